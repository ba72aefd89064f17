"""Write an interactive film: an HTML file that any browser can open without a network.

    python post/player.py runs/gas.h5 -o gas.html
    python post/player.py runs/crater.h5 --colour displacement
    python post/player.py runs/brownian.h5 --disks 2001       with the path of one disk
    python post/player.py runs/gas.h5.part --live             while the run continues

The film shows disks, walls and obstacles to scale.  If the run has an event log, disks move along
their exact paths between frames, and colours, energies and numbers of collisions change at each
event.  Without an event log the film shows only the frames.  With the controls of the page the user
can play the film, step to the next frame or event, change the speed of the film, and zoom.  Colours
show the species, speed, displacement or number of collisions of each disk.  If the user clicks on a
disk, the page shows the path of the disk, and the picture follows the disk.  Plots show the speeds
and the energies.  For up to 20 disks a list shows the next events.  Without --count, the film
contains as many evenly spread frames as fit into 30 MB.

With --live, the script starts a web server and prints its address.  The page at this address shows
a running simulation on this computer until the run ends.  With --open, the script opens the film or
the page in the browser.
"""

import base64
import hashlib
import html
import json
import re
import webbrowser
from argparse import Namespace
from collections import defaultdict
from contextlib import suppress
from pathlib import Path

from ricochet import Run, RunError
from ricochet.analysis.paths import seen, turns_between, why_no_log_tells, why_unknown
from ricochet.figures.drawing import COLOURS, caption, chosen_colour, label_of, scale_top
from ricochet.reading.files import destination
from ricochet.reading.nature import known, rows_of
from ricochet.reading.box import groups_of_rows
from ricochet.reading.reader import SIDES
from ricochet.reading.records import span
from ricochet.script import chosen_disks, chosen_frames, command_line, launch, report

import numpy as np
from matplotlib.colors import to_hex

PAGE = Path(__file__).with_name("page")  # the parts of the page
INPUTS = Path(__file__).resolve().parents[1] / "input"
SCRIPTS = ("film", "camera", "stage", "panels", "sliders", "controls", "stream", "live")
SWING = ("amplitude", "period", "phase")  # variables of an oscillating side
STROKE = ("velocity", "start_time", "end_time")
LAWS = ("motion", *SWING, *STROKE, "temperature", "surface_velocity")
ROOM = 29e6  # largest size of the data of the disks [bytes of base64]
LIVE_ROOM = 6e6  # the same for the film of an unfinished run, which is sent repeatedly
TURN = (16 + 8) * 4 / 3  # bytes per velocity change between two frames, and per half of an event
MOST_FRAMES = 20000
MOST_RADII = 256  # largest number of different radii in a film
FEW_DISKS = 20  # most disks to show all digits and next events
MOST_SAMPLES = 2000  # largest number of samples of a plot
ENERGIES = ("kinetic", "potential", "rotational")
MOST_AT_ONCE = 200000  # number of disks, over all frames, that are read together


def frames_that_fit(run: Run, room: float) -> int:
    """Return the number of frames that fit into a file of the given size.

    In each frame, a disk requires 16 bits for each component of its position and velocity, 8 bits
    for its number of collisions, and 32 bits for its angle.  Up to half of the file is reserved for
    the event log.
    """
    more = sum(one is not None for one in (run.event_count, run.image, run.recycled))
    more += 4 * ("orientation" in run.disk_data)
    one = run.n_disks * (8 + more) * 4 / 3
    fixed = run.n_disks * (2 + 1 + 4 + 8) * 4 / 3  # for species, size, mass and first position
    turns = 0 if run.event_count is None else TURN * float(run.event_count[-1].sum())
    return int(np.clip((room - fixed - min(turns, room / 2)) / (one + 50), 2, MOST_FRAMES))


def quantities(run: Run) -> list[str]:
    """Return the quantities, other than the species, that colours of disks can show."""
    found = ["speed"] if "recycled" in run.nature else ["speed", "displacement"]
    return found + ["collisions"] * (run.event_count is not None)


def in_room(run: Run, place: np.ndarray) -> np.ndarray:
    """Return positions in units of the visible region, which contains the box at all times."""
    lower, upper = run.bounds
    return (place - lower) / (upper - lower)


def sides(run: Run) -> list[dict]:
    """Return the position, motion, temperature and surface velocity of each side of the box."""
    places = [end[axis] for axis in (0, 1) for end in (run.lower, run.upper)]
    found = [
        {"place": float(side.get("position", at))}
        | {k: side[k] for k in LAWS if side.get(k) not in (None, "still")}
        for at, side in zip(places, run.sides, strict=True)
    ]
    for k, (time, place) in run.piston_positions.items():
        some = thinned(len(time), MOST_FRAMES)
        found[k]["way"] = [time[some].tolist(), np.ravel(place)[some].tolist()]
    return found


def thinned(count: int, most: int) -> np.ndarray:
    """Return at most `most` evenly spread integers between 0 and `count` - 1."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))


def laws_of(run: Run, group: str) -> list[dict]:
    """Return the temperature and surface velocity of each obstacle or wall."""
    rows = rows_of(run.parameters.get(group, {}))
    laws = [{k: float(row[k]) for k in LAWS[-2:] if known(row.get(k))} for row in rows]
    return [laws[k] for k in groups_of_rows(run.parameters, group)]


def moving(run: Run, frames: list[int], top: float) -> dict[str, bytes]:
    """Return the arrays with the data of all disks in each frame.

    Positions are stored as 16-bit integers in units of the visible region.  Velocities are stored
    as 16-bit integers in units of the largest velocity component in the frame.  If there are few
    disks, positions and velocities are stored with full precision.  Numbers of collisions are
    stored as values from 0 to 255, where 255 corresponds to `top`.  The numbers of periods that a
    disk has crossed along x and y since the previous frame are stored in four bits each.  The
    numbers of times that each disk has been recycled are stored modulo 256.
    """
    found: dict[str, bytearray] = defaultdict(bytearray)
    at_once = max(1, MOST_AT_ONCE // run.n_disks)
    for first in range(0, len(frames), at_once):
        some, before = frames[first : first + at_once], frames[max(0, first - 1)]
        inside, velocity = in_room(run, run.position[some]), run.velocity[some]
        fastest = np.ones(len(some))
        if run.n_disks > FEW_DISKS:
            inside = np.round(65535 * np.clip(inside, 0, 1)).astype("<u2")
            fastest = np.abs(velocity).max(axis=(1, 2))
            unit = np.where(fastest > 0, fastest, 1)[:, None, None]
            velocity = np.round(32767 * velocity / unit).astype("<i2")
        parts = {"positions": inside, "velocities": velocity, "fastest": fastest}
        if run.event_count is not None:
            share = np.log1p(run.event_count[some]) / np.log1p(top)
            parts["hits"] = np.round(255 * np.clip(share, 0, 1)).astype("u1")
        if run.image is not None:
            crossed = np.clip(np.diff(run.image[[before, *some]], axis=0), -7, 7) + 8
            parts["shifts"] = (16 * crossed[..., 0] + crossed[..., 1]).astype("u1")
        if run.recycled is not None:
            parts["recycled"] = (run.recycled[some] % 256).astype("u1")
        if "orientation" in run.disk_data:
            parts["angles"] = run.orientation[some].astype("<f4")
        for name, part in parts.items():
            found[name] += part.tobytes()
    return found


def told_by_log(run: Run, frames: list[int], most: float) -> tuple[dict, dict[str, np.ndarray]]:
    """Return collisions per disk in each frame and, unless the log is too long, events and paths.

    For each event in the log, the function returns the time and the two partners of the collision.
    Paths of disks are described by the number of velocity changes in each interval between frames.
    For each velocity change, the description of the paths contains the disk, the time as a fraction
    of the interval, and the new velocity.
    """
    exact, facts = run.n_disks <= FEW_DISKS, {"known": False, "events": False}
    try:
        log = run.event_log()
    except RunError:  # a film can be made without an event log
        facts["collisions"] = run.collisions_per_disk_at(run.time)[frames].tolist()
        reason = why_no_log_tells(run) or "output.event_log tells the paths between"
        return facts | {"note": reason}, {}
    ends, pairs = seen(run, log, frames), np.append(0, np.cumsum(log.j > 0))
    facts["collisions"] = (2 / run.n_disks * pairs[ends]).tolist()
    some = slice(ends[0], ends[-1])
    if ends[-1] - ends[0] + pairs[ends[-1]] - pairs[ends[0]] > most:
        return facts | {"note": "too many collisions between"}, {}
    facts |= {"events": exact, "note": why_unknown(run, log)}
    blocks = {"when": log.time[some].astype("<f8")}
    blocks |= {name: (own[some] - 1).astype("<i4") for name, own in (("i", log.i), ("j", log.j))}
    if not facts["note"]:
        facts["known"] = True
        turns, time = turns_between(run, log, frames, ends), run.time[frames]
        apart = np.append(np.diff(time), 1)[turns.frame]
        share = (turns.time - time[turns.frame]) / np.where(apart > 0, apart, 1)
        blocks["gaps"] = np.bincount(turns.frame, minlength=len(frames)).astype("<u4")
        blocks["turning"] = turns.disk.astype("<u4")
        numbers = np.column_stack([share, turns.velocity])
        blocks["turns"] = numbers.astype("<f8" if exact else "<f4")
    return facts, blocks


def boundary_names(run: Run, kind: str) -> list[str]:
    """Return the names of all obstacles or walls: 'wall floor', or 'wall 1' without a name."""
    names = run.parameters.get(kind, {}).get("name", ())
    return [
        f"{kind} {names[k] if names[k] != f'{kind}{k + 1}' else k + 1}"
        for k in groups_of_rows(run.parameters, kind)
    ]


def species(run: Run) -> list[dict]:
    """Return for each species the properties that are common to all its disks."""
    colours = [c if c != "#000000" else "#8a8a8a" for c in map(to_hex, COLOURS)]
    return [
        {
            "name": kind.name,
            "count": int(kind.disks.sum()),
            "mass": kind.mass,
            "alike": kind.alike,
            "sizes": f"m = {span(kind.masses, 4)}, r = {span(kind.radii, 4)}",
            "colour": colours[k % len(colours)],
        }
        for k, kind in enumerate(run.by_species)
    ]


def radii_of(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return at most 256 different radii, and the index of the radius of each disk."""
    radii = np.unique(run.radius)
    if len(radii) > MOST_RADII:
        radii = np.geomspace(radii[0], radii[-1], MOST_RADII)
    return radii, np.searchsorted((radii[1:] + radii[:-1]) / 2, run.radius)


def curves(run: Run) -> dict:
    """Return the energy of each species and the pressure against time, for small plots.

    The energies and the pressure are taken from the observables, because observables are written
    more often than frames.  Missing values are None; the pressure is None before the first
    collision.
    """
    series, found = {}, {}
    for name in (
        "collisions",
        "virial_pressure",
        *(f"{s}/{e}_energy" for s in run.names for e in ENERGIES),
    ):
        with suppress(RunError):
            found["time"], series[name] = run.observable(name)
    time = found.get("time", run.time[[0, -1]])
    some = thinned(len(time), MOST_SAMPLES)

    def rounded(name: str) -> list | None:
        values = series.get(name, np.full(len(time), np.nan))
        return [float(f"{x:.7g}") if np.isfinite(x) else None for x in values[some]]

    if (pressure := series.get("virial_pressure")) is not None:
        series["virial_pressure"] = np.where(series["collisions"] > 0, pressure, np.nan)
    found = {"time": list(map(float, time[some])), "pressure": None}
    if len(some) > 2 and np.isfinite(series.get("virial_pressure", np.nan)).any():
        found["pressure"] = rounded("virial_pressure")
    for kind in ENERGIES:
        names = [f"{name}/{kind}_energy" for name in run.names]
        there = kind == "kinetic" or any(series.get(name, time[:0]).any() for name in names)
        found[kind] = [rounded(name) for name in names] if there else None
    return found


def scene(run: Run) -> tuple[dict, dict]:
    """Return the constant data of a film: the box, the obstacles, the species and the disks.

    The argument `run` is a `Run`, or another object with those attributes of `Run` that the
    function uses.
    """
    radii, own = radii_of(run)
    facts = {
        "exact": run.n_disks <= FEW_DISKS,
        "settles": run.nature.in_equilibrium,
        "heated": bool(run.nature & {"thermal_walls", "thermostatted"}),
        "recycling": "recycled" in run.nature,
        "gravity": run.gravity.tolist(),
        "lower": run.bounds[0].tolist(),
        "edges": (run.bounds[1] - run.bounds[0]).tolist(),
        "sides": sides(run),
        "periodic": run.periodic.tolist(),
        "obstacles": [
            [*map(float, o.centre), o.radius, o.inside, *([o.from_angle, o.to_angle] * o.is_arc)]
            for o in run.obstacles
        ],
        "walls": run.walls.tolist(),
        "laws": {name: laws_of(run, name) for name in ("obstacle", "wall")},
        "species": species(run),
        "radii": radii.tolist(),
        "surfaces": [
            *(f"the {side} side" for side in SIDES),  # names of partners j <= 0
            *boundary_names(run, "obstacle"),
            *boundary_names(run, "wall"),
        ],
    }
    blocks = {
        "mass": run.mass.astype("<f4"),
        "species": (run.species - 1).astype("<u2"),
        "sizes": own.astype("u1"),
    }
    return facts, {name: block.tobytes() for name, block in blocks.items()}


def film(
    run: Run,
    frames: list[int],
    colour: str,
    traced: list[int],
    room: float = ROOM,
) -> tuple[dict, dict]:
    """Return the values and the arrays of a film; each array is stored as bytes."""
    tops = {name: scale_top(run, frames, name) for name in quantities(run)}
    told, blocks = told_by_log(run, frames, room / 2 // TURN)
    blocks = {name: block.tobytes() for name, block in blocks.items()}
    blocks |= moving(run, frames, tops.get("collisions", 1))
    # Displacements of disks are measured from the positions in the first frame of the film,
    # unwrapped across periodic sides (`origin`).  Recycled disks have no displacements.
    origin = run.position[frames[0]]
    if "recycled" not in run.nature:
        origin = run.unwrapped(0) + origin - run.unwrapped(frames[0])
    blocks["origins"] = in_room(run, origin).astype("<f4").tobytes()
    facts, own = scene(run)
    facts |= {
        "time": run.time[frames].tolist(),
        "curves": curves(run),
        "scales": {name: [label_of(run, name), float(f"{top:.7g}")] for name, top in tops.items()},
        "colour": colour,
        "traced": traced or ([0] if run.n_disks == 1 else []),
        **told,
    }
    return facts, blocks | own


def texts(facts: dict, blocks: dict) -> dict:
    """Return the values and arrays of a film as text for a web page."""
    return {"facts": facts, "blocks": {k: base64.b64encode(v).decode() for k, v in blocks.items()}}


def page(run: Run, film: dict | None) -> str:
    """Return the complete web page of a film.

    If `film` is None, the page requests the film from the server that the option --live starts.
    """
    title = str(run.parameter("run", "title", "")) or run.path.stem
    commit = run.provenance.get("git_commit", "unknown")
    words = {
        "title": title,
        "caption": caption([run]),
        "warning": run.termination_note if film else "",
        "source": f"{run.path.name} (ricochet {commit})",
    }
    return paged(film, words)


def view() -> str:
    """Return the page of a film that is a part of the page of the laboratory."""
    return paged(None, dict.fromkeys(("title", "caption", "warning", "source"), ""))


def paged(film: dict | None, words: dict[str, str]) -> str:
    """Insert the given texts into the template of a film page, and return the page.

    A page that contains no film requests the film from its server.
    """
    style = text_of("style.css")
    script = "\n".join(text_of(f"{name}.js") for name in SCRIPTS)
    fillings = {name: html.escape(text) for name, text in words.items()} | {
        "policy": policy(style, script, *["connect-src 'self'"] * (film is None)),
        "style": style,
        "data": enclosed(film),
        "script": script,
    }
    return filled("page.html", fillings)


def lab_page(data: dict) -> str:
    """Return the page of the laboratory.

    The argument `data` contains the table of input variables and the input files.
    """
    style = text_of("style.css") + text_of("lab.css")
    script = text_of("sliders.js") + text_of("lab.js")
    more = "connect-src 'self'", "img-src data:", "frame-src 'self'"
    fillings = {"policy": policy(style, script, *more), "style": style, "script": script}
    return filled("lab.html", fillings | {"data": enclosed(data)})


def chooser(paths: list[Path]) -> list[dict]:
    """Return the title, description, sliders and picture of each input file for the laboratory."""
    known = json.loads((INPUTS / "chooser.json").read_text(encoding="utf-8"))
    found = []
    for path in paths:
        own = known.get(path.stem) if path.resolve().parent == INPUTS else None
        if own is None:
            words = {"title": path.stem, "subject": "Your own", "sentence": ""}
            found.append({"name": path.stem, **words, "sliders": [], "picture": None})
        else:
            found.append({"name": path.stem, **own, "picture": picture_of(path)})
    order = [*known]
    return sorted(found, key=lambda one: order.index(one["name"]) if one["picture"] else -1)


def picture_of(path: Path) -> str:
    """Return the picture of an input file as a data URL."""
    drawn = (INPUTS / "pictures" / f"{path.stem}.png").read_bytes()
    return f"data:image/png;base64,{base64.b64encode(drawn).decode()}"


def filled(name: str, fillings: dict[str, str]) -> str:
    """Return the text of a page after replacing its placeholders."""
    blank = re.compile("{{(" + "|".join(fillings) + ")}}")
    return blank.sub(lambda found: fillings[found[1]], text_of(name))


def text_of(name: str) -> str:
    """Return the text of a style, script or template file from which pages are made."""
    return (PAGE / name).read_text(encoding="utf-8")


def enclosed(data: object) -> str:
    """Return data as JSON without `<`, which would be unsafe inside an HTML script element."""
    return json.dumps(data, allow_nan=False).replace("<", "\\u003c")


def policy(style: str, script: str, *more: str) -> str:
    """Return a content security policy for one style, one script and the sources `more`."""
    rules = ["default-src 'none'", "base-uri 'none'", "form-action 'none'", *more]
    for tag, own in (("script", script), ("style", style)):
        digest = base64.b64encode(hashlib.sha256(own.encode()).digest()).decode()
        rules.append(f"{tag}-src 'sha256-{digest}'")
    return "; ".join(rules)


def chosen_film(run: Run, args: Namespace, room: float) -> tuple[list[int], tuple[dict, dict]]:
    """Return the film and the frame numbers that the command-line options request."""
    frames = chosen_frames(run, args.frames, args.count or frames_that_fit(run, room))
    traced = chosen_disks(run, args.disks or [])
    return frames, film(run, frames, chosen_colour(run, args.colour), traced, room)


def whole(run: Run, colour: str | None = None) -> str:
    """Return the page with a film of the whole run, using default options."""
    args = Namespace(frames=None, count=None, colour=colour, disks=None)
    return page(run, texts(*chosen_film(run, args, ROOM)[1]))


def main() -> None:
    parser = command_line(
        __doc__, "RUN.html", one=True, csv=False, frames=None, count=None, colour=None, disks=None
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
