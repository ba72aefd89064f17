"""Section 12 of the report: billiards."""

import atexit
from functools import cache, partial
from math import acos, cos, log, pi, radians, sin, sqrt
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ricochet import Run

from .case import AT_MOST, Case, Member, relative, sigmas, within
from .estimators import angular_momentum, over
from .inputs import EVERY_EVENT, PERIODIC, disk, namelist

CONTAINER = {
    "box": {"lower": (-1, -1), "upper": (1, 1)},
    "obstacle": {"centre": (0, 0), "radius": 1.0, "side": "inside"},
}

ROUND = Member(
    namelist(
        **CONTAINER, species=disk((0.3, 0), (0.6, 0.8), 0.05),
        stop={"events": 101}, output=EVERY_EVENT,
    )
)  # fmt: skip


def angles(run: Run) -> np.ndarray:
    """Return the polar angles of the collisions, unwrapped."""
    x = run.position[1 : len(run.event_log().time) + 1][:, 0]
    return np.unwrap(np.arctan2(x[:, 1], x[:, 0]))


DISK, HOLE = 0.01, 0.25
SINAI = Member(
    namelist(
        obstacle={"centre": (0.5, 0.5), "radius": HOLE},
        species=disk((0.1, 0.2), (0.8, 0.6), DISK),
        stop={"events": 2_000_000},
    )
)
HEAVY = Member(
    namelist(
        species=[
            {"name": "heavy", **disk((0.5, 0.5), (0, 0), 0.2, 1e15)},
            {"name": "light", **disk((0.1, 0.2), (0.8, 0.6), 0.01)},
        ],
        stop={"collisions": 1_000_000},
    )
)


APEX, START, PUSH, RIM = np.array((2, 1)), np.array((2.3, 2)), np.array((0.1, 0)), 0.1
WEDGE = {
    "box": {"upper": (4, 3), "gravity": (0, -1)},
    "wall": [{"from": (0.5, 2.5), "to": (2, 1)}, {"from": (2, 1), "to": (3.5, 2.5)}],
    "species": disk(tuple(START), tuple(PUSH), RIM),
}
FALL = Member(namelist(**WEDGE, stop={"time": 200}, output={"frames_every_time": 0.05}))
STEPS = Member(
    namelist(
        **WEDGE, run={"dynamics": "steps", "dt": 1e-5}, stop={"time": 10},
        output={"frames_every_time": 0.05},
    )
)  # fmt: skip


def miss(run: Run) -> float:
    """Return the largest deviation from the exact path in a right-angled wedge under gravity.

    The distances of the disk from the two walls are independent of each other. Each is the height
    of a ball that bounces on a floor under the gravitational acceleration g / sqrt(2).
    """
    t, x = run.time, run.position[:][:, 0]
    normals = np.array(((-1, 1), (1, 1))) / np.sqrt(2)
    g, errors = 1 / np.sqrt(2), []
    for normal in normals:
        height, speed = (START - APEX) @ normal - RIM, PUSH @ normal
        fastest = np.sqrt(speed**2 + 2 * g * height)
        since = np.mod(t + (fastest - speed) / g, 2 * fastest / g)
        exact = fastest * since - g * since**2 / 2
        errors.append((x - APEX) @ normal - RIM - exact)
    return float(np.hypot(*errors).max())


def last(run: Run, name: str) -> float:
    """Return the last value of an observable, summed over its components."""
    return float(np.sum(run.observable(name).value[-1]))


def free_path(run: Run) -> float:
    """Return the mean free path: path length per collision, at speed 1."""
    return run.time[-1] / (last(run, "side_collisions") + last(run, "obstacle_collisions"))


def mean_path(radius: float, hole: float) -> float:
    """Return the exact mean free path pi Q / p in the unit box with one scatterer.

    Q and p are area and perimeter of the region that the centre of the disk can reach.
    """
    a, reach = 1 - 2 * radius, hole + radius
    return pi * (a**2 - pi * reach**2) / (4 * a + 2 * pi * reach)


#: A random Lorentz gas of overlapping scatterers: their number per area R^2, where R = 1 is the sum
#: of the radii; their total number; and the radius of the tracer, which has speed 1.
DENSITY, SCATTERERS, TRACER = 0.01, 100_000, 0.1
FREE_TIME = 1 / (2 * DENSITY)  # exact, because overlaps hide the same fraction of rims and of area


@cache
def scatterers() -> str:
    """Return the path of a file of random circles, which is removed when this process ends."""
    folder = TemporaryDirectory()
    atexit.register(folder.cleanup)
    path = Path(folder.name) / "scatterers.txt"
    side = np.sqrt(SCATTERERS / DENSITY)
    places = np.random.default_rng(7).uniform(0, side, (SCATTERERS, 2))
    rows = np.column_stack([places, np.full(SCATTERERS, 1 - TRACER)])
    np.savetxt(path, rows, fmt="%.12g", header="x y radius", comments="")
    return str(path)


def among_scatterers(seed: int) -> str:
    """Return the input of one tracer, with a frame every ten mean free times."""
    side = float(np.sqrt(SCATTERERS / DENSITY))
    return namelist(
        run={"seed": seed}, box={"upper": (side, side), **PERIODIC},
        obstacle={"name": "scatterers", "file": scatterers()},
        species={"name": "tracer", "count": 1, "radius": TRACER, "speed": 1.0},
        stop={"events": 2_000_000}, output={"frames_every_time": 10 * FREE_TIME},
    )  # fmt: skip


LORENTZ = tuple(Member(partial(among_scatterers, seed)) for seed in range(1, 5))


def free_time(run: Run) -> float:
    """Return the mean time between collisions of a tracer."""
    return run.time[-1] / last(run, "obstacle_collisions")


def over_boltzmann(run: Run) -> float:
    """Return D / D_0 from the slope of <dx^2> between 10 and 30 mean free times."""
    # the last frame is at the end of the run
    x = run.position[:][:-1, 0] + run.image[:][:-1, 0] * run.edges
    near, far = (np.mean(np.sum((x[lag:] - x[:-lag]) ** 2, axis=1)) for lag in (1, 3))
    return float((far - near) / (4 * 20 * FREE_TIME) / (3 / (16 * DENSITY)))


def boltzmann_over(n: float) -> float:
    """Return D_0 / D for overlapping scatterers, from the expansion in their density.

    The coefficients are quoted from memory.
    """
    return 1 - 4 / 3 * n * np.log(n) - 0.8775 * n + 4.519 * (n * np.log(n)) ** 2


# --- billiards with arcs ---

#: Radius of the disk in billiards with arcs. The radii of the arcs exceed 1 by BALL, so that the
#: centre of the disk moves in a billiard with half circles of radius 1.
BALL = 0.001
RIM_OF_ARC = 1 + BALL


def arc(name: str, centre: tuple, first: float) -> dict:
    """Return a half circle with the given centre, starting at the given angle."""
    angles = {"from_angle": first, "to_angle": first + 180}
    return {"name": name, "centre": centre, "radius": RIM_OF_ARC, **angles}


def stadium(velocity: tuple, events: int) -> Member:
    """Return a run in a stadium: half circles of radius 1, joined by straight lines of length 2."""
    lines = [{"from": (-1, y), "to": (1, y)} for y in (-RIM_OF_ARC, RIM_OF_ARC)]
    return Member(
        namelist(
            box={"lower": (-2.2, -1.2), "upper": (2.2, 1.2)}, wall=lines,
            obstacle=[arc("left", (-1, 0), 90), arc("right", (1, 0), -90)],
            species=disk((0.25, 0), velocity, BALL),
            stop={"events": events}, output={"event_log": True},
        )
    )  # fmt: skip


STADIUM = stadium((cos(1.0), sin(1.0)), 2_000_000)
ALONG_AXIS = stadium((1, 0), 1001)
#: pi times area over perimeter of the region that the centre of the disk can reach.
STADIUM_PATH = pi * (4 + pi) / (4 + 2 * pi)
#: The path along the long axis, of length 4 between the arcs, has a stability matrix with the trace
#: 2 - 2 * 4 / 1 = -6, and thus the stretching factor 3 + sqrt(8) per collision.
AXIS_EXPONENT = log(3 + sqrt(8)) / 4


def stretching(run: Run) -> float:
    """Return the Lyapunov exponent of a path with speed 1, measured from the event log.

    A narrow beam around the path has the curvature B. During the time t between collisions, 1/B
    increases by t, and the beam widens by the factor |1 + B t|. At a collision B increases by 2
    k / cos(phi), with k = -1/R at the inner face of an arc and 0 at a wall; the impulse 2 m
    cos(phi) yields phi. See Dellago, Posch and Hoover, Physical Review E 53, 1485 (1996).
    """
    log_, first_wall = run.event_log(), -4 - len(run.obstacles)
    reach = np.array([obstacle.radius - run.radius[0] for obstacle in run.obstacles])
    arcs = (log_.j <= -4) & (log_.j > first_wall)
    inner = reach[np.where(arcs, -4 - log_.j, 0)]
    turn = np.where(arcs, -4 * run.mass[0] / (log_.impulse * inner), 0.0)
    flights = np.diff(log_.time)
    curvature, grown = 1.0, 0.0
    for flight, bend in zip(flights.tolist(), turn.tolist(), strict=False):
        curvature += bend
        factor = 1 + curvature * flight
        grown += log(abs(factor))
        curvature /= factor
    return grown / float(flights.sum())


#: The mushroom: half the width of the stem, and its depth below the cap.
HALF_STEM, DEPTH = 0.4, 1.0
BULGE = BALL**2 * pi / 4


def mushroom(angular_momentum: float, events: int, **output) -> Member:
    """Return a run in a mushroom, on a path of speed 1 with the given angular momentum.

    The centre of the arc is one disk radius above the underside of the cap. The centre of the disk
    therefore moves in an exact half circle of radius 1, in which collisions conserve the magnitude
    of the angular momentum.
    """
    half, rim = HALF_STEM, RIM_OF_ARC
    sides = [(s * rim, BALL, s * rim, 0, s * half, 0, s * half, -DEPTH) for s in (-1, 1)]
    across = angular_momentum / 0.6
    return Member(
        namelist(
            box={"lower": (-1.2, -DEPTH), "upper": (1.2, 1.2)},
            obstacle=arc("cap", (0, BALL), 0),
            wall=[{"name": f"stem{k}", "points": points} for k, points in enumerate(sides)],
            species=disk((0, BALL + 0.6), (across, sqrt(1 - across**2)), BALL),
            stop={"events": events}, output=output,
        )
    )  # fmt: skip


REGULAR = mushroom(HALF_STEM + 0.01, 200_000, frames_every_events=1)
CHAOTIC = mushroom(HALF_STEM - 0.01, 2_000_000, frames_every_events=1)


def about_cap(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return height above the centre of the cap, and magnitude of the angular momentum (F,)."""
    away, velocity = run.position[:][:, 0] - (0, BALL), run.velocity[:][:, 0]
    spin = away[:, 0] * velocity[:, 1] - away[:, 1] * velocity[:, 0]
    return away[:, 1], np.abs(spin)


def regular_path(run: Run) -> list[float]:
    """Return the largest change of the angular momentum, and the collisions in the stem."""
    height, spin = about_cap(run)
    stem = np.sum(height < -1e-9) + np.sum(
        np.abs(run.position[:][:, 0, 0])[height < 1e-9] < HALF_STEM
    )
    return [float(np.ptp(spin)), float(stem)]


def largest_spin(run: Run) -> float:
    """Return the largest angular momentum of a chaotic path after collisions in the cap.

    A path leaves the underside of the cap or the arc with an angular momentum that it keeps until
    it enters the stem.
    """
    height, spin = about_cap(run)
    edge = np.abs(run.position[:][:, 0, 0]) >= HALF_STEM
    return float(spin[(height >= 0) & edge].max())


def share_in_cap(run: Run) -> float:
    """Return the fraction of time that the disk spends in the cap."""
    height, time = run.position[:][:, 0, 1] - BALL, run.time
    low, high = height[:-1], height[1:]
    step = high - low
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.where(step == 0, high >= 0, np.maximum(low, high) / np.abs(step))
    return float(np.sum(np.clip(part, 0, 1) * np.diff(time)) / time[-1])


def chaotic_share() -> float:
    """Return the exact fraction of the chaotic part of phase space that lies in the cap.

    A path in the cap is regular if its angular momentum exceeds half the width b of the stem. For
    R = 1, the regular paths fill an area R^2 arccos(b/R) - b sqrt(R^2 - b^2) times 2 pi of phase
    space. In the stem all paths are chaotic.
    """
    b = HALF_STEM
    cap = pi / 2 - (acos(b) - b * sqrt(1 - b * b))
    neck = 2 * (b * BALL - BULGE)
    return cap / (cap + 2 * (b - BALL) * (DEPTH - BALL) + neck)


STEP = radians(150.733419431936)
CASES = [
    Case(
        "P12-01", "round container: first collision, interval, polar step",
        (ROUND,),
        lambda run: [
            run.event_log().time[0], *run.position[1][0], np.diff(run.event_log().time[:2])[0],
            np.diff(angles(run)[:2])[0],
        ],
        [0.739184421103839, 0.743510652662303, 0.591347536883071, 1.83836884220768, STEP],
        relative(1e-12), "D",
    ),
    Case(
        "P12-02", "round container, 100 collisions: angular momentum, polar steps",
        (ROUND,), lambda run: [*(angular_momentum(run) / 0.24), *(np.diff(angles(run)) / STEP)],
        1, within(1e-9), "D",
    ),
    Case(
        "P12-02", "round container, collision 101: time and polar angle",
        (ROUND,), lambda run: [run.event_log().time[100], angles(run)[100] % (2 * pi)],
        [184.576068641872, 6.14074471547], relative(1e-9), "D",
    ),
    Case(
        "W1-01", "right-angled wedge under gravity, 160 collisions: deviation of the path",
        (FALL,), miss, 0, within(1e-10), "D: two independent bouncing balls",
    ),
    Case(
        "W1-03", "wedge with time steps of 1e-5, 8 collisions: deviation of the path",
        (STEPS,), miss, 0, within(1e-3), "D: two independent bouncing balls",
    ),
    Case(
        "P12-03", "Sinai's billiard, 2e6 collisions: mean free path",
        (SINAI,), free_path, mean_path(DISK, HOLE), relative(0.005), "Santalo; Chernov 1997",
    ),
    Case(
        "P12-04", "light disk around a heavy one: rates of collisions with disk and sides",
        (HEAVY,),
        lambda run: [
            last(run, "collisions") / run.time[-1], last(run, "side_collisions") / run.time[-1]
        ],
        [0.511039, 1.518241], relative(0.005), "D, R",
    ),
    Case(
        "P12-05", "random Lorentz gas of 100 000 scatterers: mean free time",
        LORENTZ, over(free_time), FREE_TIME, sigmas(4, 0.005), "D",
    ),
    Case(
        "P12-06", "random Lorentz gas, n R² = 0.01: diffusion coefficient over Boltzmann's",
        LORENTZ, over(over_boltzmann), 1 / boltzmann_over(DENSITY), within(0.015),
        "Weijland and van Leeuwen 1968, quoted from memory",
    ),
    Case(
        "P12-07", "stadium of two arcs and two walls, 2e6 hits: mean free path",
        (STADIUM,), free_path, STADIUM_PATH, relative(0.005), "Santalo; Chernov 1997",
    ),
    Case(
        "P12-08", "stadium, unstable path along the axis: Lyapunov exponent",
        (ALONG_AXIS,), stretching, AXIS_EXPONENT, relative(1e-3), "D: stretching 3 + sqrt(8)",
    ),
    Case(
        "P12-09", "stadium, straight part as long as the width: Lyapunov exponent",
        (STADIUM,), stretching, 0.43, within(0.01),
        "Benettin and Strelcyn 1978; Dellago and Posch 1995, quoted from memory",
    ),
    Case(
        "P12-10", "mushroom, regular path of 2e5 hits: angular momentum, hits in the stem",
        (REGULAR,), regular_path, 0, within(1e-9), "Bunimovich 2001",
    ),
    Case(
        "P12-11", "mushroom, chaotic path: largest angular momentum in the cap",
        (CHAOTIC,), largest_spin, HALF_STEM, AT_MOST, "Bunimovich 2001",
    ),
    Case(
        "P12-12", "mushroom, chaotic path of 2e6 hits: fraction of time in the cap",
        (CHAOTIC,), share_in_cap, chaotic_share(), relative(0.02), "D: phase-space volumes",
    ),
]  # fmt: skip
