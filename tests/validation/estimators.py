"""Measurements that several sections share: pure functions of a run."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ricochet import Run
from ricochet.statistics import Estimate, SeriesMean, estimate, series_mean
from ricochet.thermodynamics import steps


def over_runs(measure, runs: tuple[Run, ...]) -> Estimate:
    """The mean of a measurement over independent runs, with the error from their scatter."""
    return estimate([measure(run) for run in runs])


def over(measure: Callable[[Run], ArrayLike]) -> Callable[..., Estimate]:
    """The same as a function of the runs."""
    return lambda *runs: over_runs(measure, runs)


def middle(measure, runs: tuple[Run, ...]) -> np.ndarray:
    """The median over independent runs.

    For tests that reject one right sample in a hundred: the median of three runs is rejected once
    in some 3000; a wrong law shows in all of them.
    """
    return np.median([measure(run) for run in runs], axis=0)


def several(means: list[SeriesMean]) -> Estimate:
    """Several means as one with vectors."""
    return Estimate(*np.array([(one.mean, one.error) for one in means]).T)


def at_collisions(run: Run, name: str, tau: np.ndarray) -> np.ndarray:
    """An observable after so many collisions per disk."""
    return np.interp(tau, run.collisions_per_disk.value, run.observable(name).value)


def hit_rate(run: Run) -> SeriesMean:
    """Hits of all sides per time."""
    s = steps(run)
    return series_mean(s.hits, s.time)


def force(run: Run) -> SeriesMean:
    """Mean force on one side."""
    s = steps(run)
    return series_mean(s.impulse.mean(axis=1), s.time)


def differences(run: Run, other: Run, factor: float = 1.0) -> int:
    """How many events, places, velocities are not the same to the last bit.

    `other` is the faster one, by `factor`.
    """
    a, b = run.events, other.events
    if len(a.time) != len(b.time):
        return max(len(a.time), len(b.time))
    parts = (
        a.i != b.i, a.j != b.j, a.time != factor * b.time,
        run.position[-1] != other.position[-1], factor * run.velocity[-1] != other.velocity[-1],
    )  # fmt: skip
    return sum(int(np.sum(part)) for part in parts)
