"""The laboratory: a page of this computer's browser that changes an input and shows the run.

    python post/lab.py                 the inputs of the folder input/
    python post/lab.py my.nml          and one of your own

Choose an input, move sliders, and the disks follow; speeds, energies and pressure stand beside
them.  Two runs can be compared side by side, and kept: as input file, output file, command line.
The page is at an address that is printed, until Ctrl-C; runs end with it.
"""

import io
import json
import tempfile
import threading
import time
import webbrowser
from argparse import ArgumentTypeError, BooleanOptionalAction, Namespace, RawTextHelpFormatter
from contextlib import suppress
from pathlib import Path
from urllib.parse import unquote

from player import LIVE_ROOM, chosen_film, enclosed, filled, page, policy, text_of, texts
from ricochet import Run, RunError
from ricochet.drawing import disk_collection, draw_box, species_colours
from ricochet.lab import Lab, edited
from ricochet.live import HTML, JSON, LOOK, NOT_FOUND, Handler, serving
from ricochet.script import Parser, launch

from matplotlib.figure import Figure

INPUTS = Path(__file__).resolve().parents[1] / "input"
LONGEST = 1_000_000  # bytes of a request
drawing = threading.Lock()


class Answers(Handler):
    """Answers the requests of the laboratory's pages."""

    frames = "'self'"
    lab: Lab

    def found(self, path: str, query: str) -> tuple[int, str, bytes]:
        try:
            return self.answer(path.strip("/").split("/"), unquote(query))
        except RunError as problem:
            return 409, "text/plain; charset=utf-8", f"{problem}\n".encode()
        except FileNotFoundError:  # the program renames its file, or a newer run has replaced it
            return 409, "text/plain; charset=utf-8", b"the file is not there any more: try again\n"

    def answer(self, parts: list[str], query: str) -> tuple[int, str, bytes]:
        """Status, kind and body of what is there."""
        match parts:
            case [""]:
                return 200, HTML, lab_page(self.lab).encode()
            case ["favicon.ico"]:
                return 204, "image/png", b""
            case ["form"]:
                return 200, JSON, json.dumps(self.lab.form(query)).encode()
            case ["picture"]:
                return 200, "image/png", picture(self.lab, query)
            case ["state"]:
                return 200, JSON, json.dumps(self.lab.state(query)).encode()
            case [number, run]:
                return 200, HTML, page(self.lab.run(number, run).opened(), None).encode()
            case [number, run, "film"]:
                return 200, JSON, self.lab.film(number, run, query.removeprefix("known="))
            case [number, run, "input"]:
                own = self.lab.run(number, run)
                return 200, "application/octet-stream", edited(own.input, own.settings)
            case [number, run, "output"]:
                path = self.lab.run(number, run).opened().path
                return 200, "application/octet-stream", path.read_bytes()
        return NOT_FOUND

    def do_POST(self) -> None:
        """A wish of a page of this very server; pages of others are refused."""
        names = ("check", "start", "stop", "leave")
        actions = {f"/{name}": getattr(self.lab, name) for name in names}
        host, length = self.headers.get_all("Host"), self.headers.get("Content-Length", "")
        if host not in ([own] for own in self.hosts) or self.headers.get_all("Origin") != [
            f"http://{host[0]}"
        ]:
            return self.reply(403, "text/plain", b"only for pages of this server\n")
        if self.path not in actions:
            return self.reply(*NOT_FOUND)
        if not length.isdecimal() or len(length) > 9 or int(length) > LONGEST:
            return self.send_error(400)
        try:
            wish = json.loads(self.rfile.read(int(length)))
            body = json.dumps(actions[self.path](wish)).encode()
        except RunError as problem:
            return self.reply(409, "text/plain; charset=utf-8", f"{problem}\n".encode())
        except (AttributeError, LookupError, RecursionError, TypeError, ValueError):
            return self.send_error(400)  # it is no wish
        return self.reply(200, JSON, body)


def lab_page(lab: Lab) -> str:
    """The page, with a number of its own."""
    style = text_of("style.css") + text_of("lab.css")
    script = text_of("lab.js")
    more = "connect-src 'self'", "img-src 'self'", "frame-src 'self'"
    data = {"page": lab.new_page(), "table": lab.table, "inputs": list(lab.inputs)}
    fillings = {"policy": policy(style, script, *more), "style": style, "script": script}
    return filled("lab.html", fillings | {"data": enclosed(data)})


def picture(lab: Lab, name: str) -> bytes:
    """The last frame of an input in a square, as PNG."""
    with drawing:  # one at a time: a form must not wait long
        run = lab.sample(name) if name in lab.inputs else None
        if run is None:
            raise RunError("there is no picture")
        figure, file = Figure(figsize=(1.6, 1.6), layout="none"), io.BytesIO()
        axes = figure.add_axes((0.02, 0.02, 0.96, 0.96))
        draw_box(axes, run, run.time[-1])
        axes.set_axis_off()
        disk_collection(axes, run, run.position[-1], facecolors=species_colours(run))
        figure.savefig(file, format="png")
        return file.getvalue()


def filmed(run: Run) -> dict:
    """What the player shows of a run."""
    whole = Namespace(frames=None, count=None, colour=None, disks=None)
    return texts(*chosen_film(run, whole, LIVE_ROOM)[1])


def port(text: str) -> int:
    """The number of a port."""
    if not text.isdecimal() or int(text) > 65535:
        raise ArgumentTypeError(f"'{text}' is not a port: 0 (any that is free) to 65535")
    return int(text)


def main() -> None:
    raw = RawTextHelpFormatter
    parser = Parser(description=__doc__, formatter_class=raw, allow_abbrev=False)
    parser.add_argument("inputs", nargs="*", type=Path, metavar="INPUT.nml", help="more inputs")
    opened = "open the page in your browser [no]"
    parser.add_argument("--open", action=BooleanOptionalAction, help=opened)
    parser.add_argument("--port", type=port, default=0, metavar="N", help="the port [a free one]")
    args = parser.parse_args()
    for path in args.inputs:
        if path.suffix != ".nml" or not path.is_file():
            raise RunError(f"{path}: is no input file, whose name ends in .nml")
    names = {path.stem for path in args.inputs}  # a name counts once
    inputs = [path for path in sorted(INPUTS.glob("*.nml")) if path.stem not in names]
    with tempfile.TemporaryDirectory(prefix="ricochet-lab-") as folder:
        lab = Lab(args.inputs + inputs, Path(folder), filmed)
        try:
            with (
                suppress(KeyboardInterrupt),
                serving(type("Lab", (Answers,), {"lab": lab}), args.port) as address,
            ):
                if args.open:
                    threading.Thread(target=webbrowser.open, args=[address], daemon=True).start()
                while True:
                    lab.watch()
                    time.sleep(LOOK)
        finally:
            lab.close()
    print("stopped, with all runs")


if __name__ == "__main__":
    launch(main)
