"""Numbers of the laboratory: pressures, theoretical values, and scans."""

import asyncio

import numpy as np
import pytest

from laboratory import film
from ricochet import Simulation
from ricochet.pages.numbers import (
    means,
    observed,
    pressure_between,
    sample_of,
    sampled,
    snapshot_run,
)
from sampling import samples
from synthetic_run import ROOT


def test_the_pressure_beside_a_moving_side_is_that_of_the_area_of_each_moment():
    """The pressure over the whole time is therefore the mean of the pressures of its parts."""
    samples, count = [], 200
    with Simulation(ROOT / "input/constant_pressure.nml") as run:
        for time in np.linspace(5, 20, 301):
            run.advance(time=time)
            seen = {name: float(np.sum(part)) for name, part in run._observed().items()}
            samples.append(sampled(count, seen | {"time": run.time}))
    parts = [np.array(samples[k : k + 101]).T for k in (0, 100, 200)]
    means = [pressure_between(part).mean for part in parts]
    assert pressure_between(np.array(samples).T).mean == pytest.approx(np.mean(means))


THEORIES = {  # systems in equilibrium, with the number of their theoretical values
    "a gas between walls": ("&species count = 200 radius = 0.01 speed = 1 /", 4),
    "a mixture between walls": (
        "&species name = 'a' count = 100 radius = 0.006 speed = 1 /\n"
        "&species name = 'b' count = 100 radius = 0.012 mass = 4 speed = 1 /",
        5,
    ),
    "one pair of walls": (
        "&box boundary = 'wall', 'periodic' /\n&species count = 200 radius = 0.015 speed = 1 /",
        4,
    ),
    "a flow in a periodic box": (
        "&box boundary = 2*'periodic' /\n"
        "&species name = 'a' count = 150 radius = 0.01 velocity = 3, 0 /\n"
        "&species name = 'b' count = 50 radius = 0.01 velocity = -1, 1 /",
        5,
    ),
    "thermal walls": (
        "&side name = 'left' temperature = 2 /\n&species count = 200 radius = 0.01 speed = 1 /",
        4,
    ),
    "a flow that thermal walls stop": (
        "&box boundary = 'periodic', 'wall' /\n&side name = 'top' temperature = 1 /\n"
        "&side name = 'bottom' temperature = 1 /\n"
        "&species name = 'a' count = 150 radius = 0.01 velocity = 3, 1 /\n"
        "&species name = 'b' count = 50 radius = 0.01 velocity = 1, -1 /",
        5,
    ),
    "perfectly rough disks": (
        "&contact tangential_restitution = 1 /\n&species count = 200 radius = 0.01 speed = 1 /",
        4,
    ),
    "gravity": ("&box gravity = 0, -1 /\n&species count = 200 radius = 0.01 speed = 1 /", 1),
    "grains": ("&contact restitution = 0.9 /\n&species count = 200 radius = 0.01 speed = 1 /", 0),
}


@pytest.mark.parametrize("case", THEORIES)
def test_theory_is_what_is_measured_in_equilibrium(case):
    """Where no theory applies, there are no theoretical values."""
    text, known = THEORIES[case]
    samples = []
    with Simulation(text) as simulation:
        run = snapshot_run(simulation)
        simulation.advance(collisions=30 * simulation.n_disks)
        for _ in range(400):
            simulation.advance_by(collisions=simulation.n_disks)
            value = observed(simulation)
            samples.append(sample_of(run, value))
        energy = value["all/kinetic_energy"] + value.get("all/rotational_energy", 0)
        found = means(run, samples, energy * simulation.n_disks)
    assert sum(one["theory"] is not None for one in found) == known
    assert all((one["value"] is None) == (case == "grains") for one in found[:-1])
    for one in found[:-1]:
        if one["theory"] is not None:
            error = one["error"]
            assert one["short"] == (error is None)
            allowed = 0.03 * one["value"] if error is None else 5 * error + 0.005 * one["value"]
            assert one["theory"] == pytest.approx(one["value"], abs=allowed), one


SHORT = {  # systems in which momentum, the energies of species, or all energy fluctuate slowly
    "a gas between walls": "&species count = 100 radius = 0.015 speed = 1 /",
    "a mixture between walls": "&species name = 'a' count = 60 radius = 0.01 speed = 1 /\n"
    "&species name = 'b' count = 40 radius = 0.02 mass = 4 speed = 1 /",
    "thermal walls": "&box boundary = 'wall', 'periodic' /\n&side name = 'left' temperature = 1 /\n"
    "&species count = 60 radius = 0.02 speed = 1 /",
}


@pytest.mark.parametrize("case", SHORT)
@samples(8, 60)
def test_errors_include_slow_fluctuations_or_the_run_is_too_short_for_them(case, samples):
    """Deviations from theory have about unit variance in units of the error, at all lengths.

    A sample is taken after 0.2 or 2 collisions per disk.
    """
    deviations, known = [], []
    for seed in range(samples):
        rows = []
        with Simulation(SHORT[case], {"run.seed": seed}) as simulation:
            run, every = snapshot_run(simulation), simulation.n_disks // (10, 1)[seed % 2]
            for _ in range(801):
                value = observed(simulation)
                rows.append(sample_of(run, value))
                simulation.advance_by(collisions=every)
                if len(rows) not in (41, 81, 161, 401, 801):
                    continue
                found = means(run, rows, value["all/kinetic_energy"] * simulation.n_disks)[:-2]
                exact = [one for one in found if one["error"] is not None]
                assert all(one["short"] == (one["error"] is None) for one in found)
                assert not exact or rows[-1][4] >= 30, "the speeds have hardly relaxed"
                deviations += [(one["value"] - one["theory"]) / one["error"] for one in exact]
            known.append(len(exact) / len(found))
    assert np.sqrt(np.mean(np.square(deviations))) < 1.8
    assert np.max(np.abs(deviations)) < 6
    assert any(known), "a long run is long enough"


SCANS = {  # for a gas: changes, measured quantity, values, and expected proportionality
    "gas, the energy of each disk": ({}, "all/kinetic_energy", ("1", "2"), (1, 4)),
    "gas, collisions per time": ({}, "collisions", ("1", "2"), (1, 2)),
    "gas, pressure": ({}, "virial_pressure", ("1", "2"), (1, 4)),
    "a gas that collapses": ({"contact.restitution": "0"}, "virial_pressure", ("1", "2"), ()),
    "a gas that cools, energy per time": (
        {"contact.restitution": "0.9"},
        "dissipated_energy",
        ("1", "2"),
        (1, 8),
    ),
}


@pytest.mark.parametrize("case", SCANS)
def test_a_scan_gives_means_and_rates_whatever_the_time_it_takes(address, case):
    """All rates in a run are proportional to its speeds; a busy machine ends no sample early."""
    settings, of, values, powers = SCANS[case]

    async def visit():
        async with film(address) as one:
            await one.start()
            wish = {"input": "gas", "settings": settings, "added": [], "of": of, "seconds": 600}
            await one.say("scan", **wish, variable="species.gas.speed", values=values)
            return [await one.until("scan") for _ in values]

    found = asyncio.run(visit())
    assert [one["index"] for one in found] == [0, 1]
    if not powers:
        assert all("at the same time" in one["problems"][0]["text"] for one in found), found
        return
    means = [one["mean"] / power for one, power in zip(found, powers, strict=True)]
    assert means[0] == pytest.approx(means[1], rel=1e-6) and means[0] > 0
    assert (found[0]["error"] is None) == bool(settings)
