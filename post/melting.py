"""Melting of hard disks: pressure against packing fraction for each number of disks.

    python post/melting.py runs/melting/*/*.h5 -o melting.png --csv melting.csv

The reduced pressure is P* = P d^2 / kT, where d is the diameter of the disks and P is calculated
from the virial. P* is averaged in equilibrium, which begins after the first X collisions per disk,
where X is the value of --equilibration, or by default when no observable drifts any longer.  The
disks must be equal and the box must be periodic.  In an infinite system, the liquid and the hexatic
phase coexist at P* = 9.185 between the packing fractions 0.700 and 0.716. In a finite box the
pressure is not constant in the coexistence region, and a plot of the pressure contains a loop.  The
loop of the pressure is caused by the interface between the two phases, and becomes flatter for
larger N.  Published values are from Engel and others, Physical Review E 87, 042134 (2013), and for
N = 128^2 from Li and others, Journal of Chemical Physics 157, 234111 (2022).  Near melting, the
warnings about errors are important, because correlation times are long.
"""

from ricochet import Run
from ricochet.analysis.statistics import combine_runs
from ricochet.analysis.thermodynamics import z_virial
from ricochet.figures.drawing import caption, colours, plt
from ricochet.predictions.hard_disks import MELTING
from ricochet.reading.nature import allow
from ricochet.script import by_packing, command_line, grouped, launch, over_runs, report

import numpy as np


def table(runs: list[Run], skip: float | None) -> tuple[list[dict], list[str]]:
    """Return a table row for each number of disks and packing fraction, and warnings."""
    rows, notes = [], []
    for count, own in grouped(runs, lambda run: run.n_disks):
        for eta, same in by_packing(own):
            members = [z_virial(run, skip).scaled(4 * eta / np.pi) for run in same]
            row = {"N": count, "packing": eta, "runs": len(same)}
            row |= over_runs("P", members, notes, f"N = {count}, η = {eta:g}")
            rows.append(row | {"samples": round(combine_runs(members).samples, 1)})
    return rows, notes


def draw(rows: list[dict], runs: list[Run]) -> plt.Figure:
    """Draw the measured values as points with error bars, and published values as lines."""
    figure, axes = plt.subplots(figsize=(8, 5.5))
    for (name, points), style in zip(MELTING.items(), (":", "--", "-"), strict=True):
        axes.plot(*np.transpose(points), ls=style, color="0.4", lw=1, label=name)
    sizes = grouped(rows, lambda row: row["N"])
    for (count, own), colour in zip(sizes, colours(len(sizes)), strict=True):
        x, y, error = ([row[name] for row in own] for name in ("packing", "P", "P_error"))
        axes.errorbar(x, y, error, marker="o", lw=0.8, color=colour, label=f"N = {count}")
    axes.set(xlabel="packing fraction $\\eta$", ylabel="$P^* = P\\,d^2\\,/\\,kT$")
    axes.set_title(caption(runs))
    axes.legend()
    return figure


def main() -> None:
    args = command_line(__doc__, "melting.png", equilibration=None).parse_args()
    for run in args.runs:
        allow(
            run,
            "the melting curve is for equal disks in a periodic box",
            "thermostatted",
            "rough",
            "rotating",
        )
    rows, notes = table(args.runs, args.equilibration)
    report(args, draw(rows, args.runs), rows, notes=notes)


if __name__ == "__main__":
    launch(main)
