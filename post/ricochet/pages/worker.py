"""Worker process of the laboratory, which runs a simulation and sends frames to a web page.

A request on standard input is a line of JSON. An answer on standard output begins with a letter, b
for a frame or t for a JSON object, and its length in four bytes. The item "is" of a JSON object is
"scene" (the constant part of the picture), "numbers", "events" (the next ones), "state",
"problems", "file" or "scan". The page confirms each frame by the request "got". While two frames
are not confirmed, the worker waits.

A frame begins with seven numbers of 8 bytes: the time, the collisions per disk, the positions of
the left, right, bottom and top side, and a number that marks the open sides. It is the sum of 1 for
the left, 2 for the right, 4 for the bottom and 8 for the top side, if these are open. Numbers of 4
bytes follow: positions x, y of all disks, velocities, and angles of rotating disks, in the byte
order of the computer. They are NaN for disks outside the box.

Changes are applied only at times at which all events have been processed completely. The Python
script written by the function `script` can therefore repeat the run bit for bit.
"""

import base64
import ctypes
import json
import os
import re
import resource
import select
import signal
import struct
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from ..analysis.statistics import correlated_mean
from ..reading.box import passages
from ..reading.reader import SIDES, Run
from ..running.program import ProgramError, value_text
from ..running.simulation import NEVER, Simulation
from .actions import let_in, scale_velocities, script, set_row, typical_speed, words
from .encounters import advance_and_record, are_recorded
from .numbers import (
    FEW_DISKS,
    TURNS,
    energies,
    means,
    observed,
    pressure_between,
    sample_of,
    sampled,
    snapshot_run,
)

DISKS = 20000  # largest number of disks
MEMORY = 2 << 30  # largest memory of a process [bytes]
INTERVAL = 1 / 60  # interval of frames [s]
SLICE = 0.012  # longest call of the engine between requests [s]
FRAMES_AHEAD = 2  # largest number of frames that the page has not drawn yet
NUMBERS_INTERVAL = 0.1  # interval of messages with numbers [s]
EVENTS_SENT = 6  # number of next events shown
MOST_SAMPLES = 4000  # largest number of samples kept
SCAN_SAMPLES = 160  # samples per value in a scan
SCAN_EVENTS = 1000  # fewest events in four intervals between samples
SCAN_SECONDS = 4.0  # time limit of a value in a scan, unless the request contains `seconds` [s]
COUNTED = ("collisions", "dissipated_energy")  # observables that are counts since the start
#: Input variables that define the motion of a side.
MOTION = ("motion", "velocity", "start_time", "end_time", "amplitude", "period", "phase")
MOTION += ("mass", "force")
AT_ONCE = 1e-9  # relative delay after which disks let in by the user enter
HOLD = 0.15  # time in which a dragged side reaches the pointer [s]
ENDINGS = {"input": ".nml", "script": ".py", "output": ".h5.part"}
UNREAD = bytearray()  # incomplete line at the end of the data received
PR_SET_PDEATHSIG = 1  # option of prctl


class Session:
    """Simulation shown on a page, and the pace at which it advances."""

    def __init__(self, describe_scene: Callable[[Run], tuple[dict, dict]]) -> None:
        """Store the function that converts the constant part of a picture to values and arrays."""
        self.describe_scene = describe_scene
        self.simulation: Simulation | None = None
        self.playing, self.ended, self.reason = False, False, ""
        self.pace = 0.0  # simulated time per second
        self.due = self.numbers_sent = time.perf_counter()
        self.unconfirmed = 0  # number of frames that the page has not confirmed
        self.actions: list[tuple] = []  # changes: time, kind, value as requested, exact value
        self.samples: deque[tuple[float, ...]] = deque(maxlen=MOST_SAMPLES)
        self.last_event: tuple | None = None
        self.encounters: list[dict] = []  # events of a few disks not yet sent to the page
        self.goal: tuple[float, int, int] | None = None  # end of a step in progress
        self.made = 0  # number of changes of variables when the scene was last sent
        self.held: dict[int, dict] = {}  # earlier motion of each dragged side, by its index
        self.led = False  # whether the page sets the time of each frame
        self.open_sides = 0  # sum of 1 << k over the open sides k
        self.closing: dict[str, str] | None = None  # side that a disk prevents from closing

    # --- requests ---

    def start(self, request: dict) -> None:
        """Replace the present simulation by one of a new input, if the input is valid."""
        pace = max(0.0, float(request["pace"] or 0.0))
        try:
            other = Simulation._of(request["text"], setting_lines(request["settings"]))
            if other.n_disks > DISKS:
                raise ProgramError(f"the laboratory allows {DISKS} disks", 2)
        except (ProgramError, ValueError) as problem:
            refuse(problem, name=f"{request['input']}.nml")
            return
        if self.simulation:
            self.simulation.close()
        self.simulation, self.request, self.initial, self.pace = other, request, other.input, pace
        self.actions, self.held, self.ended, self.reason = [], {}, False, ""
        self.playing, self.goal, self.led = bool(request["playing"]), None, False
        self.unconfirmed, self.encounters, self.closing = 0, [], None
        self.send_scene(changed=False)

    def send_scene(self, changed: bool) -> None:
        """Send the constant part of the picture after a start or a change of the simulation."""
        run = self.run = snapshot_run(self.simulation)
        self.samples.clear()
        self.made = len(self.simulation.changes)
        opens = run.open_at(self.simulation.time)
        self.open_sides = sum(1 << k for k, is_open in enumerate(opens) if is_open)
        facts, blocks = self.describe_scene(run)
        letters = {name: base64.b64encode(block).decode() for name, block in blocks.items()}
        speed = run.speed(0)[run.in_box(0)]
        facts |= {
            "top": float(1.5 * np.sqrt(2 * np.mean(speed**2)) or 1.0) if len(speed) else 1.0,
            "rest": float(np.mean(speed == 0)) if len(speed) else 0.0,
            "turning": TURNS in run.disk_data,
            "stepped": bool(run.time_step),
        }
        if are_recorded(run):
            facts["masses"] = run.mass.tolist()
        scene = {"is": "scene", "changed": changed, "run": self.request.get("run")}
        send_json(scene | {"facts": facts, "blocks": letters})
        self.send_frame()
        self.send_numbers()
        self.send_state()

    def change(self, request: dict) -> None:
        """Change variables of the running simulation."""
        self.apply("change", request["settings"])

    def heat(self, request: dict) -> None:
        """Multiply the velocities of all disks by the requested factor."""
        factor = float(request["factor"])
        self.apply("heat", factor, lambda: scale_velocities(self.simulation, factor))

    def place(self, request: dict) -> None:
        """Move one disk to a position."""
        x, y = map(float, request["position"])
        self.set_disk("position", int(request["disk"]), [x, y])

    def push(self, request: dict) -> None:
        """Double the kinetic energy of a disk; a disk at rest moves upwards at a typical speed."""
        disk = int(request["disk"])
        own = np.sqrt(2) * self.simulation.velocity[disk]
        upwards = [0.0, typical_speed(self.simulation)]
        self.set_disk("velocity", disk, own.tolist() if own.any() else upwards)

    def aim(self, request: dict) -> None:
        """Set the velocity of one disk to the requested value."""
        x, y = map(float, request["velocity"])
        self.set_disk("velocity", int(request["disk"]), [x, y], "aim")

    def set_disk(self, name: str, disk: int, value: list[float], what: str = "") -> None:
        """Set the position or the velocity of a disk; `what` is the name of the action."""
        if not 0 <= disk < self.run.n_disks:
            raise ValueError("no such disk")
        if np.isnan(self.simulation.position[disk, 0]):
            self.send_state(f"disk {disk + 1} is outside of the box")
            return
        change = partial(set_row, self.simulation, name, disk, value)
        self.apply(what or name, (disk, value), change)

    def hold(self, request: dict) -> None:
        """Move a side to a position at constant velocity, or restore its earlier motion.

        Its speed is at most the rms speed of the disks. If its earlier motion is impossible, it
        stays where it is.
        """
        number, target = int(request["side"]), request["to"]
        name, inwards = f"side.{SIDES[number]}.", 1 if number % 2 == 0 else -1
        now, known = self.simulation._settle(), self.simulation._values()
        rest = dict.fromkeys((name + word for word in MOTION), "")
        if target is None:
            before = self.held.pop(number, None)
            if before and not self.apply("hold", before, refused=False):
                self.apply("hold", {**rest, name + "motion": "still"})
            return
        old = {key: value_text(key, value) for key in rest if (value := known.get(key)) is not None}
        self.held.setdefault(number, {**rest, name + "motion": "still", **old})
        way = float(target) - float(self.run.corners_at(now)[number % 2][number // 2])
        taken = max(self.pace * HOLD, abs(way) / typical_speed(self.simulation), 1e-9)
        wish = {"motion": "constant_velocity", "velocity": repr(inwards * way / taken)}
        wish |= {"start_time": repr(now), "end_time": repr(now + taken)}
        self.apply("hold", rest | {name + word: value for word, value in wish.items()})

    def open_side(self, request: dict) -> None:
        """Open a side, or close it as soon as no disk overlaps it."""
        side, is_open = SIDES[int(request["side"])], bool(request["open"])
        wish = {f"side.{side}.open": value_text("", is_open)}
        self.closing = None
        if not self.apply("open_side", wish, refused=is_open) and not is_open:
            self.closing = wish
            self.send_state(f"the {side} side is closed as soon as no disk overlaps its line")

    def insert(self, request: dict) -> None:
        """Let at most the requested number of waiting disks enter through a source immediately."""
        now, known = self.simulation._settle(), self.simulation._values()
        then = now + AT_ONCE * (now + self.pace or 1.0)
        burst = {"count": int(request["count"]), "interval": then, "start_time": then}
        burst = {f"source.{request['source']}.{name}": value for name, value in burst.items()}
        burst[f"source.{request['source']}.end_time"] = then
        usual, before = {name: known.get(name) for name in burst}, self.simulation.present.sum()
        done = partial(let_in, self.simulation, burst, then, usual)
        is_done = self.apply("insert", (burst, then, usual), done)
        if is_done and self.simulation.present.sum() <= before:
            self.send_state("no disk waits outside, or there is no free place for it")

    def apply(
        self,
        what: str,
        value: object,
        change: Callable[[], object] | None = None,
        refused: bool = True,
    ) -> bool:
        """Apply a change at a time that a repeated run can reach exactly; return True on success.

        If `change` is None, `value` holds new settings of variables. If `refused`, the page
        receives the reason for a failure.
        """
        try:
            now = self.simulation._settle()
            if change:
                change()
            else:
                self.simulation._change(setting_lines(value))
        except (ProgramError, ValueError) as problem:
            if what == "change":
                refuse(problem, change=True)
            elif refused:
                self.send_state(str(problem))
            return False
        exact = value
        if change is None:
            known = self.simulation._values()
            exact = {name: known.get(name) for name in value}
        self.actions.append((now, what, value, exact))
        self.send_scene(changed=True)
        return True

    def play(self, _: dict) -> None:
        """Continue the simulation."""
        self.playing, self.goal, self.due = True, None, time.perf_counter()
        self.led = False
        self.send_state()

    def pause(self, _: dict) -> None:
        """Pause the simulation."""
        self.playing, self.goal, self.led = False, None, False
        self.send_numbers()
        self.send_state()

    def set_pace(self, request: dict) -> None:
        """Set the simulated time per second of real time."""
        self.pace = max(0.0, float(request["pace"]))

    def got(self, _: dict) -> None:
        """Record that the page has drawn another frame."""
        self.unconfirmed = max(0, self.unconfirmed - 1)

    def step(self, request: dict) -> None:
        """Advance the simulation by the requested time and pause."""
        if not (more := float(request["time"])) >= 0:
            raise ValueError("a step cannot go back in time")
        self.playing, self.led = False, False
        self.goal = self.simulation.time + more, NEVER, NEVER

    def reach(self, request: dict) -> None:
        """Advance to the time at which the page compares several runs, and wait for a request."""
        self.led, self.goal = True, (float(request["time"]), NEVER, NEVER)

    def event(self, request: dict) -> None:
        """Advance the simulation by one event and pause."""
        coming = [] if self.run.time_step else self.simulation.next_events(1)
        if not coming and not self.run.time_step:
            self.pause(request)  # no further event can occur
            return
        self.playing, self.led = False, False
        self.goal = np.inf, NEVER, self.simulation.events + 1
        self.last_event = coming[0] if coming else None

    def keep(self, request: dict) -> None:
        """Send a file requested by the user: the `input`, a `script` or the `output`."""
        name, part = self.request["input"], request["part"]
        try:
            end = self.simulation.time if self.ended else self.simulation._settle()
            if part == "output":
                body = self.output_file(f"{name}.h5")
            elif part == "script":
                body = script(name, self.initial, self.actions, end)
            else:
                body = self.simulation.input if self.actions else self.initial
        except (OSError, ProgramError) as problem:
            refuse(problem)
            return
        if isinstance(body, str):
            body = body.encode(errors="surrogateescape")
        letters = base64.b64encode(body).decode()
        send_json({"is": "file", "name": name + ENDINGS[part], "body": letters})

    def output_file(self, name: str) -> bytes:
        """Return the contents of an output file, delaying TERM until its folder is removed."""
        ends: list[int] = []  # not blocked, because a thread of a library would then receive it
        before = signal.signal(signal.SIGTERM, lambda number, _: ends.append(number))
        try:
            with tempfile.TemporaryDirectory(prefix="ricochet-lab-") as folder:
                return self.simulation.save(Path(folder) / name).read_bytes()
        finally:
            signal.signal(signal.SIGTERM, before)
            if ends:
                sys.exit()

    # --- progress of the simulation, and messages to the page ---

    def is_advancing(self) -> bool:
        """Return whether the simulation should advance now."""
        ready = self.simulation and not self.ended and self.unconfirmed < FRAMES_AHEAD
        return bool(ready and (self.goal or (self.playing and self.pace > 0 and not self.led)))

    def advance(self) -> None:
        """Advance towards the time of the next frame, for at most `SLICE` seconds of real time."""
        now = time.perf_counter()
        passed, self.due = min(now - self.due, 0.1), now
        stepping = self.goal and not self.led
        limits = self.goal or (self.simulation.time + self.pace * passed, NEVER, NEVER)
        try:
            if self.go_on(limits) and self.goal:
                return  # a step is shown only when complete
        except ProgramError as problem:
            self.ended, self.reason = True, str(problem)
        self.goal = None
        if self.closing and self.apply("open_side", self.closing, refused=False):
            self.closing = None
        if len(self.simulation.changes) != self.made:  # a change scheduled in the input
            self.send_scene(changed=True)
        self.send_frame()
        if self.ended or stepping or now > self.numbers_sent + NUMBERS_INTERVAL:
            self.send_numbers()
        if self.ended or stepping:
            self.send_state()

    def go_on(self, limits: tuple[float, int, int]) -> bool:
        """Advance for at most `SLICE`; return True as long as no limit has been reached."""
        if are_recorded(self.run):
            return advance_and_record(self.simulation, limits, SLICE, self.record)
        return self.simulation._go_on(limits, SLICE)

    def record(self, event: dict) -> None:
        """Store an event of a few disks with the energies after it."""
        self.encounters.append(event | energies(self.run, observed(self.simulation)))

    def send_frame(self) -> None:
        """Send a frame."""
        run, simulation = self.run, self.simulation
        now = simulation.time
        lower, upper = run.corners_at(now)
        if np.any(lower < run.bounds[0]) or np.any(upper > run.bounds[1]):
            self.send_scene(changed=True)
            return
        head = [
            now,
            2 * simulation.collisions / run.n_disks,
            lower[0],
            upper[0],
            lower[1],
            upper[1],
            self.open_sides,
        ]
        parts = [simulation.position, simulation.velocity]
        if TURNS in run.disk_data:
            parts.append(simulation.orientation)
        if "recycled" in run.nature:
            parts.append(simulation.recycled)
        body = b"".join(np.asarray(part, dtype=np.float32).tobytes() for part in parts)
        send(b"b", struct.pack("7d", *head) + body)
        self.unconfirmed += 1
        if run.n_disks <= FEW_DISKS and not run.time_step and not self.ended:
            coming = simulation.next_events(EVENTS_SENT)
            events = {"next": coming, "happened": self.last_event, "encounters": self.encounters}
            send_json({"is": "events"} | events)
            self.last_event, self.encounters = None, []

    def send_state(self, problem: str = "") -> None:
        """Send the state of the simulation, its changes so far, and the reason for a refusal."""
        changes = [
            (when, name, value)
            for when, what, values, _ in self.actions
            for name, value in (values.items() if what == "change" else [("", words(what, values))])
        ]
        times = {when for when, *_ in self.actions}
        times |= {value[1] for _, what, value, _ in self.actions if what == "insert"}
        planned = [one for one in self.simulation.changes if one[0] not in times]
        changes = sorted(changes + planned, key=lambda one: one[0])
        # While the user drags a side, this change is described only once.
        changes = [
            one
            for k, one in enumerate(changes)
            if k == 0 or one[1:] != changes[k - 1][1:] or not one[2].endswith("is dragged")
        ]
        state = {"playing": self.playing, "ended": self.ended, "reason": problem or self.reason}
        send_json({"is": "state", "changes": changes} | state)

    def send_numbers(self) -> None:
        """Send the present energies, and means since the last change with their errors."""
        self.numbers_sent = time.perf_counter()
        run, value = self.run, observed(self.simulation)
        now = value["time"]
        if not self.samples or now > self.samples[-1][0]:
            self.samples.append(sample_of(run, value))
        energy = run.n_disks * value["all/kinetic_energy"]
        if "rough" in run.nature:
            energy += run.n_disks * value["all/rotational_energy"]
        facts = {
            "time": now,
            "settles": run.nature.in_equilibrium,
            "speed": value["all/mean_speed"],
            "pressure": value["virial_pressure"] if value["collisions"] > 0 else None,
            "means": means(run, self.samples, energy),
        }
        if "inside" in value:
            facts["inside"] = [value[f"{name}/particle_number"] for name in run.names]
            for name, parts in passages(value).items():
                facts[name] = sum(value[part] for part in parts)
        send_json({"is": "numbers"} | facts | energies(run, value))


# --- messages ---


def setting_lines(settings: dict[str, str]) -> list[str]:
    """Return each setting in the form GROUP.VARIABLE=VALUE of the option `--set`."""
    lines = [f"{name}={value}" for name, value in settings.items()]
    if any("\n" in line or "\r" in line for line in lines):
        raise ValueError("a value must not contain line ends")
    return lines


def problems(reason: Exception, name: str = "input") -> list[dict]:
    """Return the error messages of the program, each with the setting that caused it.

    A message about a setting is shown beside its field, and therefore omits its name. All other
    messages begin with the `name` of the input file and the line.
    """
    found = []
    for line in str(reason).splitlines():
        place = line.removeprefix("--set ").partition("=")[0] if line.startswith("--set ") else ""
        text = re.sub(r"^--set .*: \w+\.\w+: ", "", line)
        found.append({"place": place, "text": re.sub(r"^input(?=:)", name, text)})
    return found


def refuse(reason: Exception, change: bool = False, name: str = "input") -> None:
    """Tell the page why a request was refused."""
    send_json({"is": "problems", "change": change, "problems": problems(reason, name)})


def send(kind: bytes, body: bytes) -> None:
    """Write an answer to standard output."""
    sys.stdout.buffer.write(kind + struct.pack(">I", len(body)) + body)
    sys.stdout.buffer.flush()


def send_json(message: dict) -> None:
    """Write an answer to standard output as JSON."""
    try:
        text = json.dumps(message, allow_nan=False)
    except ValueError:  # NaN and infinity are sent as null
        text = json.dumps(json.loads(json.dumps(message), parse_constant=lambda _: None))
    send(b"t", text.encode())


def requests(wait: float | None) -> list[dict]:
    """Return all requests that have arrived, waiting for the first for at most `wait` seconds."""
    if select.select([0], [], [], wait)[0]:
        data = os.read(0, 1 << 20)
        if not data:
            sys.exit()  # the laboratory has ended
        UNREAD.extend(data)
    *lines, rest = UNREAD.split(b"\n")
    UNREAD[:] = rest
    found = list(map(json.loads, lines))
    starts = [request for request in found if request["do"] == "start"]
    return [one for one in found if one not in starts[:-1]]  # only the last start counts


def scan(request: dict) -> None:
    """Run a simulation for each of several values of a variable, and send each result or error."""
    for index, value in enumerate(request["values"]):
        try:
            lines = setting_lines(request["settings"] | {request["variable"]: value})
            seconds = request.get("seconds", SCAN_SECONDS)
            mean, error = measure(request["text"], lines, request["of"], seconds)
            found = {"mean": mean, "error": error}
        except (ProgramError, ValueError) as problem:
            found = {"problems": problems(problem)}
        send_json({"is": "scan", "index": index} | found)


def measure(text: str, lines: list[str], name: str, seconds: float) -> tuple[float, float | None]:
    """Return the time average of an observable and its error, after at most `seconds`.

    For a count (`COUNTED`) this is the rate of growth. Samples are half a collision per disk apart;
    the second half is averaged. An error is returned only if the run relaxes to equilibrium.
    """
    samples, began = [], time.perf_counter()
    with Simulation._of(text, lines) as simulation:
        count, settles = simulation.n_disks, simulation.nature.in_equilibrium
        step = max(count, SCAN_EVENTS) // 4
        while len(samples) < SCAN_SAMPLES and time.perf_counter() < began + seconds:
            value = observed(simulation)
            samples.append((*sampled(count, value), value[name]))
            simulation._go_on((np.inf, NEVER, simulation.events + step), seconds / SCAN_SAMPLES)
    late = np.array(samples[len(samples) // 2 :]).T
    apart = np.diff(late[0])
    if not apart.any():
        raise ValueError("cannot measure: no collisions, or all collisions at the same time")
    if name == "virial_pressure":  # a mean since the start
        one = pressure_between(late)
    else:
        gain = np.diff(late[-1]) if name in COUNTED else late[-1][1:] * apart
        one = correlated_mean(gain, apart)
    if np.isnan(one.mean):
        raise ValueError("cannot measure: no disk is left in the box")
    return float(one.mean), float(one.error) if settles and np.isfinite(one.error) else None


def work(describe_scene: Callable[[Run], tuple[dict, dict]]) -> None:
    """Answer requests of the page until the server of the laboratory closes the connection."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # handled by the laboratory
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    session = Session(describe_scene)
    handlers = {"start": session.start, "scan": scan, "pace": session.set_pace}
    own = (
        "change",
        "heat",
        "place",
        "push",
        "aim",
        "hold",
        "play",
        "pause",
        "got",
        "step",
        "reach",
        "event",
        "keep",
        "open_side",
        "insert",
    )
    handlers |= {name: getattr(session, name) for name in own}
    while True:
        wait = None
        if session.is_advancing():
            wait = max(0.0, session.due + INTERVAL - time.perf_counter())
        for request in requests(wait):
            try:
                if request["do"] in ("start", "scan") or session.simulation:
                    handlers[request["do"]](request)
            except (AttributeError, LookupError, OverflowError, TypeError, ValueError) as problem:
                send_json({"is": "state", "reason": f"invalid request: {problem}"})
        if session.is_advancing() and time.perf_counter() >= session.due + INTERVAL:
            session.advance()
