"""Theoretical formulas for comparison with measurements; they do not read runs."""
