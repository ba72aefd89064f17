"""Take the screenshots of the laboratory (the interactive web page) for the tutorials.

    python docs/screenshots.py [NAME...]

The script starts the laboratory, opens it in headless Chromium, and writes pictures to
docs/tutorials. It requires the program and its library (`make all library`), Chromium and
chromedriver.
"""

import base64
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS), str(DOCS.parent / "tests"), str(DOCS.parent / "post")]
from browser import browsing  # noqa: E402
from page_figures import reduced  # noqa: E402

#: Input of each screenshot, and the simulated time at which it is taken.
PICTURES = {
    "laboratory": ("mixture", 1.5),
    "laboratory_crater": ("crater", 0.48),
    "laboratory_collision": ("collision", 0),
    "laboratory_pump": ("pump", 17),
}
#: Time shown by the film, or -1 before the first picture.
TIME = """const { film, moment } = filmOf(current()).inside?.() ?? {};
    return film ? moment.time : -1"""


def address_of(lab: subprocess.Popen) -> str:
    """Return the address that the laboratory prints."""
    for line in lab.stdout:
        if found := re.search(r"http://\S+", line):
            return found[0]
    raise SystemExit("the laboratory has printed no address")


def main() -> None:
    wanted = sys.argv[1:] or [*PICTURES]
    command = [sys.executable, DOCS.parent / "post" / "lab.py", "--no-open"]
    with (
        tempfile.TemporaryDirectory() as folder,
        subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        ) as lab,
    ):
        try:
            address = address_of(lab).split("#")[0]
            with browsing(Path(folder), (1400, 900)) as browser:
                for name in wanted:
                    given, when = PICTURES[name]
                    browser.open("about:blank")
                    browser.open(f"{address}#input={given}")
                    while browser.run(TIME) < when:
                        time.sleep(0.1)
                    browser.draw(3)
                    data = base64.b64decode(browser.call("GET", "/screenshot"))
                    picture = Path(folder) / f"{name}.png"
                    picture.write_bytes(data)
                    (DOCS / "tutorials" / f"{name}.png").write_bytes(reduced(picture))
        finally:
            lab.terminate()


if __name__ == "__main__":
    main()
