"""Browser for tests of pages: headless Chromium, controlled by chromedriver."""

import contextlib
import json
import re
import shutil
import subprocess
import time
import urllib.request
from pathlib import Path

import pytest

from whole_runs import PATIENCE, wait_for, with_parent

PORT = r"started successfully on port (\d+)"
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--remote-debugging-pipe",  # Chromium ends with the driver, even if that is killed
]


class Browser:
    """Session of chromedriver, by the W3C WebDriver protocol."""

    def __init__(self, port: int, profile: Path, size: tuple[int, int]) -> None:
        """Start Chromium with an empty profile."""
        self.root = f"http://127.0.0.1:{port}"
        arguments = [*FLAGS, f"--user-data-dir={profile}", f"--window-size={size[0]},{size[1]}"]
        wanted = {
            "timeouts": {"script": 1000 * PATIENCE, "pageLoad": 1000 * PATIENCE},
            "goog:chromeOptions": {"args": arguments, "binary": shutil.which("chromium")},
            "goog:loggingPrefs": {"browser": "ALL"},
        }
        answer = self.call("POST", "/session", {"capabilities": {"alwaysMatch": wanted}})
        self.root += f"/session/{answer['sessionId']}"

    def call(self, method: str, path: str, body: dict | None = None) -> object:
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.root + path, data, method=method)
        request.add_header("Content-Type", "application/json")
        with urllib.request.urlopen(request, timeout=PATIENCE) as reply:
            return json.load(reply)["value"]

    def open(self, page: Path | str) -> None:
        address = page if isinstance(page, str) else page.resolve().as_uri()
        self.call("POST", "/url", {"url": address})

    def run(self, script: str, *arguments) -> object:
        return self.call("POST", "/execute/sync", {"script": script, "args": list(arguments)})

    def until(self, condition: str, *arguments) -> None:
        """Wait in the page until a script returns a true value.

        Repeated commands would use more processor time than the page itself.
        """
        self.run(
            f"""const given = arguments;
            function found() {{ {condition} }}
            return new Promise((done, fail) => (function look() {{
              try {{ if (found(...given)) done(true); else setTimeout(look, 20); }}
              catch (problem) {{ fail(problem); }}
            }})());""",
            *arguments,
        )

    def resize(self, width: int, height: int, phone: bool = False) -> None:
        """Set the size of the page itself, as on a device."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": 2 if phone else 1}
        self.protocol("Emulation.setDeviceMetricsOverride", **metrics, mobile=phone)

    def protocol(self, command: str, **params) -> object:
        """Execute a command of the protocol of Chromium's developer tools."""
        return self.call("POST", "/goog/cdp/execute", {"cmd": command, "params": params})

    def touch(self, *places: tuple[float, float], lifted: bool = True) -> None:
        """Move a finger along a path in window coordinates, as on a screen that can be scrolled.

        A finger that rests before it is lifted leaves the page without motion.
        """
        kinds = ["touchStart"] + ["touchMove"] * (len(places) - 1)
        for kind, (x, y) in zip(kinds, places, strict=True):
            self.protocol("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y}])
        if lifted:
            time.sleep(0.1 if len(places) > 1 else 0)
            self.protocol("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def complaints(self) -> list[dict]:
        return self.call("POST", "/se/log", {"type": "browser"})

    def draw(self, count: int) -> None:
        """Wait until the given number of pictures has been drawn."""
        self.run(
            """let left = arguments[0];
            return new Promise(done => requestAnimationFrame(function again() {
              if (left-- > 0) requestAnimationFrame(again); else done(true);
            }));""",
            count,
        )

    def element(self, name: str) -> dict:
        return self.call("POST", "/element", {"using": "css selector", "value": f"#{name}"})

    def click(self, name: str) -> None:
        self.call("POST", f"/element/{next(iter(self.element(name).values()))}/click", {})

    def on_stage(self, x: float, y: float) -> dict:
        """Return driver coordinates of a position on the stage, from its corner [CSS pixels]."""
        box = self.run("return $('stage').getBoundingClientRect().toJSON()")
        place = {"x": round(x - box["width"] / 2), "y": round(y - box["height"] / 2)}
        return {"origin": self.element("stage"), **place}

    def point(self, kind: str, *fingers: list[tuple[float, float]]) -> None:
        """Press a mouse or fingers on the stage, move each along its path, and release them."""
        moves = []
        for number, places in enumerate(fingers):
            move = {"type": "pointerMove", "duration": 30}
            first, *others = [{**move, **self.on_stage(*place)} for place in places]
            down, lift = {"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}
            one = {"type": "pointer", "id": f"p{number}", "parameters": {"pointerType": kind}}
            moves.append({**one, "actions": [first, down, *others, lift]})
        self.call("POST", "/actions", {"actions": moves})
        self.call("DELETE", "/actions")

    def wheel(self, x: float, y: float, steps: int) -> None:
        """Turn the mouse wheel at a position on the stage."""
        scroll = {"type": "scroll", "deltaX": 0, "deltaY": -100, **self.on_stage(x, y)}
        body = {"actions": [{"type": "wheel", "id": "wheel", "actions": [scroll] * steps}]}
        self.call("POST", "/actions", body)

    def press(self, *keys: str) -> None:
        kinds = "keyDown", "keyUp"
        actions = [{"type": kind, "value": key} for key in keys for kind in kinds]
        body = {"actions": [{"type": "key", "id": "keys", "actions": actions}]}
        self.call("POST", "/actions", body)

    def close(self) -> None:
        self.call("DELETE", "")


@contextlib.contextmanager
def browsing(folder: Path, size: tuple[int, int] = (1300, 860)):
    """Yield a browser with an empty profile, and end it together with its driver."""
    missing = [name for name in ("chromium", "chromedriver") if not shutil.which(name)]
    if missing:
        pytest.skip(f"no {' and no '.join(missing)} (Debian packages chromium, chromium-driver)")
    log = folder / "chromedriver.log"
    with log.open("w") as file:  # the driver chooses a free port and prints it
        command = with_parent("chromedriver", "--port=0", "--allowed-ips=127.0.0.1")
        driver = subprocess.Popen(command, stdout=file, stderr=file)
    try:
        wait_for(lambda: re.search(PORT, log.read_text()) or driver.poll() is not None)
        browser = Browser(int(re.search(PORT, log.read_text())[1]), folder / "profile", size)
        try:
            yield browser
        finally:
            browser.close()
    finally:
        driver.terminate()
        driver.wait(PATIENCE)
