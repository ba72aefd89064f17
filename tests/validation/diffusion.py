"""Section 14 of the report: velocity autocorrelation and diffusion.

Frames are written in single precision, because seven digits of a velocity suffice here.
"""

import numpy as np

from ricochet import Run, hard_disks as hd
from ricochet.analysis.correlations import Correlator, curves
from ricochet.analysis.equilibrium import later

from .case import Case, Member, within
from .estimators import over
from .inputs import gases

N = 1024
PACKINGS = (0.05, 0.2, 0.4)


def rate(eta: float) -> float:
    """Return the collision rate w at kT = 1."""
    diameter = 2 * np.sqrt(eta / (np.pi * N))
    return hd.collision_rate(float(hd.simulated_finite(eta, N)), diameter, N - 1)


def watched(seeds: int, eta: float, step: float, frames: int) -> tuple[Member, ...]:
    """Return runs with frames `step` mean free times apart."""
    interval = step / rate(eta)
    return gases(
        seeds, N, packing_fraction=eta, periodic=True, temperature=1.0,
        stop={"time": interval * frames},
        output={"frames_every_time": interval, "precision": "single", "event_log": step < 1},
    )  # fmt: skip


def mean_free_time(run: Run) -> float:
    """Return the mean free time 1 / w at the energy of a run."""
    return run.n_disks * run.time[-1] / (2 * run.observable("collisions").value[-1])


def found(run: Run, free_times: np.ndarray) -> dict:
    """Return the time correlations of a run, without its start, at the given lags."""
    time, unit = run.time[later(run)], mean_free_time(run)
    step = time[1] - time[0]
    lags = step * np.round(free_times * unit / step)
    return curves([Correlator(run, time, lags=lags).follow(run)])["all"]


def half_and_one(run: Run) -> list[float]:
    """Return psi at w t = 1/2 and 1, interpolated between frames."""
    t, vacf, _ = found(run, np.arange(6) / 4)["vacf"]
    psi = vacf[1:] / vacf[0]
    return list(np.exp(np.interp((0.5, 1.0), t[1:] / mean_free_time(run), np.log(psi))))


def enskog_ratio(run: Run) -> float:
    """Return the slope of <dx^2> / 4 between w t = 8 and 28, relative to Enskog's value."""
    t, msd, _ = found(run, np.array([8, 28]))["msd"]
    kt = np.sum(run.kinetic_energy(0)) / (run.n_disks - 1)
    eta = 0.05
    expected = hd.enskog(float(hd.simulated(eta)), eta, 2 * run.radius[0], kt)["D"]
    return (msd[1] - msd[0]) / (4 * (t[1] - t[0])) / expected


CASES = [
    *[
        Case(
            "P14-01", f"packing {eta}: velocity autocorrelation at w t = 0.5 and 1",
            watched(8, eta, 0.25, 500), over(half_and_one),
            [0.609, 0.3755], within(0.01), "D, R",
        )
        for eta in PACKINGS
    ],
    Case(
        "P14-02", "packing 0.05: diffusion coefficient over Enskog's",
        watched(6, 0.05, 1.0, 1200), over(enskog_ratio),
        1.05, within(0.04), "D, R",
    ),
]  # fmt: skip
