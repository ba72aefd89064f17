"""Discharge rate of a refilled hopper against the width of its mouth, with Beverloo's law.

    python post/discharge.py runs/hopper/*.h5 -o discharge.png --csv discharge.csv

The mouth is the shortest gap between the ends of two straight walls, and D is its width.  In two
dimensions Beverloo's law is W = C sqrt(g / d) (D / d - k)^(3/2), with the mean diameter d of the
disks.  It applies to rough disks.

panels
  rate         W sqrt(d / g) against D / d with the fit of C and k
  power_law    the same against D / d - k on logarithmic axes; dashed: fit of the exponent, k = 1.4
  count, rate  number and rate of recycled disks against time, if all runs have the same width

first table (a row for each width)
  D_over_d     width D / d
  W, samples   recycled disks per unit time after --after, number of independent samples
  W_reduced    W sqrt(d / g)

second table (from three widths on)
  C, k         fit of Beverloo's law
  exponent     fitted exponent for k = 1.4, the value of Beverloo et al. (1961) in three dimensions

Random radii (polydispersity) differ between seeds, and so does W.  The errors are then estimated
from the scatter of several seeds.

refuses
  runs without a mouth, without recycled disks (drive.kind = 'recycle') or without gravity

see also
  docs/guides/flows-of-grains.md; Beverloo, Leniger, van de Velde, Chem. Eng. Sci. 15, 260 (1961)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("discharge", __doc__)


if __name__ == "__main__":
    launch(main)
