"""Take the screenshots of the laboratory (the interactive web page) for the tutorials.

    python docs/screenshots.py

The script starts the laboratory, opens it in headless Chromium, and writes pictures to
docs/tutorials.  The script needs the program and its library (`make all library`), Chromium and
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

#: Input of each screenshot, and the duration of the simulation before the screenshot [s].
PICTURES = {"laboratory": ("mixture", 8), "laboratory_crater": ("crater", 20)}


def address_of(lab: subprocess.Popen) -> str:
    """Return the address that the laboratory prints."""
    for line in lab.stdout:
        if found := re.search(r"http://\S+", line):
            return found[0]
    raise SystemExit("the laboratory has printed no address")


def main() -> None:
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
                for name, (given, seconds) in PICTURES.items():
                    browser.open("about:blank")
                    browser.open(f"{address}#input={given}")
                    time.sleep(seconds)
                    data = base64.b64decode(browser.call("GET", "/screenshot"))
                    picture = Path(folder) / f"{name}.png"
                    picture.write_bytes(data)
                    (DOCS / "tutorials" / f"{name}.png").write_bytes(reduced(picture))
        finally:
            lab.terminate()


if __name__ == "__main__":
    main()
