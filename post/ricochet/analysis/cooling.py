"""Cooling gases: mean energies of an ensemble, Haff's law and the temperatures of rough disks.

Throughout, tau is the number of collisions per disk. `Curves` maps names to arrays of coordinates,
or to estimates (with errors) of the quantity measured at these coordinates.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy

from ..predictions import hard_disks, theory
from ..reading.files import RunError
from ..reading.nature import SOURCES, TRAITS, Refused, allow
from ..reading.reader import Run
from .estimates import UNLIKELY, Estimate, estimate, propagate_error
from .equilibrium import drift, free_disks, kt_at_start
from .thermodynamics import lightest_and_heaviest, packing

__all__ = [
    "FlowShare",
    "energies",
    "flow_share",
    "temperature_ratio",
]

Curves = dict[str, np.ndarray | Estimate]

WINDOW = 2.0  # averaging window of a cooling rate [collisions per disk]
SLOW = 0.9  # cooling rate over Haff's rate below which a gas counts as inhomogeneous
SMOOTH = (
    "inelastic",
    "soft_contacts",
    "mixture",
    "rotating",
)  # traits of gases that obey Haff's law
NOT_COOLING = "it is not a freely cooling gas"
# all traits that a freely cooling gas may have
COOLING = TRAITS.keys() - SOURCES - {"collapsed", "gravity"}
TOGETHER = 25  # disks per cell when the velocities of neighbours are compared
FLOWING = 0.05  # fraction of the kinetic energy in flows above which a gas counts as inhomogeneous
SETTLED = 0.005  # relative distance from its limit at which the temperature ratio counts as steady


def on_grid(x: Sequence[Any], y: Sequence[Any], points: int) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate the K curves of each run on a common grid that ends with the shortest run."""
    grid = np.linspace(0, min(own[-1] for own in x), points)
    each = zip(x, y, strict=True)
    return grid, np.array([[np.interp(grid, own, k) for k in tracks] for own, tracks in each])


def energies(runs: list[Run], points: int = 201) -> Curves:
    """Average the kinetic energies of cooling gases over runs that differ only in their seed.

    Parameters
    ----------
    runs : list of Run
        (R,) runs of cooling gases
    points : int
        number of points of each curve

    Returns
    -------
    dict of str to numpy.ndarray or Estimate
        curves of shape (points,): "K_all" and "K_SPECIES" (relative to the initial energy of all
        disks) against "collisions_per_disk"; "energy_all" and "energy_SPECIES" against "time"; and
        "ratio", the temperature of the heaviest species divided by that of the lightest

    Raises
    ------
    Refused
        if a run is driven, or if the disks are initially at rest

    Examples
    --------
    >>> found = cooling.energies(cooling_runs)
    >>> found["K_all"].mean.shape, bool(found["K_all"].mean[-1] < 0.1)
    ((201,), True)
    """
    names = ("all", *runs[0].names)
    for run in runs:
        allow(run, NOT_COOLING, *COOLING)
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


def temperature_ratio(runs: Sequence[Run], first: float, last: float) -> Estimate:
    """Average the ratio of the temperatures of two species over a part of each run.

    Parameters
    ----------
    runs : sequence of Run
        (R,) runs of one cooling mixture that differ only in their seed
    first, last : float
        collisions per disk between which the ratio is averaged, or up to the end of a shorter run

    Returns
    -------
    Estimate
        temperature of the heaviest species over that of the lightest, averaged over collisions per
        disk and over the runs

    Raises
    ------
    Refused
        if all species have the same mass, or if a run is driven
    RunError
        if a run ends before `first` collisions per disk

    Examples
    --------
    >>> bool(cooling.temperature_ratio(mixed_runs, 5, 10).mean > 0)
    True
    """
    light, heavy = (runs[0].names[k] for k in lightest_and_heaviest(runs[0]))
    ratios = []
    for run in runs:
        allow(run, NOT_COOLING, *COOLING)
        tau = run.collisions_per_disk.value
        if tau[-1] <= first:
            raise RunError(f"{run.path}: ends after {tau[-1]:.3g} collisions per disk")
        ratio = moving_energy(run, heavy) / moving_energy(run, light)
        part = np.append(tau[(tau > first) & (tau < last)], min(last, tau[-1]))
        part = np.insert(part, 0, first)
        ratios.append(np.trapezoid(np.interp(part, tau, ratio), part) / (part[-1] - first))
    return estimate(ratios)


def moving_energy(run: Run, name: str = "all") -> np.ndarray:
    """Return the kinetic energy per disk (T,); raise Refused if its initial value is zero."""
    energy = run.observable(f"{name}/kinetic_energy").value
    if name == "all" and not energy[0] > 0:
        raise Refused(f"{run.path}: starts with disks at rest, which cannot cool")
    return energy


# --- homogeneity ---


class FlowShare(NamedTuple):
    """Fraction of the kinetic energy of a gas that is due to flows."""

    share: float  # on average 0 for independent velocities, as in a homogeneous gas
    p: float  # p-value of the hypothesis that velocities are independent

    @property
    def homogeneous(self) -> bool:
        """Whether the flows are statistically insignificant, or negligible."""
        return self.p >= UNLIKELY or self.share <= FLOWING


def flow_share(runs: Sequence[Run], frame: int = -1) -> FlowShare:
    """Measure the fraction of the kinetic energy of cooling gases that is due to flows.

    When a gas becomes inhomogeneous, neighbouring disks begin to move in parallel. For independent
    velocities, the squared momentum of a cell of about 25 disks (`TOGETHER`) is on average the sum
    of the squared momenta of its disks. Any excess over this sum is due to a flow: divided by twice
    the mass of the cell, it is the energy of the flow.

    Parameters
    ----------
    runs : sequence of Run
        (R,) runs of one input that differ only in their seed
    frame : int
        index of the frame

    Returns
    -------
    FlowShare
        fraction for all runs together (NaN if the frames have no velocities), and the p-value of
        the hypothesis that velocities are independent

    Examples
    --------
    >>> cooling.flow_share(cooling_runs, 0).homogeneous
    True
    """
    try:
        excess, total, squares, freedom = np.sum([cell_sums(run, frame) for run in runs], axis=0)
    except RunError:  # frames without velocities
        return FlowShare(np.nan, 1.0)
    if not total > 0:
        return FlowShare(0.0, 1.0)
    return FlowShare(float(excess / total), float(scipy.special.chdtrc(freedom, squares)))


def cell_sums(run: Run, frame: int) -> tuple[float, float, float, float]:
    """Return flow energy, kinetic energy, chi^2 of the momenta of cells and degrees of freedom."""
    momentum = run.mass[:, None] * (run.velocity[frame] - drift(run))
    side = np.sqrt(run.edges.prod() * TOGETHER / run.n_disks)
    cells = np.maximum(2, np.rint(run.edges / side)).astype(int)
    place = ((run.position[frame] - run.lower) / run.edges * cells).astype(int)
    cell = np.clip(place, 0, cells - 1) @ (1, cells[0])
    mass, own = (np.bincount(cell, each) for each in (run.mass, np.sum(momentum**2, axis=1)))
    square = np.sum([np.bincount(cell, part) ** 2 for part in momentum.T], axis=0)
    some = own > 0
    excess = np.sum((square - own)[some] / (2 * mass[some]))
    total = np.sum(momentum**2 / (2 * run.mass[:, None]))
    return excess, total, 2 * np.sum(square[some] / own[some]), 2 * some.sum()


def flow_notes(groups: Sequence[tuple[str, Sequence[Run]]]) -> list[str]:
    """Return a note for each named group of gases that become inhomogeneous during their runs."""
    notes = []
    for name, runs in groups:
        found = flow_share(cooled) if (cooled := [r for r in runs if r.nature.cooling]) else None
        if found and not found.homogeneous:
            notes.append(
                f"{name}: at the end the gas is not homogeneous; flows contain "
                f"{100 * found.share:.2g} % of its kinetic energy, and its temperatures are not "
                "those of the homogeneous state"
            )
    return notes


# --- Haff's law ---


def first_rate(run: Run) -> float:
    """Return the initial collision rate w0 [1/time] of smooth disks cooling in a periodic box.

    For equal disks w0 is predicted by the equation of state; for mixtures it is measured. Raise
    `Refused` if Haff's law does not apply.
    """
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
    """Return w0 from the first collisions, corrected for the cooling while they are counted."""
    time, tau = run.collisions_per_disk
    first = min(int(np.searchsorted(tau, 1.0)), len(tau) - 1)
    slower = (1 - run.restitution**2) * tau[first] / 4
    return float(
        tau[first] / (time[first] - time[0]) * (np.expm1(slower) / slower if slower > 0 else 1)
    )


def energy_left(run: Run) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return w0 t, collisions per disk and K / K(0) at each sample, all of shape (T,).

    Raise `Refused` if Haff's law does not apply to the run. In a window of a run, the first sample
    may follow after the start of the window.
    """
    time, tau = run.collisions_per_disk
    if len(time) < 2:
        raise RunError(f"{run.path}: has one sample of the energy, two are required")
    energy = moving_energy(run)
    return (time - time[0]) * first_rate(run), tau, energy / energy[0]


def soft_law(runs: list[Run]) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return w0 t, tau and K / K(0) predicted for a velocity-dependent restitution, or None."""
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
    """Compare the cooling of runs with the same coefficient of restitution with Haff's law.

    `tracks` are results of `energy_left`, and `soft` is a result of `soft_law`. Returned are curves
    (points,); the mean cooling rate per collision or, with `soft`, the exponent of the decay in
    time; and the number of collisions per disk at which the gas becomes inhomogeneous (NaN if it
    never does), without and with its error.
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
    """Fit the exponent p of K ~ t^-p to the last decade of times (T,).

    Haff's law predicts p = 2, and the theory of viscoelastic disks p = 5/3.
    """
    late = time >= time[-1] / 10
    return float(-np.polyfit(np.log(time[late]), np.log(energy[late]), 1)[0])


def homogeneous_until(tau: np.ndarray, rate: np.ndarray, law: float | np.ndarray) -> float:
    """Return the tau after which the cooling rate stays below `SLOW` times `law` (NaN if none)."""
    slow = rate < SLOW * law
    if not slow[-1]:
        return float("nan")
    return float(tau[0 if slow.all() else np.flatnonzero(~slow)[-1] + 1])


# --- rough disks ---


def rough_law(run: Run) -> tuple[float, float, float]:
    """Return normal and tangential restitution and I / (m r^2), or raise `Refused`."""
    law = "the laws are for equal rough disks that cool in a periodic box, without contact.friction"
    allow(run, law, "inelastic", "rough", "rotating")
    if "rough" not in run.nature:
        raise Refused(f"{run.path}: has smooth disks; {law}")
    if run.parameter("contact", "friction") is not None:
        raise Refused(f"{run.path}: has a Coulomb limit; {law}")
    beta = float(run.parameter("contact", "tangential_restitution"))
    return run.restitution, beta, float(run.parameter("contact", "inertia", 0.5))


def temperatures(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return translational and rotational temperature (T,) of rough disks at each sample."""
    kinds = "temperature", "rotational_temperature"
    t, rotational = (run.observable(f"all/{kind}").value for kind in kinds)
    return t, rotational


def rough(runs: list[Run], points: int = 200) -> Curves:
    """Average the temperatures of cooling rough disks over runs that differ only in their seed.

    The curves (points,) are "T" (translational), "T_rot" (rotational) and their "ratio" against
    "collisions_per_disk".
    """
    own = [run.collisions_per_disk.value for run in runs]
    tau, both = on_grid(own, [temperatures(run) for run in runs], points)
    t, rotational = np.moveaxis(both, 1, 0)
    values = {"T": t, "T_rot": rotational, "ratio": rotational / t}
    return {"collisions_per_disk": tau} | {name: estimate(one) for name, one in values.items()}


def steady_ratio(runs: list[Run], law: tuple[float, float, float]) -> Estimate:
    """Estimate the late ratio of rotational to translational temperature, given `rough_law`."""
    ratios = []
    for run in runs:
        tau, (t, rotational) = run.collisions_per_disk.value, temperatures(run)
        expected = theory.rough_temperatures(tau, (t[0], rotational[0]), *law)
        away = np.abs(expected[1] / expected[0] / theory.rough_ratio(*law) - 1) > SETTLED
        late = tau > max(tau[away], default=0.0)
        late = late if late.any() else tau >= tau[-1] / 2
        ratios.append(np.mean(rotational[late] / t[late]))
    return estimate(ratios)
