"""Command-line options, reports and exit codes that are common to the scripts in post/.

Figures are drawn without a display; their style is defined in `style.mplstyle`.
"""

import argparse
import csv
import hashlib
import re
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import groupby, repeat
from pathlib import Path
from typing import NoReturn

import matplotlib
import numpy as np

from .analysis.estimates import Curve, Estimate
from .analysis.statistics import SeriesMean, combine_runs, diagnostics
from .analysis.equilibrium import SPEEDS_FORGET, frames_from, start_of_steady_state
from .analysis.thermodynamics import packing
from .figures.drawing import COLOURINGS, STYLE, plt, save, warn
from .reading.files import destination, did_you_mean
from .reading.nature import Refused
from .reading.reader import Restitution, Run, RunError, read_run
from .reading.units import UNNAMED, Units, units_of
from .running.ensembles import in_order, read_manifest

Table = dict[str, Iterable] | list[dict]  # columns by name, or a list of rows


# --- options ---


def frame_list(text: str) -> tuple[int | slice, ...]:
    """Convert a list of frame numbers and ranges, such as '0,10,-1' or '100:200', to indices."""

    def chosen(part: str) -> int | slice:
        if ":" not in part:
            return int(part)
        frames = slice(*(int(number) if number else None for number in part.split(":")))
        frames.indices(1)  # raises an error for a step of 0
        return frames

    try:
        return tuple(map(chosen, text.split(",")))
    except (TypeError, ValueError):
        problem = f"'{text}' is not a list of frames such as 0,10,-1 or 100:200 or ::5"
        raise argparse.ArgumentTypeError(problem) from None


def disk_list(text: str) -> list[int]:
    """Convert a text such as '1,5,9' to a list of disk numbers."""
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        problem = f"'{text}' is not a list of disks such as 1,5,9"
        raise argparse.ArgumentTypeError(problem) from None


def positive(text: str) -> int:
    """Convert a text to a positive integer."""
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number above 0")
    return int(text)


def not_negative(text: str) -> float:
    """Convert a text to a number that is not negative."""
    value = float(text)
    if not 0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of at least 0")
    return value


def unit_names(text: str) -> Units:
    """Convert a text such as 'length=cm,time=s' to names of units."""
    try:
        return units_of(text)
    except ValueError as problem:
        raise argparse.ArgumentTypeError(str(problem)) from None


#: Options of several scripts, each with name, conversion, symbol of the value, and help text.
OPTIONS = {
    "frames": (frame_list, "LIST", "frames to use, such as 0,10,-1 or 100:200 or ::5"),
    "count": (positive, "N", "largest number of frames, which are evenly spread"),
    "equilibration": (
        not_negative,
        "X",
        "equilibration: the first X collisions per disk are left out [until no observable drifts]",
    ),
    "min_separation": (float, "X", "smallest distance of two frames, in collisions per disk"),
    "wavenumber": (not_negative, "K", "wave number of F_s(k, t) times the mean diameter"),
    "disks": (disk_list, "IDS", "disks to show: numbers such as 1,5,9"),
    "colour": (str, "WHAT", f"species, {', '.join(COLOURINGS)} [species; speed if there is one]"),
}


#: Option names of earlier versions, each with the present name of the option.
RENAMED = {"--skip": "--equilibration", "--apart": "--min-separation", "--wave": "--wavenumber"}
#: Alternative spellings of option names.
SPELLINGS = {"colour": ["--color"]}


class Parser(argparse.ArgumentParser):
    """Command-line parser that suggests a similar option if an option is unknown."""

    def parse_args(self, args: Sequence[str] | None = None, namespace=None) -> argparse.Namespace:
        words = joined(sys.argv[1:] if args is None else args)
        known, unknown = self.parse_known_args(words, namespace)
        if unknown:
            word = unknown[0].split("=")[0]
            if RENAMED.get(word) in self._option_string_actions:
                self.error(f"{word} is called {RENAMED[word]} now")
            self.error(f"unknown argument {word}{did_you_mean(word, self._option_string_actions)}")
        if hasattr(known, "runs"):
            paths = known.runs if known.paired else finished(known.runs)
            known.runs = [replace(read_run(path), units=known.units) for path in paths]
            if len(known.runs) > 1 and not known.repeated:
                known.runs = distinct(known.runs)
        results = [getattr(known, name, None) for name in ("output", "csv")]
        if None not in results and results[0].resolve() == results[1].resolve():
            self.error(f"{known.csv} is the name of the figure, too: choose another for --csv")
        return known


def finished(paths: list[Path]) -> list[Path]:
    """Return the paths of finished runs, and print a warning about unfinished runs.

    If no run has finished, all paths are returned.  If all files of a sweep are given, member runs
    without an output file are also counted as unfinished.
    """
    whole = [path for path in paths if path.suffix != ".part"]
    if not whole:
        return paths
    missing = {path.with_suffix("").stem for path in paths if path.suffix == ".part"}
    for folder in {path.parent for path in whole}:
        there = {path.stem for path in folder.glob("*.h5")}
        if there <= {path.stem for path in whole if path.parent == folder}:
            missing |= read_manifest(folder).keys() - there
    if missing:
        names = ", ".join([*sorted(missing, key=in_order)[:10], *["..."] * (len(missing) > 10)])
        told = f"{len(whole)} of {len(whole) + len(missing)} runs; {len(missing)} unfinished"
        print(f"warning: {told}: {names}", file=sys.stderr)
    return whole


def distinct(runs: list[Run]) -> list[Run]:
    """Return the runs without duplicates, which are runs with identical final states."""
    found: dict[bytes, list[Run]] = {}
    for run in runs:
        parts = run.time[-1:], run.position[-1], run.velocity[-1], run.mass, run.radius
        ending = hashlib.blake2b(b"".join(part.tobytes() for part in parts))
        found.setdefault(ending.digest(), []).append(run)
    if twins := [str(run.path) for _, *others in found.values() for run in others]:
        print(f"warning: left out, the same as another run: {', '.join(twins)}", file=sys.stderr)
    return [same for same, *_ in found.values()]


def joined(words: Iterable[str]) -> list[str]:
    """Join each list such as '-10:' to the preceding option, as in '--frames=-10:'.

    If the list were a separate word, argparse would interpret the list as an option.
    """
    result: list[str] = []
    for word in words:
        if re.fullmatch(r"-\d+[,:][-\d,:]*", word) and result and result[-1].startswith("--"):
            result[-1] += f"={word}"
        else:
            result.append(word)
    return result


def command_line(
    doc: str, output: str, one: bool = False, csv: bool = True, repeated: bool = False, **defaults
) -> Parser:
    """Return a command-line parser, whose help text is the docstring `doc` of the script.

    The script accepts a single run if `one` is true, and any number of runs otherwise.  The
    argument `output` is the default name of the output file.  Duplicate runs are ignored unless
    `repeated` is true.  Unfinished runs are ignored, except in a script that sets the parser
    default `paired` to true.  If `csv` is true, the script has the option --csv.  Each further
    keyword argument names one of the `OPTIONS` and specifies its default.  The default None means
    that the option has no default value.  A default text describes what the script does without the
    option, where this differs from the help text in `OPTIONS`; the default value is None.
    """
    raw = argparse.RawDescriptionHelpFormatter
    parser = Parser(description=doc, formatter_class=raw, allow_abbrev=False)
    parser.set_defaults(title=doc.splitlines()[0], repeated=repeated, paired=False, notes=[])
    some = {"nargs": 1 if one else "+", "help": f"file{'s' * (not one)} written by ricochet"}
    parser.add_argument("runs", type=Path, metavar="RUN.h5", **some)
    place = {"default": None if output.startswith("RUN") else Path(output), "metavar": "FILE"}
    parser.add_argument("-o", "--output", type=Path, help=f"output file [{output}]", **place)
    if csv:
        parser.add_argument(
            "--csv",
            type=Path,
            metavar="FILE",
            help="file to which the numbers are written as a table",
        )
    names = "names of units for the axes, such as length=cm,time=s,mass=g [reduced units]"
    parser.add_argument("--units", type=unit_names, default=UNNAMED, metavar="NAMES", help=names)
    for name, default in defaults.items():
        convert, value, meaning = OPTIONS[name]
        names = [f"--{name.replace('_', '-')}", *SPELLINGS.get(name, [])]
        text = isinstance(default, str)
        if text:
            meaning = f"{meaning.partition(' [')[0]} [{default}]"
        elif default is not None:
            meaning += f" [{default:g}]"
        start = None if text else default
        parser.add_argument(*names, type=convert, default=start, metavar=value, help=meaning)
    return parser


def chosen_frames(run: Run, which: Sequence[int | slice] | None, count: int | None) -> list[int]:
    """Return the frame numbers that the options --frames and --count select.

    Without --frames, all frames are selected.  If `count` is smaller than the number of selected
    frames, only `count` evenly spread frames are returned.
    """
    frames: list[int] = []
    for part in which if which is not None else [slice(None)]:
        if isinstance(part, int) and not -run.n_frames <= part < run.n_frames:
            raise RunError(f"{run.path}: no frame {part}, there are {run.n_frames}")
        frames += np.atleast_1d(np.arange(run.n_frames)[part]).tolist()
    if not frames:
        raise RunError(f"{run.path}: no such frames, there are {run.n_frames}")
    if count is None or count >= len(frames):
        return frames
    return [frames[k] for k in np.linspace(0, len(frames) - 1, count).round().astype(int)]


def late_frames(run: Run, args: argparse.Namespace) -> list[int]:
    """Return the selected frames (--frames) that are in the steady state and far enough apart.

    If no frame of --frames is in the steady state, the last frame is returned.  The function adds a
    warning to `args.notes` if some requested frames are not used, or if the speeds in the first
    used frame may still depend on the initial speeds.
    """
    frames, start = (
        chosen_frames(run, args.frames, None),
        start_of_steady_state(run, args.equilibration),
    )
    used = frames_from(run, start, args.min_separation, frames)
    says = f"{run.path.name}: "
    if not used:
        used = [max(frames)]
        args.notes.append(
            f"{says}none of the frames is from t = {start:.4g} on; the last one is used"
        )
    elif args.frames is not None and len(used) < len(frames):
        some = f"takes {len(used)} of {len(frames)} frames, from t = {start:.4g} on and "
        args.notes.append(f"{says}{some}{args.min_separation:g} collisions per disk apart")
    tau = run.collisions_per_disk_at(run.time)[used[0]]
    if args.equilibration is None and tau < SPEEDS_FORGET * (1 - 1e-9):
        early = f"begins {tau:.3g} collisions per disk after the start, which speeds remember for "
        args.notes.append(f"{says}{early}{SPEEDS_FORGET:g}; run longer")
    return used


def chosen_disks(run: Run, ids: list[int]) -> list[int]:
    """Convert disk numbers, which begin with 1, to indices, which begin with 0."""
    for number in ids:
        if not 1 <= number <= run.n_disks:
            raise RunError(f"{run.path}: no disk {number}, there are {run.n_disks}")
    return [number - 1 for number in ids]


def recorded(run: Run, name: str) -> float:
    """Return a positive number from the `provenance` group of a finished run."""
    value = float(run.provenance.get(name, 0))
    if value <= 0:
        what = name.replace("_", " ")
        raise RunError(
            f"{run.path}: contains no {what}: the run is not finished, or this number was 0"
        )
    return value


def grouped(runs: Iterable[Run], key: Callable[[Run], float]) -> list[tuple[float, list[Run]]]:
    """Group the runs by the value of the function `key`, and sort the groups by this value."""
    ordered = sorted(runs, key=key)
    return [(value, list(group)) for value, group in groupby(ordered, key=key)]


def by_restitution(runs: Iterable[Run]) -> list[tuple[Restitution, list[Run]]]:
    """Group the runs by their coefficient of restitution and its dependence on velocity."""
    return grouped(runs, lambda run: run.contact_law)


def by_packing(runs: Iterable[Run]) -> list[tuple[float, list[Run]]]:
    """Group the runs by their packing fraction."""
    return grouped(runs, lambda run: round(packing(run), 6))


# --- printed tables, warnings and figures ---


def report(
    args: argparse.Namespace,
    figure: plt.Figure | None,
    *tables: Table,
    data: Table | None = None,
    notes: Sequence[str] = (),
) -> None:
    """Print the tables, save the figure, and write a table to the file of --csv.

    The file of --csv contains the table `data` or, if `data` is None, the first table.  The
    argument `notes` contains warnings about the numbers.  All warnings are written to stderr and on
    the figure, including warnings about runs that ended early.
    """
    if any(tables):
        print("\n\n".join(text_of(table) for table in tables if table), flush=True)
    notes = [
        *(run.termination_note for run in args.runs if run.termination_note),
        *args.notes,
        *notes,
    ]
    notes = once(notes, {run.path.name for run in args.runs})
    for note in [*notes, *without_error(tables)]:
        print(f"warning: {note}", file=sys.stderr)
    if figure is not None:
        warn(figure, notes)
        save(figure, args.output, args.runs, args.title)
        print(f"figure: {args.output}")
    if "csv" in args and args.csv:
        write_csv(args.csv, tables[0] if data is None else data)


def once(notes: Iterable[str], names: set[str]) -> list[str]:
    """Return the warnings without repetitions.

    If several warnings differ only in names of runs and in numbers, only the first warning and the
    number of such warnings are returned.
    """
    kinds: dict[str, list[str]] = {}
    for note in notes:
        name = re.match(r".*?\.h5(\.part)?(?=[: ])", note)
        known = name and Path(name[0]).name in names
        kind = re.sub(r"-?\d[\d.]*(e[-+]\d+)?", "", note[name.end() :]) if known else note
        kinds.setdefault(kind, []).append(note)
    return [one + f" ({len(more) + 1} such)" * bool(more) for one, *more in kinds.values()]


def measured(
    name: str, estimate: Estimate | SeriesMean | None, at: int | tuple = ()
) -> dict[str, float | None]:
    """Return two cells of a table row: the mean and the error of an estimate.

    If the estimate is a curve, `at` is the index of a point of the curve.  If the estimate is None,
    the mean and the error are None.
    """
    parts = (None, None) if estimate is None else (estimate.mean, estimate.error)
    values = [part if part is None else float(np.asarray(part)[at]) for part in parts]
    return dict(zip((name, f"{name}_error"), values, strict=True))


def over_runs(
    name: str, members: Sequence[SeriesMean], notes: list[str], about: str
) -> dict[str, float | None]:
    """Return the table cells of a mean over runs, and add warnings about the mean to `notes`."""
    notes += diagnostics(about, members)
    return measured(name, combine_runs(members))


def spread(results: dict[str, dict]) -> dict[str, np.ndarray]:
    """Convert groups of results to table columns: one for a number, two for an estimate.

    The name of each column ends with the key of its group.
    """
    columns = {}
    for end, found in results.items():
        for name, values in found.items():
            if isinstance(values, Estimate):
                columns |= {name + end: values.mean, f"{name}_error{end}": values.error}
            else:
                columns[name + end] = values
    return columns


def points(names: Sequence[str], curves: dict[tuple, Curve]) -> list[dict]:
    """Return a table row for each point of the curves: key of the curve, x, y and error of y."""
    return [
        dict(zip(names, (*key, *map(float, point)), strict=True))
        for key, curve in curves.items()
        for point in zip(*curve, strict=True)
    ]


def without_error(tables: Sequence[Table]) -> list[str]:
    """Return a list that contains one warning if some numbers have no error."""
    names = [
        name.removesuffix("_error")
        for table in map(columns, tables)
        for name, errors in table.items()
        if name.endswith("error")
        for values in [table.get(name[: -len("_error")], repeat(None))]
        if any(is_nan(e) and not is_nan(v) for e, v in zip(errors, values, strict=False))
    ]
    reason = "takes several runs, or more samples in equilibrium"
    return [f"no error of {', '.join(names)}: it {reason}"] if names else []


def is_nan(value: object) -> bool:
    """Return whether a value of any type is a floating-point NaN."""
    return isinstance(value, float) and bool(np.isnan(value))


def columns(table: Table) -> dict[str, Iterable]:
    """Convert a table to a dictionary of columns; all rows must have the same keys."""
    if isinstance(table, dict):
        return table
    return {name: [row[name] for row in table] for name in (table[0] if table else ())}


def write_csv(path: Path, table: Table) -> None:
    """Write a table as a CSV file with a header line and full numerical precision."""
    table = columns(table)
    with destination(path).open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(zip(*table.values(), strict=True))


def text_of(table: Table) -> str:
    """Return a table as text with aligned columns and six digits for each number."""
    table = columns(table)
    rows = [
        ["-" if v is None else f"{v:.6g}" if isinstance(v, float) else str(v) for v in row]
        for row in zip(*table.values(), strict=True)
    ]
    widths = [max(map(len, column)) for column in zip(table, *rows, strict=True)]
    lines = (
        "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        for row in (table, *rows)
    )
    return "\n".join(lines)


# --- errors and exit codes ---


def launch(main: Callable[[], None]) -> None:
    """Run the main function of a script, and report exceptions in one line on stderr.

    The exit code is 1 for the exception `Refused` and 2 for all other exceptions.  The command
    `python -X dev` shows the traceback of an unexpected exception.
    """
    matplotlib.use("Agg")  # not at import, because a notebook may import a script
    plt.style.use(STYLE)
    name = Path(sys.argv[0]).name
    if not sys.flags.dev_mode:
        warnings.simplefilter("ignore")
    try:
        main()
    except RunError as problem:
        give_up(name, str(problem), code=1 if isinstance(problem, Refused) else 2)
    except OSError as problem:  # errors while writing, as on a full disk, have no file name
        give_up(name, f"{problem.filename or 'cannot write the output'}: {problem.strerror}")
    except Exception as problem:
        if sys.flags.dev_mode:
            raise
        give_up(name, f"cannot make sense of {' '.join(sys.argv[1:])}: {problem!r}")
    except KeyboardInterrupt:
        print(f"{name}: interrupted", file=sys.stderr)
        sys.exit(130)


def give_up(name: str, reason: str, code: int = 2) -> NoReturn:
    """Print an error message in one line, and exit with the given code."""
    print(f"{name}: {' '.join(reason.split())}", file=sys.stderr)
    sys.exit(code)
