"""Films of runs in notebooks; a film is an interactive HTML page, which `player.py` generates."""

import html
import sys
from pathlib import Path

from ..commands import SCRIPTS
from ..reading.reader import Run


class Film:
    """Film of a run, which a notebook displays, and which `save` writes to a file."""

    def __init__(self, run: Run, colour: str | None = None, height: int = 700):
        """Make a film with a height in pixels, whose colours show the quantity `colour`."""
        if str(SCRIPTS) not in sys.path:
            sys.path.append(str(SCRIPTS))
        import player

        self.page, self.height = player.whole(run, colour), height

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe title="a film" style="{style}" srcdoc="{html.escape(self.page)}"></iframe>'

    def save(self, path: str | Path) -> None:
        """Write the film to an HTML file, which any browser displays."""
        Path(path).write_text(self.page, encoding="utf-8")
