"""A film of a run: disks of true size in time."""

from collections.abc import Sequence

from matplotlib.animation import FuncAnimation
from matplotlib.collections import EllipseCollection

from . import drawing
from .drawing import plt
from .reader import Run, RunError


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
    colour = drawing.chosen_colour(run, colour)
    aspect = drawing.aspect_of(run)
    height = min(6.4, 6.4 * aspect)
    width = height / aspect + (1.2 if colour != "species" else 0.2)
    figure, axes = plt.subplots(figsize=(max(width, 3.6), height + 0.6), dpi=100)
    style = {}
    if colour != "species":
        limits = (-180, 180) if colour == "psi6" else (0, drawing.scale_top(run, frames, colour))
        style = {"cmap": drawing.colour_map(colour), "clim": limits}

    def show(frame: int) -> EllipseCollection:
        axes.clear()
        drawing.draw_box(axes, run, run.time[frame])
        if colour == "species":
            style["facecolors"] = drawing.species_colours(run)
        else:
            style["array"] = drawing.values_of(run, frame, colour)
        drawing.radius_marks(axes, run, frame)
        axes.set_title(f"{drawing.caption([run])},  t = {run.time[frame]:.4g}")
        return drawing.disk_collection(axes, run, run.position[frame], **style)

    disks = show(frames[0])
    if colour == "species":
        drawing.species_legend(figure, run)
    else:
        figure.colorbar(disks, label=drawing.LABELS[colour], shrink=0.8, extend="max")
    drawing.warn(figure, [run.shortcoming] if run.shortcoming else [])
    figure.canvas.draw()
    figure.set_layout_engine("none")  # the layout stays; solving it for each frame is slow
    film = FuncAnimation(figure, show, frames, interval=1000 / fps, cache_frame_data=False)
    plt.close(figure)  # else a notebook shows the first frame as well
    return film
