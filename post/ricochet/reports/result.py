"""Result of an analysis: groups of runs, table, figure, notes and warnings."""

import base64
import html
import io
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..reading.files import counted, optional_package
from ..reading.reader import Run
from .groups import Group
from .tables import Table, columns, text_of

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from ..figures.sheet import Sheet


@dataclass(repr=False)
class Result:
    """Result of an analysis.

    Attributes
    ----------
    table
        rows of the table, as dictionaries
    notes
        explanations below the figure, such as the meaning of its error bars
    warnings
        reasons for which a number may be wrong
    groups
        groups of runs that were combined, with their results
    further
        further tables
    printed
        table that the script prints [table]
    data
        table for the option --csv of the script [table]
    values
        results common to all groups
    explained
        whether a warning explains why numbers have no error
    """

    table: list[dict[str, Any]]
    groups: list[Group] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    further: list[Table] = field(default_factory=list)
    printed: Table | None = None
    data: Table | None = None
    values: Any = None
    explained: bool = False
    name: str = ""  # name of the analysis
    options: Any = None
    draw: Callable[["Result"], "Sheet | None"] | None = None

    @property
    def runs(self) -> list[Run]:
        """Runs of all groups."""
        return [run for group in self.groups for run in group.runs]

    @property
    def shown(self) -> Table:
        """Table printed by the script."""
        return self.table if self.printed is None else self.printed

    def figure(self, panel: str | None = None, width: float | str | None = None) -> "Figure | None":
        """Draw the figure, with all text at a size of at least 8 points.

        Parameters
        ----------
        panel
            name of the only panel to draw [all panels]
        width
            width, such as 8.5 or '8.5cm', or 'slide' [16 cm]

        Returns
        -------
        figure : matplotlib.figure.Figure or None
            the figure, or None if the runs have none

        Examples
        --------
        >>> figure = ricochet.analyse("speeds", runs).figure("late", "8.5cm")
        >>> round(2.54 * figure.get_figwidth(), 3)
        8.5
        """
        sheet = self.draw(self) if self.draw else None
        if sheet is None:
            return None
        sheet.notes += self.notes
        return sheet.figure(panel, width, self.warnings)

    def to_dataframe(self) -> "pandas.DataFrame":
        """Return the table as a pandas DataFrame.

        Returns
        -------
        table : pandas.DataFrame
            the rows of `table`

        Raises
        ------
        ImportError
            if pandas is not installed

        Examples
        --------
        >>> result = ricochet.analyse("speeds", runs)
        >>> len(result.to_dataframe()) == len(result.table) if has_pandas else True
        True
        """
        return optional_package("pandas", "a table").DataFrame(self.table)

    def __repr__(self) -> str:
        lines = [
            f"{self.name} of {counted(len(self.runs), 'run')}",
            text_of(self.shown),
        ]
        return "\n".join(lines + [f"warning: {text}" for text in self.warnings])

    def _repr_html_(self) -> str:
        """Return the figure and the table for a notebook."""
        head = "".join(f"<th>{html.escape(name)}</th>" for name in columns(self.table))
        rows = [[cell(value) for value in row.values()] for row in self.table]
        body = "".join(f"<tr>{''.join(f'<td>{one}</td>' for one in row)}</tr>" for row in rows)
        return f"{self.picture()}<table><tr>{head}</tr>{body}</table>"

    def picture(self) -> str:
        """Return the figure as an HTML element."""
        from matplotlib import pyplot

        figure, file = self.figure(), io.BytesIO()
        if figure is None:
            return ""
        figure.savefig(file, format="png")
        pyplot.close(figure)
        return f'<img src="data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}">'


def cell(value: object) -> str:
    """Return a table cell as text."""
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return "-" if value is None else html.escape(text)
