"""Sessions with the engine in this process, each of which owns a simulation in memory."""

import ctypes
import os
import sys
import threading
import weakref
from typing import Self

from .engine import ROOM, library

ALIVE: "weakref.WeakSet[Session]" = weakref.WeakSet()


class Session:
    """Session with the engine, which owns one simulation in memory."""

    __slots__ = ("__weakref__", "_handle", "_lock")
    _handle: int | None
    _lock: threading.RLock

    def _take(self, handle: int) -> None:
        self._handle, self._lock = handle, threading.RLock()
        ALIVE.add(self)

    def close(self) -> None:
        """Free the memory of the simulation, which cannot be used afterwards.

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

    def _open(self) -> "Held":
        return Held(self)

    def _text(self, what: str) -> str:
        room = ROOM
        with self._open() as handle:
            while True:
                text = ctypes.create_string_buffer(room)
                length = library().ricochet_text(handle, what.encode(), text, room)
                if length < room:
                    return text.value.decode(errors="surrogateescape")
                room = length + 1


class Held:
    """Context manager that locks a simulation against other threads."""

    def __init__(self, simulation: Session):
        """Store the simulation; the `with` statement locks it and returns its handle."""
        self.simulation = simulation

    def __enter__(self) -> int:
        self.simulation._lock.acquire()
        if not self.simulation._handle:
            self.simulation._lock.release()
            raise ValueError("the simulation is closed")
        return self.simulation._handle

    def __exit__(self, *_: object) -> None:
        self.simulation._lock.release()


def after_fork() -> None:
    """After a fork, close simulations in the child that other threads of the parent advanced."""
    for simulation in ALIVE:
        if not simulation._lock.acquire(blocking=False):
            simulation._handle = None
        simulation._lock = threading.RLock()


os.register_at_fork(after_in_child=after_fork)
