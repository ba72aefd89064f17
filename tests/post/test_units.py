"""Names of units on the axes of figures."""

import numpy as np
import pytest

from ricochet import read_run, script
from ricochet.reading.units import POWERS, UNNAMED, Units, units_of
from synthetic_gases import falling, gas as relaxed
from synthetic_run import ROOT, maxwell_velocities, run_script, write_run


def test_units_are_made_of_length_time_and_mass():
    units = units_of("length=m, time=s, mass=kg")
    assert units == Units("m", "s", "kg")
    found = {name: units.name(name) for name in POWERS}
    assert found == {
        "number": "",
        "length": "m",
        "time": "s",
        "mass": "kg",
        "rate": "1/s",
        "speed": "m/s",
        "squared speed": "m²/s²",
        "energy": "kg m²/s²",
        "number density": "1/m²",
        "stress": "kg/s²",
        "viscosity": "kg/s",
        "heat flux": "kg m/s³",
    }
    assert units.name("1/speed") == "s/m" and units.name("1/squared speed") == "s²/m²"
    assert units._replace(energy="J").name("energy") == "J"
    assert Units(time="s").label("time t", "time") == "time t (s)"
    assert Units(time="s").label("speed") == "speed (reduced units)", "its length is unknown"
    assert UNNAMED.label("share", "number") == "share"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("lenght=m", "'lenght' is not one of length, time, mass, energy; did you mean length?"),
        ("time", "'time' has no name of a unit, as length=cm has"),
        ("time=", "'time=' has no name of a unit, as length=cm has"),
        ("time=s,time=h", "time is given twice"),
    ],
)
def test_what_is_no_name_of_a_unit_is_refused(capsys, text, problem):
    assert run_script("snapshot", "any.h5", "--units", text) == 2
    assert problem.replace("length?", "") in capsys.readouterr().err


def test_no_script_writes_a_unit_of_its_own():
    """All labels use `Units.label`; otherwise --units would be ignored silently."""
    paths = [*ROOT.glob("post/*.py"), *ROOT.glob("post/ricochet/*/*.py")]
    names = {path.name for path in paths if "(reduced units)" in path.read_text()}
    assert names == {"units.py"}


def test_the_axes_of_a_figure_have_the_named_units(tmp_path, rng, monkeypatch):
    """Films and pictures also use the names of the units."""
    v = maxwell_velocities(rng, 3, 20)
    more = {"observables": {"collisions": np.arange(3)}}
    path = write_run(tmp_path / "gas.h5", rng.uniform(0.1, 0.9, v.shape), v, **more)
    assert read_run(path).units == UNNAMED
    texts = []

    def kept(figure, *_):
        texts.extend(axes.get_ylabel() for axes in figure.axes)

    monkeypatch.setattr(script, "save", kept)
    words = ("--units", "length=cm,time=s", "--colour", "speed")
    assert run_script("snapshot", path, "-o", tmp_path / "a.png", *words) == 0
    assert "speed (cm/s)" in texts and "y (cm)" in texts
    assert np.all(["reduced" not in text for text in texts])
    assert run_script("snapshot", path, "-o", tmp_path / "a.png") == 0
    assert "y" in texts, "the box without names of units"
    page = tmp_path / "a.html"
    assert run_script("player", path, "-o", page, *words) == 0
    assert "speed (cm/s)" in page.read_text()


@pytest.mark.parametrize(
    ("script", "words", "units"),
    [
        ("gravity", [], {"s²/cm²", "1/cm"}),
        ("mixture", [], {"s/cm"}),
        ("speeds", ["--unscaled"], {"s/cm"}),
    ],
)
def test_the_axes_of_densities_have_the_reciprocal_unit(
    tmp_path, rng, monkeypatch, script, words, units
):
    path, labels = falling(tmp_path / "gas.h5", rng), []

    def kept(figure, *_):
        labels.extend(axes.get_ylabel() for axes in figure.axes)

    monkeypatch.setattr("ricochet.script.save", kept)
    if script == "speeds":
        path = relaxed(tmp_path / "one.h5", rng)
    given = ["--units", "length=cm,time=s,mass=g", "-o", tmp_path / "a.png"]
    assert run_script(script, path, *given, *words) == 0
    found = {label.rpartition("(")[2].strip(")") for label in labels if "density" in label}
    assert found == units
