"""Means with errors, fits, and tests of a sample against a law."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy

MOST_WINDOWS = 10**6
Law = Callable[[np.ndarray], np.ndarray]


class Estimate(NamedTuple):
    """A mean with its standard error."""

    mean: np.ndarray | float
    error: np.ndarray | float


class LawTest(NamedTuple):
    """A sample compared with a law."""

    n: int  # values that count as independent
    ks: float  # Kolmogorov-Smirnov distance, the largest between the two distribution functions
    ks_p: float  # probability of a larger distance by chance
    chi2: float  # per degree of freedom, bins of equal probability
    chi2_p: float


class PowerLaw(NamedTuple):
    """y = factor x^exponent with the standard errors of a weighted fit."""

    factor: float
    exponent: float
    factor_error: float
    exponent_error: float

    def __call__(self, x: np.ndarray) -> np.ndarray:
        return self.factor * np.asarray(x, dtype=float) ** self.exponent


def hold_against(
    sample: np.ndarray, cdf: Law, bins: int = 30, independent: int | None = None
) -> LawTest:
    """Kolmogorov-Smirnov and chi-square test of a sample against a law.

    Correlated values scatter as if there were fewer: `independent` is that number [all of them].
    """
    n = len(sample) if independent is None else independent
    distance = float(scipy.stats.ks_1samp(sample, cdf).statistic)
    counts, _ = np.histogram(cdf(np.asarray(sample)), bins=bins, range=(0, 1))
    chi2 = (
        scipy.stats.chisquare(counts, np.full(bins, counts.sum() / bins)).statistic
        * n
        / len(sample)
    )
    return LawTest(
        n,
        distance,
        float(scipy.stats.kstwo.sf(distance, n)),
        float(chi2) / (bins - 1),
        float(scipy.stats.chi2.sf(chi2, bins - 1)),
    )


def estimate(values: np.ndarray, axis: int = 0) -> Estimate:
    """Mean and standard error over independent members; a single member has no error (NaN)."""
    values = np.asarray(values, dtype=float)
    mean = values.mean(axis=axis)
    if values.shape[axis] < 2:
        return Estimate(mean, np.full_like(mean, np.nan))
    return Estimate(mean, values.std(axis=axis, ddof=1) / np.sqrt(values.shape[axis]))


def combined(estimates: list[Estimate]) -> Estimate:
    """The mean of independent estimates, with the error that follows from theirs."""
    means = np.array([e.mean for e in estimates])
    errors = np.array([e.error for e in estimates])
    return Estimate(means.mean(axis=0), np.sqrt(np.sum(errors**2, axis=0)) / len(means))


def ratio(amount: np.ndarray, per: np.ndarray, factor: float = 1.0) -> Estimate:
    """Sum of the blocks (B,) over sum, with the error from their scatter."""
    total = np.sum(amount) / np.sum(per)
    return Estimate(factor * total, abs(factor) * estimate(amount / per).error)


def windows(time: np.ndarray, value: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Middles and means of the windows of a series (T,); an incomplete last one is left out."""
    count = max(1, int(np.floor((time[-1] - time[0]) / width + 1e-9)))
    if count > MOST_WINDOWS:
        raise ValueError(f"{count} windows of {width:g}")
    index = np.minimum(((time - time[0]) / width).astype(int), count)
    sums = np.bincount(index, value, count + 1)[:count]
    numbers = np.bincount(index, minlength=count + 1)[:count]
    return time[0] + (np.arange(count) + 0.5) * width, sums / np.maximum(numbers, 1)


def excess_kurtosis(speed: np.ndarray) -> float:
    """a2 = <v^4> / (2 <v^2>^2) - 1: zero for a Maxwell law, -1/2 for equal speeds."""
    square = np.square(speed)
    return float(np.mean(square**2) / (2 * np.mean(square) ** 2) - 1)


def fit_power_law(x: np.ndarray, y: np.ndarray, y_error: np.ndarray) -> PowerLaw | None:
    """Weighted straight line through ln y against ln x; None with fewer than three points.

    If the points scatter by more than their errors, the errors of the fit are enlarged to match.
    """
    x, y, y_error = (np.asarray(a, dtype=float) for a in (x, y, y_error))
    good = (x > 0) & (y > 0) & (y_error > 0)
    if len(np.unique(x[good])) < 3:
        return None
    log_x, log_y, weight = np.log(x[good]), np.log(y[good]), y[good] / y_error[good]
    line, covariance = np.polyfit(log_x, log_y, 1, w=weight, cov="unscaled")
    chi2 = np.sum((weight * (log_y - np.polyval(line, log_x))) ** 2) / max(1, good.sum() - 2)
    slope_error, offset_error = np.sqrt(np.diag(covariance) * max(1.0, chi2))
    factor = float(np.exp(line[1]))
    return PowerLaw(factor, float(line[0]), factor * offset_error, slope_error)
