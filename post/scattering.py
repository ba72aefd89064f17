"""Scattering angle against impact parameter, on the exact curve.

    python post/scattering.py runs/scattering/*.h5 -o scattering.png --csv scattering.csv

Each run holds two disks, one at rest; b is the distance of the line of flight from the rest disk's
centre, positive on its left, R12 = r1 + r2.  The angle is that between the moving disk's first and
last velocity.  Exact for a finite mass ratio M = m1 / m2 and restitution xi, kappa =
(1 + xi) / 2 * M / (1 + M), s = b / R12, c^2 = 1 - s^2:
    tan theta = 2 kappa s c / (1 - 2 kappa c^2);   M infinite and xi = 1:  theta = 2 acos(s).
"""

from typing import NamedTuple

from ricochet import Run, RunError
from ricochet.drawing import COLOURS, plt
from ricochet.script import command_line, launch, read_all, report
from ricochet.theory import scattering_angle

import numpy as np


class Scattering(NamedTuple):
    """What one run says."""

    impact: float  # b / R12, with its sign
    angle: float  # [rad]
    speed_change: float  # speed' / speed - 1
    mass_ratio: float  # at rest over moving


def scattering(run: Run) -> Scattering:
    """Impact parameter and deflection of the disk that moves at the start."""
    before, after = run.velocity[0], run.velocity[-1]
    moving = np.flatnonzero(np.any(before != 0, axis=1))
    if run.count != 2 or len(moving) != 1:
        raise RunError(f"{run.path}: needs two disks, one of them at rest")
    i, k = moving[0], 1 - moving[0]
    v, w = before[i], after[i]
    gap = run.position[0][k] - run.position[0][i]
    impact = (v[1] * gap[0] - v[0] * gap[1]) / np.hypot(*v) / run.radius.sum()
    angle = np.arctan2(abs(v[0] * w[1] - v[1] * w[0]), v @ w)
    change = np.hypot(*w) / np.hypot(*v) - 1
    return Scattering(impact, angle, change, run.mass[k] / run.mass[i])


def draw(points: list[Scattering], restitution: float) -> plt.Figure:
    """The angle above, its difference from the exact one below."""
    s, angle = np.array([(p.impact, p.angle) for p in points]).T
    ratio = points[0].mass_ratio
    figure, (top, bottom) = plt.subplots(
        2, 1, sharex=True, figsize=(6, 6), height_ratios=(3, 1), constrained_layout=True
    )
    end = max(1.2, np.abs(s).max())
    fine = np.linspace(-end if s.min() < 0 else 0, end, 2401)
    exact = f"exact, $m_1/m_2$ = {ratio:,.7g}, ξ = {restitution:g}"
    top.plot(
        fine,
        np.degrees(scattering_angle(fine, ratio, restitution)),
        color="black",
        lw=1.2,
        label=exact,
    )
    if restitution == 1:
        top.plot(
            fine,
            np.degrees(scattering_angle(fine)),
            color=COLOURS[4],
            lw=1.2,
            ls="--",
            label="$m_1/m_2 = \\infty$: $2\\arccos(|b|/R_{12})$",
        )
    top.plot(
        s,
        np.degrees(angle),
        ls="",
        marker="o",
        mfc="none",
        color=COLOURS[0],
        label=f"simulation, {len(points)} runs",
    )
    top.set(ylabel="scattering angle θ (degrees)", ylim=(-5, 185), yticks=range(0, 181, 30))
    top.legend()
    error = np.abs(np.degrees(angle - scattering_angle(s, ratio, restitution)))
    bottom.semilogy(s, np.maximum(error, 1e-16), ls="", marker=".", color=COLOURS[0])
    bottom.set(
        xlabel="impact parameter $b/R_{12}$",
        ylabel="|error| (degrees)\n(0 drawn at $10^{-16}$)",
        ylim=(1e-17, 30 * max(error.max(), 1e-16)),
    )
    return figure


def main() -> None:
    args = command_line(__doc__, "scattering.png").parse_args()
    runs = read_all(args.runs)
    points = sorted(scattering(run) for run in runs)
    restitution = runs[0].restitution
    table = []
    for p in points:
        exact = scattering_angle(p.impact, p.mass_ratio, restitution)
        row = {"b_over_R12": p.impact, "angle_degrees": float(np.degrees(p.angle))}
        row |= {"exact_degrees": float(np.degrees(exact))}
        row |= {"error_degrees": float(np.degrees(abs(p.angle - exact)))}
        table.append(row | {"speed_change": p.speed_change})
    report(args, runs, "Scattering angle", draw(points, restitution), table)


if __name__ == "__main__":
    launch(main)
