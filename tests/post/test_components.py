"""Temperatures by species and by component of the velocities."""

import numpy as np
import pytest

from ricochet import RunError, driven, fields, speeds
from synthetic_run import written

HEAT = {"light": (1.0, 3.0), "heavy": (2.0, 0.5)}  # kT_x and kT_y


@pytest.fixture
def uneven(tmp_path, rng):
    """Return a run of two species with different kT_x and kT_y, in which the heavy one flows."""
    mass = np.repeat([1.0, 5.0], [60, 40])
    heat = np.repeat([HEAT["light"], HEAT["heavy"]], [60, 40], axis=0)
    v = rng.normal(size=(400, 100, 2)) * np.sqrt(heat / mass[:, None])
    v[:, 60:, 0] += 0.7
    parts = {"mass": mass, "species": np.repeat([1, 2], [60, 40]), "names": tuple(HEAT)}
    return written(tmp_path / "run.h5", rng.uniform(size=v.shape), v, **parts)


def test_fields_and_speeds_have_them(uneven):
    for name, (along_x, along_y) in HEAT.items():
        own = fields.fields([uneven], None, (2, 2), name).found
        for field, law in (("kT_x", along_x), ("kT_y", along_y)):
            assert own[field].mean == pytest.approx(np.full(4, law), rel=0.1)
            assert np.all(own[field].error < 0.1 * law)
        assert own["temperature"].mean == pytest.approx((own["kT_x"].mean + own["kT_y"].mean) / 2)
        assert own["flow_x"].mean == pytest.approx(np.full(4, 0.7 * (name == "heavy")), abs=0.1)
        kt = speeds.kt_of_frames(uneven, slice(None), name, 1).mean()
        assert kt == pytest.approx(along_y, rel=0.05)
    both = [fields.fields([uneven], None, (2, 2), name).disks for name in HEAT]
    assert np.array_equal(sum(both), fields.fields([uneven], None, (2, 2)).disks)
    with pytest.raises(RunError, match="medium"):
        fields.fields([uneven], None, (2, 2), "medium")


def test_a_driven_mixture_has_those_of_each_species(simulated):
    text = """&box boundary = 'periodic', 'periodic' / &species name = 'a' count = 60 radius = .01 /
    &species name = 'b' count = 20 radius = .02 mass = 5 / &contact restitution = 0.7 /
    &drive kind = 'noise' interval = 0.01 strength = 1 keep_momentum = .true. / &stop time = 3 /
    &output observables_every_time = 0.1 frames_every_time = 0.1 /"""
    run = simulated(text)
    found = driven.temperature(run)
    assert list(found) == ["", "a", "b"]
    kt = speeds.kt_of_frames(run, slice(None))
    assert found[""][1] == pytest.approx(kt, rel=1e-9)
    for axis, (_, values) in enumerate(driven.components(run).values()):
        assert values == pytest.approx(speeds.kt_of_frames(run, slice(None), None, axis))
