"""Pressure, collision rates and temperature in equilibrium, with errors.

Three independent methods yield the pressure P: the virial of the pair collisions, the collision
rate (of equal disks), and the force on the walls. Z = P / (n kT) is the compressibility factor. For
the parameter `skip` see the module `equilibrium`.
"""

from typing import NamedTuple

import numpy as np

from ..predictions import hard_disks
from ..reading.files import RunError, counted
from ..reading.nature import Refused, allow
from ..reading.reader import SIDES, Run, Species
from .equilibrium import (
    drift,
    frames_from,
    free_disks,
    kt_at_start,
    kt_in_time,
    kt_of,
    start_of_equilibrium,
    start_of_steady_state,
)
from .statistics import FEWEST, FINE, SeriesMean, correlated_mean

__all__ = [
    "collision_rate",
    "frames_from",
    "kt_at_start",
    "mean_free_time",
    "packing",
    "rates",
    "start_of_equilibrium",
    "start_of_steady_state",
    "temperature",
    "z_ways",
]

TIMED = ("every_time", "at", "per_decade")  # schedules by time rather than by collisions
MANY = 1e8  # disks above which the effect of a fixed energy is negligible
# Properties of a run (`Run.nature`) with which an equation of state applies. A run without any of
# them consists of equal smooth disks of conserved energy in a periodic box.
FLUID = ("walls", "thermal_walls", "thermostatted", "rough", "rotating", "mixture")


class Steps(NamedTuple):
    """Changes of observables between successive samples in equilibrium."""

    time: np.ndarray  # (T,) duration
    kt: np.ndarray  # (T,) mean during the step
    collisions: np.ndarray  # (T,) number of pair collisions
    virial: np.ndarray  # (T,)
    hits: np.ndarray  # (T,) number of collisions with all sides
    impulse: np.ndarray  # (T, 4) momentum transferred to each side


# --- temperature ---


def temperature(run: Run, skip: float | None = None) -> SeriesMean:
    """Estimate kT in equilibrium.

    If samples are taken at equal numbers of collisions, they are more frequent while the gas is
    hot, because the collision rate is proportional to sqrt(kT). Such samples are weighted with 1 /
    sqrt(kT).

    Parameters
    ----------
    run : ricochet.Run
        a run in equilibrium
    skip : float, optional
        collisions per disk discarded as equilibration [until no observable drifts]

    Returns
    -------
    SeriesMean
        kT, with an error of 0 if the kinetic energy is conserved

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
    return temperature_after(run, start_of_equilibrium(run, skip))


def temperature_after(run: Run, start: float) -> SeriesMean:
    """Estimate kT from the samples after a given time if the kinetic energy fluctuates."""
    track, time, kt = kt_in_time(run)
    kt, time = kt[time >= start], time[time >= start]
    by_time = (run.parameter("output", f"{track}_{how}") for how in TIMED)
    if all(given is None for given in by_time) and "gravity" not in run.nature:
        return correlated_mean(kt**0.5, kt**-0.5)
    return correlated_mean(*between(time, kt)[::-1])


def between(time: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the intervals between samples, and the integral of `value` over each interval."""
    return np.diff(time), np.diff(time) * (value[1:] + value[:-1]) / 2


def mean_energy(run: Run, mass: float, skip: float | None = None) -> SeriesMean:
    """Estimate the mean kinetic energy of a disk of given mass in equilibrium without gravity.

    If the total momentum is conserved, this energy is smaller than kT.
    """
    bound = (run.n_disks - free_disks(run)) * mass / run.mass.sum()
    moving = 0.5 * mass * float(np.sum(drift(run) ** 2))
    return temperature(run, skip).scaled(1 - bound, moving)


# --- disks ---


def packing(run: Run) -> float:
    """Return the packing fraction, the area of the disks over the area of the box.

    Parameters
    ----------
    run : ricochet.Run
        any run

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
    """Return the species; raise Refused if disks of one species differ in mass or radius."""
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
        any run
    start : float
        time after which collisions are counted

    Returns
    -------
    float
        mean free time [time]

    Raises
    ------
    RunError
        if no pair of disks collided after `start`

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
            f"{run.path}: has {counted(len(time) - first, 'sample')} of the observables in "
            "equilibrium, too few for an error; set output.observables_every_time, or run longer"
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
    """Return two series whose means have the ratio `amount` per time and kT^power.

    To first order in the deviation of kT from its mean, the second series is kT^power. The error of
    the ratio thus includes the correlation of `amount` with kT.
    """
    kt = float(np.average(s.kt, weights=s.time))
    return amount * kt**-power, s.time * (1 + power * (s.kt / kt - 1))


def virial_over_kt(run: Run, skip: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return two series, based on the virial, such that the ratio of their means is Z - 1."""
    s = steps(run, skip)
    return over_kt(s.virial / (2 * run.n_disks), s, 1)


def collision_rate(run: Run, skip: float | None = None) -> SeriesMean:
    """Estimate the rate of pair collisions per disk.

    Parameters
    ----------
    run : ricochet.Run
        a run in equilibrium
    skip : float, optional
        collisions per disk discarded as equilibration [until no observable drifts]

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
    """Estimate Z from the virial of the pair collisions; raise Refused without equilibrium."""
    return correlated_mean(*virial_over_kt(run, skip)).scaled(1.0, 1.0)


def z_rate(run: Run, skip: float | None = None) -> SeriesMean:
    """Estimate Z from the collision rate of equal disks; raise Refused without equilibrium."""
    s = steps(run, skip)
    turning = run.n_disks / 2 if run.nature & {"rough", "rotating"} else 0.0
    # degrees of freedom that share a fixed energy
    share = free_disks(run) + turning if run.nature.keeps_energy else MANY
    unit = hard_disks.collision_rate(2.0, 2 * run.radius[0], share, 1.0, run.mass[0])
    return correlated_mean(*over_kt(s.collisions, s, 0.5)).scaled(2 / (run.n_disks * unit), 1.0)


def z_wall(run: Run, skip: float | None = None) -> SeriesMean:
    """Estimate Z = P A / (N kT) from the force of equal disks on four walls.

    A is the area that disk centres can reach. Raise `Refused` if the run does not reach
    equilibrium.
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
        a run in equilibrium
    skip : float, optional
        collisions per disk discarded as equilibration [until no observable drifts]

    Returns
    -------
    dict of str to SeriesMean
        Z by method: "virial", "rate" (for equal disks) and "walls" (in a box with four walls)

    Raises
    ------
    Refused
        if no equation of state applies to the run

    Examples
    --------
    >>> ways = thermodynamics.z_ways(run)
    >>> sorted(ways), bool(abs(ways["rate"].mean - hard_disks.henderson(0.3)) < 0.3)
    (['rate', 'virial'], True)
    """
    allow(run, "it has no equation of state", *FLUID)
    walled = not run.periodic.any() and np.ptp(run.radius) == 0
    ways = {"virial": z_virial} | ({} if "mixture" in run.nature else {"rate": z_rate})
    ways |= {"walls": z_wall} if walled else {}
    return {name: way(run, skip) for name, way in ways.items()}


def pressures(run: Run, skip: float | None = None) -> dict[str, SeriesMean]:
    """Return "pressure_virial", and the pressure on each wall as "pressure_left" and so on.

    Pressures are in energy/length^2. Raise `Refused` if the run does not reach equilibrium.
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
    """Return the rates "w_A_B" [1/time] at which a disk of A collides with B (from event logs)."""
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
        a run in equilibrium
    skip : float, optional
        collisions per disk discarded as equilibration [until no observable drifts]

    Returns
    -------
    dict of str to SeriesMean
        the quantities by name

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
