"""Coverage of the error bars: fraction of error bars that contain the true value.

    python post/coverage.py runs/coverage/*/*.h5 -o coverage.png --csv coverage.csv

Runs at one packing fraction differ only in their seed.  The compressibility factor Z is calculated
from the virial, and its mean over all runs counts as the true value.  Correct error bars contain
the true value in 68 % of the runs.

panels
  packing1, packing2, ...    Z of single runs with their errors

table (a row for each packing fraction)
  Z, scatter                   mean and standard deviation of Z over the runs
  error, within_%              mean error, coverage
  naive_error, naive_within_%  the same, calculated as if all samples were independent

refuses
  fewer than ten seeds, gravity, obstacles, inelastic disks

see also
  equation_of_state.py, docs/explanation/statistics.md
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("coverage", __doc__)


if __name__ == "__main__":
    launch(main)
