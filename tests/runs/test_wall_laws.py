"""Sides, obstacles and straight walls with laws of their own, and what happens at each of them."""

import h5py
import numpy as np
import pytest

from whole_runs import FINISHED, contents, differences, one_line, write_input

SYSTEM = """&box upper = 2, 1 boundary = 'wall', 'wall' /
&side name = 'left' restitution = 0.5 /
&side name = 'top' restitution = 0.9 rule = 'normal' /
&obstacle name = 'post' centre = 1, 0.4 radius = 0.15 rule = 'normal' restitution = 0.2 /
&obstacle centre = 0.3, 0.3 radius = 0.05 /
&wall name = 'ramp' from = 1.4, 0.2 to = 1.8, 0.4 restitution = 0 /
&contact restitution = 0.98 wall_restitution = 0.97 contact_time = 1e-5 /
&species name = 'a' count = 3000 radius = 0.005 temperature = 1 /
&species name = 'b' count = 300 radius = 0.01 mass = 4 temperature = 1 /
&stop collisions = 20000 / &output observables_every_collisions = 5000 event_log = .true. /
"""
WALLS = ["sides/" + side for side in ("left", "right", "bottom", "top")]
OBSTACLES = ["walls/" + name for name in ("post", "obstacle2", "ramp")]


def at_walls(found: dict, what: str) -> dict[str, np.ndarray]:
    return {name: found[f"/observables/{name}/{what}/value"] for name in WALLS + OBSTACLES}


@pytest.fixture
def finished(ricochet, tmp_path):
    write_input(tmp_path, SYSTEM)
    assert ricochet("gas.nml", "-o", "plain.h5").returncode == FINISHED
    return contents(tmp_path / "plain.h5")


def test_walls_receive_what_disks_lose(finished):
    """Momentum, energy and counts add up, wall by wall."""
    momentum = finished["/observables/momentum/value"]
    received = sum(at_walls(finished, "impulse").values())
    assert received[0].tolist() == [0, 0]
    assert momentum + received == pytest.approx(np.tile(momentum[0], (len(momentum), 1)), abs=1e-9)
    hits = at_walls(finished, "collisions")
    by_side = np.transpose([hits[name] for name in WALLS])
    assert (by_side == finished["/observables/wall_collisions/value"]).all()
    at_obstacles = sum(hits[name] for name in OBSTACLES)
    assert (at_obstacles == finished["/observables/obstacle_collisions/value"]).all()
    assert all(hits[name][-1] > 0 for name in hits)
    code = finished["/events/j"]
    assert [np.sum(code == -k) for k in range(7)] == [hits[name][-1] for name in hits]
    energy = at_walls(finished, "energy")
    assert all((values <= 0).all() for values in energy.values())
    lost = finished["/observables/dissipated_energy/value"][-1]
    assert 0 < -sum(values[-1] for values in energy.values()) < lost
    assert energy["sides/left"][-1] < energy["sides/right"][-1]


def test_impulse_on_a_side_is_that_of_the_old_observable(finished):
    impulse, old = at_walls(finished, "impulse"), finished["/observables/wall_impulse/value"]
    for k, (side, axis) in enumerate(zip(WALLS, (0, 0, 1, 1), strict=True)):
        assert (abs(impulse[side][:, axis]) == old[:, k]).all()


@pytest.mark.parametrize(
    "options", [["run.threads=2"], ["run.search='pairs'"], ["run.queue='heap'"]]
)
def test_laws_of_walls_leave_no_trace_of_the_method(finished, ricochet, tmp_path, options):
    run = ricochet("gas.nml", "-o", "other.h5", *(f"--set={option}" for option in options))
    assert run.returncode == FINISHED
    found = differences(tmp_path / "plain.h5", tmp_path / "other.h5")
    assert [name for name in found if not name.startswith("/parameters")] == []


def test_a_run_goes_on_with_its_walls(finished, ricochet, tmp_path):
    ricochet("gas.nml", "-o", "other.h5", "--set=stop.collisions=9000")
    assert ricochet("gas.nml", "-o", "other.h5", "--resume").returncode == FINISHED
    found = differences(tmp_path / "plain.h5", tmp_path / "other.h5")
    assert [name for name in found if not name.startswith("/parameters")] == []


def test_a_disk_between_two_walls_knows_them_apart(ricochet, tmp_path):
    """It leaves the left wall with half its speed, the right one with all, the ramp with none."""
    write_input(
        tmp_path,
        """&side name = 'left' restitution = 0.5 / &species count = 1 radius = 0.1
        position = 0.5, 0.5 velocity = 1, 0 / &stop time = 6 / &output frames_every_events = 1 /""",
    )
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    with h5py.File(tmp_path / "gas.h5") as file:
        v = file["particles/disks/velocity/value"][:, 0, 0]
        assert v[:5].tolist() == [1, -1, 0.5, -0.5, 0.25]
        assert file["observables/sides/left/energy/value"][-1] == (v[-1] ** 2 - 1) / 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("&side restitution = 1 /", "side.name: is missing"),
        ("&side name = 'middle' /", "'left', 'right', 'bottom' or 'top'"),
        ("&side name = 'top' / &side name = 'top' /", '"top" is already that of line 1'),
        ("&side name = 'left' / &box boundary = 'periodic', 'wall' /", "is periodic"),
        ("&side name = 'left' restitution = 2 /", "from 0 to 1"),
        ("&side name = 'left' rule = 'rough' /", "'velocity' or 'normal'"),
        ("&wall from = 0, 0 to = 1, 1 rule = 'none' /", "'velocity' or 'normal'"),
        ("&species name = 'sides' count = 1 radius = 0.1 /", "is reserved"),
    ],
)
def test_a_law_that_cannot_be_is_refused_in_a_line(ricochet, tmp_path, text, said):
    write_input(tmp_path, f"{text} &species count = 1 radius = 0.01 speed = 1 / &stop time = 1 /")
    run = ricochet("gas.nml", "--check")
    assert run.returncode == 2
    assert said in one_line(run)


@pytest.mark.parametrize(
    "law",
    ["restitution = 0", "temperature = 9 speed = 5", "tangential_restitution = 0.5 friction = 1"],
)
def test_disks_grow_between_walls_whatever_their_law(ricochet, tmp_path, law):
    """The places of `dense` disks are those between elastic walls."""
    for name, words in ("elastic", ""), ("other", law):
        write_input(
            tmp_path,
            f"&obstacle centre = 0.5, 0.5 radius = 0.2 {words} /"
            f"&wall from = 0.1, 0.9 to = 0.9, 0.9 {words} /"
            "&contact wall_rule = 'normal' /"
            "&species count = 40 packing_fraction = 0.4 placement = 'dense' temperature = 1 /"
            "&stop collisions = 1 / &output frames_every_collisions = 1 /",
        )
        assert ricochet("gas.nml", "-o", f"{name}.h5").returncode == FINISHED
    places = [
        contents(tmp_path / f"{name}.h5")["/particles/disks/position/value"][0]
        for name in ("elastic", "other")
    ]
    assert (places[0] == places[1]).all()
