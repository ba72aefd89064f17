"""Driven disks: what they do in time, and the laws for what lasts."""

import numpy as np

from . import hard_disks, theory
from .reader import Run
from .structure import largest_cluster
from .thermodynamics import packing

GAP = 0.1  # of a cluster, in mean diameters
Curves = dict[str, tuple[np.ndarray, np.ndarray]]  # time and value by species, '' for all of them


def temperature(run: Run) -> Curves:
    """At the observables."""
    return {"": run.observable("all/temperature")}


def noise_law(run: Run) -> float | None:
    """The temperature at which noise and collisions balance."""
    drive = run.parameters.get("drive", {})
    known = {"noisy", "lossy"} <= run.nature <= {"noisy", "lossy", "turning"}
    if not known or not run.periodic.all() or drive.get("species"):
        return None
    gas = packing(run), 2 * run.radius[0], run.mass[0]
    return hard_disks.noise_temperature(float(drive["strength"]), run.restitution, *gas)


def share(run: Run) -> Curves:
    """Of the disks in the left half, at the frames."""
    middle = run.lower[0] + run.edges[0] / 2
    return {"": (run.time, np.mean(run.position[:][..., 0] < middle, axis=1))}


def fuller(share: np.ndarray) -> np.ndarray:
    """Shares (T,) of one half as those of the half that had more of the disks.

    The first third of the time tells which half that was in the last third, and the last in the
    first, for the half that is called fuller by its own disks has more than 1/2 even of none but
    chance.  The middle lets the thirds forget each other.
    """
    third = max(1, len(share) // 3)
    ends = share[:third], share[-third:]
    signs = [np.sign(end.mean() - 0.5) for end in ends]
    return 0.5 + np.concatenate([signs[1] * (ends[0] - 0.5), signs[0] * (ends[1] - 0.5)])


def demon_law(run: Run) -> float | None:
    """The share in the fuller half that lasts; a wall from the floor up parts the halves."""
    floor = run.parameters.get("side", {}).get("bottom", {})
    middle = run.lower[0] + run.edges[0] / 2
    parting = [wall for wall in run.walls if np.allclose(wall[:, 0], middle)]
    heights = [w[:, 1].max() for w in parting if np.isclose(w[:, 1].min(), run.lower[1])]
    across, down = run.gravity
    alike = run.nature <= {"moving", "falling", "lossy", "obstructed", "turning"}
    if floor.get("motion") != "sawtooth" or not heights or across != 0 or not alike:
        return None
    if run.obstacles or run.restitution == 1 or run.parameter("contact", "wall_restitution") != 1:
        return None
    hole, diameter = float(heights[0] - run.lower[1]), 2 * run.radius[0]
    layers = run.count * diameter / (run.edges[0] / 2 - diameter)
    climb = max(0.0, -down) * hole / float(floor["velocity"]) ** 2
    return theory.demon_share(climb, layers, run.restitution)


def height(run: Run) -> Curves:
    """Mean height above the floor of each species, at the frames."""
    y = run.position[:][..., 1] - run.lower[1]
    several = len(run.names) > 1
    return {
        kind.name * several: (run.time, y[:, kind.disks].mean(axis=1)) for kind in run.by_species
    }


def cluster(run: Run) -> Curves:
    """Share of the disks in the largest cluster, at the frames."""
    gap = GAP * 2 * float(run.radius.mean())
    shares = [largest_cluster(run, frame, gap) / run.count for frame in range(run.frames)]
    return {"": (run.time, np.array(shares))}
