"""Page of the laboratory: sliders, texts, keys, mouse, downloads and addresses."""

import itertools
import os
import random

import numpy as np
import pytest

from laboratory import laboratory
from laboratory_page import inside, moving, pixel, slide, type_at
from ricochet import Simulation
from ricochet.pages.worker import DISKS, setting_lines
from ricochet.running.program import ProgramError
from sampling import mostly
from synthetic_run import ROOT
from whole_runs import wait_for


def test_changes_that_a_run_refuses_start_one_run_that_moves(opened):
    """After a collapse, messages about the old run do not stop the new one."""
    before = opened.run("return current().run")
    opened.run("""const one = filmOf(current()), settings = { 'species.gas.count': '5' };
        one.inside().stream.ended = true;
        for (let k = 0; k < 3; k++) one.send({ do: 'change', settings });""")
    moving(opened, before)
    reached = inside(opened, "moment.time")
    wait_for(lambda: inside(opened, "moment.time") > reached)
    assert opened.run("return [current().run, again, state.paused]") == [before + 1, False, False]


def test_what_acts_on_the_disks_acts_at_once_and_the_rest_starts_anew(opened):
    before, time = opened.run("return current().run"), inside(opened, "moment.time")
    slide(opened, 3, 0.5)  # restitution
    opened.until("return current().changes.length")
    assert opened.run("return current().run") == before and inside(opened, "moment.time") >= time
    when, name, value = opened.run("return current().changes.at(-1)")
    assert when >= time and name == "contact.restitution" and float(value) == 0.65
    assert "restitution of two disks = 0.65" in opened.run("return $('changes').textContent")
    assert inside(opened, "film.settles") is False, "no Maxwell curve any more"
    opened.run("$('heat').querySelector('button:last-of-type').click()")
    wait_for(lambda: opened.run("return current().changes.length") == 2)
    assert "all speeds times 1.25" in opened.run("return $('changes').textContent")
    slide(opened, 1, 0.5)  # number of disks
    moving(opened, before)
    assert inside(opened, "kinds[0].count") == int(opened.run("return textOf('species.gas.count')"))
    assert "number of disks = " in opened.run("return current().words")
    assert opened.run("return current().changes.length") == 0


def test_a_slider_of_decades_has_each_of_them(opened):
    for name, middle in (("mass", 31.6), ("count", 32)):
        spec = {"key": f"species.gas.{name}", "from": 1, "to": 1000, "log": True}
        assert opened.run("return valuesOf(arguments[0], 2)", spec) == [1, middle, 1000]


def test_a_value_that_cannot_be_waits_alone(opened):
    before = opened.run("return current().run")
    opened.run("set('species.gas.radius', '0.03')")
    wait_for(lambda: opened.run("return document.querySelectorAll('.wrong').length") == 1)
    moving(opened)
    rows = opened.run("return [...document.querySelectorAll('.wrong')].map(one => one.innerText)")
    assert rows[0].startswith("radius of a disk") and "too full: at most 0.0126" in rows[0]
    opened.run("set('species.gas.speed', '2')")
    wait_for(lambda: opened.run("return current().words") == "speed of each disk at the start = 2")
    moving(opened, before)
    opened.run("set('species.gas.radius', '0.005')")
    wait_for(lambda: "radius" in opened.run("return current().words"))
    assert opened.run("return document.querySelector('.wrong')") is None


#: Texts typed beside sliders of the input gas: index, variable, an allowed value.
TYPED = [
    (0, "species.gas.speed", lambda rng: rng.uniform(0.1, 9)),
    (1, "species.gas.count", lambda rng: rng.randint(2, 900)),
    (2, "species.gas.radius", lambda rng: rng.uniform(1e-4, 0.01)),
    (3, "contact.restitution", lambda rng: rng.uniform(0.3, 1.0)),
    (4, "box.gravity", lambda rng: rng.uniform(-9, 9)),
]


def some_text(rng, value):
    """Return a random text that is, or resembles, a number."""
    forms = "{}", "{:.3}", "{:.2e}", " {:.9f}", "{:.12}!"
    text = str(value) if isinstance(value, int) else rng.choice(forms).format(value)
    text = rng.choice([text, text.replace("e", "D"), text.replace(".", ",")])
    if rng.random() < 0.5:
        place = rng.randrange(len(text) + 1)
        new = rng.choice(["", " ", "*", "/", "-", "abc", "2*", "'", "=", ",,", "½", "1 ", "nan"])
        text = rng.choice([text[:place] + new + text[place + 1 :], new])
    return text


def test_a_text_at_a_slider_is_the_value_that_runs_or_waits_with_one_message(opened):
    """The program decides whether the text is valid; nothing else changes.

    THOROUGH tests more texts.
    """
    rng, path = random.Random(8), ROOT / "input/gas.nml"
    opened.run("""const old = hear; hear = (source, news) =>
        news.is === 'file' ? window.kept = atob(news.body) : old(source, news);""")
    good, waiting = {}, set()
    for _ in range(40 if os.environ.get("THOROUGH") else 15):
        number, key, value = rng.choice(TYPED)
        text = some_text(rng, value(rng))
        before = opened.run("return [current().run, current().changes.length]")
        type_at(opened, number, text)
        done = f"return !busy && !again && ('{key}' in state.waiting || !differs('{key}'))"
        opened.until(done)
        plain = text.strip().replace(",", ".")
        wish = good | {key: f"0,{plain}" if key == "box.gravity" else plain}
        try:
            with Simulation._of(path.read_text(), setting_lines(wish)) as trial:
                fine = trial.n_disks <= DISKS
        except ProgramError:
            fine = False
        if fine:
            good = wish
        waiting = waiting - {key} if fine else waiting | {key}
        wrong = """return [...document.querySelectorAll('.wrong')].map(
            one => one.querySelector('.problem').textContent);"""
        said = opened.run(wrong)
        assert len(said) == len(waiting) and all(said), (text, said)
        assert key in opened.run("return Object.keys(state.waiting)") or fine, text
        assert fine or before == opened.run("return [current().run, current().changes.length]")
        opened.run("window.kept = ''")
        # A request during which the run collapses is answered by the message about the collapse.
        ask = "filmOf(current()).send({ do: 'keep', part: 'input' }); return window.kept"
        wait_for(lambda script=ask: opened.run(script))
        with (
            Simulation(opened.run("return window.kept")) as there,
            Simulation._of(path.read_text(), setting_lines(good)) as expected,
        ):
            assert there.parameters == expected.parameters, text


def test_the_table_shows_the_moment_that_is_shown(opened):
    """The values are those of the disks shown; kT never exceeds the kinetic energy of a disk."""
    before = opened.run("return current().run")
    opened.run("choose('mixture')")
    moving(opened, before)
    opened.run("set('contact.restitution', '0.9')")
    wait_for(lambda: inside(opened, "moment.collisions") > 3)
    opened.press("p")
    wait_for(lambda: not inside(opened, "state.playing"))
    titles = ["temperature", "mean speed of light", "mean speed of heavy"]
    for key in ("\ue011", "\ue014", "\ue014", "\ue010", "\ue012"):  # Home, right, right, End, left
        opened.press(key)
        rows = inside(opened, "numbersNow()")
        assert [row["name"] for row in rows][:3] == titles
        table = opened.run("""return [...filmOf(current()).document.getElementById('numbers').rows]
            .map(row => [...row.cells].map(cell => cell.textContent))""")
        assert table[0][:2] == ["", "now"] and [row[0] for row in table[1:4]] == titles
        kinetic = sum(inside(opened, "moment.kinetic")) / 2
        assert 0.97 * kinetic < rows[0]["now"] <= kinetic
        assert float(table[1][1]) == pytest.approx(rows[0]["now"], rel=1e-3)
        if key == "\ue011":
            assert [float(row[1]) for row in table[2:4]] == [1, 1]


def mouse(browser, *moves):
    """Move the mouse to window coordinates; 'down' and 'up' press and release its button."""
    made = []
    for one in moves:
        if one in ("down", "up"):
            made.append({"type": f"pointer{one.title()}", "button": 0})
        else:
            made.append({"type": "pointerMove", "duration": 40, "x": one[0], "y": one[1]})
    pointer = {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}}
    browser.call("POST", "/actions", {"actions": [{**pointer, "actions": made}]})


def repeated(browser):
    """Download the script of the paused newest run; return time and positions after running it."""
    browser.run("""const old = hear; hear = (source, news) =>
        news.is === 'file' ? window.kept = atob(news.body) : old(source, news);
        window.kept = ''; filmOf(current()).send({ do: 'keep', part: 'script' })""")
    browser.until("return window.kept")
    script, space = browser.run("return window.kept"), {}
    exec(script.replace("    print(", "    end = simulation.time, simulation.position  # ("), space)
    return space["end"]


def test_the_mouse_grips_each_side_from_both_faces(opened):
    """The pointer changes its shape within 12 pixels of a side, which it drags inwards."""
    names = ("left", "right", "bottom", "top")
    cursor = "return filmOf(current()).document.getElementById('stage').style.cursor[0]"
    for shift, number in itertools.product((-12, 12), range(4)):
        axis, inwards = number // 2, (1, -1, -1, 1)[number]  # in window coordinates
        place = [0.4, 0.4]
        place[axis] = inside(opened, "past.at(-1).sides")[number]
        start = pixel(opened, *place)
        start[axis] += shift
        end = start[:]
        end[axis] += 9 * inwards
        count = len(opened.run("return current().changes"))
        mouse(opened, start)
        wait_for(lambda shape="en"[axis]: opened.run(cursor) == shape)
        mouse(opened, "down", end)
        wait_for(lambda n=count: len(opened.run("return current().changes")) > n)
        mouse(opened, "up")
        last = "return current().changes.at(-1)[2]"
        assert opened.run(last) == f"the {names[number]} side is dragged"


def test_a_dragged_side_follows_the_mouse_and_then_stays(opened):
    """The motion is a change of the running simulation, which the script repeats."""
    run, middle = opened.run("return current().run"), pixel(opened, 1, 0.5)
    end = pixel(opened, 0.8, 0.5)
    steps = [[x, end[1]] for x in np.linspace(middle[0], end[0], 12).round().astype(int).tolist()]
    mouse(opened, middle, "down", *steps)
    right = "past.at(-1).sides[1]"

    def is_near_the_mouse():
        mouse(opened, [end[0] + 1, end[1]], end)
        return inside(opened, right) < 0.85

    wait_for(is_near_the_mouse)  # the side is not faster than the disks
    assert inside(opened, right) > 0.75
    mouse(opened, "up")
    wait_for(
        lambda: opened.run("return current().changes.at(-1)[2]") == "the right side is dragged"
    )

    def stays():
        time, place = inside(opened, "past.at(-1).time"), inside(opened, right)
        wait_for(lambda: inside(opened, "past.at(-1).time") > time)
        return inside(opened, right) == place

    wait_for(stays)  # the side moves until the worker has been told of its release
    opened.press("p")
    wait_for(lambda: not inside(opened, "state.playing"))
    place = inside(opened, right)
    opened.press("\ue014")
    wait_for(lambda: inside(opened, "moment.time") == inside(opened, "past.at(-1).time"))
    assert inside(opened, right) == pytest.approx(place)
    time, position = repeated(opened)
    assert time == pytest.approx(inside(opened, "moment.time"))
    assert position[:, 0].max() < place
    assert opened.run("return [current().run, location.hash]") == [run, "#input=gas"]


def test_a_disk_is_dragged_while_the_run_is_paused_and_gets_energy(opened):
    opened.press("p")
    wait_for(lambda: not inside(opened, "state.playing"))
    at = "[inside().past.at(-1).place.slice(0, 2), inside().past.at(-1).velocity.slice(0, 2)]"
    state = f"return (inside => {at}.map(one => [...one]))(filmOf(current()).inside)"
    (x, y), before = opened.run(state)
    others = opened.run("return [...filmOf(current()).inside().past.at(-1).place]")
    others = np.reshape(others, (-1, 2))[1:]
    rng = np.random.default_rng(1)
    free = next(
        p for p in rng.uniform(0.1, 0.9, (9999, 2)) if np.hypot(*(others - p).T).min() > 0.012
    )
    start, end = pixel(opened, x, y), pixel(opened, *free)
    mouse(opened, start, "down", [start[0] + 9, start[1] + 9], end, "up")
    wait_for(lambda: opened.run("return current().changes.length") == 1)
    (x, y), velocity = opened.run(state)
    assert [x, y] == pytest.approx(free, abs=0.004) and velocity == before
    mouse(opened, end, "down", "up")
    assert opened.run("return filmOf(current()).inside().state.traced") == [0]
    opened.run("filmOf(current()).document.getElementById('push').click()")
    wait_for(lambda: opened.run("return current().changes.length") == 2)
    (x, y), velocity = opened.run(state)
    assert np.sum(np.square(velocity)) == pytest.approx(2 * np.sum(np.square(before)), rel=1e-5)
    assert opened.run("return current().changes.map(one => one[2])") == [
        "disk 1 is moved",
        "disk 1 gets energy",
    ]
    taken = pixel(opened, *others[0])
    mouse(opened, pixel(opened, x, y), "down", [taken[0] + 9, taken[1]], taken, "up")
    wait_for(lambda: "overlaps" in opened.run("return $('status').textContent"))
    assert opened.run(state)[0] == [x, y] and opened.run("return current().run") == 1
    _, position = repeated(opened)
    assert position[0] == pytest.approx([x, y], abs=1e-6)


def test_a_paused_run_goes_back_step_by_step_and_on(opened):
    opened.press("p")
    wait_for(lambda: not inside(opened, "state.playing"))
    opened.press("\ue012")  # arrow left
    assert inside(opened, "moment.time") < inside(opened, "past.at(-1).time")
    opened.press("\ue010")  # End
    newest = inside(opened, "moment.time")
    opened.press("\ue014")  # arrow right
    wait_for(lambda: inside(opened, "moment.time") > newest)
    before = inside(opened, "moment.time")
    opened.press("n")
    wait_for(lambda: inside(opened, "moment.time") > before)
    opened.press("p")
    wait_for(lambda: inside(opened, "moment.time") > before + 0.01)


def test_the_frame_before_a_change_is_one_step_back(opened):
    """A change of the paused run replaces the newest frame and adds none."""
    wait_for(lambda: inside(opened, "past.length") > 3)
    opened.press("p")
    wait_for(lambda: not inside(opened, "state.playing"))
    for disk in (0, 1):
        opened.run("filmOf(current()).send({ do: 'push', disk: arguments[0] })", disk)
        wait_for(lambda n=disk: len(opened.run("return current().changes")) > n)
    times = inside(opened, "past.map(frame => frame.time)")
    assert times[-1] - times[-2] > 1e-6
    opened.press("\ue012")  # arrow left
    assert inside(opened, "moment.time") == times[-2]


def test_what_is_clicked_is_downloaded_or_measured(opened, tmp_path):
    """Script and output have the same time, the input can be run, and a scan returns energies."""
    slide(opened, 3, 0.5)  # restitution
    wait_for(lambda: "script" in opened.run("return $('shelf').textContent"))
    changed = opened.run("return current().changes[0][0]")
    wait_for(lambda: inside(opened, "moment.time") > changed + 0.05)
    opened.press("p")
    wait_for(lambda: not inside(opened, "state.playing"))
    where = {"behavior": "allow", "downloadPath": str(tmp_path)}
    wish = {"cmd": "Browser.setDownloadBehavior", "params": where}
    opened.call("POST", "/goog/cdp/execute", wish)
    for number, name in enumerate(("gas.nml", "gas.py", "gas.h5.part")):
        opened.run("$('shelf').querySelectorAll('button')[arguments[0]].click()", number)
        wait_for((tmp_path / name).exists)
    space = {}
    script = (tmp_path / "gas.py").read_text()
    exec(
        script.replace("    print(", "    state = simulation.time, simulation.position  # ("), space
    )
    time, position = space["state"]
    assert inside(opened, "moment.time") == pytest.approx(time), "of the moment that is seen"
    with Simulation.load(tmp_path / "gas.h5.part") as there:
        assert there.time == time and np.array_equal(there.position, position)
    with Simulation(tmp_path / "gas.nml") as again:
        assert again.parameters["contact"]["restitution"] == 0.65
    opened.run("set('contact.restitution', '1')")
    opened.run("$('scanning').open = true")
    opened.click("scan")
    wait_for(lambda: opened.run("return scan.points.length") == 5)
    for speed, mean, _ in opened.run("return scan.points"):
        assert mean == pytest.approx(speed**2 / 2)
    assert "mean kinetic energy against speed" in opened.run("return $('points').innerText")


LINKS = {  # values in an address, and a property of the film
    "a number": ("crater", {"species.projectile.mass": "50"}, ("kinds[1].mass", 50)),
    "a vector": ("gas", {"box.gravity": "0,-2"}, ("film.gravity", [0, -2])),
    "an added group": (
        "gas",
        {"obstacle.post.centre": "0.5,0.5", "obstacle.post.radius": "0.1"},
        ("film.obstacles[0]", [0.5, 0.5, 0.1, False]),
    ),
    "letters": ("gas", {"run.title": "'50 % & more + #1'"}, ("kinds[0].count", 1000)),
}


@pytest.mark.parametrize("case", mostly(LINKS, ["an added group", "letters"]))
def test_the_address_holds_input_and_values_and_brings_them_back(opened, case):
    """A link, the reloaded page of the link, and values chosen on the page lead to the same run."""
    name, settings, (what, value) = LINKS[case]
    before = opened.run("return current().run")
    start = "const [name, settings] = arguments; choose(name, settings)"
    opened.run(start, name, settings)
    moving(opened, before)
    address = opened.run("return location.href")
    assert f"#input={name}&" in address
    for _ in range(2):
        opened.open("about:blank")
        opened.open(address)
        moving(opened)
        assert opened.run("return location.href") == address
        assert opened.run("return state.has") == settings
        assert inside(opened, what) == value
        assert opened.run("return $('status').textContent") == ""
    opened.run("location.hash = '#input=cooling&contact.restitution=0.5'")
    moving(opened, 1)
    assert opened.run("return [state.input.name, state.has]") == [
        "cooling",
        {"contact.restitution": "0.5"},
    ]
    opened.run("set('contact.restitution', '0.75')")
    wait_for(lambda: opened.run("return location.hash").endswith("contact.restitution=0.75"))


def test_an_address_with_mistakes_shows_a_run_and_the_mistake(opened):
    for wish, words in (
        ("input=none", "There is no input none."),
        ("input=gas&species.gas.size=3", "There is no variable species.gas.size."),
        ("input=gas&toString=3", "There is no variable toString."),
        ("input=gas&species.gas.radius=-1", "One value is not possible"),
        ("input=gas&contact.restitution=%3Cb%3E", "One value is not possible"),
    ):
        before = opened.run("return current().run")
        opened.run("location.hash = arguments[0]", wish)
        moving(opened, before)
        assert words in opened.run("return $('status').textContent")
        assert opened.run("return [state.input.name, location.hash]") == ["gas", "#input=gas"]


#: Values in the group `&contact` on which the values of other variables depend.
LAWS = [
    {"restitution": 0.8, "wall_rule": "velocity"},
    {"restitution": 0.6, "wall_rule": "normal", "tangential_restitution": 0.25, "friction": 0.35},
]
SHOWN = """const field = document.getElementById('v.' + arguments[0]);
    return field.placeholder ?? field.options[0].text.slice(1, -1)"""
AT_SLIDER = """const at = state.input.sliders.findIndex(({ key }) => key === arguments[0]);
    const row = document.querySelectorAll('.slider')[at];
    const [range, field] = row.querySelectorAll('input');
    return [range.ariaValueText, field.value]"""


def test_a_variable_without_a_value_shows_the_value_that_acts(opened):
    """Its default may be the value of another variable, which changes."""
    before, side = opened.run("return current().run"), {"side.left.motion": "still"}
    opened.run("choose('cooling', arguments[0])", side)
    moving(opened, before)
    opened.run("$('everything').open = true")
    opened.until("return document.getElementById('v.side.left.rule')")
    text = (ROOT / "input/cooling.nml").read_text() + "\n&side name = 'left' /\n"
    for laws in LAWS:
        settings = {f"contact.{name}": str(value) for name, value in laws.items()}
        opened.run(
            "for (const [key, text] of Object.entries(arguments[0])) set(key, text)", settings
        )
        with Simulation._of(text, setting_lines(side | settings)) as run:
            own = run.parameters["side"]["left"]
            walls = str(run.parameters["contact"]["wall_restitution"])
        for name in {"restitution", "rule", "tangential_restitution", "friction"} & own.keys():
            assert opened.run(SHOWN, f"side.left.{name}") == str(own[name]), name
        assert opened.run(SHOWN, "contact.wall_restitution") == walls == str(laws["restitution"])
        words, field = opened.run(AT_SLIDER, "contact.wall_restitution")
        assert field == walls and words.startswith(f"{walls}, from ")


def test_a_slider_without_a_value_says_which_variable_determines_it(opened):
    """Without a restitution of their own, walls have that of two disks."""
    opened.run("choose('cooling')")
    opened.until("return !busy && current().wished.input === 'cooling'")
    notes = "return [...document.querySelectorAll('.slider small')].map(one => one.textContent)"
    opened.until(f"const notes = (() => {{ {notes} }})(); return notes.length === 5 && notes[1]")
    assert opened.run(notes)[:2] == ["at once", "at once; as restitution of two disks"]
    opened.run("set('contact.wall_restitution', '0.95')")
    assert opened.run(notes)[1] == "at once"
    opened.run("set('contact.restitution', '0.8')")
    assert opened.run("return numberOf('contact.wall_restitution')") == 0.95


def test_an_input_with_mistakes_shows_them_in_the_place_of_its_film(browser, program, tmp_path):
    (tmp_path / "own.nml").write_text("&species masss = 1 count = 9 /\n&box uper = 2, 2 /\n")
    with laboratory(program, tmp_path, tmp_path / "own.nml") as (_, address):
        browser.open(f"{address}#input=own")
        browser.until("return document.querySelector('#status.problem')")
        film = "filmOf(current()).document"
        shown = browser.run(f"return {film}.getElementById('starting').innerText").splitlines()
        assert [line.partition(";")[0] for line in shown] == [
            "own.nml:1: species.masss: unknown variable",
            "own.nml:1: species.radius: is missing",
            "own.nml:2: box.uper: unknown variable",
        ]
        seen = "return getComputedStyle({}).visibility"
        assert browser.run(seen.format(f"{film}.getElementById('starting')")) == "visible"
        assert "no sliders" in browser.run("return $('sliders').innerText")
        (tmp_path / "own.nml").write_text("&species radius = 0.01 count = 9 speed = 1 /\n")
        browser.click("run")
        moving(browser)
        assert browser.run(seen.format(f"{film}.getElementById('starting')")) == "hidden"
        assert browser.run(seen.format(f"{film}.getElementById('stage')")) == "visible"
        assert browser.complaints() == []
        browser.open("about:blank")
