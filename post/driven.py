"""Quantities of driven disks as functions of time, with pictures of the disks.

    python post/driven.py runs/heated/*.h5 -o heated.png --csv heated.csv
    python post/driven.py runs/constant_pressure/*.h5 --show width -o width.png

--show temperature  kT of the velocities relative to their mean, times N / (N - 1)
--show width        width of a box with a piston (motion = 'piston')
--show share        fraction of the disks in the left half of the box
--show height       mean height of the disks of each species
--show viscosity    -P_xy / box.shear_rate, with the collisional part of the stress
--show cluster      fraction of the disks in the largest cluster (gaps below a tenth of a diameter)

panels
  curves              a line for each run; dashed: theory
  picture1 ...        first and last frame of one input, last frames of two or three inputs

table (a row for each input and species; "heavy / light": ratio of their temperatures)
  late, samples       mean over the second half (share: in the fuller half); independent samples
  kT_x, kT_y          components of the temperature [energy]
  deviation           standard deviation of the width; theory_deviation: predicted value
  enthalpy_change, momentum_change    largest relative changes of the conserved quantities
  loss                energy lost per collision / value for independent velocities (white noise)
  theory, ratio       predicted value of `late`, and late / theory

theories (for equal disks)
  temperature         white noise, independent velocities (van Noije and Ernst 1998)
  temperature         elastic disks: adiabat of a slowly moving side
  share               dilute gas in two chambers (after Eggers 1999)
  width               elastic disks: mean width at constant enthalpy

refuses
  runs with one frame, --show width without a piston, --show viscosity without shear

see also
  fields.py (profiles), energy.py (balance), docs/explanation/theory.md, docs/guides/pistons.md
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("driven", __doc__)


if __name__ == "__main__":
    launch(main)
