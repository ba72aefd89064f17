"""Tests of the code on the pages of docs/: each fenced block is executed in the order of the page.

A block of the language `fortran` whose first line is a comment `! runs/NAME.nml: ...` is written to
this file.  Blocks of the language `bash` are executed in a folder that looks like the project, and
all blocks of the language `python` of a page form one program, which is executed in parts.  Blocks
of the language `text` show output and are not executed.

A comment `<!-- test: OLD => NEW; OLD => NEW -->` before a block replaces texts in the block, so
that a long run becomes a short one.  The comment `<!-- test: not run, REASON -->` excludes a block.
"""

import re
import shutil
import sys
from typing import NamedTuple

import pytest

from synthetic_run import ROOT
from whole_runs import environment, ran

BLOCK = re.compile(
    r"^(?:<!-- test: (?P<note>.*?) -->\n+)?```(?P<language>\w*)\n(?P<code>.*?)^```$", re.M | re.S
)
LANGUAGES = {"bash", "python", "fortran", "text", "diff", "mermaid", "c"}
PAGES = [path for path in sorted(ROOT.glob("docs/*/*.md")) if "```" in path.read_text()]
RUN = [path for path in PAGES if path.parent.name in ("tutorials", "guides")]


class Block(NamedTuple):
    """A block of code of a page, as it is executed."""

    language: str
    code: str


def blocks_of(page: str) -> list[Block]:
    """Return the blocks of a page that are executed, after the replacements for the test."""
    found = []
    for one in BLOCK.finditer(page):
        code, note = one["code"], one["note"] or ""
        if note.startswith("not run, "):
            continue
        for change in filter(None, note.split("; ")):
            old, new = change.split(" => ")
            assert old in code, f"the block does not contain {old!r}"
            code = code.replace(old, new)
        found.append(Block(one["language"], code))
    return found


def make_project(folder, program):
    """Make a folder that looks like the project to the commands of a page."""
    (folder / "runs").mkdir()
    (folder / "build").mkdir()
    (folder / "build" / "ricochet").symlink_to(program)
    for script in (ROOT / "runs").glob("*.sh"):
        shutil.copy(script, folder / "runs")
    for name in ("input", "post", "docs"):
        (folder / name).symlink_to(ROOT / name)


@pytest.mark.parametrize("page", RUN, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_the_code_of_a_page_works(page, program, tmp_path):
    make_project(tmp_path, program)
    own = environment(
        PYTHON=sys.executable, RICOCHET=program, PYTHONPATH=ROOT / "post", MPLBACKEND="Agg"
    )
    code = ""
    for block in blocks_of(page.read_text()):
        if block.language == "fortran":
            name = re.match(r"! (runs/[\w-]+\.nml)\b", block.code)
            assert name, f"the first line names no file: {block.code.splitlines()[0]}"
            (tmp_path / name[1]).write_text(block.code)
        elif block.language == "bash":
            shell = re.sub(r"(?m)^(?:\.venv/bin/)?python ", f"{sys.executable} ", block.code)
            ran("bash", "-ec", shell, cwd=tmp_path, env=own, check=True)
        elif block.language == "python":
            code += block.code
    if code:
        said = ran(sys.executable, "-W", "error::UserWarning", "-c", code, cwd=tmp_path, env=own)
        assert said.returncode == 0, said.stderr


def test_each_block_names_its_language():
    """A block without a language, or with an unknown one, would not be executed."""
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
