"""Mean kinetic energy of a mixture in time, elastic and inelastic.

    python post/cooling.py runs/cooling/*.h5 -o cooling.png --csv cooling.csv

Runs are put together by restitution xi; lines are means over the runs, bands are standard
errors.  K is per disk and in units of its start value over all disks.  The lowest row shows
the temperature ratio of the heaviest to the lightest species, 1 in equilibrium.
"""

from typing import NamedTuple

import numpy as np

from drawing import (
    COLOURS,
    band,
    caption,
    command_line,
    dilute_limit,
    grouped,
    launch,
    plt,
    read_all,
    save,
    write_csv,
)
from read_run import Run
from theory import Estimate, estimate

# Dilute elastic mixture, half m and half 4 m, equal speeds at the start: Boltzmann equation.
EQUIPARTITION = np.array(
    [(0, 4), (1, 2.02), (2, 1.455), (3, 1.228), (4, 1.115), (5, 1.062), (6, 1.031), (8, 1.005)]
)


class Cooling(NamedTuple):
    """The energies of runs that differ by their seed; values (S, P), S = all and each species."""

    by_time: tuple[np.ndarray, Estimate]
    by_collisions: tuple[np.ndarray, Estimate]
    ratio: Estimate  # (P,) heaviest to lightest, at the collisions


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
    heavy, light = 1 + heaviest(runs[0]), 1 + lightest(runs[0])
    ratio = by_tau[:, heavy] / by_tau[:, light]
    return Cooling((time, estimate(by_time)), (tau, estimate(by_tau)), estimate(ratio))


def heaviest(run: Run) -> int:
    """Index of the species with the largest mass."""
    return int(np.argmax([run.mass[run.of_species(name)][0] for name in run.names]))


def lightest(run: Run) -> int:
    """Index of the species with the smallest mass."""
    return int(np.argmin([run.mass[run.of_species(name)][0] for name in run.names]))


def draw(groups: list[tuple[float, list[Run]]], results: list[Cooling]) -> plt.Figure:
    """Columns: restitution.  Rows: against time, against collisions; below the ratio."""
    figure = plt.figure(figsize=(10, 9))
    grid = figure.add_gridspec(3, len(groups))
    labels = ("all", *groups[0][1][0].names)
    colours = ("black", *COLOURS)
    floor = min(r.by_time[1].mean.min() for r in results)
    for column, ((xi, _), result) in enumerate(zip(groups, results, strict=True)):
        for row, (x, y) in enumerate((result.by_time, result.by_collisions)):
            axes = figure.add_subplot(grid[row, column])
            for label, mean, error, colour in zip(labels, y.mean, y.error, colours, strict=False):
                band(axes, x, mean, error, color=colour, label=label)
            axes.set(yscale="log", ylim=(0.8 * floor, 2), xlim=(0, x[-1]))
            axes.set_xlabel("collisions per disk" if row else "time (reduced units)")
            if column == 0:
                axes.set_ylabel("$\\langle K \\rangle\\,/\\,\\langle K \\rangle_{all,\\,t=0}$")
            if row == 0:
                axes.set_title(f"ξ = {xi:g}")
            if row == column == 0:
                axes.legend()
    axes = figure.add_subplot(grid[2, :])
    for (xi, _), result, colour in zip(groups, results, COLOURS[2:], strict=False):
        band(axes, result.by_collisions[0], *result.ratio, color=colour, label=f"ξ = {xi:g}")
    dilute_limit(axes, EQUIPARTITION, "ξ = 1, ")
    axes.axhline(1, color="0.6", lw=0.8, zorder=0)
    axes.set(xlabel="collisions per disk", xlim=(0, None), ylabel="temperature ratio heavy / light")
    axes.legend(ncols=2)
    runs = [run for _, members in groups for run in members]
    figure.suptitle(
        f"{caption(runs)}, wall rule: {runs[0].parameter('contact', 'wall_rule', '')}", fontsize=10
    )
    return figure


def main() -> None:
    args = command_line(__doc__, "cooling.png", table=True).parse_args()
    runs = read_all(args.runs)
    groups = grouped(runs, lambda run: run.restitution)
    results = [cooling(members) for _, members in groups]
    for (xi, members), result in zip(groups, results, strict=True):
        left = Estimate(result.by_time[1].mean[0, -1], result.by_time[1].error[0, -1])
        ratio = Estimate(result.ratio.mean[-1], result.ratio.error[-1])
        print(
            f"restitution = {xi:g}  runs = {len(members)}  energy_left = {left}  "
            f"temperature_ratio = {ratio}"
        )
    save(draw(groups, results), args.output, runs, "Cooling and equipartition of a mixture")
    if args.csv:
        write_csv(args.csv, columns(groups, results))


def columns(groups: list, results: list[Cooling]) -> dict[str, np.ndarray]:
    """All curves against collisions per disk."""
    names = ("all", *groups[0][1][0].names)
    table = {}
    for (xi, _), result in zip(groups, results, strict=True):
        tau, energy = result.by_collisions
        table[f"collisions_per_disk_xi{xi:g}"] = tau
        for name, mean, error in zip(names, *energy, strict=True):
            table[f"K_{name}_xi{xi:g}"], table[f"K_{name}_error_xi{xi:g}"] = mean, error
        table[f"ratio_xi{xi:g}"], table[f"ratio_error_xi{xi:g}"] = result.ratio
    return table


if __name__ == "__main__":
    launch(main)
