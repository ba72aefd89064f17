"""Analyses with their options, and the runs that they accept and combine."""

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from ..figures.drawing import colours
from ..figures.sheet import Sheet
from ..reading.files import RunError, did_you_mean
from ..reading.nature import stays_in_box
from ..reading.reader import Run, read_run
from ..reading.units import units_of
from . import analyses
from .groups import Group, Grouping, differences, together
from .options import TIMES, Option
from .result import Result
from .tables import once


def accept(run: Run) -> None:
    """Accept any run."""


@dataclass(frozen=True)
class Analysis:
    """Analysis of runs, defined as `ANALYSIS` in a module of this package."""

    # Returns the result for groups of runs, given the values of all options.
    compute: Callable[[list[Group], SimpleNamespace], Result]
    draw: Callable[[Result], Sheet | None]  # draws the figure of a result
    options: Sequence[Option] = ()
    # Raises an error for a run to which the analysis does not apply.
    accepts: Callable[[Run], None] = accept
    group_by: Grouping = together  # determines which runs are combined
    averages: Grouping | None = None  # determines which runs are averaged [group_by]
    may_differ: Sequence[str] = ()  # groups and variables in which averaged runs may differ
    single: bool = False  # only one run is analysed
    repeated: bool = False  # runs with the same final state are analysed separately
    unfinished: bool = False  # unfinished runs are analysed, too

    @property
    def name(self) -> str:
        """Name of the analysis."""
        return self.compute.__module__.rpartition(".")[2]

    @property
    def about(self) -> str:
        """One-line description of the analysis."""
        return analyses[self.name]

    def __call__(
        self, runs: Run | str | Path | Sequence[Run | str | Path], given: Mapping[str, Any]
    ) -> Result:
        """Analyse runs or output files with some of the options."""
        files = [runs] if isinstance(runs, Run | str | Path) else [*runs]
        found = [one if isinstance(one, Run) else read_run(one) for one in files]
        if not found or (self.single and len(found) > 1):
            raise RunError(f"{self.name}: {'one run is' if self.single else 'runs are'} required")
        values = {option.name: option.default for option in self.options}
        for name, value in given.items():
            if name == "units":
                units = units_of(value) if isinstance(value, str) else value
                found = [replace(run, units=units) for run in found]
            elif name == "times":
                span = TIMES.value(value)
                found = [run.window(*span) if span else run for run in found]
            elif name not in values:
                known = [*values, "units", "times"]
                hint = did_you_mean(name, known) or f"; there are {', '.join(known)}"
                raise ValueError(f"{self.name} has no option {name}{hint}")
        values |= {
            one.name: one.value(given[one.name]) for one in self.options if one.name in given
        }
        kept, left_out = (found, []) if self.repeated else distinct(found)
        return self.result(kept, SimpleNamespace(**values), left_out)

    def result(
        self, runs: list[Run], options: SimpleNamespace, warnings: Iterable[str] = ()
    ) -> Result:
        """Return the result for distinct runs and the values of all options."""
        for run in runs:
            stays_in_box(run)
            self.accepts(run)
        groups = [Group(key, members) for key, members in self.group_by(runs)]
        for group, colour in zip(groups, colours(len(groups)), strict=True):
            group.colour = colour
        result = self.compute(groups, options)
        early = [run.termination_note for run in runs if run.termination_note]
        averaged = self.averages(runs) if self.averages else [(one.key, one.runs) for one in groups]
        mixed = differences([members for _, members in averaged], self.may_differ)
        told = [*warnings, *mixed, *early, *result.warnings]
        result.warnings = once(told, {run.path.name for run in runs})
        result.groups, result.options = groups, options
        result.name, result.draw = self.name, self.draw
        return result


def distinct(runs: list[Run]) -> tuple[list[Run], list[str]]:
    """Return the runs with distinct final states, and a warning if identical runs are left out."""
    if len(runs) < 2:
        return runs, []
    found: dict[bytes, list[Run]] = {}
    for run in runs:
        parts = run.time[-1:], run.position[-1], run.velocity[-1], run.mass, run.radius
        ending = hashlib.blake2b(b"".join(part.tobytes() for part in parts))
        found.setdefault(ending.digest(), []).append(run)
    twins = [str(run.path) for _, *others in found.values() for run in others]
    warnings = [f"left out, the same as another run: {', '.join(twins)}"] if twins else []
    return [same for same, *_ in found.values()], warnings
