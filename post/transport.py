"""Viscosities, thermal conductivity and diffusion coefficient, compared with Enskog's theory.

    python post/transport.py runs/driven/transport_*/*.h5 -o transport.png --csv transport.csv

Runs with equal packing fraction are combined.  They need the Helfand moments (output.helfand) with
about four samples per mean free time and, for D, frames at equal intervals.

Viscosities and conductivity: plot the mean square change of a Helfand moment against the lag; half
the slope is A kT times the viscosity, or A (kT)^2 times the conductivity (A: area of the box).  D
is half of the integral of <v(0) v(s)>.  With fixed energy and zero total momentum, the viscosities
and the conductivity of N disks are too small by a fraction of 2/N to 6/N.

panels
  viscosity, conductivity, bulk_viscosity, D    coefficient divided by Enskog's, against the lag
  all                                           means over the lags, against the packing fraction

table (a row for each packing fraction and coefficient)
  value      mean over the lags from t/2 to t; t is 20 mean free times or, for D, the time in which
             sound crosses the box
  enskog     Enskog's value (Gass 1971; mixtures: Lopez de Haro, Cohen and Kincaid 1983)
  unit       unit of both
  ratio      value / enskog

refuses
  walls, inelastic disks, driving, runs without Helfand moments, or with fewer than eight collisions
  per disk in equilibrium

see also
  correlations.py (D of species), driven.py --show viscosity (shear), docs/explanation/laws.md
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("transport", __doc__)


if __name__ == "__main__":
    launch(main)
