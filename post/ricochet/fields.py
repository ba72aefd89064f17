"""Fields of a run in its steady state, in the cells of a grid, and the profiles between two walls.

What the fields are is in fields.py.
"""

from typing import NamedTuple

import numpy as np
import scipy

from . import hard_disks
from .reader import Run, RunError
from .statistics import Estimate, estimate
from .thermodynamics import after_start, equal_disks

BLOCKS = 10


class Fluxes(NamedTuple):
    """What passes from one wall to the opposite one, per length and time."""

    pressure: float  # momentum along the axis
    shear: float  # momentum along the walls
    energy: float


def steady_frames(run: Run, skip: float | None) -> list[int]:
    """Frames after `skip` collisions per disk, else those of the second half."""
    start = run.time[-1] / 2 if skip is None else after_start(run, skip)
    frames = np.flatnonzero(run.time >= start).tolist()
    if len(frames) < 2:
        raise RunError(f"{run.path}: has {len(frames)} frames in the steady state; it takes two")
    return frames


def fields(run: Run, frames: list[int], cells: tuple[int, int]) -> dict[str, np.ndarray]:
    """Means over some frames in each cell of a grid, by name, (nx * ny,) each; NaN if empty."""
    size = np.array(cells)
    place = np.floor((run.position[frames] - run.lower) / run.edges * size).astype(int)
    place = np.clip(place, 0, size - 1)
    cell = (place[..., 0] + size[0] * place[..., 1]).ravel()
    v = run.velocity[frames].reshape(-1, 2)
    mass = np.tile(run.mass, len(frames))

    def total(weight: np.ndarray | None = None) -> np.ndarray:
        return np.bincount(cell, weight, minlength=size.prod())

    with np.errstate(divide="ignore", invalid="ignore"):
        number, u = total(), np.stack([total(mass * part) for part in v.T]) / total(mass)
        c = v - u.T[cell]
        square = mass * np.sum(c**2, axis=1) / 2
        found = {"flow_x": u[0], "flow_y": u[1], "temperature": total(square) / number}
        if "angular_velocity" in run.elements:
            turning = run.inertia * run.angular_velocity[frames] ** 2
            found["rotational_temperature"] = total(turning.ravel()) / number
    area = len(frames) * run.edges.prod() / size.prod()
    products = {"xx": (0, 0), "xy": (0, 1), "yy": (1, 1)}
    stress = {f"stress_{ab}": mass * c[:, a] * c[:, b] for ab, (a, b) in products.items()}
    heat = {"heat_x": square * c[:, 0], "heat_y": square * c[:, 1]}
    carried = {name: total(values) / area for name, values in (stress | heat).items()}
    return {"density": number / area, **found, **carried}


def estimates(runs: list[Run], skip: float | None, cells: tuple[int, int]) -> dict[str, Estimate]:
    """Means and errors over blocks of time of all runs; NaN in cells that are mostly empty."""
    blocks = [
        fields(run, list(part), cells)
        for run in runs
        for frames in [steady_frames(run, skip)]
        for part in np.array_split(frames, min(BLOCKS, len(frames)))
    ]
    found = {}
    for name in blocks[0]:
        cells_in_time = np.array([block[name] for block in blocks]).T
        known = (cell[~np.isnan(cell)] for cell in cells_in_time)  # the blocks with disks in it
        means = [estimate(one) if len(one) > 1 else (np.nan, np.nan) for one in known]
        found[name] = Estimate(*np.transpose(means))
    return found


def growth(run: Run, name: str, start: float) -> np.ndarray:
    """How much a sum over collisions has grown per time since `start`."""
    time, value = run.observable(name)
    first = int(np.searchsorted(time, start))
    if first > len(time) - 2:
        raise RunError(f"{run.path}: too few observables in the steady state")
    return (value[-1] - value[first]) / (time[-1] - time[first])


def fluxes(run: Run, axis: int, start: float) -> Fluxes:
    """From what both walls have received."""
    names = (("left", "right"), ("bottom", "top"))[axis]
    length = 2 * run.edges[1 - axis]
    near, far = (growth(run, f"sides/{name}/impulse", start) for name in names)
    gained = [growth(run, f"sides/{name}/energy", start) for name in names]
    momentum = (far - near) / length
    return Fluxes(momentum[axis], momentum[1 - axis], (gained[0] - gained[1]) / length)


def expected(run: Run, axis: int, x: np.ndarray, flux: Fluxes, middle: tuple[float, float]):
    """(C, 3) flow along the walls, kT and n at the places x, from those in the middle on.

    Pressure is the same everywhere; dT/dx = -(energy - shear u) / conductivity, du/dx = -shear /
    viscosity.
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
        state_of_gas = (hard_disks.henderson(eta), eta, diameter, kt, mass)
        density = mass * eta / per_disk
        viscosity = density * hard_disks.enskog_viscosity(*state_of_gas)
        conductivity = hard_disks.enskog_conductivity(*state_of_gas)
        return -flux.shear / viscosity, -(flux.energy - flux.shear * u) / conductivity

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
    """Whether there are two walls and between them nothing but equal disks, smooth and elastic."""
    return all(
        not run.periodic[axis]
        and run.periodic[1 - axis]
        and equal_disks(run)
        and run.restitution == 1
        and "angular_velocity" not in run.elements
        and not run.gravity.any()
        and not run.obstacles
        and not len(run.walls)
        for run in runs
    )


def prediction(runs: list[Run], axis: int, skip: float | None, x: np.ndarray, found: dict):
    """What `expected` says of runs of one input, with the fluxes and the middle of all of them.

    None if a gas of these fluxes would have to be colder than 0, or denser than disks can be.
    Raises RunError if there are no disks in the middle.
    """
    starts = [run.time[steady_frames(run, skip)[0]] for run in runs]
    measured = [fluxes(run, axis, t) for run, t in zip(runs, starts, strict=True)]
    flux = Fluxes(*np.mean(measured, axis=0))
    along, half = f"flow_{'yx'[axis]}", len(x) // 2
    cells = slice(half - 1, half + 1 + len(x) % 2)
    middle = tuple(float(np.mean(found[name].mean[cells])) for name in (along, "temperature"))
    if not np.all(np.isfinite(middle)):
        raise RunError(f"{runs[0].path}: too few disks in the middle; take fewer --cells")
    try:
        return expected(runs[0], axis, x, flux, middle), flux
    except ValueError:  # of the search for the density
        return None, flux
