"""Mean kinetic energy of each species of an elastic or inelastic mixture against time.

    python post/cooling.py runs/cooling/*.h5 -o cooling.png --csv cooling.csv

Runs with the same coefficient of restitution xi are combined; lines are means over the runs.  With
fewer than four runs, the scatter of single runs is estimated from the numbers of disks.

panels
  energy1, energy2, ...    energies per disk for each xi; bands contain 95 % of single runs
  time, collisions         energies of all xi over the initial mean; bands: errors of the means
  ratio                    temperature ratio of the heaviest and the lightest species

table (a row for each restitution)
  energy_left          mean energy at the end over that at the start
  temperature_ratio    at the end; 1 in equilibrium
  flow_share           share of the energy in flows; if it is large, the gas is not homogeneous
  --csv: all curves, reduced against collisions per disk and in units of the input against time

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
