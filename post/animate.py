"""Animate a run: disks of true size in time.

    python post/animate.py runs/gas.h5 -o gas.mp4              needs ffmpeg, see below
    python post/animate.py runs/crater.h5 --colour speed --count 500 --fps 30

A name without an ending gets .mp4 if ffmpeg is there, and .gif if not; without -o it is that of
the run.  Where the system has no ffmpeg, `.venv/bin/pip install imageio-ffmpeg` brings one.
"""

from contextlib import suppress
from pathlib import Path

from ricochet import Run, RunError, read_run
from ricochet.drawing import (
    LABELS,
    caption,
    chosen_colour,
    colour_map,
    disk_collection,
    draw_box,
    move_disks,
    plt,
    species_colours,
    species_legend,
    values_of,
    warn,
)
from ricochet.files import destination
from ricochet.script import command_line, film_frames, launch, positive, report

import numpy as np
from matplotlib import animation
from tqdm import tqdm


def find_ffmpeg() -> bool:
    """Whether there is an ffmpeg: the system's, or that of the package imageio-ffmpeg."""
    if not animation.FFMpegWriter.isAvailable():
        with suppress(ImportError, RuntimeError):
            from imageio_ffmpeg import get_ffmpeg_exe

            plt.rcParams["animation.ffmpeg_path"] = get_ffmpeg_exe()
    return animation.FFMpegWriter.isAvailable()


def film_path(wish: Path | None, run: Run) -> Path:
    """Where to write: -o, else the name of the run in the current folder."""
    ffmpeg = find_ffmpeg()
    path = wish or Path(run.path.stem)
    if not path.suffix:
        path = path.with_suffix(".mp4" if ffmpeg else ".gif")
    if path.suffix == ".mp4" and not ffmpeg:
        raise RunError(f"{path}: mp4 needs ffmpeg: pip install imageio-ffmpeg, or write a .gif")
    if path.suffix not in (".mp4", ".gif"):
        raise RunError(f"{path}: a film ends in .mp4 or .gif")
    return path


def colour_limits(run: Run, frames: list[int], colour: str) -> tuple[float, float]:
    """A scale for the whole film, from some of its frames."""
    if colour == "psi6":
        return -180.0, 180.0
    some = frames[:: max(1, len(frames) // 20)]
    top = max(float(np.quantile(values_of(run, frame, colour), 0.99)) for frame in some)
    return 0.0, top or 1.0


def animate(run: Run, frames: list[int], colour: str, path: Path, fps: int) -> None:
    """Draw once, then move and recolour the disks frame by frame."""
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
    if colour == "species":
        species_legend(figure, run)
    else:
        disks.set(cmap=colour_map(colour), clim=colour_limits(run, frames, colour))
        figure.colorbar(disks, label=LABELS[colour], shrink=0.8, extend="max")
    title = axes.set_title(" ")
    warn(figure, [run.shortcoming] if run.shortcoming else [])
    figure.canvas.draw()
    figure.set_layout_engine("none")  # the layout stays; solving it for each frame is slow
    writer = (animation.FFMpegWriter if path.suffix == ".mp4" else animation.PillowWriter)(fps=fps)
    with writer.saving(figure, str(destination(path)), dpi=100):
        for frame in tqdm(frames, unit="frame", desc=path.name, disable=None):
            move_disks(disks, run, run.position[frame], **colours_of(frame))
            title.set_text(f"{caption([run])},  t = {run.time[frame]:.4g}")
            writer.grab_frame()
    plt.close(figure)


def main() -> None:
    parser = command_line(
        __doc__, "RUN.mp4", one=True, csv=False, frames=None, count=300, colour=None
    )
    parser.add_argument("--fps", type=positive, metavar="N", default=25, help="per second [25]")
    args = parser.parse_args()
    run = read_run(args.run)
    path = film_path(args.output, run)
    frames = film_frames(run, args)
    animate(run, frames, chosen_colour(run, args.colour), path, args.fps)
    report(args, [run], "Film", None, [{"film": path, "frames": len(frames), "of": run.frames}])


if __name__ == "__main__":
    launch(main)
