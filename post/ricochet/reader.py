"""Read a Ricochet run: the only module that knows the layout of the HDF5 file.

    from ricochet import read_run
    run = read_run("runs/gas.h5")
    run.time                 # (T,)    times of the frames
    run.position[-1]         # (N, 2)  one frame, read from the file on demand
    run.speed(-1)            # (N,)    derived quantities take a frame, a slice or a list
    run.observable("all/kinetic_energy").value

T frames, N disks, S species.  All quantities are in the units of the input file ("reduced units").
Frames are read on demand, so a file may be larger than memory.  A file that is still being written
(`.part`) is read up to its last committed frame.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np

DISKS = "particles/disks"


class RunError(Exception):
    """A file that cannot be used; the message is one line that says what and where."""


class Series(NamedTuple):
    """An observable: `value` (T, ...) at `time` (T,), on its own clock."""

    time: np.ndarray
    value: np.ndarray


class Events(NamedTuple):
    """The event log: collisions of any kind in chronological order, (E,) each.

    `j` is the id of the other disk, or 0, -1, -2, -3 for the left, right, bottom and top side, then
    -4, -5, ... for the obstacles followed by the straight walls.
    """

    time: np.ndarray
    i: np.ndarray  # id of a disk
    j: np.ndarray
    impulse: np.ndarray  # magnitude of the change of momentum


class Obstacle(NamedTuple):
    """A circular wall, which keeps disks out, or in (`inside`)."""

    centre: np.ndarray
    radius: float
    inside: bool


class Species(NamedTuple):
    """What the disks of one species have in common."""

    name: str
    mass: float
    radius: float
    disks: np.ndarray  # (N,) mask

    @property
    def label(self) -> str:
        """Name and mass, for a legend."""
        return f"{self.name}, m = {self.mass:g}"


@dataclass(frozen=True)
class Frames:
    """A per-disk quantity in time, (T, N, ...), read frame by frame when indexed."""

    path: Path
    name: str
    count: int

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, frame: int | slice | list[int]) -> np.ndarray:
        try:
            chosen = np.arange(self.count)[frame]
        except IndexError:
            raise RunError(f"{self.path}: no frame {frame}, there are {self.count}") from None
        steps = np.unique(np.diff(chosen)) if chosen.ndim else ()
        with open_file(self.path) as file:
            data = file[f"{DISKS}/{self.name}/value"]
            if len(steps) == 1 and steps[0] > 0:
                values = data[chosen[0] : chosen[-1] + 1 : steps[0]]
            elif chosen.ndim and chosen.size:  # far faster than a list as index in h5py
                values = np.stack([data[k] for k in chosen])
            else:
                values = data[chosen] if chosen.size else data[:0]
        return values.astype(float) if values.dtype.kind == "f" else values

    def __iter__(self) -> Iterator[np.ndarray]:
        return (self[k] for k in range(self.count))


@dataclass(frozen=True)
class Run:
    """One run: constants as arrays, frames on demand, observables by name."""

    path: Path
    time: np.ndarray  # (T,)
    position: Frames  # (T, N, 2), wrapped into the box along a periodic axis
    velocity: Frames  # (T, N, 2)
    image: Frames | None  # (T, N, 2) how many periods a disk has travelled
    collisions: Frames | None  # (T, N) collisions of any kind since the start
    mass: np.ndarray  # (N,)
    radius: np.ndarray  # (N,)
    species: np.ndarray  # (N,) 1-based
    names: tuple[str, ...]  # of the species
    lower: np.ndarray  # (2,) corner of the box
    edges: np.ndarray  # (2,) lengths of the box
    periodic: np.ndarray  # (2,) bool
    obstacles: tuple[Obstacle, ...]
    walls: np.ndarray  # (W, 2, 2) straight walls, from one point to another
    parameters: dict = field(repr=False)  # group -> variable -> value, as used
    provenance: dict = field(repr=False)

    @property
    def count(self) -> int:
        """N, the number of disks."""
        return len(self.mass)

    @property
    def frames(self) -> int:
        """T, the number of frames."""
        return len(self.time)

    @property
    def upper(self) -> np.ndarray:
        """(2,) upper right corner of the box."""
        return self.lower + self.edges

    @cached_property
    def by_species(self) -> tuple[Species, ...]:
        """The species in the order of the input file."""
        masks = [self.of_species(name) for name in self.names]
        return tuple(
            Species(name, float(self.mass[mask][0]), float(self.radius[mask][0]), mask)
            for name, mask in zip(self.names, masks, strict=True)
        )

    def of_species(self, name: str) -> np.ndarray:
        """(N,) mask of the disks of one species."""
        if name not in self.names:
            raise RunError(f"{self.path}: no species '{name}', there are {', '.join(self.names)}")
        return self.species == self.names.index(name) + 1

    def speed(self, frame: int | slice | list[int]) -> np.ndarray:
        """(..., N) length of the velocity."""
        return np.linalg.norm(self.velocity[frame], axis=-1)

    def kinetic_energy(self, frame: int | slice | list[int]) -> np.ndarray:
        """(..., N) m v^2 / 2."""
        return 0.5 * self.mass * np.sum(self.velocity[frame] ** 2, axis=-1)

    def unwrapped(self, frame: int | slice | list[int]) -> np.ndarray:
        """(..., N, 2) position with whole periods added: continuous in time."""
        if self.image is None:
            return self.position[frame]
        return self.position[frame] + self.image[frame] * self.edges

    def displacement(self, frame: int | slice | list[int], origin: int = 0) -> np.ndarray:
        """(..., N) straight-line distance from the place in the frame `origin`."""
        return np.linalg.norm(self.unwrapped(frame) - self.unwrapped(origin), axis=-1)

    def observable(self, name: str) -> Series:
        """The observable `name`, such as 'total_energy' or 'all/kinetic_energy'."""
        with open_file(self.path) as file:
            group = file.get(f"observables/{name}")
            if not isinstance(group, h5py.Group) or "value" not in group:
                raise RunError(f"{self.path}: has no observable '{name}'")
            count = committed(file, "observables", group["value"].shape[0])
            if count == 0:
                raise RunError(f"{self.path}: holds no observables yet")
            return Series(*(checked(group[part], count)[:count] for part in Series._fields))

    @cached_property
    def events(self) -> Events:
        """All collisions; needs `output.event_log = .true.` in the input file."""
        with open_file(self.path) as file:
            if "events" not in file:
                raise RunError(f"{self.path}: has no event log, set output.event_log = .true.")
            count = committed(file, "events", file["events/time"].shape[0])
            events = (checked(file[f"events/{part}"], count, ()) for part in Events._fields)
            return Events(*(data[:count] for data in events))

    @cached_property
    def collisions_per_disk(self) -> Series:
        """2 C / N, C the pair collisions since the start, at the times of the observables."""
        time, collisions = self.observable("collisions")
        return Series(time, 2 * collisions / self.count)

    def collisions_per_disk_at(self, time: np.ndarray) -> np.ndarray:
        """The same at other times, by linear interpolation."""
        return np.interp(time, *self.collisions_per_disk)

    def parameter(self, group: str, variable: str, default: object = None) -> object:
        """A variable of the input file as it was used."""
        return self.parameters.get(group, {}).get(variable, default)

    @property
    def restitution(self) -> float:
        """Restitution of disk on disk; NaN if it differs between pairs of species."""
        one = self.parameter("contact", "restitution", 1.0)
        pairs = self.parameter("contact", "pair_restitution", one)
        values = np.unique(np.asarray(pairs, dtype=float))
        return float(values[0]) if len(values) == 1 else np.nan

    @property
    def time_step(self) -> float:
        """The dt of a run by time steps; 0 for an event-driven one."""
        steps = self.parameter("run", "dynamics", "events") == "steps"
        return float(self.parameter("run", "dt")) if steps else 0.0

    @property
    def seed(self) -> int:
        """Seed of the random number generator."""
        return int(self.parameter("run", "seed", self.parameters.get("seed", 0)))

    @property
    def gravity(self) -> np.ndarray:
        """(2,) acceleration of free flight."""
        return np.asarray(self.parameter("box", "gravity", (0.0, 0.0)), dtype=float)


def read_run(path: str | Path) -> Run:
    """Open a run, finished or not.  Raises RunError with a one-line reason."""
    path = Path(path)
    with open_file(path) as file:
        check_format(path, file)
        return run_of(path, file)


@contextmanager
def open_file(path: Path) -> Iterator[h5py.File]:
    """The HDF5 file for reading; any fault found in it becomes a RunError."""
    with hdf5_file(path) as file:
        try:
            yield file
        except KeyError as problem:
            raise RunError(f"{path}: not a complete Ricochet run, {problem.args[0]}") from None
        except (OSError, RuntimeError, MemoryError):
            raise RunError(f"{path}: the file is damaged") from None
        except (AttributeError, IndexError, TypeError, ValueError):
            raise RunError(f"{path}: not laid out as a Ricochet run, or damaged") from None


def hdf5_file(path: Path) -> h5py.File:
    """The open file, also while a simulation writes it."""
    if not path.exists():
        part = Path(f"{path}.part")
        near = (f"{other}" for other in path.parent.glob("*.h5*") if ".chk." not in other.name)
        hint = f", but there is {part} of an unfinished run" if part.exists() else None
        hint = hint or did_you_mean(str(path), near)
        raise RunError(f"{path}: no such file{hint}")
    if path.is_dir():
        raise RunError(f"{path}: is a folder, not a run")
    try:
        return h5py.File(path, "r", locking=False)
    except PermissionError:
        raise RunError(f"{path}: no permission to read") from None
    except OSError:
        state = "is empty" if path.stat().st_size == 0 else "is not an HDF5 file, or is cut short"
        raise RunError(f"{path}: {state}") from None


def did_you_mean(word: str, others: Iterable[str]) -> str:
    """A suggestion, if one of the others is like the word."""
    return "".join(f"; did you mean {near}?" for near in get_close_matches(word, others, 1))


def checked(data: h5py.Dataset, count: int, item: tuple[int, ...] | None = None) -> h5py.Dataset:
    """The dataset, if it holds at least `count` numbers, or arrays of the shape `item`."""
    usual = data.dtype.kind in "iuf" and data.dtype.itemsize <= 8
    if not usual or len(data) < count or item not in (None, data.shape[1:]):
        raise ValueError(f"{data.name}: not {count} numbers, or arrays of the shape {item}")
    return data


def check_format(path: Path, file: h5py.File) -> None:
    """Refuse a file of another kind or of a later version."""
    version = file["h5md"].attrs.get("version") if "h5md" in file else None
    if path.name.endswith(".chk.h5"):
        raise RunError(f"{path}: a checkpoint, resume the run or read its .part file")
    if version is None or DISKS not in file:
        raise RunError(f"{path}: an HDF5 file, but not of a Ricochet run")
    if version[0] != 1:
        raise RunError(f"{path}: H5MD version {version[0]}.{version[1]}, this program reads 1.x")


def run_of(path: Path, file: h5py.File) -> Run:
    """The run in an open file."""
    disks = file[DISKS]
    count = committed(file, DISKS, disks["position/value"].shape[0])
    if count == 0:
        raise RunError(f"{path}: holds no frame yet")
    box, mass = disks["box"], checked(disks["mass"], 1, ())[:]
    parameters = tree(file["parameters"]) if "parameters" in file else {}
    species = checked(disks["species"], len(mass), ())[:].astype(int)
    names = parameters.get("species", {}).get("names")
    frames = {}
    for name, item in {"position": (2,), "velocity": (2,), "image": (2,), "collisions": ()}.items():
        if name in disks:
            checked(disks[name]["value"], count, (len(mass), *item))
            frames[name] = Frames(path, name, count)
    return Run(
        path=path,
        time=checked(disks["position/time"], count, ())[:count],
        position=frames["position"],
        velocity=frames["velocity"],
        image=frames.get("image"),
        collisions=frames.get("collisions"),
        mass=mass,
        radius=checked(disks["radius"], len(mass), ())[:],
        species=species,
        names=tuple(np.atleast_1d(names)) if names is not None else default_names(species),
        lower=vector(box, "lower", np.zeros(2)),
        edges=vector(box, "edges", None),
        periodic=np.array([plain(b) == "periodic" for b in box.attrs["boundary"]]),
        obstacles=obstacles_of(parameters.get("obstacle", {})),
        walls=walls_of(parameters.get("wall", {})),
        parameters=parameters,
        provenance=tree(file["provenance"]) if "provenance" in file else {},
    )


def committed(file: h5py.File, group: str, extent: int) -> int:
    """How many of the `extent` samples of a group are valid (a `.part` is allocated ahead)."""
    counter = file[group].get("committed")
    return extent if counter is None else max(0, min(extent, int(counter[()])))


def default_names(species: np.ndarray) -> tuple[str, ...]:
    """Names for species that have none."""
    return tuple(f"species {k + 1}" for k in range(species.max(initial=1)))


def obstacles_of(group: dict) -> tuple[Obstacle, ...]:
    """The circular walls in /parameters/obstacle."""
    if "centre" not in group:
        return ()
    centres = np.reshape(group["centre"], (-1, 2)).astype(float)
    radii, inside = np.atleast_1d(group["radius"]), np.atleast_1d(group["inside"])
    return tuple(
        Obstacle(c, float(r), bool(i)) for c, r, i in zip(centres, radii, inside, strict=True)
    )


def walls_of(group: dict) -> np.ndarray:
    """(W, 2, 2) the straight walls in /parameters/wall."""
    if "from" not in group:
        return np.empty((0, 2, 2))
    ends = [np.reshape(group[end], (-1, 2)).astype(float) for end in ("from", "to")]
    return np.stack(ends, axis=1)


def vector(group: h5py.Group, name: str, default: np.ndarray | None) -> np.ndarray:
    """A small vector that is a dataset or an attribute."""
    if name in group:
        return checked(group[name], 2, ())[:]
    if name in group.attrs or default is None:
        return np.asarray(group.attrs[name])
    return default


def tree(group: h5py.Group) -> dict:
    """A group as a dictionary of plain values; attributes and datasets alike."""
    values = {name: plain(value) for name, value in group.attrs.items()}
    for name, item in group.items():
        values[name] = tree(item) if isinstance(item, h5py.Group) else plain(item[()])
    return values


def plain(value: object) -> object:
    """Text instead of bytes, Python numbers instead of arrays without an axis."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace").rstrip()
    if isinstance(value, np.ndarray) and value.dtype.kind in "SO":
        return [plain(item) for item in value.ravel()]
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        return plain(value.item())
    return value
