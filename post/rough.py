"""Cooling of rough disks: temperatures of translation and of rotation against theory.

    python post/rough.py runs/rough.h5 -o rough.png --csv rough.csv

Left: T = m <v^2> / 2 and T_rot = I <omega^2> against collisions per disk; dashed the law for
Maxwell's velocities (Luding et al. 1998).  Right: T_rot / T with its steady value by that law, and
by direct simulation of the Boltzmann equation where that is known.  They hold while a dilute gas of
equal disks without Coulomb friction stays homogeneous.  Runs of one input, in a periodic box.
"""

from ricochet import Run, RunError, theory
from ricochet.drawing import COLOURS, band, caption, plt
from ricochet.script import command_line, launch, measured, read_all, report
from ricochet.statistics import Estimate, estimate
from ricochet.thermodynamics import equal_disks

import numpy as np

SETTLED = 0.005  # the ratio has forgotten its start when by the law it is so close to its limit


def law_of(run: Run) -> tuple[float, float, float]:
    """xi, beta, q of a run that the laws are for."""
    beta = float(run.parameter("contact", "tangential_restitution", -1.0))
    walls = not run.periodic.all() or run.obstacles or len(run.walls)
    if beta <= -1 or walls or not equal_disks(run) or not np.isfinite(run.restitution):
        raise RunError(f"{run.path}: the laws are for equal rough disks in a periodic box")
    if run.parameter("contact", "friction") is not None:
        raise RunError(f"{run.path}: the laws know no Coulomb limit; leave out contact.friction")
    return run.restitution, beta, float(run.parameter("contact", "inertia", 0.5))


def temperatures(run: Run) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Collisions per disk, T, T_rot at the observables."""
    both = (
        run.observable(f"all/{name}").value for name in ("temperature", "rotational_temperature")
    )
    return run.collisions_per_disk.value, *both


def means(runs: list[Run]) -> dict[str, np.ndarray | Estimate]:
    """Means over runs at common numbers of collisions per disk."""
    tracks = [temperatures(run) for run in runs]
    tau = np.linspace(0, min(track[0][-1] for track in tracks), 200)
    at = [[np.interp(tau, track[0], part) for part in track[1:]] for track in tracks]
    return {
        "tau": tau,
        "T": estimate([t for t, _ in at]),
        "T_rot": estimate([r for _, r in at]),
        "ratio": estimate([r / t for t, r in at]),
    }


def steady_ratio(runs: list[Run], law: tuple[float, float, float]) -> Estimate:
    """T_rot / T where it is `SETTLED`, or in the second half of runs where it is not yet."""
    ratios = []
    for run in runs:
        tau, t, rotational = temperatures(run)
        expected = theory.rough_temperatures(tau, (t[0], rotational[0]), *law)
        away = np.abs(expected[1] / expected[0] / theory.rough_ratio(*law) - 1) > SETTLED
        late = tau > max(tau[away], default=0.0)
        late = late if late.any() else tau >= tau[-1] / 2
        ratios.append(np.mean(rotational[late] / t[late]))
    return estimate(ratios)


def draw(runs: list[Run], law: tuple[float, float, float], found: dict) -> plt.Figure:
    """Both temperatures, logarithmic, and their ratio."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 5))
    tau = found["tau"]
    start = tuple(float(found[name].mean[0]) for name in ("T", "T_rot"))
    expected = theory.rough_temperatures(tau, start, *law)
    for name, label, colour, line in zip(
        ("T", "T_rot"), ("$T$", "$T_{rot}$"), COLOURS, expected, strict=False
    ):
        band(left, tau, *found[name], color=colour, label=label)
        left.plot(tau, line, color="black", ls="--", lw=1)
    left.plot([], [], color="black", ls="--", lw=1, label="Luding et al. 1998")
    band(right, tau, *found["ratio"], color=COLOURS[2], label="measured")
    right.plot(tau, expected[1] / expected[0], color="black", ls="--", lw=1, label="Luding et al.")
    exact = theory.ROUGH_RATIOS.get(law[:2]) if law[2] == 0.5 else None
    if exact is not None:
        right.axhline(exact, color="black", lw=1, label=f"Boltzmann equation: {exact:.4f}")
    top = max(start)
    left.set(yscale="log", ylim=(1e-3 * top, 1.5 * top), ylabel="temperature (reduced units)")
    right.set(ylabel="$T_{rot} / T$", ylim=(0, None))
    for axes in (left, right):
        axes.set(xlabel="collisions per disk", xlim=(0, None))
        axes.legend()
    figure.suptitle(f"{caption(runs)},  β = {law[1]:g}", fontsize=10)
    return figure


def main() -> None:
    args = command_line(__doc__, "rough.png").parse_args()
    runs = read_all(args.runs)
    laws = {law_of(run) for run in runs}
    if len(laws) > 1:
        raise RunError("the runs are not of one contact law")
    (law,) = laws
    found = means(runs)
    row = {
        "restitution": law[0],
        "tangential_restitution": law[1],
        "inertia": law[2],
        "runs": len(runs),
        **measured("ratio", steady_ratio(runs, law)),
        "maxwellian": theory.rough_ratio(*law),
        "boltzmann": theory.ROUGH_RATIOS.get(law[:2]) if law[2] == 0.5 else None,
    }
    data = {"collisions_per_disk": found["tau"]}
    for name in ("T", "T_rot", "ratio"):
        data |= {name: found[name].mean, f"{name}_error": found[name].error}
    report(args, runs, "Cooling of rough disks", draw(runs, law, found), [row], data=data)


if __name__ == "__main__":
    launch(main)
