"""Execute every example in the docstring of a public function."""

import doctest
import sys
from importlib import import_module
from importlib.util import find_spec

import numpy as np
import pytest

import ricochet

sys.path.insert(0, str(ricochet.commands.HERE.parents[1] / "tests" / "support"))

from check_docstrings import MODULES, members_of

FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
GAS = {
    "box": {"boundary": ("periodic", "periodic")},
    "species": {"name": "gas", "count": 64, "packing_fraction": 0.3, "temperature": 1.0},
    "stop": {"collisions_per_disk": 60},
    "output": {
        "event_log": True,
        "helfand": True,
        "frames_every_time": 0.02,
        "observables_every_time": 0.004,
    },
}
HOT = {
    "box.boundary": ("wall", "periodic"),
    "contact.wall_rule": "normal",
    "stop.collisions_per_disk": 200,
}
ROUGH = {"contact.restitution": 0.9, "contact.tangential_restitution": 0.5}
MIXED = {
    "box": {"boundary": ("periodic", "periodic")},
    "species": [
        {"name": name, "count": 32, "packing_fraction": 0.05, "temperature": 1, "mass": mass}
        for name, mass in (("light", 1), ("heavy", 4))
    ],
    "contact": {"restitution": 0.8},
    "stop": {"collisions_per_disk": 12},
}
CRATER = """&species name = 'bed' count = 60 packing_fraction = 0.5 region = 0, 1, 0, 0.5 /
&species name = 'projectile' relative_to = 'bed' mass = 25 radius = 2 position = 0.5, 0.8
  velocity = 0, -5 /
&contact restitution = 0.5 contact_time = 1e-5 /
&stop energy_fraction = 0.1 /
"""


@pytest.fixture(scope="session")
def names(request, tmp_path_factory):
    """Return the objects that examples may use: `run`, `runs`, `mixed_runs` and others."""
    patch = pytest.MonkeyPatch()
    patch.setenv("RICOCHET", str(request.getfixturevalue("program")))
    folder = tmp_path_factory.mktemp("examples")

    def made(name: str, system: object, **more: object) -> ricochet.Run:
        return ricochet.run(system, more, folder / f"{name}.h5", progress=False)

    runs = [made(f"gas_{seed}", GAS, **{"run.seed": seed}) for seed in (1, 2, 3)]
    cool = {"contact.restitution": 0.9}
    cooling_runs = [made(f"cool_{seed}", GAS, **{"run.seed": seed}, **cool) for seed in (1, 2, 3)]
    yield {
        "np": np,
        "ricochet": ricochet,
        "run": runs[0],
        "runs": runs,
        "cooling_runs": cooling_runs,
        "bed_run": made("bed", CRATER),
        "heated_runs": [made("hot", GAS, **HOT)],
        "rough_runs": [made(f"rough_{k}", GAS, **{"run.seed": k}, **ROUGH) for k in (1, 2)],
        "small": {"species": {"count": 20, "radius": 0.01, "speed": 1}, "stop": {"collisions": 20}},
        "mixed_runs": [made(f"mixed_{k}", MIXED, **{"run.seed": k}) for k in (1, 2)],
        "has_xarray": bool(find_spec("xarray")),
        "has_gsd": bool(find_spec("gsd")),
        "has_mdanalysis": bool(find_spec("MDAnalysis")),
        "has_pandas": bool(find_spec("pandas")),
        "walled_run": made("walls", GAS, **{"box.boundary": ("wall", "wall")}),
        **{name: import_module(f"ricochet.{name}") for name in MODULES},
        "folder": folder,
    }
    patch.undo()


@pytest.mark.parametrize("module", ["ricochet", *(f"ricochet.{name}" for name in MODULES)])
def test_the_examples_of_a_module_work(module, names):
    """The namespace has NumPy, the names of the module, and a few small runs."""
    loaded = import_module(module)
    finder, runner = doctest.DocTestFinder(), doctest.DocTestRunner(optionflags=FLAGS)
    told: list[str] = []
    globs = {**vars(loaded), **names}
    found = finder.find(loaded, globs=globs)
    if module == "ricochet":  # defined in other modules
        for name in loaded.__all__:
            own = getattr(loaded, name)
            found += finder.find(own, name, globs=globs)
            for member in members_of(own) if isinstance(own, type) else ():
                if member not in vars(own):  # a member of a base class
                    found += finder.find(getattr(own, member), f"{name}.{member}", globs=globs)
    for test in found:
        runner.run(test, out=told.append, clear_globs=False)
    assert not runner.failures, "".join(told)
    assert runner.tries
