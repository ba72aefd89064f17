"""Make a film to play with: one HTML file, which any browser opens, without a network.

    python post/player.py runs/gas.h5 -o gas.html
    python post/player.py runs/crater.h5 --colour displacement
    python post/player.py runs/brownian.h5 --disks 2001       with the trace of a disk
    python post/player.py runs/gas.h5.part --live             while the run goes on

Disks of true size with walls and obstacles, in true time: between two frames they fly along their
paths, and colours, energies and counts follow them, if the run has an event log; else the film
shows frames.  Play, step to the next frame, or event of the log, speed, zoom;
colour by species, speed, displacement or collisions; a click on a disk shows its trace, and the
camera follows it; speeds, energies, and for up to 20 disks the events to come.  Without --count a
film has as many frames, evenly spread, as fit into 30 MB.

--live shows a run on this computer, at an address that is printed, until the run ends.  --open
opens what is shown in the browser.
"""

import base64
import hashlib
import html
import json
import re
import webbrowser
from argparse import Namespace
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from pathlib import Path

from ricochet import Run, RunError
from ricochet.drawing import COLOURS, LABELS, caption, chosen_colour, plt, scale_top, values_of
from ricochet.files import destination
from ricochet.live import serve
from ricochet.nature import KICKED
from ricochet.paths import MOST_AT_ONCE, Paths
from ricochet.reader import SIDES, amplitude, span
from ricochet.script import chosen_disks, chosen_frames, command_line, launch, report
from ricochet.thermodynamics import has_log

import numpy as np
from matplotlib.colors import to_hex
from tqdm import tqdm

PAGE = Path(__file__).with_name("page")  # what the page is made of
SCRIPTS = ("film", "motion", "camera", "stage", "panels", "queue", "controls", "live")
MOTION = ("motion", "amplitude", "period", "phase")  # of a side
ROOM = 29e6  # bytes of base64 for the disks
LIVE_ROOM = 6e6  # the same of a film that is renewed while its run goes on
TURN = (20 + 8) * 4 / 3  # bytes of a collision of a disk between two frames, and of its time
MOST_FRAMES = 20000
MOST_RADII = 256  # that are told apart
FEW_DISKS = 20  # up to here every digit is in the page, and the events to come
BINS = 40  # of the speed histogram
FEWEST = 10  # disks of a species that has a histogram
MOST_SAMPLES = 500  # of a plot
MOST_EVENTS = 20000  # to come
RESTING = 0.02  # of the disks at rest at the end: no gas
DECADES = 1e4  # between the ends of an axis of speeds that grows by factors


def frames_that_fit(run: Run, room: float) -> int:
    """How many frames the file can hold.

    Each disk needs two 16-bit positions, an 8-bit colour per quantity, 32 bits of an angle; time,
    energies and histograms are in words.  Up to half of the room is for collisions between frames.
    """
    turning = 4 * ("orientation" in run.elements)
    one = run.count * (4 + len(quantities(run)) + (run.image is not None) + turning + 1 / 8) * 4 / 3
    words = 50 + 200 * len(run.names)
    fixed = run.count * (2 + 1 + 4 + 8) * 4 / 3  # species, size, mass and origin
    turns = 0 if run.collisions is None else TURN * float(run.collisions[-1].sum())
    return int(np.clip((room - fixed - min(turns, room / 2)) / (one + words), 2, MOST_FRAMES))


def quantities(run: Run) -> list[str]:
    """What disks can be coloured by, apart from their species."""
    return ["speed", "displacement"] + ["collisions"] * (run.collisions is not None)


def in_room(run: Run, place: np.ndarray) -> np.ndarray:
    """Places in units of what the page shows: the box, with room for sides that move."""
    lower, upper = run.room
    return (place - lower) / (upper - lower)


def sides(run: Run) -> list[dict]:
    """Of each side its place, and how it moves about it; nothing of the latter if it stays."""
    places = [end[axis] for axis in (0, 1) for end in (run.lower, run.upper)]
    moves = [{k: side[k] for k in MOTION} if amplitude(side) else {} for side in run.sides]
    return [{"place": float(at), **move} for at, move in zip(places, moves, strict=True)]


def moving(run: Run, frames: list[int], before: int, tops: dict) -> dict[str, np.ndarray]:
    """(T, N, ...) what differs from frame to frame; `before` is the frame before them.

    Positions in units of the room, as 16-bit integers, of few disks with every digit; colours as
    places 0 to 255 on their scales; periods crossed along x and y since the frame before, four bits
    each; angles.
    """
    inside = in_room(run, run.position[frames])
    if run.count > FEW_DISKS:
        inside = np.round(65535 * np.clip(inside, 0, 1))
    found = {"positions": inside.astype("<u2" if run.count > FEW_DISKS else "<f8")}
    for name, top in tops.items():
        scale = np.log1p if name == "collisions" else np.asarray
        share = scale(values_of(run, frames, name)) / scale(top)
        found[name] = np.round(255 * np.clip(share, 0, 1)).astype("u1")
    if run.image is not None:
        x, y = np.moveaxis(np.clip(np.diff(run.image[[before, *frames]], axis=0), -7, 7) + 8, -1, 0)
        found["shifts"] = (16 * x + y).astype("u1")
    if "orientation" in run.elements:
        found["angles"] = run.orientation[frames].astype("<f4")
    return found


def coded_turns(
    run: Run, paths: Paths, frames: list[int]
) -> tuple[dict[str, bytearray], list[int]]:
    """Collisions between the frames, and how many disks have unknown paths.

    Of each gap between two frames the number of collisions; of each collision its disk, three
    numbers: when, as share of the gap, and where, in units of the room; and the kinetic energy that
    the disk gains.  Of disks with unknown paths the heading in the first frame.
    """
    kind = "<f8" if run.count <= FEW_DISKS else "<f4"
    names = ("gaps", "turning", "turns", "gains", "guessed", "headings")
    blocks = {name: bytearray() for name in names}
    guesses = []
    for k, turns in enumerate(paths.along(frames)):
        start, end = run.time[[frames[k], frames[k + 1]]]
        when = (turns.time - start) / (end - start if end > start else 1)
        where = in_room(run, turns.place)
        blocks["gaps"] += np.uint32(len(when)).astype("<u4").tobytes()
        blocks["turning"] += turns.disk.astype("<u4").tobytes()
        blocks["turns"] += np.column_stack([when, where]).astype(kind).tobytes()
        blocks["gains"] += turns.gain.astype(kind).tobytes()
        blocks["guessed"] += np.packbits(turns.guessed, bitorder="little").tobytes()
        guesses.append(int(turns.guessed.sum()))
        if guesses[-1]:  # directions, a full turn in 256 parts
            angle = np.arctan2(*run.velocity[frames[k]][turns.guessed].T[::-1])
            blocks["headings"] += (np.round(128 * angle / np.pi) % 256).astype("u1").tobytes()
    return blocks, guesses


def told_by_log(
    run: Run, paths: Paths, frames: list[int], most: float
) -> tuple[dict, dict[str, np.ndarray]]:
    """Collisions per disk in each frame, and the events of few disks; the moments of all events.

    No events and moments without a log, no moments if it is longer than `most`.
    """
    facts, moments = {"events": None}, dict.fromkeys(("pairs", "others"), np.zeros(0))
    if paths.log is None:
        facts["collisions"] = run.collisions_per_disk_at(run.time)[frames].tolist()
        return facts, moments
    time, i, j = paths.log[:3]
    before = np.searchsorted(time[j > 0], run.time[frames], "right")
    facts["collisions"] = (2 * before / run.count).tolist()
    some = slice(*np.searchsorted(time, run.time[[frames[0], frames[-1]]], "right"))
    time, i, j = time[some], i[some], j[some]
    if len(time) <= most:
        moments = {"pairs": time[j > 0], "others": time[j <= 0]}
    if run.count <= FEW_DISKS:
        parts = {"time": time, "i": i - 1, "j": j - 1}
        facts["events"] = {name: own[:MOST_EVENTS].tolist() for name, own in parts.items()}
        facts["surfaces"] = [f"the {side} side" for side in SIDES]  # what j < 0 is called
        facts["surfaces"] += [f"obstacle {k + 1}" for k in range(len(run.obstacles))]
        facts["surfaces"] += [f"wall {k + 1}" for k in range(len(run.walls))]
    return facts, moments


def species(run: Run) -> list[dict]:
    """What the disks of each species have in common."""
    colours = [c if c != "#000000" else "#8a8a8a" for c in map(to_hex, COLOURS)]
    return [
        {
            "name": kind.name,
            "count": int(kind.disks.sum()),
            "mass": kind.mass,
            "sizes": f"m = {span(kind.masses)}, r = {span(kind.radii)}",
            "colour": colours[k % len(colours)],
        }
        for k, kind in enumerate(run.by_species)
    ]


def radii_of(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """The radii that there are, as few as a byte can number, and which of them each disk has."""
    radii = np.unique(run.radius)
    if len(radii) > MOST_RADII:
        radii = np.geomspace(radii[0], radii[-1], MOST_RADII)
    return radii, np.searchsorted((radii[1:] + radii[:-1]) / 2, run.radius)


def pressure(run: Run) -> dict | None:
    """The pressure against time, of as many samples as a plot can show; None without a cadence."""
    with suppress(RunError):
        series = run.observable("pressure")
        some = np.linspace(0, len(series.time) - 1, min(len(series.time), MOST_SAMPLES)).astype(int)
        if len(some) > 2 and np.isfinite(series.value[some]).all():
            value = list(map(significant, series.value[some]))
            return {"time": list(map(significant, series.time[some])), "value": value}
    return None


def speed_bins(run: Run, frames: list[int], top: float) -> dict:
    """The axis of the histogram of speeds.

    Where disks are at rest to the end, as around a crater, speeds have no Maxwell curve: bins grow
    with the speed, up to the fastest disk.
    """
    last = run.speed(frames[-1])
    if np.mean(last == 0) < RESTING or not last.any():
        return {"edges": np.linspace(0, top, BINS + 1), "rest": False}
    some = frames[:: max(1, len(frames) // 40)]
    fastest = 1.01 * float(run.speed(some).max())
    return {"edges": np.geomspace(fastest / DECADES, fastest, BINS + 1), "rest": True}


def speed_counts(run: Run, frames: list[int], bins: dict) -> list[list[list[int]]]:
    """Histograms of the speeds of each species, frame by frame.

    Empty for a species of few or unequal disks if the histogram is to be compared with a Maxwell
    curve; else the first number is that of the disks at rest.
    """
    speeds, size = run.speed(frames), BINS + 2
    places = np.searchsorted(bins["edges"], speeds, "right")
    if bins["rest"]:
        places = np.where(speeds > 0, np.maximum(places, 1), 0)
    places += size * np.arange(len(frames))[:, None]
    first = 0 if bins["rest"] else 1
    counts = [
        np.bincount(places[:, kind.disks].ravel(), minlength=size * len(frames))
        .reshape(-1, size)[:, first : BINS + 1]
        .tolist()
        if bins["rest"] or (len(kind.masses) >= FEWEST and np.ptp(kind.masses) == 0)
        else [[]] * len(frames)
        for kind in run.by_species
    ]
    return list(map(list, zip(*counts, strict=True)))


def significant(value: float) -> float:
    """Seven digits are enough for the eye and short in the file."""
    return float(f"{value:.7g}")


def film(
    run: Run,
    frames: list[int],
    colour: str,
    traced: list[int],
    room: float = ROOM,
    watched: Callable[[list], Iterable] = iter,
) -> tuple[dict, dict]:
    """What the page needs to know, and the arrays that move as name -> bytes.

    `watched` passes on the parts in which frames are read, as tqdm does.
    """
    tops = {name: scale_top(run, frames, name) for name in quantities(run)}
    bins = speed_bins(run, frames, 1.3 * tops["speed"])
    parts, kinetic, potential, counts = [], [], [], []
    before, at_once = frames[0], max(1, MOST_AT_ONCE // run.count)
    for some in watched([frames[k : k + at_once] for k in range(0, len(frames), at_once)]):
        parts.append(moving(run, some, before, tops))
        before = some[-1]
        heights = run.unwrapped(some) @ run.gravity
        for means, energy in (kinetic, run.kinetic_energy(some)), (potential, -run.mass * heights):
            each = [energy[:, kind.disks].mean(axis=1) for kind in run.by_species]
            means += [list(map(significant, row)) for row in np.transpose(each)]
        counts += speed_counts(run, some, bins)
    blocks = {name: b"".join(part[name].tobytes() for part in parts) for name in parts[0]}
    most = 0.4 * room // TURN  # the rest of its half is for headings
    paths = Paths(run, most)
    turns, guesses = coded_turns(run, paths, frames)
    told, moments = told_by_log(run, paths, frames, most / 2)
    blocks |= turns | {name: when.astype("<f8").tobytes() for name, when in moments.items()}
    blocks["mass"] = run.mass.astype("<f4").tobytes()
    # Where displacements count from, without jumps until the first frame of the film.
    origin = run.unwrapped(0) + run.position[frames[0]] - run.unwrapped(frames[0])
    blocks["origins"] = in_room(run, origin).astype("<f4").tobytes()
    blocks["species"] = (run.species - 1).astype("<u2").tobytes()
    radii, own = radii_of(run)
    blocks["sizes"] = own.astype("u1").tobytes()
    blocks["palette"] = plt.get_cmap()(range(256), bytes=True)[:, :3].tobytes()
    facts = {
        "time": run.time[frames].tolist(),
        "exact": run.count <= FEW_DISKS,
        "guesses": guesses,
        "kicked": bool(run.nature & KICKED),
        "settles": run.nature.in_equilibrium,
        "gravity": run.gravity.tolist(),
        "lower": run.room[0].tolist(),
        "edges": (run.room[1] - run.room[0]).tolist(),
        "sides": sides(run),
        "periodic": run.periodic.tolist(),
        "obstacles": [[*map(float, o.centre), o.radius, o.inside] for o in run.obstacles],
        "walls": run.walls.tolist(),
        "species": species(run),
        "radii": radii.tolist(),
        "kinetic": kinetic,
        "potential": potential if run.gravity.any() else None,
        "pressure": pressure(run),
        "speeds": {
            "edges": [significant(edge) for edge in bins["edges"]],
            "rest": bins["rest"],
            "counts": counts,
        },
        "scales": {name: [LABELS[name], significant(top)] for name, top in tops.items()},
        "colour": colour,
        "traced": traced or ([0] if run.count == 1 else []),
        "logged": has_log(run),
        **told,
    }
    return facts, blocks


def texts(facts: dict, blocks: dict) -> dict:
    """The film in letters: what every page can hold, and the server of --live can send."""
    return {"facts": facts, "blocks": {k: base64.b64encode(v).decode() for k, v in blocks.items()}}


def page(run: Run, film: dict | None) -> str:
    """The whole file; without a film it asks the server of --live for one."""
    title = str(run.parameter("run", "title", "")) or run.path.stem
    commit = run.provenance.get("git_commit", "unknown")
    style = text_of("style.css")
    script = "\n".join(text_of(f"{name}.js") for name in SCRIPTS)
    fillings = {
        "policy": policy(style, script, *["connect-src 'self'"] * (film is None)),
        "title": html.escape(title),
        "caption": html.escape(caption([run])),
        "warning": html.escape(run.shortcoming if film else ""),
        "source": html.escape(f"{run.path.name} (ricochet {commit})"),
        "style": style,
        "data": enclosed(film),
        "script": script,
    }
    return filled("page.html", fillings)


def filled(name: str, fillings: dict[str, str]) -> str:
    """A page with its blanks filled in."""
    blank = re.compile("{{(" + "|".join(fillings) + ")}}")
    return blank.sub(lambda found: fillings[found[1]], text_of(name))


def text_of(name: str) -> str:
    """A part of the page."""
    return (PAGE / name).read_text(encoding="utf-8")


def enclosed(data: object) -> str:
    """Data as a script of a page may hold it: no sign of it opens a tag."""
    return json.dumps(data, allow_nan=False).replace("<", "\\u003c")


def policy(style: str, script: str, *more: str) -> str:
    """What a page may do: run its own script in its own style, and load nothing but `more`."""
    rules = ["default-src 'none'", "base-uri 'none'", "form-action 'none'", *more]
    for tag, own in (("script", script), ("style", style)):
        digest = base64.b64encode(hashlib.sha256(own.encode()).digest()).decode()
        rules.append(f"{tag}-src 'sha256-{digest}'")
    return "; ".join(rules)


def chosen_film(
    run: Run, args: Namespace, room: float, watched: Callable[[list], Iterable] = iter
) -> tuple[list[int], tuple[dict, dict]]:
    """The film that the options ask for, and its frames; `watched` is as in `film`."""
    frames = chosen_frames(run, args.frames, args.count or frames_that_fit(run, room))
    traced = chosen_disks(run, args.disks or [])
    return frames, film(run, frames, chosen_colour(run, args.colour), traced, room, watched)


def main() -> None:
    parser = command_line(
        __doc__, "RUN.html", one=True, csv=False, frames=None, count=None, colour=None, disks=None
    )
    parser.add_argument("--live", action="store_true", help="show the run while it goes on")
    parser.add_argument("--open", action="store_true", help="open the film in the browser")
    args = parser.parse_args()
    (run,) = args.runs
    if args.colour == "psi6":
        raise RunError("--colour psi6 is for snapshot.py and animate.py")
    if args.live:
        if args.output:
            raise RunError("--live writes no file: leave out -o")

        def newest(now: Run) -> dict:
            return texts(*chosen_film(now, args, LIVE_ROOM)[1])

        print(serve(run, page(run, None), newest, webbrowser.open if args.open else None))
        return
    path = args.output or Path(run.path.name).with_suffix(".html")
    if path.suffix != ".html":
        raise RunError(f"{path}: a player ends in .html")
    # Only here: a server makes films in threads, and the lock of tqdm may be lost to an interrupt.
    bar = partial(tqdm, desc="player", unit="part", leave=False, disable=None)
    frames, parts = chosen_film(run, args, ROOM, bar)
    text = page(run, texts(*parts))
    destination(path).write_text(text, encoding="utf-8")
    size = len(text) / 1e6
    rows = [{"player": path, "frames": len(frames), "of": run.frames, "MB": size}]
    report(args, None, rows)
    if args.open:
        webbrowser.open(path.resolve().as_uri())


if __name__ == "__main__":
    launch(main)
