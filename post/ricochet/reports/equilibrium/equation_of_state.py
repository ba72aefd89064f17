"""Equation of state Z = P / (n kT) of hard disks against packing fraction, by three methods."""

from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.ticker import LogLocator

from ...analysis.statistics import combine_runs
from ...analysis.thermodynamics import z_ways
from ...figures.drawing import COLOURS, caption, listed, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...predictions import hard_disks
from ...reading.reader import Run, RunError
from ..groups import Group, by_packing
from ..options import shared
from ..registry import Analysis
from ..result import Result
from ..tables import columns, over_runs, with_all_columns

UNLIKE = 0.02  # largest difference of <r>^2 / <r^2> within a figure
WAYS = {"virial": "virial", "rate": "collision rate", "walls": "force on the walls"}


def likeness(runs: list[Run]) -> float:
    """Return <r>^2 / <r^2> of the radii r, on which the theoretical curves depend."""
    found = np.array([np.mean(run.radius) ** 2 / np.mean(run.radius**2) for run in runs])
    equal = np.array([np.ptp(run.radius) == 0 for run in runs])
    other = (np.abs(found - found[0]) > UNLIKE) | (equal != equal[0])
    if other.any():
        path = runs[int(np.argmax(other))].path
        raise RunError(f"{path}: the radii are not equal or not distributed as in {runs[0].path}")
    return 1.0 if equal.all() else float(found.mean())


def table(groups: list[Group], skip: float | None) -> tuple[list[dict[str, Any]], list[str]]:
    """Return a row for each packing fraction, and a list of warnings.

    Cells are empty where a method does not apply; a method that applies nowhere has no column.
    """
    rows, warnings = [], []
    alike = likeness([run for group in groups for run in group.runs])
    for group in groups:
        eta, same = group.key, group.runs
        row = {"packing": eta, "runs": len(same)}
        found = [z_ways(run, skip) for run in same]
        for name, way in WAYS.items():
            if all(name in one for one in found):
                members = [one[name] for one in found]
                row |= over_runs(f"Z_{name}", members, warnings, f"η = {eta:g}, {way}")
        row["samples"] = round(combine_runs([one["virial"] for one in found]).samples, 1)
        z = hard_disks.published(eta, same[0].n_disks, bool(same[0].periodic.all()))
        z = hard_disks.of_sizes(z, eta, alike)
        known = np.isfinite(z) and (alike == 1 or eta <= hard_disks.FLUID[-1, 0])
        rows.append(row | {"Z_reference": z if known else None})
    return with_all_columns(rows), warnings


def cells(result: Result) -> dict[str, np.ndarray]:
    """Return the columns of the table, with NaN for empty cells."""
    return {name: np.array(own, dtype=float) for name, own in columns(result.table).items()}


def fluids(result: Result) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Return <r>^2 / <r^2>, packing fractions, and two equations of state of the fluid."""
    alike, fluid = likeness(result.runs), np.linspace(0, 0.72, 200)
    if alike < 1:  # such fluids do not freeze where equal disks do
        fluid = np.linspace(0, max(0.72, float(cells(result)["packing"].max())), 200)
    laws = (hard_disks.henderson(fluid), hard_disks.simulated(fluid))
    henderson, published = (hard_disks.of_sizes(z, fluid, alike) for z in laws)
    if alike < 1:
        published = np.where(fluid <= hard_disks.FLUID[-1, 0], published, np.nan)
    return alike, fluid, henderson, published


def draw_points(axes: plt.Axes, found: dict[str, np.ndarray], deviations: bool) -> None:
    """Plot Z by each method, or its deviation from the reference in percent."""
    eta, expected = found["packing"], found["Z_reference"]
    for (name, way), marker, colour in zip(WAYS.items(), "oxs", COLOURS, strict=False):
        if f"Z_{name}" in found:
            z, error = found[f"Z_{name}"], found[f"Z_{name}_error"]
            style = {"ls": "", "marker": marker, "mfc": "none", "color": colour, "ms": 6}
            if deviations:
                axes.errorbar(eta, 100 * (z / expected - 1), 100 * error / expected, **style)
            else:
                axes.errorbar(eta, z, error, label=f"by {way}", **style)


def draw_z(axes: plt.Axes, result: Result) -> None:
    """Plot Z with published equations of state."""
    (alike, fluid, henderson, published), found = fluids(result), cells(result)
    rough = "Henderson 1975" if alike == 1 else "Santos et al. 1999, from Henderson's equation"
    label = "Kolafa, Rottner 2006; to 0.648 Erpenbeck, Luban 1985; then this program"
    label = label if alike == 1 else "Santos et al. 1999, from simulations of equal disks"
    axes.plot(fluid, henderson, color="0.6", label=rough)
    axes.plot(fluid, published, color="black", lw=1, label=label)
    if alike == 1:
        solid = np.linspace(0.715, 0.86, 100)
        label = "crystal, Alder, Hoover and Young 1968"
        axes.plot(solid, hard_disks.crystal(solid), color="black", lw=1, ls="--", label=label)
    draw_points(axes, found, deviations=False)
    # determined by the data, because the curves diverge
    most = np.nanmax([found[f"Z_{name}"] for name in WAYS if f"Z_{name}" in found])
    axes.set(ylabel="$Z = P\\,/\\,(n\\,kT)$", xlim=(0, 0.05 + max(found["packing"])))
    if most > 3:
        axes.semilogy()
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("")
    axes.set(xlabel="packing fraction $\\eta$", ylim=(0.9, 1.15 * most))
    legend_above(axes)


def draw_deviation(axes: plt.Axes, result: Result) -> None:
    """Plot the deviation of Z from a reference equation of state."""
    (_, fluid, henderson, published), found = fluids(result), cells(result)
    axes.plot(fluid, 100 * (henderson / published - 1), color="0.6")
    draw_points(axes, found, deviations=True)
    axes.axhline(0, color="black", lw=1, zorder=0)
    expected = found["Z_reference"]
    if np.isnan(expected).any():
        words = f"no reference for η = {listed(set(found['packing'][np.isnan(expected)]))}"
        axes.text(0.99, 0.97, words, ha="right", va="top", transform=axes.transAxes)
    largest = 3 * np.nanmax(np.abs(100 * (found["Z_virial"] / expected - 1)), initial=0.1)
    axes.set(xlabel="packing fraction $\\eta$", ylabel="deviation (%)", ylim=(-largest, largest))


def draw(result: Result) -> Sheet:
    """Plot Z, and its deviation from a reference equation of state."""
    above = Panel("z", draw_z, (result,), aspect=0.6)
    below = Panel("deviation", draw_deviation, (result,), aspect=0.35, share_x="z")
    return Sheet([[above], [below]], caption(result.runs))


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return the compressibility factors by three methods."""
    rows, warnings = table(groups, options.equilibration)
    return Result(rows, notes=["Bars: standard errors of the mean."], warnings=warnings)


ANALYSIS = Analysis(compute, draw, options=(shared("equilibration"),), group_by=by_packing)
