"""Tests of the speeds of disks against the expected distribution.

The speeds of each frame are scaled by the energy of the frame, so that conserved and slowly
fluctuating energies do not influence the test.  Scaled speeds deviate less from the expected
distribution than independent values would (Lilliefors, Journal of the American Statistical
Association 62, 399 (1967)).  The p-values follow from a comparison with random frames, which have
as many disks as the measured frames and are scaled like the measured frames.  The velocities in a
random frame are uniformly distributed on the sphere of constant energy.  Along axes where the total
momentum is conserved, or changed only by noise, velocities are relative to the centre of mass.  If
the frames of a run are correlated, the measured statistics are divided by the statistical
inefficiency of the series of frames.  The measured inefficiency is only an estimate.  Therefore the
statistics of random frames are divided by random estimates of an inefficiency, so that the p-values
include the uncertainty of the estimate.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..predictions.theory import Law, finite_n_cdf
from ..reading.arrays import Index
from ..reading.reader import Run
from .statistics import statistical_inefficiency
from .equilibrium import comoving, thermal_energy

__all__ = ["SpeedTest", "speed_test"]

BINS = 30  # of equal probability
DRAWN = 4000  # drawn samples
MOST = 1000  # speeds of a drawn sample; more have the same distribution of the scaled statistics
MANY = 2000  # number of disks above which the motion of the centre of mass is negligible
NOISES = 400  # random estimates of a statistical inefficiency
LONG = 200  # number of frames above which the noise of this estimate is negligible
LEAST = 0.5  # smallest statistical inefficiency of frames, whose correlations are positive
TAIL = 0.05  # fraction of the samples that an exponential tail replaces


class SpeedTest(NamedTuple):
    """Result of a test that compares speeds with the expected distribution."""

    law: str  # "fixed_energy" (N disks share a fixed energy), or "Maxwell"
    independent: float  # number of independent speeds
    ks: float  # Kolmogorov-Smirnov distance
    ks_p: float  # probability of a larger distance by chance
    chi2: float  # per degree of freedom, bins of equal probability
    chi2_p: float


def shares(run: Run, frames: Index, name: str) -> np.ndarray:
    """Return the energies (F, n) of the disks of a species, divided by the mean energy per disk.

    For a run in equilibrium, the mean energy is the mean over all disks in the frame.  For any
    other run, the mean energy is the mean over the disks of the species.
    """
    energy, own = thermal_energy(run, frames), run.of_species(name)
    unit = energy if run.nature.in_equilibrium else energy[:, own]
    return energy[:, own] / unit.mean(axis=1, keepdims=True)


class Sample(NamedTuple):
    """Numbers of disks and frames in a sample of speeds, and constraints on energy and momentum."""

    sharing: int  # disks that share the energy
    own: int  # disks of the species
    frames: int
    axes: tuple[bool, ...] = (False, False)  # axes along which the centre of mass is at rest
    mass: tuple[
        float, ...
    ] = ()  # masses of all disks, those of the species first; () if masses do not matter

    def law(self) -> Law:
        """Return the expected distribution function of the reduced speed u of a sample."""
        return finite_n_cdf(self.sharing, all(self.axes) and self.own == self.sharing)

    def smaller(self) -> "Sample":
        """Return a smaller sample, of about `MOST` speeds, that yields equal p-values."""
        most = self
        if self.sharing > MANY or not any(self.axes):
            own = min(self.own, MANY)
            most = Sample(round(self.sharing * own / self.own), own, self.frames)
        return most._replace(frames=min(self.frames, -(-MOST // most.own)))

    def draw(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Return `count` random samples (count, frames * own) of energies, in units of the mean."""
        size = count * self.frames
        if self.mass:
            mass = np.array(self.mass)
            v = rng.normal(size=(size, len(mass), 2)) / np.sqrt(mass)[:, None]
            v -= np.array(self.axes) * np.average(v, axis=1, weights=mass)[:, None]
            energy = mass * np.sum(v**2, axis=-1)
            total = energy[:, : self.sharing].sum(axis=1)
            energy = energy[:, : self.own]
        else:
            energy = rng.exponential(size=(size, self.own))
            others = self.sharing - self.own
            total = energy.sum(axis=1) + (rng.gamma(others, size=size) if others else 0.0)
        return (energy * (self.sharing / total)[:, None]).reshape(count, -1)


def sample_of(run: Run, name: str, frames: int) -> Sample:
    """Return a `Sample` that describes the disks of a species in a given number of frames."""
    own, axes = run.of_species(name), tuple(map(bool, comoving(run) | bool(run.shear_rate)))
    count = int(own.sum())
    mass = (*run.mass[own], *run.mass[~own]) if any(axes) and run.n_disks <= MANY else ()
    return Sample(run.n_disks if run.nature.in_equilibrium else count, count, frames, axes, mass)


def statistics_of(values: np.ndarray) -> np.ndarray:
    """Compare S samples (S, n) with the uniform distribution; return n D^2 and chi^2, (2, S).

    The uniform distribution is over the interval from 0 to 1.  D is the Kolmogorov-Smirnov distance
    between a sample and the uniform distribution.
    """
    samples, n = values.shape
    ranks, ordered = np.arange(n) / n, np.sort(values, axis=1)
    distance = np.maximum(ordered - ranks, ranks + 1 / n - ordered).max(axis=1)
    which = np.minimum((values * BINS).astype(int), BINS - 1) + BINS * np.arange(samples)[:, None]
    counts = np.bincount(which.ravel(), minlength=BINS * samples).reshape(samples, BINS)
    chi2 = np.sum((counts - n / BINS) ** 2, axis=1) / (n / BINS)
    return np.stack([n * distance**2, chi2])


@lru_cache(maxsize=64)
def by_chance(sample: Sample) -> np.ndarray:
    """Return an array (2, DRAWN) with n D^2 and chi^2 of random samples."""
    rng, law, parts = np.random.default_rng(1), sample.law(), []
    for _ in range(10):
        parts.append(statistics_of(law(np.sqrt(sample.draw(rng, DRAWN // 10)))))
    return np.concatenate(parts, axis=1)


def chance(found: float, drawn: np.ndarray) -> float:
    """Return the probability that a random statistic exceeds the measured statistic `found`.

    The argument `drawn` (S,) contains random statistics in increasing order.  The probability is
    the fraction of the values in `drawn` that are larger than `found`.  Above the 95 % quantile of
    the random statistics, the probability follows from an exponential distribution that is fitted
    to the random statistics above this quantile.
    """
    first = int(len(drawn) * (1 - TAIL))
    if found <= drawn[first]:
        return 1 - float(np.searchsorted(drawn, found)) / len(drawn)
    mean = float(np.mean(drawn[first:] - drawn[first]))
    return TAIL * float(np.exp((drawn[first] - found) / mean))


def inefficiency(counts: Sequence[np.ndarray], cumulative: bool) -> float:
    """Return the statistical inefficiency of the numbers of disks in bins, averaged over runs.

    The argument `counts` contains the numbers (F, B) of disks in B bins in each of the F frames of
    a run.  If `cumulative` is true, the numbers are first summed over bins, as in the
    Kolmogorov-Smirnov distance.  For a run with fewer than three frames, the statistical
    inefficiency is set to 1.
    """
    series = [np.cumsum(own, axis=1)[:, :-1] if cumulative else own for own in counts]
    found = [statistical_inefficiency(own, LEAST) if len(own) > 2 else 1.0 for own in series]
    return float(np.average(found, weights=[len(own) for own in counts]))


@lru_cache(maxsize=64)
def noise(sizes: tuple[int, ...], true: float, cumulative: bool) -> np.ndarray:
    """Return random estimates (NOISES,) of a statistical inefficiency, divided by its true value.

    For 20 frames the relative noise of an estimated inefficiency is about a third.  The argument
    `sizes` contains the numbers of frames of the runs.  The function draws random series of the
    numbers of disks in bins.  The autocorrelation of the random series decays exponentially, with
    the statistical inefficiency `true`.
    """
    if sum(sizes) > LONG:
        return np.ones(NOISES)
    rng, keep = np.random.default_rng(2), (true - 1) / (true + 1)
    counts = [correlated(rng.normal(size=(size, NOISES, BINS)), keep) for size in sizes]
    drawn = ([own[:, k] for own in counts] for k in range(NOISES))
    return np.array([inefficiency(own, cumulative) for own in drawn]) / true


def correlated(values: np.ndarray, keep: float) -> np.ndarray:
    """Convert independent values (F, ..., B) into an autoregressive series of F frames.

    Each frame is `keep` times the previous frame plus independent noise.

    The values of the B bins in a frame add up to zero, because they represent deviations of the
    numbers of disks, whose total is fixed.
    """
    values = values - values.mean(axis=-1, keepdims=True)
    for k in range(1, len(values)):
        values[k] = keep * values[k - 1] + (1 - keep**2) ** 0.5 * values[k]
    return values


def p_value(
    found: float, drawn: np.ndarray, own: float, sizes: tuple[int, ...], cumulative: bool
) -> float:
    """Return the probability that a random statistic exceeds the measured statistic `found`.

    The argument `drawn` (DRAWN,) contains statistics of random samples of independent frames.
    The argument `own` is the statistical inefficiency of the measured frames, and `sizes` contains
    the numbers of frames of the runs in increasing order.
    """
    true = float(f"{max(1, own):.2g}")
    estimates = np.tile(noise(sizes, true, cumulative), DRAWN // NOISES)
    return chance(found / own, np.sort(drawn / estimates))


def speed_test(runs: Sequence[Run], frames: Sequence[Index], name: str) -> SpeedTest:
    """Compare the speeds of a species with the expected distribution.

    Parameters
    ----------
    runs : list of Run
        (R,) runs that differ by their seed
    frames : list of Index
        (R,) frames of each run
    name : str
        name of the species

    Returns
    -------
    SpeedTest
        statistics and p-values of the Kolmogorov-Smirnov test and of the chi-square test.  If the
        expected distribution is not known, `law` is "none" and all statistics and p-values are NaN.
        The distribution is not known for disks that conserve their angular momentum in a round
        container, and for fewer than three disks that share a fixed energy

    Examples
    --------
    >>> test = speed_laws.speed_test(runs, [range(2, 12)] * 3, "gas")
    >>> test.law, test.ks_p > 1e-3
    ('fixed_energy', True)
    """
    each = [shares(run, own, name) for run, own in zip(runs, frames, strict=True)]
    sample = sample_of(runs[0], name, sum(map(len, each)))
    known = sample.sharing > 2 and not any("round_container" in run.nature for run in runs)
    law, counts = sample.law(), []
    values = [law(np.sqrt(one)) for one in each]
    for one in values:
        bins = np.minimum((one * BINS).astype(int), BINS - 1)
        counts.append(np.stack([np.bincount(row, minlength=BINS) for row in bins]))
    total = sample.own * sample.frames
    summed, single = inefficiency(counts, cumulative=True), inefficiency(counts, cumulative=False)
    free = total / max(1.0, summed)
    if not known:
        return SpeedTest("none", free, *[np.nan] * 4)
    found = statistics_of(np.concatenate(values).reshape(1, -1))[:, 0]
    drawn, sizes = by_chance(sample.smaller()), tuple(sorted(map(len, counts)))
    fixed = runs[0].nature.keeps_kinetic_energy
    return SpeedTest(
        "fixed_energy" if fixed else "Maxwell",
        free,
        float(np.sqrt(found[0] / total)),
        p_value(found[0], drawn[0], summed, sizes, cumulative=True),
        found[1] / max(1.0, single) / (BINS - 1),
        p_value(found[1], drawn[1], single, sizes, cumulative=False),
    )
