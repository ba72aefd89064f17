"""Tests of the scripts in runs/, with scripts that replace the programs and record the calls."""

import fnmatch
import os
import re
import shutil
from pathlib import Path

import pytest

from whole_runs import environment, executable, ran

ROOT = Path(__file__).resolve().parents[2]
NO_SYSTEM = ("common", "ensemble", "ensemble_folder", "figures", "bench", "memory", "scaling")
SYSTEMS = sorted(p.stem for p in (ROOT / "runs").glob("*.sh") if p.stem not in NO_SYSTEM)


@pytest.fixture
def study(tmp_path):
    """Return a function that runs a script of runs/ without simulations and figures."""
    for folder in ("runs", "input"):
        (tmp_path / folder).mkdir()
        for path in (ROOT / folder).iterdir():
            if path.is_file():
                shutil.copy(path, tmp_path / folder)
    executable(tmp_path / "ricochet", "exit 4")
    executable(tmp_path / "python", f"echo \"$@\" >>'{tmp_path}/drawn.txt'")
    noted = f"echo \"$LC_ALL\" >>'{tmp_path}/language.txt'"
    executable(tmp_path / "bin" / "awk", f'{noted}\nexec {shutil.which("awk")} "$@"')
    own = {
        "LC_ALL": "de_DE.UTF-8",  # with decimal commas
        "PATH": f"{tmp_path}/bin:{os.environ['PATH']}",
        "PYTHON": f"{tmp_path}/python",
        "RICOCHET": f"{tmp_path}/ricochet",
    }

    def run(script, *options, **more):
        command = ["bash", f"{script}.sh", *options]
        return ran(*command, cwd=tmp_path / "runs", env=environment(**own | more))

    return run


@pytest.mark.parametrize("system", SYSTEMS)
def test_a_study_names_its_members_and_draws_its_figures(study, tmp_path, system):
    run = study(system, "--dry-run")
    assert run.returncode == 0, run.stderr
    assert "--set " in run.stdout
    members = {line.split("\t")[0] for line in run.stdout.splitlines()}
    for call in (tmp_path / "drawn.txt").read_text().splitlines():
        script = call.split()[0]
        folder = "lorentz" if script == "post/scatterers.py" else "figures"
        assert (ROOT / script).is_file() and f" -o runs/{folder}/" in call
        drawn = call.partition(" -o ")[0].split()[1:]
        for name in (Path(word).stem for word in drawn if word.endswith(".h5")):
            assert fnmatch.filter(members, name), f"no member run is called {name}"
    if (tmp_path / "language.txt").exists():
        assert set((tmp_path / "language.txt").read_text().split()) == {"C"}


def test_the_page_states_how_long_each_study_takes():
    page = (ROOT / "runs" / "README.md").read_text()
    section = page.partition("\n## How long the studies take\n")[2].partition("\n## ")[0]
    rows = "".join(line for line in section.splitlines() if line.startswith("|"))
    assert set(SYSTEMS) == set(re.findall(r"`(\w+)\.sh`", rows))


def test_many_disks_near_melting_begin_as_copies_of_fewer(study):
    for full, sides in (("", ("64",)), ("1", ("full/64", "full/128"))):
        run = study("melting", "--dry-run", FULL=full)
        assert run.returncode == 0, run.stderr
        for side in sides:
            assert run.stdout.count(f"species.disks.file=runs/melting/{side}/molten_") == 16


def test_a_list_of_members_is_not_written_through_a_link(study, tmp_path):
    precious = tmp_path / "precious"
    precious.write_text("precious")
    (tmp_path / "runs" / "scattering").mkdir()
    (tmp_path / "runs" / "scattering" / "members.txt").symlink_to(precious)
    assert study("scattering", "--dry-run").returncode == 0
    assert precious.read_text() == "precious"


@pytest.mark.parametrize("script", [*SYSTEMS, "figures"])
def test_help_says_what_a_study_does_and_starts_nothing(study, tmp_path, script):
    run = study(script, "--help")
    assert run.returncode == 0 and "ensemble.sh" in run.stdout
    assert run.stdout.splitlines()[0] in (ROOT / "runs" / f"{script}.sh").read_text()
    assert not (tmp_path / "runs" / script).exists()


def test_threads_are_measured_by_turns_and_drawn(study, tmp_path):
    """Existing measurements are not repeated, and a failed run ends the script with its message."""
    executable(tmp_path / "ricochet", f"echo $1 $2 $3 $6 >>'{tmp_path}/runs.txt'\n: >\"$3\"")
    sizes = {"SIZES": "100", "THREADS": "1 4", "RUNS": "2"}
    for _ in range(2):
        run = study("scaling", **sizes)
        assert run.returncode == 0, run.stderr
        calls = (tmp_path / "runs.txt").read_text().splitlines()
        assert [call.split()[3][-1] for call in calls[1:]] == ["1", "4", "1", "4"]
    assert "post/scaling.py runs/scaling/gas_100_1_1.h5" in (tmp_path / "drawn.txt").read_text()
    executable(tmp_path / "ricochet", "echo no room >&2\nexit 3")
    run = study("scaling", **sizes | {"SIZES": "200"})
    assert run.returncode != 0 and run.stderr.splitlines()[-1] == "no room"
    assert study("scaling", "--help").returncode == 0


def test_what_is_missing_shows_before_anything_runs(study):
    run = study("gas", PYTHON="/nowhere/python")
    assert run.returncode == 2 and "make demo" in run.stderr.splitlines()[-1]
    run = study("figures", "gasses")
    assert run.returncode == 2 and "known: scattering" in run.stderr.splitlines()[-1]


@pytest.mark.parametrize(("per_collision", "code"), [(2080, 0), (2120, 1), (0, 1)])
def test_the_gate_on_instructions_lets_nothing_through_that_it_did_not_count(
    study, program, tmp_path, per_collision, code
):
    until = r"printf '%s ' $* | sed -n 's/.*stop\.[ce][a-z]*=\([0-9]*\) .*/\1/p'"
    count = f"n=$(({per_collision} * ($({until}) / 2 * 2) + 5000))"
    kicks = r"printf '%s ' $* | sed -n 's/.*stop.time=0\.\([0-9]*\) .*/1\1/p'"
    count = f"case $* in *drive.*) n=$({kicks} | cut -c -7)00 ;; *) {count} ;; esac"
    executable(tmp_path / "bin" / "valgrind", f'{count}\necho "==1== Collected : $n" >&2')
    gate = study("bench", "--check", RICOCHET=program)
    assert gate.returncode == code, gate.stderr
    assert f"packing 0.5: {per_collision} instructions per collision" in gate.stdout
