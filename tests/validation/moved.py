"""Section 15 of the report, moving sides: bouncing disk, gas under a piston, Maxwell's demon."""

from math import acos, pi, sin, sqrt

import numpy as np

from ricochet import Run
from ricochet.analysis.driven import fuller, share
from ricochet.analysis.statistics import Estimate, combine_runs, correlated_mean
from ricochet.predictions.hard_disks import adiabat
from ricochet.predictions.theory import demon_share, pushed_width

from .case import AT_LEAST, AT_MOST, Case, Member, Tolerance, relative, sigmas, within
from .estimators import each, over, several
from .inputs import ensemble, namelist

# --- one disk that bounces on a moving floor, g = 1 ---


def bouncing(height: float, **law) -> Member:
    """Return a disk that starts at rest with its rim at a height above the mean floor."""
    return Member(
        namelist(
            box={"upper": (1, 1000), "gravity": (0, -1)},
            side={"name": "bottom", "rule": "normal", **law},
            species={"radius": 0.1, "position": (0.5, 0.1 + height)},
            stop={"events": 400, "time": 1e6},
            output={"frames_every_events": 1},
        )
    )


V = 0.25
STRUCK = tuple(bouncing(1, motion="sawtooth", velocity=V, restitution=xi) for xi in (0.5, 0.75))


def leaving(run: Run) -> np.ndarray:
    """Return the upward velocities immediately after the last 40 bounces."""
    return run.velocity[run.n_frames - 41 : run.n_frames - 1][:, 0, 1]


def shaken(xi: float, strength: float) -> Member:
    """Return a run that starts close to the periodic orbit with one bounce per period.

    The floor oscillates with period 1. A disk that leaves the floor at the velocity 1/2 flies for
    one period if the floor then has the velocity (1 - xi) / (1 + xi) / 2.
    """
    amplitude = strength / (2 * pi) ** 2
    phase = acos((1 - xi) / (1 + xi) / 2 / (2 * pi * amplitude))
    height = amplitude * sin(phase) + 0.125 + 1e-4
    return bouncing(
        height, motion="sine", amplitude=amplitude, period=1.0, restitution=xi,
        phase=(phase / (2 * pi) + 0.5) % 1,
    )  # fmt: skip


def doubling(xi: float) -> float:
    """Return the acceleration of the floor, over g, at which the period of the orbit doubles."""
    return float(np.hypot(pi * (1 - xi) / (1 + xi), 2 * (1 + xi**2) / (1 + xi) ** 2))


BELOW, ABOVE = (
    tuple(shaken(xi, factor * doubling(xi)) for xi in (0.5, 0.8)) for factor in (0.98, 1.02)
)


# --- a dilute gas that a side compresses and expands slowly ---

PISTON = ensemble(
    4,
    box={"upper": (2, 1)},
    side={"name": "right", "motion": "sine", "amplitude": 0.5, "period": 1000.0},
    species={"name": "gas", "count": 200, "radius": 1e-3, "temperature": 1.0,
             "exact_temperature": 1.0},
    stop={"time": 750},
    output={"observables_every_time": 250},
)  # fmt: skip


def adiabats(run: Run) -> list[float]:
    """Return T times area over its initial value at the inner, mean and outer side position."""
    kt = run.observable("all/temperature").value
    area = np.array([2.0, 1.5, 2.0, 2.5]) - 2e-3
    return list((kt * area / (kt[0] * area[0]))[1:])


# --- a dense gas that a side compresses slowly to half its width, as in `compression.nml` ---

SLOW, PRESSED_DISKS = 0.0125, 500
PRESSED = ensemble(
    16,
    box={"upper": (2, 1)},
    side={"name": "right", "motion": "constant_velocity", "velocity": SLOW, "end_time": 80.0},
    species={"name": "gas", "count": PRESSED_DISKS, "packing_fraction": 0.2, "temperature": 1.0,
             "exact_temperature": 1.0},
    stop={"time": 80},
    output={"observables_every_time": 20},
)  # fmt: skip
#: The side starts abruptly: sound and flow contain a fraction of up to m u^2 / kT of the energy.
SOUND = Tolerance("4 sigma + m u² / kT", lambda _, error: 4 * error + SLOW**2)


def heated(run: Run) -> np.ndarray:
    """Return the logarithm of T over its initial value at four positions of the side."""
    kt = run.observable("all/temperature").value
    return np.log(kt[1:] / kt[0])


def pressed() -> np.ndarray:
    """Return ln T on the adiabat; its last value is 1.462, or 1.413 without layers at the walls."""
    radius, widths = sqrt(0.4 / PRESSED_DISKS / pi), np.array([2, 1.75, 1.5, 1.25, 1])
    return np.log(adiabat(widths, 1.0, PRESSED_DISKS, radius, walled=True))[1:]


# --- a piston: constant force, constant enthalpy ---

FORCE, PUSHING, WIDE = 130.0, 100, 1.5
PUSHED = ensemble(
    4,
    box={"upper": (WIDE, 1)},
    side={"name": "right", "motion": "piston", "mass": 20.0, "force": FORCE},
    species={"name": "gas", "count": PUSHING, "packing_fraction": 0.3, "speed": sqrt(2)},
    stop={"time": 1000},
    output={"observables_every_time": 0.1},
)  # fmt: skip
ROD = 0.05  # radius of three disks on a line, with the masses 1, 2, 3
RODS = Member(
    namelist(
        box={"upper": (2, 1)},
        side={"name": "right", "motion": "piston", "mass": 1.5, "force": 1.0},
        species=[
            {"name": f"m{k}", "mass": float(k), "radius": ROD, "position": (0.4 * k, 0.5),
             "velocity": ((-1.0) ** k, 0.0)} for k in (1, 2, 3)
        ],
        stop={"time": 200000},
        output={"observables_every_time": 2},
    )
)  # fmt: skip


def room(*runs: Run) -> Estimate:
    """Return the mean width and its variance after the equilibration."""
    tracks = [run.observable("sides/right/position") for run in runs]
    widths = [np.ravel(place)[time > time[-1] / 20] for time, place in tracks]
    squares = [(x - x.mean()) ** 2 for x in widths]
    return several(
        [combine_runs([correlated_mean(one) for one in own]) for own in (widths, squares)]
    )


def room_of_gas() -> tuple[float, float]:
    """Return the predicted mean and variance of the width of the gas.

    The configuration integral of the gas follows from its adiabat.
    """
    radius, widths = sqrt(0.3 * WIDE / PUSHING / pi), np.linspace(1, 2.2, 20001)
    places = -PUSHING * np.log(adiabat(widths, 1.0, PUSHING, radius, walled=True))
    return pushed_width(widths, places, 2 * PUSHING + 1, PUSHING + FORCE * (WIDE - widths))


def room_of_rods() -> tuple[float, float]:
    """Return mean and variance of the width for three rods: Q is the free length cubed."""
    energy = 3 + 2.0
    widths = np.linspace(6 * ROD, energy, 200002)[1:-1]
    return pushed_width(widths, 3 * np.log(widths - 6 * ROD), 4, energy - widths)


# --- Maxwell's demon: two chambers, a sawtooth floor, a hole above it ---

GRAINS, DIAMETER, WIDTH, HOLE, XI = 120, 0.5, 19.5, 8.0, 0.9
LAYERS = GRAINS * DIAMETER / WIDTH
THRESHOLD = LAYERS * (1 - XI**2) * sqrt(pi * HOLE) / 4  # critical velocity: see `demon_share`


def chambers(velocity: float) -> tuple[Member, ...]:
    """Return longer runs of the input `demon.nml` with another velocity of the floor."""
    return ensemble(
        8,
        box={"upper": (40, 50), "gravity": (0, -1)},
        side={"name": "bottom", "motion": "sawtooth", "velocity": velocity},
        wall=[
            {"name": "lower", "from": (20, 0), "to": (20, HOLE)},
            {"name": "upper", "from": (20, HOLE + 6), "to": (20, 50)},
        ],
        species={"name": "grain", "count": GRAINS, "radius": DIAMETER / 2,
                 "region": (0, 40, 1, 30), "temperature": 4.0},
        contact={"restitution": XI, "wall_restitution": 1, "wall_rule": "normal",
                 "contact_time": 1e-4},
        stop={"time": 3000},
        output={"frames_every_time": 5},
    )  # fmt: skip


def fuller_share(run: Run) -> float:
    """Return the mean fraction of disks in the fuller half, in the second half of the time."""
    _, left = share(run)[""]
    return float(fuller(left[run.n_frames // 2 :]).mean())


CASES = [
    Case(
        "P15-11", "sawtooth floor, ξ = 0.5, 0.75: velocity over V (1 + ξ) / (1 - ξ)",
        STRUCK, lambda *runs: [leaving(r)[-1] / V / f for r, f in zip(runs, (3, 7), strict=True)],
        1, relative(1e-12), "D",
    ),
    Case(
        "P15-11", "sine floor, 0.98 of the period doubling: velocity at each bounce",
        BELOW, each(lambda run: leaving(run)[-1]), 0.5, within(1e-4), "D",
    ),
    Case(
        "P15-11", "sine floor, 1.02 of the period doubling: difference of successive bounces",
        ABOVE, each(lambda run: abs(leaving(run)[-1] - leaving(run)[-2])),
        0.01, AT_LEAST, "D",
    ),
    Case(
        "P15-11", "sine floor, 1.02 of the period doubling: difference of every second bounce",
        ABOVE, each(lambda run: abs(leaving(run)[-1] - leaving(run)[-3])),
        1e-4, AT_MOST, "D",
    ),
    Case(
        "P15-12", "slow compression of a dilute gas: T times area over its initial value",
        PISTON, over(adiabats), 1, sigmas(4, 0.02), "D",
    ),
    Case(
        "P15-14", "slow compression of a dense gas, packing 0.2 to 0.4: ln T/T(0)",
        PRESSED, over(heated), pressed(), SOUND, "Kolafa 2006, D",
    ),
    Case(
        "P15-15", "piston and three rods: mean width and its variance",
        (RODS,), room, room_of_rods(), sigmas(4), "Tonks 1936, D",
    ),
    Case(
        "P15-16", "piston and a dense gas: mean width and its variance",
        PUSHED, room, room_of_gas(), sigmas(4), "Kolafa 2006, D",
    ),
    *[
        Case(
            "P15-13",
            f"Maxwell's demon, floor at {velocity:g} of the threshold: share of the fuller chamber",
            chambers(velocity * THRESHOLD), over(fuller_share),
            demon_share(HOLE / (velocity * THRESHOLD) ** 2, LAYERS, XI), within(0.05),
            "after Eggers 1999",
        )
        for velocity in (0.7, 1.2)
    ],
]  # fmt: skip
