"""How often does a printed error bar hold the truth?

    python post/coverage.py runs/coverage/*/*.h5 -o coverage.png --csv coverage.csv

Many runs that differ only by their seed, at one or more packing fractions.  Each gives Z by the
virial with its error, half of the 68 % interval; the truth is the mean over all runs of a packing
fraction.  Right errors hold it in 68 of 100 runs, and are as large as the scatter of the means.
For comparison: the error that takes every sample of the observables for independent.
"""

from ricochet import Run, RunError
from ricochet.drawing import COLOURS, caption, plt
from ricochet.script import command_line, grouped, launch, read_all, report
from ricochet.statistics import SeriesMean
from ricochet.thermodynamics import packing, steps, temperature, z_virial

import numpy as np
import scipy

SHOWN = 60  # runs in a panel


def naive_error(run: Run, skip: float | None) -> float:
    """Standard error of Z by the virial, if samples had no memory."""
    s = steps(run, skip)
    rest = s.virial - s.time * np.sum(s.virial) / np.sum(s.time)
    return float(scipy.stats.sem(rest) / np.mean(s.time) / (2 * run.count * temperature(run)))


def table(groups: list, means: list[list[SeriesMean]], skip: float | None) -> list[dict]:
    """A row per packing fraction."""
    rows = []
    for (eta, runs), members in zip(groups, means, strict=True):
        if len(runs) < 10:
            raise RunError(f"{runs[0].path}: needs at least 10 seeds per packing fraction")
        z, error = np.array([(one.mean, one.error) for one in members]).T
        off = np.abs(z - z.mean())
        naive = np.array([naive_error(run, skip) for run in runs])
        rows.append(
            {
                "packing": eta,
                "runs": len(runs),
                "Z": float(z.mean()),
                "scatter": float(z.std(ddof=1)),
                "error": float(error.mean()),
                "within_%": float(100 * np.mean(off < error)),
                "naive_error": float(naive.mean()),
                "naive_within_%": float(100 * np.mean(off < naive)),
            }
        )
    return rows


def draw(groups: list, means: list[list[SeriesMean]], rows: list[dict]) -> plt.Figure:
    """Per packing fraction the runs in order of their mean, with error bars."""
    figure, panels = plt.subplots(
        1, len(groups), squeeze=False, figsize=(max(5, 3.6 * len(groups)), 4.2)
    )
    for axes, members, row in zip(panels[0], means, rows, strict=True):
        ordered = sorted(members[:SHOWN], key=lambda one: one.mean)
        for k, one in enumerate(ordered):
            holds = abs(one.mean - row["Z"]) < one.error
            style = {"color": COLOURS[0] if holds else COLOURS[1], "ms": 2.5, "lw": 1}
            axes.errorbar(k, one.mean, one.error, marker="o", **style)
        axes.axhline(row["Z"], color="black", lw=1)
        axes.set_title(f"η = {row['packing']:g}: {row['within_%']:.0f} % of {row['runs']} hold it")
        axes.set(xticks=[], xlabel=f"{len(ordered)} runs, in order of their mean")
    panels[0, 0].set_ylabel("$Z = P\\,/\\,(n\\,kT)$ of a run")
    figure.suptitle(caption([run for _, runs in groups for run in runs]), fontsize=10)
    return figure


def main() -> None:
    args = command_line(__doc__, "coverage.png", skip=None).parse_args()
    runs = read_all(args.runs)
    groups = grouped(runs, lambda run: round(packing(run), 6))
    means = [[z_virial(run, args.skip) for run in members] for _, members in groups]
    rows = table(groups, means, args.skip)
    report(args, runs, "How often an error bar holds the truth", draw(groups, means, rows), rows)


if __name__ == "__main__":
    launch(main)
