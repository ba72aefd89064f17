"""Draw the trajectories of disks through the frames of a run.

    python post/trajectory.py runs/sinai.h5 -o sinai.png               all disks (at most 12)
    python post/trajectory.py runs/sinai.h5 --disks 1,5 --frames :200  two of them, 200 frames

Straight lines connect the positions in successive frames.  Without gravity these paths are exact if
the run has a frame at every event (output.frames_every_events = 1).  Several runs are drawn side by
side.
"""

import argparse
from typing import Any

from ricochet import Run, RunError
from ricochet.figures import drawing, sheet
from ricochet.figures.drawing import plt
from ricochet.reports.options import chosen_disks, chosen_frames
from ricochet.script import add_width, command_line, launch, report

import numpy as np
from matplotlib.patches import Circle

MARGIN = 0.35  # width of the axis labels of a panel [inches]
GAP = 0.15  # gap between rows of panels [inches]


def paths_of(run: Run, disks: list[int], frames: list[int]) -> list[np.ndarray]:
    """Return the path (T', 2) of each disk through the given frames.

    A path that crosses a periodic side is extended beyond this side and continues from the opposite
    side of the box. A row of NaN separates the two pieces. If a disk is recycled, a row of NaN
    separates its paths before and after this moment.
    """
    paths = np.moveaxis(run.position[frames][:, disks], 1, 0)
    counts, images = np.zeros(paths.shape[:2]), np.zeros(paths.shape, dtype=int)
    if "recycled" in run.nature:
        if run.recycled is None:
            raise RunError(f"{run.path}: has no recycled in its frames")
        counts = np.moveaxis(run.recycled[frames][:, disks], 1, 0)
    if run.image is not None:
        images = np.moveaxis(run.image[frames][:, disks], 1, 0)
    return [drawn(*track, run.edges) for track in zip(paths, images, counts, strict=True)]


def drawn(path: np.ndarray, image: np.ndarray, count: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return a path (T, 2) with a row of NaN wherever the number `count` (T,) changes."""
    cuts = np.flatnonzero(np.diff(count)) + 1
    pieces = []
    for own, crossed in zip(np.split(path, cuts), np.split(image, cuts), strict=True):
        pieces += [wrapped(own, crossed, edges), np.full((1, 2), np.nan)]
    return np.concatenate(pieces[:-1])


def wrapped(path: np.ndarray, image: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return a path (T, 2), extended past the periodic side at both ends of each crossing."""
    rows = [path[:1]]
    gap = np.full((1, 2), np.nan)
    for start, end, jump in zip(path[:-1], path[1:], np.diff(image, axis=0), strict=True):
        step = np.array([start, end + jump * edges])
        rows.append(step[1:])
        corners = {(i, j) for i in (0, jump[0]) for j in (0, jump[1])} - {(0, 0)}
        for corner in sorted(corners, key=lambda c: tuple(c) == tuple(jump)):
            rows += [gap, step - corner * edges]
    return np.concatenate(rows)


def has_every_event(run: Run, frames: list[int]) -> bool:
    """Return whether straight lines through the frames are the exact paths of the disks."""
    all_events = run.parameter("output", "frames_every_events", 0) == 1
    return all_events and bool(np.all(np.diff(frames) == 1)) and "gravity" not in run.nature


def draw_paths(axes: plt.Axes, run: Run, disks: list[int], frames: list[int]) -> None:
    """Draw the paths of the chosen disks, and all disks in the last frame."""
    drawing.draw_box(axes, run, run.time[frames[-1]])
    others = np.full(run.n_disks, "0.85")
    others[disks] = "none"
    sizes = drawing.drawn_diameters(axes, run)
    drawing.disk_collection(axes, run, run.position[frames[-1]], facecolors=others, zorder=0.8)
    for order, (disk, path) in enumerate(zip(disks, paths_of(run, disks, frames), strict=True)):
        colour = drawing.COLOURS[order % len(drawing.COLOURS)]
        alpha = float(np.clip(60 / len(path), 0.25, 1)) ** 0.5
        axes.plot(*path.T, color=colour, lw=0.8, alpha=alpha, zorder=1)
        axes.plot(*path[0], marker="x", color=colour, zorder=4)
        axes.add_patch(Circle(path[-1], sizes[disk] / 2, color=colour, lw=0, zorder=0.9))
    lines = "" if has_every_event(run, frames) else ",  lines join frames"
    letters = sheet.title_letters(axes.figure.get_figwidth() / axes.get_gridspec().ncols - MARGIN)
    titles = (
        f"{run.parameter('run', 'title') or run.path.stem}",
        f"{drawing.caption([run])}{lines}",
        f"t = {run.time[frames[0]]:.4g} (crosses) to {run.time[frames[-1]]:.4g} (disks)"
        f"{drawing.note_on_size(axes, run)}",
    )
    axes.set_title(
        "\n".join(line for title in titles for line in sheet.wrap(title, letters)),
        parse_math=False,
        pad=18,  # above the labels of the walls
    )


def main() -> None:
    parser = command_line(__doc__, "trajectory.png", frames=None, count=None, disks=None)
    add_width(parser, "13cm for each run")
    args = parser.parse_args()
    with plt.style.context(sheet.text_style(args.width)):
        figure, rows = draw(args)
    report(args, figure, rows)


def draw(args: argparse.Namespace) -> tuple[plt.Figure, list[dict[str, Any]]]:
    """Draw the paths of all runs side by side; return also the rows of the table."""
    size, rows = len(args.runs), []
    tallest = min(max(map(drawing.aspect_of, args.runs)), 2.0)
    paper = sheet.width_of(args.width)[0] if args.width else 0.0
    columns = 1 if 0 < paper < sheet.STACKED else size
    width, below = (paper * sheet.CM / columns if paper else 5.2), size // columns
    height = (width - MARGIN) * tallest + 1.15  # the title has three lines
    shape = {"squeeze": False, "figsize": (width * columns, height * below)}
    figure, panels = plt.subplots(below, columns, **shape)
    for axes, run in zip(panels.flat, args.runs, strict=True):
        frames = chosen_frames(run, args.frames, args.count)
        disks = chosen_disks(run, args.disks or list(range(1, 1 + min(12, run.n_disks))))
        draw_paths(axes, run, disks, frames)
        place_at = run.position.__getitem__ if "recycled" in run.nature else run.unwrapped
        ends = np.hstack([place_at(frames[end])[disks] for end in (0, -1)]).tolist()
        names = ("x_first", "y_first", "x_last", "y_last")
        for disk, places in zip(disks, ends, strict=True):
            row = {"run": run.path.name, "disk": disk + 1, "frames": len(frames)}
            rows.append(row | dict(zip(names, places, strict=True)))
    longest = max(axes.get_title("left").count("\n") + 1 for axes in panels.flat)
    line = sheet.title_size() * sheet.LINE / 72  # [inches]
    more = line * max(0, longest - 3) + (GAP if args.width else 0)
    figure.set_figheight(below * (height + more))
    return figure, rows


if __name__ == "__main__":
    launch(main)
