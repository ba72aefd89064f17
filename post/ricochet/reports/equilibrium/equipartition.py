"""Time until two species under gravity have the same kinetic energy."""

from collections.abc import Callable
from functools import reduce
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from ...analysis.equilibrium import relaxed_start
from ...analysis.estimates import (
    ONE_SIGMA,
    Estimate,
    estimate,
    propagate_error,
    rounded_to_error,
    student,
)
from ...analysis.statistics import windows
from ...analysis.thermodynamics import lightest_and_heaviest
from ...figures.drawing import caption, colours, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...reading.nature import SETTLED, allow
from ...reading.reader import Run
from ..groups import Group, grouped
from ..options import Option, shared
from ..registry import Analysis
from ..result import Result
from ..tables import measured

RESAMPLED = 400  # bootstrap samples of the runs


class Approach(NamedTuple):
    """Kinetic energies of two species in consecutive time windows."""

    time: np.ndarray  # (W,) centres of the windows
    light: Estimate  # (W,)
    heavy: Estimate
    gap: Estimate  # (W,) heavy / light - 1
    thermalisation: Estimate  # NaN if the energies never agree, or if the error is too large


def entry(time: np.ndarray, gap: np.ndarray, within: float = 0.1, lasting: int = 3) -> float:
    """Return the interpolated time at which an energy difference (W,) falls below `within`.

    The difference must stay below `within` for at least `lasting` windows.
    """
    close = gap <= within
    for k in range(len(time) - lasting + 1):
        if close[k : k + lasting].all():
            both = [k, max(k - 1, 0)]
            return float(np.interp(within, gap[both], time[both]))
    return float("nan")


def approach(runs: list[Run], width: float, within: float) -> Approach:
    """Return the mean energies of the lightest and the heaviest species in each time window."""
    both = []
    for kind in lightest_and_heaviest(runs[0]):
        name = runs[0].names[kind]
        tracks = [windows(*run.observable(f"{name}/kinetic_energy"), width) for run in runs]
        # up to the end of the shortest run
        time = reduce(np.intersect1d, [middles for middles, _ in tracks])
        both.append(np.array([values[np.isin(middles, time)] for middles, values in tracks]))
    light, heavy = map(estimate, both)
    difference = estimate(both[1] - both[0])
    gap = Estimate(difference.mean / light.mean, difference.error / light.mean)
    if len(runs) == 1:
        gap = Estimate(gap.mean, np.full_like(gap.mean, np.std(gap.mean[len(time) // 2 :])))
        agreed = propagate_error(
            lambda curve: entry(time, curve, within), gap._replace(mean=np.abs(gap.mean))
        )
    else:
        agreed = over_runs(lambda own: entry(time, np.abs(own[1] / own[0] - 1), within), both)
    return Approach(time, light, heavy, gap, agreed)


def over_runs(of: Callable[[np.ndarray], float], both: list[np.ndarray]) -> Estimate:
    """Return a function of the mean energies (2, W) of R runs, with a bootstrap error.

    `both` holds the energies (R, W) of the two species. A bootstrap sample is a random choice of R
    runs. In 68 % of these samples, the result deviates by less than the error. The error is NaN if
    the result is NaN for all runs, or in more than 32 % of the samples. A jackknife is unsuitable,
    because the function jumps where noise raises a curve above a limit. The omission of one run
    seldom causes such a jump; if it does, the jackknife error is far too large.
    """
    tracks, count = np.array(both), len(both[0])
    mean = tracks.mean(axis=1)
    whole = of(mean)
    chosen = np.random.default_rng(1).multinomial(count, np.full(count, 1 / count), RESAMPLED)
    means = np.einsum("cr,krw->ckw", chosen / count, tracks)
    spread = np.sqrt(count / (count - 1))  # resampled means scatter too little by this factor
    values = np.array([of(mean + spread * (own - mean)) for own in means])
    values[np.isnan(values)] = np.inf
    apart = np.quantile(np.abs(values - whole), 2 * ONE_SIGMA - 1, method="nearest")
    error = float(apart) * float(student(count))
    return Estimate(whole, error) if np.isfinite(error) else Estimate(np.nan, np.nan)


def late(runs: list[Run], name: str, skip: float | None) -> Estimate:
    """Return the mean of an observable in equilibrium over all runs."""
    means = []
    for run in runs:
        time, value = run.observable(name)
        means.append(value[time >= relaxed_start(run, skip)[0]].mean())
    return estimate(means)


def start_width(run: Run) -> float:
    """Return v0, the largest value of the input variable `speed`."""
    species = run.parameters.get("species", {})
    return max(float(species.get(name, {}).get("speed", 0.0)) for name in run.names)


def by_start(runs: list[Run]) -> list[tuple[float, list[Run]]]:
    """Group runs with the same width v0 of the initial velocity distribution."""
    return grouped(runs, start_width)


def draw_approach(axes: plt.Axes, group: Group, options: SimpleNamespace, labelled: bool) -> None:
    """Plot the energies of both species as functions of time for one v0."""
    first, found = group.runs[0], group.values
    order, shades = lightest_and_heaviest(first), colours(len(first.names))
    for k, energy in zip(order, (found.light, found.heavy), strict=True):
        style = {"color": shades[k], "marker": ".", "label": first.names[k]}
        axes.errorbar(found.time, *energy, **style)
    if np.isfinite(found.thermalisation.mean):
        time = " ± ".join(rounded_to_error(*found.thermalisation))
        label = "thermalisation time " + f"{time} {first.units.time}".rstrip()
        axes.axvline(found.thermalisation.mean, color="0.5", ls=":", lw=1.2, label=label)
    unit = first.units.name("speed")
    axes.set(title=f"initial speed {group.key:g} {unit}", xlim=(0, options.until))
    axes.set(ylabel=first.units.label("kinetic energy", "energy"), ylim=(0, None))
    if labelled:
        axes.set_xlabel(first.units.label("time"))
    else:
        axes.tick_params(labelbottom=False)
    legend_above(axes)


def draw(result: Result) -> Sheet:
    """Plot the energies as functions of time in a separate panel for each v0."""
    last, rows = len(result.groups) - 1, []
    for k, group in enumerate(result.groups):
        more = {"aspect": 0.34 + 0.05 * (k == last), "share_x": "start1" * (k > 0)}
        given = (group, result.options, k == last)
        rows.append([Panel(f"start{k + 1}", draw_approach, given, **more)])
    return Sheet(rows, ";  ".join(dict.fromkeys(caption(one.runs) for one in result.groups)))


def check(run: Run) -> None:
    """Raise Refused unless the species of a run reach a common temperature."""
    allow(run, "its species do not reach a common temperature", *SETTLED)


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return T_therm, and the energies in equilibrium, for each v0."""
    rows, warnings, share = [], [], f"{100 * options.within:g} %"
    for group in groups:
        runs = group.runs
        group.values = found = approach(runs, options.window, options.within)
        row = {"v0": group.key, "runs": len(runs), **measured("T_therm", found.thermalisation)}
        total = late(runs, "total_energy", options.equilibration)
        row |= measured("energy", Estimate(*(part / runs[0].n_disks for part in total)))
        for which, kind in zip(("light", "heavy"), lightest_and_heaviest(runs[0]), strict=True):
            name = f"{runs[0].names[kind]}/kinetic_energy"
            row |= measured(f"K_{which}", late(runs, name, options.equilibration))
        rows.append(row)
        if np.isnan(found.thermalisation.mean):
            known = 2 * np.median(found.gap.error) <= options.within
            why = f"the error of the energy difference exceeds {share}; use more runs or disks"
            why = f"the energies never agree within {share}" if known else why
            warnings.append(f"v0 = {group.key:g}: no T_therm; {why}")
    notes = [
        f"From the thermalisation time on, the means differ by less than {share} for three "
        "windows. Energies are means per disk over windows of time and over the runs. Bars: "
        "standard errors of the mean over the runs."
    ]
    return Result(rows, notes=notes, warnings=warnings)


ANALYSIS = Analysis(
    compute,
    draw,
    options=(
        shared("equilibration", "15, or until no drift"),
        Option("window", "duration of each window of time [0.5]", 0.5, float),
        Option("within", "largest relative difference of equal energies [0.1]", 0.1, float),
        Option("until", "end of the time axis [20]", 20, float),
    ),
    accepts=check,
    group_by=by_start,
)
