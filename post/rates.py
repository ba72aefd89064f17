"""Pressure, temperature, collision rates and free paths of a gas in equilibrium, with errors.

    python post/rates.py runs/bulk.h5 -o rates.png --csv rates.csv

Runs of one system are combined, and scaled to their mean kT if each conserves its kinetic energy.
Free paths are calculated from the event log: in each frame, the path of a disk between its
collisions before and after the frame, weighted with the inverse of its duration.  If disks lose
energy or walls have different temperatures, only free paths are analysed.

panels
  pressure      pressure from the virial and force per length of the sides, against time; for equal
                disks of radius r in a square of side L the force is larger by 1 / (1 - 2 r / L)
  free_paths    distribution of reduced free paths, compared with that for molecular chaos

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
