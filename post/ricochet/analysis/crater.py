"""Impacts: identify projectile and bed, and measure the size of the crater.

The projectile is the disk of the species 'projectile' or, if there is no such species, the only
disk that moves initially. All other disks form the bed.
"""

from typing import Any, NamedTuple

import contourpy
import numpy as np
import scipy

from ..reading.files import RunError
from ..reading.nature import Refused, allow
from ..reading.reader import Run

__all__ = [
    "Crater",
    "crater",
    "hole",
    "projectile",
]


class Crater(NamedTuple):
    """Size of a crater by several definitions, and the state at the end of the run."""

    hit: int
    displaced: int
    width: float  # horizontal extent of the initial positions of the displaced disks
    depth: float
    hole_width: float
    hole_depth: float
    energy_left: float  # relative to the initial energy
    time: float
    collisions: int
    side_collisions: int


# Properties of a run (`Run.nature`) that are allowed because they do not set the bed in motion.
QUIET: tuple[str, ...]
QUIET = (
    "inelastic",
    "soft_contacts",
    "rough",
    "rotating",
    "pair_restitution",
    "mixture",
    "obstacles",
    "walls",
)
QUIET += ("time_stepped",)
FEW_HITS = 0.01  # wall collisions per disk up to which the box does not affect the crater
HIT_OVER_LEAST = 3.4  # number of disks hit, divided by M (1/f - 1) / (1 - xi^2)
# number of disks in a sufficiently large bed, divided by the number of disks hit
BED_OVER_HIT = 2.2


def energy_fraction(run: Run) -> float:
    """Return the fraction of the initial energy at which the run ends (`stop.energy_fraction`)."""
    return float(run.parameter("stop", "energy_fraction", 0.1))


def ended_by_time(run: Run, size: Crater) -> bool:
    """Return whether the run ended before its energy fell to `stop.energy_fraction`."""
    return size.energy_left > energy_fraction(run) * (1 + 1e-9)


def box_takes_part(run: Run, side_collisions: float) -> bool:
    """Return whether the sides affect the crater: with more than 0.01 side collisions per disk."""
    return side_collisions > FEW_HITS * run.n_disks


def enough_disks(mass_ratio: float, restitution: float, fraction: float) -> float:
    """Estimate the number of disks in a bed whose crater does not reach the sides of the box.

    M is the mass ratio of projectile and bed disk, xi the restitution, and f the fraction of the
    energy at which the run ends. In a large bed, about 3.4 M (1/f - 1) / (1 - xi^2) disks are hit.
    A bed with 2.2 times this number of disks is large enough. Both factors were measured in a
    square box, half filled at a packing fraction of 0.5, for M from 10 to 50, xi from 0.3 to 0.8,
    ratios of radii from 5 to 10 and f = 0.1. A projectile with 2 or 3 times the radius of a bed
    disk penetrates deeper, and a bed 1.5 times as large was sufficient in all cases. The result is
    infinite for xi = 1 or f = 0.
    """
    if restitution >= 1 or fraction <= 0:
        return float("inf")
    hit = HIT_OVER_LEAST * mass_ratio * (1 / fraction - 1) / (1 - restitution**2)
    return BED_OVER_HIT * hit


def projectile(run: Run) -> int:
    """Find the projectile of an impact.

    Parameters
    ----------
    run : ricochet.Run
        a run of an impact

    Returns
    -------
    int
        index of the projectile

    Raises
    ------
    RunError
        if no species is called 'projectile' and the number of initially moving disks is not one

    Examples
    --------
    >>> projectile(bed_run)
    60
    """
    if run.n_disks < 2:
        raise Refused(f"{run.path}: contains one disk; a crater requires a projectile and a bed")
    if "projectile" in run.names:
        return int(np.flatnonzero(run.of_species("projectile"))[0])
    moving = np.flatnonzero(run.speed(0) > 0)
    if len(moving) != 1:
        needed = "a crater requires a species 'projectile', or one moving disk among disks at rest"
        raise Refused(f"{run.path}: {needed}; here {len(moving)} disks move")
    return int(moving[0])


def bed(run: Run) -> np.ndarray:
    """Return a mask (N,) of all disks except the projectile."""
    mask = np.ones(run.n_disks, dtype=bool)
    mask[projectile(run)] = False
    return mask


def displaced(run: Run, frame: int = -1) -> np.ndarray:
    """Return a mask (N,) of the bed disks displaced by more than their own radius."""
    return bed(run) & (run.displacement(frame) > run.radius)


def crater(run: Run) -> Crater:
    """Measure the crater in the last frame of a run.

    Parameters
    ----------
    run : ricochet.Run
        a run in which a projectile hits a bed at rest

    Returns
    -------
    Crater
        size of the crater by several definitions, and the state at the end of the run

    Raises
    ------
    Refused
        if anything other than the projectile can set the bed in motion

    Examples
    --------
    >>> size = crater.crater(bed_run)
    >>> size.hit > 5, size.energy_left <= 0.1
    (True, True)
    """
    law = "a crater requires a bed that is at rest without the projectile"
    allow(run, law, *QUIET)
    if run.event_count is None:
        raise RunError(f"{run.path}: does not contain the collisions of each disk")
    moved, lying, outline = displaced(run), bed(run), hole(run)
    start = run.position[0]
    rim = np.max((start[:, 1] + run.radius)[lying])
    bottom = np.min((start[:, 1] - run.radius)[moved], initial=rim)
    return Crater(
        hit=int(np.sum(run.event_count[-1][lying] > 0)),
        displaced=int(moved.sum()),
        width=float(np.ptp(start[moved, 0])) if moved.any() else 0.0,
        depth=float(rim - bottom),
        hole_width=float(np.ptp(outline[:, 0])) if len(outline) else 0.0,
        hole_depth=float(np.ptp(outline[:, 1])) if len(outline) else 0.0,
        energy_left=float(run.kinetic_energy(-1).sum() / run.kinetic_energy(0).sum()),
        time=float(run.time[-1]),
        collisions=int(run.observable("collisions").value[-1]),
        side_collisions=int(run.observable("side_collisions").value[-1].sum()),
    )


def hole(run: Run) -> np.ndarray:
    """Return the outline of the hole that the projectile leaves in the bed.

    The hole is the largest region in which the local packing fraction is less than half of its
    initial median.

    Parameters
    ----------
    run : ricochet.Run
        a run of an impact

    Returns
    -------
    numpy.ndarray
        (P, 2) vertices of a closed line [length]; empty if the bed has no hole

    Examples
    --------
    >>> hole(bed_run).shape[1]
    2
    """
    x, y, before = packing_field(run, 0)
    *_, after = packing_field(run, -1)
    half = 0.5 * np.median(before[before > 0.05])
    gone = np.pad(np.minimum(before - half, half - after), 1, constant_values=-half)
    x, y = (np.concatenate([[2 * u[0] - u[1]], u, [2 * u[-1] - u[-2]]]) for u in (x, y))
    lines: list[np.ndarray] = contourpy.contour_generator(x, y, gone).lines(0.0)  # type: ignore[assignment]
    return max(lines, key=area, default=np.empty((0, 2)))


def area(ring: np.ndarray) -> float:
    """Return the area inside a closed line (P, 2)."""
    x, y = ring.T
    return abs(float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))) / 2


def packing_field(run: Run, frame: int, cells: int = 240) -> tuple[np.ndarray, ...]:
    """Return x and y of cell centres, and the smoothed packing fraction (y, x) of the bed."""
    here = bed(run)
    side = run.edges.max() / cells
    shape: Any = np.maximum(1, np.round(run.edges / side)).astype(int)
    limits: Any = np.stack([run.lower, run.upper], axis=1)
    disks = np.pi * run.radius[here] ** 2
    x, y = run.position[frame][here].T
    area, xs, ys = np.histogram2d(x, y, shape, limits, weights=disks)
    reach = 2.5 * np.median(run.radius[here]) / side
    smooth = scipy.ndimage.gaussian_filter(area, reach, mode="reflect")
    fraction = smooth.T / (np.diff(xs)[0] * np.diff(ys)[0])
    return (xs[1:] + xs[:-1]) / 2, (ys[1:] + ys[:-1]) / 2, fraction
