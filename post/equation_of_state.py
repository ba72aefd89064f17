"""Equation of state of hard disks: Z = P / (n kT) against packing fraction, three ways.

    python post/equation_of_state.py runs/state/eta_*.h5 -o state.png --csv state.csv

By the virial of the pair collisions; by the collision rate (equal disks); by the force on the sides
(walls).  Errors come from 20 blocks of each run.  Runs at equal packing fraction are put together.
Disks between walls are denser away from them: the wall pressure belongs to the area open to the
centres, and differs from the bulk by about 1/sqrt(N).  Elastic runs only; the first 20 collisions
per disk are left out.
"""

import numpy as np

import hard_disks
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
from read_run import Run, RunError
from theory import Estimate
from thermodynamics import combined, packing, z_rate, z_virial, z_wall

NONE = Estimate(float("nan"), float("nan"))


def pressures(run: Run) -> list[Estimate]:
    """Z by virial, rate, walls; NaN where a way is closed."""
    if run.restitution != 1:
        raise RunError(f"{run.path}: is not elastic, it has no equation of state")
    equal = np.ptp(run.radius) == 0 and np.ptp(run.mass) == 0
    walled = not run.periodic.any() and not run.obstacles and np.ptp(run.radius) == 0
    return [z_virial(run), z_rate(run) if equal else NONE, z_wall(run) if walled else NONE]


def reference(eta: float, count: int, periodic: bool) -> float:
    """What simulations of others found: fluid to 0.65, crystal beyond 0.72; NaN between."""
    if eta <= 0.5:
        return float(
            hard_disks.simulated_finite(eta, count) if periodic else hard_disks.simulated(eta)
        )
    return float(hard_disks.crystal(eta, count) if eta >= 0.72 else hard_disks.simulated(eta))


def tabulated(groups: list[tuple[float, list[Run]]]) -> dict[str, list]:
    """A row per packing fraction."""
    table = {"packing": [eta for eta, _ in groups], "runs": [len(runs) for _, runs in groups]}
    rows = [
        [combined(list(way)) for way in zip(*(pressures(run) for run in runs), strict=True)]
        for _, runs in groups
    ]
    for k, name in enumerate(("virial", "rate", "walls")):
        table[f"Z_{name}"] = [float(row[k].mean) for row in rows]
        table[f"Z_{name}_error"] = [float(row[k].error) for row in rows]
    table["Z_reference"] = [
        reference(eta, runs[0].count, bool(runs[0].periodic.all())) for eta, runs in groups
    ]
    return table


def draw(table: dict[str, list], runs: list[Run]) -> plt.Figure:
    """Z above, its deviation from the reference below."""
    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 8), height_ratios=(2, 1))
    fluid = np.linspace(0, 0.72, 200)
    above.plot(fluid, hard_disks.henderson(fluid), color="0.6", label="Henderson 1975")
    above.plot(
        fluid, hard_disks.simulated(fluid), color="black", lw=1,
        label="Kolafa and Rottner 2006; above 0.5 Erpenbeck and Luban 1985",
    )  # fmt: skip
    solid = np.linspace(0.715, 0.86, 100)
    above.plot(
        solid, hard_disks.crystal(solid), color="black", lw=1, ls="--",
        label="crystal, Alder, Hoover and Young 1968",
    )  # fmt: skip
    eta, expected = np.array(table["packing"]), np.array(table["Z_reference"])
    ways = (("virial", "o", 1), ("rate", "x", 1), ("walls", "s", 1))
    for (name, marker, size), colour in zip(ways, COLOURS, strict=False):
        z, error = np.array(table[f"Z_{name}"]), np.array(table[f"Z_{name}_error"])
        if np.isnan(z).all():
            continue
        style = {"ls": "", "marker": marker, "mfc": "none", "color": colour, "ms": 6 * size}
        above.errorbar(eta, z, error, label=f"by {labels()[name]}", **style)
        below.errorbar(eta, 100 * (z / expected - 1), 100 * error / expected, **style)
    henderson = 100 * (hard_disks.henderson(fluid) / hard_disks.simulated(fluid) - 1)
    below.plot(fluid, henderson, color="0.6")
    below.axhline(0, color="black", lw=1, zorder=0)
    largest = np.nanmax(np.abs(100 * (np.array(table["Z_virial"]) / expected - 1)), initial=0.1)
    below.set(
        xlabel="packing fraction $\\eta$", ylabel="deviation (%)", ylim=(-3 * largest, 3 * largest)
    )
    above.set(
        yscale="log", ylabel="$Z = P\\,/\\,(n\\,kT)$", ylim=(0.9, None),
        title=caption(runs), xlim=(0, 0.05 + max(eta)),
    )  # fmt: skip
    above.legend()
    return figure


def labels() -> dict[str, str]:
    """What the ways are called in the figure."""
    return {"virial": "virial", "rate": "collision rate", "walls": "force on the walls"}


def main() -> None:
    args = command_line(__doc__, "equation_of_state.png", table=True).parse_args()
    runs = read_all(args.runs)
    groups = grouped(runs, lambda run: round(packing(run), 6))
    table = tabulated(groups)
    print_table(table)
    save(draw(table, runs), args.output, runs, "Equation of state of hard disks")
    if args.csv:
        write_csv(args.csv, table)


if __name__ == "__main__":
    launch(main)
