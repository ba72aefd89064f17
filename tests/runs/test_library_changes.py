"""Changes of a running simulation, saved simulations, and their continuation by the program."""

import json
import pickle
import random
from pathlib import Path

import numpy as np
import pytest

import ricochet
from library_systems import GAS
from ricochet import ProgramError, Simulation, read_run
from whole_runs import ran


def test_the_table_says_what_may_change_in_a_running_simulation(program):
    """A variable not marked as changeable in the table is refused for this reason."""
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


def test_a_saved_simulation_goes_on_in_the_program_and_back(program, tmp_path, whole):
    """The final state is bit-identical to that of an uninterrupted run."""
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
    """The energy balance holds, and the saved input gives the position of the side."""
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


#: Variables of each motion of a side at its mean position.
MOTIONS = {
    "still": {},
    "sine": {"amplitude": 0.01, "period": 1, "phase": 0},
    "parabolic": {"amplitude": 0.01, "period": 1, "phase": 0},
    "sawtooth": {"velocity": 1},
    "constant_velocity": {"velocity": 0.1, "start_time": 1, "end_time": 2},
    "piston": {"mass": 10, "force": 100},
}


@pytest.mark.parametrize("new", MOTIONS)
@pytest.mark.parametrize("former", MOTIONS)
def test_a_new_motion_drops_the_variables_of_the_former_one(former, new):
    """Only variables set by the same change are reported if they have no effect."""
    system = {"side": {"name": "right", "motion": former} | MOTIONS[former]}
    system["species"] = {"count": 5, "radius": 0.02, "temperature": 1}
    change = {f"side.right.{name}": value for name, value in MOTIONS[new].items()}
    change["side.right.motion"] = new
    with Simulation(system) as gas:
        for name in sorted(MOTIONS[former].keys() - MOTIONS[new].keys()):
            with pytest.raises(ProgramError, match=f"{name}: has no effect with motion = '{new}'"):
                gas.change(change | {f"side.right.{name}": MOTIONS[former][name]})
        side = gas.change(change).parameters["side"]["right"]
        assert side.keys() & {name for own in MOTIONS.values() for name in own} == {*MOTIONS[new]}
        assert gas.changes == ([] if former == new else gas.changes) and side["motion"] == new
        energy = gas.advance(time=0.3).observable("total_energy")
        with Simulation(gas.input) as again:
            if former in ("still", new):
                assert again.advance(time=0.3).observable("total_energy") == energy


def test_a_piston_is_held_by_its_motion_alone(program, tmp_path, monkeypatch):
    """It stays where it is, and the program continues the run with the saved input."""
    monkeypatch.chdir(tmp_path)
    gas = Simulation(ricochet.example("constant_pressure"), {"stop.time": 9}).advance(time=1)
    place = gas.observable("sides/right/position")
    gas.change({"side.right.motion": "still"})
    assert "force" not in gas.input and "mass" not in gas.parameters["side"]["right"]
    assert gas.parameters["side"]["right"]["position"] == pytest.approx(place, rel=1e-15)
    gas.save("gas.h5", input="gas.nml")
    ran(program, "gas.nml", "-o", "gas.h5", "--resume", "--set=stop.time=1.5", check=True)
    assert np.array_equal(read_run("gas.h5").position[-1], gas.advance(time=1.5).position)
    assert gas.observable("sides/right/position") == place
    gas.change({"side.right.motion": "piston", "side.right.mass": 10, "side.right.force": 100})
    assert gas.advance(time=2).observable("sides/right/position") != place


@pytest.mark.parametrize("schedule", ["frames_every_time = 1e-9", "event_log = .true."])
def test_a_saved_simulation_needs_room_for_what_is_written_only(
    schedule, program, tmp_path, monkeypatch
):
    """When the program continues the run, the file grows to that of an undisturbed run."""
    monkeypatch.chdir(tmp_path)
    text = "&species count = 50 radius = 0.01 speed = 1 /\n&stop time = 0.9 /\n"
    text += f"&output {schedule} /\n"
    gas = Simulation(text).advance(time=2.5e-8)
    saved = gas.save("gas.h5", input="gas.nml")
    assert saved.stat().st_size < 200_000 and len(pickle.dumps(gas)) < 200_000
    copy = pickle.loads(pickle.dumps(gas)).advance(time=1e-7)
    assert np.array_equal(copy.position, gas.copy().advance(time=1e-7).position)
    ran(program, "gas.nml", "-o", "gas.h5", "--resume", "--set=stop.time=1e-7", check=True)
    ran(program, "gas.nml", "-o", "whole.h5", "--set=stop.time=1e-7", check=True)
    resumed, whole = read_run("gas.h5"), read_run("whole.h5")
    assert np.array_equal(resumed.position[-1], whole.position[-1])
    assert resumed.n_frames == (whole.n_frames - 25 if "frames" in schedule else 2)


def test_a_change_is_work_and_goes_on_in_the_program(program, tmp_path, monkeypatch):
    """The program continues with the saved input, and refuses the initial one."""
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
    """A simulation in memory needs no stop condition; with one, the program can continue it."""
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


def test_an_input_that_is_written_and_read_again_has_the_same_radii():
    """A radius follows from the packing fraction as given, not from that of the rounded radius."""
    rng = random.Random(1)
    for _ in range(200):
        count, packing = rng.randint(2, 30), rng.uniform(0.01, 0.2)
        gas = Simulation({"species": {"count": count, "packing_fraction": packing, "speed": 1}})
        again = Simulation(gas.input)
        assert again.input == gas.input and again.radius[0] == gas.radius[0], packing


def test_an_input_is_saved_over_nothing_but_a_saved_one(tmp_path, monkeypatch):
    """Only a file saved earlier is replaced, which is checked in advance."""
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


@pytest.mark.parametrize("name", ["side.surface_velocity", "Side.left.Surface_Velocity"])
def test_a_change_takes_effect_however_its_variable_is_written(name):
    """Capital letters are accepted, and names without that of their only group."""
    hot = {"name": "left", "temperature": 1, "surface_velocity": 1}
    gas = Simulation({"side": hot, "species": {"count": 5, "radius": 0.02, "speed": 1}})
    assert gas.change({name: 1}).changes == []
    assert gas.change({name: 0}).changes == [(0.0, name, "0")]
    assert "surface_velocity = 0" in gas.input


def test_one_element_of_a_vector_can_change():
    gas = Simulation(GAS).change({"box.gravity(2)": -5})
    assert gas.parameters["box"]["gravity"] == [0, -5]
    assert gas.change({"box.gravity(2)": -5}).changes == [(0.0, "box.gravity(2)", "-5")]
    with pytest.raises(ProgramError, match="no element 3"):
        gas.change({"box.gravity(3)": 1})
    with pytest.raises(ProgramError, match='unknown variable; did you mean "restitution"'):
        gas.change({"contact.restituton": 0.5})


@pytest.mark.parametrize("kind", ["obstacle", "wall", "species"])
def test_a_file_that_has_changed_moves_no_obstacle(tmp_path, monkeypatch, kind):
    """Changes and saved files read the input again, and are refused if its files have changed."""
    monkeypatch.chdir(tmp_path)
    rows = {"obstacle": "x y radius\n0.3 0.3 0.05\n", "wall": "x1 y1 x2 y2\n0.3 0.3 0.4 0.4\n"}
    rows["species"] = "x y vx vy radius\n0.3 0.3 1 0 0.05\n0.6 0.6 0 1 0.05\n"
    gases = {"species": {"name": "a", "count": 9, "radius": 0.02, "speed": 1}}
    gases |= {kind: {"name": "a", "file": "rows.txt"}}
    Path("rows.txt").write_text(rows[kind])
    gas = Simulation(gases).advance(time=0.1)
    Path("rows.txt").write_text(rows[kind].replace("0.05", "0.04").replace("0.4 0.4", "0.4 0.5"))
    told = rf"^{kind}\.a\.file: rows\.txt has changed since .*restore the file$"
    with pytest.raises(ProgramError, match=told):
        gas.change({"contact.restitution": 0.9})
    with pytest.raises(ProgramError, match=told):
        gas.save("gas.h5")
    assert gas.changes == [] and not list(Path().glob("gas.h5*"))
    Path("rows.txt").write_text(rows[kind])
    gas.change(
        {"contact.restitution": 0.9, f"{kind}.a.restitution": 0.5}
        if kind != "species"
        else {"contact.restitution": 0.9}
    ).save("gas.h5")
    assert np.array_equal(Simulation.load("gas.h5").position, gas.position)
