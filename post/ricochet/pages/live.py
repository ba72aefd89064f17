"""Web server for browsers on the same computer, and the page of an unfinished run.

Requests from pages of other web sites are refused. Such a page could otherwise read data by means
of a host name that resolves to this computer (DNS rebinding).
"""

import asyncio
import json
import logging
import os
import signal
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path

from aiohttp import web

from ..reading.files import RunError
from ..reading.reader import Run, read_run

ADDRESS = "127.0.0.1"
CHECK_INTERVAL = 0.5  # interval at which the server checks whether the run has ended [s]
DIED = "was killed or has crashed"
PATIENCE = 10.0  # time without requests after which the server of an ended run stops [s]
LONGEST = 1_000_000  # largest request [bytes]
SILENCE = 5.0  # longest time between a connection and its first request [s]
HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
}
SERVER = web.AppKey("server", dict)


# --- web server ---


@web.middleware
async def guarded(request: web.Request, handler: Callable) -> web.StreamResponse:
    """Refuse all requests except those of the user or of a page of this server."""
    port = request.app[SERVER]["port"]
    hosts = {f"{name}:{port}" for name in (ADDRESS, "localhost")}
    if port == 80:
        hosts |= {ADDRESS, "localhost"}
    host = request.headers.getall("Host", [])
    origin = request.headers.getall("Origin", [])
    own = len(host) == 1 and host[0] in hosts
    own &= not origin or origin == [f"http://{host[0]}"]
    own &= request.headers.get("Sec-Fetch-Site", "none") in ("none", "same-origin")
    if "Upgrade" in request.headers:  # browsers always send the origin when they open a socket
        own &= bool(origin)
    request.app[SERVER]["heard"].add(request.protocol)
    if not own:
        return web.Response(status=403, text="only pages of this server are allowed\n")
    try:
        return await handler(request)
    except (RunError, OSError) as problem:
        return web.Response(status=409, text=f"{problem}\n")


def application(paths: Mapping[str, Callable], frames: str = "'none'") -> web.Application:
    """Return a web application for the paths; `frames` lists origins that may embed its pages."""
    app = web.Application(middlewares=[guarded], client_max_size=LONGEST)
    app[SERVER] = {"heard": set()}  # connections that have sent a request
    app.add_routes([web.get(path, handler) for path, handler in paths.items()])

    async def add_headers(_: web.Request, response: web.StreamResponse) -> None:
        response.headers.update(HEADERS)
        response.headers["Content-Security-Policy"] = f"frame-ancestors {frames}"

    app.on_response_prepare.append(add_headers)
    return app


async def close_silent(app: web.Application, server: web.Server) -> None:
    """Close connections without requests, many of which would exhaust the server."""
    active, clock = app[SERVER]["heard"], asyncio.get_running_loop().time
    since: dict = {}
    while True:
        await asyncio.sleep(CHECK_INTERVAL)
        now = clock()
        active.intersection_update(server.connections)
        since = {one: since.get(one, now) for one in server.connections if one not in active}
        for one, first in since.items():
            if now > first + SILENCE:
                one.force_close()


async def listen(runner: web.AppRunner, ports: Sequence[int]) -> None:
    """Listen on the first free port of a list; raise RunError if there is none."""
    for port in ports:
        try:
            await web.TCPSite(runner, ADDRESS, port, backlog=512).start()
            return
        except OSError as problem:
            reason = os.strerror(problem.errno)
    raise RunError(f"port {port}: {reason}; choose another with --port, or 0 for any free port")


@asynccontextmanager
async def serving(app: web.Application, *ports: int):
    """Run the server; yield its address, and an event that is set by Ctrl-C, TERM and HUP.

    The first free port of `ports` is used, where 0 stands for any. RunError is raised if none is
    free.
    """
    for name in ("aiohttp", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # requests are not logged
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        loop.add_signal_handler(number, stop.set)
    runner = web.AppRunner(app, access_log=None, shutdown_timeout=1.0)
    await runner.setup()
    try:
        await listen(runner, ports)
        app[SERVER]["port"] = runner.addresses[0][1]
        watch = asyncio.create_task(close_silent(app, runner.server))
        address = f"http://{ADDRESS}:{app[SERVER]['port']}/"
        print(f"{address}  (Ctrl-C ends)", flush=True)
        yield address, stop
        watch.cancel()
    finally:
        await runner.cleanup()


def page_of(text: str) -> Callable:
    """Return a function that answers every request with the given page."""

    async def answer(_: web.Request) -> web.Response:
        return web.Response(text=text, content_type="text/html")

    return answer


# --- page of an unfinished run ---


class Live:
    """Film of a run that may be in progress; showing the film does not disturb the run.

    For each request the output file is opened without a lock, and only complete data are read.
    """

    def __init__(self, run: Run, make_film: Callable[[Run], dict]) -> None:
        """Store the run and the function that converts it to a film."""
        self.final = run.path.with_suffix("") if run.path.suffix == ".part" else run.path
        self.part, self.make_film = Path(f"{self.final}.part"), make_film
        self.lock_file = Path(f"{self.final}.lock")  # held by the program while it writes
        self.lock = threading.Lock()
        self.stamp, self.body = "", b""
        self.last_request = -PATIENCE  # time of the last request
        self.delivered = False  # whether a page has received the end

    @property
    def end(self) -> str:
        """Reason why the run has ended; empty while it continues."""
        if not self.part.exists():
            return "has ended" if self.final.exists() else ""
        if abandoned(self.lock_file):
            return DIED
        return "" if self.lock_file.exists() else "has stopped"

    def answer(self, known: str) -> tuple[bytes, bool]:
        """Return the film (empty if the page has the latest one), and whether the run has ended."""
        with self.lock:
            end = self.end
            # A request may fail while the simulation program renames the file; the next request
            # will succeed.
            with suppress(RunError, FileNotFoundError):
                run = read_run(self.part if self.part.exists() else self.final)
                stamp = f"{run.n_frames} {end}"
                if stamp != self.stamp:
                    body = {"stamp": stamp, "end": end, "warning": run.termination_note}
                    self.body = json.dumps(body | self.make_film(run), allow_nan=False).encode()
                    self.stamp = stamp
            ends = bool(end) and self.stamp.endswith(end)
            return b"" if known == self.stamp else self.body, ends

    async def film(self, request: web.Request) -> web.StreamResponse:
        """Answer a request of a page for the latest film."""
        self.last_request = asyncio.get_running_loop().time()
        body, ends = await asyncio.to_thread(self.answer, request.query.get("known", ""))
        response = web.Response(body=body, content_type="application/json")
        await response.prepare(request)
        await response.write_eof()
        # set only after the answer is sent, because this event stops the server
        self.delivered = self.delivered or ends
        return response


def abandoned(lock: Path) -> bool:
    """Return whether the program was killed, so that no process holds a lock on its lock file.

    On a file system without locks the result is False.
    """
    import fcntl  # not at the top: Windows, where files can be read, has no such module

    try:
        descriptor = os.open(lock, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return os.path.samestat(os.fstat(descriptor), lock.stat())  # not just removed
    except OSError:
        return False
    finally:
        os.close(descriptor)


def serve(
    run: Run,
    page: str,
    make_film: Callable[[Run], dict],
    open_page: Callable[[str], object] | None = None,
) -> str:
    """Show a run until it ends or Ctrl-C or TERM arrives; return why the server stopped.

    RunError is raised if the file cannot be shown, or if the simulation program was killed.
    """
    if run.path.suffix != ".part":
        raise RunError(f"{run.path}: has finished; leave out --live")
    live = Live(run, make_film)
    if live.end:
        raise RunError(f"{run.path}: the run {live.end}; leave out --live")
    asyncio.run(serve_until_end(live, page, open_page))
    end, left = live.end, live.part if live.part.exists() else live.final
    if end == DIED:
        raise RunError(f"{left}: the run {end}")
    return f"the run {end}: {left}" if end else "stopped; the run continues"


async def serve_until_end(live: Live, page: str, open_page: Callable[[str], object] | None) -> None:
    """Serve the page until it has shown the end of the run, or until a signal arrives."""
    app = application({"/": page_of(page), "/film": live.film})
    async with serving(app, 0) as (address, stop):
        if open_page:
            threading.Thread(target=open_page, args=[address], daemon=True).start()
        clock = asyncio.get_running_loop().time
        while not stop.is_set():
            informed = live.delivered or clock() > live.last_request + PATIENCE
            if live.end and informed:
                break
            with suppress(TimeoutError):
                await asyncio.wait_for(stop.wait(), CHECK_INTERVAL)
