"""How a gas forgets, spreads and orders: VACF, mean square displacement, a2, g(r), psi6.

    python post/correlations.py runs/state/memory_*.h5 -o correlations.png --csv correlations.csv

Runs are combined by packing fraction; lines are means over the runs.  Frames must be equally far
apart in time; lags are logarithmic, every frame is an origin.  Frames before equilibrium, which is
found or begins after --skip, count for a2 alone.  Times are in units of the
mean free time 1/w, lengths of the mean diameter.  At first the VACF falls as exp(-w t); the
displacement is compared with Enskog's D; a2 = <v^4> / (2 <v^2>^2) - 1 is 0 in equilibrium and -1/2
for equal speeds; psi6 = mean of exp(6 i theta) over the Delaunay neighbours, its modulus for single
disks and for all: 1 in a perfect triangular crystal.
"""

from collections.abc import Callable

from ricochet import Run, RunError, hard_disks
from ricochet.drawing import COLOURS, caption, dilute_limit, plt
from ricochet.script import command_line, grouped, launch, read_all, report
from ricochet.statistics import estimate, excess_kurtosis
from ricochet.theory import RELAXATION
from ricochet.thermodynamics import packing, start_of_equilibrium, temperature

import numpy as np
import scipy

MOST_FRAMES = 50  # for g(r) and psi6


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


def check_frames(run: Run) -> None:
    """Equal intervals of time, or the lags mean nothing; the last frame may be out of step."""
    steps = np.diff(run.time[:-1] if run.frames > 2 else run.time)
    if run.frames < 10 or np.ptp(steps) > 1e-6 * steps[0]:
        raise RunError(f"{run.path}: needs 10 frames and more, written by frames_every_time")


def later(run: Run, skip: float | None) -> slice:
    """Frames in equilibrium, without the last, which may be out of step."""
    first = int(np.searchsorted(run.time, start_of_equilibrium(run, skip)))
    if run.frames - 1 - first < 2:
        raise RunError(f"{run.path}: needs more frames in equilibrium")
    return slice(first, run.frames - 1)


def velocity_memory(run: Run, at: np.ndarray, skip: float | None = None) -> np.ndarray:
    """Normalised velocity autocorrelation at lags in frames."""
    v = run.velocity[later(run, skip)]
    return np.array([np.mean(v[k:] * v[: len(v) - k]) for k in at]) / np.mean(v**2)


def displacement(run: Run, at: np.ndarray, skip: float | None = None) -> np.ndarray:
    """Mean square displacement at lags in frames, relative to the centre of mass."""
    x = run.unwrapped(later(run, skip))
    x = x - np.average(x, axis=1, weights=run.mass, keepdims=True)
    return np.array([2 * np.mean((x[k:] - x[: len(x) - k]) ** 2) for k in at])


def frames_of(run: Run) -> np.ndarray:
    """At most `MOST_FRAMES`, from the later half."""
    return np.unique(np.linspace(run.frames // 2, run.frames - 1, MOST_FRAMES).astype(int))


def pair_correlation(run: Run, edges: np.ndarray) -> np.ndarray:
    """g(r) in bins, `edges` in mean diameters; between walls only about disks far from them."""
    r = edges * 2 * run.radius.mean()
    size = np.where(run.periodic, run.edges, 0.0)
    sums = np.zeros(len(edges) - 1)
    centres = 0
    for k in frames_of(run):
        x = run.position[k] - run.lower
        margin = np.where(run.periodic, -np.inf, r[-1])
        inner = np.all((x > margin) & (x < run.edges - margin), axis=1)
        tree, part = (scipy.spatial.cKDTree(p, boxsize=size) for p in (x, x[inner]))
        sums += np.diff(part.count_neighbors(tree, r))
        centres += inner.sum()
    density = (run.count - 1) / np.prod(run.edges)
    return sums / np.maximum(centres, 1) / (density * np.pi * np.diff(r**2))


def bond_order(run: Run, frame: int) -> np.ndarray:
    """(N,) complex psi6 of each disk, over its Delaunay neighbours."""
    x = run.position[frame]
    near = 4 * np.sqrt(np.prod(run.edges) / run.count)
    points = padded(x, run, near)
    start, neighbours = scipy.spatial.Delaunay(points).vertex_neighbor_vertices
    centre = np.repeat(np.arange(len(points)), np.diff(start))
    inside = centre < run.count
    bonds = points[neighbours[inside]] - points[centre[inside]]
    turns = np.exp(6j * np.arctan2(bonds[:, 1], bonds[:, 0]))
    sums = np.bincount(centre[inside], turns.real, run.count) + 1j * np.bincount(
        centre[inside], turns.imag, run.count
    )
    return sums / np.bincount(centre[inside], minlength=run.count)


def padded(x: np.ndarray, run: Run, width: float) -> np.ndarray:
    """The points, then their periodic copies within `width` of the box."""
    points = x
    for axis in np.flatnonzero(run.periodic):
        shift = np.where(np.arange(2) == axis, run.edges, 0.0)
        low = points[:, axis] < run.lower[axis] + width
        high = points[:, axis] > run.upper[axis] - width
        points = np.concatenate([points, points[low] + shift, points[high] - shift])
    return points


def order(run: Run) -> tuple[float, float]:
    """Mean |psi6| of single disks, and |mean psi6| of all; over frames."""
    values = [bond_order(run, k) for k in frames_of(run)]
    return float(np.mean(np.abs(values))), float(np.mean([abs(v.mean()) for v in values]))


def kurtosis(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Collisions per disk and a2 of the frames."""
    a2 = np.array([excess_kurtosis(run.speed(k)) for k in range(run.frames)])
    return run.collisions_per_disk_at(run.time), a2


def diffusion_law(run: Run, time: np.ndarray) -> np.ndarray:
    """4 D_E t by Enskog; NaN where the equation of state of the fluid ends."""
    eta = packing(run)
    z = float(hard_disks.simulated(eta))
    diameter = 2 * run.radius.mean()
    return (
        4 * time * hard_disks.enskog_diffusion(z, eta, diameter, temperature(run), run.mass.mean())
    )


def mean_over(runs: list[Run], measure: Callable[[Run], np.ndarray]) -> np.ndarray:
    return estimate([measure(run) for run in runs]).mean


def analysed(runs: list[Run], skip: float | None) -> dict[str, np.ndarray]:
    """All curves of runs at one packing fraction."""
    for run in runs:
        check_frames(run)
    first = runs[0]
    at = lags(min(len(range(run.frames)[later(run, skip)]) for run in runs))
    reach = min(4.0, 0.45 * first.edges.min() / (2 * first.radius.mean()))
    edges = np.linspace(1, reach, 121)
    time = at * (first.time[1] - first.time[0])
    free = float(np.mean([mean_free_time(run) for run in runs]))
    diameter = 2 * first.radius.mean()
    tau, _ = kurtosis(first)
    tau = tau[: max(1, *(later(run, skip).start + 1 for run in runs))]
    return {
        "wt": time / free,
        "vacf": mean_over(runs, lambda run: velocity_memory(run, at, skip)),
        "msd": mean_over(runs, lambda run: displacement(run, at, skip)) / diameter**2,
        "enskog": diffusion_law(first, time) / diameter**2,
        "tau": tau,
        "a2": mean_over(runs, lambda run: kurtosis(run)[1][: len(tau)]),
        "r": (edges[1:] + edges[:-1]) / 2,
        "g": mean_over(runs, lambda run: pair_correlation(run, edges)),
        "psi6": mean_over(runs, lambda run: np.array(order(run))),
    }


def draw(groups: list[tuple[float, list[Run]]], results: list[dict]) -> plt.Figure:
    """Four panels: VACF, displacement, a2, g(r)."""
    figure, panels = plt.subplots(2, 2, figsize=(11, 8.5))
    (vacf, msd), (a2, pairs) = panels
    for (eta, _), found, colour in zip(groups, results, COLOURS, strict=False):
        label = f"η = {eta:.3g}"
        vacf.plot(found["wt"], found["vacf"], color=colour, marker=".", lw=1, label=label)
        msd.plot(found["wt"], found["msd"], color=colour, marker=".", lw=1)
        msd.plot(found["wt"], found["enskog"], color=colour, ls="--", lw=1)
        a2.plot(found["tau"], found["a2"], color=colour, lw=1)
        local, of_all = found["psi6"]
        pairs.plot(
            found["r"], found["g"], color=colour, lw=1,
            label=f"{label},  ψ₆ {local:.2f} of a disk, {of_all:.2f} of all",
        )  # fmt: skip
    wt = np.geomspace(min(f["wt"][0] for f in results), 5, 200)
    vacf.plot(wt, np.exp(-wt), color="black", ls="--", lw=1, label="$e^{-wt}$")
    msd.plot([], [], color="black", ls="--", lw=1, label="$4 D_E t$, Enskog")
    vacf.axhline(0, color="0.6", lw=0.8, zorder=0)
    vacf.set(xscale="log", xlabel="$w\\,t$", ylabel="velocity autocorrelation")
    msd.set(
        xscale="log",
        yscale="log",
        xlabel="$w\\,t$",
        ylabel="mean square displacement / $\\sigma^2$",
    )
    if min(found["a2"][0] for found in results) < -0.4:
        dilute_limit(a2, RELAXATION)
        a2.legend(loc="lower right")
    a2.axhline(0, color="0.6", lw=0.8, zorder=0)
    a2.set(xlabel="collisions per disk", ylabel="$a_2$ (0: Maxwell)", xlim=(0, None))
    pairs.axhline(1, color="0.6", lw=0.8, zorder=0)
    pairs.set(xlabel="$r\\,/\\,\\sigma$", ylabel="pair correlation $g(r)$", ylim=(0, None))
    for axes, place in ((vacf, "upper right"), (msd, "lower right"), (pairs, "upper right")):
        axes.legend(loc=place)
    figure.suptitle(caption([run for _, runs in groups for run in runs]), fontsize=10)
    return figure


def curves(groups: list, results: list[dict]) -> list[dict]:
    """All curves, one below the other."""
    return [
        {"what": what, "packing": eta, "x": float(x), "y": float(y)}
        for (eta, _), found in zip(groups, results, strict=True)
        for what, abscissa in (("vacf", "wt"), ("msd", "wt"), ("a2", "tau"), ("g", "r"))
        for x, y in zip(found[abscissa], found[what], strict=False)
    ]


def table(groups: list, results: list[dict]) -> list[dict]:
    """A row per packing fraction: order at contact and of the bonds."""
    rows = []
    for (eta, members), found in zip(groups, results, strict=True):
        local, of_all = map(float, found["psi6"])
        row = {"packing": eta, "runs": len(members), "g_first_bin": float(found["g"][0])}
        rows.append(row | {"psi6_local": local, "psi6_global": of_all})
    return rows


def main() -> None:
    args = command_line(__doc__, "correlations.png", skip=None).parse_args()
    runs = read_all(args.runs)
    groups = grouped(runs, lambda run: round(packing(run), 6))
    results = [analysed(members, args.skip) for _, members in groups]
    figure, rows = draw(groups, results), table(groups, results)
    title = "Correlations in a gas of hard disks"
    report(args, runs, title, figure, rows, data=curves(groups, results))


if __name__ == "__main__":
    launch(main)
