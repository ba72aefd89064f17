"""Discharge rate of a refilled hopper against the width of its mouth, with Beverloo's law.

    python post/discharge.py runs/hopper/*.h5 -o discharge.png --csv discharge.csv

Each run must contain a hopper, whose mouth is the gap between the ends of two straight walls, and
must recycle the disks that leave the mouth (drive.kind = 'recycle').  The rate W is the number of
disks that are recycled per unit of time; recycled disks are counted after the time --after.  D is
the width of the mouth and d the mean diameter of the disks.  Under gravity g, Beverloo's law in two
dimensions is W = C sqrt(g / d) (D / d - k)^(3/2).  The table contains W in disks per time, and the
dimensionless rate W_reduced = W sqrt(d / g).  If all runs have one value of D, the figure shows the
rate against time, from which the start of the steady state can be read.  If the runs have several
values of D, the figure shows W_reduced against D / d.  If the runs have at least three values of D,
the script determines C and k by a fit.  In a second fit the exponent is free, and k has the fixed
value 1.4.  If the radii are drawn (polydispersity), each seed has a different sample of radii, on
which W depends.  The error of W then follows from the scatter of the runs.  The error of a single
run does not contain the scatter between samples of radii, and the script prints a warning.
Beverloo, Leniger and van de Velde, Chemical Engineering Science 15, 260 (1961), measured k = 1.4 in
three dimensions, where the exponent is 5/2.  Beverloo's law applies to rough disks.  The rate of
smooth disks increases with the height of the bed.
"""

from typing import NamedTuple

from ricochet import Run, RunError
from ricochet.analysis.statistics import (
    Estimate,
    SeriesMean,
    combine_runs,
    correlated_mean,
    diagnostics,
    estimate,
    fit_law,
    fit_power_law,
    rounded_to_error,
    windows,
)
from ricochet.figures.drawing import COLOURS, caption, plt
from ricochet.reading.nature import Refused
from ricochet.script import command_line, grouped, launch, measured, not_negative, report

import numpy as np

EXPONENT = 1.5  # of Beverloo's law in two dimensions
BEVERLOO = 1.4  # k of Beverloo, Leniger and van de Velde (1961)
WINDOWS = 50  # number of mean rates in a figure against time


def mouth(run: Run) -> float:
    """Return the shortest distance between an end of a wall and an end of another wall."""
    ends = run.walls
    gaps = [
        np.linalg.norm(one - other)
        for k in range(len(ends))
        for other_wall in ends[k + 1 :]
        for one in ends[k]
        for other in other_wall
    ]
    if not gaps:
        raise Refused(f"{run.path}: has no mouth between the ends of two straight walls (&wall)")
    return float(min(gaps))


def reduced_width(run: Run) -> float:
    """Return the width of the mouth divided by the mean diameter of the disks."""
    return round(mouth(run) / (2 * float(run.radius.mean())), 6)


def rate(run: Run, after: float):
    """Return the mean number of recycled disks per time after the time `after`."""
    time, rates = rates_of(run)
    late = time[:-1] >= after
    if late.sum() < 2:
        count = int(np.sum(time >= after))
        raise RunError(f"{run.path}: has {count} samples after t = {after:g}; needs 3")
    return correlated_mean(rates[late])


def reduction(run: Run) -> float:
    """Return the factor sqrt(d / g), by which a rate is multiplied to make it dimensionless."""
    return float(np.sqrt(2 * run.radius.mean() / np.linalg.norm(run.gravity)))


def rates_of(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return the sampling times (T,), and the numbers of recycled disks per time between them."""
    if "recycled" not in run.nature:
        raise Refused(f"{run.path}: recycles no disks (drive.kind = 'recycle')")
    if not np.any(run.gravity):
        raise Refused(f"{run.path}: has no gravity (box.gravity)")
    time, count = run.observable("recycled")
    return time, np.diff(count) / np.diff(time)


def draws_radii(run: Run) -> bool:
    """Return whether the program drew the radii of disks at random, as with polydispersity."""
    species = run.parameters.get("species", {})
    return any(float(species.get(name, {}).get("polydispersity", 0.0)) > 0 for name in run.names)


def fitted(
    x: np.ndarray, y: np.ndarray, error: np.ndarray | None = None, runs: np.ndarray | float = np.inf
) -> dict[str, Estimate]:
    """Return C and k of the first fit and the exponent of the second fit, with their errors.

    The errors follow from the errors (M,) of the reduced rates `y`, each estimated from `runs`
    independent values, or without `error` from the scatter of the points.
    """
    largest = x.min() - 1e-6

    def law(x: np.ndarray, c: float, k: float) -> np.ndarray:
        return np.log(c) + EXPONENT * np.log(x - k)

    start = y.max() / x[np.argmax(y)] ** EXPONENT, min(1.0, largest - 1)
    first = fit_law(law, x, y, start, error, runs, bounds=((1e-9, -10), (np.inf, largest)))
    second = fit_power_law(x - BEVERLOO, y, error, runs)
    if first is None or second is None:
        return {}
    both = map(Estimate, first.values, first.errors)
    exponent = Estimate(second.exponent, second.exponent_error)
    return dict(zip(("C", "k", "exponent"), (*both, exponent), strict=True))


def mean_rate(runs: list[Run], members: list[SeriesMean]) -> SeriesMean:
    """Return the mean of the rates of runs with one mouth.

    If the radii are drawn, the error of the mean of several runs is that of their scatter.
    """
    if len(runs) < 2 or not any(map(draws_radii, runs)):
        return combine_runs(members)
    drift = sum(one.drift for one in members) / len(members) ** 0.5
    means = estimate([one.mean for one in members])
    return SeriesMean(*map(float, means), len(members), drift, len(members) - 1)


class Rates(NamedTuple):
    """Rates against the width of the mouth."""

    rows: list[dict]  # a table row for each of the M widths
    notes: list[str]
    independent: np.ndarray  # (M,) number of independent values from which the error follows
    complete: bool  # whether the errors contain the scatter between samples of radii


def measured_rates(runs: list[Run], after: float) -> Rates:
    """Measure the rate for each width of the mouth."""
    rows, notes, independent, complete = [], [], [], True
    mouths = grouped(runs, lambda run: round(mouth(run), 9))
    for _, same in sorted(mouths, key=lambda pair: pair[0]):
        members = [rate(run, after) for run in same]
        width = round(float(np.mean([reduced_width(run) for run in same])), 6)
        whole = mean_rate(same, members)
        notes += diagnostics(f"D = {width:g} d", members)
        if len(same) < 2 and draws_radii(same[0]):
            complete = False
            notes.append(
                f"D = {width:g} d: the error of a single run does not contain the scatter between "
                "samples of radii (polydispersity); use several seeds"
            )
        row = {"D_over_d": width, "runs": len(same)} | measured("W", whole)
        reduced = [one.scaled(reduction(run)) for one, run in zip(members, same, strict=True)]
        row |= measured("W_reduced", mean_rate(same, reduced))
        rows.append(row | {"samples": round(whole.samples, 1)})
        independent.append(whole.freedom + 1)
    return Rates(rows, notes, np.array(independent), complete)


def fit_of(found: Rates) -> dict[str, Estimate]:
    """Fit Beverloo's law to measured rates; return an empty dictionary for fewer than 3 widths.

    If the errors of the rates are unknown or incomplete, the errors of the fit follow from the
    scatter of the points.
    """
    x, y, error = columns(found.rows)
    if found.complete and np.all(error > 0):
        return fitted(x, y, error, found.independent)
    return fitted(x, y)


def columns(rows: list[dict]) -> np.ndarray:
    """Return an array (3, M) with D / d, the reduced rate and its error (NaN if unknown)."""
    names = "D_over_d", "W_reduced", "W_reduced_error"
    return np.array([[row[name] for row in rows] for name in names], float)


def draw_in_time(row: dict, runs: list[Run], after: float) -> plt.Figure:
    """Draw the number of recycled disks and the discharge rate of each run against time."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.8))
    for k, run in enumerate(runs):
        style = {"color": COLOURS[0], "lw": 1, "alpha": 1 if len(runs) == 1 else 0.6}
        style |= {"label": "measured" if k == 0 else ""}
        time, rates = rates_of(run)
        left.plot(*run.observable("recycled"), **style)
        width = max((time[-1] - time[0]) / WINDOWS, float(np.diff(time).max()))
        right.plot(*windows(time[1:], rates, width), **style)
    last = max(float(run.observable("recycled").time[-1]) for run in runs)
    start = np.mean([np.interp(after, *run.observable("recycled")) for run in runs])
    label = f"$W$ = {' ± '.join(rounded_to_error(row['W'], row['W_error']))}"
    line = np.array([after, last])
    left.plot(line, start + row["W"] * (line - after), color="black", ls="--", label=label)
    error = np.nan_to_num(row["W_error"])
    right.plot(line, 2 * [row["W"]], color="black", ls="--", label=label)
    right.fill_between(line, row["W"] - error, row["W"] + error, color="0.5", alpha=0.3, lw=0)
    for axes in (left, right):
        axes.axvline(after, color="0.5", ls=":", lw=1, label=f"--after {after:g}")
        axes.set(xlabel=runs[0].units.label("time $t$", "time"), xlim=(0, None), ylim=(0, None))
        axes.legend(loc="best")
    left.set_ylabel("recycled disks since the start")
    right.set_ylabel(runs[0].units.label("recycled disks per time", "rate"))
    figure.suptitle(f"{caption(runs)},  $D/d$ = {row['D_over_d']:.3g}")
    return figure


def draw(rows: list[dict], runs: list[Run], fit: dict[str, Estimate]) -> plt.Figure:
    """Draw the rates with the fits, and in a second panel rate^(2/3), which is linear in D."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.8))
    x, y, error = columns(rows)
    left.errorbar(x, y, error, fmt="o", label="measured")
    slope = 2 / 3 * y ** (-1 / 3)
    right.errorbar(x, y ** (2 / 3), slope * error, fmt="o", label="measured")
    if fit:
        (c, _), (k, dk), (n, dn) = fit.values()
        line = np.linspace(max(k, 0), 1.05 * x.max(), 200)
        text = f"{c:.3g} $(D/d - k)^{{3/2}}$, $k$ = {k:.2f} ± {dk:.2f}"
        left.plot(line, c * (line - k) ** EXPONENT, label=text)
        right.plot(line, c ** (2 / 3) * (line - k), label=text)
        left.plot([], [], " ", label=f"exponent {n:.2f} ± {dn:.2f} for $k$ = {BEVERLOO}")
    top = 1.1 * np.max(y + np.nan_to_num(error))
    for axes, highest in ((left, top), (right, top ** (2 / 3))):
        axes.set(xlabel="width of the mouth $D/d$", xlim=(0, 1.1 * x.max()), ylim=(0, highest))
        axes.legend(loc="upper left")
    left.set_ylabel("rate $W \\sqrt{d/g}$")
    right.set_ylabel("$(W \\sqrt{d/g})^{2/3}$")
    figure.suptitle(caption(runs))
    return figure


def main() -> None:
    parser = command_line(__doc__, "discharge.png")
    words = "start of the steady state: earlier samples are left out [4]"
    parser.add_argument("--after", type=not_negative, default=4.0, metavar="T", help=words)
    args = parser.parse_args()
    found = measured_rates(args.runs, args.after)
    rows, fit = found.rows, fit_of(found)
    for name, (value, uncertainty) in fit.items():
        print(f"{name} = {value:.4f} ± {uncertainty:.4f}")
    if len(rows) == 1:
        figure = draw_in_time(rows[0], args.runs, args.after)
    else:
        figure = draw(rows, args.runs, fit)
    report(args, figure, rows, notes=found.notes)


if __name__ == "__main__":
    launch(main)
