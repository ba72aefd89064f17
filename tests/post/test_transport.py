"""Transport coefficients from Helfand moments, and the script transport."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from ricochet.reports.equilibrium import transport as transport_script
from ricochet.reports.groups import Group
from ricochet.reports.result import Result
from gas_inputs import GAS, UNLIKE, USUAL
from ricochet import (
    RunError,
    driven,
    estimates,
    hard_disks as hd,
    thermodynamics as td,
    transport as tp,
    write_start,
)
from sampling import STATISTICS, held_as_often_as_stated, samples
from synthetic_run import drawn


def carried(v, mass):
    """Return the kinetic fluxes (5,) for velocities (N, 2): momentum xx, xy, yy, energy x, y."""
    energy = mass * np.sum(v**2, axis=1) / 2
    products = np.array([v[:, 0] ** 2, v[:, 0] * v[:, 1], v[:, 1] ** 2])
    return np.array([*(products @ mass), *(energy @ v)])


def test_moments_are_those_of_the_definition(gas):
    """With a frame at each event, positions and velocities determine all fluxes and transfers."""
    every = "frames_every_events = 1 observables_every_events = 1"
    run = gas(count=10, packing=UNLIKE.format(1, 5), length=40, restitution=0.9, cadence=every)
    x, v, m, time = run.position[:], run.velocity[:], run.mass, run.time
    flown, handed = [np.zeros(5)], [np.zeros(5)]
    for k in range(run.n_frames - 1):
        flown.append((time[k + 1] - time[k]) * carried(v[k], m))
        changed = np.flatnonzero(np.any(v[k + 1] != v[k], axis=1))
        handed.append(np.zeros(5))
        if len(changed) == 0:
            continue
        i, j = changed
        r = x[k + 1, i] - x[k + 1, j]
        r -= run.edges * np.round(r / run.edges)
        dp = m[i] * (v[k + 1, i] - v[k, i])
        gain = m * (np.sum(v[k + 1] ** 2, axis=1) - np.sum(v[k] ** 2, axis=1)) / 2
        handed[-1] = [dp[0] * r[0], dp[0] * r[1], dp[1] * r[1], *((gain[i] - gain[j]) / 2 * r)]
    for parts, (stress, heat) in ((flown, tp.SUMS[::2]), (handed, tp.SUMS[1::2])):
        expected = np.cumsum(parts, axis=0)
        found = run.observable(stress).value, run.observable(heat).value
        found = np.concatenate([found[0][:, [0, 1, 3]], found[1]], axis=1)
        np.testing.assert_allclose(found, expected, atol=1e-9 * np.ptp(expected))
    now = [carried(one, m)[[0, 1, 1, 2]] for one in v]
    np.testing.assert_allclose(run.observable("kinetic_tensor").value, now, rtol=1e-12, atol=1e-12)


def test_all_that_changes_velocities_counts_in_what_is_carried(gas):
    """With driving, moving and thermal walls and dissipation, the moment integrates the flux."""
    driven = {
        "sides": "'wall', 'periodic' / &side name = 'left' temperature = 3 / "
        "&side name = 'right' motion = 'sine' amplitude = 0.02 period = 0.1 / "
        "&drive kind = 'brownian' interval = 0.07 temperature = 1",
        "restitution": 0.8,
        "cadence": "observables_every_time = 0.001",
    }
    run = gas(length=60, **driven)
    now, sums = (run.observable(name).value for name in ("kinetic_tensor", "helfand_stress"))
    steps = 0.001 * (now[1:-1] + now[:-2]) / 2
    np.testing.assert_allclose(sums[-2], steps.sum(axis=0), atol=0.01 * sums[-2].max())


def test_moments_do_not_know_that_the_gas_moves(gas, simulated, tmp_path):
    """Second differences have no mean growth, until rounding errors separate the two runs."""
    still = gas(length=100)
    start = write_start(tmp_path / "fast.txt", still.position[0], still.velocity[0] + [0.5, 0.25])
    text = GAS.format(**USUAL | {"length": 100}).replace("temperature = 2", f"file = '{start}'")
    moments = [tp.moments(run, 0.0)[1] for run in (still, simulated(text, name="fast"))]
    for name in tp.MOMENTS:
        own, other = (np.diff(one[name][:15], 2, axis=0) for one in moments)
        np.testing.assert_allclose(own, other, atol=1e-8 * np.ptp(own))


def fluctuating(rng, count, memory):
    """Return moments (count, 2) of fluxes with the autocorrelation exp(-t / memory)."""
    keep = np.exp(-1 / memory)
    noise = rng.normal(0, np.sqrt(1 - keep**2), (count + 500, 2))
    moment = np.cumsum(lfilter([1], [1, -keep], noise, axis=0)[500:] + 0.3, axis=0)
    return moment - np.linspace(moment[0], moment[-1], len(moment))


@samples(30, 300)
def test_fluxes_that_forget_have_the_coefficient_and_the_errors_they_should(samples):
    """The coefficient is the integral of the autocorrelation; correct errors contain it in 68 %."""
    rng, keep = np.random.default_rng(4), np.exp(-1 / 6)
    truth = (1 + keep) / (1 - keep) / 2
    found = [tp.coefficient(fluctuating(rng, 6000, 6.0), 1.0, 100) for _ in range(samples)]
    mean, error = np.array([(one.mean, one.error) for one in found]).T
    assert mean.mean() == pytest.approx(truth, abs=4 * mean.std() / np.sqrt(samples))
    held = np.abs(mean - truth) < error
    if samples < 300:
        assert held_as_often_as_stated(held)
    else:
        assert np.mean(held) == pytest.approx(2 * estimates.ONE_SIGMA - 1, abs=0.1)


@STATISTICS
def test_errors_of_coefficients_of_short_runs_are_their_scatter():
    """This takes 1200 short series; a tenth of them would not reveal an error of 10 %."""
    rng, keep = np.random.default_rng(4), np.exp(-1 / 6)
    truth = (1 + keep) / (1 - keep) / 2
    few = [tp.coefficient(fluctuating(rng, 1400, 6.0), 1.0, 100) for _ in range(1200)]
    mean, error = np.array([(one.mean, one.error) for one in few]).T
    assert np.mean(np.abs(mean - truth) < error) == pytest.approx(0.68, abs=0.03)
    assert np.mean(error) == pytest.approx(np.std(mean), rel=0.08)


def test_the_running_coefficient_grows_from_the_mean_square_to_the_integral():
    keep = np.exp(-1 / 6)
    truth = (1 + keep) / (1 - keep) / 2
    slopes = tp.running(fluctuating(np.random.default_rng(5), 400000, 6.0), 0.5, [1, 40, 80])
    assert slopes[0] == pytest.approx(1, rel=0.02)  # <flux^2> step / 2
    assert slopes[-1] == pytest.approx(2 * truth, rel=0.05)


def test_squares_allow_for_the_mean_growth_that_is_taken_away():
    """The mean square of a random walk is its number of steps, whatever the mean step."""
    moment = np.cumsum(np.random.default_rng(6).normal(2.0, 1.0, (41, 4000)), axis=0)
    moment -= np.linspace(moment[0], moment[-1], 41)
    assert tp.squares(moment, 20).mean() == pytest.approx(20, rel=0.05)


@pytest.mark.parametrize("packings", [(0.3,), (0.1, 0.3, 0.5)])
def test_neither_points_nor_the_legend_cover_other_points(monkeypatch, packings):
    """All coefficients have the same values and errors."""
    names = ("viscosity", "conductivity", "bulk_viscosity", "D")
    own = {"ratio": 1.0, "ratio_error": 0.05}
    rows = [{"what": name, "packing": eta, **own} for eta in packings for name in names]
    curve = estimates.Curve(*np.ones((3, 5)))
    found = {name: SimpleNamespace(curve=curve) for name in names}
    groups = [Group(eta, [], found) for eta in packings]
    monkeypatch.setattr(transport_script, "caption", lambda runs: "")
    figure = transport_script.draw(Result(rows, groups)).figure()
    figure.draw_without_rendering()
    (axes,) = (one for one in figure.axes if "packing" in one.get_xlabel())
    at = np.sort(np.concatenate([part[0].get_xdata() for part in axes.containers]))
    assert len(at) == 4 * len(packings)
    assert np.diff(axes.transData.transform(np.stack([at, at], axis=1))[:, 0]).min() > 2
    top = axes.transData.transform((0, 1.05))[1]
    assert axes.get_legend().get_window_extent().y0 > top


def test_coefficients_are_drawn_with_their_numbers_and_doubted(gas, tmp_path, capsys):
    runs = [gas(f"gas{k}", packing=packing).path for k, packing in enumerate((0.1, 0.3))]
    rows = drawn(tmp_path, "transport", *runs)
    means = [row for row in rows if not row["wt"]]
    coefficients = {(name, eta) for name in hd.enskog(1.5, 0.1, 1.0) for eta in (0.1, 0.3)}
    assert {(row["what"], float(row["packing"])) for row in means} == coefficients
    assert all(float(row["error"]) > 0 for row in means)
    assert all(float(row["wt"]) > 0 for row in rows if row["what"].endswith("(t)"))
    printed, said = capsys.readouterr()
    assert "before it has settled" not in said and "sigma*sqrt(kT/m)" in printed
    drawn(tmp_path, "transport", gas(length=20).path)
    assert "before it has settled" in capsys.readouterr().err


def test_runs_of_one_cadence_are_taken_together_however_warm_they_are(gas):
    runs = [gas(f"gas{seed}", seed=seed, length=60) for seed in range(1, 7)]
    paths = [td.mean_free_time(run) for run in runs]
    assert np.ptp(paths) > 0.15 * np.mean(paths)
    found = tp.coefficients(runs)["viscosity"]
    assert len(found.members) == 6
    with pytest.raises(RunError, match="different sampling interval"):
        tp.coefficients([runs[0], gas("rare", length=60, cadence="observables_every_time = 0.04")])


def test_of_a_mixture_there_are_the_viscosities(gas, tmp_path, capsys):
    """Nearly equal disks have the viscosities of equal ones; different runs are refused."""
    mixed = gas("mixed", packing=UNLIKE.format(0.1, 9))
    rows = drawn(tmp_path, "transport", mixed.path)
    assert {row["what"] for row in rows if not row["wt"]} == {"viscosity", "bulk_viscosity"}
    assert "no conductivity and no D for a mixture" in capsys.readouterr().err
    nearly, plain = gas("nearly", packing=UNLIKE.format(3.01, 64)), gas(packing=0.2)
    whole, one = (tp.enskog_of(run, reduced=True) for run in (nearly, plain))
    for name in tp.MOMENTS[:2]:
        assert whole[name] == pytest.approx(one[name], rel=1e-4)
    for own in (nearly, plain):
        with pytest.raises(RunError, match="its disks are not those of"):
            tp.coefficients([own, mixed])


def test_the_viscosity_of_grains_is_what_their_heat_takes(simulated):
    """In a sheared box the work, viscosity times squared shear rate, is dissipated or heats."""
    run = simulated("""&box boundary = 'periodic', 'periodic' shear_rate = 0.5 /
    &species count = 100 packing_fraction = 0.4 temperature = 1 / &contact restitution = 0.8 /
    &stop collisions_per_disk = 100 / &output observables_every_collisions_per_disk = 0.1 /""")
    (time, lost), kt = run.observable("dissipated_energy"), run.observable("all/temperature").value
    later, found = driven.viscosity(run)[""]
    mean = np.average(found, weights=np.diff(later, prepend=0))
    work = np.ptp(lost) + run.n_disks * (kt[-1] - kt[0])
    assert mean == pytest.approx(work / (0.25 * time[-1]), rel=0.05)
