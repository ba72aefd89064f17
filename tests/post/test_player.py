"""The player in a real browser: it loads without errors, its buttons act, its picture changes."""

import json
import time

import numpy as np
import pytest

import player
from ricochet import read_run
from synthetic_run import maxwell_velocities, run_script, write_run
from whole_runs import wait_for


@pytest.fixture
def rng():
    return np.random.default_rng(9)


# --- the file, without a browser ---


def bouncing_gas(path, rng, frames=40, count=60, **more):
    """A run of disks that drift; the second half is a heavier species."""
    velocity = maxwell_velocities(rng, frames, count)
    phase = rng.uniform(0, 6, (1, count, 2))
    position = 0.5 + 0.3 * np.cos(np.arange(frames)[:, None, None] / 9 + phase)
    species = 1 + (np.arange(count) >= count // 2)
    options = {
        "mass": np.where(species == 2, 4.0, 1.0),
        "radius": np.where(species == 2, 0.02, 0.01),
        "species": species,
        "names": ("light", "heavy"),
        "collisions": np.arange(frames)[:, None] * np.arange(count),
        "observables": {"collisions": 30 * np.arange(frames)},
        "parameters": {"run": {"title": "A <gas> & more", "seed": 3}},
        **more,
    }
    return write_run(path, position, velocity, **options)


def still_run(path, position, **more):
    """A run whose disks stand at the positions given, frame by frame."""
    frames = len(position)
    observables = {"collisions": np.zeros(frames)}
    return write_run(path, position, np.zeros_like(position), observables=observables, **more)


def test_positions_keep_sixteen_bits(tmp_path, rng):
    run = read_run(bouncing_gas(tmp_path / "gas.h5", rng, lower=(-1.0, 0.0), edges=(3.0, 2.0)))
    facts, blocks = player.film(run, [0, 7], "speed", [])
    assert not facts["exact"]
    codes = np.frombuffer(blocks["positions"], "<u2").reshape(2, run.count, 2)
    back = np.array(facts["lower"]) + codes[1] / 65535 * np.array(facts["edges"])
    np.testing.assert_allclose(back, run.position[7], atol=3.0 / 65535)


def test_colours_span_their_scale():
    values = np.array([0.0, 1.0, 2.0, 5.0])
    assert player.coded(values, 2.0, log=False).tolist() == [0, 128, 255, 255]
    assert player.coded(values, 3.0, log=True).tolist() == [0, 128, 202, 255]


def test_speeds_and_energies_are_those_of_the_frame(tmp_path, rng):
    run = read_run(bouncing_gas(tmp_path / "gas.h5", rng))
    facts, _ = player.film(run, [0, 20], "speed", [])
    assert facts["kinetic"][1][1] == pytest.approx(run.kinetic_energy(20)[30:].mean(), rel=1e-6)
    assert facts["potential"] is None
    assert not facts["speeds"]["rest"]
    counts = np.histogram(run.speed(20)[30:], facts["speeds"]["edges"])[0]
    assert facts["speeds"]["counts"][1][1] == counts.tolist()


def test_the_pressure_is_that_of_the_run_if_there_are_enough_samples(tmp_path, rng):
    pressure = np.linspace(1, 2, 1000)
    for count in (1000, 2):
        observables = {"collisions": np.zeros(count), "pressure": pressure[:count]}
        times = {"observables": observables, "observable_time": np.arange(count)}
        run = read_run(bouncing_gas(tmp_path / "gas.h5", rng, **times))
        shown = player.film(run, [0, 7], "speed", [])[0]["pressure"]
        if count == 2:
            assert shown is None
        else:
            assert len(shown["time"]) == 500 and shown["time"][-1] == 999
            np.testing.assert_allclose(
                shown["value"], np.interp(shown["time"], range(count), pressure), rtol=1e-6
            )


def test_speeds_beside_disks_at_rest_are_counted_by_factors(tmp_path, rng):
    """As around a crater: one bar of disks at rest beside a Maxwell curve would say nothing."""
    velocity = maxwell_velocities(rng, 5, 60) * np.array([1e-2, 1.0, 1.0])[np.arange(60) % 3, None]
    velocity[:, ::4] = 0
    observables = {"collisions": np.zeros(5)}
    path = write_run(tmp_path / "a.h5", 0.5 + 0 * velocity, velocity, observables=observables)
    run = read_run(path)
    facts, _ = player.film(run, [0, 4], "speed", [])
    edges, ((first,), _) = facts["speeds"]["edges"], facts["speeds"]["counts"]
    speeds = run.speed(0)
    assert facts["speeds"]["rest"] and first[0] == np.sum(speeds == 0) and sum(first) == 60
    assert np.ptp(np.diff(np.log(edges))) < 1e-5 and edges[-1] > speeds.max()


def test_ten_thousand_disks_and_three_hundred_frames_stay_below_thirty_megabytes(tmp_path):
    count, frames = 10000, 300
    still = np.broadcast_to(np.float32(0.5), (frames, count, 2))
    path = write_run(tmp_path / "big.h5", still[:1], still[:1], collisions=np.zeros((1, count)))
    run = read_run(path)
    assert player.frames_that_fit(run, player.ROOM) >= frames
    assert frames * count * 7 * 4 / 3 < player.ROOM < 30e6 - 5e5


def test_a_film_of_few_disks_and_many_frames_keeps_to_its_room(tmp_path, rng, monkeypatch):
    room = 200000
    monkeypatch.setattr(player, "ROOM", room)
    run = read_run(bouncing_gas(tmp_path / "gas.h5", rng, frames=1000, count=40))
    frames = list(range(player.frames_that_fit(run, room)))
    assert len(frames) < run.frames
    page = player.page(run, player.texts(*player.film(run, frames, "speed", [])))
    assert len(page) - len(player.page(run, None)) < 1.05 * room


def test_frames_worked_on_together_give_what_one_by_one_gives(tmp_path, rng, monkeypatch):
    image = rng.integers(-3, 3, (40, 60, 2))
    path = bouncing_gas(tmp_path / "gas.h5", rng, image=image, periodic=(True, True))
    run, frames = read_run(path), [0, 3, 4, 9, 39]
    together = player.film(run, frames, "speed", [])
    monkeypatch.setattr(player, "MOST_AT_ONCE", 1)
    assert player.film(run, frames, "speed", []) == together


def test_walls_and_traced_disks_are_in_the_page(tmp_path):
    walls = [((0.0, 0.25), (0.5, 0.0))]
    run = read_run(still_run(tmp_path / "a.h5", np.full((2, 3, 2), 0.5), walls=walls))
    facts, _ = player.film(run, [0, 1], "speed", [2, 0])
    assert facts["walls"] == [[[0.0, 0.25], [0.5, 0.0]]] and facts["traced"] == [2, 0]


def test_crossings_of_periodic_sides_are_counted(tmp_path):
    image = np.array([[[0, 0]], [[1, -2]], [[1, -2]]])
    run = read_run(
        still_run(tmp_path / "a.h5", np.full((3, 1, 2), 0.5), image=image, periodic=(True, True))
    )
    _, blocks = player.film(run, [0, 1, 2], "speed", [])
    assert [(code // 16 - 8, code % 16 - 8) for code in blocks["shifts"]] == [
        (0, 0),
        (1, -2),
        (0, 0),
    ]


def test_wrong_requests_are_answered_in_one_line(tmp_path, rng, capsys):
    path = bouncing_gas(tmp_path / "gas.h5", rng, collisions=None)
    for arguments, words in (
        (["-o", tmp_path / "a.mp4"], "a player ends in .html"),
        (["--disks", "1,61"], "no disk 61, there are 60"),
        (["--colour", "collisions"], "has no collisions per disk"),
    ):
        assert run_script("player", path, *arguments) == 2
        assert words in capsys.readouterr().err


def test_open_shows_the_film_in_the_browser(tmp_path, rng, monkeypatch, capsys):
    visited = []
    monkeypatch.setattr(player.webbrowser, "open", visited.append)
    path = bouncing_gas(tmp_path / "gas.h5", rng)
    assert run_script("player", path, "--open", "-o", tmp_path / "a film.html") == 0
    assert visited == [(tmp_path / "a film.html").as_uri()]


# --- in the browser ---


@pytest.fixture
def opened(browser, tmp_path, rng):
    """The player of a small gas, paused at its first frame."""
    path = bouncing_gas(tmp_path / "gas.h5", rng)
    assert run_script("player", path, "-o", tmp_path / "gas.html") == 0
    browser.open(tmp_path / "gas.html")
    browser.run("step(0)")
    return browser


def stage(browser) -> str:
    """What is drawn, all layers in one text."""
    return browser.run("return layers.map(layer => layer.toDataURL()).join()")


def frame(browser) -> int:
    return browser.run("return moment.frame")


def test_it_loads_without_complaints_and_tells_what_it_shows(opened):
    assert opened.complaints() == []
    assert opened.run("return document.querySelector('h1').textContent") == "A <gas> & more"
    assert "frame 1/40" in opened.run("return $('clock').textContent")
    opened.run("step(3)")
    assert "t = 3 · frame 4/40" in opened.run("return $('clock').textContent")


#: Texts that would become part of a page which does not escape them.
HOSTILE = (
    "</title></script><script>document.title='taken'</script>",
    "<img src=x onerror=\"document.title='taken'\">",
    "<!--<script>",
    "{{data}}&lt;b onload='x'",
)


@pytest.mark.parametrize("text", HOSTILE)
def test_texts_of_the_file_stay_texts(browser, tmp_path, rng, text):
    name = text[:40]
    path = bouncing_gas(
        tmp_path / "gas.h5", rng, names=(name, "b"), parameters={"run": {"title": text}}
    )
    assert run_script("player", path, "-o", tmp_path / "gas.html") == 0
    browser.open(tmp_path / "gas.html")
    browser.run("step(0); trace([0]); $('colour').value = 'species'")
    assert browser.complaints() == []
    assert browser.run("return [document.title, document.querySelector('h1').textContent]") == [
        text,
        text,
    ]
    assert browser.run("return [kinds[0].name, $('energies').rows[1].cells[0].textContent]") == [
        name,
        name,
    ]
    assert name in browser.run("return $('disk').textContent")
    assert browser.run("return document.querySelectorAll('img').length") == 0


def test_the_policy_of_the_page_stops_what_is_not_its_own(opened):
    opened.run(
        """const body = document.body, create = tag => document.createElement(tag);
        const add = (tag, more) => body.append(Object.assign(create(tag), more));
        add('script', { textContent: 'document.title = "taken"' });
        add('div', { innerHTML: '<b onclick="x" style="color: red">b</b>' });
        add('img', { src: 'http://127.0.0.1:9/x.png' });
        add('style', { textContent: 'h1 { color: rgb(1, 2, 3) }' });
        window.refused = fetch('http://127.0.0.1:9/x').then(() => 0, () => 1);"""
    )
    said = [entry["message"] for entry in opened.complaints()]
    for what in ("inline script", "inline event handler", "inline style", "image", "connect"):
        assert any(what in line.lower() and "Content Security Policy" in line for line in said), (
            what,
            said,
        )
    assert opened.run("return document.title") == "A <gas> & more"


def test_no_sign_of_the_data_opens_a_tag(tmp_path, rng):
    path = bouncing_gas(tmp_path / "gas.h5", rng, names=("<a", "b</script>"))
    run = read_run(path)
    text = player.page(run, player.texts(*player.film(run, [0, 1], "speed", [])))
    data = text.split('id="film">')[1].split("</script>")[0]
    assert "<" not in data and json.loads(data)["facts"]["species"][1]["name"] == "b</script>"


def test_a_window_may_change_before_the_film_has_come(browser, tmp_path, rng):
    run = read_run(bouncing_gas(tmp_path / "gas.h5", rng))
    (tmp_path / "gas.html").write_text(player.page(run, None), encoding="utf-8")
    browser.open(tmp_path / "gas.html")
    browser.complaints()
    browser.run("dispatchEvent(new Event('resize'))")
    assert [line for line in browser.complaints() if "Uncaught" in line["message"]] == []


def test_it_asks_nothing_of_the_network(opened):
    asked = opened.run("return performance.getEntriesByType('resource').map(r => r.name)")
    assert asked == []


def test_buttons_and_keys_step_through_the_frames_and_the_picture_follows(opened):
    first = stage(opened)
    opened.click("next")
    second = stage(opened)
    assert frame(opened) == 1 and second != first
    opened.press("\ue014")  # arrow right
    assert frame(opened) == 2 and stage(opened) not in (first, second)
    opened.press("\ue012")  # arrow left
    assert frame(opened) == 1 and stage(opened) == second
    opened.click("back")
    opened.click("back")
    assert frame(opened) == 0 and stage(opened) == first
    opened.press("\ue010")  # end
    assert frame(opened) == 39
    opened.click("first")
    assert frame(opened) == 0


def test_play_plays_to_the_end_and_pause_pauses(opened):
    opened.run("$('pace').value = 2")
    opened.click("play")
    wait_for(lambda: frame(opened) == 39)
    wait_for(lambda: not opened.run("return state.playing"))
    assert opened.run("return $('play').ariaPressed") == "false"
    opened.run("$('pace').value = 0; pace = 0.01")
    opened.click("play")
    wait_for(lambda: opened.run("return moment.time") > 0)
    opened.press(" ")
    stopped = opened.run("return moment.time")
    assert 0 < stopped < 39
    opened.draw(5)
    assert opened.run("return moment.time") == stopped


def test_a_film_that_is_paused_and_played_at_once_keeps_its_pace(opened):
    steps = opened.run(
        """const own = requestAnimationFrame;
        let asked = 0;
        requestAnimationFrame = action => { asked += 1; return own(action); };
        for (const on of [false, true, false, true]) play(on);
        asked = 0;
        return new Promise(done => own(() => { asked = 0; own(() => done(asked)); }));"""
    )
    assert steps <= 1


def test_the_scrub_bar_and_the_choices_act(opened):
    opened.run("$('scrub').value = 25.5 / 39; $('scrub').dispatchEvent(new Event('input'))")
    assert opened.run("return moment.time") == pytest.approx(25.5)
    pictures = {}
    for colour in ("species", "speed", "displacement", "collisions"):
        opened.run(
            "$('colour').value = arguments[0]; $('colour').dispatchEvent(new Event('change'))",
            colour,
        )
        pictures[colour] = stage(opened)
    assert len(set(pictures.values())) == 4
    histogram = opened.run("return $('histogram').toDataURL()")
    opened.click("now")
    now = opened.run("return $('histogram').toDataURL()")
    assert now != histogram
    opened.run("step(26)")
    assert opened.run("return $('histogram').toDataURL()") != now
    energy = opened.run("return $('energy').toDataURL()")
    opened.click("total")
    assert opened.run("return $('energy').toDataURL()") != energy
    assert opened.complaints() == []


def test_a_click_on_a_disk_shows_its_trace(opened):
    opened.run("step(12)")
    plain = stage(opened)
    place = opened.run("return [across(X[41]) / page.dots, up(Y[41]) / page.dots]")
    opened.point("mouse", [place])
    chosen = opened.run("return state.traced")
    traced = stage(opened)
    assert chosen == [41] and traced != plain
    assert "disk 42 (heavy)" in opened.run("return $('disk').textContent")
    opened.click("clear")
    assert stage(opened) == plain


def test_disks_have_their_true_size(opened):
    """Area of the pixels of one colour against the circle of its radius; large and small."""
    for zoom in (1, 12):
        area, radius = opened.run(
            """state.colour = 'species'; refresh(); step(0);
            for (let k = 0; k < disks; k++) X[k] = Y[k] = 0;
            X[59] = Y[59] = 0.5037; [camera.zoom, camera.x, camera.y] = [arguments[0], 0.5, 0.5];
            drawStage();
            const r = radii[1], side = Math.ceil(2 * r) + 8;
            const left = across(X[59]) - side / 2, top = up(Y[59]) - side / 2;
            const data = disksBrush.getImageData(left, top, side, side).data;
            let sum = 0;
            for (let k = 3; k < data.length; k += 4) sum += data[k] / 255;
            return [sum, r]""",
            zoom,
        )
        assert area == pytest.approx(np.pi * radius**2, rel=0.02 + 0.2 / radius)


def colours_at(browser, *points):
    """Colours of the stage at points of the box, given in units of its edges."""
    return browser.run(
        """return arguments[0].map(([x, y]) => {
          const [px, py] = [[x, 0], [y, 1]].map(([s, k]) => film.lower[k] + s * film.edges[k]);
          const [disk, below] = [disksBrush, ground].map(
            brush => Array.from(brush.getImageData(across(px), up(py), 1, 1).data));
          return disk[3] > 127 ? disk : below;
        })""",
        points,
    )


def test_a_disk_on_a_periodic_side_shows_on_both(browser, tmp_path):
    here = np.array([[[0.02, 0.5]]])
    for periodic in (True, False):
        path = still_run(tmp_path / "a.h5", here, radius=0.1, periodic=(periodic, False))
        assert run_script("player", path, "-o", tmp_path / "a.html") == 0
        browser.open(tmp_path / "a.html")
        near, far, middle = colours_at(browser, (0.06, 0.52), (0.96, 0.52), (0.5, 0.52))
        assert near != middle
        assert (far == near) == periodic


def test_obstacles_are_drawn(browser, tmp_path):
    path = still_run(
        tmp_path / "a.h5",
        np.array([[[0.5, 0.8]]]),
        obstacles=[((0.5, 0.5), 0.5, True), ((0.5, 0.3), 0.1, False)],
    )
    assert run_script("player", path, "-o", tmp_path / "a.html") == 0
    browser.open(tmp_path / "a.html")
    corner, inner, free = colours_at(browser, (0.03, 0.03), (0.5, 0.3), (0.25, 0.5))
    assert corner == inner != free


def test_straight_walls_and_their_images_are_drawn(browser, tmp_path):
    path = still_run(
        tmp_path / "a.h5",
        np.array([[[0.5, 0.8]]]),
        walls=[((0.2, 0.3), (0.6, 0.3)), ((0.9, 0.6), (1.1, 0.6))],
        periodic=(True, False),
    )
    assert run_script("player", path, "-o", tmp_path / "a.html") == 0
    browser.open(tmp_path / "a.html")
    free, first, second, image = colours_at(
        browser, (0.4, 0.5), (0.4, 0.3), (0.95, 0.6), (0.05, 0.6)
    )
    assert first == second == image != free
    assert browser.complaints() == []


def test_several_disks_are_traced(browser, tmp_path, rng):
    path = bouncing_gas(tmp_path / "gas.h5", rng)
    assert run_script("player", path, "--disks", "3,42", "-o", tmp_path / "a.html") == 0
    browser.open(tmp_path / "a.html")
    browser.run("step(20)")
    assert browser.run("return state.traced") == [2, 41]
    lines = browser.run("return $('disk').innerText").splitlines()
    assert [line.split(" at ")[0] for line in lines] == ["disk 3 (light)", "disk 42 (heavy)"]
    both = stage(browser)
    browser.run("trace([2])")
    assert stage(browser) != both


def test_light_and_dark_differ(opened):
    before = stage(opened)
    opened.click("theme")
    assert stage(opened) != before


def test_it_fits_a_phone(opened):
    opened.resize(390, 844, phone=True)
    opened.run("layout()")
    assert opened.run("return document.documentElement.scrollWidth") <= 390
    width = opened.run("return stage.getBoundingClientRect().width")
    assert 300 <= width <= 390
    assert opened.run("return $('play').getBoundingClientRect().height") >= 44
    assert opened.complaints() == []


@pytest.mark.check
def test_ten_thousand_disks_are_drawn_thirty_times_a_second(browser, tmp_path, rng):
    """The best of some windows of a second: other programs may use the processor, too."""
    position = rng.uniform(0, 1, (10, 10000, 2))
    path = still_run(tmp_path / "big.h5", position, radius=0.003)
    assert run_script("player", path, "-o", tmp_path / "big.html") == 0
    browser.open(tmp_path / "big.html")
    browser.run(
        """window.drawn = 0; play(false);
        requestAnimationFrame(function again() {
          show(last() * (drawn % 100) / 100); window.drawn++; requestAnimationFrame(again);
        });"""
    )
    rates = []
    for _ in range(5):
        before = browser.run("return [drawn, performance.now()]")
        time.sleep(1)
        after = browser.run("return [drawn, performance.now()]")
        rates.append(1000 * (after[0] - before[0]) / (after[1] - before[1]))
    assert max(rates) >= 30, rates
