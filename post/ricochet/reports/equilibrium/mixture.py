"""Speeds and energies of each species of a mixture, initially and in equilibrium."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from ...analysis.estimates import binned, rounded_to_error
from ...analysis.speed_laws import speed_test
from ...analysis.speeds import kt_of_frames, means
from ...analysis.statistics import combine_runs, correlated_mean
from ...analysis.thermodynamics import kinds_of_disks, mean_energy
from ...figures.drawing import COLOURS, bars, caption, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...predictions.theory import maxwell_pdf
from ...reading.nature import SETTLED, Refused, allow
from ...reading.reader import Run, Species
from ..groups import Group
from ..options import late_frames, shared
from ..registry import Analysis
from ..result import Result
from ..tables import measured

BINS = 60  # bins of a histogram
NEEDED = "needs a mixture of at least three disks, the same in all runs; see speeds.py"


def pooled(runs: list[Run], frames: list[list[int]], name: str) -> np.ndarray:
    """Return the speeds of all disks of a species in the given frames of all runs."""
    each = zip(runs, frames, strict=True)
    return np.concatenate([run.speed(k)[run.of_species(name)] for run, own in each for k in own])


def table(
    runs: list[Run], frames: list[list[int]], skip: float | None = None
) -> list[dict[str, Any]]:
    """Return mean speed and energy of each species, initially and in equilibrium."""
    rows = []
    for kind in kinds_of_disks(runs[0]):
        name, mass = kind.name, kind.mass
        start = np.mean([np.ravel(means([run], [[0]], name)) for run in runs], axis=0)
        speed, energy = means(runs, frames, name)
        theory = combine_runs([mean_energy(run, mass, skip) for run in runs])
        expected = theory.mean
        test = speed_test(runs, frames, name)
        row = {"species": name, "mass": mass, "v_start": float(start[0])}
        row |= {"K_start": float(start[2]), **measured("v", speed)}
        row |= {"v_theory": float(np.sqrt(np.pi * expected / (2 * mass))), **measured("K", energy)}
        row |= measured("K_theory", theory)
        for k, axis in enumerate("xy"):
            both = zip(runs, frames, strict=True)
            tracks = [correlated_mean(kt_of_frames(run, own, name, k)) for run, own in both]
            row |= measured(f"kT_{axis}", combine_runs(tracks))
        row |= {
            "speeds": round(test.independent),
            "law": test.law,
            "KS_D": test.ks,
            "KS_p": test.ks_p,
        }
        rows.append(row)
    return rows


def speed_bins(start: np.ndarray, top: float) -> np.ndarray:
    """Return about 60 speed bins up to `top`; a common initial speed is at a bin centre."""
    speed, width = float(np.mean(start)), top / BINS
    if 0 < speed < top and np.ptp(start) < 1e-9 * speed:
        width = speed / max(1, round(speed / width))
    return np.maximum(0, (np.arange(int(top / width) + 3) - 0.5) * width)


def draw_start(axes: plt.Axes, result: Result, kind: Species, bins: np.ndarray) -> None:
    """Plot the initial speeds of a species."""
    row = row_of(result, kind)
    speeds = pooled(result.runs, [[0]] * len(result.runs), kind.name)
    draw_speeds(axes, result, kind, speeds, bins, len(speeds))
    axes.plot([], [], ls="", label="⟨v⟩ = {v_start:.4g},  ⟨K⟩ = {K_start:.4g}".format(**row))
    axes.set_title(f"{kind.name}, start")
    legend_above(axes)


def draw_late(axes: plt.Axes, result: Result, kind: Species, bins: np.ndarray) -> None:
    """Plot the speeds of a species in equilibrium with the Maxwell distribution."""
    row = row_of(result, kind)
    speeds = pooled(result.runs, result.values, kind.name)
    draw_speeds(axes, result, kind, speeds, bins, row["speeds"])
    thermal = np.sqrt(2 * row["K_theory"] / kind.mass)
    v = np.linspace(0, bins[-1], 301)
    label = f"Maxwell: KS D = {row['KS_D']:.4f}, p = {row['KS_p']:.2g}"
    axes.plot(v, maxwell_pdf(v / thermal) / thermal, color="black", lw=1.2, label=label, zorder=3)
    for x in ("v", "K"):
        mean = " ± ".join(rounded_to_error(row[x], row[f"{x}_error"]))
        axes.plot([], [], ls="", label=f"⟨{x}⟩ = {mean} (theory {row[f'{x}_theory']:.4g})")
    axes.set_title(f"{kind.name}, equilibrium")
    legend_above(axes)


def draw_speeds(
    axes: plt.Axes,
    result: Result,
    kind: Species,
    speeds: np.ndarray,
    bins: np.ndarray,
    independent: int,
) -> None:
    """Plot a histogram of speeds, with error bars for the number of independent speeds."""
    run = result.runs[0]
    colour = COLOURS[run.names.index(kind.name) % len(COLOURS)]
    counted = f"{len(speeds)} speeds" + f", {independent} independent" * (independent < len(speeds))
    style = {"color": colour, "label": f"{kind.label}: {counted}"}
    bars(axes, binned(speeds, bins, independent), bins, fill=True, alpha=0.45, **style)
    density = run.units.label("probability density $P(v)$", "1/speed")
    axes.set(ylabel=density, xlabel=run.units.label("speed v", "speed"))
    axes.set(xlim=(0, bins[-1]), ylim=(0, None))


def row_of(result: Result, kind: Species) -> dict[str, Any]:
    """Return the row of the table for a species."""
    return next(row for row in result.table if row["species"] == kind.name)


def draw(result: Result) -> Sheet:
    """Plot the speeds of each species initially and in equilibrium, in two panels."""
    runs, frames, rows = result.runs, result.values, []
    top = max(np.quantile(pooled(runs, frames, name), 0.9995) for name in runs[0].names)
    for kind in runs[0].by_species:
        bins = speed_bins(pooled(runs, [[0]] * len(runs), kind.name), top)
        start = Panel(f"{kind.name}_start", draw_start, (result, kind, bins), aspect=0.65)
        late = Panel(f"{kind.name}_equilibrium", draw_late, (result, kind, bins), aspect=0.65)
        rows.append([start, late])
    return Sheet(rows, caption(runs))


def check(run: Run) -> None:
    """Raise Refused unless the species of a mixture exchange energy."""
    if len(run.names) < 2 or run.n_disks < 3:
        raise Refused(f"{run.path}: {NEEDED}")
    allow(run, "its species do not reach a common temperature", *SETTLED)
    tracks = [run.observable(f"{name}/kinetic_energy").value for name in run.names]
    if not any(np.ptp(track) > 1e-9 * np.max(track) for track in tracks):
        raise Refused(
            f"{run.path}: its species have not collided with each other: each still "
            "has its initial energy"
        )


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Compare mean speeds and energies in equilibrium with theory."""
    (group,), warnings = groups, []
    for run in group.runs:
        if run.names != group.runs[0].names:
            raise Refused(f"{run.path}: {NEEDED}")
    frames = [late_frames(run, options, warnings) for run in group.runs]
    rows = table(group.runs, frames, options.equilibration)
    bars = "Bars: standard errors for the number of independent speeds."
    notes = [f"{bars} ± : standard error of the mean."]
    return Result(rows, notes=notes, warnings=warnings, values=frames)


ANALYSIS = Analysis(
    compute,
    draw,
    options=(shared("frames"), shared("equilibration"), shared("min_separation", 5.0)),
    accepts=check,
)
