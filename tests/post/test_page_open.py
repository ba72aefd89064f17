"""Open systems in the player and the laboratory: disks that leave and enter, and their buttons."""

import asyncio
import base64
import io
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from laboratory import HEAD, film
from laboratory_page import inside, moving
from test_page_controls import repeated
from test_page_layout import ROWS, SHOW_ROWS, SIZES, WIDE
from whole_runs import wait_for

OPEN = """
&box upper = 2, 1 /
&side name = 'right' open = .false. /
&species name = 'gas' count = 40 waiting = 20 radius = 0.02 temperature = 4 /
&source name = 'pump' region = 0, 0.5, 0, 1 interval = 0.1 count = 5 temperature = 4
  end_time = 0.35 /
&change name = 'opened' time = 0.6 set = 'side.right.open=.true.' /
&stop time = 2 /
&output frames_every_time = 0.1 observables_every_time = 0.1 event_log = .true. /
"""
#: Number of pixels covered by disks, in squares of the unit of length.
AREA = """drawStage(); return pixels.filter(one => one >>> 24 > 127).length / view.unit ** 2"""


@pytest.fixture
def pumped(simulated, playing):
    """Return a run of an open system, and its film in a browser."""
    run = simulated(OPEN)
    return run, playing(run.path)


def test_a_film_shows_the_disks_that_are_in_the_box(pumped):
    run, browser = pumped
    count = run.present.sum(axis=1)
    assert count[0] == 20 and count.max() > 30 and count[-1] < 20, "disks enter and leave"
    for frame in range(run.n_frames):
        browser.run("step(arguments[0])", frame)
        assert browser.run("return moment.inside") == [count[frame]]
        area = browser.run(AREA)
        assert area == pytest.approx(count[frame] * np.pi * run.radius[0] ** 2, rel=0.1)
        mean = run.kinetic_energy(frame)[run.in_box(frame)].mean()
        assert browser.run("return moment.kinetic[0]") == pytest.approx(mean, rel=1e-3)
        seen = "return [false, true].map(all => { state.sofar = all; return speedsNow().seen[0]; })"
        assert browser.run(seen) == [count[frame], count[: frame + 1].sum()]
    numbers = browser.run("return [film.curves.inside[0], film.curves.entered, film.curves.left]")
    found = np.array(numbers)
    assert np.array_equal(found[0], 20 + found[1] - found[2])
    assert "disks inside" in browser.run("return $('clock').textContent")


def test_between_frames_disks_leave_at_the_times_in_the_event_log(pumped):
    run, browser = pumped
    log = run.event_log()
    leaves = log.time[(log.j == -1) & (log.impulse == 0)]
    assert len(leaves) == run.observable("sides/right/left").value[-1] > 10
    entered = run.observable("sources/pump/entered").value
    for before, after in pairwise(range(run.n_frames)):
        if entered[before] == entered[after]:
            time = 0.37 * run.time[before] + 0.63 * run.time[after]
            browser.run("go(arguments[0])", time)
            gone = np.sum((leaves > run.time[before]) & (leaves <= time))
            assert browser.run("return moment.inside[0]") == len(run.in_box(before)) - gone


def test_a_disk_that_leaves_is_no_longer_selected_and_its_path_ends_there(pumped):
    run, browser = pumped
    stays = np.all(run.present[8:12], axis=0)
    leaves = np.all(run.present[8:11], axis=0) & ~np.any(run.present[11:], axis=0)
    for disk, frame, selected in (
        (np.flatnonzero(stays)[0], 11, True),
        (np.flatnonzero(leaves)[0], 11, False),
    ):
        browser.run("step(10); trace([arguments[0]])", int(disk))
        assert browser.run("return state.traced") == [disk]
        browser.run("step(arguments[0])", frame)
        assert browser.run("return state.traced.length > 0 && camera.follow >= 0") == selected
        path = browser.run("return flights(arguments[0], 0.8, 1.1).at(-1).to", int(disk))
        assert (path[0] is not None) == selected
        browser.run("step(9); $('whole').click()")
    assert browser.complaints() == []


def test_an_open_side_is_dotted_from_its_time_on(pumped):
    run, browser = pumped
    assert run.open_at([0.0, 0.599, 0.6, 2.0])[:, 1].tolist() == [False, False, True, True]
    pictures = []
    for time, opens in ((0.5, False), (0.6, True), (0.5, False)):
        browser.run("go(arguments[0])", time)
        assert browser.run("return openSides()") == [False, opens, False, False]
        assert ("right side is open" in browser.run("return $('stage').ariaLabel")) == opens
        pictures.append(browser.run("return $('ground').toDataURL()"))
    assert pictures[0] == pictures[2] != pictures[1]
    assert "dotted: open side" in browser.run("return $('legend').textContent")
    assert "side.right.open" in browser.run("return $('scrub').title")


def test_a_change_has_a_visible_mark_on_the_time_line(pumped):
    _, browser = pumped
    place = browser.run("return $('scrub').getBoundingClientRect().toJSON()")
    browser.run("theme(false); refresh()")
    screen = Image.open(io.BytesIO(base64.b64decode(browser.call("GET", "/screenshot"))))
    row = place["top"] + 0.3 * place["height"]  # above the slider
    xs = range(round(place["left"]), round(place["right"]))
    accent = [x for x in xs if screen.getpixel((x, row))[:3] == (0, 114, 178)]
    ends = place["left"] + 8, place["right"] - 8  # of the middle of the thumb
    assert len(accent) in (1, 2, 3)
    assert np.mean(accent) == pytest.approx(ends[0] + 0.3 * (ends[1] - ends[0]), abs=1.5)


def test_disks_outside_cannot_be_pushed_and_each_frame_says_who_is_inside(address):
    async def visit():
        async with film(address) as one:
            await one.start("pump", pace=0.0)
            frame = await one.until("frame")
            there = np.isfinite(np.frombuffer(frame, np.float32, 600, 8 * HEAD).reshape(-1, 2))
            assert np.array_equal(there.all(axis=1), np.arange(300) < 50)
            assert (await one.until("numbers"))["inside"] == [50]
            await one.until("state")
            for wish in ({"do": "push"}, {"do": "place", "position": [5, 5]}):
                await one.say(**wish, disk=200)
                assert "disk 201 is outside" in (await one.until("state", "scene"))["reason"]
            await one.say("open_side", side=1, open=True)
            assert (await one.until("scene"))["facts"]["sides"][1]["open"]
            assert np.frombuffer(await one.until("frame"), float, HEAD)[6] == 2
            await one.say("insert", source="pump", count=70)
            await one.until("scene")
            assert (await one.until("numbers"))["inside"] == [120]

    asyncio.run(visit())


BUTTONS = "return [...$('open_system').children].map(one => one.textContent)"


def test_the_buttons_of_a_pump_add_disks_and_open_and_close_its_lid(opened):
    """The script repeats this, and nothing is cut in any window."""
    assert opened.run(BUTTONS) == []
    before = opened.run("return current().run")
    opened.run("choose('pump')")
    moving(opened, before)
    assert opened.run(BUTTONS) == ["add 50 disks", "open the right side"]
    opened.run("for (const one of $('open_system').children) one.click()")
    wait_for(lambda: opened.run(BUTTONS)[1] == "close the right side")
    wait_for(lambda: inside(opened, "stream.curves.left.at(-1)") > 0)
    opened.run("$('open_system').lastChild.click()")
    wait_for(lambda: opened.run(BUTTONS)[1] == "open the right side")
    assert opened.run("return current().changes.map(one => one[2])") == [
        "up to 50 disks are let in",
        "the right side is opened",
        "the right side is closed",
    ]
    opened.press("p")
    wait_for(lambda: not inside(opened, "state.playing"))
    time, position = repeated(opened)
    assert time == pytest.approx(inside(opened, "moment.time"))
    assert np.isfinite(position[:, 0]).sum() == inside(opened, "moment.inside")[0]
    for width, height in SIZES:
        opened.resize(width, height)
        wait_for(lambda narrow=width < 1100: opened.run("return isBare()") == narrow)
        opened.run(SHOW_ROWS, ROWS)
        assert opened.run(WIDE) == [], (width, height)
    opened.press("\ue011")  # Home
    assert inside(opened, "moment.inside") == [50]
