"""Tests of the documentation: links, names of procedures, commands, examples and numbers."""

import importlib.util
import json
import re
import shutil
import sys
import textwrap
import tomllib
from pathlib import Path

import numpy as np
import pytest

from check_docstrings import members_of
from ricochet import Run, packages
from synthetic_run import ROOT, run_code, write_run
from test_pages import run_shell
from whole_runs import environment, ran

PLACES = ("*.md", "docs/**/*.md", "*/README.md", "src/*/README.md")
PAGES = sorted(page for place in PLACES for page in ROOT.glob(place))
TOUR = ROOT / "docs" / "tutorials" / "tour.ipynb"
ELSEWHERE = ("http://", "https://", "mailto:", "#")


def path_of(page):
    """Return the path of a page in the root of the project or anywhere in docs/."""
    root = ROOT / f"{page}.md"
    (path,) = [root] if root.exists() else ROOT.glob(f"docs/*/{page}.md")
    return path


def section(page, heading):
    """Return the text below a heading of a page, including subheadings."""
    text = path_of(page).read_text()
    level = len(heading) - len(heading.lstrip("#"))
    return re.search(rf"^{heading}$(.*?)(?=^#{{1,{level}}} |\Z)", text, re.M | re.S)[1]


def script_in_docs(name):
    """Import a script of docs/ as a module."""
    source = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    module = importlib.util.module_from_spec(source)
    source.loader.exec_module(module)
    return module


def test_the_input_pages_are_current(program):
    pages = script_in_docs("input_page").pages(program)
    old = [path for path, text in pages.items() if (ROOT / path).read_text() != text]
    assert old == [], "make them anew: python docs/input_page.py build/ricochet"
    assert {
        f"docs/reference/input/{path.name}" for path in ROOT.glob("docs/reference/input/*.md")
    } <= {*pages}


def test_the_page_of_a_group_lists_all_its_variables(program):
    """The variables of the collision rule are described on a page of their own."""
    pages = script_in_docs("input_page").pages(program)
    for group, entries in json.loads(ran(program, "--print-variables").stdout).items():
        listed = re.findall(r"^\| \[`(\w+)`\]", pages[f"docs/reference/input/{group}.md"], re.M)
        assert sorted(listed) == sorted(entries)


def test_the_other_reference_pages_are_current(program):
    pages = script_in_docs("reference_pages").pages(program)
    old = [path for path, text in pages.items() if (ROOT / path).read_text() != text]
    assert old == [], "make them anew: python docs/reference_pages.py build/ricochet"


def test_the_queues_on_the_page_are_those_of_the_engine(program):
    engine = program.parent / "tests" / "four_disks"
    if not engine.exists():
        pytest.skip("make test builds it")
    pages = script_in_docs("queue_page")
    tables = [pages.table(*state) for state in pages.states(engine)]
    page = textwrap.dedent(path_of("how-it-works").read_text()).replace("\n    ", "\n")
    assert [table for table in tables[:-1] if table not in page] == []


def sections_of(page):
    """Return the headings of a page in the form used by links."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.M)
    return [re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_what_a_page_leads_to_and_names_is_there(page):
    text = page.read_text()
    links = re.findall(r"\]\(([^)\s]+)\)", text)
    local = [link.partition("#") for link in links if not link.startswith(ELSEWHERE)]
    assert [name for name, _, _ in local if not (page.parent / name).exists()] == []
    sections = [(page.parent / name, section) for name, _, section in local if section]
    sections += [(page, link[1:]) for link in links if link.startswith("#")]
    assert [section for path, section in sections if section not in sections_of(path)] == []
    folders, endings = "post|runs|input|tests|src|docs", "py|sh|nml|f90|pf"
    named = re.findall(rf"\b((?:{folders})/(?:\w+/)*\w+\.(?:{endings})\b)", text)
    new = re.findall(r"`((?:src|post|tests)/\S+)`, a new file|[Cc]reate a\s+file\s+`(\S+)`", text)
    mine = {"runs/mine.nml", *(name for pair in new for name in pair)}
    missing = [name for name in named if not (ROOT / name).exists()]
    assert [name for name in missing if name not in mine and name == name.lower()] == []


@pytest.mark.parametrize(
    ("page", "heading"), [("promises", "## Promises"), ("inside", "## Invariants")]
)
def test_promises_are_held_by_tests_and_modules_that_exist(page, heading):
    """The second column of each table names tests, the third modules or scripts."""
    sources = [*ROOT.glob("tests/**/*.py"), *ROOT.glob("tests/**/*.pf")]
    known = re.findall(
        r"^def test_(\w+)|^  subroutine (\w+)", "".join(p.read_text() for p in sources), re.M
    )
    known = {name for pair in known for name in pair}
    rows = re.findall(r"^\|(?: [^|]+ \|){2,3}$", section(page, heading), re.M)[1:]
    cells = [re.split(r" *\| *", row.replace("\\|", ""))[2:-1] for row in rows]
    named = [word for cell in cells for word in re.findall(r"`(\w+)`", cell[0])]
    assert len(named) > 10
    assert [word for word in named if word not in known] == []
    keepers = [
        word for _, *last in cells for cell in last for word in re.findall(r"`(\w[\w/.]*\w)`", cell)
    ]
    places = [ROOT / word if "." in word else ROOT / "src" / f"{word}.f90" for word in keepers]
    assert [str(place) for place in places if not place.exists()] == []


def procedures_of(module):
    """Return the names of all procedures in a module such as `physics/collisions`."""
    path = ROOT / "src" / f"{module}.f90"
    code = path.read_text() if path.exists() else ""
    return re.findall(r"^ *(?!end\b)[^!'\"\n]*?\b(?:subroutine|function) +(\w+) *\(", code, re.M)


def test_procedures_that_are_named_exist():
    """Each name `folder/file: procedure` on the page `inside` is a procedure in src/."""
    page = path_of("inside").read_text()
    named = re.findall(r"`((?:\w+/)?\w+): (\w+)`", page)
    assert len(named) > 30
    missing = [f"{module}: {name}" for module, name in named if name not in procedures_of(module)]
    for file, name in re.findall(r"`(\w+/\w+\.c): (\w+)`", page):
        if f" {name}(" not in (ROOT / "src" / file).read_text():
            missing.append(f"{file}: {name}")
    assert missing == []


def called(build, *words, cwd):
    """Return the (module, procedure) pairs that a run calls, if built with --coverage."""
    for counts in build.glob("*.gcda"):
        counts.unlink()
    ran(build / "ricochet", *words, cwd=cwd)
    gcov = ["gcov", "--json-format", "--stdout", *sorted(build.glob("*.gcda"))]
    lines = ran(*gcov, cwd=build, check=True).stdout.splitlines()
    files = [file for line in lines for file in json.loads(line)["files"]]
    return {
        (Path(file["file"]).stem, re.sub(r"^__\w+?_MOD_|\.\d+$", "", function["name"]))
        for file in files
        for function in file["functions"]
        if function["execution_count"] > 0
    }


@pytest.mark.check
def test_procedures_that_are_named_are_called_in_their_examples(tmp_path):
    if not shutil.which("gcov"):
        pytest.skip("gcov counts the calls")
    build = tmp_path / "build"
    flags = "OPT=-O0 --coverage -Wno-maybe-uninitialized"
    make = ["make", "-j2", flags, f"BUILD={build}", "all"]
    ran(*make, cwd=ROOT, env=environment(), check=True)
    (tmp_path / "input").symlink_to(ROOT / "input")
    page = section("inside", "## Where is it decided …\\?")
    short = dict(re.findall(r"^- \*(\w+)\*: `([^`]+)`$", page, re.M))
    rows = re.findall(r"^\| (.+) \| (.+) \| ?(.*) \|$", page, re.M)
    rows = [row for row in rows if row[2] not in ("-", "seen in")]
    assert len(rows) > 40 and len(short) == 3
    calls, missing = {}, []
    for question, answer, cell in rows:
        commands = re.sub(r"\*(\w+)\*", lambda name: f"`{short[name[1]]}`", cell)
        examples = re.findall(r"`([^`]+)`", commands) or ["gas.nml"]
        for example in examples:
            if example not in calls:
                first, *options = example.split()
                name = first if first.startswith("-") else f"input/{first}"
                known = (tmp_path / "runs" / first).with_suffix(".h5").exists()
                force = ["--force"] * (known and "--resume" not in options)
                calls[example] = called(build, name, *options, *force, cwd=tmp_path)
        seen = set().union(*(calls[example] for example in examples))
        for file, procedure in re.findall(r"`(?:\w+/)?(\w+)(?:\.c)?: (\w+)`", answer):
            if (file, procedure) not in seen:
                missing.append(f"{question}: {file}: {procedure}")
    assert missing == []


@pytest.mark.parametrize("folder", sorted(p.name for p in ROOT.glob("src/*/")))
def test_every_folder_introduces_its_modules(folder):
    """The README of each folder names all modules above the table of their tests."""
    page = (ROOT / "src" / folder / "README.md").read_text().split("## Tests")[0]
    modules = [path.stem for path in (ROOT / "src" / folder).glob("*.f90")]
    assert [name for name in modules if not re.search(rf"`{name}\b", page)] == []


def test_links_to_the_laboratory_set_values_that_the_program_accepts(ricochet):
    links = {link for page in PAGES for link in re.findall(r"#input=[^)`\s]+", page.read_text())}
    shown = json.loads((ROOT / "input/chooser.json").read_text())
    assert len(links) > 8
    for link in links:
        name, *settings = link.removeprefix("#input=").split("&")
        assert name in shown
        for setting in settings:  # the form knows variables by name, not their elements
            assert re.fullmatch(r"[\w.]+=[^=]+", setting), link
        words = [word for one in settings for word in ("--set", one)]
        done = ricochet(ROOT / f"input/{name}.nml", *words, "--check")
        assert done.returncode == 0, done.stderr


def test_options_that_are_named_exist(program):
    """All options of ricochet in code blocks of the pages exist."""
    known = ran(program, "--help", check=True).stdout
    for page in PAGES:
        for line in page.read_text().splitlines():
            if re.match(r"    (build/)?ricochet ", line):
                for option in re.findall(r"\s(--[a-z-]+)", line.split("#")[0]):
                    assert option in known, f"{page.name}: {line}"


def test_the_numbers_of_the_tasks_are_those_of_their_tables():
    pages = script_in_docs("tasks_page")
    numbers = json.loads((ROOT / "docs" / "tasks.json").read_text())
    other = {name: (mean + 1, error) for name, (mean, error) in numbers.items()}
    texts = [path_of(name).read_text() for name in pages.PAGES]
    for text in texts:
        assert pages.filled(text, numbers) == text, "make it anew: python docs/tasks_page.py"
        assert pages.filled(text, other) != text
    assert [name for name in pages.TEXTS if f"<!-- {name} -->" not in "".join(texts)] == []


@pytest.mark.check
def test_the_studies_give_the_numbers_of_the_tasks(program, tmp_path, monkeypatch):
    """Exercises that take less than a minute are repeated, and agree within their errors."""
    (tmp_path / "runs").mkdir()
    for script in (ROOT / "runs").glob("*.sh"):
        shutil.copy(script, tmp_path / "runs")
    for name in ("input", "post"):
        (tmp_path / name).symlink_to(ROOT / name)
    own = environment(PYTHON=sys.executable, RICOCHET=program)
    for study in ("mixture", "cooling"):
        ran(tmp_path / f"runs/{study}.sh", env=own, check=True)
    pages = script_in_docs("tasks_page")
    monkeypatch.setattr(pages, "TABLES", tmp_path / "runs" / "figures")
    known = json.loads((ROOT / "docs" / "tasks.json").read_text())
    found = pages.mixture() | pages.cooling()
    for name in known.keys() & found.keys():
        (mean, error), (before, before_error) = found[name], known[name]
        assert abs(mean - before) <= 4 * np.hypot(error or 1e-9, before_error or 1e-9), name


def test_make_lists_its_targets_in_one_screen_and_suggests_them():
    screen = ran("make", "help", cwd=ROOT).stdout.splitlines()
    assert len(screen) <= 24 and max(map(len, screen)) <= 80
    names = ("demo", "test", "unit-tests", "figures", "check", "bench", "lint", "docs", "clean")
    for target in names:
        assert any(line.startswith(f"  make {target} ") for line in screen)
    wrong = ran("make", "tset", cwd=ROOT)
    assert wrong.returncode == 2 and "no file tset; did you mean test?" in wrong.stderr


def test_workflows_take_fixed_actions_and_may_only_read():
    for workflow in ROOT.glob(".github/workflows/*.yml"):
        text = workflow.read_text()
        actions = re.findall(r"uses: *(.*)", text)
        fixed = [action for action in actions if re.search(r"@[0-9a-f]{40} # v\d", action)]
        assert actions == fixed
        assert "\npermissions:\n  contents: read\n" in text


def test_every_script_of_post_is_in_the_list():
    page = path_of("scripts").read_text()
    scripts = [p.name for p in ROOT.glob("post/*.py") if "def main()" in p.read_text()]
    assert [name for name in scripts if not re.search(rf"^\|.*`{name}`.*\| ", page, re.M)] == []


def test_every_observable_is_on_the_page_on_output():
    source = (ROOT / "src" / "physics" / "observables.f90").read_text()
    names = re.findall(r'call list%add\((?:(?:group|path)//)?"/?(\w+)"', source)
    known = section("output", "## /observables")
    assert len(names) > 20 and [name for name in names if f"{name}`" not in known] == []


@pytest.fixture
def at_work(tmp_path, program, monkeypatch):
    """Return a new folder as working directory, with RICOCHET naming the program."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RICOCHET", str(program))
    return tmp_path


def test_the_code_that_the_page_on_output_shows_reads_a_run(tmp_path, monkeypatch):
    lines = section("output", "## Reading it").splitlines()
    code = "\n".join(line[4:] for line in lines if line.startswith("    "))
    assert "from ricochet import read_run" in code and "import h5py" in code
    (tmp_path / "runs").mkdir()
    x = np.random.default_rng(1).uniform(size=(2, 30, 2))
    names = "all/kinetic_energy", "total_energy", "virial_pressure"
    energies = {name: [0.0, 0.0] for name in names}
    for name, periodic in (("gas", (False, False)), ("bulk", (True, True))):
        path = tmp_path / "runs" / f"{name}.h5"
        write_run(path, x, x, observables=energies, periodic=periodic)
    monkeypatch.chdir(tmp_path)
    run_code(code)
    assert (tmp_path / "runs" / "gas.png").exists()


def test_the_code_that_the_page_on_runs_shows_runs_the_program(at_work, program, capfd):
    code = []
    for page, title in (
        ("README", "## In Python"),
        ("runs-in-python", "## One run"),
        ("runs-in-python", "## A simulation in memory"),
        ("runs-in-python", "## Many runs"),
    ):
        code += re.findall(r"^    (?!build/).*", section(page, title), re.M)
    code.append("    assert box.collisions == 3000")
    run_code(textwrap.dedent("\n".join(code)))
    said = capfd.readouterr()
    assert said.err == ""
    assert "<Run " in said.out and "Name: virial_pressure" in said.out
    energies = [float(line) for line in said.out.splitlines() if re.fullmatch(r"[\d.]+", line)][:3]
    assert len(set(energies)) == 3 and all(0 < energy < 250 for energy in energies)
    memory = section("runs-in-python", "## A simulation in memory")
    (again,) = re.findall(r"^    build/ricochet (.*)", memory, re.M)
    ran(program, *again.split(), check=True)


@pytest.mark.statistics
def test_the_code_on_time_correlations_of_the_page_on_output_works(at_work, program, capfd):
    """The example is executed with two seeds, a tenth of the disks and a fiftieth of the time.

    Each of the four runs starts from a dense packing, which takes most of the time.
    """
    page = section("output", "## Time correlations and structure")
    blocks = [textwrap.dedent(one) for one in re.findall(r"(?:^    .*\n)+", page, re.M)]
    assert len(blocks) == 3
    text = (ROOT / "input" / "glass.nml").read_text()
    for old, new in (("38.603", "12.2075"), ("count = 500", "count = 50"), ("1001", "20.5")):
        assert old in text
        text = text.replace(old, new)
    for folder in ("input", "runs", "build"):
        (at_work / folder).mkdir()
    (at_work / "input" / "glass.nml").write_text(text)
    (at_work / "build" / "ricochet").symlink_to(program)
    (at_work / "post").symlink_to(ROOT / "post")
    run_shell(blocks[0].replace("\\\n", "").replace("1 2 3 4", "1 2"))
    assert "F_s_small,0.78" in (at_work / "runs" / "glass.csv").read_text()
    code = "\n".join(blocks[1:]).replace("1000", "50").replace("100, apart", "10, apart")
    code = code.replace("(1, 2, 3, 4)", "(1, 2)")
    code += "assert msd[0] == 0 and error[5] > 0 and g.y.max() > 3 and memory.done == len(times)"
    capfd.readouterr()
    run_code(code.replace("until=400", "until=10"))
    assert capfd.readouterr().err == ""


def test_the_code_on_transport_of_the_page_on_output_works(at_work, capfd):
    """The example is executed with two seeds and a thousandth of the time."""
    page = section("output", "## Transport coefficients")
    blocks = [textwrap.dedent(one) for one in re.findall(r"(?:^    .*\n)+", page, re.M)]
    (at_work / "runs").mkdir()
    for name in ("input", "post"):
        (at_work / name).symlink_to(ROOT / name)
    shell = blocks[0].replace("runs/ensemble.sh", str(ROOT / "runs" / "ensemble.sh"))
    run_shell(shell.replace("\\\n", "").replace("1-4", "1-2").replace("100000", "100"))
    assert (at_work / "runs" / "carried.csv").read_text().count("conductivity") > 3
    code = "".join(blocks[1:]).replace(", 3, 4)", ")").replace("2000", "200")
    run_code(code + "assert temperature.shape == (8,)\n")
    assert "mean=" in capfd.readouterr().out


def test_there_is_one_version(program):
    """Program, CHANGELOG and citation file agree in version and date."""
    said = ran(program, "--version", check=True).stdout
    init = (ROOT / "post/ricochet/__init__.py").read_text()  # pip takes it from there
    packaged = re.search(r'^__version__ = "(.*)"$', init, re.M)[1]
    page, cited = ((ROOT / name).read_text() for name in ("CHANGELOG.md", "CITATION.cff"))
    version, date = re.search(r"^## ([\d.]+) \((.*)\)$", page, re.M).groups()
    assert said.split()[1] == packaged == version
    assert f"\nversion: {version}\ndate-released: {date}\n" in cited


def test_the_citation_contains_what_its_schema_requires():
    """The schema 1.2.0 of the citation file format requires four keys."""
    cited = (ROOT / "CITATION.cff").read_text()
    assert re.search(r"^cff-version: 1\.2\.0$", cited, re.M)
    assert re.search(r"^authors:\n  - name: \S", cited, re.M)
    assert {"message", "title"} <= set(re.findall(r"^(\w+): \S", cited, re.M))


COMPLETION = ROOT / "docs" / "ricochet-completion.bash"


def completed(program, *words):
    """Return the completions that bash proposes for the last word."""
    script = """source "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _ricochet
    printf '%s\\n' "${COMPREPLY[@]}" """
    command = ["bash", "-c", script, "bash", COMPLETION, program, *words]
    result = ran(*command, cwd=ROOT, check=True)
    assert result.stderr == ""
    return result.stdout.split()


def test_completion_knows_options_variables_values_and_files(program):
    assert completed(program, "--res") == ["--resume"]
    assert completed(program, "input/gas") == ["input/gas.nml"]
    assert completed(program, "inp") == ["input"]
    assert completed(program, "--explain", "shear") == ["shear_rate"]
    assert {"contact", "contact_time", "contact.wall_rule"} <= {
        *completed(program, "--explain", "con")
    }
    assert completed(program, "--explain", "stop.wa") == ["stop.wall_clock"]
    assert completed(program, "--set", "drive.k") == ["drive.kind=", "drive.keep_momentum="]
    assert completed(program, "input/gas.nml", "--set", "run.s") == ["run.seed=", "run.search="]
    assert completed(program, "--set", "run.queue", "=", "he") == ["heap"]
    assert completed(program, "--set", "run.queue", "=") == ["calendar", "heap"]
    assert completed(program, "--set", "output.event_log", "=", ".t") == [".true."]
    assert completed(program, "--set", "run.seed", "=") == []
    named = completed(program, "input/crater.nml", "--set", "species.projectile.v")
    assert named == ["species.projectile.velocities=", "species.projectile.velocity="]
    assert completed(program, "--set", "box.gravity(") == ["box.gravity(1)=", "box.gravity(2)="]
    assert completed(program, "--set", "'box.gravity(2") == ["box.gravity(2)="]
    assert completed(program, "--set", "box.boundary(2)", "=", "p") == ["periodic"]
    placement = ["--set", "species.bed.placement", "="]
    assert completed(program, "input/crater.nml", *placement, "d") == ["dense"]


def test_completion_knows_ensembles(program, tmp_path):
    (tmp_path / "ricochet").symlink_to(program)
    ensemble = tmp_path / "ricochet-ensemble"
    ensemble.symlink_to(ROOT / "runs" / "ensemble.sh")
    assert completed(ensemble, "--se") == ["--seeds", "--set"]
    assert completed(ensemble, "input/gas") == ["input/gas.nml"]
    assert completed(ensemble, "--scan", "species.gr") == ["species.grid="]
    assert completed(ensemble, "--scan", "run.queue", "=", "he") == ["heap"]
    assert completed("runs/ensemble.sh", "--sc") == ["--scan"]
    known = 'source "$1"; complete -p ricochet ricochet-ensemble runs/ensemble.sh'
    ran("bash", "-c", known, "bash", COMPLETION, check=True)


# --- the notebook: all cells can be executed, and show the results that its text describes ---


def test_one_command_installs_what_the_notebook_needs():
    """It installs Jupyter, its kernel, and all packages that the cells import."""
    wanted = {"ipykernel", "jupyterlab", "pandas"}
    lines = (ROOT / "requirements.txt").read_text().splitlines()
    installed = {line.split("==")[0] for line in lines if re.search(r"==.*#.*\bnotebook\b", line)}
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert installed == set(extras["optional-dependencies"]["notebook"]) == wanted
    cells = json.loads(TOUR.read_text())["cells"]
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    imported = set(re.findall(r"^(?:import|from) (\w+)", code, re.M)) - {"ricochet"}
    assert imported <= installed | set(packages.needed)
    said = ran("make", "-n", "notebook", cwd=ROOT)
    assert ".ci/set-up demo notebook" in said.stdout and "docs/tutorials/tour.ipynb" in said.stdout
    assert "make notebook" in cells[0]["source"][-2] + cells[0]["source"][-1]


def test_the_page_says_all_that_a_run_can_do():
    page = path_of("output").read_text().partition("What a `Run` can do")[2]
    names = {name for name in (*Run.__dataclass_fields__, *members_of(Run)) if name[0] != "_"}
    assert [name for name in sorted(names) if not re.search(rf"`{name}\b", page)] == []


@pytest.mark.check
def test_each_cell_shows_what_it_promises(program, monkeypatch):
    """The cells show figures, a film, a conserved energy and an error message, but no warning."""
    nbclient = pytest.importorskip("nbclient")
    import nbformat

    notebook = nbformat.read(TOUR, as_version=4)
    monkeypatch.setenv("RICOCHET", str(program))
    kernel = {"kernel_name": "python3", "timeout": 300}
    folder = {"metadata": {"path": str(TOUR.parent)}}
    nbclient.NotebookClient(notebook, resources=folder, **kernel).execute()
    cells = [(one.source, shown(one)) for one in notebook.cells if one.cell_type == "code"]
    drawn = [output for source, output in cells if "plt.subplots" in source]
    assert len(drawn) == 6 and all("image/png" in output for output in drawn)
    assert "next: [(" in showing(cells, "heated.next_events")
    assert "<iframe" in showing(cells, "Film(run")
    assert float(showing(cells, "largest relative").split(":")[1]) < 1e-12
    assert "contact.restitution" in showing(cells, "except ricochet.ProgramError")
    assert [source for source, output in cells if "Warning" in output] == []


def shown(cell):
    """Return the output of a notebook cell as a single text."""
    return "\n".join(
        str(output.get("text", "")) + "\n".join(map(str, output.get("data", {}).items()))
        for output in cell.outputs
    )


def showing(cells, code):
    """Return the output of the only notebook cell that contains the given code."""
    (found,) = [output for source, output in cells if code in source]
    return found
