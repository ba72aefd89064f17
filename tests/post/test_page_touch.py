"""Page of the laboratory on touch screens, where the same fingers scroll the page."""

import pytest

from laboratory_page import inside, moving, pixel
from sampling import mostly
from whole_runs import wait_for

SIZES = {"tablet": (1024, 768), "telephone": (390, 844)}
#: Numbers of events that the stage receives, and the distances by which film and form scroll.
HEARD = """const stage = filmOf(current()).document.getElementById('stage');
    window.heard = {};
    for (const kind of ['pointerdown', 'pointermove', 'pointerup', 'pointercancel'])
      stage.addEventListener(kind, () => { heard[kind] = (heard[kind] ?? 0) + 1; });"""
SCROLLED = "[filmOf(current()).scrollY, scrollY, $('form').scrollTop]"
#: Centre of an element of the film and of the form, in window coordinates.
IN_FILM = """const one = filmOf(current()).document.getElementById(arguments[0]);
    const frame = current().frame.getBoundingClientRect(), box = one.getBoundingClientRect();
    return [frame.x + box.x + box.width / 2, frame.y + box.y + box.height / 2, frame.bottom];"""
SLIDER = """const one = document.querySelectorAll('.slider [type=range]')[arguments[0]];
    const box = one.getBoundingClientRect();
    return [box.x, box.y + box.height / 2, box.width, +one.value];"""


@pytest.fixture(params=mostly(SIZES, ["telephone"]))
def touched(opened, request):
    """Return the laboratory on a touch screen once five large disks move."""
    opened.resize(*SIZES[request.param], True)
    opened.protocol("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=5)
    before = opened.run("return current().run")
    settings = {"species.gas.count": "5", "species.gas.radius": "0.02"}
    opened.run("choose('gas', arguments[0])", settings)
    moving(opened, before)
    opened.run(HEARD)
    # With few plots the film on a tablet is no longer than its window and could not be scrolled.
    opened.run("filmOf(current()).document.body.style.paddingBottom = '400px'")
    yield opened
    opened.protocol("Emulation.setTouchEmulationEnabled", enabled=False)


def path(start, end, steps=12):
    """Return positions on a straight line."""
    return [
        [a + (b - a) * k / steps for a, b in zip(start, end, strict=True)] for k in range(steps + 1)
    ]


def paused(browser):
    browser.press("p")
    wait_for(lambda: not inside(browser, "state.playing"))


def to_the_top(browser):
    """Undo all scrolling, including any that has not reached the page yet."""
    browser.draw(3)
    browser.run("filmOf(current()).scrollTo(0, 0); $('form').scrollTop = 0")
    wait_for(lambda: browser.run(f"return {SCROLLED}") == [0, 0, 0])


def changes(browser):
    return browser.run("return current().changes.map(one => one[2])")


def place_of(browser, disk):
    """Return the newest position of a disk."""
    script = "return [...filmOf(current()).inside().past.at(-1).place]"
    return browser.run(script)[2 * disk : 2 * disk + 2]


def test_a_finger_drags_each_side_and_scrolls_nothing(touched):
    """This takes 5 to 15 s, because the browser draws the moving disks during long gestures."""
    sides = {"right": 1, "top": 3, "bottom": 2, "left": 0}
    for name, number in sides.items():
        x0, x1, y0, y1 = inside(touched, "past.at(-1).sides")
        middle = [(x0 + x1) / 2, (y0 + y1) / 2]
        start, end = middle[:], middle[:]
        start[number // 2] = (x0, x1, y0, y1)[number]
        end[number // 2] = start[number // 2] + (0.2 if number % 2 == 0 else -0.2)
        start, end = pixel(touched, *start), pixel(touched, *end)
        touched.touch(*path(start, end), lifted=False)
        wait_for(lambda name=name: f"the {name} side is dragged" in changes(touched))
        touched.protocol("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    wait_for(lambda: touched.run("return heard.pointerup") == 4)
    assert touched.run("return heard.pointercancel") is None
    assert touched.run(f"return {SCROLLED}") == [0, 0, 0]


def test_a_finger_elsewhere_scrolls_the_page_and_changes_nothing(touched):
    """This includes a finger along a side and, in a paused run, on a disk that was not selected.

    It takes 5 to 10 s, because the browser draws the moving disks during long gestures.
    """
    starts = [pixel(touched, 0.5, 0.4), pixel(touched, 0.005, 0.4)]
    for start in starts:
        touched.touch(*path(start, [start[0], start[1] - 70]))
        touched.until("return filmOf(current()).scrollY")
        to_the_top(touched)
    paused(touched)
    start = pixel(touched, *place_of(touched, 0))
    touched.touch(*path(start, [start[0], start[1] - 70]))
    touched.until("return filmOf(current()).scrollY")
    assert touched.run("return [heard.pointercancel, heard.pointerup ?? 0]") == [3, 0]
    assert changes(touched) == []
    assert inside(touched, "state.traced") == []


def test_a_selected_disk_follows_the_finger_and_its_buttons_are_seen(touched):
    paused(touched)
    stage = "filmOf(current()).document.getElementById('stage').getBoundingClientRect().height"
    height = touched.run(f"return {stage}")
    touched.touch(pixel(touched, *place_of(touched, 0)))
    wait_for(lambda: inside(touched, "state.traced") == [0])
    touched.run("filmOf(current()).layout()")
    assert touched.run(f"return {stage}") == height, "the picture does not change its size"
    for button in ("follow", "push", "clear"):
        _, y, bottom = touched.run(IN_FILM, button)
        assert y < bottom, button
    others = [place_of(touched, k) for k in range(1, 5)]
    x, y = place_of(touched, 0)
    free = next(
        (x, other)
        for other in (0.1, 0.3, 0.5, 0.7, 0.9)
        if abs(other - y) > 0.15 and all(abs(other - place[1]) > 0.06 for place in others)
    )
    start, end = pixel(touched, x, y), pixel(touched, *free)
    beside = [[a + 7, b + 3] for a, b in path(start, end)]
    touched.touch(*beside)
    wait_for(lambda: changes(touched) == ["disk 1 is moved"])
    assert place_of(touched, 0) == pytest.approx(free, abs=0.01)
    assert touched.run("return heard.pointercancel") is None
    assert touched.run(f"return {SCROLLED}") == [0, 0, 0]
    touched.touch(touched.run(IN_FILM, "push")[:2])
    wait_for(lambda: changes(touched) == ["disk 1 is moved", "disk 1 gets energy"])


def test_a_refused_position_is_told_until_the_next_change(touched):
    paused(touched)
    touched.run("filmOf(current()).send({ do: 'place', disk: 0, position: [0.001, 0.5] })")
    wait_for(lambda: "not wholly inside" in touched.run("return $('status').textContent"))
    touched.run("filmOf(current()).send({ do: 'push', disk: 0 })")
    wait_for(lambda: changes(touched) == ["disk 1 gets energy"])
    assert touched.run("return $('status').textContent") == ""


def test_a_finger_that_scrolls_over_a_slider_leaves_its_value(touched):
    """This takes 5 to 15 s, because the browser draws the moving disks during long gestures."""
    run = touched.run("return current().run")
    touched.press("s")
    x, y, width, value = touched.run(SLIDER, 3)
    for fraction in (0.2, 0.7):
        start = [x + fraction * width, y]
        touched.touch(*path(start, [start[0], start[1] - 120]))
        touched.until("return $('form').scrollTop")
        assert touched.run(SLIDER, 3)[3] == value
        to_the_top(touched)
    assert changes(touched) == [] and touched.run("return current().run") == run
    x, y, width, _ = touched.run(SLIDER, 3)
    touched.touch(*path([x + 0.8 * width, y], [x + 0.5 * width, y]))
    wait_for(lambda: changes(touched))
    assert touched.run(SLIDER, 3)[3] < value
    touched.touch([x + 0.2 * width, y])
    wait_for(lambda: float(changes(touched)[-1]) < 0.6)
    assert touched.run("return [current().run, $('form').scrollTop]") == [run, 0]


def test_a_finger_sets_the_speed_and_the_time_of_a_film_only_along_their_sliders(touched):
    wait_for(lambda: inside(touched, "past.length") > 9)
    for name in ("pace", "scrub"):
        value = f"return filmOf(current()).document.getElementById('{name}').value"
        x, y, _ = touched.run(IN_FILM, name)
        before = touched.run(value)
        touched.touch(*path([x - 20, y], [x - 20, y - 100]))
        touched.until("return filmOf(current()).scrollY")
        assert inside(touched, "state.playing")
        assert name == "scrub" or touched.run(value) == before
        to_the_top(touched)
        touched.touch(*path([x + 9, y], [x - 25, y]))
        wait_for(lambda value=value, before=before: touched.run(value) < before)
    assert not inside(touched, "state.playing")
