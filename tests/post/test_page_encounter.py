"""Laboratory with two to four disks: dragged arrows, momentum, energy, restitution."""

import numpy as np
import pytest

from laboratory_page import inside, pixel
from ricochet import Simulation
from sampling import mostly
from synthetic_run import ROOT
from test_page_layout import WIDE
from whole_runs import wait_for

MASSES = np.array([1.0, 2.0])
PHONE = (390, 844)  #: size of the window
#: Texts of a table, row by row, with the values of fields.
CELLS = """const { rows } = filmOf(current()).document.getElementById(arguments[0]);
    const text = one => one.firstElementChild?.value ?? one.textContent;
    return [...rows].slice(1).map(row => [...row.cells].map(text));"""
CLICK = "filmOf(current()).document.getElementById(arguments[0]).click()"
TEN_TIMES_FASTER = """const pace = filmOf(current()).document.getElementById('pace');
    pace.value = 1; pace.dispatchEvent(new Event('input'));"""
#: Position in the box of the tip of a disk's arrow.
TIP = """const film = filmOf(current()), [i] = arguments;
    return film.tipOf(i);"""


@pytest.fixture
def two(opened):
    """Return the laboratory with two disks before their collision."""
    opened.run("choose('collision')")
    opened.until("return !busy && current().wished.input === 'collision'")
    opened.until("return !!filmOf(current()).inside?.().film?.masses")
    return opened


def number(text):
    return float(text.replace("\u2212", "-"))


def table(browser, name="bodies"):
    return browser.run(CELLS, name)


def bodies(browser):
    """Return mass, velocity, momentum and energy of each disk and their sums, as shown."""
    return np.array([[number(text) for text in row[1:]] for row in table(browser)])


def rerun(browser, action):
    """Perform an action that starts a new run, and wait until the film shows it."""
    before = browser.run("return current().run")
    action()
    browser.until("return !busy && current().run > arguments[0]", before)
    browser.until("return filmOf(current()).inside().stream.run === current().run")


def collide(browser):
    """Step to the next disk-disk collision, and return it."""
    known = len(inside(browser, "encounter.collisions"))
    while len(inside(browser, "encounter.collisions")) == known:
        time = inside(browser, "moment.time")
        browser.press("n")
        wait_for(lambda t=time: inside(browser, "moment.time") > t)
    return inside(browser, "encounter.collisions")[-1]


def mouse(browser, *steps):
    """Press, move and release the mouse in the window."""
    moves = [
        {"type": "pointerMove", "duration": 30, "x": round(x), "y": round(y)} for x, y in steps
    ]
    down, lift = {"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}
    one = {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}}
    actions = [{**one, "actions": [moves[0], down, *moves[1:], lift]}]
    browser.call("POST", "/actions", {"actions": actions})
    browser.call("DELETE", "/actions")


def test_the_panel_shows_momenta_and_energies_and_waits_at_the_start(two):
    rows = bodies(two)
    assert rows[0] == pytest.approx([1, 0.5, 0, 0.5, 0, 0.125])
    assert rows[1] == pytest.approx([2, -0.2, 0, -0.4, 0, 0.04])
    assert rows[2] == pytest.approx([3, 0.1 / 3, 0, 0.1, 0, 0.165], abs=5e-5)
    assert inside(two, "moment.time") == 0 and not inside(two, "state.playing")
    assert two.run("return $('pause').textContent") == "Go on"
    two.press("p")
    wait_for(lambda: inside(two, "moment.time") > 0)


@pytest.mark.parametrize("restitution", mostly([1, 0.5, 0], [0.5]))
def test_a_collision_obeys_the_conservation_laws_and_the_restitution(two, restitution):
    two.run("bounce(arguments[0])", restitution)
    wait_for(lambda: two.run("return state.has['contact.restitution'] ?? '1'") == str(restitution))
    one = collide(two)
    before, after = np.array(one["before"]), np.array(one["after"])
    assert before == pytest.approx(np.array([[0.5, 0], [-0.2, 0]]), abs=1e-15)
    assert MASSES @ after == pytest.approx(MASSES @ before, abs=1e-15)
    assert one["separation"] == pytest.approx(restitution * one["approach"], abs=1e-14)
    # Sum of the radii 0.12, lines 0.06 apart: the normal is inclined by 30 degrees.
    assert one["approach"] == pytest.approx(0.7 * np.sqrt(0.75), rel=1e-12)
    lost = MASSES @ (before**2 - after**2).sum(axis=1) / 2
    reduced = 1 / (1 / MASSES).sum()
    expected = (1 - restitution**2) * reduced * one["approach"] ** 2 / 2
    assert lost == pytest.approx(expected, abs=1e-15)
    momentum, energy, speeds = table(two, "balance")
    assert momentum[1:] == ["(0.1, 0)"] * 2
    assert number(energy[1]) == 0.165
    assert number(energy[2].split()[0]) == pytest.approx(0.165 - expected, rel=1e-5)
    assert ("% lost" in energy[2]) == (restitution < 1)
    assert speeds[2].endswith(f"(ratio {restitution})")


def test_the_run_is_the_same_bit_for_bit_as_without_stops_at_collisions(two, program, tmp_path):
    two.run(TEN_TIMES_FASTER)
    two.press("p")
    wait_for(lambda: len(inside(two, "encounter.collisions")) > 2)
    two.press("p")
    wait_for(lambda: not inside(two, "state.playing"))
    times = [one["time"] for one in inside(two, "encounter.collisions")]
    with Simulation(ROOT / "input/collision.nml", {"stop.time": 1000}) as same:
        for when in times:
            same.advance_by(collisions=1)
            assert same.time == when


def test_an_arrow_is_dragged_by_mouse_at_the_start_and_changes_the_input(two):
    start = pixel(two, *two.run(TIP, 0))
    rerun(two, lambda: mouse(two, start, [start[0] + 20, start[1]], [start[0], start[1] - 60]))
    velocity = bodies(two)[0, 1:3]
    assert velocity[0] == 0.5 and velocity[1] > 0.1
    given = two.run("return textOf('species.disk1.velocity')")
    assert [*map(float, given.split(","))] == pytest.approx(velocity)
    assert f"species.disk1.velocity={given}" in two.run("return decodeURIComponent(location.hash)")
    assert inside(two, "moment.time") == 0 and not inside(two, "state.playing")
    assert two.run("return current().changes.length") == 0


def test_an_arrow_that_is_dragged_later_changes_the_moving_disks(two):
    collide(two)
    before, run = bodies(two), two.run("return current().run")
    start = pixel(two, *two.run(TIP, 1))
    mouse(two, start, [start[0] + 20, start[1]], [start[0] + 30, start[1] + 40])
    wait_for(lambda: two.run("return current().changes.length") == 1)
    assert two.run("return current().changes[0][2]") == "disk 2 gets a new velocity"
    after = bodies(two)
    assert after[0] == pytest.approx(before[0]) and after[1, 2] < before[1, 2]
    assert two.run("return current().run") == run


@pytest.mark.parametrize("size", mostly([(1024, 768), PHONE], [PHONE]))
def test_a_finger_drags_an_arrow_and_scrolls_nothing(two, size):
    two.resize(*size, True)
    two.protocol("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=5)
    two.draw(3)
    x, y = pixel(two, *two.run(TIP, 0))
    rerun(two, lambda: two.touch(*[[x + 3, y - 4 * k] for k in range(10)]))
    assert bodies(two)[0, 2] > 0
    assert two.run("return [filmOf(current()).scrollY, scrollY]") == [0, 0]
    two.protocol("Emulation.setTouchEmulationEnabled", enabled=False)


def test_fields_of_the_panel_set_masses_and_velocities(two):
    field = """const { rows } = filmOf(current()).document.getElementById('bodies');
        const one = rows[arguments[0]].cells[arguments[1]].firstElementChild;
        one.focus(); one.select();"""
    for row, column, text, variable, value in (
        (2, 3, "-0.35", "velocity", "-0.2,-0.35"),
        (1, 1, "4", "mass", "4"),
    ):
        two.run("current().frame.focus()")
        two.run(field, row, column)

        def enter(keys=text):
            two.press(*keys, "\ue007")

        rerun(two, enter)
        assert two.run("return textOf(arguments[0])", f"species.disk{row}.{variable}") == value
    rows = bodies(two)
    assert rows[1, 4] == pytest.approx(-0.7) and rows[0, 0] == 4


def test_in_the_frame_of_the_centre_of_mass_the_momenta_cancel(two):
    two.run(CLICK, "centred")
    wait_for(lambda: inside(two, "state.centred"))
    rows = bodies(two)
    assert rows[2, 1:5] == pytest.approx(np.zeros(4))
    assert rows[0, 3] == pytest.approx(-rows[1, 3])
    assert rows[2, 5] == pytest.approx(0.165 - 0.1**2 / 6, rel=1e-3)
    centre = two.run("const { x, y } = filmOf(current()).totals(); return [x, y]")
    places = []
    for _ in range(2):
        places.append(pixel(two, *centre))
        collide(two)
        centre = two.run("const { x, y } = filmOf(current()).totals(); return [x, y]")
    assert np.abs(np.subtract(*places)).max() <= 1
    assert table(two, "balance")[0][1:] == ["(0, 0)"] * 2


def test_disks_are_added_up_to_four_and_removed(two):
    for count in (3, 4, 3, 2):
        more = count > len(bodies(two)) - 1
        rerun(two, lambda button="more" if more else "fewer": two.run(CLICK, button))
        assert len(bodies(two)) == count + 1
        assert inside(two, "film.masses.length") == count
    state = """return ['more', 'fewer'].map(id =>
        filmOf(current()).document.getElementById(id).disabled)"""
    assert two.run(state) == [False, True]
    assert two.run("return location.hash") == "#input=collision"


#: Parts of the panel that must be visible without scrolling in a window of a computer.
SEEN = """const film = filmOf(current()), end = film.document.documentElement.clientHeight;
    const low = id => film.document.getElementById(id).getBoundingClientRect().bottom;
    const parts = ['play', 'stage', 'bodies', 'polygon', 'inelastic', 'balance'];
    return parts.filter(id => low(id) > end);"""


SIZES = [(1280, 800), (1366, 768), (1024, 768), PHONE]


@pytest.mark.parametrize("size", mostly(SIZES, [(1366, 768), PHONE]))
def test_nothing_of_the_panel_is_cut(two, size):
    """With three disks, and numbers of all lengths."""
    two.resize(*size)
    rerun(two, lambda: two.run(CLICK, "more"))
    rerun(two, lambda: two.run("redefine('disk1', 'velocity', [-0.123456, 0.654321])"))
    collide(two)
    assert two.run(WIDE) == []
    stage = """return filmOf(current()).document.getElementById('stage')
        .getBoundingClientRect().height"""
    assert two.run(stage) > 0.4 * min(size)
    if size[0] > 700:
        assert two.run(SEEN) == []


def test_without_gravity_the_energy_changes_only_at_collisions(two):
    """Between samples before and after a collision, the curve is no sloped line."""
    two.run("bounce(0)")
    wait_for(lambda: two.run("return state.has['contact.restitution']") == "0")
    one = collide(two)
    wait_for(lambda: inside(two, "stream.curves.time").count(one["time"]) == 2)
    two.press("p")
    wait_for(lambda: inside(two, "moment.time") > one["time"] + 0.3)
    two.press("p")
    wait_for(lambda: not inside(two, "state.playing"))
    curves = inside(two, "stream.curves")
    for s, mass in enumerate(MASSES):
        before, after = (mass * np.square(one[name][s]).sum() / 2 for name in ("before", "after"))
        true = np.where(np.array(curves["time"]) < one["time"], before, after)
        at = curves["time"].index(one["time"])
        assert curves["kinetic"][s][at] == pytest.approx(before), "immediately before"
        np.testing.assert_allclose(np.delete(curves["kinetic"][s], at), np.delete(true, at))


def test_events_to_come_are_those_of_the_moment_shown(two):
    """A step back does not show the events that follow the newest frame."""
    queue = "filmOf(current()).document.getElementById('queue').textContent"
    wait_for(lambda: "disk 1 and disk 2" in two.run(f"return {queue}"))
    first = two.run(f"return {queue}")
    collide(two)
    wait_for(lambda: two.run(f"return {queue}") not in ("", first))
    two.press("\ue011")  # Home
    wait_for(lambda: inside(two, "moment.time") == 0)
    assert two.run(f"return {queue}") == first


PAINTED = """const canvas = filmOf(current()).document.getElementById('energy');
    const { width, height } = canvas, copy = document.createElement('canvas');
    Object.assign(copy, { width, height });
    const pen = copy.getContext('2d', { willReadFrequently: true });
    pen.drawImage(canvas, 0, 0);
    const { data } = pen.getImageData(0, 0, width, height), [r, g, b] = arguments[0];
    return data.some((_, k) => k % 4 === 0 && data[k + 3] > 99
      && Math.abs(data[k] - r) + Math.abs(data[k + 1] - g) + Math.abs(data[k + 2] - b) < 12);"""


def test_the_energy_is_plotted_from_the_first_moment(two):
    colour = two.run(
        "const film = filmOf(current()); return film.speciesColour(film.inside().kinds[1])"
    )
    wait_for(lambda: two.run(PAINTED, colour))
    collide(two)
    wait_for(lambda: two.run(PAINTED, colour))


def test_a_disk_dropped_on_another_returns_and_the_message_names_both(two):
    """The disks have the numbers of the picture; no slider of the form shows the message."""
    start, other = pixel(two, 0.25, 0.53), pixel(two, 0.75, 0.47)
    grip = [start[0] - 10, start[1] + 5]
    mouse(two, grip, [grip[0], grip[1] + 40], [other[0] - 10, other[1] + 5])
    wait_for(lambda: two.run("return $('status').textContent") == "disk 1 would overlap disk 2")
    assert two.run("return [state.settings, state.waiting]") == [{}, {}]
    wait_for(lambda: inside(two, "moment.time") == 0)
    said = "return [...document.querySelectorAll('#form .problem')].map(one => one.textContent)"
    assert "".join(two.run(said)) == ""
    drop = two.run("return filmOf(current()).pixelOf(0.25, 0.53)")
    assert two.run("return filmOf(current()).diskAt(...arguments[0], 0)", drop) == 0


LABELS = """const film = filmOf(current()), words = [];
    const marks = film.document.getElementById('marks').getContext('2d');
    marks.fillText = text => { words.push(String(text)); };
    film.drawStage();
    delete marks.fillText;
    film.drawStage();
    return words;"""


def test_keys_control_the_film_after_a_slider_is_released(two):
    """A slider reached with the Tab key keeps the keys that move it."""
    middle = """const one = document.querySelectorAll('.slider [type=range]')[arguments[0]];
        const { x, y, width, height } = one.getBoundingClientRect();
        return [x + width / 2, y + height / 2];"""
    x, y = two.run(middle, 2)
    rerun(two, lambda: mouse(two, [x, y], [x + 10, y], [x + 20, y]))
    settings, run = two.run("return [state.settings, current().run]")
    assert list(settings) == ["species.disk2.mass"]
    collide(two)
    for key, condition in (("\ue011", "=== 0"), ("\ue014", "> 0")):  # Home, right
        two.press(key)
        two.until(f"return filmOf(current()).inside().moment.time {condition}")
    assert two.run("return [state.settings, current().run]") == [settings, run]
    two.run("document.querySelectorAll('.slider [type=range]')[2].focus()")
    rerun(two, lambda: two.press("\ue014"))
    assert two.run("return state.settings") != settings


def test_the_next_event_is_labelled_and_can_be_hidden(two):
    """A teacher who asks for a prediction hides it in the picture and in the list."""
    wait_for(lambda: "next event: t = 0.5658" in two.run(LABELS))
    queue = "return filmOf(current()).document.getElementById('queue').childElementCount"
    assert two.run(queue) > 0
    two.run(CLICK, "foretold")
    assert not any("next event" in text for text in two.run(LABELS))
    assert two.run(queue) == 0
    two.press("c")  # the next run beside this one hides it, too
    wait_for(lambda: two.run("return state.boxes.length === 2 && !busy && current().run > 1"))
    wait_for(lambda: two.run("return films().every(one => !one.inside().state.foretold)"))
    two.run(CLICK, "foretold")
    wait_for(lambda: two.run("return films().every(one => one.inside().state.foretold)"))


def test_the_energies_of_both_tables_name_their_frame_of_reference(two):
    text = "return filmOf(current()).document.querySelector(arguments[0]).innerText"
    plain = [two.run(text, f"section:has(#{name}) h2") for name in ("bodies", "energies")]
    assert plain == ["Momentum and energy", "Energy per disk"]
    two.run(CLICK, "centred")
    wait_for(lambda: inside(two, "state.centred"))
    found = [two.run(text, f"section:has(#{name}) h2") for name in ("bodies", "energies")]
    assert found == [
        "Momentum and energy, centre-of-mass frame",
        "Energy per disk, frame of the box",
    ]


def test_momenta_have_the_colours_of_their_disks_and_a_scale(two):
    drawn = """const film = filmOf(current()), colours = [];
        const marks = film.document.getElementById('marks').getContext('2d');
        marks.fill = path => { if (path) colours.push(marks.fillStyle); };
        film.drawMomenta();
        delete marks.fill;
        film.drawStage();
        const { kinds } = film.inside(), probe = document.createElement('canvas').getContext('2d');
        const own = kinds.map(kind => {
          probe.fillStyle = `rgb(${film.speciesColour(kind)})`;
          return probe.fillStyle;
        });
        return [colours, own];"""
    colours, own = two.run(drawn)
    assert colours[:2] == own and len(set(own)) == 2
    two.until(f"const words = (() => {{ {LABELS} }})(); return words.includes('momentum 1')")
    assert "speed 0.8" in two.run(LABELS)
    two.run(CLICK, "momenta")
    wait_for(lambda: not any("momentum" in text for text in two.run(LABELS)))


def test_compared_collisions_have_their_tables_side_by_side_at_one_time(two):
    two.press("c")
    two.until("return state.boxes.length === 2 && !busy && current().run === state.runs")
    two.until("return !!filmOf(current()).inside?.().film?.masses")
    two.run("bounce(0)")
    two.until("return current().changes.length === 1")
    assert collide(two)["separation"] == pytest.approx(0, abs=1e-12)
    at_once = "const [a, b] = films().map(one => one.inside().moment.time); return a === b && a > 0"
    two.until(at_once)
    texts = """const { document } = filmOf(current());
        const other = document.querySelector('#others > div');
        return [other, document.querySelector('.own')].map(part => [
          part.querySelector('h2').innerText, part.getBoundingClientRect().top,
          [...part.querySelectorAll('table')].at(-1).rows[3]?.cells[2].textContent ?? '']);"""
    two.until(f"const [[,, words]] = (() => {{ {texts} }})(); return words.includes('ratio 1')")
    (first, top, _), (second, beside, speeds) = two.run(texts)
    assert (first, second) == ("Run A", "Momentum and energy of run B")
    assert top == beside and speeds.endswith("(ratio 0)")


def test_walls_keep_the_energy_of_a_perfectly_inelastic_collision(two):
    two.run("bounce(0)")
    two.until("return current().changes.length === 1")
    collide(two)
    energy = bodies(two)[2, 5]
    for _ in range(2):  # two events at walls
        time = inside(two, "moment.time")
        two.press("n")
        wait_for(lambda t=time: inside(two, "moment.time") > t)
    assert bodies(two)[2, 5] == pytest.approx(energy)


def test_changes_are_listed_in_words(two):
    for _ in range(2):
        rerun(two, lambda: two.run(CLICK, "more"))
    rerun(two, lambda: two.run("redefine('disk1', 'velocity', [0.415, -0.345])"))
    words = "velocity of disk1 = (0.415, \u22120.345) · disk3 added · disk4 added"
    assert two.run("return current().words") == words
    one = two.run("return inWords(['species.disk1.position', '0.3,0.5'])")
    assert one == "position of disk1 = (0.3, 0.5)", "the slider shows the height alone"
    one = two.run("return inWords(['species.disk1.position', '0.25,0.5'])")
    assert one == "height of disk 1 at the start = 0.5"


#: Cells and fields of the tables of a panel that are too narrow for their content.
NARROW = """const { document } = filmOf(current());
    return [...document.querySelectorAll('.bodies :is(input, td, th)')]
      .filter(one => one.scrollWidth > one.clientWidth)
      .map(one => [one.value ?? one.textContent, one.scrollWidth, one.clientWidth])"""


def test_no_number_of_the_table_is_cut_or_touches_another(two):
    rerun(two, lambda: two.run(CLICK, "more"))
    rerun(two, lambda: two.run("redefine('disk1', 'velocity', [-0.123456, -0.654321])"))
    for size in SIZES:
        two.resize(*size)
        for is_bare in (False, True):
            two.run("bare(arguments[0])", is_bare)
            two.draw(3)
            cells = "return filmOf(current()).document.querySelectorAll('.bodies input').length"
            assert two.run(cells) == 9 and two.run(NARROW) == [], (size, is_bare)
