"""The player: contents of its file and, in a browser, paths, pictures, controls and event log."""

import numpy as np
import pytest

import player
from ricochet import film_data, read_run
from ricochet.figures.drawing import draw_box, plt
from ricochet.reading.reader import SIDES
from synthetic_run import maxwell_velocities, still_run, write_run, written
from whole_runs import wait_for


# --- the file, without a browser ---


def bouncing_gas(path, rng, frames=40, count=60, **more):
    """Write a run of drifting disks, the second half of them a heavier species."""
    velocity = maxwell_velocities(rng, frames, count)
    phase = rng.uniform(0, 6, (1, count, 2))
    position = 0.5 + 0.3 * np.cos(np.arange(frames)[:, None, None] / 9 + phase)
    heavy = np.arange(count) >= count // 2
    kinds = {"mass": np.where(heavy, 4.0, 1.0), "radius": np.where(heavy, 0.02, 0.01)}
    kinds |= {"species": 1 + heavy, "names": ("light", "heavy")}
    kinds["collisions"] = np.arange(frames)[:, None] * np.arange(count)
    energies = {f"{name}/kinetic_energy": np.ones(frames) for name in kinds["names"]}
    kinds["observables"] = {"collisions": 30 * np.arange(frames), **energies}
    kinds["parameters"] = {"run": {"title": "A <gas> & more", "seed": 3}}
    return write_run(path, position, velocity, **kinds | more)


def filmed(run, frames, traced=()):
    """Return the data of the page of a run."""
    return player.film(run, frames, "speed", list(traced))


def test_speeds_energies_and_pressure_are_those_of_the_run(tmp_path, rng):
    pressure = np.linspace(1, 2, 1000)
    for count in (1000, 3, 2):
        observables = {"collisions": np.arange(count), "virial_pressure": pressure[:count]}
        times = {"observables": observables, "observable_time": np.arange(count)}
        run = read_run(bouncing_gas(tmp_path / "gas.h5", rng, **times))
        curves = filmed(run, [0, 20])[0]["curves"]
        assert (curves["pressure"] is None) == (count == 2), "too few samples"
        if curves["pressure"]:
            assert curves["pressure"][0] is None, "before the first collision"
            assert len(curves["time"]) == min(count, film_data.MOST_SAMPLES)
            shown = np.array(curves["pressure"][1:]), curves["time"][1:]
            expected = np.interp(shown[1], range(count), pressure[:count])
            np.testing.assert_allclose(shown[0], expected, rtol=1e-6)
    assert curves["potential"] is None


COUNTED = "state.sofar = arguments[0]; go(arguments[1]); const { counts, seen } = speedsNow();"


def test_speeds_are_counted_at_the_moment_and_so_far(playing, tmp_path, rng):
    run = read_run(bouncing_gas(tmp_path / "gas.h5", rng))
    browser = playing(run.path)
    edges = browser.run("return film.speeds.edges")
    for sofar, frames in ((False, [12]), (True, range(13))):
        told = "return [counts.map(c => Array.from(c)), seen]"
        counts, seen = browser.run(COUNTED + told, sofar, run.time[12])
        assert seen == [len(frames) * kind.disks.sum() for kind in run.by_species]
        for s, kind in enumerate(run.by_species):
            true = np.histogram(run.speed(list(frames))[:, kind.disks], edges)[0]
            apart = np.abs(np.subtract(counts[s][: len(true)], true))
            assert apart.sum() <= 0.01 * true.sum()  # speeds are rounded


def test_speeds_beside_disks_at_rest_are_counted_by_factors(playing, tmp_path, rng):
    """In a linear histogram of a crater, the bar of resting disks would dwarf all others."""
    velocity = maxwell_velocities(rng, 5, 60) * np.array([1e-2, 1.0, 1.0])[np.arange(60) % 3, None]
    velocity[:, ::4] = 0
    observables = {"collisions": np.zeros(5)}
    run = written(tmp_path / "a.h5", 0 * velocity + 0.5, velocity, observables=observables)
    browser, speeds = playing(run.path), run.speed(0)
    edges, rest = browser.run("return [film.speeds.edges, film.speeds.rest]")
    (first,) = browser.run(COUNTED + "return counts.map(c => Array.from(c))", False, 0)
    assert rest and first[0] == np.sum(speeds == 0) and sum(first) == 60
    assert np.ptp(np.diff(np.log(edges))) < 1e-5 and edges[-1] > speeds.max()


def test_a_film_keeps_to_its_room(tmp_path, rng, monkeypatch):
    """The limit holds for ten thousand disks, and for few disks with many frames."""
    still = np.broadcast_to(np.float32(0.5), (1, 10000, 2))
    run = written(tmp_path / "a.h5", still, still, collisions=np.zeros((1, 10000)))
    assert player.frames_that_fit(run, player.ROOM) >= 200
    room = 200000
    monkeypatch.setattr(player, "ROOM", room)
    run = read_run(bouncing_gas(tmp_path / "gas.h5", rng, frames=1000, count=40))
    frames = list(range(player.frames_that_fit(run, room)))
    assert len(frames) < run.n_frames
    page = player.page(run, player.texts(*filmed(run, frames)))
    assert len(page) - len(player.page(run, None)) < 1.05 * room


# --- texts of others ---

#: Texts that a page without escaping would execute or display wrongly.
HOSTILE = (
    "</title></script><script>document.title='taken'</script>",
    "<img src=x onerror=\"document.title='taken'\">",
    "<!--<script>",
    "{{data}}&lt;b onload='x'",
)


@pytest.mark.parametrize("text", HOSTILE)
def test_texts_of_the_file_stay_texts(playing, tmp_path, rng, text):
    names = {"names": (text[:40], "b</script>"), "parameters": {"run": {"title": text}}}
    browser = playing(bouncing_gas(tmp_path / "gas.h5", rng, **names))
    browser.run("trace([0]); $('colour').value = 'species'")
    assert browser.complaints() == []
    shown = browser.run("return [document.title, document.querySelector('h1').textContent]")
    assert shown == [text, text]
    shown = browser.run("return [...kinds, { name: $('energies').rows[1].cells[0].textContent }]")
    assert [one["name"] for one in shown] == [text[:40], "b</script>", text[:40]]
    assert text[:40] in browser.run("return $('disk').textContent")
    assert browser.run("return document.querySelectorAll('img').length") == 0


@pytest.fixture
def opened(playing, tmp_path, rng):
    """Return the player of a small gas, paused at the first frame."""
    return playing(bouncing_gas(tmp_path / "gas.h5", rng))


def test_the_policy_of_the_page_stops_what_is_not_its_own(opened):
    assert opened.run("return performance.getEntriesByType('resource').length") == 0
    opened.run(
        """const body = document.body, create = tag => document.createElement(tag);
        const add = (tag, more) => body.append(Object.assign(create(tag), more));
        add('script', { textContent: 'document.title = "taken"' });
        add('div', { innerHTML: '<b onclick="x" style="color: red">b</b>' });
        add('img', { src: 'http://127.0.0.1:9/x.png' });
        add('style', { textContent: 'h1 { color: rgb(1, 2, 3) }' });
        window.refused = fetch('http://127.0.0.1:9/x').then(() => 0, () => 1);"""
    )
    said = [line["message"].lower() for line in opened.complaints()]
    for what in ("inline script", "inline event handler", "inline style", "image", "connect"):
        assert any(what in line and "content security policy" in line for line in said), said
    assert opened.run("return document.title") == "A <gas> & more"


# --- buttons and pictures ---


def stage(browser) -> str:
    """Return all layers of the drawing as text."""
    return browser.run("return layers.map(layer => layer.toDataURL()).join()")


def frame(browser) -> int:
    return browser.run("return moment.frame")


def test_buttons_and_keys_step_through_the_frames_and_the_picture_follows(opened):
    assert opened.complaints() == []
    assert opened.run("return document.querySelector('h1').textContent") == "A <gas> & more"
    assert "frame 1/40" in opened.run("return $('clock').textContent")
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
    opened.click("theme")
    assert stage(opened) != first


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


def test_the_scrub_bar_and_the_choices_act(opened):
    opened.run("$('scrub').value = 25.5 / 39; $('scrub').dispatchEvent(new Event('input'))")
    assert opened.run("return moment.time") == pytest.approx(25.5)
    pictures = set()
    for colour in ("species", "speed", "displacement", "collisions"):
        choose = "$('colour').value = arguments[0]; $('colour').dispatchEvent(new Event('change'))"
        opened.run(choose, colour)
        pictures.add(stage(opened))
    assert len(pictures) == 4
    for canvas, button in (("histogram", "sofar"), ("energy", "total")):
        before = opened.run("return $(arguments[0]).toDataURL()", canvas)
        opened.click(button)
        assert opened.run("return $(arguments[0]).toDataURL()", canvas) != before
    before = opened.run("return $('histogram').toDataURL()")
    opened.run("step(26)")
    assert opened.run("return $('histogram').toDataURL()") != before
    assert opened.complaints() == []


def test_a_click_on_a_disk_shows_its_trace(playing, tmp_path, rng):
    browser = playing(bouncing_gas(tmp_path / "gas.h5", rng), "--disks", "3,42")
    browser.run("step(12)")
    assert browser.run("return state.traced") == [2, 41]
    lines = browser.run("return $('disk').innerText").splitlines()
    assert [line.split(" at ")[0] for line in lines] == ["disk 3 (light)", "disk 42 (heavy)"]
    both = stage(browser)
    browser.click("clear")
    plain = stage(browser)
    browser.point("mouse", [browser.run("return [across(X[41]), up(Y[41])].map(p => p / page.dots)")])  # fmt: skip  # noqa: E501
    assert browser.run("return state.traced") == [41]
    assert stage(browser) not in (plain, both)


def test_disks_have_their_true_size(opened):
    """The area of the pixels of a colour is compared with that of a large and of a small disk."""
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
    """Return the colours of the stage at points of the box, relative to its edges."""
    return browser.run(
        """return arguments[0].map(([x, y]) => {
          const [px, py] = [[x, 0], [y, 1]].map(([s, k]) => film.lower[k] + s * film.edges[k]);
          const [disk, below] = [disksBrush, ground].map(
            brush => Array.from(brush.getImageData(across(px), up(py), 1, 1).data));
          return disk[3] > 127 ? disk : below;
        })""",
        points,
    )


def test_obstacles_walls_and_images_are_drawn(playing, tmp_path):
    here, there = np.array([[[0.02, 0.5]]]), np.array([[[0.5, 0.8]]])
    for periodic in (True, False):
        path = still_run(tmp_path / "a.h5", here, radius=0.1, periodic=(periodic, False))
        near, far, middle = colours_at(playing(path), (0.06, 0.52), (0.96, 0.52), (0.5, 0.52))
        assert near != middle and (far == near) == periodic
    rounds = [((0.5, 0.5), 0.5, True), ((0.5, 0.3), 0.1, False)]
    browser = playing(still_run(tmp_path / "a.h5", there, obstacles=rounds))
    corner, inner, free = colours_at(browser, (0.03, 0.03), (0.5, 0.3), (0.25, 0.5))
    assert corner == inner != free
    walls = [((0.2, 0.3), (0.6, 0.3)), ((0.9, 0.6), (1.1, 0.6))]
    browser = playing(still_run(tmp_path / "a.h5", there, walls=walls, periodic=(True, False)))
    places = (0.4, 0.5), (0.4, 0.3), (0.95, 0.6), (0.05, 0.6)
    free, first, second, image = colours_at(browser, *places)
    assert first == second == image != free
    assert browser.complaints() == []


# --- between frames ---

FEW = """&species name = 'a' count = 8 radius = 0.05 temperature = 1 /
&species name = 'b' count = 4 radius = 0.08 mass = 4 temperature = 1 /
&contact restitution = 0.95 wall_restitution = 0.9 /
&stop time = 2 /
"""
SHAPES = """&obstacle name = 'post' centre = 1, 0.4 radius = 0.15 /
&wall name = 'ramp' from = 0.2, 0.2 to = 0.5, 0.4 /
"""
BOXES = {
    "walls": SHAPES,
    "periodic": "&box boundary = 'periodic', 'periodic' /\n" + SHAPES,
    "gravity": "&box boundary = 'periodic', 'wall' gravity = 0, -5 /\n" + SHAPES,
    "moving": "&side name = 'right' motion = 'sine' amplitude = 0.05 period = 0.7 /\n"
    "&side name = 'bottom' motion = 'sawtooth' velocity = 0.5 /\n",
    "container": "&obstacle name = 'c' centre = 0.5, 0.5 radius = 0.5 side = 'inside' /\n",
}
LOGGED = ("output.frames_every_time=0.5", "output.event_log=.true.")


def many(text):
    """Return more disks than a page stores with all digits."""
    return text.replace("count = 8", "count = 24").replace("0.05", "0.02")


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("exact", [True, False])
def test_paths_energies_and_colours_follow_the_log(simulated, playing, box, exact):
    """A film of few frames with an event log is compared with a run with many frames."""
    text = BOXES[box] + (FEW if exact else many(FEW))
    run = simulated(text, *LOGGED)
    truth = simulated(text, "output.frames_every_time=0.03", name="many")
    frames = list(range(1, truth.n_frames - 1, 2))
    browser = playing(run.path)
    found = browser.run(
        """return arguments[0].map(t => { show(t); return [
          [X, Y, VX, VY].map(values => Array.from(values)),
          moment.kinetic, moment.potential, moment.collisions,
          ...Object.keys(film.scales).map(name => Array.from(codesNow(name))),
        ]; })""",
        truth.time[frames].tolist(),
    )
    assert browser.run("return film.known && !$('between').textContent")
    pairs, tops = run.event_log().time[run.event_log().j > 0], browser.run("return film.scales")
    heights = -run.mass * (truth.unwrapped(frames) @ run.gravity)
    worst, turned = 1e-6 if exact else 2e-4, []
    for k, (flight, kinetic, potential, count, speed, displacement, hits) in enumerate(found):
        at, (x, y, vx, vy) = frames[k], flight
        gap = np.stack([x, y], axis=-1) - truth.position[at]
        gap -= np.where(run.periodic, run.edges * np.round(gap / run.edges), 0)
        assert np.abs(gap).max() < (1e-6 if exact else 2 / 65535)
        turned.append(np.abs(np.hypot(vx, vy) - truth.speed(at)))
        assert count == 2 * np.sum(pairs <= truth.time[at]) / run.n_disks
        for s, kind in enumerate(run.by_species):
            true = truth.kinetic_energy(at)[kind.disks].mean()
            assert kinetic[s] == pytest.approx(true, rel=worst, abs=worst)
            height = heights[k, kind.disks].mean()
            assert potential[s] == pytest.approx(height, rel=worst, abs=worst)
        for codes, values, top in (
            (speed, truth.speed(at), tops["speed"][1]),
            (displacement, truth.displacement(at), tops["displacement"][1]),
            (hits, np.log1p(truth.event_count[at]), np.log1p(tops["collisions"][1])),
        ):
            apart = np.abs(np.array(codes) - 255 * np.minimum(1, values / top))
            assert np.quantile(apart, 0.9) < 3
    assert np.median(turned) < 1e-2


@pytest.mark.parametrize("box", BOXES)
def test_events_to_come_are_those_of_the_log(simulated, playing, box):
    """The page lists the events, and the film can be moved to each of them."""
    run = simulated(BOXES[box] + FEW, *LOGGED)
    browser, events = playing(run.path), run.event_log()
    times = events.time[:40]
    found = []
    for _ in times:
        browser.press("n")
        found.append(browser.run("return moment.time"))
    np.testing.assert_allclose(found, times, atol=1e-9)
    browser.run("show(arguments[0], true)", float((times[6] + times[7]) / 2))
    rows = browser.run("return [...$('queue').children].map(row => row.textContent)")
    assert len(rows) == 20
    others = [f"the {name} side" for name in ("left", "right", "bottom", "top")]
    others += ["obstacle c"] if box == "container" else ["obstacle post", "wall ramp"]
    for row, k in zip(rows, range(7, 27), strict=True):
        other = f"disk {events.j[k]}" if events.j[k] > 0 else others[-events.j[k]]
        assert row.split("t =")[0] == f"disk {events.i[k]} and {other}"
    happened = browser.run("return $('happened').textContent")
    assert happened.startswith(f"Happened: disk {events.i[6]} and")
    browser.run("go(last())")
    browser.press("n")
    assert browser.run("return moment.time") == run.time[-1]
    assert browser.complaints() == []


@pytest.mark.parametrize("seed", range(4))
def test_sides_are_drawn_where_disks_meet_them(simulated, playing, seed):
    """In random systems no disk is beyond a side, and disks touch it in the logged collisions."""
    rng = np.random.default_rng(seed)
    text = f"&run seed = {seed} /\n&box lower = -3, 2 upper = -1.8, 3.1 /\n" + FEW
    for name in rng.choice(SIDES, rng.integers(1, 4), replace=False):
        size, period, phase = rng.uniform((0.02, 0.3, 0), (0.1, 1, 1))
        kind = rng.choice(["sine", "parabolic", "constant_velocity", "piston"])
        words = f"amplitude = {size} "
        words += f"period = {period} phase = {phase}"
        if kind == "constant_velocity":
            words = (
                f"velocity = {(phase - 0.5) * size} start_time = {period / 9} end_time = {period}"
            )
        if kind == "piston":
            words = f"mass = {period} force = {30 * size}"
        text += f"&side name = '{name}' motion = '{kind}' {words} /\n"
    samples = ("frames", "observables")
    every = [f"output.{what}_every_events=1" for what in samples]
    run = simulated(text, *every, "output.event_log=.true.")
    events, reach = run.event_log(), run.radius[:, None] + [-1e-9, -1e-9]
    (lower, upper), place = run.corners_at(run.time), run.position[:]
    assert np.all(place - reach >= lower[:, None]) and np.all(place + reach <= upper[:, None])
    assert np.all(lower >= run.bounds[0]) and np.all(upper <= run.bounds[1])
    sides = np.stack([lower, upper], axis=-1).reshape(-1, 4)
    hits = np.flatnonzero(events.j <= 0)
    axis, rim = -events.j[hits] // 2, run.radius[events.i[hits] - 1] * (-1) ** -events.j[hits]
    touched = place[hits + 1, events.i[hits] - 1, axis] - rim
    np.testing.assert_allclose(touched, sides[hits + 1, -events.j[hits]], atol=1e-9)
    axes = plt.figure().add_subplot()
    for k in (-1, len(lower) // 2):
        axes.clear()
        draw_box(axes, run, run.time[k])
        segments = np.array(axes.collections[0].get_segments())
        assert np.all(segments.min((0, 1)) == lower[k]) and np.all(segments.max((0, 1)) == upper[k])
    assert np.array_equal(np.transpose([axes.get_xlim(), axes.get_ylim()]), run.bounds)
    plt.close()
    browser, some = playing(run.path), rng.uniform(*run.time[[0, -1]], 50)
    act = """return arguments[0].map(t => {
      show(t); return [sidesAt(moment.shown), source.nextEvent()]; })"""
    drawn, told = zip(*browser.run(act, some.tolist()), strict=True)
    expected = np.stack(run.corners_at(some), axis=-1).reshape(-1, 4)
    np.testing.assert_allclose(drawn, expected, atol=1e-12)
    ends = np.append(events.time, run.time[-1])
    assert list(told) == ends[np.searchsorted(events.time, some, "right")].tolist()


def test_disks_with_unknown_paths_stand_as_in_the_frame_and_the_film_says_so(simulated, playing):
    """Straight flights would be wrong, because walls reflect disks."""
    run = simulated("&box boundary = 'periodic', 'wall' /\n" + FEW)
    browser = playing(run.path)
    browser.run("state.arrows = true; go(0.45 * last())")
    found = browser.run("return [X, Y, VX, VY].map(values => Array.from(values))")
    at = frame(browser)
    assert run.time[at] == browser.run("return moment.shown") < browser.run("return moment.time")
    np.testing.assert_allclose(np.transpose(found[:2]), run.position[at], atol=1e-12)
    turned = np.subtract(*(np.arctan2(y, x) for x, y in (found[2:], run.velocity[at].T)))
    assert np.abs(np.exp(1j * turned) - 1).max() < np.pi / 250
    energies = [run.kinetic_energy(at)[kind.disks].mean() for kind in run.by_species]
    assert browser.run("return moment.kinetic") == pytest.approx(energies, rel=1e-6)
    assert browser.run("return moment.collisions") == pytest.approx(
        run.collisions_per_disk_at(run.time)[at]
    )
    said = browser.run("return $('between').textContent")
    assert "Frames only" in said and "output.event_log" in said
    before = browser.run("return moment.time")
    browser.press("n")  # next events are not listed
    told = "return [moment.time, $('event').hidden, $('coming').hidden]"
    assert browser.run(told) == [before, True, True]


def test_time_is_that_of_the_run_whenever_frames_are_taken(playing, simulated):
    """With unequally spaced frames, half of the film's time is half of the distance."""
    run = simulated(
        """&species name = 'a' radius = 0.01 position = 0.05, 0.05 velocity = 0.08, 0.08 /
        &output frames_at = 0.1, 0.2, 0.3 event_log = .true. / &stop time = 10 /"""
    )
    assert run.time.tolist() == [0, 0.1, 0.2, 0.3, 10]
    browser = playing(run.path)
    browser.run("go(5)")
    assert browser.run("return [X[0], Y[0]]") == pytest.approx([0.45, 0.45])
    assert browser.run("return +$('scrub').value") == pytest.approx(0.5)
    # The test triggers each picture, simulating a rate of 60 per second.
    browser.run("window.requestAnimationFrame = draw => { window.draw = draw; }")
    browser.run("pace = 1; $('pace').value = 0; go(0); play(true); window.now = performance.now()")
    second = """draw(now); const start = moment.time;
    for (let k = 0; k < 60; k++) { now += 1000 / 60; draw(now); } return moment.time - start"""
    assert browser.run(second) == pytest.approx(1)
    browser.run("$('pace').value = -2; $('pace').dispatchEvent(new Event('input'))")
    assert browser.run(second) == pytest.approx(0.01)
    assert "0.01 (0.01 time units per second)" in browser.run("return $('times').textContent")


# --- camera and controls ---


@pytest.fixture
def gas(simulated, playing):
    browser = playing(simulated(many(FEW)).path)
    browser.run("go(0.37)")
    return browser


def test_the_address_of_a_paused_film_is_a_link_to_its_moment(gas):
    wait_for(lambda: gas.run("return location.hash") == "#t=0.37")
    address = gas.run("return location.href")
    gas.open("about:blank")
    gas.open(address)
    assert gas.run("return [moment.time, state.playing]") == [0.37, False]
    gas.run("location.hash = '#t=1.25'")
    wait_for(lambda: gas.run("return moment.time") == 1.25)


def test_wheel_and_fingers_zoom_where_they_are_and_a_drag_moves_the_box(gas):
    place = "return [backAcross(100 * page.dots), backUp(150 * page.dots)]"
    below = gas.run(place)
    gas.wheel(100, 150, 10)
    assert gas.run("return camera.zoom") > 2
    assert gas.run(place) == pytest.approx(below, abs=0.01)
    before = gas.run("return [camera.x, view.unit / page.dots]")
    gas.point("mouse", [(200, 200), (230, 200), (250, 200)])
    assert gas.run("return camera.x") == pytest.approx(before[0] - 50 / before[1], rel=0.03)
    gas.press("0")
    assert gas.run("return [camera.zoom, camera.x, camera.y]") == [1, 0.5, 0.5]
    gas.point("touch", [(200, 200), (180, 200), (100, 200)], [(240, 200), (260, 200), (340, 200)])
    assert gas.run("return camera.zoom") == pytest.approx(6, rel=0.3)
    assert gas.run("return state.traced") == []


def test_the_camera_follows_the_clicked_disk(gas):
    near = "Math.abs(x - 0.5) < 0.12 && Math.abs(Y[i] - 0.5) < 0.12"
    disk = gas.run(f"zoomBy(3); trace([]); return X.findIndex((x, i) => {near})")
    assert disk >= 0
    middle = "[across(X[arguments[0]]), up(Y[arguments[0]])].map(p => p / page.dots)"
    gas.point("mouse", [gas.run(f"return {middle}", disk)])
    assert len(gas.run("return state.traced")) == 1
    gaps = gas.run(
        """camera.zoom = 8; const gaps = [];
        for (let t = 0; t < 2; t += 0.1) {
          show(t);
          const i = state.traced[0], free = 0.5 - page.width / 2 / view.unit;
          if (Math.max(Math.abs(X[i] - 0.5), Math.abs(Y[i] - 0.5)) < free)
            gaps.push(Math.hypot(across(X[i]) - page.width / 2, up(Y[i]) - page.height / 2));
        }
        return gaps;"""
    )
    assert len(gaps) > 3 and max(gaps) < 1
    gas.point("mouse", [(200, 200), (230, 200), (260, 200)])  # a drag stops following a disk
    assert gas.run("return camera.follow") == -1


def test_full_screen_gives_the_box_the_screen(gas):
    before = gas.run("return page.height")
    gas.press("f")
    wait_for(lambda: gas.run("return document.fullscreenElement?.id") == "view")
    wait_for(lambda: gas.run("return page.height") > before)
    gas.press("f")
    now = "return [document.fullscreenElement, page.height]"
    wait_for(lambda: gas.run(now) == [None, before])


SIZES = {
    "desk": (1280, 800, False), "wide": (1920, 1080, False),
    "upright": (390, 844, True), "lying": (844, 390, True),
}  # fmt: skip
CONTROLS = ["stage", "play", "scrub", "pace", "colour", "arrows", "full", "follow", "clear"]


@pytest.mark.parametrize("edges", [(1, 1), (1, 3), (3, 1)])
def test_box_and_controls_are_seen_without_scrolling(browser, playing, tmp_path, edges):
    position = np.full((3, 12, 2), 0.5) * edges
    playing(still_run(tmp_path / "a.h5", position, edges=edges))
    for size in SIZES:
        browser.resize(*SIZES[size])
        browser.open(tmp_path / "film.html")
        browser.run("go(1); trace([3])")
        controls_are_seen(browser, size, edges)
    assert browser.complaints() == []


def controls_are_seen(browser, size, edges):
    """Test the positions of the controls of a film in a window of one of the `SIZES`."""
    width, height, phone = SIZES[size]
    assert browser.run("return document.documentElement.scrollWidth") <= width
    boxes = {
        name: browser.run("return $(arguments[0]).getBoundingClientRect().toJSON()", name)
        for name in (*CONTROLS, "histogram", "energy")
    }
    for name in CONTROLS:
        box = boxes[name]
        if edges != (1, 3) or size == "lying" or name == "stage":
            assert box["left"] >= 0 and box["right"] <= width, (name, box)
            assert box["top"] >= 0 and box["bottom"] <= height, (name, box)
    assert boxes["stage"]["height"] >= (110 if edges == (3, 1) or size == "upright" else 260)
    assert boxes["play"]["height"] >= (44 if phone else 38)
    if phone:  # histogram and disks are visible together
        assert boxes["histogram"]["bottom"] < height and boxes["histogram"]["height"] > 70
    if size == "wide":
        assert boxes["energy"]["right"] > 1860 and boxes["energy"]["bottom"] < 1080
