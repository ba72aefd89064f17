"""The reader of output files, and the answers of scripts to unusable files and arguments."""

import csv
import os
import re
import shutil
import signal
import sys
import venv
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from matplotlib.collections import LineCollection

from ricochet import RunError, read_run
from ricochet.reading.files import counted, did_you_mean
from ricochet.figures.drawing import draw_box, plt, radius_marks
from synthetic_run import ROOT, SCRIPTS, run_script, write_run
from whole_runs import FINISHED, MIXTURE, STOPPED
from whole_runs import executable, frames_in, ran, wait_for, write_input


def tiny(path, frames=1, count=1, **more):
    """Write a run of disks at rest."""
    x = np.zeros((frames, count, 2))
    return write_run(path, x, x, **more)


def test_a_part_of_a_name_suggests_the_shortest_name_that_contains_it():
    names = ["species1/temperature", "all/temperature", "virial"]
    assert did_you_mean("temp", names) == "; did you mean all/temperature?"
    assert did_you_mean("virail", iter(names)) == "; did you mean virial?"
    assert did_you_mean("xyz", names) == did_you_mean("a", names) == ""
    assert [counted(k, "frame") for k in range(3)] == ["0 frames", "1 frame", "2 frames"]


# --- what a run says ---


@pytest.fixture
def small(tmp_path):
    """Return three frames of two disks moving apart."""
    x = np.array([[[0.2, 0.5], [0.7, 0.5]], [[0.1, 0.5], [0.8, 0.5]], [[0.0, 0.5], [0.9, 0.5]]])
    return write_run(tmp_path / "small.h5", x, 0 * x, collisions=[[0, 0], [1, 0], [3, 2]])


def test_constants_are_those_of_the_input_and_energies_those_of_the_observables(simulated):
    run = simulated(FALLING + "&run seed = 7 / &stop time = 1 / " + BOTH.format(""))
    assert (run.n_disks, run.names, run.seed, run.restitution) == (16, ("A", "B"), 7, 1)
    np.testing.assert_array_equal([run.gravity, run.upper], [[0, -9.81], [4, 4]])
    for kind in run.by_species:
        energies = run.kinetic_energy(slice(None))[:, kind.disks].mean(axis=1)
        found = run.observable(f"{kind.name}/kinetic_energy").value
        np.testing.assert_allclose(energies, found, rtol=1e-9)
    assert repr(run) == f"<Run {run.path}: 8 A, 8 B; {run.n_frames} frames, t = 0 to 1>"


def test_frames_and_observables_are_values_in_expressions(small):
    """This applies to operators and functions, on either side, together with arrays."""
    run = read_run(small)
    time, value = energy = run.observable("all/kinetic_energy")
    for values, array in ((run.position, run.position[:]), (energy, value)):
        assert values.shape == array.shape and len(values) == len(array)
        pairs = [(values * 2, array * 2), (2 - values, 2 - array), (-values, -array)]
        pairs += [
            (values**2 / 3, array**2 / 3),
            (array + values, 2 * array),
            (values < 1, array < 1),
        ]
        pairs += [(values - values, 0 * array), (np.exp(values), np.exp(array))]
        for name in ("mean", "std", "sum", "min", "max"):
            pairs += [(getattr(values, name)(), getattr(array, name)())]
            pairs += [(getattr(values, name)(axis=0), getattr(array, name)(axis=0))]
            pairs += [(getattr(np, name)(values, axis=0), getattr(array, name)(axis=0))]
        for found, expected in pairs:
            assert type(found) is type(expected)
            np.testing.assert_array_equal(found, expected)
        with pytest.raises(TypeError):
            np.add(array, 1, out=values)
    assert energy[-1] == value[-1] and energy.time is time and energy.value is value
    np.testing.assert_array_equal(energy[:2], value[:2])
    assert repr(energy) == f"<Series of {len(value)} values, t = {time[0]:g} to {time[-1]:g}>"
    assert [frame.tolist() for frame in run.position] == run.position[:].tolist()


def test_a_run_is_a_sequence_of_frames(small):
    run = read_run(small)
    assert len(run) == run.n_frames == 3
    assert [frame.time for frame in run] == run.time.tolist()
    for frame in (*run, run[-1], run[0]):
        assert np.array_equal(frame.position, run.position[frame.index])
        assert np.array_equal(frame.speed, run.speed(frame.index))
    with pytest.raises(RunError, match="no frame 3 of 3"):
        run[3]


def test_frames_are_indexed_like_an_array_and_are_one_for_numpy(small):
    run = read_run(small)
    whole = run.position[:]
    assert whole.shape == run.position.shape == (3, 2, 2)
    assert (run.position.ndim, run.position.dtype) == (whole.ndim, whole.dtype)
    every, mask = slice(None), np.array([True, False, True])
    axes = ((..., 0), (every, 0), (-1, 1), (every, every, 1), (mask, 0), ([0, 2], [1, 0]))
    axes += ((0, every, [0, 1]), None, (), ([], 0), whole > 0.5, [[0], [2]])
    for index in (0, -1, slice(None, None, -1), slice(2, 0, -2), slice(1, 9), [2, -3], *axes):
        np.testing.assert_array_equal(run.position[index], whole[index])
    np.testing.assert_array_equal(np.array(list(run.position)), whole)
    np.testing.assert_array_equal(run.position, whole)
    assert np.asarray(run.event_count, dtype=float).dtype == float
    for index, words in ((3, "0 with size 3"), ((0, 2), "1 with size 2"), ("x", "only integers")):
        with pytest.raises(RunError, match=f"small.h5: position.*{words}"):
            run.position[index]


def frames_seen_by_another_program(path):
    code = f"from ricochet import read_run; print(read_run({str(path)!r}).n_frames)"
    result = ran(sys.executable, "-c", code, cwd=ROOT / "post")
    return int(result.stdout) if result.returncode == 0 else result.stderr.splitlines()[-1]


def test_a_run_in_progress_is_read_up_to_its_last_committed_frame(tmp_path):
    path = tiny(tmp_path / "run.h5.part", 5, 2, committed=2)
    assert len(read_run(path).position[:]) == 2
    with h5py.File(path, "r+", locking=True) as writer:  # as the program locks the file
        assert frames_seen_by_another_program(path) == 2
        for count, words in ((0, "holds no frame yet"), (6, "holds 5 of 6 samples")):
            writer["particles/disks/committed"][...] = count
            writer.flush()
            assert words in frames_seen_by_another_program(path)


def test_observables_that_are_read_while_a_run_goes_on_are_of_one_moment(tmp_path):
    path = tiny(tmp_path / "run.h5.part", 5)
    run, seen = read_run(path), []
    for count, name in ((3, "dissipated_energy"), (5, "all/kinetic_energy")):
        with h5py.File(path, "r+") as writer:
            writer["observables/committed"][...] = count
        seen.append(len(run.observable(name).time))
    assert seen == [3, 3] and len(read_run(path).observable(name).time) == 5


def test_restitution_per_pair_of_species(tmp_path):
    for pairs, expected in (([0.5, 0.5, 0.5, 0.5], 0.5), ([0.5, 0.9, 0.9, 0.5], np.nan)):
        contact = {"restitution": 0.7, "pair_restitution": pairs}
        run = read_run(tiny(tmp_path / "run.h5", parameters={"contact": contact}))
        np.testing.assert_equal(run.restitution, expected)


def test_straight_walls_are_read_and_drawn_with_their_images(tmp_path):
    assert read_run(tiny(tmp_path / "none.h5")).walls.shape == (0, 2, 2)
    walls = [((0.1, 0.2), (0.9, 0.4)), ((0.5, 0.0), (0.5, 0.3))]
    for periodic, copies in (((False, False), 1), ((True, False), 3), ((True, True), 9)):
        run = read_run(tiny(tmp_path / "run.h5", walls=walls, periodic=periodic))
        np.testing.assert_array_equal(run.walls, walls)
        axes = plt.figure().add_subplot()
        draw_box(axes, run)
        found = [some for some in axes.collections if isinstance(some, LineCollection)]
        found = [some for some in found if some.get_capstyle() == "projecting"]  # not the sides
        drawn = [line for some in found for line in some.get_segments()]
        plt.close()
        assert len(drawn) == 2 * copies
        for wall in walls:
            for i in (-1, 0, 1) if periodic[0] else (0,):
                assert any(np.allclose(wall + np.array([i, 0]), line) for line in drawn)


def test_a_run_knows_how_disks_turn_and_what_happens_at_walls(simulated):
    run = simulated("""&side name = 'left' temperature = 2 /
    &wall name = 'w' from = 0.2, 0.2 to = 0.4, 0.3 /
    &contact tangential_restitution = 0.5 wall_rule = 'normal' /
    &species count = 20 radius = 0.03 temperature = 1 rotational_temperature = 1 /
    &stop time = 1 / &output frames_every_time = 0.1 event_log = .true. /""")
    assert set(run.disk_data) == {"angular_velocity", "orientation"}
    energy = 0.5 * np.mean(run.inertia * run.angular_velocity[:] ** 2, axis=1)
    assert run.observable("all/rotational_energy").value[-1] == pytest.approx(energy[-1])
    assert run.orientation[-1].any() and not run.orientation[0].any()
    assert {"sides/left/impulse", "obstacles/w/energy_to_disks"} <= set(run.observables)
    assert run.observable("obstacles/w/impulse").value.shape[1:] == (2,)
    size = np.hypot(*run.event_log().momentum_change.T)
    assert size == pytest.approx(run.event_log().impulse)
    with pytest.raises(RunError, match="no wall_hits in its frames"):
        run.per_disk("wall_hits")
    axes = plt.subplots()[1]
    marks = radius_marks(axes, run, run.n_frames - 1)
    dx, dy = np.transpose([b - a for a, b in marks.get_segments()])
    assert np.hypot(dx, dy) == pytest.approx(run.radius)
    turned = np.angle(np.exp(1j * (np.arctan2(dy, dx) - run.orientation[-1])))
    assert turned == pytest.approx(0)


# --- files that cannot be used ---


def bad_files(folder) -> dict[str, str]:
    """Return unusable files, each with words of the expected message."""
    data = tiny(folder / "good.h5", 4, 50).read_bytes()
    (folder / "short.h5").write_bytes(data[: len(data) // 2])
    (folder / "empty.h5").touch()
    (folder / "text.h5").write_text("no HDF5 at all\n" * 100)
    (folder / "input.nml").write_text("&run /\n")
    (folder / "unfinished.h5.part").touch()
    with h5py.File(folder / "foreign.h5", "w") as file:
        file["x"] = 1
    with h5py.File(tiny(folder / "future.h5"), "r+") as file:
        file["h5md"].attrs["version"] = np.array([2, 0])
    with h5py.File(tiny(folder / "partial.h5"), "r+") as file:
        del file["particles/disks/velocity"], file["particles/disks/mass"]
    os.mkfifo(folder / "fifo")
    return {
        "empty.h5": "empty",
        "text.h5": "not an HDF5",
        "short.h5": "cut short",
        "input.nml": "is an input file; give its output: build/ricochet",
        "foreign.h5": "not of a Ricochet run",
        "future.h5": "version 2.0",
        "partial.h5": "not laid out as a Ricochet run",
        "missing.h5": "no such file",
        "unfinished.h5": "unfinished run",
        "": "folder",
        "fifo": "is a device, not a run",
    }


@pytest.mark.parametrize("script", SCRIPTS)
def test_scripts_answer_a_bad_file_with_one_line_and_exit_2(tmp_path, script, capsys):
    for name, words in bad_files(tmp_path).items():
        path = tmp_path / name
        assert run_script(script, *[path] * (2 if script == "lyapunov" else 1)) == 2
        said = capsys.readouterr().err
        assert said.startswith(f"{script}.py: {path}") and said.count("\n") == 1
        assert words in said


@pytest.mark.parametrize("mode", ["r", "r+"])
def test_a_file_that_the_same_process_has_open_is_not_called_damaged(tmp_path, mode):
    """h5py refuses an open file in another mode, or with other locking."""
    path = tiny(tmp_path / "good.h5")
    with h5py.File(path, mode), pytest.raises(RunError, match="this process has opened") as caught:
        read_run(path)
    assert read_run(path).n_disks
    assert "close it there first" in str(caught.value)
    (remedy,) = re.findall(r"h5py\.File\(.*\)", str(caught.value))
    with eval(remedy, {"h5py": h5py, "path": path}):
        assert read_run(path).n_disks


@pytest.fixture
def unfinished(ricochet, tmp_path) -> Path:
    """Return the output of a run stopped by its limit of wall time."""
    write_input(tmp_path, MIXTURE)
    run = ricochet("gas.nml", "-o", "gas.h5", "--set", "stop.wall_clock=1e-9")
    assert run.returncode == STOPPED
    return tmp_path / "gas.h5.part"


@pytest.mark.parametrize("cuts", [12, pytest.param(300, marks=pytest.mark.check)])
def test_a_file_cut_anywhere_is_refused(unfinished, ricochet, tmp_path, cuts):
    """The file is that of a finished or of an unfinished run."""
    assert ricochet("gas.nml", "-o", "whole.h5").returncode == FINISHED
    for whole in (unfinished, tmp_path / "whole.h5"):
        data, path = whole.read_bytes(), tmp_path / "cut.h5"
        for k in range(cuts):
            path.write_bytes(data[: k * len(data) // cuts])
            with pytest.raises(RunError, match=r"is empty|cut short") as caught:
                read_run(path)
            assert "\n" not in str(caught.value)


# --- runs that go on, or ended early ---

BOTH = "&output frames_every_time = 0.2 observables_every_time = 0.2 {}/\n"
OUTPUT = "&stop time = 1e5 / " + BOTH
SHORT = OUTPUT.format("")
LONGER = SHORT.replace("1e5", "1e6")  # for few disks
PAIR = "&species name = 'one' count = 1 radius = 0.1 position = {}, 0.3 velocity = 1, 0.3 /\n"
CHAOTIC = "&obstacle centre = 0.5, 0.7 radius = 0.2 /\n" + PAIR
LORENTZ = """&box boundary = 'periodic', 'periodic' / &obstacle centre = 0.5, 0.5 radius = 0.35 /
&species name = 'tracer' count = 1 radius = 0.1 position = 0, 0 velocity = 0.6, 0.8 /
"""
FALLING = """&box upper = 4, 4 gravity = 0, -9.81 /
&species name = 'A' count = 8 mass = 1 radius = 0.05 velocities = 'uniform' speed = 3 /
&species name = 'B' count = 8 mass = 2 radius = 0.05 velocities = 'uniform' speed = 3 /
"""
BULK = """&box boundary = 'periodic', 'periodic' /
&species name = 'gas' count = 64 packing_fraction = 0.3 temperature = 1 /
"""
CRATER = """&species name = 'bed' count = 40 radius = 0.04 region = 0, 1, 0, 0.5 /
&species name = 'projectile' mass = 25 radius = 0.1 position = 0.5, 0.75 velocity = 0, -5 /
"""
TARGET = "&species radius = 0.05 position = 0.8, 0.5 /\n"
ROUGH = "&contact tangential_restitution = 0.5 restitution = 0.9 /\n"
STEPS = "&run dynamics = 'steps' dt = 4e-3 /\n"
LOG = "helfand = .true. "
GENERIC = ("speeds", "snapshot", "animate", "energy", "trajectory", "export", "player", "cooling")
SETTLED = ("correlations", "equation_of_state", "rates", "melting", "transport")
SOON = ("--equilibration", "1", "--min-separation", "1")
FROM_HEIGHT = {"gravity": SOON[:2], "driven": ("--show", "height")}
REFILLED = """&box gravity = 0, -1 / &wall from = 0, 0.6 to = 0.4, 0.4 /
&wall from = 1, 0.6 to = 0.6, 0.4 / &species count = 30 radius = 0.02 region = 0, 1, 0.7, 1 /
&drive kind = 'recycle' interval = 0.05 velocity = 0, -0.5 from_region = 0, 1, 0, 0.3
to_region = 0, 1, 0.7, 1 / &contact restitution = 0.9 contact_time = 1e-4 /
"""
#: Inputs, and the scripts (with options) that draw their runs.
RUNNING = [
    ([MIXTURE.split("&contact")[0] + SHORT], dict.fromkeys(GENERIC, ()) | {"mixture": SOON}),
    ([FALLING + SHORT], FROM_HEIGHT | {"equipartition": (), "fields": ()}),
    ([CRATER + SHORT], {"crater": (), "crater_scan": ()}),
    ([PAIR.format(0.3) + TARGET + LONGER], {"scattering": ()}),
    ([BULK + OUTPUT.format(LOG)], dict.fromkeys(SETTLED, ())),
    ([BULK + OUTPUT.format("event_log = .true. ")], {"contacts": ()}),
    ([BULK + ROUGH + SHORT], {"rough": ()}),
    ([BULK + "&contact restitution = 0.9 /\n" + SHORT], {"haff": ()}),
    ([CHAOTIC.format(x) + LONGER for x in (0.3, 0.300001)], {"lyapunov": ("--largest", "0.1")}),
    ([REFILLED + SHORT], {"discharge": ("--after", "0")}),
    ([LORENTZ + LONGER], {"lorentz": ("--lags", "1", "3")}),
    ([FALLING + SHORT, FALLING + STEPS + SHORT], {"missed": SOON[:2]}),
]
ENDINGS = {"animate": "gif", "export": "xyz", "player": "html"}


@pytest.mark.parametrize("system", range(len(RUNNING)))
def test_running_simulations_are_drawn(started, tmp_path, system, capsys):
    """The simulation is suspended while the scripts read its file, and has not finished.

    All scripts that apply to a system draw their figures. The first and the fifth system take 5 to
    9 s, because nine and five scripts draw them.
    """
    texts, scripts = RUNNING[system]
    parts = []
    for k, text in enumerate(texts):
        process = started(write_input(tmp_path, text, f"{k}.nml"), "-o", f"{k}.h5")
        parts.append(tmp_path / f"{k}.h5.part")
        wait_for(lambda: frames_in(parts[-1], "observables") > 100)
        process.send_signal(signal.SIGSTOP)
    for script, options in scripts.items():
        figure = tmp_path / f"{script}.{ENDINGS.get(script, 'png')}"
        few = ("--count", "3") if script == "animate" else ()
        table = tmp_path / "new" / f"{script}.csv"
        numbers = () if script in ENDINGS else ("--csv", table)
        code = run_script(script, *parts, "-o", figure, *options, *few, *numbers)
        printed, said = capsys.readouterr()
        assert code == 0, said
        assert f"warning: {parts[0].name} is unfinished" in said
        assert ("(2 such)" in said) == (len(parts) == 2), "once, with their number"
        assert figure.stat().st_size > 0
        if numbers:
            data, lines = figure.read_bytes(), printed.splitlines()
            assert data.startswith(b"\x89PNG") and b"ricochet" in data[:3000], "its source"
            assert len(lines) > 1 and len(lines[0]) == len(lines[1]) > 10, "a table"
            rows = list(csv.DictReader(table.read_text().splitlines()))
            assert rows and all(None not in row and None not in row.values() for row in rows)


def test_every_script_draws_a_running_simulation():
    """Except `cost` and `scaling`, which require complete runs, and `coverage`."""
    drawn = {script for _, scripts in RUNNING for script in scripts}
    assert drawn == {*SCRIPTS} - {"cost", "coverage", "scaling"}


@pytest.mark.parametrize(
    ("name", "note", "said"),
    [
        ("a.h5", "", ""),
        ("a.h5", "cooled to nothing", "a.h5 ended early: cooled to nothing"),
        ("a.h5", "an inelastic collapse occurred: 9", "a.h5: an inelastic collapse occurred"),
        ("a.h5.part", "", "a.h5.part is unfinished: going on, stopped, or broken off"),
        ("a.h5.part", "an inelastic collapse", "broke off: an inelastic collapse; last"),
    ],
)
def test_a_run_that_met_no_stop_rule_says_so(tmp_path, monkeypatch, capsys, name, note, said):
    """The warning is printed, and drawn in red on the figure."""
    kinds = {"species": [1, 1, 2], "names": ("a", "b")} if note else {}  # with a legend
    run = tiny(tmp_path / name, 4, 3, provenance={"git_commit": "abc", "note": note}, **kinds)
    texts = []

    def shown(figure, *_):
        below = figure.legends[0].get_title().get_text() if note else figure.get_supxlabel()
        texts.append(below.replace("\n", " "))

    monkeypatch.setattr("ricochet.script.save", shown)
    assert run_script("snapshot", run) == 0
    warned = capsys.readouterr().err
    assert said in warned and said in texts[0] and bool(said) == bool(warned) == bool(texts[0])


def test_a_file_with_the_names_of_an_earlier_version_is_refused_in_one_line(tmp_path, capsys):
    path = tiny(tmp_path / "a.h5", 4, 3)
    with h5py.File(path, "r+") as file:
        file["observables"]["pressure"] = 0
    with pytest.raises(RunError, match=r"a\.h5: was written by an earlier version of Ri"):
        read_run(path)
    assert run_script("snapshot", path) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_of_an_ensemble_the_finished_members_are_taken_and_the_others_counted(tmp_path, capsys):
    """Members without files count if all files are given; the warning is printed once."""
    note = {"git_commit": "abc", "note": "cooled to nothing"}
    runs = [tiny(tmp_path / f"{k}.h5", 4 + k, 3, provenance=note) for k in range(3)]
    (tmp_path / "9.h5.part").touch()
    members = "".join(f"{k}\t--set run.seed={k}\n" for k in (0, 1, 2, 9, 10))
    (tmp_path / "manifest.txt").write_text(members)
    for given, told in (
        (runs, "3 of 5 runs; 2 unfinished: 9, 10"),
        ([*runs[:2], tmp_path / "9.h5.part"], "2 of 3 runs; 1 unfinished: 9"),
        (runs[:2], ""),
    ):
        assert run_script("trajectory", *given, "-o", tmp_path / "a.png") == 0
        said = capsys.readouterr().err
        assert told in said and ("unfinished" in said) == bool(told)
        assert f"warning: 0.h5 ended early: cooled to nothing ({len(given)} such)" in said or told
        assert said.count("cooled to nothing") == 1


# --- where results go ---

#: Scripts that write results in different ways, with the option and the file extension.
WRITERS = [
    ("snapshot", "-o", "png"),
    ("cooling", "--csv", "csv"),
    ("export", "-o", "xyz"),
    ("player", "-o", "html"),
    ("animate", "-o", "gif"),
]


def write_with(script, option, run, result):
    """Run a script that writes a result."""
    few = ["--count", "1"] if script == "animate" else []
    return run_script(script, run, option, result, *few)


@pytest.mark.parametrize(("script", "option", "ending"), WRITERS)
def test_a_full_disk_is_one_line(
    unfinished, small_disk, tmp_path, monkeypatch, capsys, script, option, ending
):
    monkeypatch.chdir(tmp_path)
    assert write_with(script, option, unfinished, small_disk(4) / f"a.{ending}") == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert said == f"{script}.py: cannot write the output: No space left on device"


@pytest.mark.parametrize(("script", "option", "ending"), WRITERS)
def test_results_are_written_into_files_of_ones_own(
    tmp_path, monkeypatch, capsys, script, option, ending
):
    """Links, FIFOs and runs are not written to; other hard links of a file keep its content."""
    monkeypatch.chdir(tmp_path)
    names = ("collisions", "all/kinetic_energy", "disk/kinetic_energy")
    run = tiny(Path("run.h5"), 4, 3, observables={name: np.arange(1.0, 5.0) for name in names})
    result, precious, before = Path(f"a.{ending}"), Path("precious"), run.read_bytes()

    def refused(words: str) -> bool:
        code = write_with(script, option, run, result)
        said = capsys.readouterr().err.splitlines()[-1]
        result.unlink()
        return code == 2 and said.startswith(f"{script}.py: {result}: ") and words in said

    precious.write_text("precious")
    for target in (precious, "dangling"):
        result.symlink_to(target)
        assert refused("not an ordinary file")
    os.mkfifo(result)
    assert refused("not an ordinary file")
    result.hardlink_to(run)
    assert refused("HDF5")
    result.hardlink_to(precious)
    assert write_with(script, option, run, result) == 0 and result.stat().st_size > 50
    assert write_with(script, option, run, result) == 0, "an ordinary file is replaced"
    assert precious.read_text() == "precious" and run.read_bytes() == before
    assert not Path("dangling").exists()


# --- words on the command line ---


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ("snapshot run.h5 --cuont 3", "did you mean --count?"),
        ("snapshot run.h5 --colour=sped", "did you mean speed?"),
        ("snapshot run.h5 --color=sped", "did you mean speed?"),
        ("speeds run.h5 --skip 5", "--skip is called --equilibration now"),
        ("speeds run.h5 --apart=5", "--apart is called --min-separation now"),
        ("correlations run.h5 --wave 5", "--wave is called --wavenumber now"),
        ("snapshot run.h5 --skip 5", "unknown argument --skip"),
        ("haff run.h5 --out a.png", "unknown argument --out; did you mean --output?"),
        ("haff run.h5 -o a.png --csv ./a.png", "a.png is the name of the figure, too"),
        ("snapshot run.h5 runs/old.h5", "takes one run, but runs/old.h5 is a second one"),
        ("snapshot rum.h5", "no such file; did you mean run.h5?"),
        ("snapshot runs/odl.h5", "no such file; did you mean runs/old.h5?"),
        ("snapshot odl", "no such file; did you mean runs/old.h5?"),
        ("snapshot xyz.h5", "xyz.h5: no such file\n"),
        ("snapshot run.h5 --frames 0,a", "'0,a' is not a list"),
        ("snapshot run.h5 --frames ::0", "'::0' is not a list"),
        ("snapshot run.h5 --frames 0:1:1:1", "'0:1:1:1' is not a list"),
        ("snapshot run.h5 --frames -4:-5,3", "no frame 3, there are 3"),
        ("snapshot run.h5 --count 0", "'0' is not a whole number above 0"),
        ("animate run.h5 --count -3", "'-3' is not a whole number above 0"),
        ("trajectory run.h5 --disks one", "'one' is not a list"),
        ("trajectory run.h5 --disks 0", "no disk 0"),
        ("fields run.h5 --cells 1", "the number of cells must be 2 to 100000"),
        ("fields run.h5 --cells 4 --grid 3,3", "not allowed with"),
        ("fields run.h5 --equilibration nan", "is not a number of at least 0"),
        ("export run.h5 --count 0.5", "'0.5' is not a whole number above 0"),
    ],
)
def test_a_wrong_word_is_answered_by_the_right_one(small, monkeypatch, capsys, wrong, words):
    monkeypatch.chdir(small.parent)
    small.rename("run.h5")
    Path("runs").mkdir()
    Path("runs/old.h5").touch()
    assert run_script(*wrong.split()) == 2
    said = capsys.readouterr().err
    assert words in said and "Traceback" not in said


@pytest.mark.parametrize("script", SCRIPTS)
def test_scripts_explain_themselves(script, capsys, monkeypatch):
    """A help text fits on a screen of 50 lines, and up to its options on 40."""
    monkeypatch.setenv("COLUMNS", "80")
    assert run_script(script, "--help") == 0
    said = capsys.readouterr().out
    assert f"python post/{script}.py" in said and "--output" in said
    before, _, _ = said.partition("positional arguments:")
    assert before.count("\n") <= 40 and said.count("\n") <= 50


# --- where scripts and packages are ---


def test_a_script_works_from_any_folder_and_without_a_display(small, tmp_path):
    command = [sys.executable, ROOT / "post" / "snapshot.py", small, "-o", "new/a.png"]
    bare = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path)}
    result = ran(*command, cwd=tmp_path, env=bare)
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "new" / "a.png").exists()


def test_after_set_up_python_finds_the_package_from_any_folder(tmp_path):
    """The test uses a copy of the files that set-up reads, and a complete `.venv`."""
    package = "post/ricochet/__init__.py"
    for name in (
        ".ci/set-up",
        "src/find_h5fc.sh",
        "src/progress.sh",
        "requirements.txt",
        "tests/readers.txt",
        package,
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    own = tmp_path / ".venv"
    venv.create(own, symlinks=True)
    (own / "purposes").write_text("demo\n")
    wanted = [tmp_path / "requirements.txt", tmp_path / "tests" / "readers.txt"]
    (own / "requirements.txt").write_text("".join(path.read_text() for path in wanted))
    ran(tmp_path / ".ci" / "set-up", "demo", check=True)
    code = "from importlib.util import find_spec; print(find_spec('ricochet').origin)"
    found = ran(own / "bin" / "python", "-c", code, cwd="/", check=True).stdout
    assert found.strip() == str(tmp_path / package)


def test_a_film_takes_the_ffmpeg_of_a_python_package(tmp_path, monkeypatch, capsys):
    film, path = tmp_path / "film.mp4", tiny(tmp_path / "run.h5", 2, 3)
    ffmpeg = executable(tmp_path / "its-ffmpeg", 'for film; do :; done\ncat >"$film"')
    with plt.rc_context({"animation.ffmpeg_path": "no-ffmpeg"}):
        monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)  # as if it were not installed
        assert run_script("animate", path, "-o", film) == 2
        way = f"mp4 needs ffmpeg: `{sys.executable} -m pip install imageio-ffmpeg`, or write a"
        assert way in capsys.readouterr().err and not film.exists()
        package = SimpleNamespace(get_ffmpeg_exe=lambda: str(ffmpeg))
        monkeypatch.setitem(sys.modules, "imageio_ffmpeg", package)
        assert run_script("animate", path, "-o", film) == 0
    assert film.stat().st_size > 0


@pytest.mark.parametrize("script", [*SCRIPTS, "lab"])
def test_a_python_without_packages_is_told_where_they_are(script):
    run = ran(sys.executable, "-S", ROOT / f"post/{script}.py", "--help")  # no site-packages
    assert run.returncode == 2 and run.stderr.count("\n") == 1
    assert run.stderr.startswith(f"{script}.py: ") and "has no numpy, h5py" in run.stderr
    assert f"{ROOT}/.venv/bin/python" in run.stderr
