"""Pressure, collision rates and temperature of a run, with errors from blocks of its time.

Three ways to the pressure that do not know of each other: the virial of the pair collisions, the
collision rate (equal disks), the force on the sides.  Z = P / (n kT); elastic runs.
"""

from typing import NamedTuple

import numpy as np

import hard_disks
from read_run import Run, RunError
from theory import Estimate

SETTLING = 20.0  # collisions per disk that are left out at the start
BLOCKS = 20


class Blocks(NamedTuple):
    """What happened in each of `BLOCKS` equal parts of the run, after the settling."""

    time: np.ndarray  # (B,)
    collisions: np.ndarray  # (B,) of pairs
    virial: np.ndarray  # (B,)
    hits: np.ndarray  # (B,) of all sides
    impulse: np.ndarray  # (B, 4) by side


def blocks(run: Run, settling: float = SETTLING) -> Blocks:
    """The run cut at samples of the observables."""
    time, tau = run.collisions_per_disk
    first = int(np.searchsorted(tau, settling)) if tau[-1] > 2 * settling else 0
    cuts = np.linspace(first, len(time) - 1, BLOCKS + 1).astype(int)
    if len(time) - first <= BLOCKS or tau[-1] == 0:
        raise RunError(f"{run.path}: too few observables for blocks, set observables_every_...")
    sums = (
        run.observable(name).value[cuts]
        for name in ("collisions", "virial", "wall_collisions", "wall_impulse")
    )
    collisions, virial, hits, impulse = (np.diff(s, axis=0) for s in sums)
    return Blocks(np.diff(time[cuts]), collisions, virial, hits.sum(axis=1), impulse)


def ratio(amount: np.ndarray, per: np.ndarray, factor: float = 1.0) -> Estimate:
    """Sum over sum, with the error from the scatter of the blocks."""
    total = np.sum(amount) / np.sum(per)
    rates = amount / per
    return Estimate(factor * total, abs(factor) * np.std(rates, ddof=1) / np.sqrt(len(rates)))


def free_disks(run: Run) -> int:
    """Disks whose momentum is free: one less if the total is zero for ever."""
    return run.count - 1 if np.all(run.periodic) else run.count


def temperature(run: Run) -> float:
    """The kT of an elastic gas, from its fixed energy."""
    return float(np.sum(run.kinetic_energy(0))) / free_disks(run)


def packing(run: Run) -> float:
    """Area of the disks over area of the box."""
    return float(np.pi * np.sum(run.radius**2) / np.prod(run.edges))


def collision_rate(run: Run) -> Estimate:
    """Pair collisions per disk and time."""
    b = blocks(run)
    return ratio(b.collisions, b.time, 2 / run.count)


def hit_rate(run: Run) -> Estimate:
    """Hits of all sides per time."""
    b = blocks(run)
    return ratio(b.hits, b.time)


def force(run: Run) -> Estimate:
    """Mean force on one side."""
    b = blocks(run)
    return ratio(b.impulse.mean(axis=1), b.time)


def z_virial(run: Run) -> Estimate:
    """P / (n kT) by the virial of the pairs."""
    b = blocks(run)
    z = ratio(b.virial, b.time, 1 / (2 * run.count * temperature(run)))
    return Estimate(1 + z.mean, z.error)


def z_rate(run: Run) -> Estimate:
    """P / (n kT) by the collision rate; equal masses."""
    free = free_disks(run)
    diameter, mass = 2 * run.radius[0], run.mass[0]
    unit = hard_disks.collision_rate(2.0, diameter, free, temperature(run), mass)
    rate = collision_rate(run)
    return Estimate(1 + rate.mean / unit, rate.error / unit)


def z_wall(run: Run) -> Estimate:
    """P / (n kT) by the forces on the sides; area open to the centres of equal disks."""
    b = blocks(run)
    a = run.edges - 2 * run.radius[0]
    work = b.impulse[:, :2].mean(axis=1) * a[0] + b.impulse[:, 2:].mean(axis=1) * a[1]
    return ratio(work, b.time, 1 / (2 * run.count * temperature(run)))


def combined(estimates: list[Estimate]) -> Estimate:
    """The mean of independent estimates, with the error that their own errors give."""
    means = np.array([e.mean for e in estimates])
    errors = np.array([e.error for e in estimates])
    return Estimate(means.mean(axis=0), np.sqrt(np.sum(errors**2, axis=0)) / len(means))
