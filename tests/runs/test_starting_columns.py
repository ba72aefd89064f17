"""Initial-configuration files with the radius, mass and other quantities of each disk."""

import h5py
import numpy as np
import pytest

from ricochet import read_run, write_start
from ricochet.figures.film_data import radii_of
from synthetic_run import run_script
from whole_runs import FILES, FINISHED, STOPPED, USAGE, differences, one_line, write_input

COUNT = 120
INPUT = """&box boundary = 'periodic', 'wall' upper = 2, 1 /
&species name = 'bed' file = 'bed.txt' /
&species name = 'stone' file = 'bed.txt' /
&stop collisions_per_disk = 40 /
&output observables_every_collisions = 100 frames_every_collisions = 400 event_log = .true. /
"""


@pytest.fixture
def bed(tmp_path):
    """Write an initial-configuration file of disks of different radii, and return its arrays."""
    rng = np.random.default_rng(5)
    site = np.stack(np.divmod(np.arange(COUNT), 8), axis=1)
    arrays = {
        "position": (site + 0.5) * [2 / 15, 1 / 8],
        "velocity": rng.normal(size=(COUNT, 2)),
        "radius": rng.uniform(0.01, 0.06, COUNT),
        "mass": rng.uniform(0.1, 9, COUNT),
        "species": np.where(np.arange(COUNT) % 10 == 3, "stone", "bed"),
        "angular_velocity": rng.normal(size=COUNT),
        "orientation": rng.uniform(-9, 9, COUNT),
    }
    write_start(tmp_path / "bed.txt", **arrays)
    write_input(tmp_path, INPUT)
    return arrays


def by_species(arrays):
    """Return the arrays sorted by species, the order of the disks in the output file."""
    order = np.argsort(arrays["species"] != "bed", kind="stable")
    return {name: values[order] for name, values in arrays.items()}


def finished(ricochet, path, *options):
    run = ricochet("gas.nml", "-o", path, "--quiet", *options)
    assert run.returncode == FINISHED, run.stderr
    return run


def disks_in(path, frame):
    """Return the quantities of each disk in a frame."""
    with h5py.File(path) as file:
        disks = file["particles/disks"]
        moving = ("position", "velocity", "angular_velocity", "orientation")
        found = {name: disks[f"{name}/value"][frame] for name in moving}
        return found | {name: disks[name][:] for name in ("radius", "mass")}


SPINNING = INPUT + "&contact tangential_restitution = 0.3 friction = 0.2 restitution = 0.9 /"


@pytest.mark.parametrize("text", [INPUT, SPINNING])
def test_every_column_arrives_to_the_last_digit_and_that_of_a_last_frame(
    ricochet, tmp_path, bed, text
):
    """All columns are read exactly, and the input can override columns for a species."""
    names, rows = (tmp_path / "bed.txt").read_text().split("\n", 1)
    rows = f"# a bed\n{names.upper()}\n\n" + rows.replace(" ", ",\t")
    (tmp_path / "bed.txt").write_text("\ufeff" + rows.replace("\n", "\r\n") + "# its end")
    write_input(tmp_path, text)
    finished(ricochet, "gas.h5")
    first, there = disks_in(tmp_path / "gas.h5", 0), by_species(bed)
    assert all((first[name] == there[name]).all() for name in first)
    run = read_run(tmp_path / "gas.h5")
    assert [kind.disks.sum() for kind in run.by_species] == [108, 12]
    own = run.parameters["species"]["bed"]
    assert own["count"] == 108 and "mass" not in own and "radius" not in own
    area = np.pi * np.sum(there["radius"][:108] ** 2)
    assert own["packing_fraction"] == pytest.approx(area / 2)
    last = disks_in(tmp_path / "gas.h5", -1)
    kept = (last["angular_velocity"] == first["angular_velocity"]).all()
    assert kept == (text == INPUT)
    write_input(tmp_path, text.replace("bed.txt", "gas.h5"))
    finished(ricochet, "next.h5")
    begun = disks_in(tmp_path / "next.h5", 0)
    assert all((begun[name] == last[name]).all() for name in last)
    said = {"radius": 0.01, "mass": 2, "angular_velocity": 0}
    finished(ricochet, "new.h5", *(f"--set=species.bed.{name}={said[name]}" for name in said))
    new = disks_in(tmp_path / "new.h5", 0)
    for name, value in said.items():
        assert (new[name][:108] == value).all() and (new[name][108:] == last[name][108:]).all()


def test_a_file_says_nothing_of_spins_where_the_input_says_how_disks_start(ricochet, tmp_path, bed):
    """If the input specifies velocities, the file still determines orientations and positions."""
    rest = [f"--set=species.{name}.velocities=rest" for name in ("bed", "stone")]
    finished(ricochet, "gas.h5", "--set=stop.time=1", *rest)
    with h5py.File(tmp_path / "gas.h5") as file:
        assert "angular_velocity" not in file["particles/disks"]
        angle = file["particles/disks/orientation/value"]
        assert (angle[:] == by_species(bed)["orientation"]).all()


def test_disks_of_many_sizes_grow_to_their_own(ricochet, tmp_path, bed):
    bed["radius"] *= 1.25
    write_start(tmp_path / "bed.txt", **bed)
    run = ricochet("gas.nml", "-o", "x.h5")
    assert run.returncode == USAGE and "overlaps disk" in run.stderr
    grown = [f"species.{name}.placement=grown" for name in ("bed", "stone")]
    finished(ricochet, "gas.h5", "--set", grown[0], "--set", grown[1])
    run = read_run(tmp_path / "gas.h5")
    assert (run.radius == by_species(bed)["radius"]).all()
    apart = run.position[0][:, None] - run.position[0]
    apart[..., 0] -= np.round(apart[..., 0] / 2) * 2
    assert (np.hypot(*apart.T) - run.radius - run.radius[:, None] + np.eye(COUNT)).min() > -1e-13


@pytest.mark.parametrize(
    ("law", "spread", "placement", "packing"),
    [
        ("uniform", 0.47, "random", 0.6),
        ("gaussian", 0.1, "lattice", 0.3),
        ("gaussian", 0.27, "dense", 0.75),
        ("lognormal", 0.39, "random", 0.5),
        ("lognormal", 0.2, "grown", 0.7),
    ],
)
def test_radii_that_are_drawn_fill_what_was_asked_and_go_on(
    ricochet, tmp_path, law, spread, placement, packing
):
    """Random radii yield the requested packing fraction, and masses proportional to their areas."""
    grown = "file = 'start.txt' velocities = 'rest' placement = 'grown'"
    where = grown if placement == "grown" else f"temperature = 1 placement = '{placement}'"
    site = np.stack(np.divmod(np.arange(400), 20), axis=1)
    write_start(tmp_path / "start.txt", (site + 0.5) / 20)
    write_input(
        tmp_path,
        f"""&box boundary = 'periodic', 'wall' /
        &species count = 400 packing_fraction = {packing} mass = 2 mass_scaling = 'area' {where}
        polydispersity = {spread} radius_distribution = '{law}' /
        &species name = 'other' count = 9 relative_to = 'species1' radius = 0.5 polydispersity = 0.2
        temperature = 1 region = 0, 1, 0, 1 placement = 'dense' /
        &stop events = 3000 /""",
    )
    finished(ricochet, "whole.h5")
    assert ricochet("gas.nml", "-o", "gas.h5", "--set=stop.wall_clock=1e-9").returncode == STOPPED
    finished(ricochet, "gas.h5", "--resume")
    assert differences(tmp_path / "whole.h5", tmp_path / "gas.h5") == []
    run = read_run(tmp_path / "gas.h5")
    radius, mean = run.by_species[0].radii, run.parameters["species"]["species1"]["radius"]
    assert np.pi * np.sum(radius**2) == pytest.approx(packing)
    assert 1 < radius.max() / radius.min() < 10 and np.sum(radius == radius[0]) == 1
    assert radius.mean() == pytest.approx(mean, rel=4 * spread / 20)
    assert radius.std() == pytest.approx(mean * spread, rel=0.2)
    assert run.by_species[0].masses == pytest.approx(2 * (radius / mean) ** 2)
    assert (run.by_species[1].masses == 2).all()
    assert run.by_species[1].radius == pytest.approx(mean / 2, rel=0.3)
    apart = run.position[0][:, None] - run.position[0]
    apart[..., 0] -= np.round(apart[..., 0])
    gaps = np.hypot(*apart.T) - run.radius - run.radius[:, None] + np.eye(run.n_disks)
    assert gaps.min() > -1e-13
    finished(ricochet, "new.h5", "--set=run.seed=2")
    assert (read_run(tmp_path / "new.h5").radius != run.radius).all()


def test_maxwell_velocities_belong_to_the_mass_of_each_disk(ricochet, tmp_path):
    """Light and heavy disks have the same kT, which is exact on request."""
    x, y = np.divmod(np.arange(10000), 100)
    mass = np.where(x < 50, 1, 100)
    write_start(tmp_path / "bed.txt", np.stack([x, y], axis=1) + 0.5, radius=0.3, mass=mass)
    text = "&box upper = 100, 100 / &species file = 'bed.txt' temperature = 2 {} / &stop time = 0 /"
    for more, accuracy in [("", 0.1), ("exact_temperature = 2", 1e-12)]:
        write_input(tmp_path, text.format(more))
        finished(ricochet, "gas.h5", "--force")
        run = read_run(tmp_path / "gas.h5")
        energy = run.kinetic_energy(0)
        assert abs(energy[mass == 1].mean() - 2) < 0.1 and abs(energy[mass == 100].mean() - 2) < 0.1
        assert abs(run.observable("all/temperature").value[0] - 2) < accuracy


@pytest.mark.parametrize("name", ["bed.npy", "bed.npz"])
def test_arrays_of_numpy_are_told_what_they_need(ricochet, tmp_path, name):
    (np.save if name.endswith("y") else np.savez)(tmp_path / name, np.ones((3, 2)))
    write_input(tmp_path, f"&species file = '{name}' radius = 0.1 / &stop time = 1 /")
    run = ricochet("gas.nml")
    assert run.returncode == USAGE and "write_start" in one_line(run)


def put(file, name, disk, value):
    file[f"particles/disks/{name}/value"][-1, disk, 0] = value


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda file: file.__delitem__("particles/disks/radius"), "gas.h5: has no radius"),
        (lambda file: file["particles/disks/mass"].write_direct(np.zeros(120)), "0 is not a mass"),
        (lambda file: put(file, "position", 3, np.nan), "row 4 of the last frame: NaN is out of"),
        (lambda file: put(file, "position", 3, 99), "row 4 of the last frame: disk 4 at 99,"),
        (lambda file: put(file, "velocity", 7, -np.inf), "row 8 of the last frame: -Infinity is"),
        (lambda file: put(file, "velocity", 7, 1e101), "row 8 of the last frame: 1e101 is out of"),
    ],
)
def test_numbers_in_a_damaged_run_are_refused(ricochet, tmp_path, bed, damage, says):
    finished(ricochet, "gas.h5")
    with h5py.File(tmp_path / "gas.h5", "r+") as file:
        damage(file)
    write_input(tmp_path, INPUT.replace("bed.txt", "gas.h5"), "gas.nml")
    run = ricochet("gas.nml", "-o", "x.h5")
    assert run.returncode in (USAGE, FILES)
    assert all(says in line and "gas.h5" in line for line in run.stderr.splitlines())


def test_scripts_see_each_disk_and_refuse_laws_of_equal_ones(ricochet, tmp_path, bed, capsys):
    finished(ricochet, "gas.h5")
    run = read_run(tmp_path / "gas.h5")
    radii, own = radii_of(run)
    assert (radii[own] == by_species(bed)["radius"]).all()
    assert run_script("mixture", run.path, "-o", tmp_path / "mixture.png") == 1
    message = capsys.readouterr().err
    assert "the disks of 'bed' differ in mass or radius" in message
    mass = run.mass[:108]
    assert run.by_species[0].label == f"bed, m = {mass.min():g} to {mass.max():g}"


def test_arrays_in_files_of_numpy_become_starting_files(tmp_path):
    arrays = {"position": np.array([[0.1, 1 / 3]]), "mass": np.array([2]), "species": np.array([1])}
    np.savez(tmp_path / "a.npz", **arrays)
    path = write_start(tmp_path / "bed.txt", **np.load(tmp_path / "a.npz"))
    assert path.read_text() == f"x y mass species\n{0.1:.17g} {1 / 3:.17g} 2 1\n"
    np.save(tmp_path / "a.npy", arrays["position"])
    write_start(path, np.load(tmp_path / "a.npy"), radius=0.5)
    assert path.read_text() == f"x y radius\n{0.1:.17g} {1 / 3:.17g} 0.5\n"


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        ({"position": np.ones((2, 3))}, "position: of shape (2, 3), not (N, 2)"),
        ({"position": np.ones((0, 2))}, "position: of 0 disks, not of 1"),
        ({"position": [[1, np.inf]]}, "position: not all numbers are finite"),
        ({"position": [["a", "b"]]}, "position: not an array of real numbers"),
        ({"position": [[1, 2]], "velocity": np.ones((2, 2))}, "velocity: of 2 disks, not of 1"),
        ({"position": [[1, 2]], "radius": [0]}, "radius: not all numbers are above 0"),
        ({"position": [[1, 2]], "species": ["a", "b"]}, "species: of 2 disks, not of 1"),
        ({"position": [[1, 2]], "species": "big ones"}, "species: 'big ones' is neither a number"),
        ({"position": [[1, 2]], "species": [0]}, "species: '0' is neither a number from 1 nor"),
        ({"position": [[1, 2]], "species": "x" * 41}, "species: 'xxxx"),
    ],
)
def test_arrays_that_are_no_disks_are_refused(tmp_path, arrays, says):
    with pytest.raises(ValueError, match="^" + says.replace("(", r"\(").replace(")", r"\)")):
        write_start(tmp_path / "bed.txt", **arrays)
    assert not (tmp_path / "bed.txt").exists()


@pytest.mark.parametrize(
    ("velocities", "given"),
    [
        ("'maxwell' temperature = 1", {"orientation": 0.5}),
        ("'file'", {"velocity": (1.0, 0.5), "angular_velocity": 3.0}),
    ],
)
def test_a_run_goes_on_only_with_what_its_file_gave_the_disks(
    ricochet, tmp_path, velocities, given
):
    """The file must contain the same quantities as before."""
    write_input(
        tmp_path,
        f"""&species file = 'start.txt' count = 3 radius = 0.05 mass = 1 velocities = {velocities} /
        &box boundary = 'periodic', 'wall' /
        &stop events = 30 /""",
    )
    place = [(0.2, 0.2), (0.5, 0.5), (0.8, 0.7)]
    given = {name: np.broadcast_to(value, (3, *np.shape(value))) for name, value in given.items()}
    path = write_start(tmp_path / "start.txt", place, **given)
    finished(ricochet, "whole.h5")
    stop = ["--set", "stop.wall_clock=1e-9"]
    assert ricochet("gas.nml", "-o", "parts.h5", *stop).returncode == STOPPED
    path.rename(tmp_path / "kept.txt")
    for there in ((), [{"velocity": np.ones((3, 2))}]):
        for other in there:
            write_start(path, place, **other)
        for name, longer in {"parts.h5": [], "whole.h5": ["--set", "stop.events=60"]}.items():
            run = ricochet("gas.nml", "-o", name, "--resume", *longer)
            assert run.returncode == FILES and "species.file" in one_line(run), run.stderr
    (tmp_path / "kept.txt").replace(path)
    finished(ricochet, "parts.h5", "--resume")
    assert differences(tmp_path / "whole.h5", tmp_path / "parts.h5") == []
