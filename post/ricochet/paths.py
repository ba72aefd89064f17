"""The true paths of disks between two frames: free flights from collision to collision.

A flight is known from its two ends, so a path is known by its turns, the collisions between the
frames.  They are those of the event log, gone through from the first frame; that they lead to the
second is checked.  Without a log a path is known if it has no turns: a free flight leads from one
frame to the next.  A path that remains unknown is said to be guessed: all of them are where kicks
change velocities between the collisions.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, starmap
from math import hypot
from typing import NamedTuple

import numpy as np

from .files import RunError
from .reader import Run

CLOSE = 1e-3  # radii between where a path leads and where the disk is
MOST_AT_ONCE = 200000  # disks of the frames that are read together


class State(NamedTuple):
    """A frame."""

    time: float
    position: np.ndarray  # (N, 2)
    velocity: np.ndarray  # (N, 2)
    image: np.ndarray  # (N, 2) periods travelled
    hits: np.ndarray | None  # (N,) collisions since the start


@dataclass(frozen=True)
class Turns:
    """Collisions between two frames, disk by disk, for each disk in the order of time."""

    disk: np.ndarray  # (M,) indices
    time: np.ndarray  # (M,)
    place: np.ndarray  # (M, 2) without jumps at periodic sides since the first frame
    gain: np.ndarray  # (M,) change of the kinetic energy of the disk
    guessed: np.ndarray  # (N,) bool: disks whose paths are not known


def unknown(guessed: np.ndarray) -> Turns:
    """No turns: these disks, (N,) bool, have some that nobody knows."""
    return Turns(np.zeros(0, int), np.zeros(0), np.zeros((0, 2)), np.zeros(0), guessed)


@dataclass
class Flight:
    """A disk on its way: where it was last known to be, and its collisions so far.

    A collision is its time, x, y, and the kinetic energy that it gives the disk.
    """

    mass: float
    time: float
    x: float
    y: float
    vx: float
    vy: float
    turns: list[tuple[float, float, float, float]]

    def fly(self, time: float, gx: float, gy: float) -> None:
        """On to a later time."""
        t = time - self.time
        self.x += t * (self.vx + 0.5 * t * gx)
        self.y += t * (self.vy + 0.5 * t * gy)
        self.vx += t * gx
        self.vy += t * gy
        self.time = time

    def turn(self, dvx: float, dvy: float) -> None:
        """Collide, here and now, with this change of velocity."""
        gain = self.mass * (dvx * (self.vx + 0.5 * dvx) + dvy * (self.vy + 0.5 * dvy))
        self.vx += dvx
        self.vy += dvy
        self.turns.append((self.time, self.x, self.y, gain))


class Paths:
    """The paths between frames of a run."""

    def __init__(self, run: Run, most: float = np.inf) -> None:
        """Give at most so many turns in all."""
        self.run, self.most = run, most

    @cached_property
    def log(self) -> tuple[np.ndarray, ...] | None:
        """Time, i, j and change of momentum of the events, and the collisions of all after each.

        Not of a sheared box: images that slide are beyond these paths.
        """
        if self.run.shear_rate != 0:
            return None
        try:
            time, i, j, _, change = self.run.events
        except RunError:
            return None  # a log that is not there, or is damaged, does not stop a film
        return None if change is None else (time, i, j, change, np.cumsum(1 + (j > 0)))

    def along(self, frames: list[int]) -> Iterator[Turns]:
        """The turns between each two frames that follow each other in a list."""
        at_once = max(2, MOST_AT_ONCE // self.run.count)
        for first in range(0, len(frames) - 1, at_once - 1):
            states = self.states(frames[first : first + at_once])
            yield from starmap(self.between, pairwise(states))

    def states(self, frames: list[int]) -> list[State]:
        """Some frames, read together."""
        run = self.run
        place, velocity = run.position[frames], run.velocity[frames]
        image = np.zeros_like(place) if run.image is None else run.image[frames]
        hits = [None] * len(frames) if run.collisions is None else run.collisions[frames]
        times = map(float, run.time[frames])
        return [State(*one) for one in zip(times, place, velocity, image, hits, strict=True)]

    def between(self, a: State, b: State) -> Turns:
        """The turns between two frames."""
        if self.run.kicked:
            return unknown(np.ones(self.run.count, bool))
        h, g = b.time - a.time, self.run.gravity
        end = b.position + (b.image - a.image) * self.run.edges
        free = self.near(a.position + h * (a.velocity + 0.5 * h * g), end)
        flights = self.replay(a, b)
        guessed, found = ~free, []
        for k, flight in sorted(flights.items()):
            turns = flight.turns
            flight.fly(b.time, *g.tolist())
            gap = hypot(flight.x - end[k][0], flight.y - end[k][1])
            guessed[k] = gap > CLOSE * self.run.radius[k]
            if not guessed[k]:
                found += [(k, *turn) for turn in turns]
        self.most -= len(found)
        disk, time, x, y, gain = np.array(found).reshape(-1, 5).T
        return Turns(disk.astype(int), time, np.column_stack([x, y]), gain, guessed)

    def near(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """(N,) whether places agree, by the sizes of their disks."""
        return np.linalg.norm(one - other, axis=1) <= CLOSE * self.run.radius

    def replay(self, a: State, b: State) -> dict[int, Flight]:
        """The flights of all disks that collide between two frames, by the event log, if any."""
        if self.log is None:
            return {}
        run, (time, i, j, changes, total) = self.run, self.log
        if a.hits is None:
            span = slice(*np.searchsorted(time, [a.time, b.time], "right"))
        else:  # which events a frame has seen is clear even if several have the same time
            span = slice(*np.searchsorted(total, [a.hits.sum(), b.hits.sum()], "right"))
        if np.sum(1 + (j[span] > 0)) > self.most:
            return {}
        flights = {
            k: Flight(
                float(run.mass[k]), a.time, *a.position[k].tolist(), *a.velocity[k].tolist(), []
            )
            for k in {*(i[span] - 1).tolist(), *(j[span][j[span] > 0] - 1).tolist()}
        }
        gravity = run.gravity.tolist()
        parts = (part[span].tolist() for part in (time, i, j, changes))
        for at, one, other, change in zip(*parts, strict=True):
            for disk, sign in ((one, 1), (other, -1)):
                if disk > 0:
                    flight = flights[disk - 1]
                    flight.fly(at, *gravity)
                    flight.turn(*(sign * part / flight.mass for part in change))
        return flights
