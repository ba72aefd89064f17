"""The output file of whole runs: layout, meaning of every number, order, cadence, and refusals."""

import shutil
import subprocess
import time

import h5py
import numpy as np
import pytest

from whole_runs import (
    FILES,
    FINISHED,
    MIXTURE,
    USAGE,
    contents,
    differences,
    one_line,
    write_input,
)

GRAVITY = """&box upper = 2, 3  boundary = 'periodic', 'wall'  gravity = 0, -2 /
&species name = 'gas' count = 50 radius = 0.03 mass = 2 velocities = 'uniform' speed = 1 /
&obstacle name = 'peg' centre = 1, 1 radius = 0.3 /
&stop time = 3 /
&output frames_every_time = 0.1 observables_every_time = 0.1 event_log = .true. /
"""


@pytest.fixture
def ran(ricochet, tmp_path):
    """`ran(text, *options)` performs a run and returns the open output file."""
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
    frames = 17
    for name, kind, shape in [
        ("position", np.float64, (frames, 80, 2)),
        ("velocity", np.float64, (frames, 80, 2)),
        ("collisions", np.int64, (frames, 80)),
    ]:
        assert disks[name]["value"].shape == shape and disks[name]["value"].dtype == kind
        assert disks[name]["step"] == disks["position/step"], "a hard link"
        assert disks[name]["time"] == disks["position/time"], "a hard link"
    assert "image" not in disks
    observables = file["observables"]
    scalars = ["total_energy", "pressure", "virial", "dissipated_energy"]
    scalars += [
        f"{group}/{name}"
        for group in ("all", "light", "heavy")
        for name in ("kinetic_energy", "potential_energy", "mean_speed", "temperature")
    ]
    counts = ["collisions", "obstacle_collisions"]
    samples = len(observables["total_energy/value"])
    for name in [*scalars, *counts, "momentum", "wall_collisions", "wall_impulse"]:
        width = {"momentum": (2,), "wall_collisions": (4,), "wall_impulse": (4,)}.get(name, ())
        assert observables[name]["value"].shape == (samples, *width)
        assert observables[name]["step"] == observables["all/kinetic_energy/step"]
        assert observables[name]["time"] == observables["all/kinetic_energy/time"]
    for name in [*counts, "wall_collisions"]:
        assert observables[name]["value"].dtype == np.int64
    assert disks["committed"][()] == frames and observables["committed"][()] == samples


def test_every_parameter_is_there_as_it_was_used(ran, tmp_path):
    file = ran(MIXTURE, "--set", "species.heavy.mass=5", "--set", "run.seed=6")["parameters"]
    assert text(file["input"][()]) == MIXTURE.rstrip("\n") or text(file["input"][()]) == MIXTURE
    assert text(file["overrides"][()]).split() == ["species.heavy.mass=5", "run.seed=6"]
    assert file["seed"][()] == 6 and file["run"].attrs["seed"] == 6
    assert text(file["run"].attrs["search"]) == "cells"
    assert file["species/heavy"].attrs["mass"] == 5
    assert file["species/light"].attrs["radius"] == 0.02
    assert [text(name) for name in file["species/names"]] == ["light", "heavy"]
    assert list(file["species/counts"]) == [60, 20]
    assert file["contact"].attrs["wall_restitution"] == 0.9
    assert file["output"].attrs["event_log"] == 1
    assert file["stop"].attrs["time"] == 4
    assert "frames_every_events" not in file["output"].attrs


def test_the_origin_is_there(ran):
    origin = ran(MIXTURE)["provenance"].attrs
    for name in ("program_version", "git_commit", "compiler", "flags", "hdf5_version", "host"):
        assert text(origin[name]).strip()
    assert "-ffp-contract=off" in text(origin["flags"])
    assert origin["wall_time"] > 0 and origin["collisions_per_second"] > 0


def test_obstacles_are_one_table(ran):
    table = ran(GRAVITY)["parameters/obstacle"]
    assert [text(name) for name in table["name"]] == ["peg"]
    assert table["centre"][:].tolist() == [[1, 1]]
    assert list(table["radius"]) == [0.3] and list(table["inside"]) == [0]


def test_disks_stand_in_the_order_of_the_input(ran):
    """The program renumbers its disks as they move; the file must not show it."""
    file = ran(MIXTURE, "--set", "output.frames_every_time=0.01", "--set", "stop.time=6")
    disks = file["particles/disks"]
    assert list(disks["id"]) == list(range(1, 81))
    assert list(disks["species"]) == [1] * 60 + [2] * 20
    assert list(disks["mass"]) == [1] * 60 + [4] * 20
    assert list(disks["radius"]) == [0.02] * 60 + [0.03] * 20
    assert file["observables/collisions/value"][-1] > 1500, "long enough for renumbering"
    position, velocity = disks["position/value"][:], disks["velocity/value"][:]
    fastest = np.linalg.norm(velocity, axis=-1).max()
    steps = np.linalg.norm(np.diff(position, axis=0), axis=-1)
    assert steps.max() <= fastest * 0.01 * (1 + 1e-9)
    assert position.min() >= 0.02 - 1e-12 and position.max() <= 0.98 + 1e-12
    assert (np.diff(disks["collisions/value"][:], axis=0) >= 0).all()


def test_explicit_positions_are_the_first_frame(ran):
    file = ran(
        "&species name = 'a' count = 3 radius = 0.01 position = 0.9,0.8, 0.1,0.2, 0.5,0.5\n"
        "velocity = 1,2, 3,4, 5,6 /\n&stop time = 0 /\n"
    )
    disks = file["particles/disks"]
    assert disks["position/value"][:].tolist() == [[[0.9, 0.8], [0.1, 0.2], [0.5, 0.5]]]
    assert disks["velocity/value"][:].tolist() == [[[1, 2], [3, 4], [5, 6]]]
    assert disks["position/time"][:].tolist() == [0]


@pytest.mark.parametrize(("end", "last"), [(1.0, [1.0]), (1.03, [1.0, 1.03])])
def test_samples_by_time_are_at_the_very_multiples_and_at_the_end(ran, end, last):
    file = ran(MIXTURE, "--set", "output.frames_every_time=0.1", "--set", f"stop.time={end}")
    time = file["particles/disks/position/time"][:]
    assert time.tolist() == [k * 0.1 for k in range(10)] + last
    assert file["particles/disks/position/step"][:].tolist() == list(range(len(time)))


@pytest.mark.parametrize("kind", ["collisions", "events"])
def test_samples_by_number_are_at_the_very_multiples_and_at_the_end(ran, kind):
    every = ["--set", "output.observables_every_collisions=", "--set", "stop.time="]
    every += ["--set", f"output.observables_every_{kind}=40", "--set", f"stop.{kind}=250"]
    file = ran(MIXTURE, *every)["observables"]
    number = file["collisions/value"][:]
    if kind == "events":
        number = number + file["wall_collisions/value"][:].sum(axis=1)
    assert number.tolist() == [0, 40, 80, 120, 160, 200, 240, 250]


def test_without_a_cadence_there_are_the_first_and_the_last_sample(ran):
    file = ran(MIXTURE, "--set", "output.frames_every_time=", "--set", "stop.time=0.7")
    assert file["particles/disks/position/time"][:].tolist() == [0, 0.7]


def test_observables_are_what_the_frames_say(ran):
    file = ran(GRAVITY)
    disks, seen = file["particles/disks"], file["observables"]
    v, x, mass = disks["velocity/value"][:], disks["position/value"][:], disks["mass"][:]
    kinetic = 0.5 * mass * (v**2).sum(axis=-1)
    potential = 2 * mass * x[..., 1]
    own = 0.5 * mass * ((v - v.mean(axis=1, keepdims=True)) ** 2).sum(axis=-1)
    dissipated = seen["dissipated_energy/value"][:]
    expected = {
        "all/kinetic_energy": kinetic.mean(axis=1),
        "gas/potential_energy": potential.mean(axis=1),
        "gas/mean_speed": np.linalg.norm(v, axis=-1).mean(axis=1),
        "all/temperature": own.mean(axis=1),
        "momentum": (mass[:, None] * v).sum(axis=1),
        "total_energy": (kinetic + potential).sum(axis=1),
    }
    for name, values in expected.items():
        np.testing.assert_allclose(seen[name]["value"][:], values, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(seen["total_energy/value"][:], seen["total_energy/value"][0])
    assert abs(dissipated).max() < 1e-10
    area = 6 - np.pi * 0.09
    time, virial = seen["virial/time"][1:], seen["virial/value"][1:]
    pressure = (kinetic.sum(axis=1)[1:] + virial / (2 * time)) / area
    np.testing.assert_allclose(seen["pressure/value"][1:], pressure, rtol=1e-12)
    assert np.isclose(seen["pressure/value"][0], kinetic[0].sum() / area)


def test_energy_that_is_gone_has_been_dissipated(ran):
    seen = ran(MIXTURE)["observables"]
    balance = seen["total_energy/value"][:] + seen["dissipated_energy/value"][:]
    np.testing.assert_allclose(balance, balance[0], rtol=1e-12)
    assert seen["dissipated_energy/value"][-1] > 0


def test_positions_are_in_the_periodic_box_and_images_count_the_periods(ran):
    file = ran(GRAVITY, "--set", "stop.time=20")
    disks = file["particles/disks"]
    assert [text(b) for b in disks["box"].attrs["boundary"]] == ["periodic", "none"]
    x, image = disks["position/value"][:], disks["image/value"][:]
    assert (x[..., 0] >= 0).all() and (x[..., 0] < 2).all()
    assert (image[..., 1] == 0).all() and np.abs(image[..., 0]).max() > 2
    way = np.abs(np.diff((x + image * [2, 3])[..., 0], axis=0)).max()
    assert way <= 0.1 * np.abs(disks["velocity/value"][..., 0]).max() * (1 + 1e-9)


def test_single_precision_is_the_same_run_rounded(ran):
    double = ran(MIXTURE)["particles/disks"]
    single = ran(MIXTURE, "--set", "output.precision='single'", name="single")["particles/disks"]
    for name in ("position", "velocity"):
        assert single[name]["value"].dtype == np.float32
        rounded = double[name]["value"][:].astype(np.float32)
        assert (single[name]["value"][:] == rounded).all()
    assert (single["position/time"][:] == double["position/time"][:]).all()


def test_the_event_log_lists_every_collision(ran):
    file = ran(GRAVITY)
    events, seen = file["events"], file["observables"]
    i, j, when = events["i"][:], events["j"][:], events["time"][:]
    assert (np.diff(when) >= 0).all() and when[-1] <= 3
    assert (j > 0).sum() == seen["collisions/value"][-1]
    walls = [(j == code).sum() for code in (0, -1, -2, -3)]
    assert walls == seen["wall_collisions/value"][-1].tolist() and walls[:2] == [0, 0]
    assert (j == -4).sum() == seen["obstacle_collisions/value"][-1] > 0
    assert (j >= -4).all() and (i >= 1).all() and (i <= 50).all() and (i != j).all()
    floor = events["impulse"][:][j == -2].sum()
    assert np.isclose(floor, seen["wall_impulse/value"][-1][2]), "the wall is elastic: no friction"
    per_disk = np.bincount(np.concatenate([i, j[j > 0]]) - 1, minlength=50)
    assert per_disk.tolist() == file["particles/disks/collisions/value"][-1].tolist()
    assert events["committed"][()] == len(when)


@pytest.mark.parametrize(
    ("count", "packing", "seed"), [(3, 0.001, 22), (3, 0.001, 23), (10, 0.01, 29), (10, 0.01, 37)]
)
def test_a_period_brings_no_old_contact_back(ran, tmp_path, count, packing, seed):
    """Without rebound a pair stays in contact to the last bits, which a period changes."""
    sticky = f"""&run seed = {seed} / &contact restitution = 0 /
    &box boundary = 'periodic', 'periodic' /
    &species count = {count} packing_fraction = {packing} temperature = 1 /
    &stop collisions_per_disk = 50 time = 1e5 /
    &output event_log = .true. frames_every_collisions = 1 /
    """
    for name, search, queue in (("cells", "cells", "calendar"), ("pairs", "pairs", "heap")):
        ways = ("--set", f"run.search={search}", "--set", f"run.queue={queue}")
        file = ran(sticky, *ways, name=name)
        assert (np.diff(file["events/time"][:]) >= 0).all()
        file.close()
    found = differences(tmp_path / "cells.h5", tmp_path / "pairs.h5")
    assert [name for name in found if "parameters" not in name] == []


def test_the_same_input_gives_the_same_bytes(ran, tmp_path):
    """Cost apart: two numbers of 8 bytes, and both runs on one build and host."""
    every = ["--set", "output.frames_every_time=", "--set", "output.frames_every_events=7"]
    ran(MIXTURE, *every, name="one").close()
    time.sleep(1.1)  # a second later: no time stamps
    ran(MIXTURE, *every, name="two").close()
    one, two = ((tmp_path / f"{name}.h5").read_bytes() for name in ("one", "two"))
    assert len(one) == len(two)
    differing = [k for k in range(len(one)) if one[k] != two[k]]
    assert len(differing) <= 16
    assert differences(tmp_path / "one.h5", tmp_path / "two.h5") == []


def test_a_cadence_that_is_set_takes_the_place_of_that_in_the_file(ricochet, tmp_path):
    """For the same samples only."""
    write_input(
        tmp_path,
        "&species count = 20 radius = 0.02 speed = 1 / &stop collisions = 40 /"
        " &output frames_every_collisions = 10 observables_every_collisions = 10 /\n",
    )

    def samples(name, *settings):
        run = ricochet("gas.nml", "-o", name, *(f"--set=output.{each}" for each in settings))
        assert run.returncode == FINISHED, run.stderr
        with h5py.File(tmp_path / name) as file:
            tracks = "particles/disks/position", "observables/total_energy"
            return tuple(len(file[track]["step"]) for track in tracks)

    assert samples("a.h5") == (5, 5)
    assert samples("b.h5", "frames_every_collisions_per_disk=2") == (3, 5)
    assert samples("c.h5", "observables_every_collisions=20") == (5, 3)


def test_two_cadences_of_the_same_samples_are_refused(ricochet, tmp_path):
    """In the file or on the command line; neither would be left out without a word."""
    disks = "&species count = 20 radius = 0.02 speed = 1 / &stop collisions = 40 /\n"
    write_input(tmp_path, disks)
    both = "output.frames_every_collisions_per_disk=2", "output.frames_every_collisions=15"
    twice = ricochet("gas.nml", *(f"--set={each}" for each in both))
    words = "is given with frames_every_collisions; give one of them\n"
    assert twice.returncode == USAGE
    assert twice.stderr == f"--set {both[0]}: output.frames_every_collisions_per_disk: {words}"
    write_input(
        tmp_path,
        disks + "&output frames_every_collisions = 15\nframes_every_collisions_per_disk = 2 /\n",
    )
    twice = ricochet("gas.nml")
    assert twice.returncode == USAGE
    assert twice.stderr == f"gas.nml:3: output.frames_every_collisions_per_disk: {words}"
    assert ricochet("gas.nml", f"--set={both[1]}").returncode == FINISHED


def test_the_cadence_leaves_no_trace_in_the_trajectory(ran, tmp_path):
    often = ran(MIXTURE, "--set", "output.frames_every_time=0.0125", name="often")
    seldom = ran(MIXTURE, "--set", "output.observables_every_collisions=7", name="seldom")
    for name in ("position", "velocity", "collisions"):
        path = f"particles/disks/{name}/value"
        assert (often[path][::20] == seldom[path][:]).all()


def test_other_tools_read_the_file(ran, tmp_path):
    ran(MIXTURE).close()
    if shutil.which("h5dump") is None:
        pytest.skip("no h5dump")
    dump = subprocess.run(
        ["h5dump", "-d", "/particles/disks/position/time", tmp_path / "gas.h5"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "3.75, 4" in dump.stdout


def test_the_summary_says_what_the_file_says(ricochet, tmp_path):
    run = ricochet(write_input(tmp_path), "-o", "gas.h5")
    said = dict(line.split(" = ") for line in run.stdout.splitlines())
    found = contents(tmp_path / "gas.h5")
    for name in ("total_energy", "dissipated_energy", "collisions"):
        assert float(said[name]) == pytest.approx(found[f"/observables/{name}/value"][-1], rel=1e-6)
    rate = found["/provenance@collisions_per_second"]
    assert float(said["collisions_per_second"]) == pytest.approx(rate, rel=1e-6)


def test_folders_are_made_and_nothing_is_left_beside_the_result(ricochet, tmp_path):
    input_file = write_input(tmp_path)
    run = ricochet(input_file, "-o", "some/where/gas.h5")
    assert run.returncode == FINISHED
    assert one_line(run) == "note: folder some/where/ has been created for the output"
    run = ricochet(input_file, "-o", "some/where/gas.h5", "--force")
    assert (run.returncode, run.stderr) == (FINISHED, "")
    assert [path.name for path in (tmp_path / "some/where").iterdir()] == ["gas.h5"]


def test_a_finished_file_is_replaced_by_force_only(ricochet, tmp_path):
    path, input_file = tmp_path / "gas.h5", write_input(tmp_path)
    ricochet(input_file, "-o", path)
    before = path.read_bytes()
    run = ricochet(input_file, "-o", path, "--set", "run.seed=8")
    assert run.returncode == FILES and "--force" in one_line(run)
    assert path.read_bytes() == before
    run = ricochet(input_file, "-o", path, "--set", "run.seed=8", "--force")
    assert run.returncode == FINISHED
    assert contents(path)["/parameters/seed"] == 8


def test_a_run_that_is_over_before_it_begins_says_why(ricochet, tmp_path):
    rest = ["--set", "species.light.velocities='rest'", "--set", "species.heavy.velocities='rest'"]
    rest += ["--set", "species.light.temperature=", "--set", "species.heavy.temperature="]
    input_file = write_input(tmp_path)
    run = ricochet(input_file, "-o", "gas.h5", *rest, "--set", "stop.energy_fraction=0.1")
    assert run.returncode == FINISHED and "\ntime = 0\n" in run.stdout
    assert "nothing moves at the start" in one_line(run)


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


def test_an_output_beyond_the_disk_is_refused_before_the_run(ricochet, tmp_path):
    run = ricochet(write_input(tmp_path), "-o", "gas.h5", "--set", "output.frames_every_time=4e-9")
    assert run.returncode == FILES
    assert "are free" in one_line(run) and list(tmp_path.glob("gas.h5*")) == []


def test_a_species_has_no_name_that_the_file_uses_itself(ricochet, ran, tmp_path):
    """Nothing that stands beside the groups of species, as found in a file."""
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
    """One with room for just its samples is not; with another stop rule their number is unknown."""
    planned = ["--set", "output.event_log=.false."]
    ran(GRAVITY, *planned, name="planned").close()
    ran(GRAVITY, *planned, "--set", "stop.collisions=1000000000", name="rebuilt").close()
    assert differences(tmp_path / "planned.h5", tmp_path / "rebuilt.h5") == [
        "/parameters/overrides",
        "/parameters/stop@collisions",
    ]
