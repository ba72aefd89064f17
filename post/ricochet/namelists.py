"""Input files as text: what they give, and the same file with other values.

The program alone decides what a file means; this finds the places in it.
"""

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from .program import value_text

TOKEN = re.compile(
    r"""!.* | (?P<text>'(?:[^'\n]|'')*' | "(?:[^"\n]|"")*") | &(?P<group>\w+) | (?P<end>/)
    | (?P<name>\w+) (?:\((?P<element>\d+)\))? \s*= | (?P<word>[^\s'"!/&=,]+)""",
    re.VERBOSE,
)


@dataclass
class Assignment:
    """`name = values` from `start` to `end`; `element` of a vector counts from 1, 0 is all."""

    name: str
    element: int
    start: int
    end: int
    values: list[str]


@dataclass
class Group:
    """`&kind ... /` from `start` to `end`, where its `/` is; `label` is its name or its number."""

    kind: str
    start: int
    end: int = -1
    label: str = ""
    assignments: list[Assignment] = field(default_factory=list)

    def given(self, variables: Mapping[str, dict]) -> dict[str, str]:
        """The values of the file, written as --set has them."""
        values: dict[str, list[str]] = {}
        for own in self.assignments:
            if own.element:
                default = variables.get(own.name, {}).get("value", "")
                some = values.setdefault(own.name, [part.strip() for part in default.split(",")])
                some[own.element - 1 : own.element] = own.values
            else:
                values[own.name] = own.values
        return {name: ",".join(some) for name, some in values.items()}


def scan(text: str) -> list[Group]:
    """The groups of an input file."""
    groups: list[Group] = []
    inside, count = False, Counter()
    for token in TOKEN.finditer(text):
        match token.lastgroup:
            case "group":
                kind = token["group"].lower()
                count[kind] += 1
                groups.append(Group(kind, token.start(), label=f"{kind}{count[kind]}"))
                inside = True
            case "end" if inside:
                groups[-1].end, inside = token.start(), False
            case "name" | "element" if inside:
                name, element = token["name"].lower(), int(token["element"] or 0)
                own = Assignment(name, element, token.start(), token.end(), [])
                groups[-1].assignments.append(own)
            case "text" | "word" if inside and groups[-1].assignments:
                own = groups[-1].assignments[-1]
                own.end = token.end()
                own.values += values_of(token[0])
                if own.name == "name":
                    groups[-1].label = own.values[0]
    return [group for group in groups if group.end >= 0]


def values_of(word: str) -> list[str]:
    """`'it''s'` is a text, `3*0.5` three numbers."""
    if word[0] in "'\"":
        return [word[1:-1].replace(2 * word[0], word[0])]
    repeated = re.fullmatch(r"(\d{1,4})\*(.+)", word)
    return int(repeated[1]) * [repeated[2]] if repeated else [word]


def place_of(group: Group, table: Mapping[str, Mapping]) -> str:
    """How --set addresses the variables of a group: `box`, or `species.gas`."""
    return f"{group.kind}.{group.label}" if "name" in table.get(group.kind, ()) else group.kind


def with_groups(text: str, added: Iterable[tuple[str, str]]) -> str:
    """The file with more groups at its end, each with its name, if it has one."""
    for kind, label in added:
        name = f"  name = {value_text('name', label)}\n" if label else ""
        text = f"{text.rstrip()}\n\n&{kind}\n{name}/\n"
    return text


def edited(text: str, settings: Mapping[str, str], table: Mapping[str, Mapping]) -> str:
    """The file with what --set would set; comments stay; an empty value removes a variable."""
    places = {place_of(group, table) for group in scan(text)}
    wanted = {setting.rpartition(".")[0] for setting, value in settings.items() if value}
    text = with_groups(text, ((place, "") for place in sorted(wanted - places)))
    changes = []
    for group in scan(text):
        prefix = place_of(group, table) + "."
        for setting, value in settings.items():
            name = setting.removeprefix(prefix)
            if setting.startswith(prefix) and name in table[group.kind]:
                changes += changes_of(text, group, name, quoted(value, table[group.kind][name]))
    for start, end, new in sorted(changes, reverse=True):
        text = text[:start] + new + text[end:]
    return text


def changes_of(text: str, group: Group, name: str, value: str) -> list[tuple[int, int, str]]:
    """What to replace in the text, from where to where, that a variable gets this value."""
    before = [own for own in group.assignments if own.name == name]
    new = f"{name} = {value}" if value else ""
    changes = [(own.start, own.end, "") for own in before]
    if before:
        changes[0] = (before[0].start, before[0].end, new)
    elif value:
        line = text.rfind("\n", 0, group.end) + 1
        alone = line > group.start and not text[line : group.end].strip()
        changes = [(line, line, f"  {new}\n")] if alone else [(group.end, group.end, f" {new} ")]
    return changes


def quoted(value: str, variable: Mapping) -> str:
    """A value of --set as a file has it: texts, but not logicals, in quotes."""
    if not value or variable["type"] in ("integer", "number") or value[0] == ".":
        return value
    parts = [value] if variable["size"] == 1 else re.split(r"\s*,\s*", value)
    return value_text(variable["name"], parts)
