"""Measurements that several sections share: pure functions of a run."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ricochet import Run
from ricochet.analysis.statistics import (
    Estimate,
    SeriesMean,
    combine_runs,
    estimate,
    correlated_mean,
)
from ricochet.analysis.thermodynamics import steps


def each(measure: Callable[[Run], ArrayLike]) -> Callable[..., np.ndarray]:
    """A measurement of each run, as a function of all of them."""
    return lambda *runs: np.ravel([measure(run) for run in runs])


def over(measure: Callable[[Run], ArrayLike]) -> Callable[..., Estimate]:
    """The mean of a measurement over independent runs, with the error from their scatter."""
    return lambda *runs: estimate([measure(run) for run in runs])


def pooled(measure: Callable[[Run], SeriesMean]) -> Callable[..., SeriesMean]:
    """The mean over runs whose own means have errors."""
    return lambda *runs: combine_runs([measure(run) for run in runs])


def middle(measure: Callable[[Run], ArrayLike]) -> Callable[..., np.ndarray]:
    """The median over independent runs.

    For tests that reject one right sample in a hundred: the median of three runs is rejected once
    in some 3000; a wrong law shows in all of them.
    """
    return lambda *runs: np.median([measure(run) for run in runs], axis=0)


def several(means: list[SeriesMean]) -> Estimate:
    """Several means as one with vectors."""
    return Estimate(*np.array([(one.mean, one.error) for one in means]).T)


def angular_momentum(run: Run) -> np.ndarray:
    """About the origin, in all frames."""
    x, v = run.position[:], run.velocity[:]
    return np.sum(run.mass * (x[..., 0] * v[..., 1] - x[..., 1] * v[..., 0]), axis=1)


def at_collisions(run: Run, name: str, tau: np.ndarray) -> np.ndarray:
    """An observable after so many collisions per disk."""
    return np.interp(tau, run.collisions_per_disk.value, run.observable(name).value)


def hit_rate(run: Run) -> SeriesMean:
    """Hits of all sides per time."""
    s = steps(run)
    return correlated_mean(s.hits, s.time)


def force(run: Run) -> SeriesMean:
    """Mean force on one side."""
    s = steps(run)
    return correlated_mean(s.impulse.mean(axis=1), s.time)
