"""Means of correlated time series, with errors and warnings; includes the module `estimates`.

The functions `estimate` and `correlated_mean` compute a mean and its error.  The function
`estimate` is for independent values, such as the results of runs that differ by their seed.  The
function `correlated_mean` is for a single series in time, whose samples are correlated.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from .estimates import (
    MANY,
    UNLIKELY,
    Curve,
    Estimate,
    LawFit,
    LawTest,
    PowerLaw,
    binned,
    estimate,
    excess_kurtosis,
    fit_law,
    fit_power_law,
    goodness_of_fit,
    kurtosis_noise,
    propagate_error,
    rounded_to_error,
    student,
)

__all__ = [
    "Curve",
    "Estimate",
    "LawFit",
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
    "fit_law",
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
FEW = 10  # independent samples
FINE, COARSE = 64, 16  # number of parts of a series whose means resolve slow modes
FEWEST = 8  # smallest number of independent samples for an error
LEAST_WAVES, MOST_WAVES = 2, 8  # number of slow waves from which the error of a series is estimated
PER_WAVE = 6  # largest number of waves times inefficiency over length
LEAST_INEFFICIENCY = 0.02  # of a strongly anticorrelated series


class SeriesMean(NamedTuple):
    """Mean of a correlated series, with its error and diagnostics."""

    mean: float
    error: float  # half the 68 % interval, or NaN for fewer than `FEWEST` independent samples
    samples: float  # number of independent samples
    drift: float  # slope over its error; a standard Gaussian variable without a drift
    freedom: float = np.inf  # degrees of freedom of the error

    def scaled(self, factor: float, offset: float = 0.0) -> "SeriesMean":
        """Return the mean, with its error, after replacing each sample x by offset + factor x."""
        return self._replace(mean=offset + factor * self.mean, error=abs(factor) * self.error)


def cells(series: np.ndarray, count: int) -> np.ndarray:
    """Return the means of about `count` equal parts of a series (T,).

    If the length of the series is not a multiple of the length of a part, the remaining samples at
    the start of the series are left out.
    """
    width = max(1, len(series) // count)
    return series[len(series) % width :].reshape(-1, width).mean(axis=1)


def statistical_inefficiency(series: np.ndarray, least: float = 0.1) -> float:
    """Estimate the statistical inefficiency 1 + 2 tau of a series.

    tau is the integrated autocorrelation time, in samples.  The variance of the mean of correlated
    samples is the variance for independent samples times the statistical inefficiency.  The sum of
    autocorrelations is truncated, and corrected for the unknown mean, by the method of Wolff,
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
    return inefficiency_and_lag(series, least)[0]


def inefficiency_and_lag(series: np.ndarray, least: float) -> tuple[float, int]:
    """Return the statistical inefficiency and the largest lag in the sum of autocorrelations."""
    if np.max(np.ptp(series, axis=0)) <= 1e-12 * np.max(np.abs(series), initial=0):
        return 1.0, 0
    count, rest = len(series), series - np.mean(series, axis=0)
    found, lag = 1.0, 0
    for lag in range(1, count // 2):
        found += 2 * np.mean(rest[lag:] * rest[:-lag]) / np.mean(rest**2)
        tau = 1.5 / np.log((found + 1) / (found - 1)) if found > 1 else 1e-9
        if np.exp(-lag / tau) < tau / np.sqrt(lag * count):
            break
    return max(least, found) * (1 + (2 * lag + 1) / count), lag


def correlated_mean(amount: np.ndarray, per: np.ndarray | float = 1.0) -> SeriesMean:
    """Estimate the mean of a correlated series, or the ratio of the sums of two correlated series.

    The estimate is the ratio R of the sums of the two series.  The error of the ratio R is the
    error of the mean of the series (amount - R per) / (mean of per), estimated from the slowest
    Fourier components of the series.

    The error describes fluctuations that occur within the series.  If a state never changes during
    a run, such as the order of disks in a narrow channel or the structure of a glass, the error of
    one run does not contain the differences between such states.  Use the scatter of several runs
    with different starts.

    Parameters
    ----------
    amount : array_like
        (T,) samples of a series in equilibrium, such as numbers of collisions
    per : array_like
        (T,) series whose sum divides the sum of `amount`, such as durations; a number stands for a
        constant series

    Returns
    -------
    SeriesMean
        the ratio of the sums with its error, the effective number of independent samples, and the
        drift; if a few parts of the series `per` contain most of its sum, the error is NaN

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

    The means over parts of the series are transformed by a discrete cosine transform.  The squared
    standard error is the mean square of the first coefficients except the constant coefficient,
    divided by the number of parts.  The error is estimated by the method of Lazarus, Lewis, Stock
    and Watson, Journal of Business and Economic Statistics 36, 541 (2018).  Only cosine waves whose
    period is longer than the correlation length of the series are used.  Let a be the first
    coefficient of the cosine transform after the constant one, and b the root mean square of the
    following coefficients.  If the series does not drift, -a / b has Student's distribution.  The
    returned drift is -a / b, converted to a Gaussian variable with variance 1.

    The correlation length is the estimated statistical inefficiency plus the standard deviation of
    this estimate (Madras and Sokal, Journal of Statistical Physics 50, 109 (1988)).  The standard
    deviation of the estimate is added, because an inefficiency that is underestimated by chance
    would lead to an error that is too small.  For an anticorrelated series, the function
    `periodic_waves` computes the error.
    """
    parts = cells(series, FINE)
    per_sample, lag = inefficiency_and_lag(parts, LEAST_INEFFICIENCY)
    doubt = np.sqrt(2 * (2 * lag + 1) / len(parts))
    most = min(MOST_WAVES, len(parts) // 2)
    waves = int(len(parts) / (PER_WAVE * per_sample * (1 + doubt)))
    waves = int(np.clip(waves, LEAST_WAVES, most))
    height = scipy.fft.dct(parts, norm="ortho")[1 : waves + 2]
    others = np.sqrt(np.mean(height[1:] ** 2))
    slope = -height[0] / others if others > 0 else 0.0
    chance = scipy.special.stdtr(waves, -abs(slope))
    drift = float(np.copysign(scipy.special.ndtri(chance), slope))
    if per_sample < 1:
        return *periodic_waves(parts, per_sample), drift
    return float(np.sqrt(np.mean(height[:-1] ** 2) / len(parts))), waves, drift


def periodic_waves(parts: np.ndarray, per_sample: float) -> tuple[float, int]:
    """Return standard error of the mean and degrees of freedom of an anticorrelated series (T,).

    The running sum of an anticorrelated series contains a bounded part, which fluctuates but does
    not grow with the length of the series.  For example, the running sum of the impulses on two
    opposite walls contains the momentum of the disks between the walls, which is bounded.  The
    values of the bounded part at the start and at the end of the series contribute to the variance
    of the mean.  To the squared coefficients of a cosine transform, the bounded part contributes
    twice as much as to the variance of the mean.  To the squared coefficients of a Fourier
    transform, averaged over sines and cosines, the bounded part contributes exactly as much as to
    the variance of the mean.  The spectral density of the bounded part increases as the square of
    the frequency, and therefore coefficients of higher frequency would increase the bias of the
    mean.  For a small inefficiency `per_sample` fewer coefficients are used, such that the relative
    bias is constant.
    """
    most = min(MOST_WAVES, len(parts) // 2) // 2
    pairs = int(np.clip(round(len(parts) * per_sample**0.5 / (2 * PER_WAVE)), 1, max(1, most)))
    power = np.abs(scipy.fft.rfft(parts)[1 : pairs + 1]) ** 2
    return float(np.sqrt(np.mean(power)) / len(parts)), 2 * pairs


def equilibration(series: np.ndarray) -> int:
    """Return the number of samples before a series becomes stationary.

    The function returns twice the number of initial samples that White's rule (MSER) discards
    (White, Simulation 69, 323 (1997)).  White's rule minimises the standard error of the mean of
    the remaining samples.

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
    mean follows from the scatter of the means.

    Parameters
    ----------
    means : sequence of SeriesMean
        (R,) the means of the runs

    Returns
    -------
    SeriesMean
        the mean of the means; its attribute `samples` is the sum of the attributes of the runs or,
        if the error follows from the scatter, the number of runs

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
    """Return the squares (R,) of the standard errors of means, without Student's factor t."""
    return np.array([(one.error / student(one.freedom + 1)) ** 2 for one in means])


def scatter_p(means: Sequence[SeriesMean]) -> float:
    """Return the p-value of the hypothesis that the means differ only because of their errors."""
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
        whether a drift of at least the measured size would occur by chance with a probability below
        `UNLIKELY`

    Examples
    --------
    >>> has_drift(SeriesMean(1.0, 0.1, 50, 1.0)), has_drift(SeriesMean(1.0, 0.1, 50, 4.0))
    (False, True)
    """
    return bool(2 * scipy.special.ndtr(-abs(mean.drift)) < UNLIKELY)


def has_trend(series: np.ndarray) -> bool:
    """Determine whether a straight line explains most of the variance of a series.

    For a series that is nearly a straight line, the function `correlated_mean` finds no significant
    drift, because the function interprets the trend as a long autocorrelation.

    Parameters
    ----------
    series : numpy.ndarray
        (T,) samples at equal intervals

    Returns
    -------
    bool
        whether the squared correlation coefficient of the series and time exceeds 0.75

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
