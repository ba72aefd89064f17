"""Open the HDF5 files of runs, and prepare the paths of figures and tables."""

import multiprocessing
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from importlib import import_module
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any

import h5py
import numpy as np

PRIORITY = 10  # priority of removing folders among the actions at the end of a process


class RunError(Exception):
    """Error for an unusable file, with a message that names its path and the reason."""


class Unsound(Exception):
    """Error for invalid contents of a file, to whose message `open_file` adds the path."""


def installing(package: str) -> str:
    """Return the command that installs a package for the running Python."""
    return f"{sys.executable} -m pip install {package}"


def optional_package(module: str, user: str) -> Any:
    """Import an optional module, or raise an ImportError that says how to install it."""
    try:
        return import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        raise ImportError(f"{user} needs a package: {installing(package)}") from None


@contextmanager
def open_file(path: Path) -> Iterator[h5py.File]:
    """Open an HDF5 file for reading; raise RunError if its contents are unusable."""
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
    """Open an HDF5 file for reading, even while a simulation is writing to it."""
    if not path.exists():
        part = Path(f"{path}.part")
        hint = f", but there is {part} of an unfinished run" if part.exists() else None
        raise RunError(f"{path}: no such file{hint or similar_file(path, '.h5', Path('runs'))}")
    if not path.is_file():  # opening a FIFO would block
        raise RunError(f"{path}: is a {'folder' if path.is_dir() else 'device'}, not a run")
    try:
        return h5py.File(path, "r", locking=False)
    except PermissionError:
        raise RunError(f"{path}: no permission to read") from None
    except OSError as problem:
        if "locking flag" in str(problem) or "already open" in str(problem):
            remedy = 'close it there first, or open it with h5py.File(path, "r", locking=False)'
            raise RunError(
                f"{path}: this process has opened it to write, or with a lock; {remedy}"
            ) from None
        if path.suffix == ".nml":
            command = f"build/ricochet {path} writes runs/{path.stem}.h5"
            raise RunError(f"{path}: is an input file; give its output: {command}") from None
        if not path.exists():  # just removed, or renamed by the program
            raise RunError(f"{path}: no such file") from None
        state = "is empty" if path.stat().st_size == 0 else "is not an HDF5 file, or is cut short"
        raise RunError(f"{path}: {state}") from None


def did_you_mean(word: str, others: Iterable[str]) -> str:
    """Return a question that suggests the most similar word, or '' if there is none.

    If no word is similar, the shortest one that contains `word` is suggested.
    """
    return "".join(f"; did you mean {name}?" for name in nearest(word, list(others)))


def nearest(word: str, known: list[str]) -> list[str]:
    """Return the most similar word, or else the shortest that contains `word`, as a list."""
    longer = [other for other in known if len(word) > 2 and word.lower() in other.lower()]
    return get_close_matches(word, known, 1) or sorted(longer, key=len)[:1]


def similar_file(path: Path, ending: str, usual: Path) -> str:
    """Return a question that suggests the file whose name is most similar to a missing one's.

    Files with the `ending`, or that of an unfinished output, are considered in the folder of `path`
    and in the `usual` folder.
    """
    there = [
        file
        for folder in (usual, path.parent)
        for end in (f"{ending}.part", ending)
        for file in sorted(folder.glob(f"*{end}"))
    ]
    files = {file.name.partition(ending)[0]: file for file in there}
    near = nearest(path.name.partition(ending)[0], [*files])
    return "".join(f"; did you mean {files[name]}?" for name in near)


def counted(number: int, noun: str) -> str:
    """Return a number and a noun, in the plural unless the number is 1."""
    return f"{number} {noun}" + ("" if number == 1 else "s")


def tree(group: h5py.Group) -> dict[str, Any]:
    """Return the attributes, datasets and subgroups of an HDF5 group as a nested dictionary."""
    values = {name: plain(value) for name, value in group.attrs.items()}
    for name, item in group.items():
        values[name] = tree(item) if isinstance(item, h5py.Group) else plain(item[()])
    return values


def plain(value: object) -> object:
    """Convert bytes to strings, and NumPy scalars to Python numbers."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace").rstrip()
    if isinstance(value, np.ndarray) and value.dtype.kind == "S":
        return [plain(item) for item in value.ravel()]
    return value.item() if isinstance(value, np.generic) else value


def destination(path: Path) -> Path:
    """Create the folder of a result and return its path.

    RunError is raised if the path belongs to something other than an ordinary file, or to an HDF5
    file.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_symlink() or (path.exists() and not path.is_file()):
        raise RunError(f"{path}: is not an ordinary file; choose another name, or remove it")
    if path.exists() and h5py.is_hdf5(path):
        raise RunError(f"{path}: holds HDF5 data, which a result does not replace")
    if path.exists() and path.stat().st_nlink > 1:
        path.unlink()  # other hard links to the file keep its content
    return path


class TemporaryFolder:
    """Temporary folder of an output file, removed when no object refers to it any longer.

    If a worker process returns a run to its parent, the parent removes the folder. If a process
    sends a run to its workers, it removes the folder itself when it ends.
    """

    def __init__(self, path: Path | None = None):
        """Create a folder, or take over the folder of a worker process."""
        self.path = Path(tempfile.mkdtemp(prefix="ricochet-")) if path is None else path
        self.removal = Finalize(self, shutil.rmtree, (self.path, True), exitpriority=PRIORITY)

    def remove(self) -> None:
        """Remove the temporary folder immediately."""
        self.removal()

    def keep(self) -> None:
        """Keep the folder until this process ends."""
        if self.removal.still_active():
            self.removal.cancel()
            Finalize(None, shutil.rmtree, (self.path, True), exitpriority=PRIORITY)

    def __deepcopy__(self, _: object) -> "TemporaryFolder":
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the folder, and determine which process will remove it."""
        in_worker = multiprocessing.parent_process() is not None
        self.removal.cancel() if in_worker else self.keep()
        return received, (self.path, in_worker)


def received(path: Path, sent_by_worker: bool) -> TemporaryFolder | None:
    """Return the folder of a run sent by a worker process, or None if its parent sent it."""
    return TemporaryFolder(path) if sent_by_worker else None
