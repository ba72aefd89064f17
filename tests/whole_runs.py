"""Tools of the tests of whole runs: inputs, and functions that compare output files."""

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

#: A little of everything: two species, walls that take energy, frames and observables apart.
MIXTURE = """&run title = 'mixture' seed = 5 /
&species name = 'light' count = 60 radius = 0.02 temperature = 1 /
&species name = 'heavy' count = 20 radius = 0.03 mass = 4 temperature = 1 /
&contact restitution = 0.95 wall_restitution = 0.9 contact_time = 1e-3 /
&stop time = 4 /
&output frames_every_time = 0.25 observables_every_collisions = 50 event_log = .true. /
"""


def contents(path) -> dict[str, np.ndarray]:
    """All that an output file says: datasets by path, attributes by path@name."""
    found = {}

    def visit(name, item):
        for k in range(h5py.h5a.get_num_attrs(item)):
            attribute = h5py.h5a.open(item, index=k)
            found[f"{name}@{attribute.name.decode()}"] = read(attribute)
        if isinstance(item, h5py.h5d.DatasetID):
            found[name] = read(item, h5py.h5s.ALL, h5py.h5s.ALL)
        else:  # also by second names
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
    """Names of what is not the same, bit for bit, in two output files; their origin aside."""
    return unlike(contents(one), contents(other))


def unlike(a: dict, b: dict) -> list[str]:
    """The same for what two files contain. The checksum of their inputs is left to these."""
    return [
        name
        for name in sorted(a.keys() | b.keys())
        if not name.startswith(("/provenance", "/checkpoint/input_checksum"))
        and not (name in a and name in b and same(a[name], b[name]))
    ]


def same(a, b) -> bool:
    """Equal in type, shape and every bit."""
    a, b = np.asarray(a), np.asarray(b)
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


def committed(path) -> dict[str, np.ndarray]:
    """Frames and observables of a file that may still be written, as far as they are committed."""
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
    """Names in `part` that are not the first samples of the same in `whole`."""
    return [name for name in part if not same(part[name], whole[name][: len(part[name])])]


def one_line(run) -> str:
    """The message of a run that failed: a single line, and no trace of a library."""
    lines = run.stderr.splitlines()
    assert len(lines) == 1, run.stderr
    assert "HDF5-DIAG" not in run.stderr and "Fortran runtime" not in run.stderr
    return lines[0]


def write_input(folder, text=MIXTURE, name="gas.nml") -> Path:
    """An input file in a folder."""
    path = Path(folder) / name
    path.write_text(text)
    return path


def executable(path, text, shell="sh") -> Path:
    """A script that stands in for a program."""
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"#!/usr/bin/env {shell}\n{text}\n")
    path.chmod(0o755)
    return path


def environment(**more) -> dict[str, str]:
    """The environment of the tests and more variables, without those of a `make` around it."""
    own = {name: value for name, value in os.environ.items() if "MAKE" not in name}
    return own | {name: str(value) for name, value in more.items()}


def ran(*command, check=False, **options) -> subprocess.CompletedProcess:
    """A command that has ended, with what it has said."""
    options = {"capture_output": True, "text": True, "timeout": PATIENCE, **options}
    return subprocess.run(list(map(str, command)), check=check, **options)


#: A library that the program is started with instead of the system's own fsync.
FSYNC = """#include <errno.h>
#include <signal.h>
#include <unistd.h>
int fsync(int d) { (void)d; %s }
"""


def with_fsync(folder, body) -> dict[str, str]:
    """The environment of a program for which fsync does something else."""
    (folder / "fsync.c").write_text(FSYNC % body)
    command = ["cc", "-shared", "-fPIC", "-o", "fsync.so", "fsync.c"]
    subprocess.run(command, cwd=folder, check=True)
    return {**os.environ, "LD_PRELOAD": str(folder / "fsync.so")}


def occupy(path, kind, precious):
    """Puts something in a place; links lead to a file of the user."""
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


#: When a wait is given up [s]. It ends what hangs, and is no measure of anything: what takes a busy
#: machine minutes passes, too.
PATIENCE = 900


def wait_for(condition):
    """Returns when the condition holds. The longer the wait, the less often one looks."""
    begin = time.monotonic()
    while not condition():
        waited = time.monotonic() - begin
        assert waited < PATIENCE, "nothing happened"
        time.sleep(min(max(0.005, waited / 10), 0.05))


# --- Processes: what they do is known from the system, not from the time that has passed ---


def facts_of(pid) -> list[str]:
    """Data of the system about a process, from its state on (proc(5), /proc/PID/stat, field 3)."""
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()


def processor_time(pid) -> float:
    """Processor time of a process so far, with the children that it has waited for [s]."""
    return sum(map(int, facts_of(pid)[11:15])) / os.sysconf("SC_CLK_TCK")


def within(seconds) -> list[str]:
    """The beginning of a command that is killed when it has used so much processor time, if any."""
    return ["prlimit", f"--cpu={seconds}"] if seconds else []


def with_parent(*command) -> list:
    """Return a command that ends with the process that starts it, even if that is killed."""
    tied = ["setpriv", "--pdeathsig", "TERM"] if shutil.which("setpriv") else []
    return [*tied, *command]


def is_asleep(pid) -> bool:
    """Whether a process waits for something; not for a disk, nor for a processor."""
    return facts_of(pid)[0] == "S"


def heeds(pid, number) -> bool:
    """Whether a process has a handler for a signal."""
    caught = re.search(r"^SigCgt:\s+(\w+)", Path(f"/proc/{pid}/status").read_text(), re.MULTILINE)
    return bool(int(caught[1], 16) >> (number - 1) & 1)


def has_ended(process) -> bool:
    """Whether a process has ended; the system still knows it until somebody waits for it."""
    how = os.WEXITED | os.WNOHANG | os.WNOWAIT
    return process.returncode is not None or os.waitid(os.P_PID, process.pid, how) is not None


def let_work(process, seconds=0.0):
    """Returns when a run can be stopped and has used so much processor time, or has ended."""
    wait_for(
        lambda: (
            has_ended(process)
            or (heeds(process.pid, signal.SIGTERM) and processor_time(process.pid) >= seconds)
        )
    )


@contextlib.contextmanager
def held(process):
    """A process stands still meanwhile, so that it is where it was found."""
    process.send_signal(signal.SIGSTOP)
    yield
    process.send_signal(signal.SIGCONT)


@contextlib.contextmanager
def filled_pipe():
    """A pipe that takes nothing any more: whoever reads it has stopped reading."""
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
    """Sends a signal; what the process says until its end, which takes less than so long.

    By processor time, with what the `members` use that the process waits for: by the clock it is
    as long as other programs make it.
    """
    before = sum(map(processor_time, [process.pid, *members]))
    os.kill(process.pid, number)  # Popen's own way takes notice of an end, and the facts are gone
    wait_for(lambda: has_ended(process))
    assert processor_time(process.pid) - before < seconds
    return process.communicate()[1]


def frames_in(path, group="particles/disks") -> int:
    """Committed frames, or samples of another group; 0 if there is no file yet."""
    try:
        with h5py.File(path, "r", locking=False) as file:
            return int(file[group]["committed"][()])
    except OSError:
        return 0
