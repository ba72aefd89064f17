"""Time until two species under gravity have the same kinetic energy.

    python post/equipartition.py runs/fall/*.h5 -o equipartition.png --csv equipartition.csv

Runs with the same initial speed v0 are combined.  The mean energies of the lightest and the
heaviest species are compared in windows of time.  T_therm is the time after which they differ by
less than --within in three successive windows.  With few runs T_therm is too large: by 16 % for ten
runs of 60 disks, and by less than 1 % for 100 runs.

panels
  start1, start2, ...    energies of both species against time for each v0

table (a row for each v0)
  T_therm             thermalisation time; error: bootstrap over the runs or, for a single run, from
                      the fluctuations in time
  energy              total energy per disk in equilibrium
  K_light, K_heavy    kinetic energy per disk in equilibrium

refuses
  runs whose species do not reach a common temperature

see also
  energy.py, gravity.py (distributions in equilibrium)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("equipartition", __doc__)


if __name__ == "__main__":
    launch(main)
