"""Copy figures from runs/figures/ to the documentation pages, with fewer pixels and colours.

    make figures                         or the scripts in runs/ that draw some of the figures
    python docs/page_figures.py [NAME...]

All existing figures, or those named, are copied to the folders of the pages that show them.
"""

import io
import sys
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parent
FIGURES = DOCS.parent / "runs" / "figures"
#: Folder of the page that shows each figure.
SHOWN = {
    "crater": ".",
    "first": "tutorials",
    "scattering": "tutorials",
    "gas": "tutorials",
    "mixture": "tutorials",
    "cooling_velocity": "tutorials",
    "crater_scan": "tutorials",
    "lab_frames": "tutorials",
    "lab_speeds": "tutorials",
    "cost": "tutorials",
    "discharge": "guides",
    "gravity_energy": "tutorials",
    "gravity_equipartition": "tutorials",
    "gravity_laws": "tutorials",
    "gravity_missed": "tutorials",
}
#: Fraction of a figure, from its top, that the page shows [all].
UPPER_PART = {"crater": 0.475}
WIDTH, COLOURS = 1100, 128


def reduced(path: Path, width: int = WIDTH, part: float = 1.0) -> bytes:
    """Return a figure as a PNG file, `width` pixels wide at most, with `COLOURS` colours.

    Only the fraction `part` of the figure, from its top, is included.
    """
    picture = Image.open(path).convert("RGB")
    picture = picture.crop((0, 0, picture.width, round(part * picture.height)))
    if picture.width > width:
        height = round(picture.height * width / picture.width)
        picture = picture.resize((width, height), Image.Resampling.LANCZOS)
    # The default method of Pillow (median cut) would replace the colours of thin lines.
    few = {"method": Image.Quantize.MAXCOVERAGE, "kmeans": 1, "dither": Image.Dither.NONE}
    file = io.BytesIO()
    picture.quantize(COLOURS, **few).save(file, format="png", optimize=True)
    return file.getvalue()


def main() -> None:
    for name in sys.argv[1:] or SHOWN:
        source = FIGURES / f"{name}.png"
        if sys.argv[1:] or source.exists():
            target = DOCS / SHOWN[name] / f"{name}.png"
            target.write_bytes(reduced(source, part=UPPER_PART.get(name, 1.0)))
            print(f"{target.relative_to(DOCS.parent)}: {target.stat().st_size} bytes")


if __name__ == "__main__":
    main()
