"""Random systems, run with many methods: results are bit-identical and obey general laws.

Each system is simulated in several ways: with default settings; on several threads; with another
search and event queue; in parts that are ended by a time limit, by TERM or by kill -9 and then
resumed; to an earlier end, from which the run is continued; with other samples; in memory; and in
other units. All runs of a system must end with the same exit code, the same message and the same
bytes. The results with default settings must obey the laws in `run_laws`.

The environment variables SYSTEMS and SEED set the number of systems and the seed, for example
`SYSTEMS=200 SEED=20270131`. `make check` uses a new seed every day.
"""

import contextlib
import functools
import itertools
import json
import os
import random
import re
import signal
import subprocess
import time
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
import pytest

from ricochet import ProgramError, Simulation

from random_systems import CADENCES, System, numbers, random_system, starting_file
from run_laws import laws_broken
from whole_runs import BROKEN, FINISHED, PATIENCE, STOPPED
from whole_runs import contents, executable, ran, unlike, within

SEEDS = [f"{os.environ.get('SEED', '1')} {k}" for k in range(int(os.environ.get("SYSTEMS", "60")))]
KEPT = 20  #: number of systems in `make test`
SECONDS = 200  # of processor time, which only endless runs exceed
PARTS = 5
BYTES = os.environ.get("BYTES", "4000000000")  # of address space
LATEST = 1e100  # largest time that an input can name
KILLED = (STOPPED, -signal.SIGTERM, -signal.SIGKILL)
NOT_THE_END = ("placing disks:", "warning:", "note:", "stopped; the run is finished")
#: Message for systems whose disks do not fit into the box.
NO_ROOM = re.compile(
    r"(species\.(radius|placement|file|position)|drive\.to_region|source\.region): "
)
#: Data about the execution of a run, which may differ between runs with equal results.
ASIDE = re.compile(
    r"^/parameters(/run@(search|queue)|/overrides|/output@checkpoint_every|/stop@wall_clock)$"
)


AT_LAST_SAMPLE = re.compile(r"/observables/(virial_pressure|sides/\w+/(position|velocity))/value")


class End(NamedTuple):
    """Exit code and last message of a run; `endless` if it used too much processor time."""

    code: int
    message: str


class Case:
    """Random system, and the folder with its input file."""

    def __init__(self, program: Path, folder: Path, seed: str):
        """Draw random systems until the program accepts one, and write its input file."""
        self.program, self.folder, self.rng = program, folder, random.Random(seed)
        self.system = accepted(program, folder, self.rng)

    def begin(self, name: str, *options: str, text: str = "case.nml") -> subprocess.Popen:
        command = [*within(SECONDS), f"--as={BYTES}", self.program, text, "-o", f"{name}.h5"]
        pipes = {"stderr": subprocess.PIPE, "stdout": subprocess.DEVNULL, "text": True}
        return subprocess.Popen([*command, "--quiet", *options], cwd=self.folder, **pipes)

    def whole(self, name: str, *options: str, **more: str) -> End:
        return end_of(self.begin(name, *options, **more))

    def result(self, name: str) -> Path:
        """Return the path of the output file of a finished or unfinished run."""
        path = self.folder / f"{name}.h5"
        return path if path.exists() else Path(f"{path}.part")

    def way(self) -> list[str]:
        """Return random options that must not affect the results."""
        searches = ["pairs"] if self.system.disks <= 300 else []
        searches += ["rescan"] if self.system.disks <= 40 else []
        search = f"--set=run.search={self.rng.choice(['cells', 'cells', *searches])}"
        if "'steps'" in self.system.text:
            return [search]
        queue = f"--set=run.queue={self.rng.choice(['calendar', 'heap'])}"
        return [search, queue, f"--set=run.threads={self.rng.choice([1, 2, 2, 3, 8])}"]

    def on_threads(self, name: str, _seconds: float) -> End:
        threads = f"--set=run.threads={self.rng.choice([2, 2, 3, 4, 6])}"
        return self.whole(name, *([] if "'steps'" in self.system.text else [threads]))

    def another_way(self, name: str, _seconds: float) -> End:
        return self.whole(name, *self.way())

    def in_parts(self, name: str, seconds: float) -> End:
        """Execute a run in parts, the first of which ends at once and the others by signals."""
        end, options = End(STOPPED, ""), ["--set=output.checkpoint_every=1e-3"]
        for part in range(PARTS):
            first = ["--set=stop.wall_clock=1e-9"] if part == 0 else ["--resume"]
            process = self.begin(name, *self.way(), *options, *first)
            if 0 < part < PARTS - 1:
                time.sleep(self.rng.uniform(0, 1.2) * seconds)
                process.send_signal(self.rng.choice([signal.SIGTERM, signal.SIGKILL]))
            before, end = end, end_of(process)
            if end.code not in KILLED or (self.folder / f"{name}.h5").exists():
                break
        if before.code == -signal.SIGKILL and "broke off" in end.message:
            return end_of(self.begin(name, "--force"))  # killed after its last message
        return End(FINISHED, "") if end.code == -signal.SIGKILL else end

    def continued(self, name: str, _seconds: float) -> End:
        """Execute a run with an early end, and continue it to the final end."""
        with h5py.File(self.result("plain")) as file:
            last = float(file["particles/disks/position/time"][-1])
            collisions = int(file["observables/collisions/value"][-1])
        times = sorted({min(self.rng.uniform(0, 0.99) * last, LATEST) for _ in "12"})
        ends = [f"time={time!r}" for time in times if last > 0]
        in_steps = "'steps'" in self.system.text  # a step ends with all its collisions
        if collisions > 2 and not in_steps and self.rng.random() < 0.5:
            numbers = self.rng.sample(range(1, collisions), 2)
            ends = [f"collisions={number}" for number in sorted(numbers)]
        resume = []
        for early in ends:
            end = self.whole(name, *self.way(), f"--set=stop.{early}", *resume)
            if end.code:
                return end
            resume = ["--resume"]
        return self.whole(name, *self.way(), *resume)

    def in_memory(self, name: str, _seconds: float) -> End:
        """Simulate in parts in this process, save and load, and finish the run with the program."""
        with h5py.File(self.result("plain")) as file:
            last = float(file["particles/disks/position/time"][-1])
        pairs = (word.removeprefix("--set=").split("=") for word in self.way())
        ways = {key: int(word) if word.isdigit() else word for key, word in pairs}
        path = self.folder / f"{name}.h5"
        with contextlib.chdir(self.folder):
            try:
                simulation = Simulation("case.nml", ways)
                for part in sorted(
                    self.rng.uniform(0, 0.99) * last for _ in range(PARTS if last else 0)
                ):
                    simulation.advance(time=part)
                    if self.rng.random() < 0.3:
                        if "'steps'" not in self.system.text:
                            simulation.next_events(3)
                        simulation.save(path, force=True)
                        simulation.close()
                        simulation = Simulation.load(path)
                simulation.save(path, force=True)
            except ProgramError as error:
                return End(error.code, str(error))
        return self.whole(name, *self.way(), "--resume")

    def with_other_samples(self, name: str, _seconds: float) -> End:
        return self.whole(name, *self.way(), *self.samples(self.rng.randint(3, 20)))

    def samples(self, count: int) -> list[str]:
        """Return options with which a run writes about the given number of samples."""
        tracks = ("frames_every", "observables_every")
        names = [f"{track}_{kind}" for track in tracks for kind in CADENCES]
        words = [f"{name}=" for name in names if name in self.system.text]
        words += [f"{track}_events={self.system.events // count + 1}" for track in tracks]
        return [f"--set=output.{word}" for word in words]

    def nearly_stands_still(self) -> bool:
        """Return whether speeds are so small that their squares underflow.

        In this case the results depend on the units.
        """
        self.whole("often", *self.samples(500), "--set=output.precision='double'")
        found = contents(self.result("often"))
        moving = [found[p] for p in found if p.endswith(("velocity/value", "orientation/value"))]
        least = 1e-28 if "precision = 'single'" in self.system.text else 1e-120
        return any(np.any((value != 0) & (np.abs(value) < least)) for value in moving)

    def in_other_units(self, name: str, _seconds: float) -> End:
        """Execute the run with lengths, velocities and masses multiplied by powers of two."""
        length, speed, mass = (2.0 ** self.rng.randint(-30, 30) for _ in range(3))
        self.units = {"length": length, "velocity": speed, "mass": mass, "s": 1, "degrees": 1}
        self.units |= {"time": length / speed, "energy": mass * speed**2}
        lines = self.system.text.replace("start.txt", "other.txt").splitlines()
        table = table_of(self.program)
        lines = [rescaled(line, self.units, table) for line in lines]
        (self.folder / "other.nml").write_text("\n".join(lines) + "\n")
        factors = [eval(COLUMNS[name], {}, self.units) for name in self.system.columns]
        text = starting_file(self.system.columns, self.system.table * factors)
        (self.folder / "other.txt").write_text(text)
        return self.whole(name, *self.way(), text="other.nml")


#: Units of the quantities in frames, observables and initial-configuration files.
UNITS = {
    "/particles/disks/position/value": "length",
    "/particles/disks/position/time": "time",
    "/particles/disks/velocity/value": "velocity",
    "/particles/disks/angular_velocity/value": "1 / time",
    "/particles/disks/orientation/value": "1",
    "/particles/disks/event_count/value": "1",
    "/observables/total_energy/value": "energy",
    "/observables/dissipated_energy/value": "energy",
    "/observables/momentum/value": "mass * velocity",
}
COLUMNS = {"x": "length", "y": "length", "vx": "velocity", "vy": "velocity", "radius": "length"}
COLUMNS |= {"mass": "mass", "omega": "1 / time", "angle": "1"}


@functools.cache
def table_of(program: Path) -> dict:
    """Return the table of variables of the program."""
    return json.loads(ran(program, "--print-variables", check=True).stdout)


def rescaled(line: str, units: dict, table: dict) -> str:
    """Return a group of the input in other units; relative sizes are dimensionless."""
    group = re.match(r"&?(\w*)", line)[1]

    def scaled(group: str, name: str, words: str) -> str:
        unit = table[group].get(name, {}).get("unit")
        if not unit or ("relative_to" in line and name in ("radius", "mass")):
            return words
        factor = eval(unit, {}, units)
        return numbers(*(factor * float(word) for word in words.split(",")))

    def value(match: re.Match) -> str:
        return f"{match[1]} = {scaled(group, *match.groups())}"

    def setting(match: re.Match) -> str:
        return f"'{match[1]}{match[2]}{match[3]}={scaled(match[1], match[3], match[4])}'"

    line = re.sub(r"(\w+) = (-?\d[-+.\de]*(?:, -?\d[-+.\de]*)*)", value, line)
    return re.sub(r"'(\w+)([\w.]*\.)(\w+)=(-?\d[^']*)'", setting, line)  # of a change


def end_of(process: subprocess.Popen) -> End:
    """Wait for the end of a process, and return its exit code and last message."""
    try:
        lines = process.communicate(timeout=PATIENCE)[1].splitlines()
    except subprocess.TimeoutExpired:
        process.kill()
        lines = ["endless"]
    lines = [line for line in lines if not line.startswith(NOT_THE_END)]
    return End(process.returncode, lines[-1] if lines else "")


def accepted(program: Path, folder: Path, rng: random.Random, **options: int | bool) -> System:
    """Return the first system that the program accepts, with its files."""
    for _ in range(20):
        system = random_system(rng, **options)
        if is_accepted(program, folder, system):
            return system
    pytest.fail("20 systems were refused one after the other")


def is_accepted(program: Path, folder: Path, system: System) -> bool:
    """Write the files of a system, and return whether the program accepts it.

    The program may refuse the system only if its disks do not fit into the box.
    """
    (Path(folder) / "start.txt").write_text(starting_file(system.columns, system.table))
    (Path(folder) / "case.nml").write_text(system.text)
    command = [*within(5), program, "case.nml", "--check"]
    done = ran(*command, cwd=folder)
    told = [line for line in done.stderr.splitlines() if not line.startswith(NOT_THE_END)]
    assert all(map(NO_ROOM.search, told)), f"{done.stderr}{system.text}"
    return done.returncode == FINISHED


def last_samples(found: dict) -> dict:
    """Return the values of the last samples without their sample numbers.

    A run without any further event ends at its last sample, whose time affects only the positions
    of moving sides and the mean pressure since the start.
    """
    return {
        name: value[-1:]
        for name, value in found.items()
        if name.startswith(("/particles", "/observables"))
        and name.endswith("/value")
        and not (bytes(found["/provenance@note"]) and AT_LAST_SAMPLE.match(name))
    }


def faults(program: Path, folder: Path, seed: str) -> str:
    """Return descriptions of all faults found in the runs of a random system."""
    case = Case(program, folder, seed)
    began = time.monotonic()
    plain = case.whole("plain")
    seconds = time.monotonic() - began
    if plain.code not in (FINISHED, BROKEN):
        return f"failed: {plain}"
    found = contents(case.result("plain"))
    said = [f"breaks a law: {law}" for law in laws_broken(found)]
    ways = [case.on_threads, case.another_way, case.in_parts, case.with_other_samples]
    if plain.code == FINISHED:
        ways += [case.continued, case.in_memory, case.in_other_units]
    for way in ways:
        name = way.__name__
        end = way(name, seconds)
        if (end.code, end.message.replace(f"{name}.h5", "plain.h5")) != plain:
            said.append(f"ends otherwise: {name} {end}, plain {plain}")
            continue
        own, other = found, contents(case.result(name))
        # If a collapse occurs, the numbers of collisions are compared, because the times have
        # different units.
        notes = {bytes(file["/provenance@note"]).split(b", the first")[0] for file in (own, other)}
        nearly = way == case.in_other_units and case.nearly_stands_still()
        if len(notes) > 1 and not nearly:
            said.append(f"notes otherwise: {name} {notes}")
        if way in (case.with_other_samples, case.in_memory):
            own, other = last_samples(own), last_samples(other)
        elif way == case.in_other_units:
            scales = {path: eval(unit, {}, case.units) for path, unit in UNITS.items()}
            own = {path: own[path] * scale for path, scale in scales.items() if path in own}
            other = {path: other[path] for path in own}
        different = [name for name in unlike(own, other) if not ASIDE.match(name)]
        if different and not nearly:
            said.append(f"differs: {name}, {len(different)} {different[:6]}")
    return "\n".join([*said, case.system.text]) if said else ""


def first_kept(seeds: list[str], kept: int) -> list:
    """Return parameters of a test, of which those beyond the first are tested in `.ci/run`.

    All are tested if the variable SYSTEMS sets their number.
    """
    kept = len(seeds) if "SYSTEMS" in os.environ else kept
    more = (pytest.param(seed, marks=pytest.mark.statistics) for seed in seeds[kept:])
    return [*seeds[:kept], *more]


@pytest.mark.parametrize("seed", first_kept(SEEDS, KEPT))
def test_all_ways_end_alike_and_the_laws_hold(program, tmp_path, seed):
    assert not (said := faults(program, tmp_path, seed)), said


# --- tests of the random systems themselves ---

#: Variables that concern the execution of a run, or require another run.
NOT_DRAWN = {"run.title", "run.search", "run.queue", "run.threads", "stop.wall_clock"}
NOT_DRAWN |= {"species.scale_positions", "obstacle.file"}
NOT_DRAWN |= {"wall.file"}
#: Pairs of features that the program refuses, or that a random system cannot combine.
APART = [
    ("box.shear_rate", r"obstacle|wall|side|box\.gravity|run\.d|stop\.energy"),
    (r"source|species\.waiting|side\.open|stop\.disks", r"box\.shear|stop\.energy|output\.helf"),
    ("source", r"drive\.(kind = recycle|from_region|to_region|velocity)"),
    ("species.waiting", r"species\.(file|position)"),
    (
        r"stop\.(energy|at_rest)",
        r"drive|box\.shear|(side|wall|obstacle)\.(temp|surf)|side\.[aefmpv]|side\.start",
    ),
    (r"stop\.at_rest", r"run\.d|contact\.contact_time|restitution = 1"),
    (r"obstacle|wall\.", r"species\.(file|position|grid|relax|placement = [ldr](?!andom))"),
    (
        r"species\.(relax|placement = relaxed)",
        r"box\.gravity|side\.([aefmp]|start)|many|species\.(grid|pl|re|packing|radius_d)",
    ),
    (r"species\.(file|position)", r"species|contact\.pair|many"),
    (r"species\.(grid|placement = |packing)", r"species\.(grid|placement = |packing)|many"),
    ("output.helfand", r"box\.(gravity|shear)"),
    (r"output\.helfand|box\.shear", r"drive\.(kind = recycle|from_region|to_region|velocity)"),
    (r"side\.(mass|force|motion = piston)", r"run\.d"),
    ("drive", "drive"),
    (r"obstacle\.(name|side)|wall (x|y)", "periodic"),
    ("output.frames_every", "output.frames_every"),
    ("output.observables_every", "output.observables_every"),
    (r"contact\.law", r"contact\.law"),
]


def test_the_systems_draw_every_variable(program, tmp_path):
    """If a variable is missing by chance, use another SEED."""
    table = table_of(program)
    known = {f"{group}.{name}" for group in table for name in table[group]}
    rngs = (random.Random(seed) for seed in SEEDS)
    drawn = set().union(*(accepted(program, tmp_path, rng).features() for rng in rngs))
    assert known - NOT_DRAWN - drawn == set()


@pytest.mark.statistics
def test_many_systems_draw_every_pair_of_features_that_goes_together(program, tmp_path):
    """Random systems contain every allowed pair of features, and the program accepts them.

    The test draws 14 000 systems, because some pairs are rare.
    """
    pairs, features = set(), set()
    systems = [random_system(random.Random(seed)) for seed in range(14000)]
    each = [(sorted(system.features()), system) for system in systems]
    for drawn, system in sorted(each, key=lambda one: -len(one[0])):  # fewest runs of the program
        features.update(drawn)
        new = set(itertools.combinations(drawn, 2)) - pairs
        if new and is_accepted(program, tmp_path, system):
            pairs |= new
    never = set(itertools.combinations(sorted(features), 2)) - pairs
    apart = {
        (one, other)
        for one, other in never
        for a, b in APART
        if (re.match(a, one) and re.match(b, other)) or (re.match(a, other) and re.match(b, one))
    }
    assert never == apart


@pytest.mark.parametrize(
    "when", ["queue=heap", "resume", "threads=2", "output.frames", "other.nml"]
)
def test_a_program_whose_result_depends_on_the_way_is_found_out(program, tmp_path, when):
    lie = f'case "$*" in *{when}*) exec {program} "$@" --set stop.events=3 ;; esac'
    liar = executable(tmp_path / "liar", f'{lie}\nexec {program} "$@"')
    for k in range(20):
        (tmp_path / f"{k}").mkdir()
        if said := faults(liar, tmp_path / f"{k}", f"1 {k}"):
            break
    assert "&species" in said


@pytest.mark.parametrize(
    ("law", "name", "change"),
    [
        ("energy", "/observables/dissipated_energy/value", lambda x: 1.000001 * x),
        ("momentum", "/observables/momentum/value", lambda x: np.array([[0, 0], [1, 0]])),
        ("disks and walls apart", "/particles/disks/position/value", lambda x: x.round(1)),
        ("disks and walls apart", "/parameters/box@shear_rate", lambda x: -x),
        ("log", "/events/j", lambda x: -x),
        ("log", "/events/time", lambda x: x[::-1]),
        ("log", "/particles/disks/event_count/value", lambda x: x + 1),
        ("observables", "/particles/disks/velocity/value", lambda x: 1.000001 * x),
    ],
)
def test_a_file_that_breaks_a_law_is_found_out(ricochet, tmp_path, law, name, change):
    rate = 0.0 if law == "momentum" else 0.7
    (tmp_path / "gas.nml").write_text(
        f"""&box upper = 3, 2 boundary = 'periodic', 'periodic' shear_rate = {rate} /
        &species count = 60 radius = 0.12 temperature = 1 / &contact restitution = 0.9 /
        &stop events = 300 / &output event_log = .true. frames_every_events = 50 /"""
    )
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    found = contents(tmp_path / "gas.h5")
    assert list(laws_broken(found)) == []
    said = list(laws_broken(found | {name: change(found[name])}))
    assert law in [line.split(":")[0] for line in said]
