"""Write an animation of a run, with disks drawn to scale.

    python post/animate.py runs/gas.h5 -o gas.mp4              needs ffmpeg, see below
    python post/animate.py runs/crater.h5 --colour speed --count 500 --fps 30

Without -o the film is named after the run.  If the name has no ending, the film is written as .mp4
if ffmpeg is installed, otherwise as .gif.  `.venv/bin/python -m pip install imageio-ffmpeg`
installs ffmpeg.

see also
  player.py (film for a browser), docs/guides/films.md
"""

from contextlib import suppress
from pathlib import Path

from ricochet import Run, RunError
from ricochet.figures.drawing import (
    aspect_of,
    caption,
    chosen_colour,
    colour_map,
    disk_collection,
    draw_box,
    exceeded,
    label_of,
    limits_of,
    moment,
    note_on_size,
    plt,
    radius_marks,
    sample_of,
    species_colours,
    top_of,
    species_legend,
    values_of,
    warn,
)
from ricochet.reading.files import destination, installing
from ricochet.reports.options import chosen_frames, positive
from ricochet.script import command_line, launch, report

from matplotlib import animation
from matplotlib.collections import EllipseCollection
from tqdm import tqdm


def film_path(wish: Path | None, run: Run) -> Path:
    """Return the path of the film, named after the run by default."""
    if not animation.FFMpegWriter.isAvailable():  # by the system
        with suppress(ImportError, RuntimeError):
            from imageio_ffmpeg import get_ffmpeg_exe

            plt.rcParams["animation.ffmpeg_path"] = get_ffmpeg_exe()
    ffmpeg = animation.FFMpegWriter.isAvailable()
    path = wish or Path(run.path.stem)
    if not path.suffix:
        path = path.with_suffix(".mp4" if ffmpeg else ".gif")
    if path.suffix == ".mp4" and not ffmpeg:
        way = f"`{installing('imageio-ffmpeg')}`, or write a .gif"
        raise RunError(f"{path}: mp4 needs ffmpeg: {way}")
    if path.suffix not in (".mp4", ".gif"):
        raise RunError(f"{path}: a film ends in .mp4 or .gif")
    return path


def animate(
    run: Run, frames: list[int], colour: str | None = None, fps: float = 25
) -> animation.FuncAnimation:
    """Write a film that shows the given frames, `fps` of them per second.

    `colour` is the quantity that the colours of the disks represent: "species", or one of
    `COLOURINGS`.
    """
    colour = chosen_colour(run, colour)
    aspect = aspect_of(run)
    height = min(6.4, 6.4 * aspect)
    width = height / aspect + (1.2 if colour != "species" else 0.2)
    figure, axes = plt.subplots(figsize=(max(width, 3.6), height + 0.75), dpi=100)
    style = {}
    if colour != "species":
        sample = sample_of(run, frames, colour)
        limits = limits_of(colour, top_of(sample))
        style = {"cmap": colour_map(colour), "clim": limits}

    def show(frame: int) -> EllipseCollection:
        axes.clear()
        draw_box(axes, run, run.time[frame])
        if colour == "species":
            style["facecolors"] = species_colours(run)
        else:
            style["array"] = values_of(run, frame, colour)
        radius_marks(axes, run, frame)
        axes.set_title(f"{caption([run])},  {moment(run, frame)}{note_on_size(axes, run)}")
        return disk_collection(axes, run, run.position[frame], **style)

    disks = show(frames[0])
    if colour == "species":
        species_legend(figure, run)
    else:
        beyond = exceeded(sample, *limits)
        figure.colorbar(disks, label=label_of(run, colour), shrink=0.8, extend=beyond)
        species_legend(figure, run, by_outline=True)
    warn(figure, [run.termination_note] if run.termination_note else [])
    figure.canvas.draw()
    figure.set_layout_engine("none")  # one layout for all frames, since computing it is slow
    return animation.FuncAnimation(
        figure, show, frames, interval=1000 / fps, cache_frame_data=False
    )


def main() -> None:
    parser = command_line(
        __doc__,
        "RUN.mp4",
        one=True,
        csv=False,
        open_systems=True,
        frames=None,
        count=300,
        colour=None,
    )
    parser.add_argument(
        "--fps", type=positive, metavar="N", default=25, help="frames per second [25]"
    )
    args = parser.parse_args()
    (run,) = args.runs
    path = film_path(args.output, run)
    frames = chosen_frames(run, args.frames, args.count)
    film = animate(run, frames, args.colour, args.fps)
    writer = (animation.FFMpegWriter if path.suffix == ".mp4" else animation.PillowWriter)(
        fps=args.fps
    )
    with tqdm(total=len(frames), unit="frame", desc=path.name, disable=None) as bar:
        film.save(destination(path), writer, dpi=100, progress_callback=lambda *_: bar.update())
    report(args, None, [{"film": path, "frames": len(frames), "of": run.n_frames}])


if __name__ == "__main__":
    launch(main)
