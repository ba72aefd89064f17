"""What a run reads from HDF5 files is checked like text, and comes from no other file."""

import os

import h5py
import numpy as np
import pytest

from whole_runs import FILES, FINISHED, STOPPED, USAGE, one_line, write_input

TWO_SPECIES = """&box boundary = 'periodic', 'wall' /
&species name = 'gas' count = 30 radius = 0.02 temperature = 1 /
&species name = 'stone' count = 10 radius = 0.04 mass = 4 temperature = 1 /
&stop time = 20 /
&output frames_every_time = 5 /
"""
ONWARD = """&box boundary = 'periodic', 'wall' /
&species name = 'gas' count = 30 radius = 0.02 file = 'x.h5' velocities = 'file' /
&species name = 'stone' count = 10 radius = 0.04 mass = 4 file = 'x.h5' velocities = 'file' /
&stop time = 1 /
"""
POSITION, VELOCITY = "particles/disks/position/value", "particles/disks/velocity/value"


def put(name, place, value):
    return lambda file: file[name].__setitem__(place, value)


def external(file, name, values):
    kind = {"shape": values.shape, "dtype": values.dtype}
    file.create_dataset(name, **kind, external=[("fifo", 0, values.nbytes)])


def virtual(file, name, values):
    layout = h5py.VirtualLayout(values.shape, values.dtype)
    layout[...] = h5py.VirtualSource("fifo", "x", values.shape)
    file.create_virtual_dataset(name, layout)


#: What a dataset may be instead of values: in another file, nowhere, or too many.
ELSEWHERE = {
    "a link": lambda file, name, values: file.__setitem__(name, h5py.ExternalLink("fifo", "x")),
    "external": external,
    "virtual": virtual,
    "a loop": lambda file, name, values: file.__setitem__(name, h5py.SoftLink(f"/{name}")),
    "enormous": lambda file, name, values: file.create_dataset(
        name, (2**40, 2**24), chunks=(64, 64), dtype=values.dtype
    ),
}


def elsewhere(how, name):
    """Puts something else in the place of a dataset."""

    def edit(file):
        values = file[name][()]
        del file[name]
        ELSEWHERE[how](file, name, np.asarray(values))

    return edit


@pytest.fixture
def onward(ricochet, tmp_path):
    """`onward(edit)`: a run that starts from a finished one whose file has been edited."""
    write_input(tmp_path, TWO_SPECIES)
    write_input(tmp_path, ONWARD, "onward.nml")
    assert ricochet("gas.nml", "-o", "x.h5").returncode == FINISHED

    def run(edit, *options):
        with h5py.File(tmp_path / "x.h5", "r+") as file:
            edit(file)
        return ricochet("onward.nml", "-o", "y.h5", *options)

    return run


@pytest.mark.parametrize(
    ("edit", "says"),
    [
        (put(VELOCITY, (-1, 0, 0), np.nan), f"{VELOCITY}: row 1 of the last frame: NaN is out of"),
        (put(VELOCITY, (-1, 39, 1), -np.inf), f"{VELOCITY}: row 40 of the last frame: -Infinity"),
        (put(VELOCITY, (-1, 7, 1), 1e101), f"{VELOCITY}: row 8 of the last frame: 1e101 is out of"),
        (put(POSITION, (-1, 3, 1), np.nan), f"{POSITION}: row 4 of the last frame: NaN is out of"),
        (put(POSITION, (-1, 3, 0), 1.5), f"{POSITION}: row 4 of the last frame: disk 4 at 1.5,"),
        (put(POSITION, (-1, 35), (0.01, 0.5)), f"{POSITION}: row 36 of the last frame: disk 6 at"),
    ],
)
def test_numbers_from_a_run_are_checked_like_those_of_a_text(onward, edit, says):
    for options in ([], ["--check"]):
        run = onward(edit, *options)
        assert run.returncode == USAGE
        assert f"x.h5: {says}" in one_line(run)


def test_numbers_of_earlier_frames_are_not_read(onward):
    assert onward(put(VELOCITY, (0, 0, 0), np.nan)).returncode == FINISHED


@pytest.mark.parametrize("how", ELSEWHERE)
@pytest.mark.parametrize("name", [POSITION, "particles/disks/species", "parameters/species/names"])
def test_a_file_of_a_run_leads_to_no_other(onward, tmp_path, how, name):
    os.mkfifo(tmp_path / "fifo")
    run = onward(elsewhere(how, name))
    assert run.returncode == FILES
    assert all(name in line for line in run.stderr.splitlines())


@pytest.mark.parametrize("how", ["a link", "external", "virtual", "a loop"])
@pytest.mark.parametrize(
    "name", [*(f"particles/disks/{x}" for x in ("committed", "position/value")), "checkpoint/1"]
)
def test_nothing_is_read_from_or_written_to_what_an_output_names(ricochet, tmp_path, how, name):
    """A stopped run that goes on; what it leads to is a pipe, and would keep it for ever."""
    write_input(tmp_path, TWO_SPECIES)
    command = ["gas.nml", "-o", "gas.h5", "--quiet"]
    for resume in ([], ["--resume"]):  # twice: the first one counts
        stopped = ricochet(*command, "--set", "stop.wall_clock=1e-9", *resume)
        assert stopped.returncode == STOPPED
    os.mkfifo(tmp_path / "fifo")
    with h5py.File(tmp_path / "gas.h5.part", "r+") as file:
        elsewhere(how, name)(file)
    run = ricochet(*command, "--resume")
    assert run.returncode in ((FINISHED, FILES) if name == "checkpoint/1" else (FILES,))
    assert run.returncode == FINISHED or "gas.h5.part" in one_line(run)
