"""Pages for the browsers of this computer: a server, and the newest film of a run that goes on.

Requests from a page of another address are refused at once, so that pages of other hosts cannot
read along under a name that points here (DNS rebinding).
"""

import asyncio
import json
import logging
import os
import signal
import threading
from collections.abc import Callable, Mapping
from contextlib import asynccontextmanager, suppress
from pathlib import Path

from aiohttp import web

from ..reading.files import RunError
from ..reading.reader import Run, read_run

ADDRESS = "127.0.0.1"
LOOK = 0.5  # seconds between looks whether the run has ended
DIED = "was killed or has crashed"
PATIENCE = 10.0  # seconds since a page last asked, after which none is left to be told the end
LONGEST = 1_000_000  # bytes of a request
SILENCE = 5.0  # seconds that a connection may wait with its first request
HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
}
SERVER = web.AppKey("server", dict)


# --- a server ---


@web.middleware
async def guarded(request: web.Request, handler: Callable) -> web.StreamResponse:
    """Answer a page of this server, or a person who types the address; nobody else."""
    port = request.app[SERVER]["port"]
    hosts = {f"{name}:{port}" for name in (ADDRESS, "localhost")}
    if port == 80:
        hosts |= {ADDRESS, "localhost"}
    host = request.headers.getall("Host", [])
    origin = request.headers.getall("Origin", [])
    own = len(host) == 1 and host[0] in hosts
    own &= not origin or origin == [f"http://{host[0]}"]
    own &= request.headers.get("Sec-Fetch-Site", "none") in ("none", "same-origin")
    if "Upgrade" in request.headers:  # browsers always say where a socket is opened
        own &= bool(origin)
    request.app[SERVER]["heard"].add(request.protocol)
    if not own:
        return web.Response(status=403, text="only for pages of this server\n")
    try:
        return await handler(request)
    except (RunError, OSError) as problem:
        return web.Response(status=409, text=f"{problem}\n")


def application(paths: Mapping[str, Callable], frames: str = "'none'") -> web.Application:
    """Return a server with a function for each path.

    `frames` names the origins whose pages may contain its own.
    """
    app = web.Application(middlewares=[guarded], client_max_size=LONGEST)
    app[SERVER] = {"heard": set()}  # connections that have asked for something
    app.add_routes([web.get(path, handler) for path, handler in paths.items()])

    async def sign(_: web.Request, response: web.StreamResponse) -> None:
        response.headers.update(HEADERS)
        response.headers["Content-Security-Policy"] = f"frame-ancestors {frames}"

    app.on_response_prepare.append(sign)
    return app


async def drop_silent(app: web.Application, server: web.Server) -> None:
    """Close connections on which nobody asks, so that a crowd of them keeps nobody out."""
    heard, clock = app[SERVER]["heard"], asyncio.get_running_loop().time
    since: dict = {}
    while True:
        await asyncio.sleep(LOOK)
        now = clock()
        heard.intersection_update(server.connections)
        since = {one: since.get(one, now) for one in server.connections if one not in heard}
        for one, first in since.items():
            if now > first + SILENCE:
                one.force_close()


@asynccontextmanager
async def serving(app: web.Application, port: int = 0):
    """Answer requests; gives the address, and an event that Ctrl-C, TERM and HUP set.

    Raises RunError if the port is taken.
    """
    for name in ("aiohttp", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # requests are of no interest
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        loop.add_signal_handler(number, stop.set)
    runner = web.AppRunner(app, access_log=None, shutdown_timeout=1.0)
    await runner.setup()
    try:
        site = web.TCPSite(runner, ADDRESS, port, backlog=512)
        try:
            await site.start()
        except OSError as problem:
            raise RunError(f"port {port}: {os.strerror(problem.errno)}") from None
        app[SERVER]["port"] = runner.addresses[0][1]
        watch = asyncio.create_task(drop_silent(app, runner.server))
        address = f"http://{ADDRESS}:{app[SERVER]['port']}/"
        print(f"{address}  (Ctrl-C ends)", flush=True)
        yield address, stop
        watch.cancel()
    finally:
        await runner.cleanup()


def page_of(text: str) -> Callable:
    """Return a function that answers with a page."""

    async def answer(_: web.Request) -> web.Response:
        return web.Response(text=text, content_type="text/html")

    return answer


# --- a run that goes on ---


class Live:
    """The newest film of a run that may still be going on.

    For each look the file is opened anew, without locks, and only committed data are read, so that
    the run is not disturbed.
    """

    def __init__(self, run: Run, filmed: Callable[[Run], dict]) -> None:
        """Take the run and the function that makes a film of it."""
        self.final = run.path.with_suffix("") if run.path.suffix == ".part" else run.path
        self.part, self.filmed = Path(f"{self.final}.part"), filmed
        self.claim = Path(f"{self.final}.lock")  # there, and locked, while the program writes
        self.lock = threading.Lock()
        self.stamp, self.news = "", b""
        self.asked = -PATIENCE  # when a page asked last
        self.delivered = False  # a page has the end

    @property
    def end(self) -> str:
        """Why the run has ended; empty while it goes on."""
        if not self.part.exists():
            return "has ended" if self.final.exists() else ""
        if abandoned(self.claim):
            return DIED
        return "" if self.claim.exists() else "has stopped"

    def answer(self, known: str) -> tuple[bytes, bool]:
        """Return what is new for a page, and whether the run has ended."""
        with self.lock:
            end = self.end
            # Caught at an unlucky moment, as when the file is renamed: the next look will do.
            with suppress(RunError, FileNotFoundError):
                run = read_run(self.part if self.part.exists() else self.final)
                stamp = f"{run.n_frames} {end}"
                if stamp != self.stamp:
                    news = {"stamp": stamp, "end": end, "warning": run.termination_note}
                    self.news = json.dumps(news | self.filmed(run), allow_nan=False).encode()
                    self.stamp = stamp
            ends = bool(end) and self.stamp.endswith(end)
            return b"" if known == self.stamp else self.news, ends

    async def film(self, request: web.Request) -> web.StreamResponse:
        """Answer a page that asks."""
        self.asked = asyncio.get_running_loop().time()
        news, ends = await asyncio.to_thread(self.answer, request.query.get("known", ""))
        response = web.Response(body=news, content_type="application/json")
        await response.prepare(request)
        await response.write_eof()
        self.delivered = self.delivered or ends  # only now: then the server leaves
        return response


def abandoned(lock: Path) -> bool:
    """Whether a lock file is there that no process holds: the run has died.

    A lock that is free is taken for a moment only.  Where file locks do not work the answer is no.
    """
    import fcntl  # not on Windows, where files can be read nevertheless

    try:
        descriptor = os.open(lock, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return os.path.samestat(os.fstat(descriptor), lock.stat())  # not one just removed
    except OSError:
        return False
    finally:
        os.close(descriptor)


def serve(
    run: Run, page: str, filmed: Callable[[Run], dict], visit: Callable[[str], object] | None = None
) -> str:
    """Show the run until it has ended, or until Ctrl-C or TERM; return how it ended.

    `visit` is called with the address of the page.  Raises RunError if there is nothing to show,
    or if the run has died.
    """
    if run.path.suffix != ".part":
        raise RunError(f"{run.path}: has finished; leave out --live")
    live = Live(run, filmed)
    if live.end:
        raise RunError(f"{run.path}: the run {live.end}; leave out --live")
    asyncio.run(shown(live, page, visit))
    end, left = live.end, live.part if live.part.exists() else live.final
    if end == DIED:
        raise RunError(f"{left}: the run {end}")
    return f"the run {end}: {left}" if end else "stopped; the run goes on"


async def shown(live: Live, page: str, visit: Callable[[str], object] | None) -> None:
    """Serve the page until the end of the run has been told, or until a signal."""
    app = application({"/": page_of(page), "/film": live.film})
    async with serving(app) as (address, stop):
        if visit:
            threading.Thread(target=visit, args=[address], daemon=True).start()
        clock = asyncio.get_running_loop().time
        while not stop.is_set():
            told = live.delivered or clock() > live.asked + PATIENCE
            if live.end and told:
                break
            with suppress(TimeoutError):
                await asyncio.wait_for(stop.wait(), LOOK)
