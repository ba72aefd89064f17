"""What may stand where a run reads and writes: links, pipes, devices, files of others."""

import os
import shutil
import signal
import subprocess
import tempfile
from pathlib import Path

import pytest

from whole_runs import (
    FILES,
    FINISHED,
    PATIENCE,
    STOPPED,
    USAGE,
    differences,
    frames_in,
    held,
    one_line,
    wait_for,
    write_input,
)

SHORT = """&species name = 'gas' count = 20 radius = 0.02 speed = 1 /
&stop time = 1 /
&output frames_every_time = 0.1 /
"""
ENDLESS = SHORT.replace("time = 1 ", "time = 1e6 ").replace("0.1", "5")
COMMAND = ["gas.nml", "-o", "gas.h5"]
AT_ONCE = ["--set", "stop.wall_clock=1e-9"]
#: The output, and all that a run has beside it.
PLACES = [
    *("gas.h5", "gas.h5.lock", "gas.h5.part", "gas.h5.part_new"),
    *("gas.chk.h5", "gas.chk_prev.h5", "gas.chk_new.h5"),
]


def occupy(path, kind, precious):
    """Puts something in a place; links lead to a file of the user."""
    if kind == "link":
        path.symlink_to(precious)
    elif kind == "hard link":
        path.hardlink_to(precious)
    elif kind == "link to nothing":
        path.symlink_to(precious.with_name("new"))
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    else:
        path.write_text("notes")


def everything_in(folder) -> dict[str, object]:
    """Paths below a folder with what they hold, or where they lead."""
    return {
        str(path): path.readlink() if path.is_symlink() else path.is_file() and path.read_bytes()
        for path in Path(folder).rglob("*")
    }


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize(
    "kind", ["link", "hard link", "link to nothing", "pipe", "device", "folder", "file"]
)
def test_what_no_run_has_made_is_neither_written_through_nor_removed(
    ricochet, tmp_path, place, kind
):
    """By a new run, with --force or without, and by one that goes on."""
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


def test_the_checkpoint_may_have_a_second_name(ricochet, tmp_path):
    """As after a kill at the moment when it is also the previous one."""
    write_input(tmp_path, SHORT)
    assert ricochet(*COMMAND, *AT_ONCE).returncode == STOPPED
    (tmp_path / "gas.chk_prev.h5").hardlink_to(tmp_path / "gas.chk.h5")
    assert ricochet(*COMMAND, *AT_ONCE, "--resume").returncode == STOPPED
    assert ricochet(*COMMAND, "--resume").returncode == FINISHED


def test_what_a_killed_run_has_half_made_is_in_nobodys_way(ricochet, tmp_path):
    write_input(tmp_path, SHORT)
    assert ricochet("gas.nml", "-o", "whole.h5").returncode == FINISHED
    assert ricochet(*COMMAND, *AT_ONCE).returncode == STOPPED
    for content in (b"", bytes(4096), (tmp_path / "gas.h5.part").read_bytes()[:3000]):
        (tmp_path / "gas.h5.part_new").write_bytes(content)
        (tmp_path / "gas.h5.lock").touch()
        half = bytes(4096) if content else b""
        (tmp_path / "gas.chk_new.h5").write_bytes(half)
        assert ricochet(*COMMAND, *AT_ONCE, "--resume").returncode == STOPPED
    assert ricochet(*COMMAND, "--resume").returncode == FINISHED
    assert sorted(path.name for path in tmp_path.iterdir()) == ["gas.h5", "gas.nml", "whole.h5"]


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
    assert one_line(run).startswith(f"{name}: cannot be read: ")


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


def test_blanks_at_the_end_belong_to_a_name(ricochet, tmp_path):
    write_input(tmp_path, SHORT)
    (tmp_path / "doc ").write_text("chapter one")
    (tmp_path / "other.nml ").write_text(SHORT.replace("20", "30"))
    write_input(tmp_path, SHORT, "other.nml")
    run = ricochet("gas.nml", "-o", "doc ")
    assert run.returncode == FILES and one_line(run).startswith("doc : ")
    run = ricochet("gas.nml", "-o", "doc ", "--force")
    assert run.returncode == FILES
    assert (tmp_path / "doc ").read_text() == "chapter one"
    assert ricochet("gas.nml", "-o", "doc").returncode == FINISHED
    assert "30 disks" in ricochet("other.nml ", "--check").stdout


def test_a_run_that_was_killed_without_a_checkpoint_is_deleted_by_force_only(
    ricochet, started, tmp_path
):
    write_input(tmp_path, ENDLESS)
    part = tmp_path / "gas.h5.part"
    process = started(*COMMAND)
    wait_for(lambda: frames_in(part) > 10)
    process.kill()
    process.wait()
    before = part.read_bytes()
    for option in ("--quiet", "--resume"):
        run = ricochet(*COMMAND, "--set", "stop.time=9", option)
        assert run.returncode == FILES and "--force" in one_line(run)
        assert part.read_bytes() == before
    run = ricochet(*COMMAND, "--set", "stop.time=9", "--force")
    assert run.returncode == FINISHED
    assert not part.exists()


def test_a_stopped_run_goes_on_or_starts_over_as_the_message_says(ricochet, tmp_path):
    write_input(tmp_path, SHORT)
    assert ricochet(*COMMAND, *AT_ONCE).returncode == STOPPED
    before = everything_in(tmp_path)
    run = ricochet(*COMMAND)
    assert run.returncode == FILES
    assert "--resume goes on" in one_line(run) and "--force starts over" in run.stderr
    assert everything_in(tmp_path) == before
    assert ricochet(*COMMAND, "--force").returncode == FINISHED


@pytest.mark.parametrize(
    ("taken", "owner"),
    [
        ("x.chk.h5", "x.h5"),
        ("x.chk_prev.h5", "x.h5"),
        ("x.chk_new.h5", "x.h5"),
        ("x.h5.part", "x.h5"),
        ("some/x.h5.lock", "some/x.h5"),
        ("x.part_new", "x"),
        ("x.chk", "x"),
    ],
)
def test_no_output_has_the_name_of_a_file_of_another_run(ricochet, tmp_path, taken, owner):
    run = ricochet(write_input(tmp_path, SHORT), "-o", taken)
    assert run.returncode == USAGE
    assert f'"{taken}"' in one_line(run) and f'"{owner}"' in run.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["gas.nml"]


def test_outputs_that_differ_in_any_letter_share_nothing(ricochet, tmp_path):
    write_input(tmp_path, SHORT)
    names = ["x", "x.h5", "x.h", "x.chk_", "x.h5 "]
    for name in names:
        assert ricochet("gas.nml", "-o", name, *AT_ONCE).returncode == STOPPED
    for name in names:
        assert ricochet("gas.nml", "-o", name, "--resume").returncode == FINISHED
    for name in names[1:]:
        assert differences(tmp_path / "x", tmp_path / name) == []


def test_force_leaves_a_finished_run_alone_that_has_the_name_of_a_checkpoint(ricochet, tmp_path):
    write_input(tmp_path, SHORT)
    assert ricochet("gas.nml", "-o", "z.h5").returncode == FINISHED
    shutil.copy(tmp_path / "z.h5", tmp_path / "z.chk.h5")
    before = everything_in(tmp_path)
    run = ricochet("gas.nml", "-o", "z.h5", "--force")
    assert run.returncode == FILES and one_line(run).startswith("z.chk.h5: ")
    assert everything_in(tmp_path) == before


def test_a_file_that_appears_during_the_run_is_not_overwritten(started, tmp_path):
    write_input(tmp_path, ENDLESS)
    process = started(*COMMAND, "--set", "stop.time=30000")
    wait_for((tmp_path / "gas.h5.part").exists)
    with held(process):
        (tmp_path / "gas.h5").write_text("copied here meanwhile")
    message = process.communicate()[1]
    assert process.returncode == FILES and "gas.h5.part" in message.splitlines()[-1]
    assert (tmp_path / "gas.h5").read_text() == "copied here meanwhile"
    assert frames_in(tmp_path / "gas.h5.part") == 6001


def test_a_lock_that_was_removed_and_taken_anew_stays(started, tmp_path):
    """The first run's end must not unlock the second."""
    write_input(tmp_path, ENDLESS)
    process = started(*COMMAND)
    wait_for(lambda: frames_in(tmp_path / "gas.h5.part") > 10)
    lock = tmp_path / "gas.h5.lock"
    lock.unlink()
    lock.touch()
    process.send_signal(signal.SIGTERM)
    assert process.wait() == STOPPED
    assert lock.exists()


@pytest.fixture
def shared(program):
    """A folder for all users, with the program and an input in it."""
    if os.geteuid() != 0:
        pytest.skip("needs root, to be another user")
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o777)
        shutil.copy(program, name)
        write_input(name, ENDLESS).chmod(0o644)
        try:
            as_nobody(Path(name), "--version")
        except PermissionError:
            pytest.skip("no other user may enter the folders above this one")
        yield Path(name)


def as_nobody(folder, *arguments, **options):
    """A run of another user."""
    return subprocess.run(
        [folder / "ricochet", *arguments],
        cwd=folder,
        user=65534,
        group=65534,
        extra_groups=[],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        **options,
    )


def test_a_run_of_another_user_is_a_twin(shared):
    command = [shared / "ricochet", *COMMAND, "--set", "stop.time=20000"]
    first = subprocess.Popen(command, cwd=shared)
    try:
        wait_for((shared / "gas.h5.part").exists)
        with held(first):
            run = as_nobody(shared, *COMMAND, "--force")
        assert run.returncode == FILES and "another run" in one_line(run)
        assert first.wait() == FINISHED
    finally:
        first.kill()
        first.wait()


def test_a_folder_that_cannot_be_written_or_listed(shared):
    """A run needs the right to make files, and says so at once; not the right to list them."""
    for mode, status in ((0o555, FILES), (0o733, FINISHED)):
        shared.chmod(mode)
        run = as_nobody(shared, *COMMAND, "--set", "stop.time=9")
        assert run.returncode == status, run.stderr
        if status == FILES:
            assert one_line(run).startswith("gas.h5: ") and "Permission denied" in run.stderr


def test_a_disk_that_cannot_synchronize_has_the_result(ricochet, tmp_path):
    """Some file systems refuse fsync of a folder, or at all."""
    source, library = tmp_path / "sync.c", tmp_path / "sync.so"
    source.write_text(
        "#include <errno.h>\nint fsync(int d) { errno = EINVAL; return d < 0 ? 0 : -1; }\n"
    )
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, source], check=True)
    write_input(tmp_path, SHORT)
    environment = {**os.environ, "LD_PRELOAD": str(library)}
    run = ricochet(*COMMAND, "--set", "output.checkpoint_every=1e-6", env=environment)
    assert (run.returncode, run.stderr) == (FINISHED, "")
    assert (tmp_path / "gas.h5").exists()
