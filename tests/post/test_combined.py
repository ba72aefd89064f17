"""Runs that analyses combine although they differ in more than their seed."""

from types import SimpleNamespace

import ricochet
from ricochet.reports import analysis
from ricochet.reports.groups import differences
from synthetic_gases import cooled, gas


def with_parameter(run, group, name, value):
    """Return a run with another value of a parameter."""
    run.parameters.setdefault(group, {})[name] = value
    return run


def test_runs_that_differ_in_physics_are_combined_with_a_warning(tmp_path, rng):
    """Seed, title, output and stop condition do not count as physics."""
    same = [ricochet.read_run(gas(tmp_path / f"{k}.h5", rng)) for k in range(2)]
    for group, name in (("run", "title"), ("stop", "events"), ("output", "precision")):
        for k, run in enumerate(same):
            with_parameter(run, group, name, f"{name} {k}")
    assert not differences([same])
    for k, run in enumerate(same):
        with_parameter(run, "contact", "wall_rule", ("normal", "velocity")[k])
    told = "combined although contact.wall_rule differs: normal, velocity"
    assert differences([same]) == [told]
    assert not differences([[run] for run in same]), "each is analysed alone"
    assert not differences([same], ["contact"]) and not differences([same], ["wall_rule"])
    assert told in ricochet.analyse("speeds", same).warnings


def test_curves_of_two_wall_rules_are_drawn_apart(tmp_path):
    """The title, the rows of the table and the columns of the data name both."""
    runs = [ricochet.read_run(cooled(tmp_path / f"{k}.h5", 0.9, 0.1, seed=k)) for k in range(4)]
    for k, run in enumerate(runs):
        run.periodic[:] = False
        with_parameter(run, "contact", "wall_rule", ("normal", "velocity")[k % 2])
    result = analysis("cooling").result(runs, SimpleNamespace())
    assert [row["wall_rule"] for row in result.table] == ["normal", "velocity"]
    assert [row["runs"] for row in result.table] == [2, 2]
    assert not any("combined although" in text for text in result.warnings)
    assert "wall rules: normal, velocity" in result.draw(result).title
    alone = analysis("cooling").result(runs[::2], SimpleNamespace())
    assert "wall_rule" not in alone.table[0] and "wall rule: normal" in alone.draw(alone).title
