"""Speeds of disks relative to the thermal speed, and moments of their distribution."""

from collections.abc import Sequence

import numpy as np

from ..reading.arrays import Index, chosen
from ..reading.nature import Refused
from ..reading.reader import Run
from ..reading.results import CHUNK
from .estimates import Estimate, excess_kurtosis
from .statistics import combine_runs, correlated_mean
from .equilibrium import comoving, thermal_energy

__all__ = [
    "means",
    "reduced_speeds",
]

ENOUGH = 400  # speeds from which a local temperature is calculated


def kt_of_frames(
    run: Run, frames: Index, species: str | None = None, component: int | None = None
) -> np.ndarray:
    """Return kT (F,) in frames, relative to the shear flow and to the centre of mass.

    The result is the mean of kT_x and kT_y, or one of them if `component` is 0 or 1.
    """
    own = slice(None) if species is None else run.of_species(species)
    energy = thermal_energy(run, frames, component)[:, own].mean(axis=1)
    bound = comoving(run) | bool(run.shear_rate)  # axes along which the mean velocity is subtracted
    if component is None:
        return energy * run.n_disks / (run.n_disks - bound.sum() / 2)
    return 2 * energy * run.n_disks / (run.n_disks - bound[component])


def reduced_speeds(
    run: Run, frames: Index, each: bool = False, species: str | None = None
) -> np.ndarray:
    """Return speeds in units of the thermal speed sqrt(2 kT / m) of each species.

    Parameters
    ----------
    run : ricochet.Run
        any run
    frames : ricochet.arrays.Index
        frames to use
    each : bool
        use the kT of each frame in place of the mean over all frames
    species : str, optional
        name of the species [all]

    Returns
    -------
    numpy.ndarray
        (F * N,) reduced speeds

    Raises
    ------
    Refused
        if the disks of a species are at rest

    Examples
    --------
    >>> u = speeds.reduced_speeds(run, [-2, -1])
    >>> u.shape, round(float(np.mean(u**2)), 6)
    ((128,), 1.0)
    """
    energy = thermal_energy(run, frames)
    for kind in run.by_species:
        own = energy[:, kind.disks]
        kt = np.mean(own, axis=1 if each else None, keepdims=True)
        if not kt.all():
            raise Refused(
                f"{run.path}: '{kind.name}' is at rest (kT = 0), so that its thermal speed is 0"
            )
        energy[:, kind.disks] /= kt
    return np.sqrt(energy[:, slice(None) if species is None else run.of_species(species)]).ravel()


def moment(members: Sequence[np.ndarray], power: int, independent: float) -> Estimate:
    """Return the mean of u^power, where the speeds u are first scaled to a mean square of 1.

    `members` holds, for each run, the speeds (F, n) of n disks in F frames. The error is estimated
    from the time series of frames and corrected for the scaling. If a single run has too few
    frames, the error is calculated for `independent` uncorrelated speeds instead.
    """
    u = np.concatenate([one.ravel() for one in members])
    mean = np.mean(u**power)
    rests = [one**power - power / 2 * mean * one**2 for one in members]
    error = combine_runs([correlated_mean(rest.mean(axis=1)) for rest in rests]).error
    if not np.isfinite(error):
        error = np.std(np.concatenate([rest.ravel() for rest in rests])) / np.sqrt(independent)
    return Estimate(mean, error)


def all_move(run: Run, frame: int) -> bool:
    """Return whether at least one disk of each species moves in a frame."""
    energy = run.kinetic_energy(frame)
    return all(energy[kind.disks].any() for kind in run.by_species)


def kt_in_strips(run: Run, frames: list[int], axis: int, strips: int) -> np.ndarray:
    """Return kT (strips,) in strips of equal width across an axis, NaN where few disks are."""
    place = (run.position[frames][..., axis] - run.lower[axis]) / run.edges[axis]
    strip = np.clip((strips * place).astype(int), 0, strips - 1)
    energy = thermal_energy(run, frames)
    count, total = (
        np.bincount(strip.ravel(), weights, strips) for weights in (None, energy.ravel())
    )
    return np.where(count >= ENOUGH, total / np.maximum(count, 1), np.nan)


def relaxation(
    run: Run, until: float = 16, frames: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return collisions per disk (F,) and the second Sonine coefficient a2 (F,) of early frames.

    Frames in which a whole species is at rest are left out. Of the others, the first `frames` are
    used or, if `frames` is not given, all up to `until` collisions per disk.
    """
    tau = run.collisions_per_disk_at(run.time)
    if frames is None:
        chosen = [k for k in np.flatnonzero(tau <= until).tolist() if all_move(run, k)]
    else:
        chosen = list(range(min(frames, run.n_frames)))
    found: list[float] = []
    for some in np.array_split(chosen, len(chosen) * run.n_disks // CHUNK + 1):
        if len(some):
            speeds = reduced_speeds(run, some.tolist(), each=True)
            found += map(excess_kurtosis, speeds.reshape(len(some), -1))
    return tau[chosen], np.array(found)


def means(runs: Sequence[Run], frames: Sequence[Index], name: str) -> tuple[Estimate, Estimate]:
    """Estimate the mean speed and the mean kinetic energy of a species.

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
    tuple of Estimate
        mean speed and mean energy. The errors account for the autocorrelation of frames; for few
        frames, or runs that differ significantly, they are estimated from the scatter of the runs

    Examples
    --------
    >>> speed, energy = speeds.means(runs, [[-1]] * 3, "gas")
    >>> bool(speed.mean > 0), bool(energy.error > 0)
    (True, True)
    """
    mask = runs[0].of_species(name)
    members = [
        np.array(
            [
                (run.speed(k)[mask].mean(), run.kinetic_energy(k)[mask].mean())
                for k in chosen(run.n_frames, own)
            ]
        )
        for run, own in zip(runs, frames, strict=True)
    ]
    series = [[correlated_mean(column) for column in one.T] for one in members]
    speed, energy = (combine_runs(own) for own in zip(*series, strict=True))
    return Estimate(speed.mean, speed.error), Estimate(energy.mean, energy.error)
