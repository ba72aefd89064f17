"""What pip asks when it builds the package: which scripts there are, and the command of each."""

from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

POST = Path(__file__).parent
SCRIPTS = sorted(set(POST.glob("*.py")) - {Path(__file__)})


class Commands(MetadataHookInterface):
    """Fills `scripts` in pyproject.toml."""

    def update(self, metadata: dict) -> None:
        names = (script.stem.replace("_", "-") for script in SCRIPTS)
        metadata["scripts"] = {f"ricochet-{name}": "ricochet.commands:main" for name in names}


class Scripts(BuildHookInterface):
    """Puts scripts, their page and inputs into the package, to each other as they lie here."""

    def initialize(self, version: str, build_data: dict) -> None:
        if version != "editable":
            for path in (*SCRIPTS, POST / "page", POST.parent / "input"):
                place = path.relative_to(POST.parent)
                build_data["force_include"][str(path)] = f"ricochet/{place}"
