"""Means, errors and tests for samples of known distributions: the coverage is correct."""

import numpy as np
import pytest
from scipy.signal import lfilter

from ricochet import estimates, statistics, theory
from ricochet.analysis import cooling
from ricochet.predictions.hard_disks import haff_rate


def remembering(rng, length: int, memory: float) -> np.ndarray:
    """Return a series (T,) with mean 0, variance 1 and correlation time `memory`, in samples."""
    keep = np.exp(-1 / memory)
    return lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.normal(size=length + 2000))[2000:]


# --- laws of speeds ---


def test_maxwell_sample_is_accepted_and_a_wrong_temperature_rejected(rng):
    u = np.linalg.norm(rng.normal(0, np.sqrt(0.5), (50000, 2)), axis=1)
    right = statistics.goodness_of_fit(u, theory.maxwell_cdf)
    wrong = statistics.goodness_of_fit(1.02 * u, theory.maxwell_cdf)
    assert right.ks_p > 0.01 and right.chi2_p > 0.01 and right.ks < 1.63 / np.sqrt(right.n)
    assert wrong.ks_p < 0.01 and wrong.chi2_p < 0.01
    x = np.linspace(0, 4, 4001)
    slope = np.gradient(theory.maxwell_cdf(x), x)
    np.testing.assert_allclose(slope[1:-1], theory.maxwell_pdf(x)[1:-1], atol=1e-6)


@pytest.mark.parametrize("periodic", [False, True])
def test_finite_n_law_is_that_of_disks_sharing_an_energy(rng, periodic):
    """In a periodic box the centre of mass is at rest; copies of a value count once."""
    v = rng.normal(size=(40000, 5, 2))
    v -= periodic * v.mean(axis=1, keepdims=True)
    k = np.sum(v**2, axis=2)
    u, law = np.sqrt(k[:, 0] / k.mean(axis=1)), theory.finite_n_cdf(5, periodic)
    found = statistics.goodness_of_fit(u, law)
    assert found.ks_p > 0.01
    assert statistics.goodness_of_fit(u, theory.finite_n_cdf(5, not periodic)).ks_p < 0.01
    again = statistics.goodness_of_fit(np.repeat(u, 4), law, independent=len(u))
    assert again == pytest.approx(found, rel=0.02)


def test_excess_kurtosis_and_its_noise(rng):
    assert statistics.excess_kurtosis(np.ones(10)) == -0.5
    gases = np.sqrt(rng.exponential(size=(2000, 500)))
    found = [statistics.excess_kurtosis(speed) for speed in gases]
    assert np.mean(found) == pytest.approx(0, abs=0.01)
    assert np.std(found) == pytest.approx(estimates.kurtosis_noise(500), rel=0.1)


# --- independent values ---


@pytest.mark.parametrize("copies", [1, 4])
def test_errors_of_a_histogram_are_its_scatter(rng, copies):
    """The values are independent, or groups of four are equal."""
    bins = np.linspace(0, 1, 6)
    draws = np.repeat(rng.beta(2, 3, (4000, 100)), copies, axis=1)
    heights = [estimates.binned(values, bins, independent=100) for values in draws]
    assert np.sum(heights[0].mean) / 5 == pytest.approx(1)
    scatter = np.std([height.mean for height in heights], axis=0)
    error2 = np.mean([height.error**2 for height in heights], axis=0)
    assert np.sqrt(error2) == pytest.approx(scatter, rel=0.05)


@pytest.mark.parametrize("members", [2, 3, 4, 30])
def test_68_of_100_estimates_hold_the_mean_however_few_the_members(rng, members):
    """For many values the error is the standard error; a single value has no error."""
    mean, error = statistics.estimate(rng.normal(3, 2, (20000, members)), axis=1)
    assert np.mean(np.abs(mean - 3) < error) == pytest.approx(0.6827, abs=0.015)
    assert np.sqrt(np.mean(error**2)) > 2 / np.sqrt(members)
    assert np.isnan(statistics.estimate([1.0]).error)
    assert statistics.student(1e9) == pytest.approx(1)


def test_power_law_is_found_with_its_error(rng):
    x = np.linspace(1, 30, 10)
    pulls = []
    for _ in range(200):
        error = 0.02 * 3 * x**0.7
        fit = statistics.fit_power_law(x, 3 * x**0.7 + error * rng.normal(size=10), error)
        pulls.append((fit.exponent - 0.7) / fit.exponent_error)
    assert abs(np.mean(pulls)) < 0.3 and 0.7 < np.std(pulls) < 1.3
    assert fit.factor == pytest.approx(3, rel=0.05)
    assert statistics.fit_power_law([1, 2], [1, 2], [0.1, 0.1]) is None


@pytest.mark.parametrize("points", [3, 5, 10])
def test_68_of_100_exponents_hold_the_true_one_where_scatter_makes_the_error(rng, points):
    x = np.linspace(1, 30, points)
    samples = x * np.exp(0.05 * rng.normal(size=(2000, points)))
    fits = [statistics.fit_power_law(x, y) for y in samples]
    held = np.mean([abs(fit.exponent - 1) < fit.exponent_error for fit in fits])
    assert held == pytest.approx(0.6827, abs=0.04)


@pytest.mark.parametrize(("points", "runs"), [(3, 2), (3, 4), (5, 4), (10, 8), (20, 4)])
def test_68_of_100_exponents_hold_the_true_one_where_runs_make_the_errors(rng, points, runs):
    """The errors of the points, estimated from few runs, differ by up to a factor of four."""
    x, held = np.linspace(1, 30, points), []
    spread = np.geomspace(0.05, 0.0125, points)
    for _ in range(1000):
        y = statistics.estimate(x * (1 + spread * rng.normal(size=(runs, points))))
        fit = statistics.fit_power_law(x, *y, runs)
        held.append(abs(fit.exponent - 1) < fit.exponent_error)
    assert np.mean(held) == pytest.approx(0.6827, abs=0.06)


@pytest.mark.parametrize("runs", [4, 8])
def test_a_fit_says_that_it_misses_its_points_as_seldom_as_it_should(rng, runs):
    x, missed = np.linspace(1, 30, 10), np.zeros((2, 1000), int)
    for k in range(1000):
        for bent in (0, 1):
            y = x**0.7 * (1 + 0.4 * bent * np.sin(x / 3))
            own = statistics.estimate(y * (1 + 0.05 * rng.normal(size=(runs, 10))))
            missed[bent, k] = statistics.fit_power_law(x, *own, runs).missed
    assert missed[0].sum() < 20, "by chance 0.5 %"
    assert missed[1].mean() > (0.5 if runs == 4 else 0.99)


def test_errors_are_written_with_two_digits():
    assert statistics.rounded_to_error(0.0000123, 0.00031) == ("0.00001", "0.00031")
    assert statistics.rounded_to_error(-1e-9, 0.2) == ("0.00", "0.20")
    assert statistics.rounded_to_error(945.3, 12.4) == ("945", "12")
    assert statistics.rounded_to_error(0.9512, 0.00999) == ("0.951", "0.010")
    assert statistics.rounded_to_error(0.5, 0.0) == ("0.5", "0")


# --- series in time ---


def test_the_error_of_a_series_without_memory_is_that_of_its_scatter(rng):
    amount = rng.poisson(1000, 20000).astype(float)
    found = statistics.correlated_mean(amount, np.full(20000, 2.0))
    assert found.mean == pytest.approx(500, rel=0.01)
    assert found.error == pytest.approx(np.sqrt(1000) / 2 / np.sqrt(20000), rel=0.4)


def test_a_series_in_decades_is_worth_its_last_samples_and_has_no_error(rng):
    times = np.diff(np.geomspace(1, 1e6, 200))
    found = statistics.correlated_mean(times * rng.normal(5, 1, 199), times)
    assert found.mean == pytest.approx(5, abs=1.5) and np.isnan(found.error) and found.samples < 3


@pytest.mark.parametrize("memory", [0.5, 5, 20])
def test_68_of_100_intervals_hold_the_mean_of_a_series_that_remembers(rng, memory):
    means = [
        statistics.correlated_mean(remembering(rng, 2000, memory) + 3 * rng.normal(size=2000))
        for _ in range(400)
    ]
    hit = np.mean([abs(one.mean) < one.error for one in means])
    assert 0.60 <= hit <= 0.76
    exact = np.sqrt((1 / np.tanh(0.5 / memory) + 9) / 2000)
    assert np.mean([one.error for one in means]) == pytest.approx(1.1 * exact, rel=0.12)


def test_what_samples_make_up_for_is_no_error(rng):
    """The sum of the series is bounded, as for disks that exchange energy with a wall."""
    series = np.diff(rng.normal(size=(1000, 641))) + 0.1 * rng.normal(size=(1000, 640))
    means = [statistics.correlated_mean(one) for one in series]
    held = np.mean([abs(one.mean) < one.error for one in means])
    assert 0.62 <= held <= 0.76


def test_equilibrium_begins_where_a_drift_has_died_out(rng):
    decay = 20 * np.exp(-np.arange(4000) / 200)
    starts = [statistics.equilibration(remembering(rng, 4000, 3) + decay) for _ in range(40)]
    assert np.quantile(starts, 0.1) > 3 * 200 and np.quantile(starts, 0.9) < 2000
    calm = [statistics.equilibration(remembering(rng, 4000, 3)) for _ in range(40)]
    assert np.median(calm) < 400


def test_what_speaks_against_an_error_is_said(rng):
    calm = [statistics.correlated_mean(rng.normal(size=640)) for _ in range(10)]
    assert statistics.diagnostics("Z", calm) == []
    slope = np.linspace(0, 0.5, 640)  # insignificant in a single run, but equal in all runs
    drifting = [statistics.correlated_mean(rng.normal(size=640) + slope) for _ in range(10)]
    assert "Z: still drifts" in statistics.diagnostics("Z", drifting)[0]
    apart = [one._replace(mean=one.mean + k) for k, one in enumerate(calm)]
    assert "runs scatter by 3" in statistics.diagnostics("Z", apart)[0]
    assert statistics.combine_runs(apart).error == pytest.approx(1, rel=0.1)
    assert statistics.combine_runs(apart).samples == 10, "a run is a sample"
    assert statistics.statistical_inefficiency(rng.normal(size=3)) > 1
    short = statistics.correlated_mean(rng.normal(size=5))
    assert "no error" in statistics.diagnostics("Z", [short])[0]
    slow = [statistics.correlated_mean(remembering(rng, 640, 100)) for _ in range(100)]
    said = [" ".join(statistics.diagnostics("Z", [one])) for one in slow]
    assert np.mean(["independent samples; run longer" in text for text in said]) > 0.5


@pytest.mark.parametrize("seeds", ["equal", "different"])
def test_a_constant_has_neither_an_error_nor_a_warning(rng, seeds):
    """Rounding errors of the constant are independent, or add up as those of an energy do."""
    for runs in range(1, 7):
        length, size = int(rng.integers(8, 2000)), 10 ** rng.uniform(-9, 9)
        constants = rng.choice([-1, 1]) * size * rng.uniform(1, 2, runs)
        if seeds == "equal":
            constants[:] = constants[0]
        noise = rng.normal(size=(runs, length))
        if rng.random() < 0.5:
            noise = np.cumsum(noise, axis=1)
        series = constants[:, None] * (1 + 2e-16 * noise)
        means = [statistics.correlated_mean(one) for one in series]
        assert np.max([one.error for one in means]) <= 1e-12 * size
        assert statistics.diagnostics("kT", means) == []
        # Where the constant depends on the seed, only the scatter of the runs is an error.
        unknown = [one._replace(error=np.nan) for one in means]
        assert statistics.diagnostics("kT", unknown) == []
        scatter = statistics.estimate([one.mean for one in means]).error
        whole = statistics.combine_runs(unknown)
        assert whole.error == pytest.approx(scatter, nan_ok=True)


def test_windows_are_means():
    time = np.arange(0, 10.01, 0.1)
    middle, mean = statistics.windows(time, time, 2.0)
    np.testing.assert_allclose(middle, [1, 3, 5, 7, 9])
    np.testing.assert_allclose(mean, [0.95, 2.95, 4.95, 6.95, 8.95])
    some = statistics.windows(time[::50], time[::50], 2.0)
    np.testing.assert_allclose(some, [[1, 5], [0, 5]], err_msg="no window without samples")


def test_a_propagated_error_belongs_to_the_value_at_the_mean():
    """The middle of the two limits would be biased for a curved function; no limit, no value."""
    curve = statistics.Estimate(np.array([1.0, 2.0]), np.array([0.1, 0.5]))
    assert estimates.propagate_error(lambda y: y[1] ** 2, curve) == pytest.approx((4.0, 2.0))
    known = estimates.propagate_error(lambda y: y[1] if y[1] > 1.8 else np.nan, curve)
    assert np.isnan(known.mean) and np.isnan(known.error)


def test_the_end_of_the_homogeneous_state_is_that_of_the_mean_rate():
    """At the printed number the curves in the figure become pale."""
    tau = np.linspace(0, 40, 401)
    tracks = []
    for factor in (0.925, 0.975, 1.025, 1.075):
        rate = factor * haff_rate(0.8) * (1 - 0.3 * np.sqrt(tau / 40))
        fallen = np.concatenate([[0], np.cumsum(np.diff(tau) * (rate[1:] + rate[:-1]) / 2)])
        tracks.append((tau, tau, np.exp(-fallen)))
    _, _, end, with_error = cooling.haff(tracks, 0.8)
    assert with_error.mean == end and with_error.error > 0
