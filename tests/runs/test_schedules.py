"""Scheduled changes in the input (`&change`): bit-identical to changes of a simulation.

Each test draws a random system and changes it at random times with `Simulation.change`. An input
then schedules the same changes. The program runs it on one, two and three threads, with stops at
random numbers of events. A simulation in memory schedules the changes with `Simulation.schedule`,
in random order, and is copied, pickled, saved and loaded between them. All final states must be
bit-identical.

The environment variables SYSTEMS and SEED set the number of systems and the seed.
"""

import contextlib
import math
import os
import pickle
import random
import re
from pathlib import Path

import numpy as np
import pytest

import ricochet
from random_systems import Draw
from ricochet import ProgramError, Simulation, read_run
from ricochet.predictions import hard_disks
from synthetic_run import ROOT
from test_changes import MOST_KICKS, MOST_STEPS, drawn_change, facts, kept
from test_random_systems import accepted, first_kept
from whole_runs import FINISHED, contents, ran, unlike

COUNT = int(os.environ.get("SYSTEMS", "20"))
KEPT = 8  #: number of systems in `make test`
SEEDS = [f"{os.environ.get('SEED', '1')} schedule {k}" for k in range(COUNT)]
MOST_DISKS = 200
MOST_EVENTS = 600  #: between two changes


class Course:
    """Random system with changes at random times."""

    def __init__(self, program: Path, seed: str):
        """Draw the system, and simulate it in memory with the changes."""
        self.program, self.rng = program, random.Random(seed)
        system = accepted(program, Path(), self.rng, most=MOST_DISKS, openings=False)
        self.draw: Draw = system.draw
        text = re.sub(r"^&stop.*$", "&stop events = 1000000000 /", system.text, flags=re.MULTILINE)
        self.text = re.sub(r"^&output.*$", "&output /", text, flags=re.MULTILINE)
        self.steps = "'steps'" in text
        Path("case.nml").write_text(self.text)
        self.changes: list[tuple[float, list[str]]] = []
        self.end, self.message = 0.0, ""
        simulation = Simulation("case.nml")
        try:
            for _ in range(self.rng.randint(1, 4)):
                self.advance(simulation)
                self.change(simulation)
            self.advance(simulation)
        except ProgramError as error:
            self.message = error.message
        if self.changes and self.changes[-1][0] == self.end and not self.message:
            self.changes.pop()  # after this change, time does not advance
        else:
            self.facts, self.events = facts(simulation), simulation.events

    def advance(self, simulation: Simulation) -> None:
        """Advance to a random time without a kick."""
        rng, draw = self.rng, self.draw
        speed = simulation.observable("all/mean_speed") or draw.speed
        time = rng.choice([0.01, 0.3, 10]) * rng.random() * min(draw.edges) / speed
        if self.steps:
            time = min(time, MOST_STEPS * draw.step)
        if (drive := simulation.parameters["drive"])["kind"] != "none":
            # Not a time of a kick, which a change in memory follows and a scheduled one precedes.
            time = min(time, (MOST_KICKS + 0.1) * drive["interval"])
        goal, ahead = self.end + time, simulation.copy()
        with contextlib.suppress(ProgramError):  # then `simulation` fails before `goal`, too
            ahead.advance(time=goal, events=ahead.events + MOST_EVENTS)
            if ahead.time < goal:
                goal = self.end + rng.random() * (ahead.time - self.end)
        self.end = goal
        if self.steps:  # changes take effect at the ends of steps
            self.end = math.ceil(self.end / draw.step) * draw.step
        simulation.advance(time=self.end)

    def change(self, simulation: Simulation) -> None:
        """Make a random change of variables, unless it is refused."""
        settings = drawn_change(simulation, self.draw).settings
        if self.steps and ("&drive" in self.text or (settings and settings[0].startswith("drive"))):
            return  # the kicks of a step follow its changes
        if not settings or (self.changes and self.changes[-1][0] == self.end) or self.end == 0:
            return
        self.facts, self.events = facts(simulation), simulation.events
        try:
            simulation._change(settings)
        except ProgramError:
            return
        self.changes.append((self.end, settings))

    def run_file(self, name: str, *sets: str, stops: int = 0) -> None:
        """Run the input with the changes in the program, and compare its last state."""
        groups = []
        for time, settings in self.changes:
            words = ", ".join(f"'{one}'" for one in (line.replace("'", "''") for line in settings))
            groups.append(f"&change time = {time!r} set = {words} /\n")
        text = self.text.replace("&stop events = 1000000000", f"&stop time = {self.end!r}") + "\n"
        Path("all.nml").write_text(text + "".join(self.rng.sample(groups, len(groups))))
        command = ["all.nml", "-o", f"{name}.h5", "--quiet", *sets]
        cuts = sorted(self.rng.randint(1, max(self.events, 1)) for _ in range(stops))
        done = None
        for k, cut in enumerate([*cuts, None]):
            more = [f"--set=stop.events={cut}"] if cut is not None else []
            done = ran(self.program, *command, *more, *["--resume"] * (k > 0))
            if done.returncode == 3 and "is a finished run" in done.stderr:
                continue  # two cuts at the same number of events
            if done.returncode != FINISHED:
                break
        if self.message:
            # The advice that follows depends on the number of events until the collapse was
            # detected.
            assert self.message.split(":")[-1].split(";")[0] in done.stderr
            return
        assert done.returncode in (FINISHED, 3), done.stderr
        run = read_run(f"{name}.h5")
        assert len(run.changes) == sum(len(settings) for _, settings in self.changes)
        there = {n: run.observable(n).value[-1] for n in run.observables}
        there |= {"position": run.position[-1], "velocity": run.velocity[-1]}
        self.compare(there)

    def compare(self, there: dict) -> None:
        """Compare values with those of the first simulation."""
        # If a change adds virial_tensor to a simulation in memory, this sum starts at the change.
        different = [
            name
            for name in (self.facts.keys() & there.keys()) - {"virial_tensor"}
            if not np.array_equal(np.ravel(self.facts[name]), np.ravel(there[name]))
        ]
        assert different == []

    def run_in_memory(self) -> None:
        """Schedule the changes of a simulation, and advance it in slices and copies."""
        rng = self.rng
        simulation = Simulation("case.nml", {}, rng.choice([1, 1, 2]))
        pending = rng.sample(self.changes, len(self.changes))
        while pending and rng.random() < 0.8:
            simulation._schedule(*pending.pop())
        pending.sort(key=lambda one: one[0])
        for part in sorted(rng.random() for _ in range(5)):
            time = part * self.end
            while pending and pending[0][0] <= time:
                simulation.advance(time=pending[0][0] * (1 - 1e-9))
                simulation._schedule(*pending.pop(0))
            simulation.advance(time=max(time, simulation.time))
            match rng.choice("csp "):
                case "c":
                    simulation = simulation.copy()
                case "s":
                    simulation = kept(simulation, "memory")
                case "p":
                    simulation = pickle.loads(pickle.dumps(simulation))
        for one in pending:
            simulation._schedule(*one)
        simulation.advance(time=self.end)
        assert len(simulation.changes) == sum(len(settings) for _, settings in self.changes)
        self.compare(facts(simulation))


@pytest.mark.parametrize("seed", first_kept(SEEDS, KEPT))
def test_changes_of_an_input_are_those_of_a_simulation(program, tmp_path, monkeypatch, seed):
    monkeypatch.chdir(tmp_path)
    course = Course(program, seed)
    course.run_file("one")
    threads = course.rng.choice([2, 3])
    search = course.rng.choice(["cells", "pairs"])
    course.run_file("many", f"--set=run.threads={threads}", stops=course.rng.randint(0, 3))
    course.run_file("cut", f"--set=run.search={search}", stops=course.rng.randint(1, 4))
    if not course.message:
        course.run_in_memory()


GAS = """&run seed = 3 /
&side name = 'left' temperature = 2 /
&side name = 'right' motion = 'piston' mass = 10 force = 100 position = 0.9 /
&species count = 60 radius = 0.01 temperature = 1 region = 0, 0.9, 0, 1 /
&change time = 0.5 set = 'side.left.temperature=', 'side.right.motion=still' /
&change name = 'pull' time = 1 set = 'side.right.motion=constant_velocity',
  'side.right.velocity=0.1', 'side.right.start_time=1', 'side.right.end_time=2' /
&stop time = 3 /
&output observables_every_time = 0.125 frames_every_time = 0.25 /
"""


def test_a_run_with_changes_resumes_from_any_time_with_other_later_changes(program, tmp_path):
    """Only changes after the checkpoint may differ."""
    (tmp_path / "gas.nml").write_text(GAS)

    def run(name, *words, more=""):
        (tmp_path / "gas.nml").write_text(GAS + more)
        command = ["gas.nml", "-o", f"{name}.h5", "--quiet", *words]
        return ran(program, *command, cwd=tmp_path)

    assert run("whole").returncode == FINISHED
    for end in (0.3, 0.5, 0.7, 1.0, 2.5):
        assert run("part", "--force", f"--set=stop.time={end}").returncode == FINISHED
        done = run("part", "--resume")
        assert done.returncode == FINISHED, done.stderr
        whole, part = contents(tmp_path / "whole.h5"), contents(tmp_path / "part.h5")
        assert [name for name in unlike(whole, part) if "overrides" not in name] == []
    late = "&change name = 'late' time = 2.75 set = 'box.gravity=0, -1' /\n"
    assert run("late", more=late).returncode == FINISHED
    assert run("part", "--force", "--set=stop.time=2.5").returncode == FINISHED
    assert run("part", "--resume", more=late).returncode == FINISHED
    late_run, part_run = read_run(tmp_path / "late.h5"), read_run(tmp_path / "part.h5")
    assert np.array_equal(late_run.position[-1], part_run.position[-1])
    assert part_run.changes == late_run.changes and part_run.changes[-1].time == 2.75
    assert run("part", "--force", "--set=stop.time=2.5").returncode == FINISHED
    early = run("part", "--resume", "--set=change.pull.time=1.5")
    assert (
        early.returncode == 2 and "before the time of the checkpoint, 2.5, differ" in early.stderr
    )
    passed = run("part", "--resume", more=late.replace("2.75", "2.25"))
    assert passed.returncode == 2
    assert "gas.nml:10: change.late: its time has passed" in passed.stderr


@pytest.mark.parametrize("position", [0, 0.1])
def test_a_change_to_the_values_in_force_leaves_a_piston_alone(position):
    """Its position is not known in advance, but it is no position at which a motion starts anew."""
    text = f"""&box upper = 4, 1 / &output frames_every_time = 0.3 / &stop time = 3 /
        &side name = 'left' motion = 'piston' mass = 20 force = 30 position = {position} /
        &species name = 'a' count = 50 packing_fraction = 0.2 speed = 1 region = 0.5, 4, 0, 1 /\n"""
    change = "&change time = 1.234 set = 'box.gravity=0, 0', 'contact.restitution=1' /"
    run, changed = ricochet.run(text), ricochet.run(text + change)
    assert np.array_equal(run.position, changed.position)
    assert np.array_equal(*(one.observable("sides/left/position").value for one in (run, changed)))


def test_a_change_within_a_step_is_still_due_when_the_step_continues(
    program, tmp_path, monkeypatch
):
    """A simulation is saved within a time step: after a change in it, which its end makes."""
    monkeypatch.chdir(tmp_path)
    text = """&run dynamics = 'steps' dt = 0.1 / &contact restitution = 1 / &stop time = 1 /
        &species name = 'a' count = 50 packing_fraction = 0.3 speed = 1 /
        &change name = 'c' time = 0.42 set = 'contact.restitution=0' /"""
    whole = Simulation(text).advance(time=1)
    gas = Simulation(text).advance(time=0.45)
    gas.save("gas.h5", input="gas.nml")
    loaded = Simulation.load("gas.h5").advance(time=1)
    ran(program, "gas.nml", "-o", "gas.h5", "--resume", "--quiet", check=True)
    assert np.array_equal(loaded.velocity, whole.velocity)
    assert np.array_equal(read_run("gas.h5").velocity[-1], whole.velocity)
    assert whole.observable("dissipated_energy") > 0


def test_the_balance_and_the_positions_of_sides_hold_across_changes(program, tmp_path):
    """The series of the side is continuous, and all observables exist from the start."""
    (tmp_path / "gas.nml").write_text(GAS)
    ran(program, "gas.nml", "-o", "gas.h5", "--quiet", cwd=tmp_path, check=True)
    run = read_run(tmp_path / "gas.h5")
    energy, heat, work = (run.observable(n).value for n in ("total_energy", "heat", "work"))
    assert np.ptp(energy - heat - work) < 1e-12 * energy.max()
    time, place = run.observable("sides/right/position")
    held = (time >= 0.5) & (time <= 1)
    assert np.ptp(place[held]) == 0 and place[0] == 0.9 and np.ptp(heat[held]) == 0
    pulled = place[held][-1] - 0.1 * np.clip(time - 1, 0, 1)
    assert np.abs(place - pulled)[time >= 1].max() < 1e-14
    assert run.corners_at(2.0)[1][0] == pytest.approx(place[held][-1] - 0.1, abs=1e-14)
    assert {"changed", "thermal_walls", "piston"} <= run.nature
    short = ran(program, "gas.nml", "-o", "s.h5", "--quiet", "--set=stop.time=0.25", cwd=tmp_path)
    assert short.returncode == FINISHED
    assert not read_run(tmp_path / "s.h5").changes  # none has been made
    assert "changed" not in read_run(tmp_path / "s.h5").nature


def test_a_change_that_fails_at_its_time_ends_the_run_and_names_its_line(program, tmp_path):
    """An oscillation would start at a position at which the side is not."""
    text = GAS + (
        "&change name = 'swing' time = 2 set = 'side.right.motion=sine',\n"
        " 'side.right.amplitude=0.05', 'side.right.period=1', 'side.right.phase=0' /\n"
    )
    (tmp_path / "gas.nml").write_text(text)
    assert ran(program, "gas.nml", "--check", cwd=tmp_path).returncode == FINISHED
    run = ran(program, "gas.nml", "-o", "gas.h5", "--quiet", cwd=tmp_path)
    assert run.returncode == 4
    assert run.stderr.startswith("gas.nml:10: change.swing: a side would jump")
    simulation = Simulation(text)
    with pytest.raises(ProgramError, match=r"change\.swing: a side would jump") as caught:
        simulation.advance(time=3)
    assert caught.value.code == 4


def test_a_schedule_in_memory_refuses_the_past_and_what_cannot_change():
    gas = Simulation(GAS).advance(time=1.5)
    for time, values, words in (
        (1.5, {"box.gravity": (0, -1)}, "time: 1.5 is not a time after the present time"),
        (2, {"box.upper": (2, 1)}, "box.upper: cannot change in a running simulation"),
        (2, {"side.left.friction": 1}, "side.friction: has no effect with rule"),
        (2, {"contact.contact_time": 1}, "needs data that the disks do not have"),
    ):
        with pytest.raises(ProgramError, match=re.escape(words)):
            gas.schedule(time, values)
    gas.schedule(2, {"box.gravity": (0, -1)}).change({"contact.restitution": 0.9})
    assert [change[0] for change in gas.changes] == [0.5, 0.5, 1, 1, 1, 1, 1.5]
    assert gas.advance(time=2.5).changes[-1] == (2, "box.gravity", "0, -1")
    assert gas.parameters["box"]["gravity"] == [0, -1]
    assert gas.parameters["contact"]["restitution"] == 0.9


def kicked_input(kind: str, change: str) -> str:
    """Return an input with a kick at time 0.5 and the given change."""
    own = {"noise": "strength = 1", "andersen": "temperature = 2 fraction = 0.5"}
    return f"""&box boundary = 2*'periodic' /
        &species count = 60 radius = 0.01 temperature = 1 /
        &drive kind = '{kind}' {own.get(kind, "temperature = 2")} interval = 0.25 /
        &change {change} /
        &output observables_every_time = 0.125 frames_every_time = 0.125 /
        &stop time = 1 /"""


@pytest.mark.parametrize("kind", ["noise", "andersen", "brownian"])
@pytest.mark.parametrize(
    "setting", ["drive.interval = 0.125", "drive.interval = 0.1", "contact.restitution = 0.9"]
)
def test_a_change_at_the_time_of_a_kick_precedes_the_kick(program, tmp_path, kind, setting):
    """The kick at time 0.5 is applied once, after the change, with any stops and threads.

    It has the same effect as after a change just before 0.5, and is the first with the new
    interval.
    """
    at = {"same": 0.5, "before": math.nextafter(0.5, 0)}
    for name, time in at.items():
        text = kicked_input(kind, f"time = {time!r} set = '{setting}'")
        (tmp_path / f"{name}.nml").write_text(text)
        ran(program, f"{name}.nml", "-o", f"{name}.h5", "--quiet", cwd=tmp_path, check=True)
    work, expected = (read_run(tmp_path / f"{name}.h5").observable("drive_energy") for name in at)
    jumps = np.diff(work.value)[3:5]  # until 0.5, and until 0.625
    assert jumps == pytest.approx(np.diff(expected.value)[3:5], rel=1e-6, abs=1e-9)
    assert abs(jumps[0]) > 0.01
    for name, options in {"slices": ["--set=stop.events=20"], "threads": []}.items():
        command = [program, "same.nml", "-o", f"{name}.h5", "--quiet"]
        for k, more in enumerate([*options, "--set=stop.time=0.5", "--set=run.threads=2"]):
            done = ran(*command, more, *["--resume"] * (k > 0), cwd=tmp_path)
            assert done.returncode == FINISHED, done.stderr
        found = unlike(contents(tmp_path / "same.h5"), contents(tmp_path / f"{name}.h5"))
        assert [x for x in found if not x.startswith("/parameters")] == []


@pytest.fixture
def simulated_input(program, tmp_path):
    """Return a function that runs an input of the project and reads the result."""

    def simulated(name, *sets):
        output = tmp_path / f"{name}.h5"
        ran(program, ROOT / f"input/{name}.nml", "-o", output, "--quiet", *sets, check=True)
        return read_run(output)

    return simulated


@pytest.mark.parametrize("changed", [{}, {"contact.wall_restitution": 0.5}])
def test_a_saved_input_continues_a_simulation_after_its_scheduled_changes(
    program, tmp_path, monkeypatch, changed
):
    """The saved input contains the scheduled changes made since the last change."""
    monkeypatch.chdir(tmp_path)
    gas = Simulation(
        "&species count = 20 radius = 0.01 temperature = 1 /\n&stop time = 1 /\n"
        "&change time = 0.2 set = 'contact.restitution=0.6' /\n"
        "&change time = 0.5 set = 'box.gravity=0, -1' /\n"
        "&change time = 0.9 set = 'contact.restitution=0.9' /\n"
    )
    gas.advance(time=0.3)
    if changed:
        gas.change(changed)
    gas.advance(time=0.6).save("gas.h5", input="gas.nml")
    done = ran(program, "gas.nml", "-o", "gas.h5", "--resume", "--quiet")
    assert done.returncode == FINISHED, done.stderr
    assert np.array_equal(read_run("gas.h5").position[-1], gas.advance(time=1).position)


def test_a_free_expansion_does_no_work(simulated_input):
    """No disk reaches the side, so that the energy is constant up to rounding errors."""
    run = simulated_input("free_expansion", "--set=stop.time=1.5")
    energy, work = run.observable("total_energy").value, run.observable("work").value
    assert max(np.ptp(energy), np.ptp(work)) < 1e-12 * energy[0]
    assert run.position[-1][:, 0].max() > 1.5


def test_the_temperature_after_a_quench_decays_by_a_tenth_at_each_kick(simulated_input):
    """The law is kT = 1 + 3 * 0.9^k after k kicks, the first at the time of the change."""
    run = simulated_input("quench", "--set=stop.time=25", "--set=species.gas.count=4000")
    time, kt = run.observable("all/temperature")
    kicks = np.round((time - 20) / 0.1) + 1
    late = time > 19.95
    law = 1 + 3 * 0.9 ** kicks[late]
    error = 1 / np.sqrt(4000)  # relative standard deviation of kT
    assert np.abs(kt[late] / law - 1).max() < 5 * error
    assert kt[~late][-50:].mean() == pytest.approx(4, rel=0.05)


def test_each_window_of_a_ramp_has_the_temperature_of_its_restitution(simulated_input):
    run = simulated_input("ramp", "--set=species.grain.count=500", "--set=box.upper=140,140")
    time, kt = run.observable("all/temperature")
    steps = [(0, 0.95), *((change.time, float(change.value)) for change in run.changes)]
    eta = float(np.sum(np.pi * run.radius**2) / np.prod(run.edges))
    ends = [*(start for start, _ in steps[1:]), run.time[-1]]
    for (start, xi), end in zip(steps, ends, strict=True):
        steady = (time > (start + end) / 2) & (time < end)
        law = hard_disks.noise_temperature(0.05, xi, eta, 1.0)
        assert kt[steady].mean() == pytest.approx(law, rel=0.1)


@pytest.mark.statistics
def test_the_efficiency_of_a_slow_engine_is_that_of_carnot():
    """The efficiency is lower at finite speed, and its limit is that of Carnot.

    The engine is that of the tutorial. The test takes about 4 s.
    """
    text = (ROOT / "docs/tutorials/carnot.md").read_text()
    code = re.findall(r"```python\n(.*?)```", text, re.S)[-1]
    code = code.replace("range(48)", "range(24)").replace(", 0.0125]", "]")
    found: dict = {"np": np, "ricochet": ricochet}
    exec(code, found)
    limit, error = found["line"][1], np.sqrt(found["covariance"][1, 1])
    assert error < 0.04 and abs(limit - 0.5) < 3 * error
    assert found["efficiency"][0] < 0.5 - 3 * found["error"][0]
