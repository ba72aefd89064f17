"""Groups of many obstacles: circles and straight walls from files, and polylines."""

import sys
from itertools import pairwise
from pathlib import Path

import h5py
import matplotlib.pyplot as plt
import numpy as np
import pytest

from ricochet import Simulation, read_run
from ricochet.drawing import draw_box

from whole_runs import FINISHED, USAGE, ran, write_input

ROOT = Path(__file__).resolve().parents[2]
SIDE = 9
BOX = f"&box upper = {SIDE}, {SIDE} boundary = 'periodic', 'periodic' /"
END = """&obstacle name = 'last' centre = 3, 3 radius = 0.2 /
&species count = 3 radius = 0.03 velocities = 'maxwell' /
&stop events = 2000 /
&output frames_every_events = 50 event_log = .true. /"""
POINTS = [(1, 1), (2, 1.5), (2, 2.5), (1, 1)]


def scatterers() -> np.ndarray:
    """Return circles (n, 3), some of them overlapping."""
    rng = np.random.default_rng(4)
    cells = np.stack(np.meshgrid(*2 * [np.arange(SIDE) + 0.5]), axis=-1).reshape(-1, 2)
    places = cells + rng.uniform(-0.4, 0.4, cells.shape)
    return np.column_stack([places, rng.uniform(0.1, 0.3, len(cells))])


def walls() -> np.ndarray:
    """Return straight walls (n, 4)."""
    start = np.random.default_rng(5).uniform(1, SIDE - 1, (20, 2))
    return np.column_stack([start, start + np.array([0.3, -0.2])])


def table(names: str, rows: np.ndarray) -> str:
    return (
        "\n".join(["# many", names, "", *(" ".join(map(repr, row)) for row in rows.tolist())])
        + "\n"
    )


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Write inputs with the same obstacles, in groups of many and one by one."""
    (tmp_path / "circles.txt").write_text(table("x y radius", scatterers()))
    (tmp_path / "walls.txt").write_text(table("X1 y1 x2 y2", walls()))
    points = ", ".join(f"{x}, {y}" for x, y in POINTS)
    many = [
        "&obstacle name = 'circles' file = 'circles.txt' /",
        "&wall name = 'triangle' points = " + points + " /",
        "&wall name = 'lines' file = 'walls.txt' /",
    ]
    one = [f"&obstacle centre = {x!r}, {y!r} radius = {r!r} /" for x, y, r in scatterers().tolist()]
    ends = [(*a, *b) for a, b in pairwise(POINTS)] + walls().tolist()
    one += [f"&wall from = {a!r}, {b!r} to = {c!r}, {d!r} /" for a, b, c, d in ends]
    write_input(tmp_path, "\n".join([BOX, *many, END]), "many.nml")
    write_input(tmp_path, "\n".join([BOX, *one, END]), "single.nml")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_obstacles_of_a_file_are_met_as_if_each_had_a_group(program, folder):
    for name in ("many", "single"):
        assert ran(program, f"{name}.nml", "-o", f"{name}.h5").returncode == FINISHED
    with h5py.File("many.h5") as many, h5py.File("single.h5") as single:
        for name in (
            "particles/disks/position/value",
            "particles/disks/velocity/value",
            "events/j",
        ):
            assert np.array_equal(many[name][()], single[name][()])
        codes = many["events/j"][()]
        assert codes.min() < -4 - len(scatterers())  # including walls
        sums = many["observables"]["obstacles" if "obstacles" in many["observables"] else "walls"]
        assert set(sums) == {"circles", "last", "triangle", "lines"}
        hits = sum(int(sums[name]["collisions/value"][-1]) for name in sums)
        assert hits == int(many["observables/obstacle_collisions/value"][-1])


def test_a_reader_has_every_obstacle_in_the_order_of_its_codes(program, folder):
    assert ran(program, "many.nml", "-o", "many.h5").returncode == FINISHED
    run = read_run("many.h5")
    assert np.array_equal([o.centre for o in run.obstacles], [*scatterers()[:, :2], [3, 3]])
    assert [o.radius for o in run.obstacles] == [*scatterers()[:, 2], 0.2]
    assert np.array_equal(run.walls[:3], [*pairwise(POINTS)])
    assert np.array_equal(run.walls[3:].reshape(-1, 4), walls())
    axes = plt.figure().subplots()
    draw_box(axes, run)
    plt.close()


def test_a_simulation_has_them_too(folder):
    with Simulation("many.nml") as simulation:
        rows = simulation.parameters["obstacle_rows"]
        assert np.array_equal(rows["centre"], [*scatterers()[:, :2], [3, 3]])
        assert np.array_equal(rows["group"], [1] * len(scatterers()) + [2])
        assert np.array_equal(simulation.parameters["wall_rows"]["to"][:3], POINTS[1:])


def test_a_file_of_hdf5_has_the_same_obstacles(program, folder):
    assert ran(program, "many.nml", "-o", "text.h5").returncode == FINISHED
    with h5py.File("circles.h5", "w") as circles, h5py.File("walls.h5", "w") as lines:
        circles["centre"], circles["radius"] = scatterers()[:, :2], scatterers()[:, 2]
        lines["from"], lines["to"] = walls()[:, :2], walls()[:, 2:]
    text = (folder / "many.nml").read_text().replace(".txt", ".h5")
    path = write_input(folder, text, "hdf5.nml")
    assert ran(program, path, "-o", "hdf5.h5").returncode == FINISHED
    with h5py.File("text.h5") as one, h5py.File("hdf5.h5") as other:
        for name in ("particles/disks/position/value", "parameters/wall_rows/to"):
            assert np.array_equal(one[name][()], other[name][()])
    with h5py.File("circles.h5", "r+") as circles:
        circles["radius"][7] = np.nan
    done = ran(program, "hdf5.nml", "-o", "hdf5.h5", "--force")
    assert done.returncode == USAGE
    assert "circles.h5: row 8: NaN is out of range" in done.stderr
    with h5py.File("circles.h5", "w") as circles:
        circles["centre"] = scatterers()[:, :2]
    done = ran(program, "hdf5.nml", "-o", "hdf5.h5", "--force")
    assert "circles.h5: has no dataset radius" in done.stderr


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x y radius\n1 1 0.2\n1 2 0\n", "circles.txt:3: 0 is not a radius"),
        ("x y radius\n\n1 1 0.2\n1 2\n", "circles.txt:4: 2 values; expected: x y radius"),
        ("x y radius\n1 1 O.2\n", 'circles.txt:2: "O.2" is not a number'),
        ("1 1 0.2\n", "circles.txt:1: the first line must name the columns, x y radius"),
        ("x y radius\n# none\n", "circles.txt: contains no obstacles"),
        (
            "radius y x\n0.1 2 3\n\n0.1 2 30 # far\n",
            "circles.txt:4: centre: the obstacle is outside",
        ),
    ],
)
def test_mistakes_in_a_file_are_named_with_their_line(program, folder, text, message):
    (folder / "circles.txt").write_text(text)
    done = ran(program, "many.nml", "-o", "many.h5")
    assert done.returncode == USAGE
    assert "obstacle.file: " + message in done.stderr


def test_a_script_makes_random_scatterers(program, tmp_path, monkeypatch):
    """The scatterers fill the printed box, and their positions depend on the seed."""
    monkeypatch.chdir(tmp_path)
    script, many = str(ROOT / "post/scatterers.py"), ["400", "0.01", "--radius", "0.9"]
    for seed in ("1", "2"):
        made = ran(sys.executable, script, *many, "--seed", seed, "-o", f"{seed}.txt")
        assert made.returncode == 0 and made.stdout == f"{seed}.txt: 400 circles, L = 200\n"
    one, two = (np.loadtxt(f"{seed}.txt", skiprows=1) for seed in (1, 2))
    assert one.shape == (400, 3) and (one[:, 2] == 0.9).all() and not np.any(one[:, 0] == two[:, 0])
    assert one[:, :2].min() > 0 and one[:, :2].max() < 200
    assert np.abs(one[:, :2].mean(axis=0) - 100).max() < 4 * 200 / np.sqrt(12 * 400)
    text = BOX.replace(f"{SIDE}, {SIDE}", "200, 200") + "&obstacle file = '1.txt' /"
    text += "&species count = 5 radius = 0.1 speed = 1 / &stop events = 200 /"
    assert ran(program, write_input(tmp_path, text)).returncode == FINISHED
    assert ran(sys.executable, script, "0", "0.01", "-o", "none.txt").returncode == 2


def test_a_run_does_not_go_on_among_other_obstacles(program, folder):
    assert ran(program, "many.nml", "-o", "many.h5").returncode == FINISHED
    more = ["many.nml", "-o", "many.h5", "--resume", "--set", "stop.events=3000"]
    (folder / "circles.txt").write_text(table("x y radius", scatterers()[::-1]))
    done = ran(program, *more)
    assert done.returncode == USAGE
    assert "obstacle.circles.centre" in done.stderr
    (folder / "circles.txt").write_text(table("x y radius", scatterers()))
    assert ran(program, *more).returncode == FINISHED


def test_too_many_groups_are_refused_in_one_line(program, tmp_path):
    text = "&obstacle centre = 0.5, 0.5 radius = 0.1 /\n" * 5003
    done = ran(program, write_input(tmp_path, text + "&species count = 1 /\n&stop time = 1 /"))
    assert done.returncode == USAGE
    assert done.stderr.count("more than 5000 groups") == 1
    assert "(file)" in done.stderr


def crowded(seed: int) -> str:
    """Return a random system of a few disks among many obstacles."""
    rng = np.random.default_rng(seed)
    edges, many = rng.permutation([4.0, 7.0]), int(rng.integers(30, 200))
    scale = np.sqrt(np.prod(edges) / many)
    periodic = rng.random(2) < 0.5
    falls = np.where(periodic | (rng.random(2) < 0.5), 0, rng.uniform(-1, 1, 2))
    kinds = ", ".join("'periodic'" if one else "'wall'" for one in periodic)
    text = [
        f"&box upper = {edges[0]}, {edges[1]} boundary = {kinds} gravity = {falls[0]}, {falls[1]} /"
    ]
    for x, y in rng.uniform(0, edges, (many, 2)):
        if rng.random() < 0.7:
            text += [f"&obstacle centre = {x}, {y} radius = {rng.uniform(0.05, 0.3) * scale} /"]
        else:
            end = np.clip((x, y) + rng.uniform(-1.5, 1.5, 2) * scale, 0, edges)
            text += [f"&wall from = {x}, {y} to = {end[0]}, {end[1]} /"]
    if not periodic[0] and rng.random() < 0.5:
        text += ["&side name = 'left' motion = 'sine' amplitude = 0.1 period = 1.3 /"]
    size = rng.uniform(0.02, 0.1) * scale
    gas = "velocities = 'maxwell' temperature = 1"
    text += [f"&species name = 'gas' count = {rng.choice([1, 3, 25])} radius = {size} {gas} /"]
    if rng.random() < 0.4:
        text += [f"&species name = 'big' count = 1 radius = {2.5 * size} {gas} /"]
    if rng.random() < 0.3:
        text += ["&contact restitution = 0.9 contact_time = 1e-6 /"]
    return "\n".join(
        [*text, "&stop events = 1200 time = 100 /", "&output frames_every_events = 20 /"]
    )


@pytest.mark.parametrize("seed", range(8))
def test_every_way_to_search_finds_the_same_among_many_obstacles(program, tmp_path, seed):
    path, found = write_input(tmp_path, crowded(seed)), []
    for name, *options in (
        ("cells",),
        ("pairs", "run.search=pairs"),
        ("heap", "run.queue=heap", "run.threads=2"),
    ):
        sets = [word for option in options for word in ("--set", option)]
        done = ran(program, path, "-o", tmp_path / f"{name}.h5", *sets)
        assert done.returncode == FINISHED, done.stderr
        with h5py.File(tmp_path / f"{name}.h5") as file:
            found += [
                [file[f"particles/disks/{what}/value"][()] for what in ("position", "velocity")]
            ]
    for other in found[1:]:
        assert all(map(np.array_equal, found[0], other))
