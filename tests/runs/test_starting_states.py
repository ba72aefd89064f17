"""Initial states from files, with stretched boxes, compression, or an exact temperature."""

import math
import re

import h5py
import numpy as np
import pytest

from whole_runs import FINISHED, USAGE, one_line, write_input

PERIODIC = "&box boundary = 'periodic', 'periodic' upper = {size}, {size} /\n"
GAS = (
    PERIODIC.format(size=1)
    + """&species name = 'light' count = 150 radius = 0.02 velocities = 'maxwell' /
&species name = 'heavy' count = 50 mass = 4 radius = 0.02 velocities = 'maxwell' /
&stop collisions_per_disk = 5 /
"""
)
NEXT = """&species name = 'light' radius = {radius} file = 'gas.h5' {more} /
&species name = 'heavy' mass = 4 radius = {radius} file = 'gas.h5' {more} /
&stop time = 0 /
"""


@pytest.fixture
def onward(ricochet, tmp_path):
    """Return a function that starts a run from the last frame of a gas in a box of another size."""
    write_input(tmp_path, GAS)
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED

    def run(size, radius, more=""):
        write_input(
            tmp_path, PERIODIC.format(size=size) + NEXT.format(radius=radius, more=more), "next.nml"
        )
        return ricochet("next.nml", "-o", "next.h5", "--force")

    return run


def last_and_first(folder):
    """Return the final positions and velocities of a run, and the initial ones of the next run."""
    with h5py.File(folder / "gas.h5") as one, h5py.File(folder / "next.h5") as other:
        names = [f"particles/disks/{name}/value" for name in ("position", "velocity")]
        return [one[name][-1] for name in names], [other[name][0] for name in names]


def observable(path, name):
    with h5py.File(path) as file:
        return file[f"observables/{name}/value"][0]


@pytest.mark.parametrize("size", [1, 0.9, 1.3])
def test_disks_in_the_file_of_a_run_are_stretched_to_the_box_and_need_no_count(
    onward, tmp_path, size
):
    assert onward(size, 0.01, "scale_positions = .true.").returncode == FINISHED
    (x, v), (y, w) = last_and_first(tmp_path)
    assert np.allclose(y, size * x, rtol=1e-14) and (v == w).all()
    with h5py.File(tmp_path / "next.h5") as file:
        assert list(file["parameters/species/counts"]) == [150, 50]
        light = file["parameters/species/light"].attrs
        assert light["count"] == 150
        assert light["packing_fraction"] == pytest.approx(150 * math.pi * (0.01 / size) ** 2)


def test_disks_that_a_smaller_box_makes_overlap_are_named(onward):
    run = onward(0.8, 0.02, "scale_positions = .true.")
    assert run.returncode == USAGE
    lines = run.stderr.splitlines()
    assert all("species.file: gas.h5: " in line and "overlaps disk" in line for line in lines)
    assert all("of the last frame, stretched to this box: disk" in line for line in lines)
    run = onward(0.8, 0.01)  # not stretched
    assert run.returncode == USAGE and "is not wholly in its region" in run.stderr


def test_disks_grow_from_the_places_in_a_file(ricochet, tmp_path):
    """Disks are compressed from the positions in a file; in a crystal they keep their sites."""
    box = "&box boundary = 'periodic', 'periodic' upper = {!r}, {!r} /\n"
    edges = np.array([10, 5 * math.sqrt(3)])
    light = "&species name = 'light' count = 100 packing_fraction = 0.75 placement = 'lattice'"
    light += " temperature = 1 / &stop collisions_per_disk = 20 /"
    write_input(tmp_path, box.format(*map(float, edges)) + light)
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    edges, radius = 2 * edges, math.sqrt(0.84 * 4 * np.prod(edges) / (100 * math.pi))
    grown = "&species name = 'light' file = 'gas.h5' placement = 'grown' scale_positions = .true."
    grown += f" radius = {radius} / &stop time = 0 /"
    write_input(tmp_path, box.format(*map(float, edges)) + grown, "next.nml")
    assert ricochet("next.nml", "-o", "next.h5").returncode == FINISHED
    (x, v), (y, w) = last_and_first(tmp_path)
    assert (v == w).all()
    moved = nearest(y - 2 * x, edges)
    assert np.hypot(*nearest(moved - np.median(moved, axis=0), edges).T).max() < 1  # half a spacing
    apart = np.hypot(*nearest(y[:, None] - y, edges).T)
    assert (apart + 9 * np.eye(100)).min() > 2 * radius * (1 - 1e-12)


def nearest(vector, edges):
    """Return the displacements to the nearest periodic images."""
    return vector - np.round(vector / edges) * edges


def test_what_cannot_grow_is_told(onward):
    run = onward(1, 0.0376, "placement = 'grown'")
    assert run.returncode == USAGE and "of the wanted packing 0.88" in one_line(run)


def test_a_temperature_is_exact_if_wanted(onward, tmp_path):
    """The temperature is exact for velocities from a file and for random velocities."""
    for more in ("", "velocities = 'maxwell'"):
        assert onward(1, 0.02, f"exact_temperature = 0.01 {more}").returncode == FINISHED
        for name in ("light", "heavy"):
            found = observable(tmp_path / "next.h5", f"{name}/temperature")
            assert found == pytest.approx(0.01, rel=1e-13)
        assert np.allclose(observable(tmp_path / "next.h5", "momentum"), 0, atol=1e-12)
    run = onward(1, 0.02, "exact_temperature = 1 velocities = 'rest'")
    assert run.returncode == USAGE
    assert run.stderr.count("species.exact_temperature: the disks do not move relative") == 2


@pytest.mark.parametrize(("packing", "fits"), [(0.90685, True), (0.90689, True), (0.90691, False)])
def test_a_crystal_may_be_as_dense_as_disks_can_be(ricochet, tmp_path, packing, fits):
    box = f"&box boundary = 'periodic', 'periodic' upper = 10, {5 * math.sqrt(3)!r} /\n"
    species = f"&species count = 100 placement = 'lattice' packing_fraction = {packing} /\n"
    write_input(tmp_path, box + species + "&stop time = 0 /\n")
    run = ricochet("gas.nml", "-o", "gas.h5")
    assert run.returncode == (FINISHED if fits else USAGE)
    assert fits or "the closest packing is 0.9069" in one_line(run)


def test_a_single_disk_may_be_half_as_wide_as_a_period(ricochet, tmp_path):
    box = "&box boundary = 'periodic', 'wall' upper = 0.3, 1 /\n"
    write_input(
        tmp_path, box + "&species count = 1 radius = 0.1 velocity = 0.7, 1 / &stop time = 8.1 /"
    )
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    assert observable(tmp_path / "gas.h5", "total_energy") == pytest.approx(0.745)
    with h5py.File(tmp_path / "gas.h5") as file:
        x, image = (file[f"particles/disks/{name}/value"] for name in ("position", "image"))
        way = x[-1, 0] + image[-1, 0] * [0.3, 1] - x[0, 0]
    assert way[0] == pytest.approx(0.7 * 8.1, rel=1e-12)
    run = ricochet("gas.nml", "-o", "x.h5", "--set", "species.species1.radius=0.16")
    assert run.returncode == USAGE and "one diameter" in one_line(run)


@pytest.mark.parametrize("loss", ["restitution = 0.5", "tangential_restitution = 0"])
def test_a_gas_that_has_cooled_down_says_so_in_its_file(ricochet, tmp_path, loss):
    text = GAS.replace("&stop collisions_per_disk = 5", f"&contact {loss} / &stop time = 1e90")
    write_input(
        tmp_path, text.replace("count = 150", "count = 2").replace("count = 50", "count = 2")
    )
    run = ricochet("gas.nml", "-o", "gas.h5", "--quiet")
    assert run.returncode == FINISHED
    with h5py.File(tmp_path / "gas.h5") as file:
        note = file["provenance"].attrs["note"].decode()
    assert note and f"note = {note}\n" in run.stdout


RELAXED = """&box boundary = 'periodic', 'wall' /
&species name = 'small' count = 150 radius = 0.02 relaxation_sweeps = {sweeps}{more} /
&species name = 'large' count = 150 radius = 0.026 placement = 'relaxed' temperature = 1 /
&stop collisions_per_disk = 3 /
"""


def relaxed(sweeps: int, more: str = " temperature = 1") -> str:
    return RELAXED.format(sweeps=sweeps, more=more)


def test_check_leaves_the_relaxation_out(ricochet, tmp_path):
    """With 10**9 sweeps the placement would take years; an impossible packing is still refused."""
    write_input(tmp_path, relaxed(10**9))
    run = ricochet("gas.nml", "--check")
    assert run.returncode == FINISHED and "valid; 300 disks" in run.stdout
    run = ricochet("gas.nml", "--check", "--set", "species.large.radius=0.04")
    assert run.returncode == USAGE and "fill at most 0.9" in one_line(run)


def test_a_relaxation_is_reported_with_the_swaps_of_different_radii(ricochet, tmp_path):
    write_input(tmp_path, relaxed(20))
    said = ricochet("gas.nml", "-o", "gas.h5").stderr
    found = re.search(r"the packing was relaxed: 20 sweeps, (\d+) of (\d+) swaps of differ", said)
    accepted, tried = map(int, found.groups())
    assert 0 < accepted < tried < 20 * 300 and tried > 20 * 300 / 3
    assert ricochet("gas.nml", "-o", "gas.h5", "--force", "--quiet").stderr == ""
    write_input(tmp_path, relaxed(7).replace("0.026", "0.02"))
    said = ricochet("gas.nml", "-o", "gas.h5", "--force").stderr
    assert said.startswith("the packing was relaxed: 7 sweeps\n")


def test_twenty_sweeps_move_most_disks_by_a_diameter(ricochet, tmp_path):
    places = {}
    for sweeps in (0, 20):
        write_input(tmp_path, relaxed(sweeps))
        assert ricochet("gas.nml", "-o", "gas.h5", "--force").returncode == FINISHED
        with h5py.File(tmp_path / "gas.h5") as file:
            places[sweeps] = file["particles/disks/position/value"][0]
    steps = places[20] - places[0]
    steps[:, 0] -= np.rint(steps[:, 0])
    assert np.median(np.hypot(*steps.T)) > 0.04


def test_a_relaxed_start_that_is_too_dense_is_told(ricochet, tmp_path):
    write_input(tmp_path, relaxed(5))
    run = ricochet("gas.nml", "-o", "gas.h5", "--set", "species.large.radius=0.0385")
    assert run.returncode == USAGE
    assert "in steps: placement = 'grown'" in one_line(run)


def test_disks_of_many_sizes_are_not_crushed_before_their_area_is_reached(ricochet, tmp_path):
    """The largest radius is not used for all disks."""
    text = "&species count = 200 packing_fraction = {} polydispersity = 0.4 /\n&stop time = 1 /\n"
    text += "&side name = 'left' motion = 'constant_velocity' velocity = 0.5 end_time = 1 /\n"
    for packing, answer in ((0.45, "valid"), (0.52, "would crush the disks, which need at least")):
        (tmp_path / "gas.nml").write_text(text.format(packing))
        run = ricochet("gas.nml", "--check")
        assert answer in run.stdout + run.stderr
