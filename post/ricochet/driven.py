"""Driven disks: what they do in time, and the laws for what lasts."""

import numpy as np

from . import hard_disks, theory
from .reader import Run
from .structure import largest_cluster
from .thermodynamics import equal_disks, packing

GAP = 0.1  # of a cluster, in mean diameters
Curves = dict[str, tuple[np.ndarray, np.ndarray]]  # time and value by species, '' for all of them


def temperature(run: Run) -> Curves:
    """At the observables."""
    return {"": run.observable("all/temperature")}


def noise_law(run: Run) -> float | None:
    """The temperature at which noise and collisions balance."""
    drive = run.parameters.get("drive", {})
    alone = run.periodic.all() and not run.obstacles and not run.shear_rate
    smooth = "angular_velocity" not in run.elements and run.restitution < 1
    if not (alone and smooth and equal_disks(run)) or drive.get("species"):
        return None
    if drive.get("kind") != "noise":
        return None
    gas = packing(run), 2 * run.radius[0], run.mass[0]
    return hard_disks.noise_temperature(float(drive["strength"]), run.restitution, *gas)


def share(run: Run) -> Curves:
    """Of the disks in the left half, at the frames."""
    middle = run.lower[0] + run.edges[0] / 2
    return {"": (run.time, np.mean(run.position[:][..., 0] < middle, axis=1))}


def fuller(mean: float) -> float:
    """The share in the half that has more."""
    return max(mean, 1 - mean)


def demon_law(run: Run) -> float | None:
    """The share in the fuller half that lasts; a wall from the floor up parts the halves."""
    floor = run.parameters.get("side", {}).get("bottom", {})
    middle = run.lower[0] + run.edges[0] / 2
    parting = [wall for wall in run.walls if np.allclose(wall[:, 0], middle)]
    heights = [w[:, 1].max() for w in parting if np.isclose(w[:, 1].min(), run.lower[1])]
    across, down = run.gravity
    alike = equal_disks(run) and np.isfinite(run.restitution)
    if floor.get("motion") != "sawtooth" or not heights or across != 0 or not alike:
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
