"""Scattering angle against impact parameter, compared with the exact result.

    python post/scattering.py runs/scattering/*.h5 -o scattering.png --csv scattering.csv

Each run contains two disks, one of them at rest at the start.  The impact parameter b is positive
if the moving disk passes on the left, and R12 is the sum of the radii.  M is the mass of the
resting disk divided by the mass of the moving disk, and xi is the restitution.  The exact angle
theta is given by tan theta = 2 kappa s c / (1 - 2 kappa c^2) with s = b / R12, c^2 = 1 - s^2 and
kappa = (1 + xi) / 2 * M / (1 + M).

panels
  angles    scattering angle against b / R12, with the exact law
  errors    deviation of the angles from the exact law

table (a row for each run)
  b_over_R12                       reduced impact parameter
  angle_degrees, exact_degrees     angle between the first and the last velocity, exact angle
  error_degrees, speed_change      deviation of the angle, relative change of the speed

refuses
  other than two disks, two moving disks, rotation, gravity, driving

see also
  trajectory.py (paths)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("scattering", __doc__)


if __name__ == "__main__":
    launch(main)
