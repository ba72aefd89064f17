"""Section 12: billiards."""

from math import pi, radians

import numpy as np

from ricochet import Run

from .case import Case, Member, relative, within
from .estimators import angular_momentum
from .inputs import EVERY_EVENT, disk, namelist

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
    """Polar angles of the hits, without jumps."""
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
    """Largest distance from the exact path in a right-angled wedge under gravity.

    The heights over the two walls are two balls that bounce on floors of their own, with the
    accelerations g/sqrt 2, and do not know of each other.
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
    """Sum of an observable at the end."""
    return float(np.sum(run.observable(name).value[-1]))


def free_path(run: Run) -> float:
    """Length of the path over the number of hits, speed 1."""
    return run.time[-1] / (last(run, "side_collisions") + last(run, "obstacle_collisions"))


def mean_path(radius: float, hole: float) -> float:
    """Pi Q / p, by area and perimeter open to the centre in the unit box with one scatterer."""
    a, reach = 1 - 2 * radius, hole + radius
    return pi * (a**2 - pi * reach**2) / (4 * a + 2 * pi * reach)


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
]  # fmt: skip
