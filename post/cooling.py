"""Mean kinetic energy of each species of an elastic or inelastic mixture as a function of time.

    python post/cooling.py runs/cooling/*.h5 -o cooling.png --csv cooling.csv

Runs with the same coefficient of restitution xi are combined, and lines are means over these runs.
With fewer than four runs, the scatter of single runs is estimated from the numbers of disks.

panels
  energy1, energy2, ...    energies per disk for each xi against time (more than three xi: against
                           collisions per disk); bands contain 95 % of single runs
  time, collisions         energies for all xi (more than three xi: of all disks only), divided by
                           the initial mean, against time and against collisions per disk; bands:
                           errors of the means
  ratio                    ratio of the temperatures of heaviest and lightest species

table (a row for each restitution)
  energy_left          final mean energy divided by initial mean energy
  temperature_ratio    temperature ratio at the end; 1 in equilibrium
  flow_share           share of flows in the kinetic energy; a large share means that the gas is not
                       homogeneous

--csv FILE writes all curves: relative energies against collisions per disk, and energies in units
of the input against time.

refuses
  driven, falling or heated disks, disks at rest

see also
  haff.py (equal disks and Haff's law), mixture.py (speeds)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("cooling", __doc__)


if __name__ == "__main__":
    launch(main)
