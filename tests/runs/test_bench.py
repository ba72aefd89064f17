"""The gate on instructions per collision lets nothing through that it did not count."""

import os
import subprocess

import pytest

from synthetic_run import ROOT

VALGRIND = """#!/bin/sh
case "$* " in
*"stop.collisions=1 "*) echo "==1== Collected : 5000" >&2 ;;
*) echo "==1== Collected : $((100000 * {} + 5000))" >&2 ;;
esac
"""


@pytest.mark.parametrize(("per_collision", "code"), [(2080, 0), (2120, 1), (0, 1)])
def test_the_gate_on_instructions(program, tmp_path, per_collision, code):
    (tmp_path / "valgrind").write_text(VALGRIND.format(per_collision))
    (tmp_path / "valgrind").chmod(0o755)
    path = f"{tmp_path}:{os.environ['PATH']}"
    gate = subprocess.run(
        ["runs/bench.sh", "--check"],
        cwd=ROOT,
        env={**os.environ, "RICOCHET": str(program), "PATH": path},
        capture_output=True,
        text=True,
    )
    assert gate.returncode == code, gate.stderr
    assert f"packing 0.5: {per_collision} instructions per collision" in gate.stdout
