"""Types for events, obstacles, species, changes and the law of restitution."""

from typing import NamedTuple

import numpy as np


class EventLog(NamedTuple):
    """The E events of a run in chronological order, as arrays (E,).

    An event is a collision of disk `i` with another disk or with a boundary. A positive `j` is the
    id of the other disk. The boundary ids 0, -1, -2 and -3 denote the left, right, bottom and top
    side of the box, and -4, -5, ... the circular obstacles and arcs, followed by the straight
    walls.
    """

    time: np.ndarray
    i: np.ndarray  # id of a disk, counted from 1
    j: np.ndarray
    impulse: np.ndarray  # magnitude of the momentum change
    momentum_change: np.ndarray | None = None  # (E, 2) of disk i; None in files of older versions


class Event(NamedTuple):
    """One event; see `EventLog`."""

    time: float
    i: int  # id of a disk, counted from 1
    j: int
    impulse: float  # magnitude of the momentum change
    momentum_change: np.ndarray  # (2,) of disk i


class Obstacle(NamedTuple):
    """Circular obstacle, which encloses the disks if `inside` is True, or arc of a circle.

    An arc extends counter-clockwise from `from_angle` to `to_angle` [degrees]; both are None for a
    circle.
    """

    centre: np.ndarray
    radius: float
    inside: bool
    from_angle: float | None = None
    to_angle: float | None = None

    @property
    def is_arc(self) -> bool:
        """True for an arc, which encloses no area."""
        return self.from_angle is not None

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the distances of points from the outline of the obstacle.

        Parameters
        ----------
        points : numpy.ndarray
            (..., 2) positions [length]

        Returns
        -------
        numpy.ndarray
            (...) distances [length]

        Examples
        --------
        >>> import numpy as np
        >>> from ricochet import Obstacle
        >>> arc = Obstacle(np.zeros(2), 1.0, False, 0.0, 90.0)
        >>> arc.distance(np.array([[0.0, 2.0], [-3.0, 1.0]])).tolist()
        [1.0, 3.0]
        """
        away = np.asarray(points) - self.centre
        distance = np.abs(np.linalg.norm(away, axis=-1) - self.radius)
        if self.from_angle is None or self.to_angle is None:
            return distance
        angle = np.degrees(np.arctan2(away[..., 1], away[..., 0]))
        ends = self.ends - self.centre
        to_ends = np.linalg.norm(away[..., np.newaxis, :] - ends, axis=-1).min(axis=-1)
        turned = (angle - self.from_angle) % 360
        return np.where(turned <= self.to_angle - self.from_angle, distance, to_ends)

    @property
    def ends(self) -> np.ndarray:
        """End points (2, 2) of an arc [length]."""
        return self.points(2)

    def points(self, count: int) -> np.ndarray:
        """Return equally spaced points on the outline, both ends included.

        Parameters
        ----------
        count : int
            number of points

        Returns
        -------
        numpy.ndarray
            (count, 2) positions [length]

        Examples
        --------
        >>> import numpy as np
        >>> from ricochet import Obstacle
        >>> Obstacle(np.zeros(2), 2.0, False, -90.0, 90.0).points(3).round(9).tolist()
        [[0.0, -2.0], [2.0, 0.0], [0.0, 2.0]]
        """
        first = 0.0 if self.from_angle is None else self.from_angle
        last = 360.0 if self.to_angle is None else self.to_angle
        angle = np.radians(np.linspace(first, last, count))
        return self.centre + self.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


class Species(NamedTuple):
    """One species of disks, with differing masses and radii if they are read from a file."""

    name: str
    masses: np.ndarray  # (n,)
    radii: np.ndarray  # (n,)
    disks: np.ndarray  # (N,) mask of all disks of the run

    @property
    def alike(self) -> bool:
        """True if all disks of the species have the same mass and radius."""
        return bool(np.ptp(self.masses) == 0 and np.ptp(self.radii) == 0)

    @property
    def mass(self) -> float:
        """Mass of each disk, or the mean mass if the disks differ."""
        return float(self.masses[0] if self.alike else self.masses.mean())

    @property
    def radius(self) -> float:
        """Radius of each disk, or the mean radius if the disks differ."""
        return float(self.radii[0] if self.alike else self.radii.mean())

    @property
    def label(self) -> str:
        """Name of the species with the mass of its disks, for legends."""
        return f"{self.name}, m = {span(self.masses)}"


class Change(NamedTuple):
    """Change of a variable during a run; an empty `value` stands for the default."""

    time: float
    name: str
    value: str

    @property
    def parts(self) -> list[str]:
        """Group, name of its member if there are several, and variable, in lower case."""
        return self.name.lower().split(".")


def changes_in(text: str) -> list[Change]:
    """Return the changes listed in a text with lines TIME GROUP.VARIABLE=VALUE."""
    lines = (line.partition(" ") for line in text.splitlines())
    return [Change(float(time), *rest.partition("=")[::2]) for time, _, rest in lines]


class Restitution(NamedTuple):
    """Coefficient of normal restitution of a pair of disks.

    It is `xi` at all impact velocities if `law` is "constant", otherwise only above `speed`.
    """

    xi: float
    law: str = "constant"
    speed: float = 0.0  # g0

    def __format__(self, spec: str) -> str:
        soft = f" {self.law} below {self.speed:g}" if self.law != "constant" else ""
        return f"{self.xi:{spec}}{soft}"

    @property
    def name(self) -> float | str:
        """The constant coefficient, or the name of the velocity-dependent law."""
        return self.xi if self.law == "constant" else f"{self:g}"

    def at(self, g: np.ndarray) -> np.ndarray:
        """Return the coefficients of restitution at normal impact velocities `g`, an array.

        The viscoelastic law is 1 - y + c y^2 with y proportional to g^(1/5) (Ramirez and others,
        Physical Review E 60, 4465 (1999)). "elastic_below" is 1 minus a rounding error below
        `speed`, so that the cooling time of a gas is very long but finite at all energies.
        """
        if self.law == "elastic_below":
            return np.where(g < self.speed, np.nextafter(1.0, 0.0), self.xi)
        c = {"power": 0.0, "viscoelastic": 0.6}[self.law]
        y = 2 * (1 - self.xi) / (1 + np.sqrt(1 - 4 * c * (1 - self.xi)))
        y = y * np.minimum(g / self.speed, 1.0) ** 0.2
        return 1 - y + c * y**2


def span(values: np.ndarray, digits: int = 6) -> str:
    """Return the smallest and largest value as text, or a single value if all are equal."""
    ends = (f"{values.min():.{digits}g}", f"{values.max():.{digits}g}")
    return ends[0] if ends[0] == ends[1] else " to ".join(ends)
