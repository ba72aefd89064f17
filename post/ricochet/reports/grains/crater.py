"""Impact of a projectile: pictures before and after the impact, energy, and crater size."""

from types import SimpleNamespace

import numpy as np
import scipy
from matplotlib.ticker import LogLocator

from ...analysis import crater
from ...analysis.crater import Crater, bed, displaced, projectile
from ...figures import drawing
from ...figures.drawing import COLOURS, WALL, caption, disk_collection, draw_box, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...reading.reader import Run
from ..groups import Group, each_run
from ..registry import Analysis
from ..result import Result

BELOW = {"location": "bottom", "pad": 0.02, "shrink": 0.9, "aspect": 30}  # position of a colour bar


def draw_state(axes: plt.Axes, run: Run, frame: int, values: np.ndarray, limits: tuple):
    """Draw the bed disks, coloured by the given values, and the projectile in black."""
    draw_box(axes, run, run.time[frame])
    colours = plt.get_cmap("viridis")(plt.Normalize(*limits)(values))
    colours[projectile(run)] = (0, 0, 0, 1)
    disk_collection(axes, run, run.position[frame], facecolors=colours)
    axes.set_title(f"t = {run.time[frame]:.4g}")


def hull(run: Run) -> np.ndarray:
    """Return the convex hull (P, 2) of the initial positions of displaced disks, or no points."""
    points = run.position[0][displaced(run)]
    if len(points) < 4:
        return points[:0]
    # QJ: allows that all points lie on a line
    vertices = scipy.spatial.ConvexHull(points, qhull_options="QJ").vertices
    return points[np.append(vertices, vertices[0])]


def draw_outline(axes: plt.Axes, ring: np.ndarray, colour: str, label: str) -> None:
    """Draw the outline of a region, unless it is empty."""
    if len(ring):
        axes.plot(*ring.T, color=colour, lw=1.4, zorder=4, label=label)
        legend_above(axes)


def draw_displacements(axes: plt.Axes, run: Run, frame: int) -> None:
    """Draw the bed before or after the impact, coloured by the displacements of the disks."""
    limits = (0, drawing.scale_top(run, [run.n_frames - 1], "displacement"))
    draw_state(axes, run, frame, run.displacement(-1), limits)
    if frame == 0:
        draw_outline(axes, hull(run), COLOURS[1], "hull of the displaced disks")
    else:
        draw_outline(axes, crater.hole(run), COLOURS[3], "hole: below half the packing")
    scale = plt.cm.ScalarMappable(plt.Normalize(*limits), "viridis")
    label = f"{drawing.label_of(run, 'displacement')} at the end"
    axes.figure.colorbar(scale, ax=axes, extend="max", label=label, **BELOW)


def draw_hits(axes: plt.Axes, run: Run) -> None:
    """Draw each disk at its initial position, coloured by its number of collisions."""
    count = np.log10(1.0 + run.event_count[-1])
    top = float(np.ceil(count[bed(run)].max())) or 1.0
    draw_state(axes, run, 0, count, (0, top))
    axes.set_title("collisions, at the first positions")
    scale = plt.cm.ScalarMappable(plt.Normalize(0, top), "viridis")
    bar = axes.figure.colorbar(scale, ax=axes, label="collisions of a disk", **BELOW)
    ticks = np.array([0, *(10**k for k in range(0, int(top), 1 + int(top) // 5))])
    bar.set_ticks(np.log10(1.0 + ticks), labels=[f"{tick:g}" for tick in ticks])


def draw_energy(axes: plt.Axes, run: Run) -> None:
    """Plot the remaining energy and the number of collisions as functions of time."""
    time, energy = run.observable("all/kinetic_energy")
    axes.semilogy(time, energy / energy[0], color=COLOURS[0], label="kinetic energy")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("")
    fraction = run.parameter("stop", "energy_fraction")
    if fraction and 0 < float(fraction) < 1:
        axes.axhline(float(fraction), **{**WALL, "color": "0.6", "linewidth": 0.8}, ls="--")
    axes.set(xlabel=run.units.label("time"), ylabel="$E/E_0$", ylim=(None, 1.3))
    twin = axes.twinx()
    twin.plot(*run.observable("collisions"), color=COLOURS[4], ls="-.")
    twin.set(ylabel="pair collisions", ylim=(0, None))
    twin.spines["right"].set_visible(True)
    axes.plot([], [], color=COLOURS[4], ls="-.", label="collisions")
    legend_above(axes)


def draw(result: Result) -> Sheet | None:
    """Draw the bed before and after the impact, collisions per disk, and the energy of one run."""
    if len(result.runs) > 1:
        return None
    (run,), size = result.runs, result.groups[0].values
    aspect = 1.1 * max(1.0, drawing.aspect_of(run)) + 0.15
    before = Panel("before", draw_displacements, (run, 0), aspect)
    after = Panel("after", draw_displacements, (run, -1), aspect, share_y="before")
    hits = Panel("collisions", draw_hits, (run,), aspect)
    energy = Panel("energy", draw_energy, (run,), aspect)
    return Sheet([[before, after], [hits, energy]], caption([run]), notes=sizes_of(run, size))


def sizes_of(run: Run, size: Crater) -> list[str]:
    """Return texts that describe the projectile and the crater."""
    tip, lying = projectile(run), bed(run)
    mass, radius = (of[tip] / of[lying].mean() for of in (run.mass, run.radius))
    return [
        f"Projectile: mass {mass:.4g} m, radius {radius:.4g} r, speed {run.speed(0)[tip]:.4g}.",
        f"Hole (below half of the bed's packing fraction): width {size.hole_width:.3f}, "
        f"depth {size.hole_depth:.3f}. {size.hit} disks hit. "
        f"{size.displaced} displaced by more than r, from a width {size.width:.3f}, depth "
        f"{size.depth:.3f}.",
    ]


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return the size of the crater in each run."""
    rows, warnings = [], []
    for group in groups:
        (run,), name = group.runs, group.runs[0].label
        group.values = size = crater.crater(run)
        by_time = crater.ended_by_time(run, size)
        box = crater.box_takes_part(run, size.side_collisions)
        marks = {"ended_by_time": int(by_time), "box_takes_part": int(box)}
        rows.append({"run": name, **size._asdict(), **marks})
        left = f"{name}: {100 * size.energy_left:.3g} % of the energy is left, not the "
        left += f"{100 * crater.energy_fraction(run):g} % of stop.energy_fraction"
        walls = f"{size.side_collisions} wall hits"
        walls = f"{name}: the crater reaches the floor or the sides, {walls}"
        warnings += [left] * by_time + [walls] * box
    notes = [
        "Dashed: fraction of the energy at which a run ends. m, r: mass and radius of a bed disk."
    ]
    return Result(rows, notes=notes, warnings=warnings)


ANALYSIS = Analysis(compute, draw, group_by=each_run)
