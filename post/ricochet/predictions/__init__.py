"""Theoretical formulas for comparison with measured values; the formulas do not read runs."""
