"""Sections 7 and 8: collision rates, pressure, equation of state."""

from math import gamma, pi, sqrt

import numpy as np

from ricochet import Run
from ricochet import hard_disks as hd
from ricochet.statistics import SeriesMean, combined
from ricochet.thermodynamics import collision_rate, z_rate, z_virial, z_wall

from .case import Case, Member, relative, sigmas, within
from .estimators import force, hit_rate, over_runs, several
from .inputs import PERIODIC, ROOT_2, gas, namelist
from .laws import mixture_rates, mixture_z

N = 1000


def long_gas(count: int, tau: float, seed: int = 1, **more) -> Member:
    """A gas observed 2000 times in `tau` collisions per disk."""
    every = max(1, int(tau * count / 4000))
    return Member(
        gas(
            count, seed=seed, stop={"collisions_per_disk": tau},
            output={"observables_every_collisions": every}, **more,
        )
    )  # fmt: skip


# --- periodic ---

PACKINGS = tuple(round(0.05 * k, 2) for k in range(1, 11))


def bulk(eta: float) -> tuple[Member, ...]:
    """Longer where the pressure is tested, too."""
    more = eta in (0.1, 0.3, 0.5)
    return tuple(
        long_gas(N, 4000, seed, packing_fraction=eta, periodic=True)
        for seed in range(1, 5 if more else 2)
    )


def reduced_rate(run: Run) -> SeriesMean:
    """The w at kT = m = 1."""
    scale = sqrt(run.count / (run.count - 1))  # speeds sqrt 2, at rest as a whole
    return collision_rate(run).scaled(1 / scale)


def pair_rate(run: Run) -> SeriesMean:
    """Pair collisions per time."""
    return collision_rate(run).scaled(run.count / 2)


def rate_reference(eta: float) -> float:
    diameter = 2 * sqrt(eta / (pi * N))
    return hd.collision_rate(hd.simulated_finite(eta, N), diameter, N - 1)


BULK = [
    Case(
        "P7-01", f"periodic, packing {eta:.2f}: collision rate",
        bulk(eta), lambda *runs: combined([reduced_rate(run) for run in runs]),
        rate_reference(eta), relative(0.004), "KR",
    )
    for eta in PACKINGS
] + [
    case
    for eta in (0.1, 0.3, 0.5)
    for case in (
        Case(
            "P8-01", f"periodic, packing {eta}: Z by the virial",
            bulk(eta), lambda *runs: combined([z_virial(run) for run in runs]),
            hd.simulated_finite(eta, N), sigmas(3, 0.003), "KR",
        ),
        Case(
            "P8-01", f"periodic, packing {eta}: one over the other",
            bulk(eta),
            lambda *runs: combined([z_virial(run) for run in runs]).mean
            / combined([z_rate(run) for run in runs]).mean,
            1, within(1e-3), "D",
        ),
    )
] + [
    Case(
        "P8-01", "periodic, packing 0.3, N = 256: Z by the virial",
        tuple(
            long_gas(256, 4000, seed, packing_fraction=0.3, periodic=True) for seed in (1, 2, 3, 4)
        ),
        lambda *runs: combined([z_virial(run) for run in runs]),
        hd.simulated_finite(0.3, 256), sigmas(3, 0.003), "KR",
    ),
]  # fmt: skip

# --- walls ---

WALLED = {  # radius: w, hits of all sides, force on one side, collisions per disk to run
    0.001: (7.118, 1608.5, 1008.33, 4000),
    0.004: (30.93, 1784, 1118.4, 20000),
    0.007: (65.30, 2279, 1424.6, 25000),
    0.010: (131.64, 3543, 2211, 25000),
    0.0126157: (282.6, 6802, 4269, 20000),
}


def walled(radius: float) -> tuple[Member]:
    return (long_gas(N, WALLED[radius][3], radius=radius),)


WALLS = [
    Case(
        "P7-02", f"walls, radius {radius}: collision rate, hits, force",
        walled(radius),
        lambda run: several([collision_rate(run), hit_rate(run), force(run)]),
        values[:3], relative(0.01), "R",
    )
    for radius, values in WALLED.items()
]  # fmt: skip

# --- exact: two disks ---


def two(radius: float) -> tuple[Member]:
    return (
        Member(
            namelist(
                run={"seed": 7},
                species={"count": 2, "radius": radius, "speed": ROOT_2},
                stop={"collisions": 4_000_000},
                output={"observables_every_collisions": 2000},
            )
        ),
    )


def two_exact(s: float) -> list[float]:
    """Pair rate, hits of all sides, force on one, in the unit box with E = 2."""
    a, n, energy = 1 - s, 2, 2.0
    q = a**4 - pi * s**2 * a**2 + 8 / 3 * s**3 * a - s**4 / 2
    dq_ds = -(2 * pi * s * a**2 - 8 * s**2 * a + 2 * s**3)
    dq_da = 2 * a**3 - pi * s**2 * a + 4 / 3 * s**3  # a and b apart, then a = b
    u = sqrt(2 * energy) * gamma(n) / (sqrt(pi) * gamma(n + 0.5))
    return [-dq_ds / q * u / sqrt(2), 2 * dq_da / q * u, dq_da / q * energy / n]


TWO = [
    Case(
        "P7-04", f"two disks, radius {radius}: pair rate, hits, force",
        two(radius),
        lambda run: several([pair_rate(run), hit_rate(run), force(run)]),
        values, relative(tolerance), "D",
    )
    for radius, values, tolerance in (
        (0.1, [0.980390, 4.590752, 2.704176], 0.005),
        (0.15, [1.922013, 6.015352, 3.543335], 0.003),
    )
]  # fmt: skip
assert all(
    np.allclose(two_exact(2 * r), case.reference, rtol=1e-6)
    for r, case in zip((0.1, 0.15), TWO, strict=True)
)

# --- dilute, and the virial identity ---

DILUTE = tuple(long_gas(100, 40000, seed, radius=0.01) for seed in (1, 2))


def identity(count: int, collisions: int, **more) -> Member:
    """A run from its very start to its end."""
    return Member(
        gas(
            count, stop={"collisions": collisions}, output={"observables_every_collisions": 1000},
            contact={"wall_rule": "normal"}, **more,
        )
    )  # fmt: skip


def identity_terms(run: Run) -> tuple[float, float, float]:
    """Wall pressure, virial pressure, and the boundary term d(sum m x v) / (2 K t); whole run."""
    work = 2 * np.sum(run.kinetic_energy(0)) * run.time[-1]
    impulse, a = run.observable("wall_impulse").value[-1], run.edges - 2 * run.radius[0]
    wall = (impulse[:2].mean() * a[0] + impulse[2:].mean() * a[1]) / work
    moved = [np.sum(run.mass[:, None] * run.velocity[k] * (run.position[k] - 0.5)) for k in (0, -1)]
    return wall, 1 + run.observable("virial").value[-1] / work, (moved[1] - moved[0]) / work


IDENTITIES = (
    identity(2, 100_000, radius=0.15),
    identity(100, 100_000, radius=0.01),
    identity(100, 100_000, radius=0.035),
    identity(1000, 100_000, radius=0.004),
)

DILUTE_CASES = [
    Case(
        "P7-05", "dilute gas between walls: F a / (N kT)",
        DILUTE, lambda *runs: combined([z_wall(run) for run in runs]),
        1.0664, relative(0.003), "D, R",
    ),
    Case(
        "P7-06", "the same: wall pressure over virial pressure",
        DILUTE, lambda *runs: [z_wall(run).mean / z_virial(run).mean for run in runs],
        1, within(1e-3), "D",
    ),
    Case(
        "P7-06", "virial identity after 1e5 collisions, N = 2 and 100: wall over virial pressure",
        IDENTITIES[:3], lambda *runs: [np.divide(*identity_terms(run)[:2]) for run in runs],
        1, within(1e-3), "D",
    ),
    Case(
        "P7-06", "the same with its boundary term, N up to 1000: exact",
        IDENTITIES, lambda *runs: [np.dot(identity_terms(run), (1, -1, 1)) for run in runs],
        0, within(1e-11), "D",
    ),
]  # fmt: skip

# --- mixtures ---


def mixture(count: int, radii: tuple, masses: tuple, seed: int = 1, **output) -> str:
    """Half of each, periodic, kT = 1."""
    species = [
        {"name": name, "count": count // 2, "radius": r, "mass": m, "temperature": 1.0}
        for name, r, m in zip(("first", "second"), radii, masses, strict=True)
    ]
    return namelist(
        run={"seed": seed},
        box=PERIODIC,
        species=species,
        stop={"collisions_per_disk": 2000},
        output=output,
    )


def radii_for(eta: float, factor: float, count: int) -> tuple[float, float]:
    small = sqrt(eta / (pi * count / 2 * (1 + factor**2)))
    return small, factor * small


def two_radii(eta: float) -> tuple[Member, ...]:
    return tuple(
        Member(mixture(N, radii_for(eta, 1.4, N), (1, 1), seed, observables_every_collisions=500))
        for seed in (1, 2, 3)
    )


def mixed_z(eta: float) -> float:
    """Z of radii 1 : 1.4, half of each."""
    return mixture_z(2 * np.array(radii_for(eta, 1.4, N)), [N / 2, N / 2])


SPECIES_RATES = tuple(
    Member(mixture(N, radii_for(0.1, 2, N), (1, 4), seed, event_log=True)) for seed in (1, 2, 3, 4)
)


def species_rates(run: Run) -> np.ndarray:
    """w_11, w_12, w_21, w_22 at kT = 1."""
    log = run.events
    pairs = log.j > 0
    kinds = run.species[np.stack([log.i[pairs], log.j[pairs]]) - 1] - 1
    counts = np.zeros((2, 2))
    np.add.at(counts, (kinds[0], kinds[1]), 1)
    np.add.at(counts, (kinds[1], kinds[0]), 1)
    per_disk = counts / np.bincount(run.species)[1:, None] / run.time[-1]
    kt = np.sum(run.kinetic_energy(0)) / (run.count - 1)
    return (per_disk / sqrt(kt)).ravel()


MIXTURES = [
    *[
        Case(
            "P8-02", f"radii 1 : 1.4, packing {eta}: Z",
            two_radii(eta), lambda *runs: combined([z_virial(run) for run in runs]),
            mixed_z(eta), relative(0.004), "Santos, Yuste and Lopez de Haro 2002",
        )
        for eta in (0.3, 0.5)
    ],
    Case(
        "P7-07", "radii 1 : 2, masses 1 : 4, packing 0.1: w_ij",
        SPECIES_RATES, lambda *runs: over_runs(species_rates, runs),
        mixture_rates(2 * np.array(radii_for(0.1, 2, N)), [N / 2, N / 2], [1, 4]).ravel(),
        relative(0.01), "section 7",
    ),
]  # fmt: skip

# --- dense ---


def dense(count: int, eta: float, placement: str, tau: float) -> tuple[Member, ...]:
    return tuple(
        long_gas(count, tau, seed, packing_fraction=eta, periodic=True, placement=placement)
        for seed in (1, 2)
    )


def lattice(columns: int, rows: int, eta: float, tau: float) -> Member:
    """A triangular crystal that fits its periodic box."""
    edges = (1.0, rows / columns * sqrt(3) / 2)
    every = int(tau * columns * rows / 4000)
    return Member(
        namelist(
            box={"upper": edges, **PERIODIC},
            species={
                "count": columns * rows, "packing_fraction": eta, "placement": "lattice",
                "speed": ROOT_2,
            },
            stop={"collisions_per_disk": tau}, output={"observables_every_collisions": every},
        )
    )  # fmt: skip


# Packing: beta P (2 r)^2 of 870 disks in a square box.
NEAR_FREEZING = {0.67: 7.986779, 0.69: 8.969898}

DENSE = [
    Case(
        "P8-04", f"dense start, packing {hd.FLUID[k, 0]:.4f}, N = 1024: Z",
        dense(1024, float(hd.FLUID[k, 0]), "dense", 4000),
        lambda *runs: combined([z_virial(run) for run in runs]),
        hd.FLUID[k, 1], relative(0.005), "Erpenbeck and Luban 1985",
    )
    for k in (10, 11, 12)
] + [
    Case(
        "P8-04", f"dense start, packing {eta}, N = 870: Z",
        dense(870, eta, "dense", 15000), lambda *runs: combined([z_virial(run) for run in runs]),
        pressure * pi / (4 * eta), relative(0.005), "Li et al., J. Chem. Phys. 157, 234111 (2022)",
    )
    for eta, pressure in NEAR_FREEZING.items()
] + [
    Case(
        "P8-05", "lattice start, crystal at packing 0.80: Z",
        (lattice(30, 32, 0.80, 4000),), z_virial, hd.crystal(0.80, 960), relative(0.005),
        "Alder, Hoover and Young 1968",
    ),
]  # fmt: skip

CASES = BULK + WALLS + TWO + DILUTE_CASES + MIXTURES + DENSE
