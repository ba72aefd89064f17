"""One run is the same run stopped and resumed, bit for bit; what no run can resume is refused."""

import itertools
import os
import random
import re
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import h5py
import pytest

from whole_runs import (
    FILES,
    FINISHED,
    MIXTURE,
    STOPPED,
    USAGE,
    differences,
    one_line,
    seal,
    write_input,
)

CHECK = pytest.mark.check
GAS = "&species name = 'gas' count = 40 radius = 0.02 speed = 1 /\n"
#: Every combination of these is a system of its own.
CHOICES = {
    "dynamics": {
        "cells": "",
        "heap": "&run queue = 'heap' /",
        "pairs": "&run search = 'pairs' /",
        "rescan": "&run search = 'rescan' /",
        "steps": "&run dynamics = 'steps' dt = 2e-3 /",
        "steps by pairs": "&run dynamics = 'steps' dt = 2e-3 search = 'pairs' /",
    },
    "box": {
        "walls": "",
        "falling": "&box gravity = 0.1, -1 /",
        "channel": "&box boundary = 'periodic', 'wall' /",
        "falling channel": "&box boundary = 'periodic', 'wall' gravity = 0, -1 /",
        "periodic": "&box boundary = 'periodic', 'periodic' /",
    },
    "obstacles": {
        "free": "",
        "peg in a pot": "&obstacle name = 'peg' centre = 0.5, 0.5 radius = 0.1 /"
        " &obstacle name = 'pot' centre = 0.5, 0.5 radius = 0.5 side = 'inside' /",
    },
    "species": {
        "equal": "",
        "giants": "&species name = 'giant' count = 2 mass = 50 radius = 0.1 /",
    },
    "contact": {
        "elastic": "",
        "inelastic": "&contact restitution = 0.99 wall_rule = 'normal' contact_time = 5e-3 /",
    },
    "output": {
        "growing": "&output frames_every_time = 0.05 observables_every_collisions = 30"
        " event_log = .true. / &stop time = 20 /",
        "planned": "&output frames_every_events = 77 observables_every_events = 31"
        " precision = 'single' / &stop events = 4000 /",
        "mixed": "&output frames_every_collisions = 50 observables_every_time = 0.1 /"
        " &stop collisions_per_disk = 80 /",
        "per disk": "&output frames_every_collisions_per_disk = 3.3"
        " observables_every_collisions_per_disk = 0.7 / &stop collisions_per_disk = 80 /",
        "ends": "&stop time = 20 /",
    },
}
SYSTEMS = list(itertools.product(*(choice.values() for choice in CHOICES.values())))


def stops_until_the_end(run, times):
    """Runs to the end with a stop soon after each of these times; how often it was stopped.

    No clock decides where: the run ends at the time, goes on, and its wall clock stops it after a
    single step.
    """
    resume = []
    for stops, time in enumerate(times):
        assert run(f"stop.time={time}", *resume) == FINISHED
        resume = ["--resume"]
        if run("stop.wall_clock=1e-9", *resume) == FINISHED:
            return stops
    assert run("run.threads=1", *resume) == FINISHED
    return len(times)


def stopped_and_whole(program, most, folder, system):
    """Stops of a run in parts, and where its output differs from that of the run in one piece."""
    folder.mkdir()
    write_input(folder, GAS + "\n".join(system) + "\n")

    def run(setting, *options, name="parts.h5"):
        command = [program, "gas.nml", "-o", name, "--quiet", "--set", setting, *options]
        return subprocess.run(command, cwd=folder, stdout=subprocess.DEVNULL).returncode

    assert run("run.threads=1", name="whole.h5") == FINISHED
    with h5py.File(folder / "whole.h5") as file:
        end = file["particles/disks/position/time"][-1]
    rng = random.Random(str(system))
    stops = stops_until_the_end(run, sorted(rng.uniform(0, end) for _ in range(most)))
    other = differences(folder / "whole.h5", folder / "parts.h5")
    shutil.rmtree(folder)
    return stops, other


@pytest.mark.parametrize(("stride", "most"), [(41, 4), pytest.param(1, 20, marks=CHECK)])
def test_one_run_is_the_same_run_stopped_and_resumed(program, tmp_path, stride, most):
    """For every combination of the choices; fast: for some, in which every choice occurs."""
    systems = SYSTEMS[::stride]
    for k, choice in enumerate(CHOICES.values()):
        assert {system[k] for system in systems} == set(choice.values())
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        folders = (tmp_path / str(k) for k in range(len(systems)))
        results = list(pool.map(partial(stopped_and_whole, program, most), folders, systems))
    failed = {system: found for system, (_, found) in zip(systems, results, strict=True) if found}
    assert failed == {}
    assert sum(stops for stops, _ in results) > most / 2 * len(systems)


@pytest.fixture
def stopped(ricochet, tmp_path):
    """`stopped(*options)`: a run that its wall clock has stopped; its command less --resume."""
    write_input(tmp_path, MIXTURE)
    command = ["gas.nml", "-o", "gas.h5", "--set", "stop.time=1000"]
    run = ricochet(*command, "--set", "stop.wall_clock=1e-9")
    assert run.returncode == STOPPED and "--resume" in one_line(run)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "gas.chk.h5",
        "gas.h5.part",
        "gas.nml",
    ]
    return command


def test_stops_between_and_at_samples_and_before_the_first_event(ricochet, tmp_path):
    """The wall clock stops a run at once, so that every resume makes one little step."""
    write_input(tmp_path, GAS + SYSTEMS[0][-1])
    short = ["gas.nml", "--set", "species.gas.count=3", "--set", "species.gas.radius=0.15"]
    short += ["--set", "run.search='pairs'", "--set", "stop.time=1", "-o"]
    assert ricochet(*short, "whole.h5").returncode == FINISHED
    resume, status, stops = [], STOPPED, 0
    while status == STOPPED:
        run = ricochet(*short, "parts.h5", "--set", "stop.wall_clock=1e-9", *resume)
        status, resume, stops = run.returncode, ["--resume"], stops + 1
        assert stops < 500
    assert status == FINISHED and stops > 20
    changed = ["/parameters/overrides", "/parameters/stop@wall_clock"]
    assert differences(tmp_path / "whole.h5", tmp_path / "parts.h5") == changed


def test_every_part_of_a_run_gets_somewhere(ricochet, stopped):
    """Also when its wall clock stops it at once, before a disk comes to the next cell."""
    times = []
    for _ in range(12):
        run = ricochet(*stopped, "--resume", "--set", "stop.wall_clock=1e-9")
        assert run.returncode == STOPPED
        times.append(float(re.search("stopped at time ([^,]+),", one_line(run))[1]))
    assert times == sorted(set(times))


def test_how_a_run_is_done_may_change_when_it_goes_on(ricochet, tmp_path, stopped):
    fewer = [*stopped[:-1], "stop.time=40"]
    assert ricochet(*fewer, "--set", "stop.wall_clock=1e-9", "--force").returncode == STOPPED
    run = ricochet(*fewer, "--resume", "--set", "run.search='pairs'", "--set", "run.queue='heap'")
    assert run.returncode == FINISHED
    fewer[2] = "whole.h5"
    assert ricochet(*fewer).returncode == FINISHED
    other = differences(tmp_path / "whole.h5", tmp_path / "gas.h5")
    assert all(name.startswith("/parameters") for name in other)


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ("run.seed=8", "run.seed = 8"),
        ("species.heavy.mass=3", "species.heavy.mass = 3"),
        ("contact.contact_time=0.002", "contact.contact_time = 0.002"),
        ("contact.restitution=0.9", "contact.restitution = 0.9"),
        ("output.event_log=.false.", "output.event_log = .false."),
    ],
)
def test_a_checkpoint_of_another_input_is_refused(ricochet, tmp_path, stopped, change, names):
    before = (tmp_path / "gas.h5.part").read_bytes()
    run = ricochet(*stopped, "--set", change, "--resume")
    assert run.returncode == USAGE
    assert "another input" in one_line(run) and names in one_line(run)
    assert (tmp_path / "gas.h5.part").read_bytes() == before


def test_a_checkpoint_of_another_version_is_refused(ricochet, tmp_path, stopped):
    path = tmp_path / "gas.chk.h5"
    with h5py.File(path, "r+") as file:
        file["program"][()] = b"ricochet 0.0.9"
    seal(path)
    run = ricochet(*stopped, "--resume")
    assert run.returncode == USAGE and "ricochet 0.0.9" in one_line(run)


@pytest.mark.parametrize("trials", [60, pytest.param(600, marks=CHECK)])
def test_a_damaged_checkpoint_is_refused(ricochet, tmp_path, stopped, trials):
    path = tmp_path / "gas.chk.h5"
    whole, rng = path.read_bytes(), random.Random(1)
    for k in range(trials):
        damaged = bytearray(whole)
        if k % 2:
            damaged[rng.randrange(len(whole))] ^= 1 << rng.randrange(8)
        else:
            damaged = damaged[: k * len(whole) // trials]
        path.write_bytes(damaged)
        run = ricochet(*stopped, "--resume")
        assert run.returncode == USAGE and re.search("damaged|is empty", one_line(run))
    path.write_bytes(whole)
    run = ricochet(*stopped, "--resume", "--set", "stop.wall_clock=1e-9")
    assert run.returncode == STOPPED


def test_what_is_no_checkpoint_is_called_what_it_is(ricochet, tmp_path, stopped):
    """And the way out that is named is there."""
    path, earlier = tmp_path / "gas.chk.h5", tmp_path / "gas.chk_prev.h5"
    assert ricochet(*stopped, "--resume", "--set", "stop.wall_clock=1e-9").returncode == STOPPED
    whole = path.read_bytes()
    for content, flaw in [
        (b"", "is empty"),
        (b"ricochet", "is damaged, of another version, or not a checkpoint"),
        (whole[:40], "is damaged or cut short"),
        (whole[:-1], "is damaged or cut short"),
        (b"ricochet checkpoint, CRC-64 of the rest: ".ljust(64), "is damaged, of another version"),
        (b"notes\n" * 100, "is damaged, of another version, or not a checkpoint"),
        ((tmp_path / "gas.h5.part").read_bytes(), "is damaged, of another version"),
    ]:
        path.write_bytes(content)
        run = ricochet(*stopped, "--resume")
        assert run.returncode == USAGE
        assert one_line(run).startswith(f"gas.chk.h5: {flaw}") and "gas.chk_prev.h5" in run.stderr
    earlier.rename(path)
    earlier.write_bytes(whole[:-1])
    assert ricochet(*stopped, "--resume", "--set", "stop.wall_clock=1e-9").returncode == STOPPED
    path.unlink()
    path.mkdir()
    earlier.unlink()
    run = ricochet(*stopped, "--resume")
    assert run.returncode == USAGE
    assert one_line(run) == (
        "gas.chk.h5: is a folder; remove it; then --force instead of --resume starts over"
    )


def test_the_checkpoint_before_is_kept_and_is_as_good(ricochet, tmp_path):
    command = write_short_run(tmp_path)
    assert ricochet(*command, "whole.h5").returncode == FINISHED
    parts = [*command, "parts.h5"]
    for resume in ([], ["--resume"], ["--resume"]):
        run = ricochet(*parts, "--set", "stop.wall_clock=1e-9", *resume)
        assert run.returncode == STOPPED
    shutil.copy(tmp_path / "parts.chk_prev.h5", tmp_path / "parts.chk.h5")
    assert ricochet(*parts, "--resume").returncode == FINISHED
    other = differences(tmp_path / "whole.h5", tmp_path / "parts.h5")
    assert all(name.startswith("/parameters") for name in other)


def test_resuming_needs_a_checkpoint(ricochet, tmp_path):
    command = [*write_short_run(tmp_path), "gas.h5"]
    run = ricochet(*command, "--resume")
    assert run.returncode == FILES and "no checkpoint" in one_line(run)
    assert ricochet(*command).returncode == FINISHED
    run = ricochet(*command, "--resume")
    assert run.returncode == FILES and "finished" in one_line(run)


def test_resuming_needs_the_unfinished_output(ricochet, tmp_path, stopped):
    part = tmp_path / "gas.h5.part"
    part.write_bytes(part.read_bytes()[:5000])
    assert "gas.h5.part" in one_line(ricochet(*stopped, "--resume"))
    part.unlink()
    run = ricochet(*stopped, "--resume")
    assert run.returncode == FILES and "gas.h5.part" in one_line(run)


def test_a_stopped_run_is_started_over_by_force_only(ricochet, tmp_path, stopped):
    run = ricochet(*stopped)
    assert run.returncode == FILES and "--resume" in one_line(run) and "--force" in one_line(run)
    assert ricochet(*stopped[:-1], "stop.time=1", "--force").returncode == FINISHED
    assert sorted(path.name for path in tmp_path.iterdir()) == ["gas.h5", "gas.nml"]


def write_short_run(folder) -> list[str]:
    """The beginning of a command that runs a moment, up to -o."""
    write_input(folder, MIXTURE)
    return ["gas.nml", "--set", "stop.time=0.5", "-o"]
