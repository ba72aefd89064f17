"""Write the Unix manual page of a command (ricochet, ricochet-ensemble) from its --help text.

    python docs/manual_page.py build/ricochet PREFIX > ricochet.1

The version number is that of the program `ricochet` in the folder of the command.
"""

import posixpath
import re
import sys
from pathlib import Path
from textwrap import dedent

from input_page import GROUPS, LAW, said, variables, written

#: Section of the manual page, by the first word (before a colon) of a paragraph of the --help text.
SECTIONS = {
    "usage": "SYNOPSIS",
    "members": "OPTIONS",
    "": "OPTIONS",
    "exit": "EXIT STATUS",
    "examples": "EXAMPLES",
}
LINK = r"\[\w+\]\(([\w./]+)[^)]*\)"  # a link from docs/reference/input/ to another page
FILES = """\
.SH FILES
.ad l
.TP
.I {prefix}/share/ricochet/input
Experiments, ready to run; reference.nml shows every variable.
.TP
.I {prefix}/share/ricochet/post
Python scripts that turn output files into figures and films: player.py is the command
.BR ricochet\\-player ,
crater_scan.py
.BR ricochet\\-crater\\-scan ,
and so on; each has a \\-\\-help.
They need the packages in requirements.txt there.
.TP
.I {prefix}/share/doc/ricochet
README.md, which leads to all pages.
.TP
.I OUT.h5
Results, in the format H5MD. Until the run has finished: OUT.h5.part.
.SH SEE ALSO
.BR ricochet (1),
.BR ricochet\\-ensemble (1),
.BR h5dump (1)
"""


def roff(text: str) -> str:
    """Escape the special characters of roff."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return "\n".join("\\&" + line if line[:1] in {".", "'"} else line for line in text.split("\n"))


def section(paragraph: str) -> list[str]:
    """Convert a paragraph of the --help text to a section in roff format."""
    found = re.match(r"(\w+):( *)", paragraph)
    word = found[1] if found else "" if paragraph.startswith(" ") else None
    heading = SECTIONS.get(word, "DESCRIPTION")
    if heading != "OPTIONS":
        paragraph = re.sub(r"^\w+:", lambda found: " " * len(found[0]), paragraph)
    return [f".SH {heading}", ".nf", roff(dedent(paragraph).strip("\n")), ".fi"]


def installed(link: re.Match) -> str:
    """Convert a link to a page of the documentation to the path of the installed page."""
    return f"PREFIX/share/doc/ricochet/{posixpath.normpath(f'docs/reference/input/{link[1]}')}"


def inputs(program: Path) -> list[str]:
    """Return a list of all input groups and their variables in roff format."""
    lines = [
        ".SH INPUT",
        "A file consists of groups",
        ".B &name ... /",
        "with lines variable = value; only what differs from the default is needed.",
    ]
    for group, entries in variables(program).items():
        purpose = re.sub(LINK, installed, GROUPS[group])
        title, prefix = (LAW, "") if group == LAW else (f"&{group}", f"{group}.")
        lines += [f'.SS "{title}"', roff(purpose)]
        for name, entry in entries.items():
            unit = f" [{entry['unit']}]" if entry["unit"] else ""
            kind = "example" if entry["default"] is None else "default"
            meaning = f"{entry['help'].rstrip('.')}{unit}. Allowed: {entry['allowed']};"
            meaning += f" {kind}: {written(entry)}."
            lines += [".TP", f".B {roff(prefix + name)}", roff(meaning)]
    return lines


def page(command: Path, prefix: str) -> str:
    """Return the manual page in roff format."""
    program = command.with_name("ricochet")
    version = said(program, "--version").split()[1]
    headline, *paragraphs = said(command, "--help").rstrip().split("\n\n")
    title, purpose = headline.split(": ", 1)
    lines = [
        f'.TH {roff(title.upper())} 1 "" "Ricochet {version}" "User Commands"',
        ".SH NAME",
        f"{title} \\- {roff(purpose)}",
    ]
    for paragraph in paragraphs:
        lines += section(re.sub(r"(?<!\S)input/", "PREFIX/share/ricochet/input/", paragraph))
    if command == program:
        lines += inputs(program)
    text = "\n".join(lines) + "\n"
    return text.replace("PREFIX/", f"{roff(prefix)}/") + FILES.format(prefix=roff(prefix))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    sys.stdout.write(page(Path(sys.argv[1]).absolute(), sys.argv[2]))
