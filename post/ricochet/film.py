"""A film of a run: disks of true size in time."""

from collections.abc import Sequence

from matplotlib.animation import FuncAnimation

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
    sides = drawing.draw_box(axes, run, run.time[frames[0]])

    def colours_of(frame: int) -> dict:
        if colour == "species":
            return {"facecolors": drawing.species_colours(run)}
        return {"array": drawing.values_of(run, frame, colour)}

    disks = drawing.disk_collection(axes, run, run.position[0], **colours_of(0))
    marks = drawing.radius_marks(axes, run, frames[0])
    if colour == "species":
        drawing.species_legend(figure, run)
    else:
        limits = (-180, 180) if colour == "psi6" else (0, drawing.scale_top(run, frames, colour))
        disks.set(cmap=drawing.colour_map(colour), clim=limits)
        figure.colorbar(disks, label=drawing.LABELS[colour], shrink=0.8, extend="max")
    title = axes.set_title(" ")
    drawing.warn(figure, [run.shortcoming] if run.shortcoming else [])
    figure.canvas.draw()
    figure.set_layout_engine("none")  # the layout stays; solving it for each frame is slow

    def show(frame: int) -> None:
        drawing.move_sides(sides, run, run.time[frame])
        drawing.move_disks(disks, run, run.position[frame], **colours_of(frame))
        if marks is not None:
            drawing.move_marks(marks, run, frame)
        title.set_text(f"{drawing.caption([run])},  t = {run.time[frame]:.4g}")

    film = FuncAnimation(figure, show, frames, interval=1000 / fps, cache_frame_data=False)
    plt.close(figure)  # else a notebook shows the first frame as well
    return film
