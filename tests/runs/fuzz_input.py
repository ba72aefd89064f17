"""Feeds the program thousands of damaged input files and judges what it makes of them.

Whatever the file, --check must end within seconds with status 0 or 2, without a backtrace. Refused,
the lines name the file; accepted, --print-input says what an independent reading of the file
(below, by another method) gives.

    python tests/runs/fuzz_input.py --count 10000 --program build/ricochet
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
sys.path.append(str(ROOT / "tests"))
from whole_runs import PATIENCE, within  # noqa: E402

MOST_SECONDS = 5  # of processor time

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
    """&obstacle
  name = 'pin'
  centre = 0.5, 0.5
  radius = 0.2
/
&species grid = 3, 3  radius = 0.02  speed = 2.5  velocities = 'uniform'
  region = 0.05, 0.25, 0.05, 0.95 /
&stop events = 10  energy_fraction = 0.1 /
""",
    """&species count = 5 radius = 0.05 temperature = 2 /
&stop collisions_per_disk = 3 wall_clock = 60 /
&run search = 'pairs' queue = 'heap' /
""",
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
    """A copy of the text with one to four injuries."""
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


class Malformed(Exception):
    """The independent reading finds no valid namelist."""


WORD = re.compile(
    r"""(?P<space>(?:[ \t\n]|![^\n]*)+)|(?P<text>'(?:[^'\n]|'')*'|"(?:[^"\n]|"")*")"""
    r"""|(?P<word>[\w.+\-*]+)|(?P<mark>[&/,=()])""",
    re.ASCII,
)


def tokens_of(data: bytes) -> list[tuple[str, str]]:
    """(kind, text) of each word, text, mark; blanks only where they stand after `&`."""
    text = data.decode("utf-8", "surrogateescape").removeprefix("\ufeff")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    tokens, place = [], 0
    while place < len(text):
        found = WORD.match(text, place)
        if not found:
            raise Malformed(f"unexpected {text[place:][:10]!r}")
        if found.lastgroup != "space":
            tokens.append((found.lastgroup, found[0]))
        place = found.end()
    return [*tokens, ("end", "")]


def read_namelist(data: bytes) -> list[tuple[str, dict]]:
    """(group, {variable or (variable, element): [value, ...]}) in the order of the file."""
    tokens = tokens_of(data)
    groups: list[tuple[str, dict]] = []
    at = 0

    def take(kind: str, text: str | None = None) -> str:
        nonlocal at
        if tokens[at][0] != kind or text not in (None, tokens[at][1]):
            raise Malformed(f"{tokens[at]} instead of {text or kind}")
        at += 1
        return tokens[at - 1][1]

    while tokens[at][0] != "end":
        take("mark", "&")
        group: dict = {}
        groups.append((take("word").lower(), group))
        while tokens[at] != ("mark", "/"):
            name: str | tuple = take("word").lower()
            if tokens[at] == ("mark", "("):
                at += 1
                name = (name, int(take("word")))
                take("mark", ")")
            take("mark", "=")
            if name in group:
                raise Malformed(f"{name} twice")
            group[name] = values = []
            while True:
                kind, text = tokens[at]
                is_name = kind == "word" and tokens[at + 1] in (("mark", "="), ("mark", "("))
                if kind in ("text", "word") and not is_name:
                    values.append(text)
                elif text != ",":
                    break
                at += 1
        at += 1
    return groups


def plain(values: list[str]) -> list:
    """Values as Python has them: repeats spelt out, texts, truths, numbers."""
    spelt: list = []
    repeats = 1
    for value in values:
        count, single = re.fullmatch(r"(?:(\d+)\*)?(.*)", value).groups()
        repeats *= int(count or 1)
        if single:
            spelt += [plain_value(single)] * repeats
            repeats = 1
    return spelt


def plain_value(value: str) -> object:
    if value[0] in "'\"":
        quote = value[0]
        return value[1:-1].replace(quote * 2, quote).rstrip(" ")
    if value.lower() in (".true.", "true", "t", ".t."):
        return True
    if value.lower() in (".false.", "false", "f", ".f."):
        return False
    if re.fullmatch(r"[+-]?\d+", value):
        return int(value)
    return float(value.lower().replace("d", "e"))


def alike(found: object, wanted: object) -> bool:
    """Whether two values are the same; a real may be written as an integer."""
    return found == (float(wanted) if isinstance(found, float) else wanted)


def contradiction(data: bytes, groups: list[dict]) -> str | None:
    """What the independent reading has against the groups of --print-input; None if nothing."""
    try:
        expected = read_namelist(data)
    except (Malformed, ValueError) as reason:
        return f"accepted, but malformed: {reason}"
    if [name for name, _ in expected] != [group["group"] for group in groups]:
        return f"other groups than {[name for name, _ in expected]}"
    for (name, variables), group in zip(expected, groups, strict=True):
        for key, written in variables.items():
            variable, element = key if isinstance(key, tuple) else (key, None)
            found = group["values"].get(variable)
            found = found[element - 1] if element and isinstance(found, list) else found
            found = found if isinstance(found, list) else [found]
            wanted = plain(written)
            if len(found) != len(wanted) or not all(map(alike, found, wanted)):
                return f"{name}.{key} is {wanted}, taken as {found}"
        surplus = group["values"].keys() - {
            key[0] if isinstance(key, tuple) else key for key in variables
        }
        if surplus:
            return f"{name} has {surplus}"
    return None


def judge(program: str, data: bytes, path: Path) -> tuple[str, str]:
    """('accepted' or 'refused' or the fault, details)."""
    path.write_bytes(data)
    runs = [
        subprocess.run(
            [*within(MOST_SECONDS), program, path, option],
            check=False,
            capture_output=True,
            timeout=PATIENCE,
        )
        for option in ("--check", "--print-input")
    ]
    if any(run.returncode == -signal.SIGKILL for run in runs):
        return "hang", ""
    errors = runs[0].stderr.decode("utf-8", "replace").rstrip("\n")
    if runs[0].returncode not in (0, 2) or re.search(r"backtrace|SIG[A-Z]+|libgfortran", errors):
        return "crash", f"status {runs[0].returncode}\n{errors}"
    if runs[0].returncode == 0:
        against = contradiction(data, json.loads(runs[1].stdout.decode("utf-8", "surrogateescape")))
        return ("misread", against) if against else ("accepted", "")
    lines = [line for line in errors.split("\n") if not line.startswith("placing disks")]
    if not all(line.startswith(f"{path}:") for line in lines):
        return "unclear message", errors
    return "refused", errors


def cases(count: int, seed: int):
    """Mutated files; every tenth is random bytes."""
    for number in range(count):
        rng = random.Random(f"{seed} {number}")
        if number % 10 == 9:
            yield rng.randbytes(rng.randrange(2000))
        else:
            yield mutate(rng, rng.choice(SEEDS))


def fuzz(program: str, count: int, seed: int) -> Counter:
    """Verdicts by kind; faulty files are shown on stderr."""
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
