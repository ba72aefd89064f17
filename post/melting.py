"""Melting of hard disks: pressure against packing fraction for each number of disks.

    python post/melting.py runs/melting/*/*.h5 -o melting.png --csv melting.csv

In an infinite system the liquid and the hexatic phase coexist at P* = P d^2 / kT = 9.185 between
the packing fractions 0.700 and 0.716.  In a finite box the interface between them causes a loop of
the pressure curve, which becomes flatter as N increases.  Correlation times are long near melting:
heed the warnings about errors.

panels
  pressure    P* against the packing fraction; lines: Engel and others (2013), Li and others (2022)

table (a row for each number of disks and packing fraction)
  P          reduced pressure P* from the virial, with its standard error
  samples    effective number of independent samples

refuses
  unequal disks, walls, inelastic disks

see also
  equation_of_state.py, snapshot.py --colour psi6
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("melting", __doc__)


if __name__ == "__main__":
    launch(main)
