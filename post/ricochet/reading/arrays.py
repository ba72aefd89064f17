"""Types of arrays and of indices that functions of the package accept."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

#: Chooses frames: a number, which counts from the end if it is negative, a slice, or a list.
Index = int | slice | Sequence[int] | np.ndarray
#: A number, or an array of numbers at which a formula is evaluated.
Number = TypeVar("Number", float, np.ndarray)


def as_index(index: Index) -> int | slice | np.ndarray:
    """Return an index as NumPy understands it along one axis, also of a tuple or a range."""
    if isinstance(index, int | np.integer | slice):
        return index if isinstance(index, slice) else int(index)
    array = np.asarray(index)
    return array if len(array) else array.astype(np.int64)


def chosen(count: int, index: Index) -> list[int]:
    """Return the numbers, from 0, that an index chooses among `count` things."""
    found: list[int] = np.atleast_1d(np.arange(count)[as_index(index)]).tolist()
    return found
