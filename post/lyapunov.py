"""Divergence of initially close trajectories, and the Lyapunov exponent.

    python post/lyapunov.py runs/pairs/*.h5 -o lyapunov.png --csv lyapunov.csv

Successive runs in the given order are combined into pairs.  The two runs of a pair start from
almost the same state and have frames at the same times.  The distance between two runs is the
Euclidean distance between the positions of all disks, calculated with the nearest periodic images.
The distance between the two runs of a pair grows as exp(lambda t) until it reaches the size of the
box.  The Lyapunov exponent lambda is the mean growth of the logarithm of the distance between two
fixed distances, divided by the mean time of this growth (Aurell and others, Journal of Physics A
30, 1 (1997)).  The larger distance is --largest.  The logarithm of the distance grows by the
fraction --fit-from of its whole growth before it reaches the smaller distance.  The growth before
the smaller distance is not used, because it depends on the starts and on the direction of the
initial difference.  A pair that does not reach the larger distance contributes its growth until the
end of the run.  The mean slope in a fixed interval of time would be too small, by 3 % in Sinai's
billiard with the defaults.  The exponent is too large by less than 1 % as long as nearly all pairs
reach the larger distance.  The error is determined by the jackknife over the pairs.  The script
rejects gases that cool, because their rate of divergence is not constant.
"""

from typing import NamedTuple

from ricochet import Run, RunError
from ricochet.analysis.statistics import Estimate, estimate
from ricochet.figures.drawing import COLOURS, plt
from ricochet.reading.nature import TRAITS, allow
from ricochet.reading.units import Units
from ricochet.script import command_line, launch, measured, report

import numpy as np

LEAST_GROWTH = 1.0  # smallest logarithm of the ratio of the two distances


class Divergence(NamedTuple):
    """Logarithms of the distances of P pairs, and their growth between two distances."""

    time: np.ndarray  # (T,)
    logarithm: np.ndarray  # (P, T)
    ends: tuple[float, float]  # logarithms of the smaller and of the larger distance
    growth: np.ndarray  # (P,) growth of the logarithm between the distances
    passed: np.ndarray  # (2, P) times at which this growth begins and ends
    reached: int  # number of pairs that reach the larger distance
    exponent: Estimate  # Lyapunov exponent [1/time]


def distance(one: Run, other: Run) -> np.ndarray:
    """Return the Euclidean distance (T,) between the positions of all disks in two runs."""
    frames = min(one.n_frames, other.n_frames)
    if one.n_disks != other.n_disks or not np.array_equal(one.time[:frames], other.time[:frames]):
        raise RunError(f"{other.path}: not the same disks at the same times as in {one.path}")
    apart = other.unwrapped(slice(frames)) - one.unwrapped(slice(frames))
    return np.sqrt(np.sum(apart**2, axis=(1, 2)))


def divergence(time: np.ndarray, apart: np.ndarray, largest: float, begin: float) -> Divergence:
    """Determine the Lyapunov exponent from the distances (P, T) of P pairs of runs at T times.

    The larger distance is `largest`, and the growth until the smaller distance is the fraction
    `begin` of the growth of the logarithm until the larger distance.
    """
    with np.errstate(divide="ignore"):
        logarithm = np.log(apart)
    finite = np.isfinite(logarithm)
    if not finite.any(axis=1).all():
        raise RunError("no fit is possible: the runs of a pair are equal")
    start = max(float(track[some][0]) for track, some in zip(logarithm, finite, strict=True))
    upper = float(np.log(largest))
    lower = start + begin * (upper - start)
    starts, stops = (
        np.array([passage(time, own, level) for own in logarithm]) for level in (lower, upper)
    )
    growth = np.where(np.isnan(stops), logarithm[:, -1], upper) - lower
    growth[np.isnan(starts)] = 0
    reached = int(np.sum(np.isfinite(stops)))
    passed = np.stack([np.nan_to_num(times, nan=time[-1]) for times in (starts, stops)])
    duration = passed[1] - passed[0]
    if upper - lower < LEAST_GROWTH or not duration.sum() > 0:
        raise RunError("no fit is possible: the starts are too far apart or the runs too short")
    exponent = growth.sum() / duration.sum()
    if (count := len(growth)) > 1:
        rests = [np.delete(one, k).sum() for one in (growth, duration) for k in range(count)]
        without = np.divide(*np.reshape(rests, (2, count)))
        found = estimate(count * exponent - (count - 1) * without)
    else:
        found = Estimate(exponent, np.nan)
    return Divergence(time, logarithm, (lower, upper), growth, passed, reached, found)


def passage(time: np.ndarray, logarithm: np.ndarray, level: float) -> float:
    """Return the interpolated time at which a distance first reaches a level, or NaN."""
    above = logarithm >= level
    if not above.any():
        return float("nan")
    k = int(np.argmax(above))
    both = [max(k - 1, 0), k]
    if not np.isfinite(logarithm[both]).all():
        return float(time[k])
    return float(np.interp(level, logarithm[both], time[both]))


def draw(found: Divergence, units: Units) -> plt.Figure:
    """Draw the distance of each pair (thin), their mean (thick), and the mean growth (dashed)."""
    figure, axes = plt.subplots(figsize=(7, 5))
    for track in found.logarithm:
        axes.semilogy(found.time, np.exp(track), color=COLOURS[0], lw=0.6, alpha=0.4)
    number = len(found.logarithm)
    mean = found.logarithm.mean(axis=0)
    axes.plot(found.time, np.exp(mean), color="black", label=f"{number} pairs: geometric mean")
    mean_slope, error = found.exponent
    label = f"$e^{{\\lambda t}}$, $\\lambda$ = {mean_slope:.3f} ± {error:.3f}"
    ends = found.passed.mean(axis=1), np.exp([found.ends[0], found.ends[0] + found.growth.mean()])
    axes.plot(*ends, color=COLOURS[1], lw=2.5, ls="--", label=label)
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
        help="fraction of the growth of the logarithm that is left out at the start [0.2]",
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
    begin, end = map(float, found.passed.mean(axis=1))
    row = {"pairs": len(apart), "from": begin, "to": end}
    row |= measured("lyapunov_exponent", found.exponent)
    notes = []
    if late := len(apart) - found.reached:
        far = f"{late} of {len(apart)} pairs do not reach the distance {args.largest:g}"
        notes = [f"{far}; the exponent of longer runs is more accurate"]
    tracks = {f"pair_{k + 1}": track for k, track in enumerate(apart)}
    report(args, draw(found, args.units), [row], data={"time": found.time, **tracks}, notes=notes)


if __name__ == "__main__":
    launch(main)
