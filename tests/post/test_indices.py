"""All functions accept the same kinds of index: integer, slice, list, tuple or array."""

import numpy as np
import pytest
from synthetic_run import written

from ricochet import structure

FRAMES = 6
EDGES = np.linspace(0.5, 3, 6)
#: Functions of a run and an index that return a row for each frame.
BY_FRAME = {
    "speed": lambda run, index: run.speed(index),
    "kinetic_energy": lambda run, index: run.kinetic_energy(index),
    "unwrapped": lambda run, index: run.unwrapped(index),
    "displacement": lambda run, index: run.displacement(index),
    "bond_order": structure.bond_order,
    "largest_cluster": lambda run, index: structure.largest_cluster(run, index, 0.05),
}
#: Functions of a run and an index that return a mean over the frames.
MEANS = {
    "pair_correlation": lambda run, index: structure.pair_correlation(run, index, EDGES),
    "structure_factor": lambda run, index: structure.structure_factor(run, index, 10 * EDGES),
    "bond_correlation": lambda run, index: structure.bond_correlation(
        run, index, np.atleast_2d(structure.bond_order(run, index)), EDGES
    ),
    "evenly": structure.evenly,
}


@pytest.fixture
def run(tmp_path, rng):
    place, image = rng.uniform(size=(FRAMES, 40, 2)), rng.integers(-2, 3, (FRAMES, 40, 2))
    more = {"image": image, "periodic": (True, True), "radius": 0.05}
    return written(tmp_path / "a.h5", place, rng.normal(size=place.shape), **more)


def kinds_of(numbers: list[int]) -> list:
    """Return the same frames as list, tuple and array and, if equally spaced, range and slice."""
    kinds = [numbers, tuple(numbers), np.array(numbers, dtype=int)]
    steps = np.unique(np.diff(numbers))
    if len(numbers) > 1 and len(steps) == 1 and steps[0] > 0 and numbers[0] >= 0:
        ends = numbers[0], numbers[-1] + 1, int(steps[0])
        kinds += [range(*ends), slice(*ends)]
    return kinds


@pytest.mark.parametrize("numbers", [[2], [-1], [1, 2, 3], [0, 2, 4], [3, 0, 5], [-1, 2], []])
@pytest.mark.parametrize("name", BY_FRAME)
def test_each_kind_of_index_chooses_the_same_frames(run, name, numbers):
    """Each row equals the result for a single frame."""
    rows = [BY_FRAME[name](run, number) for number in numbers]
    for kind in kinds_of(numbers):
        found = BY_FRAME[name](run, kind)
        assert len(found) == len(numbers)
        np.testing.assert_array_equal(found, np.reshape(rows, np.shape(found)))


@pytest.mark.parametrize("numbers", [[2], [1, 2, 3], [3, 0, 5], [-1, 2]])
@pytest.mark.parametrize("name", MEANS)
def test_each_kind_of_index_has_the_same_mean(run, name, numbers):
    first, *others = [MEANS[name](run, kind) for kind in kinds_of(numbers)]
    for other in others:
        np.testing.assert_array_equal(other, first)
    if len(numbers) == 1:
        np.testing.assert_array_equal(MEANS[name](run, numbers[0]), first)


def test_a_frame_that_is_not_there_is_refused(run):
    for function in (*BY_FRAME.values(), *MEANS.values()):
        with pytest.raises(IndexError):
            function(run, [0, FRAMES])
