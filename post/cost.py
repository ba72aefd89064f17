"""Time per collision against the number of disks, for each method of finding the next event.

    python post/cost.py runs/cost/*.h5 -o cost.png --csv cost.csv

Of several runs with the same method and number of disks N, the fastest is used.  Power laws are
fitted in the range of --fit.  Below this range the cost of the collision itself matters; above it
the disks do not fit into the caches of the processor.

panels
  cost    processor time per collision against N, with fits (dotted outside their range)

first table (a row for each method and N)
  microseconds    processor time per collision

second table (a row for each method)
  exponent        exponent of N in the fitted power law, with its standard error

refuses
  unfinished runs

see also
  scaling.py (several cores), docs/explanation/performance.md
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("cost", __doc__)


if __name__ == "__main__":
    launch(main)
