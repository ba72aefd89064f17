"""The Makefile: folders, runners of unit tests, two at once, a linker that is not GNU's."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PFUNIT_DIR = os.environ.get("PFUNIT_DIR", "")
SUITE = """module test_it
  use funit
contains
  @test
  subroutine works()
    @assertEqual(1, {})
  end subroutine works
end module test_it
"""


def started(*arguments) -> subprocess.Popen:
    environment = {name: value for name, value in os.environ.items() if "MAKE" not in name}
    return subprocess.Popen(
        ["make", *map(str, arguments)],
        cwd=ROOT,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def make(*arguments) -> subprocess.CompletedProcess:
    process = started(*arguments)
    out, err = process.communicate(timeout=120)
    return subprocess.CompletedProcess(arguments, process.returncode, out, err)


@pytest.fixture
def small(tmp_path) -> list[str]:
    """Arguments of `make unit-tests` for a program with one test and no module of ours."""
    suites = tmp_path / "suites"
    suites.mkdir()
    (suites / "test_it.pf").write_text(SUITE.format(1))
    build = f"BUILD={tmp_path / 'build'}"
    shared = "shared=tests/support/funit.f90"
    return ["unit-tests", "DEBUG=1", "sources=", shared, f"suites={suites}", build, "PFUNIT_DIR="]


def test_two_at_once_in_one_folder_both_succeed(small):
    makes = [started(*small) for _ in range(4)]
    for process in makes:
        out, err = process.communicate(timeout=120)
        assert process.returncode == 0 and " OK" in out and err == "", out + err


def test_what_did_not_change_is_not_built_again(small, tmp_path):
    assert "link" in make(*small).stdout
    assert "link" not in make(*small).stdout
    (tmp_path / "suites" / "test_it.pf").write_text(SUITE.format(2))
    again = make(*small)
    assert again.returncode == 2 and "Failures: 1" in again.stdout


@pytest.mark.skipif(not PFUNIT_DIR, reason="PFUNIT_DIR names no pFUnit")
def test_runners_take_turns_in_one_folder(small, tmp_path):
    """Each runs what is there now, not what the other has left."""
    real = [*[word for word in small if not word.startswith(("shared", "PFUNIT"))]]
    real += ["shared=", f"PFUNIT_DIR={PFUNIT_DIR}"]
    for value, status in ((1, 0), (2, 2), (1, 0)):
        (tmp_path / "suites" / "test_it.pf").write_text(SUITE.format(value))
        for arguments in (small, real):
            run = make(*arguments)
            assert run.returncode == status, run.stdout + run.stderr


def test_without_hints_about_memory_nothing_of_them_is_left(small, tmp_path):
    program = tmp_path / "build" / "substitute" / ".." / "unit_tests"
    for hints, wraps in (([], True), (["HINTS="], False), ([], True)):
        run = make(*small, *hints)
        assert run.returncode == 0, run.stderr
        names = subprocess.run(["nm", program], capture_output=True, text=True, check=True).stdout
        assert ("wrap_malloc" in names) == wraps


def test_a_linker_that_cannot_redirect_gets_no_hints(small, tmp_path):
    """A stand-in for one: it refuses the option as others do."""
    compiler = tmp_path / "gfortran"
    refusal = 'case "$*" in *--wrap*) echo unknown option: --wrap >&2; exit 1;; esac'
    compiler.write_text(f'#!/bin/sh\n{refusal}\nexec gfortran "$@"\n')
    compiler.chmod(0o755)
    run = make(*small, f"FC={compiler}")
    assert run.returncode == 0 and run.stderr == "", run.stderr


def test_a_wrong_pfunit_folder_is_named_and_harms_nothing_else(tmp_path):
    wrong = make("unit-tests", f"BUILD={tmp_path}", "PFUNIT_DIR=nowhere")
    assert wrong.returncode == 2
    assert "PFUNIT_DIR=nowhere: no pFUnit is installed there" in wrong.stderr
    assert len(wrong.stderr.splitlines()) == 1
    assert make("help", "PFUNIT_DIR=nowhere").returncode == 0


def test_a_folder_that_cannot_be_written_is_named():
    run = make("BUILD=/proc/build")
    assert run.returncode == 2
    assert run.stderr.splitlines()[0] == "Cannot write to /proc/build; BUILD=folder takes another"
    assert len(run.stderr.splitlines()) == 2  # and what `make` itself says
