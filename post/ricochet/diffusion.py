"""How disks move: velocity autocorrelation, mean square displacement, diffusion coefficient.

Lags are numbers of frames, which must be equally far apart; `frames` are those in equilibrium.  The
integral of <v(0) v(t)> needs no sum over frames: that of v is the way x(t) - x(0), which the run
knows exactly, however far apart its frames are.
"""

import numpy as np

from . import hard_disks
from .reader import Run
from .statistics import SeriesMean, series_mean
from .thermodynamics import packing, temperature


def lags(frames: int, per_decade: int = 12) -> np.ndarray:
    """Whole numbers of frames, in logarithmic steps, up to half the run."""
    last = max(1, frames // 2)
    count = 1 + int(per_decade * np.log10(last))
    return np.unique(np.geomspace(1, last, count).round().astype(int))


def velocity_memory(run: Run, frames: slice, at: np.ndarray) -> np.ndarray:
    """Normalised velocity autocorrelation at lags in frames."""
    v = run.velocity[frames]
    return np.array([np.mean(v[k:] * v[: len(v) - k]) for k in at]) / np.mean(v**2)


def motion(run: Run, frames: slice) -> tuple[np.ndarray, np.ndarray]:
    """(T, N, 2) positions, continuous in time, and velocities, relative to the centre of mass."""
    return tuple(
        values - np.average(values, axis=1, weights=run.mass, keepdims=True)
        for values in (run.unwrapped(frames), run.velocity[frames])
    )


def displacement(run: Run, frames: slice, at: np.ndarray) -> np.ndarray:
    """Mean square displacement at lags in frames, relative to the centre of mass."""
    x, _ = motion(run, frames)
    return np.array([2 * np.mean((x[k:] - x[: len(x) - k]) ** 2) for k in at])


def integrated_memory(run: Run, frames: slice, at: np.ndarray) -> np.ndarray:
    """D(t) at lags in frames: half the integral of <v(0) v(s)> from 0 to t."""
    x, v = motion(run, frames)
    return np.array([np.mean(v[: len(v) - k] * (x[k:] - x[: len(x) - k])) for k in at])


def crossing_time(run: Run) -> float:
    """Time in which sound crosses the box, after which disks feel its size."""
    eta, mass = packing(run), run.mass.mean()
    return float(run.edges.min()) / hard_disks.speed_of_sound(eta, temperature(run), mass)


def diffusion_lag(runs: list[Run], frames: list[slice]) -> int:
    """In frames: until sound has crossed the box, or an eighth of the shortest run."""
    step = runs[0].time[1] - runs[0].time[0]
    shortest = min(f.stop - f.start for f in frames)
    return int(np.clip(crossing_time(runs[0]) / step, 2, max(2, shortest // 8)))


def diffusion(run: Run, frames: slice, lag: int) -> tuple[SeriesMean, SeriesMean]:
    """D between the lags `lag` / 2 and `lag`, from the displacements and from the velocities.

    That is the mean over these lags of d<r^2>/dt / 4, and of half the integral of <v(0) v(t)>.  One
    origin in time gives one value, so that the error knows what disks remember and share.  Between
    frames the latter is a cubic curve, whose slopes <v(0) v(t)> are known: off by 0.2 % of D at
    most, for a memory that falls exponentially, and by far less if D(t) has settled.
    """
    step, half = float(run.time[1] - run.time[0]), lag // 2
    x, v = motion(run, frames)
    origins = len(x) - lag
    near, far = (np.sum((x[k : k + origins] - x[:origins]) ** 2, axis=2) for k in (half, lag))
    spread = (far - near).mean(axis=1) / (4 * step * (lag - half))
    area = np.cumsum(x, axis=0) - x / 2 - step / 12 * v  # the integral of x over time, in steps
    mean = (area[lag : lag + origins] - area[half : half + origins]) / (lag - half)
    memory = np.sum(v[:origins] * (mean - x[:origins]), axis=2).mean(axis=1) / 2
    return series_mean(spread), series_mean(memory)
