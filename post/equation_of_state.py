"""Equation of state of hard disks: Z = P / (n kT) against packing fraction, three ways.

    python post/equation_of_state.py runs/state/eta_*.h5 -o state.png --csv state.csv

By the virial of the pair collisions; by the collision rate (equal disks); by the force on the sides
(walls).  Means are taken in equilibrium: from where nothing drifts any more, or after --skip.
Errors take the memory of the pressure into account; `samples` is how many independent ones the
virial is worth.  Runs at equal packing fraction are combined.  Elastic runs without gravity.  Disks
between walls are denser away from them: the wall pressure belongs to the area open to the centres,
and differs from the bulk by about 1/sqrt(N).  The curves are those of disks of one radius, and are
left out for others.
"""

from ricochet import Run, RunError, hard_disks
from ricochet.drawing import COLOURS, caption, plt
from ricochet.script import columns, command_line, grouped, launch, measured, read_all, report
from ricochet.statistics import SeriesMean, combined, doubts
from ricochet.thermodynamics import packing, z_rate, z_virial, z_wall

import numpy as np

WAYS = {"virial": "virial", "rate": "collision rate", "walls": "force on the walls"}


def pressures(run: Run, skip: float | None = None) -> dict[str, SeriesMean]:
    """Z by virial, rate, walls, where they apply."""
    if run.gravity.any():
        raise RunError(f"{run.path}: falls, it has no equation of state")
    equal = np.ptp(run.radius) == 0 and np.ptp(run.mass) == 0
    empty = not run.periodic.any() and not run.obstacles and not len(run.walls)
    walled = empty and np.ptp(run.radius) == 0
    ways = {"virial": (z_virial, True), "rate": (z_rate, equal), "walls": (z_wall, walled)}
    return {name: way(run, skip) for name, (way, applies) in ways.items() if applies}


def reference(eta: float, count: int, periodic: bool) -> float:
    """What simulations of others found: fluid to 0.65, crystal beyond 0.72; NaN between."""
    if eta <= 0.5:
        return float(
            hard_disks.simulated_finite(eta, count) if periodic else hard_disks.simulated(eta)
        )
    return float(hard_disks.crystal(eta, count) if eta >= 0.72 else hard_disks.simulated(eta))


def one_radius(runs: list[Run]) -> bool:
    """Whether the curves apply: to all runs, or to none."""
    equal = [bool(np.ptp(run.radius) == 0) for run in runs]
    for run, own in zip(runs, equal, strict=True):
        if own != equal[0]:
            raise RunError(f"{run.path}: not of one radius, or of several, as {runs[0].path} is")
    return equal[0]


def table(
    groups: list[tuple[float, list[Run]]], skip: float | None
) -> tuple[list[dict], list[str]]:
    """A row per packing fraction, empty where a way does not apply; and what speaks against it."""
    rows, notes = [], []
    for eta, runs in groups:
        row = {"packing": eta, "runs": len(runs)}
        found = [pressures(run, skip) for run in runs]
        for name in WAYS:
            members = [one[name] for one in found if name in one]
            row |= measured(f"Z_{name}", combined(members) if len(members) == len(runs) else None)
            notes += doubts(f"η = {eta:g}, {WAYS[name]}", members) if members else []
        row["samples"] = round(combined([one["virial"] for one in found]).samples, 1)
        periodic = bool(runs[0].periodic.all())
        expected = reference(eta, runs[0].count, periodic) if one_radius(runs) else np.nan
        rows.append(row | {"Z_reference": expected if np.isfinite(expected) else None})
    return rows, notes


def draw_curves(above: plt.Axes, below: plt.Axes) -> None:
    """Published equations of state, and the deviation of one of them from the reference."""
    fluid, solid = np.linspace(0, 0.72, 200), np.linspace(0.715, 0.86, 100)
    above.plot(fluid, hard_disks.henderson(fluid), color="0.6", label="Henderson 1975")
    above.plot(
        fluid, hard_disks.simulated(fluid), color="black", lw=1,
        label="Kolafa and Rottner 2006; above 0.5 Erpenbeck and Luban 1985",
    )  # fmt: skip
    above.plot(
        solid, hard_disks.crystal(solid), color="black", lw=1, ls="--",
        label="crystal, Alder, Hoover and Young 1968",
    )  # fmt: skip
    henderson = 100 * (hard_disks.henderson(fluid) / hard_disks.simulated(fluid) - 1)
    below.plot(fluid, henderson, color="0.6")


def draw(rows: list[dict], runs: list[Run]) -> plt.Figure:
    """Z above, its deviation from the reference below."""
    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 8), height_ratios=(2, 1))
    if one_radius(runs):
        draw_curves(above, below)
    else:
        below.set_visible(False)
        above.set_xlabel("packing fraction $\\eta$")
        above.tick_params(labelbottom=True)
    found = {name: np.array(values, dtype=float) for name, values in columns(rows).items()}
    eta, expected = found["packing"], found["Z_reference"]
    for (name, way), marker, colour in zip(WAYS.items(), "oxs", COLOURS, strict=False):
        z, error = found[f"Z_{name}"], found[f"Z_{name}_error"]
        if np.isnan(z).all():
            continue
        style = {"ls": "", "marker": marker, "mfc": "none", "color": colour, "ms": 6}
        above.errorbar(eta, z, error, label=f"by {way}", **style)
        below.errorbar(eta, 100 * (z / expected - 1), 100 * error / expected, **style)
    below.axhline(0, color="black", lw=1, zorder=0)
    largest = np.nanmax(np.abs(100 * (found["Z_virial"] / expected - 1)), initial=0.1)
    below.set(
        xlabel="packing fraction $\\eta$", ylabel="deviation (%)", ylim=(-3 * largest, 3 * largest)
    )
    above.set(
        yscale="log", ylabel="$Z = P\\,/\\,(n\\,kT)$", ylim=(0.9, None),
        title=caption(runs), xlim=(0, 0.05 + max(eta)),
    )  # fmt: skip
    above.legend()
    return figure


def main() -> None:
    args = command_line(__doc__, "equation_of_state.png", skip=None).parse_args()
    runs = read_all(args.runs)
    one_radius(runs)  # refuses a mixture among others
    rows, notes = table(grouped(runs, lambda run: round(packing(run), 6)), args.skip)
    title = "Equation of state of hard disks"
    report(args, runs, title, draw(rows, runs), rows, notes=notes)


if __name__ == "__main__":
    launch(main)
