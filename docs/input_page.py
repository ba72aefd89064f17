"""Write docs/input.md from what the program says of its variables.

python docs/input_page.py build/ricochet > docs/input.md
"""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "post" / "ricochet"))
from variables import explained

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
    "stop": "When the run ends: at the first of these that is met. At least one is needed.",
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
"""


def row(entry: dict) -> str:
    """A line of the table."""
    value = f"`{entry['value']}`" if entry["kind"] == "default" else f"e.g. `{entry['value']}`"
    name = entry["name"].split(".")[-1]
    meaning = entry["help"] + (f" [{entry['unit']}]" if entry["unit"] else "")
    cells = (f"`{name}`", meaning, entry["allowed"], value)
    return "| " + " | ".join(cell.replace("|", "\\|").replace("**", "^") for cell in cells) + " |"


def page(program: Path) -> str:
    """The whole page. What all kinds of walls share stands there once."""
    rows = {group: list(map(row, explained(program, group))) for group in GROUPS if group != LAW}
    walls = "side", "obstacle", "wall"
    rows[LAW] = [entry for entry in rows["side"] if all(entry in rows[group] for group in walls)]
    for group in walls:
        rows[group] = [entry for entry in rows[group] if entry not in rows[LAW]]
    lines = [HEAD]
    for group, words in GROUPS.items():
        lines += [f"## {group.capitalize() if group == LAW else '&' + group}", "", words, ""]
        lines += ["| variable | meaning [unit] | allowed | default |", "|---|---|---|---|"]
        lines += [*rows[group], ""]
    return "\n".join(lines)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    sys.stdout.write(page(Path(sys.argv[1]).resolve()))
