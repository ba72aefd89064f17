"""Figures of named panels, drawn for a given width on paper or for a slide."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.text import Annotation, Text
from matplotlib.ticker import LogFormatterMathtext, LogFormatterSciNotation

from ..reading.files import RunError, did_you_mean
from .drawing import STYLE

CM = 1 / 2.54  # [inches]
WIDTH = 16.0  # width of the text of an A4 page [cm]
HIGHEST = 22.0  # highest figure that leaves space for a caption on an A4 page [cm]
LONGEST = 25.0  # highest figure of stacked panels [cm]
LEAST_HEIGHT = 3.5  # least height of a row of panels with its labels [cm]
STACKED = 12.0  # width below which panels are stacked [cm]
SLIDE = 4 / 3  # size of text on a slide, relative to paper
SLIDE_SHAPE = 9 / 16  # height / width of a slide
SMALLEST = 8.0  # size of the smallest text [points]
SCRIPT = 0.7  # size of subscripts and superscripts, relative to their text
SCRIPTS = re.compile(r"\$[^$]*(?:[_^]|\\frac)[^$]*\$")  # formula with a subscript or superscript
PAD = 6.0  # distance between a title and its panel [points]
LINE = 1.35  # distance between lines of text, relative to the size of the text
KEY = 1.8  # height of a common legend [lines]
LETTER = 0.52  # mean width of a letter, relative to the size of the text
HANDLE = 5  # width of the line or symbol in a legend [letters]
TOO_LONG = "The figure is higher than a page: --panel NAME draws one panel alone."
NAME_OFFSET = 8.0  # distance between the end of a curve and its name [points]
CURVE_NAME = "name of a curve"  # mark of such texts
LETTERS = 6.4  # mean number of letters of the smallest text [1/cm]


@dataclass(frozen=True)
class Panel:
    """Panel of a figure, drawn by `draw(axes, *arguments)`.

    `aspect` is height / width, `weight` the relative width within a row; `share_x` and `share_y`
    name panels of the figure with which the panel shares an axis.
    """

    name: str
    draw: Callable[..., None]
    arguments: tuple[Any, ...] = ()
    aspect: float = 0.75
    weight: float = 1.0
    share_x: str = ""
    share_y: str = ""


@dataclass
class Sheet:
    """Rows of panels, a title above them, and a function that adds a common legend."""

    rows: list[list[Panel]]
    title: str = ""
    legend: Callable[[Figure], None] | None = None
    notes: list[str] = field(default_factory=list)  # explanations below the figure

    def only(self, name: str) -> "Sheet":
        """Return a figure that consists of one panel."""
        panels = {panel.name: panel for row in self.rows for panel in row}
        if name not in panels:
            hint = did_you_mean(name, panels) or f"; there are {', '.join(panels)}"
            raise RunError(f"the figure has no panel {name}{hint}")
        return Sheet([[panels[name]]], self.title, self.legend, self.notes)

    def figure(
        self,
        panel: str | None = None,
        width: float | str | None = None,
        warnings: Sequence[str] = (),
    ) -> Figure:
        """Draw the figure, or one panel of it, for a given width (see `width_of`)."""
        size, slide = width_of(width)
        sheet = self.only(panel) if panel else self
        rows = sheet.rows
        if size < STACKED:
            rows = [[one] for row in rows for one in row]
        with plt.style.context([STYLE, sizes_of_text(SLIDE if slide else 1.0)]):
            return sheet.drawn(rows, size, SLIDE_SHAPE if slide and panel else None, warnings)

    def drawn(
        self, rows: list[list[Panel]], width: float, shape: float | None, warnings: Sequence[str]
    ) -> Figure:
        """Draw the title, the rows of panels, and the notes and warnings below the panels."""
        letters = int(width * LETTERS * SMALLEST / plt.rcParams["legend.fontsize"])
        title = [line for part in self.title.split("\n") for line in wrap(part, letters - 4)]
        below = [(line, "0.25") for note in self.notes for line in wrap(note, letters)]
        below += [(line, "firebrick") for line in warning_lines(warnings, letters)]
        small = plt.rcParams["legend.fontsize"]
        line = small / 72 * LINE  # [inches]
        figure = plt.figure(figsize=(width * CM, width * CM))
        foot = line * (len(below) + 0.5 * bool(below))
        highest = CM * (LONGEST if width < STACKED else HIGHEST * max(1.0, width / WIDTH))
        key = line * KEY * bool(self.legend)
        heights = self.draw_panels(figure, rows, highest - line * len(title) - foot - key)
        if self.legend:
            self.legend(figure)
        key *= bool(figure.legends)
        foot += key
        whole = sum(heights) + line * len(title) + foot
        if whole > highest + 1e-6 and shape is None and sum(map(len, rows)) > 1:
            longer = wrap(TOO_LONG, letters)
            below += [(text, "0.25") for text in longer]
            foot += line * len(longer)
            whole += line * len(longer)
        whole = whole if shape is None else max(width * CM * shape, foot + line * 12)
        figure.set_size_inches(width * CM, whole)
        above = (0, foot / whole, 1, 1 - foot / whole)  # above the notes
        layout = ConstrainedLayoutEngine(rect=above)
        figure.set_layout_engine(layout)
        for axes in figure.axes:
            enlarge_scripts(axes)
            wrap_labels(figure, axes)
        if title:
            figure.suptitle("\n".join(title), fontsize=small)
        for legend in figure.legends:
            place = (0, (foot - key) / whole, 1, key / whole)  # between panels and notes
            legend.set_bbox_to_anchor(place, figure.transFigure)
        for k, (text, colour) in enumerate(reversed(below)):
            figure.text(0.01, (k + 0.4) * line / whole, text, color=colour, fontsize=small)
        named = any(text.get_gid() == CURVE_NAME for axes in figure.axes for text in axes.texts)
        if named or any(axes.get_aspect() != "auto" for axes in figure.axes):
            # The shape of a panel with equal scales is known only after a layout. Drawing the
            # figure performs a second layout, without which titles would overlap.
            layout.execute(figure)
            for axes in figure.axes:
                separate_names(axes)
        return figure

    def draw_panels(self, figure: Figure, rows: list[list[Panel]], room: float) -> list[float]:
        """Draw rows of panels, and return their heights [inches] without legends.

        If not all rows fit into `room`, the highest rows are reduced below the height of their
        panels.
        """
        alone = all(len(row) == 1 for row in rows)  # one grid aligns the axes of all rows
        parts = figure.add_gridspec(len(rows), 1)
        drawn: dict[str, Axes] = {}
        for k, row in enumerate(rows):
            weights = [one.weight for one in row]
            cells = [parts[k]] if alone else parts[k].subgridspec(1, len(row), width_ratios=weights)
            for j, one in enumerate(row):
                shared = {"sharex": drawn.get(one.share_x), "sharey": drawn.get(one.share_y)}
                drawn[one.name] = figure.add_subplot(cells[j], **shared)
        legends = []
        for row in rows:
            for one in row:
                one.draw(drawn[one.name], *one.arguments)
            legends.append(max(height_of_legend(drawn[one.name]) for one in row))
        panels = [height_of(row, figure.get_figwidth()) for row in rows]
        top = largest_height(panels, room - sum(legends))
        heights = [min(panel, top) + own for panel, own in zip(panels, legends, strict=True)]
        parts.set_height_ratios(heights)
        return heights


def columns_that_fit(widths: Sequence[float], room: float) -> int:
    """Return the number of columns of a legend that fit into `room`, all in letters."""
    counts = range(1, len(widths) + 1)
    parts = {count: np.array_split(np.array(widths) + HANDLE, count) for count in counts}
    wide = {count: sum(part.max() for part in own) for count, own in parts.items()}
    return max((count for count in counts if wide[count] <= room), default=1)


def legend_above(axes: Axes, **style: Any) -> None:
    """Add a legend between a panel and its title, where it hides no data."""
    handles, labels = axes.get_legend_handles_labels()
    figure = axes.get_figure(root=True)
    size = float(plt.rcParams["legend.fontsize"])
    inches = axes.get_position().width * (figure.get_figwidth() if figure else 1.0)
    letters = inches * 72 / (LETTER * size)
    scale = [size_of(label, size) / size for label in labels]
    labels = [
        "\n".join(wrap(label, (letters - HANDLE) / large))
        for label, large in zip(labels, scale, strict=True)
    ]
    lines = [label.split("\n") for label in labels]
    widths = [
        large * max(map(letters_of, own)) for own, large in zip(lines, scale, strict=True) if own
    ]
    columns = columns_that_fit(widths, letters)
    place: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0, 1), "borderaxespad": 0.3}
    close = {"labelspacing": 0.25, "borderpad": 0.2, "handlelength": 1.6, "columnspacing": 1.2}
    legend = axes.legend(handles, labels, ncols=columns, **place | close | style)
    for text, large in zip(legend.get_texts(), scale, strict=True):
        text.set_fontsize(large * size)
    heights = [large * len(own) for own, large in zip(lines, scale, strict=True)]
    columns_of_lines = np.array_split(heights, columns)
    height = max(sum(column) for column in columns_of_lines) + ("title" in style)
    for where in ("left", "center"):
        axes.set_title(axes.get_title(loc=where), loc=where, pad=PAD + size * LINE * height)


class PlainLogFormatter(LogFormatterSciNotation):
    """Labels of a logarithmic axis without superscripts, such as 0.01 or 1e-6."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Return the label of a tick, which is empty where the axis needs no label."""
        if not super().__call__(x, pos):
            return ""
        return f"{x:g}".replace("e-0", "e-").replace("e+0", "e").replace("e+", "e")


def size_of(text: str, size: float) -> float:
    """Return the size of a text whose subscripts and superscripts are not below `SMALLEST`.

    Scripts of scripts are smaller. The ratio of the sizes is a private constant of matplotlib, so
    that only the size of the whole text can be changed.
    """
    return max(size, SMALLEST / SCRIPT) if SCRIPTS.search(text) else size


def enlarge_scripts(axes: Axes) -> None:
    """Make subscripts and superscripts legible in all texts of a panel except its legend."""
    for axis in (axes.xaxis, axes.yaxis):
        if isinstance(axis.get_major_formatter(), LogFormatterMathtext):
            axis.set_major_formatter(PlainLogFormatter())
        if isinstance(axis.get_minor_formatter(), LogFormatterMathtext):
            axis.set_minor_formatter(PlainLogFormatter(labelOnlyBase=False))
    titles = [child for child in axes.get_children() if isinstance(child, Text)]
    for text in (axes.xaxis.get_label(), axes.yaxis.get_label(), *titles):
        text.set_fontsize(size_of(text.get_text(), float(text.get_fontsize())))


def height_of_legend(axes: Axes) -> float:
    """Return the height of a legend between a panel and its title [inches]."""
    offset = axes.titleOffsetTrans.get_matrix()[1, 2]  # type: ignore[attr-defined]
    figure = axes.get_figure(root=True)
    return max(0.0, float(offset) / (figure.dpi if figure else 72) - PAD / 72)


def name_curve(axes: Axes, x: float, y: float, name: str, colour: str) -> None:
    """Write the name of a curve beside its end (x, y)."""
    axes.annotate(
        name,
        (x, y),
        xytext=(NAME_OFFSET, 0),
        textcoords="offset points",
        va="center",
        color=colour,
        fontsize=plt.rcParams["legend.fontsize"],
        gid=CURVE_NAME,
        arrowprops={"arrowstyle": "-", "color": colour, "lw": 0.6, "shrinkA": 1, "shrinkB": 0},
        annotation_clip=False,
    )


def separate_names(axes: Axes) -> None:
    """Shift names of curves up or down so that they do not overlap."""
    texts = [text for text in axes.texts if text.get_gid() == CURVE_NAME]
    names = [text for text in texts if isinstance(text, Annotation)]
    figure = axes.get_figure(root=True)
    if not names or figure is None:
        return
    points = 72 / figure.dpi
    height = np.array([axes.transData.transform(name.xy)[1] for name in names]) * points
    order = np.argsort(height, kind="stable")
    steps = LINE * float(names[0].get_fontsize()) * np.arange(len(names))
    above = height[order] - steps
    # The mean of these two bounds is the increasing sequence with the smallest largest shift.
    low, high = np.maximum.accumulate(above), np.minimum.accumulate(above[::-1])[::-1]
    for k, place in zip(order, (low + high) / 2 + steps, strict=True):
        names[k].xyann = (NAME_OFFSET, place - height[k])


def wrap(text: str, letters: float) -> list[str]:
    """Split a text into lines of about the given number of letters.

    Formulas, texts in parentheses and expressions such as x = 1 ± 2 are not split.
    """
    lines: list[str] = []
    for word in re.findall(r"\([^()]*\)\S*|(?:\$[^$]*\$|[^\s$]| [=±] )+", text):
        if lines and letters_of(f"{lines[-1]} {word}") <= letters:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines


def letters_of(text: str) -> float:
    """Return the approximate width of a text, which may contain formulas, in letters."""
    return len(re.sub(r"[${}_^]", "", re.sub(r"\\(?:[a-zA-Z]+|,)", "x", text)))


def wrap_labels(figure: Figure, axes: Axes) -> None:
    """Wrap axis labels that are longer than their axis."""
    size = figure.get_size_inches() * axes.get_position().size * 72  # [points]
    for axis, length in zip((axes.xaxis, axes.yaxis), size, strict=True):
        label = axis.get_label()
        letters = length / (LETTER * float(label.get_fontsize()))
        label.set_text("\n".join(wrap(label.get_text(), max(10, letters))))


def height_of(row: Sequence[Panel], width: float) -> float:
    """Return the height of a row of panels of given total width."""
    whole = sum(panel.weight for panel in row)
    return max(panel.aspect * width * panel.weight / whole for panel in row)


def largest_height(heights: Sequence[float], room: float) -> float:
    """Return the limit to the heights of rows with which all rows fit into `room` [inches]."""
    for k, height in enumerate(order := sorted(heights)):
        equal = (room - sum(order[:k])) / (len(order) - k)
        if height >= equal:
            return max(equal, LEAST_HEIGHT * CM)
    return max(heights)


def width_of(text: float | str | None) -> tuple[float, bool]:
    """Convert a width, such as 8.5, '8.5cm' or 'slide', to cm, and return whether it is a slide."""
    if text is None or text == "slide":
        return WIDTH, text == "slide"
    try:
        width = float(str(text).removesuffix("cm"))
    except ValueError:
        width = 0.0
    if not 5 <= width <= 100:
        raise RunError(f"'{text}' is not a width from 5cm to 100cm, or slide")
    return width, False


def title_size() -> float:
    """Return the size of titles [points]."""
    return FontProperties(size=plt.rcParams["axes.titlesize"]).get_size_in_points()


def title_letters(width: float) -> float:
    """Return the number of letters of a title that fit into a width [inches]."""
    return width / CM * LETTERS * SMALLEST / title_size()


def text_style(width: float | str | None) -> dict[str, Any]:
    """Return the sizes of text in a figure of the given width; without a width, keep the style."""
    return {} if width is None else sizes_of_text(SLIDE if width_of(width)[1] else 1.0)


def sizes_of_text(scale: float) -> dict[str, Any]:
    """Return the sizes of text in a figure: 9 points on paper, 8 points for legends and ticks."""
    names = "font.size", "axes.labelsize", "axes.titlesize", "figure.titlesize"
    small = "legend.fontsize", "legend.title_fontsize", "xtick.labelsize", "ytick.labelsize"
    return dict.fromkeys(names, 9 * scale) | dict.fromkeys(small, SMALLEST * scale)


def warning_lines(warnings: Sequence[str], letters: int) -> list[str]:
    """Return the lines of at most three warnings, with the number of the others."""
    lines = [line for text in warnings[:3] for line in wrap(f"Warning: {text}", letters)]
    rest = len(warnings) - 3
    return lines + [f"and {rest} more warning{'s' * (rest > 1)}, as printed"] * (rest > 0)


def smallest_text(figure: Figure) -> float:
    """Return the size of the smallest visible text of a figure [points].

    Subscripts, superscripts and fractions of formulas are included, but not their own scripts.
    """
    figure.draw_without_rendering()
    texts = [one for one in figure.findobj() if isinstance(one, Text) and one.get_visible()]
    return min(
        float(text.get_fontsize()) * (SCRIPT if SCRIPTS.search(text.get_text()) else 1.0)
        for text in texts
        if text.get_text()
    )
