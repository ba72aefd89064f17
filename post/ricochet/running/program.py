"""Run the program from Python with an input file or a dictionary, and return a `Run`.

The program reports its progress only to a terminal, so its standard error is a pseudo-terminal.
"""

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from ..commands import HERE
from ..reading.files import RunError, TemporaryFolder, did_you_mean
from ..reading.reader import Run, open_run
from .starting import with_start

STOPPED = 75
PROGRESS = "\033[?7l"  # start of each update of the progress line on a terminal
PAUSE = 30.0  # interval of progress lines without a terminal [s]
#: Folders that may contain the input files: of an installed package, and of a clone.
INPUTS = (HERE / "input", HERE.parents[1] / "input")
ESCAPES = re.compile(r"\033\[\??\d*[A-Za-z]")


class ProgramError(RunError):
    """Error of a program that cannot start or does not finish.

    `message` holds the lines that the program printed, `code` is its exit code, and `path` is the
    file with the completed part of the run, or None.
    """

    def __init__(self, message: str, code: int, path: Path | None = None):
        """Store the message, with one line for each error in the input."""
        super().__init__(message)
        self.message, self.code, self.path = message, code, path

    def __reduce__(self) -> tuple[Any, ...]:
        """Return all attributes, so that a worker process can pass the error on by `pickle`."""
        return type(self), (self.message, self.code, self.path)


def run(
    system: str | Path | Mapping[str, Any],
    overrides: Mapping[str, Any] | None = None,
    output: str | Path | None = None,
    force: bool = False,
    resume: bool = False,
    threads: int | None = None,
    progress: bool = True,
) -> Run:
    """Run the program with an input, and return the finished run.

    Parameters
    ----------
    system : str, Path or mapping
        an input file, the text of an input, or a dictionary of its groups, such as `{"species":
        {"count": 9, "radius": 0.1}}`; a repeated group is a list of dictionaries; radius, mass,
        angular_velocity and orientation may be arrays with a value for each position
    overrides : mapping of str to object, optional
        values that replace those of the input, such as `{"species.gas.mass": 2}` or `{"contact":
        {"restitution": 0.9}}`; None stands for the default of a variable
    output : str or Path, optional
        output file [a temporary file, deleted when no object uses it any longer]
    force, resume : bool
        start the program with the option `--force` or `--resume`
    threads : int, optional
        value of the variable `run.threads`
    progress : bool
        show the progress, continuously on a terminal or in a notebook, otherwise as a line every 30
        s

    Returns
    -------
    Run
        the finished run

    Raises
    ------
    ProgramError
        if the program reports an error

    Examples
    --------
    >>> result = ricochet.run(small, {"run.seed": 3}, progress=False)
    >>> result.n_disks, result.seed
    (20, 3)
    """
    program = find_program()
    folder = TemporaryFolder()
    work = folder.path
    temporary = output is None
    output = work / "run.h5" if output is None else Path(output)
    text = unseen(system, output)
    groups = text if isinstance(system, Mapping) else None
    if text is not None:
        system = work / "input.nml"
        system.write_text(text, encoding="utf-8")
    cores = {"run.threads": threads} if whole_threads(threads) else {}
    pairs = settings_of({} if overrides is None else overrides) + settings_of(cores)
    words = [word for pair in pairs for word in ("--set", pair)]
    command = [program, "-o", output, *words]
    command += ["--force"] * force + ["--resume"] * resume + ["--", system]
    began = time.time()
    code, lines = watched(list(map(str, command)), progress)
    message = "\n".join(lines).replace(f"{work}{os.sep}", "")
    if code != 0:
        part = output.with_name(f"{output.name}.part")
        written = part.is_file() and part.stat().st_mtime > began - 1  # written by this run
        message = without_options(named(message, groups), pairs)
        if temporary and written:
            folder.keep()
        message = message or f"{program} ended with exit code {code}"
        raise ProgramError(message, code, part if written else None)
    if message:
        print(message, file=sys.stderr)
    return open_run(output, folder if temporary else None)


def example(name: str) -> Path:
    """Return the path of an input file supplied with Ricochet.

    Parameters
    ----------
    name : str
        name of the file, with or without `.nml`, such as "crater"

    Returns
    -------
    Path
        path of the input file

    Raises
    ------
    RunError
        if there is no such file; the message suggests a name, or lists them all

    Examples
    --------
    >>> ricochet.example("crater").name
    'crater.nml'
    """
    folder = next((place for place in INPUTS if place.is_dir()), INPUTS[-1])
    path = folder / f"{name.removesuffix('.nml')}.nml"
    if Path(name).name != name or not path.is_file():
        names = sorted(own.stem for own in folder.glob("*.nml"))
        hint = did_you_mean(name, names) or f"; there are {', '.join(names)}"
        raise RunError(f"{folder}: there is no input {name}{hint}")
    return path


def whole_threads(threads: int | None) -> int:
    """Check and return the number of threads; 0 means that the input determines the number."""
    if threads is None:
        return 0
    if not isinstance(threads, Integral) or not 1 <= threads <= 1024:
        raise ValueError(f"threads: a whole number from 1 to 1024, not {threads!r}")
    return int(threads)


def find_program() -> str:
    """Return the path of the program: the value of RICOCHET, or the first path found.

    The installed package, the folder `build` of this clone, and PATH are searched in this order.
    """
    root = HERE.parents[1]
    if wish := os.environ.get("RICOCHET"):
        places = [Path(wish)]
    else:
        built = [HERE / "bin/ricochet", root / "build/ricochet"]
        places = [*built, Path(shutil.which("ricochet") or "")]
    for place in places:
        if place.is_file() and os.access(place, os.X_OK):
            return str(place.resolve())
    build = [f"in {root / 'build'}"] if (root / "Makefile").is_file() else []  # otherwise installed
    where = f"at {wish}" if wish else " or ".join([*build, "on PATH"])
    make = "run make" if build else "run make install in a clone of Ricochet"
    raise ProgramError(
        f"no program ricochet {where}: {make}, or set RICOCHET to the path of the program", 3
    )


def watched(command: list[str], progress: bool = True) -> tuple[int, list[str]]:
    """Run a command with a progress bar, and return its exit code and its messages.

    If Python is interrupted or killed, the program writes a checkpoint and ends.
    """
    import pty  # not at the top: Windows, where files can be read, has no such module

    ours, its = pty.openpty()
    process = subprocess.Popen(
        tied(command), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=its
    )
    os.close(its)
    lines, spoken = [], time.monotonic()
    show = progress and (sys.stderr.isatty() or "ipykernel" in sys.modules)
    look = {"bar_format": "{bar:20} {desc}", "dynamic_ncols": True, "delay": 0.5}
    try:
        with tqdm(total=100, leave=False, disable=not show, **look) as bar:
            for line in lines_from(ours):
                text = ESCAPES.sub("", line).strip()
                share = re.search(r"([\d.]+) %", text)
                if not line.startswith(PROGRESS):
                    lines += [text] if text else []
                elif share:
                    bar.n = float(share[1])
                    bar.set_description_str(text)
                    if progress and not show and time.monotonic() > spoken + PAUSE:
                        print(text, file=sys.stderr, flush=True)
                        spoken = time.monotonic()
    finally:
        if process.poll() is None:
            process.terminate()
            list(lines_from(ours))  # closing the terminal earlier would lose the last messages
        process.wait()
        os.close(ours)
    return process.returncode, lines


def tied(command: list[str]) -> list[str]:
    """Return a command that receives SIGTERM, and then writes a checkpoint, when this process ends.

    The tool setpriv of util-linux, if available, requests the signal. A Python function called
    between fork and exec would be unsafe in a process with several threads.
    """
    setpriv = shutil.which("setpriv") if sys.platform == "linux" else None
    return [setpriv, "--pdeathsig", "TERM", "--", *command] if setpriv else command


def lines_from(terminal: int) -> Iterator[str]:
    """Yield the lines that a program writes to its terminal, including overwritten ones."""
    rest = b""
    while True:
        try:
            data = os.read(terminal, 65536)
        except OSError:  # raised by Linux when no process has the terminal open any longer
            data = b""
        *lines, rest = re.split(rb"[\r\n]", rest + data)
        yield from (line.decode(errors="replace") for line in (lines if data else [*lines, rest]))
        if not data:
            return


# --- the input ---


def unseen(system: str | Path | Mapping[str, Any], place: Path | None = None) -> str | None:
    """Return the text of an input given as a text or a dictionary, or None for a file.

    Arrays with a value for each disk are written to initial-configuration files in the folder of
    `place`, or in a temporary folder of this process.
    """
    if isinstance(system, Mapping):
        return namelist(system, place)
    if not isinstance(system, str | os.PathLike):
        kind = type(system).__name__
        raise TypeError(f"an input is a file, its text, or a dictionary of groups, not {kind}")
    return system if isinstance(system, str) and ("&" in system or "\n" in system) else None


def namelist(groups: Mapping[str, Any], place: Path | None = None) -> str:
    """Return the text of an input file with the given groups, whose values the program checks.

    Arrays with a value for each disk are written to initial-configuration files in the folder of
    `place`.
    """
    text = []
    for name, content in groups.items():
        for own in content if isinstance(content, list | tuple) else [content]:
            if not isinstance(own, Mapping):
                kind = type(own).__name__
                raise TypeError(
                    f"{name}: a group must be a dictionary or a list of dictionaries, not {kind}"
                )
            group = with_start(own, place) if name == "species" else own
            lines = [
                f"  {variable} = {value_text(f'{name}.{variable}', value)}\n"
                for variable, value in group.items()
                if value is not None
            ]
            text += [f"&{name}\n", *lines, "/\n"]
    return "".join(text)


def settings_of(overrides: Mapping[str, Any]) -> list[str]:
    """Return GROUP.VARIABLE=VALUE for each override; an empty VALUE stands for the default."""
    return [
        f"{name}={'' if value is None else value_text(name, value)}"
        for name, value in flat(overrides).items()
    ]


def flat(overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return overrides with full names as keys, such as "run.seed", in place of nested groups."""
    if not isinstance(overrides, Mapping):
        kind = type(overrides).__name__
        raise TypeError(f"values are a dictionary as {{'run.seed': 2}}, not {kind}")
    found: dict[str, Any] = {}
    for name, value in overrides.items():
        inner = flat(value) if isinstance(value, Mapping) else {"": value}
        for rest, own in inner.items():
            whole = ".".join(filter(None, (name, rest)))
            if whole in found:
                raise ValueError(f"{whole}: is given twice")
            found[whole] = own
    return found


def without_options(message: str, settings: Iterable[str]) -> str:
    """Replace the option --set in messages of the program by the name of the override."""
    for pair in settings:
        name = pair.partition("=")[0]
        place = re.compile(rf"^--set {re.escape(pair)}: (?:{name.split('.')[0]}[\w.]*: )?", re.M)
        message = place.sub(lambda _, name=name: f"{name}: ", message)  # type: ignore[misc]
    return message


def named(message: str, text: str | None) -> str:
    """Replace line numbers in messages by names of groups if the input is not a file."""
    if text is None:
        return message
    input_lines = text.splitlines()

    def place(found: re.Match[str]) -> str:
        before = input_lines[: int(found[1] or 0)]
        starts = [k for k, line in enumerate(before) if line.lstrip().startswith("&")]
        own = "\n".join(input_lines[starts[-1] :] if starts else [])
        name = re.match(r"[^&]*&\w+\s[^/&]*?\bname\s*=\s*'([^']*)'", own)
        return f"{found[2]}.{name[1]}" if name else found[2]

    return re.sub(r"^input(?:\.nml)?(?::(\d+))?: &?(\w+)", place, message, flags=re.MULTILINE)


def value_text(name: str, value: object, separator: str = ", ") -> str:
    """Return a value in namelist format; an array becomes the list of its numbers, row by row."""
    if isinstance(value, np.floating):
        value = float(value)
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()  # converted to Python types, even for a single value
    match value:
        case bool():
            return ".true." if value else ".false."
        case str() | Path():
            return "'" + str(value).replace("'", "''") + "'"
        case int() | float():
            return repr(value)
        case list() | tuple() if len(value) > 0:
            return separator.join(value_text(name, part, separator) for part in value)
        case list() | tuple():
            raise TypeError(f"{name}: the list is empty; omit the variable to use its default")
    kind = type(value).__name__
    raise TypeError(f"{name}: a value is a number, text, a bool, or a list of these, not {kind}")
