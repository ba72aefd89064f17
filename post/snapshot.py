"""Draw frames of a run: disks, walls and obstacles to scale.

    python post/snapshot.py runs/gas.h5 -o gas.png                     the last frame
    python post/snapshot.py runs/gas.h5 --frames 0,10,-1 -o gas.png    chosen frames side by side
    python post/snapshot.py runs/gravity.h5 --count 12 --quiver        twelve frames, evenly spread

colours (--colour)
  species, speed    species with a legend; speed, like all others, with one scale for all frames
  displacement      distance from the position in the first frame
  collisions        number of collisions since the start
  spin              angular velocity of disks that can rotate
  psi6              phase of the bond order of a disk, relative to the mean of all disks

picture
  lines, outlines   orientations of rotating disks; species other than the first
  periodic sides    a disk overlapping a periodic side is drawn on both sides of the box
  titles            time, events or collisions, and the factor by which tiny disks are enlarged

see also
  player.py, animate.py, trajectory.py
"""

import argparse

from ricochet import Run, drawing
from ricochet.analysis.thermodynamics import packing
from ricochet.figures.drawing import plt
from ricochet.figures.sheet import CM, STACKED, text_style, title_letters, width_of, wrap
from ricochet.reports.options import chosen_frames, frame_list
from ricochet.script import add_width, command_line, launch, report

import numpy as np
from matplotlib.colors import LogNorm, Normalize, to_rgba_array


def scale(values: np.ndarray, log: bool, colour: str) -> Normalize:
    """Return a colour scale for the given values, exceeded by the few largest of them."""
    if colour in ("psi6", "spin"):
        top = np.nanquantile(np.abs(values), 0.995) or 1.0
        return Normalize(*drawing.limits_of(colour, top))
    moved = values[values > 0]
    if not len(moved) or not log:
        return Normalize(0, drawing.top_of(moved))
    low, top = np.quantile(moved, (0.005, 0.995))
    return LogNorm(min(low, top / 1.01), top)


def lines(text: str, letters: float) -> str:
    """Split a title into lines of a number of letters, unless there is space for any title."""
    return text if np.isinf(letters) else "\n".join(wrap(text, letters))


def draw(run: Run, frames: list[int], colour: str, args: argparse.Namespace) -> plt.Figure:
    """Draw a picture of the disks for each frame."""
    aspect = drawing.aspect_of(run)
    rows, columns = drawing.panel_grid(len(frames), aspect)
    width, apart = min(10.5, (6.0 if len(frames) == 1 else 3.4) * columns) / columns, 0.0
    letters = np.inf
    if args.width:
        size = width_of(args.width)[0]
        rows, columns = (len(frames), 1) if size < STACKED else (rows, columns)
        width, apart = (size * CM - 0.9) / columns, 0.5  # [inches]
        letters = title_letters(width)
    shape = (width * columns + 0.9, (width * aspect + apart) * rows + 0.7)
    figure, panels = plt.subplots(rows, columns, squeeze=False, figsize=shape)
    if colour != "species":
        values = np.array([drawing.values_of(run, frame, colour) for frame in frames])
        whole = scale(values, args.log, colour)
        bar = {"label": drawing.label_of(run, colour)}
    longest = max(float(np.nanmax(run.speed(frame), initial=0)) for frame in frames) or 1.0
    # The longest velocity arrow is as long as a tenth of the box.
    arrows = {"angles": "xy", "scale_units": "xy", "scale": longest / (0.1 * run.edges.max())}
    # Short arrows have small heads, and arrows that extend beyond the walls are drawn completely.
    arrows |= {"width": 0.005, "minshaft": 2, "clip_on": False, "zorder": 4, "color": "0.2"}
    if colour == "species":  # darker shades of the colours of the disks, for contrast
        dark = to_rgba_array(drawing.species_colours(run)) * (0.6, 0.6, 0.6, 1)
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
        axes.set_title(lines(drawing.moment(run, frames[k]), letters))
        if args.quiver:
            seen = run.in_box(frames[k])
            vectors = (*run.position[frames[k]][seen].T, *run.velocity[frames[k]][seen].T)
            if colour == "species":
                arrows["color"] = dark[seen]
            drawn = axes.quiver(*vectors, **arrows)
            drawn.set_in_layout(False)  # arrows beyond the walls need no room
            if k == 0:
                drawing.draw_key(axes, run, drawn, longest)
    drawing.species_legend(figure, run, by_outline=colour != "species")
    if colour != "species" and not args.per_frame:
        beyond = drawing.exceeded(values, whole.vmin, whole.vmax)
        figure.colorbar(disks, ax=panels, shrink=0.8, aspect=30, extend=beyond, **bar)
    fluid = not run.nature & {"gravity", "obstacles", "open"} and run.n_disks > 1
    dense = f",  η = {packing(run):.4g}" if fluid else ""
    larger = drawing.note_on_size(panels.flat[0], run)
    figure.suptitle(lines(drawing.caption([run]) + dense + larger, columns * letters))
    return figure


def main() -> None:
    chosen = {"frames": None, "count": None, "colour": None}
    parser = command_line(__doc__, "snapshot.png", one=True, open_systems=True, **chosen)
    parser.add_argument("--quiver", action="store_true", help="draw velocities as arrows")
    parser.add_argument("--log", action="store_true", help="use a logarithmic colour scale")
    parser.add_argument("--per-frame", action="store_true", help="a colour scale for each frame")
    add_width(parser, "that of the pictures")
    args = parser.parse_args()
    (run,) = args.runs
    which = args.frames or (None if args.count else frame_list("-1"))
    frames = chosen_frames(run, which, args.count)
    with plt.style.context(text_style(args.width)):
        figure = draw(run, frames, drawing.chosen_colour(run, args.colour), args)
    rows = []
    for frame in frames:
        row = {"frame": frame, **drawing.count_at(run, frame), "time": float(run.time[frame])}
        inside = run.in_box(frame)
        if run.present is not None:
            row |= {"inside": len(inside)}
        means = {"mean_speed": run.speed(frame), "kinetic_energy": run.kinetic_energy(frame)}
        for name, values in means.items():
            row[name] = float(values[inside].mean()) if len(inside) else np.nan
        rows.append(row)
    report(args, figure, rows)


if __name__ == "__main__":
    launch(main)
