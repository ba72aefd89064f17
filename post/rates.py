"""Pressure, temperature, collision rates and free paths of a gas in equilibrium, with errors.

    python post/rates.py runs/bulk.h5 -o rates.png --csv rates.csv

Runs are combined; all must be of one system, elastic, without gravity.  Means and errors come from
20 blocks of each run, after its first --skip collisions per disk (of the whole run, if it is not
twice as long).  Pressure: by the virial of the pair collisions, and by the impulses on each side (a
little larger: centres keep a radius away from sides).  With an event log also w_ij, the collisions
of a disk of species i with disks of species j per time, and the free paths: in a frame each disk is
on one, as long as its speed times the time between its collisions before and after.  Frames meet
long paths more often; therefore each counts 1 over its time.  The line is for disks that meet
without memory (Boltzmann, Enskog).
"""

from ricochet import Run, RunError
from ricochet.drawing import COLOURS, caption, plt
from ricochet.script import command_line, launch, read_all, report
from ricochet.statistics import Estimate, combined, ratio
from ricochet.thermodynamics import (
    BLOCKS,
    SKIP,
    blocks,
    collision_rate,
    packing,
    settled,
    temperature,
    z_virial,
)

import numpy as np
import scipy

SIDES = ("left", "right", "bottom", "top")
BINS = np.linspace(0, 6, 49)  # free paths in units of their mean


def check(runs: list[Run]) -> None:
    """Refuse runs without equilibrium, and runs of different systems."""
    first = runs[0]
    for run in runs:
        if run.restitution != 1 or run.gravity.any() or run.obstacles or len(run.walls):
            raise RunError(f"{run.path}: needs an elastic gas without gravity, obstacles, walls")
        if run.names != first.names or run.count != first.count:
            raise RunError(f"{run.path}: not the same system as {first.path}")


def pressures(run: Run, skip: float) -> dict[str, Estimate]:
    """By the virial, and by the sides that are walls; a side feels force per length."""
    area, z, kt = np.prod(run.edges), z_virial(run, skip), run.count * temperature(run)
    found = {"pressure_virial": Estimate(z.mean * kt / area, z.error * kt / area)}
    b = blocks(run, skip)
    for k, side in enumerate(SIDES):
        if not run.periodic[k // 2]:
            found[f"pressure_{side}"] = ratio(b.impulse[:, k], b.time, 1 / run.edges[1 - k // 2])
    return found


def pair_rates(run: Run, skip: float) -> dict[str, Estimate]:
    """w_ij from the event log."""
    log, species = run.events, run.species - 1
    time, tau = run.collisions_per_disk
    cuts = np.linspace(time[settled(tau, skip)], run.time[-1], BLOCKS + 1)
    pairs = log.j > 0
    one, other = species[log.i[pairs] - 1], species[log.j[pairs] - 1]
    found = {}
    for a, first in enumerate(run.by_species):
        for b, second in enumerate(run.names):
            weight = ((one == a) & (other == b)) * 1.0 + ((one == b) & (other == a))
            counts, _ = np.histogram(log.time[pairs], cuts, weights=weight)
            rate = ratio(counts, np.diff(cuts), 1 / first.disks.sum())
            found[f"w_{first.name}_{second}"] = rate
    return found


def quantities(run: Run, skip: float = SKIP) -> dict[str, Estimate]:
    """Everything that has an error, by name."""
    found = pressures(run, skip) | {"collisions_per_disk_and_time": collision_rate(run, skip)}
    if not run.periodic.all():
        b = blocks(run, skip)
        found["side_hits_per_time"] = ratio(b.hits, b.time)
    return found | (pair_rates(run, skip) if has_log(run) else {})


def has_log(run: Run) -> bool:
    return bool(run.parameter("output", "event_log", False))


# --- free paths ---


def free_paths(run: Run, skip: float = SKIP) -> tuple[np.ndarray, np.ndarray]:
    """Lengths of the paths that the disks of all frames are on, and the weight of each."""
    log = run.events
    disk = np.concatenate([log.i, log.j[log.j > 0]])
    time = np.concatenate([log.time, log.time[log.j > 0]])
    order = np.lexsort((time, disk))
    ends = np.cumsum(np.bincount(disk, minlength=run.count + 1))
    duration = np.full((run.frames, run.count), np.nan)
    for k in range(run.count):
        own = time[order[ends[k] : ends[k + 1]]]
        after = np.searchsorted(own, run.time, side="right")
        inside = (after > 0) & (after < len(own))
        duration[inside, k] = own[after[inside]] - own[after[inside] - 1]
    duration[: settled(run.collisions_per_disk_at(run.time), skip)] = np.nan
    known = duration > 0
    return (run.speed(slice(None)) * duration)[known], 1 / duration[known]


def path_density(x: np.ndarray) -> np.ndarray:
    """Density of free paths in units of the mean one, <v> / w, if collisions have no memory.

    nu(v) / w follows from the mean relative speed of a disk of speed v in a Maxwellian gas.
    """
    u = np.linspace(0, 5, 2001)[1:]  # v / sqrt(2 kT / m)
    half = u**2 / 2
    slow, fast = (scipy.special.ive(order, half) for order in (0, 1))
    nu = ((1 + u**2) * slow + u**2 * fast) / np.sqrt(2)
    rate = nu / (u * 2 / np.sqrt(np.pi))  # collisions per mean free path
    weight = 2 * u * np.exp(-(u**2)) * nu
    weight /= np.sum(weight)
    return np.array([np.sum(weight * rate * np.exp(-rate * value)) for value in x])


def histogram(runs: list[Run], skip: float = SKIP) -> tuple[float, np.ndarray] | None:
    """The mean free path, and the density of the paths in units of it."""
    parts = [free_paths(run, skip) for run in runs if has_log(run)]
    if not parts or sum(len(path) for path, _ in parts) == 0:
        return None
    path, weight = (np.concatenate(part) for part in zip(*parts, strict=True))
    mean = float(np.average(path, weights=weight))
    counts, _ = np.histogram(path / mean, BINS, weights=weight)
    return mean, counts / (np.sum(weight) * np.diff(BINS))


# --- figure ---


def draw_blocks(axes: plt.Axes, runs: list[Run], skip: float) -> None:
    """The pressure block by block."""
    for run, style in zip(runs, ("-", "--", ":", "-."), strict=False):
        b = blocks(run, skip)
        kt, middle = temperature(run), np.cumsum(b.time) - b.time / 2
        virial = (run.count * kt + b.virial / b.time / 2) / np.prod(run.edges)
        axes.plot(middle, virial, color=COLOURS[0], marker=".", ls=style, lw=0.8, label="virial")
        if not run.periodic.any():
            length = run.edges[[1, 1, 0, 0]]
            sides = np.mean(b.impulse / length, axis=1) / b.time
            axes.plot(middle, sides, color=COLOURS[1], marker=".", ls=style, lw=0.8, label="sides")
    handles, names = axes.get_legend_handles_labels()
    known = dict(zip(names, handles, strict=True))
    axes.legend(known.values(), known.keys())
    axes.set(xlabel="time t (reduced units)", ylabel="pressure of a block")


def draw(runs: list[Run], paths: tuple[float, np.ndarray] | None, skip: float) -> plt.Figure:
    """The pressure by blocks; with an event log also the free paths."""
    figure, panels = plt.subplots(1, 2 if paths else 1, figsize=(10 if paths else 6, 4.5))
    draw_blocks(np.atleast_1d(panels)[0], runs, skip)
    if paths:
        mean, density = paths
        axes = panels[1]
        axes.stairs(density, BINS, color=COLOURS[0], label=f"measured, $\\ell$ = {mean:.4g}")
        fine = np.linspace(0, BINS[-1], 200)
        axes.plot(fine, path_density(fine), color="black", lw=1.2, label="without memory")
        axes.set(
            yscale="log", xlabel="free path $/\\,\\ell$", ylabel="probability density", xlim=(0, 6)
        )
        axes.legend()
    figure.suptitle(f"{caption(runs)},  η = {packing(runs[0]):.4g}", fontsize=10)
    return figure


def table(runs: list[Run], skip: float, path: float | None) -> dict[str, list]:
    """A row per quantity: exact ones first, then those with an error."""
    found = [quantities(run, skip) for run in runs]
    means = {key: combined([one[key] for one in found]) for key in found[0]}
    momentum = np.mean([run.observable("momentum").value for run in runs], axis=(0, 1))
    exact = {
        "packing": packing(runs[0]),
        "kT": float(np.mean([temperature(run) for run in runs])),
        "momentum_x": float(momentum[0]),
        "momentum_y": float(momentum[1]),
    }
    if path is not None:
        exact["mean_free_path"] = path
    return {
        "quantity": [*exact, *means],
        "mean": [*exact.values(), *(float(one.mean) for one in means.values())],
        "error": [*[float("nan")] * len(exact), *(float(one.error) for one in means.values())],
    }


def main() -> None:
    args = command_line(__doc__, "rates.png", skip=SKIP).parse_args()
    runs = read_all(args.runs)
    check(runs)
    paths = histogram(runs, args.skip)
    rows = table(runs, args.skip, paths[0] if paths else None)
    title = "Pressure, rates and free paths of hard disks"
    report(args, runs, title, draw(runs, paths, args.skip), rows)


if __name__ == "__main__":
    launch(main)
