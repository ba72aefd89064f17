"""Draw disks of true size, walls and obstacles with Matplotlib; save figures.

`plt.style.use(drawing.STYLE)` gives a notebook the style of the scripts.
"""

from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection, PatchCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Rectangle

from ..analysis.statistics import Estimate, kurtosis_noise
from ..analysis.structure import bond_order, periods
from ..reading.arrays import Index, as_index
from ..reading.files import RunError, destination, did_you_mean
from ..reading.nature import known, rows_of
from ..reading.reader import SIDES, Run, groups_of_rows

STYLE = Path(__file__).with_name("style.mplstyle")
COLOURS = matplotlib.rc_params_from_file(STYLE)["axes.prop_cycle"].by_key()["color"]
WALL: dict[str, Any] = {"color": "0.25", "linewidth": 1.2}

#: What disks can be coloured by, apart from their species.
LABELS = {
    "speed": "speed (reduced units)",
    "displacement": "displacement (reduced units)",
    "collisions": "collisions so far",
    "psi6": "direction of $\\psi_6$ against the mean one (degrees)",
}


def caption(runs: list[Run]) -> str:
    """What a reader must know: number of disks, restitution, what else varies, seeds."""
    parts = [f"N = {listed({run.n_disks for run in runs})}"]
    restitutions = {run.restitution for run in runs}
    if all(map(np.isfinite, restitutions)):
        parts.append(f"ξ = {listed(restitutions)}")
    values: dict[str, set[float]] = {}
    for run in runs:
        for name, value in numbers_of(run).items():
            values.setdefault(name, set()).add(value)
    parts += [f"{name} = {listed(own)}" for name, own in values.items() if len(own) > 1]
    seeds = {run.seed for run in runs}
    parts.append(f"seed {min(seeds)}" if len(seeds) == 1 else f"{len(seeds)} seeds")
    return "\n".join(wrap(",  ".join(parts), 110))


def titled(runs: list[Run]) -> str:
    """Title of the input and what else a reader must know."""
    title = str(runs[0].parameter("run", "title", ""))
    return "\n".join(filter(None, (title, caption(runs))))


def listed(values: set[float]) -> str:
    """A few numbers, or from where to where they go."""
    words = [f"{value:g}" for value in sorted(values)]
    return ", ".join(words) if len(words) < 5 else f"{words[0]} to {words[-1]}"


def numbers_of(run: Run) -> dict[str, float]:
    """The numbers of the input that say what system it is, by name, less those of any caption."""
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
    """A colour for each of so many things, from the `first` of COLOURS on; of many from a scale."""
    if first + count <= len(COLOURS):
        return COLOURS[first : first + count]
    return [to_hex(colour) for colour in plt.get_cmap()(np.linspace(0, 0.9, count))]


def panel_grid(count: int, aspect: float) -> tuple[int, int]:
    """Rows and columns for `count` panels of this height over width, wider than high."""
    columns = int(np.clip(np.ceil(np.sqrt(count * aspect * 1.4)), 1, count))
    rows = int(np.ceil(count / columns))
    return rows, int(np.ceil(count / rows))


def values_of(run: Run, frame: Index, colour: str) -> np.ndarray:
    """(..., N) the number that colours each disk, see `LABELS`; psi6 of one frame only."""
    if colour == "collisions" and run.event_count is not None:
        return run.event_count[as_index(frame)].astype(float)
    if colour == "psi6":
        psi = bond_order(run, frame)
        return np.degrees(np.angle(psi * psi.mean().conj()))
    return run.displacement(frame) if colour == "displacement" else run.speed(frame)


def scale_top(run: Run, frames: Sequence[int], colour: str) -> float:
    """The upper end of a scale for a film, without the few largest values.

    From some frames, or from the last one: disks are displaced ever farther.
    """
    some = [] if colour == "displacement" else frames[:: max(1, len(frames) // 40)]
    values = values_of(run, sorted({*some, frames[-1]}), colour)
    moved = values[values > 0]
    return float(np.quantile(moved, 0.995)) if len(moved) else 1.0


def colour_map(colour: str) -> str:
    """The colours of values; a direction comes back to where it was."""
    return "hsv" if colour == "psi6" else "viridis"


def chosen_colour(run: Run, wish: str | None) -> str:
    """The wish if the run has the data; without one by species where there are several."""
    known = ("species", *LABELS)
    if wish is not None and wish not in known:
        hint = did_you_mean(wish, known)
        raise RunError(f"'{wish}' is not one of {', '.join(known)}{hint}")
    if wish == "collisions" and run.event_count is None:
        raise RunError(f"{run.path}: has no collisions per disk")
    return wish or ("species" if len(run.names) > 1 else "speed")


def aspect_of(run: Run) -> float:
    """Height over width of what is drawn."""
    width, height = run.bounds[1] - run.bounds[0]
    return height / width


def lone(x: np.ndarray) -> dict[str, Any]:
    """Style of a curve: a single point is not seen without a marker."""
    return {"marker": "o", "ms": 3, "clip_on": False} if len(x) < 2 else {}


def draw_box(axes: Axes, run: Run, time: float | None = None) -> None:
    """Walls solid, periodic sides dashed, obstacles grey; equal scales, ticks at the corners.

    Sides that move are drawn where they are at this time [their own places], what lies beyond them
    grey.  Walls that heat or slide say so.
    """
    low, high = run.bounds
    (x0, y0), (x1, y1) = (run.lower, run.upper) if time is None else run.corners_at(time)
    lines = [(x0, y0), (x0, y1)], [(x1, y0), (x1, y1)], [(x0, y0), (x1, y0)], [(x0, y1), (x1, y1)]
    styles = ["--" if periodic else "-" for periodic in np.repeat(run.periodic, 2)]
    sides: dict[str, Any]
    grey: dict[str, Any]
    sides, grey = {"linestyles": styles, "clip_on": False, "zorder": 3}, {"facecolor": "0.85"}
    axes.add_patch(Rectangle((low[0], low[1]), *(high - low), zorder=-2, **grey))
    axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, facecolor="white", zorder=-1))
    axes.add_collection(LineCollection(lines, **sides, **WALL))
    walls = [wall + shift for wall in run.walls for shift in periods(run)]
    axes.add_collection(LineCollection(walls, zorder=3, capstyle="projecting", **WALL))
    draw_circles(axes, run, grey)
    axes.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    (x0, y0), (x1, y1) = run.lower, run.upper
    axes.set_xticks([x0, x1], [f"{x0:g}", f"{x1:g}"])
    axes.set_yticks([y0, y1], [f"{y0:g}", f"{y1:g}"])
    axes.set_xlabel("x", labelpad=-8)
    axes.set_ylabel("y", labelpad=-8)
    axes.tick_params(length=3)
    axes.label_outer()
    axes.spines[:].set_visible(False)
    name_walls(axes, run)


def draw_circles(axes: Axes, run: Run, grey: dict[str, Any]) -> None:
    """Circular obstacles, with those of their periodic images that reach into the box."""
    if any(obstacle.inside for obstacle in run.obstacles):
        axes.add_patch(Rectangle((run.lower[0], run.lower[1]), *run.edges, zorder=0, **grey))
    width = min(1.0, 20 / np.sqrt(max(len(run.obstacles), 1)))  # of lines: many circles are small
    for inside, fill, level in ((True, "white", 0.1), (False, "0.75", 0.5)):  # a map is at 0.2
        circles = [
            Circle(obstacle.centre + shift, obstacle.radius)
            for shift in periods(run)
            for obstacle in run.obstacles
            if obstacle.inside == inside
            and np.all(obstacle.centre + shift + obstacle.radius >= run.lower)
            and np.all(obstacle.centre + shift - obstacle.radius <= run.upper)
        ]
        style: dict[str, Any]
        style = {"facecolor": fill, "edgecolor": "0.25", "linewidth": width, "zorder": level}
        axes.add_collection(PatchCollection(circles, **style))


def name_walls(axes: Axes, run: Run) -> None:
    """Along each side and wall its temperature, and how fast and where to it slides."""
    (x0, y0), (x1, y1) = run.bounds
    ends_of = [((x0, y0), (x0, y1), 1), ((x1, y0), (x1, y1), -1)]
    ends_of += [((x0, y0), (x1, y0), -1), ((x0, y1), (x1, y1), 1)]
    shown: list[Any] = [*zip(run.sides, ends_of, strict=True)]
    walls = rows_of(run.parameters.get("wall", {}))
    groups = groups_of_rows(run.parameters, "wall")
    firsts = np.unique(groups, return_index=True)[1]  # of each polyline, or file, one wall
    shown += [(walls[groups[k]], (*run.walls[k], 1)) for k in firsts]
    for own, (start, end, side) in shown:
        speed = own.get("surface_velocity", 0.0)
        words = [f"kT = {own['temperature']:g}"] if known(own.get("temperature")) else []
        words += [f"{'→' if speed > 0 else '←'} {abs(speed):g}"] if speed else []
        way = np.subtract(end, start)
        along = way / np.linalg.norm(way)
        axes.annotate(
            ",  ".join(words),
            start + 0.7 * way,  # beside the names of the axes
            xytext=9 * side * np.array([-along[1], along[0]]),
            textcoords="offset points",
            rotation=np.degrees(np.arctan2(along[1], along[0])),
            ha="center",
            va="center",
            size=9,
            color="firebrick",
        )


def with_images(run: Run, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices and places of the disks, and of their periodic images that reach into the box."""
    which, places = [np.arange(run.n_disks)], [position]
    for shift in periods(run):
        if shift.any():
            place = position + shift
            inside = (place > run.lower - run.radius[:, None]) & (
                place < run.upper + run.radius[:, None]
            )
            which.append(np.flatnonzero(inside.all(axis=1)))
            places.append(place[which[-1]])
    return np.concatenate(which), np.concatenate(places)


def disk_collection(axes: Axes, run: Run, position: np.ndarray, **style: Any) -> EllipseCollection:
    """Disks of true size at `position` (N, 2) and their periodic images.

    Of their style `array` (N,) colours them by value, or else `facecolors`.
    """
    which, places = with_images(run, position)
    size, flat = 2 * run.radius[which], np.zeros(len(which))
    for name in style.keys() & {"array", "facecolors"}:
        style[name] = np.asarray(style[name])[which]
    style = {"linewidths": 0, "units": "xy", "offset_transform": axes.transData, **style}
    disks = EllipseCollection(size, size, flat, offsets=places, **style)
    axes.add_collection(disks)
    return disks


def radius_marks(axes: Axes, run: Run, frame: int) -> LineCollection | None:
    """A radius of each disk that shows how it has turned; None where disks have no orientation."""
    if "orientation" not in run.disk_data:
        return None
    which, places = with_images(run, run.position[frame])
    angle = run.orientation[frame][which]
    rim = run.radius[which] * np.array([np.cos(angle), np.sin(angle)])
    lines = np.stack([places, places + rim.T], axis=1)
    marks = LineCollection([*lines], colors="black", linewidths=0.6, zorder=1.5)
    axes.add_collection(marks)
    return marks


def band(axes: Axes, x: np.ndarray, y: np.ndarray, error: np.ndarray, **style: Any) -> None:
    """A line with its error."""
    axes.plot(x, y, **style)
    axes.fill_between(x, y - error, y + error, color=style["color"], alpha=0.25, lw=0)


def bars(axes: Axes, height: Estimate, bins: np.ndarray, **style: Any) -> None:
    """A histogram with its errors."""
    axes.stairs(height.mean, bins, **style)
    middle = (bins[1:] + bins[:-1]) / 2
    axes.errorbar(middle, *height, fmt="none", color=style["color"], elinewidth=1)


def noise_band(axes: Axes, count: int, colour: str) -> None:
    """Within which a2 of so many speeds lies in 95 % of all cases if they are Maxwellian."""
    reach = 2 * kurtosis_noise(count)
    axes.axhspan(-reach, reach, color=colour, alpha=0.12, lw=0, zorder=0)


def dilute_limit(axes: Axes, points: np.ndarray, of: str = "") -> None:
    """Points (P, 2) of a solution of the Boltzmann equation as open circles."""
    label = f"{of}dilute limit (Boltzmann equation)"
    axes.plot(*points.T, ls="", marker="o", mfc="none", color="black", label=label)


def species_colours(run: Run) -> list[str]:
    """A colour for each disk."""
    return [COLOURS[(s - 1) % len(COLOURS)] for s in run.species]


def species_legend(figure: Figure, run: Run) -> None:
    """Which colour is which species, below all panels; nothing for a single one."""
    handles = [
        Line2D([], [], ls="", marker="o", color=COLOURS[k % len(COLOURS)])
        for k in range(len(run.names))
    ]
    if len(run.names) > 1:
        figure.legend(handles, run.names, loc="outside lower center", ncols=len(run.names))


def warn(figure: Figure, notes: Sequence[str]) -> None:
    """Below the figure, what speaks against its numbers; at most three notes in full."""
    if not notes:
        return
    rest = len(notes) - 3
    more = [f"and {rest} more warning{'s' * (rest > 1)}, as printed"] if rest > 0 else []
    lines = [wrap(f"Warning: {note}", 15 * int(figure.get_figwidth())) for note in notes[:3]]
    text = "\n".join([line for part in lines for line in part] + more)
    if figure.legends:  # one lies where the label would
        figure.legends[0].set_title(text, FontProperties(size=9))
        figure.legends[0].get_title().set_color("firebrick")
    else:
        figure.supxlabel(text, fontsize=9, color="firebrick")


def save(figure: Figure, path: Path, runs: list[Run], title: str) -> None:
    """Write the figure, its source in the metadata; missing folders are made."""
    sources = ", ".join(run.path.name for run in runs[:20]) + (", ..." if len(runs) > 20 else "")
    commits = sorted({str(run.provenance.get("git_commit", "unknown")) for run in runs})
    origin = f"{sources} (ricochet {', '.join(commits)})"
    if path.suffix not in (".pdf", ".svg", ".png"):
        raise RunError(f"{path}: a figure ends in .pdf, .svg, .png")
    key = "Subject" if path.suffix == ".pdf" else "Description"
    figure.savefig(destination(path), metadata={"Title": title, key: origin})
    plt.close(figure)
