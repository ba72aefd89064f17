"""Equation of state Z = P / (n kT) of hard disks against packing fraction, from three methods.

    python post/equation_of_state.py runs/state/eta_*.h5 -o state.png --csv state.csv

The pressure P is determined from the virial of the pair collisions.  For equal disks, the pressure
is also determined from the collision rate, and in boxes with walls from the force on the walls.
Means are taken in equilibrium, which begins after the first X collisions per disk, where X is the
value of --equilibration, or by default when no observable drifts any longer.  Errors account for
the autocorrelation of the pressure; in the table, `samples` is the effective number of independent
samples of the virial. Runs with equal packing fraction are combined.  The disks must be elastic,
and there must be no gravity.  Thermal walls and driving are allowed if all of them impose the same
temperature; the temperature kT is then a measured mean with an error.  Near walls there is a layer
that the centres of disks cannot reach, and therefore the density in the interior is higher.
The factor Z that follows from the force on the walls is calculated with the area that centres can
reach, and differs from Z far from the walls by a fraction of about 1/sqrt(N).  For disks of many
radii r, the curves show the equation of state of fluids derived by Santos, Yuste and Lopez de Haro
(1999).  The equation of Santos, Yuste and Lopez de Haro depends on the radii only through the ratio
<r>^2 / <r^2>, which must be the same for all runs.  The curve of such disks ends at the packing
fraction 0.648, because equal disks freeze at 0.70; the lower panel then names the packing fractions
that have no reference.
"""

from ricochet import Run, RunError, hard_disks
from ricochet.analysis.statistics import combine_runs
from ricochet.analysis.thermodynamics import z_ways
from ricochet.figures.drawing import COLOURS, caption, listed, plt
from ricochet.script import by_packing, columns, command_line, launch, measured, over_runs, report

import numpy as np
from matplotlib.ticker import LogLocator

UNLIKE = 0.02  # largest difference of <r>^2 / <r^2> in a figure
WAYS = {"virial": "virial", "rate": "collision rate", "walls": "force on the walls"}


def likeness(runs: list[Run]) -> float:
    """Return the ratio <r>^2 / <r^2> of the radii, which determines the theoretical curves."""
    found = np.array([np.mean(run.radius) ** 2 / np.mean(run.radius**2) for run in runs])
    equal = np.array([np.ptp(run.radius) == 0 for run in runs])
    other = (np.abs(found - found[0]) > UNLIKE) | (equal != equal[0])
    if other.any():
        path = runs[int(np.argmax(other))].path
        raise RunError(f"{path}: the radii are not equal or not distributed as in {runs[0].path}")
    return 1.0 if equal.all() else float(found.mean())


def table(runs: list[Run], skip: float | None) -> tuple[list[dict], list[str]]:
    """Return a table row for each packing fraction, and warnings.

    If a method of measuring Z does not apply to the runs, the table cells of this method are empty.
    """
    rows, notes, alike = [], [], likeness(runs)
    for eta, same in by_packing(runs):
        row = {"packing": eta, "runs": len(same)}
        found = [z_ways(run, skip) for run in same]
        for name, way in WAYS.items():
            members, about = [one[name] for one in found if name in one], f"η = {eta:g}, {way}"
            cells = over_runs(f"Z_{name}", members, notes, about) if members else {}
            row |= cells if len(members) == len(same) else measured(f"Z_{name}", None)
        row["samples"] = round(combine_runs([one["virial"] for one in found]).samples, 1)
        z = hard_disks.published(eta, same[0].n_disks, bool(same[0].periodic.all()))
        z = hard_disks.of_sizes(z, eta, alike)
        known = np.isfinite(z) and (alike == 1 or eta <= hard_disks.FLUID[-1, 0])
        rows.append(row | {"Z_reference": z if known else None})
    return rows, notes


def draw(rows: list[dict], runs: list[Run]) -> plt.Figure:
    """Draw Z in the upper panel, and its deviation from a reference equation in the lower panel."""
    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 8), height_ratios=(2, 1))
    alike, fluid, solid = likeness(runs), np.linspace(0, 0.72, 200), np.linspace(0.715, 0.86, 100)
    found = {name: np.array(values, dtype=float) for name, values in columns(rows).items()}
    eta, expected = found["packing"], found["Z_reference"]
    if alike < 1:  # such fluids do not freeze where equal disks do
        fluid = np.linspace(0, max(0.72, float(eta.max())), 200)
    laws = (hard_disks.henderson(fluid), hard_disks.simulated(fluid))
    henderson, published = (hard_disks.of_sizes(z, fluid, alike) for z in laws)
    label = "Kolafa and Rottner 2006; up to 0.65 Erpenbeck and Luban 1985; then this program"
    if alike < 1:
        published = np.where(fluid <= hard_disks.FLUID[-1, 0], published, np.nan)
        label = "Santos et al. 1999, from simulations of equal disks"
    rough = "Henderson 1975" if alike == 1 else "Santos et al. 1999, from Henderson's equation"
    above.plot(fluid, henderson, color="0.6", label=rough)
    above.plot(fluid, published, color="black", lw=1, label=label)
    if alike == 1:
        label = "crystal, Alder, Hoover and Young 1968"
        above.plot(solid, hard_disks.crystal(solid), color="black", lw=1, ls="--", label=label)
    below.plot(fluid, 100 * (henderson / published - 1), color="0.6")
    for (name, way), marker, colour in zip(WAYS.items(), "oxs", COLOURS, strict=False):
        z, error = found[f"Z_{name}"], found[f"Z_{name}_error"]
        if not np.isnan(z).all():
            style = {"ls": "", "marker": marker, "mfc": "none", "color": colour, "ms": 6}
            above.errorbar(eta, z, error, label=f"by {way}", **style)
            below.errorbar(eta, 100 * (z / expected - 1), 100 * error / expected, **style)
    below.axhline(0, color="black", lw=1, zorder=0)
    if np.isnan(expected).any():
        words = f"no reference for η = {listed(set(eta[np.isnan(expected)]))}"
        below.text(0.99, 0.97, words, ha="right", va="top", transform=below.transAxes)
    largest = 3 * np.nanmax(np.abs(100 * (found["Z_virial"] / expected - 1)), initial=0.1)
    below.set(xlabel="packing fraction $\\eta$", ylabel="deviation (%)", ylim=(-largest, largest))
    most = np.nanmax([found[f"Z_{name}"] for name in WAYS])  # from the data, as the curves diverge
    above.set(ylabel="$Z = P\\,/\\,(n\\,kT)$", xlim=(0, 0.05 + max(eta)), title=caption(runs))
    if most > 3:
        above.semilogy()
        above.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        above.yaxis.set_major_formatter("{x:g}")
        above.yaxis.set_minor_formatter("")
    above.set_ylim(0.9, 1.15 * most)
    above.legend()
    return figure


def main() -> None:
    args = command_line(__doc__, "equation_of_state.png", equilibration=None).parse_args()
    rows, notes = table(args.runs, args.equilibration)
    report(args, draw(rows, args.runs), rows, notes=notes)


if __name__ == "__main__":
    launch(main)
