"""Cooling of a gas of equal disks: Haff's law, and where the gas leaves it.

    python post/haff.py runs/haff/*.h5 -o haff.png --csv haff.csv

Runs are combined by restitution xi.  Left: K against time in units of the first mean free time,
K0 / (1 + (1 - xi^2) w0 t / 4)^2 (Haff 1983).  Right: K against collisions per disk, an exponential
(van Noije and Ernst 1998).  Both hold while the gas stays homogeneous; later, streams carry the
energy and it falls more slowly.  Periodic boxes at rest as a whole.
"""

from ricochet import Run, RunError, hard_disks
from ricochet.drawing import band, caption, colours, plt
from ricochet.script import command_line, grouped, launch, measured, read_all, report
from ricochet.statistics import Estimate, estimate
from ricochet.thermodynamics import free_disks, packing, temperature

import numpy as np

POINTS = 200


def first_rate(run: Run) -> float:
    """w0: collisions per disk and time at the start, by the equation of state."""
    if not run.periodic.all() or np.ptp(run.radius) > 0 or np.ptp(run.mass) > 0:
        raise RunError(f"{run.path}: Haff's law is for equal disks in a periodic box")
    z = float(hard_disks.simulated(packing(run)))
    kt = temperature(run)
    return hard_disks.collision_rate(z, 2 * run.radius[0], free_disks(run), kt, run.mass[0])


def energy_left(run: Run) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """w0 t, collisions per disk, K / K0 at the observables."""
    time, energy = run.observable("all/kinetic_energy")
    return time * first_rate(run), run.collisions_per_disk.value, energy / energy[0]


def means(runs: list[Run]) -> dict[str, np.ndarray | Estimate]:
    """Means over runs on common grids; time in logarithmic steps."""
    tracks = [energy_left(run) for run in runs]
    late = min(t[-1] for t, _, _ in tracks)
    time = np.geomspace(max(t[1] for t, _, _ in tracks), late, POINTS)
    tau = np.linspace(0, min(c[-1] for _, c, _ in tracks), POINTS)
    return {
        "time": time,
        "by_time": estimate([np.interp(time, t, k) for t, _, k in tracks]),
        "tau": tau,
        "by_collisions": estimate([np.interp(tau, c, k) for _, c, k in tracks]),
    }


def draw(groups: list[tuple[float, list[Run]]], results: list[dict]) -> plt.Figure:
    """K against time, double logarithmic, and against collisions, logarithmic."""
    figure, (left, right) = plt.subplots(1, 2, sharey=True, figsize=(10, 5))
    for (xi, _), found, colour in zip(groups, results, colours(len(groups)), strict=True):
        panels = (
            (left, found["time"], found["by_time"], hard_disks.haff_by_time),
            (right, found["tau"], found["by_collisions"], hard_disks.haff_by_collisions),
        )
        for axes, x, y, law in panels:
            band(axes, x, *y, color=colour, label=f"ξ = {xi:g}")
            axes.plot(x, law(x, xi), color="black", ls="--", lw=1)
    left.plot([], [], color="black", ls="--", lw=1, label="Haff 1983")
    right.plot([], [], color="black", ls="--", lw=1, label="van Noije and Ernst 1998")
    floor = min(found["by_time"].mean.min() for found in results)
    left.set(
        xscale="log", yscale="log", ylim=(floor / 2, 1.5), xlabel="$w_0\\,t$", ylabel="$K / K_0$"
    )
    right.set(xlabel="collisions per disk", xlim=(0, None))
    left.legend()
    right.legend()
    runs = [run for _, members in groups for run in members]
    eta = ", ".join(f"{value:.3g}" for value in sorted({round(packing(run), 6) for run in runs}))
    figure.suptitle(f"{caption(runs)},  η = {eta}", fontsize=10)
    return figure


def table(groups: list[tuple[float, list[Run]]], results: list[dict]) -> list[dict]:
    """Energies after 5, 10 and 20 collisions per disk, as far as the runs go."""
    rows = []
    for (xi, members), found in zip(groups, results, strict=True):
        for tau in (5, 10, 20):
            if tau > found["tau"][-1]:
                break
            left = Estimate(*(np.interp(tau, found["tau"], y) for y in found["by_collisions"]))
            rows.append(
                {
                    "restitution": xi,
                    "runs": len(members),
                    "collisions_per_disk": tau,
                    **measured("energy_left", left),
                    "expected": float(hard_disks.haff_by_collisions(tau, xi)),
                }
            )
    return rows


def curves(groups: list[tuple[float, list[Run]]], results: list[dict]) -> dict[str, np.ndarray]:
    """All curves and laws."""
    columns = {}
    for (xi, _), found in zip(groups, results, strict=True):
        time, tau = found["time"], found["tau"]
        columns[f"w0_t_xi{xi:g}"] = time
        columns[f"K_by_time_xi{xi:g}"], columns[f"K_by_time_error_xi{xi:g}"] = found["by_time"]
        columns[f"haff_xi{xi:g}"] = hard_disks.haff_by_time(time, xi)
        columns[f"collisions_per_disk_xi{xi:g}"] = tau
        columns[f"K_xi{xi:g}"], columns[f"K_error_xi{xi:g}"] = found["by_collisions"]
        columns[f"law_xi{xi:g}"] = hard_disks.haff_by_collisions(tau, xi)
    return columns


def main() -> None:
    args = command_line(__doc__, "haff.png").parse_args()
    runs = read_all(args.runs)
    groups = grouped(runs, lambda run: run.restitution)
    results = [means(members) for _, members in groups]
    figure, rows = draw(groups, results), table(groups, results)
    title = "Cooling of a gas of inelastic disks"
    report(args, runs, title, figure, rows, data=curves(groups, results))


if __name__ == "__main__":
    launch(main)
