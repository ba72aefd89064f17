"""Laws that the figures compare with, the tests of a sample against a law, and estimates.

Two dimensions throughout; u = v / sqrt(2 kT / m) is the reduced speed, x = K / kT = u^2.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import stats

Law = Callable[[np.ndarray], np.ndarray]


class Estimate(NamedTuple):
    """A mean with its standard error."""

    mean: np.ndarray | float
    error: np.ndarray | float

    def __str__(self) -> str:
        return f"{self.mean:.6g} +- {self.error:.2g}"


class LawTest(NamedTuple):
    """A sample held against a law."""

    n: int  # values that count as independent
    ks: float  # largest distance of the two distribution functions
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


def maxwell_pdf(u: np.ndarray) -> np.ndarray:
    """Density of the reduced speed in equilibrium, 2 u exp(-u^2)."""
    return 2 * u * np.exp(-(u**2))


def maxwell_cdf(u: np.ndarray) -> np.ndarray:
    """Its distribution function, 1 - exp(-u^2)."""
    return -np.expm1(-np.square(u))


def finite_n_cdf(count: int, periodic: bool = False) -> Law:
    """The exact law of u for `count` disks that share a fixed energy, kT = E/N.

    Between walls K/E follows the Beta(1, N-1) law whatever the masses; in a periodic box of
    equal disks at rest as a whole, K N / (E (N-1)) follows Beta(1, N-2).
    """
    free, scale = (count - 2, count - 1) if periodic else (count - 1, count)
    return lambda u: 1 - np.clip(1 - np.square(u) / scale, 0, 1) ** free


def scattering_angle(b: np.ndarray, mass_ratio: float = np.inf, restitution: float = 1.0):
    """Deflection [rad] of a disk hitting one at rest, b = impact parameter / (r1 + r2).

    `mass_ratio` is the mass at rest over the mass in flight; infinite and elastic: 2 acos b.
    """
    b = np.minimum(np.abs(b), 1.0)
    kappa = 0.5 * (1 + restitution) / (1 + 1 / mass_ratio)
    cosine = np.sqrt(1 - b**2)
    return np.arctan2(2 * kappa * b * cosine, 1 - 2 * kappa * cosine**2)


def barometric_cdf(height: np.ndarray, scale: float, top: float) -> np.ndarray:
    """Heights in 0..top with density exp(-height / scale)."""
    return np.expm1(-height / scale) / np.expm1(-top / scale)


def excess_kurtosis(speed: np.ndarray) -> float:
    """a2 = <v^4> / (2 <v^2>^2) - 1: zero for a Maxwell law, -1/2 for equal speeds."""
    square = np.square(speed)
    return float(np.mean(square**2) / (2 * np.mean(square) ** 2) - 1)


def hold_against(
    sample: np.ndarray, cdf: Law, bins: int = 30, independent: int | None = None
) -> LawTest:
    """Kolmogorov-Smirnov and chi-square test of a sample against a law.

    `independent` tells how many of the values are (all, if not given): correlated ones scatter as
    if there were only so many.
    """
    n = len(sample) if independent is None else independent
    distance = float(stats.ks_1samp(sample, cdf).statistic)
    counts, _ = np.histogram(cdf(np.asarray(sample)), bins=bins, range=(0, 1))
    chi2 = stats.chisquare(counts, np.full(bins, counts.sum() / bins)).statistic * n / len(sample)
    return LawTest(
        n,
        distance,
        float(stats.kstwo.sf(distance, n)),
        float(chi2) / (bins - 1),
        float(stats.chi2.sf(chi2, bins - 1)),
    )


def estimate(values: np.ndarray, axis: int = 0) -> Estimate:
    """Mean and standard error over independent members; one member has no error (NaN)."""
    values = np.asarray(values, dtype=float)
    n = values.shape[axis]
    mean = values.mean(axis=axis)
    if n < 2:
        return Estimate(mean, np.full_like(mean, np.nan))
    return Estimate(mean, values.std(axis=axis, ddof=1) / np.sqrt(n))


def fit_power_law(x: np.ndarray, y: np.ndarray, y_error: np.ndarray) -> PowerLaw | None:
    """Weighted straight line through ln y against ln x; None with fewer than three points.

    If the points scatter by more than their errors, the errors of a and p are enlarged alike.
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
