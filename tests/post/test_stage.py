"""The stage of the player in a browser: disks and obstacles of all sizes are visible."""

import numpy as np
import pytest

from synthetic_run import still_run, write_run


def test_species_are_striped_and_never_look_like_a_hole(playing, tmp_path):
    """The centre of each disk is coloured; the legend names only visible patterns."""
    x = np.array([[[0.2, 0.5], [0.5, 0.5], [0.8, 0.5]]] * 2)
    kinds = {"species": [1, 2, 3], "names": ("a", "b", "c"), "radius": [0.1, 0.1, 0.004]}
    browser = playing(still_run(tmp_path / "a.h5", x, **kinds))
    words = browser.run("return kinds.map((_, s) => patternOf(s))")
    assert words == ["", ", striped", ""]
    for disk, striped in ((0, False), (1, True)):
        centre, column = browser.run(
            """const at = dy => pixels[Math.round(up(Y[arguments[0]] + dy)) * page.width
                + Math.round(across(X[arguments[0]]))];
            const heights = Array.from({ length: 91 }, (_, k) => (k - 45) / 500);
            const own = palette[arguments[0]], between = heights.filter(dy => at(dy) === paper);
            return [at(0) === own, between.length]""",
            disk,
        )
        assert centre and (column > 5) == striped


def test_small_disks_far_apart_are_drawn_large_enough_and_the_page_says_so(playing, tmp_path):
    x = np.broadcast_to(np.array([[0.2, 0.2], [0.8, 0.8]]), (2, 2, 2))
    for radius, words in ((1e-4, True), (0.05, False)):
        browser = playing(still_run(tmp_path / f"{words}.h5", x, radius=radius))
        least, said = browser.run("return [radii[0] / page.dots, $('between').textContent]")
        assert least >= 3 and ("drawn larger" in said) == words


def test_the_arrows_of_a_film_have_a_scale(playing, tmp_path, rng):
    """The arrow of a round speed is as long as that of a disk of this speed, at any zoom."""
    v = rng.normal(size=(2, 12, 2))
    observables = {"collisions": np.zeros(2)}
    path = write_run(tmp_path / "a.h5", 0 * v + 0.5, v, observables=observables)
    browser = playing(path)
    for zoom in (1, 4):
        words, key, speed = browser.run(
            """camera.zoom = arguments[0]; state.arrows = true; refresh();
            const words = [], { fillText } = marks;
            marks.fillText = (text, x) => {
              if (`${text}`.startsWith("speed")) words.push([text, x / page.dots]);
            };
            drawMarks();
            marks.fillText = fillText;
            return [words, arrowScale() / page.dots, film.scales.speed[1]];""",
            zoom,
        )
        ((text, x),) = words
        shown = float(text.removeprefix("speed "))
        assert shown == pytest.approx(speed, rel=0.5)
        assert x - 18 == pytest.approx(shown * key, rel=1e-3)


def test_many_obstacles_cost_the_same_each_and_keep_their_area(playing, tmp_path, rng):
    """The law of an obstacle is read a few times per picture, however many obstacles there are."""
    count, radius, x = 20_000, 3e-4, np.full((2, 1, 2), 0.5)
    rounds = [((*centre,), radius, False) for centre in rng.uniform(0, 1, (count, 2)).tolist()]
    path = still_run(tmp_path / "a.h5", x, radius=1e-3, obstacles=rounds, periodic=(True, True))
    browser = playing(path)
    reads, covered = browser.run(
        """let reads = 0;
        film.laws.obstacle = new Proxy(film.laws.obstacle, {
          get(laws, name) { reads++; return Reflect.get(laws, name); },
        });
        const parts = colour => [1, 3, 5].map(k => parseInt(colour.slice(k, k + 2), 16));
        const sum = list => list.reduce((all, one) => all + one);
        const drawn = () => {
          layOutStage();
          drawStage();
          const { data } = ground.getImageData(0, 0, page.width, page.height);
          return sum(data.filter((_, k) => k % 4 < 3)) / (page.width * page.height);
        };
        const all = drawn(), { obstacles } = film;
        film.obstacles = [];
        const none = drawn();
        film.obstacles = obstacles;
        return [reads, (none - all) / (sum(parts(ink.stage)) - sum(parts(ink.wall)))]"""
    )
    assert reads < 20 * count
    assert covered == pytest.approx(count * np.pi * radius**2, rel=0.15)
    zoomed = browser.run("zoom(400); drawStage(); return radii[0] / view.unit")
    assert zoomed == pytest.approx(1e-3)
    assert browser.complaints() == []


def test_an_arc_is_drawn_between_its_angles(playing, tmp_path):
    """The line of an arc from 0 to 90 degrees is in the upper right quarter, and not filled."""
    browser = playing(still_run(tmp_path / "a.h5", np.full((2, 1, 2), 0.9), radius=1e-3))
    quarters = browser.run(
        """film.obstacles = [[0.5, 0.5, 0.3, false, 0, 90]];
        film.laws.obstacle = [{}];
        layOutStage();
        drawStage();
        const darkness = (x, y) => {
          const { data } = ground.getImageData(across(x) - 4, up(y) - 4, 9, 9);
          return 255 - Math.min(...data.filter((_, k) => k % 4 < 3));
        };
        const at = (size, k) => {
          const turn = (k + 0.5) * Math.PI / 2;
          return darkness(0.5 + size * Math.cos(turn), 0.5 + size * Math.sin(turn));
        };
        return [0, 1, 2, 3].map(k => [at(0.3, k), at(0.15, k)]);"""
    )
    outline, inside = np.transpose(quarters)
    assert outline[0] > 100 and (outline[1:] < 20).all() and (inside < 20).all()
    assert browser.complaints() == []
