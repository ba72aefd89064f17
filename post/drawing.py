"""What the scripts share: the command line, disks of true size, saving a figure and a table."""

import argparse
import csv
import re
import sys
from collections.abc import Callable, Iterable
from itertools import groupby
from pathlib import Path
from typing import NoReturn

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.patches import Circle, Rectangle

from read_run import Run, RunError, did_you_mean, read_run

plt.style.use(Path(__file__).with_name("ricochet.mplstyle"))

COLOURS = plt.rcParams["axes.prop_cycle"].by_key()["color"]
WALL = {"color": "0.25", "linewidth": 1.2}


class Parser(argparse.ArgumentParser):
    """Answers a wrong option or choice with the right one."""

    def error(self, message: str) -> NoReturn:
        words = [*self._option_string_actions, *re.findall(r"'([^']*)'", message)[1:]]
        for wrong in re.findall(r"unrecognized arguments: (-[^\s=]+)|choice: '([^']*)'", message):
            message += did_you_mean("".join(wrong), words)
        super().error(message)


def command_line(
    doc: str, output: str, one: bool = False, table: bool = False
) -> argparse.ArgumentParser:
    """A parser whose help is the script's docstring; `one` run or any number, --csv or not."""
    parser = Parser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    if one:
        parser.add_argument("run", metavar="RUN.h5", help="file written by ricochet")
    else:
        parser.add_argument("runs", nargs="+", metavar="RUN.h5", help="files written by ricochet")
    parser.add_argument("-o", "--output", default=output, type=Path, help=f"[{output}]")
    if table:
        parser.add_argument("--csv", type=Path, help="write the numbers behind the figure")
    return parser


def whole_numbers(text: str) -> list[int]:
    """A list such as '0,10,-1' on the command line."""
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is no list such as 1,5,9") from None


def positive(text: str) -> int:
    """A number of things on the command line."""
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"'{text}' is no whole number above 0")
    return int(text)


def launch(main: Callable[[], None]) -> None:
    """Run a script: a file that cannot be used is one line on stderr and exit code 2.

    So are numbers of which the script can make no sense; `python -X dev` shows where.
    """
    name = Path(sys.argv[0]).name
    try:
        main()
    except RunError as problem:
        give_up(name, str(problem))
    except OSError as problem:  # without a name: while writing, on a full disk
        give_up(name, f"{problem.filename or 'cannot write the output'}: {problem.strerror}")
    except (ArithmeticError, LookupError, MemoryError, TypeError, ValueError) as problem:
        if sys.flags.dev_mode:
            raise
        give_up(name, f"cannot make sense of {' '.join(sys.argv[1:])}: {problem!r}")
    except KeyboardInterrupt:
        print(f"{name}: interrupted", file=sys.stderr)
        sys.exit(130)


def give_up(name: str, reason: str) -> None:
    """Exit code 2 and one line."""
    print(f"{name}: {' '.join(reason.split())}", file=sys.stderr)
    sys.exit(2)


def read_all(paths: Iterable[str]) -> list[Run]:
    """The runs in the order given."""
    return [read_run(path) for path in paths]


def grouped(runs: Iterable[Run], key: Callable[[Run], float]) -> list[tuple[float, list[Run]]]:
    """Runs put together by a number, in ascending order."""
    ordered = sorted(runs, key=key)
    return [(value, list(group)) for value, group in groupby(ordered, key=key)]


def caption(runs: list[Run]) -> str:
    """What a reader must know: number of disks, restitution, seeds."""
    counts = sorted({run.count for run in runs})
    parts = [f"N = {', '.join(map(str, counts))}"]
    restitutions = sorted({run.restitution for run in runs})
    if all(np.isfinite(restitutions)):
        parts.append(f"ξ = {', '.join(f'{x:g}' for x in restitutions)}")
    seeds = sorted({run.seed for run in runs})
    parts.append(f"seed {seeds[0]}" if len(seeds) == 1 else f"{len(seeds)} seeds")
    return ",  ".join(parts)


def species_label(run: Run, name: str) -> str:
    """The name and the mass of a species."""
    return f"{name}, m = {run.mass[run.of_species(name)][0]:g}"


def draw_box(axes: plt.Axes, run: Run) -> None:
    """Walls solid, periodic sides dashed, obstacles grey; equal scales, ticks at the corners."""
    (x0, y0), (x1, y1) = run.lower, run.upper
    for axis, (xs, ys) in (
        (0, ((x0, x0), (y0, y1))),
        (0, ((x1, x1), (y0, y1))),
        (1, ((x0, x1), (y0, y0))),
        (1, ((x0, x1), (y1, y1))),
    ):
        axes.plot(xs, ys, ls="--" if run.periodic[axis] else "-", clip_on=False, zorder=3, **WALL)
    for obstacle in run.obstacles:
        if obstacle.inside:
            axes.add_patch(Rectangle(run.lower, *run.edges, facecolor="0.85", zorder=0))
        fill = "white" if obstacle.inside else "0.75"
        for centre in images(run, obstacle.centre):
            axes.add_patch(
                Circle(centre, obstacle.radius, facecolor=fill, edgecolor="0.25", zorder=0.5)
            )
    axes.set(aspect="equal", xlim=(x0, x1), ylim=(y0, y1))
    axes.set_xticks([x0, x1], [f"{x0:g}", f"{x1:g}"])
    axes.set_yticks([y0, y1], [f"{y0:g}", f"{y1:g}"])
    axes.set_xlabel("x", labelpad=-8)
    axes.set_ylabel("y", labelpad=-8)
    axes.tick_params(length=3)
    axes.label_outer()
    axes.spines[:].set_visible(False)


def images(run: Run, point: np.ndarray) -> np.ndarray:
    """(M, 2) the point and its periodic copies beside the box."""
    shifts = [(-1, 0, 1) if periodic else (0,) for periodic in run.periodic]
    return np.array([point + run.edges * (i, j) for i in shifts[0] for j in shifts[1]])


def disk_collection(axes: plt.Axes, run: Run, position: np.ndarray, **style) -> EllipseCollection:
    """Disks of true size at `position` (N, 2); `array=` colours them by value."""
    diameter = 2 * run.radius
    style = {"linewidths": 0, **style}
    collection = EllipseCollection(
        diameter,
        diameter,
        np.zeros(run.count),
        units="xy",
        offsets=position,
        offset_transform=axes.transData,
        **style,
    )
    axes.add_collection(collection)
    return collection


def band(axes: plt.Axes, x: np.ndarray, y: np.ndarray, error: np.ndarray, **style) -> None:
    """A line with its standard error."""
    axes.plot(x, y, **style)
    axes.fill_between(x, y - error, y + error, color=style["color"], alpha=0.25, lw=0)


def dilute_limit(axes: plt.Axes, points: np.ndarray, of: str = "") -> None:
    """Points (P, 2) of a solution of the Boltzmann equation as open circles."""
    label = f"{of}dilute limit (Boltzmann equation)"
    axes.plot(*points.T, ls="", marker="o", mfc="none", color="black", label=label)


def species_colours(run: Run) -> list[str]:
    """A colour for each disk."""
    return [COLOURS[(s - 1) % len(COLOURS)] for s in run.species]


def species_legend(figure: plt.Figure, run: Run) -> None:
    """Which colour is which species, below all panels; nothing for a single one."""
    handles = [
        plt.Line2D([], [], ls="", marker="o", color=COLOURS[k % len(COLOURS)])
        for k in range(len(run.names))
    ]
    if len(run.names) > 1:
        figure.legend(handles, run.names, loc="outside lower center", ncols=len(run.names))


def save(figure: plt.Figure, path: Path, runs: list[Run], title: str) -> None:
    """Write the figure with its source in the metadata; the folder is made."""
    sources = ", ".join(run.path.name for run in runs[:20]) + (", ..." if len(runs) > 20 else "")
    commits = sorted({str(run.provenance.get("git_commit", "unknown")) for run in runs})
    origin = f"{sources} (ricochet {', '.join(commits)})"
    keys = {
        ".pdf": {"Title": title, "Subject": origin},
        ".svg": {"Title": title, "Description": origin},
        ".png": {"Title": title, "Description": origin},
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix not in keys:
        raise RunError(f"{path}: a figure ends in {', '.join(keys)}")
    figure.savefig(path, metadata=keys[path.suffix])
    plt.close(figure)


def write_csv(path: Path, columns: dict[str, Iterable]) -> None:
    """A table with one header line; numbers keep all their digits."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))


def print_table(columns: dict[str, Iterable]) -> None:
    """The same for people: aligned, six digits."""
    rows = [
        [f"{v:.6g}" if isinstance(v, float) else str(v) for v in row]
        for row in zip(*columns.values(), strict=True)
    ]
    widths = [max(map(len, column)) for column in zip(columns, *rows, strict=True)]
    for row in (columns, *rows):
        print("  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)))
