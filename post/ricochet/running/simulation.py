"""Simulations in memory, which Python can advance, change, analyse, save and load.

    with ricochet.Simulation("input/gas.nml", {"run.seed": 2}) as gas:
        gas.advance(time=1.0)
        gas.position, gas.observable("all/kinetic_energy"), gas.next_events(3)

The library (`make library`) contains the engine of the program.  For the same input, the state of a
`Simulation` is bit-identical to the state in a run of `build/ricochet`.  The state does not depend
on the intermediate times at which `advance` returned.
"""

import ctypes
import json
import math
import operator
import os
import sys
import tempfile
import threading
import weakref
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..reading.arrays import snapshot
from ..reading.files import RunError, did_you_mean
from ..reading.nature import Nature, nature_of
from ..reading.reader import Event, EventLog
from .engine import ROOM, c_text, called, library, opened
from .inputs import check_input_place, read_input, write_input
from .program import (
    ProgramError,
    named,
    settings_of,
    whole_threads,
    without_options,
)

PATIENCE = 0.05  # interval of checks for signals [s]
NEVER = 2**63 - 1
ROUNDING = 1e-14  # relative rounding error of a time
FASTEST = 1e100  # largest number that is allowed in an input
ALIVE: "weakref.WeakSet[Simulation]" = weakref.WeakSet()
#: Type of the elements of each array of a simulation.
COLUMNS = {
    "position": float,
    "velocity": float,
    "angular_velocity": float,
    "orientation": float,
    "image": np.int64,
    "radius": float,
    "mass": float,
    "species": np.int32,
}


class Simulation:
    """A simulation in the memory of this process, which starts at the initial state.

    Parameters
    ----------
    system : str, Path or mapping
        an input file, the text of an input, or a dictionary of its groups, as for `ricochet.run`
    overrides : mapping of str to object, optional
        values of variables, as for `ricochet.run`, such as {"contact.restitution": 0.9} or
        {"contact": {"restitution": 0.9}}
    threads : int, optional
        number of threads [that of the input, or one]

    Raises
    ------
    ProgramError
        if the input contains an error; the exception contains the message of the program

    Examples
    --------
    >>> with ricochet.Simulation(small, {"run.seed": 2}) as box:
    ...     box.advance(collisions=10).position.shape
    (20, 2)
    """

    __slots__ = ("__weakref__", "_handle", "_lock", "_settled", "_start_energy")
    _handle: int | None
    _lock: threading.RLock
    _settled: float
    _start_energy: float

    def __init__(
        self,
        system: str | Path | Mapping[str, Any],
        overrides: Mapping[str, Any] | None = None,
        threads: int | None = None,
    ):
        """Start a simulation of an input; the arguments are described in the class docstring."""
        text, groups = read_input(system), isinstance(system, Mapping)
        settings = settings_of({} if overrides is None else overrides)
        try:
            self._begin(text, settings, threads)
        except ProgramError as problem:
            message = named(problem.message, text if groups else None)
            raise ProgramError(without_options(message, settings), problem.code) from None

    def __repr__(self) -> str:
        """Return a line with numbers of disks, time, and numbers of collisions and events."""
        if not getattr(self, "_handle", None):
            return "<Simulation: closed>"
        names = [*self.parameters["species"]]
        numbers = np.bincount(self.species, minlength=len(names) + 1)[1:]
        kinds = ", ".join(f"{n} {name}" for n, name in zip(numbers, names, strict=True))
        counts = f"{self.collisions} collisions, {self.events} events"
        return f"<Simulation: {kinds}; t = {self.time:g}, {counts}>"

    @classmethod
    def _of(cls, text: str, settings: list[str]) -> Self:
        """Return a simulation of the input `text`; each of `settings` is GROUP.VARIABLE=VALUE."""
        self = cls.__new__(cls)
        self._begin(text, settings)
        return self

    def _begin(self, text: str, settings: list[str], threads: int | None = None) -> None:
        """Start the simulation of the input `text`; each of `settings` is GROUP.VARIABLE=VALUE."""
        words = c_text(text), c_text("\n".join(settings))
        engine = library(files=b".h5" in b"".join(words))
        self._take(opened(engine.ricochet_open, *words, whole_threads(threads)))

    def _take(self, handle: int) -> None:
        self._handle, self._lock = handle, threading.RLock()
        self._settled = -1.0  # a time up to which all events are complete
        ALIVE.add(self)
        self._start_energy = self.observable("all/kinetic_energy") * self.n_disks

    @classmethod
    def load(cls, path: str | Path, threads: int | None = None) -> Self:
        """Return a simulation in the state of the last checkpoint of a finished or unfinished run.

        Parameters
        ----------
        path : str or Path
            the output file of the run, or the unfinished output, whose name ends in `.part`
        threads : int, optional
            number of threads [that of the input, or one]

        Returns
        -------
        Simulation
            the simulation, at the time of the checkpoint

        Raises
        ------
        ProgramError
            if the file contains no usable checkpoint

        Examples
        --------
        >>> with ricochet.Simulation.load(run.path) as box:
        ...     bool(box.time == run.time[-1]), box.n_disks
        (True, 64)
        """
        self = cls.__new__(cls)
        load = library(files=True).ricochet_load
        self._take(opened(load, c_text(Path(path)), whole_threads(threads)))
        return self

    def save(self, path: str | Path, force: bool = False, input: str | Path | None = None) -> Path:
        """Write an output file that the command `ricochet INPUT -o path --resume` can continue.

        The file contains samples of the initial state and of the present state.  If `change` has
        changed variables, INPUT must be the changed input, which this method writes to the file
        `input`.

        Parameters
        ----------
        path : str or Path
            the output file of the run that will continue
        force : bool
            whether an existing file may be replaced
        input : str or Path, optional
            file to which the present input is written; the file must be new, or written by an
            earlier `save` and not edited since

        Returns
        -------
        Path
            the path of the file, which is `path` with `.part` at its end

        Raises
        ------
        ProgramError
            if the file exists already, or cannot be written

        Examples
        --------
        >>> with ricochet.Simulation(small) as box:
        ...     saved = box.advance(collisions=10).save(folder / "saved.h5")
        >>> saved.name
        'saved.h5.part'
        """
        path = Path(path)
        if input is not None:
            check_input_place(Path(input), path)
        with self._open() as handle:
            called(library(files=True).ricochet_save, handle, c_text(path), int(force))
        if input is not None:
            write_input(Path(input), self.input)
        return path.with_name(f"{path.name}.part")

    def close(self) -> None:
        """Free the memory of the simulation; the simulation cannot be used after this call.

        Examples
        --------
        >>> box = ricochet.Simulation(small)
        >>> box.close()
        """
        handle = getattr(self, "_handle", None)
        if handle:
            with self._lock:
                self._handle = None
                library().ricochet_close(handle)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        if not sys.is_finalizing():
            self.close()

    def copy(self) -> Self:
        """Return an independent simulation in the same state.

        After the same calls, the copy and the original are in bit-identical states.  The functions
        `copy.copy`, `copy.deepcopy` and `pickle.dumps` also copy a simulation.  A pickle contains a
        checkpoint, so that another process can load the pickle.  If the input names a starting
        file, this file must exist when the pickle is loaded.

        Returns
        -------
        Simulation
            the copy

        Examples
        --------
        >>> with ricochet.Simulation(small) as box, box.copy() as other:
        ...     other.advance(collisions=10).collisions, box.collisions
        (10, 0)
        """
        twin = type(self).__new__(type(self))
        with self._open() as handle:
            twin._take(opened(library().ricochet_copy, handle))
        twin._settled, twin._start_energy = self._settled, self._start_energy
        return twin

    def __copy__(self) -> Self:
        return self.copy()

    def __deepcopy__(self, _: object) -> Self:
        return self.copy()

    def __reduce__(self) -> tuple[Any, ...]:
        """Return a checkpoint of the simulation for `pickle`."""
        with tempfile.TemporaryDirectory(prefix="ricochet-") as folder:
            data = self.save(Path(folder) / "state.h5").read_bytes()
        return restored, (type(self), data, self._start_energy)

    def _open(self) -> "Held":
        return Held(self)

    def advance(
        self,
        time: float | None = None,
        collisions: int | None = None,
        events: int | None = None,
        on_event: Callable[[Event], object] | None = None,
    ) -> Self:
        """Advance the simulation until one of the limits is reached.

        All limits are counted from the start of the run.  Without limits, the stop rules of the
        input apply.  As in a run of the program, the simulation ends before a limit if no further
        event can occur, or if a gas that only loses energy has cooled to 1e-25 of its initial
        temperature.  After an interrupt (Ctrl-C), the simulation is in the state at the moment of
        the interrupt and can be continued.

        Parameters
        ----------
        time : float, optional
            time since the start
        collisions : int, optional
            number of collisions of two disks
        events : int, optional
            number of events (collisions of any kind); `advance` never ends between simultaneous
            events
        on_event : callable, optional
            function that is called with an `Event` after each event.  The function may read and
            change the simulation, which is in the state just after the event.  If the function
            returns a true value, `advance` ends after all events of that time.  If `on_event` is
            given, each event takes about 20 microseconds

        Returns
        -------
        Simulation
            this simulation

        Raises
        ------
        ValueError
            if a limit has already been passed, or if neither the arguments nor the input set a
            limit
        RunError
            if no further event can occur, so that no limit can be reached
        ProgramError
            if the simulation cannot continue, for example after an inelastic collapse

        Examples
        --------
        >>> with ricochet.Simulation(small) as box:
        ...     box.advance(time=0.1).time, box.advance(collisions=20).collisions
        (0.1, 20)
        >>> with ricochet.Simulation(small) as box:
        ...     found = []
        ...     box.advance(events=5, on_event=found.append).events, len(found), found[0].i > 0
        (5, 5, True)
        """
        limits = (
            math.inf if time is None else float(time),
            NEVER if collisions is None else min(int(collisions), NEVER),
            NEVER if events is None else min(int(events), NEVER),
        )
        given = limits != (math.inf, NEVER, NEVER)
        if not given and self._endless():
            raise ValueError(
                "advance: no limit; the input has no &stop: give time, collisions or events"
            )
        if math.isnan(limits[0]):
            raise ValueError("time: nan is not a time")
        before = (self.time, self.collisions, self.events)
        if limits[0] < before[0] * (1 - ROUNDING):
            raise ValueError(f"time: {time} has passed; it is {before[0]:.6g}")
        for name, limit, now in zip(("collisions", "events"), limits[1:], before[1:], strict=True):
            if limit < now:
                raise ValueError(f"{name}: {limit} has passed; there were {now}")
        if on_event is None:
            while self._go_on(limits, PATIENCE):
                pass
        else:
            self._report(limits, on_event)
        after = (self.time, self.collisions, self.events)
        if given and before == after and all(map(operator.lt, after, limits)):
            why = self._text("note") or "no disk will ever collide again"
            raise RunError(f"advance: none of the values will be reached: {why}")
        return self

    def advance_by(
        self,
        time: float | None = None,
        collisions: int | None = None,
        events: int | None = None,
        on_event: Callable[[Event], object] | None = None,
    ) -> Self:
        """Advance the simulation by a time, or by a number of collisions or events.

        Parameters
        ----------
        time : float, optional
            duration by which to advance
        collisions : int, optional
            number of further collisions of two disks
        events : int, optional
            number of further events (collisions of any kind)
        on_event : callable, optional
            function that is called after each event, as for `advance`

        Returns
        -------
        Simulation
            this simulation

        Raises
        ------
        ValueError
            if no value is given, or if a value is negative

        Examples
        --------
        >>> with ricochet.Simulation(small) as box:
        ...     box.advance(collisions=4).advance_by(collisions=3).collisions
        7
        """
        steps = {"time": time, "collisions": collisions, "events": events}
        goals = {name: step for name, step in steps.items() if step is not None}
        if not goals:
            raise ValueError("advance_by: give time, collisions or events")
        for name, step in goals.items():
            if not step >= 0:
                raise ValueError(f"{name}: {step} is not a number from 0")
            goals[name] = getattr(self, name) + step
        return self.advance(**goals, on_event=on_event)  # type: ignore[arg-type]

    def _report(self, limits: tuple[float, int, int], on_event: Callable[[Event], object]) -> None:
        """Advance towards the limits and call a function after each event."""
        stopped = False
        while not stopped:
            before = self.events
            with self._open() as handle:
                advance = library().ricochet_advance_event
                while called(advance, handle, *limits, PATIENCE):
                    pass
                records = self._last_events(self.events - before)
            if len(records) == 0:
                return
            for t, i, j, impulse, *change in records.tolist():
                event = Event(t, int(i), int(j), impulse, np.array(change))
                stopped = bool(on_event(event)) or stopped

    def _last_events(self, most: int) -> np.ndarray:
        """Return an array (E, 6): time, i, j, impulse and momentum change of the latest events."""
        records = np.empty((most, 6))
        with self._open() as handle:
            n = library().ricochet_last_events(handle, most, records.ctypes.data)
        return records[:n]

    def event_log(self, most: int) -> EventLog:
        """Return the latest events in chronological order.

        The engine stores at least the latest million events.

        Parameters
        ----------
        most : int
            largest number of events to return

        Returns
        -------
        EventLog
            times, numbers of the disks, and impulses of E events

        Raises
        ------
        RunError
            if the input does not contain `output.event_log = .true.`

        Examples
        --------
        >>> with ricochet.Simulation(small, {"output.event_log": True}) as box:
        ...     log = box.advance(events=30).event_log(10)
        >>> len(log.time), bool(np.all(np.diff(log.time) >= 0))
        (10, True)
        """
        if not self.parameters.get("output", {}).get("event_log"):
            raise RunError("the simulation has no event log, set output.event_log = .true.")
        records = self._last_events(max(int(most), 0))
        ids = records[:, 1:3].astype(np.int32)
        return EventLog(records[:, 0], ids[:, 0], ids[:, 1], records[:, 3], records[:, 4:])

    def _endless(self) -> bool:
        """Return whether the input sets no stop rule other than a limit of the wall-clock time."""
        return self.parameters.get("stop", {}).keys() <= {"wall_clock"}

    def _go_on(self, limits: tuple[float, int, int], patience: float) -> bool:
        """Advance for at most `patience` [s]; return whether no limit has been reached yet."""
        with self._open() as handle:
            return called(library().ricochet_advance, handle, *limits, patience)

    def _settle(self) -> float:
        """Advance to the next time at which the state is reproducible, and return this time.

        After a call of `advance`, the attribute `time` may be rounded, and the engine may still
        have to shift its origin of time.  Therefore `_settle` advances to a slightly later time
        that the engine reaches exactly.  Another simulation that advances to that later time has
        the same state.  The time of a simulation is the sum of this origin and the time since the
        origin.  The sum may skip every second floating-point number, so that several later times
        are tried.
        """
        ulps = 0
        while self.time != self._settled:
            ulps += 1
            self._settled = self.time + ulps * math.ulp(self.time) if self.time > 0 else 0.0
            self.advance(time=self._settled)
        return self._settled

    def change(self, values: Mapping[str, Any]) -> Self:
        """Change variables of the simulation at the present time.

        The variables that can change are gravity, the driving, the collision rules of disks and
        boundaries, and the temperatures, velocities and motions of boundaries.  If the total energy
        changes, the change of the energy counts as work.

        Parameters
        ----------
        values : mapping of str to object
            values of variables by their full names, such as {"box.gravity": (0, -1)}

        Returns
        -------
        Simulation
            this simulation

        Raises
        ------
        ProgramError
            if a variable cannot be changed; in this case all variables keep their values

        Examples
        --------
        >>> with ricochet.Simulation(small) as box:
        ...     box.change({"box.gravity": (0, -1)}).changes
        [(0.0, 'box.gravity', '0, -1')]
        """
        settings = settings_of(values)
        try:
            return self._change(settings)
        except ProgramError as problem:
            message = without_options(problem.message, settings)
            raise ProgramError(message, problem.code) from None

    def _change(self, settings: list[str]) -> Self:
        with self._open() as handle:
            called(library().ricochet_change, handle, c_text("\n".join(settings)))
        return self

    def _text(self, what: str) -> str:
        room = ROOM
        with self._open() as handle:
            while True:
                text = ctypes.create_string_buffer(room)
                length = library().ricochet_text(handle, what.encode(), text, room)
                if length < room:
                    return text.value.decode(errors="surrogateescape")
                room = length + 1

    @property
    def input(self) -> str:
        """Text of an input file with the present values, including overrides and changes."""
        return self._text("input")

    @property
    def changes(self) -> list[tuple[float, str, str]]:
        """Time, name of the variable, and new value of each change during the simulation."""
        found = []
        for line in self._text("changes").splitlines():
            time, _, rest = line.partition(" ")
            found.append((float(time), *rest.partition("=")[::2]))
        return found

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
        for group in {"obstacle", "wall"} & found.keys():  # the file contains them as columns
            rows = list(found[group].values())
            found |= geometry_of(group, rows)
            found[group] = {name: [row.get(name, np.nan) for row in rows] for name in rows[0]}
            if "side" in found[group]:
                found[group]["inside"] = [side == "inside" for side in found[group]["side"]]
        if changes := self._text("changes"):
            found["changes"] = changes
        return found

    def _values(self) -> dict[str, Any]:
        """Return the values of all variables that have a value; each key is GROUP.NAME.VARIABLE."""
        lines = (line.split(" = ", 1) for line in self._text("parameters").splitlines())
        return {name: json.loads(text) if ", ... " not in text else text for name, text in lines}

    @property
    def nature(self) -> Nature:
        """Physical properties of the simulation until the present time; see `ricochet.nature`."""
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
        """Number of collisions of two disks since the start."""
        return self._counts()[1]

    @property
    def events(self) -> int:
        """Number of events (collisions of any kind) since the start."""
        return self._counts()[2]

    def _column(self, name: str) -> np.ndarray:
        """Return a read-only copy of an array in `COLUMNS`; disks are in the order of the input."""
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

        Along a periodic axis, all positions are inside the box.  All positions can be set at once,
        if no disks overlap at the new positions; the change of energy counts as work.
        """
        return self._column("position")

    @position.setter
    def position(self, value: ArrayLike) -> None:
        if not np.array_equal(value, self.position):
            self._set("position", value, library().ricochet_set_positions)

    @property
    def velocity(self) -> np.ndarray:
        """Velocities of the disks, (N, 2) [length/time], as a read-only copy.

        All velocities can be set at once; the change of energy counts as work.
        """
        return self._column("velocity")

    @velocity.setter
    def velocity(self, value: ArrayLike) -> None:
        self._set("velocity", value, library().ricochet_set_velocities)

    def _set(self, name: str, value: ArrayLike, function: Callable[..., int]) -> None:
        """Pass an array (N, 2) to a function of the library."""
        array = np.ascontiguousarray(value, dtype=float)
        if array.shape != (self.n_disks, 2):
            raise ValueError(f"{name}: has the shape {array.shape}, not ({self.n_disks}, 2)")
        if not np.abs(array).max() < FASTEST:
            raise ValueError(f"{name}: has values that are not below {FASTEST:g}")
        with self._open() as handle:
            called(function, handle, array.ctypes.data)

    @property
    def angular_velocity(self) -> np.ndarray:
        """Angular velocities, (N,) [1/time]; raises AttributeError if the disks cannot rotate."""
        return self._column("angular_velocity")

    @property
    def orientation(self) -> np.ndarray:
        """Orientations of the disks, (N,) [rad].

        An orientation is an angle from the x axis, which is not reduced modulo 2 pi.  If the disks
        have no orientations, AttributeError is raised.
        """
        return self._column("orientation")

    @property
    def image(self) -> np.ndarray:
        """Number of box lengths that each disk has moved across periodic sides, (N, 2).

        Adding these numbers, times the edges of the box, to the positions gives continuous paths.
        If no side is periodic, AttributeError is raised.
        """
        return self._column("image")

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
        """Number of the species of each disk, (N,), counted from 1 in the order of the input."""
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
        """Names of the observables, which are the names in an output file."""
        return list(self._observed())

    def observable(self, name: str) -> Any:
        """Return the present value of an observable.

        Parameters
        ----------
        name : str
            name of the observable in the output file, such as "all/kinetic_energy"; the attribute
            `observables` lists all names

        Returns
        -------
        float, int or numpy.ndarray
            a number, or an array of the components

        Raises
        ------
        RunError
            if no observable has that name

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
            largest number of events to return

        Returns
        -------
        list of tuple
            time, i and j of each event; the numbers i and j are defined as in `EventLog`

        Raises
        ------
        RunError
            if the simulation is time-stepped, so that events cannot be predicted

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


def restored(kind: type[Simulation], data: bytes, start_energy: float) -> Simulation:
    """Return the simulation whose checkpoint `data` was stored in a pickle."""
    with tempfile.TemporaryDirectory(prefix="ricochet-") as folder:
        path = Path(folder) / "state.h5.part"
        path.write_bytes(data)
        simulation = kind.load(path)
    simulation._start_energy = start_energy
    return simulation


def geometry_of(group: str, rows: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the table of all obstacles or walls if a row of the input names a file or points.

    In such a row, the coordinates are replaced by NaN.
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


def after_fork() -> None:
    """Close, in the child of a fork, the simulations that another thread was advancing."""
    for simulation in ALIVE:
        if not simulation._lock.acquire(blocking=False):
            simulation._handle = None
        simulation._lock = threading.RLock()


os.register_at_fork(after_in_child=after_fork)


class Held:
    """Context manager that locks a simulation, so that no other thread advances or closes it."""

    def __init__(self, simulation: Simulation):
        """Store the simulation; the statement `with` acquires its lock and returns its handle."""
        self.simulation = simulation

    def __enter__(self) -> int:
        self.simulation._lock.acquire()
        if not self.simulation._handle:
            self.simulation._lock.release()
            raise ValueError("the simulation is closed")
        return self.simulation._handle

    def __exit__(self, *_: object) -> None:
        self.simulation._lock.release()
