"""Runs random systems in several ways, and compares every byte of what they write.

    python tests/runs/fuzz_systems.py --count 200 --seed 5

Each system runs plainly; then on several threads, with another search and queue, in parts that are
stopped by a signal and resumed, each part in another way, and to an earlier end, from which it is
continued. All must end alike: with the same exit code, the same message and the same bytes; and
what the energy has changed by must be what the observables say was lost and given. A system that is
refused, or is too long for the plain run, says nothing.
"""

import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import fuzzing
import h5py

sys.path[:0] = [str(fuzzing.ROOT / "tests"), str(fuzzing.ROOT / "tests" / "support")]

from random_systems import System, random_system  # noqa: E402
from whole_runs import FINISHED, PATIENCE, STOPPED, USAGE, differences, imbalance, within  # noqa: E402

HARMLESS = {"same", "refused", "too long", "nothing to compare"}
SECONDS_PLAIN, SECONDS = 10, 200  # of processor time; the second only something endless takes
MOST_PARTS = 12
BYTES = 4_000_000_000
LATEST = 1e100  # that an input can name
BALANCE = 1e-12  # of the energy, what was lost, and what was given
UNREAD = "stopped; the run is finished"  # a signal may come when all is done
#: What does not belong to the results: what says how they were computed.
ASIDE = re.compile(r"^/(parameters(/run@(search|queue)|/overrides)$|checkpoint/input)")


class Runs:
    """One system in a folder of its own."""

    def __init__(self, program: str, folder: Path, system: System):
        """Writes the input."""
        self.program, self.folder = program, folder
        folder.mkdir()
        (folder / "start.txt").write_text(system.start + "\n")
        (folder / "case.nml").write_text(system.text)

    def begin(self, name: str, seconds: int, *options: str) -> subprocess.Popen:
        """Starts a run that may use so much processor time."""
        command = [
            *within(seconds),
            f"--as={BYTES}",
            self.program,
            "case.nml",
            "-o",
            f"{name}.h5",
            "--quiet",
            *options,
        ]
        return subprocess.Popen(
            command, cwd=self.folder, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True
        )

    def whole(self, name: str, seconds: int, *options: str) -> tuple[int, str]:
        """Exit code and last message of a run."""
        return ended(self.begin(name, seconds, *options))

    def result(self, name: str) -> Path:
        """What a run left: its finished file, or that of one that broke off."""
        path = self.folder / f"{name}.h5"
        return path if path.exists() else Path(f"{path}.part")

    def in_parts(self, rng: random.Random, plain_seconds: float, way) -> tuple[int, str]:
        """Stops a run at random moments and resumes it."""
        code, message = STOPPED, ""
        for part in range(MOST_PARTS):
            resume = ["--resume"] if (self.folder / "parts.h5.part").exists() else []
            process = self.begin("parts", SECONDS, *way(rng), *resume)
            if part < MOST_PARTS - 1:
                time.sleep(rng.uniform(0, 1.2) * plain_seconds)
                process.send_signal(signal.SIGTERM)
            code, message = ended(process)
            if code not in (STOPPED, -signal.SIGTERM):
                break
        return code, message

    def continued(self, rng: random.Random, way) -> tuple[int, str]:
        """Lets a run end early, and continues it."""
        with h5py.File(self.result("plain")) as file:
            end = float(file["particles/disks/position/time"][-1])
        if end == 0:
            return self.whole("continued", SECONDS, *way(rng))
        code, message = self.whole(
            "continued",
            SECONDS,
            *way(rng),
            f"--set=stop.time={min(rng.uniform(0, 0.99) * end, LATEST)!r}",
        )
        if code == FINISHED:
            return self.whole("continued", SECONDS, *way(rng), "--resume")
        return code, message


def ended(process: subprocess.Popen) -> tuple[int, str]:
    """Exit code and last line of a process; `endless` if it has used its processor time."""
    try:
        lines = process.communicate(timeout=PATIENCE)[1].splitlines()
    except subprocess.TimeoutExpired:
        process.kill()
        lines = process.communicate()[1].splitlines()
    if process.returncode == -signal.SIGKILL:
        return process.returncode, "endless"
    lines = [line for line in lines if not line.startswith(("warning:", "note:", UNREAD))]
    return process.returncode, lines[-1] if lines else ""


def ways(system: System):
    """Random options that must not change a bit."""
    searches = ["cells", "pairs"] if system.disks <= 300 else ["cells"]
    if system.disks <= 40:
        searches.append("rescan")

    def way(rng: random.Random) -> list[str]:
        if "'steps'" in system.text:
            return [f"--set=run.search={rng.choice(searches)}"]
        return [
            f"--set=run.threads={rng.choice([1, 2, 2, 3, 4, 6, 8])}",
            f"--set=run.search={rng.choice(['cells', 'cells', *searches])}",
            f"--set=run.queue={rng.choice(['calendar', 'heap'])}",
        ]

    return way


def judge(program: str, folder: Path, seed: str) -> tuple[str, str]:
    """('same' or another harmless word or the fault, details)."""
    rng = random.Random(seed)
    system = random_system(rng)
    runs = Runs(program, folder, system)
    way = ways(system)
    began = time.monotonic()
    plain = runs.whole("plain", SECONDS_PLAIN, "--set=run.threads=1")
    seconds = time.monotonic() - began
    if plain[0] == USAGE:
        return "refused", ""
    if plain[1] == "endless":
        return "too long", ""
    if plain[0] not in (FINISHED, 4):
        return "failed", f"{system.text}{plain}"
    others = {}
    for name in "one", "two":
        options = way(rng)
        others[name] = options, runs.whole(name, SECONDS, *options)
    others["parts"] = [], runs.in_parts(rng, seconds, way)
    if plain[0] == FINISHED:
        others["continued"] = [], runs.continued(rng, way)
    for name, (options, end) in others.items():
        if (end[0], end[1].replace(f"{name}.h5", "plain.h5")) != plain:
            return (
                "ends otherwise",
                f"{' '.join(options)}: {name} {end}, plain {plain}\n{system.text}",
            )
        if not runs.result("plain").exists():
            continue
        found = [
            x for x in differences(runs.result("plain"), runs.result(name)) if not ASIDE.match(x)
        ]
        if found:
            return "differs", f"{name} {' '.join(options)}: {len(found)} {found[:6]}\n{system.text}"
    if "'steps'" not in system.text and runs.result("plain").exists():
        part = imbalance(runs.result("plain"))
        if not part < BALANCE:
            return "out of balance", f"by {part:g}\n{system.text}"
    return "same", ""


def fuzz(program: str, count: int, seed: int) -> Counter:
    """Verdicts by kind; systems with a fault are shown on stderr."""
    with tempfile.TemporaryDirectory() as folder:

        def verdict(case):
            place = Path(folder) / case.replace(" ", "_")
            try:
                return judge(program, place, case)
            finally:
                subprocess.run(["rm", "-rf", place], check=True)

        return fuzzing.tally(verdict, [f"{seed} {k}" for k in range(count)], HARMLESS)


if __name__ == "__main__":
    sys.exit(fuzzing.run(__doc__, fuzz, HARMLESS, count=200))
