"""Rows and columns of tables, and tables as text."""

import csv
import re
from collections.abc import Iterable, Sequence
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.estimates import Curve, Estimate
from ..analysis.statistics import SeriesMean, combine_runs, diagnostics
from ..reading.files import destination

#: Columns by name, or a list of rows.
Table = dict[str, Any] | list[dict[str, Any]]


def measured(
    name: str, estimate: Estimate | SeriesMean | None, at: int | tuple[int, ...] = ()
) -> dict[str, float | None]:
    """Return two table cells: mean and error of an estimate, or of the point `at` of a curve.

    Both are None if there is no estimate.
    """
    parts = (None, None) if estimate is None else (estimate.mean, estimate.error)
    values = [part if part is None else float(np.asarray(part)[at]) for part in parts]
    return dict(zip((name, f"{name}_error"), values, strict=True))


def over_runs(
    name: str, members: Sequence[SeriesMean], notes: list[str], about: str
) -> dict[str, float | None]:
    """Return the table cells of a mean over runs, and add warnings about it to `notes`."""
    notes += diagnostics(about, members)
    return measured(name, combine_runs(members))


def spread(results: dict[str, dict[str, Any]]) -> dict[str, np.ndarray]:
    """Convert groups of results to columns whose names end with the keys of the groups.

    A number yields one column, an estimate two.
    """
    columns: dict[str, Any] = {}
    for end, found in results.items():
        for name, values in found.items():
            if isinstance(values, Estimate):
                columns |= {name + end: values.mean, f"{name}_error{end}": values.error}
            else:
                columns[name + end] = values
    return columns


def points(names: Sequence[str], curves: dict[tuple[Any, ...], Curve]) -> list[dict[str, Any]]:
    """Return a table row for each point of the curves: key of the curve, x, y and error of y."""
    return [
        dict(zip(names, (*key, *map(float, point)), strict=True))
        for key, curve in curves.items()
        for point in zip(*curve, strict=True)
    ]


def without_error(tables: Sequence[Table]) -> list[str]:
    """Return one warning if some numbers have no error."""
    names = [
        name.removesuffix("_error")
        for table in map(columns, tables)
        for name, errors in table.items()
        if name.endswith("error")
        for values in [table.get(name[: -len("_error")], repeat(None))]
        if any(is_nan(e) and not is_nan(v) for e, v in zip(errors, values, strict=False))
    ]
    reason = "takes several runs, or more samples in equilibrium"
    return [f"no error of {', '.join(names)}: it {reason}"] if names else []


def is_nan(value: object) -> bool:
    """Return whether a value of any type is a floating-point NaN."""
    return isinstance(value, float) and bool(np.isnan(value))


def columns(table: Table) -> dict[str, Iterable[Any]]:
    """Convert a table to a dictionary of columns; all rows must have the same keys."""
    if isinstance(table, dict):
        return table
    return {name: [row[name] for row in table] for name in (table[0] if table else ())}


def with_all_columns(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows with all columns, filling missing cells with None."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    return [{name: row.get(name) for name in names} for row in rows]


def write_csv(path: Path, table: Table) -> None:
    """Write a table as a CSV file with a header line, with full precision."""
    table = columns(table)
    with destination(path).open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(zip(*table.values(), strict=True))


def text_of(table: Table) -> str:
    """Return a table as text with aligned columns and six significant digits."""
    table = columns(table)
    rows = [
        ["-" if v is None else f"{v:.6g}" if isinstance(v, float) else str(v) for v in row]
        for row in zip(*table.values(), strict=True)
    ]
    widths = [max(map(len, column)) for column in zip(table, *rows, strict=True)]
    lines = (
        "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        for row in (table, *rows)
    )
    return "\n".join(lines)


def once(notes: Iterable[str], names: set[str]) -> list[str]:
    """Return the warnings without repetitions.

    Of warnings that differ only in names of runs and in numbers, only the first is returned, with
    the number of such warnings.
    """
    kinds: dict[str, list[str]] = {}
    for note in notes:
        name = re.match(r".*?\.h5(\.part)?(?=[: ])", note)
        known = name is not None and Path(name[0]).name in names
        rest = note[name.end() :] if name else note
        kind = re.sub(r"-?\d[\d.]*(e[-+]\d+)?", "", rest) if known else note
        kinds.setdefault(kind, []).append(note)
    return [one + f" ({len(more) + 1} such)" * bool(more) for one, *more in kinds.values()]
