"""Section 9 of the report: cooling gases, the TC model, inelastic collapse."""

from itertools import pairwise
from math import log, sqrt

import numpy as np

from ricochet import Run, hard_disks as hd
from ricochet.analysis.cooling import energy_left, exponent, soft_law
from ricochet.mixtures import cooling_ratio

from .case import AT_LEAST, AT_MOST, EXACT, Case, Member, relative, sigmas, within
from .estimators import at_collisions, each, over
from .inputs import PERIODIC, disk, gases, light_and_heavy, namelist

# --- gases of one species ---

ETA = 0.02


def cooling(xi: float, tau: float) -> tuple[Member, ...]:
    """Return thirty cooling gases that start in equilibrium."""
    return gases(
        30, 1000, packing_fraction=ETA, periodic=True, temperature=1.0,
        contact={"restitution": xi}, stop={"collisions_per_disk": tau},
        output={"observables_every_collisions": 50},
    )  # fmt: skip


COOLING = {0.9: cooling(0.9, 20.2), 0.8: cooling(0.8, 10.2)}


def left(run: Run, tau: float) -> float:
    """Return K / K0 after `tau` collisions per disk."""
    energy = at_collisions(run, "all/kinetic_energy", tau)
    return float(energy / run.observable("all/kinetic_energy").value[0])


def left_at_time(run: Run, w0_t: float) -> float:
    """Return K / K0 after a time in units of the initial mean free time."""
    time, energy = run.observable("all/kinetic_energy")
    kt = energy[0] * run.n_disks / (run.n_disks - 1)
    z = hd.simulated_finite(ETA, run.n_disks)
    w0 = hd.collision_rate(z, 2 * run.radius[0], run.n_disks - 1, kt)
    return float(np.interp(w0_t / w0, time, energy) / energy[0])


ENDLESS = tuple(
    member
    for seed, xi in ((1, 0.8), (2, 0.6))
    for member in gases(
        (seed,), 100, packing_fraction=0.05, periodic=True, contact={"restitution": xi},
        stop={"collisions": 10**9}, output={"observables_every_collisions": 1000},
    )
)  # fmt: skip


SOFT = {
    law: gases(
        20, 500, packing_fraction=ETA, periodic=True, temperature=1.0,
        contact={"restitution": 0.8, "restitution_law": law, "reference_speed": 20},
        stop={"collisions_per_disk": 150},
        output={"observables_per_decade": 20, "decades_from": 0.1},
    )
    for law in ("power", "viscoelastic")
}  # fmt: skip


def late_exponent(run: Run) -> float:
    """Return p of K ~ t^-p after thousands of initial mean free times."""
    time, energy = run.observable("all/kinetic_energy")
    return exponent(time, energy)


def over_the_law(run: Run) -> float:
    """Return the final K over its prediction for velocity-dependent restitution."""
    law, (w0_t, _, left) = soft_law([run]), energy_left(run)
    return float(left[-1] / np.exp(np.interp(w0_t[-1], law[0], np.log(law[2]))))


def fall(run: Run) -> float:
    """Return by how many powers of ten the temperature decreases."""
    kt = run.observable("all/temperature").value
    return float(np.log10(kt[0] / kt[-1]))


SLOW = 0.99999


def slow_loss(rule: str) -> tuple[Member, ...]:
    """Return gases that lose energy to the walls so slowly that they remain in equilibrium."""
    return gases(
        30, 1000, radius=0.001, temperature=1.0,
        contact={"restitution": 1, "wall_restitution": SLOW, "wall_rule": rule},
        stop={"collisions_per_disk": 400}, output={"observables_every_collisions": 5000},
    )  # fmt: skip


def loss_per_hit(run: Run) -> float:
    """Return the mean energy loss per collision with a side, in units of (1 - xi^2) kT."""
    energy = run.observable("total_energy").value
    hits = run.observable("side_collisions").value.sum(axis=1)
    return -log(energy[-1] / energy[0]) * run.n_disks / hits[-1] / (1 - SLOW**2)


GAS = [
    *[
        Case(
            "P9-01", f"cooling, ξ = {xi}: K / K(0) after {tau} collisions per disk",
            COOLING[xi], over(lambda run, tau=tau: left(run, tau)),
            hd.haff_by_collisions(tau, xi), relative(0.03), "van Noije and Ernst 1998; R",
        )
        for xi, tau in ((0.9, 10), (0.9, 20), (0.8, 10))
    ],
    Case(
        "P9-02", "cooling, ξ = 0.9: K / K(0) after 12.8 initial mean free times",
        COOLING[0.9], over(lambda run: left_at_time(run, 12.8)),
        hd.haff_by_time(12.8, 0.9), relative(0.015), "Haff 1983; R",
    ),
    *[
        Case(
            "P9-13", f"cooling, '{law}': {what}", SOFT[law], over(of), value, relative(part),
            "Ramirez et al. 1999",
        )
        for law in SOFT
        for what, of, value, part in (
            ("exponent p of K ~ t^-p at late times", late_exponent, 5 / 3, 0.02),
            ("K over the law for Maxwell's distribution", over_the_law, 1.0, 0.05),
        )
    ],
    Case(
        "P9-12", "unlimited cooling: decades of T until the program ends the run",
        ENDLESS, each(fall), 26, within(1), "D",
    ),
    *[
        Case(
            "P9-04", f"walls, rule '{rule}': mean energy loss per collision over (1 - ξ²) kT",
            slow_loss(rule), over(loss_per_hit),
            share * 2000 / 2001, sigmas(3, 0.01), "D",
        )
        for rule, share in (("velocity", 1.5), ("normal", 1.0))
    ],
]  # fmt: skip

# --- mixture ---


def mixtures(xi: float, seeds: int, radius: float, **box) -> tuple[Member, ...]:
    return light_and_heavy(
        seeds, radius, box=box, contact={"restitution": xi}, stop={"collisions_per_disk": 20},
        output={"observables_every_collisions": 100},
    )  # fmt: skip


def temperature_ratio(run: Run) -> float:
    """Return K_heavy / K_light, averaged from 10 to 20 collisions per disk."""
    heavy, light = (
        at_collisions(run, f"{name}/kinetic_energy", np.linspace(10, 20, 21))
        for name in ("heavy", "light")
    )
    return float(np.mean(heavy / light))


def steps(*runs: Run) -> float:
    """Return the smallest increase of the ratio between successive groups, over its error."""
    ratio, third = over(temperature_ratio), len(runs) // 3
    groups = [ratio(*runs[k : k + third]) for k in range(0, len(runs), third)]
    return min((b.mean - a.mean) / np.hypot(a.error, b.error) for a, b in pairwise(groups))


EXAM = tuple(member for xi in (1.0, 0.9, 0.8) for member in mixtures(xi, 16, 0.004))
MIXTURE = [
    Case(
        "P9-05",
        "mixture: increase of K_heavy / K_light from ξ = 1 to 0.9 to 0.8, in standard errors",
        EXAM, steps, 3, AT_LEAST, "EX; Garzo and Dufty 1999",
    ),
    Case(
        "P9-05", "mixture, ξ = 1: K_heavy / K_light after 10 collisions per disk",
        EXAM[:16], over(temperature_ratio), 1, relative(0.03), "D",
    ),
    *[
        Case(
            "P9-06", f"dilute mixture in a periodic box, ξ = {xi}: K_heavy / K_light",
            mixtures(xi, 64, 0.001, **PERIODIC), over(temperature_ratio), cooling_ratio(4, xi),
            relative(0.03), "Garzo and Dufty 1999; D",
        )
        for xi in (0.9, 0.8)
    ],
]  # fmt: skip

# --- TC model ---


def since_last(run: Run) -> np.ndarray:
    """Return, for each event, the time since the last event of either partner."""
    log = run.event_log()
    last = [-np.inf] * (run.n_disks + 1)
    since = np.empty(len(log.time))
    for k, (t, i, j) in enumerate(zip(*(part.tolist() for part in log[:3]), strict=True)):
        partners = (i, j) if j > 0 else (i,)
        since[k] = t - max(last[p] for p in partners)
        for p in partners:
            last[p] = t
    return since


def flagged(run: Run) -> np.ndarray:
    """Return which events follow an event of one of the partners within the contact time."""
    return since_last(run) < run.parameter("contact", "contact_time")


FLAG_TIMES = (0.01, 0.05, 0.1, 0.2, 0.5, 1, 2)
ELASTIC = tuple(
    member
    for eta in (0.05, 0.1)
    for member in gases(
        1, 1000, packing_fraction=eta, periodic=True, temperature=1.0,
        stop={"collisions_per_disk": 400}, output={"event_log": True},
    )
)  # fmt: skip


def flag_fractions(run: Run) -> np.ndarray:
    """Return the fractions of collisions that are elastic in the TC model, at `FLAG_TIMES`."""
    rate = 2 * len(run.event_log().time) / run.n_disks / run.time[-1]
    since = since_last(run)[run.event_log().time > 10 / rate] * rate
    return np.mean(since[:, None] < FLAG_TIMES, axis=0)


FLAGGED = tuple(
    member
    for contact_time in (0.01, 1e-3, 1e9)
    for member in gases(
        1, 100, radius=0.02, contact={"restitution": 0.5, "contact_time": contact_time},
        stop={"events": 2000}, output={"observables_every_events": 1, "event_log": True},
    )
)  # fmt: skip


def wrong_flags(run: Run) -> int:
    """Return the number of events whose energy loss contradicts the TC model."""
    lost = np.diff(run.observable("dissipated_energy").value) > 0
    return int(np.sum(lost == flagged(run)))


TC = [
    Case(
        "P9-07",
        "TC model: fraction of collisions within t_c of the previous one, w t_c = 0.01 to 2",
        ELASTIC, each(flag_fractions),
        2 * [0.0186, 0.090, 0.172, 0.32, 0.62, 0.86, 0.98], within(0.01), "R",
    ),
    Case(
        "P9-07", "TC model, any t_c: number of events treated wrongly",
        FLAGGED, each(wrong_flags), 0, EXACT, "Luding and McNamara 1998",
    ),
]  # fmt: skip

# --- collapse ---


def line_of_three(xi: float, places: tuple, velocities: tuple, time: float) -> Member:
    """Return a run of three disks on a line, far from the sides."""
    return Member(
        namelist(
            box={"lower": (-1000, 0), "upper": (1001, 1)},
            species=[
                disk((x, 0.5), (v, 0), 0.05) for x, v in zip(places, velocities, strict=True)
            ],
            contact={"restitution": xi}, stop={"time": time},
            output={"event_log": True, "frames_every_events": 1},
        )
    )  # fmt: skip


def symmetric(*factors: float) -> tuple[Member, ...]:
    """Return runs in which the outer of three disks approach at equal speeds, one slightly later.

    The restitution is a factor times the critical restitution of inelastic collapse.
    """
    return tuple(
        line_of_three(factor * CRITICAL, (0.3, 0.5, 0.7001), (1, 0, -1), 100.0)
        for factor in factors
    )


def spread(run: Run) -> float:
    """Return the largest difference between the final velocities."""
    return float(np.ptp(run.velocity[-1][:, 0]))


CRITICAL = 7 - 4 * sqrt(3)
COLLAPSED, DISPERSED = (line_of_three(xi, (0.3, 0.5, 0.7), (1, 0, -0.5), 2.0) for xi in (0.05, 0.1))
FIRST_SIX = [
    0.1, 0.148780487804878, 0.153777208706786, 0.155026293727612, 0.155392587099469,
    0.155504860274233,
]  # fmt: skip
COLLAPSE = [
    Case(
        "P9-10", "three disks on a line, 1.03 and 1.4 times the critical ξ: speed of separation",
        symmetric(1.03, 1.4), each(spread), 1e-12, AT_LEAST,
        "Bernu and Mazighi 1990",
    ),
    Case(
        "P9-10", "three disks on a line, 0.97 and 0.7 times the critical ξ: speed at the collapse",
        symmetric(0.97, 0.7), each(spread), 1e-16, AT_MOST,
        "Bernu and Mazighi 1990",
    ),
    Case(
        "P9-11", "collapse, ξ = 0.05: times of the first six collisions",
        (COLLAPSED,), lambda run: run.event_log().time[:6], FIRST_SIX,
        within(1e-12), "D, 120 digits",
    ),
    Case(
        "P9-11", "collapse, ξ = 0.05: time, velocities, position",
        (COLLAPSED,),
        lambda run: [run.event_log().time[26], *run.velocity[-1][:, 0], run.position[27][1, 0]],
        [7 / 45, 1 / 6, 1 / 6, 1 / 6, 0.525925925925926], within(1e-9), "D, 120 digits",
    ),
    Case(
        "P9-11", "ξ = 0.1: number of collisions, time of the last one, velocities",
        (DISPERSED,),
        lambda run: [len(run.event_log().time), run.event_log().time[-1], *run.velocity[-1][:, 0]],
        [6, 0.195077620020993, 0.1659559375, 0.166739203125, 0.167304859375],
        within(1e-12), "D",
    ),
]  # fmt: skip

CASES = GAS + MIXTURE + TC + COLLAPSE
