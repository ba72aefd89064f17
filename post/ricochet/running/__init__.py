"""Simulations: the program, the engine in memory, sweeps of many runs, and starting files."""
