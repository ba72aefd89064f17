"""Speedup of runs on several processor cores."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from ...figures.drawing import COLOURS, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...reading.files import counted
from ...reading.reader import Run, RunError
from ..groups import Group, each_run, grouped
from ..options import recorded
from ..registry import Analysis
from ..result import Result


def table(runs: list[Run]) -> list[dict[str, Any]]:
    """Return a table row for each number of disks and of threads, in increasing order."""
    groups = grouped(runs, lambda run: (run.n_disks, int(run.provenance.get("threads", 1))))
    walls = {key: [recorded(run, "wall_time") for run in same] for key, same in groups}
    rows = []
    for (disks, threads), times in walls.items():
        if (disks, 1) not in walls:
            raise RunError(
                f"no run of {counted(disks, 'disk')} has one thread, which the comparison requires"
            )
        alone = np.median(walls[disks, 1])
        row = {"disks": disks, "threads": threads, "runs": len(times)}
        row |= {"seconds": float(np.median(times)), "gain": float(alone / np.median(times))}
        rows.append(row | {"gain_least": alone / max(times), "gain_most": alone / min(times)})
    return rows


def draw_speedup(axes: plt.Axes, result: Result) -> None:
    """Plot the speedup against the number of threads, with the ideal speedup dotted."""
    rows = result.table
    for (disks, own), colour in zip(grouped(rows, lambda row: row["disks"]), COLOURS, strict=False):
        threads, y, low, high = (
            np.array([row[name] for row in own])
            for name in ("threads", "gain", "gain_least", "gain_most")
        )
        label = counted(disks, "disk")
        axes.errorbar(threads, y, (y - low, high - y), marker="o", color=colour, label=label)
    cores = (1, max(row["threads"] for row in rows))
    axes.plot(cores, cores, ls=":", lw=1, color="grey", label="threads")
    axes.set_xscale("log", base=2)
    axes.set_yscale("log", base=2)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
    axes.set(xlabel="threads", ylabel="speedup over one thread", title="Speedup on several cores")
    legend_above(axes)


def draw(result: Result) -> Sheet:
    """Plot the speedup."""
    return Sheet([[Panel("speedup", draw_speedup, (result,), aspect=0.7)]])


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return the speedup for each number of disks and of threads."""
    notes = ["Points: medians of the wall times. Bars: smallest and largest speedup."]
    return Result(table(groups[0].runs), notes=notes)


ANALYSIS = Analysis(compute, draw, repeated=True, averages=each_run)
