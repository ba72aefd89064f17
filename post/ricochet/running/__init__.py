"""Simulations: the program, the engine in memory, sweeps, and initial-configuration files."""
