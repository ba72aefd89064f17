"""The Makefile: folders, runners of unit tests, two at once, a linker that is not GNU's."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from whole_runs import PATIENCE

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
    out, err = process.communicate(timeout=PATIENCE)
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
        out, err = process.communicate(timeout=PATIENCE)
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


def ran(*command, **options) -> subprocess.CompletedProcess:
    return subprocess.run(
        list(map(str, command)), capture_output=True, text=True, timeout=PATIENCE, **options
    )


def files_in(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if not path.is_dir()]


def test_an_installed_program_and_its_scripts_run_from_anywhere(tmp_path):
    place = [f"DESTDIR={tmp_path / 'root'}", "PREFIX=/usr"]
    assert make("install", *place).returncode == 0
    installed = tmp_path / "root/usr"
    inputs = installed / "share/ricochet/input"
    ensemble = [installed / "bin/ricochet-ensemble", inputs / "lab.nml", "-d", "here"]
    environment = {name: value for name, value in os.environ.items() if name != "RICOCHET"}
    done = ran(*ensemble, "--seeds", "1,2", cwd=tmp_path, env=environment)
    assert done.returncode == 0, done.stderr
    script = installed / "share/ricochet/post/energy.py"
    done = ran(sys.executable, script, "here/seed_1.h5", "-o", "energy.png", cwd=tmp_path)
    assert done.returncode == 0 and (tmp_path / "energy.png").exists(), done.stderr
    assert make("uninstall", *place).returncode == 0
    assert files_in(tmp_path / "root") == []


def test_only_what_was_installed_goes(tmp_path):
    """Runs, notes and folders of users stay, and so does what a user puts where a file was."""
    prefix = tmp_path / "it's a folder"
    shared, place = prefix / "share/ricochet", f"PREFIX={prefix}"
    mine = [shared / name for name in ("runs/gas.h5", "input/mine.nml", "post/page/notes.txt")]

    def mine_are_there():
        return [path.read_text() for path in mine] == ["mine"] * len(mine)

    assert make("install", place).returncode == 0
    installed = set(files_in(prefix))
    for path in mine:
        path.parent.mkdir(exist_ok=True)
        path.write_text("mine")
    (prefix / "bin/other").touch()
    ran(sys.executable, shared / "post/energy.py", "--help")  # leaves __pycache__
    old = shared / "post/old/thing.py"
    old.parent.mkdir()
    old.write_text("of an earlier version")
    with (shared / "installed").open("a") as names:
        names.write("share/ricochet/post/old/thing.py\n")
    (shared / "input/gas.nml").unlink()
    assert make("install", place).returncode == 0
    assert installed < set(files_in(prefix)) and mine_are_there()
    assert not old.parent.exists()
    assert make("uninstall", place).returncode == 0
    assert set(files_in(prefix)) == {*mine, prefix / "bin/other"} and mine_are_there()
    assert not (shared / "post/ricochet").exists()


def test_a_file_that_no_install_has_listed_is_not_replaced(tmp_path):
    place = f"PREFIX={tmp_path}"
    (tmp_path / "bin").mkdir()
    program = tmp_path / "bin/ricochet"
    program.write_text("another program")
    for action in ("install", "uninstall"):
        done = make(action, place)
        assert done.returncode == 2 and len(done.stderr.splitlines()) == 2, done.stderr
        assert files_in(tmp_path) == [program] and program.read_text() == "another program"


def test_an_install_without_a_list_is_replaced_and_its_other_files_stay(tmp_path):
    """As earlier versions made them."""
    place, shared = f"PREFIX={tmp_path}", tmp_path / "share/ricochet"
    assert make("install", place).returncode == 0
    (shared / "installed").unlink()
    (shared / "input/gas.nml").write_text("of an earlier version")
    (shared / "runs").mkdir()
    (shared / "runs/gas.h5").write_text("mine")
    done = make("uninstall", place)
    assert done.returncode == 2 and str(shared / "installed") in done.stderr.splitlines()[0]
    done = make("install", place)
    assert done.returncode == 0 and "has left no list" in done.stdout
    assert "of an earlier version" not in (shared / "input/gas.nml").read_text()
    assert make("uninstall", place).returncode == 0
    assert files_in(tmp_path) == [shared / "runs/gas.h5"]


def test_a_program_that_is_older_than_its_source_is_not_installed(program, tmp_path):
    """Nor is another one built, perhaps with other options, in a folder of somebody else."""
    build, prefix = tmp_path / "build", tmp_path / "usr"
    build.mkdir()
    copy = shutil.copy(program, build)
    place = [f"BUILD={build}", f"PREFIX={prefix}"]
    os.utime(copy, (0, 0))
    done = make("install", *place)
    assert done.returncode == 2 and "is older than src/" in done.stderr.splitlines()[0]
    assert len(done.stderr.splitlines()) == 2 and not prefix.exists()
    os.utime(copy)
    assert make("install", *place).returncode == 0
    assert (prefix / "bin/ricochet").read_bytes() == program.read_bytes()
    assert files_in(build) == [Path(copy)]


def test_the_manual_page_explains_every_variable(tmp_path):
    assert make("install", f"PREFIX={tmp_path}").returncode == 0
    page = (tmp_path / "share/man/man1/ricochet.1").read_text().replace("\\-", "-")
    defaults = ran(tmp_path / "bin/ricochet", "--print-defaults").stdout
    group, missing = "", []
    for line in defaults.splitlines():
        if found := re.match(r"(?:! )?&(\w+)", line):
            group = found[1]
        elif (found := re.match(r"(?:! )?  (?:! )?(\w+) = ", line)) and (
            f"\n.B {group}.{found[1]}\n" not in page
        ):
            missing.append(f"{group}.{found[1]}")
    assert missing == [] and ".B run.seed\n" in page
    if shutil.which("man"):
        assert ran("man", "--warnings", "-l", tmp_path / "share/man/man1/ricochet.1").stderr == ""


def test_a_folder_that_cannot_be_installed_to_is_refused_in_one_line():
    done = make("install", "PREFIX=here")
    assert done.returncode == 2 and "write folders that begin with /" in done.stderr
    assert len(done.stderr.splitlines()) == 2  # the second is that of make


@pytest.mark.check
def test_a_release_builds_and_runs_without_git_and_names_its_commit(tmp_path):
    clone, commit = tmp_path / "clone", ran("git", "rev-parse", "HEAD", cwd=ROOT)
    if commit.returncode != 0:
        pytest.skip("not a git clone")
    ran("git", "clone", "--quiet", ROOT, clone, check=True)
    tarball = ran("make", "dist", cwd=clone, check=True).stdout.split()[-1]
    ran("tar", "-xzf", clone / tarball, "-C", tmp_path, check=True)
    release = next(tmp_path.glob("ricochet-*"))
    built = subprocess.run(["make", "-j2"], cwd=release, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    version = ran("build/ricochet", "--version", cwd=release).stdout
    named = re.search(r"commit: +(\w+)", version)[1]
    assert commit.stdout.startswith(named)
    done = ran("build/ricochet", "input/lab.nml", cwd=release)
    assert done.returncode == 0, done.stderr
