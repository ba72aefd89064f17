"""Density, flow, temperature, stress and heat flux as functions of position in a steady state.

    python post/fields.py runs/fourier/*.h5 --across x -o fourier.png --csv fourier.csv
    python post/fields.py runs/leidenfrost.h5 --grid 12,24 -o rolls.png

The box is divided into cells, and the fields in a cell are averages over the disks whose centres
are in the cell.  The density n is the number of disks per accessible area (the area that centres
can reach).  The flow velocity u is the mass-weighted mean of v.  With the relative velocity c = v -
u, kT is the mean of m c^2 / 2, and kT_x and kT_y are the means of m c_x^2 and m c_y^2. If disks can
rotate, kT_rot is the mean of I omega^2. The kinetic part of the stress is the sum of m c_a c_b per
area, and the kinetic part of the heat flux is the sum of m c^2 c / 2 per area.  The collisional
parts of stress and heat flux are not included.  Within a cell, the flow velocity u is interpolated
linearly from the neighbouring cells.  The averages include the frames after the first X collisions
per disk, where X is the value of --equilibration, or by default the frames in the second half of
each run.  Errors are determined from the differences between blocks of time, taken from all runs of
one input (docs/explanation/statistics.md).  If a cell contained disks in fewer than two blocks,
only its density is calculated.  The table contains kT, stress and heat flux only for cells in which
at least three disks remain if any one block of time is left out.  With --species, the fields of one
species are calculated, relative to the mean flow of that species.

The flow velocity u is a mean over time.  A flow that varies with time, such as the oscillation of a
shaken bed, is therefore part of the temperatures, the stress and the heat flux.  The script prints
a warning if the oscillation of the centre of mass alone is more than 5 % of the kinetic energy
along an axis.  The panel of the temperature shows kT_x and kT_y if they differ significantly.

With --grid, the script also draws the stream function psi of the particle flux j, where j_x = d psi
/ dy and j_y = -d psi / dx.  The contour lines of psi are the streamlines of the mean flow, and the
difference of psi between two points is the number of disks that pass between them per time.
Recycled disks (drive.kind = 'recycle') leave the flow in one region and enter it in another.  A run
with recycled disks therefore has no stream function, and only the arrows are drawn.  The longest
arrow represents the largest significant flow.  Arrows are pale in cells without significant flow,
where chi^2 of the two components is below 5.99.  In a gas without flow, noise alone causes a chi^2
above 5.99 in 5 % of the cells.

For equal disks between two walls, dashed lines show predicted profiles without fitted parameters.
A profile is calculated from the measured temperature and flow in the middle of the box, and from
the measured fluxes of momentum and energy at the walls.  The predicted profiles are calculated with
Enskog's viscosity and thermal conductivity (Gass 1971) and with the equation of state.  The band
shows the error of the predicted profile, which follows from the errors of the measured values.  At
a packing fraction of 0.2 the true viscosity is 0.98 to 1.00 times Enskog's viscosity, and the true
thermal conductivity is 1.03 to 1.05 times Enskog's conductivity.  Squares show the temperatures and
velocities of the walls.  The table contains the predicted differences of temperature and velocity
between each wall and the gas next to the wall.
"""

import argparse
from typing import NamedTuple

from ricochet import Run
from ricochet.analysis.fields import (
    ACROSS,
    fields,
    has_theory,
    oscillation_notes,
    places,
    prediction,
)
from ricochet.analysis.statistics import Estimate
from ricochet.analysis.streams import StreamFunction, stream_function
from ricochet.analysis.equilibrium import motion_notes
from ricochet.figures.drawing import band, draw_box, plt, titled
from ricochet.reading.reader import SIDES
from ricochet.reading.units import Units
from ricochet.script import command_line, launch, measured, report, spread

import numpy as np
from matplotlib.patches import Circle

MOST_CELLS = 100_000
LEAST_FLOW = 0.2  # smallest range of the axis of a flow velocity [thermal speeds]
SIGNIFICANT = 5.99  # 95 % quantile of chi^2 with two degrees of freedom
#: Significant mean of the squared differences of kT_x and kT_y, in units of the squared errors.
UNEQUAL = 9.0
#: Text and unit of the axis label of each field.
LABELS = {
    "density": ("number density n", "number density"),
    "flow_x": ("flow $u_x$", "speed"),
    "flow_y": ("flow $u_y$", "speed"),
    "temperature": ("kT", "energy"),
    "kT_x": ("$kT_x$", "energy"),
    "kT_y": ("$kT_y$", "energy"),
    "rotational_temperature": ("$kT_{rot}$", "energy"),
    "stress_xx": ("kinetic stress, xx", "stress"),
    "stress_xy": ("kinetic stress, xy", "stress"),
    "stress_yy": ("kinetic stress, yy", "stress"),
    "heat_x": ("kinetic heat flux along x", "heat flux"),
    "heat_y": ("kinetic heat flux along y", "heat flux"),
}
PANELS = {"density": "A", "flow": "B", "temperature": "C"}  # panels with a prediction


def heading(runs: list[Run], species: str | None) -> str:
    """Return the title of a figure, which names the species whose disks are measured."""
    if species is None:
        return titled(runs)
    count = np.sum(runs[0].of_species(species))
    return f"{titled(runs)}\nfields of the species '{species}' ({count} disks)"


def draw_profile(
    runs: list[Run], axis: int, x: np.ndarray, found: dict, law, title: str
) -> plt.Figure:
    """Draw density, flow, temperatures, stress and heat flux against the position along an axis."""
    run, flow = runs[0], f"flow_{'yx'[axis]}"
    figure, panels = plt.subplot_mosaic("AABBCC;DDDEEE", figsize=(12, 7))
    draw_fields(panels["A"], run.units, x, found, "density")
    draw_fields(panels["B"], run.units, x, found, flow)
    parts = ("kT_x", "kT_y") if unequal(found) else ()
    draw_fields(panels["C"], run.units, x, found, "temperature", *parts, "rotational_temperature")
    draw_fields(panels["D"], run.units, x, found, "stress_xx", "stress_yy", "stress_xy")
    draw_fields(panels["E"], run.units, x, found, f"heat_{'xy'[axis]}")
    for name, panel in PANELS.items() if law is not None else ():
        style = {"color": "black", "ls": "--", "lw": 1, "label": "Enskog, from the fluxes"}
        band(panels[panel], with_ends(run, axis, x), *law[name], **style)
    for wall in walls(run, axis):
        for panel, name in (("B", "flow"), ("C", "kT")):
            style = {"marker": "s", "color": "black", "ls": "none", "clip_on": False, "zorder": 3}
            own = "wall" not in panels[panel].get_legend_handles_labels()[1]
            panels[panel].plot(wall["x"], wall[name], label="wall" if own else None, **style)
    low, high = panels["B"].get_ylim()
    least = LEAST_FLOW * float(np.sqrt(np.nanmax(found["temperature"].mean)))
    panels["B"].set_ylim(min(low, -least), max(high, least))
    for axes in panels.values():
        axes.set_xlabel(run.units.label("xy"[axis], "length"))
        axes.set_xlim(run.lower[axis], run.upper[axis])
        if len(axes.get_legend_handles_labels()[0]) > 1:
            axes.legend()
    figure.suptitle(title)
    return figure


def unequal(found: dict[str, Estimate]) -> bool:
    """Return whether kT_x and kT_y differ by more than their errors explain."""
    x, y = found["kT_x"], found["kT_y"]
    with np.errstate(divide="ignore", invalid="ignore"):
        chi2 = (x.mean - y.mean) ** 2 / (x.error**2 + y.error**2)
    chi2 = chi2[np.isfinite(chi2)]
    return len(chi2) > 0 and float(chi2.mean()) > UNEQUAL


def draw_fields(axes: plt.Axes, units: Units, x: np.ndarray, found: dict, *names: str) -> None:
    """Draw points with error bars; there is a gap for each cell without disks."""
    there = [name for name in names if name in found]
    for name in there:
        label = LABELS[name][0] if len(there) > 1 else "measured"
        axes.errorbar(x, *found[name], fmt="o", ms=3, label=label)
    words = ", ".join(dict.fromkeys(LABELS[name][0].partition(",")[0] for name in there))
    axes.set_ylabel(units.label(words, LABELS[there[0]][1]))


def with_ends(run: Run, axis: int, x: np.ndarray) -> np.ndarray:
    """Return positions x, extended at both ends by the outermost possible centre positions."""
    reach = run.radius[0]
    return np.concatenate([[run.lower[axis] + reach], x, [run.upper[axis] - reach]])


def walls(run: Run, axis: int) -> list[dict]:
    """Return position, kT and velocity of the two thermal sides at the ends of an axis."""
    each = zip(SIDES, run.sides, np.stack([run.lower, run.upper], axis=1).ravel(), strict=True)
    return [
        {
            "wall": name,
            "x": x,
            "kT": float(own["temperature"]),
            "flow": own.get("surface_velocity", 0.0),
        }
        for name, own, x in each
        if name in ACROSS[axis] and "temperature" in own
    ]


def at_walls(run: Run, axis: int, law: dict) -> list[dict]:
    """Return kT and velocity of each wall, and the predicted values of the gas next to the wall."""
    rows = []
    for wall in walls(run, axis):
        end = 0 if wall["wall"] == ACROSS[axis][0] else -1
        row = {"wall": wall["wall"], "kT_of_wall": wall["kT"]}
        row |= measured("kT_of_gas", law["temperature"], end)
        row |= {"flow_of_wall": wall["flow"]} | measured("flow_of_gas", law["flow"], end)
        rows.append(row)
    return rows


class Flow(NamedTuple):
    """Mean flow in the cells of a grid."""

    u: np.ndarray  # (2, C) along x and y [speed]
    significant: np.ndarray  # (C,) whether the flow differs from 0 by more than its error explains


def flow_of(found: dict[str, Estimate]) -> Flow:
    """Return the measured mean flow."""
    parts = [found[name] for name in ("flow_x", "flow_y")]
    u, error = (np.array([part[k] for part in parts]) for k in (0, 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        chi2 = np.sum(np.square(u / error), axis=0)
    return Flow(u, np.nan_to_num(chi2, posinf=0.0) > SIGNIFICANT)


def draw_arrows(axes: plt.Axes, run: Run, cells: tuple[int, int], flow: Flow, colour: str) -> None:
    """Draw the flow as arrows, which are pale in cells without significant flow.

    The arrow of the largest significant flow is as long as a cell.  If no cell has a significant
    flow, the arrow of the largest flow is as long as a cell.
    """
    size = np.hypot(*flow.u)
    shown = size[flow.significant] if flow.significant.any() else size
    top = float(np.nanmax(shown, initial=0.0)) or 1.0
    scale = {"units": "xy", "scale_units": "xy", "angles": "xy", "color": colour, "zorder": 2}
    scale |= {"scale": top / float(np.min(run.edges / cells))}
    scale |= {"width": 0.05 * float(np.min(run.edges / cells))}
    for some, alpha in ((~flow.significant, 0.25), (flow.significant, 1.0)):
        place, u = places(run, cells)[some], flow.u[:, some]
        arrows = axes.quiver(*place.T, *u, alpha=alpha, **scale)
    words = f"flow {top:.2g}" + " (not significant)" * (not flow.significant.any())
    key = {"labelpos": "W", "color": "black", "coordinates": "axes", "alpha": 1.0}
    axes.quiverkey(arrows, 0.45, 1.05, top, words, **key)


def draw_grid(
    runs: list[Run],
    cells: tuple[int, int],
    found: dict[str, Estimate],
    stream: StreamFunction | None,
    title: str,
) -> plt.Figure:
    """Draw maps of density and temperature, and arrows on a map of the stream function, if any."""
    run = runs[0]
    figure, panels = plt.subplots(1, 3, figsize=(16, 1 + 4.5 * run.edges[1] / run.edges[0]))
    sides = [np.linspace(run.lower[k], run.upper[k], cells[k] + 1) for k in (0, 1)]
    for axes, name in zip(panels, ("density", "temperature"), strict=False):
        draw_box(axes, run)
        image = axes.pcolormesh(*sides, found[name].mean.reshape(cells[::-1]), zorder=0.2)
        for one in (obstacle for obstacle in run.obstacles if obstacle.inside):
            image.set_clip_path(Circle(one.centre, one.radius, transform=axes.transData))
        figure.colorbar(image, ax=axes, label=run.units.label(*LABELS[name]), shrink=0.8)
    draw_box(panels[2], run)
    if stream is not None:
        draw_stream(figure, panels[2], run, sides, stream.corners.mean)
    draw_arrows(panels[2], run, cells, flow_of(found), "black")
    figure.suptitle(title)
    return figure


def draw_stream(
    figure: plt.Figure, axes: plt.Axes, run: Run, sides: list[np.ndarray], psi: np.ndarray
) -> None:
    """Draw a stream function (NY + 1, NX + 1) as colours with contour lines."""
    top = float(np.abs(psi).max()) or 1.0
    levels = np.linspace(-top, top, 16)  # even: no line at 0, where noise dominates
    filled = axes.contourf(*sides, psi, levels, cmap="RdBu_r", zorder=0.2)
    axes.contour(*sides, psi, levels, colors="0.5", linewidths=0.5, zorder=0.3)
    label = run.units.label("stream function ψ of the flux", "rate")
    figure.colorbar(filled, ax=axes, label=label, shrink=0.8, format="%.2g", ticks=levels[::3])


def cells_of(text: str) -> tuple[int, ...]:
    """Convert a text to the numbers of cells, N for a profile or (NX, NY) for a map."""
    cells = tuple(int(word) for word in text.split(","))
    if min(cells) < 1 or not 2 <= np.prod(cells) <= MOST_CELLS:
        raise argparse.ArgumentTypeError(f"the number of cells must be 2 to {MOST_CELLS}")
    return cells


def main() -> None:
    parser = command_line(__doc__, "fields.png", equilibration="the first half of each run")
    parser.add_argument("--across", choices=("x", "y"), default="x", help="axis of the profile [x]")
    shape = parser.add_mutually_exclusive_group()
    whole = {
        "type": cells_of,
        "metavar": "N",
        "default": (20,),
        "help": "number of cells of the profile [20]",
    }
    shape.add_argument("--cells", **whole)
    shape.add_argument(
        "--grid", type=cells_of, metavar="NX,NY", help="cells of a map, instead of a profile"
    )
    parser.add_argument("--species", metavar="NAME", help="species whose fields are measured [all]")
    args = parser.parse_args()
    runs, axis, tables = args.runs, "xy".index(args.across), []
    cells = args.grid or (*args.cells, 1)[:: 1 if axis == 0 else -1]
    if len(cells) != 2:
        parser.error("--cells takes one number, --grid two")
    cooling = [run.path.name for run in runs if run.nature.cooling]
    notes = motion_notes(runs)
    notes += [f"{name} loses energy and gains none: its state is not steady" for name in cooling]
    notes += oscillation_notes(runs, args.equilibration, args.species)
    title = heading(runs, args.species)
    own = fields(runs, args.equilibration, cells, args.species)
    found = own.found
    middles = places(runs[0], cells)
    data = {"x": middles[:, 0], "y": middles[:, 1]} | spread({"": found})
    if args.grid:
        stream = None
        if any("recycled" in run.nature for run in runs):
            notes.append("recycled disks enter the flow inside the box: no stream function")
        else:
            stream = stream_function(runs, args.equilibration, cells, args.species)
            data |= spread({"": {"stream_function": stream.middles}})
        data |= {"flow_significant": flow_of(found).significant.astype(int)}
        figure = draw_grid(runs, cells, found, stream, title)
    else:
        x, law = data["xy"[axis]], None
        if has_theory(runs, axis):
            law, flux = prediction(own, axis, with_ends(runs[0], axis, x))
            row: dict = {}
            for name, value in flux._asdict().items():
                row |= measured(f"{name}_flux", value)
            tables = [[row]]
        if law:
            ends = {name: law[name] for name in ("flow", "temperature")}
            inner = {k: Estimate(*(part[1:-1] for part in one)) for k, one in ends.items()}
            data |= spread({"_expected": inner})
            tables.append(at_walls(runs[0], axis, law))
        elif tables:
            notes.append(
                "no profile agrees with these fluxes and the temperature in the middle: run longer"
            )
        figure = draw_profile(runs, axis, x, found, law, title)
        tables = [{name: v for name, v in data.items() if "stress" not in name}, *tables]
    report(args, figure, *tables, data=data, notes=notes)


if __name__ == "__main__":
    launch(main)
