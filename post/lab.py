"""The laboratory: a page where disks move, and where what acts on them can be changed.

    python post/lab.py                 the inputs of the folder input/
    python post/lab.py my.nml          and one of your own

Choose an input, move sliders, and the disks follow at once; speeds, energies and pressure stand
beside them.  Runs can be kept side by side, and taken along: as input file, script, and as a file
that the program goes on from.  The page is at an address that is printed, until
Ctrl-C; everything ends with it.
"""

import asyncio
import sys
import threading
import webbrowser
from argparse import ArgumentTypeError, BooleanOptionalAction, RawTextHelpFormatter
from pathlib import Path

from player import INPUTS, chooser, lab_page, view
from ricochet import RunError
from ricochet.pages.lab import Lab, form
from ricochet.pages.live import application, page_of, serving
from ricochet.script import Parser, launch

from aiohttp import web

#: A worker, which finds the player's module where this one is.
WORKER = """import sys; sys.path[:0] = [{!r}]
from player import scene
from ricochet.pages.worker import work
work(scene)"""


def routes(lab: Lab) -> dict:
    """Return the function that answers at each address."""
    data = {"table": lab.table, "inputs": chooser([*lab.inputs.values()])}

    async def formed(request: web.Request) -> web.Response:
        path = lab.inputs.get(request.query_string)
        if path is None:
            raise RunError("no such input")
        return web.json_response(await asyncio.to_thread(form, path))

    return {
        "/": page_of(lab_page(data)),
        "/view": page_of(view()),
        "/form": formed,
        "/ws": lab.socket,
    }


async def open_lab(lab: Lab, port: int, visit: bool) -> None:
    """Serve until a signal comes."""
    lab.prepare()
    try:
        async with serving(application(routes(lab), frames="'self'"), port) as (address, stop):
            if visit:
                threading.Thread(target=webbrowser.open, args=[address], daemon=True).start()
            await stop.wait()
            await lab.close()
    finally:
        await lab.close()


def port(text: str) -> int:
    """Parse a port number."""
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
    more = "a folder whose files inputs may name, too"
    parser.add_argument("--files", type=Path, action="append", default=[], metavar="DIR", help=more)
    args = parser.parse_args()
    for path in args.inputs:
        if path.suffix != ".nml" or not path.is_file():
            raise RunError(f"{path}: is no input file, whose name ends in .nml")
    names = {path.stem for path in args.inputs}  # a name counts once
    inputs = [path for path in sorted(INPUTS.glob("*.nml")) if path.stem not in names]
    folders = [INPUTS, *(path.parent for path in args.inputs), *args.files]
    command = [sys.executable, "-c", WORKER.format(str(Path(__file__).parent))]
    asyncio.run(open_lab(Lab(args.inputs + inputs, folders, command), args.port, args.open))
    print("stopped, with all runs")


if __name__ == "__main__":
    launch(main)
