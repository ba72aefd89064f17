"""A crater: before and after, energy in time, and its size.

    python post/crater.py runs/crater.h5 -o crater.png
    python post/crater.py runs/scan/*.h5 --csv craters.csv     sizes of many runs, no figure

The projectile is the species of that name, or else the only disk that moves at the start; the
others are the bed.  Sizes: `hit`, bed disks that collided with anything; `displaced`, bed disks
now further than one radius from their first position; `width` and `depth`, the extent of the first
positions of the displaced ones, from the rim of the bed downwards.  A crater is marked if the box
takes part (wall hits are more than 1 % of the number of disks), or if the run ended with more
energy left than `stop.energy_fraction`.
"""

from ricochet import Run
from ricochet.crater import (
    Crater,
    bed,
    box_takes_part,
    crater,
    displaced,
    ended_by_time,
    energy_fraction,
    packing_field,
    projectile,
)
from ricochet.drawing import COLOURS, LABELS, WALL, caption, disk_collection, draw_box, plt
from ricochet.script import command_line, launch, read_all, report

import numpy as np
import scipy
from matplotlib.ticker import LogLocator


def draw_state(axes: plt.Axes, run: Run, frame: int, values: np.ndarray, limits: tuple):
    """Bed disks coloured by value, the projectile black."""
    draw_box(axes, run)
    colours = plt.get_cmap("viridis")(plt.Normalize(*limits)(values))
    colours[projectile(run)] = (0, 0, 0, 1)
    disk_collection(axes, run, run.position[frame], facecolors=colours)
    axes.set_title(f"t = {run.time[frame]:.4g}")


def draw_hull(axes: plt.Axes, run: Run) -> None:
    """The outline of the crater: hull of the first positions of the displaced disks."""
    points = run.position[0][displaced(run)]
    if len(points) > 3:
        hull = scipy.spatial.ConvexHull(points, qhull_options="QJ")  # QJ: also for a row
        ring = points[hull.vertices]
        axes.fill(*ring.T, fill=False, edgecolor=COLOURS[1], lw=1.4, zorder=4)
        axes.plot([], [], color=COLOURS[1], lw=1.4, label="hull of the displaced disks")
        axes.legend(loc="upper left")


def draw_cavity(axes: plt.Axes, run: Run) -> None:
    """The outline of the hole: where the packing is half of what it was."""
    before, after = packing_field(run, 0), packing_field(run, -1)
    level = 0.5 * np.quantile(before[2][before[2] > 0.05], 0.5)
    axes.contour(*after, levels=[level], colors=[COLOURS[1]], linewidths=1.2, zorder=4)
    axes.plot([], [], color=COLOURS[1], lw=1.2, label="half of the first packing")
    axes.legend(loc="upper left")


def draw_energy(axes: plt.Axes, run: Run) -> None:
    """Energy left, and collisions, against time."""
    time, energy = run.observable("all/kinetic_energy")
    axes.semilogy(time, energy / energy[0], color=COLOURS[0], label="kinetic energy $E/E_0$")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("")
    fraction = run.parameter("stop", "energy_fraction")
    if fraction and 0 < float(fraction) < 1:
        axes.axhline(float(fraction), **{**WALL, "color": "0.6", "linewidth": 0.8}, ls="--")
    axes.set(xlabel="time (reduced units)", ylabel="$E/E_0$", ylim=(None, 1.3))
    twin = axes.twinx()
    twin.plot(*run.observable("collisions"), color=COLOURS[1], ls="-.", label="collisions")
    twin.set(ylabel="pair collisions", ylim=(0, None))
    twin.spines["right"].set_visible(True)
    axes.set_box_aspect(0.9)
    axes.legend(
        handles=[axes.lines[0], twin.lines[0]],
        loc="upper center",
        bbox_to_anchor=(0.5, 1.14),
        ncols=2,
    )


def draw(run: Run, size: Crater) -> plt.Figure:
    """Before, after, collisions per disk, energy."""
    figure, ((before, after), (hits, energy)) = plt.subplots(2, 2, figsize=(9.4, 10.6))
    moved, radius = run.displacement(-1), float(np.median(run.radius))
    limits = (0, float(np.quantile(moved[displaced(run)], 0.9)) if size.displaced else radius)
    draw_state(before, run, 0, moved, limits)
    draw_hull(before, run)
    draw_state(after, run, -1, moved, limits)
    draw_cavity(after, run)
    scale = plt.cm.ScalarMappable(plt.Normalize(*limits), "viridis")
    figure.colorbar(
        scale,
        ax=[before, after],
        location="bottom",
        shrink=0.6,
        aspect=40,
        extend="max",
        pad=0.02,
        label=f"{LABELS['displacement']} at the end",
    )
    count = np.log10(1.0 + run.collisions[-1])
    top = float(np.ceil(count[bed(run)].max())) or 1.0
    draw_state(hits, run, 0, count, (0, top))
    hits.set_title("collisions of each disk, drawn at its first position")
    scale = plt.cm.ScalarMappable(plt.Normalize(0, top), "viridis")
    bar = figure.colorbar(
        scale, ax=hits, location="bottom", shrink=0.8, aspect=30, pad=0.02, label="collisions"
    )
    ticks = [0, *(10**k for k in range(int(top) + 1))]
    bar.set_ticks(np.log10(1.0 + np.array(ticks[:-1])), labels=ticks[:-1])
    draw_energy(energy, run)
    tip = projectile(run)
    lying = np.flatnonzero(bed(run))[0]
    figure.suptitle(
        f"{caption([run])},  projectile: mass {run.mass[tip] / run.mass[lying]:.4g} m, radius "
        f"{run.radius[tip] / run.radius[lying]:.4g} r, speed {run.speed(0)[tip]:.4g}\n"
        f"crater: {size.hit} disks hit, {size.displaced} displaced by more than r, width "
        f"{size.width:.3f}, depth {size.depth:.3f}",
        fontsize=10,
    )
    return figure


def marks(run: Run, size: Crater) -> dict[str, int]:
    """What cut the crater short, as in `crater_scan.py`."""
    return {
        "ended_by_time": int(ended_by_time(run, size)),
        "box_takes_part": int(box_takes_part(run, size.wall_collisions)),
    }


def notes(run: Run, size: Crater) -> list[str]:
    """The same in words."""
    found, name = marks(run, size), run.path.name
    wanted = f"not the {100 * energy_fraction(run):g} % of stop.energy_fraction"
    left = f"{name}: {100 * size.energy_left:.3g} % of the energy is left, {wanted}"
    box = f"{name}: the crater reaches the floor or the sides, {size.wall_collisions} wall hits"
    return [left] * found["ended_by_time"] + [box] * found["box_takes_part"]


def main() -> None:
    args = command_line(__doc__, "crater.png").parse_args()
    runs = read_all(args.runs)
    sizes = [crater(run) for run in runs]
    figure = draw(runs[0], sizes[0]) if len(runs) == 1 else None
    members = list(zip(runs, sizes, strict=True))
    table = [{"run": run.path.name, **size._asdict(), **marks(run, size)} for run, size in members]
    report(args, runs, "Crater", figure, table, notes=[n for one in members for n in notes(*one)])


if __name__ == "__main__":
    launch(main)
