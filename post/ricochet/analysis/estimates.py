"""Means, densities and fits of independent values with their errors, and goodness-of-fit tests."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ..predictions.theory import Law

__all__ = [
    "Curve",
    "Estimate",
    "LawFit",
    "LawTest",
    "PowerLaw",
    "estimate",
    "excess_kurtosis",
    "fit_law",
    "fit_power_law",
    "goodness_of_fit",
    "rounded_to_error",
]

FEWEST_RUNS = 4  # fewest runs whose scatter is regarded as a measured error
UNLIKELY = 0.005  # p-value below which a deviation is significant
MANY = 1e12  # degrees of freedom of an error that is known exactly
ONE_SIGMA = 0.5 * math.erfc(-math.sqrt(0.5))  # importing scipy.special takes a third of a second


class Estimate(NamedTuple):
    """Mean with its error: half the width of the 68 % confidence interval."""

    mean: Any  # a number, or an array of any shape
    error: Any  # of the same shape


class Curve(NamedTuple):
    """Curve of P points (x, y), with the errors of y."""

    x: np.ndarray
    y: np.ndarray
    error: np.ndarray  # NaN where the error is unknown


class LawTest(NamedTuple):
    """Result of comparing a sample with a distribution."""

    n: int  # number of independent values
    ks: float  # Kolmogorov-Smirnov distance: largest difference of the distribution functions
    ks_p: float  # probability that chance alone causes a larger distance
    chi2: float  # per degree of freedom, for bins of equal probability
    chi2_p: float


class LawFit(NamedTuple):
    """K parameters of a law fitted to points, with their errors."""

    values: np.ndarray  # (K,)
    errors: np.ndarray  # (K,) half the width of the 68 % intervals
    chi2: float = float("nan")  # per degree of freedom; NaN if the points have no errors
    missed: bool = False  # whether the deviations from the law are larger than the errors explain


class PowerLaw(NamedTuple):
    """Power law y = factor x^exponent, with the error of the exponent."""

    factor: float
    exponent: float
    exponent_error: float
    chi2: float = float("nan")  # per degree of freedom, of the best line
    missed: bool = False  # whether the deviations from the law are larger than the errors explain

    def __call__(self, x: np.ndarray) -> np.ndarray:
        return self.factor * np.asarray(x, dtype=float) ** self.exponent


def goodness_of_fit(
    sample: np.ndarray, cdf: Law, bins: int = 30, independent: int | None = None
) -> LawTest:
    """Compare a sample with a distribution by a Kolmogorov-Smirnov and a chi-square test.

    Parameters
    ----------
    sample : numpy.ndarray
        (n,) values
    cdf : callable
        cumulative distribution function, applied to an array
    bins : int
        number of bins of equal probability for the chi-square test
    independent : int, optional
        effective number of independent values if they are correlated [n]

    Returns
    -------
    LawTest
        both statistics with their p-values

    Examples
    --------
    >>> sample = (np.arange(1000) + 0.5) / 1000
    >>> goodness_of_fit(sample, lambda x: np.clip(x, 0, 1)).ks_p > 0.99
    True
    """
    n = len(sample) if independent is None else independent
    distance = float(scipy.stats.ks_1samp(sample, cdf).statistic)
    counts, _ = np.histogram(cdf(np.asarray(sample)), bins=bins, range=(0, 1))
    chi2 = scipy.stats.chisquare(counts).statistic * n / len(sample)
    return LawTest(
        n,
        distance,
        float(scipy.stats.kstwo.sf(distance, n)),
        float(chi2) / (bins - 1),
        float(scipy.special.chdtrc(bins - 1, chi2)),
    )


def student(samples: ArrayLike) -> Any:
    """Return Student's t of 68 % intervals, given numbers of independent samples (...).

    For many samples t is 1.
    """
    return scipy.special.stdtrit(np.clip(np.subtract(samples, 1.0), 1.0, MANY), ONE_SIGMA)


def estimate(values: ArrayLike, axis: int = 0) -> Estimate:
    """Estimate a mean and its error from independent values, such as the results of several runs.

    Parameters
    ----------
    values : array_like
        (..., R, ...) values of R runs
    axis : int
        axis of the runs

    Returns
    -------
    Estimate
        (...) mean, and half the width of its 68 % interval by Student's t; NaN for a single value

    Examples
    --------
    >>> mean, error = estimate([1.0, 2.0, 3.0])
    >>> float(mean), round(float(error), 2)
    (2.0, 0.76)
    """
    values = np.asarray(values, dtype=float)
    mean, count = values.mean(axis=axis), values.shape[axis]
    if count < 2:
        return Estimate(mean, np.full_like(mean, np.nan))
    return Estimate(mean, student(count) * values.std(axis=axis, ddof=1) / np.sqrt(count))


def propagate_error(of: Callable[[np.ndarray], float], curve: Estimate) -> Estimate:
    """Propagate the error of a curve (P,) to a number `of(curve)`, such as the time of a crossing.

    The error is half the difference between the numbers for the curve plus and minus its error.
    Mean and error are NaN if one of these numbers is NaN.
    """
    first, last = (of(curve.mean + sign * curve.error) for sign in (-1, 1))
    error = abs(last - first) / 2
    return Estimate(of(curve.mean) + 0 * error, error)


def jackknife(whole: float, rests: np.ndarray) -> Estimate:
    """Return the jackknife estimate of a quantity whose values without one block are `rests` (G,).

    `whole` is its value for all data. Each of the G blocks, such as runs, must hold the same share
    of the data.
    """
    return estimate(len(rests) * whole - (len(rests) - 1) * np.asarray(rests))


class PseudoValues(NamedTuple):
    """Pseudo-values (G, ...) of the jackknife for G blocks of time of any length."""

    values: np.ndarray
    share: np.ndarray  # fraction of the sample contained in each block

    def mean(self) -> np.ndarray:
        """Return the mean of the pseudo-values, or NaN unless at least two blocks contain data."""
        seen = self.share > 0
        mean = np.sum(self.share * np.where(seen, self.values, 0), axis=0)
        return np.where(seen.sum(axis=0) > 1, mean, np.nan)

    def rests(self) -> np.ndarray:
        """Return deviations (G, ...) from the mean; their squares add up to its squared error."""
        seen = self.share > 0
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(self.share / (1 - self.share) / seen.sum(axis=0))
            return np.where(seen, root * (self.values - self.mean()), 0)

    def estimate(self, correlation: np.ndarray | float = 0.0) -> Estimate:
        """Return the mean of the pseudo-values with its error.

        `correlation` describes neighbouring blocks of time: twice the sum of d_k d_(k+1) over the
        sum of d_k^2, where d_k is the deviation of block k from the mean.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            error = np.sqrt(np.sum(self.rests() ** 2, axis=0))
            samples = 1 / np.sum(self.share**2, axis=0)
            wider = np.sqrt((1 + correlation) / (1 - correlation / (len(self.values) - 1)))
        return Estimate(self.mean(), wider * student(samples) * error)


def jackknife_of_sums(
    of: Callable[[np.ndarray], np.ndarray], sums: np.ndarray, weights: np.ndarray
) -> PseudoValues:
    """Return the jackknife pseudo-values (G, ...) of a function of sums over blocks of time."""
    with np.errstate(divide="ignore", invalid="ignore"):
        total = sums.sum(axis=0)
        rest = np.stack([of(total - one) for one in sums])
        share = np.broadcast_to(weights / weights.sum(axis=0), rest.shape)
        return PseudoValues(rest + (of(total) - rest) / share, share)


def binned(values: np.ndarray, bins: np.ndarray, independent: int | None = None) -> Estimate:
    """Estimate the probability density (B,) of a sample (n,) in bins with the edges (B + 1,).

    The integral over all bins is the fraction of the sample inside them. The errors assume that
    `independent` of the values are independent [n].
    """
    share = np.histogram(values, bins)[0] / len(values)
    error = np.sqrt(share * (1 - share) / (independent or len(values)))
    return Estimate(share / np.diff(bins), error / np.diff(bins))


def excess_kurtosis(speed: np.ndarray) -> float:
    """Return the second Sonine coefficient a2 = <v^4> / (2 <v^2>^2) - 1 of speeds in the plane.

    Parameters
    ----------
    speed : numpy.ndarray
        (n,) speeds, in any unit

    Returns
    -------
    float
        a2: 0 for the Maxwell distribution, -1/2 for equal speeds

    Examples
    --------
    >>> excess_kurtosis(np.ones(5))
    -0.5
    """
    square = np.square(speed)
    return float(np.mean(square**2) / (2 * np.mean(square) ** 2) - 1)


def rounded_to_error(mean: float, error: float) -> tuple[str, ...]:
    """Format a mean with as many digits as its error justifies.

    Parameters
    ----------
    mean, error : float
        mean and its error

    Returns
    -------
    tuple of str
        mean and error, rounded to two significant digits of the error; only the mean if the error
        is NaN

    Examples
    --------
    >>> rounded_to_error(3.14159, 0.0123)
    ('3.142', '0.012')
    """
    if not np.isfinite(error):
        return (f"{mean:.4g}",)
    if error == 0:
        return f"{mean:.6g}", "0"
    places = max(0, 1 - int(np.floor(np.log10(float(f"{error:.1e}")))))
    return f"{mean:z.{places}f}", f"{error:.{places}f}"


def kurtosis_noise(count: int) -> float:
    """Return the standard deviation of a2 (see `excess_kurtosis`) for Maxwellian speeds.

    x = v^2 is distributed exponentially; let its mean be 1. To first order, a2 is the sample mean
    of y = x^2 / 2 - 2 x minus its expectation, and y has the variance 20 / 4 + 4 * 1 - 2 * 4 = 1.
    """
    return 1 / np.sqrt(count)


def fit_power_law(
    x: np.ndarray, y: np.ndarray, y_error: np.ndarray | None = None, runs: ArrayLike = MANY
) -> PowerLaw | None:
    """Fit a power law as a straight line of ln y against ln x; for its errors see `fit_law`.

    Parameters
    ----------
    x, y : numpy.ndarray
        (P,) points; points with a coordinate that is not positive are ignored
    y_error : numpy.ndarray, optional
        (P,) errors of y [estimated from the scatter of the points]
    runs : array_like, optional
        number of runs from which each error was estimated, a number or (P,) [exact errors]

    Returns
    -------
    PowerLaw or None
        factor and exponent, or None for fewer than three different x

    Examples
    --------
    >>> x = np.array([1.0, 2.0, 4.0, 8.0])
    >>> fit = fit_power_law(x, 3 * x**2)
    >>> round(fit.factor, 6), round(fit.exponent, 6)
    (3.0, 2.0)
    """
    alike = y_error is None
    x, y, error, runs = usable(x, y, y if alike else y_error, runs)
    if len(np.unique(x)) < 3:
        return None
    log_x, log_y = np.log(x), np.log(y)
    exponent, offset = map(float, np.polyfit(log_x, log_y, 1))
    slopes, rest = np.stack([log_x, np.ones(len(x))], axis=1), log_y - (offset + exponent * log_x)
    relative = None if alike else error / y
    fit = with_errors(np.array([exponent, offset]), slopes, rest, relative, runs)
    return PowerLaw(float(np.exp(offset)), exponent, float(fit.errors[0]), fit.chi2, fit.missed)


def fit_law(
    logarithm: Callable[..., np.ndarray],
    x: ArrayLike,
    y: ArrayLike,
    start: Sequence[float],
    y_error: ArrayLike | None = None,
    runs: ArrayLike = MANY,
    bounds: tuple[Sequence[float], Sequence[float]] = ((-np.inf, -np.inf), (np.inf, np.inf)),
) -> LawFit | None:
    """Fit the two parameters of a law to the logarithms of points with equal weights.

    If the points deviate from the law by more than their errors explain, the errors of the
    parameters are multiplied by sqrt(chi^2 per degree of freedom). All errors include Student's
    factor t. docs/explanation/statistics.md explains why the weights are equal.

    Parameters
    ----------
    logarithm : callable
        function of x and the two parameters that returns ln y
    x, y : array_like
        (P,) points; points with a coordinate that is not positive are ignored
    start : sequence of float
        (2,) initial guess of the parameters
    y_error : array_like, optional
        (P,) errors of y [estimated from the scatter of the points]
    runs : array_like, optional
        number of runs from which each error was estimated, a number or (P,) [exact errors]
    bounds : tuple, optional
        lower and upper bounds of the parameters

    Returns
    -------
    LawFit or None
        fitted parameters, or None for fewer than three different x

    Examples
    --------
    >>> x = np.array([3.0, 5.0, 9.0, 17.0])
    >>> law = lambda x, c, k: np.log(c * np.sqrt(x - k))
    >>> fit_law(law, x, 2 * np.sqrt(x - 1), (1, 0), bounds=((0, -9), (9, 2.9))).values.round(6)
    array([2., 1.])
    """
    alike = y_error is None
    x, y, error, runs = usable(x, y, y if alike else y_error, runs)
    if len(np.unique(x)) < 3:
        return None
    log_y = np.log(y)

    def rest(values: np.ndarray) -> np.ndarray:
        return logarithm(x, *values) - log_y

    tight = {"xtol": 1e-12, "ftol": 1e-12, "gtol": 1e-12, "x_scale": "jac", "jac": "3-point"}
    found = scipy.optimize.least_squares(rest, start, bounds=bounds, **tight)
    return with_errors(found.x, found.jac, -found.fun, None if alike else error / y, runs)


def usable(
    x: ArrayLike, y: ArrayLike, error: ArrayLike | None, runs: ArrayLike
) -> tuple[np.ndarray, ...]:
    """Return x, y, error and number of runs of the points where the first three are positive."""
    x, y, error = (np.asarray(part, dtype=float) for part in (x, y, error))
    good = (x > 0) & (y > 0) & (error > 0)
    return x[good], y[good], error[good], np.broadcast_to(np.asarray(runs, float), x.shape)[good]


def with_errors(
    values: np.ndarray,
    slopes: np.ndarray,
    rest: np.ndarray,
    relative: np.ndarray | None,
    runs: np.ndarray,
) -> LawFit:
    """Return fitted parameters (K,) with their errors.

    `slopes` (P, K) are the derivatives of ln y with respect to the parameters, `rest` (P,) the
    deviations of ln y from the law, and `relative` (P,) the relative errors of y, if known.
    """
    share = np.linalg.pinv(slopes)  # derivatives (K, P) of the parameters with respect to ln y
    free = len(rest) - 2
    if relative is None:
        variance = np.sum(share**2, axis=1) * (rest @ rest) / free
        return LawFit(values, student(free + 1) * np.sqrt(variance))
    parts = (share * relative / student(runs)) ** 2
    variance = parts.sum(axis=1)
    degrees = variance**2 / np.sum(parts**2 / (runs - 1), axis=1)  # Welch and Satterthwaite
    best = np.linalg.lstsq(slopes / relative[:, None], rest / relative, rcond=None)[0]
    chi2 = float(np.sum(((rest - slopes @ best) / relative) ** 2) / free)
    missed = points_miss_a_law(chi2, free, float(runs.min()))
    errors = student(degrees + 1) * np.sqrt(variance * (chi2 if missed else 1.0))
    return LawFit(values, errors, chi2, missed)


def points_miss_a_law(chi2: float, free: int, runs: float) -> bool:
    """Return whether chi^2 per degree of freedom is too large for chance (probability below 0.5 %).

    The errors in `chi2` are estimated from `runs` runs each and include Student's factor (Welch,
    Biometrika 38, 330 (1951)). `free` is the number of degrees of freedom.
    """
    if free < 1 or runs < FEWEST_RUNS:
        return False
    denominator = (free + 2) * (runs - 1) / 3
    ratio = student(runs) ** 2 * chi2 / (1 + 2 / (runs - 1))
    return bool(scipy.special.fdtrc(free, denominator, ratio) < UNLIKELY)
