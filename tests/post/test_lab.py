"""The laboratory: forms from the program's table, runs within limits, a page that shows them."""

import http.client
import json
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import lab as script
from ricochet import RunError
from ricochet import lab as module
from ricochet.lab import Lab, edited
from ricochet.live import Server
from ricochet.program import namelist
from synthetic_run import ROOT, run_script
from whole_runs import FINISHED, PATIENCE, differences, wait_for, write_input

INPUTS = sorted((ROOT / "input").glob("*.nml"))
LONG = {
    "stop.collisions_per_disk": "1e9",
    "output.frames_every_collisions": "1000000000",
    "output.observables_every_collisions": "1000000000",
}


@pytest.fixture
def laboratory_of(program, tmp_path, monkeypatch):
    """`laboratory_of(*inputs)`; its runs end with the test."""
    monkeypatch.setenv("RICOCHET", str(program))
    made = []

    def make(*inputs):
        folder = tmp_path / f"lab{len(made)}"
        folder.mkdir()
        made.append(Lab(list(inputs or INPUTS), folder, lambda run: {}))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture
def lab(laboratory_of):
    return laboratory_of()


def wish(lab, page, name="gas", settings=None, added=(), **more):
    wanted = {"input": name, "settings": settings or {}, "added": list(added)}
    return lab.start({"page": page, **wanted, **more})


# --- input files ---


@pytest.fixture
def outputs(ricochet, tmp_path):
    """`outputs(words, words)` runs both; what differs, apart from how the input was given."""

    def compare(one, other):
        for name, words in {"a.h5": one, "b.h5": other}.items():
            done = ricochet(*words, "-o", name, "--force", "--quiet")
            assert done.returncode == FINISHED, done.stderr
        told = ("/parameters/input", "/parameters/overrides", "/checkpoint")
        names = differences(tmp_path / "a.h5", tmp_path / "b.h5")
        return [name for name in names if not name.startswith(told)]

    return compare


def as_words(settings):
    """On the command line."""
    return [part for pair in settings.items() for part in ("--set", "=".join(pair))]


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.stem)
def test_forms_and_edited_files_give_the_run_of_the_same_settings(path, lab, outputs, tmp_path):
    """Of every input: a value replaced, one added, one removed, a group added; and all of them."""
    groups = lab.form(path.stem)["groups"]
    settings = {"stop.time": "0.01", "run.title": "it's, so", "contact.restitution": "0.875"}
    first = next(group["place"] for group in groups if group["kind"] == "species")
    settings |= {f"{first}.mass": "1.5", "output.event_log": ".true."}
    rules = ("events", "energy_fraction", "collisions", "collisions_per_disk")
    settings |= {f"stop.{name}": "" for name in rules}
    mine = tmp_path / "mine.nml"
    mine.write_bytes(edited(path, settings))
    assert outputs([mine], [path, *as_words(settings)]) == []
    comments = [
        [line for line in file.read_text().splitlines() if line.startswith("!")]
        for file in (path, mine)
    ]
    assert comments[0] == comments[1]
    bare, given = "", {}
    for group in groups:
        name = group["given"].pop("name", None)
        bare += namelist({group["kind"]: {"name": name} if name else {}})
        given |= {f"{group['place']}.{word}": value for word, value in group["given"].items()}
    given["stop.events"] = "20"
    mine.write_bytes(edited(write_input(tmp_path, bare), given))
    assert outputs([mine], [path, "--set", "stop.events=20"]) == []


# --- runs ---


def test_every_input_has_a_form_and_runs(lab):
    """With some frames, also where the file asks for none."""
    page = lab.new_page()
    for name in lab.inputs:
        form = lab.form(name)
        assert form["about"] and any(group["kind"] == "species" for group in form["groups"])
        answer = wish(lab, page, name, form["settings"] | {"stop.events": "50"})
        assert answer["problems"] == [], name
        lab.page(page).newest.process.wait()
        assert lab.state(page) == {"running": False, "stopped": False, "reason": ""}, name
    wish(lab, page, "crater", lab.form("crater")["settings"])
    lab.page(page).newest.process.wait()
    assert module.FRAMES / 2 < lab.page(page).newest.opened().frames < 3 * module.FRAMES
    assert lab.form("gravity")["settings"] == {"output.event_log": ".true."}


@pytest.mark.parametrize(
    ("variable", "value", "words"),
    [
        ("species.projectile.mass", "-3", "is out of range; allowed: a number > 0"),
        ("contact.restitution", "x", "is not a number"),
        ("species.bed.radius", "0.01", ""),
        ("box.boundary", "wall", "1 value instead of 2"),
        ("output.event_log", "maybe", ".true."),
    ],
)
def test_a_wrong_value_gets_the_line_of_the_program_at_its_variable(
    lab, ricochet, variable, value, words
):
    problems = wish(lab, lab.new_page(), "crater", {variable: value})["problems"]
    said = ricochet(ROOT / "input/crater.nml", "--check", "--set", f"{variable}={value}").stderr
    lines = [line.replace(f"{ROOT / 'input'}/", "") for line in said.splitlines()]
    assert [line["text"] for line in problems] == lines
    assert words in problems[0]["text"]
    group = variable.rpartition(".")[0]
    assert all(line["place"].rpartition(".")[0] == group for line in problems), problems


def test_the_command_that_is_shown_gives_the_same_run(lab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    settings = {"species.gas.count": "50", "run.title": "it's, so", "stop.events": "99"}
    page = lab.new_page()
    command = wish(lab, page, settings=settings)["command"]
    own = lab.page(page).newest
    own.process.wait()
    assert subprocess.run(command, shell=True, capture_output=True).returncode == FINISHED
    assert differences(own.opened().path, tmp_path / "runs/gas.h5") == []


def test_an_added_group_is_run_and_in_the_file_to_download(lab, outputs, tmp_path):
    page, added = lab.new_page(), [["obstacle", "post"]]
    settings = {"obstacle.post.centre": "0.5,0.5", "obstacle.post.radius": "0.1"}
    settings["stop.events"] = "99"
    answer = wish(lab, page, settings=settings, added=added)
    assert answer["problems"] == [] and answer["command"].endswith(" gas.nml -o gas.h5")
    own = lab.page(page).newest
    own.process.wait()
    assert len(own.opened().obstacles) == 1
    (tmp_path / "mine.nml").write_bytes(edited(own.input, own.settings))
    assert outputs(["mine.nml"], [own.input, *as_words(settings)]) == []


def going_on(lab, page, **more):
    """A run that would go on for very long."""
    assert wish(lab, page, settings=LONG, **more)["problems"] == []
    run = lab.page(page).newest
    run.opened()
    assert run.running
    return run


@pytest.mark.parametrize(("limit", "most"), [("SILENCE", -1), ("PAGES", 1)])
def test_a_run_ends_when_its_page_is_silent_and_another_comes(lab, monkeypatch, limit, most):
    run = going_on(lab, lab.new_page())
    lab.watch()
    assert run.running and not run.reason
    monkeypatch.setattr(module, "SILENCE", -1)
    monkeypatch.setattr(module, limit, most)
    lab.watch() if limit == "SILENCE" else lab.new_page()
    run.process.wait(PATIENCE)
    assert not run.running


def test_no_more_than_so_many_pages_and_disks_and_bytes(lab):
    pages = [lab.new_page() for _ in range(module.PAGES)]
    assert len(set(pages)) == module.PAGES
    with pytest.raises(RunError, match="close one"):
        lab.new_page()
    lab.leave({"page": pages[0]})
    page = lab.new_page()
    for settings, words in (
        ({"species.gas.count": "20001"}, "20001 disks"),
        ({"stop.collisions_per_disk": "1e9"}, "a run here may have 200 MB"),
    ):
        more = {"species.gas.radius": "1e-6"}
        (problem,) = wish(lab, page, settings=more | settings)["problems"]
        assert words in problem["text"]
    assert wish(lab, page, settings=more | {"species.gas.count": "100000000"})["problems"]
    assert lab.page(page).runs == {}


def test_a_run_is_stopped_at_its_limits_and_says_so(lab, monkeypatch):
    """And the kernel has limits of its own."""
    page = lab.new_page()
    for limit, words in {"SECONDS": "which a run may take", "MEGABYTES": "0 MB"}.items():
        run = going_on(lab, page)
        most = module.resource.prlimit(run.process.pid, module.resource.RLIMIT_CPU)[0]
        assert most == 2 * module.SECONDS
        with monkeypatch.context() as patch:
            patch.setattr(module, limit, 0)
            lab.watch()
        run.process.wait(PATIENCE)
        state = lab.state(page)
        assert state["stopped"] and state["reason"].startswith("stopped") and words in run.reason


# --- requests ---


@pytest.fixture
def server(lab):
    """The server of a laboratory, in this process; gives its port."""
    one = Server(("127.0.0.1", 0), type("Answers", (script.Answers,), {"lab": lab}))
    threading.Thread(target=one.serve_forever, daemon=True).start()
    yield one.server_address[1]
    one.shutdown()
    one.server_close()


def post(port, path, body, **headers):
    """Status and text of the answer to a wish."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    headers = {"Origin": f"http://127.0.0.1:{port}", **headers}
    data = body if isinstance(body, bytes) else json.dumps(body).encode()
    connection.request("POST", path, data, {k: v for k, v in headers.items() if v})
    answer = connection.getresponse()
    return answer.status, answer.read().decode()


def test_only_its_own_pages_may_start_runs(lab, server):
    page = lab.new_page()
    good = {"page": page, "input": "gas", "settings": LONG, "added": []}
    for origin in ("http://evil.example", "null", "", f"http://localhost:{server}"):
        assert post(server, "/start", good, Origin=origin)[0] == 403, origin
    assert post(server, "/start", good, Host="evil.example")[0] == 403
    assert post(server, "/start", good | {"page": "1234"})[0] == 409
    senseless = {"input": ["../gas", ["gas"]], "settings": [[]], "added": ["obstacle"]}
    for name, values in {**senseless, "page": [None]}.items():
        for value in values:
            status, text = post(server, "/start", good | {name: value})
            assert status in (400, 409) and len(text.splitlines()) == 1, text
    assert lab.page(page).runs == {}
    assert post(server, "/start", good)[0] == 200
    assert lab.page(page).newest.running


# --- the command ---


@pytest.fixture
def running(program, tmp_path, monkeypatch):
    """The laboratory as a command, and its first line."""
    monkeypatch.setenv("RICOCHET", str(program))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    command = [sys.executable, ROOT / "post/lab.py", "--no-open"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, cwd=tmp_path, **pipes)
    yield process, process.stdout.readline()
    process.kill()
    process.communicate()


@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_no_run_is_left_behind(running, tmp_path, sign):
    process, line = running
    port = int(re.fullmatch(r"http://127\.0\.0\.1:(\d+)/  \(Ctrl-C ends\)\n", line)[1])
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    connection.request("GET", "/")
    page = re.search(r'"page": "(\w+)"', connection.getresponse().read().decode())[1]
    good = {"page": page, "input": "gas", "settings": LONG, "added": []}
    assert post(port, "/start", good)[0] == 200
    children = Path(f"/proc/{process.pid}/task").glob("*/children")
    pids = [pid for task in children for pid in task.read_text().split()]
    assert len(pids) == 1
    process.send_signal(sign)
    out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, out, err) == (0, "stopped, with all runs\n", "")
    assert not Path("/proc", pids[0]).exists()
    assert list(tmp_path.glob("ricochet-lab-*")) == []


def test_wrong_words_are_refused_in_one_line(server, program, monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("RICOCHET", str(program))
    for words, reason in (
        (["--port", "99999"], "is not a port"),
        ([tmp_path / "none.nml"], "is no input file"),
        ([ROOT / "README.md"], "is no input file"),
        (["--port", server], f"lab.py: port {server}: Address already in use\n"),
    ):
        assert run_script("lab", *words) == 2
        assert reason in capsys.readouterr().err


# --- the page ---


@pytest.fixture
def opened(server, lab, browser, monkeypatch):
    """The page, with its first run shown."""
    monkeypatch.setattr(lab, "filmed", script.filmed)
    browser.open(f"http://127.0.0.1:{server}/")
    return shows(browser)


def shows(browser, count=1):
    """Wait until so many runs are seen."""
    seen = "!busy && !again && !document.querySelector('.coming') && films().length"
    wait_for(lambda: browser.run(f"return {seen}") == count)
    return browser


def run_of(browser, number):
    """Wait until this is the newest run, and is seen."""
    wait_for(lambda: browser.run("return state.shown.at(-1).number") == number)
    return shows(browser, browser.run("return state.shown.length"))


def in_film(browser, name):
    """The words of a part of the first film."""
    return browser.run("return inFilm(films()[0], arguments[0]).textContent", name)


def change(browser, variable, value):
    """Type a value."""
    browser.run(
        """const row = document.querySelector(`[data-place="${arguments[0]}"]`);
        row.querySelector('input:not([type]), select').value = arguments[1];
        row.querySelector('input:not([type]), select').dispatchEvent(new Event('change'));""",
        variable,
        value,
    )


def test_the_form_has_every_variable_and_sliders_keep_to_what_is_allowed(opened, lab):
    """Both ends and the middle of every slider are values that the table allows."""
    places = "[...document.querySelectorAll('.variable')].map(r => r.dataset.place)"
    rows = set(opened.run(f"return {places}"))
    named = {kind for kind, variables in lab.table.items() if "name" in variables}
    wanted = {
        f"{'species.gas' if kind == 'species' else kind}.{name}"
        for kind, variables in lab.table.items()
        if kind == "species" or kind not in named  # the file has no others
        for name in variables
        if name != "name"
    }
    assert rows == wanted
    wrong = opened.run(
        """const wrong = [];
        const all = Object.entries(lab.table).flatMap(([kind, own]) =>
          Object.entries(own).map(([name, v]) => [kind, name, v]));
        for (const [kind, name, v] of all) {
          if (!['real', 'integer'].includes(v.type)) continue;
          for (const start of v.value.split(',')) {
            const { input, slider } = control(v, start, start);
            for (const place of [0, 1, 500, 999, 1000]) {
              slider.value = place;
              const text = slider.read(), value = +text;
              if (isNaN(value) || (v.low !== null && (v.open ? value <= v.low : value < v.low))
                || (v.high !== null && value > v.high) || (v.type === 'integer' && value % 1))
                wrong.push([kind, name, place, text]);
            }
          }
        }
        return wrong;"""
    )
    assert wrong == []
    assert opened.complaints() == []


def test_a_slider_is_followed_by_a_run_and_a_wrong_value_is_marked(opened, lab):
    """What is chosen in a film stays for the next run; a wrong value leaves the run before."""
    opened.run(
        """const colour = inFilm(films()[0], 'colour');
        colour.value = 'displacement';
        colour.dispatchEvent(new Event('change'));
        const slider = document.querySelector('[data-place="species.gas.count"] [type=range]');
        slider.value = 250;
        slider.dispatchEvent(new Event('input'));"""
    )
    run_of(opened, 2)
    count = int(opened.run("return state.settings['species.gas.count']"))
    assert 30 <= count <= 300
    assert lab.page(opened.run("return lab.page")).newest.opened().count == count
    command = opened.run("return document.querySelector('.run button').title")
    assert f"species.gas.count={count}" in command
    assert opened.run("return films()[0].choices().colour") == "displacement"
    change(opened, "species.gas.radius", "-1")
    wait_for(lambda: opened.run("return document.querySelector('.wrong') !== null"))
    words = opened.run("return document.querySelector('.wrong .problem').textContent")
    assert words.startswith("--set species.gas.radius=-1: species.radius:")
    assert opened.run("return state.shown[0].number") == 2
    change(opened, "species.gas.radius", "0.005")
    wait_for(lambda: opened.run("return document.querySelector('.wrong') === null"))
    run_of(opened, 3)


def test_two_runs_stand_side_by_side_at_one_pace(opened):
    opened.click("compare")
    change(opened, "species.gas.speed", "3")
    shows(opened, 2)
    paces = opened.run("return films().map(one => one.choices().pace)")
    assert paces[0] == paces[1]
    heights = "films().map(one => (one.layout(), inFilm(one, 'stage').offsetHeight))"
    assert opened.run(f"films().forEach(one => one.play(false)); return new Set({heights}).size") == 1  # fmt: skip  # noqa: E501
    change(opened, "species.gas.speed", "2")
    wait_for(lambda: opened.run("return state.shown.at(-1).number") == 3)
    shows(opened, 2)
    assert opened.run("return state.shown.map(one => one.number)") == [1, 3]
    assert opened.complaints() == []


def test_pause_stops_run_and_film_and_go_on_goes_on(opened, lab):
    page = lab.page(opened.run("return lab.page"))
    opened.run("Object.assign(state.settings, arguments[0]); run()", LONG)
    wait_for(lambda: 2 in page.runs and page.newest.running)
    run_of(opened, 2)
    assert "End follows it" in in_film(opened, "live")
    opened.press("\ue010")  # End
    assert "the film follows it" in in_film(opened, "live")
    wait_for(lambda: opened.run("return $('pause').textContent") == "Pause")
    opened.click("pause")
    wait_for(lambda: opened.run("return state.stopped"))
    wait_for(lambda: opened.run("return $('pause').textContent") == "Go on")
    assert not page.newest.running and opened.run("return !films().some(isPlaying)")
    opened.click("pause")
    wait_for(lambda: page.newest.running)
    assert list(page.runs) == [2] and "--resume" in page.newest.process.args
    opened.open("about:blank")  # the page says goodbye
    wait_for(lambda: lab.pages == {})


def test_the_keyboard_is_enough(opened):
    """Keys of the film act on the page, those of the page in the film."""
    opened.press("p")
    opened.press("\ue011")  # Home
    opened.press("\ue014")  # arrow right
    assert "frame 2/" in in_film(opened, "clock")
    opened.press("c")
    assert opened.run("return isComparing()")
    opened.press("s")
    assert opened.run("return getComputedStyle($('form')).display") == "none"
    opened.press("s")
    opened.run("document.querySelector('iframe').contentWindow.focus()")
    opened.press("r")
    run_of(opened, 2)


@pytest.mark.parametrize(
    ("width", "height", "phone"),
    [(1280, 800, False), (1920, 1080, False), (390, 844, True), (844, 390, True)],
)
def test_nothing_is_wider_than_the_screen(server, lab, browser, monkeypatch, width, height, phone):
    monkeypatch.setattr(lab, "filmed", script.filmed)
    browser.resize(width, height, phone)
    browser.open(f"http://127.0.0.1:{server}/")
    shows(browser)
    for form in (False, True):
        browser.run("bare(!arguments[0])", form)
        wide = browser.run(
            """const all = [...document.querySelectorAll('body *')].filter(one => one.offsetParent);
            return all.filter(one => one.getBoundingClientRect().right > innerWidth + 1
              && !one.closest('.run > header p')).map(one => one.outerHTML.slice(0, 80));"""
        )
        assert wide == []
        assert browser.run("return document.documentElement.scrollHeight <= innerHeight + 1")
