"""Fraction of collisions that time-stepped simulations fail to detect.

    python post/missed.py runs/rates_events/*.h5 runs/rates_steps/*.h5 -o missed.png

Event-driven and time-stepped runs with equal seeds are compared in equilibrium.  A time step dt
detects an overlap only at its end.  The expected fraction is the mean probability P(q), with
q = g dt / s, that a pair with relative speed g and sum of radii s separates within the step.

panels
  missed    missed fraction against dt, with the expectation

table (a row for each time step; the first is the event-driven method)
  runs, kT, rate      pairs of runs, temperature [energy], pair collisions per disk and time
  missed_percent      missed fraction; one pair: error from the fluctuations in time
  expected_percent    expectation

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
