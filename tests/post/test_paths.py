"""Paths between frames against the same run with many more frames."""

from itertools import pairwise

import numpy as np
import pytest

from ricochet.paths import CLOSE, Paths

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
    "&side name = 'top' temperature = 1 speed = 3 /\n"
    + SHAPES.replace("/", "temperature = 3 /", 1),
    "moving": "&side name = 'right' motion = 'sine' amplitude = 0.05 period = 0.7 /\n"
    "&side name = 'bottom' motion = 'sawtooth' velocity = 0.5 /\n"
    "&side name = 'top' motion = 'parabolic' amplitude = 0.03 period = 0.3 phase = 0.4 /\n",
    "steps": "&run dynamics = 'steps' dt = 1e-4 /\n" + SHAPES,
}


@pytest.fixture(params=SYSTEMS)
def runs(request, simulated):
    """One trajectory with few frames and an event log, with some frames, and with many."""
    text = SYSTEMS[request.param] + DISKS + "&stop time = 1 /\n"
    return [
        simulated(text, f"output.frames_every_time={gap}", *log, name=f"{gap}")
        for gap, log in ((0.25, [LOG]), (0.05, []), (0.01, []))
    ]


def places(run, frame, ends, turns, disk, times):
    """Where the path leads, from one frame to the next; `ends` are its places in them."""
    own = turns.disk == disk
    t = [run.time[frame], *turns.time[own], run.time[frame + 1]]
    cell = ends[0] - run.position[frame][disk] if own.any() else 0
    x = [ends[0], *(turns.place[own] + cell), ends[1]]
    result = np.column_stack([np.interp(times, t, [place[axis] for place in x]) for axis in (0, 1)])
    for a, b in pairwise(t):
        during = (times > a) & (times <= b)
        bend = 0.5 * (times[during] - a) * (times[during] - b)
        result[during] += bend[:, None] * run.gravity
    return result


def farthest(run, dense) -> tuple[float, int]:
    """How far paths miss the places of the denser run, and how many paths are guessed."""
    gap, guessed, known, truth = 0.0, 0, run.unwrapped(slice(None)), dense.unwrapped(slice(None))
    for frame, turns in enumerate(Paths(run).along(list(range(run.frames)))):
        inside = (dense.time > run.time[frame]) & (dense.time < run.time[frame + 1])
        guessed += turns.guessed.sum()
        for disk in np.flatnonzero(~turns.guessed):
            ends = known[frame : frame + 2, disk]
            path = places(run, frame, ends, turns, disk, dense.time[inside])
            gap = max(gap, np.abs(path - truth[inside, disk]).max())
    return gap, guessed


def test_the_event_log_gives_the_true_paths(runs):
    gap, guessed = farthest(runs[0], runs[2])
    assert gap < 1e-6 and guessed == 0


def test_without_a_log_a_path_is_known_if_it_is_a_free_flight(runs):
    hits = np.sum(np.diff(runs[1].collisions[:], axis=0) > 0)
    gap, guessed = farthest(runs[1], runs[2])
    assert gap < CLOSE * runs[1].radius.max() and 0.99 * hits <= guessed <= hits > 20


def test_a_log_that_leads_elsewhere_is_not_believed(simulated):
    """That of a run leads from its first frame to its last; not so with a collision less."""
    run = simulated(DISKS + "&stop time = 5 /\n", LOG, "output.precision='single'")
    (turns,) = Paths(run).along([0, run.frames - 1])
    assert not turns.guessed.any()
    run.events.momentum_change[7] = 0
    (turns,) = Paths(run).along([0, run.frames - 1])
    assert turns.guessed[run.events.i[7] - 1]


def test_turns_beyond_the_room_for_them_are_guessed(simulated):
    """And not looked for: a log may hold 1e9 events."""
    run = simulated(DISKS + "&stop time = 2 /\n", LOG, "output.frames_every_time=0.5")
    frames = list(range(run.frames))
    all_turns = [len(turns.disk) for turns in Paths(run).along(frames)]
    some = list(Paths(run, all_turns[0] + 1).along(frames))
    assert [len(turns.disk) for turns in some] == [all_turns[0], 0, 0, 0]
    hits = np.diff(run.collisions[:], axis=0) > 0
    assert np.mean([turns.guessed for turns in some[1:]] != hits[1:]) < 0.02


def test_with_kicks_no_path_between_frames_is_known(simulated):
    drive = "&drive kind = 'andersen' fraction = 0.1 interval = 0.1 temperature = 1 /\n"
    run = simulated(drive + DISKS + "&stop time = 1 /\n", LOG, "output.frames_every_time=0.05")
    for turns in Paths(run).along(list(range(run.frames))):
        assert len(turns.disk) == 0 and turns.guessed.all()
