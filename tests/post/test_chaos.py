"""Divergence of neighbouring runs and diffusion of tracers: the scripts lyapunov and lorentz."""

import csv

import numpy as np
import pytest

from ricochet.reports.trajectories import lorentz
from ricochet.reports.trajectories import lyapunov
from ricochet import RunError, read_run, statistics
from synthetic_run import refusal, run_script, write_run


def neighbours(folder, rng, pairs=3, growth=2.0, frames=81):
    """Write pairs of runs of two disks with distances 1e-12 exp(growth t) up to 0.5, t < 16."""
    time = np.linspace(0, 16, frames)
    paths = []
    for k in range(pairs):
        x = rng.uniform(size=(frames, 2, 2))
        slope = growth + 0.1 * (k - (pairs - 1) / 2)
        apart = np.minimum(1e-12 * np.exp(slope * time), 0.5)
        shifted = x + apart[:, None, None] * np.array([[0.6, 0], [0, 0.8]])
        for name, where in (("a", x), ("b", shifted)):
            paths.append(write_run(folder / f"{k}_{name}.h5", where, x, time=time))
    return paths


def test_lyapunov_finds_the_rate_of_divergence(tmp_path, rng, capsys):
    paths = neighbours(tmp_path, rng)
    runs = [read_run(path) for path in paths]
    apart = np.array([lyapunov.distance(*runs[k : k + 2]) for k in (0, 2, 4)])
    found = lyapunov.divergence(runs[0].time, apart, largest=0.01, begin=0.2)
    growth, times = found.growth, np.diff(found.passed, axis=0)[0]
    np.testing.assert_allclose(growth / times, [1.9, 2.0, 2.1], atol=1e-3)
    assert found.exponent.mean == pytest.approx(2, abs=0.01)
    relative = statistics.estimate(times).error / times.mean()
    assert found.exponent.error == pytest.approx(2 * relative, rel=0.1)
    assert np.exp(found.ends) == pytest.approx([1e-10, 0.01]) and found.reached == 3
    shorter = lyapunov.divergence(runs[0].time[:56], apart[:, :56], largest=0.01, begin=0.2)
    assert shorter.reached == 1 and shorter.exponent.mean == pytest.approx(2, abs=0.02)
    with pytest.raises(RunError, match="no fit is possible"):
        lyapunov.divergence(runs[0].time, 0 * apart, largest=0.01, begin=0.2)
    assert "3 runs: an even number" in refusal(capsys, "lyapunov", *paths[:3])


def tracer(path, rng, radii=(0.4, 0.4), walk=0.3, frames=20001):
    """Write a random walk in a box with two scatterers, with a frame every 10 mean free times.

    With R = 0.5 and two scatterers in 2 x 2, the density n R^2 is 1/8 and the mean free time 2.
    """
    step = rng.normal(scale=walk, size=(frames, 1, 2))
    place = np.cumsum(step, axis=0) + 1
    image = np.floor(place / 2).astype(np.int32)
    time = 20.0 * np.arange(frames)
    held = [((0.5, 0.5), radii[0], False), ((1.5, 1.5), radii[1], False)]
    return write_run(
        path,
        place - 2 * image,
        np.broadcast_to([0.6, 0.8], place.shape),
        time=time,
        radius=0.1,
        edges=(2.0, 2.0),
        periodic=(True, True),
        image=image,
        obstacles=held,
        observables={"obstacle_collisions": time / 2},
    )


def test_lorentz_finds_the_diffusion_of_a_random_walk(tmp_path, rng, capsys):
    paths = [tracer(tmp_path / f"{k}.h5", rng) for k in range(4)]
    runs = [read_run(path) for path in paths]
    assert lorentz.density_of(runs[0]) == 0.125
    found = [lorentz.diffusion(run, (10.0, 30.0)) for run in runs]
    exact = 0.3**2 / 2 / 20 / (3 / 16 / 0.25)  # <dx^2> / (2 t) over 3 v / (16 n R)
    mean = np.mean([one["diffusion"] for one in found])
    assert mean == pytest.approx(exact, rel=0.05)
    assert [one["free_time"] for one in found] == pytest.approx([1] * 4)
    assert lorentz.expansion(1e-9) == pytest.approx(1, abs=1e-7)
    table = tmp_path / "table.csv"
    assert run_script("lorentz", *paths, "-o", tmp_path / "a.png", "--csv", table) == 0
    capsys.readouterr()
    (row,) = csv.DictReader(table.read_text().splitlines())
    assert float(row["diffusion"]) == pytest.approx(mean) and row["runs"] == "4"
    uneven = tracer(tmp_path / "uneven.h5", rng, radii=(0.4, 0.3), frames=11)
    assert "equal circles" in refusal(capsys, "lorentz", uneven)
    short = tracer(tmp_path / "short.h5", rng, frames=11)
    assert "needs more frames" in refusal(capsys, "lorentz", short)


def test_the_exponent_depends_neither_on_the_starts_nor_on_waiting_times(rng):
    """Distances grow by random factors at random times, after a slow beginning."""
    found = []
    time = np.arange(0, 400, 0.1)
    for _ in range(40):
        tracks = []
        for _ in range(12):
            often = rng.uniform(size=400) < 0.8
            waits = rng.exponential(np.where(often, 0.2, 2.0))
            steps = rng.exponential(0.5, 400)
            steps[:8] *= 0.1
            at = np.cumsum(waits)
            tracks.append(-27 + np.interp(time, at, np.cumsum(steps), left=0))
        apart = np.exp(np.minimum(tracks, 0))
        found.append(lyapunov.divergence(time, apart, largest=0.01, begin=0.2).exponent)
    exact = 0.5 / (0.8 * 0.2 + 0.2 * 2.0)
    mean, error = np.transpose(found)
    assert mean.mean() == pytest.approx(exact, abs=4 * statistics.estimate(mean).error)
    assert abs(mean.mean() / exact - 1) < 0.05
    assert np.mean(np.abs(mean - exact) < error) == pytest.approx(0.6827, abs=0.25)
