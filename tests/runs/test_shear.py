"""Sheared boxes (Lees and Edwards): what a seam must not change.

Bits, balances and gaps are asserted of all systems (test_random_systems.py), the viscosity of a
gas in the validation.
"""

import numpy as np
import pytest

from ricochet import read_run
from whole_runs import FINISHED, write_input

SHEARED = """&run seed = 3 /
&box lower = -3, 1 upper = 7, 9 boundary = 'periodic', 'periodic' shear_rate = 0.7 /
&species name = 'a' count = 120 radius = 0.25 temperature = 1 /
&contact restitution = 0.9 /
&stop time = 2 /
"""


def run_of(ricochet, folder, text: str, *settings: str):
    """A finished run of an input, in a file of its own."""
    write_input(folder, text)
    name = f"{len(list(folder.iterdir()))}.h5"
    result = ricochet("gas.nml", "-o", name, *(f"--set={setting}" for setting in settings))
    assert result.returncode == FINISHED, result.stderr
    return read_run(folder / name)


def found(run, name: str) -> np.ndarray:
    return run.observable(name).value


def test_a_pair_meets_across_the_seam_as_inside(ricochet, tmp_path):
    """By Galileo: the disk beyond the top is seen with the velocity of the image."""
    slip, lift = 0.3 * 10, np.array([0, 4.5])
    place = np.array([[3, 5], [4.2, 5.9]])
    velocity = np.array([[0.5, 0.3], [-0.6, -0.4]])
    system = """&box upper = 10, 10 boundary = 'periodic', 'periodic' {} /
&species name = 'a' mass = 2 radius = 0.4 position = {}, {} velocity = {}, {} /
&species name = 'b' mass = 3 radius = 0.4 position = {}, {} velocity = {}, {} /
&contact restitution = 0.8 / &stop time = 2 /
&output frames_every_time = 0.5 event_log = .true. /
"""
    runs = []
    for shear, x, v in (
        ("", place, velocity),
        ("shear_rate = 0.3", (place + lift) % 10, velocity - [[0, 0], [slip, 0]]),
    ):
        numbers = np.concatenate([x, v], axis=1).ravel()
        text = system.format(shear, *map(repr, map(float, numbers)))
        runs.append(run_of(ricochet, tmp_path, text))
    inside, across = runs
    assert len(inside.events.time) == len(across.events.time) == 1
    assert across.events.time == pytest.approx(inside.events.time, rel=1e-13)
    assert across.events.impulse == pytest.approx(inside.events.impulse, rel=1e-13)
    at = inside.events.time[0]
    # by hand: the impulse along the line of centres
    apart = place[1] - place[0] + (velocity[1] - velocity[0]) * at
    assert np.linalg.norm(apart) == pytest.approx(0.8, rel=1e-13)
    closing = apart @ (velocity[1] - velocity[0]) / 0.8
    push = 1.8 * (2 * 3 / 5) * closing * apart / 0.8
    assert across.velocity[-1][0] == pytest.approx(velocity[0] + push / 2, rel=1e-12)
    # b is now as it was: below the seam, and slower by the slip, or above it
    rows = across.image[-1][1, 1] - across.image[0][1, 1]
    after = velocity[1] - push / 3 - [slip * (1 + rows), 0]
    assert across.velocity[-1][1] == pytest.approx(after, rel=1e-12)
    own = across.unwrapped(-1)[0] - across.unwrapped(0)[0]
    assert own == pytest.approx(inside.unwrapped(-1)[0] - inside.unwrapped(0)[0], rel=1e-12)
    work = slip * push[0] + 0.5 * 3 * sum_of_passages(across, slip)
    assert found(across, "work")[-1] == pytest.approx(work, rel=1e-12)


def sum_of_passages(run, slip: float) -> float:
    """Change of v**2 of disk b by passing the seam, after the only collision."""
    last = run.velocity[-1][1, 0]
    rows = run.image[-1][1, 1] - run.image[0][1, 1]
    return last**2 - (last + rows * slip) ** 2


def test_a_free_disk_goes_straight_on(ricochet, tmp_path):
    """Unwrapped, whatever it passes, and however often."""
    run = run_of(
        ricochet,
        tmp_path,
        """&box lower = -1, 2 upper = 2, 4 boundary = 'periodic', 'periodic' shear_rate = -0.4 /
&species name = 'a' radius = 0.1 position = 0.5, 2.5 velocity = 0.3, 1.7 /
&stop time = 300 / &output frames_every_time = 10 /
""",
    )
    straight = [0.5, 2.5] + run.time[:, None] * [0.3, 1.7]
    assert np.allclose(run.unwrapped(slice(None))[:, 0], straight, rtol=1e-12, atol=1e-9)
    rows = run.image[:][:, 0, 1]
    assert rows[-1] == 255
    assert run.velocity[:][:, 0, 0] == pytest.approx(0.3 + 0.8 * rows)


def test_generated_velocities_get_the_profile_and_given_ones_do_not(ricochet, tmp_path):
    kinds = {
        "temperature = 1": True,
        "temperature = 1 exact_temperature = 2": True,
        "speed = 2": True,
        "velocities = 'rest'": True,
        "velocity = 1, 2": False,
    }
    for kind, generated in kinds.items():
        text = SHEARED.replace("temperature = 1", kind)
        sheared, plain = (
            run_of(ricochet, tmp_path, text, "stop.time=0.1", f"box.shear_rate={rate}")
            for rate in (0.7, 0)
        )
        profile = np.zeros((120, 2))
        profile[:, 0] = 0.7 * (plain.position[0][:, 1] - 5)
        expected = plain.velocity[0] + generated * profile
        assert sheared.velocity[0] == pytest.approx(expected, abs=1e-13), kind
        if generated:
            for name in ("all/temperature", "a/temperature", "pressure"):
                value = found(plain, name)[0]
                assert found(sheared, name)[0] == pytest.approx(value, abs=1e-12), (kind, name)


def test_an_elastic_gas_heats_as_its_shear_stress_says(ricochet, tmp_path):
    """dE/dt = -gamma P_xy A relative to the profile, P_xy A = sum m u_x u_y + d virial_xy/dt."""
    run = run_of(
        ricochet,
        tmp_path,
        """&box upper = 100, 100 boundary = 'periodic', 'periodic' shear_rate = 0.2 /
&species name = 'a' count = 4000 packing_fraction = 0.2 temperature = 1 /
&stop collisions_per_disk = 12 /
&output frames_every_collisions = 200 observables_every_collisions = 200 /
""",
    )
    stress = []
    for frame in range(run.frames):
        x, v = run.position[frame], run.velocity[frame]
        stress.append(np.sum(run.mass * (v[:, 0] - 0.2 * (x[:, 1] - 50)) * v[:, 1]))
    virial = found(run, "virial_tensor")[-1, 1]
    assert virial < 0  # collisions count
    heat = -0.2 * (np.trapezoid(stress, run.time) + virial)
    energy = 4000 * found(run, "all/temperature")
    assert energy[-1] > 1.1 * energy[0]
    assert energy[-1] - energy[0] == pytest.approx(heat, rel=1e-3)


def test_kicks_are_relative_to_the_profile(ricochet, tmp_path):
    bath = "&drive kind = 'brownian' temperature = 2 interval = 0.5 /\n"
    many = SHEARED.replace("count = 120", "count = 3000").replace("0.25", "0.04")
    run = run_of(ricochet, tmp_path, many + bath)
    height, speed = run.position[-1][:, 1] - 5, run.velocity[-1][:, 0]
    error = np.sqrt(2 / np.sum(height**2))
    assert np.polyfit(height, speed, 1)[0] == pytest.approx(0.7, abs=5 * error)
    assert found(run, "all/temperature")[-1] == pytest.approx(2, rel=5 / np.sqrt(3000))
