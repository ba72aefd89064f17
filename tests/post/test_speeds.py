"""Speeds of disks in equilibrium and in steady states: the scripts speeds and mixture."""

from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from matplotlib.collections import LineCollection

from ricochet.reports.equilibrium import mixture
from ricochet import RunError, read_run, script, speed_laws, speeds, thermodynamics
from ricochet.figures.drawing import plt
from sampling import held_as_often_as_stated, samples
from synthetic_gases import gas
from synthetic_run import drawn, maxwell_velocities, refusal, write_run, written


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


@samples(60, 600)
@pytest.mark.parametrize("frames", [1, 40])
@pytest.mark.parametrize(("power", "exact"), [(1, np.sqrt(np.pi) / 2), (4, 2)])
def test_moments_of_speeds_hold_those_of_maxwell(rng, power, exact, frames, samples):
    """Scaling by the sample reduces the scatter by 0.71 and 0.55; four frames share velocities."""
    held = []
    for _ in range(samples):
        free = rng.exponential(size=(-(-frames // 4), 500))
        u = np.sqrt(np.repeat(free, min(frames, 4), axis=0))
        u /= np.sqrt(np.mean(u**2))
        found = speeds.moment([u], power, u.size)
        held.append(abs(found.mean - exact) < found.error)
    if samples < 600:
        assert held_as_often_as_stated(held)
    else:
        assert np.mean(held) == pytest.approx(0.6827, abs=0.07)


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
    falls = "kT falls from 0.2362 to 0.06767"  # halves of exp(-0.75) and exp(-2)
    printed, said = capsys.readouterr()
    assert falls in words_on(figures[1]) and falls in said and said.count("\n") == 1
    tests = cells(printed)
    assert float(tests["KS_p"]) > 0.001 and float(tests["kT_last"]) == 0.0676676
    assert "cool.h5: differs in kind from" in refusal(capsys, "speeds", calm, cool)


def test_the_table_contains_the_second_sonine_coefficient(tmp_path, rng, capsys):
    """The speeds v^(1/2) of a Maxwellian gas have <v^2> = sqrt(pi) / 2 and <v^4> = 1."""
    path = gas(tmp_path / "a.h5", rng, count=2000)
    with h5py.File(path, "r+") as file:
        velocity = file["particles/disks/velocity/value"]
        velocity[...] /= np.sqrt(np.linalg.norm(velocity[()], axis=2, keepdims=True))
    drawn(tmp_path, "speeds", path)
    row = {
        name: float(cell) for name, cell in cells(capsys.readouterr().out).items() if "a2" in name
    }
    assert 0 < row["a2_error"] < 0.005
    assert abs(row["a2"] - (2 / np.pi - 1)) < 4 * row["a2_error"]


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
    """The gas has kT = 0.5 in a flow with ten times this energy, or with a drift."""
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
    """Return all texts of a figure on one line."""
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
    for speed, top in rng.uniform((0.1, 2), (2, 9), (20, 2)):  # equal initial speeds
        bins = mixture.speed_bins(np.full(5, speed), top)
        one = np.searchsorted(bins, speed)
        assert bins[one - 1 : one + 1].mean() == pytest.approx(speed) and bins[-1] >= top


@pytest.mark.parametrize("hot", [1.0, 9.0])
def test_a_temperature_that_varies_in_space_is_said(tmp_path, rng, capsys, hot):
    """A thermal wall heats an inelastic gas, whose left half is `hot` times as hot."""
    parameters = {"contact": {"restitution": 0.9}, "side/left": {"temperature": 1.0}}
    more = {"periodic": (False, True), "observable_time": np.arange(121.0)}
    path = gas(tmp_path / "a.h5", rng, count=1000, frames=121, parameters=parameters, **more)
    with h5py.File(path, "r+") as file:
        velocity, x = (file[f"particles/disks/{name}/value"] for name in ("velocity", "position"))
        left = x[..., :1] < np.median(x[..., 0])
        velocity[...] = velocity[...] * np.where(left, np.sqrt(hot), 1)
    drawn(tmp_path, "speeds", path, "--equilibration", 20)
    said = capsys.readouterr().err
    assert ("kT varies in space by a factor of" in said) == (hot > 1), said


def test_error_bars_of_a_mixture_are_those_of_its_independent_speeds(tmp_path, rng):
    run = read_run(gas(tmp_path / "a.h5", rng, frames=3))
    (kind,), heights = run.by_species, {}
    for independent in (600, 150):
        axes, result = plt.figure().add_subplot(), SimpleNamespace(runs=[run])
        histogram = run.speed([0, 1, 2]).ravel(), np.linspace(0, 4, 20)
        mixture.draw_speeds(axes, result, kind, *histogram, independent)
        (bars,) = (one for one in axes.collections if isinstance(one, LineCollection))
        heights[independent] = [np.ptp(line[:, 1]) for line in bars.get_segments()]
        (label,) = axes.get_legend_handles_labels()[1]
        assert label.endswith("600 speeds" + ", 150 independent" * (independent == 150))
        plt.close("all")
    assert heights[150] == pytest.approx(2 * np.array(heights[600]))
