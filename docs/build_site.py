"""Build the documentation site: pages of docs/, READMEs, Python reference, and pages of the source.

    python docs/build_site.py build

Examples on the pages use the program build/ricochet, or the one that the environment variable
RICOCHET names.

`make docs` runs this script. It copies all pages to the folder build/docs-sources, converting links
between pages of different folders to links within the site; from this copy Sphinx builds the site
build/docs. The README.md of each folder of docs/ is its index page, and its links determine the
order of the pages of the folder on the site. A page NAME.md beside a folder NAME is the index page
of that folder. The exit code is 1 if Sphinx prints a warning or a link within the site is broken.
"""

import argparse
import contextlib
import html
import importlib.util
import json
import os
import posixpath
import re
import shutil
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from unittest import mock
from urllib.parse import unquote, urlsplit

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
#: Folder of the site with the pages that the program FORD generates from the Fortran source.
FORTRAN = "fortran"
#: Pages that Sphinx generates without a source file.
OWN = ("genindex.html", "search.html", "py-modindex.html")
#: Pages whose sources are outside docs/, with their names in the folder `project` of the site.
OUTSIDE = {
    "README.md": "readme",
    "CHANGELOG.md": "changelog",
    "CONTRIBUTING.md": "contributing",
    "CODE_OF_CONDUCT.md": "conduct",
    "input/README.md": "input",
    "runs/README.md": "runs",
    "src/README.md": "src",
    "post/ricochet/README.md": "python",
    "LICENSE": "licence",
}
GLOSSARY = "explanation/glossary"
#: Script of the search page, which shows excerpts of pages. It contains their texts, because a page
#: opened as a file cannot read other pages.
EXCERPTS = """const TEXTS = {texts};
window.fetch = async page => ({{
  text: async () => `<div role="main">${{TEXTS[page.replace(/^\\.\\//, "")] ?? ""}}</div>`,
}});
"""
LINK = re.compile(r"(?<=\]\()[^)\s]+|(?<=\bsrc=\")[^\"]+")
TO_FOLDER = re.compile(r"\[([^\[\]]*)\]\(([\w/.-]+)\)")
ELSEWHERE = ("http:", "https:", "mailto:", "#", "data:")
API_HEAD = """\
# {short}

```{{eval-rst}}
.. automodule:: {name}
   :no-members:

.. currentmodule:: {name}

.. autosummary::
   :nosignatures:

{names}

{entries}
```
"""


def sources() -> dict[str, str]:
    """Return a dictionary from the path of each page in the project to its path on the site."""
    pages = {}
    for path in sorted([*DOCS.rglob("*.md"), *DOCS.rglob("*.ipynb")]):
        name = path.relative_to(DOCS).with_suffix("").as_posix()
        pages[f"docs/{path.relative_to(DOCS)}"] = re.sub(r"(^|/)README$", r"\1index", name)
    pages |= {name: f"project/{new}" for name, new in OUTSIDE.items()}
    for path in sorted((ROOT / "src").glob("*/README.md")):
        pages[path.relative_to(ROOT).as_posix()] = f"project/src-{path.parent.name}"
    return pages


class Stage:
    """Folder of the sources of the documentation site."""

    def __init__(self, folder: Path) -> None:
        """Store the folder, whose earlier files remain until `tidy` is called."""
        self.folder = folder
        self.pages = sources()
        self.written: set[Path] = set()

    def write(self, name: str, content: str | bytes) -> None:
        """Write a file if its content has changed, so that Sphinx rebuilds only changed pages."""
        path = self.folder / name
        data = content.encode() if isinstance(content, str) else content
        if not path.exists() or path.read_bytes() != data:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        self.written.add(path)

    def tidy(self) -> None:
        """Remove files written by earlier calls of the script but not by this one."""
        for path in self.folder.rglob("*"):
            if path.is_file() and path not in self.written:
                path.unlink()

    def target(self, page: str, link: str) -> str:
        """Convert a link of a page to a link within the site, and copy any linked file."""
        name, mark, section = link.partition("#")
        if not name or link.startswith(ELSEWHERE):
            return link
        path = posixpath.normpath(posixpath.join(posixpath.dirname(page), unquote(name)))
        if (ROOT / path).is_dir():
            path = posixpath.join(path, "README.md")
        if path in self.pages:
            ending = ".ipynb" if path.endswith(".ipynb") else ".md"
            new = self.pages[path] + ending
        elif (ROOT / path).is_file():
            new = path.removeprefix("docs/") if path.startswith("docs/") else f"files/{path}"
            self.write(new, (ROOT / path).read_bytes())
        else:
            raise SystemExit(f"{page}: the link {link} leads nowhere")
        return posixpath.relpath(new, posixpath.dirname(self.pages[page])) + mark + section

    def relinked(self, page: str, text: str) -> str:
        """Convert all links in the text of a page to links within the site.

        A link to a folder without a page is replaced by its text.
        """
        here = (ROOT / page).parent

        def unlinked(found: re.Match) -> str:
            folder = here / found[2]
            without_page = folder.is_dir() and not (folder / "README.md").exists()
            return found[1] if without_page else found[0]

        text = TO_FOLDER.sub(unlinked, text)
        return LINK.sub(lambda found: self.target(page, found[0]), text)

    def contents(self, page: str, text: str) -> str:
        """Return a hidden table of contents that lists the pages in the folder of an index page.

        An index page README.md lists pages of its own folder, any other index page NAME.md those of
        the folder NAME. If there is a section "All pages", only the links in this section are
        listed.
        """
        here = posixpath.dirname(page)
        folder = here if page.endswith("README.md") else page.removesuffix(".md")
        names = []
        listed = text.rpartition("## All pages")[2]
        for found in re.finditer(r"\]\(([^)\s#]+)\)", listed):
            path = posixpath.normpath(posixpath.join(here, found[1]))
            path = f"{path}/README.md" if (ROOT / path).is_dir() else path
            rest = path.removeprefix(f"{folder}/")
            inner = path in self.pages and path != page and rest != path
            inner = inner and "/" not in rest.removesuffix("/README.md")
            if inner and self.pages[path] not in names:
                names.append(self.pages[path])
        more = ["project/index"] if page == "docs/README.md" else []
        if page == "docs/reference/README.md":
            more += ["reference/scripts/index", "reference/python/index"]
        lines = [f"/{name}" for name in [*names, *more]]
        return "\n```{toctree}\n:hidden:\n\n" + "\n".join(lines) + "\n```\n"

    def copy_pages(self) -> None:
        """Copy all pages."""
        for page, name in self.pages.items():
            text = (ROOT / page).read_text(encoding="utf-8")
            if page.endswith(".ipynb"):
                book = json.loads(text)
                for cell in book["cells"]:
                    if cell["cell_type"] == "markdown":
                        whole = self.relinked(page, "".join(cell["source"]))
                        cell["source"] = whole.splitlines(keepends=True)
                self.write(f"{name}.ipynb", json.dumps(book, indent=1, ensure_ascii=False))
                continue
            if page == "LICENSE":
                text = f"# Licence\n\n{text}"
            # Mermaid diagrams remain text, because a browser would need a script from another
            # server to draw them.
            text = self.relinked(page, text).replace("```mermaid", "```text")
            text = with_cards(text)
            if name == GLOSSARY:
                text = with_index_entries(text)
            own = page.startswith("docs/") and page.endswith("/README.md")
            if own or (ROOT / page).with_suffix("").is_dir():
                text += self.contents(page, (ROOT / page).read_text(encoding="utf-8"))
            self.write(f"{name}.md", text)

    def write_project_index(self) -> None:
        """Write an index of the pages whose sources are outside docs/."""
        own = [name for name in self.pages.values() if name.startswith("project/")]
        lines = "\n".join(f"/{name}" for name in own)
        self.write(
            "project/index.md",
            "# Project\n\nThese pages are the README files of the folders of the source tree, "
            "written for\nthose who read or change the source code. The pages of the "
            f'<a href="../{FORTRAN}/index.html">Fortran source</a>\nlist every module, type and '
            "procedure; they load their style from the network.\n\n"
            f"```{{toctree}}\n:maxdepth: 1\n\n{lines}\n```\n",
        )

    def write_python_reference(self) -> None:
        """Write a page for each public module of the package."""
        sys.path[:0] = [str(ROOT / "post"), str(ROOT / "tests" / "support")]
        from importlib import import_module

        from check_docstrings import MODULES

        names = ["ricochet", *(import_module(f"ricochet.{name}").__name__ for name in MODULES)]
        for name in names:
            module = import_module(name)
            public = sorted(module.__all__)
            listed = "\n".join(f"   {one}" for one in public)
            entries = []
            for one in public:
                kind = "class" if isinstance(getattr(module, one), type) else "function"
                members = "\n   :members:" if kind == "class" else ""
                entries.append(f".. auto{kind}:: {one}{members}\n")
            text = API_HEAD.format(
                short=f"ricochet.{name.rpartition('.')[2]}" if "." in name else name,
                name=name,
                names=listed,
                entries="\n".join(entries),
            )
            self.write(f"reference/python/{name}.md", text)
        self.write_index(
            "python",
            "# Python modules\n\nThis reference lists the public functions and classes of the "
            "package `ricochet`, for those who\nanalyse runs in Python. A module can be imported "
            "without the name of its folder, as in\n`from ricochet import structure`.",
            names,
        )

    def write_index(self, folder: str, text: str, names: list[str]) -> None:
        """Write the index page of a folder of the reference, with links to its other pages."""
        contents = "\n".join(names)
        self.write(
            f"reference/{folder}/index.md",
            f"{text}\n\n```{{toctree}}\n:maxdepth: 1\n\n{contents}\n```\n",
        )

    def write_script_pages(self) -> None:
        """Write a page for each script in post/, based on its command-line parser."""
        drawn = self.figures_of_scripts()
        names = []
        for path in sorted((ROOT / "post").glob("*.py")):
            parser = parser_of(path)
            if parser is None:
                continue
            names.append(path.stem)
            text = f"# {path.name}\n\n{prose(parser.description or '')}\n\n## Options\n\n"
            text += "| option | meaning |\n|---|---|\n" + "".join(options_of(parser))
            for figure in drawn.get(path.stem, []):
                text += f"\n![{figure}]({posixpath.relpath(figure, 'docs/reference/scripts')})\n"
            self.pages[f"docs/reference/scripts/{path.stem}.md"] = f"reference/scripts/{path.stem}"
            page = self.relinked(f"docs/reference/scripts/{path.stem}.md", text)
            self.write(f"reference/scripts/{path.stem}.md", page)
        self.write_index(
            "scripts",
            "# Options of each script\n\nThese pages are generated from the parsers of the scripts "
            "in `post/`; `--help` prints the same\ntext.",
            names,
        )

    def figures_of_scripts(self) -> dict[str, list[str]]:
        """Return, for each script in post/, the figures on the pages that it has drawn."""
        shown = {path.name: path.relative_to(ROOT).as_posix() for path in DOCS.rglob("*.png")}
        found: dict[str, list[str]] = {}
        for path in sorted((ROOT / "runs").glob("*.sh")):
            text = path.read_text(encoding="utf-8").replace("\\\n", " ")
            for line in text.splitlines():
                script = re.search(r"post/(\w+)\.py", line)
                name = re.search(r"\$figures/([\w-]+\.png)", line)
                if script and name and name[1] in shown:
                    found.setdefault(script[1], []).append(shown[name[1]])
        return found


def with_cards(text: str) -> str:
    """Convert each list that follows the comment `<!-- cards -->` to a grid of cards."""

    def grid(found: re.Match) -> str:
        cards = [
            f":::{{grid-item-card}} {title}\n{words[2:3].upper()}{words[3:]}\n:::\n"
            for title, words in re.findall(
                r"^- \*\*(.*?)\*\*(.*(?:\n  .*)*)", found[1], re.MULTILINE
            )
        ]
        return "::::{grid} 1 2 2 3\n:gutter: 2\n\n" + "\n".join(cards) + "::::\n"

    return re.sub(r"^<!-- cards -->\n((?:- .*\n(?:  .*\n)*)+)", grid, text, flags=re.MULTILINE)


def with_index_entries(text: str) -> str:
    """Mark the terms of the glossary as index entries, so that a search finds them first.

    A table row explains the term in its first column or, after a symbol, the words at the beginning
    of its second column.
    """

    def mark(words: str) -> str:
        return f"{{index}}`{words} <!{words}>`"

    def marked(found: re.Match) -> str:
        first, second = found[1], found[2]
        begin = re.match(r"[a-zA-Z][a-zA-Z -]{3,}?(?=[:;,]| \(| and |$)", second)
        if re.fullmatch("[a-zA-Z]{2,}[a-zA-Z -]*", first):
            first = mark(first)
        elif begin:
            second = mark(begin[0]) + second[begin.end() :]
        return f"| {first} | {second} |"

    head, tables, rest = text.partition("## Symbols")
    return head + tables + re.sub(r"^\| (?!symbol|term)(.+?) \| (.+) \|$", marked, rest, flags=re.M)


class ParserFoundError(Exception):
    """Exception that stops a script when it parses its command line."""


def parser_of(path: Path) -> argparse.ArgumentParser | None:
    """Return the parser of a script, which is stopped when it parses its command line, or None."""
    source = importlib.util.spec_from_file_location(f"script_{path.stem}", path)
    module = importlib.util.module_from_spec(source)
    source.loader.exec_module(module)
    if not hasattr(module, "main"):
        return None
    found: list[argparse.ArgumentParser] = []

    def parse(self: argparse.ArgumentParser, *_: object) -> None:
        found.append(self)
        raise ParserFoundError

    with (
        mock.patch.object(argparse.ArgumentParser, "parse_known_args", parse),
        mock.patch.object(sys, "argv", [path.name]),
        contextlib.suppress(ParserFoundError),
    ):
        module.main()
    return found[0] if found else None


def escaped(text: str) -> str:
    """Escape characters with a special meaning in Markdown, except in code."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(
        part if part.startswith("`") else re.sub(r"([*_<>|$\\\[\]])", r"\\\1", part)
        for part in parts
    )


def prose(description: str) -> str:
    """Convert the description of a script to Markdown, with indented lines as code."""
    paragraphs = re.split(r"\n\s*\n", description.strip())
    code = [paragraph.startswith("    ") for paragraph in paragraphs]
    return "\n\n".join(
        f"```text\n{textwrap.dedent(one)}\n```" if is_code else escaped(one)
        for one, is_code in zip(paragraphs, code, strict=True)
    )


def options_of(parser: argparse.ArgumentParser) -> Iterator[str]:
    """Yield a table row for each option of a parser."""
    for action in parser._actions:
        if action.dest == "help" or action.help == argparse.SUPPRESS:
            continue
        value = action.metavar or ("" if action.nargs == 0 else action.dest.upper())
        value = " ".join(value) if isinstance(value, tuple) else value
        names = ", ".join(f"`{name}`" for name in action.option_strings)
        title = f"{names} {escaped(value)}" if names else f"`{value}`"
        yield f"| {title.strip()} | {escaped(' '.join((action.help or '').split()))} |\n"


class Page(HTMLParser):
    """Parser that collects links, anchors and text of an HTML page of the site."""

    def __init__(self, path: Path) -> None:
        """Read a page."""
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.anchors: set[str] = set()
        self.words: list[str] = []
        self.articles = 0  # number of enclosing elements <article>
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.articles += tag == "article"
        self.anchors |= {value for key in ("id", "name") if (value := given.get(key))}
        self.links += [value for key in ("href", "src") if (value := given.get(key))]
        loaded = given.get("href") if given.get("rel") == "stylesheet" else given.get("src")
        self.loaded += [loaded] if loaded else []

    def handle_endtag(self, tag: str) -> None:
        self.articles -= tag == "article"

    def handle_data(self, data: str) -> None:
        if self.articles:
            self.words += data.replace("¶", "").split()


def pages_of(site: Path) -> dict[Path, Page]:
    """Return all pages of the site except those generated by FORD."""
    return {path: Page(path) for path in site.rglob("*.html") if FORTRAN not in path.parts}


def write_excerpts(site: Path) -> None:
    """Write the script of the search page."""
    texts = {
        path.relative_to(site).as_posix(): html.escape(" ".join(page.words), quote=False)
        for path, page in sorted(pages_of(site).items())
        if path.name not in OWN
    }
    script = EXCERPTS.format(texts=json.dumps(texts, ensure_ascii=False))
    (site / "_static" / "excerpts.js").write_text(script, encoding="utf-8")


def broken(site: Path) -> list[str]:
    """Return the broken links of the site, except links on pages generated by FORD.

    Scripts, styles and pictures from other servers also count as broken, because the site must work
    without a network.
    """
    pages = pages_of(site)
    found = []
    for path, page in pages.items():
        found += [
            f"{path.relative_to(site)}: {link}" for link in page.loaded if urlsplit(link).netloc
        ]
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            anchor = unquote(parts.fragment)
            lost = not target.exists() or (
                anchor and target in pages and anchor not in pages[target].anchors
            )
            if lost:
                found.append(f"{path.relative_to(site)}: {link}")
    return sorted(set(found))


def main(build: Path) -> int:
    """Build the site; return 0 if Sphinx printed no warning and no link is broken."""
    site, stage = build / "docs", Stage(build / "docs-sources")
    stage.copy_pages()
    stage.write_project_index()
    stage.write_python_reference()
    stage.write_script_pages()
    stage.tidy()
    program = os.environ.get("RICOCHET", str(build / "ricochet"))
    own = {"RICOCHET": program, "PYTHONPATH": str(ROOT / "post")}
    environment = os.environ | own | {"RICOCHET_SITE_CACHE": str(build / "docs-cache")}
    command = [sys.executable, "-m", "sphinx", "-a", "-W", "--keep-going", "-q", "-j", "auto"]
    command += ["-c", str(DOCS), "-d", str(build / "docs-doctrees"), str(stage.folder), str(site)]
    status = subprocess.run(command, env=environment, check=False).returncode
    names = {path.relative_to(stage.folder).with_suffix(".html") for path in stage.written}
    for path in site.rglob("*.html"):
        name = path.relative_to(site)
        made_by_sphinx = name.parts[0] in ("_static", "_downloads", FORTRAN) or name.name in OWN
        if not made_by_sphinx and name not in names:  # left by an earlier call
            path.unlink()
    write_excerpts(site)
    if status == 0 and not (site / FORTRAN / "index.html").exists():
        print(f"{site}/{FORTRAN}: the pages of the Fortran source are missing", file=sys.stderr)
        status = 1
    if status == 0 and (lost := broken(site)):
        print(*(f"broken link: {link}" for link in lost), sep="\n", file=sys.stderr)
        status = 1
    shutil.rmtree(site / ".doctrees", ignore_errors=True)
    return status


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    sys.exit(main(Path(sys.argv[1]).resolve()))
