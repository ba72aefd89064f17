"""Output files of runs: layout, parameters, sampling schedules and refused paths.

The numbers themselves are tested with random systems in test_random_systems.py, and in tests/unit/.
"""

import re
import time

import h5py
import numpy as np
import pytest

from whole_runs import FILES, FINISHED, MIXTURE, USAGE, contents, differences, one_line, write_input

GRAVITY = """&box upper = 2, 3  boundary = 'periodic', 'wall'  gravity = 0, -2 /
&species name = 'gas' count = 50 radius = 0.03 mass = 2 velocities = 'uniform' speed = 1 /
&obstacle name = 'peg' centre = 1, 1 radius = 0.3 /
&stop time = 3 /
&output frames_every_time = 0.1 observables_every_time = 0.1 event_log = .true. /
"""


@pytest.fixture
def ran(ricochet, tmp_path):
    """Return a function that executes a run and returns the open output file."""
    opened = []

    def run(text, *options, name="gas"):
        done = ricochet(write_input(tmp_path, text, f"{name}.nml"), "-o", f"{name}.h5", *options)
        assert (done.returncode, done.stderr) == (FINISHED, "")
        opened.append(h5py.File(tmp_path / f"{name}.h5", "r"))
        return opened[-1]

    yield run
    for file in opened:
        file.close()


def text(value) -> str:
    return value.decode()


def test_the_layout_is_h5md(ran):
    file = ran(MIXTURE)
    assert list(file["h5md"].attrs["version"]) == [1, 1]
    assert text(file["h5md/creator"].attrs["name"]) == "ricochet"
    assert "name" in file["h5md/author"].attrs
    disks = file["particles/disks"]
    assert disks["box"].attrs["dimension"] == 2
    assert [text(b) for b in disks["box"].attrs["boundary"]] == ["none", "none"]
    assert list(disks["box/edges"]) == [1, 1] and list(disks["box/lower"]) == [0, 0]
    assert list(disks["id"]) == list(range(1, 81))
    assert list(disks["species"]) == [1] * 60 + [2] * 20
    assert list(disks["mass"]) == [1] * 60 + [4] * 20
    assert list(disks["radius"]) == [0.02] * 60 + [0.03] * 20
    frames = 17
    for name, kind, shape in [
        ("position", np.float64, (frames, 80, 2)),
        ("velocity", np.float64, (frames, 80, 2)),
        ("event_count", np.int32, (frames, 80)),
    ]:
        assert disks[name]["value"].shape == shape and disks[name]["value"].dtype == kind
        assert disks[name]["step"] == disks["position/step"], "a hard link"
        assert disks[name]["time"] == disks["position/time"], "a hard link"
    assert "image" not in disks
    observables = file["observables"]
    scalars = ["total_energy", "virial_pressure", "virial", "dissipated_energy"]
    scalars += [
        f"{group}/{name}"
        for group in ("all", "light", "heavy")
        for name in ("kinetic_energy", "potential_energy", "mean_speed", "temperature")
    ]
    counts = ["collisions", "obstacle_collisions"]
    samples = len(observables["total_energy/value"])
    for name in [*scalars, *counts, "momentum", "side_collisions", "side_impulse"]:
        width = {"momentum": (2,), "side_collisions": (4,), "side_impulse": (4,)}.get(name, ())
        assert observables[name]["value"].shape == (samples, *width)
        assert observables[name]["step"] == observables["all/kinetic_energy/step"]
        assert observables[name]["time"] == observables["all/kinetic_energy/time"]
    for name in [*counts, "side_collisions"]:
        assert observables[name]["value"].dtype == np.int64
    assert disks["committed"][()] == frames and observables["committed"][()] == samples


def test_every_parameter_is_there_as_it_was_used(ran, tmp_path):
    sets = ["species.heavy.mass=5", "species.light.radius=", "species.light.packing_fraction=0.1"]
    sets += ["run.seed=2", "run.seed=6"]  # the last one is used
    file = ran(MIXTURE.rstrip("\n"), *(f"--set={word}" for word in sets))["parameters"]
    assert text(file["input"][()]) == MIXTURE.rstrip("\n")
    assert text(file["overrides"][()]).split() == sets
    assert file["seed"][()] == 6 and file["run"].attrs["seed"] == 6
    assert text(file["run"].attrs["search"]) == "cells"
    assert file["species/heavy"].attrs["mass"] == 5
    light = file["species/light"].attrs
    assert light["radius"] == pytest.approx((0.1 / 60 / np.pi) ** 0.5)
    assert text(light["velocities"]) == "maxwell" and "speed" not in light
    assert [text(kind) for kind in file["box"].attrs["boundary"]] == ["wall", "wall"]
    assert [text(name) for name in file["species/names"]] == ["light", "heavy"]
    assert list(file["species/counts"]) == [60, 20]
    assert file["contact"].attrs["wall_restitution"] == 0.9
    assert file["output"].attrs["event_log"] == 1
    assert file["stop"].attrs["time"] == 4
    assert "frames_every_events" not in file["output"].attrs
    table = ran(GRAVITY, name="obstacles")["parameters/obstacle"]
    assert [text(name) for name in table["name"]] == ["peg"]
    assert table["centre"][:].tolist() == [[1, 1]]
    assert list(table["radius"]) == [0.3] and list(table["inside"]) == [0]


def test_the_origin_is_there(ran):
    origin = ran(MIXTURE)["provenance"].attrs
    for name in ("program_version", "git_commit", "compiler", "flags", "hdf5_version", "host"):
        assert text(origin[name]).strip()
    assert "-ffp-contract=off" in text(origin["flags"])
    assert origin["wall_time"] > 0 and origin["collisions_per_second"] > 0


@pytest.mark.parametrize(
    ("track", "cadence", "end", "expected"),
    [
        ("frames", "every_time=0.1", "time=1", [k * 0.1 for k in range(11)]),
        ("frames", "every_time=0.1", "time=1.03", [*(k * 0.1 for k in range(11)), 1.03]),
        ("frames", "every_time=", "time=0.7", [0, 0.7]),
        (
            "frames",
            "at=0.1,0.7500000000000001,9",
            "time=0.8",
            [0, 0.1, 0.25, 0.5, 0.7500000000000001, 0.8],
        ),
        ("observables", "every_collisions=40", "collisions=250", [*range(0, 250, 40), 250]),
        ("observables", "every_events=40", "events=250", [*range(0, 250, 40), 250]),
        ("observables", "every_collisions_per_disk=1", "collisions=250", [*range(0, 250, 40), 250]),
    ],
)
def test_samples_are_at_the_very_multiples_and_at_the_end(ran, track, cadence, end, expected):
    """A schedule on the command line replaces that of the same samples in the input."""
    file = ran(MIXTURE, f"--set=output.{track}_{cadence}", "--set=stop.time=", f"--set=stop.{end}")
    disks, seen = file["particles/disks"], file["observables"]
    times, number = disks["position/time"][:], seen["collisions/value"][:]
    if "events" in cadence:
        number = number + seen["side_collisions/value"][:].sum(axis=1)
    assert (times if track == "frames" else number).tolist() == expected
    assert disks["position/step"][:].tolist() == list(range(len(times)))
    other = (number[1:-1] % 50 == 0) if track == "frames" else (times[1:-1] % 0.25 == 0)
    assert other.all() and len(other) > 0


def test_single_precision_is_the_same_run_rounded(ran):
    double = ran(MIXTURE)["particles/disks"]
    single = ran(MIXTURE, "--set", "output.precision='single'", name="single")["particles/disks"]
    for name in ("position", "velocity"):
        assert single[name]["value"].dtype == np.float32
        rounded = double[name]["value"][:].astype(np.float32)
        assert (single[name]["value"][:] == rounded).all()
    assert (single["position/time"][:] == double["position/time"][:]).all()


TURNING = GRAVITY + "&contact friction = 0.2 tangential_restitution = 0.3 /\n"
COLUMNS = "velocity", "event_count", "image", "angular_velocity", "orientation"


@pytest.mark.parametrize("wanted", [["position"], COLUMNS[:1], COLUMNS[1:4:2], COLUMNS])
def test_frames_have_the_columns_that_are_asked_for(ran, wanted):
    """Frames contain positions and the requested columns; all other data are the same."""
    whole = ran(TURNING, name="whole")["particles/disks"]
    words = ", ".join(f"'{name}'" for name in wanted)
    part = ran(TURNING, f"--set=output.frame_columns={words}", name="part")["particles/disks"]
    found, there = ({name for name in disks if f"{name}/value" in disks} for disks in (part, whole))
    assert there >= {"position", "velocity", "event_count", "image", "angular_velocity"}
    assert found == there & {"position", *wanted}
    for name in found:
        for item in ("step", "time", "value"):
            assert (part[name][item][:] == whole[name][item][:]).all()


@pytest.mark.parametrize("cut", [0, 1.5, 3.0])
def test_counts_in_frames_grow_longer_where_they_must(ricochet, tmp_path, cut):
    """A disk crosses a box of length 1 so fast that 32 bits suffice only up to t = 2.1."""
    path = write_input(
        tmp_path,
        """&box boundary = 'periodic', 'periodic' /
        &species name = 'a' count = 1 radius = 0.1 velocity = 1e9, 0 /
        &run dynamics = 'steps' dt = 0.25 /
        &stop time = 4 /
        &output frames_every_time = 0.5 /""",
    )
    ricochet(path, "-o", "a.h5", *([f"--set=stop.time={cut}"] if cut else []))
    ended = ricochet(path, "-o", "a.h5", *(["--resume"] if cut else []))
    with h5py.File(tmp_path / "a.h5", "r") as file:
        image = file["particles/disks/image/value"]
        assert image.dtype == np.int64, ended.stderr
        assert image[:, 0, 0].tolist() == [500_000_000 * k for k in range(9)]


def test_the_same_input_gives_the_same_bytes(ran, tmp_path):
    """Two runs of an input write equal files, except for two numbers on the computing time."""
    every = ["--set", "output.frames_every_time=", "--set", "output.frames_every_events=7"]
    ran(MIXTURE, *every, name="one").close()
    time.sleep(1.1)  # a second later: no time stamps
    ran(MIXTURE, *every, name="two").close()
    one, two = ((tmp_path / f"{name}.h5").read_bytes() for name in ("one", "two"))
    assert len(one) == len(two)
    differing = [k for k in range(len(one)) if one[k] != two[k]]
    assert len(differing) <= 16
    assert differences(tmp_path / "one.h5", tmp_path / "two.h5") == []


@pytest.mark.parametrize("turn", ["", "species.light.angular_velocity=9"])
def test_the_summary_says_what_the_file_says(ricochet, tmp_path, turn):
    run = ricochet(write_input(tmp_path), "-o", "gas.h5", *(["--set", turn] if turn else []))
    said = dict(line.split(" = ") for line in run.stdout.splitlines())
    found = contents(tmp_path / "gas.h5")
    for name in ("total_energy", "dissipated_energy", "collisions"):
        assert float(said[name]) == pytest.approx(found[f"/observables/{name}/value"][-1], rel=1e-6)
    for name in ("kinetic_energy", *["rotational_energy"] * bool(turn)):
        mean = found[f"/observables/all/{name}/value"][-1]
        assert float(said[name]) == pytest.approx(80 * mean, rel=1e-6)
    assert ("rotational_energy" in said) == bool(turn)
    rate = found["/provenance@collisions_per_second"]
    assert float(said["collisions_per_second"]) == pytest.approx(rate, rel=1e-6)


def test_the_summary_of_a_billiard_has_a_rate_of_events(ricochet, tmp_path):
    """A disk among boundaries has no collisions with disks, and a rate of 0 says nothing."""
    one = "&species count = 1 radius = 0.01 speed = 1 / &stop events = 1000 /"
    said = ricochet(write_input(tmp_path, one), "-o", "one.h5").stdout
    rate = float(re.search(r"^events_per_second = (.+)$", said, re.M)[1])
    assert "collisions_per_second = 0\n" in said and rate > 100
    assert "events_per_second" not in ricochet(write_input(tmp_path), "-o", "gas.h5").stdout


def test_the_file_of_a_small_run_is_small(ran, tmp_path):
    """A sweep of 10^5 small runs fits on a disk: tables of groups are not larger than the data."""
    ran(
        """&species count = 100 packing_fraction = 0.1 speed = 1 /
        &stop collisions_per_disk = 10 /
        &output frames_every_collisions = 500 observables_every_collisions = 50 /"""
    )
    assert (tmp_path / "gas.h5").stat().st_size < 75_000


def test_folders_are_made_and_nothing_is_left_beside_the_result(ricochet, tmp_path):
    input_file = write_input(tmp_path)
    run = ricochet(input_file, "-o", "some/where/gas.h5")
    assert run.returncode == FINISHED
    assert one_line(run) == "note: folder some/where/ has been created for the output"
    run = ricochet(input_file, "-o", "some/where/gas.h5", "--force")
    assert (run.returncode, run.stderr) == (FINISHED, "")
    assert [path.name for path in (tmp_path / "some/where").iterdir()] == ["gas.h5"]


def test_a_run_that_is_over_before_it_begins_says_why(ricochet, tmp_path):
    rest = ["--set", "species.light.velocities='rest'", "--set", "species.heavy.velocities='rest'"]
    rest += ["--set", "species.light.temperature=", "--set", "species.heavy.temperature="]
    input_file = write_input(tmp_path)
    run = ricochet(input_file, "-o", "gas.h5", *rest, "--set", "stop.energy_fraction=0.1")
    assert run.returncode == FINISHED and "\ntime = 0\n" in run.stdout
    assert "no disk moves at the start" in one_line(run)


def test_impossible_places_are_refused_in_one_line(ricochet, tmp_path):
    input_file = write_input(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    for place, reason in [
        ("folder", "is a folder"),
        ("file/gas.h5", "cannot make its folder"),
        ("/proc/gas.h5", "cannot be created"),
        ("/proc/some/where/gas.h5", "cannot make its folder"),
        ("/dev/null", "exists already"),
    ]:
        run = ricochet(input_file, "-o", place)
        assert run.returncode == FILES
        assert reason in one_line(run) and place in one_line(run)


def test_a_species_has_no_name_that_the_file_uses_itself(ricochet, ran, tmp_path):
    """A species cannot be named like another object of the same HDF5 group."""
    file = ran(MIXTURE)
    used = {*file["observables"], *file["parameters/species"]} - {"light", "heavy"}
    assert {"all", "committed", "momentum", "names", "counts"} < used
    for name in used:
        write_input(tmp_path, MIXTURE.replace("heavy", name))
        run = ricochet("gas.nml", "-o", "other.h5")
        assert run.returncode == USAGE
        assert "species.name" in one_line(run) and f'"{name}"' in run.stderr
    assert not list(tmp_path.glob("other*"))


def test_a_file_that_was_rebuilt_lacks_nothing(ran, tmp_path):
    """A file is rebuilt only if the stop condition does not determine its number of samples."""
    planned = ["--set", "output.event_log=.false."]
    ran(GRAVITY, *planned, name="planned").close()
    ran(GRAVITY, *planned, "--set", "stop.collisions=1000000000", name="rebuilt").close()
    assert differences(tmp_path / "planned.h5", tmp_path / "rebuilt.h5") == [
        "/parameters/overrides",
        "/parameters/stop@collisions",
    ]
