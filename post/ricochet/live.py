"""Show a run in the browsers of this computer while it goes on.

The file is opened anew for each look, without locks, and only what is committed is read: the run
does not notice.  Requests that do not come from a page of this very address are refused, lest pages
of other hosts read along under a name that points here (DNS rebinding).
"""

import json
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote

from .files import RunError
from .reader import Run, read_run

ADDRESS = "127.0.0.1"
LOOK = 0.5  # seconds between looks whether the run has ended
DIED = "was killed or has crashed"
PATIENCE = 10.0  # seconds since a page last asked, after which none is left to be told the end


class Live:
    """The newest film of a run that may still be going on."""

    def __init__(self, run: Run, filmed: Callable[[Run], dict]) -> None:
        """Take the run, and what makes a film of a run."""
        self.final = run.path.with_suffix("") if run.path.suffix == ".part" else run.path
        self.part, self.filmed = Path(f"{self.final}.part"), filmed
        self.claim = Path(f"{self.final}.lock")  # there, and locked, while the program writes
        self.lock = threading.Lock()
        self.stamp, self.news = "", b""
        self.asked = -PATIENCE  # when a page asked last
        self.delivered = False  # a page has the end

    @property
    def end(self) -> str:
        """Empty while the run goes on.  The final name means that it has finished."""
        if not self.part.exists():
            return "has ended" if self.final.exists() else ""
        if abandoned(self.claim):
            return DIED
        return "" if self.claim.exists() else "has stopped"

    def answer(self, known: str) -> tuple[bytes, bool]:
        """What a page does not know yet, nothing if there is nothing new; whether it is the end."""
        with self.lock:
            self.asked = time.monotonic()
            end = self.end
            # Caught at an unlucky moment, as when the file is renamed: the next look will do.
            with suppress(RunError, FileNotFoundError):
                run = read_run(self.part if self.part.exists() else self.final)
                stamp = f"{run.frames} {end}"
                if stamp != self.stamp:
                    news = {"stamp": stamp, "end": end, "warning": run.shortcoming}
                    self.news = json.dumps(news | self.filmed(run), allow_nan=False).encode()
                    self.stamp = stamp
            ends = bool(end) and self.stamp.endswith(end)
            return b"" if known == self.stamp else self.news, ends


def abandoned(lock: Path) -> bool:
    """Whether a lock file is there that nobody holds: the kernel has dropped the lock of a run.

    A lock that is held is left alone, and one that is not for a moment only.  Where there are no
    locks nobody knows.
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


class Server(ThreadingHTTPServer):
    """A thread for each connection."""

    daemon_threads = True

    def handle_error(self, *_) -> None:
        """A connection that breaks is of no interest; anything else is one line."""
        problem = sys.exception()
        if not isinstance(problem, ConnectionError):
            print(f"a request was not answered: {problem!r}", file=sys.stderr)


class Handler(BaseHTTPRequestHandler):
    """Answers pages of this computer, and nobody else."""

    server_version, sys_version = "ricochet", ""
    timeout = 60  # seconds that a request may take to arrive
    frames = "'none'"  # whose pages may show this one as a part

    def found(self, path: str, query: str) -> tuple[int, str, bytes]:
        """Status, kind and body of what is at a path."""
        raise NotImplementedError

    def do_GET(self) -> None:
        path, _, query = self.path.partition("?")
        if self.headers.get_all("Host") not in ([host] for host in self.hosts):
            self.reply(403, "text/plain", b"only for pages of this computer\n")
        else:
            self.reply(*self.found(path, query))

    @property
    def hosts(self) -> list[str]:
        """The names of this server."""
        port = self.server.server_address[1]
        return [f"{ADDRESS}:{port}", f"localhost:{port}"]

    def send_error(self, code: int, *_) -> None:
        """Whatever it is that http.server does not understand, it is the request."""
        self.close_connection = True
        self.reply(code if code < 500 else 400, "text/plain", b"not understood\n")

    def reply(self, code: int, kind: str, body: bytes) -> None:
        self.request_version = "HTTP/1.0"  # else some answers would have no status
        self.send_response(code)
        for name, value in (
            ("Content-Type", kind),
            ("Content-Length", str(len(body))),
            ("Cache-Control", "no-store"),
            ("X-Content-Type-Options", "nosniff"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
            ("Content-Security-Policy", f"frame-ancestors {self.frames}"),
        ):
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_) -> None:
        """Nothing: requests are of no interest."""


NOT_FOUND = 404, "text/plain", b"no such page\n"
HTML, JSON = "text/html; charset=utf-8", "application/json"


def handler(live: Live, page: bytes) -> type[Handler]:
    """What answers the requests: the page at /, what is new at /film."""

    class Show(Handler):
        ends = False  # whether the answer tells that the run has ended

        def do_GET(self) -> None:
            super().do_GET()
            live.delivered = live.delivered or self.ends  # only now: then the server leaves

        def found(self, path: str, query: str) -> tuple[int, str, bytes]:
            match path:
                case "/":
                    return 200, HTML, page
                case "/film":
                    news, self.ends = live.answer(unquote(query.removeprefix("known=")))
                    return 200, JSON, news
            return NOT_FOUND

    return Show


@contextmanager
def serving(answers: type[Handler], port: int = 0) -> Iterator[str]:
    """Answer requests, and print the address; Ctrl-C, TERM, HUP are KeyboardInterrupt meanwhile.

    Raises RunError if the port is taken.
    """
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler)
    try:
        server = Server((ADDRESS, port), answers)
    except OSError as problem:
        raise RunError(f"port {port}: {problem.strerror}") from None
    with server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://{ADDRESS}:{server.server_address[1]}/"
        try:
            print(f"{address}  (Ctrl-C ends)", flush=True)
            yield address
        finally:
            server.shutdown()


def serve(
    run: Run, page: str, filmed: Callable[[Run], dict], visit: Callable[[str], object] | None = None
) -> str:
    """Show the run until it has ended, or until Ctrl-C or TERM; returns what happened.

    `visit` is called with the address of the page.
    Raises RunError if there is nothing to show or the run has died.
    """
    if run.path.suffix != ".part":
        raise RunError(f"{run.path}: has finished; leave out --live")
    live = Live(run, filmed)
    if live.end:
        raise RunError(f"{run.path}: the run {live.end}; leave out --live")
    with suppress(KeyboardInterrupt), serving(handler(live, page.encode())) as address:
        if visit:
            visit(address)
        while not live.end:
            time.sleep(LOOK)
        while not live.delivered and time.monotonic() < live.asked + PATIENCE:
            time.sleep(LOOK)
    end, left = live.end, live.part if live.part.exists() else live.final
    if end == DIED:
        raise RunError(f"{left}: the run {end}")
    return f"the run {end}: {left}" if end else "stopped; the run goes on"
