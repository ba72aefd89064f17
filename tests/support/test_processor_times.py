"""Tests of the list of the slowest tests that pytest prints at the end."""

import re
import sys
from pathlib import Path

import pytest

from whole_runs import environment, ran

TESTS = Path(__file__).resolve().parents[1]
WORK = "import os\nwhile sum(os.times()[:2]) < 0.5: pass"
FILE = f"""import subprocess, sys, pytest
@pytest.mark.parametrize("number", range(12))
def test_that_waits_for_a_child(number):
    if number == 7:
        subprocess.run([sys.executable, "-c", {WORK!r}], check=True)
"""


@pytest.mark.parametrize("workers", ["-n0", "-n1"])
def test_the_time_of_a_child_counts_and_the_last_line_is_that_of_pytest(tmp_path, workers):
    (tmp_path / "test_a.py").write_text(FILE)
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    (tmp_path / "conftest.py").write_text((TESTS / "conftest.py").read_text())
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", workers]
    own = environment(PYTHONPATH=TESTS)
    lines = ran(*command, cwd=tmp_path, env=own).stdout.splitlines()
    (title,) = (k for k, line in enumerate(lines) if line.startswith("slowest of 12 tests"))
    used, name = re.fullmatch(r" +([\d.]+) s  (\S+)", lines[title + 1]).groups()
    assert name == "test_a.py::test_that_waits_for_a_child[7]" and 0.4 <= float(used) < 5
    assert len(lines) > title + 11 and re.match(r"12 passed in", lines[-1])
