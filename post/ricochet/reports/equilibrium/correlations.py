"""Time correlations, diffusion coefficient and structure functions of a fluid."""

from itertools import combinations_with_replacement, cycle
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from matplotlib.ticker import LogLocator

from ...analysis import transport
from ...analysis.correlations import correlators, curves as curves_of
from ...analysis.equilibrium import all_settle, later, motion_notes
from ...analysis.estimates import Curve, Estimate, estimate
from ...analysis.speeds import relaxation
from ...analysis.statistics import SeriesMean, combine_runs, correlated_mean
from ...analysis.structure import (
    averaged,
    bond_correlation,
    bond_order,
    evenly,
    pair_correlation,
    structure_factor,
)
from ...analysis.thermodynamics import FLUID, kt_at_start, mean_free_time, packing
from ...figures.drawing import COLOURS, band, caption, dilute_limit, noise_band, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...predictions import hard_disks, mixtures
from ...predictions.theory import RELAXATION
from ...reading.nature import Refused, allow
from ...reading.reader import Run, RunError
from ..groups import Group, by_packing
from ..options import shared
from ..registry import Analysis
from ..result import Result
from ..tables import measured, over_runs, points

PLAIN = {"walls"}  # the only trait with which Enskog's D applies
#: Traits of runs without equilibrium whose structure functions can nevertheless be calculated.
RESTLESS = (
    "inelastic",
    "soft_contacts",
    "pair_restitution",
    "unequal_temperatures",
    "noise_driven",
    "random_walk",
    "active",
    "sliding_surfaces",
)
FINE, COARSE = 0.01, 0.035  # widths of distance bins [mean diameters]
NEAR = 1.6  # distance up to which bins are narrow [mean diameters]
DIFFUSION, ORDERS = ("D_displacement", "D_velocities"), ("psi6_local", "psi6_global")
UNLIKE = 0.05  # largest relative difference of masses and radii of a species between combined runs


class Found(NamedTuple):
    """Results of all runs at one packing fraction: numbers with errors, and named curves."""

    members: dict[str, list[SeriesMean]]
    curves: dict[str, Curve]
    lag: float | None  # lag at which D is measured [mean free times], or None
    unit: float | None  # w sigma^2, the unit of D(t) if Enskog's D does not apply, or None


def check(run: Run) -> None:
    """Raise an error if a run is inhomogeneous or too small."""
    allow(run, "correlations are those of disks without obstacles and gravity", *FLUID, *RESTLESS)
    if run.n_disks < 3:
        raise Refused(f"{run.path}: needs at least three disks")
    if run.n_frames < 10:
        raise RunError(f"{run.path}: needs at least 10 frames")


def check_alike(runs: list[Run]) -> None:
    """Raise RunError if runs that are to be combined have different species."""
    kinds = [run.by_species for run in runs]
    for run, own in zip(runs, kinds, strict=True):
        same = [(k.name, k.disks.sum()) for k in own] == [(k.name, k.disks.sum()) for k in kinds[0]]
        if not same or not np.allclose(
            *([(k.mass, k.radius) for k in each] for each in (own, kinds[0])), rtol=UNLIKE, atol=0
        ):
            raise RunError(
                f"{run.path}: its disks are not those of {runs[0].path}, which has the same "
                "packing fraction; analyse them separately"
            )


def bins(run: Run) -> dict[str, np.ndarray]:
    """Return the bins of distance and wavenumber, in units based on the mean diameter."""
    half = 0.5 * run.edges.min() / (2 * run.radius.mean())
    least = float(run.radius.min() / run.radius.mean())
    found = {
        "g": distances(least, max(1.1, min(6.0, 0.9 * half))),
        "g6": np.geomspace(1, max(1.1, half), 41),
    }
    return found | ({"S": np.linspace(0, 20, 101)} if run.periodic.all() else {})


def distances(least: float, most: float) -> np.ndarray:
    """Return the edges of distance bins, which are narrow up to NEAR, where g(r) is steep."""
    near = np.arange(least, min(NEAR, most), FINE)
    return np.append(
        near, np.linspace(near[-1] + FINE, most, 1 + round(max(0, most - NEAR) / COARSE))
    )


def structure(runs: list[Run], frames: list[slice]) -> tuple[dict, dict[str, Curve]]:
    """Return psi6 of each run, and structure functions of all disks and of pairs of species."""
    some = [evenly(run, own) for run, own in zip(runs, frames, strict=True)]
    psi = {(id(r), k): bond_order(r, k) for r, own in zip(runs, some, strict=True) for k in own}
    each = [[psi[id(run), k] for k in own] for run, own in zip(runs, some, strict=True)]
    members = {
        "psi6_local": [correlated_mean([np.abs(one).mean() for one in own]) for own in each],
        "psi6_global": [correlated_mean([abs(one.mean()) for one in own]) for own in each],
    }

    def g6(run: Run, own: list[int], edges: np.ndarray) -> np.ndarray:
        return bond_correlation(run, own, [psi[id(run), k] for k in own], edges)

    edges = bins(runs[0])
    curves = {"g6": averaged(g6, runs, some, edges["g6"])}
    pairs = list(combinations_with_replacement(species(runs[0]), 2))
    for name, of in (("g", pair_correlation), ("S", structure_factor)):
        for pair in (None, *pairs) if name in edges else ():
            shown = "_".join((name, *(pair or ())))
            curves[shown] = averaged(of, runs, some, edges[name], pair)
    return members, curves


def species(run: Run) -> tuple[str, ...]:
    """Return the names of the species if a run is a mixture, otherwise none."""
    return run.names if "mixture" in run.nature else ()


def free_time(runs: list[Run], frames: list[slice]) -> float:
    """Return the mean free time, averaged over the given frames."""
    each = zip(runs, frames, strict=True)
    return float(np.mean([mean_free_time(run, run.time[own.start]) for run, own in each]))


def motion(runs: list[Run], frames: list[slice], skip: float | None, wave: float) -> dict:
    """Return the time correlations of all disks and of each species as functions of w t."""
    first, diameter = runs[0], 2 * runs[0].radius.mean()
    members = correlators(runs, [wave / diameter], skip=skip)
    found, unit, curves = curves_of(members), free_time(runs, frames), {}
    names = {"all": ""} | {one: f"_{one}" for one in species(first)}
    for one, end in names.items():
        for name, (lag, mean, error) in found[one].items():
            scale = 1 / mean[0] if name == "vacf" else diameter**-2 if name == "msd" else 1.0
            shown = name.partition("(")[0].replace("diffusion", "D_velocities(t)") + end
            if name != "diffusion" or first.periodic.all():
                curves[shown] = Curve(lag[1:] / unit, scale * mean[1:], scale * error[1:])
    time = found["all"]["msd"].x
    wt, some = time[1:] / unit, np.isin(members[0].lags, time)
    if first.nature <= PLAIN:
        density, theory = first.n_disks / np.prod(first.edges), transport.enskog_of(first)
        kinematic = theory["viscosity"] / (density * first.mass[0])
        tail = hard_disks.long_time_tail(time[1:], density, theory["D"], kinematic)
        curves["vacf_tail"] = Curve(wt, tail, np.full_like(tail, np.nan))
    if first.periodic.all():
        slope = np.diff([one.means("msd")[some] for one in members]) / np.diff(time)
        middle = (time[1:] + time[:-1]) / (2 * unit)
        curves["D_displacement(t)"] = Curve(middle, *estimate(slope / 4))
    return curves


def kurtosis(runs: list[Run], until: int) -> Curve:
    """Return a2 in the first frames as a function of collisions per disk."""
    tau, a2 = zip(*(relaxation(run, frames=until) for run in runs), strict=True)
    return Curve(np.mean(tau, axis=0), *estimate(a2))


def analysed(runs: list[Run], skip: float | None, wave: float = 2 * np.pi) -> Found:
    """Return all results for the runs at one packing fraction."""
    frames = [later(run, skip) for run in runs]
    pairs, settled = list(zip(runs, frames, strict=True)), all_settle(runs)
    try:
        curves = motion(runs, frames, skip, wave)
    except Refused:
        curves = {}
    until = max(own.start for own in frames) + 1 if settled else min(run.n_frames for run in runs)
    curves["a2"] = kurtosis(runs, until)
    members, lag = {}, None
    if (
        settled
        and runs[0].periodic.all()
        and all(transport.in_step(run.time[own]) for run, own in pairs)
    ):
        steps, names = transport.diffusion_lag(runs, frames), species(runs[0])
        each = [transport.diffusion(*one, steps, *names) for one in pairs]
        ways = DIFFUSION[: 1 if "thermostatted" in runs[0].nature else 2]
        for k, end in enumerate(["", *(f"_{name}" for name in names)]):
            own = zip(*(found[k] for found in each), strict=True)
            members |= {way + end: list(one) for way, one in zip(ways, own, strict=False)}
        apart = runs[0].time[frames[0].start + 1] - runs[0].time[frames[0].start]
        lag = steps * float(apart / free_time(runs, frames))
    orders, shown = structure(runs, frames)
    moved = "D_displacement(t)" in curves
    unit = (2 * runs[0].radius.mean()) ** 2 / free_time(runs, frames) if moved else None
    return Found(members | orders, curves | shown, lag, unit)


def enskog(run: Run) -> dict[str, float]:
    """Return Enskog's D of equal disks, or of each species of a mixture; {} if D is unknown."""
    if run.nature <= PLAIN:
        return {"D_enskog": float(transport.enskog_of(run)["D"])}
    if not run.nature <= {*PLAIN, "mixture"} or not all(kind.alike for kind in run.by_species):
        return {}
    own = [(kind.disks.sum(), 2 * kind.radius, kind.mass) for kind in run.by_species]
    count, diameter, mass = np.array(own, dtype=float).T
    density, kt = count / np.prod(run.edges), kt_at_start(run)
    found = mixtures.self_diffusion(
        float(hard_disks.henderson(packing(run))), density, diameter, mass, kt
    )
    return {f"D_enskog_{name}": float(d) for name, d in zip(run.names, found, strict=True)}


def table(groups: list[Group]) -> tuple[list[dict[str, Any]], list[str]]:
    """Return a table row for each packing fraction, and warnings about its numbers."""
    rows, warnings = [], []
    kinds = dict.fromkeys(name for group in groups for name in species(group.runs[0]))
    ends = ["", *(f"_{name}" for name in kinds)]
    for group in groups:
        run, found, theory = group.runs[0], group.values, enskog(group.runs[0])
        row = {"packing": group.key, "runs": len(group.runs), "D_time": found.lag}
        for name in (*(way + end for end in ends for way in DIFFUSION), *ORDERS):
            if name in found.members:
                about = f"η = {group.key:g}, {name}"
                row |= over_runs(name, found.members[name], warnings, about)
            else:
                row |= measured(name, None)
        row |= {name: theory.get(name) for name in (f"D_enskog{end}" for end in ends)}
        alike = "mixture" not in run.nature  # a mixture has no first bin
        first = Estimate(*found.curves["g"][1:]) if alike else None
        rows.append(row | measured("g_first_bin", first, 0))
    return rows, warnings


def missing(group: Group) -> list[str]:
    """Return a note that explains which diffusion coefficients are not in the table, if any."""
    run, reasons = group.runs[0], []
    names = ", ".join(name for name in DIFFUSION if name not in group.values.members)
    if not run.nature.in_equilibrium:
        reasons.append(f"{names} (calculated only in equilibrium)")
    elif not run.periodic.all():
        reasons.append(f"{names} (calculated only in a periodic box)")
    elif names and "thermostatted" in run.nature and "D_displacement" not in names:
        reasons.append(f"{names} (a heat bath changes velocities between frames)")
    elif names:
        reasons.append(f"{names} (calculated only from equally spaced frames)")
    if not enskog(run):
        reasons.append("D_enskog (known only for undriven smooth elastic disks)")
    return [f"η = {group.key:.3g}: no {', no '.join(reasons)}."] if reasons else []


def curves(groups: list[Group]) -> list[dict[str, Any]]:
    """Return a table of the numbers with errors, followed by all points of the curves."""
    names, rows = ("what", "packing", "x", "y", "error"), []
    for group in groups:
        found = group.values
        for what, members in found.members.items():
            mean, error, *_ = combine_runs(members)
            x = found.lag if what.startswith("D_") else None
            rows.append(dict(zip(names, (what, group.key, x, mean, error), strict=True)))
        rows += points(names, {(what, group.key): one for what, one in found.curves.items()})
    return rows


# --- figure ---

AXES = {
    "vacf": {"ylabel": "velocity autocorrelation", "xscale": "log"},
    "tail": {"ylabel": "velocity autocorrelation", "xscale": "log", "yscale": "log"},
    "msd": {
        "ylabel": "$\\langle \\Delta r^2 \\rangle\\,/\\,\\sigma^2$",
        "xscale": "log",
        "yscale": "log",
    },
    "D": {"ylabel": "$D(t)\\,/\\,D_E$", "xscale": "log"},
    "F_s": {"ylabel": "$F_s(k,t)$", "xscale": "log"},
    "alpha2": {"ylabel": "$\\alpha_2$ of displacements", "xscale": "log"},
    "a2": {"xlabel": "collisions per disk", "ylabel": "$a_2$ of velocities"},
    "g": {"xlabel": "$r\\,/\\,\\sigma$", "ylabel": "$g(r)$"},
    "S": {"xlabel": "$k\\,\\sigma$", "ylabel": "$S(k)$"},
    "g6": {"xlabel": "$r\\,/\\,\\sigma$", "ylabel": "$g_6(r)$", "xscale": "log", "yscale": "log"},
}
PALE = 0.3  # opacity of parts without an error
LINES = ("-", "--", ":", "-.")  # line styles of all disks, and of species

LEVELS = {"vacf": 0, "F_s": 0, "alpha2": 0, "a2": 0, "g": 1, "S": 1}  # horizontal lines


def parts(shown: dict[str, Curve], panel: str) -> dict[str, Curve]:
    """Return the curves of a panel by species or pair of species, with "" for all disks."""
    names = [one for one in shown if one == panel or one.startswith(f"{panel}_")]
    return {one[len(panel) + 1 :]: shown[one] for one in names if one != "vacf_tail"}


def in_time(axes: plt.Axes, curve: Curve, label: str | None = None, **style: Any) -> None:
    """Plot a function of time with its error band; parts without an error are pale."""
    axes.plot(*curve[:2], **style, alpha=PALE)
    known = np.isfinite(curve.error)
    band(axes, *(np.where(known, part, np.nan) for part in curve), label=label, **style)


def positive(curve: Curve) -> Curve:
    """Return the part of a curve that a logarithmic axis can show."""
    return Curve(*(part[curve.y > 0] for part in curve))


def draw_parts(axes: plt.Axes, group: Group, panel: str, keyed: str) -> None:
    """Plot the curves of all disks and of species or pairs of species.

    They are named in the legend if `keyed` is not empty, and distinguished by colour if it is
    "colours".
    """
    own = parts(group.values.curves, panel)
    shades = ["black", *COLOURS] if keyed == "colours" and len(own) > 1 else [group.colour]
    for (of, curve), dash, shade in zip(own.items(), cycle(LINES), cycle(shades)):
        named = of.replace("_", ", ") if of else "all" if len(own) > 1 else None
        style = {"color": shade, "ls": dash, "lw": 1, "label": named if keyed else None}
        if panel in ("g", "S"):
            band(axes, *curve, **style)
        else:
            in_time(axes, curve, marker=".", **style)


def draw_tail(axes: plt.Axes, group: Group) -> None:
    """Plot the velocity autocorrelation with its long-time tail on logarithmic axes."""
    shown, line = group.values.curves, {"color": group.colour, "lw": 1}
    if "vacf" in shown:
        in_time(axes, positive(shown["vacf"]), marker=".", **line)
    if "vacf_tail" in shown:
        wt, tail, _ = shown["vacf_tail"]
        axes.plot(wt[wt > 3], tail[wt > 3], ls="--", **line)


def draw_diffusion(axes: plt.Axes, group: Group, row: dict[str, Any]) -> None:
    """Plot both diffusion coefficients, divided by Enskog's value if his theory applies."""
    found = group.values
    unit = row["D_enskog"] or found.unit
    for name, marker in (("D_displacement(t)", "."), ("D_velocities(t)", "x")):
        if name in found.curves:
            x, y, error = found.curves[name]
            style = {"marker": marker, "ms": 4, "color": group.colour, "lw": 1}
            in_time(axes, Curve(x, y / unit, error / unit), **style)


def draw_panel(axes: plt.Axes, result: Result, name: str) -> None:
    """Plot a function for all groups."""
    groups = result.groups
    keyed = "colours" if len(groups) == 1 else "dashes"
    for group, row in zip(groups, result.table, strict=True):
        if name == "tail":
            draw_tail(axes, group)
        elif name == "D":
            draw_diffusion(axes, group, row)
        elif name == "a2":
            band(axes, *group.values.curves["a2"], color=group.colour, lw=1)
            noise_band(axes, sum(run.n_disks for run in group.runs), group.colour)
        elif name == "g6":
            style = {"marker": ".", "color": group.colour, "lw": 1}
            band(axes, *positive(group.values.curves["g6"]), **style)
        else:
            draw_parts(axes, group, name, keyed if group is groups[0] else "")
    axes.set(**{"xlabel": "$w\\,t$", **AXES[name]})
    if name in LEVELS:
        axes.axhline(LEVELS[name], color="0.6", lw=0.8, zorder=0)
    add_theory(axes, result, name)
    if name == "g6":
        axes.set_ylim(1e-5, 1.5)
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter("")
    if name in ("vacf", "g") and len(groups) > 1:
        for group in groups:
            axes.plot([], [], color=group.colour, label=f"η = {group.key:.3g}")
    if axes.get_legend_handles_labels()[0]:
        legend_above(axes)


def add_theory(axes: plt.Axes, result: Result, name: str) -> None:
    """Add predictions and limits to a panel."""
    groups, known = result.groups, result.groups[0].runs[0].nature <= PLAIN
    if name == "vacf" and known:
        wt = np.geomspace(min(group.values.curves["vacf"].x[0] for group in groups), 5, 200)
        axes.plot(wt, np.exp(-wt), color="black", ls="--", lw=1, label="$\\exp(-wt)$")
    elif name == "tail":
        if known:
            axes.plot([], [], color="black", ls="--", lw=1, label="mode coupling, $1/t$")
        axes.set_ylim(1e-4, 1.2)
    elif name == "F_s":
        axes.set_title(f"$k\\sigma$ = {result.options.wavenumber:.3g}")
    elif name == "g":
        axes.set_ylim(0, None)
    elif name == "D":
        axes.axhline(1 if known else 0, color="0.6", lw=0.8, zorder=0)
        axes.set_ylim(0, 1.1 * axes.dataLim.y1)
        if not known:
            axes.set_ylabel("$D(t)\\,/\\,(w\\,\\sigma^2)$")
        axes.plot([], [], color="black", marker=".", label="displacements")
        if any("D_velocities(t)" in group.values.curves for group in groups):
            axes.plot([], [], color="black", marker="x", label="velocities")
    elif name == "a2" and known and min(g.values.curves["a2"].y[0] for g in groups) < -0.4:
        dilute_limit(axes, RELAXATION)


def told(group: Group, row: dict[str, Any]) -> str:
    """Return diffusion coefficients and bond order as text."""
    text = f"η = {group.key:.3g}:"
    for name in ("", *species(group.runs[0])):
        key = f"D_displacement_{name}" if name else "D_displacement"
        if mean := row[key]:
            error = row[f"{key}_error"]
            text += f" D{f' of {name}' if name else ''} = {mean:.4g} ± {error:.2g},"
    return f"{text} ψ₆ {row['psi6_local']:.2f} of a disk, {row['psi6_global']:.2f} of all."


def draw(result: Result) -> Sheet:
    """Plot all available time correlations and structure functions."""
    there = set().union(*(group.values.curves for group in result.groups))
    if max(len(group.values.curves["a2"].x) for group in result.groups) < 2:
        there.remove("a2")  # the runs start in equilibrium
    of = {"tail": "vacf", "D": "D_displacement(t)"}
    names = [name for name in AXES if of.get(name, name) in there]
    rows = []
    for own in np.array_split(names, -(-len(names) // 3)):
        aspect = 0.3 * len(own)
        rows.append([Panel(str(name), draw_panel, (result, str(name)), aspect) for name in own])
    return Sheet(rows, caption(result.runs))


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return time correlations, diffusion coefficients and structure functions."""
    runs = [run for group in groups for run in group.runs]
    for run in runs:
        if ("mixture" in run.nature) != ("mixture" in runs[0].nature):
            raise RunError(f"{run.path}: not equal disks, or not a mixture, as {runs[0].path} is")
    for group in groups:
        check_alike(group.runs)
        group.values = analysed(group.runs, options.equilibration, options.wavenumber)
    rows, warnings = table(groups)
    warnings += motion_notes(runs)
    if not all("vacf" in group.values.curves for group in groups):
        warnings.append(
            "no steady state without flow: time correlations and diffusion coefficients are omitted"
        )
    notes = [told(*one) for one in zip(groups, rows, strict=True)]
    notes += [text for group in groups for text in missing(group)]
    notes.append("Bands: standard errors; pale parts have no error. w: collision rate.")
    return Result(rows, notes=notes, warnings=warnings, data=curves(groups))


ANALYSIS = Analysis(
    compute,
    draw,
    options=(shared("equilibration"), shared("wavenumber", 2 * np.pi)),
    accepts=check,
    group_by=by_packing,
)
