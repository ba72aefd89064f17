"""Time correlation functions of displacements, velocities and densities for each species.

    from ricochet import correlations, read_run
    found = correlations.measured([read_run("runs/glass.h5")], waves=[5.2], skip=0)
    found["small"]["msd"]                # a Curve: lags x, means y, errors

Each function is a mean over pairs of samples at times t0 and t, as a function of the lag t - t0,
for one species or for "all" disks. With r the displacement of a disk from t0 to t, they are:

    msd        <r^2>, the mean square displacement
    vacf       <v(t0) v(t)>, the velocity autocorrelation; the mean square speed at lag 0
    diffusion  <v(t0) r> / 2, half the integral of vacf; not for driven disks
    alpha2     <r^4> / (2 <r^2>^2) - 1, the non-Gaussian parameter, 0 for Gaussian r
    overlap    fraction of the disks with r < `reach` [0.3 mean diameters]
    F_s(k)     <J0(k r)>, the mean of exp(i k r) over all directions, for each k of `waves`

The section "Time correlations" of docs/explanation/statistics.md explains how lags and time origins
are chosen and errors are estimated.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike
from tqdm import tqdm

from ..reading.files import RunError
from ..reading.nature import KICKED, TRAITS, allow
from ..reading.reader import Run
from ..reading.results import CHUNK
from ..running.simulation import Simulation
from .estimates import Curve, Estimate, estimate
from .statistics import FEWEST, correlated_mean
from .equilibrium import conserved_momentum, later, refuse_others

__all__ = [
    "Correlator",
    "bursts",
    "curves",
    "measured",
]

PER_DECADE = 12
FEW_PAIRS = 0.125  # fewest pairs at a lag, relative to the number at a shorter lag
ORIGINS = 16  # time origins per lag if not every sample is an origin
BLOCKS = 16  # blocks of time from which errors are estimated
REACH = 0.3  # mean diameters
CLOSE = 1e-9  # relative difference below which two lags are equal
MOST_PAIRS = 2 * 10**6  # largest number of pairs of samples whose lags are compared
PATIENCE = 5.0  # time after which a terminal shows the progress [s]
# Every sample is a time origin unless samples x lags x disks exceeds this number.
MOST_DISKS = 10**8
FLOWING = {"sheared", "sliding_surfaces", "recycled", "changed"}
FIXED = ("msd", "fourth", "vacf", "diffusion", "overlap")


def lags_of(times: np.ndarray) -> np.ndarray:
    """Return lags (L,): 0 and twelve per decade, each with many pairs of the given samples.

    In each twelfth of a decade the lag with the most pairs is chosen, unless a shorter lag has more
    than eight times as many pairs per remaining time. ValueError is raised unless there are at
    least two `times` (T,) in increasing order.
    """
    if len(times) < 2 or not (np.diff(times) > 0).all():
        raise ValueError("lags require at least two times in increasing order")
    origins = np.arange(len(times))
    most = max(16, MOST_PAIRS // len(times))
    if len(times) > most:
        origins = np.sort(np.random.default_rng(1).choice(origins, most, replace=False))
    apart = np.concatenate([times[k + 1 :] - times[k] for k in origins])
    _, first, pairs = np.unique(np.round(np.log(apart) / CLOSE), True, return_counts=True)
    part = np.floor(PER_DECADE * np.log10(apart[first] / apart.min()) + CLOSE)
    order = np.lexsort((first, -pairs, part))
    _, best = np.unique(part[order], return_index=True)
    lags, pairs = apart[first[order[best]]], pairs[order[best]]
    # time that remains after each lag, relative to the time that remains after the shortest lag
    rest = 1 + (apart.min() - lags) / (times[-1] - times[0])
    enough = pairs / rest >= FEW_PAIRS * np.maximum.accumulate(pairs / rest)
    return np.append(0, lags[enough])


def bursts(first: float, last: float, apart: float, until: float) -> np.ndarray:
    """Return sampling times in bursts, which yield many pairs of samples at every lag.

    Each burst consists of samples at logarithmically spaced times after its start, ten per decade.

    Parameters
    ----------
    first, last : float
        shortest and longest time between the start of a burst and a later sample [time]
    apart : float
        time between the starts of successive bursts [time]
    until : float
        end of the schedule [time]

    Returns
    -------
    numpy.ndarray
        (T,) increasing times, starting at 0

    Raises
    ------
    ValueError
        unless 0 < first <= last <= until and apart > 0

    Examples
    --------
    >>> times = bursts(0.1, 1.0, apart=2.0, until=5.0)
    >>> float(times[0]), len(times), bool(times[-1] <= 5)
    (0.0, 36, True)
    """
    if not (0 < first <= last <= until and apart > 0):
        raise ValueError("bursts require 0 < first <= last <= until and apart > 0")
    steps = np.geomspace(first, last, 1 + round(10 * np.log10(last / first)))
    starts = np.arange(0, until - last * (1 - CLOSE), apart)
    times = np.sort(np.add.outer(starts, np.append(0, steps)), axis=None)
    return times[np.append(True, np.diff(times) > CLOSE * first)]


class Correlator:
    """Time correlations of a run or a simulation, accumulated sample by sample.

    A sample is kept only as long as it can form pairs with later ones; in long runs about 16
    samples per lag are kept. A pickled correlator stores its complete state, so that the
    measurement continues exactly where it stopped.
    """

    def __init__(
        self,
        source: Run | Simulation,
        times: ArrayLike,
        waves: Iterable[float] = (),
        reach: float | None = None,
        lags: np.ndarray | None = None,
    ):
        """Start with empty sums for the given lags, or for the lags that `lags_of` selects."""
        cools = {"inelastic"} if source.nature.cooling else set()
        what = "time correlations require a steady state without flow"
        allow(source, what, *TRAITS.keys() - FLOWING - cools)
        self.times, self.waves = np.asarray(times, dtype=float), tuple(waves)
        self.lags = lags_of(self.times) if lags is None else np.asarray(lags, dtype=float)
        self.reach = REACH * 2 * float(source.radius.mean()) if reach is None else float(reach)
        self.kicked = bool(source.nature & KICKED)
        self.kept = conserved_momentum(source)
        names = source.names if isinstance(source, Run) else source.parameters["species"]
        self.mass, self.names = source.mass, ("all", *names)
        species = np.arange(len(self.names))
        self.shares = (species == 0) | (species == source.species[:, None])
        self.shares = self.shares / self.shares.sum(axis=0)  # (N, 1 + S)
        size = len(self.lags), BLOCKS
        self.every = len(self.times) * len(self.lags) * len(self.mass) <= MOST_DISKS
        self.pairs = np.zeros(size)
        self.sums = np.zeros((*size, len(self.names), len(FIXED) + len(self.waves)))
        self.done = 0  # number of samples added
        self.held: dict[int, np.ndarray] = {}  # samples kept, by number: x, y, vx, vy (4, N)
        # for the number of each sample: the origins that need no later sample
        self.ends: dict[int, list[int]] = {}
        # for the number of each sample: the pairs (origin, lag) that this sample completes
        self.due: dict[int, list[tuple[int, int]]] = {}
        self.last = np.full(len(self.lags), -1.0)  # time interval of the last origin of each lag

    def follow(self, source: Run | Simulation) -> Self:
        """Add new samples: those stored by a run since the last call, or of a simulation."""
        times = self.times[self.done :]
        look = {"delay": PATIENCE, "disable": None, "leave": False, "unit": "frame"}
        for place, velocity in tqdm(samples(source, times), total=len(times), **look):
            self.add(place, velocity)
        return self

    def add(self, place: np.ndarray, velocity: np.ndarray) -> None:
        """Add a sample of unwrapped positions (N, 2) and velocities (N, 2)."""
        share = self.mass / self.mass.sum()
        state = np.concatenate(
            [(values - self.kept * (share @ values)).T for values in (place, velocity)]
        )
        now, time = self.done, self.times[self.done]
        close = CLOSE * self.lags + 4 * np.spacing(self.times[-1]) * (self.lags > 0)
        partner = np.searchsorted(self.times, time + self.lags - close)
        there = np.append(self.times, np.inf)[partner] <= time + self.lags + close
        since = (time - self.times[0]) * ORIGINS / np.where(self.lags > 0, self.lags, np.inf)
        part = np.where((self.lags > 0) & (not self.every), np.floor(since + 1e-6), now)
        fresh = np.flatnonzero(there & (part > self.last))
        self.last[fresh] = part[fresh]
        for lag in fresh.tolist():
            self.due.setdefault(int(partner[lag]), []).append((now, lag))
        if len(fresh):
            self.held[now] = state
            self.ends.setdefault(int(partner[fresh].max()), []).append(now)
        if now in self.due:
            origins, lags = np.transpose(self.due.pop(now))
            self.count(origins, lags, state)
        for origin in self.ends.pop(now, []):
            del self.held[origin]
        self.done += 1

    def count(self, origins: np.ndarray, lags: np.ndarray, state: np.ndarray) -> None:
        """Add P pairs of the present sample and earlier ones, at lags with the indices `lags`."""
        values = np.empty((len(FIXED) + len(self.waves), len(origins), state.shape[1]))
        for k, origin in enumerate(origins):
            self.evaluate(self.held[origin], state, values[:, k])
        for wave, one in zip(self.waves, values[len(FIXED) :], strict=True):
            scipy.special.j0(wave * np.sqrt(values[0]), out=one)
        span = self.times[-1] - self.times[0]
        share = (self.times[origins] - self.times[0]) / span
        where = lags, np.minimum((BLOCKS * share).astype(int), BLOCKS - 1)
        np.add.at(self.pairs, where, 1)
        np.add.at(self.sums, where, np.moveaxis(values @ self.shares, 0, 2))

    def evaluate(self, before: np.ndarray, now: np.ndarray, values: np.ndarray) -> None:
        """Write the `FIXED` quantities of each disk, for two samples (4, N), to `values` (F, N)."""
        square, fourth, memory, half, overlap = values[: len(FIXED)]
        x, y = now[:2] - before[:2]
        vx, vy = before[2:]
        np.add(x * x, y * y, out=square)
        np.multiply(square, square, out=fourth)
        np.add(vx * now[2], vy * now[3], out=memory)
        np.multiply(0.5, vx * x + vy * y, out=half)
        np.less(square, self.reach**2, out=overlap)

    def amounts(self, name: str, species: int) -> np.ndarray:
        """Return sums (L, B) over the pairs at L lags that start in each of B blocks of time."""
        names = (*FIXED, *(f"F_s({k:g})" for k in self.waves))
        if name != "alpha2":
            return self.sums[:, :, species, names.index(name)]
        square, fourth = np.moveaxis(self.sums[:, :, species, :2], 2, 0)
        number = np.maximum(self.pairs.sum(axis=1, keepdims=True), 1)
        m2, m4 = (part.sum(axis=1, keepdims=True) / number for part in (square, fourth))
        m2 = np.where(m2 > 0, m2, np.nan)  # to first order in the deviations of the blocks
        return fourth / (2 * m2**2) - m4 / m2**3 * square + (m4 / m2**2 - 1) * self.pairs

    def means(self, name: str, species: int = 0) -> np.ndarray:
        """Return the mean (L,) over all pairs at each lag, NaN where there are none."""
        number = self.pairs.sum(axis=1)
        return self.amounts(name, species).sum(axis=1) / np.where(number > 0, number, np.nan)


def samples(source: Run | Simulation, times: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield unwrapped positions and velocities at given times, advancing a simulation."""
    if isinstance(source, Simulation):
        box = source.parameters["box"]
        edges = np.subtract(box["upper"], box["lower"])
        for time in times:
            source.advance(time=time)
            images = source.image * edges if "periodic" in box["boundary"] else 0.0
            yield source.position + images, source.velocity
        return
    frames = np.searchsorted(source.time, times * (1 - 1e-12))
    frames = frames[frames < source.n_frames]
    off = np.abs(source.time[frames] - times[: len(frames)]) > 1e-9 * np.abs(times[: len(frames)])
    if off.any():
        raise RunError(f"{source.path}: has no frame at t = {times[np.argmax(off)]:.9g}")
    for some in np.array_split(frames, len(frames) * source.n_disks // CHUNK + 1):
        yield from zip(source.unwrapped(some), source.velocity[some], strict=True)


def mean_of(members: Sequence[Correlator], name: str, species: int, lags: np.ndarray) -> Estimate:
    """Return a correlation function with its errors at the lags that have the indices `lags`."""
    means = [one.means(name, species)[lags] for one in members]
    if len(means) > 1:
        return estimate(means)
    error, (one,) = np.full(len(lags), np.nan), members
    amounts, span = one.amounts(name, species), one.times[-1] - one.times[0]
    for k, lag in enumerate(lags):
        some = one.pairs[lag] > 0
        if one.lags[lag] * FEWEST <= span * (1 + CLOSE) and np.isfinite(means[0][k]):
            error[k] = correlated_mean(amounts[lag, some], one.pairs[lag, some]).error
    return Estimate(means[0], error)


def curves(members: Sequence[Correlator]) -> dict[str, dict[str, Curve]]:
    """Return the correlation functions accumulated by several correlators.

    Parameters
    ----------
    members : sequence of Correlator
        (R,) correlators, with equal lags, of runs that differ only in their seed

    Returns
    -------
    dict of str to dict of str to Curve
        functions by species, including "all", and by name, as listed at the top of this module

    Examples
    --------
    >>> found = curves(correlators(runs))
    >>> sorted(found["all"])
    ['alpha2', 'diffusion', 'msd', 'overlap', 'vacf']
    """
    first = members[0]
    pairs = np.array([one.pairs.sum(axis=1) for one in members])
    lags = np.flatnonzero(pairs.all(axis=0))
    names = ["msd", "vacf", "alpha2", "overlap", *(f"F_s({k:g})" for k in first.waves)]
    names += [] if first.kicked else ["diffusion"]
    return {
        species: {name: Curve(first.lags[lags], *mean_of(members, name, k, lags)) for name in names}
        for k, species in enumerate(first.names)
    }


def correlators(
    runs: Sequence[Run],
    waves: Iterable[float] = (),
    reach: float | None = None,
    skip: float | None = None,
) -> list[Correlator]:
    """Return a correlator of each run in its steady state, with the lags of the first run.

    RunError is raised if a run has too few frames, or no lag in common with the first run.
    """
    refuse_others(runs)
    times = [run.time[later(run, skip)] for run in runs]
    lags, found = lags_of(times[0]), []
    shared = lags > 0
    for run, own in zip(runs, times, strict=True):
        found.append(Correlator(run, own, waves, reach, lags).follow(run))
        shared &= found[-1].pairs.any(axis=1)
        if not shared.any():
            raise RunError(
                f"{run.path}: no two frames have a lag of the first run; set "
                "output.frames_every_time or frames_per_decade"
            )
    return found


def measured(runs: Sequence[Run], **options: Any) -> dict[str, dict[str, Curve]]:
    """Compute the time correlation functions of runs that differ only in their seed.

    Parameters
    ----------
    runs : sequence of Run
        (R,) runs of the same disks
    **options : object
        `waves`, wavenumbers k of F_s(k) [1/length]; `reach`, the displacement below which a disk
        overlaps with its earlier position [0.3 mean diameters]; `skip`, collisions per disk
        discarded as equilibration [until no observable drifts]

    Returns
    -------
    dict of str to dict of str to Curve
        functions by species, including "all", and by name, as listed at the top of this module

    Raises
    ------
    RunError
        if a run has too few frames, or no lag in common with the first run

    Examples
    --------
    >>> found = correlations.measured(runs, waves=[5.0])
    >>> msd = found["gas"]["msd"]
    >>> float(msd.y[0]), bool(msd.y[-1] > msd.y[1])
    (0.0, True)
    """
    return curves(correlators(runs, **options))
