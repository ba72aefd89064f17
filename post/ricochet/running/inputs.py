"""Read the text of input files, and write the inputs of `Simulation.save`."""

import os
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from ..reading.files import similar_file
from .engine import c_text
from .program import ProgramError, unseen


def read_input(system: str | Path | Mapping[str, Any], place: Path | None = None) -> str:
    """Return the text of an input given as a file, a text, or a dictionary of groups."""
    if (text := unseen(system, place)) is not None:
        return text
    try:
        return Path(cast(str, system)).read_text(encoding="utf-8", errors="surrogateescape")
    except FileNotFoundError:
        hint = similar_file(Path(cast(str, system)), ".nml", Path("input"))
        raise ProgramError(f"{system}: there is no such file{hint}", 3) from None
    except OSError as error:
        raise ProgramError(f"{system}: cannot be read: {error.strerror}", 3) from error


def head_of(text: str) -> str:
    """Return the first line of a saved input, a comment with a checksum of the remaining lines."""
    crc = zlib.crc32(text.encode(errors="surrogateescape"))
    return f"! Saved by ricochet.Simulation, which may replace it unless it is edited: {crc:08x}\n"


def check_input_place(path: Path, output: Path) -> None:
    """Raise ProgramError if `save` would overwrite a file that it did not write itself."""
    c_text(path)
    try:
        if path.parent.resolve() == output.parent.resolve() and path.name in [
            output.name + end for end in ("", ".part", ".part_new", ".lock")
        ]:
            raise ProgramError(f"{path}: is a file of the output; choose another for the input", 3)
        if not path.parent.is_dir():
            raise ProgramError(f"{path}: there is no folder {path.parent}", 3)
        if not os.path.lexists(path):
            return
        if path.is_file() and not path.is_symlink():
            text = path.read_text(encoding="utf-8", errors="surrogateescape")
            head, end, rest = text.partition("\n")
            if head + end == head_of(rest):
                return
    except OSError as error:
        raise ProgramError(f"{path}: cannot be written: {error.strerror}", 3) from error
    raise ProgramError(
        f"{path}: exists already, and save has not written it; choose another file for the input", 3
    )


def write_input(path: Path, text: str) -> None:
    """Write an input to `path`, replacing a file or link of that name by a new file."""
    try:
        path.unlink(missing_ok=True)
        with path.open("x", encoding="utf-8", errors="surrogateescape") as file:
            file.write(head_of(text) + text)
    except OSError as error:
        raise ProgramError(f"{path}: cannot be written: {error.strerror}", 3) from error
