"""The recipes of docs/: they fit the sources, and their additions work."""

import re
import shutil
import sys
import textwrap
from pathlib import Path

import h5py
import numpy as np
import pytest

from synthetic_run import ROOT, write_run
from test_docs import path_of, section
from whole_runs import differences, environment, ran


def test_the_analysis_of_a_recipe_works(tmp_path):
    """The module, its script and its test are added to a copy of the package."""
    shutil.copytree(ROOT / "post", tmp_path / "post")
    add_files(section("recipes-that-add-a-file", "## An analysis"), tmp_path)
    v = np.ones((3, 4, 2)) * np.array([1.0, 2.0, 3.0])[:, None, None]
    words = ["post/fastest.py", write_run(tmp_path / "run.h5", 0 * v, v), "-o", "a.pdf"]
    own = environment(PYTHONPATH=f"{tmp_path / 'post'}:{ROOT / 'tests'}")
    said = ran(sys.executable, *words, cwd=tmp_path, env=own, check=True).stdout.split()
    assert said[:4] == ["N", "largest", "4", f"{3 * 2**0.5:.6g}"] and (tmp_path / "a.pdf").exists()
    pytest_words = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "tests/post/test_fastest.py"]
    assert "1 passed" in ran(sys.executable, *pytest_words, cwd=tmp_path, env=own).stdout


def replace_lines(name: str, text: str, old: list[str], new: list[str]) -> str:
    """Replace complete lines of a file, found irrespective of their indentation."""
    pattern = "".join(rf"^( *){re.escape(line.strip())}\n" for line in old)
    places = [*re.finditer(pattern, text, re.MULTILINE)]
    how = f"{name} contains these lines of a recipe {len(places)} times instead of once"
    assert len(places) == 1, f"{how}; adapt docs/explanation/recipes.md:\n" + "\n".join(old)
    (found,) = places
    lines = [f"{found[1]}{line}\n" if line.strip() else "\n" for line in new]
    return text[: found.start()] + "".join(lines) + text[found.end() :]


def add_files(page: str, root: Path) -> None:
    """Write the new files that a page contains."""
    for name, code in new_files(page):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(code)


def new_files(page: str) -> list[tuple[str, str]]:
    """Return the names and the contents of the new files that a page contains."""
    file = r"`((?:src|post|tests)/\S+)`, a new file:\n\n((?:    .*\n|\n)+)"
    return [
        (name, textwrap.dedent(code).rstrip("\n") + "\n") for name, code in re.findall(file, page)
    ]


def changed_files(page: str) -> list[tuple[str, str]]:
    """Return the names of the files that a page changes, each with its changes."""
    blocks = re.findall(r"^```diff\n(.*?)^```", page, re.M | re.S)
    change = re.compile(r"^--- (\S+)\n(.*?)(?=^--- |\Z)", re.M | re.S)
    return [pair for block in blocks for pair in change.findall(block)]


def carry_out_recipes(page: str, root: Path) -> int:
    """Apply the changes of the source code described on a page: new files and new lines."""
    add_files(page, root)
    changes = 0
    for name, text in changed_files(page):
        for lines in map(str.splitlines, text.split("@@\n")):
            old = [line[1:] for line in lines if line[0] != "+"]
            new = [line[1:] for line in lines if line[0] != "-"]
            file = root / name
            file.write_text(replace_lines(name, file.read_text(), old, new))
            changes += 1
    return changes


def test_a_recipe_that_does_not_fit_the_sources_is_named(tmp_path):
    (tmp_path / "a.f90").write_text("call one()\ncall three()\n")
    page = "```diff\n--- a.f90\n call one()\n+call two()\n```\n"
    assert carry_out_recipes(page, tmp_path) == 1
    with pytest.raises(AssertionError, match=r"a\.f90 contains .* 0 times .*\n *call 1"):
        carry_out_recipes(page.replace("one", "1"), tmp_path)


def look_at_bars(run, folder):
    """Check the results of the recipe for a bar in Python and in the paths of disks."""
    ran(*run, "--set", "contact.wall_rule=normal", "--force", cwd=folder, check=True)
    code = """if True:
        from ricochet import read_run
        from ricochet.reading.paths import seen, turns_between
        run = read_run("all.h5")
        assert run.walls.tolist() == [[[1, 0.1], [1, 0.9]]]
        frames = list(range(0, run.n_frames, 50))
        turns = turns_between(run, run.event_log(), frames, seen(run, run.event_log(), frames))
        assert len(turns.time) == (run.event_log()[0] <= run.time[300]).sum() > 200
    """
    own = environment(PYTHONPATH=folder / "post")
    ran(sys.executable, "-c", code, cwd=folder, env=own, check=True)
    for script, figure in (("player", "all.html"), ("snapshot", "all.png")):
        command = [sys.executable, folder / f"post/{script}.py", "all.h5", "-o", figure]
        ran(*command, cwd=folder, env=own, check=True)


def look_at_pulses(program, folder):
    """Check the results of the recipes for a placement and for a motion of a side.

    The disk on the right of the ring reaches the bottom at times 0.4, 1.2, ...; only at the first
    of them does the side strike, with a velocity of 0.5.
    """
    (folder / "pulsed.nml").write_text(
        """&species count = 4 radius = 0.1 placement = 'ring' ring_radius = 0.3 velocity = 0, -1 /
        &side name = 'bottom' motion = 'pulsed' velocity = 0.5 pulse_period = 2 / &stop time = 1.9 /
        &run dynamics = 'ideal' /"""
    )
    ran(program, "pulsed.nml", "-o", "pulsed.h5", "--quiet", cwd=folder, check=True)
    with h5py.File(folder / "pulsed.h5") as file:
        x = file["particles/disks/position/value"][0]
        v = file["particles/disks/velocity/value"][:, 0, 1]
    ring = [[0.8, 0.5], [0.5, 0.8], [0.2, 0.5], [0.5, 0.2]]
    assert x == pytest.approx(np.array(ring))
    assert abs(v).tolist() == [1, 2]


def look_at_restitution(program, folder):
    """Check a head-on collision at half the reference speed, in the program and in Python."""
    (folder / "linear.nml").write_text(
        """&species radius = 0.1 position = 0.2, 0.5, 0.8, 0.5 velocity = 0.5, 0, -0.5, 0 /
        &contact restitution = 0.6 restitution_law = 'linear' reference_speed = 2 /
        &stop time = 0.6 /"""
    )
    ran(program, "linear.nml", "-o", "linear.h5", "--quiet", cwd=folder, check=True)
    code = "from ricochet import read_run; print(read_run('linear.h5').contact_law.at(1.0))"
    own = environment(PYTHONPATH=folder / "post")
    said = ran(sys.executable, "-c", code, cwd=folder, env=own, check=True).stdout
    assert float(said) == pytest.approx(0.8)
    with h5py.File(folder / "linear.h5") as file:
        v = file["particles/disks/velocity/value"][-1, :, 0]
    assert v.tolist() == pytest.approx([-0.4, 0.4])


def all_recipes() -> str:
    """Return the text of all pages with recipes."""
    names = "recipes", "recipes-that-add-a-choice", "recipes-that-add-a-file"
    return "\n".join(path_of(name).read_text() for name in names)


def test_the_sizes_of_the_recipes_are_listed():
    """The table counts the new files and the changed files of each recipe, and their lines."""
    rows = ["| recipe | new files | lines in them | changed files | lines added to them |"]
    rows.append("|---|---:|---:|---:|---:|")
    for title, recipe in re.findall(r"^## (.*)\n((?:(?!## ).*\n)*)", all_recipes(), re.M):
        new = [code.count("\n") for _, code in new_files(recipe)]
        changed = changed_files(recipe)
        if new or changed:
            added = sum(len(re.findall(r"^\+", text, re.M)) for _, text in changed)
            rows.append(f"| {title} | {len(new)} | {sum(new)} | {len(changed)} | {added} |")
    table = "\n".join(rows) + "\n"
    assert table in all_recipes(), f"the table of docs/explanation/recipes.md must be\n{table}"


@pytest.fixture
def by_recipe(tmp_path):
    """Return a copy of the sources in which all recipes have been applied."""
    for name in ("src", "post", "Makefile", "tests"):
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, tmp_path / name)
    assert carry_out_recipes(all_recipes(), tmp_path) > 30
    return tmp_path


def test_the_recipes_fit_the_sources_and_the_style(by_recipe):
    ran("git", "init", "-q", cwd=by_recipe, check=True)
    said = ran(sys.executable, "tests/support/check_style.py", cwd=by_recipe)
    assert (said.returncode, said.stdout) == (0, "")


@pytest.mark.statistics
def test_the_recipes_work(tmp_path, by_recipe):
    """The program is compiled with all recipes, which takes half a minute."""
    build = ["make", "-j2", "OPT=-O0", f"BUILD={tmp_path}/build"]
    about = "observables", "variables", "namelist_input"
    laws = " ".join(f"tests/unit/test_{name}.pf" for name in about)
    for goal in ([], [f"tests={laws}", "unit-tests"]):  # these include the additions
        made = ran(*build, *goal, cwd=tmp_path, env=environment())
        assert made.returncode == 0, made.stdout + made.stderr
    (tmp_path / "all.nml").write_text(
        """&box upper = 2, 1 / &run dynamics = 'ideal' /
        &bar name = 'rod' from = 1, 0.1 to = 1, 0.9 thickness = 0.3 /
        &species count = 50 radius = 0.02 speed = 1 region = 0, 0.7, 0, 1 /
        &contact wall_rule = 'sticky' wall_restitution = 1 / &stop time = 3 /
        &output frames_every_time = 0.01 observables_every_time = 0.01 event_log = .true. /"""
    )
    run = [tmp_path / "build" / "ricochet", "all.nml", "-o", "all.h5", "--quiet"]
    ran(*run, cwd=tmp_path, check=True)
    with h5py.File(tmp_path / "all.h5") as file:
        fastest = file["observables/largest_speed/value"][:]
        x, y = np.moveaxis(file["particles/disks/position/value"][:], -1, 0)
        assert file["observables/collisions/value"][-1] == 0
        assert file["observables/obstacle_collisions/value"][-1] > 10
        assert file["parameters/bar/thickness"][:].tolist() == [0.3]
    assert np.hypot(x - 1, np.maximum(np.abs(y - 0.5) - 0.4, 0)).min() > 0.17 - 1e-9
    assert fastest[0] == pytest.approx(1) and (np.diff(fastest) <= 1e-15).all()
    assert fastest[-1] < 1  # sticky walls take the tangential velocity
    look_at_bars(run, tmp_path)
    gas = """&species count = 3000 packing_fraction = 0.3 temperature = 1 /
        &contact restitution = 1 wall_restitution = 0.5 / &stop wall_hits = 1500 /
        &side name = 'bottom' elastic_below = 1e9 /
        &output frames_every_collisions = 10000 observables_every_collisions = 10000 /"""
    (tmp_path / "gas.nml").write_text(gas)
    for name, *options in (
        ("plain",),
        ("cores", "--set=run.threads=2"),
        ("parts", "--set=stop.wall_hits=600"),
        ("parts", "--resume"),
    ):
        command = [run[0], "gas.nml", "-o", f"{name}.h5", "--quiet", *options]
        ran(*command, cwd=tmp_path, check=True)
    (tmp_path / "langevin.nml").write_text(
        """&drive kind = 'langevin' interval = 0.05 temperature = 2 drag = 1 /
        &species count = 3000 packing_fraction = 0.1 velocities = 'rest' /
        &run dynamics = 'ideal' / &stop time = 0.5 /"""
    )
    ran(run[0], "langevin.nml", "-o", "langevin.h5", "--quiet", cwd=tmp_path, check=True)
    with h5py.File(tmp_path / "langevin.h5") as file:
        energy = file["observables/all/kinetic_energy/value"][-1]
    assert energy == pytest.approx(2 * (1 - np.exp(-1)), rel=4 / np.sqrt(3000))
    look_at_pulses(run[0], tmp_path)
    look_at_restitution(run[0], tmp_path)
    for other in ("cores", "parts"):
        found = differences(tmp_path / "plain.h5", tmp_path / f"{other}.h5")
        assert [name for name in found if "parameters" not in name] == []
    with h5py.File(tmp_path / "plain.h5") as file:
        exchanged = file["observables/exchanged_impulse/value"][:]
        hits = file["particles/disks/wall_hits/value"][:]
        sides = [
            file[f"observables/sides/{name}/energy_to_disks/value"][-1]
            for name in ("bottom", "top")
        ]
        assert sides[0] == pytest.approx(0, abs=1e-9) and sides[1] < -1  # elastic, and not
        assert file["observables/side_collisions/value"][-1].sum() == 1500
        assert exchanged[0] == 0 and exchanged[-1] > 0
        assert (hits.sum(1) == file["observables/side_collisions/value"][:].sum(1)).all()
