"""Laboratory: an interactive page that runs simulations and changes their parameters.

    python post/lab.py                 with the inputs of the folder input/
    python post/lab.py my.nml          also with your own input file

page
  inputs, sliders    the simulation responds at once
  plots              speeds, energies and pressure, with theory
  several runs       side by side
  downloads          input file, Python script that repeats the run, output file to continue

The script prints the address of the page, and serves it until Ctrl-C ends all simulations.

see also
  docs/tutorials/laboratory.md
"""

import asyncio
import json
import sys
import threading
import webbrowser
from argparse import ArgumentTypeError, BooleanOptionalAction, RawTextHelpFormatter
from pathlib import Path

from ricochet import RunError
from ricochet.figures.web_page import INPUTS, chooser, lab_page, view
from ricochet.pages.lab import Lab, form
from ricochet.pages.live import application, page_of, serving
from ricochet.reading.files import similar_file
from ricochet.running.engine import library
from ricochet.script import Parser, launch

from aiohttp import web

USUAL_PORT = 8642  # links of the lesson lead to this port
#: Python code that a worker process executes, with the folder of this file in its path.
WORKER = """import sys; sys.path[:0] = [{!r}]
from ricochet.figures.film_data import scene
from ricochet.pages.worker import work
work(scene)"""


def routes(lab: Lab) -> dict:
    """Return the function that answers requests for each address of the web server."""
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


async def open_lab(lab: Lab, ports: list[int], visit: bool) -> None:
    """Serve the page of the laboratory until a signal arrives."""
    lab.prepare()
    try:
        async with serving(application(routes(lab), frames="'self'"), *ports) as (address, stop):
            if ports[0] == USUAL_PORT and f":{USUAL_PORT}/" not in address:
                print(in_use(address), flush=True)
            if visit:
                threading.Thread(target=open_page, args=[address], daemon=True).start()
            await stop.wait()
            await lab.close()
    finally:
        await lab.close()


def open_page(address: str) -> None:
    """Open the page in a browser, or print that the user must do it, as on a remote computer."""
    if not webbrowser.open(address):
        print(f"No browser can be opened here: open {address} in a browser", flush=True)


def in_use(address: str) -> str:
    """Return the message that another program occupies the usual port of the laboratory."""
    usual = f"http://127.0.0.1:{USUAL_PORT}/"
    return f"Port {USUAL_PORT} is in use: in links of the lesson, replace {usual} by {address}"


def port(text: str) -> int:
    """Convert a text on the command line to a port number."""
    if not text.isdecimal() or int(text) > 65535:
        raise ArgumentTypeError(f"'{text}' is not a port: allowed are 0 (any free port) to 65535")
    return int(text)


def main() -> None:
    raw = RawTextHelpFormatter
    parser = Parser(description=__doc__, formatter_class=raw, allow_abbrev=False)
    parser.add_argument(
        "inputs",
        nargs="*",
        type=Path,
        metavar="INPUT.nml",
        help="further input files to choose from",
    )
    opened = "open the page in your browser [no]"
    parser.add_argument("--open", action=BooleanOptionalAction, help=opened)
    parser.add_argument(
        "--port",
        type=port,
        metavar="N",
        help=f"port of the server [{USUAL_PORT} if it is free, otherwise any free port]",
    )
    more = "further folder from which inputs may read files"
    parser.add_argument("--files", type=Path, action="append", default=[], metavar="DIR", help=more)
    args = parser.parse_args()
    for path in args.inputs:
        if not path.exists():
            raise RunError(f"{path}: no such file{similar_file(path, '.nml', Path('input'))}")
        if path.suffix != ".nml" or not path.is_file():
            raise RunError(f"{path}: is not an input file; the name must end in .nml")
    library()  # without it no run could start
    names = {path.stem for path in args.inputs}  # each name is listed once
    chosen = json.loads((INPUTS / "chooser.json").read_text(encoding="utf-8"))
    inputs = [INPUTS / f"{name}.nml" for name in sorted(chosen) if name not in names]
    folders = [INPUTS, *(path.parent for path in args.inputs), *args.files]
    command = [sys.executable, "-c", WORKER.format(str(Path(__file__).parent))]
    ports = [USUAL_PORT, 0] if args.port is None else [args.port]
    asyncio.run(open_lab(Lab(args.inputs + inputs, folders, command), ports, args.open))
    print("stopped the server and all runs")


if __name__ == "__main__":
    launch(main)
