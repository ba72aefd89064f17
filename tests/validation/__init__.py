"""Physics validation behind `make check`: tables of cases with published or exact references.

A case consists of the inputs of its runs, a pure function that measures a value in these runs, the
reference value, the tolerance, and the source of the reference. `python tests/validate.py` runs all
cases and writes the report docs/explanation/validation.md.
"""

from importlib import import_module

TABLES = "few_disks speeds equilibrium dissipation crater gravity billiards symmetry diffusion"
TABLES += " driven kicked recycled sheared moved relaxed"  # in the order of the report
CASES = [case for name in TABLES.split() for case in import_module(f"validation.{name}").CASES]
