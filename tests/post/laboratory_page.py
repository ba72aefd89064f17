"""Actions on the page of the laboratory in a browser, for tests of this page."""

import json

from synthetic_run import ROOT

CHOOSER = json.loads((ROOT / "input/chooser.json").read_text())


def inside(browser, what):
    """Return the value of an expression in the newest film."""
    return browser.run(f"return filmOf(current()).inside().{what}")


def moving(browser, than=0):
    """Wait until the disks of a newer run than the given one move."""
    seen = """const box = current(); if (!(box?.run > arguments[0]) || busy || again) return false;
        const { stream, moment } = filmOf(box).inside();
        return stream.run === box.run && moment.time > 0"""
    browser.until(seen, than)
    return browser


def slide(browser, number, place):
    """Drag a slider of the form to a fraction of its length."""
    act = """const range = document.querySelectorAll('.slider [type=range]')[arguments[0]];
    range.value = arguments[1] * range.max; range.dispatchEvent(new Event('input'));"""
    browser.run(act, number, place)


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


def type_at(browser, number, text):
    """Type a text beside a slider, followed by Enter."""
    field = "document.querySelectorAll('.slider input:not([type])')[arguments[0]].select()"
    browser.run(field, number)
    browser.press(*(text or "\ue003"), "\ue007")  # backspace, enter
