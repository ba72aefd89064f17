"""Animate a run: disks of true size in time.

    python post/animate.py runs/gas.h5 -o gas.mp4              needs ffmpeg, see below
    python post/animate.py runs/crater.h5 --colour speed --count 500 --fps 30

A name without an ending gets .mp4 if ffmpeg is there, and .gif if not; without -o it is that of
the run.  Where the system has no ffmpeg, `.venv/bin/pip install imageio-ffmpeg` brings one.
"""

from contextlib import suppress
from pathlib import Path

from ricochet import Run, RunError
from ricochet.drawing import plt
from ricochet.files import destination
from ricochet.film import animate
from ricochet.script import chosen_frames, command_line, launch, positive, report

from matplotlib import animation
from tqdm import tqdm


def film_path(wish: Path | None, run: Run) -> Path:
    """Where to write: -o, else the name of the run in the current folder."""
    if not animation.FFMpegWriter.isAvailable():  # by the system
        with suppress(ImportError, RuntimeError):
            from imageio_ffmpeg import get_ffmpeg_exe

            plt.rcParams["animation.ffmpeg_path"] = get_ffmpeg_exe()
    ffmpeg = animation.FFMpegWriter.isAvailable()
    path = wish or Path(run.path.stem)
    if not path.suffix:
        path = path.with_suffix(".mp4" if ffmpeg else ".gif")
    if path.suffix == ".mp4" and not ffmpeg:
        raise RunError(f"{path}: mp4 needs ffmpeg: pip install imageio-ffmpeg, or write a .gif")
    if path.suffix not in (".mp4", ".gif"):
        raise RunError(f"{path}: a film ends in .mp4 or .gif")
    return path


def main() -> None:
    parser = command_line(
        __doc__, "RUN.mp4", one=True, csv=False, frames=None, count=300, colour=None
    )
    parser.add_argument("--fps", type=positive, metavar="N", default=25, help="per second [25]")
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
    report(args, None, [{"film": path, "frames": len(frames), "of": run.frames}])


if __name__ == "__main__":
    launch(main)
