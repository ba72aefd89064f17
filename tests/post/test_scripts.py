"""Each script of post/ is tested on synthetic runs with known results."""

import csv
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from scipy.signal import lfilter

import cost
import crater as crater_figure
import crater_scan
import equation_of_state
import equipartition
import gravity
import haff
import lorentz
import lyapunov
import missed
import mixture
import player
import scaling
import scattering
import trajectory
from ricochet import (
    RunError,
    cooling,
    crater,
    read_run,
    script,
    speed_laws,
    speeds,
    statistics,
    theory,
    thermodynamics,
)
from ricochet.figures.drawing import caption, plt, with_images
from ricochet.script import chosen_frames, distinct, frame_list, grouped
from synthetic_run import drawn, maxwell_velocities, run_script, write_run, written

TWO = statistics.student(2)  # Student's factor of the error of two runs


def refusal(capsys, script, *arguments, code=2):
    """Return the message of a script that refuses its arguments (exit code 1 if a law fails)."""
    assert run_script(script, *arguments) == code
    said = capsys.readouterr().err
    assert said.startswith(f"{script}.py: ") and said.count("\n") == 1
    return said


# --- gases ---


def gas(path, rng, count=200, frames=41, mass=1.0, **more):
    """Write a gas that relaxes from equal to Maxwellian speeds, half a collision per frame."""
    angle = rng.uniform(0, 2 * np.pi, (1, count))
    start = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    v = np.concatenate([start, maxwell_velocities(rng, frames - 1, count)])
    v *= np.sqrt(count / np.sum(v**2, axis=(1, 2)))[:, None, None]
    x = rng.uniform(0.05, 0.95, (frames, count, 2))
    energies = 0.5 * np.broadcast_to(mass, count) * np.sum(v**2, axis=2)
    observables = {"collisions": np.arange(frames) * count // 2} | {
        f"{name}/kinetic_energy": energies[:, more.get("species", np.ones(count)) == k + 1].mean(1)
        for k, name in enumerate(more.get("names", ()))
    }
    return write_run(path, x, v, mass=mass, observables=observables, **more)


def mixed(path, rng):
    """Write a gas in which half of the disks have four times the mass."""
    species = {"species": np.repeat([1, 2], 100), "names": ("a", "b")}
    return gas(path, rng, mass=np.repeat([1.0, 4.0], 100), **species)


def made_to_cool(path, rate=0.05):
    """Reduce the energy of each frame of a file by exp(-rate) relative to the previous one."""
    with h5py.File(path, "r+") as file:
        velocity, mass = file["particles/disks/velocity/value"], file["particles/disks/mass"][()]
        first = 0.5 * np.sum(mass[:, None] * velocity[0] ** 2)
        left = np.exp(-rate * np.arange(len(velocity)))
        velocity[...] = velocity[...] * np.sqrt(left)[:, None, None]
        file["observables/dissipated_energy/value"][...] = first * (1 - left)
    return path


def test_equilibrium_frames_are_late_and_apart(tmp_path, rng):
    run = read_run(gas(tmp_path / "gas.h5", rng))

    def frames(skip, apart):
        start = thermodynamics.start_of_equilibrium(run, skip)
        return thermodynamics.frames_from(run, start, apart)

    assert frames(skip=15, apart=5) == [15, 20, 25, 30, 35, 40]
    assert frames(skip=39, apart=0) == [39, 40]
    with pytest.raises(
        RunError, match="ends after 40 collisions per disk, before --equilibration 50"
    ):
        frames(skip=50, apart=5)
    hits, ends = np.full((200, 41), 3 * np.arange(41)).T, {"collisions": [0, 100 * 40]}
    v, time = maxwell_velocities(rng, 41, 200), np.arange(41.0) ** 2
    more = {"collisions": hits, "observables": ends, "observable_time": time[[0, -1]]}
    run = written(tmp_path / "frames.h5", 0 * v, v, time=time, **more)
    assert frames(skip=15, apart=5) == [15, 20, 25, 30, 35, 40], "by the collisions in the frames"


def test_reduced_speeds_do_not_know_units_and_relax_from_minus_one_half(tmp_path, rng):
    u = speeds.reduced_speeds(read_run(mixed(tmp_path / "a.h5", rng)), [5, 6])
    np.testing.assert_allclose(np.mean(u.reshape(2, 2, 100) ** 2, axis=(0, 2)), [1, 1])
    tau, a2 = speeds.relaxation(read_run(gas(tmp_path / "gas.h5", rng)))
    assert a2[0] == pytest.approx(-0.5) and np.abs(a2[1:]).max() < 0.5
    np.testing.assert_allclose(tau, np.arange(17))


@pytest.mark.parametrize("frames", [1, 40])
@pytest.mark.parametrize(("power", "exact"), [(1, np.sqrt(np.pi) / 2), (4, 2)])
def test_moments_of_speeds_hold_those_of_maxwell(rng, power, exact, frames):
    """Scaling by the sample reduces the scatter by 0.71 and 0.55; four frames share velocities."""
    held = []
    for _ in range(600):
        free = rng.exponential(size=(-(-frames // 4), 500))
        u = np.sqrt(np.repeat(free, min(frames, 4), axis=0))
        u /= np.sqrt(np.mean(u**2))
        found = speeds.moment([u], power, u.size)
        held.append(abs(found.mean - exact) < found.error)
    assert np.mean(held) == pytest.approx(0.6827, abs=0.07)


@pytest.mark.parametrize("reach", [gravity.SPEED_RANGE, gravity.HEIGHT_RANGE])
def test_errors_of_slopes_are_their_scatter_although_kt_is_measured(rng, reach):
    """The values have exponential distributions whose kT changes from block to block."""
    found = []
    for _ in range(300):
        kt = np.repeat(rng.gamma(400, 1 / 400, gravity.BLOCKS), 60)[:, None]
        values = kt * rng.exponential(size=(len(kt), 40))
        species = [gravity.Samples(1.0, 0.0, 2 * values, values, values)]
        laws = values.mean() * gravity.warmth(species)
        found.append(gravity.slope_of(values, reach, 1 / laws))
    mean, error = np.transpose(found)
    assert np.mean(np.abs(mean - mean.mean()) < error) == pytest.approx(0.6827, abs=0.07)
    assert np.mean(error) == pytest.approx(1.06 * np.std(mean), rel=0.12)


@pytest.mark.parametrize(
    ("system", "exact"),
    [
        ({}, True),
        ({"periodic": (True, True)}, True),
        ({"periodic": (True, False)}, True),
        ({"parameters": {"box": {"gravity": [0.0, -1.0]}}, "names": ("disk",)}, False),
        ({"periodic": (True, True), "mass": np.repeat([1.0, 2.0], 100)}, True),
    ],
)
def test_the_law_of_fixed_energy_is_used_only_where_it_holds(tmp_path, rng, system, exact):
    """Under gravity the kinetic energy is not conserved."""
    run = gas(tmp_path / "run.h5", rng, **system)
    drawn(tmp_path, "speeds", run)
    known = read_run(run)
    test = speed_laws.speed_test([known], [range(15, 41, 5)], known.names[0])
    assert (test.law == "fixed_energy") == exact and test.ks_p > 1e-3


@pytest.fixture
def figures(monkeypatch):
    """Collect the figures that scripts draw."""
    found, save = [], script.save
    monkeypatch.setattr(script, "save", lambda *all_of: (found.append(all_of[0]), save(*all_of)))
    return found


def test_a_gas_that_cools_is_not_called_equilibrium(tmp_path, rng, capsys, figures):
    """Each frame is scaled by its own temperature; the speeds are Maxwellian."""
    calm = gas(tmp_path / "calm.h5", rng, count=2000)
    cool = made_to_cool(gas(tmp_path / "cool.h5", rng, count=2000))
    drawn(tmp_path, "speeds", calm)
    assert "Equilibrium, many frames" in words_on(figures[0]) and capsys.readouterr().err == ""
    drawn(tmp_path, "speeds", cool)
    assert "No equilibrium" in words_on(figures[1]) and "Equilibrium" not in words_on(figures[1])
    falls = "kT falls from 0.2362 to 0.06767"  # exp(-0.75) and exp(-2) halves
    printed, said = capsys.readouterr()
    assert falls in words_on(figures[1]) and falls in said and said.count("\n") == 1
    tests = cells(printed)
    assert float(tests["KS_p"]) > 0.001 and float(tests["kT_last"]) == 0.0676676
    assert "cool.h5: differs in kind from" in refusal(capsys, "speeds", calm, cool)


def test_fewer_frames_than_asked_for_are_said(tmp_path, rng, capsys):
    path = gas(tmp_path / "a.h5", rng)
    for frames, words in (("10:30", "takes 3 of 20 frames, from t = 15"), ("3", "none of the fr")):
        drawn(tmp_path, "speeds", path, "--frames", frames)
        assert f"warning: a.h5: {words}" in capsys.readouterr().err


def cells(printed):
    """Return the row of a printed table as a dictionary."""
    header, row, _ = (line.split() for line in printed.splitlines())
    return dict(zip(header, row, strict=True))


@pytest.mark.parametrize("drift", [0.0, 0.02])
def test_a_sheared_gas_is_steady_relative_to_its_flow(tmp_path, rng, capsys, figures, drift):
    """The kT is 0.5 in a flow with ten times this energy, or with a drift."""
    sides = {"periodic": (True, True), "observable_time": np.arange(121.0)}
    box = {"box": {"shear_rate": 10.0}, "contact": {"restitution": 0.9}}
    path = gas(tmp_path / "a.h5", rng, count=1000, frames=121, parameters=box, **sides)
    with h5py.File(made_to_cool(path, -drift), "r+") as file:
        velocity, y = (file[f"particles/disks/{name}/value"] for name in ("velocity", "position"))
        velocity[...] += 10 * y[..., 1:] * [1, 0]
    drawn(tmp_path, "speeds", path, "--equilibration", 20)
    printed, said = capsys.readouterr()
    row, words = cells(printed), words_on(figures[0])
    if drift:
        assert "No steady kT yet" in words and "has no steady kT yet; kT goes from" in said
    else:
        assert float(row["kT"]) == pytest.approx(0.5, rel=0.01) and said == ""
        assert "Steady state" in words and "energy" not in words


def test_speeds_of_few_disks_or_at_rest_or_on_sliding_walls_are_refused(tmp_path, rng, capsys):
    slides = {"parameters": {"side/top": {"surface_velocity": 1.0}}, "names": ("disk",)}
    said = refusal(capsys, "speeds", gas(tmp_path / "a.h5", rng, **slides), code=1)
    assert "a.h5: has sliding surfaces;" in said
    for count, words in ((2, "needs at least three disks"), (3, "'disk' is at rest (kT = 0)")):
        x = np.zeros((3, count, 2))
        still = write_run(tmp_path / f"{count}.h5", x, x, observables={"collisions": [0, 0, 0]})
        assert words in refusal(capsys, "speeds", still, code=1)


def words_on(figure):
    """Return all texts of a figure in one line."""
    parts = [text.get_text() for text in figure.findobj(plt.Text)]
    return " ".join(" ".join(parts).split())


def test_mixture_has_the_means_of_maxwell(tmp_path, rng):
    mass = np.repeat([1.0, 4.0], 500)
    v = maxwell_velocities(rng, 31, 1000) / np.sqrt(mass)[:, None] * np.sqrt(1.25)
    v[0] = [1, 0]
    parts = {"mass": mass, "species": np.repeat([1, 2], 500), "names": ("light", "heavy")}
    parts["observables"] = {"collisions": np.arange(31) * 500}
    turned = (np.roll(v, k, axis=2) for k in (0, 1))
    runs = [written(tmp_path / f"{k}.h5", 0 * v, own, **parts)
            for k, own in enumerate(turned)]  # fmt: skip
    result = mixture.table(runs, [list(range(1, 31))] * 2)
    for row, kinetic, speed in zip(result, (0.5, 2.0), (1.401248, 0.700624), strict=True):
        assert row["K_start"] == kinetic and row["v_start"] == 1
        assert row["v_theory"] == pytest.approx(speed, abs=1e-6)
        assert row["K"] == pytest.approx(1.25, rel=0.02) and row["KS_p"] > 1e-3
    slow = np.repeat(maxwell_velocities(rng, 40, 1000), 10, axis=0)  # speeds that last ten frames
    parts["observables"] = {"collisions": np.arange(400) * 500}
    run = written(tmp_path / "slow.h5", 0 * slow, slow, **parts)
    each = [speed_laws.speed_test([run], [range(400)], name).independent for name in run.names]
    assert 300 < np.mean(each) / 500 * 10 < 700
    for speed, top in rng.uniform((0.1, 2), (2, 9), (20, 2)):  # a start at one speed
        bins = mixture.speed_bins(np.full(5, speed), top)
        one = np.searchsorted(bins, speed)
        assert bins[one - 1 : one + 1].mean() == pytest.approx(speed) and bins[-1] >= top


# --- cooling ---


def cooled(path, xi, decay, heavy=2.0, seed=1, points=101):
    """Write energies that decay with collisions; the heavy species is `heavy` times as hot."""
    t = np.linspace(0, 1, points) ** 2
    total, x = np.exp(-decay * t), np.zeros((1, 4, 2))
    observables = {
        "collisions": 40 * t,
        "all/kinetic_energy": 3 * total,
        "light/kinetic_energy": 6 * total / (1 + heavy),
        "heavy/kinetic_energy": 6 * heavy * total / (1 + heavy),
    }
    more = {"species": [1, 1, 2, 2], "names": ("light", "heavy"), "mass": [1, 1, 4, 4]}
    more["parameters"] = {"run": {"seed": seed}, "contact": {"restitution": xi}}
    return write_run(path, x, x, observable_time=t, observables=observables, **more)


def test_cooling_averages_over_runs_on_one_grid(tmp_path):
    """Relative energies are drawn against collisions, energies in input units against time."""
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
    path = gas(tmp_path / "gas.h5", rng, names=("all",))  # all/kinetic_energy, disks of that name
    (row, *_) = drawn(tmp_path, "cooling", path)
    assert not any("ratio" in name for name in row)


@pytest.mark.parametrize("end", [25.0, None])
def test_the_cooling_rate_is_that_of_the_homogeneous_state(rng, end):
    """The rate is three per cent above the law with a scatter of one, and half of it later."""
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


def test_the_steady_ratio_has_forgotten_its_start(monkeypatch, tmp_path):
    """Runs that follow the law start without rotation or with too much rotation."""
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


# --- scattering ---


def collision(path, b, ratio=1e6):
    """Write two frames of a light disk that is scattered by a heavy disk at rest."""
    r, v = np.array([0.1, 0.001]), np.array([1.0, 0.0])
    normal = np.array([-np.sqrt(1 - b**2), b]) if abs(b) < 1 else np.zeros(2)
    after = v - 2 * ratio / (1 + ratio) * (v @ normal) * normal
    x = [[[0.5, 0.5], [0.1, 0.5 + b * r.sum()]]] * 2
    velocities, elastic = [[[0, 0], v], [[0, 0], after]], {"contact": {"restitution": 1.0}}
    return write_run(path, x, velocities, mass=[ratio, 1], radius=r, parameters=elastic)


@pytest.mark.parametrize("b", [0.0, 0.3, -0.7, 0.99, -1.1])
def test_scattering_of_a_run(tmp_path, b):
    row = scattering.scattering(read_run(collision(tmp_path / "run.h5", b)))
    assert row["b_over_R12"] == pytest.approx(b, abs=1e-14)
    assert row["angle_degrees"] == pytest.approx(row["exact_degrees"], abs=1e-11)
    if abs(b) < 1:
        infinite = 2 * np.degrees(np.arccos(abs(b)))
        assert np.degrees(theory.scattering_angle(b)) == pytest.approx(infinite)


# --- crater ---


def impact(path, mass=25.0, speed=5.0, xi=0.5, seed=1, moved=3, left=0.1, names=True, walls=0):
    """Write a bed of 4 x 20 disks with the first `moved` disks of the top row displaced."""
    r = 0.02
    xs, ys = np.meshgrid(np.arange(20) * 0.05 + 0.025, [0.35, 0.3, 0.25, 0.2])
    first = np.concatenate([[[0.5, 0.75]], np.stack([xs.ravel(), ys.ravel()], axis=1)])
    last = first.copy()
    last[1 : 1 + moved, 1] += 1.5 * r
    last[1 + moved, 0] += 0.5 * r
    v = np.zeros((2, 81, 2))
    v[0, 0], v[1, 0] = (0, -speed), (0, -speed * np.sqrt(left))
    hit = np.zeros((2, 81), np.int32)
    hit[1, : 1 + moved + 4] = 2
    observables = {"collisions": [0, 90], "side_collisions": [[0] * 4, [0, 0, walls, 0]]}
    observables["all/kinetic_energy"] = [1.0, left]
    parameters = {"run": {"seed": seed}, "contact": {"restitution": xi}}
    parameters["stop"] = {"energy_fraction": 0.1}
    kinds = {"names": ("projectile" if names else "tip", "bed"), "mass": np.r_[mass, np.ones(80)]}
    kinds |= {"species": np.r_[1, np.full(80, 2)], "radius": np.r_[5 * r, np.full(80, r)]}
    more = {"collisions": hit, "observables": observables, "parameters": parameters, **kinds}
    return write_run(path, [first, last], v, **more)


@pytest.mark.parametrize("names", [True, False])
def test_crater_sizes(tmp_path, names):
    run = read_run(impact(tmp_path / "run.h5", names=names))
    size = crater.crater(run)
    assert (size.hit, size.displaced, size.collisions) == (7, 3, 90)
    assert size.width == pytest.approx(0.1) and size.depth == pytest.approx(0.04)
    assert size.energy_left == pytest.approx(0.1)
    none = crater.crater(read_run(impact(tmp_path / "none.h5", moved=0)))
    assert (none.displaced, none.width, none.depth) == (0, 0, 0)
    x, y, field = crater.packing_field(run, 0)
    area = field.sum() * (x[1] - x[0]) * (y[1] - y[0])
    assert area == pytest.approx(80 * np.pi * 0.02**2, rel=1e-6)


def test_figures_and_films_have_scales_and_limits_of_their_data(tmp_path, rng):
    run = read_run(impact(tmp_path / "a.h5"))
    figure = crater_figure.draw(run, crater.crater(run))
    (bar,) = [axes for axes in figure.axes if axes.get_xlabel().startswith("displacement")]
    film, _ = player.film(run, [0, 1], "displacement", [])
    assert bar.get_xlim()[1] == pytest.approx(film["scales"]["displacement"][1])
    runs = [read_run(gas(tmp_path / "b.h5", rng, count=2))]
    for eta, z in ((0.05, 1.1), (0.6, 6.5)):
        ways = {
            f"Z_{name}{part}": z for name in ("virial", "rate", "walls") for part in ("", "_error")
        }
        figure = equation_of_state.draw([{"packing": eta, "Z_reference": z, **ways}], runs)
        assert z < figure.axes[0].get_ylim()[1] < 1.3 * z
    plt.close("all")


@pytest.mark.parametrize(
    ("words", "more"),
    [
        ("", {}),
        ("reaches the floor or the sides, 3 wall hits", {"walls": 3}),
        ("30 % of the energy is left", {"left": 0.3}),
    ],
)
def test_a_crater_that_was_cut_short_is_marked(tmp_path, capsys, words, more):
    path = impact(tmp_path / "a.h5", **more)
    (row,) = drawn(tmp_path, "crater", path)
    assert int(row["box_takes_part"]) == ("walls" in more)
    assert int(row["ended_by_time"]) == ("left" in more)
    said = capsys.readouterr().err
    assert words in said and bool(said) == bool(more)


def test_every_run_of_a_grid_is_on_a_curve_or_named(tmp_path, capsys):
    """The grid has three masses, two speeds, two seeds; two runs are isolated, one of them doubled.

    Points that the box or time cut short are in no fit; the same run twice counts once.
    """
    grid = [
        impact(tmp_path / f"{m}_{v}_{s}.h5", mass=m, speed=v, seed=s, moved=m + s, walls=m // 15)
        for m in (5, 10, 15)
        for v in (2, 5)
        for s in (1, 2)
    ]
    alone = [impact(tmp_path / f"{m}_7.h5", mass=m, speed=7, xi=0.9 - m / 100) for m in (30, 40)]
    again = impact(tmp_path / "again.h5", mass=30, speed=7, xi=0.6, moved=4)
    paths = [*grid, *alone, again]
    runs = distinct([read_run(path) for path in (*paths, grid[0])])
    assert len(runs) == len(paths)
    assert f"left out, the same as another run: {grid[0]}" in capsys.readouterr().err
    points = [crater_scan.point(*one) for one in grouped(runs, crater_scan.key_of)]
    scans = crater_scan.scanned(points)
    assert [curve[0].values["speed"] for curve in scans["mass"]] == [2, 5]
    assert [curve[0].values["mass"] for curve in scans["speed"]] == [5, 10, 15]
    for own in scans.values():
        assert sum(p.runs for curve in own for p in curve) == len(grid)
    slow = scans["mass"][0]
    assert slow[1].sizes["displaced"] == (11.5, 0.5 * TWO) and slow[1].runs == 2
    assert [p.free for p in slow] == [True, True, False]
    assert crater_scan.fit_of("mass", slow, "displaced") is None, "two free points"
    three = crater_scan.fit_of("mass", [p._replace(free=True) for p in slow], "displaced")
    assert np.isnan(three.chi2), "two runs a point do not say how far they scatter"
    figure = crater_scan.draw(runs, scans)
    legends = [text.get_text() for axes in figure.axes for text in axes.get_legend().get_texts()]
    assert {"speed 2", "speed 5", "mass 5", "mass 10", "mass 15"} <= set(legends)
    assert figure.axes[0].get_title("left") == "radius 5,  restitution 0.5"
    rows = drawn(tmp_path, "crater_scan", *paths)
    assert len(rows) == 6 + 6 and {row["speed"] for row in rows} == {"2.0", "5.0"}
    assert {"hole_width", "hole_depth_error"} <= set(rows[0])
    said = capsys.readouterr().err.splitlines()
    unfitted = [line for line in said if line.startswith("warning: no fit against ")]
    assert len(unfitted) == 2, "equal notes on two curves are one"
    reason = "time or walls limit 1 of 3 points; the crater reaches"
    assert f"no fit against mass: {reason}" in unfitted[0]
    said = [line for line in said if line not in unfitted]
    for line, mass, xi, count in zip(said, (30, 40), (0.6, 0.5), (2, 1), strict=True):
        assert f"mass {mass},  speed 7,  radius 5,  restitution {xi} (runs: {count})" in line


# --- gravity ---


def falling(path, rng, temperature=0.7, frames=400, dynamics="events", drift=0.0, seed=1, hits=15):
    """Write an ideal gas in equilibrium under gravity with `hits` pair collisions per frame."""
    mass, r = np.repeat([0.025, 0.05], 30), 0.04
    height = r + rng.exponential(temperature / (mass * 9.81), (frames, 60))
    x = np.stack([rng.uniform(r, 8 - r, (frames, 60)), height], axis=-1)
    v = rng.normal(size=(frames, 60, 2)) * np.sqrt(temperature / mass)[:, None]
    k, u = 0.5 * mass * np.sum(v**2, axis=2), mass * 9.81 * x[..., 1]
    halves = {"A": slice(0, 30), "B": slice(30, 60), "all": slice(0, 60)}
    observables = {
        f"{name}/{kind}_energy": e[:, part].mean(axis=1)
        for name, part in halves.items()
        for kind, e in (("kinetic", k), ("potential", u))
    }
    time = np.linspace(0, 100, frames)
    observables |= {"collisions": hits * np.arange(frames), "total_energy": 80 * (1 + drift * time)}
    parameters = {
        "run": {"seed": seed, "dynamics": dynamics, "dt": 0.004},
        "box": {"gravity": [0.0, -9.81]},
        "contact": {"restitution": 1.0},
        "species/A": {"speed": 0.5},
        "species/B": {"speed": 0.25},
    }
    kinds = {"species": np.repeat([1, 2], 30), "names": ("A", "B"), "mass": mass, "radius": r}
    more = {"time": time, "edges": (8, 16), "observables": observables, "parameters": parameters}
    return write_run(path, x, v, **kinds, **more)


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
        return statistics.propagate_error(lambda curve: equipartition.entry(time, curve), known)

    assert found(gap, 0.005) == pytest.approx((3 + 0.1 / 0.11, 0.005 / 0.11))  # for a steep line
    for unknown in (found(gap + 1, 0.04), found(gap, 0.06), found(gap, np.nan)):
        assert np.isnan(unknown.mean)


def test_one_run_of_many_disks_has_a_thermalisation_time_with_an_error(rng):
    """Its error follows from fluctuations in equilibrium and has a coverage of 68 %."""
    time, found = np.arange(0, 40, 0.25) + 0.25, []
    kinds = [SimpleNamespace(mass=mass) for mass in (1.0, 2.0)]
    for _ in range(200):
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
    assert 0.55 < np.mean(np.abs(mean - truth) < error) < 0.85
    assert np.abs(np.median(mean) - truth) < 0.3 * truth and np.isfinite(mean).mean() > 0.9


def test_the_jackknife_error_of_the_thermalisation_time_is_the_scatter_of_groups(rng):
    """The energy difference falls below 10 % at a known time; the noise is that of 20 runs."""
    time = np.arange(0.25, 12, 0.5)
    difference, truth = np.exp(-time / 3), 3 * np.log(10)

    def crossing(both):
        return equipartition.entry(time, np.abs(both[1] / both[0] - 1))

    found = []
    for _ in range(300):
        light = 1 + 0.01 * rng.normal(size=(20, len(time)))
        heavy = 1 + difference + 0.01 * rng.normal(size=light.shape)
        found.append(equipartition.over_runs(crossing, [light, heavy]))
    mean, error = np.transpose(found)
    assert 0.56 < np.mean(np.abs(mean - truth) < error) < 0.78  # four standard deviations
    assert np.mean(error) == pytest.approx(np.std(mean), rel=0.25)
    assert abs(mean.mean() - truth) < 0.3 * np.std(mean)


def test_one_run_does_not_say_that_energies_agree(tmp_path, rng, capsys):
    """In equilibrium the energies of 30 disks pass through agreement again and again."""
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


# --- frames, paths, export, times ---


def test_frames_are_chosen_by_number_range_and_count(tmp_path, rng):
    run = read_run(gas(tmp_path / "gas.h5", rng, count=2))
    for which, count, chosen in (
        (None, 1, [0]),
        (None, 5, [0, 10, 20, 30, 40]),
        (None, 1000, list(range(41))),
        ("0,10,-1", None, [0, 10, 40]),
        ("38:", None, [38, 39, 40]),
        ("::20", None, [0, 20, 40]),
        ("-2:,0", None, [39, 40, 0]),
        ("10:21", 2, [10, 20]),
    ):
        assert chosen_frames(run, which and frame_list(which), count) == chosen
    for which, problem in (("41", "no frame 41, there are 41"), ("50:", "no such frames")):
        with pytest.raises(RunError, match=problem):
            chosen_frames(run, frame_list(which), None)


def test_disks_that_reach_across_a_periodic_side_are_drawn_on_both(tmp_path):
    x = np.array([[[0.5, 0.5], [0.005, 0.5], [0.5, 0.995], [0.995, 0.995]]])
    sides = {"radius": 0.01, "image": np.zeros((1, 4, 2), int)}
    along_x = [(1, 1.005, 0.5), (3, -0.005, 0.995)]
    along_y = [(2, 0.5, -0.005), (3, 0.995, -0.005)]
    for periodic, expected in (
        ((False, False), []),
        ((True, False), along_x),
        ((True, True), [*along_x, *along_y, (3, -0.005, -0.005)]),
    ):
        run = written(tmp_path / "run.h5", x, x, periodic=periodic, **sides)
        which, places = with_images(run, x[0])
        np.testing.assert_array_equal(which[:4], range(4))
        found = [(k, *place) for k, place in zip(which[4:], places[4:].round(9), strict=True)]
        assert sorted(found) == sorted(expected)


def test_paths_break_where_a_period_is_crossed_and_pass_corners(tmp_path):
    x, image = np.array([[[0.8, 0.5]], [[0.1, 0.5]], [[0.4, 0.5]]]), np.zeros((3, 1, 2), int)
    image[1:, 0, 0] = 1
    run = written(tmp_path / "run.h5", x, x, periodic=(True, False), image=image)
    (path,) = trajectory.paths_of(run, [0], [0, 1, 2])
    expected = [[0.8, 0.5], [1.1, 0.5], [np.nan] * 2, [-0.2, 0.5], [0.1, 0.5], [0.4, 0.5]]
    np.testing.assert_allclose(path, expected)
    corner = np.array([[0.9, 0.7], [0.5, 0.1]]), np.array([[0, 0], [1, 1]])
    path = trajectory.wrapped(*corner, np.ones(2))
    pieces = np.split(path, np.flatnonzero(np.isnan(path[:, 0])))
    assert len(pieces) == 4, "as it leaves, through two cells that it may touch, as it arrives"
    np.testing.assert_allclose(pieces[0], [[0.9, 0.7], [1.5, 1.1]])
    np.testing.assert_allclose(pieces[-1][1:], [[-0.1, -0.3], [0.5, 0.1]])


def timed(path, count=3, search="cells", **provenance):
    """Write a run with a recorded wall time."""
    x = np.zeros((1, count, 2))
    return write_run(path, x, x, parameters={"run": {"search": search}}, provenance=provenance)


def test_the_legend_of_the_cost_names_each_method_once(tmp_path):
    runs = [
        read_run(timed(tmp_path / f"{name}.h5", 9, name, collisions_per_second=1e5))
        for name in cost.LABELS
    ]
    figure = cost.draw(runs, cost.costs(runs), {}, 128, 1e4)
    texts = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert [text.partition(": ")[0] for text in texts] == [*cost.LABELS]
    assert [name for name, text in cost.LABELS.items() if text.startswith(f"{name}:")] == []
    plt.close(figure)


def test_cost_takes_the_best_of_equal_runs_and_fits_a_power(tmp_path):
    kinds = [("pairs", 20, 1e5), ("pairs", 10, 1e5), ("pairs", 10, 2e5), ("cells", 10, 1e6)]
    runs = [
        read_run(timed(tmp_path / f"{k}.h5", n, search, collisions_per_second=rate))
        for k, (search, n, rate) in enumerate(kinds)
    ]
    drawn(tmp_path, "cost", *(run.path for run in runs))
    measured = cost.costs(runs)
    np.testing.assert_allclose(measured["pairs"], [[10, 20], [5, 10]])
    np.testing.assert_allclose(measured["cells"], [[10], [1]])
    n = np.array([16, 128, 256, 512, 1024])
    measured = {"rescan": (n, np.where(n == 16, 9, 3e-3 * n**1.9)), "cells": (n[:3], n[:3])}
    laws = cost.fits(measured, 128, 1e4)
    assert laws["rescan"].exponent == pytest.approx(1.9) and "cells" not in laws
    assert laws["rescan"].factor == pytest.approx(3e-3)
    bent = cost.fits({"pairs": (n, n * np.array([1, 1, 1.1, 1, 1.1]))}, 16, 1e4)["pairs"]
    assert 0 < abs(bent.exponent - 1) < 2 * bent.exponent_error < 0.1


def test_several_cores_are_compared_with_one_by_medians(tmp_path):
    times = [(1, 12.0), (1, 10.0), (1, 20.0), (2, 6.0)]
    runs = [read_run(timed(tmp_path / f"{n}_{t}.h5", threads=n, wall_time=t)) for n, t in times]
    drawn(tmp_path, "scaling", *(run.path for run in runs))
    alone, two = scaling.table(runs)
    assert alone["runs"] == 3 and alone["seconds"] == 12 and two["gain"] == pytest.approx(2)
    with pytest.raises(RunError, match="one thread"):
        scaling.table(runs[-1:])


# --- divergence ---


def neighbours(folder, rng, pairs=3, growth=2.0, frames=81):
    """Write pairs of runs of two disks with distances 1e-12 exp(growth t) up to 0.5, t < 16."""
    time = np.linspace(0, 16, frames)
    paths = []
    for k in range(pairs):
        x = rng.uniform(size=(frames, 2, 2))
        slope = growth + 0.1 * (k - (pairs - 1) / 2)
        apart = np.minimum(1e-12 * np.exp(slope * time), 0.5)
        shifted = x + apart[:, None, None] * np.array([[0.6, 0], [0, 0.8]])
        for name, where in (("a", x), ("b", shifted)):
            paths.append(write_run(folder / f"{k}_{name}.h5", where, x, time=time))
    return paths


def test_lyapunov_finds_the_rate_of_divergence(tmp_path, rng, capsys):
    paths = neighbours(tmp_path, rng)
    runs = [read_run(path) for path in paths]
    apart = np.array([lyapunov.distance(*runs[k : k + 2]) for k in (0, 2, 4)])
    found = lyapunov.divergence(runs[0].time, apart, largest=0.01, begin=0.2)
    np.testing.assert_allclose(found.slope, [1.9, 2.0, 2.1], atol=1e-3)
    assert found.exponent.mean == pytest.approx(2, abs=1e-3)
    assert found.exponent.error == pytest.approx(statistics.student(3) * 0.1 / 3**0.5, rel=0.02)
    assert found.end == pytest.approx(10.8), "the last frame before the first pair is 0.01 apart"
    with pytest.raises(RunError, match="no fit is possible"):
        lyapunov.divergence(runs[0].time, 0 * apart, largest=0.01, begin=0.2)
    assert "3 runs: an even number" in refusal(capsys, "lyapunov", *paths[:3])


# --- tracers among scatterers ---


def tracer(path, rng, radii=(0.4, 0.4), walk=0.3, frames=20001):
    """Write a random walk in a box of two scatterers with a frame every 10 mean free times.

    With R = 0.5 and two scatterers in 2 x 2 the density n R^2 is 1/8, the mean free time 2.
    """
    step = rng.normal(scale=walk, size=(frames, 1, 2))
    place = np.cumsum(step, axis=0) + 1
    image = np.floor(place / 2).astype(np.int32)
    time = 20.0 * np.arange(frames)
    held = [((0.5, 0.5), radii[0], False), ((1.5, 1.5), radii[1], False)]
    return write_run(
        path,
        place - 2 * image,
        np.broadcast_to([0.6, 0.8], place.shape),
        time=time,
        radius=0.1,
        edges=(2.0, 2.0),
        periodic=(True, True),
        image=image,
        obstacles=held,
        observables={"obstacle_collisions": time / 2},
    )


def test_lorentz_finds_the_diffusion_of_a_random_walk(tmp_path, rng, capsys):
    paths = [tracer(tmp_path / f"{k}.h5", rng) for k in range(4)]
    runs = [read_run(path) for path in paths]
    assert lorentz.density_of(runs[0]) == 0.125
    found = [lorentz.diffusion(run, (10.0, 30.0)) for run in runs]
    exact = 0.3**2 / 2 / 20 / (3 / 16 / 0.25)  # <dx^2> / (2 t) over 3 v / (16 n R)
    mean = np.mean([one["diffusion"] for one in found])
    assert mean == pytest.approx(exact, rel=0.05)
    assert [one["free_time"] for one in found] == pytest.approx([1] * 4)
    assert lorentz.expansion(1e-9) == pytest.approx(1, abs=1e-7)
    table = tmp_path / "table.csv"
    assert run_script("lorentz", *paths, "-o", tmp_path / "a.png", "--csv", table) == 0
    capsys.readouterr()
    (row,) = csv.DictReader(table.read_text().splitlines())
    assert float(row["diffusion"]) == pytest.approx(mean) and row["runs"] == "4"
    uneven = tracer(tmp_path / "uneven.h5", rng, radii=(0.4, 0.3), frames=11)
    assert "equal circles" in refusal(capsys, "lorentz", uneven)
    short = tracer(tmp_path / "short.h5", rng, frames=11)
    assert "needs more frames" in refusal(capsys, "lorentz", short)


# --- captions, and every script draws ---


def test_captions_name_what_varies(tmp_path):
    x = np.zeros((1, 2, 2))

    def run(k, **species):
        groups = {"run": {"seed": k}, "contact": {"restitution": 1.0}, "species/disk": species}
        groups["stop"] = {"time": 1.0 + k}
        return written(tmp_path / f"{k}.h5", x, x, parameters=groups)

    same = [run(k, mass=2.0) for k in (1, 2)]
    assert caption(same) == "N = 2,  ξ = 1,  2 seeds"
    two = [*same, run(3, mass=4.0)]
    assert caption(two) == "N = 2,  ξ = 1,  mass = 2, 4,  3 seeds"
    many = [run(k, packing_fraction=k / 10, radius=k / 100) for k in range(1, 7)]
    assert caption(many) == "N = 2,  ξ = 1,  packing_fraction = 0.1 to 0.6,  6 seeds"


def test_what_is_no_number_has_its_reason(tmp_path, rng, capsys):
    drawn(tmp_path, "cooling", cooled(tmp_path / "one.h5", 0.9, 0.3))
    printed, said = capsys.readouterr()
    assert "nan" in printed and "no error of energy_left, temperature_ratio: it takes sev" in said
    drawn(tmp_path, "equipartition", falling(tmp_path / "f.h5", rng), "--within", 0)
    assert "v0 = 0.5: no T_therm; the error of the energy difference exceeds 0" in (
        capsys.readouterr().err
    )


def test_other_formats_are_written_too(tmp_path, rng):
    path = gas(tmp_path / "gas.h5", rng, frames=4)
    for ending, begin in {"pdf": b"%PDF", "svg": b"<?xml"}.items():
        assert run_script("snapshot", path, "-o", tmp_path / f"a.{ending}") == 0
        assert (tmp_path / f"a.{ending}").read_bytes().startswith(begin)


EVERY = " &output frames_every_time = 0.5 observables_every_time = 0.1 /"
NEEDY = (
    "correlations crater crater_scan equipartition gravity haff melting mixture rough scattering"
)


@pytest.mark.parametrize("script", [*NEEDY.split(), "speeds", "transport"])
def test_a_run_for_which_the_law_does_not_hold_is_refused_with_exit_1(simulated, capsys, script):
    """The runs have two equal disks between walls; errors of files and options are exit 2."""
    run = simulated("&species count = 2 radius = .05 speed = 1 / &stop time = 20 /" + EVERY)
    assert str(run.path) in refusal(capsys, script, run.path, code=1)
