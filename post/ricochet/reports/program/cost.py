"""Time per collision against the number of disks, for each method of finding the next event."""

from types import SimpleNamespace

import numpy as np

from ...analysis.estimates import PowerLaw, fit_power_law
from ...analysis.thermodynamics import packing
from ...figures.drawing import COLOURS, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...reading.reader import Run
from ..groups import Group, each_run
from ..options import Option, recorded
from ..registry import Analysis
from ..result import Result

LABELS = {
    "rescan": "all pairs at each collision",
    "pairs": "all pairs of the disks just involved",
    "cells": "neighbouring cells",
}


def costs(runs: list[Run]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return numbers of disks and shortest times per collision [microseconds] by search method."""
    least: dict[str, dict[int, float]] = {}
    for run in runs:
        points = least.setdefault(str(run.parameter("run", "search", "cells")), {})
        time = 1e6 / recorded(run, "collisions_per_second")
        points[run.n_disks] = min(time, points.get(run.n_disks, np.inf))
    return {search: tuple(np.array(sorted(points.items())).T) for search, points in least.items()}


def fits(measured: dict, low: float, high: float) -> dict[str, PowerLaw]:
    """Return a power law for each method, fitted to the points with `low` <= N <= `high`."""
    laws = {}
    for search, (n, cost) in measured.items():
        inside = (n >= low) & (n <= high)
        x, y = n[inside], cost[inside]
        law = fit_power_law(x, y)
        if law:
            laws[search] = law
    return laws


def draw_cost(axes: plt.Axes, result: Result) -> None:
    """Plot times and fits on logarithmic axes, with fitted lines dotted outside the fit range."""
    (measured, laws), (low, high) = result.values, result.options.fit
    for search, colour, marker in zip(LABELS, COLOURS, "osD", strict=False):
        if search in measured:
            n, cost = measured[search]
            label = f"{search}: {LABELS[search]}"
            axes.loglog(n, cost, ls="", marker=marker, color=colour, label=label)
        if search in laws:
            law, style = laws[search], {"color": colour, "lw": 1}
            label = f"$\\propto N^{{{law.exponent:.3f} \\pm {law.exponent_error:.3f}}}$"
            fitted = n[(n >= low) & (n <= high)]
            axes.plot(n, law(n), ls=":", **style)
            axes.plot(fitted, law(fitted), label=label, **style)
    eta = ", ".join(f"{v:g}" for v in sorted({round(packing(run), 3) for run in result.runs}))
    axes.set(xlabel="number of disks N", ylabel="time per collision (µs)")
    axes.set_title(f"packing fraction {eta}")
    legend_above(axes)


def draw(result: Result) -> Sheet:
    """Plot the times per collision."""
    return Sheet([[Panel("cost", draw_cost, (result,), aspect=0.75)]])


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return the shortest times per collision, and power laws fitted to them."""
    measured = costs(groups[0].runs)
    laws = fits(measured, *options.fit)
    table = [
        {"search": search, "N": int(n), "microseconds": float(cost)}
        for search, points in measured.items()
        for n, cost in zip(*points, strict=True)
    ]
    exponents = [
        {"search": search, "exponent": law.exponent, "exponent_error": float(law.exponent_error)}
        for search, law in laws.items()
    ]
    notes = ["Shortest time of several runs."]
    if laws:
        notes.append("Solid lines: fits; dotted: outside the range of a fit.")
    return Result(table, notes=notes, further=[exponents], values=(measured, laws))


FIT = Option(
    "fit",
    "smallest and largest number of disks in the fits [128 1e4]",
    (128, 1e4),
    float,
    symbol="N",
    number=2,
)
ANALYSIS = Analysis(compute, draw, options=(FIT,), repeated=True, averages=each_run)
