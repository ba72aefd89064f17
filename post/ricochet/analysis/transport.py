"""Transport coefficients: viscosities, thermal conductivity and diffusion coefficients.

Viscosities and conductivity follow from Helfand moments (docs/explanation/laws.md). Rough disks are
refused, because these moments do not include the transport of rotational energy. Diffusion
coefficients follow from displacements in equally spaced frames. The integral of <v(0) v(t)> then
requires no sum over frames, because the integral of v is the displacement.
"""

from typing import NamedTuple

import numpy as np

from ..predictions import hard_disks, mixtures
from ..reading.files import RunError
from ..reading.nature import allow
from ..reading.reader import Run
from . import thermodynamics as td
from .correlations import Correlator
from .equilibrium import comoving, drift
from .estimates import Curve, estimate
from .statistics import SeriesMean, correlated_mean

__all__ = [
    "Found",
    "coefficients",
]

PER_FREE_TIME = 4  # samples of the moments per mean free time that suffice
SUMS = ("helfand_stress", "virial_tensor", "helfand_heat", "heat_virial")
# HEAT is the decay time of the heat flux in a dilute gas of equal disks, in mean free times; it is
# shorter in a denser gas. MEMORY is the lag, in mean free times, at which transport coefficients
# are evaluated. Between MEMORY / 2 and MEMORY, the slope of the mean square of a moment is on
# average less than 0.2 % below its limit at infinite lag.
HEAT, MEMORY = 2.06, 20.0
CLOSE = 1e-6  # relative difference below which steps count as equal
UNLIKE = 0.05  # largest relative difference of Enskog's viscosity between runs of one group
TAKES = (
    "transport coefficients require elastic smooth disks in a periodic box; for other disks see "
    "driven.py --show viscosity (box.shear_rate) and D(t) of correlations.py"
)
# coefficients that follow from Helfand moments
MOMENTS = ("viscosity", "bulk_viscosity", "conductivity")


def in_step(times: np.ndarray) -> bool:
    """Return whether times (at least two) are equally spaced."""
    steps = np.diff(times)
    return bool(np.ptp(steps) <= CLOSE * steps[0])


# --- diffusion ---


def lags(frames: int, per_decade: int = 12) -> np.ndarray:
    """Return logarithmically spaced lags of up to half the number of frames."""
    last = max(1, frames // 2)
    count = 1 + int(per_decade * np.log10(last))
    return np.unique(np.geomspace(1, last, count).round().astype(int))


def motion(run: Run, frames: slice) -> tuple[np.ndarray, np.ndarray]:
    """Return unwrapped positions and velocities, (T, N, 2) each.

    Along axes where the velocity of the centre of mass is conserved, both are relative to the
    centre of mass.
    """
    kept = comoving(run)
    place, velocity = (
        values - kept * np.average(values, axis=1, weights=run.mass, keepdims=True)
        for values in (run.unwrapped(frames), run.velocity[frames])
    )
    return place, velocity


def diffusion_lag(runs: list[Run], frames: list[slice]) -> int:
    """Return the lag, in frames, at which D is measured.

    This lag is the time in which sound crosses the box and returns from its periodic images, but
    at most 1/8 of the shortest run. At longer lags D continues to grow; see laws, "Diffusion".
    """
    run, shortest = runs[0], min(f.stop - f.start for f in frames)
    kt = td.temperature(run).mean
    sound = hard_disks.speed_of_sound(td.packing(run), kt, run.mass.mean())
    crossing = float(run.edges.min()) / sound / (run.time[1] - run.time[0])
    return int(np.clip(crossing, 2, max(2, shortest // 8)))


def diffusion(run: Run, frames: slice, lag: int, *species: str) -> list[tuple[SeriesMean, ...]]:
    """Return two estimates of the diffusion coefficient D for all disks and for each species.

    The first is a quarter of the slope of the mean square displacement between the lags `lag` / 2
    and `lag`, in frames. The second is half the integral of <v(0) v>, averaged over the same range
    of lags. Displacements between frames are interpolated by a cubic curve with known slopes. For
    an exponential decay, the interpolation changes D by at most 0.2 %. Both errors account for
    correlations between time origins.
    """
    place, velocity = motion(run, frames)
    disks = [run.mass > 0, *(run.of_species(name) for name in species)]
    step = float(run.time[1] - run.time[0])
    return [of_paths(place[:, own], velocity[:, own], step, lag) for own in disks]


def of_paths(x: np.ndarray, v: np.ndarray, step: float, lag: int) -> tuple[SeriesMean, ...]:
    """Return both estimates of D for disks with the given positions and velocities (T, N, 2)."""
    origins, half = len(x) - lag, lag // 2
    near, far = (np.sum((x[k : k + origins] - x[:origins]) ** 2, axis=2) for k in (half, lag))
    spread = (far - near).mean(axis=1) / (4 * step * (lag - half))
    area = np.cumsum(x, axis=0) - x / 2 - step / 12 * v  # integral of x over time, in steps
    mean = (area[lag : lag + origins] - area[half : half + origins]) / (lag - half)
    memory = np.sum(v[:origins] * (mean - x[:origins]), axis=2).mean(axis=1) / 2
    return correlated_mean(spread), correlated_mean(memory)


# --- Helfand moments ---


def moments(run: Run, start: float) -> tuple[float, dict[str, np.ndarray]]:
    """Return the sampling interval, and the Helfand moments relative to the centre of mass.

    The momentum moment has the components xy and (xx - yy) / 2 for the shear viscosity, and (xx +
    yy) / 2 for the bulk viscosity. The energy moment has the components x and y. Each moment has
    the shape (T, C), and its mean growth is subtracted. RunError is raised if no moments were
    sampled at equal intervals after `start`.
    """
    allow(run, TAKES, "mixture")
    if "helfand_heat" not in run.observables:
        raise RunError(f"{run.path}: has no Helfand moments, set output.helfand = .true.")
    parts = [run.observable(name) for name in SUMS]
    first = int(np.searchsorted(parts[0].time, start))
    time = parts[0].time[first:-1]  # the last interval may be shorter
    if len(time) < 3 or not in_step(time):
        raise RunError(
            f"{run.path}: moments require observables at equal intervals of time; set "
            f"output.observables_every_time = {td.mean_free_time(run, start) / PER_FREE_TIME:.2g}"
        )
    flown, handed, heat, heat_handed = (part.value[first:-1] for part in parts)
    momentum = (flown + handed).reshape(-1, 2, 2)
    # The energy moments are converted to the centre-of-mass frame by subtracting the velocity of
    # the centre of mass times the momentum moment. All other terms of the conversion grow linearly
    # in time and disappear when the mean growth is subtracted.
    heat = heat + heat_handed - np.einsum("a,tab->tb", drift(run), momentum)
    xx, xy, yy = momentum[:, 0, 0], momentum[:, 0, 1], momentum[:, 1, 1]
    groups = (xy, (xx - yy) / 2), ((xx + yy) / 2,), heat.T
    known = MOMENTS[: 2 if "mixture" in run.nature else 3]
    found = {name: np.stack(one, axis=1) for name, one in zip(known, groups, strict=False)}
    share = np.linspace(0, 1, len(time))[:, None]
    return float(np.diff(time).mean()), {
        name: one - one[0] - share * (one[-1] - one[0]) for name, one in found.items()
    }


def squares(moment: np.ndarray, lag: int) -> np.ndarray:
    """Return the squared change of a Helfand moment during a lag, averaged over its components.

    The moment has the shape (T, C), and the result (T - lag,). `moments` subtracts the mean growth,
    which reduces the squares on average by the fraction lag / (T - 1). The result is corrected for
    this reduction.
    """
    gain = moment[lag:] - moment[: len(moment) - lag]
    return np.mean(gain**2, axis=1) / (1 - lag / (len(moment) - 1))


def running(moment: np.ndarray, step: float, at: np.ndarray) -> np.ndarray:
    """Return half the slope of the mean squared change of a moment, between successive lags."""
    mean = np.array([squares(moment, lag).mean() for lag in at])
    return np.diff(mean, prepend=0) / np.diff(at, prepend=0) / (2 * step)


def relative_error(samples: int, lag: int) -> float:
    """Return the relative standard error of a coefficient from one component of a moment.

    If `lag` is much longer than the decay time of the fluxes, the `samples` values of the moment
    form a random walk. The coefficient is then a quadratic form of the Gaussian steps of this walk.
    The covariance of two squared increments is twice the square of the number of steps they have in
    common.
    """
    half, origins = lag // 2, samples - lag
    apart = np.arange(-lag, lag + 1)  # origin of the second increment relative to that of the first
    pairs = np.maximum(0, origins - np.abs(apart))

    def common(first: int, second: int) -> np.ndarray:
        return np.maximum(0, np.minimum(first, apart + second) - np.maximum(0, apart))

    square = common(lag, lag) ** 2 - 2 * common(lag, half) ** 2 + common(half, half) ** 2
    return float(np.sqrt(2 * np.sum(pairs * square)) / (origins * (lag - half)))


def coefficient(moment: np.ndarray, step: float, lag: int) -> SeriesMean:
    """Estimate a transport coefficient from the increments of a Helfand moment (T, C).

    It is half the slope of the mean squared increment between the lags `lag` / 2 and `lag`, with
    the error of `relative_error` for C components and the drift over the time origins.
    """
    half = lag // 2
    near, far = squares(moment, half), squares(moment, lag)
    series = (far - near[: len(far)]) / (2 * step * (lag - half))
    found = correlated_mean(series)
    error = abs(found.mean) * relative_error(len(moment), lag) / np.sqrt(moment.shape[1])
    samples = float(np.var(series)) / error**2 if error > 0 else float(len(series))
    return found._replace(error=float(error), samples=samples, freedom=np.inf)


# --- coefficients divided by Enskog's coefficients ---


class Found(NamedTuple):
    """Transport coefficient at one packing fraction, relative to Enskog's value."""

    members: list[SeriesMean]  # values measured in the runs
    curve: Curve  # as a function of the lag [mean free times]
    lag: float  # lag at which the values were measured [mean free times]
    memory: float  # lag that the decay times require [mean free times]; 0 for D
    enskog: float  # Enskog's value, in units of the mean mass, the mean diameter and kT


def enskog_of(run: Run, reduced: bool = False) -> dict[str, float]:
    """Return the transport coefficients of Enskog's theory for the disks of a run, by name.

    The energy of the run must be conserved. Disks whose diameters and masses differ by less than 1
    % count as one species. If `reduced`, the units are the mean mass, the mean diameter and kT.
    """
    eta, kt = td.packing(run), 1.0 if reduced else td.kt_at_start(run)
    z, area = hard_disks.henderson(eta), float(np.prod(run.edges))
    diameter, mass = 2 * run.radius, run.mass
    if reduced:
        area, mass = area / diameter.mean() ** 2, mass / mass.mean()
        diameter = diameter / diameter.mean()
    if "mixture" not in run.nature:
        return hard_disks.enskog(z, eta, diameter[0], kt, mass[0])
    kinds = np.round(np.log([diameter, mass]), 2)
    _, which, count = np.unique(kinds, axis=1, return_inverse=True, return_counts=True)
    diameter, mass = (np.bincount(which.ravel(), one) / count for one in (diameter, mass))
    return mixtures.enskog_mixture(z, count / area, diameter, mass, kt)


def of_moments(runs: list[Run], starts: list[float]) -> dict[str, Found]:
    """Measure viscosities and, for identical disks, the conductivity from Helfand moments."""
    each = [moments(run, start) for run, start in zip(runs, starts, strict=True)]
    theories = [enskog_of(run, reduced=True) for run in runs]
    units = [enskog_of(run) for run in runs]
    for run, own in zip(runs, theories, strict=True):
        off = own["viscosity"] / theories[0]["viscosity"] - 1
        if own.keys() != theories[0].keys() or abs(off) > UNLIKE:
            raise RunError(f"{run.path}: its disks are not those of {runs[0].path}")
    steps = [step / td.mean_free_time(run) for run, (step, _) in zip(runs, each, strict=True)]
    if np.std(steps) > 0.1 * np.mean(steps):  # hotter disks have shorter free times
        raise RunError(f"{runs[0].path}: the other runs have a different sampling interval")
    per_free_time = 1 / float(np.mean(steps))
    shortest = min(len(one["viscosity"]) for _, one in each)
    lives = units[0].get("memory", 0) / td.mean_free_time(runs[0])
    memory = MEMORY * max(1.0, lives / HEAT)
    lag = min(round(memory * per_free_time), shortest // 8)
    if lag < max(2, per_free_time):
        raise RunError(
            f"{runs[0].path}: needs more than eight collisions per disk in equilibrium, and "
            "observables more often than each tenth"
        )
    at = lags(4 * lag)  # up to twice the lag of the result
    middle = (at + np.append(0, at[:-1])) / 2 / per_free_time
    found = {}
    for name in each[0][1]:
        members, slopes = [], []
        for run, (step, one), own in zip(runs, each, units, strict=True):
            kt = td.kt_at_start(run)
            unit = float(np.prod(run.edges)) * (kt**2 if name == "conductivity" else kt)
            unit = 1 / unit / own[name]
            members.append(coefficient(one[name], step, lag).scaled(unit))
            slopes.append(running(one[name], step, at) * unit)
        curve = Curve(middle, *estimate(slopes))
        theory = float(np.mean([own[name] for own in theories]))
        found[name] = Found(members, curve, lag / per_free_time, memory, theory)
    return found


def frames_in_step(run: Run, start: float) -> slice:
    """Return the equally spaced frames in equilibrium except the last one."""
    frames = slice(int(np.searchsorted(run.time, start)), run.n_frames - 1)
    if len(run.time[frames]) < 17 or not in_step(run.time[frames]):
        raise RunError(
            f"{run.path}: D requires at least 17 equally spaced frames in equilibrium; set "
            "output.frames_every_time only"
        )
    return frames


def of_displacements(runs: list[Run], starts: list[float]) -> Found:
    """Measure the diffusion coefficient from displacements."""
    frames = [frames_in_step(run, start) for run, start in zip(runs, starts, strict=True)]
    lag = diffusion_lag(runs, frames)
    at, pairs = lags(4 * lag), list(zip(runs, frames, strict=True))
    units = [1 / enskog_of(run)["D"] for run in runs]
    each = zip(pairs, units, strict=True)
    members = [diffusion(*one, lag)[0][1].scaled(unit) for one, unit in each]
    slopes = []
    for (run, own), unit in zip(pairs, units, strict=True):
        time = run.time[own]
        known = Correlator(run, time, lags=at * (time[1] - time[0])).follow(run)
        slopes.append(known.means("diffusion") * unit)
    step = np.mean([(run.time[1] - run.time[0]) / td.mean_free_time(run) for run in runs])
    curve, theory = Curve(at * step, *estimate(slopes)), enskog_of(runs[0], reduced=True)["D"]
    return Found(members, curve, lag * step, 0.0, float(theory))


def coefficients(runs: list[Run], skip: float | None = None) -> dict[str, Found]:
    """Measure the transport coefficients of runs, relative to Enskog's values.

    Parameters
    ----------
    runs : list of Run
        (R,) runs of one system, with `output.helfand`
    skip : float, optional
        collisions per disk discarded as equilibration [until no observable drifts]

    Returns
    -------
    dict of str to Found
        "viscosity" and "bulk_viscosity"; "conductivity" for equal disks; "D" if the runs have
        frames

    Raises
    ------
    RunError
        if a run is too short, or has no Helfand moments
    Refused
        if a run has walls, or is not in equilibrium

    Examples
    --------
    >>> found = transport.coefficients(runs)
    >>> bool(0.2 < statistics.combine_runs(found["viscosity"].members).mean < 5)
    True
    """
    for run in runs:
        allow(run, TAKES, "mixture")
    starts = [td.start_of_equilibrium(run, skip) for run in runs]
    found = of_moments(runs, starts)
    if "conductivity" in found and any(run.n_frames > 2 for run in runs):
        found["D"] = of_displacements(runs, starts)
    return found
