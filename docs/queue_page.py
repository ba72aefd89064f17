"""Print the event queues shown in docs/tutorials/how-it-works.md, and draw them with the disks.

    python docs/queue_page.py build/tests/four_disks                   the queues
    python docs/queue_page.py build/tests/four_disks docs/tutorials/queue.png    and the figure

The queues come from the program docs/four_disks.f90, built by `make test`, which simulates four
disks event by event.
"""

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Circle, Rectangle
from ricochet.figures.drawing import COLOURS, STYLE, WALL

SIDES = ("left", "right", "bottom", "top")
BOX, RADIUS = 4.0, 0.3


@dataclass(frozen=True)
class Expected:
    """State of a disk after its last event, and its predicted next event."""

    disk: int
    place: np.ndarray
    velocity: np.ndarray
    clock: float
    kind: str
    partner: int
    stale: bool
    due: float

    def at(self, time: float) -> np.ndarray:
        return self.place + self.velocity * (time - self.clock)

    @property
    def what(self) -> str:
        """Return a description of the predicted event."""
        if self.kind == "side":
            return f"hits the {SIDES[-self.partner]}"
        return "leaves its cell" if self.kind == "crossing" else f"hits disk {self.partner}"


def expected(record: dict) -> Expected:
    return Expected(
        disk=record["id"],
        place=np.array([record["x"], record["y"]]),
        velocity=np.array([record["vx"], record["vy"]]),
        clock=record["clock"],
        kind=record["kind"],
        partner=record["partner"],
        stale=record["stale"] == "T",
        due=record["due"],
    )


def states(program: Path) -> list[tuple[float, list[Expected]]]:
    """Return the time and the sorted event queue at the start and after each event."""
    text = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    found, decoder = [], json.JSONDecoder()
    while text := text.lstrip():
        state, end = decoder.raw_decode(text)
        queue = sorted(map(expected, state["disks"]), key=lambda event: event.due)
        found.append((state["now"], queue))
        text = text[end:]
    return found


def table(now: float, queue: list[Expected]) -> str:
    """Return the event queue as a table in the format of the page."""
    lines = [f"t = {now:.4f}", "   due   disk"]
    for event in queue:
        stale = f"   stale: disk {event.partner} has collided since" if event.stale else ""
        lines.append(f"{event.due:.4f}   {event.disk}   {event.what}{stale}")
    return "\n".join(lines)


def draw(axes: plt.Axes, now: float, queue: list[Expected]) -> None:
    """Draw the disks, their velocities, and the next event.

    Each disk involved in the next event is drawn with a line to its position at the event, and with
    its outline there.
    """
    first, disks = queue[0], {event.disk: event for event in queue}
    axes.add_patch(Rectangle((0, 0), BOX, BOX, fill=False, clip_on=False, **WALL))
    for line in axes.axvline, axes.axhline:
        line(BOX / 2, color="0.85", lw=1, zorder=0)
    for number, own in disks.items():
        colour, place = COLOURS[number - 1], own.at(now)
        axes.add_patch(Circle(place, RADIUS, color=colour, lw=0, alpha=0.9))
        axes.text(*place, number, color="white", ha="center", va="center", weight="bold")
        rim = place + RADIUS * own.velocity / np.hypot(*own.velocity)
        arrow = {"arrowstyle": "-|>", "color": "0.2", "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", rim + 0.6 * own.velocity, rim, arrowprops=arrow, annotation_clip=False)
    concerned = [first.disk] + [first.partner] * (first.kind == "disk")
    for number in concerned:
        place = disks[number].at(first.due)
        axes.add_patch(Circle(place, RADIUS, fill=False, ec=COLOURS[number - 1], ls="--", lw=1.2))
        axes.plot(*np.transpose([disks[number].at(now), place]), color=COLOURS[number - 1], lw=1)
    stale = " (stale)" if first.stale else ""
    axes.set_title(
        f"t = {now:.3f};  next, at {first.due:.3f}:\ndisk {first.disk} {first.what}{stale}"
    )
    axes.set(aspect="equal", xlim=(0, BOX), ylim=(0, BOX), xticks=[0, 2, 4], yticks=[0, 2, 4])
    axes.spines[:].set_visible(False)


def main() -> None:
    if len(sys.argv) not in (2, 3):
        raise SystemExit(__doc__)
    found = states(Path(sys.argv[1]))
    print("\n\n".join(table(*state) for state in found))
    if len(sys.argv) == 3:
        plt.style.use(STYLE)
        figure, axes = plt.subplots(2, 3, figsize=(9, 6.8), sharex=True, sharey=True)
        for panel, state in zip(axes.flat, found, strict=False):
            draw(panel, *state)
        figure.savefig(sys.argv[2], dpi=110)


if __name__ == "__main__":
    main()
