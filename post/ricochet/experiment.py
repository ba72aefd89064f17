"""A run for a page: its files, its process and its limits, and what is wrong with its input.

The kernel has limits of its own for every program that is started here, whatever becomes of this
one.
"""

import os
import re
import resource
import subprocess
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from .files import RunError
from .live import Live
from .namelists import place_of, scan
from .program import find_program
from .reader import Run, read_run

DISKS = 20000  # of a run
SECONDS = 60  # that a run may take, until someone goes on with it
MEGABYTES = 200  # of the files of a run
MEMORY = 2 << 30  # bytes of a run
CHECK = 20  # seconds for a check, and for the samples that are shown with the inputs


class Refused(Exception):
    """A request that makes no sense, or comes at a wrong time; the message is one line."""


@dataclass
class Experiment:
    """A run: the input file, with the groups added to it, and what --set changes."""

    folder: Path
    name: str  # of the input, without .nml
    text: str
    settings: dict[str, str]
    added: bool  # whether the file has more groups than the input
    process: subprocess.Popen | None = None
    started: float = 0.0
    reason: str = ""  # why it was stopped
    live: Live | None = None

    @property
    def input(self) -> Path:
        """The input file."""
        return self.folder / f"{self.name}.nml"

    @property
    def running(self) -> bool:
        """Whether the program is at work."""
        return self.process is not None and self.process.poll() is None

    @property
    def output(self) -> Path | None:
        """The output file, finished or not; None if there is none."""
        final = self.folder / f"{self.name}.h5"
        return next((path for path in (final, Path(f"{final}.part")) if path.exists()), None)

    def command(self, *options: str) -> list[str]:
        """How the program is called."""
        pairs = [f"{name}={value}" for name, value in self.settings.items()]
        words = [word for pair in pairs for word in ("--set", pair)]
        return [find_program(), *options, *words, "--", str(self.input)]

    def said(self) -> str:
        """The messages of the program."""
        with suppress(OSError):
            return self.without_folder((self.folder / "said").read_text(errors="replace")).strip()
        return ""

    def without_folder(self, text: str) -> str:
        """Messages with plain names of files."""
        return text.replace(f"{self.folder}{os.sep}", "")

    def over_limit(self) -> str:
        """Which limit the run has passed; empty if none."""
        if time.monotonic() > self.started + SECONDS:
            return f"stopped after {SECONDS} s, which a run may take here; it can go on"
        taken = sum(512 * path.stat().st_blocks for path in self.folder.iterdir())
        if taken > 1e6 * MEGABYTES:
            return f"stopped: its files have {MEGABYTES} MB, which is all that a run may take here"
        return ""

    def begin(self, resume: bool) -> None:
        """Start the program; Refused if it cannot be had."""
        options = ["--quiet", "-o", str(self.folder / f"{self.name}.h5")]
        options += ["--resume"] * resume
        with (self.folder / "said").open("w") as said:
            self.process = limited(self.command(*options), stdout=subprocess.DEVNULL, stderr=said)
        self.started, self.reason = time.monotonic(), ""

    def stop(self, reason: str) -> None:
        """Ask the program to end; it writes a checkpoint."""
        if self.running:
            self.reason = reason
            self.process.terminate()

    def end(self) -> None:
        """Return when the program has ended, which it is forced to if need be."""
        if self.process is not None:
            self.process.terminate()
            try:
                self.process.wait(5)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()

    def opened(self) -> Run:
        """The run as it is; waits for its first frame.  Raises Refused if there is none."""
        while True:
            over = not self.running
            with suppress(RunError):
                return read_run(self.output or "")
            if over:
                raise Refused(self.said() or "the run has ended before its first frame")
            time.sleep(0.02)


def limited(command: list[str], **pipes) -> subprocess.Popen:
    """Start a program that the kernel ends far beyond the limits, where the kernel can."""
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, **pipes)
    if hasattr(resource, "prlimit"):
        for kind, most in (
            (resource.RLIMIT_CPU, 2 * SECONDS),
            (resource.RLIMIT_FSIZE, 10_000_000 * MEGABYTES),  # a part of it is allocated ahead
            (resource.RLIMIT_AS, MEMORY),
        ):
            with suppress(ProcessLookupError):
                resource.prlimit(process.pid, kind, (most, most))
    return process


def check(experiment: Experiment, groups: Mapping[str, Mapping]) -> list[dict[str, str]]:
    """What is wrong with the input: the lines of --check, each with the variable it concerns."""
    process = limited(
        experiment.command("--check"), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        said, complaint = process.communicate(timeout=CHECK)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return [{"place": "", "text": f"placing the disks takes longer than {CHECK} s; take fewer"}]
    if process.returncode:
        lines = experiment.without_folder(complaint).splitlines()
        lines = lines or ["the program was ended, because it needed too much memory or time"]
        places = [concerned(line, experiment, groups) for line in lines]
        return [{"place": at, "text": line} for at, line in zip(places, lines, strict=True)]
    over = [
        f"{most} {unit}"
        for unit, most in (("disks", DISKS), ("MB", MEGABYTES))
        if any(int(count) > most for count in re.findall(rf"(\d+) {unit}\b", said))
    ]
    said = experiment.without_folder(said).strip()
    text = f"{said}; a run here may have {' and '.join(over)}"
    return [{"place": "", "text": text}] if over else []


def concerned(line: str, experiment: Experiment, groups: Mapping[str, Mapping]) -> str:
    """The variable that a message of the program is about, as --set names it, or its group."""
    if found := re.match(r"--set ([\w.-]+)=", line):
        return found[1]
    found = re.match(r"\S+?\.nml(?::(\d+))?: (\w+)(\.\w+)?", line)
    if not found:
        return ""
    number, kind, name = found[1], found[2], found[3] or ""
    own = [group for group in scan(experiment.text) if group.kind == kind]
    for group in own:
        first, last = (experiment.text.count("\n", 0, at) + 1 for at in (group.start, group.end))
        if len(own) == 1 or (number and first <= int(number) <= last):
            return place_of(group, groups) + name
    return kind + name if kind in groups and "name" not in groups[kind] else ""
