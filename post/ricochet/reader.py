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

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np

from .files import RunError, Unsound, attribute, find, numbers, open_file, tree, whole

DISKS = "particles/disks"
LONGEST_NAME = 40


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
    momentum_change: np.ndarray | None = None  # (E, 2) of disk i; None where it follows from that


class Obstacle(NamedTuple):
    """A circular wall, which keeps disks out, or in (`inside`)."""

    centre: np.ndarray
    radius: float
    inside: bool


class Species(NamedTuple):
    """The disks of one species; those of a starting file may have masses and radii of their own."""

    name: str
    masses: np.ndarray  # (n,)
    radii: np.ndarray  # (n,)
    disks: np.ndarray  # (N,) mask

    @property
    def alike(self) -> bool:
        """Whether all have one mass and one radius."""
        return bool(np.ptp(self.masses) == 0 and np.ptp(self.radii) == 0)

    @property
    def mass(self) -> float:
        """The mass of each, or their mean."""
        return float(self.masses[0] if self.alike else self.masses.mean())

    @property
    def radius(self) -> float:
        """The radius of each, or their mean."""
        return float(self.radii[0] if self.alike else self.radii.mean())

    @property
    def label(self) -> str:
        """Name and mass, for a legend."""
        return f"{self.name}, m = {span(self.masses)}"


@dataclass(frozen=True)
class Frames:
    """A per-disk quantity in time, read frame by frame when indexed; [:] reads all."""

    path: Path
    name: str
    shape: tuple[int, ...]  # (T, N), or (T, N, 2)

    def __len__(self) -> int:
        return self.shape[0]

    def __array__(self, dtype: object = None, copy: bool | None = None) -> np.ndarray:
        """All frames, for functions of NumPy."""
        if copy is False:
            raise ValueError(f"{self.path}: {self.name} is read from the file, that is copied")
        return self[:] if dtype is None else self[:].astype(dtype)

    def __getitem__(self, frame: int | slice | list[int]) -> np.ndarray:
        try:
            chosen = np.arange(len(self))[frame]
        except IndexError:
            raise RunError(f"{self.path}: no frame {frame}, there are {len(self)}") from None
        steps = np.unique(np.diff(chosen)) if chosen.ndim else ()
        with open_file(self.path) as file:
            data = find(file, f"{DISKS}/{self.name}/value")
            if len(steps) == 1 and steps[0] > 0:
                values = data[chosen[0] : chosen[-1] + 1 : steps[0]]
            elif chosen.ndim and chosen.size:  # far faster than a list as index in h5py
                values = np.stack([data[k] for k in chosen])
            else:
                values = data[chosen] if chosen.size else data[:0]
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            first = chosen[bad[0, 0]] if chosen.ndim else chosen
            raise RunError(f"{self.path}: {self.name}: not all numbers in frame {first} are finite")
        return values.astype(float) if values.dtype.kind == "f" else values

    def __iter__(self) -> Iterator[np.ndarray]:
        return (self[k] for k in range(len(self)))


@dataclass(frozen=True)
class Run:
    """One run: constants as arrays, frames on demand, observables by name."""

    path: Path
    time: np.ndarray  # (T,)
    position: Frames  # (T, N, 2), wrapped into the box along a periodic axis
    velocity: Frames  # (T, N, 2)
    image: Frames | None  # (T, N, 2) how many periods a disk has travelled
    collisions: Frames | None  # (T, N) collisions of any kind since the start
    elements: dict[str, Frames]  # (T, N) what else the disks of this run have, by name
    mass: np.ndarray  # (N,)
    radius: np.ndarray  # (N,)
    species: np.ndarray  # (N,) 1-based
    names: tuple[str, ...]  # of the species
    lower: np.ndarray  # (2,) corner of the box
    edges: np.ndarray  # (2,) lengths of the box
    periodic: np.ndarray  # (2,) bool
    obstacles: tuple[Obstacle, ...]
    walls: np.ndarray  # (W, 2, 2) straight walls, from one point to another
    parameters: dict  # group -> variable -> value, as used
    provenance: dict

    def __repr__(self) -> str:
        """One line, however many disks there are."""
        kinds = ", ".join(f"{np.sum(kind.disks)} {kind.name}" for kind in self.by_species)
        frames = f"{self.frames} frame{'s' * (self.frames > 1)}, t = {span(self.time)}"
        return f"<Run {self.path}: {kinds}; {frames}>"

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
            Species(name, self.mass[mask], self.radius[mask], mask)
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
        """(..., N, 2) position with whole periods added: continuous in time.

        In a sheared box (Lees and Edwards) the image above is displaced by gamma L_y t along x.
        """
        if self.image is None:
            return self.position[frame]
        image = self.image[frame]
        place = self.position[frame] + image * self.edges
        if self.shear_rate != 0:
            slide = self.shear_rate * self.edges[1] * self.time[frame]
            place[..., 0] += image[..., 1] * np.asarray(slide)[..., None]
        return place

    def displacement(self, frame: int | slice | list[int], origin: int = 0) -> np.ndarray:
        """(..., N) straight-line distance from the place in the frame `origin`."""
        return np.linalg.norm(self.unwrapped(frame) - self.unwrapped(origin), axis=-1)

    def element(self, name: str) -> Frames:
        """(T, N) what only some runs have of each disk, such as 'angular_velocity'."""
        if name not in self.elements:
            raise RunError(f"{self.path}: its frames have no {name}")
        return self.elements[name]

    @property
    def angular_velocity(self) -> Frames:
        """(T, N) of disks that can turn."""
        return self.element("angular_velocity")

    @property
    def orientation(self) -> Frames:
        """(T, N) angle to the x axis in radians, not wrapped; of disks that have a direction."""
        return self.element("orientation")

    @property
    def inertia(self) -> np.ndarray:
        """(N,) moments of inertia."""
        return float(self.parameter("contact", "inertia", 0.5)) * self.mass * self.radius**2

    def observable(self, name: str) -> Series:
        """The observable `name`, such as 'total_energy' or 'sides/left/impulse'."""
        with open_file(self.path) as file:
            group = find(file, f"observables/{name}")
            if group is None or find(group, "value") is None:
                raise Unsound(f"has no observable '{name}'")
            count = committed(file, "observables", len(numbers(group, "value")))
            if count == 0:
                raise Unsound("holds no observables yet")
            return Series(rows(group, "time", count), rows(group, "value", count, None))

    @cached_property
    def observables(self) -> tuple[str, ...]:
        """The names that `observable` knows."""
        with open_file(self.path) as file:
            group = find(file, "observables")
            if not isinstance(group, h5py.Group):
                raise Unsound("has no observables")
            return tuple(series_in(group))

    def to_dataframe(self):
        """The observables as a pandas DataFrame, a row per sample, the time as index."""
        from .bridges import observables_frame

        return observables_frame(self)

    @cached_property
    def events(self) -> Events:
        """All collisions; needs `output.event_log = .true.` in the input file."""
        with open_file(self.path) as file:
            if find(file, "events") is None:
                raise Unsound("has no event log, set output.event_log = .true.")
            count = committed(file, "events", len(numbers(file, "events/time")))
            time, impulse = (rows(file, f"events/{name}", count) for name in ("time", "impulse"))
            i, j = (rows(file, f"events/{name}", count, kinds="iu") for name in "ij")
            if np.any(i < 1) or np.any(np.maximum(i, j) > self.count):
                raise Unsound("events of disks that there are not")
            change = find(file, "events/momentum_change")
            if change is not None:
                change = rows(file, "events/momentum_change", count, (2,))
            return Events(time, i, j, impulse, change)

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
    def kicked(self) -> bool:
        """Whether velocities change between collisions, too."""
        return self.parameter("drive", "kind", "none") != "none"

    @property
    def shortcoming(self) -> str:
        """Why this is not a run that went on until a stop rule was met; empty if it is."""
        note = "".join(filter(str.isprintable, str(self.provenance.get("note", ""))))
        if self.path.suffix != ".part":
            return f"{self.path.name} ended early: {note}" if note else ""
        state = f"broke off: {note}" if note else "is unfinished: going on, stopped, or broken off"
        return f"{self.path.name} {state}; last frame at t = {self.time[-1]:.6g}"

    @property
    def seed(self) -> int:
        """Seed of the random number generator."""
        return int(self.parameter("run", "seed", self.parameters.get("seed", 0)))

    @property
    def shear_rate(self) -> float:
        """Gradient along y of the velocity along x; 0 unless the box is sheared."""
        return float(self.parameter("box", "shear_rate", 0.0))

    @property
    def gravity(self) -> np.ndarray:
        """(2,) acceleration of free flight."""
        return np.asarray(self.parameter("box", "gravity", (0.0, 0.0)), dtype=float)


def read_run(path: str | Path) -> Run:
    """Open a run, finished or not.  Raises RunError with a one-line reason."""
    path = Path(path)
    with open_file(path) as file:
        check_format(path, file)
        run = run_of(path, file)
    for frames in (run.position, run.velocity):  # not every script reads them
        frames[[0, -1]]
    return run


def check_format(path: Path, file: h5py.File) -> None:
    """Refuse a file of another kind or of a later version."""
    if path.name.endswith(".chk.h5"):
        raise Unsound("a checkpoint, resume the run or read its .part file")
    h5md = find(file, "h5md")
    version = None if h5md is None else attribute(h5md, "version")
    if version is None or find(file, DISKS) is None:
        raise Unsound("an HDF5 file, but not of a Ricochet run")
    if version[0] != 1:
        raise Unsound(f"H5MD version {version[0]}.{version[1]}, this program reads 1.x")


def run_of(path: Path, file: h5py.File) -> Run:
    """The run in an open file."""
    disks = find(file, DISKS)
    time = numbers(disks, "position/time")
    count, disk_count = committed(file, DISKS, len(time)), len(numbers(disks, "mass", 1))
    if count == 0:
        raise Unsound("holds no frame yet")
    frames = {}
    for name, item in {"position": (2,), "velocity": (2,), "image": (2,), "collisions": ()}.items():
        if name in ("position", "velocity") or find(disks, name) is not None:
            numbers(disks, f"{name}/value", count, (disk_count, *item))
            frames[name] = Frames(path, name, (count, disk_count, *item))
    elements = {
        name: Frames(path, name, (count, disk_count))
        for name in disks
        if name not in (*frames, "box") and find(disks, f"{name}/value") is not None
    }
    for name in elements:
        numbers(disks, f"{name}/value", count, (disk_count,))
    box = find(disks, "box")
    parameters, provenance = (
        {} if group is None else tree(group)
        for group in (find(file, "parameters"), find(file, "provenance"))
    )
    species = rows(disks, "species", disk_count, kinds="iu").astype(int)
    return Run(
        path=path,
        time=rows(disks, "position/time", count),
        position=frames["position"],
        velocity=frames["velocity"],
        image=frames.get("image"),
        collisions=frames.get("collisions"),
        elements=elements,
        mass=positive(rows(disks, "mass", disk_count), "mass"),
        radius=positive(rows(disks, "radius", disk_count), "radius"),
        species=species,
        names=names_of(species, parameters.get("species", {}).get("names")),
        lower=vector(box, "lower", (0.0, 0.0)),
        edges=positive(vector(box, "edges"), "edges"),
        periodic=pair(attribute(box, "boundary"), "boundary") == "periodic",
        obstacles=obstacles_of(parameters.get("obstacle", {})),
        walls=walls_of(parameters.get("wall", {})),
        parameters=parameters,
        provenance=provenance,
    )


def span(values: np.ndarray) -> str:
    """The values in short: the only one, or the smallest and the largest."""
    ends = (f"{values.min():g}", f"{values.max():g}")
    return ends[0] if ends[0] == ends[1] else " to ".join(ends)


def series_in(group: h5py.Group, path: str = "") -> Iterator[str]:
    """The names of the series in a group, and in its groups: of species, of sides and of each."""
    for name in group:
        item = find(group, name)
        if isinstance(item, h5py.Group):
            if find(item, "value") is not None:
                yield path + name
            elif path.count("/") < 2:
                yield from series_in(item, f"{path}{name}/")


def committed(file: h5py.File, group: str, extent: int) -> int:
    """How many of the `extent` samples of a group are valid (a `.part` is allocated ahead)."""
    counter = find(file, f"{group}/committed")
    count = extent if counter is None else int(whole(counter))
    if not 0 <= count <= extent:
        raise Unsound(f"{group}/committed is {count}, but there are {extent} samples")
    return count


def rows(
    group: h5py.Group,
    path: str,
    count: int,
    item: tuple[int, ...] | None = (),
    kinds: str = "iuf",
) -> np.ndarray:
    """The first rows of a dataset."""
    return finite(numbers(group, path, count, item, kinds)[:count], path)


def finite(values: np.ndarray, what: str) -> np.ndarray:
    """The values, those with a fraction in double precision."""
    if values.dtype.kind != "f":
        return values
    if not np.isfinite(values).all():
        raise Unsound(f"{what}: not all numbers are finite")
    return values.astype(float, copy=False)


def positive(values: np.ndarray, what: str) -> np.ndarray:
    """The values, if all are above 0."""
    if not np.all(values > 0):
        raise Unsound(f"{what}: not all numbers are above 0")
    return values


def vector(group: h5py.Group, name: str, default: tuple | None = None) -> np.ndarray:
    """(2,) numbers that are a dataset or an attribute."""
    value = attribute(group, name) if find(group, name) is None else rows(group, name, 2)
    return finite(pair(default if value is None else value, name), name)


def pair(value: object, what: str) -> np.ndarray:
    """The value, if it is two."""
    if np.shape(value) != (2,):
        raise Unsound(f"{what}: not one for each axis")
    return np.asarray(value)


def names_of(species: np.ndarray, names: object) -> tuple[str, ...]:
    """The names of the species (N,), numbered where the file has none."""
    there = np.unique(species)
    if not np.array_equal(there, np.arange(1, len(there) + 1)):
        raise Unsound(f"species from {there[0]} to {there[-1]}, not all from 1 on")
    names = [f"species {k}" for k in there] if names is None else names
    names = tuple(np.atleast_1d(names))
    usual = all(isinstance(name, str) and name.isprintable() and name for name in names)
    if not usual or len(names) != len(there) or max(map(len, names)) > LONGEST_NAME:
        raise Unsound("species without a proper name, or names without disks")
    return names


def obstacles_of(group: dict) -> tuple[Obstacle, ...]:
    """The circular walls in /parameters/obstacle."""
    if "centre" not in group:
        return ()
    centres = finite(np.reshape(group["centre"], (-1, 2)), "obstacle/centre")
    radii = positive(finite(np.atleast_1d(group["radius"]), "obstacle/radius"), "obstacle/radius")
    inside = np.atleast_1d(group["inside"])
    return tuple(
        Obstacle(c, float(r), bool(i)) for c, r, i in zip(centres, radii, inside, strict=True)
    )


def walls_of(group: dict) -> np.ndarray:
    """(W, 2, 2) the straight walls in /parameters/wall."""
    if "from" not in group:
        return np.empty((0, 2, 2))
    ends = [np.reshape(group[end], (-1, 2)) for end in ("from", "to")]
    return finite(np.stack(ends, axis=1), "wall")
