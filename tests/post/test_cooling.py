"""Cooling gases: Haff's law for hard and soft disks, and the scripts haff and cooling."""

import csv
from types import SimpleNamespace

import numpy as np
import pytest

import ricochet
from ricochet.reports.grains import haff
from ricochet import (
    RunError,
    cooling,
    equilibrium,
    estimates,
    hard_disks as hd,
    read_run,
    theory,
    thermodynamics as td,
)
from ricochet.reading.reader import Restitution
from synthetic_gases import TWO, cooled, gas
from synthetic_run import drawn, run_script, write_run, written


def test_a_gas_that_cools_has_a_structure_and_free_paths_and_haffs_law(bulk, tmp_path, capsys):
    """Diffusion coefficient, pressure and equation of state are undefined.

    The figures of four scripts are drawn, including the structure of a dilute gas.
    """
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
    found, rate, *_ = cooling.haff([cooling.energy_left(run)], 0.9)
    for y, law in (("K_by_time", "haff"), ("K", "law")):
        early = found[law] > 0.1
        np.testing.assert_allclose(found[y].mean[early], found[law][early], rtol=0.2)
    assert np.isnan(rate.error), "of a single run"
    drawn(tmp_path, "haff", bulk[2])
    row = drawn(tmp_path, "equation_of_state", *bulk[:2])[0]
    assert "Z_rate" in row and "Z_walls" not in row, "a periodic box has no walls"


def test_panels_of_ratios_that_share_an_axis_hold_both_curves(simulated):
    run = simulated(
        """&box boundary = 'periodic', 'periodic' /
        &species count = 300 packing_fraction = 0.05 temperature = 1 /
        &contact restitution = 0.9 restitution_law = 'power' reference_speed = 10 /
        &stop collisions_per_disk = 60 / &output observables_every_collisions_per_disk = 1 /"""
    )
    *_, left, right = haff.ANALYSIS(run, {}).figure().axes
    highest = [max(np.nanmax(line.get_ydata()) for line in axes.lines) for axes in (left, right)]
    assert left.get_ylim() == right.get_ylim()
    assert max(highest) <= left.get_ylim()[1] <= haff.RATIO_TOP


def test_the_first_rate_is_counted_where_no_equation_of_state_is_known(bulk, simulated, tmp_path):
    """Both methods agree for equal disks; a gas of two sizes cools by the same laws."""
    run = read_run(bulk[2])
    assert cooling.counted_rate(run) == pytest.approx(cooling.first_rate(run), rel=0.1)
    two = simulated(
        """&box boundary = 'periodic', 'periodic' / &contact restitution = 0.9 /
        &species name = 'small' count = 400 radius = 0.005 temperature = 1 /
        &species name = 'large' count = 400 radius = 0.008 temperature = 1 /
        &stop collisions_per_disk = 15 /
        &output observables_every_collisions_per_disk = 0.1 /""",
        name="two",
    )
    w0_t, tau, left = cooling.energy_left(two)
    np.testing.assert_allclose(left, hd.haff_by_collisions(tau, 0.9), rtol=0.1)
    np.testing.assert_allclose(left, hd.haff_by_time(w0_t, 0.9), rtol=0.15)
    drawn(tmp_path, "haff", two.path)


@pytest.mark.parametrize("law", ["power", "viscoelastic"])
def test_soft_disks_cool_by_a_law_of_their_own(simulated, tmp_path, law):
    """K decreases as t^(-5/3) at late times, and by Haff's law while all speeds exceed g0."""
    hard = hd.haff_soft(Restitution(0.7, law, 1e-9), 1.0)
    np.testing.assert_allclose(hard[2][:99], hd.haff_by_time(hard[0][:99], 0.7), rtol=1e-3)
    soft = hd.haff_soft(Restitution(0.7, law, 10.0), 1.0)
    assert cooling.exponent(soft[0], soft[2]) == pytest.approx(5 / 3, abs=0.01)
    run = simulated(
        f"""&box boundary = 'periodic', 'periodic' /
        &contact restitution = 0.8 restitution_law = '{law}' reference_speed = 10 /
        &species count = 400 packing_fraction = 0.05 temperature = 1 /
        &stop collisions_per_disk = 40 /
        &output observables_per_decade = 20 decades_from = 0.01 /""",
        name=law,
    )
    curves, *_ = cooling.haff([cooling.energy_left(run)], 0.8, cooling.soft_law([run]))
    np.testing.assert_allclose(curves["K_by_time"].mean, curves["haff"], rtol=0.15)
    assert "soft_contacts" in run.nature and np.isnan(run.restitution)
    (row,) = (row for row in drawn(tmp_path, "haff", run.path)[:1])
    assert any("below 10" in name for name in row)


def test_cooling_averages_over_runs_on_one_grid(tmp_path):
    """Relative energies are plotted against collisions, energies in input units against time."""
    paths = [
        cooled(tmp_path / f"{k}.h5", 0.9, decay, points=p)
        for k, (decay, p) in enumerate([(1.0, 401), (2.0, 301)])
    ]
    found = cooling.energies([read_run(path) for path in paths])
    tau, all_of_them = found["collisions_per_disk"], found["K_all"]
    assert tau[-1] == 20 and found["time"][-1] == 1
    one, other = np.exp(-tau / 20), np.exp(-tau / 10)
    np.testing.assert_allclose(all_of_them.mean, (one + other) / 2, atol=1e-4)
    np.testing.assert_allclose(all_of_them.error, TWO * np.abs(one - other) / 2, atol=2e-4)
    np.testing.assert_allclose(found["ratio"].mean, 2)
    heavy, t = found["energy_heavy"].mean, found["time"]
    np.testing.assert_allclose(heavy, 2 * (np.exp(-t) + np.exp(-2 * t)), rtol=1e-3)


def test_a_gas_of_one_kind_cools_without_a_ratio(tmp_path, rng):
    """The title gives the rule of the walls only if there are walls."""
    for periodic in (False, True):
        more = {"names": ("all",), "periodic": (periodic, periodic)}  # disks of the name all
        path = gas(tmp_path / f"{periodic}.h5", rng, **more)
        (row, *_) = drawn(tmp_path, "cooling", path)
        assert not any("ratio" in name for name in row)
        title = ricochet.analyse("cooling", [read_run(path)]).figure().get_suptitle()
        assert ("wall rule" in title) != periodic


@pytest.mark.parametrize("end", [25.0, None])
def test_the_cooling_rate_is_that_of_the_homogeneous_state(rng, end):
    """At first the rate is 3 % above the law with a scatter of 1, later half of it."""
    tau, true = np.linspace(0, 60, 601), 1.03 * cooling.hard_disks.haff_rate(0.9)
    tracks = []
    for factor in 1 + 0.01 * rng.normal(size=20):
        lost = true * factor * np.minimum(tau, end or 60)
        lost += 0.5 * true * np.maximum(tau - (end or 60), 0)
        tracks.append((tau, tau, np.exp(-lost)))
    curves, rate, until, known = cooling.haff(tracks, 0.9)
    assert rate.mean == pytest.approx(true, abs=4 * rate.error)
    assert rate.error == pytest.approx(0.01 * true / np.sqrt(20), rel=0.5)
    assert curves["rate"].mean[100] == pytest.approx(true * (0.5 if end else 1), rel=0.01)
    assert known.mean == pytest.approx(end, abs=1 + known.error) if end else np.isnan(known.mean)
    said = " ".join(haff.apart(0.9, curves, until))
    assert not said if end else "here K is 0.8" in said and "after 60 coll" in said
    found = haff.Cooling(curves, rate, until, known)
    group = SimpleNamespace(key=Restitution(0.9), runs=tracks, values=found)
    (note,) = haff.deviation(group)
    assert "standard errors above the law" in note and "from 20 runs" in note
    law = cooling.hard_disks.haff_rate(0.9)
    group.values = found._replace(rate=estimates.Estimate(law - 2 * rate.error, rate.error))
    assert not haff.deviation(group)
    group.values = found._replace(rate=estimates.Estimate(law - 4 * rate.error, rate.error))
    assert "rate 4.0 standard errors below the law" in haff.deviation(group)[0]


def test_the_steady_ratio_has_forgotten_its_start(monkeypatch, tmp_path):
    """Runs that follow the law start without rotation, or with too much of it."""
    law, tau = (0.9, 0.0, 0.5), np.linspace(0, 25, 251)

    def run(start, last=251):
        both = theory.rough_temperatures(tau, (1.0, start), *law)[:, :last]
        names = ("all/temperature", "all/rotational_temperature")
        observables = {"collisions": tau[:last], **dict(zip(names, both, strict=True))}
        x, path = np.zeros((1, 2, 2)), tmp_path / "a.h5"
        more = {"observable_time": tau[:last], "observables": observables}
        return written(path, x, x, **more), both

    for start in (0.0, 2.0):
        found = cooling.steady_ratio([run(start)[0]], law).mean
        assert found == pytest.approx(theory.rough_ratio(*law), rel=cooling.SETTLED)
    short, (t, r) = run(0.0, 51)
    late = np.mean(r[25:] / t[25:])
    assert cooling.steady_ratio([short], law).mean == pytest.approx(late)


def test_the_ratio_of_temperatures_is_a_mean_over_collisions_per_disk(tmp_path, rng):
    """In run k the ratio is linear in the collisions per disk, but not in time."""
    runs, tau = [], np.linspace(0, 12, 121)
    for k in range(3):
        v = rng.normal(size=(1, 40, 2))
        energy = {"a": np.exp(-tau / 4), "b": (1 + k + tau / 10) * np.exp(-tau / 4)}
        observables = {f"{name}/kinetic_energy": own for name, own in energy.items()}
        observables |= {"collisions": 20 * tau, "all/kinetic_energy": sum(energy.values()) / 2}
        more = {"mass": np.tile([1, 4], 20), "species": np.tile([1, 2], 20), "names": ("a", "b")}
        more |= {"observables": observables, "observable_time": np.exp(tau / 4)}
        runs.append(written(tmp_path / f"{k}.h5", v, v, periodic=(True, True), **more))
    assert cooling.temperature_ratio(runs, 4.03, 8.05).mean == pytest.approx(2.604)
    late = cooling.temperature_ratio(runs, 10, 40)
    assert late.mean == pytest.approx(3.1) and late.error == pytest.approx(1.32 / 3**0.5, rel=0.01)
    with pytest.raises(RunError, match="ends after 12 collisions per disk"):
        cooling.temperature_ratio(runs, 12, 40)


@pytest.mark.parametrize(("count", "kinds"), [(60, (1, 4)), (400, (1, 1)), (3000, (1, 25))])
def test_a_flow_in_a_cooling_gas_is_told_apart_from_independent_velocities(
    tmp_path, rng, count, kinds
):
    """A velocity wave has 0, 10 or 40 % of the energy of a mixture of unequal kT."""
    mass = np.tile(np.array(kinds, float), count // 2)
    thermal = np.sqrt(np.tile([1.0, 1.8], count // 2) / mass)[:, None]
    for share in (0.0, 0.1, 0.4):
        found = []
        for k in range(12):
            x, v = rng.uniform(size=(1, count, 2)), rng.normal(size=(1, count, 2)) * thermal
            wave = np.sin(2 * np.pi * x[0, :, 0])
            ratio = np.sum(mass[:, None] * v[0] ** 2) / np.sum(mass * wave**2)
            v[0, :, 1] += np.sqrt(ratio * share / (1 - share)) * wave
            path = tmp_path / f"{share}_{k}.h5"
            more = {"mass": mass, "species": np.tile([1, 2], count // 2), "names": ("a", "b")}
            run = written(path, x, v, periodic=(True, True), **more)
            found.append(cooling.flow_share([run]))
        mean, error = estimates.estimate([one.share for one in found])
        fixed = 3 / count  # for a few disks, the fixed momentum reduces the fraction
        assert 0.7 * share - fixed - 4 * error < mean < share + 4 * error
        apart = sum(not one.homogeneous for one in found)
        assert apart <= 1 if share == 0 else apart >= 12 * (share * count > 100)


def test_a_cooling_gas_that_is_not_homogeneous_is_named(tmp_path, rng, capsys):
    """The script cooling and the table of a sweep warn of energy in flows."""
    (tmp_path / "scan").mkdir()
    for seed, speed in enumerate((0.0, 1.5)):
        x, v = rng.uniform(size=(2, 400, 2)), rng.normal(size=(2, 400, 2))
        v[..., 0] += speed * np.sin(2 * np.pi * x[..., 1])
        parameters = {"contact": {"restitution": 0.8 + 0.1 * seed}, "run": {"seed": seed}}
        energy = np.sum(v**2, axis=2).mean(axis=1) / 2 * [1, 0.5]
        observables = {f"{name}/kinetic_energy": energy for name in ("all", "disk")}
        observables |= {"collisions": [0, 4000], "dissipated_energy": [0, 200]}
        more = {"observables": observables, "parameters": parameters, "periodic": (True, True)}
        write_run(tmp_path / "scan" / f"{seed}.h5", x, v, **more)
    rows = drawn(tmp_path, "cooling", *sorted((tmp_path / "scan").glob("*.h5")))
    said = capsys.readouterr()
    assert rows and "flow_share" in said.out
    assert "ξ = 0.9: at the end the gas is not homogeneous" in said.err
    assert "ξ = 0.8:" not in said.err
    assert run_script("gather", tmp_path / "scan", "--csv", tmp_path / "scan.csv") == 0
    assert "1 of 2 cooling gases are not homogeneous" in capsys.readouterr().err
    with (tmp_path / "scan.csv").open() as file:
        shares = [float(row["flow_share"]) for row in csv.DictReader(file)]
    assert abs(shares[0]) < 0.05 < 0.2 < shares[1]
