"""Section 10 of the report: craters, and random sequential insertion."""

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial import cKDTree

from ricochet import Run
from ricochet.analysis.statistics import Estimate, estimate

from .case import AT_LEAST, AT_MOST, Case, Member, Tolerance, relative
from .inputs import PERIODIC, ensemble, namelist


def crater(count: int, seed: int = 1, mass: float = 25, exit_codes=(0,), **more) -> Member:
    """Return a run of a projectile of five disk radii and a bed at a packing fraction of 1/2."""
    groups = {
        "contact": {"restitution": 0.5, "contact_time": 2.0**-17},
        "stop": {"energy_fraction": 0.1},
        "output": {"event_log": True},
    }
    for name in more:
        groups[name] = groups[name] | more[name]
    return Member(
        namelist(
            run={"seed": seed},
            species=[
                {"name": "bed", "count": count, "packing_fraction": 0.5, "region": (0, 1, 0, 0.5)},
                {
                    "name": "projectile", "relative_to": "bed", "mass": float(mass), "radius": 5.0,
                    "position": (0.5, 0.75), "velocity": (0, -5.0),
                },
            ],
            **groups,
        ),
        exit_codes=exit_codes,
    )  # fmt: skip


def hit(run: Run) -> int:
    """Return the number of bed disks that collided with another disk."""
    log = run.event_log()
    pairs = log.j > 0
    return len(np.union1d(log.i[pairs], log.j[pairs])) - 1


MASSES = (1, 5, 10, 15, 20, 25)
SCAN = tuple(crater(2000, seed, mass) for mass in MASSES for seed in range(1, 13))


def rises(*runs: Run) -> np.ndarray:
    """Return the increases of the mean number of disks hit from mass to mass, over their errors."""
    means, errors = hits_of_masses(*runs)
    return np.diff(means) / np.hypot(errors[1:], errors[:-1])


def straightness(*runs: Run) -> float:
    """Return the correlation coefficient of the mean number of disks hit with the mass."""
    return float(np.corrcoef(MASSES, hits_of_masses(*runs).mean)[0, 1])


def hits_of_masses(*runs: Run) -> Estimate:
    """Return the mean number of disks hit for each of `MASSES`."""
    return estimate(np.reshape([hit(run) for run in runs], (len(MASSES), -1)), axis=1)


def hit_less_bound(run: Run) -> float:
    """Return the number of disks hit minus M (1/f - 1), provided that none reached the sides."""
    if np.sum(run.observable("side_collisions").value[-1]) > 0:
        raise ValueError("a disk has hit a side")
    return hit(run) - 25 * (1 / 0.1 - 1)


def fraction_left(run: Run) -> np.ndarray:
    """Return the energy after each event, relative to the initial energy."""
    lost = run.observable("dissipated_energy").value
    return 1 - lost / run.observable("total_energy").value[0]


# Without the TC model, inelastic collapse occurs before the energy has fallen to a tenth.
NO_TC = tuple(
    crater(2000, seed, exit_codes=(0, 4), contact={"contact_time": 0}, output={"event_log": False})
    for seed in range(1, 13)
)  # fmt: skip

CRATERS = [
    Case(
        "P10-02", "crater, 20 000 disks: number of disks hit minus M (1/f - 1)",
        (crater(20000),), hit_less_bound, 0, AT_LEAST, "D",
    ),
    Case(
        "P10-03", "craters, masses 1 to 25: increase of the disks hit, in standard errors",
        SCAN, rises, 2, AT_LEAST, "a student's report; R",
    ),
    Case(
        "P10-03", "craters, masses 1 to 25: correlation of the disks hit with the mass",
        SCAN, straightness, 0.97, AT_LEAST, "a student's report; R",
    ),
    Case(
        "P10-04", "craters without TC model: fraction of 12 runs with a reported collapse",
        NO_TC, lambda *runs: np.mean(["collapsed" in run.nature for run in runs]),
        0.5, AT_LEAST, "R",
    ),
    Case(
        "P10-07", "crater: largest increase of the energy in an event",
        (crater(500, output={"observables_every_events": 1}),),
        lambda run: np.max(np.diff(fraction_left(run))), 0, AT_MOST, "EX",
    ),
]  # fmt: skip

# --- random sequential insertion ---

BED = 10000


def inserted(packing: float) -> tuple[Member, ...]:
    """Return the initial states of periodic boxes filled at random."""
    return ensemble(
        8,
        box=PERIODIC,
        species={"count": BED, "packing_fraction": packing}, stop={"events": 1},
    )  # fmt: skip


def free_part(*runs: Run, probes: int = 200_000) -> float:
    """Return the mean fraction of the area in which another disk can be inserted."""
    parts = []
    for run in runs:
        tree = cKDTree(run.position[0], boxsize=run.edges)
        places = np.random.default_rng(run.seed).random((probes, 2)) * run.edges
        distance, _ = tree.query(places, distance_upper_bound=2 * run.radius[0])
        parts.append(np.mean(np.isinf(distance)))
    return float(np.mean(parts))


GRID = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.43, 0.46, 0.48, 0.49, 0.5)
FILLED = tuple(member for packing in GRID for member in inserted(packing))


def attempts(*runs: Run) -> list[float]:
    """Return attempts times disk area up to the packing fractions 0.1, 0.2, ..., 0.5.

    This is the integral of 1 / `free_part` over the packing fraction.
    """
    free = [1.0, *(free_part(*runs[k : k + 8]) for k in range(0, len(runs), 8))]
    inverse = PchipInterpolator([0, *GRID], -np.log(free))
    fine = np.linspace(0, 0.5, 5001)
    sums = np.concatenate([[0], np.cumsum(np.diff(fine) * np.exp(inverse(fine[1:] - 5e-5)))])
    return [float(np.interp(t, fine, sums)) for t in (0.1, 0.2, 0.3, 0.4, 0.5)]


RSA = [
    Case(
        "P10-06",
        "random placement: fraction of the area free for one more disk at packing 0.1, 0.2",
        inserted(0.1) + inserted(0.2), lambda *runs: [free_part(*runs[:8]), free_part(*runs[8:])],
        [0.6345, 0.3436], relative(0.01), "Schaaf and Talbot 1989, R",
    ),
    Case(
        "P10-06", "random placement: attempts times disk area to reach packing 0.1 to 0.5",
        FILLED, attempts, [0.126, 0.339, 0.807, 2.33, 25.6],
        Tolerance("1 / 1 / 3 / 3 / 10 %", lambda ref, _: ref * [0.01, 0.01, 0.03, 0.03, 0.1]), "R",
    ),
]  # fmt: skip

CASES = CRATERS + RSA
