"""Mutation test: introduce faults one at a time, and report which test detects each of them.

    python tests/mutants.py [NAME...] [--jobs 2] [--commit HEAD]
    python tests/mutants.py --check

The test works on a copy of the last commit in build/mutants. A repeated call continues an
interrupted test, because the file `results` in this folder has a line for each mutant (source with
one fault) tested at each commit. For each mutant, the tests of `make test` run up to the first
failure, as described in `mutant_bench.py`. Most mutants take half a minute; one that no test
detects takes as long as `make test`. `--check` only checks that each text to be replaced occurs
exactly once.

The file mutants.diff describes each fault by a sentence and by a change of the present sources.
When the sources are rewritten, the sentence stays and the change is adapted. Earlier changes are in
the history of mutants.diff, and can be tested in a clone at an old commit.

The 24 faults were drawn from commit 67f9503 by `random.Random(20261124)`: two from each folder of
src/, one from run.f90, and three from post/. Each draw selects a kind of fault, a line of the
folder to which it can be applied, and a place in the line. The kinds are a wrong sign; another
comparison, or another of `.and.`, `.not.` and `min`; a missing line that changes the state; and a
number or index that is off by one. Of twenty draws for each folder, the first on different subjects
were used.

Faults were discarded if they change no result or only the computing time, if every run of the
program would reveal them, if their effect depends on the compiler (access beyond an array), or if
they are in code that was to be removed.
"""

import argparse
import re
import sys
from pathlib import Path
from typing import NamedTuple

from mutant_bench import ROOT, Bench, git

SCRATCH = ROOT / "build" / "mutants"
MUTANT = re.compile(r"^([\w-]+): .*\n--- (.*)\n((?:.*\n)+?)(?=\n[\w-]+: |\Z)", re.MULTILINE)


class Mutant(NamedTuple):
    """Text in a file, and its replacement."""

    file: str
    old: str
    new: str


def mutants() -> dict[str, Mutant]:
    """Return the mutants of mutants.diff by name."""
    found = {}
    for name, file, change in MUTANT.findall((ROOT / "tests" / "mutants.diff").read_text()):
        lines = change.splitlines()
        sides = ("".join(f"{line[1:]}\n" for line in lines if line[:1] != mark) for mark in "+-")
        found[name] = Mutant(file, *sides)
    return found


def applies(mutant: Mutant, tree: Path) -> bool:
    """Return whether the text that a mutant replaces occurs exactly once."""
    path = tree / mutant.file
    return path.exists() and path.read_text().count(mutant.old) == 1


def outcome(bench: Bench, mutant: Mutant) -> str:
    """Return the outcome of the tests of `make test` for a mutant."""
    if not applies(mutant, bench.tree):
        return "does not apply"
    text = (bench.tree / mutant.file).read_text()
    with bench.changed(mutant.file, text.replace(mutant.old, mutant.new)):
        if bench.build():  # for a Python file without the previous fault
            return "does not compile"
        found = bench.first(mutant.file) or bench.rest(mutant.file)
    return f"caught: {', '.join(found[:3])}" if found else "survived"


def main() -> int:
    """Print the outcome of each mutant; return 1 unless a test detects each of them."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="of the mutants [all]")
    parser.add_argument("--jobs", type=int, default=2, help="at a time [%(default)s]")
    parser.add_argument("--commit", default="HEAD", help="what is tested [%(default)s]")
    parser.add_argument("--check", action="store_true", help="only whether all texts are found")
    args = parser.parse_args()
    table = mutants()
    if unknown := set(args.names) - set(table):
        parser.error(f"not in the table: {', '.join(unknown)}")
    if args.check:
        lost = [name for name, mutant in table.items() if not applies(mutant, ROOT)]
        print("".join(f"{name}: its text is not found once\n" for name in lost), end="")
        return 1 if lost else 0
    commit = git("rev-parse", "--short=12", args.commit)
    bench, results = Bench(SCRATCH, commit, args.jobs), SCRATCH / "results"
    results.touch()
    known = dict(line.split("\t") for line in results.read_text().splitlines())
    survived = 0
    for name in args.names or table:
        key = f"{commit} {name}"
        if key not in known:
            known[key] = outcome(bench, table[name])
            with results.open("a") as file:
                file.write(f"{key}\t{known[key]}\n")
        print(f"{name}: {known[key]}", flush=True)
        survived += not known[key].startswith("caught")
    return 1 if survived else 0


if __name__ == "__main__":
    sys.exit(main())
