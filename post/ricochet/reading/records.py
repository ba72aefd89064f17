"""Types of the results of a run: events, obstacles, species, and the law of restitution."""

from typing import NamedTuple

import numpy as np


class EventLog(NamedTuple):
    """Arrays (E,) that describe the E events of a run in chronological order.

    An event is a collision of disk `i` with another disk or with a boundary. A positive `j` is the
    id of the second disk; 0, -1, -2 and -3 denote the left, right, bottom and top side of the box,
    and -4, -5, ... the circular obstacles and arcs, followed by the straight walls.
    """

    time: np.ndarray
    i: np.ndarray  # id of a disk
    j: np.ndarray
    impulse: np.ndarray  # magnitude of the momentum change
    momentum_change: np.ndarray | None = None  # (E, 2) of disk i; None in files of older versions


class Event(NamedTuple):
    """One event, with the quantities of `EventLog`."""

    time: float
    i: int  # id of a disk
    j: int
    impulse: float  # magnitude of the momentum change
    momentum_change: np.ndarray  # (2,) of disk i


class Obstacle(NamedTuple):
    """A circular obstacle, which encloses the disks if `inside` is true, or an arc of a circle.

    An arc extends counter-clockwise from `from_angle` to `to_angle` [degrees], both None for a
    circle.
    """

    centre: np.ndarray
    radius: float
    inside: bool
    from_angle: float | None = None
    to_angle: float | None = None

    @property
    def is_arc(self) -> bool:
        """True if the obstacle is an arc, which encloses no area."""
        return self.from_angle is not None

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the distances (...) of points (..., 2) from the outline of the obstacle.

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
        """Return equidistant points of the outline, from the first to the last.

        Parameters
        ----------
        count : int
            Number of points

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
    """One species of disks; masses and radii differ within it if they are read from a file."""

    name: str
    masses: np.ndarray  # (n,)
    radii: np.ndarray  # (n,)
    disks: np.ndarray  # (N,) mask

    @property
    def alike(self) -> bool:
        """True if all disks of the species have the same mass and the same radius."""
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
        """Name of the species and mass of its disks, for the legend of a figure."""
        return f"{self.name}, m = {span(self.masses)}"


class Change(NamedTuple):
    """A change of a variable during a run; an empty `value` stands for the default."""

    time: float
    name: str
    value: str


def changes_in(text: str) -> list[Change]:
    """Return the changes described by lines of the form TIME GROUP.VARIABLE=VALUE."""
    lines = (line.partition(" ") for line in text.splitlines())
    return [Change(float(time), *rest.partition("=")[::2]) for time, _, rest in lines]


class Restitution(NamedTuple):
    """Coefficient of normal restitution of a pair of disks.

    With the `law` "constant" it is `xi` for all impact velocities, otherwise only above `speed`.
    """

    xi: float
    law: str = "constant"
    speed: float = 0.0  # g0

    def __format__(self, spec: str) -> str:
        soft = f" {self.law} below {self.speed:g}" if self.law != "constant" else ""
        return f"{self.xi:{spec}}{soft}"

    @property
    def name(self) -> float | str:
        """Constant coefficient of restitution, or the name of its velocity-dependent law."""
        return self.xi if self.law == "constant" else f"{self:g}"

    def at(self, g: np.ndarray) -> np.ndarray:
        """Return the coefficients of restitution for normal impact velocities `g`, an array.

        The velocity-dependent law is 1 - y + c y^2 with y proportional to g^(1/5) (Ramirez and
        others, Physical Review E 60, 4465 (1999)). "elastic_below" is 1 minus a rounding error
        below `speed`, so that a gas has a finite, though very long, cooling time at all energies.
        """
        if self.law == "elastic_below":
            return np.where(g < self.speed, np.nextafter(1.0, 0.0), self.xi)
        c = {"power": 0.0, "viscoelastic": 0.6}[self.law]
        y = 2 * (1 - self.xi) / (1 + np.sqrt(1 - 4 * c * (1 - self.xi)))
        y = y * np.minimum(g / self.speed, 1.0) ** 0.2
        return 1 - y + c * y**2


def span(values: np.ndarray, digits: int = 6) -> str:
    """Return the smallest and largest value as text, or one value if all are equal."""
    ends = (f"{values.min():.{digits}g}", f"{values.max():.{digits}g}")
    return ends[0] if ends[0] == ends[1] else " to ".join(ends)
