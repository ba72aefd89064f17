"""Test that the pages of the folders of src/ name the tests of every source."""

import shutil
from pathlib import Path

import pytest

from protecting_tests import protection_problems

ROOT = Path(__file__).resolve().parents[2]


def test_every_source_has_a_row_with_tests_that_use_it():
    assert list(protection_problems(ROOT)) == []


@pytest.mark.parametrize(
    ("page", "before", "after", "problem"),
    [
        ("base", "| `sorting` | `test_renumbering.pf` |", "|", "sorting.f90: its page names no"),
        ("base", "`sorting`", "`sorted`", "base/sorted.f90: there is no such file"),
        ("base", "test_renumbering.pf", "test_renumber.pf", "there is no test_renumber.pf"),
        ("base", "test_renumbering.pf", "test_random_stream.pf", "does not use it"),
        ("search", "`test_obstacle_cells.pf`", "", "test_obstacle_cells.pf: no page names it"),
    ],
)
def test_a_row_that_does_not_fit_is_found(tmp_path, page, before, after, problem):
    for name in ("src", "tests/unit", "tests/runs", "tests/post", "tests/support"):
        shutil.copytree(ROOT / name, tmp_path / name)
    path = tmp_path / "src" / page / "README.md"
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after))
    assert any(problem in line for line in protection_problems(tmp_path))
