"""Section 12 of the report: billiards."""

import atexit
from functools import cache, partial
from math import pi, radians
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ricochet import Run

from .case import Case, Member, relative, sigmas, within
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
    """Return the polar angles of the collisions, continuous across 2 pi."""
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

    The distances of the disk from the two walls are independent of each other.  Each is the height
    of a ball that bounces on a floor with the acceleration g / sqrt(2).
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
    """Return the mean free path: the length of the path, at speed 1, per collision."""
    return run.time[-1] / (last(run, "side_collisions") + last(run, "obstacle_collisions"))


def mean_path(radius: float, hole: float) -> float:
    """Return the exact mean free path pi Q / p in the unit box with one scatterer.

    Q and p are the area and the perimeter of the region that the centre of the disk can reach.
    """
    a, reach = 1 - 2 * radius, hole + radius
    return pi * (a**2 - pi * reach**2) / (4 * a + 2 * pi * reach)


#: A random Lorentz gas: number of scatterers, which may overlap, per area R^2, where R = 1 is the
#: sum of the radii; number of scatterers; radius of the tracer, whose speed is 1.
DENSITY, SCATTERERS, TRACER = 0.01, 100_000, 0.1
FREE_TIME = 1 / (2 * DENSITY)  # exact, because overlaps hide the same fraction of rims and area


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
    """Return a run of one tracer with a frame every ten mean free times."""
    side = float(np.sqrt(SCATTERERS / DENSITY))
    return namelist(
        run={"seed": seed}, box={"upper": (side, side), **PERIODIC},
        obstacle={"name": "scatterers", "file": scatterers()},
        species={"name": "tracer", "count": 1, "radius": TRACER, "speed": 1.0},
        stop={"events": 2_000_000}, output={"frames_every_time": 10 * FREE_TIME},
    )  # fmt: skip


LORENTZ = tuple(Member(partial(among_scatterers, seed)) for seed in range(1, 5))


def free_time(run: Run) -> float:
    """Return the mean time between the collisions of a tracer."""
    return run.time[-1] / last(run, "obstacle_collisions")


def over_boltzmann(run: Run) -> float:
    """Return D / D_0 from the slope of <dx^2> between 10 and 30 mean free times."""
    x = run.position[:][:-1, 0] + run.image[:][:-1, 0] * run.edges  # the last frame is at the end
    near, far = (np.mean(np.sum((x[lag:] - x[:-lag]) ** 2, axis=1)) for lag in (1, 3))
    return float((far - near) / (4 * 20 * FREE_TIME) / (3 / (16 * DENSITY)))


def boltzmann_over(n: float) -> float:
    """Return D_0 / D for scatterers that may overlap, from the expansion in their density.

    The coefficients are quoted from memory.
    """
    return 1 - 4 / 3 * n * np.log(n) - 0.8775 * n + 4.519 * (n * np.log(n)) ** 2


STEP = radians(150.733419431936)
CASES = [
    Case(
        "P12-01", "round container: first hit, place; interval; polar step",
        (ROUND,),
        lambda run: [
            run.event_log().time[0], *run.position[1][0], np.diff(run.event_log().time[:2])[0],
            np.diff(angles(run)[:2])[0],
        ],
        [0.739184421103839, 0.743510652662303, 0.591347536883071, 1.83836884220768, STEP],
        relative(1e-12), "D",
    ),
    Case(
        "P12-02", "round container, 100 further hits: angular momentum, polar steps",
        (ROUND,), lambda run: [*(angular_momentum(run) / 0.24), *(np.diff(angles(run)) / STEP)],
        1, within(1e-9), "D",
    ),
    Case(
        "P12-02", "round container, hit 101: time and polar angle",
        (ROUND,), lambda run: [run.event_log().time[100], angles(run)[100] % (2 * pi)],
        [184.576068641872, 6.14074471547], relative(1e-9), "D",
    ),
    Case(
        "W1-01", "right-angled wedge of two straight walls under gravity, 160 hits: path",
        (FALL,), miss, 0, within(1e-10), "two independent bouncing balls",
    ),
    Case(
        "W1-03", "the wedge with time steps of 1e-5, 8 hits: path",
        (STEPS,), miss, 0, within(1e-3), "two independent bouncing balls",
    ),
    Case(
        "P12-03", "Sinai's billiard, 2e6 hits: mean free path",
        (SINAI,), free_path, mean_path(DISK, HOLE), relative(0.005), "Santalo; Chernov 1997",
    ),
    Case(
        "P12-04", "light disk about a very heavy one: hits per time on disk and sides",
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
        "P12-06", "random Lorentz gas, n R^2 = .01: diffusion over Boltzmann's",
        LORENTZ, over(over_boltzmann), 1 / boltzmann_over(DENSITY), within(0.015),
        "Weijland and van Leeuwen 1968, quoted from memory",
    ),
]  # fmt: skip
