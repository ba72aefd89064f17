"""How a gas forgets, spreads and orders: VACF, diffusion, a2; g(r), S(k), psi6 and g6(r).

    python post/correlations.py runs/state/memory_*.h5 -o correlations.png --csv correlations.csv

Disks without gravity.  Runs are combined by packing fraction; lines are means over the runs, bands
are standard errors, those of a single run for the structure alone, from blocks of its frames.
Frames must be equally far apart in time; lags are logarithmic, every frame is an origin.
Frames before equilibrium, which is found or begins after --skip, count for a2 alone.  Times are in
units of the mean free time 1/w, lengths of the mean diameter.  Of runs that lose energy in
collisions and have no equilibrium only a2 and the structure are found, the latter in the frames
after --skip, or else 15 collisions per disk, at any times.

VACF: at first it falls as exp(-w t), late, in theory, as 1/t (mode coupling).  Diffusion: D(t) is
a quarter of the slope of the mean square displacement, here between neighbouring lags; and half the
integral of <v(0) v(s)> from 0 to t, which is half of <v(0) (x(t) - x(0))> and so exact however far
apart the frames are.  For equal disks it stands beside D_E of Enskog.  In two dimensions the tail
makes D(t) grow without end, as the logarithm of t: a D belongs to a time, and to a box, whose
images are felt when sound has crossed it.  The table has both D, which must agree, between half of
`D_time` and `D_time`; that is the time of crossing if an eighth of the run is longer.  Periodic
boxes only.  a2 = <v^4> / (2 <v^2>^2) - 1 is 0 in equilibrium and -1/2 for equal speeds.

S(k) = <|sum of exp(i k x)|^2> / N.  psi6 of a disk: mean of exp(6 i theta) over its Delaunay
neighbours; local is its modulus, global the modulus of the mean over all disks: 1 in a perfect
triangular crystal.  g6(r) = <psi6*(0) psi6(r)>: it falls exponentially in a fluid, slowly as a
power of r in a hexatic phase, and not at all in a crystal.
"""

from typing import NamedTuple

from ricochet import Run, RunError, hard_disks
from ricochet.diffusion import (
    diffusion,
    diffusion_lag,
    displacement,
    integrated_memory,
    lags,
    velocity_memory,
)
from ricochet.drawing import band, caption, colours, dilute_limit, noise_band, plt
from ricochet.script import command_line, grouped, launch, measured, read_all, report
from ricochet.statistics import SeriesMean, combined, doubts, estimate, excess_kurtosis, series_mean
from ricochet.structure import bond_correlation, bond_order, pair_correlation, structure_factor
from ricochet.theory import RELAXATION
from ricochet.thermodynamics import (
    after_start,
    all_cool,
    equal_disks,
    free_disks,
    loses_energy,
    mean_free_time,
    packing,
    start_of_equilibrium,
    temperature,
)

import numpy as np

MOST_FRAMES = 50  # for the structure
BLOCKS = 8  # of the frames of a single run


class Curve(NamedTuple):
    """(P,) each."""

    x: np.ndarray
    y: np.ndarray
    error: np.ndarray  # NaN where there is none


class Found(NamedTuple):
    """Of the runs at one packing fraction: what has an error; curves by name."""

    members: dict[str, list[SeriesMean]]
    curves: dict[str, Curve]
    lag: float | None  # of the diffusion coefficients, in mean free times; None without


def check(run: Run, first: Run) -> None:
    """Refuse what falls; the lags mean nothing without equal intervals of time."""
    if run.gravity.any():
        raise RunError(f"{run.path}: needs a gas without gravity")
    if equal_disks(run) != equal_disks(first):
        raise RunError(f"{run.path}: not equal disks, or not a mixture, as {first.path} is")
    steps = np.diff(run.time[:-1] if run.frames > 2 else run.time)
    even = loses_energy(first) or np.ptp(steps) <= 1e-6 * steps[0]  # the last may be out of step
    if run.frames < 10 or not even:
        how = "" if loses_energy(first) else ", written by frames_every_time"
        raise RunError(f"{run.path}: needs 10 frames and more{how}")


def later(run: Run, skip: float | None, cool: bool) -> slice:
    """Frames in equilibrium, or after the start, without the last, which may be out of step."""
    begin = after_start if cool else start_of_equilibrium
    first = int(np.searchsorted(run.time, begin(run, skip)))
    if run.frames - 1 - first < 2:
        raise RunError(f"{run.path}: needs more frames after the start")
    return slice(first, run.frames - 1)


def some(frames: slice) -> list[int]:
    """At most `MOST_FRAMES` of them."""
    return np.unique(np.linspace(frames.start, frames.stop - 1, MOST_FRAMES).astype(int)).tolist()


def kurtosis(run: Run, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Collisions per disk and a2 of the first frames."""
    a2 = np.array([excess_kurtosis(run.speed(k)) for k in range(frames)])
    return run.collisions_per_disk_at(run.time[:frames]), a2


def enskog(run: Run) -> tuple[float, float]:
    """Diffusion coefficient and kinematic viscosity of equal disks, with the Z of their rate."""
    diameter, kt, mass = 2 * run.radius[0], temperature(run), run.mass[0]
    unit = hard_disks.collision_rate(2.0, diameter, free_disks(run), kt, mass)
    state = (1 + 1 / (mean_free_time(run) * unit), packing(run), diameter, kt, mass)
    return hard_disks.enskog_diffusion(*state), hard_disks.enskog_viscosity(*state)


def numbers(
    run: Run, frames: slice, psi: list[np.ndarray], lag: int | None
) -> dict[str, SeriesMean]:
    """What one run says with an error."""
    found = {}
    if run.periodic.all() and lag is not None:
        found["D_displacement"], found["D_velocities"] = diffusion(run, frames, lag)
    found["psi6_local"] = series_mean([np.abs(one).mean() for one in psi])
    found["psi6_global"] = series_mean([abs(one.mean()) for one in psi])
    return found


def bins(run: Run) -> dict[str, np.ndarray]:
    """Of distances and wave numbers, in mean diameters."""
    half = 0.5 * run.edges.min() / (2 * run.radius.mean())
    found = {
        "g": np.linspace(1, max(1.1, min(6.0, 0.9 * half)), 151),
        "g6": np.geomspace(1, max(1.1, half), 41),
    }
    return found | ({"S": np.linspace(0, 20, 101)} if run.periodic.all() else {})


def shapes(run: Run, frames: list[int], psi: list[np.ndarray]) -> dict[str, np.ndarray]:
    """Curves of the structure of one run, in `bins`."""
    edges = bins(run)
    found = {"g": pair_correlation(run, frames, edges["g"])}
    found["g6"] = bond_correlation(run, frames, psi, edges["g6"])
    if "S" in edges:
        found["S"] = structure_factor(run, frames, edges["S"])
    return found


def way(runs: list[Run], until: int) -> Curve:
    """a2 against collisions per disk in the first frames."""
    x, a2 = np.moveaxis([kurtosis(run, until) for run in runs], 1, 0)
    return Curve(x.mean(axis=0), *estimate(a2))


def motion(runs: list[Run], frames: list[slice]) -> dict[str, Curve]:
    """Curves against w t of memory and diffusion."""
    first, pairs = runs[0], list(zip(runs, frames, strict=True))
    at = lags(min(f.stop - f.start for f in frames))
    time, diameter = at * (first.time[1] - first.time[0]), 2 * first.radius.mean()
    wt = time / np.mean([mean_free_time(run) for run in runs])
    vacf = estimate([velocity_memory(*one, at) for one in pairs])
    msd = np.array([displacement(*one, at) for one in pairs])
    curves = {"vacf": Curve(wt, *vacf), "msd": Curve(wt, *estimate(msd / diameter**2))}
    if equal_disks(first):
        density = first.count / np.prod(first.edges)
        tail = hard_disks.long_time_tail(time, density, *enskog(first))
        curves["vacf_tail"] = Curve(wt, tail, np.full_like(tail, np.nan))
    if first.periodic.all():
        memory = estimate([integrated_memory(*one, at) for one in pairs])
        curves["D_velocities(t)"] = Curve(wt, *memory)
        ends, slope = np.append(0, wt), np.diff(msd, prepend=0) / np.diff(time, prepend=0)
        middle = (ends[1:] + ends[:-1]) / 2
        curves["D_displacement(t)"] = Curve(middle, *estimate(slope / 4))
    return curves


def structure(run: Run, frames: list[int], psi: list[np.ndarray], alone: bool) -> list[dict]:
    """`shapes` of a run, or of blocks of its frames if it is alone, for an error."""
    parts = np.array_split(np.arange(len(frames)), min(BLOCKS, len(frames)) if alone else 1)
    return [shapes(run, [frames[k] for k in part], [psi[k] for k in part]) for part in parts]


def analysed(runs: list[Run], skip: float | None, cool: bool) -> Found:
    """All that runs at one packing fraction say."""
    frames = [later(run, skip, cool) for run in runs]
    lag, members, forms = None if cool else diffusion_lag(runs, frames), [], []
    for run, own in zip(runs, frames, strict=True):
        psi = [bond_order(run, k) for k in some(own)]
        members.append(numbers(run, own, psi, lag))
        forms += structure(run, some(own), psi, len(runs) == 1)
    until = min(run.frames for run in runs) if cool else max(own.start for own in frames) + 1
    curves = {} if cool else motion(runs, frames)
    curves["a2"] = way(runs, until)
    for name, edges in bins(runs[0]).items():
        y, error = estimate([form[name] for form in forms])
        known = np.isfinite(y)
        curves[name] = Curve(((edges[1:] + edges[:-1]) / 2)[known], y[known], error[known])
    named = {name: [one[name] for one in members] for name in members[0]}
    if lag is not None:
        step = runs[0].time[1] - runs[0].time[0]
        lag *= float(step / np.mean([mean_free_time(run) for run in runs]))
    return Found(named, curves, lag)


def table(groups: list, results: list[Found]) -> list[dict]:
    """A row per packing fraction."""
    rows = []
    for (eta, runs), found in zip(groups, results, strict=True):
        row = {"packing": eta, "runs": len(runs), "D_time": found.lag}
        for name in ("D_displacement", "D_velocities", "psi6_local", "psi6_global"):
            members = found.members.get(name)
            row |= measured(name, combined(members) if members else None)
        known = equal_disks(runs[0]) and found.lag is not None
        row["D_enskog"] = enskog(runs[0])[0] if known else None
        rows.append(row | {"g_first_bin": float(found.curves["g"].y[0])})
    return rows


def notes(groups: list, results: list[Found]) -> list[str]:
    """What speaks against the numbers."""
    return [
        note
        for (eta, _), found in zip(groups, results, strict=True)
        for name, members in found.members.items()
        for note in doubts(f"η = {eta:g}, {name}", members)
    ]


def curves(groups: list, results: list[Found]) -> list[dict]:
    """What has an error, then all curves, one below the other."""
    rows = []
    for (eta, _), found in zip(groups, results, strict=True):
        for what, members in found.members.items():
            mean, error, *_ = combined(members)
            x = found.lag if what.startswith("D_") else None
            rows.append({"what": what, "packing": eta, "x": x, "y": mean, "error": error})
        rows += [
            {"what": what, "packing": eta, "x": float(x), "y": float(y), "error": float(error)}
            for what, curve in found.curves.items()
            for x, y, error in zip(*curve, strict=True)
        ]
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
    line, label = {"color": colour, "lw": 1}, f"η = {row['packing']:.3g}"
    if "vacf" in panels:
        draw_motion(panels, found, row, label, line)
    for name in ("a2", "S", "g"):
        if name in found.curves:
            band(panels[name], *found.curves[name], **line)
    noise_band(panels["a2"], count, colour)
    g6 = found.curves["g6"]
    order = f"{label},  ψ₆ {row['psi6_local']:.2f} of a disk, {row['psi6_global']:.2f} of all"
    above = Curve(*(part[g6.y > 0] for part in g6))
    band(panels["g6"], *above, marker=".", label=order, **line)


def draw_motion(
    panels: dict[str, plt.Axes], found: Found, row: dict, label: str, line: dict
) -> None:
    """Memory and diffusion at one packing fraction."""
    vacf = found.curves["vacf"]
    band(panels["vacf"], *vacf, marker=".", label=label, **line)
    band(panels["tail"], *(part[vacf.y > 0] for part in vacf), marker=".", **line)
    if "vacf_tail" in found.curves:
        late = vacf.x > 3
        panels["tail"].plot(vacf.x[late], found.curves["vacf_tail"].y[late], ls="--", **line)
    spread = ""
    if row["D_displacement"]:
        spread = f"{label},  D = {row['D_displacement']:.4g} ± {row['D_displacement_error']:.2g}"
    band(panels["msd"], *found.curves["msd"], marker=".", label=spread, **line)
    for name, marker in (("D_displacement(t)", "."), ("D_velocities(t)", "x")):
        if name in found.curves:
            x, y, error = found.curves[name]
            unit = row["D_enskog"] or y.max()
            band(panels["D"], x, y / unit, error / unit, marker=marker, ms=4, **line)


def draw(
    groups: list[tuple[float, list[Run]]], results: list[Found], rows: list[dict], cool: bool
) -> plt.Figure:
    """Motion above, structure below; of gases that cool a2 and the structure."""
    shown = {name: AXES[name] for name in AXES if not cool or name in ("a2", "g", "S", "g6")}
    figure, axes = plt.subplots(2, len(shown) // 2, figsize=(4.5 * len(shown) // 2, 8.5))
    panels = dict(zip(shown, axes.flat, strict=True))
    shades = colours(len(rows))
    for (_, runs), found, row, colour in zip(groups, results, rows, shades, strict=True):
        draw_group(panels, found, row, colour, sum(run.count for run in runs))
    for name, style in shown.items():
        panels[name].set(**{"xlabel": "$w\\,t$", **style})
    equal = equal_disks(groups[0][1][0])
    if not cool:
        draw_theory(panels, min(f.curves["vacf"].x[0] for f in results), equal)
    start = min(found.curves["a2"].y[0] for found in results)
    if start < -0.4 and equal and not cool:
        dilute_limit(panels["a2"], RELAXATION)
    for name, level in (("vacf", 0), ("D", 1), ("a2", 0), ("g", 1), ("S", 1)):
        if name in panels:
            panels[name].axhline(level, color="0.6", lw=0.8, zorder=0)
            if name not in ("vacf", "a2"):
                panels[name].set_ylim(0, None)
    panels["g6"].set_ylim(1e-5, 30)
    for name in panels.keys() - {"g", "S"}:
        if panels[name].get_legend_handles_labels()[0]:
            panels[name].legend()
    figure.suptitle(caption([run for _, runs in groups for run in runs]), fontsize=10)
    return figure


def draw_theory(panels: dict[str, plt.Axes], first: float, equal: bool) -> None:
    """What memory and diffusion are compared with, and the signs of the latter."""
    wt = np.geomspace(first, 5, 200)
    if equal:
        panels["vacf"].plot(wt, np.exp(-wt), color="black", ls="--", lw=1, label="$e^{-wt}$")
        panels["tail"].plot([], [], color="black", ls="--", lw=1, label="mode coupling, $1/t$")
    else:
        panels["D"].set_ylabel("$D(t)$ / its largest value")
    panels["D"].plot([], [], color="black", marker=".", label="from displacements")
    panels["D"].plot([], [], color="black", marker="x", label="from velocities")
    panels["tail"].set_ylim(1e-4, 1.2)


def main() -> None:
    args = command_line(__doc__, "correlations.png", skip=None).parse_args()
    runs = read_all(args.runs)
    for run in runs:
        check(run, runs[0])
    cool, groups = all_cool(runs), grouped(runs, lambda run: round(packing(run), 6))
    results = [analysed(members, args.skip, cool) for _, members in groups]
    rows = table(groups, results)
    title = "Correlations in a gas of hard disks"
    data, said = curves(groups, results), notes(groups, results)
    if cool:
        said.append("the gas loses energy, no equilibrium: no memory and no diffusion coefficient")
    report(args, runs, title, draw(groups, results, rows, cool), rows, data=data, notes=said)


if __name__ == "__main__":
    launch(main)
