"""Estimators of pressure, rates, cooling, transport coefficients and fields, tested on gases.

Runs that are made, whose answer is known, and small runs of the program, on which the scripts draw.
"""

import os
from contextlib import nullcontext
from typing import NamedTuple

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from scipy.signal import lfilter
from scipy.special import ndtr, stdtr
from scipy.stats import binom

import correlations
import driven
import energy
import fields as fields_script
import melting
import rates
import trajectory
from driven import demon_law, fuller, noise_law, temperature_law
from ricochet import (
    EventLog,
    RunError,
    cooling as cool,
    equilibrium,
    estimates,
    fields,
    hard_disks as hd,
    read_run,
    statistics,
    theory,
    thermodynamics as td,
    transport as tp,
    write_start,
)
from ricochet.figures.drawing import plt
from ricochet.reading.nature import Refused, nature_of
from ricochet.reading.reader import Restitution
from synthetic_run import ROOT, drawn, run_script, write_run, written
from validation.estimators import force, hit_rate

PERIODIC = (True, True)


# --- pressure ---


def steady(path, periodic, speed=1.0, radius=0.01, **parameters):
    """Write a run of 100 disks with kT = 2 speed^2; cumulative observables grow linearly."""
    time = np.arange(201.0)
    v = speed * np.tile([[2.0, 0.0], [-2.0, 0.0]], (1, 50, 1)).repeat(2, axis=0)
    observables = {
        "collisions": (500 * time).astype(int),
        "virial": 300 * speed**2 * time,
        "side_collisions": np.outer(time, (3, 3, 4, 4)).astype(int),
        "side_impulse": speed**2 * np.outer(time, (400.0, 400.0, 500.0, 500.0)),
    }
    more = {"observables": observables, "observable_time": time, "parameters": parameters}
    more |= {"time": [0, 200], "radius": radius, "periodic": periodic}
    return written(path, np.full_like(v, 0.5), v, **more)


def test_three_pressures_of_a_steady_run(tmp_path):
    walled = steady(tmp_path / "walls.h5", (False, False))
    assert td.temperature(walled)[:2] == (2, 0)
    z = td.z_virial(walled)
    assert z.mean == pytest.approx(1 + 300 / 400) and z.error == pytest.approx(0, abs=1e-12)
    assert td.z_wall(walled).mean == pytest.approx(900 * 0.98 / 400)
    assert td.collision_rate(walled).mean == pytest.approx(10)
    assert hit_rate(walled).mean == pytest.approx(14)
    assert force(walled).mean == pytest.approx(450)
    unit = hd.collision_rate(2.0, 0.02, 100, 2.0)
    assert td.z_rate(walled).mean == pytest.approx(1 + 10 / unit)
    bulk = steady(tmp_path / "bulk.h5", PERIODIC)
    assert td.temperature(bulk).mean == pytest.approx(200 / 99)
    assert td.z_virial(bulk).mean == pytest.approx(1 + 300 / (2 * 100 * 200 / 99))
    assert set(td.z_ways(bulk)) == {"virial", "rate"}


@pytest.mark.parametrize("periodic", [(False, False), (True, False), PERIODIC])
def test_kt_is_of_the_momenta_that_are_free(tmp_path, rng, periodic):
    """The conserved motion of the centre of mass reduces the thermal energy of few disks."""
    kept, mass, heat = np.array(periodic), np.array([9.0, 1.0, 1.0, 1.0]), 3.0
    v = rng.normal(size=(20000, 4, 2)) / np.sqrt(mass)[:, None]
    v -= kept * np.average(v, axis=1, weights=mass, keepdims=True)
    v *= np.sqrt(heat / np.sum(0.5 * mass[:, None] * v**2, axis=(1, 2)))[:, None, None]
    v += kept * np.array([0.2, -0.1])
    parts = {"species": [1, 2, 2, 2], "names": ("big", "small"), "mass": mass}
    run = written(tmp_path / "run.h5", 0 * v, v, periodic=periodic, **parts)
    assert td.kt_at_start(run) == pytest.approx(heat / (4 - kept.sum() / 2))
    for kind in run.by_species:
        energy = run.kinetic_energy(slice(None))[:, kind.disks].mean()
        assert td.mean_energy(run, kind.mass).mean == pytest.approx(energy, rel=0.02)
    inside = {"obstacles": [((0.5, 0.5), 0.1, 0)], "periodic": periodic}
    stopped = written(tmp_path / "stopped.h5", 0 * v[:1], v[:1], mass=mass, **inside)
    expected = stopped.kinetic_energy(0).mean()
    assert td.kt_at_start(stopped) == pytest.approx(expected), "an obstacle takes all"
    if periodic == (True, False):  # walls with friction also change the momentum along them
        slower = np.stack([v[0] + np.array([1.0, 0.0]), v[1]])
        parts |= {"periodic": periodic, "parameters": {"contact": {"restitution": 0.9}}}
        run = written(tmp_path / "slower.h5", 0 * slower, slower, **parts)
        assert not equilibrium.comoving(run).any()


def test_disks_that_may_slip_may_lose_energy():
    rough = {"tangential_restitution": 1.0, "inertia": 0.5}
    for contact, there in ((rough, False), (rough | {"friction": 0.3}, True)):
        parts = {"contact": contact}, np.ones(9), np.ones(9)
        assert ("inelastic" in nature_of(*parts, lost=0.0, turning=True, collapsed=False)) == there


def test_error_bars_are_counted_that_hold_the_truth(tmp_path, rng):
    """The pressure of twelve gases is uncorrelated in time, as the naive errors assume."""
    runs = []
    for k in range(12):
        v, time = np.full((2, 100, 2), 1.0 + k / 1e6), np.arange(401.0)
        virial = np.append(0, np.cumsum(300 + 30 * rng.normal(size=400)))
        observables = {"virial": virial, "collisions": (500 * time).astype(int)}
        observables |= {name: np.zeros((401, 4)) for name in ("side_collisions", "side_impulse")}
        more = {"observables": observables, "observable_time": time, "time": [0, 400]}
        runs.append(write_run(tmp_path / f"{k}.h5", v, v, **more))
    (row,) = drawn(tmp_path, "coverage", *runs)
    assert float(row["error"]) == pytest.approx(float(row["naive_error"]), rel=0.3)
    assert float(row["naive_error"]) == pytest.approx(float(row["scatter"]), rel=0.6)
    assert 30 < float(row["within_%"]) < 95


def test_melting_has_a_curve_for_each_number_of_disks(tmp_path):
    """P* is 4 eta Z / pi."""
    run = steady(tmp_path / "equal.h5", PERIODIC)
    (row,), _ = melting.table([run], None)
    kt = td.kt_at_start(run)
    assert row["P"] == pytest.approx((100 * kt + 300 / 2) * 0.02**2 / kt, rel=1e-5)
    axes = melting.draw([row, {**row, "N": 400}], [run]).axes[0]
    assert {"N = 100", "N = 400"} < set(axes.get_legend_handles_labels()[1])


# --- gases of mixed features ---

#: Kinds of driving, with the variables of each.
KICKS = {
    "brownian": "temperature = {}",
    "andersen": "temperature = {} fraction = 0.3",
    "noise": "strength = 0.1",
    "active": "self_propulsion_speed = 0.1 rotational_diffusion = 0.1 temperature = {}",
}


class DrawnGas(NamedTuple):
    """A gas with random features (heated, driven, rough, ...), and its known properties."""

    text: str
    plain: str  # equal masses, smooth, elastic and undriven, with the same Z
    settles: bool  # whether it reaches equilibrium
    fluid: bool  # whether its pressure is uniform
    rough: bool
    kept: np.ndarray  # (2,) axes along which the momentum is kept, if nothing heats
    kt: float | None  # of what heats


def drawn_gas(rng) -> DrawnGas:
    """Return a gas of two species in a random kind of box, with random features."""
    maybe = lambda share: bool(rng.random() < share)  # noqa: E731
    sides, count = rng.choice(["wall", "periodic"], 2), rng.integers(12, 30, 2)
    radius, mass = np.array([1.0, rng.choice([1.0, 1.5])]), rng.choice([1.0, 3.0, 10.0], 2)
    area = np.sum(count * np.pi * radius**2) / rng.uniform(0.08, 0.3)
    box = np.sqrt(area * np.array([1, 1 / rng.uniform(1, 1.6)]))
    start, bath = rng.uniform(0.3, 4, 2)
    free_time = np.sqrt(area / count.sum() / bath)
    xi, beta = 1 - 0.1 * maybe(0.1), rng.choice([-1, 1, 0.3], p=[0.6, 0.35, 0.05])
    groups, baths, driven, heated = [], [], False, maybe(0.4)
    for names, kind in zip((("left", "right"), ("bottom", "top")), sides, strict=True):
        for name in names if kind == "wall" else ():
            if heated and maybe(0.8):
                baths.append(bath * (1 + maybe(0.05)))
                groups.append(f"&side name = '{name}' temperature = {baths[-1]} /")
            elif maybe(0.03):
                driven = True
                groups.append(f"&side name = '{name}' motion = 'sine' amplitude = 0.1 period = 1 /")
    kind = rng.choice([*KICKS, "none"], p=[0.2, 0.2, 0.05, 0.05, 0.5])
    if kind != "none":
        kt, step = bath * (1 + maybe(0.1)), free_time * rng.uniform(0.05, 0.5)
        whose = "" if kind == "noise" or maybe(0.7) else " species = 'species1'"
        words = KICKS[kind].format(kt) + whose
        groups.append(f"&drive kind = '{kind}' interval = {step} {words} /")
        driven |= kind in ("noise", "active")
        baths += [kt] if kind in ("brownian", "andersen") else []
    falls, sheared = sides[1] == "wall" and maybe(0.15), set(sides) == {"periodic"} and maybe(0.15)
    obstructed = not sheared and maybe(0.08)
    groups += ["&obstacle centre = 1, 1 radius = 0.5 /"] * obstructed
    pull = f"gravity = 0, {-rng.uniform(0.1, 1) * start / box[1]}" if falls else ""
    pull += f" shear_rate = {0.3 / free_time}" if sheared else ""
    cadence = rng.choice(["collisions_per_disk = 1", f"time = {free_time / 2}"])

    def text(length, mass, *more):
        kinds = (
            f"&species count = {n} radius = {r} mass = {m} temperature = {start} /"
            for n, r, m in zip(count, radius, mass, strict=True)
        )
        box_of = f"&box upper = {box[0]}, {box[1]} boundary = '{sides[0]}', '{sides[1]}'"
        stop = f"&stop collisions_per_disk = {length} time = {length * free_time} /"
        first = f"&run seed = {rng.integers(10**6)} / {box_of} {' '.join(more[:1])} /"
        return "\n".join([first, *kinds, *more[1:], stop, f"&output observables_every_{cadence} /"])

    rule = rng.choice(["velocity", "normal"])
    law = f"&contact restitution = {xi} wall_restitution = 1 tangential_restitution = {beta}"
    law += f" wall_rule = '{rule}'"
    law += f" contact_time = {free_time / 100} /" if xi < 1 or abs(beta) < 1 else " /"
    settles = xi == 1 and abs(beta) == 1 and not (driven or sheared) and len(set(baths)) < 2
    kept = (sides == "periodic") & [True, not falls] & (not obstructed)
    if beta > -1 and rule == "normal":  # rough sides
        kept &= kept[::-1]
    fluid = settles and not (falls or obstructed)
    texts = text(400, mass, pull, law, *groups), text(800, (1, 1))
    return DrawnGas(*texts, settles, fluid, beta > -1, kept, baths[0] if baths else None)


def chance_of(off, *means):
    """The probability that the difference of means is larger than `off`, by Student's law.

    An error from a few slow waves has few degrees of freedom, which are combined as by Welch and
    Satterthwaite.  An exact value has no error.
    """
    known = [one for one in means if isinstance(one, statistics.SeriesMean) and one.error > 0]
    if not known:
        return 0.0
    squares = np.array([(one.error / estimates.student(one.freedom + 1)) ** 2 for one in known])
    whole = squares.sum()
    freedom = whole**2 / np.sum(squares**2 / [min(one.freedom, estimates.MANY) for one in known])
    return 2 * stdtr(freedom, -off / np.sqrt(whole))


@pytest.mark.parametrize("systems", [12, pytest.param(400, marks=pytest.mark.check)])
def test_kt_and_z_of_any_gas_are_right_or_refused(simulated, systems):
    """The kT is that of walls or driving, or follows from the energy; Z is of the undriven gas."""
    found = []
    for k in range(systems):
        known = drawn_gas(np.random.default_rng([int(os.environ.get("SEED", "1")), k]))
        run = simulated(known.text)
        for law, holds in ((td.temperature, known.settles), (td.z_ways, known.fluid)):
            with nullcontext() if holds else pytest.raises(Refused, match=str(run.path)):
                law(run)
        kt = known.kt
        if known.fluid and kt is None:  # all momenta and all spins share the energy
            still = known.kept * (run.mass @ run.velocity[0])
            energy = run.kinetic_energy(0).sum() - np.sum(still**2) / (2 * run.mass.sum())
            kt = energy / (run.n_disks * (1 + known.rough / 2) - known.kept.sum() / 2)
        pairs = [(td.temperature(run), (kt, 0))] if known.settles and kt else []
        if known.fluid:
            ways, plain = td.z_ways(run), td.z_ways(simulated(known.plain, name="plain"))
            pairs += [(ways[way], plain[way]) for way in ways]
        for one, other in pairs:
            error = np.hypot(one.error, other[1])
            off = abs(one.mean - other[0])
            likely = chance_of(off, one, other) > 2 * ndtr(-6)
            assert likely or off < 1e-9 * one.mean, (k, one, other, known.text)
            found += [off < error] if error else []
    share = 2 * estimates.ONE_SIGMA - 1
    assert abs(np.mean(found) - share) < 3 * np.sqrt(share * (1 - share) / (len(found) / 2))


def test_kicked_disks_have_the_diffusion_of_their_displacements_alone(simulated, monkeypatch):
    """With free flights of the time h, D is kT h / 2 m; velocities would yield 2 D."""
    run = simulated(
        """&box boundary = 'periodic', 'periodic' /
        &species count = 100 packing_fraction = 0.0005 temperature = 2 mass = 2 /
        &drive kind = 'brownian' interval = 0.01 temperature = 2 / &stop time = 20 /
        &output frames_every_time = 0.02 observables_every_time = 0.02 /"""
    )
    monkeypatch.setattr(correlations, "structure", lambda *_: ({}, {}))
    found = correlations.analysed([run], None)
    (d,) = found.members["D_displacement"]
    assert d.mean == pytest.approx(0.01 / 2, abs=4 * d.error + 0.0001)
    assert not any(name.startswith("D_velocities") for name in (*found.members, *found.curves))


# --- free paths ---


def test_free_paths_weigh_each_flight_once_however_often_frames_meet_it(tmp_path):
    """One disk has free times 1, 1, 4, 1, 1, 4, ...; another one does not collide."""
    hits = np.cumsum(np.tile([1.0, 1.0, 4.0], 40))
    time = np.linspace(0.05, hits[-1] - 0.05, 2400)
    v = np.tile([[0.5, 0.0], [1.0, 0.0]], (len(time), 1, 1))
    collisions = {"collisions": np.zeros(len(time), int)}
    run = written(tmp_path / "run.h5", 0 * v, v, time=time, observables=collisions)
    zero = np.zeros(len(hits), int)
    run.__dict__["_event_log"] = EventLog(hits, zero + 1, zero, zero + 1.0)
    path, weight = rates.free_paths(run, skip=0)
    assert set(np.round(path, 9)) == {0.5, 2.0}
    assert np.sum(weight[path > 1]) / np.sum(weight) == pytest.approx(1 / 3, rel=0.02)


def test_free_paths_scatter_as_their_errors_say(monkeypatch, rng):
    """Errors from several runs and from blocks of one run, with 4000 independent paths per run."""
    monkeypatch.setattr(
        rates, "free_paths", lambda run, skip: (rng.exponential(2.0, 4000), np.ones(4000))
    )
    monkeypatch.setattr(rates.td, "has_log", lambda run: True)
    for runs, samples in ((1, 4000), (50, 200000)):
        mean, density = rates.mean_and_density([None] * runs)
        assert abs(mean.mean - 2) < 4 * mean.error
        assert mean.error == pytest.approx(2 / np.sqrt(samples), rel=0.9 if runs == 1 else 0.4)
        law = np.diff(np.exp(-rates.BINS)) / np.diff(rates.BINS)
        off = (density.mean + law)[:16] / density.error[:16]
        assert np.mean(np.abs(off) < 3) > 0.8


# --- the scripts, on runs of the program ---

RUNS = (
    ("species.disks.packing_fraction=0.05",),
    ("species.disks.packing_fraction=0.3",),
    ("species.disks.packing_fraction=0.02", "contact.restitution=0.9"),
)


@pytest.fixture
def bulk(simulated):
    """Simulate small gases at two packing fractions and a cooling gas."""
    settings = ["species.disks.count=100", "stop.collisions_per_disk=60"]
    settings += ["output.frames_every_time=0.02", "output.observables_every_collisions=25"]
    settings += ["output.event_log=true"]
    system = ROOT / "input" / "bulk.nml"
    each = enumerate(RUNS)
    return [simulated(system, *settings, *more, name=f"{k}").path for k, more in each]


def test_diffusion_of_a_gas_is_found_twice_and_near_that_of_enskog(bulk, tmp_path):
    rows = {row["what"]: row for row in drawn(tmp_path, "correlations", *bulk[:1])}
    both = [rows[f"D_{way}"] for way in ("displacement", "velocities")]
    one, other = (float(row["y"]) for row in both)
    error, run = float(both[0]["error"]), read_run(bulk[0])
    assert 0 < error < 0.3 * one and one == pytest.approx(other, abs=error)
    assert one == pytest.approx(tp.enskog_of(run)["D"], abs=4 * error + 0.1 * one)
    assert {"vacf", "msd", "g", "S", "g6", "psi6_local", "psi6_global"} <= set(rows)
    twice = correlations.analysed([run, run], None)
    for name in ("vacf", "msd", "a2", "g", "S", "D_velocities(t)", "D_displacement(t)"):
        assert np.all(twice.curves[name].error == 0), name
    alone = correlations.analysed([run], None)
    lag, _, error = alone.curves["vacf"]
    known = lag < 0.1 * lag[-1]
    assert np.all(error[known] > 0) and np.isnan(error[-1]), "up to an eighth of the run"


def test_rates_of_a_gas_agree_with_each_other(bulk, tmp_path):
    run = read_run(bulk[0])
    found = td.rates(run)
    per_disk, pairs = found["collisions_per_disk_and_time"], found["w_disks_disks"]
    assert pairs.mean == pytest.approx(per_disk.mean, rel=0.02)
    assert pairs.mean == pytest.approx(run.collisions_per_disk.value[-1] / run.time[-1], rel=0.1)
    (mean, error), (density, _) = rates.mean_and_density([run])
    assert 0 < error < 0.03 * mean
    speed = np.mean(run.speed(slice(None)))
    assert mean == pytest.approx(speed / per_disk.mean, rel=0.03)
    assert np.sum(density * np.diff(rates.BINS)) == pytest.approx(1, abs=0.02)
    points = [row for row in drawn(tmp_path, "rates", *bulk[:1]) if row["x"]]
    names = [row["quantity"] for row in points]
    assert names.count("free_path_density") == len(rates.BINS) - 1
    assert names.count("pressure_virial(t)") > 10


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


HAFF = "smooth disks that only cool"


@pytest.mark.parametrize(
    ("script", "unlike", "words"),
    [
        ("haff", {"contact": {"restitution": 0.9, "tangential_restitution": 0.0}}, HAFF),
        ("haff", {"box": {"shear_rate": 1.0}}, HAFF),
        ("haff", {"drive": {"kind": "noise", "strength": 1.0}}, HAFF),
        ("haff", {"side/top": {"temperature": 1.0}}, HAFF),
        ("haff", {"contact": {"restitution": 1.0}}, "does not cool"),
        ("haff", {"walled": True}, "has walls"),
        ("haff", {"speed": 0.0}, "at rest"),
        ("rough", {}, "has smooth disks"),
        ("cooling", {"side/top": {"temperature": 1.0}}, "is not a freely cooling"),
        ("cooling", {"speed": 0.0}, "at rest"),
        ("crater", {"box": {"gravity": [0.0, -1.0]}}, "that is at rest"),
    ],
)
def test_runs_that_a_law_is_not_for_are_refused(tmp_path, capsys, script, unlike, words):
    """The runs differ in one feature from a gas that cools in a periodic box."""
    speed, walled = unlike.pop("speed", 1.0), unlike.pop("walled", False)
    groups = {"contact": {"restitution": 0.9}, **unlike}
    v, time = speed * np.ones((2, 4, 2)), np.array([0.0, 1.0])
    energy = {f"{name}/kinetic_energy": speed**2 * np.array([1.0, 0.9]) for name in ("all", "disk")}
    more = {"observables": {"collisions": [0, 4], **energy}, "periodic": (not walled, True)}
    path = write_run(tmp_path / "a.h5", 0 * v, v, time=time, parameters=groups, **more)
    assert run_script(script, path, "-o", tmp_path / "a.png") == 1
    said = capsys.readouterr().err
    assert words in said and said.startswith(f"{script}.py: {path}: ") and said.count("\n") == 1


def test_driven_runs_are_told_apart_by_all_but_their_seed(simulated):
    text = """&box boundary = 'wall', 'wall' gravity = 0, -1 /
    &side name = 'bottom' motion = 'sawtooth' velocity = 0.1 / &wall from = 0.5, 0 to = 0.5, 0.3 /
    &species count = 9 radius = 0.02 temperature = 1 /
    &contact restitution = 0.9 wall_restitution = 1 wall_rule = 'normal' /
    &drive kind = 'noise' strength = 1 interval = 0.1 / &stop time = 1 /"""
    changes = {
        **{"a": "run.seed=1", "b": "run.seed=2", "c": "side.bottom.velocity=0.2"},
        **{"d": "drive.strength=2", "e": "contact.restitution=0.8"},
    }
    runs = [simulated(text, change, name=name) for name, change in changes.items()]
    groups = driven.by_input(runs)
    found = [[run.path.stem for run in group] for group in groups.values()]
    assert found == [["a", "b"], ["c"], ["d"], ["e"]]
    assert list(groups)[1] == "ξ = 0.9, bottom velocity = 0.2, drive strength = 1"
    v, kt = runs[0].velocity[0], driven.temperature(runs[0])[""][1][0]
    assert kt == pytest.approx(np.sum((v - v.mean(axis=0)) ** 2) / 2 / (9 - 1))
    expected = theory.demon_share(0.3 / 0.01, 9 * 0.04 / 0.46, 0.9)
    assert noise_law(runs[0]) is None, "walls take part"
    assert demon_law(runs[0]) is None, "noise takes part"
    quiet = "\n".join(line for line in text.splitlines() if "drive" not in line)
    assert demon_law(simulated(quiet + "&stop time = 1 /")) == pytest.approx(expected)


def test_a_slow_stroke_is_drawn_beside_its_adiabat(simulated, tmp_path):
    text = """&side name = 'top' motion = 'constant_velocity' velocity = 0.02
    start_time = 1 end_time = 16 /
    &species count = 100 packing_fraction = 0.3 temperature = 1 / &stop time = 17 /
    &output observables_every_time = 1 /"""
    run = simulated(text)
    (_, kt), law = driven.temperature(run)[""], temperature_law(run)
    assert law[0] == law[1] == kt[0] and law[-1] == law[-2] > 1.6 * kt[0]
    assert kt == pytest.approx(law, rel=0.05)
    rested = simulated(text, "stop.time=40", name="rested")
    (row,) = drawn(tmp_path, "driven", rested.path)
    assert row["late_error"] == "nan" == row["ratio_error"], (
        "its energy is constant after the stroke"
    )
    for change in ("contact.restitution=0.9", "box.gravity=0,-1", "side.top.motion=still"):
        words = ["velocity", "start_time", "end_time"] if "still" in change else []
        assert temperature_law(simulated(text, change, *(f"side.top.{w}=" for w in words))) is None


@pytest.mark.parametrize("across", ["wall", "periodic"])
def test_a_side_that_disks_push_is_drawn_beside_its_mean_and_deviation(simulated, tmp_path, across):
    text = f"""&box boundary = '{across}', 'wall' / &side name = 'top' motion = 'piston' mass = 5
    force = 70 / &species count = 50 packing_fraction = 0.2 speed = 1 / &stop time = 300 /
    &output observables_every_time = 0.02 /"""
    runs = [simulated(text, f"run.seed={seed}", name=f"{seed}") for seed in (1, 2, 3)]
    (row,) = drawn(tmp_path, "driven", *(run.path for run in runs), "--show", "width")
    for found in ("late", "deviation"):
        law = float(row["theory" if found == "late" else "theory_deviation"])
        assert float(row[found]) == pytest.approx(law, abs=4 * float(row[f"{found}_error"]))
        assert float(row[f"{found}_error"]) < 0.1 * float(row["deviation"])
    assert max(float(row["enthalpy_change"]), float(row["momentum_change"])) < 1e-12
    assert all(run.nature.in_equilibrium for run in runs), "their speeds settle to Maxwell's law"
    frames = simulated(text, "output.frames_every_time=0.2", name="frames")
    squares = np.sum(frames.velocity[100:] ** 2, axis=-1)
    assert np.mean(squares**2) / np.mean(squares) ** 2 == pytest.approx(2, abs=0.08)
    short = text.replace("time = 300", "time = 0.1")
    dense = ("species.packing_fraction=0.66", "species.placement=dense")
    for changes in (("contact.restitution=0.9",), ("box.gravity=0,-1",), dense):
        crushed = simulated(short, *changes, "side.top.force=7000")
        assert driven.width_law(crushed) is None, "lossy, falling, or freezing"
    with pytest.raises(Refused, match="no piston"):
        driven.width(simulated("&species count = 2 radius = 0.1 / &stop time = 1 /"))


def test_energy_is_kept_as_its_balance_says(simulated, tmp_path):
    text = """&side name = 'left' temperature = 2 / &contact restitution = 0.9 /
    &side name = 'right' motion = 'sine' amplitude = 0.2 period = 1 /
    &species count = 50 radius = 0.02 temperature = 1 / &stop time = 3 /
    &drive kind = 'noise' strength = 1 interval = 0.1 / &output observables_every_time = 0.1 /"""
    (row,) = drawn(tmp_path, "energy", simulated(text).path)
    assert row["of"] == "total + dissipated - heat - work - drive"
    assert float(row["largest_change"]) < 1e-12


def test_single_points_are_seen_and_titles_lie_over_no_words_of_a_wall(simulated):
    top = "&side name = 'top' temperature = 2 /"
    run = simulated(f"{top} &species count = 2 radius = 0.1 temperature = 1 / &stop time = 1 /")
    curves = [line for axes in energy.draw([run]).axes for line in axes.lines]
    single = [line for line in curves if len(line.get_xdata()) == 1 and line.get_alpha() is None]
    assert [line.get_marker() for line in single] == ["o", "o"]
    figure, axes = plt.subplots(figsize=(5.2, 5.7))
    trajectory.draw_paths(axes, run, [0], [0, -1])
    figure.draw_without_rendering()
    title = axes._left_title.get_window_extent()
    said = [text.get_window_extent() for text in axes.texts if text.get_text()]
    assert said and not any(map(title.overlaps, said))


def test_an_even_gas_has_no_fuller_half(rng):
    """This also holds with correlations; a lasting majority in one half is detected."""
    noise = lfilter([1], [1, -0.9], rng.normal(scale=0.02, size=(2000, 300)))
    even = np.array([fuller(0.5 + one).mean() for one in noise])
    assert even.mean() == pytest.approx(0.5, abs=4 * even.std() / np.sqrt(2000))
    assert fuller(0.1 + 0.1 * noise[0]).mean() == pytest.approx(0.9, abs=0.02)
    assert not any(map(statistics.has_trend, noise[:100])), "a memory is no drift"
    assert all(statistics.has_trend(one + np.linspace(0, 1, 300)) for one in noise[:100])


# --- transport ---

GAS = """&run seed = {seed} / &box boundary = {sides} /
&species count = {count} packing_fraction = {packing} temperature = 2 mass = 3 /
&contact restitution = {restitution} / &stop collisions_per_disk = {length} /
&output event_log = {log} helfand = {helfand} {cadence} /
"""
USUAL = {
    "seed": 1, "sides": "'periodic', 'periodic'", "count": 64, "packing": 0.1, "restitution": 1,
    "length": 400, "log": ".true.", "helfand": ".true.",
    "cadence": "frames_every_time = 0.05 observables_every_time = 0.02",
}  # fmt: skip


@pytest.fixture
def gas(simulated):
    """Write a run of a periodic gas with additional features."""
    return lambda name="gas", **unusual: simulated(GAS.format(**USUAL | unusual), name=name)


UNLIKE = "0.1 mass = {} temperature = 2 / &species name = 'b' packing_fraction = 0.1 count = {}"


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
    """With driving, thermal and moving walls and losses, the moment is the integral of the flux."""
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


def test_fluxes_that_forget_have_the_coefficient_and_the_errors_they_should():
    """The coefficient is the integral of the autocorrelation; correct errors contain it in 68 %."""
    rng, keep = np.random.default_rng(4), np.exp(-1 / 6)
    truth = (1 + keep) / (1 - keep) / 2
    found = [tp.coefficient(fluctuating(rng, 6000, 6.0), 1.0, 100) for _ in range(300)]
    mean, error = np.array([(one.mean, one.error) for one in found]).T
    assert mean.mean() == pytest.approx(truth, abs=4 * mean.std() / np.sqrt(300))
    held = np.mean(np.abs(mean - truth) < error)
    assert held == pytest.approx(2 * estimates.ONE_SIGMA - 1, abs=0.1)
    slopes = tp.running(fluctuating(np.random.default_rng(5), 400000, 6.0), 0.5, [1, 40, 80])
    assert slopes[0] == pytest.approx(1, rel=0.02)  # <flux^2> step / 2
    assert slopes[-1] == pytest.approx(2 * truth, rel=0.05)


def test_squares_allow_for_the_mean_growth_that_is_taken_away():
    """The mean square of a random walk is its number of steps, whatever the mean step."""
    moment = np.cumsum(np.random.default_rng(6).normal(2.0, 1.0, (41, 4000)), axis=0)
    moment -= np.linspace(moment[0], moment[-1], 41)
    assert tp.squares(moment, 20).mean() == pytest.approx(20, rel=0.05)


def test_coefficients_are_drawn_with_their_numbers_and_doubted(gas, tmp_path, capsys):
    runs = [gas(f"gas{k}", packing=packing).path for k, packing in enumerate((0.1, 0.3))]
    rows = drawn(tmp_path, "transport", *runs)
    means = [row for row in rows if not row["wt"]]
    coefficients = {(name, eta) for name in hd.enskog(1.5, 0.1, 1.0) for eta in (0.1, 0.3)}
    assert {(row["what"], float(row["packing"])) for row in means} == coefficients
    assert all(float(row["error"]) > 0 for row in means)
    assert all(float(row["wt"]) > 0 for row in rows if row["what"].endswith("(t)"))
    assert "before it has settled" not in capsys.readouterr().err
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


LOSSY = {"restitution": 0.9}
SOFT = {"restitution": "0.9 restitution_law = 'power' reference_speed = 9"}
WALLS = {"sides": "'wall', 'periodic'"}
FALLING = {"sides": "'periodic', 'wall' gravity = 0, -1", "helfand": ".false."}
MIXED = {"packing": UNLIKE.format(1, 9)}
ROUND = {"sides": "'wall', 'wall' / &obstacle centre = 0.5, 0.5 radius = 0.5 side = 'inside'"}
APART = {"sides": "'wall', 'wall' / &wall from = 0.5, 0 to = 0.5, 1"}
APART |= {
    "packing": MIXED["packing"].replace("/", "region = 0, 0.5, 0, 1 /") + " region = 0.5, 1, 0, 1"
}
UNEVEN = {
    "sides": "'wall', 'periodic' / &side name = 'left' temperature = 1 / "
    "&side name = 'right' temperature = 2"
}
SETTLED = ("equation_of_state", "melting", "coverage", "transport", "gravity", "equipartition")


@pytest.mark.parametrize(
    ("unusual", "refused"),
    [
        (WALLS, {"transport": "driven.py --show viscosity", "melting": "has walls"}),
        ({"helfand": ".false."}, {"transport": "output.helfand"}),
        ({"length": 12}, {"transport": "eight collisions"}),
        (
            {"cadence": "frames_every_collisions = 500 observables_every_time = 0.02"},
            {"transport": "frames_every_time"},
        ),
        (
            {"cadence": "frames_every_time = 0.05 observables_every_collisions = 64"},
            {"transport": "observables_every_time"},
        ),
        (LOSSY, dict.fromkeys(SETTLED, "not elastic") | {"rough": "equal rough disks"}),
        (LOSSY | {"log": ".false."}, {"rates": "not elastic", "correlations": "draw them"}),
        (LOSSY | MIXED, {"mixture": "not elastic"}),
        (SOFT, {"rough": "velocity-dependent", "melting": "not elastic"}),
        (SOFT | MIXED, {"haff": "is a mixture of soft disks"}),
        (
            {"seed": 2, "cadence": "frames_every_collisions = 64"},
            {"correlations": "set output.frames_every_time"},
        ),
        (ROUND | MIXED, {"mixture": "conserves angular momentum"}),
        (APART, {"mixture": "have not collided"}),
        (MIXED | {"count": 1, "packing": MIXED["packing"].replace("9", "1")}, {"mixture": "three"}),
        (UNEVEN, dict.fromkeys(SETTLED, "at different temperatures")),
        (FALLING, dict.fromkeys(("correlations", "rates", *SETTLED[:4]), "falls")),
        (MIXED, {"correlations": "not equal disks", "equation_of_state": "not equal or"}),
        (MIXED, {"melting": "disks of different mass or radius"}),
        ({}, {"equipartition": "needs ", "mixture": "needs "}),
    ],
)
def test_runs_that_a_script_is_not_for_are_refused(gas, tmp_path, capsys, unusual, refused):
    """The message is one line; scripts that compare runs also receive a suitable run."""
    path = gas(**{"length": 20} | unusual).path
    for script, said in refused.items():
        compared = script == "correlations" or unusual is MIXED
        usual = [gas("usual", length=20).path] if compared else []
        assert run_script(script, *usual, path, "-o", tmp_path / "no.png") in (1, 2)
        words = capsys.readouterr().err
        assert words.startswith(f"{script}.py: ") and words.count("\n") == 1
        assert said in words and str(path) in words


# --- fields ---

SHEARED = """&box upper = 20, 10 boundary = 'wall', 'periodic' /
&side name = 'left' temperature = 2 /
&side name = 'right' temperature = 2 surface_velocity = {speed} /
&species count = 40 radius = 0.5 temperature = 2 /
&stop time = 1600 / &output frames_every_time = 4 observables_every_time = 4 /
"""


def test_fields_are_those_of_the_disks_in_each_cell(tmp_path):
    """Two disks in the left half move together, two disks in the right half separate."""
    position = np.array([[[0.1, 0.2], [0.2, 0.8], [0.7, 0.2], [0.8, 0.8]]] * 8)
    velocity = np.array([[[1.0, 2.0], [1.0, 2.0], [3.0, 2.0], [-1.0, 2.0]]] * 8)
    run = written(tmp_path / "a.h5", position, velocity, periodic=PERIODIC, radius=0.1)
    found = {name: one.mean for name, one in fields.fields([run], None, (2, 1)).found.items()}
    assert found["density"] == pytest.approx(4)
    assert found["flow_x"] == pytest.approx(1) and found["flow_y"] == pytest.approx(2)
    assert 3 / 4 * found["temperature"] == pytest.approx([0, 2]) == found["stress_xx"] / 8
    assert found["stress_yy"] == pytest.approx(0) and found["heat_x"] == pytest.approx(0)
    leaves = {"side/top": {"motion": "piston"}}
    gone = written(tmp_path / "b.h5", position, velocity, parameters=leaves)
    with pytest.raises(RunError, match="moves away"):
        fields.fields([gone], None, (2, 1))


@pytest.mark.parametrize(
    ("cells", "shear"), [((16, 12), 0.0), ((16, 12), 0.5), ((4, 1), 0.0), ((1, 4), 0.5)]
)
def test_fields_of_few_values_have_no_bias_and_their_errors_hold(tmp_path, rng, cells, shear):
    """Random velocities and positions between walls: kT = 2 and a uniform accessible density.

    The flow, of equal disks and of the few in a cell, is no heat, and takes none.
    """
    place = rng.uniform(0.1, [3.9, 2.9], (300, 60, 2))
    v = rng.normal(size=place.shape) + shear * np.stack([place[..., 1], 0 * place[..., 1]], axis=-1)
    v *= np.sqrt(2)
    run = written(tmp_path / "a.h5", place, v, radius=0.1, edges=(4, 3))
    own = fields.fields([run], None, cells)
    even = {"density": 60 / (3.8 * 2.8), "temperature": 2, "flow_y": 0}
    held = []
    for name, truth in even.items():
        mean, error = own.found[name]
        held.append(np.abs(mean - truth) < error)
        off = (np.average(mean, weights=own.disks) - truth) * np.sqrt(own.disks.sum())
        assert abs(off) < 4 * max(2, truth / 2) or name == "density"
    assert np.mean(held) == pytest.approx(0.68, abs=5 * 0.47 / np.sqrt(np.size(held)))


def test_errors_of_a_flow_of_bounded_displacements_are_its_scatter(tmp_path, rng):
    """A part of each velocity is the change of a bounded displacement between two frames."""
    place = np.broadcast_to(rng.uniform(0.1, 0.9, (40, 2)), (160, 40, 2))
    found = []
    for k in range(60):
        v = 0.4 * np.diff(rng.normal(size=(161, 40, 2)), axis=0)
        v += 0.3 * rng.normal(size=place.shape)
        run = written(tmp_path / f"{k}.h5", place, v, radius=0.1)
        own = fields.fields([run], None, (2, 2)).found
        found.append([own["flow_x"], own["flow_y"]])
    mean, error = np.moveaxis(found, 2, 0)
    assert np.mean(error) < 1.15 * np.sqrt(np.mean(mean**2))
    assert np.mean(np.abs(mean) < error) == pytest.approx(0.6827, abs=0.06)


def test_cells_in_which_few_disks_were_have_no_error_of_nothing(tmp_path, rng):
    """One disk in each of two blocks determines the flow only; an empty cell has no error of 0."""
    place = np.full((32, 4, 2), 0.1)
    place[[18, 30], 3, 0] = 0.5
    run = written(tmp_path / "a.h5", place, rng.normal(size=place.shape), periodic=PERIODIC)
    own = fields.fields([run], None, (3, 1))
    assert own.disks.tolist() == [62, 2, 0] and len(own.blocks) > 3
    assert own.found["density"].mean == pytest.approx(np.array([62, 2, 0]) * 3 / 16)
    assert own.found["density"].error[2] == pytest.approx(3 / 16)
    for name in ("temperature", "stress_xx", "heat_x"):
        assert np.isfinite(own.found[name]).tolist() == [[True, False, False]] * 2


def test_a_map_of_a_round_container_is_drawn_in_it(tmp_path, rng):
    place = rng.uniform(0.3, 0.7, (16, 9, 2))
    v, held = rng.normal(size=place.shape), [((0.5, 0.5), 0.5, 1)]
    run = written(tmp_path / "a.h5", place, v, obstacles=held)
    found = fields.fields([run], None, (2, 2)).found
    flow = fields_script.flow_of(run, (2, 2), found)
    axes = fields_script.draw_grid([run], (2, 2), found, flow).axes[0]
    (shown,) = (one for one in axes.collections if isinstance(one, QuadMesh))
    assert shown.get_clip_path() and axes.patches[-1].zorder < shown.zorder


def test_the_area_that_centres_can_reach(tmp_path):
    """Strips of one radius at walls and around circles and straight walls are not accessible."""
    one = np.full((2, 1, 2), 0.5)
    parts = {"radius": 0.1, "edges": (4, 2), "obstacles": [((1.0, 1.0), 0.4, 0)]}
    parts |= {"walls": [((3.0, 1.0), (3.4, 1.0))], "periodic": (True, False)}
    run = written(tmp_path / "a.h5", one, 0 * one, **parts)
    area = fields.accessible(run, (2, 1), 0.1)
    stadium = 0.4 * 0.2 + np.pi * 0.1**2
    assert area == pytest.approx([3.6 - np.pi * 0.5**2, 3.6 - stadium], rel=2e-3)


GASES = {  # input, cells and the known kT
    "still": ("""&box upper = 40, 20 / &stop time = 200 /
        &species count = 400 radius = 0.5 temperature = 1 /""", (8, 12),
        lambda run: td.temperature(run).mean),
    "falling": ("""&box upper = 20, 60 gravity = 0, -0.1 boundary = 'periodic', 'wall' /
        &side name = 'bottom' temperature = 2 / &stop time = 800 /
        &species count = 200 radius = 0.5 temperature = 2 /""", (1, 20), lambda run: 2.0),
    "sheared": ("""&box upper = 80, 40 shear_rate = 0.1 boundary = 'periodic', 'periodic' /
        &contact restitution = 0.8 / &stop time = 400 /
        &species count = 200 radius = 0.5 temperature = 1 /""", (5, 3),
        lambda run: np.mean(run.observable("all/temperature").value[-51:])),
    "couette": ("couette.nml", (1, 20), None),
}  # fmt: skip


@pytest.mark.parametrize(
    ("gas", "seeds"),
    [*((name, 4) for name in ("still", "falling", "sheared"))]
    + [pytest.param(name, 30, marks=pytest.mark.check) for name in GASES],
)
def test_fields_of_gases_have_the_temperature_that_is_known(simulated, gas, seeds):
    """The errors of a run contain the mean of many seeds with the stated probability."""
    text, cells, truth = GASES[gas]
    output = "&output frames_every_time = 4 observables_every_time = 4 /"
    system = ROOT / "input" / text if text.endswith("nml") else f"{text}\n{output}\n"
    runs = [simulated(system, f"run.seed={k + 1}", name=f"{gas}{k}") for k in range(seeds)]
    own = [fields.fields([run], None, cells) for run in runs]
    if truth is not None:
        pairs = [(one.found["temperature"].mean, one.disks) for one in own]
        known = [np.isfinite(kt) for kt, _ in pairs]
        kt = [np.average(k[ok], weights=n[ok]) for (k, n), ok in zip(pairs, known, strict=True)]
        off = statistics.estimate(np.array(kt) / [truth(run) for run in runs])
        assert off.mean == pytest.approx(1, abs=4 * off.error)
    low, high = binom.interval(0.999, seeds, 2 * estimates.ONE_SIGMA - 1)
    for name in own[0].found if seeds > 4 else ():
        mean, error = np.moveaxis([one.found[name] for one in own], 1, 0)
        held = np.where(np.isfinite(error), np.abs(mean - np.nanmean(mean, 0)) < error, np.nan)
        assert low / seeds <= np.nanmean(held) <= high / seeds, name


def test_the_law_carries_the_fluxes_and_is_a_gas_at_rest_without(simulated):
    """The gradients times viscosity and conductivity are equal to the fluxes at the walls."""
    run, eta = simulated(SHEARED.format(speed=0)), 0.3
    flux = fields.Fluxes(4 * eta / np.pi * 2 * hd.henderson(eta), 0.0, 0.0)
    law = fields.expected(run, 0, np.linspace(1, 19, 7), flux, (0.5, 2.0))
    assert law == pytest.approx(np.tile([0.5, 2, 4 * eta / np.pi], (7, 1)))
    flux, x = fields.Fluxes(1.2, -0.05, 0.1), np.linspace(1, 19, 181)
    u, kt, density = fields.expected(run, 0, x, flux, (0.0, 2.0)).T
    eta = np.pi * density / 4
    z = hd.henderson(eta)
    assert density * kt * z == pytest.approx(1.2)
    gas = hd.enskog(z, eta, 1.0, kt)
    shear, heat = -gas["viscosity"] * np.gradient(u, x), -gas["conductivity"] * np.gradient(kt, x)
    assert shear[1:-1] == pytest.approx(-0.05, rel=1e-3)
    assert (heat + shear * u)[1:-1] == pytest.approx(0.1, rel=2e-3)


def test_a_profile_and_a_map_are_drawn_with_their_numbers(simulated, tmp_path, capsys):
    path = simulated(SHEARED.format(speed=3)).path
    rows = drawn(tmp_path, "fields", path, "--cells", "5")
    found = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    assert found["x"] == pytest.approx([2.25, 6, 10, 14, 17.75]), "middles of where centres are"
    assert np.average(found["density"], weights=[3.5, 4, 4, 4, 3.5]) == pytest.approx(40 / 190)
    assert (found["density_error"] > 0).all() and found["flow_y"][-1] > found["flow_y"][0]
    assert np.isfinite(found["flow_expected"]).all()
    assert len(drawn(tmp_path, "fields", path, "--grid", "4,2")) == 8
    soon = ("stop.time=20", "output.frames_every_time=2", "output.observables_every_time=2")
    early = simulated(ROOT / "input/fourier.nml", *soon, name="early").path
    assert "flow_expected" not in drawn(tmp_path, "fields", early)[0]
    assert "warning: no profile agrees with these fluxes" in capsys.readouterr().err
