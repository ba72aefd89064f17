"""Theoretical results: speed distributions, scattering, relaxation, rough disks, two chambers.

All results are for two dimensions. u = v / sqrt(2 kT / m) is the reduced speed.
"""

from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import ArrayLike

__all__ = [
    "demon_share",
    "maxwell_cdf",
    "maxwell_pdf",
    "rough_ratio",
    "scattering_angle",
]

#: Cumulative distribution function or probability density.
Law = Callable[[np.ndarray], np.ndarray]

# Relaxation of a dilute gas of disks with equal initial speeds, from Monte Carlo solutions of the
# Boltzmann equation with 10^6 disks: collisions per disk, and the second Sonine coefficient a2
# after this number of collisions.
RELAXATION = np.transpose(
    [(0, 1, 2, 3, 4, 5, 6, 8), (-0.5, -0.370, -0.264, -0.184, -0.125, -0.0855, -0.0565, -0.025)]
)
# Relaxation of a dilute mixture, from Monte Carlo solutions of the Boltzmann equation: collisions
# per disk, and the ratio of the temperatures of heavy and light disks after this number of
# collisions. Half of the disks have the mass m and half the mass 4 m.
EQUIPARTITION = np.transpose(
    [(0, 1, 2, 3, 4, 5, 6, 8), (4, 2.02, 1.455, 1.228, 1.115, 1.062, 1.031, 1.005)]
)


def maxwell_pdf(u: np.ndarray) -> np.ndarray:
    """Return the probability density of the reduced speed in equilibrium.

    Parameters
    ----------
    u : numpy.ndarray
        (n,) reduced speeds v / sqrt(2 kT / m)

    Returns
    -------
    numpy.ndarray
        (n,) 2 u exp(-u^2)

    Examples
    --------
    >>> float(theory.maxwell_pdf(np.array([0.0]))[0])
    0.0
    """
    return 2 * u * np.exp(-(u**2))


def maxwell_cdf(u: np.ndarray) -> np.ndarray:
    """Return the cumulative distribution function of the reduced speed in equilibrium.

    Parameters
    ----------
    u : numpy.ndarray
        (n,) reduced speeds v / sqrt(2 kT / m)

    Returns
    -------
    numpy.ndarray
        (n,) 1 - exp(-u^2)

    Examples
    --------
    >>> round(float(theory.maxwell_cdf(1.0)), 4)
    0.6321
    """
    return -np.expm1(-np.square(u))


def finite_n_cdf(count: int, periodic: bool = False) -> Law:
    """Return the exact distribution function of u = v / sqrt(2 kT / m) at fixed total energy N kT.

    In a box with walls, the energy of a disk, as a fraction K / E of the total energy, is
    distributed as Beta(1, N - 1) for any masses. In a periodic box, K N / (E (N - 1)) of equal
    disks with zero total momentum is distributed as Beta(1, N - 2). N is `count`.
    """
    free, scale = (count - 2, count - 1) if periodic else (count - 1, count)
    return lambda u: 1 - np.clip(1 - np.square(u) / scale, 0, 1) ** free


def path_density(x: np.ndarray) -> np.ndarray:
    """Return the probability density (n,) of free paths x (n,), in units of the mean <v> / w.

    Under molecular chaos, the collision rate nu(v) of a disk is proportional to its mean speed
    relative to a Maxwellian gas.
    """
    u = np.linspace(0, 5, 2001)[1:]  # v / sqrt(2 kT / m)
    half = u**2 / 2
    slow, fast = (scipy.special.ive(order, half) for order in (0, 1))
    nu = ((1 + u**2) * slow + u**2 * fast) / np.sqrt(2)
    rate = nu / (u * 2 / np.sqrt(np.pi))  # collisions per mean free path
    weight = 2 * u * np.exp(-(u**2)) * nu
    weight /= np.sum(weight)
    return np.array([np.sum(weight * rate * np.exp(-rate * value)) for value in x])


def scattering_angle(
    b: ArrayLike, mass_ratio: float = np.inf, restitution: float = 1.0
) -> np.ndarray:
    """Return the scattering angle of a disk that hits a smooth disk at rest.

    Parameters
    ----------
    b : array_like
        (...) impact parameter divided by r1 + r2
    mass_ratio : float
        mass of the disk at rest divided by that of the moving disk
    restitution : float
        coefficient of normal restitution

    Returns
    -------
    numpy.ndarray
        (...) angle [rad]; 2 acos(b) for an elastic collision with an infinitely heavy disk

    Examples
    --------
    >>> float(theory.scattering_angle(0.0)) == np.pi, float(theory.scattering_angle(1.0))
    (True, 0.0)
    """
    b = np.minimum(np.abs(b), 1.0)
    kappa = 0.5 * (1 + restitution) / (1 + 1 / mass_ratio)
    cosine = np.sqrt(1 - b**2)
    return np.arctan2(2 * kappa * b * cosine, 1 - 2 * kappa * cosine**2)


# Late temperature ratio T_rot / T of cooling rough disks, by normal and tangential restitution (xi,
# beta). The moment of inertia is m r^2 / 2, and the tangential impulse has no Coulomb limit. From
# direct simulations of the Boltzmann equation with 10^5 disks; the errors are 0.002.
ROUGH_RATIOS = {(0.9, 0.0): 0.4439, (0.9, 0.8): 1.0055, (0.85, 0.3): 0.708}


def rough_rates(xi: float, beta: float, inertia: float) -> tuple[float, float, float]:
    """Return A, B and C of dT/ds = -2 (A T - B R) and dR/ds = 4 (B T - C R) for rough disks.

    T = m <v^2> / 2 and R = I <omega^2> are the temperatures, s is the number of collisions per
    disk, and `inertia` is I / m r^2. The coefficients are those of Luding, Huthmann, McNamara and
    Zippelius, Physical Review E 57, 3416 (1998), for Maxwellian velocities.
    """
    eta = inertia * (1 + beta) / (2 * inertia + 2)
    a = (1 - xi**2) / 4 + eta * (1 - eta) / 2
    return a, eta**2 / (2 * inertia), eta / (2 * inertia) * (1 - eta / inertia)


def rough_ratio(xi: float, beta: float, inertia: float) -> float:
    """Return the limit of the temperature ratio R / T of cooling rough disks.

    The theory is that of Luding, Huthmann, McNamara and Zippelius, Physical Review E 57, 3416
    (1998), for Maxwellian velocities.

    Parameters
    ----------
    xi, beta : float
        normal and tangential restitution
    inertia : float
        moment of inertia divided by m r^2

    Returns
    -------
    float
        R / T, with R = I <omega^2> and T = m <v^2> / 2

    Examples
    --------
    >>> round(theory.rough_ratio(1.0, 1.0, 0.5), 6)
    1.0
    """
    a, b, c = rough_rates(xi, beta, inertia)
    return float(((a - 2 * c) + np.sqrt((a - 2 * c) ** 2 + 8 * b**2)) / (2 * b))


def rough_temperatures(
    tau: np.ndarray, start: tuple[float, float], xi: float, beta: float, inertia: float
) -> np.ndarray:
    """Return both temperatures (2, T) of cooling rough disks after tau (T,) collisions per disk.

    `start` holds the initial translational and rotational temperature. The theory is the same as in
    `rough_ratio`.
    """
    a, b, c = rough_rates(xi, beta, inertia)
    values, vectors = np.linalg.eig(np.array([[-2 * a, 2 * b], [4 * b, -4 * c]]))
    parts = np.linalg.solve(vectors, np.array(start))
    return vectors @ (parts[:, None] * np.exp(values[:, None] * np.asarray(tau, dtype=float)))


def pushed_width(
    widths: np.ndarray, places: np.ndarray, squares: int, energy: np.ndarray
) -> tuple[float, float]:
    """Return mean and variance of the width of a box closed by a piston under a constant force.

    The probability density of the width w is proportional to Q(w) (H - F w)^(f/2 - 1), where f is
    the number of degrees of freedom, `squares` (docs/explanation/theory.md). `places` (W,) and
    `energy` (W,) are ln Q and H - F w at the equally spaced `widths` (W,). Q is the configuration
    integral; ln Q is NaN where it is unknown.
    """
    log = np.where(np.isnan(places), -np.inf, places) + (squares / 2 - 1) * np.log(energy)
    density = np.exp(log - log.max())
    mean = np.average(widths, weights=density)
    return float(mean), float(np.average((widths - mean) ** 2, weights=density))


def demon_share(climb: float, layers: float, xi: float) -> float:
    """Return the fraction of a dilute gas in the fuller of two chambers above a vibrating floor.

    The chambers are connected by a hole at height h. The flux out of a chamber is proportional to
    n^2 exp(-m g h / T). In the steady state both fluxes through the hole are equal (Eggers,
    Physical Review Letters 83, 5322 (1999)). T is determined by the energy balance of a chamber of
    width w with n disks of diameter s. A floor with a sawtooth motion of velocity V supplies the
    power n m g V. Collisions dissipate n^2 m g s sqrt(pi) (1 - xi^2) sqrt(T/m) / 2w per unit of
    time. Both are equal if T/m = (2 V w / (n s sqrt(pi) (1 - xi^2)))^2.

    Parameters
    ----------
    climb : float
        g h / V^2
    layers : float
        N s / w, where N is the number of disks in both chambers
    xi : float
        coefficient of restitution, below 1

    Returns
    -------
    float
        fraction in the fuller chamber; 1/2 where the equal distribution is stable, m g h < T

    Examples
    --------
    >>> theory.demon_share(0.1, 0.5, 0.9)
    0.5
    >>> theory.demon_share(20.0, 2.0, 0.8) > 0.9
    True
    """
    # m g h / T if all disks were in one chamber
    steep = climb * np.pi * (layers * (1 - xi**2) / 2) ** 2

    def excess(odds: float) -> float:  # logarithm of the ratio of the two fractions
        return odds - steep / 2 * np.tanh(odds / 2)

    if steep <= 4:
        return 0.5
    odds = scipy.optimize.brentq(excess, np.sqrt(3 * (1 - 4 / steep)), steep / 2)
    return float(1 / (1 + np.exp(-odds)))
