"""Section 15 of the report, recycled disks: effusion of a gas, and discharge of a hopper."""

from math import pi, sqrt

import numpy as np

from ricochet import Run
from ricochet.reports.grains.discharge import EXPONENT, fitted, rate, reduced_width, reduction

from .case import Case, Member, sigmas, within
from .estimators import over
from .inputs import ensemble, namelist

# --- a dilute gas leaves a chamber through an opening ---

COUNT, RADIUS, OPENING, EVERY = 1000, 1e-4, 0.02, 0.02
HOT = {"temperature": 1.0}
EFFUSION = ensemble(
    4,
    box={"upper": (1.2, 1)},
    wall=[
        {"name": "lower", "from": (1, 0), "to": (1, 0.5 - OPENING / 2)},
        {"name": "upper", "from": (1, 1), "to": (1, 0.5 + OPENING / 2)},
    ],
    side=[{"name": name, **HOT} for name in ("left", "bottom", "top")],
    species={"name": "gas", "count": COUNT, "radius": RADIUS, "region": (0, 1, 0, 1), **HOT},
    drive={"kind": "recycle", "interval": EVERY, "from_region": (1, 1.2, 0, 1),
           "to_region": (0, 1, 0, 1), **HOT},
    stop={"time": 600},
    output={"observables_every_time": 1},
)  # fmt: skip


def effusion(run: Run) -> float:
    """Return the rate over n v D / pi, with the mean speed v = sqrt(pi kT / 2 m).

    The law applies to openings much narrower than the mean free path, 1.8, and than the chamber;
    the rate through an opening of 0.05 is 2 % higher.

    Since disks have a finite size, the opening for their centres is narrower by a diameter, and the
    area that they can reach is smaller. A disk that has left waits half an interval on average
    before it is recycled.
    """
    time, count = run.observable("recycled")
    kt = run.observable("all/temperature").value[10:].mean()
    measured = (count[-1] - count[10]) / (time[-1] - time[10])
    density = (COUNT - measured * EVERY / 2) / (1 - 2 * RADIUS) ** 2
    return float(measured / (density * sqrt(pi * kt / 2) * (OPENING - 2 * RADIUS) / pi))


# --- rough grains leave a hopper, as in `hopper.nml` ---

SETTLED = 4.0  # time after which the discharge is steady


def hopper(width: float) -> Member:
    """Return a hopper with walls inclined by 45 degrees and a mouth of given width."""
    low = 0.1 + width / 2
    return Member(
        namelist(
            box={"upper": (1, 2), "gravity": (0, -1)},
            wall=[
                {"name": "left", "from": (0, 0.6), "to": (0.5 - width / 2, low)},
                {"name": "right", "from": (1, 0.6), "to": (0.5 + width / 2, low)},
            ],
            species={
                "name": "grain",
                "count": 1700,
                "radius": 0.01,
                "polydispersity": 0.1,
                "region": (0, 1, 0.6, 2),
            },
            drive={
                "kind": "recycle",
                "interval": 0.02,
                "from_region": (0, 1, 0, low - 0.05),
                "to_region": (0, 1, 1.6, 2),
                "velocity": (0, -0.5),
            },
            contact={
                "restitution": 0.7,
                "tangential_restitution": 1.0,
                "wall_rule": "normal",
                "contact_time": 1e-3,
            },
            stop={"time": 24},
            output={"observables_every_time": 0.1},
        )
    )


HOPPERS = tuple(hopper(width) for width in (0.12, 0.16, 0.20, 0.24, 0.28, 0.32))


def beverloo(*runs: Run) -> dict[str, tuple[float, float]]:
    """Return the results of the fits of `post/discharge.py`."""
    rates = [rate(run, SETTLED).scaled(reduction(run)) for run in runs]
    widths = np.array([reduced_width(run) for run in runs])
    means, errors = np.array([(one.mean, one.error) for one in rates]).T
    return fitted(widths, means, errors)


CASES = [
    Case(
        "P15-20", "a dilute gas leaves through an opening: rate over n v D / pi",
        EFFUSION, over(effusion), 1, sigmas(4, 0.03), "D",
    ),
    Case(
        "P15-21", "refilled hopper: k of Beverloo's law with the exponent 3/2",
        HOPPERS, lambda *runs: beverloo(*runs)["k"][0], 1.5, within(0.5), "Beverloo et al. 1961",
    ),
    Case(
        "P15-21", "refilled hopper: exponent of Beverloo's law with k = 1.4",
        HOPPERS, lambda *runs: beverloo(*runs)["exponent"][0], EXPONENT, within(0.1),
        "Beverloo et al. 1961",
    ),
]  # fmt: skip
