"""Types of arrays and of indices that functions of the package accept or return."""

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

#: Index that selects frames: a number (from the end if it is negative), a slice, or a list.
Index = int | slice | Sequence[int] | np.ndarray
#: Argument of a formula: a number or an array of numbers.
Number = TypeVar("Number", float, np.ndarray)


def as_index(index: Index) -> int | slice | np.ndarray:
    """Return an index in a form that NumPy accepts for one axis, also from a tuple or range."""
    if isinstance(index, int | np.integer | slice):
        return index if isinstance(index, slice) else int(index)
    array = np.asarray(index)
    return array if len(array) else array.astype(np.int64)


def chosen(count: int, index: Index) -> list[int]:
    """Return the numbers (from 0) that an index selects among `count` items."""
    found: list[int] = np.atleast_1d(np.arange(count)[as_index(index)]).tolist()
    return found


def in_place(function: np.ufunc, name: str) -> Any:
    """Return an in-place operator that does not modify a read-only array."""

    def operator(self: "Snapshot", other: Any) -> np.ndarray:
        if self.flags.writeable:
            getattr(np.ndarray, name)(self, other)
            return self
        return np.asarray(function(self, other))

    return operator


class Snapshot(np.ndarray):
    """An array of a simulation at one time, which is read-only because it is a copy.

    `box.velocity *= 2` is `box.velocity = box.velocity * 2`: the in-place operators return a new
    array, which the simulation accepts.  Results of expressions are ordinary arrays.
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
        """Return the result of a function of NumPy as an ordinary array or number."""
        return array[()] if return_scalar else np.asarray(array)

    def __setitem__(self, index: Any, value: Any) -> None:
        """Raise an error, because an assignment would change only a copy."""
        if not self.flags.writeable:
            raise ValueError(
                "read-only: this array is a copy of the simulation's; change a copy of it, and "
                "assign that, as in v = box.velocity.copy(); v[0] = 1, 0; box.velocity = v"
            )
        super().__setitem__(index, value)


def snapshot(values: np.ndarray) -> Snapshot:
    """Return an array as a read-only array of a simulation."""
    found = values.view(Snapshot)
    found.flags.writeable = False
    return found
