"""Mean kinetic energy in time, elastic and inelastic, of each species of a mixture.

    python post/cooling.py runs/cooling/*.h5 -o cooling.png --csv cooling.csv

Runs are combined by restitution xi; lines are means over the runs, bands are standard errors.  K is
per disk and in units of its start value over all disks.  The lowest row shows the temperature ratio
of the heaviest to the lightest species, 1 in equilibrium; not for equal masses.  The table has all
curves, against collisions per disk in the same units, against time in those of the input.
"""

from itertools import chain, cycle
from typing import NamedTuple

from ricochet import Run
from ricochet.drawing import band, caption, colours, dilute_limit, plt
from ricochet.script import command_line, grouped, launch, measured, read_all, report
from ricochet.statistics import Estimate, estimate
from ricochet.theory import EQUIPARTITION
from ricochet.thermodynamics import lightest_and_heaviest

import numpy as np

DASHES = ("--", ":", "-.", (0, (5, 1)), (0, (1, 3)), (0, (8, 3)))  # of the species


class Cooling(NamedTuple):
    """The energies of runs that differ by their seed; values (S, P), S = all and each species."""

    by_time: tuple[np.ndarray, Estimate]
    by_collisions: tuple[np.ndarray, Estimate]
    ratio: Estimate | None  # (P,) heaviest to lightest, at the collisions
    first: float  # energy per disk at the start


def energies(run: Run) -> np.ndarray:
    """(1 + S, T) kinetic energy per disk of all and of each species over that of all at t = 0."""
    values = np.array(
        [run.observable(f"{name}/kinetic_energy").value for name in ("all", *run.names)]
    )
    return values / values[0, 0]


def cooling(runs: list[Run], points: int = 201) -> Cooling:
    """Means over runs on common grids of time and of collisions per disk."""
    tracks = [(*run.collisions_per_disk, energies(run)) for run in runs]
    time = np.linspace(0, min(t[-1] for t, _, _ in tracks), points)
    tau = np.linspace(0, min(c[-1] for _, c, _ in tracks), points)
    by_time = np.array([[np.interp(time, t, k) for k in ks] for t, _, ks in tracks])
    by_tau = np.array([[np.interp(tau, c, k) for k in ks] for _, c, ks in tracks])
    ratio = None
    if np.ptp(runs[0].mass) > 0:
        light, heavy = lightest_and_heaviest(runs[0])
        ratio = estimate(by_tau[:, 1 + heavy] / by_tau[:, 1 + light])
    first = np.mean([run.observable("all/kinetic_energy").value[0] for run in runs])
    return Cooling((time, estimate(by_time)), (tau, estimate(by_tau)), ratio, float(first))


def draw_ratio(axes: plt.Axes, groups: list, results: list[Cooling]) -> None:
    """The temperature ratio against collisions, beside the dilute limit."""
    for (xi, _), result, colour in zip(groups, results, colours(len(groups), 2), strict=True):
        if result.ratio is not None:
            band(axes, result.by_collisions[0], *result.ratio, color=colour, label=f"ξ = {xi:g}")
    kinds = sorted((kind.mass, kind.disks.sum()) for kind in groups[0][1][0].by_species)
    if len(kinds) == 2 and kinds[1] == (4 * kinds[0][0], kinds[0][1]):
        dilute_limit(axes, EQUIPARTITION, "ξ = 1, ")
    axes.axhline(1, color="0.6", lw=0.8, zorder=0)
    last = max(result.by_collisions[0][-1] for result in results)
    axes.set(xlabel="collisions per disk", xlim=(0, last), ylabel="temperature ratio heavy / light")
    axes.legend(ncols=2)


def draw(groups: list[tuple[float, list[Run]]], results: list[Cooling]) -> plt.Figure:
    """Against time, against collisions; below the ratio.  Colours: restitution."""
    rows = 1 + any(result.ratio is not None for result in results)
    figure = plt.figure(figsize=(11, 4.5 + 3 * (rows - 1)))
    grid = figure.add_gridspec(rows, 2, height_ratios=(1.5, 1)[:rows])
    left = figure.add_subplot(grid[0, 0])
    right = figure.add_subplot(grid[0, 1], sharey=left)
    styles = list(zip(("all", *groups[0][1][0].names), chain("-", cycle(DASHES)), strict=False))
    for (xi, _), result, colour in zip(groups, results, colours(len(groups), 2), strict=True):
        for axes, (x, y) in ((left, result.by_time), (right, result.by_collisions)):
            for (_, style), mean, error in zip(styles, y.mean, y.error, strict=False):
                band(axes, x, mean, error, color=colour, ls=style, lw=1.4)
        left.plot([], [], color=colour, label=f"ξ = {xi:g}")
    for name, style in styles:
        right.plot([], [], color="0.3", ls=style, label=name)
    left.set(yscale="log", xlabel="time (reduced units)")
    left.set_ylabel("$\\langle K \\rangle\\,/\\,\\langle K \\rangle_{all,\\,t=0}$")
    right.set(xlabel="collisions per disk")
    for axes in (left, right):
        axes.set_xlim(0, max(line.get_xdata()[-1] for line in axes.lines if len(line.get_xdata())))
        axes.legend(loc="lower left")
    if rows == 2:
        draw_ratio(figure.add_subplot(grid[1, :]), groups, results)
    runs = [run for _, members in groups for run in members]
    figure.suptitle(
        f"{caption(runs)}, wall rule: {runs[0].parameter('contact', 'wall_rule', '')}", fontsize=10
    )
    return figure


def table(groups: list, results: list[Cooling]) -> list[dict]:
    """A row per restitution: energy and temperature ratio at the end."""
    rows = []
    for (xi, runs), found in zip(groups, results, strict=True):
        energy = found.by_time[1]
        left = measured("energy_left", Estimate(energy.mean[0, -1], energy.error[0, -1]))
        ratio = found.ratio and Estimate(found.ratio.mean[-1], found.ratio.error[-1])
        row = {"restitution": xi, "runs": len(runs)}
        rows.append(row | left | measured("temperature_ratio", ratio))
    return rows


def curves(groups: list, results: list[Cooling]) -> dict[str, np.ndarray]:
    """All curves: relative ones against collisions per disk, energies against time."""
    names = ("all", *groups[0][1][0].names)
    columns = {}
    for (xi, _), result in zip(groups, results, strict=True):
        tau, energy = result.by_collisions
        columns[f"collisions_per_disk_xi{xi:g}"] = tau
        for name, mean, error in zip(names, *energy, strict=True):
            columns[f"K_{name}_xi{xi:g}"], columns[f"K_{name}_error_xi{xi:g}"] = mean, error
        if result.ratio:
            columns[f"ratio_xi{xi:g}"], columns[f"ratio_error_xi{xi:g}"] = result.ratio
        time, energy = result.by_time
        columns[f"time_xi{xi:g}"] = time
        for name, *both in zip(names, *energy, strict=True):
            column = f"energy_{name}_xi{xi:g}", f"energy_{name}_error_xi{xi:g}"
            columns |= zip(column, np.array(both) * result.first, strict=True)
    return columns


def main() -> None:
    args = command_line(__doc__, "cooling.png").parse_args()
    runs = read_all(args.runs)
    groups = grouped(runs, lambda run: run.restitution)
    results = [cooling(members) for _, members in groups]
    figure, rows = draw(groups, results), table(groups, results)
    title = "Cooling and equipartition of a mixture"
    report(args, runs, title, figure, rows, data=curves(groups, results))


if __name__ == "__main__":
    launch(main)
