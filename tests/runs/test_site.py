"""Tests of docs/build_site.py, which collects the pages of the documentation site for Sphinx."""

import importlib.util
import json
import re

import pytest

import wrap_pages
from synthetic_run import ROOT

KINDS = ("tutorials", "guides", "reference", "explanation")


@pytest.fixture(scope="module")
def site():
    """Return the script docs/build_site.py as a module."""
    source = importlib.util.spec_from_file_location("build_site", ROOT / "docs" / "build_site.py")
    module = importlib.util.module_from_spec(source)
    source.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def stage(site, tmp_path_factory):
    """Return the folder with the sources of the site."""
    made = site.Stage(tmp_path_factory.mktemp("site"))
    made.copy_pages()
    made.write_project_index()
    made.write_python_reference()
    made.write_script_pages()
    return made


def test_each_page_stands_in_one_table_of_contents(stage):
    listed = []
    for page in stage.folder.rglob("*.md"):
        for block in re.findall(r"^```{toctree}\n(.*?)^```", page.read_text(), re.M | re.S):
            for name in re.findall(r"^[/\w].*$", block, re.M):
                folder = stage.folder if name[0] == "/" else page.parent
                listed.append((folder / name.lstrip("/")).relative_to(stage.folder).as_posix())
    pages = [*stage.folder.rglob("*.md"), *stage.folder.rglob("*.ipynb")]
    names = {page.relative_to(stage.folder).with_suffix("").as_posix() for page in pages}
    assert sorted(listed) == sorted(names - {"index"})


def test_links_lead_to_pages_and_files_of_the_site(stage):
    for page in stage.folder.rglob("*.md"):
        links = re.findall(r"\]\(([^)\s#]+)", page.read_text())
        local = [link for link in links if not re.match(r"\w+:", link)]
        assert [link for link in local if not (page.parent / link).is_file()] == [], page
    page = "docs/explanation/inside.md"
    same = "../reference/output.md#observables"
    assert stage.target(page, same) == same
    assert stage.target(page, "../../CHANGELOG.md") == "../project/changelog.md"
    assert stage.target(page, "../../input/gas.nml") == "../files/input/gas.nml"
    assert (stage.folder / "files/input/gas.nml").read_bytes() == (
        ROOT / "input/gas.nml"
    ).read_bytes()
    with pytest.raises(SystemExit, match="leads nowhere"):
        stage.target(page, "theorie.md")


def test_no_page_is_long():
    """Pages have at most 400 lines, except generated ones."""
    longer = [*ROOT.glob("docs/reference/input/*.md"), ROOT / "docs/explanation/validation.md"]
    pages = [ROOT / "README.md", *(p for p in ROOT.glob("docs/**/*.md") if p not in longer)]
    assert {p.name: n for p in pages if (n := p.read_text().count("\n")) > 400} == {}
    assert (ROOT / "README.md").read_text().count("\n") <= 95


def test_the_readme_leads_to_each_kind_of_page():
    readme = (ROOT / "README.md").read_text()
    assert [kind for kind in KINDS if f"(docs/{kind}/README.md)" not in readme] == []


def test_links_that_lead_nowhere_are_found(site, tmp_path):
    (tmp_path / "a.html").write_text(
        """<h1 id="top">A</h1> <a href="b.html#part">b</a> <a href="#top">top</a>
        <a href="https://example.org">elsewhere</a> <img src="lost.png">
        <a href="b.html#gone">b</a> <script src="https://example.org/a.js"></script>"""
    )
    (tmp_path / "b.html").write_text('<p id="part">B</p><a href="sub/">folder</a>')
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "index.html").write_text("<p>")
    lost = ["b.html#gone", "https://example.org/a.js", "lost.png"]
    assert site.broken(tmp_path) == [f"a.html: {link}" for link in lost]


def test_every_module_of_the_python_reference_lists_its_names(stage):
    import ricochet

    page = (stage.folder / "reference/python/ricochet.md").read_text()
    assert [name for name in ricochet.__all__ if f"   {name}\n" not in page] == []
    assert ".. autofunction:: run\n" in page and ".. autoclass:: Run\n" in page


def test_each_script_has_a_page_with_its_options(stage):
    page = (stage.folder / "reference/scripts/speeds.md").read_text()
    assert "| `--frames` " in page and "2 \\<v^2\\>^2" not in page.split("```")[1]
    scripts = [p.stem for p in (ROOT / "post").glob("*.py") if "def main()" in p.read_text()]
    pages = {path.stem for path in stage.folder.glob("reference/scripts/*.md")}
    assert pages == {*scripts, "index"}


def test_each_term_of_the_glossary_is_a_main_entry_of_the_index(stage):
    """A search for the term lists such an entry before all other pages."""
    page = (stage.folder / "explanation/glossary.md").read_text()
    entries = re.findall(r"\{index\}`([^`]+) <!([^`]+)>`", page)
    assert all(words == entry == words.strip() for words, entry in entries)
    table = (ROOT / "docs/explanation/glossary.md").read_text().partition("## Terms")[2]
    terms = {*re.findall(r"^\| ([\w -]+) \|", table, re.M)} - {"term"}
    names = {entry for _, entry in entries}
    assert len(entries) == len(names)
    assert terms | {"packing fraction", "diffusion coefficient", "pressure"} <= names


def test_the_search_page_has_the_text_of_each_page(site, tmp_path):
    (tmp_path / "_static").mkdir()
    (tmp_path / "sub").mkdir()
    text = '<p>menu</p><article role="main"><h1>A &lt; B<a href="#">¶</a></h1>"1"\n 2</article>end'
    (tmp_path / "sub" / "a.html").write_text(text)
    (tmp_path / "search.html").write_text("<article>form</article>")
    site.write_excerpts(tmp_path)
    script = (tmp_path / "_static" / "excerpts.js").read_text()
    texts = json.loads(script.partition(" = ")[2].partition(";\nwindow.fetch")[0])
    assert texts == {"sub/a.html": 'A &lt; B "1" 2'}


def test_the_lines_of_all_pages_have_one_width():
    """Wrapping changes neither the words of a page nor a page that is already wrapped."""
    for page in wrap_pages.pages():
        text = page.read_text()
        assert wrap_pages.wrapped(text) == text, "python tests/support/wrap_pages.py does it"
        code = "```text\n" + "word " * 40 + "\n```\n| " + "cell " * 40 + "|\n"
        item = "- " + "word " * 20 + "- " + "word " * 20 + "`" + "code " * 9 + "`\n\n"
        long = wrap_pages.wrapped(text + "\n" + item + code)
        assert long.endswith(code) and long.split() == (text + item + code).split()
        lines = long.removeprefix(text).removesuffix(code).split("\n")
        assert not re.search(r"^\s*- ", "\n".join(lines[2:]), re.M)
        assert "`" + "code " * 9 + "`" in long and max(map(len, lines)) <= 125
