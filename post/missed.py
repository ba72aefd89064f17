"""Fraction of collisions missed by time-stepped simulations.

    python post/missed.py runs/rates_events/*.h5 runs/rates_steps/*.h5 -o missed.png

Event-driven and time-stepped runs with equal seeds are compared in equilibrium.  A time-stepped run
detects overlaps only at the end of a step dt, and misses the collision of a pair that separates
within the step.  For a pair with relative speed g and sum of radii s this has the probability P(q)
with q = g dt / s.  The expected fraction is the mean of P over all pairs.

panels
  missed    missed fraction against dt, with the expected fraction

table (a row for each time step; the first is the event-driven method)
  runs, kT, rate      pairs of runs, temperature [energy], pair collisions per disk and unit time
  missed_percent      missed fraction; for one pair, the error follows from fluctuations in time
  expected_percent    expected fraction

refuses
  runs of one method only, time steps without an event-driven run of the same seed

see also
  energy.py (conservation of energy)
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("missed", __doc__)


if __name__ == "__main__":
    launch(main)
