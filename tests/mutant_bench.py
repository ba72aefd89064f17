"""Test mutants, copies of the project with one fault in a source.

Used by `mutants.py` and `random_mutants.py`. Tests run up to the first failure, beginning with
those that the page of the folder names for the changed source, because they detect most faults. All
programs and libraries have run-time checks (the build of the unit tests), because this build takes
only seconds after a change. A test of pytest detects a fault only if it fails twice, and passes
without the fault.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "support"))
from protecting_tests import protecting_tests

ROOT = Path(__file__).resolve().parents[1]
#: Variables of `make checked`; any others would cause a complete rebuild.
UNIT_BUILD = re.findall(r"^unit_build := (.*)", (ROOT / "Makefile").read_text(), re.MULTILINE)[0]
UNIT_BUILD = UNIT_BUILD.replace("$(BUILD)", "build")
#: Limits of a command [s of wall time] and of each process [s of processor time].
PYTEST = "timeout 3600 prlimit --cpu=400 .venv/bin/python -m pytest -q -p no:randomly"
UNITS = "OMP_WAIT_POLICY=passive prlimit --cpu=300 --as=8000000000 $RICOCHET_LIBRARY/unit_tests"
IMPORTS = re.compile(r"^from ricochet[\w.]* import (?:\([^)]*\)|.*)", re.MULTILINE)
FAILURE = re.compile(r"^(?:Failure in: |FAILED |ERROR |unit tests: )(.*?)(?: - .*)?$", re.MULTILINE)
#: Tests with the mark `statistics` that run the program, and those that run the package.
LOST_OF_PROGRAM = "-m statistics tests/validation tests/runs tests/post/test_lab_runs.py"
LOST_OF_PACKAGE = "-m statistics tests/post tests/runs/test_pages.py tests/runs/test_docs.py"


def git(*arguments: str, folder: Path = ROOT) -> str:
    return subprocess.check_output(["git", *arguments], cwd=folder, text=True).strip()


class Bench:
    """Copy of the project at a commit, in which mutants are built and tested.

    Methods that run tests return the names of failed tests; the list is empty if all tests pass.
    """

    def __init__(self, folder: Path, commit: str, jobs: int):
        """Make the copy, and build it without a fault."""
        self.tree, self.log, self.jobs = folder / "tree", folder / "log", jobs
        folder.mkdir(parents=True, exist_ok=True)
        if not self.tree.exists():
            git("clone", "--quiet", "--shared", "--no-checkout", str(ROOT), str(self.tree))
        git("checkout", "--quiet", "--force", "--detach", commit, folder=self.tree)
        for name in (".venv", "build/tests"):
            if (ROOT / name).exists() and not (self.tree / name).exists():
                shutil.copytree(ROOT / name, self.tree / name, symlinks=True)
        subprocess.run([".ci/set-up", "demo", "test"], cwd=self.tree, check=True)
        if said := self.build():
            raise SystemExit(f"The build fails without a fault: {said}")
        sound = self.tree / "build" / "sound"
        sound.mkdir(exist_ok=True)
        for path in (self.tree / "build" / "tests").iterdir():
            if path.name in ("ricochet", "unit_tests") or path.suffix in (".so", ".h"):
                shutil.copy2(path, sound)

    @contextmanager
    def changed(self, file: str, text: str) -> Iterator[None]:
        """Temporarily replace the text of a file."""
        path = self.tree / file
        before = path.read_text()
        path.write_text(text)
        self.fault = path, before, text
        try:
            yield
        finally:
            path.write_text(before)

    def run(self, command: str, build: str = "tests", **variables: str) -> list[str]:
        """Run a command; if it fails, return the names of tests or the last words of its output."""
        folder = f"{self.tree}/build/{build}"
        own = {"RICOCHET": f"{folder}/ricochet", "RICOCHET_LIBRARY": folder} | variables
        with self.log.open("w") as output:
            streams = {"stdout": output, "stderr": output, "env": os.environ | own}
            failed = subprocess.call(command, shell=True, cwd=self.tree, **streams)
        said = self.log.read_text(errors="replace")
        return (FAILURE.findall(said) or [" ".join(said.split()[-30:])]) if failed else []

    def fails_without_fault(self, command: str) -> bool:
        path, before, text = self.fault
        path.write_text(before)
        found = self.run(command, "sound")
        path.write_text(text)
        return bool(found)

    def build(self) -> list[str]:
        make = f"make -j{self.jobs} {UNIT_BUILD}"
        return self.run(f"{make} build/tests/unit_tests build/tests/ricochet && {make} library")

    def units(self, files: Sequence[str] = (), thorough: str = "") -> list[str]:
        """Run unit tests of some suites, or of all; `thorough` selects all random cases."""
        runs = [f"{UNITS} -f {Path(file).stem}." for file in files] or [UNITS]
        return self.run(" && ".join(runs), THOROUGH=thorough)

    def pytest(self, words: str) -> list[str]:
        """Run tests until one detects the fault."""
        flags, passed = f"-x -n {self.jobs} --dist worksteal", []
        while found := self.run(" ".join([PYTEST, flags, words, *passed])):
            names = [shlex.quote(name) for name in found if "::" in name]
            if not names:
                return found
            for name in names:
                again = f"{PYTEST} -m '' {name}"
                if self.run(again) and not self.fails_without_fault(again):
                    return [name]
            passed += [f"--deselect {name}" for name in names]
        return []

    def first(self, file: str) -> list[str]:
        """Run those of the kept tests that most likely detect a fault in a file."""
        names = protecting_tests(self.tree).get(file, [])
        units = [name for name in names if name.endswith(".pf")]
        runs = [f"tests/*/{name}" for name in names if name.endswith(".py")]
        if file.endswith(".py"):
            runs = list(self.users(file))
        return (self.units(units) if units else []) or (self.pytest(" ".join(runs)) if runs else [])

    def users(self, file: str) -> Iterator[str]:
        """Yield the tests that are named like a module, import it or a part of it, or run a script.

        The examples in docstrings are tests of all modules.
        """
        parts = re.findall(r"^(?:class|def) ([a-zA-Z]\w*)", (self.tree / file).read_text(), re.M)
        word = re.compile(rf"\b({'|'.join([Path(file).stem, *parts])})\b")
        for path in sorted((self.tree / "tests").glob("*/test_*.py")):
            text, name = path.read_text(), path.stem.removeprefix("test_")
            runs = name == "docstrings" or f'run_script("{Path(file).stem}"' in text
            if runs or word.search("\n".join([name, *IMPORTS.findall(text)])):
                yield str(path.relative_to(self.tree))

    def rest(self, file: str) -> list[str]:
        """Run all tests of `make test`."""
        return (self.units() if file.endswith(".f90") else []) or self.pytest("tests")

    def lost(self, file: str) -> list[str]:
        """Run the tests that `make test` leaves out."""
        if file.endswith(".py"):
            return self.pytest(LOST_OF_PACKAGE)
        return self.units(thorough="1") or self.pytest(LOST_OF_PROGRAM)
