"""Names, curves and notes in the player that depend on the system of a run."""

import pytest

from ricochet import film_data


def test_obstacles_and_walls_have_their_names(simulated):
    run = simulated(
        """&obstacle centre = 0.3, 0.5 radius = 0.1 /
        &obstacle name = 'post' centre = 0.7, 0.5 radius = 0.1 /
        &wall name = 'roof' points = 0.2, 0.8, 0.5, 0.9, 0.8, 0.8 /
        &wall from = 0.1, 0.1 to = 0.1, 0.3 /
        &species count = 2 radius = 0.01 speed = 1 / &stop events = 5 /"""
    )
    names = ["obstacle 1", "obstacle post", "wall roof", "wall roof", "wall 2"]
    assert film_data.scene(run)[0]["surfaces"][4:] == names


TRACERS = """&species count = 30 radius = 1e-8 speed = 1 / &stop time = 1 /
&output frames_every_time = 0.1 observables_every_time = 0.1 /"""


@pytest.mark.parametrize(
    ("more", "curve"),
    [
        ("", False),
        ("&side name = 'left' temperature = 1 / &side name = 'right' temperature = 1 /", True),
    ],
)
def test_maxwells_law_is_for_disks_that_collide_or_are_heated(simulated, playing, more, curve):
    browser = playing(simulated(TRACERS + more).path)
    assert ("Maxwell" in browser.run("return $('bars').textContent")) == curve


@pytest.mark.parametrize("g", [0, -1])
def test_no_pressure_is_drawn_under_gravity(simulated, playing, g):
    text = TRACERS.replace("1e-8", "0.03") + f"&box gravity = 0, {g} /"
    browser = playing(simulated(text).path)
    assert browser.run("return $('pressures').hidden") == (g != 0)


def test_recycled_disks_jump_and_no_event_log_would_help(simulated):
    """The reason given is not that driving changes velocities between frames."""
    drive = "&drive kind = 'recycle' interval = 0.1 from_region = 0, 1, 0, 0.2 "
    drive += "to_region = 0, 1, 0.5, 1 velocity = 0, -1 /"
    run = simulated(TRACERS + drive)
    facts, _ = film_data.film(run, [0, 1], "speed", [])
    assert facts["note"] == "recycled disks jump between frames"
