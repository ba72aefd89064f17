"""Pressure, temperature, collision rates and free paths of a gas in equilibrium, with errors.

    python post/rates.py runs/bulk.h5 -o rates.png --csv rates.csv

Runs of one system are combined, and scaled to their mean kT if each conserves its kinetic energy.
A free path in a frame is the distance between the collisions before and after the frame, weighted
with the inverse of its duration; it requires an event log.  If disks lose energy or walls have
different temperatures, only free paths are analysed.

panels
  pressure      from the virial and from the sides against time; that on the sides is larger, for
                equal disks of radius r in a square of side L by 1 / (1 - 2 r / L)
  free_paths    distribution of reduced free paths, with the prediction for molecular chaos

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
