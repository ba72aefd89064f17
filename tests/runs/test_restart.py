"""Stopped, damaged and finished runs continue exactly, or state why they cannot.

`test_random_systems.py` tests with random systems that continued runs are bit-identical.
"""

import random
import re
from pathlib import Path

import h5py
import numpy as np
import pytest
from ricochet import read_run

from whole_runs import BROKEN, FILES, FINISHED, MIXTURE, STOPPED, USAGE
from whole_runs import contents, differences, one_line, write_input

CRATER = Path(__file__).resolve().parents[2] / "input/crater.nml"
CHECK = pytest.mark.check
GAS = "&species name = 'gas' count = 40 radius = 0.02 speed = 1 /\n"
GROWING = """&output frames_every_time = 0.05 observables_every_collisions = 30
event_log = .true. /\n"""
AT_ONCE = ["--set", "stop.wall_clock=1e-9"]
COMMAND = ["gas.nml", "-o", "gas.h5", "--quiet"]
#: Input of a ball whose bounces become lower and more frequent.
COLLAPSE = """&box gravity = 0, -1 /
&species name = 'ball' radius = 0.05 position = 0.5, 0.5, 0.3, 0.3 /
&contact restitution = 0.5 /
&stop time = 100 /
&output frames_every_time = 0.1 event_log = .true. /
"""


@pytest.fixture(params=["stopped", "finished"])
def before(request, ricochet, tmp_path):
    """Return the output file of a run that COMMAND continues to a later end."""
    write_input(tmp_path, MIXTURE)
    end = AT_ONCE if request.param == "stopped" else ["--set", "stop.time=0.5"]
    run = ricochet(*COMMAND, *end)
    assert run.returncode == (STOPPED if request.param == "stopped" else FINISHED)
    (path,) = tmp_path.glob("gas.h5*")
    assert path.name == ("gas.h5.part" if request.param == "stopped" else "gas.h5")
    return path


def test_stops_between_and_at_samples_and_before_the_first_event(ricochet, tmp_path):
    """A run can be stopped and continued at any point; here, wall time limits each part."""
    write_input(tmp_path, GAS + GROWING)
    short = ["gas.nml", "--set", "species.gas.count=3", "--set", "species.gas.radius=0.15"]
    short += ["--set", "run.search='pairs'", "--set", "stop.time=1", "-o"]
    assert ricochet(*short, "whole.h5").returncode == FINISHED
    run, times, resume = None, [], []
    while run is None or run.returncode == STOPPED:
        run = ricochet(*short, "parts.h5", *AT_ONCE, *resume)
        resume = ["--resume"]
        if run.returncode == STOPPED:
            times.append(float(re.search("stopped at time ([^,]+),", one_line(run))[1]))
    assert run.returncode == FINISHED and times == sorted(set(times)) and len(times) > 20
    changed = ["/parameters/overrides", "/parameters/stop@wall_clock"]
    assert differences(tmp_path / "whole.h5", tmp_path / "parts.h5") == changed


@pytest.mark.parametrize(
    "change",
    [
        *("run.seed=8", "species.heavy.mass=3", "contact.contact_time=0.002", "box.gravity=0,-1"),
        "output.event_log=.false.",
    ],
)
def test_what_would_be_another_run_is_refused_by_name(ricochet, before, change):
    content = before.read_bytes()
    run = ricochet(*COMMAND, "--set", change, "--resume")
    assert run.returncode == USAGE
    assert "another input" in one_line(run) and change.split("=")[0] in run.stderr
    assert before.read_bytes() == content


def test_a_checkpoint_of_another_version_is_refused_by_name(ricochet, before):
    with h5py.File(before, "r+") as file:
        del file["checkpoint/program"]
        file["checkpoint/program"] = np.bytes_("ricochet 0.0.9")
        del file["parameters/overrides"]  # with a former name
        file["parameters/overrides"] = np.bytes_("side.left." + "speed=1\n")
    run = ricochet(*COMMAND, "--resume")
    assert run.returncode == USAGE and "was written by ricochet 0.0.9, but this" in one_line(run)


@pytest.mark.parametrize("name", ["input", "overrides"])
def test_an_input_in_the_output_with_a_wrong_bit_is_damaged(ricochet, before, name):
    rng = random.Random(name)
    with h5py.File(before, "r+") as file:
        text = bytearray(file[f"parameters/{name}"][()])
        text[rng.randrange(len(text))] ^= 1 << rng.randrange(7)
        del file[f"parameters/{name}"]
        file[f"parameters/{name}"] = np.bytes_(bytes(text))
    run = ricochet(*COMMAND, "--resume")
    assert run.returncode == FILES
    assert one_line(run) == f"{before.name}: cannot be read: its input is damaged"


def flip(path, slot, rng):
    """Change a random bit of a checkpoint."""
    with h5py.File(path, "r+") as file:
        words = file[f"checkpoint/{slot}"][:]
        words[rng.randrange(len(words) - 1)] ^= 1 << rng.randrange(63)
        file[f"checkpoint/{slot}"][:] = words


@pytest.mark.parametrize("trials", [10, pytest.param(200, marks=CHECK)])
def test_of_two_checkpoints_one_may_be_damaged(ricochet, tmp_path, trials):
    """If one checkpoint is damaged, the run continues from the other."""
    write_input(tmp_path, MIXTURE)
    assert ricochet("gas.nml", "-o", "whole.h5", "--set", "stop.time=1").returncode == FINISHED
    command, rng = [*COMMAND, "--set", "stop.time=1"], random.Random(trials)
    for k in range(trials):
        assert ricochet(*command, *AT_ONCE, "--force").returncode == STOPPED
        for _ in range(rng.randrange(3)):
            assert ricochet(*command, *AT_ONCE, "--resume").returncode == STOPPED
        flip(tmp_path / "gas.h5.part", 1 + k % 2, rng)
        if k % 3 == 2:
            flip(tmp_path / "gas.h5.part", 2 - k % 2, rng)
            run = ricochet(*command, "--resume")
            assert run.returncode == FILES and "checksum" in one_line(run)
            continue
        assert ricochet(*command, "--resume").returncode == FINISHED
        assert differences(tmp_path / "whole.h5", tmp_path / "gas.h5") == []


@pytest.mark.parametrize("trials", [6, pytest.param(200, marks=CHECK)])
def test_a_file_that_is_damaged_is_refused_in_one_line(ricochet, before, trials):
    """The file is truncated, missing or foreign, or has no valid checkpoint."""
    whole = before.read_bytes()
    for k in range(trials):
        before.write_bytes(whole[: k * len(whole) // trials])
        run = ricochet(*COMMAND, "--resume")
        assert run.returncode == FILES and one_line(run).startswith(f"{before.name}: ")
    before.write_bytes(whole)
    for slot in (1, 2):
        with h5py.File(before) as file:
            there = f"checkpoint/{slot}" in file
        if there:
            flip(before, slot, random.Random(slot))
    run = ricochet(*COMMAND, "--resume")
    assert run.returncode == FILES and "checksum" in one_line(run)
    with h5py.File(before, "r+") as file:
        del file["checkpoint"]
    run = ricochet(*COMMAND, "--resume")
    assert run.returncode == FILES and one_line(run).startswith(f"{before.name}: cannot be read: ")
    before.unlink()
    run = ricochet(*COMMAND, "--resume")
    assert run.returncode == FILES and "there is no run to continue" in one_line(run)


def test_a_run_that_breaks_off_leaves_its_last_state_and_makes_way(ricochet, tmp_path):
    """An aborted run keeps its last state, but cannot be resumed."""
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
        assert file["events/committed"][()] == observables["side_collisions/value"][-1].sum()
        assert observables["total_energy/time"][-1] == times[-1]
        assert file["provenance"].attrs["note"].decode() == run.stderr.strip()
    again = ricochet("gas.nml", "-o", "gas.h5", "--quiet", "--resume")
    assert again.returncode == FILES and "gas.h5.part: its run broke off" in one_line(again)
    again = ricochet("gas.nml", "-o", "gas.h5")
    assert again.returncode == BROKEN
    first, last = again.stderr.splitlines()
    assert first == "note: gas.h5.part, of a run that broke off, has been replaced"
    assert f"{last}\n" == run.stderr


def test_a_run_that_passed_a_collapse_says_so(ricochet, tmp_path):
    """All outputs report the collapse, and the proposed contact time prevents it."""
    crater = [CRATER, "-o", tmp_path / "crater.h5", "--force"]
    run = ricochet(*crater, "--set=contact.contact_time=0", "--set=output.event_log=T")
    found = contents(tmp_path / "crater.h5")
    note = found["/provenance@note"].decode()
    assert run.stderr.splitlines()[-1] == f"note: {note}" and f"\nnote = {note}\n" in run.stdout
    stuck, last = [], {}
    for time, *pair in zip(*(found[f"/events/{name}"] for name in ["time", "i", "j"]), strict=True):
        if pair[1] > 0 and all(last.get(disk) == time for disk in pair):
            stuck.append(time)
        last |= dict.fromkeys(pair, time)
    said = re.search(r": (\d+) collisions .* at time ([\d.]+); .* example to ([^,]+),", note)
    assert (int(said[1]), float(said[2])) == (len(stuck), pytest.approx(stuck[0], rel=1e-5))
    run = ricochet(*crater, f"--set=contact.contact_time={said[3]}")
    assert run.returncode == FINISHED and "collapse" not in run.stderr + run.stdout


#: Touching disks in a row, a triangle and two lattices, and a disk that strikes them.
DIAGONAL = 0.125 * 3**0.5 / 2
TOUCHING = {
    "cradle": [(0.75 + 0.125 * k, 1) for k in range(5)],
    "decimal": [(0.7 + 0.1 * k, 1) for k in range(4)],
    "rack": [
        (0.75 + DIAGONAL * k, 1 + 0.0625 * (2 * m - k)) for k in range(5) for m in range(k + 1)
    ],
    "square": [(0.75 + 0.125 * k, 0.5 + 0.125 * m) for k in range(8) for m in range(9)],
    "hexagonal": [
        (0.75 + DIAGONAL * k, 0.5 + 0.125 * m + 0.0625 * (k % 2))
        for k in range(9)
        for m in range(9)
    ],
}


@pytest.mark.parametrize("restitution", [0.75, 0.9, 0.95, 0.999])
@pytest.mark.parametrize("name", TOUCHING)
def test_disks_that_touch_and_are_struck_are_no_collapse(ricochet, tmp_path, name, restitution):
    """No collapse is reported when touching disks are struck, and the scripts accept the run."""
    places = [(0.125, 1), *TOUCHING[name]]
    write_input(
        tmp_path,
        f"&box upper = 3, 2 / &contact restitution = {restitution} wall_restitution = 1 /"
        f"&species radius = {0.05 if name == 'decimal' else 0.0625}"
        f" position = {', '.join(f'{x!r}, {y!r}' for x, y in places)}"
        f" velocity = 1, 0 {', 0, 0' * (len(places) - 1)} / &stop time = 0.7 /",
    )
    run = ricochet("gas.nml", "-o", "gas.h5")
    assert run.returncode == FINISHED and "collapse" not in run.stderr + run.stdout
    assert "collapsed" not in read_run(tmp_path / "gas.h5").nature


# --- continuation of a finished run ---


#: Input with three collisions at t = 0.5, and collisions with walls after t = 2.25.
TOGETHER = """&box upper = 8, 8 /
&species radius = 0.25 position = 1,1, 2,1, 1,3, 2,3, 1,5, 2,5
  velocity = 0.5,0, -0.5,0, 0.5,0, -0.5,0, 0.5,0, -0.5,0 /
"""


@pytest.mark.parametrize(
    "pause", ["event_log=T", "frames_every_events=1", "frames_every_collisions=2"]
)
def test_all_that_happens_at_the_end_happens_whatever_the_cadence(ricochet, tmp_path, pause):
    write_input(tmp_path, TOGETHER + "&stop time = 0.5 /")
    assert ricochet(*COMMAND, "--set", f"output.{pause}").returncode == FINISHED
    with h5py.File(tmp_path / "gas.h5") as file:
        assert file["observables/collisions/value"][-1] == 3
        assert np.all(file["particles/disks/event_count/value"][-1] == 1)


def test_the_last_frame_of_steps_is_after_the_kick_whatever_the_cadence(ricochet, tmp_path):
    steps = "&run dynamics = 'steps' dt = 0.01 / &stop time = 0.1 /" + GAS.replace("40", "400")
    write_input(tmp_path, steps + "&drive kind = 'brownian' interval = 0.01 temperature = 1 /")
    for name, cadence in (("plain", 10**9), ("often", 1)):
        every = f"--set=output.frames_every_collisions={cadence}"
        assert ricochet("gas.nml", "-o", f"{name}.h5", every).returncode == FINISHED
    one, two = (
        contents(tmp_path / f"{name}.h5")["/particles/disks/velocity/value"][-1]
        for name in ("plain", "often")
    )
    assert (one == two).all()


@pytest.mark.parametrize("end", ["events=1", "collisions=2"])
def test_a_sample_between_collisions_of_one_moment_is_not_that_of_the_moment(
    ricochet, tmp_path, end
):
    """A sample between simultaneous collisions does not count as the sample of their time."""
    cadences = "&output frames_every_time = 0.25 observables_every_time = 0.5 /"
    write_input(tmp_path, TOGETHER + cadences)
    for time in (0.5, 3):
        last = ["--set", f"stop.{end[:-2]}=", "--set", f"stop.time={time}"]
        assert ricochet("gas.nml", "-o", "whole.h5", *last, "--force").returncode == FINISHED
        assert ricochet(*COMMAND, "--set", f"stop.{end}", "--force").returncode == FINISHED
        assert ricochet(*COMMAND, *last, "--resume").returncode == FINISHED
        assert differences(tmp_path / "whole.h5", tmp_path / "gas.h5") == []


def test_a_new_cadence_counts_from_where_the_run_goes_on(ricochet, tmp_path):
    write_input(tmp_path, MIXTURE)
    assert ricochet(*COMMAND, "--set", "stop.time=1.3").returncode == FINISHED
    new = ["output.frames_every_time=0.5", "output.observables_every_events=100", "stop.time=3.1"]
    many = sorted({0.01 * k for k in range(1, 130)} | {1.6})  # more than are stored as text
    new += [f"output.frames_at={','.join(map(repr, many))}", "output.decades_from=0.3"]
    new += [
        "output.frames_per_decade=1",
        "run.title='longer'",
        "run.search='pairs'",
        "run.queue='heap'",
    ]
    options = [word for value in new for word in ("--set", value)]
    assert ricochet(*COMMAND, *options, "--resume").returncode == FINISHED
    with h5py.File(tmp_path / "gas.h5") as file:
        times = file["particles/disks/position/time"][:]
        assert file["parameters/run"].attrs["title"] == b"longer"
        events = file["observables/collisions/value"][:]
        events = events + file["observables/side_collisions/value"][:].sum(axis=1)
        sampled = file["observables/collisions/time"][:]
    assert times.tolist() == [0, 0.25, 0.5, 0.75, 1, 1.25, 1.5, 1.6, 2, 2.5, 3, 3.1]
    assert {900, 1000, 1100, 1200, 1300} < set(events[sampled > 1.3])
    assert ricochet("gas.nml", "-o", "whole.h5", "--set", "stop.time=3.1").returncode == FINISHED
    here, there = contents(tmp_path / "gas.h5"), contents(tmp_path / "whole.h5")
    for name in ("position", "velocity", "event_count"):
        path = f"/particles/disks/{name}/value"
        assert here[path][-1].tobytes() == there[path][-1].tobytes()


@pytest.mark.parametrize("end", ["time=0.5", "collisions=3", "energy_fraction=0.999"])
def test_a_finished_run_asks_for_a_later_stop_rule(ricochet, tmp_path, end):
    write_input(tmp_path, MIXTURE)
    assert ricochet(*COMMAND, "--set", "stop.time=0.5").returncode == FINISHED
    content = (tmp_path / "gas.h5").read_bytes()
    run = ricochet(*COMMAND, "--set", "stop.time=0.5", "--set", f"stop.{end}", "--resume")
    assert run.returncode == FILES and "is a finished run" in one_line(run)
    assert "a later stop rule" in run.stderr
    assert (tmp_path / "gas.h5").read_bytes() == content


def test_a_check_of_a_run_that_goes_on_changes_nothing(ricochet, before):
    content, there = before.read_bytes(), set(before.parent.iterdir())
    run = ricochet(*COMMAND, "--resume", "--check")
    assert run.returncode == FINISHED and "continues from time " in run.stdout
    assert set(before.parent.iterdir()) == there and before.read_bytes() == content


def test_a_finished_run_that_is_continued_needs_room(ricochet, small_disk, tmp_path):
    """If there is too little space on the file system, the existing run is unchanged."""
    disk = small_disk(2000)
    write_input(tmp_path, MIXTURE)
    command = ["gas.nml", "-o", "disk/gas.h5", "--quiet", "--set"]
    assert ricochet(*command, "stop.time=0.5").returncode == FINISHED
    content = (disk / "gas.h5").read_bytes()
    run = ricochet(*command, "stop.time=2e4", "--resume")
    assert run.returncode == FILES and "disk/gas.h5" in one_line(run)
    assert (disk / "gas.h5").read_bytes() == content
    small_disk(80000)
    assert ricochet(*command, "stop.time=2000", "--resume").returncode == FINISHED
    assert ricochet("gas.nml", "-o", "whole.h5", "--set", "stop.time=2000").returncode == FINISHED
    assert differences(tmp_path / "whole.h5", disk / "gas.h5") == []


def test_a_run_knows_its_overrides(ricochet, tmp_path):
    """It uses stop conditions and schedules of its own command, and all earlier overrides."""
    write_input(tmp_path)
    fixed = ["run.seed=8", "species.heavy.mass=7", "Contact.restitution=0.9", "run.title=a = b"]
    sets = [f"--set={word}" for word in fixed]
    assert ricochet("gas.nml", "-o", "whole.h5", *sets, "--set=stop.time=2").returncode == FINISHED
    assert ricochet(*COMMAND, *sets, *AT_ONCE).returncode == STOPPED
    run = ricochet(*COMMAND, "--resume", "--set=species.heavy.mass=8")
    assert run.returncode == USAGE and "species.heavy.mass" in one_line(run)
    # a stopped and a finished run
    for time, said in ((1, []), (2, ["--set=species.heavy.mass=7"])):
        options = [*said, "--set=run.title=a = b", f"--set=stop.time={time}"]
        run = ricochet(*COMMAND, "--resume", *options)
        assert run.returncode == FINISHED, run.stderr
    found = differences(tmp_path / "whole.h5", tmp_path / "gas.h5")
    assert found == ["/parameters/overrides"]  # in another order
