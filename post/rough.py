"""Cooling of rough disks: translational and rotational temperature, compared with theory.

    python post/rough.py runs/rough.h5 -o rough.png --csv rough.csv

The theory assumes Maxwell's distribution of velocities (Luding et al. 1998).  Direct simulations of
the Boltzmann equation yield a ratio T_rot / T that is up to 6 % smaller.  Flows that develop in the
cooling gas reduce the ratio further, by 3.8 to 4.6 % at a packing fraction of 0.02 and by 0.3 to
0.5 % at 0.0025.

panels
  temperatures    T = m <v^2> / 2 and T_rot = I <omega^2> against collisions per disk
  ratio           T_rot / T with both predictions

table (one row)
  ratio                    T_rot / T in the steady state
  maxwellian, boltzmann    predictions of both theories (-: not known)

refuses
  smooth disks, walls, driving, mixtures, Coulomb friction, runs with different contact laws

see also
  haff.py (smooth disks), docs/explanation/laws.md
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("rough", __doc__)


if __name__ == "__main__":
    launch(main)
