"""Published results for hard disks: equation of state, collision rates, cooling, transport.

Symbols: eta is the packing fraction, n the number of disks per area, s the diameter, m the mass, w
the rate of pair collisions per disk, chi the pair correlation function at contact, and Z = P / (n
kT) the compressibility factor.
"""

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ..reading.arrays import Number
from ..reading.reader import Restitution

__all__ = [
    "collision_rate",
    "crystal",
    "enskog",
    "haff_by_time",
    "haff_rate",
    "henderson",
    "noise_temperature",
    "simulated",
]

CLOSE_PACKING = math.pi / math.sqrt(12)
# Packing fractions and Z of the fluid from published simulations: Kolafa and Rottner, Molecular
# Physics 104, 3435 (2006), up to 0.5; Erpenbeck and Luban, Physical Review A 32, 2920 (1985),
# above.
FLUID = np.array([
    (0.05, 1.10839), (0.10, 1.23614), (0.15, 1.38804), (0.20, 1.57037), (0.25, 1.79159),
    (0.30, 2.06326), (0.35, 2.40150), (0.40, 2.82933), (0.45, 3.38054), (0.50, 4.10636),
    (CLOSE_PACKING / 1.6, 5.4963), (CLOSE_PACKING / 1.5, 6.6074), (CLOSE_PACKING / 1.4, 8.306),
])  # fmt: skip
# Packing fractions and Z of the fluid near freezing. We know no published values between the
# packing fractions 0.648 and 0.698. The values here were computed with Ricochet from two runs of
# 8000 disks and 1000 collisions per disk at each packing fraction. Their errors are below 0.1 %.
# The fluid freezes at 0.698. The value at this packing fraction is the published one for 1024^2
# disks (see `MELTING`).
FREEZING = np.array([
    (0.66, 8.875), (0.67, 9.350), (0.68, 9.839), (0.69, 10.234),
    (0.698, 9.16934 * math.pi / 4 / 0.698),
])  # fmt: skip
# Coefficient c of the finite-size correction Z_N = Z + c / N for N disks in a periodic box, at the
# first ten packing fractions of `FLUID`.
SHIFT = np.array(
    [-0.1036, -0.2152, -0.3361, -0.4680, -0.6131, -0.7741, -0.9549, -1.1605, -1.3981, -1.6776]
)
# Packing fractions and P d^2 / kT near melting in periodic boxes, where d is the diameter: Li et
# al., Journal of Chemical Physics 157, 234111 (2022), for 128^2 disks; Engel et al., Physical
# Review E 87, 042134 (2013), for 256^2 and 1024^2 disks.
MELTING = {
    "128² disks, Li et al. 2022": [
        (0.698, 9.1741), (0.704, 9.1856), (0.708, 9.1763), (0.712, 9.1655),
        (0.716, 9.1587),
    ],
    "256² disks, Engel et al. 2013": [
        (0.698, 9.1706), (0.7, 9.1890), (0.702, 9.1914), (0.704, 9.1890),
        (0.706, 9.1859), (0.708, 9.1823), (0.71, 9.1791), (0.712, 9.1772),
        (0.714, 9.1756), (0.716, 9.1782), (0.718, 9.1847), (0.72, 9.2235),
    ],
    "1024² disks, the same": [
        (0.698, 9.16934), (0.7, 9.18541), (0.702, 9.18818), (0.704, 9.18674),
        (0.706, 9.18587), (0.708, 9.18496), (0.71, 9.18415), (0.712, 9.18338),
        (0.714, 9.18195), (0.716, 9.18327), (0.718, 9.19507), (0.72, 9.23083),
    ],
}  # fmt: skip


@cache
def splines() -> tuple[Callable[..., np.ndarray], Callable[..., np.ndarray]]:
    """Return splines of the smooth function Z (1 - eta)^2, and of c in Z_N = Z + c / N."""
    eta, z = np.concatenate([FLUID, FREEZING]).T
    smooth = scipy.interpolate.CubicSpline(np.append(0, eta), np.append(1, z * (1 - eta) ** 2))
    return smooth, scipy.interpolate.CubicSpline(
        np.append(0, eta[: len(SHIFT)]), np.append(0, SHIFT)
    )


def henderson(eta: Number) -> Number:
    """Return Henderson's compressibility factor Z of the fluid, Molecular Physics 30, 971 (1975).

    Parameters
    ----------
    eta : float or numpy.ndarray
        packing fraction

    Returns
    -------
    float or numpy.ndarray
        Z = P / (n kT)

    Examples
    --------
    >>> round(hard_disks.henderson(0.3), 4)
    2.0638
    """
    return (1 + eta**2 / 8) / (1 - eta) ** 2


def simulated(eta: ArrayLike) -> np.ndarray:
    """Return Z of the fluid, interpolated between simulations.

    Simulations are published for packing fractions up to 0.648 and for 0.698. The simulations at
    packing fractions between these two were run with Ricochet.

    Parameters
    ----------
    eta : array_like
        (...) packing fraction

    Returns
    -------
    numpy.ndarray
        (...) Z = P / (n kT), or NaN above 0.698, where the fluid freezes

    Examples
    --------
    >>> bool(abs(hard_disks.simulated(0.3) / hard_disks.henderson(0.3) - 1) < 0.01)
    True
    """
    eta = np.asarray(eta, dtype=float)
    return np.where(eta <= FREEZING[-1, 0], splines()[0](eta) / (1 - eta) ** 2, np.nan)


def simulated_finite(eta: ArrayLike, count: float) -> np.ndarray:
    """Return Z (...) of `count` disks of fluid in a periodic box, for eta (...) up to 0.648.

    Above 0.5 the coefficient of the correction is extrapolated. Everywhere it agrees with the
    thermodynamic result c = -(1/2) d ln(d(eta Z)/d eta) / d ln eta (tests/post/test_laws.py).
    """
    return simulated(eta) + splines()[1](eta) / count


def crystal(eta: Number, count: float = math.inf) -> Number:
    """Return Z of the crystal by Alder, Hoover and Young, J. Chem. Phys. 49, 3688 (1968).

    Parameters
    ----------
    eta : float or numpy.ndarray
        packing fraction
    count : float
        number of disks in a periodic box with conserved total momentum

    Returns
    -------
    float or numpy.ndarray
        Z = P / (n kT)

    Examples
    --------
    >>> 10 < hard_disks.crystal(0.75) < 12
    True
    """
    alpha = CLOSE_PACKING / eta - 1
    z = 2 / alpha + 1.90 + 0.67 * alpha + 1.51 * alpha**2
    return z - (z - 1) / count


def adiabat(
    widths: np.ndarray, height: float, count: int, radius: float, walled: bool
) -> np.ndarray:
    """Return the temperatures (W,), relative to the first, of a gas between walls moved slowly.

    The `widths` (W,) are the distances between the two walls; `height` is the distance between the
    other two sides. Unless these are walls (`walled`), the momentum along them is conserved, and
    the kinetic energy is (N - 1/2) kT in place of N kT.

    Work changes it by -F dw, with F = P `height` (P: pressure of `simulated`) minus the tension of
    the other walls. In scaled particle theory, the tension is kT n r / (1 - eta), and n r (1 - eta)
    / (1 + eta) disks per length are missing beside a wall (Helfand, Frisch and Lebowitz, Journal of
    Chemical Physics 34, 1037 (1961)).
    """
    area = count * math.pi * radius**2
    eta = np.geomspace(1e-12, FREEZING[-1, 0], 50001)  # far from the walls
    layer = 2 * radius * (1 - eta) / (1 + eta)  # disks missing beside both walls, over n
    width = area / eta / (height - walled * layer) + layer
    force = eta / area * (simulated(eta) * height - walled * 2 * radius / (1 - eta))  # over N kT
    rise = -np.append(0, np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(width)))
    rise *= count / (count - (not walled) / 2)
    at = np.interp(widths, width[::-1], rise[::-1], left=np.nan)
    return np.exp(at - at[0])


def published(eta: float, count: int, periodic: bool) -> float:
    """Return Z from simulations: of the fluid up to eta = 0.648, of the crystal from eta = 0.72.

    In between, Z is NaN. If the box is `periodic`, Z includes the finite-size correction for
    `count` disks.
    """
    if FLUID[-1, 0] < eta < 0.72:
        return math.nan
    number = count if periodic else math.inf
    return float(crystal(eta, number) if eta >= 0.72 else simulated_finite(eta, number))


def of_sizes(z: np.ndarray, eta: np.ndarray, alike: float) -> np.ndarray:
    """Return Z of a fluid of disks of different radii r from `z` of equal disks and <r>^2 / <r^2>.

    The second virial coefficient is exact. If `z` is the result of scaled particle theory for equal
    disks, Z is its result for different radii (Santos, Yuste and Lopez de Haro, Molecular Physics
    96, 1 (1999)).
    """
    return (1 - alike) / (1 - eta) + alike * z


def contact_value(z: Number, eta: Number) -> Number:
    """Return the pair correlation function at contact, chi = (Z - 1) / (2 eta)."""
    return (z - 1) / (2 * eta)


def collision_rate(
    z: float, diameter: float, free: float, kt: float = 1.0, mass: float = 1.0
) -> float:
    """Return the rate of pair collisions per disk that corresponds to a pressure.

    Parameters
    ----------
    z : float
        P / (n kT)
    diameter : float
        diameter of the disks [length]
    free : float
        number of disks that share the energy: N between walls, N - 1 in a periodic box
    kt, mass : float
        temperature [energy], and mass of a disk

    Returns
    -------
    float
        collision rate [1/time]

    Examples
    --------
    >>> round(hard_disks.collision_rate(2.0, 1.0, 1e4), 3)
    2.257
    """
    # c_n is the mean relative speed of two disks in a system of fixed total energy, divided by the
    # mean relative speed of two disks with Maxwellian velocities.
    c_n = math.exp(math.lgamma(free) - math.lgamma(free + 0.5)) * math.sqrt(free)
    return 4 * (z - 1) * c_n / (math.sqrt(math.pi) * diameter) * math.sqrt(kt / mass)


def haff_rate(xi: float) -> float:
    """Return the cooling rate -d ln K / d tau of a homogeneous gas.

    K is the kinetic energy and tau the number of collisions per disk. The second Sonine coefficient
    is taken from van Noije and Ernst, Granular Matter 1, 57 (1998).

    Parameters
    ----------
    xi : float
        coefficient of restitution

    Returns
    -------
    float
        cooling rate per unit of tau

    Examples
    --------
    >>> hard_disks.haff_rate(1.0)
    0.0
    """
    a2 = 16 * (1 - xi) * (1 - 2 * xi**2) / (57 - 25 * xi + 30 * xi**2 * (1 - xi))
    return float((1 - xi**2) * (1 + a2 / 4) / 2)


def haff_by_collisions(tau: np.ndarray, xi: float) -> np.ndarray:
    """Return K / K(0) (T,) of a homogeneous cooling gas after tau (T,) collisions per disk."""
    return np.exp(-haff_rate(xi) * np.asarray(tau))


def haff_by_time(w0_t: np.ndarray, xi: float) -> np.ndarray:
    """Return Haff's law for the energy of a homogeneous gas, J. Fluid Mech. 134, 401 (1983).

    Parameters
    ----------
    w0_t : array_like
        (T,) time in initial mean free times
    xi : float
        coefficient of restitution

    Returns
    -------
    numpy.ndarray
        (T,) kinetic energy relative to its initial value

    Examples
    --------
    >>> round(float(hard_disks.haff_by_time(4.0, 0.0)), 3)
    0.25
    """
    return (1 + (1 - xi**2) * np.asarray(w0_t) / 4) ** -2


def haff_soft(law: Restitution, thermal: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return w0 t, collisions per disk and K / K(0) of a cooling gas of viscoelastic disks.

    w0 is the initial collision rate and `thermal` the initial sqrt(kT/m). If g is the relative
    normal velocity of a collision, m g^2 / 4 kT is distributed exponentially in a Maxwellian gas.
    """
    k, u = np.geomspace(1, 1e-26, 1000), np.linspace(0, 40, 2001)
    g = 2 * thermal * np.sqrt(k[:, None] * u)
    lost = scipy.integrate.trapezoid((1 - law.at(g) ** 2) * u * np.exp(-u), u)
    tau = scipy.integrate.cumulative_trapezoid(2 / lost, -np.log(k), initial=0)
    time = scipy.integrate.cumulative_trapezoid(2 / lost / np.sqrt(k), -np.log(k), initial=0)
    return time, tau, k


def noise_temperature(
    strength: float, xi: float, eta: float, diameter: float, mass: float = 1.0
) -> float:
    """Return the temperature at which dissipation balances white-noise driving.

    The formula is that of van Noije and Ernst, Granular Matter 1, 57 (1998), for independent
    Maxwellian velocities, with chi from Henderson's equation of state. Correlated velocities raise
    the temperature, by up to 2 % at eta = 0.02 and by 4 to 15 % at eta = 0.2 (xi >= 0.6).

    Parameters
    ----------
    strength : float
        rate at which driving increases the variance of each velocity component [velocity^2/time]
    xi : float
        coefficient of restitution
    eta : float
        packing fraction
    diameter, mass : float
        diameter and mass of a disk

    Returns
    -------
    float
        kT in the steady state

    Examples
    --------
    >>> kt = hard_disks.noise_temperature(1.0, 0.9, 0.2, 0.1)
    >>> bool(np.isclose(hard_disks.noise_temperature(8.0, 0.9, 0.2, 0.1), 4 * kt))
    True
    """
    chi, density = contact_value(henderson(eta), eta), 4 * eta / (math.pi * diameter**2)
    loss = math.sqrt(math.pi) * (1 - xi**2) * chi * density * diameter
    return mass * (strength / loss) ** (2 / 3)


def speed_of_sound(eta: float, kt: float = 1.0, mass: float = 1.0) -> float:
    """Return the adiabatic speed of sound of the fluid [velocity] for Henderson's Z.

    Its square is (d(eta Z)/d eta + Z^2) kT / m.
    """
    step = 1e-6
    slope = ((eta + step) * henderson(eta + step) - (eta - step) * henderson(eta - step)) / step / 2
    return math.sqrt((slope + henderson(eta) ** 2) * kt / mass)


def enskog(
    z: float, eta: float, diameter: float, kt: float = 1.0, mass: float = 1.0
) -> dict[str, float]:
    """Return the transport coefficients of Enskog's theory.

    The formulas are those of Gass, Journal of Chemical Physics 54, 1898 (1971). The bulk viscosity
    is due to collisions alone. D is the first Sonine approximation.

    Parameters
    ----------
    z : float
        P / (n kT)
    eta : float
        packing fraction
    diameter, kt, mass : float
        diameter, temperature and mass of a disk

    Returns
    -------
    dict of str to float
        "viscosity", "bulk_viscosity", "conductivity" (with Boltzmann's constant 1) and "D"

    Examples
    --------
    >>> found = hard_disks.enskog(hard_disks.henderson(0.3), 0.3, 1.0)
    >>> sorted(found)
    ['D', 'bulk_viscosity', 'conductivity', 'viscosity']
    """
    y, thermal = z - 1, np.sqrt(mass * kt / math.pi)
    density = 4 * eta / (math.pi * diameter**2)
    return {
        "viscosity": 1.022 * thermal / diameter * eta * (1 / y + 1 + 0.8729 * y),
        "conductivity": 1.029 * 4 * thermal / mass / diameter * eta * (1 / y + 1.5 + 0.8718 * y),
        "bulk_viscosity": 4 / math.pi * eta * y / diameter * thermal,
        "D": thermal / mass / (2 * density * diameter * contact_value(z, eta)),
    }


def long_time_tail(
    time: np.ndarray, density: float, diffusion: float, viscosity: float
) -> np.ndarray:
    """Return the long-time tail (T,) of <v(0) v(t)> / <v^2> according to mode-coupling theory.

    `density` is in disks per area; `diffusion` is the diffusion coefficient and `viscosity` the
    kinematic viscosity, both in length^2/time (Dorfman and Cohen, Physical Review Letters 25, 1257
    (1970)).
    """
    return 1 / (8 * math.pi * density * (diffusion + viscosity) * np.asarray(time))
