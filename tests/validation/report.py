"""The report of a validation, for people (Markdown) and for programs (JSON)."""

import json
from pathlib import Path

import numpy as np

from .case import Verdict

HEAD = """# Physics validation

Written by `python tests/validate.py --report docs/validation`. Every case runs the program on its
own input and compares the output with an exact result, a derivation, or published numbers. If a
case has several values, the table shows the one closest to its tolerance; *used* is its deviation
divided by the allowed one. Sources: EX the exam problem, LAB the laboratory exercise, URB the
gravity box, D a derivation, R an independent simulator, DSMC direct simulation of the Boltzmann
equation, KR Kolafa and Rottner (2006).

| cases | topic |
|---|---|
| P1 to P3 | one and two disks: walls, bounces, collisions, scattering, against exact formulas |
| P4 | ten disks on a line: the exact trajectory of hard rods, until rounding has grown |
| P5, P6 | speeds of a gas and a mixture: Maxwell's law, moments, the way to equilibrium |
| P7, P8 | collision rates and pressure from dilute gas to crystal, against the equation of state |
| P9 | inelastic gases: Haff's law, mixtures without equipartition, the TC model, collapse |
| P10 | craters: scaling, energy, size against mass, collapse; random placement up to saturation |
| P11 | disks under gravity: energy, equipartition, barometric law, contacts that time steps miss |
| P12 | billiards: a round container, Sinai's, a light disk around a heavy one |
| P13 | symmetries: conservation, reversal, boosts, scaling, no overlaps |
| P14 | velocity correlations and diffusion |
| P15 | thermal walls, rough disks, transport, kicks, shear, moving sides, the demon |
| W1 | straight walls: a right-angled wedge under gravity, against two bouncing balls |

"""


NOTES = """
## References that needed a second look

- **P11-10**: the share of collisions that time steps miss is P(q) with q = g Δt / s, not
  g Δt / 2s. Two disks overlap on a chord of length 2l, but collide only while they approach, on its
  first half: a contact is visible for the time l / g, not 2l / g (`post/missed.py`). The share is
  then about four times that of the table: at Δt = .001 still within 2 %, at .004 not.
- **P11-01**: the table lets centres start in [R, 8]. A disk lies wholly in its region, so with
  `region = 0, 8, 0, 8` they start up to 8 less R, and E / N is lower by g⟨m⟩R / 2 = .00735. Cases
  take the region up to 8 + R, as the table means it; one takes it up to 8.
- **P6-03**: R finds 1.39(1) between walls at packing .154 after 2 collisions per disk. The program
  gives 1.468(6), with time steps 1.485(11), in the dilute limit 1.449(8); the Boltzmann equation
  gives 1.455. After 4 and 6 collisions it gives 1.149(6) and 1.055(6), R 1.14(1) and 1.03(1).
- **P9-07**: the fractions hold to .01 up to packing .1. Beyond, the same disks meet again and the
  intervals scatter more: at packing .2 and .4 the fraction is .850 and .846 for w t_c = 1
  (table .86), .612 and .608 for .5 (.62).
- **P10-04**: not every bed collapses before a tenth of the energy is left; 14 of 18 did.
- **P7-07**: the contact values of section 7 are approximate. To first order in the density they are
  1 + sum over k of n_k times the area where circles of radii s_ik and s_jk about the two centres
  overlap. For radii 1 : 2 that is +.26, +.16, -.29 % (11, 12, 22) at packing .1, and -.2 % for
  pairs of one species, which have N_i - 1 partners; measured are +.11(5), +.14(7), -.45(6) %.
- **P8-05**: the formula of the crystal is good to .2 %: the program finds -.15, -.21, -.15, -.07,
  -.01 % at packing .74, .77, .80, .83, .86 (errors .03 to .01), and 0 near .9069.
- **P15-09**: the theory of sheared grains is linear in the stress. For xi = .95 it has .2276,
  .2142, .9518, and .2275(6), .2168(6), .9494(6) are found; for xi = .8 .475, .379, .826, and
  .490(1), .386(1), .818(1).
- **P15-13**: the threshold of Maxwell's demon is that of many dilute grains, .73 here. The chambers
  of the case, with 120 grains, turn even near .65; five times as many of a fifth of the diameter
  still part at .65.
- **P8-03** is a remark, not a case. Up to packing .70 the program agrees with Li et al. (2022)
  within its errors of .03 to .2 %.
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
        + f"\n{NOTES}"
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
