"""The report of a validation, for people (Markdown) and for programs (JSON)."""

import json
import re
from itertools import groupby
from pathlib import Path

import numpy as np

from .case import Verdict

HEAD = """# Physics validation

Written by `python tests/validate.py --report docs/validation`. Each case runs the program on its
own input and compares the result with an exact value, a derivation, or published numbers.

Cases of one number share a row, which shows the value that comes nearest to its tolerance. The
*verdict* is its deviation divided by the allowed one: up to 1 it passes, beyond it fails.
`validation.json` has all cases, with tolerances and sources.

| cases | topic |
|---|---|
| P1 to P3 | one and two disks: walls, bounces, collisions, scattering |
| P4 | ten disks on a line: the exact path of hard rods |
| P5, P6 | speeds of a gas and of a mixture |
| P7, P8 | collision rates and pressure, from dilute gas to crystal |
| P9 | inelastic gases: cooling, no equipartition, TC model, collapse |
| P10 | craters; random placement up to saturation |
| P11 | disks under gravity; contacts that time steps miss |
| P12, W1 | billiards; straight walls |
| P13 | symmetries: conservation, reversal, boosts, scaling, no overlaps |
| P14 | velocity correlations and diffusion |
| P15 | thermal walls, rough disks, transport, kicks, shear, moving sides |

"""


NOTES = """
## References that needed a second look

- **P11-10**: the share of collisions that time steps miss is P(q) with q = g Δt / s, not g Δt / 2s:
  two disks overlap on a chord, but collide only while they approach, on its first half.
- **P11-01**: the published table lets centres start in [R, 8]; here a disk lies wholly in its
  region. Cases take the region up to 8 + R; one takes it up to 8.
- **P6-03**: a published 1.39(1) after 2 collisions per disk is too low: the program finds 1.468(6),
  with time steps 1.485(11), when dilute 1.449(8); the Boltzmann equation gives 1.455.
- **P9-07**: the fractions hold to .01 up to packing .1. Beyond, the same disks meet again: .850 at
  packing .2 for w t_c = 1 (table: .86), .612 for .5 (.62).
- **P10-04**: not every bed collapses before a tenth of the energy is left; 14 of 18 did.
- **P7-07**: the contact values are approximate: to first order in the density they are wrong by
  +.26, +.16, -.29 % (pairs 11, 12, 22) at packing .1; found are +.11(5), +.14(7), -.45(6) %.
- **P8-05**: the formula of the crystal is good to .2 %.
- **P15-09**: the theory of sheared grains is linear in the stress. For ξ = .95 it has .2276, .2142,
  .9518, found are .2275(6), .2168(6), .9494(6); for ξ = .8 .475, .379, .826, found .490(1),
  .386(1), .818(1).
- **P15-13**: the threshold of Maxwell's demon, .73 here, is that of many dilute grains. The 120 of
  the case turn even near .65; five times as many of a fifth of the diameter still part there.
- **P8-03** is no case: up to packing .70 the program agrees with Li et al. (2022) within .03
  to .2 %, its errors.
"""


def number(value: float, digits: int = 9) -> str:
    """A number for people."""
    return "-" if value is None or np.isnan(value) else f"{value:.{digits}g}"


def measured(value: float, error: float) -> str:
    """A measured value, with its error if it has one."""
    if not (value and error):
        return number(value)
    digits = max(2, int(np.ceil(np.log10(abs(value) / error + 1))) + 2)
    return f"{value:.{digits}g} ± {error:.1g}"


def with_names(cases: list[dict]) -> list[dict]:
    """The cases, with what "the same" stands for."""
    named, last = [], ""
    for case in cases:
        what = case["what"]
        if re.match("the same(?! disks)", what):
            what = what.replace("the same", last, 1)
        else:
            last = what.partition(":")[0]
        named.append({**case, "what": what})
    return named


def shown(cell: str) -> str:
    """A cell whose signs Markdown takes for none of its own."""
    return cell.replace("|", "&#124;").replace("<", "&lt;")


LIMITS = {"at most": "≤", "at least": "≥"}


def rows(cases: list[dict]) -> list[str]:
    """The lines of the table: one for each case, and all values that fail."""
    lines = []
    for _, group in groupby(with_names(cases), key=lambda case: case["case"]):
        values = list(group)
        failed = [value for value in values if value["verdict"] != "pass"]
        for value in failed or [max(values, key=lambda value: value["used"])]:
            verdict = f"**FAIL** {value['problem']}" if failed else number(value["used"], 2)
            figure = measured(value["measured"], value["standard_error"])
            reference = LIMITS.get(value["tolerance"], "") + number(value["reference"])
            cells = value["case"], value["what"], reference, figure, verdict
            lines.append("| " + " | ".join(map(shown, cells)) + " |")
    return lines


def summary(verdicts: list[Verdict], seconds: float) -> str:
    """What came out, in one line."""
    return outcome([as_data(verdict) for verdict in verdicts], seconds)


def outcome(cases: list[dict], seconds: float) -> str:
    """The same of cases as data."""
    bad = [case["case"] for case in cases if case["verdict"] != "pass"]
    result = f"failed: {', '.join(bad)}" if bad else "all pass"
    return f"{len(cases)} cases in {seconds / 60:.1f} minutes: {result}"


def markdown(data: dict) -> str:
    """The page of a report."""
    cases = data["cases"]
    return (
        f"{HEAD}{outcome(cases, data['seconds'])}. Program: {data['program']}.\n\n"
        "| case | what | reference | measured | verdict |\n|---|---|---|---|---|\n"
        + "\n".join(rows(cases))
        + f"\n{NOTES}"
    )


def as_data(verdict: Verdict) -> dict:
    """A verdict as it stands in the JSON file."""
    finite = lambda value: value if np.isfinite(value) else None  # noqa: E731
    return {
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


def write(base: Path, verdicts: list[Verdict], origin: str, seconds: float) -> None:
    """Both reports, BASE.md and BASE.json."""
    cases = [as_data(verdict) for verdict in verdicts]
    data = {"program": origin, "seconds": round(seconds, 1), "cases": cases}
    base.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(data, indent=1, ensure_ascii=False) + "\n"
    base.with_suffix(".json").write_text(text)
    base.with_suffix(".md").write_text(markdown(data))
