"""All cases, in the order of the report."""

from . import (
    billiards,
    crater,
    diffusion,
    dissipation,
    driven,
    equilibrium,
    few_disks,
    gravity,
    kicked,
    moved,
    sheared,
    speeds,
    symmetry,
)

TABLES = (
    few_disks,
    speeds,
    equilibrium,
    dissipation,
    crater,
    gravity,
    billiards,
    symmetry,
    diffusion,
    driven,
    kicked,
    sheared,
    moved,
)
CASES = [case for table in TABLES for case in table.CASES]
