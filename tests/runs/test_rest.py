"""Disks that come to rest: the stop condition `stop.at_rest`, and messages if time stops."""

import re
from math import pi, sqrt, tan
from pathlib import Path

import numpy as np
import pytest
from ricochet import ProgramError, Simulation, read_run

from whole_runs import BROKEN, FINISHED, STOPPED, USAGE, differences, one_line, write_input

INPUTS = Path(__file__).resolve().parents[2] / "input"
BALL = """&box gravity = 0, -2 upper = 1, 3 /
&species name = 'ball' radius = 0.1 position = 0.5, {height} velocity = 0, 0 /
&contact wall_restitution = {restitution} {more} /
&stop at_rest = .true. /
&output frames_every_time = 0.25 event_log = .true. /
"""
COMMAND = ["gas.nml", "-o", "gas.h5"]


@pytest.mark.parametrize("restitution", [0, 0.1, 0.5, 0.9, 0.98])
@pytest.mark.parametrize("rule", ["", "wall_rule = 'normal'"])
def test_a_ball_comes_to_rest_when_its_bounces_have_ended(ricochet, tmp_path, restitution, rule):
    """The geometric series of its bounces predicts the time at which the ball comes to rest."""
    write_input(tmp_path, BALL.format(height=2, restitution=restitution, more=rule))
    run = ricochet(*COMMAND)
    assert run.returncode == FINISHED and "note" not in run.stderr + run.stdout
    fall = sqrt(2 * (2 - 0.1) / 2)
    end = fall * (1 + restitution) / (1 - restitution)
    found = read_run(tmp_path / "gas.h5")
    assert found.time[-1] == pytest.approx(end, rel=1e-8)
    assert found.position[-1] == pytest.approx(np.array([[0.5, 0.1]]), abs=1e-12)
    assert found.observable("total_energy").value[-1] == pytest.approx(2 * 0.1)
    assert "collapsed" not in found.nature
    again = ricochet(*COMMAND, "--resume")
    assert "is a finished run" in one_line(again)


def test_a_run_that_comes_to_rest_ends_alike_in_all_ways(ricochet, tmp_path):
    """The end is the same in parts, with another search and event queue, and in memory."""
    write_input(tmp_path, BALL.format(height=2, restitution=0.7, more=""))
    assert ricochet(*COMMAND).returncode == FINISHED
    other = ["--set=run.search='pairs'", "--set=run.queue='heap'", "--set=run.threads=2"]
    assert ricochet("gas.nml", "-o", "other.h5", *other).returncode == FINISHED
    aside = re.compile("/parameters/(run|overrides)|/checkpoint")
    different = differences(tmp_path / "gas.h5", tmp_path / "other.h5")
    assert [name for name in different if not aside.match(name)] == []
    command = ["gas.nml", "-o", "parts.h5", "--set=stop.wall_clock=1e-9"]
    assert ricochet(*command).returncode == STOPPED
    while ricochet(*command, "--resume").returncode == STOPPED:
        pass
    different = differences(tmp_path / "gas.h5", tmp_path / "parts.h5")
    assert [name for name in different if not aside.match(name)] == ["/parameters/stop@wall_clock"]
    whole = read_run(tmp_path / "gas.h5")
    for slices in ((), (0.5, 1, 1.5, 100)):
        ball = Simulation(tmp_path / "gas.nml")
        for time in slices:
            ball.advance(time=time)
        ball.advance()
        assert ball.time == whole.time[-1]
        assert np.array_equal(ball.position, whole.position[-1])


PAIR = """&box gravity = 0, -1 upper = 2, 2 /
&species name = 'ball' radius = 0.1 position = 0.5, 1, 1.5, {height} velocity = 0, 0, 0, 0 /
&contact restitution = 0.5 / &stop at_rest = .true. /
"""


def test_a_disk_that_rests_while_another_moves_breaks_the_run_off(ricochet, tmp_path):
    """If one disk comes to rest while another moves, the run aborts with a message."""
    write_input(tmp_path, PAIR.format(height=1.3))
    run = ricochet(*COMMAND)
    assert run.returncode == BROKEN and "disk 1 (ball) and the bottom side" in one_line(run)
    assert "stop.at_rest" not in run.stderr
    write_input(tmp_path, PAIR.format(height=1))
    run = ricochet(*COMMAND, "--force")
    assert run.returncode == FINISHED and "note" not in run.stdout


@pytest.mark.parametrize("rest", [".true.", ".false."])
def test_a_disk_that_rests_beside_a_moving_one_ends_a_run_alike_whatever_stops_it(
    ricochet, tmp_path, rest
):
    """The last event yields the message of the last time; a disk that still bounces yields none."""
    write_input(tmp_path, PAIR.format(height=1.3))
    at_rest = f"--set=stop.at_rest={rest}"
    by_time = ricochet(*COMMAND, at_rest, "--set=stop.time=9")
    by_events = ricochet(*COMMAND, at_rest, "--set=stop.events=200", "--force")
    said = by_events.stderr.splitlines()[-1]
    assert by_events.returncode == BROKEN and "disk 1 (ball) and the bottom side" in said
    assert by_time.returncode == BROKEN and said.split(" at ")[0] in by_time.stderr
    run = ricochet(*COMMAND, at_rest, "--set=stop.events=20", "--force")
    assert run.returncode == FINISHED and "note" not in run.stdout
    pair = Simulation(tmp_path / "gas.nml", {"stop.at_rest": False, "stop.events": 1000})
    pair.advance(events=20)
    with pytest.raises(ProgramError, match="time no longer advances"):
        pair.advance(events=180)


def test_the_next_collision_of_a_falling_row_is_with_a_disk_and_not_with_a_side(program, tmp_path):
    """A run ends between collisions that take no time. A library with run-time checks is used."""
    write_input(
        tmp_path,
        """&box lower = -9, -9 upper = 9, 9 gravity = 0, -1e-3 /
        &species count = 3 radius = 0.1 position = -1, 0, 0.1, 0, 1.3, 0
          velocity = 1, 0, 0, 0, -1, 0 /
        &contact restitution = 0.02 / &stop events = 100 /""",
    )
    row = Simulation(tmp_path / "gas.nml")
    for events in range(1, 31):
        row.advance(events=events)
        assert row.events == events


def test_without_gravity_disks_are_at_rest_when_none_moves(ricochet, tmp_path):
    write_input(
        tmp_path,
        """&species radius = 0.1 position = 0.3, 0.3, 0.7, 0.7 velocity = 1, 0.1, -0.5, 0.2 /
        &contact wall_restitution = 0 / &stop at_rest = .true. /""",
    )
    run = ricochet(*COMMAND)
    assert run.returncode == FINISHED and "note" not in run.stdout
    assert "\ntime = 1\n" in run.stdout and "\nkinetic_energy = 0\n" in run.stdout


@pytest.mark.parametrize(
    "more", ["stop.time=9", "stop.events=9", "output.frames_every_time=0.4", "run.threads=2"]
)
def test_without_gravity_the_run_ends_with_the_last_collision_whatever_else_is_due(
    ricochet, tmp_path, more
):
    """The disk reaches the right side at x = 0.9 after 0.75, and stops there."""
    write_input(
        tmp_path,
        """&species radius = 0.1 position = 0.15, 0.5 velocity = 1, 0 /
        &contact wall_restitution = 0 / &stop at_rest = .true. /""",
    )
    run = ricochet(*COMMAND, f"--set={more}")
    assert run.returncode == FINISHED and "\ntime = 0.75\n" in run.stdout
    disk = Simulation(tmp_path / "gas.nml").advance(time=0.5).advance(time=9)
    assert disk.time == 0.75


@pytest.mark.parametrize("more", ["stop.time=99", "run.seed=1"])
def test_a_run_with_a_source_comes_to_rest_when_its_last_disk_has(ricochet, tmp_path, more):
    """Each disk stops at the first wall that it touches. No disk enters after three."""
    write_input(
        tmp_path,
        """&box upper = 10, 10 / &species radius = 0.1 count = 3 waiting = 3 /
        &source region = 1, 9, 1, 9 interval = 1 velocity = 1, 0.5 /
        &contact wall_restitution = 0 restitution = 0 / &stop at_rest = .true. /""",
    )
    run = ricochet(*COMMAND, f"--set={more}")
    assert run.returncode == FINISHED
    assert "\nside_collisions = 3\n" in run.stdout and "\nkinetic_energy = 0\n" in run.stdout
    assert read_run(tmp_path / "gas.h5").time[-1] < 3 + 8.9  # entry of the last, way to the wall


def test_at_rest_is_no_rule_where_it_is_false(ricochet, tmp_path):
    write_input(tmp_path, BALL.format(height=2, restitution=0.5, more=""))
    run = ricochet(*COMMAND, "--set=stop.at_rest=.false.")
    assert run.returncode == USAGE and "no rule ends the run" in one_line(run)


@pytest.mark.parametrize("seed", range(1, 4))
def test_a_ball_ends_in_a_bin_of_the_galton_board(ricochet, tmp_path, seed):
    path = tmp_path / "galton.h5"
    run = ricochet(INPUTS / "galton.nml", "-o", path, f"--set=run.seed={seed}")
    assert run.returncode == FINISHED and "note" not in run.stdout
    x, y = read_run(path).position[-1, 0]
    assert y == pytest.approx(0.2, abs=1e-9) and 0.2 - 1e-9 <= x % 1 <= 0.8 + 1e-9


RING = """&box lower = -1, -1 upper = 1, 1 /
&obstacle name = 'ring' centre = 0, 0 radius = 1 side = 'inside' /
&species name = 'p' radius = 0.1 position = 0.9, 0 velocity = {} / &stop time = 10 /
&contact restitution = {} {} /
"""


@pytest.mark.parametrize("velocity", ["0, 1", "1e-9, 1", "0, -1e-5"])
@pytest.mark.parametrize("contact_time", ["", "contact_time = 1e-6", "contact_time = 1e-2"])
def test_sliding_along_a_ring_is_named(ricochet, tmp_path, velocity, contact_time):
    """The message names the sliding along a ring, which is not an inelastic collapse."""
    write_input(tmp_path, RING.format(velocity, 1, contact_time))
    run = ricochet(*COMMAND, "--quiet")
    assert run.returncode == BROKEN and "slides along a concave obstacle" in one_line(run)
    assert "disk 1 (p) and obstacle ring" in run.stderr
    assert "collapse" not in run.stderr and "contact_time" not in run.stderr


#: Systems with an inelastic collapse: a bouncing ball, two balls on top of each other, a row of
#: disks that is struck, and a row pressed against a container.
COLLAPSES = {
    "ball": PAIR.replace("1.5, {height}", "1.5, 0.7").replace("at_rest = .true.", "time = 9"),
    "tower": """&box gravity = 0, -1 / &contact restitution = 0.6 / &stop time = 9 /
        &species radius = 0.1 position = 0.5, 0.2, 0.5, 0.6 velocity = 0, 0, 0, 0 /""",
    "row": f"""&box upper = 2, 1 / &contact restitution = {0.95 * tan(pi / 8) ** 2} /
        &stop time = 9 / &species radius = 0.0625
        position = 0.25, 0.5, 0.75, 0.5, 0.875, 0.5, 1, 0.5
        velocity = 1, 0, 0, 0, 0, 0, 0, 0 /""",
    "at once": f"""&box upper = 2, 1 / &contact restitution = {0.5 * tan(pi / 8) ** 2} /
        &stop time = 9 / &species radius = 0.0625
        position = 0.625, 0.5, 0.75, 0.5, 0.875, 0.5, 1, 0.5
        velocity = 1, 0, 0, 0, 0, 0, 0, 0 /""",
    "ring": RING.format("0.5, 1", "0.3 wall_rule = 'normal'", ""),
}


@pytest.mark.parametrize(
    ("name", "contact_time"),
    [*((name, 0) for name in COLLAPSES), ("ball", 1e-30), ("tower", 1e-30), ("ring", 1e-30)],
)
def test_the_contact_time_that_is_proposed_prevents_the_collapse(
    ricochet, tmp_path, name, contact_time
):
    write_input(tmp_path, COLLAPSES[name])
    run = ricochet(*COMMAND, f"--set=contact.contact_time={contact_time}")
    assert "collapse" in run.stderr
    word = "raise" if contact_time else "set"
    said = re.search(
        rf"; {word} contact.contact_time \(TC model\), for example to ([^,]+),", run.stderr
    )
    run = ricochet(*COMMAND, "--force", f"--set=contact.contact_time={said[1]}")
    assert run.returncode == FINISHED and "collapse" not in run.stderr + run.stdout


@pytest.mark.parametrize("stop", ["events=5000", "events=250", "time=9"])
def test_disks_at_rest_end_a_run_alike_whatever_stops_it(ricochet, tmp_path, stop):
    """A ball at rest ends the run with the same message, even in memory."""
    write_input(tmp_path, BALL.format(height=2, restitution=0.5, more=""))
    run = ricochet(*COMMAND, "--set=stop.at_rest=.false.", f"--set=stop.{stop}")
    assert run.returncode == BROKEN and "disk 1 (ball) and the bottom side" in one_line(run)
    ball = Simulation(tmp_path / "gas.nml", {"stop.at_rest": False, "stop.events": 5000})
    with pytest.raises(ProgramError, match="time no longer advances"):
        ball.advance(events=300)


@pytest.mark.parametrize("text", [BALL.format(height=2, restitution=0.5, more=""), PAIR])
def test_a_simulation_loaded_at_its_limit_says_the_same(tmp_path, text):
    """It executes no event, so that the report must follow from the state alone."""
    path, events, said = tmp_path / "ball.h5", 0, None
    ball = Simulation(text.format(height=1.3).replace("at_rest = .true.", "events = 999"))
    while said is None:
        events += 1
        try:
            ball.advance(events=events)
        except ProgramError as error:
            said = str(error)
    assert ball.events == events
    ball.save(path)
    with pytest.raises(ProgramError) as again:
        Simulation.load(path).advance(events=events)
    assert str(again.value) == said and "disk 1 (ball) and the bottom side" in said


@pytest.mark.parametrize("threads", [1, 2])
def test_a_disk_that_has_just_bounced_does_not_rest_on_another_side(tmp_path, threads):
    """The limit is the bounce of a disk that falls straight to the floor, far from other sides."""
    disks = {"count": 2600, "packing_fraction": 0.1, "placement": "random", "velocity": [0, -1]}
    law = {"wall_restitution": 0.5}
    gas = Simulation({"species": disks, "box": {"gravity": [0, -1]}, "contact": law})
    gas.advance(events=1).save(tmp_path / "gas.h5")
    loaded = Simulation.load(tmp_path / "gas.h5", threads=threads).advance(events=1)
    assert np.array_equal(loaded.advance(events=9).position, gas.advance(events=9).position)


def test_bounces_lower_than_the_spacing_of_the_coordinates_are_rest(ricochet, tmp_path):
    """In a symmetric corner, rounding errors would make a disk bounce endlessly."""
    write_input(
        tmp_path,
        """&box gravity = 0, -1 / &wall points = 0.3, 0.7, 0.5, 0.5, 0.7, 0.7 /
        &species radius = 0.0625 position = 0.5, 0.7 velocity = 0, 0 /
        &contact restitution = 0.5 / &stop at_rest = .true. events = 20000 /""",
    )
    run = ricochet(*COMMAND)
    hits = int(re.search(r"obstacle_collisions = (\d+)", run.stdout)[1])
    assert run.returncode == FINISHED and hits < 20000
    run = ricochet(*COMMAND, "--force", "--set=stop.at_rest=.false.", "--set=stop.time=9")
    assert run.returncode == BROKEN and "time no longer advances" in one_line(run)
