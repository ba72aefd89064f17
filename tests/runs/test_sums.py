"""Sums over collisions agree with the event log for arbitrary masses."""

import random

import numpy as np
import pytest
from ricochet import read_run

from whole_runs import FINISHED, USAGE, contents, one_line, write_input

SIDES = ("left", "right", "bottom", "top")
HEAVY = """&box upper = 4, 2 /
&species name = 'rock' mass = {mass} radius = 0.2 position = 2, 1 velocity = {velocity} /
&species name = 'gas' count = 50 radius = 0.02 speed = 1 region = 0, 1.5, 0, 2 /
&stop collisions = 2000 / &output event_log = .true. virial_tensor = .true. /
"""


def masses(rng: random.Random) -> str:
    """Return a system with masses extending over up to 30 powers of ten."""
    mass = sorted(10 ** rng.uniform(-15, 15) for _ in range(rng.randint(1, 4)))
    words = []
    for k, m in enumerate(mass):
        moves = rng.choice(["speed = 1", f"temperature = {mass[0]}", "velocities = 'rest'"])
        moves = moves if k else "speed = 1"
        size = f"count = {rng.choice([1, 3, 20])} radius = {rng.choice([0.01, 0.03])!r}"
        words.append(f"&species name = 's{k}' mass = {m!r} {size} {moves} /")
    rng.shuffle(words)
    extra = rng.choice(
        [
            "&contact restitution = 0.9 /",
            "&obstacle name = 'peg' centre = 0.5, 0.5 radius = 0.1 /",
            f"&side name = 'left' temperature = {mass[0]!r} /",
            "&wall name = 'gate' from = 0.4, 0.2 to = 0.4, 0.9 /",
            "&contact tangential_restitution = 0.3 friction = 0.5 /",
        ]
    )
    end = "&stop events = 4000 / &output event_log = .true. virial_tensor = .true. /"
    return f"&run seed = {rng.randint(1, 999)} / {' '.join(words)} {extra} {end}"


def sums_and_logs(found: dict) -> dict:
    """Return the final sums in the file, and the corresponding sums over the event log, by name."""
    log = {name: found[f"/events/{name}"] for name in ("i", "j", "momentum_change")}
    radius = found["/particles/disks/radius"]
    change = log["momentum_change"].astype(np.longdouble)
    pairs = log["j"] > 0
    contact = (radius[log["i"][pairs] - 1] + radius[log["j"][pairs] - 1])[:, np.newaxis]
    last = {name: value[-1] for name, value in found.items() if name.endswith("/value")}
    result = {}
    if "tangential_restitution" not in found.get("text", ""):
        size = np.hypot(*change[pairs].T)[:, np.newaxis]
        result["virial"] = last["/observables/virial/value"], np.sum(size * contact)
        tensor = (size * contact * change[pairs] / size).T @ (change[pairs] / size)
        result["virial_tensor"] = last["/observables/virial_tensor/value"].reshape(2, 2), tensor
    places = [f"sides/{name}" for name in SIDES]
    places += [f"{kind}/{name}" for name in ("peg", "gate") for kind in ("walls", "obstacles")]
    codes = dict.fromkeys(places, -4) | {f"sides/{name}": -k for k, name in enumerate(SIDES)}
    for place in places:
        own = log["j"] == codes[place]
        if (name := f"/observables/{place}/impulse/value") in last and own.any():
            result[place] = last[name], -change[own].sum(axis=0)
    return result


def test_the_energy_balance_is_closed_for_different_masses(ricochet, tmp_path):
    """The energies dissipated in thousands of collisions of light disks are summed without bias."""
    (tmp_path / "gas.nml").write_text(
        """&species name = 'light' count = 7 mass = 0.01 radius = 0.067 speed = 1 /
        &species name = 'heavy' count = 1 mass = 100 radius = 0.073 velocities = 'rest' /
        &contact restitution = 0.97 / &stop events = 5000 /"""
    )
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    found = contents(tmp_path / "gas.h5")
    first, last = found["/observables/total_energy/value"][[0, -1]]
    lost = found["/observables/dissipated_energy/value"][-1]
    assert lost > 0.5 * first
    assert last + lost == pytest.approx(first, rel=1e-12, abs=0)


@pytest.mark.parametrize("seed", range(12))
def test_sums_agree_with_the_log_for_all_masses(ricochet, tmp_path, seed):
    text = masses(random.Random(seed))
    write_input(tmp_path, text)
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED, text
    compared = sums_and_logs(contents(tmp_path / "gas.h5") | {"text": text})
    for name, (summed, logged) in compared.items():
        assert np.abs(summed - logged).max() <= 1e-9 * np.abs(logged).max(), (name, text)
    assert any(name.startswith("sides/") for name in compared)


@pytest.mark.parametrize("mass", ["1e9", "1e20", "1e30", "1e-30"])
@pytest.mark.parametrize("velocity", ["0, 0", "0.3, -0.2"])
def test_a_disk_that_is_far_heavier_or_lighter_costs_no_digits(ricochet, tmp_path, mass, velocity):
    write_input(tmp_path, HEAVY.format(mass=mass, velocity=velocity))
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    for name, (summed, logged) in sums_and_logs(contents(tmp_path / "gas.h5")).items():
        assert np.abs(summed - logged).max() <= 1e-11 * np.abs(logged).max(), name
    run = read_run(tmp_path / "gas.h5")
    virial = run.observable("virial").value[-1]
    assert virial > 100 * min(1, float(mass))


def test_larger_ratios_of_masses_are_refused_by_name(ricochet, tmp_path):
    write_input(tmp_path, HEAVY.format(mass="1.1e30", velocity="0, 0"))
    run = ricochet("gas.nml", "-o", "gas.h5")
    assert run.returncode == USAGE and "species.mass" in one_line(run) and "1e30" in run.stderr
