"""Fixtures of all tests: the program under test, and functions that run it."""

import fcntl
import hashlib
import os
import signal
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from processor_times import (  # noqa: F401 (pytest finds its hooks here)
    pytest_runtest_makereport,
    pytest_runtest_protocol,
    slowest_tests,
)
from signs_of_life import SignsOfLife
from whole_runs import choose_build, ran, within

# Processes started by a shell in the background ignore these signals by default.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)

ROOT = Path(__file__).resolve().parents[1]
ROOM = 4e9  #: space for the files of the tests [bytes]


@pytest.hookimpl(trylast=True)  # after the terminal reporter exists
def pytest_configure(config):
    """Choose the program, show signs of life, and keep files in memory if possible."""
    if missing := choose_build():
        raise pytest.UsageError(missing)
    terminal = config.pluginmanager.get_plugin("terminalreporter")
    if terminal and not hasattr(config, "workerinput"):
        config.pluginmanager.register(SignsOfLife(terminal))
    memory = Path("/dev/shm")  # so that a slow disk does not matter
    if os.access(memory, os.W_OK):
        disk = os.statvfs(memory)
        if disk.f_bavail * disk.f_frsize > ROOM and not disk.f_flag & os.ST_NOEXEC:
            os.environ.setdefault("TMPDIR", str(memory))
            tempfile.tempdir = None  # determined again


def pytest_terminal_summary(terminalreporter, config):
    """Print the slowest tests, and the option that repeats the random order of the tests."""
    reports = [report for found in terminalreporter.stats.values() for report in found]
    for line in slowest_tests(report for report in reports if hasattr(report, "user_properties")):
        terminalreporter.write_line(line)
    if seed := config.getoption("randomly_seed", None):
        terminalreporter.write_line(f"the same order again: --randomly-seed={seed}")


@pytest.fixture(scope="session")
def program() -> Path:
    """Return the path of the program (RICOCHET or build/ricochet); fail if there is none."""
    path = Path(os.environ.get("RICOCHET", ROOT / "build" / "ricochet")).resolve()
    if not os.access(path, os.X_OK):
        pytest.fail(f"no program at {path}: run make first, or set RICOCHET")
    return path


@pytest.fixture(scope="session")
def made_once(tmp_path_factory) -> Callable[[str, Callable[[Path], object]], Path]:
    """Return a function that makes a file once per session, for all workers of pytest-xdist.

    It returns the path of the file that belongs to a text, calling `make(path)` if the file does
    not exist. Tests must not change the file itself, but may change a copy.
    """
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "made_once"
    folder.mkdir(exist_ok=True)

    def made(text: str, make: Callable[[Path], object]) -> Path:
        path = folder / f"{hashlib.sha256(text.encode()).hexdigest()[:20]}.h5"
        with path.with_suffix(".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not path.exists():
                unfinished = path.with_stem(f"{path.stem}_unfinished")
                make(unfinished)
                unfinished.rename(path)
        return path

    return made


@pytest.fixture
def ricochet(program, tmp_path) -> Callable[..., subprocess.CompletedProcess]:
    """Return a function that runs the program in `tmp_path`, and returns status and output.

    If `seconds` is given, the program is killed after this processor time.
    """

    def run(*arguments, seconds=None, **options) -> subprocess.CompletedProcess:
        return ran(*within(seconds), program, *arguments, **{"cwd": tmp_path, **options})

    return run


@pytest.fixture
def started(program, tmp_path):
    """Return a function that starts the program in `tmp_path`; programs still running are ended."""
    processes = []

    def start(*arguments, **options):
        command = [program, *map(str, arguments)]
        options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
        processes.append(subprocess.Popen(command, cwd=tmp_path, text=True, **options))
        return processes[-1]

    yield start
    for process in processes:
        with process:  # which also closes its pipes
            process.kill()


@pytest.fixture
def small_disk(tmp_path):
    """Return a function that makes a folder on a small disk, which requires root privileges."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = []

    def mount(kilobytes, mode="rw"):
        options = f"size={kilobytes}k,{mode}" + (",remount" if mounted else "")
        if ran("mount", "-t", "tmpfs", "-o", options, "tmpfs", folder).returncode != 0:
            pytest.skip("cannot mount a small disk here: needs root")
        mounted.append(folder)
        return folder

    yield mount
    if mounted:
        ran("umount", folder, check=True)
