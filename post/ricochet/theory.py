"""Laws that figures are compared with: speeds, scattering, relaxation of a dilute gas.

Two dimensions throughout; u = v / sqrt(2 kT / m) is the reduced speed, x = K / kT = u^2.
"""

import numpy as np

from .statistics import Law

# Dilute gas of hard disks, by Monte Carlo solution of the Boltzmann equation (10^6 disks).
# (collisions per disk, excess kurtosis a2), from equal speeds.
RELAXATION = np.transpose(
    [(0, 1, 2, 3, 4, 5, 6, 8), (-0.5, -0.370, -0.264, -0.184, -0.125, -0.0855, -0.0565, -0.025)]
)
# (collisions per disk, temperature ratio heavy / light), half m and half 4 m, from equal speeds.
EQUIPARTITION = np.transpose(
    [(0, 1, 2, 3, 4, 5, 6, 8), (4, 2.02, 1.455, 1.228, 1.115, 1.062, 1.031, 1.005)]
)


def maxwell_pdf(u: np.ndarray) -> np.ndarray:
    """Density of the reduced speed in equilibrium, 2 u exp(-u^2)."""
    return 2 * u * np.exp(-(u**2))


def maxwell_cdf(u: np.ndarray) -> np.ndarray:
    """Its distribution function, 1 - exp(-u^2)."""
    return -np.expm1(-np.square(u))


def finite_n_cdf(count: int, periodic: bool = False) -> Law:
    """The exact law of u for `count` disks that share a fixed energy, kT = E/N.

    Between walls K/E follows the Beta(1, N-1) law whatever the masses; in a periodic box of
    equal disks at rest as a whole, K N / (E (N-1)) follows Beta(1, N-2).
    """
    free, scale = (count - 2, count - 1) if periodic else (count - 1, count)
    return lambda u: 1 - np.clip(1 - np.square(u) / scale, 0, 1) ** free


def scattering_angle(b: np.ndarray, mass_ratio: float = np.inf, restitution: float = 1.0):
    """Deflection [rad] of a disk hitting one at rest, b = impact parameter / (r1 + r2).

    `mass_ratio` is the mass at rest over the moving mass; infinite and elastic: 2 acos b.
    """
    b = np.minimum(np.abs(b), 1.0)
    kappa = 0.5 * (1 + restitution) / (1 + 1 / mass_ratio)
    cosine = np.sqrt(1 - b**2)
    return np.arctan2(2 * kappa * b * cosine, 1 - 2 * kappa * cosine**2)
