"""Make a film to play with: one HTML file, which any browser opens, without a network.

    python post/player.py runs/gas.h5 -o gas.html
    python post/player.py runs/crater.h5 --colour displacement
    python post/player.py runs/brownian.h5 --disk 2001        with the trace of one disk

Disks of true size with walls and obstacles; play, step, speed; colour by species, speed,
displacement or collisions; a click on a disk shows its trace; the speeds of the frame with the
Maxwell curve of the same energy; energies per species.  A film has all frames that fit into 30 MB.
"""

import base64
import html
import json
import re
from pathlib import Path

import numpy as np
from matplotlib.colors import to_hex
from tqdm import tqdm

from drawing import COLOURS, caption, command_line, launch, plt
from read_run import Run, RunError, read_run
from snapshot import LABELS, chosen_frames, default_colour, values_of

PAGE = Path(__file__).with_suffix(".html")
ROOM = 29e6  # bytes of base64 for the disks
MOST_FRAMES = 20000
FEW_DISKS = 1000  # up to here traces through periodic sides are exact
BINS = 40  # of the speed histogram
FEWEST = 10  # disks of a species that has a histogram


def frames_that_fit(run: Run) -> int:
    """How many frames the file can hold: two 16-bit positions, an 8-bit colour per quantity."""
    one = run.count * (4 + len(quantities(run))) * 4 / 3
    return int(np.clip(ROOM / one, 2, MOST_FRAMES))


def quantities(run: Run) -> list[str]:
    """What disks can be coloured by, beside their species."""
    return [name for name in LABELS if name != "collisions" or run.collisions is not None]


def coded_positions(run: Run, frame: int) -> np.ndarray:
    """(N, 2) positions in the box as 16-bit integers."""
    inside = (run.position[frame] - run.lower) / run.edges
    return np.round(65535 * np.clip(inside, 0, 1)).astype("<u2")


def coded(values: np.ndarray, top: float, log: bool) -> np.ndarray:
    """Values from 0 to `top` as places 0 to 255 on the colour scale; log: of 1 + value."""
    if log:
        values, top = np.log1p(values), np.log1p(top)
    return np.round(255 * np.clip(values / top, 0, 1)).astype(np.uint8)


def coded_shifts(run: Run, frame: int, before: int) -> np.ndarray:
    """(N,) periods crossed along x and y since the frame `before`, four bits each."""
    crossed = np.clip(run.image[frame] - run.image[before], -7, 7) + 8
    return (16 * crossed[:, 0] + crossed[:, 1]).astype(np.uint8)


def scale_top(run: Run, frames: list[int], name: str) -> float:
    """The upper end of a colour scale, from some frames; a few fast disks do not count."""
    some = frames[:: max(1, len(frames) // 40)]
    values = np.concatenate([values_of(run, frame, name) for frame in {*some, frames[-1]}])
    moved = values[values > 0]
    return float(np.quantile(moved, 0.995)) if len(moved) else 1.0


def masks(run: Run) -> list[np.ndarray]:
    """The disks of each species."""
    return [run.of_species(name) for name in run.names]


def species(run: Run) -> list[dict]:
    """What is the same for all disks of a species."""
    colours = [c if c != "#000000" else "#8a8a8a" for c in map(to_hex, COLOURS)]
    return [
        {
            "name": name,
            "count": int(own.sum()),
            "mass": float(run.mass[own][0]),
            "radius": float(run.radius[own][0]),
            "colour": colours[k % len(colours)],
        }
        for k, (name, own) in enumerate(zip(run.names, masks(run), strict=True))
    ]


def mean_energies(run: Run, frame: int) -> tuple[list[float], list[float]]:
    """Kinetic and potential energy per disk of each species."""
    kinetic = run.kinetic_energy(frame)
    potential = -run.mass * (run.unwrapped(frame) @ run.gravity)
    return tuple([significant(e[own].mean()) for own in masks(run)] for e in (kinetic, potential))


def speed_counts(run: Run, frame: int, top: float) -> list[list[int]]:
    """Histogram of the speeds of each species; empty for one of few disks."""
    speed = run.speed(frame)
    return [
        np.histogram(speed[own], BINS, (0, top))[0].tolist() if own.sum() >= FEWEST else []
        for own in masks(run)
    ]


def significant(value: float) -> float:
    """Seven digits are enough for the eye and short in the file."""
    return float(f"{value:.7g}")


def film(run: Run, frames: list[int], colour: str, disk: int | None) -> tuple[dict, dict]:
    """What the page needs to know, and the arrays that move as name -> bytes."""
    tops = {name: scale_top(run, frames, name) for name in quantities(run)}
    fastest = 1.3 * tops["speed"]
    blocks = {name: bytearray() for name in ("positions", *tops)}
    shifted, before = run.image is not None and run.count <= FEW_DISKS, frames[0]
    shifts = blocks.setdefault("shifts", bytearray()) if shifted else None
    kinetic, potential, counts = [], [], []
    for frame in tqdm(frames, unit="frame", desc="player", disable=None):
        blocks["positions"] += coded_positions(run, frame).tobytes()
        for name, top in tops.items():
            blocks[name] += coded(values_of(run, frame, name), top, name == "collisions").tobytes()
        if shifted:
            shifts += coded_shifts(run, frame, before).tobytes()
            before = frame
        for series, value in zip((kinetic, potential), mean_energies(run, frame), strict=True):
            series.append(value)
        counts.append(speed_counts(run, frame, fastest))
    blocks["species"] = (run.species - 1).astype("<u2").tobytes()
    blocks["palette"] = plt.get_cmap()(range(256), bytes=True)[:, :3].tobytes()
    facts = {
        "time": [significant(t) for t in run.time[frames]],
        "collisions": run.collisions_per_disk_at(run.time[frames]).round(4).tolist(),
        "lower": run.lower.tolist(),
        "edges": run.edges.tolist(),
        "periodic": run.periodic.tolist(),
        "obstacles": [[*map(float, o.centre), o.radius, o.inside] for o in run.obstacles],
        "species": species(run),
        "kinetic": kinetic,
        "potential": potential if run.gravity.any() else None,
        "speeds": {"top": significant(fastest), "bins": BINS, "counts": counts},
        "scales": {name: [LABELS[name], significant(top)] for name, top in tops.items()},
        "colour": colour,
        "disk": disk - 1 if disk else 0 if run.count == 1 else None,
    }
    return facts, blocks


def page(run: Run, facts: dict, blocks: dict) -> str:
    """The whole file."""
    title = str(run.parameter("run", "title", "")) or run.path.stem
    commit = run.provenance.get("git_commit", "unknown")
    known = json.dumps(facts).replace("</", "<\\/")
    data = [f'<script type="application/json" id="film">{known}</script>']
    for name, block in blocks.items():
        text = base64.b64encode(block).decode()
        data.append(f'<script type="text/plain" id="{name}-data">{text}</script>')
    fillings = {
        "title": html.escape(title),
        "caption": html.escape(caption([run])),
        "source": html.escape(f"{run.path.name} (ricochet {commit})"),
        "data": "\n".join(data),
    }
    blank = re.compile("{{(" + "|".join(fillings) + ")}}")
    return blank.sub(lambda found: fillings[found[1]], PAGE.read_text(encoding="utf-8"))


def main() -> None:
    parser = command_line(__doc__, "RUN.html", one=True)
    parser.set_defaults(output=None)
    parser.add_argument("--frames", type=int, help="so many frames, evenly spread")
    parser.add_argument("--colour", choices=["species", *LABELS], help="[species, or speed]")
    parser.add_argument("--disk", type=int, metavar="ID", help="show the trace of this disk")
    args = parser.parse_args()
    run = read_run(args.run)
    path = args.output or Path(run.path.name).with_suffix(".html")
    if path.suffix != ".html":
        raise RunError(f"{path}: a player ends in .html")
    if args.disk is not None and not 1 <= args.disk <= run.count:
        raise RunError(f"{run.path}: no disk {args.disk}, there are {run.count}")
    colour = args.colour or default_colour(run)
    if colour == "collisions" and colour not in quantities(run):
        raise RunError(f"{run.path}: has no collisions per disk")
    frames = chosen_frames(run, None, max(1, min(run.frames, args.frames or frames_that_fit(run))))
    text = page(run, *film(run, frames, colour, args.disk))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    print(f"player = {path}")
    print(f"frames = {len(frames)} of {run.frames}")
    print(f"size = {len(text) / 1e6:.1f} MB")


if __name__ == "__main__":
    launch(main)
