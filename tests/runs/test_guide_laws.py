"""Laws that the results of the Python examples in the guides must obey."""

import re

import numpy as np
import pytest

from synthetic_run import ROOT


def carried_out(guide, *headings):
    """Execute the Python examples in sections of a guide; return their variables."""
    text = (ROOT / "docs" / "guides" / f"{guide}.md").read_text()
    variables: dict = {}
    for heading in headings:
        section = text.partition(f"\n{heading}\n")[2].partition("\n## ")[0]
        exec("".join(re.findall(r"```python\n(.*?)```", section, re.S)), variables)
    return variables


def test_two_disks_meet_again_only_after_collisions_with_others():
    found = carried_out("functions-of-events", "## How soon the same disks collide again")
    between, met = found["between"], found["met"]
    assert min(between) == 1 and between.total() + len(met) == 20000
    assert sum(found["collisions"].values()) == 2 * 20000
    assert 0.3 < sum(between[k] for k in range(5)) / 20000 < 0.5


def test_a_simulation_stops_when_the_tracer_reaches_the_side():
    found = carried_out("functions-of-events", "## A stop at a chosen event")
    times = found["times"]
    assert len(set(times)) == 20 and max(times) < 1000
    assert min(times) > (1 - 0.03) / 10  # the distance at ten times the thermal velocity


def test_a_thermostat_at_collisions_sets_the_temperature_and_conserves_momentum():
    found = carried_out("functions-of-events", "## A thermostat that acts at collisions")
    box, kt = found["box"], []
    for _ in range(60):
        box.advance_by(collisions=50, on_event=found["redraw"])
        kt.append(box.observable("all/temperature") / (1 - 1 / box.n_disks))
    assert np.mean(kt) == pytest.approx(1, abs=0.08)  # five standard errors
    assert box.observable("momentum") == pytest.approx(np.zeros(2), abs=1e-11)


def test_the_event_log_of_a_stadium_contains_its_lyapunov_exponent(monkeypatch):
    """The exponent of 20000 collisions differs from the published 0.43 by a few per cent."""
    monkeypatch.chdir(ROOT)
    found = carried_out("billiards", "## Stadium and mushroom")
    log = found["log"]
    assert abs(found["growth"] / (log.time[-1] - log.time[0]) - 0.43) < 0.02
    assert abs(found["path"].mean - found["expected"]) < 5 * found["path"].error < 0.1


def test_the_poincare_section_of_a_chaotic_billiard_is_covered_uniformly():
    """The area dx dv_x of the section is invariant: its means have 20 % more than shot noise."""
    found = carried_out("functions-of-events", "## A Poincaré section")
    x, v = found["section"].T
    assert len(x) >= 2000 and x.min() >= 0.01 and x.max() <= 0.99
    assert x.mean() == pytest.approx(0.5, abs=0.04)
    assert (v**2).mean() == pytest.approx(1 / 3, abs=0.04)
    counts = np.histogram2d(x, v, bins=4, range=[[0.01, 0.99], [-1, 1]])[0]
    assert counts.min() > 0.6 * len(x) / 16 and counts.max() < 1.4 * len(x) / 16


def test_a_simulation_stops_exactly_when_a_disk_enters_a_region():
    headings = "## A stop at a chosen event", "## A stop when a disk enters a region"
    found = carried_out("functions-of-events", *headings)
    arrivals = found["arrivals"]
    assert len(set(arrivals)) == 20 and max(arrivals) < 1000
    assert np.mean(arrivals) < np.mean(found["times"])  # the strip is in front of the side
