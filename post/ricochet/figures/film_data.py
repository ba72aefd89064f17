"""Data of an interactive film of a run: disks in all frames, collisions, box, energies."""

import base64
from collections import defaultdict
from contextlib import suppress

import numpy as np
from matplotlib.colors import to_hex

from ..reading.box import groups_of_rows, passages
from ..reading.files import RunError
from ..reading.nature import known, rows_of
from ..reading.paths import Turns, seen, turns_between, why_no_log_tells, why_unknown
from ..reading.reader import SIDES, Run
from ..reading.records import span
from .drawing import COLOURS, label_of, scale_top

SWING = ("amplitude", "period", "phase")  # variables of an oscillating side
STROKE = ("velocity", "start_time", "end_time")
JUMPING = {"recycled", "open"}  # traits of runs in which displacements are meaningless
LAWS = ("motion", *SWING, *STROKE, "temperature", "surface_velocity")
ROOM = 29e6  # largest size of the per-disk data [bytes of base64]
TURN = (16 + 8) * 4 / 3  # bytes per velocity change between two frames, and per half of an event
MOST_FRAMES = 20000
MOST_RADII = 256  # largest number of different radii in a film
FEW_DISKS = 20  # largest number of disks shown with all digits and with their next events
MOST_SAMPLES = 2000  # largest number of samples in a plot
ENERGIES = ("kinetic", "potential", "rotational")
MOST_AT_ONCE = 200000  # largest number of disks read at a time, in all frames together


def frames_that_fit(run: Run, room: float) -> int:
    """Return the number of frames that fit into a file of the given size.

    Per disk and frame, 16 bits are needed for each component of position and velocity, 8 for its
    collisions and 32 for its angle. Up to half of the file is reserved for the event log.
    """
    more = sum(one is not None for one in (run.event_count, run.image, run.recycled))
    more += 4 * ("orientation" in run.disk_data)
    more += run.present is not None
    one = run.n_disks * (8 + more) * 4 / 3
    fixed = run.n_disks * (2 + 1 + 4 + 8) * 4 / 3  # for species, size, mass and first position
    turns = 0 if run.event_count is None else TURN * float(run.event_count[-1].sum())
    return int(np.clip((room - fixed - min(turns, room / 2)) / (one + 50), 2, MOST_FRAMES))


def quantities(run: Run) -> list[str]:
    """Return the quantities, other than the species, that colours of disks can represent."""
    found = ["speed"] if run.nature & JUMPING else ["speed", "displacement"]
    return found + ["collisions"] * (run.event_count is not None)


def in_room(run: Run, place: np.ndarray) -> np.ndarray:
    """Return positions relative to the visible region, which contains the box at all times."""
    lower, upper = run.bounds
    return (place - lower) / (upper - lower)


def sides(run: Run) -> list[dict]:
    """Return the position, motion, temperature and surface velocity of each side of the box."""
    places = [end[axis] for axis in (0, 1) for end in (run.lower, run.upper)]
    found = [
        {"place": float(side.get("position", at))}
        | {k: side[k] for k in LAWS if side.get(k) not in (None, "still")}
        | {k: bool(side[k]) for k in ("open",) if k in side}
        for at, side in zip(places, run.sides, strict=True)
    ]
    for k, (time, place) in run.piston_positions.items():
        some = thinned(len(time), MOST_FRAMES)
        found[k]["way"] = [time[some].tolist(), np.ravel(place)[some].tolist()]
    return found


def opening_times(run: Run) -> list[float]:
    """Return the start time and the times at which sides are opened or closed."""
    return [0.0, *(change.time for change in run.changes if change.name.endswith(".open"))]


def thinned(count: int, most: int) -> np.ndarray:
    """Return at most `most` evenly spaced integers from 0 to `count` - 1."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))


def laws_of(run: Run, group: str) -> list[dict]:
    """Return the temperature and surface velocity of each obstacle or wall."""
    rows = rows_of(run.parameters.get(group, {}))
    laws = [{k: float(row[k]) for k in LAWS[-2:] if known(row.get(k))} for row in rows]
    return [laws[k] for k in groups_of_rows(run.parameters, group)]


def moving(run: Run, frames: list[int], top: float) -> dict[str, bytes]:
    """Return the arrays with the data of all disks in each frame.

    Positions are 16-bit integers relative to the visible region, velocities relative to the largest
    component in the frame; for few disks both have full precision. Numbers of collisions are bytes;
    255 represents `top`. Changes of the image counters have four bits each; numbers of recyclings
    are modulo 256. In an open system, a 1 marks each disk in the box.
    """
    found: dict[str, bytearray] = defaultdict(bytearray)
    at_once = max(1, MOST_AT_ONCE // run.n_disks)
    for first in range(0, len(frames), at_once):
        some, before = frames[first : first + at_once], frames[max(0, first - 1)]
        inside, velocity = in_room(run, run.position[some]), run.velocity[some]
        if run.present is not None:
            inside, velocity = np.nan_to_num(inside), np.nan_to_num(velocity)
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
        if run.present is not None:
            parts["present"] = run.present[some].astype("u1")
        for name, part in parts.items():
            found[name] += part.tobytes()
    return found


def told_by_log(
    run: Run, frames: list[int], most: float
) -> tuple[dict, dict[str, np.ndarray], Turns | None]:
    """Return collisions per disk up to each frame, and events and paths if the log is not too long.

    An event has a time and two partners. A path has the number of velocity changes in each interval
    and, for each change, the disk, the fraction of the interval and the new velocity.
    """
    exact, facts = run.n_disks <= FEW_DISKS, {"known": False, "events": False}
    try:
        log = run.event_log()
    except RunError:  # a film can be made without an event log
        facts["collisions"] = run.collisions_per_disk_at(run.time)[frames].tolist()
        reason = why_no_log_tells(run) or "output.event_log tells the paths between"
        return facts | {"note": reason}, {}, None
    ends, pairs = seen(run, log, frames), np.append(0, np.cumsum(log.j > 0))
    facts["collisions"] = (2 / run.n_disks * pairs[ends]).tolist()
    some = slice(ends[0], ends[-1])
    if ends[-1] - ends[0] + pairs[ends[-1]] - pairs[ends[0]] > most:
        return facts | {"note": "too many collisions between"}, {}, None
    facts |= {"events": exact, "note": why_unknown(run, log)}
    blocks = {"when": log.time[some].astype("<f8")}
    blocks |= {name: (own[some] - 1).astype("<i4") for name, own in (("i", log.i), ("j", log.j))}
    turns = None
    if not facts["note"]:
        facts["known"] = True
        turns, time = turns_between(run, log, frames, ends), run.time[frames]
        apart = np.append(np.diff(time), 1)[turns.frame]
        share = (turns.time - time[turns.frame]) / np.where(apart > 0, apart, 1)
        blocks["gaps"] = np.bincount(turns.frame, minlength=len(frames)).astype("<u4")
        blocks["turning"] = turns.disk.astype("<u4")
        numbers = np.column_stack([share, turns.velocity])
        blocks["turns"] = numbers.astype("<f8" if exact else "<f4")
    return facts, blocks, turns


def boundary_names(run: Run, kind: str) -> list[str]:
    """Return the names of all obstacles or walls: 'wall floor', or 'wall 1' without a name."""
    names = run.parameters.get(kind, {}).get("name", ())
    return [
        f"{kind} {names[k] if names[k] != f'{kind}{k + 1}' else k + 1}"
        for k in groups_of_rows(run.parameters, kind)
    ]


def species(run: Run) -> list[dict]:
    """Return the properties shared by all disks of a species, for each species."""
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
    """Return the energy of each species and the pressure as functions of time, for small plots.

    Missing values are None. An open system also has the numbers of disks inside, left and entered.
    """
    series, found = {}, {}
    moved = passages(run.observables) if "open" in run.nature else {}
    for name in (
        "collisions",
        "virial_pressure",
        *(f"{s}/{e}_energy" for s in run.names for e in ENERGIES),
        *(f"{s}/particle_number" for s in run.names if moved),
        *(name for names in moved.values() for name in names),
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
        there = kind == "kinetic" or any(
            np.nan_to_num(series.get(name, time[:0])).any() for name in names
        )
        found[kind] = [rounded(name) for name in names] if there else None
    if moved:
        found["inside"] = [rounded(f"{name}/particle_number") for name in run.names]
        for name, parts in moved.items():
            series[name] = np.sum([series[part] for part in parts], axis=0) + 0 * time
            found[name] = rounded(name)
    return found


def are_steps(run: Run, frames: list[int]) -> bool:
    """Return whether the kinetic energies are step functions, which the film shows as such."""
    is_whole = frames[0] == 0 and frames[-1] == run.n_frames - 1
    return run.n_disks <= FEW_DISKS and is_whole and not run.gravity.any() and run.present is None


def energy_steps(run: Run, drawn: dict, turns: Turns) -> dict:
    """Return the curves with samples at all events, and kinetic energies that change only there.

    Without gravity, the energy of a disk is constant between its collisions. The other curves are
    interpolated, or keep their last value.
    """
    order = np.argsort(turns.disk, kind="stable")  # by disk, and for each disk by time
    disk, when, after = turns.disk[order], turns.time[order], turns.velocity[order]
    start, is_first = run.velocity[0], np.diff(disk, prepend=-1) != 0
    before = np.where(is_first[:, None], start[disk], np.roll(after, 1, axis=0))
    gain = run.mass[disk] * np.sum(after**2 - before**2, axis=1) / 2
    time = np.unique(np.concatenate([drawn["time"], when]))
    time = time[thinned(len(time), MOST_SAMPLES)]
    found: dict = {"time": time.tolist(), "kinetic": []}
    for kind in run.by_species:
        own = kind.disks[disk]
        by_time = np.argsort(when[own], kind="stable")
        sums = np.append(0, np.cumsum(gain[own][by_time]))
        sums += np.sum(run.mass[kind.disks, None] * start[kind.disks] ** 2) / 2
        past = np.searchsorted(when[own][by_time], time, "right")
        found["kinetic"].append([float(f"{x:.7g}") for x in sums[past] / kind.disks.sum()])
    held = np.searchsorted(drawn["time"], time, "right") - 1
    if drawn["rotational"]:
        found["rotational"] = [[values[k] for k in held] for values in drawn["rotational"]]
    if drawn["pressure"]:
        pressure = np.interp(time, drawn["time"], np.array(drawn["pressure"], dtype=float))
        found["pressure"] = [float(f"{x:.7g}") if np.isfinite(x) else None for x in pressure]
    return found


def scene(run: Run) -> tuple[dict, dict]:
    """Return the constant data of a film of `run`: box, obstacles, species and disks."""
    radii, own = radii_of(run)
    facts = {
        "exact": run.n_disks <= FEW_DISKS,
        "settles": run.nature.in_equilibrium,
        "heated": bool(run.nature & {"thermal_walls", "thermostatted"}),
        "recycling": "recycled" in run.nature,
        "jumps": bool(run.nature & JUMPING),
        "isOpen": "open" in run.nature,
        "endsByEnergy": run.parameter("stop", "energy_fraction") is not None,
        "sources": [*run.parameters.get("source", {})],
        "gravity": run.gravity.tolist(),
        "lower": run.bounds[0].tolist(),
        "edges": (run.bounds[1] - run.bounds[0]).tolist(),
        "sides": sides(run),
        "open": [[time, run.open_at(time).tolist()] for time in opening_times(run)],
        "changes": [[time, f"{name} = {value or 'default'}"] for time, name, value in run.changes],
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
            *(f"the {side} side" for side in SIDES),  # names of the partners j <= 0
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
    """Return the values of a film, and its arrays as bytes."""
    tops = {name: scale_top(run, frames, name) for name in quantities(run)}
    told, blocks, turns = told_by_log(run, frames, room / 2 // TURN)
    drawn = curves(run)
    if turns and are_steps(run, frames):
        drawn |= energy_steps(run, drawn, turns)
    blocks = {name: block.tobytes() for name, block in blocks.items()}
    blocks |= moving(run, frames, tops.get("collisions", 1))
    # Displacements are measured from the positions in the first frame of the film, `origin`,
    # unwrapped across periodic sides. Disks that jump have no displacements.
    origin = run.position[frames[0]]
    if not run.nature & JUMPING:
        origin = run.unwrapped(0) + origin - run.unwrapped(frames[0])
    blocks["origins"] = in_room(run, origin).astype("<f4").tobytes()
    facts, own = scene(run)
    facts |= {
        "time": run.time[frames].tolist(),
        "curves": drawn,
        "scales": {name: [label_of(run, name), float(f"{top:.7g}")] for name, top in tops.items()},
        "colour": colour,
        "traced": traced or ([0] if run.n_disks == 1 else []),
        **told,
    }
    return facts, blocks | own


def texts(facts: dict, blocks: dict) -> dict:
    """Return the values and arrays of a film as text for a web page."""
    return {"facts": facts, "blocks": {k: base64.b64encode(v).decode() for k, v in blocks.items()}}
