"""Holds src/ against the rules of the design that no other tool knows. One line per problem.

    python tests/support/check_style.py [FOLDER]

Layers (their table stands in src/README.md), file and procedure lengths, privacy, names, no
pre-processor; and no path of somebody's machine in any file of the project.
"""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

OUTSIDE = {"hdf5", "iso_c_binding", "iso_fortran_env", "ieee_arithmetic"}
MOST_LINES_OF_FILE = 500
MOST_LINES_OF_PROCEDURE = 60
UNIT = re.compile(r"\s*(?:module|program)\s+(\w+)\s*$")
USE = re.compile(r"\s*use(?:\s*,\s*intrinsic\s*::)?\s+(\w+)\s*(,\s*only\s*:)?")
PREFIX = r"(?:(?:pure|impure|elemental|recursive|module)\s+|(?:\w+(?:\([^)]*\))?)\s+)*?"
PROCEDURE = re.compile(rf"\s*{PREFIX}(?:subroutine|function)\s+(\w+)\s*\(")
END = re.compile(r"\s*end\s+(?:subroutine|function)\b")
EMPTY_WORDS = re.compile(r"(?:get|set(?!_in_)|do|handle)_|(?:\w+_)?(?:manager|utils?)(?:_|$)")
MACHINE_PATH = re.compile(r"""(?:^|[\s"'=(:])/(?:home|root|Users|work|tmp|mnt|scratch)/\w""")


class Problem(NamedTuple):
    """What is wrong, and where."""

    path: Path
    line: int
    text: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.text}"


def code_of(line: str) -> str:
    """A line in lower case without texts and comment."""
    return re.sub(r"'[^']*'|\"[^\"]*\"", "''", line).split("!")[0].lower()


def layers_of(table: str) -> dict[str, int]:
    """The layer of each module, from the rows `| layer | `module` | ...` of src/README.md."""
    rows = re.findall(r"^\| *(\d+) *\| *`(\w+)` *\|", table, re.MULTILINE)
    return {name: int(layer) for layer, name in rows}


def layer_problems(path: Path, lines: list[str], layers: dict[str, int]) -> Iterator[Problem]:
    """Modules outside the table, and uses that do not point downwards or name no entities."""
    name = path.stem
    if name not in layers:
        yield Problem(path, 1, f"{name} is missing in the table of src/README.md")
    for number, line in enumerate(lines, start=1):
        use = USE.match(line)
        if not use:
            continue
        if not use[2]:
            yield Problem(path, number, f"use {use[1]} without only")
        own, other = layers.get(name), layers.get(use[1])
        if use[1] not in OUTSIDE and None not in (own, other) and other >= own:
            yield Problem(path, number, f"layer {own} uses {use[1]} of layer {other}")


def unit_problems(path: Path, lines: list[str]) -> Iterator[Problem]:
    """A file is one module of its own name, closed by default, and not too long."""
    if len(lines) > MOST_LINES_OF_FILE:
        yield Problem(path, len(lines), f"more than {MOST_LINES_OF_FILE} lines")
    units = [unit[1] for line in lines if (unit := UNIT.match(line))]
    if units != [path.stem]:
        yield Problem(path, 1, f"holds {', '.join(units) or 'nothing'} instead of {path.stem}")
    if path.stem != "main" and "private" not in map(str.strip, lines):
        yield Problem(path, 1, "no private statement")
    for number, line in enumerate(lines, start=1):
        if line.startswith("#"):
            yield Problem(path, number, "pre-processor line")


def procedure_problems(path: Path, lines: list[str]) -> Iterator[Problem]:
    """Procedures that are too long or have empty words for a name."""
    start = name = None
    for number, line in enumerate(lines, start=1):
        if END.match(line):
            if start and number - start + 1 > MOST_LINES_OF_PROCEDURE:
                yield Problem(path, start, f"{name} is longer than {MOST_LINES_OF_PROCEDURE} lines")
            start = None
        elif procedure := PROCEDURE.match(line):
            start, name = number, procedure[1]
            if EMPTY_WORDS.match(name):
                yield Problem(path, number, f"{name}: such a name says nothing; say what it is")


def path_problems(root: Path) -> Iterator[Problem]:
    """Paths of one machine, in any file that is or could be committed."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    for name in subprocess.check_output(command, cwd=root, text=True).splitlines():
        try:
            lines = (root / name).read_text().splitlines()
        except (UnicodeDecodeError, OSError):
            continue
        for number, line in enumerate(lines, start=1):
            if MACHINE_PATH.search(line) and not line.startswith("MACHINE_PATH"):
                yield Problem(Path(name), number, "path of one machine")


def problems_of(root: Path) -> Iterator[Problem]:
    """All problems of the project in `root`."""
    layers = layers_of((root / "src" / "README.md").read_text())
    paths = sorted((root / "src").glob("*.f90"))
    for name in layers.keys() - {path.stem for path in paths} - {"build_info"}:
        yield Problem(Path("src/README.md"), 1, f"there is no src/{name}.f90")
    for path in paths:
        lines = [code_of(line) for line in path.read_text().splitlines()]
        own = path.relative_to(root)
        yield from layer_problems(own, lines, layers)
        yield from unit_problems(own, lines)
        yield from procedure_problems(own, lines)
    yield from path_problems(root)


def main() -> int:
    """Prints the problems; 1 if there are any."""
    root = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    problems = list(problems_of(root))
    print(*problems, sep="\n", end="\n" if problems else "")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
