"""Speedup of a run that uses several processor cores.

    build/ricochet gas.nml -o runs/t2_1.h5 --set run.threads=2
    python post/scaling.py runs/t*.h5 -o scaling.png --csv scaling.csv

The script compares the wall times of complete runs that differ only in `run.threads`.  If runs were
repeated, the script shows the median, the smallest and the largest of their wall times.  The shell
script runs/scaling.sh performs the runs and calls this script.
"""

from ricochet import Run, RunError
from ricochet.figures.drawing import COLOURS, plt
from ricochet.script import command_line, grouped, launch, recorded, report

import numpy as np


def table(runs: list[Run]) -> list[dict]:
    """Return a table row for each number of disks and number of threads, in ascending order."""
    groups = grouped(runs, lambda run: (run.n_disks, int(run.provenance.get("threads", 1))))
    walls = {key: [recorded(run, "wall_time") for run in same] for key, same in groups}
    rows = []
    for (disks, threads), times in walls.items():
        if (disks, 1) not in walls:
            raise RunError(f"no run of {disks} disks has one thread, which the comparison requires")
        alone = np.median(walls[disks, 1])
        row = {"disks": disks, "threads": threads, "runs": len(times)}
        row |= {"seconds": float(np.median(times)), "gain": float(alone / np.median(times))}
        rows.append(row | {"gain_least": alone / max(times), "gain_most": alone / min(times)})
    return rows


def draw(rows: list[dict]) -> plt.Figure:
    """Draw the speedup against the number of threads, with the ideal speedup as a dotted line."""
    figure, axes = plt.subplots(figsize=(7, 5.5))
    for (disks, own), colour in zip(grouped(rows, lambda row: row["disks"]), COLOURS, strict=False):
        threads, y, low, high = (
            np.array([row[name] for row in own])
            for name in ("threads", "gain", "gain_least", "gain_most")
        )
        label = f"{disks} disks"
        axes.errorbar(threads, y, (y - low, high - y), marker="o", color=colour, label=label)
    cores = (1, max(row["threads"] for row in rows))
    axes.plot(cores, cores, ls=":", lw=1, color="grey", label="threads")
    axes.set_xscale("log", base=2)
    axes.set_yscale("log", base=2)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
    axes.set(xlabel="threads", ylabel="speedup over one thread", title="Speedup on several cores")
    axes.legend()
    return figure


def main() -> None:
    args = command_line(__doc__, "scaling.png", repeated=True).parse_args()
    rows = table(args.runs)
    report(args, draw(rows), rows)


if __name__ == "__main__":
    launch(main)
