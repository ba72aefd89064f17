"""Crater size against mass, speed and radius of the projectile, and against restitution.

    python post/crater_scan.py runs/crater_scan/*.h5 -o crater_scan.png --csv crater_scan.csv

Runs that differ only in their seed are combined to a point, and points that differ in one parameter
to a curve.  Fits are size = A x^p with equal weights of the points; for the restitution xi, x is
1 - xi^2.  Numbers of disks have skewed distributions for light projectiles, so that errors of means
over few runs are then too small.

panels (two for each parameter: mass, speed, radius, restitution)
  PARAMETER_numbers    disks hit and displaced
  PARAMETER_lengths    width and depth of the displaced disks and of the hole

first table (a row for each point)
  runs, hit, displaced, width, depth, hole_width, hole_depth    means, see crater.py
  energy_left, side_collisions    fraction of the energy, collisions with walls
  ended_by_time, in_fit           1: stop.time was reached; 1: the point is fitted

second table (a row for each fit)
  exponent, chi2/dof    error: jackknife over beds with common seeds, else from the points

refuses
  no projectile, restitution that depends on velocity

see also
  crater.py (one crater)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("crater_scan", __doc__)


if __name__ == "__main__":
    launch(main)
