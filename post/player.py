"""Make a film to play with: one HTML file, which any browser opens, without a network.

    python post/player.py runs/gas.h5 -o gas.html
    python post/player.py runs/crater.h5 --colour displacement
    python post/player.py runs/brownian.h5 --disks 2001       with the trace of a disk

Disks of true size with walls and obstacles; play, step, speed; colour by species, speed,
displacement or collisions; a click on a disk shows its trace; the speeds of the frame with the
Maxwell curve of the same energy; energies per species.  Without --count a film has as many frames,
evenly spread, as fit into 30 MB.
"""

import base64
import hashlib
import html
import json
import re
from pathlib import Path

from ricochet import Run, RunError, read_run
from ricochet.drawing import COLOURS, LABELS, caption, chosen_colour, plt, values_of
from ricochet.files import destination
from ricochet.script import chosen_disks, command_line, film_frames, launch, report

import numpy as np
from matplotlib.colors import to_hex
from tqdm import tqdm

PAGE = Path(__file__).with_suffix(".html")
ROOM = 29e6  # bytes of base64 for the disks
MOST_FRAMES = 20000
MOST_AT_ONCE = 200000  # disks of the frames that are handled together
FEW_DISKS = 1000  # up to here traces through periodic sides are exact
BINS = 40  # of the speed histogram
FEWEST = 10  # disks of a species that has a histogram


def frames_that_fit(run: Run) -> int:
    """How many frames the file can hold.

    Each disk needs two 16-bit positions and an 8-bit colour per quantity; time, energies and
    histograms are in words.
    """
    one = run.count * (4 + len(quantities(run)) + (run.image is not None)) * 4 / 3
    words = 40 + 200 * len(run.names)
    fixed = run.count * 2 * 4 / 3  # the species
    return int(np.clip((ROOM - fixed) / (one + words), 2, MOST_FRAMES))


def quantities(run: Run) -> list[str]:
    """What disks can be coloured by, apart from their species."""
    return ["speed", "displacement"] + ["collisions"] * (run.collisions is not None)


def coded_positions(run: Run, frames: list[int]) -> np.ndarray:
    """(T, N, 2) positions in the box as 16-bit integers."""
    inside = (run.position[frames] - run.lower) / run.edges
    return np.round(65535 * np.clip(inside, 0, 1)).astype("<u2")


def coded(values: np.ndarray, top: float, log: bool) -> np.ndarray:
    """Values from 0 to `top` as places 0 to 255 on the colour scale; log: of 1 + value."""
    if log:
        values, top = np.log1p(values), np.log1p(top)
    return np.round(255 * np.clip(values / top, 0, 1)).astype(np.uint8)


def coded_shifts(run: Run, frames: list[int], before: int) -> np.ndarray:
    """(T, N) periods crossed along x and y since the frame before, four bits each."""
    crossed = np.clip(np.diff(run.image[[before, *frames]], axis=0), -7, 7) + 8
    return (16 * crossed[..., 0] + crossed[..., 1]).astype(np.uint8)


def scale_top(run: Run, frames: list[int], name: str) -> float:
    """The upper end of a colour scale, from some frames, without the few largest values."""
    some = frames[:: max(1, len(frames) // 40)]
    values = values_of(run, sorted({*some, frames[-1]}), name)
    moved = values[values > 0]
    return float(np.quantile(moved, 0.995)) if len(moved) else 1.0


def species(run: Run) -> list[dict]:
    """What the disks of each species have in common."""
    colours = [c if c != "#000000" else "#8a8a8a" for c in map(to_hex, COLOURS)]
    return [
        {
            "name": kind.name,
            "count": int(kind.disks.sum()),
            "mass": kind.mass,
            "radius": kind.radius,
            "colour": colours[k % len(colours)],
        }
        for k, kind in enumerate(run.by_species)
    ]


def mean_energies(run: Run, frames: list[int]) -> tuple[list[list[float]], list[list[float]]]:
    """Kinetic and potential energy per disk of each species, frame by frame."""
    kinetic = run.kinetic_energy(frames)
    potential = -run.mass * (run.unwrapped(frames) @ run.gravity)
    means = (
        [e[:, kind.disks].mean(axis=1) for kind in run.by_species] for e in (kinetic, potential)
    )
    return tuple([list(map(significant, row)) for row in np.transpose(m)] for m in means)


def speed_counts(run: Run, frames: list[int], top: float) -> list[list[list[int]]]:
    """Histograms of the speeds of each species, frame by frame; empty for one of few disks."""
    bins = np.floor(run.speed(frames) * (BINS / top)).astype(int)
    bins[bins >= BINS] = BINS  # the fastest, which are not shown
    bins += (BINS + 1) * np.arange(len(frames))[:, None]
    size = (BINS + 1) * len(frames)
    counts = [
        np.bincount(bins[:, own].ravel(), minlength=size).reshape(-1, BINS + 1)[:, :BINS].tolist()
        if own.sum() >= FEWEST
        else [[]] * len(frames)
        for own in (kind.disks for kind in run.by_species)
    ]
    return list(map(list, zip(*counts, strict=True)))


def significant(value: float) -> float:
    """Seven digits are enough for the eye and short in the file."""
    return float(f"{value:.7g}")


def film(run: Run, frames: list[int], colour: str, traced: list[int]) -> tuple[dict, dict]:
    """What the page needs to know, and the arrays that move as name -> bytes."""
    tops = {name: scale_top(run, frames, name) for name in quantities(run)}
    fastest = 1.3 * tops["speed"]
    blocks = {name: bytearray() for name in ("positions", *tops)}
    shifted, before = run.image is not None and run.count <= FEW_DISKS, frames[0]
    shifts = blocks.setdefault("shifts", bytearray()) if shifted else None
    kinetic, potential, counts = [], [], []
    with tqdm(total=len(frames), unit="frame", desc="player", disable=None) as progress:
        at_once = max(1, MOST_AT_ONCE // run.count)
        for first in range(0, len(frames), at_once):
            some = frames[first : first + at_once]
            blocks["positions"] += coded_positions(run, some).tobytes()
            for name, top in tops.items():
                values = values_of(run, some, name)
                blocks[name] += coded(values, top, name == "collisions").tobytes()
            if shifted:
                shifts += coded_shifts(run, some, before).tobytes()
                before = some[-1]
            means = mean_energies(run, some)
            kinetic += means[0]
            potential += means[1]
            counts += speed_counts(run, some, fastest)
            progress.update(len(some))
    blocks["species"] = (run.species - 1).astype("<u2").tobytes()
    blocks["palette"] = plt.get_cmap()(range(256), bytes=True)[:, :3].tobytes()
    facts = {
        "time": [significant(t) for t in run.time[frames]],
        "collisions": run.collisions_per_disk_at(run.time[frames]).round(4).tolist(),
        "lower": run.lower.tolist(),
        "edges": run.edges.tolist(),
        "periodic": run.periodic.tolist(),
        "obstacles": [[*map(float, o.centre), o.radius, o.inside] for o in run.obstacles],
        "walls": run.walls.tolist(),
        "species": species(run),
        "kinetic": kinetic,
        "potential": potential if run.gravity.any() else None,
        "speeds": {"top": significant(fastest), "bins": BINS, "counts": counts},
        "scales": {name: [LABELS[name], significant(top)] for name, top in tops.items()},
        "colour": colour,
        "traced": traced or ([0] if run.count == 1 else []),
    }
    return facts, blocks


def page(run: Run, facts: dict, blocks: dict) -> str:
    """The whole file."""
    title = str(run.parameter("run", "title", "")) or run.path.stem
    commit = run.provenance.get("git_commit", "unknown")
    known = json.dumps(facts, allow_nan=False).replace("<", "\\u003c")
    data = [f'<script type="application/json" id="film">{known}</script>']
    for name, block in blocks.items():
        text = base64.b64encode(block).decode()
        data.append(f'<script type="text/plain" id="{name}-data">{text}</script>')
    template = PAGE.read_text(encoding="utf-8")
    fillings = {
        "policy": policy(template),
        "title": html.escape(title),
        "caption": html.escape(caption([run])),
        "warning": html.escape(run.shortcoming),
        "source": html.escape(f"{run.path.name} (ricochet {commit})"),
        "data": "\n".join(data),
    }
    blank = re.compile("{{(" + "|".join(fillings) + ")}}")
    return blank.sub(lambda found: fillings[found[1]], template)


def policy(template: str) -> str:
    """What the page may do: run its own script in its own style, and load nothing."""
    rules = ["default-src 'none'", "base-uri 'none'", "form-action 'none'"]
    for tag in ("script", "style"):
        (own,) = re.findall(f"<{tag}>(.*?)</{tag}>", template, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(own.encode()).digest()).decode()
        rules.append(f"{tag}-src 'sha256-{digest}'")
    return "; ".join(rules)


def main() -> None:
    parser = command_line(
        __doc__, "RUN.html", one=True, csv=False, frames=None, count=None, colour=None, disks=None
    )
    args = parser.parse_args()
    run = read_run(args.run)
    if args.colour == "psi6":
        raise RunError("--colour psi6 is for snapshot.py and animate.py")
    path = args.output or Path(run.path.name).with_suffix(".html")
    if path.suffix != ".html":
        raise RunError(f"{path}: a player ends in .html")
    args.count = args.count or frames_that_fit(run)
    frames, traced = film_frames(run, args), chosen_disks(run, args.disks or [])
    text = page(run, *film(run, frames, chosen_colour(run, args.colour), traced))
    destination(path).write_text(text, encoding="utf-8")
    size = len(text) / 1e6
    rows = [{"player": path, "frames": len(frames), "of": run.frames, "MB": size}]
    report(args, [run], "Player", None, rows)


if __name__ == "__main__":
    launch(main)
