"""Runs on several cores: numbers of threads, and special cases of the end of a run.

`test_random_systems.py` tests with random systems that threads do not affect the results.
"""

import os
from pathlib import Path

import h5py
import pytest

from whole_runs import BROKEN, FINISHED, STOPPED, differences, ran, write_input

#: Input of a gas with enough disks for several cores.
GAS = "&species name = 'gas' count = 10000 packing_fraction = 0.3 temperature = 1 /\n"


@pytest.fixture
def gas(ricochet, tmp_path):
    """Return a folder with a short run of 10 000 disks on one core."""
    write_input(tmp_path, GAS + "&stop events = 30000 /\n")
    assert ricochet("gas.nml", "-o", "one.h5").returncode == FINISHED
    return tmp_path


def threads_of(path: Path) -> int:
    with h5py.File(path) as file:
        return file["provenance"].attrs["threads"]


@pytest.mark.parametrize("log", ["", "&output event_log = .true. /\n"], ids=["plain", "log"])
def test_a_collapse_ends_a_run_on_several_cores_as_on_one(ricochet, tmp_path, log):
    """The final state is that of a run on one core."""
    lossy = "&contact restitution = 0.3 / &stop collisions_per_disk = 200 /\n"
    write_input(tmp_path, GAS.replace("10000", "5000") + lossy + log)
    one, two = (
        ricochet("gas.nml", "-o", f"{n}.h5", "--quiet", f"--set=run.threads={n}") for n in (1, 2)
    )
    assert (one.returncode, one.stderr) == (two.returncode, two.stderr)
    assert one.returncode == BROKEN
    assert differences(tmp_path / "1.h5.part", tmp_path / "2.h5.part") == []


@pytest.mark.parametrize(
    ("options", "environment", "said", "threads"),
    [
        (["--set=run.threads=4"], {}, "run.threads", 4),
        (["--set=run.threads=4", "--quiet"], {}, "", 4),
        ([], {"OMP_NUM_THREADS": "4"}, "OMP_NUM_THREADS", 4),
        (["--set=run.threads=1"], {"OMP_NUM_THREADS": "4"}, "", 1),
    ],
)
def test_more_threads_than_cores_are_warned_of(ricochet, gas, options, environment, said, threads):
    def prepare():
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1])

    more = {"env": os.environ | environment, "preexec_fn": prepare}
    done = ricochet("gas.nml", "-o", "many.h5", *options, **more)
    text = "warning: {}: 4 threads are more than the 1 core that the run may use; "
    text += "fewer threads would be faster\n"
    assert done.returncode == FINISHED and done.stderr == (text.format(said) if said else "")
    assert threads_of(gas / "many.h5") == threads
    assert differences(gas / "one.h5", gas / "many.h5") == []


def test_the_threads_are_those_of_the_last_part(ricochet, gas):
    """The output file contains the number of threads of the last part of a run."""
    command = ["gas.nml", "-o", "many.h5", "--quiet"]
    begin = ["--set=stop.wall_clock=1e-9", "--set=run.threads=3"]
    assert ricochet(*command, *begin).returncode == STOPPED
    short = ["--force", "--set=stop.events=5"]
    few, pairs = ["--set=species.gas.count=1000"], ["--set=run.search=pairs"]
    for options, threads in ((["--resume"], 2), (few + short, 1), (pairs + short, 1)):
        assert ricochet(*command, *options, "--set=run.threads=2").returncode == FINISHED
        assert threads_of(gas / "many.h5") == threads


def test_moments_of_a_run_that_goes_on_on_several_cores_count_from_its_start(ricochet, tmp_path):
    """Times of samples and kicks in a continued run are relative to the start of the first run."""
    helfand = (
        "&drive kind = 'brownian' interval = 0.1 temperature = 1 / &output helfand = .true. /\n"
    )
    write_input(tmp_path, GAS.replace("10000", "5000") + helfand + "&stop time = 0.35 /\n")
    ricochet("gas.nml", "-o", "one.h5")
    ricochet("gas.nml", "-o", "two.h5", "--set=stop.time=0.25")
    ricochet("gas.nml", "-o", "two.h5", "--set=run.threads=2", "--resume")
    assert differences(tmp_path / "one.h5", tmp_path / "two.h5") == []


@pytest.mark.parametrize("threads", [1, 2])
def test_a_run_says_what_it_did_on_one_core_though_it_had_two(ricochet, gas, threads):
    """The summary and the file report one core if the program used only one of two."""
    few = "--set=stop.collisions=9000"
    done = ricochet("gas.nml", "-o", "two.h5", few, f"--set=run.threads={threads}")
    said = [line for line in done.stdout.splitlines() if line.startswith("events_on_one_core")]
    with h5py.File(gas / "two.h5") as file:
        alone = file["provenance"].attrs["events_on_one_core"]
    assert said == [f"events_on_one_core = {alone}"] * (threads - 1)
    assert (alone > 0) == (threads == 2)


def test_too_little_memory_for_domains_is_said(program, gas):
    """There is a message if the memory suffices for one core but not for several."""
    facts = Path("/proc/meminfo").read_text().splitlines()
    facts = [line for line in facts if not line.startswith("MemAvailable")]
    (gas / "meminfo").write_text("\n".join(["MemAvailable: 14000 kB", *facts]))
    script = f"mount --bind meminfo /proc/meminfo && exec {program} gas.nml -o many.h5"
    command = ["unshare", "-m", "sh", "-c", f"{script} --set run.threads=2"]
    done = ran(*command, cwd=gas)
    if "unshare" in done.stderr or "mount" in done.stderr:
        pytest.skip("cannot pretend to have less memory here: needs root")
    said = "there is not enough memory for 2 threads; the run uses one"
    assert done.stderr == f"warning: run.threads: {said}\n" and threads_of(gas / "many.h5") == 1
    assert differences(gas / "one.h5", gas / "many.h5") == []
