"""Steady states, the thermal motion of disks, and kT as a function of time.

`skip` is the number of collisions per disk discarded as equilibration; None determines it from the
data.
"""

from collections.abc import Sequence

import numpy as np

from ..reading.arrays import Index, chosen
from ..reading.files import RunError
from ..reading.nature import KICKED, ROUNDING, SETTLED, Refused, allow
from ..reading.reader import Run
from ..reading.results import CHUNK
from ..running.simulation import Simulation
from .statistics import FEWEST, equilibration, statistical_inefficiency

__all__ = [
    "frames_from",
    "kt_at_start",
    "start_of_equilibrium",
    "start_of_steady_state",
]

CLEAR = 3.0  # difference of two means that counts as significant [standard deviations]
ENOUGH = 50  # independent samples that suffice to estimate the variance of a mean
SPEEDS_FORGET = 15.0  # collisions per disk after which speeds are independent of the initial ones
ALONG_WALLS = {
    "thermal_walls",
    "rough",
    "rotating",
    "inelastic",
}  # traits of walls that may change the tangential momentum


def refuse_others(runs: Sequence[Run]) -> None:
    """Raise RunError unless the runs agree in their species and in the number of disks of each."""
    for run in runs:
        if run.names != runs[0].names or not np.array_equal(run.species, runs[0].species):
            raise RunError(f"{run.path}: its disks are not those of {runs[0].path}")


def all_settle(runs: Sequence[Run]) -> bool:
    """Return whether the runs relax to equilibrium; raise an error if only some of them do."""
    settled = [run.nature.in_equilibrium for run in runs]
    if any(settled) and not all(settled):
        one, other = runs[settled.index(False)], runs[settled.index(True)]
        raise RunError(
            f"{one.path}: has no equilibrium, but {other.path} has one: draw them separately"
        )
    return all(settled)


def after_start(run: Run, skip: float | None = None) -> float:
    """Return the time at which `skip` collisions per disk have occurred.

    The default of `skip` is 15 (`SPEEDS_FORGET`), or half of the collisions per disk in a short
    run. For a run without collisions, half of its duration is returned.
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
    """Return the time after which the collision rate and the energies of the species do not drift.

    Unless `skip` is given, at least 15 collisions per disk (`SPEEDS_FORGET`) are discarded, because
    speeds relax during this time. Of a run with fewer than 30, this rule discards one half. Drifts
    are sought in the observables or, if these have few samples, in the frames.

    Parameters
    ----------
    run : ricochet.Run
        any run
    skip : float, optional
        collisions per disk discarded as equilibration [until no observable drifts]

    Returns
    -------
    float
        time at which the steady state begins

    Examples
    --------
    >>> start = equilibrium.start_of_steady_state(run)
    >>> bool(0 < start < run.time[-1])
    True
    """
    return explained_start(run, skip)[0]


def explained_start(run: Run, skip: float | None = None) -> tuple[float, str]:
    """Return the time after which a run is steady, with the reason for this choice."""
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


def relaxed_start(run: Run, skip: float | None = None) -> tuple[float, str]:
    """Return the time after which a gas has relaxed, with the reason for this choice.

    If no observable drifts significantly, only 15 collisions per disk (`SPEEDS_FORGET`) are
    discarded. A drift is significant if the mean before its end differs from the mean after it.
    `explained_start` is stricter: owing to noise, it discards on average a tenth of a run that is
    steady throughout.
    """
    start, reason = explained_start(run, skip)
    time, series = examined(run)
    early = after_start(run)
    if skip is not None or run.nature.cooling or not series or start <= early:
        return start, reason
    first = int(np.searchsorted(time[1:], early))
    ends = {name: equilibration(values) for name, values in series.items()}
    drifting = {k: end for k, end in ends.items() if has_changed(series[k], first, end)}
    if not drifting:
        return early, f"{SPEEDS_FORGET:g} collisions per disk, the relaxation time of speeds"
    slowest = max(drifting, key=drifting.__getitem__)
    return float(time[drifting[slowest]]), f"the {slowest} drifts until then"


def has_changed(values: np.ndarray, first: int, end: int) -> bool:
    """Return whether the means of values[first:end] and values[end:] differ significantly.

    The means also count as different if values[end:] has too few independent samples for a test.
    """
    before, after = values[first:end], values[end:]
    if len(before) == 0:
        return False
    per_sample = statistical_inefficiency(after)
    if len(after) / per_sample < ENOUGH:
        return True
    variance = np.var(after) * per_sample * (1 / len(before) + 1 / len(after))
    return bool((before.mean() - after.mean()) ** 2 > CLEAR**2 * variance)


def examined(run: Run) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return times (T,) and series (T - 1,) to be tested for drifts (none for too few samples)."""
    few = has_few_observables(run)
    time = run.time if few else run.collisions_per_disk.time
    if len(time) < 2 * FEWEST:
        return time, {}
    # two samples may have the same time
    apart = np.maximum(np.diff(time), 1e-9 * np.mean(np.diff(time)))
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
        any run
    skip : float, optional
        collisions per disk discarded as equilibration [until no observable drifts]

    Returns
    -------
    float
        time at which the equilibrium begins

    Raises
    ------
    Refused
        if the run does not reach equilibrium

    Examples
    --------
    >>> start = equilibrium.start_of_equilibrium(run, skip=10)
    >>> bool(run.collisions_per_disk_at(start) >= 9.9)
    True
    """
    allow(run, "it does not reach equilibrium", *SETTLED)
    return start_of_steady_state(run, skip)


def frames_from(
    run: Run, start: float, apart: float = 0.0, frames: list[int] | None = None
) -> list[int]:
    """Select frames after a given time, separated by a minimum number of collisions.

    Parameters
    ----------
    run : ricochet.Run
        any run
    start : float
        earliest time of a frame
    apart : float
        fewest collisions per disk between two selected frames
    frames : list of int, optional
        frames from which to select [all]

    Returns
    -------
    list of int
        indices of the selected frames

    Examples
    --------
    >>> some = equilibrium.frames_from(run, 0.0, apart=10)
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
    """Return the frames in the steady state except the last, which may follow after less time."""
    first = int(np.searchsorted(run.time, start_of_steady_state(run, skip)))
    if run.n_frames - 1 - first < 2:
        raise RunError(f"{run.path}: needs more frames after the start")
    return slice(first, run.n_frames - 1)


# --- thermal motion ---


def motion_notes(runs: Sequence[Run]) -> list[str]:
    """Return a note for figures if noise accelerates the centre of mass."""
    walks = any("random_walk" in run.nature for run in runs)
    note = "noise moves the centre of mass (drive.keep_momentum): motion is measured relative to it"
    return [note] * walks


def unforced(source: Run | Simulation) -> np.ndarray:
    """Return a mask (2,) of the axes along which only noise changes the total momentum.

    Tangential forces of walls (`ALONG_WALLS`) are neglected. Raise `Refused` if noise accelerates
    the centre of mass while friction at walls may decelerate it.
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


def conserved_momentum(source: Run | Simulation) -> np.ndarray:
    """Return a mask (2,) of axes along which walls do not change the momentum; noise may do so."""
    walls = "walls" in source.nature and source.nature & ALONG_WALLS
    return unforced(source) & (not walls)


def comoving(run: Run) -> np.ndarray:
    """Return a mask (2,) of the axes along which velocities are relative to the centre of mass.

    Along these axes the total momentum is conserved, or changed only by noise.
    """
    kept = unforced(run)
    if run.nature & ALONG_WALLS and "random_walk" not in run.nature:
        carried = run.mass[:, None] * run.velocity[[0, -1]]
        kept &= np.abs(np.ptp(carried.sum(axis=1), axis=0)) < ROUNDING * np.abs(carried).sum()
    return kept


def thermal_energy(run: Run, frames: Index, component: int | None = None) -> np.ndarray:
    """Return the energies m v^2 / 2 (F, N) of the thermal motion in the given frames.

    v is relative to the shear flow and, along the axes of `comoving`, to the centre of mass. If
    `component` is 0 or 1, only the x or the y component of v contributes.
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
    """Return the kinetic energy over kT: N - k / 2 if momentum is conserved along k axes."""
    return float(run.n_disks - comoving(run).sum() / 2)


def drift(run: Run) -> np.ndarray:
    """Return the velocity (2,) of the centre of mass, with 0 for components that vary in time."""
    centre = np.average(run.velocity[0], axis=0, weights=run.mass)
    return np.where(comoving(run), centre, 0.0)


def kt_of(run: Run, energy: np.ndarray) -> np.ndarray:
    """Convert total kinetic energies, an array of any shape, to kT (docs/explanation/laws.md)."""
    return (energy - 0.5 * run.mass.sum() * np.sum(drift(run) ** 2)) / free_disks(run)


def kt_at_start(run: Run) -> float:
    """Return kT in the first frame.

    Parameters
    ----------
    run : ricochet.Run
        any run

    Returns
    -------
    float
        kT [energy]

    Examples
    --------
    >>> equilibrium.kt_at_start(run) > 0
    True
    """
    return float(kt_of(run, run.kinetic_energy(0).sum()))


def has_few_observables(run: Run) -> bool:
    """Return whether a run has few samples of the observables, and fewer samples than frames."""
    return len(run.collisions_per_disk.time) < min(run.n_frames, 2 * FEWEST)


def kt_in_time(run: Run) -> tuple[str, np.ndarray, np.ndarray]:
    """Return source ("observables" or "frames"), times (T,) and values (T,) of kT."""
    if not has_few_observables(run):
        time, energy = run.observable("all/kinetic_energy")
        return "observables", time, kt_of(run, run.n_disks * energy)
    step = max(1, CHUNK // run.n_disks)
    parts = [run.kinetic_energy(slice(k, k + step)) for k in range(0, run.n_frames, step)]
    energy = np.concatenate([part.sum(axis=1) for part in parts])
    return "frames", run.time, kt_of(run, energy)
