"""Pressure of a fluid of hard disks in a box with walls, from scaled particle theory."""

import math

import numpy as np

from .hard_disks import henderson, of_sizes

__all__ = ["virial_pressure"]

ROUNDS = 100  # iterations for the densities far from the walls


def virial_pressure(
    count: np.ndarray, radius: np.ndarray, edges: np.ndarray, walls: np.ndarray
) -> float:
    """Return the observable `virial_pressure` / kT [1/length^2] of a fluid in a rectangular box.

    The result is (F_x L_x + F_y L_y) / (2 A kT): F is the force on a side, and L the mean distance
    between the centres of disks that touch opposite sides. The fluid has S species with numbers and
    radii (S,), the box `edges` (2,), and `walls` (2,) marks the axes that are not periodic.

    Tension and missing disks beside the walls are those of Helfand, Frisch and Lebowitz, Journal of
    Chemical Physics 34, 1037 (1961), extended to mixtures; the bulk pressure is Henderson's, for
    mixtures with `of_sizes`. The result is NaN if the box is too small for a fluid.
    """
    count, radius, edges, walls = (
        np.asarray(x, dtype=float) for x in (count, radius, edges, walls)
    )
    # area of the box, and total length of its walls
    area, length = np.prod(edges), 2 * walls @ edges[::-1]
    density = count / area
    for _ in range(ROUNDS if length else 0):
        if math.pi * density @ radius**2 >= 1:
            return math.nan
        density = (count + length * deficit(density, radius)) / area
    eta, total = math.pi * density @ radius**2, density.sum()
    if not 0 <= eta < 1:
        return math.nan
    mean = density @ radius / total
    alike = mean**2 * total / (density @ radius**2)
    pressure = total * of_sizes(henderson(eta), eta, alike)
    tension = density @ radius / (1 - eta)
    reach = edges - 2 * walls * (count @ radius) / count.sum()  # between centres at opposite sides
    force = pressure * edges[::-1] - 2 * tension * walls[::-1]
    return float(reach @ force / 2 / area)


def deficit(density: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Return the number of disks of each species (S,) missing beside a wall, per length.

    By Gibbs' adsorption equation, this number is the derivative of the tension with respect to the
    chemical potential of the species. Tension and chemical potentials are derived from the free
    energy of scaled particle theory.
    """
    own = math.pi * radius**2
    free, total, sizes = 1 - density @ own, density.sum(), density @ radius
    slope = radius / free + sizes * own / free**2
    lengths = 2 * math.pi * np.outer(radius, radius) / free
    mixed = np.outer(own, 2 * math.pi * sizes * radius / free**2)
    areas = np.outer(own, own) * (total / free**2 + 2 * math.pi * sizes**2 / free**3)
    potentials = np.add.outer(own, own) / free + lengths + mixed + mixed.T + areas
    # The derivatives of the chemical potentials are multiplied by the densities, so that the matrix
    # is regular even if a species has no disks.
    return np.linalg.solve(np.eye(len(own)) + density[:, None] * potentials, density * slope)
