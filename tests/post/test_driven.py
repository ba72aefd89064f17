"""Driven disks in time: the laws beside the curves, clusters, and which runs belong together."""

import driven
import numpy as np
import pytest

from ricochet import hard_disks, read_run, theory
from ricochet.structure import largest_cluster
from synthetic_run import ROOT, run_script, write_run
from whole_runs import FINISHED, write_input


@pytest.mark.parametrize("eta", [0.001, 0.2])
def test_at_the_temperature_of_noise_heating_is_what_collisions_take(eta):
    strength, xi, diameter, mass = 0.3, 0.8, 0.7, 2.0
    kt = hard_disks.noise_temperature(strength, xi, eta, diameter, mass)
    rate = hard_disks.collision_rate(hard_disks.henderson(eta), diameter, 1e6, kt, mass)
    assert mass * strength == pytest.approx((1 - xi**2) / 2 * rate * kt, rel=1e-5)


def test_chambers_are_even_above_the_threshold_and_as_the_fluxes_say_below():
    xi, layers = 0.9, 3.0

    def heat_over_climb(share, climb):
        """T / m g h of a chamber with this share of the disks."""
        return (2 / (share * layers * np.sqrt(np.pi) * (1 - xi**2))) ** 2 / climb

    threshold = heat_over_climb(0.5, 1.0)
    assert theory.demon_share(0.99 * threshold, layers, xi) == 0.5
    climb = 1.5 * threshold
    share = theory.demon_share(climb, layers, xi)
    flux = [s**2 * np.exp(-1 / heat_over_climb(s, climb)) for s in (share, 1 - share)]
    assert share > 0.6
    assert flux[0] == pytest.approx(flux[1])
    assert theory.demon_share(100 * threshold, layers, xi) == pytest.approx(1)
    assert theory.demon_share(1.001 * threshold, layers, xi) == pytest.approx(0.5, abs=0.05)


def test_a_cluster_hangs_together_across_a_periodic_side_and_not_across_a_wall(tmp_path):
    """Three disks in a row over the side; a large one that small ones at its rim belong to."""
    x = [(0.05, 0.5), (0.98, 0.5), (0.91, 0.5), (0.5, 0.5), (0.5, 0.77), (0.23, 0.5), (0.2, 0.1)]
    radius = np.array([0.035] * 3 + [0.2] + [0.06] * 2 + [0.035])
    for periodic, expected in ((True, 3), (False, 2)):
        path = write_run(
            tmp_path / f"{periodic}.h5", [x], [x], radius=radius, periodic=(periodic, False)
        )
        run = read_run(path)
        assert largest_cluster(run, 0, 0.005) == expected
        assert largest_cluster(run, 0, 0.012) == 3


def test_runs_are_told_apart_by_all_but_their_seed(ricochet, tmp_path):
    text = """&box boundary = 'wall', 'wall' gravity = 0, -1 /
&side name = 'bottom' motion = 'sawtooth' velocity = 0.1 /
&wall from = 0.5, 0 to = 0.5, 0.3 /
&species count = 9 radius = 0.02 temperature = 1 / &contact restitution = 0.9 wall_restitution = 1
wall_rule = 'normal' / &drive kind = 'noise' strength = 1 interval = 0.1 / &stop time = 1 /
"""
    write_input(tmp_path, text)
    changes = {
        **{"a": "run.seed=1", "b": "run.seed=2", "c": "side.bottom.velocity=0.2"},
        **{"d": "drive.strength=2", "e": "contact.restitution=0.8"},
    }
    for name, change in changes.items():
        run = ricochet("gas.nml", "-o", f"{name}.h5", "--set", change)
        assert run.returncode == FINISHED, run.stderr
    runs = [read_run(tmp_path / f"{name}.h5") for name in changes]
    groups = driven.by_input(runs)
    found = [[run.path.stem for run in group] for group in groups.values()]
    assert found == [["a", "b"], ["c"], ["d"], ["e"]]
    assert list(groups)[1] == "ξ = 0.9, bottom velocity = 0.2, drive strength = 1"
    expected = theory.demon_share(0.3 / 0.01, 9 * 0.04 / 0.46, 0.9)
    assert driven.demon_law(runs[0]) == pytest.approx(expected)
    assert driven.noise_law(runs[0]) is None, "walls take part"


def test_what_is_shown_is_one_of_a_few(tmp_path, capsys):
    path = write_run(tmp_path / "a.h5", np.zeros((3, 2, 2)), np.zeros((3, 2, 2)))
    assert run_script("driven", path, "--show", "shares", "-o", tmp_path / "a.png") == 2
    assert "did you mean share" in capsys.readouterr().err
    assert run_script("driven", path, "--show", "share", "-o", tmp_path / "a.png") == 0


def test_one_frame_is_too_few(ricochet, tmp_path, capsys):
    run = ricochet(ROOT / "input/heated.nml", "-o", "a.h5", "--set", "stop.time=0")
    assert run.returncode == 0, run.stderr
    assert run_script("driven", tmp_path / "a.h5") == 2
    assert "has one frame; it takes two" in capsys.readouterr().err
