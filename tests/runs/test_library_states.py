"""A simulation in memory: its state, its events, copies of it, and the time that it reaches.

`test_random_systems.py` tests with random systems that advancing in small steps, saving and loading
do not affect the results.
"""

import copy
import math
import multiprocessing
import pickle
import random
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

from library_systems import ENDLESS, GAS
from ricochet import EventLog, Simulation
from ricochet.running.simulation import NEVER
from ricochet.running.state import COLUMNS as ALL_COLUMNS

COLUMNS = [name for name in ALL_COLUMNS if name not in ("recycled", "present")]  # a closed gas


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
    """Arrays are read-only copies, to which complete arrays can be assigned."""
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
    """They continue independently, with bit-identical results."""
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
    """The reported events are those of the event log, and reporting does not affect the motion."""
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
    assert len(gas.event_log(10**12).time) == len(seen) and len(gas.event_log(0).time) == 0


@pytest.mark.parametrize("seed", range(4))
def test_a_call_may_end_between_simultaneous_events(seed):
    """Counts are exact, and the next call continues with the remaining events of that time."""
    rng = random.Random(seed)
    count, rows = rng.randrange(2, 7), rng.randrange(1, 3)
    places = [((k + 1) / (count + 1), 0.3 + 0.4 * r) for r in range(rows) for k in range(count)]
    system = {"box": {"boundary": [rng.choice(["wall", "periodic"]), "wall"]}}
    system["species"] = {"radius": 0.05, "position": places, "velocity": [(0, 1)] * len(places)}
    with Simulation(system) as whole, Simulation(system) as parts, Simulation(system) as stopped:
        log: list = []
        whole.advance(events=5 * len(places), on_event=log.append)
        assert len({event.time for event in log}) < len(log), "many are simultaneous"
        for k, event in enumerate(log, start=1):
            parts.advance(events=k)
            stopped.advance(time=99, on_event=lambda _: True)
            assert parts.events == stopped.events == k and parts.time == event.time
            collisions = sum(one.j > 0 for one in log[:k])
            assert parts.collisions == stopped.collisions == collisions
            assert np.array_equal(parts.velocity, stopped.velocity)
        assert np.array_equal(parts.velocity, whole.velocity)
        ends = [one.advance(time=log[-1].time + 3) for one in (whole, parts, stopped)]
        for name in ("events", "position", "velocity"):
            first, *others = (getattr(one, name) for one in ends)
            assert all(np.array_equal(first, other) for other in others)


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
    """The simulation continues as if it had started with these positions."""
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
    """A simulation advanced in one call reaches the same state to the last bit."""
    text = "&box boundary = 'periodic', 'periodic' /\n&species name = 'a' count = 200"
    text += " packing_fraction = 0.6 placement = 'dense' temperature = 1 /\n"
    with Simulation(text) as one, Simulation(text) as other:
        while one.collisions < 1e5:
            one._go_on((np.inf, NEVER, NEVER), 1e-6)
            other.advance(time=one._settle())
            for name in ("events", "position", "velocity"):
                assert np.array_equal(getattr(one, name), getattr(other, name)), name


def test_a_simulation_reaches_each_representable_time():
    """If rounding kept the simulation before the requested time, `advance` would not end."""
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
