"""Quantities of driven disks as functions of time, with pictures of the disks."""

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...analysis import driven
from ...analysis.driven import Curves, Room, TimeSeries
from ...analysis.estimates import Estimate
from ...analysis.statistics import SeriesMean, combine_runs, correlated_mean, has_trend, windows
from ...figures import drawing
from ...figures.drawing import COLOURS, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...reading.reader import Run, RunError
from ..groups import Group
from ..options import Option
from ..registry import Analysis
from ..result import Result
from ..tables import measured, over_runs, with_all_columns

MOST_PICTURES = 3
POINTS, FINE = 60, 1000  # points of a curve, and of a curve with fluctuations of interest
CORRELATED = 0.03  # share of the energy loss per collision whose absence causes a warning
SMALLEST = 2.2  # smallest diameter of a disk in a picture [points]
LINES = ("-", "-.", ":")  # line styles of the inputs if colours denote species
Law = np.ndarray | float | Room | None


def no_law(run: Run) -> None:
    """Return None, because there is no prediction for the quantity."""


@dataclass(frozen=True)
class Quantity:
    """Quantity of the figure; `law` predicts the mean of `compared(values)`."""

    label: str
    unit: str
    curves: Callable[[Run], Curves]
    law: Callable[[Run], Law] = no_law
    compared: Callable[[np.ndarray], np.ndarray] = np.asarray
    points: int = POINTS


QUANTITIES = {
    "width": Quantity("width of the box", "length", driven.width, driven.width_law, points=FINE),
    "temperature": Quantity("kT", "energy", driven.temperature, driven.temperature_law),
    "share": Quantity(
        "share of the disks in the left half",
        "number",
        driven.share,
        driven.demon_law,
        driven.fuller,
    ),
    "height": Quantity("mean height", "length", driven.height),
    "viscosity": Quantity("$-P_{xy}$ / shear rate", "viscosity", driven.viscosity),
    "cluster": Quantity("share of the disks in the largest cluster", "number", driven.cluster),
}


@dataclass
class Found:
    """Curves of a group by species, in the order of the runs, with their prediction."""

    tracks: dict[str, list[TimeSeries]]
    law: Law


def check(run: Run) -> None:
    """Raise RunError if a run has only one frame."""
    if run.n_frames < 2 or not run.time[-1] > run.time[0]:
        raise RunError(f"{run.path}: has one frame, two are required")


def by_input(runs: list[Run]) -> list[tuple[str, list[Run]]]:
    """Group runs that differ only in their seed; the keys say how the groups differ."""
    own = [{"N": run.n_disks, "ξ": run.restitution, **drawing.numbers_of(run)} for run in runs]
    names = [name for name in own[0] if len({numbers.get(name) for numbers in own}) > 1]
    groups: dict[str, list[Run]] = {}
    for run, numbers in zip(runs, own, strict=True):
        label = ", ".join(
            drawing.stated(name, {numbers[name]}) for name in names if name in numbers
        )
        groups.setdefault(label, []).append(run)
    return list(groups.items())


def on_average(laws: list[Law]) -> Law:
    """Return the mean prediction for runs that differ in their seed and initial energy."""
    rooms = all(isinstance(law, Room) for law in laws)
    return Room(*map(float, np.mean(laws, axis=0))) if rooms else laws[0]


def found_in(runs: list[Run], quantity: Quantity) -> Found:
    """Return the curves of runs with their prediction."""
    tracks: dict[str, list[TimeSeries]] = {}
    for run in runs:
        for species, curve in quantity.curves(run).items():
            tracks.setdefault(species, []).append(curve)
    return Found(tracks, on_average([quantity.law(run) for run in runs]))


# --- table ---


def late(curve: TimeSeries, compared: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return the values in the second half of a curve, which are compared with the prediction."""
    time, value = curve
    return compared(value[driven.second_half(time)])


def members_of(group: Group, species: str, show: str, halves: list[np.ndarray]) -> list[SeriesMean]:
    """Return the mean over the second half of each run.

    For a single run of constant energy the error is unknown, because its fluctuations do not show
    how its mean depends on the seed.
    """
    members = [correlated_mean(half) for half in halves]
    if show != "temperature" or species:
        return members
    pairs = zip(members, group.runs, strict=True)
    return [m._replace(error=np.nan) if driven.keeps_energy(run) else m for m, run in pairs]


def late_cells(members: list[SeriesMean], warnings: list[str], about: str) -> dict[str, Any]:
    """Return the table cells of a mean over the second halves, and add to `warnings`."""
    samples = round(combine_runs(members).samples, 1)
    return over_runs("late", members, warnings, about) | {"samples": samples}


def components(runs: list[Run]) -> dict[str, float | None]:
    """Return the table cells of kT_x and kT_y, if available."""
    if not all("kinetic_tensor" in run.observables for run in runs):
        return {}
    parts, row = [driven.components(run) for run in runs], {}
    for name in parts[0]:
        halves = [late(one[name], np.asarray) for one in parts]
        row |= measured(name, combine_runs(list(map(correlated_mean, halves))))
    return row


def deviations(
    runs: list[Run], law: Room, mean: float, halves: list[np.ndarray]
) -> dict[str, float | None]:
    """Return the table cells of the fluctuations of the width, and of conserved quantities."""
    squares = combine_runs([correlated_mean((half - mean) ** 2) for half in halves])
    found = Estimate(squares.mean**0.5, squares.error / 2 / squares.mean**0.5)
    row = measured("deviation", found) | {"theory_deviation": law.deviation}
    changes = np.max([driven.balances(run) for run in runs], axis=0)
    return row | dict(zip(("enthalpy_change", "momentum_change"), changes, strict=True))


def losses(runs: list[Run], about: str, warnings: list[str]) -> dict[str, float | None]:
    """Return the table cells of the energy lost per collision, and add to `warnings`.

    The theory of noise-driven gases assumes that the velocities of colliding disks are independent.
    """
    loss = combine_runs([driven.collision_loss(run) for run in runs])
    if 1 - loss.mean > max(CORRELATED, 3 * loss.error):
        warnings.append(
            f"{about}: a collision dissipates {100 * (1 - loss.mean):.1f} ± {100 * loss.error:.1f} "
            "% less energy than for independent velocities, which the theory assumes; kT therefore "
            "exceeds the theory"
        )
    return measured("loss", loss)


def row_of(
    group: Group, species: str, show: str, compared: Callable, warnings: list[str]
) -> dict[str, Any]:
    """Return the table row of a species or all disks, and add to `warnings`."""
    curves = group.values.tracks[species]
    halves = [late(curve, compared) for curve in curves]
    about = ", ".join(filter(None, (show, group.key, species)))
    row = {"input": group.key or None, "species": species or None, "runs": len(curves)}
    row |= late_cells(members_of(group, species, show, halves), warnings, about)
    if any(map(has_trend, halves)):
        warnings.append(f"{about}: still increases or decreases; 'late' is not steady")
    law = None if species else group.values.law
    mean, error = row["late"], row["late_error"]
    if show == "temperature" and not species:
        row |= components(group.runs)
        if all(driven.noise_law(run) is not None for run in group.runs):
            row |= losses(group.runs, about, warnings)
    if isinstance(law, Room):
        row |= deviations(group.runs, law, mean, halves)
        law = law.mean
    if np.ndim(law):
        law = float(np.mean(late((curves[0][0], law), np.asarray)))
    ratio = law and Estimate(mean / law, error / law)
    return row | {"theory": law} | measured("ratio", ratio)


def ratio_rows(group: Group, warnings: list[str]) -> list[dict[str, Any]]:
    """Return a table row with the ratio of the temperatures of two species, if there is one."""
    members = [driven.species_ratio(run) for run in group.runs]
    if None in members:
        return []
    about = ", ".join(filter(None, ("temperature ratio", group.key)))
    row = {"input": group.key or None, "species": "heavy / light", "runs": len(members)}
    return [row | late_cells(members, warnings, about)]


# --- figure ---


def levels(law: Law, compared: Callable) -> list:
    """Return the values of a prediction that are drawn as horizontal lines."""
    if isinstance(law, Room):
        return [law.mean, law.mean - law.deviation, law.mean + law.deviation]
    return [] if law is None else [law, 1 - law] if compared is driven.fuller else [law]


def styles_of(result: Result) -> dict[tuple[str, str], dict[str, Any]]:
    """Return colour and line style of each curve; a colour denotes an input or a species."""
    kinds = any(species for group in result.groups for species in group.values.tracks)
    styles = {}
    for k, group in enumerate(result.groups):
        for species in group.values.tracks:
            names = group.runs[0].names
            colour = COLOURS[names.index(species) % len(COLOURS)] if species else "black"
            style = {"color": colour, "ls": LINES[k % len(LINES)]}
            styles[group.key, species] = style if kinds else {"color": group_colour(result, k)}
    return styles


def group_colour(result: Result, k: int) -> str:
    """Return a colour for a group that differs from those of the species in the pictures."""
    names = result.runs[0].names
    first = len(names) if len(names) > 1 else 0
    return drawing.colours(len(result.groups), first)[k]


def draw_curves(axes: plt.Axes, result: Result) -> None:
    """Plot measured values as solid lines and predictions as dashed lines."""
    quantity, styles = QUANTITIES[result.options.show], styles_of(result)
    fine = quantity.points == FINE
    for group in result.groups:
        for species, curves in group.values.tracks.items():
            style = styles[group.key, species]
            label = ", ".join(filter(None, (group.key, species))) or "measured"
            for k, (time, value) in enumerate(curves):
                means = windows(time, value, (time[-1] - time[0]) / quantity.points)
                more = {"label": label * (k == 0)} | drawing.lone(means[0])
                axes.plot(*means, lw=1, alpha=0.4 if fine else 1, **style, **more)
        species, curves = next(iter(group.values.tracks.items()))
        colour = styles[group.key, species]["color"] if len(result.groups) > 1 else "black"
        for level in levels(group.values.law, quantity.compared):
            over = curves[0][0] if np.ndim(level) else np.array([0, curves[0][0][-1]])
            axes.plot(over, np.broadcast_to(level, over.shape), color=colour, ls="--", lw=1.6)
    if any(levels(group.values.law, quantity.compared) for group in result.groups):
        label = "theory: mean and standard deviation" if fine else "theory"
        axes.plot([], [], color="black", ls="--", label=label)
    bottom, top = 0.9 * axes.dataLim.y0 if fine else 0, 1.06 * axes.dataLim.y1
    units = result.runs[0].units
    axes.set(xlim=(0, None), ylim=(bottom, top), xlabel=units.label("time"))
    axes.set_ylabel(units.label(quantity.label, quantity.unit))
    legend_above(axes)


def draw_picture(axes: plt.Axes, run: Run, frame: int, name: str, colour: str) -> None:
    """Draw the disks in a frame, with very small disks enlarged."""
    drawing.draw_box(axes, run, run.time[frame])
    several = len(run.names) > 1
    shades = drawing.species_colours(run) if several else [colour] * run.n_disks
    across = drawing.points_per_length(axes) * 2 * run.radius.mean()
    rim = {"linewidths": max(0.0, SMALLEST - across), "edgecolors": "face"}
    drawing.disk_collection(axes, run, run.position[frame], facecolors=shades, **rim)
    axes.set_title("\n".join(filter(None, (name, f"t = {run.time[frame]:.4g}"))))


def draw(result: Result) -> Sheet:
    """Plot a quantity as a function of time, with pictures of the disks below."""
    groups, first = result.groups, result.runs[0]
    pictures = [(group.runs[0], -1, group.key, k) for k, group in enumerate(groups)]
    if len(groups) == 1:
        pictures = [(first, frame, "", 0) for frame in (0, -1)]
    shown = pictures[:MOST_PICTURES]
    aspect = min(2.5, drawing.aspect_of(first))
    panels = [
        Panel(f"picture{k + 1}", draw_picture, (*one, group_colour(result, number)), aspect)
        for k, (*one, number) in enumerate(shown)
    ]
    species = any(one for group in groups for one in group.values.tracks)

    def legend(figure: plt.Figure) -> None:
        if not species:  # otherwise the legend of the curves shows their colours
            drawing.species_legend(figure, first)

    curves = Panel("curves", draw_curves, (result,), aspect=0.45)
    return Sheet([[curves], panels], drawing.titled(result.runs), legend)


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Compare the mean of a quantity in the second half of the runs with its prediction."""
    quantity, warnings = QUANTITIES[options.show], []
    for group in groups:
        group.values = found_in(group.runs, quantity)
    rows = [
        row_of(group, species, options.show, quantity.compared, warnings)
        for group in groups
        for species in group.values.tracks
    ]
    if options.show == "temperature":
        rows += [row for group in groups for row in ratio_rows(group, warnings)]
    notes = [f"A line for each run, through means over 1/{quantity.points} of it."]
    return Result(with_all_columns(rows), notes=notes, warnings=warnings)


ANALYSIS = Analysis(
    compute,
    draw,
    options=(
        Option(
            "show",
            "quantity to show, see above [temperature]",
            "temperature",
            symbol="NAME",
            choices=[*QUANTITIES],
        ),
    ),
    accepts=check,
    group_by=by_input,
)
