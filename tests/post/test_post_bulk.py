"""Pressure, correlations and cooling in post/: closed formulas, and each figure drawn once."""

import re
import csv
import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import correlations
import equation_of_state
import haff
import melting
import rates
from ricochet import Events, diffusion, read_run, statistics, structure, thermodynamics
from ricochet import hard_disks as hd
from ricochet.drawing import plt, values_of
from synthetic_run import run_script, write_run
from validation.estimators import force, hit_rate
from validation.laws import cooling_ratio, luding, mixture_rates, mixture_z

BULK = Path(__file__).resolve().parents[2] / "input" / "bulk.nml"
PERIODIC = (True, True)


@pytest.fixture
def rng():
    return np.random.default_rng(8)


def written(path, position, velocity, **options):
    """A run read back."""
    return read_run(write_run(path, position, velocity, **options))


# --- formulas ---


def test_equation_of_state_has_the_virial_coefficients_and_goes_through_its_points():
    eta = 1e-4
    for law in (hd.henderson, luding):
        assert (law(eta) - 1) / eta == pytest.approx(2, rel=1e-3)
    reduced = [1, 1, 0.78200444, 0.53223180, 0.33355604, 0.1988425, 0.1148728, 0.0649930, 0.0362193]
    virial = [b * 2**k for k, b in enumerate(reduced)]
    for eta in (0.075, 0.125, 0.175):
        series = np.polyval(virial[::-1], eta)
        assert float(hd.simulated(eta)) == pytest.approx(series, rel=2e-5)
    np.testing.assert_allclose(hd.simulated(hd.FLUID[:, 0]), hd.FLUID[:, 1])
    np.testing.assert_allclose(hd.simulated(hd.FLUID[:, 0]), luding(hd.FLUID[:, 0]), rtol=2e-3)
    assert hd.crystal(0.8) - hd.crystal(0.8, 100) == pytest.approx((hd.crystal(0.8) - 1) / 100)
    assert np.isnan(hd.simulated(0.7)) and hd.simulated_finite(0.1, 100) < hd.simulated(0.1)


def test_rates_of_a_mixture_of_equals_are_those_of_one_gas():
    diameter, count = 0.02, 1000
    eta = count * np.pi * diameter**2 / 4
    w = mixture_rates([diameter, diameter], [300, 700], [1.0, 1.0])
    one = hd.collision_rate(hd.simulated(eta), diameter, 10**8)
    np.testing.assert_allclose(w.sum(axis=1), one, rtol=1e-6)
    np.testing.assert_allclose(w[:, 1] / w[:, 0], 7 / 3)
    unequal = mixture_rates([0.02, 0.04], [300, 200], [1.0, 4.0])
    assert 300 * unequal[0, 1] == pytest.approx(200 * unequal[1, 0])
    assert mixture_z([diameter, diameter], [300, 700]) == pytest.approx(hd.simulated(eta))


def test_laws_of_cooling_agree_at_first_and_equal_masses_cool_alike():
    assert hd.haff_by_time(0.01, 0.9) == pytest.approx(hd.haff_by_collisions(0.01, 0.9), rel=1e-4)
    assert hd.haff_by_time(5.0, 1.0) == hd.haff_by_collisions(5.0, 1.0) == 1
    assert cooling_ratio(1, 0.7) == pytest.approx(1) == cooling_ratio(4, 1.0)
    assert cooling_ratio(4, 0.8) > cooling_ratio(4, 0.9) > 1
    assert cooling_ratio(0.25, 0.8) == pytest.approx(1 / cooling_ratio(4, 0.8))


# --- pressure ---


def steady(path, periodic, speed=1.0, radius=0.01, **parameters):
    """100 disks with kT = 2 speed^2; all sums grow linearly in time."""
    time = np.arange(201.0)
    v = speed * np.tile([[2.0, 0.0], [-2.0, 0.0]], (1, 50, 1)).repeat(2, axis=0)
    x = np.full_like(v, 0.5)
    observables = {
        "collisions": (500 * time).astype(int),
        "virial": 300 * speed**2 * time,
        "wall_collisions": np.outer(time, (3, 3, 4, 4)).astype(int),
        "wall_impulse": speed**2 * np.outer(time, (400.0, 400.0, 500.0, 500.0)),
    }
    return written(
        path,
        x,
        v,
        time=[0, 200],
        radius=radius,
        periodic=periodic,
        observables=observables,
        observable_time=time,
        parameters=parameters or None,
    )


def test_three_pressures_of_a_steady_run(tmp_path):
    walled = steady(tmp_path / "walls.h5", (False, False))
    assert thermodynamics.temperature(walled) == 2
    z = thermodynamics.z_virial(walled)
    assert z.mean == pytest.approx(1 + 300 / 400) and z.error == pytest.approx(0, abs=1e-12)
    assert thermodynamics.z_wall(walled).mean == pytest.approx(900 * 0.98 / 400)
    assert thermodynamics.collision_rate(walled).mean == pytest.approx(10)
    assert hit_rate(walled).mean == pytest.approx(14)
    assert force(walled).mean == pytest.approx(450)
    unit = hd.collision_rate(2.0, 0.02, 100, 2.0)
    assert thermodynamics.z_rate(walled).mean == pytest.approx(1 + 10 / unit)
    bulk = steady(tmp_path / "bulk.h5", PERIODIC)
    assert thermodynamics.temperature(bulk) == pytest.approx(200 / 99)
    assert thermodynamics.z_virial(bulk).mean == pytest.approx(1 + 300 / (2 * 100 * 200 / 99))
    assert set(equation_of_state.pressures(bulk)) == {"virial", "rate"}


@pytest.mark.parametrize("periodic", [(False, False), (True, False), PERIODIC])
def test_kt_is_of_the_momenta_that_are_free(tmp_path, rng, periodic):
    """A few disks share what the conserved motion of them all does not have."""
    kept, mass, heat = np.array(periodic), np.array([9.0, 1.0, 1.0, 1.0]), 3.0
    v = rng.normal(size=(20000, 4, 2)) / np.sqrt(mass)[:, None]
    v -= kept * np.average(v, axis=1, weights=mass, keepdims=True)
    v *= np.sqrt(heat / np.sum(0.5 * mass[:, None] * v**2, axis=(1, 2)))[:, None, None]
    v += kept * np.array([0.2, -0.1])
    parts = {"species": [1, 2, 2, 2], "names": ("big", "small"), "mass": mass}
    run = written(tmp_path / "run.h5", 0 * v, v, periodic=periodic, **parts)
    assert thermodynamics.temperature(run) == pytest.approx(heat / (4 - kept.sum() / 2))
    for kind in run.by_species:
        energy = run.kinetic_energy(slice(None))[:, kind.disks].mean()
        assert thermodynamics.mean_energy(run, kind.mass) == pytest.approx(energy, rel=0.02)
    inside = {"obstacles": [((0.5, 0.5), 0.1, 0)], "periodic": periodic}
    stopped = written(tmp_path / "stopped.h5", 0 * v[:1], v[:1], mass=mass, **inside)
    expected = stopped.kinetic_energy(0).mean()
    assert thermodynamics.temperature(stopped) == pytest.approx(expected), "an obstacle takes all"


def test_pressures_in_time_are_those_at_the_mean_temperature(tmp_path):
    runs = [steady(tmp_path / f"{k}.h5", (False, False), speed=k) for k in (1, 2)]  # kT = 2, 8
    found = rates.pressures_in_time(runs, np.linspace(0, 200, 5))
    np.testing.assert_allclose(found["virial"], (2 * 100 + 300 / 2) * 5 / 2)
    np.testing.assert_allclose(found["sides"], 450 * 5 / 2)


def remembering(rng, length: int, memory: float) -> np.ndarray:
    """A series (T,) of mean 0 and variance 1 whose correlation falls by 1/e in `memory` samples."""
    keep = np.exp(-1 / memory)
    return lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.normal(size=length + 2000))[2000:]


def test_the_error_of_a_series_without_memory_is_that_of_its_scatter(rng):
    amount = rng.poisson(1000, 20000).astype(float)
    found = statistics.series_mean(amount, np.full(20000, 2.0))
    assert found.mean == pytest.approx(500, rel=0.01)
    assert found.error == pytest.approx(np.sqrt(1000) / 2 / np.sqrt(20000), rel=0.4)


@pytest.mark.parametrize("memory", [0.5, 5, 20])
def test_68_of_100_intervals_hold_the_mean_of_a_series_that_remembers(rng, memory):
    means = [
        statistics.series_mean(remembering(rng, 2000, memory) + 3 * rng.normal(size=2000))
        for _ in range(400)
    ]
    hit = np.mean([abs(one.mean) < one.error for one in means])
    assert 0.60 <= hit <= 0.76
    exact = np.sqrt((1 / np.tanh(0.5 / memory) + 9) / 2000)
    assert np.mean([one.error for one in means]) == pytest.approx(1.1 * exact, rel=0.12)


def test_equilibrium_begins_where_a_drift_has_died_out(rng):
    decay = 20 * np.exp(-np.arange(4000) / 200)
    starts = [statistics.equilibration(remembering(rng, 4000, 3) + decay) for _ in range(40)]
    assert np.quantile(starts, 0.1) > 3 * 200 and np.quantile(starts, 0.9) < 2000
    calm = [statistics.equilibration(remembering(rng, 4000, 3)) for _ in range(40)]
    assert np.median(calm) < 400


def test_what_speaks_against_an_error_is_said(rng):
    calm = [statistics.series_mean(rng.normal(size=640)) for _ in range(10)]
    assert statistics.doubts("Z", calm) == []
    slope = np.linspace(0, 0.5, 640)  # hardly seen in one run, but they all agree
    drifting = [statistics.series_mean(rng.normal(size=640) + slope) for _ in range(10)]
    assert "Z: still drifts" in statistics.doubts("Z", drifting)[0]
    apart = [one._replace(mean=one.mean + k) for k, one in enumerate(calm)]
    assert "runs scatter by 3" in statistics.doubts("Z", apart)[0]
    assert statistics.combined(apart).error == pytest.approx(1, rel=0.1)
    assert statistics.combined(apart).samples == 10, "a run is a sample"
    short = statistics.series_mean(rng.normal(size=5))
    assert "no error" in statistics.doubts("Z", [short])[0]
    slow = statistics.series_mean(remembering(rng, 640, 100))
    assert "independent samples; run longer" in " ".join(statistics.doubts("Z", [slow]))


@pytest.mark.parametrize(
    ("script", "system"),
    [
        *((name, "walls") for name in ("rates", "equation_of_state")),
        *((name, "obstacle") for name in ("melting", "coverage")),
    ],
)
def test_a_gas_that_walls_cool_has_no_equilibrium(ricochet, tmp_path, capsys, script, system):
    """Its disks are elastic; the walls, or an obstacle in a periodic box, take energy."""
    sides = {"walls": "wall", "obstacle": "periodic"}[system]
    (tmp_path / "gas.nml").write_text(
        f"""&box boundary = '{sides}', '{sides}' /
        &species count = 64 radius = 0.02 temperature = 1 /
        &contact restitution = 1 wall_restitution = 0.9 /
        &stop collisions_per_disk = 40 /
        &output frames_every_time = 0.05 observables_every_time = 0.05 /"""
        + (system == "obstacle") * "&obstacle centre = 0.5, 0.5 radius = 0.1 /"
    )
    runs = [tmp_path / f"{seed}.h5" for seed in range(1, 11 if script == "coverage" else 2)]
    for seed, path in enumerate(runs):
        assert ricochet("gas.nml", "--set", f"run.seed={seed}", "-o", path).returncode == 0
    assert run_script(script, *runs, "-o", tmp_path / "no.png") == 2
    said = capsys.readouterr().err
    assert "1.h5: is not elastic: it loses energy in collisions" in said and said.count("\n") == 1


# --- rates and free paths ---


def test_free_paths_weigh_each_flight_once_however_often_frames_meet_it(tmp_path):
    """A disk that flies 1, 1, 4, 1, 1, 4, ... time units between hits; another one without hits."""
    hits = np.cumsum(np.tile([1.0, 1.0, 4.0], 40))
    time = np.linspace(0.05, hits[-1] - 0.05, 2400)
    v = np.tile([[0.5, 0.0], [1.0, 0.0]], (len(time), 1, 1))
    run = written(
        tmp_path / "run.h5", np.full_like(v, 0.5), v, time=time,
        observables={"collisions": np.zeros(len(time), int)},
    )  # fmt: skip
    zero = np.zeros(len(hits), int)
    run.__dict__["events"] = Events(hits, zero + 1, zero, zero + 1.0)
    path, weight = rates.free_paths(run, skip=0)
    assert set(np.round(path, 9)) == {0.5, 2.0}
    assert np.sum(weight[path > 1]) / np.sum(weight) == pytest.approx(1 / 3, rel=0.02)


def test_free_paths_without_memory_have_the_mean_one():
    x = np.linspace(0, 40, 20001)
    density = rates.path_density(x)
    assert np.trapezoid(density, x) == pytest.approx(1, rel=1e-3)
    assert np.trapezoid(x * density, x) == pytest.approx(1, rel=1e-3)


# --- correlations ---


def test_velocities_that_turn_are_remembered_as_a_cosine(tmp_path):
    time = np.arange(101) * 0.1
    v = np.stack([np.cos(time), np.sin(time)], axis=1)[:, None].repeat(3, axis=1)
    run = written(tmp_path / "run.h5", 0 * v, v, time=time)
    at = correlations.lags(100)
    assert at[0] == 1 and at[-1] == 50 and np.all(np.diff(at) > 0)
    memory = diffusion.velocity_memory(run, slice(101), at)
    np.testing.assert_allclose(memory, np.cos(0.1 * at), atol=1e-12)


def test_disks_that_fly_apart_spread_as_the_square_of_time(tmp_path):
    time = np.arange(51) * 0.1
    v = np.array([[1.0, 0.0], [-1.0, 0.0]])[None].repeat(51, axis=0)
    flight = 0.5 + v * time[:, None, None]
    image = np.floor(flight).astype(int)
    run = written(tmp_path / "run.h5", flight - image, v, image=image, time=time, periodic=PERIODIC)
    at = np.array([1, 5, 20])
    np.testing.assert_allclose(diffusion.displacement(run, slice(51), at), (0.1 * at) ** 2)


def test_the_diffusion_coefficient_is_that_of_a_langevin_walk(tmp_path, rng):
    """Velocities that forget in the time 1: between t/2 and t the mean of D(t) = 1 - exp(-t)."""
    step, size, frames = 0.1, 100, 4000
    v = np.array([remembering(rng, frames, 1 / step) for _ in range(2 * size)])
    v = (v - v.reshape(size, 2, -1).mean(axis=0).repeat(size, 0).reshape(v.shape)).T
    v = v.reshape(frames, size, 2)
    x = step * (np.cumsum(v, axis=0) - v / 2)
    image = np.floor(x).astype(int)
    sides = {"image": image, "time": step * np.arange(frames), "periodic": PERIODIC}
    run = written(tmp_path / "run.h5", x - image, v, **sides)
    spread, memory = diffusion.diffusion(run, slice(frames), 60)
    expected = 1 - (np.exp(-3) - np.exp(-6)) / 3
    for found in (spread, memory):
        assert found.mean == pytest.approx(expected, abs=4 * found.error)
        assert 0.003 < found.error < 0.05
    assert spread.mean == pytest.approx(memory.mean, abs=2 * spread.error)


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
def test_diffusion_is_right_however_far_apart_frames_are(tmp_path, rng, step, lag):
    """In mean free times; the ways and slopes of each flight are exact."""
    count, time = 1000, step * np.arange(1200)
    x, v = flights(rng, count, time)
    image = np.floor(x).astype(int)
    sides = {"image": image, "time": time, "periodic": PERIODIC}
    run = written(tmp_path / "run.h5", x - image, v, **sides)
    early, late = np.exp(-step * np.array([lag // 2, lag]))
    expected = 1 - (early - late) / (step * (lag - lag // 2))
    for found in diffusion.diffusion(run, slice(None), lag):
        assert found.mean == pytest.approx(expected * (1 - 1 / count), abs=4 * found.error)
        assert found.error < 0.006
    at = np.array([1, 2, 4])
    in_time = diffusion.integrated_memory(run, slice(None), at)
    np.testing.assert_allclose(in_time, 1 - np.exp(-step * at), atol=0.015)


def test_enskog_is_boltzmann_in_a_dilute_gas():
    assert hd.speed_of_sound(1e-6) == pytest.approx(np.sqrt(2), rel=1e-4)
    eta = 1e-4
    viscosity = hd.enskog_viscosity(1 + 2 * eta, eta, 0.01, kt=2.0, mass=3.0)
    density = 3.0 * 4 * eta / (np.pi * 1e-4)
    assert viscosity * density == pytest.approx(1.022 / 0.02 * np.sqrt(6 / np.pi), rel=1e-3)
    assert hd.long_time_tail(2.0, 5.0, 0.7, 0.3) == pytest.approx(1 / (80 * np.pi))


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
    psi = [structure.bond_order(crystal, k) for k in (0, 1)]
    g6 = structure.bond_correlation(crystal, [0, 1], psi, np.array([40, 80, 120, 300]))
    np.testing.assert_allclose(g6, 1, atol=1e-4)
    turned = written(
        tmp_path / "t.h5", frames[..., ::-1], frames, edges=edges[::-1], periodic=PERIODIC
    )
    np.testing.assert_allclose(structure.bond_order(turned, 0), -1, atol=1e-4)
    x = rng.uniform(size=(2, 2000, 2))
    gas = written(tmp_path / "g.h5", x, x, periodic=PERIODIC)
    psi = structure.bond_order(gas, 0)
    assert 0.3 < np.mean(np.abs(psi)) < 0.45 and abs(psi.mean()) < 0.1
    (far,) = structure.bond_correlation(gas, [0], [psi], np.array([5, 25]))
    assert abs(far) < 0.01


# --- the scripts, on runs of the program ---

RUNS = (
    ("species.disks.packing_fraction=0.05",),
    ("species.disks.packing_fraction=0.3",),
    ("species.disks.packing_fraction=0.02", "contact.restitution=0.9"),
)


@pytest.fixture
def bulk(ricochet, tmp_path):
    """Small gases at two packing fractions, and one that cools."""
    settings = ["species.disks.count=100", "stop.collisions_per_disk=60"]
    settings += ["output.frames_every_time=0.02", "output.observables_every_collisions=25"]
    settings += ["output.event_log=true"]
    paths = [tmp_path / f"{k}.h5" for k in range(len(RUNS))]
    for path, more in zip(paths, RUNS, strict=True):
        options = [word for value in (*settings, *more) for word in ("--set", value)]
        done = ricochet(BULK, *options, "--quiet", "-o", path)
        assert done.returncode == 0, done.stderr
    return paths


def test_diffusion_of_a_gas_is_found_twice_and_near_that_of_enskog(bulk, tmp_path):
    table = tmp_path / "a.csv"
    assert run_script("correlations", bulk[0], "-o", tmp_path / "a.png", "--csv", table) == 0
    rows = {row["what"]: row for row in csv.DictReader(table.open())}
    both = [rows[f"D_{way}"] for way in ("displacement", "velocities")]
    one, other = (float(row["y"]) for row in both)
    error = float(both[0]["error"])
    run = read_run(bulk[0])
    assert 0 < error < 0.3 * one and one == pytest.approx(other, abs=error)
    assert one == pytest.approx(correlations.enskog(run)[0], abs=4 * error + 0.1 * one)
    assert {"vacf", "msd", "g", "S", "g6", "psi6_local", "psi6_global"} <= set(rows)


def test_a_gas_that_cools_has_a_structure_and_no_diffusion(bulk, tmp_path, capsys):
    table = tmp_path / "a.csv"
    assert run_script("correlations", bulk[2], "-o", tmp_path / "a.png", "--csv", table) == 0
    assert "loses energy, no equilibrium: no memory" in capsys.readouterr().err
    rows = list(csv.DictReader(table.open()))
    assert {row["what"] for row in rows} == {"psi6_local", "psi6_global", "a2", "g", "g6", "S"}
    run, edges = read_run(bulk[2]), correlations.bins(read_run(bulk[2]))["g"]
    late = correlations.some(correlations.later(run, None, cool=True))
    assert run.collisions_per_disk_at(run.time[late[0]]) > 14
    g = structure.pair_correlation(run, late, edges)
    found = np.array([[float(row[name]) for name in ("y", "error")] for row in rows
                      if row["what"] == "g"])  # fmt: skip
    assert np.all(found[:, 1] > 0) and np.mean(np.abs(found[:, 0] - g) < found[:, 1]) > 0.9


def test_curves_of_several_runs_have_the_error_of_their_scatter(bulk):
    run = read_run(bulk[0])
    twice = correlations.analysed([run, run], None, cool=False)
    for name in ("vacf", "msd", "a2", "g", "S", "D_velocities(t)", "D_displacement(t)"):
        assert np.all(twice.curves[name].error == 0), name
    assert np.isnan(correlations.analysed([run], None, cool=False).curves["vacf"].error).all()


def test_what_is_no_gas_in_equilibrium_has_no_correlations(bulk, tmp_path, capsys):
    falling = {"box": {"gravity": [0.0, -1.0]}}
    x = np.full((20, 4, 2), 0.5)
    fall = write_run(tmp_path / "fall.h5", x, x, parameters=falling)
    radius = {"radius": [0.01, 0.01, 0.02, 0.02], "species": [1, 1, 2, 2], "names": ("a", "b")}
    mixed = write_run(tmp_path / "mixed.h5", x, x, **radius)
    for script, cool, words in (
        ("correlations", [bulk[0], bulk[2]], ("draw them", "without gravity", "not equal disks")),
        ("equation_of_state", [bulk[2]], ("not elastic", "falls", "not of one radius")),
    ):
        for runs, word in zip((cool, [fall], [bulk[0], mixed]), words, strict=True):
            assert run_script(script, *runs, "-o", tmp_path / "no.png") == 2
            said = capsys.readouterr().err
            assert said.startswith(f"{script}.py: {runs[-1]}: ") and said.count("\n") == 1
            assert word in said


def test_mixtures_are_not_drawn_on_the_curves_of_equal_disks(tmp_path):
    radius = np.repeat([0.01, 0.02], 50)
    mixed = steady(tmp_path / "mixed.h5", PERIODIC, radius=radius)
    rows, _ = equation_of_state.table([(0.5, [mixed])], None)
    assert rows[0]["Z_reference"] is None
    figure = equation_of_state.draw(rows, [mixed])
    assert [line.get_label() for line in figure.axes[0].lines if "19" in line.get_label()] == []
    equal = steady(tmp_path / "equal.h5", PERIODIC)
    rows, _ = equation_of_state.table([(0.5, [equal])], None)
    assert rows[0]["Z_reference"] > 1
    assert len(equation_of_state.draw(rows, [equal]).axes[0].lines) > 3


def test_melting_has_a_curve_for_each_number_of_disks(tmp_path, capsys):
    """The pressure of 4 eta / pi Z; between walls, of mixtures, there is none."""
    run = steady(tmp_path / "equal.h5", PERIODIC)
    eta = thermodynamics.packing(run)
    (row,), _ = melting.table([((100, eta), [run])], None)
    area, kt = 1.0, thermodynamics.temperature(run)
    expected = (100 * kt + 300 / 2) / area * 0.02**2 / kt
    assert row["P"] == pytest.approx(expected, rel=1e-9)
    axes = melting.draw([row, {**row, "N": 400}], [run]).axes[0]
    assert {"N = 100", "N = 400"} < set(axes.get_legend_handles_labels()[1])
    falling = {"box": {"gravity": [0.0, -1.0]}}
    for kind, more in (("walls", {"periodic": (True, False)}), ("mixed", {}), ("falling", falling)):
        radius = np.repeat([0.01, 0.02], 50) if kind == "mixed" else 0.01
        other = steady(tmp_path / f"{kind}.h5", radius=radius, **{"periodic": PERIODIC, **more})
        assert run_script("melting", other.path, "-o", tmp_path / "no.png") == 2
        assert "needs equal disks in a periodic box without gravity" in capsys.readouterr().err


def test_published_pressures_near_melting_have_a_loop_that_flattens():
    depth = {}
    for name, points in hd.MELTING.items():
        eta, p = np.transpose(points)
        assert np.all(np.diff(eta) > 0) and p.min() > 9.15 and p.max() < 9.25
        depth[name] = p[:-1].max() - p[(eta > 0.702) & (eta < 0.718)].min()
    assert list(depth.values()) == sorted(depth.values(), reverse=True)


def test_disks_are_coloured_by_the_direction_of_their_bonds(tmp_path, rng):
    x, edges = triangular(12, 14)
    x = x + rng.normal(0, 1e-6, x.shape)
    run = written(tmp_path / "c.h5", [x], [x], edges=edges, periodic=PERIODIC)
    np.testing.assert_allclose(values_of(run, 0, "psi6"), 0, atol=0.01)
    assert run_script("snapshot", run.path, "--colour", "psi6", "-o", tmp_path / "a.png") == 0
    assert run_script("player", run.path, "--colour", "psi6", "-o", tmp_path / "a.html") == 2


def test_scripts_draw(bulk, tmp_path):
    scripts = {"equation_of_state": bulk[:2], "correlations": bulk[:2], "haff": bulk[2:]}
    scripts["rates"] = bulk[:1]
    for script, runs in scripts.items():
        figure, table = tmp_path / f"{script}.png", tmp_path / f"{script}.csv"
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert run_script(script, *runs, "-o", figure, "--csv", table) == 0
        assert figure.stat().st_size > 10000
        assert len(table.read_text().splitlines()) > 2
    assert run_script("equation_of_state", *bulk[2:], "-o", tmp_path / "no.png") == 2


def test_a_gas_that_cools_has_free_paths_and_no_pressure(bulk, tmp_path, capsys):
    table = tmp_path / "a.csv"
    assert run_script("rates", bulk[2], "-o", tmp_path / "a.png", "--csv", table) == 0
    assert "loses energy, no equilibrium" in capsys.readouterr().err
    rows = {row["quantity"]: row["mean"] for row in csv.DictReader(table.open())}
    assert not any(name.startswith("pressure") for name in rows)
    run = read_run(bulk[2])  # a path does not know how fast it is flown: Enskog's length
    eta, diameter = thermodynamics.packing(run), 2 * run.radius[0]
    density = (run.count - 1) / np.prod(run.edges)
    contact = (hd.simulated(eta) - 1) / (2 * eta)
    enskog = 1 / (2 * np.sqrt(2) * density * diameter * contact)
    assert float(rows["mean_free_path"]) == pytest.approx(enskog, rel=0.1)


def test_free_paths_scatter_as_their_errors_say(monkeypatch, rng):
    """Of runs, and of one run in blocks: paths without memory, 4000 to a run."""

    def free_paths(run, skip):
        return rng.exponential(2.0, 4000), np.ones(4000)

    monkeypatch.setattr(rates, "free_paths", free_paths)
    monkeypatch.setattr(rates, "has_log", lambda run: True)
    for runs, samples in ((1, 4000), (50, 200000)):
        mean, density = rates.histogram([None] * runs)
        assert abs(mean.mean - 2) < 4 * mean.error
        assert mean.error == pytest.approx(2 / np.sqrt(samples), rel=0.9 if runs == 1 else 0.4)
        law = np.exp(-rates.BINS)
        off = (density.mean + np.diff(law) / np.diff(rates.BINS))[:16] / density.error[:16]
        assert np.mean(np.abs(off) < 3) > 0.8


def test_the_table_of_rates_has_the_points_of_the_figure(bulk, tmp_path):
    table = tmp_path / "a.csv"
    assert run_script("rates", bulk[0], "-o", tmp_path / "a.png", "--csv", table) == 0
    points = [row for row in csv.DictReader(table.open()) if row["x"]]
    names = [row["quantity"] for row in points]
    assert names.count("free_path_density") == len(rates.BINS) - 1
    assert names.count("pressure_virial(t)") > 10
    paths = [row for row in points if row["quantity"] == "free_path_density"]
    assert all(float(row["error"]) > 0 for row in paths[:16])


def test_rates_of_a_gas_agree_with_each_other(bulk):
    run = read_run(bulk[0])
    found = rates.quantities(run)
    per_disk, pairs = found["collisions_per_disk_and_time"], found["w_disks_disks"]
    assert pairs.mean == pytest.approx(per_disk.mean, rel=0.02)
    assert pairs.mean == pytest.approx(run.collisions_per_disk.value[-1] / run.time[-1], rel=0.1)
    (mean, error), (density, _) = rates.histogram([run])
    assert 0 < error < 0.03 * mean
    speed = np.mean(run.speed(slice(None)))
    assert mean == pytest.approx(speed / per_disk.mean, rel=0.03)
    assert np.sum(density * np.diff(rates.BINS)) == pytest.approx(1, abs=0.02)


def test_the_legend_of_the_pressure_hides_nothing_that_it_names(bulk):
    run = read_run(bulk[0])
    figure, axes = plt.subplots()
    mean = rates.quantities(run)["pressure_virial"]
    rates.draw_pressure(axes, [run], {"pressure_virial": mean}, 0.1 * run.time[-1])
    figure.draw_without_rendering()
    legend = axes.get_legend().get_window_extent().transformed(axes.transData.inverted())
    assert legend.x0 > 0.1 * run.time[-1]
    assert all(np.max(line.get_ydata()) < legend.y0 for line in axes.lines)


def test_a_gas_cools_by_haff(bulk):
    found = haff.cooled([haff.energy_left(read_run(bulk[2]))], 0.9)
    for x, y, law in (
        (found.time, found.by_time.mean, hd.haff_by_time),
        (found.tau, found.by_collisions.mean, hd.haff_by_collisions),
    ):
        early = law(x, 0.9) > 0.1
        np.testing.assert_allclose(y[early], law(x, 0.9)[early], rtol=0.2)


def test_the_first_rate_is_counted_where_no_equation_of_state_is_known(bulk, ricochet, tmp_path):
    """Of equal disks both ways agree; a gas of two sizes cools by the same laws."""
    run = read_run(bulk[2])
    assert haff.counted_rate(run) == pytest.approx(haff.first_rate(run), rel=0.1)
    (tmp_path / "gas.nml").write_text(
        """&box boundary = 'periodic', 'periodic' / &contact restitution = 0.9 /
        &species name = 'small' count = 400 radius = 0.005 temperature = 1 /
        &species name = 'large' count = 400 radius = 0.008 temperature = 1 /
        &stop collisions_per_disk = 15 /
        &output observables_every_collisions_per_disk = 0.1 /""",
    )
    assert ricochet("gas.nml", "-o", tmp_path / "two.h5", "--quiet").returncode == 0
    two = read_run(tmp_path / "two.h5")
    w0_t, tau, left = haff.energy_left(two)
    np.testing.assert_allclose(left, hd.haff_by_collisions(tau, 0.9), rtol=0.1)
    np.testing.assert_allclose(left, hd.haff_by_time(w0_t, 0.9), rtol=0.15)
    assert run_script("haff", two.path, "-o", tmp_path / "two.png") == 0


@pytest.mark.parametrize(("restitution", "how"), [(1, ", written by frames_every_time"), (0.9, "")])
def test_a_gas_that_cools_may_take_its_frames_by_collisions(
    ricochet, tmp_path, capsys, restitution, how
):
    """Nothing of it is drawn against time: the advice is more frames, not even ones."""
    few = ["species.disks.count=100", "stop.collisions_per_disk=2"]
    few.append(f"contact.restitution={restitution}")
    options = [word for value in few for word in ("--set", value)]
    assert ricochet(BULK, *options, "--quiet", "-o", tmp_path / "a.h5").returncode == 0
    assert run_script("correlations", tmp_path / "a.h5", "-o", tmp_path / "a.png") == 2
    assert capsys.readouterr().err.endswith(f": needs 10 frames and more{how}\n")


def test_the_cooling_rate_of_a_single_run_has_no_error(bulk):
    run = read_run(bulk[2])
    figure = haff.draw([(0.9, [run])], [haff.cooled([haff.energy_left(run)], 0.9)])
    words = [
        text.get_text()
        for axes in figure.axes
        if axes.get_legend()
        for text in axes.get_legend().texts
    ]
    assert any(re.search(r"rate 0\.\d+  \(", word) for word in words), words


@pytest.mark.parametrize("end", [25.0, None])
def test_the_cooling_rate_is_that_of_the_homogeneous_state(rng, end):
    """Three per cent above the law, scattering by one; at half the rate after the end."""
    tau, true = np.linspace(0, 60, 601), 1.03 * hd.haff_rate(0.9)
    tracks = []
    for factor in 1 + 0.01 * rng.normal(size=20):
        lost = true * factor * np.minimum(tau, end or 60)
        lost += 0.5 * true * np.maximum(tau - (end or 60), 0)
        tracks.append((tau, tau, np.exp(-lost)))
    found = haff.cooled(tracks, 0.9)
    assert found.rate.mean == pytest.approx(true, abs=4 * found.rate.error)
    assert found.rate.error == pytest.approx(0.01 * true / np.sqrt(20), rel=0.5)
    local = found.local_rate.mean[100]
    assert local == pytest.approx(true * (0.5 if end else 1), rel=0.01)
    if end:
        assert found.homogeneous_until == pytest.approx(end, abs=1)
    else:
        assert np.isnan(found.homogeneous_until)
