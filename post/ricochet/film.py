"""A film of a run: disks of true size in time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.animation import FuncAnimation

from .drawing import (
    LABELS,
    caption,
    chosen_colour,
    colour_map,
    disk_collection,
    draw_box,
    move_disks,
    move_marks,
    plt,
    radius_marks,
    species_colours,
    species_legend,
    values_of,
    warn,
)
from .reader import Run, RunError


def colour_limits(run: Run, frames: Sequence[int], colour: str) -> tuple[float, float]:
    """A scale for the whole film, from some of its frames."""
    if colour == "psi6":
        return -180.0, 180.0
    some = frames[:: max(1, len(frames) // 20)]
    top = max(float(np.quantile(values_of(run, frame, colour), 0.99)) for frame in some)
    return 0.0, top or 1.0


def animate(
    run: Run, frames: Sequence[int] | None = None, colour: str | None = None, fps: float = 25
) -> FuncAnimation:
    """A film of these frames, all by default, `fps` of them per second.

    `colour` is "species" or a word of `drawing.LABELS`.  A notebook in the style of the scripts
    (`drawing.STYLE`) shows the film with buttons; its `save(path)` writes a file.
    """
    frames = range(run.frames) if frames is None else frames
    if not len(frames):
        raise RunError(f"{run.path}: no frames for a film")
    colour = chosen_colour(run, colour)
    aspect = run.edges[1] / run.edges[0]
    height = min(6.4, 6.4 * aspect)
    width = height / aspect + (1.2 if colour != "species" else 0.2)
    figure, axes = plt.subplots(figsize=(max(width, 3.6), height + 0.6), dpi=100)
    draw_box(axes, run)

    def colours_of(frame: int) -> dict:
        if colour == "species":
            return {"facecolors": species_colours(run)}
        return {"array": values_of(run, frame, colour)}

    disks = disk_collection(axes, run, run.position[0], **colours_of(0))
    marks = radius_marks(axes, run, frames[0])
    if colour == "species":
        species_legend(figure, run)
    else:
        disks.set(cmap=colour_map(colour), clim=colour_limits(run, frames, colour))
        figure.colorbar(disks, label=LABELS[colour], shrink=0.8, extend="max")
    title = axes.set_title(" ")
    warn(figure, [run.shortcoming] if run.shortcoming else [])
    figure.canvas.draw()
    figure.set_layout_engine("none")  # the layout stays; solving it for each frame is slow

    def show(frame: int) -> None:
        move_disks(disks, run, run.position[frame], **colours_of(frame))
        if marks is not None:
            move_marks(marks, run, frame)
        title.set_text(f"{caption([run])},  t = {run.time[frame]:.4g}")

    film = FuncAnimation(figure, show, frames, interval=1000 / fps, cache_frame_data=False)
    plt.close(figure)  # else a notebook shows the first frame as well
    return film
