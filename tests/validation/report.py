"""The report of a validation, for people (Markdown) and for programs (JSON)."""

import json
from pathlib import Path

import numpy as np

from .case import Verdict

HEAD = """# Physics validation

Written by `python tests/validate.py --report docs/validation`. Every case runs the program on an
input of its own and compares what it wrote with an exact result, a derivation, or published
numbers. Where a case has several values, the table shows the one that comes nearest to its
tolerance; *used* is its deviation over the allowed one. Names of sources: EX the exam problem, LAB
the laboratory exercise, URB the gravity box, D a derivation, R an independent simulator, DSMC
direct simulation of the Boltzmann equation, KR Kolafa and Rottner (2006).

"""


def number(value: float, digits: int = 9) -> str:
    """A number for people."""
    return "-" if np.isnan(value) else f"{value:.{digits}g}"


def measured(verdict: Verdict) -> str:
    """The measured value, with its error if it has one."""
    if not verdict.error > 0:
        return number(verdict.measured)
    digits = max(2, int(np.ceil(np.log10(abs(verdict.measured) / verdict.error + 1))) + 2)
    return f"{verdict.measured:.{digits}g} ± {verdict.error:.1g}"


def row(verdict: Verdict) -> str:
    """One line of the table."""
    case = verdict.case
    what = case.what + (f" ({verdict.values} values)" if verdict.values > 1 else "")
    deviation = verdict.measured - verdict.reference if verdict.values else np.nan
    cells = (
        case.id,
        what,
        number(verdict.reference),
        measured(verdict),
        number(deviation, 2),
        case.tolerance.text,
        number(verdict.used, 2),
        case.source,
        "pass" if verdict.passed else f"**FAIL** {verdict.problem}",
    )
    return "| " + " | ".join(cell.replace("|", "&#124;") for cell in cells) + " |"


def summary(verdicts: list[Verdict], seconds: float) -> str:
    """What came out, in one line."""
    bad = [verdict.case.id for verdict in verdicts if not verdict.passed]
    outcome = f"failed: {', '.join(bad)}" if bad else "all pass"
    return f"{len(verdicts)} cases in {seconds / 60:.1f} minutes: {outcome}"


def markdown(verdicts: list[Verdict], origin: str, seconds: float) -> str:
    """The report as a table."""
    columns = ("case", "what", "reference", "measured", "deviation", "tolerance", "used", "source")
    return (
        f"{HEAD}{summary(verdicts, seconds)}. Program: {origin}.\n\n"
        f"| {' | '.join(columns)} | verdict |\n|{'---|' * (len(columns) + 1)}\n"
        + "\n".join(map(row, verdicts))
        + "\n"
    )


def as_json(verdicts: list[Verdict], origin: str, seconds: float) -> str:
    """The same as data."""
    finite = lambda value: value if np.isfinite(value) else None  # noqa: E731
    cases = [
        {
            "case": verdict.case.id,
            "what": verdict.case.what,
            "values": verdict.values,
            "reference": finite(verdict.reference),
            "measured": finite(verdict.measured),
            "standard_error": finite(verdict.error),
            "error": finite(verdict.measured - verdict.reference),
            "tolerance": verdict.case.tolerance.text,
            "used": finite(verdict.used),
            "source": verdict.case.source,
            "verdict": "pass" if verdict.passed else "fail",
            "problem": verdict.problem,
        }
        for verdict in verdicts
    ]
    report = {"program": origin, "seconds": round(seconds, 1), "cases": cases}
    return json.dumps(report, indent=1, ensure_ascii=False) + "\n"


def write(base: Path, verdicts: list[Verdict], origin: str, seconds: float) -> None:
    """Both reports, BASE.md and BASE.json."""
    base.parent.mkdir(parents=True, exist_ok=True)
    base.with_suffix(".md").write_text(markdown(verdicts, origin, seconds))
    base.with_suffix(".json").write_text(as_json(verdicts, origin, seconds))
