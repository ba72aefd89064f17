"""Means of correlated time series, with errors and warnings; includes the module `estimates`.

`estimate` averages independent values, such as the results of runs with different seeds;
`correlated_mean` averages the correlated samples of one time series.
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
    estimate,
    excess_kurtosis,
    fit_law,
    fit_power_law,
    goodness_of_fit,
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
    "combine_runs",
    "correlated_mean",
    "equilibration",
    "estimate",
    "excess_kurtosis",
    "fit_law",
    "fit_power_law",
    "goodness_of_fit",
    "rounded_to_error",
    "statistical_inefficiency",
    "windows",
]

MOST_WINDOWS = 10**6
FEW = 10  # independent samples
FINE, COARSE = 64, 16  # parts into which a series is divided to resolve its slow modes
FEWEST = 8  # fewest independent samples from which an error is estimated
# Smallest and largest number of slow Fourier components from which the error of a series is
# estimated.
LEAST_WAVES, MOST_WAVES = 2, 8
PER_WAVE = 6  # upper bound of the number of waves times inefficiency over length
LEAST_INEFFICIENCY = 0.02  # lower bound, for a strongly anticorrelated series


class SeriesMean(NamedTuple):
    """Mean of a correlated series, with its error and diagnostics."""

    mean: float
    error: float  # half the width of the 68 % interval; NaN below `FEWEST` independent samples
    samples: float  # effective number of independent samples
    drift: float  # slope over its error, a standard Gaussian variable if there is no drift
    freedom: float = np.inf  # degrees of freedom of the error

    @property
    def is_constant(self) -> bool:
        """Whether the series has no error although it is long enough for one.

        The error of a constant series is 0. It is NaN if the constant depends on the seed, so that
        only several runs have an error.
        """
        return self.samples >= FEWEST and not self.error > 0

    def scaled(self, factor: float, offset: float = 0.0) -> "SeriesMean":
        """Return the mean and error of offset + factor x, where x are the samples."""
        return self._replace(mean=offset + factor * self.mean, error=abs(factor) * self.error)


def cells(series: np.ndarray, count: int) -> np.ndarray:
    """Return the means of about `count` equal parts of a series (T,), omitting first samples."""
    width = max(1, len(series) // count)
    return series[len(series) % width :].reshape(-1, width).mean(axis=1)


def statistical_inefficiency(series: np.ndarray, least: float = 0.1) -> float:
    """Estimate the statistical inefficiency 1 + 2 tau of a series.

    Correlations increase the variance of the mean by this factor; tau is the integrated
    autocorrelation time in samples. The sum of autocorrelations is truncated, and corrected for the
    unknown mean, as in Wolff, Computer Physics Communications 156, 143 (2004), with S = 1.5.

    Parameters
    ----------
    series : numpy.ndarray
        (T,) samples at equal intervals, or (T, K) for K quantities, whose autocorrelations are
        added
    least : float
        lower bound of the result, which is below 1 for anticorrelated samples

    Returns
    -------
    float
        statistical inefficiency

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
    """Return the statistical inefficiency, and the lag at which its sum is truncated."""
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
    """Estimate the mean of a correlated series, or the ratio of the sums of two such series.

    The error is estimated from the slowest Fourier components (docs/explanation/statistics.md). It
    covers fluctuations within the series but not states that last as long as the run, such as the
    structure of a glass. For these, use the scatter of several runs.

    Parameters
    ----------
    amount : array_like
        (T,) samples of a series in equilibrium, such as numbers of collisions
    per : array_like
        (T,) series whose sum is the divisor, such as the times during which the collisions were
        counted; or a constant

    Returns
    -------
    SeriesMean
        sum of `amount` over the sum of `per`; the error is NaN if a short part of the series
        dominates the sum of `per`

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

    The squared error is the mean square of the lowest coefficients of a cosine transform (Lazarus
    et al., Journal of Business and Economic Statistics 36, 541 (2018)), those with periods longer
    than the inefficiency plus its standard deviation (Madras and Sokal, Journal of Statistical
    Physics 50, 109 (1988)). The drift is the first coefficient over the root mean square of the
    others (Student's distribution), converted to a standard Gaussian variable.
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

    The running sum of such a series, such as the momentum of a gas, is bounded, so that only its
    two ends contribute to the variance of the mean. A cosine transform would count them twice. The
    power rises as the square of the frequency; fewer coefficients are used if the inefficiency
    `per_sample` is smaller, so that the relative bias stays the same.
    """
    most = min(MOST_WAVES, len(parts) // 2) // 2
    pairs = int(np.clip(round(len(parts) * per_sample**0.5 / (2 * PER_WAVE)), 1, max(1, most)))
    power = np.abs(scipy.fft.rfft(parts)[1 : pairs + 1]) ** 2
    return float(np.sqrt(np.mean(power)) / len(parts)), 2 * pairs


def equilibration(series: np.ndarray) -> int:
    """Return the number of samples to discard before a series is stationary.

    It is twice the number discarded by White's rule (MSER), which minimises the standard error of
    the mean of the remaining samples (White, Simulation 69, 323 (1997)).

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
    """Average the means of independent runs.

    The error is propagated from the errors of the runs. It is estimated from the scatter of the
    means instead if a run has no error, or if the means scatter by more than their errors explain.

    Parameters
    ----------
    means : sequence of SeriesMean
        (R,) means of the runs

    Returns
    -------
    SeriesMean
        the average; `samples` is the sum of the samples of all runs or, if the error is estimated
        from the scatter, the number of runs

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
    scatter = np.sum(square**2 / own_freedom)  # Welch and Satterthwaite
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
    """Return the p-value of the hypothesis that means differ only because of their errors."""
    mean, error, _, _, freedom = np.array(means).T
    if len(means) < 2 or not np.all(error > 0):
        return 1.0
    ratio = np.var(mean, ddof=1) / np.mean(squares(means))
    return float(scipy.special.fdtrc(len(mean) - 1, min(MANY, freedom.sum()), ratio))


def has_drift(mean: SeriesMean) -> bool:
    """Return whether the drift is significant (probability by chance below `UNLIKELY`)."""
    return bool(2 * scipy.special.ndtr(-abs(mean.drift)) < UNLIKELY)


def has_trend(series: np.ndarray) -> bool:
    """Return whether a straight line explains more than 75 % of the variance of a series (T,).

    `correlated_mean` finds no drift in such a series: it mistakes the trend for a long
    autocorrelation.
    """
    if len(series) < FEWEST or np.ptp(series) <= 1e-9 * np.max(np.abs(series)):
        return False
    return bool(np.corrcoef(np.arange(len(series)), series)[0, 1] ** 2 > 0.75)


def diagnostics(name: str, means: Sequence[SeriesMean]) -> list[str]:
    """Return sentences that say why the mean over runs of the quantity `name` may be unreliable."""
    if all(one.is_constant for one in means):  # longer runs would have the same means
        return []
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
        (T,) times and values of the series
    width : float
        duration of a window [time]

    Returns
    -------
    middle, mean : numpy.ndarray
        (W,) centres and means of the complete windows that contain samples

    Raises
    ------
    ValueError
        if there were more than a million windows

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
