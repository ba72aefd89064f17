"""Valid, invalid and absurd input files, and the command line of the program."""

import itertools
import json
import os
import random
import re
import subprocess
from pathlib import Path

import fuzz_input
import pytest
from ricochet.running.program import namelist
from synthetic_run import ROOT
from whole_runs import FILES, FINISHED, USAGE, ran

INPUTS = sorted((ROOT / "input").glob("*.nml"))
OTHERS = """&obstacle name = 'pin' centre = 0.5, 0.5 radius = 0.1 /
&wall name = 'ramp' from = 0.1, 0.1 to = 0.3, 0.2 /
&side name = 'top' /
"""
GOOD = """&species name = 'gas' count = 20 radius = 0.02 speed = 1 /
&stop time = 0.1 /
"""
#: Invalid inputs with their messages.
ROWS = Path(__file__).with_name("refused.txt").read_text().splitlines()
DISKS, STARTED = (
    "&species count = 10 radius = .01 /",
    "&species name = 'gas' file = 'start.txt' {} /",
)
PLACE = r'f(:\d+)?: (\S+|".*"): |--set '


@pytest.fixture
def checked(ricochet, tmp_path):
    """Return a function that runs --check on a file gas.nml with given contents."""

    def run(content, *options, **more):
        data = content.encode() if isinstance(content, str) else content
        (tmp_path / "gas.nml").write_bytes(data)
        return ricochet("gas.nml", "--check", *options, seconds=5, errors="replace", **more)

    return run


def lines_of(run) -> list[str]:
    """Return the lines on stderr, none of which may be from the Fortran run-time library."""
    assert not re.search(r"backtrace|SIG[A-Z]{3}|libgfortran|Fortran runtime", run.stderr)
    return run.stderr.splitlines()


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.name)
def test_every_input_file_is_valid_and_short_lined(ricochet, path):
    """Only `reference.nml` has a warning, because disks are at rest by default."""
    run = ricochet(path, "--check")
    assert run.returncode == 0
    if path.name == "reference.nml":
        assert re.fullmatch("warning: no events are possible: no disk moves.*\n", run.stderr)
    else:
        assert run.stderr == ""
    text = path.read_text()
    assert text.endswith("/\n"), "tools for namelists want a line end after the last /"
    assert path.name == "reference.nml" or max(map(len, text.splitlines())) <= 100


def test_the_reference_file_is_what_print_defaults_prints(ricochet):
    run = ricochet("--print-defaults")
    assert run.returncode == 0
    assert run.stdout == (ROOT / "input" / "reference.nml").read_text()


def groups_of(ricochet, *words) -> list[dict]:
    """Return the groups in the output of --print-input."""
    run = ricochet("--print-input", *words)
    assert (run.returncode, run.stderr) == (0, "")
    return json.loads(run.stdout)


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.name)
def test_an_input_that_is_printed_written_and_read_again_is_the_same(ricochet, tmp_path, path):
    groups = groups_of(ricochet, path)
    data = path.read_bytes()
    for group in groups:
        own = data[group["from"] : group["to"]].decode()
        assert own.startswith(f"&{group['group']}") and own.endswith("/")
        (tmp_path / "one.nml").write_text(own)
        (again,) = json.loads(ricochet("--print-input", "one.nml").stdout)
        assert again["values"] == group["values"]
    (tmp_path / "all.nml").write_text("".join(namelist({g["group"]: g["values"]}) for g in groups))
    kept = ["group", "name", "values"]
    assert [{key: group[key] for key in kept} for group in groups_of(ricochet, "all.nml")] == [
        {key: group[key] for key in kept} for group in groups
    ]


SPACES = [" ", "\n", "\t", "\r\n", " \r", " ! a / & ' = 1\n \n"]
LETTERS = "a1 '\"\\&/=!,()*\t\u00f6"


def drawn(rng: random.Random, row: dict) -> object:
    """Return a random allowed value of a variable, or a list of values."""
    if row["size"] != 1:
        few = [drawn(rng, row | {"size": 1}) for _ in range(rng.randint(1, 3))]
        return [rng.choice(few) for _ in range(row["size"] or rng.randint(2, 9))]
    if row["type"] == "logical":
        return rng.random() < 0.5
    if row["type"] == "text":
        return rng.choice(row["choices"] or ["".join(rng.choices(LETTERS, k=9)) + "x"])
    low, high = row["from"] or row["above"] or 0, row["to"] or row["below"]
    if row["type"] == "integer":
        return rng.randint(int(low) + 1, int(high or 2**63 - 1))
    return rng.uniform(low, high) if high else rng.choice([1, 7.5, 10.0 ** rng.uniform(-90, 90)])


def spelt(rng: random.Random, value: object) -> str:
    """Return a random spelling of a value or list, in which a count may replace equal elements."""
    if isinstance(value, list):
        words = []
        for one, row in itertools.groupby(value):
            times = len(list(row))
            word = spelt(rng, one)
            words += [f"{times}*{word}"] if rng.random() < 0.5 else [word] * times
        return words[0] + "".join(rng.choice([",", " , ", *SPACES]) + word for word in words[1:])
    if isinstance(value, bool):
        return rng.choice(["T", ".true.", "True", ".t."] if value else ["f", ".FALSE.", "false"])
    if isinstance(value, str):
        quote = rng.choice("'\"")
        return quote + value.replace(quote, 2 * quote) + quote
    sign = "-" if value < 0 else rng.choice(["", "+", "0"])
    number = repr(abs(value)).replace("e", rng.choice("eEdD"))
    return sign + rng.choice([number, number.removeprefix("0")] if "." in number else [number])


@pytest.mark.parametrize("seed", range(20))
def test_values_in_all_their_spellings_are_printed(ricochet, tmp_path, seed):
    """All spellings of a value are read alike, even in inputs with incompatible values."""
    rng = random.Random(seed)
    table = json.loads(ricochet("--print-variables").stdout)
    text, written = rng.choice(["", "\ufeff"]), []
    for group in rng.sample(sorted(table.keys() - {"contact"}), rng.randint(1, 5)):
        names = table[group].keys() - ({"name"} if group != "side" else set())
        values = {
            name: drawn(rng, table[group][name])
            for name in rng.sample(sorted(names), min(4, len(names)))
        }
        text += "&" + rng.choice([group, group.upper()]) + rng.choice(SPACES)
        for name, value in values.items():
            parts = [(name, value)]
            if group == "box" and isinstance(value, list) and rng.random() < 0.5:
                parts = [(f"{name}({k + 1})", one) for k, one in enumerate(value)]
                rng.shuffle(parts)
            for left, right in parts:
                word = rng.choice([left, left.title()]) + rng.choice(["", *SPACES])
                text += word + "=" + rng.choice(["", *SPACES]) + spelt(rng, right)
                text += rng.choice([", ", *SPACES])
        text += "/" + rng.choice(SPACES)
        written.append((group, values))
    (tmp_path / "odd.nml").write_text(text, newline="")
    told = ricochet("--print-input", "odd.nml", "--set", "contact.inertia=0.5")
    groups = json.loads(told.stdout)
    written.append(("contact", {"inertia": 0.5}))
    assert [(group["group"], group["values"]) for group in groups] == written, told.stderr
    data = text.removeprefix("\ufeff").replace("\r\n", "\n").encode()
    places = [(group["from"], group["to"]) for group in groups]
    assert places.pop() == (None, None)
    assert all(data[a : a + 1] + data[b - 1 : b] == b"&/" for a, b in places)


def test_of_a_wrong_input_what_is_understood_is_printed(ricochet, tmp_path):
    (tmp_path / "bad.nml").write_text(GOOD.replace("radius", "radios") + "&box upper = 0, 1 /\n")
    run = ricochet("--print-input", "bad.nml")
    assert run.returncode == USAGE
    assert run.stderr == ricochet("bad.nml", "--check").stderr
    assert json.loads(run.stdout)[0]["values"] == {"name": "gas", "count": 20, "speed": 1}


def test_the_table_says_what_may_change_on_resuming(ricochet):
    table = json.loads(ricochet("--print-variables").stdout)
    found = {f"{g}.{v}" for g, rows in table.items() for v, row in rows.items() if row["resumable"]}
    timed = [f"output.{v}" for v in table["output"] if re.match("(frames|observables)_", v)]
    run = [f"run.{v}" for v in ("title", "search", "queue", "threads")]
    stop = [f"{g}.{v}" for g in ("change", "stop") for v in table[g]]
    assert found == {*run, *stop, *timed, "output.decades_from", "output.checkpoint_every"}
    words = "may change on --resume"
    assert words in ricochet("--explain", "stop.time").stdout
    assert words not in ricochet("--explain", "box.lower").stdout


def test_an_override_may_name_a_side_that_the_file_does_not(ricochet, tmp_path):
    (tmp_path / "gas.nml").write_text(GOOD)
    moving = ["--set", "side.top.motion=sawtooth", "--set", "side.top.velocity=1"]
    groups = groups_of(ricochet, "gas.nml", *moving)
    assert {"name": "top", "motion": "sawtooth", "velocity": 1} in [g["values"] for g in groups]
    assert ricochet("gas.nml", "--check", *moving).returncode == FINISHED
    run = ricochet("gas.nml", "--check", "--set", "side.roof.velocity=1")
    assert run.returncode == USAGE and "roof" in run.stderr


def test_an_override_may_set_one_element_of_a_vector(ricochet, tmp_path):
    (tmp_path / "gas.nml").write_text(GOOD)
    set_twice = [
        "--set",
        "box.upper(2)=3",
        "--set",
        "BOX.UPPER(1)=4",
        "--set",
        "box.boundary(1)=periodic",
    ]
    box = [g["values"] for g in groups_of(ricochet, "gas.nml", *set_twice) if g["group"] == "box"]
    assert box == [{"upper": [4, 3], "boundary": ["periodic", "wall"]}]


def test_a_missing_file_is_answered_by_the_nearest_name_in_its_folder_or_in_input(
    ricochet, tmp_path
):
    (tmp_path / "input").mkdir()
    (tmp_path / "input" / "gas.nml").write_text(GOOD)
    (tmp_path / "input" / "notes.txt").touch()
    for word in ("gas", "gas.nml", "input/gas", "input/gsa.nml", "inpt/gas.nml", "runs/gas.h5"):
        said = ricochet(word, "--check").stderr
        assert said == f"{word}: there is no such file; did you mean input/gas.nml?\n"
    for word in ("input/zebra.nml", "notes.txt"):
        assert ricochet(word).stderr == f"{word}: there is no such file\n"
    ensemble = ran(ROOT / "runs" / "ensemble.sh", "inpt/gas.nml", "-d", "d", cwd=tmp_path)
    assert ensemble.stderr.endswith("cannot read inpt/gas.nml; did you mean input/gas.nml?\n")
    (tmp_path / "gas.nml").write_text(GOOD)
    assert "did you mean gas.nml?" in ricochet("gsa.nml").stderr


def test_every_default_that_is_printed_may_be_written_into_a_file(ricochet, tmp_path):
    table = json.loads(ricochet("--print-variables").stdout)
    files = {name: {} for name in table}
    for group, variables in table.items():
        for name, row in variables.items():
            assert (row["default"] is None) != (row["example"] is None)
            assert isinstance(row["default"], list) == (
                row["default"] is not None and row["size"] != 1
            )
            if row["needed"] or (row["default"] is not None and not row["goes_with"]):
                files[group][name] = row["example"] if row["default"] is None else row["default"]
    (tmp_path / "all.nml").write_text(namelist(files))
    for group in groups_of(ricochet, "all.nml"):
        assert group["values"] == files[group["group"]]


def test_the_readme_of_the_inputs_lists_every_file():
    listed = re.findall(r"^\| `(\w+\.nml)`", (ROOT / "input" / "README.md").read_text(), re.M)
    assert sorted([*listed, "reference.nml"]) == [path.name for path in INPUTS]


def test_all_problems_come_at_once_and_the_last_line_says_so_too(checked):
    run = checked("&species massa = 1 radius = -1 count = 2 /\n&stop tme = 1 /\n", "--set", "a=b")
    lines = lines_of(run)
    assert run.returncode == USAGE
    mass = 'did you mean "mass"? --explain species lists all'
    assert lines[:3] == [
        f"gas.nml:1: species.massa: unknown variable; {mass}",
        'gas.nml:1: species.radius: "-1" is out of range; allowed: a number > 0',
        'gas.nml:2: stop.tme: unknown variable; did you mean "time"? --explain stop lists all',
    ]
    assert lines[-1].startswith("--set a=b: ")


@pytest.mark.parametrize(
    ("group", "variables"),
    [
        ("species", {"count": 5, "radius": 0.01}),
        ("source", {"interval": 0.1, "temperature": 1}),
        ("side", {"name": "'left'", "temperature": 1}),
        ("drive", {"kind": "'noise'", "interval": 0.1, "strength": 1}),
    ],
)
def test_a_misspelt_variable_is_not_said_to_be_missing(checked, group, variables):
    for name in variables:
        k = random.randrange(len(name) - 1)
        typo = name[:k] + name[k + 1] + name[k] + name[k + 2 :]
        if typo == name:
            continue
        names = [typo if other == name else other for other in variables]
        given = " ".join(f"{n} = {v}" for n, v in zip(names, variables.values(), strict=True))
        rest = "&stop events = 1 /" if group == "species" else GOOD
        advice = f'did you mean "{name}"? --explain {group} lists all'
        wrong = f"{group}.{typo}: unknown variable; {advice}"
        said = lines_of(checked(f"&{group} {given} /\n{rest}"))
        assert said == [f"gas.nml:1: {wrong}"]
        given = " ".join(f"{n} = {v}" for n, v in variables.items() if n != name)
        option = f"{group}.{typo}={variables[name]}"
        said = lines_of(checked(f"&{group} {given} /\n{rest}", "--set", option))
        assert said == [f"--set {option}: {wrong}"]


def test_a_renamed_variable_is_not_said_to_be_missing(checked):
    former = "speed"
    drive = f"&drive kind = 'active' interval = 1 temperature = 1 {former} = 2 /\n"
    said = lines_of(checked(drive + GOOD))
    assert said == [f"gas.nml:1: drive.{former}: is called self_propulsion_speed now"]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "gas.nml: is empty, or a pipe or a device instead of a file"),
        (b"\n", "gas.nml: species: the input has no &species"),
        (b"\x89HDF\r\n\x1a\n" + bytes(9), "repeat its command with --resume"),
        (b"\x89HDF\r\n\x1a\n" + bytes(5_000_000), "is an HDF5 file"),
        (b"&box wall_temperature = 1 /", "did you mean side.temperature or wall.temperature"),
        (bytes(range(256)), "is not a text file: byte 1"),
        (GOOD.encode("utf-16"), "is not a text file"),
        (b"\xff\xfe" + GOOD.encode(), "text outside a group"),
        (b"! " + b"x" * 5_000_000, "has 5000002 bytes; an input file has at most 4194304"),
        (b"&run " + b"x" * 1_000_000 + b" = 1 /", "gas.nml:1: run."),
        (b"&" + b"x" * 1_000_000 + b" /", "unknown group"),
        (b"&run title = '" + b"x" * 1_000_000 + b"' /", "the text has 1000000 bytes"),
        (b"&run seed = " + b"1" * 1_000_000 + b" /", "is out of range"),
        (b"&run seed = " + b"1 " * 1_000_000 + b" /", "1000000 values instead of 1"),
        (b"&species position = 9999999*1 /", "9999999 values; allowed"),
        (b"&species /" * 6000, "species"),
        (b"&run " + b"seed = 1 " * 100_000 + b" /", "is set twice"),
        (b"(" * 1_000_000, "text outside a group"),
        (b"&run " + b"(" * 1_000_000, "unexpected"),
    ],
    ids=lambda value: "" if isinstance(value, bytes) else value[:30],
)
def test_absurd_files_are_refused_in_time_with_short_messages(checked, content, said):
    run = checked(content)
    assert run.returncode == USAGE
    assert said in run.stderr
    assert all(len(line) < 400 for line in lines_of(run))


@pytest.mark.parametrize(
    ("more", "stays"),
    [
        ("", True),
        ("&side name = 'left' temperature = 1 /", True),
        ("&box gravity = 0, -1 /", False),
        ("&side name = 'left' motion = 'sine' amplitude = 0.1 period = 1 /", False),
        ("&drive kind = 'noise' interval = 1 strength = 1 /", False),
        ("&change time = 1 set = 'box.gravity=0,-1' /", False),
    ],
)
def test_a_check_reports_disks_that_nothing_sets_in_motion(checked, more, stays):
    run = checked(f"&species count = 5 radius = 0.01 /\n{more}\n&stop time = 2 /")
    assert run.returncode == 0, run.stderr
    assert ("no events are possible" in run.stderr) == stays


def test_four_megabytes_of_positions_are_read_in_time(checked, tmp_path):
    side = 400
    places = ", ".join(
        f"{(column + 0.5) / side:.5f},{(row + 0.5) / side:.5f}"
        for row in range(side)
        for column in range(side)
    )
    text = f"&species radius = 0.001 position = {places} /\n&stop time = 0 /\n"
    run = checked(text)
    assert run.returncode == 0, run.stderr[:500]
    assert str(side**2) in run.stdout


@pytest.mark.parametrize(
    "kind", ["missing", "folder", "pipe", "device", "link to nothing", "secret", "x" * 5000]
)
def test_what_is_no_file_is_refused_without_waiting(ricochet, tmp_path, kind):
    path = tmp_path / kind
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path = Path("/dev/zero")
    elif kind == "link to nothing":
        path.symlink_to(tmp_path / "nothing")
    elif kind == "secret":
        path.touch(0)  # root can read any file
    run = ricochet(path, "--check")
    assert run.returncode == (USAGE if kind in ("pipe", "device", "secret") else FILES)
    assert [str(path) in line for line in lines_of(run)] == [True]


@pytest.mark.parametrize(
    "name", ["two words.nml", "größe.nml", "-odd.nml", "x" * 251 + ".nml", "a'b\"c.nml", "&.nml"]
)
def test_files_may_have_any_name(ricochet, tmp_path, name):
    (tmp_path / name).write_text(GOOD)
    run = ricochet("--check", "--", name)
    assert (run.returncode, run.stderr) == (0, "")


@pytest.mark.parametrize("command", [["--help"], ["--check", "gas.nml"], ["--quiet", "gas.nml"]])
def test_a_full_disk_behind_stdout_is_reported(ricochet, tmp_path, command):
    (tmp_path / "gas.nml").write_text(GOOD)
    with Path("/dev/full").open("w") as full:
        run = ricochet(*command, capture_output=False, stdout=full, stderr=subprocess.PIPE)
    assert run.returncode == FILES
    assert lines_of(run) == ["standard output: cannot be written: No space left on device"]


def test_explain_finds_the_words_of_users_or_names_the_documentation(ricochet):
    assert "drive.kind = 'recycle'" in ricochet("--explain", "refill").stdout
    assert "sqrt(d/g)" in ricochet("--explain", "contact_time").stdout.replace("\n", " ")
    run = ricochet("--explain", "tracers")
    assert run.returncode == USAGE and "make docs" in run.stderr
    for word in ("heat", "wall", "wall_temperature"):
        run = ricochet("--explain", word)
        assert run.returncode == 0 and re.search(r"^(side\.temper|box\.bound)", run.stdout, re.M)


@pytest.mark.parametrize("command", [["--help"], ["--version"], ["--explain", "restitution"]])
def test_questions_are_answered_on_stdout(ricochet, command):
    run = ricochet(*command)
    assert (run.returncode, run.stderr) == (0, "")
    assert "ricochet" in run.stdout or "contact.restitution" in run.stdout


def test_the_version_names_all_that_a_report_needs(ricochet):
    lines = ricochet("--version").stdout.splitlines()
    assert re.fullmatch(r"ricochet \d+\.\d+\.\d+", lines[0])
    facts = dict(line.split(":", 1) for line in lines[1:])
    assert set(facts) == {"commit", "compiler", "flags", "HDF5", "threads"}
    assert re.fullmatch(r" +([0-9a-f]{7,40}|unknown)(\+changes)?", facts["commit"])
    assert "GCC" in facts["compiler"] and "-std=f2008" in facts["flags"]
    assert re.fullmatch(r" +\d+\.\d+\.\d+", facts["HDF5"])


@pytest.mark.parametrize("command", [[], ["--resum", "a.nml"], ["a", "b"], ["--explain", "tiem"]])
def test_wrong_usage_is_one_line(ricochet, command):
    run = ricochet(*command)
    assert run.returncode == USAGE
    assert len(lines_of(run)) == 1


def test_the_limits_that_are_printed_are_those_that_hold(ricochet, checked):
    """No value within the printed limits is refused as out of range."""
    instance = {"species": ".gas", "obstacle": ".pin", "wall": ".ramp", "side": ".top"}
    instance |= {"change": ".1", "source": ".tap"}
    numbers = [
        (group, name, row)
        for group, variables in json.loads(ricochet("--print-variables").stdout).items()
        for name, row in variables.items()
        if row["type"] in ("integer", "real")
    ]
    assert len(numbers) > 50
    for group, name, row in numbers:
        whole = row["type"] == "integer"
        limits = [row[key] for key in ("above", "from", "below", "to") if row[key] is not None]
        near = [limit + shift for limit in limits for shift in (-1, -1e-6, 0, 1e-6, 1)]
        for value in [*near, 0, -1, 1e-99, 1e99]:
            number = round(value) if whole else value
            setting = f"{group}{instance.get(group, '')}.{name}="
            setting += ",".join([repr(number)] * (row["size"] or 2))
            text = GOOD + OTHERS + "&change time = 1 set = 'contact.restitution=0.5' /\n"
            text += "&source name = 'tap' interval = 1 temperature = 1 /\n"
            run = checked(text, "--quiet", "--set", setting)
            lines = lines_of(run)
            assert run.returncode == (USAGE if lines else 0), setting
            inside = row["above"] is None or number > row["above"]
            inside &= row["from"] is None or number >= row["from"]
            inside &= row["below"] is None or number < row["below"]
            inside &= row["to"] is None or number <= row["to"]
            inside &= not whole or abs(number) < 2**63
            told = re.search(rf' {group}\.{name}: "\S+ is out of range; allowed: ', run.stderr)
            assert bool(told) != inside, setting


def report(ricochet, folder, text) -> tuple[int, list[str]]:
    """Return the exit code and the messages of --check."""
    text, *start = re.sub(r"600\*(.)", lambda found: 600 * found[1], text).split("<< ")
    text, *settings = text.replace("\\n", "\n").split("--set ")
    if start:
        (folder / "start.txt").write_text(start[0].replace("\\n", "\n").rstrip("\n") + "\n")
    if "&species" not in text:
        text += "\n" + (STARTED.format("velocities = 'rest'") if start else DISKS)
    if "&stop" not in text:
        text += "\n&stop time = 1 /"
    (folder / "f").write_text(text + "\n")
    run = ricochet(
        "f", "--check", "--quiet", *(word for own in settings for word in ("--set", own))
    )
    assert run.stdout == ""
    return run.returncode, run.stderr.splitlines()


def is_told(words: str, line: str) -> bool:
    """Return whether a message contains the expected words in the same order."""
    return bool(re.search(".*".join(map(re.escape, words.strip().split(" ... "))), line))


def test_what_is_refused_is_told_in_all_its_lines(ricochet, tmp_path):
    rows = [row for row in ROWS if row and not row.startswith("#")]
    faults = []
    for row in rows:
        text, *words = row.split(" | ")
        code, lines = report(ricochet, tmp_path, text)
        told = len(words) == len(lines) and all(map(is_told, words, lines))
        legible = all(re.match(PLACE, line) and len(line) < 400 for line in lines)
        if code != (FILES if "cannot be read" in row else USAGE) or not (told and legible):
            faults += [row, *(f"    {line}" for line in lines)]
    assert not faults, "\n".join(faults)
    assert len(rows) > 200


@pytest.mark.parametrize("count", [300, pytest.param(10_000, marks=pytest.mark.check)])
def test_damaged_files_never_harm(program, count):
    verdicts = fuzz_input.fuzz(str(program), count, seed=2)
    assert set(verdicts) == {"accepted", "refused"}
    assert verdicts["accepted"] > 0.1 * count
