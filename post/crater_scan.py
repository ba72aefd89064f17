"""Crater size against the projectile's mass, speed and radius, and against restitution.

    python post/crater_scan.py runs/crater_scan/*.h5 -o crater_scan.png --csv crater_scan.csv

The four parameters are read from each run.  The most frequent value of each is the base; a run
belongs to the scan of a parameter if the other three are at the base.  Points: means over the
runs, bars: standard errors.  Lines: weighted fits of size = A x^p (x = 1 - xi^2 for the
restitution, the fraction of normal energy lost in a collision).  Only what varies is drawn.  Open
symbols are left out of the fit: the box takes part (wall hits are more than 1 % of the number of
disks), or some of the runs ended by time, with more energy left than `stop.energy_fraction`.
"""

from typing import NamedTuple

from ricochet import Run
from ricochet.crater import (
    Crater,
    bed,
    box_takes_part,
    crater,
    ended_by_time,
    energy_fraction,
    projectile,
)
from ricochet.drawing import COLOURS, caption, panel_grid, plt
from ricochet.script import command_line, launch, measured, read_all, report
from ricochet.statistics import Estimate, PowerLaw, estimate, fit_power_law

import numpy as np

AXES = {
    "mass": "mass of the projectile / mass of a bed disk, $M$",
    "speed": "speed of the projectile $v$ (reduced units)",
    "radius": "radius of the projectile / radius of a bed disk, $R$",
    "restitution": "restitution ξ",
}
SYMBOLS = {"mass": "M", "speed": "v", "radius": "R", "restitution": "(1-ξ^2)"}  # fitted against
SIZES = {"hit": "disks hit", "displaced": "displaced by more than r"}
EXTENTS = {"width": "width", "depth": "depth"}


class Point(NamedTuple):
    """The craters of runs that differ by their seed."""

    x: float
    runs: int
    sizes: dict[str, Estimate]
    energy_left: float
    wall_collisions: float  # per run
    by_time: bool  # some runs ended before the energy fraction was reached
    free: bool  # neither time nor walls cut it short


def key_of(run: Run) -> tuple[float, ...]:
    """Mass ratio, speed, radius ratio, restitution."""
    tip, lying = projectile(run), np.flatnonzero(bed(run))[0]
    values = (
        run.mass[tip] / run.mass[lying],
        run.speed(0)[tip],
        run.radius[tip] / run.radius[lying],
        run.restitution,
    )
    return tuple(float(f"{value:.9g}") for value in values)


def distinct(runs: list[Run]) -> list[Run]:
    """Each combination of parameters and seed once: scans share their base."""
    return list({(key_of(run), run.seed, run.count): run for run in runs}.values())


def base_of(keys: list[tuple[float, ...]]) -> tuple[float, ...]:
    """The most frequent value of each parameter."""
    return tuple(max(sorted(set(column)), key=column.count) for column in zip(*keys, strict=True))


def scan_points(keys: list, runs: list[Run], craters: list[Crater], axis: int) -> list[Point]:
    """The scan along one parameter, all others at the base, in ascending order."""
    base = base_of(keys)
    along = [
        k
        for k, key in enumerate(keys)
        if all(key[j] == base[j] for j in range(len(key)) if j != axis)
    ]
    points = []
    for x in sorted({keys[k][axis] for k in along}):
        members = [k for k in along if keys[k][axis] == x]
        here = [craters[k] for k in members]
        sizes = {name: estimate([getattr(c, name) for c in here]) for name in SIZES | EXTENTS}
        left, hits = (
            np.array([getattr(c, name) for c in here])
            for name in ("energy_left", "wall_collisions")
        )
        by_time = any(ended_by_time(runs[k], craters[k]) for k in members)
        free = not by_time and not box_takes_part(runs[members[0]], hits.mean())
        points.append(Point(x, len(here), sizes, left.mean(), hits.mean(), by_time, free))
    return points


def abscissa(axis: str, x: np.ndarray) -> np.ndarray:
    """What a size is fitted against."""
    return 1 - np.square(x) if axis == "restitution" else np.asarray(x, dtype=float)


def fits_of(axis: str, points: list[Point]) -> dict[str, PowerLaw | None]:
    """A power law for each size."""
    points = [p for p in points if p.free]
    x = abscissa(axis, [p.x for p in points])
    return {
        name: fit_power_law(
            x, [p.sizes[name].mean for p in points], [p.sizes[name].error for p in points]
        )
        for name in SIZES | EXTENTS
    }


def draw_sizes(
    axes: plt.Axes, axis: str, points: list[Point], fits: dict, names: dict, colours: list[str]
) -> None:
    """Some of the sizes with their fits on one pair of axes."""
    x = np.array([p.x for p in points])
    free = np.array([p.free for p in points])
    for (name, title), colour, marker in zip(names.items(), colours, "osD^", strict=False):
        y = np.array([p.sizes[name].mean for p in points])
        error = np.nan_to_num([p.sizes[name].error for p in points])
        fit = fits[name]
        label = title
        if fit:
            power = f"{fit.exponent:z.2f} \\pm {fit.exponent_error:.2f}"
            label += f", $\\propto {SYMBOLS[axis]}^{{{power}}}$"
            inside = np.linspace(x[free].min(), x[free].max(), 200)
            inside = inside[abscissa(axis, inside) > 0]
            axes.plot(inside, fit(abscissa(axis, inside)), color=colour, lw=1, ls="-")
        style = {"ls": "", "marker": marker, "color": colour}
        axes.errorbar(x[free], y[free], error[free], label=label, **style)
        axes.errorbar(x[~free], y[~free], error[~free], mfc="white", **style)


def draw(scans: dict[str, list[Point]], base: tuple, runs: list[Run]) -> plt.Figure:
    """Panels for each parameter: numbers of disks above, width and depth below."""
    rows, columns = panel_grid(len(scans), 1)
    figure = plt.figure(figsize=(5.5 * max(columns, 1.3), 5.5 * rows))
    grid = figure.add_gridspec(2 * rows, columns, height_ratios=(1.3, 1) * rows)
    fraction = energy_fraction(runs[0])
    for panel, (axis, points) in enumerate(scans.items()):
        fits, row, column = fits_of(axis, points), 2 * (panel // columns), panel % columns
        numbers = figure.add_subplot(grid[row, column])
        lengths = figure.add_subplot(grid[row + 1, column], sharex=numbers)
        draw_sizes(numbers, axis, points, fits, SIZES, COLOURS[:2])
        draw_sizes(lengths, axis, points, fits, EXTENTS, COLOURS[2:4])
        if axis == "mass":
            x = np.array([p.x for p in points])
            numbers.plot(
                x,
                x * (1 / fraction - 1),
                color="0.4",
                lw=1,
                ls=":",
                label=f"least number hit, $M\\,(1/f - 1)$, $f = {fraction:g}$",
            )
        others = [
            f"{name} {value:g}"
            for name, value in zip(AXES, base, strict=True)
            if name != axis
        ]
        numbers.set(ylabel="number of disks", title=",  ".join(others))
        numbers.tick_params(labelbottom=False)
        lengths.set(xlabel=AXES[axis], ylabel="length (box = 1)")
        for axes in (numbers, lengths):
            axes.set_ylim(0, 1.5 * axes.get_ylim()[1])
            axes.legend(loc="upper left", fontsize=8)
    per_point = {p.runs for points in scans.values() for p in points}
    number = "-".join(map(str, sorted({min(per_point), max(per_point)})))
    ended = any(not p.free for points in scans.values() for p in points)
    figure.suptitle(
        f"{caption(runs)}\n{number} runs per point,  ended at {100 * fraction:g} % of the energy"
        + (" (open: the box takes part, or ended by time)" if ended else ""),
        fontsize=10,
    )
    return figure


def table(scans: dict[str, list[Point]]) -> list[dict]:
    """A row per point."""
    rows = []
    for axis, points in scans.items():
        for p in points:
            row = {"scan": axis, "value": p.x, "runs": p.runs}
            for name, size in p.sizes.items():
                row |= measured(name, size)
            row |= {"energy_left": float(p.energy_left)}
            row |= {"wall_collisions": float(p.wall_collisions)}
            rows.append(row | {"ended_by_time": int(p.by_time), "in_fit": int(p.free)})
    return rows


def exponents(scans: dict[str, list[Point]]) -> list[dict]:
    """A row per fit."""
    return [
        {
            "scan": axis,
            "size": name,
            **measured("exponent", Estimate(fit.exponent, fit.exponent_error)),
        }
        for axis, points in scans.items()
        for name, fit in fits_of(axis, points).items()
        if fit
    ]


def main() -> None:
    args = command_line(__doc__, "crater_scan.png").parse_args()
    runs = distinct(read_all(args.runs))
    keys, craters = [key_of(run) for run in runs], [crater(run) for run in runs]
    scans = {axis: scan_points(keys, runs, craters, k) for k, axis in enumerate(AXES)}
    scanned = {axis: points for axis, points in scans.items() if len(points) > 1}
    scans = scanned or {"mass": scans["mass"]}
    figure = draw(scans, base_of(keys), runs)
    report(args, runs, "Crater size", figure, table(scans), exponents(scans))


if __name__ == "__main__":
    launch(main)
