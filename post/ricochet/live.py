"""Show a run in the browsers of this computer while it goes on.

The file is opened anew for each look, without locks, and only what is committed is read: the run
does not notice.  Requests that do not come from a page of this very address are refused, lest pages
of other hosts read along under a name that points here (DNS rebinding).
"""

import json
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from .files import RunError
from .reader import Run, read_run

ADDRESS = "127.0.0.1"
LOOK = 0.5  # seconds between looks whether the run has ended
PATIENCE = 10.0  # seconds since a page last asked, after which none is left to be told the end


class Live:
    """The newest film of a run that may still be going on."""

    def __init__(self, run: Run, filmed: Callable[[Run], dict]) -> None:
        """Take the unfinished run, and what makes a film of a run."""
        self.part, self.filmed = run.path, filmed
        self.final = run.path.with_suffix("")
        self.claim = Path(f"{self.final}.lock")  # there while the program writes; never opened here
        self.lock = threading.Lock()
        self.stamp, self.news = "", b""
        self.asked = -PATIENCE  # when a page asked last
        self.delivered = False  # a page has the end

    @property
    def end(self) -> str:
        """Empty while the run goes on.  The final name means that it has finished."""
        if not self.part.exists():
            return "has ended" if self.final.exists() else ""
        return "" if self.claim.exists() else "has stopped"

    def answer(self, known: str) -> bytes:
        """What a page does not know yet; nothing if there is nothing new."""
        with self.lock:
            self.asked = time.monotonic()
            end = self.end
            with suppress(RunError):  # caught at an unlucky moment: the next look will do
                run = read_run(self.part if self.part.exists() else self.final)
                stamp = f"{run.frames} {end}"
                if stamp != self.stamp:
                    news = {"stamp": stamp, "end": end, "warning": run.shortcoming}
                    self.news = json.dumps(news | self.filmed(run), allow_nan=False).encode()
                    self.stamp = stamp
            self.delivered = bool(end) and self.stamp.endswith(end)
            return b"" if known == self.stamp else self.news


def handler(live: Live, page: bytes) -> type[BaseHTTPRequestHandler]:
    """What answers the requests: the page at /, what is new at /film."""

    class Handler(BaseHTTPRequestHandler):
        server_version, sys_version = "ricochet", ""

        def do_GET(self) -> None:
            port, url = self.server.server_address[1], urlsplit(self.path)
            if self.headers.get_all("Host") not in ([f"{ADDRESS}:{port}"], [f"localhost:{port}"]):
                self.reply(403, "text/plain", b"only for pages of this computer\n")
            elif url.path == "/":
                self.reply(200, "text/html; charset=utf-8", page)
            elif url.path == "/film":
                known = parse_qs(url.query).get("known", [""])[0]
                self.reply(200, "application/json", live.answer(known))
            else:
                self.reply(404, "text/plain", b"no such page\n")

        def reply(self, code: int, kind: str, body: bytes) -> None:
            self.send_response(code)
            for name, value in (
                ("Content-Type", kind),
                ("Content-Length", str(len(body))),
                ("Cache-Control", "no-store"),
                ("X-Content-Type-Options", "nosniff"),
                ("Cross-Origin-Resource-Policy", "same-origin"),
                ("Content-Security-Policy", "frame-ancestors 'none'"),
            ):
                self.send_header(name, value)
            self.end_headers()
            with suppress(ConnectionError):  # the page was closed meanwhile
                self.wfile.write(body)

        def log_message(self, *_) -> None:
            """Nothing: requests are of no interest."""

    return Handler


def serve(run: Run, page: str, filmed: Callable[[Run], dict]) -> str:
    """Show the run until it has ended, or until Ctrl-C or TERM; returns what happened."""
    if run.path.suffix != ".part":
        raise RunError(f"{run.path}: has finished; leave out --live")
    live = Live(run, filmed)
    if live.end:
        raise RunError(f"{run.path}: the run {live.end}; leave out --live")
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with ThreadingHTTPServer((ADDRESS, 0), handler(live, page.encode())) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            print(f"http://{ADDRESS}:{server.server_address[1]}/  (Ctrl-C ends)", flush=True)
            while not live.end:
                time.sleep(LOOK)
            while not live.delivered and time.monotonic() < live.asked + PATIENCE:
                time.sleep(LOOK)
        except KeyboardInterrupt:
            pass
        finally:
            server.shutdown()
    if not live.end:
        return "stopped; the run goes on"
    return f"the run {live.end}: {live.part if live.part.exists() else live.final}"
