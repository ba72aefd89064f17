"""Energies as functions of time, and conservation of the total energy."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...figures.drawing import COLOURS, caption, colours, lone, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...reading.nature import Refused
from ...reading.reader import Run, RunError
from ..groups import Group, each_run
from ..registry import Analysis
from ..result import Result

EPSILON = np.finfo(float).eps  # distance of 1 from the next larger number
WINDOWS = 60  # time windows
MOST_PANELS = 4
ROUNDING = 1e-9  # largest relative change that rounding errors explain
WHY_EXACT = "flights and collisions are exact except for rounding; larger steps miss collisions"


def method(run: Run) -> str:
    """Return the name of the simulation method of a run, for a legend."""
    return f"time steps, Δt = {run.time_step:g}" if run.time_step else "event driven"


def balance(run: Run) -> tuple[np.ndarray, str]:
    """Return the conserved quantity as a function of time, and the names of the energies in it."""
    energy, words = run.observable("total_energy").value, "total"
    size = 1e-9 * np.abs(energy).max()
    for sign, term in ((1, "dissipated_energy"), (-1, "heat"), (-1, "work"), (-1, "drive_energy")):
        value = run.observable(term).value if term in run.observables else 0.0
        if np.abs(value).max() > size:
            energy = energy + sign * value
            words += f" {'+-'[sign < 0]} {term.removesuffix('_energy')}"
    return energy, words


def change(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return times and relative changes of the conserved quantity."""
    time, total = run.observable("total_energy")
    if len(time) < 2:
        raise RunError(
            f"{run.path}: has only one sample of the energies; at least two are required"
        )
    if not np.any(total):
        raise Refused(f"{run.path}: all disks are at rest, so that the energy is zero")
    energy, _ = balance(run)
    return time, (energy - energy[0]) / (abs(total[0]) or np.abs(total).max())


def means_of_windows(
    time: np.ndarray, value: np.ndarray, spaced: Callable = np.geomspace
) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean times and mean values of a time series in consecutive windows."""
    cuts = spaced(time[0], time[-1], WINDOWS + 1)[1:-1]
    parts = np.searchsorted(cuts, time)
    number = np.bincount(parts)
    some = number > 0
    sums = (np.bincount(parts, series)[some] for series in (time, value))
    return tuple(total / number[some] for total in sums)


def draw_species(axes: plt.Axes, run: Run, spaced: Callable) -> None:
    """Plot kinetic (solid) and potential energies (dotted) of all species in time windows.

    `spaced` divides the time: `np.linspace`, or `np.geomspace` for a logarithmic axis.
    """
    curves, top = [(name, "kinetic", "-") for name in run.names], 0.0
    if np.any(run.gravity):
        curves += [(name, "potential", ":") for name in run.names]
    for name, kind, style in curves:
        colour = COLOURS[run.names.index(name) % len(COLOURS)]
        time, value = (series[1:] for series in run.observable(f"{name}/{kind}_energy"))
        axes.plot(time, value, color=colour, lw=0.5, alpha=0.15)
        means = means_of_windows(time, value, spaced)
        axes.plot(*means, color=colour, ls=style, label=f"{kind}, {name}", **lone(time))
        top = max(top, means[1].max())
    axes.set_ylabel(run.units.label("energy per disk", "energy"))
    axes.set(xlabel=run.units.label("time"), ylim=(0, 1.1 * top or 1))
    if spaced is np.geomspace:
        axes.set_xscale("log")
        axes.set_title("the same, logarithmic time")
    else:
        axes.set_xlim(0, run.observable("total_energy").time[-1])
        axes.set_title(f"species, {method(run)}")
        legend_above(axes)


def of_each_method(runs: list[Run]) -> list[Run]:
    """Return the first run of each method and time step, up to `MOST_PANELS` runs."""
    first: dict[float, Run] = {}
    for run in runs:
        first.setdefault(run.time_step, run)
    return list(first.values())[:MOST_PANELS]


def draw_total(axes: plt.Axes, run: Run, is_first: bool, is_left: bool) -> None:
    """Plot the total energy of a run and its parts as functions of time on linear axes."""
    time, total = run.observable("total_energy")
    axes.plot(time, total, color="black", lw=1.6, label="total energy", zorder=3, **lone(time))
    for kind, style in (("kinetic", "-"), ("potential", ":")):  # as in the panel of species
        if f"all/{kind}_energy" in run.observables and np.any(run.gravity):
            part = run.n_disks * run.observable(f"all/{kind}_energy").value
            axes.plot(time, part, color="0.5", ls=style, lw=1, label=f"{kind} energy")
    constant, words = balance(run)
    if words != "total":
        axes.plot(time, constant, color="0.5", ls="--", lw=1.2, label=words)
    _, lost = change(run)
    axes.set_title(f"{method(run)}\nlargest change {np.abs(lost).max():.2g}")
    axes.set(xlabel=run.units.label("time"), xlim=(time[0], time[-1]))
    if is_left:
        axes.set_ylabel(run.units.label("energy"))
    if is_first:
        axes.set_ylim(min(0, axes.get_ylim()[0]), None)
        axes.locator_params(axis="y", nbins=4)
        legend_above(axes)


def draw(result: Result) -> Sheet:
    """Plot total energies, energies of each species, and changes of the conserved quantity."""
    runs = result.runs
    shown = of_each_method(runs)
    per_row = 2 if len(shown) == MOST_PANELS else max(1, len(shown))
    totals = [
        Panel(
            f"total{k + 1}",
            draw_total,
            (run, k == 0, k % per_row == 0),
            aspect=0.3 * per_row,
            share_y="total1" * (k > 0),
        )
        for k, run in enumerate(shown)
    ]
    rows = [totals[k : k + per_row] for k in range(0, len(totals), per_row)]
    species = [Panel("species", draw_species, (runs[0], np.linspace), aspect=0.7)]
    if not runs[0].nature.driven:
        more = (runs[0], np.geomspace)
        species.append(Panel("logarithmic", draw_species, more, aspect=0.7, share_y="species"))
    changes = Panel("changes", draw_changes, (runs,), aspect=0.35)
    return Sheet([*rows, species, [changes]], caption(runs))


def draw_changes(axes: plt.Axes, runs: list[Run]) -> None:
    """Plot for each run the largest change of the conserved quantity up to each time."""
    worst = 0.0
    for run, colour in zip(runs, colours(len(runs), 2), strict=True):
        time, lost = change(run)
        largest = np.maximum(np.maximum.accumulate(np.abs(lost)), EPSILON / 2)
        worst = max(worst, float(largest[-1]))
        words = balance(run)[1]
        style = {"label": method(run) + f": {words}" * (words != "total")} | lone(time[1:])
        axes.semilogy(time[1:], largest[1:], color=colour, lw=1.4, **style)
    if not any(run.nature.driven for run in runs):
        axes.set_xscale("log")
    axes.set(
        xlabel=runs[0].units.label("time"),
        ylabel="largest relative change",
        xlim=(min(run.observable("total_energy").time[1] for run in runs), None),
        ylim=(EPSILON / 4, None),
    )
    if any(run.time_step for run in runs) and worst < ROUNDING:
        axes.set_title(WHY_EXACT)
    legend_above(axes)


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return drift, scatter and largest change of the conserved quantity."""
    rows = []
    for run in groups[0].runs:
        time, lost = change(run)
        line = np.polynomial.Polynomial.fit(time, lost, 1)
        row: dict[str, Any]
        row = {"run": run.label, "method": method(run), "of": balance(run)[1]}
        row |= {"total_energy": float(run.observable("total_energy").value[0])}
        row |= {"drift": float(line(time[-1]) - line(time[0]))}
        row |= {"spread": float(np.std(lost - line(time)))}
        rows.append(row | {"largest_change": float(np.abs(lost).max())})
    notes = ["Energies of species: means over windows of time; single samples are pale."]
    warnings = [
        f"{run.label} has energies of its start and its end alone: set for example"
        " output.observables_every_time to see what happens between them"
        for run in groups[0].runs
        if len(run.observable("total_energy").time) < 3
    ]
    return Result(rows, notes=notes, warnings=warnings)


ANALYSIS = Analysis(compute, draw, averages=each_run)
