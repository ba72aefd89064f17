"""Random mutants: does a fault exist that only tests left out of `make test` detect?

    python tests/random_mutants.py [--seed 1] [--count 40] [--jobs 2] [--draw] [--rest]

A mutant is a copy of the sources with one fault. Lines of code are drawn uniformly from the Fortran
files of src/ and the Python files of post/ricochet/. In each of them an operator, comparison,
number, logical value or condition is changed, or the statement is deleted. Draws of lines that are
not code, and of mutants that do not compile, are repeated. With `--draw` the mutants are only
printed.

Each mutant is tested with two sets of tests, up to the first failure:

kept
    the tests of `make test`: the unit tests, and all tests of pytest without a mark
lost
    the tests that `make test` leaves out: the unit tests with all random cases (THOROUGH=1), and
    tests with the mark `statistics`

Tests run in the order described in `mutant_bench.py`. A fault detected by the first of the kept
tests is settled. Otherwise the lost tests run. If they fail, the remaining kept tests run as well;
if they pass, so that the fault is not one that only they detect, these run only with `--rest`.

The exit status is 1 if a fault is detected by lost tests alone. Lost tests that do not use the
program are not run for mutants of Fortran files. The script works on a copy of the last commit in
build/random_mutants. A repeated call continues an interrupted one, because the file `results` has a
line for each mutant tested at each commit.
"""

import argparse
import ast
import io
import random
import re
import sys
import tokenize
from collections.abc import Iterator
from typing import NamedTuple

from mutant_bench import ROOT, Bench, git

SCRATCH = ROOT / "build" / "random_mutants"
FOLDERS = {"src": ".f90", "post/ricochet": ".py"}
#: Replacements of a piece of code, the first group of a pattern.
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
NUMBER = re.compile(r"(?<![\w.])(\d+)(?=(\.\d+)?(?:_\w+)?(?![\w.]))")
CONDITION = re.compile(r"^\s*(?:else )?if \(")
STATEMENT = re.compile(
    r"^\s*(?:if \(.*\) )?(?!do )(?:call \w|\w[\w%(),: +*-]* = |return|exit|cycle|deallocate)"
)


class Mutant(NamedTuple):
    """Line of a file, and its replacement."""

    file: str
    line: int
    old: str
    new: str

    @property
    def name(self) -> str:
        return f"{self.file}:{self.line}"


def swapped(line: str, code: str, swaps: list[tuple[str, str]]) -> Iterator[str]:
    """Yield the line with each possible replacement; `code` is the line with strings blanked."""
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
    """Return a random mutant of a line drawn uniformly, or None if it is not code."""
    k = rng.randrange(sum(map(len, files.values())))
    for name, lines in files.items():
        if k < len(lines):
            changes = (fortran_changes if name.endswith(".f90") else python_changes)(lines, k)
            new = rng.choice(changes) if changes else lines[k]
            return Mutant(name, k + 1, lines[k], new) if new != lines[k] else None
        k -= len(lines)
    return None


def outcome(bench: Bench, mutant: Mutant, rest: bool) -> list[str]:
    """Return the tests that detect a mutant: kept, lost; `-` if not run, '' if none does."""
    lines = (bench.tree / mutant.file).read_text().splitlines()
    lines[mutant.line - 1] = mutant.new
    with bench.changed(mutant.file, "\n".join(lines) + "\n"):
        if bench.build():  # for a Python file without the previous fault
            return ["does not compile"]
        kept, lost = bench.first(mutant.file), ["-"]
        if not kept:
            lost = bench.lost(mutant.file)
            kept = bench.rest(mutant.file) if lost or rest else ["-"]
    return ["; ".join(kept[:2]), "; ".join(lost[:2])]


def main() -> int:
    """Print a table of mutants; return 1 if a mutant is detected by lost tests alone."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seed", type=int, default=1, help="of the draws [%(default)s]")
    parser.add_argument("--count", type=int, default=40, help="of mutants [%(default)s]")
    parser.add_argument("--jobs", type=int, default=2, help="at a time [%(default)s]")
    parser.add_argument("--draw", action="store_true", help="only print the mutants")
    parser.add_argument("--rest", action="store_true", help="run all kept tests in any case")
    args = parser.parse_args()
    rng, tested, alone = random.Random(args.seed), 0, 0
    commit, results = git("rev-parse", "--short=12", "HEAD"), SCRATCH / "results"
    bench = None if args.draw else Bench(SCRATCH, commit, args.jobs)
    tree = bench.tree if bench else ROOT
    files = {
        str(path.relative_to(tree)): path.read_text().splitlines()
        for folder, kind in FOLDERS.items()
        for path in sorted((tree / folder).rglob(f"*{kind}"))
    }
    known = {}
    if results.exists():
        known = dict(line.split("\t", 1) for line in results.read_text().splitlines())
    while tested < args.count:
        mutant = drawn(rng, files)
        if not mutant:
            continue
        key = f"{commit} {args.seed} {mutant.name} {mutant.new.strip()}"
        if bench and key not in known:
            known[key] = "\t".join(outcome(bench, mutant, args.rest))
            with results.open("a") as file:
                file.write(f"{key}\t{known[key]}\n")
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
