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
from tqdm import tqdm

import lab as script
from hostile import besiege, status_of
from ricochet import experiment, laboratory
from ricochet.experiment import Refused
from ricochet.laboratory import Laboratory
from ricochet.live import Server
from ricochet.namelists import edited, place_of, scan, with_groups
from ricochet.variables import limits_of, table
from synthetic_run import ROOT, run_script
from whole_runs import FINISHED, PATIENCE, differences, wait_for, write_input

INPUTS = sorted((ROOT / "input").glob("*.nml"))
LONG = {
    "stop.collisions_per_disk": "1e9",
    "output.frames_every_collisions": "1000000000",
    "output.observables_every_collisions": "1000000000",
}
MANY = LONG | {
    "stop.collisions_per_disk": "40000",
    "output.frames_every_collisions": "20000",
    "output.observables_every_collisions": "20000",
}


@pytest.fixture(scope="session")
def variables(program):
    return table(program)


# --- the table ---


def test_the_table_has_every_variable_and_its_default(program, variables):
    text = subprocess.run([program, "--print-defaults"], capture_output=True, text=True).stdout
    group, lines = "", []
    for line in text.splitlines():
        if found := re.match(r"(?:! )?&(\w+)$", line):
            group = found[1]
        elif found := re.match(r"(?:! )?  (?:! )?(\w+) = (.*?) +! ", line):
            lines.append((group, found[1], found[2]))
    entries = [(g, name, v["value"]) for g, own in variables.items() for name, v in own.items()]
    assert lines == entries
    assert variables["obstacle"]["centre"]["needed"] and not variables["stop"]["events"]["needed"]


@pytest.mark.parametrize(
    ("allowed", "kind", "size", "low", "high", "strict"),
    [
        ("a number from -1 to 1", "number", 1, -1, 1, False),
        ("2 integers from 1 to 100000000", "integer", 2, 1, 1e8, False),
        ("a number > 0 and < 1", "number", 1, 0, 1, True),
        ("a number >= 1e-12 and < 1", "number", 1, 1e-12, 1, False),
        ("numbers", "number", 0, None, None, False),
        ("an integer >= 0", "integer", 1, 0, None, False),
        ("text in quotes", "text", 1, None, None, False),
        (".true. or .false.", "choice", 1, None, None, False),
        ("2 values, each 'wall' or 'periodic'", "choice", 2, None, None, False),
    ],
)
def test_what_is_allowed_is_understood(allowed, kind, size, low, high, strict):
    found = limits_of(allowed)
    assert (found["type"], found["size"], found["open"]) == (kind, size, strict)
    assert (found["low"], found["high"]) == (low, high)


# --- input files ---


@pytest.fixture
def outputs(ricochet, tmp_path):
    """`outputs(words, words)` runs both; what differs, apart from how the input was given."""

    def compare(one, other):
        for name, words in {"a.h5": one, "b.h5": other}.items():
            done = ricochet(*words, "-o", name, "--force", "--quiet")
            assert done.returncode == FINISHED, done.stderr
        names = differences(tmp_path / "a.h5", tmp_path / "b.h5")
        return [
            name for name in names if name not in ("/parameters/input", "/parameters/overrides")
        ]

    return compare


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.stem)
def test_an_edited_file_gives_the_run_of_the_same_settings(path, outputs, tmp_path, variables):
    """Of every input: a value replaced, one added, one removed, a group added."""
    text = path.read_text()
    settings = {"stop.time": "0.01", "run.title": "it's, so", "contact.restitution": "0.875"}
    first = place_of(next(group for group in scan(text) if group.kind == "species"), variables)
    settings[f"{first}.mass"] = "1.5"
    settings |= {f"stop.{name}": "" for name in ("events", "energy_fraction", "collisions")}
    settings |= {"stop.collisions_per_disk": "", "output.event_log": ".true."}
    mine = write_input(tmp_path, edited(text, settings, variables))
    words = [part for pair in settings.items() for part in ("--set", "=".join(pair))]
    assert outputs([mine], [path, *words]) == []
    assert [line for line in text.splitlines() if line.startswith("!")] == [
        line for line in mine.read_text().splitlines() if line.startswith("!")
    ]


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.stem)
def test_what_a_form_shows_is_all_that_a_file_gives(path, outputs, tmp_path, variables):
    """An empty file with the values of the form gives the same run."""
    groups = scan(path.read_text())
    settings, bare = {"stop.events": "20"}, ""
    for group in groups:
        given = group.given(variables[group.kind])
        bare = with_groups(bare, [(group.kind, given.pop("name", ""))])
        settings |= {f"{place_of(group, variables)}.{name}": own for name, own in given.items()}
    settings["stop.events"] = "20"
    mine = write_input(tmp_path, edited(bare, settings, variables))
    assert outputs([mine], [path, "--set", "stop.events=20"]) == []


def test_values_in_all_their_spellings_are_found_and_replaced(outputs, tmp_path, variables):
    text = """&RUN Title = 'an "odd" one / it''s' ! & no = 1
    seed=3/ ! &box gravity = 1, 1 /
    &box gravity(2) = -1.5d0, upper = 2*2 /
    &species count = 5, radius = 0.05 speed = 1 /
    &stop collisions = 9 /"""
    run, box, species, stop = scan(text)
    assert run.given(variables["run"]) == {"title": 'an "odd" one / it\'s', "seed": "3"}
    assert box.given(variables["box"]) == {"gravity": "0,-1.5d0", "upper": "2,2"}
    assert (species.label, stop.label) == ("species1", "stop1")
    settings = {"box.gravity": "0,-2", "run.title": "/", "species.species1.count": "4"}
    new = write_input(tmp_path, edited(text, settings, variables), "new.nml")
    words = [part for pair in settings.items() for part in ("--set", "=".join(pair))]
    assert outputs([new], [write_input(tmp_path, text), *words]) == []


# --- runs ---


@pytest.fixture
def laboratory_of(program, tmp_path, monkeypatch):
    """`laboratory_of(*inputs)`; its runs end with the test."""
    monkeypatch.setenv("RICOCHET", str(program))
    made = []

    def make(*inputs):
        folder = tmp_path / f"lab{len(made)}"
        folder.mkdir()
        made.append(Laboratory(list(inputs or INPUTS), folder, lambda run: {}))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture
def lab(laboratory_of):
    return laboratory_of()


def wish(lab, page, name="gas", settings=None, added=(), **more):
    return lab.start(
        {"page": page, "input": name, "settings": settings or {}, "added": list(added), **more}
    )


def test_every_input_has_a_form_and_runs(lab):
    page = lab.new_page()
    for name in lab.inputs:
        form = lab.form(name)
        assert form["about"] and any(group["kind"] == "species" for group in form["groups"])
        answer = wish(lab, page, name, form["settings"] | {"stop.events": "50"})
        assert answer["problems"] == [], name
        lab.page(page).newest.process.wait()
        assert lab.state(page) == {"running": False, "stopped": False, "reason": ""}, name


def test_without_a_cadence_in_the_file_there_are_frames_nevertheless(lab):
    page = lab.new_page()
    wish(lab, page, "crater", lab.form("crater")["settings"])
    lab.page(page).newest.process.wait()
    assert laboratory.FRAMES / 2 < lab.page(page).newest.opened().frames < 3 * laboratory.FRAMES
    assert lab.form("gravity")["settings"] == {}


WRONG = {
    "species.projectile.mass": ("-3", "is out of range; allowed: a number > 0"),
    "contact.restitution": ("x", "is not a number"),
    "species.bed.radius": ("0.01", ""),
    "box.boundary": ("wall", "1 value instead of 2"),
    "output.event_log": ("maybe", ".true."),
    "box.gravity": ("0,-1,2", "3 values instead of 2"),
}


@pytest.mark.parametrize("variable", WRONG)
def test_a_wrong_value_gets_the_line_of_the_program_at_its_variable(lab, ricochet, variable):
    value, words = WRONG[variable]
    problems = wish(lab, lab.new_page(), "crater", {variable: value})["problems"]
    said = ricochet(ROOT / "input/crater.nml", "--check", "--set", f"{variable}={value}").stderr
    assert [line["text"] for line in problems] == [
        line.replace(f"{ROOT / 'input'}/", "") for line in said.splitlines()
    ]
    assert words in problems[0]["text"]
    group = variable.rpartition(".")[0]
    assert all(line["place"].rpartition(".")[0] == group for line in problems), problems


def test_a_mistake_of_the_file_is_shown_at_its_group(laboratory_of, tmp_path):
    text = """&species name = 'a' count = 3 radius = 0.1 /
    &species name = 'b'
      count = 3
    /
    &stop time = 1 /"""
    lab = laboratory_of(write_input(tmp_path, text, "mine.nml"))
    (problem,) = wish(lab, lab.new_page(), "mine")["problems"]
    assert problem["place"].startswith("species.b"), problem


def test_the_command_that_is_shown_gives_the_same_run(lab, ricochet, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    settings = {"species.gas.count": "50", "run.title": "it's, so", "stop.events": "99"}
    page = lab.new_page()
    command = wish(lab, page, settings=settings)["command"]
    own = lab.page(page).newest
    own.process.wait()
    assert subprocess.run(command, shell=True, capture_output=True).returncode == FINISHED
    names = differences(own.output, tmp_path / "runs/gas.h5")
    assert names == []


def test_an_added_group_is_run_and_in_the_file_to_download(lab, outputs, tmp_path):
    page, added = lab.new_page(), [["obstacle", "post"]]
    settings = {"obstacle.post.centre": "0.5,0.5", "obstacle.post.radius": "0.1"}
    settings["stop.events"] = "99"
    answer = wish(lab, page, settings=settings, added=added)
    assert answer["problems"] == [] and answer["command"].endswith(" gas.nml -o gas.h5")
    own = lab.page(page).newest
    own.process.wait()
    assert len(own.opened().obstacles) == 1
    write_input(tmp_path, edited(own.text, own.settings, lab.table), "mine.nml")
    write_input(tmp_path, own.text)
    words = [part for pair in settings.items() for part in ("--set", "=".join(pair))]
    assert outputs(["mine.nml"], ["gas.nml", *words]) == []


def going_on(lab, page, **more):
    """A run that would go on for very long."""
    assert wish(lab, page, settings=LONG, **more)["problems"] == []
    run = lab.page(page).newest
    run.opened()
    assert run.running
    return run


def test_a_page_has_one_run_and_keeps_the_one_to_compare_with(lab):
    page = lab.new_page()
    first = going_on(lab, page)
    second = going_on(lab, page, keep=1)
    third = going_on(lab, page, keep=1)
    assert not first.running and not second.running and third.running
    assert first.folder.exists() and not second.folder.exists()
    assert list(lab.page(page).runs) == [1, 3]


def test_a_stopped_run_goes_on_from_its_checkpoint(lab):
    page = lab.new_page()
    run = going_on(lab, page)
    lab.stop({"page": page})
    run.process.wait()
    assert lab.state(page) == {"running": False, "stopped": True, "reason": "stopped"}
    run = going_on(lab, page, resume=True)
    assert "--resume" in run.process.args and list(lab.page(page).runs) == [1]
    lab.stop({"page": page})
    run.process.wait()
    assert lab.state(page)["stopped"], run.said()


def test_a_page_may_ask_while_its_run_begins(lab, monkeypatch):
    page, seen = lab.new_page(), []
    begin = experiment.Experiment.begin
    monkeypatch.setattr(
        experiment.Experiment,
        "begin",
        lambda run, resume: (seen.append(lab.state(page)), begin(run, resume)),
    )
    assert wish(lab, page)["run"] == 1
    assert seen == [{"running": False, "stopped": False, "reason": ""}]


def test_a_form_waits_for_the_sample_of_its_own_input_only(lab, monkeypatch):
    begin, held, entered = experiment.Experiment.begin, threading.Event(), threading.Event()

    def slow(run, resume):
        if run.name == "crater":
            entered.set()
            held.wait(PATIENCE)
        begin(run, resume)

    monkeypatch.setattr(experiment.Experiment, "begin", slow)
    thread = threading.Thread(target=script.picture, args=[lab, "crater"])
    thread.start()
    entered.wait(PATIENCE)
    other = threading.Thread(target=lab.form, args=["gas"], daemon=True)
    other.start()
    other.join(PATIENCE)
    assert not other.is_alive() and not held.is_set()
    held.set()
    thread.join()


def test_a_film_waits_for_no_progress_bar(lab):
    """An interrupt may keep the lock of all bars for ever."""
    page = lab.new_page()
    wish(lab, page)
    run = lab.page(page).newest
    run.process.wait()
    with tqdm.get_lock():
        thread = threading.Thread(target=script.filmed, args=[run.opened()], daemon=True)
        thread.start()
        thread.join(PATIENCE)
        assert not thread.is_alive()


@pytest.mark.parametrize("how", ["silence", "goodbye", "another page"])
def test_a_run_ends_when_its_page_goes(lab, monkeypatch, how):
    page = lab.new_page()
    run = going_on(lab, page)
    if how == "goodbye":
        lab.leave(page)
        assert not run.folder.exists()
    else:
        lab.watch()
        assert run.running and not run.reason
        monkeypatch.setattr(laboratory, "SILENCE", -1)
        if how == "silence":
            lab.watch()
        else:
            monkeypatch.setattr(laboratory, "PAGES", 1)
            lab.new_page()
    run.process.wait(PATIENCE)
    assert not run.running


def test_no_more_than_so_many_pages(lab):
    pages = [lab.new_page() for _ in range(laboratory.PAGES)]
    assert len(set(pages)) == laboratory.PAGES
    with pytest.raises(Refused, match="close one"):
        lab.new_page()
    lab.leave(pages[0])
    lab.new_page()


def test_a_run_is_stopped_at_its_limits_and_says_so(lab, monkeypatch):
    page = lab.new_page()
    for limit, words in {"SECONDS": "which a run may take", "MEGABYTES": "0 MB"}.items():
        run = going_on(lab, page)
        with monkeypatch.context() as patch:
            patch.setattr(experiment, limit, 0)
            lab.watch()
        run.process.wait(PATIENCE)
        state = lab.state(page)
        assert state["stopped"] and state["reason"].startswith("stopped") and words in run.reason


def test_too_many_disks_or_bytes_are_refused_before_the_run(lab):
    page = lab.new_page()
    for settings, words in (
        ({"species.gas.count": "20001"}, "20001 disks; the output needs"),
        ({"stop.collisions_per_disk": "1e9"}, "a run here may have 200 MB"),
        ({"species.gas.count": "100000000"}, "100000000 disks need about"),
    ):
        more = {"species.gas.radius": "1e-6"}
        (problem,) = wish(lab, page, settings=more | settings)["problems"]
        assert words in problem["text"]
    assert lab.page(page).runs == {}


def test_the_kernel_ends_a_run_that_nobody_watches(lab):
    resource = pytest.importorskip("resource")
    run = going_on(lab, lab.new_page())
    seconds = resource.prlimit(run.process.pid, resource.RLIMIT_CPU)[0]
    assert seconds == 2 * experiment.SECONDS


# --- requests ---


@pytest.fixture
def server(lab):
    """The server of a laboratory, in this process; gives its port."""
    one = Server(("127.0.0.1", 0), type("Lab", (script.Answers,), {"lab": lab}))
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
    assert lab.page(page).runs == {}
    assert post(server, "/start", good)[0] == 200
    assert lab.page(page).newest.running


@pytest.mark.parametrize(
    "change",
    [
        {"input": "../gas"},
        {"input": ["gas"]},
        {"settings": []},
        {"settings": {"run.seed": 1}},
        {"settings": {"run.seed": "1\n"}},
        {"settings": {"run.title": "x" * 100000}},
        {"settings": {f"a.{k}": "1" for k in range(2000)}},
        {"added": [["box", "a"]]},
        {"added": "obstacle"},
        {"added": [["obstacle", "a"]] * 1000},
        {"added": [["obstacle", "a\n&stop time = 1 /"]]},
        {"page": None},
        {"page": {}},
    ],
)
def test_wishes_that_make_no_sense_are_refused_in_one_line(lab, server, change):
    page = lab.new_page()
    good = {"page": page, "input": "gas", "settings": {}, "added": []}
    for path in ("/start", "/check"):
        status, text = post(server, path, good | change)
        assert status == 409 and len(text.splitlines()) == 1, text
    assert lab.page(page).runs == {}


def test_a_wish_that_waits_for_its_page_to_go_is_refused(lab):
    page, answers = lab.new_page(), []

    def start():
        with pytest.raises(Refused, match="does not know this page"):
            wish(lab, page)
        answers.append("refused")

    own, held = lab.page(page), laboratory.Laboratory.page
    with own.lock:
        asked = threading.Event()
        lab.page = lambda number: (held(lab, number), asked.set())[0]
        thread = threading.Thread(target=start)
        thread.start()
        asked.wait(PATIENCE)
        lab.pages.pop(page)
    thread.join(PATIENCE)
    assert answers == ["refused"]


def test_a_file_that_is_renamed_meanwhile_is_asked_for_again(lab, server, monkeypatch):
    def gone(*_):
        raise FileNotFoundError

    monkeypatch.setattr(lab, "run", gone)
    host = f"Host: 127.0.0.1:{server}\r\n\r\n".encode()
    assert status_of(server, b"GET /1/2/output HTTP/1.1\r\n" + host) == 409


def test_bodies_that_are_no_wishes_are_refused(server):
    for body in (b"", b"{", b"[]", b"\xff", b"1", b"[" * 100000, b"nan"):
        assert post(server, "/start", body)[0] in (400, 409), body
    assert post(server, "/start", b"{}", **{"Content-Length": "9999999999"})[0] == 400
    assert post(server, "/film", b"{}")[0] == 404


@pytest.mark.parametrize("requests", [200, pytest.param(5000, marks=pytest.mark.check)])
def test_hostile_requests_are_refused_without_a_word(server, capfd, requests):
    host = f"Host: 127.0.0.1:{server}\r\n\r\n".encode()
    for path, status in {"/": 200, "/form?gas": 200, "/form?../gas": 409, "/1/2": 409}.items():
        assert status_of(server, f"GET {path} HTTP/1.1\r\n".encode() + host) == status, path
    besiege(server, requests)
    assert capfd.readouterr() == ("", "")


# --- the command ---


@pytest.fixture
def running(program, tmp_path, monkeypatch):
    """The laboratory as a command, its address, and the program of a run that goes on."""
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
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").parents[1]
    pids = [pid for task in children.glob("*/children") for pid in task.read_text().split()]
    assert len(pids) == 1
    process.send_signal(sign)
    out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, out, err) == (0, "stopped, with all runs\n", "")
    assert not Path("/proc", pids[0]).exists()
    assert list(tmp_path.glob("ricochet-lab-*")) == []


def test_wrong_words_are_refused_in_one_line(capsys, tmp_path):
    for words, reason in (
        (["--port", "99999"], "is not a port"),
        ([tmp_path / "none.nml"], "is no input file"),
        ([ROOT / "README.md"], "is no input file"),
    ):
        assert run_script("lab", *words) == 2
        assert reason in capsys.readouterr().err


def test_a_port_that_is_taken_is_refused_in_one_line(server, program, monkeypatch, capsys):
    monkeypatch.setenv("RICOCHET", str(program))
    assert run_script("lab", "--port", server) == 2
    assert capsys.readouterr().err == f"lab.py: port {server}: Address already in use\n"


# --- the page ---


@pytest.fixture
def opened(server, lab, browser, monkeypatch):
    """The page, with its first run shown."""
    monkeypatch.setattr(lab, "filmed", script.filmed)
    browser.open(f"http://127.0.0.1:{server}/")
    return shows(browser)


def shows(browser, count=1):
    """Wait until so many runs are seen."""
    wait_for(
        lambda: (
            browser.run(
                "return !busy && !again && !document.querySelector('.coming') && films().length"
            )
            == count
        )
    )
    return browser


def change(browser, variable, value):
    """Type a value; what the row says then is in `problem_of`."""
    browser.run(
        """const row = document.querySelector(`[data-place="${arguments[0]}"]`);
        row.querySelector('input:not([type]), select').value = arguments[1];
        row.querySelector('input:not([type]), select').dispatchEvent(new Event('change'));""",
        variable,
        value,
    )


def test_the_form_has_every_variable_of_every_group(opened, lab):
    rows = set(
        opened.run("return [...document.querySelectorAll('.variable')].map(r => r.dataset.place)")
    )
    wanted = set()
    for kind, variables in lab.table.items():
        place = "species.gas" if kind == "species" else kind
        if place == kind and "name" in variables:
            continue  # the file has none
        wanted |= {f"{place}.{name}" for name in variables if name != "name"}
    assert rows == wanted
    offered = opened.run("return [...$('add').options].map(option => option.value)")
    kinds = {value.split()[0] for value in offered if value}
    assert kinds == {kind for kind, variables in lab.table.items() if "name" in variables}
    assert opened.complaints() == []


def test_a_slider_is_followed_by_a_run(opened, lab):
    opened.run(
        """const slider = document.querySelector('[data-place="species.gas.count"] [type=range]');
        slider.value = 250;
        slider.dispatchEvent(new Event('input'));"""
    )
    wait_for(lambda: opened.run("return state.shown[0].number") == 2)
    shows(opened)
    count = int(opened.run("return state.settings['species.gas.count']"))
    assert 30 <= count <= 300
    page = lab.page(opened.run("return lab.page"))
    assert page.newest.opened().count == count
    assert f"species.gas.count={count}" in opened.run(
        "return document.querySelector('.run button').title"
    )


def test_sliders_keep_to_what_is_allowed(opened):
    """Both ends and the middle of every slider are values that the table allows."""
    wrong = opened.run(
        """const wrong = [];
        const all = Object.entries(lab.table).flatMap(([kind, own]) =>
          Object.entries(own).map(([name, v]) => [kind, name, v]));
        for (const [kind, name, v] of all) {
          if (!['number', 'integer'].includes(v.type)) continue;
          for (const start of v.value.split(', ')) {
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


def test_a_wrong_value_is_marked_and_the_run_before_stays(opened):
    change(opened, "species.gas.radius", "-1")
    wait_for(lambda: opened.run("return document.querySelector('.wrong') !== null"))
    words = opened.run("return document.querySelector('.wrong .problem').textContent")
    assert words.startswith("--set species.gas.radius=-1: species.radius:")
    assert opened.run("return state.shown[0].number") == 1
    change(opened, "species.gas.radius", "0.005")
    wait_for(lambda: opened.run("return document.querySelector('.wrong') === null"))
    shows(opened)


def test_two_runs_stand_side_by_side_at_one_pace(opened):
    opened.click("compare")
    change(opened, "species.gas.speed", "3")
    shows(opened, 2)
    paces = opened.run("return films().map(one => one.choices().pace)")
    assert paces[0] == paces[1]
    words = [
        "films()[1].document.getElementById('live').textContent = ''",
        "document.querySelectorAll('.run > header p')[1].textContent = 'long '.repeat(50)",
    ]
    for one in words:  # that the other does not have
        opened.run(f"{one}; films().forEach(one => one.play(false))")
        heights = "films().map(one => (one.layout(), inFilm(one, 'stage').offsetHeight))"
        assert opened.run(f"return new Set({heights}).size") == 1
    change(opened, "species.gas.speed", "2")
    wait_for(lambda: opened.run("return state.shown.at(-1).number") == 3)
    shows(opened, 2)
    assert opened.run("return state.shown.map(one => one.number)") == [1, 3]
    assert opened.complaints() == []


def test_pause_stops_the_run_and_go_on_goes_on(opened, lab):
    page = lab.page(opened.run("return lab.page"))
    opened.run("Object.assign(state.settings, arguments[0]); run()", LONG)
    wait_for(lambda: 2 in page.runs and page.newest.running)
    shows(opened)
    wait_for(lambda: opened.run("return $('pause').textContent") == "Pause")
    opened.click("pause")
    wait_for(lambda: opened.run("return state.stopped"))
    wait_for(lambda: opened.run("return $('pause').textContent") == "Go on")
    assert not page.newest.running
    opened.click("pause")
    wait_for(lambda: page.newest.running)
    assert list(page.runs) == [2]
    opened.open("about:blank")  # the page says goodbye
    wait_for(lambda: lab.pages == {})


def test_a_film_that_is_paused_while_it_comes_stands_at_its_first_frame(opened):
    for key in ("r", "p", "\ue011"):  # Home
        opened.press(key)
    wait_for(lambda: opened.run("return state.shown[0].number") == 2)
    shows(opened)
    assert opened.run("return !films().some(isPlaying)")
    assert "frame 1/" in opened.run("return inFilm(films()[0], 'clock').textContent")
    wait_for(lambda: opened.run("return $('pause').textContent") == "Go on")


def test_the_film_goes_on_where_it_was_paused(opened, lab):
    page = lab.page(opened.run("return lab.page"))
    opened.run("Object.assign(state.settings, arguments[0]); run()", MANY)
    wait_for(lambda: 2 in page.runs and page.newest.running)
    shows(opened)
    time = "return +inFilm(films()[0], 'clock').querySelector('b').textContent"
    opened.press("\ue010")  # End
    wait_for(lambda: opened.run(time) > 0)
    opened.press("p")
    wait_for(lambda: opened.run("return state.stopped"))
    paused = opened.run(time)
    opened.press("c")
    opened.press("p")
    wait_for(lambda: opened.run("return state.running"))
    wait_for(lambda: opened.run(time) > paused)
    assert opened.run("return state.shown.map(one => one.number)") == [2]


def test_a_choice_does_not_wait_for_the_pictures_of_others(opened, lab, monkeypatch):
    held = threading.Event()
    monkeypatch.setattr(script, "picture", lambda *_: (held.wait(PATIENCE), b"")[1])
    opened.click("choose")
    wait_for(lambda: opened.run("return document.querySelector('#inputs img').src") != "")
    opened.run("[...$('inputs').children].find(one => one.textContent === 'crater').click()")
    wait_for(lambda: opened.run("return state.input") == "crater")
    assert not held.is_set()
    held.set()


def test_the_keyboard_is_enough(opened):
    opened.press("c")
    assert opened.run("return isComparing()")
    opened.press("s")
    assert opened.run("return getComputedStyle($('form')).display") == "none"
    opened.press("s")
    opened.run("document.querySelector('[data-place=\"species.gas.count\"] [type=range]').focus()")
    opened.press("\ue014")  # arrow right
    shows(opened, 2)
    assert int(opened.run("return state.settings['species.gas.count']")) > 1000
    seen = set()
    for _ in range(12):
        opened.press("\ue004")  # tab
        seen.add(opened.run("return document.activeElement.id || document.activeElement.tagName"))
    assert len(seen) > 5


def test_keys_work_wherever_the_focus_is(opened):
    """Those of the film on the page, those of the page in the film."""
    opened.press("p")
    opened.press("\ue011")  # Home
    opened.press("\ue014")  # arrow right
    assert "frame 2/" in opened.run("return inFilm(films()[0], 'clock').textContent")
    opened.run("document.querySelector('iframe').contentWindow.focus()")
    opened.press("r")
    wait_for(lambda: opened.run("return state.shown[0].number") == 2)
    shows(opened)


def test_a_film_begins_with_its_run_however_far_that_is(opened, lab):
    page = lab.page(opened.run("return lab.page"))
    opened.run("Object.assign(state.settings, arguments[0]); run()", LONG)
    wait_for(lambda: 2 in page.runs and page.newest.running)
    shows(opened)
    assert "End follows it" in opened.run("return inFilm(films()[0], 'live').textContent")
    opened.press("\ue010")  # End
    assert "the film follows it" in opened.run("return inFilm(films()[0], 'live').textContent")


def test_the_box_has_all_the_room_that_the_histogram_leaves(opened):
    """Also where that was larger before, in a wider window; and all that the words leave."""
    height = "return inFilm(films()[0], 'stage').offsetHeight"
    first = opened.run(height)
    opened.run("films()[0].go(0); films()[0].layout()")
    assert opened.run(height) == first
    opened.click("compare")
    change(opened, "species.gas.speed", "2")
    shows(opened, 2)
    heights = opened.run(
        """films().forEach(one => one.play(false));
        return films().map(one => [0, 500].map(height => {
          if (height) inFilm(one, 'histogram').height = height;
          one.layout();
          return inFilm(one, 'stage').offsetHeight;
        }));"""
    )
    assert all(before == after for before, after in heights), heights


def test_what_is_chosen_in_a_film_stays_for_the_next_run(opened):
    opened.run(
        """const colour = inFilm(films()[0], 'colour');
        colour.value = 'displacement';
        colour.dispatchEvent(new Event('change'));"""
    )
    opened.press("r")
    wait_for(lambda: opened.run("return state.shown[0].number") == 2)
    shows(opened)
    assert opened.run("return films()[0].choices().colour") == "displacement"


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
    browser.run("bare(true)")
    stage = browser.run(
        """const frame = document.querySelector('iframe').getBoundingClientRect();
        const box = inFilm(films()[0], 'stage').getBoundingClientRect();
        return [frame.top + box.bottom, box.height]"""
    )
    assert stage[0] <= height and stage[1] >= 190
