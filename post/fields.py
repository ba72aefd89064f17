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

from ricochet import Run
from ricochet.drawing import draw_box, plt, titled
from ricochet.fields import estimates, has_theory, prediction
from ricochet.script import command_line, launch, report, spread

import numpy as np

MOST_CELLS = 100_000
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
        style = {"color": "black", "ls": "--", "lw": 1, "label": "Enskog, from the fluxes"}
        for panel, column in (("A", 2), ("B", 0), ("C", 1)):
            panels[panel].plot(x, law[:, column], **style)
    for axes in panels.values():
        axes.set(xlabel=f"{'xy'[axis]} (reduced units)", xlim=(run.lower[axis], run.upper[axis]))
        if len(axes.get_legend_handles_labels()[0]) > 1:
            axes.legend()
    figure.suptitle(titled(runs))
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
    figure.suptitle(titled(runs))
    return figure


def middles(run: Run, cells: tuple[int, int]) -> dict[str, np.ndarray]:
    """Where the cells are."""
    steps = run.edges / cells
    ranges = (run.lower[k] + (np.arange(cells[k]) + 0.5) * steps[k] for k in (0, 1))
    return dict(zip("xy", (part.ravel() for part in np.meshgrid(*ranges)), strict=True))


def cells_of(text: str) -> tuple[int, ...]:
    """N cells of a profile, or NX,NY of a map."""
    cells = tuple(int(word) for word in text.split(","))
    if min(cells) < 1 or not 2 <= np.prod(cells) <= MOST_CELLS:
        raise argparse.ArgumentTypeError(f"there are 2 to {MOST_CELLS} cells")
    return cells


def main() -> None:
    parser = command_line(__doc__, "fields.png", skip=None)
    parser.add_argument("--across", choices=("x", "y"), default="x", help="axis of a profile [x]")
    shape = parser.add_mutually_exclusive_group()
    whole = {"type": cells_of, "metavar": "N", "default": (20,), "help": "of the profile [20]"}
    shape.add_argument("--cells", **whole)
    shape.add_argument("--grid", type=cells_of, metavar="NX,NY", help="a map, no profile")
    args = parser.parse_args()
    runs, axis, tables, notes = args.runs, "xy".index(args.across), [], []
    cells = args.grid or (*args.cells, 1)[:: 1 if axis == 0 else -1]
    if len(cells) != 2:
        parser.error("--cells takes one number, --grid two")
    found = estimates(runs, args.skip, cells)
    data = middles(runs[0], cells) | spread({"": found})
    if args.grid:
        figure = draw_grid(runs, cells, found)
    else:
        x, law = data["xy"[axis]], None
        if has_theory(runs, axis):
            law, flux = prediction(runs, axis, args.skip, x, found)
            tables = [[{f"{name} flux": value for name, value in flux._asdict().items()}]]
            if law is None:
                notes = ["no gas has these fluxes and this temperature in the middle: run longer"]
            else:
                data |= {"flow_expected": law[:, 0], "temperature_expected": law[:, 1]}
        figure = draw_profile(runs, axis, x, found, law)
        tables = [{name: v for name, v in data.items() if "stress" not in name}, *tables]
    report(args, figure, *tables, data=data, notes=notes)


if __name__ == "__main__":
    launch(main)
