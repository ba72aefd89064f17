"""Short module names, such as `ricochet.structure` for `ricochet.analysis.structure`.

Both names refer to the same module object, so that each of its classes exists only once.
"""

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

from .commands import HERE

FOLDERS = (
    "reading",
    "exchange",
    "running",
    "predictions",
    "analysis",
    "figures",
    "reports",
    "pages",
)


def modules() -> dict[str, str]:
    """Return a dictionary from the short name of each module to its full name."""
    paths = (path for folder in FOLDERS for path in sorted((HERE / folder).glob("[!_]*.py")))
    return {path.stem: f"{__package__}.{path.parent.name}.{path.stem}" for path in paths}


class Aliases(MetaPathFinder, Loader):
    """Import finder for short module names, called after all other finders."""

    def __init__(self) -> None:
        """Collect the short and full names of all modules."""
        self.modules = modules()

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the import specification of a short module name, or None for any other name."""
        package, _, short = name.rpartition(".")
        if package != __package__ or short not in self.modules:
            return None
        return ModuleSpec(name, self, origin=self.modules[short])

    def exec_module(self, module: ModuleType) -> None:
        """Register the module under its short name in `sys.modules`."""
        sys.modules[module.__name__] = import_module(self.modules[module.__name__.split(".")[-1]])
