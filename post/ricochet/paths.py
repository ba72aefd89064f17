"""The true paths of disks between two frames: free flights from collision to collision.

A flight is known from its two ends, so a path is known by its turns, the collisions between the
frames.  One collision lies where the flight out of the first frame meets the one into the second.
Several are those of the event log, gone through from the first frame; that they lead to the second
is checked.  A path that remains unknown is said to be guessed: all of them are where kicks change
velocities between the collisions.
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

SIDES = ("left", "right", "bottom", "top")
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


def wall_laws(run: Run) -> list[tuple[float, bool]]:
    """Restitution of each side, obstacle and straight wall, and whether it is smooth; by code."""
    contact, sides = run.parameters.get("contact", {}), run.parameters.get("side", {})
    common = (
        float(contact.get("wall_restitution", 1.0)),
        contact.get("wall_rule", "velocity") == "normal",
    )
    laws = [common] * 4
    for name, law in sides.items():
        laws[SIDES.index(name)] = float(law["restitution"]), law["rule"] == "normal"
    for group, count in (("obstacle", len(run.obstacles)), ("wall", len(run.walls))):
        table = run.parameters.get(group, {})
        restitutions = table.get("restitution", [common[0]] * count)
        smooth = table.get("normal", [common[1]] * count)
        laws += [(float(xi), bool(flag)) for xi, flag in zip(restitutions, smooth, strict=True)]
    return laws


class Paths:
    """The paths between frames of a run."""

    def __init__(self, run: Run, most: float = np.inf) -> None:
        """Take what the wall rule needs from the run; give at most so many turns in all."""
        self.most = most
        self.run = run
        self.period = np.where(run.periodic, run.edges, np.inf).tolist()
        self.shapes = [*run.obstacles, *run.walls.tolist()]

    @cached_property
    def laws(self) -> list[tuple[float, bool]]:
        """The wall rules, for logs without changes of momentum."""
        return wall_laws(self.run)

    @cached_property
    def log(self) -> tuple[np.ndarray, ...] | None:
        """Time, i, j and change of the events, and the collisions of all disks after each.

        The change of momentum of disk i is a vector where the log has it, else its magnitude.
        Not of a sheared box: images that slide are beyond these paths.
        """
        if self.run.shear_rate != 0:
            return None
        try:
            time, i, j, impulse, vector = self.run.events
        except RunError:
            return None  # a log that is not there, or is damaged, does not stop a film
        return time, i, j, impulse if vector is None else vector, np.cumsum(1 + (j > 0))

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
        hits = None if run.collisions is None else run.collisions[frames]
        return [
            State(
                float(run.time[f]),
                place[k],
                velocity[k],
                image[k],
                None if hits is None else hits[k],
            )
            for k, f in enumerate(frames)
        ]

    def between(self, a: State, b: State) -> Turns:
        """The turns between two frames."""
        if self.run.kicked:
            return unknown(np.ones(self.run.count, bool))
        h, g = b.time - a.time, self.run.gravity
        end = b.position + (b.image - a.image) * self.run.edges
        if a.hits is None:  # a free flight shows in where it leads
            free = self.near(a.position + h * (a.velocity + 0.5 * h * g), end)
            hits = np.where(free, 0, 2)
        else:
            hits = b.hits - a.hits
        if hits.sum() > self.most:
            return unknown(hits > 0)
        # The flights before and after a single collision: they meet where turning * after = way.
        turning = a.velocity - b.velocity + h * g
        way = end - a.position - h * (b.velocity - 0.5 * h * g)
        square = np.sum(turning**2, axis=1)
        after = np.sum(turning * way, axis=1) / np.where(square > 0, square, 1)
        meet = self.near(turning * after[:, None], way) & (after >= -1e-9 * h) & (after <= h)
        once = (hits == 1) & meet
        disk = np.flatnonzero(once)
        t = np.clip(after[disk], 0, h)
        place = a.position[disk] + t[:, None] * (a.velocity[disk] + 0.5 * t[:, None] * g)
        before, later = a.velocity[disk] + t[:, None] * g, b.velocity[disk] + (t - h)[:, None] * g
        gain = 0.5 * self.run.mass[disk] * np.sum(later**2 - before**2, axis=1)
        found, guessed = [(disk, a.time + t, place, gain)], (hits > 0) & ~once
        if guessed.any() and self.log is not None:
            flights = self.replay(a, b)
            for k in np.flatnonzero(guessed):
                flight = flights.get(k)
                if flight and self.arrives(flight, b, k, end[k]):
                    times, x, y, gain = np.transpose(flight.turns)
                    place = np.column_stack([x, y])
                    found.append((np.full(len(times), k), times, place, gain))
                    guessed[k] = False
        parts = [np.concatenate(part) for part in zip(*found, strict=True)]
        order = np.lexsort((parts[1], parts[0]))
        self.most -= len(order)
        return Turns(*(part[order] for part in parts), guessed)

    def arrives(self, flight: Flight, b: State, disk: int, end: np.ndarray) -> bool:
        """Whether a flight by the log leads to the next frame."""
        flight.fly(b.time, *self.run.gravity.tolist())
        gap = hypot(flight.x - end[0], flight.y - end[1])
        return gap <= CLOSE * self.run.radius[disk]

    def near(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """(N,) whether places agree, by the sizes of their disks."""
        return np.linalg.norm(one - other, axis=1) <= CLOSE * self.run.radius

    def replay(self, a: State, b: State) -> dict[int, Flight]:
        """The flights of all disks that collide between two frames, by the event log."""
        run, (time, i, j, changes, total) = self.run, self.log
        if a.hits is None:
            span = slice(*np.searchsorted(time, [a.time, b.time], "right"))
        else:  # which events a frame has seen is clear even if several have the same time
            span = slice(*np.searchsorted(total, [a.hits.sum(), b.hits.sum()], "right"))
        flights = {
            k: Flight(
                float(run.mass[k]), a.time, *a.position[k].tolist(), *a.velocity[k].tolist(), []
            )
            for k in {*(i[span] - 1).tolist(), *(j[span][j[span] > 0] - 1).tolist()}
        }
        gravity = run.gravity.tolist()
        for event in zip(*(part[span].tolist() for part in (time, i, j, changes)), strict=True):
            at, one, other, change = event
            flight = flights[one - 1]
            flight.fly(at, *gravity)
            if other > 0:
                partner = flights[other - 1]
                partner.fly(at, *gravity)
            if changes.ndim > 1:
                flight.turn(*(part / flight.mass for part in change))
                if other > 0:
                    partner.turn(*(-part / partner.mass for part in change))
            elif other > 0:
                self.collide(flight, partner, change)
            else:
                self.bounce(flight, other, change)
        return flights

    def nearest(self, dx: float, dy: float) -> tuple[float, float]:
        """The way to the nearest periodic image."""
        px, py = self.period
        return dx - px * round(dx / px) if px < np.inf else dx, (
            dy - py * round(dy / py) if py < np.inf else dy
        )

    def collide(self, a: Flight, b: Flight, change: float) -> None:
        """Two disks get this impulse along the line of their centres."""
        dx, dy = self.nearest(b.x - a.x, b.y - a.y)
        along = change / hypot(dx, dy)
        a.turn(-along * dx / a.mass, -along * dy / a.mass)
        b.turn(along * dx / b.mass, along * dy / b.mass)

    def bounce(self, disk: Flight, code: int, change: float) -> None:
        """A disk leaves a wall by the wall rule; whether elastically shows in the impulse."""
        nx, ny = self.normal(disk, code)
        vn = disk.vx * nx + disk.vy * ny
        tx, ty = disk.vx - vn * nx, disk.vy - vn * ny

        restitution, smooth = self.laws[-code]

        def changes(xi: float) -> tuple[float, float]:
            slower = 0.0 if smooth else xi - 1
            return -(1 + xi) * vn * nx + slower * tx, -(1 + xi) * vn * ny + slower * ty

        options = [changes(xi) for xi in (restitution, 1.0)]
        disk.turn(*min(options, key=lambda v: abs(disk.mass * hypot(*v) - change)))

    def normal(self, disk: Flight, code: int) -> tuple[float, float]:
        """The direction across a side, an obstacle or a straight wall where the disk meets it."""
        if code > -4:
            return (1.0, 0.0) if code > -2 else (0.0, 1.0)
        shape = self.shapes[-4 - code]
        if code > -4 - len(self.run.obstacles):
            dx, dy = self.nearest(disk.x - shape.centre[0], disk.y - shape.centre[1])
        else:
            (x0, y0), (x1, y1) = shape
            middle = (x0 + x1) / 2, (y0 + y1) / 2
            dx, dy = self.nearest(disk.x - middle[0], disk.y - middle[1])
            along = (dx * (x1 - x0) + dy * (y1 - y0)) / ((x1 - x0) ** 2 + (y1 - y0) ** 2)
            along = min(0.5, max(-0.5, along))
            dx, dy = dx - along * (x1 - x0), dy - along * (y1 - y0)
        size = hypot(dx, dy)
        return dx / size, dy / size
