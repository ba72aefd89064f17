"""Cooling of a gas of inelastic disks, compared with Haff's law.

    python post/haff.py runs/haff/*.h5 -o haff.png --csv haff.csv

Runs with the same coefficient of restitution xi are combined.  The left panel shows the kinetic
energy K against time in units of the initial mean free time 1/w0. The left panel also shows Haff's
law K0 / (1 + (1 - xi^2) w0 t / 4)^2 (Haff 1983).  The right panel shows K against collisions per
disk, and an exponential law (van Noije and Ernst 1998).  The lower panels show the ratio of K to
Haff's law and the ratio of K to the exponential law.  Haff's law and the exponential law apply
while the gas is homogeneous.  After the end of the homogeneous state, a part of K is the energy of
flows in the gas, and K decreases more slowly.  The boxes must be periodic, and the total momentum
must be 0. For equal disks the initial collision rate w0 is calculated from the equation of state.
For unequal disks the initial collision rate w0 is measured from the first collisions.  Haff's law
and the exponential law assume that all species have the same temperature; this assumption is wrong
if the masses are very different.

The cooling rate is -d ln K / d tau, where tau is the number of collisions per disk.  The cooling
rate is averaged over two collisions per disk and over the runs.  If the measured cooling rate falls
below 90 % of the predicted rate at some tau and stays below this limit, the homogeneous state is
assumed to end at this tau.  The curves are pale at values of tau after the end of the homogeneous
state.  For several runs, the tau at the end of the homogeneous state is printed with an error.  The
column `rate` contains the cooling rate, determined by a linear fit to ln K.  The fit to ln K begins
at tau = 2, and ends at half of the tau at which the homogeneous state ends.  If the gas stays
homogeneous until the end of the run, the fit includes all data later than tau = 2.  The error of
`rate` is determined from the scatter of the runs.

If the restitution depends on velocity (contact.restitution_law), K is compared with another law,
which assumes a Maxwell distribution of velocities (docs/explanation/laws.md).  If the restitution
depends on velocity, the table contains no cooling rate.  Instead of the cooling rate, the table
contains the `exponent` p of the power law K ~ t^-p in the last decade of time; p approaches 5/3. If
the gas stays homogeneous but K differs from the law by more than 10 % at the end, a warning states
the ratio of K to the law.
"""

from ricochet import Run
from ricochet.analysis.cooling import SLOW, energy_left, exponent, haff, soft_law
from ricochet.analysis.statistics import Estimate, rounded_to_error
from ricochet.analysis.thermodynamics import packing
from ricochet.figures.drawing import band, caption, colours, plt
from ricochet.predictions.hard_disks import haff_rate
from ricochet.reading.reader import Restitution
from ricochet.script import by_restitution, command_line, launch, measured, report, spread

import numpy as np

RATIO_TOP = 2.0  # largest upper limit of the axis of ratios


def draw(runs: list[Run], groups: list, results: list) -> plt.Figure:
    """Draw K against time and collisions per disk, and the ratios of K to both laws below."""
    figure, panels = plt.subplots(
        2, 2, sharex="col", sharey="row", figsize=(10, 7), height_ratios=(2, 1)
    )
    for (xi, _), (found, rate, end, _), colour in zip(
        groups, results, colours(len(groups)), strict=True
    ):
        tau, by_time, by_tau = (found[name] for name in ("collisions_per_disk", "K_by_time", "K"))
        left_at = np.interp(end, tau, by_tau.mean)
        gone = (by_time.mean < left_at, tau > end)  # all False without an end
        sides = ((found["w0_t"], by_time, found["haff"]), (tau, by_tau, found["law"]))
        for (x, y, law), (upper, lower), after in zip(sides, panels.T, gone, strict=True):
            ratio = Estimate(y.mean / law, y.error / law)
            for axes, (mean, error) in ((upper, y), (lower, ratio)):
                band(axes, x, np.where(after, np.nan, mean), error, color=colour)
                band(axes, x, np.where(after, mean, np.nan), error, color=colour, alpha=0.4)
            upper.plot(x, law, color="black", ls="--", lw=1)
        name, known = expected(xi, found)
        label = f"ξ = {xi:g},  {name} {' ± '.join(rounded_to_error(*rate))}  ({known:.4g})"
        panels[0, 0].plot([], [], color=colour, label=f"ξ = {xi:g}")
        panels[0, 1].plot([], [], color=colour, label=label)
    laws = "Haff 1983", "van Noije and Ernst 1998"
    if any(xi.law != "constant" for xi, _ in groups):
        laws = ("law for viscoelastic disks and Maxwell's velocities",) * 2
    for axes, law in zip(panels[0], laws, strict=True):
        axes.plot([], [], color="black", ls="--", lw=1, label=law)
    floor = min(found["K_by_time"].mean.min() for found, *_ in results)
    panels[0, 0].set(xscale="log", yscale="log", ylim=(floor / 2, 1.5), ylabel="$K / K_0$")
    panels[1, 0].set(xlabel="$w_0\\,t$", ylabel="$K$ / law")
    panels[1, 0].set_ylim(None, min(RATIO_TOP, panels[1, 0].get_ylim()[1]))
    panels[1, 1].set(xlabel="collisions per disk", xlim=(0, None))
    for axes in panels[1]:
        axes.axhline(1, color="black", ls="--", lw=1, zorder=0)
    panels[0, 0].legend()
    panels[0, 1].legend(title="cooling rate (law); pale: no longer homogeneous", fontsize=8)
    eta = ", ".join(f"{value:.3g}" for value in sorted({round(packing(run), 6) for run in runs}))
    figure.suptitle(f"{caption(runs)},  η = {eta}")
    return figure


def energies(groups: list, results: list) -> list[dict]:
    """Return the energies after 5, 10 and 20 collisions per disk, if the runs are long enough."""
    rows = []
    for (xi, members), (found, *_) in zip(groups, results, strict=True):
        reached = found["collisions_per_disk"]
        for tau in (5, 10, 20):
            if tau <= reached[-1]:
                row = {"restitution": xi.name, "runs": len(members), "collisions_per_disk": tau}
                left = Estimate(*(np.interp(tau, reached, part) for part in found["K"]))
                row |= measured("energy_left", left)
                law = np.interp(tau, reached, np.log(found["law"]))
                rows.append(row | {"expected": float(np.exp(law))})
    return rows


def expected(law: Restitution, found: dict) -> tuple[str, float]:
    """Return the predicted cooling rate, or the predicted exponent for viscoelastic disks."""
    if law.law == "constant":
        return "rate", haff_rate(law.xi)
    return "exponent", exponent(found["w0_t"], found["haff"])


def rates(groups: list, results: list) -> list[dict]:
    """Return the measured and predicted cooling rate, and the end of the homogeneous state."""
    return [
        {
            "restitution": xi.name,
            "runs": len(members),
            **measured(expected(xi, found)[0], rate),
            "expected": expected(xi, found)[1],
            **measured("homogeneous_until", end if np.isfinite(end.error) else None),
        }
        for (xi, members), (found, rate, _, end) in zip(groups, results, strict=True)
    ]


def apart(xi: Restitution, found: dict, end: float) -> list[str]:
    """Return a warning if the gas stays homogeneous but the final K differs from the law."""
    ratio, tau = found["K"].mean[-1] / found["law"][-1], found["collisions_per_disk"][-1]
    if not np.isnan(end) or abs(ratio - 1) < 1 - SLOW:
        return []
    law = f"ξ = {xi:g}: the law is that of a homogeneous gas; here K is {ratio:.3g} of it after "
    return [f"{law}{tau:.3g} collisions per disk"]


def main() -> None:
    args = command_line(__doc__, "haff.png").parse_args()
    groups = by_restitution(args.runs)
    results = [
        haff([energy_left(run) for run in members], law.xi, soft_law(members))
        for law, members in groups
    ]
    data = spread({f"_xi{xi:g}": own for (xi, _), (own, *_) in zip(groups, results, strict=True)})
    tables = energies(groups, results), rates(groups, results)
    each = zip(groups, results, strict=True)
    notes = [note for (xi, _), (own, _, end, _) in each for note in apart(xi, own, end)]
    report(args, draw(args.runs, groups, results), *tables, data=data, notes=notes)


if __name__ == "__main__":
    launch(main)
