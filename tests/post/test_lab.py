"""The laboratory: simulations behind the pages of a browser, and their complete removal."""

import asyncio
import base64
import json
import os
import random
import re
import resource
import signal
import subprocess
import sys
import time
from contextlib import AsyncExitStack, asynccontextmanager, contextmanager, suppress
from pathlib import Path

import aiohttp
import numpy as np
import pytest

from ricochet import Simulation, lab as module
from ricochet.pages.numbers import (
    means,
    observed,
    pressure_between,
    sample_of,
    sampled,
    snapshot_run,
)
from ricochet.pages.worker import FRAMES_AHEAD
from synthetic_run import ROOT, run_script
from whole_runs import PATIENCE, wait_for

INPUTS = sorted(json.loads((ROOT / "input/chooser.json").read_text()))
HEAD = 6  # numbers before the positions


@contextmanager
def laboratory(program, folder, *words, **options):
    """Start a laboratory with a folder for temporary files; yield its process and address."""
    own = os.environ | {"RICOCHET": str(program), "TMPDIR": str(folder)}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    command = [sys.executable, ROOT / "post/lab.py", *words]
    process = subprocess.Popen(command, cwd=folder, env=own, **pipes, **options)
    try:
        line = process.stdout.readline()
        yield process, re.fullmatch(r"(http://127\.0\.0\.1:\d+/)  \(Ctrl-C ends\)\n", line)[1]
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def address(program, tmp_path_factory):
    """Return the address of a laboratory for tests that do not change it."""
    with laboratory(program, tmp_path_factory.mktemp("lab")) as (process, address):
        yield address
        assert process.poll() is None


class Film:
    """A client with one run that uses its socket as the page of a browser does."""

    def __init__(self, session, socket, address):
        """Take what is open."""
        self.session, self.socket, self.address = session, socket, address
        self.frames, self.last = 0, {}

    async def say(self, do, **more):
        with suppress(ConnectionError):  # earlier answers are still read
            await self.socket.send_json({"do": do, **more})

    async def start(self, name="gas", settings=None, added=(), pace=0.1):
        """Start a run, and wait for its first frame, or for what is wrong."""
        wish = {"input": name, "settings": settings or {}, "added": list(added)}
        await self.say("start", **wish, pace=pace, playing=True)
        return await self.until("scene", "problems")

    async def next(self):
        """The next message: its kind and its content."""
        async with asyncio.timeout(PATIENCE):
            message = await self.socket.receive()
        if message.type == aiohttp.WSMsgType.BINARY:
            self.frames += 1
            await self.say("got")
            self.last["frame"] = message.data
            return "frame", message.data
        if message.type != aiohttp.WSMsgType.TEXT:
            return "closed", message.extra
        news = json.loads(message.data)
        self.last[news["is"]] = news
        return news["is"], news

    async def until(self, *kinds):
        """Wait for one of these kinds."""
        while True:
            kind, news = await self.next()
            assert kind != "closed" or "closed" in kinds, self.last
            if kind in kinds:
                return news

    async def kept(self, part):
        """The download, or the answer if there is none."""
        await self.say("keep", part=part)
        news = await self.until("file", "problems")
        return base64.b64decode(news["body"]) if news["is"] == "file" else news


@asynccontextmanager
async def film(address):
    """A page that is open."""
    async with aiohttp.ClientSession() as session:
        own = {"headers": {"Origin": address.rstrip("/")}, "max_msg_size": 0}
        async with session.ws_connect(f"{address}ws", **own) as socket:
            yield Film(session, socket, address)


def place(frame):
    """Return the positions (2, N) of a frame."""
    count = (len(frame) - 8 * HEAD) // 16
    return np.frombuffer(frame, np.float32, 2 * count, 8 * HEAD).reshape(-1, 2)


# --- runs ---


@pytest.mark.parametrize("name", INPUTS)
def test_what_was_done_is_done_again_by_the_script_to_the_last_bit(address, tmp_path, name):
    """Each input is run with changes at random times, including heating and cooling."""
    rng = random.Random(name)

    async def visit():
        async with film(address) as one:
            form = await (await one.session.get(f"{address}form?{name}")).json()
            assert form["about"] and any(group["kind"] == "species" for group in form["groups"])
            scene = await one.start(name, pace=rng.uniform(0.01, 1))
            assert scene["is"] == "scene", scene
            for _ in range(3):
                for _ in range(rng.randint(1, 5)):
                    await one.until("frame")
                if rng.random() < 0.5:
                    await one.say("heat", factor=rng.uniform(0.5, 2))
                else:
                    xi = f"{rng.uniform(500, 1000):.3f}d-3"
                    settings = {"contact.restitution": xi, "box.gravity": "2*-0.1"}
                    wish = dict([rng.choice([*settings.items()])])
                    await one.say("change", settings=wish)
                await one.until("state", "problems")
            await one.say("pause")
            while (await one.until("state"))["playing"]:
                pass
            return (await one.kept("script")).decode(), await one.kept("output")

    text, output = asyncio.run(visit())
    part = tmp_path / "a.h5.part"
    part.write_bytes(output)
    space = {}
    exec(text.replace("    print(", "    state = simulation.time, simulation.velocity  # ("), space)
    time, velocity = space["state"]
    with Simulation.load(part) as there:
        assert there.time == time and np.array_equal(there.velocity, velocity)


def test_frames_come_at_the_pace_and_changes_act_at_once(address):
    async def visit():
        async with film(address) as one:
            await one.start(pace=0.0)
            await one.until("frame")
            await one.say("pace", pace=0.5)
            began, first = time.monotonic(), np.frombuffer(one.last["frame"], float, 1)[0]
            while one.frames < 40:
                await one.until("frame")
            now = np.frombuffer(one.last["frame"], float, 1)[0]
            assert 0 < now - first <= 0.5 * (time.monotonic() - began) + 0.05
            await one.say("change", settings={"box.gravity": "0,-3"})
            scene = await one.until("scene", "problems")
            assert scene["changed"] and scene["facts"]["gravity"] == [0, -3]
            assert not scene["facts"]["settles"]
            assert [change[1:] for change in (await one.until("state"))["changes"]] == [
                ["box.gravity", "0,-3"]
            ]
            before = place(one.last["frame"])
            await one.say("step", time=0.01)
            after = place(await one.until("frame"))
            assert 0 < np.abs(after - before).max() < 0.2

    asyncio.run(visit())


def test_a_page_that_draws_slowly_lets_nothing_pile_up(address):
    async def visit():
        async with film(address) as one:
            await one.start(pace=1)
            frames = 0
            with suppress(TimeoutError):
                async with asyncio.timeout(None) as limit:
                    while frames <= FRAMES_AHEAD:
                        message = await one.socket.receive()
                        frames += message.type == aiohttp.WSMsgType.BINARY
                        if frames == FRAMES_AHEAD:
                            limit.reschedule(asyncio.get_running_loop().time() + 2)
            assert frames == FRAMES_AHEAD
            await one.say("got")
            await one.until("frame")

    asyncio.run(visit())


def test_few_disks_tell_what_comes_and_one_event_is_a_step(address):
    async def visit():
        async with film(address) as one:
            await one.start("scattering", pace=0.0)
            coming = (await one.until("events"))["next"]
            assert len(coming) >= 1
            await one.say("event")
            happened = (await one.until("events"))["happened"]
            assert happened == coming[0]
            assert np.frombuffer(one.last["frame"], float, 1)[0] == pytest.approx(coming[0][0])

    asyncio.run(visit())


@pytest.mark.parametrize(
    ("settings", "place", "words"),
    [
        ({"species.gas.radius": "0.1"}, "species.gas.radius", "closest packing"),
        ({"contact.restitution": "2"}, "contact.restitution", "from 0 to 1"),
        ({"species.gas.count": "30001", "species.gas.radius": "1e-5"}, "", "20000"),
        ({"species.gas.file": "/etc/passwd"}, "", "--files FOLDER"),
        ({"species.gas.FILE": "/etc/passwd"}, "", "--files FOLDER"),
        ({"species.gas.file": " '/etc/passwd'"}, "", "--files FOLDER"),
        ({"species.gas.file=/etc/passwd#": ""}, "", "no variable"),
        ({"run.title": "two\nlines"}, "", "no variable"),
    ],
)
def test_a_wrong_value_gets_one_line_and_the_run_goes_on(address, settings, place, words):
    async def visit():
        async with film(address) as one:
            await one.start()
            news = await one.start(settings=settings)
            assert [problem["place"] for problem in news["problems"]] == [place]
            assert words in news["problems"][0]["text"] and "root:" not in str(news)
            for wrong in (
                "[",
                "3",
                '{"do": "end"}',
                '{"do": "pace", "pace": []}',
                '{"do": "start"}',
                '{"do": "step", "time": -1}',
                '{"do": "heat", "factor": NaN}',
                '{"do": "change", "settings": {"species.gas.file": "/etc/passwd"}}',
            ):
                await one.socket.send_str(wrong)
            while "not understood" not in (await one.until("state"))["reason"]:
                pass
            await one.until("frame")
            await one.say("change", settings={"species.gas.count": "3"})
            assert (await one.until("problems"))["change"] is True
            await one.until("frame")

    asyncio.run(visit())


def test_an_added_group_is_run_and_in_what_is_kept(address):
    async def visit():
        async with film(address) as one:
            obstacle = {"obstacle.post.centre": "0.5,0.5", "obstacle.post.radius": "0.1"}
            scene = await one.start(settings=obstacle, added=[["obstacle", "post"]])
            assert scene["facts"]["obstacles"] == [[0.5, 0.5, 0.1, False]]
            text = await one.kept("input")
            assert b"&obstacle" in text and b"post" in text
            with Simulation(text.decode()) as again:
                assert again.n_disks == 1000

    asyncio.run(visit())


def test_a_side_that_disks_push_is_where_the_engine_has_it(address):
    async def visit():
        async with film(address) as one:
            names = {"motion": "'piston'", "mass": "5", "force": "0.1"}
            free = {f"side.right.{name}": value for name, value in names.items()}
            await one.start(settings=free, added=[["side", "right"]], pace=1)
            places = []
            while len(places) < 20 or places[-1] < 1.5:
                places.append(np.frombuffer(await one.until("frame"), float, HEAD)[3])
                assert places[-1] <= one.last["scene"]["facts"]["edges"][0], "it stays in sight"
            assert places[0] == 1 and places[-1] > places[5] > 1

    asyncio.run(visit())


def test_the_pressure_beside_a_moving_side_is_that_of_the_area_of_each_moment():
    """Therefore the pressure of the whole time is the mean of the pressures of its parts."""
    samples, count = [], 200
    with Simulation(ROOT / "input/constant_pressure.nml") as run:
        for time in np.linspace(5, 20, 301):
            run.advance(time=time)
            seen = {name: float(np.sum(part)) for name, part in run._observed().items()}
            samples.append(sampled(count, seen | {"time": run.time}))
    parts = [np.array(samples[k : k + 101]).T for k in (0, 100, 200)]
    means = [pressure_between(part, count).mean for part in parts]
    assert pressure_between(np.array(samples).T, count).mean == pytest.approx(np.mean(means))


THEORIES = {  # systems in equilibrium, and the number of their theoretical values
    "a gas between walls": ("&species count = 200 radius = 0.01 speed = 1 /", 4),
    "a mixture between walls": (
        "&species name = 'a' count = 100 radius = 0.006 speed = 1 /\n"
        "&species name = 'b' count = 100 radius = 0.012 mass = 4 speed = 1 /",
        5,
    ),
    "one pair of walls": (
        "&box boundary = 'wall', 'periodic' /\n&species count = 200 radius = 0.015 speed = 1 /",
        4,
    ),
    "a flow in a periodic box": (
        "&box boundary = 2*'periodic' /\n"
        "&species name = 'a' count = 150 radius = 0.01 velocity = 3, 0 /\n"
        "&species name = 'b' count = 50 radius = 0.01 velocity = -1, 1 /",
        5,
    ),
    "thermal walls": (
        "&side name = 'left' temperature = 2 /\n&species count = 200 radius = 0.01 speed = 1 /",
        4,
    ),
    "a flow that thermal walls stop": (
        "&box boundary = 'periodic', 'wall' /\n&side name = 'top' temperature = 1 /\n"
        "&side name = 'bottom' temperature = 1 /\n"
        "&species name = 'a' count = 150 radius = 0.01 velocity = 3, 1 /\n"
        "&species name = 'b' count = 50 radius = 0.01 velocity = 1, -1 /",
        5,
    ),
    "perfectly rough disks": (
        "&contact tangential_restitution = 1 /\n&species count = 200 radius = 0.01 speed = 1 /",
        4,
    ),
    "gravity": ("&box gravity = 0, -1 /\n&species count = 200 radius = 0.01 speed = 1 /", 1),
    "grains": ("&contact restitution = 0.9 /\n&species count = 200 radius = 0.01 speed = 1 /", 0),
}


@pytest.mark.parametrize("case", THEORIES)
def test_theory_is_what_is_measured_in_equilibrium(case):
    """Theoretical values are absent where no theory applies."""
    text, known = THEORIES[case]
    samples = []
    with Simulation(text) as simulation:
        run = snapshot_run(simulation)
        simulation.advance(collisions=30 * simulation.n_disks)
        for _ in range(400):
            simulation.advance_by(collisions=simulation.n_disks)
            value = observed(simulation)
            samples.append(sample_of(run, value))
        energy = value["all/kinetic_energy"] + value.get("all/rotational_energy", 0)
        found = means(run, samples, energy * simulation.n_disks)
    assert sum(one["theory"] is not None for one in found) == known
    assert all((one["value"] is None) == (case == "grains") for one in found[:-1])
    for one in found[:-1]:
        if one["theory"] is not None:
            allowed = 5 * one["error"] + 0.005 * one["value"]
            assert one["theory"] == pytest.approx(one["value"], abs=allowed), one


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


def test_of_many_starts_at_once_the_last_counts_and_a_step_without_end_can_be_left(address):
    async def visit():
        async with film(address) as one:
            await one.start()
            wish = {"input": "gas", "added": [], "pace": 0.1, "playing": True}
            for speed in range(1, 200):
                await one.say("start", settings={"species.gas.speed": str(speed)}, **wish)
            scenes = 0
            while one.last["scene"]["facts"]["top"] < 2.1 * 199:
                await one.until("scene")
                scenes += 1
            assert scenes < 100
            await one.say("step", time=1e9)
            await one.say("change", settings={"box.gravity": "0,-1"})
            await one.until("scene")
            await one.say("pause")
            while (await one.until("state"))["playing"]:
                pass

    asyncio.run(visit())


def test_a_run_can_be_kept_after_a_wrong_wish_and_without_a_folder(program, tmp_path):
    async def visit(address):
        async with film(address) as one:
            await one.start()
            await one.start(settings={"species.gas.radius": "1"})
            assert b"HDF" in (await one.kept("output"))[:8]
            await one.start(settings={"species.gas.count": "12"})
            (tmp_path / "temporary").rmdir()
            await one.kept("output")
            assert b"simulation.advance" in await one.kept("script")
            (tmp_path / "own.nml").unlink()
            wish = {"input": "own", "settings": {}, "added": [], "pace": 1, "playing": True}
            await one.say("start", **wish)
            assert "own.nml" in (await one.until("problems"))["problems"][0]["text"]
            assert (await one.session.get(f"{address}form?own")).status == 409
            await one.until("frame")

    (tmp_path / "temporary").mkdir()
    (tmp_path / "own.nml").write_text("&species count = 3 radius = 0.1 /\n")
    with laboratory(program, tmp_path / "temporary", tmp_path / "own.nml") as (process, address):
        asyncio.run(visit(address))
        assert process.poll() is None


SCANS = {  # for a gas: changes, measured quantity, values, and expected proportionality
    "gas, the energy of each disk": ({}, "all/kinetic_energy", ("1", "2"), (1, 4)),
    "gas, collisions per time": ({}, "collisions", ("1", "2"), (1, 2)),
    "gas, pressure": ({}, "virial_pressure", ("1", "2"), (1, 4)),
    "a gas that collapses": ({"contact.restitution": "0"}, "virial_pressure", ("1", "2"), ()),
    "a gas that cools, energy per time": (
        {"contact.restitution": "0.9"},
        "dissipated_energy",
        ("1", "2"),
        (1, 8),
    ),
}


@pytest.mark.parametrize("case", SCANS)
def test_a_scan_gives_means_and_rates_whatever_the_time_it_takes(address, case):
    """All rates of a run are proportional to its speeds."""
    settings, of, values, powers = SCANS[case]

    async def visit():
        async with film(address) as one:
            await one.start()
            wish = {"input": "gas", "settings": settings, "added": [], "of": of}
            await one.say("scan", **wish, variable="species.gas.speed", values=values)
            return [await one.until("scan") for _ in values]

    found = asyncio.run(visit())
    assert [one["index"] for one in found] == [0, 1]
    if not powers:
        assert all("at the same time" in one["problems"][0]["text"] for one in found), found
        return
    means = [one["mean"] / power for one, power in zip(found, powers, strict=True)]
    assert means[0] == pytest.approx(means[1], rel=1e-6) and means[0] > 0
    assert (found[0]["error"] is None) == bool(settings)


def test_runs_have_their_number(address):
    async def visit():
        async with AsyncExitStack() as open_films:
            for _ in range(module.RUNS):
                one = await open_films.enter_async_context(film(address))
            with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                await open_films.enter_async_context(film(address))
            assert refused.value.status == 409
            await one.start()

    asyncio.run(visit())


# --- strangers ---


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
    """Many connections send one byte or nothing while a run continues."""

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


# --- the command ---


def children(pid):
    """Return the numbers of the child processes of a process."""
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for task in tasks for child in task.read_text().split()]


def alive(pids):
    """Return those of the processes that are alive."""
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
        ("work", ["INT"]),
        ("work", ["HUP"]),
        ("work", ["TERM", "HUP", "TERM"]),
        ("work", ["KILL"]),
        ("placing", ["INT", "INT"]),
        ("placing", ["KILL"]),
        ("keeping", ["KILL"]),
        ("keeping", ["HUP", "TERM"]),
    ],
)
def test_nothing_is_left_behind(program, tmp_path, at, signs):
    """This holds for running simulations, for one that places disks, and for unfinished files."""
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
        ([tmp_path / "none.nml"], "is not an input file"),
        ([ROOT / "README.md"], "is not an input file"),
        (["--port", port], f"lab.py: port {port}: Address already in use\n"),
    ):
        assert run_script("lab", *words) == 2
        assert reason in capsys.readouterr().err
