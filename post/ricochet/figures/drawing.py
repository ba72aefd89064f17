"""Draw disks, walls and obstacles to scale with Matplotlib, and save figures.

In a notebook, `plt.style.use(drawing.STYLE)` selects the style of the figures that the scripts
draw.
"""

from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.quiver import Quiver

from ..analysis.estimates import Estimate, kurtosis_noise
from ..analysis.structure import bond_order, periods
from ..reading.arrays import Index, as_index
from ..reading.files import RunError, destination, did_you_mean
from ..reading.nature import known, rows_of, stays_in_box
from ..reading.box import groups_of_rows
from ..reading.reader import SIDES, Run
from ..reading.units import UNNAMED

STYLE = Path(__file__).with_name("style.mplstyle")
COLOURS = matplotlib.rc_params_from_file(STYLE)["axes.prop_cycle"].by_key()["color"]
LEAST_SHARE = 0.12  # smallest diameter drawn, relative to the mean distance between disks
OUTLINE = 0.08  # width of an outline, relative to the diameter
LEAST_POINTS = 4.0  # largest diameter to which small disks are enlarged
ARC_POINTS = 181  # points of the polyline that represents an arc
# Lines are not snapped to whole pixels, because a straight wall would then have a step where an arc
# begins.
WALL: dict[str, Any] = {"color": "0.25", "linewidth": 1.2, "snap": False}

#: Quantities that can determine the colours of disks, each with its label and its dimension.
COLOURINGS = {
    "speed": ("speed", "speed"),
    "displacement": ("displacement", "length"),
    "collisions": ("number of collisions", "number"),
    "spin": ("angular velocity", "rate"),
    "psi6": ("direction of $\\psi_6$ relative to the mean (degrees)", "number"),
}


def caption(runs: list[Run]) -> str:
    """Return a caption: number of disks, contact law, seeds, and parameters that runs differ in."""
    parts = [f"N = {listed({run.n_disks for run in runs})}"]
    restitutions = {run.restitution for run in runs}
    if all(map(np.isfinite, restitutions)):
        parts.append(f"ξ = {listed(restitutions)}")
    for name, symbol, absent in (("tangential_restitution", "β", -1.0), ("friction", "μ", None)):
        common = {run.parameter("contact", name, absent) for run in runs}
        if len(common) == 1 and common != {absent}:
            parts.append(f"{symbol} = {common.pop():g}")
    values: dict[str, set[float]] = {}
    for run in runs:
        for name, value in numbers_of(run).items():
            values.setdefault(name, set()).add(value)
    chance = by_chance(runs)
    parts += [
        stated(name, own) for name, own in values.items() if len(own) > 1 and name not in chance
    ]
    seeds = {run.seed for run in runs}
    parts.append(f"seed {min(seeds)}" if len(seeds) == 1 else f"{len(seeds)} seeds")
    return "\n".join(wrap(",  ".join(parts), 110))


def stated(name: str, values: set[float]) -> str:
    """Return the values of a parameter as text; a time step of 0 becomes "event-driven"."""
    steps = values - {0.0} if name == "dt" else values
    parts = ["event-driven"] * (steps != values) + [f"{name} = {listed(steps)}"] * bool(steps)
    return " and ".join(parts)


def by_chance(runs: list[Run]) -> set[str]:
    """Return the names of packing fractions whose values differ only because radii are random."""
    given: dict[str, set[tuple[bool, str]]] = {}
    for run in runs:
        for kind in run.names:
            own = run.parameters.get("species", {}).get(kind, {})
            what = [np.ravel(own.get(name, 0)).tolist() for name in ("count", "radius", "region")]
            name = f"{kind} " * (len(run.names) > 1) + "packing_fraction"
            given.setdefault(name, set()).add((own.get("polydispersity", 0) > 0, str(what)))
    return {name for name, kinds in given.items() if len(kinds) == 1 and next(iter(kinds))[0]}


def count_at(run: Run, frame: int) -> dict[str, int]:
    """Return the number of events or collisions before a frame; {} if `output` was changed."""
    schedule = run.parameters.get("output", {})
    counted = {"events": ["collisions", "side_collisions", "obstacle_collisions"]}
    counted["collisions"] = counted["events"][:1]
    for name, parts in counted.items():
        if every := schedule.get(f"frames_every_{name}"):
            total = sum(int(np.sum(run.observable(part).value[-1])) for part in parts)
            if run.n_frames - 1 == -(-total // every):  # the last frame may follow earlier
                return {name: min(frame * int(every), total)}
    return {}


def moment(run: Run, frame: int) -> str:
    """Return the title of a panel: the number of events or collisions, if known, and the time."""
    counts = [f"{name[:-1]} {number},  " for name, number in count_at(run, frame).items()]
    return "".join(counts) + f"t = {run.time[frame]:.4g} {run.units.time}".rstrip()


def titled(runs: list[Run]) -> str:
    """Return the title given in the input, if it is the same for all runs, and the caption."""
    titles = {str(run.parameter("run", "title", "")) for run in runs}
    return "\n".join(
        filter(None, (*titles, caption(runs)) if len(titles) == 1 else [caption(runs)])
    )


def listed(values: set[float]) -> str:
    """Return up to four numbers as text, or the smallest and the largest of more than four.

    Fractions have four digits, or six if they would otherwise be equal.
    """
    ordered = sorted(values)
    words = [f"{value:g}" if value == round(value) else f"{value:.4g}" for value in ordered]
    if len(set(words)) < len(values):
        words = [f"{value:g}" for value in ordered]
    return ", ".join(words) if len(words) < 5 else f"{words[0]} to {words[-1]}"


def numbers_of(run: Run) -> dict[str, float]:
    """Return the numerical input variables that a caption states if runs differ in them."""
    found = {**run.parameters.get("box", {}), **run.parameters.get("contact", {})}
    if found.get("wall_restitution") == run.restitution:
        del found["wall_restitution"]
    for kind in run.names:
        own, prefix = run.parameters.get("species", {}).get(kind, {}), f"{kind} "
        if "packing_fraction" in own:
            own = {name: value for name, value in own.items() if name != "radius"}
        found |= {prefix * (len(run.names) > 1) + name: value for name, value in own.items()}
    for name, own in zip(SIDES, run.sides, strict=True):
        found |= {f"{name} {variable}": value for variable, value in own.items()}
    found |= {f"drive {name}": value for name, value in run.parameters.get("drive", {}).items()}
    found["dt"] = run.time_step
    return {
        name: float(value)
        for name, value in found.items()
        if isinstance(value, int | float) and name.split()[-1] not in ("count", "restitution")
    }


def colours(count: int, first: int = 0) -> list[str]:
    """Return `count` of the `COLOURS` from `first` on, or of a colour map if these are too few."""
    if first + count <= len(COLOURS):
        return COLOURS[first : first + count]
    return [to_hex(colour) for colour in plt.get_cmap()(np.linspace(0, 0.9, count))]


def ordered_colours(count: int) -> list[str]:
    """Return colours whose order, from dark to light, is that of the values they stand for."""
    return [to_hex(colour) for colour in plt.get_cmap()(np.linspace(0, 0.82, count))]


def panel_grid(count: int, aspect: float) -> tuple[int, int]:
    """Return the numbers of rows and columns for `count` panels with height / width = `aspect`."""
    columns = int(np.clip(np.ceil(np.sqrt(count * aspect * 1.4)), 1, count))
    rows = int(np.ceil(count / columns))
    return rows, int(np.ceil(count / rows))


def label_of(run: Run, colour: str) -> str:
    """Return the label of a colour scale, including the unit."""
    return run.units.label(*COLOURINGS[colour])


def values_of(run: Run, frame: Index, colour: str) -> np.ndarray:
    """Return the values (..., N) that determine the colours of disks; see `COLOURINGS`."""
    if colour == "collisions" and run.event_count is not None:
        return run.event_count[as_index(frame)].astype(float)
    if colour == "psi6":
        psi = bond_order(run, frame)
        return np.degrees(np.angle(psi * psi.mean().conj()))
    if colour == "spin":
        return run.angular_velocity[as_index(frame)]
    return run.displacement(frame) if colour == "displacement" else run.speed(frame)


def scale_top(run: Run, frames: Sequence[int], colour: str) -> float:
    """Return the upper end of the colour scale of a film: the 99.5 % quantile of the values.

    The values are taken from about 40 frames. Displacements grow with time, so that their values
    are taken from the last frame.
    """
    return top_of(sample_of(run, frames, colour))


def sample_of(run: Run, frames: Sequence[int], colour: str) -> np.ndarray:
    """Return the values (F, N) in the frames on which `scale_top` bases a colour scale."""
    some = [] if colour == "displacement" else frames[:: max(1, len(frames) // 40)]
    return values_of(run, sorted({*some, frames[-1]}), colour)


def top_of(values: np.ndarray) -> float:
    """Return the upper end of a colour scale: the 99.5 % quantile of the nonzero absolute values.

    If these are all equal, it is twice their value, because the lightest colour is hardly visible
    on white.
    """
    moved = np.abs(values[(values != 0) & np.isfinite(values)])
    if len(moved) == 0:
        return 1.0
    top = float(np.quantile(moved, 0.995))
    return 2 * top if np.ptp(moved) <= 1e-9 * top else top


def exceeded(values: np.ndarray, low: float, top: float) -> str:
    """Return which ends of a colour scale are exceeded by values, as a keyword of `colorbar`."""
    ends = bool(np.any(values < low)), bool(np.any(values > top))
    return {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[ends]


def limits_of(colour: str, top: float) -> tuple[float, float]:
    """Return both ends of a linear colour scale with the largest value `top`."""
    return {"psi6": (-180.0, 180.0), "spin": (-top, top)}.get(colour, (0.0, top))


def colour_map(colour: str) -> str:
    """Return the name of the colour map, cyclic for angles and diverging for spins."""
    return {"psi6": "hsv", "spin": "coolwarm"}.get(colour, "viridis")


def chosen_colour(run: Run, wish: str | None) -> str:
    """Return the quantity that colours represent: `wish`, or the default if it is None."""
    known = ("species", *COLOURINGS)
    if wish is not None and wish not in known:
        hint = did_you_mean(wish, known)
        raise RunError(f"'{wish}' is not one of {', '.join(known)}{hint}")
    if wish == "collisions" and run.event_count is None:
        raise RunError(f"{run.path}: has no collisions per disk")
    if wish == "psi6":
        stays_in_box(run)
    if wish == "spin" and "angular_velocity" not in run.disk_data:
        raise RunError(
            f"{run.path}: its disks cannot rotate, or the frames do not contain their spins"
        )
    return wish or ("species" if len(run.names) > 1 else "speed")


def aspect_of(run: Run) -> float:
    """Return height / width of the region that the box covers with its moving sides."""
    width, height = run.bounds[1] - run.bounds[0]
    return height / width


def lone(x: np.ndarray) -> dict[str, Any]:
    """Return the style of a curve with the abscissas `x`; a single point is drawn as a marker."""
    return {"marker": "o", "ms": 3, "clip_on": False} if len(x) < 2 else {}


def draw_box(axes: Axes, run: Run, time: float | None = None) -> None:
    """Draw the sides of the box, the walls and the obstacles, with equal scales on both axes.

    Periodic sides are dashed, open sides dotted and circles grey; thermal and sliding walls are
    labelled. Moving sides are drawn at their positions at `time` [mean positions], with the area
    beyond them in grey.
    """
    low, high = run.bounds
    (x0, y0), (x1, y1) = (run.lower, run.upper) if time is None else run.corners_at(time)
    lines = [(x0, y0), (x0, y1)], [(x1, y0), (x1, y1)], [(x0, y0), (x1, y0)], [(x0, y1), (x1, y1)]
    styles = ["--" if periodic else "-" for periodic in np.repeat(run.periodic, 2)]
    opens = run.open_at(run.time[0] if time is None else time)
    styles = [":" if is_open else style for is_open, style in zip(opens, styles, strict=True)]
    sides: dict[str, Any]
    grey: dict[str, Any]
    sides, grey = {"linestyles": styles, "clip_on": False, "zorder": 3}, {"facecolor": "0.85"}
    axes.add_patch(Rectangle((low[0], low[1]), *(high - low), zorder=-2, **grey))
    axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, facecolor="white", zorder=-1))
    axes.add_collection(LineCollection(lines, **sides, **WALL))
    arcs = [obstacle.points(ARC_POINTS) for obstacle in run.obstacles if obstacle.is_arc]
    walls = [line + shift for line in (*run.walls, *arcs) for shift in periods(run)]
    axes.add_collection(LineCollection(walls, zorder=3, capstyle="projecting", **WALL))
    draw_circles(axes, run, grey)
    axes.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    (x0, y0), (x1, y1) = run.lower, run.upper
    axes.set_xticks([x0, x1], [f"{x0:g}", f"{x1:g}"])
    axes.set_yticks([y0, y1], [f"{y0:g}", f"{y1:g}"])
    axes.set_xlabel(run.units.coordinate("x"), labelpad=-8)
    axes.set_ylabel(run.units.coordinate("y"), labelpad=-8)
    axes.tick_params(length=3)
    axes.label_outer()
    axes.spines[:].set_visible(False)
    name_walls(axes, run)


def draw_circles(axes: Axes, run: Run, grey: dict[str, Any]) -> None:
    """Draw circular obstacles (not arcs), including periodic images that overlap the box."""
    circles = [obstacle for obstacle in run.obstacles if not obstacle.is_arc]
    if any(circle.inside for circle in circles):
        axes.add_patch(Rectangle((run.lower[0], run.lower[1]), *run.edges, zorder=0, **grey))
    width = min(1.0, 20 / np.sqrt(max(len(circles), 1)))  # thin if there are many circles
    centres = np.array([circle.centre for circle in circles]).reshape(-1, 2)
    radii = np.array([circle.radius for circle in circles])
    encloses = np.array([circle.inside for circle in circles], dtype=bool)
    for inside, fill, level in ((True, "white", 0.1), (False, "0.75", 0.5)):  # above maps (0.2)
        style: dict[str, Any]
        style = {"facecolors": fill, "edgecolors": "0.25", "linewidths": width, "zorder": level}
        for shift in periods(run):
            at, reach = centres + shift, radii[:, np.newaxis]
            seen = (at + reach >= run.lower) & (at - reach <= run.upper)
            shown = seen.all(axis=1) & (encloses == inside)
            sizes = 2 * radii[shown]  # draws 100 000 circles in a second
            style |= {"offsets": at[shown], "offset_transform": axes.transData, "units": "xy"}
            axes.add_collection(EllipseCollection(sizes, sizes, np.zeros(1), **style))


def name_walls(axes: Axes, run: Run) -> None:
    """Label each thermal or sliding side and wall with its temperature and surface velocity."""
    (x0, y0), (x1, y1) = run.bounds
    ends_of = [((x0, y0), (x0, y1), 1), ((x1, y0), (x1, y1), -1)]
    ends_of += [((x0, y0), (x1, y0), -1), ((x0, y1), (x1, y1), 1)]
    shown: list[Any] = [*zip(run.sides, ends_of, strict=True)]
    walls = rows_of(run.parameters.get("wall", {}))
    groups = groups_of_rows(run.parameters, "wall")
    firsts = np.unique(groups, return_index=True)[1]  # label only one wall of each polyline or file
    shown += [(walls[groups[k]], (*run.walls[k], 1)) for k in firsts]
    for own, (start, end, side) in shown:
        speed = own.get("surface_velocity", 0.0)
        words = [f"kT = {own['temperature']:g}"] if known(own.get("temperature")) else []
        words += [f"{'→' if speed > 0 else '←'} {abs(speed):g}"] if speed else []
        way = np.subtract(end, start)
        along = way / np.linalg.norm(way)
        axes.annotate(
            ",  ".join(words),
            start + 0.7 * way,  # beside the labels of the axes
            xytext=9 * side * np.array([-along[1], along[0]]),
            textcoords="offset points",
            rotation=np.degrees(np.arctan2(along[1], along[0])),
            ha="center",
            va="center",
            size=9,
            color="firebrick",
        )


def with_images(run: Run, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return indices and positions of all disks in the box, and of images that overlap the box."""
    which = [np.flatnonzero(np.isfinite(position).all(axis=1))]
    places = [position[which[0]]]
    for shift in periods(run):
        if shift.any():
            place = position + shift
            inside = (place > run.lower - run.radius[:, None]) & (
                place < run.upper + run.radius[:, None]
            )
            which.append(np.flatnonzero(inside.all(axis=1)))
            places.append(place[which[-1]])
    return np.concatenate(which), np.concatenate(places)


def points_per_length(axes: Axes) -> float:
    """Return the number of typographic points per unit of length, for equal scales of both axes."""
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    pixels = min(axes.bbox.width / (x1 - x0), axes.bbox.height / (y1 - y0))
    figure = axes.get_figure(root=True)
    return float(72 * pixels / (figure.dpi if figure else 72))


def drawn_diameters(axes: Axes, run: Run) -> np.ndarray:
    """Return the diameters (N,) with which disks are drawn; tiny disks are enlarged."""
    apart = np.sqrt(np.prod(run.edges) / run.n_disks)
    least = min(LEAST_SHARE * apart, LEAST_POINTS / points_per_length(axes))
    return np.maximum(2 * run.radius, least)


def note_on_size(axes: Axes, run: Run) -> str:
    """Return a note for a title if disks are enlarged, otherwise ''."""
    larger = drawn_diameters(axes, run) > 2 * run.radius
    return ", small disks enlarged" if larger.any() else ""


def disk_collection(axes: Axes, run: Run, position: np.ndarray, **style: Any) -> EllipseCollection:
    """Draw disks at `position` (N, 2) with their periodic images, enlarging small disks.

    `array` (N,) holds values for a colour map, or `facecolors` the colours. If colours represent
    values, a black outline inside the rim marks disks of all species but the first.
    """
    which, places = with_images(run, position)
    diameters = drawn_diameters(axes, run)
    size, flat = diameters[which], np.zeros(len(which))
    if "array" in style and len(run.names) > 1:
        widths = np.clip(OUTLINE * diameters * points_per_length(axes), 0, 1.5)
        widths = (widths * (run.species > 1))[which]
        # Half of the width of an outline lies outside its ellipse.
        size = size - widths / points_per_length(axes)
        style = {"edgecolors": "black", "linewidths": widths, **style}
    for name in style.keys() & {"array", "facecolors"}:
        style[name] = np.asarray(style[name])[which]
    style = {"linewidths": 0, "units": "xy", "offset_transform": axes.transData, **style}
    disks = EllipseCollection(size, size, flat, offsets=places, **style)
    axes.add_collection(disks)
    return disks


def radius_marks(axes: Axes, run: Run, frame: int) -> LineCollection | None:
    """Mark the orientation of each disk by a radius; return None if disks have no orientations."""
    if "orientation" not in run.disk_data:
        return None
    which, places = with_images(run, run.position[frame])
    angle = run.orientation[frame][which]
    length = drawn_diameters(axes, run)[which] / 2
    rim = length * np.array([np.cos(angle), np.sin(angle)])
    lines = np.stack([places, places + rim.T], axis=1)
    marks = LineCollection([*lines], colors="black", linewidths=0.6, zorder=1.5)
    axes.add_collection(marks)
    return marks


def band(axes: Axes, x: np.ndarray, y: np.ndarray, error: np.ndarray, **style: Any) -> None:
    """Draw a curve with its error band."""
    axes.plot(x, y, **style)
    axes.fill_between(x, y - error, y + error, color=style["color"], alpha=0.25, lw=0)


def bars(axes: Axes, height: Estimate, bins: np.ndarray, **style: Any) -> None:
    """Draw a histogram with its error bars."""
    axes.stairs(height.mean, bins, **style)
    middle = (bins[1:] + bins[:-1]) / 2
    axes.errorbar(middle, *height, fmt="none", color=style["color"], elinewidth=1)


def noise_band(axes: Axes, count: int, colour: str, label: str = "") -> None:
    """Draw the band that contains a2 of `count` Maxwellian speeds with 95 % probability."""
    reach = 2 * kurtosis_noise(count)
    axes.axhspan(-reach, reach, color=colour, alpha=0.15, lw=0, zorder=0, label=label)


def dilute_limit(axes: Axes, points: np.ndarray, of: str = "") -> None:
    """Plot a solution of the Boltzmann equation as open circles (points: shape (P, 2))."""
    label = f"{of}dilute limit (Boltzmann equation)"
    axes.plot(*points.T, ls="", marker="o", mfc="none", color="black", label=label)


def species_colours(run: Run) -> list[str]:
    """Return the colour of the species of each disk."""
    return [COLOURS[(s - 1) % len(COLOURS)] for s in run.species]


def species_legend(figure: Figure, run: Run, by_outline: bool = False) -> None:
    """Add a legend of the species (if several) below all panels, by colour or `by_outline`."""
    styles = [{"color": COLOURS[k % len(COLOURS)]} for k in range(len(run.names))]
    if by_outline:
        styles = [{"mfc": "0.8", "mec": "black", "mew": 1.5 * (k > 0)} for k in range(len(styles))]
    handles = [Line2D([], [], ls="", marker="o", **style) for style in styles]
    if len(run.names) > 1:
        figure.legend(handles, run.names, loc="outside lower center", ncols=len(run.names))


def draw_key(axes: Axes, run: Run, arrows: Quiver, longest: float) -> None:
    """Draw a reference arrow above a panel, labelled with the speed that it represents.

    The arrow is placed above the title of the panel if both do not fit side by side.
    """
    power = 10.0 ** np.floor(np.log10(longest))
    speed = max(step * power for step in (1, 2, 5) if step * power <= longest)
    unit = run.units.name("speed")
    words = f"speed {speed:g}" + f" {unit}" * (unit != UNNAMED.name("speed"))
    place = {"coordinates": "axes", "labelpos": "W", "color": "black"}
    title = axes.get_title("left")
    panel, size = axes.get_window_extent(), float(axes.title.get_fontsize()) * axes.figure.dpi / 72
    beside = 0.6 * size * len(title + words) < 0.75 * panel.width  # 0.6: width of a character
    if not beside:
        axes.set_title(f"\n{title}")
    height = 0.04 if beside else 0.03 + 1.5 * size / panel.height
    axes.quiverkey(arrows, 0.9, 1 + height, speed, words, **place)


def warn(figure: Figure, notes: Sequence[str]) -> None:
    """Write warnings below a figure, at most three of them in full."""
    if not notes:
        return
    rest = len(notes) - 3
    more = [f"and {rest} more warning{'s' * (rest > 1)}, as printed"] if rest > 0 else []
    lines = [wrap(f"Warning: {note}", 15 * int(figure.get_figwidth())) for note in notes[:3]]
    text = "\n".join([line for part in lines for line in part] + more)
    if figure.legends:  # an axis label would overlap the warnings
        figure.legends[0].set_title(text, FontProperties(size=9))
        figure.legends[0].get_title().set_color("firebrick")
    else:
        figure.supxlabel(text, fontsize=9, color="firebrick")


def save(figure: Figure, path: Path, runs: list[Run], title: str) -> None:
    """Save a figure with metadata that name the runs, creating missing folders."""
    sources = ", ".join(run.label for run in runs[:20]) + (", ..." if len(runs) > 20 else "")
    commits = sorted({str(run.provenance.get("git_commit", "unknown")) for run in runs})
    origin = f"{sources} (ricochet {', '.join(commits)})"
    if path.suffix not in (".pdf", ".svg", ".png"):
        raise RunError(f"{path}: the name of a figure must end in .pdf, .svg, .png")
    key = "Subject" if path.suffix == ".pdf" else "Description"
    figure.savefig(destination(path), metadata={"Title": title, key: origin})
    plt.close(figure)
