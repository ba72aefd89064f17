"""Links, pipes, devices and foreign files at paths that a run reads or writes."""

import os
import shutil
import signal
import tempfile
from pathlib import Path

import pytest

from whole_runs import FILES, FINISHED, STOPPED, USAGE
from whole_runs import differences, frames_in, occupy, one_line, ran, wait_for, with_fsync
from whole_runs import write_input

SHORT = """&species name = 'gas' count = 20 radius = 0.02 speed = 1 /
&stop time = 1 /
&output frames_every_time = 0.1 /
"""
ENDLESS = SHORT.replace("time = 1 ", "time = 1e6 ").replace("0.1", "5")
COMMAND = ["gas.nml", "-o", "gas.h5", "--quiet"]
AT_ONCE = ["--set", "stop.wall_clock=1e-9"]
#: In the first case, the results are complete except for the data written at the end of a run.
PAUSE = "static int n; if (!n++) raise(SIGSTOP); return 0;"


def everything_in(folder) -> dict[str, object]:
    """Return all paths in a folder, with the contents of files and the targets of links."""
    return {str(path): what_stands(path) for path in Path(folder).rglob("*")}


@pytest.mark.parametrize("place", ["gas.h5", "gas.h5.lock", "gas.h5.part", "gas.h5.part_new"])
@pytest.mark.parametrize(
    "kind", ["link", "hard link", "link to nothing", "pipe", "device", "folder", "file"]
)
def test_what_no_run_has_made_is_neither_written_through_nor_removed(
    ricochet, tmp_path, place, kind
):
    """This applies to links and foreign objects, with or without --force."""
    write_input(tmp_path, SHORT)
    precious = tmp_path / "home" / "precious"
    precious.parent.mkdir()
    precious.write_text("ten years of data")
    assert ricochet(*COMMAND, *AT_ONCE).returncode == STOPPED
    (tmp_path / place).unlink(missing_ok=True)
    occupy(tmp_path / place, kind, precious)
    before = everything_in(tmp_path)
    for option in ("--resume", "--force", "--quiet"):
        run = ricochet(*COMMAND, option)
        assert run.returncode in (USAGE, FILES)
        assert place in one_line(run)
        assert everything_in(tmp_path) == before


def test_a_run_goes_on_only_in_a_file_without_another_name(ricochet, tmp_path):
    write_input(tmp_path, SHORT)
    assert ricochet(*COMMAND, *AT_ONCE).returncode == STOPPED
    part, copy = tmp_path / "gas.h5.part", tmp_path / "copy"
    copy.hardlink_to(part)
    before = copy.read_bytes()
    run = ricochet(*COMMAND, "--resume")
    assert run.returncode == FILES
    assert one_line(run).startswith("gas.h5.part: ") and "second name" in run.stderr
    assert copy.read_bytes() == before
    copy.unlink()
    assert ricochet(*COMMAND, "--resume").returncode == FINISHED


def test_what_a_killed_run_has_half_made_is_in_nobodys_way(ricochet, tmp_path):
    write_input(tmp_path, SHORT)
    assert ricochet("gas.nml", "-o", "whole.h5").returncode == FINISHED
    assert ricochet(*COMMAND, *AT_ONCE).returncode == STOPPED
    for content in (b"", bytes(4096), (tmp_path / "gas.h5.part").read_bytes()[:3000]):
        (tmp_path / "gas.h5.part_new").write_bytes(content)
        (tmp_path / "gas.h5.lock").touch()
        assert ricochet(*COMMAND, *AT_ONCE, "--resume").returncode == STOPPED
    assert ricochet(*COMMAND, "--resume").returncode == FINISHED
    assert sorted(path.name for path in tmp_path.iterdir()) == ["gas.h5", "gas.nml", "whole.h5"]


def test_a_run_that_was_killed_before_its_first_checkpoint_goes_on(ricochet, started, tmp_path):
    """Without a checkpoint it starts again from its initial state."""
    write_input(tmp_path, ENDLESS)
    process = started(*COMMAND)
    wait_for(lambda: frames_in(tmp_path / "gas.h5.part") > 10)
    process.kill()
    process.wait()
    before = (tmp_path / "gas.h5.part").read_bytes()
    end = ["--set", "stop.time=9"]
    run = ricochet(*COMMAND, *end)
    assert run.returncode == FILES and "--resume" in one_line(run) and "--force" in run.stderr
    assert (tmp_path / "gas.h5.part").read_bytes() == before
    assert ricochet(*COMMAND, *end, "--resume").returncode == FINISHED
    assert ricochet("gas.nml", "-o", "whole.h5", *end).returncode == FINISHED
    assert differences(tmp_path / "gas.h5", tmp_path / "whole.h5") == []


def test_the_folder_of_the_output_may_be_a_link(ricochet, tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "link").symlink_to("disk")
    assert ricochet(write_input(tmp_path, SHORT), "-o", "link/gas.h5").returncode == FINISHED
    assert [path.name for path in (tmp_path / "disk").iterdir()] == ["gas.h5"]


@pytest.mark.parametrize("name", ["places.txt", "places.h5"])
@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "link to nothing"])
def test_positions_come_from_files_only(ricochet, tmp_path, name, kind):
    occupy(tmp_path / name, kind, tmp_path / "precious")
    placed = f"radius = 0.02 placement = 'file' file = '{name}' velocities = 'rest'"
    write_input(tmp_path, SHORT.replace("radius = 0.02 speed = 1", placed))
    run = ricochet("gas.nml", "--check")
    assert run.returncode == FILES
    assert f"{name}: cannot be read: " in one_line(run)


@pytest.mark.parametrize(
    ("options", "code"),
    [
        (["gas.nml", "-o", "a\nb.h5"], FINISHED),
        (["gas.nml", "-o", "a\nb/"], FILES),
        (["no\nfile"], FILES),
        (["gas.nml", "--set", "run\n.seed=1"], USAGE),
        (["gas.nml", "--set", "run.seed=\n1x"], USAGE),
        (["gas.nml", "-o", "folder\n/b.h5"], FINISHED),
    ],
)
def test_names_with_line_breaks_break_no_line(ricochet, tmp_path, options, code):
    write_input(tmp_path, SHORT)
    run = ricochet(*options)
    assert run.returncode == code
    lines = run.stderr.splitlines()
    assert len(lines) <= 1 and all("?" in line for line in lines)
    assert all(" = " in line for line in run.stdout.splitlines())


@pytest.mark.parametrize(
    ("taken", "owner"),
    [("x.h5.part", "x.h5"), ("some/x.h5.lock", "some/x.h5"), ("x.part_new", "x")],
)
def test_no_output_has_the_name_of_a_file_of_another_run(ricochet, tmp_path, taken, owner):
    run = ricochet(write_input(tmp_path, SHORT), "-o", taken)
    assert run.returncode == USAGE
    assert f'"{taken}"' in one_line(run) and f'"{owner}"' in run.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["gas.nml"]


def test_outputs_that_differ_in_any_letter_share_nothing(ricochet, tmp_path):
    write_input(tmp_path, SHORT)
    names = ["x", "x.h5", "x.h", "x.part_", "x.h5 "]
    for name in names:
        assert ricochet("gas.nml", "-o", name, *AT_ONCE).returncode == STOPPED
    for name in names:
        assert ricochet("gas.nml", "-o", name, "--resume").returncode == FINISHED
    for name in names[1:]:
        assert differences(tmp_path / "x", tmp_path / name) == []


# --- at its end a run replaces only the file that existed at its start ---

#: Options with which a run starts if there is a result of an earlier run.
BEGINNINGS = {"in an empty place": [], "from a finished run": ["--resume"], "over one": ["--force"]}
EARLY = ["--set", "stop.time=0.5"]


@pytest.fixture(params=BEGINNINGS)
def beginning(request, ricochet, tmp_path):
    """Return the options of a run, with or without an earlier result at the output path."""
    write_input(tmp_path, SHORT)
    if BEGINNINGS[request.param]:
        assert ricochet(*COMMAND, *EARLY).returncode == FINISHED
    return BEGINNINGS[request.param]


def put(kind, place, other):
    """Create a file, folder or link at the path of the result."""
    if kind == "another run":
        shutil.copy(other, place.with_name("copy"))
        place.with_name("copy").replace(place)
    elif kind == "another run in the same inode":
        place.write_bytes(other.read_bytes())
    elif kind == "a changed bit, with the same date":
        if not place.exists():
            place.write_bytes(other.read_bytes())
        date, content = place.stat().st_mtime_ns, bytearray(place.read_bytes())
        content[len(content) // 2] ^= 1
        place.write_bytes(content)
        os.utime(place, ns=(date, date))
    elif kind == "a link":  # to the former object, or to nothing
        if place.exists():
            place.rename(place.with_name("moved"))
        place.symlink_to("moved")
    elif kind == "an empty file":
        place.write_bytes(b"")
    else:
        place.unlink(missing_ok=True)
        place.mkdir()


def what_stands(place):
    """Return a comparable description of the object at a path."""
    return place.readlink() if place.is_symlink() else place.is_file() and place.read_bytes()


@pytest.mark.parametrize(
    "kind",
    [
        *("another run", "another run in the same inode", "a changed bit, with the same date"),
        *("an empty file", "a folder", "a link"),
    ],
)
@pytest.mark.parametrize("moment", ["while it runs", "while it is stopped"])
def test_what_has_come_since_the_run_began_is_left(
    ricochet, started, tmp_path, beginning, kind, moment
):
    """An object that appears at the output path during the run is not replaced.

    The results remain in the .part file.
    """
    other, place = tmp_path / "other.h5", tmp_path / "gas.h5"
    assert ricochet("gas.nml", "-o", other, *EARLY, "--set", "run.seed=2").returncode == FINISHED
    if moment == "while it runs":
        process = started(*COMMAND, *beginning, env=with_fsync(tmp_path, PAUSE))
        assert os.WIFSTOPPED(os.waitpid(process.pid, os.WUNTRACED)[1])
        put(kind, place, other)
        process.send_signal(signal.SIGCONT)
        message = process.communicate(timeout=60)[1]
        assert process.returncode == FILES, message
        assert len(message.splitlines()) == 1 and "gas.h5.part" in message
        assert frames_in(tmp_path / "gas.h5.part") == 11
    else:
        assert ricochet(*COMMAND, *beginning, *AT_ONCE).returncode == STOPPED
        put(kind, place, other)
    before = what_stands(place)
    run = ricochet(*COMMAND, "--resume")
    assert run.returncode == FILES and one_line(run).startswith("gas.h5: ")
    assert what_stands(place) == before
    place.rename(tmp_path / "away")
    assert ricochet(*COMMAND, "--resume").returncode == FINISHED
    assert what_stands(tmp_path / "away") == before
    assert ricochet("gas.nml", "-o", "whole.h5").returncode == FINISHED
    assert differences(place, tmp_path / "whole.h5") == []


def test_a_copy_of_the_earlier_result_is_another_file(ricochet, tmp_path, beginning):
    """A run copied to another folder can continue there, but does not replace a result."""
    assert ricochet(*COMMAND, *beginning, *AT_ONCE).returncode == STOPPED
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    for path in tmp_path.glob("gas.*"):
        shutil.copyfile(path, folder / path.name)
    if beginning:
        run = ricochet(*COMMAND, "--resume", cwd=folder)
        assert run.returncode == FILES and "is not the file that was there" in one_line(run)
        (folder / "gas.h5").unlink()
    assert ricochet(*COMMAND, "--resume", cwd=folder).returncode == FINISHED
    assert ricochet("gas.nml", "-o", "whole.h5").returncode == FINISHED
    assert differences(tmp_path / "whole.h5", folder / "gas.h5") == []
    assert sorted(path.name for path in folder.iterdir()) == ["gas.h5", "gas.nml"]


def test_force_means_what_is_there_when_it_is_said(ricochet, tmp_path):
    write_input(tmp_path, SHORT)
    assert ricochet(*COMMAND, *AT_ONCE).returncode == STOPPED
    assert ricochet("gas.nml", "-o", "other.h5", *EARLY).returncode == FINISHED
    (tmp_path / "other.h5").rename(tmp_path / "gas.h5")
    before = everything_in(tmp_path)
    run = ricochet(*COMMAND)
    assert run.returncode == FILES and "--force" in one_line(run)
    assert everything_in(tmp_path) == before
    assert ricochet(*COMMAND, "--force").returncode == FINISHED
    assert frames_in(tmp_path / "gas.h5") == 11 and not (tmp_path / "gas.h5.part").exists()


# --- locks, users, folders ---


def test_a_lock_that_was_removed_and_taken_anew_stays(started, tmp_path):
    """When the first run ends, it must not remove the lock of the second one."""
    write_input(tmp_path, ENDLESS)
    process = started(*COMMAND)
    wait_for(lambda: frames_in(tmp_path / "gas.h5.part") > 10)
    lock = tmp_path / "gas.h5.lock"
    lock.unlink()
    lock.touch()
    process.send_signal(signal.SIGTERM)
    assert process.wait() == STOPPED
    assert lock.exists()


@pytest.mark.skipif(os.geteuid() != 0, reason="needs root, to be another user")
@pytest.mark.parametrize(("mode", "status"), [(0o555, FILES), (0o733, FINISHED)])
def test_a_run_needs_the_right_to_make_files_not_to_list_them(program, mode, status):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copy(program, folder)
        write_input(folder, SHORT).chmod(0o644)
        folder.chmod(mode)
        user = {"user": 65534, "group": 65534, "extra_groups": []}
        try:
            run = ran(folder / "ricochet", *COMMAND, cwd=folder, **user)
        except PermissionError:
            pytest.skip("no other user may enter the folders above this one")
    assert run.returncode == status, run.stderr
    if status == FILES:
        assert one_line(run).startswith("gas.h5: ") and "Permission denied" in run.stderr


def test_a_disk_that_cannot_synchronize_has_the_result(ricochet, tmp_path):
    """The result is complete even if the file system does not support fsync."""
    write_input(tmp_path, SHORT)
    refused = with_fsync(tmp_path, "errno = EINVAL; return -1;")
    run = ricochet(*COMMAND, "--set", "output.checkpoint_every=1e-6", env=refused)
    assert (run.returncode, run.stderr) == (FINISHED, "")
    assert (tmp_path / "gas.h5").exists()
