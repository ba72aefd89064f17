"""Published results for mixtures of hard disks: collisions, transport, cooling.

S is the number of species. `z` is Z = P / (n kT) of equal disks at the packing fraction of the
mixture.
"""

import math

import numpy as np
import scipy

from .hard_disks import contact_value

__all__ = ["cooling_ratio", "self_diffusion"]


def contact_values(z: float, density: np.ndarray, diameter: np.ndarray) -> np.ndarray:
    """Return the pair correlation functions at contact (S, S) of a mixture, to about 1 %.

    The formulas are those of Jenkins and Mancini, Journal of Applied Mechanics 54, 27 (1987),
    except that chi of equal disks is calculated from `z`, as in Santos, Yuste and Lopez de Haro,
    Journal of Chemical Physics 117, 5785 (2002).
    """
    eta = math.pi / 4 * np.sum(density * diameter**2)
    mean = np.sum(density * diameter) / np.sum(density * diameter**2)
    unlike = 2 * diameter[:, None] * diameter / (diameter[:, None] + diameter)
    return 1 / (1 - eta) + (contact_value(z, eta) - 1 / (1 - eta)) * unlike * mean


def enskog_mixture(
    z: float, density: np.ndarray, diameter: np.ndarray, mass: np.ndarray, kt: float = 1.0
) -> dict[str, float]:
    """Return the viscosities of a mixture, and the decay time "memory" of its fluxes.

    The theory is the first Sonine approximation of Lopez de Haro, Cohen and Kincaid, Journal of
    Chemical Physics 78, 2746 (1983), in two dimensions. The kinetic part of the shear viscosity is
    multiplied by 1.022. In a dilute gas of equal disks, higher approximations increase the
    viscosity by this factor. The bulk viscosity accounts for the unequal temperatures of the
    species during an expansion.
    """
    total, pair = mass[:, None] + mass, (diameter[:, None] + diameter) / 2
    reduced = mass[:, None] * mass / total
    # rates (i, j) of collisions of species i with j, except for the factor of the mean relative
    # speed
    met = density * pair * contact_values(z, density, diameter)
    # twice this rate applies to temperatures
    rate = met * 2 * np.sqrt(2 * math.pi * kt * reduced) / total
    # including the collisional transfer
    handed = 1 + math.pi / 2 * np.sum(met * pair * mass / total, axis=1)
    stress = np.diag(np.sum(rate * (2 + mass / mass[:, None]), axis=1)) - rate
    lives = np.linalg.solve(stress, handed)
    sums, share = 2 * rate.sum(axis=1), density / density.sum()
    heat = np.diag(sums) - 2 * rate + sums.max() * share  # conserves the mean
    cooler = np.linalg.solve(heat, 2 * handed - 2 * share @ handed)
    together = np.sum(density[:, None] * met * pair**2 * np.sqrt(math.pi / 2 * kt * reduced))
    slowest = min(np.linalg.eigvals(matrix).real.min() for matrix in (stress, heat))
    return {
        "viscosity": float(1.022 * kt * density @ (lives * handed) + together / 2),
        "bulk_viscosity": float(together + 2 * kt * density @ (handed * cooler)),
        "memory": float(1 / slowest),
    }


def self_diffusion(
    z: float, density: np.ndarray, diameter: np.ndarray, mass: np.ndarray, kt: float = 1.0
) -> np.ndarray:
    """Return the diffusion coefficient of single disks of each species in Enskog's theory.

    In the first Sonine approximation, D_i = kT / sum_j z_ij with z_ij = 2 n_j s_ij chi_ij sqrt(2 pi
    m_ij kT), where s_ij is the mean diameter and m_ij the reduced mass of the pair. Higher
    approximations increase D of light tracers. A species of density 0 consists of tracers, which
    collide only with other species.

    Parameters
    ----------
    z : float
        P / (n kT) of equal disks at the packing fraction of the mixture
    density, diameter, mass : numpy.ndarray
        (S,) disks per area, diameter and mass of each species
    kt : float
        temperature

    Returns
    -------
    numpy.ndarray
        (S,) diffusion coefficients [length^2/time]

    Examples
    --------
    A tracer that differs from the disks of a dilute gas by its mass:

    >>> n, s, m = np.array([0.01, 0.0]), np.ones(2), np.array([1.0, 1e6])
    >>> own, heavy = mixtures.self_diffusion(hard_disks.henderson(0.01 * np.pi / 4), n, s, m)
    >>> round(float(own / heavy), 4)
    1.4142
    """
    pair = (diameter[:, None] + diameter) / 2
    reduced = mass[:, None] * mass / (mass[:, None] + mass)
    met = density * pair * contact_values(z, density, diameter)  # (i, j)
    friction = 2 * np.sum(met * np.sqrt(2 * math.pi * kt * reduced), axis=1)
    return kt / friction


def cooling_ratio(
    mass_ratio: float, restitution: float, share: float = 0.5, diameter_ratio: float = 1.0
) -> float:
    """Return the ratio of the temperatures of two species in a cooling dilute gas.

    At this ratio both species cool at the same rate. The cooling rates are taken from Garzo and
    Dufty, Physical Review E 60, 5706 (1999), in two dimensions, for Maxwellian velocities in each
    species.

    Parameters
    ----------
    mass_ratio : float
        mass of a disk of the second species divided by that of the first
    restitution : float
        coefficient of normal restitution of all collisions
    share : float
        fraction of the disks in the second species
    diameter_ratio : float
        diameter of a disk of the second species divided by that of the first

    Returns
    -------
    float
        T2 / T1

    Examples
    --------
    >>> round(mixtures.cooling_ratio(4, 0.8), 3), round(mixtures.cooling_ratio(4, 1.0), 3)
    (1.341, 1.0)
    """
    mass, part = np.array([1.0, mass_ratio]), np.array([1 - share, share])
    size = np.array([1.0, diameter_ratio])
    opposite = mass / (mass[:, None] + mass)  # m_j / (m_i + m_j)

    def difference(log: float) -> float:
        square = np.array([1.0, np.exp(log)]) / mass  # kT / m
        total = square[:, None] + square
        gain = 1 - opposite * (1 + restitution) / 2 * total / square[:, None]
        met = part * (size[:, None] + size) / 2 * np.sqrt(total)
        rates = np.sum(met * opposite * gain, axis=1)
        return float(rates[1] - rates[0])

    return float(np.exp(scipy.optimize.brentq(difference, -9.0, 9.0, xtol=1e-13)))
