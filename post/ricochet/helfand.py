"""Shear and bulk viscosity and heat conductivity of a gas in equilibrium, by Einstein and Helfand.

A Helfand moment is what momentum or energy has been carried, times the way: disks carry m v_a v_b
and (m v^2 / 2) v while they fly, and a collision hands dP_a and dE on over r = x_i - x_j.  Its mean
square grows in time as the mean square displacement does, and half of the slope is the transport
coefficient: times 1 / (A kT) for viscosities, 1 / (A kT^2) for the conductivity, A the area.  See
Helfand, Phys. Rev. 119, 1 (1960); Alder, Gass and Wainwright, J. Chem. Phys. 53, 3813 (1970).

Velocities between collisions are the first ones and all changes in the event log, and r is along
the change of momentum, one diameter long: so the moments are exact, at any time, without positions.
"""

from typing import NamedTuple

import numpy as np

from .reader import Events, Run, RunError, read_run
from .statistics import SeriesMean, series_mean
from .thermodynamics import drift, equal_disks, mean_free_time, temperature

PER_FREE_TIME = 10  # samples of the moments
#: Mean free times after which fluxes are forgotten: in a dilute gas as exp(-w t / 2.06), that of
#: heat, which lives longest; from half of this on less than 0.2 % of the conductivity is missing.
MEMORY = 20.0
CLOSE = 1e-5  # of a velocity


class Moments(NamedTuple):
    """Helfand moments at times that are equally far apart, without their mean growth."""

    step: float
    shear: np.ndarray  # (T, 2) xy and (xx - yy) / 2 of the momentum
    bulk: np.ndarray  # (T, 1) (xx + yy) / 2 of the momentum
    heat: np.ndarray  # (T, 2) x and y of the energy


def check(run: Run) -> None:
    """Refuse all but the gases that the moments are for."""
    alone = run.periodic.all() and not (run.gravity.any() or run.obstacles or len(run.walls))
    driven = run.kicked or run.shear_rate != 0 or "angular_velocity" in run.elements
    if not alone or driven or run.time_step or not equal_disks(run) or run.restitution != 1:
        raise RunError(
            f"{run.path}: transport takes equal elastic smooth disks in a periodic box, by events "
            "and at rest: no gravity, walls, shear or kicks"
        )


def log(run: Run) -> Events:
    """The events until the last frame, with changes of momentum."""
    events = read_run(run.path).events  # logs are long: the run would keep them
    if events.momentum_change is None:
        raise RunError(
            f"{run.path}: its event log has no momentum_change; set output.virial_tensor = .true."
        )
    seen = np.searchsorted(events.time, run.time[-1], "right")
    return Events(*(part[:seen] for part in events))


def velocities(run: Run, events: Events) -> tuple[np.ndarray, np.ndarray]:
    """(E, 2, 2) velocities of the disks i and j before each collision and after it.

    Raises RunError if the log does not lead from the first frame to the last.
    """
    start, end = run.velocity[[0, -1]] - drift(run)
    _, i, j, _, change = events
    disk = np.stack([i, j], axis=1).ravel() - 1
    change = np.stack([change, -change], axis=1).reshape(-1, 2) / run.mass[disk, None]
    order = np.argsort(disk, kind="stable")  # the collisions of each disk in turn
    disk, change = disk[order], change[order]
    before = np.cumsum(change, axis=0) - change
    first, last = (np.searchsorted(disk, disk, side) for side in ("left", "right"))
    before += start[disk] - before[first]
    after = before + change
    if not np.allclose(after[last - 1], end[disk], rtol=0, atol=CLOSE * np.abs(end).max()):
        raise RunError(f"{run.path}: the event log does not lead from the first frame to the last")
    back = np.empty_like(order)
    back[order] = np.arange(len(order))
    return before[back].reshape(-1, 2, 2), after[back].reshape(-1, 2, 2)


def flux(v: np.ndarray, mass: float) -> np.ndarray:
    """(..., 5) what disks with the velocities (..., 2) carry: momentum xx, xy, yy, energy x, y."""
    x, y = np.moveaxis(v, -1, 0)
    energy = mass * (x**2 + y**2) / 2
    return np.stack([mass * x * x, mass * x * y, mass * y * y, energy * x, energy * y], axis=-1)


def handed_on(run: Run, change: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """(E, 5) the same, from disk to disk in each collision."""
    way = 2 * run.radius[0] * change / np.linalg.norm(change, axis=1, keepdims=True)
    gain = run.mass[0] * np.sum(after[:, 0] ** 2 - before[:, 0] ** 2, axis=1) / 2
    products = [change[:, a] * way[:, b] for a, b in ((0, 0), (0, 1), (1, 1))]
    return np.stack([*products, gain * way[:, 0], gain * way[:, 1]], axis=1)


def moments(run: Run, start: float) -> Moments:
    """From the time `start` to the last frame, `PER_FREE_TIME` samples per mean free time."""
    check(run)
    events = log(run)
    before, after = velocities(run, events)
    mass = run.mass[0]
    carried = flux(run.velocity[0] - drift(run), mass).sum(axis=0)
    changes = (flux(after, mass) - flux(before, mass)).sum(axis=1)
    carried = carried + np.cumsum(np.vstack([np.zeros(5), changes]), axis=0)
    knots = np.concatenate([run.time[:1], events.time, run.time[-1:]])
    flown = np.cumsum(np.vstack([np.zeros(5), carried * np.diff(knots)[:, None]]), axis=0)
    handed = handed_on(run, events.momentum_change, before, after)
    handed = np.cumsum(np.vstack([np.zeros(5), handed]), axis=0)

    step = mean_free_time(run) / PER_FREE_TIME
    time = np.arange(start, run.time[-1], step)
    total = handed[np.searchsorted(events.time, time, "right")]
    total += np.stack([np.interp(time, knots, part) for part in flown.T], axis=1)
    total -= total[0] + np.linspace(0, 1, len(time))[:, None] * (total[-1] - total[0])
    xx, xy, yy, *heat = total.T
    shear = np.stack([xy, (xx - yy) / 2], axis=1)
    return Moments(step, shear, ((xx + yy) / 2)[:, None], np.stack(heat, axis=1))


def squares(moment: np.ndarray, lag: int) -> np.ndarray:
    """(T - lag,) squares of what the moment (T, C) gains in `lag` samples, mean of the components.

    The mean growth, which is that of the series itself, has taken lag / (T - 1) of them away.
    """
    gain = moment[lag:] - moment[: len(moment) - lag]
    return np.mean(gain**2, axis=1) / (1 - lag / (len(moment) - 1))


def running(moment: np.ndarray, step: float, at: np.ndarray) -> np.ndarray:
    """Half of the slope of the mean square between each of the lags (in samples) and the last."""
    mean = np.array([squares(moment, lag).mean() for lag in at])
    return np.diff(mean, prepend=0) / np.diff(at, prepend=0) / (2 * step)


def coefficient(moment: np.ndarray, step: float, lag: int) -> SeriesMean:
    """Half of the slope of the mean square between the lags `lag` / 2 and `lag`.

    One origin in time gives one value, as for the diffusion coefficient.
    """
    half = lag // 2
    near, far = squares(moment, half), squares(moment, lag)
    return series_mean((far - near[: len(far)]) / (2 * step * (lag - half)))


def units(run: Run) -> dict[str, float]:
    """What makes a transport coefficient of the slope of each moment."""
    area, kt = float(np.prod(run.edges)), temperature(run)
    return {"shear": 1 / (area * kt), "bulk": 1 / (area * kt), "heat": 1 / (area * kt**2)}
