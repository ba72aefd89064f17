"""The physics validation behind `make check`: tables of cases with published or exact references.

A case is a line: the inputs it runs, how it is measured (a pure function of the runs), the
reference, the tolerance, the source.  `python tests/validate.py` runs them; docs/validation.md is
its report.
"""

from importlib import import_module

TABLES = "few_disks speeds equilibrium dissipation crater gravity billiards symmetry diffusion"
TABLES += " driven kicked sheared moved"  # in the order of the report
CASES = [case for name in TABLES.split() for case in import_module(f"validation.{name}").CASES]
