"""Tests of sweeps from Python, and of tables of member runs."""

import multiprocessing
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from ricochet import ProgramError, RunError, ensemble, read_run, sweep
from ricochet.running.ensembles import typed
from slurm_substitute import slurm_surroundings
from whole_runs import environment, executable, ran

ROOT = Path(__file__).resolve().parents[2]
GAS = """&box boundary = 'wall', 'wall' /
&species name = 'a' count = 30 radius = 0.03 temperature = 1 /
&stop collisions_per_disk = 5 /
"""
VALUES = {"contact.restitution": [0.8, 0.95], "species.a.velocity": [(1, -1)], "run.seed": [1, 2]}


@pytest.fixture
def _tools(program, monkeypatch):
    monkeypatch.setenv("RICOCHET", str(program))


@pytest.mark.usefixtures("_tools")
def test_a_sweep_and_the_script_go_on_with_each_others_members(tmp_path):
    """A sweep from Python and ensemble.sh can continue each other's member runs."""
    text = GAS.replace("temperature = 1", "")
    table = sweep(text, VALUES, tmp_path)
    assert table.member[0] == "restitution_0.8_a.velocity_1_-1_seed_1"
    assert [*table.state] == 4 * ["finished"] and [*table.seed] == [1, 2, 1, 2]
    assert [*table["contact.restitution"]] == [0.8, 0.8, 0.95, 0.95]
    assert table["species.a.velocity"][0] == (1, -1) and table["collisions"].min() >= 75
    script = [ROOT / "runs/ensemble.sh", tmp_path / "input.nml", "-d", tmp_path]
    scans = ["contact.restitution=0.8,0.95", "species.a.velocity=1,-1;0,1", "run.seed=1,2"]
    told = ran(*script, *(word for scan in scans for word in ("--scan", scan)))
    assert told.returncode == 0 and "8 of 8 members finished, 4 of them before" in told.stderr
    # A fork of this process would copy locks that other threads may hold.
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        again = sweep(text, {**VALUES, "species.a.velocity": [(1, -1), (0, 1)]}, tmp_path, pool)
    assert len(again) == 8 and set(again.state) == {"finished"}
    with pytest.raises(RunError, match="another input"):
        sweep(text.replace("count = 30", "count = 31"), VALUES, tmp_path)
    assert [*sweep(f"{text}! changed", VALUES, tmp_path).wall_time] == [*again.wall_time]


def test_a_sweep_uses_only_the_cores_that_it_was_assigned():
    """A job on a cluster may use only some cores of its machine."""
    one = "os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})"
    code = f"import os; {one}; from ricochet.running.ensembles import cores; print(cores())"
    assert ran(sys.executable, "-c", code).stdout.split() == ["1"]


@pytest.mark.usefixtures("_tools")
def test_finished_members_are_extended_with_the_same_bits(program, tmp_path):
    """This happens if the sweep has a later end."""
    values = {"contact.restitution": [0.9, 1], "run.seed": [1, 2]}
    longer = GAS.replace("disk = 5", "disk = 9") + "&output frames_every_time = 0.1 /\n"
    whole = sweep(longer, values, tmp_path / "whole")
    sweep(GAS, {**values, "run.seed": 1}, tmp_path / "grown")
    grown = sweep(longer, values, tmp_path / "grown")
    names = ["member", "collisions", "time", "total_energy", "virial"]
    names = [name for name in names if name in whole]
    assert grown[names].equals(whole[names]) and set(grown.state) == {"finished"}
    for name in whole.member:
        one, other = (read_run(tmp_path / folder / f"{name}.h5") for folder in ("whole", "grown"))
        assert np.array_equal(one.position[-1], other.position[-1])
        assert np.array_equal(one.velocity[-1], other.velocity[-1])
    before = [path.read_bytes() for path in sorted((tmp_path / "grown").glob("*.h5"))]
    again = sweep(GAS, values, tmp_path / "grown")
    assert again[names].equals(whole[names]) and set(again.state) == {"finished"}
    assert before == [path.read_bytes() for path in sorted((tmp_path / "grown").glob("*.h5"))]


@pytest.mark.usefixtures("_tools")
def test_the_script_extends_finished_members_with_the_same_bits(tmp_path):
    """This happens if the input or --set specifies a later end."""
    (tmp_path / "gas.nml").write_text(GAS)

    def run(folder, *words):
        script = [ROOT / "runs/ensemble.sh", tmp_path / "gas.nml", "-d", tmp_path / folder]
        return ran(*script, "--seeds", "1-3", *words)

    last = "stop.collisions_per_disk="
    assert run("whole", "--set", f"{last}9").returncode == 0
    assert run("set").returncode == run("input").returncode == 0
    told = run("set", "--set", f"{last}9")
    assert told.returncode == 0 and "3 of 3 members finished, 0 failed" in told.stderr
    (tmp_path / "gas.nml").write_text(GAS.replace("disk = 5", "disk = 9"))
    told = run("input")
    assert told.returncode == 0 and "3 of 3 members finished, 0 failed" in told.stderr
    for folder in ("set", "input"):
        for name in ("seed_1", "seed_2", "seed_3"):
            runs = [read_run(tmp_path / place / f"{name}.h5") for place in ("whole", folder)]
            assert np.array_equal(*(one.position[-1] for one in runs))
            assert np.array_equal(*(one.velocity[-1] for one in runs))
    (tmp_path / "gas.nml").write_text(GAS)
    before = (tmp_path / "input/seed_1.h5").read_bytes()
    told = run("input")
    assert told.returncode == 0 and "3 of 3 members finished" in told.stderr
    assert (tmp_path / "input/seed_1.h5").read_bytes() == before
    assert "3 of them before" in run("input").stderr
    assert run("set", "--set", "species.a.count=31").returncode == 2
    (tmp_path / "gas.nml").write_text(GAS.replace("count = 30", "count = 31"))
    assert run("input").returncode == 2


@pytest.mark.parametrize("engine", ["pool", "parallel", "slurm"])
@pytest.mark.parametrize("interrupted", [False, True])
def test_every_engine_extends_finished_members(program, tmp_path, engine, interrupted):
    """The bits are those of one long run, even after an interrupted extension."""
    if engine == "parallel" and not shutil.which("parallel"):
        pytest.skip("GNU parallel is not installed")
    own = slurm_surroundings(tmp_path) if engine == "slurm" else {}
    (tmp_path / "gas.nml").write_text(GAS)
    last = ["--set", "stop.collisions_per_disk=9"]

    def command(folder, *words):
        script = [ROOT / "runs/ensemble.sh", tmp_path / "gas.nml", "-d", tmp_path / folder]
        return list(map(str, [*script, "--seeds", "1-3", *words]))

    def once(*words):
        return ran(*command(*words), env=environment(RICOCHET=program, **own))

    def run(*words):
        """Repeat a command that has submitted its members until it reports their results."""
        done = once(*words)
        return run(*words) if "submitted" in done.stderr else done

    assert run("whole", *last).returncode == run("grown").returncode == 0
    chosen = [*last, "--engine", engine]
    if interrupted:
        stop = ["--set", "stop.wall_clock=1e-9", "--set", "output.observables_every_events=1"]
        assert once("grown", *chosen, *stop).returncode == 75
        assert len([*(tmp_path / "grown").glob("seed_?.h5.part")]) == 3
    told = run("grown", *chosen)
    assert told.returncode == 0 and "3 of 3 members finished" in told.stderr, told.stderr
    for name in ("seed_1", "seed_2", "seed_3"):
        runs = [read_run(tmp_path / place / f"{name}.h5") for place in ("whole", "grown")]
        assert np.array_equal(*(one.position[-1] for one in runs))
        assert np.array_equal(*(one.velocity[-1] for one in runs))
    assert "3 of them before" in run("grown", *chosen).stderr


@pytest.mark.usefixtures("_tools")
def test_what_a_member_would_refuse_is_refused_before_any_runs(tmp_path):
    with pytest.raises(ProgramError, match="from 0 to 1"):
        sweep(GAS, {"contact.restitution": [1, 2]}, tmp_path)
    with pytest.raises(ProgramError, match="no rule ends a member"):
        sweep(GAS, {"stop.collisions_per_disk": None}, tmp_path)
    with pytest.raises(ValueError, match="no values"):
        sweep(GAS, {}, tmp_path)
    assert not [*tmp_path.iterdir()]


@pytest.mark.usefixtures("_tools")
@pytest.mark.parametrize("engine", ["pool", "parallel"])
@pytest.mark.parametrize(
    ("scans", "refused"),
    [
        (["contact.restituton=0.9,0.8"], "restituton_0.9_seed_1"),
        (["contact.restitution=0.9,2"], "restitution_2_seed_1"),
        (["contact.restitution=0.9", "run.threads=1,x"], "restitution_0.9_threads_x_seed_1"),
    ],
)
def test_the_script_starts_no_member_if_the_program_refuses_a_value(
    tmp_path, scans, refused, engine
):
    """The values are checked before the folder and the list of members are written."""
    (tmp_path / "gas.nml").write_text(GAS)
    options = [word for scan in scans for word in ("--scan", scan)]
    script = [ROOT / "runs/ensemble.sh", tmp_path / "gas.nml", "-d", tmp_path / "out"]
    told = ran(*script, *options, "--seeds", "1-2", "--engine", engine)
    assert told.returncode == 2 and told.stderr.count("\n") == 1
    assert f"member {refused} cannot run: --set " in told.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("_tools")
def test_members_that_did_not_finish_say_why(tmp_path):
    sweep(GAS, {"run.seed": [1, 2, 3]}, tmp_path)
    (tmp_path / "seed_1.h5").rename(tmp_path / "seed_1.h5.part")
    (tmp_path / "seed_1.log").write_text("stopped at time 1\n")
    (tmp_path / "seed_2.h5").unlink()
    (tmp_path / "seed_2.log").write_text("seed_2: no room\n")
    (tmp_path / "seed_3.h5").write_text("no HDF5")
    table = ensemble(tmp_path)
    assert [*table.state] == ["unfinished", "failed", "failed"]
    assert table.reason[1] == "seed_2: no room" and "not an HDF5 file" in table.reason[2]
    command = [sys.executable, ROOT / "post/gather.py", tmp_path, "--csv", tmp_path / "a.csv"]
    told = ran(*command, check=True)
    assert "3 members: 2 failed, 1 unfinished" in told.stderr
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 4


def test_a_member_that_was_killed_says_so_and_one_that_failed_may_be_mended(
    program, tmp_path, monkeypatch
):
    monkeypatch.setenv("RICOCHET", str(executable(tmp_path / "killed", "kill -9 $$", "bash")))
    table = sweep(GAS, {"run.seed": [1]}, tmp_path / "runs")
    host = re.escape(os.uname().nodename)
    assert table.state[0] == "unfinished"
    assert re.fullmatch(rf"killed by signal 9 \(out of memory\?\), .* on {host}", table.reason[0])
    for state in ("unfinished", "failed"):
        assert sweep(GAS, {"run.seed": [1]}, tmp_path / "runs").state[0] == state
    assert ensemble(tmp_path / "runs").reason[0].startswith("given up after three attempts: killed")
    monkeypatch.setenv("RICOCHET", str(program))
    assert sweep(GAS, {"run.seed": [1]}, tmp_path / "runs").state[0] == "finished"
    heap = GAS.replace("'wall' /", "'wall' gravity = 0, -1 /").replace("= 5 ", "= 5000 ")
    heap = f"{heap}&contact restitution = 0.3 /"
    for _ in range(2):
        table = sweep(heap, {"run.seed": [1]}, tmp_path / "heap")
        assert table.state[0] == "failed" and "collapse" in table.reason[0]
    assert sweep(GAS, {"run.seed": [1]}, tmp_path / "heap").state[0] == "finished"


@pytest.mark.usefixtures("_tools")
def test_a_value_may_be_one_or_none(tmp_path):
    values = {"run.title": "it's, or not", "contact.restitution": [0.8, None], "run.seed": 3}
    table = sweep(GAS, values, tmp_path)
    assert [*table.state] == 2 * ["finished"] and [*table.seed] == [3, 3]
    assert [*table["contact.restitution"].isna()] == [False, True]
    assert set(table["run.title"]) == {"it's, or not"}


TEXTS = ["a b", "a_b", "a, b", "a,b", "x --set run.seed=7", "it's --set", "''", "a/b", "1,2"]


@pytest.mark.usefixtures("_tools")
def test_texts_reach_the_program_as_they_are(tmp_path):
    """Texts are passed unchanged, and each text defines a separate member run."""
    first = sweep(GAS, {"run.title": TEXTS[1::2], "run.seed": 3}, tmp_path)
    for path in tmp_path.glob("*.h5"):
        path.unlink()  # the script is to run it
    told = ran(ROOT / "runs/ensemble.sh", tmp_path / "input.nml", "-d", tmp_path,
               "--manifest", tmp_path / "manifest.txt")  # fmt: skip
    assert told.returncode == 0, told.stderr
    table = sweep(GAS, {"run.title": TEXTS, "run.seed": 3}, tmp_path)
    assert set(first.member) < set(table.member) and set(table.state) == {"finished"}
    assert sorted(table["run.title"]) == sorted(TEXTS) and set(table.seed) == {3}
    for name, title in zip(table.member, table["run.title"], strict=True):
        assert read_run(tmp_path / f"{name}.h5").parameters["run"]["title"] == title


@pytest.mark.usefixtures("_tools")
def test_values_of_several_variables_may_belong_together(tmp_path):
    """A list of dictionaries specifies the values of several variables for each member run."""
    linked = [
        {"contact": {"restitution": xi}, "stop.collisions": n} for xi, n in ((0.9, 5), (1, 9))
    ]
    table = sweep(GAS, [*linked, {"run.seed": [3, 4]}], tmp_path)
    assert [*table["contact.restitution"]][:2] == [0.9, 1] and [*table.collisions][:2] == [5, 9]
    assert [*table.seed][2:] == [3, 4] and len(table) == 4
    with pytest.raises(ProgramError, match="from 0 to 1"):
        sweep(GAS, [{"run.seed": 1}, {"contact.restitution": 2}], tmp_path / "no")
    with pytest.raises(ValueError, match="no values"):
        sweep(GAS, [], tmp_path / "no")


@pytest.mark.usefixtures("_tools")
def test_a_folder_that_cannot_be_used_is_named_in_one_line(tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "log").mkdir()
    (tmp_path / "log/seed_1.log").symlink_to(tmp_path / "seed_1.log")
    long = {"run.title": 30 * "very " + "long" + 30 * " text"}
    for values, place, words in (
        ({"run.seed": 1}, "file", "cannot be a folder"),
        ({"run.seed": 1}, "log", "is a link; remove it"),
        (long, "long", "allowed: 200"),
    ):
        with pytest.raises(RunError, match=words) as caught:
            sweep(GAS, values, tmp_path / place)
        assert "\n" not in str(caught.value)
    assert not (tmp_path / "long").exists() and not (tmp_path / "seed_1.log").exists()


def test_a_missing_package_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="pip install pandas"):
        sweep(GAS, {"run.seed": 1}, tmp_path / "new")
    with pytest.raises(ImportError, match="pip install pandas"):
        ensemble(tmp_path)
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT])
@pytest.mark.parametrize("pool", ["ThreadPoolExecutor", "ProcessPoolExecutor"])
def test_a_python_that_ends_leaves_checkpoints_and_no_process(program, tmp_path, pool, end):
    (tmp_path / "gas.nml").write_text(GAS.replace("collisions_per_disk = 5", "events = 2000000000"))
    call = f"""
import ricochet, signal
from concurrent.futures import {pool}
signal.signal(signal.SIGINT, signal.default_int_handler)
with {pool}(2) as pool:
    ricochet.sweep('gas.nml', {{'run.seed': [1, 2, 3]}}, 'runs', pool)"""
    environment = {**os.environ, "RICOCHET": str(program), "PYTHONPATH": str(ROOT / "post")}
    way = {"cwd": tmp_path, "env": environment, "stderr": subprocess.PIPE}
    python = subprocess.Popen([sys.executable, "-c", call], **way)
    parts = [tmp_path / f"runs/seed_{k}.h5.part" for k in (1, 2)]
    wait_until(lambda: all(part.exists() for part in parts))
    python.send_signal(end)
    python.wait()
    logs = [tmp_path / f"runs/seed_{k}.log" for k in (1, 2)]
    wait_until(lambda: all("stopped" in log.read_text() for log in logs))
    python.stderr.read()  # until workers have closed it, too
    assert not [*tmp_path.glob("runs/seed_3*")]


def wait_until(there) -> None:
    """Wait until a condition holds, with a long limit for busy machines."""
    for _ in range(6000):
        if there():
            return
        time.sleep(0.1)
    pytest.fail("it has never come")


@pytest.mark.parametrize(
    ("word", "value"), [("3", 3), ("1d-2", 0.01), (".true.", True), ("0,-1", (0, -1)), ("'x'", "x")]
)
def test_overrides_have_their_types(word, value):
    assert typed(word) == value and type(typed(word)) is type(value)


@pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to])
def test_nothing_is_written_through_a_link(tmp_path, link):
    """The sweep does not write through symbolic links, or to files with several hard links."""
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "runs").mkdir()
    link(tmp_path / "runs/seed_1.log", tmp_path / "mine")
    with pytest.raises((RunError, OSError)):
        sweep(GAS, {"run.seed": [1]}, tmp_path / "runs")
    assert (tmp_path / "mine").read_text() == "mine"
