"""The program, run from Python with `ricochet.run`."""

import copy
import gc
import io
import multiprocessing
import pickle
import re
import signal
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import ricochet as package
from ricochet import ProgramError, program
from synthetic_run import ROOT
from whole_runs import PATIENCE, STOPPED, USAGE, differences, environment, is_asleep, ran, wait_for

THIRD = 0.1 / 3
#: Values of all kinds: repeated groups, strings with quotes, pairs, logicals, arrays of NumPy.
GROUPS = {
    "run": {"title": np.str_("it's a test"), "seed": np.array(5)},
    "box": {"lower": np.array([-1, 0], np.int8), "boundary": ["periodic", "wall"]},
    "species": (
        {"name": "light", "count": 20, "radius": np.float32(0.03125), "speed": np.longdouble(1)},
        {"name": "heavy", "position": np.array([[[-0.5, 0.2]], [[0.5, 0.8]]]), "radius": THIRD},
    ),
    "stop": {"collisions": 30},
    "output": {"event_log": np.bool_(True)},
}
TEXT = f"""&run title = 'it''s a test' seed = 5 /
&box lower = -1, 0 boundary = 'periodic', 'wall' /
&species name = 'light' count = 20 radius = 0.03125 speed = 1 /
&species name = 'heavy' position = -0.5, 0.2, 0.5, 0.8 radius = {THIRD!r} /
&stop collisions = 30 /
&output event_log = .true. /
"""


@pytest.fixture(autouse=True)
def its_program(program, monkeypatch, tmp_path):
    """Set the program under test, and use a new folder."""
    monkeypatch.setenv("RICOCHET", str(program))
    monkeypatch.chdir(tmp_path)


def test_a_dictionary_is_the_same_run_as_the_file(tmp_path, ricochet):
    (tmp_path / "gas.nml").write_text(TEXT)
    assert ricochet("gas.nml", "-o", "a.h5", "--set", "species.light.mass=2.5").returncode == 0
    heavier = {"species.light.mass": np.array(2.5)}
    run = package.run(GROUPS, heavier, tmp_path / "b.h5")
    assert run.parameter("run", "title") == "it's a test" and run.mass[0] == 2.5
    for system in "gas.nml", Path("gas.nml").read_text():
        of_file = package.run(system, overrides=heavier)
        np.testing.assert_array_equal(of_file.position[-1], run.position[-1])
    with pytest.raises(ValueError, match="from 1 to 1024, not 0"):
        package.run("gas.nml", threads=0)
    told = {"parameters/input", "parameters/overrides"}  # the same values in another notation
    assert {name.strip("/") for name in differences("a.h5", "b.h5")} <= told


@pytest.mark.parametrize("begin", [package.run, package.Simulation])
def test_what_the_program_says_names_variables_where_nobody_sees_lines(begin):
    one = {"massa": 1, "count": 1, "radius": 0.1}
    with pytest.raises(ProgramError, match=r"^specie: unknown group"):
        begin({"specie": one})
    with pytest.raises(ProgramError, match=r"^species\.massa: unknown") as failure:
        begin({"species": one, "stop": {"time": 1}})
    assert failure.value.code == USAGE and failure.value.message == str(failure.value)
    assert failure.value.path is None
    two = [{"name": name, "count": 9, "radius": size} for name, size in (("a", 0.01), ("b", -1))]
    with pytest.raises(ProgramError, match=r'^species\.b\.radius: "-1" is out of range'):
        begin({"run": {"seed": None}, "species": two, "stop": {"time": 1}})
    Path("gas.nml").write_text(TEXT)
    with pytest.raises(ProgramError, match=r"^\S+:3: species\.radius: is missing"):
        begin("gas.nml", {"species.light.radius": None})


def test_no_value_is_the_default_and_what_is_left_is_named(tmp_path):
    run = package.run(GROUPS, {"run.seed": None, "run.title": None}, threads=2, progress=False)
    assert run.seed == 1 and run.parameter("run", "title", "") == ""
    stuck = {"species": {"count": 20, "packing_fraction": 0.5, "temperature": 1}}
    stuck |= {"contact": {"restitution": 0.0}, "stop": {"time": 100}}
    with pytest.raises(ProgramError, match="collapse") as failure:
        package.run(stuck, output="stuck.h5")
    assert failure.value.path == Path("stuck.h5.part") and failure.value.path.exists()


def test_what_the_program_says_is_the_message(tmp_path):
    package.run(GROUPS, output="a.h5")
    with pytest.raises(ProgramError, match=r"a\.h5.*exists"):
        package.run(GROUPS, output="a.h5")
    others = {"run.seed": 6, "run.title": np.array("no"), "output.event_log": np.array(False)}
    run = package.run(GROUPS, others, "a.h5", force=True)
    assert run.seed == 6 and run.parameter("run", "title") == "no"
    assert not run.parameter("output", "event_log")


def test_nothing_is_left_of_a_run_without_output(tmp_path):
    code = "import ricochet, sys; print(ricochet.run(sys.argv[1]).path)"
    (tmp_path / "gas.nml").write_text(TEXT)
    paths = environment(PYTHONPATH=ROOT / "post")
    python = ran(sys.executable, "-c", code, "gas.nml", env=paths)
    assert (python.returncode, python.stderr) == (0, "")
    assert python.stdout.strip() and not Path(python.stdout.strip()).exists()
    assert [path.name for path in tmp_path.iterdir()] == ["gas.nml"]


def left(folder):
    """Return the folders of temporary runs."""
    return [path for path in folder.iterdir() if path.name.startswith("ricochet-")]


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """Return the folder for temporary files, which worker processes use, too."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setattr(tempfile, "tempdir", None)
    yield tmp_path / "tmp"
    tempfile.tempdir = None


def test_a_temporary_file_lives_as_long_as_something_reads_it(temporary):
    """A run, its frames and its copies use a temporary folder, unless an output is given."""
    run = package.run(GROUPS)
    again, frames = copy.deepcopy(run), run.velocity
    place = run.path
    del run
    assert place.exists() and again.observable("collisions")[-1] == 30
    del again
    assert np.isfinite(frames.mean()) and len(left(temporary)) == 1
    del frames
    gc.collect()
    assert not place.exists() and not left(temporary)
    package.run(GROUPS, output=temporary / "kept.h5")
    assert not left(temporary)
    with pytest.raises(ProgramError):
        package.run(GROUPS, {"contact.restitution": 2})
    assert not left(temporary)
    for _ in range(3):
        package.run(GROUPS)
        assert not left(temporary)


def number(seed):
    return package.run(GROUPS, {"run.seed": seed}).n_frames


def whole_run(seed):
    return package.run(GROUPS, {"run.seed": seed})


def mean_of(run):
    return float(run.velocity.mean())


def refused(seed):
    return package.run(GROUPS, {"contact.restitution": seed})


def test_worker_processes_leave_no_temporary_folders(temporary):
    """Worker processes remove temporary folders if they return numbers or runs, or fail."""
    here = package.run(GROUPS)
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        assert len(list(pool.map(number, range(1, 4)))) == 3 and len(left(temporary)) == 1
        runs = list(pool.map(whole_run, range(1, 4)))
        assert list(pool.map(mean_of, [here, here])) == 2 * [mean_of(here)]
        with pytest.raises(ProgramError, match="from 0 to 1") as caught:
            pool.submit(refused, 2).result()
        assert caught.value.code == USAGE
    assert [run.seed for run in runs] == [1, 2, 3]
    assert all(np.isfinite(run.velocity.mean()) for run in (*runs, here))
    del runs
    assert [path.samefile(here.path.parent) for path in left(temporary)] == [True]


class Notebook(io.StringIO):
    """Stream on which showing any progress interrupts Python, as a user may do in a notebook."""

    def isatty(self) -> bool:
        return True

    def write(self, text) -> int:
        if "collisions" in text:
            raise KeyboardInterrupt
        return super().write(text)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_progress_is_shown_and_an_interrupted_run_goes_on(tmp_path, monkeypatch, number):
    """A notebook interrupts only Python; the program ends whenever Python ends."""
    (tmp_path / "gas.nml").write_text(TEXT)
    endless = {"stop.collisions": 10**12, "output.event_log": False}  # a log would be too big
    code = f"import ricochet; ricochet.run('gas.nml', {endless}, 'long.h5')"
    paths = environment(PYTHONPATH=ROOT / "post")
    python = subprocess.Popen(
        [sys.executable, "-c", code], env=paths, stderr=subprocess.PIPE, text=True
    )
    try:
        wait_for(lambda: (tmp_path / "long.h5.part").exists() and is_asleep(python.pid))
        python.send_signal(number)
        said = python.communicate(timeout=PATIENCE)[1]
        assert ("KeyboardInterrupt" in said) == (number == signal.SIGINT)
        wait_for(lambda: not (tmp_path / "long.h5.lock").exists())
    finally:
        python.kill()
    monkeypatch.setattr(sys, "stderr", Notebook())
    with pytest.raises(KeyboardInterrupt):
        package.run("gas.nml", endless, "long.h5", resume=True)
    with pytest.raises(ProgramError, match="--resume") as stopped:
        package.run(
            *("gas.nml", endless | {"stop.wall_clock": 1e-9}, "long.h5"),
            resume=True,
        )
    assert stopped.value.code == STOPPED


NO_GROUP = "run: a group must be a dictionary or a list of dictionaries, not "
NO_VALUE = "run.seed: a value is a number, text, a bool, or a list of these, not "


@pytest.mark.parametrize(
    ("groups", "words"),
    [
        ({"run": 3}, NO_GROUP + "int"),
        ({"run": [{}, 3]}, NO_GROUP + "int"),
        ({"run": {"seed": [1, {}]}}, NO_VALUE + "dict"),
        ({"run": {"seed": np.array(1j)}}, NO_VALUE + "complex"),
        ({"run": {"seed": np.zeros(0)}}, "run.seed: the list is empty; omit the variable"),
    ],
)
def test_what_is_no_input_is_refused(groups, words):
    with pytest.raises(TypeError, match=re.escape(words)) as refused:
        package.run(groups)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("begin", [package.run, package.Simulation])
def test_overrides_may_be_nested_and_are_named_in_messages(begin):
    """A mapping stands for the common beginning of names; messages contain no options."""
    flat = {"contact.restitution": 0.8, "species.light.mass": 2, "run.seed": 7}
    nested = {"contact": {"restitution": 0.8}, "species": {"light": {"mass": 2}}, "run.seed": 7}
    one, other = begin(GROUPS, flat), begin(GROUPS, nested)
    assert one.parameters["contact"]["restitution"] == 0.8 and set(one.mass) == {1, 2}
    assert np.array_equal(one.velocity[:], other.velocity[:])
    with pytest.raises(ValueError, match=r"run\.seed: is given twice"):
        begin(GROUPS, {"run.seed": 1, "run": {"seed": 2}})
    for value, words in ((7, 'species.light.mass: "-1"'), (0, "species.light: unknown variable")):
        wrong = {"species.light.mass": -1} if value else {"species.light": None}
        with pytest.raises(ProgramError) as refused:
            begin(GROUPS, wrong)
        assert refused.value.message.startswith(words) and "--set" not in refused.value.message


@pytest.mark.parametrize("velocity", [None, (1, 2), [(k, -k) for k in range(3)]])
def test_disks_may_have_radii_and_masses_of_their_own(tmp_path, temporary, velocity):
    """The initial-configuration file is beside the output, so that the run can be resumed."""
    own = {"radius": np.array([0.01, 0.02, 0.03]), "mass": [1, 2, 0.1], "name": "odd"}
    own["position"] = [(0.2, 0.2), (0.5, 0.5), (0.8, 0.8)]
    own |= {"speed": 1} if velocity is None else {"velocity": velocity}
    system = {"species": [{"count": 2, "radius": 0.01, "speed": 1}, own], "stop": {"collisions": 2}}
    run = package.run(system, output=tmp_path / "out.h5")
    other, box = package.run(system), package.Simulation(system)
    for found in (run, other, box, pickle.loads(pickle.dumps(box))):
        assert found.radius[2:].tolist() == [0.01, 0.02, 0.03]
        assert found.mass[2:].tolist() == [1, 2, 0.1]
    place = np.array([other.position[0], run.position[0]])
    assert np.array_equal(place, [box.position] * 2) and place[0, 2:].tolist() == [
        *map(list, own["position"])
    ]
    if velocity is not None:
        assert np.array_equal(box.velocity[2:], np.broadcast_to(velocity, (3, 2)))
    assert (tmp_path / "out.h5.start-odd.txt").is_file()
    more = {"stop.collisions": 4}
    assert (
        package.run(system, more, tmp_path / "out.h5", resume=True).observable("collisions")[-1]
        == 4
    )
    with pytest.raises(TypeError, match=r"species.mass: .* need a position"):
        package.run({"species": {"count": 3, "mass": [1, 2, 3], "radius": 0.1}})
    with pytest.raises(ValueError, match="mass: of 2 disks, not of 3"):
        package.run({"species": own | {"mass": [1, 2]}})


def test_file_names_may_begin_with_a_dash(tmp_path):
    Path("-i.nml").write_text(TEXT)
    run = package.run("-i.nml", output="-o.h5")
    assert run.seed == 5 and (tmp_path / "-o.h5").exists()
    assert package.run(Path("-i.nml"), {"run.seed": 3}).seed == 3


def test_a_missing_program_is_named(monkeypatch, tmp_path):
    """The message gives the path in RICOCHET or, outside a clone, the search path."""
    monkeypatch.setenv("RICOCHET", "nowhere")
    with pytest.raises(ProgramError, match="no program ricochet at nowhere: run make"):
        package.run(GROUPS)
    monkeypatch.delenv("RICOCHET")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(program, "HERE", tmp_path / "lib/ricochet")
    with pytest.raises(ProgramError, match=r"^no program ricochet on PATH: run make install in a "):
        package.run(GROUPS)
