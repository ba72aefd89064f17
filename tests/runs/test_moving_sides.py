"""Sides that move, and walls with laws of their own: what no random system shows.

That they leave no trace of how a run was done, what they do to the energy, and that no disk gets
through them, is asserted of all systems (test_random_systems.py); orbits are in the validation.
"""

import numpy as np
import pytest

from whole_runs import BROKEN, FINISHED, contents, one_line, write_input

BOUNCE = """&box gravity = 0, -1 upper = 1, 1000 /
&side name = 'bottom' motion = 'sine' amplitude = 0.03 period = 1 restitution = 0.8 /
&species count = 1 radius = 0.1 position = 0.5, 0.7 /
&stop events = 8 / &output frames_every_events = 1 /
"""


def observed(ricochet, folder, text: str, *options: str) -> dict[str, np.ndarray]:
    """All that the run of an input says."""
    write_input(folder, text)
    run = ricochet("gas.nml", "-o", "gas.h5", "--force", *(f"--set={word}" for word in options))
    assert run.returncode == FINISHED, run.stderr
    return contents(folder / "gas.h5")


def test_a_disk_between_two_walls_knows_them_apart(ricochet, tmp_path):
    """It leaves the left wall with half its speed, the right one with all."""
    found = observed(
        ricochet,
        tmp_path,
        """&side name = 'left' restitution = 0.5 / &species count = 1 radius = 0.1
        position = 0.5, 0.5 velocity = 1, 0 / &stop time = 6 / &output frames_every_events = 1 /""",
    )
    v = found["/particles/disks/velocity/value"][:, 0, 0]
    assert v[:5].tolist() == [1, -1, 0.5, -0.5, 0.25]
    assert found["/observables/sides/left/energy/value"][-1] == (v[-1] ** 2 - 1) / 2


@pytest.mark.parametrize(
    "law",
    ["restitution = 0", "temperature = 9 speed = 5", "tangential_restitution = 0.5 friction = 1"],
)
def test_disks_grow_between_walls_whatever_their_law(ricochet, tmp_path, law):
    """The places of `dense` disks are those between elastic walls."""
    places = [
        observed(
            ricochet,
            tmp_path,
            f"&obstacle centre = 0.5, 0.5 radius = 0.2 {words} /"
            f"&wall from = 0.1, 0.9 to = 0.9, 0.9 {words} / &contact wall_rule = 'normal' /"
            "&species count = 40 packing_fraction = 0.4 placement = 'dense' temperature = 1 /"
            "&stop collisions = 1 / &output frames_every_collisions = 1 /",
        )["/particles/disks/position/value"][0]
        for words in ("", law)
    ]
    assert (places[0] == places[1]).all()


def test_disks_start_between_the_sides_where_they_are(ricochet, tmp_path):
    """Also beyond the place of a side that starts outside of it, up to the end of a wall there."""
    found = observed(
        ricochet,
        tmp_path,
        """&side name = 'bottom' motion = 'sine' amplitude = 0.3 period = 1 phase = 0.25 /
        &side name = 'top' motion = 'sine' amplitude = 0.3 period = 1 phase = 0.75 /
        &species name = 'a' count = 100 radius = 0.01 /
        &species name = 'b' count = 1 radius = 0.05 region = 0, 1, 0.5, 1.3 position = 0.5, 1.25 /
        &wall from = 0.1, 1 to = 0.1, 1.3 / &stop time = 0 /""",
    )
    y = found["/particles/disks/position/value"][0, :, 1]
    assert y.min() >= 0.31 and y[-1] == 1.25 and y[:-1].max() <= 0.99


@pytest.mark.parametrize("dynamics", ["events", "steps"])
def test_a_side_shakes_a_bed_at_rest(ricochet, tmp_path, dynamics):
    """Nothing moves at the start, and there is no gravity: the first event comes from the side."""
    found = observed(
        ricochet,
        tmp_path,
        """&side name = 'bottom' motion = 'sine' amplitude = 0.05 period = 1 /
        &run dt = 1e-3 / &species count = 300 radius = 0.02 / &stop time = 3 /""".replace(
            "dt", f"dynamics = '{dynamics}' dt"
        ),
    )
    assert found["/observables/all/kinetic_energy/value"][-1] > 0
    assert found["/observables/work/value"][-1] > 0


def test_time_steps_come_close_to_events(ricochet, tmp_path):
    """The moments of some bounces of a disk on a floor that moves, at a fine step."""
    times = [
        observed(ricochet, tmp_path, BOUNCE, *options)["/particles/disks/velocity/time"][1:6]
        for options in ([], ["run.dynamics=steps", "run.dt=1e-5"])
    ]
    assert times[1] == pytest.approx(times[0], abs=1e-3)


@pytest.mark.parametrize(
    ("motion", "disk"),
    [  # it chatters to rest on a floor whose acceleration is less than gravity, or has no room
        ("'sine' amplitude = 0.01", "radius = 0.1 position = 0.5, 0.3"),
        ("'parabolic' amplitude = 0.01", "radius = 0.1 position = 0.5, 0.3"),
        ("'sine' amplitude = 0.5", "radius = 0.3 position = 0.5, 0.6"),
    ],
)
def test_chattering_and_crushing_is_a_collapse(ricochet, tmp_path, motion, disk):
    write_input(
        tmp_path,
        f"&box gravity = 0, -1 / &contact restitution = 0.5 / &species {disk} /"
        f"&side name = 'bottom' motion = {motion} period = 1 / &stop time = 20 /",
    )
    run = ricochet("gas.nml", "-o", "gas.h5")
    assert run.returncode == BROKEN and "inelastic collapse" in one_line(run)
