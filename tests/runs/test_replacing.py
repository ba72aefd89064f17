"""What a run may replace at its end: the file that was there when it began, and no other."""

import os
import shutil
import signal
import subprocess

import pytest

from whole_runs import (
    FILES,
    FINISHED,
    STOPPED,
    differences,
    frames_in,
    one_line,
    write_input,
)

GAS = """&species name = 'gas' count = 20 radius = 0.02 speed = 1 /
&stop time = 3 /
&output frames_every_time = 0.1 /
"""
COMMAND = ["gas.nml", "-o", "gas.h5", "--quiet"]
SHORT = ["--set", "stop.time=1"]
AT_ONCE = ["--set", "stop.wall_clock=1e-9"]
#: How a run begins: with the option that it starts with where a finished run is.
BEGINNINGS = {"in an empty place": [], "from a finished run": ["--resume"], "over one": ["--force"]}
#: Its results are complete when the program first synchronizes a file: there it stops itself.
PAUSE = """#include <signal.h>
int fsync(int descriptor)
{
    static int paused;
    if (!paused++) raise(SIGSTOP);
    return 0 * descriptor;
}
"""


@pytest.fixture(params=BEGINNINGS)
def beginning(request, ricochet, tmp_path):
    """The options of a run, in whose place a finished run of one time unit is, or nothing."""
    write_input(tmp_path, GAS)
    if BEGINNINGS[request.param]:
        assert ricochet(*COMMAND, *SHORT).returncode == FINISHED
    return BEGINNINGS[request.param]


def another_run(place, other):
    """One of the same size is moved there."""
    shutil.copy(other, place.with_name("copy"))
    place.with_name("copy").replace(place)


def another_run_in_the_same_inode(place, other):
    place.write_bytes(other.read_bytes())


def a_changed_run(place, other):
    """One bit is another, and the date is as before."""
    if not place.exists():
        place.write_bytes(other.read_bytes())
    date, content = place.stat().st_mtime_ns, bytearray(place.read_bytes())
    content[len(content) // 2] ^= 1
    place.write_bytes(content)
    os.utime(place, ns=(date, date))


def an_empty_file(place, _):
    place.write_bytes(b"")


def a_folder(place, _):
    place.unlink(missing_ok=True)
    place.mkdir()


def a_link(place, _):
    """To what was there, or to nothing."""
    if place.exists():
        place.rename(place.with_name("moved"))
    place.symlink_to("moved")


def what_stands(place):
    """What a name stands for, so that it can be compared."""
    return place.readlink() if place.is_symlink() else place.is_file() and place.read_bytes()


def until_complete(started, folder, options):
    """Starts a run; it has stopped itself when its results are complete."""
    (folder / "pause.c").write_text(PAUSE)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", "pause.so", "pause.c"], cwd=folder, check=True)
    environment = {**os.environ, "LD_PRELOAD": str(folder / "pause.so")}
    process = started(*COMMAND, *options, env=environment)
    assert os.WIFSTOPPED(os.waitpid(process.pid, os.WUNTRACED)[1])
    return process


@pytest.mark.parametrize(
    "put",
    [
        *(another_run, another_run_in_the_same_inode, a_changed_run),
        *(an_empty_file, a_folder, a_link),
    ],
)
@pytest.mark.parametrize("moment", ["while it runs", "while it is stopped"])
def test_what_has_come_since_the_run_began_is_left(
    ricochet, started, tmp_path, beginning, put, moment
):
    """The results stay in the .part, and take their name when the place is free."""
    other, place = tmp_path / "other.h5", tmp_path / "gas.h5"
    assert ricochet("gas.nml", "-o", other, *SHORT, "--set", "run.seed=2").returncode == FINISHED
    if moment == "while it runs":
        process = until_complete(started, tmp_path, beginning)
        put(place, other)
        process.send_signal(signal.SIGCONT)
        message = process.communicate(timeout=60)[1]
        assert process.returncode == FILES, message
        assert len(message.splitlines()) == 1 and "gas.h5.part" in message
        assert frames_in(tmp_path / "gas.h5.part") == 31
    else:
        assert ricochet(*COMMAND, *beginning, *AT_ONCE).returncode == STOPPED
        put(place, other)
    before = what_stands(place)
    run = ricochet(*COMMAND, "--resume")
    assert run.returncode == FILES and one_line(run).startswith("gas.h5: ")
    assert what_stands(place) == before
    place.rename(tmp_path / "away")
    assert ricochet(*COMMAND, "--resume").returncode == FINISHED
    assert what_stands(tmp_path / "away") == before
    assert ricochet("gas.nml", "-o", "whole.h5").returncode == FINISHED
    assert differences(place, tmp_path / "whole.h5") == []


def test_a_stopped_run_knows_its_place_in_another_folder(ricochet, tmp_path, beginning):
    """Dates and inodes of copies are others; and the file may be removed."""
    assert ricochet(*COMMAND, *beginning, *AT_ONCE).returncode == STOPPED
    assert ricochet("gas.nml", "-o", "whole.h5").returncode == FINISHED
    for name in ("copy", "copy without it"):
        folder = tmp_path / name
        folder.mkdir()
        for path in tmp_path.glob("gas.*"):
            shutil.copyfile(path, folder / path.name)
        if name != "copy":
            (folder / "gas.h5").unlink(missing_ok=True)
        assert ricochet(*COMMAND, *AT_ONCE, "--resume", cwd=folder).returncode == STOPPED
        assert ricochet(*COMMAND, "--resume", cwd=folder).returncode == FINISHED
        assert differences(tmp_path / "whole.h5", folder / "gas.h5") == []
        assert sorted(path.name for path in folder.iterdir()) == ["gas.h5", "gas.nml"]


def test_force_means_what_is_there_when_it_is_said(ricochet, tmp_path):
    write_input(tmp_path, GAS)
    assert ricochet(*COMMAND, *AT_ONCE).returncode == STOPPED
    assert ricochet("gas.nml", "-o", "other.h5", *SHORT).returncode == FINISHED
    (tmp_path / "other.h5").rename(tmp_path / "gas.h5")
    assert ricochet(*COMMAND, "--force").returncode == FINISHED
    assert frames_in(tmp_path / "gas.h5") == 31
