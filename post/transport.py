"""Viscosities, heat conductivity and diffusion coefficient of a gas of disks, against Enskog's.

    python post/transport.py runs/driven/transport_*/*.h5 -o transport.png --csv transport.csv

Equal elastic disks in a periodic box.  Runs are combined by packing fraction; they take an event
log (output.event_log) with changes of momentum (output.virial_tensor), from which the Helfand
moments of momentum and energy follow exactly, and for D frames that are equally far apart in time.

Small panels: half of the slope of the mean square of a moment between neighbouring lags, over
Enskog's coefficient; bands are standard errors over the runs.  For D half the integral of
<v(0) v(s)> from 0 to t.  Right, and in the table: the means between half a lag and that lag, with
errors from the series of their values.  The lag is 20 mean free times, or an eighth of the run;
that of D is the time in which sound crosses the box, as in correlations.py.

Enskog's coefficients (Gass 1971) are those with the pair correlation at contact by Henderson.  The
theory takes the velocities of disks that meet for independent.  Unless the gas is dense that is
good to some per cent for viscosity and conductivity, not for D.  In two dimensions none of them has
a limit for late times in large boxes.  N disks that share a fixed energy have a conductivity that
is lower by about 6 / N of it, viscosities by less (docs/theory.md).
"""

from typing import NamedTuple

from ricochet import Run, RunError, hard_disks, helfand
from ricochet.diffusion import diffusion, diffusion_lag, integrated_memory, lags
from ricochet.drawing import band, caption, colours, plt
from ricochet.script import command_line, grouped, launch, measured, read_all, report
from ricochet.statistics import SeriesMean, combined, doubts, estimate
from ricochet.thermodynamics import mean_free_time, packing, start_of_equilibrium, temperature

import numpy as np

#: Of which Helfand moment a coefficient is the growth.
MOMENTS = {"viscosity": "shear", "bulk_viscosity": "bulk", "conductivity": "heat"}
LABELS = {
    "viscosity": "shear viscosity",
    "conductivity": "heat conductivity",
    "bulk_viscosity": "bulk viscosity",
    "D": "diffusion coefficient",
}


class Curve(NamedTuple):
    """(P,) each."""

    wt: np.ndarray
    y: np.ndarray  # over Enskog's value
    error: np.ndarray


class Found(NamedTuple):
    """A coefficient at one packing fraction, over Enskog's."""

    members: list[SeriesMean]  # of the runs
    curve: Curve  # against the lag
    lag: float  # at which they were taken [mean free times]


def enskog(eta: float, diameter: float = 1.0, kt: float = 1.0, mass: float = 1.0):
    """The coefficients by Enskog's theory, by name."""
    state = (hard_disks.henderson(eta), eta, diameter, kt, mass)
    density = mass * 4 * eta / (np.pi * diameter**2)
    return {
        "viscosity": density * hard_disks.enskog_viscosity(*state),
        "conductivity": hard_disks.enskog_conductivity(*state),
        "bulk_viscosity": density * hard_disks.enskog_bulk_viscosity(*state),
        "D": hard_disks.enskog_diffusion(*state),
    }


def enskog_of(run: Run) -> dict[str, float]:
    """The same of a run, in its units and at its temperature."""
    return enskog(packing(run), 2 * run.radius[0], temperature(run), run.mass[0])


def of_moments(runs: list[Run], starts: list[float]) -> dict[str, Found]:
    """Viscosities and conductivity."""
    moments = [helfand.moments(run, start) for run, start in zip(runs, starts, strict=True)]
    eighth = min(len(one.heat) for one in moments) // 8
    lag = min(round(helfand.MEMORY * helfand.PER_FREE_TIME), eighth)
    if lag < helfand.PER_FREE_TIME:
        raise RunError(f"{runs[0].path}: needs more than eight collisions per disk in equilibrium")
    at = lags(4 * lag)  # up to twice the lag
    middle = (at + np.append(0, at[:-1])) / 2 / helfand.PER_FREE_TIME
    found = {}
    for name, which in MOMENTS.items():
        units = [helfand.units(run)[which] / enskog_of(run)[name] for run in runs]
        sets = [(getattr(one, which), one.step) for one in moments]
        members = [
            helfand.coefficient(*one, lag).scaled(unit)
            for one, unit in zip(sets, units, strict=True)
        ]
        slopes = [helfand.running(*one, at) * unit for one, unit in zip(sets, units, strict=True)]
        grown = lag / helfand.PER_FREE_TIME
        found[name] = Found(members, Curve(middle, *estimate(slopes)), grown)
    return found


def in_step(run: Run, start: float) -> slice:
    """Frames in equilibrium that are equally far apart, as all but the last must be."""
    frames = slice(int(np.searchsorted(run.time, start)), run.frames - 1)
    apart = np.diff(run.time[frames])
    if len(apart) < 16 or np.ptp(apart) > 1e-6 * apart[0]:
        raise RunError(
            f"{run.path}: D takes 17 frames and more in equilibrium, equally far apart; set "
            "output.frames_every_time"
        )
    return frames


def of_displacements(runs: list[Run], starts: list[float]) -> Found:
    """The diffusion coefficient."""
    frames = [in_step(run, start) for run, start in zip(runs, starts, strict=True)]
    lag = diffusion_lag(runs, frames)
    at, pairs = lags(4 * lag), list(zip(runs, frames, strict=True))
    units = [1 / enskog_of(run)["D"] for run in runs]
    members = [diffusion(*one, lag)[1].scaled(unit) for one, unit in zip(pairs, units, strict=True)]
    slopes = [integrated_memory(*one, at) * unit for one, unit in zip(pairs, units, strict=True)]
    step = np.mean([(run.time[1] - run.time[0]) / mean_free_time(run) for run in runs])
    return Found(members, Curve(at * step, *estimate(slopes)), lag * step)


def analysed(runs: list[Run], skip: float | None) -> dict[str, Found]:
    """All coefficients at one packing fraction."""
    for run in runs:
        helfand.check(run)
    starts = [start_of_equilibrium(run, skip) for run in runs]
    return of_moments(runs, starts) | {"D": of_displacements(runs, starts)}


def table(results: list[tuple[float, dict[str, Found]]]) -> list[dict]:
    """A row per packing fraction and coefficient, in units of m, the diameter and kT."""
    rows = []
    for eta, found in results:
        for name, theory in enskog(eta).items():
            ratio = combined(found[name].members)
            row = {"packing": eta, "runs": len(found[name].members), "what": name}
            row |= measured("value", ratio.scaled(theory)) | {"enskog": float(theory)}
            rows.append(row | measured("ratio", ratio))
    return rows


def draw(results: list[tuple[float, dict[str, Found]]], rows: list[dict]) -> plt.Figure:
    """All coefficients over Enskog's, against the lag and against packing."""
    layout = [["viscosity", "conductivity", "all"], ["bulk_viscosity", "D", "all"]]
    figure, panels = plt.subplot_mosaic(layout, figsize=(13, 7), width_ratios=(1, 1, 1.3))
    for (eta, found), colour in zip(results, colours(len(results)), strict=True):
        line = {"color": colour, "lw": 1, "marker": ".", "ms": 3, "label": f"η = {eta:.3g}"}
        for name, one in found.items():
            band(panels[name], *one.curve, **line)
    for (name, label), marker in zip(LABELS.items(), "osv^", strict=True):
        panels[name].set(
            xlim=(0.03, 100),
            xscale="log",
            xlabel="$w\\,t$",
            ylabel=f"{label} / Enskog's",
            ylim=(0, 1.6),
        )
        own = [row for row in rows if row["what"] == name]
        points = ([row[key] for row in own] for key in ("packing", "ratio", "ratio_error"))
        panels["all"].errorbar(*points, marker=marker, ms=4, lw=1, label=label)
    panels["all"].set(xlabel="packing fraction η", ylabel="over Enskog's")
    for name in ("viscosity", "all"):
        panels[name].legend()
    for axes in panels.values():
        axes.axhline(1, color="black", ls="--", lw=1, zorder=0)
    return figure


def data(results: list[tuple[float, dict[str, Found]]], rows: list[dict]) -> list[dict]:
    """What has an error, over Enskog's, then all curves, one below the other."""
    return [
        {
            "what": row["what"],
            "packing": row["packing"],
            "wt": None,
            "ratio": row["ratio"],
            "error": row["ratio_error"],
        }
        for row in rows
    ] + [
        {"what": f"{name}(t)", "packing": eta, "wt": wt, "ratio": y, "error": error}
        for eta, found in results
        for name, one in found.items()
        for wt, y, error in zip(*(part.tolist() for part in one.curve), strict=True)
    ]


def main() -> None:
    args = command_line(__doc__, "transport.png", skip=None).parse_args()
    runs = read_all(args.runs)
    groups = grouped(runs, lambda run: round(packing(run), 6))
    results = [(eta, analysed(members, args.skip)) for eta, members in groups]
    rows = table(results)
    notes = [
        f"η = {eta:g}, {name}: taken at {one.lag:.1f} mean free times, before it has settled; "
        f"longer runs let it reach {helfand.MEMORY:g}"
        for eta, found in results
        for name, one in found.items()
        if one.lag < helfand.MEMORY / 4
    ] + [
        note
        for eta, found in results
        for name, one in found.items()
        for note in doubts(f"η = {eta:g}, {name}", one.members)
    ]
    figure = draw(results, rows)
    figure.suptitle(caption(runs), fontsize=10)
    title = "Transport in a gas of hard disks"
    report(args, runs, title, figure, rows, data=data(results, rows), notes=notes)


if __name__ == "__main__":
    launch(main)
