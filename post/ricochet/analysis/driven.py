"""Time series of driven systems, and the values predicted for them."""

from typing import NamedTuple

import numpy as np

from ..predictions import hard_disks, theory
from ..reading.nature import ROUNDING, Refused
from ..reading.reader import SIDES, Run
from .statistics import SeriesMean, correlated_mean
from .structure import largest_cluster
from .thermodynamics import lightest_and_heaviest, packing

GAP = 0.1  # largest gap between neighbours in a cluster [mean diameters]
TimeSeries = tuple[np.ndarray, np.ndarray]  # times (S,) and values (S,)
Curves = dict[str, TimeSeries]  # by species; "" stands for all disks


def second_half(time: np.ndarray) -> np.ndarray:
    """Return which samples (S,) belong to the second half of a run."""
    return time >= (time[0] + time[-1]) / 2


def temperature(run: Run) -> Curves:
    """Return the temperature of the motion relative to the mean velocity as a function of time."""
    if run.n_disks < 2:
        raise Refused(
            f"{run.path}: holds one disk; a temperature requires at least two, as it is "
            "about their mean velocity"
        )
    time, value = run.observable("all/temperature")
    curves = {"": (time, value * run.n_disks / (run.n_disks - 1))}
    for kind in run.by_species if len(run.names) > 1 else ():
        if (count := int(kind.disks.sum())) > 1:
            time, value = run.observable(f"{kind.name}/temperature")
            curves[kind.name] = time, value * count / (count - 1)
    return curves


def species_ratio(run: Run) -> SeriesMean | None:
    """Return the temperature of the heaviest species over that of the lightest, or None.

    Both are averaged over the second half of the run. None is returned if all masses are equal, or
    if one of the two species has a single disk.
    """
    if len({kind.mass for kind in run.by_species}) == 1:
        return None
    curves = temperature(run)
    names = [run.names[k] for k in reversed(lightest_and_heaviest(run))]
    if not curves.keys() >= {*names}:
        return None
    time, _ = curves[""]
    late = second_half(time)
    return correlated_mean(*(curves[name][1][late] for name in names))


def components(run: Run) -> Curves:
    """Return kT_x and kT_y of the motion relative to the mean velocity as functions of time."""
    time, tensor = run.observable("kinetic_tensor")
    motion = 0 if run.shear_rate else run.observable("momentum").value ** 2 / run.mass.sum()
    kt = (tensor[:, [0, 3]] - motion) / (run.n_disks - 1)
    return {f"kT_{axis}": (time, kt[:, k]) for k, axis in enumerate("xy")}


def keeps_energy(run: Run) -> bool:
    """Return whether the kinetic energy is conserved in the second half of the run."""
    time, energy = run.observable("all/kinetic_energy")
    late = energy[second_half(time)]
    return bool(np.ptp(late) < ROUNDING * np.max(late, initial=0))


def noise_law(run: Run) -> float | None:
    """Return the temperature at which driving balances dissipation."""
    drive = run.parameters.get("drive", {})
    needs = {"noise_driven", "inelastic"}
    known = needs <= run.nature <= needs | {"rotating", "random_walk"}
    if not known or drive.get("species"):
        return None
    gas = packing(run), 2 * run.radius[0], run.mass[0]
    return hard_disks.noise_temperature(float(drive["strength"]), run.restitution, *gas)


def collision_loss(run: Run) -> SeriesMean:
    """Return the energy lost per collision, over its value for independent Maxwellian velocities.

    This value is (1 - xi^2) kT. The second half of the run is used. If the velocities of colliding
    disks are correlated, as in a flow, a collision dissipates less.
    """
    time, kt = temperature(run)[""]
    late = second_half(time)
    lost, kt = run.observable("dissipated_energy").value[late], kt[late]
    collisions = run.collisions_per_disk.value[late] * run.n_disks / 2
    expected = (1 - run.restitution**2) * (kt[1:] + kt[:-1]) / 2 * np.diff(collisions)
    return correlated_mean(np.diff(lost), expected)


def temperature_law(run: Run) -> np.ndarray | float | None:
    """Return the steady temperature, or the temperatures (S,) during an adiabatic compression."""
    side = only_moving(run, "constant_velocity")
    if side is None:
        return noise_law(run)
    kt = run.observable("all/temperature").value
    return kt[0] * run.n_disks / (run.n_disks - 1) * adiabat(run, side, widths(run, side))


def only_moving(run: Run, motion: str) -> int | None:
    """Return the index of the only moving side if it moves as `motion` says, or None.

    None is also returned if the disks are not equal and elastic.
    """
    moves = [k for k, side in enumerate(run.sides) if side.get("motion", "still") != "still"]
    plain = run.nature <= {"moving_sides", "piston", "walls", "rotating"} and len(moves) == 1
    return moves[0] if plain and run.sides[moves[0]]["motion"] == motion else None


def widths(run: Run, side: int) -> np.ndarray:
    """Return the width of the box along the motion of a side, at each of S samples."""
    lower, upper = run.corners_at(run.observable("total_energy").time)
    return (upper - lower)[:, side // 2]


def adiabat(run: Run, side: int, widths: np.ndarray) -> np.ndarray:
    """Return the temperatures on the adiabat, relative to that at the initial width."""
    height, walled = float(run.edges[1 - side // 2]), not run.periodic[1 - side // 2]
    return hard_disks.adiabat(widths, height, run.n_disks, float(run.radius[0]), walled)


def width(run: Run) -> Curves:
    """Return the width of the box along the motion of its piston as a function of time."""
    if not run.piston_positions:
        raise Refused(f"{run.path}: has no piston (side.motion = 'piston')")
    return {"": (run.observable("total_energy").time, widths(run, min(run.piston_positions)))}


class Room(NamedTuple):
    """Predicted mean and standard deviation of the width of a box with a piston."""

    mean: float
    deviation: float


def width_law(run: Run) -> Room | None:
    """Return the predicted width at constant enthalpy, for a piston initially at rest, or None."""
    side = only_moving(run, "piston")
    if side is None or not run.sides[side]["force"] > 0:
        return None
    along = bool(run.periodic[1 - side // 2])  # momentum along the sides is conserved
    flow = along * run.observable("momentum").value[0, 1 - side // 2] ** 2 / 2 / run.mass.sum()
    energy = run.observable("all/kinetic_energy").value[0] * run.n_disks - flow
    start, force = widths(run, side)[:1], float(run.sides[side]["force"])
    grid = np.linspace(0, start + energy / force, 20002)[1:-1, 0]
    places = -(run.n_disks - along / 2) * np.log(adiabat(run, side, np.append(start, grid))[1:])
    left = energy + force * (start - grid)
    mean, variance = theory.pushed_width(grid, places, 2 * run.n_disks + 1 - along, left)
    least = grid[np.isnan(places).sum()]
    return Room(mean, variance**0.5) if mean - 4 * variance**0.5 > least else None


def balances(run: Run) -> tuple[float, float]:
    """Return the largest relative changes of enthalpy and total momentum during a run."""
    k = min(run.piston_positions)
    side = run.sides[k]
    time, energy = run.observable("total_energy")
    speed, impulse = (
        run.observable(f"sides/{SIDES[k]}/{what}").value for what in ("velocity", "impulse")
    )
    speed, given = np.ravel(speed), (-1) ** k * impulse[:, k // 2]
    energy = energy + side["mass"] * speed**2 / 2 + side["force"] * widths(run, k)
    momentum = side["mass"] * speed - side["force"] * time - given
    return np.ptp(energy) / energy[0], np.ptp(momentum) / np.abs(given).max()


def share(run: Run) -> Curves:
    """Return the fraction of the disks in the left half of the box as a function of time."""
    middle = run.lower[0] + run.edges[0] / 2
    return {"": (run.time, np.mean(run.position[:][..., 0] < middle, axis=1))}


def fuller(share: np.ndarray) -> np.ndarray:
    """Return the fractions (T,) of disks in the fuller half, given those in the left half.

    The last third of the run decides which half is the fuller one in the first third, and vice
    versa. If the same frames served both purposes, chance alone would raise the mean fraction above
    1/2. The middle third is left out to keep the other two independent.
    """
    third = max(1, len(share) // 3)
    ends = share[:third], share[-third:]
    signs = [np.sign(end.mean() - 0.5) for end in ends]
    return 0.5 + np.concatenate([signs[1] * (ends[0] - 0.5), signs[0] * (ends[1] - 0.5)])


def demon_law(run: Run) -> float | None:
    """Return the predicted steady fraction of the disks that are in the fuller half."""
    floor = run.parameters.get("side", {}).get("bottom", {})
    middle = run.lower[0] + run.edges[0] / 2
    parting = [wall for wall in run.walls if np.allclose(wall[:, 0], middle)]
    heights = [w[:, 1].max() for w in parting if np.isclose(w[:, 1].min(), run.lower[1])]
    across, down = run.gravity
    alike = run.nature <= {"moving_sides", "gravity", "inelastic", "obstacles", "rotating", "walls"}
    if floor.get("motion") != "sawtooth" or not heights or across != 0 or not alike:
        return None
    if run.obstacles or run.restitution == 1 or run.parameter("contact", "wall_restitution") != 1:
        return None
    hole, diameter = float(heights[0] - run.lower[1]), 2 * run.radius[0]
    layers = run.n_disks * diameter / (run.edges[0] / 2 - diameter)
    climb = max(0.0, -down) * hole / float(floor["velocity"]) ** 2
    return theory.demon_share(climb, layers, run.restitution)


def height(run: Run) -> Curves:
    """Return the mean height of each species above the floor as a function of time."""
    y = run.position[:][..., 1] - run.lower[1]
    several = len(run.names) > 1
    return {
        kind.name * several: (run.time, y[:, kind.disks].mean(axis=1)) for kind in run.by_species
    }


def cluster(run: Run) -> Curves:
    """Return the fraction of the disks in the largest cluster as a function of time."""
    gap = GAP * 2 * float(run.radius.mean())
    shares = [largest_cluster(run, frame, gap) / run.n_disks for frame in range(run.n_frames)]
    return {"": (run.time, np.array(shares))}


def viscosity(run: Run) -> Curves:
    """Return the viscosity, -P_xy over the shear rate, as a function of time."""
    if "sheared" not in run.nature:
        raise Refused(f"{run.path}: is not sheared; --show viscosity requires box.shear_rate")
    if "random_walk" in run.nature:
        why = "noise moves its centre of mass through the flow, which changes the stress"
        raise Refused(f"{run.path}: {why}; set drive.keep_momentum = .true.")
    time, first = np.unique(run.observable("kinetic_tensor").time, return_index=True)
    flown, handed = (run.observable(f"{k}_tensor").value[first, 1] for k in ("kinetic", "virial"))
    stress = (flown[1:] + flown[:-1]) / 2 + np.diff(handed) / np.diff(time)
    return {"": (time[1:], -stress / (run.shear_rate * np.prod(run.edges)))}
