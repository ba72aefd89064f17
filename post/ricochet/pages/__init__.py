"""Web pages of a running simulation and of the laboratory: their servers and workers."""
