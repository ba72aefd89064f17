"""Names, curves and notes in the player that depend on the system of a run."""

import numpy as np
import pytest

from ricochet import film_data
from test_player import BOXES, FEW, LOGGED


def test_obstacles_and_walls_have_their_names(simulated):
    run = simulated(
        """&obstacle centre = 0.3, 0.5 radius = 0.1 /
        &obstacle name = 'post' centre = 0.7, 0.5 radius = 0.1 /
        &wall name = 'roof' points = 0.2, 0.8, 0.5, 0.9, 0.8, 0.8 /
        &wall from = 0.1, 0.1 to = 0.1, 0.3 /
        &species count = 2 radius = 0.01 speed = 1 / &stop events = 5 /"""
    )
    names = ["obstacle 1", "obstacle post", "wall roof", "wall roof", "wall 2"]
    assert film_data.scene(run)[0]["surfaces"][4:] == names


TRACERS = """&species count = 30 radius = 1e-8 speed = 1 / &stop time = 1 /
&output frames_every_time = 0.1 observables_every_time = 0.1 /"""


@pytest.mark.parametrize(
    ("more", "curve"),
    [
        ("", False),
        ("&side name = 'left' temperature = 1 / &side name = 'right' temperature = 1 /", True),
    ],
)
def test_maxwells_law_is_for_disks_that_collide_or_are_heated(simulated, playing, more, curve):
    browser = playing(simulated(TRACERS + more).path)
    assert ("Maxwell" in browser.run("return $('bars').textContent")) == curve


@pytest.mark.parametrize("g", [0, -1])
def test_no_pressure_is_drawn_under_gravity(simulated, playing, g):
    text = TRACERS.replace("1e-8", "0.03") + f"&box gravity = 0, {g} /"
    browser = playing(simulated(text).path)
    assert browser.run("return $('pressures').hidden") == (g != 0)


def test_recycled_disks_jump_and_no_event_log_would_help(simulated):
    """The reason given is not that driving changes velocities between frames."""
    drive = "&drive kind = 'recycle' interval = 0.1 from_region = 0, 1, 0, 0.2 "
    drive += "to_region = 0, 1, 0.5, 1 velocity = 0, -1 /"
    run = simulated(TRACERS + drive)
    facts, _ = film_data.film(run, [0, 1], "speed", [])
    assert facts["note"] == "recycled disks jump between frames"


@pytest.mark.parametrize("box", ["walls", "periodic", "container"])
def test_energies_of_few_disks_without_gravity_are_step_functions(simulated, playing, box):
    """Curves have their steps at the logged events, however rarely observables are sampled."""
    text = BOXES[box] + FEW
    run = simulated(text, *LOGGED, "output.observables_every_time=1")
    truth = simulated(text, "output.observables_every_events=1", name="many")
    browser = playing(run.path)
    curves, is_stepwise = browser.run("return [film.curves, isStepwise()]")
    assert is_stepwise and len(curves["time"]) > run.event_log().time.size
    middles = np.convolve(curves["time"], [0.5, 0.5], "valid")
    for kind, drawn in zip(run.by_species, curves["kinetic"], strict=True):
        time, energy = truth.observable(f"{kind.name}/kinetic_energy")
        held = energy[np.searchsorted(time, middles, "right") - 1]
        np.testing.assert_allclose(drawn[:-1], held, rtol=1e-6)
    corners = browser.run(
        """const pen = $('energy').getContext('2d'), { lineTo, moveTo } = pen, lines = [];
        pen.moveTo = (x, y) => lines.push([[x, y]]);
        pen.lineTo = (x, y) => (lines.at(-1) ?? lines[lines.push([]) - 1]).push([x, y]);
        const { time, kinetic: [values] } = film.curves;
        plotLines($('energy'), [{ time, values, steps: isStepwise() }], Infinity);
        Object.assign(pen, { lineTo, moveTo });
        return lines.filter(line => line.length > 2);"""
    )
    for line in corners:
        steps = np.abs(np.diff(line, axis=0))
        assert np.all(steps.min(axis=1) == 0), "each line is horizontal or vertical"


RESTING = """&species name = 'bed' count = 20 radius = 0.02 region = 0, 1, 0, 0.4 /
&species name = 'ball' radius = 0.05 position = 0.5, 0.8 velocity = 0, -1 /
&stop time = 0.6 / &output event_log = .true. /"""


def test_a_telephone_shows_title_note_and_labels_of_a_film_with_disks_at_rest(simulated, playing):
    browser = playing(simulated(RESTING).path)
    browser.resize(390, 844, True)
    browser.run("layout(); go(0.3)")
    assert browser.run("return film.speeds.rest")
    seen = """return [...document.querySelectorAll(arguments[0])]
        .map(one => one.offsetHeight > 0 && one.innerText)"""
    assert browser.run(seen, "#speeds h2") == ["Speeds"]
    assert browser.run(seen, "#bars")[0].startswith("At rest: ")
    assert browser.run(seen, ".pace .word") == ["speed"]
    share = browser.run("return $('histogram').clientWidth / $('speeds').clientWidth")
    assert share > 0.9
    assert "frame" not in browser.run("return $('clock').textContent")
    assert browser.run("return $('clock').textContent").startswith("t = 0.3 · ")
    assert browser.run("return document.documentElement.scrollWidth") <= 390
