"""Part of a run between two times, as a run under the laws in force during this time.

    for window in run.windows():                     # between successive changes (`&change`)
        print(window.restitution, window.observable("all/temperature").mean())

In a window all times are measured from its start. Counts and sums that the program accumulates
from the start of the run, such as collisions and dissipated energy, begin at zero with the first
sample of the window.
"""

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from .arrays import Index, as_index
from .files import RunError
from .frames import Frames, Series
from .nature import Nature
from .reader import Run
from .changed import changed
from .records import EventLog
from .results import SIDES

#: Observables that the program accumulates from the start of a run, apart from counts.
SUMS = {
    "virial",
    "virial_tensor",
    "dissipated_energy",
    "drive_energy",
    "heat",
    "work",
    "side_impulse",
    "outflow_energy",
    "inflow_energy",
    "helfand_stress",
    "helfand_heat",
    "heat_virial",
}
#: The last parts of the names of such observables of single boundaries.
SUMS_OF_BOUNDARIES = ("/impulse", "/energy_to_disks")
#: The last parts of the names of counts that do not accumulate.
PRESENT_COUNTS = ("inside", "/particle_number")
#: Traits that a run does not lose by a change of its laws.
LASTING = {"open", "collapsed"}


@dataclass(frozen=True, eq=False, repr=False)
class Window(Run):
    """Part of a run, from the time `start` up to, but not including, the time `end`."""

    whole: Run
    start: float
    end: float

    def observable(self, name: str) -> Series:
        """Return the samples of an observable in the window; see `Run.observable`."""
        time, value = self.whole.observable(name)
        inside = self._contains(time)
        if not inside.any():
            some = "set output.observables_every_time"
            raise RunError(f"{self.path}: has no observables in {self._span}; {some}")
        own, found = time[inside] - self.start, value[inside]
        if name == "virial_pressure":
            found = found + self._pressure_change(own)
        elif accumulates(name, value):
            found = found - found[0]
        return Series(own, found)

    def _pressure_change(self, time: np.ndarray) -> np.ndarray:
        """Return the change of `virial_pressure` if the virial is averaged from the start (T,)."""
        samples, virial = self.whole.observable("virial")
        virial = virial[self._contains(samples)]
        elapsed = time + self.start
        before = np.divide(virial, 2 * elapsed, out=np.zeros_like(virial), where=elapsed > 0)
        gain, passed = virial - virial[0], time - time[0]
        since = np.divide(gain, 2 * passed, out=np.zeros_like(virial), where=passed > 0)
        return (since - before) / self.accessible_area(time)

    @cached_property
    def _event_log(self) -> EventLog:
        log = self.whole.event_log()
        inside = self._contains(log.time)
        parts = {k: part[inside] for k, part in log._asdict().items() if part is not None}
        return EventLog(**parts | {"time": parts["time"] - self.start})

    def unwrapped(self, frame: Index) -> np.ndarray:
        """Return positions that are continuous in time; see `Run.unwrapped`."""
        first = int(np.searchsorted(self.whole.time, self.start + self.time[0]))
        return self.whole.unwrapped(first + np.arange(self.n_frames)[as_index(frame)])

    def corners_at(self, time: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners of the box at times in the window; see `Run.corners_at`."""
        return self.whole.corners_at(np.asarray(time) + self.start)

    def open_at(self, time: float | np.ndarray) -> np.ndarray:
        """Return which sides are open at times in the window; see `Run.open_at`."""
        return self.whole.open_at(np.asarray(time) + self.start)

    def accessible_area(self, time: float | np.ndarray) -> np.ndarray:
        """Return the accessible area at times in the window; see `Run.accessible_area`."""
        return self.whole.accessible_area(np.asarray(time) + self.start)

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower left and upper right corner of the region that the box covers in the whole run."""
        return self.whole.bounds

    @cached_property
    def piston_positions(self) -> dict[int, Series]:
        """Position of each piston and each changed side over time, by its index in `sides`."""
        names = {k: f"sides/{SIDES[k]}/position" for k in self.whole.piston_positions}
        return {k: self.observable(name) for k, name in names.items()}

    @cached_property
    def nature(self) -> Nature:
        """Traits of the run in the window, which determine the applicable theories."""
        return Nature(super().nature | self.whole.nature & LASTING)

    def _contains(self, time: np.ndarray) -> np.ndarray:
        """Return which times (T,) of the whole run are in the window."""
        return (time >= self.start) & (time < self.end)

    @property
    def _span(self) -> str:
        return f"the window from t = {self.start:g} to {self.end:g}"


def window_of(run: Run, start: float, end: float) -> Window:
    """Return a window of a run, from the time `start` up to, but not including, `end`."""
    if not 0 <= start < end:
        raise RunError(f"{run.path}: no window begins at {start:g} and ends at {end:g}")
    first, last = (int(k) for k in np.searchsorted(run.time, [start, end]))
    if first == last:
        some = f"has no frame from t = {start:g} to {end:g}, only from {run.time[0]:g} to"
        raise RunError(f"{run.path}: {some} {run.time[-1]:g}; see output.frames_every_time")

    def part(values: Any) -> Any:
        return values.part(first, last) if isinstance(values, Frames) else values

    kept = {entry.name: part(getattr(run, entry.name)) for entry in fields(Run)}
    kept["disk_data"] = {name: part(values) for name, values in run.disk_data.items()}
    kept["time"] = run.time[first:last] - start
    kept["parameters"] = laws_in(run, start, end)
    kept["provenance"] = {name: run.provenance.get(name, "") for name in ("note", "host")}
    lower, upper = run.corners_at(start)
    still = np.array([side.get("motion") not in ("sine", "parabolic") for side in run.sides])
    kept["lower"] = np.where(still[::2], lower, run.lower)
    kept["edges"] = np.where(still[1::2], upper, run.upper) - kept["lower"]
    return Window(**kept, whole=run, start=start, end=end)


def laws_in(run: Run, start: float, end: float) -> dict[str, Any]:
    """Return the values of the input variables at `start`, with the changes up to `end` listed."""
    parameters = changed(run.parameters, [one for one in run.changes if one.time <= start])
    for side in parameters.get("side", {}).values():
        if side.get("motion") == "constant_velocity" and side.get("end_time", np.inf) <= start:
            side["motion"] = "still"
    later = [one for one in run.changes if start < one.time < end]
    if later:
        lines = [f"{one.time - start:.17g} {one.name}={one.value}\n" for one in later]
        parameters["changes"] = "".join(lines)
    return parameters


def accumulates(name: str, value: np.ndarray) -> bool:
    """Return whether an observable accumulates from the start of a run."""
    if value.dtype.kind in "iu":
        return not name.endswith(PRESENT_COUNTS)
    return name in SUMS or name.endswith(SUMS_OF_BOUNDARIES)
