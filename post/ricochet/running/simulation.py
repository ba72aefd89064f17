"""Simulations in memory, which can be advanced, changed, analysed, saved and loaded.

    with ricochet.Simulation("input/gas.nml", {"run.seed": 2}) as gas:
        gas.advance(time=1.0)
        gas.position, gas.observable("all/kinetic_energy"), gas.next_events(3)

The library (`make library`) contains the engine of the program. The state is bit-identical to the
state in a run of `build/ricochet` with the same input. It does not depend on the times at which
`advance` returned.
"""

import math
import operator
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np

from ..reading.files import RunError
from ..reading.reader import Event
from .engine import c_text, called, library, opened
from .inputs import check_input_place, read_input, write_input
from .program import (
    ProgramError,
    named,
    settings_of,
    whole_threads,
    without_options,
)
from .state import State

PATIENCE = 0.05  # interval of checks for signals [s]
NEVER = 2**63 - 1
ROUNDING = 1e-14  # relative rounding error of a time


class Simulation(State):
    """Simulation in the memory of this process, starting in its initial state.

    Parameters
    ----------
    system : str, Path or mapping
        an input file, the text of an input, or a dictionary of its groups, as for `ricochet.run`
    overrides : mapping of str to object, optional
        values of variables, such as {"contact.restitution": 0.9} or {"contact": {"restitution":
        0.9}}
    threads : int, optional
        number of threads [that of the input, or one]

    Raises
    ------
    ProgramError
        if the input contains an error, with the message of the program

    Examples
    --------
    >>> with ricochet.Simulation(small, {"run.seed": 2}) as box:
    ...     box.advance(collisions=10).position.shape
    (20, 2)
    """

    __slots__ = ("_settled",)
    _settled: float

    def __init__(
        self,
        system: str | Path | Mapping[str, Any],
        overrides: Mapping[str, Any] | None = None,
        threads: int | None = None,
    ):
        """Start a simulation of an input; see the docstring of the class."""
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
        """Return a simulation of an input text with `settings` of the form GROUP.VARIABLE=VALUE."""
        self = cls.__new__(cls)
        self._begin(text, settings)
        return self

    def _begin(self, text: str, settings: list[str], threads: int | None = None) -> None:
        """Start a simulation of an input text with `settings` of the form GROUP.VARIABLE=VALUE."""
        words = c_text(text), c_text("\n".join(settings))
        engine = library(files=b".h5" in b"".join(words))
        self._take(opened(engine.ricochet_open, *words, whole_threads(threads)))

    def _take(self, handle: int) -> None:
        super()._take(handle)
        self._settled = -1.0  # time up to which all events are complete
        self._start_energy = self.observable("all/kinetic_energy") * self.n_disks

    @classmethod
    def load(cls, path: str | Path, threads: int | None = None) -> Self:
        """Return a simulation in the state of the last checkpoint of a run.

        Parameters
        ----------
        path : str or Path
            output file, or unfinished output, whose name ends in `.part`
        threads : int, optional
            number of threads [that of the input, or one]

        Returns
        -------
        Simulation
            the simulation at the time of the checkpoint

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
        """Write an output file with which the command `ricochet INPUT -o path --resume` continues.

        The file holds the present state and samples of the initial state. If variables were
        changed, it holds samples of the present state instead. The command checks that there is
        space for the rest of the run. If variables were changed with `change`, INPUT must contain
        the new values; the argument `input` writes such a file.

        Parameters
        ----------
        path : str or Path
            output file of the run that will continue
        force : bool
            replace an existing file
        input : str or Path, optional
            file to which the input of the continued run is written: a new file, or one written by
            an earlier `save` and not edited since

        Returns
        -------
        Path
            `path` with `.part` appended

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
            write_input(Path(input), self._text("saved input"))
        return path.with_name(f"{path.name}.part")

    def copy(self) -> Self:
        """Return an independent simulation in the same state.

        Copy and original remain bit-identical as long as the same methods are called. `copy.copy`,
        `copy.deepcopy` and pickles work as well. A pickle contains a checkpoint. If the input names
        an initial-configuration file, a process that loads the pickle needs this file.

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

    def advance(
        self,
        time: float | None = None,
        collisions: int | None = None,
        events: int | None = None,
        on_event: Callable[[Event], object] | None = None,
    ) -> Self:
        """Advance the simulation until one of the limits, counted from the start, is reached.

        Without limits, the stop conditions of the input apply. As in a run of the program, the
        simulation ends earlier if no further event can occur, or if a freely cooling gas has cooled
        to 1e-25 of its initial temperature. After an interrupt (Ctrl-C) the simulation can be
        continued.

        Parameters
        ----------
        time : float, optional
            time
        collisions : int, optional
            number of disk-disk collisions
        events : int, optional
            number of events (collisions of any kind); this limit and that of `collisions` are
            exact, even between simultaneous events, but time steps are always completed
        on_event : callable, optional
            function that receives an `Event` after each event, and may read and change the
            simulation; if it returns a true value, the simulation stops after this event or, with
            time steps, after all events of the step; each event takes about 20 microseconds

        Returns
        -------
        Simulation
            the simulation itself

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
            NEVER if collisions is None else whole_limit("collisions", collisions),
            NEVER if events is None else whole_limit("events", events),
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
            duration
        collisions : int, optional
            number of further disk-disk collisions
        events : int, optional
            number of further events (collisions of any kind)
        on_event : callable, optional
            function called after each event, as for `advance`

        Returns
        -------
        Simulation
            the simulation itself

        Raises
        ------
        ValueError
            if no value is given, or a value is negative

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
            further = step if name == "time" else whole_limit(name, step)
            goals[name] = getattr(self, name) + further
        return self.advance(**goals, on_event=on_event)  # type: ignore[arg-type]

    def _report(self, limits: tuple[float, int, int], on_event: Callable[[Event], object]) -> None:
        """Advance towards the limits, calling a function after each event."""
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

    def _endless(self) -> bool:
        """Return whether the input sets no stop condition other than a limit of wall-clock time."""
        return self.parameters.get("stop", {}).keys() <= {"wall_clock"}

    def _go_on(self, limits: tuple[float, int, int], patience: float) -> bool:
        """Advance for at most `patience` [s]; return True as long as no limit has been reached."""
        with self._open() as handle:
            return called(library().ricochet_advance, handle, *limits, patience)

    def _settle(self) -> float:
        """Advance to a time at which another simulation can reproduce the state; return this time.

        After `advance`, `time` may be rounded, and the engine may still have to shift its origin of
        time. The returned time is slightly later. It is reached exactly, because it is the sum of
        the origin and the time since the origin. Not every number is such a sum in floating-point
        arithmetic, so that several numbers are tried.
        """
        ulps = 0
        while self.time != self._settled:
            ulps += 1
            self._settled = self.time + ulps * math.ulp(self.time) if self.time > 0 else 0.0
            self.advance(time=self._settled)
        return self._settled

    def change(self, values: Mapping[str, Any]) -> Self:
        """Change variables of the simulation at the present time.

        Variables of gravity, driving and collision rules can be changed, and also temperatures,
        velocities and motions of boundaries. The change of the total energy is added to the
        observable `work`. A side starts a new motion from its present position; variables that
        belong only to its former motion, such as the force on a piston, are dropped.

        Parameters
        ----------
        values : mapping of str to object
            new values by the full names of variables, such as "box.gravity"

        Returns
        -------
        Simulation
            the simulation itself

        Raises
        ------
        ProgramError
            if a variable cannot be changed, in which case all variables keep their values

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

    def schedule(self, time: float, values: Mapping[str, Any]) -> Self:
        """Schedule a change of variables, like a group `&change` in the input.

        `advance` makes the change after all collisions, but before kicks, at this time. Scheduled
        changes are included in the files that `save` writes, in copies and in pickles.

        Parameters
        ----------
        time : float
            time of the change, counted from the start of the run and later than the present time
        values : mapping of str to object
            new values, as for `change`

        Returns
        -------
        Simulation
            the simulation itself

        Raises
        ------
        ProgramError
            if a variable cannot be changed, or the time has passed; nothing is then scheduled

        Examples
        --------
        >>> with ricochet.Simulation(small) as box:
        ...     _ = box.schedule(0.1, {"box.gravity": (0, -1)})
        ...     box.changes, box.advance(time=0.2).changes
        ([], [(0.1, 'box.gravity', '0, -1')])
        """
        settings = settings_of(values)
        try:
            return self._schedule(time, settings)
        except ProgramError as problem:
            message = without_options(problem.message, settings)
            raise ProgramError(message, problem.code) from None

    def _schedule(self, time: float, settings: list[str]) -> Self:
        lines = c_text("\n".join(settings))
        with self._open() as handle:
            called(library().ricochet_schedule, handle, float(time), lines)
        return self

    def _change(self, settings: list[str]) -> Self:
        with self._open() as handle:
            called(library().ricochet_change, handle, c_text("\n".join(settings)))
        return self


def whole_limit(name: str, limit: float) -> int:
    """Return a limit of the number of events; raise ValueError unless it is a whole number."""
    if limit == math.inf:
        return NEVER
    if isinstance(limit, float | np.floating) and not float(limit).is_integer():
        raise ValueError(f"{name}: {limit} is not a whole number")
    return min(int(limit), NEVER)


def restored(kind: type[Simulation], data: bytes, start_energy: float) -> Simulation:
    """Return the simulation whose checkpoint `data` was pickled."""
    with tempfile.TemporaryDirectory(prefix="ricochet-") as folder:
        path = Path(folder) / "state.h5.part"
        path.write_bytes(data)
        simulation = kind.load(path)
    simulation._start_energy = start_energy
    return simulation
