"""Write the manual page ricochet(1) from what the program says of itself.

python docs/manual_page.py build/ricochet PREFIX > ricochet.1
"""

import re
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

from input_page import GROUPS, explained

#: The paragraphs of --help, in order.
SECTIONS = ("SYNOPSIS", "OPTIONS", "EXIT STATUS", "EXAMPLES")
FILES = """\
.SH FILES
.ad l
.TP
.I {prefix}/share/ricochet/input
Experiments, ready to run; reference.nml shows every variable.
.TP
.I {prefix}/share/ricochet/post
Python scripts that turn output files into figures and films: each has a \\-\\-help.
They need the packages in requirements.txt there.
.TP
.I OUT.h5
Results, in the format H5MD. Until the run has finished: OUT.h5.part, and the checkpoint OUT.chk.h5.
.SH SEE ALSO
.BR ricochet\\-ensemble " (its \\-\\-help), " h5dump (1)
"""


def roff(text: str) -> str:
    """Text with everything escaped that roff would take for its own."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return "\n".join("\\&" + line if line[:1] in {".", "'"} else line for line in text.split("\n"))


def said(program: Path, option: str) -> str:
    """What the program answers to an option."""
    return subprocess.run([program, option], check=True, capture_output=True, text=True).stdout


def page(program: Path, prefix: str) -> str:
    """The whole page."""
    version = said(program, "--version").split()[1]
    headline, *paragraphs = said(program, "--help").rstrip().split("\n\n")
    title, purpose = headline.split(": ", 1)
    lines = [
        f'.TH RICOCHET 1 "" "Ricochet {version}" "User Commands"',
        ".SH NAME",
        f"{title} \\- {roff(purpose)}",
    ]
    for heading, paragraph in zip(SECTIONS, paragraphs, strict=True):
        text = re.sub(r"^(usage|exit|examples):", lambda word: " " * len(word[0]), paragraph)
        lines += [f".SH {heading}", ".nf", roff(dedent(text).strip("\n")), ".fi"]
    lines += [
        ".SH INPUT",
        "A file consists of groups",
        ".B &name ... /",
        "with lines variable = value; only what differs from the default is needed.",
    ]
    for group, words in GROUPS.items():
        lines += [f'.SS "&{group}"', roff(words)]
        for entry in explained(program, group):
            unit = f" [{entry['unit']}]" if entry["unit"] else ""
            meaning = f"{entry['help'].rstrip('.')}{unit}. Allowed: {entry['allowed']};"
            meaning += f" {entry['kind']}: {entry['value']}."
            lines += [".TP", f".B {roff(entry['name'])}", roff(meaning)]
    return "\n".join(lines) + "\n" + FILES.format(prefix=roff(prefix))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    sys.stdout.write(page(Path(sys.argv[1]).resolve(), sys.argv[2]))
