"""Special cases of sheared boxes, driving, moving sides and collision rules of walls.

General properties, such as bit-identical results and conservation laws, are tested with random
systems in test_random_systems.py; physical results on heat baths, noise, active disks, viscosity
and bouncing disks in tests/validation.
"""

import numpy as np
import pytest

from ricochet import read_run
from run_laws import laws_broken
from whole_runs import BROKEN, FINISHED, contents, one_line, write_input


@pytest.fixture
def performed(ricochet, tmp_path):
    """Return a function that executes a run and returns the path of its output and its messages."""

    def run(text: str, *settings: str):
        write_input(tmp_path, text)
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.h5"
        done = ricochet("gas.nml", "-o", path, *(f"--set={setting}" for setting in settings))
        assert done.returncode == FINISHED, done.stderr
        return path, done.stdout

    return run


@pytest.fixture
def run_of(performed):
    return lambda *words: read_run(performed(*words)[0])


@pytest.fixture
def observed(performed):
    """Return a function that executes a run of an input and returns all data in its output."""
    return lambda *words: contents(performed(*words)[0])


# --- sheared boxes ---

SHEARED = """&run seed = 3 /
&box lower = -3, 1 upper = 7, 9 boundary = 'periodic', 'periodic' shear_rate = 0.7 /
&species name = 'a' count = 120 radius = 0.25 temperature = 1 /
&contact restitution = 0.9 /
&stop time = 2 /
"""


def test_a_pair_meets_across_the_seam_as_inside(run_of):
    """A collision across the sheared boundary is equivalent to one inside the box."""
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
        runs.append(run_of(system.format(shear, *map(float, numbers))))
    inside, across = runs
    assert len(inside.event_log().time) == len(across.event_log().time) == 1
    assert across.event_log().time == pytest.approx(inside.event_log().time, rel=1e-13)
    assert across.event_log().impulse == pytest.approx(inside.event_log().impulse, rel=1e-13)
    # Disk b is now below the sheared boundary and slower by the velocity of the image, or above it.
    rows = across.image[-1][1, 1] - across.image[0][1, 1]
    frame = np.array([[0, 0], [slip * (1 + rows), 0]])
    assert across.velocity[-1] + frame == pytest.approx(inside.velocity[-1], rel=1e-12)
    own = across.unwrapped(-1)[0] - across.unwrapped(0)[0]
    assert own == pytest.approx(inside.unwrapped(-1)[0] - inside.unwrapped(0)[0], rel=1e-12)


def test_a_free_disk_goes_straight_on(run_of):
    """The unwrapped path of a free disk is straight, even across periodic sides."""
    run = run_of(
        """&box lower = -1, 2 upper = 2, 4 boundary = 'periodic', 'periodic' shear_rate = -0.4 /
        &species name = 'a' radius = 0.1 position = 0.5, 2.5 velocity = 0.3, 1.7 /
        &stop time = 300 / &output frames_every_time = 10 /"""
    )
    straight = [0.5, 2.5] + run.time[:, None] * [0.3, 1.7]
    assert np.allclose(run.unwrapped(slice(None))[:, 0], straight, rtol=1e-12, atol=1e-9)
    rows = run.image[:][:, 0, 1]
    assert rows[-1] == 255
    assert run.velocity[:][:, 0, 0] == pytest.approx(0.3 + 0.8 * rows)


def test_generated_velocities_get_the_profile_and_given_ones_do_not(run_of):
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
            run_of(text, "stop.time=0.1", f"box.shear_rate={rate}") for rate in (0.7, 0)
        )
        profile = np.zeros((120, 2))
        profile[:, 0] = 0.7 * (plain.position[0][:, 1] - 5)
        expected = plain.velocity[0] + generated * profile
        assert sheared.velocity[0] == pytest.approx(expected, abs=1e-13), kind
        if generated:
            for name in ("all/temperature", "a/temperature", "virial_pressure"):
                value = plain.observable(name).value[0]
                found = sheared.observable(name).value[0]
                assert found == pytest.approx(value, abs=1e-12), f"{kind}: {name}"


def test_kicks_are_relative_to_the_profile(run_of):
    bath = "&drive kind = 'brownian' temperature = 2 interval = 0.5 /\n"
    many = SHEARED.replace("count = 120", "count = 3000").replace("0.25", "0.04")
    run = run_of(many + bath)
    height, speed = run.position[-1][:, 1] - 5, run.velocity[-1][:, 0]
    error = np.sqrt(2 / np.sum(height**2))
    assert np.polyfit(height, speed, 1)[0] == pytest.approx(0.7, abs=5 * error)
    assert run.observable("all/temperature").value[-1] == pytest.approx(2, rel=5 / np.sqrt(3000))


# --- driving: changes of velocities at fixed intervals ---

#: Input of one disk that does not collide.
ONE = """&box boundary = 'periodic', 'periodic' upper = 50, 50 /
&species count = 1 radius = 0.1 mass = 2 temperature = 0.6 /
&output frames_every_time = {} /
"""


@pytest.mark.parametrize(
    ("every", "interval", "end", "steps", "kicked"),
    [
        (0.05, 0.1, 1, "", range(2, 21, 2)),
        (0.1, 0.25, 1.1, "&run dynamics = 'steps' dt = 0.1 /", [3, 5, 8, 10]),
    ],
    ids=["events", "steps"],
)
def test_kicks_are_at_multiples_of_the_interval_and_no_events(
    observed, every, interval, end, steps, kicked
):
    """The velocity changes only at kicks, or at the end of a time step that contains one."""
    drive = f"&drive kind = 'brownian' interval = {interval} temperature = 1 / &stop time = {end} /"
    found = observed(ONE.format(every) + drive + steps)
    velocity = found["/particles/disks/velocity/value"][:, 0]
    changed = np.flatnonzero((velocity[1:] != velocity[:-1]).any(axis=1)) + 1
    assert changed.tolist() == list(kicked)
    assert found["/observables/collisions/value"][-1] == 0


def test_energy_balances_where_kinetic_and_potential_energy_cancel(observed):
    """The total energy of many disks is much smaller than its parts, but just as accurate."""
    found = observed(
        """&box lower = -0.5, 9.5 upper = 0.5, 10.5 gravity = 0, 0.1 /
        &species count = 5000 packing_fraction = 0.1 temperature = 1 /
        &drive kind = 'andersen' interval = 1e-5 fraction = 0.01 temperature = 1 /
        &stop time = 1e-4 / &output observables_every_time = 1e-5 /"""
    )
    names = ("total_energy", "drive_energy", "dissipated_energy")
    total, given, lost = (found[f"/observables/{name}/value"] for name in names)
    assert abs(total).max() < 500 and abs(given).max() > 1
    assert np.ptp(total + lost - given) <= 1e-16 * 10_000  # rounding errors of both


def test_what_was_met_last_is_met_again_after_a_kick(observed):
    """Two touching disks are driven against each other repeatedly, and no collision is missed."""
    found = observed(
        "&species count = 2 radius = 0.1 position = 0.1, 0.5, 0.3, 0.5 /"
        "&box upper = 0.400001, 1 / &contact restitution = 0.99 contact_time = 1e-12 /"
        "&drive kind = 'brownian' interval = 1e-3 temperature = 1 / &stop time = 1 /"
        "&output frames_every_time = 1e-3 observables_every_time = 1e-3 /"
    )
    assert list(laws_broken(found)) == []


def test_the_kicks_of_a_disk_are_its_own(observed):
    """The kicks of a disk do not depend on other disks, or on its place in memory."""
    drive = "&drive kind = 'brownian' interval = 0.1 temperature = 1e-4 / &stop time = 1 /"
    disk = "&species count = 1 radius = 0.01 position = 0.9, 0.9 /"
    others = "&species grid = 20, 20 radius = 0.01 region = 0, 0.8, 0, 0.8 /"
    alone, among = (
        observed(text)["/particles/disks/velocity/value"][-1, 0]
        for text in (disk + drive, disk + others + drive)
    )
    assert alone.tolist() == among.tolist()


def test_a_gas_at_rest_waits_for_its_kick(performed):
    """A run of disks at rest ends correctly after the first kick, without a time limit."""
    drive = "&drive kind = 'noise' interval = 7 strength = 1 / &stop collisions = 1000 /"
    _, said = performed("&species count = 100 radius = 0.01 /" + drive)
    assert "note" not in said and "kicks = 1\n" in said and "collisions = 1000\n" in said


def test_a_driven_gas_does_not_end_for_being_cold(performed):
    """Between kicks the temperature may fall below 1e-25 of its initial value."""
    _, said = performed(
        "&box boundary = 'periodic', 'periodic' /"
        "&species count = 50 packing_fraction = 0.4 temperature = 1 /"
        "&contact restitution = 0.7 contact_time = 1e-9 / &stop time = 2e16 /"
        "&drive kind = 'noise' interval = 1e16 strength = 1e-60 /"
    )
    assert "note" not in said and "time = 2e16" in said


CHIRAL = """&box upper = 100, 100 boundary = 'periodic', 'periodic' /
&species count = {} radius = 1e-6 temperature = 1 /
&drive kind = 'active' temperature = 0 interval = {} self_propulsion_speed = {}
rotational_diffusion = {} turning_rate = {} /
&stop time = {} / &output frames_every_time = {} /
"""


def test_chiral_disks_move_on_circles(run_of):
    """Without diffusion and heat, a disk moves counter-clockwise on a regular polygon."""
    interval, speed, rate = 0.1, 1.5, 2 * np.pi / 5
    run = run_of(CHIRAL.format(3, interval, speed, 0, rate, 10.1, interval))
    r = run.unwrapped(slice(1, None))
    assert r[50:] == pytest.approx(r[:-50], abs=1e-9)
    middle = r[:50].mean(0)
    radius = speed * interval / (2 * np.sin(rate * interval / 2))
    arm = r - middle
    assert np.linalg.norm(arm, axis=-1) == pytest.approx(radius, abs=1e-9)
    assert (arm[:-1, :, 0] * arm[1:, :, 1] > arm[:-1, :, 1] * arm[1:, :, 0]).all()


def test_chiral_disks_spread_as_predicted(run_of):
    """The mean square displacement is that of n flights in directions u_1 ... u_n.

    <u_i u_j> is the real part of q^|i - j| with q = exp((i rate - diffusion) interval).
    """
    interval, speed, diffusion, rate = 0.1, 1.5, 0.3, -0.8
    run = run_of(CHIRAL.format(1000, interval, speed, diffusion, rate, 100, 1))
    r = run.unwrapped(slice(1, None))
    q = np.exp((1j * rate - diffusion) * interval)
    for lag in (1, 3, 10):
        n = round(lag / interval)
        apart = np.arange(1, n)
        together = n + 2 * ((n - apart) * q**apart).sum().real
        measured = ((r[lag:] - r[:-lag]) ** 2).sum(-1).mean()
        error = np.sqrt(2 * max(lag, 1 / diffusion) / r[:, :, 0].size)
        assert measured == pytest.approx((speed * interval) ** 2 * together, rel=4 * error)


# --- recycling: disks that jump from one region to another ---

FALLING = """&run seed = 4 /
&box lower = -1, 2 upper = 1, 5 gravity = 0, -1 boundary = '{}', 'wall' /
&species name = 'a' count = 60 radius = 0.03 mass = 2 region = -1, 1, 3, 5 temperature = 0.1 /
&species name = 'b' count = 20 radius = 0.06 region = -1, 1, 3, 5 /
&drive kind = 'recycle' interval = 0.25 from_region = -0.9, 0.9, 2, 2.4 to_region = -1, 1, 4, 5 {} /
&contact restitution = 0.9 contact_time = 1e-4 tangential_restitution = 0.2 /
&stop time = 10 / &output frames_every_time = 0.25 observables_every_time = 0.25 /
"""


def recycled_now(found) -> np.ndarray:
    """Return which disks (T - 1, N) were recycled between each frame and the next."""
    return np.diff(found["/particles/disks/recycled/value"], axis=0) > 0


@pytest.mark.parametrize("side", ["wall", "periodic"])
def test_disks_in_one_region_continue_in_the_other(observed, side):
    """Frames at the times of recycling show each recycled disk, and no other, in a new place."""
    found = observed(FALLING.format(side, "velocity = 0.5, -2 species = 'a'"))
    x, v, spin = (
        found[f"/particles/disks/{name}/value"]
        for name in ("position", "velocity", "angular_velocity")
    )
    now = recycled_now(found)
    inset = np.where(side == "wall", 0.03, 0), 0.03
    assert now.sum() > 100 and not now[:, 60:].any(), "only species a is recycled"
    places = x[1:][now]
    assert np.all(places >= [-1 + inset[0], 4.03]) and np.all(places <= [1 - inset[0], 4.97])
    assert np.all(v[1:][now] == [0.5, -2]) and np.all(spin[1:][now] == 0)
    inside = np.all((x[1:, :60] >= [-0.9, 2]) & (x[1:, :60] <= [0.9, 2.4]), axis=-1)
    assert not inside.any(), "every disk finds a place"
    total = found["/observables/recycled/value"]
    assert (total == found["/particles/disks/recycled/value"].sum(axis=1)).all()
    assert list(laws_broken(found)) == []
    if side == "periodic":
        assert not found["/particles/disks/image/value"][1:][now].any()


def test_recycled_disks_have_the_temperature_of_the_drive(observed):
    """Their velocities and spins are Gaussian, their positions uniform in the region."""
    text = FALLING.format("wall", "temperature = 3").replace("time = 10", "time = 60")
    found = observed(text)
    now = recycled_now(found)
    mass, radius = (found[f"/particles/disks/{name}"] for name in ("mass", "radius"))
    rows, disks = np.nonzero(now)
    v = found["/particles/disks/velocity/value"][1:][now] * np.sqrt(mass[disks] / 3)[:, None]
    inertia = mass[disks] * radius[disks] ** 2 / 2
    spin = found["/particles/disks/angular_velocity/value"][1:][now] * np.sqrt(inertia / 3)
    several = 4 / np.sqrt(len(rows))
    assert len(rows) > 500
    assert v.mean(axis=0) == pytest.approx([0, 0], abs=several)
    assert v.var(axis=0) == pytest.approx([1, 1], abs=1.5 * several)
    assert spin.var() == pytest.approx(1, abs=1.5 * several)
    places = found["/particles/disks/position/value"][1:][now][:, 0] / (1 - radius[disks])
    assert places.mean() == pytest.approx(0, abs=several)
    assert places.var() == pytest.approx(1 / 3, abs=several)


def test_disks_wait_until_there_is_room(observed):
    """A disk without a free place waits, and moves when the disk in its way has gone."""
    found = observed(
        """&box upper = 6, 1 /
        &species name = 'a' radius = 0.4 position = 0.6, 0.5 /
        &species name = 'b' radius = 0.4 position = 2.6, 0.5 velocity = 0.25, 0 /
        &drive kind = 'recycle' interval = 1 species = 'a' velocity = 0, 0
        from_region = 0, 1, 0, 1 to_region = 2.1, 3.1, 0, 1 / &stop time = 4 /
        &output frames_every_time = 1 observables_every_time = 1 /"""
    )
    assert found["/observables/recycled/value"].tolist() == [0, 0, 0, 1, 1]
    x = found["/particles/disks/position/value"]
    assert (x[:3, 0] == [0.6, 0.5]).all() and 2.5 <= x[3, 0, 0] <= 2.7
    assert np.linalg.norm(x[3, 0] - x[3, 1]) >= 0.8


def test_a_recycled_disk_has_no_last_contact(observed):
    """A disk hits the floor immediately after being recycled, and loses energy there."""
    found = observed(
        """&species count = 1 radius = 0.1 position = 0.5, 0.2 velocity = 0, -1 /
        &contact restitution = 0.5 contact_time = 10 / &output frames_every_events = 1 /
        &drive kind = 'recycle' interval = 0.2 velocity = 0, -4 from_region = 0, 1, 0, 0.3
        to_region = 0, 1, 0.5, 0.75 / &stop events = 2 /"""
    )
    v = found["/particles/disks/velocity/value"][:, 0, 1]
    assert v.tolist() == [-1, 0.5, 2]


def test_disks_at_rest_outside_the_region_end_the_run(performed):
    """A run without a time limit ends if no disk moves and none can be recycled."""
    _, said = performed(
        """&species count = 2 radius = 0.1 position = 0.5, 0.5, 0.5, 0.1 /
        &drive kind = 'recycle' interval = 0.3 velocity = 0, 0 from_region = 0, 1, 0, 0.2
        to_region = 0, 1, 0.7, 1 / &stop events = 10 /"""
    )
    assert "recycled = 1\n" in said and "kicks = 1\n" in said and "no further events" in said


# --- moving sides, and collision rules of walls ---

BOUNCE = """&box gravity = 0, -1 upper = 1, 1000 /
&side name = 'bottom' motion = 'sine' amplitude = 0.03 period = 1 restitution = 0.8 /
&species count = 1 radius = 0.1 position = 0.5, 0.7 /
&stop events = 8 / &output frames_every_events = 1 /
"""


def test_a_disk_between_two_walls_knows_them_apart(observed):
    """The left wall halves the speed of the disk, the right wall conserves it."""
    found = observed(
        """&side name = 'left' restitution = 0.5 / &species count = 1 radius = 0.1
        position = 0.5, 0.5 velocity = 1, 0 / &stop time = 6 / &output frames_every_events = 1 /"""
    )
    v = found["/particles/disks/velocity/value"][:, 0, 0]
    assert v[:5].tolist() == [1, -1, 0.5, -0.5, 0.25]
    assert found["/observables/sides/left/energy_to_disks/value"][-1] == (v[-1] ** 2 - 1) / 2


@pytest.mark.parametrize(
    "law",
    [
        "restitution = 0",
        "temperature = 9 surface_velocity = 5",
        "tangential_restitution = 0.5 friction = 1",
    ],
)
def test_disks_grow_between_walls_whatever_their_law(observed, law):
    """The initial positions of `dense` disks do not depend on the collision rules of walls."""
    places = [
        observed(
            f"&obstacle centre = 0.5, 0.5 radius = 0.2 {words} /"
            f"&wall from = 0.1, 0.9 to = 0.9, 0.9 {words} / &contact wall_rule = 'normal' /"
            "&species count = 40 packing_fraction = 0.4 placement = 'dense' temperature = 1 /"
            "&stop collisions = 1 / &output frames_every_collisions = 1 /"
        )["/particles/disks/position/value"][0]
        for words in ("", law)
    ]
    assert (places[0] == places[1]).all()


@pytest.mark.parametrize("dynamics", ["events", "steps"])
def test_a_side_shakes_a_bed_at_rest(observed, dynamics):
    """All disks are at rest without gravity, so that the moving side causes the first event."""
    found = observed(
        """&side name = 'bottom' motion = 'sine' amplitude = 0.05 period = 1 /
        &run dt = 1e-3 / &species count = 300 radius = 0.02 / &stop time = 3 /""".replace(
            "dt", f"dynamics = '{dynamics}' dt"
        )
    )
    assert found["/observables/all/kinetic_energy/value"][-1] > 0
    assert found["/observables/work/value"][-1] > 0


def test_a_side_that_crushes_disks_ends_the_run(ricochet, tmp_path):
    """If a side compresses the disks beyond jamming, the run ends with an error."""
    write_input(
        tmp_path,
        """&side name = 'right' motion = 'constant_velocity' velocity = 0.5 end_time = 1 /
        &stop time = 3 /
        &species count = 40 packing_fraction = 0.45 temperature = 1 /""",
    )
    run = ricochet("gas.nml", "-o", "gas.h5")
    assert run.returncode == BROKEN and "the side crushes the disks" in one_line(run)


def test_a_stroke_goes_from_begin_to_end_and_stays(observed):
    """A disk hits the side before and during its motion."""
    found = observed(
        """&side name = 'right' motion = 'constant_velocity' velocity = -0.5
        start_time = 1 end_time = 4 /
        &species radius = 0.1 position = 0.5, 0.5 velocity = 1, 0 / &stop time = 12 /
        &output frames_every_events = 1 observables_every_time = 2 /"""
    )
    assert found["/observables/sides/right/position/value"].tolist()[:3] == [1, 1.5, 2.5]
    assert found["/observables/sides/right/velocity/value"].tolist()[:3] == [0, -0.5, 0]
    v = found["/particles/disks/velocity/value"][:, 0, 0]
    assert v[:4].tolist() == [1, -1, 1, 0]


@pytest.mark.parametrize("placement", ["random", "dense", "grid"])
def test_sides_start_where_their_position_is(observed, placement):
    """Sides start at `position`, and all disks start and remain between the sides."""
    grid = " grid = 15, 6 region = 0.2, 1.5, -0.3, 0.8" * (placement == "grid")
    found = observed(
        f"""&box upper = 2, 1 / &side name = 'right' position = 1.5 /
        &side name = 'left' motion = 'constant_velocity' position = 0.2
        velocity = 0.1 start_time = 1 end_time = 3 /
        &side name = 'top' motion = 'piston' position = 0.8 mass = 10 force = 0 /
        &side name = 'bottom' position = -0.3 temperature = 1 /
        &species count = 90 radius = 0.02 temperature = 1 placement = '{placement}'{grid} /
        &stop time = 5 / &output frames_every_time = 0.5 observables_every_time = 0.5 /"""
    )
    places = {
        name: np.ravel(found[f"/observables/sides/{name}/position/value"])
        for name in ("left", "right", "bottom", "top")
    }
    assert places["right"].tolist() == [1.5] * 11 and places["bottom"].tolist() == [-0.3] * 11
    expected = 0.2 + 0.1 * np.clip(np.arange(11) / 2 - 1, 0, 2)
    assert places["left"] == pytest.approx(expected, abs=1e-15)
    assert places["top"][0] == 0.8 and np.all(np.diff(places["top"]) > 0), "only the gas pushes"
    v = np.ravel(found["/observables/sides/top/velocity/value"])
    impulse = found["/observables/sides/top/impulse/value"][:, 1]
    assert 10 * -v == pytest.approx(impulse, rel=1e-12)
    x = found["/particles/disks/position/value"]
    for axis, (low, high) in enumerate([("left", "right"), ("bottom", "top")]):
        assert np.all(x[..., axis] > places[low][:, None] + 0.02 - 1e-12)
        assert np.all(x[..., axis] < places[high][:, None] - 0.02 + 1e-12)
    assert not list(laws_broken(found))


def test_disks_meet_wherever_a_side_that_they_push_goes(observed):
    """All collisions occur even if a piston moves far outside the initial box."""
    cells, pairs = (
        observed(
            f"""&run search = '{search}' /
            &side name = 'right' motion = 'piston' mass = 20 force = 1 /
            &side name = 'left' motion = 'constant_velocity' velocity = 0.01 end_time = 50 /
            &species count = 40 radius = 0.03 speed = 1 / &stop time = 50 /
            &species count = 2 radius = 0.1 speed = 1 / &output frames_every_time = 1 /"""
        )["/particles/disks/position/value"]
        for search in ("cells", "pairs")
    )
    assert cells[:, :, 0].max() > 5 and (cells == pairs).all()


def test_a_side_that_disks_push_keeps_momentum_and_energy(observed):
    """The balances of momentum and energy include disks, piston, force and dissipation."""
    found = observed(
        """&box upper = 2, 1 / &side name = 'right' motion = 'piston' mass = 20 force = 300 /
        &species count = 200 packing_fraction = 0.2 temperature = 1 / &stop time = 4 /
        &contact restitution = 0.99 wall_restitution = 1 /
        &output observables_every_time = 0.02 /"""
    )
    names = ("position", "velocity", "impulse")
    place, v, impulse = (found[f"/observables/sides/right/{name}/value"] for name in names)
    time = found["/observables/total_energy/time"]
    energy, lost, work = (
        found[f"/observables/{name}/value"]
        for name in ("total_energy", "dissipated_energy", "work")
    )
    v, place = np.ravel(v), np.ravel(place)
    whole = energy + lost + 10 * v**2 + 300 * place
    assert whole == pytest.approx(whole[0], rel=1e-12)
    assert energy + lost - work == pytest.approx(energy[0], rel=1e-12)
    pushed = 300 * time - impulse[:, 0]
    assert 20 * v == pytest.approx(pushed, abs=1e-12 * impulse[-1, 0])
    assert np.ptp(place) > 0.1 and lost[-1] > 0.01 * energy[0]


def test_time_steps_come_close_to_events(observed):
    """With a small time step, a disk bounces on a moving floor at the event-driven times."""
    times = [
        observed(BOUNCE, *options)["/particles/disks/velocity/time"][1:6]
        for options in ([], ["run.dynamics=steps", "run.dt=1e-5"])
    ]
    assert times[1] == pytest.approx(times[0], abs=1e-3)


SHAKEN = "&side name = 'bottom' motion = '{}' amplitude = 0.02 period = 0.3 /"
BOWL = "&obstacle side = 'inside' centre = 0.5, 0.5 radius = 0.5 /"
RAMP = "&wall from = 0, 0.3 to = 1, 0.1 /"


@pytest.mark.parametrize("on", [SHAKEN.format("sine"), SHAKEN.format("parabolic"), BOWL, RAMP])
@pytest.mark.parametrize("lossy", [0, 0.5])
def test_disks_rest_on_what_has_restitution_0(observed, on, lossy):
    """Disks at rest on a surface with restitution 0 do not overlap, and the run continues."""
    found = observed(
        f"""{on} &box gravity = 0, -1 / &contact contact_time = 1e-3
        restitution = {lossy} wall_restitution = 0 wall_rule = 'normal' / &stop time = 3 /
        &species count = 60 radius = 0.02 temperature = 1 region = 0.2, 0.8, 0.4, 0.8 /"""
    )
    assert found["/particles/disks/event_count/value"][-1].sum() < 3 * 60 * 3 / 1e-3
    assert list(laws_broken(found)) == []


FLOOR = "gravity = 0, -1 / &side name = 'bottom' period = 1 motion = '{}"
PRESSED = """lower = -1.5, 10 upper = 1.5, 11 /
&side name = 'left' motion = 'piston' mass = {} force = {} restitution = 0.6"""


@pytest.mark.parametrize(
    ("floor", "disk"),
    # It chatters to rest on a floor that accelerates less than gravity, or if it has no room, or if
    # a force presses a side against it.
    [
        # a side that a force presses against the disk does
        (FLOOR.format("sine' amplitude = 0.01"), "0.1 position = 0.5, 0.3"),
        (FLOOR.format("parabolic' amplitude = 0.01"), "0.1 position = 0.5, 0.3"),
        (FLOOR.format("sine' amplitude = 0.5"), "0.3 position = 0.5, 0.6"),
        (PRESSED.format(0.3, 0.5), "0.1 position = -1.3, 10.5"),
        (PRESSED.format(0.01, 1), "0.1 position = 0.3, 10.4"),
    ],
)
@pytest.mark.parametrize("law", ["", "restitution_law = 'power' reference_speed = 1"])
def test_chattering_and_crushing_is_a_collapse(ricochet, tmp_path, floor, disk, law):
    write_input(
        tmp_path,
        f"&box {floor} / &contact restitution = 0.5 {law} / &species radius = {disk} /"
        "&stop time = 20 /",
    )
    run = ricochet("gas.nml", "-o", "gas.h5")
    assert run.returncode == BROKEN and "inelastic collapse" in one_line(run)


def test_noise_leaves_the_centre_of_mass_alone_unless_told_otherwise(ricochet, tmp_path):
    text = """&box boundary = 'periodic', 'periodic' / &species count = 30 radius = .02 /
        &drive kind = 'noise' interval = .01 strength = 1 / &stop time = 1 /"""
    for setting, kept in (([], True), (["--set", "drive.keep_momentum=.false."], False)):
        path = write_input(tmp_path, text)
        assert ricochet(path, *setting, "--force", "-o", "run.h5").returncode == FINISHED
        momentum = read_run(tmp_path / "run.h5").observable("momentum").value
        assert (np.ptp(momentum, axis=0).max() < 1e-9) == kept
