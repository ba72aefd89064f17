"""The tests that protect each source, from the tables in the pages of the folders of src/."""

import re
from collections.abc import Iterator
from pathlib import Path

#: Row of a table: module, unit tests, tests of whole runs.
ROW = re.compile(r"^\| `(\w+)` \|([^|\n]*)\|([^|\n]*)\|$", re.MULTILINE)
USE = re.compile(r"^ *use +(\w+)|^submodule *\((\w+)\)", re.MULTILINE)


def protecting_tests(root: Path) -> dict[str, list[str]]:
    """Return for each source in a table the names of the files that test it."""
    return {
        str((page.parent / f"{module}.f90").relative_to(root)): re.findall(r"\w+\.p[fy]", cells)
        for page in sorted((root / "src").rglob("README.md"))
        for module, *names in ROW.findall(page.read_text())
        for cells in ["".join(names)]
    }


def reached(module: str, uses: dict[str, set[str]]) -> set[str]:
    """Return a module and all modules that it uses, directly or indirectly."""
    found: set[str] = set()
    new = {module}
    while new:
        found |= new
        new = set().union(*(uses.get(name, set()) for name in new)) - found
    return found


def protection_problems(root: Path) -> Iterator[str]:
    """Yield sources without tests, and rows whose source or tests do not exist or do not fit.

    A unit test fits if it is named like the module, or uses it directly or indirectly.
    """
    known = protecting_tests(root)
    tests = {path.name: path for path in (root / "tests").rglob("test_*.p[fy]")}
    sources = [*(root / "src").rglob("*.f90")]
    units = [path for path in tests.values() if path.suffix == ".pf"]
    uses = {
        path.stem: {one or other for one, other in USE.findall(path.read_text().lower())}
        for path in [*sources, *units, *(root / "tests").rglob("*.f90")]
    }
    for source in sorted(str(path.relative_to(root)) for path in sources):
        module = Path(source).stem
        for name in known.pop(source, []) or [""]:
            if name not in tests:
                yield f"{source}: {f'there is no {name}' if name else 'its page names no tests'}"
            elif name in (f"test_{module}.pf", f"test_{module}.py") or name.endswith(".py"):
                continue
            elif module not in reached(tests[name].stem, uses):
                yield f"{source}: {name} does not use it"
    yield from (f"{source}: there is no such file" for source in known)
    named = {name for names in protecting_tests(root).values() for name in names}
    for path in sorted(units):
        if path.parent.name == "unit" and path.name not in named:
            yield f"{path.name}: no page names it"
