"""Measurements that several sections share: pure functions of a run."""

from typing import NamedTuple

import numpy as np

import hard_disks
from read_run import Run
from theory import Estimate, estimate

SETTLING = 20.0  #: collisions per disk that are left out at the start
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
    """KT of an elastic gas, from the fixed energy."""
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


def over_runs(measure, runs: tuple[Run, ...]) -> Estimate:
    """The mean of a measurement over independent runs, with the error from their scatter."""
    return estimate([measure(run) for run in runs])


def several(estimates: list[Estimate]) -> Estimate:
    """Several estimates as one with vectors."""
    return Estimate(*(np.array(part, dtype=float) for part in zip(*estimates, strict=True)))


def at_collisions(run: Run, name: str, tau: np.ndarray) -> np.ndarray:
    """An observable after so many collisions per disk."""
    return np.interp(tau, run.collisions_per_disk.value, run.observable(name).value)


def closest_gap(run: Run) -> float:
    """Smallest gap between two disks in any frame, in mean diameters; -1e-12 counts as contact."""
    from scipy.spatial import cKDTree

    reach = 2 * run.radius.max()
    smallest = np.inf
    box = np.where(run.periodic, run.edges, 0)
    for x in run.position:
        inside = (x - run.lower) % np.where(run.periodic, run.edges, np.inf)
        tree = cKDTree(inside, boxsize=box if run.periodic.any() else None)
        pairs = tree.query_pairs(1.01 * reach, output_type="ndarray")
        if len(pairs) == 0:
            continue
        apart = inside[pairs[:, 0]] - inside[pairs[:, 1]]
        apart -= box * np.round(apart / np.where(run.periodic, run.edges, 1))
        gap = np.linalg.norm(apart, axis=1) - run.radius[pairs].sum(axis=1)
        smallest = min(smallest, gap.min())
    return smallest / (2 * run.radius.mean())


def differences(run: Run, other: Run, factor: float = 1.0) -> int:
    """How many events, places, velocities are not the same to the last bit.

    `other` is the faster one, by `factor`.
    """
    a, b = run.events, other.events
    if len(a.time) != len(b.time):
        return max(len(a.time), len(b.time))
    parts = (
        a.i != b.i, a.j != b.j, a.time != factor * b.time,
        run.position[-1] != other.position[-1], factor * run.velocity[-1] != other.velocity[-1],
    )  # fmt: skip
    return sum(int(np.sum(part)) for part in parts)
