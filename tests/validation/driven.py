"""Section 15 of the report: thermal walls, rough disks, transport coefficients."""

from math import pi, sqrt

import numpy as np

from ricochet import Run, hard_disks as hd, mixtures
from ricochet.analysis.statistics import Estimate, combine_runs, goodness_of_fit
from ricochet.analysis.equilibrium import start_of_equilibrium
from ricochet.analysis.transport import MOMENTS, of_moments
from ricochet.predictions.theory import ROUGH_RATIOS, maxwell_cdf

from .case import AT_LEAST, Case, Member, sigmas, within
from .estimators import over
from .inputs import PERIODIC, ensemble

# --- one disk between a hot and a cold wall; the distance open to its centre is 1 ---

HOT, COLD = 4.0, 1.0
FLUX = sqrt(2 / pi) * sqrt(HOT * COLD) * (sqrt(HOT) - sqrt(COLD))


def between_walls(turning: bool) -> tuple[Member, ...]:
    """Return runs of one disk, smooth or rough, in a box that is periodic along the walls."""
    spin = {"angular_velocity": 1.0} if turning else {}
    return ensemble(
        10,
        box={"upper": (1.2, 1), "boundary": ("wall", "periodic")},
        side=[{"name": "left", "temperature": HOT}, {"name": "right", "temperature": COLD}],
        species={"name": "gas", "count": 1, "radius": 0.1, "temperature": 2.0, **spin},
        stop={"time": 40000},
        output={"frames_every_time": 40000, "observables_every_time": 4000},
    )


def rate(run: Run, name: str) -> float:
    """Return the final value of a cumulative observable per time."""
    time, value = run.observable(name)
    return float(value[-1] / time[-1])


def flux(run: Run) -> float:
    """Return the heat flowing from left to right per time."""
    return (rate(run, "sides/left/energy_to_disks") - rate(run, "sides/right/energy_to_disks")) / 2


# --- a gas between walls of one temperature ---

KT, COUNT = 2.0, 50
HEATED = ensemble(
    10,
    box={"upper": (20, 20), "boundary": ("wall", "periodic")},
    side=[{"name": side, "temperature": KT} for side in ("left", "right")],
    species={"name": "gas", "count": COUNT, "radius": 0.5, "temperature": KT},
    stop={"time": 4000},
    output={"frames_every_time": 100, "observables_every_time": 2},
)


def energies(run: Run) -> np.ndarray:
    """Return the total energies after equilibration."""
    time, energy = run.observable("total_energy")
    return energy[time >= 100]


def maxwell_p(*runs: Run) -> float:
    """Return the p-value of a test of all speeds against the Maxwell distribution at T."""
    speeds = [run.speed(slice(1, None)).ravel() * np.sqrt(1 / (2 * KT)) for run in runs]
    return goodness_of_fit(np.concatenate(speeds), maxwell_cdf).ks_p


# --- rough disks that cool ---

ETA, ROUGH_COUNT = 0.0025, 20000  # dilute, because the references are for the dilute limit


def cooling(xi: float, beta: float) -> tuple[Member, ...]:
    """Return dilute cooling gases that start with the steady temperature ratio."""
    edge = sqrt(ROUGH_COUNT * pi / 4 / ETA)
    return ensemble(
        6,
        box={"upper": (edge, edge), **PERIODIC},
        species={
            "name": "gas", "count": ROUGH_COUNT, "radius": 0.5, "temperature": 1.0,
            "rotational_temperature": ROUGH_RATIOS[xi, beta],
        },
        contact={"restitution": xi, "tangential_restitution": beta},
        stop={"collisions_per_disk": 10},
        output={"observables_every_collisions": 2000},
    )  # fmt: skip


def ratio(run: Run) -> float:
    """Return T_rot / T, averaged from 4 to 10 collisions per disk."""
    tau = run.collisions_per_disk.value
    turning, moving = (
        run.observable(f"all/{name}").value for name in ("rotational_temperature", "temperature")
    )
    return float(np.mean((turning / moving)[tau >= 4]))


# --- viscosities and conductivity of a gas in equilibrium ---

FLOWING = 200


def flowing(eta: float, size: float, mass: float) -> tuple[Member, ...]:
    """Return gases of two equally numerous species, the first with diameter and mass 1."""
    edge = sqrt(FLOWING * pi / 8 * (1 + size**2) / eta)
    own = np.full(2, FLOWING / 2 / edge**2), np.array([1, size]), np.array([1, mass])
    memory = mixtures.enskog_mixture(hd.henderson(eta), *own)["memory"]
    half = {"count": FLOWING // 2, "temperature": 1.0, "exact_temperature": 1.0}
    return ensemble(
        8,
        box={"upper": (edge, edge), **PERIODIC},
        species=[
            {"name": "first", "radius": 0.5, "mass": 1.0, **half},
            {"name": "other", "radius": size / 2, "mass": mass, **half},
        ],
        stop={"time": 4000 * memory},
        output={"observables_every_time": 0.1 * memory, "helfand": True},
    )  # fmt: skip


def enskog_ratios(*runs: Run) -> Estimate:
    """Return the viscosities and, for equal disks, the conductivity relative to Enskog's values."""
    found = of_moments(list(runs), [start_of_equilibrium(run) for run in runs])
    means = [combine_runs(found[name].members) for name in MOMENTS if name in found]
    return Estimate(*(np.array([getattr(one, k) for one in means]) for k in ("mean", "error")))


CASES = [
    Case(
        "P15-01", "one smooth disk between walls at T = 4 and 1: heat per time",
        between_walls(False), over(flux), 1.5 * FLUX, sigmas(4, 0.02), "D",
    ),
    Case(
        "P15-01", "one rotating disk between thermal walls: heat per time",
        between_walls(True), over(flux), 2 * FLUX, sigmas(4, 0.02), "D",
    ),
    Case(
        "P15-02", "thermal walls: variance of the energy over N T²",
        HEATED, over(lambda run: energies(run).var() / (COUNT * KT**2)), 1, sigmas(4, 0.2), "D",
    ),
    Case(
        "P15-02", "thermal walls: p-value of the speeds against Maxwell's distribution",
        HEATED, maxwell_p, 0.001, AT_LEAST, "D",
    ),
    *[
        Case(
            "P15-03", f"rough disks, ξ = {xi}, β = {beta}: T_rot / T",
            cooling(xi, beta), over(ratio), expected, within(0.01), "D",
        )
        for (xi, beta), expected in ROUGH_RATIOS.items()
    ],
    *[
        Case(
            "P15-04",
            f"packing {eta}, radii 1 : {size}, masses 1 : {mass}: transport over Enskog's",
            flowing(eta, size, mass), enskog_ratios, 1, sigmas(4, 0.2), "D",
        )
        for eta, size, mass in ((0.05, 1, 1), (0.2, 1, 1), (0.01, 2, 4), (0.2, 1, 10))
    ],
]  # fmt: skip
