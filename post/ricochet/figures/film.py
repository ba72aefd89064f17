"""Films of runs in notebooks; a film is an interactive HTML page."""

import html
from pathlib import Path

import numpy as np

from ..reading.reader import Run
from .drawing import chosen_colour
from .film_data import ROOM, film, frames_that_fit, texts
from .web_page import page


def whole(run: Run, colour: str | None = None) -> str:
    """Return the page with a film of the whole run, of as many frames as fit into it."""
    count = min(run.n_frames, frames_that_fit(run, ROOM))
    frames = np.linspace(0, run.n_frames - 1, count).round().astype(int).tolist()
    return page(run, texts(*film(run, frames, chosen_colour(run, colour), [], ROOM)))


class Film:
    """Film of a run, which a notebook displays, and which `save` writes to a file."""

    def __init__(self, run: Run, colour: str | None = None, height: int = 700):
        """Make a film with a height in pixels, whose colours show the quantity `colour`."""
        self.page, self.height = whole(run, colour), height

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe title="a film" style="{style}" srcdoc="{html.escape(self.page)}"></iframe>'

    def save(self, path: str | Path) -> None:
        """Write the film to an HTML file, which any browser displays."""
        Path(path).write_text(self.page, encoding="utf-8")
