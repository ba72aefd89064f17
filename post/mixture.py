"""Speeds and energies of each species of a mixture, initially and in equilibrium.

    python post/mixture.py runs/mixture/*.h5 -o mixture.png --csv mixture.csv

All runs are combined.  The theory predicts <K> = kT and <v> = sqrt(pi kT / 2 m).  In a periodic box
<K> is smaller than kT by the fraction m / M, where M is the total mass of the disks.  If the
kinetic energy is conserved, kT is known exactly; otherwise it is measured.

panels (two for each species)
  SPECIES_start          histogram of the speeds at the start
  SPECIES_equilibrium    the same in equilibrium, with Maxwell's law and the mean values

table (a row for each species)
  v_start, K_start          mean speed and kinetic energy at the start
  v, K, kT_x, kT_y          mean speed, kinetic energy and components of kT in equilibrium
  v_theory, K_theory        predictions
  speeds, law, KS_D, KS_p   number of independent speeds, Kolmogorov-Smirnov test and its p-value

refuses
  fewer than two species or three disks, species that have not collided with each other, inelastic
  collisions, and other runs in which the species do not reach a common temperature

see also
  speeds.py (reduced speeds), docs/explanation/statistics.md (errors and tests)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("mixture", __doc__)


if __name__ == "__main__":
    launch(main)
