"""How disks are arranged and how they move: made runs against closed formulas."""

import numpy as np
import pytest

import correlations
import snapshot
from ricochet import structure, transport
from ricochet import hard_disks as hd
from ricochet.drawing import values_of
from ricochet.structure import largest_cluster
from synthetic_run import run_script, written

PERIODIC = (True, True)


# --- structure ---


@pytest.mark.parametrize("periodic", [PERIODIC, (False, False), (True, False)])
def test_points_at_random_are_not_correlated(tmp_path, rng, periodic):
    x = rng.uniform(size=(60, 1000, 2))
    run = written(tmp_path / "run.h5", x, x, periodic=periodic)
    g = structure.pair_correlation(run, list(range(60)), np.linspace(1, 6, 6))
    np.testing.assert_allclose(g, 1, atol=0.05)


def test_the_structure_factor_of_points_at_random_is_1_of_a_lattice_n(tmp_path, rng, monkeypatch):
    x = rng.uniform(size=(60, 500, 2))
    gas = written(tmp_path / "gas.h5", x, x, periodic=PERIODIC)
    edges = np.array([0, 0.12, 0.3, 0.6, 1.0])  # 2 pi / L = 0.126 in diameters
    for terms in (structure.MOST_TERMS, 1e4):
        monkeypatch.setattr(structure, "MOST_TERMS", terms)
        found = structure.structure_factor(gas, list(range(60)), edges)
        assert np.isnan(found[0]), "no wave is longer than the box"
        np.testing.assert_allclose(found[2:], 1, atol=0.15)
    x, sides = triangular(12, 14)
    lattice = written(tmp_path / "c.h5", [x], [x], edges=sides, periodic=PERIODIC, radius=0.5)
    monkeypatch.undo()
    first = 4 * np.pi / np.sqrt(3)  # Bragg's peak, six wave vectors
    edges = first + np.array([-0.3, -0.01, 0.01])
    between, peak = structure.structure_factor(lattice, [0], edges)
    assert between == pytest.approx(0, abs=1e-9) and peak == pytest.approx(len(x))


def test_the_structure_of_one_run_knows_that_its_frames_remember(tmp_path, rng):
    """Of two places, each for half of the time: worth two frames, not as many as there are."""
    places = rng.uniform(size=(2, 200, 2))
    run = written(tmp_path / "run.h5", *[np.repeat(places, 16, axis=0)] * 2, periodic=PERIODIC)
    parts = [slice(0, 16), slice(16, 32), slice(0, 32)]
    one, other, both = (correlations.structure([run], [part])[1] for part in parts)
    for name in ("g", "S"):
        apart = np.abs(one[name].y - other[name].y)
        assert np.all(both[name].error >= 0.35 * apart), name


def triangular(columns, rows):
    """A perfect crystal in its periodic box."""
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    x = np.stack([i + 0.5 * (j % 2), j * np.sqrt(0.75)], axis=-1).reshape(-1, 2) + 0.2
    return x, (columns, rows * np.sqrt(0.75))


def test_a_crystal_is_in_order_and_points_at_random_are_not(tmp_path, rng):
    x, edges = triangular(12, 14)
    # Shaken a little: in a perfect one the triangulation of the copies is not unique.
    x = x + rng.normal(0, 1e-6, x.shape)
    frames = np.stack([x, x])
    crystal = written(tmp_path / "c.h5", frames, frames, edges=edges, periodic=PERIODIC)
    np.testing.assert_allclose(structure.bond_order(crystal, 0), 1, atol=1e-4)
    np.testing.assert_allclose(values_of(crystal, 0, "psi6"), 0, atol=0.01)
    psi = [structure.bond_order(crystal, k) for k in (0, 1)]
    g6 = structure.bond_correlation(crystal, [0, 1], psi, np.array([40, 80, 120, 300]))
    np.testing.assert_allclose(g6, 1, atol=1e-4)
    assert run_script("snapshot", crystal.path, "--colour", "psi6", "-o", tmp_path / "a.png") == 0
    for colour, ends in {"psi6": (-180, 180), "speed": (0, 7)}.items():
        shown = snapshot.scale(np.full(9, 7.0), False, colour)
        assert (shown.vmin, shown.vmax) == ends
    assert run_script("player", crystal.path, "--colour", "psi6", "-o", tmp_path / "a.html") == 2
    turned = {"edges": edges[::-1], "periodic": PERIODIC}
    turned = written(tmp_path / "t.h5", frames[..., ::-1], frames, **turned)
    np.testing.assert_allclose(structure.bond_order(turned, 0), -1, atol=1e-4)
    x = rng.uniform(size=(2, 2000, 2))
    gas = written(tmp_path / "g.h5", x, x, periodic=PERIODIC)
    psi = structure.bond_order(gas, 0)
    assert 0.3 < np.mean(np.abs(psi)) < 0.45 and abs(psi.mean()) < 0.1
    (far,) = structure.bond_correlation(gas, [0], [psi], np.array([5, 25]))
    assert abs(far) < 0.01


def test_a_cluster_hangs_together_across_a_periodic_side_and_not_across_a_wall(tmp_path):
    """Three disks in a row over the side; a large one that small ones at its rim belong to."""
    x = [(0.05, 0.5), (0.98, 0.5), (0.91, 0.5), (0.5, 0.5), (0.5, 0.77), (0.23, 0.5), (0.2, 0.1)]
    radius = np.array([0.035] * 3 + [0.2] + [0.06] * 2 + [0.035])
    for periodic, expected in ((True, 3), (False, 2)):
        sides = {"radius": radius, "periodic": (periodic, False)}
        run = written(tmp_path / "run.h5", [x], [x], **sides)
        assert largest_cluster(run, 0, 0.005) == expected
        assert largest_cluster(run, 0, 0.012) == 3


# --- motion ---


def flights(rng, count, time):
    """Positions and velocities (T, count, 2) of points that take a new velocity at the rate 1.

    Each component is normal with variance 1, so that <v(0) v(t)> / 2 = D'(t) = exp(-t).
    """
    x, v = np.empty((2, len(time), count, 2))
    for k in range(count):
        turns = np.cumsum(rng.exponential(size=int(time[-1] + 10 * np.sqrt(time[-1]) + 30)))
        turns = np.append(0, turns)
        speed = rng.normal(size=(len(turns), 2))
        place = np.cumsum(np.diff(turns, prepend=0)[:, None] * np.roll(speed, 1, axis=0), axis=0)
        last = np.searchsorted(turns, time, side="right") - 1
        v[:, k] = speed[last]
        x[:, k] = place[last] + (time - turns[last])[:, None] * speed[last]
    return x, v


@pytest.mark.parametrize(("step", "lag"), [(0.4, 8), (1.0, 4), (2.0, 2), (5.0, 2)])
def test_memory_and_diffusion_are_right_however_far_apart_frames_are(tmp_path, rng, step, lag):
    """In mean free times; the ways and slopes of each flight are exact."""
    count, time = 1000, step * np.arange(1200)
    x, v = flights(rng, count, time)
    image = np.floor(x).astype(int)
    sides = {"image": image, "time": time, "periodic": PERIODIC}
    run = written(tmp_path / "run.h5", x - image, v, **sides)
    early, late = np.exp(-step * np.array([lag // 2, lag]))
    expected = 1 - (early - late) / (step * (lag - lag // 2))
    for found in transport.diffusion(run, slice(None), lag):
        assert found.mean == pytest.approx(expected * (1 - 1 / count), abs=4 * found.error)
        assert found.error < 0.006
    at = np.array([1, 2, 4])
    in_time = transport.integrated_memory(run, slice(None), at)
    np.testing.assert_allclose(in_time, 1 - np.exp(-step * at), atol=0.015)
    memory = transport.velocity_memory(run, slice(1200), at)
    np.testing.assert_allclose(memory, np.exp(-step * at), atol=0.015)
    far = 4 * (step * at - 1 + np.exp(-step * at))
    np.testing.assert_allclose(transport.displacement(run, slice(1200), at), far, rtol=0.015)


# --- formulas ---


def test_enskog_is_boltzmann_in_a_dilute_gas():
    assert hd.speed_of_sound(1e-6) == pytest.approx(np.sqrt(2), rel=1e-4)
    eta = 1e-4
    viscosity = hd.enskog(1 + 2 * eta, eta, 0.01, kt=2.0, mass=3.0)["viscosity"]
    assert viscosity == pytest.approx(1.022 / 0.02 * np.sqrt(6 / np.pi), rel=1e-3)
    assert hd.long_time_tail(2.0, 5.0, 0.7, 0.3) == pytest.approx(1 / (80 * np.pi))
