"""Sections 7 and 8 of the report: collision rates, pressure, equation of state."""

from math import gamma, pi, sqrt

import numpy as np

from ricochet import Run, hard_disks as hd
from ricochet.analysis.statistics import SeriesMean
from ricochet.analysis.thermodynamics import collision_rate, packing, z_rate, z_virial, z_wall

from .case import Case, Member, relative, sigmas, within
from .estimators import each, force, hit_rate, over, pooled, several
from .inputs import PERIODIC, ROOT_2, ensemble, gases
from .laws import mixture_rates

N = 1000


def long_gases(seeds: int, count: int, tau: float, **more) -> tuple[Member, ...]:
    """Return gases with 2000 samples of the observables in `tau` collisions per disk."""
    output = {"observables_every_collisions": max(1, int(tau * count / 4000))}
    return gases(seeds, count, stop={"collisions_per_disk": tau}, output=output, **more)


# --- periodic ---

PACKINGS = tuple(round(0.05 * k, 2) for k in range(1, 11))


def bulk(eta: float) -> tuple[Member, ...]:
    """Return periodic gases, in longer runs where the pressure is tested as well."""
    seeds = 4 if eta in (0.1, 0.3, 0.5) else 1
    return long_gases(seeds, N, 4000, packing_fraction=eta, periodic=True)


def reduced_rate(run: Run) -> SeriesMean:
    """Return the collision rate w at kT = m = 1."""
    scale = sqrt(run.n_disks / (run.n_disks - 1))  # speeds are sqrt(2), and the total momentum is 0
    return collision_rate(run).scaled(1 / scale)


def pair_rate(run: Run) -> SeriesMean:
    """Return the number of pair collisions per time."""
    return collision_rate(run).scaled(run.n_disks / 2)


def rate_reference(eta: float) -> float:
    diameter = 2 * sqrt(eta / (pi * N))
    return hd.collision_rate(hd.simulated_finite(eta, N), diameter, N - 1)


BULK = [
    Case(
        "P7-01", f"periodic box, packing {eta:.2f}: collision rate",
        bulk(eta), pooled(reduced_rate),
        rate_reference(eta), relative(0.004), "KR",
    )
    for eta in PACKINGS
] + [
    case
    for eta in (0.1, 0.3, 0.5)
    for case in (
        Case(
            "P8-01", f"periodic box, packing {eta}: Z by the virial",
            bulk(eta), pooled(z_virial),
            hd.simulated_finite(eta, N), sigmas(3, 0.003), "KR",
        ),
        Case(
            "P8-01", f"periodic box, packing {eta}: Z by the virial over Z by the collision rate",
            bulk(eta), lambda *runs: pooled(z_virial)(*runs).mean / pooled(z_rate)(*runs).mean,
            1, within(1e-3), "D",
        ),
    )
] + [
    Case(
        "P8-01", "periodic box, packing 0.3, N = 256: Z by the virial",
        long_gases(4, 256, 4000, packing_fraction=0.3, periodic=True),
        pooled(z_virial),
        hd.simulated_finite(0.3, 256), sigmas(3, 0.003), "KR",
    ),
]  # fmt: skip

# --- walls ---

# by radius: w, collision rate of all sides, force on a side, length in collisions per disk
WALLED = {
    0.001: (7.118, 1608.5, 1008.33, 4000),
    0.004: (30.93, 1784, 1118.4, 20000),
    0.007: (65.30, 2279, 1424.6, 25000),
    0.010: (131.64, 3543, 2211, 25000),
    0.0126157: (282.6, 6802, 4269, 20000),
}


WALLS = [
    Case(
        "P7-02", f"walls, radius {radius}: rates of pair and wall collisions, force",
        long_gases(1, N, values[3], radius=radius),
        lambda run: several([collision_rate(run), hit_rate(run), force(run)]),
        values[:3], relative(0.01), "R",
    )
    for radius, values in WALLED.items()
]  # fmt: skip

# --- exact: two disks ---


def two_exact(s: float) -> list[float]:
    """Return pair collision rate, side collision rate and force on a side for E = 2."""
    a, n, energy = 1 - s, 2, 2.0
    q = a**4 - pi * s**2 * a**2 + 8 / 3 * s**3 * a - s**4 / 2
    dq_ds = -(2 * pi * s * a**2 - 8 * s**2 * a + 2 * s**3)
    dq_da = 2 * a**3 - pi * s**2 * a + 4 / 3 * s**3  # derivative with respect to one edge
    u = sqrt(2 * energy) * gamma(n) / (sqrt(pi) * gamma(n + 0.5))
    return [-dq_ds / q * u / sqrt(2), 2 * dq_da / q * u, dq_da / q * energy / n]


TWO = [
    Case(
        "P7-04", f"two disks, radius {radius}: rates of pair and wall collisions, force",
        ensemble(
            (7,), species={"count": 2, "radius": radius, "speed": ROOT_2},
            stop={"collisions": 4_000_000}, output={"observables_every_collisions": 2000},
        ),
        lambda run: several([pair_rate(run), hit_rate(run), force(run)]),
        two_exact(2 * radius), relative(tolerance), "D",
    )
    for radius, tolerance in ((0.1, 0.005), (0.15, 0.003))
]  # fmt: skip

# --- dilute gases, and the virial theorem ---

DILUTE = long_gases(2, 100, 40000, radius=0.01)


IDENTITIES = tuple(
    member
    for count, radius in ((2, 0.15), (100, 0.01), (100, 0.035), (1000, 0.004))
    for member in gases(
        1, count, radius=radius, contact={"wall_rule": "normal"},
        stop={"collisions": 100_000}, output={"observables_every_collisions": 1000},
    )
)  # fmt: skip


def identity_terms(run: Run) -> tuple[float, float, float]:
    """Return wall pressure, virial pressure, and the term d(sum m x v) / (2 K t) of a whole run."""
    work = 2 * np.sum(run.kinetic_energy(0)) * run.time[-1]
    impulse, a = run.observable("side_impulse").value[-1], run.edges - 2 * run.radius[0]
    wall = (impulse[:2].mean() * a[0] + impulse[2:].mean() * a[1]) / work
    moved = [np.sum(run.mass[:, None] * run.velocity[k] * (run.position[k] - 0.5)) for k in (0, -1)]
    return wall, 1 + run.observable("virial").value[-1] / work, (moved[1] - moved[0]) / work


DILUTE_CASES = [
    Case(
        "P7-05", "dilute gas between walls: force on a side, F a / (N kT)",
        DILUTE, pooled(z_wall),
        1.0664, relative(0.003), "D, R",
    ),
    Case(
        "P7-06", "dilute gas between walls: wall pressure over virial pressure",
        DILUTE, each(lambda run: z_wall(run).mean / z_virial(run).mean),
        1, within(1e-3), "D",
    ),
    Case(
        "P7-06", "virial theorem, N = 2 and 100: wall pressure over virial pressure",
        IDENTITIES[:3], each(lambda run: np.divide(*identity_terms(run)[:2])),
        1, within(1e-3), "D",
    ),
    Case(
        "P7-06", "virial theorem with its boundary term, N up to 1000: exact",
        IDENTITIES, each(lambda run: np.dot(identity_terms(run), (1, -1, 1))),
        0, within(1e-11), "D",
    ),
]  # fmt: skip

# --- mixtures ---


def mixtures(seeds: int, radii: tuple, masses: tuple, **output) -> tuple[Member, ...]:
    """Return periodic mixtures of two equally numerous species at kT = 1."""
    species = [
        {"name": name, "count": N // 2, "radius": r, "mass": m, "temperature": 1.0}
        for name, r, m in zip(("first", "second"), radii, masses, strict=True)
    ]
    stop = {"collisions_per_disk": 2000}
    return ensemble(seeds, box=PERIODIC, species=species, stop=stop, output=output)


def radii_for(eta: float, factor: float) -> tuple[float, float]:
    small = sqrt(eta / (pi * N / 2 * (1 + factor**2)))
    return small, factor * small


def species_rates(run: Run) -> np.ndarray:
    """Return the collision rates w_11, w_12, w_21, w_22 at kT = 1."""
    log = run.event_log()
    pairs = log.j > 0
    kinds = run.species[np.stack([log.i[pairs], log.j[pairs]]) - 1] - 1
    counts = np.zeros((2, 2))
    np.add.at(counts, (kinds[0], kinds[1]), 1)
    np.add.at(counts, (kinds[1], kinds[0]), 1)
    per_disk = counts / np.bincount(run.species)[1:, None] / run.time[-1]
    kt = np.sum(run.kinetic_energy(0)) / (run.n_disks - 1)
    return (per_disk / sqrt(kt)).ravel()


def over_equation_of_state(run: Run) -> SeriesMean:
    """Return Z from the virial, relative to its prediction for the radii of the run."""
    eta, alike = packing(run), np.mean(run.radius) ** 2 / np.mean(run.radius**2)
    return z_virial(run).scaled(1 / float(hd.of_sizes(hd.simulated_finite(eta, N), eta, alike)))


def polydisperse(eta: float, law: str, spread: float) -> tuple[Member, ...]:
    """Return periodic gases of polydisperse disks with masses proportional to their areas."""
    size = {"polydispersity": spread, "radius_distribution": law, "mass_scaling": "area"}
    return long_gases(2, N, 2000, packing_fraction=eta, periodic=True, **size)


MIXTURES = [
    *[
        Case(
            "P8-02", f"mixture, radii 1 : 1.4, packing {eta}: Z over the equation of state",
            mixtures(3, radii_for(eta, 1.4), (1, 1), observables_every_collisions=500),
            pooled(over_equation_of_state), 1,
            relative(0.004), "Santos, Yuste and Lopez de Haro 1999",
        )
        for eta in (0.3, 0.5)
    ],
    *[
        Case(
            "P8-02",
            f"{law} radii, polydispersity {spread}, packing {eta}: Z over the equation of state",
            polydisperse(eta, law, spread), pooled(over_equation_of_state),
            1, relative(0.005), "Santos, Yuste and Lopez de Haro 1999",
        )
        for law, spread in (("uniform", 0.47), ("lognormal", 0.39))
        for eta in (0.3, 0.5)
    ],
    Case(
        "P7-07", "radii 1 : 2, masses 1 : 4, packing 0.1: collision rates of each pair of species",
        mixtures(4, radii_for(0.1, 2), (1, 4), event_log=True), over(species_rates),
        mixture_rates(2 * np.array(radii_for(0.1, 2)), [N / 2, N / 2], [1, 4]).ravel(),
        relative(0.01), "Jenkins and Mancini 1987; Santos, Yuste and Lopez de Haro 2002",
    ),
]  # fmt: skip

# --- dense ---


def dense(count: int, eta: float, tau: float) -> tuple[Member, ...]:
    more = {"packing_fraction": eta, "periodic": True, "placement": "dense"}
    return long_gases(2, count, tau, **more)


#: A triangular crystal commensurate with its periodic box.
COLUMNS, ROWS = 30, 32
CRYSTAL = long_gases(
    1, COLUMNS * ROWS, 4000, packing_fraction=0.80, placement="lattice",
    box={"upper": (1.0, ROWS / COLUMNS * sqrt(3) / 2), **PERIODIC},
)  # fmt: skip


# By packing fraction: P d^2 / kT of 870 disks in a square box.
NEAR_FREEZING = {0.67: 7.986779, 0.69: 8.969898}

DENSE = [
    Case(
        "P8-04", f"dense start, packing {hd.FLUID[k, 0]:.4f}, N = 1024: Z",
        dense(1024, float(hd.FLUID[k, 0]), 4000), pooled(z_virial),
        hd.FLUID[k, 1], relative(0.005), "Erpenbeck and Luban 1985",
    )
    for k in (10, 11, 12)
] + [
    Case(
        "P8-04", f"dense start, packing {eta}, N = 870: Z",
        dense(870, eta, 15000), pooled(z_virial),
        pressure * pi / (4 * eta), relative(0.005), "Li et al., J. Chem. Phys. 157, 234111 (2022)",
    )
    for eta, pressure in NEAR_FREEZING.items()
] + [
    Case(
        "P8-05", "crystal from a lattice, packing 0.80: Z",
        CRYSTAL, z_virial, hd.crystal(0.80, 960), relative(0.005),
        "Alder, Hoover and Young 1968",
    ),
]  # fmt: skip

CASES = BULK + WALLS + TWO + DILUTE_CASES + MIXTURES + DENSE
