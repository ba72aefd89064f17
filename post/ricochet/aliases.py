"""Short names of the modules: `ricochet.structure` is `ricochet.analysis.structure`.

Users and their scripts need not know the sub-package of a module.  A short name is the same module
object, not a copy, so classes and states exist once.
"""

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

from .commands import HERE

FOLDERS = ("reading", "running", "predictions", "analysis", "figures", "pages")


def modules() -> dict[str, str]:
    """The full name of each module of the sub-packages, by its short name."""
    paths = (path for folder in FOLDERS for path in sorted((HERE / folder).glob("[!_]*.py")))
    return {path.stem: f"{__package__}.{path.parent.name}.{path.stem}" for path in paths}


class Aliases(MetaPathFinder, Loader):
    """Finds `ricochet.structure` for an `import`; Python asks it after all other finders."""

    def __init__(self) -> None:
        """Remember the modules; there is one finder for the life of the process."""
        self.modules = modules()

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The specification of a short name of this package, else None."""
        package, _, short = name.rpartition(".")
        if package != __package__ or short not in self.modules:
            return None
        return ModuleSpec(name, self, origin=self.modules[short])

    def exec_module(self, module: ModuleType) -> None:
        """Put the module itself where `import` looks for the result."""
        sys.modules[module.__name__] = import_module(self.modules[module.__name__.split(".")[-1]])
