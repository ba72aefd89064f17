"""Laws of open systems: effusion, escape from billiards, stationary densities, exact balances."""

import math

import numpy as np
import pytest

from ricochet import Simulation, read_run
from synthetic_run import ROOT
from whole_runs import ran

RADIUS = 1e-9  #: of point-like disks, which hardly ever collide


def namelist(*groups: str) -> str:
    """Return an input text with the given groups."""
    return "".join(f"&{group} /\n" for group in groups)


# --- effusion ---


def inside_half_space(t: float, length: float) -> float:
    """Return the fraction of free particles with kT = m = 1 that are still in [0, length].

    They start uniformly distributed, are reflected at 0 and leave at `length`. Unfolded at 0, a
    particle of speed u leaves before t if it starts within u t of the end of an interval of twice
    the length.
    """
    a = t / (2 * length)
    return math.erf(1 / (a * math.sqrt(2))) - a * math.sqrt(2 / math.pi) * -math.expm1(-0.5 / a**2)


@pytest.mark.parametrize("dynamics", ["", " dynamics = 'steps' dt = 0.001"])
def test_an_ideal_gas_flows_out_of_its_box(dynamics):
    """The flux starts at n sqrt(kT/2 pi m), and the number inside obeys the exact law."""
    disks, length = 4000, 2.0
    gas = Simulation(
        namelist(
            f"run {dynamics}",
            f"box upper = {length}, 1",
            "side name = 'right' open = .true.",
            f"species count = {disks} radius = {RADIUS} temperature = 1 mass = 1",
        )
    )
    early = 0.01 * length  # the flux is constant to first order in this time
    flux = disks / length * math.sqrt(1 / (2 * math.pi))
    assert disks * (1 - inside_half_space(early, length)) == pytest.approx(flux * early, rel=1e-12)
    for t in (0.1, 0.5, 1, 3) if not dynamics else (0.1, 0.5):
        share = inside_half_space(t, length)
        left = disks - gas.advance(time=t).observable("inside")
        error = math.sqrt(disks * share * (1 - share))
        assert abs(left - disks * (1 - share)) < 4 * error, t


def test_a_row_of_rods_leaves_like_points_behind_a_line_that_recedes():
    """In the coordinates x_i - 2 i r, rods are points, and the last of k leaves at L - 2 (k - 1) r.

    This is exact at all densities. Points of equal mass pass through each other, and are reflected
    at the closed end.
    """
    rng = np.random.default_rng(5)
    rods, radius, length = 120, 0.003, 1.0
    gaps = rng.dirichlet(np.ones(rods + 1)) * (length - 2 * rods * radius)
    free, v = radius + np.cumsum(gaps)[:-1], rng.normal(size=rods)
    x = free + 2 * radius * np.arange(rods)
    gas = Simulation(
        namelist(
            f"box upper = {length}, 1",
            "side name = 'right' open = .true.",
            f"species radius = {radius} position = {', '.join(f'{a!r}, 0.5' for a in x.tolist())}"
            f" velocity = {', '.join(f'{a!r}, 0' for a in v.tolist())}",
            "output event_log = .true.",
        )
    )
    found = []
    while len(found) < 100:
        gas.advance_by(events=1, on_event=lambda event: event.j != -1 or found.append(event))
    distance = np.where(v > 0, -free, free - 2 * radius)  # to the line at 0, along the way
    for k, event in enumerate(found):
        times = (length - 2 * radius * (rods - k - 1) + distance) / np.abs(v)
        first = int(np.argmin(times))
        assert event.i == rods - k
        assert event.time == pytest.approx(times[first], rel=1e-11)
        distance[first] = np.inf  # this point has left


def open_gas(disks: int, radius: float, door: float, seed: int) -> str:
    """Return a gas between hot walls, in which disks that leave through a small door enter again.

    Disk centres pass a door of the given width between the ends of two walls.
    """
    half = radius + door / 2
    return namelist(
        f"run seed = {seed}",
        *(f"side name = '{name}' temperature = 1" for name in ("left", "bottom", "top")),
        "side name = 'right' open = .true.",
        f"wall from = 1, 0 to = 1, {0.5 - half!r}",
        f"wall from = 1, 1 to = 1, {0.5 + half!r}",
        f"species count = {disks} radius = {radius!r} temperature = 1",
        f"source interval = 0.01 count = {disks} temperature = 1",
    )


def density_at_door(disks: float, radius: float) -> float:
    """Return the density of centres on the line of the door, to second order in the density.

    The density of centres is the activity, n (1 + pi s^2 n) in the middle of a gas of diameter s,
    times the probability that a disk inserted there overlaps with no other. On the line, which is
    s/2 outside the region of the other centres, it can overlap only with centres in a segment. At
    the other walls the density has an excess of (2/3) n^2 s^3 per length for the same reason.
    """
    s, edge = 2 * radius, 1 - 2 * radius
    area, excess = edge**2, 4 * edge * 2 / 3 * s**3
    n = 2 * disks / (area + math.sqrt(area**2 + 4 * excess * disks))
    segment = s**2 * (math.pi / 3 - math.sqrt(3) / 4)
    return n * (1 + n * (math.pi * s**2 - segment))


@pytest.mark.statistics
@pytest.mark.parametrize(
    ("disks", "radius", "door", "time"), [(100, 1e-5, 0.02, 3000), (100, 0.008, 0.006, 10000)]
)
def test_a_gas_flows_through_a_small_opening(disks, radius, door, time):
    """The flux is n sqrt(kT/2 pi m), with the density n of centres on the line of the opening."""
    rates = []
    for seed in range(1, 5):
        gas = Simulation(open_gas(disks, radius, door, seed)).advance(time=10)
        before, inside = gas.observable("sides/right/left"), []
        for k in range(1, 101):
            gas.advance(time=10 + k * time / 100)
            inside.append(gas.observable("inside"))
        flux = density_at_door(np.mean(inside), radius) / math.sqrt(2 * math.pi) * door
        rates.append((gas.observable("sides/right/left") - before) / (time * flux))
    error = 1 / math.sqrt(4 * time * flux)  # of a Poisson process
    assert abs(np.mean(rates) - 1) < 4 * error + 0.01  # and for the finite width of the door


# --- escape from billiards ---


def escapes_from_circle(x: np.ndarray, v: np.ndarray, door: float, until: float) -> np.ndarray:
    """Return when points with speed 1 pass the door of a unit circle (infinity if never).

    The door is an arc of given length around the angle 0. Each bounce increases the polar angle by
    the same amount.
    """
    along = np.sum(x * v, axis=1)
    time = -along + np.sqrt(along**2 + 1 - np.sum(x**2, axis=1))
    spin = x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0]
    end = x + time[:, None] * v
    angle, chord = np.arctan2(end[:, 1], end[:, 0]), 2 * np.sqrt(1 - spin**2)
    step = np.sign(spin) * 2 * np.arccos(np.abs(spin))
    found = np.full(len(x), np.inf)
    while np.any(np.isinf(found) & (time < until)):
        gone = np.isinf(found) & (np.abs((angle + np.pi) % (2 * np.pi) - np.pi) < door / 2)
        found[gone] = time[gone]
        angle, time = angle + step, time + chord
    return found


def circle(disks: int, door: float, seed: int) -> tuple[Simulation, np.ndarray, np.ndarray]:
    """Return disks in a circle with a door, with their positions and velocities."""
    rng = np.random.default_rng(seed)
    angle, turn = 2 * np.pi * rng.random((2, disks))
    x = np.sqrt(rng.random(disks)) * 0.999 * np.array([np.cos(angle), np.sin(angle)])
    x, v = x.T, np.array([np.cos(turn), np.sin(turn)]).T
    half = math.degrees(door / 2)
    sides = [f"side name = '{name}' open = .true." for name in ("left", "right", "bottom", "top")]
    lists = [", ".join(map(repr, array.ravel().tolist())) for array in (x, v)]
    text = namelist(
        "box lower = -1.01, -1.01 upper = 1.01, 1.01",
        *sides,
        f"obstacle centre = 0, 0 radius = 1 from_angle = {half!r} to_angle = {360 - half!r}",
        f"species radius = {RADIUS} position = {lists[0]} velocity = {lists[1]}",
    )
    return Simulation(text), x, v


def test_disks_escape_from_a_circle_at_the_times_of_free_points():
    """A disk departs from the box at a known distance behind the door."""
    door, until = 0.3, 30
    box, x, v = circle(300, door, 2)
    exact = escapes_from_circle(x, v, door, until)
    found = np.full(300, np.inf)

    def record(event):
        if event.impulse == 0 and -3 <= event.j <= 0:
            found[event.i - 1] = event.time

    box.advance(time=until, on_event=record)
    assert np.isfinite(found).sum() > 150
    assert found.size - np.isfinite(found).sum() == box.observable("inside")
    # The box ends 0.01 to 0.43 beyond the circle.
    late = np.isfinite(found)
    assert np.all(found[late] - exact[late] > 0.0099) and np.all(found[late] - exact[late] < 0.9)
    assert np.all(exact[~late] > until - 0.9)


@pytest.mark.statistics
def test_a_circle_empties_as_a_power_law_and_a_stadium_exponentially(program, tmp_path):
    """Late survivors of a circle: 2/(door t), Bunimovich and Dettmann, PRL 94, 100201 (2005).

    In a chaotic billiard of area A they decay with the mean time pi A/(w v) for small doors.
    """
    disks, door = 4000, 0.2
    box, x, v = circle(disks, door, 4)
    exact = escapes_from_circle(x, v, door, 400)
    left = [box.advance(time=t).observable("inside") for t in (100, 200, 400)]
    assert np.abs(left - np.sum(exact[:, None] > [100, 200, 400], axis=0)).max() <= 1
    assert abs(left[2] * door * 400 / disks - 2) < 4 * 2 / math.sqrt(left[2]) + 0.3
    ran(program, ROOT / "input/escape.nml", "-o", "a.h5", "--quiet", cwd=tmp_path, check=True)
    time, inside = read_run(tmp_path / "a.h5").observable("inside")
    early, late = np.searchsorted(-inside, [-1500, -150])
    decay = np.log(inside[early] / inside[late]) / (time[late] - time[early])
    mean_time = math.pi * (1 + math.pi / 4) / 0.05
    assert abs(decay * mean_time - 1) < 4 / math.sqrt(inside[early] - inside[late])


# --- sources ---


def test_a_source_and_an_open_side_reach_a_stationary_number():
    """The mean number inside, and its variance, are the rate of the source times the mean stay.

    All disks have the same velocity, so that each stay is determined by the distance from the open
    side.
    """
    interval, length, start = 0.01, 2.0, 1.0
    gas = Simulation(
        namelist(
            f"box upper = {length}, 1",
            "side name = 'right' open = .true.",
            f"species count = 400 waiting = 400 radius = {RADIUS}",
            f"source interval = {interval} velocity = 1, 0 region = 0, {start}, 0, 1",
        )
    )
    inside = [gas.advance(time=2.005 + 0.5 * k).observable("inside") for k in range(200)]
    age = 0.005 + interval * np.arange(200)
    stays = np.clip((length - age) / start, 0, 1)  # probability of being inside at this age
    mean, variance = stays.sum(), np.sum(stays * (1 - stays))
    assert mean == pytest.approx((length - start / 2) / interval, rel=1e-9)
    assert abs(np.mean(inside) - mean) < 4 * math.sqrt(variance / 50)
    assert np.var(inside) == pytest.approx(variance, rel=0.5)
    assert gas.observable("sources/source1/entered") == 10150
    assert gas.observable("sides/right/left") == 10150 - inside[-1]


def test_a_funnel_is_filled_comes_to_rest_and_runs_empty(program, tmp_path):
    """Each grain that has entered leaves after the outlet opens; energy and numbers balance."""
    ran(program, ROOT / "input/pour.nml", "-o", "a.h5", "--quiet", cwd=tmp_path, check=True)
    run = read_run(tmp_path / "a.h5")
    time, inside = run.observable("inside")
    entered, left = (
        run.observable(name).value for name in ("sources/tap/entered", "sides/bottom/left")
    )
    assert np.array_equal(inside, entered - left)
    early = time < 32
    assert np.array_equal(entered[early], 8 * np.floor(time[early]))
    assert left[time <= 40].max() == 0 and entered[-1] == left[-1] == 250 and time[-1] < 80
    fall = 27.0  # height of the source [grain energy]
    assert run.observable("all/kinetic_energy").value[time == 40][0] < 1e-3 * fall
    terms = {
        name: run.observable(name).value
        for name in ("total_energy", "dissipated_energy", "outflow_energy", "inflow_energy")
    }
    balance = sum(terms.values()) - 2 * terms["inflow_energy"]
    assert np.ptp(balance) < 1e-12 * max(np.abs(value).max() for value in terms.values())
