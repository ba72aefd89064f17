"""Write an interactive film: an HTML file that any browser can open without a network.

    python post/player.py runs/gas.h5 -o gas.html
    python post/player.py runs/crater.h5 --colour displacement
    python post/player.py runs/brownian.h5 --disks 2001       with the path of one disk
    python post/player.py runs/gas.h5.part --live             while the run continues

page
  picture     disks, walls and obstacles to scale; click on a disk to see its path and follow it
  controls    play, next frame or event, speed, zoom, colours
  plots       speeds and energies; for up to 20 disks also a list of the next events

film
  paths       exact between frames if the run has an event log; otherwise only frames are shown
  size        without --count, as many evenly spread frames as fit into 30 MB
  --live      a web server on this computer shows an unfinished run until it ends

see also
  animate.py (videos), docs/guides/films.md
"""

import webbrowser
from argparse import Namespace
from pathlib import Path

from ricochet import Run, RunError
from ricochet.figures.drawing import chosen_colour
from ricochet.figures.film_data import JUMPING, ROOM, film, frames_that_fit, texts
from ricochet.figures.web_page import page
from ricochet.reading.files import destination
from ricochet.reports.options import chosen_disks, chosen_frames
from ricochet.script import command_line, launch, report

LIVE_ROOM = 6e6  # size of the film of an unfinished run, which is sent repeatedly [bytes]


def chosen_film(run: Run, args: Namespace, room: float) -> tuple[list[int], tuple[dict, dict]]:
    """Return the frames and the film that the command-line options request."""
    frames = chosen_frames(run, args.frames, args.count or frames_that_fit(run, room))
    traced = chosen_disks(run, args.disks or [])
    return frames, film(run, frames, chosen_colour(run, args.colour), traced, room)


def main() -> None:
    parser = command_line(
        __doc__,
        "RUN.html",
        one=True,
        csv=False,
        open_systems=True,
        frames=None,
        count=None,
        colour=None,
        disks=None,
    )
    parser.add_argument(
        "--live", action="store_true", help="show an unfinished run while it continues"
    )
    parser.add_argument(
        "--open", action="store_true", help="open the film or the page in the browser"
    )
    args = parser.parse_args()
    (run,) = args.runs
    if args.colour in ("psi6", "spin"):
        raise RunError(f"--colour {args.colour} is for snapshot.py and animate.py")
    if args.colour == "displacement" and run.nature & JUMPING:
        raise RunError(f"{run.path}: its disks jump, so that they have no displacements")
    if args.live:
        if args.output:
            raise RunError("--live writes no file: leave out -o")
        from ricochet.pages.live import serve  # a film is opened without the server

        def newest(now: Run) -> dict:
            return texts(*chosen_film(now, args, LIVE_ROOM)[1])

        print(serve(run, page(run, None), newest, webbrowser.open if args.open else None))
        return
    path = args.output or Path(run.path.name).with_suffix(".html")
    if path.suffix != ".html":
        raise RunError(f"{path}: the name of a player must end in .html")
    frames, parts = chosen_film(run, args, ROOM)
    text = page(run, texts(*parts))
    destination(path).write_text(text, encoding="utf-8")
    size = len(text) / 1e6
    rows = [{"player": path, "frames": len(frames), "of": run.n_frames, "MB": size}]
    report(args, None, rows)
    if args.open:
        webbrowser.open(path.resolve().as_uri())


if __name__ == "__main__":
    launch(main)
