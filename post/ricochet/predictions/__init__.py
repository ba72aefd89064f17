"""Formulas of theory that measured values are compared with; none of them reads a run."""
