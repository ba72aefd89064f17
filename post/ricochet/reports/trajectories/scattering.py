"""Scattering angle against impact parameter, compared with the exact result."""

from itertools import cycle
from types import SimpleNamespace

import numpy as np

from ...figures.drawing import COLOURS, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...predictions.theory import scattering_angle
from ...reading.files import counted
from ...reading.nature import Refused, allow
from ...reading.reader import Run
from ..groups import Group, each_run
from ..registry import Analysis
from ..result import Result


def moving_and_resting(run: Run) -> tuple[int, int]:
    """Return the indices of the initially moving and of the resting disk."""
    moving = np.flatnonzero(run.speed(0))
    if run.n_disks != 2 or len(moving) != 1:
        raise Refused(f"{run.path}: needs two disks, one of them at rest")
    return moving[0], 1 - moving[0]


def law_of(run: Run) -> tuple[float, float]:
    """Return the mass ratio (resting over moving disk), and the coefficient of restitution."""
    moving, resting = moving_and_resting(run)
    return float(run.mass[resting] / run.mass[moving]), run.restitution


def scattering(run: Run) -> dict[str, float]:
    """Return the impact parameter and the scattering angle of the moving disk."""
    law = "the exact law is for two smooth disks without gravity and driving"
    allow(run, law, "walls", "inelastic", "rotating", "mixture")
    i, k = moving_and_resting(run)
    v, w = run.velocity[0][i], run.velocity[-1][i]
    gap = run.position[0][k] - run.position[0][i]
    impact = (v[1] * gap[0] - v[0] * gap[1]) / np.hypot(*v) / run.radius.sum()
    angle = np.arctan2(abs(v[0] * w[1] - v[1] * w[0]), v @ w)
    exact = scattering_angle(impact, run.mass[k] / run.mass[i], run.restitution)
    return {
        "b_over_R12": impact,
        "angle_degrees": float(np.degrees(angle)),
        "exact_degrees": float(np.degrees(exact)),
        "error_degrees": float(np.degrees(abs(angle - exact))),
        "speed_change": np.hypot(*w) / np.hypot(*v) - 1,
    }


def draw_angles(axes: plt.Axes, result: Result) -> None:
    """Plot the scattering angle, with the exact angle for each mass ratio and restitution."""
    s, angle = column(result, "b_over_R12"), column(result, "angle_degrees")
    end = max(1.2, np.abs(s).max())
    fine = np.linspace(-end if s.min() < 0 else 0, end, 2401)
    for (ratio, restitution), style in zip(result.values, cycle(("-", ":", "-.")), strict=False):
        label = f"exact, mass ratio {ratio:,.7g}, ξ = {restitution:g}"
        exact = np.degrees(scattering_angle(fine, ratio, restitution))
        axes.plot(fine, exact, color="black", ls=style, lw=1.2, label=label)
    if all(restitution == 1 for _, restitution in result.values):
        label, heavy = "infinite mass ratio", scattering_angle(fine)
        axes.plot(fine, np.degrees(heavy), color=COLOURS[4], lw=1.2, ls="--", label=label)
    label = f"simulation, {counted(len(s), 'run')}"
    axes.plot(s, angle, ls="", marker="o", mfc="none", color=COLOURS[0], label=label)
    axes.set(ylabel="scattering angle θ (degrees)", ylim=(-5, 185), yticks=range(0, 181, 30))
    axes.set_xlabel("impact parameter $b/R_{12}$")
    legend_above(axes)


def draw_errors(axes: plt.Axes, result: Result) -> None:
    """Plot the deviation of the scattering angle from the exact angle."""
    s, error = column(result, "b_over_R12"), column(result, "error_degrees")
    axes.semilogy(s, np.maximum(error, 1e-16), ls="", marker=".", color=COLOURS[0])
    axes.set(xlabel="impact parameter $b/R_{12}$", ylabel="|error| (degrees)")
    axes.set_ylim(1e-17, 30 * max(error.max(), 1e-16))


def column(result: Result, name: str) -> np.ndarray:
    """Return a column of the table."""
    return np.array([row[name] for row in result.table])


def draw(result: Result) -> Sheet:
    """Plot the scattering angle and its deviation from the exact angle."""
    angles = Panel("angles", draw_angles, (result,), aspect=0.6)
    return Sheet([[angles], [Panel("errors", draw_errors, (result,), 0.3, share_x="angles")]])


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return the scattering angles in increasing order of the impact parameter."""
    runs = groups[0].runs
    rows = sorted(map(scattering, runs), key=lambda row: row["b_over_R12"])
    warnings = [
        f"{run.label}: a collision with a side changed the angle; stop the run before"
        for run in runs
        if run.observable("side_collisions").value[-1].any()
    ]
    laws = sorted({law_of(run) for run in runs})
    notes = ["An error of 0 is drawn at 1e-16 degrees."]
    return Result(rows, notes=notes, warnings=warnings, values=laws)


ANALYSIS = Analysis(compute, draw, averages=each_run)
