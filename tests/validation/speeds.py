"""Sections 5 and 6 of the report: speed distributions, and relaxation of gases and mixtures."""

from collections.abc import Callable
from math import pi, sqrt

import numpy as np
from scipy import stats

from ricochet import Run
from ricochet.analysis.statistics import Estimate, estimate, excess_kurtosis, goodness_of_fit
from ricochet.analysis.equilibrium import kt_at_start
from ricochet.predictions.theory import finite_n_cdf, maxwell_cdf

from .case import AT_MOST, Case, Member, relative, sigmas, within
from .estimators import at_collisions, middle, over
from .inputs import PERIODIC, ensemble, gases, light_and_heavy

LEAST = 1.63  #: KS distance times sqrt(n) that is exceeded with a probability of 1 %


def after(run: Run, tau: float) -> slice:
    """Return the frames after a number of collisions per disk."""
    return slice(int(np.searchsorted(run.collisions_per_disk_at(run.time), tau)), None)


def reduced(run: Run, tau: float = 15) -> np.ndarray:
    """Return the speeds in the frames in equilibrium, over sqrt(2 K / N)."""
    v = run.speed(after(run, tau))
    return (v / sqrt(np.mean(v**2))).ravel()


def obeyed(
    name: str,
    what: str,
    members: tuple[Member, ...],
    sample: Callable[[Run], tuple],
    source: str = "D",
) -> Case:
    """Return a case that compares a sample of values from a run with a distribution function.

    `sample` returns both for a run.
    """

    def distance(run: Run) -> float:
        values, law = sample(run)
        return goodness_of_fit(values, law).ks * sqrt(len(values))

    what = f"{what}: √n times the Kolmogorov-Smirnov distance"
    return Case(name, what, members, middle(distance), LEAST, AT_MOST, source)


def uniform(u: np.ndarray) -> np.ndarray:
    return np.clip(u, 0, 1)


# --- one kind of disk ---


def sampled(count: int, radius: float, interval: float, frames: int) -> tuple[Member, ...]:
    """Return runs with equally spaced frames."""
    time = interval * frames
    output = {"frames_every_time": interval, "observables_every_time": time / 400}
    return gases(3, count, radius=radius, stop={"time": time}, output=output)


LARGE = sampled(1000, 0.004, 0.17, 200)  # frames are 5 collisions per disk apart
FINITE = {  # by N: frames are 5 collisions per disk apart
    10: sampled(10, 0.02, 3.2, 20000),
    100: sampled(100, 0.01, 0.62, 6000),
}


def large(run: Run) -> tuple:
    return reduced(run), maxwell_cdf


def finite(run: Run) -> tuple:
    """Return reduced speeds, and their distribution for N disks sharing a fixed energy."""
    return reduced(run), finite_n_cdf(run.n_disks)


def component(run: Run) -> tuple:
    """Return the fractions m vx^2 / 2E, and their distribution, Beta(1/2, N - 1/2)."""
    share = run.velocity[after(run, 15)][..., 0].ravel() ** 2 / (2 * run.n_disks)
    return share, stats.beta(0.5, run.n_disks - 0.5).cdf


LAWS = [
    obeyed("P5-01", "speeds, Maxwell's distribution", LARGE, large, "EX, LAB"),
    *[
        obeyed("P5-03", f"N = {count}: {what}, exact distribution", members, sample)
        for count, members in FINITE.items()
        for what, sample in (("speeds", finite), ("vx", component))
    ],
]

# --- collisions in equilibrium ---


def hits_on_record(periodic: bool) -> tuple[Member, ...]:
    """Return gases that start in equilibrium, with an event log."""
    output = {"frames_every_events": 1, "event_log": True, "observables_every_time": 0.1}
    return gases(
        3, 100, periodic=periodic, radius=0.005, temperature=1.0,
        stop={"events": 12000}, output=output,
    )  # fmt: skip


def wall_speeds(run: Run) -> tuple:
    """Return |v_n| / sqrt(2 kT / m) of collisions with the sides, and its distribution."""
    log = run.event_log()
    hit = log.j <= 0
    return log.impulse[hit] / (2 * sqrt(2 * kt_at_start(run))), maxwell_cdf


def wall_energies(run: Run) -> np.ndarray:
    """Return K / kT of the disk in each collision with a side."""
    log = run.event_log()
    hit = np.flatnonzero(log.j <= 0)
    return run.kinetic_energy(slice(1, None))[hit, log.i[hit] - 1] / kt_at_start(run)


def in_parts(measure, runs: tuple[Run, ...]) -> Estimate:
    """Return the mean of values measured at collisions, with its error from parts of the runs."""
    values = np.concatenate([measure(run) for run in runs])
    return estimate([part.mean() for part in np.array_split(values, 60)])


def approach_speeds(run: Run) -> tuple:
    """Return g_n / sqrt(4 kT / m) of pair collisions, and its distribution."""
    log = run.event_log()
    return log.impulse[log.j > 0] / sqrt(4 * kt_at_start(run)), maxwell_cdf


def contacts(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return direction of contact [turns of the mirror image] and |b| / s of pair collisions."""
    log = run.event_log()
    at = np.flatnonzero(log.j > 0)
    i, j = log.i[at] - 1, log.j[at] - 1
    x, v = run.position[1:], run.velocity[1:]
    apart = x[at, i] - x[at, j]
    apart -= np.where(run.periodic, run.edges, 0) * np.round(apart / run.edges)
    speed = v[at, i] - v[at, j]
    across = apart[:, 0] * speed[:, 1] - apart[:, 1] * speed[:, 0]
    b = np.abs(across) / np.linalg.norm(speed, axis=1) / np.linalg.norm(apart, axis=1)
    return np.arctan2(apart[:, 1], apart[:, 0]) / pi % 1, b


WALLED, BULK = hits_on_record(False), hits_on_record(True)
COLLISIONS = [
    obeyed("P5-06", "normal speeds at sides, flux distribution", WALLED, wall_speeds),
    Case(
        "P5-06", "mean energy of a disk that collides with a side, over kT",
        WALLED, lambda *runs: in_parts(wall_energies, runs),
        1.5 * 200 / 201, sigmas(3, 0.03), "D, for N = 100",
    ),
    obeyed("P5-07", "approach speeds of pairs, exact distribution", BULK, approach_speeds),
    obeyed(
        "P5-07", "impact parameters, uniform distribution", BULK,
        lambda run: (contacts(run)[1], uniform),
    ),
    obeyed(
        "P5-07",
        "directions of contact, uniform distribution", BULK, lambda run: (contacts(run)[0], uniform)
    ),
]  # fmt: skip

# --- relaxation ---

TAU = (0, 1, 2, 3, 4, 5, 6, 8)
EQUAL_SPEEDS = gases(
    16, 2000, packing_fraction=0.01, periodic=True,
    stop={"collisions_per_disk": 8.001}, output={"frames_every_collisions": 1000},
)  # fmt: skip


def kurtosis(*runs: Run) -> list[float]:
    """Return a2 at the times `TAU`, from the disks of all runs."""
    return [excess_kurtosis(np.concatenate([run.speed(tau) for run in runs])) for tau in TAU]


A2_TOLERANCE = 0.01 + 4.5 / sqrt(16 * 2000)


MIXED = light_and_heavy(
    4, 0.004, stop={"collisions_per_disk": 4000},
    output={"observables_every_collisions": 2500, "frames_every_collisions": 250_000},
)  # fmt: skip
MIXING = light_and_heavy(
    128, 0.001, box=PERIODIC,
    stop={"collisions_per_disk": 8}, output={"observables_every_collisions": 50},
)  # fmt: skip


def settled(run: Run, name: str) -> np.ndarray:
    """Return the values of an observable after 20 collisions per disk."""
    series = run.observable(name)
    return series.value[run.collisions_per_disk.value > 20]


def energies(run: Run) -> list[float]:
    """Return mean kinetic energies and mean speeds, of the light and then of the heavy disks."""
    names = ("light/kinetic_energy", "heavy/kinetic_energy", "light/mean_speed", "heavy/mean_speed")
    return [settled(run, name).mean() for name in names]


def ratios(*runs: Run) -> np.ndarray:
    """Return the mean K_heavy over the mean K_light at the times `TAU`."""
    heavy, light = (
        np.mean([at_collisions(r, f"{name}/kinetic_energy", TAU) for r in runs], axis=0)
        for name in ("heavy", "light")
    )
    return heavy / light


# --- exchange of energy in single collisions ---


def exchanging(mass: float) -> tuple[Member, ...]:
    """Return dilute gases whose light and heavy disks have Maxwellian velocities of unequal kT."""
    disks = {"count": 30000, "radius": 0.0005}
    light = {"name": "light", "temperature": 0.1, **disks}
    heavy = {"name": "heavy", "temperature": 1.0, "mass": mass, **disks}
    return ensemble(
        4, box=PERIODIC, species=[light, heavy], stop={"collisions_per_disk": 0.1},
        output={"event_log": True},
    )  # fmt: skip


def exchanged(run: Run) -> float:
    """Return the fraction of the difference of kT exchanged on average in a light-heavy collision.

    The difference is averaged over the start and the end of a run so short that the velocities
    remain Maxwellian.
    """
    log, v, mass = run.event_log(), run.velocity[0].copy(), run.mass
    gained, mixed = 0.0, 0
    for i, j, change in zip(log.i - 1, log.j - 1, log.momentum_change, strict=True):
        if run.species[i] != run.species[j]:
            k, to_light = (i, change) if run.species[i] == 1 else (j, -change)
            gained += to_light @ (2 * v[k] + to_light / mass[k]) / 2
            mixed += 1
        v[i] += change / mass[i]
        v[j] -= change / mass[j]
    kinetic = [run.kinetic_energy(frame) for frame in (0, -1)]
    heavier = [k[run.species == 2].mean() - k[run.species == 1].mean() for k in kinetic]
    return gained / mixed / np.mean(heavier)


MIXTURE = [
    Case(
        "P5-05", "start with equal speeds: a2 after 0 to 8 collisions per disk",
        EQUAL_SPEEDS, kurtosis, [-0.5, -0.370, -0.264, -0.184, -0.125, -0.0855, -0.0565, -0.025],
        within(A2_TOLERANCE), "DSMC",
    ),
    Case(
        "P6-02", "light and heavy disks in equilibrium: mean energies, mean speeds",
        MIXED, over(energies),
        [1.25, 1.25, 1.401248, 0.700624], relative(0.005), "D; a student's report",
    ),
    Case(
        "P6-03", "K_heavy / K_light after 0 to 8 collisions per disk",
        MIXING, ratios, [4, 2.02, 1.455, 1.228, 1.115, 1.062, 1.031, 1.005],
        within(0.02 + 0.063 / sqrt(len(MIXING))), "DSMC",
    ),
    *[
        Case(
            "P6-04", f"light and heavy disks of unequal kT, masses 1 : {mass}: share of the "
            "difference that a collision exchanges",
            exchanging(mass), over(exchanged), 4 * mass / (1 + mass) ** 2, sigmas(4, 0.08), "D",
        )
        for mass in (4, 25)
    ],
]  # fmt: skip

CASES = LAWS + COLLISIONS + MIXTURE
