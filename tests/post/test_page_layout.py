"""The page of the laboratory: contrast, accessibility and visibility on screens of all sizes."""

from itertools import pairwise

import pytest

import player
from laboratory_page import CHOOSER, inside, moving
from whole_runs import wait_for


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
