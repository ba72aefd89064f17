"""Parts of figures other than the measured curves: bands of single runs, panels, explanations."""

from itertools import pairwise

import numpy as np
import pytest
from matplotlib import colors
from matplotlib.collections import EllipseCollection
from matplotlib.quiver import Quiver, QuiverKey
from matplotlib.text import Text
from scipy.signal import lfilter

import ricochet
from ricochet.reports.grains import cooling as cooling_figure
from ricochet.reports.equilibrium import fields as fields_figure
from ricochet.reports.equilibrium import missed as missed_figure
from ricochet import (
    crater,
    drawing,
    equilibrium,
    read_run,
    script,
    statistics,
    thermodynamics,
)
from ricochet.figures.drawing import plt
from sampling import held_as_often_as_stated, samples
from synthetic_run import ROOT, run_script, write_run, written


@pytest.fixture
def figures(monkeypatch):
    """Collect the figures that scripts would write."""
    found = []
    monkeypatch.setattr(script, "save", lambda figure, *_: found.append(figure))
    yield found
    for figure in found:
        plt.close(figure)


# --- cooling ---


def mixture(path, energies, tau=20.0, cooled=0.0):
    """Return a run of light and heavy disks with the energies (T, N) of single disks."""
    frames, count = energies.shape
    species = np.repeat([1, 2], [count // 3, count - count // 3])
    mass = np.array([1.0, 4.0])[species - 1]
    v = np.sqrt(2 * energies / mass)[..., None] * [1.0, 0.0]
    means = {
        f"{name}/kinetic_energy": energies[:, species == k + 1].mean(axis=1)
        for k, name in enumerate(("light", "heavy"))
    }
    lost = cooled * count * energies[0].mean() * np.linspace(0, 1, frames)
    ends = {"collisions": np.linspace(0, tau * count / 2, frames).astype(int)}
    more = {"observables": means | ends | {"dissipated_energy": lost}, "species": species}
    more |= {"names": ("light", "heavy"), "mass": mass}
    more |= {"parameters": {"contact": {"restitution": 1.0 - cooled}}}
    return write_run(path, np.full(v.shape, 0.5), v, **more)


@pytest.mark.parametrize("kept", [True, False])
def test_the_expected_scatter_of_one_run_is_that_of_exponential_energies(tmp_path, rng, kept):
    """4000 gases of 3 to 60 disks are compared; a conserved energy has a fixed sum."""
    count = int(rng.integers(3, 60))
    draws = rng.exponential(size=(4000, count))
    if kept:
        draws *= count / draws.sum(axis=1, keepdims=True)
    energies = np.stack([np.full(count, 1.0), draws[0]])
    run = read_run(mixture(tmp_path / "a.h5", energies, cooled=0.0 if kept else 0.1))
    light = run.of_species("light")
    means = {"all": np.ones(1), "light": np.ones(1), "heavy": np.ones(1)}
    found = cooling_figure.expected_scatter(run, means, np.array([50.0]))
    for name, mask in (("all", np.ones(count, bool)), ("light", light), ("heavy", ~light)):
        own = draws[:, mask].mean(axis=1).std()
        # A Beta distribution has N + 1 where the Gaussian estimate has N.
        assert found[name][0] == pytest.approx(own, rel=0.05 + 0.5 * kept / count, abs=1e-12)
    assert np.all(cooling_figure.expected_scatter(run, means, np.zeros(1))["light"] == 0), (
        "equal speeds at the start have no scatter"
    )


def test_cooling_has_a_linear_panel_for_each_restitution(tmp_path, rng, figures):
    """Each panel shows three means in units of the input, with the band of single runs."""
    paths = []
    for k, cooled in enumerate((0.0, 0.1)):
        draws = 3 * rng.exponential(size=(5, 30))
        draws *= 3 * 30 * (1 - cooled * np.arange(5)[:, None] / 4) / draws.sum(axis=1)[:, None]
        paths.append(mixture(tmp_path / f"{k}.h5", draws, cooled=cooled))
    words = ("-o", tmp_path / "a.png", "--units", "energy=J,time=s")
    assert run_script("cooling", *paths, *words) == 0
    (figure,) = figures
    first, second, overview, *_ = figure.axes
    for axes, cooled in ((first, 0.1), (second, 0.0)):
        assert axes.get_yscale() == axes.get_xscale() == "linear"
        assert [line.get_label() for line in axes.lines] == [
            "all disks",
            "light, m = 1",
            "heavy, m = 4",
        ]
        assert axes.lines[0].get_ydata()[-1] == pytest.approx(3 * (1 - cooled))
        band = axes.collections[1].get_paths()[0].vertices[:, 1]
        assert np.ptp(band) > np.ptp(axes.lines[1].get_ydata()), "a single run has a band"
    assert first.get_ylabel() == "mean energy per disk (J)" and first.get_xlabel() == "time (s)"
    assert overview.get_yscale() == "log"
    said = " ".join(text.get_text() for text in figure.texts)
    assert "estimated" in said and "standard errors" not in said


def test_many_restitutions_have_named_curves_and_common_axes(tmp_path, rng):
    """Names of curves do not overlap, and the legend lies below all panels and their labels."""
    runs = []
    for k, cooled in enumerate(np.sort(rng.uniform(0, 0.3, 6))):
        draws = rng.exponential(size=(5, 30))
        draws *= 30 * (1 - cooled * np.arange(5)[:, None] / 4) / draws.sum(axis=1)[:, None]
        runs.append(read_run(mixture(tmp_path / f"{k}.h5", draws, cooled=cooled)))
    for width in ("16cm", "slide"):
        figure = ricochet.analyse("cooling", runs).figure(width=width)
        figure.canvas.draw()
        time, tau, ratio, *single = figure.axes
        assert len(single) == 6 and len({axes.get_xlim() + axes.get_ylim() for axes in single}) == 1
        for axes in (time, tau, ratio):
            names = [text for text in axes.texts if text.get_text().startswith("ξ")]
            assert len(names) == 6
            boxes = [Text.get_window_extent(text) for text in names]
            ends = sorted((box.y0, box.y1) for box in boxes)
            assert all(low[1] <= high[0] for low, high in pairwise(ends))
            top = np.argsort([text.xy[1] for text in names])
            assert np.all(np.diff([boxes[k].y0 for k in top]) > 0), "in the order of the curves"
        (legend,) = figure.legends
        assert legend.get_window_extent().y1 < min(axes.get_tightbbox().y0 for axes in figure.axes)
        plt.close(figure)


def test_the_table_of_cooling_has_both_values_after_the_same_number_of_collisions(tmp_path, rng):
    """The energies of both runs fall by 10 % over time, the second in twice as many collisions."""
    runs = []
    for k, tau in enumerate((20.0, 40.0)):
        draws = rng.exponential(size=(5, 30))
        draws *= 30 * (1 - 0.1 * np.arange(5)[:, None] / 4) / draws.sum(axis=1)[:, None]
        runs.append(read_run(mixture(tmp_path / f"{k}.h5", draws, tau=tau, cooled=0.1)))
    found = ricochet.analyse("cooling", runs)
    (row,) = found.table
    few = "Bands in panels of one ξ and of the temperature ratio: 95 % of single runs, estimated."
    assert found.notes == [f"{few} Other bands: standard errors of the mean over the runs."]
    assert row["energy_left"] == pytest.approx((0.9 + 0.95) / 2, abs=1e-6)


# --- energies ---


def test_the_total_energy_has_a_linear_panel_for_each_time_step(tmp_path, rng, figures):
    """A panel shows the first run by each method; a note explains changes due to rounding."""
    paths, totals, time = [], [], np.linspace(0, 8, 41)
    for k, dt in enumerate((0.0, 0.1, 0.2, 0.2)):
        total = 7.0 + 1e-15 * rng.normal(size=41)
        kinetic = rng.uniform(0, 7, 41)
        found = {"total_energy": total, "all/kinetic_energy": kinetic / 2}
        found |= {"disk/kinetic_energy": kinetic / 2, "disk/potential_energy": (7 - kinetic) / 2}
        found["all/potential_energy"] = (7 - kinetic) / 2
        own = {"box": {"gravity": [0.0, -1.0]}, "run": {"dt": dt, "seed": k}}
        own["run"]["dynamics"] = "steps" if dt else "events"
        more = {"observables": found, "observable_time": time, "parameters": own}
        v = rng.normal(size=(2, 2, 2))
        paths.append(write_run(tmp_path / f"{k}.h5", 0 * v + 0.5, v, **more))
        totals.append(total)
    words = ("-o", tmp_path / "a.png", "--units", "energy=J,time=s")
    assert run_script("energy", *paths, *words) == 0
    (figure,) = figures
    for axes, total in zip(figure.axes, totals[:3], strict=False):
        assert axes.get_xscale() == axes.get_yscale() == "linear"
        np.testing.assert_array_equal(axes.lines[0].get_xdata(), time)
        np.testing.assert_array_equal(axes.lines[0].get_ydata(), total)
        assert axes.get_xlabel() == "time (s)"
    first, species, changes = figure.axes[0], figure.axes[3], figure.axes[-1]
    assert first.get_ylabel() == "energy (J)" and len(figure.axes) == 3 + 2 + 1
    assert species.get_xscale() == "linear" and figure.axes[4].get_xscale() == "log"
    assert "exact except for rounding" in changes.get_title(loc="left") + changes.get_title()


# --- craters ---


def test_a_bed_that_is_large_enough_keeps_the_crater_from_the_box(simulated, rng):
    """Craters of random projectiles are free in a bed of the estimated size, not in half of it."""
    for _ in range(3):
        mass, xi = rng.uniform(4, 12), rng.uniform(0.3, 0.7)
        size = crater.enough_disks(mass, xi, 0.1)
        for share, taken in ((1.1, False), (0.5, True)):
            run = simulated(
                ROOT / "input/crater.nml",
                f"species.bed.count={round(share * size)}",
                f"species.projectile.mass={mass}",
                f"contact.restitution={xi}",
                f"run.seed={rng.integers(1000)}",
            )
            hits = crater.crater(run).side_collisions
            assert crater.box_takes_part(run, hits) == taken, (mass, xi, share, hits)


def test_the_titles_of_the_panels_of_a_crater_are_below_the_title_of_the_figure(simulated):
    run = simulated(ROOT / "input/crater.nml", "species.bed.count=200")
    figure = ricochet.analyse("crater", run).figure()
    figure.draw_without_rendering()
    titles = [axes._left_title for axes in figure.axes if axes._left_title.get_text()]
    assert len(titles) == 3 and figure._suptitle is not None
    bottom = figure._suptitle.get_window_extent().y0
    assert all(one.get_window_extent().y1 < bottom for one in titles)


# --- where equilibrium begins ---


def test_the_reason_of_the_start_names_what_drifts(tmp_path, rng):
    """Each quantity in turn relaxes more slowly than speeds, while all others are steady."""
    time, names = np.arange(2001.0), ("a", "b")
    found = {
        f"{k}/{e}_energy": 1 + 0.01 * rng.normal(size=2001)
        for k in names
        for e in ("kinetic", "potential")
    }
    v = rng.normal(size=(2, 4, 2))
    for late in sorted(found):
        slow = found | {late: found[late] + np.exp(-time / 100)}
        slow |= {"collisions": 2 * time}
        more = {"observables": slow, "observable_time": time, "species": [1, 1, 2, 2]}
        more |= {"names": names, "parameters": {"box": {"gravity": [0.0, -1.0]}}}
        run = read_run(write_run(tmp_path / "run.h5", 0 * v + 0.5, v, time=time[[0, -1]], **more))
        start, why = equilibrium.explained_start(run)
        name, kind = late.removesuffix("_energy").split("/")
        assert start > 200 and f"the {kind} energy of {name} drifts" in why
        assert start == thermodynamics.start_of_steady_state(run)
    assert equilibrium.explained_start(run, 20.0) == (20.0, "--equilibration 20")


def test_a_relaxed_gas_loses_no_time_and_a_drifting_gas_does(tmp_path, rng):
    """Observables fluctuate slowly, as under gravity; in some of the runs one of them drifts."""
    time, v, lost = np.arange(1001.0), rng.normal(size=(2, 4, 2)), []
    for k in range(24):
        noise = lfilter([1], [1, -0.8], rng.normal(size=(4, 1001)))
        noise[0] += 30 * np.exp(-time / 60) * (k >= 20)
        names = (f"{kind}/{e}_energy" for kind in "ab" for e in ("kinetic", "potential"))
        observables = {name: 10 + one for name, one in zip(names, noise, strict=True)}
        observables |= {"collisions": 4 * time}
        more = {"observables": observables, "observable_time": time, "species": [1, 1, 2, 2]}
        more |= {"names": ("a", "b"), "parameters": {"box": {"gravity": [0.0, -1.0]}}}
        run = written(tmp_path / "run.h5", 0 * v + 0.5, v, time=time[[0, -1]], **more)
        rules = equilibrium.explained_start, equilibrium.relaxed_start
        lost.append([rule(run)[0] for rule in rules])
    before, after = np.transpose(lost)
    assert np.mean(after[:20] < 10) >= 0.85 and np.mean(before[:20] < 10) < 0.5
    assert (after[20:] > 100).all() and (after <= before).all()


# --- speeds ---


def maxwellian(path, rng, mass=2.0, kt=3.0, count=400, frames=41):
    """Write a gas in equilibrium at kT = 3/2, with one collision per disk between frames."""
    mass = np.broadcast_to(mass, count)
    v = rng.normal(size=(frames, count, 2)) * np.sqrt(kt / mass)[:, None]
    v *= np.sqrt(kt * 2 * count / np.sum(mass[:, None] * v**2, axis=(1, 2)))[:, None, None]
    ends = {"collisions": np.arange(frames) * count // 2}
    return write_run(path, rng.uniform(0.05, 0.95, v.shape), v, mass=mass, observables=ends)


def test_speeds_are_drawn_in_units_of_the_input_on_request(tmp_path, rng, figures, capsys):
    """The Maxwell curve has its maximum at sqrt(kT / m); curve and histogram have the area 1."""
    path, out = maxwellian(tmp_path / "gas.h5", rng), tmp_path / "a.png"
    assert run_script("speeds", path, "-o", out, "--unscaled", "--units", "length=m,time=s") == 0
    for axes in figures[0].axes[:3]:
        assert axes.get_xlabel() == "speed v (m/s)"
        (curve,) = (line for line in axes.lines if "Maxwell" in line.get_label())
        (v, law), steps = curve.get_data(), axes.patches[0].get_data()
        assert v[np.argmax(law)] == pytest.approx(np.sqrt(3 / 2), rel=0.02)
        assert np.trapezoid(law, v) == pytest.approx(1, abs=1e-3)
        assert np.sum(steps.values * np.diff(steps.edges)) == pytest.approx(1, abs=0.02)
    mixed = maxwellian(tmp_path / "mixed.h5", rng, mass=np.repeat([1.0, 4.0], 200))
    assert run_script("speeds", mixed, "-o", out, "--unscaled") == 2
    assert "mixed.h5: its disks have several masses; mixture.py" in capsys.readouterr().err


def test_the_coefficient_of_speeds_is_explained_beside_its_band(tmp_path, rng, figures):
    """The legend shows the colours of band and curve for each number of disks."""
    path, small = maxwellian(tmp_path / "gas.h5", rng), maxwellian(tmp_path / "b.h5", rng, count=50)
    assert run_script("speeds", path, "-o", tmp_path / "a.png") == 0
    assert run_script("speeds", path, small, "-o", tmp_path / "a.png") == 0
    assert "0 for Maxwell's speeds" in " ".join(text.get_text() for text in figures[0].texts)
    for figure, ends in zip(figures, ({400: ""}, {50: ", N = 50", 400: ", N = 400"}), strict=True):
        labels = figure.axes[3].get_legend_handles_labels()
        shown = dict(zip(*labels[::-1], strict=True))
        for count, end in ends.items():
            band = shown[f"95 % in equilibrium{end}"].get_facecolor()
            assert band[:3] == colors.to_rgb(shown[f"N = {count}"][0].get_color())
        figure.draw_without_rendering()
        legend, curves = figure.axes[3].get_legend().get_window_extent(), figure.axes[3].lines
        assert not any(line.get_window_extent().overlaps(legend) for line in curves)


# --- pictures of disks ---


def test_disks_have_their_true_size_unless_they_would_be_lost(tmp_path, rng):
    """Disks are never drawn smaller, and enlarged to at most 0.12 of their mean distance."""
    for _ in range(20):
        count, radius = int(rng.integers(1, 400)), 10 ** rng.uniform(-5, -1)
        x = rng.uniform(0, 1, (1, count, 2))
        run = read_run(write_run(tmp_path / "a.h5", x, 0 * x, radius=radius))
        figure, axes = plt.subplots(figsize=rng.uniform(1, 12, 2))
        drawing.draw_box(axes, run)
        drawn = drawing.drawn_diameters(axes, run)
        larger = drawn[0] > 2 * radius
        most = max(2 * radius, 0.12 / count**0.5) * (1 + 1e-9)
        assert np.all(drawn >= 2 * radius) and np.all(drawn <= most)
        points = drawn[0] * drawing.points_per_length(axes)
        assert points <= drawing.LEAST_POINTS * (1 + 1e-9) or not larger
        assert bool(drawing.note_on_size(axes, run)) == larger
        disks = drawing.disk_collection(axes, run, run.position[0])
        np.testing.assert_allclose(2 * disks._widths, drawn)
        plt.close(figure)


def test_arrows_have_a_scale_and_a_second_species_an_outline(tmp_path, rng, figures):
    v = rng.normal(size=(2, 6, 2))
    kinds = {"species": [1, 1, 1, 2, 2, 2], "names": ("a", "b"), "radius": 0.05}
    path = write_run(tmp_path / "a.h5", rng.uniform(0.2, 0.8, v.shape), v, **kinds)
    words = ("--quiver", "--colour", "speed", "--units", "length=m,time=s")
    assert run_script("snapshot", path, "-o", tmp_path / "a.png", *words) == 0
    (figure,) = figures
    axes, run = figure.axes[0], read_run(path)
    (key,) = [one for one in axes.artists if isinstance(one, QuiverKey)]
    speed = float(key.label.split()[1])
    assert key.label.endswith(" m/s") and speed <= run.speed(-1).max() < 2.5 * speed
    *_, disks = [one for one in axes.collections if isinstance(one, EllipseCollection)]
    widths = disks.get_linewidths()
    assert np.all(np.array(widths) == np.array([0, 0, 0, 1, 1, 1]) * widths[-1]) and widths[-1] > 0


@pytest.mark.parametrize(
    ("frames", "edges"), [(2, (1, 1)), (4, (1, 2)), (12, (1, 2)), (12, (2, 1))]
)
def test_the_scale_of_arrows_is_beside_or_above_the_title(tmp_path, rng, figures, frames, edges):
    x = rng.uniform(0.2, 0.8, (frames, 3, 2)) * edges
    path = write_run(tmp_path / "a.h5", x, 10 * x, edges=edges, radius=0.01)
    words = (
        "--quiver",
        "--units",
        "length=m,time=s",
        "--frames",
        ",".join(map(str, range(frames))),
    )
    assert run_script("snapshot", path, "-o", tmp_path / "a.png", *words) == 0
    (figure,) = figures
    figure.draw_without_rendering()
    (key,) = [one for one in figure.axes[0].artists if isinstance(one, QuiverKey)]
    title = figure.axes[0]._left_title
    assert title.get_text().strip() == "t = 0 s"
    extent = title.get_window_extent()
    if title.get_text().startswith("\n"):
        extent.y1 -= extent.height / 2  # the empty line
    assert not extent.overlaps(key.text.get_window_extent())
    assert not figure._suptitle.get_window_extent().overlaps(key.text.get_window_extent())


@pytest.mark.parametrize("width", [None, 8.5, 16])
@pytest.mark.parametrize(("count", "edges"), [(1, (1, 1)), (2, (1, 1)), (2, (1, 2)), (3, (2, 1))])
def test_titles_and_labels_of_paths_are_inside_the_figure(
    tmp_path, rng, figures, count, edges, width
):
    paths = []
    for k in range(count):
        x = rng.uniform(0.2, 0.8, (2, 3, 2)) * edges
        paths.append(write_run(tmp_path / f"{k}.h5", x, x, edges=edges, radius=0.01))
    words = ["--width", f"{width}cm"] if width else []
    assert run_script("trajectory", *paths, "-o", tmp_path / "a.png", *words) == 0
    chosen = ["--frames", ",".join("01"[:count])]
    assert run_script("snapshot", paths[0], "-o", tmp_path / "b.png", *words, *chosen) == 0
    for figure in figures:
        figure.draw_without_rendering()
        (x0, y0), (x1, y1) = figure.get_tightbbox().get_points()
        size = figure.get_size_inches()
        assert min(x0, y0) >= 0 and x1 <= size[0] and y1 <= size[1]
        assert not width or size[0] == pytest.approx(width / 2.54)


def test_the_title_of_paths_says_when_lines_are_not_the_exact_path(tmp_path, figures, simulated):
    gas = "&species count = 2 radius = 0.02 speed = 1 / &stop events = 12 / "
    gas += "&output frames_every_{} = {} /"
    every = simulated(gas.format("events", 1), name="every").path
    timed = simulated(gas.format("time", 0.3), name="timed").path
    for run, more, exact in (
        (every, (), True),
        (every, ("--frames", "::2"), False),
        (timed, (), False),
    ):
        assert run_script("trajectory", run, *more, "-o", tmp_path / "a.png") == 0
        assert ("lines join frames" not in figures[-1].axes[0].get_title("left")) is exact


def test_panels_contain_the_number_of_events_before_the_frame(tmp_path, figures, simulated):
    """The numbers agree with the event log, even for the last frame, which follows earlier."""
    gas = "&species count = 20 radius = 0.02 speed = 1 / &stop events = 57 / "
    gas += "&output event_log = .true. frames_every_{} = {} /"
    for name, every in (("events", 20), ("collisions", 10)):
        run = simulated(gas.format(name, every), name=name)
        words = ("--frames", "0,1,-1", "-o", tmp_path / "a.png")
        assert run_script("snapshot", run.path, *words) == 0
        log, titles = run.event_log(), [axes.get_title("left") for axes in figures[-1].axes[:3]]
        counted = log.time if name == "events" else log.time[log.j > 0]
        before = [int(np.sum(counted <= run.time[k])) for k in (0, 1, -1)]
        assert before[1] == every and before[2] == len(counted)
        starts = [f"{name[:-1]} {number},  t = " for number in before]
        assert all(map(str.startswith, titles, starts)), titles
    timed = simulated(gas.format("time", 0.1), name="time")
    more = gas.format("events", 20).replace("_log = .true.", "_log = .true. frames_at = 0.001")
    for run in (timed, simulated(more, name="more")):
        assert run_script("snapshot", run.path, "-o", tmp_path / "a.png") == 0
        assert figures[-1].axes[0].get_title("left").startswith("t = ")


def test_equal_speeds_have_a_colour_of_the_middle_of_the_scale(simulated, tmp_path, figures):
    """The colour bar has no arrow at its ends, because no speed exceeds the scale."""
    run = simulated("&species count = 9 radius = 0.05 speed = 3 /&stop events = 0 time = 0 /")
    words = ("--frames", "0", "--colour", "speed", "-o", tmp_path / "a.png")
    assert run_script("snapshot", run.path, *words) == 0
    *_, disks = (c for c in figures[0].axes[0].collections if isinstance(c, EllipseCollection))
    np.testing.assert_allclose(disks.norm(disks.get_array()), 0.5)
    assert disks.colorbar.extend == "neither"
    assert drawing.exceeded(np.array([1.0, 3.0]), 0, 2) == "max"


def test_outlines_are_inside_the_disks(tmp_path, rng):
    x = rng.uniform(0.2, 0.8, (1, 6, 2))
    kinds = {"species": [1, 1, 1, 2, 2, 2], "names": ("a", "b"), "radius": 0.05}
    run = read_run(write_run(tmp_path / "a.h5", x, x, **kinds))
    _, axes = plt.subplots()
    drawing.draw_box(axes, run)
    disks = drawing.disk_collection(axes, run, x[0], array=np.arange(6.0))
    outside = np.array(disks.get_linewidths()) / drawing.points_per_length(axes)
    assert outside[-1] > 0 and 2 * disks._widths + outside == pytest.approx(np.full(6, 0.1))
    assert not any(lines.get_snap() for lines in axes.collections[:2])
    plt.close("all")


def test_spins_have_a_colour(tmp_path, rng, figures, capsys, simulated):
    """The scale has 0 at its centre; disks that cannot rotate have no spin."""
    rough = "&contact tangential_restitution = 0 /"
    run = simulated(f"&species count = 9 radius = 0.05 temperature = 1 /{rough}&stop time = 1 /")
    assert run_script("snapshot", run.path, "--colour", "spin", "-o", tmp_path / "a.png") == 0
    *_, disks = (c for c in figures[0].axes[0].collections if isinstance(c, EllipseCollection))
    np.testing.assert_allclose(disks.get_array(), run.angular_velocity[-1])
    assert disks.norm.vmin == -disks.norm.vmax and np.ptp(run.angular_velocity[-1]) > 0
    smooth = simulated("&species count = 9 radius = 0.05 speed = 1 /&stop time = 1 /")
    assert run_script("snapshot", smooth.path, "--colour", "spin", "-o", tmp_path / "a.png") == 2
    assert "its disks cannot rotate" in capsys.readouterr().err


# --- flows ---


def test_arrows_are_as_long_as_the_largest_flow_beyond_its_error(tmp_path, rng):
    """A noisy roll of 5 % of the thermal speed is drawn dark, and sets the scale of the arrows."""
    x = rng.uniform(0, 1, (1, 4, 2))
    run, cells = read_run(write_run(tmp_path / "a.h5", x, 0 * x)), (10, 8)
    u = 0.01 * rng.normal(size=(2, 80))
    u[:, 5], error = (0.2, 0.0), np.full((2, 80), 0.01)
    u[:, 7], error[:, 7] = (0.5, 0.5), 1.0
    names = zip(("flow_x", "flow_y"), u, error, strict=True)
    found = {name: statistics.Estimate(*own) for name, *own in names}
    flow = fields_figure.flow_of(found)
    assert flow.significant[5] and not flow.significant[7] and flow.significant.sum() < 14
    figure, axes = plt.subplots()
    fields_figure.draw_arrows(axes, run, cells, flow, "black")
    pale, dark = (c for c in axes.collections if isinstance(c, Quiver))
    assert pale.get_alpha() < dark.get_alpha() == 1 and flow.significant.sum() == dark.N
    assert 0.2 / dark.scale == pytest.approx(0.1), "the length of a cell"
    plt.close(figure)


def test_fields_of_a_run_that_is_too_short_say_that_they_have_no_errors(tmp_path, rng, capsys):
    for frames, known in ((6, False), (60, True)):
        x, v = rng.uniform(0, 1, (frames, 40, 2)), rng.normal(size=(frames, 40, 2))
        path = write_run(tmp_path / f"{frames}.h5", x, v)
        assert run_script("fields", path, "--grid", "2,2", "-o", tmp_path / "a.png") == 0
        told = [line for line in capsys.readouterr().err.splitlines() if "no error" in line]
        assert len(told) == (not known) and all("no errors: the steady" in one for one in told)
        assert ricochet.analyse("fields", read_run(path), grid="2,2").explained == (not known)


# --- one run ---


@samples(30, 300)
def test_the_collisions_that_one_pair_of_runs_misses_have_an_error(rng, samples):
    """Error bars contain the true value in two of three pairs of runs with correlated rates."""
    held, true = [], 0.1
    for _ in range(samples):
        noise = rng.normal(size=(2, 420))
        for k in range(1, 420):  # correlated over about five samples
            noise[:, k] = 0.8 * noise[:, k - 1] + 0.6 * noise[:, k]
        rates = [
            statistics.correlated_mean(mean * (5 + one[20:]))
            for mean, one in zip((1 - true, 1.0), noise, strict=True)
        ]
        share = missed_figure.missed_of_pairs(rates[:1], rates[1:])
        held.append(abs(share.mean - true) < share.error)
    assert held_as_often_as_stated(held) if samples < 300 else 0.58 < np.mean(held) < 0.78
    assert missed_figure.missed_of_pairs(rates[1:], rates[1:]) == (0.0, 0.0)
