"""The server of the laboratory: limits, refused requests, and the removal of all processes."""

import asyncio
import os
import resource
import signal
import socket
import sys
from contextlib import AsyncExitStack
from pathlib import Path

import aiohttp
import pytest
from aiohttp import web

import lab as script
from laboratory import film, laboratory
from ricochet import RunError, live
from ricochet import lab as module
from sampling import STATISTICS
from synthetic_run import ROOT, run_script
from whole_runs import PATIENCE, ran, wait_for


def test_no_file_is_read_by_another_door(address):
    """Neither added groups nor values of a scan can name other files."""

    async def visit():
        async with film(address) as one:
            await one.start()
            wish = {"input": "gas", "settings": {}, "added": [], "of": "all/kinetic_energy"}
            group = "species file = '/etc/passwd' /\n&species"
            for added in ([group, "x"], ["species", "x' file = '/etc/passwd"], ["none", "x"]):
                await one.say("start", **wish | {"added": [added]}, pace=1, playing=True)
                problems = (await one.until("problems"))["problems"]
                assert problems[0]["text"].startswith("no group can be called")
            await one.say("scan", **wish, variable="species.gas.File", values=["/etc/passwd"])
            problems = (await one.until("problems", "scan"))["problems"]
            assert "--files FOLDER" in problems[0]["text"]

    asyncio.run(visit())


#: Worker that sends a single message when it starts.
SCENE = """printf 't\\000\\000\\000\\017{"is": "scene"}'; exec cat"""


def test_runs_have_their_number(program, monkeypatch):
    """The server counts connections, so that trivial workers suffice."""
    monkeypatch.setenv("RICOCHET", str(program))
    lab = module.Lab([], [], ["sh", "-c", SCENE])

    async def visit():
        async with (
            live.serving(live.application({"/ws": lab.socket}), 0) as (address, _),
            AsyncExitStack() as open_films,
        ):
            for _ in range(module.RUNS):
                one = await open_films.enter_async_context(film(address))
            with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                await open_films.enter_async_context(film(address))
            assert refused.value.status == 409
            await one.until("scene")
        await lab.close()

    asyncio.run(visit())


def test_a_computer_without_a_browser_gets_the_address_to_open(program, tmp_path, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("BROWSER", "/bin/false")
    with laboratory(program, tmp_path, "--open") as (process, address):
        said = process.stdout.readline()
        assert "No browser" in said and address in said


def test_other_sites_are_refused_before_they_cost_anything(address):
    async def ask(session, path, **headers):
        return (await session.get(address + path, headers=headers)).status

    async def visit():
        host = address[len("http://") : -1]
        async with film(address) as one:
            for headers in (
                {"Host": "evil.example"},
                {"Host": "evil.example:80"},
                {"Origin": "http://evil.example"},
                {"Origin": "null"},
                {"Origin": f"http://localhost:{host.split(':')[1]}"},
                {"Sec-Fetch-Site": "cross-site"},
                {"Sec-Fetch-Site": "same-site"},
            ):
                for path in ("", "form?gas", "view", "ws", "none"):
                    assert await ask(one.session, path, **headers) == 403, (headers, path)
            with pytest.raises(aiohttp.WSServerHandshakeError):  # every browser sends the origin
                await one.session.ws_connect(address + "ws")
            for path in ("none", "pictures/..%2Fgas.nml", "pictures/gas.png"):
                assert await ask(one.session, path) == 404, path
            for path in ("form?none", "form?..%2Fgas"):
                assert await ask(one.session, path) == 409, path
            assert (await one.session.post(address, data=b"x" * 5_000_000)).status in (405, 413)

    asyncio.run(visit())


def test_a_crowd_with_few_files_gets_answers(program, tmp_path):
    """Many connections send a byte or nothing while a run continues."""

    def few():
        resource.setrlimit(resource.RLIMIT_NOFILE, (256, 256))

    async def crowd(address):
        port = int(address.split(":")[2][:-1])
        async with film(address) as one:
            await one.start()
            silent = []
            for _ in range(200):
                silent.append(await asyncio.open_connection("127.0.0.1", port))
                silent[-1][1].write(b"G")
            begun = one.frames
            while one.frames < begun + 30:
                await one.until("frame")
            for _, writer in silent:
                writer.close()
            replies = await asyncio.gather(*(one.session.get(address) for _ in range(90)))
            assert {reply.status for reply in replies} == {200}

    with laboratory(program, tmp_path, preexec_fn=few) as (process, address):
        asyncio.run(crowd(address))
        process.terminate()
        assert process.communicate(timeout=PATIENCE) == ("stopped the server and all runs\n", "")


def children(pid):
    """Return the ids of the child processes of a process."""
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for task in tasks for child in task.read_text().split()]


def alive(pids):
    """Return those processes in a list that are still running."""
    found = []
    for pid in pids:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
        found += [pid] * (state not in "ZX")
    return found


@pytest.mark.parametrize(
    ("at", "signs"),
    [
        ("once", ["TERM"]),
        pytest.param("work", ["INT"], marks=STATISTICS),
        pytest.param("work", ["HUP"], marks=STATISTICS),
        ("work", ["TERM", "HUP", "TERM"]),
        pytest.param("work", ["KILL"], marks=STATISTICS),
        ("placing", ["INT", "INT"]),
        pytest.param("placing", ["KILL"], marks=STATISTICS),
        ("keeping", ["KILL"]),
        pytest.param("keeping", ["HUP", "TERM"], marks=STATISTICS),
    ],
)
def test_nothing_is_left_behind(program, tmp_path, at, signs):
    """All processes end, even while disks are being placed or files are unfinished."""
    hard = {"species.gas.packing_fraction": "0.545", "species.gas.radius": "", "run.seed": "7"}

    async def act(process, address):
        if at == "once":
            return children(process.pid)
        async with film(address) as one:
            await one.start(pace=1.0)
            if at == "placing":
                await one.say("start", input="gas", settings=hard, added=[], pace=1, playing=True)
            keeping = asyncio.create_task(one.kept("output")) if at == "keeping" else None
            while keeping and not (keeping.done() or any(tmp_path.iterdir())):
                await asyncio.sleep(0)
            pids = children(process.pid)
            for sign in signs:
                process.send_signal(getattr(signal, f"SIG{sign}"))
            if keeping:
                await asyncio.wait([keeping])
            return pids

    with laboratory(program, tmp_path) as (process, address):
        pids = asyncio.run(act(process, address))
        for sign in signs if at == "once" else ():
            process.send_signal(getattr(signal, f"SIG{sign}"))
        out, err = process.communicate(timeout=PATIENCE)
        if signs != ["KILL"]:
            assert (process.returncode, out, err) == (0, "stopped the server and all runs\n", "")
        assert at == "once" or len(pids) == 2
        wait_for(lambda: not alive(pids))
        assert list(tmp_path.iterdir()) == []


def test_a_worker_that_dies_is_told_and_the_next_takes_its_place(program, tmp_path):
    """The worker may be working or spare."""

    async def visit(process, address):
        for _ in range(2):
            async with film(address) as one:
                assert (await one.start())["is"] == "scene"
                pids = children(process.pid)
                assert len(pids) == 2
                for pid in pids:
                    os.kill(pid, signal.SIGKILL)
                assert await one.until("closed") == module.DIED.decode()
            while {*pids} & {*children(process.pid)}:  # the laboratory has not yet detected the end
                await asyncio.sleep(0.01)

    with laboratory(program, tmp_path) as (process, address):
        asyncio.run(visit(process, address))
        assert process.poll() is None


def test_wrong_words_are_refused_in_one_line(address, program, monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("RICOCHET", str(program))
    port = address.split(":")[2][:-1]
    for words, reason in (
        (["--port", "99999"], "is not a port"),
        (["inpt/gas.nml"], "inpt/gas.nml: no such file; did you mean input/gas.nml?"),
        ([ROOT / "README.md"], "is not an input file"),
        (
            ["--port", port],
            f"lab.py: port {port}: Address already in use; choose another with --port, or 0 for",
        ),
    ):
        assert run_script("lab", *words) == 2
        assert reason in capsys.readouterr().err


@pytest.mark.parametrize("is_taken", [True, False])
def test_a_laboratory_at_another_than_its_usual_port_names_both(
    program, monkeypatch, capsys, is_taken
):
    monkeypatch.setenv("RICOCHET", str(program))
    with socket.create_server(("127.0.0.1", 0)) as other:
        usual = other.getsockname()[1]
        monkeypatch.setattr(script, "USUAL_PORT", usual)
        if not is_taken:
            other.close()

        async def printed():
            lab = module.Lab([], [], ["cat"])
            task, out = asyncio.create_task(script.open_lab(lab, [usual, 0], visit=False)), ""
            async with asyncio.timeout(PATIENCE):
                while not out:
                    await asyncio.sleep(0.01)
                    out = capsys.readouterr().out
            os.kill(os.getpid(), signal.SIGTERM)
            await task
            return out.splitlines()

        first, *rest = asyncio.run(printed())
    address = first.removesuffix("  (Ctrl-C ends)")
    assert (address == f"http://127.0.0.1:{usual}/") != is_taken
    assert len(rest) == is_taken
    for line in rest:
        assert line.startswith(f"Port {usual} is in use") and line.endswith(address)


def test_a_port_that_is_taken_is_replaced_by_the_next_of_the_list():
    async def chosen(*ports):
        runner = web.AppRunner(web.Application())
        await runner.setup()
        try:
            await live.listen(runner, ports)
            return runner.addresses[0][1]
        finally:
            await runner.cleanup()

    with socket.create_server(("127.0.0.1", 0)) as other:
        taken = other.getsockname()[1]
        assert asyncio.run(chosen(taken, 0)) not in (0, taken)
        with pytest.raises(RunError, match=f"port {taken}: Address already in use"):
            asyncio.run(chosen(taken))


def test_a_laboratory_without_the_library_does_not_start(program, tmp_path, monkeypatch):
    """The page would wait for ever for a run that cannot start."""
    monkeypatch.setenv("RICOCHET", str(program))
    monkeypatch.setenv("RICOCHET_LIBRARY", str(tmp_path))
    done = ran(sys.executable, ROOT / "post/lab.py")
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr == f"lab.py: no libricochet.so in {tmp_path}: run make library in a clone\n"
