"""The laboratory as a process, and a client that uses it like a page in a browser."""

import asyncio
import base64
import json
import os
import re
import subprocess
import sys
from contextlib import asynccontextmanager, contextmanager, suppress

import aiohttp

from synthetic_run import ROOT
from whole_runs import PATIENCE, with_parent

HEAD = 7  # numbers before the positions


@contextmanager
def laboratory(program, folder, *words, **options):
    """Start a laboratory with a folder for temporary files; yield its process and address.

    Without the option --port it chooses a free port.
    """
    own = os.environ | {"RICOCHET": str(program), "TMPDIR": str(folder)}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    command = with_parent(sys.executable, ROOT / "post/lab.py", "--port", "0", *words)
    process = subprocess.Popen(command, cwd=folder, env=own, **pipes, **options)
    try:
        line = process.stdout.readline()
        yield process, re.fullmatch(r"(http://127\.0\.0\.1:\d+/)  \(Ctrl-C ends\)\n", line)[1]
    finally:
        process.kill()
        process.communicate()


class Film:
    """Client with one run that uses its socket like a page in a browser."""

    def __init__(self, session, socket, address):
        """Store the open connection."""
        self.session, self.socket, self.address = session, socket, address
        self.frames, self.last = 0, {}

    async def say(self, do, **more):
        with suppress(ConnectionError):  # earlier answers can still be read
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
