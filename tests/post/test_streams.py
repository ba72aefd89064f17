"""The stream function: differences of psi are numbers of disks passing per time."""

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from ricochet import read_run, streams
from ricochet.reading.nature import Refused
from synthetic_run import drawn, write_run, written

FRAMES, COUNT, RADIUS = 120, 60, 0.06
GRIDS = ((3, 4), (7, 7), (16, 24))


@pytest.mark.parametrize("periodic", [(False, False), (True, False), (False, True), (True, True)])
def test_a_stream_function_is_found_from_its_flux(rng, periodic):
    """Random modes satisfy the boundary conditions, with a flux along periodic axes."""
    edges = rng.uniform(0.5, 3, 2)
    count = tuple(map(int, rng.integers(30, 45, 2)))
    ends = [np.linspace(0, edge, n + 1) for edge, n in zip(edges, count, strict=True)]
    through = rng.normal(size=2) * periodic
    waves = np.where(periodic, 2, 1) * np.pi * rng.integers(1, 3, (3, 2)) / edges
    phases, sizes = np.where(periodic, rng.uniform(0, 6, (3, 2)), 0), rng.normal(size=3)

    def psi(x, y):
        parts = zip(sizes, waves, phases, strict=True)
        total = sum(a * np.sin(k[0] * x + p[0]) * np.sin(k[1] * y + p[1]) for a, k, p in parts)
        return total + through[0] * y - through[1] * x

    fine = [(np.arange(4 * n) + 0.5) * edge / (4 * n) for edge, n in zip(edges, count, strict=True)]
    x, y = (part.ravel() for part in np.meshgrid(*fine))
    step = 1e-5
    flux = np.stack([psi(x, y + step) - psi(x, y - step), psi(x - step, y) - psi(x + step, y)])
    run = SimpleNamespace(edges=edges, lower=0 * edges, periodic=np.array(periodic))
    mesh = streams.Mesh(run, count)
    loads = mesh.loads(np.stack([x, y], axis=1), flux.T / (2 * step) * edges.prod() / x.size)
    found = mesh.solve(loads[:, None]).reshape(count[1] + 1, count[0] + 1)
    exact = psi(*np.meshgrid(*ends))
    exact = exact - exact[0, 0]
    assert np.abs(found - exact).max() < 0.01 * np.ptp(exact)


def in_a_strip(rng) -> tuple[np.ndarray, np.ndarray, Callable]:
    """Sample disks moving at 1 between two walls along x; psi grows over the accessible part."""
    x = rng.uniform([0, RADIUS], [1, 1 - RADIUS], (FRAMES, COUNT, 2))
    return x, np.broadcast_to([1.0, 0.0], x.shape), lambda x, y: COUNT * share(y)


def in_a_funnel(rng) -> tuple[np.ndarray, np.ndarray, Callable]:
    """Sample disks that flow down between two walls whose distance varies with the height."""
    y = rng.uniform(0, 1, (FRAMES, COUNT))
    half = 0.35 + 0.1 * np.cos(2 * np.pi * y)
    slope = -0.2 * np.pi * np.sin(2 * np.pi * y)
    part = rng.uniform(-1, 1, y.shape)  # x / half; the density is 1 / (2 half) of the disks at y
    v = np.stack([-part * slope, -np.ones_like(y)], axis=-1)

    def psi(x, y):
        return COUNT * np.clip((x - 0.5) / (0.7 + 0.2 * np.cos(2 * np.pi * y)) + 0.5, 0, 1)

    return np.stack([0.5 + half * part, y], axis=-1), v, psi


def in_a_drum(rng) -> tuple[np.ndarray, np.ndarray, Callable]:
    """Sample disks rotating rigidly at the rate 1 in a round container of radius 0.5."""
    most, angle = 0.5 - RADIUS, rng.uniform(0, 2 * np.pi, (FRAMES, COUNT))
    r = most * np.sqrt(rng.uniform(0, 1, angle.shape))
    x = np.stack([r * np.cos(angle), r * np.sin(angle)], axis=-1)
    v = np.stack([-x[..., 1], x[..., 0]], axis=-1)

    def psi(x, y):
        square = (x - 0.5) ** 2 + (y - 0.5) ** 2
        return COUNT / (2 * np.pi) * np.clip(1 - square / most**2, 0, None)

    return 0.5 + x, v, psi


def share(y: np.ndarray) -> np.ndarray:
    """Return the fraction of the accessible width that is below a height."""
    return np.clip((y - RADIUS) / (1 - 2 * RADIUS), 0, 1)


SYSTEMS = {
    "strip": (in_a_strip, (True, False), ()),
    "funnel": (in_a_funnel, (False, True), ()),
    "drum": (in_a_drum, (False, False), [((0.5, 0.5), 0.5, 1)]),
}


@pytest.mark.parametrize("system", SYSTEMS)
def test_differences_of_psi_are_fluxes_on_every_grid(tmp_path, rng, system):
    """Psi at corners and midpoints of cells is correct within its error, even near walls."""
    sample, periodic, obstacles = SYSTEMS[system]
    pulls = []
    for seed in range(2 * len(GRIDS)):
        x, v, psi = sample(rng)
        cells = GRIDS[seed % len(GRIDS)]
        more = {"radius": RADIUS, "periodic": periodic, "obstacles": obstacles}
        run = written(tmp_path / f"{seed}.h5", x, v + 0.5 * rng.normal(size=v.shape), **more)
        found = streams.stream_function([run], None, cells)
        for (mean, error), points in (
            (found.corners, np.meshgrid(*(np.linspace(0, 1, n + 1) for n in cells))),
            (found.middles, streams.places(run, cells).T),
        ):
            off = mean - (psi(*points) - psi(0, 0))
            assert (np.abs(off) < 5 * error + 1e-3 * COUNT).all()
        middle = tuple(size // 2 for size in found.corners.mean.shape)
        exact = psi(middle[1] / cells[0], middle[0] / cells[1]) - psi(0, 0)
        pulls.append((found.corners.mean[middle] - exact) / found.corners.error[middle])
    low, high = chi2.interval(0.999, len(pulls))
    assert low < np.sum(np.square(pulls)) < high


def test_recycled_disks_have_no_stream_function(tmp_path, rng, capsys):
    """The script draws the arrows of a refilled hopper, and says why there are no streamlines."""
    x, v, _ = in_a_funnel(rng)
    parameters = {"drive": {"kind": "recycle"}}
    path = write_run(tmp_path / "a.h5", x, v, radius=RADIUS, parameters=parameters)
    with pytest.raises(Refused, match=r"recycles disks.*no stream function"):
        streams.stream_function([read_run(path)], None, (4, 4))
    rows = drawn(tmp_path, "fields", path, "--grid", "4,4")
    assert "flow_significant" in rows[0] and "stream_function" not in rows[0]
    assert "no stream function" in capsys.readouterr().err
