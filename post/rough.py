"""Cooling of rough disks: translational and rotational temperature against theory.

    python post/rough.py runs/rough.h5 -o rough.png --csv rough.csv

The left panel shows T = m <v^2> / 2 and T_rot = I <omega^2> against collisions per disk.  The
dashed curves show a theory that assumes Maxwell distributions of the velocities (Luding et al.
1998).  The right panel shows the ratio T_rot / T, and at most two reference values of this ratio in
the steady state.  The first reference value is the prediction of the theory by Luding and others
(1998).  The second reference value is the result of direct simulations of the Boltzmann equation,
if such a result is available; it is up to 6 % lower than the first reference value.  The prediction
and the simulation result apply to a homogeneous dilute gas of equal disks without Coulomb friction.
In a cooling gas a flow develops, which contributes to T and therefore decreases the ratio T_rot /
T.  The flow decreases T_rot / T by 3.8 to 4.6 % at a packing fraction of 0.02, and by 0.3 to 0.5 %
at a packing fraction of 0.0025. In a gas that cools faster, the flow causes a larger decrease of
T_rot / T.  All runs must have the same input, and the box must be periodic.
"""

from ricochet import Run, RunError, theory
from ricochet.analysis.cooling import Curves, flow_notes, rough, rough_law, steady_ratio
from ricochet.figures.drawing import COLOURS, band, caption, plt
from ricochet.script import command_line, launch, measured, report, spread


def draw(runs: list[Run], law: tuple, exact: float | None, found: Curves) -> plt.Figure:
    """Draw translational and rotational temperature on logarithmic axes, and their ratio."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 5))
    tau, start = found["collisions_per_disk"], (found["T"].mean[0], found["T_rot"].mean[0])
    expected = theory.rough_temperatures(tau, start, *law)
    dashed = {"color": "black", "ls": "--", "lw": 1}
    for name, label, colour, line in zip(
        ("T", "T_rot"), ("$T$", "$T_{rot}$"), COLOURS, expected, strict=False
    ):
        band(left, tau, *found[name], color=colour, label=label)
        left.plot(tau, line, **dashed)
    left.plot([], [], label="Luding et al. 1998", **dashed)
    band(right, tau, *found["ratio"], color=COLOURS[2], label="measured")
    right.plot(tau, expected[1] / expected[0], label="Luding et al.", **dashed)
    if exact is not None:
        right.axhline(exact, color="black", lw=1, label=f"Boltzmann equation: {exact:.4f}")
    top, label = max(start), runs[0].units.label("temperature", "energy")
    left.set(yscale="log", ylim=(1e-3 * top, 1.5 * top), ylabel=label)
    right.set(ylabel="$T_{rot} / T$", ylim=(0, None))
    for axes in (left, right):
        axes.set(xlabel="collisions per disk", xlim=(0, None))
        axes.legend()
    figure.suptitle(f"{caption(runs)},  β = {law[1]:g}")
    return figure


def main() -> None:
    args = command_line(__doc__, "rough.png").parse_args()
    laws = {rough_law(run) for run in args.runs}
    if len(laws) > 1:
        raise RunError("the runs differ in their contact law")
    (law,) = laws
    found = rough(args.runs)
    exact = theory.ROUGH_RATIOS.get(law[:2]) if law[2] == 0.5 else None
    row = dict(zip(("restitution", "tangential_restitution", "inertia"), law, strict=True))
    row |= {"runs": len(args.runs), **measured("ratio", steady_ratio(args.runs, law))}
    row |= {"maxwellian": theory.rough_ratio(*law), "boltzmann": exact}
    notes = flow_notes([("all runs", args.runs)])
    if exact is None:
        notes += [
            "the theory assumes Maxwell's velocities; the Boltzmann equation yields up to 6 % less"
        ]
    figure = draw(args.runs, law, exact, found)
    report(args, figure, [row], data=spread({"": found}), notes=notes)


if __name__ == "__main__":
    launch(main)
