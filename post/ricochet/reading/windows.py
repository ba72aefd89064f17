"""Part of a run between two times, as a run under the laws in force during this time.

    for window in run.windows():                     # between successive changes (`&change`)
        print(window.restitution, window.observable("all/temperature").mean())

In a window all times are measured from its start. Counts and sums that the program accumulates
from the start of the run, such as collisions and dissipated energy, begin at zero with the first
sample of the window, and those of single disks with its first frame.
"""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from .box import OSCILLATING, displaced
from .changed import changed
from .files import RunError
from .frames import Frames, Series
from .nature import Nature
from .reader import Run
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
#: Counts of single disks that accumulate from frame to frame.
COUNTS_OF_DISKS = ("event_count", "recycled")
#: Traits that a run does not lose by a change of its laws. An open system remains open as long as
#: some of its disks are outside.
LASTING = {"open", "collapsed"}
#: Provenance that describes the whole run.
OF_WHOLE = {"wall_time", "collisions_per_second", "events_on_one_core"}
ROUNDING = 1e-12  # relative rounding error of times


@dataclass(frozen=True, eq=False, repr=False)
class Window(Run):
    """Part of a run, from the time `start` up to, but not including, the time `end`."""

    whole: Run
    start: float
    end: float

    @property
    def _place(self) -> str:
        return f"{self.path}, {self._span}"

    @property
    def label(self) -> str:
        """Name of the file with the times of the window, for tables and warnings."""
        return f"{self.path.name} ({self._times})"

    def observable(self, name: str) -> Series:
        """Return the samples of an observable in the window; see `Run.observable`."""
        time, value = self.whole.observable(name)
        inside = within(time, self.start, self.end)
        if not len(time[inside]):
            some = "set output.observables_every_time"
            raise RunError(f"{self.path}: has no observables in {self._span}; {some}")
        own, found = since(self.start, time[inside]), value[inside]
        if name == "virial_pressure":
            found = self._virial_pressure(own)
        elif accumulates(name, value):
            found = found - found[0]
        return Series(own, found)

    def _virial_pressure(self, time: np.ndarray) -> np.ndarray:
        """Return the pressure (T,) with the virial averaged from the first sample."""
        if self.shear_rate:  # relative to the flow
            kinetic = self.observable("kinetic_tensor").value[:, [0, 3]].sum(axis=1) / 2
        else:
            inside = "inside" in self.observables
            number = self.observable("inside").value if inside else self.n_disks
            kinetic = number * self.observable("all/kinetic_energy").value
        virial, passed = self.observable("virial").value, time - time[0]
        mean = np.divide(virial, 2 * passed, out=np.zeros_like(virial), where=passed > 0)
        return (kinetic + mean) / self.accessible_area(time)

    @cached_property
    def _event_log(self) -> EventLog:
        log = self.whole.event_log()
        inside = within(log.time, self.start, self.end)
        parts = {k: part[inside] for k, part in log._asdict().items() if part is not None}
        return EventLog(**parts | {"time": since(self.start, parts["time"])})

    @property
    def _shear_time(self) -> np.ndarray:
        return self.time + self.start

    @cached_property
    def piston_positions(self) -> dict[int, Series]:
        """Position of each piston and each changed side over time, by its index in `sides`.

        The samples before and after the window are included, to interpolate between samples.
        """
        found = {}
        for k in self._free_sides:
            time, value = self.whole.observable(f"sides/{SIDES[k]}/position")
            inside = within(time, self.start, self.end)
            some = slice(max(0, inside.start - 1), inside.stop + 1)
            found[k] = Series(time[some] - self.start, value[some])
        return found

    @cached_property
    def nature(self) -> Nature:
        """Traits of the run in the window, which determine the applicable theories."""
        lasting = self.whole.nature & LASTING
        if self.present is not None and np.all(self.present[0]):
            lasting -= {"open"}  # unless the laws in force open the system
        return Nature(super().nature | lasting)

    @property
    def termination_note(self) -> str:
        """Reason why the run ended early, if the window extends to the end of the run."""
        ended = since(self.start, self.whole.time[-1:]) <= self.time[-1]
        return self.whole.termination_note if ended or "collapsed" in self.nature else ""

    @property
    def _times(self) -> str:
        if np.isinf(self.end):
            return f"from t = {self.start:g}"
        return f"t = {self.start:g} to {self.end:g}"

    @property
    def _span(self) -> str:
        return f"the window {'' if np.isinf(self.end) else 'from '}{self._times}"


def within(time: np.ndarray, start: float, end: float) -> slice:
    """Return which of the increasing times (T,) are in a window; rounding errors do not count."""
    return slice(*map(int, np.searchsorted(time, np.array([start, end]) * (1 - ROUNDING))))


def since(start: float, time: np.ndarray) -> np.ndarray:
    """Return times (T,) measured from the start of a window, without negative rounding errors."""
    return np.maximum(time - start, 0.0)


def window_of(run: Run, start: float, end: float) -> Window:
    """Return a window of a run, from the time `start` up to, but not including, `end`."""
    if not 0 <= start < end:
        raise RunError(f"{run.path}: no window begins at {start:g} and ends at {end:g}")
    if isinstance(run, Window):
        inner = window_of(run.whole, run.start + start, min(run.end, run.start + end))
        return replace(inner, units=run.units)
    inside = within(run.time, start, end)
    first, last = inside.start, inside.stop
    if first == last:
        some = f"has no frame from t = {start:g} to {end:g}, only from {run.time[0]:g} to"
        raise RunError(f"{run.path}: {some} {run.time[-1]:g}; see output.frames_every_time")

    def part(values: Any) -> Any:
        return values.part(first, last) if isinstance(values, Frames) else values

    kept = {entry.name: part(getattr(run, entry.name)) for entry in fields(Run)}
    kept["disk_data"] = {name: part(values) for name, values in run.disk_data.items()}
    for name in COUNTS_OF_DISKS if run.present else (*COUNTS_OF_DISKS, "image"):
        kept[name] = kept[name] and kept[name].from_zero()
    kept["time"] = since(start, run.time[first:last])
    kept["provenance"] = {k: v for k, v in run.provenance.items() if k not in OF_WHOLE}
    kept["parameters"] = laws_in(run, start, end)
    box = kept["parameters"]["box"]
    kept["lower"], kept["edges"] = np.array(box["lower"]), np.subtract(box["upper"], box["lower"])
    return Window(**kept, whole=run, start=start, end=end)


def laws_in(run: Run, start: float, end: float) -> dict[str, Any]:
    """Return the values of the input variables at `start`, with the changes up to `end` listed."""
    # The output of a saved simulation begins with the laws at the time of saving.
    first = max(start, float(run.provenance.get("saved_at", 0.0)))
    made = [one for one in run.changes if one.time <= first * (1 + ROUNDING)]
    later = [one for one in run.changes[len(made) :] if one.time < end * (1 - ROUNDING)]
    parameters = changed(run.parameters, made)
    set_clocks(parameters, start)
    set_schedule(parameters, start, end)
    set_corners(parameters, run, start)
    if later:
        lines = [f"{one.time - start:.17g} {one.name}={one.value}\n" for one in later]
        parameters["changes"] = "".join(lines)
    return parameters


def set_clocks(parameters: dict[str, Any], start: float) -> None:
    """Measure all times in the laws of sides and sources from `start`."""
    for own in [*parameters.get("side", {}).values(), *parameters.get("source", {}).values()]:
        if own.get("motion") in OSCILLATING:
            own["phase"] = (own.get("phase", 0.0) + start / own["period"]) % 1
        if own.get("motion") == "constant_velocity" and own["end_time"] <= start:
            own["motion"] = "still"
            for name in ("velocity", "start_time", "end_time"):
                own.pop(name, None)
        if "start_time" in own:
            own["start_time"] = max(0.0, own["start_time"] - start)
        if "end_time" in own:
            own["end_time"] = own["end_time"] - start


def set_schedule(parameters: dict[str, Any], start: float, end: float) -> None:
    """Measure the end of the run and the listed times of samples from `start`."""
    stop, output = (parameters.get(name, {}) for name in ("stop", "output"))
    if "time" in stop:
        stop["time"] = min(stop["time"], end) - start
    for name in {"frames_at", "observables_at"} & output.keys():
        times = np.atleast_1d(output.pop(name))
        if len(inside := times[within(times, start, end)]):
            output[name] = since(start, inside)


def set_corners(parameters: dict[str, Any], run: Run, start: float) -> None:
    """Let the box extend to the positions of its sides at `start`; oscillating ones are kept."""
    sides = [parameters.get("side", {}).get(name, {}) for name in SIDES]
    places = np.stack(run.corners_at(start), axis=1).ravel()
    for k, side in enumerate(sides):
        if side.get("motion") in OSCILLATING:
            places[k] = (run.lower, run.upper)[k % 2][k // 2]
        elif k in run.piston_positions and side.get("motion") != "piston":
            places[k] = place_at_start(run, k, side, start, places[k])
        side.pop("position", None)
    parameters["box"]["lower"], parameters["box"]["upper"] = places[::2], places[1::2]


def place_at_start(run: Run, k: int, side: dict[str, Any], start: float, near: float) -> float:
    """Return the position of a side at `start`: exactly, if a sample follows before a change."""
    time, place = run.piston_positions[k]
    later = [one.time for one in run.changes if one.time > start * (1 + ROUNDING)]
    inside = within(time, start, min([*later, np.inf]))
    if inside.start == inside.stop:
        return near
    moved = float(displaced(side, time[inside][0] - start))
    return float(place[inside][0]) - (-1) ** k * moved


def accumulates(name: str, value: np.ndarray) -> bool:
    """Return whether an observable accumulates from the start of a run."""
    if value.dtype.kind in "iu":
        return not name.endswith(PRESENT_COUNTS)
    return name in SUMS or name.endswith(SUMS_OF_BOUNDARIES)
