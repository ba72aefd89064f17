"""Section 11 of the report: two species under gravity, event-driven and time-stepped."""

from collections.abc import Callable, Iterable
from math import asin, pi, sqrt

import numpy as np
from scipy.optimize import brentq

from ricochet import Run
from ricochet.analysis.statistics import goodness_of_fit
from ricochet.predictions.theory import maxwell_cdf

from .case import AT_MOST, Case, Member, relative, sigmas, within
from .estimators import each, middle, over
from .inputs import ensemble

G, R, TOP, MASS = 9.81, 0.04, 16.0, {"A": 0.025, "B": 0.05}
START = 20.0  #: time after which the gas is in equilibrium


def boxes(
    seeds: int | Iterable[int], v0: float, time: float, observed: float = 1.0, run=None, **output
) -> tuple[Member, ...]:
    """Return runs of 30 + 30 disks that start in the lower half, at heights up to 8."""
    return ensemble(
        seeds, run=run or {}, box={"upper": (8, 16), "gravity": (0, -G)},
        species=[
            {
                "name": name, "count": 30, "mass": mass, "radius": R,
                "region": (0, 8, 0, 8 + R), "velocities": "uniform", "speed": v0,
            }
            for name, mass in MASS.items()
        ],
        stop={"time": time}, output={"observables_every_time": observed, **output},
    )  # fmt: skip


# --- the temperature that follows from the energy ---


def mean_height_energy(kt: float, mass: float) -> float:
    """Return the mean potential energy of one disk between floor and ceiling."""
    weight, height = mass * G / kt, TOP - 2 * R
    return mass * G * R + kt - mass * G * height / np.expm1(weight * height)


def energy_of(kt: float) -> float:
    """Return E/N; the excluded area raises the mean potential energy by 1.8 % of kT."""
    return kt + np.mean([mean_height_energy(kt, m) for m in MASS.values()]) + 0.018 * kt


def temperature_of(energy: float) -> float:
    """Return kT of the gas at an energy E/N."""
    return brentq(lambda kt: energy_of(kt) - energy, 0.05, 10)


def start_energy(run: Run) -> float:
    """Return the initial energy per disk, E/N."""
    return float(run.observable("total_energy").value[0]) / run.n_disks


def settled(run: Run, name: str) -> np.ndarray:
    """Return the values of an observable after the time `START`."""
    time, value = run.observable(name)
    return value[time > START]


def kinetic(run: Run) -> float:
    """Return the mean of the kinetic energies per disk of the two species."""
    return float(np.mean([settled(run, f"{name}/kinetic_energy").mean() for name in MASS]))


def share(run: Run) -> float:
    """Return the ratio <K_A> / <K_B> of the kinetic energies of the two species."""
    return float(settled(run, "A/kinetic_energy").mean() / settled(run, "B/kinetic_energy").mean())


def pair_rate(run: Run) -> float:
    """Return the number of pair collisions per disk and time after the time `START`."""
    time, collisions = run.observable("collisions")
    first = int(np.searchsorted(time, START))
    return 2 * (collisions[-1] - collisions[first]) / run.n_disks / (time[-1] - time[first])


SEEDS = {0.1: (1,), 0.5: (2, 3), 1: (4,), 2: (5,)}
LONG_RUNS = tuple(run for v0, seeds in SEEDS.items() for run in boxes(seeds, v0, 20000.0))
ENERGIES = {0.1: 1.47898, 0.5: 1.48198, 1: 1.49136, 2: 1.52886}
SCAN_KT = {0.1: 0.7302, 0.5: 0.7318, 1: 0.7366, 2: 0.7561}


def at_energy(mean: float) -> Callable[[Run], float]:
    """Return a function that measures kT of a run, corrected to the mean energy over all seeds."""
    kt = temperature_of(mean)
    return lambda run: kinetic(run) + kt - temperature_of(start_energy(run))


MEANS = [
    *[
        Case(
            "P11-01", f"gravity, v0 = {v0}: E/N, 100 seeds", boxes(100, v0, 1e-3),
            over(start_energy), energy, sigmas(3, 0.03), "D",
        )
        for v0, energy in ENERGIES.items()
    ],
    Case(
        "P11-02", "gravity, 5 energies: mean K over kT(E/N)",
        LONG_RUNS, each(lambda run: kinetic(run) / temperature_of(start_energy(run))),
        1, relative(0.006), "D, R",
    ),
    Case(
        "P11-02", "gravity, 5 energies: ratio of the mean energies of both species",
        LONG_RUNS, each(share), 1, within(0.015), "D",
    ),
    *[
        Case(
            "P11-03", f"gravity, v0 = {v0}: kT at the mean energy", boxes(8, v0, 2000.0),
            over(at_energy(ENERGIES[v0])), kt, relative(0.006), "D",
        )
        for v0, kt in SCAN_KT.items()
    ],
]  # fmt: skip

# --- relaxation, laws ---

WINDOWS = ((0, 0.5), (0.5, 1), (1, 1.5), (3.5, 4), (5, 10))
FALLING = boxes(1024, 0.5, 10.0, observed=0.05)


def window_ratios(*runs: Run) -> list[float]:
    """Return <K_B> / <K_A> in `WINDOWS`, averaged over seeds and time."""
    time = runs[0].observable("A/kinetic_energy").time
    a, b = (
        np.mean([run.observable(f"{name}/kinetic_energy").value for run in runs], axis=0)
        for name in MASS
    )
    inside = [(time >= low) & (time < high) for low, high in WINDOWS]
    return [b[w].mean() / a[w].mean() for w in inside]


SAMPLED = boxes((11, 12, 13), 0.5, 4020.0, frames_every_time=2.0)


def later(run: Run) -> slice:
    return slice(int(np.searchsorted(run.time, START)), None)


def of(run: Run, name: str, values: np.ndarray) -> np.ndarray:
    """Return the values of the disks of one species."""
    return values[:, run.of_species(name)]


def square_distances(run: Run) -> list[float]:
    """Return the KS distance of v^2 from its predicted distribution times sqrt(n), by species."""
    found = []
    for name in MASS:
        energy = of(run, name, run.kinetic_energy(later(run))).ravel()
        u = np.sqrt(energy / energy.mean())
        found.append(goodness_of_fit(u, maxwell_cdf).ks * sqrt(len(u)))
    return found


def slopes(run: Run) -> list[float]:
    """Return d ln p / dy over m g / kT, fitted without the layers at floor and ceiling."""
    heights, kt = run.position[later(run)][..., 1], kinetic(run)
    low, high = 1.0, 13.0
    found = []
    for name, mass in MASS.items():
        y = of(run, name, heights).ravel()
        mean = np.mean(y[(y > low) & (y < high)]) - low
        found.append(exponent(mean, high - low) * kt / (mass * G))
    return found


def exponent(mean: float, length: float) -> float:
    """Return k for which the density exp(-k y) between 0 and `length` has the given mean."""
    return brentq(lambda k: 1 / k - length / np.expm1(k * length) - mean, 1e-3, 10)


LAWS = [
    Case(
        "P11-05", "gravity, 1024 seeds: K_B / K_A in four intervals up to t = 4",
        FALLING, lambda *runs: window_ratios(*runs)[:4], [1.99, 1.78, 1.26, 1.00],
        within(0.06), "R",
    ),
    Case(
        "P11-05", "gravity, 1024 seeds: K_B / K_A after relaxation, t = 5 to 10",
        FALLING, lambda *runs: window_ratios(*runs)[4], 1.00, within(0.03), "R",
    ),
    Case(
        "P11-06",
        "gravity: v² of both species, exact distribution: √n times the Kolmogorov-Smirnov distance",
        SAMPLED, middle(square_distances), 1.63, AT_MOST, "URB, D",
    ),
    Case(
        "P11-07", "gravity: slope of ln(density) against height over m g / kT",
        SAMPLED, over(slopes), 1, within(0.03), "URB, D, R",
    ),
]  # fmt: skip

# --- time steps ---

CONTACTS = {(0.025, 0.025): 0.21, (0.025, 0.05): 0.50, (0.05, 0.05): 0.29}  #: fraction of pairs


def too_short(q: float) -> float:
    """Return the fraction of collisions missed by time steps of q contact distances.

    A collision is detected if a step ends while the disks overlap and still approach each other, on
    the first half of the chord. For uniformly distributed impact parameters b and phases, the
    result is the mean of 1 - sqrt(1 - b^2) / q where this is positive. (If overlaps of separating
    disks were detected as well, q / 2 would replace q.)
    """
    if q >= 1:
        return 1 - pi / (4 * q)
    return 1 - sqrt(1 - q**2) - (asin(q) - q * sqrt(1 - q**2)) / (2 * q)


def missed(kt: float, dt: float) -> float:
    """Return the mean of `too_short` over pairs, and over relative speeds of collisions in a gas.

    The density of the relative speeds g is proportional to g^2 exp(-mu g^2 / 2kT).
    """
    total = 0.0
    for (m1, m2), part in CONTACTS.items():
        g = np.linspace(0, 12, 2001)[1:] * sqrt(kt * (1 / m1 + 1 / m2))
        weight = g**2 * np.exp(-(g**2) * m1 * m2 / (m1 + m2) / (2 * kt))
        shares = np.array([too_short(speed * dt / (2 * R)) for speed in g])
        total += part * np.sum(weight * shares) / np.sum(weight)
    return total


def rate_ratio(stepped: Run, exact: Run) -> float:
    """Return the collision rate over its expected value, for runs of equal energy."""
    expected = 1 - missed(kinetic(stepped), stepped.parameter("run", "dt"))
    return pair_rate(stepped) / pair_rate(exact) / expected


STEPS = [
    Case(
        "P11-10", f"time steps of {dt}: fraction of collisions found, over the predicted fraction",
        (*boxes((2,), 0.5, 5000.0, run={"dynamics": "steps", "dt": dt}), LONG_RUNS[1]),
        rate_ratio, 1, within(0.01), "D: docstring of too_short",
    )
    for dt in (0.004, 0.002, 0.001)
]  # fmt: skip

CASES = MEANS + LAWS + STEPS
