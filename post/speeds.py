"""Speed distributions in the first frame, in the last frame and in equilibrium.

    python post/speeds.py runs/gas/*.h5 -o speeds.png --csv speeds.csv

Runs with the same number of disks N are combined.  Speeds are reduced to u = v / sqrt(2 kT / m),
for which Maxwell's law is P(u) = 2 u exp(-u^2) for any mass.  Equilibrium begins when no observable
drifts any longer.  While kT changes, each frame is scaled with its own kT.

panels
  start, end    histograms of one frame of the first run with the largest N
  late          histograms of all frames in equilibrium, with standard errors
  relaxation    second Sonine coefficient a2 against collisions per disk

table (a row for each N and species)
  runs ... independent    numbers of runs, frames, speeds and independent speeds
  kT, kT_x, kT_y          temperature and its components [energy]
  kT_first, kT_last       temperature in the first and in the last frame used
  mean_u, kurtosis, a2    <u>; <u^4> (Maxwell: 2); <v^4> / (2 <v^2>^2) - 1 (Maxwell: 0)
  law                     law of the tests: Maxwell, or fixed_energy (N disks share a fixed energy)
  KS_D, KS_p              Kolmogorov-Smirnov test: distance and p-value
  chi2/dof, chi2_p        chi-square test, with its p-value

refuses
  fewer than three disks, disks at rest, sliding surfaces, runs that differ in kind

see also
  mixture.py (unscaled speeds of each species), docs/explanation/statistics.md (tests)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("speeds", __doc__)


if __name__ == "__main__":
    launch(main)
