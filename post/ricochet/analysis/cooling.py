"""Gases that cool: energies of many runs on common grids, Haff's law, temperatures of rough disks.

tau = collisions per disk.  `Curves` has by name what several runs say together: grids as arrays,
what is measured on them as estimates.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..predictions import hard_disks, theory
from ..reading.nature import SOURCES, TRAITS, Refused, allow
from ..reading.reader import Run
from .statistics import Estimate, estimate, propagate_error
from .thermodynamics import free_disks, kt_at_start, lightest_and_heaviest, packing

Curves = dict[str, np.ndarray | Estimate]

WINDOW = 2.0  # collisions per disk over which a cooling rate is taken
SLOW = 0.9  # of Haff's law, below which a gas is no longer homogeneous
SMOOTH = (
    "inelastic",
    "soft_contacts",
    "mixture",
    "rotating",
)  # what a gas may be that cools by Haff's law
SETTLED = 0.005  # the ratio has forgotten its start when by the law it is so close to its limit


def on_grid(x: Sequence[Any], y: Sequence[Any], points: int) -> tuple[np.ndarray, np.ndarray]:
    """A grid from 0 to the last x of the shortest run, and the tracks y (K, T) there: (R, K, P)."""
    grid = np.linspace(0, min(own[-1] for own in x), points)
    each = zip(x, y, strict=True)
    return grid, np.array([[np.interp(grid, own, k) for k in tracks] for own, tracks in each])


def energies(runs: list[Run], points: int = 201) -> Curves:
    """Of runs that differ by their seed: kinetic energies per disk of all and of each species.

    `K_...` over that of all at the start, against `collisions_per_disk`; `ratio` of the
    temperatures, heaviest to lightest species; `energy_...` against `time`.
    """
    names, alone = ("all", *runs[0].names), TRAITS.keys() - SOURCES - {"collapsed", "gravity"}
    for run in runs:
        allow(run, "it does not cool by itself", *alone)
    energy = [np.array([moving_energy(run, name) for name in names]) for run in runs]
    first = np.mean([tracks[0, 0] for tracks in energy])
    left = [tracks / tracks[0, 0] for tracks in energy]
    time, tau = zip(*(run.collisions_per_disk for run in runs), strict=True)
    found: Curves = {}
    found["collisions_per_disk"], by_tau = on_grid(tau, left, points)
    for k, name in enumerate(names):
        found[f"K_{name}"] = estimate(by_tau[:, k])
    if np.ptp(runs[0].mass) > 0:
        light, heavy = lightest_and_heaviest(runs[0])
        found["ratio"] = estimate(by_tau[:, 1 + heavy] / by_tau[:, 1 + light])
    found["time"], by_time = on_grid(time, left, points)
    for k, name in enumerate(names):
        found[f"energy_{name}"] = Estimate(*(np.array(estimate(by_time[:, k])) * first))
    return found


def moving_energy(run: Run, name: str = "all") -> np.ndarray:
    """(T,) kinetic energy per disk at the observables, of disks that moved at the start."""
    energy = run.observable(f"{name}/kinetic_energy").value
    if name == "all" and not energy[0] > 0:
        raise Refused(f"{run.path}: starts with disks at rest; there is nothing to cool")
    return energy


# --- Haff's law ---


def first_rate(run: Run) -> float:
    """w0: collisions per disk and time at the start, by the equation of state, or as counted."""
    law = "Haff's law is for smooth disks that only cool, in a periodic box"
    allow(run, law, *SMOOTH)
    if "inelastic" not in run.nature:
        raise Refused(f"{run.path}: does not cool; {law}")
    if {"soft_contacts", "mixture"} <= run.nature:
        raise Refused(f"{run.path}: is a mixture of soft disks; {law}, or of one kind")
    if "mixture" in run.nature:
        return counted_rate(run)
    z = float(hard_disks.simulated(packing(run)))
    kt = kt_at_start(run)
    return hard_disks.collision_rate(z, 2 * run.radius[0], free_disks(run), kt, run.mass[0])


def counted_rate(run: Run) -> float:
    """w0 by the first collision of each disk; meanwhile Haff's law has slowed the disks down."""
    time, tau = run.collisions_per_disk
    first = min(int(np.searchsorted(tau, 1.0)), len(tau) - 1)
    slower = (1 - run.restitution**2) * tau[first] / 4
    return float(tau[first] / time[first] * (np.expm1(slower) / slower if slower > 0 else 1))


def energy_left(run: Run) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """w0 t, collisions per disk, K / K0 at the observables."""
    time, tau = run.collisions_per_disk
    energy = moving_energy(run)
    return time * first_rate(run), tau, energy / energy[0]


def soft_law(runs: list[Run]) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """w0 t, collisions per disk, K / K0 by the law of soft disks; None if they are not."""
    if "soft_contacts" not in runs[0].nature:
        return None
    thermal = np.mean([np.sqrt(kt_at_start(run) / run.mass[0]) for run in runs])
    return hard_disks.haff_soft(runs[0].contact_law, float(thermal))


def haff(
    tracks: list[tuple[np.ndarray, np.ndarray, np.ndarray]],
    xi: float,
    soft: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None,
    points: int = 200,
) -> tuple[Curves, Estimate, float, Estimate]:
    """What runs with the same restitution say, each as w0 t, collisions per disk, K / K0.

    Curves: K / K0 against w0 t, in logarithmic steps, and against collisions per disk, each with
    its law, and the local cooling rate.  Then the cooling rate, or with the law of soft disks the
    `exponent`, and where the homogeneous state ends, in collisions per disk, alone and with its
    error: NaN if it does not.
    """
    time = np.geomspace(max(t[1] for t, *_ in tracks), min(t[-1] for t, *_ in tracks), points)
    tau, by_tau = on_grid([c for _, c, _ in tracks], [(k, np.log(k)) for *_, k in tracks], points)
    logs = by_tau[:, 1]
    low, high = (np.clip(tau + shift, 0, tau[-1]) for shift in (-WINDOW / 2, WINDOW / 2))
    falls = [np.interp(low, tau, y) - np.interp(high, tau, y) for y in logs]
    local = estimate(np.array(falls) / (high - low))
    law, by_time = hard_disks.haff_rate(xi), hard_disks.haff_by_time(time, xi)
    by_collisions = hard_disks.haff_by_collisions(tau, xi)
    if soft is not None:
        by_time, by_collisions = (
            np.exp(np.interp(x, own, np.log(soft[2])))
            for x, own in zip((time, tau), soft[:2], strict=True)
        )
        law = -np.gradient(np.log(by_collisions), tau)
    end = homogeneous_until(tau, local.mean, law)
    part = (tau >= WINDOW) & (tau <= (tau[-1] if np.isnan(end) else end / 2))
    slopes = [-np.polyfit(tau[part], y[part], 1)[0] if part.sum() > 2 else np.nan for y in logs]
    in_time = [np.exp(np.interp(np.log(time), np.log(t[1:]), np.log(k[1:]))) for t, _, k in tracks]
    if soft is not None:
        slopes = [exponent(time, k) for k in in_time]
    curves: Curves = {
        "w0_t": time,
        "K_by_time": estimate([np.interp(time, t, k) for t, _, k in tracks]),
        "haff": by_time,
        "collisions_per_disk": tau,
        "K": estimate(by_tau[:, 0]),
        "law": by_collisions,
        "rate": local,
    }
    return (
        curves,
        estimate(slopes),
        end,
        propagate_error(lambda c: homogeneous_until(tau, c, law), local),
    )


def exponent(time: np.ndarray, energy: np.ndarray) -> float:
    """P of K ~ t^-p in the last decade of logarithmic times: 2 by Haff, 5/3 if disks are soft."""
    late = time >= time[-1] / 10
    return float(-np.polyfit(np.log(time[late]), np.log(energy[late]), 1)[0])


def homogeneous_until(tau: np.ndarray, rate: np.ndarray, law: float | np.ndarray) -> float:
    """From where on the rate stays below `SLOW` of the law; NaN if it does not in the end."""
    slow = rate < SLOW * law
    if not slow[-1]:
        return float("nan")
    return float(tau[0 if slow.all() else np.flatnonzero(~slow)[-1] + 1])


# --- rough disks ---


def rough_law(run: Run) -> tuple[float, float, float]:
    """xi, beta, q of a run that the laws of rough disks are for."""
    law = "the laws are for equal rough disks that cool in a periodic box, without contact.friction"
    allow(run, law, "inelastic", "rough", "rotating")
    if "rough" not in run.nature:
        raise Refused(f"{run.path}: has smooth disks; {law}")
    if run.parameter("contact", "friction") is not None:
        raise Refused(f"{run.path}: has a Coulomb limit; {law}")
    beta = float(run.parameter("contact", "tangential_restitution"))
    return run.restitution, beta, float(run.parameter("contact", "inertia", 0.5))


def temperatures(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """T of translation and of rotation at the observables."""
    kinds = "temperature", "rotational_temperature"
    t, rotational = (run.observable(f"all/{kind}").value for kind in kinds)
    return t, rotational


def rough(runs: list[Run], points: int = 200) -> Curves:
    """T, T_rot and their ratio against collisions per disk, of runs that differ by their seed."""
    own = [run.collisions_per_disk.value for run in runs]
    tau, both = on_grid(own, [temperatures(run) for run in runs], points)
    t, rotational = np.moveaxis(both, 1, 0)
    values = {"T": t, "T_rot": rotational, "ratio": rotational / t}
    return {"collisions_per_disk": tau} | {name: estimate(one) for name, one in values.items()}


def steady_ratio(runs: list[Run], law: tuple[float, float, float]) -> Estimate:
    """T_rot / T where it is `SETTLED`, or in the second half of runs where it is not yet."""
    ratios = []
    for run in runs:
        tau, (t, rotational) = run.collisions_per_disk.value, temperatures(run)
        expected = theory.rough_temperatures(tau, (t[0], rotational[0]), *law)
        away = np.abs(expected[1] / expected[0] / theory.rough_ratio(*law) - 1) > SETTLED
        late = tau > max(tau[away], default=0.0)
        late = late if late.any() else tau >= tau[-1] / 2
        ratios.append(np.mean(rotational[late] / t[late]))
    return estimate(ratios)
