"""Published results used only in the validation, with the symbols of `ricochet.hard_disks`."""

import math

import numpy as np

from ricochet import hard_disks as hd, mixtures


def mixture_rates(diameters, density, masses, kt: float = 1.0) -> np.ndarray:
    """Return w_ij, the rate of collisions of a disk of species i with disks of species j."""
    s, n, m = (np.asarray(a, dtype=float) for a in (diameters, density, masses))
    pair = (s[:, None] + s) / 2
    reduced = 2 * math.pi * kt * (1 / m[:, None] + 1 / m)
    z = float(hd.simulated(math.pi / 4 * np.sum(n * s**2)))
    return n * pair * mixtures.contact_values(z, n, s) * np.sqrt(reduced)


def noise_kurtosis(xi: float) -> float:
    """Return a2 for white-noise driving: van Noije and Ernst, Granular Matter 1, 57 (1998)."""
    return 16 * (1 - xi) * (1 - 2 * xi**2) / (185 - 153 * xi + 30 * (1 - xi) * xi**2)


def sheared_grains(xi: float) -> tuple[float, float, float]:
    """Return shear rate, -P_xy and P_yy of a dilute inelastic gas in steady uniform shear.

    The shear rate is in units of nu = 2 sqrt(pi) n sigma sqrt(T / m), the stresses in units of the
    pressure. Santos, Garzo and Dufty, Phys. Rev. E 69, 061303 (2004), in two dimensions: the stress
    relaxes at the rate beta nu, and the cooling rate is zeta nu.
    """
    beta, zeta = (1 + xi) / 2 * (1 - (1 - xi) / 4), (1 - xi**2) / 2
    rate = math.sqrt(zeta / beta) * (beta + zeta)
    return rate, zeta / rate, beta / (beta + zeta)
