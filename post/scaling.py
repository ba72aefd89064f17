"""How much faster a run is on several cores, beside the most that the work of one core allows.

    RICOCHET_TIMES=1 build/ricochet gas.nml -o runs/t2_1.h5 --set run.threads=2 2>runs/t2_1.times
    python post/scaling.py runs/t*.h5 -o scaling.png --csv scaling.csv

Wall time of whole runs that differ in `run.threads` alone, the median over equal ones with the
least and the largest.  Where a file NAME.times beside NAME.h5 holds what RICOCHET_TIMES=1 printed,
the parts with a star are taken for what more cores can share, and one core does the rest: lines by
Amdahl, AFIPS Conf. Proc. 30, 483 (1967).  runs/scaling.sh does it all.
"""

import re
from collections import defaultdict
from pathlib import Path

from ricochet import Run, RunError
from ricochet.drawing import COLOURS, plt
from ricochet.script import command_line, launch, read_all, report

import numpy as np

PART = re.compile(r"^(\*?) ?(\S.*?) +([\d.]+) s +[\d.]+ %$", re.MULTILINE)
WAITING = "waiting for other threads"


def wall_time(run: Run) -> float:
    """Of the whole process, in seconds."""
    seconds = float(run.provenance.get("wall_time", 0))
    if seconds <= 0:
        raise RunError(f"{run.path}: is not finished: records no wall time")
    return seconds


def share_of_one(run: Run) -> float | None:
    """Share of the work that one core does while the others wait; None: nothing was measured."""
    told = Path(run.path).with_suffix(".times")
    parts = PART.findall(told.read_text()) if told.is_file() else []
    shared = threads(run) * sum(float(seconds) for star, _, seconds in parts if star)
    alone = sum(float(seconds) for star, name, seconds in parts if not star and name != WAITING)
    return alone / (alone + shared) if shared else None


def threads(run: Run) -> int:
    """How many the run had."""
    return int(run.provenance.get("threads", 1))


def rows(runs: list[Run]) -> list[dict]:
    """One for each number of disks and threads, in ascending order."""
    walls, shares = defaultdict(list), defaultdict(list)
    for run in runs:
        key = run.count, threads(run)
        walls[key].append(wall_time(run))
        share = share_of_one(run)
        if share is not None:
            shares[key].append(share)
    table = []
    for (disks, n), times in sorted(walls.items()):
        if (disks, 1) not in walls:
            raise RunError(f"no run of {disks} disks has one thread to compare the others with")
        alone = np.median(walls[disks, 1])
        known = [np.median(shares[key]) for key in sorted(shares) if key[0] == disks]
        table.append(
            {
                "disks": disks,
                "threads": n,
                "runs": len(times),
                "seconds": float(np.median(times)),
                "gain": float(alone / np.median(times)),
                "gain_least": float(alone / max(times)),
                "gain_most": float(alone / min(times)),
                "bound": float(gain(known[-1], n)) if known else None,
                "alone": float(known[-1]) if known else None,
            }
        )
    return table


def gain(alone: float, cores: np.ndarray | int) -> np.ndarray | float:
    """Of so many cores over one that does a share of the work alone."""
    return 1 / (alone + (1 - alone) / cores)


def draw(table: list[dict]) -> plt.Figure:
    """Gain against threads; dashed the bound, dotted what perfect sharing would give."""
    figure, axes = plt.subplots(figsize=(7, 5.5))
    most = max(64, *(row["threads"] for row in table))
    cores = np.geomspace(1, most, 100)
    sizes = sorted({row["disks"] for row in table})
    for disks, colour in zip(sizes, COLOURS, strict=False):
        own = [row for row in table if row["disks"] == disks]
        y = np.array([row["gain"] for row in own])
        reach = [[row["gain_least"] for row in own], [row["gain_most"] for row in own]]
        axes.errorbar(
            [row["threads"] for row in own], y, np.abs(np.array(reach) - y),
            marker="o", color=colour, label=f"{disks} disks",
        )  # fmt: skip
        if own[-1]["alone"] is not None:
            axes.plot(cores, gain(own[-1]["alone"], cores), ls="--", lw=1, color=colour)
    axes.plot(cores, cores, ls=":", lw=1, color="grey", label="threads")
    axes.plot([], [], ls="--", lw=1, color="grey", label="bound by what one core does alone")
    axes.set_xscale("log", base=2)
    axes.set_yscale("log", base=2)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
    axes.set(xlabel="threads", ylabel="times as fast as one", title="Gain by several cores")
    axes.legend()
    return figure


def main() -> None:
    parser = command_line(__doc__, "scaling.png")
    args = parser.parse_args()
    runs = read_all(args.runs)
    table = rows(runs)
    report(args, runs, "Gain by several cores", draw(table), table)


if __name__ == "__main__":
    launch(main)
