"""Page of the laboratory: contrast, accessibility and visibility on screens of all sizes."""

import re
from decimal import Decimal
from itertools import pairwise

import pytest

from ricochet.figures.film import whole
from laboratory_page import CHOOSER, inside, moving
from whole_runs import wait_for


def test_disks_can_be_told_from_both_grounds_and_species_in_grey(simulated, browser, tmp_path):
    """The contrast is at least 3 to 1, as WCAG 2.2 requires for graphics (1.4.11)."""
    species = "".join(f"&species count = 3 radius = 0.0{k} speed = 1 /\n" for k in (1, 2, 3, 4))
    run = simulated(species + "&stop time = 1 /\n")
    (tmp_path / "film.html").write_text(whole(run))
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
    opened.resize(1024, 768)
    cut = "return [...$('bar').children].filter(one => one.scrollHeight > one.clientHeight + 1)"
    longest = max((one["title"] for one in CHOOSER.values()), key=len)
    opened.run("$('name').textContent = arguments[0]", longest)
    assert opened.run(f"{cut}.map(one => one.id)") == []
    opened.resize(1920, 1080)
    for speed in (-2, 1.5):
        opened.run(
            """const film = filmOf(current()), pace = film.document.getElementById('pace');
            pace.value = arguments[0]; film.refresh();""",
            speed,
        )
        assert opened.run(beyond) == []


@pytest.fixture
def paused(opened):
    """Return the laboratory with a paused film, which need not be redrawn all the time."""
    opened.run("filmOf(current()).play(false)")
    opened.until("return !filmOf(current()).inside().state.playing")
    return opened


def test_every_title_fits_into_a_telephone_and_the_controls_are_seen(paused):
    paused.resize(360, 740, True)
    for one in CHOOSER.values():
        paused.run("$('name').textContent = arguments[0]", one["title"])
        wide = paused.run("return [document.documentElement.scrollWidth, innerWidth]")
        assert wide == [360, 360], one["title"]
    ends = """const play = filmOf(current()).document.getElementById('play');
        return [play.getBoundingClientRect().bottom, current().frame.clientHeight]"""
    paused.until(f"{ends}.reduce((play, frame) => play <= frame)")


#: Window sizes, some of them so narrow that the sliders are hidden at first.
SIZES = [(1280, 800), (1366, 768), (1920, 1080), (1024, 768), (820, 1180), (390, 844)]
#: Rows of the table with the longest numbers: tiny, large, and negative.
ROWS = [
    {"name": "temperature", "now": -1.234e-5, "value": 0.49969, "error": 1.9e-6, "theory": 0.5},
    {"name": "mean speed of light", "now": 9999, "value": 55432.19, "error": 0.012, "theory": 5e4},
    {"name": "mean speed of heavy", "now": 0.88, "value": -0.0996, "error": 1e-5, "theory": -0.1},
    {"name": "pressure", "now": 553.6, "value": 553.87, "error": 0.89, "theory": 554.0},
    {"name": "pressure of an ideal gas", "now": None, "value": None, "error": None, "theory": 500},
]
SHOW_ROWS = """for (const film of films().filter(one => one.inside().film)) {
      film.numbersNow = () => arguments[0];
      film.layout();
    }
    overlayAll();
    filmOf(leader()).layout();"""
#: Visible parts of the page and of its films that are wider than their place or the window.
WIDE = """const isShown = one => one.offsetParent && getComputedStyle(one).visibility === 'visible';
    const isCut = one => one.clientWidth && one.scrollWidth > one.clientWidth + 1
      && !one.matches('input, select, #status, #name, .caption, :has(> #stage), #main, #stage');
    return [document, ...films().map(one => one.document)].flatMap(page => {
      const { scrollWidth, clientWidth } = page.documentElement;
      const isBeyond = one => one.getBoundingClientRect().right > clientWidth + 0.5;
      const wide = [...page.querySelectorAll('body *')]
        .filter(one => isShown(one) && (isCut(one) || isBeyond(one)));
      return [...(scrollWidth > clientWidth ? [page.title || 'film'] : []),
        ...wide.map(one => one.outerHTML.slice(0, 90))];
    });"""
#: Left, top, right and bottom of the picture and of other parts, in window coordinates.
PLACES = """const box = leader(), { x, y } = box.frame.getBoundingClientRect();
    const place = ({ left, top, right, bottom }) => [left + x, top + y, right + x, bottom + y];
    const form = $('form').getBoundingClientRect();
    return { ...Object.fromEntries(['stage', 'speeds', 'numbers'].map(id => [id,
        place(filmOf(box).document.getElementById(id).getBoundingClientRect())])),
      form: [form.left, form.top, form.right, form.bottom],
      bar: $('bar').getBoundingClientRect().bottom };"""


def test_nothing_is_cut_in_windows_of_all_sizes(paused):
    """Scroll bars have their usual width, and numbers are as long as possible."""
    for width, height in SIZES:
        paused.resize(width, height)
        is_narrow, is_phone = width < 1100, width < 700
        wait_for(lambda hides=is_narrow: paused.run("return isBare()") == hides)
        for is_open in (False, True) if is_narrow else (True,):
            if is_narrow and is_open:
                paused.click("settings")
            paused.run(SHOW_ROWS, ROWS)
            case = width, height, is_open
            assert paused.run(WIDE) == [], case
            places = paused.run(PLACES)
            left, top, _, bottom = places["stage"]
            assert bottom - top > 0.45 * min(height, width if is_phone else 0.8 * width), case
            assert not is_phone or top < places["bar"] + 20, "the film is first"
            assert left >= places["form"][2] or bottom <= places["form"][1] or not is_open, case
        if is_narrow:
            paused.click("settings")
    texts = "[...filmOf(leader()).document.querySelectorAll('#numbers td')]"
    texts = paused.run(f"return {texts}.map(one => one.textContent)")
    assert {"0.4996900 ±\u00a00.0000019", "0.5000000", "553.87 ±\u00a00.89"} <= {*texts}


def number(text):
    return Decimal(text.replace("\u2212", "-"))


def test_errors_have_two_digits_and_laws_as_many_decimals_as_means(opened, rng):
    """The second digit of the error is the last digit of the mean."""
    means = (rng.normal(size=99) * 10 ** rng.uniform(-2, 4, 99)).tolist()
    errors = [*(10 ** rng.uniform(-6, 1, 95)).tolist(), 0.0995, 0.0996, 0.1, 9.99]
    laws = [mean + error for mean, error in zip(means, errors, strict=True)]
    found = opened.run(
        """const film = filmOf(current());
        return arguments[0].map(([value, error, theory]) =>
          [film.withError({ value, error }), film.lawOf({ theory, error })]);""",
        [*zip(means, errors, laws, strict=True)],
    )
    for (text, law), mean, error, theory in zip(found, means, errors, laws, strict=True):
        shown, width = map(number, text.split(" ±\u00a0"))
        assert width == Decimal(f"{error:.1e}"), text
        unit = Decimal(10) ** (width.adjusted() - 1)
        assert width.as_tuple().exponent == min(0, width.adjusted() - 1), text
        assert abs(shown - Decimal(mean)) <= Decimal("0.501") * unit, text
        assert abs(number(law) - Decimal(theory)) <= Decimal("0.501") * unit
        assert number(law).as_tuple().exponent <= shown.as_tuple().exponent


COMPARED = """const frame = box => box.frame.getBoundingClientRect(), [first] = state.boxes;
    const plots = ['stage', 'play', 'histogram', 'energy', 'pressure', 'numbers']
      .map(id => filmOf(leader()).document.getElementById(id).getBoundingClientRect());
    const advice = current().figure.querySelector('.advice').getBoundingClientRect();
    return { leads: leader() === first, plots: plots.every(one => one.width * one.height),
      advice: [advice.left, advice.right, advice.width],
      stage: plots[0].right + frame(leader()).left,
      captions: state.boxes.map(box => box.figure.firstChild.textContent) };"""


def test_a_kept_run_shows_its_film_and_plots_until_the_next_one_does(opened):
    """The place of the next run says what to do, and nothing is cut in any window."""
    wait_for(lambda: inside(opened, "numbersNow().length"))
    opened.run("start = run; run = () => {}; keep()")  # the next run does not start yet
    for state in ("true", "isThere(current())"):
        opened.until(f"return {state}")
        waiting = opened.run(f"arrangeAll(); {COMPARED}")
        assert waiting["leads"] and waiting["plots"]
        left, right, width = waiting["advice"]
        assert waiting["stage"] <= left and right <= 1280 and width > 200
    opened.run("run = start; run()")
    moving(opened, 1)
    wait_for(lambda: opened.run(COMPARED)["plots"])
    compared = opened.run(COMPARED)
    assert not compared["leads"] and compared["advice"][2] == 0
    assert compared["captions"] == ["A: as in the file", "B: change a slider"]
    for size in [*SIZES, (390, 844, True)]:  # scroll bars of a telephone take no space
        opened.resize(*size)
        opened.run(SHOW_ROWS, ROWS)
        assert opened.run(WIDE) == [], size
    opened.resize(1280, 800)
    opened.run("set('species.gas.speed', '2')")
    caption = "return current().figure.firstChild.textContent"
    wait_for(lambda: opened.run(caption) == "B: speed of each disk at the start = 2")


def test_every_control_has_a_name_in_words(opened):
    opened.press("c")
    moving(opened, 1)
    opened.press("p")
    wait_for(lambda: not inside(opened, "state.playing"))
    names = opened.run(
        """const documents = [document, ...films().map(one => one.document)];
        const parts = 'aside canvas, #stage, input, select, button';
        const nameOf = one => one.getAttribute('aria-label') || one.labels?.[0]?.textContent
          || one.textContent.trim() || one.title;
        return documents.flatMap(one => [...one.querySelectorAll(parts)])
          .filter(one => one.offsetParent).map(nameOf);"""
    )
    assert len(names) > 40 and [name for name in names if not re.search("[a-z]{2}", name)] == []
    values = "return [...document.querySelectorAll('[type=range]')].map(one => one.ariaValueText)"
    assert all(" from " in text for text in opened.run(values))
    label = opened.run("return filmOf(current()).document.getElementById('stage').ariaLabel")
    assert "1000 gas" in label and "coloured by speed" in label


def test_a_plot_that_was_hidden_has_a_size(opened):
    widths = opened.run(
        """const film = filmOf(current()), plots = film.document.querySelectorAll('aside canvas');
        film.document.getElementById('pressures').hidden = true;
        film.layout();
        return [...plots].filter(one => one.offsetParent).map(one => one.width);"""
    )
    assert widths and all(widths)
