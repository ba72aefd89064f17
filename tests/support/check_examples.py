"""Write the Python examples of the documentation to files, for a type checker.

    python tests/support/check_examples.py FOLDER

One file is written for each section of README.md and of the pages in docs/ that contains an
example, and one for the code cells of the notebook docs/tutorials/tour.ipynb. A section without
imports is appended to the file of the previous section.
"""

import ast
import json
import re
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
TOUR = ROOT / "docs" / "tutorials" / "tour.ipynb"


def blocks_of(section: str) -> list[str]:
    """Return the Python code in a section: fences, and indented blocks with imports or calls."""
    fences = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
    marked = [code for language, code in fences.findall(section) if language == "python"]
    blocks = re.findall(r"(?:^    .*\n(?:\n(?=    ))?)+", fences.sub("", section), re.MULTILINE)
    return marked + [block for block in map(textwrap.dedent, blocks) if is_python(block)]


def is_python(block: str) -> bool:
    """Return whether a block of code is Python, rather than shell commands or Fortran."""
    try:
        nodes = [*ast.walk(ast.parse(block))]
    except SyntaxError:
        return False
    return any(isinstance(node, ast.Import | ast.ImportFrom | ast.Call) for node in nodes)


def examples_of(page: str) -> list[str]:
    """Return the Python programs on a page."""
    found: list[str] = []
    for section in re.split(r"^#+ ", page, flags=re.MULTILINE):
        code = "\n".join(blocks_of(section))
        if re.search(r"^from \.", code, re.MULTILINE):
            continue  # a module of the package, which a test of the recipes adds to it
        if re.search(r"^(import|from) ", code, re.MULTILINE):
            found.append(code)
        elif code and found:
            found[-1] += code
    return found


def cells_of(notebook: str) -> str:
    """Return the code cells of a notebook as one program."""
    cells = json.loads(notebook)["cells"]
    code = ["".join(cell["source"]) + "\n" for cell in cells if cell["cell_type"] == "code"]
    return "\n".join(["from IPython.display import display", *code])


def main(folder: Path) -> None:
    """Write the Python examples of all pages to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.py"):
        old.unlink()
    for page in PAGES:
        for number, code in enumerate(examples_of(page.read_text()), start=1):
            (folder / f"{page.stem.replace('-', '_')}_{number}.py").write_text(code)
    (folder / "tour.py").write_text(cells_of(TOUR.read_text()))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
