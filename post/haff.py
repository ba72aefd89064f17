"""Cooling of a gas of inelastic disks, compared with Haff's law.

    python post/haff.py runs/haff/*.h5 -o haff.png --csv haff.csv

Runs with the same coefficient of restitution xi are combined.  The laws hold while the gas is
homogeneous and its species have one temperature.  Let tau be the number of collisions per disk.
The homogeneous state ends when the cooling rate -d ln K / d tau stays below 90 % of the predicted
rate.

panels
  time, collisions                kinetic energy K against time in mean free times 1/w0, with Haff's
                                  law, and against tau, with an exponential law
  time_ratio, collisions_ratio    K divided by these laws; pale where no longer homogeneous

first table (a row for each restitution, after 5, 10 and 20 collisions per disk)
  energy_left, expected    K / K0 (K0: initial energy) and its prediction

second table (a row for each restitution)
  rate                 linear fit to ln K from tau = 2 to half of the homogeneous state
  exponent             for viscoelastic disks instead of the rate: p of K ~ t^-p in the last decade
  expected             prediction of the rate or the exponent
  homogeneous_until    tau at the end of the homogeneous state (-: homogeneous to the end)

refuses
  walls, obstacles, driving, rotation, elastic disks, mixtures of viscoelastic disks

see also
  cooling.py (mixtures), rough.py (rotation), docs/explanation/laws.md (viscoelastic disks)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("haff", __doc__)


if __name__ == "__main__":
    launch(main)
