"""The laboratory: pages of a browser, and the processes that simulate for them.

A page has a number that nobody guesses, and for each of its runs a socket with a worker behind it
(`ricochet.worker`), which ends with the socket.  One worker more is always ready, so that nobody
waits until Python has started.  There is one list of all of them; the kernel ends those of a
laboratory that is killed.
"""

import asyncio
import json
import re
import secrets
import shlex
import shutil
import struct
import subprocess
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from aiohttp import WSMsgType, web

from .files import RunError
from .program import find_program, value_text

PAGES = 8  # at a time
RUNS = 4  # of a page
START = 20.0  # seconds that placing the disks may take
SCAN = 60.0  # seconds that a scan may take
DOWNLOAD = 20.0  # seconds
GRACE = 3.0  # seconds, after which a worker that has been asked to end is forced to
FILES = 3  # of a run that are on their way
NAME = re.compile(r"[\w.-]{1,200}")  # of a variable or a group
GONE = "this run is not there any more"
DOES = {"start", "change", "heat", "play", "pause", "pace", "step", "event", "got", "scan"}


# --- inputs, as the program understands them ---


def printed(*words: str | Path) -> object:
    """The JSON that the program prints; mistakes of an input do not matter here."""
    said = subprocess.run([find_program(), *words], capture_output=True, text=True, check=False)
    return json.loads(said.stdout or "[]")


def form(path: Path) -> dict:
    """What an input file says about itself, and gives, group by group."""
    head = path.read_text(errors="replace").split("\n&")[0]
    groups = [
        {
            "kind": group["group"],
            "place": ".".join(filter(None, (group["group"], group["name"]))),
            "given": {word: setting(value) for word, value in group["values"].items()},
        }
        for group in printed("--print-input", path)
    ]
    return {"about": "\n".join(re.findall(r"^! ?(.*)", head, re.M)), "groups": groups}


def setting(value: object) -> str:
    """A value as --set has it."""
    if isinstance(value, list):
        return ",".join(map(setting, value))
    return value if isinstance(value, str) else value_text("", value)


def shown(path: Path) -> str:
    """A path from here, if it lies here; a program by its name, if that is enough."""
    if shutil.which(path.name) == str(path):
        return path.name
    with suppress(ValueError):
        return str(path.resolve().relative_to(Path.cwd()))
    return str(path)


# --- processes ---


class Worker:
    """A process with one simulation, from this side."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        """Take one that has been started."""
        self.process = process
        self.runs: dict[str, str] = {}  # number of each run that was wished, and its input
        self.files: deque[asyncio.Future] = deque()  # that it has been asked for
        self.scan: asyncio.Task | None = None
        self.deadline: asyncio.TimerHandle | None = None

    async def send(self, wish: Mapping) -> None:
        """Tell it what to do, as soon as it listens; nothing happens if it has ended."""
        with suppress(ConnectionError, RuntimeError):
            self.process.stdin.write(json.dumps(wish).encode() + b"\n")
            await self.process.stdin.drain()

    async def heard(self) -> tuple[bytes, bytes]:
        """Its next answer: a letter, and what it says.  Raises IncompleteReadError at its end."""
        kind, length = struct.unpack(">cI", await self.process.stdout.readexactly(5))
        return kind, await self.process.stdout.readexactly(length)

    def end_in(self, seconds: float) -> None:
        """End it if it has not answered by then."""
        self.relax()
        self.deadline = asyncio.get_running_loop().call_later(seconds, self.kill)

    def relax(self) -> None:
        """It has answered."""
        if self.deadline:
            self.deadline.cancel()
            self.deadline = None

    def kill(self) -> None:
        """End it, whatever it does; unless it is busy with a file, which it removes first."""
        with suppress(ProcessLookupError):
            self.process.terminate()


class Lab:
    """The inputs, the program's table of variables, pages, and all processes."""

    def __init__(self, inputs: list[Path], folders: list[Path], command: list[str]) -> None:
        """Take input files, folders whose files inputs may name, and how a worker is started."""
        self.inputs = {path.stem: path for path in inputs}
        self.folders = [folder.resolve() for folder in folders]
        self.command = command
        self.table = printed("--print-variables")
        self.pages: dict[str, dict[object, Worker | None]] = {}  # the workers of each
        self.waiting: list[str] = []  # numbers of pages that have not opened a socket yet
        self.workers: set[Worker] = set()
        self.spare: asyncio.Task | None = None
        self.runs = 0
        self.closed = False

    # --- processes ---

    async def begun(self) -> Worker:
        """A new worker."""
        pipe = subprocess.PIPE
        process = await asyncio.create_subprocess_exec(
            *self.command, stdin=pipe, stdout=pipe, limit=1 << 24
        )
        worker = Worker(process)
        self.workers.add(worker)
        if self.closed:
            worker.kill()
        return worker

    def prepare(self) -> None:
        """Have a worker ready."""
        if not (self.spare or self.closed):
            self.spare = asyncio.create_task(self.begun())

    async def worker(self) -> Worker:
        """One that is ready, or will be soon; the next is prepared."""
        self.prepare()
        task, self.spare = self.spare, None
        if task is None:
            raise RunError("the laboratory ends")
        worker = await task
        self.prepare()
        return worker

    async def end(self, worker: Worker) -> None:
        """It is not needed any more."""
        worker.relax()
        worker.kill()
        try:
            async with asyncio.timeout(GRACE):
                await worker.process.wait()
        except TimeoutError:
            worker.process.kill()
            await worker.process.wait()
        self.workers.discard(worker)

    async def close(self) -> None:
        """End everything."""
        self.closed = True
        if self.spare:
            with suppress(OSError, asyncio.CancelledError):
                await self.spare
        await asyncio.gather(*map(self.end, [*self.workers]))

    # --- pages ---

    def new_page(self) -> str:
        """The number of one more page.  Raises RunError if there are too many."""
        if len(self.pages) >= PAGES:
            raise RunError(f"{PAGES} pages are open, which is all that can be: close one")
        self.waiting = [*self.waiting[1 - 16 * PAGES :], secrets.token_hex(16)]
        return self.waiting[-1]

    async def socket(self, request: web.Request) -> web.StreamResponse:
        """A run of a page, as long as its socket is open."""
        number = request.query.get("page", "")
        if number not in self.waiting and number not in self.pages:
            raise RunError("no such page: load it again")
        runs = self.pages.get(number, {})
        if len(runs) >= RUNS or (number not in self.pages and len(self.pages) >= PAGES):
            raise RunError(f"{RUNS} runs of a page and {PAGES} pages can be open: close one")
        self.pages[number] = runs
        place = object()
        runs[place] = None  # taken from now on
        socket = web.WebSocketResponse(heartbeat=30.0, max_msg_size=1_000_000)
        try:
            runs[place] = worker = await self.worker()
            await socket.prepare(request)
            await self.converse(worker, socket)
        finally:
            worker = runs.pop(place)
            if not runs:
                self.pages.pop(number, None)
                self.waiting = [*self.waiting[1 - 16 * PAGES :], number]  # it may come back
            if worker:
                await self.end(worker)
        return socket

    async def converse(self, worker: Worker, socket: web.WebSocketResponse) -> None:
        """Until the page leaves, or the worker has ended."""
        listening = asyncio.create_task(self.listen(worker, socket))
        try:
            async for message in socket:
                if message.type != WSMsgType.TEXT:
                    continue
                try:
                    await self.hear(worker, socket, json.loads(message.data))
                except (RunError, OSError) as problem:
                    with suppress(ConnectionError):
                        await socket.send_json(wrong(problem))
                except (AttributeError, LookupError, RecursionError, TypeError, ValueError):
                    with suppress(ConnectionError):
                        await socket.send_json({"is": "state", "reason": "not understood"})
        finally:
            listening.cancel()
            if worker.scan:
                worker.scan.cancel()
                await asyncio.wait([worker.scan])

    async def hear(self, worker: Worker, socket: web.WebSocketResponse, wish: dict) -> None:
        """What a page wants of a worker."""
        if wish["do"] not in DOES:
            raise ValueError(wish["do"])
        if wish["do"] in ("start", "scan"):
            wish |= self.found(wish)
        if wish["do"] == "scan":
            if worker.scan and not worker.scan.done():
                raise RunError("one scan at a time")
            worker.scan = asyncio.create_task(self.scan(socket, wish))
            return
        if wish["do"] == "start":
            self.runs += 1
            wish["run"] = self.runs
            worker.runs[str(self.runs)] = wish["input"]
        await worker.send(wish)

    def found(self, wish: dict) -> dict:
        """The text of an input with the groups that are added; the command for the same run.

        Raises LookupError, TypeError or ValueError if it is no wish for a run.
        """
        name, settings, added = (wish[word] for word in ("input", "settings", "added"))
        path = self.inputs[name]
        text = path.read_text(encoding="utf-8", errors="surrogateescape")
        for kind, label in added:
            if kind not in self.table or not NAME.fullmatch(label):
                raise RunError(f"no group can be called {kind} {label}")
            text = f"{text.rstrip()}\n\n&{kind}\n  name = {value_text('name', label)}\n/\n"
        scanned = [(wish["variable"], one) for one in wish.get("values", ())]
        for key, value in [*settings.items(), *scanned]:
            if not NAME.fullmatch(key) or not value.isprintable():
                raise RunError(f"{key!r:.80} and {value!r:.80}: no variable and its value")
            if key.lower().endswith("file"):
                self.allow(value)
        program = shown(Path(find_program()))
        words = [word for item in settings.items() for word in ("--set", "=".join(item))]
        words = [program, shown(path), *words, "-o", f"runs/{name}.h5"]
        if added:  # it takes the file that can be downloaded
            words = [program, f"{name}.nml", "-o", f"{name}.h5"]
        return {"text": text, "command": shlex.join(words)}

    def allow(self, file: str) -> None:
        """Refuse a file of disks that is not where those of inputs are."""
        path = Path(re.fullmatch(r"""(['"]?)([^'"]*)\1""", file.strip())[2]).resolve()
        if not any(path.is_relative_to(folder) for folder in self.folders):
            raise RunError(f"{file}: lies elsewhere; start the laboratory with --files FOLDER")

    async def listen(self, worker: Worker, socket: web.WebSocketResponse) -> None:
        """Pass on what a worker says; the socket closes with it."""
        with suppress(asyncio.IncompleteReadError, ConnectionError):
            while True:
                kind, body = await worker.heard()
                if kind == b"b":
                    await socket.send_bytes(body)
                elif kind in b"fe":
                    file = worker.files.popleft()
                    if file.done():  # nobody waits any more
                        continue
                    if kind == b"f":
                        file.set_result(body)
                    else:
                        file.set_exception(RunError(body.decode()))
                else:
                    if body.startswith(b'{"is": "starting"'):
                        worker.end_in(START)  # not before: on a busy computer Python starts slowly
                    elif body.startswith((b'{"is": "scene"', b'{"is": "problems"')):
                        worker.relax()
                    await socket.send_str(body.decode())
        for file in worker.files:
            if not file.done():
                file.set_exception(RunError("the run has ended"))
        if not socket.closed:
            with suppress(ConnectionError):
                await socket.send_json(wrong(self.cause(worker)))
            await socket.close()

    def cause(self, worker: Worker) -> str:
        """Why a worker has ended."""
        if worker.deadline and worker.deadline.when() <= asyncio.get_running_loop().time():
            return f"placing the disks takes longer than {START:g} s; take fewer"
        return "the run needs more memory than it may have here; take fewer disks"

    async def scan(self, socket: web.WebSocketResponse, wish: dict) -> None:
        """A scan, by a worker of its own."""
        worker = await self.worker()
        try:
            worker.end_in(SCAN)
            await worker.send(wish)
            left = len(wish["values"])
            with suppress(asyncio.IncompleteReadError, ConnectionError):
                while left > 0:
                    _, body = await worker.heard()
                    left = 0 if b'"text"' in body else left - 1
                    await socket.send_str(body.decode())
        finally:
            await self.end(worker)

    async def kept(self, number: str, run: str, part: str) -> tuple[str, bytes]:
        """A part of what a run was: the name of the file, and its bytes."""
        workers = self.pages.get(number, {}).values()
        worker = next((one for one in workers if one and run in one.runs), None)
        if worker is None:
            raise RunError(GONE)
        if len(worker.files) >= FILES:
            raise RunError("one file at a time")
        file = asyncio.get_running_loop().create_future()
        worker.files.append(file)
        try:
            async with asyncio.timeout(DOWNLOAD):
                await worker.send({"do": "keep", "part": part, "run": int(run)})
                return worker.runs[run], await file
        except TimeoutError:
            raise RunError("the run is busy: try again") from None


def wrong(problem: object) -> dict:
    """What a page is told of a wish that cannot be."""
    lines = [{"place": "", "text": str(problem), "limit": None}]
    return {"is": "problems", "change": False, "problems": lines}


def path_of(folder: Path, name: str) -> Path:
    """A file in a folder, by its plain name."""
    if name != Path(name).name or not (folder / name).is_file():
        raise web.HTTPNotFound(text="no such file\n")
    return folder / name


__all__ = ["Lab", "form", "path_of", "printed"]
