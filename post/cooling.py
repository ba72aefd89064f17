"""Mean kinetic energy of each species of an elastic or inelastic mixture against time.

    python post/cooling.py runs/cooling/*.h5 -o cooling.png --csv cooling.csv

Runs with the same coefficient of restitution xi are combined, and lines show means over the runs.
The panels of the first row, one for each xi, show the mean kinetic energy per disk against time in
the units of the input.  The bands in the first row contain the results of 95 % of single runs.  The
width of the bands in the first row is measured if there are at least four runs, and is otherwise
estimated from the numbers of disks.  The panels of the second row compare all values of xi on a
logarithmic axis.  The second row shows the kinetic energy per disk of each species, divided by the
initial mean over all disks; bands show the errors of the means.  The third row shows the ratio of
the temperatures of the heaviest and the lightest species, which is 1 in equilibrium.  The third row
is omitted if all masses are equal.  If there are fewer than four runs, the half-width of the band
around the temperature ratio is twice the standard deviation of the ratio over single runs.  The
table contains the reduced energies against collisions per disk, and the energies in the units of
the input against time.  The script prints a warning if the gas is not homogeneous at the end,
because its temperature ratio is then not that of the homogeneous state.
"""

from itertools import chain, cycle

from ricochet import Run
from ricochet.analysis.cooling import SMOOTH, Curves, energies, flow_notes, flow_share
from ricochet.analysis.estimates import FEWEST_RUNS, Estimate, student
from ricochet.analysis.thermodynamics import lightest_and_heaviest
from ricochet.figures.drawing import COLOURS, band, caption, colours, dilute_limit, plt
from ricochet.predictions.theory import EQUIPARTITION
from ricochet.reading.reader import Restitution, Species
from ricochet.script import by_restitution, command_line, launch, measured, report, spread

import numpy as np
from matplotlib.ticker import LogLocator

TINY = np.finfo(float).tiny
DASHES = ("--", ":", "-.", (0, (5, 1)), (0, (1, 3)), (0, (8, 3)))  # line styles of the species


def in_time(found: Curves, name: str) -> Estimate:
    """Return the energy of a species as a function of time, in units of the initial mean energy."""
    first = found["energy_all"].mean[0]
    return Estimate(*(part / first for part in found[f"energy_{name}"]))


def draw_ratio(axes: plt.Axes, groups: list, results: list[Curves]) -> None:
    """Draw the temperature ratio against collisions per disk, with the theory for a dilute gas."""
    for (xi, own), found, colour in zip(groups, results, colours(len(groups), 2), strict=True):
        if "ratio" in found:
            tau, ratio = found["collisions_per_disk"], found["ratio"]
            band(axes, tau, ratio.mean, ratio_band(own, found), color=colour, label=f"ξ = {xi:g}")
    if any(len(own) < FEWEST_RUNS for _, own in groups):
        axes.fill_between([], [], color="0.85", label="95 % of single runs, estimated")
    runs = [run for _, own in groups for run in own]
    kinds = sorted((kind.mass, kind.disks.sum()) for kind in runs[0].by_species)
    alone = all(run.nature <= {*SMOOTH, "obstacles", "walls"} for run in runs)
    equal_speeds = all(abs(found["ratio"].mean[0] - 4) < 1e-6 for found in results)
    if alone and equal_speeds and len(kinds) == 2 and kinds[1] == (4 * kinds[0][0], kinds[0][1]):
        dilute_limit(axes, EQUIPARTITION, "ξ = 1, ")
    axes.axhline(1, color="0.6", lw=0.8, zorder=0)
    last = max(found["collisions_per_disk"][-1] for found in results)
    axes.set(xlabel="collisions per disk", xlim=(0, last), ylabel="temperature ratio heavy / light")
    axes.legend(ncols=2)


def draw_overview(figure: plt.Figure, places: tuple, runs: list[Run], found: list) -> None:
    """Draw all energies on logarithmic axes, with a colour for each coefficient of restitution."""
    left = figure.add_subplot(places[0])
    right = figure.add_subplot(places[1], sharey=left)
    styles = list(zip(("all", *runs[0].names), chain("-", cycle(DASHES)), strict=False))
    for ((xi, _), curves), colour in zip(found, colours(len(found), 2), strict=True):
        for name, style in styles:
            line = {"color": colour, "ls": style, "lw": 1.4}
            band(left, curves["time"], *in_time(curves, name), **line)
            band(right, curves["collisions_per_disk"], *curves[f"K_{name}"], **line)
        left.plot([], [], color=colour, label=f"ξ = {xi:g}")
    for name, style in styles:
        right.plot([], [], color="0.3", ls=style, label=name)
    left.set(yscale="log", xlabel=runs[0].units.label("time"))
    low, high = left.get_ylim()  # an elastic gas has rounding errors only
    left.set_ylim(min(low, 0.9), max(high, 1.1))
    left.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    left.yaxis.set_major_formatter("{x:g}")
    left.yaxis.set_minor_formatter("")
    left.set_ylabel("$\\langle K \\rangle\\,/\\,\\langle K \\rangle_{all,\\,t=0}$")
    right.set(xlabel="collisions per disk")
    for axes in (left, right):
        axes.set_xlim(0, max(line.get_xdata()[-1] for line in axes.lines if len(line.get_xdata())))
        axes.legend(loc="lower left")


def randomised(run: Run, kind: Species, tau: np.ndarray) -> np.ndarray:
    """Return the variance of the energies in a species, divided by the squared mean energy.

    Collisions change the ratio of the variance to the squared mean from its initial value to 1,
    which is the value for an exponential distribution.
    """
    first = run.kinetic_energy(0)[kind.disks]
    start = float(np.var(first) / np.mean(first) ** 2) if np.any(first) else 1.0
    return 1 - (1 - start) * np.exp(-tau)  # exp(-tau): fraction without a collision


def expected_scatter(run: Run, energies: dict[str, np.ndarray], tau: np.ndarray) -> dict:
    """Return the expected standard deviation of the mean energy in single runs.

    The keys of the returned dictionary are the names of the species, and "all" for all disks.

    The energies of the disks are assumed to be independent or, in an elastic gas, independent
    except for their fixed sum.  Inelastic collisions correlate the energies of the disks, and
    therefore the true standard deviation is smaller than the estimate that the function returns.
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
    """Return the standard deviation of each energy over single runs as a function of time.

    If there are at least four runs, the standard deviation is measured; otherwise the expected
    standard deviation is returned.
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

    If there are fewer than `FEWEST_RUNS` runs, the function returns twice the standard deviation of
    the temperature ratio over single runs.
    """
    if len(runs) >= FEWEST_RUNS:
        return found["ratio"].error
    both = [runs[0].by_species[k] for k in lightest_and_heaviest(runs[0])]
    parts = [
        randomised(runs[0], kind, found["collisions_per_disk"]) / kind.disks.sum() for kind in both
    ]
    return 2 * np.sqrt(sum(parts)) * found["ratio"].mean


def draw_energies(axes: plt.Axes, runs: list[Run], found: Curves, xi: Restitution) -> None:
    """Draw the mean energies for one coefficient of restitution on linear axes."""
    names = ("all", *runs[0].names) if len(runs[0].names) > 1 else ("all",)
    labels, deviations = (
        {kind.name: kind.label for kind in runs[0].by_species},
        scatter(runs, found),
    )
    for name, colour in zip(names, ("black", *COLOURS), strict=False):
        style = {"color": colour, "lw": 1.4, "label": labels.get(name, "all disks")}
        band(axes, found["time"], found[f"energy_{name}"].mean, 2 * deviations[name], **style)
    units, tau = runs[0].units, found["collisions_per_disk"][-1]
    number = f"mean of {len(runs)} runs" if len(runs) > 1 else "one run"
    axes.set(xlim=(0, found["time"][-1]), ylim=(0, None), xlabel=units.label("time"))
    axes.set_title(f"ξ = {xi:g}: {number}, to {tau:.3g} collisions per disk")


def draw(runs: list[Run], groups: list, results: list[Curves]) -> plt.Figure:
    """Draw the energies for each coefficient of restitution, and the temperature ratio."""
    ratio = any("ratio" in found for found in results)
    columns = min(len(groups), 3)
    above = -(-len(groups) // columns)
    heights = [1.2] * above + [1.4] + [1.0] * ratio
    figure = plt.figure(figsize=(max(4.2 * columns, 11), 3.2 * sum(heights)))
    grid = figure.add_gridspec(len(heights), 6, height_ratios=heights)
    for k, ((xi, own), found) in enumerate(zip(groups, results, strict=True)):
        width = 6 // columns
        row, left = k // columns, width * (k % columns)
        axes = figure.add_subplot(grid[row, left : left + width])
        draw_energies(axes, own, found, xi)
        if left == 0:
            axes.set_ylabel(runs[0].units.label("mean energy per disk", "energy"))
        if k == 0:
            measured = all(len(own) >= FEWEST_RUNS for _, own in groups)
            title = "band: 95 % of single runs" + ("" if measured else " at least, estimated")
            axes.legend(loc="upper right", title=title)
    places = grid[above, :3], grid[above, 3:]
    draw_overview(figure, places, runs, list(zip(groups, results, strict=True)))
    if ratio:
        draw_ratio(figure.add_subplot(grid[above + 1, :]), groups, results)
    figure.suptitle(f"{caption(runs)}, wall rule: {runs[0].parameter('contact', 'wall_rule', '')}")
    return figure


def table(groups: list, results: list[Curves]) -> list[dict]:
    """Return energy, temperature ratio and share of flows at the end, by restitution."""
    return [
        {
            "restitution": xi.name,
            "runs": len(runs),
            **measured("energy_left", found["K_all"], -1),
            **measured("temperature_ratio", found.get("ratio"), -1),
            "flow_share": flow_share(runs).share,
        }
        for (xi, runs), found in zip(groups, results, strict=True)
    ]


def main() -> None:
    args = command_line(__doc__, "cooling.png").parse_args()
    groups = by_restitution(args.runs)
    results = [energies(members) for _, members in groups]
    data = spread({f"_xi{xi:g}": own for (xi, _), own in zip(groups, results, strict=True)})
    notes = flow_notes([(f"ξ = {xi:g}", members) for xi, members in groups])
    report(args, draw(args.runs, groups, results), table(groups, results), data=data, notes=notes)


if __name__ == "__main__":
    launch(main)
