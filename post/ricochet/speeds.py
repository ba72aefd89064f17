"""Speeds of the disks of a gas in units of their thermal speed, and the law that they follow."""

import numpy as np

from .reader import Run
from .statistics import Estimate, Law, estimate, excess_kurtosis, series_mean
from .theory import finite_n_cdf
from .thermodynamics import conserved

MEMORY = 5.0  # collisions per disk after which a speed is independent


def reduced_speeds(run: Run, frames: list[int], each: bool = False) -> np.ndarray:
    """(F * N,) speeds of these frames, each species by its own thermal speed.

    That is the one of all these frames, or of `each` for itself.
    """
    energy = np.array([run.kinetic_energy(k) for k in frames])
    for kind in run.by_species:
        own = energy[:, kind.disks]
        kt = np.mean(own, axis=1 if each else None, keepdims=True)
        energy[:, kind.disks] /= np.where(kt > 0, kt, 1)
    return np.sqrt(energy).ravel()


def independent_frames(run: Run, frames: list[int]) -> int:
    """How many independent frames these count as."""
    tau = run.collisions_per_disk_at(run.time)[frames]
    return min(len(frames), 1 + int((tau[-1] - tau[0]) / MEMORY * (1 + 1e-9)))


def relaxation(
    run: Run, until: float = 16, frames: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Collisions per disk and a2 of each frame up to `until` collisions per disk, or the first."""
    tau = run.collisions_per_disk_at(run.time)
    tau = tau[tau <= until] if frames is None else tau[:frames]
    return tau, np.array([excess_kurtosis(reduced_speeds(run, [k])) for k in range(len(tau))])


def exact_law(run: Run) -> Law | None:
    """The law of N disks that share a fixed kinetic energy, for runs that have one."""
    axes = conserved(run).sum()
    free = not run.nature.keeps_kinetic_energy
    if free or axes == 1 or (axes == 2 and np.ptp(run.mass) > 0):
        return None
    return finite_n_cdf(run.count, bool(axes == 2))


def means(runs: list[Run], frames: list[list[int]], name: str) -> tuple[Estimate, Estimate]:
    """Mean speed and mean kinetic energy of a species in some frames of each run.

    The error is over the runs, or over the frames of the only run, which remember each other.
    """
    mask = runs[0].of_species(name)
    members = [
        np.array([(run.speed(k)[mask].mean(), run.kinetic_energy(k)[mask].mean()) for k in own])
        for run, own in zip(runs, frames, strict=True)
    ]
    if len(members) > 1:
        both = zip(*estimate([one.mean(axis=0) for one in members]), strict=True)
    else:
        both = (series_mean(column)[:2] for column in members[0].T)
    return tuple(Estimate(*one) for one in both)
