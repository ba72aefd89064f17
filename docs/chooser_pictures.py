"""Draw the pictures input/pictures/NAME.png of all input files offered in the laboratory.

    python docs/chooser_pictures.py [NAME...]

Each picture shows the simulation of an input file at the time given in input/chooser.json, for few
disks with their paths. It contains a checksum of the input file, so that a test can detect changes
of the file.
"""

import hashlib
import io
import json
import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from PIL import Image, PngImagePlugin

INPUTS = Path(__file__).resolve().parents[1] / "input"
PIXELS, FEW = 144, 20
SPECIES = ("#0072b2", "#d55e00", "#009e73")
#: Colour palette of a picture: shades of grey, and mixtures of the disk colours with white.
PALETTE = [g for grey in (77, 130, 204, 255) for g in (grey,) * 3] + [
    round(255 + share * (int(colour[k : k + 2], 16) - 255))
    for colour in SPECIES
    for share in (1, 0.66, 0.33)
    for k in (1, 3, 5)
]


def digest(path: Path, at: float) -> str:
    """Return a checksum of the time, and of the input without its comments."""
    lines = [line.split("!")[0].strip() for line in path.read_text(encoding="utf-8").splitlines()]
    return hashlib.sha256("\n".join([*filter(None, lines), repr(float(at))]).encode()).hexdigest()


def draw_sides(axes: Axes, room: np.ndarray, sides: list[dict]) -> None:
    """Draw the sides of a box with the corners `room` (2, 2), except open ones."""
    (x0, y0), (x1, y1) = room
    if not any(side.get("open") for side in sides):
        axes.add_patch(Rectangle(room[0], x1 - x0, y1 - y0, fill=False, color="0.3", lw=0.8))
        return
    lines = [[(x, y0), (x, y1)] for x in (x0, x1)] + [[(x0, y), (x1, y)] for y in (y0, y1)]
    shut = [line for line, side in zip(lines, sides, strict=True) if not side.get("open")]
    axes.add_collection(LineCollection(shut, color="0.3", lw=0.8, capstyle="projecting"))


def picture(path: Path, at: float) -> bytes:
    """Return a PNG picture of the disks at the given time."""
    from ricochet import Simulation
    from ricochet.reading.box import obstacles_of, walls_of
    from ricochet.reading.reader import SIDES

    figure = Figure(figsize=(1.6, 1.6), dpi=2 * PIXELS / 1.6, layout="none")
    axes = figure.add_axes((0.02, 0.02, 0.96, 0.96))
    with Simulation(path) as run:
        box = run.parameters["box"]
        way = [run.position.copy()]
        for time in np.linspace(0, at, 401 if run.n_disks <= FEW else 2)[1:]:
            way.append(run.advance(time=time).position)
        lower, upper = (np.asarray(box[end], float) for end in ("lower", "upper"))
        room = np.array([lower, upper])
        for k, side in enumerate(SIDES):
            if (place := f"sides/{side}/position") in run.observables:
                room[k % 2, k // 2] = run.observable(place)
        axes.add_patch(Rectangle(lower, *(upper - lower), fill=False, color="0.8", lw=0.8))
        draw_sides(axes, room, [run.parameters.get("side", {}).get(k, {}) for k in SIDES])
        for one in obstacles_of(run.parameters):
            if one.is_arc:
                axes.plot(*one.points(181).T, color="0.3", lw=0.8)
                continue
            colour = "none" if one.inside else "0.8"
            axes.add_patch(Circle(one.centre, one.radius, facecolor=colour, edgecolor="0.3"))
        walls = walls_of(run.parameters)
        axes.add_collection(LineCollection(walls, color="0.3", lw=0.8))
        inside = np.isfinite(run.position[:, 0])  # the others are outside an open box
        least = min(0.006, 0.2 / np.sqrt(run.n_disks)) * np.max(upper - lower)
        size = 2 * np.maximum(run.radius, least)[inside]
        colours = [SPECIES[(k - 1) % len(SPECIES)] for k in run.species]
        if run.n_disks <= FEW:
            way = np.array(way)
            jumps = (
                np.abs(np.diff(way, axis=0)).max(axis=2, keepdims=True) > (upper - lower).min() / 2
            )
            way[1:][np.broadcast_to(jumps, way[1:].shape)] = np.nan
            for k in range(run.n_disks):
                axes.plot(*way[:, k].T, color=colours[k], lw=0.6)
        circles = EllipseCollection(
            size,
            size,
            0 * size,
            units="xy",
            offsets=run.position[inside],
            offset_transform=axes.transData,
        )
        circles.set(facecolor=np.array(colours)[inside], edgecolor="none")
        axes.add_collection(circles)
    axes.set(xlim=(lower[0], upper[0]), ylim=(lower[1], upper[1]), aspect="equal")
    axes.set_axis_off()
    large, file = io.BytesIO(), io.BytesIO()
    figure.savefig(large, format="png")
    small = Image.open(large).convert("RGB").resize((PIXELS, PIXELS), Image.Resampling.LANCZOS)
    notes = PngImagePlugin.PngInfo()
    notes.add_text("input", digest(path, at))
    colours = Image.new("P", (1, 1))
    colours.putpalette(PALETTE)
    small.quantize(palette=colours, dither=Image.Dither.NONE).save(
        file, format="png", optimize=True, pnginfo=notes
    )
    return file.getvalue()


def main() -> None:
    known = json.loads((INPUTS / "chooser.json").read_text(encoding="utf-8"))
    (INPUTS / "pictures").mkdir(exist_ok=True)
    for name in sys.argv[1:] or known:
        data = picture(INPUTS / f"{name}.nml", known[name]["at"])
        (INPUTS / f"pictures/{name}.png").write_bytes(data)
        print(f"input/pictures/{name}.png: {len(data)} bytes")


if __name__ == "__main__":
    main()
