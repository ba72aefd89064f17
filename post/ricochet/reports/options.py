"""Options of analyses and scripts, and the frames and disks that they select."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..analysis.equilibrium import SPEEDS_FORGET, frames_from, start_of_steady_state
from ..figures.drawing import COLOURINGS
from ..reading.files import RunError
from ..reading.reader import Run
from ..reading.units import Units, units_of


def frame_list(text: str) -> tuple[int | slice, ...]:
    """Convert a list of frames and ranges, such as '0,10,-1' or '100:200', to indices."""

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
    """Convert a text to a nonnegative number."""
    value = float(text)
    if not 0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of at least 0")
    return value


def time_window(text: str) -> tuple[float, float]:
    """Convert a text such as '20:40', '20:' or ':40' to the first and last time of a window."""
    try:
        start, end = text.split(":")
        return float(start or 0), float(end or "inf")
    except ValueError:
        problem = f"'{text}' is not a window of time such as 20:40 or 20:"
        raise argparse.ArgumentTypeError(problem) from None


def unit_names(text: str) -> Units:
    """Convert a text such as 'length=cm,time=s' to names of units."""
    try:
        return units_of(text)
    except ValueError as problem:
        raise argparse.ArgumentTypeError(str(problem)) from None


@dataclass(frozen=True)
class Option:
    """Option of an analysis."""

    # Name of the argument in Python; the option of the script has hyphens in place of underscores.
    name: str
    meaning: str  # help text
    default: Any = None  # value if the option is missing
    # Conversion of the text on the command line; `bool` for an option without a value.
    convert: Callable[[str], Any] = str
    symbol: str | None = None  # name of the value in the help text
    choices: Sequence[str] | None = None  # allowed values [all]
    number: int | None = None  # number of values, if there are several
    flag: str = ""  # name of the option of the script, if it differs from `name`

    def add_to(self, parser: argparse.ArgumentParser) -> None:
        """Add the option to the parser of a script."""
        names = [self.flag or f"--{self.name.replace('_', '-')}", *SPELLINGS.get(self.name, [])]
        if self.convert is bool:
            parser.add_argument(*names, action="store_true", dest=self.name, help=self.meaning)
            return
        more: dict[str, Any] = {"default": self.default, "dest": self.name, "help": self.meaning}
        if self.choices:
            more |= {"choices": self.choices, "metavar": self.symbol}
        else:
            more |= {"type": self.convert, "metavar": self.symbol, "nargs": self.number}
        parser.add_argument(*names, **more)

    def value(self, given: Any) -> Any:
        """Return the value of a Python argument, which may be a text as on a command line."""
        if self.choices and given not in self.choices:
            raise ValueError(f"{self.name} is not one of {', '.join(self.choices)}: {given!r}")
        if not isinstance(given, str) or self.convert is str:
            return given
        try:
            return self.convert(given)
        except argparse.ArgumentTypeError as problem:
            raise ValueError(f"{self.name}: {problem}") from None


def shared(name: str, default: Any = None) -> Option:
    """Return one of the `OPTIONS` of several analyses with its default.

    A default that is a text describes what the analysis does without the option. Without the
    option, its value is then None.
    """
    convert, symbol, meaning = OPTIONS[name]
    if isinstance(default, str):
        meaning, default = f"{meaning.partition(' [')[0]} [{default}]", None
    elif default is not None:
        meaning += f" [{default:g}]"
    return Option(name, meaning, default, convert, symbol)


#: Window of time to which all analyses can be restricted.
TIMES = Option(
    "times",
    "only the times from START up to END; 20: has no END",
    convert=time_window,
    symbol="START:END",
)
#: Options of several scripts: conversion, symbol of the value, and help text, by name.
OPTIONS: dict[str, tuple[Callable[[str], Any], str, str]] = {
    "frames": (frame_list, "LIST", "frames to use, such as 0,10,-1 or 100:200 or ::5"),
    "count": (positive, "N", "largest number of frames, which are evenly spread"),
    "equilibration": (
        not_negative,
        "X",
        "equilibration (collisions per disk) [until no drift]",
    ),
    "min_separation": (float, "X", "least separation of frames (collisions per disk)"),
    "wavenumber": (not_negative, "K", "wave number of F_s(k, t) times the mean diameter"),
    "disks": (disk_list, "IDS", "disks to show: numbers such as 1,5,9"),
    "colour": (str, "WHAT", f"species, {', '.join(COLOURINGS)} [species; speed if there is one]"),
}


#: Option names of earlier versions, with the present names.
RENAMED = {"--skip": "--equilibration", "--apart": "--min-separation", "--wave": "--wavenumber"}
#: Alternative spellings of option names.
SPELLINGS = {"colour": ["--color"]}


def chosen_frames(run: Run, which: Sequence[int | slice] | None, count: int | None) -> list[int]:
    """Return the indices of the frames selected by --frames [all] and --count (evenly spread)."""
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


def late_frames(run: Run, options: SimpleNamespace, warnings: list[str]) -> list[int]:
    """Return the frames of --frames that are in the steady state and far enough apart.

    If there are none, the last frame is returned. Warnings are added if requested frames are not
    used, or if the speeds in the first selected frame may still depend on the initial speeds.
    """
    frames, start = (
        chosen_frames(run, options.frames, None),
        start_of_steady_state(run, options.equilibration),
    )
    used = frames_from(run, start, options.min_separation, frames)
    says = f"{run.label}: "
    if not used:
        used = [max(frames)]
        warnings.append(
            f"{says}none of the frames is from t = {start:.4g} on; the last one is used"
        )
    elif options.frames is not None and len(used) < len(frames):
        some = f"takes {len(used)} of {len(frames)} frames, from t = {start:.4g} on and "
        warnings.append(f"{says}{some}{options.min_separation:g} collisions per disk apart")
    tau = run.collisions_per_disk_at(run.time)[used[0]]
    if options.equilibration is None and tau < SPEEDS_FORGET * (1 - 1e-9):
        early = f"its frames begin at {tau:.3g} collisions per disk, but the initial speeds may "
        warnings.append(f"{says}{early}have an effect up to {SPEEDS_FORGET:g}; run longer")
    return used


def chosen_disks(run: Run, ids: list[int]) -> list[int]:
    """Convert disk numbers, counted from 1, to indices."""
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
            f"{run.path}: contains no {what}: the run is not finished, this number was 0, or "
            "--times selects a part of the run"
        )
    return value
