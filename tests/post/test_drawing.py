"""Functions shared by the figures of several scripts: frames, images, paths, captions, formats."""

import importlib.util

import numpy as np
import pytest
from matplotlib import colors

import trajectory
from ricochet import RunError, read_run
from ricochet.figures.drawing import COLOURS, STYLE, caption, plt, with_images
from ricochet.reports.options import chosen_frames, frame_list
from synthetic_gases import cooled, falling, gas
from synthetic_run import ROOT, drawn, run_script, written


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
    few = [run(k, packing_fraction=0.0502655 * k) for k in (1, 2)]
    assert "packing_fraction = 0.05027, 0.1005" in caption(few)
    near = [run(k, packing_fraction=0.05026 + k * 1e-6, radius=123456 + k) for k in (1, 2)]
    assert "packing_fraction = 0.050261, 0.050262" in caption(near)
    wide = [run(k, mass=123450 + k) for k in (1, 2)]
    assert "mass = 123451, 123452" in caption(wide)
    random = {"radius": 0.1, "polydispersity": 0.2}
    many = [run(k, packing_fraction=0.3 + k / 1000, **random) for k in range(1, 4)]
    assert caption(many) == "N = 2,  ξ = 1,  3 seeds"
    many = [run(k, packing_fraction=k / 10, polydispersity=0.2, radius=k) for k in range(1, 4)]
    assert "packing_fraction = 0.1, 0.2, 0.3" in caption(many)
    rough = {"restitution": 0.9, "tangential_restitution": 0.0, "friction": 0.5}
    grains = written(tmp_path / "rough.h5", x, x, parameters={"contact": rough})
    assert caption([grains]).startswith("N = 2,  ξ = 0.9,  β = 0,  μ = 0.5,  ")


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


def test_figures_of_the_pages_keep_the_colours_of_their_lines(tmp_path):
    """Thin lines have few pixels, and most colours could go to shades of other areas."""
    source = importlib.util.spec_from_file_location("page_figures", ROOT / "docs/page_figures.py")
    pages = importlib.util.module_from_spec(source)
    source.loader.exec_module(pages)
    plt.style.use(STYLE)
    figure, axes = plt.subplots(figsize=(8, 8))
    axes.set_ylim(-3, 12)  # the lines are above the part of the figure that is cut off
    for k, colour in enumerate(COLOURS[:6]):
        axes.plot([0, 1], [k, k], lw=2, color=colour)
        axes.fill_between([0, 1], k + 0.1, k + 0.9, color=colour, alpha=0.25)
    axes.scatter(*np.random.default_rng(1).uniform([0, 6], [1, 12], (4000, 2)).T, c=range(4000))
    figure.savefig(tmp_path / "a.png")
    small = tmp_path / "small.png"
    small.write_bytes(pages.reduced(tmp_path / "a.png", part=0.9))
    pixels = 255 * plt.imread(small)[..., :3].reshape(-1, 3)
    for colour in COLOURS[:6]:
        assert np.abs(pixels - 255 * np.array(colors.to_rgb(colour))).max(axis=1).min() < 20, colour
