"""Time correlations, diffusion coefficient and structure functions of a fluid.

    python post/correlations.py runs/state/memory_*.h5 -o correlations.png --csv correlations.csv

Runs with the same packing fraction are combined.  Frames may be spaced equally or logarithmically
in time.  Use --equilibration 0 if a run begins in equilibrium.  Times are in units of the mean free
time 1/w, lengths in mean diameters.  For a cooling or flowing gas only a2 is calculated.

panels
  vacf, tail    velocity autocorrelation, linear and logarithmic, with exp(-w t) and the tail 1/t
  msd, D        mean square displacement, and D(t) from displacements and from velocities
  F_s, alpha2   self-intermediate scattering function, non-Gaussian parameter
  a2            second Sonine coefficient of the velocities against collisions per disk
  g, S, g6      pair correlation, structure factor, correlation of bond orientations

table (a row for each packing fraction)
  D_time                        lag of the diffusion coefficients [1/w]: the time in which sound
                                crosses the box, but at most an eighth of the run
  D_displacement, D_velocities  D from displacements and from velocities, averaged over lags from
                                D_time / 2 to D_time; both must agree
  D_displacement_NAME, ...      the same for each species of a mixture
  psi6_local, psi6_global       mean of |psi6|, and modulus of the mean psi6 (1 in a crystal)
  D_enskog, g_first_bin         Enskog's coefficient (_NAME: of a species), g(r) at contact
  --csv: all curves, and the overlap (share of disks within 0.3 diameters of an earlier position)

refuses
  gravity, obstacles, fewer than three disks or ten frames

see also
  transport.py (viscosities), docs/explanation/statistics.md (errors), ricochet.correlations
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("correlations", __doc__)


if __name__ == "__main__":
    launch(main)
