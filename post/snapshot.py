"""Draw frames of a run: disks of true size, walls, obstacles.

    python post/snapshot.py runs/gas.h5 -o gas.png                     the last frame
    python post/snapshot.py runs/gas.h5 --frames 0,10,-1 -o gas.png    chosen frames side by side
    python post/snapshot.py runs/gravity.h5 --count 12 --quiver        twelve frames, evenly spread

Colour: species, speed, displacement from the first frame, or collisions so far.
"""

import numpy as np
from matplotlib.colors import to_rgba_array

from drawing import (
    caption,
    command_line,
    disk_collection,
    draw_box,
    launch,
    plt,
    positive,
    save,
    species_colours,
    species_legend,
    whole_numbers,
)
from read_run import Run, read_run

LABELS = {
    "speed": "speed (reduced units)",
    "displacement": "displacement (reduced units)",
    "collisions": "collisions so far",
}


def spread_frames(run: Run, count: int) -> list[int]:
    """Numbers of `count` frames, evenly spread."""
    return np.unique(np.linspace(0, run.frames - 1, count).round().astype(int)).tolist()


def values_of(run: Run, frame: int, colour: str) -> np.ndarray:
    """(N,) the number that colours each disk."""
    if colour == "collisions" and run.collisions is not None:
        return run.collisions[frame].astype(float)
    return run.displacement(frame) if colour == "displacement" else run.speed(frame)


def default_colour(run: Run) -> str:
    """Species tell more than speeds where there are several."""
    return "species" if len(run.names) > 1 else "speed"


def panel_grid(count: int, aspect: float) -> tuple[int, int]:
    """Rows and columns for `count` panels of this height over width, wider than high."""
    columns = int(np.clip(np.ceil(np.sqrt(count * aspect * 1.4)), 1, count))
    rows = int(np.ceil(count / columns))
    return rows, int(np.ceil(count / rows))


def darker(colours: list[str]) -> np.ndarray:
    """(N, 4) the same hues, which stand out against them."""
    return to_rgba_array(colours) * (0.6, 0.6, 0.6, 1)


def draw_arrows(axes: plt.Axes, run: Run, frame: int, longest: float, colours) -> None:
    """Velocities as arrows; `longest` is the speed drawn as a tenth of the box."""
    scale = longest / (0.1 * run.edges.max())
    x, v = run.position[frame], run.velocity[frame]
    axes.quiver(
        *x.T, *v.T, angles="xy", scale_units="xy", scale=scale, width=0.005, color=colours, zorder=4
    )


def draw(run: Run, frames: list[int], colour: str, quiver: bool) -> plt.Figure:
    """One panel per frame, one colour scale for all."""
    aspect = run.edges[1] / run.edges[0]
    rows, columns = panel_grid(len(frames), aspect)
    width = min(10.5, (6.0 if len(frames) == 1 else 3.4) * columns) / columns
    figure, panels = plt.subplots(
        rows, columns, squeeze=False, figsize=(width * columns + 0.9, width * aspect * rows + 0.7)
    )
    if colour != "species":
        values = [values_of(run, frame, colour) for frame in frames]
        limits = (0.0, float(np.quantile(values, 0.995)) or 1.0)
    longest = max(float(np.max(run.speed(frame))) for frame in frames) or 1.0
    for k, axes in enumerate(panels.flat):
        if k >= len(frames):
            axes.set_visible(False)
            continue
        draw_box(axes, run)
        if colour == "species":
            style = {"facecolors": species_colours(run)}
        else:
            style = {"array": values[k], "clim": limits}
        disks = disk_collection(axes, run, run.position[frames[k]], **style)
        if quiver:
            arrows = darker(species_colours(run)) if colour == "species" else "0.2"
            draw_arrows(axes, run, frames[k], longest, arrows)
        axes.set_title(f"t = {run.time[frames[k]]:.4g}")
    if colour == "species":
        species_legend(figure, run)
    else:
        figure.colorbar(disks, ax=panels, label=LABELS[colour], shrink=0.8, aspect=30, extend="max")
    figure.suptitle(caption([run]), fontsize=10)
    return figure


def main() -> None:
    parser = command_line(__doc__, "snapshot.png", one=True)
    parser.add_argument(
        "--frames",
        type=whole_numbers,
        default=[-1],
        help="frame numbers, e.g. 0,10,-1 (negative: from the end) [-1]",
    )
    parser.add_argument("--count", type=positive, help="this many frames, evenly spread")
    parser.add_argument("--colour", choices=["species", *LABELS], help="[species, or speed]")
    parser.add_argument("--quiver", action="store_true", help="velocities as arrows")
    args = parser.parse_args()
    run = read_run(args.run)
    frames = spread_frames(run, args.count) if args.count else args.frames
    figure = draw(run, frames, args.colour or default_colour(run), args.quiver)
    save(figure, args.output, [run], f"Frames of {run.path.name}")


if __name__ == "__main__":
    launch(main)
