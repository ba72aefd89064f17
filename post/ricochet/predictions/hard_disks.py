"""Published results for hard disks: equation of state, collision rates, cooling, diffusion.

eta = packing fraction, n = disks per area, s = diameter, m = mass, w = pair collisions per disk and
time, chi = pair correlation at contact, Z = P / (n kT).
"""

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ..reading.arrays import Number
from ..reading.reader import Restitution

CLOSE_PACKING = math.pi / math.sqrt(12)
# Simulation: to 0.5 from the equation of state of Kolafa and Rottner, Mol. Phys. 104, 3435 (2006);
# above, Erpenbeck and Luban, Phys. Rev. A 32, 2920 (1985).
FLUID = np.array([
    (0.05, 1.10839), (0.10, 1.23614), (0.15, 1.38804), (0.20, 1.57037), (0.25, 1.79159),
    (0.30, 2.06326), (0.35, 2.40150), (0.40, 2.82933), (0.45, 3.38054), (0.50, 4.10636),
    (CLOSE_PACKING / 1.6, 5.4963), (CLOSE_PACKING / 1.5, 6.6074), (CLOSE_PACKING / 1.4, 8.306),
])  # fmt: skip
# Z_N = Z + c / N in a periodic box, at the first ten packing fractions.
SHIFT = np.array(
    [-0.1036, -0.2152, -0.3361, -0.4680, -0.6131, -0.7741, -0.9549, -1.1605, -1.3981, -1.6776]
)
# P d^2 / kT near melting, periodic boxes: Li et al., J. Chem. Phys. 157, 234111 (2022), for 128^2;
# Engel et al., Phys. Rev. E 87, 042134 (2013).
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
    """Z (1 - eta)^2, which is close to 1 and smooth and so safe to interpolate, and c."""
    eta, z = FLUID.T
    smooth = scipy.interpolate.CubicSpline(np.append(0, eta), np.append(1, z * (1 - eta) ** 2))
    return smooth, scipy.interpolate.CubicSpline(np.append(0, eta[:10]), np.append(0, SHIFT))


def henderson(eta: Number) -> Number:
    """Z of the fluid by Henderson, Mol. Phys. 30, 971 (1975)."""
    return (1 + eta**2 / 8) / (1 - eta) ** 2


def simulated(eta: ArrayLike) -> np.ndarray:
    """Z of the fluid between the points of `FLUID`; NaN beyond the last."""
    eta = np.asarray(eta, dtype=float)
    return np.where(eta <= FLUID[-1, 0], splines()[0](eta) / (1 - eta) ** 2, np.nan)


def simulated_finite(eta: ArrayLike, count: int) -> np.ndarray:
    """The same for `count` disks in a periodic box, eta up to 0.5."""
    return simulated(eta) + splines()[1](eta) / count


def crystal(eta: Number, count: float = math.inf) -> Number:
    """Z of the crystal by Alder, Hoover and Young, J. Chem. Phys. 49, 3688 (1968).

    `count` disks in a periodic box: their centre of mass is free, as in an ideal gas of one.
    """
    alpha = CLOSE_PACKING / eta - 1
    z = 2 / alpha + 1.90 + 0.67 * alpha + 1.51 * alpha**2
    return z - (z - 1) / count


def adiabat(
    widths: np.ndarray, height: float, count: int, radius: float, walled: bool
) -> np.ndarray:
    """T over that at the first of the widths (W,) between two walls, one of which moves slowly.

    `walled`: the other two sides are walls, too.  d ln T = -F dw / (N kT), where the side feels
    F = P h less the tension of two walls along its way.  A wall has the tension kT n r / (1 - eta),
    and lacks n r (1 - eta) / (1 + eta) disks per length, by scaled particle theory:
    Helfand, Frisch and Lebowitz, J. Chem. Phys. 34, 1037 (1961).  P as `simulated`.
    """
    area = count * math.pi * radius**2
    eta = np.geomspace(1e-12, FLUID[-1, 0], 50001)  # far from the walls
    layer = 2 * radius * (1 - eta) / (1 + eta)  # of the two walls together
    width = area / eta / (height - walled * layer) + layer
    force = eta / area * (simulated(eta) * height - walled * 2 * radius / (1 - eta))  # over N kT
    rise = -np.append(0, np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(width)))
    at = np.interp(widths, width[::-1], rise[::-1], left=np.nan)
    return np.exp(at - at[0])


def published(eta: float, count: int, periodic: bool) -> float:
    """Z that simulations of others found: fluid to 0.65, crystal beyond 0.72; NaN between."""
    if eta <= 0.5:
        return float(simulated_finite(eta, count) if periodic else simulated(eta))
    return float(crystal(eta, count) if eta >= 0.72 else simulated(eta))


def of_sizes(z: np.ndarray, eta: np.ndarray, alike: float) -> np.ndarray:
    """Z of a fluid of many radii from that of equal disks; `alike` = <r>^2 / <r^2>.

    Santos, Yuste and Lopez de Haro, Mol. Phys. 96, 1 (1999): the second virial coefficient is
    exact, and scaled-particle theory gives itself.
    """
    return (1 - alike) / (1 - eta) + alike * z


def contact_value(z: Number, eta: Number) -> Number:
    """The chi of Z = 1 + 2 eta chi."""
    return (z - 1) / (2 * eta)


def collision_rate(
    z: float, diameter: float, free: float, kt: float = 1.0, mass: float = 1.0
) -> float:
    """The w that follows from Z; `free` = N between walls, N - 1 in a periodic box."""
    # Mean relative speed for fixed energy over that of the Maxwell law.
    c_n = math.exp(math.lgamma(free) - math.lgamma(free + 0.5)) * math.sqrt(free)
    return 4 * (z - 1) * c_n / (math.sqrt(math.pi) * diameter) * math.sqrt(kt / mass)


def haff_rate(xi: float) -> float:
    """-d ln K / d tau, tau collisions per disk, while the gas stays homogeneous.

    a2 by van Noije and Ernst, Granular Matter 1, 57 (1998).
    """
    a2 = 16 * (1 - xi) * (1 - 2 * xi**2) / (57 - 25 * xi + 30 * xi**2 * (1 - xi))
    return float((1 - xi**2) * (1 + a2 / 4) / 2)


def haff_by_collisions(tau: np.ndarray, xi: float) -> np.ndarray:
    """K / K0 after tau collisions per disk, while the gas stays homogeneous."""
    return np.exp(-haff_rate(xi) * np.asarray(tau))


def haff_by_time(w0_t: np.ndarray, xi: float) -> np.ndarray:
    """K / K0 after the time t, w0 = w at the start; Haff, J. Fluid Mech. 134, 401 (1983)."""
    return (1 + (1 - xi**2) * np.asarray(w0_t) / 4) ** -2


def haff_soft(law: Restitution, thermal: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """w0 t, collisions per disk, K / K0 of a gas of soft disks, for Maxwell's velocities.

    `thermal` = sqrt(kT/m) at the start.  Of g, u = m g^2 / 4 kT is exponential, weighted by g.
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
    """The kT at which collisions take what noise gives, variance `strength` per time to each v_x.

    Van Noije and Ernst, Granular Matter 1, 57 (1998), for Maxwell's velocities; chi by Henderson.
    """
    chi, density = contact_value(henderson(eta), eta), 4 * eta / (math.pi * diameter**2)
    loss = math.sqrt(math.pi) * (1 - xi**2) * chi * density * diameter
    return mass * (strength / loss) ** (2 / 3)


def speed_of_sound(eta: float, kt: float = 1.0, mass: float = 1.0) -> float:
    """Of the fluid, adiabatic: c^2 = (d(eta Z)/d eta + Z^2) kT / m, Z by Henderson."""
    step = 1e-6
    slope = ((eta + step) * henderson(eta + step) - (eta - step) * henderson(eta - step)) / step / 2
    return math.sqrt((slope + henderson(eta) ** 2) * kt / mass)


def enskog(
    z: float, eta: float, diameter: float, kt: float = 1.0, mass: float = 1.0
) -> dict[str, float]:
    """Viscosities, heat conductivity (k = 1) and D, by name; Gass, J. Chem. Phys. 54, 1898 (1971).

    The bulk viscosity is all of it collisional; D is the first Sonine approximation.
    """
    y, thermal = z - 1, np.sqrt(mass * kt / math.pi)
    density = 4 * eta / (math.pi * diameter**2)
    return {
        "viscosity": 1.022 * thermal / diameter * eta * (1 / y + 1 + 0.8729 * y),
        "conductivity": 1.029 * 4 * thermal / mass / diameter * eta * (1 / y + 1.5 + 0.8718 * y),
        "bulk_viscosity": 4 / math.pi * eta * y / diameter * thermal,
        "D": thermal / mass / (2 * density * diameter * contact_value(z, eta)),
    }


def contact_values(z: float, density: np.ndarray, diameter: np.ndarray) -> np.ndarray:
    """chi_ij of a mixture (S,), from the Z of equal disks at its packing fraction; to a percent.

    Jenkins and Mancini, J. Appl. Mech. 54, 27 (1987), with the better chi of equal disks as
    Santos, Yuste and Lopez de Haro, J. Chem. Phys. 117, 5785 (2002).
    """
    eta = math.pi / 4 * np.sum(density * diameter**2)
    mean = np.sum(density * diameter) / np.sum(density * diameter**2)
    unlike = 2 * diameter[:, None] * diameter / (diameter[:, None] + diameter)
    return 1 / (1 - eta) + (contact_value(z, eta) - 1 / (1 - eta)) * unlike * mean


def enskog_mixture(
    z: float, density: np.ndarray, diameter: np.ndarray, mass: np.ndarray, kt: float = 1.0
) -> dict[str, float]:
    """Viscosities of a mixture (S,), and "memory": the time in which they forget stress and heat.

    Enskog's theory in first Sonine approximation, as in Lopez de Haro, Cohen and Kincaid, J. Chem.
    Phys. 78, 2746 (1983), here in two dimensions; what disks carry in flight has the factor 1.022
    that higher ones add for equal disks.  While a gas expands its species differ in temperature.
    """
    total, pair = mass[:, None] + mass, (diameter[:, None] + diameter) / 2
    reduced = mass[:, None] * mass / total
    met = density * pair * contact_values(z, density, diameter)  # (i, j)
    rate = met * 2 * np.sqrt(2 * math.pi * kt * reduced) / total  # 2 of it: of temperatures
    handed = 1 + math.pi / 2 * np.sum(met * pair * mass / total, axis=1)  # by collisions, too
    stress = np.diag(np.sum(rate * (2 + mass / mass[:, None]), axis=1)) - rate
    lives = np.linalg.solve(stress, handed)
    sums, share = 2 * rate.sum(axis=1), density / density.sum()
    heat = np.diag(sums) - 2 * rate + sums.max() * share  # the mean of all never changes
    cooler = np.linalg.solve(heat, 2 * handed - 2 * share @ handed)
    together = np.sum(density[:, None] * met * pair**2 * np.sqrt(math.pi / 2 * kt * reduced))
    slowest = min(np.linalg.eigvals(matrix).real.min() for matrix in (stress, heat))
    return {
        "viscosity": float(1.022 * kt * density @ (lives * handed) + together / 2),
        "bulk_viscosity": float(together + 2 * kt * density @ (handed * cooler)),
        "memory": float(1 / slowest),
    }


def long_time_tail(
    time: np.ndarray, density: float, diffusion: float, viscosity: float
) -> np.ndarray:
    """<v(0) v(t)> / <v^2> at late times by mode coupling; Dorfman and Cohen, PRL 25, 1257."""
    return 1 / (8 * math.pi * density * (diffusion + viscosity) * np.asarray(time))
