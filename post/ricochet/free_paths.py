"""Free paths of disks between their collisions, by the event log: what they are is in rates.py."""

import numpy as np
import scipy

from .nature import allow
from .reader import Run
from .statistics import Estimate, estimate
from .thermodynamics import has_log, start_of_steady_state

BINS = np.linspace(0, 6, 49)  # free paths in units of their mean
BLOCKS = 8  # of the frames of a single run
#: With which disks fly straight and at one speed, in all parts of the box alike.
STRAIGHT = {"mixture", "unlike", "lossy", "rough", "turning", "thermal", "uneven", "sliding"}


def free_paths(run: Run, skip: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Lengths of the paths that the disks of all frames are on, and the weight of each."""
    allow(run, "free paths are those of disks that fly freely in an empty box", *STRAIGHT)
    log = run.events
    disk = np.concatenate([log.i, log.j[log.j > 0]])
    time = np.concatenate([log.time, log.time[log.j > 0]])
    order = np.lexsort((time, disk))
    ends = np.cumsum(np.bincount(disk, minlength=run.count + 1))
    duration = np.full((run.frames, run.count), np.nan)
    for k in range(run.count):
        own = time[order[ends[k] : ends[k + 1]]]
        after = np.searchsorted(own, run.time, side="right")
        inside = (after > 0) & (after < len(own))
        duration[inside, k] = own[after[inside]] - own[after[inside] - 1]
    duration[run.time < start_of_steady_state(run, skip)] = np.nan
    known = duration > 0
    return (run.speed(slice(None)) * duration)[known], 1 / duration[known]


def path_density(x: np.ndarray) -> np.ndarray:
    """Density of free paths in units of the mean one, <v> / w, if collisions have no memory.

    nu(v) / w follows from the mean relative speed of a disk of speed v in a Maxwellian gas.
    """
    u = np.linspace(0, 5, 2001)[1:]  # v / sqrt(2 kT / m)
    half = u**2 / 2
    slow, fast = (scipy.special.ive(order, half) for order in (0, 1))
    nu = ((1 + u**2) * slow + u**2 * fast) / np.sqrt(2)
    rate = nu / (u * 2 / np.sqrt(np.pi))  # collisions per mean free path
    weight = 2 * u * np.exp(-(u**2)) * nu
    weight /= np.sum(weight)
    return np.array([np.sum(weight * rate * np.exp(-rate * value)) for value in x])


def mean_and_density(
    runs: list[Run], skip: float | None = None
) -> tuple[Estimate, Estimate] | None:
    """The mean free path, and the density of paths in units of it, in `BINS`; None without a log.

    Their errors are from the scatter of the runs, or of a single run's frames in blocks.
    """
    parts = [free_paths(run, skip) for run in runs if has_log(run)]
    if not parts or sum(len(path) for path, _ in parts) == 0:
        return None
    path, weight = (np.concatenate(part) for part in zip(*parts, strict=True))
    mean = float(np.average(path, weights=weight))
    if len(parts) == 1:
        parts = list(zip(np.array_split(path, BLOCKS), np.array_split(weight, BLOCKS), strict=True))

    def density(path: np.ndarray, weight: np.ndarray) -> np.ndarray:
        counts, _ = np.histogram(path / mean, BINS, weights=weight)
        return counts / (np.sum(weight) * np.diff(BINS))

    known = [part for part in parts if len(part[0]) > 0]
    means = estimate([np.average(path, weights=weight) for path, weight in known])
    shapes = estimate([density(*part) for part in known])
    return Estimate(mean, means.error), Estimate(density(path, weight), shapes.error)
