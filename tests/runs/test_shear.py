"""Sheared boxes (Lees and Edwards): the same bits by every way, and what a seam must not change."""

import numpy as np
import pytest

from ricochet import read_run
from whole_runs import FINISHED, USAGE, differences, one_line, write_input

SHEARED = """&run seed = 3 /
&box lower = -3, 1 upper = 7, 9 boundary = 'periodic', 'periodic' shear_rate = 0.7 /
&species name = 'a' count = 120 radius = 0.25 temperature = 1 /
&contact restitution = 0.9 /
&stop time = 20 /
&output frames_every_time = 1 observables_every_time = 0.7 event_log = .true. /
"""
#: Few columns and rows: cells stand for several of their images. A seam that races; disks at rest.
VARIANTS = {
    "gas": [],
    "backwards": ["box.shear_rate=-2"],
    "racing": ["box.shear_rate=40", "stop.time=0.5"],
    "strip": ["box.upper=7,3.5", "species.a.count=20"],
    "column": ["box.upper=-1.5,9", "species.a.count=12", "contact.restitution=1"],
    "two": ["box.upper=-1.9,2.1", "species.a.count=2", "stop.time=50"],
    "plastic": ["contact.restitution=0", "contact.contact_time=1e-4"],
    "at rest": ["contact.restitution=0.5"],
    "sizes": ["species.a.radius=0.1"],
}
GIANT = "&species name = 'giant' count = 2 mass = 50 radius = 0.9 /\n"


def text_of(name: str) -> str:
    """The input of a variant."""
    if name == "at rest":
        return SHEARED.replace(" temperature = 1", "")
    return SHEARED + (GIANT if name == "sizes" else "")


def overrides(*settings: str) -> list[str]:
    return [f"--set={setting}" for setting in settings]


def finish(ricochet, name: str, *options: str):
    result = ricochet("gas.nml", "-o", f"{name}.h5", "--force", *options)
    assert result.returncode == FINISHED, result.stderr


def found(run, name: str) -> np.ndarray:
    return run.observable(name).value


@pytest.mark.parametrize("name", VARIANTS)
def test_every_search_and_queue_gives_the_same_bits(ricochet, tmp_path, name):
    write_input(tmp_path, text_of(name))
    options = overrides(*VARIANTS[name])
    finish(ricochet, "cells", *options)
    for way in ("run.search=pairs", "run.queue=heap", "run.threads=2"):
        finish(ricochet, "other", *options, *overrides(way))
        differ = differences(tmp_path / "cells.h5", tmp_path / "other.h5")
        assert [path for path in differ if not path.startswith("/parameters")] == [], way
    run = read_run(tmp_path / "cells.h5")
    assert found(run, "collisions")[-1] > 10


@pytest.mark.parametrize("name", VARIANTS)
def test_energy_balances_and_disks_stay_apart(ricochet, tmp_path, name):
    write_input(tmp_path, text_of(name))
    finish(ricochet, "gas", *overrides(*VARIANTS[name]))
    run = read_run(tmp_path / "gas.h5")
    terms = [found(run, name) for name in ("total_energy", "dissipated_energy", "work")]
    balance = terms[0] + terms[1] - terms[2]
    assert abs(balance - balance[0]).max() <= 1e-12 * np.abs(terms).max()
    assert terms[2][-1] != 0
    for frame in range(run.frames):
        assert gaps(run, frame).min() > -1e-10
        position = run.position[frame]
        assert ((position >= run.lower) & (position < run.upper)).all()


def gaps(run, frame: int) -> np.ndarray:
    """Between the rims of all pairs, each through its nearest image."""
    i, j = np.triu_indices(run.count, 1)
    separation = run.position[frame][j] - run.position[frame][i]
    rows = np.round(separation[:, 1] / run.edges[1])
    slide = run.shear_rate * run.edges[1] * run.time[frame]
    separation -= rows[:, None] * np.array([slide, run.edges[1]])
    separation[:, 0] -= run.edges[0] * np.round(separation[:, 0] / run.edges[0])
    return np.linalg.norm(separation, axis=1) - run.radius[i] - run.radius[j]


def test_a_stopped_run_and_another_cadence_change_no_bit(ricochet, tmp_path):
    write_input(tmp_path, SHEARED)
    finish(ricochet, "whole")
    finish(ricochet, "parts", *overrides("stop.time=3.3"))
    for end in (7.77, 11, 13.123, 20):
        options = overrides(f"stop.time={end}")
        assert ricochet("gas.nml", "-o", "parts.h5", "--resume", *options).returncode == FINISHED
    assert differences(tmp_path / "whole.h5", tmp_path / "parts.h5") == ["/parameters/overrides"]
    finish(ricochet, "often", *overrides("output.frames_every_time=0.05"))
    whole, often = (read_run(tmp_path / f"{name}.h5") for name in ("whole", "often"))
    assert (whole.position[-1] == often.position[-1]).all()
    assert (whole.velocity[-1] == often.velocity[-1]).all()


def test_a_pair_meets_across_the_seam_as_inside(ricochet, tmp_path):
    """By Galileo: the disk beyond the top is seen with the velocity of the image."""
    slip, lift, stop = 0.3 * 10, np.array([0, 4.5]), 2.0
    place = np.array([[3, 5], [4.2, 5.9]])
    velocity = np.array([[0.5, 0.3], [-0.6, -0.4]])
    system = """&box upper = 10, 10 boundary = 'periodic', 'periodic' {} /
&species name = 'a' mass = 2 radius = 0.4 position = {}, {} velocity = {}, {} /
&species name = 'b' mass = 3 radius = 0.4 position = {}, {} velocity = {}, {} /
&contact restitution = 0.8 / &stop time = {} /
&output frames_every_time = 0.5 event_log = .true. /
"""
    runs = []
    for shear, x, v in (
        ("", place, velocity),
        ("shear_rate = 0.3", (place + lift) % 10, velocity - [[0, 0], [slip, 0]]),
    ):
        numbers = np.concatenate([x, v], axis=1).ravel()
        write_input(tmp_path, system.format(shear, *map(repr, map(float, numbers)), stop))
        finish(ricochet, f"run{len(runs)}")
        runs.append(read_run(tmp_path / f"run{len(runs)}.h5"))
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
    write_input(
        tmp_path,
        """&box lower = -1, 2 upper = 2, 4 boundary = 'periodic', 'periodic' shear_rate = -0.4 /
&species name = 'a' radius = 0.1 position = 0.5, 2.5 velocity = 0.3, 1.7 /
&stop time = 300 / &output frames_every_time = 10 /
""",
    )
    finish(ricochet, "gas")
    run = read_run(tmp_path / "gas.h5")
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
        write_input(tmp_path, SHEARED.replace("temperature = 1", kind))
        end = overrides("stop.time=0.1")
        finish(ricochet, "sheared", *end)
        finish(ricochet, "plain", *end, *overrides("box.shear_rate=0"))
        sheared, plain = (read_run(tmp_path / f"{name}.h5") for name in ("sheared", "plain"))
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
    write_input(
        tmp_path,
        """&box upper = 100, 100 boundary = 'periodic', 'periodic' shear_rate = 0.2 /
&species name = 'a' count = 4000 packing_fraction = 0.2 temperature = 1 /
&stop collisions_per_disk = 12 /
&output frames_every_collisions = 200 observables_every_collisions = 200 /
""",
    )
    finish(ricochet, "gas")
    run = read_run(tmp_path / "gas.h5")
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
    write_input(tmp_path, SHEARED.replace("a' count = 120", "a' count = 3000") + bath)
    end = overrides("species.a.radius=0.04", "stop.time=2")
    finish(ricochet, "gas", *end)
    finish(ricochet, "heap", *end, *overrides("run.queue=heap"))
    differ = differences(tmp_path / "gas.h5", tmp_path / "heap.h5")
    assert [path for path in differ if not path.startswith("/parameters")] == []
    run = read_run(tmp_path / "gas.h5")
    height, speed = run.position[-1][:, 1] - 5, run.velocity[-1][:, 0]
    error = np.sqrt(2 / np.sum(height**2))
    assert np.polyfit(height, speed, 1)[0] == pytest.approx(0.7, abs=5 * error)
    assert found(run, "all/temperature")[-1] == pytest.approx(2, rel=5 / np.sqrt(3000))
    names = ("total_energy", "dissipated_energy", "work", "drive_energy")
    terms = [found(run, name) for name in names]
    balance = terms[0] + terms[1] - terms[2] - terms[3]
    assert abs(balance - balance[0]).max() <= 1e-12 * np.abs(terms).max()


@pytest.mark.parametrize(
    ("other", "text"),
    {
        "box.gravity": "&box gravity = 0, -1 shear_rate = 1 boundary = 'periodic', 'wall' /",
        "box.boundary": "&box boundary = 'wall', 'periodic' shear_rate = 1 /",
        "run.dynamics": "&run dynamics = 'steps' dt = 1e-3 /",
        "stop.energy_fraction": "&stop energy_fraction = 0.5 / &contact restitution = 0.9 /",
        "&obstacle": "&obstacle centre = 0.5, 0.5 radius = 0.1 /",
        "&wall": "&wall from = 0.1, 0.1 to = 0.2, 0.1 /",
    }.items(),
)
def test_what_does_not_go_with_shear_is_refused_by_name(ricochet, tmp_path, other, text):
    parts = {
        "&box": "&box boundary = 'periodic', 'periodic' shear_rate = 1 /",
        "&species": "&species count = 3 radius = 0.02 temperature = 1 /",
        "&stop": "&stop time = 1 /",
    }
    parts[text.split()[0]] = text
    write_input(tmp_path, "\n".join(parts.values()) + "\n")
    result = ricochet("gas.nml", "--check")
    assert result.returncode == USAGE
    lines = [line for line in result.stderr.splitlines() if other in line]
    assert len(lines) == 1
    assert "box.shear_rate" in lines[0]


def test_one_disk_that_meets_nothing_needs_an_end_in_time(ricochet, tmp_path):
    one = SHEARED.replace("count = 120", "count = 1").replace("time = 20", "events = 9")
    write_input(tmp_path, one)
    result = ricochet("gas.nml", "--check")
    assert result.returncode == USAGE
    assert "stop" in one_line(result) and "box.shear_rate" in result.stderr
    assert ricochet("gas.nml", "--check", "--set=stop.time=1").returncode == FINISHED


def test_a_run_does_not_go_on_with_another_shear_rate(ricochet, tmp_path):
    write_input(tmp_path, SHEARED)
    finish(ricochet, "gas", *overrides("stop.time=1"))
    command = ["gas.nml", "-o", "gas.h5", "--resume"]
    result = ricochet(*command, *overrides("stop.time=2", "box.shear_rate=0.6"))
    assert result.returncode == USAGE
    assert "box.shear_rate" in one_line(result)
