"""The reader of output files, and what all scripts answer to a wrong command line."""

import shutil
import subprocess
import sys
import venv
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from ricochet import Obstacle, RunError, read_run
from ricochet.drawing import draw_box, plt, radius_marks
from synthetic_run import ROOT, SCRIPTS, run_script, write_run
from whole_runs import FINISHED, write_input


@pytest.fixture
def small(tmp_path):
    """Three frames of two disks that move apart."""
    x = np.array([[[0.2, 0.5], [0.7, 0.5]], [[0.1, 0.5], [0.8, 0.5]], [[0.0, 0.5], [0.9, 0.5]]])
    v = np.array([[[-3.0, 4.0], [0.0, 1.0]]] * 3)
    return write_run(
        tmp_path / "small.h5",
        x,
        v,
        time=[0, 0.5, 1],
        mass=[2.0, 1.0],
        radius=[0.1, 0.2],
        species=[2, 1],
        names=("light", "heavy one"),
        edges=(2, 4),
        lower=(-1, -2),
        periodic=(True, False),
        image=np.array([[[0, 0], [0, 0]], [[0, 0], [1, 0]], [[-1, 0], [1, 0]]]),
        collisions=[[0, 0], [1, 0], [3, 2]],
        obstacles=[((0.5, 0.25), 0.2, 0)],
        observables={"collisions": [0, 2, 6], "all/kinetic_energy": [1.0, 2.0, 3.0]},
        parameters={
            "run": {"seed": 7},
            "contact": {"restitution": 0.5},
            "box": {"gravity": [0.0, -9.81]},
        },
    )


def test_constants_and_parameters(small):
    run = read_run(small)
    assert (run.count, run.frames, run.names) == (2, 3, ("light", "heavy one"))
    assert run.seed == 7 and run.restitution == 0.5
    np.testing.assert_array_equal(run.gravity, [0, -9.81])
    np.testing.assert_array_equal(run.upper, [1, 2])
    np.testing.assert_array_equal(run.periodic, [True, False])
    np.testing.assert_array_equal(run.of_species("heavy one"), [True, False])
    (obstacle,) = run.obstacles
    assert obstacle[1:] == Obstacle(None, 0.2, False)[1:]


def test_a_run_is_shown_in_one_line(small):
    run = read_run(small)
    assert repr(run) == f"<Run {small}: 1 light, 1 heavy one; 3 frames, t = 0 to 1>"


def test_derived_quantities(small):
    run = read_run(small)
    np.testing.assert_allclose(run.speed(0), [5, 1])
    np.testing.assert_allclose(run.kinetic_energy(-1), [25, 0.5])
    np.testing.assert_allclose(run.unwrapped(2), [[-2, 0.5], [2.9, 0.5]])
    np.testing.assert_allclose(run.displacement(2), [2.2, 2.2])
    np.testing.assert_allclose(run.displacement(slice(0, 2)), [[0, 0], [0.1, 2.1]])
    np.testing.assert_allclose(run.collisions_per_disk_at([0.25, 1.0]), [1, 6])


def test_frames_are_indexed_like_an_array(small):
    run = read_run(small)
    whole = run.position[:]
    assert whole.shape == (3, 2, 2)
    for index in (0, -1, slice(None, None, -1), slice(2, 0, -2), slice(1, 9), [2, -3]):
        np.testing.assert_array_equal(run.position[index], whole[index])
    np.testing.assert_array_equal(np.array(list(run.position)), whole)
    with pytest.raises(RunError, match="no frame 3, there are 3"):
        run.position[3]


def frames_seen_by_another_program(path):
    code = f"from ricochet import read_run; print(read_run({str(path)!r}).frames)"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT / "post"
    )
    return int(result.stdout) if result.returncode == 0 else result.stderr.splitlines()[-1]


def test_a_run_in_progress_is_read_up_to_its_last_committed_frame(tmp_path):
    x = np.zeros((5, 2, 2))
    path = write_run(tmp_path / "run.h5.part", x, x, committed=2)
    assert len(read_run(path).position[:]) == 2
    with h5py.File(path, "r+", locking=True) as writer:  # as the program holds it
        assert frames_seen_by_another_program(path) == 2
        writer["particles/disks/committed"][...] = 0
        writer.flush()
        assert "holds no frame yet" in frames_seen_by_another_program(path)
        for count in (6, 10**12, -1):
            writer["particles/disks/committed"][...] = count
            writer.flush()
            says = f"particles/disks/committed is {count}, but there are 5 samples"
            assert says in frames_seen_by_another_program(path)


def test_single_precision_is_computed_in_double(tmp_path):
    path = write_run(tmp_path / "run.h5", np.zeros((1, 1, 2)), np.ones((1, 1, 2)))
    with h5py.File(path, "r+") as file:
        del file["particles/disks/velocity/value"]
        file["particles/disks/velocity/value"] = np.ones((1, 1, 2), np.float32)
    assert read_run(path).speed(0).dtype == np.float64


def test_restitution_per_pair_of_species(tmp_path):
    x = np.zeros((1, 1, 2))
    for pairs, expected in (([0.5, 0.5, 0.5, 0.5], 0.5), ([0.5, 0.9, 0.9, 0.5], np.nan)):
        contact = {"restitution": 0.7, "pair_restitution": pairs}
        path = write_run(tmp_path / "run.h5", x, x, parameters={"contact": contact})
        np.testing.assert_equal(read_run(path).restitution, expected)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (["snapshot", "run.h5", "--cuont", "3"], "did you mean --count?"),
        (["snapshot", "run.h5", "--colour=sped"], "did you mean speed?"),
        (["animate", "run.h5", "--frames", "3"], "--frames 3 is a single frame; use --count"),
        (["player", "run.h5", "--frames=300"], "--frames 300 is a single frame; use --count"),
        (["player", "run.h5", "--disk", "1"], "--disk is now --disks"),
        (["export", "run.h5", "--every=2"], "--every is now --frames ::N"),
        (["trajectory", "run.h5", "--first", "2"], "--first is now --frames 0:N"),
        (["speeds", "run.h5", "--first", "2"], "--first is now --frames 0:N, or N: for"),
        (["gravity", "run.h5", "--after", "20"], "--after is now --skip X"),
        (["lyapunov", "run.h5", "--skip", "0.2"], "--skip is now --fit-from SHARE"),
        (["haff", "run.h5", "--out", "a.png"], "unknown argument --out; did you mean --output?"),
        (["snapshot", "rum.h5"], "no such file; did you mean run.h5?"),
    ],
)
def test_a_wrong_word_is_answered_by_the_right_one(small, monkeypatch, capsys, wrong, words):
    monkeypatch.chdir(small.parent)
    small.rename("run.h5")
    assert run_script(*wrong) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (["snapshot", "--frames", "0,a"], "'0,a' is not a list"),
        (["snapshot", "--frames", "::0"], "'::0' is not a list"),
        (["snapshot", "--frames", "0:1:1:1"], "'0:1:1:1' is not a list"),
        (["snapshot", "--frames", "-4:-5,3"], "no frame 3, there are 3"),
        (["snapshot", "--count", "0"], "'0' is not a whole number above 0"),
        (["animate", "--count", "-3"], "'-3' is not a whole number above 0"),
        (["trajectory", "--disks", "one"], "'one' is not a list"),
        (["trajectory", "--disks", "0"], "no disk 0"),
        (["export", "--count", "0.5"], "'0.5' is not a whole number above 0"),
    ],
)
def test_numbers_that_are_none_are_refused(small, capsys, wrong, words):
    script, *options = wrong
    assert run_script(script, small, *options) == 2
    said = capsys.readouterr().err
    assert words in said and "Traceback" not in said


@pytest.mark.parametrize("script", SCRIPTS)
def test_scripts_explain_themselves(script, capsys):
    assert run_script(script, "--help") == 0
    said = capsys.readouterr().out
    assert f"python post/{script}.py" in said and "--output" in said


def test_a_script_works_from_any_folder_and_without_a_display(small, tmp_path):
    result = subprocess.run(
        [sys.executable, ROOT / "post" / "snapshot.py", small, "-o", "new/a.png"],
        cwd=tmp_path,
        env={"PATH": "/usr/bin:/bin", "HOME": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "new" / "a.png").exists()


def test_after_set_up_python_finds_the_package_from_any_folder(tmp_path):
    """In a copy of what set-up reads, with a `.venv` that lacks no other package."""
    package = "post/ricochet/__init__.py"
    for name in (".ci/set-up", "requirements.txt", "tests/readers.txt", package):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    environment = tmp_path / ".venv"
    venv.create(environment, symlinks=True)
    (environment / "purposes").write_text("demo\n")
    wanted = [tmp_path / "requirements.txt", tmp_path / "tests" / "readers.txt"]
    (environment / "requirements.txt").write_text("".join(path.read_text() for path in wanted))
    subprocess.run([tmp_path / ".ci" / "set-up", "demo"], check=True)
    code = "from importlib.util import find_spec; print(find_spec('ricochet').origin)"
    command = [environment / "bin" / "python", "-c", code]
    found = subprocess.run(command, cwd="/", capture_output=True, text=True, check=True).stdout
    assert found.strip() == str(tmp_path / package)


def test_straight_walls_are_read_and_drawn_with_their_images(tmp_path):
    x = np.full((1, 1, 2), 0.5)
    path = write_run(tmp_path / "none.h5", x, x)
    assert read_run(path).walls.shape == (0, 2, 2)
    walls = [((0.1, 0.2), (0.9, 0.4)), ((0.5, 0.0), (0.5, 0.3))]
    for periodic, copies in (((False, False), 1), ((True, False), 3), ((True, True), 9)):
        run = read_run(write_run(tmp_path / "run.h5", x, x, walls=walls, periodic=periodic))
        np.testing.assert_array_equal(run.walls, walls)
        axes = plt.figure().add_subplot()
        draw_box(axes, run)
        drawn = [line.get_xydata() for line in axes.lines[4:]]  # the sides come first
        plt.close()
        assert len(drawn) == 2 * copies
        for wall in walls:
            for i in (-1, 0, 1) if periodic[0] else (0,):
                assert any(np.allclose(wall + np.array([i, 0]), line) for line in drawn)


def test_a_film_takes_the_ffmpeg_of_a_python_package(tmp_path, monkeypatch, capsys):
    still = np.zeros((2, 3, 2))
    film, path = tmp_path / "film.mp4", write_run(tmp_path / "run.h5", still, still)
    ffmpeg = tmp_path / "its-ffmpeg"
    ffmpeg.write_text('#!/bin/sh\nfor film; do :; done\ncat >"$film"\n')
    ffmpeg.chmod(0o755)
    with plt.rc_context({"animation.ffmpeg_path": "no-ffmpeg"}):
        monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)  # as if it were not installed
        assert run_script("animate", path, "-o", film) == 2
        assert "mp4 needs ffmpeg" in capsys.readouterr().err and not film.exists()
        package = SimpleNamespace(get_ffmpeg_exe=lambda: str(ffmpeg))
        monkeypatch.setitem(sys.modules, "imageio_ffmpeg", package)
        assert run_script("animate", path, "-o", film) == 0
    assert film.stat().st_size > 0


@pytest.mark.parametrize("script", [*SCRIPTS, "lab"])
def test_a_python_without_packages_is_told_where_they_are(script):
    command = [sys.executable, "-S", ROOT / "post" / f"{script}.py", "--help"]  # no site-packages
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 2 and run.stderr.count("\n") == 1
    assert run.stderr.startswith(f"{script}.py: ") and "has no numpy, h5py" in run.stderr
    assert f"{ROOT}/.venv/bin/python" in run.stderr


def test_frames_have_a_shape_and_are_arrays_for_numpy(tmp_path):
    x = np.arange(12.0).reshape(2, 3, 2)
    run = read_run(write_run(tmp_path / "a.h5", x, x, collisions=np.ones((2, 3), int)))
    assert run.position.shape == (2, 3, 2) and run.collisions.shape == (2, 3)
    assert np.array_equal(run.position, x) and np.mean(run.velocity) == x.mean()
    assert np.asarray(run.collisions, dtype=float).dtype == float


def test_a_run_knows_how_disks_turn_and_what_happens_at_walls(ricochet, tmp_path):
    text = """&side name = 'left' temperature = 2 / &wall name = 'w' from = 0.2, 0.2 to = 0.4, 0.3 /
    &contact tangential_restitution = 0.5 wall_rule = 'normal' /
    &species count = 20 radius = 0.03 temperature = 1 rotational_temperature = 1 /
    &stop time = 1 / &output frames_every_time = 0.1 event_log = .true. /"""
    write_input(tmp_path, text)
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    run = read_run(tmp_path / "gas.h5")
    assert set(run.elements) == {"angular_velocity", "orientation"}
    energy = 0.5 * np.mean(run.inertia * run.angular_velocity[:] ** 2, axis=1)
    assert run.observable("all/rotational_energy").value[-1] == pytest.approx(energy[-1])
    assert run.orientation[-1].any() and not run.orientation[0].any()
    assert {"sides/left/impulse", "walls/w/energy"} <= set(run.observables)
    assert run.observable("walls/w/impulse").value.shape[1:] == (2,)
    size = np.hypot(*run.events.momentum_change.T)
    assert size == pytest.approx(run.events.impulse)
    with pytest.raises(RunError, match="its frames have no wall_hits"):
        run.element("wall_hits")
    axes = plt.subplots()[1]
    marks = radius_marks(axes, run, run.frames - 1)
    dx, dy = np.transpose([b - a for a, b in marks.get_segments()])
    assert np.hypot(dx, dy) == pytest.approx(run.radius)
    turned = np.angle(np.exp(1j * (np.arctan2(dy, dx) - run.orientation[-1])))
    assert turned == pytest.approx(0)
