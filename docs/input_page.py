"""Write the pages on input variables from the table that the program prints.

python docs/input_page.py build/ricochet

The page docs/reference/input.md lists the groups of input variables.  For each group, the script
also writes a page in docs/reference/input/, which describes the variables and contains an example
and a picture.  The example of a group is a part of an input file in input/.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = "docs/reference/input"
LAW = "Collision rules of boundaries"
GROUPS = {
    "run": "Seed, method and number of threads of the run.",
    "box": "Size of the box, its boundaries, gravity and shear "
    "([theory](../../explanation/theory.md#sheared-boxes)).",
    "side": "A side of the box that is a wall, with its motion "
    "([theory](../../explanation/theory.md#sides-that-move)); one group for each side that is "
    "described. Its collision rule is described under [boundaries](boundaries.md).",
    "obstacle": "A circular obstacle or an arc, or many of them from a file; repeated for each. "
    "Its collision rule is described under [boundaries](boundaries.md).",
    "wall": "A straight wall, a polyline, or many walls from a file; repeated for each. Disks "
    "bounce off both faces and off the end points. Its collision rule is described under "
    "[boundaries](boundaries.md).",
    LAW: "Each group `&side`, `&obstacle` and `&wall` may contain these variables. Where they "
    "are not given, the `wall_...` variables of [`&contact`](contact.md) apply.",
    "species": "Disks of one kind; repeated for each species. At least one is needed "
    "([starting states](../../explanation/theory.md#starting-states)).",
    "contact": "Collision rules of disks, and of boundaries that have none of their own "
    "([theory](../../explanation/theory.md#contact)).",
    "drive": "Driving: changes of velocities (kicks) at fixed intervals "
    "([theory](../../explanation/theory.md#kicks)).",
    "stop": "End of the run, at the first of these rules that is met. At least one is needed. If "
    "no further event can occur and no `time` is given, the run ends at the last collision, or "
    "at the sample that is due after it.",
    "output": "Contents of the output file, and the times at which they are written. The initial "
    "and the final state are always written. Averages over samples by collisions or events "
    "differ from averages over time by a relative amount of order 1/N "
    "([output](../output.md#observables)).",
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
    "stop": "scattering",
    "output": "mixture",
}

HEAD = """\
# Input: every variable

This page is the reference for all variables of an input file, for everybody who writes one.
[input/README](../../input/README.md) explains the rules of the format and shows how to describe a
system; [input/reference.nml](../../input/reference.nml) is a file with all variables. The same text
for one variable is printed by `ricochet --explain VARIABLE`; `--explain WORD` searches names,
choices and explanations. `docs/input_page.py` generates these pages from the table in the program.

A file consists of groups `&name ... /` with lines `variable = value`. Only values that differ from
the default are needed. On the command line `--set GROUP.VARIABLE=VALUE` replaces a value. A
species, an obstacle or a wall is addressed by its name, as in `--set species.projectile.mass=50`,
and one element of a vector by its number, as in `--set 'box.gravity(2)=-5'`. The file chooses the
units of length, time and mass ([units](../explanation/glossary.md#units)).

For each variable the pages list the values that are *allowed*, the *default* (if there is none, an
example), the choice of another variable with which it *applies*, and variables of its group with
which it may *not* be given *together*. A variable *may change* when a run is continued
(`--resume`), because it has no effect on the trajectory, or while a simulation runs (in Python and
on the laboratory page). All other variables are fixed during a run.

## Groups

"""


def said(program: Path, *words: str) -> str:
    """Return the output of the program when it is called with an option."""
    return subprocess.run([program, *words], check=True, capture_output=True, text=True).stdout


def variables(program: Path) -> dict[str, dict[str, dict]]:
    """Return the input variables that belong to each group in `GROUPS`.

    Variables that are common to all kinds of boundaries form a separate group.  Numbers in the
    table of variables are stored as texts in the format of the program.
    """
    table = json.loads(said(program, "--print-variables"), parse_float=str, parse_int=str)
    walls = [table[group] for group in ("side", "obstacle", "wall")]
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
    """Return whether all kinds of boundaries have a variable of this name with the same meaning."""
    return len({wall[name]["help"] for wall in walls if name in wall}) == 1 and all(
        name in wall for wall in walls
    )


def condition(group: str, entry: dict) -> str:
    """Return the setting that a variable requires, or an empty text if it requires none."""
    if not entry["goes_with"]:
        return ""
    [(choice, words)] = entry["goes_with"].items()
    text = f"`{choice}` = " + ", ".join(f"`'{word}'`" for word in words)
    if group == "species":
        text += f" (if `{choice}` is not given, this variable sets `{choice} = '{words[0]}'`)"
    return text


def facts(group: str, entry: dict) -> list[str]:
    """Return the properties of a variable, such as its allowed values, as text for the page."""
    allowed = [f"Allowed: {entry['allowed']}" + f" [{entry['unit']}]" * bool(entry["unit"])]
    if entry["default"] is not None:
        default = f"Default: `{written(entry)}`"
    else:
        given = "none; must be given" + " where it applies" * bool(entry["goes_with"])
        default = f"Default: {entry['otherwise'] or given}. Example: `{written(entry)}`"
    applies = condition(group, entry)
    excludes = ", ".join(f"`{name}`" for name in entry["excludes"] or [])
    change = "on `--resume`" * entry["resumable"] + "while a simulation runs" * entry["changeable"]
    return [
        *allowed,
        default,
        *([f"Applies with: {applies}"] if applies else []),
        *([f"Not together with: {excludes}"] if excludes else []),
        *([f"May change: {change}"] if change else []),
    ]


def section(group: str, name: str, entry: dict) -> str:
    """Return the section of the page that describes one variable."""
    title = name if group == LAW else f"{group}.{name}"
    meanings = (entry["meanings"] or {}).items()
    lines = [f"### `{title}`", "", plain(entry["help"]), ""]
    lines += [f"- `'{word}'`: {plain(meaning)}" for word, meaning in meanings]
    lines += [""] * bool(meanings) + [plain(". ".join(facts(group, entry)) + "."), ""]
    return "\n".join(lines)


def plain(text: str) -> str:
    """Return the text after escaping the characters that Markdown uses for emphasis."""
    return text.replace("**", "^")


def file_of(group: str) -> str:
    """Return the file name, without extension, of the page about a group of input variables."""
    return "boundaries" if group == LAW else group


def title_of(group: str) -> str:
    """Return the heading of the page about a group of input variables."""
    return group if group == LAW else f"&{group}"


def example_of(group: str) -> list[str]:
    """Return the section with the example of a group, which shows a part of an input file."""
    name = EXAMPLES[group]
    text = (ROOT / "input" / f"{name}.nml").read_text(encoding="utf-8")
    kind = "side" if group == LAW else group
    blocks = re.findall(rf"^&{kind}\n.*?^/\n", text, re.MULTILINE | re.DOTALL)
    lines = ["## Example", "", f"From [{name}.nml](../../../input/{name}.nml):", "", "```text"]
    lines += ["".join(blocks).rstrip("\n"), "```"]
    if (ROOT / f"input/pictures/{name}.png").exists():
        lines += ["", f"![{name}.nml](../../../input/pictures/{name}.png)"]
    return [*lines, ""]


def linked(name: str, group: str) -> str:
    """Return a link to the section of the page that describes a variable."""
    title = name if group == LAW else f"{group}.{name}"
    return f"[`{name}`](#{re.sub(r'[^a-z0-9_ -]', '', title)})"


def group_page(group: str, entries: dict[str, dict]) -> str:
    """Return the text of the page about a group of input variables."""
    lines = [f"# {title_of(group)}", "", GROUPS[group], "", *example_of(group)]
    lines += ["## Variables", "", "| variable | default |", "|---|---|"]
    for name, entry in entries.items():
        default = f"`{written(entry)}`" if entry["default"] is not None else ""
        lines.append(f"| {linked(name, group)} | {default} |")
    lines += ["", *(section(group, *one) for one in entries.items())]
    return "\n".join(lines)


def pages(program: Path) -> dict[str, str]:
    """Return a dictionary from the path of each page to its text."""
    groups = variables(program)
    found = {
        f"{FOLDER}/{file_of(group)}.md": group_page(group, entries)
        for group, entries in groups.items()
    }
    items = "".join(
        f"- [{title_of(group)}](input/{file_of(group)}.md): "
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
