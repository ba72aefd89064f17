"""Sections 1 to 4 of the report: exact results for one, two and ten disks."""

from dataclasses import replace
from math import log, sqrt

import numpy as np

from ricochet import Run

from .case import EXACT, Case, Member, relative, within
from .estimators import each
from .inputs import EVERY_EVENT, disk, namelist

FALLING = {"upper": (8, 16), "gravity": (0, -9.81)}
SMALL = 0.04


def few(*species: dict, box=None, contact=None, **stop) -> Member:
    """Return a run of a few disks with a frame and a log entry at every event."""
    groups = {"box": box or {}, "contact": contact or {}}
    return Member(namelist(species=list(species), stop=stop, output=EVERY_EVENT, **groups))


def final(run: Run) -> np.ndarray:
    """Return the final velocities."""
    return run.velocity[-1].ravel()


# --- one disk ---


def square_path(start=(0.5, 0.25), contact=None, **stop) -> Member:
    """Return a run of a disk whose path between elastic walls closes after four collisions."""
    return few(disk(start, (1, 1), 0.1), contact=contact, **stop)


def dropped(height: float, events: int, speed=(0, 0), contact=None) -> Member:
    """Return a run of a disk falling onto the floor."""
    box = FALLING | {"upper": (40, 16)}
    return few(disk((1, height), speed, SMALL), box=box, contact=contact, events=events)


def impacts(xi: float, count: int) -> np.ndarray:
    """Return the exact times of the impacts after a fall from height 1."""
    flights = np.append(0.5, xi ** np.arange(1, count))
    return 2 * sqrt(2 / 9.81) * np.cumsum(flights)


def until_rest(xi: float) -> int:
    """Return the number of impacts before the first flight shorter than 1e-12."""
    return int(np.ceil(log(1e-12 / (2 * sqrt(2 / 9.81))) / log(xi)))


def dissipating(run: Run) -> int:
    """Return the number of events that dissipated energy."""
    return int(np.sum(np.diff(run.observable("dissipated_energy").value) > 0))


def last_flight(run: Run) -> float:
    """Return the mean duration of the flights after the last energy loss."""
    return float(np.diff(run.event_log().time[dissipating(run) - 1 :]).mean())


def apexes(run: Run) -> np.ndarray:
    """Return the largest heights of the centre, calculated from the speeds after the impacts."""
    return run.position[1:][:, 0, 1] + run.velocity[1:][:, 0, 1] ** 2 / (2 * 9.81)


SLOWED = square_path(contact={"wall_restitution": 0.9}, events=6)
PATH_TIMES = [0.4, 0.677777777777778, 1.35679012345679, 1.69972565157750, 2.53801249809480]
PATH_TIMES += [2.96138969330556]
REST = (0.5, 0.8, 0.9, 0.95)
REST_TIMES = [1.35457092295719, 4.06371276887158, 8.57894917872889, 17.6094219984435]


def bouncing(rule: str = "velocity", vx: float = 0) -> tuple[Member, ...]:
    """Return runs of falling disks with the restitutions `REST`, until they are at rest.

    The exit code is 4, because the last bounces are lower than the spacing of coordinates.
    """
    laws = ({"wall_restitution": xi, "wall_rule": rule} for xi in REST)
    runs = (dropped(1.04, until_rest(law["wall_restitution"]), (vx, 0), law) for law in laws)
    return tuple(replace(run, exit_codes=(0, 4)) for run in runs)


TC = tuple(
    dropped(1.04, 200, contact={"wall_restitution": 0.5, "contact_time": t}) for t in (1e-3, 1e-6)
)


ONE = [
    Case(
        "P1-04", "one disk on a closed path: order and times of the collisions",
        (square_path(events=4),),
        lambda run: [*run.event_log().j, *run.event_log().time],
        [-1, -3, 0, -2, 0.4, 0.65, 1.2, 1.45], within(1e-14), "EX, section B.1",
    ),
    Case(
        "P1-04", "one disk from the centre into the corners: back after 4 collisions",
        (square_path((0.5, 0.5), time=1.6),),
        lambda run: [*run.position[-1][0], *final(run), len(run.event_log().time)],
        [0.5, 0.5, 1, 1, 4], within(1e-14), "EX, section B.1",
    ),
    Case(
        "P1-05", "walls with restitution 0: velocity and number of events",
        (square_path(contact={"wall_restitution": 0}, time=2),),
        lambda run: [*final(run), len(run.event_log().time), run.time[-1]],
        [0, 0, 1, 2], EXACT, "EX, section B.1",
    ),
    Case(
        "P1-06", "walls, rule 'velocity', ξ = 0.9: times of 6 collisions",
        (SLOWED,), lambda run: run.event_log().time, PATH_TIMES, within(1e-13), "D",
    ),
    Case(
        "P1-06", "walls, rule 'velocity', ξ = 0.9: speeds 0.9^k",
        (SLOWED,), lambda run: np.abs(run.velocity[:]).ravel(),
        np.repeat(0.9 ** np.arange(7), 2), within(1e-13), "D",
    ),
    Case(
        "P1-07", "walls, rule 'normal', ξ = 0.9: times of 4 collisions, velocity",
        (square_path(contact={"wall_restitution": 0.9, "wall_rule": "normal"}, events=4),),
        lambda run: [*run.event_log().time, *final(run)],
        [0.4, 0.65, 1.288888888888889, 1.538888888888889, 0.81, 0.81], within(1e-13), "D",
    ),
    Case(
        "P1-08", "elastic bounces from height 1: mean duration of 10 000, all heights",
        (dropped(1.04, 10001),), lambda run: [np.diff(run.event_log().time).mean(), *apexes(run)],
        [0.903047281971462, *[1.04] * 10001], relative(1e-9), "D",
    ),
    Case(
        "P1-10", "disk thrown upwards: time to the ceiling and back, speed there",
        (dropped(SMALL, 2, (0, 20)),),
        lambda run: [run.event_log().time[1], -run.velocity[1][0, 1]],
        [2.16877950901169, 9.36213650829766], relative(1e-12), "D",
    ),
    *[
        Case(
            "P1-12", f"bouncing disk, ξ = {xi}: all impacts until flights last 1e-12",
            (member,), lambda run: run.event_log().time, impacts(xi, until_rest(xi)),
            relative(1e-12), "D",
        )
        for xi, member in zip(REST, bouncing(), strict=True)
    ],
    Case(
        "P1-12", "bouncing disk: comes to rest at t0 (1 + ξ) / (1 - ξ)",
        bouncing(), each(lambda run: run.event_log().time[-1]), REST_TIMES, relative(1e-11), "D",
    ),
    Case(
        "P1-13", "distance until rest, rule 'normal'",
        bouncing("normal", 1), each(lambda run: run.position[-1][0, 0] - 1),
        REST_TIMES, relative(1e-9), "D",
    ),
    Case(
        "P1-13", "distance until rest, rule 'velocity'",
        bouncing("velocity", 1)[:3], each(lambda run: run.position[-1][0, 0] - 1),
        [0.752539401642885, 2.05694103115722, 4.30135679044302], relative(1e-9), "D",
    ),
    Case(
        "P1-14", "TC model, t_c = 1e-3 and 1e-6: number of inelastic impacts",
        TC, each(dissipating), [10, 20], EXACT, "D",
    ),
    Case(
        "P1-14", "TC model, t_c = 1e-3 and 1e-6: final duration of the bounces",
        TC, each(last_flight),
        [8.81882111300256e-4, 8.61212999316656e-7], relative(1e-9), "D",
    ),
    Case(
        "P1-14", "TC model, t_c = 1e-3 and 1e-6: final height of the bounces",
        TC, each(lambda run: run.velocity[-1][0, 1] ** 2 / (2 * 9.81)),
        [0.25**10, 0.25**20], relative(1e-9), "D",
    ),
]  # fmt: skip

# --- two disks ---


UNEQUAL = few(
    disk((0.3, 0.4), (1, 0), 0.05, 1), disk((0.7, 0.45), (-0.5, 0.2), 0.07, 3),
    contact={"restitution": 0.7}, collisions=1,
)  # fmt: skip
MONKEY = few(
    disk((1, 8), (6, 8), SMALL), disk((4, 12), (0, 0), SMALL), box=FALLING, collisions=1
)  # fmt: skip
LAB = few(
    disk((0, 0), (1, 0), 0.1), disk((0.5, 0), (-1, 0), 0.1),
    box={"lower": (-1, -1), "upper": (1, 1)}, events=3,
)  # fmt: skip
NO_MEETING = (
    few(disk((0.25, 0.25), (1, 0), 0.125), disk((0.75, 0.5), (0, 0), 0.125), time=0.5),
    few(disk((0.375, 0.5), (-1, 0), 0.125), disk((0.625, 0.5), (1, 0), 0.125), time=0.125),
    few(disk((0.25, 0.5), (0.5, 0), 0.125), disk((0.5, 0.5), (0.5, 0), 0.125), time=0.5),
)

TWO = [
    Case(
        "P2-04", "two unequal disks, ξ = 0.7: time, velocities, dissipated energy",
        (UNEQUAL,),
        lambda run: [
            run.event_log().time[0], *final(run), run.observable("dissipated_energy").value[-1]
        ],
        [
            0.216327631153395, 0.367472195926245, -0.781276238886498, -0.289157398642082,
            0.460425412962166, 0.11888046875,
        ],
        within(1e-13), "EX, eq. 7 and 11; D",
    ),
    Case(
        "P2-06", "two disks that graze, recede or are at relative rest: number of collisions",
        NO_MEETING, each(lambda run: np.sum(run.event_log().j > 0)),
        [0, 0, 0], EXACT, "EX, eq. 7",
    ),
    Case(
        "P2-07", "two falling disks: time, positions, velocities",
        (MONKEY,),
        lambda run: [run.event_log().time[0], *run.position[-1].ravel(), *final(run)],
        [0.492, 3.952, 10.74867608, 4, 10.81267608, 0, -4.82652, 6, 3.17348],
        within(1e-12), "D",
    ),
    Case(
        "P2-09", "two disks in a box: first three events",
        (LAB,),
        lambda run: [
            *run.event_log().time, *run.position[1][:, 0], *run.velocity[1][:, 0],
            run.position[2][1, 0], run.position[3][0, 0],
        ],
        [0.15, 0.7, 1.2, 0.15, 0.35, -1, 1, 0.9, -0.9], within(1e-14), "LAB; D",
    ),
]  # fmt: skip

# --- scattering ---

B = np.arange(11) / 10
ANGLES = [
    180, 168.52164764374, 156.92605947908, 145.08476095851, 132.84360103361, 119.99995038037,
    106.26014970435, 91.145934714068, 73.739740287755, 51.683820571990, 0,
]  # fmt: skip
SLOWING = [
    -1.999998e-6, -1.979998e-6, -1.919998e-6, -1.819998e-6, -1.679998e-6, -1.499998e-6,
    -1.279998e-6, -1.019999e-6, -7.19999e-7, -3.79999e-7, 0,
]  # fmt: skip


def scattered(b: float) -> Member:
    """Return a run of case P3, with the heavy disk at y = 0, so that `b` is not rounded."""
    heavy, light = disk((0.5, 0), (0, 0), 0.1, 1e6), disk((0.2, b), (1, 0), 0.001)
    return few(heavy, light, box={"lower": (0, -0.5), "upper": (1, 0.5)}, collisions=1, time=0.7)


SCATTERED = tuple(scattered(0.101 * b) for b in B)


def deflection(run: Run) -> float:
    """Return the final direction of the light disk [deg]."""
    return float(np.degrees(np.arctan2(abs(run.velocity[-1][1, 1]), run.velocity[-1][1, 0])))


SCATTERING = [
    Case(
        "P3-01", "scattering angle against impact parameter, finite mass, in degrees",
        SCATTERED, each(deflection),
        ANGLES, within(1e-9), "EX, problem 1; D",
    ),
    Case(
        "P3-01", "ratio of the speeds after and before, minus 1",
        SCATTERED, each(lambda run: run.speed(-1)[1] - 1),
        SLOWING, within(1e-12), "D",
    ),
]  # fmt: skip

# --- rods ---

ROD_X = (0.0523, 0.1517, 0.2231, 0.3529, 0.4119, 0.5037, 0.6311, 0.7079, 0.8237, 0.9311)
ROD_V = (0.9013, -0.3527, 0.6091, -1.1083, 0.2539, 0.8117, -0.7019, 0.4507, -0.2063, -0.5531)
RODS = Member(
    namelist(
        species={
            "count": 10, "radius": 0.02,
            "position": [c for x in ROD_X for c in (x, 0.5)],
            "velocity": [c for v in ROD_V for c in (v, 0.0)],
        },
        stop={"time": 97}, output={"frames_every_time": 0.97, "observables_every_time": 0.97},
    )
)  # fmt: skip
ROD_PLACES = {
    1: [.034593, .188951, .350419, .423589, .473439, .529743, .597849, .654921, .818183, .866073],
    10: [.03397, .08031, .13137, .38281, .44239, .49051, .55473, .61741, .71491, .81733],
    100: [.1616, .2414, .3742, .4396, .5074, .5598, .6658, .7922, .8532, .9002],
}  # fmt: skip
ROD_COUNTS = {1: [54, 8], 10: [566, 95], 100: [5606, 959]}


def rod_counts(run: Run, frame: int) -> list[int]:
    """Return the numbers of pair collisions and of wall collisions up to a sample."""
    walls = run.observable("side_collisions").value[frame]
    return [run.observable("collisions").value[frame], walls.sum()]


TONKS = [
    case
    for number, (frame, tolerance) in enumerate({1: 1e-12, 10: 1e-11, 100: 1e-9}.items(), start=1)
    for case in (
        Case(
            f"P4-0{number}", f"ten disks on a line, t = {0.97 * frame:g}: positions",
            (RODS,), lambda run, k=frame: run.position[k][:, 0],
            ROD_PLACES[frame], within(tolerance), "Tonks gas; D",
        ),
        Case(
            f"P4-0{number}", f"ten disks on a line, t = {0.97 * frame:g}: pair and wall collisions",
            (RODS,), lambda run, k=frame: rod_counts(run, k), ROD_COUNTS[frame], EXACT, "D, R",
        ),
    )
]  # fmt: skip
TONKS.append(
    Case(
        "P4-03", "ten disks on a line, t = 97: set of speeds, as at the start",
        (RODS,), lambda run: np.sort(np.abs(run.velocity[-1][:, 0])),
        np.sort(np.abs(ROD_V)), within(1e-12), "D",
    )
)  # fmt: skip

CASES = ONE + TWO + SCATTERING + TONKS
