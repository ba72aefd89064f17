"""Cooling gases: laws of Haff for hard and soft disks, structure, and the script haff."""

import numpy as np
import pytest

from ricochet import cooling as cool, equilibrium, hard_disks as hd, read_run, thermodynamics as td
from ricochet.reading.reader import Restitution
from synthetic_run import drawn


def test_a_gas_that_cools_has_a_structure_and_free_paths_and_haffs_law(bulk, tmp_path, capsys):
    """Diffusion coefficient, pressure and equation of state are not defined."""
    rows = drawn(tmp_path, "correlations", bulk[2])
    assert "no steady state without flow: time correlations" in capsys.readouterr().err
    assert {row["what"] for row in rows} == {"psi6_local", "psi6_global", "a2", "g", "g6", "S"}
    run = read_run(bulk[2])
    assert run.collisions_per_disk_at(run.time[equilibrium.later(run).start]) > 14
    rows = {row["quantity"]: row["mean"] for row in drawn(tmp_path, "rates", bulk[2])}
    assert not any(name.startswith("pressure") for name in rows)
    eta, diameter = td.packing(run), 2 * run.radius[0]
    density = (run.n_disks - 1) / np.prod(run.edges)
    contact = (hd.simulated(eta) - 1) / (2 * eta)  # paths do not depend on the speed
    enskog = 1 / (2 * np.sqrt(2) * density * diameter * contact)
    assert float(rows["mean_free_path"]) == pytest.approx(enskog, rel=0.1)
    found, rate, *_ = cool.haff([cool.energy_left(run)], 0.9)
    for y, law in (("K_by_time", "haff"), ("K", "law")):
        early = found[law] > 0.1
        np.testing.assert_allclose(found[y].mean[early], found[law][early], rtol=0.2)
    assert np.isnan(rate.error), "of a single run"
    drawn(tmp_path, "haff", bulk[2])
    drawn(tmp_path, "equation_of_state", *bulk[:2])


def test_the_first_rate_is_counted_where_no_equation_of_state_is_known(bulk, simulated, tmp_path):
    """Both methods agree for equal disks; a gas of two sizes cools by the same laws."""
    run = read_run(bulk[2])
    assert cool.counted_rate(run) == pytest.approx(cool.first_rate(run), rel=0.1)
    two = simulated(
        """&box boundary = 'periodic', 'periodic' / &contact restitution = 0.9 /
        &species name = 'small' count = 400 radius = 0.005 temperature = 1 /
        &species name = 'large' count = 400 radius = 0.008 temperature = 1 /
        &stop collisions_per_disk = 15 /
        &output observables_every_collisions_per_disk = 0.1 /""",
        name="two",
    )
    w0_t, tau, left = cool.energy_left(two)
    np.testing.assert_allclose(left, hd.haff_by_collisions(tau, 0.9), rtol=0.1)
    np.testing.assert_allclose(left, hd.haff_by_time(w0_t, 0.9), rtol=0.15)
    drawn(tmp_path, "haff", two.path)


@pytest.mark.parametrize("law", ["power", "viscoelastic"])
def test_soft_disks_cool_by_a_law_of_their_own(simulated, tmp_path, law):
    """K decreases as t^(-5/3) at late times; if all speeds exceed g0, it follows Haff's law."""
    hard = hd.haff_soft(Restitution(0.7, law, 1e-9), 1.0)
    np.testing.assert_allclose(hard[2][:99], hd.haff_by_time(hard[0][:99], 0.7), rtol=1e-3)
    soft = hd.haff_soft(Restitution(0.7, law, 10.0), 1.0)
    assert cool.exponent(soft[0], soft[2]) == pytest.approx(5 / 3, abs=0.01)
    run = simulated(
        f"""&box boundary = 'periodic', 'periodic' /
        &contact restitution = 0.8 restitution_law = '{law}' reference_speed = 10 /
        &species count = 400 packing_fraction = 0.05 temperature = 1 /
        &stop collisions_per_disk = 40 /
        &output observables_per_decade = 20 decades_from = 0.01 /""",
        name=law,
    )
    curves, *_ = cool.haff([cool.energy_left(run)], 0.8, cool.soft_law([run]))
    np.testing.assert_allclose(curves["K_by_time"].mean, curves["haff"], rtol=0.15)
    assert "soft_contacts" in run.nature and np.isnan(run.restitution)
    (row,) = (row for row in drawn(tmp_path, "haff", run.path)[:1])
    assert any("below 10" in name for name in row)
