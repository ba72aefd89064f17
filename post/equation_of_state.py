"""Equation of state Z = P / (n kT) of hard disks against packing fraction, by three methods.

    python post/equation_of_state.py runs/state/eta_*.h5 -o state.png --csv state.csv

Runs with equal packing fraction are combined.  Errors include the autocorrelation of the pressure.
Z from the walls refers to the area accessible to the centres, and differs from the bulk value by a
fraction of about 1/sqrt(N).  Disks of many radii r are compared with the equation of Santos, Yuste
and Lopez de Haro (1999), which depends on <r>^2 / <r^2> and ends at the packing fraction 0.648.

panels
  z            Z from the virial, the collision rate (equal disks) and the walls, with references
  deviation    relative deviation from the reference

table (a row for each packing fraction)
  Z_virial, Z_rate, Z_walls    compressibility factor from each method (none, or -: does not apply)
  samples                      effective number of independent samples of the virial
  Z_reference                  published value; in a periodic box for the number of disks of the run

refuses
  gravity, inelastic disks, unequal temperatures, different distributions of radii

see also
  rates.py (one system), melting.py, coverage.py (errors)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("equation_of_state", __doc__)


if __name__ == "__main__":
    launch(main)
