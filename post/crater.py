"""Impact of a projectile: pictures before and after the impact, energy, and crater size.

    python post/crater.py runs/crater.h5 -o crater.png
    python post/crater.py runs/scan/*.h5 --csv craters.csv     sizes of many runs, no figure

The projectile is the species 'projectile' or the only disk that moves at the start; all other disks
are the bed.

panels
  before, after    bed at the start and at the end, with the displacement of each disk
  collisions       number of collisions of each disk
  energy           remaining kinetic energy and number of collisions against time

table (a row for each run)
  hit, displaced            number of disks that collided, and that moved by more than their radius
  width, depth              extent of the displaced disks, depth below the surface
  hole_width, hole_depth    extent of the region with less than half the packing fraction of the bed
  energy_left               remaining fraction of the initial energy
  ended_by_time             1: the run ended before stop.energy_fraction was reached
  box_takes_part            1: wall collisions exceed 1 % of the number of disks

refuses
  runs without a projectile, beds that move without one

see also
  crater_scan.py (sizes against parameters)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("crater", __doc__)


if __name__ == "__main__":
    launch(main)
