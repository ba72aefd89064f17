"""Collision rates, free paths and self-diffusion, tested on synthetic runs and on gases."""

import numpy as np
import pytest

from ricochet.reports.equilibrium import correlations
from ricochet.reports.equilibrium import rates
from ricochet import EventLog, read_run, thermodynamics as td, transport as tp
from synthetic_run import drawn, written


def test_kicked_disks_have_the_diffusion_of_their_displacements_alone(simulated, monkeypatch):
    """For free flights of duration h, D is kT h / 2 m; velocities would yield 2 D."""
    run = simulated(
        """&box boundary = 'periodic', 'periodic' /
        &species count = 100 packing_fraction = 0.0005 temperature = 2 mass = 2 /
        &drive kind = 'brownian' interval = 0.01 temperature = 2 / &stop time = 20 /
        &output frames_every_time = 0.02 observables_every_time = 0.02 /"""
    )
    monkeypatch.setattr(correlations, "structure", lambda *_: ({}, {}))
    found = correlations.analysed([run], None)
    (d,) = found.members["D_displacement"]
    assert d.mean == pytest.approx(0.01 / 2, abs=4 * d.error + 0.0001)
    assert not any(name.startswith("D_velocities") for name in (*found.members, *found.curves))


def test_free_paths_weigh_each_flight_once_however_often_frames_meet_it(tmp_path):
    """One disk has free times 1, 1, 4, 1, 1, 4, ...; another one does not collide."""
    hits = np.cumsum(np.tile([1.0, 1.0, 4.0], 40))
    time = np.linspace(0.05, hits[-1] - 0.05, 2400)
    v = np.tile([[0.5, 0.0], [1.0, 0.0]], (len(time), 1, 1))
    collisions = {"collisions": np.zeros(len(time), int)}
    run = written(tmp_path / "run.h5", 0 * v, v, time=time, observables=collisions)
    zero = np.zeros(len(hits), int)
    run.__dict__["_event_log"] = EventLog(hits, zero + 1, zero, zero + 1.0)
    path, weight = rates.free_paths(run, skip=0)
    assert set(np.round(path, 9)) == {0.5, 2.0}
    assert np.sum(weight[path > 1]) / np.sum(weight) == pytest.approx(1 / 3, rel=0.02)


def test_free_paths_scatter_as_their_errors_say(monkeypatch, rng):
    """Errors from several runs, and from blocks of one run, of 4000 independent paths each."""
    monkeypatch.setattr(
        rates, "free_paths", lambda run, skip: (rng.exponential(2.0, 4000), np.ones(4000))
    )
    monkeypatch.setattr(rates.td, "has_log", lambda run: True)
    for runs, samples in ((1, 4000), (50, 200000)):
        mean, density = rates.mean_and_density([None] * runs)
        assert abs(mean.mean - 2) < 4 * mean.error
        assert mean.error == pytest.approx(2 / np.sqrt(samples), rel=0.9 if runs == 1 else 0.4)
        law = np.diff(np.exp(-rates.BINS)) / np.diff(rates.BINS)
        off = (density.mean + law)[:16] / density.error[:16]
        assert np.mean(np.abs(off) < 3) > 0.8


def test_diffusion_of_a_gas_is_found_twice_and_near_that_of_enskog(bulk, tmp_path):
    """The structure factor of a dilute gas, with many wave vectors, is calculated three times."""
    rows = {row["what"]: row for row in drawn(tmp_path, "correlations", *bulk[:1])}
    both = [rows[f"D_{way}"] for way in ("displacement", "velocities")]
    one, other = (float(row["y"]) for row in both)
    error, run = float(both[0]["error"]), read_run(bulk[0])
    assert 0 < error < 0.3 * one and one == pytest.approx(other, abs=error)
    assert one == pytest.approx(tp.enskog_of(run)["D"], abs=4 * error + 0.1 * one)
    assert {"vacf", "msd", "g", "S", "g6", "psi6_local", "psi6_global"} <= set(rows)
    twice = correlations.analysed([run, run], None)
    for name in ("vacf", "msd", "a2", "g", "S", "D_velocities(t)", "D_displacement(t)"):
        assert np.all(twice.curves[name].error == 0), name
    alone = correlations.analysed([run], None)
    lag, _, error = alone.curves["vacf"]
    known = lag < 0.1 * lag[-1]
    assert np.all(error[known] > 0) and np.isnan(error[-1]), "up to an eighth of the run"


def test_rates_of_a_gas_agree_with_each_other(bulk, tmp_path):
    run = read_run(bulk[0])
    found = td.rates(run)
    per_disk, pairs = found["collisions_per_disk_and_time"], found["w_disks_disks"]
    assert pairs.mean == pytest.approx(per_disk.mean, rel=0.02)
    assert pairs.mean == pytest.approx(run.collisions_per_disk.value[-1] / run.time[-1], rel=0.1)
    (mean, error), (density, _) = rates.mean_and_density([run])
    assert 0 < error < 0.03 * mean
    speed = np.mean(run.speed(slice(None)))
    assert mean == pytest.approx(speed / per_disk.mean, rel=0.03)
    assert np.sum(density * np.diff(rates.BINS)) == pytest.approx(1, abs=0.02)
    points = [row for row in drawn(tmp_path, "rates", *bulk[:1]) if row["x"]]
    names = [row["quantity"] for row in points]
    assert names.count("free_path_density") == len(rates.BINS) - 1
    assert names.count("pressure_virial(t)") > 10
