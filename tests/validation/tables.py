"""All cases, in the order of the report."""

from importlib import import_module

TABLES = "few_disks speeds equilibrium dissipation crater gravity billiards symmetry diffusion"
TABLES += " driven kicked sheared moved"
CASES = [case for name in TABLES.split() for case in import_module(f"validation.{name}").CASES]
