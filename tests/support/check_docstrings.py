"""Check the docstrings of public Python functions against the numpydoc standard.

    python tests/support/check_docstrings.py

The names in `__all__` of the package and of the modules in `MODULES` are checked; each problem is
printed on one line.
"""

import sys
from functools import cached_property
from importlib import import_module
from types import FunctionType

MODULES = (
    "bridges",
    "contacts",
    "estimates",
    "statistics",
    "structure",
    "correlations",
    "hard_disks",
    "mixtures",
    "theory",
    "crater",
    "speeds",
    "equilibrium",
    "thermodynamics",
    "cooling",
    "transport",
    "fields",
    "streams",
)
#: Rules of numpydoc that are not applied in this project, with reasons.
IGNORED = {
    "GL01": "the summary stands on the line of the quotes, as everywhere in the project",
    "ES01": "a summary that says all needs no more text",
    "SA01": "the pages of the project say which functions belong together",
    "PR06": "types are those of the annotations",
    "PR08": "descriptions of parameters are phrases that may begin with a symbol",
    "PR09": "and that end without a stop, as comments on attributes do",
    "RT02": "a tuple has names, as numpydoc itself recommends for several results",
    "RT04": "likewise for results",
    "RT05": "likewise",
    "YD01": "generators have Yields only where a caller uses them",
}
#: Classes whose public methods and properties are also checked.
CLASSES = ("Run", "Simulation")
METHODS = (FunctionType, classmethod, staticmethod)
#: Rules that are not applied to named tuples, which need no examples because functions return them.
OF_CLASSES = {"EX01", "PR01", "PR02"}


def problems() -> list[str]:
    """Return all problems as `module.name: CODE text`."""
    from numpydoc.validate import validate  # missing where only some tests are run

    found = []
    for module in ("ricochet", *(f"ricochet.{name}" for name in MODULES)):
        loaded = import_module(module)
        for name in loaded.__all__:
            own = getattr(loaded, name)
            ignored = IGNORED.keys() | (OF_CLASSES if isinstance(own, type) else set())
            for code, text in validate(f"{loaded.__name__}.{name}")["errors"]:
                if code not in ignored:
                    found.append(f"{module}.{name}: {code} {text}")
    return found + [problem for name in CLASSES for problem in of_methods(name)]


def of_methods(name: str) -> list[str]:
    """Return all problems in the methods and properties of a class of the package."""
    from numpydoc.validate import validate

    found = []
    for member, value in members_of(getattr(import_module("ricochet"), name)).items():
        is_property = isinstance(value, property | cached_property)
        if member.startswith("_") or not (is_property or isinstance(value, METHODS)):
            continue
        ignored = IGNORED.keys() | ({"EX01"} if is_property else set())
        for code, text in validate(f"ricochet.{name}.{member}")["errors"]:
            if code not in ignored:
                found.append(f"ricochet.{name}.{member}: {code} {text}")
    return found


def members_of(kind: type) -> dict[str, object]:
    """Return the attributes of a class of the package, including those of its base classes."""
    own = [base for base in reversed(kind.__mro__) if base.__module__.startswith("ricochet")]
    return {name: value for base in own for name, value in vars(base).items()}


if __name__ == "__main__":
    told = problems()
    print(*told, sep="\n", end="\n" * bool(told))
    sys.exit(bool(told))
