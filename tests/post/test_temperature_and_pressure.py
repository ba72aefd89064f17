"""Estimators of temperature and pressure, tested on synthetic runs and on gases of the program."""

import os
from contextlib import nullcontext
from typing import NamedTuple

import numpy as np
import pytest
from scipy.special import ndtr, stdtr

from ricochet.reports.equilibrium import melting
from ricochet.reports.groups import Group
from ricochet.reports.result import Result
from gas_inputs import PERIODIC
from ricochet import equilibrium, estimates, hard_disks as hd, statistics, thermodynamics as td
from ricochet.reading.nature import Refused, nature_of
from synthetic_run import drawn, write_run, written
from validation.estimators import force, hit_rate


def steady(path, periodic, speed=1.0, radius=0.01, **parameters):
    """Write a run of 100 disks with kT = 2 speed^2 and linearly growing cumulative observables."""
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
    (row,), _ = melting.table([Group(100, [run])], None)
    kt = td.kt_at_start(run)
    assert row["P"] == pytest.approx((100 * kt + 300 / 2) * 0.02**2 / kt, rel=1e-5)
    groups = [Group(100, [run], colour="blue"), Group(400, [run], colour="red")]
    axes = melting.draw(Result([row, {**row, "N": 400}], groups)).figure().axes[0]
    assert {"N = 100", "N = 400"} < set(axes.get_legend_handles_labels()[1])


#: Kinds of driving, with the variables of each.
KICKS = {
    "brownian": "temperature = {}",
    "andersen": "temperature = {} fraction = 0.3",
    "noise": "strength = 0.1",
    "active": "self_propulsion_speed = 0.1 rotational_diffusion = 0.1 temperature = {}",
}


class DrawnGas(NamedTuple):
    """Gas with random traits (heated, driven, rough, ...), and its known properties."""

    text: str
    plain: str  # equal masses, smooth, elastic and undriven, with the same Z
    settles: bool  # whether it reaches equilibrium
    fluid: bool  # whether its pressure is uniform
    rough: bool
    kept: np.ndarray  # (2,) axes along which the momentum is conserved, if nothing heats
    kt: float | None  # of the heat bath


def drawn_gas(rng) -> DrawnGas:
    """Return a gas of two species in a random kind of box, with random traits."""
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
    """Return the probability by Student's law that the difference of means exceeds `off`.

    An error from a few slow waves has few degrees of freedom, which are combined according to Welch
    and Satterthwaite. An exact value has no error.
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
    """The kT is that of walls or driving, or given by the energy; Z is that of the undriven gas."""
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
