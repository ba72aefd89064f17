"""The table of variables, as the program itself tells it (`--print-defaults`, `--explain`).

It needs the standard library only: pages of the documentation are made where nothing else is.
"""

import re
import subprocess
from pathlib import Path

ENTRY = re.compile(
    r"^(?P<name>\S+?)(?:  \[(?P<unit>.*)\])?\n"
    r"    (?P<help>.*)\n    allowed: (?P<allowed>.*)\n"
    r"    (?P<kind>default|example): (?P<value>.*)$",
    re.MULTILINE,
)
DEFAULTS = re.compile(r"^(?:! )?(?:&(?P<group>\w+)$|  +(?P<needed>\w+) = .* ! an example: )", re.M)
CHOICE = re.compile(r"'(\w+)'|(\.\w+\.)")
SIZES = {"a": 1, "an": 1, "numbers": 0, "integers": 0, "values,": 0}  # how `allowed` begins


def said(program: str | Path, *words: str) -> str:
    """What the program answers to an option."""
    return subprocess.run([program, *words], check=True, capture_output=True, text=True).stdout


def explained(program: str | Path, group: str) -> list[dict]:
    """The variables of a group: name, unit (or None), help, allowed, kind, value."""
    text = said(program, "--explain", group)
    entries = [found.groupdict() for found in ENTRY.finditer(text)]
    if 4 * len(entries) != len(text.splitlines()):
        raise SystemExit(f"cannot understand {program} --explain {group}")
    return [entry for entry in entries if entry["name"].startswith(f"{group}.")]


def table(program: str | Path) -> dict[str, dict[str, dict]]:
    """Group -> variable -> what `explained` says and `limits_of`; `needed`: has no default."""
    groups: dict[str, dict[str, dict]] = {}
    needed = set()
    for found in DEFAULTS.finditer(said(program, "--print-defaults")):
        if found["group"]:
            group = found["group"]
            groups[group] = {
                entry["name"].removeprefix(f"{group}."): entry | limits_of(entry["allowed"])
                for entry in explained(program, group)
            }
        else:
            needed.add(f"{group}.{found['needed']}")
    for entries in groups.values():
        for entry in entries.values():
            entry["needed"] = entry["name"] in needed
    return groups


def limits_of(allowed: str) -> dict:
    """What `2 numbers > 0` and the like mean.

    type: integer, number, choice, or text; size: how many values, 0 any number; choices; low and
    high: None without a limit; open: low itself is not allowed.
    """
    first = allowed.split()[0]
    choices = [quoted or logical for quoted, logical in CHOICE.findall(allowed)]
    kind = re.search("integer|number", allowed)
    low = re.search(r"(?:\bfrom|>=?) (\S+)", allowed)
    high = re.search(r"(?:\bto|<=?) (\S+)", allowed)
    return {
        "type": "choice" if choices else kind[0] if kind else "text",
        "size": int(first) if first.isdecimal() else SIZES.get(first, 1),
        "choices": choices,
        "low": float(low[1]) if low and kind else None,
        "high": float(high[1]) if high and kind else None,
        "open": bool(re.search("> ", allowed)),
    }
