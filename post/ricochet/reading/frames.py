"""Types for per-disk quantities in all frames, and for time series of observables.

Both can be used like arrays in expressions and NumPy functions, as in `run.velocity * 2` or
`run.observable("all/temperature").mean()`.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from .files import RunError, Unsound, did_you_mean, open_file

DISKS = "particles/disks"
WHOLE = (type(None), type(...), bool, np.bool_)  # first indices that do not select frames


class NoSuchFrame(RunError, IndexError):
    """Error for the index of a frame that does not exist."""


class Values(NDArrayOperatorsMixin):
    """Base class of types that act as NumPy arrays in expressions."""

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """Return all values as an array."""
        raise NotImplementedError

    def __array_ufunc__(self, function: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        """Convert the operands to arrays and call the NumPy function."""
        if any(isinstance(item, Values) for item in options.get("out", ())):
            return NotImplemented
        arrays = [np.asarray(item) if isinstance(item, Values) else item for item in inputs]
        return getattr(function, method)(*arrays, **options)

    def mean(self, axis: Any = None, **options: Any) -> Any:
        """Return the mean of all values or along an axis; see `numpy.mean`."""
        return np.asarray(self).mean(axis, **options)

    def std(self, axis: Any = None, **options: Any) -> Any:
        """Return the standard deviation of all values or along an axis; see `numpy.std`."""
        return np.asarray(self).std(axis, **options)

    def sum(self, axis: Any = None, **options: Any) -> Any:
        """Return the sum of all values or along an axis; see `numpy.sum`."""
        return np.asarray(self).sum(axis, **options)

    def min(self, axis: Any = None, **options: Any) -> Any:
        """Return the minimum of all values or along an axis; see `numpy.min`."""
        return np.asarray(self).min(axis, **options)

    def max(self, axis: Any = None, **options: Any) -> Any:
        """Return the maximum of all values or along an axis; see `numpy.max`."""
        return np.asarray(self).max(axis, **options)


class Series(Values):
    """Time series of an observable: times (T,) and values (T, ...).

    The times are usually not those of the frames. Indices, NumPy functions and arithmetic apply to
    the values: `series[-1]` is the last value. `time, value = series` assigns both arrays.

    Parameters
    ----------
    time : numpy.ndarray
        (T,) times
    value : numpy.ndarray
        (T, ...) values

    Examples
    --------
    >>> energy = run.observable("total_energy")
    >>> bool(energy[-1] == energy.value[-1]), len(energy) == len(energy.time)
    (True, True)
    """

    def __init__(self, time: np.ndarray, value: np.ndarray):
        """Create a time series from times and values."""
        self.time, self.value = time, value

    def __len__(self) -> int:
        return len(self.time)

    def __iter__(self) -> Iterator[np.ndarray]:
        """Yield the array of times, then the array of values."""
        return iter((self.time, self.value))

    def __getitem__(self, index: Any) -> Any:
        """Return the values that a NumPy index selects."""
        return self.value[index]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """Return the values as a NumPy array."""
        return np.array(self.value, dtype=dtype, copy=copy)

    def __repr__(self) -> str:
        shape = " x ".join(map(str, self.value.shape))
        when = f", t = {self.time[0]:g} to {self.time[-1]:g}" if len(self) else ""
        return f"<Series of {shape} values{when}>"

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the array of values."""
        return self.value.shape

    @property
    def ndim(self) -> int:
        """Number of axes of the array of values."""
        return self.value.ndim

    @property
    def dtype(self) -> np.dtype[Any]:
        """NumPy type of the values."""
        return self.value.dtype


@dataclass(frozen=True, eq=False)
class Frames(Values):
    """A per-disk quantity in all frames, read from the output file on demand.

    An index such as `[-1]` reads only the selected frames; `[:]`, expressions and NumPy functions
    read all of them.
    """

    path: Path
    name: str
    shape: tuple[int, ...]  # (T, N), or (T, N, 2)
    # keeps a temporary file in existence
    folder: object = field(default=None, repr=False)
    first: int = 0  # index in the file of the first frame
    counted_from: int | None = None  # frame in the file at which the values, counts, are zero

    def part(self, start: int, end: int) -> "Frames":
        """Return the frames from `start` up to, but not including, `end`."""
        return replace(self, shape=(end - start, *self.shape[1:]), first=self.first + start)

    def from_zero(self) -> "Frames":
        """Return the counts since the first frame, in which they are zero."""
        return replace(self, counted_from=self.first)

    def __len__(self) -> int:
        return self.shape[0]

    def __iter__(self) -> Iterator[np.ndarray]:
        """Yield the frames one by one, reading each on demand."""
        return (self[k] for k in range(len(self)))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """Return the quantity in all frames as a NumPy array."""
        if copy is False:
            raise ValueError(
                f"{self.path}: {self.name} is read from the file, which requires a copy"
            )
        return self[:] if dtype is None else self[:].astype(dtype)

    @property
    def ndim(self) -> int:
        """Number of axes of the array."""
        return len(self.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """NumPy type of the values."""
        return self.read(np.arange(0)).dtype

    def __getitem__(self, index: Any) -> np.ndarray:
        """Return the values that a NumPy index selects, reading only the selected frames."""
        first, *rest = index if isinstance(index, tuple) and index else (index,)
        try:
            if type(first) in WHOLE or np.ndim(first) > 1:
                return self.read(np.arange(len(self)))[index]
            chosen = np.arange(len(self))[first]
            if chosen.ndim == 0:
                return self.read(chosen[None])[(0, *rest)]
            whole = slice(None) if isinstance(first, slice) else np.arange(len(chosen))
            return self.read(chosen)[(whole, *rest)]
        except IndexError as problem:
            shape = " x ".join(map(str, self.shape))
            raise NoSuchFrame(f"{self.path}: {self.name} ({shape}): {problem}") from None

    def read(self, chosen: np.ndarray) -> np.ndarray:
        """Read frames from the file, in the order of their indices in `chosen`."""
        steps, chosen = np.unique(np.diff(chosen)), chosen + self.first
        with open_file(self.path) as file:
            if self.name not in file[DISKS]:
                raise Unsound(f"has no {self.name} in its frames, see output.frame_columns")
            data = file[f"{DISKS}/{self.name}/value"]
            if len(chosen) == 0:
                values = data[:0]
            elif len(steps) == 1 and steps[0] > 0:
                values = data[chosen[0] : chosen[-1] + 1 : steps[0]]
            else:  # much faster than indexing with a list in h5py
                values = np.stack([data[k] for k in chosen])
            if self.counted_from is not None:
                values = values - data[self.counted_from]
        return values.astype(float if values.dtype.kind == "f" else np.int64)


# --- time series in an output file ---


def series_in(group: h5py.Group, path: str = "") -> Iterator[str]:
    """Yield the names of all time series in an HDF5 group and its subgroups."""
    for name, item in group.items():
        if isinstance(item, h5py.Group):
            if "value" in item:
                yield path + name
            else:
                yield from series_in(item, f"{path}{name}/")


def series_of(file: h5py.File, name: str, count: int) -> Series:
    """Return the first `count` samples of an observable in an open HDF5 file."""
    if f"observables/{name}/value" not in file:
        near = did_you_mean(name, series_in(file["observables"]))
        raise Unsound(f"has no observable '{name}'{near}")
    if count == 0:
        raise Unsound("holds no observables yet")
    group = file[f"observables/{name}"]
    return Series(*(rows(group[part], count) for part in ("time", "value")))


def committed(file: h5py.File, group: str) -> int:
    """Return the number of complete samples in a group, which may have space for further ones."""
    return int(file[group]["committed"][()])


def rows(data: h5py.Dataset, count: int | None = None) -> np.ndarray:
    """Return the first `count` rows of a dataset, or all; real numbers in double precision."""
    values = data[:count]
    if count is not None and len(values) < count:
        raise Unsound(f"{data.name} holds {len(values)} of {count} samples")
    return values.astype(float, copy=False) if values.dtype.kind == "f" else values
