"""Tests of the speed distribution.

The speeds in each frame are scaled by the energy of the frame and, where momentum is conserved,
measured relative to the centre of mass. The p-values are obtained from random frames: velocities of
the same number of disks, distributed uniformly on the sphere of constant energy and scaled in the
same way. A statistical inefficiency accounts for correlations between frames. See "p-values of
speeds" in docs/explanation/statistics.md.
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
DRAWN = 4000  # number of random samples
# Number of speeds in a random sample; the scaled statistics of larger samples have the same
# distribution.
MOST = 1000
MANY = 2000  # disks above which the motion of the centre of mass is negligible
NOISES = 400  # random estimates of a statistical inefficiency
LONG = 200  # frames above which the noise of such an estimate is negligible
LEAST = 0.5  # least statistical inefficiency of frames, whose correlations are positive
TAIL = 0.05  # fraction of the random statistics replaced by an exponential tail


class SpeedTest(NamedTuple):
    """Result of comparing measured speeds with the expected distribution."""

    law: str  # "Maxwell", or "fixed_energy" if N disks share a fixed energy
    independent: float  # number of independent speeds
    ks: float  # Kolmogorov-Smirnov distance
    ks_p: float  # probability that chance alone causes a larger distance
    chi2: float  # per degree of freedom, for bins of equal probability
    chi2_p: float


def shares(run: Run, frames: Index, name: str) -> np.ndarray:
    """Return the energies (F, n) of the disks of a species, relative to the mean energy in a frame.

    The mean is taken over all disks if the run is in equilibrium, otherwise over the species.
    """
    energy, own = thermal_energy(run, frames), run.of_species(name)
    unit = energy if run.nature.in_equilibrium else energy[:, own]
    return energy[:, own] / unit.mean(axis=1, keepdims=True)


class Sample(NamedTuple):
    """Size of a sample of speeds, and the conservation laws that constrain the speeds."""

    sharing: int  # number of disks that share the energy
    own: int  # number of disks of the species
    frames: int
    axes: tuple[bool, ...] = (False, False)  # axes along which the centre of mass is at rest
    mass: tuple[
        float, ...
    ] = ()  # masses of all disks, with those of the species first; () if masses do not matter

    def law(self) -> Law:
        """Return the expected distribution function of the reduced speed u."""
        return finite_n_cdf(self.sharing, all(self.axes) and self.own == self.sharing)

    def smaller(self) -> "Sample":
        """Return a smaller sample, of about `MOST` speeds, that yields the same p-values."""
        most = self
        if self.sharing > MANY or not any(self.axes):
            own = min(self.own, MANY)
            most = Sample(round(self.sharing * own / self.own), own, self.frames)
        return most._replace(frames=min(self.frames, -(-MOST // most.own)))

    def draw(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Return `count` random samples (count, frames * own) of energies over their mean."""
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
    """Return the `Sample` that describes the disks of a species in a given number of frames."""
    own, axes = run.of_species(name), tuple(map(bool, comoving(run) | bool(run.shear_rate)))
    count = int(own.sum())
    mass = (*run.mass[own], *run.mass[~own]) if any(axes) and run.n_disks <= MANY else ()
    return Sample(run.n_disks if run.nature.in_equilibrium else count, count, frames, axes, mass)


def statistics_of(values: np.ndarray) -> np.ndarray:
    """Compare samples (S, n) with the uniform distribution; return n D^2 and chi^2 as (2, S)."""
    samples, n = values.shape
    ranks, ordered = np.arange(n) / n, np.sort(values, axis=1)
    distance = np.maximum(ordered - ranks, ranks + 1 / n - ordered).max(axis=1)
    which = np.minimum((values * BINS).astype(int), BINS - 1) + BINS * np.arange(samples)[:, None]
    counts = np.bincount(which.ravel(), minlength=BINS * samples).reshape(samples, BINS)
    chi2 = np.sum((counts - n / BINS) ** 2, axis=1) / (n / BINS)
    return np.stack([n * distance**2, chi2])


@lru_cache(maxsize=64)
def by_chance(sample: Sample) -> np.ndarray:
    """Return n D^2 and chi^2 of random samples, an array of shape (2, DRAWN)."""
    rng, law, parts = np.random.default_rng(1), sample.law(), []
    for _ in range(10):
        parts.append(statistics_of(law(np.sqrt(sample.draw(rng, DRAWN // 10)))))
    return np.concatenate(parts, axis=1)


def chance(found: float, drawn: np.ndarray) -> float:
    """Return the probability that a random statistic exceeds the measured one, `found`.

    It is the fraction of larger values among the sorted random statistics `drawn` (S,). Above their
    95 % quantile, a fitted exponential distribution replaces them.
    """
    first = int(len(drawn) * (1 - TAIL))
    if found <= drawn[first]:
        return 1 - float(np.searchsorted(drawn, found)) / len(drawn)
    mean = float(np.mean(drawn[first:] - drawn[first]))
    return TAIL * float(np.exp((drawn[first] - found) / mean))


def inefficiency(counts: Sequence[np.ndarray], cumulative: bool) -> float:
    """Return the statistical inefficiency of the number of disks in bins, averaged over runs.

    `counts` holds the numbers (F, B) of each run, summed over the bins if `cumulative`. A run with
    fewer than three frames has the inefficiency 1.
    """
    series = [np.cumsum(own, axis=1)[:, :-1] if cumulative else own for own in counts]
    found = [statistical_inefficiency(own, LEAST) if len(own) > 2 else 1.0 for own in series]
    return float(np.average(found, weights=[len(own) for own in counts]))


@lru_cache(maxsize=64)
def noise(sizes: tuple[int, ...], true: float, cumulative: bool) -> np.ndarray:
    """Return random estimates (NOISES,) of a statistical inefficiency, divided by its true value.

    Each is based on runs of `sizes` frames whose autocorrelation decays exponentially.
    """
    if sum(sizes) > LONG:
        return np.ones(NOISES)
    rng, keep = np.random.default_rng(2), (true - 1) / (true + 1)
    counts = [correlated(rng.normal(size=(size, NOISES, BINS)), keep) for size in sizes]
    drawn = ([own[:, k] for own in counts] for k in range(NOISES))
    return np.array([inefficiency(own, cumulative) for own in drawn]) / true


def correlated(values: np.ndarray, keep: float) -> np.ndarray:
    """Convert independent values (F, ..., B) to an autoregressive series of F frames.

    The values in the B bins are deviations from the expected numbers, and add up to zero.
    """
    values = values - values.mean(axis=-1, keepdims=True)
    for k in range(1, len(values)):
        values[k] = keep * values[k - 1] + (1 - keep**2) ** 0.5 * values[k]
    return values


def p_value(
    found: float, drawn: np.ndarray, own: float, sizes: tuple[int, ...], cumulative: bool
) -> float:
    """Return the probability that a random statistic exceeds the measured one, `found`.

    `drawn` (DRAWN,) are statistics of random independent frames, `own` is the statistical
    inefficiency of the measured frames, and `sizes` are the numbers of frames of the runs in
    increasing order.
    """
    true = float(f"{max(1, own):.2g}")
    estimates = np.tile(noise(sizes, true, cumulative), DRAWN // NOISES)
    return chance(found / own, np.sort(drawn / estimates))


def speed_test(runs: Sequence[Run], frames: Sequence[Index], name: str) -> SpeedTest:
    """Compare the speeds of a species with the expected distribution.

    Parameters
    ----------
    runs : list of Run
        (R,) runs that differ only in their seed
    frames : list of Index
        (R,) frames of each run
    name : str
        name of the species

    Returns
    -------
    SpeedTest
        statistics and p-values of the Kolmogorov-Smirnov and chi-square tests. If the distribution
        is unknown, they are NaN and `law` is "none". It is unknown for disks that conserve their
        angular momentum in a round container, and for fewer than three disks that share a fixed
        energy

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
