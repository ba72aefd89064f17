"""The notebook runs from its first cell to its last, and shows what it promises."""

import json
import re
import subprocess
import tomllib

import pytest

from ricochet import Run, packages
from synthetic_run import ROOT


def test_one_command_installs_what_the_notebook_needs():
    """Jupyter, its kernel, and what the cells and the methods that they call import."""
    wanted = {"ipykernel", "jupyterlab", "pandas"}
    lines = (ROOT / "requirements.txt").read_text().splitlines()
    installed = {line.split("==")[0] for line in lines if re.search(r"==.*#.*\bnotebook\b", line)}
    extras = tomllib.loads((ROOT / "post" / "pyproject.toml").read_text())["project"]
    assert installed == set(extras["optional-dependencies"]["notebook"]) == wanted
    cells = json.loads((ROOT / "docs" / "tour.ipynb").read_text())["cells"]
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    imported = set(re.findall(r"^(?:import|from) (\w+)", code, re.M)) - {"ricochet"}
    assert imported <= installed | set(packages.needed)
    said = subprocess.run(["make", "-n", "notebook"], cwd=ROOT, capture_output=True, text=True)
    assert ".ci/set-up demo notebook" in said.stdout and "docs/tour.ipynb" in said.stdout
    assert "make notebook" in cells[0]["source"][-2] + cells[0]["source"][-1]


def test_the_page_says_all_that_a_run_can_do():
    page = (ROOT / "docs" / "output.md").read_text().partition("What a `Run` can do")[2]
    names = {*Run.__dataclass_fields__, *(name for name in vars(Run) if name[0] != "_")}
    assert [name for name in sorted(names) if not re.search(rf"`{name}\b", page)] == []


@pytest.mark.check
def test_each_cell_shows_what_it_promises(program, monkeypatch):
    """Figures, a film with buttons, a conserved energy, a mistake that is told; no warning."""
    nbclient = pytest.importorskip("nbclient")
    import nbformat

    notebook = nbformat.read(ROOT / "docs" / "tour.ipynb", as_version=4)
    monkeypatch.setenv("RICOCHET", str(program))
    kernel = {"kernel_name": "python3", "timeout": 300}
    folder = {"metadata": {"path": str(ROOT / "docs")}}
    nbclient.NotebookClient(notebook, resources=folder, **kernel).execute()
    cells = [(one.source, shown(one)) for one in notebook.cells if one.cell_type == "code"]
    drawn = [output for source, output in cells if "plt.subplots" in source]
    assert len(drawn) == 4 and all("image/png" in output for output in drawn)
    assert "Animation(frames" in showing(cells, "animate(run")
    assert float(showing(cells, "largest relative").split(":")[1]) < 1e-12
    assert "contact.restitution" in showing(cells, "except ricochet.ProgramError")
    assert [source for source, output in cells if "Warning" in output] == []


def shown(cell):
    """What a cell shows, as one text."""
    return "\n".join(
        str(output.get("text", "")) + "\n".join(map(str, output.get("data", {}).items()))
        for output in cell.outputs
    )


def showing(cells, code):
    """What the one cell shows that contains this code."""
    (found,) = [output for source, output in cells if code in source]
    return found
