"""Write the reference pages on the C interface, the input files, the command line and the scripts.

    python docs/reference_pages.py build/ricochet

Four pages in docs/reference/ are written:

- c.md, from the header src/ricochet.h
- inputs.md, from the input files and input/chooser.json
- the help text in command-line.md, from the program
- the tables of analyses and of other scripts in scripts.md, from their docstrings
"""

import ast
import json
import re
import subprocess
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
C_HEAD = """\
# C interface

Programs in C, or in any language that can call C, can use the engine as a library.
`make library` builds `build/libricochet.so` and `build/libricochet_files.so`.
`docs/reference_pages.py` generates this page from the header `ricochet.h`.

## Example

"""
INPUTS_HEAD = """\
# Inputs

This page lists all files in `input/`. Each input file is ready to run. Comments in the file explain
the settings. The pictures show the simulations at one time; `make lab` shows them in motion.
`docs/reference_pages.py` generates this page.

"""


def c_page() -> str:
    """Return the page on the C interface."""
    header = (ROOT / "src" / "ricochet.h").read_text(encoding="utf-8")
    intro, _, rest = header.partition("*/\n")
    first, _, more = intro.partition("\n\n       ")
    example, _, notes = more.partition("\n\n   A handle")
    example, notes = f"       {example}", f"   A handle{notes}"
    about = first.rpartition("\n\n")[2].strip()
    lines = [C_HEAD + about, "", "```c", textwrap.dedent(example).rstrip(), "```", ""]
    lines += ["## Rules", "", textwrap.dedent(notes).strip(), "", "## Functions", ""]
    for comment, code in re.findall(r"/\* (.*?) \*/\n((?:(?!/\*)[^\n]+\n)*)", rest, re.DOTALL):
        if comment.startswith("---"):
            lines += [f"## {comment.strip('- ')}", ""]
            continue
        name = re.search(r"(\w+)\(", code)
        if not name:
            continue
        words, values, returns = parts_of(comment)
        lines += [
            f"### `{name[1]}`",
            "",
            "```c",
            code.replace("#endif", "").strip(),
            "```",
            "",
            words,
            "",
        ]
        lines += [f"- `{argument}`: {meaning}" for argument, meaning in values]
        lines += [""] * bool(values) + [returns, ""] * bool(returns)
    return "\n".join(lines).rstrip() + "\n"


def parts_of(comment: str) -> tuple[str, list[tuple[str, str]], str]:
    """Split a comment of the header into description, arguments and return value."""
    words: list[str] = []
    values: list[tuple[str, str]] = []
    returns: list[str] = []
    for line in comment.splitlines():
        text = line.strip()
        argument = re.match(r"   (\w+): {2,}(.*)", line)
        if argument:
            values.append((argument[1], argument[2]))
        elif values and not returns and line.startswith("     "):
            name, meaning = values[-1]
            values[-1] = name, f"{meaning} {text}"
        elif values or returns:
            returns.append(text)
        else:
            words.append(text)
    return " ".join(words), values, " ".join(returns)


def summary(path: Path) -> str:
    """Return the first line of an input file, which describes the system."""
    return path.read_text(encoding="utf-8").splitlines()[0].lstrip("! ").rstrip(".")


def inputs_page() -> str:
    """Return the gallery of input files."""
    chooser = json.loads((ROOT / "input" / "chooser.json").read_text(encoding="utf-8"))
    subjects: dict[str, list[str]] = {}
    for name, entry in chooser.items():
        subjects.setdefault(entry["subject"], []).append(name)
    names = {path.stem for path in (ROOT / "input").glob("*.nml")}
    subjects["Others"] = sorted(names - chooser.keys())
    lines = [INPUTS_HEAD]
    for subject, members in subjects.items():
        lines += [f"## {subject}", "", "| | input | system |", "|---|---|---|"]
        for name in members:
            picture = f"input/pictures/{name}.png"
            shown = f"![{name}](../../{picture})" if (ROOT / picture).exists() else ""
            about = summary(ROOT / "input" / f"{name}.nml").replace("|", "\\|")
            end = "" if about.endswith("?") else "."
            lines.append(f"| {shown} | [{name}.nml](../../input/{name}.nml) | {about}{end} |")
        lines.append("")
    return "\n".join(lines)


def command_page(program: Path) -> str:
    """Return the page on the command line, with the present help text of the program."""
    page = (ROOT / "docs/reference/command-line.md").read_text(encoding="utf-8")
    said = subprocess.run([program, "--help"], check=True, capture_output=True, text=True).stdout
    before, start, rest = page.partition("<!-- help -->\n")
    end = rest.partition("<!-- end -->")[2]
    return f"{before}{start}```text\n{said.strip()}\n```\n<!-- end -->{end}"


def scripts_page() -> str:
    """Return the page on the scripts, with the present tables of analyses and other scripts."""
    page = (ROOT / "docs/reference/scripts.md").read_text(encoding="utf-8")
    sys.path.insert(0, str(ROOT / "post"))
    from ricochet import analyses

    others = [path for path in sorted((ROOT / "post").glob("*.py")) if path.stem not in analyses]
    lines = {path.stem: ast.get_docstring(ast.parse(path.read_text())) for path in others}
    whole = page[: page.index("## Analyses")]
    for title, rows in (("Analyses", analyses), ("Other scripts", lines)):
        whole += f"## {title}\n\n| script | purpose |\n|---|---|\n"
        for name, text in rows.items():
            whole += f"| `{name}.py` | {text.splitlines()[0].rstrip('.')} |\n"
        whole += "\n"
    return whole.rstrip("\n") + "\n"


def pages(program: Path) -> dict[str, str]:
    """Return a dictionary from the path of each page to its text."""
    return {
        "docs/reference/c.md": c_page(),
        "docs/reference/inputs.md": inputs_page(),
        "docs/reference/command-line.md": command_page(program),
        "docs/reference/scripts.md": scripts_page(),
    }


def main() -> None:
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    for path, text in pages(Path(sys.argv[1]).resolve()).items():
        (ROOT / path).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
