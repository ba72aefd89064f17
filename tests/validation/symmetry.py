"""Section 13 of the report: conservation laws, symmetries and time reversal of trajectories."""

from collections.abc import Iterator
from math import sqrt

import numpy as np

from ricochet import Run

from .case import AT_MOST, Case, Member, within
from .estimators import angular_momentum
from .inputs import PERIODIC, gases, namelist
from .billiards import CONTAINER

# --- conservation ---


ROUND = Member(
    namelist(
        **CONTAINER,
        species=[
            {"count": 60, "radius": 0.03, "speed": 1.0},
            {"count": 6, "radius": 0.06, "mass": 10.0, "speed": 1.0},
        ],
        contact={"wall_rule": "normal"}, stop={"events": 500_000},
        output={"frames_every_events": 5000, "observables_every_events": 5000},
    )
)  # fmt: skip


def spin_drift(run: Run) -> float:
    """Return the largest change of the angular momentum about the centre, over sum m |x| |v|."""
    x, v, spin = run.position[0], run.velocity[0], angular_momentum(run)
    scale = np.sum(run.mass * np.linalg.norm(x, axis=1) * np.linalg.norm(v, axis=1))
    return float(np.max(np.abs(spin - spin[0])) / scale)


def energy_drift(run: Run) -> float:
    """Return the largest relative change of the energy."""
    energy = run.observable("total_energy").value
    return float(np.max(np.abs(energy / energy[0] - 1)))


# --- symmetries: the same disks, listed in the input file ---


def start(count: int, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return positions on a perturbed square lattice, and velocities with kT = 1 and no drift."""
    rng = np.random.default_rng(13)
    columns = int(sqrt(count))
    x, y = np.meshgrid(*2 * [(np.arange(columns) + 0.5) / columns])
    shake = 0.5 / columns - radius
    places = np.stack([x.ravel(), y.ravel()], axis=1) + rng.uniform(-shake, shake, (count, 2))
    velocities = rng.normal(0, 1, (count, 2))
    return places, velocities - velocities.mean(axis=0)


def explicit(
    places: np.ndarray, velocities: np.ndarray, radius: float, time: float, periodic: bool, **output
) -> str:
    return namelist(
        box=PERIODIC if periodic else {},
        species={
            "count": len(places), "radius": radius, "position": places.ravel(),
            "velocity": velocities.ravel(),
        },
        stop={"time": time}, output={"event_log": True, **output},
    )  # fmt: skip


PLACES, VELOCITIES = start(100, 0.025)
SHORT = 0.085  #: about 2 collisions per disk at a packing fraction of 0.2
BOOST = np.array([0.75, -0.5])
ORDER = np.random.default_rng(5).permutation(100)
PLAIN, BOOSTED = (
    Member(explicit(PLACES, VELOCITIES + u, 0.025, SHORT, periodic=True)) for u in (0, BOOST)
)
LISTED, RELABELLED = (
    Member(explicit(PLACES[k], VELOCITIES[k], 0.025, SHORT, periodic=False))
    for k in (np.arange(100), ORDER)
)


def boost_error(run: Run, boosted: Run) -> float:
    """Return the largest difference of collision times, and of positions after shifting back."""
    if len(run.event_log().time) < 90:
        raise ValueError("too few collisions")
    apart = boosted.unwrapped(-1) - BOOST * SHORT - run.unwrapped(-1)
    times = boosted.event_log().time - run.event_log().time
    return float(max(np.max(np.abs(apart)), np.max(np.abs(times))))


def label_error(run: Run, relabelled: Run) -> float:
    """Return the largest difference of positions and event times."""
    apart = relabelled.position[-1] - run.position[-1][ORDER]
    times = relabelled.event_log().time - run.event_log().time
    return float(max(np.max(np.abs(apart)), np.max(np.abs(times))))


# --- reversal ---

REVERSALS = {  # by N and radius: collisions per disk, and log10 of the rms error
    (100, 0.01): {1: -13.6, 2: -11.2, 4: -6.3, 6: -2.2},
    (100, 0.025): {4: -13.4, 8: -10.6, 12: -7.4, 16: -4.5, 20: -1.7},
    (64, 0.04): {10: -11.9, 20: -6.9, 30: -2.3},
}
SAMPLES = 30


def onward(run: Run) -> str:
    """Return the input of the same run, ending between events at nine tenths of its time."""
    return explicit(
        run.position[0], run.velocity[0], float(run.radius[0]), 0.9 * run.time[-1], periodic=False
    )


def backward(run: Run) -> str:
    """Return the input of a run from the final state with reversed velocities, as long as `run`."""
    return explicit(
        run.position[-1], -run.velocity[-1], float(run.radius[0]), run.time[-1], periodic=False
    )


def there_and_back(count: int, radius: float, tau: int) -> Iterator[Member]:
    """Yield pairs of runs: one of about `tau` collisions per disk, and its reversal."""
    longer = {"collisions": round(tau / 0.9 * count / 2)}
    for timed in gases(SAMPLES, count, radius=radius, temperature=1.0, stop=longer):
        there = Member(onward, (timed,))
        yield from (there, Member(backward, (there,)))


def return_errors(*runs: Run) -> np.ndarray:
    """Return log10 of the rms distance from the start, averaged over `SAMPLES` pairs of runs."""
    errors = [
        np.log10(np.sqrt(np.mean(np.sum((back.position[-1] - there.position[0]) ** 2, axis=1))))
        for there, back in zip(runs[::2], runs[1::2], strict=True)
    ]
    return np.mean(np.reshape(errors, (-1, SAMPLES)), axis=1)


CASES = [
    Case(
        "P13-02", "round container, 5e5 events: change of energy and angular momentum",
        (ROUND,), lambda run: [energy_drift(run), spin_drift(run)], 1e-11, AT_MOST, "D, R",
    ),
    Case(
        "P13-04", "periodic box, moving frame of reference: positions and times",
        (PLAIN, BOOSTED), boost_error, 1e-9, AT_MOST, "D",
    ),
    *[
        Case(
            "P13-05", f"reversed velocities, N = {count}, r = {radius}: log10 of the error at τ = "
            + ", ".join(map(str, expected)),
            tuple(
                member
                for tau in expected
                for member in there_and_back(count, radius, tau)
            ),
            return_errors, list(expected.values()), within(1), "R",
        )
        for (count, radius), expected in REVERSALS.items()
    ],
    Case(
        "P13-06", "the same disks in another order: positions and times",
        (LISTED, RELABELLED), label_error, 1e-9, AT_MOST, "D",
    ),
]  # fmt: skip
