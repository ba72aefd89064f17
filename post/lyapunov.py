"""Divergence of initially close trajectories, and the Lyapunov exponent.

    python post/lyapunov.py runs/pairs/*.h5 -o lyapunov.png --csv lyapunov.csv

Successive runs in the given order are pairs with almost the same start and frames at the same
times.  The exponent lambda is the mean growth of the logarithm of the distance between two fixed
distances over the mean time of this growth (Aurell and others, J. Phys. A 30, 1 (1997)).  A mean
slope in a fixed interval of time would be too small, by 3 % in Sinai's billiard.

panels
  distances    Euclidean distance of each pair, geometric mean, fitted growth

table (one row)
  pairs, from, to      number of pairs, mean times at which the growth begins and ends
  lyapunov_exponent    [1/time], with its error from the jackknife over the pairs
  --csv: distances of all pairs against time

refuses
  an odd number of runs, different disks or times in a pair, gases that cool

see also
  trajectory.py, docs/guides/billiards.md
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("lyapunov", __doc__)


if __name__ == "__main__":
    launch(main)
