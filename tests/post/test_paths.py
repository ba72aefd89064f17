"""Paths between frames, compared with the same run with many more frames."""

from itertools import pairwise

import numpy as np
import pytest

from ricochet.reading.paths import seen, turns_between, why_unknown

SHAPES = """&obstacle name = 'post' centre = 1, 0.4 radius = 0.15 /
&wall name = 'ramp' from = 0.2, 0.2 to = 0.5, 0.4 /
"""
DISKS = """&species name = 'a' count = 20 radius = 0.03 temperature = 1 /
&species name = 'b' count = 10 radius = 0.05 mass = 4 temperature = 1 /
"""
LOG = "output.event_log=.true."
SYSTEMS = {
    "periodic": "&box boundary = 'periodic', 'periodic' /\n&contact restitution = 0.9 /\n" + SHAPES,
    "half": "&box boundary = 'periodic', 'wall' gravity = 0, -2 /\n" + SHAPES,
    "rough": "&contact restitution = 0.9 wall_restitution = 0.8 contact_time = 0.02 /\n" + SHAPES,
    "smooth": "&contact wall_restitution = 0.8 wall_rule = 'normal' /\n&box gravity = 0.3, -2 /\n",
    "laws": "&side name = 'bottom' restitution = 0.5 rule = 'normal' /\n"
    "&side name = 'left' restitution = 0.3 /\n" + SHAPES.replace("/", "restitution = 0.7 /", 1),
    "container": "&obstacle name = 'c' centre = 0.5, 0.5 radius = 0.5 side = 'inside' /\n",
    "grains": "&contact restitution = 0.9 tangential_restitution = 0.5 friction = 0.3\n"
    "wall_rule = 'normal' /\n" + SHAPES,
    "driven": "&side name = 'left' temperature = 2 /\n"
    "&side name = 'top' temperature = 1 surface_velocity = 3 /\n"
    + SHAPES.replace("/", "temperature = 3 /", 1),
    "moving": "&side name = 'right' motion = 'sine' amplitude = 0.05 period = 0.7 /\n"
    "&side name = 'bottom' motion = 'sawtooth' velocity = 0.5 /\n"
    "&side name = 'top' motion = 'parabolic' amplitude = 0.03 period = 0.3 phase = 0.4 /\n",
    "steps": "&run dynamics = 'steps' dt = 1e-4 /\n" + SHAPES,
}


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_event_log_gives_the_true_paths(simulated, system):
    """A trajectory with few frames and an event log is compared with one with many frames."""
    text = SYSTEMS[system] + DISKS + "&stop time = 1 /\n"
    run = simulated(text, LOG, "output.frames_every_time=0.25")
    dense = simulated(text, "output.frames_every_time=0.01", name="dense")
    frames, gap = list(range(run.n_frames)), 0.0
    turns, truth = turns_of(run, frames), dense.unwrapped(slice(None))
    assert not why_unknown(run, run.event_log()) and len(turns.disk) > 20
    for frame, (start, end) in enumerate(pairwise(run.time)):
        inside = (dense.time > start) & (dense.time < end)
        origin = truth[np.searchsorted(dense.time, start - 1e-9)]
        for disk in range(run.n_disks):
            own = (turns.frame == frame) & (turns.disk == disk)
            place, velocity = origin[disk], run.velocity[frame][disk]
            legs = [start, *turns.time[own], end]
            for (a, b), after in zip(pairwise(legs), [*turns.velocity[own], None], strict=True):
                during = inside & (dense.time > a) & (dense.time <= b)
                path = flown(run, place, velocity, dense.time[during] - a)
                gap = max(gap, np.abs(path - truth[during, disk]).max(initial=0))
                (place,), velocity = flown(run, place, velocity, np.array([b - a])), after
    assert gap < 1e-6


def flown(run, place, velocity, t):
    """Return the positions (T, 2) of a disk after these times."""
    return place + t[:, None] * velocity + 0.5 * t[:, None] ** 2 * run.gravity


def turns_of(run, frames):
    return turns_between(run, run.event_log(), frames, seen(run, run.event_log(), frames))


def test_a_part_of_the_frames_has_the_turns_between_them(simulated):
    run = simulated(DISKS + "&stop time = 2 /\n", LOG, "output.frames_every_time=0.25")
    all_turns, some = turns_of(run, list(range(run.n_frames))), turns_of(run, [2, 3, 5])
    own = (all_turns.frame >= 2) & (all_turns.frame < 5)
    assert sorted(some.time) == sorted(all_turns.time[own]) and set(some.frame) == {0, 1}


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ("&drive kind = 'andersen' fraction = 0.1 interval = 0.1 temperature = 1 /\n", "driving"),
        ("&box boundary = 'periodic', 'periodic' shear_rate = 1 /\n", "images"),
    ],
)
def test_where_more_than_collisions_acts_paths_are_not_known(simulated, more, why):
    run = simulated(more + DISKS + "&stop time = 0.1 /\n", LOG)
    assert why in why_unknown(run, run.event_log())
