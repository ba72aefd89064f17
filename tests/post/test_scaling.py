"""Several cores: medians of equal runs, and what one core does alone bounds the gain."""

import numpy as np
import pytest
import scaling
from ricochet import RunError, read_run
from synthetic_run import write_run


@pytest.fixture
def runs(tmp_path):
    """Of 1 and 2 threads, 10, 12 and 20 s, and 6 s; the latter knows where the time went."""

    def run(threads, seconds):
        path = tmp_path / f"{threads}_{seconds}.h5"
        x = np.zeros((1, 3, 2))
        provenance = {"threads": threads, "wall_time": float(seconds)}
        return read_run(write_run(path, x, x, provenance=provenance))

    (tmp_path / "2_6.times").write_text(
        "start: reading, placing, checking          1.000 s   16.7 %\n"
        "* events in domains                        4.500 s   75.0 %\n"
        "waiting for other threads                  0.500 s    8.3 %\n"
        "cores and the best that they can gain: 4: 3.08\n"
    )
    return [run(1, 12), run(1, 10), run(1, 20), run(2, 6)]


def test_medians_are_compared_and_one_core_bounds_the_gain(runs):
    alone, two = scaling.rows(runs)
    assert alone["runs"] == 3 and alone["seconds"] == 12
    assert two["gain"] == pytest.approx(2)
    assert two["alone"] == pytest.approx(1 / (1 + 2 * 4.5))
    assert two["bound"] == pytest.approx(10 / (1 + 9 / 2))


def test_without_one_thread_there_is_nothing_to_compare_with(runs):
    with pytest.raises(RunError, match="one thread"):
        scaling.rows(runs[-1:])
