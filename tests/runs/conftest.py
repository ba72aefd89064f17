"""Fixtures of the tests of whole runs."""

import pytest

from library_systems import GAS
from ricochet import read_run
from whole_runs import ran


@pytest.fixture(scope="module")
def whole(program, tmp_path_factory):
    """Return the settings of an input, and the output file of a complete run."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "gas.nml").write_text(GAS)
    ran(program, "gas.nml", "-o", "gas.h5", "--quiet", cwd=folder, check=True)
    return read_run(folder / "gas.h5")
