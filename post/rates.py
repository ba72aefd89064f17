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

from ricochet import Run, RunError, statistics
from ricochet import thermodynamics as td
from ricochet.drawing import COLOURS, band, bars, caption, plt
from ricochet.free_paths import BINS, mean_and_density, path_density
from ricochet.script import command_line, launch, points, report
from ricochet.statistics import FINE, Curve, Estimate, SeriesMean, estimate

import numpy as np


def check(runs: list[Run], cool: bool) -> None:
    """Refuse what is no gas in an empty box, and runs of different systems."""
    first = runs[0]
    for run in runs:
        if cool and not td.has_log(run):
            raise RunError(
                f"{run.path}: is not elastic: it loses energy in collisions, and has free paths "
                "only; those need output.event_log = .true."
            )
        if run.gravity.any() or run.obstacles or len(run.walls):
            raise RunError(f"{run.path}: needs a gas without gravity, obstacles, walls")
        if run.names != first.names or run.count != first.count:
            raise RunError(f"{run.path}: not the same system as {first.path}")


def over_all(runs: list[Run], skip: float | None, notes: list[str]) -> dict[str, SeriesMean]:
    """What has an error, at the mean temperature of the runs: hard disks only move faster."""
    kt = float(np.mean([td.temperature(run) for run in runs]))
    found = [td.rates(run, skip) for run in runs]
    means = {}
    for name in found[0]:
        power = 1.0 if name.startswith("pressure") else 0.5
        ratios = [(kt / td.temperature(run)) ** power for run in runs]
        members = [one[name].scaled(ratio) for one, ratio in zip(found, ratios, strict=True)]
        means[name] = statistics.combined(members)
        notes += statistics.doubts(name, members)
    return means


def pressures_in_time(runs: list[Run]) -> dict[str, Curve]:
    """The mean pressure over the runs, at their mean kT, by the virial and by four walls."""
    cuts = np.linspace(0, min(run.collisions_per_disk.time[-1] for run in runs), FINE + 1)
    kts = np.array([[td.temperature(run)] for run in runs])

    def growth(name: str, scale: np.ndarray | float) -> np.ndarray:
        found = []
        for run in runs:
            time, value = run.observable(name)
            total = np.sum(value.reshape(len(time), -1) * scale, axis=1)
            found.append(np.diff(np.interp(cuts, time, total)) / np.diff(cuts))
        return np.array(found) * np.mean(kts) / kts

    area, length = np.prod(runs[0].edges), runs[0].edges[[1, 1, 0, 0]]
    ideal = runs[0].count * np.mean(kts) / area
    ways = {"virial": ideal + growth("virial", 1 / (2 * area))}
    if not runs[0].periodic.any():
        ways["sides"] = growth("wall_impulse", 1 / (4 * length))
    middle = (cuts[1:] + cuts[:-1]) / 2
    return {way: Curve(middle, *estimate(values)) for way, values in ways.items()}


def draw_pressure(axes: plt.Axes, curves: dict[str, Curve], mean: SeriesMean, start: float) -> None:
    """The pressure in time with its error; its mean in equilibrium."""
    x = curves["virial"].x
    end = x[-1] + x[0]
    for (way, curve), colour in zip(curves.items(), COLOURS, strict=False):
        band(axes, *curve, color=colour, label=way)
    label = f"virial in equilibrium, {mean.mean:.5g} ± {mean.error:.2g}"
    level = np.full(2, mean.mean)
    band(axes, np.array([start, end]), level, mean.error, color="black", lw=1, label=label)
    axes.axvspan(0, start, color="0.9", lw=0, zorder=0, label="left out")
    axes.set(xlabel="time t (reduced units)", ylabel="pressure", xlim=(0, end))
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.4 * (high - low))  # room for the legend above what it names
    axes.legend(loc="upper right")


def draw_paths(axes: plt.Axes, paths: tuple[Estimate, Estimate], equal: bool) -> None:
    """The free paths, and those without memory."""
    mean, height = paths
    label = f"measured, $\\ell$ = {' ± '.join(statistics.to_error(*mean))}"
    bars(axes, height, BINS, color=COLOURS[0], label=label)
    if equal:
        fine = np.linspace(0, BINS[-1], 200)
        axes.plot(fine, path_density(fine), color="black", lw=1.2, label="without memory")
    axes.set(xlabel="free path $/\\,\\ell$", ylabel="probability density", xlim=(0, 6))
    axes.set_yscale("log")
    axes.legend()


def table(runs: list[Run], start: float, means: dict, path: Estimate | None) -> list[dict]:
    """A row per quantity: exact ones first, then those with an error."""
    momentum = np.mean([run.observable("momentum").value for run in runs], axis=(0, 1))
    exact = {
        "packing": td.packing(runs[0]),
        "kT": float(np.mean([td.temperature(run) for run in runs])),
        "momentum_x": float(momentum[0]),
        "momentum_y": float(momentum[1]),
        "equilibrium_from" if means else "from_time": start,
    }
    rows = [(name, value, "exact", "") for name, value in exact.items()]
    rows += [("mean_free_path", path.mean, float(path.error), "")] if path else []
    rows += [
        (name, float(one.mean), float(one.error), round(one.samples, 1))
        for name, one in means.items()
    ]
    return [dict(zip(("quantity", "mean", "error", "samples"), row, strict=True)) for row in rows]


def main() -> None:
    args = command_line(__doc__, "rates.png", skip=None).parse_args()
    runs, notes = args.runs, []
    cool = td.all_cool(runs)
    check(runs, cool)
    begin = td.after_start if cool else td.start_of_equilibrium
    start = max(begin(run, args.skip) for run in runs)
    paths = mean_and_density(runs, args.skip)
    means, curves = {}, {}
    count = (not cool) + bool(paths)
    figure, panels = plt.subplots(1, count, squeeze=False, figsize=(2 + 4 * count, 4.5))
    if cool:
        notes.append("the gas loses energy, no equilibrium: kT is that of the start")
    else:
        means = over_all(runs, args.skip, notes)
        shown = pressures_in_time(runs)
        draw_pressure(panels[0, 0], shown, means["pressure_virial"], start)
        curves = {(f"pressure_{way}(t)",): curve for way, curve in shown.items()}
    if paths:
        draw_paths(panels[0, -1], paths, td.equal_disks(runs[0]))
        curves["free_path_density",] = Curve((BINS[1:] + BINS[:-1]) / 2, *paths[1])
    figure.suptitle(f"{caption(runs)},  η = {td.packing(runs[0]):.4g}")
    rows = table(runs, start, means, paths and paths[0])
    data = [row | {"x": ""} for row in rows]
    for point in points(("quantity", "x", "mean", "error"), curves):
        data.append({**rows[0], **point, "samples": ""})
    report(args, figure, rows, data=data, notes=notes)


if __name__ == "__main__":
    launch(main)
