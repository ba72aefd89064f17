"""Density, flow velocity, temperature, stress and heat flux as functions of position."""

import argparse
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.patches import Circle

from ...analysis.equilibrium import motion_notes
from ...analysis.estimates import Estimate
from ...analysis.fields import (
    ACROSS,
    Fields,
    fields,
    has_theory,
    no_theory,
    oscillation_notes,
    places,
    prediction,
)
from ...analysis.streams import StreamFunction, stream_function
from ...figures import drawing
from ...figures.drawing import band, draw_box, plt, titled
from ...figures.sheet import Panel, Sheet, legend_above
from ...reading.files import RunError, counted
from ...reading.nature import rows_of
from ...reading.reader import SIDES, Run
from ...reading.units import Units
from ..groups import Group
from ..options import Option, shared
from ..registry import Analysis
from ..result import Result
from ..tables import Table, measured, spread

MOST_CELLS = 100_000
LEAST_FLOW = 0.2  # smallest range of the axis of a flow velocity [thermal speeds]
SIGNIFICANT = 5.99  # 95 % quantile of chi^2 with two degrees of freedom
#: Limit of significance: mean squared difference of kT_x and kT_y, relative to the squared errors.
UNEQUAL = 9.0
BELOW = {"location": "bottom", "pad": 0.03, "aspect": 25}  # position of a colour bar
#: Axis label of each field: text and quantity.
LABELS = {
    "density": ("number density n", "number density"),
    "flow_x": ("velocity along x", "speed"),
    "flow_y": ("velocity along y", "speed"),
    "temperature": ("kT", "energy"),
    "kT_x": ("kT, x", "energy"),
    "kT_y": ("kT, y", "energy"),
    "rotational_temperature": ("rotational kT", "energy"),
    "stress_xx": ("kinetic stress, xx", "stress"),
    "stress_xy": ("kinetic stress, xy", "stress"),
    "stress_yy": ("kinetic stress, yy", "stress"),
    "heat_x": ("kinetic heat flux along x", "heat flux"),
    "heat_y": ("kinetic heat flux along y", "heat flux"),
}
Law = dict[str, Estimate]  # predicted profiles


class Found(NamedTuple):
    """Fields in cells, with the predicted profiles or, for a map, the stream function."""

    own: Fields
    cells: tuple[int, int]
    axis: int
    law: Law | None
    stream: StreamFunction | None


# --- profile ---


def draw_panel(axes: plt.Axes, result: Result, name: str) -> None:
    """Plot a field as a function of position along an axis."""
    run, found = result.runs[0], result.values
    of = found.own.found
    x = places(run, found.cells)[:, found.axis]
    draw_fields(axes, run.units, x, of, *names_of(name, of, found.axis))
    if name in ("density", "flow", "temperature") and found.law is not None:
        style = {"color": "black", "ls": "--", "lw": 1, "label": "Enskog, from the fluxes"}
        band(axes, with_ends(run, found.axis, x), *found.law[name], **style)
    if name in ("flow", "temperature"):
        draw_walls(axes, run, found.axis, {"flow": "flow", "temperature": "kT"}[name])
    if name == "flow":
        low, high = axes.get_ylim()
        least = LEAST_FLOW * float(np.sqrt(np.nanmax(of["temperature"].mean)))
        axes.set_ylim(min(low, -least), max(high, least))
    axes.set_xlabel(run.units.label("xy"[found.axis], "length"))
    axes.set_xlim(run.lower[found.axis], run.upper[found.axis])
    if len(axes.get_legend_handles_labels()[0]) > 1:
        legend_above(axes)


def names_of(panel: str, found: dict[str, Estimate], axis: int) -> list[str]:
    """Return the names of the fields in a panel."""
    if panel == "temperature":
        parts = ["kT_x", "kT_y"] if unequal(found) else []
        return ["temperature", *parts, "rotational_temperature"]
    along, across = "xy"[axis], "yx"[axis]
    return {
        "density": ["density"],
        "flow": [f"flow_{across}"],
        "stress": ["stress_xx", "stress_yy", "stress_xy"],
        "heat": [f"heat_{along}"],
    }[panel]


def draw_walls(axes: plt.Axes, run: Run, axis: int, name: str) -> None:
    """Mark the temperature ('kT') or the velocity ('flow') of thermal walls by squares."""
    for k, wall in enumerate(walls(run, axis)):
        style = {"marker": "s", "color": "black", "ls": "none", "clip_on": False, "zorder": 3}
        axes.plot(wall["x"], wall[name], label="wall" if k == 0 else None, **style)


def unequal(found: dict[str, Estimate]) -> bool:
    """Return whether kT_x and kT_y differ by more than their errors explain."""
    x, y = found["kT_x"], found["kT_y"]
    with np.errstate(divide="ignore", invalid="ignore"):
        chi2 = (x.mean - y.mean) ** 2 / (x.error**2 + y.error**2)
    chi2 = chi2[np.isfinite(chi2)]
    return len(chi2) > 0 and float(chi2.mean()) > UNEQUAL


def draw_fields(axes: plt.Axes, units: Units, x: np.ndarray, found: dict, *names: str) -> None:
    """Plot points with error bars, leaving a gap for each cell without disks."""
    there = [name for name in names if name in found]
    for name in there:
        label = LABELS[name][0] if len(there) > 1 else "measured"
        axes.errorbar(x, *found[name], fmt="o", ms=3, label=label)
    words = ", ".join(dict.fromkeys(LABELS[name][0].partition(",")[0] for name in there))
    axes.set_ylabel(units.label(words, LABELS[there[0]][1]))


def with_ends(run: Run, axis: int, x: np.ndarray) -> np.ndarray:
    """Return positions x, extended at both ends to the outermost positions of centres."""
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
    """Return kT and velocity of each wall, and the predicted values for the gas beside it."""
    rows = []
    for wall in walls(run, axis):
        end = 0 if wall["wall"] == ACROSS[axis][0] else -1
        row = {"wall": wall["wall"], "kT_of_wall": wall["kT"]}
        row |= measured("kT_of_gas", law["temperature"], end)
        row |= {"flow_of_wall": wall["flow"]} | measured("flow_of_gas", law["flow"], end)
        rows.append(row)
    return rows


# --- map ---


class Flow(NamedTuple):
    """Mean flow velocity in the cells of a grid."""

    u: np.ndarray  # (2, C) components along x and y
    significant: np.ndarray  # (C,) whether the flow differs significantly from 0
    known: bool  # whether the errors are known


def flow_of(found: dict[str, Estimate]) -> Flow:
    """Return the measured mean flow velocity."""
    parts = [found[name] for name in ("flow_x", "flow_y")]
    u, error = (np.array([part[k] for part in parts]) for k in (0, 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        chi2 = np.sum(np.square(u / error), axis=0)
    return Flow(u, np.nan_to_num(chi2, posinf=0.0) > SIGNIFICANT, bool(np.isfinite(error).any()))


def draw_arrows(axes: plt.Axes, run: Run, cells: tuple[int, int], flow: Flow, colour: str) -> None:
    """Draw the flow as arrows, pale in cells without significant flow.

    An arrow as long as a cell represents the largest significant flow or, if no flow is
    significant, the largest flow.
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
    doubt = " (not significant)" if flow.known else " (error unknown)"
    words = f"flow {top:.2g}" + doubt * (not flow.significant.any())
    key = {"labelpos": "W", "color": "black", "coordinates": "axes", "alpha": 1.0}
    axes.quiverkey(arrows, 0.5, 1.04, top, words, **key)


def draw_map(axes: plt.Axes, result: Result, name: str) -> None:
    """Plot a field as a map."""
    run, found = result.runs[0], result.values
    draw_box(axes, run)
    values = found.own.found[name].mean.reshape(found.cells[::-1])
    image = axes.pcolormesh(*sides_of(run, found.cells), values, zorder=0.2)
    clip(axes, run, image)
    axes.figure.colorbar(image, ax=axes, label=run.units.label(*LABELS[name]), **BELOW)


def draw_flow(axes: plt.Axes, result: Result) -> None:
    """Draw arrows of the flow on a map of the stream function, if there is one."""
    run, found = result.runs[0], result.values
    draw_box(axes, run)
    if found.stream is not None:
        draw_stream(axes, run, sides_of(run, found.cells), found.stream.corners.mean)
    draw_arrows(axes, run, found.cells, flow_of(found.own.found), "black")


def sides_of(run: Run, cells: tuple[int, int]) -> list[np.ndarray]:
    """Return the edges of the cells along x (NX + 1,) and y (NY + 1,)."""
    return [np.linspace(run.lower[k], run.upper[k], cells[k] + 1) for k in (0, 1)]


def clip(axes: plt.Axes, run: Run, *maps: Artist) -> None:
    """Hide the parts of maps outside a round container."""
    for one in (obstacle for obstacle in run.obstacles if obstacle.inside):
        for each in maps:
            each.set_clip_path(Circle(one.centre, one.radius, transform=axes.transData))


def draw_stream(axes: plt.Axes, run: Run, sides: list[np.ndarray], psi: np.ndarray) -> None:
    """Plot a stream function (NY + 1, NX + 1) in colour, with contour lines."""
    top = float(np.abs(psi).max()) or 1.0
    # The number is even, so that no contour line is at 0, where noise dominates.
    levels = np.linspace(-top, top, 16)
    filled = axes.contourf(*sides, psi, levels, cmap="RdBu_r", zorder=0.2)
    lines = axes.contour(*sides, psi, levels, colors="0.5", linewidths=0.5, zorder=0.3)
    clip(axes, run, filled, lines)
    label = run.units.label("stream function ψ of the flux", "rate")
    ticks = levels[[0, 5, 10, 15]]
    axes.figure.colorbar(filled, ax=axes, label=label, format="%.2g", ticks=ticks, **BELOW)


def draw(result: Result) -> Sheet:
    """Plot the fields as maps or profiles."""
    run, name = result.runs[0], result.options.species
    title = titled(result.runs)
    if name is not None:
        count = np.sum(run.of_species(name))
        title += f"\nfields of the species '{name}' ({counted(count, 'disk')})"
    if result.options.grid:
        aspect = min(2.5, drawing.aspect_of(run)) + 0.25
        maps = [Panel(one, draw_map, (result, one), aspect) for one in ("density", "temperature")]
        return Sheet([[*maps, Panel("flow", draw_flow, (result,), aspect)]], title)
    names = [["density", "flow", "temperature"], ["stress", "heat"]]
    rows = [
        [Panel(one, draw_panel, (result, one), 0.28 * len(row)) for one in row] for row in names
    ]
    return Sheet(rows, title)


def cells_of(text: str) -> tuple[int, ...]:
    """Convert a text to numbers of cells, N for a profile or (NX, NY) for a map."""
    cells = tuple(int(word) for word in text.split(","))
    if min(cells) < 1 or not 2 <= np.prod(cells) <= MOST_CELLS:
        raise argparse.ArgumentTypeError(f"the number of cells must be 2 to {MOST_CELLS}")
    return cells


def chosen_cells(options: SimpleNamespace, axis: int) -> tuple[int, int]:
    """Return the numbers of cells along x and y given by the options."""
    if options.grid and options.cells is not None:
        raise RunError("--grid is not allowed with --cells")
    number = (20,) if options.cells is None else tuple(np.ravel(options.cells).tolist())
    cells = tuple(options.grid or (*number, 1)[:: 1 if axis == 0 else -1])
    if len(cells) != 2:
        raise RunError("--cells takes one number, --grid two")
    return cells


# --- table ---


def warnings_of(
    groups: list[Group], options: SimpleNamespace, own: Fields, errors: bool
) -> list[str]:
    """Return reasons why the state may not be steady, or why there are no `errors`."""
    runs = [run for group in groups for run in group.runs]
    cooling = [run.label for run in runs if run.nature.cooling]
    warnings = motion_notes(runs)
    warnings += [f"{name} loses energy and gains none: its state is not steady" for name in cooling]
    warnings += oscillation_notes(runs, options.equilibration, options.species)
    if not errors:
        few = "fewer than three independent blocks of time"
        warnings.append(
            f"no errors: the steady state contains {few}; run longer, or use more seeds"
        )
    return warnings


def with_theory(runs: list[Run], own: Fields, axis: int, x: np.ndarray) -> tuple[Law | None, Table]:
    """Return the predicted profiles, and a table of the measured fluxes."""
    if not has_theory(runs, axis):
        return None, []
    law, flux = prediction(own, axis, with_ends(runs[0], axis, x))
    row: dict[str, Any] = {}
    for name, value in flux._asdict().items():
        row |= measured(f"{name}_flux", value)
    return law or None, [row]


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return the fields in each cell."""
    runs, axis = [run for group in groups for run in group.runs], "xy".index(options.across)
    cells = chosen_cells(options, axis)
    own = fields(runs, options.equilibration, cells, options.species)
    errors = flow_of(own.found).known
    warnings = warnings_of(groups, options, own, errors)
    middles = places(runs[0], cells)
    data = {"x": middles[:, 0], "y": middles[:, 1]} | spread({"": own.found})
    law, stream, further = None, None, []
    if options.grid:
        if any("recycled" in run.nature for run in runs):
            warnings.append("recycled disks enter the flow inside the box: no stream function")
        else:
            stream = stream_function(runs, options.equilibration, cells, options.species)
            data |= spread({"": {"stream_function": stream.middles}})
        data |= {"flow_significant": flow_of(own.found).significant.astype(int)}
    else:
        law, flux = with_theory(runs, own, axis, data["xy"[axis]])
        further = [flux] if flux else []
    if law is not None:
        inner = {k: Estimate(*(part[1:-1] for part in law[k])) for k in ("flow", "temperature")}
        data |= spread({"_expected": inner})
        further.append(at_walls(runs[0], axis, law))
    elif further:
        few = "no profile agrees with these fluxes and the temperature in the middle: run longer"
        warnings.append(few)
    printed = {name: one for name, one in data.items() if "stress" not in name and not options.grid}
    values = Found(own, cells, axis, law, stream)
    more = {"further": further, "printed": printed, "values": values, "explained": not errors}
    return Result(rows_of(data), notes=notes_of(runs, values, options), warnings=warnings, **more)


def notes_of(runs: list[Run], found: Found, options: SimpleNamespace) -> list[str]:
    """Return explanations of the figure."""
    if options.grid:
        return ["Arrows: mean flow, pale where it is not significant. Lines: streamlines."]
    note = "Bars: standard errors, jackknife over blocks of time."
    notes = [note + " Band: error of the prediction." * (found.law is not None)]
    reasons = ((run, no_theory(run, found.axis)) for run in runs)
    if why := next((f"{run.label} {why}" for run, why in reasons if why), ""):
        law = "Enskog's theory of equal smooth elastic disks between two walls does not apply"
        notes.append(f"No predictions and no fluxes at walls: {law}, because {why}.")
    return notes


ANALYSIS = Analysis(
    compute,
    draw,
    options=(
        shared("equilibration", "first half"),
        Option("across", "axis of the profile [x]", "x", choices=("x", "y")),
        Option("cells", "number of cells of the profile [20]", None, cells_of, "N"),
        Option("grid", "cells of a map, instead of a profile", None, cells_of, "NX,NY"),
        Option("species", "species whose fields are measured [all]", symbol="NAME"),
    ),
)
