"""Write the pages on input variables from the table printed by the program.

    python docs/input_page.py build/ricochet

The page docs/reference/input.md lists the groups of input variables. Each group has its own page in
docs/reference/input/, with a description of its variables, an example taken from an input file in
input/, and a picture.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = "docs/reference/input"
LAW = "Collision rules of boundaries"
BOUNDARIES = ("side", "obstacle", "wall")
GROUPS = {
    "run": "The group `&run` sets the seed, the method and the number of threads.",
    "box": "The group `&box` sets the size of the box, its boundaries, gravity and shear "
    "([theory](../../explanation/theory.md#sheared-boxes)).",
    "side": "A group `&side` describes the motion of one side of the box that is a wall "
    "([theory](../../explanation/theory.md#sides-that-move)). The collision rule of a side is set "
    "by the variables of [boundaries](boundaries.md).",
    "obstacle": "A group `&obstacle` describes a circular obstacle or an arc, or many of them from "
    "a file, and may be repeated. The collision rule of an obstacle is set by the variables of "
    "[boundaries](boundaries.md).",
    "wall": "A group `&wall` describes a straight wall, a polyline, or many walls from a file, and "
    "may be repeated. Disks bounce off both faces of a wall and off its end points. The collision "
    "rule of a wall is set by the variables of [boundaries](boundaries.md).",
    LAW: "The groups `&side`, `&obstacle` and `&wall` share the following variables, which "
    "describe the collisions of disks with one boundary. If the group of a boundary does not "
    "contain them, the `wall_...` variables of [`&contact`](contact.md) apply.",
    "species": "A group `&species` describes disks of one kind. The group is repeated for each "
    "species, and an input file needs at least one species "
    "([initial configurations](../../explanation/theory.md#starting-states)).",
    "contact": "The group `&contact` sets the collision rules of disks, and of boundaries without "
    "rules of their own ([theory](../../explanation/theory.md#contact)).",
    "drive": "The group `&drive` describes driving, which changes velocities at fixed intervals "
    "([theory](../../explanation/theory.md#kicks)).",
    "source": "A group `&source` lets waiting disks enter the box at regular times, and may be "
    "repeated. Disks wait from the start (`waiting` of [`&species`](species.md)), or after leaving "
    "the box through an open side (`open` of [`&side`](side.md)).",
    "change": "A group `&change` describes a change of the system at a given time, and may be "
    "repeated ([changes during a run](../../guides/changes.md)).",
    "stop": "The group `&stop` sets the rules that end the run. At least one stop rule is needed, "
    "and the run ends when the first of the given rules is met. If no further event can occur and "
    "no `time` is given, the run ends at the last collision, or at the next sample after this "
    "collision.",
    "output": "The group `&output` determines the contents of the output file and the times of "
    "frames and samples. The initial and the final state are always written. Averages over samples "
    "at intervals of collisions or events differ from time averages by a relative amount of order "
    "1/N ([output](../output.md#observables)).",
}
#: Input file from which the example of each group is taken.
EXAMPLES = {
    "run": "gravity_steps",
    "box": "gravity",
    "side": "couette",
    "obstacle": "sinai",
    "wall": "hopper",
    LAW: "fourier",
    "species": "crater",
    "contact": "rough",
    "drive": "active",
    "source": "pump",
    "change": "quench",
    "stop": "scattering",
    "output": "mixture",
}

HEAD = """\
# Input: every variable

The pages below describe every variable of an input file. [input/README](../../input/README.md)
explains the format of the file and shows how to describe a system. The file
[input/reference.nml](../../input/reference.nml) contains all variables with their defaults. The
command `ricochet --explain VARIABLE` prints the description of one variable. To search names,
choices and descriptions for a word, use `ricochet --explain WORD`.

An input file consists of groups `&name ... /` with lines `variable = value`. It needs to contain
only values that differ from the default. The input file determines the units of length, time and
mass ([units](../explanation/glossary.md#units)). On the command line `--set` replaces a value:

| option | replaces |
|---|---|
| `--set GROUP.VARIABLE=VALUE` | a variable of a group |
| `--set species.projectile.mass=50` | a variable of a species, an obstacle or a wall, by its name |
| `--set 'box.gravity(2)=-5'` | one element of a vector, by its number |

Each variable has a table, which lists the allowed values with their unit and the default. If there
is no default, the table contains an example. It can also contain the following rows:

- *applies with*: this variable has no effect unless another variable has the value stated here;
- *excludes*: variables that cannot be combined with this variable;
- *may change*: when the variable may change. Variables without an effect on the trajectory may
  change *on `--resume`*. *While a simulation runs* means by `&change`, in Python, or on the
  laboratory page. If this row is missing, the variable is fixed during a run.

`docs/input_page.py` generates the pages on variables from the table in the program.

## Groups

"""


def said(program: Path, *words: str) -> str:
    """Return the output of the program when called with the given options."""
    return subprocess.run([program, *words], check=True, capture_output=True, text=True).stdout


def variables(program: Path) -> dict[str, dict[str, dict]]:
    """Return the input variables of each group in `GROUPS`.

    Variables shared by all kinds of boundaries form a group of their own. Numbers in the table are
    texts in the format of the program.
    """
    table = json.loads(said(program, "--print-variables"), parse_float=str, parse_int=str)
    walls = [table[group] for group in BOUNDARIES]
    law = {name: entry for name, entry in walls[1].items() if shared(walls, name)}
    for wall in walls:
        for name in law:
            del wall[name]
    return {group: law if group == LAW else table[group] for group in GROUPS}


def written(entry: dict) -> str:
    """Convert the default or an example value of a variable to the format of an input file."""
    value = entry["example"] if entry["default"] is None else entry["default"]
    words = value if isinstance(value, list) else [value]
    words = [str(word).lower() if isinstance(word, bool) else word for word in words]
    how = {"text": "'{}'", "logical": ".{}."}.get(entry["type"], "{}")
    return ", ".join(how.format(word.replace("'", "''")) for word in words)


def shared(walls: list[dict[str, dict]], name: str) -> bool:
    """Return whether all kinds of boundaries have this variable with the same meaning."""
    return len({wall[name]["help"] for wall in walls if name in wall}) == 1 and all(
        name in wall for wall in walls
    )


def condition(group: str, entry: dict) -> str:
    """Return the setting that a variable requires, or '' if it requires none."""
    if not entry["goes_with"]:
        return ""
    [(choice, words)] = entry["goes_with"].items()
    text = f"`{choice}` = " + ", ".join(f"`'{word}'`" for word in words)
    if group == "species":
        text += f" (if `{choice}` is not given, this variable sets `{choice} = '{words[0]}'`)"
    return text


def facts(group: str, entry: dict) -> list[str]:
    """Return the table rows of a variable, such as its allowed values."""
    rows = {"allowed": entry["allowed"] + f" [{entry['unit']}]" * bool(entry["unit"])}
    if entry["default"] is not None:
        rows["default"] = f"`{written(entry)}`"
    else:
        given = "none; must be given" + " where it applies" * bool(entry["goes_with"])
        rows["default"] = entry["otherwise"] or given
        rows["example"] = f"`{written(entry)}`"
    rows["applies with"] = condition(group, entry)
    rows["excludes"] = ", ".join(f"`{name}`" for name in entry["excludes"] or [])
    rows["may change"] = (
        "on `--resume`" * entry["resumable"] + "while a simulation runs" * entry["changeable"]
    )
    return [f"| {name} | {value} |" for name, value in rows.items() if value]


def section(group: str, name: str, entry: dict) -> str:
    """Return the section of the page that describes a variable."""
    title = name if group == LAW else f"{group}.{name}"
    meanings = (entry["meanings"] or {}).items()
    lines = [f"### `{title}`", "", plain(entry["help"]), ""]
    lines += [f"- `'{word}'`: {plain(meaning)}" for word, meaning in meanings]
    lines += [""] * bool(meanings) + ["| property | value |", "|---|---|"]
    lines += [plain(row) for row in facts(group, entry)] + [""]
    return "\n".join(lines)


def plain(text: str) -> str:
    """Escape characters that Markdown uses for emphasis."""
    return text.replace("**", "^")


def file_of(group: str) -> str:
    """Return the file name, without extension, of the page of a group."""
    return "boundaries" if group == LAW else group


def title_of(group: str) -> str:
    """Return the heading of the page of a group."""
    return group if group == LAW else f"&{group}"


def example_of(group: str) -> list[str]:
    """Return the section with the example of a group, a part of an input file."""
    name = EXAMPLES[group]
    text = (ROOT / "input" / f"{name}.nml").read_text(encoding="utf-8")
    kind = "side" if group == LAW else group
    blocks = re.findall(rf"^&{kind}\n.*?^/\n", text, re.MULTILINE | re.DOTALL)
    link = f"[{name}.nml](../../../input/{name}.nml)"
    lines = ["## Example", "", f"The following example is part of {link}:", "", "```text"]
    lines += ["".join(blocks).rstrip("\n"), "```"]
    if (ROOT / f"input/pictures/{name}.png").exists():
        lines += ["", f"![{name}.nml](../../../input/pictures/{name}.png)"]
    return [*lines, ""]


def row_of(name: str, group: str, entry: dict, page: str = "") -> str:
    """Return a row of the list of variables, which links to the section on the variable."""
    title = name if group == LAW else f"{group}.{name}"
    default = f"`{written(entry)}`" if entry["default"] is not None else ""
    return f"| [`{name}`]({page}#{re.sub(r'[^a-z0-9_ -]', '', title)}) | {default} |"


def group_page(group: str, entries: dict[str, dict], common: dict[str, dict]) -> str:
    """Return the text of the page about a group of input variables.

    The list of variables includes those of the collision rule, `common`, if the group has them.
    """
    lines = [f"# {title_of(group)}", "", GROUPS[group], "", *example_of(group)]
    lines += ["## Variables", "", "| variable | default |", "|---|---|"]
    lines += [row_of(name, group, entry) for name, entry in entries.items()]
    if group in BOUNDARIES:
        lines += [row_of(name, LAW, entry, f"{file_of(LAW)}.md") for name, entry in common.items()]
    lines += ["", *(section(group, *one) for one in entries.items())]
    return "\n".join(lines)


def pages(program: Path) -> dict[str, str]:
    """Return a dictionary from the path of each page to its text."""
    groups = variables(program)
    found = {
        f"{FOLDER}/{file_of(group)}.md": group_page(group, entries, groups[LAW])
        for group, entries in groups.items()
    }
    items = "".join(
        f"- [{title_of(group)}](input/{file_of(group)}.md) with the variables "
        + ", ".join(f"`{name}`" for name in entries)
        + "\n"
        for group, entries in groups.items()
    )
    return {f"{FOLDER}.md": HEAD + items} | found


def main() -> None:
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    for path, text in pages(Path(sys.argv[1]).resolve()).items():
        (ROOT / path).parent.mkdir(exist_ok=True)
        (ROOT / path).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
