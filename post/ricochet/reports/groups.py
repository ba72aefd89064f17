"""Groups of runs combined by an analysis."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, groupby
from typing import Any

import numpy as np

from ..analysis.thermodynamics import packing
from ..reading.reader import Restitution, Run


@dataclass
class Group:
    """Runs combined by an analysis."""

    key: Any  # value that the runs have in common, such as a number of disks
    runs: list[Run]
    values: Any = None  # results of the analysis
    colour: str = ""  # colour of the group in figures


Grouping = Callable[[list[Run]], Iterable[tuple[Any, list[Run]]]]


def grouped(runs: Iterable[Run], key: Callable[[Run], Any]) -> list[tuple[Any, list[Run]]]:
    """Group the runs by the value of `key`, and sort the groups by this value."""
    ordered = sorted(runs, key=key)
    return [(value, list(group)) for value, group in groupby(ordered, key=key)]


def together(runs: list[Run]) -> list[tuple[None, list[Run]]]:
    """Put all runs into one group."""
    return [(None, runs)]


def each_run(runs: list[Run]) -> list[tuple[str, list[Run]]]:
    """Put each run into a group of its own."""
    return [(run.label, [run]) for run in runs]


def by_number(runs: Iterable[Run]) -> list[tuple[int, list[Run]]]:
    """Group runs with the same number of disks."""
    return grouped(runs, lambda run: run.n_disks)


def by_restitution(runs: Iterable[Run]) -> list[tuple[Restitution, list[Run]]]:
    """Group runs with the same law and coefficient of restitution."""
    return grouped(runs, lambda run: run.contact_law)


def by_packing(runs: Iterable[Run]) -> list[tuple[float, list[Run]]]:
    """Group runs with the same packing fraction."""
    return grouped(runs, lambda run: round(packing(run), 6))


#: Parts of the parameters that do not affect the physics of a run, apart from its random numbers.
NO_PHYSICS = {"input", "overrides", "seed", "output", "stop"}
LONGEST = 40  # longest value in a warning [letters]


def differences(groups: Iterable[Sequence[Run]], expected: Collection[str] = ()) -> list[str]:
    """Return a warning if runs within a group differ in physics other than `expected` variables."""
    found: dict[str, dict[str, None]] = {}
    for runs in groups:
        each = [physics(run, expected) for run in runs] if len(runs) > 1 else []
        for name in dict.fromkeys(chain.from_iterable(each)):
            values = dict.fromkeys(own.get(name, "none") for own in each)
            if len(values) > 1:
                found.setdefault(name, {}).update(values)
    parts = [f"{name} differs{listed_values([*values])}" for name, values in found.items()]
    return [f"combined although {'; '.join(parts)}"] if parts else []


def listed_values(values: list[str]) -> str:
    """Return a list of different values, or only their number if there are more than four."""
    if any(len(value) > LONGEST for value in values):
        return ""
    return f": {', '.join(values)}" if len(values) < 5 else f": {len(values)} values"


def physics(run: Run, expected: Collection[str] = ()) -> dict[str, str]:
    """Return the physical parameters of a run as texts, by names such as contact.restitution."""
    kept = {
        name: value
        for name, value in run.parameters.items()
        if name not in NO_PHYSICS and name not in expected
    }
    own = kept.get("run", {})
    kept["run"] = {name: own[name] for name in ("dynamics", "dt") if name in own}
    kinds = kept.get("species", {})
    kept["species"] = {kind: of_species(kinds[kind]) for kind in run.names if kind in kinds}
    return {
        name: value
        for name, value in leaves(kept)
        if not {"file", *expected} & {name.rpartition(".")[2]}
    }


def of_species(own: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of a species without its radius or without its packing fraction.

    One of the two determines the other one, unless the radii are random. Their packing fraction is
    then random, too.
    """
    if "packing_fraction" not in own:
        return dict(own)
    derived = "packing_fraction" if own.get("polydispersity", 0) > 0 else "radius"
    return {name: value for name, value in own.items() if name != derived}


def leaves(parameters: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield the full name of each variable in nested groups, and its value as text."""
    for name, value in parameters.items():
        if isinstance(value, Mapping):
            yield from leaves(value, f"{prefix}{name}.")
        else:
            numbers = isinstance(value, float | int | np.number)
            text = f"{value:g}" if numbers else str(np.asarray(value).tolist())
            yield prefix + name, text
