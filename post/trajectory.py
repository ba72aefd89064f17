"""Draw the paths of disks through the frames of a run.

    python post/trajectory.py runs/sinai.h5 -o sinai.png                 all disks (at most 12)
    python post/trajectory.py runs/sinai.h5 --disks 1,5 --first 200      two of them, first frames

With a frame at every event (output.frames_every_events = 1) the straight lines between frames
are the exact path of flight without gravity.  Several runs are drawn side by side.
"""

import numpy as np

from drawing import (
    COLOURS,
    caption,
    command_line,
    disk_collection,
    draw_box,
    launch,
    plt,
    positive,
    read_all,
    save,
    whole_numbers,
)
from matplotlib.patches import Circle
from read_run import Run, RunError


def paths_of(run: Run, disks: list[int], count: int | None = None) -> list[np.ndarray]:
    """(T', 2) positions of each disk in the first `count` frames.

    A path that crosses periodic sides goes on beyond them, and comes in from beyond: a row of NaN
    breaks the line between the two pieces.
    """
    paths = list(np.moveaxis(run.position[:count][:, disks], 1, 0))
    if run.image is None:
        return paths
    images = np.moveaxis(run.image[:count][:, disks], 1, 0)
    return [wrapped(*track, run.edges) for track in zip(paths, images, strict=True)]


def wrapped(path: np.ndarray, image: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """The path (T, 2) with each step over a side drawn in every cell that it may touch."""
    rows = [path[:1]]
    gap = np.full((1, 2), np.nan)
    for start, end, jump in zip(path[:-1], path[1:], np.diff(image, axis=0), strict=True):
        step = np.array([start, end + jump * edges])
        rows.append(step[1:])
        corners = {(i, j) for i in (0, jump[0]) for j in (0, jump[1])} - {(0, 0)}
        for corner in sorted(corners, key=lambda c: tuple(c) == tuple(jump)):
            rows += [gap, step - corner * edges]
    return np.concatenate(rows)


def chosen_disks(run: Run, numbers: list[int] | None) -> list[int]:
    """Indices from numbers that count from 1; the first twelve without a choice."""
    for number in numbers or []:
        if not 1 <= number <= run.count:
            raise RunError(f"{run.path}: no disk {number}, there are {run.count}")
    return [number - 1 for number in numbers] if numbers else list(range(min(12, run.count)))


def draw_paths(axes: plt.Axes, run: Run, disks: list[int], count: int) -> None:
    """Paths, with the disk where it is at the end; the others grey."""
    draw_box(axes, run)
    others = np.full(run.count, "0.85")
    others[disks] = "none"
    disk_collection(axes, run, run.position[count - 1], facecolors=others, zorder=0.8)
    for order, (disk, path) in enumerate(zip(disks, paths_of(run, disks, count), strict=True)):
        colour = COLOURS[order % len(COLOURS)]
        alpha = float(np.clip(60 / len(path), 0.25, 1)) ** 0.5
        axes.plot(*path.T, color=colour, lw=0.8, alpha=alpha, zorder=1)
        axes.plot(*path[0], marker="x", color=colour, zorder=4)
        axes.add_patch(Circle(path[-1], run.radius[disk], color=colour, lw=0, zorder=0.9))
    axes.set_title(
        f"{run.parameter('run', 'title') or run.path.stem}\n{caption([run])},  "
        f"t = {run.time[0]:.4g} (crosses) to {run.time[count - 1]:.4g} (disks)"
    )


def main() -> None:
    parser = command_line(__doc__, "trajectory.png")
    parser.add_argument("--disks", type=whole_numbers, help="their numbers from 1, e.g. 1,5,9")
    parser.add_argument("--first", type=positive, metavar="K", help="only the first K frames")
    args = parser.parse_args()
    runs = read_all(args.runs)
    figure, panels = plt.subplots(1, len(runs), squeeze=False, figsize=(5.2 * len(runs), 5.7))
    for axes, run in zip(panels.flat, runs, strict=True):
        count = min(run.frames, args.first or run.frames)
        draw_paths(axes, run, chosen_disks(run, args.disks), count)
    save(figure, args.output, runs, "Paths of disks")


if __name__ == "__main__":
    launch(main)
