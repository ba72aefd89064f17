"""Diffusion of a tracer among fixed, randomly placed circles (random Lorentz gas)."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from ...analysis.estimates import estimate
from ...figures.drawing import COLOURS, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...reading.nature import allow
from ...reading.reader import Run, RunError
from ..groups import Group, grouped
from ..options import Option
from ..registry import Analysis
from ..result import Result
from ..tables import measured


def expansion(density: np.ndarray | float, squared: bool = True) -> np.ndarray:
    """Return D / D_0 from the density expansion, with or without its last term."""
    n = np.asarray(density, dtype=float)
    logarithm = n * np.log(n)
    return 1 / (1 - 4 / 3 * logarithm - 0.8775 * n + squared * 4.519 * logarithm**2)


def density_of(run: Run) -> float:
    """Return the reduced density n R^2 of a run of one disk among equal circular obstacles."""
    allow(run, "the Lorentz gas consists of one disk among fixed circles", "obstacles")
    radii = np.unique([obstacle.radius for obstacle in run.obstacles])
    inside = any(obstacle.inside or obstacle.is_arc for obstacle in run.obstacles)
    if run.n_disks != 1 or len(run.walls) or len(radii) != 1 or inside or not all(run.periodic):
        raise RunError(f"{run.path}: needs one disk among equal circles in a periodic box")
    reach = float(run.radius[0] + radii[0])
    return round(len(run.obstacles) * reach**2 / float(np.prod(run.edges)), 12)


def diffusion(run: Run, lags: tuple[float, float]) -> dict[str, float]:
    """Return D / D_0 measured between two lags, and the mean free time divided by 1/(2 n R v)."""
    speed = float(run.speed(0)[0])
    reach = float(run.radius[0] + run.obstacles[0].radius)
    free = reach / (2 * density_of(run) * speed)
    time = run.time[:-1]  # the last frame is at the end of the run
    step = float(time[1] - time[0]) if len(time) > 1 else np.inf
    first, last = (max(1, round(lag * free / step)) for lag in lags)
    if not first < last < len(time) / 4 or not np.allclose(np.diff(time), step, rtol=1e-6):
        raise RunError(f"{run.path}: needs more frames, at equal steps of at most a lag")
    place = run.unwrapped(slice(len(time)))[:, 0]
    near, far = (np.mean(np.sum((place[k:] - place[:-k]) ** 2, axis=1)) for k in (first, last))
    events = float(run.observable("obstacle_collisions").value[-1])
    return {
        "diffusion": float(far - near) / (4 * (last - first) * step) / (3 / 8 * free * speed**2),
        "free_time": float(run.time[-1]) / events / free,
    }


def by_density(runs: list[Run]) -> list[tuple[float, list[Run]]]:
    """Group runs with the same reduced density."""
    return grouped(runs, density_of)


def draw_diffusion(axes: plt.Axes, result: Result) -> None:
    """Plot D / D_0 against the density, with the Boltzmann limit and the density expansion."""
    n, ratio, error = (
        np.array([row[name] for row in result.table], dtype=float)
        for name in ("density", "diffusion", "diffusion_error")
    )
    fine = np.geomspace(n.min() / 2, n.max() * 1.3, 300)
    axes.axhline(1, color="0.5", lw=1, ls=":", label="Boltzmann")
    label = r"$D_0/D = 1 - \frac{4}{3} n\,\ln n - 0.8775\,n$"
    axes.plot(fine, expansion(fine, squared=False), color=COLOURS[1], lw=1.2, label=label)
    label = r"$\dots + 4.519\,(n\,\ln n)^2$"
    axes.plot(fine, expansion(fine), color=COLOURS[2], lw=1.2, ls="--", label=label)
    axes.errorbar(n, ratio, error, ls="", marker="o", color=COLOURS[0], label="simulation")
    axes.set(xscale="log", xlabel="density of scatterers $n$, for $R = 1$", ylabel="$D/D_0$")
    legend_above(axes)


def draw(result: Result) -> Sheet:
    """Plot the diffusion coefficient."""
    return Sheet([[Panel("diffusion", draw_diffusion, (result,), aspect=0.6)]])


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return the diffusion coefficient and the mean free time at each density."""
    rows = []
    for group in groups:
        found = [diffusion(run, tuple(options.lags)) for run in group.runs]
        row: dict[str, Any] = {"density": group.key, "runs": len(group.runs)}
        for name in ("diffusion", "free_time"):
            row |= measured(name, estimate([one[name] for one in found]))
        row["expansion"] = float(expansion(group.key))
        row["without_last_term"] = float(expansion(group.key, squared=False))
        rows.append(row)
    return Result(rows, notes=["Bars: standard errors of the mean over the runs."])


MEANING = "two lags between which D is measured, in mean free times [10 30]"
LAGS = Option("lags", MEANING, (10.0, 30.0), float, ("FROM", "TO"), number=2)
# Their positions are random, as if they depended on the seed.
PLACES = ("obstacle", "obstacle_rows", "position", "velocity")
ANALYSIS = Analysis(compute, draw, options=(LAGS,), group_by=by_density, may_differ=PLACES)
