"""Mutation test: introduce faults one at a time and report which test detects each of them.

    python tests/mutants.py [NAME...] [--jobs 2] [--commit HEAD]
    python tests/mutants.py --check

The test works in build/mutants, on a copy of the last commit.  A repeated call continues an
interrupted test, because the file `results` in this folder contains a line for each tested mutant
(source with one fault) of each commit.  First, the copy is tested without a fault.  For each
mutant, the unit tests and all other tests are then executed up to the first failure.  A mutant
takes several minutes on two cores; a mutant that no test detects takes as long as `make test`.  Use
`nice` if other programs run at the same time.  On a busy machine a test can fail because it has
waited too long, which does not count as a detection; the file `NAME.log` shows the reason of the
failure.  With `--check` the script only checks that each text to be replaced occurs exactly once.

The file mutants.diff describes each fault by a sentence and by a change of the present sources.  If
the sources are rewritten, the sentence is kept and the change is expressed in the new sources.
Earlier changes are in the history of mutants.diff, and can be tested in a clone at an old commit.

The 24 faults were drawn from commit 67f9503 by `random.Random(20261124)`: two from each folder of
src/, one from run.f90, and three from post/.  Each draw selects a kind of fault, a line of the
folder to which this kind can be applied, and a place in the line.  The kinds of faults are a wrong
sign; another comparison, or another of `.and.`, `.not.` and `min`; a missing line that changes the
state; and a number or an index that is wrong by one.  From twenty draws for each folder, the first
draws on different subjects were used.  Faults were not used if they change no result, if they only
change the computing time, if every run of the program would reveal them, if their effect depends on
the compiler (access beyond an array), or if they are in code that was to be removed.
"""

import argparse
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
SCRATCH = ROOT / "build" / "mutants"
#: Variables of `make checked`. With any others it would compile everything again.
UNIT_BUILD = re.findall(r"^unit_build := (.*)", (ROOT / "Makefile").read_text(), re.MULTILINE)[0]
UNIT_BUILD = UNIT_BUILD.replace("$(BUILD)", "build")
UNIT_TESTS = ("make -j{jobs} {unit_build}/unit_tests", "make checked")
PROGRAM = "make -j{jobs} {unit_build}/four_disks && make -j{jobs} all && make {library}"
PYTEST = "RICOCHET_LIBRARY=$PWD/build/tests "
PYTEST += ".venv/bin/python -m pytest -q -x -n {jobs} --dist load --maxschedchunk 8 -p no:randomly "
MUTANT = re.compile(r"^([\w-]+): .*\n--- (.*)\n((?:.*\n)+?)(?=\n[\w-]+: |\Z)", re.MULTILINE)
FAILURE = re.compile(r"^(?:Failure in: |FAILED |ERROR |unit tests: )(.*?)(?: - .*)?$", re.MULTILINE)


def git(*arguments: str, folder: Path = ROOT) -> str:
    return subprocess.check_output(["git", *arguments], cwd=folder, text=True).strip()


def check_out(commit: str) -> Path:
    """Make a copy of the project at a commit, with the existing build."""
    tree = SCRATCH / "tree"
    if not tree.exists():
        git("clone", "--quiet", "--shared", "--no-checkout", str(ROOT), str(tree))
    git("checkout", "--quiet", "--force", "--detach", commit, folder=tree)
    git("clean", "--quiet", "--force", "-d", folder=tree)
    if (ROOT / ".venv").exists() and not (tree / ".venv").exists():
        shutil.copytree(ROOT / ".venv", tree / ".venv", symlinks=True)
    subprocess.run([".ci/set-up", "demo", "test"], cwd=tree, check=True)
    return tree


class Mutant(NamedTuple):
    """A text in a file and its replacement."""

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


def outcome(tree: Path, mutant: Mutant | None, jobs: int, log: Path) -> str:
    """Return the outcome of the tests in a tree with one fault or without a fault."""
    steps = [*UNIT_TESTS, PROGRAM, PYTEST + "tests"]
    if mutant:
        if not applies(mutant, tree):
            return "does not apply"
        path = tree / mutant.file
        path.write_text(path.read_text().replace(mutant.old, mutant.new))
        if path.is_relative_to(tree / "post"):
            steps = steps[2:]
    for step in steps:
        variables = {"unit_build": f"{UNIT_BUILD} build/tests", "library": f"{UNIT_BUILD} library"}
        command = step.format(jobs=jobs, **variables)
        with log.open("w") as output:
            failed = subprocess.call(command, shell=True, cwd=tree, stdout=output, stderr=output)
        if failed:
            if step.startswith("make -j"):
                return "does not compile"
            said = log.read_text(errors="replace")
            return "caught: " + (", ".join(FAILURE.findall(said)[:3]) or said.split("\n")[-2])
    return "survived"


def main() -> int:
    """Print the outcome of each mutant; return 1 if a mutant survives."""
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
    SCRATCH.mkdir(parents=True, exist_ok=True)
    commit = git("rev-parse", "--short=12", args.commit)
    results = SCRATCH / "results"
    results.touch()
    known = dict(line.split("\t") for line in results.read_text().splitlines())
    survived = 0
    for name in ["nothing", *(args.names or table)]:
        key, mutant = f"{commit} {name}", table.get(name)
        if key not in known:
            known[key] = outcome(check_out(commit), mutant, args.jobs, SCRATCH / f"{name}.log")
            with results.open("a") as file:
                file.write(f"{key}\t{known[key]}\n")
        print(f"{name}: {known[key]}", flush=True)
        if not mutant and known[key] != "survived":
            print("The tests fail without a fault: first make them pass.", file=sys.stderr)
            return 1
        survived += bool(mutant) and known[key] == "survived"
    return 1 if survived else 0


if __name__ == "__main__":
    sys.exit(main())
