"""Crater size against mass, speed and radius of the projectile, and against restitution."""

from collections.abc import Iterator, Sequence
from itertools import chain
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from matplotlib.ticker import LogLocator, MaxNLocator

from ...analysis.crater import (
    bed,
    box_takes_part,
    crater,
    ended_by_time,
    energy_fraction,
    enough_disks,
    projectile,
)
from ...analysis.estimates import (
    Estimate,
    PowerLaw,
    estimate,
    fit_power_law,
    jackknife,
    rounded_to_error,
)
from ...figures.drawing import COLOURS, colours, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...reading.nature import Refused
from ...reading.reader import Run
from ...reading.records import span
from ..groups import Group, grouped
from ..registry import Analysis
from ..result import Result
from ..tables import measured

#: Axis label of each parameter: text and quantity.
AXES = {
    "mass": ("mass of projectile / bed disk, $M$", "number"),
    "speed": ("projectile speed $v$", "speed"),
    "radius": ("radius of projectile / bed disk, $R$", "number"),
    "restitution": ("1 − ξ²", "number"),
}
SIZES = {"hit": "disks hit", "displaced": "displaced by > r"}
EXTENTS = {"width": "width, displaced", "depth": "depth, displaced"}
EXTENTS |= {"hole_width": "width, hole", "hole_depth": "depth, hole"}
ALL = SIZES | EXTENTS
MARKERS = "osDv"
NONE = Estimate(np.nan, np.nan)  # exponent of a curve without a fit
ROUNDING = 1e-9  # absolute value below which an exponent counts as 0
SHORT = 0.3  # decades up to which the ticks of a logarithmic axis have equal distances
FEWEST_POINTS = 3  # fewest points to which a power law is fitted


class Point(NamedTuple):
    """Craters of all runs that differ only in their seed."""

    values: dict[str, float]  # of the parameters in AXES
    seeds: tuple[int, ...]  # of the R runs
    of_runs: dict[str, np.ndarray]  # (R,) sizes in the runs
    sizes: dict[str, Estimate]  # means over the runs
    energy_left: Estimate
    side_collisions: Estimate  # per run
    by_time: bool  # some runs reached stop.time before the energy fraction
    free: bool  # limited by neither time nor walls
    bed: int = 0  # number of disks in the bed; the largest one if the runs differ

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.seeds)


# the curves of each parameter, with points in increasing order
Scans = dict[str, list[list[Point]]]


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
    lying = max(run.n_disks for run in runs) - 1
    return Point(values, seeds, sizes, means, left, hits, by_time, free, lying)


def curves_of(scans: Scans) -> Iterator[tuple[str, list[Point]]]:
    """Yield each curve, with the name of its parameter."""
    for axis, scan in scans.items():
        for curve in scan:
            yield axis, curve


def others(axis: str, curve: list[Point]) -> dict[str, float]:
    """Return the three parameters that are constant along a curve."""
    return {name: value for name, value in curve[0].values.items() if name != axis}


def scanned(points: list[Point]) -> Scans:
    """Return the curves with at least two points or, if there are none, the longest curve."""
    scans = {}
    for axis in AXES:
        families = grouped(points, lambda p, axis=axis: tuple(others(axis, [p]).values()))
        curves = [sorted(own, key=lambda p, axis=axis: p.values[axis]) for _, own in families]
        if long := [curve for curve in curves if len(curve) > 1]:
            scans[axis] = long
    return scans or {"mass": [[max(points, key=lambda p: p.runs)]]}


def unused(points: list[Point], scans: Scans) -> list[str]:
    """Return a note on the points that belong to no curve."""
    drawn = [p.values for _, curve in curves_of(scans) for p in curve]
    return [
        f"not drawn: {listed(p.values)} (runs: {p.runs}), from which no other run differs in one "
        "parameter alone"
        for p in points
        if p.values not in drawn
    ]


def fitted_values(curve: list[Point], axis: str) -> int:
    """Return the number of different parameter values among the fitted points."""
    return len({p.values[axis] for p in curve if p.free})


def larger_bed(cut: list[Point], fraction: float) -> float:
    """Return the number of disks in a bed that would suffice for craters that reach the box.

    The number is rounded up to hundreds. Where a bed already has the estimated size, as under a
    projectile of small radius, which penetrates deeper, a bed half as large again is advised.
    """
    estimated = [enough_disks(p.values["mass"], p.values["restitution"], fraction) for p in cut]
    sizes = [max(1.5 * p.bed, size) for p, size in zip(cut, estimated, strict=True)]
    return float(100 * np.ceil(max(sizes) / 100))


def unfitted(scans: Scans, runs: list[Run]) -> list[str]:
    """Return why curves cannot be fitted, and the size of a bed that would allow a fit."""
    notes, fraction = [], energy_fraction(runs[0])
    for axis, curve in curves_of(scans):
        cut = [p for p in curve if not p.free]
        if fitted_values(curve, axis) >= FEWEST_POINTS or not cut:
            continue
        what = f"no fit against {axis}: time or walls limit {len(cut)} of {len(curve)} points"
        if timed := sum(p.by_time for p in cut):
            what += f"; {timed} reached stop.time: increase it"
        if by_box := [p for p in cut if not p.by_time]:
            what += f"; the crater reaches the box in {len(by_box)}"
            number = larger_bed(by_box, fraction)
            if np.isfinite(number):
                beds = span(np.array([p.bed for p in by_box]))
                what += f": use about {number:.0f} disks instead of {beds}"
            else:
                what += ", and a larger bed would not help"
        notes.append(what)
    return notes


def listed(values: dict[str, float]) -> str:
    """Return the values of the parameters as text."""
    return ",  ".join(f"{name} {value:g}" for name, value in values.items())


def abscissa(axis: str, x: np.ndarray) -> np.ndarray:
    """Return the variable x of the fit, given the values of a parameter."""
    return 1 - np.square(x) if axis == "restitution" else np.asarray(x, dtype=float)


def fit_of(axis: str, curve: list[Point], name: str) -> PowerLaw | None:
    """Fit a power law to a crater size.

    If all points are means over the same beds, the crater sizes at different points are correlated.
    The error of the exponent is then estimated by the jackknife over beds.
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
    return fit._replace(exponent_error=float(jackknife(fit.exponent, exponents).error))


def power(fit: PowerLaw | None) -> str:
    """Return the exponent of a fitted power law as text for a legend."""
    if not fit:
        return ""
    exact = max(abs(fit.exponent), fit.exponent_error) < ROUNDING
    exponent = " ± ".join(rounded_to_error(fit.exponent, fit.exponent_error))
    exponent = "0" if exact else exponent.replace("-", "−")
    return exponent + (f", χ²/dof {fit.chi2:.2g}" if fit.missed else "")


def draw_size(
    axes: plt.Axes, axis: str, curve: list[Point], name: str, fit: PowerLaw | None, **style: Any
) -> None:
    """Plot one crater size against a parameter, with the fitted power law in its range."""
    values, y, error = np.array([(p.values[axis], *p.sizes[name]) for p in curve]).T
    x, error = abscissa(axis, values), np.nan_to_num(error)
    free = np.array([p.free for p in curve])
    if fit:
        inside = np.geomspace(x[free].min(), x[free].max(), 50)
        axes.plot(inside, fit(inside), color=style["color"], lw=1)
    else:
        axes.plot(x, y, color=style["color"], lw=0.8, alpha=0.4)
    open_style = style | {"mfc": "white"}
    if free.any():  # the legend shows the symbol of most points
        axes.errorbar(x[free], y[free], error[free], ls="", **style)
        open_style["label"] = ""
    axes.errorbar(x[~free], y[~free], error[~free], ls="", **open_style)


def draw_sizes(
    axes: plt.Axes, result: Result, axis: str, names: dict[str, str], own: Sequence[str]
) -> None:
    """Plot several crater sizes against a parameter; colours denote curves or, for one, sizes."""
    scan, run = result.values[axis], result.runs[0]
    shared = [others(axis, curve) for curve in scan]
    named = axis == next(iter(result.values)) or len(axes.get_figure(root=True).axes) == 1
    varying = [name for name in shared[0] if len({values[name] for values in shared}) > 1]
    for curve, values, shade in zip(scan, shared, colours(len(scan)), strict=True):
        for (name, title), colour, marker in zip(names.items(), own, MARKERS, strict=False):
            fit = fit_of(axis, curve, name)
            parts = [title] * (named or not fit) + [power(fit)] * bool(fit)
            label = "" if varying else ": ".join(parts)
            style = {"color": shade if varying else colour, "marker": marker, "label": label}
            draw_size(axes, axis, curve, name, fit, **style)
        if varying:
            axes.plot([], [], color=shade, label=listed({n: values[n] for n in varying}))
    if varying:
        for title, marker in zip(names.values(), MARKERS, strict=False):
            axes.plot([], [], ls="", color="0.4", marker=marker, label=title)
    if names is SIZES and axis == "mass":
        x = np.array(sorted({p.values["mass"] for p in chain(*scan)}))
        fraction = energy_fraction(run)
        label = f"least number hit, $M\\,(1/f - 1)$, $f = {fraction:g}$"
        axes.plot(x, x * (1 / fraction - 1), color="0.4", lw=1, ls=":", label=label)
    low = len(axes.get_figure(root=True).axes) > 2  # several rows
    shapes(axes, abscissa(axis, [p.values[axis] for p in chain(*scan)]), low)
    same = set.intersection(*(set(others(axis, curve).items()) for curve in scan))
    title = listed({name: v for name, v in others(axis, scan[0]).items() if (name, v) in same})
    axes.set(xlabel=run.units.label(*AXES[axis]), title=title if names is SIZES else "")
    axes.set_ylabel("number of disks" if names is SIZES else run.units.label("length"))
    legend_above(axes)


def shapes(axes: plt.Axes, x: np.ndarray, low: bool) -> None:
    """If all values are positive, make both axes logarithmic with ticks at the points.

    A `low` panel has fewer ticks.
    """
    heights = [line.get_ydata() for line in axes.lines if len(line.get_ydata())]
    if min(x) > 0 and min(map(np.min, heights)) > 0:
        axes.set(xscale="log", yscale="log")
        places, apart = np.log(np.unique(x)), 0.15 * np.ptp(np.log(x))
        ticks = [places[0]]
        for place in places:
            ticks += [place] * bool(place - ticks[-1] > apart)
        axes.set_xticks(np.exp(ticks), minor=False)
        axes.set_xticks([], minor=True)
        axes.xaxis.set_major_formatter("{x:.3g}")
        decades = np.log10(max(map(np.max, heights)) / min(map(np.min, heights)))
        subs = (1, 3) if low and decades > 1 else (1, 2, 3, 5)
        few = MaxNLocator(4, steps=[1, 2, 5, 10])
        axes.yaxis.set_major_locator(few if decades < SHORT else LogLocator(subs=subs))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("")


def draw(result: Result) -> Sheet:
    """Plot two panels for each parameter: numbers of disks, and width and depth."""
    rows = []
    for axis in result.values:
        numbers = Panel(f"{axis}_numbers", draw_sizes, (result, axis, SIZES, COLOURS[:2]), 0.85)
        given = (result, axis, EXTENTS, COLOURS[2:6])
        lengths = Panel(f"{axis}_lengths", draw_sizes, given, 0.85, share_x=numbers.name)
        rows.append([numbers, lengths])
    points = [p for scan in result.values.values() for p in chain(*scan)]
    number = "-".join(map(str, sorted({f([p.runs for p in points]) for f in (min, max)})))
    count = span(np.array([run.n_disks for run in result.runs]))
    ended = f"ended at {100 * energy_fraction(result.runs[0]):g} % of the energy"
    return Sheet(rows, f"N = {count},  {number} run{'s' * (number != '1')} per point,  {ended}")


class Tables(NamedTuple):
    """Results of a scan."""

    points: list[dict[str, Any]]
    fits: list[dict[str, Any]]
    data: list[dict[str, Any]]  # the points, each with the exponents of its curve
    missed: list[str]  # warnings about fits that do not describe their points


def tables(scans: Scans) -> Tables:
    """Return the points and the fits of all curves."""
    found = Tables([], [], [], [])
    for axis, curve in curves_of(scans):
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


def by_parameters(runs: list[Run]) -> list[tuple[tuple[float, ...], list[Run]]]:
    """Group runs that differ only in their seed."""
    return grouped(runs, key_of)


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return the mean sizes of craters, and power laws fitted to them."""
    points = [point(group.key, group.runs) for group in groups]
    scans, runs = scanned(points), [run for group in groups for run in group.runs]
    found = tables(scans)
    notes = ["Displaced: by more than the radius r of the disk."]
    notes.append("Bars: standard errors of the mean over the beds.")
    if found.fits:
        notes.append(
            "Lines: fits of power laws in the range of their points, with the exponents above."
        )
        if len(scans) > 1:
            notes.append("All rows have the symbols that the first one names.")
    lines = sum(len(ALL) for _, curve in curves_of(scans) if len(curve) > 1)
    if len(found.fits) < lines:
        notes.append("Pale lines join points to which no power law is fitted.")
    if any(not p.free for p in points):
        notes.append("Open symbols: walls affect the crater, or stop.time was reached.")
    warnings = [*unfitted(scans, runs), *unused(points, scans), *found.missed]
    data = found.data
    return Result(
        found.points, notes=notes, warnings=warnings, further=[found.fits], data=data, values=scans
    )


ANALYSIS = Analysis(compute, draw, group_by=by_parameters)
