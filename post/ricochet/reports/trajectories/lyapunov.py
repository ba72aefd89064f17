"""Divergence of trajectories that start close together, and the Lyapunov exponent."""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from ...analysis.estimates import Estimate, jackknife
from ...figures.drawing import COLOURS, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...reading.files import counted
from ...reading.nature import TRAITS, allow
from ...reading.reader import Run, RunError
from ..groups import Group, each_run
from ..options import Option
from ..registry import Analysis
from ..result import Result
from ..tables import measured

LEAST_GROWTH = 1.0  # smallest logarithm of the ratio of the two distances


class Divergence(NamedTuple):
    """Logarithms of the distances in P pairs of runs, and the growth between two distances."""

    time: np.ndarray  # (T,)
    logarithm: np.ndarray  # (P, T)
    ends: tuple[float, float]  # logarithms of the smaller and the larger distance
    growth: np.ndarray  # (P,) growth of the logarithm between these distances
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

    Only the growth up to the distance `largest` is used. On a logarithmic scale, the first fraction
    `begin` of this growth is left out.
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
        found = jackknife(exponent, without)
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


def draw_distances(axes: plt.Axes, result: Result) -> None:
    """Plot the distance of each pair (thin), their mean (thick), and the mean growth (dashed)."""
    found, units = result.values, result.runs[0].units
    for track in found.logarithm:
        axes.semilogy(found.time, np.exp(track), color=COLOURS[0], lw=0.6, alpha=0.4)
    number = len(found.logarithm)
    mean = found.logarithm.mean(axis=0)
    axes.plot(found.time, np.exp(mean), color="black", label=f"{number} pairs: geometric mean")
    mean_slope, error = found.exponent
    label = f"$\\exp(\\lambda t)$, $\\lambda$ = {mean_slope:.3f} ± {error:.3f}"
    ends = found.passed.mean(axis=1), np.exp([found.ends[0], found.ends[0] + found.growth.mean()])
    axes.plot(*ends, color=COLOURS[1], lw=2.5, ls="--", label=label)
    axes.set(xlabel=units.label("time t", "time"))
    axes.set_ylabel(units.label("distance of the positions", "length"))
    legend_above(axes)


def draw(result: Result) -> Sheet:
    """Plot the distances of all pairs."""
    return Sheet([[Panel("distances", draw_distances, (result,), aspect=0.65)]])


def check(run: Run) -> None:
    """Raise Refused if the rate of divergence in a run is not constant."""
    fading = {"changed", "collapsed", *({"inelastic"} if run.nature.cooling else ())}
    allow(run, "its rate of divergence is not constant", *TRAITS.keys() - fading)


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return the Lyapunov exponent from pairs of successive runs."""
    runs = groups[0].runs
    if len(runs) % 2:
        given = counted(len(runs), "run")
        raise RunError(f"{given}: an even number is required, to compare two at a time")
    apart = [distance(*pair) for pair in zip(runs[::2], runs[1::2], strict=True)]
    frames = min(map(len, apart))
    apart = np.array([track[:frames] for track in apart])
    found = divergence(runs[0].time[:frames], apart, options.largest, options.fit_from)
    begin, end = map(float, found.passed.mean(axis=1))
    row = {"pairs": len(apart), "from": begin, "to": end}
    row |= measured("lyapunov_exponent", found.exponent)
    warnings = []
    if late := len(apart) - found.reached:
        far = f"{late} of {len(apart)} pairs do not reach the distance {options.largest:g}"
        warnings = [f"{far}; the exponent of longer runs is more accurate"]
    data = {"time": found.time} | {f"pair_{k + 1}": track for k, track in enumerate(apart)}
    notes = ["± : standard error, from the jackknife over the pairs."]
    return Result([row], notes=notes, warnings=warnings, data=data, values=found)


LARGEST = Option("largest", "distance at which the fit ends [0.01]", 0.01, float)
LEFT_OUT = "fraction of the growth of the logarithm that is left out at the start [0.2]"
FIT_FROM = Option("fit_from", LEFT_OUT, 0.2, float, "SHARE")
ANALYSIS = Analysis(
    compute, draw, options=(LARGEST, FIT_FROM), accepts=check, unfinished=True, averages=each_run
)
