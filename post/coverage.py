"""Fraction of error bars that contain the true value (coverage of the error bars).

    python post/coverage.py runs/coverage/*/*.h5 -o coverage.png --csv coverage.csv

The script requires many runs at each of one or more packing fractions; the runs at one packing
fraction differ only by their seed.  For each run, the script calculates the compressibility factor
Z from the virial, and the error of Z, which is half the width of the 68 % confidence interval. The
mean of Z over all runs at a packing fraction is taken as the true value.  If the errors are
correct, 68 % of the intervals contain the true value, and the errors are equal to the standard
deviation of Z over the runs.  For comparison, the script also calculates a naive error, which
assumes that all samples of the observables are independent.
"""

from ricochet import Run, RunError
from ricochet.analysis.thermodynamics import FLUID, virial_over_kt, z_virial
from ricochet.figures.drawing import COLOURS, caption, plt
from ricochet.reading.nature import allow
from ricochet.script import by_packing, command_line, launch, report

import numpy as np
import scipy

SHOWN = 60  # runs in a panel


def naive_error(run: Run, skip: float | None) -> float:
    """Return the standard error of Z if all samples of the virial are assumed to be independent."""
    amount, per = virial_over_kt(run, skip)
    return float(scipy.stats.sem(amount - per * np.sum(amount) / np.sum(per)) / np.mean(per))


def main() -> None:
    args = command_line(__doc__, "coverage.png", equilibration=None).parse_args()
    for run in args.runs:
        allow(run, "the equation of state is not defined for it", *FLUID)
    groups, rows = by_packing(args.runs), []
    figure, panels = plt.subplots(
        1, len(groups), squeeze=False, figsize=(max(5, 3.6 * len(groups)), 4.2)
    )
    for (eta, runs), axes in zip(groups, panels[0], strict=True):
        if len(runs) < 10:
            raise RunError(f"{runs[0].path}: needs at least 10 seeds per packing fraction")
        z, error = np.array([z_virial(run, args.equilibration)[:2] for run in runs]).T
        naive = np.array([naive_error(run, args.equilibration) for run in runs])
        row = {"packing": eta, "runs": len(runs), "Z": float(z.mean())}
        row |= {"scatter": float(z.std(ddof=1)), "error": float(error.mean())}
        row |= {"within_%": float(100 * np.mean(np.abs(z - z.mean()) < error))}
        row |= {"naive_error": float(naive.mean())}
        row |= {"naive_within_%": float(100 * np.mean(np.abs(z - z.mean()) < naive))}
        rows.append(row)
        first = np.argsort(z[:SHOWN])
        for k, (mean, reach) in enumerate(zip(z[first], error[first], strict=True)):
            style = {"color": COLOURS[0 if abs(mean - row["Z"]) < reach else 1], "ms": 2.5, "lw": 1}
            axes.errorbar(k, mean, reach, marker="o", **style)
        axes.axhline(row["Z"], color="black", lw=1)
        axes.set_title(f"η = {eta:g}: {row['within_%']:.0f} % of {len(runs)} contain it")
        axes.set(xticks=[], xlabel=f"{len(first)} runs, in order of their mean")
    panels[0, 0].set_ylabel("$Z = P\\,/\\,(n\\,kT)$ of a run")
    figure.suptitle(caption(args.runs))
    report(args, figure, rows)


if __name__ == "__main__":
    launch(main)
