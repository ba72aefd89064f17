"""How disks move: velocity autocorrelation, mean square displacement, diffusion coefficient.

Lags are numbers of frames, which must be equally far apart; `frames` are those in equilibrium.
"""

import numpy as np

from . import hard_disks
from .reader import Run
from .statistics import SeriesMean, series_mean
from .thermodynamics import packing, temperature


def velocity_memory(run: Run, frames: slice, at: np.ndarray) -> np.ndarray:
    """Normalised velocity autocorrelation at lags in frames."""
    v = run.velocity[frames]
    return np.array([np.mean(v[k:] * v[: len(v) - k]) for k in at]) / np.mean(v**2)


def places(run: Run, frames: slice) -> np.ndarray:
    """(T, N, 2) positions, continuous in time, relative to the centre of mass."""
    x = run.unwrapped(frames)
    return x - np.average(x, axis=1, weights=run.mass, keepdims=True)


def displacement(run: Run, frames: slice, at: np.ndarray) -> np.ndarray:
    """Mean square displacement at lags in frames, relative to the centre of mass."""
    x = places(run, frames)
    return np.array([2 * np.mean((x[k:] - x[: len(x) - k]) ** 2) for k in at])


def crossing_time(run: Run) -> float:
    """Time in which sound crosses the box, after which disks feel its size."""
    eta, mass = packing(run), run.mass.mean()
    return float(run.edges.min()) / hard_disks.speed_of_sound(eta, temperature(run), mass)


def diffusion(run: Run, frames: slice, lag: int) -> tuple[SeriesMean, SeriesMean]:
    """D between the lags `lag` / 2 and `lag`, from the displacements and from the velocities.

    That is d<r^2>/dt / 4, and half the integral of <v(0) v(t)> from 0 to each of these lags.  One
    origin in time gives one value, so that the error knows what disks remember and share.
    """
    step, half = float(run.time[1] - run.time[0]), lag // 2
    x, v = places(run, frames), run.velocity[frames]
    origins = len(x) - lag
    near, far = (np.sum((x[k : k + origins] - x[:origins]) ** 2, axis=2) for k in (half, lag))
    spread = (far - near).mean(axis=1) / (4 * step * (lag - half))
    way = np.cumsum(v, axis=0) - v / 2  # the integral of v in steps, by trapezoids
    late = np.cumsum(way, axis=0)
    mean = (late[lag : lag + origins] - late[half : half + origins]) / (lag - half)
    memory = np.sum(v[:origins] * (mean - way[:origins]), axis=2).mean(axis=1) * step / 2
    return series_mean(spread), series_mean(memory)
