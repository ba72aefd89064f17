"""Theoretical formulas for comparison with measured values; none of them reads a run."""
