"""Pressure, collision rates and temperature of a run in equilibrium, with errors.

Three independent ways to the pressure: the virial of the pair collisions, the collision rate (equal
disks), the force on the sides.  Z = P / (n kT); elastic runs.  `skip` is what is left out at the
start, in collisions per disk; None finds it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from . import hard_disks
from .reader import SIDES, Run, RunError, Species
from .statistics import FEWEST, FINE, SeriesMean, equilibration, series_mean

SPEEDS_FORGET = 15.0  # collisions per disk after which no distribution of speeds remembers another
ROUNDING = 1e-6  # of the energy; more than that is lost in collisions or not at all


class Steps(NamedTuple):
    """What happened between one sample of the observables and the next, in equilibrium."""

    time: np.ndarray  # (T,) how long it was
    collisions: np.ndarray  # (T,) of pairs
    virial: np.ndarray  # (T,)
    hits: np.ndarray  # (T,) of all sides
    impulse: np.ndarray  # (T, 4) by side


def loses_energy(run: Run) -> bool:
    """Whether disks or walls have taken energy in collisions: such a gas has no equilibrium."""
    lost = run.observable("dissipated_energy").value[-1]
    return bool(lost > ROUNDING * run.kinetic_energy([0, -1]).sum(axis=1).max())


def all_cool(runs: Sequence[Run]) -> bool:
    """Whether the runs lose energy: all of them, or none."""
    cool = [loses_energy(run) for run in runs]
    if any(cool) and not all(cool):
        lossy, elastic = runs[cool.index(True)], runs[cool.index(False)]
        raise RunError(f"{lossy.path}: loses energy, {elastic.path} does not: draw them apart")
    return all(cool)


def after_start(run: Run, skip: float | None = None) -> float:
    """The time after `skip` collisions per disk, or else when speeds have forgotten the start.

    A run too short for that counts from its middle.
    """
    time = np.union1d(run.time, run.collisions_per_disk.time)
    tau = run.collisions_per_disk_at(time)
    if skip is not None and tau[-1] < skip * (1 - 1e-9):
        ends = f"ends after {tau[-1]:.4g} collisions per disk"
        raise RunError(f"{run.path}: {ends}, before --skip {skip:g}")
    if skip is not None:
        return float(time[np.searchsorted(tau, skip * (1 - 1e-9))])
    if not tau[-1] > 0:
        return float(time[-1] / 2)
    return float(np.interp(min(SPEEDS_FORGET, tau[-1] / 2), tau, time))


def start_of_equilibrium(run: Run, skip: float | None = None) -> float:
    """The time from which the gas is in equilibrium: see `start_of_steady_state`.

    Raises RunError if the run loses energy in collisions.
    """
    if loses_energy(run):
        raise RunError(
            f"{run.path}: is not elastic: it loses energy in collisions and has no equilibrium"
        )
    return start_of_steady_state(run, skip)


def start_of_steady_state(run: Run, skip: float | None = None) -> float:
    """The time after `skip` collisions per disk, or else that from which nothing drifts.

    Looked at are the collision rate and the kinetic energy of each species, at the observables or,
    if there are more of these, at the frames.  Speeds get `SPEEDS_FORGET`, as those series say
    nothing of their distribution.  A run too short for all that counts from its middle.
    """
    if skip is not None:
        return after_start(run, skip)
    few = len(run.collisions_per_disk.time) < run.frames
    time = run.time if few else run.collisions_per_disk.time
    if len(time) < 2 * FEWEST:
        return max(float(time[-1] / 2), after_start(run))
    apart = np.maximum(np.diff(time), 1e-9 * np.mean(np.diff(time)))  # two samples at one time
    series = [np.diff(run.collisions_per_disk_at(time)) / apart]
    if len(run.names) > 1 or run.gravity.any() or not run.nature.keeps_energy:
        if few:
            energy = np.array([run.kinetic_energy(frame) for frame in range(1, run.frames)])
            series += [energy[:, kind.disks].mean(axis=1) for kind in run.by_species]
        else:
            series += [run.observable(f"{name}/kinetic_energy").value[1:] for name in run.names]
    first = max(equilibration(values) for values in series)
    return max(float(time[first]), after_start(run))


def frames_from(
    run: Run, start: float, apart: float = 0.0, frames: list[int] | None = None
) -> list[int]:
    """Of the frames [all] those from a time on, each `apart` collisions per disk from the last."""
    chosen, last = [], -np.inf
    tau = run.collisions_per_disk_at(run.time)
    for frame in range(run.frames) if frames is None else sorted(frames):
        if run.time[frame] >= start and tau[frame] >= last + apart * (1 - 1e-9):
            chosen.append(frame)
            last = tau[frame]
    return chosen


def later(run: Run, skip: float | None, cool: bool) -> slice:
    """Frames in equilibrium, or after the start, without the last, which may be out of step."""
    begin = after_start if cool else start_of_equilibrium
    first = int(np.searchsorted(run.time, begin(run, skip)))
    if run.frames - 1 - first < 2:
        raise RunError(f"{run.path}: needs more frames after the start")
    return slice(first, run.frames - 1)


def steps(run: Run, skip: float | None = None) -> Steps:
    """Differences of the observables that only grow, from the start of equilibrium on."""
    time = run.collisions_per_disk.time
    first = int(np.searchsorted(time, start_of_equilibrium(run, skip)))
    if len(time) - first <= FEWEST:
        raise RunError(
            f"{run.path}: has {len(time) - first} samples of the observables in equilibrium, too "
            "few for an error; set output.observables_every_time, or run longer"
        )
    sums = (
        run.observable(name).value[first:]
        for name in ("collisions", "virial", "wall_collisions", "wall_impulse")
    )
    collisions, virial, hits, impulse = (np.diff(s, axis=0) for s in sums)
    return Steps(np.diff(time[first:]), collisions, virial, hits.sum(axis=1), impulse)


def conserved(run: Run) -> np.ndarray:
    """(2,) along which axes nothing ever changes the total momentum."""
    empty = not run.obstacles and not len(run.walls)
    return run.periodic & (run.gravity == 0) & empty


def free_disks(run: Run) -> float:
    """N, less a half for each axis along which the total momentum is conserved."""
    return run.count - conserved(run).sum() / 2


def drift(run: Run, frames: Sequence[int] = (0,)) -> np.ndarray:
    """(F, 2) conserved velocity of the centre of mass, which is no heat; 0 along other axes."""
    centre = np.average(run.velocity[list(frames)], axis=1, weights=run.mass)
    return np.where(conserved(run), centre, 0.0)


def temperature(run: Run, frames: Sequence[int] = (0,)) -> float:
    """kT, from the kinetic energy of some frames; of a gas without gravity any will do.

    Where to divide by N and where by N - 1 is in docs/theory.md.
    """
    energy = run.kinetic_energy(list(frames)).sum(axis=1)
    heat = energy - 0.5 * run.mass.sum() * np.sum(drift(run, frames) ** 2, axis=1)
    return float(np.mean(heat)) / free_disks(run)


def mean_energy(run: Run, mass: float) -> float:
    """What <K> of a disk of this mass is in equilibrium, without gravity."""
    bound = (run.count - free_disks(run)) * mass / run.mass.sum()
    return temperature(run) * (1 - bound) + 0.5 * mass * float(np.sum(drift(run) ** 2))


def packing(run: Run) -> float:
    """Area of the disks over area of the box."""
    return float(np.pi * np.sum(run.radius**2) / np.prod(run.edges))


def equal_disks(run: Run) -> bool:
    """Whether the run is of one component, as most laws are."""
    return bool(np.ptp(run.radius) == 0 and np.ptp(run.mass) == 0)


def kinds_of_disks(run: Run) -> tuple[Species, ...]:
    """The species, each of one mass and one radius, as laws by species are."""
    for kind in run.by_species:
        if not kind.alike:
            raise RunError(f"{run.path}: the disks of '{kind.name}' are not of one mass and radius")
    return run.by_species


def lightest_and_heaviest(run: Run) -> tuple[int, int]:
    """Indices of the species with the smallest and the largest mass, which must differ."""
    masses = [kind.mass for kind in run.by_species]
    if min(masses) == max(masses):
        raise RunError(f"{run.path}: needs two species of different mass")
    return int(np.argmin(masses)), int(np.argmax(masses))


def mean_free_time(run: Run) -> float:
    """1 / w, over the whole run."""
    collisions = run.collisions_per_disk.value[-1]
    if not collisions > 0:
        raise RunError(f"{run.path}: has no collisions of two disks yet")
    return run.time[-1] / collisions


def collision_rate(run: Run, skip: float | None = None) -> SeriesMean:
    """Pair collisions per disk and time."""
    s = steps(run, skip)
    return series_mean(s.collisions, s.time).scaled(2 / run.count)


def z_virial(run: Run, skip: float | None = None) -> SeriesMean:
    """P / (n kT) by the virial of the pairs."""
    s = steps(run, skip)
    return series_mean(s.virial, s.time).scaled(1 / (2 * run.count * temperature(run)), 1.0)


def z_rate(run: Run, skip: float | None = None) -> SeriesMean:
    """P / (n kT) by the collision rate; equal masses."""
    free = free_disks(run)
    diameter, mass = 2 * run.radius[0], run.mass[0]
    unit = hard_disks.collision_rate(2.0, diameter, free, temperature(run), mass)
    return collision_rate(run, skip).scaled(1 / unit, 1.0)


def z_wall(run: Run, skip: float | None = None) -> SeriesMean:
    """P / (n kT) by the force on the sides, over the area open to the centres of equal disks."""
    s = steps(run, skip)
    a = run.edges - 2 * run.radius[0]
    work = s.impulse[:, :2].mean(axis=1) * a[0] + s.impulse[:, 2:].mean(axis=1) * a[1]
    return series_mean(work, s.time).scaled(1 / (2 * run.count * temperature(run)))


def z_ways(run: Run, skip: float | None = None) -> dict[str, SeriesMean]:
    """P / (n kT) by virial, rate, walls, where they apply."""
    if run.gravity.any():
        raise RunError(f"{run.path}: falls, it has no equation of state")
    empty = not run.periodic.any() and not run.obstacles and not len(run.walls)
    walled = empty and np.ptp(run.radius) == 0
    ways = {"virial": z_virial} | ({"rate": z_rate} if equal_disks(run) else {})
    ways |= {"walls": z_wall} if walled else {}
    return {name: way(run, skip) for name, way in ways.items()}


def pressures(run: Run, skip: float | None = None) -> dict[str, SeriesMean]:
    """By the virial, and by the sides that are walls; a side feels force per length."""
    area, kt = np.prod(run.edges), run.count * temperature(run)
    found = {"pressure_virial": z_virial(run, skip).scaled(kt / area)}
    s = steps(run, skip)
    for k, side in enumerate(SIDES):
        if not run.periodic[k // 2]:
            force = series_mean(s.impulse[:, k], s.time)
            found[f"pressure_{side}"] = force.scaled(1 / run.edges[1 - k // 2])
    return found


def has_log(run: Run) -> bool:
    """Whether the collisions of the run are in its file."""
    return bool(run.parameter("output", "event_log", False))


def pair_rates(run: Run, skip: float | None = None) -> dict[str, SeriesMean]:
    """w_ij from the event log: of a disk of species i with disks of species j, per time."""
    log, species = run.events, run.species - 1
    cuts = np.linspace(start_of_equilibrium(run, skip), run.time[-1], FINE + 1)
    pairs = log.j > 0
    one, other = species[log.i[pairs] - 1], species[log.j[pairs] - 1]
    found = {}
    for a, first in enumerate(run.by_species):
        for b, second in enumerate(run.names):
            weight = ((one == a) & (other == b)) * 1.0 + ((one == b) & (other == a))
            counts, _ = np.histogram(log.time[pairs], cuts, weights=weight)
            rate = series_mean(counts, np.diff(cuts))
            found[f"w_{first.name}_{second}"] = rate.scaled(1 / first.disks.sum())
    return found


def rates(run: Run, skip: float | None = None) -> dict[str, SeriesMean]:
    """Pressures and rates of collisions, by name."""
    found = pressures(run, skip) | {"collisions_per_disk_and_time": collision_rate(run, skip)}
    if not run.periodic.all():
        s = steps(run, skip)
        found["side_hits_per_time"] = series_mean(s.hits, s.time)
    return found | (pair_rates(run, skip) if has_log(run) else {})
