"""Kills, signals, full disks, concurrent runs and readers do not damage the results of a run."""

import contextlib
import itertools
import os
import pty
import random
import re
import signal
import subprocess
import time
from pathlib import Path

import h5py
import pytest

from whole_runs import FILES, FINISHED, MIXTURE, STOPPED
from whole_runs import committed, differences, ended_soon, filled_pipe, frames_in, has_ended, heeds
from whole_runs import held, is_asleep, is_beginning, let_work, one_line, ran, wait_for, with_fsync
from whole_runs import write_input

#: Input of a run that writes many frames to a growing file, and a few checkpoints.
BUSY = """&species name = 'gas' count = 100 radius = 0.02 speed = 1 /
&stop collisions = 20000 /
&output frames_every_events = 9 observables_every_events = 5 checkpoint_every = 0.05 /
"""
#: Input of a run whose output file has its final size from the start.
PLANNED = """&species name = 'gas' count = 100 radius = 0.02 speed = 1 /
&stop time = 30 /
&output frames_every_time = 0.01 observables_every_time = 0.004 checkpoint_every = 0.05 /
"""
LONG = ["--set", "stop.collisions=1000000000", "--set", "output.checkpoint_every="]
#: Input of a run whose output file is rebuilt at the end, because the length of the event log is
#: unknown.
LOGGED = """&box boundary = 'periodic', 'wall' /
&species name = 'gas' count = 60 radius = 0.03 temperature = 1 /
&stop time = 30 /
&output frames_every_time = 0.4 observables_every_time = 0.4 event_log = .true.
  checkpoint_every = 600 /
"""
#: First part of the message on a full disk: file, required size and free size.
NO_ROOM = r"^disk/gas\.h5(\.part)?: .*(\d+ bytes needed, \d+ bytes free|.* are free)"
#: Last part of the message on a full disk: advice, at the start and later.
MAKE_ROOM = NO_ROOM + "(; choose fewer frames or make room)?$"
GO_ON = NO_ROOM + "; --resume continues from the last checkpoint$"


@pytest.mark.parametrize("text", [BUSY, PLANNED], ids=["growing", "planned"])
@pytest.mark.parametrize("tries", [8, pytest.param(200, marks=pytest.mark.check)])
def test_kills_cost_no_committed_sample_and_no_result(ricochet, started, tmp_path, text, tries):
    """After a kill the file is valid, and the run continues from the last complete state."""
    write_input(tmp_path, text.replace("0.05", "0.001"))
    assert ricochet("gas.nml", "-o", "whole.h5").returncode == FINISHED
    whole = committed(tmp_path / "whole.h5")
    frames = len(whole["particles/disks/position/time"])
    part, rng, times = tmp_path / "gas.h5.part", random.Random(tries), []
    for _ in range(tries):
        goal = frames_in(part) + rng.randrange(frames // 3)
        process = started("gas.nml", "-o", "gas.h5", "--quiet", *["--resume"] * part.exists())
        let_write(process, part, goal)
        time.sleep(rng.uniform(0, 0.05))  # amount of data until samples are committed
        process.kill()
        message = process.communicate()[1]
        assert process.returncode in (FINISHED, -signal.SIGKILL), message
        if (tmp_path / "gas.h5").exists():  # may be killed shortly afterwards
            (tmp_path / "gas.h5").rename(tmp_path / "finished.h5")
            assert differences(tmp_path / "whole.h5", tmp_path / "finished.h5") == []
            times.append(0.0)  # of the next run
        else:
            check = ricochet("gas.nml", "-o", "gas.h5", "--resume", "--check")
            assert check.returncode == FINISHED, check.stderr
            times.append(float(check.stdout.split()[-1]))
            found = committed(part)
            assert len(found["particles/disks/position/time"]) > 0
            assert is_beginning(found, whole) == []
    assert sum(time > 0 for time in times) > tries / 4
    assert all(old <= new or new == 0 for old, new in itertools.pairwise(times))
    again = ["--resume"] * part.exists()
    assert ricochet("gas.nml", "-o", "gas.h5", *again).returncode == FINISHED
    assert differences(tmp_path / "whole.h5", tmp_path / "gas.h5") == []


def let_write(process, part, frames):
    """Wait until a run has committed the given number of frames, or has ended."""
    let_work(process)
    wait_for(lambda: has_ended(process) or frames_in(part) >= frames)


def test_files_never_take_the_place_of_closed_standard_streams(program, tmp_path):
    """If a standard stream is closed, no output file obtains its descriptor."""
    command = [program, write_input(tmp_path, BUSY), "-o", "gas.h5", *LONG]
    shell = ["bash", "-c", 'exec "$@" <&- >&- 2>&-', "bash", *map(str, command)]
    process = subprocess.Popen(shell, cwd=tmp_path)
    try:
        wait_for(lambda: frames_in(tmp_path / "gas.h5.part") > 0)
        places = Path(f"/proc/{process.pid}/fd")
        assert [str((places / str(k)).readlink()) for k in range(3)] == ["/dev/null"] * 3
    finally:
        process.kill()
        process.wait()


def shown_until_stopped(program, folder, enough):
    """Return the lines that a run writes to its terminal until TERM stops it."""
    screen, keyboard = pty.openpty()
    run = subprocess.Popen([program, "gas.nml"], cwd=folder, stdout=keyboard, stderr=keyboard)
    os.close(keyboard)
    rest = ""
    try:
        with contextlib.suppress(OSError):  # on Linux: no process writes any longer
            while data := os.read(screen, 65536):
                *lines, rest = re.split(r"(?=\r\x1b)", rest + data.decode())
                yield from lines
                if enough():
                    run.send_signal(signal.SIGTERM)
        yield rest
        assert run.wait() == STOPPED
    finally:
        run.kill()
        os.close(screen)


@pytest.mark.parametrize(
    ("text", "shown", "last"),
    [
        (
            BUSY.replace("collisions = 20000", "wall_clock = 100"),
            "[^\\r]*?([\\d.]+) %",
            "stopped at",
        ),
        (
            "&species count = 3000000 packing_fraction = .5 / &stop events = 1 /",
            "placing disks: ([\\d.]+) %",
            "stopped before the run began",
        ),
    ],
    ids=["run", "placing"],
)
def test_progress_stays_on_one_line_of_the_terminal(program, tmp_path, text, shown, last):
    """The progress line is truncated, not wrapped; a signal message has its own line."""
    write_input(tmp_path, text)
    shares = []
    for line in shown_until_stopped(program, tmp_path, lambda: len({*shares}) >= 3):
        if share := re.match(rf"\r\x1b\[\?7l{shown}[^\r]*\x1b\[K\x1b\[\?7h", line):
            shares.append(float(share[1]))
    assert shares == sorted(shares) and shares[0] < shares[-1] < 100
    assert line.startswith(f"\r\x1b[K{last}")


@pytest.mark.parametrize("gravity", [-0.1, 0])
def test_the_line_says_that_bounces_on_walls_slow_a_run_down(program, tmp_path, gravity):
    """Kicks start the bounces of disks on the floor anew; without gravity there are none."""
    write_input(
        tmp_path,
        f"""&box upper = 90, 1 gravity = 0, {gravity} / &run seed = 1 /
        &contact wall_restitution = 0.6 restitution_law = 'viscoelastic' reference_speed = 0.1 /
        &species count = 40 radius = 0.01 speed = 0.01 /
        &drive kind = 'noise' interval = 0.01 strength = 1e-3 / &stop wall_clock = 60 /""",
    )
    why, said, lines = "slow: disks bounce on walls, which contact.contact_time prevents", False, 0

    def enough():
        return said or (gravity == 0 and lines >= 5)

    for line in shown_until_stopped(program, tmp_path, enough):
        said = said or why in line
        lines += 1
    assert said == (gravity < 0)


@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT", "SIGHUP", "SIGXCPU"])
@pytest.mark.parametrize("times", [1, 2])
def test_a_signal_stops_the_run_with_a_checkpoint(started, tmp_path, name, times):
    """This holds for two signals in quick succession, too, as launchers send them."""
    process, number = start_long(started, tmp_path), getattr(signal, name)
    if times == 1:
        message = ended_soon(process, number)
    else:
        with held(process):  # both wait for it
            process.send_signal(signal.SIGTERM if name != "SIGTERM" else signal.SIGINT)
            process.send_signal(number)
        message = ended_soon(process, 0)
    assert process.returncode == STOPPED and "--resume" in message.splitlines()[-1]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["gas.h5.part", "gas.nml"]


def test_usr1_makes_a_checkpoint_and_the_run_goes_on(started, tmp_path):
    process = start_long(started, tmp_path)
    process.send_signal(signal.SIGUSR1)
    wait_for_checkpoint(tmp_path)
    frames = frames_in(tmp_path / "gas.h5.part")
    wait_for(lambda: frames_in(tmp_path / "gas.h5.part") > frames)
    assert process.poll() is None


def wait_for_checkpoint(folder):
    """Wait until the first checkpoint of a new run is valid."""

    def is_there():
        with h5py.File(folder / "gas.h5.part", "r", locking=False) as file:
            return file["checkpoint/current"][()] == 1

    wait_for(is_there)


def test_a_later_second_signal_ends_the_run_at_once(started, tmp_path):
    """This holds even while the run waits for a disk that does not respond."""
    endless = with_fsync(tmp_path, "while (1) usleep(100000);")
    process = started(write_input(tmp_path, BUSY), "-o", "gas.h5", *LONG, env=endless)
    wait_for((tmp_path / "gas.h5.part").exists)
    process.send_signal(signal.SIGTERM)
    wait_for(lambda: not is_pending(process.pid, signal.SIGTERM))

    def ends_after_another():
        time.sleep(0.6)  # signals within half a second of the first one are ignored
        process.send_signal(signal.SIGTERM)
        return has_ended(process)

    wait_for(ends_after_another)  # the first signal takes effect late on a busy machine
    assert process.wait() == -signal.SIGTERM


def is_pending(pid, number) -> bool:
    """Return whether a signal to a process is still pending."""
    status = Path(f"/proc/{pid}/status").read_text()
    masks = re.findall(r"^(?:Sig|Shd)Pnd:\s+(\w+)", status, re.MULTILINE)
    return any(int(mask, 16) >> (number - 1) & 1 for mask in masks)


def stopped_in_time(process, *codes):
    """Check that TERM ends a process within a second with an allowed code; return its output."""
    message = ended_soon(process, signal.SIGTERM)
    assert process.returncode in {STOPPED, *codes}, message
    return message


@pytest.mark.parametrize(
    ("count", "packing", "placement", "options"),
    [(3_000_000, 0.5, "random", []), (100_000, 0.75, "dense", ["--check"])],
    ids=["run", "check"],
)
def test_a_signal_ends_a_run_that_is_still_being_set_up(
    started, tmp_path, count, packing, placement, options
):
    """During the preparation a signal ends the run at once, because no data can be lost."""
    text = f"""&species count = {count} packing_fraction = {packing} placement = '{placement}' /
    &stop collisions = 1 /"""
    write_input(tmp_path, text)
    process = started("gas.nml", "-o", "gas.h5", *options)
    let_work(process, 0.5)  # of more than five seconds
    message = stopped_in_time(process)
    assert message == "stopped before the run began; nothing is lost: repeat the command\n"
    assert [path.name for path in tmp_path.iterdir()] == ["gas.nml"]


def test_a_slow_disk_does_not_slow_the_run_down(ricochet, tmp_path):
    """Slow checkpoints do not increase the number of checkpoints.

    Writing to the simulated storage takes twice as long as the interval at which the run reads the
    clock. The run ends after a few dozen checkpoints, and does not write one at each collision.
    """
    slow = with_fsync(tmp_path, "static int n; usleep(60000); if (++n > 300) _exit(9); return 0;")
    text = "&species count = 10 radius = .01 speed = 1 / &stop events = 20000 /"
    write_input(tmp_path, text + "&output checkpoint_every = 1e-9 /")
    assert ricochet("gas.nml", "-o", "gas.h5", "--quiet", env=slow).returncode == FINISHED


def test_a_run_whose_samples_cease_still_makes_checkpoints(started, tmp_path):
    """Checkpoints are written even after the last sample, when the disks are at rest."""
    pairs = "".join(f"0.1, {y}, {0.2 + y / 100}, {y}, " for y in range(1, 61))
    speeds = "1, 0, -1, 0, " * 60
    text = f"""&box upper = 1, 62 /
    &species name = 'pairs' count = 120 radius = 0.01 position = {pairs} velocity = {speeds} /
    &species name = 'other' count = 1 radius = 0.01 position = 0.5, 61 velocity = 1, 0 /
    &contact restitution = 0 wall_restitution = 1 /
    &stop events = 1000000000000 /
    &output observables_every_collisions = 1 /"""
    write_input(tmp_path, text)
    process = started("gas.nml", "-o", "gas.h5", "--quiet")
    let_work(process, 0.5)
    process.send_signal(signal.SIGUSR1)
    wait_for_checkpoint(tmp_path)
    assert frames_in(tmp_path / "gas.h5.part", "observables") == 61


@pytest.mark.check
@pytest.mark.parametrize(
    ("method", "side"),
    [
        ("dynamics='events'", 1000),
        ("dynamics='steps' dt = 1e-5", 1000),
        ("search='rescan'", 300),
        ("search='pairs'", 300),
        ("search='pairs' dynamics='steps' dt=1e-3", 300),
    ],
)
def test_many_disks_stop_in_time(started, tmp_path, method, side):
    """A run of many disks stops quickly, wherever in the program the signal arrives."""
    text = f"""&run {method} /
    &species grid = {side}, {side} packing_fraction = 0.3 temperature = 1 /
    &stop events = 1000000000 /"""
    write_input(tmp_path, text)
    for wait in (0.0, 0.5, 1.0, 2.0):
        resume = ["--resume"] * (tmp_path / "gas.h5.part").exists()
        process = started("gas.nml", "-o", "gas.h5", *resume)
        wait_for((tmp_path / "gas.h5.part").exists)
        time.sleep(wait + 0.1)
        stopped_in_time(process)


def test_a_stuck_summary_does_not_keep_a_finished_run(started, tmp_path):
    """A run ends even if the reader of its standard output has stopped reading."""
    write_input(tmp_path, "&species count = 10 radius = .01 / &stop time = 1 /")
    with filled_pipe() as inlet:
        process = started("gas.nml", "-o", "gas.h5", stdout=inlet)
        wait_for(lambda: (tmp_path / "gas.h5").exists() and is_asleep(process.pid))
        assert "the run is finished" in ended_soon(process, signal.SIGTERM)
        assert process.returncode == FINISHED


def test_ignored_signals_stay_ignored(program, tmp_path):
    """A run started with nohup, for example, continues after a signal."""
    write_input(tmp_path, BUSY)
    command = ["nohup", program, "gas.nml", "-o", "gas.h5"]
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(command, cwd=tmp_path, **silent)
    let_work(process)
    assert not heeds(process.pid, signal.SIGHUP)
    process.send_signal(signal.SIGHUP)
    assert process.wait() == FINISHED


@pytest.mark.parametrize("text", [PLANNED, BUSY], ids=["planned", "growing"])
@pytest.mark.parametrize("polls", [30, pytest.param(1000, marks=pytest.mark.check)])
def test_a_running_file_can_be_read(ricochet, started, tmp_path, text, polls):
    """A file can be read repeatedly during the run, without errors and with correct numbers."""
    write_input(tmp_path, text)
    assert ricochet("gas.nml", "-o", "whole.h5").returncode == FINISHED
    whole, part = committed(tmp_path / "whole.h5"), tmp_path / "gas.h5.part"
    looks = 0
    while looks < polls:
        process = started("gas.nml", "-o", "gas.h5", "--force")
        while not part.exists() and process.poll() is None:
            time.sleep(0.001)
        while process.poll() is None and looks < polls:
            try:
                found = committed(part)
            except OSError:
                assert process.wait() == FINISHED and not part.exists()
                break
            looks += 1
            assert is_beginning(found, whole) == []
        assert process.wait() == FINISHED, process.stderr.read()


def test_a_reader_that_locks_the_file_stops_nobody(ricochet, tmp_path):
    write_input(tmp_path, MIXTURE)
    run = ricochet("gas.nml", "-o", "gas.h5", "--set", "stop.wall_clock=1e-9")
    assert run.returncode == STOPPED
    with h5py.File(tmp_path / "gas.h5.part", "r", locking=True):
        run = ricochet("gas.nml", "-o", "gas.h5", "--resume")
    assert run.returncode == FINISHED


@pytest.mark.parametrize("option", ["--force", "--resume"])
def test_a_twin_is_refused_and_harms_nobody(ricochet, started, tmp_path, option):
    process = start_long(started, tmp_path, "--set", "stop.collisions=40000")
    process.send_signal(signal.SIGUSR1)
    wait_for_checkpoint(tmp_path)
    command = ["gas.nml", "-o", "gas.h5", *LONG, "--set", "stop.collisions=40000"]
    with held(process):
        run = ricochet(*command, option)
    assert run.returncode == FILES and "another run" in one_line(run)
    assert process.wait() == FINISHED
    command[2] = "alone.h5"
    assert ricochet(*command).returncode == FINISHED
    assert differences(tmp_path / "alone.h5", tmp_path / "gas.h5") == []


def test_of_twins_started_at_once_one_runs(started, ricochet, tmp_path):
    write_input(tmp_path, BUSY)
    twins = [started("gas.nml", "-o", "gas.h5", "--force") for _ in range(3)]
    codes = [(twin.wait(), twin.stderr.read()) for twin in twins]
    assert {code for code, _ in codes} <= {FINISHED, FILES}
    assert any(code == FINISHED for code, _ in codes)
    assert all("another run" in message for code, message in codes if code == FILES)
    assert ricochet("gas.nml", "-o", "alone.h5").returncode == FINISHED
    assert differences(tmp_path / "alone.h5", tmp_path / "gas.h5") == []


@pytest.mark.parametrize(
    "text", [BUSY.replace("0.05", "0.001"), LOGGED, PLANNED], ids=["growing", "rebuilt", "planned"]
)
@pytest.mark.parametrize("sizes", [4, pytest.param(40, marks=pytest.mark.check)])
def test_a_full_disk_costs_nothing(ricochet, tmp_path, small_disk, text, sizes):
    """No data are lost if a file system of 64 kB to 4 MB is full.

    The run continues when there is more space.
    """
    write_input(tmp_path, text)
    assert ricochet("gas.nml", "-o", "whole.h5").returncode == FINISHED
    whole = committed(tmp_path / "whole.h5")
    resumed = 0
    for k in range(sizes):
        folder = small_disk(64 + 4032 * k // (sizes - 1))
        run = ricochet("gas.nml", "-o", "disk/gas.h5", "--quiet")
        if run.returncode != FINISHED:
            assert run.returncode == FILES
            begun = (folder / "gas.h5.part").exists()
            assert re.search(GO_ON if begun else MAKE_ROOM, one_line(run)), run.stderr
            if begun:
                resumed += 1
                found = committed(folder / "gas.h5.part")
                assert len(found["particles/disks/position/time"]) > 0
                assert is_beginning(found, whole) == []
            small_disk(100_000)
            option = "--resume" if begun else "--quiet"
            assert ricochet("gas.nml", "-o", "disk/gas.h5", option).returncode == FINISHED
        assert differences(tmp_path / "whole.h5", folder / "gas.h5") == []
        assert [path.name for path in folder.iterdir()] == ["gas.h5"]
        (folder / "gas.h5").unlink()
    assert resumed > 0 or text == PLANNED


def test_a_limit_on_the_size_of_files_is_a_full_disk(program, tmp_path):
    write_input(tmp_path, BUSY)
    limited = 'ulimit -f 3000; exec "$0" gas.nml -o gas.h5'
    run = ran("bash", "-c", limited, program, cwd=tmp_path)
    assert run.returncode == FILES and "(ulimit -f)" in one_line(run)
    assert [path.name for path in tmp_path.iterdir()] == ["gas.nml"]


@pytest.mark.parametrize(("limit", "left"), [("f 2000", []), ("n 4", []), ("n 5", ["gas.h5.part"])])
def test_a_limit_of_the_process_is_named(program, tmp_path, limit, left):
    """If a limit of the process prevents writing, the message names this limit."""
    write_input(tmp_path, LOGGED)
    command = f'ulimit -{limit}; exec "$0" gas.nml -o gas.h5'
    run = ran("bash", "-c", command, program, cwd=tmp_path)
    assert run.returncode == FILES and "ulimit -" + limit[0] in one_line(run)
    assert "bytes free" not in run.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == [*left, "gas.nml"]


def test_a_disk_for_reading_only_is_left_as_it_is(ricochet, tmp_path, small_disk):
    """Files on a read-only file system are unchanged, and the message gives the reason."""
    write_input(tmp_path, MIXTURE)
    folder = small_disk(4000)
    stopped = ["gas.nml", "-o", "disk/gas.h5", "--set", "stop.wall_clock=1e-9"]
    assert ricochet(*stopped).returncode == STOPPED
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    small_disk(4000, "ro")
    for place, option in [("gas", "--resume"), ("new", "--quiet"), ("some/where/new", "--quiet")]:
        run = ricochet("gas.nml", "-o", f"disk/{place}.h5", option)
        assert run.returncode == FILES
        assert one_line(run).startswith(f"disk/{place}.h5") and "Read-only" in run.stderr
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    small_disk(4000, "rw")
    assert ricochet("gas.nml", "-o", "disk/gas.h5", "--resume").returncode == FINISHED


def test_the_planned_output_is_compared_with_the_room(ricochet, tmp_path, small_disk):
    write_input(tmp_path, PLANNED)
    small_disk(2000)
    run = ricochet("gas.nml", "-o", "disk/gas.h5")
    assert run.returncode == FILES
    assert "will have" in one_line(run) and "are free" in one_line(run)


LOGGING = """&species count = 200 radius = 0.01 speed = 1 /
&output event_log = .true. {} /
&stop {} /
"""


@pytest.mark.parametrize(
    ("output", "stop", "planned", "words"),
    [
        ("", "events = 40000", 40000 * 40, []),
        ("", "collisions = 20000", 20000 * 40, ["its copy at the end of the run as many"]),
        ("", "collisions_per_disk = 200", 20000 * 40, ["its copy at the end"]),
        ("", "events = 40000 time = 1", 45_000, ["its copy", "without the event log, whose"]),
        ("frames_every_collisions = 50", "collisions = 20000", 3_600_000, ["its copy"]),
        ("frames_every_time = 0.01", "time = 9", 6_000_000, ["its copy", "without the event log"]),
    ],
)
def test_the_event_log_and_the_final_copy_are_planned(
    output, stop, planned, words, ricochet, tmp_path, small_disk
):
    """A refused run needs at least the stated space, including the copy at its end."""
    write_input(tmp_path, LOGGING.format(output, stop))
    copies = 2 if any("copy" in word for word in words) else 1
    small_disk(copies * planned * 9 // 10240)
    run = ricochet("gas.nml", "-o", "disk/gas.h5")
    assert run.returncode == FILES and all(word in one_line(run) for word in words)
    assert ("copy" in run.stderr) == (copies == 2)
    assert ("without the event log" in run.stderr) == (len(words) == 2)
    stated = int(re.search(r"will have (\d+) bytes", run.stderr)[1])
    assert planned <= stated < 1.2 * planned
    checked = ricochet("gas.nml", "--check").stdout
    assert ("without the event log" in checked) == (len(words) == 2)
    small_disk(20_000)
    assert ricochet("gas.nml", "-o", "disk/gas.h5").returncode == FINISHED
    size = (tmp_path / "disk" / "gas.h5").stat().st_size
    assert stated * (0.9 if stop == "events = 40000" else 0.5) < size


def start_long(started, folder, *options):
    """Start a long run, and return its process once several frames have been written."""
    write_input(folder, BUSY)
    process = started("gas.nml", "-o", "gas.h5", *LONG, *options)
    wait_for(lambda: frames_in(folder / "gas.h5.part") > 10)
    return process
