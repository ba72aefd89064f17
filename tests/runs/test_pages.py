"""Tests of the code on the pages of docs/: fenced blocks are executed in the order of the page.

- `fortran` whose first line is a comment `! runs/NAME.nml: ...`, and `c` that begins with `//
  runs/NAME.c: ...`: written to this file
- `bash`: executed in a folder that looks like the project
- `python`: all blocks of a page form one program, executed at the end
- `text`: output, not executed

A comment `<!-- test: OLD => NEW; OLD => NEW -->` before a block replaces texts in it, so that a
long run becomes a short one. `<!-- test: not run, REASON -->` excludes a block.
"""

import contextlib
import itertools
import os
import re
import shlex
import shutil
import sys
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import pytest

from synthetic_run import ROOT, run_code, run_script
from whole_runs import environment, ran

BLOCK = re.compile(
    r"^(?:<!-- test: (?P<note>.*?) -->\n+)?```(?P<language>\w*)\n(?P<code>.*?)^```$", re.M | re.S
)
#: First line of a block that is written to a file, by language.
FIRST_LINE = {"fortran": r"! (runs/[\w-]+\.nml)\b", "c": r"// (runs/[\w-]+\.c)\b"}
#: Command that runs a script of post/.
SCRIPT = re.compile(r"(?:\.venv/bin/)?python post/(\w+)\.py(.*)")
LANGUAGES = {"bash", "python", "fortran", "text", "diff", "mermaid", "c"}
PAGES = [path for path in sorted(ROOT.glob("docs/*/*.md")) if "```" in path.read_text()]
RUN = [path for path in PAGES if path.parent.name in ("tutorials", "guides")]
#: Pages whose code takes most of the time, because it simulates and draws a dozen runs.
LONG = {
    "billiards",
    "contact-networks",
    "cooling-and-driving",
    "dense-states",
    "exam",
    "functions-of-events",
    "gravity",
    "hard-spheres-lab",
    "thermal-wall",
    "transport",
}


class Block(NamedTuple):
    """Block of code on a page, as executed."""

    language: str
    code: str


def blocks_of(page: str, short: bool = True) -> list[Block]:
    """Return the blocks of a page that are executed.

    Texts are replaced for the test unless `short` is False.
    """
    found = []
    for one in BLOCK.finditer(page):
        code, note = one["code"], one["note"] or ""
        if note.startswith("not run, "):
            continue
        for change in filter(None, note.split("; ") if short else ()):
            old, new = change.split(" => ")
            assert old in code, f"the block does not contain {old!r}"
            code = code.replace(old, new)
        found.append(Block(one["language"], code))
    return found


def libraries(program: Path) -> list[Path]:
    """Return the libraries used by the tests."""
    folder = Path(os.environ.get("RICOCHET_LIBRARY", program.parent))
    return sorted(folder.glob("libricochet*.so"))


def make_project(folder: Path, program: Path) -> None:
    """Make a folder that looks like the project to the commands on a page."""
    (folder / "runs").mkdir()
    (folder / "build").mkdir()
    for made in (program, *libraries(program)):
        (folder / "build" / made.name).symlink_to(made)
    for script in (ROOT / "runs").glob("*.sh"):
        shutil.copy(script, folder / "runs")
    for name in ("input", "post", "docs", "src"):
        (folder / name).symlink_to(ROOT / name)


def run_shell(code: str) -> None:
    """Execute shell commands, with scripts in this process, which has loaded their packages.

    A block with loops or variables is executed by bash as a whole.
    """
    lines = [code] if re.search(r"^ +\w|\$|<<", code, re.M) else code.splitlines()
    for line in lines:
        if script := SCRIPT.match(line):
            words = shlex.split(script[2], comments=True)
            named = [sorted(Path().glob(word)) or [word] for word in words]
            assert run_script(script[1], *itertools.chain(*named)) == 0, line
        else:
            shell = re.sub(r"(?m)^( *)(?:\.venv/bin/)?python ", rf"\1{sys.executable} ", line)
            own = environment(PYTHON=sys.executable, PYTHONPATH=ROOT / "post", MPLBACKEND="Agg")
            ran("bash", "-ec", shell, env=own, check=True)


def execute(blocks: list[Block], folder: Path, program: Path) -> None:
    """Execute blocks in a folder that looks like the project."""
    code = ""
    with contextlib.chdir(folder), mock.patch.dict(os.environ, RICOCHET=str(program)):
        for block in blocks:
            if block.language in FIRST_LINE:
                name = re.match(FIRST_LINE[block.language], block.code)
                assert name, f"the first line names no file: {block.code.splitlines()[0]}"
                Path(name[1]).write_text(block.code)
            elif block.language == "bash":
                run_shell(block.code.replace("\\\n", ""))
            elif block.language == "python":
                code += block.code
        run_code(code)


def marked(page: Path):
    """Return a parameter of a test, with a mark that excludes a long page from `make test`."""
    name = f"{page.parent.name}/{page.stem}"
    return pytest.param(page, id=name, marks=[pytest.mark.statistics] * (page.stem in LONG))


@pytest.mark.parametrize("page", [*map(marked, RUN)])
def test_the_code_of_a_page_works(page, program, tmp_path):
    """The longest pages take about ten seconds, because they simulate and draw a dozen runs."""
    text = page.read_text()
    if "libricochet" in text and not libraries(program):
        pytest.skip("make library builds it")
    make_project(tmp_path, program)
    before = {path.name for path in tmp_path.iterdir()}
    execute(blocks_of(text), tmp_path, program)
    assert {path.name for path in tmp_path.iterdir()} == before, "files belong in runs/"


def test_the_figures_of_the_inputs_are_written_to_their_folder():
    """Without -o, the script in the comment of an input would write to the top folder."""
    comments = [path.read_text() for path in sorted((ROOT / "input").glob("*.nml"))]
    drawn = [line for text in comments for line in re.findall(r"^! +.*python post/.*", text, re.M)]
    assert drawn and [line for line in drawn if " -o runs/" not in line] == []


def test_each_block_names_its_language():
    """A block in no known language would not be executed."""
    languages = {
        (path.name, one["language"]) for path in PAGES for one in BLOCK.finditer(path.read_text())
    }
    assert {pair for pair in languages if pair[1] not in LANGUAGES} == set()


def test_a_block_that_fails_is_noticed():
    page = "<!-- test: 1-8 => 1-2 -->\n```bash\nrun --seeds 1-8\n```\n\n```text\nno\n```\n"
    assert blocks_of(page) == [Block("bash", "run --seeds 1-2\n"), Block("text", "no\n")]
    assert blocks_of("<!-- test: not run, it asks -->\n```bash\nsudo\n```\n") == []
    with pytest.raises(AssertionError, match="does not contain"):
        blocks_of("<!-- test: a => b -->\n```bash\nc\n```\n")


def test_the_guides_make_their_own_figures():
    """The commands of a guide that shows the picture NAME.png make the figure `runs/NAME.png`."""
    shown = {}
    for page in sorted(ROOT.glob("docs/guides/*.md")):
        text = page.read_text()
        made = {
            name for block in blocks_of(text) for name in re.findall(r"runs/(\w+)\.png", block.code)
        }
        for name in re.findall(r"!\[[^]]*\]\((\w+)\.png\)", text):
            assert name in made, f"no command of {page.name} makes runs/{name}.png"
            shown[name] = page
    assert {path.stem for path in ROOT.glob("docs/guides/*.png")} == {*shown}


#: Advice that a page must contain if its code contains one of these words.
NEEDED = {
    r"import pandas|to_dataframe\(|\bsweep\(": "make demo",
    r"write_gsd|import gsd": "python -m pip install gsd",
    r"import freud": "python -m pip install freud-analysis",
    r"\bSimulation\(": "make demo",
}


@pytest.mark.parametrize("page", RUN, ids=lambda path: path.stem)
def test_a_page_says_what_its_code_needs(page):
    """`make demo` installs pandas and builds the library, but no other optional package."""
    text = page.read_text()
    code = "".join(one["code"] for one in BLOCK.finditer(text))
    for used, advice in NEEDED.items():
        assert not re.search(used, code) or advice in " ".join(text.split()), advice
