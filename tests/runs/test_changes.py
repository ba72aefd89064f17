"""Changes of a running simulation, which continues exactly like one loaded from a file.

Each test advances a random system and changes it at random times: gravity, the collision rules and
motions of all boundaries, the driving, the contact law and the velocities. The first simulation of
a system also attempts invalid changes, and changes to equal values, which must have no effect. Two
further simulations advance to the same times in different steps, on several threads, with another
search and event queue, and are saved and loaded between changes. The program continues the last
saved file. All final states must be bit-identical.

The environment variables SYSTEMS and SEED set the number of systems and the seed, for example
`SYSTEMS=300 SEED=20270131`. `make check` uses a new seed every day.
"""

import os
import random
import re
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from random_systems import SIDES, Draw, numbers, starting_file
from ricochet import ProgramError, Simulation, read_run
from run_laws import BALANCE, imbalance, pair_gaps, wall_gaps
from test_random_systems import accepted, first_kept
from whole_runs import contents, ran, within

COUNT = int(os.environ.get("SYSTEMS", "20"))
KEPT = 8  #: number of systems in `make test`
SEEDS = [f"{os.environ.get('SEED', '1')} change {k}" for k in range(COUNT)]
MOST_DISKS = 300
MOST_EVENTS, MOST_STEPS, MOST_KICKS = 600, 300, 30  #: between two changes
DEEPEST = 1e-12  #: largest overlap, relative to the larger of diameter and box
LAW = (
    "restitution",
    "rule",
    "tangential_restitution",
    "friction",
    "temperature",
    "surface_velocity",
)
MOTION = ("motion", "velocity", "amplitude", "period", "phase", "start_time", "end_time")
MOTION += ("mass", "force")
DRIVE = ("kind", "interval", "strength", "keep_momentum", "temperature", "fraction")
DRIVE += ("self_propulsion_speed", "rotational_diffusion", "turning_rate", "species")
CONTACT = ("restitution", "pair_restitution", "wall_restitution", "restitution_law")
CONTACT += ("reference_speed", "wall_rule", "tangential_restitution", "friction", "inertia")
CONTACT += ("wall_tangential_restitution", "wall_friction")
SAMPLED = ("total_energy", "dissipated_energy", "heat", "work", "drive_energy")
SAMPLED += ("all/kinetic_energy", "outflow_energy", "inflow_energy", "inside")
#: Features with which the trajectory depends on more than the present state of the disks.
MEMORY = r"&drive|contact_time|temperature =|motion =|shear_rate|'steps'|pair_restitution"
MEMORY += "|&source|&change|waiting =|open ="


class Change(NamedTuple):
    """Change of a simulation: settings GROUP.VARIABLE=VALUE, or velocities of all disks."""

    settings: list[str]
    velocity: np.ndarray | None = None

    def apply(self, simulation: Simulation) -> None:
        """Apply this change to a simulation at its present time."""
        if self.velocity is None:
            simulation._change(self.settings)
        else:
            simulation.velocity = self.velocity


def settings(group: str, words: str, reset: tuple[str, ...] = ()) -> list[str]:
    """Return settings GROUP.VARIABLE=VALUE, with default values for the variables in `reset`."""
    values = dict(re.findall(r"(\w+) = ('\w+'|[^ ,]+(?:, [^ ,]+)*)", words))
    return [f"{group}.{name}={values.get(name, '')}" for name in {**dict.fromkeys(reset), **values}]


def drawn_change(simulation: Simulation, draw: Draw) -> Change:
    """Return a random change that is valid for the initial system, but may be refused later."""
    rng = draw.rng
    walls = {name.rpartition(".")[0] for name in simulation._values()}
    walls = sorted(wall for wall in walls if wall.startswith(("obstacle.", "wall.")))
    sides = [f"side.{name}" for k, name in enumerate(SIDES) if not draw.periodic[k // 2]]
    kinds = ["velocity", "velocity", "contact", "box", "drive", *["law"] * bool(walls + sides)]
    openings = ["opening"] * (2 * bool(draw.openings.lids + draw.openings.sources))
    match rng.choice([*kinds, *openings, *["motion"] * min(len(sides), 3)]):
        case "opening":
            return Change([draw.openings.setting()])
        case "velocity":
            return Change([], drawn_velocity(simulation, draw))
        case "law":
            return Change(settings(rng.choice(walls + sides), draw.law(), LAW))
        case "motion":
            words = draw.side_motion() if draw.chance(0.8) else ""
            words = re.sub(
                "(?<=_time = )[^ ]+", lambda t: repr(float(t[0]) + simulation.time), words
            )
            return Change(settings(rng.choice(sides), words, MOTION))
        case "box":
            unit = rng.choice([0, 1, 10, 1e6]) * draw.speed**2 / max(draw.edges)
            pull = [0 if ends else unit * rng.uniform(-1, 1) for ends in draw.periodic]
            return Change([f"box.gravity={numbers(*pull)}"])
        case "drive":
            driven, draw.driven = draw.driven, True
            words, draw.driven = draw.drive(), driven
            return Change(settings("drive", words if draw.chance(0.7) else "", DRIVE))
    words = draw.contact()
    if simulation.parameters["contact"]["contact_time"] == 0:
        words = re.sub(" contact_time = [^ ]+", "", words)
    return Change(settings("contact", words, CONTACT))


def drawn_velocity(simulation: Simulation, draw: Draw) -> np.ndarray:
    """Return new random velocities, which may depend on the present ones."""
    rng, velocity = draw.rng, simulation.velocity
    if draw.chance(0.25):  # NaN velocities of disks outside have no effect
        return np.where(np.isfinite(velocity[::-1]), velocity[::-1], 0)
    if draw.chance(0.3):
        speed = rng.choice([0, draw.speed, draw.speed * 10.0 ** rng.randint(-9, 9)])
        own = np.random.default_rng(rng.randint(0, 10**6))
        return own.normal(0, speed, velocity.shape)
    return velocity * rng.choice([0, 0.9, -1, 1e-6, 1e6, 10.0 ** rng.uniform(-9, 9)])


class Course:
    """Simulation of a random system, with a record of its changes for repetitions."""

    def __init__(self, program: Path, seed: str):
        """Draw a random system, and write its input file to a folder."""
        self.program, self.rng = program, random.Random(seed)
        system = accepted(program, Path(), self.rng, most=MOST_DISKS)
        self.draw, self.steps = system.draw, "'steps'" in system.text
        text = re.sub(r"^&stop.*$", "&stop events = 1000000000 /", system.text, flags=re.MULTILINE)
        text = re.sub(r"^&output.*$", "&output /", text, flags=re.MULTILINE)
        Path("case.nml").write_text(text)
        self.moments: list[tuple[dict, float]] = []  #: arguments of `advance`, and the time reached
        #: number of these moments before a change, and the change
        self.changes: list[tuple[int, Change]] = []
        self.message = ""  #: message with which it aborted
        self.faults: list[str] = []
        self.samples: dict[str, list] = {name: [] for name in SAMPLED}
        self.found: dict = {}  #: contents of all its files

    def next_moment(self, simulation: Simulation) -> dict:
        """Return when the next change occurs, after a number of events or at a time."""
        rng, draw = self.rng, self.draw
        speed = float(np.nan_to_num(simulation.observable("all/mean_speed"))) or draw.speed
        if draw.sheared:
            speed = max(speed, draw.speed)  # images move
        time = rng.choice([0.01, 0.3, 10]) * rng.random() * min(draw.edges) / speed
        if self.steps:
            time = min(time, MOST_STEPS * draw.step)
        if (drive := simulation.parameters["drive"])["kind"] != "none":
            time = min(time, MOST_KICKS * drive["interval"])
        events = simulation.events + rng.randint(1, MOST_EVENTS)
        return {"time": simulation.time + time, "events": events}

    def advance(self, simulation: Simulation) -> None:
        """Advance the simulation to the next change."""
        moment = self.next_moment(simulation)
        self.moments.append((moment, simulation.time))
        simulation.advance(**moment)
        self.moments[-1] = moment, simulation.time

    def run(self) -> Simulation:
        """Execute the first simulation, which all others repeat."""
        simulation = Simulation("case.nml")
        self.look(simulation)
        try:
            for _ in range(self.rng.randint(1, 5)):
                if self.rng.random() < 0.9:
                    self.advance(simulation)
                change = drawn_change(simulation, self.draw)
                self.look(simulation)
                self.attempt(simulation, change)
                self.look(simulation)
            before = simulation.events
            self.advance(simulation)
            self.look(simulation)
            self.lively = simulation.events > before
        except ProgramError as error:
            self.message = str(error)
        self.judge_energy()
        return simulation

    def attempt(self, simulation: Simulation, change: Change) -> None:
        """Attempt a change that may be refused, together with a change to equal values."""
        if self.rng.random() < 0.3:
            self.change_nothing(simulation)
        before = facts(simulation)
        try:
            change.apply(simulation)
        except ProgramError as error:
            if unlike(before, facts(simulation)):
                self.faults.append(f"changed although it was refused: {change} {error}")
        else:
            self.changes.append((len(self.moments), change))
        if self.rng.random() < 0.3:
            self.change_nothing(simulation)

    def change_nothing(self, simulation: Simulation) -> None:
        """Apply a change that leaves all values the same."""
        before, known = facts(simulation), (simulation.changes, simulation.input)
        if self.rng.random() < 0.3:
            simulation.velocity = simulation.velocity
        else:
            lines = (line.split(" = ", 1) for line in simulation._text("parameters").splitlines())
            same = [f"{name}={text}" for name, text in lines if text[0] not in '["']
            pattern = r"contact|drive\.i|(side|wall|obstacle)\.\w+\.(restitution|temperature)"
            same = [line for line in same if re.match(pattern, line)]
            simulation._change(self.rng.sample(same, min(3, len(same))))
        if unlike(before, facts(simulation)) or (simulation.changes, simulation.input) != known:
            self.faults.append(f"a change of nothing: {unlike(before, facts(simulation))}")

    def look(self, simulation: Simulation) -> None:
        """Record the energies, and determine the largest overlap of disks."""
        observed = simulation._observed()
        for name, values in self.samples.items():
            if name in observed or name != "inside":  # missing in closed systems
                values.append(float(observed[name][0]) if name in observed else 0.0)
        simulation.save("look.h5", force=True)
        self.found |= (found := contents("look.h5.part"))
        if self.steps:
            return
        time, place = simulation.time, simulation.position
        for name, values in observed.items():
            path = f"/observables/{name}"
            found |= {f"{path}/value": np.array([values]), f"{path}/time": np.array([time])}
        edges = found["/particles/disks/box/edges"]
        for gap, width in (*pair_gaps(found, time, place), *wall_gaps(found, time, place)):
            allowed = DEEPEST * np.maximum(2 * width, edges.max())
            if np.any(-gap > allowed):
                deepest = np.max(-gap / allowed)
                self.faults.append(f"overlap {deepest:g} times what is allowed at {time}")

    def judge_energy(self) -> None:
        """Check the energy balance of the whole simulation."""
        found = {name: value for name, value in self.found.items() if "/observables" not in name}
        for name, values in self.samples.items():
            if values:
                found[f"/observables/{name}/value"] = np.array(values)
        if (part := imbalance(found) / BALANCE) > 1:
            self.faults.append(f"energy: {part:g} times what is allowed")

    def repeat(self, name: str) -> Simulation:
        """Repeat the simulation with other steps and methods, saving and loading it."""
        rng, simulation = self.rng, Simulation("case.nml", *self.way())
        for k in range(len(self.moments) + 1):
            if k > 0:
                moment, last = self.moments[k - 1]
                now = simulation.time
                for part in sorted(rng.random() for _ in range(rng.choice([0, 1, 5]))):
                    if now + (last - now) * part < last:
                        simulation.advance(time=now + (last - now) * part)
                    simulation = kept(simulation, name) if rng.random() < 0.2 else simulation
                simulation.advance(**moment)
                simulation = kept(simulation, name) if rng.random() < 0.3 else simulation
            for change in (change for after, change in self.changes if after == k):
                change.apply(simulation)
                simulation = kept(simulation, name) if rng.random() < 0.5 else simulation
        return simulation

    def way(self) -> tuple[dict[str, str], int]:
        """Return random variables, and a number of threads, that must not affect the results."""
        searches = ["cells", "pairs", *["rescan"] * (self.draw.disks <= 60)]
        ways = {"run.search": self.rng.choice(searches)}
        if not self.steps:
            ways["run.queue"] = self.rng.choice(["calendar", "heap"])
        return ways, self.rng.choice([1, 1, 2, 3])

    def continue_by_program(self, simulation: Simulation) -> None:
        """Check that the program continues a saved file to the final state of the simulation."""
        simulation.save("last.h5", force=True, input="last.nml")
        moment = self.next_moment(simulation)
        stop = [f"--set=stop.{name}={value!r}" for name, value in moment.items()]
        done = ran(self.program, "last.nml", "-o", "last.h5", "--resume", "--quiet", *stop)
        try:
            simulation.advance(**moment)
        except ProgramError as error:
            if str(error) not in done.stderr:
                self.faults.append(f"the program ends otherwise: {done.stderr}, not {error}")
            return
        if done.returncode:
            self.faults.append(f"the program fails: {done.stderr}")
            return
        run, here = read_run("last.h5"), facts(simulation)
        there = {name: run.observable(name).value[-1] for name in simulation.observables}
        there |= {"position": run.position[-1], "velocity": run.velocity[-1], "time": run.time[-1]}
        if different := [
            name
            for name in there
            if not np.array_equal(here[name].ravel(), np.ravel(there[name]), equal_nan=True)
        ]:
            where = run.time[-1], simulation.time
            self.faults.append(f"the program differs: {different}, times {where}")

    def start_from_last_frame(self, simulation: Simulation) -> None:
        """Check that a run starting from the last frame has the same first collisions."""
        text, slowest = simulation.input, np.abs(simulation.velocity)
        if re.search(MEMORY, text) or np.any((slowest > 0) & (slowest < 1e-100)):
            return
        names = ["x", "y", "vx", "vy", "radius", "mass"]
        columns = [simulation.position, simulation.velocity, simulation.radius, simulation.mass]
        if hasattr(simulation, "angular_velocity"):
            names, columns = [*names, "omega"], [*columns, simulation.angular_velocity]
        Path("frame.txt").write_text(starting_file(names, np.column_stack(columns)))
        text = re.sub(r"&species.*?\n/\n", "", text, flags=re.DOTALL)
        try:
            new = Simulation(text + "&species name = 's0' file = 'frame.txt' /\n")
        except ProgramError as error:
            if not re.search("not wholly|overlaps", str(error)):  # by rounding
                self.faults.append(f"no start from the last frame: {error}")
            return
        begin, met = simulation.time, set()
        events = zip(simulation.next_events(20), new.next_events(20), strict=False)
        for (time, i, j), (new_time, new_i, new_j) in events:
            if met & {i, j, new_i, new_j} - {0}:
                break  # later events depend on rounding
            met |= {i, j} if j > 0 else {i}
            if abs(time - begin - new_time) > 1e-6 * new_time + 8 * np.spacing(begin):
                self.faults.append(f"a new run collides otherwise: {i} {j} at {time} from {begin}")
                break


def kept(simulation: Simulation, name: str) -> Simulation:
    """Save and load a simulation, and return the loaded one."""
    simulation.save(f"{name}.h5", force=True)
    simulation.close()
    return Simulation.load(f"{name}.h5")


def facts(simulation: Simulation) -> dict[str, np.ndarray]:
    """Return all properties of the state of a simulation."""
    names = ("time", "events", "collisions", "position", "velocity", "image", "orientation")
    there = {name: getattr(simulation, name, None) for name in names}
    return simulation._observed() | {n: np.array(v) for n, v in there.items() if v is not None}


def unlike(one: dict, other: dict) -> list[str]:
    """Return the names of properties that differ in any bit."""
    same = {name for name in one if name in other and one[name].tobytes() == other[name].tobytes()}
    return sorted((one.keys() | other.keys()) - same)


def without_ways(text: str) -> str:
    """Return an input text without the variables that must not affect the results."""
    return re.sub(r"  (search|queue) = .*\n", "", text)


def faults(program: Path, seed: str) -> list[str]:
    """Return descriptions of all faults found in simulations of a random system."""
    course = Course(program, seed)
    first = course.run()
    for name in ("again", "other"):
        try:
            other = course.repeat(name)
        except ProgramError as error:
            if str(error) != course.message:
                course.faults.append(f"{name} ends otherwise: {error}, not {course.message}")
            continue
        if course.message:
            course.faults.append(f"{name} does not end with {course.message}")
        elif different := unlike(facts(first), facts(other)):
            course.faults.append(f"{name} differs: {different}")
        elif (first.changes, first.input) != (other.changes, without_ways(other.input)):
            course.faults.append(f"{name} has another input")
    if not course.message:
        if course.lively:
            course.start_from_last_frame(first)
        course.continue_by_program(first)
    return course.faults


@pytest.mark.parametrize("seed", first_kept(SEEDS, KEPT))
def test_a_changed_simulation_continues_exactly(program, tmp_path, monkeypatch, seed):
    monkeypatch.chdir(tmp_path)
    said = faults(program, seed)
    assert not said, "\n".join([*said, Path("case.nml").read_text()])


def test_a_change_suppresses_no_collision():
    """After the change, and at the same time, two disks collide again across periodic sides."""
    gas = Simulation(
        """&box boundary = 'periodic', 'periodic' /
        &species name = 'a' radius = 0.1 position = 0.3, 0.5, 0.7, 0.5 velocity = 1, 0, 0, 0 /"""
    )
    gas.advance(time=0.7).change({"contact.wall_restitution": 0.5})
    gas.advance(time=1)
    assert gas.collisions == 2 and gas.changes
    assert gas.observable("total_energy") == pytest.approx(0.5, rel=1e-15)


@pytest.mark.parametrize("pull", [-1e35, -1e50, -1e90])
def test_extreme_accelerations_leave_the_caller_in_control(pull):
    """`advance` returns after a limited time even for extremely accelerated disks."""
    script = f"""
from ricochet import Simulation
disks = {{"count": 50, "packing_fraction": 0.1, "speed": 1}}
gas = Simulation({{"species": disks}}).advance(events=77)
gas.change({{"box.gravity": (0, {pull})}})
events = gas.events
assert gas._go_on((1.0, 2**62, 2**62), 0.05) and gas.events > events"""
    assert ran(*within(60), sys.executable, "-c", script).returncode == 0


@pytest.mark.parametrize("factor", [1e-3, 1e-9, 1e-11])
def test_a_gas_that_was_slow_for_long_is_exact_when_it_is_fast_again(factor):
    """Overlaps stay within rounding errors, because times are relative to the change."""
    disks = {"count": 50, "packing_fraction": 0.2, "speed": 1}
    gas = Simulation({"species": disks}).advance(time=0.5)
    gas.velocity = factor * gas.velocity
    gas.advance(events=gas.events + 100).velocity = gas.velocity / factor
    assert deepest_overlap(gas, 60) < 1e-12 * 2 * gas.radius[0]


@pytest.mark.parametrize(
    "group",
    [
        {"side": {"name": "left", "temperature": 1}},
        {"obstacle": {"centre": [0.5, 0.5], "radius": 0.1, "temperature": 1e6}},
        {"side": {"name": "left", "motion": "sawtooth", "velocity": 1}},
        {"contact": {"tangential_restitution": 0.5}},
    ],
)
@pytest.mark.parametrize("speed", [1e-6, 1e-12])
def test_slow_disks_that_an_event_makes_fast_are_exact(group, speed):
    """A hot or moving boundary, or friction with fast rotating disks, accelerates slow disks."""
    disks = {"count": 50, "packing_fraction": 0.1, "speed": speed, "angular_velocity": 30}
    gas = Simulation({"species": disks, **group})
    while np.abs(gas.velocity).max() < 1e3 * speed:
        gas.advance(events=gas.events + 1)
    assert gas.time > 1e-4 / speed
    assert deepest_overlap(gas, 200) < DEEPEST


@pytest.mark.parametrize(
    "drive",
    [
        {"kind": "noise", "keep_momentum": False},
        {"kind": "andersen", "temperature": 1, "fraction": 0.5},
        {"kind": "brownian", "temperature": 1},
    ],
)
@pytest.mark.parametrize("speed", [1e-6, 1e-12])
def test_slow_disks_that_a_kick_makes_fast_are_exact(drive, speed):
    """A kick accelerates disks after a long time of slow motion."""
    drive = {"interval": 1 / speed, **drive}
    if drive["kind"] == "noise":
        drive["strength"] = speed  # each kick then adds the variance 1
    disks = {"count": 50, "packing_fraction": 0.1, "speed": speed}
    gas = Simulation({"species": disks, "drive": drive}).advance(time=0.999 / speed)
    assert np.abs(gas.velocity).max() < 1e2 * speed
    while np.abs(gas.velocity).max() < 1e3 * speed:
        gas.advance(events=gas.events + 1)
    assert deepest_overlap(gas, 200) < DEEPEST


def deepest_overlap(gas: Simulation, events: int) -> float:
    """Return the largest overlap of two equal disks during a number of events."""
    deepest, (one, other) = 0.0, np.triu_indices(gas.n_disks, 1)
    for _ in range(events):
        gas.advance(events=gas.events + 1)
        apart = np.hypot(*(gas.position[one] - gas.position[other]).T)
        deepest = max(deepest, np.max(2 * gas.radius[0] - apart))
    return deepest


@pytest.mark.parametrize(
    ("act", "reached"),
    [
        (lambda gas: setattr(gas, "velocity", 0 * gas.velocity), True),  # waits until it ends
        (lambda gas: setattr(gas, "velocity", 1e-14 * gas.velocity), True),  # not cold yet
        (lambda gas: gas.change({"contact.restitution": 1}), True),
        (lambda _: None, False),
    ],
)
def test_a_cold_gas_ends_at_the_same_time_in_memory_and_by_the_program(
    program, tmp_path, monkeypatch, act, reached
):
    """A gas stops after cooling by 1e-25, relative to the velocities after the last change."""
    monkeypatch.chdir(tmp_path)
    text = "&box upper = 1, 1 boundary = 'periodic', 'periodic' /\n&contact restitution = 0.1 /\n"
    text += "&species name = 'a' radius = 0.1 position = 0.3, 0.5, 0.7, 0.5"
    text += " velocity = 1, 0, -1, 0 /\n&stop time = 1e20 /\n"
    gas = Simulation(text).advance(time=2)
    act(gas)
    gas.save("gas.h5", input="gas.nml")
    end = 20.0 if reached else 1e18
    ran(program, "gas.nml", "-o", "gas.h5", "--resume", f"--set=stop.time={end}", check=True)
    assert (gas.advance(time=end).time == end) is reached
    assert read_run("gas.h5").time[-1] == gas.time


def test_a_piston_without_force_does_work():
    """Disks transfer energy to the piston, and the piston to other disks."""
    disks = {"name": "a", "count": 30, "packing_fraction": 0.1, "speed": 1}
    piston = {"name": "right", "motion": "piston", "mass": 10, "force": 0}
    gas = Simulation({"species": disks, "side": piston}).advance(events=300)
    assert gas.observable("work") != 0
    assert gas.observable("total_energy") - gas.observable("work") == pytest.approx(15, rel=1e-12)


def test_a_held_piston_is_released_where_it_is_and_held_there():
    """A piston can be stopped and released at any time; the saved input gives its position."""
    disks = {"name": "a", "count": 30, "packing_fraction": 0.1, "speed": 1}
    gas = Simulation({"species": disks}).advance(time=0.5)
    gas.change({"side.right.motion": "piston", "side.right.mass": 20, "side.right.force": 25})
    assert gas.observable("sides/right/position") == 1
    gas.advance(time=1.7)
    place = gas.observable("sides/right/position")
    assert 0 < place != 1
    undone = {f"side.right.{name}": None for name in ("mass", "force")}
    gas.change({"side.right.motion": "still", **undone}).advance(time=2.9)
    assert gas.parameters["side"]["right"]["position"] == place
    assert np.all(gas.position[:, 0] < place - gas.radius[0] + 1e-12)


def test_a_changed_simulation_whose_start_would_not_fit_is_saved(program, tmp_path, monkeypatch):
    """The side is fixed at a position that one of the initial disks overlaps."""
    monkeypatch.chdir(tmp_path)
    disks = {"name": "a", "radius": 0.05, "position": [0.3, 0.5, 0.94, 0.5], "speed": 1}
    side = {"name": "right", "motion": "constant_velocity", "velocity": 0.5, "end_time": 1}
    gas = Simulation({"species": disks, "side": side}).advance(time=0.4)
    undone = {f"side.right.{name}": None for name in ("velocity", "end_time")}
    gas.change({"side.right.motion": "still", **undone}).advance(time=0.7)
    gas.save("gas.h5", input="gas.nml")
    ran(program, "gas.nml", "-o", "gas.h5", "--resume", "--set=stop.time=2", check=True)
    run = read_run("gas.h5")
    assert run.time[0] == 0.7 and run.time[-1] == 2
    assert np.array_equal(run.position[-1], gas.advance(time=2).position)


def test_a_piston_pushes_disks_beyond_the_opposite_side_of_the_box():
    """Gravity pulls the disks to the right; the left piston follows and overtakes them."""
    disks = {"name": "a", "count": 100, "packing_fraction": 0.1, "speed": 1}
    pistons = [
        {"name": "left", "motion": "piston", "mass": 10, "force": 50},
        {"name": "right", "motion": "piston", "mass": 1, "force": 0},
    ]
    gas = Simulation({"species": disks, "side": pistons, "box": {"gravity": [1, 0]}})
    position, followed = 0.0, 0
    while position < 5:
        gas.advance(events=gas.events + 1)
        position = gas.observable("sides/left/position")
        gaps = gas.position[:, 0] - gas.radius - position
        assert gaps.min() > -1e-12 * max(1, position)
        followed += position > 1
    assert followed > 100
