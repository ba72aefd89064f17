"""The package: short names of its modules, and the cost of importing it."""

import ast
import importlib
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import ricochet
from ricochet.aliases import modules
from whole_runs import ran

INIT = Path(ricochet.__file__)
SCRIPTS = INIT.parents[1]


@pytest.mark.parametrize("name", modules())
def test_a_short_name_is_the_module_itself(name):
    """The short name works as an attribute, in `import`, and in `from ... import`."""
    whole = importlib.import_module(modules()[name])
    assert getattr(ricochet, name) is whole
    assert importlib.import_module(f"ricochet.{name}") is whole
    assert sys.modules[f"ricochet.{name}"] is whole and name in dir(ricochet)
    scope: dict = {}
    exec(f"from ricochet import {name}", scope)
    assert scope[name] is whole and whole.__spec__.name == whole.__name__ == modules()[name]


def test_no_module_has_the_name_of_another_or_of_a_function():
    """A short name would otherwise be ambiguous."""
    paths = [path for path in INIT.parent.glob("*/*.py") if path.stem != "__init__"]
    assert sorted(path.stem for path in paths) == sorted(modules())
    assert not modules().keys() & {*ricochet.__all__}


def test_type_checkers_see_the_modules_that_are_there():
    """Type checkers do not execute `__getattr__` but read the imports in `__init__.py`."""
    found = {
        name.asname: f"ricochet.{node.module}.{name.name}"
        for node in ast.walk(ast.parse(INIT.read_text()))
        if isinstance(node, ast.ImportFrom) and node.level == 1
        for name in node.names
        if name.asname and node.module and name.asname != "analyses"
    }
    assert found == modules()


def test_a_name_that_is_not_there_is_an_error():
    with pytest.raises(AttributeError, match="module 'ricochet' has no attribute 'structur'"):
        _ = ricochet.structur
    with pytest.raises(AttributeError, match=r"'load_run'; did you mean read_run\?$"):
        _ = ricochet.load_run
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("ricochet.structur")


def test_the_version_is_the_same_everywhere(program):
    """The versions of the package, the program and the citation are compared."""
    root = INIT.parents[2]
    version = ricochet.__version__
    assert f"ricochet {version}" in ran(program, "--version").stdout
    assert f"\nversion: {version}\n" in (root / "CITATION.cff").read_text()
    settings = tomllib.loads((root / "pyproject.toml").read_text())
    assert "version" in settings["project"]["dynamic"]
    assert root / settings["tool"]["hatch"]["version"]["path"] == INIT


def test_inputs_are_found_by_name(tmp_path, monkeypatch):
    """The working folder does not matter; for an unknown name a similar one is suggested."""
    monkeypatch.chdir(tmp_path)
    assert ricochet.example("gas") == ricochet.example("gas.nml")
    with ricochet.Simulation(ricochet.example("gas")) as gas:
        assert gas.n_disks > 1
    with pytest.raises(ricochet.RunError, match="no input carter; did you mean crater"):
        ricochet.example("carter")
    with pytest.raises(ricochet.RunError, match="there are active, brownian"):
        ricochet.example("../README")


def test_the_package_loads_no_more_than_its_names_need():
    heavy = ("matplotlib", "aiohttp", "scipy", "pandas", "ricochet.analysis", "ricochet.figures")
    code = f"import ricochet, sys; print([name for name in {heavy} if name in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_importing_a_script_leaves_the_figures_of_a_notebook_alone():
    """Figures drawn after importing any script keep their backend and style."""
    code = f"""if True:
        import pkgutil, sys
        import matplotlib
        matplotlib.use("svg")
        before = dict(matplotlib.rcParams)
        sys.path.insert(0, {str(SCRIPTS)!r})
        for script in pkgutil.iter_modules([{str(SCRIPTS)!r}]):
            __import__(script.name)
        assert dict(matplotlib.rcParams) == before
    """
    subprocess.run([sys.executable, "-c", code], check=True)
