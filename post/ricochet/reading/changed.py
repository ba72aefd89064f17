"""Values of input variables after changes during a run (`&change`, `Simulation.change`)."""

import copy
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import groupby, product
from typing import Any

import numpy as np

from .nature import known, rows_of
from .records import Change

#: Motions of a side with their variables. A new motion drops those that it does not have.
OF_MOTIONS = {
    "still": set[str](),
    "constant_velocity": {"velocity", "start_time", "end_time"},
    "sawtooth": {"velocity"},
    "sine": {"amplitude", "period", "phase"},
    "parabolic": {"amplitude", "period", "phase"},
    "piston": {"mass", "force"},
}
OF_MOTION = {"position"}.union(*OF_MOTIONS.values())
#: Defaults of the variables that may change, except those that follow other variables or are none.
DEFAULTS: dict[str, dict[str, Any]] = {
    "box": {"gravity": np.zeros(2)},
    "contact": {
        "restitution": 1.0,
        "restitution_law": "constant",
        "wall_rule": "velocity",
        "contact_time": 0.0,
        "tangential_restitution": -1.0,
        "inertia": 0.5,
    },
    "drive": {"kind": "none", "species": ""},
    "side": {"open": False, "motion": "still", "surface_velocity": 0.0},
    "obstacle": {"surface_velocity": 0.0},
    "wall": {"surface_velocity": 0.0},
    "source": {"count": 1, "start_time": 0.0},
}
#: Defaults of variables that apply only to some motions of a side or kinds of driving.
DEFAULTS_OF: dict[str, dict[str, Any]] = {
    "sine": {"phase": 0.0},
    "parabolic": {"phase": 0.0},
    "constant_velocity": {"start_time": 0.0},
    "noise": {"keep_momentum": True},
    "active": {"rotational_diffusion": 0.0, "turning_rate": 0.0},
}
#: Variables of contacts whose default is the value of another one.
SOURCES = {
    "wall_restitution": "restitution",
    "wall_tangential_restitution": "tangential_restitution",
    "wall_friction": "friction",
}
#: Variables of boundaries whose default is the value of a variable of contacts.
OF_WALLS = {  # the rule determines whether the last two apply
    "rule": "wall_rule",
    "restitution": "wall_restitution",
    "tangential_restitution": "wall_tangential_restitution",
    "friction": "wall_friction",
}
#: Variables among them that apply only to boundaries with the rule 'normal'.
OF_NORMAL_RULE = {"tangential_restitution", "friction"}
#: Variables that select a law, and thus drop the variables of the former law.
LAWS = ("motion", "kind")
#: Groups that are stored as columns.
COLUMNS = ("obstacle", "wall")


def changed(parameters: Mapping[str, Any], changes: Iterable[Change]) -> dict[str, Any]:
    """Return the parameters of a run after changes; its lists of changes are left out."""
    lists = ("change", "changes")
    found = {name: copy.deepcopy(own) for name, own in parameters.items() if name not in lists}
    given = set(given_in(str(found.get("input", "")), str(found.get("overrides", ""))))
    for _, together in groupby(changes, key=lambda change: change.time):
        # A new law comes first, because it drops variables that the same change may set.
        for change in sorted(together, key=lambda one: one.parts[-1] not in LAWS):
            name = assign(found, change.parts, value_of(change.value))
            given = given | {name} if change.value.strip() else given - {name}
        derive(found, given)
    return found


def given_in(text: str, overrides: str) -> Iterator[str]:
    """Yield the full names, such as side.left.restitution, of the variables that an input gives."""
    group, name, own, counts = "", "", list[str](), dict[str, int]()
    token = r"'[^']*'|\"[^\"]*\"|!.*|&\s*\w+|/|\w+\s*(?=(?:\([^)]*\)\s*)?=)"
    for match in re.finditer(token, text):
        word = match[0].strip().lower()
        if word.startswith("&"):
            group = word[1:].strip()
            counts[group] = counts.get(group, 0) + 1
            name, own = f"{group}{counts[group]}" if group in COLUMNS else "", []
        elif word == "/":
            yield from (".".join(filter(None, (group, name, one))) for one in own)
        elif word[0] in "'\"" and own and own[-1] == "name":
            name = word[1:-1].strip()
        elif word[0] not in "'\"!":
            own.append(word)
    for line in overrides.lower().splitlines():
        where, _, value = line.partition("=")
        if value.strip():
            yield re.sub(r"\(.*", "", where).strip()


def assign(parameters: dict[str, Any], parts: list[str], value: Any) -> str:
    """Assign the new value of a variable or, for None, its default; return its name."""
    group, *member, last = parts
    name, _, element = last.partition("(")
    name = name.strip()
    if value is None:
        value = copy.copy(DEFAULTS.get(group, {}).get(name))
    full = ".".join([group, *member, name])
    own = parameters.setdefault(group, {})
    if group in COLUMNS:
        assign_in_column(own, member, name, value)
        return full
    if member:
        names = {one.lower(): one for one in own}
        of_name = {"name": member[0], **DEFAULTS.get(group, {})}
        own = own.setdefault(names.get(member[0], member[0]), of_name)
    if name in LAWS:
        kinds = {**DEFAULTS_OF["noise"], **DEFAULTS_OF["active"]}
        for former in OF_MOTION - OF_MOTIONS[value] if name == "motion" else kinds:
            own.pop(former, None)
        for kept, default in DEFAULTS_OF.get(value, {}).items():
            own.setdefault(kept, default)
    if value is None:
        value = DEFAULTS_OF.get(own.get("motion", own.get("kind", "")), {}).get(name)
    if value is None:
        own.pop(name, None)
    elif element:
        own[name] = np.array(own[name], dtype=float)
        own[name][int(element.rstrip(") ")) - 1] = value
    else:
        own[name] = value
    return full


def assign_in_column(columns: dict[str, Any], member: list[str], name: str, value: Any) -> None:
    """Assign the value of a variable of a boundary in the box; None if it has no value."""
    names = [str(one).lower() for one in columns["name"]]
    row = names.index(member[0]) if member else 0
    if name == "rule":  # stored as 1 for the rule 'normal'
        name, value = "normal", int(value == "normal")
    column = np.array(columns.get(name, np.full(len(names), np.nan)), dtype=float)
    column[row] = np.nan if value is None else value
    columns[name] = column


def derive(parameters: dict[str, Any], given: set[str]) -> None:
    """Let variables that are not `given` follow those from which they take their values."""
    contact = parameters.setdefault("contact", {})
    if "contact.wall_restitution" not in given:
        contact["wall_restitution"] = contact.get("restitution", 1.0)
    for group, (name, source) in product(("side", *COLUMNS), OF_WALLS.items()):
        own = parameters.get(group, {})
        each = rows_of(own) if group in COLUMNS else [*own.values()]
        for boundary in each:
            parts = [group, boundary["name"].lower(), name]
            full = ".".join(parts)
            short = f"{group}.{name}" if len(each) == 1 else full
            if not {full, short} & given:
                value = of_walls(contact, source, given) if applies(name, boundary) else None
                assign(parameters, parts, value)


def applies(name: str, boundary: Mapping[str, Any]) -> bool:
    """Return whether one of the variables `OF_WALLS` applies to a boundary."""
    if known(boundary.get("temperature")):
        return False
    normal = boundary.get("rule") == "normal" or boundary.get("normal") == 1
    return normal or name not in OF_NORMAL_RULE


def of_walls(contact: Mapping[str, Any], name: str, given: set[str]) -> Any:
    """Return the value of a variable of contacts for walls; None if it has none."""
    source = SOURCES.get(name, name)
    value = contact.get(name if f"contact.{name}" in given else source)
    smooth = DEFAULTS["contact"].get(source) if source == "tangential_restitution" else None
    return value if value != smooth else None


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
