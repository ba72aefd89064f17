"""Write docs/input.md from what the program says of its variables.

python docs/input_page.py build/ricochet > docs/input.md
"""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "post" / "ricochet"))
from variables import explained

GROUPS = {
    "run": "What is run, and by which method.",
    "box": "The box and the gravity in it.",
    "side": "The law of a side of the box that is a wall; the group is repeated for each.",
    "obstacle": "A circular wall; the group is repeated for each.",
    "wall": "A straight wall, solid on both sides; disks bounce off its ends as off points. The "
    "group is repeated for each.",
    "species": "Disks of one kind; the group is repeated for each.",
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
default is needed. The rules, and the ways to describe disks, are in
[input/README](../input/README.md); [input/reference.nml](../input/reference.nml) is a file with
all variables. `docs/input_page.py` generates this page from `ricochet --explain`.

On the command line a variable is set with `--set GROUP.VARIABLE=VALUE`; a species, an obstacle or a
wall is addressed by its name: `--set species.projectile.mass=50`. The file chooses the
units of length, time and mass.
"""


def row(entry: dict) -> str:
    """A line of the table."""
    value = (
        f"`{entry['value']}`" if entry["kind"] == "default" else f"none; e.g. `{entry['value']}`"
    )
    unit = entry["unit"] or ""
    name = entry["name"].split(".")[-1]
    cells = (f"`{name}`", entry["help"], entry["allowed"], value, unit)
    return "| " + " | ".join(cell.replace("|", "\\|").replace("**", "^") for cell in cells) + " |"


def page(program: Path) -> str:
    """The whole page."""
    lines = [HEAD]
    for group, words in GROUPS.items():
        lines += [f"## &{group}", "", words, ""]
        lines += ["| variable | meaning | allowed | default | unit |", "|---|---|---|---|---|"]
        lines += [row(entry) for entry in explained(program, group)] + [""]
    return "\n".join(lines)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    sys.stdout.write(page(Path(sys.argv[1]).resolve()))
