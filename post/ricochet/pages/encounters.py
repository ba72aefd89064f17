"""Collisions of a few disks shown on a page, with all velocities before and after each."""

import time
from collections.abc import Callable

import numpy as np

from ..reading.reader import Run
from ..running.simulation import NEVER, Simulation

MOST_DISKS = 4  # largest number of disks for which collisions are recorded
MOST_RECORDED = 50  # largest number of events recorded between two frames


def are_recorded(run: Run) -> bool:
    """Return whether the collisions of a run are recorded."""
    is_few = 2 <= run.n_disks <= MOST_DISKS and "open" not in run.nature
    return is_few and not run.time_step and not run.periodic.any()


def advance_and_record(
    simulation: Simulation,
    limits: tuple[float, int, int],
    patience: float,
    record: Callable[[dict], None],
) -> bool:
    """Advance for at most `patience` [s], calling `record` immediately after each event.

    Stopping the engine at each event does not change the result by a single bit. The dictionary
    passed to `record` holds the time and the velocities (N, 2) of all disks before the event. For a
    disk-disk collision it also holds the indices i and j, the velocities after the collision, and
    the normal speeds of approach and separation. `limits` are a time, a number of collisions and a
    number of events; True is returned if none of them is reached. The box must have no periodic
    sides.
    """
    deadline, recorded = time.perf_counter() + patience, 0
    end, _, last = limits
    while recorded < MOST_RECORDED and time.perf_counter() < deadline:
        coming = simulation.next_events(1)
        if not coming or coming[0][0] > end or simulation.events >= last:
            break
        when, i, j = coming[0]
        gravity = np.asarray(simulation.parameters["box"]["gravity"], dtype=float)
        before = simulation.velocity + gravity * (when - simulation.time)
        if simulation._go_on((np.inf, NEVER, simulation.events + 1), patience):
            return True
        collision = described(simulation, i - 1, j - 1, before) if j > 0 else {}
        record({"time": simulation.time, "before": before.tolist()} | collision)
        recorded += 1
    return simulation._go_on(limits, patience)


def described(simulation: Simulation, i: int, j: int, before: np.ndarray) -> dict:
    """Describe the collision of disks i and j that has just occurred."""
    after, place = simulation.velocity, simulation.position
    normal = (place[j] - place[i]) / np.hypot(*(place[j] - place[i]))
    approach, separation = (float((v[i] - v[j]) @ normal) for v in (before, after))
    return {
        "disks": [i, j],
        "after": after.tolist(),
        "approach": approach,
        "separation": -separation,
    }


__all__ = ["advance_and_record", "are_recorded"]
