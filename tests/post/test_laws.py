"""Theoretical results of the package, compared with series, equations and samples."""

import numpy as np
import pytest

from ricochet import hard_disks as hd, mixtures, theory
from ricochet.predictions.theory import path_density
from ricochet.mixtures import cooling_ratio
from validation.laws import mixture_rates


def test_equation_of_state_has_the_virial_coefficients_and_goes_through_its_points():
    eta = 1e-4
    assert (hd.henderson(eta) - 1) / eta == pytest.approx(2, rel=1e-3)
    reduced = [1, 1, 0.78200444, 0.53223180, 0.33355604, 0.1988425, 0.1148728, 0.0649930, 0.0362193]
    virial = [b * 2**k for k, b in enumerate(reduced)]
    for eta in (0.075, 0.125, 0.175):
        series = np.polyval(virial[::-1], eta)
        assert float(hd.simulated(eta)) == pytest.approx(series, rel=2e-5)
    np.testing.assert_allclose(hd.simulated(hd.FLUID[:, 0]), hd.FLUID[:, 1])
    np.testing.assert_allclose(hd.simulated(hd.FREEZING[:, 0]), hd.FREEZING[:, 1])
    dense = np.linspace(0.6, 0.698, 99)  # one curve up to freezing, with a kink where it starts
    slope = np.gradient(dense * hd.simulated(dense), dense)
    assert np.all(slope > 0) and np.abs(np.diff(slope)).max() < 0.1 * slope.max()
    assert np.isnan(hd.published(0.69, 1000, True))
    assert hd.crystal(0.8) - hd.crystal(0.8, 100) == pytest.approx((hd.crystal(0.8) - 1) / 100)
    assert np.isnan(hd.simulated(0.7)) and hd.simulated_finite(0.1, 100) < hd.simulated(0.1)


def test_published_pressures_are_those_of_the_number_of_disks():
    """The reference is the 1/N correction of thermodynamics, from Henderson's equation."""
    eta, step = np.append(np.arange(1, 13) / 20, 0.647), 1e-3

    def slope(x):
        return np.diff([y * hd.henderson(y) for y in (x - step, x + step)], axis=0)[0]

    shift = -eta / (4 * step) * np.log(slope(eta + step) / slope(eta - step))
    for count in (100, 1024):
        finite, infinite = ([hd.published(x, count, one) for x in eta] for one in (True, False))
        found = count * np.subtract(finite, infinite)
        np.testing.assert_allclose(found, shift, rtol=0.06)
        np.testing.assert_allclose(found[:8], shift[:8], rtol=0.01)


def test_adiabats_are_those_of_the_room_for_centres_and_of_the_equation_of_state():
    widths, thin = np.array([2, 1.3, 0.9]), 1e-3  # number of disks, as a real number
    room = (widths[0] - 0.1) / (widths - 0.1)
    assert hd.adiabat(widths, 1.0, thin, 0.05, True) == pytest.approx(room, rel=1e-4)
    for count in (1, 3, 50):  # degrees of freedom that share the work
        lone = (widths[0] / widths) ** (count / (count - 0.5))
        assert hd.adiabat(widths, 1.0, count, 1e-5, False) == pytest.approx(lone, rel=1e-4)
    dense, radius = hd.adiabat(widths, 1.0, 10**8, 4e-5, True), 4e-5
    eta = 10**8 * np.pi * radius**2 / widths
    rate = np.diff(np.log(dense)) / np.diff(np.log(widths))
    assert np.all(-rate > hd.simulated(eta[:-1])) and np.all(-rate < hd.simulated(eta[1:]))
    assert np.isnan(hd.adiabat(np.array([1, 0.5]), 1.0, 10**8, 4e-5, True)[1])


def test_published_pressures_near_melting_have_a_loop_that_flattens():
    depth = {}
    for name, points in hd.MELTING.items():
        eta, p = np.transpose(points)
        assert np.all(np.diff(eta) > 0) and p.min() > 9.15 and p.max() < 9.25
        depth[name] = p[:-1].max() - p[(eta > 0.702) & (eta < 0.718)].min()
    assert list(depth.values()) == sorted(depth.values(), reverse=True)


def test_rates_of_a_mixture_of_equals_are_those_of_one_gas():
    diameter, count = 0.02, 1000
    eta = count * np.pi * diameter**2 / 4
    w = mixture_rates([diameter, diameter], [300, 700], [1.0, 1.0])
    one = hd.collision_rate(hd.simulated(eta), diameter, 10**8)
    np.testing.assert_allclose(w.sum(axis=1), one, rtol=1e-6)
    np.testing.assert_allclose(w[:, 1] / w[:, 0], 7 / 3)
    unequal = mixture_rates([0.02, 0.04], [300, 200], [1.0, 4.0])
    assert 300 * unequal[0, 1] == pytest.approx(200 * unequal[1, 0])


def test_the_pressure_of_many_sizes_is_that_of_their_contacts():
    """Z = 1 + pi / 2 n sum x_i x_j s_ij^2 chi_ij, and equal disks are the correct limit."""
    s, n = np.array([0.01, 0.02, 0.04]), np.array([300, 200, 50])
    eta, pair = np.pi / 4 * n @ s**2, (s[:, None] + s) / 2
    chi = mixtures.contact_values(hd.simulated(eta), n, s)
    z = 1 + np.pi / 2 * n @ (pair**2 * chi) @ n / n.sum()
    alike = (n @ s) ** 2 / (n @ s**2) / n.sum()
    assert z == pytest.approx(hd.of_sizes(hd.simulated(eta), eta, alike))
    assert hd.of_sizes(hd.simulated(eta), eta, 1) == hd.simulated(eta)


def test_laws_of_cooling_agree_at_first_and_equal_masses_cool_alike():
    assert hd.haff_by_time(0.01, 0.9) == pytest.approx(hd.haff_by_collisions(0.01, 0.9), rel=1e-4)
    assert hd.haff_by_time(5.0, 1.0) == hd.haff_by_collisions(5.0, 1.0) == 1
    assert cooling_ratio(1, 0.7) == pytest.approx(1) == cooling_ratio(4, 1.0)
    assert cooling_ratio(4, 0.8) > cooling_ratio(4, 0.9) > 1
    assert cooling_ratio(0.25, 0.8) == pytest.approx(1 / cooling_ratio(4, 0.8))


def test_rough_temperatures_follow_their_equations():
    xi, beta, q = 0.9, 0.3, 0.5
    tau = np.linspace(0, 5, 5001)
    t, r = theory.rough_temperatures(tau, (1.0, 0.2), xi, beta, q)
    a, b, c = theory.rough_rates(xi, beta, q)
    assert np.gradient(t, tau)[1:-1] == pytest.approx((-2 * (a * t - b * r))[1:-1], abs=1e-6)
    assert np.gradient(r, tau)[1:-1] == pytest.approx((4 * (b * t - c * r))[1:-1], abs=1e-6)
    late = theory.rough_temperatures(np.array([50.0]), (1.0, 0.2), xi, beta, q)
    assert late[1] / late[0] == pytest.approx(theory.rough_ratio(xi, beta, q))


def test_free_paths_without_memory_have_the_mean_one():
    x = np.linspace(0, 40, 20001)
    density = path_density(x)
    assert np.trapezoid(density, x) == pytest.approx(1, rel=1e-3)
    assert np.trapezoid(x * density, x) == pytest.approx(1, rel=1e-3)


def test_a_mixture_flows_as_one_gas_if_its_disks_are_equal_and_however_its_species_are_cut():
    """Results scale with the units; stress of few heavy disks decays twice as fast as velocity."""
    eta, z, names = 0.3, float(hd.henderson(0.3)), ("viscosity", "bulk_viscosity")
    n, size, mass = 4 * eta / np.pi * np.array([0.2, 0.3, 0.5]), np.ones(3), np.ones(3)
    equal, one = mixtures.enskog_mixture(z, n, size, mass), hd.enskog(z, eta, 1.0)
    assert [equal[name] for name in names] == pytest.approx([one[name] for name in names], rel=1e-5)
    assert equal["memory"] * hd.collision_rate(z, 1.0, 1e6) == pytest.approx(1, rel=1e-5)
    size, mass, n = np.array([1.0, 2.0, 1.0]), np.array([1.0, 9.0, 1.0]), n / 3
    cut = mixtures.enskog_mixture(z, n, size, mass)
    whole = mixtures.enskog_mixture(z, np.array([n[0] + n[2], n[1]]), size[:2], mass[:2])
    other = mixtures.enskog_mixture(z, n / 4, 2 * size, 3 * mass, 5.0)
    for name in names:
        assert cut[name] == pytest.approx(whole[name])
        assert other[name] == pytest.approx(np.sqrt(3 * 5) / 2 * cut[name])
    assert other["memory"] == pytest.approx(2 * np.sqrt(3 / 5) * cut["memory"])
    np.testing.assert_allclose(mixtures.self_diffusion(z, n, np.ones(3), np.ones(3)), one["D"])
    pair = mixtures.self_diffusion(z, np.array([n.sum(), 0]), size[:2], mass[:2])
    chi = mixtures.contact_values(z, np.array([n.sum(), 0]), size[:2])[0, 1]
    friction = 2 * n.sum() * 1.5 * chi * np.sqrt(2 * np.pi * 0.9)  # of a disk of mass 9
    assert pair[1] == pytest.approx(1 / friction)
    few, mass = eta * np.array([1, 1e-5]), np.array([1.0, 1e5])
    alone, heavy = (
        mixtures.enskog_mixture(z, few[:k], np.ones(k), mass[:k])["viscosity"] for k in (1, 2)
    )
    rate = 2 * np.sqrt(2 * np.pi) * eta * hd.contact_value(z, np.pi / 4 * eta) / mass[1]
    assert heavy - alone == pytest.approx(1.022 * few[1] / (2 * rate), rel=0.01)


@pytest.mark.parametrize("eta", [0.001, 0.2])
def test_at_the_temperature_of_noise_heating_is_what_collisions_take(eta):
    strength, xi, diameter, mass = 0.3, 0.8, 0.7, 2.0
    kt = hd.noise_temperature(strength, xi, eta, diameter, mass)
    rate = hd.collision_rate(hd.henderson(eta), diameter, 1e6, kt, mass)
    assert mass * strength == pytest.approx((1 - xi**2) / 2 * rate * kt, rel=1e-5)


def test_chambers_are_even_above_the_threshold_and_as_the_fluxes_say_below():
    xi, layers = 0.9, 3.0

    def heat_over_climb(share, climb):
        """Return T / m g h of a chamber with this fraction of the disks."""
        return (2 / (share * layers * np.sqrt(np.pi) * (1 - xi**2))) ** 2 / climb

    threshold = heat_over_climb(0.5, 1.0)
    assert theory.demon_share(0.99 * threshold, layers, xi) == 0.5
    climb = 1.5 * threshold
    share = theory.demon_share(climb, layers, xi)
    flux = [s**2 * np.exp(-1 / heat_over_climb(s, climb)) for s in (share, 1 - share)]
    assert share > 0.6 and flux[0] == pytest.approx(flux[1])
    assert theory.demon_share(100 * threshold, layers, xi) == pytest.approx(1)
    assert theory.demon_share(1.001 * threshold, layers, xi) == pytest.approx(0.5, abs=0.05)
