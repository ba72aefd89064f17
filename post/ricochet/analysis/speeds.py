"""Speeds of the disks of a gas in units of their thermal speed, and the law that they follow."""

import numpy as np

from ..predictions.theory import Law, finite_n_cdf
from ..reading.nature import Refused
from ..reading.reader import Run
from .statistics import Estimate, estimate, excess_kurtosis, correlated_mean
from .thermodynamics import conserved, drift, free_disks

MEMORY = 5.0  # collisions per disk after which a speed is independent


def thermal_energy(run: Run, frames: slice | list[int]) -> np.ndarray:
    """(F, N) m v^2 / 2, v relative to the flow of a sheared box and to what never changes."""
    velocity = run.velocity[frames]
    if run.shear_rate:
        velocity[..., 0] -= run.shear_rate * run.position[frames][..., 1]
        velocity -= np.average(velocity, axis=1, weights=run.mass)[:, None]
    else:
        velocity -= drift(run)
    return 0.5 * run.mass * np.sum(velocity**2, axis=-1)


def kt_of_frames(run: Run, frames: slice | list[int]) -> np.ndarray:
    """(F,) kT, of the momenta that are free."""
    free = run.n_disks - 1 if run.shear_rate else free_disks(run)
    return thermal_energy(run, frames).sum(axis=1) / free


def reduced_speeds(run: Run, frames: list[int], each: bool = False) -> np.ndarray:
    """(F * N,) speeds of these frames, each species by its own thermal speed.

    That is the one of all these frames, or of `each` for itself.  Refuses disks at rest.
    """
    energy = thermal_energy(run, frames)
    for kind in run.by_species:
        own = energy[:, kind.disks]
        kt = np.mean(own, axis=1 if each else None, keepdims=True)
        if not kt.all():
            raise Refused(f"{run.path}: '{kind.name}' is at rest (kT = 0), it has no thermal speed")
        energy[:, kind.disks] /= kt
    return np.sqrt(energy).ravel()


def moment(u: np.ndarray, power: int, independent: int) -> Estimate:
    """Mean of a power of speeds whose mean square is 1, which is measured with them."""
    mean = np.mean(u**power)
    rest = u**power - power / 2 * mean * u**2
    return Estimate(mean, np.std(rest) / np.sqrt(independent))


def all_move(run: Run, frame: int) -> bool:
    """Whether each species has speeds in a frame."""
    energy = run.kinetic_energy(frame)
    return all(energy[kind.disks].any() for kind in run.by_species)


def independent_frames(run: Run, frames: list[int]) -> int:
    """How many independent frames these count as."""
    tau = run.collisions_per_disk_at(run.time)[frames]
    return min(len(frames), 1 + int((tau[-1] - tau[0]) / MEMORY * (1 + 1e-9)))


def relaxation(
    run: Run, until: float = 16, frames: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Collisions per disk and a2 of each frame up to `until` collisions per disk, or the first.

    Frames with disks at rest have none: they are left out, or refused among the first.
    """
    tau = run.collisions_per_disk_at(run.time)
    if frames is None:
        chosen = [k for k in np.flatnonzero(tau <= until).tolist() if all_move(run, k)]
    else:
        chosen = list(range(min(frames, run.n_frames)))
    return tau[chosen], np.array([excess_kurtosis(reduced_speeds(run, [k])) for k in chosen])


def exact_law(run: Run) -> Law | None:
    """The law of N disks that share a fixed kinetic energy, for runs that have one."""
    axes = int(conserved(run).sum())
    free = not run.nature.keeps_kinetic_energy or run.n_disks < 2 + axes / 2
    if free or "round_container" in run.nature or axes == 1 or (axes == 2 and np.ptp(run.mass) > 0):
        return None
    return finite_n_cdf(run.n_disks, axes == 2)


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
        whole = estimate([one.mean(axis=0) for one in members])
        (v, k), (dv, dk) = whole.mean, whole.error
        return Estimate(v, dv), Estimate(k, dk)
    speed, energy = (correlated_mean(column) for column in members[0].T)
    return Estimate(speed.mean, speed.error), Estimate(energy.mean, energy.error)
