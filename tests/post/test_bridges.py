"""Exchange of runs with OVITO, MDAnalysis, GSD, LAMMPS, freud, pandas, xarray and CSV."""

import random
import re
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import ricochet
from check_examples import examples_of
from ricochet import Run, RunError, bridges, mdanalysis_universe, structure
from synthetic_run import ROOT, run_script


def reader(module: str):
    """Return a module, or skip the test with a message how to install it."""
    return pytest.importorskip(
        module, reason=f"{module} is not installed (requirements.txt, tests/readers.txt)"
    )


@pytest.fixture
def run(simulated) -> Run:
    """Return a run of two species in a container whose lower corner is not at the origin."""
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


def test_ovito_sees_the_displaced_images_of_a_sheared_box(simulated):
    """Neighbours in the tilted lattice are no closer than colliding disks."""
    words = ("box.shear_rate=1", "box.boundary=periodic,periodic", "stop.collisions_per_disk=3")
    run = simulated(ROOT / "input/lab.nml", "stop.events=", *words)
    pipeline = reader("ovito.io").import_file(str(exported(run, "run.xyz")))
    images = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    for frame in range(run.n_frames):
        cell = np.array(pipeline.compute(frame).cell[:2, :2])
        slide = cell[0, 1] - run.shear_rate * run.edges[1] * run.time[frame]
        assert slide / run.edges[0] == pytest.approx(round(slide / run.edges[0]), abs=1e-9)
        place = run.position[frame]
        gaps = [place[:, None] - place + cell @ image for image in images]
        apart = np.linalg.norm(gaps, axis=-1)
        apart[images.index((0, 0))][np.diag_indices(run.n_disks)] = np.inf
        assert apart.min() > (run.radius.min() * 2) * (1 - 1e-9)


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
        way = f"to_xarray needs a package: {sys.executable} -m pip install xarray"
        with pytest.raises(ImportError, match=way):
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


WRITERS = {"gsd": bridges.write_gsd, "lammpstrj": bridges.write_lammps}
READERS = {"gsd": bridges.read_gsd, "lammpstrj": bridges.read_lammps}


@pytest.fixture(params=WRITERS)
def kind(request) -> str:
    """Return a file format, skipping the test if its package is missing."""
    if request.param == "gsd":
        reader("gsd.hoomd")
    return request.param


@pytest.fixture
def rough(simulated) -> Run:
    """Return a run of rough disks of two species in a box with an inward moving right side."""
    return simulated(
        "&box lower = -1, 2 upper = 1, 5 boundary = 'wall', 'periodic' / "
        "&side name = 'right' motion = 'constant_velocity' velocity = 0.5 end_time = 0.5 / "
        "&species name = 'light' count = 30 radius = 0.05 speed = 1 / "
        "&species name = 'heavy' count = 9 radius = 0.1 mass = 4 speed = 1 / "
        "&contact tangential_restitution = 0.5 / &stop time = 0.3 / "
        "&output frames_every_time = 0.1 /",
        name="rough",
    )


def test_frames_return_from_files_with_every_bit(run, rough, kind):
    for one in (run, rough):
        path = exported(one, f"{one.path.stem}.{kind}")
        for k in (0, 1, -1):
            found, frame = READERS[kind](path, k), one[k]
            assert found.time == frame.time
            np.testing.assert_array_equal(found.lower, one.lower)
            np.testing.assert_allclose(found.upper, one.corners_at(frame.time)[1], rtol=1e-15)
            np.testing.assert_array_equal(found.periodic, one.periodic)
            exact = {"radius": one.radius, "mass": one.mass, "velocity": frame.velocity}
            exact |= {"species": [one.names[s - 1] for s in one.species]}
            exact |= {name: frame.per_disk(name) for name in one.disk_data}
            for name, values in exact.items():
                np.testing.assert_array_equal(found.disks[name], values)
            # In a GSD file positions are relative to the centre of the box.
            apart = found.disks["position"] - frame.position
            assert np.abs(apart).max() <= (1e-15 if kind == "gsd" else 0)


def test_ovito_opens_gsd_and_lammps_files(run, rough, kind):
    """OVITO reads both formats independently."""
    opened = reader("ovito.io").import_file
    for one in (run, rough):
        pipeline = opened(str(exported(one, f"{one.path.stem}.{kind}")))
        assert pipeline.source.num_frames == one.n_frames
        data = pipeline.compute(one.n_frames - 1)
        disks, frame = data.particles, one[-1]
        edges = one.corners_at(frame.time)[1] - one.lower
        centre = one.lower + edges / 2 if kind == "gsd" else 0
        close = {"rtol": 1e-14, "atol": 1e-14}
        np.testing.assert_allclose(disks.positions[...][:, :2] + centre, frame.position, **close)
        np.testing.assert_allclose(disks["Velocity"][...][:, :2], frame.velocity, **close)
        np.testing.assert_allclose(disks["Radius"][...], one.radius, rtol=1e-7)
        np.testing.assert_allclose(disks["Mass"][...], one.mass, rtol=1e-15)
        np.testing.assert_allclose(np.diag(data.cell[:2, :2]), edges, rtol=1e-7)
        names = {each.id: each.name for each in disks.particle_types.types}
        species = [one.names[s - 1] for s in one.species]
        assert [names[t] for t in disks.particle_types[...]] == species
        if kind == "gsd":
            assert data.cell.is2D and data.attributes["ricochet/time"] == frame.time
        else:
            assert tuple(data.cell.pbc[:2]) == tuple(one.periodic)
            assert data.attributes["Time"] == pytest.approx(frame.time, rel=1e-15)
            if one.disk_data:
                spin = disks["Angular Velocity"][...][:, 2]
                np.testing.assert_allclose(spin, frame.per_disk("angular_velocity"), rtol=1e-14)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_mdanalysis_reads_lammps_files_without_times(run, tmp_path):
    opened = reader("MDAnalysis").Universe
    path = bridges.write_lammps(run, tmp_path / "run.lammpstrj", slice(0, None, 4), time=False)
    kind = {"format": "LAMMPSDUMP", "topology_format": "LAMMPSDUMP"}
    universe = opened(str(path), **kind, lammps_coordinate_convention="unscaled")
    assert len(universe.trajectory) == len(range(0, run.n_frames, 4))
    place = run.position[0] - [*run.lower]  # MDAnalysis moves the origin to the corner of the box
    np.testing.assert_allclose(universe.atoms.positions[:, :2], place, atol=1e-6)
    found = bridges.read_lammps(path, 1)
    assert found.time == 4 and np.all(found.disks["position"] == run.position[4])


def test_the_package_gsd_reads_what_is_written(run, tmp_path):
    hoomd = reader("gsd.hoomd")
    for precision in ("single", "double"):
        path = bridges.write_gsd(run, tmp_path / "run.gsd", [-1], precision)
        with hoomd.open(str(path)) as file:
            (frame,) = file
        frame.validate()
        box = frame.configuration
        assert box.dimensions == 2 and box.step == run.n_frames - 1
        half = np.array([*run.edges, 0]) / 2
        assert np.all(np.abs(frame.particles.position) <= half * (1 + 1e-7))
        place = frame.particles.position[:, :2] + run.lower + run.edges / 2
        error = 1e-7 if precision == "single" else 1e-15
        assert np.abs(place - run.position[-1]).max() < error
        np.testing.assert_array_equal(frame.particles.image[:, :2], run.image[-1])
    with pytest.raises(ValueError, match="precision: 'half' is neither"):
        bridges.write_gsd(run, tmp_path / "run.gsd", precision="half")


def test_a_simulation_starts_from_an_imported_frame(run, kind, tmp_path):
    """Its collisions are those of the original run."""
    direct = {"box": {"lower": run.lower, "upper": run.upper, "boundary": ["periodic", "wall"]}}
    direct["species"] = [
        {"name": one.name, "position": run.position[-1][one.disks],
         "velocity": run.velocity[-1][one.disks], "radius": one.radius, "mass": one.mass}
        for one in run.by_species
    ]  # fmt: skip
    frame = READERS[kind](exported(run, f"run.{kind}"))
    starts = ricochet.write_start(tmp_path / "start.txt", **frame.disks)
    named = direct | {
        "species": [
            {"name": name, "file": str(starts), "velocities": "file", "placement": "file"}
            for name in run.names
        ]
    }
    logs = []
    for start in (direct, frame.input(), named):
        with ricochet.Simulation(start | {"stop": {"collisions": 30}}) as box:
            pairs: list = []
            box.advance(on_event=lambda event, pairs=pairs: pairs.append((event.i, event.j)))
            logs.append(pairs)
    assert logs[0] == logs[1] == logs[2] and len(logs[0]) >= 30


def test_dump_files_of_lammps_itself_are_read(tmp_path):
    """Columns are in any order, scaled or unwrapped; ids are unordered; the time is missing."""
    head = "ITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n3\nITEM: BOX BOUNDS {} {} pp\n"
    head += "-1.0e+00 1.0e+00\n0 4\n-0.5 0.5\nITEM: ATOMS "
    rows = "id type xs ys zs vx vy diameter\n3 2 0.5 0.25 0.5 1 2 0.2\n1 1 0 1 0.5 3 4 0.1\n"
    rows += "2 1 0.25 0.5 0.5 5 6 0.3\n"
    own = "type yu xu id\n1 4.5 3.5 1\n2 1 0 2\n1 -0.5 -1.5 3\n"
    path = tmp_path / "own.dump"
    path.write_text(head.format(100, "pp", "ff") + rows + head.format(200, "pp", "pp") + own)
    first, last = bridges.read_lammps(path, 0), bridges.read_lammps(path)
    assert (first.time, last.time) == (100, 200)
    assert first.periodic.tolist() == [True, False] and last.periodic.tolist() == [True, True]
    assert first.disks["position"].tolist() == [[-1, 4], [-0.5, 2], [0, 1]]
    assert first.disks["velocity"].tolist() == [[3, 4], [5, 6], [1, 2]]
    assert first.disks["radius"].tolist() == [0.05, 0.15, 0.1]
    assert first.disks["species"].tolist() == ["1", "1", "2"]
    assert [group["name"] for group in first.input()["species"]] == ["type1", "type2"]
    assert last.disks["position"].tolist() == [[-0.5, 0.5], [0, 1], [0.5, 3.5]]
    assert "velocity" not in last.disks and "radius" not in last.disks


def test_gsd_files_of_hoomd_itself_are_read(tmp_path):
    hoomd = reader("gsd.hoomd")
    frame = hoomd.Frame()
    frame.configuration.step, frame.configuration.dimensions = 7, 2
    frame.configuration.box = [4, 2, 0, 0, 0, 0]
    frame.particles.N, frame.particles.types = 2, ["A", "B"]
    frame.particles.typeid, frame.particles.position = [1, 0], [[1, -0.5, 0], [-1, 0.5, 0]]
    frame.particles.type_shapes = [{"type": "Sphere", "diameter": d} for d in (0.5, 0.25)]
    with hoomd.open(str(tmp_path / "own.gsd"), "w") as file:
        file.append(frame)
        frame.configuration.box = [4, 2, 0, 0.5, 0, 0]
        file.append(frame)
        frame.configuration.box, frame.configuration.dimensions = [4, 2, 2, 0, 0, 0], 3
        frame.particles.position = [[1, -0.5, 0], [-1, 0.5, 0.5]]
        file.append(frame)
    found = bridges.read_gsd(tmp_path / "own.gsd", 0)
    assert (
        found.time == 7 and found.periodic.all() and found.disks["species"].tolist() == ["B", "A"]
    )
    assert found.lower.tolist() == [-2, -1] and found.disks["radius"].tolist() == [0.125, 0.25]
    for k, reason in ((1, "its box is tilted"), (2, "is three-dimensional"), (9, "has no frame 9")):
        with pytest.raises(RunError, match=reason):
            bridges.read_gsd(tmp_path / "own.gsd", k)


TORN = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS pp pp pp\n0 1\n0 1\n0 1\n"
WRONG = {
    "": "has no frame -1; it is no dump file of LAMMPS",
    TORN: "has no ITEM: ATOMS",
    TORN + "ITEM: ATOMS id x y\n": "is cut short: it does not consist of 1 lines of 3 columns",
    TORN + "ITEM: ATOMS id x y\n1 2\n": "is cut short",
    TORN + "ITEM: ATOMS id q\n1 2\n": r"has no columns x and y \(or xu and yu, or xs and ys\)",
    TORN + "ITEM: ATOMS x y\n1 a\n": r"frame -1 is damaged \(could not convert",
    TORN.replace("BOUNDS", "BOUNDS xy xz yz") + "ITEM: ATOMS x y\n1 1\n": "its box is tilted",
    TORN.replace("ATOMS\n1", "ATOMS\n2") + "ITEM: ATOMS x y z\n0 0 1\n1 1 0\n": "three-dimensional",
}


@pytest.mark.parametrize("text", WRONG)
def test_a_wrong_dump_file_is_answered_in_one_line(text, tmp_path):
    (tmp_path / "a.dump").write_text(text)
    with pytest.raises(RunError, match=WRONG[text]) as problem:
        bridges.read_lammps(tmp_path / "a.dump")
    assert str(problem.value).startswith(str(tmp_path)) and "\n" not in str(problem.value)
    with pytest.raises(RunError, match="no such file"):
        bridges.read_lammps(tmp_path / "b.dump")


DUMP = TORN.replace("ATOMS\n1", "ATOMS\n2") + "ITEM: ATOMS x y z vx vy radius mass omegaz\n"
DUMP += "0.25 0.5 0 1 2 0.1 3 4\n0.75 0.5 0 1 2 0.1 3 4\n"
IMPOSSIBLE = [
    *(("STEP\n0", f"STEP\n{time}") for time in ("nan", "inf")),
    *(("pp\n0 1", f"pp\n{bounds}") for bounds in ("1 1", "1 0", "0 inf", "nan 1")),
    *(("\n0.25", f"\n{x}") for x in ("nan", "-inf", "1e999")),
    *(("0.1 3", f"{radius} 3") for radius in ("0", "-0.1", "nan", "inf")),
    *(("0.1 3", f"0.1 {mass}") for mass in ("0", "-3", "nan", "inf")),
    *((" 0 1 2", f" {numbers}") for numbers in ("nan 1 2", "0 inf 2", "0 1 nan")),
    ("3 4", "3 inf"),
]


@pytest.mark.parametrize(("old", "new"), IMPOSSIBLE)
def test_a_dump_file_with_impossible_numbers_is_answered_in_one_line(old, new, tmp_path):
    path = tmp_path / "a.dump"
    path.write_text(DUMP)
    assert bridges.read_lammps(path).input()["species"][0]["radius"].tolist() == [0.1, 0.1]
    path.write_text(DUMP.replace(old, new, 1))
    with pytest.raises(RunError, match=r"a\.dump: frame -1 is damaged \(.*\)$") as problem:
        bridges.read_lammps(path)
    assert "\n" not in str(problem.value)


@pytest.fixture
def damaged(kind, run, tmp_path):
    """Return a function that changes bytes of an exported file and reads it."""
    whole = exported(run, f"run.{kind}").read_bytes()
    path = tmp_path / f"damaged.{kind}"

    def read(change, frame=-1):
        path.write_bytes(change(bytearray(whole)))
        return READERS[kind](path, frame)

    return read


@pytest.mark.filterwarnings("error")
def test_a_damaged_file_is_answered_in_one_line_or_read(damaged, kind):
    """Bytes are changed at random, mostly in the header and the index of a GSD file."""
    rng = random.Random(1)

    def spoil(content):
        last = len(content) if kind == "lammpstrj" or rng.random() < 0.2 else 5000
        for _ in range(rng.choice([1, 1, 2, 8])):
            place = rng.randrange(last)
            new = rng.choice([0, 255, rng.randrange(256), content[place] ^ 1 << rng.randrange(8)])
            content[place : place + 1] = bytes([new] * rng.choice([1, 1, 4, 8]))
        return content[: rng.randrange(len(content))] if rng.random() < 0.05 else content

    answers: Counter[str] = Counter()
    for _ in range(400):
        try:
            frame = damaged(spoil, rng.choice([-1, 0, 3]))
        except RunError as problem:
            answers[str(problem)] += 1
        else:
            assert all(np.isfinite(frame.disks[name]).all() for name in ("position", "radius"))
            answers["read"] += 1
    assert 20 < answers.pop("read") < 380
    assert all(re.search(rf"damaged\.{kind}: [^\n]*frame.*$", answer) for answer in answers)


@pytest.mark.parametrize("group", ["particles", "bonds", "pairs"])
def test_a_gsd_file_that_counts_too_many_members_is_refused(group, tmp_path):
    """The package gsd would fill arrays of this size with default values."""
    reader("gsd.hoomd")
    layer = reader("gsd.fl")
    path = tmp_path / "a.gsd"
    with layer.open(
        str(path), "w", application="test", schema="hoomd", schema_version=[1, 4]
    ) as file:
        file.write_chunk(f"{group}/N", np.array([2**31], dtype=np.uint32))
        file.end_frame()
    with pytest.raises(RunError, match=rf"frame -1 .*{group}/N = 2147483648 exceeds the size"):
        bridges.read_gsd(path)


def test_what_cannot_be_exchanged_is_answered_in_one_line(simulated, tmp_path, monkeypatch, capsys):
    words = ("box.shear_rate=1", "box.boundary=periodic,periodic", "stop.collisions_per_disk=1")
    sheared = simulated(ROOT / "input/lab.nml", "stop.events=", *words)
    assert run_script("export", sheared.path, "-o", tmp_path / "a.lammpstrj") == 1
    assert "LAMMPS dump files are written of rectangular boxes only" in capsys.readouterr().err
    assert run_script("export", sheared.path, "-o", tmp_path / "a.pdb") == 2
    assert "must end in .xyz, .csv, .gsd or .lammpstrj" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "gsd.hoomd", None)  # as if it were not installed
    assert run_script("export", sheared.path, "-o", tmp_path / "a.gsd") == 2
    way = f"needs a package: {sys.executable} -m pip install gsd"
    assert f"a.gsd: write_gsd {way}\n" in capsys.readouterr().err
    with pytest.raises(ImportError, match=f"read_gsd {way}"):
        bridges.read_gsd(tmp_path / "a.gsd")


def examples(heading: str) -> list[str]:
    """Return the Python examples below a heading of the guide to other programs."""
    page = (ROOT / "docs" / "guides" / "other-programs.md").read_text()
    return examples_of(page.partition(f"\n## {heading}\n")[2].partition("\n#")[0])


@pytest.fixture
def at_root(program, tmp_path, monkeypatch):
    """Change to a folder in which the examples of the pages find the inputs."""
    monkeypatch.setenv("RICOCHET", str(program))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "input").symlink_to(ROOT / "input")
    (tmp_path / "runs").mkdir()


@pytest.mark.usefixtures("at_root")
def test_the_example_of_an_imported_frame_works():
    (code,) = examples("Disks of other programs")
    found: dict = {}
    exec(code, found)
    assert len(Path("runs/first.txt").read_text().splitlines()) == found["first"].n_disks + 1
    assert found["frame"].time == found["first"].time[-1]


@pytest.mark.usefixtures("at_root")
def test_freud_finds_the_order_that_this_package_finds():
    """The package freud calculates in single precision."""
    reader("freud")
    (code,) = examples("freud")
    found: dict = {}
    exec(code, found)
    run, g = found["fluid"], found["g"]
    close = {"atol": 2e-4}
    np.testing.assert_allclose(found["psi6"], structure.bond_order(run, -1), **close)
    edges = g.bin_edges / (2 * run.radius[0])
    own = structure.pair_correlation(run, -1, edges.astype(float))
    assert len(own) == 50 and np.nanmax(own) > 1.4
    np.testing.assert_allclose(g.rdf[1:], own[1:], atol=0.03)
