"""A run that goes on, shown in the browsers of this computer: `player.py --live`."""

import http.client
import json
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request

import numpy as np
import pytest

from ricochet.live import LOOK, Live, Server, handler
from synthetic_run import ROOT, run_script, write_run, written
from whole_runs import PATIENCE, frames_in, wait_for, write_input

LONG = """&run threads = 1 /
&species count = 2000 packing_fraction = 0.2 temperature = 1 /
&stop collisions = 1000000000 /
&output frames_every_collisions = 50000 /
"""
#: The player waits for pages that have asked lately, however slow they are.
SHOW = """import sys; sys.path[:0] = [sys.argv.pop(1)]; sys.argv[0] = "player.py"
from ricochet import live, script; live.PATIENCE = 1e9
import player; script.launch(player.main)"""


@pytest.fixture
def live(started, tmp_path):
    """A run that goes on, but stands still at present; the player that shows it; its address."""
    write_input(tmp_path, LONG)
    run = started("gas.nml", "-o", "gas.h5")
    part = tmp_path / "gas.h5.part"
    wait_for(lambda: frames_in(part, "particles/disks") > 2)
    run.send_signal(signal.SIGSTOP)
    command = [sys.executable, "-c", SHOW, ROOT / "post", part, "--live"]
    show = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    yield run, show, show.stdout.readline().split()[0]
    show.kill()
    show.communicate()


def opened(browser, address):
    """The page with its film."""
    browser.open(address)
    wait_for(lambda: browser.run("return live.stamp !== ''"))
    return browser


def test_the_film_keeps_up_with_the_run_until_one_goes_elsewhere(live, browser):
    run, _, address = live
    assert address.startswith("http://127.0.0.1:")
    opened(browser, address)
    browser.run("window.requestAnimationFrame = draw => { window.draw = draw; }")
    browser.run("play(false); play(true)")
    first = browser.run("draw(0); return last()")
    run.send_signal(signal.SIGCONT)
    wait_for(lambda: browser.run("return last()") > first)
    taken = browser.run("const t = moment.time; return (last() - t) / paceNow()")
    assert 0.1 < taken <= 10  # the time since the answer before
    browser.run(
        """let now = performance.now() + 1e6;
        for (let k = 0; k <= 1000; k++) draw(now += 10);"""
    )
    assert browser.run("return moment.time === last()")
    assert "Live: the run is at t =" in browser.run("return $('live').textContent")
    assert "the film follows it" in browser.run("return $('live').textContent")
    browser.run("go(first())")
    assert "End follows it" in browser.run("return $('live').textContent")
    seen = browser.run("return last()")
    wait_for(lambda: browser.run("return last()") > seen)
    assert browser.run("return moment.time === first()")
    browser.press("\ue010")  # end
    assert browser.run("return [live.newest, state.playing]") == [True, True]
    assert run.poll() is None and browser.complaints() == []


def stop(run):
    """TERM for a run that stands still."""
    run.send_signal(signal.SIGTERM)
    run.send_signal(signal.SIGCONT)


@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGTERM])
def test_the_show_stops_when_asked_and_the_run_goes_on(live, sign):
    run, show, address = live
    with urllib.request.urlopen(address + "film", timeout=PATIENCE) as reply:
        assert reply.status == 200
    show.send_signal(sign)
    out, err = show.communicate()
    assert (show.returncode, err, out.strip()) == (0, "", "stopped; the run goes on")
    assert run.poll() is None


@pytest.mark.parametrize("how", ["has ended", "has stopped"])
def test_the_show_ends_with_the_run_and_says_so(live, browser, tmp_path, how):
    """The page keeps the film."""
    run, show, address = live
    opened(browser, address)
    part, left = tmp_path / "gas.h5.part", tmp_path / "gas.h5"
    if how == "has ended":
        part.rename(left)  # as a run does at its end
    else:
        stop(run)
        left = part
    out, err = show.communicate()
    assert (show.returncode, err, out.strip()) == (0, "", f"the run {how}: {left}")
    wait_for(lambda: f"{how}, at t" in browser.run("return $('live').textContent"))
    unfinished = "is unfinished" in browser.run("return $('warning').textContent")
    assert unfinished == (how == "has stopped")
    browser.run("go(first())")
    assert browser.run("return live.on") is False


def test_a_show_without_a_page_ends_at_once(live, tmp_path, capsys):
    """Of a run that has stopped there is none."""
    run, show, _ = live
    stop(run)
    run.wait()
    out, _ = show.communicate(timeout=PATIENCE)
    part = tmp_path / "gas.h5.part"
    assert out.strip() == f"the run has stopped: {part}"
    assert run_script("player", part, "--live") == 2
    assert "gas.h5.part: the run has stopped; leave out --live" in capsys.readouterr().err
    finished = write_run(tmp_path / "a.h5", np.full((1, 1, 2), 0.5), np.zeros((1, 1, 2)))
    assert run_script("player", finished, "--live") == 2
    assert "has finished; leave out --live" in capsys.readouterr().err


def test_the_show_of_a_run_that_is_killed_ends_and_says_so(live, tmp_path, capsys):
    """A stopped one goes on; the kernel drops the lock of a killed one."""
    run, show, address = live
    part = tmp_path / "gas.h5.part"
    time.sleep(4 * LOOK)
    assert show.poll() is None
    with urllib.request.urlopen(address + "film", timeout=PATIENCE) as reply:  # a page is there
        assert json.load(reply)["end"] == ""
    run.kill()
    run.wait()
    with urllib.request.urlopen(address + "film", timeout=PATIENCE) as reply:
        assert json.load(reply)["end"] == "was killed or has crashed"
    out, err = show.communicate(timeout=PATIENCE)
    assert (show.returncode, out) == (2, "")
    assert err == f"player.py: {part}: the run was killed or has crashed\n"
    assert run_script("player", part, "--live") == 2
    assert "gas.h5.part: the run was killed or has crashed; leave" in capsys.readouterr().err


# --- requests ---


@pytest.fixture
def server(tmp_path):
    """The server of a film, in this process; gives its port, and what shows the film."""
    x = np.full((2, 3, 2), 0.5)
    live = Live(written(tmp_path / "a.h5.part", x, x), lambda run: {})
    one = Server(("127.0.0.1", 0), handler(live, b"the page"))
    threading.Thread(target=one.serve_forever, daemon=True).start()
    yield one.server_address[1], live
    one.shutdown()
    one.server_close()


def ask(port, path="/", hosts=("127.0.0.1:PORT",), method="GET"):
    """The status of the answer under these names."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    connection.putrequest(method, path, skip_host=True)
    for one in hosts:
        connection.putheader("Host", one.replace("PORT", str(port)))
    connection.endheaders()
    return connection.getresponse().status


def test_requests_under_another_name_are_refused(server):
    port, _ = server
    assert ask(port) == ask(port, hosts=["localhost:PORT"]) == 200
    for hosts in (["evil.example"], ["evil.example:PORT"], [], ["localhost"], ["127.0.0.1:1"]):
        assert ask(port, hosts=hosts) == ask(port, "/film", hosts) == 403, hosts
    assert ask(port, hosts=["localhost:PORT", "evil.example"]) == 403
    assert ask(port, "/../gas.nml") == 404
    assert ask(port, method="POST") == 400


def test_the_end_counts_as_told_when_it_has_been_sent(server, monkeypatch):
    """Else the server could leave with its last answer half written."""
    port, live = server
    told, send = [], Server.finish_request

    def finish(*words):
        told.append(live.delivered)
        send(*words)

    monkeypatch.setattr(Server, "finish_request", finish)
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/film", timeout=PATIENCE) as reply:
        assert json.load(reply)["end"] == "has stopped"
    wait_for(lambda: live.delivered)
    assert told == [False]


def status_of(port, request):
    """The status that the server answers to these bytes; 0 without an answer."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as connection:
        connection.sendall(request)
        connection.shutdown(socket.SHUT_WR)
        answer = connection.makefile("rb").read()
    return int(answer[9:12] or 0)


def test_requests_that_are_none_are_refused_without_a_word(server, capfd):
    port, _ = server
    host = f"Host: 127.0.0.1:{port}\r\n\r\n".encode()
    for path, status in {"/": 200, "/film": 200, "http://[::1/film": 404, "*": 404}.items():
        assert status_of(port, f"GET {path} HTTP/1.1\r\n".encode() + host) == status, path
    assert status_of(port, b"GET / HTTP/2.0\r\n" + host) == 400
    assert status_of(port, b"GET /\r\n\r\n") == 403
    assert capfd.readouterr() == ("", "")
