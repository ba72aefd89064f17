"""Time correlations, diffusion coefficient and structure functions of a fluid.

    python post/correlations.py runs/state/memory_*.h5 -o correlations.png --csv correlations.csv

The script accepts runs without obstacles and without gravity.  Runs of equal packing fraction are
combined; lines show means over the runs, and bands show errors.  Pale parts of lines have no error:
a single run has errors up to an eighth of its duration.  The frames may be spaced equally
or logarithmically in time (use --equilibration 0 if the run begins in equilibrium).  The unit of
time is the mean free time 1/w, and the unit of length is the mean diameter.  Equilibrium begins
after the first X collisions per disk, where X is the value of --equilibration, or by default when
no observable drifts any longer.  Frames before equilibrium are used only for the second Sonine
coefficient a2. If the gas cools or flows, the script computes only the second Sonine coefficient a2
and the structure functions.  The structure functions are averaged over the frames after the first X
collisions per disk, where X is the value of --equilibration.  Without --equilibration, the
structure functions are averaged over the frames in which no observable drifts or, if the gas cools,
over the frames later than 15 collisions per disk.  For mixtures, solid lines show the results for
all disks, and dashed or dotted lines the results for single species.

The time correlations are calculated by the module `ricochet.correlations`, whose docstring explains
how pairs of frames are chosen.  The time correlations are the velocity autocorrelation <v(0) v(t)>,
the mean square displacement, the self-intermediate scattering function, and the non-Gaussian
parameter.  The self-intermediate scattering function is F_s(k, t) = <exp(i k r)>, where the
wavenumber k is the value of --wavenumber.  The non-Gaussian parameter is alpha2 = <r^4> / (2
<r^2>^2) - 1. In theory the velocity autocorrelation decays as exp(-w t) at short times, and as 1/t
at long times (mode coupling).  The table also contains the overlap, which is the fraction of the
disks within 0.3 diameters of their first position.

There are two definitions of the diffusion coefficient D(t).  By the first definition, the diffusion
coefficient D is a quarter of the slope of the mean square displacement between neighbouring lags.
By the second definition, the diffusion coefficient D is half of the integral of <v(0) v(s)> from s
= 0 to t.  The integral of <v(0) v(s)> is computed as <v(0) (x(t) - x(0))>, which is exact for any
spacing of frames.  For driven disks, whose velocities change between collisions, only the
definition by the mean square displacement applies.  Enskog's coefficient D_E is shown for equal
smooth disks of fixed energy.  In two dimensions D(t) grows as the logarithm of t without limit,
because of the long-time tail.  Therefore a value of the diffusion coefficient D applies only to one
time and to one size of the box; after the time in which sound crosses the box, D depends on the
size of the box.  The table contains D from the mean square displacement and D from the velocity
autocorrelation, both averaged over the lags from `D_time` / 2 to `D_time`; the two values must
agree.  `D_time` is the time in which sound crosses the box, but at most an eighth of the duration
of the run.  D is calculated only for a periodic box and equally spaced frames.

The second Sonine coefficient is a2 = <v^4> / (2 <v^2>^2) - 1, where the speeds v of each species
are divided by the thermal speed of the species.  The coefficient a2 is 0 in equilibrium, and -1/2
if all speeds are equal. The structure factor is S(k) = <|sum of exp(i k x)|^2> / N.  The
bond-orientational order parameter psi6 of a disk is the mean of exp(6 i theta) over its Delaunay
neighbours.  In the table, `local` is the mean modulus of psi6, and `global` is the modulus of the
mean of psi6; `global` is 1 in a perfect triangular crystal. The correlation function g6(r) =
<psi6*(0) psi6(r)> decays exponentially in a fluid and as a power of r in a hexatic phase, and does
not decay in a crystal.
"""

from itertools import combinations_with_replacement, cycle
from typing import Any, NamedTuple

from ricochet import Run, RunError, hard_disks, transport
from ricochet.analysis.correlations import correlators, curves as curves_of
from ricochet.analysis.speeds import relaxation
from ricochet.analysis.statistics import (
    Curve,
    Estimate,
    SeriesMean,
    combine_runs,
    estimate,
    correlated_mean,
)
from ricochet.analysis.structure import (
    averaged,
    bond_correlation,
    bond_order,
    evenly,
    pair_correlation,
    structure_factor,
)
from ricochet.analysis.equilibrium import all_settle, later, motion_notes
from ricochet.analysis.thermodynamics import FLUID, mean_free_time
from ricochet.figures.drawing import (
    COLOURS,
    band,
    caption,
    colours,
    dilute_limit,
    noise_band,
    plt,
)
from ricochet.predictions.theory import RELAXATION
from ricochet.reading.nature import Refused, allow
from ricochet.script import by_packing, command_line, launch, measured, over_runs, points, report

import numpy as np
from matplotlib.ticker import LogLocator

PLAIN = {"walls"}  # the only special property allowed for Enskog's D
#: Traits of a run that exclude equilibrium, but not the calculation of structure functions.
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
FINE, COARSE = 0.01, 0.035  # widths of bins of distance, in mean diameters
NEAR = 1.6  # distance up to which bins are narrow
NUMBERS = ("D_displacement", "D_velocities", "psi6_local", "psi6_global")


class Found(NamedTuple):
    """Results of all runs at one packing fraction: numbers with errors, and named curves."""

    members: dict[str, list[SeriesMean]]
    curves: dict[str, Curve]
    lag: float | None  # lag of the diffusion coefficients [mean free times], or None
    unit: float | None  # w sigma^2, in which D(t) is drawn if Enskog's D does not apply, or None


def check(run: Run, first: Run) -> None:
    """Raise an error if the system of a run is not homogeneous."""
    allow(run, "correlations are those of disks without obstacles and gravity", *FLUID, *RESTLESS)
    if run.n_disks < 3:
        raise Refused(f"{run.path}: needs at least three disks")
    if ("mixture" in run.nature) != ("mixture" in first.nature):
        raise RunError(f"{run.path}: not equal disks, or not a mixture, as {first.path} is")
    if run.n_frames < 10:
        raise RunError(f"{run.path}: needs at least 10 frames")


def bins(run: Run) -> dict[str, np.ndarray]:
    """Return the bins of distance and wavenumber; the unit of length is the mean diameter."""
    half = 0.5 * run.edges.min() / (2 * run.radius.mean())
    least = float(run.radius.min() / run.radius.mean())
    found = {
        "g": distances(least, max(1.1, min(6.0, 0.9 * half))),
        "g6": np.geomspace(1, max(1.1, half), 41),
    }
    return found | ({"S": np.linspace(0, 20, 101)} if run.periodic.all() else {})


def distances(least: float, most: float) -> np.ndarray:
    """Return the edges of bins of distance, which are narrow up to NEAR: there g(r) is steep."""
    near = np.arange(least, min(NEAR, most), FINE)
    return np.append(
        near, np.linspace(near[-1] + FINE, most, 1 + round(max(0, most - NEAR) / COARSE))
    )


def structure(runs: list[Run], frames: list[slice]) -> tuple[dict, dict[str, Curve]]:
    """Return psi6 of each run, and structure functions of all disks and of pairs of species."""
    some = [evenly(run, own) for run, own in zip(runs, frames, strict=True)]
    psi = {(r.path, k): bond_order(r, k) for r, own in zip(runs, some, strict=True) for k in own}
    each = [[psi[run.path, k] for k in own] for run, own in zip(runs, some, strict=True)]
    members = {
        "psi6_local": [correlated_mean([np.abs(one).mean() for one in own]) for own in each],
        "psi6_global": [correlated_mean([abs(one.mean()) for one in own]) for own in each],
    }

    def g6(run: Run, own: list[int], edges: np.ndarray) -> np.ndarray:
        return bond_correlation(run, own, [psi[run.path, k] for k in own], edges)

    edges = bins(runs[0])
    curves = {"g6": averaged(g6, runs, some, edges["g6"])}
    mixed = "mixture" in runs[0].nature
    pairs = list(combinations_with_replacement(runs[0].names, 2)) if mixed else []
    for name, of in (("g", pair_correlation), ("S", structure_factor)):
        for pair in (None, *pairs) if name in edges else ():
            shown = "_".join((name, *(pair or ())))
            curves[shown] = averaged(of, runs, some, edges[name], pair)
    return members, curves


def free_time(runs: list[Run], frames: list[slice]) -> float:
    """Return the mean free time, averaged over the given frames."""
    each = zip(runs, frames, strict=True)
    return float(np.mean([mean_free_time(run, run.time[own.start]) for run, own in each]))


def motion(runs: list[Run], frames: list[slice], skip: float | None, wave: float) -> dict:
    """Return the time correlations of all disks and of each species as functions of w t."""
    first, diameter = runs[0], 2 * runs[0].radius.mean()
    members = correlators(runs, [wave / diameter], skip=skip)
    found, unit, curves = curves_of(members), free_time(runs, frames), {}
    names = {"all": ""} | {one: f"_{one}" for one in first.names if "mixture" in first.nature}
    for species, end in names.items():
        for name, (lag, mean, error) in found[species].items():
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
    """Return a2 in the first frames as a function of the number of collisions per disk."""
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
        steps = transport.diffusion_lag(runs, frames)
        both = [transport.diffusion(*one, steps) for one in pairs]
        ways = 1 if "thermostatted" in runs[0].nature else 2
        members = dict(zip(NUMBERS[:ways], map(list, zip(*both, strict=True)), strict=False))
        apart = runs[0].time[frames[0].start + 1] - runs[0].time[frames[0].start]
        lag = steps * float(apart / free_time(runs, frames))
    orders, shown = structure(runs, frames)
    moved = "D_displacement(t)" in curves
    unit = (2 * runs[0].radius.mean()) ** 2 / free_time(runs, frames) if moved else None
    return Found(members | orders, curves | shown, lag, unit)


def table(groups: list, results: list[Found]) -> tuple[list[dict], list[str]]:
    """Return a table row for each packing fraction, and warnings about the numbers."""
    rows, notes = [], []
    for (eta, runs), found in zip(groups, results, strict=True):
        row = {"packing": eta, "runs": len(runs), "D_time": found.lag}
        for name in NUMBERS:
            if name in found.members:
                row |= over_runs(name, found.members[name], notes, f"η = {eta:g}, {name}")
            else:
                row |= measured(name, None)
        plain = runs[0].nature <= PLAIN
        row["D_enskog"] = float(transport.enskog_of(runs[0])["D"]) if plain else None
        alike = "mixture" not in runs[0].nature  # a mixture has no first bin
        first = Estimate(*found.curves["g"][1:]) if alike else None
        rows.append(row | measured("g_first_bin", first, 0))
    return rows, notes


def curves(groups: list, results: list[Found]) -> list[dict]:
    """Return a table that contains the numbers with errors, followed by all curve points."""
    names, rows = ("what", "packing", "x", "y", "error"), []
    for (eta, _), found in zip(groups, results, strict=True):
        for what, members in found.members.items():
            mean, error, *_ = combine_runs(members)
            x = found.lag if what.startswith("D_") else None
            rows.append(dict(zip(names, (what, eta, x, mean, error), strict=True)))
        rows += points(names, {(what, eta): curve for what, curve in found.curves.items()})
    return rows


# --- figure ---

AXES = {
    "vacf": {"ylabel": "velocity autocorrelation", "xscale": "log"},
    "tail": {"ylabel": "velocity autocorrelation", "xscale": "log", "yscale": "log"},
    "msd": {"ylabel": "square displacement / $\\sigma^2$", "xscale": "log", "yscale": "log"},
    "D": {"ylabel": "$D(t)\\,/\\,D_E$", "xscale": "log"},
    "F_s": {"ylabel": "$F_s(k,t)$", "xscale": "log"},
    "alpha2": {"ylabel": "$\\alpha_2$ of displacements (0: Gaussian)", "xscale": "log"},
    "a2": {"xlabel": "collisions per disk", "ylabel": "$a_2$ of velocities (0: Maxwell)"},
    "g": {"xlabel": "$r\\,/\\,\\sigma$", "ylabel": "pair correlation $g(r)$"},
    "S": {"xlabel": "$k\\,\\sigma$", "ylabel": "structure factor $S(k)$"},
    "g6": {"xlabel": "$r\\,/\\,\\sigma$", "ylabel": "$g_6(r)$", "xscale": "log", "yscale": "log"},
}
PALE = 0.3  # opacity of parts without an error
LINES = ("-", "--", ":", "-.")  # line styles of all disks, and of species


def parts(shown: dict[str, Curve], panel: str) -> dict[str, Curve]:
    """Return the curves of a panel by species or pair of species; the key "" means all disks."""
    names = [one for one in shown if one == panel or one.startswith(f"{panel}_")]
    return {one[len(panel) + 1 :]: shown[one] for one in names if one != "vacf_tail"}


def in_time(axes: plt.Axes, curve: Curve, label: str | None = None, **style: Any) -> None:
    """Draw a function of time with its error band; parts without an error are pale."""
    axes.plot(*curve[:2], **style, alpha=PALE)
    known = np.isfinite(curve.error)
    band(axes, *(np.where(known, part, np.nan) for part in curve), label=label, **style)


def draw_group(
    panels: dict[str, plt.Axes], found: Found, row: dict, colour: str, count: int, keyed: str
) -> None:
    """Draw the curves of one packing fraction; each run has `count` disks.

    Species have names in the legends if `keyed` is not empty, and colours if it is "colours".
    """
    line, label, shown = {"color": colour, "lw": 1}, f"η = {row['packing']:.3g}", found.curves

    def positive(curve: Curve) -> Curve:
        return Curve(*(part[curve.y > 0] for part in curve))

    for panel in ("vacf", "msd", "F_s", "alpha2", "g", "S"):
        own = parts(shown, panel)
        mean, error = row["D_displacement"], row["D_displacement_error"]
        spread = f"{label},  D = {mean:.4g} ± {error:.2g}" if mean and panel == "msd" else label
        shades = ["black", *COLOURS] if keyed == "colours" and len(own) > 1 else [colour]
        for (of, curve), dash, shade in zip(own.items(), cycle(LINES), cycle(shades)):
            named = of.replace("_", ", ") if of else "all" if len(own) > 1 else None
            named = named if keyed else None
            if not of and panel in ("msd", "vacf"):
                named = spread + ", all" * bool(named)
            style = line | {"color": shade, "ls": dash, "label": named}
            if panel in ("g", "S"):
                band(panels[panel], *curve, **style)
            else:
                in_time(panels[panel], curve, marker=".", **style)
    if "vacf" in shown:
        in_time(panels["tail"], positive(shown["vacf"]), marker=".", **line)
        if "vacf_tail" in shown:
            wt, tail, _ = shown["vacf_tail"]
            panels["tail"].plot(wt[wt > 3], tail[wt > 3], ls="--", **line)
    for name, marker in (("D_displacement(t)", "."), ("D_velocities(t)", "x")):
        if name in shown:
            x, y, error = shown[name]
            unit = row["D_enskog"] or found.unit
            in_time(panels["D"], Curve(x, y / unit, error / unit), marker=marker, ms=4, **line)
    if "a2" in panels:
        band(panels["a2"], *shown["a2"], **line)
        noise_band(panels["a2"], count, colour)
    order = f"{label},  ψ₆ {row['psi6_local']:.2f} of a disk, {row['psi6_global']:.2f} of all"
    band(panels["g6"], *positive(shown["g6"]), marker=".", label=order, **line)


def draw(
    groups: list[tuple[float, list[Run]]], results: list[Found], rows: list[dict], wave: float
) -> plt.Figure:
    """Draw all available time correlations, and below them the available structure functions."""
    there = set().union(*(one.curves for one in results))
    if max(len(one.curves["a2"].x) for one in results) < 2:  # the runs begin in equilibrium
        there.remove("a2")
    of = {"tail": "vacf", "D": "D_displacement(t)"}
    shown = {name: style for name, style in AXES.items() if of.get(name, name) in there}
    columns = (len(shown) + 1) // 2
    figure, axes = plt.subplots(2, columns, figsize=(4.5 * columns, 8.5))
    panels = dict(zip(shown, axes.flat, strict=False))
    for spare in axes.flat[len(shown) :]:
        spare.remove()
    shades = colours(len(rows))
    for (_, runs), found, row, colour in zip(groups, results, rows, shades, strict=True):
        count = sum(run.n_disks for run in runs)
        keyed = "" if row is not rows[0] else "colours" if len(rows) == 1 else "dashes"
        draw_group(panels, found, row, colour, count, keyed)
    for name, style in shown.items():
        panels[name].set(**{"xlabel": "$w\\,t$", **style})
    known = groups[0][1][0].nature <= PLAIN
    if "vacf" in panels:
        wt = np.geomspace(min(f.curves["vacf"].x[0] for f in results), 5, 200)
        if known:
            panels["vacf"].plot(wt, np.exp(-wt), color="black", ls="--", lw=1, label="$e^{-wt}$")
            panels["tail"].plot([], [], color="black", ls="--", lw=1, label="mode coupling, $1/t$")
        panels["tail"].set_ylim(1e-4, 1.2)
        panels["F_s"].set_title(f"$k\\sigma$ = {wave:.3g}")
    if "D" in panels:
        if not known:
            panels["D"].set_ylabel("$D(t)\\,/\\,(w\\,\\sigma^2)$")
        panels["D"].set_ylim(0, 1.3 * panels["D"].dataLim.y1)  # below the legend
        panels["D"].plot([], [], color="black", marker=".", label="from displacements")
        if "D_velocities(t)" in there:
            panels["D"].plot([], [], color="black", marker="x", label="from velocities")
    start = min(found.curves["a2"].y[0] for found in results)
    if start < -0.4 and known and "a2" in panels:
        dilute_limit(panels["a2"], RELAXATION)
    for name, level in (
        ("vacf", 0),
        ("F_s", 0),
        ("alpha2", 0),
        ("D", 1 if known else 0),
        ("a2", 0),
        ("g", 1),
        ("S", 1),
    ):
        if name in panels:
            panels[name].axhline(level, color="0.6", lw=0.8, zorder=0)
            if name == "g":
                panels[name].set_ylim(0, None)
    panels["g6"].set_ylim(1e-5, 1.5)
    panels["g6"].xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    panels["g6"].xaxis.set_major_formatter("{x:g}")
    panels["g6"].xaxis.set_minor_formatter("")
    for name in panels:
        if panels[name].get_legend_handles_labels()[0]:
            panels[name].legend(loc={"g6": "lower left", "D": "upper left"}.get(name, "best"))
    figure.suptitle(caption([run for _, runs in groups for run in runs]))
    return figure


def main() -> None:
    options = {"equilibration": None, "wavenumber": 2 * np.pi}
    args = command_line(__doc__, "correlations.png", **options).parse_args()
    for run in args.runs:
        check(run, args.runs[0])
    groups = by_packing(args.runs)
    results = [analysed(members, args.equilibration, args.wavenumber) for _, members in groups]
    rows, notes = table(groups, results)
    notes += motion_notes(args.runs)
    if not all("vacf" in found.curves for found in results):
        notes.append(
            "no steady state without flow: time correlations and diffusion coefficients are omitted"
        )
    figure = draw(groups, results, rows, args.wavenumber)
    report(args, figure, rows, data=curves(groups, results), notes=notes)


if __name__ == "__main__":
    launch(main)
