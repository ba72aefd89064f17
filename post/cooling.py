"""Mean kinetic energy in time, elastic and inelastic, of each species of a mixture.

    python post/cooling.py runs/cooling/*.h5 -o cooling.png --csv cooling.csv

Runs are combined by restitution xi; lines are means over the runs, bands are errors.  K is
per disk and in units of its start value over all disks.  The lowest row shows the temperature ratio
of the heaviest to the lightest species, 1 in equilibrium; not for equal masses.  The table has all
curves, against collisions per disk in the same units, against time in those of the input.
"""

from itertools import chain, cycle

from ricochet import Run
from ricochet.analysis.cooling import SMOOTH, Curves, energies
from ricochet.analysis.statistics import Estimate
from ricochet.figures.drawing import band, caption, colours, dilute_limit, plt
from ricochet.predictions.theory import EQUIPARTITION
from ricochet.script import by_restitution, command_line, launch, measured, report, spread

DASHES = ("--", ":", "-.", (0, (5, 1)), (0, (1, 3)), (0, (8, 3)))  # line styles of the species


def in_time(found: Curves, name: str) -> Estimate:
    """Draw an energy over that of all disks at the start, against time."""
    first = found["energy_all"].mean[0]
    return Estimate(*(part / first for part in found[f"energy_{name}"]))


def draw_ratio(axes: plt.Axes, groups: list, results: list[Curves]) -> None:
    """Draw the temperature ratio against collisions, with the dilute limit."""
    for (xi, _), found, colour in zip(groups, results, colours(len(groups), 2), strict=True):
        if "ratio" in found:
            tau, ratio = found["collisions_per_disk"], found["ratio"]
            band(axes, tau, *ratio, color=colour, label=f"ξ = {xi:g}")
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


def draw(runs: list[Run], groups: list, results: list[Curves]) -> plt.Figure:
    """Draw energies against time and collisions, and the ratio; colours mean restitution."""
    rows = 1 + any("ratio" in found for found in results)
    figure = plt.figure(figsize=(11, 4.5 + 3 * (rows - 1)))
    grid = figure.add_gridspec(rows, 2, height_ratios=(1.5, 1)[:rows])
    left = figure.add_subplot(grid[0, 0])
    right = figure.add_subplot(grid[0, 1], sharey=left)
    styles = list(zip(("all", *runs[0].names), chain("-", cycle(DASHES)), strict=False))
    for (xi, _), found, colour in zip(groups, results, colours(len(groups), 2), strict=True):
        for name, style in styles:
            line = {"color": colour, "ls": style, "lw": 1.4}
            band(left, found["time"], *in_time(found, name), **line)
            band(right, found["collisions_per_disk"], *found[f"K_{name}"], **line)
        left.plot([], [], color=colour, label=f"ξ = {xi:g}")
    for name, style in styles:
        right.plot([], [], color="0.3", ls=style, label=name)
    left.set(yscale="log", xlabel=runs[0].units.label("time"))
    low, high = left.get_ylim()  # for an elastic gas the limits would enclose rounding only
    left.set_ylim(min(low, 0.9), max(high, 1.1))
    left.set_ylabel("$\\langle K \\rangle\\,/\\,\\langle K \\rangle_{all,\\,t=0}$")
    right.set(xlabel="collisions per disk")
    for axes in (left, right):
        axes.set_xlim(0, max(line.get_xdata()[-1] for line in axes.lines if len(line.get_xdata())))
        axes.legend(loc="lower left")
    if rows == 2:
        draw_ratio(figure.add_subplot(grid[1, :]), groups, results)
    figure.suptitle(f"{caption(runs)}, wall rule: {runs[0].parameter('contact', 'wall_rule', '')}")
    return figure


def table(groups: list, results: list[Curves]) -> list[dict]:
    """Return a row for each restitution: energy and temperature ratio at the end."""
    return [
        {
            "restitution": xi.name,
            "runs": len(runs),
            **measured("energy_left", in_time(found, "all"), -1),
            **measured("temperature_ratio", found.get("ratio"), -1),
        }
        for (xi, runs), found in zip(groups, results, strict=True)
    ]


def main() -> None:
    args = command_line(__doc__, "cooling.png").parse_args()
    groups = by_restitution(args.runs)
    results = [energies(members) for _, members in groups]
    data = spread({f"_xi{xi:g}": own for (xi, _), own in zip(groups, results, strict=True)})
    report(args, draw(args.runs, groups, results), table(groups, results), data=data)


if __name__ == "__main__":
    launch(main)
