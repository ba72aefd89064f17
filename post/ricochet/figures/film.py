"""Films of runs in notebooks, each an interactive HTML page."""

import html
from pathlib import Path

import numpy as np

from ..reading.reader import Run
from .drawing import chosen_colour
from .film_data import ROOM, film, frames_that_fit, texts
from .web_page import page


def whole(run: Run, colour: str | None = None) -> str:
    """Return the page with a film of the whole run, with as many frames as fit into it."""
    count = min(run.n_frames, frames_that_fit(run, ROOM))
    frames = np.linspace(0, run.n_frames - 1, count).round().astype(int).tolist()
    return page(run, texts(*film(run, frames, chosen_colour(run, colour), [], ROOM)))


class Film:
    """Film of a run, displayed by a notebook or written to a file by `save`."""

    def __init__(self, run: Run, colour: str | None = None, height: int = 700):
        """Make a film in which colours represent the quantity `colour`, `height` pixels high."""
        self.page, self.height = whole(run, colour), height

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe title="a film" style="{style}" srcdoc="{html.escape(self.page)}"></iframe>'

    def save(self, path: str | Path) -> None:
        """Write the film to an HTML file for any browser."""
        Path(path).write_text(self.page, encoding="utf-8")
