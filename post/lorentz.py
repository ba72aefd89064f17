"""Diffusion of a tracer among fixed, randomly placed circles (random Lorentz gas).

    python post/lorentz.py runs/lorentz/runs/*.h5 -o lorentz.png --csv lorentz.csv

Each run contains one disk in a periodic box with equal circular obstacles, and has frames at equal
intervals of time.  The reduced density is n R^2, where n is the number of obstacles per unit of
area, and R the sum of the radii of disk and obstacle.  The diffusion coefficient D is a quarter of
the slope of the mean square displacement between the two values of --lags, in units of the mean
free time.  Between the two values of --lags the slope is nearly constant, because the velocity
autocorrelation at these lags is small; the velocity autocorrelation is negative and decays as
1/t^2. Runs with the same density are combined, and the error is the standard error of the mean.

The figure shows D / D_0. The Boltzmann equation, which is exact in the limit of low density, yields
the diffusion coefficient D_0 = 3 v / (16 n R).  The curves show the density expansion
by van Leeuwen and Weijland, Physica 36, 457 (1967) and 38, 35 (1968), for scatterers that may
overlap, with and without the last term:

    D_0/D = 1 - (4/3) nR^2 ln(nR^2) - 0.8775 nR^2 + 4.519 (nR^2 ln(nR^2))^2.

The coefficients of the expansion are quoted from memory; they have not been compared with the
papers by van Leeuwen and Weijland.  The mean free time is 1/(2 n R v) exactly, at every density.
The table contains the ratio of the measured mean free time to 1/(2 n R v).
"""

from ricochet import Run, RunError
from ricochet.analysis.statistics import estimate
from ricochet.figures.drawing import COLOURS, plt
from ricochet.reading.nature import allow
from ricochet.script import command_line, grouped, launch, measured, report

import numpy as np


def expansion(density: np.ndarray | float, squared: bool = True) -> np.ndarray:
    """Return D / D_0 from the expansion in the density, with or without its last term."""
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
    """Return D / D_0, measured between two lags, and the mean free time divided by 1/(2 n R v)."""
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


def draw(rows: list[dict]) -> plt.Figure:
    """Draw D / D_0 against the density, with the Boltzmann limit and the density expansion."""
    figure, axes = plt.subplots(figsize=(6.5, 4.5))
    n, ratio, error = (
        np.array([row[name] for row in rows], dtype=float)
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
    axes.legend(loc="lower left")
    return figure


def main() -> None:
    parser = command_line(__doc__, "lorentz.png")
    parser.add_argument(
        "--lags",
        type=float,
        nargs=2,
        default=(10.0, 30.0),
        metavar=("FROM", "TO"),
        help="two lags between which D is measured, in mean free times [10 30]",
    )
    args = parser.parse_args()
    rows = []
    for density, runs in grouped(args.runs, density_of):
        found = [diffusion(run, tuple(args.lags)) for run in runs]
        row: dict = {"density": density, "runs": len(runs)}
        for name in ("diffusion", "free_time"):
            row |= measured(name, estimate([one[name] for one in found]))
        row["expansion"] = float(expansion(density))
        row["without_last_term"] = float(expansion(density, squared=False))
        rows.append(row)
    report(args, draw(rows), rows)


if __name__ == "__main__":
    launch(main)
