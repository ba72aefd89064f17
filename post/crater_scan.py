"""Crater size against the projectile's mass, speed and radius, and against restitution.

    python post/crater_scan.py runs/crater_scan/*.h5 -o crater_scan.png --csv crater_scan.csv

The four parameters are read from each run.  Runs that differ in one of them make a curve against
it; there is a curve for every combination of the other three, and a panel for every parameter that
varies so.  A run without such a partner is named, in print and on the figure.  Points: means over
the runs, bars: standard errors.  Lines: weighted fits of size = A x^p (x = 1 - xi^2 for the
restitution, the fraction of normal energy lost in a collision); the exponents are printed.  Open
symbols are left out of the fit: the box takes part (wall hits are more than 1 % of the number of
disks), or some of the runs ended by time, with more energy left than `stop.energy_fraction`.
"""

import hashlib
from typing import NamedTuple

from ricochet import Run, RunError
from ricochet.crater import (
    Crater,
    bed,
    box_takes_part,
    crater,
    ended_by_time,
    energy_fraction,
    projectile,
)
from ricochet.drawing import COLOURS, colours, panel_grid, plt
from ricochet.reader import span
from ricochet.script import command_line, launch, measured, read_all, report
from ricochet.statistics import Estimate, PowerLaw, estimate, fit_power_law, to_error

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


class Curve(NamedTuple):
    """Against one parameter, the others being the same."""

    others: dict[str, float]
    points: list[Point]  # in ascending order


Key = tuple[float, ...]  # a value for each of AXES


def key_of(run: Run) -> Key:
    """Mass ratio, speed, radius ratio, restitution."""
    if np.isnan(run.restitution):
        raise RunError(f"{run.path}: has several restitutions, which are no parameter of a scan")
    tip, lying = projectile(run), np.flatnonzero(bed(run))[0]
    values = (
        run.mass[tip] / run.mass[lying],
        run.speed(0)[tip],
        run.radius[tip] / run.radius[lying],
        run.restitution,
    )
    return tuple(float(f"{value:.9g}") for value in values)


def distinct(runs: list[Run]) -> list[Run]:
    """The same run once: scans share points.  It ends with the same digits."""
    return list({(key_of(run), run.seed, ending(run)): run for run in runs}.values())


def ending(run: Run) -> bytes:
    """Of the last frame."""
    return hashlib.blake2b(run.position[-1].tobytes()).digest()


def point(x: float, runs: list[Run], craters: list[Crater]) -> Point:
    """The mean over runs."""
    sizes = {name: estimate([getattr(c, name) for c in craters]) for name in SIZES | EXTENTS}
    left, hits = (
        np.array([getattr(c, name) for c in craters]) for name in ("energy_left", "wall_collisions")
    )
    by_time = any(ended_by_time(*one) for one in zip(runs, craters, strict=True))
    free = not by_time and not box_takes_part(runs[0], hits.mean())
    return Point(x, len(runs), sizes, left.mean(), hits.mean(), by_time, free)


def curves(keys: list[Key], runs: list[Run], craters: list[Crater], axis: str) -> list[Curve]:
    """One for each combination of the other parameters, also if it has a single point."""
    names, found = list(AXES), {}
    for key, *one in sorted(zip(keys, runs, craters, strict=True), key=lambda item: item[0]):
        values = dict(zip(names, key, strict=True))
        x = values.pop(axis)
        found.setdefault(tuple(values.items()), {}).setdefault(x, []).append(one)
    return [
        Curve(dict(others), [point(x, *zip(*members, strict=True)) for x, members in own.items()])
        for others, own in sorted(found.items())
    ]


def scanned(keys: list[Key], runs: list[Run], craters: list[Crater]) -> dict[str, list[Curve]]:
    """The curves that have more than a point, by parameter; else the largest of the points."""
    every = {axis: curves(keys, runs, craters, axis) for axis in AXES}
    scans = {axis: [curve for curve in own if len(curve.points) > 1] for axis, own in every.items()}
    largest = max(every["mass"], key=lambda curve: curve.points[0].runs)
    return {axis: own for axis, own in scans.items() if own} or {"mass": [largest]}


def unused(keys: list[Key], scans: dict[str, list[Curve]]) -> list[str]:
    """The runs that are on no curve."""
    drawn = {
        tuple({**curve.others, axis: p.x}[name] for name in AXES)
        for axis, own in scans.items()
        for curve in own
        for p in curve.points
    }
    return [
        f"not drawn: {listed(dict(zip(AXES, key, strict=True)))} (runs: {keys.count(key)}), from "
        "which no other run differs in one parameter alone"
        for key in sorted(set(keys) - drawn)
    ]


def listed(values: dict[str, float]) -> str:
    """Parameters in words."""
    return ",  ".join(f"{name} {value:g}" for name, value in values.items())


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


def power(axis: str, fit: PowerLaw | None) -> str:
    """The law of a fit, for a legend."""
    if not fit:
        return ""
    exponent = "\\pm".join(to_error(fit.exponent, fit.exponent_error))
    return f", $\\propto {SYMBOLS[axis]}^{{{exponent}}}$"


def draw_size(
    axes: plt.Axes, axis: str, curve: Curve, name: str, fit: PowerLaw | None, **style
) -> None:
    """One size with its fit."""
    x, y, error = np.array([(p.x, *p.sizes[name]) for p in curve.points]).T
    error, free = np.nan_to_num(error), np.array([p.free for p in curve.points])
    if fit:
        inside = np.linspace(x[free].min(), x[free].max(), 200)
        inside = inside[abscissa(axis, inside) > 0]
        axes.plot(inside, fit(abscissa(axis, inside)), color=style["color"], lw=1)
    else:
        axes.plot(x, y, color=style["color"], lw=0.8, alpha=0.4)
    axes.errorbar(x[free], y[free], error[free], ls="", **style)
    axes.errorbar(x[~free], y[~free], error[~free], ls="", **{**style, "label": ""}, mfc="white")


def draw_sizes(axes: plt.Axes, axis: str, scan: list[Curve], names: dict, own: list) -> None:
    """Some of the sizes: of a single curve each has a colour, of a family each curve."""
    varying = [name for name in scan[0].others if len({c.others[name] for c in scan}) > 1]
    for curve, shade in zip(scan, colours(len(scan)), strict=True):
        fits = fits_of(axis, curve.points)
        for (name, title), colour, marker in zip(names.items(), own, "os", strict=True):
            label = "" if varying else title + power(axis, fits[name])
            style = {"color": shade if varying else colour, "marker": marker, "label": label}
            draw_size(axes, axis, curve, name, fits[name], **style)
        if varying:
            axes.plot([], [], color=shade, label=listed({n: curve.others[n] for n in varying}))
    if varying:
        for title, marker in zip(names.values(), "os", strict=True):
            axes.plot([], [], ls="", color="0.4", marker=marker, label=title)


def draw(scans: dict[str, list[Curve]], runs: list[Run]) -> plt.Figure:
    """Panels for each parameter: numbers of disks above, width and depth below."""
    rows, columns = panel_grid(len(scans), 1)
    figure = plt.figure(figsize=(5.5 * max(columns, 1.3), 5.5 * rows))
    grid = figure.add_gridspec(2 * rows, columns, height_ratios=(1.3, 1) * rows)
    fraction = energy_fraction(runs[0])
    for panel, (axis, scan) in enumerate(scans.items()):
        row, column = 2 * (panel // columns), panel % columns
        numbers = figure.add_subplot(grid[row, column])
        lengths = figure.add_subplot(grid[row + 1, column], sharex=numbers)
        draw_sizes(numbers, axis, scan, SIZES, COLOURS[:2])
        draw_sizes(lengths, axis, scan, EXTENTS, COLOURS[2:4])
        if axis == "mass":
            x = np.array(sorted({p.x for curve in scan for p in curve.points}))
            label = f"least number hit, $M\\,(1/f - 1)$, $f = {fraction:g}$"
            numbers.plot(x, x * (1 / fraction - 1), color="0.4", lw=1, ls=":", label=label)
        same = set.intersection(*(set(curve.others.items()) for curve in scan))
        title = listed(
            {name: value for name, value in scan[0].others.items() if (name, value) in same}
        )
        numbers.set(ylabel="number of disks", title=title)
        numbers.tick_params(labelbottom=False)
        lengths.set(xlabel=AXES[axis], ylabel="length (box = 1)")
        for axes in (numbers, lengths):
            axes.set_ylim(0, 1.5 * axes.get_ylim()[1])
            axes.legend(loc="upper left", fontsize=8, ncols=1 + (len(scan) > 2))
    points = [p for scan in scans.values() for curve in scan for p in curve.points]
    number = "-".join(map(str, sorted({f([p.runs for p in points]) for f in (min, max)})))
    count = span(np.array([run.count for run in runs]))
    figure.suptitle(
        f"N = {count},  {number} run{'s' * (number != '1')} per point,"
        f"  ended at {100 * fraction:g} % of the energy"
        + (" (open: the box takes part, or ended by time)" * any(not p.free for p in points)),
        fontsize=10,
    )
    return figure


def table(scans: dict[str, list[Curve]]) -> list[dict]:
    """A row per point of each curve."""
    rows = []
    for axis, others, p in (
        (axis, curve.others, p)
        for axis, own in scans.items()
        for curve in own
        for p in curve.points
    ):
        values = {**others, axis: p.x}
        row = {"scan": axis, **{name: values[name] for name in AXES}, "runs": p.runs}
        for name, size in p.sizes.items():
            row |= measured(name, size)
        row |= {"energy_left": float(p.energy_left)}
        row |= {"wall_collisions": float(p.wall_collisions)}
        rows.append(row | {"ended_by_time": int(p.by_time), "in_fit": int(p.free)})
    return rows


def exponents(scans: dict[str, list[Curve]]) -> list[dict]:
    """A row per fit."""
    return [
        {
            "scan": axis,
            **{name: curve.others.get(name) for name in AXES},
            "size": size,
            **measured("exponent", Estimate(fit.exponent, fit.exponent_error)),
        }
        for axis, scan in scans.items()
        for curve in scan
        for size, fit in fits_of(axis, curve.points).items()
        if fit
    ]


def main() -> None:
    args = command_line(__doc__, "crater_scan.png").parse_args()
    runs = distinct(read_all(args.runs))
    keys, craters = [key_of(run) for run in runs], [crater(run) for run in runs]
    scans = scanned(keys, runs, craters)
    figure, left_out = draw(scans, runs), unused(keys, scans)
    title = "Crater size"
    report(args, runs, title, figure, table(scans), exponents(scans), notes=left_out)


if __name__ == "__main__":
    launch(main)
