"""The pure functions of post/ against closed formulas, and each figure drawn once."""

import csv
import warnings

import h5py
import numpy as np
import pytest

import cooling
import cost
import crater_scan
import energy
import equipartition
import export
import gravity
import lyapunov
import missed
import mixture
import scattering
import speeds
import trajectory
from ricochet import RunError, crater, read_run, statistics, theory, thermodynamics
from ricochet.drawing import caption, plt, with_images
from ricochet.script import chosen_frames, frame_list
from synthetic_run import maxwell_velocities, run_script, text, write_run


@pytest.fixture
def rng():
    return np.random.default_rng(20)


# --- theory ---


def test_maxwell_sample_is_accepted_and_a_wrong_temperature_rejected(rng):
    u = np.linalg.norm(rng.normal(0, np.sqrt(0.5), (20000, 2)), axis=1)
    right = statistics.hold_against(u, theory.maxwell_cdf)
    wrong = statistics.hold_against(1.02 * u, theory.maxwell_cdf)
    assert right.ks_p > 0.01 and right.chi2_p > 0.01 and right.ks < 1.63 / np.sqrt(right.n)
    assert wrong.ks_p < 0.01 and wrong.chi2_p < 0.01


def test_maxwell_density_and_distribution_agree():
    u = np.linspace(0, 4, 4001)
    slope = np.gradient(theory.maxwell_cdf(u), u)
    np.testing.assert_allclose(slope[1:-1], theory.maxwell_pdf(u)[1:-1], atol=1e-6)


def test_finite_n_law_is_that_of_disks_sharing_an_energy(rng):
    energies = rng.exponential(size=(40000, 5))  # two quadratic terms each: uniform on the simplex
    energies *= 5 / energies.sum(axis=1, keepdims=True)
    u = np.sqrt(energies[:, 0])
    assert statistics.hold_against(u, theory.finite_n_cdf(5)).ks_p > 0.01
    again = statistics.hold_against(np.repeat(u, 4), theory.finite_n_cdf(5), independent=len(u))
    assert again == pytest.approx(statistics.hold_against(u, theory.finite_n_cdf(5)), rel=0.02)
    assert statistics.hold_against(u, theory.maxwell_cdf).ks_p < 0.01
    largest = np.max(np.abs(theory.finite_n_cdf(100)(u) - theory.maxwell_cdf(u)))
    assert largest == pytest.approx(0.232 / 100, rel=0.02)


def test_errors_of_a_histogram_are_its_scatter():
    """Of independent values, and of values of which each counts as four."""
    rng, bins = np.random.default_rng(3), np.linspace(0, 1, 6)
    for copies in 1, 4:
        draws = np.repeat(rng.beta(2, 3, (4000, 100)), copies, axis=1)
        heights = [statistics.binned(values, bins, independent=100) for values in draws]
        assert np.sum(heights[0].mean) / 5 == pytest.approx(1)
        scatter = np.std([height.mean for height in heights], axis=0)
        error2 = np.mean([height.error**2 for height in heights], axis=0)
        assert np.sqrt(error2) == pytest.approx(scatter, rel=0.05)


def test_finite_n_law_in_a_periodic_box(rng):
    v = rng.normal(size=(40000, 4, 2))
    v -= v.mean(axis=1, keepdims=True)
    k = np.sum(v**2, axis=2)
    u = np.sqrt(k[:, 0] / k.mean(axis=1))
    assert statistics.hold_against(u, theory.finite_n_cdf(4, periodic=True)).ks_p > 0.01
    assert statistics.hold_against(u, theory.finite_n_cdf(4)).ks_p < 0.01


@pytest.mark.parametrize(
    ("b", "infinite", "million"),
    [
        (0.0, 180, 180),
        (0.1, 168.52165904547, 168.52164764374),
        (0.5, 120, 119.99995038037),
        (0.7, 91.145991998389, 91.145934714068),
        (0.9, 51.683865526334, 51.683820571990),
        (1.0, 0, 0),
        (1.2, 0, 0),
    ],
)
def test_scattering_angle(b, infinite, million):
    assert np.degrees(theory.scattering_angle(b)) == pytest.approx(infinite, abs=1e-11)
    assert np.degrees(theory.scattering_angle(b, 1e6)) == pytest.approx(million, abs=1e-11)


def test_excess_kurtosis(rng):
    assert statistics.excess_kurtosis(np.ones(10)) == -0.5
    speed = np.linalg.norm(rng.normal(size=(200000, 2)), axis=1)
    assert statistics.excess_kurtosis(speed) == pytest.approx(0, abs=0.02)


def test_the_noise_of_the_kurtosis_is_that_of_maxwellian_speeds(rng):
    speeds_of_gases = np.sqrt(rng.exponential(size=(2000, 500)))
    found = [statistics.excess_kurtosis(speed) for speed in speeds_of_gases]
    assert np.std(found) == pytest.approx(statistics.kurtosis_noise(500), rel=0.1)


def test_errors_are_written_with_two_digits():
    assert statistics.to_error(0.0000123, 0.00031) == ("0.00001", "0.00031")
    assert statistics.to_error(-1e-9, 0.2) == ("0.00", "0.20")
    assert statistics.to_error(945.3, 12.4) == ("945", "12")
    assert statistics.to_error(0.9512, 0.00999) == ("0.951", "0.010")
    assert statistics.to_error(0.5, 0.0) == ("0.5", "0")


def test_estimate_has_the_error_of_the_mean():
    mean, error = statistics.estimate([1.0, 2.0, 3.0, 4.0])
    assert (mean, error) == (2.5, pytest.approx(np.sqrt(5 / 3 / 4)))
    assert np.isnan(statistics.estimate([1.0]).error)


def test_power_law_is_found_with_its_error(rng):
    x = np.linspace(1, 30, 10)
    pulls = []
    for _ in range(200):
        error = 0.02 * 3 * x**0.7
        fit = statistics.fit_power_law(x, 3 * x**0.7 + error * rng.normal(size=10), error)
        pulls.append((fit.exponent - 0.7) / fit.exponent_error)
    assert abs(np.mean(pulls)) < 0.3 and 0.7 < np.std(pulls) < 1.3
    assert fit.factor == pytest.approx(3, abs=4 * fit.factor_error)
    assert statistics.fit_power_law([1, 2], [1, 2], [0.1, 0.1]) is None


# --- gas and mixture ---


def gas(path, rng, count=200, frames=41, mass=1.0, **more):
    """Equal speeds at first, then Maxwell with the energy kept; half a collision per frame."""
    angle = rng.uniform(0, 2 * np.pi, (1, count))
    v = np.concatenate(
        [
            np.stack([np.cos(angle), np.sin(angle)], axis=-1),
            maxwell_velocities(rng, frames - 1, count),
        ]
    )
    v *= np.sqrt(count / np.sum(v**2, axis=(1, 2)))[:, None, None]
    x = rng.uniform(0.05, 0.95, (frames, count, 2))
    energy = 0.5 * np.broadcast_to(mass, count) * np.sum(v**2, axis=2)
    observables = {"collisions": np.arange(frames) * count // 2} | {
        f"{name}/kinetic_energy": energy[:, more.get("species", np.ones(count)) == k + 1].mean(1)
        for k, name in enumerate(more.get("names", ()))
    }
    return write_run(path, x, v, mass=mass, observables=observables, **more)


def test_equilibrium_frames_are_late_and_apart(tmp_path, rng):
    run = read_run(gas(tmp_path / "gas.h5", rng))

    def frames(skip, apart):
        start = thermodynamics.start_of_equilibrium(run, skip)
        return thermodynamics.frames_from(run, start, apart)

    assert frames(skip=15, apart=5) == [15, 20, 25, 30, 35, 40]
    assert frames(skip=39, apart=0) == [39, 40]
    with pytest.raises(RunError, match="ends after 40 collisions per disk, before --skip 50"):
        frames(skip=50, apart=5)


def test_reduced_speeds_do_not_know_units(tmp_path, rng):
    path = gas(
        tmp_path / "a.h5",
        rng,
        mass=np.repeat([1.0, 9.0], 100),
        species=np.repeat([1, 2], 100),
        names=("a", "b"),
    )
    u = speeds.reduced_speeds(read_run(path), [5, 6])
    assert u.shape == (400,)
    np.testing.assert_allclose(np.mean(u.reshape(2, 2, 100) ** 2, axis=(0, 2)), [1, 1])


def test_relaxation_starts_at_minus_one_half(tmp_path, rng):
    tau, a2 = speeds.relaxation(read_run(gas(tmp_path / "gas.h5", rng)))
    assert a2[0] == pytest.approx(-0.5) and np.abs(a2[1:]).max() < 0.5
    np.testing.assert_allclose(tau, np.arange(17))


def made_to_cool(path, rate=0.05):
    """Lets the frames of a file lose energy by exp(-rate) from one to the next."""
    with h5py.File(path, "r+") as file:
        velocity, mass = file["particles/disks/velocity/value"], file["particles/disks/mass"][()]
        energy = 0.5 * np.sum(mass[:, None] * velocity[0] ** 2)
        left = np.exp(-rate * np.arange(len(velocity)))
        velocity[...] = velocity[...] * np.sqrt(left)[:, None, None]
        file["observables/dissipated_energy/value"][...] = energy * (1 - left)
    return path


def test_a_gas_that_cools_is_not_called_equilibrium(tmp_path, rng, capsys, monkeypatch):
    """Its frames are each drawn at their own temperature, here Maxwell's."""
    figures = []
    monkeypatch.setattr("ricochet.script.save", lambda figure, *_: figures.append(figure))
    calm = gas(tmp_path / "calm.h5", rng, count=2000)
    cool = made_to_cool(gas(tmp_path / "cool.h5", rng, count=2000))
    draw("speeds", calm, "--csv", tmp_path / "calm.csv")
    assert "Equilibrium, many frames" in words_on(figures[0]) and capsys.readouterr().err == ""
    draw("speeds", cool, "--csv", tmp_path / "cool.csv")
    said = words_on(figures[1]).lower().count("equilibrium")
    assert said == words_on(figures[1]).lower().count("no equilibrium") == 2
    falls = "kT falls from 0.2362 to 0.06767"  # exp(-0.75) and exp(-2) halves
    printed, said = capsys.readouterr()
    assert falls in words_on(figures[1]) and falls in said and said.count("\n") == 1
    header, row = (line.split() for line in printed.splitlines())
    tests = dict(zip(header, row, strict=True))
    assert float(tests["KS_p"]) > 0.001 and float(tests["kT_last"]) == 0.0676676
    assert run_script("speeds", calm, cool, "-o", tmp_path / "no.png") == 2
    assert "cool.h5: loses energy" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("system", "exact"),
    [
        ({}, True),
        ({"periodic": (True, True)}, True),
        ({"periodic": (True, False)}, False),
        ({"parameters": {"box": {"gravity": [0.0, -1.0]}}, "names": ("disk",)}, False),
        ({"periodic": (True, True), "mass": np.repeat([1.0, 2.0], 100)}, False),
    ],
)
def test_the_law_of_fixed_energy_is_used_only_where_it_holds(tmp_path, rng, system, exact):
    """Gravity takes kinetic energy away and gives it back; a strip keeps one momentum of two."""
    run = gas(tmp_path / "run.h5", rng, **system)
    draw("speeds", run, "-o", tmp_path / "run.png")
    assert (speeds.exact_law(read_run(run)) is not None) == exact


def words_on(figure):
    """All texts of a figure, in one line."""
    parts = [text.get_text() for text in figure.findobj(plt.Text)]
    return " ".join(" ".join(parts).split())


@pytest.mark.parametrize("script", ["mixture", "gravity", "equipartition", "missed"])
def test_what_loses_energy_has_no_means_in_equilibrium(tmp_path, rng, capsys, script):
    for path in runs_for(script, tmp_path, rng):
        made_to_cool(path)
    assert run_script(script, *sorted(tmp_path.glob("*.h5")), "-o", tmp_path / "no.png") == 2
    said = capsys.readouterr().err
    assert "it loses energy in collisions and has no equilibrium" in said
    assert said.count("\n") == 1


def test_mixture_table(tmp_path, rng):
    mass = np.repeat([1.0, 4.0], 500)
    v = maxwell_velocities(rng, 31, 1000) / np.sqrt(mass)[:, None] * np.sqrt(1.25)
    v[0] = [1, 0]
    x = np.zeros_like(v)
    runs = [
        read_run(
            write_run(
                tmp_path / f"{k}.h5",
                x,
                np.roll(v, k, axis=2),
                mass=mass,
                species=np.repeat([1, 2], 500),
                names=("light", "heavy"),
                observables={"collisions": np.arange(31) * 500},
            )
        )
        for k in (0, 1)
    ]
    result = mixture.table(runs, [list(range(1, 31))] * 2)
    for row, kinetic, speed in zip(result, (0.5, 2.0), (1.401248, 0.700624), strict=True):
        assert row["K_start"] == kinetic and row["v_start"] == 1
        assert row["v_theory"] == pytest.approx(speed, abs=1e-6)
        assert row["K"] == pytest.approx(1.25, rel=0.02) and row["KS_p"] > 1e-3


def cooled(path, xi, decay, heavy=2.0, seed=1, points=101):
    """Energies that decay with collisions; the heavy species `heavy` times as hot."""
    t = np.linspace(0, 1, points) ** 2
    total = np.exp(-decay * t)
    x = np.zeros((1, 4, 2))
    return read_run(
        write_run(
            path,
            x,
            x,
            mass=[1, 1, 4, 4],
            species=[1, 1, 2, 2],
            names=("light", "heavy"),
            observable_time=t,
            observables={
                "collisions": 40 * t,
                "all/kinetic_energy": 3 * total,
                "light/kinetic_energy": 6 * total / (1 + heavy),
                "heavy/kinetic_energy": 6 * heavy * total / (1 + heavy),
            },
            parameters={"run": {"seed": seed}, "contact": {"restitution": xi}},
        )
    )


def test_cooling_averages_over_runs_on_one_grid(tmp_path):
    runs = [
        cooled(tmp_path / f"{k}.h5", 0.9, decay, points=p)
        for k, (decay, p) in enumerate([(1.0, 401), (2.0, 301)])
    ]
    result = cooling.cooling(runs)
    tau, curves = result.by_collisions
    assert tau[-1] == 20 and result.by_time[0][-1] == 1
    expected = (np.exp(-tau / 20) + np.exp(-tau / 10)) / 2
    np.testing.assert_allclose(curves.mean[0], expected, atol=1e-4)
    np.testing.assert_allclose(
        curves.error[0], np.abs(np.exp(-tau / 20) - np.exp(-tau / 10)) / 2, atol=1e-4
    )
    np.testing.assert_allclose(result.ratio.mean, 2)
    np.testing.assert_allclose(curves.mean[:, 0], [1, 2 / 3, 4 / 3])


def test_curves_of_cooling_share_axes_and_fill_them(tmp_path):
    groups = [(xi, [cooled(tmp_path / f"{xi}.h5", xi, 3 * (1 - xi))]) for xi in (0.8, 0.9)]
    results = [cooling.cooling(members) for _, members in groups]
    figure = cooling.draw(groups, results)
    assert len(figure.axes) == 3
    for axes in figure.axes[:2]:
        x, y = (
            np.concatenate([getattr(line, f"get_{axis}data")() for line in axes.lines])
            for axis in "xy"
        )
        low, high = np.log(axes.get_ylim())
        assert np.max(x) == axes.get_xlim()[1] and np.ptp(np.log(y)) > 0.8 * (high - low)


def test_a_gas_of_one_kind_cools_without_a_ratio(tmp_path, rng):
    path = gas(tmp_path / "gas.h5", rng, names=("all",))  # all/kinetic_energy, disks of that name
    draw("cooling", path, "-o", tmp_path / "a.png", "--csv", tmp_path / "a.csv")
    assert "ratio" not in (tmp_path / "a.csv").read_text()


def test_the_table_of_cooling_has_energies_against_time(tmp_path):
    runs = [cooled(tmp_path / f"{k}.h5", 0.9, 1.0, seed=k, points=401) for k in (1, 2)]
    columns = cooling.curves([(0.9, runs)], [cooling.cooling(runs)])
    time = columns["time_xi0.9"]
    expected = 3 * np.exp(-time)  # 3 at the start, and t is already a square
    np.testing.assert_allclose(columns["energy_all_xi0.9"], expected, rtol=1e-3)
    np.testing.assert_allclose(columns["energy_heavy_xi0.9"], expected * 4 / 3, rtol=1e-3)
    np.testing.assert_allclose(columns["energy_all_error_xi0.9"], 0, atol=1e-12)


@pytest.mark.parametrize("script", ["equipartition", "mixture"])
def test_what_compares_species_wants_several(tmp_path, rng, capsys, script):
    path = gas(tmp_path / "gas.h5", rng, names=("one",))
    assert run_script(script, path, "-o", tmp_path / "a.png") == 2
    said = capsys.readouterr().err
    assert said.startswith(f"{script}.py: {path}: needs ") and said.count("\n") == 1


def test_nine_groups_of_runs_are_nine_curves(tmp_path, rng, monkeypatch):
    """More than there are colours in the style."""
    figures, counts = [], range(10, 100, 10)
    monkeypatch.setattr("ricochet.script.save", lambda figure, *_: figures.append(figure))
    draw("speeds", *(gas(tmp_path / f"{n}.h5", rng, count=n) for n in counts))
    relaxation = figures[-1].axes[3].get_legend_handles_labels()[1]
    assert {f"N = {n}" for n in counts} <= set(relaxation)
    draw("cooling", *(cooled(tmp_path / f"{k}.h5", 1 - k / 100, 1.0).path for k in counts))
    ratios = figures[-1].axes[-1].get_legend_handles_labels()[1]
    assert {f"ξ = {k / 100:g}" for k in counts} <= set(ratios)
    draw("energy", *(falling(tmp_path / f"f{k}.h5", rng, seed=k, frames=9) for k in counts))
    assert len({line.get_color() for line in figures[-1].axes[1].lines}) == len(counts)


def test_energies_are_in_units_of_the_first_mean(tmp_path):
    kinetic = cooling.energies(cooled(tmp_path / "run.h5", 0.9, decay=5.0, points=3))
    np.testing.assert_allclose(kinetic[0], np.exp([0, -1.25, -5]))


# --- scattering ---


def collision(path, b, ratio=1e6):
    """Two frames of a light disk scattered by a heavy one at rest, by the collision rule."""
    r, v = np.array([0.1, 0.001]), np.array([1.0, 0.0])
    normal = np.array([-np.sqrt(1 - b**2), b]) if abs(b) < 1 else np.zeros(2)
    after = v - 2 * ratio / (1 + ratio) * (v @ normal) * normal
    x = [[[0.5, 0.5], [0.1, 0.5 + b * r.sum()]]] * 2
    return read_run(
        write_run(
            path,
            x,
            [[[0, 0], v], [[0, 0], after]],
            mass=[ratio, 1],
            radius=r,
            parameters={"contact": {"restitution": 1.0}},
        )
    )


@pytest.mark.parametrize("b", [0.0, 0.3, -0.7, 0.99, -1.1])
def test_scattering_of_a_run(tmp_path, b):
    result = scattering.scattering(collision(tmp_path / "run.h5", b))
    assert result.impact == pytest.approx(b, abs=1e-14) and result.mass_ratio == 1e6
    assert result.angle == pytest.approx(theory.scattering_angle(b, 1e6), abs=1e-13)


def test_the_error_panel_of_scattering_holds_every_point():
    angle = np.pi / 2 + np.array([0, 1e-9, 1e-3])
    points = [
        scattering.Scattering(b, a, 0, np.inf)
        for b, a in zip((-(0.5**0.5), 0.5**0.5, 0.5**0.5), angle, strict=True)
    ]
    top, bottom = scattering.draw(points, 1.0).axes
    low, high = bottom.get_ylim()
    drawn = bottom.lines[0].get_ydata()
    assert np.all((low < drawn) & (drawn < high)) and drawn.max() > 0.05
    assert top.get_xlim()[0] <= -1.2 and top.get_xlim()[1] >= 1.2


def test_scattering_needs_one_moving_disk(tmp_path):
    x = np.zeros((1, 2, 2))
    with pytest.raises(RunError, match="one of them at rest"):
        scattering.scattering(read_run(write_run(tmp_path / "run.h5", x, x)))


# --- crater ---


def impact(path, mass=25.0, speed=5.0, xi=0.5, seed=1, moved=3, left=0.1, names=True, walls=0):
    """A bed of 4 x 20 disks; the `moved` first ones of the upper row pushed aside."""
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
    return write_run(
        path,
        [first, last],
        v,
        mass=np.r_[mass, np.ones(80)],
        radius=np.r_[5 * r, np.full(80, r)],
        species=np.r_[1, np.full(80, 2)],
        names=("projectile" if names else "tip", "bed"),
        collisions=hit,
        observables={
            "collisions": [0, 90],
            "wall_collisions": [[0] * 4, [0, 0, walls, 0]],
            "all/kinetic_energy": [1.0, left],
        },
        parameters={
            "run": {"seed": seed},
            "contact": {"restitution": xi},
            "stop": {"energy_fraction": 0.1},
        },
    )


@pytest.mark.parametrize("names", [True, False])
def test_crater_sizes(tmp_path, names):
    size = crater.crater(read_run(impact(tmp_path / "run.h5", names=names)))
    assert (size.hit, size.displaced, size.collisions) == (7, 3, 90)
    assert size.width == pytest.approx(0.1) and size.depth == pytest.approx(0.04)
    assert size.energy_left == pytest.approx(0.1)


def test_no_crater_has_size_zero(tmp_path):
    size = crater.crater(read_run(impact(tmp_path / "run.h5", moved=0)))
    assert (size.displaced, size.width, size.depth) == (0, 0, 0)


def test_a_crater_that_was_cut_short_is_marked(tmp_path, capsys):
    """By the rule of the scan, in print and on the figure."""
    for name, words, more in (
        ("whole", "", {}),
        ("box", "reaches the floor or the sides, 3 wall hits", {"walls": 3}),
        ("time", "30 % of the energy is left", {"left": 0.3}),
    ):
        path = impact(tmp_path / f"{name}.h5", **more)
        draw("crater", path, "-o", tmp_path / f"{name}.png", "--csv", tmp_path / "a.csv")
        (row,) = csv.DictReader((tmp_path / "a.csv").open())
        assert int(row["box_takes_part"]) == ("walls" in more)
        assert int(row["ended_by_time"]) == ("left" in more)
        said = capsys.readouterr().err
        assert words in said and bool(said) == bool(more)


def test_a_scan_of_one_parameter_is_one_column_that_says_what_varies(tmp_path):
    paths = [impact(tmp_path / f"{m}.h5", mass=m, moved=m) for m in (5, 10, 15)]
    runs = [read_run(path) for path in paths]
    keys, sizes = [crater_scan.key_of(r) for r in runs], [crater.crater(r) for r in runs]
    scans = crater_scan.scanned(keys, runs, sizes)
    figure = crater_scan.draw(scans, runs)
    assert figure.axes[0].get_title("left") == "speed 5,  radius 5,  restitution 0.5"
    assert ",  1 run per point," in figure.get_suptitle()
    assert crater_scan.unused(keys, scans) == []
    assert len(figure.axes) == 2 and figure.axes[1].get_xlabel() == crater_scan.AXES["mass"]
    assert "=" not in figure.get_suptitle().split("\n")[0].split(",", 1)[1]  # but for N
    law = statistics.PowerLaw(1, 0.00012, 0, 0.00034)
    assert crater_scan.power("speed", law) == ", $\\propto v^{0.00012\\pm0.00034}$"


def test_captions_name_what_varies(tmp_path):
    x = np.zeros((1, 2, 2))

    def run(k, **species):
        groups = {"run": {"seed": k}, "contact": {"restitution": 1.0}, "species/disk": species}
        groups["stop"] = {"time": 1.0 + k}
        return read_run(write_run(tmp_path / f"{k}.h5", x, x, parameters=groups))

    same = [run(k, mass=2.0) for k in (1, 2)]
    assert caption(same) == "N = 2,  ξ = 1,  2 seeds"
    two = [*same, run(3, mass=4.0)]
    assert caption(two) == "N = 2,  ξ = 1,  mass = 2, 4,  3 seeds"
    many = [run(k, packing_fraction=k / 10, radius=k / 100) for k in range(1, 7)]
    assert caption(many) == "N = 2,  ξ = 1,  packing_fraction = 0.1 to 0.6,  6 seeds"


def test_packing_field_holds_the_area_of_the_bed(tmp_path):
    run = read_run(impact(tmp_path / "run.h5"))
    x, y, field = crater.packing_field(run, 0)
    area = field.sum() * (x[1] - x[0]) * (y[1] - y[0])
    assert area == pytest.approx(80 * np.pi * 0.02**2, rel=1e-6)
    assert np.all(field[y > 0.6] < 1e-6)


def test_scans_share_their_base(tmp_path):
    paths = [
        impact(tmp_path / f"m{m}_{s}.h5", mass=m, seed=s, moved=m // 5 + s, walls=(m == 5) * s)
        for m in (5, 10, 15, 20, 25)
        for s in (1, 2)
    ]
    paths += [
        impact(tmp_path / f"x{xi}_{s}.h5", xi=xi, seed=s, moved=5 + s, left=0.1 + (xi > 0.8) * 0.3)
        for xi in (0.5, 0.7, 0.9)
        for s in (1, 2)
    ]
    runs = crater_scan.distinct([read_run(path) for path in paths])
    assert len(runs) == len(paths) - 2, "mass 25 and xi 0.5 is the base, once per seed"
    keys, sizes = [crater_scan.key_of(r) for r in runs], [crater.crater(r) for r in runs]
    scans = crater_scan.scanned(keys, runs, sizes)
    assert list(scans) == ["mass", "restitution"] and crater_scan.unused(keys, scans) == []
    ((others, mass),), ((_, xi),) = scans.values()
    assert others == {"speed": 5, "radius": 5, "restitution": 0.5}
    assert [p.x for p in mass] == [5, 10, 15, 20, 25]
    assert mass[1].sizes["displaced"] == (3.5, 0.5) and mass[1].runs == 2
    assert [p.by_time for p in xi] == [False, False, True] == [not p.free for p in xi]
    assert [p.wall_collisions for p in mass] == [1.5, 0, 0, 0, 0]
    assert [p.free for p in mass] == [False, True, True, True, True]
    assert crater_scan.fits_of("mass", mass[:3])["displaced"] is None, "two free points"


def test_every_run_of_a_grid_is_on_a_curve_or_named(tmp_path, capsys):
    """Three masses, two speeds, two seeds; and two runs that stand alone, one of them twice."""
    grid = [
        impact(tmp_path / f"{m}_{v}_{s}.h5", mass=m, speed=v, seed=s, moved=m + s)
        for m in (5, 10, 15)
        for v in (2, 5)
        for s in (1, 2)
    ]
    alone = [impact(tmp_path / f"{m}_7.h5", mass=m, speed=7, xi=0.9 - m / 100) for m in (30, 40)]
    again = impact(tmp_path / "again.h5", mass=30, speed=7, xi=0.6, seed=2)
    runs = [read_run(path) for path in (*grid, *alone, again)]
    keys, sizes = [crater_scan.key_of(r) for r in runs], [crater.crater(r) for r in runs]
    scans = crater_scan.scanned(keys, runs, sizes)
    assert [c.others["speed"] for c in scans["mass"]] == [2, 5]
    assert [c.others["mass"] for c in scans["speed"]] == [5, 10, 15]
    for own in scans.values():
        assert sum(p.runs for curve in own for p in curve.points) == len(grid)
    figure = crater_scan.draw(scans, runs)
    assert {"speed 2", "speed 5", "mass 5", "mass 10", "mass 15"} <= set(words_in(figure))
    assert figure.axes[0].get_title("left") == "radius 5,  restitution 0.5"
    paths = [run.path for run in runs]
    draw("crater_scan", *paths, "-o", tmp_path / "a.png", "--csv", tmp_path / "a.csv")
    rows = list(csv.DictReader((tmp_path / "a.csv").open()))
    assert len(rows) == 6 + 6 and {row["speed"] for row in rows} == {"2.0", "5.0"}
    said = capsys.readouterr().err.splitlines()
    for line, mass, xi, count in zip(said, (30, 40), (0.6, 0.5), (2, 1), strict=True):
        assert f"mass {mass},  speed 7,  radius 5,  restitution {xi} (runs: {count})" in line


def words_in(figure):
    """The labels in the legends of a figure."""
    return [text.get_text() for axes in figure.axes for text in axes.get_legend().get_texts()]


def test_runs_that_differ_in_what_is_no_parameter_all_count(tmp_path):
    """Two beds with the same seed are two runs; the same run twice is one."""
    runs = [read_run(impact(tmp_path / f"{k}.h5", moved=k)) for k in (3, 4)]
    again = read_run(impact(tmp_path / "again.h5", moved=4))
    assert crater_scan.distinct([*runs, again]) == [runs[0], again]


# --- gravity ---


def test_windows_are_means():
    time = np.arange(0, 10.01, 0.1)
    middle, mean = statistics.windows(time, time, 2.0)
    np.testing.assert_allclose(middle, [1, 3, 5, 7, 9])
    np.testing.assert_allclose(mean, [0.95, 2.95, 4.95, 6.95, 8.95])


def test_thermalisation_time_ignores_a_passing_agreement():
    time = np.arange(8.0)
    gap = np.array([2, 1.05, 1.5, 1.2, 1.09, 1.0, 0.95, 1.3]) - 1

    def found(difference, error):
        known = statistics.Estimate(difference, np.full(8, error))
        return equipartition.thermalisation_time(time, known)

    assert found(gap, 0.04) == 4
    for unknown in (found(gap + 1, 0.04), found(gap, 0.06), found(gap, np.nan)):
        assert np.isnan(unknown)


def test_one_run_does_not_say_that_energies_agree(tmp_path, rng, capsys):
    """In equilibrium the energies of 30 disks pass through agreement again and again."""
    path = falling(tmp_path / "run.h5", rng)
    draw("equipartition", path, "-o", tmp_path / "a.png", "--csv", tmp_path / "a.csv")
    (row,) = csv.DictReader((tmp_path / "a.csv").open())
    assert row["T_therm"] == "nan" and "take more runs" in capsys.readouterr().err
    several = [read_run(falling(tmp_path / f"{k}.h5", rng, seed=k)) for k in range(2, 60)]
    assert equipartition.approach(several, 2, 0.1).thermalisation == 1


def falling(path, rng, temperature=0.7, frames=400, dynamics="events", drift=0.0, seed=1, hits=15):
    """An ideal gas in equilibrium in the gravity box; `hits` pair collisions per frame."""
    mass, r = np.repeat([0.025, 0.05], 30), 0.04
    x = np.stack(
        [
            rng.uniform(r, 8 - r, (frames, 60)),
            r + rng.exponential(temperature / (mass * 9.81), (frames, 60)),
        ],
        axis=-1,
    )
    v = rng.normal(size=(frames, 60, 2)) * np.sqrt(temperature / mass)[:, None]
    k, u = 0.5 * mass * np.sum(v**2, axis=2), mass * 9.81 * x[..., 1]
    halves = {"A": slice(0, 30), "B": slice(30, 60), "all": slice(0, 60)}
    observables = {
        f"{name}/{kind}_energy": e[:, part].mean(axis=1)
        for name, part in halves.items()
        for kind, e in (("kinetic", k), ("potential", u))
    }
    time = np.linspace(0, 100, frames)
    return write_run(
        path,
        x,
        v,
        time=time,
        mass=mass,
        radius=r,
        species=np.repeat([1, 2], 30),
        names=("A", "B"),
        edges=(8, 16),
        observables={
            **observables,
            "collisions": hits * np.arange(frames),
            "total_energy": 80 * (1 + drift * time),
        },
        parameters={
            "run": {"seed": seed, "dynamics": dynamics, "dt": 0.004},
            "box": {"gravity": [0.0, -9.81]},
            "contact": {"restitution": 1.0},
            "species/A": {"speed": 0.5},
            "species/B": {"speed": 0.25},
        },
    )


def test_gravity_slopes_are_those_of_the_laws(tmp_path, rng):
    run = read_run(falling(tmp_path / "run.h5", rng))
    frames = thermodynamics.frames_from(run, thermodynamics.start_of_equilibrium(run, 40))
    assert frames == list(range(80, 400))
    species = [gravity.samples(run, kind, frames) for kind in run.by_species]
    assert species[0].height.shape == (320, 30) and 0 <= species[0].height.min() < 0.01
    for row in gravity.table(run, species, 0.7):
        for kind in ("speed", "height"):
            assert row[f"{kind}_slope"] == pytest.approx(1, abs=0.06)
        assert row["K"] == pytest.approx(0.7, rel=0.03)
        assert row["K_x"] == pytest.approx(0.35, rel=0.04)


def test_slopes_are_fitted_in_the_range_that_is_asked_for(rng):
    x = np.concatenate([rng.exponential(0.5, 200000), 2 + rng.exponential(1.0, 20000)])
    assert gravity.log_slope(x, (0, 1.5)) == pytest.approx(2, rel=0.02)
    assert gravity.log_slope(x[200000:], (2, 5)) == pytest.approx(1, rel=0.03)
    grid = np.linspace(0, 20, 20001)
    assert gravity.law_slope(grid, np.exp(-grid), (1, 5), 10**5) == pytest.approx(1, rel=1e-3)


def test_disks_that_share_an_energy_have_the_mean_they_share():
    e = np.linspace(0, 84, 20001)
    density = gravity.normalised(e, gravity.sharing(e, 0.7, 60))
    assert np.trapezoid(e * density, e) == pytest.approx(0.7, rel=1e-4)
    assert gravity.sharing(np.array([85.0]), 0.7, 60) == 0


def test_crowded_disks_spread_upwards(tmp_path, rng):
    """To first order a small radius lowers the density by the area that is taken, times n."""
    run = read_run(falling(tmp_path / "run.h5", rng))
    h = np.linspace(0, 15.9, 4001)
    species = [gravity.samples(run, kind, list(range(80, 400))) for kind in run.by_species]
    points = [s._replace(radius=0.0) for s in species]
    ideal = gravity.crowded_heights(h, points, 9.81, 0.7, 8.0)
    dense = gravity.crowded_heights(h, species, 9.81, 0.7, 8.0)
    excess = np.pi * 0.08**2 / 8 * (29 * ideal[0] + 30 * ideal[1])
    expected = -excess + np.trapezoid(excess * ideal[0], h)
    np.testing.assert_allclose(dense[0] / ideal[0] - 1, expected, atol=0.006)
    assert -0.06 < dense[0][0] / ideal[0][0] - 1 < -0.04
    assert np.trapezoid(dense[1], h) == pytest.approx(1, rel=1e-12)


def test_runs_are_put_together_by_the_largest_start_speed(tmp_path, rng):
    run = read_run(falling(tmp_path / "run.h5", rng, frames=2))
    assert equipartition.start_width(run) == 0.5


def test_total_change_of_the_energy(tmp_path, rng):
    run = read_run(falling(tmp_path / "run.h5", rng, dynamics="steps", drift=1e-6))
    assert energy.total_change(run)[1][-1] == pytest.approx(1e-4)
    assert energy.method(run) == "time steps, Δt = 0.004"
    wave = np.tile([1, -1, -1, 1], 100)
    bottom = energy.draw([run]).axes[1]
    (line,) = bottom.lines  # the largest change so far, not a block of noise
    assert np.all(np.diff(line.get_ydata()) >= 0) and line.get_ydata()[-1] == pytest.approx(1e-4)
    drift, spread = energy.drift_and_spread(run.time, 0.1 * run.time + 5 * wave)
    assert drift == pytest.approx(10, rel=0.01) and spread == pytest.approx(5, rel=1e-3)


def test_missed_share_is_that_of_chords_at_random_phases(rng):
    for q in (0.1, 0.7, 1.0, 2.5):
        half = np.sqrt(1 - rng.uniform(0, 1, 10**6) ** 2)
        late = rng.uniform(0, q, 10**6) > half
        assert missed.missed_share(q) == pytest.approx(late.mean(), abs=4e-3 * q)
    assert missed.missed_share(9.99e-4) == pytest.approx(missed.missed_share(1.001e-3), rel=0.01)
    assert missed.missed_share(1 - 1e-9) == pytest.approx(missed.missed_share(1.0))
    assert missed.missed_share(0) == 0


def test_missed_collisions_of_the_gravity_box(tmp_path, rng):
    """Small steps: <q^2> / 6 with <g^2> = 3 kT / mu for every kind of pair."""
    run = read_run(falling(tmp_path / "run.h5", rng, frames=2))
    dt, s2 = 1e-4, 0.08**2
    kinds = [3 * 0.7 / mu * dt**2 / s2 / 6 for mu in (0.0125, 0.05 / 3, 0.025)]
    assert missed.missed_by_pair(dt, 0.7, 0.0125, 0.08) == pytest.approx(kinds[0], rel=1e-2)
    n_a, n_b = 435, 435
    weight = [n_a / 2 * 80**0.5, 900 / 1.5 * 60**0.5, n_b * 40**0.5]
    assert missed.expected_share(run, dt, 0.7) == pytest.approx(
        np.average(kinds, weights=weight), rel=1e-2
    )
    for step, percent in ((0.004, 6.0), (0.002, 1.36), (0.001, 0.334)):
        assert 100 * missed.expected_share(run, step, 0.73) == pytest.approx(percent, rel=3e-3)


def test_runs_with_equal_seeds_are_compared(tmp_path, rng):
    def made(seed, hits, dynamics):
        path = tmp_path / f"{dynamics}_{seed}.h5"
        return read_run(falling(path, rng, frames=50, dynamics=dynamics, seed=seed, hits=hits))

    events = [made(1, 10, "events"), made(2, 20, "events"), made(3, 40, "events")]
    steps = [made(1, 9, "steps"), made(2, 16, "steps")]
    rows = missed.compare(steps + events, 2.0)
    assert [row.dt for row in rows] == [0, 0.004] and [row.runs for row in rows] == [3, 2]
    assert rows[0].share.mean == 0 and rows[1].share.mean == pytest.approx(0.15)
    assert rows[1].share.error == pytest.approx(0.05)
    assert rows[1].rate.mean == pytest.approx(12.5 * 2 / 60 * 49 / 100)
    for runs, problem in ((steps, "event-driven"), ([events[2], steps[0]], "no seed")):
        with pytest.raises(RunError, match=problem):
            missed.compare(runs, 2.0)
    with pytest.raises(RunError, match="before --skip 20"):
        missed.compare(steps + events, 20.0)


def test_runs_by_steps_without_a_partner_are_named(tmp_path, rng, capsys):
    paths = [tmp_path / f"{name}.h5" for name in ("events1", "steps1", "steps2", "steps3")]
    for path in paths:
        dynamics, seed = path.stem[:-1], int(path.stem[-1])
        falling(path, rng, frames=50, dynamics=dynamics, seed=seed, hits=9 + seed)
    draw("missed", *paths, "--skip", 2, "-o", tmp_path / "missed.png")
    (said,) = (line for line in capsys.readouterr().err.splitlines() if "left out" in line)
    assert said.endswith(f"{paths[2]}, {paths[3]}") and str(paths[1]) not in said


def test_a_figure_of_one_pair_of_runs_says_so(tmp_path, rng):
    runs = [
        read_run(falling(tmp_path / f"{kind}.h5", rng, frames=50, dynamics=kind))
        for kind in ("events", "steps")
    ]
    (axes,) = missed.draw(runs, missed.compare(runs, 2.0)).axes
    labels = axes.get_legend_handles_labels()[1]
    assert any(label.endswith("1 pair of runs") for label in labels)


def test_equilibrium_values_are_means_after_skip(tmp_path, rng):
    runs = [read_run(falling(tmp_path / f"{k}.h5", rng, temperature=k, seed=k)) for k in (1, 3)]
    approach = equipartition.approach(runs, 10, 0.1)
    (result,) = equipartition.table([(0.5, runs)], [approach], skip=100)  # 0.5 a frame
    assert result["runs"] == 2 and result["energy"] == pytest.approx(80 / 60)
    for name, column in (("A", "K_light"), ("B", "K_heavy")):
        one, other = (run.observable(f"{name}/kinetic_energy").value[200:].mean() for run in runs)
        assert result[column] == pytest.approx((one + other) / 2)
        assert result[f"{column}_error"] == pytest.approx((other - one) / 2)


# --- frames, paths, export, cost ---


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
        run = read_run(write_run(tmp_path / "run.h5", x, x, periodic=periodic, **sides))
        which, places = with_images(run, x[0])
        np.testing.assert_array_equal(which[:4], range(4))
        found = [(k, *place) for k, place in zip(which[4:], places[4:].round(9), strict=True)]
        assert sorted(found) == sorted(expected)


def test_a_snapshot_has_one_scale_or_one_for_each_frame(tmp_path, rng, monkeypatch):
    v = maxwell_velocities(rng, 3, 50) * np.array([1, 10, 100])[:, None, None]
    path = write_run(tmp_path / "run.h5", rng.uniform(size=v.shape), v)
    figures, limits = [], {}
    monkeypatch.setattr("ricochet.script.save", lambda figure, *_: figures.append(figure))
    for name, options in {"one": (), "each": ("--per-frame",), "log": ("--log",)}.items():
        draw("snapshot", path, "--frames", ":", "--colour", "speed", *options)
        disks = (axes.collections[-1] for axes in figures[-1].axes if axes.get_title("left"))
        limits[name] = [collection.get_clim() for collection in disks]
    assert len(set(limits["one"])) == 1 == len(set(limits["log"])) and len(set(limits["each"])) == 3
    assert limits["one"][0][0] == 0 and limits["each"][0][1] < 0.03 * limits["one"][0][1]
    low, high = limits["log"][0]
    assert 0 < low < 1 and high == limits["one"][0][1]
    plt.close("all")


def test_disks_at_rest_are_seen_on_a_logarithmic_scale(tmp_path, monkeypatch):
    v = np.zeros((1, 9, 2))
    v[0, 0] = 1, 2
    path = write_run(tmp_path / "run.h5", np.full(v.shape, 0.5), v)
    figures = []
    monkeypatch.setattr("ricochet.script.save", lambda figure, *_: figures.append(figure))
    draw("snapshot", path, "--colour", "speed", "--log")
    disks = figures[0].axes[0].collections[-1]
    assert np.all(disks.to_rgba(disks.get_array())[:, 3] == 1)
    plt.close("all")


def test_paths_break_where_a_period_is_crossed(tmp_path):
    x = np.array([[[0.8, 0.5]], [[0.1, 0.5]], [[0.4, 0.5]]])
    run = read_run(
        write_run(
            tmp_path / "run.h5",
            x,
            x,
            periodic=(True, False),
            image=np.array([[[0, 0]], [[1, 0]], [[1, 0]]]),
        )
    )
    (path,) = trajectory.paths_of(run, [0], [0, 1, 2])
    cut = [np.nan, np.nan]
    np.testing.assert_allclose(
        path, [[0.8, 0.5], [1.1, 0.5], cut, [-0.2, 0.5], [0.1, 0.5], [0.4, 0.5]]
    )


def test_paths_over_a_corner_are_drawn_in_the_cell_between():
    path = trajectory.wrapped(
        np.array([[0.9, 0.7], [0.5, 0.1]]), np.array([[0, 0], [1, 1]]), np.ones(2)
    )
    pieces = np.split(path, np.flatnonzero(np.isnan(path[:, 0])))
    assert len(pieces) == 4, "as it leaves, through two cells that it may touch, as it arrives"
    np.testing.assert_allclose(pieces[0], [[0.9, 0.7], [1.5, 1.1]])
    np.testing.assert_allclose(pieces[-1][1:], [[-0.1, -0.3], [0.5, 0.1]])
    assert any(np.allclose(piece[1:], [[-0.1, 0.7], [0.5, 1.1]]) for piece in pieces)


def test_exports_keep_every_digit(tmp_path, rng):
    run = read_run(gas(tmp_path / "gas.h5", rng, count=3, frames=2, names=("a disk",)))
    lines = export.xyz_frame(run, 1).splitlines()
    assert lines[0] == "3" and 'Lattice="1.0 0 0 0 1.0 0 0 0 1"' in lines[1]
    assert "pos:R:2" in lines[1] and "Time=1.0" in lines[1] and 'pbc="F F F"' in lines[1]
    rows = np.array([line.split()[1:] for line in lines[2:]], dtype=float)
    np.testing.assert_array_equal(rows[:, :2], run.position[1])
    np.testing.assert_array_equal(rows[:, 2:4], run.velocity[1])
    table = list(csv.DictReader("".join(export.exported(run, ".csv", [0, 1])).splitlines()))
    assert len(table) == 6 and table[3]["species"] == "a disk"
    assert float(table[5]["vy"]) == run.velocity[1][2, 1]


def test_cost_takes_the_best_of_equal_runs(tmp_path):
    runs = []
    for k, (search, n, rate) in enumerate(
        [("pairs", 20, 1e5), ("pairs", 10, 1e5), ("pairs", 10, 2e5), ("cells", 10, 1e6)]
    ):
        x = np.zeros((1, n, 2))
        runs.append(
            read_run(
                write_run(
                    tmp_path / f"{k}.h5",
                    x,
                    x,
                    parameters={"run": {"search": search}},
                    provenance={"collisions_per_second": rate},
                )
            )
        )
    measured = cost.costs(runs)
    np.testing.assert_allclose(measured["pairs"], [[10, 20], [5, 10]])
    np.testing.assert_allclose(measured["cells"], [[10], [1]])


def test_cost_fits_a_power_of_n_to_many_disks():
    n = np.array([16, 128, 256, 512, 1024])
    measured = {"rescan": (n, np.where(n == 16, 9, 3e-3 * n**1.9)), "cells": (n[:3], n[:3])}
    laws = cost.fits(measured, 128, 1e4)
    assert laws["rescan"].exponent == pytest.approx(1.9) and "cells" not in laws
    assert laws["rescan"].factor == pytest.approx(3e-3)
    assert "rescan" not in cost.fits(measured, 128, 300)
    bent = cost.fits({"pairs": (n, n * np.array([1, 1, 1.1, 1, 1.1]))}, 16, 1e4)["pairs"]
    assert 0 < abs(bent.exponent - 1) < 2 * bent.exponent_error < 0.1


# --- divergence ---


def neighbours(folder, rng, pairs=3, growth=2.0, frames=81):
    """Files of pairs of runs of two disks, 1e-12 exp(growth t) apart up to 0.5, time 0 to 16."""
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


def test_lyapunov_finds_the_rate_of_divergence(tmp_path, rng):
    runs = [read_run(path) for path in neighbours(tmp_path, rng)]
    apart = np.array([lyapunov.distance(*runs[k : k + 2]) for k in (0, 2, 4)])
    found = lyapunov.divergence(runs[0].time, apart, largest=0.01, begin=0.2)
    np.testing.assert_allclose(found.slope, [1.9, 2.0, 2.1], atol=1e-3)
    assert found.exponent.mean == pytest.approx(2, abs=1e-3)
    assert found.exponent.error == pytest.approx(0.1 / 3**0.5, rel=0.02)
    assert found.end == pytest.approx(10.8), "the last frame before the first pair is 0.01 apart"
    with pytest.raises(RunError, match="nothing to fit"):
        lyapunov.divergence(runs[0].time, 0 * apart, largest=0.01, begin=0.2)


def test_lyapunov_follows_disks_through_periodic_sides(tmp_path):
    x = np.array([[[0.9, 0.5]], [[0.1, 0.5]]])
    image = np.array([[[0, 0]], [[1, 0]]])
    sides = {"periodic": (True, False), "time": [0, 1]}
    one = read_run(write_run(tmp_path / "1.h5", x, x, image=image, **sides))
    shift = np.array([0.8, 0])
    other = read_run(write_run(tmp_path / "2.h5", x + shift, x, image=0 * image, **sides))
    np.testing.assert_allclose(lyapunov.distance(one, other), [0.8, 0.2])
    later = read_run(write_run(tmp_path / "3.h5", x, x, time=[0, 2]))
    with pytest.raises(RunError, match="not the same disks at the same times"):
        lyapunov.distance(one, later)


def test_lyapunov_wants_pairs(tmp_path, rng, capsys):
    paths = neighbours(tmp_path, rng)
    assert run_script("lyapunov", *paths[:3]) == 2
    assert "3 runs: not pairs" in capsys.readouterr().err


# --- every script draws ---


def draw(script, *arguments):
    """Run a script in this process, warnings being errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert run_script(script, *arguments) == 0


def runs_for(script, folder, rng):
    """Input files and further options for a script."""
    if script in ("speeds", "snapshot"):
        options = ["--frames", "0,-1", "--quiver"] if script == "snapshot" else []
        return [gas(folder / "gas.h5", rng, parameters={"contact": {"restitution": 1.0}}), *options]
    if script == "mixture":
        return [
            gas(
                folder / f"{k}.h5",
                rng,
                mass=np.repeat([1.0, 4.0], 100),
                names=("a", "b"),
                species=np.repeat([1, 2], 100),
            )
            for k in range(2)
        ]
    if script == "cooling":
        return [
            cooled(folder / f"{xi}_{s}.h5", xi, 3 * (1 - xi), seed=s).path
            for xi in (0.8, 0.9, 1.0)
            for s in (1, 2)
        ]
    if script == "scattering":
        return [collision(folder / f"{b}.h5", b).path for b in (-0.5, 0, 0.5, 1.1)]
    if script == "crater":
        return [impact(folder / "run.h5", moved=9)]
    if script == "crater_scan":
        return [
            impact(folder / f"{m}_{s}.h5", mass=m, seed=s, moved=3 + s + m // 5)
            for m in (5, 10, 15, 25)
            for s in (1, 2)
        ]
    if script == "trajectory":
        return [gas(folder / "gas.h5", rng, count=3, obstacles=[((0.5, 0.5), 0.5, 1)])]
    if script == "lyapunov":
        return neighbours(folder, rng)
    if script == "missed":
        return [
            falling(
                folder / f"{dynamics}_{k}.h5", rng, dynamics=dynamics, seed=k, hits=10 - k * step
            )
            for step, dynamics in enumerate(("events", "steps"))
            for k in (1, 2)
        ]
    if script == "cost":
        x = np.zeros((1, 3, 2))
        return [
            write_run(
                folder / "run.h5",
                x,
                x,
                parameters={"run": {"search": "cells"}},
                provenance={"collisions_per_second": 1e6, "git_commit": text("abc")},
            )
        ]
    return [falling(folder / "run.h5", rng)]


@pytest.mark.parametrize(
    "script",
    [
        "speeds",
        "snapshot",
        "mixture",
        "cooling",
        "scattering",
        "crater",
        "crater_scan",
        "energy",
        "equipartition",
        "gravity",
        "missed",
        "trajectory",
        "cost",
        "lyapunov",
    ],
)
def test_script_draws_and_tabulates(tmp_path, rng, script, capsys):
    arguments = runs_for(script, tmp_path, rng)
    figure, table = tmp_path / "deep" / "figure.png", tmp_path / "new" / "a.csv"
    draw(script, *arguments, "-o", figure, "--csv", table)
    data = figure.read_bytes()
    assert data.startswith(b"\x89PNG") and len(data) > 10000
    assert b"ricochet" in data[:3000], "the source stands in the metadata"
    rows = list(csv.reader(table.open()))
    assert len(rows) > 1 and len({len(row) for row in rows}) == 1
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) > 1 and len(printed[0]) == len(printed[1]) > 10, "a table"


def test_what_is_no_number_has_its_reason(tmp_path, rng, capsys):
    draw("cooling", cooled(tmp_path / "one.h5", 0.9, 0.3).path, "-o", tmp_path / "a.png")
    printed, said = capsys.readouterr()
    assert "nan" in printed and "no error of energy_left, temperature_ratio: it takes sev" in said
    draw("equipartition", falling(tmp_path / "f.h5", rng), "--within", 0, "-o", tmp_path / "b.png")
    assert "v0 = 0.5: no T_therm; the difference of the energies is not known to 0" in (
        capsys.readouterr().err
    )


def test_vector_figures_are_written_too(tmp_path, rng):
    path = gas(tmp_path / "gas.h5", rng)
    draw("snapshot", path, "-o", tmp_path / "a.pdf")
    draw("snapshot", path, "-o", tmp_path / "a.svg")
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")


def test_animation_and_export_write_their_files(tmp_path, rng):
    path = gas(tmp_path / "gas.h5", rng, frames=4)
    draw("animate", path, "-o", tmp_path / "film.gif", "--fps", 10)
    assert (tmp_path / "film.gif").read_bytes().startswith(b"GIF")
    draw("export", path, "-o", tmp_path / "gas.xyz", "--frames", "::2")
    assert (tmp_path / "gas.xyz").read_text().count("Lattice") == 2
