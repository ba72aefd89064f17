"""What a run reads from HDF5 files is checked like text, and comes from no other file."""

import os
import subprocess
import sys

import fuzz_checkpoint
import h5py
import numpy as np
import pytest

from whole_runs import FILES, FINISHED, STOPPED, USAGE, one_line, seal, write_input

CHECK = pytest.mark.check

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


def put(name, place, value):
    return lambda file: file[name].__setitem__(place, value)


@pytest.mark.parametrize("options", [[], ["--check"]])
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
def test_numbers_from_a_run_are_checked_like_those_of_a_text(onward, edit, says, options):
    run = onward(edit, *options)
    assert run.returncode == USAGE
    assert one_line(run).startswith(f"x.h5: {says}")


def test_numbers_of_earlier_frames_are_not_read(onward):
    assert onward(put(VELOCITY, (0, 0, 0), np.nan)).returncode == FINISHED


def elsewhere(how, name):
    """Lets `fuzz_checkpoint` replace a dataset by one whose values would be in `fifo`."""
    return lambda file: fuzz_checkpoint.remake(name, fuzz_checkpoint.SHAPES[how], file)


@pytest.mark.parametrize("how", ["elsewhere", "outside", "virtual", "a loop", "enormous"])
@pytest.mark.parametrize("name", [POSITION, "particles/disks/species", "parameters/species/names"])
def test_a_file_of_a_run_leads_to_no_other(onward, tmp_path, how, name):
    os.mkfifo(tmp_path / "fifo")
    run = onward(elsewhere(how, name))
    assert run.returncode == FILES and name in one_line(run)


@pytest.fixture
def resumed(ricochet, tmp_path):
    """`resumed(edit)`: a stopped run goes on from a checkpoint that is edited and sealed anew.

    It was stopped one step after time 20, whatever the machine.
    """
    write_input(tmp_path, TWO_SPECIES)
    command = ["gas.nml", "-o", "gas.h5", "--quiet", "--set", "output.frames_every_time=1e5"]
    assert ricochet(*command).returncode == FINISHED
    command += ["--set", "stop.time=1e6", "--set", "stop.wall_clock=1e-9"]
    assert ricochet(*command, "--resume").returncode == STOPPED
    checkpoint = tmp_path / "gas.chk.h5"

    def run(edit):
        with h5py.File(checkpoint, "r+") as file:
            edit(file)
        seal(checkpoint)
        return ricochet(*command, "--resume")

    return run


def change(name, place, new):
    """The value `new(old)` in the place of the old one."""
    return lambda file: file[name].__setitem__(place, new(file[name][place]))


def copy(name, one, other):
    return lambda file: file[name].__setitem__(other, file[name][one])


FRAMES = "progress/frames/"


@pytest.mark.parametrize(
    ("edit", "says"),
    [
        (put("disks/species", 3, 10**9), "disks/species, row 4 is 1000000000; possible: 1 to 2;"),
        (put("disks/species", 3, 0), "disks/species, row 4 is 0; possible: 1 to 2;"),
        (change("disks/species", 3, lambda s: 3 - s), "disks/species, row 4 is "),
        (put("disks/id", 7, 0), "disks/id, row 8 is 0; possible: 1 to 40;"),
        (put("disks/id", 7, 10**9), "disks/id, row 8 is 1000000000; possible: 1 to 40;"),
        (copy("disks/id", 2, 9), "disks/id, row 10 is "),
        (put("now", 0, np.nan), "now is NaN; possible: 0 to 1e101;"),
        (put("now", 0, -1.0), "now is -1; possible: 0 to 1e101;"),
        (change("now", 0, lambda now: now + 1e9), "disks/x1, x2, row 1: the disk is outside the"),
        (put("epoch", 0, np.inf), "epoch is Infinity; possible: 0 to 1e101;"),
        (put("epoch", 0, 1e90), "progress/frames: the last sample is of time "),
        (put("disks/v1", 5, np.inf), "disks/v1, row 6 is Infinity; possible: "),
        (change("disks/v1", 5, lambda v: 2 * v + 1), "start_energy less dissipated is "),
        (put("disks/v2", 5, 1e99), ""),
        (put("disks/x1", 39, 1e99), "disks/x1, x2, row 40: the disk is outside the box, at 1e99"),
        (put("disks/x2", 0, np.nan), "disks/x2, row 1 is NaN; possible: "),
        (change("disks/clock", 1, lambda t: t + 1), "disks/clock, row 2 is "),
        (put("disks/clock", 1, -1e99), "disks/clock, row 2 is -1e99; possible: "),
        (put("disks/collisions", 1, -1), "disks/collisions, row 2 is -1; possible: 0 to "),
        (change("disks/collisions", 1, lambda n: n + 1), "disks/collisions add up to "),
        (put("disks/image1", 1, 10**9), "disks/image1, image2, row 2: the disk cannot have gone"),
        (put("disks/image2", 1, 3), "disks/image2, row 2 is 3; possible: 0 to 0;"),
        (put("collisions", 0, -5), "collisions is -5; possible: 0 to 9007199254740992;"),
        (change("collisions", 0, lambda n: n + 1), "events is "),
        (put("surfaces/collisions", 2, 2**63 - 1), f"surfaces/collisions, row 3 is {2**63 - 1};"),
        (put("sums/high", 0, 2**62), "sums/high, row 1 is 4611686018427387904; possible: "),
        (change("sums/high", 1, lambda e: e + 10**18), "start_energy less dissipated is "),
        (put("start_energy", 0, -1), "start_energy is -1; possible: 0 to "),
        (put("epoch_events", 0, 10**15), "epoch_events is 1000000000000000 after "),
        (put("epoch_begin", 0, 1e9), "epoch_begin is 1e9, epoch_end "),
        (put("epoch_end", 0, 0.0), "epoch_begin is "),
        (put("last_advance", 0, 1e9), "last_advance is 1e9, now "),
        (put(FRAMES + "count", 0, 0), "progress/frames/count is 0; possible: 1 to "),
        (put(FRAMES + "last_time", 0, np.nan), "progress/frames/last_time is NaN; possible: "),
        (put(FRAMES + "last_time", 0, 1e9), "progress/frames: the last sample is of time 1e9 and"),
        (put(FRAMES + "last_events", 0, 10**12), "progress/frames: the last sample is of time "),
        (put("progress/events", 0, 3), "progress/events is 3 instead of 0;"),
        (put("progress/spent", 0, np.nan), "progress/spent is NaN; possible: 0 to "),
        (lambda file: file.__delitem__("disks/clock"), "it cannot be read: disks/clock;"),
        (elsewhere("outside", "now"), "it cannot be used: now keeps its values in another file;"),
        (elsewhere("texts", "now"), "it cannot be read: now;"),
        (elsewhere("one more", "disks/id"), "it cannot be read: disks/id;"),
    ],
)
def test_a_checkpoint_with_a_right_checksum_is_not_trusted(resumed, edit, says):
    run = resumed(edit)
    assert run.returncode == USAGE
    assert one_line(run).startswith(f"gas.chk.h5: is damaged: {says}")
    assert run.stderr.endswith("--force instead of --resume starts over\n")


def test_a_checkpoint_that_is_sealed_anew_as_it_is_goes_on(resumed):
    assert resumed(lambda file: None).returncode == STOPPED


def test_a_checkpoint_asks_for_no_more_frames_than_there_are(resumed):
    run = resumed(put(FRAMES + "count", 0, 10**9))
    assert run.returncode == FILES and "committed is " in one_line(run)


@pytest.mark.parametrize("name", ["position/value", "position/time", "velocity/value"])
def test_nothing_is_written_into_a_file_that_the_output_names(resumed, tmp_path, name):
    precious = tmp_path / "precious"
    precious.write_bytes(b"x" * 100000)

    def lead_away(file, name, values):
        values = np.asarray(values)
        kind = {"shape": values.shape, "dtype": values.dtype}
        file.create_dataset(name, **kind, external=[(str(precious), 0, max(values.nbytes, 8))])

    with h5py.File(tmp_path / "gas.h5.part", "r+") as file:
        fuzz_checkpoint.remake(f"particles/disks/{name}", lead_away, file)
    run = resumed(lambda file: None)
    assert run.returncode == FILES and "another file" in one_line(run)
    assert precious.read_bytes() == b"x" * 100000


def test_checkpoints_with_right_checksums_never_harm(program):
    verdicts = fuzz_checkpoint.fuzz(str(program), 90, seed=2)
    assert set(verdicts) <= fuzz_checkpoint.HARMLESS
    assert verdicts["refused"] > 30 and verdicts["finished"] > 5


@CHECK
def test_thousands_of_checkpoints_with_right_checksums_never_harm(program):
    command = [sys.executable, fuzz_checkpoint.__file__, "--program", program, "--count", "3000"]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr[-5000:]
