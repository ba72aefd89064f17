"""Tools for tests of whole runs: inputs, and functions that compare output files."""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import h5py
import numpy as np

FINISHED, USAGE, FILES, BROKEN, STOPPED = 0, 2, 3, 4, 75

#: A system with many features: two species, dissipating walls, separate schedules of frames and
#: observables.
MIXTURE = """&run title = 'mixture' seed = 5 /
&species name = 'light' count = 60 radius = 0.02 temperature = 1 /
&species name = 'heavy' count = 20 radius = 0.03 mass = 4 temperature = 1 /
&contact restitution = 0.95 wall_restitution = 0.9 contact_time = 1e-3 /
&stop time = 4 /
&output frames_every_time = 0.25 observables_every_collisions = 50 event_log = .true. /
"""


def contents(path) -> dict[str, np.ndarray]:
    """Return all contents of an output file: datasets by path, attributes by path@name."""
    found = {}

    def visit(name, item):
        for k in range(h5py.h5a.get_num_attrs(item)):
            attribute = h5py.h5a.open(item, index=k)
            found[f"{name}@{attribute.name.decode()}"] = read(attribute)
        if isinstance(item, h5py.h5d.DatasetID):
            found[name] = read(item, h5py.h5s.ALL, h5py.h5s.ALL)
        else:  # including second names
            for key in item:
                visit(f"{name}/{key.decode()}", h5py.h5o.open(item, key))

    def read(item, *spaces):
        value = np.empty(item.shape, item.dtype)
        if value.size:
            item.read(*spaces, value)
        return value[()]

    with h5py.File(path, "r", locking=False) as file:
        visit("", h5py.h5o.open(file.id, b"/"))
    return found


def differences(one, other) -> list[str]:
    """Return the names of all items, except their origin, that differ between two output files."""
    return unlike(contents(one), contents(other))


def unlike(a: dict, b: dict) -> list[str]:
    """Return the names of the items that differ between the contents of two files.

    The checksum of the input is ignored.
    """
    return [
        name
        for name in sorted(a.keys() | b.keys())
        if not name.startswith(("/provenance", "/checkpoint/input_checksum"))
        and not (name in a and name in b and same(a[name], b[name]))
    ]


def same(a, b) -> bool:
    """Return whether two arrays agree in type, shape and every bit."""
    a, b = np.asarray(a), np.asarray(b)
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


def committed(path) -> dict[str, np.ndarray]:
    """Return the committed frames and observables of a file that may still be written to."""
    found = {}
    with h5py.File(path, "r", locking=False) as file:
        for root in ("particles/disks", "observables"):
            count = int(file[root]["committed"][()])
            for name in ("position", "velocity", "total_energy", "collisions", "momentum"):
                if f"{root}/{name}/value" in file:
                    for part in ("step", "time", "value"):
                        found[f"{root}/{name}/{part}"] = file[f"{root}/{name}/{part}"][:count]
    return found


def is_beginning(part: dict, whole: dict) -> list[str]:
    """Return the names in `part` that are not the first samples of the same item in `whole`."""
    return [name for name in part if not same(part[name], whole[name][: len(part[name])])]


def one_line(run) -> str:
    """Return the message of a run that failed, a single line without traces of a library."""
    lines = run.stderr.splitlines()
    assert len(lines) == 1, run.stderr
    assert "HDF5-DIAG" not in run.stderr and "Fortran runtime" not in run.stderr
    return lines[0]


def write_input(folder, text=MIXTURE, name="gas.nml") -> Path:
    """Write an input file to a folder."""
    path = Path(folder) / name
    path.write_text(text)
    return path


def executable(path, text, shell="sh") -> Path:
    """Write a script that stands in for a program."""
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"#!/usr/bin/env {shell}\n{text}\n")
    path.chmod(0o755)
    return path


def environment(**more) -> dict[str, str]:
    """Return the environment of the tests with more variables, without those of `make`."""
    own = {name: value for name, value in os.environ.items() if "MAKE" not in name}
    return own | {name: str(value) for name, value in more.items()}


def choose_build() -> str:
    """Make RICOCHET and RICOCHET_LIBRARY absolute, because tests change the folder.

    Without RICOCHET_LIBRARY, the libraries beside the program are tested. The result says which
    program is missing, or is empty.
    """
    if program := os.environ.get("RICOCHET"):
        os.environ["RICOCHET"] = str(Path(program).resolve())
        os.environ.setdefault("RICOCHET_LIBRARY", str(Path(program).resolve().parent))
        if not os.access(program, os.X_OK):
            return f"RICOCHET: no program at {program}; run make first"
    if libraries := os.environ.get("RICOCHET_LIBRARY"):
        os.environ["RICOCHET_LIBRARY"] = str(Path(libraries).resolve())
    return ""


def ran(*command, check=False, **options) -> subprocess.CompletedProcess:
    """Run a command, and return it with its output."""
    options = {"capture_output": True, "text": True, "timeout": PATIENCE, **options}
    return subprocess.run(list(map(str, command)), check=check, **options)


#: Library preloaded to replace the fsync of the system.
FSYNC = """#include <errno.h>
#include <signal.h>
#include <unistd.h>
int fsync(int d) { (void)d; %s }
"""


def with_fsync(folder, body) -> dict[str, str]:
    """Return the environment of a program for which fsync has the given body."""
    (folder / "fsync.c").write_text(FSYNC % body)
    command = ["cc", "-shared", "-fPIC", "-o", "fsync.so", "fsync.c"]
    subprocess.run(command, cwd=folder, check=True)
    return {**os.environ, "LD_PRELOAD": str(folder / "fsync.so")}


def occupy(path, kind, precious):
    """Put something in a place; links lead to a file of the user."""
    if kind == "link":
        path.symlink_to(precious)
    elif kind == "hard link":
        path.hardlink_to(precious)
    elif kind == "link to nothing":
        path.symlink_to(precious.with_name("new"))
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    else:
        path.write_text("notes")


#: Time after which a wait is abandoned [s]. It ends hanging processes and measures nothing:
#: whatever takes a busy machine several minutes passes, too.
PATIENCE = 900


def wait_for(condition):
    """Wait until a condition holds, checking it less often the longer it takes."""
    begin = time.monotonic()
    while not condition():
        waited = time.monotonic() - begin
        assert waited < PATIENCE, "nothing happened"
        time.sleep(min(max(0.005, waited / 10), 0.05))


# --- Processes: what they do is known from the system, not from the time that has passed ---


def facts_of(pid) -> list[str]:
    """Return data of the system about a process, from its state on (proc(5), field 3 of stat)."""
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()


def processor_time(pid) -> float:
    """Return the processor time of a process so far, including children it has waited for [s]."""
    return sum(map(int, facts_of(pid)[11:15])) / os.sysconf("SC_CLK_TCK")


def within(seconds) -> list[str]:
    """Return the beginning of a command that is killed after a processor time, if any is given."""
    return ["prlimit", f"--cpu={seconds}"] if seconds else []


def with_parent(*command) -> list:
    """Return a command that ends with the process that starts it, even if that is killed."""
    tied = ["setpriv", "--pdeathsig", "TERM"] if shutil.which("setpriv") else []
    return [*tied, *command]


def is_asleep(pid) -> bool:
    """Return whether a process waits for something other than a disk or a processor."""
    return facts_of(pid)[0] == "S"


def heeds(pid, number) -> bool:
    """Return whether a process has a handler for a signal."""
    caught = re.search(r"^SigCgt:\s+(\w+)", Path(f"/proc/{pid}/status").read_text(), re.MULTILINE)
    return bool(int(caught[1], 16) >> (number - 1) & 1)


def has_ended(process) -> bool:
    """Return whether a process has ended, even if nobody has waited for it yet."""
    how = os.WEXITED | os.WNOHANG | os.WNOWAIT
    return process.returncode is not None or os.waitid(os.P_PID, process.pid, how) is not None


def let_work(process, seconds=0.0):
    """Wait until a run can be stopped and has used a processor time, or has ended."""
    wait_for(
        lambda: (
            has_ended(process)
            or (heeds(process.pid, signal.SIGTERM) and processor_time(process.pid) >= seconds)
        )
    )


@contextlib.contextmanager
def held(process):
    """Keep a process stopped, so that its state does not change meanwhile."""
    process.send_signal(signal.SIGSTOP)
    yield
    process.send_signal(signal.SIGCONT)


@contextlib.contextmanager
def filled_pipe():
    """Yield a pipe that accepts no more data, because its reader has stopped reading."""
    outlet, inlet = os.pipe()
    os.set_blocking(inlet, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(inlet, b"x" * 4096)
    os.set_blocking(inlet, True)
    yield inlet
    os.close(inlet)
    os.close(outlet)


def ended_soon(process, number, seconds=1.0, members=()) -> str:
    """Send a signal to a process, and return its output up to its end, which must come soon.

    The limit is on processor time, including that of the `members` for which the process waits,
    because wall time depends on other programs.
    """
    before = sum(map(processor_time, [process.pid, *members]))
    # Popen's own method would notice the end of the process and discard its data
    os.kill(process.pid, number)
    wait_for(lambda: has_ended(process))
    assert processor_time(process.pid) - before < seconds
    return process.communicate()[1]


def frames_in(path, group="particles/disks") -> int:
    """Return the number of committed frames, or samples of another group; 0 without a file."""
    try:
        with h5py.File(path, "r", locking=False) as file:
            return int(file[group]["committed"][()])
    except OSError:
        return 0
