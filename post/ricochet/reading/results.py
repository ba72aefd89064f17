"""Contents of an output file: constants, frames, observables and event log."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .files import RunError, Unsound, open_file, optional_package
from .frames import Frames, Series, committed, rows, series_in, series_of
from .nature import Nature, nature_of
from .records import EventLog, Obstacle
from .units import UNNAMED, Units

if TYPE_CHECKING:
    import pandas

CHUNK = 10**6  # largest number of disks read at a time, in all frames together
SIDES = ("left", "right", "bottom", "top")
TENSORS = ("virial_tensor", "kinetic_tensor", "helfand_stress")


@dataclass(frozen=True, eq=False)
class Results:
    """Results of one run, as stored in its output file."""

    path: Path
    time: np.ndarray  # (T,)
    position: Frames  # (T, N, 2), wrapped into the box along periodic axes
    velocity: Frames  # (T, N, 2); missing if `output.frame_columns` omits it
    image: Frames | None  # (T, N, 2) image counters; None without periodic sides
    event_count: Frames | None  # (T, N) number of events; None if not in the frames
    recycled: Frames | None  # (T, N) how often each disk was recycled; None without recycling
    disk_data: dict[str, Frames]  # (T, N) further per-disk quantities, by name
    mass: np.ndarray  # (N,)
    radius: np.ndarray  # (N,)
    species: np.ndarray  # (N,) index of the species, from 1
    names: tuple[str, ...]  # names of the species
    lower: np.ndarray  # (2,) lower left corner of the box
    edges: np.ndarray  # (2,) edge lengths of the box
    periodic: np.ndarray  # (2,) bool
    obstacles: tuple[Obstacle, ...]
    walls: np.ndarray  # (W, 2, 2) end points of the straight walls
    parameters: dict[str, Any]  # by group and variable, the value used in the run
    provenance: dict[str, Any]
    # names of the units, for the labels of axes
    units: Units = field(default=UNNAMED, kw_only=True)
    # keeps a temporary file in existence
    _folder: object = field(default=None, kw_only=True, repr=False)

    @property
    def n_disks(self) -> int:
        """Number of disks, N."""
        return len(self.mass)

    @property
    def n_frames(self) -> int:
        """Number of frames, T."""
        return len(self.time)

    def parameter(self, group: str, variable: str, default: Any = None) -> Any:
        """Return the value of an input variable in the run.

        Parameters
        ----------
        group, variable : str
            names in the input file, such as "contact" and "restitution"
        default : object
            value to return if the variable has none

        Returns
        -------
        object
            a number, a string or an array

        Examples
        --------
        >>> run.parameter("stop", "collisions_per_disk"), run.parameter("stop", "events", "none")
        (60.0, 'none')
        """
        return self.parameters.get(group, {}).get(variable, default)

    def observable(self, name: str) -> Series:
        """Return the time series of an observable.

        Parameters
        ----------
        name : str
            one of `observables`, such as "total_energy" or "sides/left/impulse"

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
        """Number of samples of the observables when the run was first read."""
        with open_file(self.path) as file:
            return committed(file, "observables")

    @cached_property
    def observables(self) -> tuple[str, ...]:
        """Names of all observables in the file."""
        with open_file(self.path) as file:
            return tuple(series_in(file["observables"]))

    def to_dataframe(self) -> "pandas.DataFrame":
        """Return the observables as a pandas DataFrame with one row per sample.

        Returns
        -------
        pandas.DataFrame
            (T', columns), indexed by time; the columns are observables such as
            `all/kinetic_energy`, and components such as `momentum_x` and `virial_tensor_xy`

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
        pandas = optional_package("pandas", "to_dataframe")

        columns: dict[str, np.ndarray] = {}
        for name in self.observables:
            time, value = self.observable(name)
            parts = {(): ("",), (2,): ("_x", "_y"), (4,): [f"_{side}" for side in SIDES]}
            values = value.reshape(len(time), -1).T
            if name in TENSORS:
                parts[4,] = ("_xx", "_xy", "_yx", "_yy")
            columns |= zip([name + part for part in parts[value.shape[1:]]], values, strict=True)
        return pandas.DataFrame(columns, index=pandas.Index(time, name="time"))

    def event_log(self) -> EventLog:
        """Return all collisions of disks with each other and with boundaries, in order of time.

        Returns
        -------
        EventLog
            (E,) times, collision partners and impulses of all events

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
        """Mean number of disk-disk collisions per disk as a function of time."""
        time, collisions = self.observable("collisions")
        return Series(time, 2 * collisions / self.n_disks)

    def collisions_per_disk_at(self, time: np.ndarray) -> np.ndarray:
        """Return the mean number of disk-disk collisions per disk at the given times.

        It is interpolated between samples of the observables or, if there are more frames than
        samples, with the help of the event counts of the frames.

        Parameters
        ----------
        time : numpy.ndarray
            (...) times, such as those of the frames

        Returns
        -------
        numpy.ndarray
            (...) mean number of collisions per disk since the start of the run

        Examples
        --------
        >>> tau = run.collisions_per_disk_at(run.time)
        >>> float(tau[0]), bool(tau[-1] > 50)
        (0.0, True)
        """
        known, tau = self.collisions_per_disk
        if self.event_count is None or len(known) >= self.n_frames:
            return np.interp(time, known, tau)
        # strictly increasing even at rest
        hits, rising = self.events_per_disk, 1e-12 / max(self.time[-1], 1e-300)

        def clock(t: np.ndarray) -> np.ndarray:
            return np.interp(t, self.time, hits) + rising * np.asarray(t)

        return np.interp(clock(time), clock(known), tau)

    @cached_property
    def events_per_disk(self) -> np.ndarray:
        """Mean number (T,) of events per disk from the start up to each frame."""
        if self.event_count is None:
            raise RunError(f"{self.path}: has no event_count in its frames")
        step = max(1, CHUNK // self.n_disks)
        parts = [self.event_count[k : k + step] for k in range(0, max(1, self.n_frames), step)]
        return np.concatenate([part.mean(axis=1) for part in parts])

    @cached_property
    def nature(self) -> Nature:
        """Traits of the run, which determine the applicable theories."""
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
