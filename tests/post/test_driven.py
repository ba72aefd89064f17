"""Driven gases: the scripts driven and energy, with moving sides, pistons and noise."""

import numpy as np
import pytest
from scipy.signal import lfilter

import ricochet
import trajectory
from ricochet import driven, statistics, theory
from ricochet.analysis.driven import demon_law, fuller, noise_law, temperature_law
from ricochet.figures.drawing import plt
from ricochet.reading.nature import Refused
from ricochet.reports.equilibrium.driven import by_input
from sampling import STATISTICS, samples
from synthetic_run import drawn


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
    groups = dict(by_input(runs))
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


def test_correlated_velocities_are_the_reason_of_a_temperature_above_the_theory(simulated):
    text = """&box boundary = 'periodic', 'periodic' / &drive kind = 'noise' interval = 0.002
    strength = 1 / &species count = 400 packing_fraction = {} temperature = 1 /
    &contact restitution = {} / &stop time = 2 / &output observables_every_time = 0.01 /"""
    dilute, dense = (
        ricochet.analyse("driven", simulated(text.format(*one), name=f"{one[1]}"))
        for one in ((0.02, 0.9), (0.2, 0.6))
    )
    reason = "less energy than for independent velocities"
    assert not any(reason in warning for warning in dilute.warnings)
    assert any(reason in warning for warning in dense.warnings)
    for result, most in ((dilute, np.inf), (dense, 0.9)):
        (row,) = result.table
        # heating balances dissipation: T^(3/2) is inversely proportional to the loss per collision
        within = 4 * (row["ratio_error"] + row["loss_error"])
        assert row["ratio"] == pytest.approx(row["loss"] ** (-2 / 3), abs=within)
        assert row["loss"] < most and row["ratio"] < 1.25
    assert dilute.table[0]["loss"] == pytest.approx(1, abs=4 * dilute.table[0]["loss_error"])


def test_the_temperature_ratio_of_a_driven_mixture_is_listed(simulated):
    text = """&box boundary = 'periodic', 'periodic' / &drive kind = 'noise' interval = 0.002
    strength = 1 / &species name = 'heavy' count = 100 packing_fraction = 0.05 mass = 4
    temperature = 1 / &species name = 'light' count = 100 packing_fraction = 0.05 temperature = 1 /
    &contact restitution = 0.8 / &stop time = 5 / &output observables_every_time = 0.05 /"""
    runs = [simulated(text, f"run.seed={seed}", name=f"{seed}") for seed in (1, 2)]
    rows = {row["species"]: row for row in ricochet.analyse("driven", runs).table}
    ratio, kinds = rows["heavy / light"], [rows[name]["late"] for name in ("heavy", "light")]
    assert ratio["late"] == pytest.approx(kinds[0] / kinds[1], rel=0.01)
    assert 0 < ratio["late_error"] < 0.1 * ratio["late"] and ratio["samples"] > 4
    assert ratio["theory"] is None and ratio["late"] > 1.2


def test_a_slow_stroke_is_drawn_beside_its_adiabat(simulated, tmp_path, capsys):
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
    other = simulated(text, "stop.time=40", "run.seed=7", name="other")
    (row,) = drawn(tmp_path, "driven", rested.path, other.path)
    said = capsys.readouterr().err
    assert float(row["late_error"]) > 0 and "samples; run longer" not in said
    assert "fewer than" not in said, "a longer run would have the same mean"
    for change in ("contact.restitution=0.9", "box.gravity=0,-1", "side.top.motion=still"):
        words = ["velocity", "start_time", "end_time"] if "still" in change else []
        assert temperature_law(simulated(text, change, *(f"side.top.{w}=" for w in words))) is None


@pytest.mark.parametrize("across", ["wall", pytest.param("periodic", marks=STATISTICS)])
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
    axes_of_energy = ricochet.analyse("energy", run).figure().axes
    curves = [line for axes in axes_of_energy for line in axes.lines]
    single = [line for line in curves if len(line.get_xdata()) == 1 and line.get_alpha() is None]
    assert [line.get_marker() for line in single] == ["o", "o"]
    figure, axes = plt.subplots(figsize=(5.2, 5.7))
    trajectory.draw_paths(axes, run, [0], [0, -1])
    figure.draw_without_rendering()
    title = axes._left_title.get_window_extent()
    said = [text.get_window_extent() for text in axes.texts if text.get_text()]
    assert said and not any(map(title.overlaps, said))


@samples(200, 2000)
def test_an_even_gas_has_no_fuller_half(rng, samples):
    """This holds for correlated frames, too; a lasting majority in one half is detected."""
    noise = lfilter([1], [1, -0.9], rng.normal(scale=0.02, size=(samples, 300)))
    even = np.array([fuller(0.5 + one).mean() for one in noise])
    assert even.mean() == pytest.approx(0.5, abs=4 * even.std() / np.sqrt(samples))
    assert fuller(0.1 + 0.1 * noise[0]).mean() == pytest.approx(0.9, abs=0.02)
    assert not any(map(statistics.has_trend, noise[:100])), "a memory is no drift"
    assert all(statistics.has_trend(one + np.linspace(0, 1, 300)) for one in noise[:100])
