"""Layout of the time series in an output file (HDF5)."""

from collections.abc import Iterator

import h5py
import numpy as np

from .files import Unsound, did_you_mean
from .frames import Series


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
