"""Speedup of runs on several processor cores.

    build/ricochet gas.nml -o runs/t2_1.h5 --set run.threads=2
    python post/scaling.py runs/t*.h5 -o scaling.png --csv scaling.csv

The wall times of complete runs that differ only in run.threads are compared.

panels
  speedup    median, smallest and largest speedup against the number of threads

table (a row for each number of disks and of threads)
  seconds                      median of the wall times
  gain, gain_least, gain_most  median, smallest and largest speedup, relative to the median time
                               with one thread

refuses
  unfinished runs, no run with one thread

see also
  cost.py (one core); runs/scaling.sh performs the runs
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("scaling", __doc__)


if __name__ == "__main__":
    launch(main)
