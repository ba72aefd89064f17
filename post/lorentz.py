"""Diffusion of a tracer among fixed, randomly placed circles (random Lorentz gas).

    python post/lorentz.py runs/lorentz/runs/*.h5 -o lorentz.png --csv lorentz.csv

Each run contains one disk in a periodic box with equal circles, and frames at equal intervals.
Runs with the same reduced density n R^2 are combined, where R is the sum of the radii of disk and
circle.  The Boltzmann equation predicts D_0 = 3 v / (16 n R).  The density expansion of van Leeuwen
and Weijland (Physica 36, 457 (1967); 38, 35 (1968)) is quoted from memory:
D_0/D = 1 - (4/3) nR^2 ln(nR^2) - 0.8775 nR^2 + 4.519 (nR^2 ln(nR^2))^2.

panels
  diffusion    D / D_0 against the density, with both versions of the expansion

table (a row for each density)
  diffusion                       D / D_0; D is a quarter of the slope of the mean square
                                  displacement between the two --lags, where it is nearly constant
  free_time                       mean free time divided by its exact value 1 / (2 n R v)
  expansion, without_last_term    predictions of D / D_0

refuses
  several disks, walls, different circles, too few frames

see also
  scatterers.py (files of circles), trajectory.py, docs/guides/billiards.md
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("lorentz", __doc__)


if __name__ == "__main__":
    launch(main)
