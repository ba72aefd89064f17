"""Load the library of the engine (see `ricochet.h`) and call its functions."""

import ctypes
import functools
import os
from collections.abc import Callable
from pathlib import Path

from ..commands import HERE
from .program import ProgramError

ROOM = 100_000  # size of the buffer for a message [bytes]


def c_text(text: str | Path) -> bytes:
    """Encode a text or path for the library; raise ValueError if it contains a zero byte."""
    words = os.fsencode(text) if isinstance(text, Path) else text.encode(errors="surrogateescape")
    if b"\0" in words:
        raise ValueError(f"{text!r} has a zero byte")
    return words


def opened(make: Callable[..., int], *arguments: object) -> int:
    """Return the simulation handle that a library function creates, or raise its error."""
    message, code = ctypes.create_string_buffer(ROOM), ctypes.c_int()
    handle = make(*arguments, message, ROOM, ctypes.byref(code))
    if not handle:
        raise ProgramError(message.value.decode(errors="replace"), code.value)
    return handle


def called(function: Callable[..., int], *arguments: object) -> bool:
    """Call a library function, raising its error; return whether the call must be repeated."""
    message = ctypes.create_string_buffer(ROOM)
    code = function(*arguments, message, ROOM)
    if code > 1:
        raise ProgramError(message.value.decode(errors="replace"), code)
    return code == 1


@functools.cache
def library(files: bool = False) -> ctypes.CDLL:
    """Load the library of the engine, with support of HDF5 files if `files` is True."""
    name = "libricochet_files.so" if files else "libricochet.so"
    wish = os.environ.get("RICOCHET_LIBRARY")  # a folder
    places = [Path(wish)] if wish else [HERE / "lib", HERE.parents[1] / "build"]
    path = next((place / name for place in places if (place / name).is_file()), None)
    if path is None:
        raise ProgramError(f"no {name} in {places[-1]}: run make library in a clone", 3)
    # Local symbols avoid clashes with the HDF5 library of h5py.
    engine = ctypes.CDLL(str(path))
    p, n, text = ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p
    long, real = ctypes.c_int64, ctypes.c_double
    answer = [ctypes.c_char_p, n]
    kinds = {
        "open": (p, text, text, n, *answer, p),
        "close": (None, p),
        "copy": (p, p, *answer, p),
        "advance": (n, p, real, long, long, real, *answer),
        "advance_event": (n, p, real, long, long, real, *answer),
        "last_events": (n, p, n, p),
        "time": (real, p),
        "count": (None, p, p),
        "column": (n, p, text, p),
        "observables": (n, p, text, n, p),
        "next_events": (n, p, n, p),
        "change": (n, p, text, *answer),
        "schedule": (n, p, real, text, *answer),
        "set_velocities": (n, p, p, *answer),
        "set_positions": (n, p, p, *answer),
        "text": (n, p, text, text, n),
    }
    if files:
        kinds |= {
            "save": (n, p, text, n, *answer),
            "load": (p, text, n, *answer, p),
        }
    for function, (result, *arguments) in kinds.items():
        it = getattr(engine, f"ricochet_{function}")
        it.restype, it.argtypes = result, arguments
    return engine
