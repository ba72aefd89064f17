"""Pressure, collision rates and temperature of runs in equilibrium, with errors.

The pressure P can be measured in three independent ways: from the virial of the pair collisions,
from the collision rate of equal disks, and from the force on the sides.  The compressibility factor
is Z = P / (n kT).  If the kinetic energy is conserved, kT is exact; otherwise kT is a mean over
time.  The parameter `skip` of many functions is the duration of the equilibration, in collisions
per disk; samples from the equilibration are left out.  If `skip` is None, the duration is
determined from the data.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..predictions import hard_disks
from ..reading.arrays import Index, chosen
from ..reading.files import RunError
from ..reading.nature import KICKED, ROUNDING, SETTLED, Refused, allow
from ..reading.reader import SIDES, Run, Species
from ..running.simulation import Simulation
from .statistics import FEWEST, FINE, SeriesMean, equilibration, correlated_mean

__all__ = [
    "collision_rate",
    "frames_from",
    "free_disks",
    "kt_at_start",
    "mean_energy",
    "mean_free_time",
    "packing",
    "pair_rates",
    "pressures",
    "rates",
    "start_of_equilibrium",
    "start_of_steady_state",
    "temperature",
    "z_rate",
    "z_virial",
    "z_wall",
    "z_ways",
]

TIMED = ("every_time", "at", "per_decade")  # samples are taken at times, not after collisions
SPEEDS_FORGET = 15.0  # collisions per disk after which speeds are independent of the start
ALONG_WALLS = {
    "thermal_walls",
    "rough",
    "rotating",
    "inelastic",
}  # with these traits walls may change the momentum along them
MANY = 1e8  # number of disks above which the effect of a fixed energy is negligible
#: Traits (see `nature`) that a run may have if an equation of state applies to the run. A run
#: without any trait has equal smooth disks with conserved energy in a periodic box.
FLUID = ("walls", "thermal_walls", "thermostatted", "rough", "rotating", "mixture")


class Steps(NamedTuple):
    """Changes of observables between successive samples in equilibrium."""

    time: np.ndarray  # (T,) duration
    kt: np.ndarray  # (T,) mean over the duration
    collisions: np.ndarray  # (T,) number of pair collisions
    virial: np.ndarray  # (T,)
    hits: np.ndarray  # (T,) of all sides
    impulse: np.ndarray  # (T, 4) by side


def refuse_others(runs: Sequence[Run]) -> None:
    """Raise an error unless all runs have the same species with the same numbers of disks."""
    for run in runs:
        if run.names != runs[0].names or not np.array_equal(run.species, runs[0].species):
            raise RunError(f"{run.path}: its disks are not those of {runs[0].path}")


def all_settle(runs: Sequence[Run]) -> bool:
    """Return whether the runs relax to equilibrium; raise an error if only some runs do so."""
    settled = [run.nature.in_equilibrium for run in runs]
    if any(settled) and not all(settled):
        one, other = runs[settled.index(False)], runs[settled.index(True)]
        raise RunError(
            f"{one.path}: has no equilibrium, but {other.path} has one: draw them separately"
        )
    return all(settled)


def after_start(run: Run, skip: float | None = None) -> float:
    """Return the time after which `skip` collisions per disk have occurred.

    By default the number of collisions per disk is `SPEEDS_FORGET`, or half of the collisions of a
    short run.  In a run without collisions, the result is half of the duration.
    """
    time = np.union1d(run.time, run.collisions_per_disk.time)
    tau = run.collisions_per_disk_at(time)
    if skip is not None and tau[-1] < skip * (1 - 1e-9):
        ends = f"ends after {tau[-1]:.4g} collisions per disk"
        raise RunError(f"{run.path}: {ends}, before --equilibration {skip:g}")
    if skip is not None:
        return float(time[np.searchsorted(tau, skip * (1 - 1e-9))])
    if not tau[-1] > 0:
        return float(time[-1] / 2)
    return float(np.interp(min(SPEEDS_FORGET, tau[-1] / 2), tau, time))


def start_of_steady_state(run: Run, skip: float | None = None) -> float:
    """Return the time after which a run is in a steady state.

    A run is regarded as steady after the time at which the collision rate and the energies of the
    species stop drifting.  Drifts are found in the samples of the observables or, if there are few
    samples, in the frames.  The result is at least `SPEEDS_FORGET` collisions per disk after the
    start, because the distribution of speeds relaxes during this time.  If a run has
    fewer than 2 `SPEEDS_FORGET` collisions per disk, this minimum is half of their number.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse
    skip : float, optional
        duration of the equilibration, in collisions per disk [until no observable drifts]

    Returns
    -------
    float
        time

    Examples
    --------
    >>> start = thermodynamics.start_of_steady_state(run)
    >>> bool(0 < start < run.time[-1])
    True
    """
    return explained_start(run, skip)[0]


def explained_start(run: Run, skip: float | None = None) -> tuple[float, str]:
    """Return the time after which a run is steady, and a text with the reason for this time."""
    forgets = f"{SPEEDS_FORGET:g} collisions per disk, the relaxation time of speeds"
    if skip is not None:
        return after_start(run, skip), f"--equilibration {skip:g}"
    if run.nature.cooling:
        return after_start(run), forgets
    time, series = examined(run)
    if not series:
        later = max(float(time[-1] / 2), after_start(run))
        return later, "half of the time: too few samples to see a drift"
    last = {name: equilibration(values) for name, values in series.items()}
    slowest = max(last, key=last.__getitem__)
    drifts, early = float(time[last[slowest]]), after_start(run)
    if drifts <= early:
        return early, forgets
    return drifts, f"the {slowest} drifts until then, or fluctuates too slowly to exclude a drift"


def examined(run: Run) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return times (T,) and a dictionary with the series (T - 1,) that are tested for drifts.

    If there are too few samples for a test, the dictionary is empty.
    """
    few = has_few_observables(run)
    time = run.time if few else run.collisions_per_disk.time
    if len(time) < 2 * FEWEST:
        return time, {}
    apart = np.maximum(np.diff(time), 1e-9 * np.mean(np.diff(time)))  # two samples at the same time
    series = {"collision rate": np.diff(run.collisions_per_disk_at(time)) / apart}
    if len(run.names) == 1 and run.nature.keeps_kinetic_energy:
        return time, series
    if few:
        energy = np.concatenate([thermal_energy(run, [k]) for k in range(1, run.n_frames)])
        return time, series | {
            f"kinetic energy of {kind.name}": energy[:, kind.disks].mean(axis=1)
            for kind in run.by_species
        }
    kinetic = "temperature" if "random_walk" in run.nature else "kinetic_energy"
    for name in sorted(run.names):
        for kind in (kinetic, "potential_energy", "rotational_energy"):
            if (known := f"{name}/{kind}") in run.observables:
                series[f"{kind.replace('_', ' ')} of {name}"] = run.observable(known).value[1:]
    return time, series


def start_of_equilibrium(run: Run, skip: float | None = None) -> float:
    """Return the time after which a run is in equilibrium.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse
    skip : float, optional
        duration of the equilibration, in collisions per disk [until no observable drifts]

    Returns
    -------
    float
        time

    Raises
    ------
    Refused
        if the run does not reach equilibrium

    Examples
    --------
    >>> start = thermodynamics.start_of_equilibrium(run, skip=10)
    >>> bool(run.collisions_per_disk_at(start) >= 9.9)
    True
    """
    allow(run, "it does not reach equilibrium", *SETTLED)
    return start_of_steady_state(run, skip)


def frames_from(
    run: Run, start: float, apart: float = 0.0, frames: list[int] | None = None
) -> list[int]:
    """Select frames after a given time with a minimum number of collisions between them.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse
    start : float
        time of the first frame
    apart : float
        smallest number of collisions per disk between two selected frames
    frames : list of int, optional
        frames from which to select [all frames]

    Returns
    -------
    list of int
        numbers of the frames

    Examples
    --------
    >>> some = thermodynamics.frames_from(run, 0.0, apart=10)
    >>> 5 <= len(some) <= 7
    True
    """
    chosen, last = [], -np.inf
    tau = run.collisions_per_disk_at(run.time)
    for frame in range(run.n_frames) if frames is None else sorted(frames):
        if run.time[frame] >= start and tau[frame] >= last + apart * (1 - 1e-9):
            chosen.append(frame)
            last = tau[frame]
    return chosen


def later(run: Run, skip: float | None = None) -> slice:
    """Return the frames in the steady state or, for a cooling gas, the frames after `after_start`.

    The last frame is left out, because the last interval between frames may differ from the other
    intervals.
    """
    first = int(np.searchsorted(run.time, start_of_steady_state(run, skip)))
    if run.n_frames - 1 - first < 2:
        raise RunError(f"{run.path}: needs more frames after the start")
    return slice(first, run.n_frames - 1)


# --- temperature ---


def motion_notes(runs: Sequence[Run]) -> list[str]:
    """Return a note if motion is measured relative to a centre of mass that noise moves."""
    walks = any("random_walk" in run.nature for run in runs)
    note = "noise moves the centre of mass (drive.keep_momentum): motion is measured relative to it"
    return [note] * walks


def unforced(source: Run | Simulation) -> np.ndarray:
    """Return a mask (2,) of the axes along which nothing except noise changes the total momentum.

    Forces of walls parallel to an axis are not considered.  Such walls conserve the momentum along
    the axis unless the run has a trait in `ALONG_WALLS`.  If noise moves the centre of mass, and
    walls of a run with such a trait may stop this motion, an error is raised.
    """
    box, nature = source.parameters.get("box", {}), source.nature
    if nature & (KICKED - {"noise_driven"}) or nature & {"obstacles", "changed"}:
        return np.zeros(2, dtype=bool)
    axes = (np.array(box["boundary"]) == "periodic") & (np.array(box.get("gravity", 0.0)) == 0)
    if axes.any() and "random_walk" in nature and "walls" in nature and nature & ALONG_WALLS:
        name = getattr(source, "path", "the simulation")
        why = "noise moves its centre of mass, and walls may stop it"
        raise Refused(f"{name}: {why}; set drive.keep_momentum = .true.")
    return axes & ("sheared" not in nature or "random_walk" in nature)


def comoving(run: Run) -> np.ndarray:
    """Return a mask (2,) of the axes along which motion is relative to the centre of mass.

    Along these axes the total momentum is conserved, or only noise changes the total momentum.
    """
    kept = unforced(run)
    if run.nature & ALONG_WALLS and "random_walk" not in run.nature:
        carried = run.mass[:, None] * run.velocity[[0, -1]]
        kept &= np.abs(np.ptp(carried.sum(axis=1), axis=0)) < ROUNDING * np.abs(carried).sum()
    return kept


def thermal_energy(run: Run, frames: Index, component: int | None = None) -> np.ndarray:
    """Return the energies m v^2 / 2 (F, N) of the thermal motion of disks in the given frames.

    The velocity v is relative to the shear flow and, along `comoving` axes, to the centre of mass.
    If `component` is 0, only the x component of v is used.  If `component` is 1, only the y
    component is used.
    """
    frames = chosen(run.n_frames, frames)
    velocity = run.velocity[frames]
    if run.shear_rate:
        velocity[..., 0] -= run.shear_rate * run.position[frames][..., 1]
    axes = comoving(run) | bool(run.shear_rate)
    velocity -= axes * np.average(velocity, axis=1, weights=run.mass)[:, None]
    parts = slice(None) if component is None else slice(component, component + 1)
    return 0.5 * run.mass * np.sum(velocity[..., parts] ** 2, axis=-1)


def free_disks(run: Run) -> float:
    """Return the effective number of disks: the total kinetic energy divided by kT.

    This number is N minus 1/2 for each axis along which motion is relative to the centre of mass.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse

    Returns
    -------
    float
        the effective number of disks

    Examples
    --------
    >>> thermodynamics.free_disks(run)
    63.0
    """
    return float(run.n_disks - comoving(run).sum() / 2)


def drift(run: Run) -> np.ndarray:
    """Return the velocity (2,) of the centre of mass, or 0 along axes where it is not conserved."""
    centre = np.average(run.velocity[0], axis=0, weights=run.mass)
    return np.where(comoving(run), centre, 0.0)


def kt_of(run: Run, energy: np.ndarray) -> np.ndarray:
    """Return kT for total kinetic energies `energy`, an array of any shape.

    The page docs/theory.md explains when to divide the energy by N and when by N - 1.
    """
    return (energy - 0.5 * run.mass.sum() * np.sum(drift(run) ** 2)) / free_disks(run)


def kt_at_start(run: Run) -> float:
    """Return kT in the first frame.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse

    Returns
    -------
    float
        kT

    Examples
    --------
    >>> thermodynamics.kt_at_start(run) > 0
    True
    """
    return float(kt_of(run, run.kinetic_energy(0).sum()))


def has_few_observables(run: Run) -> bool:
    """Return whether a run has few samples of the observables, and more frames than samples."""
    return len(run.collisions_per_disk.time) < min(run.n_frames, 2 * FEWEST)


def kt_in_time(run: Run) -> tuple[str, np.ndarray, np.ndarray]:
    """Return the source of the data, "observables" or "frames", and times and kT from this source.

    The frames are used if there are few samples of the observables and more frames.
    """
    if not has_few_observables(run):
        time, energy = run.observable("all/kinetic_energy")
        return "observables", time, kt_of(run, run.n_disks * energy)
    energy = np.array([run.kinetic_energy(k).sum() for k in range(run.n_frames)])
    return "frames", run.time, kt_of(run, energy)


def temperature(run: Run, skip: float | None = None) -> SeriesMean:
    """Estimate kT in equilibrium.

    Samples that are taken after equal numbers of collisions are more frequent while a gas is hot,
    because the collision rate is proportional to sqrt(kT).  Such samples therefore have the weight
    1 / sqrt(kT).

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse
    skip : float, optional
        duration of the equilibration, in collisions per disk [until no observable drifts]

    Returns
    -------
    SeriesMean
        kT, whose error is 0 if the kinetic energy is conserved

    Raises
    ------
    Refused
        if the run does not reach equilibrium

    Examples
    --------
    >>> thermodynamics.temperature(run).error
    0.0
    """
    if run.nature.keeps_kinetic_energy:
        return SeriesMean(kt_at_start(run), 0.0, np.inf, 0.0)
    start, (track, time, kt) = start_of_equilibrium(run, skip), kt_in_time(run)
    kt, time = kt[time >= start], time[time >= start]
    by_time = (run.parameter("output", f"{track}_{how}") for how in TIMED)
    if all(given is None for given in by_time) and "gravity" not in run.nature:
        return correlated_mean(kt**0.5, kt**-0.5)
    return correlated_mean(*between(time, kt)[::-1])


def between(time: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the durations between samples, and the integral of the value over each duration."""
    return np.diff(time), np.diff(time) * (value[1:] + value[:-1]) / 2


def mean_energy(run: Run, mass: float, skip: float | None = None) -> SeriesMean:
    """Estimate the mean kinetic energy of a disk of a given mass in equilibrium.

    The run must not have gravity.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse
    mass : float
        mass of the disk
    skip : float, optional
        duration of the equilibration, in collisions per disk [until no observable drifts]

    Returns
    -------
    SeriesMean
        mean kinetic energy, which is smaller than kT if the total momentum is conserved

    Examples
    --------
    >>> mean = thermodynamics.mean_energy(run, 1.0).mean
    >>> bool(np.isclose(mean, run.kinetic_energy(-1).mean()))
    True
    """
    bound = (run.n_disks - free_disks(run)) * mass / run.mass.sum()
    moving = 0.5 * mass * float(np.sum(drift(run) ** 2))
    return temperature(run, skip).scaled(1 - bound, moving)


# --- disks ---


def packing(run: Run) -> float:
    """Return the packing fraction: the area of the disks divided by the area of the box.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse

    Returns
    -------
    float
        packing fraction

    Examples
    --------
    >>> round(thermodynamics.packing(run), 6)
    0.3
    """
    return float(np.pi * np.sum(run.radius**2) / np.prod(run.edges))


def kinds_of_disks(run: Run) -> tuple[Species, ...]:
    """Return the species; raise an error if disks of one species differ in mass or radius."""
    for kind in run.by_species:
        if not kind.alike:
            raise Refused(f"{run.path}: the disks of '{kind.name}' differ in mass or radius")
    return run.by_species


def lightest_and_heaviest(run: Run) -> tuple[int, int]:
    """Return the indices of the species with the smallest and the largest mass."""
    masses = [kind.mass for kind in run.by_species]
    if min(masses) == max(masses):
        raise Refused(f"{run.path}: needs two species of different mass")
    return int(np.argmin(masses)), int(np.argmax(masses))


def mean_free_time(run: Run, start: float = 0.0) -> float:
    """Return the mean time between collisions of a disk with other disks.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse
    start : float
        time after which collisions are counted

    Returns
    -------
    float
        mean free time [time]

    Raises
    ------
    RunError
        if no two disks collided after `start`

    Examples
    --------
    >>> bool(thermodynamics.mean_free_time(run) < run.time[-1] / 50)
    True
    """
    first, last = run.collisions_per_disk_at(np.array([start, run.time[-1]]))
    if not last > first:
        raise Refused(f"{run.path}: has no collisions of two disks yet")
    return float((run.time[-1] - start) / (last - first))


# --- pressure and rates ---


def steps(run: Run, skip: float | None = None) -> Steps:
    """Return the changes of cumulative observables between successive samples in equilibrium."""
    time = run.collisions_per_disk.time
    first = int(np.searchsorted(time, start_of_equilibrium(run, skip)))
    if len(time) - first <= FEWEST:
        raise RunError(
            f"{run.path}: has {len(time) - first} samples of the observables in equilibrium, too "
            "few for an error; set output.observables_every_time, or run longer"
        )
    sums = (
        run.observable(name).value[first:]
        for name in ("collisions", "virial", "side_collisions", "side_impulse")
    )
    collisions, virial, hits, impulse = (np.diff(s, axis=0) for s in sums)
    if not collisions.any():
        raise Refused(f"{run.path}: has no collisions of two disks in equilibrium")
    time = time[first:]
    if run.nature.keeps_kinetic_energy:
        kt = np.full(len(time), kt_at_start(run))
    else:
        kt = kt_of(run, run.n_disks * run.observable("all/kinetic_energy").value[first:])
    step, heat = between(time, kt)
    mean = temperature(run, skip).mean / (heat.sum() / step.sum()) * (kt[1:] + kt[:-1]) / 2
    return Steps(step, mean, collisions, virial, hits.sum(axis=1), impulse)


def over_kt(amount: np.ndarray, s: Steps, power: float) -> tuple[np.ndarray, np.ndarray]:
    """Return two series; the ratio of their means is the amount per time, divided by kT^power.

    The ratio is exact to first order in the deviations of kT from its mean.  The error of the ratio
    therefore includes the correlation between the amount and kT.
    """
    kt = float(np.average(s.kt, weights=s.time))
    return amount * kt**-power, s.time * (1 + power * (s.kt / kt - 1))


def virial_over_kt(run: Run, skip: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return two series; the ratio of their means is Z - 1, calculated from the virial."""
    s = steps(run, skip)
    return over_kt(s.virial / (2 * run.n_disks), s, 1)


def collision_rate(run: Run, skip: float | None = None) -> SeriesMean:
    """Estimate the number of pair collisions of a disk per unit of time.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse
    skip : float, optional
        duration of the equilibration, in collisions per disk [until no observable drifts]

    Returns
    -------
    SeriesMean
        collision rate [1/time]

    Raises
    ------
    Refused
        if the run does not reach equilibrium

    Examples
    --------
    >>> rate = thermodynamics.collision_rate(run)
    >>> 0 < rate.error < rate.mean
    True
    """
    s = steps(run, skip)
    return correlated_mean(s.collisions, s.time).scaled(2 / run.n_disks)


def z_virial(run: Run, skip: float | None = None) -> SeriesMean:
    """Estimate Z = P / (n kT) from the virial of the pair collisions.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse
    skip : float, optional
        duration of the equilibration, in collisions per disk [until no observable drifts]

    Returns
    -------
    SeriesMean
        Z

    Raises
    ------
    Refused
        if the run does not reach equilibrium

    Examples
    --------
    >>> z = thermodynamics.z_virial(run)
    >>> bool(abs(z.mean - hard_disks.henderson(0.3)) < 0.3)
    True
    """
    return correlated_mean(*virial_over_kt(run, skip)).scaled(1.0, 1.0)


def z_rate(run: Run, skip: float | None = None) -> SeriesMean:
    """Estimate Z = P / (n kT) from the collision rate of equal disks.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse
    skip : float, optional
        duration of the equilibration, in collisions per disk [until no observable drifts]

    Returns
    -------
    SeriesMean
        Z

    Raises
    ------
    Refused
        if the run does not reach equilibrium

    Examples
    --------
    >>> z = thermodynamics.z_rate(run)
    >>> bool(abs(z.mean - hard_disks.henderson(0.3)) < 0.3)
    True
    """
    s = steps(run, skip)
    turning = run.n_disks / 2 if run.nature & {"rough", "rotating"} else 0.0
    share = free_disks(run) + turning if run.nature.keeps_energy else MANY  # a fixed energy
    unit = hard_disks.collision_rate(2.0, 2 * run.radius[0], share, 1.0, run.mass[0])
    return correlated_mean(*over_kt(s.collisions, s, 0.5)).scaled(2 / (run.n_disks * unit), 1.0)


def z_wall(run: Run, skip: float | None = None) -> SeriesMean:
    """Estimate Z = P / (n kT) from the force of equal disks on four walls.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse
    skip : float, optional
        duration of the equilibration, in collisions per disk [until no observable drifts]

    Returns
    -------
    SeriesMean
        Z = P A / (N kT), where A is the area accessible to the centres of the disks

    Raises
    ------
    Refused
        if the run does not reach equilibrium

    Examples
    --------
    >>> z = thermodynamics.z_wall(walled_run)
    >>> bool(1 < z.mean < 4)
    True
    """
    s = steps(run, skip)
    a = run.edges - 2 * run.radius[0]
    work = s.impulse[:, :2].mean(axis=1) * a[0] + s.impulse[:, 2:].mean(axis=1) * a[1]
    return correlated_mean(*over_kt(work, s, 1)).scaled(1 / (2 * run.n_disks))


def z_ways(run: Run, skip: float | None = None) -> dict[str, SeriesMean]:
    """Estimate Z = P / (n kT) with each method that applies to a run.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse
    skip : float, optional
        duration of the equilibration, in collisions per disk [until no observable drifts]

    Returns
    -------
    dict of str to SeriesMean
        Z by name of the method: "virial", for equal disks also "rate", and "walls" if the box has
        four walls

    Raises
    ------
    Refused
        if no equation of state applies to the run

    Examples
    --------
    >>> sorted(thermodynamics.z_ways(run))
    ['rate', 'virial']
    """
    allow(run, "it has no equation of state", *FLUID)
    walled = not run.periodic.any() and np.ptp(run.radius) == 0
    ways = {"virial": z_virial} | ({} if "mixture" in run.nature else {"rate": z_rate})
    ways |= {"walls": z_wall} if walled else {}
    return {name: way(run, skip) for name, way in ways.items()}


def pressures(run: Run, skip: float | None = None) -> dict[str, SeriesMean]:
    """Estimate the pressure from the virial, and from the force on each wall of the box.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse
    skip : float, optional
        duration of the equilibration, in collisions per disk [until no observable drifts]

    Returns
    -------
    dict of str to SeriesMean
        pressures by name: "pressure_virial", "pressure_left", ... [energy/length^2]

    Raises
    ------
    Refused
        if the run does not reach equilibrium

    Examples
    --------
    >>> sorted(thermodynamics.pressures(run))
    ['pressure_virial']
    """
    s = steps(run, skip)
    inside = correlated_mean(run.n_disks * s.kt * s.time + s.virial / 2, s.time)
    found = {"pressure_virial": inside.scaled(1 / np.prod(run.edges))}
    for k, side in enumerate(SIDES):
        if not run.periodic[k // 2]:
            force = correlated_mean(s.impulse[:, k], s.time)
            found[f"pressure_{side}"] = force.scaled(1 / run.edges[1 - k // 2])
    return found


def has_log(run: Run) -> bool:
    """Return whether the output file of a run contains an event log."""
    return bool(run.parameter("output", "event_log", False))


def pair_rates(run: Run, skip: float | None = None) -> dict[str, SeriesMean]:
    """Estimate the collision rates between species from the event log.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse
    skip : float, optional
        duration of the equilibration, in collisions per disk [until no observable drifts]

    Returns
    -------
    dict of str to SeriesMean
        "w_A_B": collision rate of a disk of species A with disks of species B [1/time]

    Raises
    ------
    RunError
        if the run has no event log

    Examples
    --------
    >>> sorted(thermodynamics.pair_rates(run))
    ['w_gas_gas']
    """
    log, species = run.event_log(), run.species - 1
    cuts = np.linspace(start_of_equilibrium(run, skip), run.time[-1], FINE + 1)
    pairs = log.j > 0
    one, other = species[log.i[pairs] - 1], species[log.j[pairs] - 1]
    found = {}
    for a, first in enumerate(run.by_species):
        for b, second in enumerate(run.names):
            weight = ((one == a) & (other == b)) * 1.0 + ((one == b) & (other == a))
            counts, _ = np.histogram(log.time[pairs], cuts, weights=weight)
            rate = correlated_mean(counts, np.diff(cuts))
            found[f"w_{first.name}_{second}"] = rate.scaled(1 / first.disks.sum())
    return found


def rates(run: Run, skip: float | None = None) -> dict[str, SeriesMean]:
    """Estimate temperature, pressures and collision rates of a run in equilibrium.

    Parameters
    ----------
    run : ricochet.Run
        the run to analyse
    skip : float, optional
        duration of the equilibration, in collisions per disk [until no observable drifts]

    Returns
    -------
    dict of str to SeriesMean
        by name

    Raises
    ------
    Refused
        if the run does not reach equilibrium

    Examples
    --------
    >>> sorted(thermodynamics.rates(run))
    ['collisions_per_disk_and_time', 'kT', 'pressure_virial', 'w_gas_gas']
    """
    found = {"kT": temperature(run, skip), **pressures(run, skip)}
    found["collisions_per_disk_and_time"] = collision_rate(run, skip)
    if not run.periodic.all():
        s = steps(run, skip)
        found["side_hits_per_time"] = correlated_mean(s.hits, s.time)
    return found | (pair_rates(run, skip) if has_log(run) else {})
