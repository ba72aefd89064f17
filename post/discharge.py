"""Discharge rate of a refilled hopper against the width of its mouth, with Beverloo's law.

    python post/discharge.py runs/hopper/*.h5 -o discharge.png --csv discharge.csv

The mouth of width D is the shortest gap between the ends of two straight walls.  Beverloo's law in
two dimensions is W = C sqrt(g / d) (D / d - k)^(3/2), with the mean diameter d; it applies to rough
disks.

panels
  rate         W sqrt(d / g) against D / d with the fit of C and k
  power_law    the same against D / d - k, logarithmic; dashed: k = 1.4, and the exponent is fitted
  count, rate  if all runs have one width: recycled disks, and their rate, against time

first table (a row for each width)
  D_over_d     width D / d
  W            recycled disks per time after --after; `samples`: independent values
  W_reduced    W sqrt(d / g)

second table (from three widths on)
  C, k         fit of Beverloo's law
  exponent     fitted with k = 1.4, which Beverloo et al. (1961) found in three dimensions

Radii drawn at random (polydispersity) differ between seeds, and W with them: the errors then follow
from the scatter of several seeds.

refuses
  runs without a mouth, recycled disks (drive.kind = 'recycle') or gravity

see also
  docs/guides/flows-of-grains.md; Beverloo, Leniger, van de Velde, Chem. Eng. Sci. 15, 260 (1961)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("discharge", __doc__)


if __name__ == "__main__":
    launch(main)
