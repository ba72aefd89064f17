"""The player between frames: true time and paths, camera, events to come, a run that goes on."""

import http.client
import json
import signal
import subprocess
import sys
import threading
import time
import urllib.request

import numpy as np
import pytest

from hostile import besiege, status_of
from ricochet import read_run
from ricochet.live import LOOK, Live, Server, handler
from synthetic_run import ROOT, run_script, write_run
from whole_runs import FINISHED, PATIENCE, frames_in, wait_for, write_input

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
    "container": "&obstacle name = 'c' centre = 0.5, 0.5 radius = 0.5 side = 'inside' /\n",
}


@pytest.fixture
def shown(ricochet, browser, tmp_path):
    """`shown(input, *settings)` runs it and opens its player, paused; returns the run."""

    def show(text, *settings, name="gas"):
        write_input(tmp_path, text)
        options = [part for setting in settings for part in ("--set", setting)]
        done = ricochet("gas.nml", "-o", f"{name}.h5", "--force", *options)
        assert done.returncode == FINISHED, done.stderr
        path = tmp_path / f"{name}.html"
        assert run_script("player", tmp_path / f"{name}.h5", "-o", path) == 0
        browser.open(path)
        browser.run("go(first())")
        return read_run(tmp_path / f"{name}.h5")

    return show


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("copies", [1, 3])
def test_disks_fly_along_their_true_paths(shown, browser, ricochet, tmp_path, box, copies):
    """A film of few frames with an event log against a run with many frames."""
    text = BOXES[box] + FEW
    if copies > 1:  # more disks than have all digits in the page
        text = text.replace("count = 8", "count = 24").replace("0.05", "0.02")
    run = shown(text, "output.frames_every_time=0.5", "output.event_log=.true.")
    many = ricochet("gas.nml", "-o", "many.h5", "--set", "output.frames_every_time=0.01")
    assert many.returncode == FINISHED
    truth = read_run(tmp_path / "many.h5")
    frames = list(range(1, truth.frames, 7))
    found = browser.run(
        "return arguments[0].map(t => { show(t); return [Array.from(X), Array.from(Y), "
        "Array.from(VX), Array.from(VY)]; })",
        truth.time[frames].tolist(),
    )
    x, y, vx, vy = np.moveaxis(np.array(found), 1, 0)
    gap = np.stack([x, y], axis=-1) - truth.position[frames]
    gap -= np.where(run.periodic, run.edges * np.round(gap / run.edges), 0)
    assert np.abs(gap).max() < (1e-6 if copies == 1 else 2 / 65535)
    speeds = np.hypot(vx, vy)
    assert np.median(np.abs(speeds - truth.speed(frames))) < 1e-2
    assert browser.run("return film.guesses.some(Boolean)") is False
    assert browser.run("return $('guess').textContent") == ""


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("copies", [1, 3])
def test_energies_counts_and_colours_follow_the_log(
    shown, browser, ricochet, tmp_path, box, copies
):
    """A film of few frames with an event log against a run with many frames."""
    text = BOXES[box] + FEW
    if copies > 1:  # more disks than have all digits in the page
        text = text.replace("count = 8", "count = 24").replace("0.05", "0.02")
    run = shown(text, "output.frames_every_time=0.5", "output.event_log=.true.")
    many = ricochet("gas.nml", "-o", "many.h5", "--set", "output.frames_every_time=0.03")
    assert many.returncode == FINISHED
    truth = read_run(tmp_path / "many.h5")
    frames = list(range(1, truth.frames - 1, 2))
    found = browser.run(
        """return arguments[0].map(t => { show(t); return [
          moment.kinetic, moment.potential ?? [0, 0], collisionsNow(),
          ...Object.keys(codes).map(name => Array.from(codesNow(name))),
        ]; })""",
        truth.time[frames].tolist(),
    )
    pairs = run.events.time[run.events.j > 0]
    tops = browser.run("return film.scales")
    heights = -run.mass * (truth.unwrapped(frames) @ run.gravity)
    worst = 1e-6 if copies == 1 else 2e-4
    for k, (kinetic, potential, count, speed, displacement, hits) in enumerate(found):
        frame = frames[k]
        assert count == 2 * np.sum(pairs <= truth.time[frame]) / run.count
        for s, kind in enumerate(run.by_species):
            true = truth.kinetic_energy(frame)[kind.disks].mean()
            assert kinetic[s] == pytest.approx(true, rel=worst, abs=worst)
            height = heights[k, kind.disks].mean()
            assert potential[s] == pytest.approx(height, rel=worst, abs=worst)
        for codes, values, top in (
            (speed, truth.speed(frame), tops["speed"][1]),
            (displacement, truth.displacement(frame), tops["displacement"][1]),
            (hits, np.log1p(truth.collisions[frame]), np.log1p(tops["collisions"][1])),
        ):
            gap = np.abs(np.array(codes) - 255 * np.minimum(1, values / top))
            assert np.quantile(gap, 0.9) < 3


def test_the_energies_are_drawn_as_steps_at_their_collisions(shown, browser):
    """Not as a line from frame to frame: of one disk that hits the other long after the start."""
    text = """&species name = 'a' position = 0.2, 0.5 radius = 0.05 velocity = 0.5, 0 /
    &species name = 'b' position = 0.9, 0.5 radius = 0.05 /
    &stop time = 1.35 /
    """
    shown(text, "output.event_log=.true.")
    rows = browser.run("return energiesBetween(cursorAt)[0]")
    assert len(rows) > 100
    for time_of, (a, b), _ in rows:
        assert {round(a, 9), round(b, 9)} == {0, 0.125} and (a > b) == (time_of < 1.2)


@pytest.mark.parametrize("box", BOXES)
def test_the_next_event_is_the_next_of_the_log(shown, browser, box):
    run = shown(BOXES[box] + FEW, "output.frames_every_time=0.5", "output.event_log=.true.")
    times = run.events.time[:40]
    found = []
    for _ in times:
        browser.press("n")
        found.append(browser.run("return moment.time"))
    np.testing.assert_allclose(found, times, atol=1e-9)
    browser.click("event")
    assert browser.run("return moment.time") == pytest.approx(run.events.time[40])
    browser.run("go(last())")
    browser.press("n")
    assert browser.run("return moment.time") == run.time[-1]


def test_up_to_twenty_disks_have_numbers(shown, browser):
    inked = """const { data } = marks.getImageData(across(X[0]) - 6, up(Y[0]) - 9, 12, 18);
        return data.some(Boolean)"""
    shown(FEW)
    assert browser.run(inked) is True
    shown(FEW.replace("count = 8", "count = 17").replace("0.05", "0.02"))
    assert browser.run(inked) is False


@pytest.mark.parametrize("box", BOXES)
def test_the_first_event_to_come_is_the_next_that_happens(shown, browser, box):
    """What the page predicts from places and velocities, against the log of the program."""
    run = shown(BOXES[box] + FEW, "output.frames_every_time=0.5", "output.event_log=.true.")
    events = run.events
    times = np.linspace(0.01, 1.9, 60)
    found = browser.run(
        "return arguments[0].map(t => { show(t); const e = coming.first; "
        "return [e.time, e.i + 1, e.j + 1]; })",
        times.tolist(),
    )
    for now, (when, i, j) in zip(times, found, strict=True):
        k = np.searchsorted(events.time, now)
        assert when == pytest.approx(events.time[k], abs=1e-7), (now, i, j)
        assert {i, max(j, 0)} == {events.i[k], max(0, events.j[k])}
    assert browser.complaints() == []


def test_the_queue_is_told_as_a_list_that_changes(shown, browser):
    run = shown(FEW, "output.frames_every_time=0.5", "output.event_log=.true.")
    k = int(np.flatnonzero(run.events.j > 0)[0])
    when, i, j = run.events.time[k], run.events.i[k], run.events.j[k]
    browser.run("show(arguments[0], true)", when - 1e-6)
    rows = browser.run("return [...$('queue').children].map(row => row.textContent)")
    assert {f"disk {i} and disk {j}", f"disk {j} and disk {i}"} & {rows[0].split("t =")[0]}
    assert len(rows) > 3
    browser.run("show(arguments[0], true)", when + 1e-6)
    assert "Happened: disk" in browser.run("return $('happened').textContent")
    assert browser.run("return document.querySelectorAll('#queue .fresh').length") > 0
    assert browser.run("return [...$('queue').children][0].textContent") != rows[0]


def test_a_film_without_a_log_says_where_it_interpolates(shown, browser):
    shown(FEW)
    browser.run("go(1)")
    said = browser.run("return $('guess').textContent")
    assert "shows frames as they are" in said
    assert "output.event_log" in said
    assert "Dots: frames." in browser.run("return $('guide').textContent")
    assert browser.run("return [coming.first, $('queue').children.length]") == [None, 0]


def test_disks_with_unknown_paths_stand_as_in_the_frame(shown, browser):
    """Straight flights would lead them away from the walls where they turn."""
    run = shown("&box boundary = 'periodic', 'wall' /\n" + FEW)
    browser.run("state.arrows = true; go(0.45 * last())")
    found = browser.run("return [X, Y, VX, VY].map(values => Array.from(values))")
    frame = browser.run("return moment.frame")
    assert run.time[frame] == browser.run("return moment.shown") < browser.run("return moment.time")
    np.testing.assert_allclose(np.transpose(found[:2]), run.position[frame], atol=1e-12)
    turned = np.subtract(*(np.arctan2(y, x) for x, y in (found[2:], run.velocity[frame].T)))
    assert np.abs(np.exp(1j * turned) - 1).max() < np.pi / 250
    assert np.median(np.hypot(*found[2:]) - run.speed(frame)) < 0.02
    assert browser.run("return moment.kinetic") == pytest.approx(
        [run.kinetic_energy(frame)[kind.disks].mean() for kind in run.by_species], rel=1e-6
    )
    hits = run.collisions[frame].mean()
    assert browser.run("return collisionsNow()") == pytest.approx(hits)
    assert "collisions per disk, with walls" in browser.run("return $('clock').textContent")


def test_time_is_that_of_the_run_whenever_frames_are_taken(browser, tmp_path):
    """Frames at unequal times: half of the film's time is half of the way."""
    when = np.array([0, 0.1, 0.2, 0.3, 10.0])
    position = 0.05 + 0.08 * when[:, None, None] * np.ones((1, 1, 2))
    path = write_run(
        tmp_path / "a.h5",
        position,
        np.full_like(position, 0.08),
        time=when,
        collisions=np.zeros((5, 1), int),
        observables={"collisions": np.zeros(5)},
    )
    assert run_script("player", path, "-o", tmp_path / "a.html") == 0
    browser.open(tmp_path / "a.html")
    browser.run("go(5)")
    assert browser.run("return [X[0], Y[0]]") == pytest.approx([0.45, 0.45])
    assert browser.run("return +$('scrub').value") == pytest.approx(0.5)
    # Pictures come here when the test says so, 60 in a second of their time.
    browser.run("window.requestAnimationFrame = draw => { window.draw = draw; }")
    browser.run("pace = 1; $('pace').value = 0; go(0); play(true); window.now = performance.now()")
    second = """draw(now); const start = moment.time;
    for (let k = 0; k < 60; k++) { now += 1000 / 60; draw(now); } return moment.time - start"""
    assert browser.run(second) == pytest.approx(1)
    browser.run("$('pace').value = -2; $('pace').dispatchEvent(new Event('input'))")
    assert browser.run(second) == pytest.approx(0.01)
    assert "0.01 (0.01 time units per second)" in browser.run("return $('times').textContent")


def test_disks_do_not_jump_through_a_periodic_box(browser, tmp_path):
    """Three and a half periods between two frames."""
    position, image = np.array([[[0.1, 0.5]], [[0.6, 0.5]]]), np.array([[[0, 0]], [[3, 0]]])
    path = write_run(
        tmp_path / "a.h5",
        position,
        np.array([[[3.5, 0.0]]] * 2),
        image=image,
        periodic=(True, True),
        collisions=np.zeros((2, 1), int),
        observables={"collisions": np.zeros(2)},
    )
    assert run_script("player", path, "-o", tmp_path / "a.html") == 0
    browser.open(tmp_path / "a.html")
    times = np.linspace(0, 0.99, 100)
    found = browser.run("return arguments[0].map(t => { show(t); return X[0]; })", times.tolist())
    assert found == pytest.approx((0.1 + 3.5 * times) % 1)


# --- camera and controls ---


@pytest.fixture
def gas(shown, browser):
    run = shown(FEW.replace("count = 8", "count = 30").replace("0.05", "0.02"))
    browser.run("go(0.37)")
    return run


def test_the_address_of_a_paused_film_is_a_link_to_its_moment(gas, browser):
    wait_for(lambda: browser.run("return location.hash") == "#t=0.37")
    address = browser.run("return location.href")
    browser.open("about:blank")
    browser.open(address)
    assert browser.run("return [moment.time, state.playing]") == [0.37, False]
    browser.run("location.hash = '#t=1.25'")
    wait_for(lambda: browser.run("return moment.time") == 1.25)


def test_the_wheel_zooms_where_it_is_and_a_drag_moves_the_box(gas, browser):
    place = "return [backAcross(100 * page.dots), backUp(150 * page.dots)]"
    below = browser.run(place)
    browser.wheel(100, 150, 10)
    assert browser.run("return camera.zoom") > 2
    assert browser.run(place) == pytest.approx(below, abs=0.01)
    before = browser.run("return [camera.x, view.unit / page.dots]")
    browser.point("mouse", [(200, 200), (230, 200), (250, 200)])
    assert browser.run("return camera.x") == pytest.approx(before[0] - 50 / before[1], rel=0.03)
    browser.press("0")
    assert browser.run("return [camera.zoom, camera.x, camera.y]") == [1, 0.5, 0.5]


def test_two_fingers_zoom(gas, browser):
    browser.point(
        "touch", [(200, 200), (180, 200), (100, 200)], [(240, 200), (260, 200), (340, 200)]
    )
    assert browser.run("return camera.zoom") == pytest.approx(6, rel=0.3)
    assert browser.run("return state.traced") == []


def test_the_camera_follows_the_clicked_disk(gas, browser):
    browser.run("go(0.37)")
    disk = browser.run("zoomBy(3); trace([]); return X.findIndex((x, i) => "
                       "Math.abs(x - 0.5) < 0.12 && Math.abs(Y[i] - 0.5) < 0.12)")  # fmt: skip
    assert disk >= 0
    middle = browser.run("return [across(X[arguments[0]]), up(Y[arguments[0]])].map(p => p / page.dots)", disk)  # fmt: skip  # noqa: E501
    browser.point("mouse", [middle])
    chosen = browser.run("return state.traced")
    assert len(chosen) == 1
    gaps = browser.run(
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
    browser.point("mouse", [(200, 200), (230, 200), (260, 200)])  # a drag lets it go
    assert browser.run("return camera.follow") == -1


def test_velocities_and_own_colours_show(gas, browser):
    browser.run("go(0)")
    marks = "return $('marks').toDataURL()"
    plain = browser.run(marks)
    browser.press("v")
    assert browser.run(marks) != plain
    rim = browser.run(  # arrows of one colour would be lost on disks of that colour
        """const [r, g, b] = [1, 3, 5].map(k => parseInt(ink.stage.slice(k, k + 2), 16));
        const { data } = marks.getImageData(0, 0, page.width, page.height);
        for (let k = 0; k < data.length; k += 4)
          if ([r, g, b, 255].every((part, c) => data[k + c] === part)) return true;
        return false;"""
    )
    assert rim
    browser.run(
        """const input = document.querySelector('#legend input'); input.value = '#12fa34';
        for (const type of ['input', 'change']) input.dispatchEvent(new Event(type));"""
    )
    seen = browser.run(
        "return Array.from(disksBrush.getImageData(across(X[0]), up(Y[0]), 1, 1).data)"
    )
    assert seen == [0x12, 0xFA, 0x34, 255]
    assert "rgb(18, 250, 52)" in browser.run(
        "return getComputedStyle($('energies').rows[1].cells[0].firstChild, '::before').background"
    )


def test_full_screen_gives_the_box_the_screen(gas, browser):
    before = browser.run("return page.height")
    browser.press("f")
    wait_for(lambda: browser.run("return document.fullscreenElement?.id") == "view")
    wait_for(lambda: browser.run("return page.height") > before)
    browser.press("f")
    now = "return [document.fullscreenElement, page.height]"
    wait_for(lambda: browser.run(now) == [None, before])


SIZES = {"desk": (1280, 800, False), "upright": (390, 844, True), "lying": (844, 390, True)}


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("edges", [(1, 1), (1, 3), (3, 1)])
def test_box_and_controls_are_seen_without_scrolling(browser, tmp_path, size, edges):
    position = np.full((3, 12, 2), 0.5) * edges
    path = write_run(
        tmp_path / "a.h5", position, 0 * position, edges=edges, observables={"collisions": [0] * 3}
    )
    assert run_script("player", path, "-o", tmp_path / "a.html") == 0
    width, height, phone = SIZES[size]
    browser.resize(width, height, phone)
    browser.open(tmp_path / "a.html")
    browser.run("go(1); trace([3])")
    assert browser.run("return document.documentElement.scrollWidth") <= width
    boxes = browser.run(
        "return ['stage', 'play', 'scrub', 'pace', 'colour', 'arrows', 'full', 'follow', 'clear']"
        ".map(id => [id, $(id).getBoundingClientRect().toJSON()])"
    )
    for name, box in boxes:
        tall = edges == (1, 3) and size != "lying" and name != "stage"
        if not tall:  # the lowest controls of a narrow, high box
            assert box["left"] >= 0 and box["right"] <= width, (name, box)
            assert box["top"] >= 0 and box["bottom"] <= height, (name, box)
    assert (
        browser.run(
            """const shown = $('colour'), free = shown.cloneNode(true);
        free.style.cssText = 'position: absolute; flex: none; width: auto; min-width: 0';
        shown.parentNode.append(free);
        const widths = [shown.offsetWidth, free.offsetWidth];
        free.remove();
        return widths[0] >= widths[1] ? '' : widths;"""
        )
        == ""
    ), "the words of the menu are cut"
    assert boxes[0][1]["height"] >= (110 if edges == (3, 1) or size == "upright" else 260)
    assert browser.complaints() == []


def place_of(browser, name):
    return browser.run("return $(arguments[0]).getBoundingClientRect().toJSON()", name)


def test_the_histogram_is_seen_with_the_disks(gas, browser):
    for size in ("lying", "upright"):
        browser.resize(*SIZES[size])
        browser.draw(2)
        turned = place_of(browser, "histogram")
        browser.run("layout(); scrollTo(0, 0)")
        assert place_of(browser, "histogram") == turned
        disks, speeds, controls = (
            place_of(browser, name) for name in ("stage", "histogram", "controls")
        )
        assert speeds["bottom"] < SIZES[size][1] and speeds["height"] > 70
        assert place_of(browser, "now")["left"] >= speeds["right"]
        if size == "lying":
            assert speeds["left"] > disks["right"] and speeds["top"] < disks["bottom"]
        else:
            assert disks["bottom"] < speeds["top"] and speeds["bottom"] < controls["top"]
    browser.resize(390, 320, True)  # as of two runs one above the other
    browser.run("layout()")
    assert place_of(browser, "histogram")["height"] > 70


def test_a_wide_screen_is_used(gas, browser):
    browser.resize(1920, 1080)
    browser.run("layout()")
    boxes = [place_of(browser, name) for name in ("view", "histogram", "energy")]
    assert max(box["right"] for box in boxes) > 1860
    assert boxes[1]["width"] > 550 and boxes[1]["height"] > 220
    assert boxes[2]["bottom"] < 1080


@pytest.mark.check
def test_five_thousand_disks_move_sixty_times_a_second_on_a_telephone(shown, browser):
    """On a processor slowed six times: the time that a picture takes, half of them less."""
    shown(
        "&species count = 5000 packing_fraction = 0.3 temperature = 1 /\n"
        "&stop collisions_per_disk = 3 /\n"
        "&output frames_every_collisions = 1000 event_log = .true. /\n"
    )
    browser.resize(390, 844, phone=True)
    slow = {"cmd": "Emulation.setCPUThrottlingRate"}
    browser.call("POST", "/goog/cdp/execute", slow | {"params": {"rate": 6}})
    try:
        medians = [
            browser.run(
                """state.playing = true; told = performance.now() + 1e6;
                const taken = [];
                for (let k = 0; k < 100; k++) {
                  const start = performance.now();
                  show(first() + k / 100 * (last() - first()));
                  taken.push(performance.now() - start);
                }
                state.playing = false; told = 0;
                return taken.sort((a, b) => a - b)[50];"""
            )
            for _ in range(8)
        ]
    finally:
        browser.call("POST", "/goog/cdp/execute", slow | {"params": {"rate": 1}})
    assert min(medians) < 1000 / 60, medians


# --- a run that goes on ---

LONG = """&run threads = 1 /
&species count = 2000 packing_fraction = 0.2 temperature = 1 /
&stop collisions = 1000000000 /
&output frames_every_collisions = 50000 /
"""


#: The player waits for pages that have asked lately, however slow they are.
SHOW = """import sys; sys.path[:0] = [sys.argv.pop(1)]; sys.argv[0] = "player.py"
from ricochet import live, script; live.PATIENCE = 1e9
import player; script.launch(player.main)"""


@pytest.fixture
def live(started, tmp_path):
    """A run that goes on, but stands still at present; the player that shows it; its address."""
    write_input(tmp_path, LONG)
    run = started("gas.nml", "-o", "gas.h5")
    part = tmp_path / "gas.h5.part"
    wait_for(lambda: frames_in(part, "particles/disks") > 2)
    run.send_signal(signal.SIGSTOP)
    command = [sys.executable, "-c", SHOW, ROOT / "post", part, "--live"]
    show = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    yield run, show, show.stdout.readline().split()[0]
    show.kill()
    show.communicate()


def test_a_run_is_watched_while_it_goes_on(live, browser, tmp_path):
    run, _, address = live
    assert address.startswith("http://127.0.0.1:")
    browser.open(address)
    wait_for(lambda: browser.run("return live.stamp !== ''"))
    first = browser.run("return last()")
    run.send_signal(signal.SIGCONT)
    wait_for(lambda: browser.run("return last()") > first)
    assert "Live: the run is at t =" in browser.run("return $('live').textContent")
    assert run.poll() is None
    assert browser.complaints() == []


def test_the_live_film_keeps_up_with_the_run_until_one_goes_elsewhere(live, browser):
    run, _, address = live
    browser.open(address)
    wait_for(lambda: browser.run("return live.stamp !== ''"))
    browser.run("window.requestAnimationFrame = draw => { window.draw = draw; }")
    browser.run("play(false); play(true)")
    first = browser.run("draw(0); return last()")
    run.send_signal(signal.SIGCONT)
    wait_for(lambda: browser.run("return last()") > first)
    taken = browser.run("const t = moment.time; return (last() - t) / paceNow()")
    assert 0.1 < taken <= 10  # the time since the answer before
    browser.run(
        """let now = performance.now() + 1e6;
        for (let k = 0; k <= 1000; k++) draw(now += 10);"""
    )
    assert browser.run("return moment.time === last()")
    assert "the film follows it" in browser.run("return $('live').textContent")
    assert "collisions per disk" in browser.run("return $('clock').textContent")
    browser.run("go(first())")
    assert "End follows it" in browser.run("return $('live').textContent")
    seen = browser.run("return last()")
    wait_for(lambda: browser.run("return last()") > seen)
    assert browser.run("return moment.time === first()")
    browser.press("\ue010")  # end
    assert browser.run("return [live.newest, state.playing]") == [True, True]


def stop(run):
    """TERM for a run that stands still."""
    run.send_signal(signal.SIGTERM)
    run.send_signal(signal.SIGCONT)


def ask(address, path="/", host=None, method="GET"):
    port = int(address.rstrip("/").rsplit(":", 1)[1])
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    connection.putrequest(method, path, skip_host=True)
    for one in [f"127.0.0.1:{port}"] if host is None else host:
        connection.putheader("Host", one.replace("PORT", str(port)))
    connection.endheaders()
    return connection.getresponse().status


def test_requests_under_another_name_are_refused(live):
    _, _, address = live
    assert ask(address) == ask(address, host=["localhost:PORT"]) == 200
    for host in (["evil.example"], ["evil.example:PORT"], [], ["localhost"], ["127.0.0.1:1"]):
        assert ask(address, host=host) == ask(address, "/film", host) == 403, host
    assert ask(address, host=["localhost:PORT", "evil.example"]) == 403
    assert ask(address, "/../gas.nml") == 404
    assert ask(address, method="POST") == 400


@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGTERM])
def test_the_show_stops_when_asked_and_the_run_goes_on(live, sign):
    run, show, address = live
    with urllib.request.urlopen(address + "film", timeout=PATIENCE) as reply:
        assert reply.status == 200
    show.send_signal(sign)
    out, err = show.communicate()
    assert (show.returncode, err) == (0, "")
    assert out.strip() == "stopped; the run goes on"
    assert run.poll() is None


def test_the_show_ends_with_the_run_and_says_so(live, browser, tmp_path):
    """The page keeps the film."""
    _, show, address = live
    browser.open(address)
    wait_for(lambda: browser.run("return live.stamp !== ''"))
    (tmp_path / "gas.h5.part").rename(tmp_path / "gas.h5")  # as a run does at its end
    out, err = show.communicate()
    assert (show.returncode, err) == (0, "")
    assert out.strip() == f"the run has ended: {tmp_path / 'gas.h5'}"
    wait_for(lambda: "has ended" in browser.run("return $('live').textContent"))
    browser.run("go(first())")
    assert browser.run("return live.on") is False


def test_a_run_that_stops_ends_the_show_too(live, browser, tmp_path):
    run, show, address = live
    browser.open(address)
    wait_for(lambda: browser.run("return live.stamp !== ''"))
    stop(run)
    out, err = show.communicate()
    assert (show.returncode, err) == (0, "")
    assert out.strip() == f"the run has stopped: {tmp_path / 'gas.h5.part'}"
    wait_for(lambda: "has stopped, at t" in browser.run("return $('live').textContent"))
    assert "is unfinished" in browser.run("return $('warning').textContent")


def test_a_show_without_a_page_ends_at_once(live, tmp_path, capsys):
    """Of a run that has stopped there is none."""
    run, show, _ = live
    stop(run)
    run.wait()
    out, _ = show.communicate(timeout=PATIENCE)
    part = tmp_path / "gas.h5.part"
    assert out.strip() == f"the run has stopped: {part}"
    assert run_script("player", part, "--live") == 2
    assert "gas.h5.part: the run has stopped; leave out --live" in capsys.readouterr().err


def test_the_show_of_a_run_that_is_killed_ends_and_says_so(live, tmp_path, capsys):
    """A stopped one goes on; the kernel drops the lock of a killed one."""
    run, show, address = live
    part = tmp_path / "gas.h5.part"
    run.send_signal(signal.SIGSTOP)
    time.sleep(4 * LOOK)
    assert show.poll() is None
    with urllib.request.urlopen(address + "film", timeout=PATIENCE) as reply:  # a page is there
        assert json.load(reply)["end"] == ""
    run.kill()
    run.wait()
    with urllib.request.urlopen(address + "film", timeout=PATIENCE) as reply:
        assert json.load(reply)["end"] == "was killed or has crashed"
    out, err = show.communicate(timeout=PATIENCE)
    assert (show.returncode, out) == (2, "")
    assert err == f"player.py: {part}: the run was killed or has crashed\n"
    assert (tmp_path / "gas.h5.lock").exists()
    assert run_script("player", part, "--live") == 2
    assert "gas.h5.part: the run was killed or has crashed; leave" in capsys.readouterr().err


@pytest.fixture
def server(tmp_path):
    """The server of a film, in this process; gives its port."""
    x = np.full((2, 3, 2), 0.5)
    run = read_run(write_run(tmp_path / "a.h5.part", x, x))
    one = Server(("127.0.0.1", 0), handler(Live(run, lambda run: {}), b"the page"))
    threading.Thread(target=one.serve_forever, daemon=True).start()
    yield one.server_address[1]
    one.shutdown()
    one.server_close()


def test_the_end_counts_as_told_when_it_has_been_sent(tmp_path, monkeypatch):
    """Else the server could leave with its last answer half written."""
    x = np.full((2, 3, 2), 0.5)
    live = Live(read_run(write_run(tmp_path / "a.h5.part", x, x)), lambda run: {})
    answers = handler(live, b"the page")
    reply, told = answers.reply, []

    def noted(self, *arguments):
        told.append(live.delivered)
        reply(self, *arguments)

    monkeypatch.setattr(answers, "reply", noted)
    with Server(("127.0.0.1", 0), answers) as one:
        threading.Thread(target=one.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{one.server_address[1]}/film"
        with urllib.request.urlopen(address, timeout=PATIENCE) as answer:
            assert json.load(answer)["end"] == "has stopped"
        wait_for(lambda: live.delivered)
        one.shutdown()
    assert told == [False]


@pytest.mark.parametrize("requests", [300, pytest.param(5000, marks=pytest.mark.check)])
def test_hostile_requests_are_refused_without_a_word(server, capfd, requests):
    host = f"Host: 127.0.0.1:{server}\r\n\r\n".encode()
    for path, status in {"/": 200, "/film": 200, "http://[::1/film": 404, "*": 404}.items():
        assert status_of(server, f"GET {path} HTTP/1.1\r\n".encode() + host) == status, path
    assert status_of(server, b"GET / HTTP/2.0\r\n" + host) == 400
    assert status_of(server, b"GET /\r\n\r\n") == 403
    besiege(server, requests)
    assert capfd.readouterr() == ("", "")


def test_a_finished_run_is_not_live(tmp_path, capsys):
    path = write_run(tmp_path / "a.h5", np.full((1, 1, 2), 0.5), np.zeros((1, 1, 2)))
    assert run_script("player", path, "--live") == 2
    assert "has finished; leave out --live" in capsys.readouterr().err
