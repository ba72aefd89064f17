"""Arcs: obstacles that are parts of circles, compared with whole circles and with exact paths."""

from math import pi
from pathlib import Path

import h5py
import matplotlib.pyplot as plt
import numpy as np
import pytest

from ricochet.figures.film_data import scene
from ricochet import Simulation, read_run
from ricochet.analysis.fields import accessible
from ricochet.drawing import draw_box

from whole_runs import FINISHED, USAGE, ran, write_input

INPUTS = Path(__file__).resolve().parents[2] / "input"
CIRCLE = "&obstacle name = 'ring' centre = 0.5, 0.5 radius = 0.45"
START = (
    "placement = 'grid' grid = 4, 3 region = 0.3, 0.7, 0.3, 0.7 velocities = 'uniform' speed = 2"
)
LAWS = {
    "elastic": "",
    "inelastic, normal": " restitution = 0.7 rule = 'normal'",
    "rough, sliding": " rule = 'normal' tangential_restitution = 0.5 surface_velocity = 1.5",
    "thermal, sliding": " temperature = 2 surface_velocity = -1",
}


def ring(kind: str, law: str, more: str = "", box: str = "") -> str:
    """Return disks in or around a ring, which is a whole circle or an arc of 360 degrees."""
    return f"""&run seed = 3 {more} /
&box {box} /
{CIRCLE}{kind}{law} /
&species count = 12 radius = 0.03 {START} /
&stop time = 3 /"""


@pytest.mark.parametrize("name", ["stadium", "mushroom"])
def test_random_starts_lie_inside_the_billiard(name):
    """Disks starting at random positions of the input never reach the left and right sides."""
    random = {"position": None, "velocity": None, "count": 1, "speed": 1}
    for seed in range(1, 21):
        own = {"run": {"seed": seed}, "species": {"disk": random}}
        with Simulation(INPUTS / f"{name}.nml", overrides=own) as billiard:
            billiard.advance(events=100)
            assert not np.any(billiard.observable("side_collisions")[:2])


@pytest.mark.parametrize(
    ("law", "more", "box"),
    [
        ("elastic", "", ""),
        ("inelastic, normal", "", "gravity = 0.3, -1"),
        ("rough, sliding", "", ""),
        ("rough, sliding", "dynamics = 'steps' dt = 1e-4", "gravity = 0, -1"),
        ("thermal, sliding", "", "gravity = 0.3, -1"),
    ],
)
def test_a_closed_arc_is_a_container(law, more, box):
    """In an arc of 360 degrees disks move as in a circle with side = 'inside', up to rounding."""
    whole, arc = (
        Simulation(ring(kind, LAWS[law], more, box))
        for kind in (" side = 'inside'", " from_angle = -70 to_angle = 290")
    )
    with whole, arc:
        for time in (0.1, 0.3, 0.5):
            assert np.allclose(whole.advance(time=time).position, arc.advance(time=time).position)
        assert whole.observable("obstacle_collisions") >= 5
        assert whole.observable("obstacle_collisions") == arc.observable("obstacle_collisions")
        spins = [run.angular_velocity for run in (whole, arc) if law.startswith("rough")]
        assert not spins or (np.allclose(*spins) and np.any(spins[0]))


@pytest.mark.parametrize(
    ("law", "box"),
    [*zip(LAWS, ["boundary = 'periodic', 'periodic'", "gravity = 0, -1"] * 2, strict=True)],
)
def test_a_closed_arc_is_a_peg(law, box):
    """Disks bounce off the outside of an arc of 360 degrees as off a circle, up to rounding."""
    runs = []
    for kind in ("", " from_angle = 200 to_angle = 560"):
        text = ring(kind, LAWS[law], box=box).replace("radius = 0.45", "radius = 0.2")
        runs.append(Simulation(text.replace(START, towards_the_middle())))
    whole, arc = runs
    with whole, arc:
        for time in (0.1, 0.2, 0.3):
            assert np.allclose(whole.advance(time=time).position, arc.advance(time=time).position)
        assert whole.observable("obstacle_collisions") >= 12
        assert whole.observable("obstacle_collisions") == arc.observable("obstacle_collisions")


def towards_the_middle() -> str:
    """Return positions of 12 disks on a circle, with velocities roughly towards its centre."""
    angles = np.arange(12) * pi / 6
    places = 0.35 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    velocities = -3 * places + np.random.default_rng(2).uniform(-0.3, 0.3, places.shape)
    texts = (", ".join(map(repr, part.ravel().tolist())) for part in (0.5 + places, velocities))
    return "position = {} velocity = {}".format(*texts)


def test_a_regular_path_in_a_mushroom_stays_in_the_cap():
    """The angular momentum is conserved; it is 0.552, more than half the width of the stem."""
    with Simulation(INPUTS / "mushroom.nml") as run:
        found = []
        for events in range(100, 2001, 100):
            x, v = run.advance(events=events).position[0] - (0, 0.01), run.velocity[0]
            found.append(abs(x[0] * v[1] - x[1] * v[0]))
            assert x[1] > -1e-9
        assert np.ptp(found) < 1e-12 and found[0] == pytest.approx(0.8 * 0.69)


def test_a_belt_on_an_arc_moves_counter_clockwise_on_both_faces():
    """A rough disk, initially at rest relative to the floor, is driven along the belt of an arc."""
    for y, way in ((0.44, 1), (0.56, -1)):  # under the arc at the bottom, and above it
        text = f"""&box upper = 1, 2 /
&obstacle centre = 0.5, 1 radius = 0.5 from_angle = 250 to_angle = 290
  rule = 'normal' tangential_restitution = 0 surface_velocity = 1 /
&species radius = 0.05 position = 0.5, {y} velocity = 0, {-1 if y > 0.5 else 1} /
&stop events = 1 /"""
        with Simulation(text) as run:
            assert run.advance(events=1).velocity[0, 0] > 0.1
            assert run.angular_velocity[0] * way < 0


FILE = "x y radius\n0.2 0.3 0.1\n0.7 0.6 0.15\n"
AFTER = """&species count = 5 radius = 0.02 speed = 1 /
&stop events = 300 /
&output event_log = .true. frames_every_events = 20 /"""


def test_arcs_of_a_file_are_met_as_if_each_had_a_group(program, tmp_path):
    (tmp_path / "cups.txt").write_text(FILE)
    angles = "from_angle = 180 to_angle = 360 /"
    single = [f"&obstacle centre = {x}, {y} radius = {r} {angles}" for x, y, r in
              (line.split() for line in FILE.splitlines()[1:])]  # fmt: skip
    circle = "&obstacle name = 'peg' centre = 0.5, 0.9 radius = 0.05 /"
    for name, groups in (
        ("many", [circle, f"&obstacle name = 'cups' file = 'cups.txt' {angles}"]),
        ("single", [circle, *single]),
    ):
        write_input(tmp_path, "\n".join([*groups, AFTER]), f"{name}.nml")
        done = ran(program, f"{name}.nml", "-o", f"{name}.h5", cwd=tmp_path)
        assert done.returncode == FINISHED
    with h5py.File(tmp_path / "many.h5") as many, h5py.File(tmp_path / "single.h5") as one:
        for name in ("particles/disks/position/value", "events/j", "events/impulse"):
            assert np.array_equal(many[name][()], one[name][()])
        assert many["events/j"][()].min() == -6
    many, one = (read_run(tmp_path / f"{name}.h5") for name in ("many", "single"))
    for run in (many, one):
        assert [o.is_arc for o in run.obstacles] == [False, True, True]
        assert run.obstacles[2].from_angle == 180 and run.obstacles[2].to_angle == 360
        assert run.accessible_area(0.0) == pytest.approx(1 - pi * 0.05**2)
        axes = plt.figure().subplots()
        draw_box(axes, run)
        plt.close()
        assert scene(run)[0]["obstacles"][1:] == [
            [0.2, 0.3, 0.1, False, 180, 360], [0.7, 0.6, 0.15, False, 180, 360],
        ]  # fmt: skip
    with Simulation(tmp_path / "single.nml") as running:
        assert np.isnan(running.parameters["obstacle"]["from_angle"][0])


def test_the_area_beside_an_arc_is_not_accessible(program, tmp_path):
    """Disk centres cannot reach a ring sector with round ends."""
    text = """&obstacle centre = 0.5, 0.5 radius = 0.3 from_angle = 20 to_angle = 200 /
&species radius = 0.05 position = 0.5, 0.2 velocity = 0, 1 /
&stop events = 5 /"""
    ran(program, write_input(tmp_path, text), "-o", tmp_path / "a.h5", check=True)
    area = accessible(read_run(tmp_path / "a.h5"), (1, 1), 0.05)
    assert area[0] == pytest.approx(0.81 - pi * 0.3 * 0.1 - pi * 0.05**2, rel=5e-3)


def test_disks_that_overlap_an_arc_are_refused(program, tmp_path):
    arc = "&obstacle name = 'cup' centre = 0.5, 0.5 radius = 0.3 from_angle = 180 to_angle = 360 /"
    places = {
        (0.5, 0.7): True,
        (0.5, 0.26): True,
        (0.5, 0.24): False,
        (0.5, 0.16): False,
        (0.2, 0.54): False,
        (0.2, 0.56): True,
    }
    for place, fits in places.items():
        text = f"{arc} &species radius = 0.05 position = {place[0]}, {place[1]} velocity = 1, 0 /"
        path = write_input(tmp_path, f"{text} &stop time = 1 /")
        done = ran(program, path, "--check")
        assert done.returncode == (FINISHED if fits else USAGE)
        assert fits or 'overlaps obstacle "cup"' in done.stderr


@pytest.mark.parametrize("group", ["obstacle", "wall", "species", "side"])
def test_too_many_groups_are_refused_in_one_line(program, tmp_path, group):
    path = write_input(tmp_path, f"&{group} name = 'left' /\n" * 5001 + "&stop time = 1 /")
    done = ran(program, path, "--check", "--set", "run.seed=many")
    assert done.returncode == USAGE
    assert len(done.stderr.splitlines()) == 1
    assert f":5001: {group}: more than 5000 groups of this name" in done.stderr


@pytest.mark.parametrize("angles", [{"from_angle": 17, "to_angle": 287}, {"side": "inside"}])
def test_a_disk_that_loses_its_normal_velocity_stays_inside(angles):
    """A disk moving along a concave face collides again at once and does not pass the face."""
    rng = np.random.default_rng(1)
    bowl = {"centre": [0.5, 0.5], "radius": 0.4, "restitution": 0, "rule": "normal"} | angles
    for _ in range(300):
        angle, speeds = rng.uniform(0.5, 4.5), rng.uniform(-1, 1, 2)
        out = np.array([np.cos(angle), np.sin(angle)])
        velocity = abs(speeds[0]) * out + 0.3 * speeds[1] * out[::-1] * [-1, 1]
        disk = {"radius": 0.01, "position": [*(0.5 + 0.3 * out)], "velocity": [*velocity]}
        box = Simulation({"obstacle": bowl, "species": disk}).advance(events=1)
        assert box.next_events(1)[0][0] - box.time < 1e-6 / np.hypot(*box.velocity[0])
