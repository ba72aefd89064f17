"""Energies in time, and how well the total is kept.

    python post/energy.py runs/gravity/events.h5 runs/gravity/steps_*.h5 -o energy.png

Above: mean kinetic and potential energy per disk of each species in the first run.  Below: the
relative change of the total energy in each run.  Prints, for each run and relative to the energy
at the start: the drift, that is the change over the whole run along a fitted line; the spread,
the standard deviation from that line; and the largest change.
"""

from ricochet import Run, RunError
from ricochet.drawing import COLOURS, caption, colours, plt
from ricochet.script import command_line, launch, read_all, report
from ricochet.statistics import windows

import numpy as np

EPSILON = np.finfo(float).eps  # the smallest change of a number near 1


def method(run: Run) -> str:
    """How the run was integrated, for the legend."""
    return f"time steps, Δt = {run.time_step:g}" if run.time_step else "event driven"


def total_change(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Time and E / E(0) - 1 of the total energy."""
    time, energy = run.observable("total_energy")
    if len(time) < 2:
        raise RunError(f"{run.path}: has one sample of the energies so far; nothing has changed")
    return time, energy / energy[0] - 1


def drift_and_spread(time: np.ndarray, change: np.ndarray) -> tuple[float, float]:
    """Rise of the straight line through a series from its first to its last time; scatter."""
    line = np.polynomial.Polynomial.fit(time, change, 1)
    return float(line(time[-1]) - line(time[0])), float(np.std(change - line(time)))


def draw_species(axes: plt.Axes, run: Run) -> None:
    """Kinetic solid, potential dotted, a colour per species; faint: every sample."""
    curves = [(name, "kinetic", "-") for name in run.names]
    if np.any(run.gravity):
        curves += [(name, "potential", ":") for name in run.names]
    for name, kind, style in curves:
        colour = COLOURS[run.names.index(name) % len(COLOURS)]
        time, value = run.observable(f"{name}/{kind}_energy")
        axes.plot(time, value, color=colour, lw=0.5, alpha=0.25)
        axes.plot(
            *windows(time, value, np.ptp(time) / 50),
            color=colour,
            ls=style,
            label=f"{kind}, {name}",
        )
    axes.set(ylabel="energy per disk (reduced units)", title=f"{method(run)}: {caption([run])}")
    axes.set_ylim(0, 1.35 * axes.get_ylim()[1])
    axes.legend(ncols=2, loc="upper right", title="means over 2 % of the time; faint: samples")


def draw(runs: list[Run]) -> plt.Figure:
    """Two rows with one time axis."""
    figure, (top, bottom) = plt.subplots(2, 1, sharex=True, figsize=(9, 7.5))
    draw_species(top, runs[0])
    for run, colour in zip(runs, colours(len(runs), 2), strict=True):
        time, change = total_change(run)
        size = np.maximum(np.abs(change), EPSILON / 2)
        bottom.semilogy(time, size, color=colour, lw=1, label=method(run))
    bottom.set(
        xlabel="time (reduced units)",
        ylabel="$|E(t)/E(0) - 1|$, total energy",
        xlim=(0, None),
        ylim=(EPSILON / 4, 30 * bottom.get_ylim()[1]),
    )
    bottom.legend(ncols=2, loc="upper right")
    return figure


def table(runs: list[Run]) -> list[dict]:
    """A row per run."""
    rows = []
    for run in runs:
        time, change = total_change(run)
        drift, spread = drift_and_spread(time, change)
        rows.append(
            {
                "run": run.path.name,
                "method": method(run),
                "total_energy": float(run.observable("total_energy").value[0]),
                "drift": drift,
                "spread": spread,
                "largest_change": float(np.abs(change).max()),
            }
        )
    return rows


def main() -> None:
    args = command_line(__doc__, "energy.png").parse_args()
    runs = read_all(args.runs)
    report(args, runs, "Energy", draw(runs), table(runs))


if __name__ == "__main__":
    launch(main)
