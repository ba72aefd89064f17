"""Exported runs are opened with OVITO, MDAnalysis and readers of CSV."""

import sys
from pathlib import Path

import numpy as np
import pytest

from ricochet import Run, mdanalysis_universe
from synthetic_run import ROOT, run_script


def reader(module: str):
    """Return a module, or skip the test and state how to install the module."""
    return pytest.importorskip(
        module, reason=f"{module} is not installed (requirements.txt, tests/readers.txt)"
    )


@pytest.fixture
def run(simulated) -> Run:
    """Return a run of two species in a container whose lower corner is not the origin."""
    words = ("stop.collisions_per_disk=2", "species.light.count=20", "box.boundary=periodic,wall")
    return simulated(ROOT / "input/container.nml", *words)


def exported(run: Run, name: str, *options) -> Path:
    path = run.path.with_name(name)
    assert run_script("export", run.path, "-o", path, *options) == 0
    return path


def test_ovito_opens_the_export_as_a_system_in_two_dimensions(run):
    pipeline = reader("ovito.io").import_file(str(exported(run, "run.xyz")))
    assert pipeline.source.num_frames == run.n_frames
    for frame in (0, run.n_frames - 1):
        data = pipeline.compute(frame)
        disks = data.particles
        assert data.cell.is2D and tuple(data.cell.pbc[:2]) == tuple(run.periodic)
        np.testing.assert_array_equal(np.diag(data.cell[:2, :2]), run.edges)
        np.testing.assert_array_equal(data.cell[:2, 3], run.lower)
        assert data.attributes["Time"] == pytest.approx(run.time[frame], rel=1e-15)
        one_bit = {"rtol": 4e-16}  # error of OVITO's conversion of numbers
        np.testing.assert_allclose(disks.positions[...][:, :2], run.position[frame], **one_bit)
        np.testing.assert_allclose(disks["Velocity"][...][:, :2], run.velocity[frame], **one_bit)
        np.testing.assert_allclose(disks["Radius"][...], run.radius, rtol=1e-7)
        np.testing.assert_array_equal(disks["Mass"][...], run.mass)
        np.testing.assert_array_equal(disks.identifiers[...], np.arange(1, run.n_disks + 1))
        names = {kind.id: kind.name for kind in disks.particle_types.types}
        assert [names[t] for t in disks.particle_types[...]] == [
            run.names[s - 1] for s in run.species
        ]


def test_mdanalysis_reads_positions_velocities_times_and_species(run):
    reader("MDAnalysis")
    universe = mdanalysis_universe(run)
    assert len(universe.trajectory) == run.n_frames
    for frame in (0, run.n_frames - 1):
        step = universe.trajectory[frame]
        assert step.time == pytest.approx(run.time[frame] - run.time[0], rel=1e-6, abs=1e-9)
        np.testing.assert_allclose(universe.atoms.positions[:, :2], run.position[frame], atol=1e-6)
        np.testing.assert_allclose(universe.atoms.velocities[:, :2], run.velocity[frame], atol=1e-6)
        assert not universe.atoms.positions[:, 2].any()
    heavy = universe.select_atoms("type heavy")
    np.testing.assert_array_equal(heavy.indices, np.flatnonzero(run.of_species("heavy")))
    np.testing.assert_allclose(heavy.masses, run.mass[heavy.indices])
    np.testing.assert_allclose(universe.atoms.radii, run.radius)


def test_pandas_gets_all_observables(run):
    reader("pandas")
    table = run.to_dataframe()
    np.testing.assert_array_equal(table.index, run.observable("momentum").time)
    np.testing.assert_array_equal(table["total_energy"], run.observable("total_energy").value)
    np.testing.assert_array_equal(table["momentum_y"], run.observable("momentum").value[:, 1])
    hits = table[[f"side_collisions_{side}" for side in ("left", "right", "bottom", "top")]]
    np.testing.assert_array_equal(hits, run.observable("side_collisions").value)
    names = {f"{kind}/{what}" for kind in ("all", *run.names) for what in ("mean_speed",)}
    widths = [np.size(run.observable(name).value[0]) for name in run.observables]
    assert names < set(table) and len(table.columns) == sum(widths)


def test_xarray_gets_all_frames_and_is_asked_for_where_it_is_missing(run, monkeypatch):
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "xarray", None)
        with pytest.raises(ImportError, match="to_xarray needs a package: pip install xarray"):
            run.to_xarray()
    reader("xarray")
    table = run.to_xarray()
    assert dict(table.sizes) == {"time": run.n_frames, "disk": run.n_disks, "component": 2}
    for name in ("position", "velocity", "image", "event_count"):
        np.testing.assert_array_equal(table[name], getattr(run, name)[:])
    first = table.sel(disk=1, component="y", time=run.time[-1])
    assert first.position == run.position[-1][0, 1] and first.mass == run.mass[0]
    assert table.attrs["seed"] == run.seed


def test_csv_is_read_by_numpy(run):
    path = exported(run, "run.csv", "--frames", "::2")
    table = np.genfromtxt(path, delimiter=",", names=True, dtype=None)
    frames = range(0, run.n_frames, 2)
    assert len(table) == len(frames) * run.n_disks
    speeds = np.concatenate([run.velocity[k][:, 0] for k in frames])
    np.testing.assert_array_equal(table["vx"], speeds)
    np.testing.assert_array_equal(table["time"], np.repeat(run.time[frames], run.n_disks))
    assert set(table["species"]) == {"light", "heavy"}


def test_what_else_disks_have_is_exported_too(simulated):
    run = simulated(ROOT / "input/rough.nml", "stop.collisions_per_disk=2")
    table = np.genfromtxt(exported(run, "rough.csv", "--frames", "-1"), delimiter=",", names=True)
    head, *lines = exported(run, "rough.xyz", "--frames", "-1").read_text().splitlines()[1:]
    assert {"angular_velocity", "orientation"} == set(run.disk_data)
    for k, name in enumerate(run.disk_data):
        np.testing.assert_array_equal(table[name], run.per_disk(name)[-1])
        assert f":{name}:R:1:" in head
        column = [float(line.split()[7 + k]) for line in lines]
        np.testing.assert_array_equal(column, run.per_disk(name)[-1])
