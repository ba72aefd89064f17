"""Means, densities and fits of independent values, with errors, and goodness-of-fit tests."""

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
    "binned",
    "estimate",
    "excess_kurtosis",
    "fit_law",
    "fit_power_law",
    "goodness_of_fit",
    "kurtosis_noise",
    "propagate_error",
    "rounded_to_error",
    "student",
]

FEWEST_RUNS = 4  # smallest number of runs whose scatter is used as a measured value
UNLIKELY = 0.005  # probability below which a deviation is regarded as significant
MANY = 1e12  # degrees of freedom of a known error
ONE_SIGMA = float(scipy.special.ndtr(1))  # importing scipy.stats takes a second


class Estimate(NamedTuple):
    """Mean with its error, which is half the width of the 68 % confidence interval."""

    mean: Any  # a number, or an array of any shape
    error: Any  # same shape as the mean


class Curve(NamedTuple):
    """Curve that consists of P points (x, y), with the errors of y."""

    x: np.ndarray
    y: np.ndarray
    error: np.ndarray  # NaN without an error


class LawTest(NamedTuple):
    """Result of a test that compares a sample with a distribution."""

    n: int  # number of independent values
    ks: float  # Kolmogorov-Smirnov distance, the largest between the two distribution functions
    ks_p: float  # probability of a larger distance by chance
    chi2: float  # per degree of freedom, bins of equal probability
    chi2_p: float


class LawFit(NamedTuple):
    """K parameters of a law that is fitted to points, with the errors of the parameters."""

    values: np.ndarray  # (K,)
    errors: np.ndarray  # (K,) half the 68 % intervals
    chi2: float = float("nan")  # chi^2 per degree of freedom; NaN if the points have no errors
    missed: bool = False  # whether points deviate from the law by more than their errors explain


class PowerLaw(NamedTuple):
    """Power law y = factor x^exponent, with the error of the exponent."""

    factor: float
    exponent: float
    exponent_error: float
    chi2: float = float("nan")  # chi^2 per degree of freedom, of the best line
    missed: bool = False  # whether points deviate from the law by more than their errors explain

    def __call__(self, x: np.ndarray) -> np.ndarray:
        return self.factor * np.asarray(x, dtype=float) ** self.exponent


def goodness_of_fit(
    sample: np.ndarray, cdf: Law, bins: int = 30, independent: int | None = None
) -> LawTest:
    """Compare a sample with a distribution by Kolmogorov-Smirnov and chi-square tests.

    Parameters
    ----------
    sample : numpy.ndarray
        (n,) the values
    cdf : callable
        distribution function, which takes an array of values
    bins : int
        number of bins of equal probability for the chi-square test
    independent : int, optional
        number of independent values in the sample [the number of values]; a sample of correlated
        values contains fewer independent values

    Returns
    -------
    LawTest
        statistics of the Kolmogorov-Smirnov test and of the chi-square test, each with its p-value

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
    """Return Student's factor t: half the 68 % interval of a mean, divided by its standard error.

    Parameters
    ----------
    samples : array_like
        (...) numbers of independent samples from which mean and standard error were estimated

    Returns
    -------
    float or numpy.ndarray
        (...) the factor, which tends to 1 for many samples

    Examples
    --------
    >>> round(float(student(4)), 3)
    1.197
    """
    return scipy.special.stdtrit(np.clip(np.subtract(samples, 1.0), 1.0, MANY), ONE_SIGMA)


def estimate(values: ArrayLike, axis: int = 0) -> Estimate:
    """Estimate a mean and its error from independent values, such as those of several runs.

    Parameters
    ----------
    values : array_like
        (..., R, ...) the values of R runs
    axis : int
        axis of the runs

    Returns
    -------
    Estimate
        (...) mean, and half its 68 % interval from Student's t; the error of a single value is NaN

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
    """Propagate the error of a curve to a number that is derived from the curve.

    Parameters
    ----------
    of : callable
        function that returns a number for a curve (P,), such as the time at which the curve crosses
        a level
    curve : ricochet.estimates.Estimate
        (P,) the curve with its error

    Returns
    -------
    Estimate
        the mean is the number that `of` returns for the curve; the error is ``|a - b| / 2``, where
        a and b are the numbers for the curve plus its error and for the curve minus its error; mean
        and error are NaN if a or b is NaN, or if the curve has no error

    Examples
    --------
    >>> x = np.linspace(0, 4, 401)
    >>> curve = Estimate(x, np.full(401, 0.5))
    >>> mean, error = propagate_error(lambda y: x[np.searchsorted(y, 2.0)], curve)
    >>> round(float(mean), 2), round(float(error), 2)
    (2.0, 0.5)
    """
    first, last = (of(curve.mean + sign * curve.error) for sign in (-1, 1))
    error = abs(last - first) / 2
    return Estimate(of(curve.mean) + 0 * error, error)


def binned(values: np.ndarray, bins: np.ndarray, independent: int | None = None) -> Estimate:
    """Estimate a probability density by a histogram.

    Parameters
    ----------
    values : numpy.ndarray
        (n,) the sample
    bins : numpy.ndarray
        (B + 1,) edges of the bins
    independent : int, optional
        number of independent values in the sample [all values]

    Returns
    -------
    Estimate
        (B,) density with error; its integral is the fraction of the values inside the bins

    Examples
    --------
    >>> binned(np.array([0.1, 0.2, 0.7, 0.8]), np.array([0.0, 0.5, 1.0])).mean
    array([1., 1.])
    """
    share = np.histogram(values, bins)[0] / len(values)
    error = np.sqrt(share * (1 - share) / (independent or len(values)))
    return Estimate(share / np.diff(bins), error / np.diff(bins))


def excess_kurtosis(speed: np.ndarray) -> float:
    """Return the second Sonine coefficient a2 = <v^4> / (2 <v^2>^2) - 1 of speeds.

    The formula is for speeds in two dimensions.

    Parameters
    ----------
    speed : numpy.ndarray
        (n,) speeds, in any unit

    Returns
    -------
    float
        0 for Maxwell's distribution, -1/2 for equal speeds

    Examples
    --------
    >>> excess_kurtosis(np.ones(5))
    -0.5
    """
    square = np.square(speed)
    return float(np.mean(square**2) / (2 * np.mean(square) ** 2) - 1)


def rounded_to_error(mean: float, error: float) -> tuple[str, ...]:
    """Format a mean with the digits that its error justifies.

    Parameters
    ----------
    mean, error : float
        the mean and its error

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
    """Return the standard deviation of `excess_kurtosis` for Maxwellian speeds.

    The square x = v^2 of a Maxwellian speed v has an exponential distribution, whose mean is 1 in
    suitable units. To first order in deviations of sample means, a2 equals the mean of x^2 / 2 - 2
    x over the sample minus the expected value of x^2 / 2 - 2 x.  The variance of x^2 / 2 - 2 x is
    20 / 4 + 4 * 1 - 2 * 4 = 1.

    Parameters
    ----------
    count : int
        number of speeds

    Returns
    -------
    float
        the standard deviation

    Examples
    --------
    >>> float(kurtosis_noise(10000))
    0.01
    """
    return 1 / np.sqrt(count)


def fit_power_law(
    x: np.ndarray, y: np.ndarray, y_error: np.ndarray | None = None, runs: ArrayLike = MANY
) -> PowerLaw | None:
    """Fit a power law as a straight line of ln y against ln x; see `fit_law` for the error.

    Parameters
    ----------
    x, y : numpy.ndarray
        (P,) the points; points with a coordinate that is not positive are left out
    y_error : numpy.ndarray, optional
        (P,) errors of y; without them the error of the fit follows from the scatter of the points
    runs : array_like, optional
        number of runs from which each error of y was estimated, a number or (P,); without it the
        errors are exact

    Returns
    -------
    PowerLaw or None
        factor and exponent, with the error of the exponent, or None if fewer than three points have
        different x

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
    """Fit two parameters of a law to the logarithms of points; all points have equal weights.

    Weights from the errors of few runs would be too noisy: with four runs they would increase the
    scatter of an exponent, and its error would be too small.  If the points deviate from the law by
    more than their errors explain, the errors of the parameters are multiplied by the square root
    of chi^2 per degree of freedom.  All errors contain Student's factor.

    Parameters
    ----------
    logarithm : callable
        function of x and the two parameters that returns ln y
    x, y : array_like
        (P,) the points; points with a coordinate that is not positive are left out
    start : sequence of float
        (2,) values of the parameters from which the search begins
    y_error : array_like, optional
        (P,) errors of y; without them the errors of the parameters follow from the scatter of the
        points
    runs : array_like, optional
        number of runs from which each error of y was estimated, a number or (P,); without it the
        errors are exact
    bounds : tuple, optional
        smallest and largest allowed values of the parameters

    Returns
    -------
    LawFit or None
        the parameters, or None if fewer than three points have different x

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
    """Return x, y, error and number of runs of the points at which the first three are positive."""
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

    The derivatives of ln y with respect to the parameters are `slopes` (P, K), and `rest` (P,) are
    the deviations of ln y from the law.  The relative errors of y are `relative` (P,), or unknown.
    """
    share = np.linalg.pinv(slopes)  # the derivatives (K, P) of the parameters with respect to ln y
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
    """Determine whether points deviate from a law by more than their errors explain.

    The test takes into account that the errors are estimates (Welch, Biometrika 38, 330 (1951)).

    Parameters
    ----------
    chi2 : float
        chi^2 per degree of freedom, calculated with errors that include Student's factor
    free : int
        degrees of freedom: number of points minus the two parameters of the law
    runs : float
        number of runs from which the error of each point was estimated

    Returns
    -------
    bool
        whether the probability of a larger chi^2 by chance is less than 0.5 %

    Examples
    --------
    >>> points_miss_a_law(4.0, 8, 100), points_miss_a_law(4.0, 8, 3)
    (True, False)
    """
    if free < 1 or runs < FEWEST_RUNS:
        return False
    denominator = (free + 2) * (runs - 1) / 3
    ratio = student(runs) ** 2 * chi2 / (1 + 2 / (runs - 1))
    return bool(scipy.special.fdtrc(free, denominator, ratio) < UNLIKELY)
