"""Crater of a projectile: pictures before and after the impact, energy, and crater size.

    python post/crater.py runs/crater.h5 -o crater.png
    python post/crater.py runs/scan/*.h5 --csv craters.csv     sizes of many runs, no figure

The projectile is the species 'projectile'.  If no species is called 'projectile', the projectile is
the only disk that moves at the start.  All other disks form the bed.  The script measures six
quantities that describe the size of a crater: `hit`, `displaced`, `width`, `depth`, `hole_width`
and `hole_depth`.  `hit` is the number of bed disks that collided at least once.  `displaced` is the
number of bed disks whose displacement in the last frame is larger than their radius.  `width` and
`depth` are the extent of the region from which disks were displaced; the depth is measured
downwards from the surface of the bed.  `hole_width` and `hole_depth` are the extent of the hole.
The hole is the region in which the packing fraction, averaged over a few disks, is smaller than
half of the initial packing fraction of the bed.  The script rejects runs in which the bed moves
without a projectile, for example under gravity.  The table marks a crater as affected by the walls
if the number of collisions with walls exceeds 1 % of the number of disks.  The table also marks a
crater if the run ended before the energy had fallen to the fraction `stop.energy_fraction` of its
initial value.
"""

from ricochet import Run, crater, drawing
from ricochet.analysis.crater import Crater, bed, displaced, projectile
from ricochet.figures.drawing import COLOURS, WALL, caption, disk_collection, draw_box, plt
from ricochet.script import command_line, launch, report

import numpy as np
import scipy
from matplotlib.ticker import LogLocator


def draw_state(axes: plt.Axes, run: Run, frame: int, values: np.ndarray, limits: tuple):
    """Draw the bed disks with colours that show the given values, and the projectile in black."""
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
    vertices = scipy.spatial.ConvexHull(points, qhull_options="QJ").vertices  # QJ: also for a row
    return points[np.append(vertices, vertices[0])]


def draw_outline(axes: plt.Axes, ring: np.ndarray, label: str) -> None:
    """Draw the outline of a region, unless the outline is empty."""
    if len(ring):
        axes.plot(*ring.T, color=COLOURS[1], lw=1.4, zorder=4, label=label)
        axes.legend(loc="upper left")


def draw_energy(axes: plt.Axes, run: Run) -> None:
    """Draw the remaining energy and the number of collisions against time."""
    time, energy = run.observable("all/kinetic_energy")
    axes.semilogy(time, energy / energy[0], color=COLOURS[0], label="kinetic energy $E/E_0$")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("")
    fraction = run.parameter("stop", "energy_fraction")
    if fraction and 0 < float(fraction) < 1:
        axes.axhline(float(fraction), **{**WALL, "color": "0.6", "linewidth": 0.8}, ls="--")
    axes.set(xlabel=run.units.label("time"), ylabel="$E/E_0$", ylim=(None, 1.3))
    twin = axes.twinx()
    twin.plot(*run.observable("collisions"), color=COLOURS[1], ls="-.", label="collisions")
    twin.set(ylabel="pair collisions", ylim=(0, None))
    twin.spines["right"].set_visible(True)
    axes.set_box_aspect(0.9)
    lines = [axes.lines[0], twin.lines[0]]
    axes.legend(handles=lines, loc="upper center", bbox_to_anchor=(0.5, 1.14), ncols=2)


def draw(run: Run, size: Crater) -> plt.Figure:
    """Draw the bed before and after the impact, collisions per disk, and the energy."""
    figure, ((before, after), (hits, energy)) = plt.subplots(2, 2, figsize=(9.4, 10.6))
    moved = run.displacement(-1)
    limits = (0, drawing.scale_top(run, [run.n_frames - 1], "displacement"))
    draw_state(before, run, 0, moved, limits)
    draw_outline(before, hull(run), "hull of the displaced disks")
    draw_state(after, run, -1, moved, limits)
    draw_outline(after, crater.hole(run), "hole: less than half of the bed's packing")
    below = {"location": "bottom", "pad": 0.02}
    scale = plt.cm.ScalarMappable(plt.Normalize(*limits), "viridis")
    label = f"{drawing.label_of(run, 'displacement')} at the end"
    style = {"shrink": 0.6, "aspect": 40, "extend": "max", "label": label, **below}
    figure.colorbar(scale, ax=[before, after], **style)
    count = np.log10(1.0 + run.event_count[-1])
    top = float(np.ceil(count[bed(run)].max())) or 1.0
    draw_state(hits, run, 0, count, (0, top))
    hits.set_title("collisions of each disk, drawn at its first position")
    scale = plt.cm.ScalarMappable(plt.Normalize(0, top), "viridis")
    bar = figure.colorbar(scale, ax=hits, shrink=0.8, aspect=30, label="collisions", **below)
    ticks = np.array([0, *(10**k for k in range(0, int(top), 1 + int(top) // 5))])
    bar.set_ticks(np.log10(1.0 + ticks), labels=[f"{tick:g}" for tick in ticks])
    draw_energy(energy, run)
    tip, lying = projectile(run), bed(run)
    mass, radius = (of[tip] / of[lying].mean() for of in (run.mass, run.radius))
    figure.suptitle(
        f"{caption([run])},  projectile: mass {mass:.4g} m, radius {radius:.4g} r, "
        f"speed {run.speed(0)[tip]:.4g}\n"
        f"hole: width {size.hole_width:.3f}, depth {size.hole_depth:.3f};  {size.hit} disks hit;  "
        f"{size.displaced} displaced by more than r, from a width {size.width:.3f}, depth "
        f"{size.depth:.3f}"
    )
    return figure


def main() -> None:
    args = command_line(__doc__, "crater.png").parse_args()
    rows, notes = [], []
    for run in args.runs:
        size, name = crater.crater(run), run.path.name
        by_time = crater.ended_by_time(run, size)
        box = crater.box_takes_part(run, size.side_collisions)
        marks = {"ended_by_time": int(by_time), "box_takes_part": int(box)}
        rows.append({"run": name, **size._asdict(), **marks})
        left = f"{name}: {100 * size.energy_left:.3g} % of the energy is left, not the "
        left += f"{100 * crater.energy_fraction(run):g} % of stop.energy_fraction"
        walls = f"{size.side_collisions} wall hits"
        walls = f"{name}: the crater reaches the floor or the sides, {walls}"
        notes += [left] * by_time + [walls] * box
    figure = draw(args.runs[0], size) if len(args.runs) == 1 else None
    report(args, figure, rows, notes=notes)


if __name__ == "__main__":
    launch(main)
