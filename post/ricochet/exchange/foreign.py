"""Checks of files of other programs, before and after their data are read."""

from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["DAMAGE", "check_counts", "check_index", "check_values"]

#: Exceptions that may occur while the data of a damaged file are interpreted.
DAMAGE = (
    ArithmeticError,
    AttributeError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
)
MAGIC = 0x65DF65DF65DF65DF  # first number in a GSD file
#: Header of a GSD file, with positions and sizes of the index and of the list of names.
HEADER = np.dtype([("magic", "<u8"), ("index", "<u8", 2), ("names", "<u8", 2)])
#: Entry in the index of a GSD file: an array of N x M values at a position in the file.
ENTRY = np.dtype("<u8, <u8, <i8, <u4, <u2, u1, u1")
ENTRY.names = "frame", "N", "place", "M", "id", "type", "flags"
NAME_BYTES = 64  # size of an entry in the list of names
TYPE_BYTES = np.array([0, 1, 2, 4, 8, 1, 2, 4, 8, 4, 8, 1])  # size of a value of each type
#: Groups of a GSD frame, each with a number of members.
GROUPS = ("particles", "bonds", "angles", "dihedrals", "impropers", "constraints", "pairs")


def check_index(path: Path) -> None:
    """Raise ValueError if a GSD file is shorter than its header or index implies.

    The package gsd would allocate too much memory, or read beyond the end of the file.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        header = np.fromfile(file, HEADER, 1)
        if len(header) == 0 or header["magic"][0] != MAGIC:
            raise ValueError("it does not begin as a GSD file")
        (place, count), (names, n_names) = header["index"][0].tolist(), header["names"][0].tolist()
        if place + count * ENTRY.itemsize > size or names + n_names * NAME_BYTES > size:
            raise ValueError("it is shorter than its header says")
        file.seek(place)
        entries = np.fromfile(file, ENTRY, count)
    # the remaining entries are unused
    entries = entries[: np.append(entries["place"], 0).tolist().index(0)]
    known = (entries["type"] > 0) & (entries["type"] < len(TYPE_BYTES))
    if not np.all(known) or np.any(entries["frame"] >= count):
        raise ValueError("an entry of its index is damaged")
    ends = entries["place"] + 1.0 * entries["N"] * entries["M"] * TYPE_BYTES[entries["type"]]
    if np.any(entries["place"] < 0) or np.any(ends > size):
        raise ValueError("it is shorter than its index says")


def check_counts(file: Any, path: Path, frame: int) -> None:
    """Raise ValueError if this frame or the first lists more members than the file has bytes."""
    for name in (f"{group}/N" for group in GROUPS):
        for k in {0, frame}:
            if not file.chunk_exists(frame=k, name=name):
                continue
            number = file.read_chunk(frame=k, name=name).item()
            if not 0 <= number <= path.stat().st_size:
                raise ValueError(f"{name} = {number} exceeds the size of the file")


def check_values(arrays: dict[str, np.ndarray]) -> None:
    """Raise ValueError if values in a frame are impossible.

    `arrays` are "time"; the corners "lower" and "upper" of the box (2,); and, for N disks,
    "position" and "velocity" (N, 2) and other quantities (N,).
    """
    for name, values in arrays.items():
        if not np.all(np.isfinite(values)):
            raise ValueError(f"{name}: not all numbers are finite")
    count = len(arrays["position"])
    shapes = {"time": (), "lower": (2,), "upper": (2,), "periodic": (2,)}
    shapes |= dict.fromkeys(("position", "velocity"), (count, 2))
    for name, values in arrays.items():
        if np.shape(values) != shapes.get(name, (count,)):
            raise ValueError(f"{name}: has the shape {np.shape(values)}")
    if count == 0:
        raise ValueError("it contains no disks")
    if not np.all(arrays["lower"] < arrays["upper"]):
        raise ValueError("the box has no area")
    for name in ("radius", "mass"):
        if name in arrays and not np.all(arrays[name] > 0):
            raise ValueError(f"{name}: not all numbers are above 0")
