"""Pressure, temperature, collision rates and free paths of a gas in equilibrium, with errors.

    python post/rates.py runs/bulk.h5 -o rates.png --csv rates.csv

The script combines runs of one system without gravity.  Means are taken in equilibrium, which
begins after the first X collisions per disk, where X is the value of --equilibration, or by default
when no observable drifts any longer.  Errors account for the autocorrelation of each quantity; in
the table, `samples` is the effective number of independent samples.  Warnings explain why an error
may be unreliable.  If the kinetic energy is conserved, kT of each run is exact, and the results of
all runs are scaled to the mean kT.  If there are thermal walls or a thermostat, which must all have
one temperature, or if disks rotate, kT is a measured mean with an error.

The pressure is measured from the virial of the pair collisions and from the momentum transfer to
each side.  The pressure on the sides is slightly larger than the pressure from the virial, because
the distance of the centre of a disk from a side cannot be smaller than the radius.  If the run has
an event log, the script also analyses the free paths, and the table contains the collision rates
w_ij.  The rate w_ij is the rate at which a disk of species i collides with disks of species j.  The
free path of a disk in a frame is the distance between its last collision before the frame and its
first collision after the frame.  Each free path is weighted with the inverse of its duration,
because long paths occur in more frames than short paths.  The errors are determined from the
scatter of the runs or, for a single run, from the scatter of blocks of frames.  In the panel of
free paths, the line shows the prediction for equal disks and molecular chaos (Boltzmann, Enskog).
Free paths are not defined for driven disks, whose velocities change between collisions.

If the disks lose energy, or if the walls have different temperatures, the script analyses only the
free paths.  The analysis of free paths uses the frames after the first X collisions per disk, where
X is the value of --equilibration.  Without --equilibration, the analysis uses the frames in which
no observable drifts or, if the gas cools, the frames later than 15 collisions per disk.
"""

from ricochet import Run, RunError, equilibrium, statistics, thermodynamics as td
from ricochet.analysis.statistics import FINE, Curve, Estimate, SeriesMean, estimate
from ricochet.figures.drawing import COLOURS, band, bars, caption, plt
from ricochet.predictions.theory import path_density
from ricochet.reading.nature import allow
from ricochet.script import command_line, launch, points, report

import numpy as np

BINS = np.linspace(0, 6, 49)  # free paths in units of their mean
BLOCKS = 8  # number of blocks of frames of a single run
#: Traits of runs with straight free flights whose lengths have the same distribution everywhere.
STRAIGHT = {
    "walls",
    "mixture",
    "pair_restitution",
    "inelastic",
    "soft_contacts",
    "rough",
    "rotating",
}
STRAIGHT |= {"thermal_walls", "unequal_temperatures", "sliding_surfaces"}


def check(runs: list[Run]) -> None:
    """Raise an error if the systems differ, or if they contain obstacles or gravity."""
    first = runs[0]
    for run in runs:
        allow(run, "rates are those of a gas without obstacles and gravity", *td.FLUID, *STRAIGHT)
        if not run.nature.in_equilibrium and not td.has_log(run):
            needs = "only free paths are defined for it, and they require output.event_log = .true."
            allow(run, needs, *td.FLUID)
        if run.names != first.names or run.n_disks != first.n_disks:
            raise RunError(f"{run.path}: not the same system as {first.path}")


def scales(runs: list[Run]) -> np.ndarray:
    """Return the factors by which kT of each run is scaled to the mean kT."""
    kept = all(run.nature.keeps_kinetic_energy for run in runs)
    kts = np.array([td.kt_at_start(run) if kept else 1.0 for run in runs])
    return kts.mean() / kts


def over_all(runs: list[Run], skip: float | None, notes: list[str]) -> dict[str, SeriesMean]:
    """Return all results with errors; each run is scaled to the mean temperature of all runs."""
    kts = scales(runs)
    found = [td.rates(run, skip) for run in runs]
    means = {}
    for name in found[0]:
        power = 1.0 if name.startswith("pressure") else 0.5 * (name != "kT")
        members = [one[name].scaled(kt**power) for one, kt in zip(found, kts, strict=True)]
        means[name] = statistics.combine_runs(members)
        notes += statistics.diagnostics(name, members)
    return means


def pressures_in_time(runs: list[Run]) -> dict[str, Curve]:
    """Return the mean pressure of the runs against time, from the virial and from the sides."""
    cuts = np.linspace(0, min(run.collisions_per_disk.time[-1] for run in runs), FINE + 1)

    def growth(*parts: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        lines = (np.interp(cuts, time, total) for time, total in parts)
        return sum(np.diff(line) / np.diff(cuts) for line in lines)

    def total(run: Run, name: str, scale: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        time, value = run.observable(name)
        return time, np.sum(value.reshape(len(time), -1) * scale, axis=1)

    def ideal(run: Run) -> tuple[np.ndarray, np.ndarray]:
        _, time, kt = equilibrium.kt_in_time(run)
        carried = run.n_disks / area * td.between(time, kt)[1]
        return time, np.append(0, np.cumsum(carried))

    area, length = np.prod(runs[0].edges), runs[0].edges[[1, 1, 0, 0]]
    ways = {"virial": [growth(ideal(run), total(run, "virial", 1 / (2 * area))) for run in runs]}
    if not runs[0].periodic.any():
        ways["sides"] = [growth(total(run, "side_impulse", 1 / (4 * length))) for run in runs]
    unit = scales(runs)[:, None]
    middle = (cuts[1:] + cuts[:-1]) / 2
    return {way: Curve(middle, *estimate(values * unit)) for way, values in ways.items()}


def free_paths(run: Run, skip: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return the lengths and the statistical weights of the free paths in all frames."""
    allow(run, "free paths require disks whose velocities change in collisions only", *STRAIGHT)
    log = run.event_log()
    disk = np.concatenate([log.i, log.j[log.j > 0]])
    time = np.concatenate([log.time, log.time[log.j > 0]])
    order = np.lexsort((time, disk))
    ends = np.cumsum(np.bincount(disk, minlength=run.n_disks + 1))
    duration = np.full((run.n_frames, run.n_disks), np.nan)
    for k in range(run.n_disks):
        own = time[order[ends[k] : ends[k + 1]]]
        after = np.searchsorted(own, run.time, side="right")
        inside = (after > 0) & (after < len(own))
        duration[inside, k] = own[after[inside]] - own[after[inside] - 1]
    duration[run.time < td.start_of_steady_state(run, skip)] = np.nan
    known = duration > 0
    return (run.speed(slice(None)) * duration)[known], 1 / duration[known]


def mean_and_density(
    runs: list[Run], skip: float | None = None
) -> tuple[Estimate, Estimate] | None:
    """Return the mean free path and the probability density of reduced free paths.

    The function returns None if the run has no event log.

    A reduced free path is the length of a free path divided by the mean free path.  Errors are
    determined from the scatter of the runs or, for a single run, from the scatter of blocks of
    frames.
    """
    parts = [free_paths(run, skip) for run in runs if td.has_log(run)]
    if not parts or sum(len(path) for path, _ in parts) == 0:
        return None
    path, weight = (np.concatenate(part) for part in zip(*parts, strict=True))
    mean = float(np.average(path, weights=weight))
    if len(parts) == 1:
        parts = list(zip(np.array_split(path, BLOCKS), np.array_split(weight, BLOCKS), strict=True))

    def density(path: np.ndarray, weight: np.ndarray) -> np.ndarray:
        counts, _ = np.histogram(path / mean, BINS, weights=weight)
        return counts / (np.sum(weight) * np.diff(BINS))

    known = [part for part in parts if len(part[0]) > 0]
    means = estimate([np.average(path, weights=weight) for path, weight in known])
    shapes = estimate([density(*part) for part in known])
    return Estimate(mean, means.error), Estimate(density(path, weight), shapes.error)


def draw_pressure(axes: plt.Axes, curves: dict[str, Curve], mean: SeriesMean, start: float) -> None:
    """Draw the pressure against time with its error, and the mean pressure in equilibrium."""
    x = curves["virial"].x
    end = x[-1] + x[0]
    for (way, curve), colour in zip(curves.items(), COLOURS, strict=False):
        band(axes, *curve, color=colour, label=way)
    label = f"virial in equilibrium, {mean.mean:.5g} ± {mean.error:.2g}"
    level = np.full(2, mean.mean)
    band(axes, np.array([start, end]), level, mean.error, color="black", lw=1, label=label)
    axes.axvspan(0, start, color="0.9", lw=0, zorder=0, label="left out")
    axes.set_xlim(0, end)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.4 * (high - low))  # space for the legend above the curves
    axes.legend(loc="upper right")


def draw_paths(axes: plt.Axes, paths: tuple[Estimate, Estimate], equal: bool) -> None:
    """Draw the measured distribution of free paths and the prediction for molecular chaos."""
    mean, height = paths
    label = f"measured, $\\ell$ = {' ± '.join(statistics.rounded_to_error(*mean))}"
    bars(axes, height, BINS, color=COLOURS[0], label=label)
    if equal:
        fine = np.linspace(0, BINS[-1], 200)
        axes.plot(fine, path_density(fine), color="black", lw=1.2, label="without memory")
    axes.set(xlabel="free path $/\\,\\ell$", ylabel="probability density", xlim=(0, 6))
    axes.set_yscale("log")
    axes.legend()


def table(runs: list[Run], start: float, means: dict, path: Estimate | None) -> list[dict]:
    """Return a table row for each quantity; quantities with an error are at the end."""
    begin = "equilibrium_from" if means else "from_time"
    exact = {"packing": td.packing(runs[0]), begin: start}
    momentum = np.mean([equilibrium.drift(run) * run.mass.sum() for run in runs], axis=0)
    axes = zip(("momentum_x", "momentum_y"), momentum, equilibrium.comoving(runs[0]), strict=True)
    exact |= {name: float(value) for name, value, kept in axes if kept}
    rows = [(name, value, "exact", "") for name, value in exact.items()]
    rows += [("mean_free_path", path.mean, float(path.error), "")] if path else []
    for name, one in means.items():
        known = (float(one.error), round(one.samples, 1)) if one.error != 0 else ("exact", "")
        rows.append((name, float(one.mean), *known))
    return [dict(zip(("quantity", "mean", "error", "samples"), row, strict=True)) for row in rows]


def main() -> None:
    args = command_line(__doc__, "rates.png", equilibration=None).parse_args()
    runs, notes = args.runs, []
    check(runs)
    settled = equilibrium.all_settle(runs)
    start = max(td.start_of_steady_state(run, args.equilibration) for run in runs)
    kicked = any("thermostatted" in run.nature for run in runs)
    paths = None if kicked else mean_and_density(runs, args.equilibration)
    means, curves = {}, {}
    count = settled + bool(paths)
    figure, panels = plt.subplots(1, count, squeeze=False, figsize=(2 + 4 * count, 4.5))
    if settled:
        means = over_all(runs, args.equilibration, notes)
        shown = pressures_in_time(runs)
        draw_pressure(panels[0, 0], shown, means["pressure_virial"], start)
        panels[0, 0].set(xlabel=args.units.label("time t", "time"))
        panels[0, 0].set(ylabel=args.units.label("pressure", "stress"))
        curves = {(f"pressure_{way}(t)",): curve for way, curve in shown.items()}
    if paths:
        draw_paths(panels[0, -1], paths, "mixture" not in runs[0].nature)
        curves["free_path_density",] = Curve((BINS[1:] + BINS[:-1]) / 2, *paths[1])
    figure.suptitle(f"{caption(runs)},  η = {td.packing(runs[0]):.4g}")
    rows = table(runs, start, means, paths and paths[0])
    data = [row | {"x": ""} for row in rows]
    for point in points(("quantity", "x", "mean", "error"), curves):
        data.append({**rows[0], **point, "samples": ""})
    report(args, figure, rows, data=data, notes=notes)


if __name__ == "__main__":
    launch(main)
