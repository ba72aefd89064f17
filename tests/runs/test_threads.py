"""One run on several cores: the bits of one core, whatever is written and however it is stopped."""

import os
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import pytest

from whole_runs import (
    BROKEN,
    FILES,
    FINISHED,
    PATIENCE,
    STOPPED,
    USAGE,
    differences,
    let_work,
    write_input,
)

CHECK = pytest.mark.check
INPUTS = Path(__file__).resolve().parents[2] / "input"

#: So many that four cores share a periodic box.
GAS = "&species name = 'gas' count = 10000 packing_fraction = {} placement = '{}' temperature = 1 /"
BIG = "&species name = 'big' count = 3 radius = 0.03 mass = 9 temperature = 1 /\n"
WALLS = "&box /"
PERIODIC = "&box boundary = 'periodic', 'periodic' /"
CHANNEL = "&box boundary = 'periodic', 'wall' gravity = 0, -1 /"
PEGS = (
    "&obstacle centre = 0, 0.5 radius = 0.05 / &obstacle centre = 0.7, 0.3 radius = 0.1 /"
    "&wall from = 0.1, 0.1 to = 0.4, 0.2 /"
)
TC = "&contact restitution = 0.9 wall_restitution = 0.95 contact_time = 1e-5 /"
LOG = " event_log = .true. /"
SYSTEMS = {
    "gas": [
        WALLS,
        GAS.format(0.5, "lattice"),
        "&stop time = 0.1 / &output frames_every_time = 0.02 /",
    ],
    "thin": [
        PERIODIC,
        GAS.format(0.1, "random"),
        "&stop events = 60000 / &output observables_every_events = 1111" + LOG,
    ],
    "dense": [
        PERIODIC,
        GAS.format(0.7, "lattice"),
        "&stop collisions = 80000 / &output frames_every_collisions = 7001 /",
    ],
    "pegs": [
        CHANNEL,
        PEGS,
        TC,
        BIG,
        GAS.format(0.3, "random"),
        "&stop time = 0.2 / &output frames_every_time = 0.07 observables_every_collisions = 500"
        + LOG,
    ],
    "cooling": [
        PERIODIC,
        "&contact restitution = 0.8 /",
        GAS.format(0.3, "random"),
        "&stop energy_fraction = 0.3 / &output observables_every_collisions = 997 /",
    ],
    "aligned": [
        WALLS,
        GAS.format(0.2, "lattice").replace("temperature = 1", "velocities = 'uniform'"),
        "&stop collisions_per_disk = 4 / &output frames_every_events = 3001"
        " observables_every_collisions_per_disk = 0.037" + LOG,
    ],
}


def run(program, folder, name, *options):
    command = [program, "gas.nml", "-o", name, "--quiet", *options]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=PATIENCE)


@pytest.fixture(params=SYSTEMS)
def whole(request, program, tmp_path):
    """A folder with a run on one core."""
    write_input(tmp_path, "\n".join(SYSTEMS[request.param]) + "\n")
    assert run(program, tmp_path, "one.h5", "--set=run.threads=1").returncode == FINISHED
    return tmp_path


@pytest.mark.parametrize("threads", [2, pytest.param(3, marks=CHECK), pytest.param(4, marks=CHECK)])
def test_threads_change_no_bit(program, whole, threads):
    done = run(program, whole, "many.h5", f"--set=run.threads={threads}")
    assert done.returncode == FINISHED, done.stderr
    assert differences(whole / "one.h5", whole / "many.h5") == []


@CHECK
def test_a_run_goes_on_with_other_threads(program, whole):
    """Stopped at random moments by a signal; the end is that of one core."""
    rng = random.Random(3)
    for k in range(20):
        resume = ["--resume"] if list(whole.glob("parts*.chk.h5")) else []
        threads = f"--set=run.threads={rng.randint(1, 4)}"
        command = [program, "gas.nml", "-o", "parts.h5", "--quiet", threads, *resume]
        process = subprocess.Popen(command, cwd=whole, stderr=subprocess.PIPE, text=True)
        if k < 8:
            let_work(process, rng.uniform(0, 0.4))
            process.terminate()
        message = process.communicate()[1]
        if process.returncode == FINISHED:
            break
        assert process.returncode == STOPPED, message
    assert differences(whole / "one.h5", whole / "parts.h5") == []


COUNT = re.compile(r"^( *count = )(\d+)", re.MULTILINE)
RADIUS = re.compile(r"^( *radius = )([\d.]+)", re.MULTILINE)


def scaled(text, disks):
    """An input with about so many disks, packed as before; a few disks stay as they are."""
    factor = disks / max(sum(int(match[2]) for match in COUNT.finditer(text)), 1)

    def scale(match):
        group = COUNT.sub(lambda m: f"{m[1]}{round(int(m[2]) * factor)}", match[0])
        return RADIUS.sub(lambda m: f"{m[1]}{float(m[2]) / factor**0.5}", group)

    if factor > disks / 30:
        return text
    return re.sub(r"^&species(?![^&]*relative_to)[^&]*", scale, text, flags=re.MULTILINE)


@CHECK
@pytest.mark.parametrize("name", sorted(path.stem for path in INPUTS.glob("*.nml")))
def test_every_input_gives_the_same_with_threads(program, tmp_path, name):
    write_input(tmp_path, scaled((INPUTS / f"{name}.nml").read_text(), 10_000))
    for threads in 1, 2, 3:
        options = f"--set=run.threads={threads}", "--set=stop.events=30000"
        done = run(program, tmp_path, f"{threads}.h5", *options)
        assert done.returncode == FINISHED, done.stderr
    assert differences(tmp_path / "1.h5", tmp_path / "2.h5") == []
    assert differences(tmp_path / "1.h5", tmp_path / "3.h5") == []


COLLAPSE = """&species count = 5000 packing_fraction = 0.3 temperature = 1 /
&contact restitution = 0.3 / &stop collisions_per_disk = 200 /
"""


@pytest.mark.parametrize("log", ["", "&output event_log = .true. /\n"], ids=["plain", "log"])
def test_a_collapse_ends_a_run_on_several_cores_as_on_one(program, tmp_path, log):
    """However long a window should be, it is bounded; the run breaks off in the same state."""
    write_input(tmp_path, COLLAPSE + log)
    ends = [
        (end.returncode, end.stderr)
        for end in (run(program, tmp_path, f"{n}.h5", f"--set=run.threads={n}") for n in (1, 2))
    ]
    assert ends[0] == ends[1]
    assert ends[0][0] == BROKEN
    assert differences(tmp_path / "1.h5.part", tmp_path / "2.h5.part") == []


def test_domains_without_disks_are_no_matter(program, tmp_path):
    cloud = "&species count = 8000 radius = 0.0002 region = 0, 0.1, 0, 0.1 temperature = 1 /"
    write_input(tmp_path, cloud + " &stop events = 20000 /\n")
    for threads in 1, 8:
        done = run(program, tmp_path, f"{threads}.h5", f"--set=run.threads={threads}")
        assert done.returncode == FINISHED, done.stderr
    assert differences(tmp_path / "1.h5", tmp_path / "8.h5") == []


def alone(*, cores=None, user=None, **limits):
    """What a process does before it becomes a run: keeps to some cores, limits and another user."""

    def prepare():
        if cores:
            os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:cores])
        for name, most in limits.items():
            resource.setrlimit(getattr(resource, f"RLIMIT_{name}"), (most, most))
        if user:
            os.setgroups([])
            os.setgid(user)
            os.setuid(user)

    return prepare


def output_of(whole, *options, program, threads=4, **preparation):
    """A run of a system on several threads, and how many it says that it had."""
    command = [program, "gas.nml", "-o", "many.h5", "--force", *options]
    command += [f"--set=run.threads={threads}"] if threads else []
    done = subprocess.run(
        command,
        cwd=whole,
        capture_output=True,
        text=True,
        timeout=300,
        preexec_fn=alone(**preparation),
    )
    if done.returncode != FINISHED:
        return done, 0
    assert differences(whole / "one.h5", whole / "many.h5") == []
    with h5py.File(whole / "many.h5") as file:
        return done, file["provenance"].attrs["threads"]


FALLS_BACK = re.compile(
    r"warning: run.threads: a limit on processes, threads or address space lets only (\d) of 4 "
    r"threads start; the run goes on with \1\n"
)


@pytest.fixture
def gas(program, tmp_path):
    """A folder with a short run of 10 000 disks on one core."""
    write_input(tmp_path, GAS.format(0.3, "random") + "&stop events = 30000 /")
    assert run(program, tmp_path, "one.h5").returncode == FINISHED
    return tmp_path


def test_too_little_address_space_for_stacks_leaves_fewer_threads(program, gas, monkeypatch):
    """Whatever the limit: the right result with the threads that there are, or one line."""
    monkeypatch.setenv("OMP_STACKSIZE", "16M")
    had = set()
    for most in range(40_000_000, 130_000_000, 5_000_000):
        done, threads = output_of(gas, program=program, AS=most, cores=1)
        if done.returncode == 127:
            continue  # no room for the libraries
        assert done.returncode in (FINISHED, USAGE, FILES), done.stderr
        assert len(done.stderr.splitlines()) == 1
        if found := FALLS_BACK.fullmatch(done.stderr):
            assert threads == int(found[1])
            had.add(threads)
    assert had & {1, 2, 3}


@pytest.mark.parametrize("most", [1, 2, 3])
def test_a_limit_of_processes_leaves_fewer_threads(program, gas, most):
    """The limit counts the processes of a user: one that has no other."""
    if os.geteuid() != 0:
        pytest.skip("needs root, to be another user")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for path in (program, *gas.iterdir()):
            shutil.copy(path, folder)
        for path in (folder, *folder.iterdir()):
            path.chmod(0o777)
        try:
            done, threads = output_of(folder, program=folder / program.name, NPROC=most, user=54321)
        except PermissionError:
            pytest.skip("no other user may enter the folders above this one")
    assert done.returncode == FINISHED and threads == most, done.stderr
    assert FALLS_BACK.fullmatch(done.stderr)


def test_too_little_memory_for_domains_is_said(program, tmp_path):
    """Some limit is enough for one core, and not for several."""
    write_input(
        tmp_path, GAS.replace("10000", "60000").format(0.3, "random") + "&stop events = 5 /"
    )
    assert run(program, tmp_path, "one.h5").returncode == FINISHED
    said = (
        "warning: run.threads: there is not enough memory for 4 threads; the run goes on with one\n"
    )
    for most in range(44_000_000, 64_000_000, 2_000_000):
        done, threads = output_of(tmp_path, program=program, DATA=most, cores=1)
        if done.returncode == FINISHED and done.stderr == said:
            assert threads == 1
            return
    pytest.fail("no run dropped its threads")


def test_more_threads_than_cores_are_warned_of(program, gas, monkeypatch):
    said = "warning: {}: 4 threads are more than the 1 core that the run may use, and slower\n"
    done, threads = output_of(gas, program=program, cores=1)
    assert (done.stderr, threads) == (said.format("run.threads"), 4)
    done, threads = output_of(gas, "--quiet", program=program, cores=1)
    assert (done.stderr, threads) == ("", 4)
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    done, threads = output_of(gas, program=program, threads=None, cores=1)
    assert (done.stderr, threads) == (said.format("OMP_NUM_THREADS"), 4)
    done, threads = output_of(gas, program=program, threads=1, cores=1)
    assert (done.stderr, threads) == ("", 1)


def test_the_threads_are_those_of_the_last_part(program, gas):
    """One where a run is too small, or of a kind, that one core does alone."""
    command = ["--set", "stop.wall_clock=1e-9", "--set", "run.threads=3"]
    assert run(program, gas, "many.h5", *command).returncode == STOPPED
    options = {"--resume": 2, "--set=species.gas.count=1000": 1, "--set=run.search=pairs": 1}
    for option, expected in options.items():
        force = [] if option == "--resume" else ["--force", "--set=stop.events=5"]
        done = run(program, gas, "many.h5", option, *force, "--set=run.threads=2")
        assert done.returncode == FINISHED, done.stderr
        with h5py.File(gas / "many.h5") as file:
            assert file["provenance"].attrs["threads"] == expected


def test_random_systems_find_a_program_whose_result_depends_on_the_queue(program, tmp_path):
    """`make check` runs many of them; here a stand-in stops early with one of the queues."""
    liar = tmp_path / "liar"
    liar.write_text(
        f"""#!/bin/sh
case "$*" in *queue=heap*) exec {program} "$@" --set stop.events=3 ;; esac
exec {program} "$@"
"""
    )
    liar.chmod(0o755)
    script = Path(__file__).parent / "fuzz_systems.py"
    command = [sys.executable, script, "--count", "4", "--seed", "3", "--program"]
    run = subprocess.run([*command, liar], capture_output=True, text=True, check=False)
    assert run.returncode == 1 and "--count 4 --seed 3: " in run.stdout
    assert "differs" in run.stderr and "&species" in run.stderr
    run = subprocess.run([*command, program], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("threads", [1, 2])
def test_who_asks_is_told_where_the_wall_clock_went(program, gas, threads, monkeypatch):
    """Every moment belongs to one part, from the first to the last."""
    option = f"--set=run.threads={threads}"
    assert run(program, gas, "plain.h5", option).stderr == ""
    monkeypatch.setenv("RICOCHET_TIMES", "1")
    began = time.monotonic()
    told = run(program, gas, "times.h5", option)
    elapsed = time.monotonic() - began
    parts = dict(re.findall(r"^(.*?) +([\d.]+) s +[\d.]+ %$", told.stderr, re.M))
    waits = "waiting for other threads" in parts
    assert (not waits) == ("* events in domains" not in parts) == (threads == 1)
    whole = sum(map(float, parts.values()))
    own = float(re.search(r"wall_time = (.*)", told.stdout)[1])
    assert own - 0.01 < whole < elapsed + 0.01  # of rounded numbers
    assert differences(gas / "times.h5", gas / "plain.h5") == []
