"""Write docs/input.md from what the program says of its variables.

python docs/input_page.py build/ricochet > docs/input.md
"""

import json
import subprocess
import sys
from pathlib import Path

LAW = "the law of a wall"
GROUPS = {
    "run": "What is run, and by which method.",
    "box": "The box and the gravity in it.",
    "side": "A side of the box that is a wall, with its motion; repeated for each.",
    "obstacle": "A circular wall; repeated for each.",
    "wall": "A straight wall, solid on both sides; disks bounce off its ends as off points. "
    "Repeated for each.",
    LAW: "What each `&side`, `&obstacle` and `&wall` may have of its own.",
    "species": "Disks of one kind; repeated for each.",
    "contact": "What happens at a contact.",
    "drive": "Kicks: random changes of velocity at fixed intervals.",
    "stop": "When the run ends: at the first of these that is met. At least one is needed. Where "
    "nothing can happen any more and no `time` is given, it ends at the last collision, or at the "
    "sample that is due after it.",
    "output": "What is written, and when. The initial and the final state are always written. "
    "Averages over samples by collisions or events differ from those over time by a part of the "
    "order 1/N ([output](output.md#observables)).",
}

HEAD = """\
# Input: every variable

A file consists of groups `&name ... /` with lines `variable = value`; only what differs from the
default is needed. [input/README](../input/README.md) has the rules, and the ways to describe disks;
[input/reference.nml](../input/reference.nml) is a file with all variables. `docs/input_page.py`
writes this page from what the program says of itself.

On the command line: `--set GROUP.VARIABLE=VALUE`; a species, an obstacle or a wall is addressed by
its name, as in `--set species.projectile.mass=50`. The file chooses the units of length, time and
mass. What has no default has an example instead: *e.g.*

The last column says when a variable may have another value than at the start: when a run continues
(`--resume`), because it has no effect on the trajectory; or while a simulation runs, in Python and
on the laboratory page. All other variables make another run.
"""


def said(program: Path, *words: str) -> str:
    """What the program answers to an option."""
    return subprocess.run([program, *words], check=True, capture_output=True, text=True).stdout


def variables(program: Path) -> dict[str, dict[str, dict]]:
    """Group of `GROUPS` -> variable -> all about it, numbers as the program writes them.

    What all kinds of walls share stands there once.
    """
    table = json.loads(said(program, "--print-variables"), parse_float=str, parse_int=str)
    walls = [table[group] for group in ("side", "obstacle", "wall")]
    law = {
        name: entry
        for name, entry in walls[0].items()
        if all(wall.get(name) == entry for wall in walls)
    }
    for wall in walls:
        for name in law:
            del wall[name]
    return {group: law if group == LAW else table[group] for group in GROUPS}


def written(entry: dict) -> str:
    """The default of a variable, or its example, as an input file has it."""
    value = entry["example"] if entry["default"] is None else entry["default"]
    words = value if isinstance(value, list) else [value]
    words = [str(word).lower() if isinstance(word, bool) else word for word in words]
    how = {"text": "'{}'", "logical": ".{}."}.get(entry["type"], "{}")
    return ", ".join(how.format(word.replace("'", "''")) for word in words)


def row(name: str, entry: dict) -> str:
    """A line of the table."""
    value = "e.g. " * (entry["default"] is None) + f"`{written(entry)}`"
    meaning = entry["help"] + (f" [{entry['unit']}]" if entry["unit"] else "")
    change = "`--resume`" * entry["resumable"] + "while it runs" * entry["changeable"]
    cells = (f"`{name}`", meaning, entry["allowed"], value, change)
    return "| " + " | ".join(cell.replace("|", "\\|").replace("**", "^") for cell in cells) + " |"


def page(program: Path) -> str:
    """The whole page."""
    lines = [HEAD]
    for group, entries in variables(program).items():
        title = group.capitalize() if group == LAW else f"&{group}"
        lines += [f"## {title}", "", GROUPS[group], ""]
        lines += [
            "| variable | meaning [unit] | allowed | default | may change |",
            "|---|---|---|---|---|",
        ]
        lines += [*(row(*one) for one in entries.items()), ""]
    return "\n".join(lines)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    sys.stdout.write(page(Path(sys.argv[1]).resolve()))
