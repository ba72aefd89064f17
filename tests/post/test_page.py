"""The page of the laboratory: controls for each input, accessibility and visibility."""

import importlib.util
import json
import random
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

import player
from ricochet import Simulation
from ricochet.pages.lab import form
from ricochet.pages.worker import DISKS, setting_lines
from ricochet.running.program import ProgramError
from synthetic_run import ROOT
from whole_runs import PATIENCE, wait_for

INPUTS = sorted(set((ROOT / "input").glob("*.nml")) - {ROOT / "input/reference.nml"})
CHOOSER = json.loads((ROOT / "input/chooser.json").read_text())


def test_every_input_has_its_place_in_the_chooser_and_a_picture_of_now():
    source = ROOT / "docs/chooser_pictures.py"
    spec = importlib.util.spec_from_file_location("chooser_pictures", source)
    pictures = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(pictures)
    assert {path.stem for path in INPUTS} == CHOOSER.keys()
    assert [one["name"] for one in player.chooser(INPUTS)] == list(CHOOSER)
    for path in INPUTS:
        own, drawn = CHOOSER[path.stem], ROOT / f"input/pictures/{path.stem}.png"
        assert own["title"] and own["subject"] and own["sentence"].endswith((".", "?"))
        assert drawn.stat().st_size < 10_000
        shown = Image.open(drawn).text["input"]
        message = f"make it anew: python docs/chooser_pictures.py {path.stem}"
        assert shown == pictures.digest(path, own["at"]), message


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.stem)
def test_both_ends_of_each_slider_run(path, monkeypatch, program):
    monkeypatch.setenv("RICOCHET", str(program))
    given = {group["place"]: group["given"] for group in form(path)["groups"]}
    assert len(CHOOSER[path.stem]["sliders"]) == 5
    for name, words, *ends in CHOOSER[path.stem]["sliders"]:
        assert not set("&_'") & set(words), "in words, not in names of variables"
        variable, _, component = name.removesuffix("]").partition("[")
        place, _, own = variable.rpartition(".")
        for end in ends[:2]:
            value = end
            if component:
                value = [*map(float, given.get(place, {}).get(own, "0,0").split(","))]
                value[int(component)] = end
            with Simulation(path, {variable: value}) as run:
                run.advance(time=1e-3)


def test_disks_can_be_told_from_both_grounds_and_species_in_grey(simulated, browser, tmp_path):
    """The contrast is at least 3 to 1, as required by WCAG 2.2 for graphics (1.4.11)."""
    species = "".join(f"&species count = 3 radius = 0.0{k} speed = 1 /\n" for k in (1, 2, 3, 4))
    run = simulated(species + "&stop time = 1 /\n")
    (tmp_path / "film.html").write_text(player.whole(run))
    browser.open(tmp_path / "film.html")
    for dark in (False, True):
        ground, disks, scale = browser.run(
            """theme(arguments[0]); refresh();
            const paper = [1, 3, 5].map(k => parseInt(ink.stage.slice(k, k + 2), 16));
            const scale = Array.from({ length: 256 }, (_, k) => scaleColour(k));
            return [[paper], kinds.map(speciesColour), scale].map(all => all.map(luminance));""",
            dark,
        )
        for one in disks + scale:
            low, high = sorted((one, ground[0]))
            assert (high + 0.05) / (low + 0.05) >= 3
        assert scale[::8] == sorted(scale[::8])
        greys = sorted(disks)
        assert all(b + 0.05 > 1.25 * (a + 0.05) for a, b in pairwise(greys))


# --- the page at work ---


@pytest.fixture
def opened(browser, program, tmp_path, monkeypatch):
    """Return the browser with the laboratory when the first run moves."""
    monkeypatch.setenv("RICOCHET", str(program))
    command = [sys.executable, ROOT / "post/lab.py", "--no-open"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True)
    try:
        browser.open(process.stdout.readline().split()[0])
        yield moving(browser)
        assert browser.complaints() == []
    finally:
        browser.open("about:blank")
        process.terminate()
        assert process.wait(PATIENCE) == 0


def inside(browser, what):
    """Return the value of an expression in the newest film."""
    return browser.run(f"return filmOf(current()).inside().{what}")


def moving(browser, than=0):
    """Wait until the disks of a newer run than the given one move."""
    seen = """const box = current(); if (!(box?.run > arguments[0]) || busy || again) return false;
        const { stream, moment } = filmOf(box).inside();
        return stream.run === box.run && moment.time > 0"""
    wait_for(lambda: browser.run(seen, than))
    return browser


def slide(browser, number, place):
    """Drag a slider of the form to a fraction of its length."""
    act = """const range = document.querySelectorAll('.slider [type=range]')[arguments[0]];
    range.value = arguments[1] * range.max; range.dispatchEvent(new Event('input'));"""
    browser.run(act, number, place)


def test_changes_that_a_run_refuses_start_one_run_that_moves(opened):
    """After a collapse, messages about the old run do not stop the new run."""
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
    wait_for(lambda: opened.run("return current().changes.length"))
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


#: Texts typed beside sliders of the input gas: number, variable, an allowed value.
TYPED = [
    (0, "species.gas.speed", lambda rng: rng.uniform(0.1, 9)),
    (1, "species.gas.count", lambda rng: rng.randint(2, 900)),
    (2, "species.gas.radius", lambda rng: rng.uniform(1e-4, 0.01)),
    (3, "contact.restitution", lambda rng: rng.uniform(0.3, 1.0)),
    (4, "box.gravity", lambda rng: rng.uniform(-9, 9)),
]


def some_text(rng, value):
    """Return a random text that is a number or similar to a number."""
    forms = "{}", "{:.3}", "{:.2e}", " {:.9f}", "{:.12}!"
    text = str(value) if isinstance(value, int) else rng.choice(forms).format(value)
    text = rng.choice([text, text.replace("e", "D"), text.replace(".", ",")])
    if rng.random() < 0.5:
        place = rng.randrange(len(text) + 1)
        new = rng.choice(["", " ", "*", "/", "-", "abc", "2*", "'", "=", ",,", "½", "1 ", "nan"])
        text = rng.choice([text[:place] + new + text[place + 1 :], new])
    return text


def type_at(browser, number, text):
    """Type a text beside a slider, followed by Enter."""
    field = "document.querySelectorAll('.slider input:not([type])')[arguments[0]].select()"
    browser.run(field, number)
    for key in text or "\ue003":  # backspace
        browser.press(key)
    browser.press("\ue007")  # enter


def test_a_text_at_a_slider_is_the_value_that_runs_or_waits_with_one_message(opened):
    """The program decides if the text is valid; nothing else changes."""
    rng, path = random.Random(8), ROOT / "input/gas.nml"
    opened.run("""const old = hear; hear = (source, news) =>
        news.is === 'file' ? window.kept = atob(news.body) : old(source, news);""")
    good, waiting = {}, set()
    for _ in range(40):
        number, key, value = rng.choice(TYPED)
        text = some_text(rng, value(rng))
        before = opened.run("return [current().run, current().changes.length]")
        type_at(opened, number, text)
        done = f"return !busy && !again && ('{key}' in state.waiting || !differs('{key}'))"
        wait_for(lambda script=done: opened.run(script))
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
        opened.run("window.kept = ''; filmOf(current()).send({ do: 'keep', part: 'input' })")
        wait_for(lambda: opened.run("return window.kept"))
        with (
            Simulation(opened.run("return window.kept")) as there,
            Simulation._of(path.read_text(), setting_lines(good)) as expected,
        ):
            assert there.parameters == expected.parameters, text


def test_kept_runs_stand_beside_the_next_in_equal_boxes_and_plots(opened):
    opened.press("k")
    moving(opened, 1)
    slide(opened, 0, 0.7)
    wait_for(lambda: "speed" in opened.run("return current().words"))
    sizes = """return state.boxes.map(box => filmOf(box).document.getElementById('stage'))
    .map(stage => [stage.offsetWidth, stage.offsetHeight].join());"""
    wait_for(lambda: len(set(opened.run(sizes))) == 1)
    seen = "['energy', 'pressure'].map(id => filmOf(current()).document.getElementById(id))"
    below = opened.run(f"return Math.max(...{seen}.map(one => one.getBoundingClientRect().bottom))")
    assert below < opened.run("return $('runs').clientHeight")
    assert opened.run("return state.boxes.map(box => box.letter)") == ["A", "B"]
    wait_for(lambda: len(inside(opened, "overlaid")) == 1)
    opened.press("p")
    wait_for(lambda: opened.run("return films().every(one => !one.inside().state.playing)"))
    opened.run("remove(state.boxes[0])")
    assert opened.run("return state.boxes.map(box => box.letter)") == ["B"]


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


def pixel(browser, x, y):
    """Return the window coordinates of a position in the box of the newest film."""
    return browser.run(
        """const film = filmOf(current()), frame = current().frame.getBoundingClientRect();
        const box = film.document.getElementById('stage').getBoundingClientRect();
        const [x, y] = film.pixelOf(...arguments);
        return [frame.x + box.x + x, frame.y + box.y + y].map(Math.round);""",
        x,
        y,
    )


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
    wait_for(lambda: browser.run("return window.kept"))
    script, space = browser.run("return window.kept"), {}
    exec(script.replace("    print(", "    end = simulation.time, simulation.position  # ("), space)
    return space["end"]


def test_a_dragged_side_follows_the_mouse_and_then_stays(opened):
    """The motion is a change of the running simulation, which the script repeats."""
    run, middle = opened.run("return current().run"), pixel(opened, 1, 0.5)
    end = pixel(opened, 0.8, 0.5)
    steps = [[x, end[1]] for x in np.linspace(middle[0], end[0], 12).round().astype(int).tolist()]
    mouse(opened, middle, "down", *steps)
    right = "past.at(-1).sides[1]"
    for _ in range(60):  # the side is not faster than the disks
        if inside(opened, right) < 0.85:
            break
        mouse(opened, [end[0] + 1, end[1]], end)
    assert 0.75 < inside(opened, right) < 0.85
    mouse(opened, "up")
    wait_for(
        lambda: opened.run("return current().changes.at(-1)[2]") == "the right side is dragged"
    )
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


def are_at_one_time(times, other_than):
    """Return whether all times are equal and differ from an earlier time."""
    return min(times) == max(times) != other_than


TIMES = "return films().map(one => one.inside().moment.shown)"


def test_compared_runs_show_one_time_and_go_on_alone(opened):
    """This holds while they play, at each step, and when a paused film goes to another time."""
    wait_for(lambda: inside(opened, "moment.time") > 0.1)
    for kept in (1, 2):
        opened.press("k")
        moving(opened, kept)
    opened.run("set('species.gas.count', '3000')")
    moving(opened, 3)
    seen = set()
    while len(seen) < 20 or min(seen) == max(seen):
        times = opened.run(TIMES)
        assert len(times) == 3 and min(times) == max(times)
        seen.add(times[0])
    wait_for(lambda: opened.run(TIMES)[0] > 0.15)  # beyond the kept frames
    opened.press("p")
    wait_for(lambda: opened.run("return films().every(one => !one.inside().state.playing)"))
    for key in ("\ue012", "\ue011", "\ue014", "\ue010", "\ue014", "n", "n", "\ue012"):
        before = opened.run(TIMES)[0]
        opened.press(key)  # left, Home, right, End, ...
        wait_for(lambda old=before: are_at_one_time(opened.run(TIMES), old))
    opened.press("p")
    last = opened.run(TIMES)[0]
    wait_for(lambda: opened.run(TIMES)[0] > last)
    for _ in range(2):
        opened.run("remove(state.boxes[0])")
    last = opened.run(TIMES)[0]
    wait_for(lambda: opened.run(TIMES)[0] > last + 0.02)
    assert len(opened.run(TIMES)) == 1


#: Scripts that keep a run and change the next run while the frame of the next run loads.
#: Each script comes with the settings and the number of the run that starts in the end.
WHILE_LOADING = {
    "a possible value": ("keep(); set(key, '2');", {"species.gas.speed": "2"}, 3),
    "an impossible value": ("keep(); busy -= PLACING; set(key, '-1');", {}, 3),
    "a value after a long wait": (
        "keep(); busy -= PLACING; set(key, '2');",
        {"species.gas.speed": "2"},
        2,
    ),
}


@pytest.mark.parametrize("case", WHILE_LOADING)
def test_a_run_beside_a_kept_run_starts_whatever_is_changed_meanwhile(opened, case):
    """Each request starts one run; the last run has the newest possible values, and moves."""
    script, settings, number = WHILE_LOADING[case]
    opened.run(f"const key = 'species.gas.speed'; {script}")
    wait_for(lambda: opened.run("return !busy && !again && current().run === state.runs"))
    moving(opened, number - 1)
    assert opened.run("return [state.has, state.runs]") == [settings, number]
    reached = inside(opened, "moment.time")
    wait_for(lambda: inside(opened, "moment.time") > reached)


#: Two texts for the first slider of each input of the lesson.
LESSON = {
    "crater": ("50", "30"),
    "mixture": ("25", "9"),
    "cooling": ("0.8", "0.7"),
    "gas": ("2", "3"),
}


@pytest.mark.parametrize("name", LESSON)
def test_a_value_typed_beside_a_kept_run_starts_both_from_their_start(opened, name):
    """Shortcuts act after Enter, and no worker is asked for the time of the previous run."""
    before = opened.run("return current().run")
    opened.run("choose(arguments[0])", name)
    moving(opened, before)
    wait_for(lambda: opened.run("return document.querySelectorAll('.slider').length") == 5)
    key = opened.run("return state.input.sliders[0].key")
    for kept, text in enumerate(LESSON[name], 1):
        opened.press("k")
        wait_for(lambda count=kept: opened.run("return state.boxes.length") == count + 1)
        type_at(opened, 0, text)
        wait_for(lambda now=text: opened.run("return state.has[arguments[0]]", key) == now)
        moving(opened, kept)
    asked = """const film = filmOf(current()), { reach } = film, times = [];
        film.reach = time => { times.push(time); reach(time); };
        run();
        clock.next = null;  // as when a message of the new run has arrived, but not its first frame
        clock.shown = -Infinity;  // the next picture is due
        conducts(film);
        return times"""
    before = opened.run("return current().run")
    assert opened.run(asked) == []
    moving(opened, before)
    assert opened.run("return films().map(one => one.inside().past[0].time)") == [0, 0, 0]


def test_compared_runs_have_numbers_and_histograms_side_by_side(opened):
    opened.press("k")
    moving(opened, 1)
    opened.run("set('species.gas.speed', '2')")
    wait_for(lambda: "speed" in opened.run("return current().words"))
    moving(opened, 2)
    table = """const { rows } = filmOf(current()).document.getElementById('numbers');
        const texts = [...rows].map(row => [...row.cells].map(cell => cell.textContent));
        return Object.fromEntries(texts.map(([name, ...rest]) => [name, rest]));"""

    def is_complete(found):
        heads = found.get("", []) == ["A", "theory", "B", "theory"]
        return heads and float(found["temperature"][3]) > 1

    wait_for(lambda: is_complete(opened.run(table)))
    found = opened.run(table)
    for name, power in (("temperature", 4), ("mean speed", 2), ("pressure of an ideal gas", 4)):
        slow, fast = (float(found[name][k]) for k in (1, 3))
        assert fast == pytest.approx(power * slow, rel=1e-3), name
    assert float(found["temperature"][1]) == pytest.approx(0.5 * (1 - 1 / 1000))
    seen = "overlaid.map(one => [one.letter, one.speeds().counts[0].reduce((a, b) => a + b)])"
    own = inside(opened, seen)
    assert own == [["A", 1000]]


def test_another_input_removes_the_kept_runs_and_the_same_input_keeps_them(opened):
    """Plots never contain curves of different inputs."""
    opened.press("k")
    moving(opened, 1)
    for name, letters in (("gas", ["A", "B"]), ("cooling", ["A"])):
        before = opened.run("return current().run")
        opened.run("choose(arguments[0])", name)
        moving(opened, before)
        assert opened.run("return state.boxes.map(box => box.letter)") == letters
        wait_for(lambda kept=letters[1:]: len(inside(opened, "overlaid")) == len(kept))
    assert opened.run("return document.querySelectorAll('iframe').length") == 1
    assert "A: as in the file" in opened.run("return $('shelf').textContent")


def test_a_paused_run_goes_back_step_by_step_and_on(opened):
    opened.press("p")
    wait_for(lambda: not inside(opened, "state.playing"))
    last = inside(opened, "moment.time")
    opened.press("\ue012")  # arrow left
    assert inside(opened, "moment.time") < last
    opened.press("\ue010")  # End
    newest = inside(opened, "moment.time")
    opened.press("\ue014")  # arrow right
    wait_for(lambda: inside(opened, "moment.time") > newest)
    before = inside(opened, "moment.time")
    opened.press("n")
    wait_for(lambda: inside(opened, "moment.time") > before)
    opened.press("p")
    wait_for(lambda: inside(opened, "moment.time") > before + 0.01)


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


LINKS = {  # the values of an address, and a property of the film
    "a number": ("crater", {"species.projectile.mass": "50"}, ("kinds[1].mass", 50)),
    "a vector": ("gas", {"box.gravity": "0,-2"}, ("film.gravity", [0, -2])),
    "an added group": (
        "gas",
        {"obstacle.post.centre": "0.5,0.5", "obstacle.post.radius": "0.1"},
        ("film.obstacles[0]", [0.5, 0.5, 0.1, False]),
    ),
    "letters": ("gas", {"run.title": "'50 % & more + #1'"}, ("kinds[0].count", 1000)),
}


@pytest.mark.parametrize("case", LINKS)
def test_the_address_holds_input_and_values_and_brings_them_back(opened, case):
    """A link, the page of the link loaded again, and values chosen on the page lead to one run."""
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


def test_the_first_key_leads_to_the_film_and_larger_text_stays_in_its_card(opened):
    opened.resize(1920, 1080)
    opened.press("\ue004")  # tab
    assert opened.run("return document.activeElement.id") == "film"
    opened.press("\ue007")  # enter
    focus = "filmOf(current()).document"
    assert opened.run(f"return {focus}.hasFocus() && {focus}.activeElement.id") == "play"
    opened.press("l")
    beyond = """const { document } = filmOf(current()), card = document.getElementById('view');
        const end = card.getBoundingClientRect().right;
        const wide = part => part.getBoundingClientRect().right > end
          || part.scrollWidth > part.clientWidth + 1;
        return [...card.querySelectorAll('.row, label, output')].filter(wide).map(one => one.id)"""
    for speed in (-2, 1.5):
        opened.run(
            """const film = filmOf(current()), pace = film.document.getElementById('pace');
            pace.value = arguments[0]; film.refresh();""",
            speed,
        )
        assert opened.run(beyond) == []


def test_a_scan_beside_a_kept_run_is_seen_and_moves_nothing(opened):
    """The figure is in the form, in the visible part of the window, and covers no other element."""
    opened.press("k")
    moving(opened, 1)
    places = """const parts = ['stage', 'controls', 'speeds', 'energy', 'pressure'];
        return films().flatMap(one => parts.map(id => one.document.getElementById(id)))
          .map(one => one.getBoundingClientRect().toJSON());"""
    before = opened.run(places)
    opened.run("$('scanning').open = true")
    opened.click("scan")
    wait_for(lambda: opened.run("return scan.points.length"))
    for _ in range(2):
        seen = """const canvas = $('curve'), box = canvas.getBoundingClientRect();
            const { left, top, right, bottom } = box;
            return document.elementFromPoint((left + right) / 2, (top + bottom) / 2) === canvas
              && top >= 0 && bottom <= innerHeight && right - left > 200"""
        assert opened.run(seen)
        drawn = "const image = $('curve').toDataURL(); $('curve').width += 0; "
        drawn += "const empty = $('curve').toDataURL(); drawScan(); return image !== empty"
        assert opened.run(drawn)
        assert opened.run(places) == before
        wait_for(lambda: opened.run("return scan.points.length") == 5)


def test_every_title_fits_into_a_telephone_and_the_controls_are_seen(opened):
    opened.resize(360, 740, True)
    for one in CHOOSER.values():
        opened.run("$('name').textContent = arguments[0]", one["title"])
        wide = opened.run("return [document.documentElement.scrollWidth, innerWidth]")
        assert wide == [360, 360], one["title"]
    ends = """const play = filmOf(current()).document.getElementById('play');
        return [play.getBoundingClientRect().bottom, current().frame.clientHeight]"""
    wait_for(lambda: opened.run(f"{ends}.reduce((play, frame) => play <= frame)"))


SIZES = [(1280, 800, False), (1920, 1080, False), (820, 1180, False), (390, 844, True)]


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_everything_has_a_name_and_nothing_is_covered_or_too_wide(opened, size):
    opened.resize(*size)
    for kept in (False, True):
        if kept:
            opened.run("keep()")
            moving(opened, 1)
        wide = """const isWide = (part, one) => part.offsetParent
              && part.getBoundingClientRect().right > one.innerWidth + 1;
            const all = [window, ...films()].flatMap(one =>
              [...one.document.querySelectorAll('body *')].filter(part => isWide(part, one)));
            return all.map(one => one.outerHTML.slice(0, 90));"""
        wait_for(lambda script=wide: opened.run(script) == [])
    stage, form = opened.run(
        """const film = filmOf(current()).document, box = film.getElementById('stage');
        const [stage, frame, form] = [box, current().frame, $('form')].map(
          one => one.getBoundingClientRect());
        return [[frame.x + stage.left, frame.y + stage.bottom], [form.right, form.top]];"""
    )
    assert stage[0] >= form[0] - 1 or stage[1] <= form[1] + 1, "the form covers the film"
    widths = opened.run(
        """const film = filmOf(current()), plots = film.document.querySelectorAll('aside canvas');
        film.document.getElementById('pressures').hidden = true;
        film.layout();
        return [...plots].filter(one => one.offsetParent).map(one => one.width);"""
    )
    assert all(widths), "a plot that was hidden has no size"
    opened.press("p")
    wait_for(lambda: not inside(opened, "state.playing"))
    names = opened.run(
        """const documents = [document, filmOf(current()).document];
        const parts = 'aside canvas, #stage, input, select, button';
        return documents.flatMap(one => [...one.querySelectorAll(parts)])
          .filter(one => one.offsetParent && !(one.getAttribute('aria-label') || one.labels?.length
            || one.textContent.trim() || one.title)).map(one => one.outerHTML);"""
    )
    assert names == []
    values = "return [...document.querySelectorAll('[type=range]')].map(one => one.ariaValueText)"
    assert all(" from " in text for text in opened.run(values))
    label = opened.run("return filmOf(current()).document.getElementById('stage').ariaLabel")
    assert "1000 gas" in label and "coloured by speed" in label
