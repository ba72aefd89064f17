"""Melting of hard disks: pressure against packing fraction for each number of disks."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from ...analysis.statistics import combine_runs
from ...analysis.thermodynamics import z_virial
from ...figures.drawing import caption, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...predictions.hard_disks import MELTING
from ...reading.nature import allow
from ...reading.reader import Run
from ..groups import Group, by_number, by_packing
from ..options import shared
from ..registry import Analysis
from ..result import Result
from ..tables import over_runs


def table(groups: list[Group], skip: float | None) -> tuple[list[dict[str, Any]], list[str]]:
    """Return a table row for each number of disks and packing fraction, and a list of warnings."""
    rows, warnings = [], []
    for group in groups:
        for eta, same in by_packing(group.runs):
            members = [z_virial(run, skip).scaled(4 * eta / np.pi) for run in same]
            row = {"N": group.key, "packing": eta, "runs": len(same)}
            row |= over_runs("P", members, warnings, f"N = {group.key}, η = {eta:g}")
            rows.append(row | {"samples": round(combine_runs(members).samples, 1)})
    return rows, warnings


def draw_pressures(axes: plt.Axes, result: Result) -> None:
    """Plot measured values as points with error bars, and published values as lines."""
    for (name, points), style in zip(MELTING.items(), (":", "--", "-"), strict=True):
        axes.plot(*np.transpose(points), ls=style, color="0.4", lw=1, label=name)
    for group in result.groups:
        own = [row for row in result.table if row["N"] == group.key]
        x, y, error = ([row[name] for row in own] for name in ("packing", "P", "P_error"))
        style = {"marker": "o", "lw": 0.8, "color": group.colour}
        axes.errorbar(x, y, error, label=f"N = {group.key}", **style)
    axes.set(xlabel="packing fraction $\\eta$", ylabel="$P^* = P\\,d^2\\,/\\,kT$")
    legend_above(axes)


def draw(result: Result) -> Sheet:
    """Plot the pressures."""
    panel = Panel("pressure", draw_pressures, (result,), aspect=0.65)
    return Sheet([[panel]], caption(result.runs))


def check(run: Run) -> None:
    """Raise Refused unless the disks are equal and the box is periodic."""
    known = "thermostatted", "rough", "rotating"
    allow(run, "the melting curve is for equal disks in a periodic box", *known)


def by_system(runs: list[Run]) -> list[tuple[tuple[int, float], list[Run]]]:
    """Group runs with the same number of disks and packing fraction."""
    return [((n, eta), same) for n, own in by_number(runs) for eta, same in by_packing(own)]


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return the reduced pressures."""
    rows, warnings = table(groups, options.equilibration)
    return Result(rows, notes=["Bars: standard errors of the mean."], warnings=warnings)


ANALYSIS = Analysis(
    compute,
    draw,
    options=(shared("equilibration"),),
    accepts=check,
    group_by=by_number,
    averages=by_system,
)
