"""Gases under gravity: the scripts gravity, equipartition and missed."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from ricochet.reports.equilibrium import equipartition
from ricochet.reports.equilibrium import gravity
from ricochet.reports.equilibrium import missed
from ricochet import RunError, estimates, read_run, statistics, thermodynamics
from sampling import held_as_often_as_stated, samples
from synthetic_gases import TWO, falling
from synthetic_run import drawn


@samples(40, 300)
@pytest.mark.parametrize("reach", [gravity.SPEED_RANGE, gravity.HEIGHT_RANGE])
def test_errors_of_slopes_are_their_scatter_although_kt_is_measured(rng, reach, samples):
    """The values have exponential distributions, with kT varying from block to block."""
    found = []
    for _ in range(samples):
        kt = np.repeat(rng.gamma(400, 1 / 400, gravity.BLOCKS), 60)[:, None]
        values = kt * rng.exponential(size=(len(kt), 40))
        species = [gravity.Samples(1.0, 0.0, 2 * values, values, values)]
        laws = values.mean() * gravity.warmth(species)
        found.append(gravity.slope_of(values, reach, 1 / laws))
    mean, error = np.transpose(found)
    held = np.abs(mean - mean.mean()) < error
    if samples < 300:
        assert held_as_often_as_stated(held)
    else:
        assert np.mean(held) == pytest.approx(0.6827, abs=0.07)
        assert np.mean(error) == pytest.approx(1.06 * np.std(mean), rel=0.12)


def test_slopes_of_heights_are_those_of_the_law_under_a_lid(rng):
    """The fit ends at the lid, which is between 1.4 and 8 kT / m g above the floor."""
    pulls = []
    for lid in rng.uniform(1.4, 8, 60):
        heights = -np.log1p(-rng.uniform(size=(300, 30)) * -np.expm1(-lid))
        found = gravity.slope_of(heights, gravity.HEIGHT_RANGE, np.ones(gravity.BLOCKS + 1), lid)
        pulls.append((found.mean - 1) / found.error)
    assert abs(np.mean(pulls)) < 4 / 60**0.5
    assert np.mean(np.abs(pulls) < 1) == pytest.approx(0.6827, abs=4 * 0.06)
    low = rng.uniform(0, 0.9, (300, 30))
    assert np.isnan(gravity.slope_of(low, gravity.HEIGHT_RANGE, np.ones(11), 0.9).mean)


def test_a_low_lid_is_named_with_the_end_of_the_fit(tmp_path, rng, capsys):
    """The lid at height 16 is at 2.8 kT / m g for the light disks and at 5.6 for the heavy ones."""
    path = falling(tmp_path / "run.h5", rng, temperature=1.4)
    rows = drawn(tmp_path, "gravity", path)
    assert [float(row["height_fit_to"]) for row in rows] == pytest.approx([2.8, 5.0], rel=0.05)
    said = capsys.readouterr()
    assert "the lid is at mgh = 2." in said.err and "left_out_before" in said.out


def test_gravity_slopes_are_those_of_the_laws(tmp_path, rng):
    run = read_run(falling(tmp_path / "run.h5", rng))
    frames = thermodynamics.frames_from(run, thermodynamics.start_of_equilibrium(run, 40))
    assert frames == list(range(80, 400))
    species = [gravity.samples(run, kind, frames) for kind in run.by_species]
    assert species[0].height.shape == (320, 30) and 0 <= species[0].height.min() < 0.01
    for row in gravity.table(run, species, (0.7, 0.0)):
        for kind in ("speed", "height"):
            assert row[f"{kind}_slope"] == pytest.approx(1, abs=0.06)
        assert row["K"] == pytest.approx(0.7, rel=0.03)
        assert row["K_x"] == pytest.approx(0.35, rel=0.04)


def test_crowded_disks_spread_upwards_and_share_their_energy(tmp_path, rng):
    """To first order a small radius reduces the density by n times the excluded area."""
    run = read_run(falling(tmp_path / "run.h5", rng))
    h = np.linspace(0, 15.9, 4001)
    species = [gravity.samples(run, kind, list(range(80, 400))) for kind in run.by_species]
    points = [s._replace(radius=0.0) for s in species]
    ideal = gravity.crowded_heights(h, points, 9.81, 0.7, 8.0, 60)
    dense = gravity.crowded_heights(h, species, 9.81, 0.7, 8.0, 60)
    excess = np.pi * 0.08**2 / 8 * (29 * ideal[0] + 30 * ideal[1])
    expected = -excess + np.trapezoid(excess * ideal[0], h)
    np.testing.assert_allclose(dense[0] / ideal[0] - 1, expected, atol=0.006)
    assert np.trapezoid(dense[1], h) == pytest.approx(1, rel=1e-12)
    wide = [s._replace(radius=0.1) for s in species]
    taken = np.pi * 0.2**2 * 30 * 0.075 * 9.81 / 0.7 / (8 - 0.2)
    assert gravity.crowding(run, wide, 0.7) == pytest.approx(taken) and taken > gravity.CROWDED
    assert np.isnan(gravity.heights(run, wide, 0.7)[1]).all()
    e = np.linspace(0, 84, 20001)
    density = gravity.normalised(e, gravity.sharing(e, 0.7, 60))
    assert np.trapezoid(e * density, e) == pytest.approx(0.7, rel=1e-4)


def test_thermalisation_time_ignores_a_passing_agreement():
    time = np.arange(8.0)
    gap = np.array([2, 1.05, 1.5, 1.2, 1.09, 1.0, 0.95, 1.3]) - 1

    def found(difference, error):
        known = statistics.Estimate(np.abs(difference), np.full(8, error))
        return estimates.propagate_error(lambda curve: equipartition.entry(time, curve), known)

    assert found(gap, 0.005) == pytest.approx((3 + 0.1 / 0.11, 0.005 / 0.11))  # for a steep line
    for unknown in (found(gap + 1, 0.04), found(gap, 0.06), found(gap, np.nan)):
        assert np.isnan(unknown.mean)


@samples(20, 200)
def test_one_run_of_many_disks_has_a_thermalisation_time_with_an_error(rng, samples):
    """Its error is based on fluctuations in equilibrium and has a coverage of 68 %."""
    time, found = np.arange(0, 40, 0.25) + 0.25, []
    kinds = [SimpleNamespace(mass=mass) for mass in (1.0, 2.0)]
    for _ in range(samples):
        noise = lfilter([0.015], [1, -0.7], rng.normal(size=len(time)))
        energy = {"A": np.ones(len(time)), "B": 1 + np.exp(-time / 3) + noise}
        run = SimpleNamespace(
            names=("A", "B"),
            by_species=kinds,
            observable=lambda name, of=energy: (time, of[name[0]]),
        )
        found.append(equipartition.approach([run], 0.5, 0.1).thermalisation)
    mean, error = np.transpose(found)
    truth = 3 * np.log(10)
    held = np.abs(mean - truth) < error
    assert 0.55 < np.mean(held) < 0.85 if samples >= 200 else held_as_often_as_stated(held)
    assert np.abs(np.median(mean) - truth) < 0.3 * truth and np.isfinite(mean).mean() > 0.9


def thermalisation_time(time, light, heavy):
    """Return the time after which mean energies (runs, T) of the species differ by at most 10 %."""

    def crossing(both):
        return equipartition.entry(time, np.abs(both[1] / both[0] - 1))

    return equipartition.over_runs(crossing, [light, heavy])


@samples(30, 300)
def test_the_error_of_the_thermalisation_time_is_the_scatter_of_groups(rng, samples):
    """The energy difference falls below 10 % at a known time, with the noise of 20 runs."""
    time = np.arange(0.25, 12, 0.5)
    difference, truth = np.exp(-time / 3), 3 * np.log(10)

    found = []
    for _ in range(samples):
        light = 1 + 0.01 * rng.normal(size=(20, len(time)))
        heavy = 1 + difference + 0.01 * rng.normal(size=light.shape)
        found.append(thermalisation_time(time, light, heavy))
    mean, error = np.transpose(found)
    held = np.abs(mean - truth) < error
    if samples < 300:
        assert held_as_often_as_stated(held)
    else:
        assert 0.56 < np.mean(held) < 0.78  # four standard deviations
        assert np.mean(error) == pytest.approx(np.std(mean), rel=0.25)
        assert abs(mean.mean() - truth) < 0.3 * np.std(mean)


def test_the_error_of_the_thermalisation_time_is_at_most_the_size_of_a_jump(rng):
    """Owing to noise, a curve with maxima 2.5 apart crosses the limit a period early or late."""
    time = np.arange(0.25, 12, 0.5)
    difference = np.exp(-time / 3) * (1 + 0.6 * np.cos(2 * np.pi * time / 2.5))

    errors = []
    for _ in range(60):
        light = 1 + 0.05 * rng.normal(size=(20, len(time)))
        heavy = 1 + difference + 0.05 * rng.normal(size=light.shape)
        errors.append(thermalisation_time(time, light, heavy).error)
    assert np.nanmax(errors) < 1.3 * 2.5, "the jackknife multiplies a jump by 4"


def test_one_run_does_not_say_that_energies_agree(tmp_path, rng, capsys):
    """In equilibrium the energies of 30 disks agree by chance again and again."""
    path = falling(tmp_path / "run.h5", rng)
    (row,) = drawn(tmp_path, "equipartition", path)
    assert row["T_therm"] == "nan" and "use more runs" in capsys.readouterr().err
    several = [read_run(falling(tmp_path / f"{k}.h5", rng, seed=k)) for k in range(2, 60)]
    assert equipartition.approach(several, 2, 0.1).thermalisation.mean == 1
    other = read_run(falling(tmp_path / "other.h5", rng, frames=300))  # in separate windows
    assert len(equipartition.approach([several[0], other], 0.25, 0.1).time) < 300


def test_missed_share_is_that_of_chords_at_random_phases(rng):
    for q in (0.1, 0.7, 1.0, 2.5):
        half = np.sqrt(1 - rng.uniform(0, 1, 10**6) ** 2)
        late = rng.uniform(0, q, 10**6) > half
        assert missed.missed_share(q) == pytest.approx(late.mean(), abs=4e-3 * q)
    assert missed.missed_share(9.99e-4) == pytest.approx(missed.missed_share(1.001e-3), rel=0.01)
    assert missed.missed_share(1 - 1e-9) == pytest.approx(missed.missed_share(1.0))
    assert missed.missed_share(0) == 0


def test_runs_with_equal_seeds_are_compared_and_others_named(tmp_path, rng, capsys):
    def made(seed, hits, dynamics):
        path = tmp_path / f"{dynamics}_{seed}.h5"
        return read_run(falling(path, rng, frames=50, dynamics=dynamics, seed=seed, hits=hits))

    events = [made(1, 10, "events"), made(2, 20, "events"), made(3, 40, "events")]
    steps = [made(1, 9, "steps"), made(2, 16, "steps"), made(4, 9, "steps")]
    rows = missed.compare(steps + events, 2.0)
    assert [row["dt"] for row in rows] == [0, 0.004] and [row["runs"] for row in rows] == [3, 2]
    assert rows[0]["missed_percent"] == 0 and rows[1]["missed_percent"] == pytest.approx(15)
    assert rows[1]["missed_percent_error"] == pytest.approx(5 * TWO)
    assert rows[1]["rate"] == pytest.approx(12.5 * 2 / 60 * 49 / 100)
    paths = [run.path for run in (*events, *steps)]
    drawn(tmp_path, "missed", *paths, "--equilibration", 2)
    assert capsys.readouterr().err.endswith(f"left out, because no event-driven run has the same seed: {paths[-1]}\n")  # fmt: skip  # noqa: E501
    for runs, problem in ((steps, "event-driven"), ([events[2], steps[0]], "no seed")):
        with pytest.raises(RunError, match=problem):
            missed.compare(runs, 2.0)
