"""Measurements used in several sections, as pure functions of a run."""

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
    """Return a function that measures each of several runs."""
    return lambda *runs: np.ravel([measure(run) for run in runs])


def over(measure: Callable[[Run], ArrayLike]) -> Callable[..., Estimate]:
    """Return a function that averages a measurement over runs, with the error of the mean."""
    return lambda *runs: estimate([measure(run) for run in runs])


def pooled(measure: Callable[[Run], SeriesMean]) -> Callable[..., SeriesMean]:
    """Return a function that averages the means of runs with their errors."""
    return lambda *runs: combine_runs([measure(run) for run in runs])


def middle(measure: Callable[[Run], ArrayLike]) -> Callable[..., np.ndarray]:
    """Return a function that takes the median over independent runs.

    Tests reject one correct sample in a hundred. The median of three correct runs is rejected only
    about once in 3000 cases, whereas a wrong distribution is detected in every run.
    """
    return lambda *runs: np.median([measure(run) for run in runs], axis=0)


def several(means: list[SeriesMean]) -> Estimate:
    """Combine several means into one with a vector value."""
    return Estimate(*np.array([(one.mean, one.error) for one in means]).T)


def angular_momentum(run: Run) -> np.ndarray:
    """Return the angular momentum about the origin in all frames."""
    x, v = run.position[:], run.velocity[:]
    return np.sum(run.mass * (x[..., 0] * v[..., 1] - x[..., 1] * v[..., 0]), axis=1)


def at_collisions(run: Run, name: str, tau: np.ndarray) -> np.ndarray:
    """Return an observable after a number of collisions per disk."""
    return np.interp(tau, run.collisions_per_disk.value, run.observable(name).value)


def hit_rate(run: Run) -> SeriesMean:
    """Return the number of collisions with all sides per time."""
    s = steps(run)
    return correlated_mean(s.hits, s.time)


def force(run: Run) -> SeriesMean:
    """Return the mean force on a side."""
    s = steps(run)
    return correlated_mean(s.impulse.mean(axis=1), s.time)
