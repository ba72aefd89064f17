"""Fields on a grid of cells in a steady state, and profiles between two walls.

The help of post/fields.py defines the fields. Errors, and the correction for the bias of kT, are
obtained with the jackknife over blocks of time (docs/explanation/statistics.md). In the shapes of
arrays, C is the number of cells and G the number of blocks.
"""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import scipy

from ..predictions import hard_disks
from ..reading.files import RunError, counted
from ..reading.nature import TRAITS, Refused
from ..reading.reader import SIDES, Run
from .estimates import Estimate, PseudoValues, jackknife_of_sums
from .statistics import statistical_inefficiency
from .structure import periods
from .equilibrium import after_start, comoving, free_disks, refuse_others, unforced

__all__ = [
    "Fields",
    "Fluxes",
    "fields",
    "places",
    "prediction",
]

MOST_BLOCKS = 16  # largest number of blocks per run
FEWEST_BLOCKS = 3  # fewest blocks, in all runs together, from which an error is estimated
# kT, stress and heat flux of a cell require this many disks, even if any one block is left out.
FEWEST_DISKS = 3
OSCILLATION = 0.05  # fraction of kT due to the centre of mass above which this is no thermal motion
FLOW_LEAST = -0.5  # lower bound of the correlation of the flow in neighbouring blocks
LONG = 1.5  # length of a block over the statistical inefficiency
POINTS = 1 << 16  # test points for the area that obstacles leave accessible
ACROSS = SIDES[:2], SIDES[2:]  # the two sides perpendicular to each axis
#: Properties of a run (`Run.nature`) with which Enskog's theory applies between two walls.
LAWFUL = {"walls", "thermal_walls", "unequal_temperatures", "sliding_surfaces"}
Cells = tuple[int, int]


class Fluxes(NamedTuple):
    """Momentum and energy transferred from one wall to the other, per unit of length and time."""

    pressure: Any  # of momentum along the axis; a number or an `Estimate`
    shear: Any  # of momentum along the walls; a number or an `Estimate`
    energy: Any


class Block(NamedTuple):
    """Block of time within the steady state of a run."""

    run: Run
    frames: list[int]
    end: float

    @property
    def start(self) -> float:
        """Time of the first frame of the block."""
        return float(self.run.time[self.frames[0]])


# --- blocks of time ---


def steady_frames(run: Run, skip: float | None) -> list[int]:
    """Return the frames after `skip` collisions per disk, or the second half of the run."""
    moves_away = any(one.get("motion") in {"piston", "constant_velocity"} for one in run.sides)
    # If a side starts to move during the run, only the second half is steady.
    if moves_away or run.piston_positions:
        why = "has a side that moves away from its position (motion); fields require fixed cells"
        raise Refused(f"{run.path}: {why}")
    start = run.time[-1] / 2 if skip is None else after_start(run, skip)
    frames = np.flatnonzero(run.time >= start).tolist()
    if len(frames) < FEWEST_BLOCKS:
        few = f"has {counted(len(frames), 'frame')} in the steady state"
        raise RunError(f"{run.path}: {few}; at least {FEWEST_BLOCKS} are required")
    return frames


def own_motion(run: Run, frames: list[int]) -> np.ndarray:
    """Return velocities (F, N, 2) relative to the shear flow and a noise-driven centre of mass."""
    v = run.velocity[frames]
    if run.shear_rate:
        height = run.position[frames][..., 1] - run.lower[1]
        v[..., 0] -= run.shear_rate * (height - run.edges[1] / 2)
    if "random_walk" in run.nature:
        v -= (unforced(run) * np.average(v, axis=1, weights=run.mass))[:, None]
    return v


def oscillation_notes(runs: list[Run], skip: float | None, species: str | None) -> list[str]:
    """Return a note for each run in which an oscillating flow raises the measured temperature.

    The centre of mass of N independent disks has 1/N of their kinetic energy; a larger fraction
    indicates a flow.
    """
    notes = []
    for run in runs:
        frames = steady_frames(run, skip)
        own = run.species > 0 if species is None else run.of_species(species)
        v, mass = own_motion(run, frames)[:, own], run.mass[own]
        mean = np.average(v, axis=1, weights=mass)
        scatter = np.average(np.mean((v - mean.mean(axis=0)) ** 2, axis=0), axis=0, weights=mass)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.nan_to_num(mean.var(axis=0) / scatter)
        for axis in np.flatnonzero(share > OSCILLATION + FEWEST_DISKS / own.sum()).tolist():
            notes.append(
                f"{run.label}: kT_{'xy'[axis]} contains a flow that varies with time; the "
                f"motion of the centre of mass is {100 * share[axis]:.0f} % of kT_{'xy'[axis]}"
            )
    return notes


def longest_memory(run: Run, frames: list[int], cells: Cells) -> float:
    """Return the largest statistical inefficiency [frames] of slowly varying quantities.

    These are the total mass, momentum and energy, and the Fourier components of their densities
    with the longest wavelength.
    """
    place, v = (run.position[frames] - run.lower) / run.edges, own_motion(run, frames)
    waves, found = [np.ones(place.shape[:2])], 1.0
    for axis in np.flatnonzero(np.array(cells) > 1):
        angle = np.pi * (1 + run.periodic[axis]) * place[..., axis]
        waves += [np.cos(angle), np.sin(angle)][: 1 + run.periodic[axis]]
    for wave in waves:
        for amount in (1.0, v[..., 0], v[..., 1], np.sum(v**2, axis=-1)):
            parts = run.mass * amount * wave
            series = parts.sum(axis=1)
            if np.ptp(series) > 1e-9 * np.mean(np.abs(parts).sum(axis=1)):  # otherwise conserved
                found = max(found, statistical_inefficiency(series))
    return found


def blocks_of(runs: list[Run], skip: float | None, cells: Cells) -> tuple[list[Block], float]:
    """Return the blocks of time of all runs, and an upper bound of the correlation of neighbours.

    The bound assumes an exponential autocorrelation function. It is NaN if there are too few blocks
    to estimate errors.
    """
    refuse_others(runs)
    steady = [steady_frames(run, skip) for run in runs]
    both = list(zip(runs, steady, strict=True))
    length = np.array([len(f) / longest_memory(run, f, cells) for run, f in both])
    counts = np.clip((length / LONG).astype(int), 1, MOST_BLOCKS)
    blocks, size = [], int(counts.sum())
    for (run, frames), count in zip(both, counts, strict=True):
        parts = np.array_split(frames, count if size >= FEWEST_BLOCKS else FEWEST_BLOCKS)
        ends = [*(part[0] for part in parts[1:]), frames[-1]]
        blocks += [Block(run, list(p), run.time[end]) for p, end in zip(parts, ends, strict=True)]
    if size < FEWEST_BLOCKS:
        return blocks, np.nan
    t = 2 * length / counts  # in units of the decay time of the autocorrelation
    alike = np.expm1(-t) ** 2 / (t + np.expm1(-t))
    return blocks, float(np.sum(alike * (counts - 1)) / size)


def block_correlation(
    members: PseudoValues, blocks: list[Block], most: float, least: np.ndarray
) -> np.ndarray:
    """Return the correlation (F,) of neighbouring blocks of time for F fields (G, F, C).

    It is twice the sum of products of the deviations of neighbouring blocks, divided by the sum of
    squared deviations, over all cells. It is limited to the range from `least` (F,) to `most`.
    """
    size, same = len(blocks), [a.run is b.run for a, b in pairwise(blocks)]
    rest = np.nan_to_num(members.rests())
    square = np.maximum(np.sum(rest**2, axis=(0, 2)), np.finfo(float).tiny)
    product = np.sum((rest[1:] * rest[:-1])[same], axis=(0, 2)) / square
    unbiased = product * (size - 1) / size + sum(same) / size**2  # relative to their own mean
    return np.clip(2 * unbiased, least, most) + 0 * most


# --- cells ---


def reach(run: Run, cells: Cells, axis: int, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return both ends of the range that disk centres can reach in each cell along an axis."""
    gap = 0 if run.periodic[axis] else radius
    sides = np.linspace(0, run.edges[axis], cells[axis] + 1)
    sides = run.lower[axis] + sides.clip(gap, run.edges[axis] - gap)
    return sides[:-1], sides[1:]


def places(run: Run, cells: Cells) -> np.ndarray:
    """Return the midpoint of the part of each cell that disk centres can reach.

    Parameters
    ----------
    run : ricochet.Run
        any run
    cells : tuple of int
        numbers of cells along x and y

    Returns
    -------
    numpy.ndarray
        (C, 2) midpoints [length], with x varying fastest

    Examples
    --------
    >>> fields.places(run, (2, 1)).shape
    (2, 2)
    """
    ranges = (np.mean(reach(run, cells, k, run.radius.min()), axis=0) for k in (0, 1))
    return np.stack([part.ravel() for part in np.meshgrid(*ranges)], axis=1)


def accessible(run: Run, cells: Cells, radius: float) -> np.ndarray:
    """Return the area (C,) of each cell that the centres of disks with a given radius can reach.

    Near obstacles its error is at most 0.5 % of the area of a cell.
    """
    spans, inner = [], []
    step = np.sqrt(run.edges.prod() / POINTS)
    for k in (0, 1):
        start, end = reach(run, cells, k, radius)
        fine = np.arange(0.5, run.edges[k] / cells[k] / step + 0.5)
        spans.append(end - start)
        inner.append(start[:, None] + np.outer(end - start, fine / len(fine)))
    area = np.outer(spans[1], spans[0])
    if not run.obstacles and not len(run.walls):
        return area.ravel()
    x, y = np.broadcast_arrays(inner[0][None, :, None, :], inner[1][:, None, :, None])
    points, free = np.stack([x, y], axis=-1), np.ones(x.shape, dtype=bool)
    for shift in periods(run):
        for circle in run.obstacles:
            away = np.linalg.norm(points - circle.centre - shift, axis=-1)
            if circle.is_arc:
                free &= circle.distance(points - shift) > radius
            elif not circle.inside:
                free &= away > circle.radius + radius
            elif not shift.any():
                free &= away < circle.radius - radius
        for start, end in run.walls + shift:
            along = np.clip((points - start) @ (end - start) / np.sum((end - start) ** 2), 0, 1)
            near = start + along[..., None] * (end - start)
            free &= np.linalg.norm(points - near, axis=-1) > radius
    return (area * free.mean(axis=(2, 3))).ravel()


# --- fields ---


def sums(block: Block, cells: Cells, areas: list[np.ndarray], own: np.ndarray) -> np.ndarray:
    """Return 12 sums for each cell (12, C), over the frames of a block and the disks `own` (N,).

    They are the number of frames, the number of disks, disks per area, and the sums of m, m v, m v
    v (xx, xy, yy), m v^2 v / 2 and I omega^2, with v from `own_motion`.
    """
    run, frames, _ = block
    place = run.position[frames][:, own].reshape(-1, 2) - run.lower
    cell = np.clip((place / run.edges * cells).astype(int), 0, np.array(cells) - 1) @ (1, cells[0])
    mass, count = np.tile(run.mass[own], len(frames)), int(np.prod(cells))
    x, y = own_motion(run, frames)[:, own].reshape(-1, 2).T
    square = mass * (x**2 + y**2) / 2
    area = np.array(areas)[np.tile(run.species[own] - 1, len(frames)), cell]
    dense = 1 / np.where(area > 0, area, run.edges.prod() / np.prod(cells))  # outside a moving side
    carried = [mass * x, mass * y, mass * x * x, mass * x * y, mass * y * y, square * x, square * y]
    turning = 0 * mass
    if "angular_velocity" in run.disk_data:
        turning = (run.inertia * run.angular_velocity[frames] ** 2)[:, own].ravel()
    each = [None, dense, mass, *carried, turning]
    rows = [np.bincount(cell, values, minlength=count) for values in each]
    return np.stack([np.full(count, float(len(frames))), *rows])


NAMES = (
    *("density", "flow_x", "flow_y", "temperature", "kT_x", "kT_y", "rotational_temperature"),
    *("stress_xx", "stress_xy", "stress_yy", "heat_x", "heat_y"),
)
#: Lower bounds of the correlation of neighbouring blocks. The flow is the time derivative of a
#: bounded displacement, so that neighbouring blocks are anticorrelated.
LEAST = np.array([FLOW_LEAST if name.startswith("flow") else 0.0 for name in NAMES])
BY_FRAMES = np.array([name.startswith(("density", "stress", "heat")) for name in NAMES])


def of_sums(total: np.ndarray, run: Run, cells: Cells) -> np.ndarray:
    """Return the fields (12, C) calculated from `sums`; NaN in cells without disks.

    kT, stress and heat flux are NaN in cells with fewer than `FEWEST_DISKS` disks. A flow with the
    gradient g varies by g h across a cell of width h. This variation adds m (g h)^2 / 12 per disk
    to the sum of m v v. This contribution is subtracted.
    """
    frames, n, dense, mass, mx, my, xx, xy, yy, qx, qy, turning = total
    u, v, density = mx / mass, my / mass, dense / frames
    n = np.where(n < FEWEST_DISKS, np.nan, n)
    heat_x = qx - u * (xx + yy) / 2 - u * xx - v * xy + u * (u**2 + v**2) * mass
    heat_y = qy - v * (xx + yy) / 2 - u * xy - v * yy + v * (u**2 + v**2) * mass
    stress = [xx - mass * u * u, xy - mass * u * v, yy - mass * v * v]
    for axis in np.flatnonzero(np.array(cells) > 1).tolist():
        start, end = reach(run, cells, axis, run.radius.min())
        shape = (-1, 1) if axis else (1, -1)
        slopes = (
            np.gradient(w.reshape(cells[::-1]), (start + end) / 2, axis=1 - axis) for w in (u, v)
        )
        du, dv = (np.nan_to_num(slope * (end - start).reshape(shape)).ravel() for slope in slopes)
        stress = [
            s - mass * one / 12 for s, one in zip(stress, (du * du, du * dv, dv * dv), strict=True)
        ]
    kt_x, kt_y = stress[0] / n, stress[2] / n
    u = u + run.shear_rate * (places(run, cells)[:, 1] - run.lower[1] - run.edges[1] / 2)
    carried = [density * one / n for one in (*stress, heat_x, heat_y)]
    return np.stack([density, u, v, (kt_x + kt_y) / 2, kt_x, kt_y, turning / n, *carried])


class Fields(NamedTuple):
    """Fields measured in cells, averaged over runs of one input."""

    found: dict[str, Estimate]  # (C,) by name of the field
    values: dict[str, np.ndarray]  # (G, C) pseudo-values of the blocks
    disks: np.ndarray  # (C,) disks counted in each cell
    blocks: list[Block]
    correlation: dict[str, float]  # of neighbouring blocks, by name; NaN without errors


def fields(runs: list[Run], skip: float | None, cells: Cells, species: str | None = None) -> Fields:
    """Measure density, flow velocity, temperature, stress and heat flux in a steady state.

    Parameters
    ----------
    runs : list of Run
        (R,) runs of one input that differ only in their seed
    skip : float, optional
        collisions per disk discarded as equilibration [the first half of each run]
    cells : tuple of int
        numbers of cells along x and y
    species : str, optional
        species to measure, with kT relative to its own flow velocity [all disks]

    Returns
    -------
    Fields
        fields with errors; NaN in cells that contain disks in fewer than two blocks of time

    Raises
    ------
    RunError
        if a run has too few frames, or if a side moves away from its initial position

    Examples
    --------
    >>> density = fields.fields(runs, None, (2, 2)).found["density"]
    >>> bool(abs(density.mean.mean() / 64 - 1) < 0.1)
    True
    """
    blocks, most = blocks_of(runs, skip, cells)
    run = runs[0]
    areas = [accessible(run, cells, kind.radius) for kind in run.by_species]
    own = run.species > 0 if species is None else run.of_species(species)
    parts = np.stack([sums(block, cells, areas, own) for block in blocks])
    weights = parts[:, np.where(BY_FRAMES, 0, 1)]
    values, share = jackknife_of_sums(lambda total: of_sums(total, run, cells), parts, weights)
    # If the total momentum is conserved, the thermal energy of N disks is less than N kT
    # (docs/explanation/laws.md). The temperature is therefore multiplied by the ratio of N to the
    # effective number of disks.
    values[:, NAMES.index("temperature")] *= run.n_disks / free_disks(run)
    for axis, name in enumerate(("kT_x", "kT_y")):
        values[:, NAMES.index(name)] *= run.n_disks / (run.n_disks - comoving(run)[axis])
    members = PseudoValues(values, share)
    near = block_correlation(members, blocks, most, LEAST)
    mean, error = members.estimate(near[:, None])
    frames, disks = parts[:, :2].sum(axis=0)
    room = np.max(areas, axis=0)
    unseen = (disks == 0) & (room > 0)  # an error requires disks in at least two blocks
    error[0, unseen] += 1 / (frames * room)[unseen]
    turns = "angular_velocity" in run.disk_data
    names = {n: k for k, n in enumerate(NAMES) if turns or n != "rotational_temperature"}
    return Fields(
        {name: Estimate(mean[k], error[k]) for name, k in names.items()},
        {name: values[:, k] for name, k in names.items()},
        disks,
        blocks,
        dict(zip(NAMES, near, strict=True)),
    )


# --- profiles between two walls ---


def gained(block: Block, name: str) -> np.ndarray:
    """Return the increase of a cumulative observable during a block of time."""
    time, value = block.run.observable(name)
    if len(time) < 2:
        raise RunError(f"{block.run.path}: too few observables in the steady state")
    ends = (block.start, block.end)
    return np.array([np.interp(ends, time, part) @ (-1, 1) for part in np.atleast_2d(value.T)])


def fluxes(blocks: list[Block], axis: int) -> PseudoValues:
    """Return the fluxes (G, 3) from the momentum and energy transferred to both walls."""
    run, (near, far) = blocks[0].run, ACROSS[axis]
    length = 2 * run.edges[1 - axis]
    parts = []
    for block in blocks:
        impulse = gained(block, f"sides/{far}/impulse") - gained(block, f"sides/{near}/impulse")
        energy = gained(block, f"sides/{near}/energy_to_disks") - gained(
            block, f"sides/{far}/energy_to_disks"
        )
        parts.append([impulse[axis], impulse[1 - axis], *energy, block.end - block.start])
    sums = np.array(parts)
    return jackknife_of_sums(lambda total: total[:3] / total[3] / length, sums, sums[:, 3:])


def expected(
    run: Run, axis: int, x: np.ndarray, flux: Fluxes, middle: tuple[float, float]
) -> np.ndarray:
    """Predict flow velocity, kT and density at x (P, 3) from flow velocity and kT at mid-channel.

    At uniform pressure, the equations du/dx = -shear / viscosity and dT/dx = -(energy - shear u) /
    conductivity are integrated with the given fluxes. ValueError is raised if the temperature
    becomes negative or the density exceeds close packing.
    """
    diameter, mass = 2 * run.radius[0], run.mass[0]
    per_disk = np.pi * diameter**2 / 4

    def packing(kt: float) -> float:
        def excess(eta: float) -> float:
            return eta / per_disk * kt * hard_disks.henderson(eta) - flux.pressure

        return scipy.optimize.brentq(excess, 1e-9, 0.9)

    def slope(_: float, state: np.ndarray) -> tuple[float, float]:
        u, kt = state[0], max(state[1], 1e-6)
        eta = packing(kt)
        gas = hard_disks.enskog(hard_disks.henderson(eta), eta, diameter, kt, mass)
        heat = flux.energy - flux.shear * u
        return -flux.shear / gas["viscosity"], -heat / gas["conductivity"]

    centre = run.lower[axis] + run.edges[axis] / 2
    rows = np.empty((len(x), 3))
    for side in (x < centre, x >= centre):
        order = np.argsort(np.abs(x[side] - centre))
        if not len(order):
            continue
        places = x[side][order]
        found = scipy.integrate.solve_ivp(
            slope, (centre, places[-1]), middle, t_eval=places, rtol=1e-6
        ).y.T
        states = np.array([(u, kt, packing(kt) / per_disk) for u, kt in found])
        rows[np.flatnonzero(side)[order]] = states
    return rows


def has_theory(runs: list[Run], axis: int) -> bool:
    """Return whether Enskog's theory applies: two opposite walls, equal smooth elastic disks."""
    return not any(no_theory(run, axis) for run in runs)


def no_theory(run: Run, axis: int) -> str:
    """Return why Enskog's theory between two walls does not apply to a run, or "" if it does."""
    if strange := [text for trait, text in TRAITS.items() if trait in run.nature - LAWFUL]:
        return strange[0]
    if run.periodic[axis]:
        return f"has no walls across {'xy'[axis]}"
    return "" if run.periodic[1 - axis] else f"also has walls across {'yx'[axis]}"


def prediction(
    measured: Fields, axis: int, x: np.ndarray
) -> tuple[dict[str, Estimate] | None, Fluxes]:
    """Predict the profiles between two walls with Enskog's theory, given the measured fluxes.

    Parameters
    ----------
    measured : ricochet.fields.Fields
        fields in a row of cells along the axis
    axis : int
        axis perpendicular to the walls: 0 for x, 1 for y
    x : numpy.ndarray
        (P,) positions along the axis [length]

    Returns
    -------
    profiles : dict of str to Estimate or None
        (P,) "flow", "temperature" and "density"; None if no gas can carry the measured fluxes
    fluxes : ricochet.fields.Fluxes
        pressure, shear stress and heat flux at the walls

    Raises
    ------
    RunError
        if too few disks are midway between the walls

    Examples
    --------
    >>> across = fields.fields(heated_runs, None, (8, 1))
    >>> profiles, fluxes = fields.prediction(across, 0, np.array([0.3, 0.5, 0.7]))
    >>> profiles["temperature"].mean.shape, bool(fluxes.pressure.mean > 0)
    ((3,), True)
    """
    run, size = measured.blocks[0].run, len(measured.disks)
    cells = slice(size // 2 - 1, size // 2 + 1 + size % 2)
    names = (f"flow_{'yx'[axis]}", "temperature")
    weight = measured.disks[cells] / measured.disks[cells].sum()
    middle = np.stack([measured.values[name][:, cells] @ weight for name in names], axis=1)
    if not np.all(np.isfinite(middle)):
        raise RunError(f"{run.path}: too few disks in the middle; use fewer --cells")
    flux = fluxes(measured.blocks, axis)
    share = flux.share[:, :1]
    given = PseudoValues(np.hstack([flux.values, middle]), np.tile(share, 5))
    near = [measured.correlation[name] for name in names]
    mean, error = given.estimate(np.array([0 * near[0]] * 3 + near))
    rest = given.rests()
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.sqrt(np.sum(rest**2, axis=0))
        together = np.nan_to_num(rest.T @ rest / np.outer(size, size))

    def law(values: np.ndarray) -> np.ndarray:
        return expected(run, axis, x, Fluxes(*values[:3]), tuple(values[3:]))

    found = Fluxes(*map(Estimate, mean[:3], error[:3]))
    steps = np.diag(np.where(error > 0, error, 0))
    try:
        rows, slopes = law(mean), np.array([law(mean + e) - law(mean - e) for e in steps]) / 2
    except ValueError:
        return None, found
    bands = np.sqrt(np.einsum("kcf,kl,lcf->cf", slopes, together, slopes).clip(0))
    bands += 0 * near[0]
    columns = zip(("flow", "temperature", "density"), rows.T, bands.T, strict=True)
    return {name: Estimate(*both) for name, *both in columns}, found
