"""Tests with random samples: few in `make test`, many with the mark `statistics`."""

from collections.abc import Container, Iterable

import numpy as np
import pytest
from scipy.stats import binom

from ricochet import estimates

#: Mark of a test that uses much processor time for many random samples.
STATISTICS = pytest.mark.statistics


def mostly(values: Iterable, kept: Container) -> list:
    """Return parameter values of a test, of which `make test` uses only the kept ones."""
    return [one if one in kept else pytest.param(one, marks=STATISTICS) for one in values]


def samples(few: int, many: int) -> pytest.MarkDecorator:
    """Run a test with few samples and, in `make check` and `.ci/run`, with many."""
    numbers = [few, pytest.param(many, marks=STATISTICS)]
    return pytest.mark.parametrize("samples", numbers)


def held_as_often_as_stated(held) -> bool:
    """Return whether 68 % of independent intervals `held` the true value, at a level of 0.1 %."""
    low, high = binom.interval(0.999, np.size(held), 2 * estimates.ONE_SIGMA - 1)
    return bool(low <= np.sum(held) <= high)
