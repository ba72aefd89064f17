"""Section 15 of the report, flow: sheared gases, and fluxes of heat and momentum between walls."""

from collections.abc import Callable
from math import pi, sqrt

import numpy as np

from ricochet import Run, hard_disks as hd
from ricochet.analysis.fields import fields, places, prediction

from .case import Case, Member, relative, sigmas
from .estimators import over
from .inputs import PERIODIC, ensemble
from .laws import sheared_grains

# --- an elastic gas: the viscosity follows from the heating by shear ---

COUNT = 500


def heating(eta: float) -> tuple[Member, ...]:
    """Return gases heated by shear from T = 1 to about 4.

    The shear rate is a thirtieth of the initial collision rate.
    """
    gamma = float(hd.collision_rate(hd.henderson(eta), 1.0, COUNT)) / 30
    doubling = 2 / (viscosity(eta) * gamma**2)
    edge = sqrt(COUNT * pi / 4 / eta)
    return ensemble(
        24,
        box={"upper": (edge, edge), **PERIODIC, "shear_rate": gamma},
        species={"name": "gas", "count": COUNT, "radius": 0.5, "exact_temperature": 1.0,
                 "temperature": 1.0},
        stop={"time": doubling},
        output={"observables_every_time": doubling / 20},
    )  # fmt: skip


def viscosity(eta: float) -> float:
    """Return Enskog's viscosity at T = 1, divided by the mass density."""
    return float(hd.enskog(hd.simulated(eta), eta, 1.0)["viscosity"] * pi / 4 / eta)


def heated_by_shear(eta: float) -> Callable[[Run], float]:
    """Return the growth of sqrt(T), relative to the growth for Enskog's viscosity.

    In n dT/dt = (viscosity) gamma^2 the viscosity is proportional to sqrt(T), so that sqrt(T) grows
    linearly in time.
    """

    def measure(run: Run) -> float:
        time, kt = run.observable("all/temperature")
        growth = (sqrt(kt[-1]) - sqrt(kt[0])) / time[-1]
        return growth * 2 / (viscosity(eta) * run.shear_rate**2)

    return measure


# --- a dilute inelastic gas in which heating by shear balances dissipation ---

GRAINS, ETA = 1000, 0.0025
FREQUENCY = 2 * sqrt(pi) * 4 * ETA / pi  # unit of rates at T = 1


def steady(xi: float) -> tuple[Member, ...]:
    """Return sheared gases at the shear rate for which the theory predicts T = 1."""
    edge = sqrt(GRAINS * pi / 4 / ETA)
    gamma = sheared_grains(xi)[0] * FREQUENCY
    return ensemble(
        8,
        box={"upper": (edge, edge), **PERIODIC, "shear_rate": gamma},
        species={"name": "grains", "count": GRAINS, "radius": 0.5, "temperature": 1.0},
        contact={"restitution": xi},
        stop={"collisions_per_disk": 250},
        output={"frames_every_collisions_per_disk": 1.0,
                "observables_every_collisions_per_disk": 1.0},
    )  # fmt: skip


def of_steady_shear(run: Run) -> list[float]:
    """Return shear rate, -P_xy and P_yy in units of the theory, after 50 collisions per disk.

    Only the kinetic part of the stress is included; the collisional part is smaller by a factor of
    the order of the packing fraction.
    """
    late = slice(50, None)
    place, v = run.position[late], run.velocity[late]
    v[..., 0] -= run.shear_rate * (place[..., 1] - run.lower[1] - run.edges[1] / 2)
    kt = np.mean(v**2)
    return [
        run.shear_rate / (FREQUENCY * sqrt(kt)),
        -np.mean(v[..., 0] * v[..., 1]) / kt,
        np.mean(v[..., 1] ** 2) / kt,
    ]


# --- a gas between two walls: fluxes of heat and momentum ---

BETWEEN, CELLS = 800, 20


def between(eta: float, temperatures: tuple[float, float], speed: float) -> tuple[Member, ...]:
    """Return gases between two thermal walls sliding in opposite directions."""
    edge = sqrt(BETWEEN * pi / 4 / eta / 2)
    return ensemble(
        8,
        box={"upper": (2 * edge, edge), "boundary": ("wall", "periodic")},
        side=[
            {"name": name, "temperature": kt, "surface_velocity": u}
            for name, kt, u in zip(
                ("left", "right"), temperatures, (-speed, speed), strict=True
            )
        ],
        species={"name": "gas", "count": BETWEEN, "radius": 0.5,
                 "temperature": sum(temperatures) / 2},
        stop={"time": 4000},
        output={"frames_every_time": 4, "observables_every_time": 4},
    )  # fmt: skip


def drop(name: str) -> Callable[[Run], float]:
    """Return the change of a field over the middle half of the box, relative to its prediction."""

    def measure(run: Run) -> float:
        own, x = fields([run], None, (CELLS, 1)), places(run, (CELLS, 1))[:, 0]
        law, _ = prediction(own, 0, x)
        half = slice(CELLS // 4, -CELLS // 4)
        both = own.found[name].mean, law[name.partition("_")[0]].mean
        slopes = [np.polyfit(x[half], y[half], 1)[0] for y in both]
        return float(slopes[0] / slopes[1])

    return measure


CASES = [
    *[
        Case(
            "P15-09", f"sheared gas, packing {eta}: viscosity from the heating over Enskog's",
            heating(eta), over(heated_by_shear(eta)), 1, sigmas(4, 0.05), "D",
        )
        for eta in (0.05, 0.2)
    ],
    *[
        Case(
            "P15-09", f"sheared grains, ξ = {xi}: reduced shear rate, -P_xy, P_yy",
            steady(xi), over(of_steady_shear), sheared_grains(xi), relative(0.05),
            "Santos, Garzo and Dufty 2004",
        )
        for xi in (0.95, 0.8)
    ],
    Case(
        "P15-10", "gas between walls at T = 4 and 1: temperature gradient over Enskog's",
        between(0.2, (4.0, 1.0), 0.0), over(drop("temperature")), 1, sigmas(4, 0.05), "D",
    ),
    Case(
        "P15-10", "gas between sliding walls: velocity gradient over Enskog's",
        between(0.2, (1.0, 1.0), 1.5), over(drop("flow_y")), 1, sigmas(4, 0.05), "D",
    ),
]  # fmt: skip
