"""Tests of the test tools: the substitute for pFUnit, its runner, and the style rules."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SUPPORT = ROOT / "tests" / "support"
sys.path.insert(0, str(SUPPORT))

from check_style import problems_of  # noqa: E402
from translate_pf import Refused, translate  # noqa: E402

from whole_runs import choose_build, environment, executable, ran, with_parent  # noqa: E402

RUNNERS = ["", os.environ["PFUNIT_DIR"]] if os.environ.get("PFUNIT_DIR") else [""]
FILE = """module test_it
  use funit
contains
  @test
  subroutine works()
    {}
  end subroutine works
end module test_it
"""


VERDICTS = """module test_verdicts
  use, intrinsic :: ieee_arithmetic, only: ieee_positive_inf, ieee_value
  use, intrinsic :: iso_fortran_env, only: int64, real64
  use funit
  implicit none
  real(real64), parameter :: matrix(2, 2) = reshape(1.0_real64*[1, 2, 3, 4], [2, 2])
  integer :: prepared = 0
contains
  @before
  subroutine prepare()
    prepared = prepared + 1
  end subroutine prepare
  @after
  subroutine tidy_up()
    prepared = prepared - 1
  end subroutine tidy_up
  subroutine helper()
    @assertEqual(1, 2)
    prepared = 0
  end subroutine helper
  pure real(real64) function endless()
    endless = ieee_value(endless, ieee_positive_inf)
  end function endless
"""
VERDICT = """  ! A comment between the directive and its subroutine is allowed.
  @test

  ! Like this one.
  subroutine {0}()
    integer, allocatable :: three(:)
    three = [1, 2, 3]
    {1}
    prepared = 0
  end subroutine {0}
"""
PASSES = """
    @assertEqual(3, 3)
    @assertEqual(3, 3_int64)
    @assertEqual(3_int64, 3_int64, message='with a message')
    @assertEqual(endless(), endless())
    @assertEqual(.true., prepared == 1)
    @assertEqual('word', '  word ')
    @assertEqual('a, b) ''c''', "a, b) 'c'")
    @assertEqual(matrix, 1.0_real64*matrix)
    @assertEqual([1, 2], [1, 2])
    @assertEqual(2, spread(spread([2, 2], 2, 2), 3, 2))
    @assertEqual(1.0_real64, 1 + 1.0e-9_real64, tolerance=1.0e-8_real64, message='both '//'words')
    @assertLessThan(1, 2)
    @assertLessThan(0.0_real64, matrix)
    @assertLessThanOrEqual(2_int64, 2_int64)
    @assertGreaterThan(5.0_real64, matrix)
    @assertGreaterThanOrEqual(2, 2, message='equal')
    @assertTrue(1 < 2)
    @assertTrue(matrix(:, 1) > 0)
    @assertFalse(1 > 2)
    @assertFalse(matrix(:, 1) < 0)
"""
FAILS = """
    @assertEqual(3, 4, message='the message of a failure')
    @assertEqual(1.0_real64, 1.0_real64 + epsilon(1.0_real64))
    @assertEqual(1.0_real64, 1.0_real64 - 1.0e-7_real64, tolerance=1.0e-8_real64)
    @assertEqual([1, 2, 3], [1, 2, 4])
    @assertEqual(1.0_real64, matrix)
    @assertEqual(three, three(:2))
    @assertEqual(.true., prepared == 2)
    @assertEqual('word', 'words')
    @assertLessThan(2, 2)
    @assertLessThanOrEqual(3.0_real64, matrix)
    @assertGreaterThan(2.0_real64, 2.0_real64)
    @assertGreaterThanOrEqual(1_int64, 2_int64)
    @assertTrue([1, 3] < 2)
    @assertFalse([1, 3] < 2)
    call helper(); if (anyExceptions()) return
"""


@pytest.mark.parametrize("pfunit", RUNNERS, ids=["substitute", "pFUnit"][: len(RUNNERS)])
def test_each_assertion_passes_or_fails_under_the_substitute_as_under_pfunit(tmp_path, pfunit):
    failing = [f"fails_{k}" for k in range(len(FAILS.strip().splitlines()))]
    rows = zip(failing, FAILS.strip().splitlines(), strict=True)
    tests = [VERDICT.format(name, line.strip()) for name, line in rows]
    tests += [VERDICT.format("passes_after_all_failures", PASSES.strip())]
    text = "".join([VERDICTS, *tests, "end module test_verdicts\n"])
    (tmp_path / "test_verdicts.pf").write_text(text)
    shared = f"shared={'' if pfunit else 'tests/support/funit.f90'}"
    words = ["DEBUG=1", "sources=", shared, f"suites={tmp_path}", f"BUILD={tmp_path}"]
    words.append(f"PFUNIT_DIR={pfunit}")
    result = ran("make", "unit-tests", *words, cwd=ROOT, env=environment())
    failed = re.findall(r"test_verdicts(?:_suite)?\.((?:fails|passes)_\w+)", result.stdout)
    assert failed == failing, result.stdout + result.stderr
    assert result.returncode == 2
    assert f"Failures: {len(failing)}" in result.stdout


def translated(tmp_path: Path, text: str, name: str = "test_it.pf") -> str:
    path = tmp_path / name
    path.write_text(text)
    return translate(path)


@pytest.mark.parametrize(
    "line",
    [
        "@assertTrue(done) ! a comment",
        "@assertTrue(done); n = 1",
        "@assertTrue(a .and. &",
        "if (ready) @assertTrue(done)",
        "@assertEqual(1, n, 'a message')",
        "@assertEqual(1.0, x, 1.0e-6)",
        "@assertEqual(expected=1, actual=n)",
        "@assertEqual(1, n, whitespace=keep_all)",
        "@assertEqual(1, n, message='a', message='b')",
        "@assertEqual(message='a', 1, n)",
        "@assertEqual(1, , n)",
        "@assertEqual(1, f(n)",
        "@assertLessThan(x, y, tolerance=0.1)",
        "@assertFail(message='a')",
        "@asserttrue done",
        "@disable",
    ],
)
def test_a_line_outside_the_common_language_is_refused_with_its_number(tmp_path, line):
    with pytest.raises(Refused, match="line 6: "):
        translated(tmp_path, FILE.format(line))


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("module test_it", "module test_that"),
        ("subroutine works", "recursive subroutine works"),
        ("works()\n   ", "works(self)\n   "),
        ("@test", "@test(ifdef=X)"),
        ("@test", "@testCase"),
        ("  @test\n", "  @before\n\n"),
        ("contains", "  @before\n  subroutine a()\n  @before\n  subroutine b()\n"),
        ("@test\n", "@test\n  integer :: n\n"),
    ],
)
def test_a_file_outside_the_common_language_is_refused(tmp_path, before, after):
    assert before in FILE
    with pytest.raises(Refused):
        translated(tmp_path, FILE.replace(before, after))


def test_translation_keeps_line_numbers_and_texts_with_commas_or_at_signs(tmp_path):
    text = FILE.format("@assertEqual('a, @b(', name, message='x=1, ''y''') ").replace(
        "contains", "use systems, only: carry_on => run ! user@host"
    )
    lines = translated(tmp_path, text).splitlines()
    assert lines[3] == "use systems, only: carry_on => run ! user@host"
    assert "(e_ => (('a, @b(')), a_ => ((name)))" in lines[6]
    assert "message='x=1, ''y'''" in lines[6]


def judged(tmp_path: Path, script: str, suite: str, **variables):
    """Return the verdict of run_unit_tests.sh on a script that replaces the unit-test program."""
    program, path = executable(tmp_path / "unit_tests", script), tmp_path / "test_it.pf"
    path.write_text(suite)
    judge = SUPPORT / "run_unit_tests.sh"
    return ran(judge, "a stand-in", program, path, env=environment(**variables))


@pytest.mark.parametrize(
    ("output", "status", "verdict"),
    [
        (" OK\n (2 tests)", 0, 0),
        (" OK\n (2 tests, 1 disabled)", 0, 1),
        (" OK\n (1 test)", 0, 1),
        (" OK\n (12 tests)", 0, 1),
        ("..", 0, 1),
        (" OK\n (2 tests)", 2, 2),
        ("Program received signal SIGFPE", 136, 136),
    ],
)
def test_a_unit_run_counts_only_when_complete(tmp_path, output, status, verdict):
    script = f"cat <<'E'\n{output}\nE\nexit {status}\n"
    run = judged(tmp_path, script, "  @test\n  !@test\n  @Test\n  ! about @test\n")
    assert run.returncode == verdict


@pytest.mark.parametrize(
    ("work", "verdict", "message"),
    [("sleep 2", 0, ""), ("while :; do :; done", 152, "stopped after 1 s of processor time")],
    ids=["waiting", "busy"],
)
def test_a_unit_run_is_stopped_by_processor_time_not_by_the_clock(tmp_path, work, verdict, message):
    run = judged(tmp_path, f"{work}\necho ' OK'\necho ' (1 test)'\n", "  @test\n", LIMIT="1")
    assert run.returncode == verdict and message in run.stderr


MODULE = """!> A module. It says: use nothing, private, get_it.
module upper
  use lower, only: value
  use, intrinsic :: iso_fortran_env, only: real64
  implicit none
  private
contains
  !> Twice.
  pure real(real64) function twice(x)
    integer, intent(in) :: x

    twice = 2*x*value
  end function twice
end module upper
"""


PICTURE = """```mermaid
flowchart TD
  high --> low & lowest
```
"""


def style_problems(root: Path, text: str, picture: str = PICTURE):
    ran("git", "init", "-q", root, check=True)
    for folder in ("high", "low", "lowest"):
        (root / "src" / folder).mkdir(parents=True)
        (root / "src" / folder / "README.md").write_text("A folder.\n")
    (root / "src" / "README.md").write_text(picture)
    for folder, name in (("low", "lower"), ("lowest", "other")):
        empty = f"module {name}\n  private\nend module {name}\n"
        (root / "src" / folder / f"{name}.f90").write_text(empty)
    (root / "src" / "high" / "upper.f90").write_text(text)
    return [str(problem) for problem in problems_of(root)]


def test_a_module_in_order_has_no_style_problem(tmp_path):
    assert style_problems(tmp_path, MODULE) == []


def test_a_submodule_is_a_file_of_its_name_that_needs_no_private(tmp_path):
    part = MODULE.replace("module upper", "submodule(lower) upper", 1).replace("  private\n", "")
    part = part.replace("end module", "end submodule")
    assert style_problems(tmp_path, part) == []


@pytest.mark.parametrize(
    ("before", "after", "line", "words"),
    [
        ("lower, only: value", "lower", 3, "without only"),
        ("  private\n", "  public\n", 1, "no private"),
        ("module upper", "module uppermost", 1, "instead of upper"),
        ("    twice = 2*x*value\n", "    twice = 2*x*value\n" * 59, 9, "longer than 60 lines"),
        ("function twice", "function get_twice", 9, "says nothing"),
        ("twice(x)", "twice(x, a, b, c, d, e, f, g)", 9, "8 arguments"),
        ("in) :: x\n\n", "in) :: x\n", 11, "no blank line before the body"),
        ("2*x*value", "2*x", 3, "value is imported, not used"),
        ("  private\n", "  private\n  public :: twice\n", 7, "nobody uses twice"),
        ("contains\n", "#include 'x'\ncontains\n", 7, "preprocessor"),
        ("contains\n", "contains\n" + "! a line\n" * 587, 601, "more than 600 lines"),
        ("It says:", f"It says: '/{'home'}/me'", 1, "path of one machine"),
        ("!> Twice.", "!> Twice. What is doubled", 8, "a sentence begins with What"),
        ("!> Twice.", "!> Those of all.", 8, "a sentence begins with Those of"),
        ("contains\n", "CONTAINS\n", 7, "CONTAINS: write keywords in lower case"),
        ("!> Twice.", "!> Drawn by turns.", 8, "'by turns': write alternately"),
    ],
)
def test_a_style_problem_is_reported_at_its_line(tmp_path, before, after, line, words):
    assert before in MODULE
    (problem,) = style_problems(tmp_path, MODULE.replace(before, after, 1))
    assert problem.startswith(f"src/high/upper.f90:{line}: ")
    assert words in problem


@pytest.mark.parametrize(
    ("old", "new", "most"),
    [("  !> Twice.", "  !> Twice. ", 100), ("2*x*value", "2*x*value  ! ", 110)],
)
@pytest.mark.parametrize("excess", [0, 1])
def test_a_comment_ends_at_its_column(tmp_path, old, new, most, excess):
    """Comment lines have 100 columns, and lines of code with a comment have 110."""
    text = MODULE.replace(old, new, 1)
    (line,) = [line for line in text.splitlines() if line.endswith(new)]
    problems = style_problems(
        tmp_path, text.replace(line, line + "x" * (most + excess - len(line)))
    )
    assert [problem.split(": ")[1] for problem in problems] == [
        f"comment beyond column {most}"
    ] * excess


@pytest.mark.parametrize(("lines", "is_public", "expected"), [(9, 0, 0), (10, 0, 1), (9, 1, 2)])
def test_only_small_private_procedures_need_no_comment(tmp_path, lines, is_public, expected):
    """A public procedure has a second problem here, because it is unused."""
    text = MODULE.replace("  !> Twice.\n", "")
    text = text.replace("    twice = 2", "    twice = 1\n" * (lines - 5) + "    twice = 2")
    text = text.replace("private\n", "private\n  public :: twice\n" if is_public else "private\n")
    problems = style_problems(tmp_path, text)
    assert len(problems) == expected
    assert any("no !> before it" in problem for problem in problems) == (expected > 0)


def test_words_of_python_pages_and_helps_are_looked_at(tmp_path):
    """Only questions may begin with What; help texts begin with a noun."""
    folder = tmp_path / "src" / "variables"
    folder.mkdir(parents=True)
    row = 'variable_t("run", "dt", "real", 1, "optional", "0.1", &\n      "{}", positive)'
    (folder / "README.md").write_text("A folder.\n")
    for name, text in (("good", "Length of a step."), ("bad", "of a step")):
        rows = f"!> Rows.\nmodule {name}\n  private\n{row.format(text)}\nend module {name}\n"
        (folder / f"{name}.f90").write_text(rows)
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "page.md").write_text("# What is it?\n\nIt has molten.\n")
    (tmp_path / "post").mkdir()
    (tmp_path / "post" / "script.py").write_text('"""What is it?\n\nGood.  What it does."""\n')
    found = style_problems(tmp_path, MODULE, PICTURE + "  high --> variables\n")
    places = sorted(problem.split(": ")[0] for problem in found)
    assert places == ["docs/page.md:3", "post/script.py:1", "src/variables/bad.f90:4"], found


@pytest.mark.parametrize(("lines", "expected"), [(600, []), (601, ["more than 600 lines"])])
@pytest.mark.parametrize("name", ["runs/study.sh", "tests/post/test_x.py", "tests/unit/test_x.pf"])
def test_a_file_of_tests_or_runs_has_at_most_600_lines(tmp_path, name, lines, expected):
    path = tmp_path / name
    path.parent.mkdir(parents=True)
    path.write_text("\n" * lines)
    problems = [f"{name}:{lines}: {words}" for words in expected]
    assert style_problems(tmp_path, MODULE) == problems


@pytest.mark.parametrize(("lines", "expected"), [(600, []), (601, ["more than 600 lines"])])
def test_a_python_file_of_the_scripts_has_at_most_600_lines(tmp_path, lines, expected):
    path = tmp_path / "post" / "ricochet" / "analysis" / "means.py"
    path.parent.mkdir(parents=True)
    path.write_text("pass\n" * lines)
    (tmp_path / "post" / "ricochet" / "README.md").write_text("  analysis --> analysis\n")
    place = f"post/ricochet/analysis/means.py:{lines}: "
    assert style_problems(tmp_path, MODULE) == [place + words for words in expected]


def test_folders_and_what_they_use_are_those_of_the_picture(tmp_path):
    drawn = PICTURE.replace("low & ", "") + "high --> lost\n"
    place = "src/high/upper.f90:3: high/ uses lower of low/"
    lost, used = sorted(style_problems(tmp_path, MODULE, drawn))
    assert lost == "src/README.md:1: there is no folder src/lost" and used.startswith(place)


@pytest.mark.parametrize(
    ("line", "used"),
    [
        ("from ..reading import reader", "reading"),
        ("from ..reading.reader import Run", "reading"),
        ("from ricochet.reading import reader", "reading"),
        ("def run():\n    import ricochet.commands", "commands"),
        ("from .. import commands", "commands"),
    ],
)
def test_imports_of_the_package_are_those_of_its_picture(tmp_path, line, used):
    """Absolute and relative imports are checked, even inside functions, except within a folder."""
    package = tmp_path / "post" / "ricochet"
    ran("git", "init", "-q", tmp_path, check=True)
    for name in ("__init__", "commands", "reading/reader", "pages/live", "pages/lab"):
        path = package / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "README.md").write_text("no picture")
    (package / "pages" / "lab.py").write_text(f"from . import live\n{line}\n")

    def problems(picture: str) -> list[str]:
        (package / "README.md").write_text(picture)
        return [str(problem) for problem in problems_of(tmp_path)]

    assert problems("  pages --> reading & commands") == []
    (problem,) = problems("  commands --> reading\n  pages --> reading".replace(used, "pages"))
    where = line.count("\n") + 2
    assert problem.startswith(f"post/ricochet/pages/lab.py:{where}: pages imports {used}")
    (problem,) = problems("  pages --> reading & commands & lost")
    assert problem == "post/ricochet/README.md:1: there is no lost in the package"


@pytest.mark.skipif(not shutil.which("setpriv"), reason="no setpriv (util-linux)")
def test_a_process_ends_with_its_parent_even_if_that_is_killed():
    child = "import time; print('lives', flush=True); time.sleep(20); print('lives on')"
    parent = "import subprocess, sys; subprocess.run(sys.argv[1:])"
    command = [sys.executable, "-c", parent, *with_parent(sys.executable, "-c", child)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "lives\n"
        process.kill()
        assert process.stdout.read() == ""


def test_the_libraries_under_test_are_those_beside_the_program(tmp_path, monkeypatch):
    """Tests change the folder, so that relative paths become absolute ones."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "build").mkdir()
    executable(tmp_path / "build" / "ricochet", "true")
    monkeypatch.setenv("RICOCHET", "build/ricochet")
    monkeypatch.delenv("RICOCHET_LIBRARY", raising=False)
    assert choose_build() == ""
    assert os.environ["RICOCHET"] == f"{tmp_path}/build/ricochet"
    assert os.environ["RICOCHET_LIBRARY"] == f"{tmp_path}/build"
    monkeypatch.setenv("RICOCHET_LIBRARY", "other")
    assert choose_build() == "" and os.environ["RICOCHET_LIBRARY"] == f"{tmp_path}/other"
    monkeypatch.setenv("RICOCHET", "nothing")
    assert choose_build() == "RICOCHET: no program at nothing; run make first"
