"""Inputs of the laboratory: their pictures, descriptions and sliders."""

import importlib.util
import re
from urllib.parse import parse_qsl, urlsplit

import pytest
from PIL import Image

import lab
from laboratory_page import CHOOSER
from ricochet import Simulation
from ricochet.figures.web_page import chooser
from ricochet.pages.lab import form
from synthetic_run import ROOT

INPUTS = sorted(set((ROOT / "input").glob("*.nml")) - {ROOT / "input/reference.nml"})


def test_every_input_has_its_place_in_the_chooser_and_a_picture_of_now():
    source = ROOT / "docs/chooser_pictures.py"
    spec = importlib.util.spec_from_file_location("chooser_pictures", source)
    pictures = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(pictures)
    assert {path.stem for path in INPUTS} == CHOOSER.keys()
    assert [one["name"] for one in chooser(INPUTS)] == list(CHOOSER)
    for path in INPUTS:
        own, drawn = CHOOSER[path.stem], ROOT / f"input/pictures/{path.stem}.png"
        assert own["title"] and own["subject"] and own["sentence"].endswith((".", "?"))
        assert drawn.stat().st_size < 10_000
        shown = Image.open(drawn).text["input"]
        message = f"make it anew: python docs/chooser_pictures.py {path.stem}"
        assert shown == pictures.digest(path, own["at"]), message


#: Settings with which an input starts faster.
CHEAPER = {"hexatic": {"species.disks.relaxation_sweeps": 1}}


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
            with Simulation(path, CHEAPER.get(path.stem, {}) | {variable: value}) as run:
                run.advance(time=1e-3)


@pytest.mark.parametrize(
    ("page", "inputs"),
    [("lesson", {"gas", "mixture", "cooling", "crater"}), ("collisions-lesson", {"collision"})],
)
def test_the_links_of_a_lesson_lead_to_the_inputs_with_these_titles(page, inputs):
    """Values that differ from the input are values of its sliders, and each heading has one."""
    text = " ".join((ROOT / f"docs/tutorials/{page}.md").read_text().split())
    shown = set()
    for title, link in re.findall(r"\[([^\]]+)\]\((http://[^)]+)\)", text):
        address = urlsplit(link)
        assert address.netloc == f"127.0.0.1:{lab.USUAL_PORT}"
        (key, name), *settings = parse_qsl(address.fragment)
        own = CHOOSER[name]
        sliders = {variable: ends for variable, _, *ends in own["sliders"]}
        assert key == "input" and title in (f"*{own['title']}*", "this state")
        assert bool(settings) == (title == "this state")
        for variable, value in settings:
            names = {f"{variable}[{k}]": part for k, part in enumerate(value.split(","))}
            names |= {variable: value}
            assert names.keys() & sliders.keys()
            for one in names.keys() & sliders.keys():
                low, high, *_ = sliders[one]
                assert low <= float(names[one]) <= high
        shown.add(name)
    assert shown == inputs
