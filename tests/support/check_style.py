"""Check the source code for violations of design rules that no other tool checks.

    python tests/support/check_style.py [FOLDER]

The script prints one line per problem.  It checks that dependences between folders agree with the
arrows in src/README.md and post/ricochet/README.md.  It checks the lengths of files, procedures,
argument lists and comment lines, the case of keywords, the comments before procedures, the
visibility of names, and the choice of names.  It also checks the help texts, the first words of
sentences, and the use of a few forbidden words.  Finally it checks that there are no preprocessor
directives and no paths that exist only on one computer.
"""

import ast
import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

MOST_LINES_OF_FILE = 600
MOST_LINES_OF_PROCEDURE = 60
MOST_LINES_WITHOUT_COMMENT = 9
MOST_ARGUMENTS = 7
MOST_FILES_OF_FOLDER = 15
MOST_COLUMNS_OF_COMMENT = 100
MOST_COLUMNS_WITH_COMMENT = 110
CODE = {".F90", ".c", ".f90", ".js", ".pf", ".py", ".sh"}
ARROWS = re.compile(r"^ *(\w+) *--> *(\w+(?: *& *\w+)*) *$", re.MULTILINE)
UNIT = re.compile(r"\s*(?:module|program|(submodule)\s*\(\w+\))\s+(\w+)\s*$")
USE = re.compile(r"\s*use(?:\s*,\s*intrinsic\s*::)?\s+(\w+)\s*(,\s*only\s*:)?")
PREFIX = r"(?:(?:pure|impure|elemental|recursive|module)\s+|(?:\w+(?:\([^)]*\))?)\s+)*?"
PROCEDURE = re.compile(rf"\s*{PREFIX}(?:subroutine|function)\s+(\w+)\s*\(")
END = re.compile(r"\s*end\s+(?:subroutine|function)\b")
TYPES = "type|class|real|integer|logical|character|procedure"
DECLARATION = re.compile(rf"(?:use|import|implicit)\b|(?:{TYPES})\b.*::")
WORDS = (
    "allocatable allocate associate call case character class contains cycle deallocate do else "
    "elseif elemental end enddo endif exit function if implicit impure in inout integer intent "
    "interface intrinsic kind logical module none only optional out parameter pointer private "
    "procedure program public pure real recursive result return select submodule subroutine then "
    "type use where while"
)
KEYWORD = re.compile(rf"\b(?:{'|'.join(WORDS.split())})\b", re.IGNORECASE)
EMPTY_WORDS = re.compile(r"(?:get|set(?!_in_)|do|handle)_|(?:\w+_)?(?:manager|utils?)(?:_|$)")
MACHINE_PATH = re.compile(r"""(?:^|[\s"'=(:])/(?:home|root|Users|work|tmp|mnt|scratch)/\w""")
# The help text of a variable begins with a capitalised noun that names the quantity, not with a
# preposition, pronoun or verb.
HELP = re.compile(r'variable_t\("(\w*)", "(\w+)", "\w+", \d+, "\w+", "[^"]*",[ &\n]*"(\w*)')
NO_NOUN = {"Of", "In", "On", "At", "By", "With", "For", "From", "To", "How", "Whether", "When"}
NO_NOUN |= {"What", "That", "Those", "Where", "Which", "Use", "Set", "Give", "The", "It", "This"}
# After one of these words at its beginning, the subject of a sentence is a clause or a pronoun, not
# a noun.
NO_SUBJECT = re.compile(
    r"(?:^|[.!?] +)((?:What|Whom)\b(?![^.]*\?)|That which\b|(?:That|Those) (?:of|that|in)\b)"
)
# Each of these expressions occurred in several sentences that readers misunderstood, and no correct
# sentence needs it.
DENIED = {
    r"by turns": "alternately, or interleaved",
    r"\bof late[,.;]": "recently",
    r"some (?:seconds|minutes|hours)\b": "several ...: 'some' is an unknown number",
    r"in the mean\b": "on average",
    r"molten\b": "melted: 'molten' is an adjective",
    r"\bnormal (?:number|law)s?\b": "Gaussian: 'normal' is the direction of a wall",
    r"every bit of\b": "bit-identical to",
    r"\bblinks?\b": "the name of the time: negligible time",
    r"disks push\b": "piston, as textbooks do",
}


class Problem(NamedTuple):
    """Violation of a rule, with file and line."""

    path: Path
    line: int
    text: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.text}"


def code_of(line: str) -> str:
    """Return a line of code in lower case, without strings and comment."""
    return bare(line).lower()


def bare(line: str) -> str:
    """Return a line of code without strings and without its comment."""
    return re.sub(r"'[^']*'|\"[^\"]*\"", "''", line).split("!")[0]


def keyword_problems(path: Path, text: str) -> Iterator[Problem]:
    """Return keywords with capital letters."""
    for number, line in enumerate(text.splitlines(), start=1):
        for found in KEYWORD.finditer(bare(line)):
            if not found[0].islower():
                yield Problem(path, number, f"{found[0]}: write keywords in lower case")


def arrows_of(page: str) -> dict[str, set[str]]:
    """Return the folders that each folder may use, from lines such as `one --> other & another`."""
    arrows: dict[str, set[str]] = {}
    for start, ends in ARROWS.findall(page):
        arrows.setdefault(start, set()).update(re.findall(r"\w+", ends))
    return arrows


def arrow_problems(
    path: Path, lines: list[str], homes: dict[str, str], arrows: dict[str, set[str]]
) -> Iterator[Problem]:
    """Yield `use` statements that lack `only` or contradict the arrows."""
    own = path.parent.name
    for number, line in enumerate(lines, start=1):
        use = USE.match(line)
        if not use:
            continue
        if not use[2]:
            yield Problem(path, number, f"use {use[1]} without only")
        other = homes.get(use[1], own)
        if own != "src" and other not in arrows.get(own, set()) | {own}:
            what = f"{own}/ uses {use[1]} of {other}/"
            yield Problem(path, number, f"{what}: no such arrow in src/README.md")


def import_problems(root: Path, package: Path) -> Iterator[Problem]:
    """Yield imports in a Python package that contradict the arrows between its folders.

    A module at the top level of the package counts as a folder; `__init__.py` may use all folders.
    """
    page = package / "README.md"
    arrows = arrows_of(page.read_text())
    files = [path for path in package.rglob("*.py") if path != package / "__init__.py"]
    nodes = {path: path.relative_to(package).parts[0].removesuffix(".py") for path in files}
    for name in sorted((arrows.keys() | set().union(*arrows.values())) - set(nodes.values())):
        yield Problem(page.relative_to(root), 1, f"there is no {name} in the package")
    for folder in sorted({path.parent for path in files}):
        if len([path for path in folder.glob("*.py") if path in nodes]) > MOST_FILES_OF_FOLDER:
            yield Problem(folder.relative_to(root), 1, f"more than {MOST_FILES_OF_FOLDER} modules")
    for path, own in sorted(nodes.items()):
        for line, other in imports_of(path, package):
            if other not in arrows.get(own, set()) | {own}:
                what = f"{own} imports {other}"
                yield Problem(path.relative_to(root), line, f"{what}: no such arrow in {page.name}")


def imports_of(path: Path, package: Path) -> Iterator[tuple[int, str]]:
    """Yield the line of each import in a file, and the folder of the package that it imports."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.level > 0:
            start = path.parents[node.level - 1].relative_to(package).parts
            start += tuple(node.module.split(".")) if node.module else ()
            for name in node.names:
                yield node.lineno, (*start, name.name)[0]
        elif isinstance(node, ast.ImportFrom | ast.Import):
            whole = isinstance(node, ast.Import)
            for name in node.names:
                called = name.name if whole else f"{node.module}.{name.name}"
                if called.split(".")[0] == package.name:
                    yield node.lineno, called.split(".")[1] if "." in called else called


def length_problems(root: Path) -> Iterator[Problem]:
    """Yield code files outside `src/` that are too long."""
    paths = [path for name in ("post", "runs", "tests") for path in (root / name).rglob("*.*")]
    for path in sorted(path for path in paths if path.suffix in CODE):
        if (count := len(path.read_text().splitlines())) > MOST_LINES_OF_FILE:
            what = f"more than {MOST_LINES_OF_FILE} lines"
            yield Problem(path.relative_to(root), count, what)


def unit_problems(path: Path, lines: list[str]) -> Iterator[Problem]:
    """Yield a problem if a file is too long, or not one private module named like the file."""
    if len(lines) > MOST_LINES_OF_FILE:
        yield Problem(path, len(lines), f"more than {MOST_LINES_OF_FILE} lines")
    units = [unit for line in lines if (unit := UNIT.match(line))]
    if [unit[2] for unit in units] != [path.stem]:
        names = ", ".join(unit[2] for unit in units) or "nothing"
        yield Problem(path, 1, f"holds {names} instead of {path.stem}")
    is_part = any(unit[1] for unit in units)
    if path.stem != "main" and not is_part and "private" not in map(str.strip, lines):
        yield Problem(path, 1, "no private statement")
    for number, line in enumerate(lines, start=1):
        if line.startswith("#"):
            yield Problem(path, number, "preprocessor line")


def procedure_problems(path: Path, lines: list[str]) -> Iterator[Problem]:
    """Yield procedures that are too long, or whose names contain a meaningless word."""
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


def column_problems(path: Path, text: str) -> Iterator[Problem]:
    """Yield comment lines, and lines of code with a comment, that are too long."""
    for number, line in enumerate(text.splitlines(), start=1):
        if re.match(r"\s*!(?!\$)", line):
            most = MOST_COLUMNS_OF_COMMENT
        elif "!" in re.sub(r"'[^']*'|\"[^\"]*\"", "", line) and not re.match(r"\s*!", line):
            most = MOST_COLUMNS_WITH_COMMENT
        else:
            continue
        if len(line) > most:
            yield Problem(path, number, f"comment beyond column {most}")


def statements_of(text: str) -> list[tuple[int, str]]:
    """Return statements, comments and empty lines with their line numbers.

    Continuation lines are joined.
    """
    statements: list[tuple[int, str]] = []
    continued = False
    for number, line in enumerate(text.splitlines(), start=1):
        code = line.strip() if line.lstrip().startswith("!") else code_of(line).strip()
        if continued:
            statements[-1] = (statements[-1][0], statements[-1][1] + code.removesuffix("&"))
        else:
            statements.append((number, code.removesuffix("&")))
        continued = code.endswith("&") and not code.startswith("!")
    return statements


def heading_problems(path: Path, text: str) -> Iterator[Problem]:
    """Yield procedures that lack a comment or an empty line, or have too many arguments.

    No comment is needed for interfaces of C functions, which manual pages describe, and for private
    procedures of fewer than ten lines.
    """
    statements = statements_of(text)
    offered = public_names(statements)
    ends = [number for number, statement in statements if END.match(statement)]
    foreign = declared = inside = False
    before = ""
    for number, statement in statements:
        if re.match(r"(abstract )?interface\b|end interface\b", statement):
            foreign = statement.startswith("interface")
        elif (procedure := PROCEDURE.match(statement)) and not END.match(statement):
            name, words = procedure[1], statement[procedure.end() :].split(")")[0]
            count = len([word for word in words.split(",") if word.strip()])
            length = next((end for end in ends if end > number), number) - number + 1
            is_small = name not in offered and length <= MOST_LINES_WITHOUT_COMMENT
            if not foreign and not before.startswith("!>") and not is_small:
                yield Problem(path, number, f"{name} has no !> before it")
            if not foreign and count > MOST_ARGUMENTS:
                yield Problem(path, number, f"{name} has {count} arguments, not {MOST_ARGUMENTS}")
            inside, declared = True, False
        elif inside and DECLARATION.match(statement):
            declared = True
        elif inside and not statement.startswith("!"):
            if declared and statement and not re.match(r"end\b|contains\b", statement) and before:
                yield Problem(path, number, f"{name}: no blank line before the body")
            inside = False
        before = statement


def public_names(statements: list[tuple[int, str]]) -> set[str]:
    """Return the public names of a module, including the public bindings of its types."""
    names: set[str] = set()
    for _, statement in statements:
        kind, colons, listed = statement.partition("::")
        if colons and re.match(r"(?:public|procedure)\b", kind) and "private" not in kind:
            names.update(re.findall(r"\w+", listed))
    return names


def name_problems(root: Path, paths: list[Path]) -> Iterator[Problem]:
    """Yield imported and public names that are unused; public types are not checked."""
    tests = [*(root / "tests").rglob("*.pf"), *(root / "tests").rglob("*.f90")]
    uses = re.compile(r"use(?:, *intrinsic *::)? *(\w+) *, *only *: *(.*)")
    wanted = set()
    for path in [*paths, *tests]:
        statements = statements_of(path.read_text())
        text = re.sub(r"!.*", "", "\n".join(line for _, line in statements if not uses.match(line)))
        for number, statement in statements:
            if not (use := uses.match(statement)):
                continue
            for name, original in re.findall(r"(\w+)(?: *=> *(\w+))?", use[2]):
                wanted.add((use[1], original or name))
                if path in paths and not re.search(rf"(?:\b|_){name}\b", text):
                    yield Problem(path.relative_to(root), number, f"{name} is imported, not used")
    for path in paths:
        for number, statement in statements_of(path.read_text()):
            if re.match(r"public *::", statement):
                for name in re.findall(r"\w+", statement[6:]):
                    if (path.stem, name) not in wanted and not name.endswith("_t"):
                        yield Problem(path.relative_to(root), number, f"nobody uses {name}")


def path_problems(root: Path) -> Iterator[Problem]:
    """Yield paths that exist only on one computer, in files that are or could be committed."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    for name in subprocess.check_output(command, cwd=root, text=True).splitlines():
        try:
            lines = (root / name).read_text().splitlines()
        except (UnicodeDecodeError, OSError):
            continue
        for number, line in enumerate(lines, start=1):
            if MACHINE_PATH.search(line) and not line.startswith("MACHINE_PATH"):
                yield Problem(Path(name), number, "path of one machine")


def comments_of(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the line number and the text of each docstring and each block of comment lines."""
    text = path.read_text()
    if path.suffix == ".py":
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                for part in re.split(r"\n *\n", ast.get_docstring(node) or ""):
                    yield getattr(node, "lineno", 1), part
        found = [
            (token.start[0], token.string.lstrip("#: "))
            for token in tokenize.generate_tokens(io.StringIO(text).readline)
            if token.type == tokenize.COMMENT
        ]
    else:
        mark = r"^\s*(#)" if path.suffix == ".sh" else r"(!)"
        lines = (re.sub(r"'[^']*'|\"[^\"]*\"", "''", line) for line in text.splitlines())
        found = [
            (number, line[start.start(1) :].lstrip("#!> "))
            for number, line in enumerate(lines, start=1)
            if (start := re.search(mark, line))
        ]
    previous, start, words = 0, 0, ""
    for number, line in found:
        if words and number == previous + 1:
            words += " " + line
        else:
            if words:
                yield start, words
            start, words = number, line
        previous = number
    if words:
        yield start, words


def language_problems(root: Path) -> Iterator[Problem]:
    """Yield help texts without an initial noun, badly begun sentences, and denied expressions."""
    for path in sorted((root / "src").glob("*/*.f90")):
        text = path.read_text()
        for row in HELP.finditer(text):
            if row[3] in NO_NOUN or not row[3][:1].isupper():
                line = text.count("\n", 0, row.start()) + 1
                what = f"the help of {row[1]}.{row[2]} begins with no capital noun"
                yield Problem(path.relative_to(root), line, f"{what}: {row[3]}")
    folders = ("src", "post", "runs", "tests")
    sources = [path for name in folders for path in (root / name).rglob("*.*")]
    for path in sorted(sources):
        if path.suffix not in (".f90", ".pf", ".py", ".sh"):
            continue
        for line, comment in comments_of(path):
            words = " ".join(comment.split())
            if begin := NO_SUBJECT.search(words):
                what = f"a sentence begins with {begin[1]}: name the noun"
                yield Problem(path.relative_to(root), line, what)
            if "tests" not in path.relative_to(root).parts:
                yield from denied_words(path.relative_to(root), line, words)
    for path in sorted((root / "docs").rglob("*.md")):
        for number, words in enumerate(path.read_text().splitlines(), start=1):
            yield from denied_words(path.relative_to(root), number, words)


def denied_words(path: Path, line: int, words: str) -> Iterator[Problem]:
    """Yield a problem for each denied expression in a text."""
    for pattern, better in DENIED.items():
        if found := re.search(pattern, words):
            yield Problem(path, line, f"{found[0]!r}: write {better}")


def problems_of(root: Path) -> Iterator[Problem]:
    """Yield all problems of the project in the folder `root`."""
    arrows = arrows_of((root / "src" / "README.md").read_text())
    paths = sorted((root / "src").rglob("*.f90"))
    homes = {path.stem: path.parent.name for path in paths}
    folders = {path.parent for path in paths if path.parent.name != "src"}
    named = arrows.keys() | set().union(*arrows.values())
    for name in sorted(named - {folder.name for folder in folders} - {"run"}):
        yield Problem(Path("src/README.md"), 1, f"there is no folder src/{name}")
    for folder in sorted(folders):
        if not (folder / "README.md").exists():
            yield Problem(folder.relative_to(root), 1, "has no README.md")
        if len(list(folder.glob("*.f90"))) > MOST_FILES_OF_FOLDER:
            yield Problem(folder.relative_to(root), 1, f"more than {MOST_FILES_OF_FOLDER} modules")
    for path in paths:
        text = path.read_text()
        lines = [code_of(line) for line in text.splitlines()]
        own = path.relative_to(root)
        yield from arrow_problems(own, lines, homes, arrows)
        yield from unit_problems(own, lines)
        yield from keyword_problems(own, text)
        yield from procedure_problems(own, lines)
        yield from heading_problems(own, text)
        yield from column_problems(own, text)
    yield from name_problems(root, paths)
    if (package := root / "post" / "ricochet").is_dir():
        yield from import_problems(root, package)
    yield from length_problems(root)
    yield from language_problems(root)
    yield from path_problems(root)


def main() -> int:
    """Print all problems; return the exit status, 1 if there are any."""
    problems = list(problems_of(Path(sys.argv[1] if len(sys.argv) > 1 else ".")))
    print(*problems, sep="\n", end="\n" if problems else "")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
