"""Tests of src/progress.sh, which shows the progress of long commands."""

import subprocess

from synthetic_run import ROOT


def shell(commands: str) -> subprocess.CompletedProcess:
    """Run shell commands that can use the functions of the script."""
    text = f". {ROOT}/src/progress.sh\n{commands}"
    return subprocess.run(["sh", "-c", text], capture_output=True, text=True, check=False)


def test_a_silent_command_shows_that_it_runs():
    done = shell("announce 'a long step' sleep 6")
    assert done.stdout == "a long step\n  ... 5 s\n" and done.returncode == 0


def test_the_status_and_the_output_of_a_command_are_kept():
    done = shell("announce step sh -c 'echo result; exit 3'")
    assert done.stdout == "step\nresult\n" and done.returncode == 3


def test_compilations_are_counted(tmp_path):
    listed = tmp_path / "progress"
    done = shell(f"count {listed} 3 compile a.f90; count {listed} 3 compile b.f90")
    assert done.stdout == "compile 1 of 3: a.f90\ncompile 2 of 3: b.f90\n"
    done = shell(f"count {listed} '' compile a.f90")
    assert done.stdout == "compile a.f90\n"
