"""The laboratory: pages of a browser, each with a run at a time, and inputs that they can change.

A page has a number that nobody guesses, and a folder.  Its run is stopped, with a checkpoint, by a
limit or when the page has not been heard of for a while; its files go when it says goodbye.  The
kernel has limits of its own for every program that is started here, whatever becomes of this one.
"""

import json
import os
import re
import resource
import secrets
import shlex
import shutil
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from .files import RunError
from .live import Live
from .program import STOPPED, find_program, namelist, value_text
from .reader import Run, read_run

PAGES = 8  # at a time
SILENCE = 90.0  # seconds, after which a page is gone; browsers let hidden pages speak once a minute
FRAMES = 200  # of a run whose input does not say how many

DISKS = 20000  # of a run
SECONDS = 60  # that a run may take, until someone goes on with it
MEGABYTES = 200  # of the files of a run
MEMORY = 2 << 30  # bytes of a run
CHECK = 20  # seconds for a check, and for the samples that are shown with the inputs


# --- inputs, as the program understands them ---


def printed(*words: str | Path) -> object:
    """The JSON that the program prints; mistakes of an input do not matter here."""
    said = subprocess.run([find_program(), *words], capture_output=True, text=True, check=False)
    return json.loads(said.stdout or "[]")


def groups_of(path: Path, settings: Mapping[str, str] | None = None) -> list[dict]:
    """The groups of an input file with what --set changes, each with its `place` for --set."""
    groups = printed("--print-input", *options(settings or {}), path)
    return [
        group | {"place": ".".join(filter(None, (group["group"], group["name"])))}
        for group in groups
    ]


def options(settings: Mapping[str, str]) -> list[str]:
    """What the program is told of settings."""
    return [word for name, value in settings.items() for word in ("--set", f"{name}={value}")]


def setting(value: object) -> str:
    """A value as --set has it."""
    if isinstance(value, list):
        return ",".join(map(setting, value))
    return value if isinstance(value, str) else value_text("", value)


def edited(path: Path, settings: Mapping[str, str]) -> bytes:
    """The file with what --set would set; comments stay outside the groups that change."""
    text, before, new = path.read_bytes(), groups_of(path), groups_of(path, settings)
    for number, group in reversed(list(enumerate(new))):
        words = namelist({group["group"]: group["values"]}).encode().rstrip()
        if group["from"] is None:
            text = text.rstrip() + b"\n\n" + words + b"\n"
        elif group["values"] != before[number]["values"]:
            text = text[: group["from"]] + words + text[group["to"] :]
    return text


# --- runs ---


@dataclass
class LabRun:
    """A run: its input file, with the groups added to it, and what --set changes."""

    folder: Path
    name: str  # of the input, without .nml
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

    def command(self, *more: str) -> list[str]:
        """How the program is called."""
        return [find_program(), *more, *options(self.settings), "--", str(self.input)]

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
        """Start the program."""
        more = ["--quiet", "-o", str(self.folder / f"{self.name}.h5"), *["--resume"] * resume]
        with (self.folder / "said").open("w") as said:
            self.process = limited(self.command(*more), stdout=subprocess.DEVNULL, stderr=said)
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
        """The run as it is; waits for its first frame.  Raises RunError if there is none."""
        while True:
            over = not self.running
            for ending in (".h5", ".h5.part"):
                with suppress(RunError):
                    return read_run(self.folder / f"{self.name}{ending}")
            if over:
                raise RunError(self.said() or "the run has ended before its first frame")
            time.sleep(0.02)

    def problems(self) -> list[dict[str, str]]:
        """What is wrong with the input: lines of --check, each with the variable it concerns."""
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        process = limited(self.command("--check"), **pipes)
        try:
            said, complaint = map(self.without_folder, process.communicate(timeout=CHECK))
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            words = f"placing the disks takes longer than {CHECK} s; take fewer"
            return [{"place": "", "text": words}]
        if process.returncode:
            lines = complaint.splitlines()
            lines = lines or ["the program was ended, because it needed too much memory or time"]
            return [{"place": self.concerned(line), "text": line} for line in lines]
        over = [
            f"{most} {unit}"
            for unit, most in (("disks", DISKS), ("MB", MEGABYTES))
            if any(int(count) > most for count in re.findall(rf"(\d+) {unit}\b", said))
        ]
        words = f"{said.strip()}; a run here may have {' and '.join(over)}"
        return [{"place": "", "text": words}] if over else []

    def concerned(self, line: str) -> str:
        """The variable that a message of the program is about, as --set names it, or its group."""
        if found := re.match(r"--set ([\w.-]+)=", line):
            return found[1]
        found = re.match(r"\S+?\.nml(?::(\d+))?: (\w+)(\.\w+)?", line)
        if not found:
            return ""
        number, kind, name = int(found[1] or 0), found[2], found[3] or ""
        text = self.input.read_bytes()
        own = [group for group in groups_of(self.input) if group["group"] == kind]
        for group in own:
            first, last = (text.count(b"\n", 0, group[end]) + 1 for end in ("from", "to"))
            if len(own) == 1 or first <= number <= last:
                return group["place"] + name
        return kind + name


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


# --- pages ---


@dataclass
class Page:
    """A page of a browser and its runs, the newest last."""

    folder: Path
    asked: float = field(default_factory=time.monotonic)
    runs: dict[int, LabRun] = field(default_factory=dict)
    lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def newest(self) -> LabRun | None:
        """The only run that may be going on."""
        return self.runs[max(self.runs)] if self.runs else None

    @property
    def silent(self) -> bool:
        """Whether it has not been heard of for long."""
        return time.monotonic() > self.asked + SILENCE

    def close(self) -> None:
        """End the run and remove all files."""
        for run in self.runs.values():
            run.end()
        shutil.rmtree(self.folder, ignore_errors=True)


class Lab:
    """The inputs, the program's table of variables, and the pages that are open."""

    def __init__(self, inputs: list[Path], folder: Path, filmed: Callable[[Run], dict]) -> None:
        """Take the input files, a folder for everything, and what makes a film of a run."""
        self.inputs = {path.stem: path for path in inputs}
        self.folder, self.filmed = folder, filmed
        self.table = printed("--print-variables")
        self.pages: dict[str, Page] = {}
        self.samples: dict[str, Run | None] = {}
        self.lock = threading.Lock()
        self.sample_locks = {name: threading.Lock() for name in self.inputs}

    def new_page(self) -> str:
        """The number of a new page; RunError if there are too many."""
        with self.lock:
            silent = [number for number, page in self.pages.items() if page.silent]
            if len(self.pages) >= PAGES:
                if not silent:
                    raise RunError(f"{PAGES} pages are open, which is all that may be: close one")
                self.pages.pop(silent[0]).close()
            number = secrets.token_hex(8)
            (self.folder / number).mkdir()
            self.pages[number] = Page(self.folder / number)
            return number

    def page(self, number: object) -> Page:
        """The page of this number, which has just been heard of."""
        page = self.pages.get(number) if isinstance(number, str) else None
        if page is None:
            raise RunError("the laboratory does not know this page any more: load it again")
        page.asked = time.monotonic()
        return page

    @contextmanager
    def held(self, number: object) -> Iterator[Page]:
        """The page of this number, for one request at a time; it may have gone meanwhile."""
        with self.page(number).lock:
            yield self.page(number)

    def leave(self, wish: Mapping) -> dict:
        """A page says goodbye."""
        page = self.page(wish.get("page"))
        with self.lock:
            self.pages.pop(wish["page"], None)
        with page.lock:
            page.close()
        return {}

    def close(self) -> None:
        """Leave no run behind."""
        with self.lock:
            for page in self.pages.values():
                page.close()

    def watch(self) -> None:
        """Stop the runs that are over a limit, or whose page has gone."""
        for page in list(self.pages.values()):
            run = page.newest
            if run is not None and run.running and not run.reason:
                with suppress(FileNotFoundError):  # the program renames its files
                    if reason := "the page has gone" if page.silent else run.over_limit():
                        run.stop(reason)

    def run_of(self, wish: Mapping, folder: Path) -> LabRun:
        """The run that a page asks for; its input file is written.

        Raises LookupError, TypeError or ValueError if it is no wish for a run.
        """
        name, settings, added = (wish[word] for word in ("input", "settings", "added"))
        text = self.inputs[name].read_text(errors="replace")
        for kind, label in added:
            text = text.rstrip() + "\n\n" + namelist({kind: {"name": label}})
        folder.mkdir(exist_ok=True)
        run = LabRun(folder, name, settings, bool(added))
        run.input.write_text(text)
        return run

    def check(self, wish: Mapping) -> dict:
        """Whether the program takes these values."""
        with self.held(wish.get("page")) as page:
            run = self.run_of(wish, page.folder / "check")
            return {"problems": run.problems(), "command": self.command(run)}

    def start(self, wish: Mapping) -> dict:
        """Start a run, or go on with the newest one; what is wrong, or the number of the run."""
        resume = wish.get("resume") is True
        with self.held(wish.get("page")) as page:
            run = self.run_of(wish, page.folder / "check")
            if problems := run.problems():
                return {"problems": problems}
            if page.newest:
                page.newest.end()
            number = max(page.runs, default=0)
            if not (resume and page.runs and page.newest.name == run.name):
                number, resume = number + 1, False
            run = self.run_of(wish, page.folder / str(number))
            for old in set(page.runs) - {number, wish.get("keep")}:
                shutil.rmtree(page.runs.pop(old).folder, ignore_errors=True)
            run.begin(resume)
            page.runs[number] = run  # others see it once it has begun
            return {"problems": [], "run": number, "command": self.command(run)}

    def stop(self, wish: Mapping) -> dict:
        """Stop the run of a page; it can go on."""
        if run := self.page(wish.get("page")).newest:
            run.stop("stopped")
        return {}

    def state(self, number: str) -> dict:
        """Whether the newest run of a page goes on, and why not."""
        run = self.page(number).newest
        if run is None or run.running:
            return {"running": run is not None, "stopped": False, "reason": ""}
        code = run.process.returncode
        words = run.reason or run.said() or f"the program was ended by signal {-code}"
        return {"running": False, "stopped": code == STOPPED, "reason": words if code else ""}

    def command(self, run: LabRun) -> str:
        """What to type for the same run."""
        program, path = Path(find_program()), self.inputs[run.name]
        if run.added:  # it takes the file that can be downloaded
            return f"{shown(program)} {run.name}.nml -o {run.name}.h5"
        words = [shown(path), *options(run.settings), "-o", f"runs/{run.name}.h5"]
        return " ".join(map(shlex.quote, [shown(program), *words]))

    def run(self, number: str, run: str) -> LabRun:
        """A run of a page."""
        runs = {str(k): own for k, own in self.page(number).runs.items()}
        if run not in runs:
            raise RunError("no such run")
        return runs[run]

    def film(self, number: str, run: str, known: str) -> bytes:
        """What a page does not know yet of the film of its run.

        Of a run that has gone that is nothing: the page is about to show the next.
        """
        if not any(str(k) == run for k in self.page(number).runs):
            return b""
        own = self.run(number, run)
        if own.live is None:
            own.live = Live(own.opened(), self.filmed)
        return own.live.answer(known)[0]

    def form(self, name: str) -> dict:
        """What an input file gives, group by group, and how often frames are to be written."""
        if name not in self.inputs:
            raise RunError("no such input")
        head = self.inputs[name].read_text(errors="replace").split("\n&")[0]
        groups = [
            {
                "kind": group["group"],
                "place": group["place"],
                "given": {word: setting(value) for word, value in group["values"].items()},
            }
            for group in groups_of(self.inputs[name])
        ]
        about = "\n".join(re.findall(r"^! ?(.*)", head, re.M))
        return {"about": about, "groups": groups, "settings": self.cadences(name, groups)}

    def cadences(self, name: str, groups: list[dict]) -> dict[str, str]:
        """The event log, and a cadence in time for samples that the input takes first and last."""
        sample = self.sample(name)
        if sample is None or sample.time[-1] <= 0:
            return {}
        given = {word for group in groups if group["kind"] == "output" for word in group["given"]}
        kinds = {word.split("_")[0] for word in given}
        step = f"{sample.time[-1] / FRAMES:.1g}"
        wanted = {"event_log": ".true."} | {
            word: step for word in self.table["output"] if word.endswith("_every_time")
        }
        return {
            f"output.{word}": value
            for word, value in wanted.items()
            if word.split("_")[0] not in kinds
        }

    def sample(self, name: str) -> Run | None:
        """The input file as it is, run once for a few seconds at most; None if it cannot run."""
        with self.sample_locks[name]:
            if name not in self.samples:
                wish = {"input": name, "settings": {}, "added": []}
                run = self.run_of(wish, self.folder / name)
                run.begin(resume=False)
                with suppress(subprocess.TimeoutExpired):
                    run.process.wait(CHECK / 4)
                run.end()
                self.samples[name] = None
                with suppress(RunError):
                    self.samples[name] = run.opened()
            return self.samples[name]


def shown(path: Path) -> str:
    """A path from here, if it lies here; a program by its name, if that is enough."""
    if shutil.which(path.name) == str(path):
        return path.name
    with suppress(ValueError):
        return str(path.resolve().relative_to(Path.cwd()))
    return str(path)
