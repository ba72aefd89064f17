"""Command lines, printed reports and exit codes of the scripts in post/.

Figures are drawn without a display, in the style of `style.mplstyle`.
"""

import argparse
import re
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import matplotlib

from .figures.drawing import STYLE, plt, save, warn
from .reading.files import counted, did_you_mean
from .reading.nature import Refused, stays_in_box
from .reading.reader import RunError, read_run
from .reading.units import UNNAMED
from .reports import analysis
from .reports.options import (
    RENAMED,
    TIMES,
    shared,
    unit_names,
)
from .reports.registry import distinct
from .reports.tables import (
    Table,
    once,
    text_of,
    without_error,
    write_csv,
)
from .running.ensembles import in_order, read_manifest

PATIENCE = 5.0  # computing time after which a terminal shows that an analysis is running [s]

# --- options ---


class HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Format of help texts, with each option beside its description."""

    def __init__(self, prog: str) -> None:
        """Widen the column of the options, to 26 characters."""
        super().__init__(prog, max_help_position=26)


class Parser(argparse.ArgumentParser):
    """Command-line parser that explains unknown arguments."""

    def parse_args(self, args: Sequence[str] | None = None, namespace=None) -> argparse.Namespace:
        words = joined(sys.argv[1:] if args is None else args)
        known, unknown = self.parse_known_args(words, namespace)
        if unknown:
            word = unknown[0].split("=")[0]
            if RENAMED.get(word) in self._option_string_actions:
                self.error(f"{word} is called {RENAMED[word]} now")
            if hasattr(known, "runs") and not word.startswith("-"):
                self.error(f"takes one run, but {word} is a second one")
            self.error(f"unknown argument {word}{did_you_mean(word, self._option_string_actions)}")
        if hasattr(known, "runs"):
            paths = known.runs if known.paired else finished(known.runs)
            known.runs = [replace(read_run(path), units=known.units) for path in paths]
            if getattr(known, "times", None):
                known.runs = [run.window(*known.times) for run in known.runs]
            for run in [] if known.open_systems else known.runs:
                stays_in_box(run)
            if not known.repeated:
                known.runs, left_out = distinct(known.runs)
                for text in left_out:
                    print(f"warning: {text}", file=sys.stderr)
        results = [getattr(known, name, None) for name in ("output", "csv")]
        if None not in results and results[0].resolve() == results[1].resolve():
            self.error(f"{known.csv} is the name of the figure, too: choose another for --csv")
        return known


def finished(paths: list[Path]) -> list[Path]:
    """Return the paths of finished runs, or all if none has finished; warn about unfinished ones.

    If all files of a sweep are given, members of the sweep without an output file count as
    unfinished, too.
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
        of_all = counted(len(whole) + len(missing), "run")
        told = f"{len(whole)} of {of_all}; {len(missing)} unfinished"
        print(f"warning: {told}: {names}", file=sys.stderr)
    return whole


def joined(words: Iterable[str]) -> list[str]:
    """Attach a list such as '-10:' to its option; argparse would mistake it for an option."""
    result: list[str] = []
    for word in words:
        if re.fullmatch(r"-\d+[,:][-\d,:]*", word) and result and result[-1].startswith("--"):
            result[-1] += f"={word}"
        else:
            result.append(word)
    return result


def command_line(
    doc: str,
    output: str,
    one: bool = False,
    csv: bool = True,
    repeated: bool = False,
    open_systems: bool = False,
    **defaults,
) -> Parser:
    """Return a command-line parser, whose help text is the docstring `doc` of the script.

    `one` restricts the script to a single run. `repeated` allows duplicate runs, and `open_systems`
    allows runs in which disks leave or enter the box. With the parser default `paired`, unfinished
    runs are used, too. `csv` adds the option --csv. Each further keyword is the name of one of the
    `OPTIONS`, and its value is the default. The default may be None, or a text that describes what
    the script does without the option.
    """
    given = "RUN.h5" if one else "RUN.h5 [RUN.h5 ...]"
    parser = Parser(
        usage=f"%(prog)s [options] {given}",
        description=doc,
        formatter_class=HelpFormatter,
        allow_abbrev=False,
    )
    parser.set_defaults(title=doc.splitlines()[0], repeated=repeated, open_systems=open_systems)
    parser.set_defaults(paired=False, notes=[])
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
    names = "names of units: length=cm,time=s,mass=g [reduced]"
    parser.add_argument("--units", type=unit_names, default=UNNAMED, metavar="NAMES", help=names)
    for name, default in defaults.items():
        shared(name, default).add_to(parser)
    return parser


def add_width(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the option --width, whose default is described in words, to the parser of a script."""
    meaning = f"width of the figure: 8.5cm, or slide [{default}]"
    parser.add_argument("--width", metavar="WIDTH", help=meaning)


# --- printed tables, warnings and figures ---


def report(
    args: argparse.Namespace,
    figure: plt.Figure | None,
    *tables: Table,
    data: Table | None = None,
    notes: Sequence[str] = (),
) -> None:
    """Print the tables, save the figure, and write `data` [first table] to the file of --csv.

    `notes`, and warnings about runs that ended early, appear on stderr and on the figure.
    """
    notes = [
        *(run.termination_note for run in args.runs if run.termination_note),
        *args.notes,
        *notes,
    ]
    notes = once(notes, {run.path.name for run in args.runs})
    if figure is not None:
        warn(figure, notes)
    publish(args, figure, tables, notes, data)


def publish(
    args: argparse.Namespace,
    figure: plt.Figure | None,
    tables: Sequence[Table],
    notes: Sequence[str],
    data: Table | None,
    explained: bool = False,
) -> None:
    """Print tables and warnings, save the figure, and write the file of --csv.

    Numbers without an error cause a further warning, unless the warnings `notes` explain them.
    """
    if any(tables):
        print("\n\n".join(text_of(table) for table in tables if table), flush=True)
    for note in [*notes, *([] if explained else without_error(tables))]:
        print(f"warning: {note}", file=sys.stderr)
    if figure is not None:
        save(figure, args.output, args.runs, args.title)
        print(f"figure: {args.output}")
    if "csv" in args and args.csv:
        write_csv(args.csv, tables[0] if data is None else data)


def run_analysis(name: str, doc: str) -> None:
    """Run the script of an analysis, whose help text is the docstring `doc` of the script."""
    own = analysis(name)
    parser = command_line(doc, f"{name}.png", one=own.single, repeated=own.repeated)
    parser.set_defaults(paired=own.unfinished)
    parser.add_argument("--panel", metavar="NAME", help="panel to draw alone [all panels]")
    add_width(parser, "16cm")
    for option in (TIMES, *own.options):
        option.add_to(parser)
    args = parser.parse_args()
    with timer(name):
        result = own.result(args.runs, args)
        figure = result.figure(args.panel, args.width)
    data = result.table if result.data is None else result.data
    tables = [result.shown, *result.further]
    publish(args, figure, tables, result.warnings, data, result.explained)


@contextmanager
def timer(name: str) -> Iterator[None]:
    """Show on a terminal how long an analysis has been running, once it exceeds `PATIENCE`.

    The line is not a progress bar of tqdm: an interrupt while another bar is drawn leaves the lock
    that all bars share acquired, and this thread would wait for it for ever.
    """
    ended, begin = threading.Event(), time.monotonic()

    def show() -> None:
        text, patience = "", PATIENCE
        while not ended.wait(patience):
            minutes, seconds = divmod(int(time.monotonic() - begin), 60)
            text, patience = f"{name}: {minutes:02d}:{seconds:02d}", 1.0
            print(f"\r{text}", end="", file=sys.stderr, flush=True)
        if text:
            print(f"\r{' ' * len(text)}\r", end="", file=sys.stderr, flush=True)

    thread = threading.Thread(target=show, daemon=True)
    if sys.stderr.isatty():
        thread.start()
    try:
        yield
    finally:
        ended.set()
        if thread.is_alive():
            thread.join()


# --- errors and exit codes ---


def launch(main: Callable[[], None]) -> None:
    """Run the main function of a script, reporting exceptions in one line on stderr.

    The exit code is 1 for `Refused` and 2 for other exceptions. `python -X dev` shows the traceback
    of an unexpected exception.
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
    except OSError as problem:  # write errors, such as a full disk, have no file name
        give_up(name, f"{problem.filename or 'cannot write the output'}: {problem.strerror}")
    except Exception as problem:
        if sys.flags.dev_mode:
            raise
        give_up(name, f"cannot make sense of {' '.join(sys.argv[1:])}: {problem!r}")
    except KeyboardInterrupt:
        print(f"{name}: interrupted", file=sys.stderr)
        sys.exit(130)


def give_up(name: str, reason: str, code: int = 2) -> NoReturn:
    """Print an error message on one line, and exit with the given code."""
    print(f"{name}: {' '.join(reason.split())}", file=sys.stderr)
    sys.exit(code)
