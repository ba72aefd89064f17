"""Run the program with thousands of damaged input files, and check its reactions.

    python tests/runs/fuzz_input.py --count 10000 --program build/ricochet

For every input file, --check must end within seconds with the exit status 0 or 2 and without a
backtrace. If a file is refused, all messages must name it. If it is accepted, the output of
--print-input must not change when it is written to a new input file and read again.
"""

import argparse
import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path += [str(ROOT / "tests"), str(ROOT / "post")]
from ricochet.running.program import namelist  # noqa: E402
from whole_runs import PATIENCE, within  # noqa: E402

MOST_SECONDS = int(os.environ.get("MOST_SECONDS", "5"))  # of processor time

SEEDS = [
    """! a comment with a / and an ' in it
&run title = 'two ''disks''' seed = 12345, dynamics = "events" /
&box lower = -1, -1 upper = 2*1.5 boundary = 'wall', 'periodic' gravity(2) = -9.81 /
&species
  name = 'heavy'   position = -0.5, 0.0, 0.5, 0.25   radius = 0.1  mass = 1e6
/
&species
  name = 'light' relative_to = 'heavy'
  mass = 1d-6   radius = .5
  position = -0.5, 0.8
  velocity = 1, 0   ! one pair
/
&contact restitution = 0.5 wall_rule = 'normal' contact_time = 1.0E-5
  pair_restitution = 1, 0.5,
                     0.5, 1 /
&stop time = 1.5 collisions = 20 /
&output precision = 'single' event_log = .true. frames_every_time = 0.25 /
""",
    *(path.read_text() for path in sorted((ROOT / "input").glob("*.nml"))),
]

NUMBERS = re.findall(
    r"\S+",
    """0 -0 1 -1 2 0.5 1e-3 1d2 .5 5. +5 2147483648 9223372036854775807
    9223372036854775808 3*2 2*0.1 1e400 1e-400 nan inf -inf 1e-320 1e101 0*1
    99999999999*1 1_8 1e 1.2.3 --5 0x10 1/3 1,2 .true. T f 'text' "a" '' 'unfinished""",
)
TOKENS = re.findall(
    r"\S+",
    """& / , = ! ' " ( ) (1) (2) (0) * 3* &end $ ; # // x % : ? == &run &box &species &stop
    &obstacle seed= radius= mass= upper(1)= position(2)= name= restitution=0.5 count=3 'x' é “""",
)
TOKENS += ["(\n", "\n", "\r\n", "\r", "\t", "\x00", "\x1b", "\xa0", "\u2212", "\ufeff"]


def mutate(rng: random.Random, text: str) -> bytes:
    """Return a copy of the text with one to four random changes."""
    data = text.encode()
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        data = rng.choice(INJURIES)(rng, data)
    return data


def flip_byte(rng: random.Random, data: bytes) -> bytes:
    place = rng.randrange(len(data) + 1)
    return data[:place] + bytes([rng.randrange(256)]) + data[place + 1 :]


def drop_bytes(rng: random.Random, data: bytes) -> bytes:
    place = rng.randrange(len(data) + 1)
    return data[:place] + data[place + rng.randrange(1, 12) :]


def insert_token(rng: random.Random, data: bytes) -> bytes:
    place = rng.randrange(len(data) + 1)
    return data[:place] + rng.choice(TOKENS + NUMBERS).encode() + data[place:]


def change_number(rng: random.Random, data: bytes) -> bytes:
    numbers = list(re.finditer(rb"(?<== )[-+.\d][-+.\dedED]*", data))
    if not numbers:
        return data
    found = rng.choice(numbers)
    return data[: found.start()] + rng.choice(NUMBERS).encode() + data[found.end() :]


def shuffle_lines(rng: random.Random, data: bytes) -> bytes:
    lines = data.splitlines(keepends=True) or [b""]
    place = rng.randrange(len(lines))
    line = lines.pop(place)
    if rng.random() < 0.5:
        lines.insert(place, line)
    lines.insert(rng.randrange(len(lines) + 1), line)
    return b"".join(lines)


def truncate(rng: random.Random, data: bytes) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def change_layout(rng: random.Random, data: bytes) -> bytes:
    change = rng.choice(
        [
            lambda d: d.replace(b"\n", b"\r\n"),
            lambda d: d.replace(b"\n", b"\r"),
            lambda d: b"\xef\xbb\xbf" + d,
            lambda d: d.replace(b", ", b" "),
            lambda d: d.replace(b" ", b"\t"),
            lambda d: d.upper(),
            lambda d: d.rstrip(),
            lambda d: d.decode("latin-1").encode("utf-16"),
        ]
    )
    return change(data)


def insert_space(rng: random.Random, data: bytes) -> bytes:
    places = [found.start() for found in re.finditer(rb"[ \n=,/]", data)] or [0]
    place = rng.choice(places)
    return data[:place] + rng.choice([b" ", b"\n\t", b" ! / & ' = 1\n", b" !\n\n "]) + data[place:]


def change_digit(rng: random.Random, data: bytes) -> bytes:
    places = [found.start() for found in re.finditer(rb"\d", data)] or [0]
    place = rng.choice(places)
    return data[:place] + b"%d" % rng.randrange(10) + data[place + 1 :]


INJURIES = [flip_byte, drop_bytes, insert_token, insert_token, change_number, change_number]
INJURIES += [shuffle_lines, truncate, change_layout, insert_space, insert_space, change_digit]


def judge(program: str, data: bytes, path: Path) -> tuple[str, str]:
    """Return 'accepted', 'refused' or the kind of fault, with details."""
    path.write_bytes(data)
    run = asked(program, path, "--check")
    errors = run.stderr.decode("utf-8", "replace").rstrip("\n")
    if run.returncode == -signal.SIGKILL:
        return "hang", ""
    if run.returncode not in (0, 2) or re.search(r"backtrace|SIG[A-Z]+|libgfortran", errors):
        return "crash", f"status {run.returncode}\n{errors}"
    if run.returncode == 0:
        once = printed(program, path)
        text = "".join(namelist({group: values}) for group, values in once)
        path.write_bytes(text.encode("utf-8", "surrogateescape"))
        twice = printed(program, path)
        return ("accepted", "") if once == twice else ("misread", f"{once}, then {twice}")
    lines = [line for line in errors.split("\n") if not line.startswith("placing disks")]
    if not all(line.startswith(f"{path}:") for line in lines):
        return "unclear message", errors
    return "refused", errors


def asked(program: str, path: Path, option: str) -> subprocess.CompletedProcess:
    command = [*within(MOST_SECONDS), program, path, option]
    return subprocess.run(command, check=False, capture_output=True, timeout=PATIENCE)


def printed(program: str, path: Path) -> list[tuple[str, dict]]:
    """Return the groups of an input file and their values, as the program prints them."""
    told = asked(program, path, "--print-input").stdout.decode("utf-8", "surrogateescape")
    return [(group["group"], group["values"]) for group in json.loads(told or "[]")]


def cases(count: int, seed: int):
    """Yield damaged input files, every tenth of them random bytes."""
    for number in range(count):
        rng = random.Random(f"{seed} {number}")
        if number % 10 == 9:
            yield rng.randbytes(rng.randrange(2000))
        else:
            yield mutate(rng, rng.choice(SEEDS))


def fuzz(program: str, count: int, seed: int) -> Counter:
    """Return how often each verdict occurred, and print faulty files to stderr."""
    verdicts: Counter = Counter()
    files = list(cases(count, seed))
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        paths = [Path(folder) / f"{number}.nml" for number in range(count)]
        for data, (verdict, details) in zip(
            files, pool.map(judge, [program] * count, files, paths), strict=True
        ):
            verdicts[verdict] += 1
            if verdict not in ("accepted", "refused"):
                print(f"--- {verdict}: {details}\n{data!r}", file=sys.stderr)
    return verdicts


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=10_000, help="number of cases (%(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the cases (%(default)s)")
    parser.add_argument("--program", default=ROOT / "build/ricochet", help="default %(default)s")
    options = parser.parse_args()
    found = fuzz(str(Path(options.program).resolve()), options.count, options.seed)
    print(", ".join(f"{number} {verdict}" for verdict, number in sorted(found.items())))
    sys.exit(not set(found) <= {"accepted", "refused"})
