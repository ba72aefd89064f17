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
from typing import NamedTuple

import numpy as np

from .files import RunError
from .nature import KICKED
from .reader import Run

CLOSE = 1e-3  # radii between where a path leads and where the disk is
MOST_AT_ONCE = 200000  # disks of the frames that are read together
NO_LOG = (np.zeros(0), np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)), np.zeros(0, int))


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
    velocity: np.ndarray  # (M, 2) afterwards
    guessed: np.ndarray  # (N,) bool: disks whose paths are not known


def running(values: np.ndarray, first: np.ndarray) -> np.ndarray:
    """(M, 2) sums up to each of the values (M, 2), which begin anew at the indices `first`."""
    sums = np.cumsum(values, axis=0)
    return sums - np.repeat(sums[first] - values[first], np.diff(first, append=len(sums)), axis=0)


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
        h, g = b.time - a.time, self.run.gravity
        end = b.position + (b.image - a.image) * self.run.edges
        guessed = ~self.arrives(slice(None), a.position + h * (a.velocity + 0.5 * h * g), end)
        disk, time, kick = self.hits(a, b)
        first = np.flatnonzero(np.diff(disk, prepend=-1))
        last = np.append(first[1:], len(disk))[: len(first)] - 1
        t, flight = time - a.time, np.diff(time, prepend=a.time)
        flight[first] = t[first]
        after = a.velocity[disk] + running(kick, first)  # without what gravity adds
        before, t = after - kick, t[:, None]
        place = a.position[disk] + running(before * flight[:, None], first) + 0.5 * t**2 * g
        goal = place[last] + (h - t[last]) * (after[last] + 0.5 * (h + t[last]) * g)
        guessed[disk[last]] = ~self.arrives(disk[last], goal, end[disk[last]])
        guessed |= bool(self.run.nature & KICKED)
        known = ~guessed[disk]
        self.most -= known.sum()
        return Turns(disk[known], time[known], place[known], (after + t * g)[known], guessed)

    def arrives(self, disk: np.ndarray | slice, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """(M,) whether places of these disks agree, by their sizes."""
        return np.linalg.norm(one - other, axis=1) <= CLOSE * self.run.radius[disk]

    def hits(self, a: State, b: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What the log has between two frames, disk by disk: which (M,), when, change of velocity.

        Nothing if it is more than what there is room for.
        """
        time, i, j, change, total = self.log or NO_LOG
        if a.hits is None:
            span = slice(*np.searchsorted(time, [a.time, b.time], "right"))
        else:  # which events a frame has seen is clear even if several have the same time
            span = slice(*np.searchsorted(total, [a.hits.sum(), b.hits.sum()], "right"))
        pair = np.flatnonzero(j[span] > 0)
        some = slice(0) if len(i[span]) + len(pair) > self.most else slice(None)
        event = np.concatenate([np.arange(len(i[span])), pair])[some]
        disk = np.concatenate([i[span], j[span][pair]])[some] - 1
        signs = np.where(np.arange(len(disk)) < len(i[span]), 1, -1)
        order = np.lexsort((event, disk))
        disk, event, signs = disk[order], event[order], signs[order, None]
        return disk, time[span][event], signs * change[span][event] / self.run.mass[disk, None]
