"""Transport coefficients: Helfand moments against definitions, errors, and a gas against Enskog."""

import csv

import numpy as np
import pytest
from scipy.signal import lfilter

import transport
from ricochet import RunError, helfand, read_run
from ricochet import hard_disks as hd
from ricochet.statistics import ONE_SIGMA
from synthetic_run import run_script
from whole_runs import FINISHED, write_input

GAS = """&run seed = {seed} / &box boundary = {sides} /
&species count = {count} packing_fraction = {packing} temperature = 2 mass = 3 /
&contact restitution = {restitution} / &stop collisions_per_disk = {length} /
&output event_log = {log} virial_tensor = {tensor} {cadence} /
"""
USUAL = {
    "seed": 1, "sides": "'periodic', 'periodic'", "count": 64, "packing": 0.1, "restitution": 1,
    "length": 400, "log": ".true.", "tensor": ".true.",
    "cadence": "frames_every_time = 0.05 observables_every_collisions = 64",
}  # fmt: skip


@pytest.fixture
def gas(ricochet, tmp_path):
    """A run of a periodic gas, with what is unusual about it."""

    def made(name="gas", **unusual):
        write_input(tmp_path, GAS.format(**USUAL | unusual))
        assert ricochet("gas.nml", "-o", f"{name}.h5").returncode == FINISHED
        return read_run(tmp_path / f"{name}.h5")

    return made


# --- formulas ---


def test_enskog_bulk_viscosity_is_what_uncorrelated_collisions_hand_on():
    """Half of their rate per area times <(diameter dP / 2)^2> / kT, where <dP^2> is 4 m kT."""
    eta, diameter, kt, mass = 0.3, 0.7, 2.0, 3.0
    z, density = float(hd.henderson(eta)), 4 * eta / (np.pi * 0.7**2)
    pairs = density * hd.collision_rate(z, diameter, 1e6, kt, mass) / 2
    expected = pairs / 2 * diameter**2 / 4 * 4 * mass
    bulk = mass * density * hd.enskog_bulk_viscosity(z, eta, diameter, kt, mass)
    assert bulk == pytest.approx(expected, rel=1e-6)


def test_moments_are_those_of_the_definition(gas):
    """With a frame at each event places and velocities tell what is carried and handed on."""
    run = gas(count=10, packing=0.3, length=40, cadence="frames_every_events = 1")
    x, v, m = run.position[:], run.velocity[:], run.mass[0]
    v = v - v[0].mean(axis=0)
    flown, handed, time = [], [], run.time
    for k in range(run.frames - 1):
        flown.append((time[k + 1] - time[k]) * helfand.flux(v[k], m).sum(axis=0))
        changed = np.flatnonzero(np.any(v[k + 1] != v[k], axis=1))
        if len(changed) == 0:
            handed.append(np.zeros(5))
            continue
        i, j = changed
        r = x[k + 1, i] - x[k + 1, j]
        r -= run.edges * np.round(r / run.edges)
        dp, de = (
            m * (v[k + 1, i] - v[k, i]),
            m * (v[k + 1, i] @ v[k + 1, i] - v[k, i] @ v[k, i]) / 2,
        )
        handed.append([dp[0] * r[0], dp[0] * r[1], dp[1] * r[1], *(de * r)])
    expected = np.vstack([np.zeros(5), np.cumsum(np.add(flown, handed), axis=0)])

    found = helfand.moments(run, 0.0)
    at = np.arange(len(found.heat)) * found.step
    before = np.searchsorted(time, at, "right") - 1
    rest = (at - time[before])[:, None] * np.array([helfand.flux(v[k], m).sum(0) for k in before])
    xx, xy, yy, *heat = (expected[before] + rest).T
    for moment, parts in (
        (found.shear, (xy, (xx - yy) / 2)),
        (found.bulk, ((xx + yy) / 2,)),
        (found.heat, heat),
    ):
        for one, other in zip(moment.T, parts, strict=True):
            straight = other[0] + np.linspace(0, 1, len(at)) * (other[-1] - other[0])
            np.testing.assert_allclose(one, other - straight, atol=1e-7 * np.ptp(other))


def test_collisions_hand_on_what_the_virial_tensor_counts(gas):
    run = gas()
    events = helfand.log(run)
    handed = helfand.handed_on(run, events.momentum_change, *helfand.velocities(run, events))
    tensor = run.observable("virial_tensor").value[-1]
    np.testing.assert_allclose(handed.sum(axis=0)[[0, 1, 1, 2]], tensor, rtol=1e-9, atol=1e-9)


def fluctuating(rng, count, memory):
    """(count, 2) moments of fluxes that forget as exp(-t / memory), with a mean growth."""
    keep = np.exp(-1 / memory)
    noise = rng.normal(0, np.sqrt(1 - keep**2), (count + 500, 2))
    return np.cumsum(lfilter([1], [1, -keep], noise, axis=0)[500:] + 0.3, axis=0)


def test_fluxes_that_forget_have_the_coefficient_and_the_errors_they_should():
    """It is the sum of their memory; right errors hold it in 68 % of all cases."""
    rng = np.random.default_rng(4)
    keep = np.exp(-1 / 6)
    truth, found = (1 + keep) / (1 - keep) / 2, []
    for _ in range(300):
        moment = fluctuating(rng, 6000, 6.0)
        moment -= np.linspace(moment[0], moment[-1], len(moment))
        found.append(helfand.coefficient(moment, 1.0, 100))
    mean, error = np.array([(one.mean, one.error) for one in found]).T
    assert mean.mean() == pytest.approx(truth, abs=4 * mean.std() / np.sqrt(300))
    held = np.mean(np.abs(mean - truth) < error)
    assert held == pytest.approx(2 * ONE_SIGMA - 1, abs=0.1)


def test_squares_allow_for_the_mean_growth_that_is_taken_away():
    """Steps without memory gain their number, whatever they gain on average."""
    steps = np.random.default_rng(6).normal(2.0, 1.0, (41, 4000))
    moment = np.cumsum(steps, axis=0)
    moment -= np.linspace(moment[0], moment[-1], 41)
    assert helfand.squares(moment, 20).mean() == pytest.approx(20, rel=0.05)


def test_the_running_coefficient_comes_from_nothing_to_the_whole():
    moment = fluctuating(np.random.default_rng(5), 400000, 6.0)
    moment -= np.linspace(moment[0], moment[-1], len(moment))
    slopes = helfand.running(moment, 0.5, np.array([1, 40, 80]))
    keep = np.exp(-1 / 6)
    whole = (1 + keep) / (1 - keep) / 2 / 0.5
    assert slopes[0] == pytest.approx(1, rel=0.02)  # <flux^2> step / 2
    assert slopes[-1] == pytest.approx(whole, rel=0.05)


# --- whole runs ---


def test_a_dilute_gas_has_the_coefficients_of_enskog(gas):
    runs = [
        gas(f"gas{seed}", seed=seed, packing=0.02, length=2000, cadence="frames_every_time = 1")
        for seed in range(1, 4)
    ]
    found = transport.analysed(runs, None)
    assert set(found) == set(transport.enskog(0.02))
    for name, one in found.items():
        ratio = transport.combined(one.members)
        assert ratio.error < 0.2, name
        assert ratio.mean == pytest.approx(1, abs=4 * ratio.error), name
    assert found["bulk_viscosity"].curve.y[0] == pytest.approx(1, abs=0.05)


def test_coefficients_are_drawn_with_their_numbers(gas, tmp_path):
    runs = [gas(f"gas{k}", packing=packing).path for k, packing in enumerate((0.1, 0.3))]
    table = tmp_path / "a.csv"
    assert run_script("transport", *runs, "-o", tmp_path / "a.png", "--csv", table) == 0
    with table.open() as file:
        rows = list(csv.DictReader(file))
    means = [row for row in rows if not row["wt"]]
    assert {(row["what"], float(row["packing"])) for row in means} == {
        (name, eta) for name in transport.LABELS for eta in (0.1, 0.3)
    }
    assert all(float(row["error"]) > 0 for row in means)
    assert all(float(row["wt"]) > 0 for row in rows if row["what"].endswith("(t)"))


@pytest.mark.parametrize(
    ("unusual", "said"),
    [
        ({"sides": "'wall', 'periodic'"}, "in a periodic box"),
        ({"restitution": 0.9, "length": 20}, "elastic"),
        ({"tensor": ".false."}, "virial_tensor"),
        ({"log": ".false."}, "event_log"),
        ({"length": 12}, "eight collisions"),
        ({"cadence": "frames_every_collisions = 500"}, "frames_every_time"),
    ],
)
def test_other_runs_are_refused(gas, tmp_path, capsys, unusual, said):
    run = gas(**unusual)
    assert run_script("transport", run.path, "-o", tmp_path / "a.png") == 2
    assert said in capsys.readouterr().err


def test_a_log_with_a_gap_is_refused(gas):
    run = gas(length=20)
    events = helfand.log(run)
    gap = type(events)(*(np.delete(part, 7, axis=0) for part in events))
    with pytest.raises(RunError, match="does not lead"):
        helfand.velocities(run, gap)


def test_coefficients_that_have_not_settled_are_doubted(gas, tmp_path, capsys):
    for length, doubted in ((20, True), (400, False)):
        run = gas(length=length)
        assert run_script("transport", run.path, "-o", tmp_path / "a.png") == 0
        assert ("before it has settled" in capsys.readouterr().err) == doubted
        run.path.unlink()
