"""Fields of a run in its steady state: density, flow, temperature, stress, heat flux.

    python post/fields.py runs/fourier/*.h5 --across x -o fourier.png --csv fourier.csv
    python post/fields.py runs/hopper.h5 --grid 16,24 -o hopper.png

Per cell, of the disks with their centres in it: number density n, flow u (mean of v by mass), kT
(mean of m (v - u)^2 / 2), kT_rot (mean of I omega^2) of disks that can turn, the stress that disks
carry (sum of m c_a c_b over the area, c = v - u) and the heat that they carry (sum of m c^2 c / 2);
what collisions hand on over the distance of two centres comes on top of both.  Frames count after
--skip, or in the second half of a run; errors are those of the means over blocks of time, and over
runs of one input.

Across equal disks between two walls, dashed: what the fluxes of momentum and energy at the walls
say by Enskog's viscosity and conductivity (Gass 1971) and the equation of state, from temperature
and flow in the middle on.  Nothing is fitted.
"""

import argparse
from contextlib import suppress
from typing import NamedTuple

from ricochet import Run, RunError, hard_disks
from ricochet.drawing import caption, draw_box, plt
from ricochet.script import command_line, launch, read_all, report
from ricochet.statistics import Estimate, estimate
from ricochet.thermodynamics import after_start, equal_disks

import numpy as np
import scipy

BLOCKS = 10
MOST_CELLS = 100_000
LAW = "Enskog, from the fluxes"
LEAST_FLOW = 0.2  # of the thermal speed: the noise of a gas at rest is not drawn larger than it is
LABELS = {
    "density": "number density n",
    "flow_x": "flow $u_x$",
    "flow_y": "flow $u_y$",
    "temperature": "kT",
    "rotational_temperature": "$kT_{rot}$",
    "stress_xx": "stress carried, xx",
    "stress_xy": "stress carried, xy",
    "stress_yy": "stress carried, yy",
    "heat_x": "heat carried along x",
    "heat_y": "heat carried along y",
}


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
    return {name: over_blocks(np.array([block[name] for block in blocks])) for name in blocks[0]}


def over_blocks(values: np.ndarray) -> Estimate:
    """Mean and error of each column of (B, C) values, over the blocks whose cell is not empty.

    Both are NaN where fewer than two blocks have disks in the cell.
    """
    columns = (column[~np.isnan(column)] for column in values.T)
    known = [estimate(column) if len(column) > 1 else (np.nan, np.nan) for column in columns]
    return Estimate(*np.transpose(known))


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
    with suppress(ValueError):  # of the search for the density
        return expected(runs[0], axis, x, flux, middle), flux
    return None, flux


def draw_profile(runs: list[Run], axis: int, x: np.ndarray, found: dict, law) -> plt.Figure:
    """Density, flow along the walls, temperatures, and what disks carry, across an axis."""
    run, flow = runs[0], f"flow_{'yx'[axis]}"
    figure, panels = plt.subplot_mosaic("AABBCC;DDDEEE", figsize=(12, 7))
    draw_fields(panels["A"], x, found, "density")
    draw_fields(panels["B"], x, found, flow)
    draw_fields(panels["C"], x, found, "temperature", "rotational_temperature")
    draw_fields(panels["D"], x, found, "stress_xx", "stress_yy", "stress_xy")
    draw_fields(panels["E"], x, found, f"heat_{'xy'[axis]}")
    low, high = panels["B"].get_ylim()
    least = LEAST_FLOW * float(np.sqrt(np.nanmax(found["temperature"].mean)))
    panels["B"].set_ylim(min(low, -least), max(high, least))
    if law is not None:
        for panel, values in zip("ABC", (law[:, 2], law[:, 0], law[:, 1]), strict=True):
            panels[panel].plot(x, values, color="black", ls="--", lw=1, label=LAW)
    for axes in panels.values():
        axes.set(xlabel=f"{'xy'[axis]} (reduced units)", xlim=(run.lower[axis], run.upper[axis]))
        if len(axes.get_legend_handles_labels()[0]) > 1:
            axes.legend()
    figure.suptitle(title_of(runs), fontsize=10)
    return figure


def draw_fields(axes: plt.Axes, x: np.ndarray, found: dict, *names: str) -> None:
    """Points with errors; cells without disks are gaps."""
    there = [name for name in names if name in found]
    for name in there:
        label = LABELS[name] if len(there) > 1 else "measured"
        axes.errorbar(x, *found[name], fmt="o", ms=3, label=label)
    what = " and ".join(dict.fromkeys(LABELS[name].partition(",")[0] for name in there))
    axes.set_ylabel(f"{what} (reduced units)")


def draw_grid(runs: list[Run], cells: tuple[int, int], found: dict) -> plt.Figure:
    """Maps of density and temperature, with the flow as arrows."""
    run = runs[0]
    figure, panels = plt.subplots(1, 2, figsize=(12, 1 + 5 * run.edges[1] / run.edges[0]))
    sides = [np.linspace(run.lower[k], run.upper[k], cells[k] + 1) for k in (0, 1)]
    middles = np.meshgrid(*((side[1:] + side[:-1]) / 2 for side in sides))
    flow = [found[name].mean.reshape(cells[::-1]) for name in ("flow_x", "flow_y")]
    for axes, name in zip(panels, ("density", "temperature"), strict=True):
        draw_box(axes, run)
        image = axes.pcolormesh(*sides, found[name].mean.reshape(cells[::-1]), zorder=0.2)
        figure.colorbar(image, ax=axes, label=LABELS[name], shrink=0.8)
        axes.quiver(*middles, *flow, color="white", width=0.004)
    figure.suptitle(title_of(runs), fontsize=10)
    return figure


def title_of(runs: list[Run]) -> str:
    """Title of the input and what else a reader must know."""
    title = str(runs[0].parameter("run", "title", ""))
    return "\n".join(filter(None, (title, caption(runs))))


def table(run: Run, cells: tuple[int, int], found: dict) -> dict[str, np.ndarray]:
    """Middles of the cells, then each field and its error."""
    steps = run.edges / cells
    ranges = (run.lower[k] + (np.arange(cells[k]) + 0.5) * steps[k] for k in (0, 1))
    x, y = (part.ravel() for part in np.meshgrid(*ranges))
    columns = {"x": x, "y": y}
    for name, (mean, error) in found.items():
        columns |= {name: mean, f"{name}_error": error}
    return columns


def grid(text: str) -> tuple[int, int]:
    """NX,NY."""
    cells = tuple(int(word) for word in text.split(","))
    if len(cells) != 2 or min(cells) < 1 or cells[0] * cells[1] > MOST_CELLS:
        raise argparse.ArgumentTypeError(f"two numbers, as 16,24, of {MOST_CELLS} cells at most")
    return cells


def profile(text: str) -> int:
    """N cells."""
    cells = int(text)
    if not 2 <= cells <= MOST_CELLS:
        raise argparse.ArgumentTypeError(f"a profile has 2 to {MOST_CELLS} cells")
    return cells


def main() -> None:
    parser = command_line(__doc__, "fields.png", skip=None)
    parser.add_argument("--across", choices=("x", "y"), default="x", help="axis of a profile [x]")
    shape = parser.add_mutually_exclusive_group()
    shape.add_argument("--cells", type=profile, default=20, metavar="N", help="of the profile [20]")
    shape.add_argument("--grid", type=grid, metavar="NX,NY", help="a map instead of a profile")
    args = parser.parse_args()
    runs = read_all(args.runs)
    axis = "xy".index(args.across)
    cells = args.grid or ((args.cells, 1) if axis == 0 else (1, args.cells))
    found = estimates(runs, args.skip, cells)
    result = table(runs[0], cells, found)
    tables, law, notes = [], None, []
    if args.grid:
        figure = draw_grid(runs, cells, found)
    else:
        x = result["xy"[axis]]
        if has_theory(runs, axis):
            law, flux = prediction(runs, axis, args.skip, x, found)
            if law is None:
                notes = ["no gas has these fluxes and this temperature in the middle: run longer"]
            else:
                result |= {"flow_expected": law[:, 0], "temperature_expected": law[:, 1]}
            tables = [[{f"{name} flux": value for name, value in flux._asdict().items()}]]
        figure = draw_profile(runs, axis, x, found, law)
        tables = [{name: v for name, v in result.items() if "stress" not in name}, *tables]
    report(args, runs, "Fields", figure, *tables, data=result, notes=notes)


if __name__ == "__main__":
    launch(main)
