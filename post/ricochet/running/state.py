"""Present state of a simulation in memory: disks, observables, input variables and events."""

import ctypes
import json
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..reading.arrays import snapshot
from ..reading.files import RunError, did_you_mean
from ..reading.nature import Nature, nature_of
from ..reading.reader import EventLog
from ..reading.records import changes_in
from .engine import ROOM, called, library
from .session import Session
from .starting import real_numbers

FASTEST = 1e100  # largest number allowed in an input
#: Element type of each array of a simulation.
COLUMNS = {
    "position": float,
    "velocity": float,
    "angular_velocity": float,
    "orientation": float,
    "image": np.int64,
    "present": np.int64,
    "recycled": np.int64,
    "radius": float,
    "mass": float,
    "species": np.int32,
}


class State(Session):
    """Present state of a simulation in memory."""

    __slots__ = ("_start_energy",)
    _start_energy: float

    @property
    def input(self) -> str:
        """Text of an input file with the present values, including overrides and changes."""
        return self._text("input")

    @property
    def changes(self) -> list[tuple[float, str, str]]:
        """Time, variable and new value of each change during the simulation."""
        found = changes_in(self._text("changes"))
        return [(time, name, value) for time, name, value in found]

    @property
    def parameters(self) -> dict[str, Any]:
        """Values of all input variables by group, in the format of `Run.parameters`."""
        found: dict[str, Any] = {}
        for whole, value in self._values().items():
            *groups, name = whole.split(".")
            place = found
            for group in groups:
                place = place.setdefault(group, {})
            place[name] = value
        for group in {"obstacle", "wall"} & found.keys():  # the output file stores them as columns
            rows = list(found[group].values())
            found |= geometry_of(group, rows)
            names = dict.fromkeys(name for row in rows for name in row)  # keeps the order
            found[group] = {name: [row.get(name, np.nan) for row in rows] for name in names}
            if "side" in found[group]:
                found[group]["inside"] = [side == "inside" for side in found[group]["side"]]
        if changes := self._text("changes"):
            found["changes"] = changes
        return found

    def _values(self) -> dict[str, Any]:
        """Return the values of all variables that have one, by GROUP.NAME.VARIABLE."""
        lines = (line.split(" = ", 1) for line in self._text("parameters").splitlines())
        return {name: json.loads(text) if ", ... " not in text else text for name, text in lines}

    @property
    def nature(self) -> Nature:
        """Traits of the simulation so far; see `ricochet.nature`."""
        energy = self.observable("all/kinetic_energy") * self.n_disks
        lost = self.observable("dissipated_energy")
        return nature_of(
            self.parameters,
            self.mass,
            self.radius,
            lost=lost / max(energy, self._start_energy) if lost else 0.0,
            turning="all/rotational_energy" in self.observables,
            collapsed="collapse" in self._text("note"),
        )

    @property
    def time(self) -> float:
        """Time since the start of the run."""
        with self._open() as handle:
            return library().ricochet_time(handle)

    def _counts(self) -> list[int]:
        counts = (ctypes.c_int64 * 3)()
        with self._open() as handle:
            library().ricochet_count(handle, counts)
        return list(counts)

    @property
    def n_disks(self) -> int:
        """Number N of disks."""
        return self._counts()[0]

    @property
    def collisions(self) -> int:
        """Number of disk-disk collisions since the start."""
        return self._counts()[1]

    @property
    def events(self) -> int:
        """Number of events (collisions of any kind) since the start."""
        return self._counts()[2]

    def _column(self, name: str) -> np.ndarray:
        """Return a read-only copy of an array in `COLUMNS`, in the order of the input."""
        values = np.empty((self.n_disks, 2))
        with self._open() as handle:
            width = library().ricochet_column(handle, name.encode(), values.ctypes.data)
        if width == 0:
            raise AttributeError(f"these disks have no {name}")
        values = values.reshape(-1)[: width * len(values)].astype(COLUMNS[name])
        return snapshot(values.reshape(-1, 2) if width == 2 else values)

    @property
    def position(self) -> np.ndarray:
        """Positions of the disks, (N, 2) [length], as a read-only copy.

        Along periodic axes they are inside the box. All positions can be set at once, if no disks
        overlap afterwards. The change of the total energy is added to the observable `work`.
        """
        return self._column("position")

    @position.setter
    def position(self, value: ArrayLike) -> None:
        if not np.array_equal(value, self.position, equal_nan=True):
            self._set("position", value, library().ricochet_set_positions)

    @property
    def velocity(self) -> np.ndarray:
        """Velocities of the disks, (N, 2) [length/time], as a read-only copy.

        All velocities can be set at once. The change of the total energy is added to the observable
        `work`.
        """
        return self._column("velocity")

    @velocity.setter
    def velocity(self, value: ArrayLike) -> None:
        self._set("velocity", value, library().ricochet_set_velocities)

    def _set(self, name: str, value: ArrayLike, function: Callable[..., int]) -> None:
        """Pass an array (N, 2) to a function of the library."""
        array = np.ascontiguousarray(real_numbers(name, value), dtype=float)
        if array.shape != (self.n_disks, 2):
            raise ValueError(f"{name}: has the shape {array.shape}, not ({self.n_disks}, 2)")
        present = getattr(self, "present", None)  # missing in closed systems
        inside = slice(None) if present is None else present.astype(bool)
        if not np.abs(array[inside]).max(initial=0) < FASTEST:
            raise ValueError(f"{name}: has values that are not below {FASTEST:g}")
        with self._open() as handle:
            called(function, handle, array.ctypes.data)

    @property
    def angular_velocity(self) -> np.ndarray:
        """Angular velocities, (N,) [1/time]; AttributeError if the disks cannot rotate."""
        return self._column("angular_velocity")

    @property
    def orientation(self) -> np.ndarray:
        """Angles between disks and the x axis, (N,) [rad], not reduced modulo 2 pi.

        AttributeError is raised if the disks have no orientations.
        """
        return self._column("orientation")

    @property
    def image(self) -> np.ndarray:
        """Image counters (N, 2): the box lengths to add to a position for a continuous path.

        AttributeError is raised if no side is periodic.
        """
        return self._column("image")

    @property
    def present(self) -> np.ndarray:
        """1 for disks in the box and 0 for disks outside, (N,).

        Positions, velocities and angles of disks outside are NaN; new values for these disks are
        ignored. AttributeError is raised if no disk can leave or enter the box.
        """
        return self._column("present")

    @property
    def recycled(self) -> np.ndarray:
        """Number of times each disk has been recycled, (N,).

        AttributeError is raised unless the driving recycles disks.
        """
        return self._column("recycled")

    @property
    def radius(self) -> np.ndarray:
        """Radii of the disks, (N,) [length]."""
        return self._column("radius")

    @property
    def mass(self) -> np.ndarray:
        """Masses of the disks, (N,)."""
        return self._column("mass")

    @property
    def species(self) -> np.ndarray:
        """Index of the species of each disk, (N,), counted from 1 in the order of the input."""
        return self._column("species")

    def _observed(self) -> dict[str, np.ndarray]:
        room = ROOM
        with self._open() as handle:
            while True:
                names, values = ctypes.create_string_buffer(room), np.empty(4 * room // 8)
                length = library().ricochet_observables(handle, names, room, values.ctypes.data)
                if length < room:
                    break
                room = length + 1
        found, first = {}, 0
        for line in names.value.decode().splitlines():
            name, width = line.rsplit(" ", 1)
            part = values[first : first + abs(int(width))]
            found[name] = part.astype(np.int64 if int(width) < 0 else float)
            first += len(part)
        return found

    @property
    def observables(self) -> list[str]:
        """Names of the observables, as in an output file."""
        return list(self._observed())

    def observable(self, name: str) -> Any:
        """Return the present value of an observable.

        Parameters
        ----------
        name : str
            one of `observables`, such as "all/kinetic_energy"

        Returns
        -------
        float, int or numpy.ndarray
            a number, or an array of components

        Raises
        ------
        RunError
            if there is no observable of this name

        Examples
        --------
        >>> with ricochet.Simulation(small) as box:
        ...     box.advance(collisions=20).observable("collisions")
        20
        """
        found = self._observed()
        if name not in found:
            raise RunError(f"there is no observable {name}{did_you_mean(name, found)}")
        return found[name].item() if len(found[name]) == 1 else found[name]

    def next_events(self, most: int) -> list[tuple[float, int, int]]:
        """Return the next events in chronological order.

        Parameters
        ----------
        most : int
            largest number of events

        Returns
        -------
        list of tuple
            time, i and j of each event (see `EventLog`)

        Raises
        ------
        RunError
            if the simulation is time-stepped, because events cannot then be predicted

        Examples
        --------
        >>> with ricochet.Simulation(small) as box:
        ...     times = [time for time, _, _ in box.next_events(3)]
        >>> times == sorted(times), len(times)
        (True, 3)
        """
        records = np.empty((max(int(most), 0), 6))
        with self._open() as handle:
            n = library().ricochet_next_events(handle, len(records), records.ctypes.data)
        if n < 0:
            raise RunError("next_events: time steps do not predict events")
        return [(float(t), int(i), int(j)) for t, i, j in records[:n, :3]]

    def _last_events(self, most: int) -> np.ndarray:
        """Return time, i, j, impulse and momentum change (E, 6) of the latest events."""
        records = np.empty((most, 6))
        with self._open() as handle:
            n = library().ricochet_last_events(handle, most, records.ctypes.data)
        return records[:n]

    def event_log(self, most: int) -> EventLog:
        """Return the latest events in chronological order; the engine stores a million of them.

        Parameters
        ----------
        most : int
            largest number of events

        Returns
        -------
        EventLog
            times, ids of the disks, and impulses of E events

        Raises
        ------
        RunError
            unless the input has `output.event_log = .true.`

        Examples
        --------
        >>> with ricochet.Simulation(small, {"output.event_log": True}) as box:
        ...     log = box.advance(events=30).event_log(10)
        >>> len(log.time), bool(np.all(np.diff(log.time) >= 0))
        (10, True)
        """
        if not self.parameters.get("output", {}).get("event_log"):
            raise RunError("the simulation has no event log, set output.event_log = .true.")
        records = self._last_events(min(max(int(most), 0), self.events))
        ids = records[:, 1:3].astype(np.int32)
        return EventLog(records[:, 0], ids[:, 0], ids[:, 1], records[:, 3], records[:, 4:])


def geometry_of(group: str, rows: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return a table of obstacles or walls if a row of the input defines several, otherwise {}.

    Such a row contains the variable `file` or `points`; its coordinates in the table are NaN.
    """
    if not any({"file", "points"} & row.keys() for row in rows):
        return {}
    wide = {"from": 2, "to": 2} if group == "wall" else {"centre": 2, "radius": 1}
    table = {
        name: np.concatenate([np.reshape(row[name], (-1, 2)[:width]) for row in rows])
        for name, width in wide.items()
    }
    counts = [np.size(row[name]) // width for row in rows for name, width in [*wide.items()][-1:]]
    table["group"] = np.repeat(np.arange(1, len(rows) + 1), counts)
    for row in rows:
        several = {"file", "points"} & row.keys()
        row |= {
            name: [np.nan] * 2 if width == 2 else np.nan for name, width in wide.items() if several
        }
    return {f"{group}_rows": table}
