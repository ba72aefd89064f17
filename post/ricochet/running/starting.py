"""Initial-configuration files: text files with arrays of disks, named by `species.file`."""

import functools
import itertools
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..reading.files import TemporaryFolder, counted, destination

SPECIES = re.compile(r"[1-9]\d*|[A-Za-z][A-Za-z0-9_-]{0,39}")  # as the program reads it

#: Columns of an initial-configuration file that are named differently from the arrays.
TURNING = {"angular_velocity": "omega", "orientation": "angle"}

#: Variables of a species (besides position and velocity) that may differ from disk to disk.
PER_DISK = ("radius", "mass", "angular_velocity", "orientation")
NUMBERS = itertools.count(1)


def with_start(group: Mapping[str, Any], place: Path | None) -> Mapping[str, Any]:
    """Return a species whose arrays have been written to an initial-configuration file.

    The path of the file begins with `place`. If `place` is None, the file is removed when this
    process ends.
    """
    columns = {name: group[name] for name in PER_DISK if np.size(group.get(name, 0)) > 1}
    if not columns:
        return group
    if "position" not in group:
        raise TypeError(f"species.{min(columns)}: values for each disk need a position for each")
    position = np.reshape(real_numbers("position", group["position"]), (-1, 2))
    rest = {name: group[name] for name in group.keys() - columns.keys() - {"position", "velocity"}}
    if "velocity" in group:
        velocity = np.reshape(real_numbers("velocity", group["velocity"]), (-1, 2))
        columns["velocity"] = np.broadcast_to(velocity, position.shape)
        rest["velocities"] = "file"
    name = f"start-{group.get('name', 'disks')}.txt"
    path = place.with_name(f"{place.name}.{name}") if place else kept() / f"{next(NUMBERS)}.{name}"
    return rest | {"file": str(write_start(path.absolute(), position, **columns))}


@functools.cache
def kept() -> Path:
    """Return a folder that is removed when this process ends."""
    folder = TemporaryFolder()
    folder.keep()
    return folder.path


def write_start(
    path: str | Path,
    position: ArrayLike,
    velocity: ArrayLike | None = None,
    radius: ArrayLike | None = None,
    mass: ArrayLike | None = None,
    species: ArrayLike | None = None,
    angular_velocity: ArrayLike | None = None,
    orientation: ArrayLike | None = None,
) -> Path:
    """Write an initial-configuration file, which `species.file` in an input can name.

    The input determines all quantities that the file lacks. Numbers have 17 significant digits and
    are therefore read back exactly. `write_start("bed.txt", **np.load("a.npz"))` converts a NumPy
    file.

    Parameters
    ----------
    path : str or Path
        text file to write
    position : array_like
        (N, 2) [length]
    velocity : array_like, optional
        (N, 2) [length/time]
    radius, mass : array_like, optional
        (N,), or one value for all disks
    species : array_like, optional
        (N,), or one value for all disks: names, or positions in the input, counted from 1
    angular_velocity, orientation : array_like, optional
        (N,), or one value for all disks [1/time], [rad]

    Returns
    -------
    Path
        path of the file

    Raises
    ------
    ValueError
        if an array has a wrong shape, or values that are not allowed

    Examples
    --------
    >>> path = ricochet.write_start(folder / "start.txt", run.position[-1], run.velocity[-1])
    >>> len(path.read_text().splitlines())
    65
    """
    position = table("position", position, width=2)
    columns = {"x": position[:, 0], "y": position[:, 1]}
    if velocity is not None:
        velocity = table("velocity", velocity, len(position), 2)
        columns |= {"vx": velocity[:, 0], "vy": velocity[:, 1]}
    for name, values in {"angular_velocity": angular_velocity, "orientation": orientation}.items():
        if values is not None:
            columns[TURNING[name]] = table(name, values, len(position))
    for name, values in {"radius": radius, "mass": mass}.items():
        if values is not None:
            columns[name] = table(name, values, len(position))
            if not np.all(columns[name] > 0):
                raise ValueError(f"{name}: not all numbers are above 0")
    words = [[f"{value:.17g}" for value in values] for values in columns.values()]
    if species is not None:
        words.append([str(name) for name in sized("species", np.asarray(species), len(position))])
        for name in set(words[-1]):
            if not SPECIES.fullmatch(name):
                raise ValueError(
                    f"species: {name!r} is neither a number from 1 nor a name: a letter, then "
                    "up to 39 letters, digits, _ and -"
                )
    path = destination(Path(path))
    with path.open("w", encoding="utf-8") as file:
        file.write(" ".join([*columns, "species"][: len(words)]) + "\n")
        file.writelines(" ".join(row) + "\n" for row in zip(*words, strict=True))
    return path


def table(name: str, values: ArrayLike, count: int | None = None, width: int = 0) -> np.ndarray:
    """Return finite numbers as an array of shape (count, width), or (count,) if width is 0."""
    values = real_numbers(name, values)
    if width and (values.ndim != 2 or values.shape[1] != width):
        raise ValueError(f"{name}: of shape {values.shape}, not (N, {width})")
    values = sized(name, values, len(values) if count is None else count)
    if not np.isfinite(values).all():
        raise ValueError(f"{name}: not all numbers are finite")
    return values


def real_numbers(name: str, values: ArrayLike) -> np.ndarray:
    """Return an array of real numbers; raise ValueError for any others, including complex ones."""
    values = np.asarray(values)
    if values.dtype.kind not in "iuf":
        raise ValueError(f"{name}: not an array of real numbers")
    return values


def sized(name: str, values: np.ndarray, count: int) -> np.ndarray:
    """Return an array of `count` values, repeating a single value."""
    if values.ndim == 0:
        return np.full(count, values)
    if len(values) != count or count == 0:
        raise ValueError(f"{name}: of {counted(len(values), 'disk')}, not of {max(count, 1)}")
    return values
