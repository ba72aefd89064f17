"""How a gas forgets, spreads and orders: VACF, diffusion, a2; g(r), S(k), psi6 and g6(r).

    python post/correlations.py runs/state/memory_*.h5 -o correlations.png --csv correlations.csv

Disks in an empty box, without gravity.  Runs are combined by packing fraction; lines are means over
the runs, bands are errors, those of a single run for the structure alone, whose frames remember
each other. Frames must be equally far apart in time; lags are logarithmic, every frame is an
origin. Frames before equilibrium, which is found or begins after --skip, count for a2 alone.  Times
are in units of the mean free time 1/w, lengths of the mean diameter.  Of runs that have no
equilibrium only a2 and the structure are found, the latter in the frames after --skip, or else
where nothing drifts, or 15 collisions per disk after the start of a gas that cools, at any times.

VACF: at first it falls as exp(-w t), late, in theory, as 1/t (mode coupling).  Diffusion: D(t) is a
quarter of the slope of the mean square displacement, here between neighbouring lags; and half the
integral of <v(0) v(s)> from 0 to t, which is half of <v(0) (x(t) - x(0))> and so exact however far
apart the frames are, unless kicks change velocities on the way: kicked disks have the first alone.
For equal smooth disks that keep their energy it stands beside D_E of Enskog.  In two dimensions the
tail makes D(t) grow without end, as the logarithm of t: a D belongs to a time, and to a box, whose
images are felt when sound has crossed it.  The table has both D, which must agree, between half of
`D_time` and `D_time`; that is the time of crossing if an eighth of the run is longer.  Periodic
boxes only.  a2 = <v^4> / (2 <v^2>^2) - 1, each species at its own temperature, is 0 in equilibrium
and -1/2 for equal speeds.

S(k) = <|sum of exp(i k x)|^2> / N.  psi6 of a disk: mean of exp(6 i theta) over its Delaunay
neighbours; local is its modulus, global the modulus of the mean over all disks: 1 in a perfect
triangular crystal.  g6(r) = <psi6*(0) psi6(r)>: it falls exponentially in a fluid, slowly as a
power of r in a hexatic phase, and not at all in a crystal.
"""

from typing import NamedTuple

from ricochet import Run, RunError, hard_disks, transport
from ricochet.drawing import band, caption, colours, dilute_limit, noise_band, plt
from ricochet.nature import allow
from ricochet.script import by_packing, command_line, launch, measured, over_runs, points, report
from ricochet.speeds import relaxation
from ricochet.statistics import Curve, Estimate, SeriesMean, combined, estimate, series_mean
from ricochet.structure import bond_correlation, bond_order, pair_correlation, structure_factor
from ricochet.theory import RELAXATION
from ricochet.thermodynamics import FLUID, all_settle, later, mean_free_time

import numpy as np

MOST_FRAMES = 50  # for the structure
PLAIN = {"walled"}  # what equal smooth elastic disks may be
#: What has no equilibrium, but a structure.
RESTLESS = ("lossy", "soft", "unlike", "uneven", "noisy", "active", "sliding")
NUMBERS = ("D_displacement", "D_velocities", "psi6_local", "psi6_global")


class Found(NamedTuple):
    """Of the runs at one packing fraction: what has an error; curves by name."""

    members: dict[str, list[SeriesMean]]
    curves: dict[str, Curve]
    lag: float | None  # of the diffusion coefficients, in mean free times; None without


def check(run: Run, first: Run) -> None:
    """Refuse what is not alike everywhere; lags mean nothing without equal intervals of time."""
    allow(run, "correlations are those of disks in an empty box", *FLUID, *RESTLESS)
    if run.count < 3:
        raise RunError(f"{run.path}: needs three disks and more")
    if ("mixture" in run.nature) != ("mixture" in first.nature):
        raise RunError(f"{run.path}: not equal disks, or not a mixture, as {first.path} is")
    steps = np.diff(run.time[:-1] if run.frames > 2 else run.time)  # the last may be out of step
    settled = first.nature.in_equilibrium
    even = not settled or len(steps) == 0 or np.ptp(steps) <= 1e-6 * steps[0]
    if run.frames < 10 or not even:
        how = ", written by frames_every_time alone" if settled else ""
        raise RunError(f"{run.path}: needs 10 frames and more{how}")


def bins(run: Run) -> dict[str, np.ndarray]:
    """Of distances and wave numbers, in mean diameters."""
    half = 0.5 * run.edges.min() / (2 * run.radius.mean())
    least = float(run.radius.min() / run.radius.mean())
    found = {
        "g": np.linspace(least, max(1.1, min(6.0, 0.9 * half)), 151),
        "g6": np.geomspace(1, max(1.1, half), 41),
    }
    return found | ({"S": np.linspace(0, 20, 101)} if run.periodic.all() else {})


def structure(runs: list[Run], frames: list[slice]) -> tuple[dict, dict[str, Curve]]:
    """psi6 of each run, and the means of the curves; of a single run over its frames."""
    members, forms, alone = {"psi6_local": [], "psi6_global": []}, [], len(runs) == 1
    for run, own in zip(runs, frames, strict=True):
        some = np.unique(np.linspace(own.start, own.stop - 1, MOST_FRAMES).astype(int)).tolist()
        psi = [bond_order(run, k) for k in some]
        members["psi6_local"].append(series_mean([np.abs(one).mean() for one in psi]))
        members["psi6_global"].append(series_mean([abs(one.mean()) for one in psi]))
        edges = bins(run)
        for part in np.array_split(np.arange(len(some)), len(some) if alone else 1):
            these, order = [some[k] for k in part], [psi[k] for k in part]
            form = {"g": pair_correlation(run, these, edges["g"])}
            form["g6"] = bond_correlation(run, these, order, edges["g6"])
            if "S" in edges:
                form["S"] = structure_factor(run, these, edges["S"])
            forms.append(form)
    curves = {}
    for name, edges in bins(runs[0]).items():
        values = np.array([form[name] for form in forms])
        known = np.isfinite(values).all(axis=0)
        columns = values[:, known]
        each = [series_mean(one)[:2] for one in columns.T] if alone else []
        mean = np.reshape(each, (-1, 2)).T if alone else estimate(columns)
        curves[name] = Curve(((edges[1:] + edges[:-1]) / 2)[known], *mean)
    return members, curves


def free_time(runs: list[Run], frames: list[slice]) -> float:
    """The mean free time in these frames."""
    each = zip(runs, frames, strict=True)
    return float(np.mean([mean_free_time(run, run.time[own.start]) for run, own in each]))


def motion(runs: list[Run], frames: list[slice]) -> dict[str, Curve]:
    """Curves against w t of memory and diffusion."""
    first, pairs = runs[0], list(zip(runs, frames, strict=True))
    at = transport.lags(min(f.stop - f.start for f in frames))
    time, diameter = at * (first.time[1] - first.time[0]), 2 * first.radius.mean()
    wt = time / free_time(runs, frames)
    msd = np.array([transport.displacement(*one, at) for one in pairs])
    curves = {
        "vacf": Curve(wt, *estimate([transport.velocity_memory(*one, at) for one in pairs])),
        "msd": Curve(wt, *estimate(msd / diameter**2)),
    }
    if first.nature <= PLAIN:
        density, theory = first.count / np.prod(first.edges), transport.enskog_of(first)
        kinematic = theory["viscosity"] / (density * first.mass[0])
        tail = hard_disks.long_time_tail(time, density, theory["D"], kinematic)
        curves["vacf_tail"] = Curve(wt, tail, np.full_like(tail, np.nan))
    if first.periodic.all():
        if "bathed" not in first.nature:
            memory = estimate([transport.integrated_memory(*one, at) for one in pairs])
            curves["D_velocities(t)"] = Curve(wt, *memory)
        ends, slope = np.append(0, wt), np.diff(msd, prepend=0) / np.diff(time, prepend=0)
        middle = (ends[1:] + ends[:-1]) / 2
        curves["D_displacement(t)"] = Curve(middle, *estimate(slope / 4))
    return curves


def kurtosis(runs: list[Run], until: int) -> Curve:
    """a2 against collisions per disk in the first frames."""
    tau, a2 = zip(*(relaxation(run, frames=until) for run in runs), strict=True)
    return Curve(np.mean(tau, axis=0), *estimate(a2))


def analysed(runs: list[Run], skip: float | None) -> Found:
    """All that runs at one packing fraction say."""
    frames = [later(run, skip) for run in runs]
    curves, members, lag = {}, {}, None
    if not all_settle(runs):
        curves["a2"] = kurtosis(runs, min(run.frames for run in runs))
    else:
        curves = motion(runs, frames)
        curves["a2"] = kurtosis(runs, max(own.start for own in frames) + 1)
        lag = transport.diffusion_lag(runs, frames)
        if runs[0].periodic.all():
            both = [transport.diffusion(*one, lag) for one in zip(runs, frames, strict=True)]
            ways = 1 if "bathed" in runs[0].nature else 2
            members = dict(zip(NUMBERS[:ways], map(list, zip(*both, strict=True)), strict=False))
        step = runs[0].time[1] - runs[0].time[0]
        lag *= float(step / free_time(runs, frames))
    orders, shown = structure(runs, frames)
    return Found(members | orders, curves | shown, lag)


def table(groups: list, results: list[Found]) -> tuple[list[dict], list[str]]:
    """A row per packing fraction; and what speaks against it."""
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
        _, *first = found.curves["g"]
        rows.append(row | measured("g_first_bin", Estimate(*first), 0))
    return rows, notes


def curves(groups: list, results: list[Found]) -> list[dict]:
    """What has an error, then all curves, one below the other."""
    names, rows = ("what", "packing", "x", "y", "error"), []
    for (eta, _), found in zip(groups, results, strict=True):
        for what, members in found.members.items():
            mean, error, *_ = combined(members)
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
    "a2": {"xlabel": "collisions per disk", "ylabel": "$a_2$ (0: Maxwell)"},
    "g": {"xlabel": "$r\\,/\\,\\sigma$", "ylabel": "pair correlation $g(r)$"},
    "S": {"xlabel": "$k\\,\\sigma$", "ylabel": "structure factor $S(k)$"},
    "g6": {"xlabel": "$r\\,/\\,\\sigma$", "ylabel": "$g_6(r)$", "xscale": "log", "yscale": "log"},
}


def draw_group(
    panels: dict[str, plt.Axes], found: Found, row: dict, colour: str, count: int
) -> None:
    """One packing fraction in all panels; `count` disks in all of its runs."""
    line, label, shown = {"color": colour, "lw": 1}, f"η = {row['packing']:.3g}", found.curves

    def positive(curve: Curve) -> Curve:
        return Curve(*(part[curve.y > 0] for part in curve))

    if "vacf" in panels:
        band(panels["vacf"], *shown["vacf"], marker=".", label=label, **line)
        band(panels["tail"], *positive(shown["vacf"]), marker=".", **line)
        if "vacf_tail" in shown:
            wt, tail, _ = shown["vacf_tail"]
            panels["tail"].plot(wt[wt > 3], tail[wt > 3], ls="--", **line)
        mean, error = row["D_displacement"], row["D_displacement_error"]
        spread = f"{label},  D = {mean:.4g} ± {error:.2g}" if mean else ""
        band(panels["msd"], *shown["msd"], marker=".", label=spread, **line)
    for name, marker in (("D_displacement(t)", "."), ("D_velocities(t)", "x")):
        if name in shown:
            x, y, error = shown[name]
            unit = row["D_enskog"] or y.max()
            band(panels["D"], x, y / unit, error / unit, marker=marker, ms=4, **line)
    for name in ("a2", "S", "g"):
        if name in shown:
            band(panels[name], *shown[name], **line)
    noise_band(panels["a2"], count, colour)
    order = f"{label},  ψ₆ {row['psi6_local']:.2f} of a disk, {row['psi6_global']:.2f} of all"
    band(panels["g6"], *positive(shown["g6"]), marker=".", label=order, **line)


def draw(
    groups: list[tuple[float, list[Run]]], results: list[Found], rows: list[dict], cool: bool
) -> plt.Figure:
    """Motion above, structure below, as far as there is any."""
    there = set().union(*(one.curves for one in results))
    of = {"tail": "vacf", "D": "D_displacement(t)"}
    shown = {name: style for name, style in AXES.items() if of.get(name, name) in there}
    columns = (len(shown) + 1) // 2
    figure, axes = plt.subplots(2, columns, figsize=(4.5 * columns, 8.5))
    panels = dict(zip(shown, axes.flat, strict=False))
    for spare in axes.flat[len(shown) :]:
        spare.remove()
    shades = colours(len(rows))
    for (_, runs), found, row, colour in zip(groups, results, rows, shades, strict=True):
        draw_group(panels, found, row, colour, sum(run.count for run in runs))
    for name, style in shown.items():
        panels[name].set(**{"xlabel": "$w\\,t$", **style})
    known = groups[0][1][0].nature <= PLAIN
    if not cool:
        wt = np.geomspace(min(f.curves["vacf"].x[0] for f in results), 5, 200)
        if known:
            panels["vacf"].plot(wt, np.exp(-wt), color="black", ls="--", lw=1, label="$e^{-wt}$")
            panels["tail"].plot([], [], color="black", ls="--", lw=1, label="mode coupling, $1/t$")
        panels["tail"].set_ylim(1e-4, 1.2)
    if "D" in panels:
        if not known:
            panels["D"].set_ylabel("$D(t)$ / its largest value")
        panels["D"].plot([], [], color="black", marker=".", label="from displacements")
        if "D_velocities(t)" in there:
            panels["D"].plot([], [], color="black", marker="x", label="from velocities")
    start = min(found.curves["a2"].y[0] for found in results)
    if start < -0.4 and known:
        dilute_limit(panels["a2"], RELAXATION)
    for name, level in (("vacf", 0), ("D", 1), ("a2", 0), ("g", 1), ("S", 1)):
        if name in panels:
            panels[name].axhline(level, color="0.6", lw=0.8, zorder=0)
            if name not in ("vacf", "a2"):
                panels[name].set_ylim(0, None)
    panels["g6"].set_ylim(1e-5, 30)
    panels["g6"].xaxis.set_minor_formatter("")
    for name in panels.keys() - {"g", "S"}:
        if panels[name].get_legend_handles_labels()[0]:
            panels[name].legend()
    figure.suptitle(caption([run for _, runs in groups for run in runs]))
    return figure


def main() -> None:
    args = command_line(__doc__, "correlations.png", skip=None).parse_args()
    for run in args.runs:
        check(run, args.runs[0])
    cool, groups = not all_settle(args.runs), by_packing(args.runs)
    results = [analysed(members, args.skip) for _, members in groups]
    rows, notes = table(groups, results)
    if cool:
        notes.append("no equilibrium: no memory and no diffusion coefficient")
    figure = draw(groups, results, rows, cool)
    report(args, figure, rows, data=curves(groups, results), notes=notes)


if __name__ == "__main__":
    launch(main)
