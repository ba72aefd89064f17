"""Analyses as functions, their scripts, and the sizes of their figures."""

import ast
import csv
import io
import sys

import numpy as np
import pytest
from tqdm import tqdm

import ricochet
from ricochet import RunError, script
from ricochet.figures.drawing import plt
from ricochet.figures.sheet import Panel, Sheet, smallest_text, width_of
from ricochet.reports import analysis
from ricochet.reports.options import Option
from synthetic_gases import falling, gas
from synthetic_run import ROOT, run_script
from whole_runs import wait_for

MOST_LINES = 60  # lines in the script of an analysis
MOST_LINES_OF_HELP = 40
MOST_LINES_OF_OTHERS = 150  # lines in scripts that belong to no analysis


@pytest.fixture
def runs(tmp_path, rng):
    """Return a file for each analysis to which synthetic runs are suited."""
    one = gas(tmp_path / "gas.h5", rng)
    return {
        "speeds": [one, gas(tmp_path / "more.h5", rng, count=300)],
        "energy": [falling(tmp_path / "fall.h5", rng)],
        "fields": [one],
    }


def text_of_cells(rows):
    """Return the cells of a table as in a CSV file."""
    return [{name: "" if cell is None else str(cell) for name, cell in row.items()} for row in rows]


@pytest.mark.parametrize("name", ricochet.analyses)
def test_each_analysis_has_a_short_script_with_the_same_line(name):
    """The first line of the script's help text is the line in the registry."""
    path = ROOT / f"post/{name}.py"
    text = path.read_text()
    help_text = ast.get_docstring(ast.parse(text))
    assert len(text.splitlines()) <= MOST_LINES
    assert len(help_text.splitlines()) <= MOST_LINES_OF_HELP
    assert help_text.splitlines()[0] == ricochet.analyses[name] == analysis(name).about
    for heading in ("\npanels", "table", "\nrefuses\n", "\nsee also\n"):
        assert heading in help_text


def test_other_scripts_stay_short():
    """Their calculations are in the package as well."""
    for path in (ROOT / "post").glob("*.py"):
        if path.stem not in ricochet.analyses:
            assert len(path.read_text().splitlines()) <= MOST_LINES_OF_OTHERS, path.name


def test_a_terminal_shows_that_an_analysis_takes_long(monkeypatch):
    """An interrupted progress bar of tqdm leaves the lock of all bars acquired."""
    terminal = io.StringIO()
    terminal.isatty = lambda: True
    monkeypatch.setattr(script, "PATIENCE", 0.0)
    monkeypatch.setattr(sys, "stderr", terminal)
    with tqdm.get_lock(), script.timer("speeds"):
        wait_for(lambda: "speeds: 00:0" in terminal.getvalue())
    assert terminal.getvalue().endswith("\r")


def test_a_script_prints_the_table_of_the_function(tmp_path, capsys, runs):
    for name, paths in runs.items():
        result = ricochet.analyse(name, paths)
        table = tmp_path / f"{name}.csv"
        words = (*paths, "-o", tmp_path / f"{name}.png", "--csv", table)
        assert run_script(name, *words) == 0
        printed = capsys.readouterr().out
        assert printed.startswith(str(result).split("\n", 1)[1].split("\nwarning")[0])
        if result.data is None:
            with table.open() as file:
                assert list(csv.DictReader(file)) == text_of_cells(result.table)
        assert result.name == name and len(result.runs) == len(paths)


@pytest.mark.parametrize("width", [None, "8.5cm", "slide", 20])
def test_no_text_of_a_figure_is_below_eight_points(runs, width):
    """The figure has the requested width, and a narrow figure has stacked panels."""
    for name, paths in runs.items():
        result = ricochet.analyse(name, paths)
        figure = result.figure(width=width)
        assert smallest_text(figure) >= 8
        assert 2.54 * figure.get_figwidth() == pytest.approx(width_of(width)[0])
        if width == "8.5cm":
            left = {
                round(axes.get_subplotspec().get_position(figure).x0, 3) for axes in figure.axes
            }
            assert len(left) == 1
        plt.close(figure)


def test_a_panel_is_drawn_alone(tmp_path, runs, capsys):
    result = ricochet.analyse("speeds", runs["speeds"])
    whole, late = result.figure(), result.figure("late")
    assert [axes.get_title(loc="left") for axes in late.axes] == ["Equilibrium, many frames"]
    assert len(whole.axes) == 4
    plt.close("all")
    words = ("-o", tmp_path / "a.png", "--panel", "lat")
    assert run_script("speeds", *runs["speeds"], *words) == 2
    assert "no panel lat; did you mean late?" in capsys.readouterr().err
    assert run_script("speeds", *runs["speeds"], *words[:2], "--width", "wide") == 2
    assert "'wide' is not a width from 5cm to 100cm, or slide" in capsys.readouterr().err


def test_warnings_and_notes_are_below_the_panels():
    """At most three warnings are written in full, in red."""
    sheet = Sheet([[Panel("a", lambda axes: axes.plot([0, 1]))]], notes=["bars: errors"])
    figure = sheet.figure(warnings=[f"reason {k}" for k in range(5)])
    lines = {text.get_text(): text for text in figure.texts}
    assert {"bars: errors", "Warning: reason 2", "and 2 more warnings, as printed"} <= {*lines}
    figure.draw_without_rendering()
    highest = max(text.get_window_extent().y1 for text in figure.texts)
    assert highest <= figure.axes[0].get_tightbbox().y0
    assert lines["Warning: reason 0"].get_color() == "firebrick"
    plt.close(figure)


def test_options_in_python_are_those_of_the_script(runs):
    """Texts are converted as on a command line; names of units reach the axes."""
    given = {"frames": "10:", "equilibration": 5, "units": "time=s,length=cm"}
    result = ricochet.analyse("speeds", runs["speeds"][0], **given)
    same = ricochet.analyse("speeds", runs["speeds"][0], frames=[slice(10, None)], equilibration=5)
    assert result.table == same.table and result.options.frames == (slice(10, None),)
    assert result.runs[0].units.time == "s"
    with pytest.raises(ValueError, match=r"speeds has no option equilibrate; did you mean equili"):
        ricochet.analyse("speeds", runs["speeds"], equilibrate=1)
    with pytest.raises(ValueError, match="frames: 'a' is not a list of frames"):
        ricochet.analyse("speeds", runs["speeds"], frames="a")
    with pytest.raises(ValueError, match=r"no analysis speed; did you mean speeds\?"):
        ricochet.analyse("speed", runs["speeds"])
    with pytest.raises(RunError, match="speeds: runs are required"):
        ricochet.analyse("speeds", [])
    with pytest.raises(ValueError, match="show is not one of a, b: 'c'"):
        Option("show", "a choice", choices=("a", "b")).value("c")


def test_a_run_that_is_given_twice_counts_once(tmp_path, rng):
    path = gas(tmp_path / "gas.h5", rng)
    result = ricochet.analyse("speeds", [path, path])
    assert len(result.runs) == 1 and "the same as another run" in result.warnings[0]


def test_energies_of_two_samples_are_no_curve(simulated):
    text = "&species count = 20 radius = 0.01 speed = 1 / &stop time = 1 / &output {} /"
    for schedule, warned in ("frames_every_time = 0.1", 1), ("observables_every_time = 0.1", 0):
        result = ricochet.analyse("energy", simulated(text.format(schedule)))
        assert len(result.warnings) == warned
        assert all("observables_every_time" in line for line in result.warnings)


def test_a_notebook_shows_figure_and_table(tmp_path, rng):
    result = ricochet.analyse("energy", falling(tmp_path / "fall.h5", rng))
    page = result._repr_html_()
    assert "data:image/png;base64," in page and "<th>largest_change</th>" in page
    assert str(result).startswith("energy of 1 run\n")


def test_the_table_is_a_data_frame(runs):
    pytest.importorskip("pandas")
    result = ricochet.analyse("speeds", runs["speeds"])
    frame = result.to_dataframe()
    assert list(frame.columns) == list(result.table[0]) and np.all(frame["N"] == [200, 300])


def test_the_list_of_analyses_has_a_line_for_each(capsys):
    assert run_script("analyses") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == sorted(ricochet.analyses) == [*ricochet.analyses]
    assert "speeds" in ricochet.analyses and ricochet.analyses["speeds"].startswith("Speed dist")
