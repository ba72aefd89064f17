"""Run the quick part of the validation in `make test`, and test its verdicts."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from ricochet.analysis.statistics import Estimate
from validation import CASES, report
from validation.case import AT_LEAST, AT_MOST, EXACT, Case, Member, judge, relative, sigmas, within
from validation.running import validate

DOCS = Path(__file__).resolve().parents[2] / "docs" / "explanation"
QUICK = ("P1-", "P2-", "P3-", "P4-", "P6-04", "P9-07", "P9-10", "P9-11", "P9-12", "P10-07")
QUICK += ("P12-01", "P12-02", "P12-03", "P12-04", "P12-07", "P12-08", "P12-10", "P13-02")
QUICK += ("P13-04", "P13-06", "W1-", "P15-01", "P15-07", "P15-11")
#: Averages over chaotic paths of millions of collisions, and over 20 cooling gases.
AVERAGES = ("P9-13", "P12-05", "P12-06", "P12-09", "P12-11", "P12-12")


def case(measure, reference, tolerance, members=()) -> Case:
    return Case("T", "a case for a test", tuple(members), measure, reference, tolerance, "test")


def verdict(value, reference, tolerance) -> bool:
    return judge(case(lambda: value, reference, tolerance), []).passed


@pytest.mark.parametrize(
    ("names", "number"), [(QUICK, 60), pytest.param(AVERAGES, 8, marks=pytest.mark.statistics)]
)
def test_exact_cases_hold(program, tmp_path, names, number):
    """The quick cases take 8 s, because they are 63 cases with 111 runs of the program."""
    cases = [case for case in CASES if case.id.startswith(names)]
    verdicts = list(validate(cases, program, tmp_path, jobs=2))
    assert len(verdicts) == len(cases) > number
    bad = [f"{v.case.id} {v.case.what}: {v.measured} {v.problem}" for v in verdicts if not v.passed]
    assert not bad, "\n".join(bad)


@pytest.mark.parametrize(
    ("value", "reference", "tolerance", "passed"),
    [
        (1.01, 1, within(0.02), True),
        (0.97, 1, within(0.02), False),
        ([1, 2.1], [1, 2], relative(0.06), True),
        ([1, 2.1], [1, 2], relative(0.04), False),
        (Estimate(1.1, 0.05), 1, sigmas(3), True),
        (Estimate(1.1, 0.05), 1, sigmas(3, 0.05), False),
        (Estimate(1.1, 0.03), 1, sigmas(3), False),
        (0, 0, relative(0.1), True),
        (1e-300, 0, EXACT, False),
        (True, True, EXACT, True),
        (0.9, 1, AT_MOST, True),
        (1.1, 1, AT_MOST, False),
        (1.1, 1, AT_LEAST, True),
        (0.9, 1, AT_LEAST, False),
        (np.nan, 1, AT_MOST, False),
        ([1, np.nan], 1, within(9), False),
        (np.inf, 1, AT_MOST, False),
        ([1, 1], [1, 1, 1], within(9), False),
    ],
)
def test_verdicts(value, reference, tolerance, passed):
    assert verdict(value, reference, tolerance) is passed


def test_failures_are_reported_and_do_not_stop_the_others(program, tmp_path):
    cases = [
        case(lambda run: 0, 0, EXACT, [Member("&stop time = 1 /\n")]),
        case(lambda: 1 / 0, 0, EXACT),
        case(lambda: 2, 2, EXACT),
        case(lambda: 3, 2, within(0.5)),
    ]
    verdicts = list(validate(cases, program, tmp_path, jobs=1))
    assert [v.passed for v in verdicts] == [False, False, True, False]
    assert "ended with 2" in verdicts[0].problem and "species" in verdicts[0].problem
    assert "ZeroDivisionError" in verdicts[1].problem
    report.write(tmp_path / "deep" / "report", verdicts, "ricochet 0", 60.0)
    data = json.loads((tmp_path / "deep" / "report.json").read_text())
    assert [c["verdict"] for c in data["cases"]] == ["fail", "fail", "pass", "fail"]
    assert data["cases"][3]["error"] == 1 and data["cases"][0]["measured"] is None
    text = (tmp_path / "deep" / "report.md").read_text()
    assert text.count("**FAIL**") == 3 and "4 cases in 1.0 minutes" in text


def test_the_page_has_every_case_of_the_report_and_the_worst_value_of_each():
    data = json.loads((DOCS / "validation.json").read_text())
    page = (DOCS / "validation.md").read_text()
    assert page == report.markdown(data, report.statistics_tables(DOCS / "validation"))
    exact = [case for case in data["cases"] if report.is_rounding(case)]
    counted = sum(map(int, re.findall(r"\| (\d+) to rounding \|", page)))
    assert 40 < counted == len(exact) < 80
    main, _, rounding = page.partition("## Cases that agree to rounding")
    others = [case for case in data["cases"] if case not in exact]
    for name in {case["case"] for case in others}:
        worst = max((case for case in others if case["case"] == name), key=lambda c: c["used"])
        (row,) = [line for line in main.splitlines() if line.startswith(f"| {name} |")]
        assert row.endswith(f"| {report.number(worst['used'], 2)} |")
        assert report.source(worst["source"]) in row
    for case in exact:
        assert report.line(case["case"], case["what"], str(case["values"])).rstrip("|") in rounding


def test_sources_are_written_in_words():
    assert report.source("EX, eq. 7; D, R") == "exam, eq. 7; derived, reference program"
    found = {word for case in CASES for word in re.findall(r"\b[A-Z]{1,4}\b", case.source)}
    assert found - report.SOURCES.keys() <= {"B", "DSMC", "E", "J", "N"}, "unexplained words"


def test_other_seeds_give_other_runs(program, tmp_path):
    text = "&run\n  seed = 1\n/\n&species count = 5 radius = 0.05 speed = 1 /\n"
    text += "&stop collisions = 3 /\n"
    last = case(lambda run: run.time[-1], 0, within(9), [Member(text)])
    first, again, other = (
        next(validate([last], program, tmp_path / str(k), 1, shift)).measured
        for k, shift in enumerate((0, 0, 1))
    )
    assert first == again != other
