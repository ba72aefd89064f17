"""Pressure, temperature, collision rates and free paths of a gas in equilibrium, with errors.

    python post/rates.py runs/bulk.h5 -o rates.png --csv rates.csv

Runs of one system are combined.  If each run conserves its kinetic energy, its results are scaled
to the mean kT of all runs.  Free paths are calculated from the event log.  In each frame, a disk is
on the path between its last collision before the frame and its next collision.  This path is
weighted with the inverse of its duration, because long paths contain more frames.  If disks lose
energy or walls have different temperatures, only free paths are analysed.

panels
  pressure      pressure from the virial and force per length of the sides, against time; for equal
                disks of radius r in a square of side L the force is larger by 1 / (1 - 2 r / L)
  free_paths    distribution of reduced free paths, and the prediction of molecular chaos

table (a row for each quantity)
  mean, error    mean in equilibrium and its standard error, or `exact`
  samples        effective number of independent samples

refuses
  gravity, obstacles, different systems, driven disks without steady pressure

see also
  equation_of_state.py (several packing fractions), correlations.py
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("rates", __doc__)


if __name__ == "__main__":
    launch(main)
