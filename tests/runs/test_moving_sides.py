"""Sides that move: what they do to a disk and to a gas, and that no method leaves a trace."""

import h5py
import numpy as np
import pytest

from whole_runs import FINISHED, contents, differences, one_line, write_input

BROKEN = 4
SYSTEM = """&box upper = 2, 1 gravity = 0, -1 boundary = 'wall', 'wall' /
&side name = 'bottom' motion = 'sine' amplitude = 0.04 period = 0.3 phase = 0.6 /
&side name = 'left' motion = 'parabolic' amplitude = 0.1 period = 0.7 restitution = 0.8 /
&side name = 'right' motion = 'sawtooth' velocity = 0.3 rule = 'normal' /
&wall name = 'ramp' from = 1.4, -0.03 to = 1.8, 0.4 restitution = 0.5 /
&contact restitution = 0.95 contact_time = 1e-5 /
&species name = 'a' count = 3000 radius = 0.005 temperature = 1 /
&species name = 'b' count = 300 radius = 0.01 mass = 4 temperature = 1 /
&output observables_every_collisions = 5000 event_log = .true. /
&stop collisions = 20000 / """
FLOOR = """&box gravity = 0, -1 upper = 1, 1000 /
&species count = 1 radius = 0.1 placement = 'explicit' {start} /
&stop time = 4000 events = 400 / &output frames_every_events = 1 observables_every_events = 1 /
&side name = 'bottom' {law} / """


def balance(observables) -> np.ndarray:
    """The energy that must not change, over the largest of its terms."""
    terms = [observables[name][:] for name in ("total_energy", "dissipated_energy", "work")]
    return (terms[0] + terms[1] - terms[2]) / max(abs(term).max() for term in terms)


def on_floor(ricochet, folder, law: str, start: str) -> dict[str, np.ndarray]:
    """A disk of radius 0.1 under unit gravity above a bottom that moves."""
    write_input(folder, FLOOR.format(law=law, start=start))
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    found = contents(folder / "gas.h5")
    named = {
        name: found[f"/observables/{name}/value"]
        for name in ("total_energy", "dissipated_energy", "work")
    }
    assert np.ptp(balance(named)) < 1e-12
    return named | {
        "time": found["/particles/disks/velocity/time"],
        "velocity": found["/particles/disks/velocity/value"][:, 0],
        "position": found["/particles/disks/position/value"][:, 0],
    }


@pytest.mark.parametrize("xi", [0.5, 0.75])
def test_sawtooth_floor_drives_a_disk_to_its_fixed_point(ricochet, tmp_path, xi):
    """The map v -> xi v + (1+xi) V has the fixed point V (1+xi)/(1-xi), exact in binary here."""
    law = f"motion = 'sawtooth' velocity = 0.25 restitution = {xi}"
    found = on_floor(ricochet, tmp_path, law, "position = 0.5, 1 velocity = 1, 0")
    v = 0.25 * (1 + xi) / (1 - xi)
    assert found["velocity"][-2] == pytest.approx([0, v], abs=1e-15 * v + 1e-30)
    assert np.diff(found["time"])[-2] == pytest.approx(2 * v, rel=1e-12)


@pytest.mark.parametrize(
    ("xi", "strength", "bounces"), [(0.5, 1.5, 1), (0.5, 1.55, 2), (0.8, 1.05, 1), (0.8, 1.09, 2)]
)
def test_sine_floor_has_the_orbit_of_theory(ricochet, tmp_path, xi, strength, bounces):
    """A disk that leaves with 1/2 flies for a period; the floor must move with (1-xi)/(1+xi)/2.

    The orbit doubles where strength**2 exceeds the sum of the squares of pi (1-xi)/(1+xi) and
    2 (1+xi**2)/(1+xi)**2: at 1.5268 for xi = 0.5, at 1.0708 for xi = 0.8.
    """
    amplitude = strength / (2 * np.pi) ** 2
    floor = (1 - xi) / (1 + xi) / 2
    phase = np.arccos(floor / (2 * np.pi * amplitude))  # of the bounces
    law = f"motion = 'sine' amplitude = {amplitude} period = 1 restitution = {xi} phase = "
    law += str(phase / (2 * np.pi) + 0.5)
    top = 0.1 + amplitude * np.sin(phase) + 0.125 + 1e-4  # half a period before, but for a bit
    found = on_floor(ricochet, tmp_path, law, f"position = 0.5, {top}")
    time, v = found["time"][-42:-2], found["velocity"][-42:-2, 1]
    assert v[bounces:] == pytest.approx(v[:-bounces], rel=1e-4)
    assert time[bounces:] - time[:-bounces] == pytest.approx(
        np.full(40 - bounces, bounces), rel=1e-4
    )
    assert (abs(v[-1] - v[-2]) > 1e-2) == (bounces > 1)
    if bounces == 1:
        assert v[-1] == pytest.approx(0.5, rel=1e-4)


def test_a_disk_reaches_the_orbit_from_rest(ricochet, tmp_path):
    law = f"motion = 'sine' amplitude = {1.2 / (2 * np.pi) ** 2} period = 1 restitution = 0.5"
    found = on_floor(ricochet, tmp_path, law, f"position = 0.5, {0.42 + 1.2 / (2 * np.pi) ** 2}")
    assert found["velocity"][-42:-2, 1] == pytest.approx(np.full(40, 0.5))


@pytest.mark.parametrize("motion", ["sine", "parabolic"])
def test_no_disk_gets_through_a_floor(ricochet, tmp_path, motion):
    law = f"motion = '{motion}' amplitude = 0.4 period = 1.1 phase = 0.3 restitution = 0.9"
    found = on_floor(ricochet, tmp_path, law, "position = 0.5, 2")
    s = found["time"] / 1.1 + 0.3
    f = np.sin(2 * np.pi * s)
    if motion == "parabolic":
        s %= 1
        f = np.where(s < 0.5, 16 * s * (0.5 - s), 16 * (s - 0.5) * (s - 1))
    gap = found["position"][:, 1] - 0.1 - 0.4 * f
    resolution = 1e-15 * (1 + abs(found["time"] * found["velocity"][:, 1]))
    assert (abs(gap) < 4 * resolution)[1:-1].all()


def test_a_slow_piston_keeps_temperature_times_area(ricochet, tmp_path):
    write_input(
        tmp_path,
        """&box upper = 2, 1 /
        &side name = 'right' motion = 'sine' amplitude = 0.5 period = 400 /
        &species count = 200 radius = 0.002 temperature = 1 exact_temperature = 1 /
        &stop time = 300 / &output observables_every_time = 50 /""",
    )
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    with h5py.File(tmp_path / "gas.h5") as file:
        group = file["observables"]
        temperature = group["all/temperature/value"][:]
        area = 2 - 0.5 * np.sin(2 * np.pi * group["all/temperature/time"][:] / 400)
        values = {
            name: group[f"{name}/value"] for name in ("total_energy", "dissipated_energy", "work")
        }
        assert np.ptp(balance(values)) < 1e-12
        assert abs(values["dissipated_energy"][-1]) < 1e-10
    assert temperature * area == pytest.approx(np.full(len(area), 2), rel=0.03)
    assert temperature.max() > 1.3 and temperature.min() < 0.85


@pytest.fixture
def finished(ricochet, tmp_path):
    write_input(tmp_path, SYSTEM)
    assert ricochet("gas.nml", "-o", "plain.h5").returncode == FINISHED
    return contents(tmp_path / "plain.h5")


def test_the_balance_of_energy_holds_with_all_motions(finished):
    found = {
        name: finished[f"/observables/{name}/value"]
        for name in ("total_energy", "dissipated_energy", "work")
    }
    assert np.ptp(balance(found)) < 1e-12
    assert found["work"][-1] > 0
    position = finished["/particles/disks/position/value"][-1]
    assert (position > [-0.1, -0.04]).all() and (position < [2, 1]).all()


@pytest.mark.parametrize(
    "options", [["run.threads=2"], ["run.search='pairs'"], ["run.queue='heap'"]]
)
def test_moving_sides_leave_no_trace_of_the_method(finished, ricochet, tmp_path, options):
    run = ricochet("gas.nml", "-o", "other.h5", *(f"--set={option}" for option in options))
    assert run.returncode == FINISHED
    found = differences(tmp_path / "plain.h5", tmp_path / "other.h5")
    assert [name for name in found if not name.startswith("/parameters")] == []


def test_a_run_goes_on_with_its_moving_sides(finished, ricochet, tmp_path):
    ricochet("gas.nml", "-o", "other.h5", "--set=stop.collisions=9000")
    assert ricochet("gas.nml", "-o", "other.h5", "--resume").returncode == FINISHED
    found = differences(tmp_path / "plain.h5", tmp_path / "other.h5")
    assert [name for name in found if not name.startswith("/parameters")] == []


def test_a_side_shakes_a_bed_at_rest(ricochet, tmp_path):
    """Nothing moves at the start, and there is no gravity: the first event comes from the side."""
    write_input(
        tmp_path,
        """&side name = 'bottom' motion = 'sine' amplitude = 0.05 period = 1 /
        &species count = 300 radius = 0.02 / &stop time = 3 /""",
    )
    for option in ("run.dynamics='events'", "run.dynamics='steps'"):
        run = ricochet("gas.nml", "-o", "gas.h5", "--force", f"--set={option}", "--set=run.dt=1e-3")
        assert run.returncode == FINISHED
        with h5py.File(tmp_path / "gas.h5") as file:
            assert file["observables/all/kinetic_energy/value"][-1] > 0
            assert file["observables/work/value"][-1] > 0


def test_time_steps_come_close_to_events(ricochet, tmp_path):
    """The height after some bounces of a disk on a floor that moves, at a fine step."""
    law = "motion = 'sine' amplitude = 0.03 period = 1 restitution = 0.8"
    exact = on_floor(ricochet, tmp_path, law, "position = 0.5, 0.7")
    run = ricochet("gas.nml", "-o", "steps.h5", "--set=run.dynamics='steps'", "--set=run.dt=1e-5",
                   "--set=stop.events=5")  # fmt: skip
    assert run.returncode == FINISHED
    found = contents(tmp_path / "steps.h5")
    times = found["/particles/disks/velocity/time"]
    assert times[1:6] == pytest.approx(exact["time"][1:6], abs=1e-3)


@pytest.mark.parametrize(
    "text",
    [
        # It chatters to rest on the floor, whose acceleration is less than gravity.
        """&box gravity = 0, -1 / &contact restitution = 0.5 /
        &side name = 'bottom' motion = 'sine' amplitude = 0.01 period = 1 /
        &species count = 1 radius = 0.1 placement = 'explicit' position = 0.5, 0.3 /""",
        """&box gravity = 0, -1 / &contact restitution = 0.5 /
        &side name = 'bottom' motion = 'parabolic' amplitude = 0.01 period = 1 /
        &species count = 1 radius = 0.1 placement = 'explicit' position = 0.5, 0.3 /""",
        # No room is left for it.
        """&side name = 'bottom' motion = 'sine' amplitude = 0.5 period = 1 restitution = 0.5 /
        &contact restitution = 0.5 /
        &species count = 1 radius = 0.3 placement = 'explicit' position = 0.5, 0.6 /""",
    ],
)
def test_chattering_and_crushing_is_a_collapse(ricochet, tmp_path, text):
    write_input(tmp_path, text + " &stop time = 20 /")
    run = ricochet("gas.nml", "-o", "gas.h5")
    assert run.returncode == BROKEN
    assert "inelastic collapse" in one_line(run)


SINE = "motion = 'sine' amplitude = 0.1 period = 1"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("&side name = 'top' motion = 'sine' period = 1 /", "needs side.amplitude"),
        ("&side name = 'top' motion = 'sine' amplitude = 0.1 /", "needs side.period"),
        ("&side name = 'top' motion = 'sawtooth' /", "needs side.velocity"),
        ("&side name = 'top' motion = 'square' /", "'still', 'sine', 'parabolic' or 'sawtooth'"),
        ("&side name = 'top' amplitude = 0.1 /", "has no effect with motion = 'still'"),
        (f"&side name = 'top' {SINE} velocity = 1 /", "has no effect with motion = 'sine'"),
        ("&side name = 'top' motion = 'sine' amplitude = 0.1 period = 0 /", "> 0"),
        ("&side name = 'top' motion = 'sine' amplitude = -1 period = 1 /", "> 0"),
        ("&side name = 'top' motion = 'sine' amplitude = 1 period = 1 /", "leaves no room"),
        (f"&side name = 'top' {SINE} phase = 2 /", "from 0 to 1"),
        ("&side name = 'top' motion = 'sawtooth' velocity = 0 /", "> 0"),
        (f"&side name = 'top' {SINE} temperature = 1 /", "given with motion"),
        (f"&side name = 'left' {SINE} / &box boundary = 'periodic', 'wall' /", "is periodic"),
        (f"&side name = 'top' {SINE} / &stop energy_fraction = 0.5 /", "motion"),
        ("&wall motion = 'sine' from = 0, 0 to = 1, 1 /", "side.motion"),
        (f"&side name = 'top' {SINE} / &wall from = 0, 0 to = 1, 1.2 /", "outside the box"),
        (
            f"&side name = 'bottom' {SINE} phase = 0.25 / "
            "&species name = 'low' count = 1 radius = 0.05 position = 0.5, 0.1 /",
            "side that moves",
        ),
    ],
)
def test_a_motion_that_cannot_be_is_refused_in_a_line(ricochet, tmp_path, text, said):
    stop = "" if "&stop" in text else "&stop time = 1 /"
    write_input(tmp_path, f"{text} &species count = 1 radius = 0.01 speed = 1 / {stop}")
    run = ricochet("gas.nml", "--check")
    assert run.returncode == 2
    assert said in one_line(run)


def test_disks_start_between_the_sides_where_they_are(ricochet, tmp_path):
    """Also beyond the place of a side that starts outside of it, up to the end of a wall there."""
    write_input(
        tmp_path,
        """&side name = 'bottom' motion = 'sine' amplitude = 0.3 period = 1 phase = 0.25 /
        &side name = 'top' motion = 'sine' amplitude = 0.3 period = 1 phase = 0.75 /
        &species name = 'a' count = 100 radius = 0.01 /
        &species name = 'b' count = 1 radius = 0.05 region = 0, 1, 0.5, 1.3 position = 0.5, 1.25 /
        &wall from = 0.1, 1 to = 0.1, 1.3 / &stop time = 0 /""",
    )
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    y = contents(tmp_path / "gas.h5")["/particles/disks/position/value"][0, :, 1]
    assert y.min() >= 0.31 and y[-1] == 1.25 and y[:-1].max() <= 0.99
