"""Time per collision against the number of disks for each way of finding the next one.

    python post/cost.py runs/cost/*.h5 -o cost.png --csv cost.csv

Reads the collisions per second that each run notes of itself; the best of equal runs counts.
Lines: powers of N through the middle of each.
"""

import numpy as np

from drawing import COLOURS, command_line, launch, plt, print_table, read_all, save, write_csv
from read_run import Run, RunError

LABELS = {
    "rescan": "everything anew at each collision",
    "pairs": "all pairs of the disks just involved",
    "cells": "neighbouring cells",
}
POWERS = {"rescan": 2, "pairs": 1, "cells": 0}


def microseconds(run: Run) -> float:
    """Time per collision in microseconds."""
    rate = float(run.provenance.get("collisions_per_second", 0))
    if rate <= 0:
        raise RunError(f"{run.path}: does not say its collisions per second")
    return 1e6 / rate


def costs(runs: list[Run]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Search -> N and the least time per collision, in ascending N."""
    least: dict[str, dict[int, float]] = {}
    for run in runs:
        points = least.setdefault(str(run.parameter("run", "search", "cells")), {})
        points[run.count] = min(microseconds(run), points.get(run.count, np.inf))
    return {search: tuple(np.array(sorted(points.items())).T) for search, points in least.items()}


def draw(measured: dict) -> plt.Figure:
    """Doubly logarithmic."""
    figure, axes = plt.subplots(figsize=(6.5, 5))
    for search, colour, marker in zip(POWERS, COLOURS, "osD", strict=False):
        if search not in measured:
            continue
        n, cost = measured[search]
        axes.loglog(
            n, cost, ls="", marker=marker, color=colour, label=f"{search}: {LABELS[search]}"
        )
        power = POWERS[search]
        line = np.median(cost / n**power) * n**power
        axes.loglog(n, line, color=colour, lw=1, label=f"$\\propto N^{power}$")
    axes.set(xlabel="number of disks N", ylabel="time per collision (µs)")
    axes.legend()
    return figure


def main() -> None:
    args = command_line(__doc__, "cost.png", table=True).parse_args()
    runs = read_all(args.runs)
    measured = costs(runs)
    table = {
        "search": [search for search, (n, _) in measured.items() for _ in n],
        "N": [int(k) for n, _ in measured.values() for k in n],
        "microseconds": [float(c) for _, cost in measured.values() for c in cost],
    }
    print_table(table)
    save(draw(measured), args.output, runs, "Cost of a collision")
    if args.csv:
        write_csv(args.csv, table)


if __name__ == "__main__":
    launch(main)
