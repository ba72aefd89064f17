"""Web servers and worker processes for the pages that show running simulations."""
