"""Exact paths of disks between frames, reconstructed from the event log."""

from typing import NamedTuple

import numpy as np

from .nature import KICKED
from .reader import SIDES, EventLog, Run
from .windows import Window, within


class Turns(NamedTuple):
    """Velocities of disks after their collisions, sorted by frame, disk and time."""

    frame: np.ndarray  # (M,) index of the frame before the collision
    disk: np.ndarray  # (M,) indices of the disks
    time: np.ndarray  # (M,)
    velocity: np.ndarray  # (M, 2) after the collision; NaN if the disk has left the box


def why_no_log_tells(run: Run) -> str:
    """Return why paths cannot be reconstructed from any event log of the run, or ''."""
    if "recycled" in run.nature:
        return "recycled disks jump between frames"
    return "the driving bends the paths between" if run.nature & KICKED else ""


def why_unknown(run: Run, log: EventLog) -> str:
    """Return why paths cannot be reconstructed from this event log, or ''."""
    if log.momentum_change is None:
        return "the log has no momentum_change"
    if reason := why_no_log_tells(run):
        return reason
    return "images slide" if run.shear_rate else ""


def seen(run: Run, log: EventLog, frames: list[int]) -> np.ndarray:
    """Return the number (T,) of logged events before each frame."""
    if isinstance(run, Window):  # events may precede its first frame, at which its counts begin
        first, logged = run.position.first - run.whole.position.first, run.whole.event_log()
        earlier = within(logged.time, run.start, run.end).start
        return seen(run.whole, logged, [first + k for k in frames]) - earlier
    if run.event_count is None:
        return np.searchsorted(log.time, run.time[frames], "right")
    # The number of events before a frame is calculated from the event counts of all disks. This is
    # correct even if several events occurred at exactly the time of the frame.
    hits = run.event_count[frames].sum(axis=1, dtype=np.int64)
    return np.searchsorted(np.cumsum(1 + (log.j > 0)), hits, "right")


def turns_between(run: Run, log: EventLog, frames: list[int], ends: np.ndarray) -> Turns:
    """Return the collisions from the first to the last frame; `ends` is the result of `seen`."""
    if log.momentum_change is None:
        raise ValueError("the log has no momentum_change")
    some = slice(ends[0], ends[-1])
    i, j = log.i[some], log.j[some]
    pair = np.flatnonzero(j > 0)
    event = np.concatenate([np.arange(len(i)), pair])
    disk = np.concatenate([i, j[pair]]) - 1
    frame = np.searchsorted(ends - ends[0], event, "right") - 1
    order = np.lexsort((event, disk, frame))
    signs = np.where(order < len(i), 1, -1)[:, None]
    event, disk, frame = event[order] + ends[0], disk[order], frame[order]
    gain = signs * log.momentum_change[event] / run.mass[disk, None]
    # Velocity changes are summed separately for each disk and each interval between frames.
    first = np.flatnonzero(np.diff(frame * run.n_disks + disk, prepend=-1))
    sums = np.cumsum(gain, axis=0)
    sums -= np.repeat(sums[first] - gain[first], np.diff(first, append=len(disk)), axis=0)
    fallen = (log.time[event] - run.time[frames][frame])[:, None] * run.gravity
    velocity = run.velocity[frames][frame, disk] + sums + fallen
    if "open" in run.nature:
        beyond_sides = -len(SIDES)  # largest id of an obstacle
        departs = (log.j <= 0) & (log.j > beyond_sides) & (log.impulse == 0)
        velocity[departs[event]] = np.nan
    return Turns(frame, disk, log.time[event], velocity)
