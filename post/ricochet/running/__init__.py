"""Simulations: the program, the engine in memory, many runs at once, and starting files."""
