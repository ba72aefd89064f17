"""p-values of speeds: uniform if the law is correct, tiny if it is wrong."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import kstest

from ricochet import speed_laws
from sampling import samples
from synthetic_run import written


def made(rng, count, frames, mass, periodic, keep, fixed):
    """Return velocities (F, N, 2) that obey the law, with the correlation `keep` between frames."""
    size = frames + 200, count, 2
    v = lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.normal(size=size), axis=0)[200:]
    v /= np.sqrt(mass)[:, None]
    v -= np.array(periodic) * np.average(v, axis=1, weights=mass)[:, None]
    if fixed:
        v /= np.sqrt(np.sum(mass[:, None] * v**2, axis=(1, 2)) / count)[:, None, None]
    return v


#: Number of disks, masses of the second half, periodic axes, memory, and whether energy is fixed.
SYSTEMS = {
    "few between sides": (5, 1, (False, False), 0.0, True),
    "few in a periodic box": (12, 1, (True, True), 0.0, True),
    "a strip": (40, 1, (True, False), 0.0, True),
    "a mixture in a periodic box": (20, 8, (True, True), 0.0, True),
    "at a fluctuating energy": (30, 1, (False, False), 0.0, False),
    "frames that remember": (100, 1, (False, False), 0.8, True),
}


@samples(12, 100)
@pytest.mark.parametrize("system", SYSTEMS)
def test_p_values_are_uniform_where_the_law_holds(tmp_path, rng, system, samples):
    count, heavy, periodic, keep, fixed = SYSTEMS[system]
    mass = np.where(np.arange(count) < count // 2, 1.0, heavy)
    kinds = {"mass": mass, "species": 1 + (mass > 1), "names": ("a", "b")[: 1 + (heavy > 1)]}
    sides = {"top": {"temperature": 1.0}} if not fixed else {}
    kinds["parameters"] = {f"side/{name}": own for name, own in sides.items()}
    frames, found = 40, []
    for k in range(samples):
        v = made(rng, count, frames, mass, periodic, keep, fixed)
        run = written(tmp_path / f"{k}.h5", 0 * v, v, periodic=periodic, **kinds)
        test = speed_laws.speed_test([run], [range(frames)], run.names[-1])
        assert test.law == ("fixed_energy" if fixed else "Maxwell")
        found.append((test.ks_p, test.chi2_p, test.independent / (run.species == 1).sum()))
    ks, chi2, free = np.transpose(found)
    assert kstest(ks, "uniform").pvalue > 1e-3 and kstest(chi2, "uniform").pvalue > 1e-3
    # Scaling removes the energies of frames; the next Laguerre polynomial decays as keep^4.
    least = frames * (1 - keep**4) / (1 + keep**4)
    assert 0.85 * least < np.mean(free) <= (0.95 if keep else 1) * frames


def test_a_wrong_law_has_a_tiny_p_value(tmp_path, rng):
    """Wrong laws are equal speeds, and a2 = 0.1 as in a gas with white-noise driving."""
    for law, most in (("equal", 1e-12), ("noisy", 1e-4)):
        tests = []
        for k in range(5):  # chance may reduce the number of independent speeds in one of them
            angle = rng.uniform(0, 2 * np.pi, (20, 500))
            v = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
            if law == "noisy":
                v = rng.normal(size=v.shape) * rng.gamma(10, 1 / 10, (20, 500, 1)) ** 0.5
            run = written(tmp_path / f"{law}{k}.h5", 0 * v, v)
            tests.append(speed_laws.speed_test([run], [range(20)], run.names[0]))
        assert np.median([test.ks_p for test in tests]) < most
        assert np.median([test.chi2_p for test in tests]) < 0.01
