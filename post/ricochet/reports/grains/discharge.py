"""Discharge rate of a refilled hopper against the width of its mouth, with Beverloo's law."""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from matplotlib.ticker import LogLocator, NullFormatter

from ...analysis.estimates import MANY, Estimate, estimate, rounded_to_error
from ...analysis.statistics import (
    SeriesMean,
    combine_runs,
    correlated_mean,
    diagnostics,
    fit_law,
    fit_power_law,
    windows,
)
from ...figures.drawing import COLOURS, caption, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...reading.files import RunError, counted
from ...reading.nature import Refused
from ...reading.reader import Run
from ..groups import Group, grouped
from ..options import Option, not_negative
from ..registry import Analysis
from ..result import Result
from ..tables import Table, measured

EXPONENT = 1.5  # exponent of Beverloo's law in two dimensions
BEVERLOO = 1.4  # k of Beverloo, Leniger and van de Velde (1961)
WINDOWS = 50  # number of mean rates in a figure over time


def mouth(run: Run) -> float:
    """Return the shortest distance between the ends of two different walls."""
    ends = run.walls
    gaps = [
        np.linalg.norm(one - other)
        for k in range(len(ends))
        for other_wall in ends[k + 1 :]
        for one in ends[k]
        for other in other_wall
    ]
    if not gaps:
        raise Refused(f"{run.path}: has no mouth between the ends of two straight walls (&wall)")
    return float(min(gaps))


def reduced_width(run: Run) -> float:
    """Return the width of the mouth in mean disk diameters."""
    return round(mouth(run) / (2 * float(run.radius.mean())), 6)


def rate(run: Run, after: float):
    """Return the mean number of disks recycled per time after the time `after`."""
    time, rates = rates_of(run)
    late = time[:-1] >= after
    if late.sum() < 2:
        count = int(np.sum(time >= after))
        raise RunError(f"{run.path}: has {counted(count, 'sample')} after t = {after:g}; needs 3")
    return correlated_mean(rates[late])


def reduction(run: Run) -> float:
    """Return sqrt(d / g), which makes a rate dimensionless when multiplied by it."""
    return float(np.sqrt(2 * run.radius.mean() / np.linalg.norm(run.gravity)))


def rates_of(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return the sampling times (T,), and the disks recycled per time between them."""
    if "recycled" not in run.nature:
        raise Refused(f"{run.path}: recycles no disks (drive.kind = 'recycle')")
    if not np.any(run.gravity):
        raise Refused(f"{run.path}: has no gravity (box.gravity)")
    time, count = run.observable("recycled")
    return time, np.diff(count) / np.diff(time)


def draws_radii(run: Run) -> bool:
    """Return whether the program drew the radii at random, as with polydispersity."""
    species = run.parameters.get("species", {})
    return any(float(species.get(name, {}).get("polydispersity", 0.0)) > 0 for name in run.names)


def fitted(
    x: np.ndarray, y: np.ndarray, error: np.ndarray | None = None, runs: np.ndarray | float = MANY
) -> dict[str, Estimate]:
    """Return C and k of the first fit and the exponent of the second fit, with their errors.

    `error` (M,) holds the errors of the reduced rates `y`, each estimated from `runs` values.
    Without it, the errors are estimated from the scatter of the points.
    """
    largest = x.min() - 1e-6

    def law(x: np.ndarray, c: float, k: float) -> np.ndarray:
        return np.log(c) + EXPONENT * np.log(x - k)

    start = y.max() / x[np.argmax(y)] ** EXPONENT, min(1.0, largest - 1)
    first = fit_law(law, x, y, start, error, runs, bounds=((1e-9, -10), (np.inf, largest)))
    second = fit_power_law(x - BEVERLOO, y, error, runs)
    if first is None or second is None:
        return {}
    both = map(Estimate, first.values, first.errors)
    exponent = Estimate(second.exponent, second.exponent_error)
    return dict(zip(("C", "k", "exponent"), (*both, exponent), strict=True))


def mean_rate(runs: list[Run], members: list[SeriesMean]) -> SeriesMean:
    """Return the mean rate of runs with the same mouth.

    If the radii are random, the error is estimated from the scatter of the runs.
    """
    if len(runs) < 2 or not any(map(draws_radii, runs)):
        return combine_runs(members)
    drift = sum(one.drift for one in members) / len(members) ** 0.5
    means = estimate([one.mean for one in members])
    return SeriesMean(*map(float, means), len(members), drift, len(members) - 1)


class Rates(NamedTuple):
    """Rates for different widths of the mouth."""

    rows: list[dict]  # a table row for each of the M widths
    warnings: list[str]
    independent: np.ndarray  # (M,) number of independent values behind each error
    complete: bool  # whether the errors include the scatter over samples of radii


def by_mouth(runs: list[Run]) -> list[tuple[float, list[Run]]]:
    """Group runs with the same width of the mouth."""
    return grouped(runs, lambda run: round(mouth(run), 9))


def measured_rates(runs: list[Run], after: float) -> Rates:
    """Measure the rate for each width of the mouth."""
    rows, warnings, independent, complete = [], [], [], True
    for _, same in by_mouth(runs):
        members = [rate(run, after) for run in same]
        width = round(float(np.mean([reduced_width(run) for run in same])), 6)
        whole = mean_rate(same, members)
        warnings += diagnostics(f"D = {width:g} d", members)
        if len(same) < 2 and draws_radii(same[0]):
            complete = False
            warnings.append(
                f"D = {width:g} d: the error of a single run does not contain the scatter between "
                "samples of radii (polydispersity); use several seeds"
            )
        row = {"D_over_d": width, "runs": len(same)} | measured("W", whole)
        reduced = [one.scaled(reduction(run)) for one, run in zip(members, same, strict=True)]
        row |= measured("W_reduced", mean_rate(same, reduced))
        rows.append(row | {"samples": round(whole.samples, 1)})
        independent.append(whole.freedom + 1)
    return Rates(rows, warnings, np.array(independent), complete)


def fit_of(found: Rates) -> dict[str, Estimate]:
    """Fit Beverloo's law to measured rates; return {} for fewer than three widths."""
    x, y, error = points(found.rows)
    if found.complete and np.all(error > 0):
        return fitted(x, y, error, found.independent)
    return fitted(x, y)


def points(rows: list[dict]) -> np.ndarray:
    """Return D / d, the reduced rate and its error (NaN if unknown) as an array (3, M)."""
    names = "D_over_d", "W_reduced", "W_reduced_error"
    return np.array([[row[name] for row in rows] for name in names], float)


# --- figure ---


def draw_in_time(axes: plt.Axes, result: Result, name: str) -> None:
    """Plot the number of recycled disks, or the discharge rate, of each run over time."""
    runs, row, after = result.runs, result.table[0], result.options.after
    for k, run in enumerate(runs):
        style = {"color": COLOURS[0], "lw": 1, "alpha": 1 if len(runs) == 1 else 0.6}
        style |= {"label": "measured" if k == 0 else ""}
        time, rates = rates_of(run)
        width = max((time[-1] - time[0]) / WINDOWS, float(np.diff(time).max()))
        shown = run.observable("recycled") if name == "count" else windows(time[1:], rates, width)
        axes.plot(*shown, **style)
    line = np.array([after, max(float(run.observable("recycled").time[-1]) for run in runs)])
    dashed = {"color": "black", "ls": "--"}
    dashed["label"] = f"$W$ = {' ± '.join(rounded_to_error(row['W'], row['W_error']))}"
    if name == "count":
        start = np.mean([np.interp(after, *run.observable("recycled")) for run in runs])
        axes.plot(line, start + row["W"] * (line - after), **dashed)
    else:
        error = np.nan_to_num(row["W_error"])
        axes.plot(line, 2 * [row["W"]], **dashed)
        axes.fill_between(line, row["W"] - error, row["W"] + error, color="0.5", alpha=0.3, lw=0)
    axes.axvline(after, color="0.5", ls=":", lw=1, label=f"--after {after:g}")
    units = runs[0].units
    axes.set(xlabel=units.label("time $t$", "time"), xlim=(0, None), ylim=(0, None))
    several = units.label("recycled disks per time", "rate")
    axes.set_ylabel("recycled disks since the start" if name == "count" else several)
    legend_above(axes)


def draw_rates(axes: plt.Axes, result: Result) -> None:
    """Plot the rates against D / d with Beverloo's law."""
    (x, y, error), fit = points(result.table), result.values
    axes.errorbar(x, y, error, fmt="o", color=COLOURS[0], label="measured")
    if fit:
        (c, _), (k, dk) = fit["C"], fit["k"]
        line = np.linspace(max(k, 0), 1.05 * x.max(), 200)
        law = f"{c:.3g} (D/d − k)^(3/2)"
        axes.plot(line, c * (line - k) ** EXPONENT, color=COLOURS[0], label=law)
        axes.plot([], [], " ", label=f"$k$ = {k:.2f} ± {dk:.2f}")
    axes.set(xlabel="width of the mouth $D/d$", ylabel="$W \\sqrt{d/g}$")
    axes.set(xlim=(0, 1.1 * x.max()), ylim=(0, 1.1 * np.max(y + np.nan_to_num(error))))
    legend_above(axes)


def draw_power(axes: plt.Axes, result: Result) -> None:
    """Plot the rates against D / d - k on logarithmic axes, with both fits."""
    x, y, error = points(result.table)
    (c, _), (k, _), (n, dn) = result.values.values()
    for shift, colour, marker in ((k, COLOURS[0], "o"), (BEVERLOO, COLOURS[1], "s")):
        axes.errorbar(x - shift, y, error, fmt=marker, color=colour, label=f"$k$ = {shift:.2f}")
    line = np.array([(x - k).min(), (x - k).max()])
    axes.plot(line, c * line**EXPONENT, color=COLOURS[0], label="exponent 3/2")
    line = np.array([(x - BEVERLOO).min(), (x - BEVERLOO).max()])
    scale = np.exp(np.mean(np.log(y) - n * np.log(x - BEVERLOO)))  # scale of the fitted line
    label = f"exponent {n:.2f} ± {dn:.2f}"
    axes.plot(line, scale * line**n, color=COLOURS[1], ls="--", label=label)
    axes.set(xlabel="$D/d - k$", ylabel="$W \\sqrt{d/g}$", xscale="log", yscale="log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    legend_above(axes)


def draw(result: Result) -> Sheet:
    """Plot the rates with the fits, or the rate over time if there is only one width."""
    if len(result.table) == 1:
        panels = [Panel(one, draw_in_time, (result, one)) for one in ("count", "rate")]
        title = f"{caption(result.runs)},  $D/d$ = {result.table[0]['D_over_d']:.3g}"
        return Sheet([panels], title)
    panels = [Panel("rate", draw_rates, (result,), aspect=0.8)]
    if result.values:
        panels.append(Panel("power_law", draw_power, (result,), aspect=0.8))
    return Sheet([panels], caption(result.runs))


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return the discharge rate for each width of the mouth, and the fits."""
    runs = [run for group in groups for run in group.runs]
    found = measured_rates(runs, options.after)
    fit = fit_of(found)
    notes = [
        "W: discharged grains per time; D: width of the mouth; d: diameter of a grain.",
        "Bars and bands: standard errors of the mean, over time and over runs.",
    ]
    if fit:
        notes.append("Lines: fits, drawn over the fitted range on logarithmic axes.")
    numbers = [{name: value for one in fit for name, value in measured(one, fit[one]).items()}]
    further: list[Table] = [numbers] if fit else []
    return Result(found.rows, notes=notes, warnings=found.warnings, further=further, values=fit)


ANALYSIS = Analysis(
    compute,
    draw,
    options=(Option("after", "start of the steady state [4]", 4.0, not_negative, "T"),),
    averages=by_mouth,
)
