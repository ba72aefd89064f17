"""Pressure, temperature, collision rates and free paths of a gas in equilibrium, with errors."""

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from ...analysis import equilibrium, statistics, thermodynamics as td
from ...analysis.estimates import Curve, Estimate, estimate
from ...analysis.statistics import FINE, SeriesMean
from ...figures.drawing import COLOURS, band, bars, caption, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...predictions.theory import path_density
from ...reading.nature import allow
from ...reading.reader import Run, RunError
from ..groups import Group
from ..options import shared
from ..registry import Analysis
from ..result import Result
from ..tables import points

BINS = np.linspace(0, 6, 49)  # free paths over their mean
BLOCKS = 8  # number of blocks of frames in a single run
#: Traits of runs with straight free flights that have the same distribution of lengths everywhere.
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


def check(run: Run) -> None:
    """Raise Refused if a run has obstacles, gravity or other forces."""
    allow(run, "rates are those of a gas without obstacles and gravity", *td.FLUID, *STRAIGHT)
    if not run.nature.in_equilibrium and not td.has_log(run):
        needs = "only free paths are defined for it, and they require output.event_log = .true."
        allow(run, needs, *td.FLUID)


def scales(runs: list[Run]) -> np.ndarray:
    """Return the factors that scale kT of each run to the mean kT."""
    kept = all(run.nature.keeps_kinetic_energy for run in runs)
    kts = np.array([td.kt_at_start(run) if kept else 1.0 for run in runs])
    return kts.mean() / kts


def over_all(runs: list[Run], skip: float | None, warnings: list[str]) -> dict[str, SeriesMean]:
    """Return all results with errors, scaling each run to the mean temperature of all runs."""
    kts = scales(runs)
    found = [td.rates(run, skip) for run in runs]
    means = {}
    for name in found[0]:
        power = 1.0 if name.startswith("pressure") else 0.5 * (name != "kT")
        members = [one[name].scaled(kt**power) for one, kt in zip(found, kts, strict=True)]
        means[name] = statistics.combine_runs(members)
        warnings += statistics.diagnostics(name, members)
    return means


def pressures_in_time(runs: list[Run]) -> dict[str, Curve]:
    """Return the mean pressure of the runs as a function of time, by virial and by sides."""
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
    """Return the mean free path and the density of free paths / mean, or None without event log.

    The errors are estimated from the scatter of the runs or, for one run, of blocks of frames.
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


class Found(NamedTuple):
    """Results of all runs."""

    start: float  # start of the equilibrium
    means: dict[str, SeriesMean]
    pressures: dict[str, Curve]  # as functions of time
    # mean free path, and probability density of free paths divided by their mean
    paths: tuple[Estimate, Estimate] | None


def draw_pressure(axes: plt.Axes, result: Result) -> None:
    """Plot the pressure as a function of time with its error, and its mean in equilibrium."""
    found, units = result.values, result.runs[0].units
    mean, x = found.means["pressure_virial"], found.pressures["virial"].x
    end = x[-1] + x[0]
    for (way, curve), colour in zip(found.pressures.items(), COLOURS, strict=False):
        band(axes, *curve, color=colour, label=way)
    label = f"virial in equilibrium, {mean.mean:.5g} ± {mean.error:.2g}"
    level, span = np.full(2, mean.mean), np.array([found.start, end])
    band(axes, span, level, mean.error, color="black", lw=1, label=label)
    axes.axvspan(0, found.start, color="0.9", lw=0, zorder=0, label="left out")
    axes.set(xlim=(0, end), xlabel=units.label("time t", "time"))
    axes.set_ylabel(units.label("pressure", "stress"))
    legend_above(axes)


def draw_paths(axes: plt.Axes, result: Result) -> None:
    """Plot the measured distribution of free paths and the prediction of molecular chaos."""
    mean, height = result.values.paths
    label = f"measured, $\\ell$ = {' ± '.join(statistics.rounded_to_error(*mean))}"
    bars(axes, height, BINS, color=COLOURS[0], label=label)
    if "mixture" not in result.runs[0].nature:
        fine = np.linspace(0, BINS[-1], 200)
        axes.plot(fine, path_density(fine), color="black", lw=1.2, label="without memory")
    axes.set(xlabel="free path $/\\,\\ell$", ylabel="probability density", xlim=(0, 6))
    axes.set_yscale("log")
    legend_above(axes)


def table(
    runs: list[Run], start: float, means: dict[str, SeriesMean], path: Estimate | None
) -> list[dict[str, Any]]:
    """Return a table row for each quantity, those with an error last."""
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


def draw(result: Result) -> Sheet:
    """Plot the pressure as a function of time, and the distribution of free paths."""
    row = [Panel("pressure", draw_pressure, (result,), aspect=0.7)] * bool(result.values.means)
    row += [Panel("free_paths", draw_paths, (result,), aspect=0.7)] * bool(result.values.paths)
    eta = ", ".join(sorted({f"{td.packing(run):.4g}" for run in result.runs}))
    return Sheet([row], f"{caption(result.runs)},  η = {eta}")


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return pressures, rates and free paths with their errors."""
    (runs,), warnings = [group.runs for group in groups], []
    for run in runs:
        if run.names != runs[0].names or run.n_disks != runs[0].n_disks:
            raise RunError(f"{run.path}: not the same system as {runs[0].path}")
    settled, skip = equilibrium.all_settle(runs), options.equilibration
    start = max(td.start_of_steady_state(run, skip) for run in runs)
    kicked = any("thermostatted" in run.nature for run in runs)
    paths = None if kicked else mean_and_density(runs, skip)
    means = over_all(runs, skip, warnings) if settled else {}
    if not means and not paths:
        raise RunError(f"{runs[0].path}: has no free paths from t = {start:.4g} on; run longer")
    pressures = pressures_in_time(runs) if settled else {}
    curves = {(f"pressure_{way}(t)",): curve for way, curve in pressures.items()}
    if paths:
        curves["free_path_density",] = Curve((BINS[1:] + BINS[:-1]) / 2, *paths[1])
    rows = table(runs, start, means, paths and paths[0])
    data = [row | {"x": ""} for row in rows]
    for point in points(("quantity", "x", "mean", "error"), curves):
        data.append({**rows[0], **point, "samples": ""})
    notes = ["Bands and bars: standard errors, from the scatter of runs or of blocks of frames."]
    values = Found(start, means, pressures, paths)
    return Result(rows, notes=notes, warnings=warnings, data=data, values=values)


ANALYSIS = Analysis(compute, draw, options=(shared("equilibration"),), accepts=check)
