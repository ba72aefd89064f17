"""What driven disks do in time, beside pictures of them.

    python post/driven.py runs/heated/*.h5 -o heated.png --csv heated.csv
    python post/driven.py runs/demon/*.h5 --show share -o demon.png

--show temperature: of all disks, m <(v - u)^2> / 2.  Dashed, for equal disks that noise heats in a
periodic box: where heating and collisions balance (van Noije and Ernst 1998).
--show share: of the disks in the left half of the box.  Dashed, for a dilute gas on a sawtooth
floor, between halves with a hole above the floor: the shares that last (after Eggers 1999).
--show height: of the disks of each species, on average.
--show cluster: share of the disks in the largest cluster, in which gaps are below a tenth of the
mean diameter.

A curve for each run, of means over a sixtieth of the time; a colour for each input and species.
Printed: the mean over the second half of the time, of `share` in the fuller half of the box, its
error over runs of one input, and its ratio to the theory.  Pictures: the end of the first run of
each input, or of a single input its start and its end.
"""

from collections.abc import Callable
from typing import NamedTuple

from ricochet import Run, RunError, hard_disks, theory
from ricochet.drawing import (
    caption,
    colours,
    disk_collection,
    draw_box,
    numbers_of,
    plt,
    species_colours,
    species_legend,
)
from ricochet.script import command_line, launch, measured, one_of, read_all, report
from ricochet.statistics import Estimate, estimate, windows
from ricochet.structure import largest_cluster
from ricochet.thermodynamics import equal_disks, packing

import numpy as np

GAP = 0.1  # of a cluster, in mean diameters
MOST_PICTURES = 3
POINTS = 60  # of a curve
HEIGHT = 4.5  # of a picture in inches
Curves = dict[str, tuple[np.ndarray, np.ndarray]]  # time and value by species, '' for all of them


class Quantity(NamedTuple):
    """What a figure shows."""

    label: str
    curves: Callable[[Run], Curves]
    law: Callable[[Run], float | None]  # what `late` should be; None where no law is known
    late: Callable[[float], float] = float  # what is compared, from the mean of a curve


def temperature(run: Run) -> Curves:
    """At the observables."""
    return {"": run.observable("all/temperature")}


def noise_law(run: Run) -> float | None:
    """The temperature at which noise and collisions balance."""
    drive = run.parameters.get("drive", {})
    alone = run.periodic.all() and not run.obstacles and not run.shear_rate
    smooth = "angular_velocity" not in run.elements and run.restitution < 1
    if not (alone and smooth and equal_disks(run)) or drive.get("species"):
        return None
    if drive.get("kind") != "noise":
        return None
    gas = packing(run), 2 * run.radius[0], run.mass[0]
    return hard_disks.noise_temperature(float(drive["strength"]), run.restitution, *gas)


def share(run: Run) -> Curves:
    """Of the disks in the left half, at the frames."""
    middle = run.lower[0] + run.edges[0] / 2
    return {"": (run.time, np.mean(run.position[:][..., 0] < middle, axis=1))}


def fuller(mean: float) -> float:
    """The share in the half that has more."""
    return max(mean, 1 - mean)


def demon_law(run: Run) -> float | None:
    """The share in the fuller half that lasts; a wall from the floor up parts the halves."""
    floor = run.parameters.get("side", {}).get("bottom", {})
    middle = run.lower[0] + run.edges[0] / 2
    parting = [wall for wall in run.walls if np.allclose(wall[:, 0], middle)]
    heights = [w[:, 1].max() for w in parting if np.isclose(w[:, 1].min(), run.lower[1])]
    across, down = run.gravity
    alike = equal_disks(run) and np.isfinite(run.restitution)
    if floor.get("motion") != "sawtooth" or not heights or across != 0 or not alike:
        return None
    hole, diameter = float(heights[0] - run.lower[1]), 2 * run.radius[0]
    layers = run.count * diameter / (run.edges[0] / 2 - diameter)
    climb = max(0.0, -down) * hole / float(floor["velocity"]) ** 2
    return theory.demon_share(climb, layers, run.restitution)


def height(run: Run) -> Curves:
    """Mean height above the floor of each species, at the frames."""
    y = run.position[:][..., 1] - run.lower[1]
    several = len(run.names) > 1
    return {
        kind.name * several: (run.time, y[:, kind.disks].mean(axis=1)) for kind in run.by_species
    }


def cluster(run: Run) -> Curves:
    """Share of the disks in the largest cluster, at the frames."""
    gap = GAP * 2 * float(run.radius.mean())
    shares = [largest_cluster(run, frame, gap) / run.count for frame in range(run.frames)]
    return {"": (run.time, np.array(shares))}


def no_law(_: Run) -> None:
    """Nothing is known."""


QUANTITIES = {
    "temperature": Quantity("T (reduced units)", temperature, noise_law),
    "share": Quantity("share of the disks in the left half", share, demon_law, fuller),
    "height": Quantity("mean height (reduced units)", height, no_law),
    "cluster": Quantity("share of the disks in the largest cluster", cluster, no_law),
}


def by_input(runs: list[Run]) -> dict[str, list[Run]]:
    """Runs that differ by their seed alone together, under what sets them apart from the others."""
    own = [{"N": run.count, "ξ": run.restitution, **numbers_of(run)} for run in runs]
    names = [name for name in own[0] if len({numbers.get(name) for numbers in own}) > 1]
    groups: dict[str, list[Run]] = {}
    for run, numbers in zip(runs, own, strict=True):
        label = ", ".join(f"{name} = {numbers[name]:g}" for name in names if name in numbers)
        groups.setdefault(label, []).append(run)
    return groups


def late_mean(time: np.ndarray, value: np.ndarray) -> float:
    """Over the second half of the time."""
    return float(np.mean(value[time >= (time[0] + time[-1]) / 2]))


def labelled(groups: dict[str, list[Run]], shown: Quantity) -> dict[tuple[str, str], list]:
    """(time, value) of each run, by input and species."""
    found: dict[tuple[str, str], list] = {}
    for name, runs in groups.items():
        for run in runs:
            for species, curve in shown.curves(run).items():
                found.setdefault((name, species), []).append(curve)
    return found


def draw_curves(axes: plt.Axes, tracks: dict[tuple[str, str], list], laws: dict) -> None:
    """Solid what was measured, dashed what should last."""
    for (key, curves), colour in zip(tracks.items(), colours(len(tracks)), strict=True):
        label = ", ".join(filter(None, key)) or "measured"
        for k, (time, value) in enumerate(curves):
            means = windows(time, value, (time[-1] - time[0]) / POINTS)
            axes.plot(*means, color=colour, lw=1, label=label if k == 0 else None)
        for level in laws[key[0]]:
            axes.axhline(level, color=colour, ls="--", lw=1.6)
    if any(laws.values()):
        axes.plot([], [], color="black", ls="--", label="theory")
    axes.set(xlabel="time (reduced units)", xlim=(0, None), ylim=(0, None))
    axes.legend()


def draw(groups: dict[str, list[Run]], shown: Quantity, tracks: dict) -> plt.Figure:
    """The curves, and pictures."""
    first = {name: runs[0] for name, runs in groups.items()}
    pictures = [(run, -1, name) for name, run in first.items()][:MOST_PICTURES]
    if len(first) == 1:
        pictures = [(run, frame, "") for run in first.values() for frame in (0, -1)]
    run = next(iter(first.values()))
    width = HEIGHT * min(1.0, run.edges[0] / run.edges[1])
    figure, (axes, *panels) = plt.subplots(
        1,
        1 + len(pictures),
        figsize=(1.5 * HEIGHT + width * len(pictures) + 1, HEIGHT + 1),
        width_ratios=[1.5 * HEIGHT, *[width] * len(pictures)],
    )
    laws = {}
    for name, one in first.items():
        law = shown.law(one)
        laws[name] = set() if law is None else {law, 1 - law} if shown.late is fuller else {law}
    draw_curves(axes, tracks, laws)
    axes.set_ylabel(shown.label)
    for panel, (run, frame, name) in zip(panels, pictures, strict=True):
        draw_box(panel, run)
        disk_collection(panel, run, run.position[frame], facecolors=species_colours(run))
        panel.set_title("\n".join(filter(None, (name, f"t = {run.time[frame]:.4g}"))))
    if not any(species for _, species in tracks):  # else the curves name them, in their colours
        species_legend(figure, run)
    title = str(run.parameter("run", "title", ""))
    everything = [run for runs in groups.values() for run in runs]
    figure.suptitle("\n".join(filter(None, (title, caption(everything)))), fontsize=10)
    return figure


def table(groups: dict[str, list[Run]], shown: Quantity, tracks: dict) -> list[dict]:
    """A row for each input and species: the mean of the second half, and what it should be."""
    rows = []
    for (name, species), curves in tracks.items():
        late = estimate([shown.late(late_mean(*curve)) for curve in curves])
        law = shown.law(groups[name][0])
        row = {"input": name or None, "species": species or None, "runs": len(curves)}
        row |= {**measured("late", late), "theory": law}
        rows.append(row | measured("ratio", law and Estimate(late.mean / law, late.error / law)))
    return rows


def main() -> None:
    parser = command_line(__doc__, "driven.png")
    known = one_of(*QUANTITIES)
    choices = ", ".join(QUANTITIES)
    parser.add_argument(
        "--show", type=known, default="temperature", metavar="WHAT", help=f"{choices} [temperature]"
    )
    args = parser.parse_args()
    runs = read_all(args.runs)
    for run in runs:
        if run.frames < 2 or not run.time[-1] > run.time[0]:
            raise RunError(f"{run.path}: has one frame; it takes two")
    groups, shown = by_input(runs), QUANTITIES[args.show]
    tracks = labelled(groups, shown)
    rows = table(groups, shown, tracks)
    report(args, runs, f"Driven disks: {args.show}", draw(groups, shown, tracks), rows)


if __name__ == "__main__":
    launch(main)
