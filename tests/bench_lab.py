"""Measure response times and frame rates of the laboratory in a browser: `make bench-lab`.

Headless Chromium draws without a graphics card, so that a browser on a screen is not slower. The
script fails if a measured value misses its goal, which is meaningful only on an otherwise idle
computer.
"""

import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from browser import browsing

LAB = Path(__file__).resolve().parents[1] / "post/lab.py"
LONGEST = 20_000  # time limit of a measurement [ms]
# In every document: time from the request of the page to the first motion of disks [ms].
OPENING = """if (top === window) requestAnimationFrame(function look(now) {
  try { if (filmOf(current()).inside().moment.time > 0) { window.moved = now; return; } } catch {}
  requestAnimationFrame(look);
});"""
# Time from the change of a value to a picture of disks that moved with the new value [ms].
WAIT = """const [key, text, anew, longest] = arguments, box = current(), from = performance.now();
const before = anew ? box.run : box.changes.length, seen = filmOf(box).inside;
const isNew = () => anew
  ? box.run > before && seen().stream.run === box.run && seen().moment.time > 0
  : box.changes.length > before && seen().moment.time > box.changes.at(-1)[0];
set(key, text);
return new Promise(done => requestAnimationFrame(function look() {
  const taken = performance.now() - from;
  if (isNew() || taken > longest) done(taken); else requestAnimationFrame(look);
}));"""
# Number of pictures per second that differ from the previous one.
PICTURES = """const seen = filmOf(current()).inside, from = performance.now();
let count = 0, last = seen().moment.time;
return new Promise(done => requestAnimationFrame(function look() {
  const { time } = seen().moment, taken = performance.now() - from;
  if (time !== last) { count++; last = time; }
  if (taken > 5000) done(1000 * count / taken); else requestAnimationFrame(look);
}));"""


def opened(browser, address):
    """Open the page after a pause, like a user, and return the time until disks move [ms]."""
    time.sleep(2)
    browser.open(address)
    for _ in range(LONGEST // 16):
        if moved := browser.run("return window.moved"):
            return moved
        browser.draw(1)
    raise SystemExit("no disks move in the page")


def measured(browser, address, repeats):
    """Yield each measured quantity, its goal, and whether smaller values are better."""
    script = {"cmd": "Page.addScriptToEvaluateOnNewDocument", "params": {"source": OPENING}}
    browser.call("POST", "/goog/cdp/execute", script)

    def waits(key, values, anew):
        found = []
        for value in values:
            found.append(browser.run(WAIT, key, f"{value:.6g}", anew, LONGEST) / 1000)
            browser.draw(30)
        return statistics.median(found)

    opening = statistics.median(opened(browser, address) / 1000 for _ in range(repeats))
    yield "opening the page (s)", opening, 0.5, True
    steps = range(repeats)
    acting = waits("contact.restitution", (0.99 - 0.01 * k for k in steps), False)
    yield "a slider that acts at once (s)", acting, 0.1, True
    anew = waits("species.gas.radius", (0.004 + 1e-4 * k for k in steps), True)
    yield "a slider that starts anew (s)", anew, 0.3, True
    yield "pictures per second, 1000 disks", browser.run(PICTURES), 50, False
    waits("species.gas.radius", [0.002], True)
    waits("species.gas.count", [20000], True)
    yield "pictures per second, 20 000 disks", browser.run(PICTURES), 20, False


def main():
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    missed = 0
    with tempfile.TemporaryDirectory(prefix="ricochet-bench-") as folder:
        command = [sys.executable, LAB]
        lab = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=folder)
        try:
            address = lab.stdout.readline().split()[0]
            with browsing(Path(folder), (1280, 800)) as browser:
                for what, value, goal, less in measured(browser, address, repeats):
                    reached = value <= goal if less else value >= goal
                    missed += not reached
                    note = "" if reached else "  missed"
                    print(f"{what:36}{value:8.3f}   goal {goal:g}{note}", flush=True)
        except pytest.skip.Exception as problem:
            sys.exit(f"bench_lab.py: {problem.msg}")
        finally:
            lab.terminate()
            lab.wait()
    sys.exit(bool(missed))


if __name__ == "__main__":
    main()
