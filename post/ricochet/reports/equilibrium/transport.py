"""Viscosities, thermal conductivity and diffusion coefficient, compared with Enskog's theory."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from ...analysis.statistics import combine_runs
from ...analysis.transport import coefficients
from ...figures.drawing import COLOURS, band, caption, colours, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ..groups import Group, by_packing
from ..options import shared
from ..registry import Analysis
from ..result import Result
from ..tables import measured, over_runs, points

NO_CONDUCTIVITY = (
    "no conductivity and no D for a mixture: diffusing species also transport energy; "
    "correlations.py computes D of each species"
)
LABELS = {
    "viscosity": "shear viscosity",
    "conductivity": "heat conductivity",
    "bulk_viscosity": "bulk viscosity",
    "D": "diffusion coefficient",
}
#: Units of the coefficients in the table.
UNITS = {
    "viscosity": "sqrt(m*kT)/sigma",
    "conductivity": "sqrt(kT/m)/sigma",
    "bulk_viscosity": "sqrt(m*kT)/sigma",
    "D": "sigma*sqrt(kT/m)",
}


def table(groups: list[Group]) -> tuple[list[dict[str, Any]], list[str]]:
    """Return a table row for each packing fraction and coefficient, and a list of warnings."""
    rows, unsettled, warnings = [], [], []
    for group in groups:
        found = group.values
        for name in filter(found.get, LABELS):
            members, theory = found[name].members, found[name].enskog
            about = f"η = {group.key:g}, {name}"
            row = {"packing": group.key, "runs": len(members), "what": name}
            row |= measured("value", combine_runs(members).scaled(theory)) | {"enskog": theory}
            row |= {"unit": UNITS[name]}
            rows.append(row | over_runs("ratio", members, warnings, about))
            if found[name].lag < found[name].memory / 4:
                unsettled.append(
                    f"{about}: taken at {found[name].lag:.1f} mean free times, before it has "
                    f"settled; longer runs let it reach {found[name].memory:.3g}"
                )
    mixed = any("conductivity" not in group.values for group in groups)
    return rows, [*unsettled, *warnings, *[NO_CONDUCTIVITY] * mixed]


def draw_lags(axes: plt.Axes, groups: list[Group], name: str) -> None:
    """Plot a coefficient, relative to Enskog's value, against the lag."""
    for group in groups:
        if name in group.values:
            style = {"color": group.colour, "lw": 1, "marker": ".", "ms": 3}
            band(axes, *group.values[name].curve, label=f"η = {group.key:.3g}", **style)
    axes.set(xlabel="$w\\,t$", xscale="log", xlim=(0.03, None))
    axes.set(ylabel=f"{LABELS[name]} / Enskog's", ylim=(0, 1.6))
    axes.axhline(1, color="black", ls="--", lw=1, zorder=0)
    if name == "viscosity":
        legend_above(axes)


def draw_all(axes: plt.Axes, result: Result) -> None:
    """Plot all coefficients, relative to Enskog's values, against the packing fraction."""
    packing = [group.key for group in result.groups]
    # offset of points that would otherwise cover each other
    apart = 0.015 * (max(np.ptp(packing), 0.1))
    for k, ((name, label), marker) in enumerate(zip(LABELS.items(), "osv^", strict=True)):
        own = [row for row in result.table if row["what"] == name]
        if own:
            eta, *ratio = (
                np.array([row[x] for row in own]) for x in ("packing", "ratio", "ratio_error")
            )
            style = {"marker": marker, "ms": 4, "lw": 1, "label": label, "color": COLOURS[k]}
            axes.errorbar(eta + (k - 1.5) * apart, *ratio, **style)
    axes.set(xlabel="packing fraction η", ylabel="coefficient / Enskog's")
    axes.set_xlim(min(packing) - 5 * apart, max(packing) + 5 * apart)
    axes.axhline(1, color="black", ls="--", lw=1, zorder=0)
    legend_above(axes)


def draw(result: Result) -> Sheet:
    """Plot the coefficients against lag and packing fraction."""
    # the colours before these denote coefficients
    scale = colours(len(result.groups), len(COLOURS))
    for group, colour in zip(result.groups, scale, strict=True):
        group.colour = colour
    there = set().union(*(group.values for group in result.groups))
    names = [name for name in LABELS if name in there]
    panels = [Panel(name, draw_lags, (result.groups, name), aspect=0.65) for name in names]
    rows = [panels[k : k + 2] for k in range(0, len(panels), 2)]
    rows.append([Panel("all", draw_all, (result,), aspect=0.4)])
    return Sheet(rows, caption(result.runs))


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return the transport coefficients, and their ratios to Enskog's values."""
    for group in groups:
        group.values = coefficients(group.runs, options.equilibration)
    rows, warnings = table(groups)
    data = [
        {"what": row["what"], "packing": row["packing"], "wt": None}
        | {"ratio": row["ratio"], "error": row["ratio_error"]}
        for row in rows
    ]
    curves = {
        (f"{name}(t)", group.key): one.curve
        for group in groups
        for name, one in group.values.items()
    }
    data += points(("what", "packing", "wt", "ratio", "error"), curves)
    notes = ["Bands and bars: standard errors of the mean. w: collision rate of a disk."]
    return Result(rows, notes=notes, warnings=warnings, data=data)


ANALYSIS = Analysis(compute, draw, options=(shared("equilibration"),), group_by=by_packing)
