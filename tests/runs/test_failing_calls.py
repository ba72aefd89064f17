"""Failed or interrupted system calls: the run prints one line and loses no data."""

import os
import re
import shutil
import signal
import subprocess
from concurrent.futures import ThreadPoolExecutor

import h5py
import pytest

from whole_runs import FILES, FINISHED, PATIENCE, STOPPED, USAGE
from whole_runs import committed, differences, is_beginning, one_line, ran, write_input

#: This input causes few system calls, but all kinds of them. The number of frames is known in
#: advance, but those of observables and events are not, so that the file is rebuilt at the end. The
#: run writes two checkpoints.
SMALL = """&box boundary = 'periodic', 'wall' /
&species name = 'gas' file = 'gas.txt' radius = 0.03 temperature = 1 /
&stop events = 2 /
&output observables_every_collisions = 2 event_log = .true. checkpoint_every = 1e-6 /
"""
COMMAND = ["gas.nml", "-o", "gas.h5", "--quiet"]
#: Options with which the run starts: it replaces a result, resumes a stopped run, or extends a
#: finished one.
OPTIONS = ("--force", "--resume", "--resume --quiet")
#: System calls of the program, and how they fail; + means that all later calls fail, too.
WAYS = {
    "openat": ["EIO", "EIO+"],
    "read": ["EIO", "EIO+"],
    "pread64": ["EIO", "EIO+"],
    "write": ["EIO", "ENOSPC+"],
    "pwrite64": ["EIO", "ENOSPC+"],
    "ftruncate": ["EIO", "EIO+"],
    "fsync": ["EIO", "EIO+", "EINVAL+"],
    "rename": ["EIO", "EIO+"],
    "unlink": ["EIO", "EIO+"],
    "close": ["EIO", "EIO+"],
    "flock": ["ENOLCK"],
    "newfstatat": ["EIO", "EIO+"],
}


@pytest.fixture(scope="module")
def stage(program, tmp_path_factory):
    """Return a folder with the expected result, and starting folders and traces for each option.

    Folders and traces are named like the options.
    """
    if not shutil.which("strace"):
        pytest.skip("strace is not installed")
    stage = tmp_path_factory.mktemp("stage")
    for option, change, code in (
        ("whole", [], FINISHED),
        ("--force", ["--set", "run.seed=2"], FINISHED),
        ("--resume", ["--set", "stop.wall_clock=1e-9"], STOPPED),
        ("--resume --quiet", ["--set", "stop.events=1"], FINISHED),
    ):
        folder = stage / option
        folder.mkdir()
        write_input(folder, SMALL)
        (folder / "gas.txt").write_text("".join(f"{k / 12} 0.5\n" for k in range(12)))
        run = started(program, *COMMAND, *change, folder=folder)
        assert run.returncode == code, run.stderr
    for option in OPTIONS:
        copy_folder(stage / option, stage / "count")
        run = traced(program, stage / "count", option, "-e", f"trace={','.join(WAYS)}")
        if run.returncode != FINISHED:
            pytest.skip("strace cannot trace here: " + run.stderr.strip()[-80:])
        (stage / "count" / "trace").rename(stage / f"trace{option}")
        shutil.rmtree(stage / "count")
    return stage


def copy_folder(source, target):
    """Copy a folder with `cp`, because Python functions do not preserve holes in files."""
    subprocess.run(["cp", "-a", source, target], check=True)


def started(*command, folder):
    """Start the run in a folder; if it hangs, kill it with all its child processes."""
    return ran("timeout", "-s", "KILL", PATIENCE, *command, cwd=folder, timeout=None)


def traced(program, folder, option, *what):
    """Start the run under strace, which writes to the file `trace`."""
    # with this option strace 6.1 sends no signals
    fast = [] if ":signal=" in "".join(what) else ["--seccomp-bpf"]
    strace = ["strace", *fast, "-f", "-y", "-o", "trace", *what]
    return started(*strace, program, *COMMAND, *option.split(), folder=folder)


def positions(stage, option, call, first="gas.nml") -> range:
    """Return the numbers of all calls of one kind after the first trace line with a given text."""
    lines = (stage / f"trace{option}").read_text().splitlines()
    begin = next(k for k, line in enumerate(lines) if first in line)
    calls = [k for k, line in enumerate(lines) if re.match(rf"\d+ +{call}\(", line)]
    return range(sum(k < begin for k in calls) + 1, len(calls) + 1)


def chosen(stage, option, call, step) -> list[int]:
    """Return the numbers of random calls, and of the last calls, which complete the file."""
    numbers = positions(stage, option, call)
    last = {"pwrite64": 4, "ftruncate": 2, "rename": 2, "unlink": 2}.get(call, 1)
    return sorted({*numbers[::step], *numbers[-last:]})


def outcome(check, program, stage, option, call, inject) -> str:
    """Return a list of faults after a run in which one system call was disturbed."""
    folder = stage / f"{option} {call} {inject}"
    copy_folder(stage / option, folder)
    try:
        check(program, stage, folder, option, call, inject)
    except (AssertionError, OSError, KeyError) as problem:
        return f"{option} {inject}: {problem}"
    finally:
        shutil.rmtree(folder)
    return ""


def same_results(stage, result) -> bool:
    """Return whether results agree except for wall times, by a fast comparison of bytes."""
    whole = stage / "whole" / "gas.h5"
    return timeless(whole) == timeless(result) or differences(whole, result) == []


def timeless(path) -> bytes:
    """Return the bytes of a file without the wall times of the run."""
    content = path.read_bytes()
    with h5py.File(path, locking=False) as file:
        for name in ("wall_time", "collisions_per_second"):
            content = content.replace(file["provenance"].attrs[name].tobytes(), bytes(8))
    return content


def check_after_failure(program, stage, folder, option, call, inject):
    result = folder / "gas.h5"
    earlier = result.read_bytes() if result.exists() else None
    run = traced(program, folder, option, "-e", f"trace={call}", "-e", inject)
    assert run.returncode in (FINISHED, USAGE, FILES), (run.returncode, run.stderr)
    if run.returncode == FINISHED:
        assert run.stderr == ""
        assert same_results(stage, result)
        return
    if "inject=write:error=ENOSPC" not in inject:  # otherwise the message would fail, too
        one_line(run)
    if call == "write" and result.exists() and same_results(stage, result):
        return  # only the summary could not be written
    assert not result.exists() or result.read_bytes() == earlier, "the earlier result is gone"
    go_on(program, stage, folder, option)


def go_on(program, stage, folder, option):
    """Check that the remaining file is valid, and that the run continues or starts again."""
    part = folder / "gas.h5.part"
    if part.exists():
        found = committed(part)
        assert is_beginning(found, committed(stage / "whole" / "gas.h5")) == []
        if shutil.which("h5dump"):
            subprocess.run(["h5dump", "-H", part], check=True, stdout=subprocess.DEVNULL)
    assert part.exists() or option != "--resume", "the checkpoint is gone"
    onward = option if option != "--force" or not part.exists() else "--resume"
    again = started(program, *COMMAND, *onward.split(), folder=folder)
    assert again.returncode == FINISHED, ("again", again.stderr)
    assert same_results(stage, folder / "gas.h5")


def check_after_kill(program, stage, folder, option, call, inject):
    """Check that after a kill the result is old or complete, and that the run can continue."""
    result = folder / "gas.h5"
    earlier = result.read_bytes() if result.exists() else None
    run = traced(program, folder, option, "-e", f"trace={call}", "-e", inject)
    assert run.returncode in (FINISHED, -signal.SIGKILL, 128 + signal.SIGKILL), run.stderr
    if result.exists() and result.read_bytes() != earlier:
        assert same_results(stage, result)
    else:
        go_on(program, stage, folder, option)


def check_after_signal(program, stage, folder, option, call, inject):
    """Check that the run was stopped with a checkpoint, finished, or not started."""
    before = contents_of(folder)
    run = traced(program, folder, option, "-e", f"trace={call}", "-e", inject)
    trace = (folder / "trace").read_text()
    if "--- SIGTERM" not in trace:  # reading system information takes a varying number of calls
        made = len(re.findall(rf"^\d+ +{call}\(", trace, re.MULTILINE))
        assert made < int(inject.rpartition("=")[2]), "no signal was sent"
        assert run.returncode == FINISHED
    left = contents_of(folder)
    if run.returncode == FINISHED:
        assert set(left) == {"gas.nml", "gas.txt", "gas.h5"}
        assert same_results(stage, folder / "gas.h5")
        return
    assert run.returncode == STOPPED, (run.returncode, run.stderr)
    assert left.get("gas.h5") == before.get("gas.h5"), "the earlier result is another"
    if "nothing is lost" in one_line(run):
        assert left == before
    else:
        again = started(program, *COMMAND, "--resume", folder=folder)
        assert again.returncode == FINISHED, again.stderr
        assert same_results(stage, folder / "gas.h5")


def contents_of(folder) -> dict[str, bytes]:
    """Return the contents of all files in a folder by name."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "trace"}


#: Disturbances of a call in the syntax of strace, with the property checked for each.
KILLED = ("pwrite64", "ftruncate", "fsync", "rename", "unlink", "openat")
MEETINGS = [(check_after_failure, call, [f"error={way}" for way in WAYS[call]]) for call in WAYS]
MEETINGS += [(check_after_signal, call, ["signal=SIGTERM"]) for call in WAYS]
MEETINGS += [(check_after_kill, call, ["signal=SIGKILL"]) for call in KILLED]


@pytest.mark.parametrize(("check", "call", "ways"), MEETINGS)
@pytest.mark.parametrize("step", [250, pytest.param(1, marks=pytest.mark.check)])
def test_whatever_meets_a_call_costs_nothing(program, stage, check, call, ways, step):
    """No data are lost after a failed call, a signal or a kill.

    The calls that complete the file, mostly `pwrite64`, are disturbed one by one, which takes 5 s.
    """
    cases = [
        (option, f"inject={call}:{what}:when={number}{again}")
        for option in OPTIONS
        for number in chosen(stage, option, call, step)
        for what, again in (way.partition("+")[:2] for way in ways)
    ]

    def problem(case):
        option, inject = case
        return outcome(check, program, stage, option, call, inject)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        assert [found for found in pool.map(problem, cases) if found] == []


@pytest.mark.parametrize("option", OPTIONS)
def test_a_file_that_seems_to_exist_for_a_moment_is_no_danger(program, stage, option):
    """The first of several calls that look for the unfinished output fails."""
    lines = (stage / f"trace{option}").read_text().splitlines()
    calls = [line for line in lines if re.match(r"\d+ +newfstatat\(", line)]
    numbers = [number for number, line in enumerate(calls, start=1) if '"gas.h5.part"' in line]
    for number in numbers:
        inject = f"inject=newfstatat:error=EIO:when={number}"
        assert outcome(check_after_failure, program, stage, option, "newfstatat", inject) == ""


@pytest.mark.parametrize("error", ["EINTR", "EAGAIN"])
@pytest.mark.parametrize("forever", ["", "+"])
def test_a_reluctant_standard_output_is_no_failure(program, stage, error, forever):
    """The result is complete even if writing to standard output fails."""
    folder = stage / f"{error}{forever}"
    copy_folder(stage / "--force", folder)
    (number,) = positions(stage, "--force", "write", first="write(1<")
    inject = f"inject=write:error={error}:when={number}{forever}"
    run = traced(program, folder, "--force", "-e", "trace=write", "-e", inject)
    assert (run.returncode, run.stderr) == (FINISHED, "")
    assert run.stdout.startswith("output = gas.h5") == (forever == "")
    assert same_results(stage, folder / "gas.h5")
