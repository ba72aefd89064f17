"""Mean kinetic energy of each species of an elastic or inelastic mixture as a function of time."""

from itertools import chain, cycle
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator

from ...analysis.cooling import SMOOTH, Curves, energies, flow_notes, flow_share
from ...analysis.estimates import FEWEST_RUNS, Estimate, student
from ...analysis.thermodynamics import lightest_and_heaviest
from ...figures.drawing import COLOURS, band, caption, dilute_limit, ordered_colours, plt
from ...figures.sheet import Panel, Sheet, legend_above, name_curve
from ...predictions.theory import EQUIPARTITION
from ...reading.reader import Restitution, Run, Species
from ..groups import Group, grouped
from ..registry import Analysis
from ..result import Result
from ..tables import measured, spread

FEW = 3  # largest number of groups with panels against time and a legend in the first of them
COLUMNS = 5  # largest number of panels of single groups in a row
TINY = np.finfo(float).tiny
DASHES = ("--", ":", "-.", (0, (5, 1)), (0, (1, 3)), (0, (8, 3)))  # line styles of the species


def in_time(found: Curves, name: str) -> Estimate:
    """Return the energy of a species over time, relative to the initial mean of all disks."""
    first = found["energy_all"].mean[0]
    return Estimate(*(part / first for part in found[f"energy_{name}"]))


def draw_ratio(axes: plt.Axes, groups: list[Group]) -> None:
    """Plot the temperature ratio against collisions per disk, with the theory of a dilute gas."""
    results = [group.values for group in groups]
    for group in groups:
        if "ratio" in group.values:
            tau, ratio = group.values["collisions_per_disk"], group.values["ratio"]
            reach = ratio_band(group.runs, group.values)
            band(axes, tau, ratio.mean, reach, color=group.colour)
            name_curve(axes, tau[-1], ratio.mean[-1], f"{group.key:g}", group.colour)
    runs = [run for group in groups for run in group.runs]
    kinds = sorted((kind.mass, kind.disks.sum()) for kind in runs[0].by_species)
    alone = all(run.nature <= {*SMOOTH, "obstacles", "walls"} for run in runs)
    equal_speeds = all(abs(found["ratio"].mean[0] - 4) < 1e-6 for found in results)
    if alone and equal_speeds and len(kinds) == 2 and kinds[1] == (4 * kinds[0][0], kinds[0][1]):
        dilute_limit(axes, EQUIPARTITION, "ξ = 1, ")
    axes.axhline(1, color="0.6", lw=0.8, zorder=0)
    last = max(found["collisions_per_disk"][-1] for found in results)
    axes.set(
        xlabel="collisions per disk", xlim=(0, last), ylabel="temperature ratio (heavy / light)"
    )
    axes.xaxis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 5, 10]))
    legend_above(axes)


def draw_overview(axes: plt.Axes, groups: list[Group], against: str) -> None:
    """Plot energies on a logarithmic axis; for more than `FEW` groups, only those of all disks."""
    shown = styles(groups[0].runs[0])[: 1 if len(groups) > FEW else None]
    width = 1.8 if len(groups) > FEW else 1.4
    for group in groups:
        curves = group.values
        for name, style in shown:
            x = curves["time" if against == "time" else "collisions_per_disk"]
            energy = in_time(curves, name) if against == "time" else curves[f"K_{name}"]
            band(axes, x, *energy, color=group.colour, ls=style, lw=width)
            if name == "all":
                name_curve(axes, x[-1], energy.mean[-1], f"{group.key:g}", group.colour)
    for name, style in shown if len(shown) > 1 else ():
        axes.plot([], [], color="0.3", ls=style, label=name)
    units = groups[0].runs[0].units
    axes.set_xlabel(units.label("time") if against == "time" else "collisions per disk")
    axes.set(yscale="log", ylabel="energy / initial mean energy")
    low, high = axes.get_ylim()  # an elastic gas has only rounding errors
    axes.set_ylim(min(low, 0.9), max(high, 1.1))
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("")
    axes.set_xlim(0, max(line.get_xdata()[-1] for line in axes.lines if len(line.get_xdata())))
    legend_above(axes)


def styles(run: Run) -> list[tuple[str, Any]]:
    """Return the line style of all disks and of each species."""
    return list(zip(("all", *run.names), chain("-", cycle(DASHES)), strict=False))


def randomised(run: Run, kind: Species, tau: np.ndarray) -> np.ndarray:
    """Return the variance of the energies of a species at tau, divided by their squared mean.

    Collisions change this ratio from its initial value to 1, the value for an exponential
    distribution.
    """
    first = run.kinetic_energy(0)[kind.disks]
    start = float(np.var(first) / np.mean(first) ** 2) if np.any(first) else 1.0
    # exp(-tau) is the fraction of disks that have not collided
    return 1 - (1 - start) * np.exp(-tau)


def expected_scatter(run: Run, energies: dict[str, np.ndarray], tau: np.ndarray) -> dict:
    """Return the expected standard deviation of the mean energy of a single run, by species.

    It is assumed that the energies of the disks are independent, except that their sum is fixed in
    an elastic gas. Inelastic collisions correlate them, so that the true standard deviation is
    smaller.
    """
    counts = {kind.name: int(kind.disks.sum()) for kind in run.by_species}
    variances = {
        kind.name: counts[kind.name] * energies[kind.name] ** 2 * randomised(run, kind, tau)
        for kind in run.by_species
    }
    total, kept = sum(variances.values()), run.nature.keeps_kinetic_energy
    found = {"all": 0 * total if kept else np.sqrt(total) / run.n_disks}
    for name, own in variances.items():
        fixed = own**2 / np.maximum(total, TINY) if kept else 0.0
        found[name] = np.sqrt(np.maximum(own - fixed, 0)) / counts[name]
    return found


def scatter(runs: list[Run], found: Curves) -> dict[str, np.ndarray]:
    """Return the standard deviation of single runs, for each energy as a function of time.

    If there are at least four runs, it is measured; otherwise the expected value is returned.
    """
    names = ("all", *runs[0].names)
    if len(runs) >= FEWEST_RUNS:
        to_one = np.sqrt(len(runs)) / student(len(runs))
        return {name: found[f"energy_{name}"].error * to_one for name in names}
    tau = np.interp(found["time"], *runs[0].collisions_per_disk)
    means = {name: found[f"energy_{name}"].mean for name in names}
    return expected_scatter(runs[0], means, tau)


def ratio_band(runs: list[Run], found: Curves) -> np.ndarray:
    """Return the half-width of the error band of the temperature ratio.

    For fewer than `FEWEST_RUNS` runs, it is twice the standard deviation of single runs.
    """
    if len(runs) >= FEWEST_RUNS:
        return found["ratio"].error
    both = [runs[0].by_species[k] for k in lightest_and_heaviest(runs[0])]
    parts = [
        randomised(runs[0], kind, found["collisions_per_disk"]) / kind.disks.sum() for kind in both
    ]
    return 2 * np.sqrt(sum(parts)) * found["ratio"].mean


def draw_energies(axes: plt.Axes, group: Group, groups: list[Group], first: bool) -> None:
    """Plot the mean energies for one coefficient of restitution on linear axes.

    The horizontal axis is the time or, for more than `FEW` groups, the number of collisions per
    disk, which all panels have in common.
    """
    runs, found, many = group.runs, group.values, len(groups) > FEW
    x = found["collisions_per_disk" if many else "time"]
    label = "collisions per disk" if many else runs[0].units.label("time")
    names = ("all", *runs[0].names) if len(runs[0].names) > 1 else ("all",)
    labels = {kind.name: kind.label for kind in runs[0].by_species}
    deviations = scatter(runs, found)
    for name, colour in zip(names, ("black", *COLOURS), strict=False):
        style = {"color": colour, "lw": 1.4, "label": labels.get(name, "all disks")}
        band(axes, x, found[f"energy_{name}"].mean, 2 * deviations[name], **style)
    axes.set(xlim=(0, x[-1]), ylim=(0, None), xlabel=label)
    axes.xaxis.set_major_locator(MaxNLocator(4 if many else "auto", steps=[1, 2, 5, 10]))
    differ = len({*map(extent, groups)}) > 1
    axes.set_title(f"{group.key:g}" + f"\n{extent(group)}" * differ)
    if first:
        axes.set_ylabel(runs[0].units.label("mean energy per disk", "energy"))
    if first and not many:
        legend_above(axes)


def extent(group: Group) -> str:
    """Return the number of runs and of collisions per disk of a group."""
    number = f"{len(group.runs)} runs" if len(group.runs) > 1 else "one run"
    return f"{number}, {group.values['collisions_per_disk'][-1]:.3g} collisions/disk"


def legend_of_species(figure: Figure) -> None:
    """Add a legend of the species below all panels, unless only other panels are drawn."""
    for axes in figure.axes:
        handles, labels = axes.get_legend_handles_labels()
        if "all disks" in labels:
            figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
            return


def draw(result: Result) -> Sheet:
    """Plot the energies for each coefficient of restitution, and the temperature ratio."""
    groups, many = result.groups, len(result.groups) > FEW
    columns = int(np.ceil(len(groups) / np.ceil(len(groups) / COLUMNS)))
    aspect = 1.7 if many else 0.3 * columns + 0.2
    single = []
    for k, group in enumerate(groups):
        more = {"share_y": "energy1" * (k > 0), "share_x": "energy1" * (many and k > 0)}
        own = (group, groups, k % columns == 0)
        single.append(Panel(f"energy{k + 1}", draw_energies, own, aspect=aspect, **more))
    energies = [single[k : k + columns] for k in range(0, len(single), columns)]
    time = Panel("time", draw_overview, (groups, "time"), aspect=0.8)
    tau = Panel("collisions", draw_overview, (groups, "tau"), aspect=0.8, share_y="time")
    common = [[time, tau]]
    if any("ratio" in group.values for group in groups):
        common.append([Panel("ratio", draw_ratio, (groups,), aspect=0.38)])
    rows = common + energies if many else energies + common
    words = caption(result.runs)
    if len(extents := {*map(extent, groups)}) == 1:
        words += f", each: {extents.pop()}" if len(groups) > 1 else f", {extents.pop()}"
    if rules := sorted({*map(rule_of, result.runs)} - {""}):
        words += f", wall rule{'s' * (len(rules) > 1)}: {', '.join(rules)}"
    return Sheet(rows, words, legend_of_species if many else None)


class Key(NamedTuple):
    """Contact law and wall rule shared by runs that are averaged."""

    law: Restitution
    wall_rule: str  # empty in a periodic box, or if it is the same in all runs

    def __format__(self, spec: str) -> str:
        return f"ξ = {self.law:{spec}}" + f", wall rule {self.wall_rule}" * bool(self.wall_rule)


def by_collisions(runs: list[Run]) -> list[tuple[Key, list[Run]]]:
    """Group runs with the same restitution of disks and the same wall rule."""
    rules = [rule_of(run) for run in runs]
    one = len({*rules}) == 1
    return grouped(runs, lambda run: Key(run.contact_law, "" if one else rule_of(run)))


def suffix(key: Key) -> str:
    """Return the end of the column names of a group."""
    return f"_xi{key.law:g}" + f"_{key.wall_rule}" * bool(key.wall_rule)


def rule_of(run: Run) -> str:
    """Return the wall rule, empty in a periodic box."""
    return "" if run.periodic.all() else str(run.parameter("contact", "wall_rule", "velocity"))


def table(groups: list[Group]) -> list[dict[str, Any]]:
    """Return the final energy, temperature ratio and fraction of flows, by restitution."""
    several = any(group.key.wall_rule for group in groups)
    return [
        {
            "restitution": group.key.law.name,
            **({"wall_rule": group.key.wall_rule} if several else {}),
            "runs": len(group.runs),
            **measured("energy_left", group.values["K_all"], -1),
            **measured("temperature_ratio", group.values.get("ratio"), -1),
            "flow_share": flow_share(group.runs).share,
        }
        for group in groups
    ]


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return the energies of all species as functions of time and collisions per disk."""
    for group in groups:
        group.values = energies(group.runs)
    for group, colour in zip(groups, ordered_colours(len(groups)), strict=True):
        group.colour = colour
    data = spread({suffix(group.key): group.values for group in groups})
    warnings = flow_notes([(f"{group.key:g}", group.runs) for group in groups])
    return Result(table(groups), notes=[meaning_of_bands(groups)], warnings=warnings, data=data)


def meaning_of_bands(groups: list[Group]) -> str:
    """Return a note on the bands in the figure (see `ratio_band`)."""
    few = [len(group.runs) < FEWEST_RUNS for group in groups]
    text = "Bands in panels of one ξ"
    if any(few) and any("ratio" in group.values for group in groups):
        text += " and of the temperature ratio"
        text += "" if all(few) else f" of fewer than {FEWEST_RUNS} runs"
    text += ": 95 % of single runs" + ", estimated" * any(few) + "."
    if any(len(group.runs) > 1 for group in groups):
        text += " Other bands: standard errors of the mean over the runs."
    return text


ANALYSIS = Analysis(compute, draw, group_by=by_collisions)
