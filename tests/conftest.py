"""Fixtures of all tests: the program under test and functions that run it."""

import os
import signal
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from whole_runs import ran, within

# Processes that a shell starts in the background ignore these signals by default.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)

ROOT = Path(__file__).resolve().parents[1]
ROOM = 4e9  #: for the files of the tests [bytes]


def pytest_configure():
    """Keep the files of the tests in memory if possible, so that a slow disk does not matter."""
    memory = Path("/dev/shm")
    if os.access(memory, os.W_OK):
        disk = os.statvfs(memory)
        if disk.f_bavail * disk.f_frsize > ROOM and not disk.f_flag & os.ST_NOEXEC:
            os.environ.setdefault("TMPDIR", str(memory))
            tempfile.tempdir = None  # it is asked anew


def pytest_terminal_summary(terminalreporter, config):
    """Print the option that repeats the random order of the tests, also in quiet mode."""
    if seed := config.getoption("randomly_seed", None):
        terminalreporter.write_line(f"the same order again: --randomly-seed={seed}")


@pytest.fixture(scope="session")
def program() -> Path:
    """Return the path of the program (RICOCHET or build/ricochet); fail if it does not exist."""
    path = Path(os.environ.get("RICOCHET", ROOT / "build" / "ricochet")).resolve()
    if not os.access(path, os.X_OK):
        pytest.fail(f"no program at {path}: run make first, or set RICOCHET")
    return path


@pytest.fixture
def ricochet(program, tmp_path) -> Callable[..., subprocess.CompletedProcess]:
    """Return a function that runs the program in `tmp_path` and returns its status and output.

    If `seconds` is given, the program is killed after this processor time.
    """

    def run(*arguments, seconds=None, **options) -> subprocess.CompletedProcess:
        return ran(*within(seconds), program, *arguments, **{"cwd": tmp_path, **options})

    return run


@pytest.fixture
def started(program, tmp_path):
    """Return a function that starts the program in `tmp_path`; running programs are ended."""
    processes = []

    def start(*arguments, **options):
        command = [program, *map(str, arguments)]
        options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
        processes.append(subprocess.Popen(command, cwd=tmp_path, text=True, **options))
        return processes[-1]

    yield start
    for process in processes:
        with process:  # whose pipes are closed
            process.kill()


@pytest.fixture
def small_disk(tmp_path):
    """Return a function that makes a folder on a small disk; it requires the rights of root."""
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
