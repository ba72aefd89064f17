"""A simulation in memory is bit-identical to a run of the program, and never ends the process.

`test_random_systems.py` tests with random systems that advancing in small steps, saving and loading
do not change the results.
"""

import copy
import ctypes
import gc
import json
import math
import multiprocessing
import os
import pickle
import random
import re
import signal
import subprocess
import sys
import textwrap
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import h5py
import numpy as np
import pytest

from ricochet import EventLog, ProgramError, RunError, Simulation, read_run
from ricochet.running.engine import library
from ricochet.running.simulation import NEVER
from ricochet.running.state import COLUMNS
from whole_runs import ran

GAS = """&box boundary = 'periodic', 'wall' gravity = 0, -1 /
&species name = 'a' count = 60 radius = 0.02 velocities = 'maxwell' temperature = 1 /
&species name = 'b' count = 20 radius = 0.04 mass = 3 velocities = 'rest' /
&contact restitution = 0.9 tangential_restitution = 0.5 contact_time = 1e-4 /
&output event_log = .true. /
&stop collisions = 400 /
"""
RESTING = {"species": {"count": 9, "radius": 0.1, "velocities": "rest"}}
SHEARED = {"box": {"boundary": ["periodic", "periodic"], "shear_rate": 1}}
SHEARED |= {"species": {"count": 1, "radius": 0.1}}
ENDLESS = {"contact.restitution": 1, "contact.tangential_restitution": 1}


@pytest.fixture(scope="module")
def whole(program, tmp_path_factory):
    """Return the settings of an input, and the output file of a complete run."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "gas.nml").write_text(GAS)
    ran(program, "gas.nml", "-o", "gas.h5", "--quiet", cwd=folder, check=True)
    return read_run(folder / "gas.h5")


def test_a_simulation_shows_what_the_file_of_its_run_has(whole):
    """Arrays, observables, counts and next collisions agree with the output file of a run."""
    with Simulation(GAS) as gas:
        assert {*COLUMNS} < {*dir(gas)}
        log = whole.event_log()
        assert gas.next_events(9) == list(zip(log.time[:9], log.i[:9], log.j[:9], strict=True))
        for frame in (0, -1):
            for name in COLUMNS:
                stored = getattr(whole, name)
                expected = stored if name in ("radius", "mass", "species") else stored[frame]
                assert np.array_equal(getattr(gas, name), expected), name
            for name in gas.observables:
                assert np.array_equal(gas.observable(name), whole.observable(name).value[frame])
            gas.advance()
        assert {*gas.observables} == {*whole.observables}
        assert (gas.time, gas.collisions, gas.n_disks) == (whole.time[-1], 400, 80)
        assert gas.events == len(log.time)


def test_arrays_are_read_only_and_are_assigned_whole():
    """Arrays are read-only copies; a complete array can be assigned."""
    with Simulation(GAS) as gas:
        for name in {*COLUMNS} & {*dir(gas)}:
            array = getattr(gas, name)
            with pytest.raises(ValueError, match=r"read-only.*box.velocity = v"):
                array[0] = 99
            with pytest.raises(ValueError, match="read-only"):
                array[array > 0] += 1
            with pytest.raises(ValueError, match="read-only"):
                array.sort()
        before = gas.velocity
        gas.velocity *= 2
        gas.velocity -= [1, 0]
        assert np.array_equal(gas.velocity, 2 * before - [1, 0])
        twin = own = gas.velocity.copy()
        own[0] = 3, 4
        own += 1
        assert own is twin and own[0].tolist() == [4, 5]
        for array in (before * 2, np.sqrt(gas.radius), before @ np.eye(2)):
            assert type(array) is np.ndarray and array.flags.writeable
        assert type(before.sum()) is np.float64
        assert np.array_equal(pickle.loads(pickle.dumps(before)), before)


def test_a_simulation_says_in_one_line_what_it_is():
    gas = Simulation(GAS).advance(collisions=4)
    words = f"<Simulation: 60 a, 20 b; t = {gas.time:g}, 4 collisions, {gas.events} events>"
    assert repr(gas) == words
    gas.close()
    assert repr(gas) == "<Simulation: closed>"


def states(*simulations):
    """Return all properties of the states of simulations."""
    return [
        [(gas.time, gas.events, gas.changes)]
        + [getattr(gas, name).tolist() for name in COLUMNS]
        + [np.ravel(gas.observable(name)).tolist() for name in gas.observables]
        for gas in simulations
    ]


@pytest.mark.parametrize("seed", range(3))
def test_a_copy_and_a_pickle_continue_with_the_same_bits(seed):
    """Copies and pickles of a simulation continue independently with bit-identical results."""
    random.seed(seed)
    gas = Simulation(GAS, {"run.seed": seed}, threads=1 + seed)
    gas.advance(events=random.randrange(300))
    if seed:
        gas.change({"box.gravity": (0, -2)})
        gas.velocity = gas.velocity[::-1]
        gas.advance_by(events=random.randrange(99))
    before = states(gas)
    others = [gas.copy(), copy.copy(gas), copy.deepcopy(gas), pickle.loads(pickle.dumps(gas))]
    assert states(*others) == 4 * before
    assert {other.nature for other in others} == {gas.nature}
    others[0].velocity = 2 * others[0].velocity
    others[0].advance_by(events=50)
    assert states(gas) == before
    for other in (gas, *others[1:]):
        other.advance_by(events=200)
    assert states(*others[1:]) == 3 * states(gas)
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        far = pool.submit(Simulation.advance_by, gas, events=20).result()
    assert states(far) == states(gas.advance_by(events=20))
    assert np.array_equal(gas.event_log(9).time, others[1].advance_by(events=20).event_log(9).time)


@pytest.mark.parametrize("threads", [1, 2])
def test_each_event_is_reported_in_the_state_of_its_moment(whole, threads):
    """The reported events are equal to the event log, and reporting does not change the motion."""
    log, seen = whole.event_log(), []

    def see(event):
        assert event.time == gas.time and gas.events == len(seen) + 1
        seen.append(event)

    gas = Simulation(GAS, threads=threads)
    gas.advance(on_event=see)
    for k, name in enumerate(EventLog._fields):
        assert np.array_equal([event[k] for event in seen], getattr(log, name))
    assert np.array_equal(gas.position, whole.position[-1])
    kept = gas.event_log(30)
    for name in EventLog._fields:
        assert np.array_equal(getattr(kept, name), getattr(log, name)[-30:])
    assert len(gas.event_log(10**6).time) == len(seen) and len(gas.event_log(0).time) == 0


def test_a_function_of_events_may_stop_and_change_the_simulation():
    system = {"species": {"count": 30, "radius": 0.02, "temperature": 1}}
    gas = Simulation(system)
    assert gas.advance(time=9, on_event=lambda event: event.j > 0).collisions == 1
    first, energy = gas.events, gas.observable("total_energy")
    bounds, changed = [], []

    def mark(event):
        if event.j <= 0 and not changed:
            gas.velocity *= 2
            changed.append(gas.time)
        bounds.append(event.time)

    gas.advance_by(time=0.5, on_event=mark)
    assert len(changed) == 1 and gas.time == bounds[-1] + (gas.time - bounds[-1])
    assert gas.events == first + len(bounds)
    assert gas.observable("total_energy") == pytest.approx(4 * energy, rel=1e-12)
    assert gas.observable("work") == pytest.approx(3 * energy, rel=1e-12)
    with pytest.raises(ZeroDivisionError):
        gas.advance_by(events=9, on_event=lambda event: 1 / 0)
    assert gas.events == first + len(bounds) + 1
    assert gas.advance_by(events=0, on_event=1).events == first + len(bounds) + 1


@pytest.mark.parametrize("boundary", ["wall", "periodic"])
def test_positions_are_set_and_their_energy_is_work(boundary):
    """After positions are set, the simulation continues as if it had started with them."""
    gas = Simulation(GAS, {"box.boundary": [boundary, "wall"], **ENDLESS}).advance(events=77)
    gas.position = before = gas.position
    assert gas.changes == []
    place = [1 - before[:, 0], before[:, 1]]  # a mirror image
    place = np.column_stack(place)
    gas.position = place
    assert gas.changes == [(gas.time, "position", "")]
    assert gas.observable("work") == pytest.approx(0, abs=1e-12)
    assert np.array_equal(gas.position, np.mod(place, 1) if boundary == "periodic" else place)
    order = np.argsort(gas.position[gas.species == 1][:, 1])
    energy = gas.observable("total_energy")
    place = gas.position.copy()
    place[:60] = place[:60][order[::-1]]
    gas.position = place
    assert gas.observable("total_energy") - energy == pytest.approx(gas.observable("work"))
    gas.advance_by(events=400)
    change = gas.observable("total_energy") - energy
    assert change == pytest.approx(gas.observable("work"), abs=1e-9)
    where = np.linalg.norm(gas.position[:, None] - gas.position, axis=-1) + np.eye(80)
    assert np.all(where > (gas.radius[:, None] + gas.radius) * (1 - 1e-9))


def test_a_moved_disk_keeps_the_periods_that_it_has_crossed():
    system = {"box": {"boundary": ["periodic", "periodic"]}}
    system["species"] = {"position": [(0.5, 0.5)], "velocity": [(1, 0)], "radius": 0.1}
    gas = Simulation(system).advance(time=3.2)
    gas.position = [(0.9, 0.5)]
    assert gas.image.tolist() == [[3, 0]]
    gas.position += [0.2, 0]
    assert gas.image.tolist() == [[4, 0]] and gas.position[0, 0] == pytest.approx(0.1)


def test_a_moment_where_a_slice_has_ended_is_reached_again():
    """A simulation that is advanced in one call reaches the same state to the last bit."""
    text = "&box boundary = 'periodic', 'periodic' /\n&species name = 'a' count = 200"
    text += " packing_fraction = 0.6 placement = 'dense' temperature = 1 /\n"
    with Simulation(text) as one, Simulation(text) as other:
        while one.collisions < 1e5:
            one._go_on((np.inf, NEVER, NEVER), 1e-6)
            other.advance(time=one._settle())
            for name in ("events", "position", "velocity"):
                assert np.array_equal(getattr(one, name), getattr(other, name)), name


def test_handles_share_nothing_and_give_all_back():
    """Simulations are independent, and all memory is released, also for invalid inputs."""
    one, other = Simulation(GAS), Simulation(GAS, {"run.seed": 2})
    for k in range(1, 21):
        one.advance(events=10 * k)
        other.advance(events=7 * k)
    assert np.array_equal(one.position, Simulation(GAS).advance(events=200).position)

    def resident():
        gc.collect()
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    sizes = []
    for _ in range(3):
        for k in range(333):
            Simulation(GAS).advance(events=20).next_events(3)
            if k % 10 == 0:
                with pytest.raises(ProgramError):
                    Simulation(GAS + "&boxx /")
        sizes.append(resident())
    assert sizes[-1] - sizes[0] < 4e6


def test_an_interrupt_leaves_the_simulation_whole():
    """Ctrl-C raises an exception quickly, and the simulation can then continue unchanged."""
    gas = Simulation(GAS, ENDLESS)
    timer = threading.Timer(0.3, signal.raise_signal, [signal.SIGINT])
    timer.start()
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        gas.advance(collisions=10**9)
    timer.join()
    assert time.monotonic() - began < 60 and gas.collisions > 0
    same = Simulation(GAS, ENDLESS).advance(events=gas.events)
    there = [one.advance(events=gas.events + 5).position for one in (same, gas)]
    assert np.array_equal(*there)


def test_other_threads_of_python_run_meanwhile():
    """Other Python threads run during `advance`, because the interpreter lock is released."""
    gas, counted = Simulation(GAS, ENDLESS), [0]
    worker = threading.Thread(target=gas.advance, kwargs={"events": 10**6})
    worker.start()
    while worker.is_alive():
        counted[0] += 1
        time.sleep(1e-3)
    assert counted[0] > 10 and gas.events == 10**6


def kept(system) -> Simulation:
    """Return a simulation after saving and loading."""
    return Simulation.load(Simulation(system).save("kept.h5", force=True))


@pytest.mark.parametrize(
    ("act", "error", "words"),
    [
        (lambda gas: gas.advance(time=-1), ValueError, "has passed"),
        (lambda gas: gas.advance(time=np.nan), ValueError, "nan"),
        (lambda gas: gas.advance(time="soon"), ValueError, "soon"),
        (lambda gas: gas.advance(events=None, collisions=[1]), TypeError, "int"),
        (lambda gas: gas.observable("all/temperatur"), RunError, "all/temperature"),
        (lambda gas: gas.colour, AttributeError, "colour"),
        (lambda gas: gas.next_events("x"), ValueError, "x"),
        (lambda _: kept({"species": {"count": 9, "radius": 0.1}}).advance(), ValueError, "&stop"),
        (lambda gas: gas.change({"species.a.count": 3}), ProgramError, "cannot change"),
        (lambda gas: gas.change({"gravity": 3}), ProgramError, "gravity: cannot change"),
        (lambda gas: gas.change({"contact.contact_time": 0}), ProgramError, "data that the disks"),
        (lambda gas: gas.change({"contact.restitution": 2}), ProgramError, "from 0 to 1"),
        (lambda gas: setattr(gas, "velocity", np.zeros(3)), ValueError, "(3,)"),
        (lambda gas: setattr(gas, "velocity", gas.velocity * np.nan), ValueError, "below"),
        (lambda gas: setattr(gas, "velocity", 1e90 * gas.velocity), ProgramError, "out of range"),
        (lambda gas: setattr(gas, "mass", gas.mass), AttributeError, "mass"),
        (lambda gas: setattr(gas, "velocities", gas.velocity), AttributeError, "velocities"),
        (lambda gas: gas.change([("box.gravity", 1)]), TypeError, "a dictionary"),
        (lambda _: Simulation(GAS, threads=0), ValueError, "from 1 to 1024"),
        (lambda _: Simulation.load("no.h5", threads=1.5), ValueError, "not 1.5"),
        (lambda _: Simulation(None), TypeError, "its text"),
        (lambda _: Simulation("&species count = -1 radius = 1 /"), ProgramError, "from 1 to"),
        (lambda gas: gas.save("/proc/none/x.h5"), ProgramError, "/proc/none"),
        (lambda gas: gas.advance(events=9).advance(events=8), ValueError, "8 has passed"),
        (lambda gas: gas.advance(collisions=-1), ValueError, "-1 has passed"),
        (lambda gas: gas.advance_by(), ValueError, "give time, collisions"),
        (lambda gas: gas.advance_by(time=-1), ValueError, "-1 is not a number from 0"),
        (lambda _: kept(RESTING).advance(events=1), RunError, "ever collide again"),
        (lambda _: kept(RESTING).event_log(3), RunError, "output.event_log"),
        (lambda gas: setattr(gas, "position", 0 * gas.position), ProgramError, "wholly inside"),
        (
            lambda gas: setattr(gas, "position", gas.position[[1, *range(79)]]),
            ProgramError,
            "overlaps disk 1",
        ),
        (lambda gas: setattr(gas, "position", gas.position * np.nan), ValueError, "below"),
        (lambda _: setattr(kept(SHEARED), "position", [(0.1, 0.2)]), ProgramError, "sheared"),
        (lambda gas: [gas.close(), gas.close(), gas.position], ValueError, "closed"),
        (lambda gas: [gas.close(), gas.advance()], ValueError, "closed"),
        (lambda _: Simulation("no.nml"), ProgramError, "no.nml"),
        (lambda _: Simulation({"species": {"count": []}}), TypeError, "empty"),
        (lambda _: Simulation(GAS, {"run.seeed": 1}), ProgramError, "seed"),
        (lambda _: Simulation("&box /\0"), ValueError, "zero"),
        (lambda _: Simulation.load("no.h5"), ProgramError, "no.h5"),
        (lambda _: Simulation.load("/dev/null"), ProgramError, "/dev/null"),
        (lambda _: Simulation.load("a\0.h5"), ValueError, "zero"),
        (lambda gas: gas.save("a\0.h5"), ValueError, "zero"),
        (lambda gas: gas.save("a.h5", input="b\0.nml"), ValueError, "zero"),
        (lambda gas: gas.change({"box.gravity": "0, -2\0\nrun.seed=1"}), ValueError, "zero"),
        (lambda gas: gas.save("x.h5.part"), ProgramError, "is reserved for files"),
        (lambda _: Simulation("&species count = 1 radius = .1 /").advance(), ValueError, "&stop"),
    ],
)
def test_wrong_use_is_said_in_one_line(act, error, words, tmp_path, monkeypatch):
    """Wrong use raises an exception with one line; other simulations continue."""
    monkeypatch.chdir(tmp_path)
    gas = Simulation(GAS)
    with pytest.raises(error, match=re.escape(words)) as caught:
        act(gas)
    assert len(str(caught.value).splitlines()) == 1
    assert Simulation(GAS).advance(events=5).events == 5


def test_the_table_says_what_may_change_in_a_running_simulation(program):
    """A variable that the table does not mark as changeable is refused for this reason."""
    table = json.loads(ran(program, "--print-variables", check=True).stdout)
    system = GAS + "&side name = 'top' / &wall name = 'w' from = 0.4, 0.5 to = 0.6, 0.5 /"
    system += "&obstacle name = 'o' centre = 0.5, 0.5 radius = 0.01 /"
    names = {"side": "top", "wall": "w", "obstacle": "o", "species": "a"}
    gas, refused = Simulation(system), "cannot change in a running simulation"
    for group, rows in table.items():
        for name, row in rows.items():
            value = row["default"] if row["example"] is None else row["example"]
            full = ".".join([group, *([names[group]] if group in names else []), name])
            try:
                gas.change({full: value})
                reason = ""
            except ProgramError as error:
                reason = error.message
            assert row["changeable"] == (refused not in reason), full
            assert not (row["changeable"] and row["resumable"]), full


def test_a_simulation_that_breaks_off_says_so():
    """A simulation that has failed raises the message of the program at every further call."""
    words = """&box gravity = 0, -1 /
    &species count = 1 radius = 0.1 position = 0.5, 0.5 velocity = 0, 0 /
    &contact wall_restitution = 0 /
    &stop time = 1000 /"""
    with Simulation(words) as ball:
        for _ in range(2):
            with pytest.raises(ProgramError, match="collapse") as caught:
                ball.advance()
            assert caught.value.code == 4


def test_a_saved_simulation_goes_on_in_the_program_and_back(program, tmp_path, whole):
    """The final state is bit-identical to the final state of an uninterrupted run."""
    (tmp_path / "gas.nml").write_text(GAS)
    Simulation(GAS).advance(events=150).save(tmp_path / "gas.h5")
    with pytest.raises(ProgramError, match="exists already"):
        Simulation(GAS).save(tmp_path / "gas.h5")
    saved = Simulation(GAS).advance(events=150).time
    assert read_run(tmp_path / "gas.h5.part").provenance["saved_at"] == saved
    ran(program, "gas.nml", "-o", "gas.h5", "--resume", "--set=stop.collisions=300", cwd=tmp_path)
    assert read_run(tmp_path / "gas.h5").provenance["saved_at"] == saved
    gas = Simulation.load(tmp_path / "gas.h5").advance(collisions=400)
    assert np.array_equal(gas.position, whole.position[-1])
    assert np.array_equal(gas.velocity, whole.velocity[-1])


def test_a_side_is_held_moved_and_released_where_it_is():
    """The energy balance holds, and the saved input contains the position of the side."""
    side = "side.right"
    system = {
        "box": {"upper": [2, 1]},
        "side": {"name": "right", "motion": "piston", "mass": 10, "force": 100},
        "species": {"count": 60, "radius": 0.02, "temperature": 1},
        "stop": {"time": 9},
    }
    held = {f"{side}.motion": "still", f"{side}.mass": None, f"{side}.force": None}
    moved = {f"{side}.motion": "constant_velocity", f"{side}.velocity": 0.1}
    moved |= {f"{side}.start_time": 3, f"{side}.end_time": 5}
    free = {f"{side}.motion": "piston", f"{side}.mass": 5, f"{side}.force": 0}
    free |= {name: None for name in moved if "time" in name or "velocity" in name}
    gas = Simulation(system)

    def balance():
        now = {name: gas.observable(name) for name in ("total_energy", "dissipated_energy", "work")}
        return now["total_energy"] + now["dissipated_energy"] - now["work"]

    start, fewest = balance(), []
    for k, change in enumerate([held, moved, free, held]):
        place = gas.advance(time=1.0 + 1.5 * k).observable("sides/right/position")
        gas.change(change)
        assert gas.observable("sides/right/position") == pytest.approx(place, rel=1e-15)
        again = Simulation(gas.input)
        if change is not moved:
            assert again.observable("sides/right/position") == pytest.approx(place, rel=1e-15)
        fewest.append(gas.observable("sides/right/collisions"))
    assert np.all(np.diff(fewest) > 0), "it is hit between any two changes"
    place = gas.observable("sides/right/position")
    assert gas.advance(time=8).observable("sides/right/position") == place
    assert balance() == pytest.approx(start, rel=1e-12)


def test_a_change_is_work_and_goes_on_in_the_program(program, tmp_path, monkeypatch):
    """The program continues with the saved input, and refuses the initial input."""
    monkeypatch.chdir(tmp_path)
    Path("gas.nml").write_text(GAS)
    gas = Simulation("gas.nml", {"run.seed": 5}).advance(events=50)
    gas.velocity = gas.velocity[::-1]
    assert "seed = 5" in gas.input
    gas.advance(events=100)

    def balance():
        flows = [gas.observable(name) for name in ("heat", "work") if name in gas.observables]
        return gas.observable("total_energy") + gas.observable("dissipated_energy") - sum(flows)

    before = balance()
    soft = {"contact.restitution_law": "power", "contact.reference_speed": 1}
    gas.change({"box.gravity": (0, 3), "side.top.temperature": 2, **soft})
    gas.advance(events=150).change({"contact.restitution": 0.7})
    gas.advance(events=200).velocity = 2 * gas.velocity
    gas.advance(events=300)
    assert balance() == pytest.approx(before, rel=1e-12)
    assert {"changed", "thermal_walls", "gravity", "soft_contacts"} <= gas.nature
    gas.save("gas.h5", input="changed.nml")
    told = ran(program, "gas.nml", "-o", "gas.h5", "--resume", "--quiet", "--set=run.seed=5")
    assert told.returncode == 2 and "there box.gravity = [0, 3]" in told.stderr
    ran(program, "changed.nml", "-o", "gas.h5", "--resume", "--quiet", check=True)
    whole, gas = read_run("gas.h5"), gas.advance()
    assert np.array_equal(whole.velocity[-1], gas.velocity)
    assert whole.nature == gas.nature
    assert Simulation.load("gas.h5").changes == gas.changes
    assert [name for _, name, _ in gas.changes][-2:] == ["contact.restitution", "velocity"]


def test_numbers_that_c_may_give_are_refused_or_count_as_none():
    """The header file describes these numbers, which the Python package never passes."""
    engine, gas, room = library(), Simulation(GAS), 200
    message = ctypes.create_string_buffer(room)
    with gas._open() as handle:
        for bad in (np.nan, np.inf, -np.inf):
            velocity = gas.velocity.copy()
            velocity[7, 1] = bad
            code = engine.ricochet_set_velocities(handle, velocity.ctypes.data, message, room)
            assert code == 2 and b"velocity" in message.value
        assert engine.ricochet_advance(handle, np.nan, 9, 9, 1.0, message, room) == 2
        assert b"time" in message.value
        for room in (0, -5):
            message.raw = b"#" * 200
            assert engine.ricochet_advance(handle, np.nan, 9, 9, 1.0, message, room) == 2
            assert message.raw == b"#" * 200
        assert engine.ricochet_next_events(handle, -3, None) == 0
    engine.ricochet_close(None)
    assert gas.advance(events=9).events == 9 and np.isfinite(gas.velocity).all()


#: Arguments that a caller in C may pass, valid or invalid.
NUMBERS = np.nan, np.inf, -np.inf, -1.0, 0.0, 0.1, 0.3, 1e-300, 1e100, 1e308
COUNTS = -(2**31), -5, -1, 0, 1, 5, 60, 500
SETTINGS = (
    *("", "=", "gravity", "box.gravity", "box.gravity=", "box.gravity=nan,1", "\n\n", "&box /"),
    *("box.gravity=0,-1", "contact.restitution=2", "contact.restitution=0.5", "x" * 300),
    *("species.a.count=3", "stop.time=1", "side.top.temperature=1", "drive.kind=noise"),
)
NAMES = "position", "image", "mass", "", "x", "input", "parameters", "changes", "note"


@pytest.mark.parametrize("seed", range(4))
def test_random_calls_in_c_have_an_answer(seed):
    """Whatever numbers and texts are passed, no call crashes, hangs or accepts invalid numbers."""
    engine, chance = library(), random.Random(seed)
    text, values = ctypes.create_string_buffer(20_000), np.empty((600, 6))
    message = ctypes.create_string_buffer(500)
    for _ in range(15):
        gas = Simulation(GAS, {"run.seed": chance.randrange(99)}, threads=chance.choice([1, 2]))
        for _ in range(10):
            say = message, min(chance.choice(COUNTS), 500)
            time, count = chance.choice(NUMBERS), chance.choice(COUNTS)
            if chance.random() < 0.5:
                velocity = gas.velocity.copy()
                velocity[chance.randrange(80), chance.randrange(2)] = chance.choice(NUMBERS)
            else:
                velocity = 2 * gas.velocity
            with gas._open() as handle:
                codes = [
                    engine.ricochet_advance(handle, time, count, count, 0.01, *say),
                    engine.ricochet_set_velocities(handle, velocity.ctypes.data, *say),
                    engine.ricochet_change(handle, chance.choice(SETTINGS).encode(), *say),
                ]
                assert set(codes) <= {0, 1, 2, 4}
                most = engine.ricochet_next_events(handle, count, values.ctypes.data)
                assert 0 <= most <= max(count, 0)
                name = chance.choice(NAMES).encode()
                assert 0 <= engine.ricochet_column(handle, name, values.ctypes.data) <= 2
                for ask, *rest in (
                    (engine.ricochet_text, name, text, count),
                    (engine.ricochet_observables, text, count, values.ctypes.data),
                ):
                    assert ask(handle, *rest) >= 0
            assert np.isfinite([gas.time, *gas.position.flat, *gas.velocity.flat]).all()


def test_files_that_are_refused_leave_no_memory_behind(tmp_path):
    """Refused files (missing, damaged or foreign) do not cause memory leaks."""
    places = [tmp_path / name for name in ("none.h5", "text.h5", "other.h5", "old.h5", "cut.h5")]
    places[1].write_text("not HDF5")
    with h5py.File(places[2], "w") as file:
        file["x"] = 1.0
    for path in places[3:]:
        Simulation(GAS).save(path)
    with h5py.File(f"{places[3]}.part", "r+") as file:
        del file["checkpoint/program"]
        file["checkpoint/program"] = np.bytes_("ricochet 0")
    whole = Path(f"{places[4]}.part").read_bytes()
    Path(f"{places[4]}.part").write_bytes(whole[: len(whole) // 2])
    sizes = []
    for _ in range(3):
        for _ in range(300):
            for path in places:
                with pytest.raises(ProgramError):
                    Simulation.load(path)
        gc.collect()
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        sizes.append(pages * os.sysconf("SC_PAGE_SIZE"))
    assert sizes[-1] - sizes[0] < 1e6


def test_a_damaged_input_in_a_file_is_called_damaged(tmp_path):
    """For any damaged bits the message consists of one line."""
    text = GAS.replace("event_log = .true.", "")  # which is allocated as a whole
    path = Simulation(text).save(tmp_path / "gas.h5")
    whole = path.read_bytes()
    place = whole.find(text.encode())
    for k in range(0, len(text), 7):
        damaged = bytearray(whole)
        damaged[place + k] ^= 1 << k % 8
        path.write_bytes(damaged)
        with pytest.raises(ProgramError, match="input is damaged") as caught:
            Simulation.load(path)
        assert caught.value.code == 3 and "\n" not in caught.value.message


def test_a_simulation_reaches_each_representable_time():
    """If rounding errors kept the simulation before the requested time, `advance` would not end."""
    for seed in range(1, 251):
        rng = random.Random(seed)
        few = {"species": {"count": 5, "radius": 0.05, "temperature": 1}, "run": {"seed": seed}}
        with Simulation(few) as box:
            box.advance(time=10 ** rng.uniform(-6, -1))
            box.velocity *= 0.9  # begins an epoch
            box.advance_by(time=10 ** rng.uniform(-3, 0))
            for _ in range(4):
                goal = math.nextafter(box.time, math.inf)
                assert not box._go_on((goal, NEVER, NEVER), 1.0) and box.time >= goal


def test_a_settled_time_is_reached_exactly_by_another_simulation():
    """A change at a settled time therefore has the same effect to the last bit."""
    for seed in range(1, 251):
        rng = random.Random(seed)
        few = {"species": {"count": 5, "radius": 0.05, "temperature": 1}, "run": {"seed": seed}}
        start, more, after = (10 ** rng.uniform(low, low + 3) for low in (-6, -3, -2))
        with Simulation(few) as box, Simulation(few) as other:
            box.advance(time=start)
            first = box._settle()
            box.velocity *= 0.9
            box.advance_by(time=more)
            second = box._settle()
            assert second == box.time == box._settle()
            other.advance(time=first).velocity *= 0.9
            other.advance(time=second)
            for one in box, other:
                one.velocity *= 1.1
                one.advance_by(time=after)
            assert box.time == other.time and np.array_equal(box.position, other.position)


@pytest.mark.parametrize(
    "groups",
    [
        {"drive": {"kind": "noise", "interval": 0.01, "strength": 1}},
        {
            "drive": {
                "kind": "active",
                "interval": 1e-4,
                "temperature": 1,
                "self_propulsion_speed": 2,
            }
        },
        {"output": {"frames_every_time": 0.1, "observables_every_time": 1e-3}},
        {"output": {"frames_per_decade": 5, "decades_from": 1e-3, "observables_at": [0.1, 0.2]}},
        {"run": {"dynamics": "steps", "dt": 1e-4}},
        {"species": {"name": "a", "count": 1, "radius": 0.1, "speed": 1}}
        | {"drive": {"kind": "noise", "interval": 0.01, "strength": 1, "keep_momentum": False}}
        | {"box": {"boundary": ("periodic", "periodic")}},
    ],
)
def test_a_simulation_needs_no_stop(groups, program, tmp_path, monkeypatch):
    """A simulation in memory needs no stop rule; the program can continue it with a stop rule."""
    monkeypatch.chdir(tmp_path)
    system = {"species": {"name": "a", "count": 20, "radius": 0.01, "speed": 1}} | groups
    box = Simulation(system).advance(time=0.25)
    assert box.time == 0.25 and "stop" not in box.input
    box.save("box.h5", input="box.nml")
    told = ran(program, "box.nml", "-o", "box.h5", "--resume")
    assert told.returncode == 2 and "no rule ends the run" in told.stderr
    ran(program, "box.nml", "-o", "box.h5", "--resume", "--set=stop.time=0.5", check=True)
    there = Simulation({**system, "stop": {"time": 0.5}}).advance()
    assert np.array_equal(read_run("box.h5").position[-1], there.position)
    assert Simulation.load("box.h5").advance(time=0.6).time == 0.6


def test_an_input_is_saved_over_nothing_but_a_saved_one(tmp_path, monkeypatch):
    """An input is saved only over a file that was saved before, which is checked in advance."""
    monkeypatch.chdir(tmp_path)
    gas = Simulation(GAS)
    Path("mine.nml").write_text("! my comments\n")
    Path("link.nml").symlink_to("mine.nml")
    Path("dangling.nml").symlink_to("none.nml")
    Path("folder").mkdir()
    places = ["mine.nml", "link.nml", "dangling.nml", "folder", "no/where.nml"]
    files = ["gas.h5", "gas.h5.part", "gas.h5.part_new", "gas.h5.lock", "folder/../gas.h5.part"]
    for place in [*places, *files]:
        with pytest.raises(ProgramError, match=place.split("/")[0]) as caught:
            gas.save("gas.h5", input=place)
        assert caught.value.code == 3
    assert {path.name for path in Path().iterdir()} == {*places[:4]}
    assert Path("mine.nml").read_text() == "! my comments\n"
    assert gas.save("gas.h5", input="new.nml") == Path("gas.h5.part")
    gas.advance(events=50).change({"box.gravity": (0, 1)}).save("gas.h5", True, "new.nml")
    assert Simulation("new.nml").input == gas.input
    Path("new.nml").write_text(Path("new.nml").read_text() + "! edited\n")
    with pytest.raises(ProgramError, match=r"new\.nml"):
        gas.save("gas.h5", True, "new.nml")


def test_the_library_has_no_fault_that_checks_would_find(program):
    """All tests of this file succeed with a library that contains run-time checks."""
    checked = Path(program).parent / "tests"
    if not (checked / "libricochet_files.so").is_file():
        pytest.skip("`make test` builds it")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:randomly", __file__]
    own = {**os.environ, "RICOCHET_LIBRARY": str(checked)}
    ended = ran(*command, "-k", "not checks_would_find and not header", env=own)
    assert ended.returncode == 0, ended.stdout[-3000:]


def test_the_library_needs_no_hdf5_and_shows_its_functions_only():
    """The library exports only the functions of the header."""
    path = library()._name
    assert "hdf5" not in ran("ldd", path, check=True).stdout
    listed = ran("nm", "-D", "--defined-only", path, check=True).stdout.split()[2::3]
    header = (Path(__file__).resolve().parents[2] / "src/ricochet.h").read_text().split("/* ---")[0]
    assert sorted(listed) == sorted({*re.findall(r"\b(ricochet_\w+)\(", header)})


def test_the_example_in_the_header_is_a_complete_program(tmp_path):
    """The example compiles without warnings, and stops at the requested number of collisions."""
    header = Path(__file__).resolve().parents[2] / "src/ricochet.h"
    folder = Path(library()._name).parent
    example = re.search(r"^ {7}#include .*?^ {7}\}$", header.read_text(), re.MULTILINE | re.DOTALL)
    source = tmp_path / "gas.c"
    source.write_text(textwrap.dedent(example[0]) + "\n")
    strict = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{header.parent}"]
    link = [f"-L{folder}", f"-Wl,-rpath,{folder}", "-lricochet", "-lm"]
    ran("cc", *strict, str(source), "-o", "gas", *link, cwd=tmp_path, check=True)
    shown = ran(tmp_path / "gas", check=True).stdout
    assert re.fullmatch(r"time [\d.]+, 500 collisions, first disk at -?[\d.]+, -?[\d.]+\n", shown)


def test_a_fork_and_an_interpreter_that_ends_do_no_harm():
    """A child process continues independently, and the interpreter can end during `advance`."""
    script = f"""
import os, threading
from ricochet import Simulation
gas = Simulation({GAS!r}, {ENDLESS})
gas.advance(events=10)
if os.fork() == 0:
    os._exit(0 if gas.advance(events=100).events == 100 else 1)
assert os.waitstatus_to_exitcode(os.wait()[1]) == 0
assert gas.advance(events=100).events == 100
threading.Thread(target=gas.advance, kwargs={{"events": 10**12}}, daemon=True).start()
if os.fork() == 0:  # what a thread steps that the child does not have is closed there
    try:
        gas.time
    except ValueError as error:
        os._exit(0 if "closed" in str(error) else 1)
    os._exit(0)
assert os.waitstatus_to_exitcode(os.wait()[1]) == 0
other = threading.Thread(target=gas.advance, kwargs={{"events": 10**6}})
other.start()
gas.advance(events=10**6)  # two threads, one simulation
other.join()
"""
    assert subprocess.run([sys.executable, "-c", script], timeout=300).returncode == 0
