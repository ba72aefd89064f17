"""Unfinished runs in browsers on this computer: `player.py --live`."""

import signal
import socket
import subprocess
import sys
import time
import urllib.request

import numpy as np
import pytest

from ricochet.pages.live import CHECK_INTERVAL
from synthetic_run import ROOT, run_script, write_run
from whole_runs import PATIENCE, frames_in, wait_for, write_input

LONG = """&run threads = 1 /
&species count = 2000 packing_fraction = 0.2 temperature = 1 /
&stop collisions = 1000000000 /
&output frames_every_collisions = 50000 /
"""
#: The player waits for pages with recent requests, however slow they are.
SHOW = """import sys; sys.path[:0] = [sys.argv.pop(1)]; sys.argv[0] = "player.py"
from ricochet import live, script; live.PATIENCE = 1e9
import player; script.launch(player.main)"""


@pytest.fixture
def live(started, tmp_path):
    """Yield a suspended run, the player that shows it, and the address of the player."""
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
    """Return the browser with the page and its film."""
    browser.open(address)
    browser.until("return live.stamp !== ''")
    return browser


def test_the_film_keeps_up_with_the_run_until_one_goes_elsewhere(live, browser):
    """This takes 5 to 10 s, because each request converts the run to a film again."""
    run, _, address = live
    assert address.startswith("http://127.0.0.1:")
    opened(browser, address)
    browser.run("window.requestAnimationFrame = draw => { window.draw = draw; }")
    browser.run("play(false); play(true)")
    first = browser.run("draw(0); return last()")
    run.send_signal(signal.SIGCONT)
    wait_for(lambda: browser.run("return last()") > first)
    taken = browser.run("const t = moment.time; return (last() - t) / paceNow()")
    assert 0.1 < taken <= 10  # time since the previous answer
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


@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGTERM])
def test_the_show_stops_when_asked_and_the_run_goes_on(live, sign):
    run, show, address = live
    with urllib.request.urlopen(address + "film", timeout=PATIENCE) as reply:
        assert reply.status == 200
    show.send_signal(sign)
    out, err = show.communicate(timeout=PATIENCE)
    assert (show.returncode, err, out.strip()) == (0, "", "stopped; the run continues")
    assert run.poll() is None


@pytest.mark.parametrize("how", ["has ended", "has stopped", "was killed or has crashed"])
@pytest.mark.parametrize("seen", [True, False])
def test_the_show_ends_with_the_run_and_says_so(live, browser, tmp_path, capsys, how, seen):
    """A page keeps the film. A suspended run counts as running; a killed run has no lock."""
    run, show, address = live
    part, left = tmp_path / "gas.h5.part", tmp_path / "gas.h5"
    if seen:
        opened(browser, address)
    time.sleep(4 * CHECK_INTERVAL)
    assert show.poll() is None
    if how == "has ended":
        part.rename(left)  # as a run does at its end
    else:
        left = part
        run.send_signal(signal.SIGTERM if how == "has stopped" else signal.SIGKILL)
        run.send_signal(signal.SIGCONT)
        run.wait(PATIENCE)
    out, err = show.communicate(timeout=PATIENCE)
    if "crashed" in how:
        assert (show.returncode, out, err) == (2, "", f"player.py: {part}: the run {how}\n")
    else:
        assert (show.returncode, err, out.strip()) == (0, "", f"the run {how}: {left}")
    if seen:
        wait_for(lambda: f"{how}, at t" in browser.run("return $('live').textContent"))
        unfinished = "is unfinished" in browser.run("return $('warning').textContent")
        assert unfinished == (how != "has ended")
        browser.run("go(first())")
        assert browser.run("return live.on") is False
    if how == "has ended":
        left = write_run(left, np.full((1, 1, 2), 0.5), np.zeros((1, 1, 2)))
        how = "has finished"
    assert run_script("player", left, "--live") == 2
    assert f"{how}; leave out --live" in capsys.readouterr().err


# --- requests ---


def test_requests_under_another_name_are_refused(live):
    """Invalid requests are refused in the same way, without an answer."""
    _, show, address = live
    server = int(address.split(":")[2][:-1])

    def status_of(line, *hosts):
        head = "".join(f"Host: {one}\r\n".replace("PORT", str(server)) for one in hosts)
        with socket.create_connection(("127.0.0.1", server), timeout=PATIENCE) as connection:
            connection.sendall(f"{line}\r\n{head}Connection: close\r\n\r\n".encode())
            answer = connection.makefile("rb").read()
        return int(answer[9:12] or 0)  # 0 if there is no answer

    own, other = "127.0.0.1:PORT", "evil.example"
    assert status_of("GET / HTTP/1.1", "localhost:PORT") == 200
    names = [[other], [f"{other}:PORT"], [], ["localhost"], ["127.0.0.1:1"], [own, other]]
    for hosts in names:
        for path in ("/", "/film"):
            assert status_of(f"GET {path} HTTP/1.1", *hosts) in (400, 403), hosts
    for path in ("/", "/film"):
        assert status_of(f"GET {path} HTTP/1.1", own) == 200, path
    for line in ("GET /../gas.nml HTTP/1.1", "GET http://[::1/film HTTP/1.1", "GET * HTTP/1.1"):
        assert status_of(line, own) in (400, 404), line
    assert status_of("POST / HTTP/1.1", own) == 405
    assert status_of("GET /") == 403
    show.send_signal(signal.SIGTERM)
    assert show.communicate(timeout=PATIENCE)[1] == ""
