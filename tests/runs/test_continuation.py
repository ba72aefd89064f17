"""A finished run is continued as if it had never ended; what is not the same run is refused."""

import random
import signal

import h5py
import numpy as np
import pytest
from test_restart import GAS, SYSTEMS

from whole_runs import (
    FILES,
    FINISHED,
    MIXTURE,
    STOPPED,
    USAGE,
    contents,
    differences,
    frames_in,
    let_work,
    one_line,
    processor_time_of,
    wait_for,
    write_input,
)

CHECK = pytest.mark.check
BROKEN = 4
#: A ball that bounces ever faster and lower.
COLLAPSE = """&box gravity = 0, -1 /
&species name = 'ball' radius = 0.05 position = 0.5, 0.5, 0.3, 0.3 /
&contact restitution = 0.5 /
&stop time = 100 /
&output frames_every_time = 0.1 event_log = .true. /
"""


@pytest.mark.parametrize("stride", [47, pytest.param(3, marks=CHECK)])
def test_a_run_that_ends_three_times_is_one_long_run(ricochet, tmp_path, stride):
    """Every kind of stop rule, between samples and at them; every kind of output."""
    ends = [
        ["stop.time=3.21", "stop.time=5.005", "stop.time=9"],
        ["stop.events=77", "stop.events=1031", "stop.events=2000"],
        ["stop.time=0.05", "stop.events=300", "stop.collisions=703"],
        ["stop.collisions=57", "stop.collisions_per_disk=10", "stop.time=40"],
    ]
    for k, system in enumerate(SYSTEMS[::stride]):
        write_input(tmp_path, GAS + "\n".join(system[:-1]) + system[-1].split("&stop")[0])
        first, second, last = (["--set", end] for end in ends[k % len(ends)])
        assert ricochet("gas.nml", "-o", "whole.h5", *last, "--force").returncode == FINISHED
        command = ["gas.nml", "-o", "parts.h5"]
        assert ricochet(*command, *first, "--force").returncode == FINISHED
        for end in (second, last):
            assert ricochet(*command, *end, "--resume").returncode == FINISHED, system
        assert differences(tmp_path / "whole.h5", tmp_path / "parts.h5") == [], system
        names = {path.name for path in tmp_path.iterdir()}
        assert names == {"gas.nml", "whole.h5", "parts.h5"}


#: Three collisions at the time 0.5, and walls from 2.25 on.
AT_ONCE = """&box upper = 8, 8 /
&species radius = 0.25 position = 1,1, 2,1, 1,3, 2,3, 1,5, 2,5
  velocity = 0.5,0, -0.5,0, 0.5,0, -0.5,0, 0.5,0, -0.5,0 /
"""


@pytest.mark.parametrize(
    "pause", ["event_log=T", "frames_every_events=1", "frames_every_collisions=2"]
)
def test_all_that_happens_at_the_end_happens_whatever_the_cadence(ricochet, tmp_path, pause):
    write_input(tmp_path, AT_ONCE + "&stop time = 0.5 /")
    run = ricochet("gas.nml", "-o", "gas.h5", "--set", f"output.{pause}")
    assert run.returncode == FINISHED
    with h5py.File(tmp_path / "gas.h5") as file:
        assert file["observables/collisions/value"][-1] == 3
        assert np.all(file["particles/disks/collisions/value"][-1] == 1)


@pytest.mark.parametrize("end", ["events=1", "collisions=2"])
def test_a_sample_between_collisions_of_one_moment_is_not_that_of_the_moment(
    ricochet, tmp_path, end
):
    """The moment is not over, neither for samples nor for `stop.time`."""
    write_input(
        tmp_path, AT_ONCE + "&output frames_every_time = 0.25 observables_every_time = 0.5 /"
    )
    command = ["gas.nml", "-o", "parts.h5"]
    for time in (0.5, 3):
        last = ["--set", f"stop.{end[:-2]}=", "--set", f"stop.time={time}"]
        assert ricochet("gas.nml", "-o", "whole.h5", *last, "--force").returncode == FINISHED
        assert ricochet(*command, "--set", f"stop.{end}", "--force").returncode == FINISHED
        assert ricochet(*command, *last, "--resume").returncode == FINISHED
        assert differences(tmp_path / "whole.h5", tmp_path / "parts.h5") == []
        run = ricochet(*command, *last, "--resume")
        assert run.returncode == FILES and "finished run" in one_line(run)


LONG = ["--set", "stop.time=30", "--set", "output.checkpoint_every=0.05"]


@pytest.mark.parametrize("tries", [12, pytest.param(100, marks=CHECK)])
def test_a_continued_run_that_is_stopped_and_killed_loses_nothing(
    ricochet, started, tmp_path, tries
):
    """The finished file stays as it is until the longer one takes its place."""
    write_input(tmp_path, GAS + SYSTEMS[0][-1].split("&stop")[0])
    duration = processor_time_of(started("gas.nml", "-o", "whole.h5", *LONG))
    command = ["gas.nml", "-o", "parts.h5", "--quiet"]
    assert ricochet(*command, "--set", "stop.time=1.01").returncode == FINISHED
    output, rng = tmp_path / "parts.h5", random.Random(tries)
    short, ended = output.read_bytes(), 0
    for k in range(tries):
        process = started(*command, *LONG, "--resume")
        let_work(process, rng.uniform(0, duration))
        process.send_signal(signal.SIGTERM if k % 3 == 2 else signal.SIGKILL)
        message = process.communicate()[1]
        allowed = STOPPED
        if output.read_bytes() != short:  # it has finished, even if it was killed right afterwards
            assert differences(tmp_path / "whole.h5", output) == []
            output.write_bytes(short)
            ended += 1
            allowed = FINISHED
        assert process.returncode in (allowed, -signal.SIGKILL), message
    assert ended < tries
    if output.read_bytes() == short:
        assert ricochet(*command, *LONG, "--resume").returncode == FINISHED
    assert differences(tmp_path / "whole.h5", output) == []


def test_a_new_cadence_counts_from_where_the_run_goes_on(ricochet, tmp_path):
    write_input(tmp_path, MIXTURE)
    command = ["gas.nml", "-o", "gas.h5", "--quiet"]
    assert ricochet(*command, "--set", "stop.time=1.3").returncode == FINISHED
    new = ["output.frames_every_time=0.5", "output.observables_every_events=100", "stop.time=3.1"]
    new += ["run.title='longer'", "run.search='pairs'", "run.queue='heap'"]
    options = [word for value in new for word in ("--set", value)]
    assert ricochet(*command, *options, "--resume").returncode == FINISHED
    with h5py.File(tmp_path / "gas.h5") as file:
        times = file["particles/disks/position/time"][:]
        assert file["parameters/run"].attrs["title"] == b"longer"
        events = sum(file[f"observables/{kind}collisions/value"][:].T for kind in ("", "obstacle_"))
        sampled = file["observables/collisions/time"][:]
        events = events + file["observables/wall_collisions/value"][:].sum(axis=1)
    assert times.tolist() == [0, 0.25, 0.5, 0.75, 1, 1.25, 1.5, 2, 2.5, 3, 3.1]
    assert {900, 1000, 1100, 1200, 1300} < set(events[sampled > 1.3])
    assert ricochet("gas.nml", "-o", "whole.h5", "--set", "stop.time=3.1").returncode == FINISHED
    here, there = contents(tmp_path / "gas.h5"), contents(tmp_path / "whole.h5")
    for name in ("position", "velocity", "image", "collisions"):
        path = f"/particles/disks/{name}/value"
        assert path not in here or here[path][-1].tobytes() == there[path][-1].tobytes()


@pytest.fixture
def finished(ricochet, tmp_path):
    """`finished(*options)` tries to continue a run of 0.5 time units; its file stays as it is."""
    write_input(tmp_path, MIXTURE)
    command = ["gas.nml", "-o", "gas.h5", "--quiet"]
    assert ricochet(*command, "--set", "stop.time=0.5").returncode == FINISHED
    output = tmp_path / "gas.h5"

    def go_on(*options):
        before = output.read_bytes()
        run = ricochet(*command, "--resume", *options)
        assert output.read_bytes() == before
        return run

    return go_on


@pytest.mark.parametrize("end", ["time=0.5", "time=0.1", "collisions=3", "energy_fraction=0.999"])
def test_a_finished_run_asks_for_a_longer_stop_rule(finished, end):
    run = finished("--set", "stop.time=0.5", "--set", f"stop.{end}")
    assert run.returncode == FILES
    assert "is a finished run" in one_line(run)
    assert "--resume and a stop rule" in run.stderr


@pytest.mark.parametrize(
    "rules",
    [
        "time=0.5",
        "time=0",
        "collisions=3",
        "collisions_per_disk=0.7",
        "events=1200",
        "energy_fraction=0.9",
        "time=0.01 events=3",
    ],
)
def test_the_rules_that_ended_a_run_are_named_and_the_advice_helps(ricochet, tmp_path, rules):
    """No other rule is named, and a run that follows the advice goes on."""
    write_input(tmp_path, MIXTURE.replace("time = 4", rules.replace(" ", "\n")))
    command = ["gas.nml", "-o", "gas.h5", "--quiet"]
    assert ricochet(*command).returncode == FINISHED
    run = ricochet(*command, "--resume")
    assert run.returncode == FILES
    advice = one_line(run).split("such as ")[1].split()
    named = [word.split("=")[0] for word in advice[1::2]]
    assert named and {f"stop.{rule.split('=')[0]}" for rule in rules.split()} >= set(named)
    assert ricochet(*command, "--resume", *advice).returncode == FINISHED


@pytest.mark.parametrize(
    "change", ["run.seed=8", "species.heavy.mass=3", "output.event_log=.false.", "box.gravity=0,-1"]
)
def test_what_would_be_another_run_is_refused_by_name(finished, change):
    run = finished("--set", change)
    assert run.returncode == USAGE
    assert "another input" in one_line(run) and change.split("=")[0] in run.stderr


def test_a_check_of_a_run_that_goes_on_changes_nothing(finished, tmp_path):
    run = finished("--check")
    assert run.returncode == FINISHED and "goes on from time 0.5" in run.stdout
    assert {path.name for path in tmp_path.iterdir()} == {"gas.nml", "gas.h5"}


def test_without_its_last_state_a_finished_run_is_not_continued(finished, tmp_path):
    with h5py.File(tmp_path / "gas.h5", "r+") as file:
        del file["checkpoint"]
    run = finished()
    assert run.returncode == FILES and "placement = 'file'" in one_line(run)


@pytest.mark.parametrize("name", ["disks/x1", "disks/v2", "disks/collisions", "now", "checksum"])
def test_a_damaged_last_state_is_refused(finished, tmp_path, name):
    with h5py.File(tmp_path / "gas.h5", "r+") as file:
        place = file["checkpoint"]
        for part in name.split("/"):
            place = place[part]
        bits = place[()].view(np.uint64) if place.shape else place[()].reshape(1).view(np.uint64)
        bits[0] ^= 1
        place[()] = bits.view(place.dtype).reshape(place.shape)
    run = finished()
    assert run.returncode == USAGE and "gas.h5: is damaged: " in one_line(run)


def test_a_finished_run_that_is_continued_needs_room(ricochet, small_disk, tmp_path):
    """Without it the run that is there is unharmed."""
    disk = small_disk(2000)
    write_input(tmp_path, MIXTURE)
    command = ["gas.nml", "-o", "disk/gas.h5", "--quiet", "--set"]
    assert ricochet(*command, "stop.time=0.5").returncode == FINISHED
    before = (disk / "gas.h5").read_bytes()
    run = ricochet(*command, "stop.time=2e4", "--resume")
    assert run.returncode == FILES and "--resume goes on" in one_line(run)
    assert (disk / "gas.h5").read_bytes() == before
    small_disk(80000)
    assert ricochet(*command, "stop.time=2000", "--resume").returncode == FINISHED
    assert ricochet("gas.nml", "-o", "whole.h5", "--set", "stop.time=2000").returncode == FINISHED
    assert differences(tmp_path / "whole.h5", disk / "gas.h5") == []


def test_a_twin_of_a_continued_run_is_refused(finished, started, tmp_path):
    process = started("gas.nml", "-o", "gas.h5", "--quiet", "--resume", "--set", "stop.time=1e5")
    wait_for(lambda: frames_in(tmp_path / "gas.h5.part") > 9)
    run = finished("--set", "stop.time=1e5")
    assert run.returncode == FILES and "another run" in one_line(run)
    process.terminate()
    assert process.wait() == STOPPED


def test_a_run_that_breaks_off_leaves_its_last_state(ricochet, tmp_path):
    write_input(tmp_path, COLLAPSE)
    run = ricochet("gas.nml", "-o", "gas.h5", "--quiet")
    assert run.returncode == BROKEN and "collapse" in one_line(run)
    assert {path.name for path in tmp_path.iterdir()} == {"gas.nml", "gas.h5.part"}
    with h5py.File(tmp_path / "gas.h5.part") as file:
        disks, observables = file["particles/disks"], file["observables"]
        times = disks["position/time"][:]
        assert len(times) == disks["committed"][()] == len(disks["position/value"])
        assert 2 < times[-1] < 2.2 and times[-1] % 0.1 > 1e-3
        assert np.all(disks["position/value"][-1, :, 1] < 0.1)
        assert file["events/committed"][()] == observables["wall_collisions/value"][-1].sum()
        assert observables["total_energy/time"][-1] == times[-1]
        assert file["provenance"].attrs["note"].decode() == run.stderr.strip()


def test_a_run_knows_its_overrides(ricochet, tmp_path):
    """Stop rules and cadences are as the command says; the rest is as it was, in the same words."""
    write_input(tmp_path)
    fixed = ["run.seed=8", "species.heavy.mass=7", "Contact.restitution=0.9", "run.title=a = b"]
    sets = [f"--set={word}" for word in fixed]
    assert ricochet("gas.nml", "-o", "whole.h5", *sets, "--set=stop.time=2").returncode == FINISHED
    first = ["gas.nml", "-o", "gas.h5"]
    assert ricochet(*first, *sets, "--set=stop.wall_clock=1e-9").returncode == STOPPED
    run = ricochet(*first, "--resume", "--set=species.heavy.mass=8")
    assert run.returncode == USAGE and "species.heavy.mass" in one_line(run)
    for time in (1, 2):  # a stopped one, then a finished one
        options = ["--set=run.title=a = b", f"--set=stop.time={time}"]
        run = ricochet(*first, "--resume", *options)
        assert run.returncode == FINISHED, run.stderr
    found = differences(tmp_path / "whole.h5", tmp_path / "gas.h5")
    assert found == []
