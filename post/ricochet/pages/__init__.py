"""Web servers and worker processes of the pages that show running simulations."""
