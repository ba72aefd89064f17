"""The notebook runs from its first cell to its last, and shows what it promises."""

import pytest

from synthetic_run import ROOT

pytestmark = pytest.mark.check
nbclient = pytest.importorskip("nbclient")


@pytest.fixture(scope="module")
def cells(program):
    """The code of each cell with what it shows: kinds of data and texts."""
    import nbformat

    notebook = nbformat.read(ROOT / "docs" / "tour.ipynb", as_version=4)
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("RICOCHET", str(program))
        kernel = {"kernel_name": "python3", "timeout": 300}
        folder = {"metadata": {"path": str(ROOT / "docs")}}
        nbclient.NotebookClient(notebook, resources=folder, **kernel).execute()
    return [(cell.source, shown(cell)) for cell in notebook.cells if cell.cell_type == "code"]


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


def test_every_figure_is_drawn(cells):
    drawn = [output for source, output in cells if "plt.subplots" in source]
    assert len(drawn) == 4 and all("image/png" in output for output in drawn)


def test_the_film_has_buttons(cells):
    assert "Animation(frames" in showing(cells, "animate(run")


def test_energy_is_conserved_and_mistakes_are_told(cells):
    assert float(showing(cells, "largest relative").split(":")[1]) < 1e-12
    assert "contact.restitution" in showing(cells, "except ricochet.ProgramError")


def test_no_cell_warns(cells):
    assert [source for source, output in cells if "Warning" in output] == []
