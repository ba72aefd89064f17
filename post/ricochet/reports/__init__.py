"""Analyses of runs, each of which computes a table and draws a figure (see `ricochet.analyses`)."""

from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..reading.files import did_you_mean
from ..reading.reader import Run

if TYPE_CHECKING:
    from .registry import Analysis
    from .result import Result

HERE = Path(__file__).parent


class Analyses(Mapping[str, str]):
    """Names of all analyses, each with a line of description, read without loading the modules."""

    def __init__(self) -> None:
        """Find the modules of all analyses."""
        paths = sorted(HERE.glob("*/[!_]*.py"), key=lambda path: path.stem)
        self.modules = {path.stem: f"{__name__}.{path.parent.name}.{path.stem}" for path in paths}

    def __getitem__(self, name: str) -> str:
        path = HERE.joinpath(*self.modules[name].split(".")[-2:]).with_suffix(".py")
        return path.read_text(encoding="utf-8").splitlines()[0].strip('"')

    def __iter__(self) -> Iterator[str]:
        return iter(self.modules)

    def __len__(self) -> int:
        return len(self.modules)

    def __repr__(self) -> str:
        """Return a line for each analysis."""
        longest = max(map(len, self))
        return "\n".join(f"{name:{longest}}  {about}" for name, about in self.items())


analyses = Analyses()


def analysis(name: str) -> "Analysis":
    """Return the analysis of the given name."""
    if name not in analyses:
        hint = did_you_mean(name, analyses) or f"; there are {', '.join(analyses)}"
        raise ValueError(f"no analysis {name}{hint}")
    found: Analysis = import_module(analyses.modules[name]).ANALYSIS
    return found


def analyse(
    name: str, runs: Run | str | Path | Sequence[Run | str | Path], **options: Any
) -> "Result":
    """Analyse runs.

    Parameters
    ----------
    name : str
        name of the analysis, one of `ricochet.analyses`
    runs : Run, str, pathlib.Path or list
        one or several runs, or paths of output files
    **options
        options of the script of the same name, with underscores in place of hyphens

    Returns
    -------
    result : ricochet.reports.result.Result
        table, figure, notes and warnings

    Raises
    ------
    ValueError
        if there is no such analysis or option
    RunError
        if the analysis does not apply to a run

    Examples
    --------
    >>> result = ricochet.analyse("speeds", runs, equilibration=15)
    >>> result.table[0]["N"]
    64
    >>> figure = result.figure()
    """
    return analysis(name)(runs, options)
