"""Read output files of Ricochet.

    from ricochet import read_run
    run = read_run("runs/gas.h5")
    run.time                 # (T,)    times of the frames
    run.position[-1]         # (N, 2)  one frame, read from the file on demand
    run.speed(-1)            # (N,)    derived quantities take a frame, a slice or a list
    run.observable("all/kinetic_energy").value

T is the number of frames, N that of disks and S that of species. All quantities are in the units of
the input file. Frames are read on demand, so that a file may be larger than the memory. An
unfinished output (`.part`) is read up to its last complete frame. Only this module and the modules
`results` and `frames` depend on the layout of the HDF5 file.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from .arrays import Index, as_index
from .box import obstacles_of, walls_of
from .files import RunError, Unsound, open_file, optional_package, tree
from .frames import DISKS, Frames, NoSuchFrame, committed, rows
from .nature import TRAITS, allow
from .pressure import PressureResults
from .records import Event, EventLog, Obstacle, Restitution, Species, span
from .results import SIDES

if TYPE_CHECKING:
    import xarray

    from .windows import Window

__all__ = [
    "SIDES",
    "Event",
    "EventLog",
    "Frame",
    "Obstacle",
    "Restitution",
    "Run",
    "Species",
    "open_run",
    "read_run",
]


class Run(PressureResults):
    """Results of one run: arrays of constants, frames, and time series of observables.

    T is the number of frames and N that of disks. All quantities are in the units of the input
    file. See `read_run`.
    """

    def __repr__(self) -> str:
        """Return a one-line description of the run."""
        kinds = ", ".join(f"{np.sum(kind.disks)} {kind.name}" for kind in self.by_species)
        frames = f"{self.n_frames} frame{'s' * (self.n_frames > 1)}, t = {span(self.time)}"
        return f"<Run {self._place}: {kinds}; {frames}>"

    @property
    def _place(self) -> str:
        """Path of the file, and in a window its times."""
        return str(self.path)

    @property
    def label(self) -> str:
        """Name of the file, and in a window its times, for tables and warnings."""
        return self.path.name

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)

    def __getitem__(self, frame: int) -> "Frame":
        """Return the frame with the given index, counted from the last frame if negative."""
        if not -len(self) <= frame < len(self):
            raise NoSuchFrame(f"{self.path}: there is no frame {frame} of {len(self)}")
        return Frame(self, frame % len(self))

    def __iter__(self) -> "Iterator[Frame]":
        """Yield the frames in chronological order."""
        return (Frame(self, k) for k in range(len(self)))

    @cached_property
    def by_species(self) -> tuple[Species, ...]:
        """All species, in the order of the input file."""
        masks = [self.of_species(name) for name in self.names]
        return tuple(
            Species(name, self.mass[mask], self.radius[mask], mask)
            for name, mask in zip(self.names, masks, strict=True)
        )

    def of_species(self, name: str) -> np.ndarray:
        """Return a mask of the disks of a species.

        Parameters
        ----------
        name : str
            name of the species

        Returns
        -------
        numpy.ndarray
            (N,) mask

        Raises
        ------
        RunError
            if there is no species of this name

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
        """Return positions that are continuous in time when disks cross periodic sides.

        In a sheared box (Lees-Edwards boundary conditions) the periodic image above the box is
        displaced along x by gamma L_y t, where gamma is the shear rate and L_y the height of the
        box.

        Parameters
        ----------
        frame : int, slice, list of int or numpy.ndarray
            frames to use

        Returns
        -------
        numpy.ndarray
            (..., N, 2) positions [length]; equal to `position` along axes that are not periodic

        Raises
        ------
        RunError
            if disks are recycled, which makes their positions discontinuous

        Examples
        --------
        >>> apart = (run.unwrapped(-1) - run.position[-1]) / run.edges
        >>> bool(np.allclose(apart, np.round(apart), atol=1e-9))
        True
        """
        allow(self, "displacements are not defined", *TRAITS.keys() - {"recycled", "open"})
        frame = as_index(frame)
        if self.image is None:
            return self.position[frame]
        image = self.image[frame]
        place = self.position[frame] + image * self.edges
        if self.shear_rate != 0:
            slide = self.shear_rate * self.edges[1] * self._shear_time[frame]
            place[..., 0] += image[..., 1] * np.asarray(slide)[..., None]
        return place

    @property
    def _shear_time(self) -> np.ndarray:
        """Time (T,) of each frame since the images of a sheared box were aligned."""
        return self.time

    def displacement(self, frame: Index, origin: int = 0) -> np.ndarray:
        """Return the distance of each disk from its position in a reference frame.

        Parameters
        ----------
        frame : int, slice, list of int or numpy.ndarray
            frames to use
        origin : int
            frame of the reference positions

        Returns
        -------
        numpy.ndarray
            (..., N) distances [length] between unwrapped positions

        Examples
        --------
        >>> float(run.displacement(0).max())
        0.0
        """
        return np.linalg.norm(self.unwrapped(frame) - self.unwrapped(origin), axis=-1)

    def per_disk(self, name: str) -> Frames:
        """Return a per-disk quantity that only some output files contain.

        Parameters
        ----------
        name : str
            one of `disk_data`, such as "angular_velocity" or "orientation"

        Returns
        -------
        Frames
            (T, N) values; an index reads the selected frames from the file

        Raises
        ------
        RunError
            if the frames do not contain this quantity

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
        """Angular velocities (T, N) [1/time]; only if the disks can rotate."""
        return self.per_disk("angular_velocity")

    @property
    def orientation(self) -> Frames:
        """Angles (T, N) between disks and the x axis [rad], not reduced modulo 2 pi."""
        return self.per_disk("orientation")

    @property
    def present(self) -> Frames | None:
        """1 for disks in the box and 0 for disks outside (T, N); None for a closed system."""
        return self.disk_data.get("present")

    def in_box(self, frame: int) -> np.ndarray:
        """Return the indices of the disks that are in the box in a frame.

        Parameters
        ----------
        frame : int
            frame to use

        Returns
        -------
        numpy.ndarray
            (n,) indices in increasing order; those of all disks in a closed system

        Examples
        --------
        >>> len(run.in_box(-1)) == run.n_disks
        True
        """
        if self.present is None:
            return np.arange(self.n_disks)
        return np.flatnonzero(self.present[frame])

    @property
    def inertia(self) -> np.ndarray:
        """Moments of inertia (N,) of the disks."""
        return float(self.parameter("contact", "inertia", 0.5)) * self.mass * self.radius**2

    def to_xarray(self) -> "xarray.Dataset":
        """Return the frames as an xarray Dataset; the package xarray must be installed.

        Returns
        -------
        xarray.Dataset
            all quantities in the frames, and mass, radius and species of each disk, with the
            dimensions "time", "disk" and "component" ("x" and "y"); the attributes are the path and
            the seed

        Raises
        ------
        ImportError
            if xarray is not installed

        Examples
        --------
        >>> dict(run.to_xarray().sizes)["disk"] if has_xarray else 64
        64
        """
        xarray = optional_package("xarray", "to_xarray")

        dimensions = ("time", "disk", "component")
        frames: dict[str, Frames | None]
        frames = {"position": self.position, "velocity": self.velocity, **self.disk_data}
        frames |= {"image": self.image, "event_count": self.event_count, "recycled": self.recycled}
        data: dict[str, tuple[Any, np.ndarray]] = {
            name: (dimensions[: values.ndim], values[:])
            for name, values in frames.items()
            if values is not None
        }
        data |= {name: ("disk", getattr(self, name)) for name in ("mass", "radius", "species")}
        axes = {"time": self.time, "disk": np.arange(self.n_disks) + 1, "component": ["x", "y"]}
        return xarray.Dataset(data, axes, {"path": str(self.path), "seed": self.seed})

    def window(self, start: float, end: float = np.inf) -> "Window":
        """Return a part of the run, as a run under the laws in force during this time.

        All times in the window are measured from `start`. Counts and sums, such as the numbers of
        collisions and the dissipated energy, begin at zero with the first sample of the window.
        The parameters have their values at `start`; changes within the window are listed in
        `changes`.

        Parameters
        ----------
        start, end : float
            times; the frames and samples at `end` are not included, because the state at the time
            of a change is the state after it

        Returns
        -------
        Run
            the window

        Raises
        ------
        RunError
            if the window contains no frame

        Examples
        --------
        >>> late = run.window(0.1)
        >>> len(late) < len(run), bool(late.time[0] < 0.1)
        (True, True)
        """
        from .windows import window_of  # not at the top, because that module imports this one

        return window_of(self, start, end)

    def windows(self) -> "list[Window]":
        """Return the windows between successive changes during the run; see `window`.

        Returns
        -------
        list of Run
            the windows in chronological order, except those without frames

        Examples
        --------
        >>> len(run.windows())  # without changes, the whole run
        1
        """
        from .windows import within

        times = sorted({0.0, *(change.time for change in self.changes), np.inf})
        return [
            self.window(start, end)
            for start, end in pairwise(times)
            if len(self.time[within(self.time, start, end)])
        ]

    @property
    def restitution(self) -> float:
        """Coefficient of restitution of two disks; NaN if it depends on species or velocity."""
        return self.contact_law.xi if self.contact_law.law == "constant" else np.nan

    @property
    def contact_law(self) -> Restitution:
        """Law of restitution of two disks; `xi` is NaN if it depends on the species."""
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

    @property
    def termination_note(self) -> str:
        """Reason why the run ended early; empty if it ended by one of its stop conditions."""
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
    def gravity(self) -> np.ndarray:
        """Gravitational acceleration (2,)."""
        return np.asarray(self.parameter("box", "gravity", (0.0, 0.0)), dtype=float)


@dataclass(frozen=True)
class Frame:
    """One frame of a run, with arrays read from the file on demand.

    `for frame in run` visits all frames; `run[-1]` is the last one.

    Parameters
    ----------
    run : ricochet.Run
        run that contains the frame
    index : int
        index of the frame

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
        """Time of the frame."""
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
        """Return a per-disk quantity in this frame; see `Run.per_disk`."""
        return self.run.per_disk(name)[self.index]


def read_run(path: str | Path) -> Run:
    """Open the output file of a finished or unfinished run.

    Parameters
    ----------
    path : str or Path
        the output file; of an unfinished run, the file NAME.h5.part

    Returns
    -------
    Run
        the run up to its last complete frame

    Raises
    ------
    RunError
        if the file is unusable; the message is one line

    Examples
    --------
    >>> ricochet.read_run(run.path).n_disks
    64
    """
    return open_run(Path(path))


def open_run(path: Path, folder: object = None) -> Run:
    """Open the output file of a run; `folder` exists as long as any object reads the file."""
    with open_file(path) as file:
        if DISKS not in file or "h5md" not in file:
            raise Unsound("an HDF5 file, but not of a Ricochet run")
        major, minor = file["h5md"].attrs["version"]
        if major != 1:
            raise Unsound(f"H5MD version {major}.{minor}, this program reads 1.x")
        return run_of(path, file, folder)


def run_of(path: Path, file: h5py.File, folder: object = None) -> Run:
    """Return the run stored in an open HDF5 file."""
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
    if "changes" in parameters:  # without those scheduled for a later time
        made = str(parameters.pop("changes")).splitlines(keepends=True)
        now = float(rows(disks["position/time"], count)[-1])
        if made := [line for line in made if float(line.split(" ")[0]) <= now]:
            parameters["changes"] = "".join(made)
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
        recycled=frames.pop("recycled", None),
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
