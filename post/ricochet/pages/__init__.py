"""Web pages of running simulations and of the laboratory: servers and worker processes."""
