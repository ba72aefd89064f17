"""Crater size against mass, speed and radius of the projectile, and against restitution.

    python post/crater_scan.py runs/crater_scan/*.h5 -o crater_scan.png --csv crater_scan.csv

The script reads the mass, speed and radius of the projectile and the coefficient of restitution
from each run.  Runs that differ in only one parameter form a curve against that parameter.  For
each parameter with at least one curve there is a panel; along each curve in the panel, the other
three parameters are constant.  Runs that belong to no curve are listed in the printed warnings and
on the figure.  Points are means over the runs, with error bars.  Lines are fits of size = A x^p, in
which all points have equal weights.  For the restitution xi, the variable x = 1 - xi^2 is the
fraction of the normal energy that a collision dissipates.  The exponents are printed with chi^2 per
degree of freedom.  If a fit does not describe its points, a warning is printed.  The error of an
exponent is determined from the scatter between the beds (jackknife) if all points of a curve are
means over runs with the same seeds, and otherwise from the errors of the points.  If each point is
a single run, the error is determined from the deviations of the points from the fit.  Points with
open symbols are not used in fits.  A point is not used in fits if the number of collisions with
walls exceeds 1 % of the number of disks, because the walls then affect the crater.  A point is also
not used in fits if some of its runs reached `stop.time` before the energy had fallen to the
fraction `stop.energy_fraction` of its initial value.

The numbers of disks that are hit and displaced have a skewed distribution if the projectile is
light, so that the errors of means over few runs are too small: in 57 % of the groups of four runs
with a projectile as heavy as a disk, the true mean is within the error.
"""

from itertools import chain
from typing import NamedTuple

from ricochet import Run
from ricochet.analysis.crater import (
    bed,
    box_takes_part,
    crater,
    ended_by_time,
    energy_fraction,
    enough_disks,
    projectile,
)
from ricochet.analysis.estimates import (
    Estimate,
    PowerLaw,
    estimate,
    fit_power_law,
    rounded_to_error,
)
from ricochet.figures.drawing import COLOURS, colours, panel_grid, plt
from ricochet.reading.records import span
from ricochet.reading.nature import Refused
from ricochet.script import command_line, grouped, launch, measured, report

import numpy as np

#: Text and unit of the axis label of each parameter.
AXES = {
    "mass": ("mass of the projectile / mass of a bed disk, $M$", "number"),
    "speed": ("speed of the projectile $v$", "speed"),
    "radius": ("radius of the projectile / radius of a bed disk, $R$", "number"),
    "restitution": ("restitution ξ", "number"),
}
SYMBOLS = {"mass": "M", "speed": "v", "radius": "R", "restitution": "(1-ξ^2)"}  # in fits
SIZES = {"hit": "disks hit", "displaced": "displaced by more than r"}
EXTENTS = {"width": "width of the displaced", "depth": "depth of the displaced"}
EXTENTS |= {"hole_width": "width of the hole", "hole_depth": "depth of the hole"}
ALL = SIZES | EXTENTS
MARKERS = "osDv"
NONE = Estimate(np.nan, np.nan)  # exponent of a curve without a fit
FEWEST_POINTS = 3  # smallest number of points that is fitted


class Point(NamedTuple):
    """The craters of all runs that differ only by their seed."""

    values: dict[str, float]  # of AXES
    seeds: tuple[int, ...]  # of the R runs
    of_runs: dict[str, np.ndarray]  # (R,) sizes in each run
    sizes: dict[str, Estimate]  # means over the runs
    energy_left: Estimate
    side_collisions: Estimate  # per run
    by_time: bool  # some runs reached stop.time before the energy fraction
    free: bool  # limited by neither time nor walls

    @property
    def runs(self) -> int:
        """The number of runs."""
        return len(self.seeds)


Scans = dict[str, list[list[Point]]]  # the curves of each parameter; points in ascending order


def key_of(run: Run) -> tuple[float, ...]:
    """Return the mass ratio, speed, radius ratio and restitution of a run."""
    if np.isnan(run.restitution):
        raise Refused(f"{run.path}: has no constant restitution, which a scan requires")
    tip, lying = projectile(run), np.flatnonzero(bed(run))[0]
    ratios = run.mass[tip] / run.mass[lying], run.radius[tip] / run.radius[lying]
    values = ratios[0], run.speed(0)[tip], ratios[1], run.restitution
    return tuple(float(f"{value:.9g}") for value in values)


def point(key: tuple[float, ...], runs: list[Run]) -> Point:
    """Return the mean crater sizes over runs with equal parameters."""
    runs = sorted(runs, key=lambda run: run.seed)
    craters = [crater(run) for run in runs]
    sizes = {name: np.array([getattr(c, name) for c in craters], dtype=float) for name in ALL}
    means = {name: estimate(own) for name, own in sizes.items()}
    left, hits = (
        estimate([getattr(c, name) for c in craters]) for name in ("energy_left", "side_collisions")
    )
    by_time = any(ended_by_time(*one) for one in zip(runs, craters, strict=True))
    free = not by_time and not box_takes_part(runs[0], hits.mean)
    values = dict(zip(AXES, key, strict=True))
    seeds = tuple(run.seed for run in runs)
    return Point(values, seeds, sizes, means, left, hits, by_time, free)


def others(axis: str, curve: list[Point]) -> dict[str, float]:
    """Return the three parameters that are equal for all points of a curve."""
    return {name: value for name, value in curve[0].values.items() if name != axis}


def scanned(points: list[Point]) -> Scans:
    """Return the curves with at least two points, or the longest curve if all have one point."""
    scans = {}
    for axis in AXES:
        families = grouped(points, lambda p, axis=axis: tuple(others(axis, [p]).values()))
        curves = [sorted(own, key=lambda p, axis=axis: p.values[axis]) for _, own in families]
        if long := [curve for curve in curves if len(curve) > 1]:
            scans[axis] = long
    return scans or {"mass": [[max(points, key=lambda p: p.runs)]]}


def unused(points: list[Point], scans: Scans) -> list[str]:
    """Return the points that do not belong to any curve."""
    drawn = [p.values for scan in scans.values() for curve in scan for p in curve]
    return [
        f"not drawn: {listed(p.values)} (runs: {p.runs}), from which no other run differs in one "
        "parameter alone"
        for p in points
        if p.values not in drawn
    ]


def fitted_values(curve: list[Point], axis: str) -> int:
    """Return the number of different parameter values among the points used in the fit."""
    return len({p.values[axis] for p in curve if p.free})


def unfitted(scans: Scans, runs: list[Run]) -> list[str]:
    """Return the reason why curves cannot be fitted, and a bed size that would allow a fit."""
    notes, fraction = [], energy_fraction(runs[0])
    for axis, curve in ((axis, curve) for axis, scan in scans.items() for curve in scan):
        cut = [p for p in curve if not p.free]
        if fitted_values(curve, axis) >= FEWEST_POINTS or not cut:
            continue
        what = f"no fit against {axis}: time or walls limit {len(cut)} of {len(curve)} points"
        if timed := sum(p.by_time for p in cut):
            what += f"; {timed} reached stop.time: increase it"
        by_box = [p.values for p in cut if not p.by_time]
        sizes = [enough_disks(v["mass"], v["restitution"], fraction) for v in by_box]
        if sizes and np.isfinite(max(sizes)):
            number = 100 * int(np.ceil(max(sizes) / 100))
            what += f"; the crater reaches the box in {len(sizes)}: use about {number} disks"
            what += f" instead of {span(np.array([run.n_disks - 1 for run in runs]))}"
        elif sizes:
            what += f"; the crater reaches the box in {len(sizes)}, and a larger bed would not help"
        notes.append(what)
    return notes


def listed(values: dict[str, float]) -> str:
    """Return the values of the parameters as text."""
    return ",  ".join(f"{name} {value:g}" for name, value in values.items())


def abscissa(axis: str, x: np.ndarray) -> np.ndarray:
    """Return the variable x of the fit, calculated from the values of a parameter."""
    return 1 - np.square(x) if axis == "restitution" else np.asarray(x, dtype=float)


def fit_of(axis: str, curve: list[Point], name: str) -> PowerLaw | None:
    """Fit a power law to a crater size.

    If all points are means over the same beds, the sizes at different points are correlated, and
    the error of the exponent is that of the jackknife: the fit is repeated without each bed in
    turn.
    """
    free = [p for p in curve if p.free]
    x = abscissa(axis, [p.values[axis] for p in free])
    y, error = np.array([p.sizes[name] for p in free]).reshape(-1, 2).T
    runs = min((p.runs for p in free), default=0)
    fit = fit_power_law(x, y, *((error, runs) if runs > 1 else ()))
    if fit is None or fit.missed or len({p.seeds for p in free}) > 1 or runs < 2:
        return fit
    each = np.array([p.of_runs[name] for p in free])
    rest = (each.sum(axis=1, keepdims=True) - each) / (runs - 1)
    if not rest.min() > 0:
        return fit
    exponents = np.array([fit_power_law(x, some).exponent for some in rest.T])
    return fit._replace(exponent_error=float(estimate((1 - runs) * exponents).error))


def power(axis: str, curve: list[Point], fit: PowerLaw | None) -> str:
    """Return the fitted power law as text for the legend of a figure."""
    if not fit:
        return ""
    exponent = "\\pm".join(rounded_to_error(fit.exponent, fit.exponent_error))
    missed = f", $\\chi^2$/dof {fit.chi2:.2g}" if fit.missed else ""
    return f", $\\propto {SYMBOLS[axis]}^{{{exponent}}}${missed}"


def draw_size(
    axes: plt.Axes, axis: str, curve: list[Point], name: str, fit: PowerLaw | None, **style
) -> None:
    """Draw one crater size against a parameter, with the fitted power law."""
    x, y, error = np.array([(p.values[axis], *p.sizes[name]) for p in curve]).T
    error, free = np.nan_to_num(error), np.array([p.free for p in curve])
    if fit:
        inside = np.linspace(x[free].min(), x[free].max(), 200)
        inside = inside[abscissa(axis, inside) > 0]
        axes.plot(inside, fit(abscissa(axis, inside)), color=style["color"], lw=1)
    else:
        axes.plot(x, y, color=style["color"], lw=0.8, alpha=0.4)
    open_style = style | {"mfc": "white"}
    if free.any():  # the legend shows the symbol that most points have
        axes.errorbar(x[free], y[free], error[free], ls="", **style)
        open_style["label"] = ""
    axes.errorbar(x[~free], y[~free], error[~free], ls="", **open_style)


def draw_sizes(axes: plt.Axes, axis: str, scan: list[list[Point]], names: dict, own: list) -> None:
    """Draw several crater sizes against a parameter.

    If there is only one curve, colours distinguish the sizes; otherwise colours distinguish the
    curves.
    """
    shared = [others(axis, curve) for curve in scan]
    varying = [name for name in shared[0] if len({values[name] for values in shared}) > 1]
    for curve, values, shade in zip(scan, shared, colours(len(scan)), strict=True):
        for (name, title), colour, marker in zip(names.items(), own, MARKERS, strict=False):
            fit = fit_of(axis, curve, name)
            label = "" if varying else title + power(axis, curve, fit)
            style = {"color": shade if varying else colour, "marker": marker, "label": label}
            draw_size(axes, axis, curve, name, fit, **style)
        if varying:
            axes.plot([], [], color=shade, label=listed({n: values[n] for n in varying}))
    if varying:
        for title, marker in zip(names.values(), MARKERS, strict=False):
            axes.plot([], [], ls="", color="0.4", marker=marker, label=title)


def draw(runs: list[Run], scans: Scans) -> plt.Figure:
    """Draw two panels for each parameter: numbers of disks, and below them width and depth."""
    rows, columns = panel_grid(len(scans), 1)
    figure = plt.figure(figsize=(5.5 * max(columns, 1.3), 5.5 * rows))
    grid = figure.add_gridspec(2 * rows, columns, height_ratios=(1.3, 1) * rows)
    fraction, units = energy_fraction(runs[0]), runs[0].units
    for panel, (axis, scan) in enumerate(scans.items()):
        row, column = 2 * (panel // columns), panel % columns
        numbers = figure.add_subplot(grid[row, column])
        lengths = figure.add_subplot(grid[row + 1, column], sharex=numbers)
        draw_sizes(numbers, axis, scan, SIZES, COLOURS[:2])
        draw_sizes(lengths, axis, scan, EXTENTS, COLOURS[2:6])
        if axis == "mass":
            x = np.array(sorted({p.values["mass"] for p in chain(*scan)}))
            label = f"least number hit, $M\\,(1/f - 1)$, $f = {fraction:g}$"
            numbers.plot(x, x * (1 / fraction - 1), color="0.4", lw=1, ls=":", label=label)
        same = set.intersection(*(set(others(axis, curve).items()) for curve in scan))
        title = listed({name: v for name, v in others(axis, scan[0]).items() if (name, v) in same})
        numbers.set(ylabel="number of disks", title=title)
        numbers.tick_params(labelbottom=False)
        lengths.set(xlabel=units.label(*AXES[axis]), ylabel=units.label("length"))
        for axes, room in ((numbers, 1.5), (lengths, 1.9)):
            axes.set_ylim(0, room * axes.get_ylim()[1])
            axes.legend(loc="upper left", fontsize=8, ncols=1 + (len(scan) > 2))
    points = [p for scan in scans.values() for p in chain(*scan)]
    number = "-".join(map(str, sorted({f([p.runs for p in points]) for f in (min, max)})))
    count = span(np.array([run.n_disks for run in runs]))
    figure.suptitle(
        f"N = {count},  {number} run{'s' * (number != '1')} per point,"
        f"  ended at {100 * fraction:g} % of the energy"
        + "\n(open symbols: walls affect the crater, or stop.time was reached)"
        * any(not p.free for p in points)
    )
    return figure


class Tables(NamedTuple):
    """Results of a scan."""

    points: list[dict]
    fits: list[dict]
    data: list[dict]  # the points, each with the exponents of its curve
    missed: list[str]  # warnings about fits that do not describe their points


def tables(scans: Scans) -> Tables:
    """Return the points and the fits of all curves."""
    found = Tables([], [], [], [])
    for axis, curve in ((axis, curve) for axis, scan in scans.items() for curve in scan):
        rows = []
        for p in curve:
            row = {"scan": axis, **p.values, "runs": p.runs}
            for name, size in p.sizes.items():
                row |= measured(name, size)
            row |= measured("energy_left", p.energy_left)
            row |= measured("side_collisions", p.side_collisions)
            rows.append(row | {"ended_by_time": int(p.by_time), "in_fit": int(p.free)})
        exponents = {}
        for size in ALL:
            fit = fit_of(axis, curve, size)
            exponent = Estimate(fit.exponent, fit.exponent_error) if fit else NONE
            exponents |= measured(f"{size}_exponent", exponent)
            if fit:
                row = {"scan": axis, **curve[0].values, axis: None, "size": size}
                row |= {"of": "1 - xi^2" if axis == "restitution" else axis}
                row |= measured("exponent", exponent)
                found.fits.append(row | {"chi2/dof": fit.chi2})
                what = f"{size} against {axis}: the fit does not describe its points; "
                what += "chi^2 per degree of freedom is "
                found.missed.extend([f"{what}{fit.chi2:.2g}"] * fit.missed)
        found.points.extend(rows)
        found.data.extend(row | exponents for row in rows)
    return found


def main() -> None:
    args = command_line(__doc__, "crater_scan.png").parse_args()
    points = [point(*one) for one in grouped(args.runs, key_of)]
    scans = scanned(points)
    found = tables(scans)
    notes = [*unfitted(scans, args.runs), *unused(points, scans), *found.missed]
    figure = draw(args.runs, scans)
    report(args, figure, found.points, found.fits, data=found.data, notes=notes)


if __name__ == "__main__":
    launch(main)
