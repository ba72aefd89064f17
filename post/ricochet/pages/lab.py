"""Web server of the laboratory, which starts a worker process for each simulation of a page.

Each run and each scan has its own WebSocket and worker process (`ricochet.worker`), which ends when
the socket is closed. Since Python takes time to start, a spare worker is always kept ready. If the
server is killed, the operating system ends all workers.
"""

import asyncio
import json
import os
import re
import struct
import subprocess
from asyncio.subprocess import Process
from contextlib import suppress
from pathlib import Path

from aiohttp import web

from ..reading.files import RunError
from ..running.program import find_program, value_text

RUNS = 24  # largest number of simultaneous runs on all pages
GRACE = 3.0  # time after which a worker that does not end on request is killed [s]
ENDED = b"No answer: the laboratory has ended."  # reason for closing a socket, at most 123 bytes
DIED = b"It has ended: it needs more memory than it may have here (fewer disks do), or was killed."
NAME = re.compile(r"[\w.-]{1,200}")  # name of a variable or group


# --- contents of input files ---


def printed(*words: str | Path) -> object:
    """Return the JSON output of the simulation program; its error messages are ignored."""
    done = subprocess.run([find_program(), *words], capture_output=True, text=True, check=False)
    return json.loads(done.stdout or "[]")


def form(path: Path) -> dict:
    """Return the description of an input file and the values of its groups."""
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
    """Return a value in the format of the option `--set` of the simulation program."""
    if isinstance(value, list):
        return ",".join(map(setting, value))
    return value if isinstance(value, str) else value_text("", value).removesuffix(".0")


# --- processes ---


class Lab:
    """Server of the laboratory, with the input files, the table of variables, and the workers."""

    def __init__(self, inputs: list[Path], folders: list[Path], command: list[str]) -> None:
        """Store the input files, the folders to which they may refer, and the worker command."""
        self.inputs = {path.stem: path for path in inputs}
        self.folders = [folder.resolve() for folder in folders]
        self.command = command
        self.table = printed("--print-variables")
        self.workers: set[Process] = set()
        self.spare: asyncio.Task | None = None
        self.runs = 0
        self.closed = False

    # --- processes ---

    async def start_worker(self) -> Process:
        """Start a worker process."""
        pipe = subprocess.PIPE
        worker = await asyncio.create_subprocess_exec(
            *self.command, stdin=pipe, stdout=pipe, limit=1 << 24
        )
        self.workers.add(worker)
        if self.closed:
            terminate(worker)
        return worker

    def prepare(self) -> None:
        """Start the spare worker process, unless it exists."""
        if not (self.spare or self.closed):
            self.spare = asyncio.create_task(self.start_worker())

    async def worker(self) -> Process:
        """Return the spare worker process, and start another one."""
        self.prepare()
        task, self.spare = self.spare, None
        if task is None:
            raise RunError("the laboratory is ending")
        worker = await task
        self.prepare()
        if is_alive(worker):
            return worker
        self.workers.discard(worker)  # killed by another process
        return await self.worker()

    async def end(self, worker: Process) -> None:
        """End a worker process, by force after `GRACE` seconds."""
        terminate(worker)
        try:
            async with asyncio.timeout(GRACE):
                await worker.wait()
        except TimeoutError:
            worker.kill()
            await worker.wait()
        self.workers.discard(worker)

    async def close(self) -> None:
        """End all worker processes."""
        self.closed = True
        if self.spare:
            with suppress(OSError, asyncio.CancelledError):
                await self.spare
        await asyncio.gather(*map(self.end, [*self.workers]))

    # --- runs ---

    async def socket(self, request: web.Request) -> web.StreamResponse:
        """Handle the WebSocket of a run, which ends when the WebSocket is closed."""
        if self.runs >= RUNS:
            raise RunError(f"{RUNS} runs are open, which is the largest number: close a page")
        self.runs += 1
        worker, socket = None, web.WebSocketResponse(heartbeat=30.0, max_msg_size=1_000_000)
        try:
            worker = await self.worker()
            await socket.prepare(request)
            await self.pass_requests(worker, socket)
        finally:
            if worker:
                await self.end(worker)
            self.runs -= 1
        return socket

    async def pass_requests(self, worker: Process, socket: web.WebSocketResponse) -> None:
        """Pass requests of a page on to its worker process until the WebSocket is closed."""
        answers = asyncio.create_task(self.pass_answers(worker, socket))
        try:
            async for message in socket:
                try:
                    query = self.allowed(json.loads(message.data))
                except (RunError, OSError) as problem:
                    await send(socket, refusal(problem))
                except (AttributeError, LookupError, RecursionError, TypeError, ValueError):
                    await send(socket, {"is": "state", "reason": "not understood"})
                else:
                    with suppress(ConnectionError, RuntimeError):  # the worker may have ended
                        worker.stdin.write(json.dumps(query).encode() + b"\n")
                        await worker.stdin.drain()
        finally:
            answers.cancel()

    async def pass_answers(self, worker: Process, socket: web.WebSocketResponse) -> None:
        """Pass answers of a worker process on to its page, and finally close the WebSocket."""
        with suppress(asyncio.IncompleteReadError, ConnectionError):
            while True:
                kind, length = struct.unpack(">cI", await worker.stdout.readexactly(5))
                body = await worker.stdout.readexactly(length)
                await (socket.send_bytes(body) if kind == b"b" else socket.send_str(body.decode()))
        await socket.close(message=ENDED if self.closed else DIED)

    def allowed(self, query: dict) -> dict:
        """Check a request of a page, and return it with the text of the input.

        A malformed request raises LookupError, TypeError or ValueError.
        """
        if query["do"] not in ("start", "scan"):
            return query
        name, settings, added = (query[word] for word in ("input", "settings", "added"))
        text = self.inputs[name].read_text(encoding="utf-8", errors="surrogateescape")
        for kind, label in added:
            if kind not in self.table or not NAME.fullmatch(label):
                raise RunError(f"no group can be called {kind} {label}")
            text = f"{text.rstrip()}\n\n&{kind}\n  name = {value_text('name', label)}\n/\n"
        scanned = [(query["variable"], one) for one in query.get("values", ())]
        for key, value in [*settings.items(), *scanned]:
            if not NAME.fullmatch(key) or not value.isprintable():
                raise RunError(f"{key!r:.80} and {value!r:.80}: no variable and its value")
            if key.lower().endswith("file"):
                self.allow(value)
        return query | {"text": text}

    def allow(self, file: str) -> None:
        """Raise RunError if the input names a file outside the allowed folders."""
        path = Path(re.fullmatch(r"""(['"]?)([^'"]*)\1""", file.strip())[2]).resolve()
        if not any(path.is_relative_to(folder) for folder in self.folders):
            raise RunError(
                f"{file}: is outside the allowed folders; start the laboratory with --files FOLDER"
            )


async def send(socket: web.WebSocketResponse, message: dict) -> None:
    """Send a message to a page, if its WebSocket is still open."""
    with suppress(ConnectionError):
        await socket.send_json(message)


def terminate(worker: Process) -> None:
    """Ask a worker process to remove its temporary files and end."""
    with suppress(ProcessLookupError):
        worker.terminate()


def is_alive(worker: Process) -> bool:
    """Return whether a worker is running; `asyncio` sets its return code only with a delay."""
    with suppress(ProcessLookupError):
        os.kill(worker.pid, 0)
        return worker.returncode is None
    return False


def refusal(problem: object) -> dict:
    """Return the message that tells a page why its request was refused."""
    lines = [{"place": "", "text": str(problem)}]
    return {"is": "problems", "change": False, "problems": lines}


__all__ = ["Lab", "form", "printed"]
