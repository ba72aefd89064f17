"""The report of a validation: a page in Markdown and data in JSON."""

import json
from itertools import groupby
from pathlib import Path

import numpy as np

from .case import Verdict

HEAD = """# Physics validation

Written by `python tests/validate.py --report docs/explanation/validation`. Each case runs the
program on its own input and compares the result with an exact value, a derivation, or published
numbers.

Cases of one number share a row, which shows the value that comes nearest to its tolerance. The
*verdict* is its deviation divided by the allowed one: up to 1 it passes, beyond it fails. What must
hold to rounding (1e-9 or better) is only counted in the row of its topic. `validation.json` has all
cases, with tolerances and sources.

"""

TOPICS = {
    "P1": "one disk: walls, bounces, TC model",
    "P2": "two disks: collisions",
    "P3": "scattering",
    "P4": "ten disks on a line: the exact path of hard rods",
    "P5": "speeds of a gas",
    "P6": "mixture",
    "P7": "collision rates, forces on walls",
    "P8": "pressure, from dilute gas to crystal",
    "P9": "inelastic gases: cooling, no equipartition, TC model, collapse",
    "P10": "craters; random placement up to saturation",
    "P11": "disks under gravity; contacts that time steps miss",
    "P12": "billiards",
    "P13": "symmetries: conservation, reversal, boosts, order of the disks",
    "P14": "velocity correlations and diffusion",
    "P15": "thermal walls, rough disks, transport, kicks, recycling, shear, moving sides",
    "P16": "relaxed starts: pressure and order in equilibrium",
    "W1": "straight walls: a wedge under gravity",
}


NOTES = """
## References that needed a second look

- **P11-10**: the share of collisions that time steps miss is P(q) with q = g Δt / s, not g Δt / 2s:
  two disks overlap on a chord, but collide only while they approach, on its first half.
- **P11-01**: the published table lets centres start in [R, 8]; here a disk lies wholly in its
  region, so it is taken up to 8 + R.
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
- **P15-20**: the rate holds for an opening that is much narrower than the mean free path and than
  the chamber. With .05 of the chamber it is 1.9(6) % higher; with .2 mean free paths besides,
  5.4(6) %.
- **P15-21**: the tolerance is that of the literature, k between 1 and 2; k and the exponent were
  fitted with the other one fixed, because they are strongly correlated. Smooth grains do not obey
  the law: 2000 of them have an exponent of 1.29(3) with k = 1.3(2).
- **P15-13**: the threshold of Maxwell's demon, .73 here, holds for many dilute grains. The 120
  disks of the case become evenly distributed near .65; 600 disks of a fifth of the diameter are
  still separated there.
- **P12-06**: the coefficients -4/3, -.8775 and 4.519 of the expansion of D_0/D are quoted from
  memory: the papers of van Leeuwen and Weijland could not be consulted, nor could a published
  simulation be found. Exact are the limit, D_0 = 3v/(16nR) of the Boltzmann equation, and the mean
  free time of P12-05. `runs/lorentz.sh` measured D/D_0 at six densities n R^2 of 100 000 scatterers
  (four runs of 10^6 events each): .984(2), .968(3), .947(2), .909(3), .842(1), .719(3) at .0025,
  .005, .01, .02, .04, .08, where the expansion gives .982, .967, .941, .897, .825, .723, and
  without its last term .983, .970, .950, .920, .880, .834. So the first two terms are confirmed
  within the errors up to .005; the terms that are left out matter from .01 on.
- **P12-09**: the Lyapunov exponent .43 of the stadium is quoted from memory, because the papers of
  Benettin and Strelcyn and of Dellago and Posch could not be consulted. The estimator is confirmed
  by the exact exponent of an unstable path (P12-08). An independent program for points (4000 paths
  of 2000 collisions) found .4292(5).
- **P8-03** is no case: up to packing .70 the program agrees with Li et al. (2022) within .03
  to .2 %, its errors.
"""


def number(value: float, digits: int = 9) -> str:
    """Return a number as text for a reader."""
    return "-" if value is None or np.isnan(value) else f"{value:.{digits}g}"


def measured(value: float, error: float) -> str:
    """Return a measured value as text, with its error if there is one."""
    if not (value and error and np.isfinite(error)):
        return number(value)
    digits = max(2, int(np.ceil(np.log10(abs(value) / error + 1))) + 2)
    return f"{value:.{digits}g} ± {error:.1g}"


def shown(cell: str) -> str:
    """Return the text of a cell with the special characters of Markdown escaped."""
    return cell.replace("|", "&#124;").replace("<", "&lt;")


LIMITS = {"at most": "≤", "at least": "≥"}


def topic_of(case: dict) -> str:
    """Return the topic of a case, which is the first part of its name."""
    return case["case"].partition("-")[0]


def is_rounding(case: dict) -> bool:
    """Return whether the tolerance of a case allows for rounding errors only."""
    text = case["tolerance"].partition(" ")[0]
    if case["tolerance"] in LIMITS:
        return abs(case["reference"] or 0) <= 1e-9
    return text == "exact" or (text.replace(".", "").startswith("1e-") and float(text) <= 1e-9)


def rows(cases: list[dict]) -> list[str]:
    """Return the lines of the table: one for each topic and for each case, and all failures."""
    lines = []
    ordered = sorted(cases, key=lambda case: [*TOPICS, topic_of(case)].index(topic_of(case)))
    for topic, under in groupby(ordered, key=topic_of):
        values = list(under)
        exact = [value for value in values if is_rounding(value) and value["verdict"] == "pass"]
        used = number(max(value["used"] for value in exact), 2) if exact else ""
        count = f"{len(exact)} to rounding" if exact else ""
        lines.append(line(f"**{topic}**", TOPICS.get(topic, ""), "", count, used))
        for _, group in groupby(values, key=lambda value: value["case"]):
            lines += rows_of_case([value for value in group if value not in exact])
    return lines


def rows_of_case(values: list[dict]) -> list[str]:
    """Return lines for the cases of one name: failed cases, or the closest to its tolerance."""
    failed = [value for value in values if value["verdict"] != "pass"]
    lines = []
    for value in failed or sorted(values, key=lambda value: -value["used"])[:1]:
        verdict = f"**FAIL** {value['problem']}" if failed else number(value["used"], 2)
        reference = LIMITS.get(value["tolerance"], "") + number(value["reference"])
        figure = measured(value["measured"], value["standard_error"])
        lines.append(line(value["case"], value["what"], reference, figure, verdict))
    return lines


def line(*cells: str) -> str:
    """Return a line of the table."""
    return "| " + " | ".join(map(shown, cells)) + " |"


def outcome(cases: list[dict], seconds: float) -> str:
    """Return the result of the validation in one line."""
    bad = [case["case"] for case in cases if case["verdict"] != "pass"]
    result = f"failed: {', '.join(bad)}" if bad else "all pass"
    return f"{len(cases)} cases in {seconds / 60:.1f} minutes: {result}"


BARS = """
## Error bars and p-values

The tables are written by `python tests/coverage_tables.py`. The lists of systems and quantities
were made before the first run. The seeds of the tables were not used to improve the estimators,
with two exceptions: these seeds showed that the errors of the flow and of the slopes under gravity
were wrong, and their rows were measured again with the corrected estimators. An error bar belongs
to a single run, or to a group of runs if the name of the system states a number of runs; *bars* is
the number of runs or groups. *Held* is the percentage of the error bars that contain the true
value, which is exact, or the mean over all bars, or the value of 3000 runs from which the groups
are drawn (disks that fall). The expected percentage is 68, and 61 to 75 are allowed; the
percentage of n bars has a standard deviation of 47 / √n by chance. *Error / scatter* is the mean
error divided by the standard deviation of the measured values; Student's t makes this ratio larger
than 1. *Three* is the percentage for means over three bars, whose errors follow from their
scatter.

| system | quantity | bars | held | error / scatter | three |
|---|---|---|---|---|---|
"""
P_VALUES = """
The second table contains p-values of `speeds.py` for valid runs. Of 100 p-values 5 should be below
0.05 and 32 below 0.32. *Uniform* is the p-value of a Kolmogorov-Smirnov test of these p-values
against the uniform distribution. The seeds of the mixtures begin at 20001, all other seeds at 1001.

| system | species | runs | KS: < .05 | < .32 | uniform | χ²: < .05 | < .32 | uniform |
|---|---|---|---|---|---|---|---|---|
"""


def statistics_tables(base: Path) -> str:
    """Return the tables of `tests/coverage_tables.py` if coverage.json is beside the page."""
    path = base.parent / "coverage.json"
    if not path.exists():
        return ""
    tables = json.loads(path.read_text())
    bars = [
        line(
            row["system"], row["quantity"], str(row["runs"]), number(row["held_%"], 3),
            number(row["error_over_scatter"], 3), number(row["three_%"], 3),
        )
        for row in tables["bars"]
    ]  # fmt: skip
    p_values = [
        line(
            row["system"], row["species"], str(row["runs"]),
            *(number(row[f"{test}_{name}"], 2) for test in ("ks", "chi2")
              for name in ("below_5_%", "below_32_%", "uniform")),
        )
        for row in tables["p_values"]
    ]  # fmt: skip
    missing = ", ".join(f"*{name}*" for name in tables.get("missing", []))
    rest = f"\nThese systems of the lists have not been measured yet: {missing}.\n" * bool(missing)
    return BARS + "\n".join(bars) + "\n" + P_VALUES + "\n".join(p_values) + "\n" + rest


def rewrite(base: Path) -> None:
    """Write BASE.md again from BASE.json and coverage.json."""
    data = json.loads(base.with_suffix(".json").read_text())
    base.with_suffix(".md").write_text(markdown(data, statistics_tables(base)))


def markdown(data: dict, tables: str = "") -> str:
    """Return the page of a report; `tables` follow the cases."""
    cases = data["cases"]
    return (
        f"{HEAD}{outcome(cases, data['seconds'])}. Program: {data['program']}.\n\n"
        "| case | what | reference | measured | verdict |\n|---|---|---|---|---|\n"
        + "\n".join(rows(cases))
        + f"\n{NOTES}{tables}"
    )


def as_data(verdict: Verdict) -> dict:
    """Return a verdict in the form that the JSON file contains."""
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
    """Write both reports, BASE.md and BASE.json."""
    cases = [as_data(verdict) for verdict in verdicts]
    data = {"program": origin, "seconds": round(seconds, 1), "cases": cases}
    base.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(data, indent=1, ensure_ascii=False) + "\n"
    base.with_suffix(".json").write_text(text)
    rewrite(base)
