"""Pressure, temperature, collision rates and free paths of a gas in equilibrium, with errors.

    python post/rates.py runs/bulk.h5 -o rates.png --csv rates.csv

Runs are combined; all must be of one system, without gravity.  Means are taken in equilibrium: from
where nothing drifts any more, or after --skip.  Errors take the memory of each quantity into
account, `samples` is how many independent ones it is worth, and what speaks against an error is a
warning.  All is scaled to the mean temperature of the runs.  Pressure: by the virial of the pair
collisions, and by the impulses on each side (a little larger: centres keep a radius away from
sides).  With an event log also w_ij, the collisions of a disk of species i with disks of species j
per time, and the free paths: in a frame each disk is on one, as long as its speed times the time
between its collisions before and after.  Frames meet long paths more often; therefore each counts 1
over its time; errors are from the scatter of runs, or of one run's frames in blocks.  The line is
for equal disks that meet without memory (Boltzmann, Enskog).  Of runs that lose energy in
collisions and have no equilibrium only the free paths are found, in the frames after --skip, or
else 15 collisions per disk.
"""

from ricochet import Run, RunError
from ricochet.drawing import COLOURS, band, bars, caption, plt
from ricochet.script import command_line, launch, read_all, report
from ricochet.statistics import (
    FINE,
    Estimate,
    SeriesMean,
    combined,
    doubts,
    estimate,
    series_mean,
    to_error,
)
from ricochet.thermodynamics import (
    after_start,
    all_cool,
    collision_rate,
    equal_disks,
    loses_energy,
    packing,
    start_of_equilibrium,
    steps,
    temperature,
    z_virial,
)

import numpy as np
import scipy

SIDES = ("left", "right", "bottom", "top")
BINS = np.linspace(0, 6, 49)  # free paths in units of their mean
MIDDLES = (BINS[1:] + BINS[:-1]) / 2
BLOCKS = 8  # of the frames of a single run


def check(runs: list[Run]) -> None:
    """Refuse what is no gas in an empty box, and runs of different systems."""
    first = runs[0]
    cool = all_cool(runs)
    for run in runs:
        if cool and not has_log(run):
            raise RunError(
                f"{run.path}: is not elastic: it loses energy in collisions, and has free paths "
                "only; those need output.event_log = .true."
            )
        if run.gravity.any() or run.obstacles or len(run.walls):
            raise RunError(f"{run.path}: needs a gas without gravity, obstacles, walls")
        if run.names != first.names or run.count != first.count:
            raise RunError(f"{run.path}: not the same system as {first.path}")


def pressures(run: Run, skip: float | None) -> dict[str, SeriesMean]:
    """By the virial, and by the sides that are walls; a side feels force per length."""
    area, kt = np.prod(run.edges), run.count * temperature(run)
    found = {"pressure_virial": z_virial(run, skip).scaled(kt / area)}
    s = steps(run, skip)
    for k, side in enumerate(SIDES):
        if not run.periodic[k // 2]:
            force = series_mean(s.impulse[:, k], s.time)
            found[f"pressure_{side}"] = force.scaled(1 / run.edges[1 - k // 2])
    return found


def pair_rates(run: Run, skip: float | None) -> dict[str, SeriesMean]:
    """w_ij from the event log."""
    log, species = run.events, run.species - 1
    cuts = np.linspace(start_of_equilibrium(run, skip), run.time[-1], FINE + 1)
    pairs = log.j > 0
    one, other = species[log.i[pairs] - 1], species[log.j[pairs] - 1]
    found = {}
    for a, first in enumerate(run.by_species):
        for b, second in enumerate(run.names):
            weight = ((one == a) & (other == b)) * 1.0 + ((one == b) & (other == a))
            counts, _ = np.histogram(log.time[pairs], cuts, weights=weight)
            rate = series_mean(counts, np.diff(cuts))
            found[f"w_{first.name}_{second}"] = rate.scaled(1 / first.disks.sum())
    return found


def quantities(run: Run, skip: float | None = None) -> dict[str, SeriesMean]:
    """Everything that has an error, by name."""
    found = pressures(run, skip) | {"collisions_per_disk_and_time": collision_rate(run, skip)}
    if not run.periodic.all():
        s = steps(run, skip)
        found["side_hits_per_time"] = series_mean(s.hits, s.time)
    return found | (pair_rates(run, skip) if has_log(run) else {})


def at_temperature(found: dict[str, SeriesMean], ratio: float) -> dict[str, SeriesMean]:
    """What they would be at another temperature: hard disks only move faster."""
    powers = {name: 1.0 if name.startswith("pressure") else 0.5 for name in found}
    return {name: one.scaled(ratio ** powers[name]) for name, one in found.items()}


def has_log(run: Run) -> bool:
    return bool(run.parameter("output", "event_log", False))


# --- free paths ---


def free_paths(run: Run, skip: float | None = None) -> tuple[np.ndarray, np.ndarray]:
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
    begin = after_start if loses_energy(run) else start_of_equilibrium
    duration[run.time < begin(run, skip)] = np.nan
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


def histogram(runs: list[Run], skip: float | None = None) -> tuple[Estimate, Estimate] | None:
    """The mean free path, and the density of the paths in units of it.

    Their errors are from the scatter of the runs, or of a single run's frames in blocks.
    """
    parts = [free_paths(run, skip) for run in runs if has_log(run)]
    if not parts or sum(len(path) for path, _ in parts) == 0:
        return None
    path, weight = (np.concatenate(part) for part in zip(*parts, strict=True))
    mean = float(np.average(path, weights=weight))
    if len(parts) == 1:
        parts = list(zip(np.array_split(path, BLOCKS), np.array_split(weight, BLOCKS), strict=True))
    known = [part for part in parts if len(part[0]) > 0]
    means = estimate([np.average(path, weights=weight) for path, weight in known])
    shapes = estimate([density(path, weight, mean) for path, weight in known])
    return Estimate(mean, means.error), Estimate(density(path, weight, mean), shapes.error)


def density(path: np.ndarray, weight: np.ndarray, unit: float) -> np.ndarray:
    """Of paths, in the bins."""
    counts, _ = np.histogram(path / unit, BINS, weights=weight)
    return counts / (np.sum(weight) * np.diff(BINS))


# --- figure ---


def pressures_in_time(runs: list[Run], cuts: np.ndarray) -> dict[str, np.ndarray]:
    """(R, C) the pressure of each run between the times `cuts`, at the mean kT of the runs."""
    kts = np.array([[temperature(run)] for run in runs])

    def rates(name: str, scale: np.ndarray | float) -> np.ndarray:
        found = []
        for run in runs:
            time, value = run.observable(name)
            total = np.sum(value.reshape(len(time), -1) * scale, axis=1)
            found.append(np.diff(np.interp(cuts, time, total)) / np.diff(cuts))
        return np.array(found) * np.mean(kts) / kts

    area, length = np.prod(runs[0].edges), runs[0].edges[[1, 1, 0, 0]]
    ideal = runs[0].count * np.mean(kts) / area
    ways = {"virial": ideal + rates("virial", 1 / (2 * area))}
    if not runs[0].periodic.any():
        ways["sides"] = rates("wall_impulse", 1 / (4 * length))
    return ways


def cuts_of(runs: list[Run]) -> np.ndarray:
    """Times between which a pressure is drawn."""
    return np.linspace(0, min(run.collisions_per_disk.time[-1] for run in runs), FINE + 1)


def draw_pressure(axes: plt.Axes, runs: list[Run], means: dict, start: float) -> None:
    """The pressure in time, mean over the runs with its error; its mean in equilibrium."""
    cuts = cuts_of(runs)
    middle, colours = (cuts[1:] + cuts[:-1]) / 2, iter(COLOURS)
    for way, values in pressures_in_time(runs, cuts).items():
        band(axes, middle, *estimate(values), color=next(colours), label=way)
    mean, error, *_ = means["pressure_virial"]
    label = f"virial in equilibrium, {mean:.5g} ± {error:.2g}"
    ends = np.array([start, cuts[-1]])
    band(axes, ends, np.full(2, mean), error, color="black", lw=1, label=label)
    axes.axvspan(0, start, color="0.9", lw=0, zorder=0, label="left out")
    axes.set(xlabel="time t (reduced units)", ylabel="pressure", xlim=(0, cuts[-1]))
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.4 * (high - low))  # room for the legend above what it names
    axes.legend(loc="upper right")


def draw(
    runs: list[Run], means: dict, start: float, paths: tuple[Estimate, Estimate] | None
) -> plt.Figure:
    """The pressure in time, of a gas with means; with an event log also the free paths."""
    count = bool(means) + bool(paths)
    figure, panels = plt.subplots(1, count, squeeze=False, figsize=(2 + 4 * count, 4.5))
    if means:
        draw_pressure(panels[0, 0], runs, means, start)
    if paths:
        mean, height = paths
        axes, label = panels[0, -1], f"measured, $\\ell$ = {' ± '.join(to_error(*mean))}"
        bars(axes, height, BINS, color=COLOURS[0], label=label)
        fine = np.linspace(0, BINS[-1], 200)
        if equal_disks(runs[0]):
            axes.plot(fine, path_density(fine), color="black", lw=1.2, label="without memory")
        axes.set(
            yscale="log", xlabel="free path $/\\,\\ell$", ylabel="probability density", xlim=(0, 6)
        )
        axes.legend()
    figure.suptitle(f"{caption(runs)},  η = {packing(runs[0]):.4g}", fontsize=10)
    return figure


def table(runs: list[Run], means: dict, start: float, path: Estimate | None) -> dict[str, list]:
    """A row per quantity: exact ones first, then those with an error."""
    momentum = np.mean([run.observable("momentum").value for run in runs], axis=(0, 1))
    exact = {
        "packing": packing(runs[0]),
        "kT": float(np.mean([temperature(run) for run in runs])),
        "momentum_x": float(momentum[0]),
        "momentum_y": float(momentum[1]),
        "from_time" if not means else "equilibrium_from": start,
    }
    known = {} if path is None else {"mean_free_path": path}
    known |= means
    return {
        "quantity": [*exact, *known],
        "mean": [*exact.values(), *(float(one.mean) for one in known.values())],
        "error": ["exact"] * len(exact) + [float(one.error) for one in known.values()],
        "samples": [""] * (len(exact) + (path is not None))
        + [round(one.samples, 1) for one in means.values()],
    }


def curves(runs: list[Run], means: dict, paths: tuple[Estimate, Estimate] | None) -> list[dict]:
    """A row for each point of the figure: the pressure at a time x, the density at a length x."""
    shown = {}
    if means:
        cuts = cuts_of(runs)
        for way, values in pressures_in_time(runs, cuts).items():
            shown[f"pressure_{way}(t)"] = ((cuts[1:] + cuts[:-1]) / 2, *estimate(values))
    if paths:
        shown["free_path_density"] = (MIDDLES, *paths[1])
    return [
        {"quantity": name, "mean": float(y), "error": float(error), "samples": "", "x": float(x)}
        for name, curve in shown.items()
        for x, y, error in zip(*curve, strict=True)
    ]


def main() -> None:
    args = command_line(__doc__, "rates.png", skip=None).parse_args()
    runs = read_all(args.runs)
    check(runs)
    cool, kt = all_cool(runs), float(np.mean([temperature(run) for run in runs]))
    begin = after_start if cool else start_of_equilibrium
    found = [
        {} if cool else at_temperature(quantities(run, args.skip), kt / temperature(run))
        for run in runs
    ]
    members = {name: [one[name] for one in found] for name in found[0]}
    means = {name: combined(ones) for name, ones in members.items()}
    start = max(begin(run, args.skip) for run in runs)
    paths = histogram(runs, args.skip)
    rows = table(runs, means, start, paths[0] if paths else None)
    notes = [note for name, ones in members.items() for note in doubts(name, ones)]
    notes += ["the gas loses energy, no equilibrium: kT is that of the start"] * cool
    title = "Pressure, rates and free paths of hard disks"
    values = [dict(zip(rows, row, strict=True), x="") for row in zip(*rows.values(), strict=True)]
    data = values + curves(runs, means, paths)
    report(args, runs, title, draw(runs, means, start, paths), rows, data=data, notes=notes)


if __name__ == "__main__":
    launch(main)
