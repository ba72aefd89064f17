"""Viscosities, thermal conductivity and diffusion coefficient, compared with Enskog's theory.

    python post/transport.py runs/driven/transport_*/*.h5 -o transport.png --csv transport.csv

The disks must be elastic, and the box must be periodic.  Runs with equal packing fraction are
combined.  The output files must contain the Helfand moments of momentum and energy
(output.helfand).  About four samples of the observables are required per mean free time
(output.observables_every_time).  For the diffusion coefficient D, the frames must be equally spaced
in time.  For mixtures the script computes only the viscosities, because the diffusion of the
species also transports energy, and because D differs between species (see correlations.py).

The small panels show the coefficients as functions of the lag, divided by Enskog's coefficients.  A
viscosity or the conductivity is half of the slope, between neighbouring lags, of the mean square
change of a Helfand moment against the lag.  The diffusion coefficient D is half the integral of
<v(0) v(s)> from 0 to the lag.  Bands show the errors, determined from the scatter of the runs.  The
right panel and the table contain means over the lags from t/2 to t; their errors account for the
autocorrelation.  For viscosities and conductivity, the lag t is 20 mean free times, or longer if
heavy disks decorrelate slowly, but at most an eighth of the duration of the run.  For D, the lag t
is the time in which sound crosses the box, as in correlations.py.

Enskog's coefficients are calculated after Gass (1971), and for mixtures after Lopez de Haro, Cohen
and Kincaid (1983).  The value of the pair correlation function at contact is taken from Henderson
or, for mixtures, from Jenkins and Mancini (1987).  In the table, the units of the columns `value`
and `enskog` are formed from the mean mass m, the mean diameter sigma and kT; the column `unit`
contains them.  Enskog's theory assumes that the velocities of colliding disks are independent.
Unless the gas is dense, the viscosities and the conductivity of Enskog's theory are accurate to a
few per cent, whereas the predicted D is less accurate.  In two dimensions no coefficient converges
for long times in large boxes.  A fixed total energy of the N disks makes the coefficients smaller
(docs/explanation/laws.md).  The relative decrease of the conductivity is about 6 / N, that of the
bulk viscosity 5 / N, and that of the shear viscosity 2 / N.
"""

from ricochet.analysis.statistics import combine_runs
from ricochet.analysis.transport import Found, coefficients
from ricochet.figures.drawing import COLOURS, band, caption, colours, plt
from ricochet.script import by_packing, command_line, launch, measured, over_runs, points, report

import numpy as np

NO_CONDUCTIVITY = (
    "no conductivity and no D for a mixture: diffusing species also transport energy; "
    "correlations.py computes D of each species"
)
LABELS = {
    "viscosity": "shear viscosity",
    "conductivity": "heat conductivity",
    "bulk_viscosity": "bulk viscosity",
    "D": "diffusion coefficient",
}
#: Units of the coefficients in the table.
UNITS = {
    "viscosity": "sqrt(m*kT)/sigma",
    "conductivity": "sqrt(kT/m)/sigma",
    "bulk_viscosity": "sqrt(m*kT)/sigma",
    "D": "sigma*sqrt(kT/m)",
}
Results = list[tuple[float, dict[str, Found]]]


def table(results: Results) -> tuple[list[dict], list[str]]:
    """Return a table row for each packing fraction and coefficient, and warnings."""
    rows, unsettled, notes = [], [], []
    for eta, found in results:
        for name in filter(found.get, LABELS):
            members, theory, about = found[name].members, found[name].enskog, f"η = {eta:g}, {name}"
            row = {"packing": eta, "runs": len(members), "what": name}
            row |= measured("value", combine_runs(members).scaled(theory)) | {"enskog": theory}
            row |= {"unit": UNITS[name]}
            rows.append(row | over_runs("ratio", members, notes, about))
            if found[name].lag < found[name].memory / 4:
                unsettled.append(
                    f"{about}: taken at {found[name].lag:.1f} mean free times, before it has "
                    f"settled; longer runs let it reach {found[name].memory:.3g}"
                )
    mixed = any("conductivity" not in found for _, found in results)
    return rows, [*unsettled, *notes, *[NO_CONDUCTIVITY] * mixed]


def draw(results: Results, rows: list[dict]) -> plt.Figure:
    """Draw all coefficients, divided by Enskog's coefficients, against lag and packing fraction."""
    there = set().union(*(found for _, found in results))
    layout, height = [[*filter(there.__contains__, LABELS), "all"]], 4.5
    if "D" in there:
        layout, height = [["viscosity", "conductivity", "all"], ["bulk_viscosity", "D", "all"]], 7
    widths = [1] * (len(layout[0]) - 1) + [1.3]
    figure, panels = plt.subplot_mosaic(layout, figsize=(13, height), width_ratios=widths)
    scale = colours(len(results), len(COLOURS))  # colours show packing
    for (eta, found), colour in zip(results, scale, strict=True):
        line = {"color": colour, "lw": 1, "marker": ".", "ms": 3, "label": f"η = {eta:.3g}"}
        for name, one in found.items():
            band(panels[name], *one.curve, **line)
    packing = [eta for eta, _ in results]
    apart = 0.015 * (max(np.ptp(packing), 0.1))  # of points that would otherwise cover each other
    for k, ((name, label), marker) in enumerate(zip(LABELS.items(), "osv^", strict=True)):
        if name not in panels:
            continue
        panels[name].set(xlabel="$w\\,t$", xscale="log", xlim=(0.03, None))
        panels[name].set(ylabel=f"{label} / Enskog's", ylim=(0, 1.6))
        own = [row for row in rows if row["what"] == name]
        eta, *ratio = (
            np.array([row[x] for row in own]) for x in ("packing", "ratio", "ratio_error")
        )
        style = {"marker": marker, "ms": 4, "lw": 1, "label": label}
        panels["all"].errorbar(eta + (k - 1.5) * apart, *ratio, **style)
    panels["all"].set(xlabel="packing fraction η", ylabel="coefficient / Enskog's")
    panels["all"].set_xlim(min(packing) - 5 * apart, max(packing) + 5 * apart)
    low, high = panels["all"].get_ylim()
    panels["all"].set_ylim(low, high + 0.3 * (high - low))  # space for the legend
    panels["viscosity"].legend()
    panels["all"].legend(loc="upper center", ncols=2)
    for axes in panels.values():
        axes.axhline(1, color="black", ls="--", lw=1, zorder=0)
    return figure


def main() -> None:
    args = command_line(__doc__, "transport.png", equilibration=None).parse_args()
    results = [(eta, coefficients(runs, args.equilibration)) for eta, runs in by_packing(args.runs)]
    rows, notes = table(results)
    data = [
        {"what": row["what"], "packing": row["packing"], "wt": None}
        | {"ratio": row["ratio"], "error": row["ratio_error"]}
        for row in rows
    ]
    data += points(
        ("what", "packing", "wt", "ratio", "error"),
        {(f"{name}(t)", eta): one.curve for eta, found in results for name, one in found.items()},
    )
    figure = draw(results, rows)
    figure.suptitle(caption(args.runs))
    report(args, figure, rows, data=data, notes=notes)


if __name__ == "__main__":
    launch(main)
