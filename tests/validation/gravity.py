"""Section 11: two kinds of disks under gravity, event driven and by time steps."""

from math import asin, pi, sqrt

import numpy as np
from scipy.optimize import brentq

from ricochet import Run
from ricochet.statistics import Estimate, estimate, hold_against
from ricochet.theory import maxwell_cdf

from .case import AT_MOST, Case, Member, relative, sigmas, within
from .estimators import middle, over_runs
from .inputs import namelist

G, R, TOP, MASS = 9.81, 0.04, 16.0, {"A": 0.025, "B": 0.05}
START = 20.0  #: when everything has come to equilibrium


def box(
    v0: float,
    seed: int,
    time: float,
    frames: float | None = None,
    observed: float = 1.0,
    top: float = 8 + R,
    **run,
) -> Member:
    """30 + 30 disks in the lower half, wholly below `top`: by default centres up to 8."""
    output = {"observables_every_time": observed}
    if frames:
        output["frames_every_time"] = frames
    return Member(
        namelist(
            run={"seed": seed, **run},
            box={"upper": (8, 16), "gravity": (0, -G)},
            species=[
                {
                    "name": name, "count": 30, "mass": mass, "radius": R,
                    "region": (0, 8, 0, top), "velocities": "uniform", "speed": v0,
                }
                for name, mass in MASS.items()
            ],
            stop={"time": time}, output=output,
        )
    )  # fmt: skip


# --- what the energy makes of the temperature ---


def mean_height_energy(kt: float, mass: float) -> float:
    """<U> of one disk between floor and ceiling."""
    weight, height = mass * G / kt, TOP - 2 * R
    return mass * G * R + kt - mass * G * height / np.expm1(weight * height)


def energy_of(kt: float) -> float:
    """E/N of the gas; disks that exclude each other stand 1.8 % of kT higher."""
    return kt + np.mean([mean_height_energy(kt, m) for m in MASS.values()]) + 0.018 * kt


def temperature_of(energy: float) -> float:
    """KT that belongs to E/N."""
    return brentq(lambda kt: energy_of(kt) - energy, 0.05, 10)


TABLE = {
    1.3140: 0.6453, 1.3671: 0.6725, 1.4249: 0.7022, 1.4820: 0.7318, 1.5440: 0.7640,
    1.5858: 0.7858, 1.5970: 0.7917,
}  # fmt: skip
assert all(abs(temperature_of(e) / kt - 1) < 2e-3 for e, kt in TABLE.items())


def start_energy(run: Run) -> float:
    """E/N."""
    return float(run.observable("total_energy").value[0]) / run.count


def settled(run: Run, name: str) -> np.ndarray:
    """An observable after `START`."""
    time, value = run.observable(name)
    return value[time > START]


def kinetic(run: Run) -> float:
    """Mean of the two species' kinetic energies per disk."""
    return float(np.mean([settled(run, f"{name}/kinetic_energy").mean() for name in MASS]))


def share(run: Run) -> float:
    """<K_A> / <K_B>."""
    return float(settled(run, "A/kinetic_energy").mean() / settled(run, "B/kinetic_energy").mean())


def pair_rate(run: Run) -> float:
    """Pair collisions per disk and time after `START`."""
    time, collisions = run.observable("collisions")
    first = int(np.searchsorted(time, START))
    return 2 * (collisions[-1] - collisions[first]) / run.count / (time[-1] - time[first])


LONG_RUNS = tuple(
    box(v0, seed, 20000.0) for v0, seed in ((0.1, 1), (0.5, 2), (0.5, 3), (1, 4), (2, 5))
)
SCAN = {v0: tuple(box(v0, seed, 2000.0) for seed in range(1, 9)) for v0 in (0.1, 0.5, 1, 2)}
STARTS = {v0: tuple(box(v0, seed, 1e-3) for seed in range(1, 101)) for v0 in (0.1, 0.5, 1, 2)}
LOWER = tuple(box(0.5, seed, 1e-3, top=8.0) for seed in range(1, 101))
ENERGIES = {0.1: 1.47898, 0.5: 1.48198, 1: 1.49136, 2: 1.52886}
SCAN_KT = {0.1: 0.7302, 0.5: 0.7318, 1: 0.7366, 2: 0.7561}


def at_mean_energy(v0: float, *runs: Run) -> Estimate:
    """KT at the seed-averaged energy: each run is shifted there by the law of its own energy."""
    shifted = [
        kinetic(run) + temperature_of(ENERGIES[v0]) - temperature_of(start_energy(run))
        for run in runs
    ]
    return estimate(shifted)


MEANS = [
    *[
        Case(
            "P11-01", f"v0 = {v0}: E/N, 100 seeds", members,
            lambda *runs: over_runs(start_energy, runs), ENERGIES[v0], sigmas(3, 0.03), "D",
        )
        for v0, members in STARTS.items()
    ],
    Case(
        "P11-01", "v0 = 0.5, disks wholly below 8: E/N, 100 seeds", LOWER,
        lambda *runs: over_runs(start_energy, runs),
        ENERGIES[0.5] - G * np.mean([*MASS.values()]) * R / 2, sigmas(3, 0.03), "D",
    ),
    Case(
        "P11-02", "5 energies: <K> over kT(E/N)",
        LONG_RUNS, lambda *runs: [kinetic(run) / temperature_of(start_energy(run)) for run in runs],
        1, relative(0.006), "D, R",
    ),
    Case(
        "P11-02", "the same: <K_A> / <K_B>",
        LONG_RUNS, lambda *runs: [share(run) for run in runs], 1, within(0.015), "D",
    ),
    *[
        Case(
            "P11-03", f"v0 = {v0}: kT at the mean energy", members,
            lambda *runs, v0=v0: at_mean_energy(v0, *runs), SCAN_KT[v0], relative(0.006), "D",
        )
        for v0, members in SCAN.items()
    ],
]  # fmt: skip

# --- relaxation, laws ---

WINDOWS = ((0, 0.5), (0.5, 1), (1, 1.5), (3.5, 4), (5, 10))
FALLING = tuple(box(0.5, seed, 10.0, observed=0.05) for seed in range(1, 1025))


def window_ratios(*runs: Run) -> list[float]:
    """<K_B> / <K_A> in `WINDOWS`, means over seeds and time."""
    time = runs[0].observable("A/kinetic_energy").time
    a, b = (
        np.mean([run.observable(f"{name}/kinetic_energy").value for run in runs], axis=0)
        for name in MASS
    )
    inside = [(time >= low) & (time < high) for low, high in WINDOWS]
    return [b[w].mean() / a[w].mean() for w in inside]


SAMPLED = tuple(box(0.5, seed, 4020.0, frames=2.0) for seed in (11, 12, 13))


def later(run: Run) -> slice:
    return slice(int(np.searchsorted(run.time, START)), None)


def of(run: Run, name: str, values: np.ndarray) -> np.ndarray:
    """The columns of one species."""
    return values[:, run.of_species(name)]


def square_distances(run: Run) -> list[float]:
    """KS distance times sqrt(n) of v^2 from its law, for each species."""
    found = []
    for name in MASS:
        energy = of(run, name, run.kinetic_energy(later(run))).ravel()
        u = np.sqrt(energy / energy.mean())
        found.append(hold_against(u, maxwell_cdf).ks * sqrt(len(u)))
    return found


def slopes(run: Run) -> list[float]:
    """Fitted d ln p / dy of the heights over m g / kT; floor and ceiling layers left out."""
    heights, kt = run.position[later(run)][..., 1], kinetic(run)
    low, high = 1.0, 13.0
    found = []
    for name, mass in MASS.items():
        y = of(run, name, heights).ravel()
        mean = np.mean(y[(y > low) & (y < high)]) - low
        found.append(exponent(mean, high - low) * kt / (mass * G))
    return found


def exponent(mean: float, length: float) -> float:
    """The k for which density exp(-k y) on 0..length has this mean."""
    return brentq(lambda k: 1 / k - length / np.expm1(k * length) - mean, 1e-3, 10)


LAWS = [
    Case(
        "P11-05", "1024 seeds: <K_B> / <K_A> at 0-.5, .5-1, 1-1.5, 3.5-4",
        FALLING, lambda *runs: window_ratios(*runs)[:4], [1.99, 1.78, 1.26, 1.00],
        within(0.06), "R",
    ),
    Case(
        "P11-05", "the same: after the thermalisation, 5-10",
        FALLING, lambda *runs: window_ratios(*runs)[4], 1.00, within(0.03), "R",
    ),
    Case(
        "P11-06", "v^2 of both species against their law: KS distance sqrt(n)",
        SAMPLED, lambda *runs: middle(square_distances, runs), 1.63, AT_MOST, "URB, D",
    ),
    Case(
        "P11-07", "heights of both species: slope over m g / kT",
        SAMPLED, lambda *runs: over_runs(slopes, runs), 1, within(0.03), "URB, D, R",
    ),
]  # fmt: skip

# --- time steps ---

STEPPED = {dt: box(0.5, 2, 5000.0, dynamics="steps", dt=dt) for dt in (0.004, 0.002, 0.001)}
CONTACTS = {(0.025, 0.025): 0.21, (0.025, 0.05): 0.50, (0.05, 0.05): 0.29}  #: shares of the pairs


def too_short(q: float) -> float:
    """Share of contacts that no step sees: a step is q contact distances long.

    A pair is seen if a step ends while it overlaps and still approaches, on the first half of its
    chord: with uniform impact parameter b and phase, the mean of 1 - sqrt(1 - b^2) / q where that
    is positive.  (Overlap alone, receding or not, would make it q / 2.)
    """
    if q >= 1:
        return 1 - pi / (4 * q)
    return 1 - sqrt(1 - q**2) - (asin(q) - q * sqrt(1 - q**2)) / (2 * q)


def missed(kt: float, dt: float) -> float:
    """The mean over pairs; in a gas they meet with speeds of density g^2 exp(-mu g^2 / 2kT)."""
    total = 0.0
    for (m1, m2), part in CONTACTS.items():
        g = np.linspace(0, 12, 2001)[1:] * sqrt(kt * (1 / m1 + 1 / m2))
        weight = g**2 * np.exp(-(g**2) * m1 * m2 / (m1 + m2) / (2 * kt))
        shares = np.array([too_short(speed * dt / (2 * R)) for speed in g])
        total += part * np.sum(weight * shares) / np.sum(weight)
    return total


def rate_ratio(stepped: Run, exact: Run) -> float:
    """Collision rates at equal seeds, so at equal energies."""
    return pair_rate(stepped) / pair_rate(exact)


STEPS = [
    *[
        Case(
            "P11-10", f"time steps of {dt}: collision rate over the exact one, over that expected",
            (member, LONG_RUNS[1]),
            lambda run, exact, dt=dt: rate_ratio(run, exact) / (1 - missed(kinetic(run), dt)),
            1, within(0.01), "D, see the docstring of too_short",
        )
        for dt, member in STEPPED.items()
    ],
]  # fmt: skip

CASES = MEANS + LAWS + STEPS
