"""Pressure, collision rates and temperature of a run, with errors from blocks of its time.

Three independent ways to the pressure: the virial of the pair collisions, the collision rate (equal
disks), the force on the sides.  Z = P / (n kT); elastic runs.  `skip` is what is left out at the
start, in collisions per disk.
"""

from typing import NamedTuple

import numpy as np

from . import hard_disks
from .reader import Run, RunError
from .statistics import Estimate, ratio

SKIP = 20.0  # collisions per disk
BLOCKS = 20


class Blocks(NamedTuple):
    """What happened in each of `BLOCKS` equal parts of the run."""

    time: np.ndarray  # (B,)
    collisions: np.ndarray  # (B,) of pairs
    virial: np.ndarray  # (B,)
    hits: np.ndarray  # (B,) of all sides
    impulse: np.ndarray  # (B, 4) by side


def settled(tau: np.ndarray, skip: float) -> int:
    """Index of the first sample after `skip`; 0 if the run, `tau` (T,), is not twice as long."""
    return int(np.searchsorted(tau, skip)) if tau[-1] > 2 * skip else 0


def equilibrium_frames(
    run: Run, skip: float, apart: float = 0.0, frames: list[int] | None = None
) -> list[int]:
    """Of the frames [all] those after `skip` collisions per disk, each `apart` from the last."""
    chosen, last = [], -np.inf
    tau = run.collisions_per_disk_at(run.time)
    for frame in range(run.frames) if frames is None else sorted(frames):
        if tau[frame] >= skip and tau[frame] >= last + apart * (1 - 1e-9):
            chosen.append(frame)
            last = tau[frame]
    return chosen


def blocks(run: Run, skip: float = SKIP) -> Blocks:
    """The run cut at samples of the observables."""
    time, tau = run.collisions_per_disk
    first = settled(tau, skip)
    cuts = np.linspace(first, len(time) - 1, BLOCKS + 1).astype(int)
    if len(time) - first <= BLOCKS or tau[-1] == 0:
        raise RunError(f"{run.path}: too few observables for blocks, set observables_every_...")
    sums = (
        run.observable(name).value[cuts]
        for name in ("collisions", "virial", "wall_collisions", "wall_impulse")
    )
    collisions, virial, hits, impulse = (np.diff(s, axis=0) for s in sums)
    return Blocks(np.diff(time[cuts]), collisions, virial, hits.sum(axis=1), impulse)


def free_disks(run: Run) -> int:
    """Disks whose momentum is free: one less if the total is always zero."""
    return run.count - 1 if np.all(run.periodic) else run.count


def temperature(run: Run) -> float:
    """The kT of an elastic gas, from its fixed energy."""
    return float(np.sum(run.kinetic_energy(0))) / free_disks(run)


def packing(run: Run) -> float:
    """Area of the disks over area of the box."""
    return float(np.pi * np.sum(run.radius**2) / np.prod(run.edges))


def lightest_and_heaviest(run: Run) -> tuple[int, int]:
    """Indices of the species with the smallest and the largest mass."""
    masses = [kind.mass for kind in run.by_species]
    return int(np.argmin(masses)), int(np.argmax(masses))


def collision_rate(run: Run, skip: float = SKIP) -> Estimate:
    """Pair collisions per disk and time."""
    b = blocks(run, skip)
    return ratio(b.collisions, b.time, 2 / run.count)


def z_virial(run: Run, skip: float = SKIP) -> Estimate:
    """P / (n kT) by the virial of the pairs."""
    b = blocks(run, skip)
    z = ratio(b.virial, b.time, 1 / (2 * run.count * temperature(run)))
    return Estimate(1 + z.mean, z.error)


def z_rate(run: Run, skip: float = SKIP) -> Estimate:
    """P / (n kT) by the collision rate; equal masses."""
    free = free_disks(run)
    diameter, mass = 2 * run.radius[0], run.mass[0]
    unit = hard_disks.collision_rate(2.0, diameter, free, temperature(run), mass)
    rate = collision_rate(run, skip)
    return Estimate(1 + rate.mean / unit, rate.error / unit)


def z_wall(run: Run, skip: float = SKIP) -> Estimate:
    """P / (n kT) by the force on the sides, over the area open to the centres of equal disks."""
    b = blocks(run, skip)
    a = run.edges - 2 * run.radius[0]
    work = b.impulse[:, :2].mean(axis=1) * a[0] + b.impulse[:, 2:].mean(axis=1) * a[1]
    return ratio(work, b.time, 1 / (2 * run.count * temperature(run)))
