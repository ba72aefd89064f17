"""Divergence of initially close trajectories, and the Lyapunov exponent.

    python post/lyapunov.py runs/pairs/*.h5 -o lyapunov.png --csv lyapunov.csv

Successive runs in the given order are combined into pairs.  The two runs of a pair start from
almost the same state and have frames at the same times.  The distance between two runs is the
Euclidean distance between the positions of all disks, calculated with the nearest periodic images.
The distance between the two runs of a pair grows as exp(lambda t) until it reaches the size of the
box.  A straight line is fitted to the logarithm of the distance of each pair, in the same interval
of time for all pairs.  The fits end at the time at which the first pair reaches the distance
--largest.  The value of --fit-from is the ratio of the start time to the end time of the fits.
Times before the start of the fits are not used, because the difference of the two states has not
yet turned into the direction of fastest growth.  The Lyapunov exponent lambda is the mean slope of
the fitted lines, and its error is the standard error of the mean.  The script rejects gases that
cool, because their rate of divergence is not constant.
"""

from typing import NamedTuple

from ricochet import Run, RunError
from ricochet.analysis.statistics import Estimate, estimate
from ricochet.figures.drawing import COLOURS, plt
from ricochet.reading.nature import TRAITS, allow
from ricochet.reading.units import Units
from ricochet.script import command_line, launch, measured, report

import numpy as np


class Divergence(NamedTuple):
    """Logarithms of the distances of all pairs, and straight lines fitted between two times."""

    time: np.ndarray  # (T,)
    logarithm: np.ndarray  # (P, T)
    slope: np.ndarray  # (P,) [1/time]
    exponent: Estimate  # Lyapunov exponent, the mean of the slopes
    begin: float
    end: float


def distance(one: Run, other: Run) -> np.ndarray:
    """Return the Euclidean distance (T,) between the positions of all disks in two runs."""
    frames = min(one.n_frames, other.n_frames)
    if one.n_disks != other.n_disks or not np.array_equal(one.time[:frames], other.time[:frames]):
        raise RunError(f"{other.path}: not the same disks at the same times as in {one.path}")
    apart = other.unwrapped(slice(frames)) - one.unwrapped(slice(frames))
    return np.sqrt(np.sum(apart**2, axis=(1, 2)))


def divergence(time: np.ndarray, apart: np.ndarray, largest: float, begin: float) -> Divergence:
    """Fit straight lines to the logarithms of the distances of P pairs of runs at T times.

    The fits end at the time at which the first distance reaches `largest`.  The argument `begin` is
    the ratio of the start time to the end time of the fits.
    """
    with np.errstate(divide="ignore"):
        logarithm = np.log(apart)
    far = np.any(apart > largest, axis=0)
    last = int(np.argmax(far)) if far.any() else len(time)
    first = int(np.ceil(begin * last))
    if last - first < 3 or not np.all(np.isfinite(logarithm[:, first:last])):
        raise RunError(
            "no fit is possible: the starts are equal or too far apart, or there are too few frames"
        )
    fitted = time[first:last]
    slope = np.polyfit(fitted, logarithm[:, first:last].T, 1)[0]
    ends = float(fitted[0]), float(fitted[-1])
    return Divergence(time, logarithm, slope, estimate(slope), *ends)


def draw(found: Divergence, units: Units) -> plt.Figure:
    """Draw the distance of each pair (thin lines), the geometric mean (thick line) and its fit."""
    figure, axes = plt.subplots(figsize=(7, 5))
    for track in found.logarithm:
        axes.semilogy(found.time, np.exp(track), color=COLOURS[0], lw=0.6, alpha=0.4)
    mean = found.logarithm.mean(axis=0)
    axes.plot(
        found.time, np.exp(mean), color="black", label=f"{len(found.slope)} pairs: geometric mean"
    )
    inside = (found.time >= found.begin) & (found.time <= found.end)
    t = found.time[inside]
    line = mean[inside].mean() + found.exponent.mean * (t - t.mean())
    mean_slope, error = found.exponent
    label = f"$e^{{\\lambda t}}$, $\\lambda$ = {mean_slope:.3f} ± {error:.3f}"
    axes.plot(t, np.exp(line), color=COLOURS[1], lw=2.5, ls="--", label=label)
    axes.set(xlabel=units.label("time t", "time"))
    axes.set_ylabel(units.label("distance of the positions", "length"))
    axes.legend(loc="upper left")
    return figure


def main() -> None:
    parser = command_line(__doc__, "lyapunov.png")
    parser.set_defaults(paired=True)
    parser.add_argument(
        "--largest", type=float, default=0.01, help="distance at which the fit ends [0.01]"
    )
    parser.add_argument(
        "--fit-from",
        type=float,
        default=0.2,
        metavar="SHARE",
        help="start of the fit, divided by the end of the fit [0.2]",
    )
    args = parser.parse_args()
    if len(args.runs) % 2:
        raise RunError(f"{len(args.runs)} runs: an even number is required")
    for run in args.runs:
        fading = {"changed", "collapsed", *({"inelastic"} if run.nature.cooling else ())}
        allow(run, "its rate of divergence is not constant", *TRAITS.keys() - fading)
    apart = [distance(*pair) for pair in zip(args.runs[::2], args.runs[1::2], strict=True)]
    frames = min(map(len, apart))
    apart = np.array([track[:frames] for track in apart])
    found = divergence(args.runs[0].time[:frames], apart, args.largest, args.fit_from)
    row = {"pairs": len(found.slope), "from": found.begin, "to": found.end}
    row |= measured("lyapunov_exponent", found.exponent)
    tracks = {f"pair_{k + 1}": track for k, track in enumerate(apart)}
    report(args, draw(found, args.units), [row], data={"time": found.time, **tracks})


if __name__ == "__main__":
    launch(main)
