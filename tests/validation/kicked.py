"""Section 15 of the report, driving: white noise, heat baths, Brownian and active disks."""

from collections.abc import Callable
from math import exp, pi, sqrt

import numpy as np

from ricochet import Run, hard_disks as hd
from ricochet.analysis.correlations import Correlator, curves
from ricochet.analysis.statistics import excess_kurtosis

from .case import Case, Member, sigmas, within
from .estimators import over
from .inputs import PERIODIC, ensemble, gases
from .laws import noise_kurtosis


# --- a dilute inelastic gas with white-noise driving, which balances dissipation at T = 1 ---

HEATED_COUNT, ETA = 5000, 0.0025
FREE_TIME = 1 / float(hd.collision_rate(hd.henderson(ETA), 1.0, HEATED_COUNT))  # at T = 1
STRENGTH = 0.002


def heated(xi: float) -> tuple[Member, ...]:
    """Return heated gases that start at the predicted temperature.

    There are ten kicks per mean free time; the sampling times are not multiples of their interval.
    """
    edge = sqrt(HEATED_COUNT * pi / 4 / ETA)
    kt = hd.noise_temperature(STRENGTH, xi, ETA, 1.0)
    unit = FREE_TIME / sqrt(kt)
    return ensemble(
        8,
        box={"upper": (edge, edge), **PERIODIC},
        species={
            "name": "gas", "count": HEATED_COUNT, "radius": 0.5, "exact_temperature": kt,
            "temperature": kt,
        },
        contact={"restitution": xi},
        drive={
            "kind": "noise", "interval": 0.1 * unit, "strength": STRENGTH,
            "keep_momentum": True,
        },
        stop={"time": 60 * unit},
        output={
            "frames_every_time": 3.03 * unit, "observables_every_time": 0.303 * unit,
            "precision": "single",
        },
    )  # fmt: skip


def steady_temperature(run: Run) -> float:
    """Return the mean temperature after the first fifth of the run."""
    time, kt = run.observable("all/temperature")
    return float(kt[time >= time[-1] / 5].mean())


def steady_kurtosis(run: Run) -> float:
    """Return a2 of the velocities after the first fifth of the run."""
    return float(np.mean([excess_kurtosis(v) for v in run.speed(slice(run.n_frames // 5, None))]))


def diffusion(run: Run) -> float:
    """Return D, from the slope of <dr^2> between 6 and 18 mean free times, over its prediction.

    The prediction is Enskog's D times 2 / (1 + xi), because to first order a collision changes a
    mean velocity by (1 + xi) / 2 of the elastic change; V. Garzo, Physica A 343, 105 (2004), for
    equal disks.
    """
    time = run.time[run.n_frames // 5 : -1]
    lags = (time[1] - time[0]) * np.array([2, 6])
    t, msd, _ = curves([Correlator(run, time, lags=lags).follow(run)])["all"]["msd"]
    theory = hd.enskog(float(hd.henderson(ETA)), ETA, 1.0, steady_temperature(run))["D"]
    return float((msd[1] - msd[0]) / (4 * (t[1] - t[0])) / theory * (1 + run.restitution) / 2)


# --- disks that almost never collide, whose motion is known exactly ---

FREE_COUNT, KICK = 100, 1.0


def free(frames_every: int, kicks: int, **drive) -> tuple[Member, ...]:
    """Return runs of very small driven disks, where `drive` holds the variables of the driving."""
    return ensemble(
        8,
        box={"upper": (100, 100), **PERIODIC},
        species={
            "name": "free", "count": FREE_COUNT, "mass": MASS, "radius": 1e-6,
            "temperature": drive["temperature"],
        },
        drive={"interval": KICK, **drive},
        stop={"time": kicks * KICK},
        output={"frames_every_time": frames_every * KICK},
    )  # fmt: skip


MASS, BATH = 2.0, 3.0
FRACTION = 0.3
LAGS = (1, 2, 5)
BATHED = free(1, 2000, kind="andersen", temperature=BATH, fraction=FRACTION)
DIFFUSING = free(1, 2000, kind="brownian", temperature=BATH)
SWIM, TURN = 1.5, 0.02  #: speed and rotational diffusion coefficient of an active disk
WARMTH = 0.5
SWIMMING = free(
    10,
    20000,
    kind="active",
    temperature=WARMTH,
    self_propulsion_speed=SWIM,
    rotational_diffusion=TURN,
)


def memory(run: Run) -> list[float]:
    """Return <v(0) v(t)> at the lags, in units of 2 kT / m."""
    v = run.velocity[:]
    return [float(np.mean(v[k:] * v[: len(v) - k])) * MASS / BATH for k in (0, *LAGS)]


def spread(lags: tuple[int, ...], law: Callable[[int], float]) -> Callable[[Run], list[float]]:
    """Return a function that measures <|dr|^2> over its prediction, at lags in frames.

    The first frame is left out, because the first flight does not follow a kick.
    """

    def measure(run: Run) -> list[float]:
        r = run.unwrapped(slice(1, None))
        squares = ((k, np.sum((r[k:] - r[:-k]) ** 2, axis=-1)) for k in lags)
        return [float(np.mean(square)) / law(k) for k, square in squares]

    return measure


def headings(run: Run) -> list[float]:
    """Return the mean cosine of the change of orientation at the lags, in frames."""
    angle = run.per_disk("orientation")[:]
    return [float(np.mean(np.cos(angle[k:] - angle[:-k]))) for k in LAGS]


def swum(kicks: int) -> float:
    """Return <|dr|^2> of an active disk flying straight from kick to kick.

    The directions u_1 ... u_n of the flights have <u_i u_j> = exp(-D_r |i - j| interval). For short
    intervals the result is 4 D t + 2 (v / D_r)^2 (D_r t - 1 + exp(-D_r t)), Howse et al., Phys.
    Rev. Lett. 99, 048102 (2007).
    """
    i = np.arange(kicks)
    together = np.exp(-TURN * KICK * np.abs(i[:, None] - i)).sum()
    return float(KICK**2 * (SWIM**2 * together + 2 * kicks * WARMTH / MASS))


# --- two species of rough disks in a heat bath: equipartition of the energy ---

PAIRS = 100


def bathed(kind: str, **drive) -> tuple[Member, ...]:
    """Return dense mixtures of perfectly rough disks that start at another temperature."""
    edge = sqrt(PAIRS * pi * (0.5**2 + 0.8**2) / 0.3)
    return ensemble(
        8,
        box={"upper": (edge, edge), **PERIODIC},
        species=[
            {"name": "light", "count": PAIRS, "radius": 0.5, "temperature": 1.0},
            {
                "name": "heavy", "count": PAIRS, "radius": 0.8, "mass": 4.0,
                "temperature": 1.0,
            },
        ],
        contact={"tangential_restitution": 1.0},
        drive={"kind": kind, "interval": 0.5, "temperature": BATH, **drive},
        stop={"time": 2000},
        output={"observables_every_time": 0.503},
    )  # fmt: skip


def shares(run: Run) -> list[float]:
    """Return <m v^2 / 2> and <I omega^2> of both species over the temperature of the bath."""
    return [
        factor * float(run.observable(f"{species}/{what}").value[100:].mean()) / BATH
        for species in ("light", "heavy")
        for what, factor in (("kinetic_energy", 1), ("rotational_energy", 2))
    ]


def heat_capacity(run: Run) -> float:
    """Return the variance of the energy per disk, divided by T^2."""
    return float(run.observable("total_energy").value[100:].var() / BATH**2 / (2 * PAIRS))


# --- Brownian disks have the pressure of hard disks, whatever their dynamics ---

CROWD, CROWDED = 1000, 0.3
CROWDS = gases(
    4, CROWD, packing_fraction=CROWDED, periodic=True, temperature=1.0,
    drive={"kind": "brownian", "interval": 0.002, "temperature": 1.0},
    stop={"collisions_per_disk": 100}, output={"observables_every_collisions": 5000},
)  # fmt: skip


def compressibility(run: Run) -> float:
    """Return Z from the virial of the pair collisions."""
    time, virial = run.observable("virial")
    return float(1 + (virial[-1] - virial[1]) / (2 * CROWD * (time[-1] - time[1])))


CASES = [
    *[
        Case(
            "P15-05", f"inelastic gas with white noise, ξ = {xi}: T",
            heated(xi), over(steady_temperature), hd.noise_temperature(STRENGTH, xi, ETA, 1.0),
            sigmas(4, 0.01), "van Noije and Ernst 1998",
        )
        for xi in (0.8, 0.6)
    ],
    *[
        Case(
            "P15-05", f"inelastic gas with white noise, ξ = {xi}: a2",
            heated(xi), over(steady_kurtosis), noise_kurtosis(xi), within(0.005),
            "van Noije and Ernst 1998",
        )
        for xi in (0.8, 0.6)
    ],
    *[
        Case(
            "P15-05",
            f"inelastic gas with white noise, ξ = {xi}: diffusion coefficient over theory",
            heated(xi), over(diffusion), 1, within(0.03), "Garzo 2004",
        )
        for xi in (0.8, 0.6)
    ],
    Case(
        "P15-06", "Andersen, free disks: velocity autocorrelation after 0 to 5 kicks",
        BATHED, over(memory), [(1 - FRACTION) ** k for k in (0, *LAGS)], sigmas(4, 0.02), "D",
    ),
    *[
        Case(
            "P15-06", f"{kind}, rough mixture: temperatures of translation and rotation over T",
            bathed(kind, **more), over(shares), 1, sigmas(4, 0.01), "D",
        )
        for kind, more in (("andersen", {"fraction": 0.2}), ("brownian", {}))
    ],
    Case(
        "P15-06", "andersen, rough mixture: variance of the energy over N T²",
        bathed("andersen", fraction=0.2), over(heat_capacity), 1.5, sigmas(4, 0.1), "D",
    ),
    Case(
        "P15-07", "Brownian free disks: mean square displacement over 4 D t",
        DIFFUSING, over(spread((1, 5, 20), lambda kicks: 2 * BATH / MASS * KICK**2 * kicks)),
        1, sigmas(4, 0.02), "D",
    ),
    Case(
        "P15-07", "Brownian disks at packing 0.3: Z by the virial",
        CROWDS, over(compressibility), float(hd.simulated(CROWDED)), sigmas(4, 0.01), "KR",
    ),
    Case(
        "P15-08", "active free disks: mean square displacement over theory",
        SWIMMING, over(spread((1, 10, 100), lambda frames: swum(10 * frames))),
        1, sigmas(4, 0.02), "Howse et al. 2007, D",
    ),
    Case(
        "P15-08", "active free disks: mean cosine of the rotation at D_r t = 0.2, 0.4, 1",
        SWIMMING, over(headings), [exp(-TURN * 10 * KICK * k) for k in LAGS], sigmas(4, 0.02), "D",
    ),
]  # fmt: skip
