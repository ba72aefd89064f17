"""All cases, in the order of the report."""

from . import (
    billiards,
    crater,
    diffusion,
    dissipation,
    equilibrium,
    few_disks,
    gravity,
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
)
CASES = [case for table in TABLES for case in table.CASES]
