"""Tests of what works after `make demo` alone, in the environment that it creates."""

import re
from pathlib import Path

import pytest

from synthetic_run import ROOT
from test_pages import FIRST_LINE, RUN, blocks_of
from whole_runs import environment, ran

pytestmark = pytest.mark.check


@pytest.fixture(scope="module")
def clone(tmp_path_factory) -> Path:
    """Return a clone of the last commit in which only `make demo` has been run."""
    folder = tmp_path_factory.mktemp("newcomer") / "ricochet"
    ran("git", "clone", "--quiet", ROOT, folder, check=True)
    ran("make", "demo", cwd=folder, env=newcomer(), check=True)
    return folder


def newcomer(**more) -> dict[str, str]:
    """Return an environment that leads to no program or package outside the clone."""
    mine = environment(MPLBACKEND="Agg", **more)
    foreign = ("RICOCHET", "RICOCHET_LIBRARY", "PYTHONPATH", "BUILD", "MAKEFLAGS", "MAKELEVEL")
    return {name: value for name, value in mine.items() if name not in foreign}


def in_environment(shell: str) -> str:
    """Return shell commands in which `python` is that of .venv."""
    return re.sub(r"(?m)^( *)(?:\.venv/bin/)?python ", r"\1.venv/bin/python ", shell)


def indented_blocks(page: str) -> list[str]:
    """Return the indented blocks of code of a page."""
    found = re.findall(r"(?m)(?:^    .*\n(?:\n(?=    ))?)+", page)
    return [re.sub(r"(?m)^    ", "", block) for block in found]


def test_the_blocks_of_the_readme_work(clone):
    blocks = indented_blocks((ROOT / "README.md").read_text())
    python = [block for block in blocks if block.startswith("import ")]
    shell = [block for block in blocks if "build/ricochet" in block or block.startswith("cp ")]
    assert python and shell
    ran("bash", "-ec", "\n".join(shell), cwd=clone, env=newcomer(), check=True)
    ran(".venv/bin/python", "-c", "\n".join(python), cwd=clone, env=newcomer(), check=True)


@pytest.mark.parametrize("page", RUN, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_the_first_commands_of_a_page_work(page, clone):
    """The first executable block is run with the files contained in the blocks before it."""
    ran("git", "clean", "-fdxq", "--exclude=demo", "runs", cwd=clone, check=True)
    for language, code in blocks_of(page.read_text()):
        if language in FIRST_LINE:
            (clone / re.match(FIRST_LINE[language], code)[1]).write_text(code)
        elif language == "bash":
            shell = in_environment(code)
            ran("bash", "-ec", shell, cwd=clone, env=newcomer(), check=True)
            return
        elif language == "python":
            ran(".venv/bin/python", "-c", code, cwd=clone, env=newcomer(), check=True)
            return
