"""Rough disks, thermal and sliding walls.

Every method, and a run that was stopped, gives the same bits; the balance of energy holds.
"""

from pathlib import Path

import numpy as np
import pytest

from ricochet import read_run
from whole_runs import FINISHED, STOPPED, differences, write_input

INPUTS = Path(__file__).parents[2] / "input"
DISKS = """&species name = 'a' count = 2500 radius = 0.005 temperature = 1
rotational_temperature = 1 /
&species name = 'b' count = 300 radius = 0.01 mass = 4 temperature = 1 angular_velocity = 20 /
&stop collisions = 15000 /
&output observables_every_collisions = 5000 event_log = .true. /
"""
ROUGH = "&contact restitution = 0.95 tangential_restitution = 0.4 friction = 0.3 inertia = 0.4\n"
SYSTEMS = {
    "rough": ROUGH + "/ &box upper = 2, 1 boundary = 'periodic', 'periodic' /\n",
    "walls": ROUGH
    + """wall_rule = 'normal' wall_friction = 0.1 contact_time = 1e-4 / &run seed = 7 /
&box upper = 2, 1 gravity = 0, -1 /
&side name = 'left' temperature = 2 /
&side name = 'top' tangential_restitution = 1 speed = 2 /
&obstacle name = 'post' centre = 1, 0.4 radius = 0.15 temperature = 3 speed = 1 /
&wall name = 'ramp' from = 1.4, 0.2 to = 1.8, 0.4 restitution = 0.5 speed = -1 /
""",
    "steps": ROUGH
    + """wall_rule = 'normal' / &run dynamics = 'steps' dt = 1e-5 / &box upper = 2, 1 /
&side name = 'left' temperature = 2 speed = 1 /
""",
}


@pytest.fixture(params=SYSTEMS)
def system(request, ricochet, tmp_path):
    """A finished run, plain.h5, of one of the systems."""
    write_input(tmp_path, SYSTEMS[request.param] + DISKS)
    stop = ["--set=stop.time=0.004"] if request.param == "steps" else []
    assert ricochet("gas.nml", "-o", "plain.h5", *stop).returncode == FINISHED
    return request.param, stop


def traces(tmp_path, other):
    """Where a run differs from plain.h5, apart from its own input."""
    found = differences(tmp_path / "plain.h5", tmp_path / other)
    return [name for name in found if not name.startswith("/parameters")]


@pytest.mark.parametrize("method", ["run.threads=2", "run.search=pairs", "run.queue=heap"])
def test_every_method_gives_the_same_bits(system, ricochet, tmp_path, method):
    name, stop = system
    if name == "steps" and "queue" in method:
        pytest.skip("time steps have no queue")
    run = ricochet("gas.nml", "-o", "other.h5", "--set", method, *stop)
    assert run.returncode == FINISHED, run.stderr
    assert traces(tmp_path, "other.h5") == []


def test_a_stopped_run_goes_on_with_the_same_bits(system, ricochet, tmp_path):
    _, stop = system
    part = ricochet("gas.nml", "-o", "other.h5", "--set=stop.wall_clock=1e-9", *stop)
    assert part.returncode == STOPPED
    assert ricochet("gas.nml", "-o", "other.h5", "--resume", *stop).returncode == FINISHED
    assert traces(tmp_path, "other.h5") == []


def energies(run):
    """The terms of the balance that this run has, with their signs."""
    gains = ("heat", "work", "drive_energy")
    signs = {"total_energy": 1, "dissipated_energy": 1, **dict.fromkeys(gains, -1)}
    there = [name for name in signs if name in run.observables]
    return [signs[name] * run.observable(name).value for name in there]


def test_the_balance_of_energy_holds_to_rounding(system, tmp_path):
    terms = energies(read_run(tmp_path / "plain.h5"))
    balance = np.sum(terms, axis=0)
    assert len(terms) == {"rough": 2, "walls": 4, "steps": 4}[system[0]]
    assert np.ptp(balance) < 1e-12 * np.max(np.abs(terms))


#: How many terms the balance of energy has for each input.
TERMS = {
    **{"fourier": 3, "couette": 4, "rough": 2},
    **{"leidenfrost": 3, "demon": 3, "nut": 3, "heated": 3, "active": 3},
}


@pytest.mark.parametrize("name", TERMS)
def test_the_inputs_keep_the_balance_of_energy(ricochet, tmp_path, name):
    stop = ("--set=stop.collisions=100000",)
    run = ricochet(INPUTS / f"{name}.nml", "-o", "gas.h5", *stop)
    assert run.returncode == FINISHED, run.stderr
    run = read_run(tmp_path / "gas.h5")
    terms = energies(run)
    assert len(terms) == TERMS[name]
    assert np.ptp(np.sum(terms, axis=0)) < 1e-12 * np.max(np.abs(terms))
    if name == "couette":
        work, heat = (run.observable(kind).value for kind in ("work", "heat"))
        middle = len(work) // 2
        assert work[-1] - work[middle] > 1000
        assert heat[-1] - heat[middle] == pytest.approx(work[middle] - work[-1], rel=0.15)


@pytest.mark.parametrize("name", TERMS)
def test_the_inputs_leave_no_trace_of_threads_and_stops(ricochet, tmp_path, name):
    path, stop = INPUTS / f"{name}.nml", "--set=stop.collisions=20000"
    assert ricochet(path, "-o", "plain.h5", stop).returncode == FINISHED
    assert ricochet(path, "-o", "threads.h5", stop, "--set=run.threads=2").returncode == FINISHED
    early = ("--set=stop.collisions=9000", "--set=stop.wall_clock=1e-9")
    assert ricochet(path, "-o", "parts.h5", early[0]).returncode == FINISHED
    assert ricochet(path, "-o", "parts.h5", "--resume", stop, early[1]).returncode == STOPPED
    assert ricochet(path, "-o", "parts.h5", "--resume", stop).returncode == FINISHED
    assert traces(tmp_path, "threads.h5") == traces(tmp_path, "parts.h5") == []
