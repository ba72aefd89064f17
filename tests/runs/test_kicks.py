"""Kicks: when they come, whom they reach, and what else must not come of them.

Bits, balances and momentum are asserted of all systems (test_random_systems.py), what baths, noise
and swimming disks do in the validation.
"""

import numpy as np
import pytest

from run_laws import laws_broken
from whole_runs import FINISHED, contents, write_input

#: One disk that meets nothing.
ONE = """&box boundary = 'periodic', 'periodic' upper = 50, 50 /
&species count = 1 radius = 0.1 mass = 2 temperature = 0.6 /
&output frames_every_time = {} /
"""


def observed(ricochet, folder, text: str, name: str = "gas"):
    """What the run of an input writes, and what it says."""
    write_input(folder, text)
    run = ricochet("gas.nml", "-o", f"{name}.h5")
    assert run.returncode == FINISHED, run.stderr
    return contents(folder / f"{name}.h5"), run.stdout


@pytest.mark.parametrize(
    ("every", "interval", "end", "steps", "kicked"),
    [
        (0.05, 0.1, 1, "", range(2, 21, 2)),
        (0.1, 0.25, 1.1, "&run dynamics = 'steps' dt = 0.1 /", [3, 5, 8, 10]),
    ],
    ids=["events", "steps"],
)
def test_kicks_are_at_multiples_of_the_interval_and_no_events(
    ricochet, tmp_path, every, interval, end, steps, kicked
):
    """The velocity changes at each kick, and only there; in time steps at the end of its step."""
    drive = f"&drive kind = 'brownian' interval = {interval} temperature = 1 / &stop time = {end} /"
    found, _ = observed(ricochet, tmp_path, ONE.format(every) + drive + steps)
    velocity = found["/particles/disks/velocity/value"][:, 0]
    changed = np.flatnonzero((velocity[1:] != velocity[:-1]).any(axis=1)) + 1
    assert changed.tolist() == list(kicked)
    assert found["/observables/collisions/value"][-1] == 0


def test_energy_balances_where_kinetic_and_potential_energy_cancel(ricochet, tmp_path):
    """The sum over many disks is far smaller than its terms, and as exact as if it were not."""
    found, _ = observed(
        ricochet,
        tmp_path,
        """&box lower = -0.5, 9.5 upper = 0.5, 10.5 gravity = 0, 0.1 /
        &species count = 5000 packing_fraction = 0.1 temperature = 1 /
        &drive kind = 'andersen' interval = 1e-5 fraction = 0.01 temperature = 1 /
        &stop time = 1e-4 / &output observables_every_time = 1e-5 /""",
    )
    names = ("total_energy", "drive_energy", "dissipated_energy")
    total, given, lost = (found[f"/observables/{name}/value"] for name in names)
    assert abs(total).max() < 500 and abs(given).max() > 1
    assert np.ptp(total + lost - given) <= 1e-16 * 10_000  # of both


def test_orientations_start_uniform_and_those_of_swimmers_diffuse(ricochet, tmp_path):
    found, _ = observed(
        ricochet,
        tmp_path,
        """&box boundary = 'periodic', 'periodic' /
        &species name = 'a' count = 3000 packing_fraction = 0.2 temperature = 1 /
        &species name = 'b' count = 2000 packing_fraction = 0.2 temperature = 1 mass = 2 /
        &drive kind = 'active' temperature = 0.5 speed = 3 rotational_diffusion = 20 species = 'a'
        interval = 0.0009765625 / &stop time = 0.009765625 /""",
    )
    angle = found["/particles/disks/orientation/value"]
    active, passive = angle[:, :3000], angle[:, 3000:]
    assert (passive == 0).all()
    assert abs(np.exp(1j * active[0]).mean()) < 4 / np.sqrt(3000)
    variance = 2 * 20 * 10 * 2**-10
    turned = (active[-1] - active[0]) ** 2
    assert turned.mean() == pytest.approx(variance, abs=4 * variance * np.sqrt(2 / 3000))


@pytest.mark.parametrize(("species", "mass2"), [("", 11000), ("species = 'b'", 8000)])
def test_noise_without_keep_momentum_moves_the_whole(ricochet, tmp_path, species, mass2):
    """By as much as independent kicks do, also for one species."""
    found, _ = observed(
        ricochet,
        tmp_path,
        f"""&box boundary = 'periodic', 'periodic' /
        &species name = 'a' count = 3000 packing_fraction = 0.2 temperature = 1 /
        &species name = 'b' count = 2000 packing_fraction = 0.2 temperature = 1 mass = 2 /
        &drive kind = 'noise' strength = 30 interval = 1e-3 {species} / &stop time = 0.01 /""",
    )
    momentum = found["/observables/momentum/value"]
    moved, free = abs(momentum[-1] - momentum[0]), np.sqrt(mass2 * 30 * 0.01)
    assert (moved < 5 * free).all() and moved.max() > 0.05 * free


def test_what_was_met_last_is_met_again_after_a_kick(ricochet, tmp_path):
    """Two disks side by side are kicked together again and again: no hit is taken for the last."""
    found, _ = observed(
        ricochet,
        tmp_path,
        "&species count = 2 radius = 0.1 position = 0.1, 0.5, 0.3, 0.5 /"
        "&box upper = 0.400001, 1 / &contact restitution = 0.99 contact_time = 1e-12 /"
        "&drive kind = 'brownian' interval = 1e-3 temperature = 1 / &stop time = 3 /"
        "&output frames_every_time = 1e-3 observables_every_time = 1e-3 /",
    )
    assert list(laws_broken(found)) == []


def test_the_kicks_of_a_disk_are_its_own(ricochet, tmp_path):
    """They do not depend on who else there is, nor on where a disk is in memory."""
    drive = "&drive kind = 'brownian' interval = 0.1 temperature = 1e-4 / &stop time = 1 /"
    disk = "&species count = 1 radius = 0.01 position = 0.9, 0.9 /"
    others = "&species grid = 20, 20 radius = 0.01 region = 0, 0.8, 0, 0.8 /"
    alone, among = (
        observed(ricochet, tmp_path, text, name)[0]["/particles/disks/velocity/value"][-1, 0]
        for name, text in (("alone", disk + drive), ("among", disk + others + drive))
    )
    assert alone.tolist() == among.tolist()


def test_a_gas_at_rest_waits_for_its_kick(ricochet, tmp_path):
    """Nothing can happen before it, and no rule names a time."""
    drive = "&drive kind = 'noise' interval = 7 strength = 1 / &stop collisions = 1000 /"
    _, said = observed(ricochet, tmp_path, "&species count = 100 radius = 0.01 /" + drive)
    assert "note" not in said and "kicks = 1\n" in said and "collisions = 1000\n" in said


def test_a_driven_gas_does_not_end_for_being_cold(ricochet, tmp_path):
    """Its temperature falls below 1e-25 of the first between two kicks."""
    _, said = observed(
        ricochet,
        tmp_path,
        "&box boundary = 'periodic', 'periodic' /"
        "&species count = 50 packing_fraction = 0.4 temperature = 1 /"
        "&contact restitution = 0.7 contact_time = 1e-9 / &stop time = 2e16 /"
        "&drive kind = 'noise' interval = 1e16 strength = 1e-60 /",
    )
    assert "note" not in said and "time = 2e16" in said
