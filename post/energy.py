"""Energies against time, and conservation of the total energy.

    python post/energy.py runs/gravity/events.h5 runs/gravity/steps_*.h5 -o energy.png

The panels of the first row show the total energy and its parts against time on linear axes.  In the
first row, there is one panel for each time step, which shows the first run with this time step.
The second row shows the mean kinetic and potential energy per disk of each species in the first
run, against linear and logarithmic time.  For driven disks there is no panel with logarithmic time.
The lowest panel shows for each run the largest relative change of the conserved quantity between
the start and each time.  The conserved quantity is the total energy or, if energy is exchanged,
total + dissipated - heat - work - drive.

The conservation of energy does not depend on the time step: between collisions the disks follow
exact parabolas, and every collision conserves energy, so all changes are rounding errors.  With
large time steps, the error is that collisions are missed, and the script missed.py counts missed
collisions.

The table contains three numbers for each run: the drift, the spread and the largest change of the
conserved quantity.  The drift is the change over the whole run of a straight line that is fitted to
the conserved quantity.  The spread is the standard deviation of the conserved quantity from the
fitted line.  The largest change is the largest difference of the conserved quantity from its
initial value.  The drift, the spread and the largest change are given relative to the total energy
at the start or, if the total energy at the start is 0, relative to the largest total energy.
"""

from collections.abc import Callable

from ricochet import Run, RunError
from ricochet.figures.drawing import COLOURS, caption, colours, lone, plt
from ricochet.reading.nature import Refused
from ricochet.script import command_line, launch, report

import numpy as np

EPSILON = np.finfo(float).eps  # rounding unit of a number near 1
WINDOWS = 60  # windows of time
MOST_PANELS = 4
ROUNDING = 1e-9  # largest relative change that rounding can explain
WHY_EXACT = "flights and collisions are exact except for rounding; larger steps miss collisions"


def method(run: Run) -> str:
    """Return the name of the simulation method of a run, for the legend of a figure."""
    return f"time steps, Δt = {run.time_step:g}" if run.time_step else "event driven"


def balance(run: Run) -> tuple[np.ndarray, str]:
    """Return the time series of the conserved quantity, and the names of the energies in it."""
    energy, words = run.observable("total_energy").value, "total"
    size = 1e-9 * np.abs(energy).max()
    for sign, term in ((1, "dissipated_energy"), (-1, "heat"), (-1, "work"), (-1, "drive_energy")):
        value = run.observable(term).value if term in run.observables else 0.0
        if np.abs(value).max() > size:
            energy = energy + sign * value
            words += f" {'+-'[sign < 0]} {term.removesuffix('_energy')}"
    return energy, words


def change(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return the times and the relative changes of the conserved quantity."""
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
    """Draw kinetic energies (solid lines) and potential energies (dotted lines) of all species.

    The function `spaced` divides the time into windows; it is `np.linspace`, or `np.geomspace` for
    a logarithmic axis.
    """
    curves = [(name, "kinetic", "-") for name in run.names]
    if np.any(run.gravity):
        curves += [(name, "potential", ":") for name in run.names]
    for name, kind, style in curves:
        colour = COLOURS[run.names.index(name) % len(COLOURS)]
        time, value = (series[1:] for series in run.observable(f"{name}/{kind}_energy"))
        axes.plot(time, value, color=colour, lw=0.5, alpha=0.15)
        means = means_of_windows(time, value, spaced)
        axes.plot(*means, color=colour, ls=style, label=f"{kind}, {name}", **lone(time))
    axes.set_ylabel(run.units.label("energy per disk", "energy"))
    axes.set(xlabel=run.units.label("time"), ylim=(0, 1.35 * axes.get_ylim()[1]))
    if spaced is np.geomspace:
        axes.set_xscale("log")
    else:
        axes.set_xlim(0, run.observable("total_energy").time[-1])


def of_each_method(runs: list[Run]) -> list[Run]:
    """Return the first run of each method and time step, but at most `MOST_PANELS` runs."""
    first: dict[float, Run] = {}
    for run in runs:
        first.setdefault(run.time_step, run)
    return list(first.values())[:MOST_PANELS]


def draw_total(axes: plt.Axes, run: Run) -> None:
    """Draw the total energy of a run and its parts against time on linear axes."""
    time, total = run.observable("total_energy")
    axes.plot(time, total, color="black", lw=1.6, label="$E_{tot}$", zorder=3, **lone(time))
    for kind, colour in (("kinetic", COLOURS[2]), ("potential", COLOURS[3])):
        if f"all/{kind}_energy" in run.observables and np.any(run.gravity):
            part = run.n_disks * run.observable(f"all/{kind}_energy").value
            axes.plot(time, part, color=colour, lw=0.8, label=f"{kind} energy")
    constant, words = balance(run)
    if words != "total":
        axes.plot(time, constant, color="0.5", ls="--", lw=1.2, label=words)
    _, lost = change(run)
    axes.set_title(f"{method(run)}\nlargest change {np.abs(lost).max():.2g}", fontsize="medium")
    axes.set(xlabel=run.units.label("time"), xlim=(time[0], time[-1]))


def draw(runs: list[Run]) -> plt.Figure:
    """Draw total energies, energies of each species, and changes of the conserved quantity."""
    shown = of_each_method(runs)
    figure = plt.figure(figsize=(max(9, 3.2 * len(shown)), 10.5))
    grid = figure.add_gridspec(3, len(shown), height_ratios=(1, 1.3, 1.3))
    totals = [figure.add_subplot(grid[0, k]) for k in range(len(shown))]
    for axes, run in zip(totals, shown, strict=True):
        axes.sharey(totals[0])
        draw_total(axes, run)
        axes.tick_params(labelleft=axes is totals[0])
    totals[0].set_ylabel(runs[0].units.label("energy of all disks", "energy"))
    totals[0].set_ylim(min(0, totals[0].get_ylim()[0]), 1.45 * totals[0].get_ylim()[1])
    totals[0].legend(loc="upper right", ncols=1 + (len(shown) < 3))
    scales = (np.linspace,) if runs[0].nature.driven else (np.linspace, np.geomspace)
    parts = grid[1, :].subgridspec(1, len(scales))
    left, *_ = (figure.add_subplot(parts[k]) for k in range(len(scales)))
    for axes, spaced in zip(figure.axes[-len(scales) :], scales, strict=True):
        draw_species(axes, runs[0], spaced)
    left.set_title(f"{method(runs[0])}: {caption(runs[:1])}")
    left.legend(ncols=2, loc="upper right", title="means over windows; faint: samples")
    draw_changes(figure.add_subplot(grid[2, :]), runs)
    return figure


def draw_changes(axes: plt.Axes, runs: list[Run]) -> None:
    """Draw for each run the largest change of the conserved quantity up to each time."""
    worst = 0.0
    for run, colour in zip(runs, colours(len(runs), 2), strict=True):
        time, lost = change(run)
        largest = np.maximum(np.maximum.accumulate(np.abs(lost)), EPSILON / 2)
        worst = max(worst, float(largest[-1]))
        style = {"label": f"{method(run)}: {balance(run)[1]}"} | lone(time[1:])
        axes.semilogy(time[1:], largest[1:], color=colour, lw=1.4, **style)
    if not any(run.nature.driven for run in runs):
        axes.set_xscale("log")
    axes.set(
        xlabel=runs[0].units.label("time"),
        ylabel="largest change so far, over E(0)",
        xlim=(min(run.observable("total_energy").time[1] for run in runs), None),
        ylim=(EPSILON / 4, 10 * axes.get_ylim()[1]),
    )
    axes.legend(ncols=1 + (len(runs) > 2), loc="upper right", title="change of")
    if any(run.time_step for run in runs) and worst < ROUNDING:
        axes.set_title(WHY_EXACT, fontsize="medium")


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
