"""Windows of a run: a part of it between two times is a run under the laws then in force."""

import json
import re

import numpy as np
import pytest

import ricochet as package
from ricochet import RunError, Simulation, read_run, write_start
from ricochet.reading.changed import DEFAULTS, DEFAULTS_OF, OF_MOTIONS, changed, value_of
from ricochet.reading.paths import seen, turns_between
from ricochet.reading.records import changes_in
from ricochet.reading.windows import accumulates
from synthetic_run import run_script

#: A dissipative gas with an obstacle in a box, and all kinds of observables.
BOX = """
&run seed = 3 /
&box upper = 1.2, 1 /
&contact restitution = 0.9 /
&obstacle name = 'post' centre = 0.6, 0.5 radius = 0.1 /
&species name = 'grain' count = 40 radius = 0.02 {start} /
&stop time = {end} /
&output virial_tensor = .true. event_log = .true.
        frames_every_time = 0.05 observables_every_time = 0.05 /
"""

#: A gas whose walls, gravity and laws change.
CHANGED = """
&run seed = 5 /
&box upper = 2, 1 /
&side name = 'right' motion = 'constant_velocity' position = 1 velocity = -0.5 end_time = 1 /
&contact restitution = 0.95 /
&species name = 'gas' count = 60 radius = 0.01 region = 0, 1, 0, 1 temperature = 1 /
&change time = 1 set = 'contact.restitution=0.8', 'box.gravity=0,-0.5' /
&change time = 2 set = 'side.left.temperature=2', 'contact.wall_restitution=1' /
&stop time = 3 /
&output frames_every_time = 0.1 observables_every_time = 0.05 frames_at = 0.35, 2.25 /
"""


def test_a_window_has_the_observables_of_a_run_that_starts_with_its_first_frame(
    simulated, tmp_path
):
    """Sums and counts begin at zero, also in the mean pressure since the start."""
    whole = simulated(BOX.format(start="temperature = 1", end=0.4))
    window = whole.window(0.2)
    place = tmp_path / "start.txt"
    write_start(place, whole.position[4], whole.velocity[4])
    placed = f"placement = 'file' file = '{place}'"
    again = simulated(BOX.format(start=placed, end=0.2), name="again")
    np.testing.assert_allclose(window.time, again.time, atol=1e-12)
    np.testing.assert_allclose(window.position[:], again.position[:], atol=1e-9)
    np.testing.assert_allclose(window.velocity[1:3], again.velocity[1:3], atol=1e-9)
    for name in again.observables:
        time, value = window.observable(name)
        np.testing.assert_allclose(time, again.observable(name).time, atol=1e-12)
        close = {"rtol": 1e-7, "atol": 1e-9}
        np.testing.assert_allclose(value, again.observable(name).value, **close, err_msg=name)
    log, fresh = window.event_log(), again.event_log()
    np.testing.assert_array_equal(log.i, fresh.i)
    np.testing.assert_allclose(log.time, fresh.time, atol=1e-9)
    assert window.pressure(0, 0.2) == pytest.approx(again.pressure(0, 0.2))
    table, other = window.to_dataframe(), again.to_dataframe()
    np.testing.assert_allclose(table["side_impulse_left"], other["side_impulse_left"], rtol=1e-7)


def test_windows_between_changes_have_the_laws_then_in_force(simulated):
    whole = simulated(CHANGED)
    parts = whole.windows()
    assert [part.restitution for part in parts] == [0.95, 0.8, 0.8]
    assert [part.parameter("contact", "wall_restitution") for part in parts] == [0.95, 0.8, 1.0]
    assert [part.gravity[1] for part in parts] == [0, -0.5, -0.5]
    assert ["moving_sides" in part.nature for part in parts] == [True, False, False]
    assert ["thermal_walls" in part.nature for part in parts] == [False, False, True]
    assert all("changed" not in part.nature and not part.changes for part in parts)
    np.testing.assert_allclose([part.upper[0] for part in parts], [1, 1.5, 1.5])
    np.testing.assert_allclose([part.accessible_area(0.0) for part in parts], [1, 1.5, 1.5])
    assert sum(len(part) for part in parts) == len(whole)
    across = whole.window(0.5, 2.5)
    assert "changed" in across.nature
    assert [part.parameter("stop", "time") for part in (*parts, across)] == [1, 1, 1, 2]
    lists = [part.parameter("output", "frames_at") for part in parts]
    assert lists[0] == [0.35] and lists[1] is None and lists[2] == [0.25]
    assert [change.time for change in across.changes] == [0.5, 0.5, 1.5, 1.5]
    for part in (*parts, across):
        for name in part.observables:
            series, own = whole.observable(name), part.observable(name)
            first = np.searchsorted(series.time, part.start)
            expected = series.value[first : first + len(own)]
            if accumulates(name, series.value):
                expected = expected - expected[0]
            if name != "virial_pressure":
                np.testing.assert_array_equal(own.value, expected, err_msg=name)


def test_counts_of_disks_begin_at_zero_also_in_a_sheared_box(simulated):
    """The periodic images above and below have moved since the start of the run."""
    sheared = """
    &box upper = 1, 1 boundary = 'periodic', 'periodic' shear_rate = 2 /
    &species name = 'gas' count = 20 radius = 0.02 temperature = 1 /
    &stop time = 3 / &output frames_every_time = 0.25 /
    """
    whole = simulated(sheared)
    window = whole.window(1.3)
    assert abs(whole.image[-1][:, 1]).max() > 0
    late, step = slice(6, None), 0.25
    moved = np.diff(window.unwrapped(slice(None)), axis=0)
    row = 2 * step * np.floor(whole.unwrapped(6)[:, 1])  # at first in the row of the box
    expected = np.diff(whole.unwrapped(late), axis=0)
    expected[..., 0] -= row
    np.testing.assert_allclose(moved, expected, atol=1e-12)
    np.testing.assert_array_equal(window.unwrapped(0), window.position[0])
    np.testing.assert_array_equal(window.unwrapped(-1), window.unwrapped([-1])[0])
    counts = window.event_count[:]
    np.testing.assert_array_equal(counts, whole.event_count[late] - whole.event_count[6])
    assert counts[-1].sum() > counts[0].sum() == window.events_per_disk[0] == 0


def test_paths_in_a_window_are_those_of_the_run(simulated):
    """The event log of the window contains events before its first frame."""
    whole = simulated(BOX.format(start="temperature = 1", end=0.4))
    part = whole.window(0.17)
    each = [(whole, [4, 5, 7]), (part, [0, 1, 3])]
    logs = [run.event_log() for run, _ in each]
    ends = [seen(run, log, own) for (run, own), log in zip(each, logs, strict=True)]
    assert np.all(np.diff(ends[1]) > 0) and ends[1][0] > 0
    turns = [
        turns_between(run, log, own, end)
        for (run, own), log, end in zip(each, logs, ends, strict=True)
    ]
    for found, expected, shift in zip(*turns[::-1], (0, 0, 0.17, 0), strict=True):
        np.testing.assert_allclose(found + shift, expected, atol=1e-12)


def test_a_window_of_a_window_is_a_window_of_the_run(simulated):
    whole = simulated(CHANGED)
    inner, direct = whole.window(0.5).window(0.7, 2.0), whole.window(1.2, 2.5)
    np.testing.assert_allclose(inner.time, direct.time, atol=1e-12)
    np.testing.assert_array_equal(inner.velocity[:], direct.velocity[:])
    np.testing.assert_allclose(inner.observable("work").value, direct.observable("work").value)
    assert [change.name for change in inner.changes] == [change.name for change in direct.changes]
    assert inner.restitution == direct.restitution == 0.8
    laws = [one.parameters["contact"] for one in (whole.window(1, 3), whole.window(2).window(0))]
    assert laws[0]["wall_restitution"] == 0.8 and laws[1]["wall_restitution"] == 1


#: A gas beside a side that moves.
BESIDE = """
&box upper = 2, 1 /
&side name = 'right' {side} /
&species name = 'gas' count = 20 radius = 0.01 {start} /
{more}
&stop time = {end} / &output frames_every_time = 0.1 observables_every_time = 0.1 /
"""
STROKE = "motion = 'constant_velocity' velocity = -0.4"
#: Motions of the side and a later change, the motion after t = 0.5, and a change after it.
MOTIONS = [
    ("motion = 'sine' amplitude = 0.05 period = 0.3 phase = 0.1", "", "{same}", ""),
    ("motion = 'parabolic' amplitude = 0.05 period = 0.3 phase = 0.9", "", "{same}", ""),
    (f"{STROKE} position = 1.5 end_time = 0.7", "", f"{STROKE} {{at}} end_time = 0.2", ""),
    (f"{STROKE} position = 1.5 end_time = 0.44", "", "{at}", ""),
    (
        f"{STROKE} position = 1.5 start_time = 0.6 end_time = 1",
        "",
        f"{STROKE} {{at}} start_time = 0.1 end_time = 0.5",
        "",
    ),
    (
        "",
        "&change time = 0.43 set = 'side.right.motion=constant_velocity', "
        "'side.right.velocity=-0.4', 'side.right.end_time=0.8' /",
        f"{STROKE} {{at}} end_time = 0.3",
        "",
    ),
    (
        f"{STROKE} position = 1.5 end_time = 3",
        "&change time = 0.83 set = 'side.right.motion=still' /",
        f"{STROKE} {{at}} end_time = 2.5",
        "&change time = 0.33 set = 'side.right.motion=still' /",
    ),
]


@pytest.mark.parametrize(("side", "more", "side_then", "more_then"), MOTIONS)
def test_sides_move_in_a_window_as_in_a_run_that_starts_with_it(
    simulated, tmp_path, side, more, side_then, more_then
):
    start = "temperature = 1 region = 0, 1.4, 0, 1"
    whole = simulated(BESIDE.format(side=side, start=start, more=more, end=1.4))
    window, place = whole.window(0.5, 1.3), tmp_path / "start.txt"
    write_start(place, whole.position[5], whole.velocity[5])
    same = f"{side.partition('phase')[0]} phase = {window.sides[1].get('phase')}"
    then = {"side": side_then.format(same=same, at=f"position = {window.upper[0]}"), "end": 0.8}
    start = f"placement = 'file' file = '{place}'"
    again = simulated(BESIDE.format(**then, start=start, more=more_then), name="again")
    again = again.window(0, 0.8)
    close = {"rtol": 1e-7, "atol": 1e-9}
    np.testing.assert_allclose(window.position[:], again.position[:], **close)
    for own, other in zip(window.sides, again.sides, strict=True):
        assert rounded(own) == rounded(other)
    times = np.linspace(0, 0.7, 9 if more_then == "" else 8)
    for name in ("corners_at", "accessible_area"):
        found, expected = (getattr(one, name)(times) for one in (window, again))
        np.testing.assert_allclose(found, expected, **close, err_msg=name)
    np.testing.assert_allclose(window.bounds, again.bounds, **close)
    for name in {"virial_pressure", "work", "side_impulse"} & {*again.observables}:
        found, expected = (one.observable(name).value for one in (window, again))
        np.testing.assert_allclose(found, expected, **close, err_msg=name)
    assert window.nature == again.nature


def test_a_saved_simulation_has_the_laws_after_its_changes(tmp_path):
    """Its file contains them, together with all changes so far."""
    with Simulation(BOX.format(start="temperature = 1", end=2)) as box:
        box.advance(time=0.1).change({"contact.wall_restitution": 0.5, "box.gravity": [0, -1]})
        box.schedule(0.2, {"contact.restitution": 0.8})
        box.schedule(0.4, {"contact.restitution": 0.6})
        run = saved(box.advance(time=0.3), tmp_path / "box.h5")
    (window,) = run.windows()
    assert window.start == 0.2 and window.nature == run.window(0.3).nature
    for part in (window, run.window(0)):
        laws = part.parameters["contact"]
        assert [laws["restitution"], laws["wall_restitution"]] == [0.8, 0.5]
        assert part.gravity[1] == -1
        assert not part.changes and "changed" not in part.nature


def test_windows_without_frames_are_left_out_and_rounding_errors_of_times_ignored(simulated):
    text = BOX.replace("frames_every_time = 0.05", "frames_every_time = 0.7")
    text += "&change time = 1 set = 'contact.restitution=0.8' / "
    text += "&change time = 1.1 set = 'contact.restitution=0.7' /"
    text += "&change time = 2.1 set = 'contact.restitution=0.6' /"
    whole = simulated(text.format(start="temperature = 1", end=2.5))
    assert whole.time[3] < 2.1  # 3 times 0.7
    assert [part.restitution for part in whole.windows()] == [0.9, 0.7, 0.6]
    assert [len(part) for part in whole.windows()] == [2, 1, 2]
    late = whole.window(0.1).window(2.0)
    assert len(late) == 2 and late.time[0] == 0 and late.restitution == 0.6


def test_a_system_is_open_from_its_opening_until_all_disks_are_inside(simulated):
    changes = [f"&change time = {k} set = 'side.top.open={k == 1}' /" for k in (1, 2)]
    text = BOX.format(start="temperature = 1", end=3) + " ".join(changes)
    closed, opened, later = simulated(text).windows()
    assert ["open" in part.nature for part in (closed, opened, later)] == [False, True, True]
    assert np.all(closed.present[:]) and not np.all(later.present[0])
    assert package.analyse("speeds", closed).table[0]["N"] == 40
    with pytest.raises(RunError, match="open system"):
        package.analyse("speeds", later)


def test_tables_and_warnings_name_the_window(simulated):
    whole = simulated(CHANGED)
    table = package.analyse("energy", whole.windows()).table
    expected = [f"gas.h5 (t = {k} to {k + 1})" for k in (0, 1)] + ["gas.h5 (from t = 2)"]
    assert [row["run"] for row in table] == expected
    assert "the window from t = 1 to 2" in repr(whole.window(1, 2))
    provenance = whole.window(1, 2).provenance
    assert provenance["git_commit"] == whole.provenance["git_commit"]
    assert "wall_time" not in provenance


def test_haffs_law_begins_with_the_first_sample(gas):
    cadence = "frames_every_time = 0.1 observables_every_time = 0.1"
    unlike = "0.1 mass = 1 temperature = 2 / &species name = 'b' packing_fraction = 0.1 count = 32"
    for packing in (0.1, unlike):  # equal disks, and a mixture
        run = gas(cadence=cadence, restitution=0.9, length=30, helfand=".false.", packing=packing)
        each = [package.analyse("haff", run.window(start)) for start in (0.42, 0.5)]
        for name in ("table", "further", "data"):
            first, second = (str(getattr(one, name)) for one in each)
            numbers = [re.findall(r"[\d.]+(?:e-?\d+)?", text) for text in (first, second)]
            found, expected = (np.array(own, dtype=float) for own in numbers)
            np.testing.assert_allclose(found, expected, rtol=1e-9)
    with pytest.raises(RunError, match="has one sample"):
        package.analyse("haff", run.window(0.42, 0.51))
    with pytest.raises(RunError, match="no free paths"):
        package.analyse("rates", run.window(0.5, 0.5001)).figure()
    with pytest.raises(RunError, match="a part of the run"):
        package.analyse("cost", run.window(0.5))


def test_the_law_of_heights_needs_two_samples(simulated):
    run = simulated(
        "&box gravity = 0, -2 / &species count = 20 packing_fraction = 0.05 temperature = 1 / "
        "&stop time = 1 / &output frames_every_time = 0.1 observables_every_time = 0.1 /"
    )
    with pytest.raises(RunError, match="needs two samples"):
        package.analyse("gravity", run.window(0.5, 0.55)).figure()


def test_windows_of_one_run_have_a_structure_of_their_own(gas):
    run = gas(length=100)
    first, second = run.window(0, 0.5), run.window(0.5)
    each = [package.analyse("correlations", one, equilibration=0).table for one in (first, second)]
    both = package.analyse("correlations", [first, second], equilibration=0).table
    local = [table[0]["psi6_local"] for table in (*each, both)]
    assert local[2] == pytest.approx(np.mean(local[:2]))


#: Settings of which a test draws, for a system with two sides, an obstacle and gravity.
SETTINGS = [
    "contact.restitution=0.7",
    "contact.restitution=",
    "Contact.Restitution=0.85",
    "contact.wall_restitution=0.5",
    "contact.wall_restitution=",
    "contact.wall_rule=normal",
    "contact.tangential_restitution=0.2",
    "contact.wall_tangential_restitution=-0.5",
    "box.gravity=0, -1",
    "box.gravity(1)=1d-1",
    "box.gravity=2*0.5",
    "drive.kind='noise' drive.interval=0.1 drive.strength=0.2 drive.species=''",
    "obstacle.post.rule='normal'",
    "obstacle.post.rule=",
    "side.left.temperature=2",
    "side.left.temperature=",
    "side.right.restitution=0.6",
    "obstacle.post.temperature=3",
    "obstacle.post.restitution=0.4",
    "side.right.motion=constant_velocity side.right.velocity=0.01 side.right.end_time=50",
    "side.right.motion='still'",
    "side.top.surface_velocity=1",
    "box.gravity=",
    "contact.wall_rule=",
    "contact.friction=0.3",
    "contact.friction=",
    "contact.tangential_restitution=",
    "drive.kind= drive.interval= drive.strength= drive.species=",
    "drive.keep_momentum=false",
    "side.right.restitution=",
    "side.right.rule='normal'",
    "obstacle.post.temperature=",
]


@pytest.mark.parametrize("seed", range(12))
def test_changed_parameters_are_those_of_the_simulation(seed, tmp_path):
    """The engine keeps its own list of values, which a saved simulation contains."""
    rng = np.random.default_rng(seed)
    text = BOX.format(start="temperature = 1", end=1) + " &side name = 'left' restitution = 0.9 /"
    text += "&side name = 'right' / &side name = 'top' / ! wall_restitution = ..."
    rough = "restitution = 0.9 tangential_restitution = 0.5"
    with Simulation(text.replace("restitution = 0.9", rough, 1) if seed % 2 else text) as box:
        before = saved(box, tmp_path / "before.h5").parameters
        for k in range(8):
            box.advance(time=0.01 * (k + 1))
            chosen = str(rng.choice(SETTINGS)).replace(", ", ",").split(" ")
            try:
                box.change(dict(one.split("=", 1) for one in chosen))
            except package.ProgramError:
                continue  # such as rotation, which must be present from the start
        after = saved(box, tmp_path / "after.h5").parameters
    found = changed(before, changes_in(after.pop("changes", "")))
    for group in ("box", "contact", "drive"):
        assert known(found[group]) == known(after[group]), group
    for side in after["side"]:
        assert in_both(found["side"][side], after["side"][side])
    assert in_both(found["obstacle"], after["obstacle"])


def saved(box, path):
    """Return the saved state of a simulation as an unfinished run."""
    box.save(path)
    return read_run(f"{path}.part")


def test_a_new_motion_keeps_the_variables_that_it_shares_with_the_former_one(tmp_path):
    stroke = "motion = 'constant_velocity' velocity = -0.1 start_time = 2 end_time = 3"
    text = BOX.format(start="temperature = 1", end=1) + f" &side name = 'left' {stroke} / "
    text += "&side name = 'top' motion = 'sine' amplitude = 0.001 period = 1 phase = 0.25 /"
    with Simulation(text) as box:
        before = saved(box, tmp_path / "before.h5").parameters
        box.advance(time=0.5)
        box.change({"side.left.motion": "constant_velocity", "side.left.velocity": 0.2})
        box.change({"side.top.motion": "parabolic"})
        after = saved(box, tmp_path / "after.h5").parameters
    found = changed(before, changes_in(after["changes"]))["side"]
    assert known(found["top"]) == known(after["side"]["top"])
    after["side"]["left"].pop("position", None)
    assert known(found["left"]) == known(after["side"]["left"])


def test_the_area_in_the_pressure_is_that_of_the_program(simulated):
    """An oscillating side counts at its present position if another side moves permanently."""
    swing = "&side name = 'left' motion = 'sine' amplitude = 0.05 period = 0.3 /"
    start = "temperature = 1 region = 0.1, 1.4, 0, 1"
    side = f"{STROKE} position = 1.5 end_time = 0.6"
    whole = simulated(BESIDE.format(side=side, start=start, more=swing, end=1.4))
    for run in (whole, whole.window(0.2), whole.window(0.75)):
        time, pressure = run.observable("virial_pressure")
        area = run.accessible_area(time)
        assert np.ptp(area) > 0 or run.sides[1]["motion"] == "still"
        kinetic = run.n_disks * run.observable("all/kinetic_energy").value
        virial, passed = run.observable("virial").value[1:], time[1:] - time[0]
        np.testing.assert_allclose((pressure * area - kinetic)[1:], virial / (2 * passed))


def in_both(found, expected):
    """Return whether the values agree; a value that a new rule needs may be listed only once."""
    found, expected = known(found), known(expected)
    return all(found[name] == expected[name] for name in found.keys() & expected.keys())


def known(values):
    """Return nested values in a form that can be compared, without missing ones."""
    if isinstance(values, dict):
        own = {name: known(value) for name, value in values.items()}
        return {name: value for name, value in own.items() if value is not None}
    if isinstance(values, str | bool):
        return values
    numbers = [None if value != value else value for value in np.ravel(values).tolist()]
    return None if set(numbers) <= {None} else numbers


def rounded(values):
    """Return values of variables in a form that can be compared."""
    texts = {name: own for name, own in values.items() if isinstance(own, str)}
    return {name: np.round(own, 9) for name, own in values.items() if name not in texts} | texts


def test_defaults_are_those_of_the_program(ricochet):
    groups = json.loads(ricochet("--print-variables").stdout)
    known_here = {name: value for own in DEFAULTS_OF.values() for name, value in own.items()}
    for group, variables in groups.items():
        own = DEFAULTS.get(group, {})
        for name, variable in variables.items():
            if variable["changeable"] and variable["default"] is not None:
                found = own[name] if name in own else known_here[name]
                assert np.ravel(found).tolist() == np.ravel(variable["default"]).tolist(), name
    motions = {name: set() for name in groups["side"]["motion"]["choices"]}
    for name, variable in groups["side"].items():
        for motion in variable["goes_with"].get("motion", []) if variable["changeable"] else []:
            motions[motion].add(name)
    assert motions == OF_MOTIONS


def test_values_are_read_as_in_an_input():
    assert [value_of(text) for text in (".true.", "F", "'a, b'", "noise", "")] == [
        True,
        False,
        "a, b",
        "noise",
        None,
    ]
    assert value_of(" 1d-3") == 1e-3
    assert value_of("2*0.5, 1").tolist() == [0.5, 0.5, 1]


def test_scripts_and_analyses_take_a_window(simulated, tmp_path, capsys):
    run = simulated(CHANGED)

    def code_and_text(*options):
        code = run_script("energy", run.path, "-o", tmp_path / "energy.png", *options)
        return code, "".join(capsys.readouterr())

    code, text = code_and_text("--times", "1:2")
    assert code == 0 and code_and_text()[1] != text
    direct = package.analyse("energy", run.window(1, 2)).table
    assert package.analyse("energy", run, times="1:2").table == direct
    wrong = {"5": "is not a window", "7:3": "no window begins", "9:": "only from 0 to 3"}
    for text, problem in wrong.items():
        code, told = code_and_text("--times", text)
        assert code == 2 and problem in told
    with pytest.raises(RunError, match="no frame"):
        read_run(run.path).window(3.5)
    with pytest.raises(ValueError, match="not a window of time"):
        package.analyse("energy", run, times="5")
    assert package.analyse("energy", run, times=None).table[0]["run"] == run.label
    part, other = run.window(1, 2), run.window(1, 2)
    assert part == part != other and {part, part} == {part}
