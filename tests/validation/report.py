"""The report of a validation: a page in Markdown and data in JSON."""

import json
import re
from itertools import groupby
from pathlib import Path

import numpy as np

from .case import Verdict

HEAD = """# Physics validation

How far can the numbers of the program be trusted? This page lists all validation cases with their
reference values, measured values and verdicts, for researchers who rely on the results. In each
case the program runs an input of its own. The result is compared with an exact value, a derived
formula or published numbers. The file `validation.json` beside this page contains all values with
their tolerances. The command `python tests/validate.py --report docs/explanation/validation` writes
both files.

The *verdict* is the deviation from the reference, divided by the tolerance. A value passes if its
verdict is at most 1. If the reference is a bound (≤ or ≥), the verdict is 0 if the bound is
satisfied. The table has one row for each case. If a case has several values, the row shows the
value that is closest to its tolerance. Values that must agree with the reference to rounding (1e-9
or better) are listed in [the second table](#cases-that-agree-to-rounding). In the first table, the
row of each topic states the number of these values.

The column *source* names the origin of the reference:

| source | meaning |
|---|---|
| derived | calculated from the model; the formula is in `tests/validation` |
| reference program | another hard-disk program, written for these cases, without shared code |
| DSMC | direct simulation Monte Carlo solution of the Boltzmann equation |
| exam, lab, gravity exercise | texts of the [exercises](../tutorials/README.md) |
| all others | publications |

"""

#: Words of the page for the abbreviations of the sources.
SOURCES = {
    "D": "derived",
    "R": "reference program",
    "EX": "exam",
    "LAB": "lab",
    "URB": "gravity exercise",
    "KR": "Kolafa and Rottner 2006",
}

TOPICS = {
    "P1": "one disk: walls, bounces, TC model",
    "P2": "two disks: collisions",
    "P3": "scattering of a light disk off a heavy one",
    "P4": "ten disks on a line: exact paths of hard rods",
    "P5": "speeds in a gas",
    "P6": "equilibrium and relaxation of a mixture",
    "P7": "collision rates and forces on walls",
    "P8": "pressure, from the dilute gas to the crystal",
    "P9": "inelastic gases: cooling, partition of energy, TC model, collapse",
    "P10": "craters, and random placement",
    "P11": "disks under gravity, and time steps",
    "P12": "billiards and Lorentz gases",
    "P13": "symmetries: conservation laws, time reversal, moving frames, order of the disks",
    "P14": "velocity correlations and diffusion",
    "P15": "thermal walls, rough disks, transport, driving, recycling, shear, moving sides",
    "P16": "relaxed starts: pressure and order in equilibrium",
    "W1": "straight walls: a wedge under gravity",
}


NOTES = """
## Notes on single cases

Some references are approximate, differ from a publication, or hold only under certain conditions.
Such references are explained in the following notes. A number in parentheses is the standard error
of the last digit.

**P6-03, relaxation of a mixture.** The published ratio K_heavy / K_light after 2 collisions per
disk is 1.39(1). The published value is too low, as other values of this ratio show:

| method | ratio |
|---|---|
| measured here | 1.468(6) |
| measured here, time steps | 1.485(11) |
| measured here, dilute gas | 1.449(8) |
| Boltzmann equation | 1.455 |

**P7-07, collision rates of a mixture.** The reference is calculated with approximate contact values
of the pair distribution functions. The table compares two numbers for packing fraction 0.1. The
first number is the error of the contact values, to first order in the density. The second number is
the deviation of the measured collision rates from the reference.

| pair | error of the contact value (%) | measured deviation (%) |
|---|---|---|
| 11 | +0.26 | +0.11(5) |
| 12 | +0.16 | +0.14(7) |
| 22 | -0.29 | -0.45(6) |

**P8-03, pressure of a dense fluid.** The table contains no case P8-03. Up to packing fraction 0.70
the measured pressure agrees with the results of Li et al. (2022). The errors are 0.03 to 0.2 %.

**P8-05, pressure of the crystal.** The formula for the reference pressure is accurate to 0.2 %.

**P9-07, TC model.** The theoretical fractions of elastic collisions are accurate to 0.01 up to
packing 0.1. In denser gases the measured fraction is smaller, because the same disks collide
repeatedly. The table lists the fractions for several products of the collision rate w of a disk and
the contact duration t_c:

| w t_c | low packing | packing 0.2 |
|---|---|---|
| 1 | 0.86 | 0.850 |
| 0.5 | 0.62 | 0.612 |

**P10-04, craters without the TC model.** If the TC model is switched off, an inelastic collapse
occurs in all 12 runs before the energy has fallen to a tenth of its initial value. In 7 of the 12
runs time no longer advances, and the run ends.

**P11-01, energy under gravity.** In the published table the disks of radius R start with their
centres between the heights R and 8. In Ricochet a disk lies completely inside its starting region.
The starting region must therefore end at 8 + R.

**P11-10, time steps.** Let g be the relative speed of two disks, s the sum of their radii and Δt
the time step. Runs with time steps miss the fraction P(q) of the collisions, where q = g Δt / s.
The argument of P is q and not q / 2, because a collision is detected only while the disks approach
each other. Overlapping disks approach each other along the first half of the path on which they
overlap.

**P12-06, diffusion in a Lorentz gas.** The density expansion of D_0/D has the coefficients -4/3,
-0.8775 and 4.519. These coefficients are quoted from memory, because the papers of van Leeuwen and
Weijland could not be consulted. No published simulation was found. The limit of low density, D_0 =
3v/(16nR) from the Boltzmann equation, and the mean free time of case P12-05 are exact references.
The table compares the expansion with `runs/lorentz.sh`, which simulates 100 000 scatterers (four
runs of 10^6 events for each density). Up to n R^2 = 0.005, the first two terms agree with the
measured values within the statistical errors. At n R^2 = 0.01 and above, the omitted terms are
larger than the statistical errors.

| n R^2 | 0.0025 | 0.005 | 0.01 | 0.02 | 0.04 | 0.08 |
|---|---|---|---|---|---|---|
| measured D/D_0 | 0.984(2) | 0.968(3) | 0.947(2) | 0.909(3) | 0.842(1) | 0.719(3) |
| expansion | 0.982 | 0.967 | 0.941 | 0.897 | 0.825 | 0.723 |
| expansion without its last term | 0.983 | 0.970 | 0.950 | 0.920 | 0.880 | 0.834 |

**P12-09, Lyapunov exponent of the stadium.** The value 0.43 is quoted from memory, because the
papers of Benettin and Strelcyn and of Dellago and Posch could not be consulted. Two checks support
this value. In case P12-08 the same estimator finds the exactly known exponent of an unstable path.
An independent program for point particles (4000 paths of 2000 collisions) yielded the exponent
0.4292(5).

**P15-05, gas driven by white noise.** The theory assumes independent velocities of Maxwell's
distribution, and the deviation is systematic: at ξ = 0.8 it is +0.4 %, four standard errors. Two
causes reduce the energy that a collision dissipates, to 0.993(1) of the value for independent
Maxwellian velocities. The negative a2 raises the temperature by 0.2 %. Correlations of the
velocities explain the rest; at packing fraction 0.2 they raise the temperature by 4 to 15 %. At ξ =
0.6 the positive a2 lowers the temperature by 0.2 %, so that the two causes nearly cancel.

**P15-09, sheared inelastic gas.** The theory is linear in the stress. Therefore the error of the
theory grows with the inelasticity. Each cell of the table contains three values: the reduced shear
rate, -P_xy and P_yy.

| restitution ξ | theory | measured |
|---|---|---|
| 0.95 | 0.2276, 0.2142, 0.9518 | 0.2275(6), 0.2168(6), 0.9494(6) |
| 0.8 | 0.475, 0.379, 0.826 | 0.490(1), 0.386(1), 0.818(1) |

**P15-13, Maxwell's demon.** The theory assumes many dilute grains. According to the theory, the
disks collect in one chamber if the floor velocity is below 0.73. The 120 disks of this case already
distribute evenly between the chambers at floor velocities above about 0.65. If there are 600 disks
with a fifth of the diameter, most disks are still in one chamber at the floor velocity 0.65.

**P15-20, effusion.** The theoretical rate applies to an opening much narrower than the mean free
path and than the chamber. For an opening 0.05 times as wide as the chamber, the measured rate is
1.9(6) % higher than the theoretical rate. If the opening is also 0.2 mean free paths wide, the
measured rate is 5.4(6) % higher.

**P15-21, discharge of a hopper.** The tolerance covers the values of k in the literature, which lie
between 1 and 2. Since k and the exponent are strongly correlated, each of the two was fitted with
the other one fixed. Smooth grains do not obey Beverloo's law: a fit for 2000 smooth grains yields
the exponent 1.29(3) and k = 1.3(2).
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


def order(case: dict) -> int:
    """Return the position of the topic of a case on the page."""
    return [*TOPICS, topic_of(case)].index(topic_of(case))


def is_rounding(case: dict) -> bool:
    """Return whether the tolerance of a case allows for rounding errors only."""
    text = case["tolerance"].partition(" ")[0]
    if case["tolerance"] in LIMITS:
        return abs(case["reference"] or 0) <= 1e-9
    return text == "exact" or (text.replace(".", "").startswith("1e-") and float(text) <= 1e-9)


def rows(cases: list[dict]) -> list[str]:
    """Return the lines of the table: one for each topic and for each case, and all failures."""
    lines = []
    for topic, under in groupby(sorted(cases, key=order), key=topic_of):
        values = list(under)
        exact = [value for value in values if is_rounding(value) and value["verdict"] == "pass"]
        used = number(max(value["used"] for value in exact), 2) if exact else ""
        count = f"{len(exact)} to rounding" if exact else ""
        lines.append(line(f"**{topic}**", TOPICS.get(topic, ""), "", "", count, used))
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
        origin = source(value["source"])
        lines.append(line(value["case"], value["what"], reference, origin, figure, verdict))
    return lines


def rounding_rows(cases: list[dict]) -> list[str]:
    """Return a line for each value that agrees with its reference to rounding."""
    return [
        line(
            case["case"], case["what"], str(case["values"]), source(case["source"]),
            case["tolerance"], number(case["used"], 2),
        )
        for case in sorted(cases, key=order)
        if is_rounding(case) and case["verdict"] == "pass"
    ]  # fmt: skip


def source(text: str) -> str:
    """Return the source of a reference with the abbreviations replaced by words."""
    return re.sub("|".join(rf"\b{name}\b" for name in SOURCES), lambda one: SOURCES[one[0]], text)


def line(*cells: str) -> str:
    """Return a line of the table."""
    return "| " + " | ".join(map(shown, cells)) + " |"


def outcome(cases: list[dict], seconds: float) -> str:
    """Return the result of the validation in one line."""
    bad = [case["case"] for case in cases if case["verdict"] != "pass"]
    result = f"failed: {', '.join(bad)}" if bad else "all pass"
    return f"{len(cases)} cases in {seconds / 60:.1f} minutes: {result}"


ROUNDING = """
## Cases that agree to rounding

The column *values* states the number of compared values.

| case | quantity | values | source | tolerance | verdict |
|---|---|---|---|---|---|
"""
BARS = """
## Error bars and p-values

Of 100 correct error bars, 68 contain the true value on average. The tables of this section show how
many error bars of the scripts contain the true value. They are written by `python
tests/coverage_tables.py`. We chose the systems and quantities before the first run, and used other
seeds to improve the estimators. Some rows were measured again for the following reasons:

- The first tables showed that the scripts calculated four errors wrongly: those of the flow
  velocity, of the slopes under gravity, of the coefficients from Helfand moments and of the
  thermalisation time. The rows of these four quantities were measured again with corrected
  estimators.
- Later, the bias of the Lyapunov exponent and the equilibration under gravity were changed. The
  rows of the Lyapunov exponent and of gases under gravity were then measured again.

Curves of cooling gases as functions of time are compared at one fixed time. An error bar refers to
a single run, unless the name of the system contains a number of runs; then it refers to a group of
that many runs. The table has the following columns:

- *bars*: number of runs or groups of runs.
- *coverage*: percentage of the error bars that contain the true value. The true value is either
  known exactly, or it is the mean over all bars. We expect a coverage of 68 % and allow 61 to 75 %.
  For n error bars the standard deviation of the coverage is 47 / √n %.
- *error / scatter*: mean error divided by the standard deviation of the measured values. The ratio
  is larger than 1 if the errors contain the factor of Student's t.
- *three*: coverage of means over three values. The error of such a mean is calculated from the
  scatter of the three values.

In four rows about craters, the coverage is outside the allowed range. A projectile as light as a
disk hits or displaces few disks in most beds, but many disks in some beds. The distribution of the
number of disks is therefore skewed (skewness 2.2). A sample of four values from such a distribution
often includes no large value. If a sample includes no large value, both its mean and its error are
too small. Means over more values, drawn at random from 240 craters, have a better coverage: 64 %
for 16 values, and 67 % for 64 values. The exponents are calculated from the numbers of disks, so
their errors are too small as well.

| system | quantity | bars | coverage | error / scatter | three |
|---|---|---|---|---|---|
"""
P_VALUES = """
The second table lists p-values of `speeds.py` for runs to which the tested law applies. Of 100
p-values, 5 should be below 0.05 and 32 below 0.32. *KS* stands for the Kolmogorov-Smirnov test of
the speeds, and χ² for the χ² test. *Uniform* is the p-value of another Kolmogorov-Smirnov test.
This second test compares the p-values in the row with a uniform distribution. The seeds of the
mixtures begin at 20001, all other seeds at 1001.

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
    rest = (
        f"\nThe script lists further systems that have not been measured yet: {missing}.\n"
        * bool(missing)
    )
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
        "| case | quantity | reference | source | measured | verdict |\n|---|---|---|---|---|---|\n"
        + "\n".join(rows(cases))
        + f"\n{NOTES}{ROUNDING}"
        + "\n".join(rounding_rows(cases))
        + f"\n{tables}"
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
