"""Viscosities, thermal conductivity and diffusion coefficient, compared with Enskog's theory.

    python post/transport.py runs/driven/transport_*/*.h5 -o transport.png --csv transport.csv

Runs with equal packing fraction are combined.  They need the Helfand moments (output.helfand) and
about four samples of the observables per mean free time; D needs frames at equal times.  A
viscosity or the conductivity is half of the slope of the mean square change of a Helfand moment
against the lag; D is half of the integral of <v(0) v(s)>.  A fixed total energy reduces the
coefficients by 2 to 6 over N (docs/explanation/laws.md).

panels
  viscosity, conductivity, bulk_viscosity, D    coefficient over Enskog's against the lag
  all                                           means over the lags, against the packing fraction

table (a row for each packing fraction and coefficient)
  value, enskog, unit    mean over the lags from t/2 to t, Enskog's value (Gass 1971; mixtures:
                         Lopez de Haro, Cohen and Kincaid 1983), unit of both; t is 20 mean free
                         times, and for D the time in which sound crosses the box
  ratio                  value / enskog

refuses
  walls, inelastic disks, driving, runs without Helfand moments or shorter than eight collisions

see also
  correlations.py (D of species), driven.py --show viscosity (shear)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("transport", __doc__)


if __name__ == "__main__":
    launch(main)
