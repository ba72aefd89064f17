"""Coverage of the error bars: fraction of error bars that contain the true value."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy

from ...analysis.thermodynamics import FLUID, virial_over_kt, z_virial
from ...figures.drawing import COLOURS, caption, plt
from ...figures.sheet import Panel, Sheet
from ...reading.files import counted
from ...reading.nature import allow
from ...reading.reader import Run, RunError
from ..groups import Group, by_packing
from ..options import shared
from ..registry import Analysis
from ..result import Result

SHOWN = 60  # runs in a panel


def naive_error(run: Run, skip: float | None) -> float:
    """Return the standard error of Z assuming that all samples of the virial are independent."""
    amount, per = virial_over_kt(run, skip)
    return float(scipy.stats.sem(amount - per * np.sum(amount) / np.sum(per)) / np.mean(per))


def draw_bars(axes: plt.Axes, group: Group, row: dict[str, Any]) -> None:
    """Plot the means of single runs with their error bars."""
    z, error = group.values
    first = np.argsort(z[:SHOWN])
    for k, (mean, reach) in enumerate(zip(z[first], error[first], strict=True)):
        style = {"color": COLOURS[0 if abs(mean - row["Z"]) < reach else 1], "ms": 2.5, "lw": 1}
        axes.errorbar(k, mean, reach, marker="o", **style)
    axes.axhline(row["Z"], color="black", lw=1)
    axes.set_title(f"η = {group.key:g}: {row['within_%']:.0f} % of\n{len(group.runs)} contain it")
    axes.set(xticks=[], xlabel=f"{counted(len(first), 'run')}, in order")
    axes.set_ylabel("$Z = P\\,/\\,(n\\,kT)$ of a run")


def draw(result: Result) -> Sheet:
    """Plot a panel for each packing fraction."""
    panels = [
        Panel(f"packing{k + 1}", draw_bars, (group, row), aspect=1.0)
        for k, (group, row) in enumerate(zip(result.groups, result.table, strict=True))
    ]
    return Sheet([panels[k : k + 3] for k in range(0, len(panels), 3)], caption(result.runs))


def check(run: Run) -> None:
    """Raise Refused unless an equation of state applies to a run."""
    allow(run, "the equation of state is not defined for it", *FLUID)


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return the coverage of the error bars, and of naive error bars."""
    rows = []
    for group in groups:
        runs = group.runs
        if len(runs) < 10:
            raise RunError(f"{runs[0].path}: needs at least 10 seeds per packing fraction")
        z, error = np.array([z_virial(run, options.equilibration)[:2] for run in runs]).T
        naive = np.array([naive_error(run, options.equilibration) for run in runs])
        row = {"packing": group.key, "runs": len(runs), "Z": float(z.mean())}
        row |= {"scatter": float(z.std(ddof=1)), "error": float(error.mean())}
        row |= {"within_%": float(100 * np.mean(np.abs(z - z.mean()) < error))}
        row |= {"naive_error": float(naive.mean())}
        row |= {"naive_within_%": float(100 * np.mean(np.abs(z - z.mean()) < naive))}
        rows.append(row)
        group.values = z, error
    notes = [
        "Bars: 68 % confidence intervals of single runs; orange: without the mean of all runs."
    ]
    return Result(rows, notes=notes)


ANALYSIS = Analysis(
    compute, draw, options=(shared("equilibration"),), accepts=check, group_by=by_packing
)
