"""Collisions that are elastic below an impact speed: no collapse, and laws of dissipation."""

import re

import numpy as np
import pytest

import ricochet
from ricochet import read_run
from synthetic_run import ROOT
from test_collapse import System
from whole_runs import FINISHED, write_input

LAW = "restitution_law = 'elastic_below' reference_speed ="
COMMAND = ["gas.nml", "-o", "gas.h5", "--quiet", "--force"]


@pytest.mark.parametrize("seed", range(24))
def test_no_row_of_disks_collapses_with_any_common_velocity(ricochet, tmp_path, seed):
    """The dissipated energy does not depend on a common velocity, except for rounding errors.

    With a constant restitution, 12 of the rows with these seeds collapse.
    """
    system, dissipated = System(seed), []
    for common in {system.common, 0.0}:
        system.common = common
        law = f"&contact {LAW} {float(1e-4 * np.abs(system.v).max())!r}"
        write_input(tmp_path, system.text().replace("&contact", law))
        run = ricochet(*COMMAND)
        assert run.returncode == FINISHED and "collapse" not in run.stdout + run.stderr
        dissipated.append(float(re.search(r"\ndissipated_energy = (\S+)", run.stdout)[1]))
    assert dissipated[0] == pytest.approx(dissipated[-1], rel=1e-3)


def test_pairs_above_the_speed_lose_energy_and_pairs_below_do_not(ricochet, tmp_path):
    """Pairs collide just below and just above the speed, some of them at a moving side."""
    for speed, left in ((0.999999, 1.0), (1.000001, 0.5)):
        text = f"""&contact restitution = 0.5 wall_rule = 'normal' {LAW} 1 / &stop events = 1 /
            &side name = 'right' motion = 'sawtooth' velocity = 0.25 /
            &species name = 'disks' radius = 0.1 position = """
        pair = f"0.3, 0.5, 0.7, 0.5 velocity = {0.5!r}, 0, {0.5 - speed!r}, 0 /"
        write_input(tmp_path, text + pair)
        assert ricochet(*COMMAND).returncode == FINISHED
        u, v = read_run(tmp_path / "gas.h5").velocity[-1][:, 0]
        assert v - u == pytest.approx(left * speed, rel=1e-12)
        one = f"0.5, 0.5 velocity = {speed - 0.25!r}, 0 /"  # relative to the strike of the side
        write_input(tmp_path, text + one)
        assert ricochet(*COMMAND).returncode == FINISHED
        (v,) = read_run(tmp_path / "gas.h5").velocity[-1][:, 0]
        assert -v == pytest.approx(left * speed + 0.25, rel=1e-12)


@pytest.mark.parametrize("speed", [0.03, 0.1])
def test_the_energy_of_a_line_of_5000_disks_decays_as_time_to_the_power_two_thirds(speed):
    """A gas of sticky particles on a ring has E ~ t^(-2/3), whatever the reference speed.

    Ben-Naim, Chen, Doolen and Redner, Physical Review Letters 83, 4069 (1999), use the same law of
    restitution: at late times, the gas of any restitution below 1 is that of Burgers' equation
    without viscosity. The test takes about 1 s for each speed.
    """
    disks, rng = 5000, np.random.default_rng(5)
    velocity = np.zeros((disks, 2))
    velocity[:, 0] = rng.uniform(-1, 1, disks)
    velocity[:, 0] -= velocity[:, 0].mean()
    place = np.full((disks, 2), 0.5)
    place[:, 0] = np.arange(disks) + rng.uniform(0.05, 0.95, disks)
    line = {
        "box": {"upper": [disks, 1], "boundary": ["periodic", "wall"]},
        "species": {"radius": 0.0001, "position": place, "velocity": velocity},
        "contact": {
            "restitution": 0.5,
            "restitution_law": "elastic_below",
            "reference_speed": speed,
        },
    }
    times = np.geomspace(10, 300, 13)
    with ricochet.Simulation(line) as gas:
        energies = [gas.advance(time=t).observable("all/kinetic_energy") for t in times]
        assert "collapsed" not in gas.nature
    slope, _ = np.polyfit(np.log(times), np.log(energies), 1)
    assert slope == pytest.approx(-2 / 3, abs=0.05)


def test_craters_without_contact_time_do_not_collapse(ricochet, tmp_path):
    """The energy and the number of moved grains agree with those of the TC model."""
    moved = []
    for law in ("contact_time=1e-5", "contact_time=0"):
        sets = [f"--set=contact.{law}", "--set=species.bed.count=500"]
        if law.endswith("=0"):
            sets += ["--set=contact.restitution_law=elastic_below"]
            sets += ["--set=contact.reference_speed=1e-3"]
        crater = ROOT / "input/crater.nml"
        counts = []
        for seed in (1, 2, 3, 4):
            name = f"{len(sets)}-{seed}.h5"
            run = ricochet(crater, "-o", name, "--quiet", *sets, f"--set=run.seed={seed}")
            assert run.returncode == FINISHED and "collapse" not in run.stdout + run.stderr
            result = read_run(tmp_path / name)
            counts.append(int((result.event_count[-1] > 0).sum()))
        moved.append(np.mean(counts))
    assert moved[1] == pytest.approx(moved[0], rel=0.05)
