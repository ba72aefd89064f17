"""Means with errors, fits, and tests of a sample against a law.

Two kinds of error: `estimate` is for independent members, such as runs that differ by their seed;
`correlated_mean` is for one series in time, whose samples remember each other.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ..predictions.theory import Law

MOST_WINDOWS = 10**6
FEWEST_RUNS = 4  # for an error of their error, and so to weigh by


class Estimate(NamedTuple):
    """A mean with its error, half the 68 % interval."""

    mean: Any  # a number, or an array of any shape
    error: Any  # likewise


class Curve(NamedTuple):
    """Points with the errors of y; (P,) each."""

    x: np.ndarray
    y: np.ndarray
    error: np.ndarray  # NaN where there is none


class LawTest(NamedTuple):
    """A sample compared with a law."""

    n: int  # values that count as independent
    ks: float  # Kolmogorov-Smirnov distance, the largest between the two distribution functions
    ks_p: float  # probability of a larger distance by chance
    chi2: float  # per degree of freedom, bins of equal probability
    chi2_p: float


class PowerLaw(NamedTuple):
    """y = factor x^exponent; its error is that of a weighted fit."""

    factor: float
    exponent: float
    exponent_error: float
    chi2: float = float("nan")  # per degree of freedom, of the points about it
    free: int = 0  # degrees of freedom

    def misses(self, runs: int) -> bool:
        """Whether points are farther off than errors over so many runs explain (Welch 1951)."""
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
    """Kolmogorov-Smirnov and chi-square test of a sample against a law.

    Correlated values scatter as if there were fewer: `independent` is that number [all of them].
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


ONE_SIGMA = float(scipy.special.ndtr(1))  # scipy.stats takes a second to be read


def student(samples: ArrayLike) -> Any:
    """Half the 68 % interval of a mean over its standard error, both from so many samples."""
    return scipy.special.stdtrit(np.maximum(1.0, np.subtract(samples, 1.0)), ONE_SIGMA)


def estimate(values: ArrayLike, axis: int = 0) -> Estimate:
    """Mean and error over independent members; a single member has no error (NaN)."""
    values = np.asarray(values, dtype=float)
    mean, count = values.mean(axis=axis), values.shape[axis]
    if count < 2:
        return Estimate(mean, np.full_like(mean, np.nan))
    return Estimate(mean, student(count) * values.std(axis=axis, ddof=1) / np.sqrt(count))


def propagate_error(of: Callable[[np.ndarray], float], curve: Estimate) -> Estimate:
    """When something happens to a curve: the middle and half the width between its two limits.

    They are those of the curves an error below and above.  NaN if it never happens to one of them,
    or if there are no errors.
    """
    first, last = (of(curve.mean + sign * curve.error) for sign in (-1, 1))
    return Estimate((first + last) / 2, abs(last - first) / 2)


# --- series in time ---

FINE, COARSE = 64, 16  # cells of a series: in their means fast noise fades, and slow modes show
FEWEST = 8  # samples from which an error can be had


class SeriesMean(NamedTuple):
    """The mean of a correlated series, and what is needed to trust it."""

    mean: float
    error: float  # half the 68 % interval; NaN if worth fewer than `FEWEST` samples
    samples: float  # independent samples that the series is worth
    drift: float  # second half less first half, over the error of that difference

    def scaled(self, factor: float, offset: float = 0.0) -> "SeriesMean":
        """The same for offset + factor x."""
        return self._replace(mean=offset + factor * self.mean, error=abs(factor) * self.error)


def cells(series: np.ndarray, count: int) -> np.ndarray:
    """Means over `count` equal parts of a series (T,); samples too many for that lead and go."""
    width = max(1, len(series) // count)
    return series[len(series) % width :].reshape(-1, width).mean(axis=1)


def statistical_inefficiency(series: np.ndarray, least: float = 0.1) -> float:
    """1 + 2 tau, tau the integrated autocorrelation time in samples: as many count as one.

    Below 1, but not below `least`, where samples make up for each other, as hits of a wall do.

    The window of the sum and the correction for the unknown mean are those of U. Wolff, Comput.
    Phys. Commun. 156, 143 (2004), with S = 1.5.  Sums that end at the first negative term, as
    libraries have them, give too small errors for series as short as these.
    """
    count, rest = len(series), series - np.mean(series)
    if np.ptp(series) <= 1e-12 * np.max(np.abs(series), initial=0):
        return 1.0
    found, lag = 1.0, 0
    for lag in range(1, count // 2):
        found += 2 * np.mean(rest[lag:] * rest[:-lag]) / np.mean(rest**2)
        tau = 1.5 / np.log((found + 1) / (found - 1)) if found > 1 else 1e-9
        if np.exp(-lag / tau) < tau / np.sqrt(lag * count):
            break
    return max(least, found) * (1 + (2 * lag + 1) / count)


def correlated_mean(amount: np.ndarray, per: np.ndarray | float = 1.0) -> SeriesMean:
    """Sum of a series (T,) in equilibrium over the sum of another, such as counts over times.

    The error is that of the mean of amount - ratio * per, from the autocorrelation of its cells,
    with Student's t for few samples.  There is none if a few cells have most of the weight, as with
    samples in decades.
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
    coarse = cells(rest, COARSE)
    least = min(
        1.0, statistical_inefficiency(cells(rest, FINE))
    )  # few cells may seem to make up for each other
    free = len(coarse) / statistical_inefficiency(coarse, least)
    error = float(np.std(coarse, ddof=1) / np.sqrt(free))
    if not error > 1e-12 * np.max(np.abs(amount)) / np.mean(per):  # constant but for rounding
        return SeriesMean(mean, 0.0, float(len(rest)), 0.0)
    early, late = (half.mean() for half in np.array_split(rest, 2))
    samples = min(float(len(rest)), float(np.var(rest)) / error**2)
    interval = error * float(student(min(free, len(coarse))))
    return SeriesMean(mean, interval, samples, float(late - early) / (2 * error))


def equilibration(series: np.ndarray) -> int:
    """Where a series (T,) may be taken as stationary: twice the point that White's rule finds.

    The rule (MSER; K. P. White, Simulation 69, 323 (1997)) drops what makes the standard error of
    the rest smallest; at that point what is left of the start is as large as the noise.
    """
    values = cells(series, FINE)
    count = len(values)
    scatter = [np.var(values[k:]) / (count - k) for k in range(count // 4 + 1)]
    return 2 * int(np.argmin(scatter)) * max(1, len(series) // FINE)


def combine_runs(means: Sequence[SeriesMean]) -> SeriesMean:
    """The mean over independent runs; their scatter counts where errors do not explain it, or lack.

    Samples add up, but where the scatter counts a run is one sample; drifts that agree grow.
    """
    runs = len(means)
    mean, error, samples, drift = np.array(means).T
    size, own = samples.sum(), np.sqrt(np.sum(error**2)) / runs
    if scatter_p(means) < UNLIKELY or np.isnan(own):
        size, own = runs, estimate(mean).error
    return SeriesMean(mean.mean(), float(own), float(size), float(drift.sum() / np.sqrt(runs)))


UNLIKELY = 0.005  # probability below which chance is no explanation
FEW = 10  # independent samples


def scatter_p(means: Sequence[SeriesMean]) -> float:
    """Probability that runs scatter more than this, if their errors are right."""
    mean, error, *_ = np.array(means).T
    if len(means) < 2 or not np.all(error > 0):
        return 1.0
    chi2 = len(mean) * np.var(mean) / np.mean(error**2)
    return float(scipy.special.chdtrc(len(mean) - 1, chi2))


def has_drift(mean: SeriesMean) -> bool:
    """Whether its halves differ by more than chance explains."""
    return bool(2 * scipy.special.ndtr(-abs(mean.drift)) < UNLIKELY)


def has_trend(series: np.ndarray) -> bool:
    """Whether most of how a series (T,) varies is a straight line: it grows or falls all the time.

    That looks like a long memory to `correlated_mean`, whose error then hides the drift.
    """
    if len(series) < FEWEST or np.ptp(series) <= 1e-9 * np.max(np.abs(series)):
        return False
    return bool(np.corrcoef(np.arange(len(series)), series)[0, 1] ** 2 > 0.75)


def diagnostics(name: str, means: Sequence[SeriesMean]) -> list[str]:
    """Why the mean over these runs should not be trusted, in sentences; none if it may be."""
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
    """Middles and means of windows of a series (T,) that have samples; no incomplete last one."""
    count = max(1, int(np.floor((time[-1] - time[0]) / width + 1e-9)))
    if count > MOST_WINDOWS:
        raise ValueError(f"{count} windows of {width:g}")
    index = np.minimum(((time - time[0]) / width).astype(int), count)
    sums = np.bincount(index, value, count + 1)[:count]
    numbers = np.bincount(index, minlength=count + 1)[:count]
    some = np.flatnonzero(numbers)
    return time[0] + (some + 0.5) * width, sums[some] / numbers[some]


def binned(values: np.ndarray, bins: np.ndarray, independent: int | None = None) -> Estimate:
    """Histogram (B,) with integral 1; errors as of so many `independent` values, or of all."""
    share = np.histogram(values, bins)[0] / len(values)
    error = np.sqrt(share * (1 - share) / (independent or len(values)))
    return Estimate(share / np.diff(bins), error / np.diff(bins))


def excess_kurtosis(speed: np.ndarray) -> float:
    """a2 = <v^4> / (2 <v^2>^2) - 1: zero for a Maxwell law, -1/2 for equal speeds."""
    square = np.square(speed)
    return float(np.mean(square**2) / (2 * np.mean(square) ** 2) - 1)


def rounded_to_error(mean: float, error: float) -> tuple[str, ...]:
    """Both with the two digits of the error that say something; the mean alone without an error."""
    if not np.isfinite(error):
        return (f"{mean:.4g}",)
    if error == 0:
        return f"{mean:.6g}", "0"
    places = max(0, 1 - int(np.floor(np.log10(float(f"{error:.1e}")))))
    return f"{mean:z.{places}f}", f"{error:.{places}f}"


def kurtosis_noise(count: int) -> float:
    """Standard deviation of `excess_kurtosis` of so many Maxwellian speeds in two dimensions.

    To first order a2 is the mean of x^2 / 2 - 2 x, less its mean, where x = v^2 is exponential with
    the mean 1: variance 20 / 4 + 4 * 1 - 2 * 4 = 1.
    """
    return 1 / np.sqrt(count)


def fit_power_law(
    x: np.ndarray, y: np.ndarray, y_error: np.ndarray | None = None
) -> PowerLaw | None:
    """Weighted straight line through ln y against ln x; None with fewer than three points.

    If the points scatter by more than their errors, the errors of the fit are enlarged to match.
    Without errors all points weigh alike, and their scatter is all that makes the error.
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
