"""Fixtures of the tests of post/."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from browser import browsing
from gas_inputs import GAS, USUAL
from laboratory import laboratory
from laboratory_page import moving
from ricochet import read_run
from synthetic_run import ROOT, run_script
from whole_runs import FINISHED, write_input


@pytest.fixture
def rng():
    """Return a generator of random numbers with a fixed seed."""
    return np.random.default_rng(8)


@pytest.fixture
def simulated(ricochet, tmp_path, made_once):
    """Return a function that simulates a system given by an input file or its text.

    Each system is simulated once per session; each test receives a copy of the output file.
    """

    def run(system, *settings, name="gas"):
        path = system if isinstance(system, Path) else write_input(tmp_path, system)
        options = [word for one in settings for word in ("--set", one)]

        def simulate(output):
            done = ricochet(path, *options, "--quiet", "--force", "-o", output)
            assert done.returncode == FINISHED, done.stderr

        text, output = f"{path.read_text()}{settings}", tmp_path / f"{name}.h5"
        if re.search(r"\bfile *=", text):  # the file may have different content the next time
            simulate(output)
        else:
            shutil.copy(made_once(text, simulate), output)
        return read_run(output)

    return run


@pytest.fixture(scope="session")
def chromium(tmp_path_factory):
    """Yield a browser for all tests."""
    with browsing(tmp_path_factory.mktemp("browser")) as one:
        yield one


@pytest.fixture
def browser(chromium):
    """Return the browser in its initial state."""
    chromium.open("about:blank")
    chromium.resize(1280, 800)
    chromium.complaints()
    return chromium


@pytest.fixture
def playing(browser, tmp_path):
    """Return a function that makes the player of a run and opens it, paused."""

    def play(path, *options):
        assert run_script("player", path, "-o", tmp_path / "film.html", *options) == 0
        browser.open(tmp_path / "film.html")
        browser.run("go(first())")
        return browser

    return play


@pytest.fixture(scope="session")
def address(program, tmp_path_factory):
    """Return the address of a laboratory for all tests that do not end its processes."""
    with laboratory(program, tmp_path_factory.mktemp("lab")) as (process, address):
        yield address
        assert process.poll() is None


@pytest.fixture
def opened(browser, address):
    """Return the browser with a new page of the laboratory, once its first run moves."""
    browser.open(address)
    yield moving(browser)
    assert browser.complaints() == []
    browser.open("about:blank")  # ends the runs


#: Settings of the gases simulated by the fixture `bulk`.
RUNS = (
    ("species.disks.packing_fraction=0.05", "output.frames_every_time=0.04"),
    ("species.disks.packing_fraction=0.3", "output.frames_every_time=0.02"),
    (
        "species.disks.packing_fraction=0.02",
        "output.frames_every_time=0.1",
        "contact.restitution=0.9",
    ),
)


@pytest.fixture
def bulk(simulated):
    """Simulate small gases at two packing fractions, and a cooling gas."""
    settings = ["species.disks.count=100", "stop.collisions_per_disk=60"]
    settings += ["output.observables_every_collisions=25", "output.event_log=true"]
    system = ROOT / "input" / "bulk.nml"
    each = enumerate(RUNS)
    return [simulated(system, *settings, *more, name=f"{k}").path for k, more in each]


@pytest.fixture
def gas(simulated):
    """Write a run of a periodic gas with additional features."""
    return lambda name="gas", **unusual: simulated(GAS.format(**USUAL | unusual), name=name)
