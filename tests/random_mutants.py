"""Random mutants: does a fault exist that only tests left out of `make test` detect?

    python tests/random_mutants.py [--seed 1] [--count 40] [--jobs 2] [--draw] [--rest]

A mutant is a copy of the sources with one fault.  The script draws lines of code uniformly from the
Fortran files of src/ and the Python files of post/ricochet/, and changes an operator, comparison,
number, logical value or condition of each line, or deletes the statement.  Draws of lines that are
not code, and of mutants that do not compile, are repeated.  With `--draw` the mutants are only
printed.

Each mutant runs against two sets of tests, up to the first failure:

kept
    the tests of `make test`: the unit tests, and all tests of pytest without a mark
lost
    the tests that `make test` leaves out: the unit tests with all random cases (THOROUGH=1), and
    tests with the mark `statistics`

The tests that the table of the folder names for the mutated file run first, because they detect
most faults.  If they fail, the fault is kept's, and nothing else runs.  Otherwise the lost tests
run.  If the lost tests pass, the fault cannot be detected by them alone; then the remaining kept
tests run only with `--rest`.  If the lost tests fail, the remaining kept tests run, too.

The script returns 1 if a fault is detected by lost tests alone.  All programs and libraries have
run-time checks (the build of the unit tests), because this build takes seconds after a change.
Lost tests that pass without any program do not run for mutants of Fortran files.  The script works
in build/random_mutants, on a copy of the last commit.  A repeated call continues an interrupted
one, because the file `results` contains a line for each tested mutant of each commit.  A test of
pytest must fail twice, as on a busy machine it can fail because it has waited too long.
"""

import argparse
import ast
import io
import os
import random
import re
import shlex
import shutil
import subprocess
import sys
import tokenize
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from mutants import FAILURE, ROOT, UNIT_BUILD, git

sys.path.insert(0, str(Path(__file__).parent / "support"))
from protecting_tests import protecting_tests

SCRATCH = ROOT / "build" / "random_mutants"
FOLDERS = {"src": ".f90", "post/ricochet": ".py"}
#: Replacements of a piece of code; the first group of a pattern is replaced.
SWAPS = [
    (r"(?<![*+\-/=<>(,e.] )(?<=[\w)\] ])(\+)(?=[ \w(])", "-"),
    (r"(?<=[\w)\]]) ?(-) ?(?=[\w(])", "+"),
    (r"(?<=[\w)\]])(\*)(?=[\w(])", "/"),
    (r"(?<=[\w)\]])( \* )(?=[\w(])", " / "),
    (r"(?<=[\w)\]])(/)(?=[\w(])", "*"),
    (r"(?<=[\w)\]])( / )(?=[\w(])", " * "),
    (r" (<) ", "<="), (r" (<=) ", "<"), (r" (>) ", ">="), (r" (>=) ", ">"),
    (r" (==) ", "/=" ), (r" (/=) ", "=="),
]  # fmt: skip
FORTRAN_SWAPS = [
    (r"(\.and\.)", ".or."), (r"(\.or\.)", ".and."),
    (r"(\.true\.)", ".false."), (r"(\.false\.)", ".true."),
    (r"\b(min)\(", "max"), (r"\b(max)\(", "min"), (r"\b(\.not\. )", ""),
]  # fmt: skip
PYTHON_SWAPS = [
    (r" (==) ", "!="), (r" (!=) ", "=="), (r"\b(and)\b", "or"), (r"\b(or)\b", "and"),
    (r"\b(True)\b", "False"), (r"\b(False)\b", "True"), (r"\b(not )", ""),
    (r"\b(min)\(", "max"), (r"\b(max)\(", "min"),
]  # fmt: skip
IMPORTS = re.compile(r"^from ricochet[\w.]* import (?:\([^)]*\)|.*)", re.MULTILINE)
PYTEST = "timeout 3600 prlimit --cpu=400 .venv/bin/python -m pytest -q -p no:randomly"
NUMBER = re.compile(r"(?<![\w.])(\d+)(?=(\.\d+)?(?:_\w+)?(?![\w.]))")
CONDITION = re.compile(r"^\s*(?:else )?if \(")
STATEMENT = re.compile(
    r"^\s*(?:if \(.*\) )?(?:call \w|\w[\w%(),: +*-]* = |return|exit|cycle|deallocate)"
)


class Mutant(NamedTuple):
    """A line of a file and its replacement."""

    file: str
    line: int
    old: str
    new: str

    @property
    def name(self) -> str:
        return f"{self.file}:{self.line}"


def swapped(line: str, code: str, swaps: list[tuple[str, str]]) -> Iterator[str]:
    """Return the line with each possible replacement; `code` is the line with strings blanked."""
    for pattern, new in swaps:
        for found in re.finditer(pattern, code):
            yield line[: found.start(1)] + new + line[found.end(1) :]
    for found in NUMBER.finditer(code):
        yield line[: found.start(1)] + str(int(found[1]) + 1) + line[found.end(1) :]


def fortran_changes(lines: list[str], k: int) -> list[str]:
    """Return all mutants of a line of Fortran."""
    line = lines[k]
    code = re.sub(r"'[^']*'|\"[^\"]*\"", lambda text: " " * len(text[0]), line)
    code = re.sub(r"!.*", lambda text: " " * len(text[0]), code)
    if not code.strip() or re.match(r"\s*(use|public|private|module|end|implicit)\b", code):
        return []
    found = list(swapped(line, code, [*SWAPS, *FORTRAN_SWAPS]))
    whole = not code.rstrip().endswith("&") and not (k and lines[k - 1].rstrip().endswith("&"))
    if whole and (start := CONDITION.match(code)):
        end, depth = start.end(), 1
        while depth:
            depth += {"(": 1, ")": -1}.get(code[end], 0)
            end += 1
        condition = line[start.end() : end - 1]
        found.append(f"{line[: start.end()]}.not. ({condition}){line[end - 1 :]}")
    if whole and STATEMENT.match(code) and "::" not in code and "=>" not in code:
        found.append("")
    return found


def python_code(text: str) -> list[str]:
    """Return the lines of a Python file with strings and comments blanked."""
    lines = [list(line) for line in text.splitlines()]
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in (tokenize.STRING, tokenize.COMMENT):
            (first, start), (last, end) = token.start, token.end
            for row in range(first, last + 1):
                own = lines[row - 1]
                left, right = start if row == first else 0, end if row == last else len(own)
                own[left:right] = " " * (right - left)
    return ["".join(line) for line in lines]


def python_changes(lines: list[str], k: int) -> list[str]:
    """Return all mutants of a line of Python."""
    text = "\n".join(lines) + "\n"
    line, code = lines[k], python_code(text)[k]
    if not code.strip() or re.match(r"\s*(import|from|def|class|@|[)\]}]+:?$)", code):
        return []
    found = list(swapped(line, code, [*SWAPS[:-2], *PYTHON_SWAPS]))
    indent = line[: len(line) - len(line.lstrip())]
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.If) and node.test.lineno == node.test.end_lineno == k + 1:
            test = node.test
            condition = line[test.col_offset : test.end_col_offset]
            found.append(f"{line[: test.col_offset]}not ({condition}){line[test.end_col_offset :]}")
        kinds = ast.Assign | ast.AugAssign | ast.Expr | ast.Return | ast.Raise
        if isinstance(node, kinds) and node.lineno == node.end_lineno == k + 1:
            found.append(f"{indent}pass")
    return [new for new in found if compiles("\n".join([*lines[:k], new, *lines[k + 1 :]]))]


def compiles(text: str) -> bool:
    try:
        compile(text, "mutant", "exec")
    except SyntaxError:
        return False
    return True


def drawn(rng: random.Random, files: dict[str, list[str]]) -> Mutant | None:
    """Return a random mutant of a line drawn uniformly, or nothing if it is not code."""
    k = rng.randrange(sum(map(len, files.values())))
    for name, lines in files.items():
        if k < len(lines):
            changes = (fortran_changes if name.endswith(".f90") else python_changes)(lines, k)
            new = rng.choice(changes) if changes else lines[k]
            return Mutant(name, k + 1, lines[k], new) if new != lines[k] else None
        k -= len(lines)
    return None


class Bench:
    """A copy of the project in which mutants are built and tested."""

    def __init__(self, jobs: int, of_program: str):
        """Make the copy, and test it without a fault unless `of_program` is known already."""
        self.tree, self.jobs, self.log = SCRATCH / "tree", jobs, SCRATCH / "log"
        if not self.tree.exists():
            git("clone", "--quiet", "--shared", "--no-checkout", str(ROOT), str(self.tree))
        self.restore()
        for name in (".venv", "build/tests"):
            if (ROOT / name).exists() and not (self.tree / name).exists():
                shutil.copytree(ROOT / name, self.tree / name, symlinks=True)
        subprocess.run([".ci/set-up", "demo", "test"], cwd=self.tree, check=True)
        self.of_program = of_program.split("; ")
        if not of_program:
            units = self.build() or self.units(thorough="1")
            if said := units or self.pytest("-m statistics tests"):
                raise SystemExit(f"The tests fail without a fault: {said}")
            nothing = {"RICOCHET": "/", "RICOCHET_LIBRARY": "/"}
            self.of_program = self.run(f"{PYTEST} -n {jobs} -m statistics tests", **nothing)

    def restore(self) -> None:
        commit = git("rev-parse", "HEAD")
        git("checkout", "--quiet", "--force", "--detach", commit, folder=self.tree)

    def apply(self, mutant: Mutant) -> None:
        path = self.tree / mutant.file
        lines = path.read_text().splitlines()
        lines[mutant.line - 1] = mutant.new
        path.write_text("\n".join(lines) + "\n")

    def run(self, command: str, **variables: str) -> list[str]:
        """Run a command; if it fails, return the names of tests or the last words of its output."""
        build = f"{self.tree}/build/tests"
        own = {"RICOCHET": f"{build}/ricochet", "RICOCHET_LIBRARY": build} | variables
        with self.log.open("w") as output:
            streams = {"stdout": output, "stderr": output, "env": os.environ | own}
            failed = subprocess.call(command, shell=True, cwd=self.tree, **streams)
        said = self.log.read_text(errors="replace")
        return (FAILURE.findall(said) or [" ".join(said.split()[-30:])]) if failed else []

    def build(self) -> list[str]:
        make = f"make -j{self.jobs} {UNIT_BUILD}"
        return self.run(f"{make} build/tests/unit_tests build/tests/ricochet && {make} library")

    def units(self, files: Sequence[str] = (), thorough: str = "") -> list[str]:
        """Run unit tests of some suites or of all."""
        program = "OMP_WAIT_POLICY=passive prlimit --cpu=600 --as=8000000000 build/tests/unit_tests"
        runs = [f"{program} -f {Path(file).stem}." for file in files] or [program]
        return self.run(" && ".join(runs), THOROUGH=thorough)

    def pytest(self, *words: str) -> list[str]:
        """Run tests until one fails twice: on a busy machine a test can fail by chance."""
        flags, passed = f"-x -n {self.jobs} --dist worksteal", []
        while found := self.run(" ".join([PYTEST, flags, *words, *passed])):
            names = [shlex.quote(name) for name in found if "::" in name]
            if not names or self.run(" ".join([PYTEST, "-m ''", *names])):
                return found
            passed += [f"--deselect {name}" for name in names]
        return []

    def first(self, mutant: Mutant) -> list[str]:
        """Run the tests that are most likely to detect a mutant; all of them are kept tests."""
        files = protecting_tests(self.tree).get(mutant.file, [])
        units = [name for name in files if name.endswith(".pf")]
        runs = [f"tests/*/{name}" for name in files if name.endswith(".py")]
        if mutant.file.endswith(".py"):
            word = re.compile(rf"\b{Path(mutant.file).stem}\b")
            every = sorted((self.tree / "tests").glob("*/test_*.py"))
            runs = [str(path.relative_to(self.tree)) for path in every
                    if word.search("".join(IMPORTS.findall(path.read_text())))]  # fmt: skip
        return (self.units(units) if units else []) or (self.pytest(*runs) if runs else [])

    def lost(self, mutant: Mutant) -> list[str]:
        """Run the tests that `make test` leaves out."""
        if mutant.file.endswith(".py"):
            return self.pytest("-m statistics tests")
        names = map(shlex.quote, self.of_program)
        return self.units(thorough="1") or self.pytest("-m statistics", *names)

    def rest(self, mutant: Mutant) -> list[str]:
        """Run all kept tests."""
        return (self.units() if mutant.file.endswith(".f90") else []) or self.pytest("tests")

    def outcome(self, mutant: Mutant, rest: bool) -> list[str]:
        """Return the tests that detect a mutant: kept, lost; `-` if not run, '' if none does."""
        self.apply(mutant)
        try:
            if mutant.file.endswith(".f90") and self.build():
                return ["does not compile"]
            kept, lost = self.first(mutant), ["-"]
            if not kept:
                lost = self.lost(mutant)
                kept = self.rest(mutant) if lost or rest else ["-"]
            return ["; ".join(kept[:2]), "; ".join(lost[:2])]
        finally:
            self.restore()


def main() -> int:
    """Print a table of mutants; return 1 if a mutant is detected by lost tests alone."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seed", type=int, default=1, help="of the draws [%(default)s]")
    parser.add_argument("--count", type=int, default=40, help="of mutants [%(default)s]")
    parser.add_argument("--jobs", type=int, default=2, help="at a time [%(default)s]")
    parser.add_argument("--draw", action="store_true", help="only print the mutants")
    parser.add_argument("--rest", action="store_true", help="run all kept tests in any case")
    args = parser.parse_args()
    files = {
        str(path.relative_to(ROOT)): path.read_text().splitlines()
        for folder, kind in FOLDERS.items()
        for path in sorted((ROOT / folder).rglob(f"*{kind}"))
    }
    rng, tested, alone = random.Random(args.seed), 0, 0
    SCRATCH.mkdir(parents=True, exist_ok=True)
    results = SCRATCH / "results"
    results.touch()
    commit = git("rev-parse", "--short=12", "HEAD")
    known = dict(line.split("\t", 1) for line in results.read_text().splitlines())

    def store(key: str, found: list[str]) -> None:
        known[key] = "\t".join(found)
        with results.open("a") as file:
            file.write(f"{key}\t{known[key]}\n")

    if not args.draw:
        bench = Bench(args.jobs, known.get(f"{commit} nothing", ""))
        if f"{commit} nothing" not in known:
            store(f"{commit} nothing", ["; ".join(bench.of_program)])
    while tested < args.count:
        mutant = drawn(rng, files)
        if not mutant:
            continue
        key = f"{commit} {args.seed} {mutant.name} {mutant.new.strip()}"
        if not args.draw and key not in known:
            store(key, bench.outcome(mutant, args.rest))
        found = known.get(key, "").split("\t")
        if found == ["does not compile"]:
            continue
        tested += 1
        print(f"{tested}. {mutant.name}\n  - {mutant.old.strip()}\n  + {mutant.new.strip()}")
        if len(found) == 2:
            print(f"  kept: {found[0] or 'none'}\n  lost: {found[1] or 'none'}", flush=True)
            alone += not found[0] and found[1] not in ("", "-")
    return 1 if alone else 0


if __name__ == "__main__":
    sys.exit(main())
