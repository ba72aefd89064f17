"""A crater: the projectile, the bed, and the size of what the one did to the other.

The projectile is the species of that name, or else the only disk that moves at the start; the
others are the bed.
"""

from typing import Any, NamedTuple

import contourpy
import numpy as np
import scipy

from ..reading.files import RunError
from ..reading.nature import allow
from ..reading.reader import Run


class Crater(NamedTuple):
    """The size of a crater by several definitions, and how the run ended."""

    hit: int
    displaced: int
    width: float  # of the first places of the displaced disks
    depth: float
    hole_width: float
    hole_depth: float
    energy_left: float  # over the energy at the start
    time: float
    collisions: int
    side_collisions: int


#: What a run may be in which nothing but a projectile moves a bed.
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
FEW_HITS = 0.01  # of walls, per disk: up to here the box does not count


def energy_fraction(run: Run) -> float:
    """The share of the energy at which the run was to end."""
    return float(run.parameter("stop", "energy_fraction", 0.1))


def ended_by_time(run: Run, size: Crater) -> bool:
    """More energy is left than `stop.energy_fraction`."""
    return size.energy_left > energy_fraction(run) * (1 + 1e-9)


def box_takes_part(run: Run, side_collisions: float) -> bool:
    """The crater reaches the floor or the sides; `side_collisions` may be a mean over runs."""
    return side_collisions > FEW_HITS * run.n_disks


def projectile(run: Run) -> int:
    """Index of the projectile."""
    if run.n_disks < 2:
        raise RunError(f"{run.path}: holds one disk; a crater needs a projectile and a bed")
    if "projectile" in run.names:
        return int(np.flatnonzero(run.of_species("projectile"))[0])
    moving = np.flatnonzero(run.speed(0) > 0)
    if len(moving) != 1:
        raise RunError(f"{run.path}: no species 'projectile' and {len(moving)} disks that move")
    return int(moving[0])


def bed(run: Run) -> np.ndarray:
    """(N,) mask of the disks at rest at the start."""
    mask = np.ones(run.n_disks, dtype=bool)
    mask[projectile(run)] = False
    return mask


def displaced(run: Run, frame: int = -1) -> np.ndarray:
    """(N,) mask of the bed disks further than their radius from their first position."""
    return bed(run) & (run.displacement(frame) > run.radius)


def crater(run: Run) -> Crater:
    """The sizes of the crater in the last frame."""
    law = "a crater is what a projectile does to a bed that lies still without it"
    allow(run, law, *QUIET)
    if run.event_count is None:
        raise RunError(f"{run.path}: has no collisions per disk")
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
    """(P, 2) outline of the hole, the largest place where half of the bed's packing is gone.

    Empty where there is none.
    """
    x, y, before = packing_field(run, 0)
    *_, after = packing_field(run, -1)
    half = 0.5 * np.median(before[before > 0.05])
    gone = np.pad(np.minimum(before - half, half - after), 1, constant_values=-half)
    x, y = (np.concatenate([[2 * u[0] - u[1]], u, [2 * u[-1] - u[-2]]]) for u in (x, y))
    lines: list[np.ndarray] = contourpy.contour_generator(x, y, gone).lines(0.0)  # type: ignore[assignment]
    return max(lines, key=area, default=np.empty((0, 2)))


def area(ring: np.ndarray) -> float:
    """Of a closed line (P, 2)."""
    x, y = ring.T
    return abs(float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))) / 2


def packing_field(run: Run, frame: int, cells: int = 240) -> tuple[np.ndarray, ...]:
    """Area fraction smoothed over a few disks: x and y of the cells and values (y, x)."""
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
