"""The engine in this process: a simulation to step, look at, save and load.

    with ricochet.Simulation("input/gas.nml", {"run.seed": 2}) as gas:
        gas.advance(time=1.0)
        gas.position, gas.observable("all/kinetic_energy"), gas.next_events(3)

It is the program's own engine (`make library`), with its bits: in whatever steps a simulation goes
on, its state is that of `build/ricochet` with the same input.
"""

import ctypes
import functools
import json
import math
import os
import sys
import threading
import weakref
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from ..commands import HERE
from ..reading.arrays import snapshot
from ..reading.files import RunError, did_you_mean
from ..reading.nature import Nature, nature_of
from .program import (
    ProgramError,
    named,
    settings_of,
    unseen,
    whole_threads,
    without_options,
)

ROOM = 100_000  # size of a message [bytes]
PATIENCE = 0.05  # interval of checks for signals [s]
NEVER = 2**63 - 1
ROUNDING = 1e-14  # relative rounding of a time
FASTEST = 1e100  # largest number that an input accepts
ALIVE: "weakref.WeakSet[Simulation]" = weakref.WeakSet()
#: The arrays of a simulation, and their numbers.
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
    """A simulation in memory, at its start.

    Parameters
    ----------
    system : str, Path or mapping
        an input file, its text, or its groups, as for `ricochet.run`
    overrides : mapping of str to object, optional
        values of variables, as for `ricochet.run`, such as {"contact.restitution": 0.9} or
        {"contact": {"restitution": 0.9}}
    threads : int, optional
        number of threads [that of the input, or one]

    Raises
    ------
    ProgramError
        if the input has a mistake, with the lines of the program

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
        """Start from an input; the class describes the arguments."""
        text, groups = read_input(system), isinstance(system, Mapping)
        settings = settings_of({} if overrides is None else overrides)
        try:
            self._begin(text, settings, threads)
        except ProgramError as problem:
            message = named(problem.message, text if groups else None)
            raise ProgramError(without_options(message, settings), problem.code) from None

    def __repr__(self) -> str:
        """Return one line: disks, time and numbers of events."""
        if not self._handle:
            return "<Simulation: closed>"
        names = [*self.parameters["species"]]
        numbers = np.bincount(self.species, minlength=len(names) + 1)[1:]
        kinds = ", ".join(f"{n} {name}" for n, name in zip(numbers, names, strict=True))
        counts = f"{self.collisions} collisions, {self.events} events"
        return f"<Simulation: {kinds}; t = {self.time:g}, {counts}>"

    @classmethod
    def _of(cls, text: str, settings: list[str]) -> Self:
        """Return a simulation of the text of an input with settings GROUP.VARIABLE=VALUE."""
        self = cls.__new__(cls)
        self._begin(text, settings)
        return self

    def _begin(self, text: str, settings: list[str], threads: int | None = None) -> None:
        """Start from the text of an input with settings GROUP.VARIABLE=VALUE."""
        words = c_text(text), c_text("\n".join(settings))
        engine = library(files=b".h5" in b"".join(words))
        self._take(opened(engine.ricochet_open, *words, whole_threads(threads)))

    def _take(self, handle: int) -> None:
        self._handle, self._lock = handle, threading.RLock()
        self._settled = -1.0  # a time at which all has happened
        ALIVE.add(self)
        self._start_energy = self.observable("all/kinetic_energy") * self.n_disks

    @classmethod
    def load(cls, path: str | Path, threads: int | None = None) -> Self:
        """Return the simulation of the last checkpoint of a run, finished or not.

        Parameters
        ----------
        path : str or Path
            the output file, or its `.part`
        threads : int, optional
            number of threads [that of the input, or one]

        Returns
        -------
        Simulation
            the simulation, at the time of the checkpoint

        Raises
        ------
        ProgramError
            if the file has no checkpoint that can be used

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
        """Write a file from which `ricochet INPUT -o path --resume` continues.

        It contains the samples of the start and the present state.  After a change INPUT differs
        from the input of the start: it is the text that is written to `input`.

        Parameters
        ----------
        path : str or Path
            the output file of the run to be continued
        force : bool
            whether an existing file may be replaced
        input : str or Path, optional
            where to write the present input: a new file, or one that `save` has written and that
            nobody has edited since

        Returns
        -------
        Path
            `path` with `.part` at its end

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
        """Free the memory; the simulation cannot be used afterwards.

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

    def __reduce__(self) -> NoReturn:
        raise TypeError("a simulation cannot be copied or sent; save it, and load it there")

    def _open(self) -> "Held":
        return Held(self)

    def advance(
        self,
        time: float | None = None,
        collisions: int | None = None,
        events: int | None = None,
    ) -> Self:
        """Continue until the first of these values is reached, counted from the start of the run.

        Without any, the stop rule of the input decides, if it has one.  As a run of the program,
        it ends before that when nothing will ever happen, or when a gas that only loses energy has
        cooled to 1e-25 of its first temperature.  An interrupt (Ctrl-C) leaves the simulation in
        the state of that moment.

        Parameters
        ----------
        time : float, optional
            time since the start
        collisions : int, optional
            number of collisions of two disks
        events : int, optional
            number of collisions of any kind; events of one moment are never separated

        Returns
        -------
        Simulation
            this one

        Raises
        ------
        ValueError
            if the time is past, or if neither a value nor the input says how far
        ProgramError
            if the simulation breaks off, as in an inelastic collapse

        Examples
        --------
        >>> with ricochet.Simulation(small) as box:
        ...     box.advance(time=0.1).time, box.advance(collisions=20).collisions
        (0.1, 20)
        """
        limits = (
            math.inf if time is None else float(time),
            NEVER if collisions is None else min(int(collisions), NEVER),
            NEVER if events is None else min(int(events), NEVER),
        )
        if limits == (math.inf, NEVER, NEVER) and self._endless():
            raise ValueError(
                "advance: how far? The input has no &stop; give time, collisions or events"
            )
        if math.isnan(limits[0]):
            raise ValueError("time: nan is no time")
        if limits[0] < self.time * (1 - ROUNDING):
            raise ValueError(f"time: {time} is past; it is {self.time:.6g}")
        while self._go_on(limits, PATIENCE):
            pass
        return self

    def _endless(self) -> bool:
        """Whether no rule of the input stops the run, apart from wall-clock time."""
        return self.parameters.get("stop", {}).keys() <= {"wall_clock"}

    def _go_on(self, limits: tuple[float, int, int], patience: float) -> bool:
        """Advance towards these limits for a few seconds; return whether they are still ahead."""
        with self._open() as handle:
            return called(library().ricochet_advance, handle, *limits, patience)

    def _settle(self) -> float:
        """Complete all events up to now; return a time at which another run has the same state.

        At the end of a slice `time` may be rounded, and the engine may be about to change its
        origin of time; both are over at the next double.
        """
        if self.time != self._settled:
            self._settled = math.nextafter(self.time, math.inf) if self.time > 0 else 0.0
            self.advance(time=self._settled)
        return self._settled

    def change(self, values: Mapping[str, Any]) -> Self:
        """Change variables of the running simulation from this moment on.

        These may be gravity, the drive, and the laws of contacts, sides, walls and obstacles with
        their temperatures, velocities and motions.  The change of the total energy counts as work.

        Parameters
        ----------
        values : mapping of str to object
            values of variables by their full names, such as {"box.gravity": (0, -1)}

        Returns
        -------
        Simulation
            this one

        Raises
        ------
        ProgramError
            if a variable cannot change; then nothing has changed

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
        """The input as it is now, with overrides and changes, as the text of a file."""
        return self._text("input")

    @property
    def changes(self) -> list[tuple[float, str, str]]:
        """Changes during the simulation: time, name and value of each."""
        found = []
        for line in self._text("changes").splitlines():
            time, _, rest = line.partition(" ")
            found.append((float(time), *rest.partition("=")[::2]))
        return found

    @property
    def parameters(self) -> dict[str, Any]:
        """All variables with their values, by groups, as `Run.parameters` has them."""
        found: dict[str, Any] = {}
        for whole, value in self._values().items():
            *groups, name = whole.split(".")
            place = found
            for group in groups:
                place = place.setdefault(group, {})
            place[name] = value
        for group in {"obstacle", "wall"} & found.keys():  # the file has columns of them
            rows = list(found[group].values())
            found |= geometry_of(group, rows)
            found[group] = {name: [row.get(name, np.nan) for row in rows] for name in rows[0]}
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
        """The traits of the simulation so far: see `ricochet.nature`."""
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
        """N, the number of disks."""
        return self._counts()[0]

    @property
    def collisions(self) -> int:
        """Number of collisions of two disks since the start."""
        return self._counts()[1]

    @property
    def events(self) -> int:
        """Number of collisions of any kind since the start."""
        return self._counts()[2]

    def _column(self, name: str) -> np.ndarray:
        """Return a read-only copy of an array of `COLUMNS`, disks in the order of the input."""
        values = np.empty((self.n_disks, 2))
        with self._open() as handle:
            width = library().ricochet_column(handle, name.encode(), values.ctypes.data)
        if width == 0:
            raise AttributeError(f"these disks have no {name}")
        values = values.reshape(-1)[: width * len(values)].astype(COLUMNS[name])
        return snapshot(values.reshape(-1, 2) if width == 2 else values)

    @property
    def position(self) -> np.ndarray:
        """(N, 2) positions [length] within the box where an axis is periodic; a read-only copy."""
        return self._column("position")

    @property
    def velocity(self) -> np.ndarray:
        """(N, 2) velocities [length/time]; a read-only copy.  All can be set at once."""
        return self._column("velocity")

    @velocity.setter
    def velocity(self, value: ArrayLike) -> None:
        array = np.ascontiguousarray(value, dtype=float)
        if array.shape != (self.n_disks, 2):
            raise ValueError(f"velocity: has the shape {array.shape}, not ({self.n_disks}, 2)")
        if not np.abs(array).max() < FASTEST:
            raise ValueError(f"velocity: has values that are not below {FASTEST:g}")
        with self._open() as handle:
            called(library().ricochet_set_velocities, handle, array.ctypes.data)

    @property
    def angular_velocity(self) -> np.ndarray:
        """(N,) angular velocities [1/time]; AttributeError if the disks cannot turn."""
        return self._column("angular_velocity")

    @property
    def orientation(self) -> np.ndarray:
        """(N,) angles to the x axis [rad], not wrapped; AttributeError without a direction."""
        return self._column("orientation")

    @property
    def image(self) -> np.ndarray:
        """(N, 2) periods that each disk has crossed; AttributeError without a periodic side."""
        return self._column("image")

    @property
    def radius(self) -> np.ndarray:
        """(N,) radii [length]."""
        return self._column("radius")

    @property
    def mass(self) -> np.ndarray:
        """(N,) masses."""
        return self._column("mass")

    @property
    def species(self) -> np.ndarray:
        """(N,) numbers of the species, from 1, in the order of the input."""
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
        """The names of the observables, as in the output file."""
        return list(self._observed())

    def observable(self, name: str) -> Any:
        """Return the present value of an observable.

        Parameters
        ----------
        name : str
            name as in the output file, such as "all/kinetic_energy"; `observables` has all

        Returns
        -------
        float, int or numpy.ndarray
            a number, or an array of its components

        Raises
        ------
        RunError
            if there is no observable of that name

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
            number of events; there may be fewer

        Returns
        -------
        list of tuple
            (time, i, j) of each event, i and j as in `EventLog`

        Raises
        ------
        RunError
            if the simulation is by time steps, which cannot predict events

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
            raise RunError("next_events: time steps do not know what comes")
        return [(float(t), int(i), int(j)) for t, i, j in records[:n, :3]]


def geometry_of(group: str, rows: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """The table of all obstacles, if a group has a file or points; its own row is emptied."""
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
    """Close, in a child process, the simulations that another thread was advancing."""
    for simulation in ALIVE:
        if not simulation._lock.acquire(blocking=False):
            simulation._handle = None
        simulation._lock = threading.RLock()


os.register_at_fork(after_in_child=after_fork)


class Held:
    """Lock of a simulation, so that no other thread advances or closes it meanwhile."""

    def __init__(self, simulation: Simulation):
        """Take the simulation; `with` acquires the lock and returns the handle."""
        self.simulation = simulation

    def __enter__(self) -> int:
        self.simulation._lock.acquire()
        if not self.simulation._handle:
            self.simulation._lock.release()
            raise ValueError("the simulation is closed")
        return self.simulation._handle

    def __exit__(self, *_: object) -> None:
        self.simulation._lock.release()


# --- the library ---


def head_of(text: str) -> str:
    """The first line of an input that `save` writes: it says what the rest was."""
    crc = zlib.crc32(text.encode(errors="surrogateescape"))
    return f"! Saved by ricochet.Simulation, which may replace it unless it is edited: {crc:08x}\n"


def check_input_place(path: Path, output: Path) -> None:
    """Refuse a place where `save` would write its input over something else."""
    c_text(path)
    try:
        if path.parent.resolve() == output.parent.resolve() and path.name in [
            output.name + end for end in ("", ".part", ".part_new", ".lock")
        ]:
            raise ProgramError(f"{path}: is a file of the output; choose another for the input", 3)
        if not path.parent.is_dir():
            raise ProgramError(f"{path}: there is no folder {path.parent}", 3)
        if not os.path.lexists(path):
            return
        if path.is_file() and not path.is_symlink():
            text = path.read_text(encoding="utf-8", errors="surrogateescape")
            head, end, rest = text.partition("\n")
            if head + end == head_of(rest):
                return
    except OSError as error:
        raise ProgramError(f"{path}: cannot be written: {error.strerror}", 3) from error
    raise ProgramError(
        f"{path}: exists already, and save has not written it; choose another file for the input", 3
    )


def write_input(path: Path, text: str) -> None:
    """Write an input, in place of one that `save` has written; never through a link."""
    try:
        path.unlink(missing_ok=True)
        with path.open("x", encoding="utf-8", errors="surrogateescape") as file:
            file.write(head_of(text) + text)
    except OSError as error:
        raise ProgramError(f"{path}: cannot be written: {error.strerror}", 3) from error


def read_input(system: str | Path | Mapping[str, Any]) -> str:
    """Return the text of an input of any kind."""
    if (text := unseen(system)) is not None:
        return text
    try:
        return Path(cast(str, system)).read_text(encoding="utf-8", errors="surrogateescape")
    except OSError as error:
        raise ProgramError(f"{system}: cannot be read: {error.strerror}", 3) from error


def c_text(text: str | Path) -> bytes:
    """Return a text or a path for the library; a zero byte in it is refused."""
    words = os.fsencode(text) if isinstance(text, Path) else text.encode(errors="surrogateescape")
    if b"\0" in words:
        raise ValueError(f"{text!r} has a zero byte")
    return words


def opened(make: Callable[..., int], *arguments: object) -> int:
    """Return a new handle from a function of the library; raise its error."""
    message, code = ctypes.create_string_buffer(ROOM), ctypes.c_int()
    handle = make(*arguments, message, ROOM, ctypes.byref(code))
    if not handle:
        raise ProgramError(message.value.decode(errors="replace"), code.value)
    return handle


def called(function: Callable[..., int], *arguments: object) -> bool:
    """Call a function of the library; raise its error; return whether to call it again."""
    message = ctypes.create_string_buffer(ROOM)
    code = function(*arguments, message, ROOM)
    if code > 1:
        raise ProgramError(message.value.decode(errors="replace"), code)
    return code == 1


@functools.cache
def library(files: bool = False) -> ctypes.CDLL:
    """Load the engine; the version with functions for files needs the HDF5 of the system."""
    name = "libricochet_files.so" if files else "libricochet.so"
    wish = os.environ.get("RICOCHET_LIBRARY")  # a folder
    places = [Path(wish)] if wish else [HERE / "lib", HERE.parents[1] / "build"]
    path = next((place / name for place in places if (place / name).is_file()), None)
    if path is None:
        raise ProgramError(f"no {name} in {places[-1]}: run make library in a clone", 3)
    engine = ctypes.CDLL(str(path))  # its symbols are its own: no clash with the HDF5 of h5py
    p, n, text = ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p
    long, real = ctypes.c_int64, ctypes.c_double
    answer = [ctypes.c_char_p, n]
    kinds = {
        "open": (p, text, text, n, *answer, p),
        "close": (None, p),
        "advance": (n, p, real, long, long, real, *answer),
        "time": (real, p),
        "count": (None, p, p),
        "column": (n, p, text, p),
        "observables": (n, p, text, n, p),
        "next_events": (n, p, n, p),
        "change": (n, p, text, *answer),
        "set_velocities": (n, p, p, *answer),
        "text": (n, p, text, text, n),
    }
    if files:
        kinds |= {
            "save": (n, p, text, n, *answer),
            "load": (p, text, n, *answer, p),
        }
    for function, (result, *arguments) in kinds.items():
        it = getattr(engine, f"ricochet_{function}")
        it.restype, it.argtypes = result, arguments
    return engine
