"""Divergence of trajectories that start close together, and the Lyapunov exponent.

    python post/lyapunov.py runs/pairs/*.h5 -o lyapunov.png --csv lyapunov.csv

The first two runs form a pair, the next two another, and so on.  Both runs of a pair start almost
at the same point and have frames at the same times.  The distance within a pair grows from one
fixed value to another.  The exponent is the growth of the logarithm of the distance, divided by the
mean time of this growth (Aurell and others, J. Phys. A 30, 1 (1997)).  A mean slope in a fixed
interval of time would be too small, by 3 % in Sinai's billiard.

panels
  distances    distance of each pair (Euclidean), geometric mean, fitted growth

table (one row)
  pairs, from, to      number of pairs, mean times at which the growth begins and ends
  lyapunov_exponent    exponent [1/time], with its error from the jackknife over the pairs

--csv FILE writes the distances of all pairs against time.

refuses
  an odd number of runs, different disks or times in a pair, cooling gases

see also
  trajectory.py, docs/guides/billiards.md
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("lyapunov", __doc__)


if __name__ == "__main__":
    launch(main)
