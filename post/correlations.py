"""Time correlations, diffusion coefficient and structure functions of a fluid.

    python post/correlations.py runs/state/memory_*.h5 -o correlations.png --csv correlations.csv

Runs with the same packing fraction are combined.  Frames are equally or logarithmically spaced in
time; use --equilibration 0 if a run begins in equilibrium.  Times are in units of the mean free
time 1/w, lengths in mean diameters.  A gas that cools or flows has no time correlations but a2.

panels
  vacf, tail    velocity autocorrelation, linear and logarithmic, with exp(-w t) and the tail 1/t
  msd, D        mean square displacement, and D(t) by displacements and by velocities
  F_s, alpha2   self-intermediate scattering function, non-Gaussian parameter
  a2            second Sonine coefficient of the velocities against collisions per disk
  g, S, g6      pair correlation, structure factor, correlation of bond orientations

table (a row for each packing fraction)
  D_time                        lag of the diffusion coefficients [1/w]: the time in which sound
                                crosses the box, at most an eighth of the run
  D_displacement, D_velocities  means over the lags from D_time / 2 to D_time; they must agree
  D_displacement_NAME, ...      the same for each species of a mixture
  psi6_local, psi6_global       mean modulus and modulus of the mean of psi6 (1: crystal)
  D_enskog, g_first_bin         Enskog's coefficient (_NAME: of a species), g(r) at contact
  --csv: all curves, also the overlap (share of disks within 0.3 diameters of their first place)

refuses
  gravity, obstacles, less than three disks or ten frames

see also
  transport.py (viscosities), docs/explanation/statistics.md (errors), ricochet.correlations
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("correlations", __doc__)


if __name__ == "__main__":
    launch(main)
