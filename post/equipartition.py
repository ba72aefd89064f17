"""Time after which the kinetic energies of two species under gravity are equal.

    python post/equipartition.py runs/gravity_v0/*.h5 -o equipartition.png --csv times.csv

Runs with the same width v0 of the initial velocity distribution are combined.  Energies are
averaged over the runs, and over windows of time of the length --window.  The thermalisation time
T_therm is the time at which the relative difference of the two energies falls below --within and
stays below this value for three windows.  The error of T_therm is determined by the bootstrap
method: the value of T_therm is calculated again for random choices of the runs.  With few runs
T_therm is overestimated, because noise raises the energy difference above the limit again.  The
overestimate is 16 % on average for ten runs of 60 disks, and less than 1 % for 100 runs.  For a
single run, the error of the relative energy difference is the fluctuation of the ratio of the two
energies in the second half of the run.  For a single run, the error limits of T_therm are the
values of T_therm for the energy difference minus its error and plus its error.  In single runs with
30 disks of each species, the error of the relative energy difference is 26 %, which is too large to
determine T_therm; therefore many runs or many disks are required.  In the table, K_light and
K_heavy are mean energies in equilibrium, which begins after the first X collisions per disk, where
X is the value of --equilibration and by default 15, or later if an observable drifts significantly
after 15 collisions per disk.
"""

from collections.abc import Callable
from functools import reduce
from typing import NamedTuple

from ricochet import Run
from ricochet.analysis.estimates import ONE_SIGMA
from ricochet.analysis.statistics import (
    Estimate,
    estimate,
    propagate_error,
    rounded_to_error,
    student,
    windows,
)
from ricochet.analysis.equilibrium import relaxed_start
from ricochet.analysis.thermodynamics import lightest_and_heaviest
from ricochet.figures.drawing import caption, colours, plt
from ricochet.reading.nature import SETTLED, allow
from ricochet.script import command_line, grouped, launch, measured, report

import numpy as np


RESAMPLED = 400  # random choices of the runs


class Approach(NamedTuple):
    """Kinetic energies of the two species in consecutive windows of time."""

    time: np.ndarray  # (W,) middles
    light: Estimate  # (W,)
    heavy: Estimate
    gap: Estimate  # (W,) heavy / light - 1
    thermalisation: Estimate  # NaN if they never agree or the error is too large


def entry(time: np.ndarray, gap: np.ndarray, within: float = 0.1, lasting: int = 3) -> float:
    """Return the interpolated time at which an energy difference (W,) falls below `within`.

    The difference must stay below `within` for at least `lasting` windows.
    """
    close = gap <= within
    for k in range(len(time) - lasting + 1):
        if close[k : k + lasting].all():
            both = [k, max(k - 1, 0)]
            return float(np.interp(within, gap[both], time[both]))
    return float("nan")


def approach(runs: list[Run], width: float, within: float) -> Approach:
    """Return the mean energies of the lightest and heaviest species in each window of time."""
    both = []
    for kind in lightest_and_heaviest(runs[0]):
        name = runs[0].names[kind]
        tracks = [windows(*run.observable(f"{name}/kinetic_energy"), width) for run in runs]
        time = reduce(np.intersect1d, [middles for middles, _ in tracks])  # end of the shortest run
        both.append(np.array([values[np.isin(middles, time)] for middles, values in tracks]))
    light, heavy = map(estimate, both)
    difference = estimate(both[1] - both[0])
    gap = Estimate(difference.mean / light.mean, difference.error / light.mean)
    if len(runs) == 1:
        gap = Estimate(gap.mean, np.full_like(gap.mean, np.std(gap.mean[len(time) // 2 :])))
        agreed = propagate_error(
            lambda curve: entry(time, curve, within), gap._replace(mean=np.abs(gap.mean))
        )
    else:
        agreed = over_runs(lambda own: entry(time, np.abs(own[1] / own[0] - 1), within), both)
    return Approach(time, light, heavy, gap, agreed)


def over_runs(of: Callable[[np.ndarray], float], both: list[np.ndarray]) -> Estimate:
    """Return the value of a function of the mean energies (2, W) of R runs, with a bootstrap error.

    The argument `both` contains the energies (R, W) of the two species.  The function is calculated
    for many random choices of R of the runs, with replacement.  In 68 % of the choices the result
    deviates by less than the error from the result for all runs.  The jackknife would not be
    suitable, because the function jumps where noise raises a curve above a limit: the omission of
    one run seldom causes a jump, and then changes the error by a large factor.  The result is NaN
    if the function is NaN for the mean energies of all runs, or for more than 32 % of the choices.
    """
    tracks, count = np.array(both), len(both[0])
    mean = tracks.mean(axis=1)
    whole = of(mean)
    chosen = np.random.default_rng(1).multinomial(count, np.full(count, 1 / count), RESAMPLED)
    means = np.einsum("cr,krw->ckw", chosen / count, tracks)
    spread = np.sqrt(count / (count - 1))  # resampled means scatter too little by this factor
    values = np.array([of(mean + spread * (own - mean)) for own in means])
    values[np.isnan(values)] = np.inf
    apart = np.quantile(np.abs(values - whole), 2 * ONE_SIGMA - 1, method="nearest")
    error = float(apart) * float(student(count))
    return Estimate(whole, error) if np.isfinite(error) else Estimate(np.nan, np.nan)


def late(runs: list[Run], name: str, skip: float | None) -> Estimate:
    """Return the mean of an observable in equilibrium over all runs."""
    means = []
    for run in runs:
        time, value = run.observable(name)
        means.append(value[time >= relaxed_start(run, skip)[0]].mean())
    return estimate(means)


def start_width(run: Run) -> float:
    """Return v0, which is the largest value of the input variable `speed`."""
    species = run.parameters.get("species", {})
    return max(float(species.get(name, {}).get("speed", 0.0)) for name in run.names)


def draw(groups: list, results: list[Approach], until: float, within: float) -> plt.Figure:
    """Draw the energies against time, in a separate panel for each v0."""
    figure, panels = plt.subplots(
        len(groups), 1, sharex=True, squeeze=False, figsize=(8, 1.2 + 2.1 * len(groups))
    )
    first = groups[0][1][0]
    order, shades = lightest_and_heaviest(first), colours(len(first.names))
    for axes, (v0, runs), found in zip(panels.flat, groups, results, strict=True):
        for k, energy in zip(order, (found.light, found.heavy), strict=True):
            style = {"color": shades[k], "marker": ".", "label": first.names[k]}
            axes.errorbar(found.time, *energy, **style)
        if np.isfinite(found.thermalisation.mean):
            label = f"means differ by less than {100 * within:g} % for three windows from t = "
            label += " ± ".join(rounded_to_error(*found.thermalisation))
            axes.axvline(found.thermalisation.mean, color="0.5", ls="--", lw=1, label=label)
        axes.set(title=f"$v_0$ = {v0:g},  {caption(runs)}", xlim=(0, until))
        axes.set_ylabel(first.units.label("⟨K⟩", "energy"))
        axes.set_ylim(0, None)
        axes.legend(ncols=3, loc="lower right")
    panels[-1, 0].set_xlabel(first.units.label("time"))
    return figure


def main() -> None:
    parser = command_line(__doc__, "equipartition.png", equilibration="15, or until no drift")
    parser.add_argument(
        "--window", type=float, default=0.5, help="duration of each window of time [0.5]"
    )
    parser.add_argument(
        "--within",
        type=float,
        default=0.1,
        help="largest relative difference of equal energies [0.1]",
    )
    parser.add_argument("--until", type=float, default=20, help="end of the time axis [20]")
    args = parser.parse_args()
    for run in args.runs:
        allow(run, "its species do not reach a common temperature", *SETTLED)
    groups, rows, notes = grouped(args.runs, start_width), [], []
    results = [approach(runs, args.window, args.within) for _, runs in groups]
    for (v0, runs), found in zip(groups, results, strict=True):
        row = {"v0": v0, "runs": len(runs), **measured("T_therm", found.thermalisation)}
        total = late(runs, "total_energy", args.equilibration)
        row |= measured("energy", Estimate(*(part / runs[0].n_disks for part in total)))
        for which, kind in zip(("light", "heavy"), lightest_and_heaviest(runs[0]), strict=True):
            name = f"{runs[0].names[kind]}/kinetic_energy"
            row |= measured(f"K_{which}", late(runs, name, args.equilibration))
        rows.append(row)
        if np.isnan(found.thermalisation.mean):
            known, share = 2 * np.median(found.gap.error) <= args.within, f"{100 * args.within:g} %"
            why = f"the error of the energy difference exceeds {share}; use more runs or disks"
            why = f"the energies never agree within {share}" if known else why
            notes.append(f"v0 = {v0:g}: no T_therm; {why}")
    figure = draw(groups, results, args.until, args.within)
    report(args, figure, rows, notes=notes)


if __name__ == "__main__":
    launch(main)
