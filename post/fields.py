"""Density, flow velocity, temperature, stress and heat flux as functions of position.

    python post/fields.py runs/fourier/*.h5 --across x -o fourier.png --csv fourier.csv
    python post/fields.py runs/leidenfrost.h5 --grid 12,24 -o rolls.png

Values are averages over the disks whose centres are in a cell, over all frames of the steady state
and all runs.  c = v - u is the velocity of a disk relative to the mean flow velocity u.

panels
  density, flow, temperature    with Enskog's theory for equal disks between two walls (dashed)
  stress, heat                  kinetic parts, without the parts that collisions transfer
  with --grid: density, temperature, and flow on the stream function (arrows, contour lines)

table (a row for each cell)
  x, y                     midpoint of the part of the cell that disk centres can reach
  density                  disks per area accessible to their centres
  flow_x, flow_y           u, the mass-weighted mean of v; flow_significant: 1 if it differs from 0
  temperature, kT_x, kT_y  means of m c^2 / 2, m c_x^2, m c_y^2; rotational_temperature: I omega^2
  stress_.., heat_..       sums of m c_a c_b and of m c^2 c / 2, per area (stress: only with --csv)
  .._expected              values predicted from the fluxes of momentum and energy at the walls
  stream_function          psi with j_x = d psi / dy, j_y = -d psi / dx

further tables
  pressure_flux, shear_flux, energy_flux    fluxes measured at the walls
  kT_of_.., flow_of_..                      of the wall, and predicted for the gas next to it

refuses
  sides that leave their initial position, fewer than three frames in the steady state

see also
  driven.py (time series), docs/explanation/statistics.md (errors), docs/guides/flows-of-grains.md
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("fields", __doc__)


if __name__ == "__main__":
    launch(main)
