"""Scattering angle against impact parameter, compared with the exact result.

    python post/scattering.py runs/scattering/*.h5 -o scattering.png --csv scattering.csv

Each run contains two disks, one of which is at rest at the start.  The impact parameter b is the
distance between the path of the moving disk and the centre of the disk at rest.  The sign of b is
positive if the moving disk passes on the left.  R12 = r1 + r2 is the sum of the radii.  The
scattering angle is the angle between the initial and the final velocity of the moving disk.  Let M
be the mass of the disk at rest divided by the mass of the moving disk, xi the coefficient of
restitution, s = b / R12, c^2 = 1 - s^2, and kappa = (1 + xi) / 2 * M / (1 + M).  For finite M the
exact scattering angle is given by the following formula:

    tan theta = 2 kappa s c / (1 - 2 kappa c^2).

For infinite M and xi = 1, the scattering angle is theta = 2 acos(s).
"""

from ricochet import Run
from ricochet.figures.drawing import COLOURS, plt
from ricochet.predictions.theory import scattering_angle
from ricochet.reading.nature import Refused, allow
from ricochet.script import command_line, launch, report

import numpy as np


def moving_and_resting(run: Run) -> tuple[int, int]:
    """Return the indices of the disk that moves at the start and of the disk that is at rest."""
    moving = np.flatnonzero(run.speed(0))
    if run.n_disks != 2 or len(moving) != 1:
        raise Refused(f"{run.path}: needs two disks, one of them at rest")
    return moving[0], 1 - moving[0]


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


def draw(rows: list[dict], ratio: float, restitution: float) -> plt.Figure:
    """Draw the scattering angle, and its deviation from the exact angle for this mass ratio."""
    names = ("b_over_R12", "angle_degrees", "error_degrees")
    s, angle, error = (np.array([row[name] for row in rows]) for name in names)
    figure, (top, bottom) = plt.subplots(2, 1, sharex=True, figsize=(6, 6), height_ratios=(3, 1))
    end = max(1.2, np.abs(s).max())
    fine = np.linspace(-end if s.min() < 0 else 0, end, 2401)
    label = f"exact, mass ratio {ratio:,.7g}, ξ = {restitution:g}"
    exact = np.degrees(scattering_angle(fine, ratio, restitution))
    top.plot(fine, exact, color="black", lw=1.2, label=label)
    if restitution == 1:
        label, heavy = "infinite mass ratio: $2\\arccos(|b|/R_{12})$", scattering_angle(fine)
        top.plot(fine, np.degrees(heavy), color=COLOURS[4], lw=1.2, ls="--", label=label)
    label = f"simulation, {len(rows)} runs"
    top.plot(s, angle, ls="", marker="o", mfc="none", color=COLOURS[0], label=label)
    top.set(ylabel="scattering angle θ (degrees)", ylim=(-5, 185), yticks=range(0, 181, 30))
    top.legend()
    bottom.semilogy(s, np.maximum(error, 1e-16), ls="", marker=".", color=COLOURS[0])
    bottom.set(xlabel="impact parameter $b/R_{12}$", ylim=(1e-17, 30 * max(error.max(), 1e-16)))
    bottom.set_ylabel("|error| (degrees)\n(0 drawn at $10^{-16}$)")
    return figure


def main() -> None:
    args = command_line(__doc__, "scattering.png").parse_args()
    rows = sorted(map(scattering, args.runs), key=lambda row: row["b_over_R12"])
    first = args.runs[0]
    moving, resting = moving_and_resting(first)
    figure = draw(rows, first.mass[resting] / first.mass[moving], first.restitution)
    notes = [
        f"{run.path.name}: a collision with a side changed the angle; stop the run before"
        for run in args.runs
        if run.observable("side_collisions").value[-1].any()
    ]
    report(args, figure, rows, notes=notes)


if __name__ == "__main__":
    launch(main)
