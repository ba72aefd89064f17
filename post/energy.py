"""Energies in time, and how well the total is conserved.

    python post/energy.py runs/gravity/events.h5 runs/gravity/steps_*.h5 -o energy.png

The upper panel shows the mean kinetic and potential energy per disk of each species in the first
run.  The lower panel shows, for each run, the largest relative change so far of the conserved
quantity.  That is the total energy, or, where energy is exchanged, total + dissipated - heat - work
- drive.  The time axis is logarithmic, because most happens at first; it is linear for driven
disks.

The table has three numbers for each run, relative to the total energy at the start, or to the
largest one if that is 0: the drift, which is the change over the whole run along a fitted line; the
spread, which is the standard deviation from that line; and the largest change.
"""

from collections.abc import Callable

from ricochet import Run, RunError
from ricochet.figures.drawing import COLOURS, caption, colours, lone, plt
from ricochet.reading.nature import Refused
from ricochet.script import command_line, launch, report

import numpy as np

EPSILON = np.finfo(float).eps  # the smallest change of a number near 1
WINDOWS = 60  # windows of time


def method(run: Run) -> str:
    """Return how the run was integrated, for the legend."""
    return f"time steps, Δt = {run.time_step:g}" if run.time_step else "event driven"


def balance(run: Run) -> tuple[np.ndarray, str]:
    """Return the conserved quantity at the observables, and its terms in words."""
    energy, words = run.observable("total_energy").value, "total"
    size = 1e-9 * np.abs(energy).max()
    for sign, term in ((1, "dissipated_energy"), (-1, "heat"), (-1, "work"), (-1, "drive_energy")):
        value = run.observable(term).value if term in run.observables else 0.0
        if np.abs(value).max() > size:
            energy = energy + sign * value
            words += f" {'+-'[sign < 0]} {term.removesuffix('_energy')}"
    return energy, words


def change(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return time and relative change of the conserved quantity."""
    time, total = run.observable("total_energy")
    if len(time) < 2:
        raise RunError(f"{run.path}: has one sample of the energies so far; nothing has changed")
    if not np.any(total):
        raise Refused(f"{run.path}: all disks are at rest, there is no energy")
    energy, _ = balance(run)
    return time, (energy - energy[0]) / (abs(total[0]) or np.abs(total).max())


def means_of_windows(
    time: np.ndarray, value: np.ndarray, spaced: Callable = np.geomspace
) -> tuple[np.ndarray, np.ndarray]:
    """Return means of a series over windows of growing length, at their mean times."""
    cuts = spaced(time[0], time[-1], WINDOWS + 1)[1:-1]
    parts = np.searchsorted(cuts, time)
    number = np.bincount(parts)
    some = number > 0
    sums = (np.bincount(parts, series)[some] for series in (time, value))
    return tuple(total / number[some] for total in sums)


def draw_species(axes: plt.Axes, run: Run) -> None:
    """Draw kinetic energy solid and potential dotted, a colour for each species."""
    curves = [(name, "kinetic", "-") for name in run.names]
    if np.any(run.gravity):
        curves += [(name, "potential", ":") for name in run.names]
    for name, kind, style in curves:
        colour = COLOURS[run.names.index(name) % len(COLOURS)]
        time, value = (series[1:] for series in run.observable(f"{name}/{kind}_energy"))
        axes.plot(time, value, color=colour, lw=0.5, alpha=0.15)
        spaced = np.linspace if run.nature.driven else np.geomspace
        means = means_of_windows(time, value, spaced)
        axes.plot(*means, color=colour, ls=style, label=f"{kind}, {name}", **lone(time))
    axes.set_ylabel(run.units.label("energy per disk", "energy"))
    axes.set_title(f"{method(run)}: {caption([run])}")
    axes.set_ylim(0, 1.35 * axes.get_ylim()[1])
    axes.legend(ncols=2, loc="upper right", title="means; faint: samples")


def draw(runs: list[Run]) -> plt.Figure:
    """Draw two rows with one time axis."""
    figure, (top, bottom) = plt.subplots(2, 1, sharex=True, figsize=(9, 7.5))
    draw_species(top, runs[0])
    for run, colour in zip(runs, colours(len(runs), 2), strict=True):
        time, lost = change(run)
        largest = np.maximum(np.maximum.accumulate(np.abs(lost)), EPSILON / 2)
        style = {"label": f"{method(run)}: {balance(run)[1]}"} | lone(time[1:])
        bottom.semilogy(time[1:], largest[1:], color=colour, lw=1.4, **style)
    if not any(run.nature.driven for run in runs):
        bottom.set_xscale("log")
    bottom.set(
        xlabel=runs[0].units.label("time"),
        ylabel="largest change so far, over E(0)",
        xlim=(min(run.observable("total_energy").time[1] for run in runs), None),
        ylim=(EPSILON / 4, 10 * bottom.get_ylim()[1]),
    )
    bottom.legend(ncols=1 + (len(runs) > 2), loc="upper right", title="change of")
    return figure


def main() -> None:
    args = command_line(__doc__, "energy.png").parse_args()
    rows = []
    for run in args.runs:
        time, lost = change(run)
        line = np.polynomial.Polynomial.fit(time, lost, 1)
        row = {"run": run.path.name, "method": method(run), "of": balance(run)[1]}
        row |= {"total_energy": float(run.observable("total_energy").value[0])}
        row |= {"drift": float(line(time[-1]) - line(time[0]))}
        row |= {"spread": float(np.std(lost - line(time)))}
        rows.append(row | {"largest_change": float(np.abs(lost).max())})
    report(args, draw(args.runs), rows)


if __name__ == "__main__":
    launch(main)
