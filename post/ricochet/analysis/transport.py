"""Transport coefficients: viscosities, thermal conductivity and diffusion coefficients.

The functions for diffusion require equally spaced frames, and each lag is given as a number of
frames.  In the functions for diffusion, the argument `frames` contains the frames in equilibrium.
The integral of <v(0) v(t)> requires no sum over frames, because the integral of v is the
displacement x(t) - x(0), which is exact for any interval between frames (see `correlations`).

Viscosities and conductivity follow from Einstein-Helfand relations.  A Helfand moment is the time
integral of the total flux of momentum or energy.  In free flight, a disk contributes m v_a v_b to
the flux of momentum and (m v^2 / 2) v to the flux of energy.  A collision transfers the momentum
dP_a and the energy dE over the distance r = x_i - x_j.  Like a mean square displacement, the mean
square of a Helfand moment grows linearly in time.  Let s be the slope of the mean square as a
function of time, and A the area of the box.  The viscosities are s / (2 A kT), and the conductivity
is s / (2 A kT^2).  See Helfand, Physical Review 119, 1 (1960), and Alder, Gass and Wainwright,
Journal of Chemical Physics 53, 3813 (1970).  If `output.helfand` is true, the program accumulates
the Helfand moments exactly, and writes them as observables.

The viscosities of a mixture follow from the stress of all disks together.  The conductivity of a
mixture does not follow from the energy moment alone, because diffusing species transport their
enthalpy.  If disks dissipate energy, or if noise supplies energy, fluctuations do not determine the
transport coefficients.  In the theory of a cooling gas, the moments are correlated with other
quantities that depend on the unknown distribution of states of the gas (Baskaran, Dufty and Brey,
Physical Review E 77, 031311 (2008)).  If noise drives the disks, the fluctuation-dissipation
theorem does not hold.  An error is raised for rough disks, because the moments do not include the
rotational energy that rough disks transport.
"""

from typing import NamedTuple

import numpy as np

from ..predictions import hard_disks
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
    "enskog_of",
]

PER_FREE_TIME = 4  # sufficient number of samples of the moments
SUMS = ("helfand_stress", "virial_tensor", "helfand_heat", "heat_virial")
# HEAT is the decay time of the heat flux in a dilute gas of equal disks, in mean free times; in a
# denser gas this decay time is shorter. MEMORY is the lag, in mean free times, at which transport
# coefficients are evaluated. Between the lags MEMORY / 2 and MEMORY, the slope of the mean square
# of a moment is on average less than 0.2 % below the slope at infinite lag.
HEAT, MEMORY = 2.06, 20.0
CLOSE = 1e-6  # relative difference of steps that are regarded as equal
UNLIKE = 0.05  # largest relative difference of Enskog's viscosity between runs of one group
TAKES = (
    "transport coefficients require elastic smooth disks in a periodic box; for other disks see "
    "driven.py --show viscosity (box.shear_rate) and D(t) of correlations.py"
)
MOMENTS = ("viscosity", "bulk_viscosity", "conductivity")  # coefficients from Helfand moments


def in_step(times: np.ndarray) -> bool:
    """Return whether times (at least two) are equally spaced."""
    steps = np.diff(times)
    return bool(np.ptp(steps) <= CLOSE * steps[0])


# --- diffusion ---


def lags(frames: int, per_decade: int = 12) -> np.ndarray:
    """Return logarithmically spaced lags, in numbers of frames, up to half of the run."""
    last = max(1, frames // 2)
    count = 1 + int(per_decade * np.log10(last))
    return np.unique(np.geomspace(1, last, count).round().astype(int))


def motion(run: Run, frames: slice) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (T, N, 2), which are not wrapped into the box, and velocities (T, N, 2).

    Along axes where the velocity of the centre of mass is conserved, positions and velocities are
    relative to the centre of mass.
    """
    kept = comoving(run)
    place, velocity = (
        values - kept * np.average(values, axis=1, weights=run.mass, keepdims=True)
        for values in (run.unwrapped(frames), run.velocity[frames])
    )
    return place, velocity


def diffusion_lag(runs: list[Run], frames: list[slice]) -> int:
    """Return the lag, in numbers of frames, in which sound crosses the box.

    At lags longer than the time in which sound crosses the box, the size of the box influences
    diffusion.  The returned lag is at most an eighth of the shortest run.
    """
    run, shortest = runs[0], min(f.stop - f.start for f in frames)
    kt = td.temperature(run).mean
    sound = hard_disks.speed_of_sound(td.packing(run), kt, run.mass.mean())
    crossing = float(run.edges.min()) / sound / (run.time[1] - run.time[0])
    return int(np.clip(crossing, 2, max(2, shortest // 8)))


def diffusion(run: Run, frames: slice, lag: int) -> tuple[SeriesMean, SeriesMean]:
    """Estimate the diffusion coefficient D from displacements and from velocities.

    The first estimate is a quarter of the slope d<r^2>/dt of the mean square displacement, averaged
    over the lags from `lag` / 2 to `lag`.  The second estimate is the mean of I(t) / 2 over the
    lags t from `lag` / 2 to `lag`, where I(t) is the integral of <v(0) v> from 0 to t.  For each
    estimate, every frame at which an interval of the length `lag` can start yields one value of a
    series; the error of the mean of the series includes the correlations between the values.
    Between frames, I(t) is interpolated by a cubic curve with the known slopes <v(0) v(t)>. If the
    velocity autocorrelation decays exponentially, the interpolation changes D by at most 0.2 %, and
    by far less at lags where D(t) is constant.
    """
    step, half = float(run.time[1] - run.time[0]), lag // 2
    x, v = motion(run, frames)
    origins = len(x) - lag
    near, far = (np.sum((x[k : k + origins] - x[:origins]) ** 2, axis=2) for k in (half, lag))
    spread = (far - near).mean(axis=1) / (4 * step * (lag - half))
    area = np.cumsum(x, axis=0) - x / 2 - step / 12 * v  # integral of x over time in steps
    mean = (area[lag : lag + origins] - area[half : half + origins]) / (lag - half)
    memory = np.sum(v[:origins] * (mean - x[:origins]), axis=2).mean(axis=1) / 2
    return correlated_mean(spread), correlated_mean(memory)


# --- Helfand moments ---


def moments(run: Run, start: float) -> tuple[float, dict[str, np.ndarray]]:
    """Return the sampling interval and the Helfand moments after a given time.

    The mean growth of each moment in time is subtracted, so that the first and the last value of
    the moment are 0.  The moments (T, C) for the viscosity are the momentum moments xy and (xx -
    yy) / 2, the moment for the bulk viscosity is (xx + yy) / 2, and the moments for the
    conductivity are the energy moments x and y.  All Helfand moments are relative to the centre of
    mass.  If the run contains no moments at equal intervals, RunError is raised.
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
    # To convert the energy moments to the frame of the centre of mass, the velocity of the centre
    # of mass times the momentum moment is subtracted. All other terms of the conversion grow
    # linearly in time, so that the subtraction of the mean growth removes these terms.
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
    """Return squares (T - lag,) of the increments of a moment (T, C) over `lag` samples.

    The squared increments are averaged over the C components of the moment.  The mean growth that
    is subtracted from a moment was estimated from the same series; therefore the squares are too
    small by the fraction lag / (T - 1).  The returned squares are corrected for the subtraction of
    the mean growth.
    """
    gain = moment[lag:] - moment[: len(moment) - lag]
    return np.mean(gain**2, axis=1) / (1 - lag / (len(moment) - 1))


def running(moment: np.ndarray, step: float, at: np.ndarray) -> np.ndarray:
    """Return half the slope of the mean squared increment of a moment between successive lags."""
    mean = np.array([squares(moment, lag).mean() for lag in at])
    return np.diff(mean, prepend=0) / np.diff(at, prepend=0) / (2 * step)


def relative_error(samples: int, lag: int) -> float:
    """Return the relative standard error of a coefficient that one component of a moment yields.

    The moment has `samples` values and is a random walk, because the fluxes decay in a time much
    shorter than `lag`.  The coefficient is then a quadratic form of independent Gaussian steps,
    whose variance is known: the covariance of two squared increments is twice the square of the
    number of steps that both have in common.
    """
    half, origins = lag // 2, samples - lag
    apart = np.arange(-lag, lag + 1)  # origin of the second increment minus that of the first
    pairs = np.maximum(0, origins - np.abs(apart))

    def common(first: int, second: int) -> np.ndarray:
        return np.maximum(0, np.minimum(first, apart + second) - np.maximum(0, apart))

    square = common(lag, lag) ** 2 - 2 * common(lag, half) ** 2 + common(half, half) ** 2
    return float(np.sqrt(2 * np.sum(pairs * square)) / (origins * (lag - half)))


def coefficient(moment: np.ndarray, step: float, lag: int) -> SeriesMean:
    """Estimate a transport coefficient from the increments of a Helfand moment (T, C).

    The estimate is half the slope of the mean squared increment, as a function of the lag, between
    `lag` / 2 and `lag`.  Every sample at which an interval of the length `lag` can start yields one
    value of a series.  Few of these values are independent, and their distribution is far from
    Gaussian; an error that is estimated from the series is therefore too small on average.  The
    error follows from `relative_error` instead, with C independent components.  Only the drift is
    taken from the series.
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
    """A transport coefficient at one packing fraction, divided by the value in Enskog's theory."""

    members: list[SeriesMean]  # values of the runs
    curve: Curve  # against the lag, in mean free times
    lag: float  # at which the values were measured [mean free times]
    memory: float  # lag required by the decay times; 0 for D
    enskog: float  # in units of the mean mass, the mean diameter and kT


def enskog_of(run: Run, reduced: bool = False) -> dict[str, float]:
    """Return the transport coefficients of Enskog's theory for the disks of a run.

    Disks whose diameters and masses differ by less than 1 % are treated as one species.

    Parameters
    ----------
    run : ricochet.Run
        a run that conserves its kinetic energy
    reduced : bool
        whether the units are the mean mass, the mean diameter and kT, instead of the units of the
        run

    Returns
    -------
    dict of str to float
        coefficients by name, as returned by `hard_disks.enskog` or, for a mixture, by
        `hard_disks.enskog_mixture`

    Examples
    --------
    >>> sorted(transport.enskog_of(run))
    ['D', 'bulk_viscosity', 'conductivity', 'viscosity']
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
    return hard_disks.enskog_mixture(z, count / area, diameter, mass, kt)


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
    at = lags(4 * lag)  # lags up to twice the lag of the result
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
    """Return the equally spaced frames in equilibrium, without the last frame."""
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
    members = [diffusion(*one, lag)[1].scaled(unit) for one, unit in zip(pairs, units, strict=True)]
    slopes = []
    for (run, own), unit in zip(pairs, units, strict=True):
        time = run.time[own]
        known = Correlator(run, time, lags=at * (time[1] - time[0])).follow(run)
        slopes.append(known.means("diffusion") * unit)
    step = np.mean([(run.time[1] - run.time[0]) / td.mean_free_time(run) for run in runs])
    curve, theory = Curve(at * step, *estimate(slopes)), enskog_of(runs[0], reduced=True)["D"]
    return Found(members, curve, lag * step, 0.0, float(theory))


def coefficients(runs: list[Run], skip: float | None = None) -> dict[str, Found]:
    """Measure the transport coefficients of runs, divided by the values in Enskog's theory.

    Parameters
    ----------
    runs : list of Run
        (R,) runs of one system, with `output.helfand`
    skip : float, optional
        duration of the equilibration, in collisions per disk [until no observable drifts]

    Returns
    -------
    dict of str to Found
        coefficients, with the keys "viscosity" and "bulk_viscosity", for equal disks also
        "conductivity", and "D" if the runs contain frames

    Raises
    ------
    RunError
        if a run is too short, or has no Helfand moments
    Refused
        if a run is not in equilibrium, or has walls

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
