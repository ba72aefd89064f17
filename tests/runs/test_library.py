"""The engine in this process: its bits are those of the program, and nothing ends the process.

That slices of time, a save and a load leave no trace in any random system is one of the ways of
`test_random_systems.py`.
"""

import copy
import gc
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from ricochet import ProgramError, RunError, Simulation, read_run
from ricochet.simulation import COLUMNS, NEVER, library
from whole_runs import ran

GAS = """&box boundary = 'periodic', 'wall' gravity = 0, -1 /
&species name = 'a' count = 60 radius = 0.02 velocities = 'maxwell' temperature = 1 /
&species name = 'b' count = 20 radius = 0.04 mass = 3 velocities = 'rest' /
&contact restitution = 0.9 tangential_restitution = 0.5 contact_time = 1e-4 /
&output event_log = .true. /
&stop collisions = 400 /
"""
ENDLESS = {"contact.restitution": 1, "contact.tangential_restitution": 1}


@pytest.fixture(scope="module")
def whole(program, tmp_path_factory):
    """What the program makes of it."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "gas.nml").write_text(GAS)
    ran(program, "gas.nml", "-o", "gas.h5", "--quiet", cwd=folder, check=True)
    return read_run(folder / "gas.h5")


def test_a_simulation_shows_what_the_file_of_its_run_has(whole):
    """Arrays, observables, counts and the collisions to come, at the start and at the end."""
    with Simulation(GAS) as gas:
        assert {*COLUMNS} < {*dir(gas)}
        log = whole.events
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
        assert (gas.time, gas.collisions, gas.count) == (whole.time[-1], 400, 80)
        assert gas.events == len(log.time)


def test_a_moment_where_a_slice_has_ended_is_reached_again():
    """In one go, to the last bit: in the middle of an epoch, and where one ends."""
    text = "&box boundary = 'periodic', 'periodic' /\n&species name = 'a' count = 200"
    text += " packing_fraction = 0.6 placement = 'dense' temperature = 1 /\n"
    with Simulation(text) as one, Simulation(text) as other:
        while one.collisions < 1e5:
            one._go_on((np.inf, NEVER, NEVER), 1e-6)
            other.advance(time=one._settle())
            for name in ("events", "position", "velocity"):
                assert np.array_equal(getattr(one, name), getattr(other, name)), name


def test_handles_share_nothing_and_give_all_back():
    """Also one that nobody closes, and one whose input is wrong."""
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
    """Ctrl-C raises within moments; what goes on has the bits of what nobody stopped."""
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
    """The lock of the interpreter is free while the engine works."""
    gas, counted = Simulation(GAS, ENDLESS), [0]
    worker = threading.Thread(target=gas.advance, kwargs={"events": 10**6})
    worker.start()
    while worker.is_alive():
        counted[0] += 1
        time.sleep(1e-3)
    assert counted[0] > 10 and gas.events == 10**6


def kept(system) -> Simulation:
    """Saved and loaded."""
    return Simulation.load(Simulation(system).save("kept.h5", force=True))


@pytest.mark.parametrize(
    ("act", "error", "words"),
    [
        (lambda gas: gas.advance(time=-1), ValueError, "is past"),
        (lambda gas: gas.advance(time=np.nan), ValueError, "nan"),
        (lambda gas: gas.advance(time="soon"), ValueError, "soon"),
        (lambda gas: gas.advance(events=None, collisions=[1]), TypeError, "int"),
        (lambda gas: gas.observable("all/temperatur"), RunError, "all/temperature"),
        (lambda gas: gas.colour, AttributeError, "colour"),
        (lambda gas: gas.next_events("x"), ValueError, "x"),
        (lambda _: kept({"species": {"count": 9, "radius": 0.1}}).advance(), ValueError, "&stop"),
        (lambda gas: gas.change({"species.a.count": 3}), ProgramError, "cannot change"),
        (lambda gas: gas.change({"contact.contact_time": 0}), ProgramError, "columns"),
        (lambda gas: gas.change({"contact.restitution": 2}), ProgramError, "from 0 to 1"),
        (lambda gas: setattr(gas, "velocity", np.zeros(3)), ValueError, "(3,)"),
        (lambda gas: setattr(gas, "velocity", gas.velocity * np.nan), ValueError, "below"),
        (lambda gas: setattr(gas, "velocity", 1e90 * gas.velocity), ProgramError, "out of range"),
        (lambda gas: setattr(gas, "mass", gas.mass), AttributeError, "mass"),
        (lambda gas: setattr(gas, "velocities", gas.velocity), AttributeError, "velocity can"),
        (lambda gas: gas.change([("box.gravity", 1)]), TypeError, "a dictionary"),
        (lambda _: Simulation(GAS, threads=0), ValueError, "from 1 to 1024"),
        (lambda _: Simulation.load("no.h5", threads=1.5), ValueError, "not 1.5"),
        (lambda _: Simulation(None), TypeError, "its text"),
        (lambda _: Simulation("&species count = -1 radius = 1 /"), ProgramError, "from 1 to"),
        (lambda gas: gas.save("/proc/none/x.h5"), ProgramError, "/proc/none"),
        (copy.copy, TypeError, "save it"),
        (lambda gas: [gas.close(), gas.close(), gas.position], ValueError, "closed"),
        (lambda gas: [gas.close(), gas.advance()], ValueError, "closed"),
        (lambda _: Simulation("no.nml"), ProgramError, "no.nml"),
        (lambda _: Simulation({"species": {"count": []}}), TypeError, "empty"),
        (lambda _: Simulation(GAS, {"run.seeed": 1}), ProgramError, "seed"),
        (lambda _: Simulation("&box /\0"), ValueError, "zero"),
        (lambda _: Simulation.load("no.h5"), ProgramError, "no.h5"),
        (lambda _: Simulation.load("/dev/null"), ProgramError, "/dev/null"),
    ],
)
def test_wrong_use_is_said_in_one_line(act, error, words, tmp_path, monkeypatch):
    """The process goes on, and so does another simulation."""
    monkeypatch.chdir(tmp_path)
    gas = Simulation(GAS)
    with pytest.raises(error, match=re.escape(words)) as caught:
        act(gas)
    assert len(str(caught.value).splitlines()) == 1
    assert Simulation(GAS).advance(events=5).events == 5


def test_a_simulation_that_breaks_off_says_so():
    """With the message of the program and its code, each time it is asked to go on."""
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
    """To the end of the plain run, bit for bit."""
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


def test_a_change_is_work_and_goes_on_in_the_program(program, tmp_path, monkeypatch):
    """With the input that was saved; that of the start is refused by name."""
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
    soft = {"contact.restitution_law": "power", "contact.restitution_speed": 1}
    gas.change({"box.gravity": (0, 3), "side.top.temperature": 2, **soft})
    gas.advance(events=150).change({"contact.restitution": 0.7})
    gas.advance(events=200).velocity = 2 * gas.velocity
    gas.advance(events=300)
    assert balance() == pytest.approx(before, rel=1e-12)
    assert {"changed", "thermal", "falling", "soft"} <= gas.nature
    gas.save("gas.h5", input="changed.nml")
    told = ran(program, "gas.nml", "-o", "gas.h5", "--resume", "--quiet", "--set=run.seed=5")
    assert told.returncode == 2 and "there box.gravity = [0, 3]" in told.stderr
    ran(program, "changed.nml", "-o", "gas.h5", "--resume", "--quiet", check=True)
    whole, gas = read_run("gas.h5"), gas.advance()
    assert np.array_equal(whole.velocity[-1], gas.velocity)
    assert whole.nature == gas.nature
    assert Simulation.load("gas.h5").changes == gas.changes
    assert [name for _, name, _ in gas.changes][-2:] == ["contact.restitution", "velocity"]


def test_the_library_needs_no_hdf5_and_shows_its_functions_only():
    """Those of the header."""
    path = library()._name
    assert "hdf5" not in ran("ldd", path, check=True).stdout
    listed = ran("nm", "-D", "--defined-only", path, check=True).stdout.split()[2::3]
    header = (Path(__file__).resolve().parents[2] / "src/ricochet.h").read_text().split("/* ---")[0]
    assert sorted(listed) == sorted(re.findall(r"\b(ricochet_\w+)\(", header))


def test_a_fork_and_an_interpreter_that_ends_do_no_harm():
    """A child goes on by itself; the end during `advance` is the end of the process."""
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
