"""Two species under gravity: when do their kinetic energies agree?

    python post/equipartition.py runs/gravity_v0/*.h5 -o equipartition.png --csv times.csv

Runs are put together by the width v0 of the start velocities; energies are means over the runs
and over windows of --window.  T_therm is the middle of the first window from which the two agree
within --within for three windows.  A single pair of energies is no measure: with 30 + 30 disks
their ratio fluctuates by 26 % in equilibrium, so take many runs.  The equilibrium values in the
table are means over the second half of the time.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cooling import heaviest, lightest
from drawing import (
    COLOURS,
    caption,
    command_line,
    grouped,
    launch,
    plt,
    print_table,
    read_all,
    save,
    write_csv,
)
from read_run import Run
from theory import Estimate, estimate


class Approach(NamedTuple):
    """Kinetic energies of the two species in time windows."""

    time: np.ndarray  # (W,) middles
    light: Estimate  # (W,)
    heavy: Estimate
    thermalisation: float  # NaN if they never agree


def windows(time: np.ndarray, value: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Means over windows of a series; incomplete last window left out."""
    count = max(1, int(np.floor((time[-1] - time[0]) / width + 1e-9)))
    index = np.minimum(((time - time[0]) / width).astype(int), count)
    sums = np.bincount(index, value, count + 1)[:count]
    numbers = np.bincount(index, minlength=count + 1)[:count]
    return time[0] + (np.arange(count) + 0.5) * width, sums / np.maximum(numbers, 1)


def thermalisation_time(
    time: np.ndarray, light: np.ndarray, heavy: np.ndarray, within: float = 0.1, lasting: int = 3
) -> float:
    """First time from which |heavy / light - 1| <= within for `lasting` windows in a row."""
    close = np.abs(heavy / light - 1) <= within
    for k in range(len(time) - lasting + 1):
        if close[k : k + lasting].all():
            return float(time[k])
    return float("nan")


def approach(runs: list[Run], width: float, within: float) -> Approach:
    """Means over runs of the windowed energies of the lightest and the heaviest species."""
    names = (runs[0].names[lightest(runs[0])], runs[0].names[heaviest(runs[0])])
    both = []
    for name in names:
        tracks = [windows(*run.observable(f"{name}/kinetic_energy"), width) for run in runs]
        time = tracks[0][0]
        both.append(estimate([values for _, values in tracks]))
    light, heavy = both
    return Approach(time, light, heavy, thermalisation_time(time, light.mean, heavy.mean, within))


def settled(group: list[Run], quantity: Callable[[Run], str]) -> Estimate:
    """Mean over runs of an observable's mean over the second half of the time."""
    means = []
    for run in group:
        time, value = run.observable(quantity(run))
        means.append(value[time >= (time[0] + time[-1]) / 2].mean())
    return estimate(means)


def energy_per_disk(group: list[Run]) -> Estimate:
    """Total energy at the start over the number of disks."""
    return estimate([run.observable("total_energy").value[0] / run.count for run in group])


def tabulated(groups: list, results: list[Approach]) -> dict[str, list]:
    """A row per v0."""
    members = [runs for _, runs in groups]
    energy = [energy_per_disk(runs) for runs in members]
    light = [settled(r, lambda run: f"{run.names[lightest(run)]}/kinetic_energy") for r in members]
    heavy = [settled(r, lambda run: f"{run.names[heaviest(run)]}/kinetic_energy") for r in members]
    columns = {"v0": [v0 for v0, _ in groups], "runs": [len(runs) for runs in members]}
    columns["T_therm"] = [result.thermalisation for result in results]
    for name, values in (("energy", energy), ("K_light", light), ("K_heavy", heavy)):
        columns[name] = [float(value.mean) for value in values]
        columns[f"{name}_error"] = [float(value.error) for value in values]
    return columns


def start_width(run: Run) -> float:
    """v0: the largest `speed` that the input asks for."""
    species = run.parameters.get("species", {})
    return max(float(species.get(name, {}).get("speed", 0.0)) for name in run.names)


def draw(groups: list, results: list[Approach], until: float, within: float) -> plt.Figure:
    """A panel per v0."""
    figure, panels = plt.subplots(
        len(groups), 1, sharex=True, squeeze=False, figsize=(8, 1.2 + 2.1 * len(groups))
    )
    names = groups[0][1][0].names
    order = (lightest(groups[0][1][0]), heaviest(groups[0][1][0]))
    for axes, (v0, runs), result in zip(panels.flat, groups, results, strict=True):
        for k, energy in zip(order, (result.light, result.heavy), strict=True):
            axes.errorbar(
                result.time, energy.mean, energy.error, color=COLOURS[k], marker=".", label=names[k]
            )
        if np.isfinite(result.thermalisation):
            axes.axvline(
                result.thermalisation,
                color="0.5",
                ls="--",
                lw=1,
                label=f"equal to {100 * within:g} % from t = {result.thermalisation:.3g}",
            )
        axes.set(ylabel="⟨K⟩ per disk", title=f"$v_0$ = {v0:g},  {caption(runs)}", xlim=(0, until))
        axes.set_ylim(0, None)
        axes.legend(ncols=3, loc="lower right")
    panels[-1, 0].set_xlabel("time (reduced units)")
    return figure


def main() -> None:
    parser = command_line(__doc__, "equipartition.png", table=True)
    parser.add_argument("--window", type=float, default=0.5, help="time averaged over [0.5]")
    parser.add_argument("--within", type=float, default=0.1, help="relative difference [0.1]")
    parser.add_argument("--until", type=float, default=20, help="end of the time axis [20]")
    args = parser.parse_args()
    runs = read_all(args.runs)
    groups = grouped(runs, start_width)
    results = [approach(members, args.window, args.within) for _, members in groups]
    table = tabulated(groups, results)
    print_table(table)
    save(
        draw(groups, results, args.until, args.within),
        args.output,
        runs,
        "Equipartition under gravity",
    )
    if args.csv:
        write_csv(args.csv, table)


if __name__ == "__main__":
    launch(main)
