"""Discharge rate of a refilled hopper against the width of its mouth, with Beverloo's law.

    python post/discharge.py runs/hopper/*.h5 -o discharge.png --csv discharge.csv

Each run must contain a hopper, whose mouth is the gap between the ends of two straight walls, and
must recycle the disks that leave the mouth (drive.kind = 'recycle').  The rate W is the number of
disks that are recycled per unit of time; recycled disks are counted after the time --after.  D is
the width of the mouth and d the mean diameter of the disks.  Under gravity g, Beverloo's law in two
dimensions is W = C sqrt(g / d) (D / d - k)^(3/2).  If the runs have at least three values of D, the
script determines C and k by a fit.  In a second fit the exponent is free, and k has the fixed value
1.4.  Beverloo, Leniger and van de Velde, Chemical Engineering Science 15, 260 (1961), measured k =
1.4 in three dimensions, where the exponent is 5/2.  Beverloo's law applies to rough disks.  The
rate of smooth disks increases with the height of the bed.
"""

from ricochet import Run, RunError
from ricochet.analysis.statistics import combine_runs, correlated_mean
from ricochet.figures.drawing import caption, plt
from ricochet.reading.nature import Refused
from ricochet.script import command_line, grouped, launch, not_negative, over_runs, report

import numpy as np
from scipy.optimize import curve_fit

EXPONENT = 1.5  # of Beverloo's law in two dimensions
BEVERLOO = 1.4  # k of Beverloo, Leniger and van de Velde (1961)
LEAST_ERROR = 0.01  # relative error of a rate in the fits, besides its statistical error


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
    """Return the mean number of recycled disks per time, in units of sqrt(g / d)."""
    if "recycled" not in run.nature:
        raise Refused(f"{run.path}: recycles no disks (drive.kind = 'recycle')")
    gravity = float(np.linalg.norm(run.gravity))
    if gravity == 0:
        raise Refused(f"{run.path}: has no gravity (box.gravity)")
    time, count = run.observable("recycled")
    late = time >= after
    if late.sum() < 3:
        raise RunError(f"{run.path}: has {late.sum()} samples after t = {after:g}; needs 3")
    rates = np.diff(count[late]) / np.diff(time[late])
    return correlated_mean(rates).scaled(np.sqrt(2 * float(run.radius.mean()) / gravity))


def fitted(x: np.ndarray, y: np.ndarray, error: np.ndarray) -> dict[str, tuple[float, float]]:
    """Return C and k of the first fit and the exponent of the second fit, with standard errors."""
    known = np.where(np.isfinite(error), error, 0)
    sigma = np.hypot(known, LEAST_ERROR * y)
    largest = x.min() - 1e-6

    def law(x: np.ndarray, c: float, k: float) -> np.ndarray:
        return c * (x - k) ** EXPONENT

    def power(x: np.ndarray, c: float, n: float) -> np.ndarray:
        return c * (x - BEVERLOO) ** n

    bounds = ([0, -10], [np.inf, largest])
    first, spread = curve_fit(law, x, y, [y[-1] / x[-1] ** EXPONENT, 1], sigma, bounds=bounds)
    second, scatter = curve_fit(power, x, y, [first[0], EXPONENT], sigma)
    errors = np.sqrt([*np.diag(spread), scatter[1, 1]])
    return dict(
        zip(("C", "k", "exponent"), zip([*first, second[1]], errors, strict=True), strict=True)
    )


def table(runs: list[Run], after: float) -> tuple[list[dict], list[str]]:
    """Return a table row for each width of the mouth, and warnings."""
    rows, notes = [], []
    mouths = grouped(runs, lambda run: round(mouth(run), 9))
    for _, same in sorted(mouths, key=lambda pair: pair[0]):
        members = [rate(run, after) for run in same]
        width = round(float(np.mean([reduced_width(run) for run in same])), 6)
        row = {"D_over_d": width, "runs": len(same)}
        row |= over_runs("W", members, notes, f"D = {width:g} d")
        rows.append(row | {"samples": round(combine_runs(members).samples, 1)})
    return rows, notes


def columns(rows: list[dict]) -> np.ndarray:
    """Return an array (3, M) with D / d, the rate and its error; an unknown error is NaN."""
    return np.array([[row[name] for row in rows] for name in ("D_over_d", "W", "W_error")], float)


def draw(rows: list[dict], runs: list[Run], fit: dict) -> plt.Figure:
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
    for axes in (left, right):
        axes.set(xlabel="width of the mouth $D/d$", xlim=(0, None), ylim=(0, None))
        axes.legend()
    left.set_ylabel("rate $W \\sqrt{d/g}$")
    right.set_ylabel("$(W \\sqrt{d/g})^{2/3}$")
    figure.suptitle(caption(runs))
    return figure


def main() -> None:
    parser = command_line(__doc__, "discharge.png")
    words = "start of the steady state: earlier samples are left out [4]"
    parser.add_argument("--after", type=not_negative, default=4.0, metavar="T", help=words)
    args = parser.parse_args()
    rows, notes = table(args.runs, args.after)
    x, y, error = columns(rows)
    fit = fitted(x, y, error) if len(rows) > 2 else {}
    for name, (value, uncertainty) in fit.items():
        print(f"{name} = {value:.4f} ± {uncertainty:.4f}")
    report(args, draw(rows, args.runs, fit), rows, notes=notes)


if __name__ == "__main__":
    launch(main)
