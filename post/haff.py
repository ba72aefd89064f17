"""Cooling of a gas: Haff's law, and where the gas leaves it.

    python post/haff.py runs/haff/*.h5 -o haff.png --csv haff.csv

Runs are combined by restitution xi.  Left: K against time in units of the first mean free time,
K0 / (1 + (1 - xi^2) w0 t / 4)^2 (Haff 1983).  Right: K against collisions per disk, an exponential
(van Noije and Ernst 1998).  Below: K over the law.  Both hold while the gas stays homogeneous;
later, streams carry the energy and it falls more slowly.  Periodic boxes at rest as a whole.  w0 is
by the equation of state; of unequal disks, for which there is none, by their first collisions, and
both laws take all sizes to be at one temperature: not so for very different masses.

The cooling rate is -d ln K / d tau, tau collisions per disk.  The homogeneous state ends where its
mean over two collisions per disk and over the runs falls below 90 % of the law for good; from there
on the curves are pale.  `rate` is the slope of a line through ln K from two collisions per disk on,
when speeds have their shape, until half of that end, or to the end of a run that stays homogeneous;
its error is from the scatter of the runs.
"""

from typing import NamedTuple

from ricochet import Run, RunError, hard_disks
from ricochet.drawing import band, caption, colours, plt
from ricochet.script import command_line, grouped, launch, measured, read_all, report
from ricochet.statistics import Estimate, estimate, to_error
from ricochet.thermodynamics import equal_disks, free_disks, packing, temperature

import numpy as np

POINTS = 200
WINDOW = 2.0  # collisions per disk over which a rate is taken
SLOW = 0.9  # of the law
RATIO_TOP = 2.0  # of the axis of ratios, at most


def first_rate(run: Run) -> float:
    """w0: collisions per disk and time at the start, by the equation of state, or as counted."""
    if not run.periodic.all() or np.isnan(run.restitution):
        raise RunError(f"{run.path}: Haff's law is for a periodic box, and one restitution")
    if not equal_disks(run):
        return counted_rate(run)
    z = float(hard_disks.simulated(packing(run)))
    kt = temperature(run)
    return hard_disks.collision_rate(z, 2 * run.radius[0], free_disks(run), kt, run.mass[0])


def counted_rate(run: Run) -> float:
    """w0 by the first collision of each disk; meanwhile Haff's law has slowed the disks down."""
    time, tau = run.collisions_per_disk
    first = min(int(np.searchsorted(tau, 1.0)), len(tau) - 1)
    slower = (1 - run.restitution**2) * tau[first] / 4
    return float(tau[first] / time[first] * (np.expm1(slower) / slower if slower > 0 else 1))


def energy_left(run: Run) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """w0 t, collisions per disk, K / K0 at the observables."""
    time, energy = run.observable("all/kinetic_energy")
    return time * first_rate(run), run.collisions_per_disk.value, energy / energy[0]


class Cooling(NamedTuple):
    """K / K0 of runs that differ by their seed, on common grids, and the rate at which it falls."""

    time: np.ndarray  # (P,) w0 t, in logarithmic steps
    by_time: Estimate
    tau: np.ndarray  # (P,) collisions per disk
    by_collisions: Estimate
    local_rate: Estimate  # (P,) at tau
    homogeneous_until: float  # tau; NaN if the runs end in this state
    rate: Estimate


def cooled(tracks: list[tuple[np.ndarray, np.ndarray, np.ndarray]], xi: float) -> Cooling:
    """What runs with the same restitution say, each as w0 t, collisions per disk, K / K0."""
    late = min(t[-1] for t, _, _ in tracks)
    time = np.geomspace(max(t[1] for t, _, _ in tracks), late, POINTS)
    tau = np.linspace(0, min(c[-1] for _, c, _ in tracks), POINTS)
    logs = [np.interp(tau, c, np.log(k)) for _, c, k in tracks]
    low, high = (np.clip(tau + shift, 0, tau[-1]) for shift in (-WINDOW / 2, WINDOW / 2))
    falls = [np.interp(low, tau, y) - np.interp(high, tau, y) for y in logs]
    local = estimate(np.array(falls) / (high - low))
    end = homogeneous_until(tau, local.mean, hard_disks.haff_rate(xi))
    part = (tau >= WINDOW) & (tau <= (tau[-1] if np.isnan(end) else end / 2))
    slopes = [-np.polyfit(tau[part], y[part], 1)[0] if part.sum() > 2 else np.nan for y in logs]
    return Cooling(
        time,
        estimate([np.interp(time, t, k) for t, _, k in tracks]),
        tau,
        estimate([np.interp(tau, c, k) for _, c, k in tracks]),
        local,
        end,
        estimate(slopes),
    )


def homogeneous_until(tau: np.ndarray, rate: np.ndarray, law: float) -> float:
    """From where on the rate stays below `SLOW` of the law; NaN if it does not in the end."""
    slow = rate < SLOW * law
    if not slow[-1]:
        return float("nan")
    return float(tau[0 if slow.all() else np.flatnonzero(~slow)[-1] + 1])


def draw(groups: list[tuple[float, list[Run]]], results: list[Cooling]) -> plt.Figure:
    """K against time, double logarithmic, and against collisions, logarithmic; below the ratios."""
    figure, panels = plt.subplots(
        2, 2, sharex="col", sharey="row", figsize=(10, 7), height_ratios=(2, 1)
    )
    for (xi, _), found, colour in zip(groups, results, colours(len(groups)), strict=True):
        rate = " ± ".join(to_error(*found.rate))
        label = f"ξ = {xi:g},  rate {rate}  ({hard_disks.haff_rate(xi):.4g})"
        end = found.homogeneous_until
        left_at = np.interp(end, found.tau, found.by_collisions.mean)
        gone = (found.by_time.mean < left_at, found.tau > end)  # all False without an end
        sides = (
            (found.time, found.by_time, hard_disks.haff_by_time),
            (found.tau, found.by_collisions, hard_disks.haff_by_collisions),
        )
        for (x, y, law), (upper, lower), after in zip(sides, panels.T, gone, strict=True):
            ratio = Estimate(y.mean / law(x, xi), y.error / law(x, xi))
            for axes, (mean, error) in ((upper, y), (lower, ratio)):
                band(axes, x, np.where(after, np.nan, mean), error, color=colour)
                band(axes, x, np.where(after, mean, np.nan), error, color=colour, alpha=0.4)
            upper.plot(x, law(x, xi), color="black", ls="--", lw=1)
        panels[0, 0].plot([], [], color=colour, label=f"ξ = {xi:g}")
        panels[0, 1].plot([], [], color=colour, label=label)
    panels[0, 0].plot([], [], color="black", ls="--", lw=1, label="Haff 1983")
    panels[0, 1].plot([], [], color="black", ls="--", lw=1, label="van Noije and Ernst 1998")
    floor = min(found.by_time.mean.min() for found in results)
    panels[0, 0].set(xscale="log", yscale="log", ylim=(floor / 2, 1.5), ylabel="$K / K_0$")
    panels[1, 0].set(xlabel="$w_0\\,t$", ylabel="$K$ / law")
    panels[1, 0].set_ylim(None, min(RATIO_TOP, panels[1, 0].get_ylim()[1]))
    panels[1, 1].set(xlabel="collisions per disk", xlim=(0, None))
    for axes in panels[1]:
        axes.axhline(1, color="black", ls="--", lw=1, zorder=0)
    panels[0, 0].legend()
    panels[0, 1].legend(title="cooling rate (law); pale: no longer homogeneous", fontsize=8)
    runs = [run for _, members in groups for run in members]
    eta = ", ".join(f"{value:.3g}" for value in sorted({round(packing(run), 6) for run in runs}))
    figure.suptitle(f"{caption(runs)},  η = {eta}", fontsize=10)
    return figure


def rates(groups: list[tuple[float, list[Run]]], results: list[Cooling]) -> list[dict]:
    """The cooling rate beside the law, and where the homogeneous state ends."""
    return [
        {
            "restitution": xi,
            "runs": len(members),
            **measured("rate", found.rate),
            "expected": hard_disks.haff_rate(xi),
            "homogeneous_until": None
            if np.isnan(found.homogeneous_until)
            else found.homogeneous_until,
        }
        for (xi, members), found in zip(groups, results, strict=True)
    ]


def table(groups: list[tuple[float, list[Run]]], results: list[Cooling]) -> list[dict]:
    """Energies after 5, 10 and 20 collisions per disk, as far as the runs go."""
    rows = []
    for (xi, members), found in zip(groups, results, strict=True):
        for tau in (5, 10, 20):
            if tau > found.tau[-1]:
                break
            left = Estimate(*(np.interp(tau, found.tau, y) for y in found.by_collisions))
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


def curves(groups: list[tuple[float, list[Run]]], results: list[Cooling]) -> dict[str, np.ndarray]:
    """All curves and laws."""
    columns = {}
    for (xi, _), found in zip(groups, results, strict=True):
        time, tau = found.time, found.tau
        columns[f"w0_t_xi{xi:g}"] = time
        columns[f"K_by_time_xi{xi:g}"], columns[f"K_by_time_error_xi{xi:g}"] = found.by_time
        columns[f"haff_xi{xi:g}"] = hard_disks.haff_by_time(time, xi)
        columns[f"collisions_per_disk_xi{xi:g}"] = tau
        columns[f"K_xi{xi:g}"], columns[f"K_error_xi{xi:g}"] = found.by_collisions
        columns[f"law_xi{xi:g}"] = hard_disks.haff_by_collisions(tau, xi)
        columns[f"rate_xi{xi:g}"], columns[f"rate_error_xi{xi:g}"] = found.local_rate
    return columns


def main() -> None:
    args = command_line(__doc__, "haff.png").parse_args()
    runs = read_all(args.runs)
    groups = grouped(runs, lambda run: run.restitution)
    results = [cooled([energy_left(run) for run in members], xi) for xi, members in groups]
    figure, tables = draw(groups, results), (table(groups, results), rates(groups, results))
    title = "Cooling of a gas of inelastic disks"
    report(args, runs, title, figure, *tables, data=curves(groups, results))


if __name__ == "__main__":
    launch(main)
