"""Fraction of collisions missed by time-stepped simulations."""

from itertools import combinations_with_replacement
from math import comb
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...analysis.equilibrium import start_of_equilibrium
from ...analysis.estimates import Estimate, estimate
from ...analysis.statistics import SeriesMean, correlated_mean
from ...analysis.thermodynamics import kinds_of_disks, temperature
from ...figures.drawing import COLOURS, caption, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...reading.reader import Run, RunError
from ..groups import Group, grouped
from ..options import shared
from ..registry import Analysis
from ..result import Result
from ..tables import measured

SPEEDS = np.linspace(0, 12, 2001)  # relative speeds [sqrt(kT / mu)]


def missed_share(q: np.ndarray) -> np.ndarray:
    """Return P(q), the mean probability of missing a collision, where q = g dt / s."""
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
    """Return the equilibrium values of the pair-collision rate per disk and of kT."""
    time, tau = run.collisions_per_disk
    first = int(np.searchsorted(time, start_of_equilibrium(run, skip)))
    if first >= len(time) - 1:
        raise RunError(f"{run.path}: needs two samples of the observables in equilibrium")
    rate = correlated_mean(np.diff(tau[first:]), np.diff(time[first:]))
    return rate, temperature(run, skip).mean


def missed_of_pairs(rates: list[SeriesMean], exact: list[SeriesMean]) -> Estimate:
    """Return the fraction of missed collisions from pairs of runs with equal seeds.

    The error is estimated from the scatter of the pairs or, for a single pair, from the
    fluctuations of both rates in time.
    """
    shares = [1 - one.mean / other.mean for one, other in zip(rates, exact, strict=True)]
    if rates == exact:
        return Estimate(0.0, 0.0)
    if len(shares) > 1:
        return estimate(shares)
    relative = [one.error / one.mean for one in (rates[0], exact[0])]
    return Estimate(shares[0], float((1 - shares[0]) * np.hypot(*relative)))


def compare(runs: list[Run], skip: float | None) -> list[dict[str, Any]]:
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


def draw_missed(axes: plt.Axes, result: Result) -> None:
    """Plot the measured and the predicted fraction of missed collisions against dt."""
    run, rows = result.runs[0], result.table[1:]
    names = ("dt", "missed_percent", "missed_percent_error")
    dt, share, error = (np.array([row[name] for row in rows]) for name in names)
    kt, size = float(np.mean([row["kT"] for row in rows])), rows[0]["runs"]
    curve = np.geomspace(dt.min() / 1.5, dt.max() * 1.5, 50)
    expected = [100 * expected_share(run, step, kt) for step in curve]
    label = "expected: overlap detected after the closest approach"
    axes.plot(curve, expected, color="black", lw=1.2, label=label)
    style = {"ls": "", "marker": "o", "color": COLOURS[0]}
    seen = share > 0
    if seen.any():
        label = f"measured, {size} pair{'s' * (size > 1)} of runs"
        axes.errorbar(dt[seen], share[seen], error[seen], label=label, capsize=3, **style)
    above = ~seen & (share + error > 0)
    if above.any():
        style |= {"marker": "v", "label": "upper limit: mean, not above 0, plus its error"}
        axes.plot(dt[above], (share + error)[above], **style)
    axes.set(xscale="log", yscale="log")
    axes.set(xlabel=run.units.label("Δt", "time"), ylabel="pair collisions missed (%)")
    axes.set_xticks(dt, [f"{step:g}" for step in dt], minor=False)
    axes.set_xticks([], minor=True)
    legend_above(axes)


def draw(result: Result) -> Sheet:
    """Plot the fraction of missed collisions."""
    return Sheet([[Panel("missed", draw_missed, (result,), aspect=0.65)]], caption(result.runs))


def by_step(runs: list[Run]) -> list[tuple[float, list[Run]]]:
    """Group runs with the same time step."""
    return grouped(runs, lambda run: run.time_step)


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Compare the collision rates of event-driven and time-stepped runs with equal seeds."""
    runs = groups[0].runs
    rows = compare(runs, options.equilibration)
    seeds = {run.seed for run in runs if run.time_step == 0}
    alone = ", ".join(str(run.path) for run in runs if run.seed not in seeds)
    reason = "left out, because no event-driven run has the same seed"
    warnings = [f"{reason}: {alone}"] if alone else []
    warnings += [
        f"dt = {row['dt']:g}: the measured fraction is not above 0, and the axis is logarithmic"
        for row in rows[1:]
        if row["missed_percent"] <= 0
    ]
    notes = ["Bars: standard errors of the mean over pairs of runs with equal seeds."]
    return Result(rows, notes=notes, warnings=warnings)


ANALYSIS = Analysis(compute, draw, options=(shared("equilibration"),), averages=by_step)
