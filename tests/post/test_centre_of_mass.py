"""Noise that accelerates the centre of mass does not affect results on the motion of the disks."""

import numpy as np
import pytest

from ricochet import correlations, equilibrium, fields, speeds
from ricochet.reading.nature import Refused

LOOSE = "drive.keep_momentum=.false."
#: Boxes and species of several kinds, for a few collisions per disk, before rounding errors grow.
GAS = """&run seed = {seed} / &box upper = 1, {height} boundary = 'periodic', '{y}'
shear_rate = {shear} /
&species count = {n} packing_fraction = {eta} temperature = 1 mass = 2 /
&species count = 9 radius = 0.01 temperature = 1 /
&contact restitution = {xi} /
&drive kind = 'noise' interval = 0.002 strength = {strength} /
&stop time = 0.1 / &output frames_every_time = 0.01 observables_every_time = 0.01 /"""


def drawn(rng, **given) -> str:
    """Return the input of a gas heated by noise."""
    values = {"seed": rng.integers(10**6), "height": rng.uniform(0.5, 2), "n": rng.integers(5, 40)}
    values |= {"eta": rng.uniform(0.01, 0.2), "strength": rng.uniform(1, 100), "y": "periodic"}
    return GAS.format(**values | {"xi": rng.choice([1.0, 0.9]), "shear": 0} | given)


@pytest.mark.parametrize("case", range(7))
def test_motion_is_relative_to_a_centre_of_mass_that_noise_moves(simulated, case):
    """Kicks with and without their mean cause the same relative motion (Galilean invariance)."""
    rng = np.random.default_rng(case)
    text = drawn(rng, shear=2.0 * (case == 6))
    held, loose = simulated(text, name="held"), simulated(text, LOOSE, name="loose")
    carried = [run.mass @ run.velocity[-1] for run in (held, loose)]
    assert "random_walk" in loose.nature and "random_walk" not in held.nature
    assert abs(carried[1][1]) > 1e3 * abs(carried[0][1])
    every = slice(None)
    for of in (speeds.kt_of_frames, speeds.reduced_speeds, equilibrium.thermal_energy):
        assert of(loose, every) == pytest.approx(of(held, every), rel=1e-6, abs=1e-6)
    kt = [fields.fields([run], None, (1, 1)).found["temperature"].mean for run in (held, loose)]
    assert kt[1] == pytest.approx(kt[0], rel=1e-5 if case < 6 else 0.1)
    if case < 6:
        both = [correlations.measured([run], skip=0)["all"] for run in (held, loose)]
        for name in ("msd", "vacf", "alpha2"):
            expected = both[0][name].y[1:]
            assert both[1][name].y[1:] == pytest.approx(expected, rel=1e-6, abs=1e-9), name


def test_what_cannot_be_measured_relative_to_it_is_refused(simulated, rng):
    loose = simulated(drawn(rng), LOOSE)
    for of in (loose.pressure, loose.pressure_tensor):
        with pytest.raises(Refused, match="keep_momentum"):
            of(0, 0.1)
    text = drawn(rng, y="wall", xi=0.9)
    with pytest.raises(Refused, match="walls may stop it"):
        speeds.kt_of_frames(simulated(text, LOOSE), [0])
    assert np.all(speeds.kt_of_frames(simulated(text), [0, -1]) > 0)


def test_smooth_walls_leave_the_centre_of_mass_free_along_them(simulated, rng):
    run = simulated(drawn(rng, y="wall", xi=1.0), LOOSE)
    v = run.velocity[-1] - [np.average(run.velocity[-1][:, 0], weights=run.mass), 0]
    energy = 0.5 * run.mass * np.sum(v**2, axis=1)
    assert equilibrium.thermal_energy(run, [-1])[0] == pytest.approx(energy)
