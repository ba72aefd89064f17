"""Crater size against mass, speed and radius of the projectile, and against restitution.

    python post/crater_scan.py runs/crater_scan/*.h5 -o crater_scan.png --csv crater_scan.csv

Runs that differ only in their seed form a point, and points that differ in one parameter form a
curve.  The fits are size = A x^p with equal weights, where x is the parameter or, for the
restitution xi, 1 - xi^2.  For light projectiles the numbers of disks hit and displaced have skewed
distributions; with few runs, the errors of their means are then underestimated.

panels (two for each parameter: mass, speed, radius, restitution)
  PARAMETER_numbers    disks hit and displaced
  PARAMETER_lengths    width and depth of the displaced disks and of the hole

first table (a row for each point)
  runs, hit, displaced, width, depth, hole_width, hole_depth    means, see crater.py
  energy_left, side_collisions    remaining fraction of the energy, collisions with walls
  ended_by_time                   1: stop.time was reached before stop.energy_fraction
  in_fit                          1: the point is included in the fit

second table (a row for each fit)
  exponent     exponent p; its error comes from a jackknife over the seeds if all points use the
               same seeds, otherwise from the fit
  chi2/dof     chi squared over the number of degrees of freedom

refuses
  runs without a projectile, restitution that depends on velocity

see also
  crater.py (one crater)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("crater_scan", __doc__)


if __name__ == "__main__":
    launch(main)
