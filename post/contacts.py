"""Contact network and force chains of a run, from the collisions in a window of time.

    python post/contacts.py runs/hopper.h5 --from 3.5 --until 4 -o contacts.png --csv contacts.csv

The run needs an event log (output.event_log = .true.).  Each line connects two disks that collided
in the window of time; the disks are drawn at their positions in the frame that is nearest to the
middle of the window.  The width of a line is proportional to the mean force between the two disks,
which is the sum of the impulses divided by the length of the window.  A line from the centre of a
disk to the edge of the disk shows its contact with a side or an obstacle.  A contact of two disks
is called strong if its impulse is larger than the mean impulse times the value of --above.  Disks
that are connected by strong contacts form a force chain; red lines show the chains of at least
--at-least disks.  The second panel shows the distribution of the forces between disks, in units of
the mean force.  By default, the window of time is the last tenth of the run.  The option --contacts
FILE writes a table with a row for each contact, which contains the ids of the disks, the number of
collisions, the impulse, the force, and the change of momentum.
"""

import csv
from pathlib import Path

from ricochet import Run, contacts, drawing
from ricochet.figures.drawing import plt
from ricochet.reading.files import destination
from ricochet.script import command_line, launch, report

import numpy as np
from matplotlib.collections import LineCollection

WIDEST = 5.0  # width of the line of the contact at the quantile TOP [points]
TOP = 0.995
COLUMNS = ("i", "j", "contacts", "impulse", "force")


def lines_of(run: Run, frame: int, found: contacts.ContactNetwork) -> np.ndarray:
    """Return a line (E, 2, 2) for each contact, from disk i to the nearest image of disk j.

    For a contact with a boundary, the line leads from the centre of the disk to the edge of the
    disk.
    """
    place, start = run.position[frame], found.i - 1
    to_boundary = -found.momentum / np.maximum(np.hypot(*found.momentum.T), 1e-300)[:, None]
    apart = to_boundary * run.radius[start][:, None]
    pairs = found.pairs
    bond = place[found.j[pairs] - 1] - place[start[pairs]]
    apart[pairs] = bond - np.where(run.periodic, np.round(bond / run.edges), 0) * run.edges
    return np.stack([place[start], place[start] + apart], axis=1)


def draw_network(
    axes: plt.Axes, run: Run, frame: int, found: contacts.ContactNetwork, chained: np.ndarray
) -> None:
    """Draw the disks of a frame, and a line for each contact."""
    drawing.draw_box(axes, run, run.time[frame])
    style = {"facecolors": ["0.9"] * run.n_disks, "edgecolors": "0.75"}
    drawing.disk_collection(axes, run, run.position[frame], **style)
    lines, top = lines_of(run, frame, found), np.quantile(found.force, TOP)
    widths = WIDEST * np.minimum(found.force / top, 1)
    for some, colour in ((~chained, "0.35"), (chained, "firebrick")):
        images = [(0, 0)]
        for axis in np.flatnonzero(run.periodic):
            shift = np.where(np.arange(2) == axis, run.edges, 0)
            images += [tuple(np.add(one, way * shift)) for one in images for way in (-1, 1)]
        ends, wide = lines[some], widths[some]
        shown, own = [], []
        for image in images:
            moved = ends + image
            inside = np.any(np.all((moved >= run.lower) & (moved <= run.upper), axis=2), axis=1)
            shown.append(moved[inside])
            own.append(wide[inside])
        style = {"linewidths": np.concatenate(own), "color": colour, "capstyle": "round"}
        axes.add_collection(LineCollection(np.concatenate(shown), zorder=3, **style))


def draw_forces(axes: plt.Axes, force: np.ndarray) -> None:
    """Draw the distribution of the forces of two disks, in units of the mean force."""
    ratio = force / force.mean()
    bins = np.linspace(0, min(ratio.max(), 10) * (1 + 1e-9), 31)
    density, _ = np.histogram(ratio, bins)
    density = density / (len(ratio) * np.diff(bins))
    seen = density > 0
    axes.semilogy((bins[1:] + bins[:-1])[seen] / 2, density[seen], "o", ms=4)
    axes.semilogy(bins, np.exp(-bins), "k--", lw=1, label="exponential distribution")
    axes.set(xlabel="force / mean force", ylabel="probability density")
    axes.set_ylim(density[seen].min() / 2, None)
    axes.legend()


def main() -> None:
    parser = command_line(__doc__, "contacts.png", one=True)
    parser.add_argument(
        "--from", type=float, dest="start", help="start of the window of time [0.9 times the end]"
    )
    parser.add_argument("--until", type=float, help="end of the window of time [end of the run]")
    parser.add_argument(
        "--above",
        type=float,
        default=1.0,
        help="smallest impulse of a strong contact, divided by the mean impulse [1]",
    )
    parser.add_argument(
        "--at-least", type=int, default=3, help="smallest number of disks of a chain [3]"
    )
    parser.add_argument(
        "--contacts", type=Path, metavar="FILE", help="CSV file for a table of all contacts"
    )
    args = parser.parse_args()
    (run,) = args.runs
    until = float(run.time[-1]) if args.until is None else args.until
    start = 0.9 * until if args.start is None else args.start
    found = contacts.network(run, start, until)
    chains = contacts.chains(found, args.above, args.at_least)
    strong = contacts.strong_contacts(found, args.above)
    linked = np.isin(found.i, np.concatenate([*chains, np.zeros(0, dtype=int)]))
    frame = int(np.abs(run.time - (start + until) / 2).argmin())
    aspect = drawing.aspect_of(run)
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(10.5, 1.2 + 5 * min(max(aspect, 0.7), 1.8)), width_ratios=(1, 1)
    )
    if len(found.i):
        draw_network(left, run, frame, found, strong & linked)
    if found.pairs.any():
        draw_forces(right, found.force[found.pairs])
    left.set_title(f"contacts from t = {start:.4g} to {until:.4g}, disks at {run.time[frame]:.4g}")
    figure.suptitle(drawing.caption([run]))
    if args.contacts:
        with destination(args.contacts).open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow([*COLUMNS, "momentum_x", "momentum_y"])
            columns = [getattr(found, name).tolist() for name in COLUMNS]
            rows.writerows(zip(*columns, *found.momentum.T.tolist(), strict=True))
    pairs = found.pairs
    row = {"start": start, "end": until, "pairs": int(pairs.sum())}
    row |= {"collisions_per_pair": float(found.contacts[pairs].mean()) if pairs.any() else 0.0}
    row |= {"mean_force": float(found.force[pairs].mean()) if pairs.any() else 0.0}
    row |= {"strong": int(strong.sum()), "chains": len(chains)}
    report(args, figure, [row | {"largest_chain": len(chains[0]) if chains else 0}])


if __name__ == "__main__":
    launch(main)
