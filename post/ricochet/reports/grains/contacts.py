"""Contact network and force chains of a run, from the collisions in a time window."""

import csv
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from matplotlib.collections import LineCollection

from ...figures import drawing
from ...figures.drawing import plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...reading import contacts
from ...reading.contacts import ContactNetwork
from ...reading.files import destination
from ...reading.reader import Run
from ..groups import Group
from ..options import Option
from ..registry import Analysis
from ..result import Result

WIDEST = 5.0  # width of the line of a contact whose impulse is at the quantile TOP [points]
TOP = 0.995
COLUMNS = ("i", "j", "contacts", "impulse", "force")


class Found(NamedTuple):
    """Contacts in a time window, a mask of the contacts in chains, and the frame to draw."""

    network: ContactNetwork
    chained: np.ndarray
    frame: int


def lines_of(run: Run, frame: int, found: ContactNetwork) -> np.ndarray:
    """Return a line (E, 2, 2) for each contact, from disk i to the nearest image of disk j.

    The line of a contact with a boundary ends at the rim of the disk.
    """
    place, start = run.position[frame], found.i - 1
    to_boundary = -found.momentum / np.maximum(np.hypot(*found.momentum.T), 1e-300)[:, None]
    apart = to_boundary * run.radius[start][:, None]
    pairs = found.pairs
    bond = place[found.j[pairs] - 1] - place[start[pairs]]
    apart[pairs] = bond - np.where(run.periodic, np.round(bond / run.edges), 0) * run.edges
    return np.stack([place[start], place[start] + apart], axis=1)


def draw_network(axes: plt.Axes, result: Result) -> None:
    """Draw the disks in a frame, with a line for each contact."""
    (run,), (found, chained, frame) = result.runs, result.values
    drawing.draw_box(axes, run, run.time[frame])
    axes.set_title(f"disks at t = {run.time[frame]:.4g}")
    style = {"facecolors": ["0.9"] * run.n_disks, "edgecolors": "0.75"}
    drawing.disk_collection(axes, run, run.position[frame], **style)
    if not len(found.i):
        return
    lines, top = lines_of(run, frame, found), np.quantile(found.force, TOP)
    widths = WIDEST * np.minimum(found.force / top, 1)
    steps = [(0, -1, 1) if periodic else (0,) for periodic in run.periodic]
    for some, colour in ((~chained, "0.35"), (chained, "firebrick")):
        shown, own = [], []
        for image in product(*steps):
            moved = lines[some] + np.array(image) * run.edges
            inside = np.any(np.all((moved >= run.lower) & (moved <= run.upper), axis=2), axis=1)
            shown.append(moved[inside])
            own.append(widths[some][inside])
        style = {"linewidths": np.concatenate(own), "color": colour, "capstyle": "round"}
        axes.add_collection(LineCollection(np.concatenate(shown), zorder=3, **style))


def draw_forces(axes: plt.Axes, result: Result) -> None:
    """Plot the distribution of the disk-disk contact forces, in units of their mean."""
    found = result.values.network
    axes.set(xlabel="force / mean force", ylabel="probability density")
    if not found.pairs.any():
        return
    force = found.force[found.pairs]
    ratio = force / force.mean()
    bins = np.linspace(0, min(ratio.max(), 10) * (1 + 1e-9), 31)
    count, _ = np.histogram(ratio, bins)
    seen, density = count > 0, count / (len(ratio) * np.diff(bins))
    axes.semilogy((bins[1:] + bins[:-1])[seen] / 2, density[seen], "o", ms=4, label="contacts")
    axes.semilogy(bins, np.exp(-bins), "k--", lw=1, label="exponential distribution")
    axes.set_ylim(density[seen].min() / 2, None)
    legend_above(axes)


def draw(result: Result) -> Sheet:
    """Draw the network, and plot the distribution of the forces."""
    (run,), row = result.runs, result.table[0]
    aspect = min(max(drawing.aspect_of(run), 0.8), 1.8)
    network = Panel("network", draw_network, (result,), aspect)
    forces = Panel("forces", draw_forces, (result,), aspect)
    window = f"contacts from t = {row['start']:.4g} to {row['end']:.4g}"
    return Sheet([[network, forces]], f"{drawing.caption([run])}\n{window}")


def write_contacts(path: Path, found: ContactNetwork) -> None:
    """Write a table of all contacts."""
    with destination(path).open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow([*COLUMNS, "momentum_x", "momentum_y"])
        columns = [getattr(found, name).tolist() for name in COLUMNS]
        rows.writerows(zip(*columns, *found.momentum.T.tolist(), strict=True))


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Return the numbers of contacts and chains."""
    (run,) = groups[0].runs
    until = float(run.time[-1]) if options.until is None else options.until
    start = 0.9 * until if options.start is None else options.start
    found = contacts.network(run, start, until)
    chains = contacts.chains(found, options.above, options.at_least)
    strong = contacts.strong_contacts(found, options.above)
    linked = np.isin(found.i, np.concatenate([*chains, np.zeros(0, dtype=int)]))
    if options.contacts:
        write_contacts(options.contacts, found)
    pairs = found.pairs
    row = {"start": start, "end": until, "pairs": int(pairs.sum())}
    row |= {"collisions_per_pair": float(found.contacts[pairs].mean()) if pairs.any() else 0.0}
    row |= {"mean_force": float(found.force[pairs].mean()) if pairs.any() else 0.0}
    row |= {"strong": int(strong.sum()), "chains": len(chains)}
    row |= {"largest_chain": len(chains[0]) if chains else 0}
    notes = ["Width of a line: mean force of the contact. Red: force chains."]
    frame = int(np.abs(run.time - (start + until) / 2).argmin())
    return Result([row], notes=notes, values=Found(found, strong & linked, frame))


ANALYSIS = Analysis(
    compute,
    draw,
    options=(
        Option("start", "start of the window [0.9 times the end]", None, float, "T", flag="--from"),
        Option("until", "end of the window [end of the run]", None, float, "T"),
        Option("above", "least impulse of a strong contact, over the mean [1]", 1.0, float, "X"),
        Option("at_least", "smallest number of disks of a chain [3]", 3, int, "N"),
        Option("contacts", "CSV file for a table of all contacts", None, Path, "FILE"),
    ),
    single=True,
)
