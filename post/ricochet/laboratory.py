"""Pages of a browser, each with a run at a time, and the inputs that they can change.

A page has a number that nobody guesses, and a folder.  Its run is stopped, with a checkpoint, by a
limit or when the page has not been heard of for a while; its files go when it says goodbye.
"""

import re
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

from .experiment import CHECK, Experiment, Refused, check
from .files import RunError
from .live import Live
from .namelists import place_of, scan, with_groups
from .program import STOPPED, find_program
from .reader import Run
from .variables import table

PAGES = 8  # at a time
SILENCE = 90.0  # seconds, after which a page is gone; browsers let hidden pages speak once a minute
MOST_SETTINGS, MOST_GROUPS, LONGEST = 1000, 100, 10000  # of a request; characters of a value
FRAMES = 200  # of a run whose input does not say how many


@dataclass
class Page:
    """A page of a browser and its runs, the newest last."""

    folder: Path
    asked: float = field(default_factory=time.monotonic)
    runs: dict[int, Experiment] = field(default_factory=dict)
    lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def newest(self) -> Experiment | None:
        """The only run that may be going on."""
        return self.runs[max(self.runs)] if self.runs else None

    def close(self) -> None:
        """End the run and remove all files."""
        for run in self.runs.values():
            run.end()
        shutil.rmtree(self.folder, ignore_errors=True)


class Laboratory:
    """The inputs, the program's table of variables, and the pages that are open."""

    def __init__(self, inputs: list[Path], folder: Path, filmed: Callable[[Run], dict]) -> None:
        """Take the input files, a folder for everything, and what makes a film of a run."""
        self.inputs = {path.stem: path for path in inputs}
        self.folder, self.filmed = folder, filmed
        self.table = table(find_program())
        self.pages: dict[str, Page] = {}
        self.samples: dict[str, Run | None] = {}
        self.lock = threading.Lock()
        self.sample_locks = {name: threading.Lock() for name in self.inputs}

    # --- pages ---

    def new_page(self) -> str:
        """The number of a new page; Refused if there are too many."""
        with self.lock:
            silent = [number for number, page in self.pages.items() if is_silent(page)]
            if len(self.pages) >= PAGES and not silent:
                raise Refused(f"{PAGES} pages are open, which is all that may be: close one")
            if len(self.pages) >= PAGES:
                self.pages.pop(silent[0]).close()
            number = secrets.token_hex(8)
            (self.folder / number).mkdir()
            self.pages[number] = Page(self.folder / number)
            return number

    def page(self, number: object) -> Page:
        """The page of this number, which has just been heard of."""
        page = self.pages.get(number) if isinstance(number, str) else None
        if page is None:
            raise Refused("the laboratory does not know this page any more: load it again")
        page.asked = time.monotonic()
        return page

    @contextmanager
    def held(self, number: object) -> Iterator[Page]:
        """The page of this number, for one request at a time; it may have gone meanwhile."""
        with self.page(number).lock:
            yield self.page(number)

    def leave(self, number: object) -> None:
        """A page says goodbye."""
        page = self.page(number)
        with self.lock:
            self.pages.pop(number, None)
        with page.lock:
            page.close()

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
                    if reason := "the page has gone" if is_silent(page) else run.over_limit():
                        run.stop(reason)

    # --- runs ---

    def experiment(self, wish: Mapping, folder: Path) -> Experiment:
        """The run that a page asks for; its input file is written.  Refused if it is no wish."""
        name, settings, added = (wish.get(word) for word in ("input", "settings", "added"))
        if not (isinstance(name, str) and isinstance(settings, dict) and isinstance(added, list)):
            raise Refused("not a wish for a run")
        if name not in self.inputs:
            raise Refused("no such input")
        names = [group for group, variables in self.table.items() if "name" in variables]
        for pair in added:
            if not (isinstance(pair, list) and len(pair) == 2 and pair[0] in names):
                raise Refused("not a group that can be added")
        words = [*settings, *settings.values(), *(label for _, label in added)]
        if len(settings) > MOST_SETTINGS or len(added) > MOST_GROUPS:
            raise Refused("more settings or groups than a page can have")
        if not all(isinstance(word, str) and is_line(word) for word in words):
            raise Refused("a value is not one line of text")
        text = with_groups(self.inputs[name].read_text(errors="replace"), added)
        folder.mkdir(exist_ok=True)
        run = Experiment(folder, name, text, settings, bool(added))
        run.input.write_text(text)
        return run

    def check(self, wish: Mapping) -> dict:
        """Whether the program takes these values."""
        with self.held(wish.get("page")) as page:
            run = self.experiment(wish, page.folder / "check")
            return {"problems": check(run, self.table), "command": self.command(run)}

    def start(self, wish: Mapping) -> dict:
        """Start a run, or go on with the newest one; what is wrong, or the number of the run."""
        resume = wish.get("resume") is True
        with self.held(wish.get("page")) as page:
            run = self.experiment(wish, page.folder / "check")
            if problems := check(run, self.table):
                return {"problems": problems}
            if page.newest:
                page.newest.end()
            number = max(page.runs, default=0)
            if not (resume and page.runs and page.newest.name == run.name):
                number, resume = number + 1, False
            run = self.experiment(wish, page.folder / str(number))
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

    def command(self, run: Experiment) -> str:
        """What to type for the same run."""
        program, path = Path(find_program()), self.inputs[run.name]
        if run.added:  # it takes the file that can be downloaded
            return f"{shown(program)} {run.name}.nml -o {run.name}.h5"
        words = [shown(path), *run.command()[1:-2], "-o", f"runs/{run.name}.h5"]
        return " ".join(map(shlex.quote, [shown(program), *words]))

    def run(self, number: str, run: str) -> Experiment:
        """A run of a page."""
        runs = {str(k): own for k, own in self.page(number).runs.items()}
        if run not in runs:
            raise Refused("no such run")
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

    # --- inputs ---

    def form(self, name: str) -> dict:
        """What an input file gives, group by group, and how often frames are to be written."""
        if name not in self.inputs:
            raise Refused("no such input")
        text = self.inputs[name].read_text(errors="replace")
        groups = [
            {
                "kind": group.kind,
                "place": place_of(group, self.table),
                "given": group.given(self.table.get(group.kind, {})),
            }
            for group in scan(text)
        ]
        about = "\n".join(re.findall(r"^! ?(.*)", text.split("\n&")[0], re.M))
        return {"about": about, "groups": groups, "settings": self.cadences(name, groups)}

    def cadences(self, name: str, groups: list[dict]) -> dict[str, str]:
        """A cadence in time for each kind of sample that the input leaves at first and last."""
        sample = self.sample(name)
        if sample is None or sample.time[-1] <= 0:
            return {}
        given = {word for group in groups if group["kind"] == "output" for word in group["given"]}
        kinds = {word.split("_every_")[0] for word in given}
        step = f"{sample.time[-1] / FRAMES:.1g}"
        return {
            f"output.{word}": step
            for word in self.table["output"]
            if word.endswith("_every_time") and word.split("_every_")[0] not in kinds
        }

    def sample(self, name: str) -> Run | None:
        """The input file as it is, run once for a few seconds at most; None if it cannot run."""
        with self.sample_locks[name]:
            if name not in self.samples:
                folder = self.folder / name
                run = self.experiment({"input": name, "settings": {}, "added": []}, folder)
                run.begin(resume=False)
                with suppress(subprocess.TimeoutExpired):
                    run.process.wait(CHECK / 4)
                run.end()
                self.samples[name] = None
                with suppress(RunError, Refused):
                    self.samples[name] = run.opened()
            return self.samples[name]


def is_silent(page: Page) -> bool:
    """Whether a page has not been heard of for long."""
    return time.monotonic() > page.asked + SILENCE


def is_line(word: str) -> bool:
    """Whether a text can be a value: one line, without control characters, and not too long."""
    return word.isprintable() and len(word) <= LONGEST


def shown(path: Path) -> str:
    """A path from here, if it lies here; a program by its name, if that is enough."""
    if shutil.which(path.name) == str(path):
        return path.name
    with suppress(ValueError):
        return str(path.resolve().relative_to(Path.cwd()))
    return str(path)
