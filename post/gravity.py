"""Distributions of squared speed and of height under gravity, compared with exponential laws.

    python post/gravity.py runs/gravity/long.h5 -o gravity.png --csv gravity.csv

The solid lines are P(v^2) = m / (2 kT) exp(-m v^2 / 2 kT) and P(h) ~ exp(-m g h / kT), where h is
the height of a centre above its lowest position.  These laws are exact for many point particles.
The dashed lines allow for the fixed total energy of N disks and, to first order, for the area that
disks exclude.  Slopes are maximum-likelihood fits: to speeds with m v^2 / 2 up to 5 kT, and to
heights with m g h between kT and 5 kT (or up to the lid).

panels
  speeds, speeds_log      histograms of v^2 on linear and logarithmic axes
  heights, heights_log    the same for the heights

first table (a row for each species)
  kT, K, K_x                     temperature, kinetic energy and its part along x
  speed_slope, height_slope      fitted slope (jackknife errors) over slope of the solid line
  speed_shared, height_crowded   slope of the dashed line divided by the slope of the solid line
  height_fit_to                  upper end of the fit [kT / m g]

second table
  equilibrium_from, left_out_before    start of equilibrium, and the criterion that determines it

refuses
  runs without gravity along y, moving or sliding walls, driven or inelastic disks

see also
  equipartition.py (time to equilibrium), docs/tutorials/gravity.md (laws)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("gravity", __doc__)


if __name__ == "__main__":
    launch(main)
