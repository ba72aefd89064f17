"""Time per collision against the number of disks, for each method of finding the next event.

    python post/cost.py runs/cost/*.h5 -o cost.png --csv cost.csv

Each output file contains the number of collisions per second of processor time.  If several runs
have the same method and number of disks, the script uses the fastest of them.  The lines are power
laws, which are fitted to the points with numbers of disks N in the range of --fit.  Below the range
of --fit, the cost of the collision itself is not small compared with the cost of the search for the
next event.  Above the range of --fit, the data of the disks do not fit into the caches of the
processor.
"""

from ricochet import Run
from ricochet.analysis.statistics import PowerLaw, fit_power_law
from ricochet.analysis.thermodynamics import packing
from ricochet.figures.drawing import COLOURS, plt
from ricochet.script import command_line, launch, recorded, report

import numpy as np

LABELS = {
    "rescan": "all pairs at each collision",
    "pairs": "all pairs of the disks just involved",
    "cells": "neighbouring cells",
}


def costs(runs: list[Run]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return the numbers of disks and the shortest times per collision [microseconds].

    The dictionary contains one pair of arrays for each method of finding the next event.
    """
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


def draw(
    runs: list[Run], measured: dict, laws: dict[str, PowerLaw], low: float, high: float
) -> plt.Figure:
    """Draw times and fits on logarithmic axes; fitted lines are dotted outside the fit range."""
    figure, axes = plt.subplots(figsize=(7, 5.5))
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
    eta = ", ".join(f"{value:g}" for value in sorted({round(packing(run), 3) for run in runs}))
    axes.set(xlabel="number of disks N", ylabel="time per collision (µs)")
    axes.set_title(f"packing fraction {eta}")
    axes.legend()
    return figure


def main() -> None:
    parser = command_line(__doc__, "cost.png", repeated=True)
    parser.add_argument(
        "--fit",
        type=float,
        nargs=2,
        default=[128, 1e4],
        metavar="N",
        help="smallest and largest number of disks in the fits [128 1e4]",
    )
    args = parser.parse_args()
    measured = costs(args.runs)
    laws = fits(measured, *args.fit)
    table = [
        {"search": search, "N": int(n), "microseconds": float(cost)}
        for search, points in measured.items()
        for n, cost in zip(*points, strict=True)
    ]
    exponents = [
        {"search": search, "exponent": law.exponent, "exponent_error": float(law.exponent_error)}
        for search, law in laws.items()
    ]
    report(args, draw(args.runs, measured, laws, *args.fit), table, exponents)


if __name__ == "__main__":
    launch(main)
