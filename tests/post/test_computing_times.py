"""Computing times: the scripts cost and scaling."""

import numpy as np
import pytest

from ricochet.reports.program import cost
import ricochet
from ricochet.reports.program import scaling
from ricochet import RunError, read_run
from ricochet.figures.drawing import plt
from synthetic_run import drawn, write_run


def timed(path, count=3, search="cells", **provenance):
    """Write a run with a recorded wall time."""
    x = np.zeros((1, count, 2))
    return write_run(path, x, x, parameters={"run": {"search": search}}, provenance=provenance)


def test_the_legend_of_the_cost_names_each_method_once(tmp_path):
    runs = [
        read_run(timed(tmp_path / f"{name}.h5", 9, name, collisions_per_second=1e5))
        for name in cost.LABELS
    ]
    figure = ricochet.analyse("cost", runs).figure()
    texts = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert [text.partition(": ")[0] for text in texts] == [*cost.LABELS]
    assert [name for name, text in cost.LABELS.items() if text.startswith(f"{name}:")] == []
    plt.close(figure)


def test_cost_takes_the_best_of_equal_runs_and_fits_a_power(tmp_path):
    kinds = [("pairs", 20, 1e5), ("pairs", 10, 1e5), ("pairs", 10, 2e5), ("cells", 10, 1e6)]
    runs = [
        read_run(timed(tmp_path / f"{k}.h5", n, search, collisions_per_second=rate))
        for k, (search, n, rate) in enumerate(kinds)
    ]
    drawn(tmp_path, "cost", *(run.path for run in runs))
    for option, lines in (((1, 15), False), ((5, 40), True)):
        more = [read_run(timed(tmp_path / "40.h5", 40, "pairs", collisions_per_second=4e4))]
        notes = ricochet.analyse("cost", [*runs, *more], fit=option).notes
        assert any("fits" in note for note in notes) == lines
    measured = cost.costs(runs)
    np.testing.assert_allclose(measured["pairs"], [[10, 20], [5, 10]])
    np.testing.assert_allclose(measured["cells"], [[10], [1]])
    n = np.array([16, 128, 256, 512, 1024])
    measured = {"rescan": (n, np.where(n == 16, 9, 3e-3 * n**1.9)), "cells": (n[:3], n[:3])}
    laws = cost.fits(measured, 128, 1e4)
    assert laws["rescan"].exponent == pytest.approx(1.9) and "cells" not in laws
    assert laws["rescan"].factor == pytest.approx(3e-3)
    bent = cost.fits({"pairs": (n, n * np.array([1, 1, 1.1, 1, 1.1]))}, 16, 1e4)["pairs"]
    assert 0 < abs(bent.exponent - 1) < 2 * bent.exponent_error < 0.1


def test_several_cores_are_compared_with_one_by_medians(tmp_path):
    times = [(1, 12.0), (1, 10.0), (1, 20.0), (2, 6.0)]
    runs = [read_run(timed(tmp_path / f"{n}_{t}.h5", threads=n, wall_time=t)) for n, t in times]
    drawn(tmp_path, "scaling", *(run.path for run in runs))
    alone, two = scaling.table(runs)
    assert alone["runs"] == 3 and alone["seconds"] == 12 and two["gain"] == pytest.approx(2)
    with pytest.raises(RunError, match="one thread"):
        scaling.table(runs[-1:])
