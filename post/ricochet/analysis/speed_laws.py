"""Tests of the speeds of disks against the expected distribution.

The speeds of each frame are scaled by the energy of the frame, so that conserved and slowly
fluctuating energies do not influence the test.  Scaled speeds deviate less from the expected
distribution than independent values would (Lilliefors, Journal of the American Statistical
Association 62, 399 (1967)).  The p-values are therefore computed from random frames, which have as
many disks as the measured frames, and whose speeds are scaled by the energy of the frame, too.  The
velocities in a random frame are uniformly distributed on the sphere of constant energy.  Along the
axes that the function `equilibrium.comoving` returns, the velocities are relative to the centre of
mass.  Correlated frames are weighted according to their statistical inefficiency.
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
#: The statistical error of an estimated statistical inefficiency is proportional to 1 / sqrt(F),
#: where F is the number of frames. An estimate of the statistical inefficiency is used only if the
#: estimate exceeds 1 by more than a threshold divided by sqrt(F). For the Kolmogorov-Smirnov test,
#: the threshold is one standard deviation of an estimate from cumulative counts, about two of which
#: are independent. For the chi-square test, the threshold is two standard deviations of an estimate
#: from the counts in all bins.
LEAST_DISTANCE, LEAST_CHI2 = 1.4, 4 / np.sqrt(BINS - 1)
TAIL = 0.05  # fraction of the samples that an exponential tail replaces


class SpeedTest(NamedTuple):
    """Result of comparing speeds with the expected distribution."""

    law: str  # "fixed_energy" (N disks share a fixed energy), or "Maxwell"
    independent: float  # number of independent speeds
    ks: float  # Kolmogorov-Smirnov distance
    ks_p: float  # probability of a larger distance by chance
    chi2: float  # per degree of freedom, bins of equal probability
    chi2_p: float


def shares(run: Run, frames: Index, name: str) -> np.ndarray:
    """Return the energies (F, n) of the disks of a species, divided by the mean energy per disk.

    For a run in equilibrium, the mean is over all disks in the frame.  For any other run, the mean
    is over the disks of the species in the frame.
    """
    energy, own = thermal_energy(run, frames), run.of_species(name)
    unit = energy if run.nature.in_equilibrium else energy[:, own]
    return energy[:, own] / unit.mean(axis=1, keepdims=True)


class Sample(NamedTuple):
    """Properties of frames in which the disks of a species share an energy with other disks."""

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
        """Return a sample of about `MOST` speeds that yields the same p-values as this sample."""
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
    """Return the `Sample` that describes the disks of a species in `frames` frames of a run."""
    own, axes = run.of_species(name), tuple(map(bool, comoving(run) | bool(run.shear_rate)))
    count = int(own.sum())
    mass = (*run.mass[own], *run.mass[~own]) if any(axes) and run.n_disks <= MANY else ()
    return Sample(run.n_disks if run.nature.in_equilibrium else count, count, frames, axes, mass)


def statistics_of(values: np.ndarray) -> np.ndarray:
    """Compare S samples (S, n) with the uniform distribution; return n D^2 and chi^2, (2, S).

    The uniform distribution is over the interval from 0 to 1.  D is the Kolmogorov-Smirnov
    distance.
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
    """Return sorted values of n D^2 and sorted values of chi^2, (2, DRAWN), of random samples."""
    rng, law, parts = np.random.default_rng(1), sample.law(), []
    for _ in range(10):
        parts.append(statistics_of(law(np.sqrt(sample.draw(rng, DRAWN // 10)))))
    return np.sort(np.concatenate(parts, axis=1), axis=1)


def chance(found: float, drawn: np.ndarray) -> float:
    """Return the probability that a random statistic exceeds the measured statistic `found`.

    The probability is the fraction of the sorted random statistics `drawn` (S,) that exceed
    `found`.  If `found` is above the 95 % quantile of the random statistics, the probability
    follows instead from an exponential distribution that is fitted to the random statistics above
    this quantile.
    """
    first = int(len(drawn) * (1 - TAIL))
    if found <= drawn[first]:
        return 1 - float(np.searchsorted(drawn, found)) / len(drawn)
    mean = float(np.mean(drawn[first:] - drawn[first]))
    return TAIL * float(np.exp((drawn[first] - found) / mean))


def per_frame(counts: np.ndarray, least: float) -> float:
    """Return the statistical inefficiency of `counts` (F, B), the counts in B bins in each frame.

    If the estimate does not exceed 1 by more than `least` / sqrt(F), which is the size of random
    deviations, the function returns 1.  Without the threshold `least` / sqrt(F), the noise of the
    estimate would distort the p-value of chi^2 if there are many bins.
    """
    found = statistical_inefficiency(counts) if len(counts) > 2 else 1.0
    return found if found > 1 + least / np.sqrt(len(counts)) else 1.0


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
    size = [len(own) for own in counts]
    slow = [per_frame(np.cumsum(own, axis=1)[:, :-1], LEAST_DISTANCE) for own in counts]
    memory = float(np.average(slow, weights=size))
    fast = float(np.average([per_frame(own, LEAST_CHI2) for own in counts], weights=size))
    total = sample.own * sample.frames
    if not known:
        return SpeedTest("none", total / memory, *[np.nan] * 4)
    square, chi2 = statistics_of(np.concatenate(values).reshape(1, -1))[:, 0]
    drawn, fixed = by_chance(sample.smaller()), runs[0].nature.keeps_kinetic_energy
    return SpeedTest(
        "fixed_energy" if fixed else "Maxwell",
        total / memory,
        float(np.sqrt(square / total)),
        chance(square / memory, drawn[0]),
        chi2 / fast / (BINS - 1),
        chance(chi2 / fast, drawn[1]),
    )
