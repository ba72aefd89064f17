"""Execute the commands of guides, and store the figures that the guides show.

    python docs/guide_figures.py [NAME...]

The script executes the blocks of code of the guides with the given names, or of all guides, as
tests/runs/test_pages.py does, but without the replacements that make runs short.  A guide that
shows the picture `NAME.png` makes the figure `runs/NAME.png`; the script stores it beside the
page, with fewer pixels and colours.  The runs are kept if the variable GUIDE_RUNS names a folder.
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

GUIDES = DOCS / "guides"
MOST, NARROW = 120_000, 700  # [bytes] and [pixels]: pictures of many disks become narrower


def pictures_of(page: str) -> list[str]:
    """Return the names of the pictures of a guide that stand in its own folder."""
    return re.findall(r"!\[[^]]*\]\((\w+)\.png\)", page)


def main() -> None:
    """Make the figures of all guides, or of those that are named."""
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
