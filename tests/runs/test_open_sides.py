"""Open sides and sources: exact departures, exact balances, and the same bits in all engines."""

import math
import pickle

import h5py
import numpy as np
import pytest

import ricochet
from ricochet import ProgramError, Simulation
from whole_runs import contents, one_line, ran, unlike

GAS = """
&run seed = 3 /
&box upper = 1, 1 gravity = 0.2, -1 /
&side name = 'right' open = .true. /
&side name = 'left' motion = 'sine' amplitude = 0.03 period = 0.7 /
&obstacle name = 'peg' centre = 0.7, 0.5 radius = 0.1 /
&species name = 'gas' count = 150 waiting = 30 radius = 0.01 temperature = 1 /
&species name = 'big' count = 5 waiting = 2 radius = 0.06 mass = 9 temperature = 1 /
&contact restitution = 0.9 tangential_restitution = 0.3 /
&source name = 'pump' species = 'gas' region = 0.1, 0.5, 0, 1 interval = 0.05 count = 4
  temperature = 2 end_time = 0.9 /
&source name = 'press' species = 'big' region = 0.1, 0.5, 0, 1 interval = 0.1 velocity = 1, 0 /
&source name = 'rain' species = 'gas' interval = 0.07 velocity = 0, -1 start_time = 0.3 /
&change time = 0.45 set = 'source.pump.count=2' 'box.gravity=0, 0' /
&stop time = 1.1 /
&output observables_every_time = 0.1 frames_every_time = 0.5 event_log = .true. /
"""
BASE = "&box upper = 2, 1 /\n&side name = 'right' open = .true. /\n"


def test_a_change_to_an_interval_whose_entries_cannot_be_counted_is_refused(program, tmp_path):
    """Without a stop time only the time of the change reveals it."""
    text = (
        "&species name = 'gas' count = 20 waiting = 5 radius = 0.01 speed = 1 /\n"
        "&source name = 'pump' species = 'gas' interval = 0.1 temperature = 1 /\n"
    )
    with Simulation(text) as run:
        run.advance(time=1)
        with pytest.raises(ProgramError, match="interval: 1e18 intervals until this change"):
            run.change({"source.pump.interval": 1e-18})
        run.change({"source.pump.interval": 0.2})
    change = "&change time = 1 set = 'source.pump.interval=1e-18' /\n"
    (tmp_path / "gas.nml").write_text(f"{text}{change}&stop collisions = 10 /")
    refused = ran(program, "gas.nml", "--check", cwd=tmp_path)
    assert refused.returncode == 2 and "intervals until this change" in refused.stderr


@pytest.fixture(scope="module")
def whole(program, tmp_path_factory):
    """Execute the run of GAS with the serial engine."""
    folder = tmp_path_factory.mktemp("open")
    (folder / "gas.nml").write_text(GAS)
    ran(program, "gas.nml", "-o", "gas.h5", cwd=folder, check=True)
    return folder / "gas.h5"


def test_free_disks_leave_at_exact_times(tmp_path, program):
    """The centre of a point-like disk reaches the line after the distance over its velocity."""
    rng = np.random.default_rng(1)
    x, v = rng.random((40, 2)) * [1.9, 0.9] + 0.05, rng.random((40, 2)) * [1, 0] + [0.1, 0]
    x[:, 1] = np.linspace(0.05, 0.95, 40)
    (tmp_path / "free.nml").write_text(
        f"{BASE}&species radius = 1e-9 position = {', '.join(map(repr, x.ravel().tolist()))}"
        f" velocity = {', '.join(map(repr, v.ravel().tolist()))} /\n&output event_log = .true. /\n"
    )
    ran(program, "free.nml", "-o", "a.h5", "--set", "stop.disks_inside=7", cwd=tmp_path, check=True)
    with h5py.File(tmp_path / "a.h5") as file:
        events = {name: item[()] for name, item in file["events"].items()}
        inside = file["observables/inside/value"][()]
        left = file["observables/sides/right/left/value"][()]
    times = (2 - x[:, 0]) / v[:, 0]
    order = np.argsort(times)[:33]
    np.testing.assert_array_equal(events["i"], order + 1)
    np.testing.assert_allclose(events["time"], times[order], rtol=4e-16)
    assert np.all(events["j"] == -1) and not events["impulse"].any()
    assert not events["momentum_change"].any()
    assert inside.tolist() == [40, 7] and left.tolist() == [0, 33]


def test_numbers_and_energy_balance(whole):
    """Disks are conserved exactly, energy up to rounding errors of its largest term."""
    run = contents(whole)
    values = {
        name.removeprefix("/observables/").removesuffix("/value"): value
        for name, value in run.items()
        if name.startswith("/observables/") and name.endswith("/value")
    }
    entered = sum(value for name, value in values.items() if name.endswith("/entered"))
    assert np.all(values["inside"] == 123 + entered - values["sides/right/left"])
    assert np.all(values["inside"] == values["gas/particle_number"] + values["big/particle_number"])
    assert values["sides/right/left"][-1] > 20 and entered[-1] > 40
    terms = {"total_energy": 1, "dissipated_energy": 1, "work": -1, "heat": -1}
    terms |= {"outflow_energy": 1, "inflow_energy": -1}
    balance = sum(sign * values[name] for name, sign in terms.items() if name in values)
    largest = max(np.abs(values[name]).max() for name in terms if name in values)
    assert np.abs(balance - balance[0]).max() < 1e-12 * largest
    present = run["/particles/disks/present/value"]
    assert np.array_equal(present.sum(1), values["inside"][[0, 5, 10, 11]])
    for name in ("position", "velocity", "angular_velocity", "orientation"):
        absent = np.isnan(run[f"/particles/disks/{name}/value"])
        assert np.array_equal(absent.reshape(*present.shape, -1).any(2), present == 0), name


@pytest.mark.parametrize(
    "setting",
    ["run.search=pairs", "run.search=rescan", "run.queue=heap", "run.threads=3", "stop.events=300"],
)
def test_all_engines_and_a_resumed_run_agree(whole, program, tmp_path, setting):
    """The output depends neither on search, queue and threads nor on an interruption."""
    (tmp_path / "gas.nml").write_text(GAS)
    ran(program, "gas.nml", "-o", "b.h5", f"--set={setting}", cwd=tmp_path, check=True)
    if setting.startswith("stop"):
        ran(program, "gas.nml", "-o", "b.h5", "--resume", cwd=tmp_path, check=True)
    different = unlike(contents(whole), contents(tmp_path / "b.h5"))
    own = ("/parameters/run@", "/parameters/overrides", "/checkpoint")
    data = [name for name in different if not name.startswith(own)]
    if setting.startswith("stop"):  # the file has a frame of the state at which the run stopped
        data = [name for name in data if not name.startswith("/particles")]
    assert not data


def test_a_simulation_in_memory_has_the_same_course(whole, tmp_path):
    """Steps, copies, pickles and saved files do not affect a simulation."""
    gas = Simulation(GAS).advance(events=100).copy()
    gas = pickle.loads(pickle.dumps(gas.advance(time=0.5)))
    gas.save(tmp_path / "gas.h5")
    gas = Simulation.load(tmp_path / "gas.h5").advance(time=1.1)
    run = contents(whole)
    for name in ("position", "velocity", "present"):
        np.testing.assert_array_equal(getattr(gas, name), run[f"/particles/disks/{name}/value"][-1])
    assert gas.observable("inside") == run["/observables/inside/value"][-1]
    assert gas.observable("outflow_energy") == run["/observables/outflow_energy/value"][-1]


def test_sides_open_and_close_in_memory():
    """A lid opens and closes; it is refused if a disk is on its line, or for a run without lids."""
    gas = Simulation(
        BASE + "&species radius = 0.05 position = 0.5, 0.5, 1, 0.5, 1.5, 0.5 velocity = 1, 0 /"
    )
    gas.advance(time=0.47)
    with pytest.raises(ProgramError, match="disk 3 overlaps the line of the side"):
        gas.change({"side.right.open": False})
    gas.advance(time=0.6).change({"side.right.open": False}).advance(time=10)
    assert gas.observable("sides/right/left") == 1 and gas.observable("inside") == 2
    gas.velocity = -gas.velocity  # NaN of the absent disk is ignored
    gas.change({"side.right.open": True}).advance(time=20)
    assert gas.observable("inside") == 0 and math.isnan(gas.observable("all/temperature"))
    closed = Simulation("&species count = 3 radius = 0.05 speed = 1 /").advance(time=1)
    with pytest.raises(ProgramError, match=r"side\.open can change during a run only if"):
        closed.change({"side.left.open": True})
    closed.schedule(2, {"side.left.open": True}).advance(time=20)
    assert closed.observable("inside") < 3


def test_sources_act_at_multiples_within_their_times():
    """The k-th action is at k times the interval, and changes of the source take effect."""
    gas = Simulation(
        BASE + "&species count = 40 waiting = 40 radius = 0.01 /\n&source name = 's' "
        "interval = 0.25 count = 2 velocity = 0, 0 start_time = 0.5 end_time = 1.25 /"
    )
    counts = [gas.advance(time=0.125 * k).observable("inside") for k in range(14)]
    assert counts == [0, 0, 0, 0, 2, 2, 4, 4, 6, 6, 8, 8, 8, 8]
    assert np.flatnonzero(gas.present).tolist() == list(range(8))
    gas.change({"source.s.end_time": 10, "source.s.interval": 1, "source.s.count": 5})
    assert [gas.advance(time=t).observable("sources/s/entered") for t in (1.9, 2, 3)] == [8, 13, 18]


@pytest.mark.parametrize(
    ("interval", "start", "end", "actions"),
    [(0.1, 0, 0.3, 3), (0.57, 57, 58, 2), (0.1, 0.7, 0.7, 1), (0.1, 0, 0.0999, 0)],
)
def test_start_and_end_of_a_source_are_inclusive(interval, start, end, actions):
    """A multiple of the interval may differ from them by rounding errors."""
    gas = Simulation(
        BASE + f"&species count = 9 waiting = 9 radius = 0.01 /\n&source interval = {interval} "
        f"velocity = 0, 0 start_time = {start} end_time = {end} /"
    )
    assert gas.advance(time=60).observable("inside") == actions


def test_a_source_without_room_inserts_as_many_disks_as_fit():
    """The others try again at the next times, including after space has become free."""
    gas = Simulation(
        "&box upper = 2, 1 /\n&species count = 20 waiting = 20 radius = 0.1 /\n&source name = 's' "
        "interval = 0.1 count = 20 velocity = 0, 0 region = 0, 0.3, 0, 0.3 /"
    )
    assert gas.advance(time=5).observable("inside") == 1
    gas.velocity = np.where(gas.present[:, None], [1, 0], np.nan)
    assert gas.advance(time=5.45).observable("inside") == 2


def test_sources_at_one_time_act_in_the_order_of_the_file():
    """The first one takes the disks with the lowest ids."""
    source = "&source name = '{}' interval = {} count = 3 velocity = 0, {} start_time = 1 /\n"
    gas = Simulation(
        BASE + "&species count = 4 waiting = 4 radius = 0.01 /\n" + source.format("a", 1, 1)
        + source.format("b", 0.5, 2)
    )  # fmt: skip
    gas.advance(time=1)
    assert [gas.observable(f"sources/{name}/entered") for name in "ab"] == [3, 1]
    assert gas.velocity[:, 1].tolist() == [1, 1, 1, 2]


@pytest.mark.parametrize(
    ("addition", "message"),
    [
        ("&stop time = 1 energy_fraction = 0.5 /", "stop.energy_fraction: cannot be combined"),
        ("&stop time = 1 /\n&output helfand = .true. /", "output.helfand: cannot be combined"),
        ("&stop time = 1 /\n&box shear_rate = 1 boundary = 2*'periodic' /", "is periodic"),
        (
            "&stop time = 1 /\n&drive kind = 'recycle' interval = 1 temperature = 1 "
            "from_region = 0, 1, 0, 0.1 to_region = 0, 1, 0.5, 1 /\n&source interval = 1 "
            "temperature = 1 /",
            "source: cannot be combined with drive.kind",
        ),
        ("&stop time = 1 /\n&source interval = 1 /", "source.velocity: is missing"),
        ("&stop time = 1 /\n&source temperature = 1 /", "source.interval: is missing"),
        ("&source temperature = 1 interval = 1e-15 end_time = 2 /", "2e15 intervals until the end"),
        ("&source temperature = 1 interval = 1e-9 start_time = 1e7 /", "1e16 intervals until"),
        (
            "&obstacle name = 'hub' centre = 1, 0.5 radius = 0.3 /\n&source temperature = 1 "
            "interval = 1 region = 0.9, 1.1, 0.4, 0.6 /",
            'source.region: no disk fits into it because of obstacle "hub"',
        ),
        (
            "&obstacle centre = 1, 0.5 radius = 0.5 side = 'inside' /\n&source temperature = 1 "
            "interval = 1 region = 1.8, 2, 0.9, 1 /",
            'source.region: no disk fits into it because of obstacle "obstacle1"',
        ),
    ],
)
def test_impossible_combinations_are_refused(program, tmp_path, addition, message):
    """The message names the variable."""
    base = BASE if "&box" not in addition else BASE.split("\n", 1)[1]
    (tmp_path / "a.nml").write_text(base + "&species count = 9 radius = 0.01 /\n" + addition)
    assert message in ran(program, "a.nml", "--check", cwd=tmp_path).stderr


def test_a_start_needs_all_disks(whole, program, tmp_path):
    """The message says how many disks are outside."""
    (tmp_path / "b.nml").write_text(
        "&species name = 'gas' file = 'gas.h5' /\n&box upper = 1, 1 /\n&stop time = 1 /"
    )
    (tmp_path / "gas.h5").write_bytes(whole.read_bytes())
    assert "are not in the box" in one_line(ran(program, "b.nml", "--check", cwd=tmp_path))


def test_time_steps_let_disks_leave_and_enter(program, tmp_path):
    """Time-stepped runs balance, too, with both searches of pairs."""
    text = GAS.replace("seed = 3", "seed = 3 dynamics = 'steps' dt = 0.002")
    (tmp_path / "gas.nml").write_text(text.replace("&contact ", "&contact contact_time = 0.01 "))
    for name, search in (("a", "cells"), ("b", "pairs")):
        ran(program, "gas.nml", "-o", name + ".h5", f"--set=run.search={search}", cwd=tmp_path)
    one, other = (ricochet.read_run(tmp_path / f"{name}.h5") for name in "ab")
    for name in ("inside", "total_energy", "outflow_energy", "sources/pump/entered"):
        np.testing.assert_array_equal(one.observable(name).value, other.observable(name).value)
    assert one.observable("sides/right/left").value[-1] > 20
    assert one.observable("sources/pump/entered").value[-1] > 20
