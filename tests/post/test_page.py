"""The laboratory's page: what it offers of each input, and that everybody can see and use it."""

import importlib.util
import json
from itertools import pairwise

import pytest
from PIL import Image

import player
from ricochet import Simulation
from ricochet.lab import form
from synthetic_run import ROOT

INPUTS = sorted((ROOT / "input").glob("*.nml"))
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
    """By 3 to 1, as WCAG 2.2 has it for pictures (1.4.11)."""
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
