"""How a gas forgets, spreads and orders: VACF, diffusion, a2; g(r), S(k), psi6 and g6(r).

    python post/correlations.py runs/state/memory_*.h5 -o correlations.png --csv correlations.csv

Elastic disks without gravity.  Runs are combined by packing fraction; lines are means over the
runs.  Frames must be equally far apart in time; lags are logarithmic, every frame is an origin.
Frames before equilibrium, which is found or begins after --skip, count for a2 alone.  Times are in
units of the mean free time 1/w, lengths of the mean diameter.

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
    crossing_time,
    diffusion,
    displacement,
    integrated_memory,
    velocity_memory,
)
from ricochet.drawing import caption, colours, dilute_limit, plt
from ricochet.script import command_line, grouped, launch, measured, read_all, report
from ricochet.statistics import SeriesMean, combined, doubts, estimate, excess_kurtosis, series_mean
from ricochet.structure import bond_correlation, bond_order, pair_correlation, structure_factor
from ricochet.theory import RELAXATION
from ricochet.thermodynamics import (
    equal_disks,
    free_disks,
    packing,
    start_of_equilibrium,
    temperature,
)

import numpy as np

MOST_FRAMES = 50  # for the structure


class Found(NamedTuple):
    """Of the runs at one packing fraction: what has an error; curves as name -> (x, y)."""

    members: dict[str, list[SeriesMean]]
    curves: dict[str, tuple[np.ndarray, np.ndarray]]
    lag: float  # of the diffusion coefficients, in mean free times


def lags(frames: int, per_decade: int = 12) -> np.ndarray:
    """Whole numbers of frames, in logarithmic steps, up to half the run."""
    last = max(1, frames // 2)
    count = 1 + int(per_decade * np.log10(last))
    return np.unique(np.geomspace(1, last, count).round().astype(int))


def mean_free_time(run: Run) -> float:
    """1 / w, over the whole run."""
    collisions = run.collisions_per_disk.value[-1]
    if not collisions > 0:
        raise RunError(f"{run.path}: has no collisions of two disks yet")
    return run.time[-1] / collisions


def check(run: Run, first: Run) -> None:
    """Refuse what falls; the lags mean nothing without equal intervals of time."""
    if run.gravity.any():
        raise RunError(f"{run.path}: needs a gas without gravity")
    if equal_disks(run) != equal_disks(first):
        raise RunError(f"{run.path}: not equal disks, or not a mixture, as {first.path} is")
    steps = np.diff(run.time[:-1] if run.frames > 2 else run.time)
    if run.frames < 10 or np.ptp(steps) > 1e-6 * steps[0]:  # the last may be out of step
        raise RunError(f"{run.path}: needs 10 frames and more, written by frames_every_time")


def later(run: Run, skip: float | None) -> slice:
    """Frames in equilibrium, without the last, which may be out of step."""
    first = int(np.searchsorted(run.time, start_of_equilibrium(run, skip)))
    if run.frames - 1 - first < 2:
        raise RunError(f"{run.path}: needs more frames in equilibrium")
    return slice(first, run.frames - 1)


def some(frames: slice) -> list[int]:
    """At most `MOST_FRAMES` of them."""
    return np.unique(np.linspace(frames.start, frames.stop - 1, MOST_FRAMES).astype(int)).tolist()


def kurtosis(run: Run, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Collisions per disk and a2 of the first frames."""
    a2 = np.array([excess_kurtosis(run.speed(k)) for k in range(frames)])
    return run.collisions_per_disk_at(run.time[:frames]), a2


def diffusion_lag(runs: list[Run], frames: list[slice]) -> int:
    """In frames: until sound has crossed the box, or an eighth of the shortest run."""
    step = runs[0].time[1] - runs[0].time[0]
    shortest = min(f.stop - f.start for f in frames)
    return int(np.clip(crossing_time(runs[0]) / step, 2, max(2, shortest // 8)))


def enskog(run: Run) -> tuple[float, float]:
    """Diffusion coefficient and kinematic viscosity of equal disks, with the Z of their rate."""
    diameter, kt, mass = 2 * run.radius[0], temperature(run), run.mass[0]
    unit = hard_disks.collision_rate(2.0, diameter, free_disks(run), kt, mass)
    state = (1 + 1 / (mean_free_time(run) * unit), packing(run), diameter, kt, mass)
    return hard_disks.enskog_diffusion(*state), hard_disks.enskog_viscosity(*state)


def numbers(run: Run, frames: slice, psi: list[np.ndarray], lag: int) -> dict[str, SeriesMean]:
    """What one run says with an error."""
    found = {}
    if run.periodic.all():
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


def motion(runs: list[Run], frames: list[slice]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Curves against w t of memory and diffusion, and of a2 against collisions per disk."""
    first, pairs = runs[0], list(zip(runs, frames, strict=True))
    at = lags(min(f.stop - f.start for f in frames))
    time, diameter = at * (first.time[1] - first.time[0]), 2 * first.radius.mean()
    wt = time / np.mean([mean_free_time(run) for run in runs])
    vacf = estimate([velocity_memory(*one, at) for one in pairs]).mean
    msd = estimate([displacement(*one, at) for one in pairs]).mean
    until = max(own.start for own in frames) + 1
    a2 = estimate([kurtosis(run, until) for run in runs]).mean
    curves = {"vacf": (wt, vacf), "msd": (wt, msd / diameter**2), "a2": tuple(a2)}
    if equal_disks(first):
        density = first.count / np.prod(first.edges)
        curves["vacf_tail"] = wt, hard_disks.long_time_tail(time, density, *enskog(first))
    if first.periodic.all():
        memory = estimate([integrated_memory(*one, at) for one in pairs]).mean
        curves["D_velocities(t)"] = wt, memory
        ends, slope = np.append(0, wt), np.diff(msd, prepend=0) / np.diff(time, prepend=0)
        curves["D_displacement(t)"] = (ends[1:] + ends[:-1]) / 2, slope / 4
    return curves


def analysed(runs: list[Run], skip: float | None) -> Found:
    """All that runs at one packing fraction say."""
    frames = [later(run, skip) for run in runs]
    lag, members, forms = diffusion_lag(runs, frames), [], []
    for run, own in zip(runs, frames, strict=True):
        psi = [bond_order(run, k) for k in some(own)]
        members.append(numbers(run, own, psi, lag))
        forms.append(shapes(run, some(own), psi))
    curves = motion(runs, frames)
    for name, edges in bins(runs[0]).items():
        y = estimate([form[name] for form in forms]).mean
        known = np.isfinite(y)
        curves[name] = ((edges[1:] + edges[:-1]) / 2)[known], y[known]
    named = {name: [one[name] for one in members] for name in members[0]}
    step = (runs[0].time[1] - runs[0].time[0]) / np.mean([mean_free_time(run) for run in runs])
    return Found(named, curves, float(lag * step))


def table(groups: list, results: list[Found]) -> list[dict]:
    """A row per packing fraction."""
    rows = []
    for (eta, runs), found in zip(groups, results, strict=True):
        row = {"packing": eta, "runs": len(runs), "D_time": found.lag}
        for name in ("D_displacement", "D_velocities", "psi6_local", "psi6_global"):
            members = found.members.get(name)
            row |= measured(name, combined(members) if members else None)
        row["D_enskog"] = enskog(runs[0])[0] if equal_disks(runs[0]) else None
        rows.append(row | {"g_first_bin": float(found.curves["g"][1][0])})
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
            {"what": what, "packing": eta, "x": float(x), "y": float(y), "error": None}
            for what, curve in found.curves.items()
            for x, y in zip(*curve, strict=True)
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


def draw_group(panels: dict[str, plt.Axes], found: Found, row: dict, colour: str) -> None:
    """One packing fraction in all panels."""
    line = {"color": colour, "lw": 1}
    label, (wt, vacf) = f"η = {row['packing']:.3g}", found.curves["vacf"]
    panels["vacf"].plot(wt, vacf, marker=".", label=label, **line)
    panels["tail"].plot(wt[vacf > 0], vacf[vacf > 0], marker=".", **line)
    if "vacf_tail" in found.curves:
        late = wt > 3
        panels["tail"].plot(wt[late], found.curves["vacf_tail"][1][late], ls="--", **line)
    spread = ""
    if row["D_displacement"]:
        spread = f"{label},  D = {row['D_displacement']:.4g} ± {row['D_displacement_error']:.2g}"
    panels["msd"].plot(*found.curves["msd"], marker=".", label=spread, **line)
    for name, marker in (("D_displacement(t)", "."), ("D_velocities(t)", "x")):
        if name in found.curves:
            x, y = found.curves[name]
            panels["D"].plot(x, y / (row["D_enskog"] or y.max()), marker=marker, ms=4, **line)
    for name in ("a2", "S", "g"):
        if name in found.curves:
            panels[name].plot(*found.curves[name], **line)
    r, g6 = found.curves["g6"]
    order = f"{label},  ψ₆ {row['psi6_local']:.2f} of a disk, {row['psi6_global']:.2f} of all"
    panels["g6"].plot(r[g6 > 0], g6[g6 > 0], marker=".", label=order, **line)


def draw(groups: list[tuple[float, list[Run]]], results: list[Found], rows: list[dict]):
    """Eight panels: motion above, structure below."""
    figure, axes = plt.subplots(2, 4, figsize=(18, 8.5))
    panels = dict(zip(AXES, axes.flat, strict=True))
    for found, row, colour in zip(results, rows, colours(len(rows)), strict=True):
        draw_group(panels, found, row, colour)
    for name, style in AXES.items():
        panels[name].set(**{"xlabel": "$w\\,t$", **style})
    wt = np.geomspace(min(f.curves["vacf"][0][0] for f in results), 5, 200)
    if equal_disks(groups[0][1][0]):
        panels["vacf"].plot(wt, np.exp(-wt), color="black", ls="--", lw=1, label="$e^{-wt}$")
        panels["tail"].plot([], [], color="black", ls="--", lw=1, label="mode coupling, $1/t$")
    else:
        panels["D"].set_ylabel("$D(t)$ / its largest value")
    panels["D"].plot([], [], color="black", marker=".", label="from displacements")
    panels["D"].plot([], [], color="black", marker="x", label="from velocities")
    start = min(found.curves["a2"][1][0] for found in results)
    if start < -0.4 and equal_disks(groups[0][1][0]):
        dilute_limit(panels["a2"], RELAXATION)
    for name, level in (("vacf", 0), ("D", 1), ("a2", 0), ("g", 1), ("S", 1)):
        panels[name].axhline(level, color="0.6", lw=0.8, zorder=0)
    panels["tail"].set_ylim(1e-4, 1.2)
    panels["g6"].set_ylim(1e-5, 30)
    for name in ("g", "S", "D"):
        panels[name].set_ylim(0, None)
    for name in ("vacf", "tail", "msd", "D", "a2", "g6"):
        if panels[name].get_legend_handles_labels()[0]:
            panels[name].legend()
    figure.suptitle(caption([run for _, runs in groups for run in runs]), fontsize=10)
    return figure


def main() -> None:
    args = command_line(__doc__, "correlations.png", skip=None).parse_args()
    runs = read_all(args.runs)
    for run in runs:
        check(run, runs[0])
    groups = grouped(runs, lambda run: round(packing(run), 6))
    results = [analysed(members, args.skip) for _, members in groups]
    rows = table(groups, results)
    title = "Correlations in a gas of hard disks"
    data, said = curves(groups, results), notes(groups, results)
    report(args, runs, title, draw(groups, results, rows), rows, data=data, notes=said)


if __name__ == "__main__":
    launch(main)
