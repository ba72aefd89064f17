"""Execute the commands of guides, and store the figures that the guides show.

    python docs/guide_figures.py [NAME...]

The script executes the code blocks of all guides, or of those named. The test
tests/runs/test_pages.py executes the same code blocks with shorter runs. If a guide shows the
picture NAME.png, its code blocks write the figure runs/NAME.png, which the script copies to the
folder of the guide with fewer pixels and colours. Output files of the runs are kept in the folder
that the environment variable GUIDE_RUNS names, if any.
"""

import os
import re
import sys
import tempfile
from pathlib import Path

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path[:0] = [str(DOCS), str(ROOT / "tests"), str(ROOT / "tests" / "runs"), str(ROOT / "post")]
from page_figures import reduced  # noqa: E402
from test_pages import blocks_of, execute, make_project  # noqa: E402

os.environ["THOROUGH"] = "1"  # draws figures with their layout, which most tests omit
GUIDES = DOCS / "guides"
MOST, NARROW = 120_000, 700  # [bytes] and [pixels]: pictures of many disks become narrower


def pictures_of(page: str) -> list[str]:
    """Return the names of the pictures that are stored in the folder of a guide."""
    return re.findall(r"!\[[^]]*\]\((\w+)\.png\)", page)


def main() -> None:
    """Make the figures of all guides, or of those named on the command line."""
    program = ROOT / "build" / "ricochet"
    for name in sys.argv[1:] or [path.stem for path in sorted(GUIDES.glob("*.md"))]:
        page = (GUIDES / f"{name}.md").read_text()
        if not pictures_of(page):
            continue
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(os.environ.get("GUIDE_RUNS") or temporary) / name
            folder.mkdir(parents=True)
            make_project(folder, program)
            execute(blocks_of(page, short=False), folder, program)
            for picture in pictures_of(page):
                target = GUIDES / f"{picture}.png"
                figure = folder / "runs" / f"{picture}.png"
                small = reduced(figure)
                target.write_bytes(small if len(small) <= MOST else reduced(figure, NARROW))
                print(f"{target.relative_to(ROOT)}: {target.stat().st_size} bytes")


if __name__ == "__main__":
    main()
