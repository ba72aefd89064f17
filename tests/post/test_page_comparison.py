"""Page of the laboratory: kept runs beside the next run, in equal boxes and at equal times."""

import numpy as np
import pytest

from laboratory_page import inside, moving, slide, type_at
from ricochet import Simulation
from sampling import mostly
from synthetic_run import ROOT
from whole_runs import wait_for


def test_kept_runs_stand_beside_the_next_in_equal_boxes_and_plots(opened):
    """This takes 5 s, because several runs move and are drawn simultaneously."""
    opened.press("c")
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
    assert (
        opened.run("return filmOf(current()).document.getElementById('stage').offsetHeight") > 340
    )
    tags = "return state.boxes.map(box => box.figure.firstChild.style.getPropertyValue('--run'))"
    wait_for(lambda: len({*opened.run(tags)} - {"transparent"}) == 2)
    wait_for(lambda: len(inside(opened, "overlaid")) == 1)
    opened.press("p")
    opened.until("return films().every(one => !one.inside().state.playing)")
    opened.run("remove(state.boxes[0])")
    assert opened.run("return state.boxes.map(box => box.letter)") == ["B"]


def are_at_one_time(times, other_than):
    """Return whether all times are equal and differ from an earlier time."""
    return min(times) == max(times) != other_than


TIMES = "return films().map(one => one.inside().moment.shown)"


def test_compared_runs_show_one_time_and_go_on_alone(opened):
    """This holds while they play, at each step, and when a paused film moves to another time.

    It takes 5 to 10 s, because three runs move and are drawn simultaneously.
    """
    wait_for(lambda: inside(opened, "moment.time") > 0.1)
    for kept in (1, 2):
        opened.press("c")
        moving(opened, kept)
    opened.run("set('species.gas.count', '3000')")
    moving(opened, 3)
    stored = opened.run("return Math.max(...films().map(one => one.inside().past.at(-1).time))")
    seen = set()
    while len(seen) < 20 or min(seen) == max(seen):
        times = opened.run(TIMES)
        assert len(times) == 3 and min(times) == max(times)
        seen.add(times[0])
    wait_for(lambda: opened.run(TIMES)[0] > stored)  # then all films have the same frames
    opened.press("p")
    opened.until("return films().every(one => !one.inside().state.playing)")
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


#: Scripts that keep a run and change the next run while its frame loads, each with the settings and
#: the number of the run that finally starts.
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
    """Each request starts one run; the last run has the latest possible values, and moves."""
    script, settings, number = WHILE_LOADING[case]
    opened.run(f"const key = 'species.gas.speed'; {script}")
    opened.until("return !busy && !again && current().run === state.runs")
    moving(opened, number - 1)
    assert opened.run("return [state.has, state.runs]") == [settings, number]
    reached = inside(opened, "moment.time")
    wait_for(lambda: inside(opened, "moment.time") > reached)


def test_a_run_that_waits_for_the_page_goes_on_beside_another_run(opened):
    """A worker that is two frames ahead when its run is kept continues in the comparison."""
    opened.run("waiting = filmOf(current()); drawn = waiting.drawn; waiting.drawn = () => {}")
    wait_for(lambda: inside(opened, "stream.fresh") == 2)
    opened.run("waiting.drawn = drawn; keep()")
    moving(opened, 1)
    last = "return films().map(one => one.inside().past.at(-1).time)"
    reached = max(opened.run(last))
    wait_for(lambda: min(opened.run(last)) > reached)


def test_compared_runs_replay_the_times_that_all_of_them_have(opened):
    """A film that lacks frames of another film never shows an earlier time than it."""
    opened.press("c")
    moving(opened, 1)
    wait_for(lambda: inside(opened, "past.length") > 60)
    # Every second frame of the second run is removed, as if a film needed too much memory.
    thin = """const { past } = filmOf(current()).inside();
        for (let k = past.length - 2; k > 0; k -= 2) past.splice(k, 1);
        keep();
        return past.at(-1).time"""
    stored = opened.run(thin)
    moving(opened, 2)
    times = [0]
    while max(times) <= stored:
        times = opened.run(TIMES)
        assert min(times) == max(times)


#: Two texts for the first slider of each input of the lesson.
LESSON = {
    "crater": ("50", "30"),
    "mixture": ("25", "9"),
    "cooling": ("0.8", "0.7"),
    "gas": ("2", "3"),
}


@pytest.mark.parametrize("name", mostly(LESSON, ["crater"]))
def test_a_value_typed_beside_a_kept_run_starts_both_from_their_start(opened, name):
    """Shortcuts act after Enter, and no worker is asked for the time of the previous run.

    This takes 5 to 10 s, because three runs move and are drawn simultaneously.
    """
    before = opened.run("return current().run")
    opened.run("choose(arguments[0])", name)
    moving(opened, before)
    wait_for(lambda: opened.run("return document.querySelectorAll('.slider').length") == 5)
    key = opened.run("return state.input.sliders[0].key")
    for kept, text in enumerate(LESSON[name], 1):
        opened.press("c")
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
    opened.press("c")
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


#: Records the largest values of the axes of the histogram of speeds, and the runs with a curve.
RECORDED = """const film = filmOf(current()), { axes, drawMaxwell } = film;
    film.recorded = {};
    film.axes = (plot, x, y, name, ...rest) => {
      if (name === 'speed') film.recorded = { most: [x[1], y[1]], curves: [] };
      return axes(plot, x, y, name, ...rest);
    };
    film.drawMaxwell = (pen, one, ...rest) => {
      film.recorded.curves.push(one.letter ?? 'own');
      drawMaxwell(pen, one, ...rest);
    };"""


@pytest.mark.parametrize("speed", [0.5, 2])
def test_the_histogram_has_room_and_a_curve_for_each_compared_run(opened, speed):
    """The maximum of the Maxwell distribution of speeds is at most e^(-1/2) sqrt(m/E)."""
    opened.press("c")
    moving(opened, 1)
    opened.run(f"set('species.gas.speed', '{speed}'); {RECORDED}")
    moving(opened, 2)
    seen = "return filmOf(current()).recorded"
    wait_for(lambda: sorted(opened.run(seen).get("curves", [])) == ["A", "own"])
    width, height = opened.run(seen)["most"]
    for one in (1, speed):
        assert height > np.exp(-0.5) * np.sqrt(2) / one
        assert width > 2 * one


def test_another_input_removes_the_kept_runs_and_the_same_input_keeps_them(opened):
    """Plots never contain curves of different inputs."""
    opened.press("c")
    moving(opened, 1)
    for name, letters in (("gas", ["A", "B"]), ("cooling", ["A"])):
        before = opened.run("return current().run")
        opened.run("choose(arguments[0])", name)
        moving(opened, before)
        assert opened.run("return state.boxes.map(box => box.letter)") == letters
        wait_for(lambda kept=letters[1:]: len(inside(opened, "overlaid")) == len(kept))
    assert opened.run("return document.querySelectorAll('iframe').length") == 1
    assert "A: as in the file" in opened.run("return $('shelf').textContent")


def test_a_scan_beside_a_kept_run_is_seen_and_moves_nothing(opened):
    """The figure is in the visible part of the form and covers no other element."""
    opened.press("c")
    moving(opened, 1)
    begun = "return films()[1].document.getElementById('clock').textContent.startsWith('t = 0 ')"
    wait_for(lambda: not opened.run(begun))  # the text of the first moment is longer
    places = """const parts = ['stage', 'controls', 'speeds', 'energy', 'pressure'];
        return films().flatMap(one => parts.map(id => one.document.getElementById(id)))
          .map(one => one.getBoundingClientRect().toJSON());"""
    before = opened.run(places)
    opened.run("$('scanning').open = true")
    opened.click("scan")
    opened.until("return scan.points.length")
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


STAGES = """return state.boxes.map(box => box.frame.getBoundingClientRect().y
      + filmOf(box).document.getElementById('stage').getBoundingClientRect().y);"""
AT_HISTOGRAM = """const film = filmOf(current()), frame = current().frame;
    const plot = film.document.getElementById('histogram').getBoundingClientRect();
    const top = frame.getBoundingClientRect().y, at = top + plot.y + plot.height / 2;
    return [at > top && document.elementFromPoint(plot.x + plot.width / 5, at) === frame,
      ['first', 'last'].map(id => film.document.getElementById(id).offsetWidth > 0)].flat();"""


def test_compared_pictures_are_scrolled_together_on_a_telephone(opened):
    """No picture covers a plot, and the buttons for both ends of the film are there."""
    opened.press("c")
    moving(opened, 1)
    opened.press("p")
    opened.resize(390, 844, True)
    opened.until("return filmOf(current()).document.getElementById('histogram').offsetWidth > 300")
    before = opened.run(STAGES)
    assert before[0] == pytest.approx(before[1], abs=1)
    opened.run("filmOf(current()).scrollTo(0, 250)")
    wait_for(lambda: opened.run(STAGES)[0] < before[0] - 200)
    after = opened.run(STAGES)
    assert after[0] == pytest.approx(after[1], abs=1)
    assert opened.run(AT_HISTOGRAM) == [True] * 3


def test_the_time_appears_once_and_both_pressures_without_scrolling(opened):
    opened.press("c")
    moving(opened, 1)
    opened.run("set('species.gas.speed', '2')")
    moving(opened, 2)
    force = "filmOf(current()).document.getElementById('force')"
    opened.until(f"return /^A: [0-9.]+, B: [0-9.]+$/.test({force}.textContent)")
    first, second = opened.run(f"return {force}.textContent").split(", ")
    assert 3 < float(second[3:]) / float(first[3:]) < 5, "pressure is proportional to the energy"
    assert opened.run(f"return {force}.getBoundingClientRect().bottom") < 700
    clocks = "return films().map(one => one.document.getElementById('clock').innerText)"
    bare, lead = opened.run(clocks)
    assert bare.startswith("A: ") and "t =" not in bare
    assert lead.startswith("t = ") and "B: " in lead


def test_compared_craters_show_how_many_disks_are_at_rest(opened):
    """This number measures the size of a crater, in the laboratory as in a film."""
    before = opened.run("return current().run")
    opened.run("choose('crater')")
    moving(opened, before)
    opened.press("c")
    moving(opened, before + 1)
    text = "filmOf(current()).document.getElementById('bars')"
    words = "/^At rest: A: [0-9]+ of 2000 bed, .*; B: [0-9]+ of 2000 bed/"
    opened.until(f"return {words}.test({text}.innerText)")


def test_an_impact_shows_the_energy_left_the_disks_at_rest_and_when_its_input_ends(opened):
    opened.resize(1366, 768)
    opened.run("choose('crater')")
    opened.until("return !busy && !!textOf('stop.energy_fraction')")
    wait_for(lambda: inside(opened, "stream.run") == opened.run("return current().run"))
    wait_for(lambda: inside(opened, "moment.time") > 0.06)
    opened.press("p")
    wait_for(lambda: not inside(opened, "state.playing"))
    opened.draw(3)
    with Simulation(ROOT / "input/crater.nml") as same:
        start = same.observable("all/kinetic_energy")
        same.advance(time=inside(opened, "moment.time"))
        left = 100 * same.observable("all/kinetic_energy") / start
    text = opened.run("return filmOf(current()).document.getElementById('clock').textContent")
    assert float(text.split(" · ")[-1].removesuffix(" % of the energy left")) == pytest.approx(
        left, rel=6e-3
    )
    assert opened.run("return filmOf(current()).document.getElementById('bars').offsetHeight") > 0
    assert opened.run("return $('ends').textContent").endswith("until 10 % of the energy is left.")
