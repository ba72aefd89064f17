"""Wrap the paragraphs and list items of the pages at 120 characters per line.

    python tests/support/wrap_pages.py            rewrites pages that are wrapped differently
    python tests/support/wrap_pages.py --check    only lists these pages

Code, tables, headings, displayed formulas and HTML are left unchanged.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
WIDTH = 120
FOLDERS = ("docs", "src", "input", "runs", "post")
#: Generated pages, which are not wrapped.
EXCEPT = re.compile(
    r"docs/(reference/(input|input/\w+|inputs|c|command-line)"
    r"|explanation/validation)\.md"
)
ITEM = re.compile(r"( *)([-*+]|\d+[.)]) +(?=\S)")
#: Lines that end a paragraph and do not belong to it.
OTHER = re.compile(r" *(#|\||<|\$\$|!\[|:::|>|\[[^\]]+\]: |={3,}$|-{3,}$)")
#: Words that would begin another element of the page at the start of a line.
BEGINS = re.compile(r"([-*+]|\d+[.)]|#+|=+|-+|[|>].*|\$\$.*|<.*|:::.*)$")


def pages() -> list[Path]:
    """Return the pages to be wrapped."""
    found = [
        *ROOT.glob("*.md"),
        *(path for name in FOLDERS for path in (ROOT / name).rglob("*.md")),
    ]
    return [path for path in sorted(found) if not EXCEPT.fullmatch(f"{path.relative_to(ROOT)}")]


def filled(words: list[str], first: str, rest: str) -> list[str]:
    """Return the lines of a paragraph, prefixed by `first` and then by `rest`."""
    lines, line = [], first
    for number, word in enumerate(words):
        fits = len(line) + (number > 0) + len(word) <= WIDTH
        if number and not fits and not BEGINS.match(word):
            lines.append(line)
            line = rest + word
        else:
            line += " " * (number > 0) + word
    return [*lines, line]


def parts_of(text: str) -> list[str]:
    """Return the words of a paragraph; code and formulas with spaces count as one word."""
    joined = re.sub(
        r"(`+)(?:(?!\1).)+\1|(?<!\\)\$[^$]+\$", lambda one: one[0].replace(" ", "\0"), text
    )
    return [word.replace("\0", " ") for word in joined.split()]


def wrapped(page: str) -> str:
    """Return a page with wrapped paragraphs."""
    found: list[str] = []
    paragraph: list[str] = []
    first = rest = ""
    fence, in_html = "", False

    def end() -> None:
        if paragraph:
            found.extend(filled(parts_of(" ".join(paragraph)), first, rest))
        paragraph.clear()

    for line in page.splitlines():
        mark = re.match(r" *(`{3,}|~{3,})", line)
        if fence or mark:
            end()
            fence = "" if fence and mark and mark[1].startswith(fence) else fence or mark[1]
        elif in_html or line.startswith("<!--"):
            end()
            in_html = "-->" not in line
        elif item := ITEM.match(line):
            end()
            first, rest = item[0], " " * item.end()
            paragraph.append(line[item.end() :])
            continue
        elif paragraph and line.strip() and not OTHER.match(line) and line[-2:] != "  ":
            paragraph.append(line.strip())
            continue
        elif line.strip() and not OTHER.match(line) and not line.startswith("  "):
            first = rest = ""
            paragraph.append(line)
            continue
        end()
        found.append(line)
    end()
    return "\n".join(found) + "\n"


def main() -> int:
    """Wrap or list the pages; return 1 if `--check` finds one that is wrapped differently."""
    check = "--check" in sys.argv[1:]
    other = [path for path in pages() if wrapped(path.read_text()) != path.read_text()]
    for path in other:
        print(f"{path.relative_to(ROOT)}: {'is not wrapped' if check else 'wrapped'}")
        if not check:
            path.write_text(wrapped(path.read_text()))
    return int(check and bool(other))


if __name__ == "__main__":
    sys.exit(main())
