"""The physics validation behind `make check`: tables of cases with published or exact references.

A case is a line: the inputs it runs, how it is measured (a pure function of the runs), the
reference, the tolerance, the source.  `python tests/validate.py` runs them; docs/validation.md is
its report.
"""
