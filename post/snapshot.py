"""Draw frames of a run: disks, walls and obstacles to scale.

    python post/snapshot.py runs/gas.h5 -o gas.png                     the last frame
    python post/snapshot.py runs/gas.h5 --frames 0,10,-1 -o gas.png    chosen frames side by side
    python post/snapshot.py runs/gravity.h5 --count 12 --quiver        twelve frames, evenly spread

The option --colour selects what the colours show.  The choices are species, speed, displacement,
collisions, spin and psi6. With --colour displacement, colours show the distance of each disk from
its position in the first frame.  With --colour collisions, colours show the number of collisions of
each disk since the start.  The spin is the angular velocity of disks that can rotate.  With
--colour psi6, colours show the phase of the bond-orientational order parameter psi6 of each disk,
relative to the phase of the mean of psi6 over all disks.  All frames have the same colour scale,
which begins at 0, unless --per-frame is given.  With --log the colour scale is logarithmic.  If
colours show a quantity other than the species, all disks except those of the first species have an
outline.  A disk that overlaps a periodic side is drawn on both sides of the box.  If disks can
rotate, a line from the centre of each disk shows its orientation.  If the run wrote frames after a
fixed number of events or collisions, the title of each panel contains the number of events or
collisions.  Disks that would be too small to be visible are drawn enlarged, and the title states
the factor.
"""

import argparse

from ricochet import Run, drawing
from ricochet.analysis.thermodynamics import packing
from ricochet.figures.drawing import plt
from ricochet.reading.units import UNNAMED
from ricochet.script import chosen_frames, command_line, frame_list, launch, report

import numpy as np
from matplotlib.quiver import Quiver
from matplotlib.colors import LogNorm, Normalize, to_rgba_array


def scale(values: np.ndarray, log: bool, colour: str) -> Normalize:
    """Return a colour scale for the given values; the few largest values exceed the scale."""
    if colour in ("psi6", "spin"):
        top = np.quantile(np.abs(values), 0.995) or 1.0
        return Normalize(*drawing.limits_of(colour, top))
    moved = values[values > 0]
    if not len(moved) or not log:
        return Normalize(0, drawing.top_of(moved))
    low, top = np.quantile(moved, (0.005, 0.995))
    return LogNorm(min(low, top / 1.01), top)


def draw_key(axes: plt.Axes, run: Run, arrows: Quiver, longest: float) -> None:
    """Draw a reference arrow above a panel, with the speed that corresponds to its length.

    The arrow is above the title of the panel if both do not fit side by side.
    """
    power = 10.0 ** np.floor(np.log10(longest))
    speed = max(step * power for step in (1, 2, 5) if step * power <= longest)
    unit = run.units.name("speed")
    words = f"speed {speed:g}" + f" {unit}" * (unit != UNNAMED.name("speed"))
    place = {"coordinates": "axes", "labelpos": "W", "color": "black"}
    title = axes.get_title("left")
    panel, size = axes.get_window_extent(), axes.title.get_fontsize() * axes.figure.dpi / 72
    beside = 0.6 * size * len(title + words) < 0.75 * panel.width  # 0.6: width of a character
    if not beside:
        axes.set_title(f"\n{title}")
    height = 0.04 if beside else 0.03 + 1.5 * size / panel.height
    axes.quiverkey(arrows, 0.9, 1 + height, speed, words, **place)


def draw(run: Run, frames: list[int], colour: str, args: argparse.Namespace) -> plt.Figure:
    """Draw a picture of the disks for each frame."""
    aspect = drawing.aspect_of(run)
    rows, columns = drawing.panel_grid(len(frames), aspect)
    width = min(10.5, (6.0 if len(frames) == 1 else 3.4) * columns) / columns
    figure, panels = plt.subplots(
        rows, columns, squeeze=False, figsize=(width * columns + 0.9, width * aspect * rows + 0.7)
    )
    if colour != "species":
        values = np.array([drawing.values_of(run, frame, colour) for frame in frames])
        whole = scale(values, args.log, colour)
        bar = {"label": drawing.label_of(run, colour)}
    longest = max(float(np.max(run.speed(frame))) for frame in frames) or 1.0
    # The longest velocity arrow is as long as a tenth of the box.
    arrows = {"angles": "xy", "scale_units": "xy", "scale": longest / (0.1 * run.edges.max())}
    arrows |= {"width": 0.005, "zorder": 4, "color": "0.2"}
    if colour == "species":  # darker shades of the colours of the disks, for contrast
        darker = (0.6, 0.6, 0.6, 1)
        arrows["color"] = to_rgba_array(drawing.species_colours(run)) * darker
    for k, axes in enumerate(panels.flat):
        if k >= len(frames):
            axes.set_visible(False)
            continue
        drawing.draw_box(axes, run, run.time[frames[k]])
        if colour == "species":
            style = {"facecolors": drawing.species_colours(run)}
        else:
            norm = scale(values[k], args.log, colour) if args.per_frame else whole
            # A logarithmic colour scale cannot show the value 0.
            seen = np.maximum(values[k], norm.vmin) if args.log else values[k]
            style = {"array": seen, "norm": norm, "cmap": drawing.colour_map(colour)}
        disks = drawing.disk_collection(axes, run, run.position[frames[k]], **style)
        drawing.radius_marks(axes, run, frames[k])
        if colour != "species" and args.per_frame:
            beyond = drawing.exceeded(values[k], norm.vmin, norm.vmax)
            figure.colorbar(disks, ax=axes, shrink=0.7, extend=beyond, **bar)
        axes.set_title(drawing.moment(run, frames[k]))
        if args.quiver:
            drawn = axes.quiver(*run.position[frames[k]].T, *run.velocity[frames[k]].T, **arrows)
            if k == 0:
                draw_key(axes, run, drawn, longest)
    if colour == "species":
        drawing.species_legend(figure, run)
    else:
        drawing.species_legend(figure, run, by_outline=True)
    if colour != "species" and not args.per_frame:
        beyond = drawing.exceeded(values, whole.vmin, whole.vmax)
        figure.colorbar(disks, ax=panels, shrink=0.8, aspect=30, extend=beyond, **bar)
    fluid = not run.nature & {"gravity", "obstacles"} and run.n_disks > 1
    dense = f",  η = {packing(run):.4g}" if fluid else ""
    larger = drawing.note_on_size(panels.flat[0], run)
    figure.suptitle(drawing.caption([run]) + dense + larger)
    return figure


def main() -> None:
    parser = command_line(__doc__, "snapshot.png", one=True, frames=None, count=None, colour=None)
    parser.add_argument("--quiver", action="store_true", help="draw velocities as arrows")
    parser.add_argument("--log", action="store_true", help="use a logarithmic colour scale")
    parser.add_argument(
        "--per-frame", action="store_true", help="use a separate colour scale for each frame"
    )
    args = parser.parse_args()
    (run,) = args.runs
    which = args.frames or (None if args.count else frame_list("-1"))
    frames = chosen_frames(run, which, args.count)
    figure = draw(run, frames, drawing.chosen_colour(run, args.colour), args)
    rows = []
    for frame in frames:
        row = {"frame": frame, **drawing.count_at(run, frame), "time": float(run.time[frame])}
        row |= {"mean_speed": float(run.speed(frame).mean())}
        rows.append(row | {"kinetic_energy": float(run.kinetic_energy(frame).mean())})
    report(args, figure, rows)


if __name__ == "__main__":
    launch(main)
