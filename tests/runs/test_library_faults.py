"""Wrong use, interrupts, processes and memory: the library never ends the calling process."""

import gc
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from library_systems import ENDLESS, GAS
from ricochet import ProgramError, RunError, Simulation
from synthetic_run import ROOT

RESTING = {"species": {"count": 9, "radius": 0.1, "velocities": "rest"}}
SHEARED = {"box": {"boundary": ["periodic", "periodic"], "shear_rate": 1}}
SHEARED |= {"species": {"count": 1, "radius": 0.1}}


def test_handles_share_nothing_and_give_all_back():
    """Simulations are independent, and all memory is released, even for invalid inputs."""
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
    """Ctrl-C raises an exception quickly, and the simulation can continue unchanged."""
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
    """`advance` releases the interpreter lock, so that other Python threads run."""
    gas, counted, events = Simulation(GAS, ENDLESS), 0, 10**4
    while counted <= 10:  # until one call takes long enough
        counted, events = 0, 2 * events
        worker = threading.Thread(target=gas.advance, kwargs={"events": events})
        worker.start()
        while worker.is_alive():
            counted += 1
            time.sleep(1e-3)
        assert gas.events == events


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
        (lambda gas: gas.change({"gravity": 3}), ProgramError, "did you mean box.gravity?"),
        (lambda gas: gas.change({"contact.contact_time": 0}), ProgramError, "data that the disks"),
        (lambda gas: gas.change({"contact.restitution": 2}), ProgramError, "from 0 to 1"),
        (lambda gas: setattr(gas, "velocity", np.zeros(3)), ValueError, "(3,)"),
        (lambda gas: setattr(gas, "velocity", gas.velocity * np.nan), ValueError, "below"),
        (lambda gas: setattr(gas, "velocity", gas.velocity + 0j), ValueError, "of real numbers"),
        (lambda gas: setattr(gas, "position", gas.position + 1j), ValueError, "of real numbers"),
        (lambda gas: setattr(gas, "velocity", gas.velocity.astype(str)), ValueError, "of real"),
        (lambda gas: setattr(gas, "velocity", 1e90 * gas.velocity), ProgramError, "out of range"),
        (lambda gas: setattr(gas, "mass", gas.mass), AttributeError, "mass"),
        (lambda gas: setattr(gas, "velocities", gas.velocity), AttributeError, "velocities"),
        (lambda gas: gas.change([("box.gravity", 1)]), TypeError, "a dictionary"),
        (lambda _: Simulation(GAS, threads=0), ValueError, "from 1 to 1024"),
        (lambda _: Simulation.load("no.h5", threads=1.5), ValueError, "not 1.5"),
        (lambda _: Simulation(None), TypeError, "its text"),
        (lambda _: Simulation(f"{ROOT}/input/gsa.nml"), ProgramError, "input/gas.nml?"),
        (lambda _: Simulation("&species count = -1 radius = 1 /"), ProgramError, "from 1 to"),
        (lambda gas: gas.save("/proc/none/x.h5"), ProgramError, "/proc/none"),
        (lambda gas: gas.advance(events=9).advance(events=8), ValueError, "8 has passed"),
        (lambda gas: gas.advance(collisions=-1), ValueError, "-1 has passed"),
        (lambda gas: gas.advance(collisions=2.5), ValueError, "2.5 is not a whole number"),
        (lambda gas: gas.advance(events=np.nan), ValueError, "events: nan is not a whole number"),
        (lambda gas: gas.advance_by(events=0.5), ValueError, "events: 0.5 is not a whole number"),
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
    """Wrong use raises an exception with a one-line message; other simulations continue."""
    monkeypatch.chdir(tmp_path)
    gas = Simulation(GAS)
    with pytest.raises(error, match=re.escape(words)) as caught:
        act(gas)
    assert len(str(caught.value).splitlines()) == 1
    assert Simulation(GAS).advance(events=5).events == 5


def test_a_simulation_that_breaks_off_says_so():
    """A failed simulation raises the message of the program at every further call."""
    words = """&box gravity = 0, -1 /
    &species count = 1 radius = 0.1 position = 0.5, 0.5 velocity = 0, 0 /
    &contact wall_restitution = 0 /
    &stop time = 1000 /"""
    with Simulation(words) as ball:
        for _ in range(2):
            with pytest.raises(ProgramError, match="collapse") as caught:
                ball.advance()
            assert caught.value.code == 4


def test_files_that_are_refused_leave_no_memory_behind(tmp_path):
    """Missing, damaged or foreign files cause no memory leaks."""
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
    """Whatever bits are damaged, the message is a single line."""
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


def test_a_fork_and_an_interpreter_that_ends_do_no_harm():
    """A child process continues independently, and the interpreter may end during `advance`."""
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
gas = Simulation({GAS!r}, {ENDLESS})
other = threading.Thread(target=gas.advance, kwargs={{"events": 10**5}})
other.start()
gas.advance(events=10**5)  # two threads, one simulation
other.join()
"""
    assert subprocess.run([sys.executable, "-c", script], timeout=300).returncode == 0
