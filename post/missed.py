"""Fraction of collisions that time-stepped simulations fail to detect.

    python post/missed.py runs/gravity/rates/*.h5 -o missed.png --csv missed.csv

The script requires event-driven runs and time-stepped runs with the same seeds.  For each time step
dt the script calculates the fraction of missed pair collisions, relative to the number of pair
collisions in the event-driven run with the same seed.  The first X collisions per disk, where X is
the value of --equilibration, are not counted, and the fraction is averaged over the seeds.  The
script compares the measured fraction with the predicted fraction P, which is derived below.  If
there is only one pair of runs, the error is determined from the fluctuations of the two collision
rates in time.  For small time steps the fluctuations of the collision rates are larger than the
fraction of missed collisions; therefore runs with several seeds are required.

Two disks of diameter s with the relative speed g and the impact parameter b would overlap along a
chord of length 2 l, where l = sqrt(s^2 - b^2).  The two disks approach each other only along the
first half of the chord, for the time l / g.  An overlap that is detected after the time l / g is
ignored, because the disks are already separating.  The time between the first contact and the next
time step is random.  Therefore the probability that a collision is missed is 1 - l / (g dt), or 0
if this expression is negative.  The impact parameter b is distributed uniformly between -s and s.
With q = g dt / s, the mean probability that a collision is missed is given by the following
formula:

    P(q) = 1 - sqrt(1 - q^2) - (asin q - q sqrt(1 - q^2)) / (2 q)    for q < 1,
    P(q) = 1 - pi / (4 q)                                            beyond; q^2 / 6 for small q.

The probability density of the relative speeds of colliding pairs is proportional to g^2 exp(-mu g^2
/ 2 kT), where mu is the reduced mass.  The collision rate of disks of species i with disks of
species j is proportional to N_i N_j / (h_i + h_j) / sqrt(mu), where h_i and h_j are scale heights.
In a gravitational field of acceleration a, species i has the scale height h_i = kT / (m_i a).
"""

from itertools import combinations_with_replacement
from math import comb

from ricochet import Run, RunError
from ricochet.analysis.statistics import Estimate, SeriesMean, correlated_mean, estimate
from ricochet.analysis.equilibrium import start_of_equilibrium
from ricochet.analysis.thermodynamics import kinds_of_disks, temperature
from ricochet.figures.drawing import COLOURS, caption, plt
from ricochet.script import command_line, grouped, launch, measured, report

import numpy as np

SPEEDS = np.linspace(0, 12, 2001)  # in units of sqrt(kT / mu)


def missed_share(q: np.ndarray) -> np.ndarray:
    """Return P(q), the mean probability that a collision is missed, where q = g dt / s."""
    q = np.asarray(q, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        short = np.minimum(q, 1)
        root = np.sqrt(1 - short**2)
        below = 1 - root - (np.arcsin(short) - short * root) / (2 * short)
        share = np.where(q < 1, below, 1 - np.pi / (4 * q))
    return np.where(q < 1e-3, q**2 / 6, share)


def expected_share(run: Run, step: float, temperature: float) -> float:
    """Return the mean probability of missing a collision in a dilute gas in equilibrium."""
    shares, rates = [], []
    pull = float(np.linalg.norm(run.gravity))
    for a, b in combinations_with_replacement(kinds_of_disks(run), 2):
        reduced, diameter = a.mass * b.mass / (a.mass + b.mass), a.radius + b.radius
        pairs = comb(a.disks.sum(), 2) if a is b else a.disks.sum() * b.disks.sum()
        height = temperature / pull * (1 / a.mass + 1 / b.mass) if pull else 1.0
        rates.append(pairs * diameter / np.sqrt(reduced) / height)
        q = np.sqrt(temperature / reduced) * SPEEDS * step / diameter
        shares.append(np.average(missed_share(q), weights=SPEEDS**2 * np.exp(-(SPEEDS**2) / 2)))
    return float(np.average(shares, weights=rates))


def rate_and_temperature(run: Run, skip: float | None) -> tuple[SeriesMean, float]:
    """Return the number of pair collisions per disk and unit of time, and kT, in equilibrium."""
    time, tau = run.collisions_per_disk
    first = int(np.searchsorted(time, start_of_equilibrium(run, skip)))
    if first >= len(time) - 1:
        raise RunError(f"{run.path}: needs two samples of the observables in equilibrium")
    rate = correlated_mean(np.diff(tau[first:]), np.diff(time[first:]))
    return rate, temperature(run, skip).mean


def missed_of_pairs(rates: list[SeriesMean], exact: list[SeriesMean]) -> Estimate:
    """Return the fraction of missed collisions, determined from pairs of runs with equal seeds.

    The error is determined from the scatter of the results of the pairs of runs.  For a single pair
    of runs, the error is determined from the fluctuations of the collision rates of both runs.
    """
    shares = [1 - one.mean / other.mean for one, other in zip(rates, exact, strict=True)]
    if rates == exact:
        return Estimate(0.0, 0.0)
    if len(shares) > 1:
        return estimate(shares)
    relative = [one.error / one.mean for one in (rates[0], exact[0])]
    return Estimate(shares[0], float((1 - shares[0]) * np.hypot(*relative)))


def compare(runs: list[Run], skip: float | None) -> list[dict]:
    """Return a table row for the event-driven runs (dt = 0) and for each time step, in percent."""
    groups = grouped(runs, lambda run: run.time_step)
    if groups[0][0] != 0 or len(groups) < 2:
        raise RunError("event-driven and time-stepped runs are required")
    exact = {run.seed: rate_and_temperature(run, skip)[0] for run in groups[0][1]}
    rows = []
    for step, members in groups:
        pairs = [run for run in members if run.seed in exact]
        if not pairs:
            raise RunError(f"no seed of dt = {step:g} has an event-driven run")
        rates, temperatures = zip(*(rate_and_temperature(run, skip) for run in pairs), strict=True)
        rate = rates[0] if len(rates) == 1 else estimate([one.mean for one in rates])
        share = missed_of_pairs(list(rates), [exact[run.seed] for run in pairs])
        kt = float(np.mean(temperatures))
        row = {"dt": step, "runs": len(pairs), **measured("kT", estimate(temperatures))}
        row |= measured("rate", rate)
        row |= measured("missed_percent", Estimate(*(100 * part for part in share)))
        rows.append(row | {"expected_percent": 100 * expected_share(pairs[0], step, kt)})
    return rows


def draw(runs: list[Run], rows: list[dict]) -> plt.Figure:
    """Draw the measured and the predicted fraction of missed collisions against dt."""
    figure, axes = plt.subplots(figsize=(6.5, 4.5))
    names = ("dt", "missed_percent", "missed_percent_error")
    dt, share, error = (np.array([row[name] for row in rows[1:]]) for name in names)
    kt, size = float(np.mean([row["kT"] for row in rows[1:]])), rows[1]["runs"]
    curve = np.geomspace(dt.min() / 1.5, dt.max() * 1.5, 50)
    expected = [100 * expected_share(runs[0], step, kt) for step in curve]
    label = "expected: overlap detected after the closest approach"
    axes.plot(curve, expected, color="black", lw=1.2, label=label)
    label = f"measured, {size} pair{'s' * (size > 1)} of runs"
    style = {"ls": "", "marker": "o", "color": COLOURS[0], "capsize": 3, "label": label}
    seen = share > 0
    if seen.any():
        axes.errorbar(dt[seen], share[seen], error[seen], **style)
    above = ~seen & (share + error > 0)
    if above.any():
        style |= {"marker": "v", "label": "upper limit: mean, not above 0, plus its error"}
        axes.plot(
            dt[above], (share + error)[above], **{k: style[k] for k in style if k != "capsize"}
        )
    axes.set(xscale="log", yscale="log", title=caption(runs))
    axes.set(xlabel=runs[0].units.label("Δt", "time"), ylabel="pair collisions missed [%]")
    axes.set_xticks(dt, [f"{step:g}" for step in dt], minor=False)
    axes.set_xticks([], minor=True)
    axes.legend(loc="upper left")
    return figure


def main() -> None:
    args = command_line(__doc__, "missed.png", equilibration=None).parse_args()
    rows = compare(args.runs, args.equilibration)
    seeds = {run.seed for run in args.runs if run.time_step == 0}
    alone = ", ".join(str(run.path) for run in args.runs if run.seed not in seeds)
    notes = [f"left out, because no event-driven run has the same seed: {alone}"] if alone else []
    notes += [
        f"dt = {row['dt']:g}: the measured fraction is not above 0, and the axis is logarithmic"
        for row in rows[1:]
        if row["missed_percent"] <= 0
    ]
    report(args, draw(args.runs, rows), rows, notes=notes)


if __name__ == "__main__":
    launch(main)
