"""Feeds the program checkpoints with a right checksum and a wrong content, and judges the run.

Whatever a checkpoint says, the run that resumes from it is refused in one line, or it goes on and
ends as any other: no crash, no hang, no NaN in its output, no disk outside the box.

    python tests/runs/fuzz_checkpoint.py --count 2000 --program build/ricochet
"""

import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import fuzzing
import h5py
import numpy as np

from whole_runs import FILES, FINISHED, STOPPED, USAGE, committed, seal

HARMLESS = {"finished", "stopped", "refused", "broke off"}
CHECKPOINT, OUTPUT = "gas.chk.h5", "gas.h5.part"
MOST_SECONDS = 20  # of processor time
#: For a program with sanitizers: in damaged files HDF5 itself asks for absurd sizes, and leaks.
SANITIZER = "detect_leaks=0:allocator_may_return_null=1:log_path=sanitizer"
ENVIRONMENT = os.environ | {"ASAN_OPTIONS": SANITIZER, "UBSAN_OPTIONS": "log_path=sanitizer"}
BROKEN = 4

DISKS = """&species name = 'light' count = 14 radius = 0.03 temperature = 1 /
&species name = 'heavy' count = 6 radius = 0.05 mass = 4 temperature = 1 /
"""
SYSTEMS = {
    "walls": """&box gravity = 0, -1 /
        &contact restitution = 0.99 contact_time = 1e-3 / &stop time = 20 /
        &output frames_every_time = 1 observables_every_time = 0.5 event_log = .true. /""",
    "periodic": """&box boundary = 'periodic', 'periodic' / &stop collisions = 3000 /
        &contact restitution = 0.999 / &output frames_every_collisions = 200 /""",
    "pairs": """&box boundary = 'periodic', 'wall' / &stop events = 3000 /
        &obstacle name = 'peg' centre = 0.5, 0.5 radius = 0.1 / &run search = 'pairs' /
        &output observables_every_events = 100 /""",
    "steps": """&run dynamics = 'steps' dt = 2e-3 /
        &box gravity = 0, -1 boundary = 'periodic', 'wall' /
        &contact restitution = 0.99 contact_time = 5e-3 / &stop time = 20 /
        &output frames_every_time = 1 /""",
}

#: A run that has finished goes on for one step.
AT_ONCE = ["stop.wall_clock=1e-9", "--resume"]

REALS = [np.nan, np.inf, -np.inf, 0, -0.0, -1, 0.5, 1e-310, 1e9, 1e99, -1e99, 1e120, 1e200, -1e300]
INTEGERS = [-1, 0, 1, 2, 3, 21, 10**9, 2**31 - 1, -(2**31), 2**53, 2**53 + 2, 2**63 - 1, -(2**63)]


def put(name, place, value, file):
    """One value, or all values, of a dataset."""
    if file[name].dtype == np.int32:
        value = max(-(2**31), min(value, 2**31 - 1))
    file[name][place] = value


def scale(name, factor, file):
    file[name][...] = (file[name][...] * factor).astype(file[name].dtype)


def swap(name, a, b, file):
    values = file[name][:]
    values[[a, b]] = values[[b, a]]
    file[name][:] = values


def copy_row(a, b, file):
    """A disk that is there twice."""
    for dataset in file["disks"].values():
        dataset[b] = dataset[a]


def remake(name, change, file):
    """Another dataset of this name, `change(values)`; or what `change` calls for."""
    values = file[name][()]
    del file[name]
    change(file, name, values)


def other(change):
    """A dataset made of the values of the old one."""

    def make(file, name, values):
        file[name] = change(values)

    return make


def external(file, name, values):
    values = np.asarray(values)
    kind = {"shape": values.shape, "dtype": values.dtype}
    file.create_dataset(name, **kind, external=[("fifo", 0, max(values.nbytes, 8))])


def enormous(file, name, values):
    file.create_dataset(name, (2**40, 2**24), chunks=(64, 64), dtype=np.asarray(values).dtype)


def virtual(file, name, values):
    layout = h5py.VirtualLayout(np.shape(values), np.asarray(values).dtype)
    layout[...] = h5py.VirtualSource("fifo", "x", np.shape(values))
    file.create_virtual_dataset(name, layout)


SHAPES = {
    "gone": lambda file, name, values: None,
    "a group": lambda file, name, values: file.create_group(name),
    "a loop": lambda file, name, values: file.__setitem__(name, h5py.SoftLink(f"/{name}")),
    "elsewhere": lambda file, name, values: file.__setitem__(name, h5py.ExternalLink("fifo", "x")),
    "outside": external,
    "virtual": virtual,
    "enormous": enormous,
    "no values": other(lambda values: h5py.Empty("f8")),
    "one more": other(lambda values: np.append(values, values)),
    "one less": other(lambda values: np.atleast_1d(values)[:-1]),
    "a scalar": other(lambda values: np.ravel(values)[0] if np.size(values) else 0),
    "a column": other(lambda values: np.reshape(values, (-1, 1))),
    "texts": other(lambda values: np.full(np.shape(values), b"12")),
    "long texts": other(lambda values: "x" * 100000),
    "reals": other(lambda values: np.full(np.shape(values), np.nan)),
    "short reals": other(lambda values: np.full(np.shape(values), 1.5, np.float32)),
    "integers": other(lambda values: np.full(np.shape(values), 1)),
    "unsigned": other(lambda values: np.full(np.shape(values), 2**64 - 1, np.uint64)),
    "pairs": other(lambda values: np.zeros(np.shape(values), "i4,f8")),
}

#: Those that change more than values.
FORMS = set(SHAPES) - {"reals", "short reals", "integers", "unsigned"}


def edits(path: Path, rng: random.Random) -> list[tuple]:
    """All injuries to single datasets of a checkpoint, as (words, function of the open file)."""
    found = []
    with h5py.File(path) as file:
        names: list[str] = []
        file.visititems(lambda name, item: names.append(name) if hasattr(item, "shape") else None)
        for name in names:
            item = file[name]
            for kind, how in SHAPES.items():
                found.append((f"{name}: {kind}", partial(remake, name, how)))
            if item.dtype.kind not in "if":
                continue
            row = rng.randrange(len(item)) if item.shape else ()
            for value in REALS if item.dtype.kind == "f" else INTEGERS:
                found.append((f"{name}[{row}] = {value}", partial(put, name, row, value)))
                found.append((f"{name}[:] = {value}", partial(put, name, ..., value)))
            for factor in (-1, 2, 1 + 1e-9):
                found.append((f"{name} * {factor}", partial(scale, name, factor)))
            for value in (item[row] + 1, item[row] - 1):
                found.append((f"{name}[{row}] = {value}", partial(put, name, row, value)))
            if item.size > 1:
                found.append((f"{name}: swapped", partial(swap, name, row, row - 1)))
        if "disks" in file:
            found.append(("a disk twice", partial(copy_row, 3, 4)))
    return found


def garble(rng: random.Random, path: Path) -> str:
    """Random bytes anywhere behind the header."""
    data = bytearray(path.read_bytes())
    places = [rng.randrange(512, len(data)) for _ in range(rng.choice([1, 1, 3, 10, 100]))]
    for place in places:
        flipped = data[place] ^ 1 << rng.randrange(8)
        data[place] = rng.choice([0, 255, rng.randrange(256), flipped])
    path.write_bytes(data)
    return f"bytes {places}"


def stop_runs(program: str, folder: Path) -> None:
    """A run of each system that has stopped half way, one step after its 300th collision."""
    for name, text in SYSTEMS.items():
        (folder / name).mkdir()
        (folder / name / "gas.nml").write_text(DISKS + text + "\n")
        os.mkfifo(folder / name / "fifo")
        command = [program, "gas.nml", "-o", "gas.h5", "--quiet"]
        for stop, code in (["stop.collisions=300"], FINISHED), (AT_ONCE, STOPPED):
            part = [*command, "--set", *stop]
            run = subprocess.run(part, cwd=folder / name, capture_output=True, check=False)
            assert run.returncode == code, run.stderr


def flaw_of(path: Path) -> str | None:
    """What is wrong in the samples of a run that went on."""
    for name, values in committed(path).items():
        if not np.isfinite(values).all():
            return f"{name} is not finite"
        if name.endswith("/time") and (np.diff(values) < 0).any():
            return f"{name} decreases"
        if name.endswith("/position/value") and (np.abs(values - 0.5) > 0.52).any():
            return f"{name}: outside the box"
    return None


def judge(program: str, runs: Path, case: tuple) -> tuple[str, str]:
    """(a harmless verdict or the fault, details) for one injury to the files of a system."""
    number, system, injure = case
    folder = runs / str(number)
    subprocess.run(["cp", "-r", "--sparse=always", runs / system, folder], check=True)
    injure(folder)
    command = [program, "gas.nml", "-o", "gas.h5", "--resume", "--set", "stop.wall_clock=10"]
    run = fuzzing.limited([*command, "--quiet"], MOST_SECONDS, cwd=folder, env=ENVIRONMENT)
    try:
        if not run:
            return "hang", ""
        errors = run.stderr.decode("utf-8", "replace").rstrip("\n")
        return verdict_of(run.returncode, errors, folder)
    finally:
        shutil.rmtree(folder)


def verdict_of(status: int, errors: str, folder: Path) -> tuple[str, str]:
    """The same from what the program left."""
    known = {FINISHED: "finished", STOPPED: "stopped", BROKEN: "broke off"}
    known |= {USAGE: "refused", FILES: "refused"}
    if status not in known or re.search(r"backtrace|SIG[A-Z]+|libgfortran", errors):
        reports = [path.read_text() for path in folder.glob("sanitizer.*")]
        return "crash", "\n".join([f"status {status}", errors, *reports])
    if errors.count("\n") or bool(errors) != (status != FINISHED):
        return "unclear message", errors
    if known[status] in ("finished", "stopped"):
        flaw = flaw_of(folder / ("gas.h5" if status == FINISHED else OUTPUT))
        if flaw:
            return "nonsense", flaw
    return known[status], errors


@dataclass(repr=False)
class Injury:
    """What is done to one of the files of a stopped run; its words tell it in a report."""

    file: str
    words: str
    edit: Callable | random.Random

    def __repr__(self) -> str:
        return f"{self.file}: {self.words}"

    def __call__(self, folder: Path) -> None:
        path = folder / self.file
        if isinstance(self.edit, random.Random):
            self.words = garble(self.edit, path)
        else:
            with h5py.File(path, "r+") as file:
                self.edit(file)
        if self.file == CHECKPOINT:
            seal(path)


def cases(folder: Path, count: int, seed: int):
    """(number, system, injury): every third of random bytes, the others a sample of all edits."""
    rng = random.Random(seed)
    whole = [
        (system, Injury(file, *edit))
        for system in SYSTEMS
        for file in (CHECKPOINT, OUTPUT)
        for edit in edits(folder / system / file, rng)
        if file == CHECKPOINT or is_structure(edit[0])
    ]
    rng.shuffle(whole)
    for number in range(count):
        if number % 3 == 2 or not whole:
            system = rng.choice(list(SYSTEMS))
            yield number, system, Injury(CHECKPOINT, "bytes", random.Random(f"{seed} {number}"))
        else:
            yield number, *whole.pop()


def is_structure(words: str) -> bool:
    """Of the samples so far what the run relies on: counters, and shapes of the first element."""
    name, _, kind = words.partition(": ")
    return "committed" in name or (name.startswith("particles/disks/position/") and kind in FORMS)


def fuzz(program: str, count: int, seed: int) -> Counter:
    """Verdicts by kind; harmful cases are shown on stderr."""
    with tempfile.TemporaryDirectory() as name:
        stop_runs(program, Path(name))
        judged = partial(judge, program, Path(name))
        return fuzzing.tally(judged, cases(Path(name), count, seed), HARMLESS)


if __name__ == "__main__":
    sys.exit(fuzzing.run(__doc__, fuzz, HARMLESS, count=2000))
