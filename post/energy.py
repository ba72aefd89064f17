"""Energies as functions of time, and conservation of the total energy.

    python post/energy.py runs/gravity/events.h5 runs/gravity/steps_*.h5 -o energy.png

The conserved quantity is the total energy or, if energy is exchanged, total + dissipated - heat -
work - drive.  It changes only by rounding errors, even for large time steps, because flights and
collisions are exact.  Large time steps miss collisions instead.

panels
  total1 ... total4       total energy and its parts, for the first run with each time step
  species, logarithmic    energies per disk of each species in the first run
  changes                 largest relative change of the conserved quantity up to each time

table (a row for each run; changes relative to the total energy at the start)
  of                terms of the conserved quantity
  total_energy      total energy at the start [energy]
  drift             change of a fitted straight line over the run
  spread            standard deviation from this line
  largest_change    largest difference from the value at the start

refuses
  disks at rest, fewer than two samples of the energies

see also
  missed.py (collisions that time steps miss)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("energy", __doc__)


if __name__ == "__main__":
    launch(main)
