"""Synthetic runs of gases, shared by several test files of this folder."""

import numpy as np

from ricochet import statistics
from synthetic_run import maxwell_velocities, write_run

TWO = statistics.student(2)  # Student's factor for the error of two runs


def gas(path, rng, count=200, frames=41, mass=1.0, **more):
    """Write a gas that relaxes from equal to Maxwellian speeds, half a collision per frame."""
    angle = rng.uniform(0, 2 * np.pi, (1, count))
    start = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    v = np.concatenate([start, maxwell_velocities(rng, frames - 1, count)])
    v *= np.sqrt(count / np.sum(v**2, axis=(1, 2)))[:, None, None]
    x = rng.uniform(0.05, 0.95, (frames, count, 2))
    energies = 0.5 * np.broadcast_to(mass, count) * np.sum(v**2, axis=2)
    observables = {"collisions": np.arange(frames) * count // 2} | {
        f"{name}/kinetic_energy": energies[:, more.get("species", np.ones(count)) == k + 1].mean(1)
        for k, name in enumerate(more.get("names", ()))
    }
    return write_run(path, x, v, mass=mass, observables=observables, **more)


def cooled(path, xi, decay, heavy=2.0, seed=1, points=101):
    """Write energies that decay with collisions, with a heavy species `heavy` times as hot."""
    t = np.linspace(0, 1, points) ** 2
    total, x = np.exp(-decay * t), np.zeros((1, 4, 2))
    observables = {
        "collisions": 40 * t,
        "all/kinetic_energy": 3 * total,
        "light/kinetic_energy": 6 * total / (1 + heavy),
        "heavy/kinetic_energy": 6 * heavy * total / (1 + heavy),
    }
    more = {"species": [1, 1, 2, 2], "names": ("light", "heavy"), "mass": [1, 1, 4, 4]}
    more["parameters"] = {"run": {"seed": seed}, "contact": {"restitution": xi}}
    return write_run(path, x, x, observable_time=t, observables=observables, **more)


def falling(path, rng, temperature=0.7, frames=400, dynamics="events", drift=0.0, seed=1, hits=15):
    """Write an ideal gas in equilibrium under gravity, with `hits` pair collisions per frame."""
    mass, r = np.repeat([0.025, 0.05], 30), 0.04
    height = r + rng.exponential(temperature / (mass * 9.81), (frames, 60))
    x = np.stack([rng.uniform(r, 8 - r, (frames, 60)), height], axis=-1)
    v = rng.normal(size=(frames, 60, 2)) * np.sqrt(temperature / mass)[:, None]
    k, u = 0.5 * mass * np.sum(v**2, axis=2), mass * 9.81 * x[..., 1]
    halves = {"A": slice(0, 30), "B": slice(30, 60), "all": slice(0, 60)}
    observables = {
        f"{name}/{kind}_energy": e[:, part].mean(axis=1)
        for name, part in halves.items()
        for kind, e in (("kinetic", k), ("potential", u))
    }
    time = np.linspace(0, 100, frames)
    observables |= {"collisions": hits * np.arange(frames), "total_energy": 80 * (1 + drift * time)}
    parameters = {
        "run": {"seed": seed, "dynamics": dynamics, "dt": 0.004},
        "box": {"gravity": [0.0, -9.81]},
        "contact": {"restitution": 1.0},
        "species/A": {"speed": 0.5},
        "species/B": {"speed": 0.25},
    }
    kinds = {"species": np.repeat([1, 2], 30), "names": ("A", "B"), "mass": mass, "radius": r}
    more = {"time": time, "edges": (8, 16), "observables": observables, "parameters": parameters}
    return write_run(path, x, v, **kinds, **more)
