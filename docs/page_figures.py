"""Copy figures from runs/figures/ to the documentation pages, with fewer pixels and colours.

    make figures                         or the scripts in runs/ that draw some of the figures
    python docs/page_figures.py [NAME...]

The script copies the figures that the arguments name, or all existing figures, from runs/figures/
to the folders of the pages that show the figures.  The script reduces the numbers of pixels and
colours of each figure.
"""

import io
import sys
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parent
FIGURES = DOCS.parent / "runs" / "figures"
#: Folder of the page that shows each figure.
SHOWN = {
    "first": "tutorials",
    "scattering": "tutorials",
    "gas": "tutorials",
    "mixture": "tutorials",
    "cooling_velocity": "tutorials",
    "crater_scan": "tutorials",
    "lab_frames": "tutorials",
    "lab_speeds": "tutorials",
    "cost": "tutorials",
    "gravity_energy": "tutorials",
    "gravity_equipartition": "tutorials",
    "gravity_laws": "tutorials",
    "gravity_missed": "tutorials",
}
WIDTH, COLOURS = 1100, 64


def reduced(path: Path, width: int = WIDTH) -> bytes:
    """Return a figure as a PNG file with at most `width` pixels per row and `COLOURS` colours."""
    picture = Image.open(path).convert("RGB")
    if picture.width > width:
        height = round(picture.height * width / picture.width)
        picture = picture.resize((width, height), Image.Resampling.LANCZOS)
    file = io.BytesIO()
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(file, format="png", optimize=True)
    return file.getvalue()


def main() -> None:
    for name in sys.argv[1:] or SHOWN:
        source = FIGURES / f"{name}.png"
        if sys.argv[1:] or source.exists():
            target = DOCS / SHOWN[name] / f"{name}.png"
            target.write_bytes(reduced(source))
            print(f"{target.relative_to(DOCS.parent)}: {target.stat().st_size} bytes")


if __name__ == "__main__":
    main()
