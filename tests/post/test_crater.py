"""Scattering of one disk, and craters: the scripts scattering, crater and crater_scan."""

import numpy as np
import pytest

import ricochet
from ricochet.reports.grains import crater_scan
from ricochet.reports.equilibrium import equation_of_state
import player
from ricochet.reports.trajectories import scattering
from ricochet import crater, read_run, theory
from ricochet.analysis import statistics
from ricochet.figures.drawing import plt
from ricochet.reports.groups import Group, grouped
from ricochet.reports.registry import distinct
from ricochet.reports.result import Result
from sampling import held_as_often_as_stated, samples
from synthetic_gases import TWO, gas
from synthetic_run import drawn, write_run


def collision(path, b, ratio=1e6):
    """Write two frames of a light disk scattered by a heavy disk at rest."""
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
    figure = ricochet.analyse("crater", run).figure()
    bars = [axes for axes in figure.axes if axes.get_xlabel().startswith("displacement")]
    film, _ = player.film(run, [0, 1], "displacement", [])
    tops = [bar.get_xlim()[1] for bar in bars]
    assert tops == pytest.approx([film["scales"]["displacement"][1]] * 2)
    runs = [read_run(gas(tmp_path / "b.h5", rng, count=2))]
    for eta, z in ((0.05, 1.1), (0.6, 6.5)):
        ways = {
            f"Z_{name}{part}": z for name in ("virial", "rate", "walls") for part in ("", "_error")
        }
        rows = [{"packing": eta, "Z_reference": z, **ways}]
        figure = equation_of_state.draw(Result(rows, [Group(eta, runs)])).figure()
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
    """The grid has three masses, two speeds, two seeds, and two isolated runs, one of them doubled.

    Points limited by the box or by time are not fitted; a run given twice counts once.
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
    runs, warnings = distinct([read_run(path) for path in (*paths, grid[0])])
    assert len(runs) == len(paths)
    assert warnings == [f"left out, the same as another run: {grid[0]}"]
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
    assert not three.missed, "two runs a point do not say how far they scatter"
    figure = ricochet.analyse("crater_scan", runs).figure()
    legends = [text.get_text() for axes in figure.axes for text in axes.get_legend().get_texts()]
    assert {"speed 2", "speed 5", "mass 5", "mass 10", "mass 15"} <= set(legends)
    title = figure.axes[0].get_title("left") + figure.axes[0].get_title()  # in any style
    assert title == "radius 5,  restitution 0.5"
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


@pytest.mark.parametrize("beds", [(10, 10), (3600, 4000), (9000, 9000)])
def test_a_bed_that_is_too_small_is_never_answered_with_a_smaller_one(beds):
    """The bed is advised for the largest crater that reaches the box, whatever its estimate is."""
    none = statistics.Estimate(0.0, 0.0)
    values = {"mass": 40.0, "speed": 5.0, "radius": 2.0, "restitution": 0.5}
    cut = [crater_scan.Point(values, (), {}, {}, none, none, False, False, n) for n in beds]
    advised = crater_scan.larger_bed(cut, 0.1)
    assert advised >= max(*(1.5 * n for n in beds), crater.enough_disks(40, 0.5, 0.1))
    assert advised == {10: 3600, 4000: 6000, 9000: 13500}[beds[1]]
    elastic = [p._replace(values=values | {"restitution": 1.0}) for p in cut]
    assert np.isinf(crater_scan.larger_bed(elastic, 0.1))


@pytest.mark.parametrize("walls", [(0, 0, 0), (0, 0, 3)])
def test_a_scan_is_advised_a_bed_larger_than_its_own(tmp_path, walls):
    """The caption describes a line as a fit only where a power law is fitted."""
    paths = [
        impact(tmp_path / f"{m}.h5", mass=m, moved=m, walls=hits)
        for m, hits in zip((2, 4, 8), walls, strict=True)
    ]
    result = ricochet.analyse("crater_scan", paths)
    fitted = not any(walls)
    assert any("Lines: fits" in note for note in result.notes) == fitted
    drawn_lines = [line for axes in result.figure().axes for line in axes.lines]
    pale = any(line.get_alpha() and len(line.get_xdata()) > 1 for line in drawn_lines)
    assert any("Pale lines" in note for note in result.notes) == pale
    assert pale or fitted
    advice = [text for text in result.warnings if "instead of 80" in text]
    assert len(advice) == (not fitted)
    assert all(int(text.split(" disks")[0].split()[-1]) > 80 for text in advice)
    plt.close("all")


@samples(50, 500)
@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize("runs", [2, 8])
def test_exponents_hold_the_true_one_whether_points_share_beds(rng, shared, runs, samples):
    """A bed with a large crater increases the sizes at all points that share it."""
    none = statistics.Estimate(0.0, 0.0)

    def point(mass, number, beds):
        own = {"hit": mass**0.9 * beds * (1 + 0.02 * rng.normal(size=runs))}
        seeds = tuple(range(runs)) if shared else tuple(range(number * runs, (number + 1) * runs))
        mean = {"hit": statistics.estimate(own["hit"])}
        return crater_scan.Point({"mass": mass}, seeds, own, mean, none, none, False, True)

    held = []
    for _ in range(samples):
        beds = 1 + 0.1 * rng.normal(size=(6, runs))
        points = [point(2.0**k, k, beds[0 if shared else k]) for k in range(6)]
        fit = crater_scan.fit_of("mass", points, "hit")
        held.append(abs(fit.exponent - 0.9) < fit.exponent_error)
        assert not shared or fit.exponent_error < 0.04
    if samples < 500:
        assert held_as_often_as_stated(held)
    else:
        assert np.mean(held) == pytest.approx(0.6827, abs=0.075)


def test_a_gas_without_projectile_is_told_what_a_crater_requires(tmp_path, rng):
    said = "requires a species 'projectile', or one moving disk among disks at rest; here 2 disks"
    with pytest.raises(ricochet.RunError, match=said):
        crater.projectile(read_run(gas(tmp_path / "a.h5", rng, count=2)))
