"""Sweeps, in which many runs of one input are executed in parallel, and tables of their results.

    values = {"contact.restitution": [0.8, 0.9], "run.seed": range(8)}
    table = ricochet.sweep("input/gas.nml", values, "runs/scan")
    table = ricochet.ensemble("runs/scan")   # one row per member run; also for runs/ensemble.sh

A sweep can be interrupted at any time; the same call continues it. Its folder contains input.nml,
manifest.txt with the overrides of each member run, and NAME.h5 and NAME.log for each member run.
`runs/ensemble.sh` writes the same files, so that either of the two can continue a sweep of the
other.
"""

import contextlib
import fcntl
import itertools
import json
import multiprocessing
import os
import re
import signal
import stat
import subprocess
import tempfile
import threading
import time
import zlib
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import h5py
import numpy as np

from ..reading.files import RunError, open_file, optional_package, plain
from ..reading.frames import committed
from .inputs import read_input
from .program import STOPPED, ProgramError, find_program, flat, tied, value_text
from .simulation import Simulation

if TYPE_CHECKING:
    import pandas

FINISHED = ": is a finished run, "
BROKE_OFF = ": its run broke off "
LOOK = 0.2  # interval at which a worker checks for an interrupt [s]
LONGEST_NAME = 200  # longest name of a member run [characters]
GOES_ON = re.compile(r"(stopped.*|killed by signal.*|.*--resume continues.*|)")


def sweep(
    system: str | Path | Mapping[str, Any],
    values: Mapping[str, Any] | Iterable[Mapping[str, Any]],
    folder: str | Path,
    executor: Executor | None = None,
) -> "pandas.DataFrame":
    """Run an input with all combinations of the given values of variables.

    Interrupted member runs are continued. Finished member runs are not repeated, but they are
    extended if the end of the run or another variable that may change on a resume has a new value
    in the input.

    Parameters
    ----------
    system : str, Path or mapping
        the input, as for `ricochet.run`
    values : mapping of str to object, or list of them
        a value or a list of values for each variable (None: its default), the first varying
        slowest; a list of such dictionaries varies several variables together
    folder : str or Path
        folder for the files of the member runs
    executor : concurrent.futures.Executor, optional
        executor whose processes can access the folder [all cores that this process may use]

    Returns
    -------
    pandas.DataFrame
        table of the member runs, as returned by `ensemble`

    Raises
    ------
    ProgramError
        if the program refuses the input of a member run; all inputs are checked before the first
        run
    RunError
        if the folder or a log is unusable, or the name of a member run is too long
    ValueError
        if `values` is empty

    Examples
    --------
    >>> restitutions = [1, 0.9]
    >>> table = ricochet.sweep(small, {"contact.restitution": restitutions}, folder / "xi")
    >>> list(table["state"])
    ['finished', 'finished']
    >>> linked = [{"species.speed": v, "stop.collisions": 10 * v} for v in (1, 2)]
    >>> list(ricochet.sweep(small, linked, folder / "linked")["collisions"])
    [10, 20]
    """
    # imported here, so that a missing package is reported before the runs
    optional_package("pandas", "a table of members")
    folder = Path(folder)
    text = read_input(system, folder / "input")
    members = [
        settings
        for part in ([values] if isinstance(values, Mapping) else values)
        for settings in combinations(choices_of(part))
    ]
    if not any(members):
        raise ValueError("sweep: there are no values; ricochet.run makes a single run")
    check(text, members)
    overrides = names_of(members, read_manifest(folder))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise RunError(f"{folder}: cannot be a folder of member runs: {problem.strerror}") from None
    remember(folder, text, overrides)
    mark = folder / f".sweep {os.getpid()} {threading.get_ident()} {os.uname().nodename}"
    for left in folder.glob(".sweep * * *"):
        wanted(left)
    mark.touch()
    pool, waiting = executor or ThreadPoolExecutor(cores()), []
    try:
        for name, own in overrides.items():
            waiting.append(pool.submit(run_member, folder, name, own, mark))
        for member in waiting:
            member.result()
    finally:
        mark.unlink(missing_ok=True)  # running members then write a checkpoint and stop
        for member in waiting:
            member.cancel()
        if executor is None:
            pool.shutdown()
    return ensemble(folder)


def cores() -> int:
    """Return the number of cores that this process may use, such as those of a cluster's job."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def choices_of(values: Mapping[str, Any]) -> dict[str, list[Any]]:
    """Return a dictionary with the list of values of each variable."""
    return {
        name: [own] if isinstance(own, str) or not isinstance(own, Iterable) else list(own)
        for name, own in flat(values).items()
    }


def combinations(choices: Mapping[str, list[Any]]) -> Iterator[dict[str, Any]]:
    """Yield the settings of each combination of values; the first variable varies slowest."""
    pairs = [[(name, value) for value in own] for name, own in choices.items()]
    yield from map(dict, itertools.product(*pairs))


def check(text: str, members: Iterable[Mapping[str, Any]]) -> None:
    """Raise ProgramError if the program refuses one of the values.

    Each value of a variable, except seeds, is checked once, in the first member run that uses it.
    """
    known: set[str] = set()
    for settings in members:
        pairs = {words_of({name: settings[name]}) for name in settings.keys() - {"run.seed"}}
        if known and pairs <= known:
            continue
        known |= pairs or {""}
        with Simulation(text, settings) as member:
            if member._endless():
                raise ProgramError("stop: no rule ends a member", 2)


def names_of(members: Iterable[Mapping[str, Any]], taken: Mapping[str, str]) -> dict[str, str]:
    """Return a dictionary from the names of the member runs to their overrides in the manifest."""
    found: dict[str, str] = {}
    known = dict(taken)
    for settings in members:
        words, name = words_of(settings), name_of(settings)
        altered = any(isinstance(value, str | Path) for value in settings.values())
        if altered and words != known.get(name, words):
            name += f"_{zlib.crc32(words.encode(errors='surrogateescape')):08x}"
        if len(name) > LONGEST_NAME:
            raise RunError(
                f"sweep: the name {name[:40]}... of a member would have {len(name)} characters, "
                f"allowed: {LONGEST_NAME}; vary fewer or shorter values"
            )
        found[name] = known[name] = words
    return found


def name_of(settings: Mapping[str, Any]) -> str:
    """Return the name that `sweep` and runs/ensemble.sh give to a member run, from its settings."""
    parts = []
    for variable, value in settings.items():
        short = variable.removeprefix("species.")
        if "." not in short.partition(".")[2] and not variable.startswith("species."):
            short = short.partition(".")[2]
        short = short.replace("(", "_").replace(")", "")  # box.gravity(2)
        word = "default" if value is None else value_text(variable, value, ",")
        parts.append(f"{short}_{re.sub('[^A-Za-z0-9.+-]', '_', word)}")
    return "_".join(parts)


def words_of(settings: Mapping[str, object]) -> str:
    """Return the overrides as text for a line of the manifest."""
    words = {
        name: "" if value is None else value_text(name, value, ",")
        for name, value in settings.items()
    }
    return " ".join(f"--set {name}={word}" for name, word in words.items())


def read_manifest(folder: Path) -> dict[str, str]:
    """Return a dictionary from the names of the member runs in a manifest to their overrides."""
    path = folder / "manifest.txt"
    if not path.is_file():
        return {}
    lines = path.read_text(encoding="utf-8", errors="surrogateescape").splitlines()
    return {name: rest for name, _, rest in (line.partition("\t") for line in lines)}


def remember(folder: Path, text: str, overrides: Mapping[str, str]) -> None:
    """Write input.nml and manifest.txt, unless this would alter settings of runs that have data."""
    door = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(door, fcntl.LOCK_EX)  # only one command at a time, as in runs/ensemble.sh
        remember_alone(folder, text, overrides)
    finally:
        os.close(door)


def remember_alone(folder: Path, text: str, overrides: Mapping[str, str]) -> None:
    """Write input.nml and manifest.txt while this process holds the lock of the folder."""
    before = read_manifest(folder)
    path = folder / "input.nml"
    old = path.read_text(encoding="utf-8", errors="surrogateescape") if path.is_file() else text
    data = {name for name in before if any(files_of(folder, name)) and not failed(folder, name)}
    if old != text and data and not may_continue(folder, old, text):
        raise RunError(
            f"{folder}: holds members of another input (see {path}); choose another folder"
        )
    for name in data & overrides.keys():
        if before[name] != overrides[name]:
            raise RunError(
                f"{folder}: holds a member '{name}' with other settings ({before[name]})"
            )
    from_elsewhere = [] if path.is_file() else [files_of(folder, name)[0] for name in overrides]
    if not path.is_file() or old != text:
        put(path, text)  # becomes newer than finished members, which `run_member` therefore extends
    for result in filter(None, from_elsewhere):
        result.touch()  # so that this run is left as it is
    lines = sorted(f"{name}\t{rest}\n" for name, rest in {**before, **overrides}.items())
    put(folder / "manifest.txt", "".join(lines))


def may_continue(folder: Path, old: str, new: str) -> bool:
    """Return whether two inputs differ only in variables that may change on a resume."""
    program = find_program()
    table = json.loads(subprocess.check_output([program, "--print-variables"]))
    kept = []
    for text in (old, new):
        with tempfile.NamedTemporaryFile("w", suffix=".nml", dir=folder) as file:
            file.write(text)
            file.flush()
            printed = subprocess.run(
                [program, "--print-input", file.name], capture_output=True, check=False
            )
        if printed.returncode:
            return False
        groups = [
            (group["group"], group["name"], name, value)
            for group in json.loads(printed.stdout)
            for name, value in group["values"].items()
            if not table[group["group"]][name]["resumable"]
        ]
        kept.append(sorted(groups, key=str))
    return kept[0] == kept[1]


def put(path: Path, text: str) -> None:
    """Write a file atomically."""
    new = path.with_name(f".new.{os.getpid()}.{path.name}")
    new.write_text(text, encoding="utf-8", errors="surrogateescape")
    new.replace(path)


def files_of(folder: Path, name: str) -> tuple[Path | None, Path | None]:
    """Return the paths of the finished and the unfinished output of a member run, or None.

    While a finished run is being extended, both files exist, and the run counts as unfinished.
    """
    whole, part = folder / f"{name}.h5", folder / f"{name}.h5.part"
    unfinished = part if part.is_file() else None
    return whole if whole.is_file() and not unfinished else None, unfinished


def log_of(path: Path) -> TextIO:
    """Open the log of a member run for appending, refusing symbolic and hard links."""
    way = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
    try:
        log = os.fdopen(os.open(path, way, 0o666), "a")
    except OSError as problem:
        reason = "is a link" if path.is_symlink() else problem.strerror
        raise RunError(f"{path}: {reason}; remove it, or choose another folder") from None
    status = os.fstat(log.fileno())
    if not stat.S_ISREG(status.st_mode) or status.st_nlink != 1:
        log.close()
        raise RunError(f"{path}: is not an ordinary file: remove it, or choose another folder")
    return log


def run_member(folder: Path, name: str, overrides: str, mark: Path) -> int:
    """Execute a member run, unless it is finished or running elsewhere; return its exit code."""
    if not wanted(mark):
        return STOPPED
    with log_of(folder / f"{name}.log") as log:
        try:
            fcntl.flock(log, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return 0
        finished, unfinished = files_of(folder, name)
        if finished and not is_older(finished, folder / "input.nml"):
            return 0
        if before := last_words(folder, name):
            print(file=log, flush=True)  # separates this attempt from an earlier one
        words = [word for pair in pairs_of(overrides) for word in ("--set", "=".join(pair))]
        output = ["-o", folder / f"{name}.h5", "--quiet", *words]
        command = [find_program(), folder / "input.nml", *output]
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        pipes = {"stdin": subprocess.DEVNULL, "stdout": log, "stderr": log, "env": environment}
        resume = ["--resume"] * bool(finished or unfinished)
        code = finished_with([*command, *resume], mark, **pipes)
        if finished and FINISHED in last_words(folder, name):
            finished.touch()  # the run satisfies the new stop conditions already
            return 0
        if unfinished and BROKE_OFF in last_words(folder, name):
            code = finished_with(command, mark, **pipes)  # start again from the beginning
        if code < 0:
            memory = " (out of memory?)" * (-code == signal.SIGKILL)
            moment = time.strftime("%FT%T%z")
            again = ", twice" * before.startswith("killed by signal")
            given_up = "given up after three attempts: " * (bool(again) and "twice" in before)
            kill = f"{given_up}killed by signal {-code}{memory}{again}, {moment}"
            print(f"{kill} on {os.uname().nodename}", file=log)
        return code


def is_older(path: Path, other: Path) -> bool:
    """Return whether the file `path` was modified before the file `other`."""
    return path.stat().st_mtime_ns < other.stat().st_mtime_ns


def is_there(pid: int) -> bool:
    """Return whether a process with the id `pid` exists on this machine."""
    try:
        os.kill(pid, 0)
    except OSError as problem:
        return isinstance(problem, PermissionError)  # the process belongs to another user
    return True


def wanted(mark: Path) -> bool:
    """Return whether the call of `sweep` that created the file `mark` is still in progress.

    The file is deleted if the process that created it on this machine no longer exists.
    """
    _, pid, _, host = mark.name.split(" ", 3)
    if host == os.uname().nodename and not is_there(int(pid)):
        mark.unlink(missing_ok=True)
    return mark.exists()


def finished_with(command: list[Any], mark: Path, **pipes: Any) -> int:
    """Run a command and return its exit code; stop it if the file `mark` is deleted."""
    process: subprocess.Popen[bytes] = subprocess.Popen(tied(command), **pipes)
    try:
        while True:
            with contextlib.suppress(subprocess.TimeoutExpired):
                return process.wait(LOOK)
            if not wanted(mark):
                process.terminate()
    finally:
        process.terminate()  # no effect if the command has ended
        parent = multiprocessing.parent_process()
        if parent and parent.pid and not is_there(parent.pid):
            os._exit(STOPPED)  # otherwise this process of a pool would wait for work forever


def pairs_of(overrides: str) -> Iterator[tuple[str, str]]:
    """Yield variable and value, quoted or not, of each override in a line of a manifest."""
    parts = overrides.removeprefix("--set ").split(" --set ") if overrides else []
    while parts:
        part = parts.pop(0)
        while parts and "='" in part and part.count("'") % 2:
            part += f" --set {parts.pop(0)}"
        name, _, value = part.strip().partition("=")
        yield name.strip(), value.strip()


def last_words(folder: Path, name: str) -> str:
    """Return the last line in the log of a member run."""
    path = folder / f"{name}.log"
    lines = path.read_text(errors="replace").splitlines() if path.is_file() else []
    return lines[-1] if lines else ""


def failed(folder: Path, name: str) -> bool:
    """Return whether the log of a member run ends with a reason why the run cannot continue."""
    words = last_words(folder, name)
    return not (files_of(folder, name)[0] or GOES_ON.fullmatch(words))


# --- the table ---


def ensemble(folder: str | Path) -> "pandas.DataFrame":
    """Return a table of the member runs in a folder.

    Parameters
    ----------
    folder : str or Path
        folder created by `sweep` or runs/ensemble.sh

    Returns
    -------
    pandas.DataFrame
        one row per member run: `member`, each override by its full name, `seed`, `state`
        ('finished', 'unfinished' or 'failed') and its `reason`, `wall_time` [s], and the last value
        of each scalar observable

    Raises
    ------
    RunError
        if the folder does not exist or contains no member run

    Examples
    --------
    >>> table = ricochet.sweep(small, {"run.seed": range(1, 3)}, folder / "sweep")
    >>> ricochet.ensemble(folder / "sweep").equals(table)
    True
    """
    return optional_package("pandas", "a table of members").DataFrame(gathered(Path(folder)))


def gathered(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of the table of `ensemble`."""
    if not folder.is_dir():
        raise RunError(f"{folder}: there is no such folder")
    overrides = read_manifest(folder)
    stems = {
        path.name.partition(".h5")[0] for path in (*folder.glob("*.h5"), *folder.glob("*.h5.part"))
    }
    overrides |= dict.fromkeys(stems - overrides.keys(), "")
    if not overrides:
        raise RunError(f"{folder}: holds no members: neither manifest.txt nor *.h5")
    return [row_of(folder, name, overrides[name]) for name in sorted(overrides, key=in_order)]


def in_order(name: str) -> list[tuple[int, float, str]]:
    """Return a sort key for the name of a member run that orders numbers by value."""
    parts = re.split(r"(\d+\.?\d*(?:e[+-]?\d+)?)", name)
    return [(0, float(part), "") if k % 2 else (1, 0.0, part) for k, part in enumerate(parts)]


def row_of(folder: Path, name: str, overrides: str) -> dict[str, Any]:
    """Return the row of a member run in the table of `ensemble`."""
    row: dict[str, Any] = {"member": name}
    row |= {variable: typed(value) for variable, value in pairs_of(overrides)}
    finished, unfinished = files_of(folder, name)
    said = last_words(folder, name)
    row |= {"seed": row.get("run.seed"), "state": "finished", "reason": "", "wall_time": np.nan}
    if not finished:
        row["state"] = "failed" if failed(folder, name) else "unfinished"
        row["reason"] = said or ("" if unfinished else "has not begun")
    path = finished or unfinished
    if path:
        try:
            row |= last_values(path)
        except RunError as problem:
            row |= {"state": "failed", "reason": str(problem)}
    return row


def typed(value: str) -> object:
    """Convert an override to a number, a bool, a tuple of numbers, or a string."""
    if not value:
        return None
    if value.strip(".").lower() in ("true", "false", "t", "f"):
        return value.strip(".").lower()[0] == "t"
    numbers: list[float] = []
    for word in value.split(","):
        for kind in (int, float):
            try:
                numbers.append(kind(word.lower().replace("d", "e") if kind is float else word))
                break
            except ValueError:
                continue
        else:
            quoted = len(value) > 1 and value[0] == value[-1] and value[0] in "'\""
            return value[1:-1].replace(2 * value[0], value[0]) if quoted else value
    return numbers[0] if len(numbers) == 1 else tuple(numbers)


def last_values(path: Path) -> dict[str, Any]:
    """Return the seed, the wall time and the last value of each scalar observable of a run.

    A sweep may have 10^5 files; the low-level functions of h5py read them in half of the time.
    """
    with open_file(path) as file:
        row = {"seed": plain(file["parameters/run"].attrs["seed"])}
        row["wall_time"] = plain(file["provenance"].attrs.get("wall_time", np.nan))
        count = committed(file, "observables")
        paths: list[bytes] = []
        observables = h5py.h5g.open(file.id, b"observables")
        if count:
            observables.links.visit(paths.append)
        one = h5py.h5s.create_simple((1,))
        for name in paths:
            if not name.endswith(b"/value"):
                continue
            data = h5py.h5d.open(observables, name)
            space = data.get_space()
            if space.get_simple_extent_ndims() == 1:
                space.select_hyperslab((count - 1,), (1,))
                value = np.empty(1, data.dtype)
                data.read(one, space, value)
                row[name.removesuffix(b"/value").decode()] = plain(value[0])
    return row
