"""What is refused, and in which words: refused.txt has the inputs and all that is said of them."""

import re
from pathlib import Path

from whole_runs import FILES, USAGE

ROWS = Path(__file__).with_name("refused.txt").read_text().splitlines()
DISKS, STARTED = (
    "&species count = 10 radius = .01 /",
    "&species name = 'gas' file = 'start.txt' {} /",
)
PLACE = r'f(:\d+)?: (\S+|".*"): |--set '


def report(ricochet, folder, text) -> tuple[int, list[str]]:
    """Exit code and messages of --check."""
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
    """Whether a message has the words of the table, in their order."""
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
