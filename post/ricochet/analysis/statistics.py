"""Means with errors, fits, and goodness-of-fit tests.

Two functions compute errors.  The function `estimate` is for independent values, such as the
results of runs that differ by their seed.  The function `correlated_mean` is for a single series in
time, whose samples are correlated.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ..predictions.theory import Law

__all__ = [
    "Curve",
    "Estimate",
    "LawTest",
    "PowerLaw",
    "SeriesMean",
    "binned",
    "combine_runs",
    "correlated_mean",
    "diagnostics",
    "equilibration",
    "estimate",
    "excess_kurtosis",
    "fit_power_law",
    "goodness_of_fit",
    "has_drift",
    "has_trend",
    "kurtosis_noise",
    "propagate_error",
    "rounded_to_error",
    "statistical_inefficiency",
    "student",
    "windows",
]

MOST_WINDOWS = 10**6
FEWEST_RUNS = 4  # smallest number of runs whose scatter is used as a weight


class Estimate(NamedTuple):
    """A mean with its error; the error is half the width of the 68 % confidence interval."""

    mean: Any  # a number, or an array of any shape
    error: Any  # same shape as the mean


class Curve(NamedTuple):
    """P points of a curve, with the errors of y."""

    x: np.ndarray
    y: np.ndarray
    error: np.ndarray  # NaN without an error


class LawTest(NamedTuple):
    """Result of comparing a sample with a distribution."""

    n: int  # number of independent values
    ks: float  # Kolmogorov-Smirnov distance, the largest between the two distribution functions
    ks_p: float  # probability of a larger distance by chance
    chi2: float  # per degree of freedom, bins of equal probability
    chi2_p: float


class PowerLaw(NamedTuple):
    """Power law y = factor x^exponent, with the error of the exponent from a weighted fit."""

    factor: float
    exponent: float
    exponent_error: float
    chi2: float = float("nan")  # chi^2 per degree of freedom
    free: int = 0  # degrees of freedom

    def misses(self, runs: int) -> bool:
        """Return whether the points deviate from the power law by more than their errors explain.

        The test of Welch (1951) takes into account that the errors were estimated from only `runs`
        runs.
        """
        if self.free < 1 or runs < FEWEST_RUNS:
            return False
        own, few = student(runs) ** 2 * self.chi2, (self.free + 2) * (runs - 1) / 3
        ratio = own / (1 + 2 / (runs - 1))
        return bool(scipy.special.fdtrc(self.free, few, ratio) < UNLIKELY)

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
        both statistics with their probabilities

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


MANY = 1e12  # degrees of freedom of a known error
ONE_SIGMA = float(scipy.special.ndtr(1))  # importing scipy.stats takes a second


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
    curve : ricochet.statistics.Estimate
        (P,) the curve with its error

    Returns
    -------
    Estimate
        mean and half the difference of two numbers, which are derived from the curve plus its error
        and from the curve minus its error; both are NaN if one of these numbers is NaN, or if the
        curve has no error

    Examples
    --------
    >>> x = np.linspace(0, 4, 401)
    >>> curve = Estimate(x, np.full(401, 0.5))
    >>> mean, error = propagate_error(lambda y: x[np.searchsorted(y, 2.0)], curve)
    >>> round(float(mean), 2), round(float(error), 2)
    (2.0, 0.5)
    """
    first, last = (of(curve.mean + sign * curve.error) for sign in (-1, 1))
    return Estimate((first + last) / 2, abs(last - first) / 2)


# --- series in time ---

FINE, COARSE = 64, 16  # number of parts of a series whose means resolve slow modes
FEWEST = 8  # smallest number of independent samples for an error
LEAST_WAVES, MOST_WAVES = 2, 8  # number of slow waves from which the error of a series is estimated
PER_WAVE = 6  # largest number of waves times inefficiency over length


class SeriesMean(NamedTuple):
    """The mean of a correlated series, with its error and diagnostics."""

    mean: float
    error: float  # half the 68 % interval, or NaN for fewer than `FEWEST` independent samples
    samples: float  # number of independent samples
    drift: float  # slope over its error; a standard Gaussian variable without a drift
    freedom: float = np.inf  # degrees of freedom of the error

    def scaled(self, factor: float, offset: float = 0.0) -> "SeriesMean":
        """Return the mean of the series offset + factor x, where x is the original series."""
        return self._replace(mean=offset + factor * self.mean, error=abs(factor) * self.error)


def cells(series: np.ndarray, count: int) -> np.ndarray:
    """Return the means of about `count` equal parts of a series (T,).

    Samples at the start of the series that do not fill a part are left out.
    """
    width = max(1, len(series) // count)
    return series[len(series) % width :].reshape(-1, width).mean(axis=1)


def statistical_inefficiency(series: np.ndarray, least: float = 0.1) -> float:
    """Estimate the statistical inefficiency 1 + 2 tau of a series.

    tau is the integrated autocorrelation time, in samples.  The variance of the mean of correlated
    samples is the variance for independent samples times the statistical inefficiency.  The largest
    lag in the sum of autocorrelations, and the correction for the unknown mean, are those of Wolff,
    Computer Physics Communications 156, 143 (2004), with the parameter S = 1.5.  A sum that ends at
    the first negative autocorrelation would underestimate the error of short series.

    Parameters
    ----------
    series : numpy.ndarray
        (T,) samples at equal intervals, or (T, K) samples of K quantities, whose autocorrelations
        are added
    least : float
        lower bound of the result, which is below 1 for anticorrelated samples

    Returns
    -------
    float
        the statistical inefficiency

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(size=4000)
    >>> bool(0.8 < statistical_inefficiency(noise) < 1.2)
    True
    >>> bool(4 < statistical_inefficiency(np.repeat(noise, 5)) < 6)
    True
    """
    count, rest = len(series), series - np.mean(series, axis=0)
    if np.max(np.ptp(series, axis=0)) <= 1e-12 * np.max(np.abs(series), initial=0):
        return 1.0
    found, lag = 1.0, 0
    for lag in range(1, count // 2):
        found += 2 * np.mean(rest[lag:] * rest[:-lag]) / np.mean(rest**2)
        tau = 1.5 / np.log((found + 1) / (found - 1)) if found > 1 else 1e-9
        if np.exp(-lag / tau) < tau / np.sqrt(lag * count):
            break
    return max(least, found) * (1 + (2 * lag + 1) / count)


def correlated_mean(amount: np.ndarray, per: np.ndarray | float = 1.0) -> SeriesMean:
    """Estimate the mean of a correlated series, or the ratio of the sums of two correlated series.

    The error is that of the mean of the series amount - ratio * per, which is estimated from the
    slowest Fourier components of this series.

    Parameters
    ----------
    amount : array_like
        (T,) samples of a series in equilibrium, such as numbers of collisions
    per : array_like
        (T,) series by whose sum the sum of the amounts is divided, such as durations; or a number

    Returns
    -------
    SeriesMean
        the ratio of the sums with its error, and the effective number of independent samples and
        the drift of the series; the error is NaN if a few parts of the series contain most of the
        sum of `per`

    Examples
    --------
    >>> found = correlated_mean(np.random.default_rng(1).normal(3.0, 0.1, 1000))
    >>> bool(abs(found.mean - 3) < 4 * found.error < 0.03)
    True
    """
    amount, per = np.broadcast_arrays(np.asarray(amount, dtype=float), per)
    if len(amount) == 0:
        return SeriesMean(np.nan, np.nan, 0.0, 0.0)
    mean = float(np.sum(amount) / np.sum(per))
    weight = cells(per, COARSE)
    worth = min(float(len(amount)), float(weight.sum() ** 2 / np.sum(weight**2)))
    if worth < FEWEST:
        return SeriesMean(mean, np.nan, worth, 0.0)
    rest = (amount - mean * per) / np.mean(per)
    error, freedom, drift = slow_waves(rest)
    if not error > 1e-12 * np.max(np.abs(amount)) / np.mean(per):  # constant up to rounding
        return SeriesMean(mean, 0.0, float(len(rest)), 0.0)
    samples = min(float(len(rest)), float(np.var(rest)) / error**2)
    return SeriesMean(mean, error * float(student(freedom + 1)), samples, drift, freedom)


def slow_waves(series: np.ndarray) -> tuple[float, int, float]:
    """Return standard error of the mean, degrees of freedom and drift of a series (T,).

    The square of the error is the mean square of the first coefficients of the cosine transform,
    divided by the length of the series.  The method is that of Lazarus, Lewis, Stock and Watson,
    Journal of Business and Economic Statistics 36, 541 (2018).  The number of coefficients is
    limited to waves that are slower than the correlations of the series.  The drift is the ratio of
    the first coefficient to the following coefficients, expressed as a standard Gaussian variable.
    """
    parts = cells(series, FINE)
    per_sample = max(1e-9, statistical_inefficiency(parts))
    most = min(MOST_WAVES, len(parts) // 2)
    waves = int(np.clip(len(parts) / (PER_WAVE * per_sample), LEAST_WAVES, most))
    height = scipy.fft.dct(parts, norm="ortho")[1 : waves + 2]
    error = np.sqrt(np.mean(height[:-1] ** 2) / len(parts))
    others = np.sqrt(np.mean(height[1:] ** 2))
    slope = -height[0] / others if others > 0 else 0.0
    chance = scipy.special.stdtr(waves, -abs(slope))
    return float(error), waves, float(np.copysign(scipy.special.ndtri(chance), slope))


def equilibration(series: np.ndarray) -> int:
    """Return the number of samples before a series becomes stationary.

    The result is twice the number of samples that White's rule (MSER) leaves out (White, Simulation
    69, 323 (1997)).  White's rule minimises the standard error of the mean of the remaining
    samples.

    Parameters
    ----------
    series : numpy.ndarray
        (T,) samples at equal intervals

    Returns
    -------
    int
        index of the first sample to use, at most half the length of the series

    Examples
    --------
    >>> start = np.exp(-np.arange(1000) / 20)
    >>> noise = 0.01 * np.random.default_rng(1).normal(size=1000)
    >>> 60 <= equilibration(start + noise) <= 300
    True
    """
    values = cells(series, FINE)
    count = len(values)
    scatter = [np.var(values[k:]) / (count - k) for k in range(count // 4 + 1)]
    return 2 * int(np.argmin(scatter)) * max(1, len(series) // FINE)


def combine_runs(means: Sequence[SeriesMean]) -> SeriesMean:
    """Combine the means of independent runs into one mean.

    The error of the combined mean follows from the errors of the runs.  If the means of the runs
    scatter by more than their errors explain, or if a run has no error, the error of the combined
    mean follows from this scatter.

    Parameters
    ----------
    means : sequence of SeriesMean
        (R,) the means of the runs

    Returns
    -------
    SeriesMean
        the mean of the means; the attribute `samples` is the sum over the runs or, if the error
        follows from the scatter, the number of runs

    Examples
    --------
    >>> one, other = SeriesMean(1.0, 0.1, 50, 0.0), SeriesMean(1.1, 0.1, 50, 0.0)
    >>> both = combine_runs([one, other])
    >>> round(float(both.mean), 3), round(both.error, 3), both.samples
    (1.05, 0.071, 100.0)
    """
    runs = len(means)
    mean, _, samples, drift, own_freedom = np.array(means).T
    size, square = samples.sum(), squares(means)
    scatter = np.sum(square**2 / own_freedom)  # degrees of freedom (Welch, Satterthwaite)
    freedom = np.sum(square) ** 2 / scatter if scatter > 0 else np.inf
    own = student(freedom + 1) * np.sqrt(np.sum(square)) / runs
    if scatter_p(means) < UNLIKELY or np.isnan(own):
        size, own, freedom = runs, estimate(mean).error, max(1, runs - 1)
    whole = mean.mean(), float(own), float(size), float(drift.sum() / np.sqrt(runs))
    return SeriesMean(*whole, float(freedom))


def squares(means: Sequence[SeriesMean]) -> np.ndarray:
    """Return the squares (R,) of the standard errors of means, which exclude Student's factor t."""
    return np.array([(one.error / student(one.freedom + 1)) ** 2 for one in means])


UNLIKELY = 0.005  # probability below which a deviation is regarded as significant
FEW = 10  # independent samples


def scatter_p(means: Sequence[SeriesMean]) -> float:
    """Return the probability that means with these errors scatter at least as much as `means`."""
    mean, error, _, _, freedom = np.array(means).T
    if len(means) < 2 or not np.all(error > 0):
        return 1.0
    ratio = np.var(mean, ddof=1) / np.mean(squares(means))
    return float(scipy.special.fdtrc(len(mean) - 1, min(MANY, freedom.sum()), ratio))


def has_drift(mean: SeriesMean) -> bool:
    """Determine whether a series drifts by more than chance explains.

    Parameters
    ----------
    mean : ricochet.statistics.SeriesMean
        the mean of the series

    Returns
    -------
    bool
        whether the probability that such a drift occurs by chance is below `UNLIKELY`

    Examples
    --------
    >>> has_drift(SeriesMean(1.0, 0.1, 50, 1.0)), has_drift(SeriesMean(1.0, 0.1, 50, 4.0))
    (False, True)
    """
    return bool(2 * scipy.special.ndtr(-abs(mean.drift)) < UNLIKELY)


def has_trend(series: np.ndarray) -> bool:
    """Determine whether a straight line explains most of the variance of a series.

    The function `correlated_mean` interprets such a trend as a long autocorrelation and therefore
    finds no significant drift.

    Parameters
    ----------
    series : numpy.ndarray
        (T,) samples at equal intervals

    Returns
    -------
    bool
        whether the squared correlation coefficient with time exceeds 0.75

    Examples
    --------
    >>> has_trend(np.arange(100.0)), has_trend(np.cos(np.arange(100.0)))
    (True, False)
    """
    if len(series) < FEWEST or np.ptp(series) <= 1e-9 * np.max(np.abs(series)):
        return False
    return bool(np.corrcoef(np.arange(len(series)), series)[0, 1] ** 2 > 0.75)


def diagnostics(name: str, means: Sequence[SeriesMean]) -> list[str]:
    """Return the reasons why a mean over runs may be unreliable.

    Parameters
    ----------
    name : str
        name of the quantity in the returned sentences
    means : sequence of SeriesMean
        (R,) the means of the runs

    Returns
    -------
    list of str
        a sentence for each reason; an empty list if the mean is reliable

    Examples
    --------
    >>> diagnostics("Z", [SeriesMean(1.0, 0.1, 5.0, 0.0)])
    ['Z: worth only 5.0 independent samples; run longer']
    """
    found, whole = [], combine_runs(means)
    if np.isnan(whole.error):
        return [f"{name}: no error, a run has fewer than {FEWEST} samples in equilibrium"]
    if scatter_p(means) < UNLIKELY:
        spread, said = np.std([m.mean for m in means], ddof=1), np.mean([m.error for m in means])
        found.append(
            f"{name}: runs scatter by {spread:.2g} where each says ± {said:.2g}; the error is from "
            "the scatter"
        )
    elif whole.samples < FEW:
        found.append(f"{name}: worth only {whole.samples:.1f} independent samples; run longer")
    if has_drift(whole):
        more = "above" if whole.drift > 0 else "below"
        found.append(
            f"{name}: still drifts, the second half is {abs(whole.drift):.1f} errors {more} the "
            "first; run longer, or set a longer --equilibration"
        )
    return found


def windows(time: np.ndarray, value: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Average a series over windows of equal duration.

    Parameters
    ----------
    time, value : numpy.ndarray
        (T,) the series
    width : float
        duration of a window [time]

    Returns
    -------
    middle, mean : numpy.ndarray
        (W,) centres of the windows that contain samples, and means over these windows; an
        incomplete last window is left out

    Raises
    ------
    ValueError
        if the number of windows would exceed a million

    Examples
    --------
    >>> middle, mean = windows(np.arange(6.0), np.arange(6.0), 2.0)
    >>> middle, mean
    (array([1., 3.]), array([0.5, 2.5]))
    """
    count = max(1, int(np.floor((time[-1] - time[0]) / width + 1e-9)))
    if count > MOST_WINDOWS:
        raise ValueError(f"{count} windows of {width:g}")
    index = np.minimum(((time - time[0]) / width).astype(int), count)
    sums = np.bincount(index, value, count + 1)[:count]
    numbers = np.bincount(index, minlength=count + 1)[:count]
    some = np.flatnonzero(numbers)
    return time[0] + (some + 0.5) * width, sums[some] / numbers[some]


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

    The square x = v^2 of a Maxwellian speed v has an exponential distribution, here with mean 1.
    To first order, a2 is the deviation of the sample mean of x^2 / 2 - 2 x from the expected value.
    The variance of x^2 / 2 - 2 x is 20 / 4 + 4 * 1 - 2 * 4 = 1.

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
    x: np.ndarray, y: np.ndarray, y_error: np.ndarray | None = None
) -> PowerLaw | None:
    """Fit a power law as a weighted straight line of ln y against ln x.

    If the points scatter by more than their errors, the error of the fit is increased accordingly.

    Parameters
    ----------
    x, y : numpy.ndarray
        (P,) the points; points with a coordinate that is not positive are left out
    y_error : numpy.ndarray, optional
        (P,) errors of y; without them all points have equal weights, and the error of the fit
        follows from the scatter of the points

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
    x, y, y_error = (np.asarray(a, dtype=float) for a in (x, y, y if alike else y_error))
    good = (x > 0) & (y > 0) & (y_error > 0)
    if len(np.unique(x[good])) < 3:
        return None
    log_x, log_y, weight = np.log(x[good]), np.log(y[good]), y[good] / y_error[good]
    line, covariance = np.polyfit(log_x, log_y, 1, w=weight, cov="unscaled")
    free = int(good.sum()) - 2
    chi2 = float(np.sum((weight * (log_y - np.polyval(line, log_x))) ** 2) / free)
    wider = student(free + 1) ** 2 * chi2 if alike else max(1.0, chi2)
    error = float(np.sqrt(covariance[0, 0] * wider))
    factor, exponent = np.exp(line[1]), line[0]
    return PowerLaw(float(factor), float(exponent), error, np.nan if alike else chi2, free)
