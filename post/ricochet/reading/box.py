"""The box of a run: its sides, which may move, its accessible area, obstacles and walls."""

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from .changed import OF_MOTION, value_of
from .frames import Series
from .records import Change, Obstacle, changes_in
from .results import SIDES, Results

DRIFTING = (
    "constant_velocity",
    "piston",
)  # motions of a side that change the area of the box for good
OSCILLATING = ("sine", "parabolic")  # motions about a fixed mean position
MOVED = OF_MOTION | {"motion"}  # variables of a side that determine its motion


class BoxResults(Results):
    """Results of one run, including the positions of the sides of the box."""

    @property
    def upper(self) -> np.ndarray:
        """Coordinates (2,) of the upper right corner of the box."""
        return self.lower + self.edges

    @property
    def shear_rate(self) -> float:
        """Gradient along y of the mean velocity along x; 0 unless the box is sheared."""
        return float(self.parameter("box", "shear_rate", 0.0))

    @property
    def changes(self) -> list[Change]:
        """Changes of variables during the run, with time, name and new value."""
        return changes_in(self.parameters.get("changes", ""))

    @property
    def sides(self) -> list[dict[str, Any]]:
        """Input variables of each side of the box at the start, in the order of `SIDES`."""
        return [self.parameters.get("side", {}).get(name, {}) for name in SIDES]

    def corners_at(self, time: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners of the box, whose sides may move, at the given times.

        Positions of pistons, and of sides whose motion is changed during the run, are interpolated
        between samples.

        Parameters
        ----------
        time : float or numpy.ndarray
            (...) times

        Returns
        -------
        lower, upper : numpy.ndarray
            (..., 2) lower left and upper right corners [length]

        Examples
        --------
        >>> lower, upper = run.corners_at(0.5)
        >>> upper.tolist()
        [1.0, 1.0]
        """
        inwards = np.stack([displaced(side, np.asarray(time)) for side in self.sides], axis=-1)
        inwards = inwards + self._offsets
        for k, place in self.piston_positions.items():
            end = (self.lower, self.upper)[k % 2][k // 2]
            at = np.interp(time, place.time, np.ravel(place.value))
            inwards[..., k] = (-1) ** k * (at - end)
        return self.lower + inwards[..., ::2], self.upper - inwards[..., 1::2]

    def open_at(self, time: float | np.ndarray) -> np.ndarray:
        """Return which sides of the box are open at the given times.

        Parameters
        ----------
        time : float or numpy.ndarray
            (...) times

        Returns
        -------
        numpy.ndarray
            (..., 4) True for each open side, in the order left, right, bottom, top

        Examples
        --------
        >>> run.open_at(0.5).tolist()
        [False, False, False, False]
        """
        now = np.asarray(time)
        found = np.tile([bool(side.get("open", False)) for side in self.sides], (*now.shape, 1))
        for k, side in enumerate(SIDES):
            for change in self.changes:
                if change.parts == ["side", side, "open"]:
                    opens = bool(value_of(change.value))
                    found[..., k] = np.where(now >= change.time, opens, found[..., k])
        return found

    @property
    def _offsets(self) -> np.ndarray:
        """Inward displacement (4,) of each side from the edge of the box at the start."""
        ends = [end[axis] for axis in (0, 1) for end in (self.lower, self.upper)]
        starts = [side.get("position", end) for side, end in zip(self.sides, ends, strict=True)]
        return (np.array(starts, dtype=float) - ends) * [1, -1, 1, -1]

    @cached_property
    def piston_positions(self) -> dict[int, Series]:
        """Position of each piston and each changed side over time, by its index in `sides`."""
        return {k: self.observable(f"sides/{SIDES[k]}/position") for k in self._free_sides}

    @property
    def _free_sides(self) -> list[int]:
        """Indices in `sides` of the pistons, and of the sides whose motion is changed."""
        names = (change.parts for change in self.changes)
        new = {name[1] for name in names if name[0] == "side" and name[-1] in MOVED}
        return [
            k
            for k, side in enumerate(self.sides)
            if side.get("motion") == "piston"
            or (SIDES[k] in new and f"sides/{SIDES[k]}/position" in self.observables)
        ]

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower left and upper right corner of the region that the box covers during the run."""
        swings = np.array([outmost(side) for side in self.sides])
        swings = np.maximum(0.0, swings - self._offsets)
        for k, place in self.piston_positions.items():
            beyond = (self.lower[k // 2] - place.value, place.value - self.upper[k // 2])[k % 2]
            swings[k] = max(0.0, np.max(beyond))
        return self.lower - swings[::2], self.upper + swings[1::2]

    def accessible_area(self, time: float | np.ndarray) -> np.ndarray:
        """Return the area of the box without its obstacles, or the area of a round container.

        Walls and arcs have no area, even if they enclose a region. Oscillating sides are taken to
        be at their mean positions, unless another side moves permanently, as in the pressure that
        the program writes.

        Parameters
        ----------
        time : float or numpy.ndarray
            (...) times, which matter only if sides move

        Returns
        -------
        numpy.ndarray
            (...) areas [length^2]

        Examples
        --------
        >>> float(run.accessible_area(0.0))
        1.0
        """
        drifts = np.array([side.get("motion") in DRIFTING for side in self.sides])
        drifts[[*self.piston_positions]] = True
        lower, upper = self.corners_at(time)
        if not drifts.any():
            lower, upper = (np.broadcast_to(end, lower.shape) for end in (self.lower, self.upper))
        area = np.prod(upper - lower, axis=-1)
        circles = [obstacle for obstacle in self.obstacles if not obstacle.is_arc]
        for circle in sorted(circles, key=lambda circle: not circle.inside):
            own = np.pi * circle.radius**2
            area = np.minimum(area, own) if circle.inside else area - own
        return area


def passages(observables: Iterable[str]) -> dict[str, list[str]]:
    """Return the observables that count the disks leaving or entering an open system."""
    names = list(observables)
    return {
        "left": [name for name in names if name.startswith("sides/") and name.endswith("/left")],
        "entered": [name for name in names if name.startswith("sources/")],
    }


def outmost(side: Mapping[str, Any]) -> float:
    """Return the largest outward displacement (see `displaced`) of a side during the run."""
    if side.get("motion") == "constant_velocity":
        return max(0.0, -float(side["velocity"]) * float(side["end_time"] - side["start_time"]))
    return float(side["amplitude"]) if side.get("motion") in OSCILLATING else 0.0


def displaced(side: Mapping[str, Any], time: np.ndarray) -> np.ndarray:
    """Return the inward displacement of a moving side at times (docs/explanation/theory.md).

    The displacement is relative to the mean position of an oscillating side, or to the initial
    position of a side moving at constant velocity.
    """
    if side.get("motion") == "constant_velocity":
        start, end = side["start_time"], side["end_time"]
        return side["velocity"] * (np.clip(time, start, end) - start)
    if outmost(side) == 0:
        return np.zeros(np.shape(time))
    s = (time / side["period"] + side["phase"]) % 1
    if side["motion"] == "sine":
        return side["amplitude"] * np.sin(2 * np.pi * s)
    return side["amplitude"] * 16 * np.where(s < 0.5, s * (0.5 - s), (s - 0.5) * (s - 1))


def obstacles_of(parameters: Mapping[str, Any]) -> tuple[Obstacle, ...]:
    """Return all circular obstacles and arcs in the order of their boundary ids."""
    groups = parameters.get("obstacle", {})
    if "inside" not in groups:
        return ()
    rows = parameters.get("obstacle_rows", groups)
    own = groups_of_rows(parameters, "obstacle")
    inside, none = np.asarray(groups["inside"])[own], np.full(len(groups["inside"]), np.nan)
    angles = [np.asarray(groups.get(name, none))[own] for name in ("from_angle", "to_angle")]
    return tuple(
        Obstacle(c, float(r), bool(i), *(() if np.isnan(a) else (float(a), float(b))))
        for c, r, i, a, b in zip(rows["centre"], rows["radius"], inside, *angles, strict=True)
    )


def walls_of(parameters: Mapping[str, Any], group: str = "wall") -> np.ndarray:
    """Return the end points (W, 2, 2) of the straight walls in the order of their boundary ids."""
    rows = parameters.get(f"{group}_rows", parameters.get(group))
    return np.stack([rows["from"], rows["to"]], axis=1) if rows else np.empty((0, 2, 2))


def groups_of_rows(parameters: Mapping[str, Any], name: str) -> np.ndarray:
    """Return the index of the `&obstacle` group of each obstacle (W,) in the input file."""
    rows = parameters.get(f"{name}_rows")
    if rows:
        return np.asarray(rows["group"]) - 1
    return np.arange(len(parameters.get(name, {}).get("name", ())))
