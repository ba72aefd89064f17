"""Tests of the Makefile: folders, simultaneous unit tests, other linkers, and installation."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import venv
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from whole_runs import environment, executable, ran

ROOT = Path(__file__).resolve().parents[2]
#: Files that the documentation mentions but that exist only in the source tree, because they are
#: not installed.
SOURCES = {"src", "post", "runs", "tests", "CONTRIBUTING.md", "Containerfile"}
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


def make(*arguments, **more) -> subprocess.CompletedProcess:
    return ran("make", *arguments, cwd=ROOT, env=environment(**more))


@pytest.fixture
def small(tmp_path) -> list[str]:
    """Return arguments of `make unit-tests` for one test that uses no module of the project."""
    suites = tmp_path / "suites"
    suites.mkdir()
    (suites / "test_it.pf").write_text(SUITE.format(1))
    build = f"BUILD={tmp_path / 'build'}"
    shared = "shared=tests/support/funit.f90"
    return ["unit-tests", "DEBUG=1", "sources=", shared, f"suites={suites}", build, "PFUNIT_DIR="]


@pytest.mark.skipif(not shutil.which("objdump"), reason="objdump is not installed")
def test_a_prefetch_of_the_event_loop_is_an_instruction(program):
    """If a prefetch is a function call, simulations of 1e5 disks are slower by 30 %."""
    event_loop = program.parent / "event_loop.o"
    if not event_loop.exists():
        pytest.skip("this compiler cannot make one object of the event loop")
    relocations = ran("objdump", "-r", event_loop, check=True).stdout
    assert "malloc" in relocations and "prefetch_" not in relocations


def test_two_at_once_in_one_folder_both_succeed(small):
    with ThreadPoolExecutor(4) as pool:
        for done in pool.map(lambda _: make(*small), range(4)):
            assert done.returncode == 0 and " OK" in done.stdout and done.stderr == "", done


def test_a_build_that_is_killed_while_it_links_is_finished_by_the_next(small, tmp_path):
    """The next build must link the program again."""
    script = """case "$*" in
*" -o "*/unit_tests*)
  printf '' > "$(echo "$*" | sed 's/.* -o \\([^ ]*\\) .*/\\1/')"
  pid=$PPID builders=
  while grep -qE '^(sh|make|flock)$' /proc/$pid/comm; do
    builders="$pid $builders"
    pid=$(cut -d ' ' -f 4 /proc/$pid/stat)
  done
  kill -KILL $builders ;; # the first of them first, so that it sees no other end
*) exec gfortran "$@" ;;
esac"""
    compiler = tmp_path / "link"
    compiler.symlink_to(executable(tmp_path / "compiler", script))
    assert make(*small, f"FC={compiler}").returncode == -signal.SIGKILL
    compiler.unlink()
    compiler.symlink_to(shutil.which("gfortran"))
    again = make(*small, f"FC={compiler}")
    assert again.returncode == 0 and " OK" in again.stdout, again.stdout + again.stderr


@pytest.mark.skipif(not PFUNIT_DIR, reason="PFUNIT_DIR names no pFUnit")
def test_runners_take_turns_in_one_folder(small, tmp_path):
    """Of two test runners in the same folder, each must execute its own program."""
    real = [*[word for word in small if not word.startswith(("shared", "PFUNIT"))]]
    real += ["shared=", f"PFUNIT_DIR={PFUNIT_DIR}"]
    for value, status in ((1, 0), (2, 2), (1, 0)):
        (tmp_path / "suites" / "test_it.pf").write_text(SUITE.format(value))
        for arguments in (small, real):
            run = make(*arguments)
            assert run.returncode == status, run.stdout + run.stderr


def test_a_linker_that_cannot_redirect_gets_no_hints(small, tmp_path):
    """A script replaces the linker and refuses an option, as some linkers do."""
    refusal = 'case "$*" in *--wrap*) echo unknown option: --wrap >&2; exit 1;; esac'
    compiler = executable(tmp_path / "gfortran", f'{refusal}\nexec gfortran "$@"')
    run = make(*small, f"FC={compiler}")
    assert run.returncode == 0 and run.stderr == "", run.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["unit-tests", "PFUNIT_DIR=nowhere", "BUILD={}"],
            "PFUNIT_DIR=nowhere: no pFUnit is installed there",
        ),
        (
            ["unit-tests", "tests=tests/unit/test_no.pf", "BUILD={}"],
            "tests/unit/test_no.pf: is no file with unit tests; they are in tests/unit/test_*.pf",
        ),
        (
            ["unit-tests", "tests=test_observables", "BUILD={}"],
            "is no file with unit tests; did you mean tests/unit/test_observables.pf",
        ),
        (["tests"], "There is no target tests; did you mean test? (make help lists the targets)"),
        (["buidl"], "There is no target and no file buidl (make help lists the targets)"),
        (["BUILD=/proc/build"], "Cannot write to /proc/build; BUILD=folder takes another"),
        (["install", "PREFIX=here"], "write folders that begin with /"),
        (["film"], "make film INPUT=input/crater.nml"),
    ],
)
def test_what_cannot_be_made_is_refused_in_one_line(tmp_path, arguments, words):
    done = make(*(word.format(tmp_path) for word in arguments))
    first, *more = done.stderr.splitlines()
    assert done.returncode == 2 and words in first, done.stderr
    assert all(line.startswith("make") for line in more) and len(more) < 2


def files_in(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if not path.is_dir()]


def test_a_film_takes_one_command(program, tmp_path):
    (tmp_path / "my gas.nml").write_text(
        "&species count = 20 radius = 0.01 temperature = 1 /\n&stop time = 9e9 /\n"
    )
    browser, film = executable(tmp_path / "browse", 'echo "$1" > "$0.txt"'), tmp_path / "films"
    choices = [f"INPUT={tmp_path}/my gas.nml", f"FILM={film}", "SET=stop.time=1 output.event_log=T"]
    done = make("film", f"BUILD={program.parent}", *choices, BROWSER=browser)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "browse.txt").read_text().strip() == (film / "my gas.html").as_uri()


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Yield a folder with all installed files, and uninstall them afterwards."""
    root = tmp_path_factory.mktemp("root")
    place = [f"DESTDIR={root}", "PREFIX=/usr"]
    assert make("install", *place).returncode == 0
    yield root / "usr"
    assert make("uninstall", *place).returncode == 0
    assert files_in(root) == [] and not (root / "usr/share/doc/ricochet").exists()


def test_an_installed_program_and_its_scripts_run_from_anywhere(installed, tmp_path):
    inputs = installed / "share/ricochet/input"
    ensemble = [installed / "bin/ricochet-ensemble", inputs / "lab.nml", "-d", "here"]
    own = {name: value for name, value in os.environ.items() if name != "RICOCHET"}
    done = ran(*ensemble, "--seeds", "1,2", cwd=tmp_path, env=own)
    assert done.returncode == 0, done.stderr
    script = installed / "share/ricochet/post/energy.py"
    done = ran(sys.executable, script, "here/seed_1.h5", "-o", "energy.png", cwd=tmp_path)
    assert done.returncode == 0 and (tmp_path / "energy.png").exists(), done.stderr
    own["PATH"] = f"{Path(sys.executable).parent}:{own['PATH']}"
    done = ran(installed / "bin/ricochet-lab", "--help", cwd=tmp_path, env=own)
    assert done.returncode == 0 and "--no-open" in done.stdout, done.stderr


def test_an_installed_engine_is_found_by_its_module(installed, tmp_path):
    """The settings of the modulefile suffice for C programs and for the Python package."""
    (module,) = (installed / "share/modulefiles/ricochet").iterdir()
    told = dict(re.findall(r"^prepend-path (\w+) {(.+)}$", module.read_text(), re.MULTILINE))
    assert module.read_text().startswith("#%Module") and told["PATH"] == "/usr/bin"
    if not (installed / "lib/libricochet.so").exists():
        pytest.skip("make library builds it")
    assert (installed / "include/ricochet.h").exists()
    place = told["PYTHONPATH"].replace("/usr", str(installed), 1)
    code = "import ricochet; print(ricochet.Simulation('&species radius = .1 count = 2 /').n_disks)"
    own = environment(PYTHONPATH=place)
    own.pop("RICOCHET_LIBRARY", None)
    done = ran(sys.executable, "-c", code, cwd=tmp_path, env=own)
    assert (done.returncode, done.stdout.strip()) == (0, "2"), done.stderr


def test_who_installs_for_others_is_told_that_the_program_is_for_this_processor(tmp_path, program):
    build = tmp_path / "build"
    build.mkdir()
    shutil.copy(program, build)
    place = [f"BUILD={build}", f"PREFIX={tmp_path}/usr"]
    for flags, said in (("-march=native", True), ("-march=x86-64-v3", False)):
        (build / "flags").write_text(f"gfortran -O2 {flags}\n")
        done = make("install", *place)
        assert done.returncode == 0
        assert ("ARCH=x86-64-v3" in done.stderr) == said and len(done.stderr.splitlines()) == said


def test_only_what_was_installed_goes(tmp_path):
    """Installing and uninstalling leave other programs, and files and folders of users, unchanged.

    Several installations of 250 files take 5 to 7 s.
    """
    prefix = tmp_path / "it's a folder"
    shared, place, program = prefix / "share/ricochet", f"PREFIX={prefix}", prefix / "bin/ricochet"
    program.parent.mkdir(parents=True)
    program.write_text("another program")
    for action in ("install", "uninstall"):
        done = make(action, place)
        assert done.returncode == 2 and len(done.stderr.splitlines()) == 2, done.stderr
        assert files_in(prefix) == [program] and program.read_text() == "another program"
    program.unlink()
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
    (shared / "installed").unlink()  # the first versions left no such file
    (shared / "input/gas.nml").write_text("of an earlier version")
    done = make("uninstall", place)
    assert done.returncode == 2 and str(shared / "installed") in done.stderr.splitlines()[0]
    done = make("install", place)
    assert done.returncode == 0 and "has left no list" in done.stdout
    assert "of an earlier version" not in (shared / "input/gas.nml").read_text()
    assert make("uninstall", place).returncode == 0
    assert set(files_in(prefix)) == {*mine, prefix / "bin/other"} and mine_are_there()
    assert not (shared / "post/ricochet").exists()


def test_a_program_that_is_older_than_its_source_is_not_installed(program, tmp_path):
    """An outdated program is neither installed nor rebuilt.

    It is not rebuilt because the folder may belong to another user.
    """
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


def test_what_the_manual_pages_speak_of_is_installed(installed):
    """All paths in the manual pages are absolute, and each page is named like its command."""
    pages = sorted(path.name for path in (installed / "share/man/man1").iterdir())
    assert pages == ["ricochet-ensemble.1", "ricochet.1"]
    version = ran(installed / "bin/ricochet", "--version").stdout.split()[1]
    for name in pages:
        page = installed / "share/man/man1" / name
        text = page.read_text().replace("\\-", "-")
        assert f'"Ricochet {version}"' in text and f".SH NAME\n{page.stem} - " in text
        named = set(re.findall(r"(?<![\w/])/usr/[\w./-]*\w", text))
        assert len(named) >= 3
        assert [name for name in named if not (installed.parent / name[1:]).exists()] == []
        assert not re.search(r"(?<![\w/])(input|post|docs|share)/", text)
        commands = re.findall(r"\bricochet-\w[\w-]*", text)
        assert [name for name in commands if not (installed / "bin" / name).exists()] == []
        if shutil.which("man"):
            assert ran("man", "--warnings", "-l", page).stderr == ""
    table = json.loads(ran(installed / "bin/ricochet", "--print-variables").stdout)
    shared = table["side"].keys() & table["wall"].keys() & table["obstacle"].keys() - {"name"}
    walls = ("side", "wall", "obstacle")
    named = [
        name if group in walls and name in shared else f"{group}.{name}"
        for group in table
        for name in table[group]
    ]
    page = (installed / "share/man/man1/ricochet.1").read_text().replace("\\-", "-")
    assert "run.seed" in named and [name for name in named if f"\n.B {name}\n" not in page] == []
    assert (installed / "share/doc/ricochet/LICENSE").exists()
    links = [
        (page, link)
        for page in (installed / "share/doc/ricochet").rglob("*.md")
        for link in re.findall(r"\]\((?!\w+:|#)([^)\s#]+)", page.read_text())
    ]
    lost = {link for page, link in links if not (page.parent / link).exists()}
    assert {re.sub(r"^(\.\./)+", "", link).split("/")[0] for link in lost} <= SOURCES


@pytest.mark.check
def test_pip_brings_program_library_package_commands_and_inputs(tmp_path):
    """The new environment uses packages of the present one and needs no network."""
    own = tmp_path / "venv"
    venv.create(own, symlinks=True)
    python = own / "bin/python"
    (packages,) = own.glob("lib/python*/site-packages")
    (packages / "others.pth").write_text(sysconfig.get_path("purelib"))
    alone = ["--no-deps", "--no-index", "--no-build-isolation", "--quiet"]
    pip = [sys.executable, "-m", "pip", "--python", python, "install", *alone]
    ran(*pip, ROOT, check=True)
    commands = {path.name for path in (own / "bin").glob("ricochet-*")}
    scripts = {path.stem for path in ROOT.glob("post/*.py")} | {"ensemble"}
    assert commands == {f"ricochet-{name.replace('_', '-')}" for name in scripts}
    inputs = packages / "ricochet/input"
    code = "from ricochet import Simulation, simulation; print(simulation.__file__)"
    code += f"; Simulation('{inputs}/lab.nml').advance(events=9).save('saved.h5')"
    assert ran(python, "-c", code, cwd=tmp_path, check=True).stdout.startswith(str(packages))
    done = ran(own / "bin/ricochet", inputs / "lab.nml", "-o", "lab.h5", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    done = ran(own / "bin/ricochet-player", "lab.h5", "-o", "lab.html", cwd=tmp_path)
    assert done.returncode == 0 and (tmp_path / "lab.html").exists(), done.stderr
    sweep = [own / "bin/ricochet-ensemble", inputs / "lab.nml", "-d", "sweep", "--seeds", "1-2"]
    alone = {name: value for name, value in environment().items() if name != "RICOCHET"}
    done = ran(*sweep, cwd=tmp_path, env=alone)
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in tmp_path.glob("sweep/*.h5")) == ["seed_1.h5", "seed_2.h5"]


@pytest.mark.parametrize("script", [".ci/set-up", "src/install.sh", "runs/ensemble.sh"])
def test_scripts_that_need_a_later_bash_say_so(tmp_path, script):
    """A script stops at once if the version of bash is too old."""
    text = (ROOT / script).read_text()
    limit = re.search(r"BASH_VERSINFO.*>= (404)\b", text).span(1)
    copy = tmp_path / "script"
    copy.write_text(f"{text[: limit[0]]}99999{text[limit[1] :]}")
    done = ran("bash", copy, cwd=tmp_path)
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1
    assert "bash 4.4 or newer is needed" in done.stderr


def test_the_first_h5fc_that_compiles_is_taken(tmp_path):
    """The h5fc of conda may name a compiler that is not installed."""
    system = shutil.which("h5fc", path="/usr/bin")
    if not system:
        pytest.skip("the system has no h5fc")
    executable(tmp_path / "h5fc", "echo x86_64-conda-linux-gnu-gfortran; exit 127", "sh")
    finder, path = ROOT / "src/find_h5fc.sh", os.environ["PATH"]
    found = ran(finder, env=environment(PATH=f"{tmp_path}:{path}"))
    assert (found.returncode, found.stdout) == (0, f"{system}\n")
    executable(tmp_path / "h5fc", f'exec {system} "$@"', "sh")
    found = ran(finder, env=environment(PATH=f"{tmp_path}:{path}"))
    assert (found.returncode, found.stdout) == (0, f"{tmp_path}/h5fc\n")


def test_an_old_python_is_told_before_anything_is_installed(tmp_path):
    """Otherwise the user would be asked for a password in vain."""
    (tmp_path / ".ci").mkdir()
    (tmp_path / "bin").mkdir()
    (tmp_path / "src").mkdir()
    for file in (".ci/set-up", "src/progress.sh"):
        shutil.copy(ROOT / file, tmp_path / file)
    old = """case "$*" in --version) echo Python 3.10.12 ;; *) exit 1 ;; esac"""
    executable(tmp_path / "bin/python3", old, "sh")
    for name in ("apt-get", "sudo"):
        executable(tmp_path / "bin" / name, f"touch '{tmp_path}/asked'", "sh")
    path = f"{tmp_path}/bin:{os.environ['PATH']}"
    done = ran(tmp_path / ".ci/set-up", "demo", env=environment(PATH=path))
    assert done.returncode == 1 and "Python 3.11 or newer is needed" in done.stderr
    assert "3.10.12" in done.stderr and not (tmp_path / "asked").exists()


#: Programs with which .ci/set-up works, without gfortran, h5fc and sudo.
FEW_TOOLS = "awk bash cat cmp dirname env grep head mkdir mktemp mv rm sed sh sort tail"


@pytest.mark.parametrize("apt", [True, False])
def test_who_cannot_install_packages_is_told_which_are_missing(tmp_path, apt):
    """Neither a missing sudo nor a system other than Debian leads to a message of the shell."""
    (tmp_path / "bin").mkdir()
    for folder in (".ci", "src"):
        (tmp_path / folder).mkdir()
    for file in (".ci/set-up", "src/progress.sh", "src/find_h5fc.sh"):
        shutil.copy(ROOT / file, tmp_path / file)
    for name in FEW_TOOLS.split():
        (tmp_path / "bin" / name).symlink_to(shutil.which(name))
    executable(tmp_path / "bin/id", "echo 1000", "sh")
    executable(tmp_path / "bin/python3", "exit 0", "sh")
    if apt:
        executable(tmp_path / "bin/apt-get", f"touch '{tmp_path}/asked'", "sh")
    done = ran(tmp_path / ".ci/set-up", "demo", env=environment(PATH=f"{tmp_path}/bin"))
    words = "please run as root: apt-get install " if apt else "please install (names as in Debian"
    assert done.returncode == 1 and not (tmp_path / "asked").exists()
    assert done.stderr.startswith(f"set-up: {words}") and "gfortran" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_linker_without_version_scripts_makes_the_library(tmp_path):
    """Its flags are left out; the names of the C interface remain visible."""
    refusing = 'case "$*" in *version-script*) exit 1 ;; esac; exec gfortran "$@"'
    fc, build = executable(tmp_path / "fc", refusing, "bash"), tmp_path / "build"
    make(f"FC={fc}", f"BUILD={build}", f"{build}/hints.mk")
    assert "EXPORTS ?=\n" in (build / "hints.mk").read_text()
    make(f"BUILD={tmp_path / 'gnu'}", f"{tmp_path / 'gnu'}/hints.mk")
    assert "EXPORTS ?= 1\n" in (tmp_path / "gnu/hints.mk").read_text()


@pytest.mark.check
def test_a_release_builds_and_runs_without_git_and_names_its_commit(tmp_path):
    clone, commit = tmp_path / "clone", ran("git", "rev-parse", "HEAD", cwd=ROOT)
    if commit.returncode != 0:
        pytest.skip("not a git clone")
    ran("git", "clone", "--quiet", ROOT, clone, check=True)
    tarball = ran("make", "dist", cwd=clone, check=True).stdout.split()[-1]
    ran("tar", "-xzf", clone / tarball, "-C", tmp_path, check=True)
    release = next(tmp_path.glob("ricochet-*"))
    built = ran("make", "-j2", cwd=release)
    assert built.returncode == 0, built.stderr
    version = ran("build/ricochet", "--version", cwd=release).stdout
    named = re.search(r"commit: +(\w+)", version)[1]
    assert commit.stdout.startswith(named)
    done = ran("build/ricochet", "input/lab.nml", cwd=release)
    assert done.returncode == 0, done.stderr
