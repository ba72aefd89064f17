"""Values of input variables after changes during a run (`&change`, `Simulation.change`)."""

import copy
import re
from collections.abc import Iterable, Mapping
from itertools import groupby
from typing import Any

import numpy as np

from .records import Change

#: Variables of the motion of a side. A new motion drops those of the former one.
OF_MOTION = {
    "position",
    "velocity",
    "start_time",
    "end_time",
    "amplitude",
    "period",
    "phase",
    "mass",
    "force",
}
#: Variables of contacts whose default is the value of another one.
SOURCES = {
    "wall_restitution": "restitution",
    "wall_tangential_restitution": "tangential_restitution",
    "wall_friction": "friction",
}
#: Variables of boundaries whose default is the value of a variable of contacts.
OF_WALLS = {
    "restitution": "wall_restitution",
    "tangential_restitution": "wall_tangential_restitution",
    "friction": "wall_friction",
    "rule": "wall_rule",
}


def changed(parameters: Mapping[str, Any], changes: Iterable[Change]) -> dict[str, Any]:
    """Return the parameters of a run after changes; its lists of changes are left out."""
    lists = ("change", "changes")
    found = {name: copy.deepcopy(own) for name, own in parameters.items() if name not in lists}
    # Variables named by the input itself; its changes name others as GROUP.VARIABLE.
    given = set(re.findall(r"(?<![\w.])\w+", str(found.get("input", "")).lower()))
    given |= set(re.findall(r"\w+", str(found.get("overrides", "")).lower()))
    for _, together in groupby(changes, key=lambda change: change.time):
        before = dict(found.get("contact", {}))
        # A new motion comes first, because it drops variables that the same change may set.
        for change in sorted(together, key=lambda change: not change.name.endswith(".motion")):
            assign(found, change)
            name = change.name.rpartition(".")[2]
            given = given | {name} if change.value else given - {name}
        derive(found, before, given)
    return found


def assign(parameters: dict[str, Any], change: Change) -> None:
    """Assign the new value of a variable, or remove the variable if its default is restored."""
    group, *member, last = change.name.split(".")
    name, _, element = last.partition("(")
    own = parameters.setdefault(group, {})
    value = value_of(change.value)
    if group in ("obstacle", "wall"):  # stored as columns
        row = list(own["name"]).index(member[0])
        empty: Any = "" if isinstance(value, str) else np.nan
        column = list(own.get(name, [empty] * len(own["name"])))
        column[row] = empty if value is None else value
        own[name] = np.array(column) if empty != "" else column
        return
    if member:
        own = own.setdefault(member[0], {"name": member[0]})
    if name == "motion":
        for former in OF_MOTION:
            own.pop(former, None)
    if value is None:
        own.pop(name, None)
    elif element:
        own[name] = np.array(own[name], dtype=float)
        own[name][int(element.rstrip(") ")) - 1] = value
    else:
        own[name] = value


def derive(parameters: dict[str, Any], before: Mapping[str, Any], given: set[str]) -> None:
    """Let variables that the input does not give follow those from which they take their values.

    `before` contains the variables of contacts before the change, and `given` all words of the
    input. A boundary whose value equals the former default is taken to have this default.
    """
    contact = parameters.get("contact", {})
    for name, source in SOURCES.items():
        if name not in given and name in before and source in contact:
            contact[name] = contact[source]
    for name, source in OF_WALLS.items():
        old, new = before.get(source), contact.get(source)
        if old is None or new is None or old == new:
            continue
        for side in parameters.get("side", {}).values():
            if side.get(name) == old:
                side[name] = new
        for group in ("obstacle", "wall"):
            columns = parameters.get(group, {})
            if name in columns:
                values = [new if one == old else one for one in columns[name]]
                columns[name] = values if isinstance(new, str) else np.array(values)


def value_of(text: str) -> Any:
    """Convert a value written as in an input; None for an empty text, which restores the default.

    Several numbers become an array. A factor such as in 3*0.5 repeats a number.
    """
    text = text.strip()
    if text.startswith(("'", '"')):
        return text[1:-1]
    words = [word.strip() for word in text.split(",")]
    if words == [""]:
        return None
    if re.fullmatch(r"\.?(true|false|t|f)\.?", text.lower()):
        return text.lower().lstrip(".").startswith("t")
    try:
        numbers = [number for word in words for number in repeated(word)]
    except ValueError:
        return text
    return numbers[0] if len(numbers) == 1 else np.array(numbers)


def repeated(word: str) -> list[float]:
    """Return a number, written as in Fortran, as often as its factor says."""
    factor, _, number = word.lower().rpartition("*")
    return [float(number.replace("d", "e"))] * int(factor or 1)
