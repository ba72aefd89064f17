"""Runs of the laboratory: frames, changes, messages, and downloads that repeat a run."""

import asyncio
import json
import random
import time
from contextlib import suppress

import aiohttp
import numpy as np
import pytest

from laboratory import HEAD, film, laboratory
from ricochet import Simulation
from ricochet.pages.worker import FRAMES_AHEAD
from sampling import STATISTICS
from synthetic_run import ROOT

INPUTS = sorted(json.loads((ROOT / "input/chooser.json").read_text()))
#: `make test` uses every fourth input, `.ci/run` all of them.
OF_EACH = [pytest.param(one, marks=STATISTICS if k % 4 else ()) for k, one in enumerate(INPUTS)]


def place(frame):
    """Return the positions (2, N) of a frame."""
    count = (len(frame) - 8 * HEAD) // 16
    return np.frombuffer(frame, np.float32, 2 * count, 8 * HEAD).reshape(-1, 2)


@pytest.mark.parametrize("name", OF_EACH)
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
        same = np.array_equal(there.velocity, velocity, equal_nan=True)  # NaN: disks outside
        assert there.time == time and same


def test_one_disk_is_placed_aimed_and_pushed(address, tmp_path):
    """The energy of a pushed disk doubles."""

    async def visit():
        async with film(address) as one:
            await one.start("collision")
            await one.say("pause")
            while (await one.until("state"))["playing"]:
                pass
            found = []
            for wish in (
                {"do": "place", "disk": 1, "position": [0.7, 0.625]},
                {"do": "aim", "disk": 0, "velocity": [0.25, -0.5]},
                {"do": "push", "disk": 1},
            ):
                await one.say(**wish)
                await one.until("scene")
                found.append(place(await one.until("frame")))
            return found, await one.kept("output")

    found, output = asyncio.run(visit())
    for positions in found:
        assert positions[1] == pytest.approx([0.7, 0.625])
    part = tmp_path / "a.h5.part"
    part.write_bytes(output)
    with Simulation.load(part) as there:
        assert there.velocity[0] == pytest.approx([0.25, -0.5])
        assert there.velocity[1] == pytest.approx([-0.2 * np.sqrt(2), 0])


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


#: Refused settings, the variable beside which the message is shown, and words in it.
WRONG = [
    ({"species.gas.radius": "0.1"}, "species.gas.radius", "closest packing"),
    ({"contact.restitution": "2"}, "contact.restitution", "from 0 to 1"),
    ({"species.gas.count": "30001", "species.gas.radius": "1e-5"}, "", "20000"),
    ({"species.gas.file": "/etc/passwd"}, "", "--files FOLDER"),
    ({"species.gas.FILE": "/etc/passwd"}, "", "--files FOLDER"),
    ({"species.gas.file": " '/etc/passwd'"}, "", "--files FOLDER"),
    ({"species.gas.file=/etc/passwd#": ""}, "", "no variable"),
    ({"run.title": "two\nlines"}, "", "no variable"),
]


def test_a_wrong_value_gets_one_line_and_the_run_goes_on(address):
    async def visit():
        async with film(address) as one:
            await one.start()
            for settings, place, words in WRONG:
                news = await one.start(settings=settings)
                assert [problem["place"] for problem in news["problems"]] == [place]
                assert words in news["problems"][0]["text"] and "root:" not in str(news)
                await one.until("frame")
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
