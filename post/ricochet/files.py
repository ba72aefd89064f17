"""Files from anybody's hands, and places for results.

An HDF5 file can name other files, as links or as the place of its data, and can declare any size.
What is read here lies in the file itself: at the end of hard links, stored in full, met once.
"""

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from posixpath import join

import h5py
import numpy as np

MOST_PACKED = 20  # compressed data may be so many times larger than their file


class RunError(Exception):
    """A file that cannot be used; the message is one line that says what and where."""


class Unsound(Exception):
    """What is wrong inside a file; `open_file` adds which one."""


# --- opening ---


@contextmanager
def open_file(path: Path) -> Iterator[h5py.File]:
    """The HDF5 file for reading; any fault found in it becomes a RunError."""
    with hdf5_file(path) as file:
        try:
            yield file
        except Unsound as problem:
            raise RunError(f"{path}: {problem}") from None
        except (OSError, RuntimeError, MemoryError):
            raise RunError(f"{path}: the file is damaged") from None
        except (AttributeError, LookupError, TypeError, ValueError):
            raise RunError(f"{path}: not laid out as a Ricochet run, or damaged") from None


def hdf5_file(path: Path) -> h5py.File:
    """The open file, also while a simulation writes it."""
    if not path.exists():
        part = Path(f"{path}.part")
        near = (f"{other}" for other in path.parent.glob("*.h5*") if ".chk." not in other.name)
        hint = f", but there is {part} of an unfinished run" if part.exists() else None
        hint = hint or did_you_mean(str(path), near)
        raise RunError(f"{path}: no such file{hint}")
    if not path.is_file():  # a FIFO would be waited for
        raise RunError(f"{path}: is a {'folder' if path.is_dir() else 'device'}, not a run")
    try:
        return h5py.File(path, "r", locking=False)
    except FileNotFoundError:  # it has just been removed, or renamed by the program
        raise RunError(f"{path}: no such file") from None
    except PermissionError:
        raise RunError(f"{path}: no permission to read") from None
    except OSError:
        state = "is empty" if path.stat().st_size == 0 else "is not an HDF5 file, or is cut short"
        raise RunError(f"{path}: {state}") from None


def did_you_mean(word: str, others: Iterable[str]) -> str:
    """A suggestion, if one of the others is like the word."""
    return "".join(f"; did you mean {near}?" for near in get_close_matches(word, others, 1))


# --- reading ---


def find(group: h5py.Group, path: str) -> h5py.Group | h5py.Dataset | None:
    """What lies at `path` below the group in the file itself; None if nothing does."""
    for name in path.split("/"):
        if not isinstance(group, h5py.Group) or not group.id.links.exists(name.encode()):
            return None
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise Unsound(f"{join(group.name, name)} is a link to somewhere else")
        group = group[name]
    if isinstance(group, h5py.Dataset):
        plan = group.id.get_create_plist()
        if plan.get_external_count() or plan.get_layout() == h5py.h5d.VIRTUAL:
            raise Unsound(f"{group.name} keeps its data in another file")
    return group


def numbers(
    group: h5py.Group,
    path: str,
    count: int = 0,
    item: tuple[int, ...] | None = None,
    kinds: str = "iuf",
) -> h5py.Dataset:
    """The dataset at `path`, if it holds `count` numbers, or arrays of the shape `item`."""
    data = find(group, path)
    if data is None:
        raise Unsound(f"not a complete Ricochet run, {join(group.name, path)} is missing")
    if data.dtype.kind not in kinds or data.dtype.itemsize > 8:
        raise Unsound(f"{data.name} is of a wrong type")
    if len(data) < count or item not in (None, data.shape[1:]):
        raise Unsound(f"{data.name} has a wrong shape")
    check_size(data, count)
    return data


def check_size(data: h5py.Dataset, rows: int) -> None:
    """Refuse a dataset whose first `rows` rows are not in the file."""
    size = rows * math.prod(data.shape[1:]) * data.dtype.itemsize
    if size and data.chunks:  # a part of a chunk cannot be read
        size = max(size, math.prod(data.chunks) * data.dtype.itemsize)
    packed = data.id.get_create_plist().get_nfilters()
    room = MOST_PACKED * data.file.id.get_filesize() if packed else data.id.get_storage_size()
    if size > room:
        raise Unsound(f"{data.name} declares {size} bytes that the file does not hold")


def tree(group: h5py.Group, levels: int = 4, met: set | None = None) -> dict:
    """A group as a dictionary of plain values; attributes and datasets alike."""
    if levels == 0:
        raise Unsound(f"{group.name} has too many groups above it")
    met = {group} if met is None else met
    values = {name: attribute(group, name) for name in group.attrs}
    for name in group:
        item = find(group, name)
        if item in met:
            raise Unsound(f"{join(group.name, name)} is in the file under another name")
        met.add(item)
        values[name] = tree(item, levels - 1, met) if isinstance(item, h5py.Group) else whole(item)
    return values


def whole(data: h5py.Dataset) -> object:
    """All of a small dataset."""
    check_type(data.name, data.dtype, data.shape)
    check_size(data, len(data) if data.shape else 1)
    return plain(data[()])


def attribute(owner: h5py.Group, name: str) -> object:
    """The value of an attribute, None if there is none."""
    if name not in owner.attrs:
        return None
    held = owner.attrs.get_id(name)
    check_type(f"{owner.name}@{name}", held.dtype, held.shape)
    return plain(owner.attrs[name])


def check_type(name: str, kind: np.dtype, shape: tuple | None) -> None:
    """Numbers and texts only; a text of free length alone, for many could all be the same one."""
    if shape is None or not (kind.kind in "iufbS" or (h5py.check_string_dtype(kind) and not shape)):
        raise Unsound(f"{name} is of a wrong type")


def plain(value: object) -> object:
    """Text instead of bytes, Python numbers instead of arrays without an axis."""
    if isinstance(value, str):
        value = value.encode("utf-8", "surrogateescape")
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace").rstrip()
    if isinstance(value, np.ndarray) and value.dtype.kind in "SO":
        return [plain(item) for item in value.ravel()]
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        return plain(value.item())
    return value


# --- writing ---


def destination(path: Path) -> Path:
    """A place for a result: its folder is made, and only an ordinary file may be there before."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_symlink() or (path.exists() and not path.is_file()):
        raise RunError(f"{path}: is not an ordinary file; choose another name, or remove it")
    if path.exists() and h5py.is_hdf5(path):
        raise RunError(f"{path}: holds HDF5 data, which a result does not replace")
    if path.exists() and path.stat().st_nlink > 1:
        path.unlink()  # its other names keep what they have
    return path
