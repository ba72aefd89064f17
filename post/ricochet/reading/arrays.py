"""Types of arrays and indices used by the functions of this package."""

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

#: Selection of frames: an integer, a slice or a list. Negative integers count from the last frame.
Index = int | slice | Sequence[int] | np.ndarray
#: Argument of a formula: a number or an array.
Number = TypeVar("Number", float, np.ndarray)


def as_index(index: Index) -> int | slice | np.ndarray:
    """Convert an integer, slice, list, tuple or range to an index of one axis of an array."""
    if isinstance(index, int | np.integer | slice):
        return index if isinstance(index, slice) else int(index)
    array = np.asarray(index)
    return array if len(array) else array.astype(np.int64)


def chosen(count: int, index: Index) -> list[int]:
    """Return the indices, from 0 to `count` - 1, of the items that an index selects."""
    found: list[int] = np.atleast_1d(np.arange(count)[as_index(index)]).tolist()
    return found


def in_place(function: np.ufunc, name: str) -> Any:
    """Return an in-place operator that returns a new array if its operand is read-only."""

    def operator(self: "Snapshot", other: Any) -> np.ndarray:
        if self.flags.writeable:
            getattr(np.ndarray, name)(self, other)
            return self
        return np.asarray(function(self, other))

    return operator


class Snapshot(np.ndarray):
    """Read-only copy of an array of a simulation, such as the velocities at one time.

    In-place operators return a new array, so that `box.velocity *= 2` is equivalent to
    `box.velocity = box.velocity * 2` and sets the velocities of the simulation. Other expressions
    return ordinary arrays.
    """

    __iadd__ = in_place(np.add, "__iadd__")
    __isub__ = in_place(np.subtract, "__isub__")
    __imul__ = in_place(np.multiply, "__imul__")
    __itruediv__ = in_place(np.true_divide, "__itruediv__")
    __ifloordiv__ = in_place(np.floor_divide, "__ifloordiv__")
    __imod__ = in_place(np.remainder, "__imod__")
    __ipow__ = in_place(np.power, "__ipow__")
    __imatmul__ = in_place(np.matmul, "__imatmul__")

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        """Convert the result of a NumPy function to an ordinary array or number."""
        return array[()] if return_scalar else np.asarray(array)

    def __setitem__(self, index: Any, value: Any) -> None:
        """Raise an error, because assignment to this copy would not change the simulation."""
        if not self.flags.writeable:
            raise ValueError(
                "read-only: this array is a copy of the simulation's; change a copy of it, and "
                "assign that, as in v = box.velocity.copy(); v[0] = 1, 0; box.velocity = v"
            )
        super().__setitem__(index, value)


def snapshot(values: np.ndarray) -> Snapshot:
    """Convert an array to a read-only `Snapshot`."""
    found = values.view(Snapshot)
    found.flags.writeable = False
    return found
