"""Read output files of Ricochet.

Only this module depends on the layout of the HDF5 file.

    from ricochet import read_run
    run = read_run("runs/gas.h5")
    run.time                 # (T,)    times of the frames
    run.position[-1]         # (N, 2)  one frame, read from the file on demand
    run.speed(-1)            # (N,)    derived quantities take a frame, a slice or a list
    run.observable("all/kinetic_energy").value

T is the number of frames, N the number of disks, and S the number of species.  All quantities are
in the units of the input file ("reduced units").  Frames are read on demand, so a file may be
larger than the memory of the computer.  A `.part` file, which the program is still writing, is read
up to its last complete frame.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import h5py
import numpy as np

from .arrays import Index, as_index
from .files import RunError, Unsound, did_you_mean, open_file, tree
from .frames import DISKS, Frames, NoSuchFrame, Series
from .nature import TRAITS, Nature, allow, nature_of
from .units import UNNAMED, Units

if TYPE_CHECKING:
    import pandas
    import xarray

SIDES = ("left", "right", "bottom", "top")
TENSORS = ("virial_tensor", "kinetic_tensor", "helfand_stress")
DRIFTING = (
    "constant_velocity",
    "piston",
)  # motions of a side that change the area of the box permanently


class EventLog(NamedTuple):
    """Arrays (E,) that describe the E events of a run in chronological order.

    An event is a collision of disk `i` with another disk or with a boundary.  If `j` is positive,
    `j` is the id of the second disk.  The values 0, -1, -2 and -3 of `j` denote the left, right,
    bottom and top side of the box.  The values -4, -5, ... denote first the circular obstacles,
    then the straight walls.  `momentum_change` is the momentum change of disk `i`.
    """

    time: np.ndarray
    i: np.ndarray  # id of a disk
    j: np.ndarray
    impulse: np.ndarray  # magnitude of the change of momentum
    momentum_change: np.ndarray | None = None  # (E, 2) of disk i; None in files of older versions


class Event(NamedTuple):
    """One event, described by the same quantities as in `EventLog`."""

    time: float
    i: int  # id of a disk
    j: int
    impulse: float  # magnitude of the change of momentum
    momentum_change: np.ndarray  # (2,) of disk i


class Obstacle(NamedTuple):
    """A circular obstacle, which encloses the disks if `inside` is true."""

    centre: np.ndarray
    radius: float
    inside: bool


class Species(NamedTuple):
    """The disks of one species.

    Masses and radii can differ within a species if a starting file specifies them.
    """

    name: str
    masses: np.ndarray  # (n,)
    radii: np.ndarray  # (n,)
    disks: np.ndarray  # (N,) mask

    @property
    def alike(self) -> bool:
        """True if all disks of the species have the same mass and the same radius."""
        return bool(np.ptp(self.masses) == 0 and np.ptp(self.radii) == 0)

    @property
    def mass(self) -> float:
        """Mass of each disk, or the mean mass if the masses of the disks differ."""
        return float(self.masses[0] if self.alike else self.masses.mean())

    @property
    def radius(self) -> float:
        """Radius of each disk, or the mean radius if the radii of the disks differ."""
        return float(self.radii[0] if self.alike else self.radii.mean())

    @property
    def label(self) -> str:
        """Name of the species and mass of its disks, for the legend of a figure."""
        return f"{self.name}, m = {span(self.masses)}"


class Restitution(NamedTuple):
    """Coefficient of normal restitution of a pair of disks.

    If `law` is "constant", the coefficient is `xi` for all impact velocities.  Otherwise the
    coefficient depends on the impact velocity below `speed`, and is `xi` above `speed`.
    """

    xi: float
    law: str = "constant"
    speed: float = 0.0  # g0

    def __format__(self, spec: str) -> str:
        soft = f" {self.law} below {self.speed:g}" if self.law != "constant" else ""
        return f"{self.xi:{spec}}{soft}"

    @property
    def name(self) -> float | str:
        """The coefficient if it is constant; otherwise a text that names the law."""
        return self.xi if self.law == "constant" else f"{self:g}"

    def at(self, g: np.ndarray) -> np.ndarray:
        """Return the coefficients of restitution for an array `g` of normal impact velocities.

        The coefficient is 1 - y + c y^2, where y is proportional to g^(1/5): see Ramirez et al.,
        Phys. Rev. E 60, 4465 (1999).
        """
        c = {"power": 0.0, "viscoelastic": 0.6}[self.law]
        y = 2 * (1 - self.xi) / (1 + np.sqrt(1 - 4 * c * (1 - self.xi)))
        y = y * np.minimum(g / self.speed, 1.0) ** 0.2
        return 1 - y + c * y**2


@dataclass(frozen=True)
class Run:
    """The results of one run: arrays of constants, frames, and time series of observables.

    `read_run` returns a `Run`.  T is the number of frames and N the number of disks.  All
    quantities are in the units of the input file.
    """

    path: Path
    time: np.ndarray  # (T,)
    position: Frames  # (T, N, 2), wrapped into the box along a periodic axis
    velocity: Frames  # (T, N, 2); not available if `output.frame_columns` omits it
    image: Frames | None  # (T, N, 2) periods crossed; None without periodic sides
    event_count: Frames | None  # (T, N) numbers per disk; None if not in the frames
    disk_data: dict[str, Frames]  # (T, N) further quantities of the disks, by name
    mass: np.ndarray  # (N,)
    radius: np.ndarray  # (N,)
    species: np.ndarray  # (N,) 1-based
    names: tuple[str, ...]  # of the species
    lower: np.ndarray  # (2,) corner of the box
    edges: np.ndarray  # (2,) lengths of the box
    periodic: np.ndarray  # (2,) bool
    obstacles: tuple[Obstacle, ...]
    walls: np.ndarray  # (W, 2, 2) straight walls, from one point to another
    parameters: dict[str, Any]  # group -> variable -> value used in the run
    provenance: dict[str, Any]
    units: Units = field(default=UNNAMED, kw_only=True)  # names of the units for labels of axes
    _folder: object = field(default=None, kw_only=True, repr=False)  # keeps a temporary file

    def __repr__(self) -> str:
        """Return a description of the run in one line."""
        kinds = ", ".join(f"{np.sum(kind.disks)} {kind.name}" for kind in self.by_species)
        frames = f"{self.n_frames} frame{'s' * (self.n_frames > 1)}, t = {span(self.time)}"
        return f"<Run {self.path}: {kinds}; {frames}>"

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)

    def __getitem__(self, frame: int) -> "Frame":
        """Return the frame with the given number; the last frame also has the number -1."""
        if not -len(self) <= frame < len(self):
            raise NoSuchFrame(f"{self.path}: there is no frame {frame} of {len(self)}")
        return Frame(self, frame % len(self))

    def __iter__(self) -> "Iterator[Frame]":
        """Yield the frames in chronological order."""
        return (Frame(self, k) for k in range(len(self)))

    @property
    def n_disks(self) -> int:
        """Number of disks, N."""
        return len(self.mass)

    @property
    def n_frames(self) -> int:
        """Number of frames, T."""
        return len(self.time)

    @property
    def upper(self) -> np.ndarray:
        """Coordinates (2,) of the upper right corner of the box."""
        return self.lower + self.edges

    @property
    def sides(self) -> list[dict[str, Any]]:
        """Input variables of each side of the box, in the order of `SIDES`."""
        return [self.parameters.get("side", {}).get(name, {}) for name in SIDES]

    def corners_at(self, time: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners of the box at the given times.

        If sides of the box move, the corners depend on time.  The position of a piston is
        interpolated between the samples of the observables.

        Parameters
        ----------
        time : float or numpy.ndarray
            (...) times

        Returns
        -------
        lower, upper : numpy.ndarray
            (..., 2) lower left and upper right corners [length]

        Examples
        --------
        >>> lower, upper = run.corners_at(0.5)
        >>> upper.tolist()
        [1.0, 1.0]
        """
        inwards = np.stack([displaced(side, np.asarray(time)) for side in self.sides], axis=-1)
        inwards = inwards + self._offsets
        for k, place in self.piston_positions.items():
            end = (self.lower, self.upper)[k % 2][k // 2]
            at = np.interp(time, place.time, np.ravel(place.value))
            inwards[..., k] = (-1) ** k * (at - end)
        return self.lower + inwards[..., ::2], self.upper - inwards[..., 1::2]

    @property
    def _offsets(self) -> np.ndarray:
        """Inward displacements (4,) of the sides from the edges of the box at the start."""
        ends = [end[axis] for axis in (0, 1) for end in (self.lower, self.upper)]
        starts = [side.get("position", end) for side, end in zip(self.sides, ends, strict=True)]
        return (np.array(starts, dtype=float) - ends) * [1, -1, 1, -1]

    @cached_property
    def piston_positions(self) -> dict[int, Series]:
        """Time series of the position of each piston; the keys are indices of `sides`."""
        free = [k for k, side in enumerate(self.sides) if side.get("motion") == "piston"]
        return {k: self.observable(f"sides/{SIDES[k]}/position") for k in free}

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower left and upper right corner of the area that the box covers during the run."""
        swings = np.array([outmost(side) for side in self.sides])
        swings = np.maximum(0.0, swings - self._offsets)
        for k, place in self.piston_positions.items():
            beyond = (self.lower[k // 2] - place.value, place.value - self.upper[k // 2])[k % 2]
            swings[k] = max(0.0, np.max(beyond))
        return self.lower - swings[::2], self.upper + swings[1::2]

    @cached_property
    def by_species(self) -> tuple[Species, ...]:
        """All species, in the order of the input file."""
        masks = [self.of_species(name) for name in self.names]
        return tuple(
            Species(name, self.mass[mask], self.radius[mask], mask)
            for name, mask in zip(self.names, masks, strict=True)
        )

    def of_species(self, name: str) -> np.ndarray:
        """Return an array that is true for the disks of the given species.

        Parameters
        ----------
        name : str
            name of the species

        Returns
        -------
        numpy.ndarray
            (N,) array that is true for the disks of the species

        Raises
        ------
        RunError
            if there is no species of that name

        Examples
        --------
        >>> int(run.of_species("gas").sum())
        64
        """
        if name not in self.names:
            raise RunError(f"{self.path}: no species '{name}', there are {', '.join(self.names)}")
        return self.species == self.names.index(name) + 1

    def speed(self, frame: Index) -> np.ndarray:
        """Return the speed of each disk in the given frames.

        Parameters
        ----------
        frame : int, slice, list of int or numpy.ndarray
            frames to use

        Returns
        -------
        numpy.ndarray
            (..., N) speeds [length/time]

        Examples
        --------
        >>> run.speed(-1).shape, run.speed([0, -1]).shape
        ((64,), (2, 64))
        """
        return np.linalg.norm(self.velocity[as_index(frame)], axis=-1)

    def kinetic_energy(self, frame: Index) -> np.ndarray:
        """Return the translational kinetic energy of each disk in the given frames.

        Parameters
        ----------
        frame : int, slice, list of int or numpy.ndarray
            frames to use

        Returns
        -------
        numpy.ndarray
            (..., N) energies [energy]

        Examples
        --------
        >>> energy = run.observable("all/kinetic_energy").value[0]
        >>> bool(np.isclose(run.kinetic_energy(0).mean(), energy))
        True
        """
        return 0.5 * self.mass * np.sum(self.velocity[as_index(frame)] ** 2, axis=-1)

    def unwrapped(self, frame: Index) -> np.ndarray:
        """Return positions that are continuous in time, also when disks cross periodic sides.

        In a sheared box (Lees-Edwards boundary conditions), the periodic image above the box is
        displaced along x by gamma L_y t.  Here gamma is the shear rate and L_y is the height of the
        box.

        Parameters
        ----------
        frame : int, slice, list of int or numpy.ndarray
            frames to use

        Returns
        -------
        numpy.ndarray
            (..., N, 2) positions [length]; equal to `position` along axes that are not periodic

        Examples
        --------
        >>> apart = (run.unwrapped(-1) - run.position[-1]) / run.edges
        >>> bool(np.allclose(apart, np.round(apart), atol=1e-9))
        True
        """
        frame = as_index(frame)
        if self.image is None:
            return self.position[frame]
        image = self.image[frame]
        place = self.position[frame] + image * self.edges
        if self.shear_rate != 0:
            slide = self.shear_rate * self.edges[1] * self.time[frame]
            place[..., 0] += image[..., 1] * np.asarray(slide)[..., None]
        return place

    def displacement(self, frame: Index, origin: int = 0) -> np.ndarray:
        """Return the distance of each disk from its position in a reference frame.

        The distances include the displacements of disks across periodic sides.

        Parameters
        ----------
        frame : int, slice, list of int or numpy.ndarray
            frames to use
        origin : int
            frame of the reference positions

        Returns
        -------
        numpy.ndarray
            (..., N) distances [length]

        Examples
        --------
        >>> float(run.displacement(0).max())
        0.0
        """
        return np.linalg.norm(self.unwrapped(frame) - self.unwrapped(origin), axis=-1)

    def per_disk(self, name: str) -> Frames:
        """Return a quantity of each disk that only some output files contain.

        Parameters
        ----------
        name : str
            name in the file, such as "angular_velocity" or "orientation"; the attribute `disk_data`
            contains all such quantities

        Returns
        -------
        Frames
            (T, N) read from the file when it is indexed

        Raises
        ------
        RunError
            if the frames do not contain the quantity

        Examples
        --------
        >>> rough_runs[0].per_disk("angular_velocity")[-1].shape
        (64,)
        """
        if name not in self.disk_data:
            raise RunError(f"{self.path}: has no {name} in its frames")
        return self.disk_data[name]

    @property
    def angular_velocity(self) -> Frames:
        """Angular velocities (T, N) [1/time], which exist only if the disks can rotate."""
        return self.per_disk("angular_velocity")

    @property
    def orientation(self) -> Frames:
        """Angles (T, N) of the disks to the x axis [rad], not reduced modulo 2 pi."""
        return self.per_disk("orientation")

    @property
    def inertia(self) -> np.ndarray:
        """Moments of inertia (N,) of the disks."""
        return float(self.parameter("contact", "inertia", 0.5)) * self.mass * self.radius**2

    def observable(self, name: str) -> Series:
        """Return the time series of an observable.

        Parameters
        ----------
        name : str
            name in the file, such as "total_energy" or "sides/left/impulse"; the attribute
            `observables` contains all names

        Returns
        -------
        Series
            times (T',) and values (T', ...)

        Raises
        ------
        RunError
            if the file has no observable of that name

        Examples
        --------
        >>> time, energy = run.observable("total_energy")
        >>> bool(np.ptp(energy) < 1e-9 * energy[0])
        True
        """
        with open_file(self.path) as file:
            return series_of(file, name, self._samples)

    @cached_property
    def _samples(self) -> int:
        """Number of samples of the observables, counted when the run was first read."""
        with open_file(self.path) as file:
            return committed(file, "observables")

    @cached_property
    def observables(self) -> tuple[str, ...]:
        """Names of all observables in the file."""
        with open_file(self.path) as file:
            return tuple(series_in(file["observables"]))

    def to_dataframe(self) -> "pandas.DataFrame":
        """Return the observables as a pandas DataFrame, which has one row for each sample.

        The index of the table is the time.  The columns have the names of the observables, such as
        `all/kinetic_energy`.  Each component of a vector or tensor has its own column, such as
        `momentum_x` or `virial_tensor_xy`.

        Returns
        -------
        pandas.DataFrame
            (T', columns) of numbers

        Raises
        ------
        ImportError
            if pandas is not installed

        Examples
        --------
        >>> table = run.to_dataframe()
        >>> table.index.name, "all/kinetic_energy" in table.columns
        ('time', True)
        """
        try:
            import pandas
        except ImportError:
            raise ImportError("to_dataframe needs a package: pip install pandas") from None

        columns: dict[str, np.ndarray] = {}
        with open_file(self.path) as file:
            series = {name: series_of(file, name, self._samples) for name in self.observables}
        for name, (time, value) in series.items():
            parts = {(): ("",), (2,): ("_x", "_y"), (4,): [f"_{side}" for side in SIDES]}
            values = value.reshape(len(time), -1).T
            if name in TENSORS:
                parts[4,] = ("_xx", "_xy", "_yx", "_yy")
            columns |= zip([name + part for part in parts[value.shape[1:]]], values, strict=True)
        return pandas.DataFrame(columns, index=pandas.Index(time, name="time"))

    def to_xarray(self) -> "xarray.Dataset":
        """Return the frames as an xarray Dataset; the package xarray must be installed.

        The dimensions are "time", "disk" and "component" ("x" and "y").  The variables are all
        quantities of the frames, and the mass, radius and species of each disk.  The attributes are
        the path of the file and the seed.

        Returns
        -------
        xarray.Dataset
            positions, velocities and the other quantities of the frames

        Raises
        ------
        ImportError
            if xarray is not installed

        Examples
        --------
        >>> dict(run.to_xarray().sizes)["disk"] if has_xarray else 64
        64
        """
        try:
            import xarray
        except ImportError:
            raise ImportError("to_xarray needs a package: pip install xarray") from None

        dimensions = ("time", "disk", "component")
        frames: dict[str, Frames | None]
        frames = {"position": self.position, "velocity": self.velocity, **self.disk_data}
        frames |= {"image": self.image, "event_count": self.event_count}
        data: dict[str, tuple[Any, np.ndarray]] = {
            name: (dimensions[: values.ndim], values[:])
            for name, values in frames.items()
            if values is not None
        }
        data |= {name: ("disk", getattr(self, name)) for name in ("mass", "radius", "species")}
        axes = {"time": self.time, "disk": np.arange(self.n_disks) + 1, "component": ["x", "y"]}
        return xarray.Dataset(data, axes, {"path": str(self.path), "seed": self.seed})

    def event_log(self) -> EventLog:
        """Return all collisions of disks with each other and with boundaries, in order of time.

        Returns
        -------
        EventLog
            (E,) times, partners and impulses of all events

        Raises
        ------
        RunError
            unless the input has `output.event_log = .true.`

        Examples
        --------
        >>> log = run.event_log()
        >>> pairs = int(np.sum(log.j > 0))
        >>> bool(pairs == run.observable("collisions").value[-1])
        True
        """
        return self._event_log

    @cached_property
    def _event_log(self) -> EventLog:
        with open_file(self.path) as file:
            if "events" not in file:
                raise Unsound("has no event log, set output.event_log = .true.")
            count = committed(file, "events")
            return EventLog(
                **{
                    name: rows(file["events"][name], count)
                    for name in EventLog._fields
                    if name in file["events"]
                }
            )

    @cached_property
    def collisions_per_disk(self) -> Series:
        """Mean number of collisions of each disk with other disks, as a function of time."""
        time, collisions = self.observable("collisions")
        return Series(time, 2 * collisions / self.n_disks)

    def collisions_per_disk_at(self, time: np.ndarray) -> np.ndarray:
        """Return the mean number of collisions with other disks per disk at the given times.

        The number is interpolated between the samples of the observables.  If the file has more
        frames than such samples, the interpolation also uses the event counts of the frames.

        Parameters
        ----------
        time : numpy.ndarray
            (...) times, such as those of the frames

        Returns
        -------
        numpy.ndarray
            (...) mean number of collisions per disk since the start

        Examples
        --------
        >>> tau = run.collisions_per_disk_at(run.time)
        >>> float(tau[0]), bool(tau[-1] > 50)
        (0.0, True)
        """
        known, tau = self.collisions_per_disk
        if self.event_count is None or len(known) >= self.n_frames:
            return np.interp(time, known, tau)
        hits, rising = self.events_per_disk, 1e-12 / max(self.time[-1], 1e-300)  # also at rest

        def clock(t: np.ndarray) -> np.ndarray:
            return np.interp(t, self.time, hits) + rising * np.asarray(t)

        return np.interp(clock(time), clock(known), tau)

    @cached_property
    def events_per_disk(self) -> np.ndarray:
        """Mean number (T,) of events per disk between the start and each frame."""
        if self.event_count is None:
            raise RunError(f"{self.path}: has no event_count in its frames")
        return np.array([self.event_count[k].mean() for k in range(self.n_frames)])

    def accessible_area(self, time: float | np.ndarray) -> np.ndarray:
        """Return the area of the box minus the area of its obstacles at the given times.

        If the disks are in a round container, the accessible area is the area of the container.
        For pistons and for sides that move at constant velocity, the area depends on their
        positions at the given times.  For oscillating sides, the area is calculated from their mean
        positions, as in the pressure that the program writes.

        Parameters
        ----------
        time : float or numpy.ndarray
            (...) times

        Returns
        -------
        numpy.ndarray
            (...) areas [length^2]

        Examples
        --------
        >>> float(run.accessible_area(0.0))
        1.0
        """
        drifts = np.array([side.get("motion") in DRIFTING for side in self.sides])
        lower, upper = self.corners_at(time)
        lower = np.where(drifts[::2], lower, self.lower)
        upper = np.where(drifts[1::2], upper, self.upper)
        area = np.prod(upper - lower, axis=-1)
        for circle in sorted(self.obstacles, key=lambda circle: not circle.inside):
            own = np.pi * circle.radius**2
            area = np.minimum(area, own) if circle.inside else area - own
        return area

    def pressure(self, t1: float, t2: float) -> float:
        """Return the mean pressure between the two samples closest in time to `t1` and `t2`.

        The pressure is (<K> + dW / (2 dt)) / <A>.  Here K is the kinetic energy, A the accessible
        area, and dW the increase of the virial during the time dt between the two samples.  In a
        sheared box, K is the kinetic energy relative to the mean flow.  Averages over time are
        calculated with the trapezoidal rule.

        Parameters
        ----------
        t1, t2 : float
            times

        Returns
        -------
        float
            pressure [energy/length^2]

        Raises
        ------
        RunError
            if there are fewer than two samples of the observables

        Examples
        --------
        >>> ideal = run.observable("all/kinetic_energy").value[-1] * run.n_disks
        >>> bool(run.pressure(0, run.time[-1]) > 1.5 * ideal)
        True
        """
        if self.shear_rate:
            return float(np.trace(self.pressure_tensor(t1, t2)) / 2)
        allow(self, "its kinetic energy is no pressure", *TRAITS.keys() - {"random_walk"})
        time, kinetic = self._between("all/kinetic_energy", t1, t2)
        virial = np.diff(self._between("virial", t1, t2).value[[0, -1]])[0]
        duration, area = time[-1] - time[0], time_mean(time, self.accessible_area(time))
        return float((self.n_disks * time_mean(time, kinetic) + virial / (2 * duration)) / area)

    def pressure_tensor(self, t1: float, t2: float) -> np.ndarray:
        """Return the mean pressure tensor between the samples closest in time to `t1` and `t2`.

        The component ab of the tensor is (<sum of m v_a v_b> + dW_ab / dt) / <A>.  Here A is the
        accessible area, and dW the increase of the virial tensor during the time dt between the
        samples.  The trace of the pressure tensor is twice the pressure.  The output file contains
        the virial tensor if the input has `output.virial_tensor = .true.`, and in some other cases.

        Parameters
        ----------
        t1, t2 : float
            times

        Returns
        -------
        numpy.ndarray
            (2, 2) pressure tensor [energy/length^2]

        Raises
        ------
        RunError
            if there are fewer than two samples of the observables, or no virial tensor

        Examples
        --------
        >>> tensor = run.pressure_tensor(0, run.time[-1])
        >>> bool(np.isclose(np.trace(tensor) / 2, run.pressure(0, run.time[-1])))
        True
        """
        allow(self, "its kinetic energy is no pressure", *TRAITS.keys() - {"random_walk"})
        time, kinetic = self._between("kinetic_tensor", t1, t2)
        virial = np.subtract(*self._between("virial_tensor", t1, t2).value[[-1, 0]])
        duration, area = time[-1] - time[0], time_mean(time, self.accessible_area(time))
        return ((time_mean(time, kinetic) + virial / duration) / area).reshape(2, 2)

    def _between(self, name: str, t1: float, t2: float) -> Series:
        """Return the samples of an observable between the samples nearest to `t1` and `t2`."""
        time, value = self.observable(name)
        first, last = (int(np.argmin(np.abs(time - t))) for t in (t1, t2))
        if not time[first] < time[last]:
            raise RunError(
                f"{self.path}: has no two samples of the observables from t = {t1:g} to {t2:g}; "
                "set output.observables_every_time"
            )
        return Series(time[first : last + 1], value[first : last + 1])

    def parameter(self, group: str, variable: str, default: Any = None) -> Any:
        """Return the value of an input variable in this run, which may be its default.

        Parameters
        ----------
        group, variable : str
            names in the input, such as "contact" and "restitution"
        default : object
            value to return if the variable has no value

        Returns
        -------
        object
            a number, a text or an array

        Examples
        --------
        >>> run.parameter("stop", "collisions_per_disk"), run.parameter("stop", "events", "none")
        (60.0, 'none')
        """
        return self.parameters.get(group, {}).get(variable, default)

    @property
    def restitution(self) -> float:
        """Coefficient of restitution of two disks.

        The value is NaN if the coefficient depends on the species or on the velocity of the disks.
        """
        return self.contact_law.xi if self.contact_law.law == "constant" else np.nan

    @property
    def contact_law(self) -> Restitution:
        """Coefficient of restitution of two disks, and its dependence on the velocity.

        The coefficient is NaN if it depends on the species.
        """
        contact = self.parameters.get("contact", {})
        values = np.unique(contact.get("pair_restitution", contact.get("restitution", 1.0)))
        xi = float(values[0]) if len(values) == 1 else float("nan")
        if "soft_contacts" not in self.nature:
            return Restitution(xi)
        return Restitution(xi, contact["restitution_law"], float(contact["reference_speed"]))

    @property
    def time_step(self) -> float:
        """Time step of a time-stepped run; 0 for an event-driven run."""
        steps = self.parameter("run", "dynamics", "events") == "steps"
        return float(self.parameter("run", "dt")) if steps else 0.0

    @cached_property
    def nature(self) -> Nature:
        """Traits of the run, which determine the theories that apply to the run."""
        lost = self.observable("dissipated_energy").value[-1]
        most = self.n_disks * self.observable("all/kinetic_energy").value[[0, -1]].max()
        return nature_of(
            self.parameters,
            self.mass,
            self.radius,
            lost=lost / most if most > 1e-300 else 0.0,  # rounding error of a disk at rest
            turning="all/rotational_energy" in self.observables,
            collapsed="collapse" in str(self.provenance.get("note", "")),
        )

    @property
    def termination_note(self) -> str:
        """Reason why the run ended early; empty if a stop rule ended the run."""
        note = "".join(filter(str.isprintable, str(self.provenance.get("note", ""))))
        if self.path.suffix != ".part":
            early = ":" if note.startswith("an inelastic collapse occurred") else " ended early:"
            return f"{self.path.name}{early} {note}" if note else ""
        state = f"broke off: {note}" if note else "is unfinished: going on, stopped, or broken off"
        return f"{self.path.name} {state}; last frame at t = {self.time[-1]:.6g}"

    @property
    def seed(self) -> int:
        """Seed of the random number generator."""
        return int(self.parameter("run", "seed", self.parameters.get("seed", 0)))

    @property
    def shear_rate(self) -> float:
        """Gradient along y of the mean velocity along x; 0 unless the box is sheared."""
        return float(self.parameter("box", "shear_rate", 0.0))

    @property
    def gravity(self) -> np.ndarray:
        """Gravitational acceleration (2,)."""
        return np.asarray(self.parameter("box", "gravity", (0.0, 0.0)), dtype=float)


@dataclass(frozen=True)
class Frame:
    """One frame of a run, whose arrays are read from the file on demand.

    A loop `for frame in run` visits all frames, and `run[-1]` is the last frame.

    Parameters
    ----------
    run : Run
        the run
    index : int
        number of the frame; the first frame has the number 0

    Examples
    --------
    >>> frame = run[-1]
    >>> bool(frame.time == run.time[-1]), frame.position.shape
    (True, (64, 2))
    >>> len([frame for frame in run if frame.time < 0.1]) < len(run)
    True
    """

    run: Run = field(repr=False)
    index: int

    @property
    def time(self) -> float:
        """Time at which the frame was written."""
        return float(self.run.time[self.index])

    @property
    def position(self) -> np.ndarray:
        """Positions (N, 2) of the disks [length]."""
        return self.run.position[self.index]

    @property
    def velocity(self) -> np.ndarray:
        """Velocities (N, 2) of the disks [length/time]."""
        return self.run.velocity[self.index]

    @property
    def speed(self) -> np.ndarray:
        """Speeds (N,) of the disks [length/time]."""
        return self.run.speed(self.index)

    def per_disk(self, name: str) -> np.ndarray:
        """Return a quantity of each disk in this frame; see `Run.per_disk`."""
        return self.run.per_disk(name)[self.index]


def read_run(path: str | Path) -> Run:
    """Open the output file of a finished or unfinished run.

    Parameters
    ----------
    path : str or Path
        the output file; for an unfinished run the file NAME.h5.part

    Returns
    -------
    Run
        the run up to the last complete frame

    Raises
    ------
    RunError
        if the file cannot be used; the message is one line

    Examples
    --------
    >>> ricochet.read_run(run.path).n_disks
    64
    """
    return open_run(Path(path))


def open_run(path: Path, folder: object = None) -> Run:
    """Open the output file of a run.

    If `folder` is given, every object that reads the file later keeps a reference to `folder`.
    """
    with open_file(path) as file:
        if DISKS not in file or "h5md" not in file:
            raise Unsound("an HDF5 file, but not of a Ricochet run")
        major, minor = file["h5md"].attrs["version"]
        if major != 1:
            raise Unsound(f"H5MD version {major}.{minor}, this program reads 1.x")
        return run_of(path, file, folder)


def run_of(path: Path, file: h5py.File, folder: object = None) -> Run:
    """Return the run that is stored in an open HDF5 file."""
    disks, count = file[DISKS], committed(file, DISKS)
    if {"pressure", "wall_collisions"} & set(file["observables"]):
        old = "was written by an earlier version of Ricochet, with other names"
        raise Unsound(f"{old}: run its input again")
    if count == 0:
        raise Unsound("holds no frame yet")
    frames = {
        name: Frames(path, name, (count, *item["value"].shape[1:]), folder)
        for name, item in disks.items()
        if isinstance(item, h5py.Group) and "value" in item
    }
    parameters = tree(file["parameters"])
    box = tree(disks["box"])
    periodic = np.array(box["boundary"]) == "periodic"
    plane = (count, len(disks["id"]), 2)
    return Run(
        path=path,
        time=rows(disks["position/time"], count),
        position=frames.pop("position"),
        velocity=frames.pop("velocity", Frames(path, "velocity", plane, folder)),
        image=frames.pop("image", Frames(path, "image", plane, folder) if any(periodic) else None),
        event_count=frames.pop("event_count", None),
        disk_data=frames,
        mass=rows(disks["mass"]),
        radius=rows(disks["radius"]),
        species=rows(disks["species"]),
        names=tuple(parameters["species"]["names"]),
        lower=box["lower"],
        edges=box["edges"],
        periodic=periodic,
        obstacles=obstacles_of(parameters),
        walls=walls_of(parameters),
        parameters=parameters,
        provenance=tree(file["provenance"]),
        _folder=folder,
    )


def outmost(side: Mapping[str, Any]) -> float:
    """Return the largest outward displacement of a side during the run [length].

    The reference is the mean position of an oscillating side, or the initial position of a side
    that moves at constant velocity.
    """
    if side.get("motion") == "constant_velocity":
        return max(0.0, -float(side["velocity"]) * float(side["end_time"] - side["start_time"]))
    return float(side["amplitude"]) if side.get("motion") in ("sine", "parabolic") else 0.0


def displaced(side: Mapping[str, Any], time: np.ndarray) -> np.ndarray:
    """Return the inward displacement of a moving side at the given times.

    The reference is the mean position of an oscillating side, or the initial position of a side
    that moves at constant velocity.  The formulae are in docs/theory.md.
    """
    if side.get("motion") == "constant_velocity":
        start, end = side["start_time"], side["end_time"]
        return side["velocity"] * (np.clip(time, start, end) - start)
    if outmost(side) == 0:
        return np.zeros(np.shape(time))
    s = (time / side["period"] + side["phase"]) % 1
    if side["motion"] == "sine":
        return side["amplitude"] * np.sin(2 * np.pi * s)
    return side["amplitude"] * 16 * np.where(s < 0.5, s * (0.5 - s), (s - 0.5) * (s - 1))


def time_mean(time: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Return the time average of samples (T, ...), calculated with the trapezoidal rule."""
    return np.trapezoid(value, time, axis=0) / (time[-1] - time[0])


def span(values: np.ndarray) -> str:
    """Return the smallest and largest value as text, or one value if all values are equal."""
    ends = (f"{values.min():g}", f"{values.max():g}")
    return ends[0] if ends[0] == ends[1] else " to ".join(ends)


def series_in(group: h5py.Group, path: str = "") -> Iterator[str]:
    """Yield the names of all time series in an HDF5 group and in its subgroups."""
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
    """Return the number of samples in a group that have been written completely.

    An unfinished file has space for further samples, which are not valid.
    """
    return int(file[group]["committed"][()])


def rows(data: h5py.Dataset, count: int | None = None) -> np.ndarray:
    """Return the first `count` rows of a dataset, or all rows if `count` is None.

    Floating-point numbers are converted to double precision.
    """
    values = data[:count]
    if count is not None and len(values) < count:
        raise Unsound(f"{data.name} holds {len(values)} of {count} samples")
    return values.astype(float, copy=False) if values.dtype.kind == "f" else values


def obstacles_of(parameters: Mapping[str, Any]) -> tuple[Obstacle, ...]:
    """Return all circular obstacles, in the order of their numbers in the event log."""
    groups = parameters.get("obstacle", {})
    if "inside" not in groups:
        return ()
    rows = parameters.get("obstacle_rows", groups)
    inside = np.asarray(groups["inside"])[groups_of_rows(parameters, "obstacle")]
    parts = (rows["centre"], rows["radius"], inside)
    return tuple(Obstacle(c, float(r), bool(i)) for c, r, i in zip(*parts, strict=True))


def walls_of(parameters: Mapping[str, Any], group: str = "wall") -> np.ndarray:
    """Return the end points (W, 2, 2) of the W straight walls, in the order of the event log."""
    rows = parameters.get(f"{group}_rows", parameters.get(group))
    return np.stack([rows["from"], rows["to"]], axis=1) if rows else np.empty((0, 2, 2))


def groups_of_rows(parameters: Mapping[str, Any], name: str) -> np.ndarray:
    """Return for each obstacle the index (W,) of its `&obstacle` group in the input file."""
    rows = parameters.get(f"{name}_rows")
    if rows:
        return np.asarray(rows["group"]) - 1
    return np.arange(len(parameters.get(name, {}).get("name", ())))
