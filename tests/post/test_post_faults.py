"""Cut, damaged and foreign files: one line and exit 2. Files being written: a figure."""

import itertools
import random
import re
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np
import pytest

from ricochet import RunError, read_run
from synthetic_run import ROOT, SCRIPTS, run_script, write_run
from whole_runs import FINISHED, MIXTURE, STOPPED, frames_in, wait_for, write_input

BROKEN = 4
#: All kinds of objects in a small file.
TINY = re.sub(r"count = \d+", "count = 2", MIXTURE).replace("time = 4", "time = 0.3")


def bad_files(folder) -> dict[str, str]:
    """Files that cannot be used, each with words of the message that says why."""
    good = write_run(folder / "good.h5", np.zeros((4, 50, 2)), np.zeros((4, 50, 2)))
    (folder / "empty.h5").touch()
    (folder / "text.h5").write_text("no HDF5 at all\n" * 100)
    data = good.read_bytes()
    (folder / "short.h5").write_bytes(data[: len(data) // 2])
    with h5py.File(folder / "foreign.h5", "w") as file:
        file["x"] = 1
    write_run(folder / "future.h5", np.zeros((1, 1, 2)), np.zeros((1, 1, 2)))
    with h5py.File(folder / "future.h5", "r+") as file:
        file["h5md"].attrs["version"] = np.array([2, 0])
    write_run(folder / "partial.h5", np.zeros((1, 1, 2)), np.zeros((1, 1, 2)))
    with h5py.File(folder / "partial.h5", "r+") as file:
        del file["particles/disks/velocity"], file["particles/disks/mass"]
    (folder / "unfinished.h5.part").touch()
    with h5py.File(folder / "gas.chk.h5", "w") as file:
        file["clock"] = 1.0
    return {
        "empty.h5": "empty",
        "text.h5": "not an HDF5",
        "short.h5": "cut short",
        "foreign.h5": "not of a Ricochet run",
        "future.h5": "version 2.0",
        "partial.h5": "mass",
        "missing.h5": "no such file",
        "gas.chk.h5": "a checkpoint",
        "unfinished.h5": "unfinished run",
        "": "folder",
    }


def test_unusable_files_are_told_apart(tmp_path):
    for name, word in bad_files(tmp_path).items():
        with pytest.raises(RunError, match=word) as caught:
            read_run(tmp_path / name)
        assert "\n" not in str(caught.value) and str(tmp_path) in str(caught.value)


def test_a_file_that_goes_while_it_is_opened_is_missing(tmp_path, monkeypatch):
    """As when the program gives it its final name."""
    path = write_run(tmp_path / "a.h5", np.zeros((1, 1, 2)), np.zeros((1, 1, 2)))
    open_file = h5py.File

    def late(*words, **more):
        path.unlink()
        return open_file(*words, **more)

    monkeypatch.setattr(h5py, "File", late)
    with pytest.raises(RunError, match="no such file"):
        read_run(path)


@pytest.mark.parametrize("script", SCRIPTS)
def test_scripts_answer_a_bad_file_with_one_line_and_exit_2(tmp_path, script, capsys):
    for name, words in bad_files(tmp_path).items():
        path = tmp_path / name
        assert run_script(script, *[path] * (2 if script == "lyapunov" else 1)) == 2
        said = capsys.readouterr().err
        assert said.startswith(f"{script}.py: {path}") and said.count("\n") == 1
        assert words in said


@pytest.fixture
def unfinished(ricochet, tmp_path) -> Path:
    """What a run has written that its wall clock stopped."""
    write_input(tmp_path, MIXTURE)
    run = ricochet("gas.nml", "-o", "gas.h5", "--set", "stop.wall_clock=1e-9")
    assert run.returncode == STOPPED
    return tmp_path / "gas.h5.part"


def read_everything(path):
    """All numbers that a script could ask for; how many there are."""
    run = read_run(path)
    asked = [run.time, run.position[-1], run.velocity[:], run.speed(0), run.kinetic_energy(-1)]
    asked += [run.unwrapped(-1), *run.events, run.collisions_per_disk_at(run.time)]
    for name in ("total_energy", "momentum", *(f"{name}/kinetic_energy" for name in run.names)):
        asked += run.observable(name)
    return sum(np.size(value) for value in asked)


@pytest.mark.parametrize("cuts", [12, pytest.param(300, marks=pytest.mark.check)])
def test_a_file_cut_anywhere_is_refused(unfinished, ricochet, tmp_path, cuts):
    """A finished one, and one that was being written."""
    assert ricochet("gas.nml", "-o", "whole.h5").returncode == FINISHED
    for whole in (unfinished, tmp_path / "whole.h5"):
        data, path = whole.read_bytes(), tmp_path / "cut.h5"
        for k in range(cuts):
            path.write_bytes(data[: k * len(data) // cuts])
            with pytest.raises(RunError, match=r"is empty|cut short") as caught:
                read_everything(path)
            assert "\n" not in str(caught.value)


@pytest.mark.parametrize("stride", [5, pytest.param(1, marks=pytest.mark.check)])
def test_a_file_with_an_object_less_or_a_wrong_one_is_refused_or_read(ricochet, tmp_path, stride):
    """Each object is left out, or is a text, or has no values in turn: never another error."""
    write_input(tmp_path, TINY)
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    whole, path, names = (tmp_path / "gas.h5").read_bytes(), tmp_path / "other.h5", []
    with h5py.File(tmp_path / "gas.h5") as file:
        file.visit(names.append)
    unread = ("checkpoint", "observables/sides")  # for --resume alone; by no script
    names = [name for name in names if not name.startswith(unread)]
    assert len(names) > 60
    changes = list(itertools.product(names, (None, "text", np.zeros(0))))[::stride]
    refused = len(changes)
    for name, value in changes:
        path.write_bytes(whole)
        with h5py.File(path, "r+") as file:
            del file[name]
            if value is not None:
                file[name] = value
        with suppress(RunError):
            read_everything(path)
            refused -= 1
    assert refused > len(changes) / 3


READER = f"""
import sys; sys.path[:0] = {[str(ROOT / name) for name in ("post", "tests", "tests/post")]!r}
from test_post_faults import read_damaged
read_damaged(*sys.argv[1:])
"""


def read_damaged(path, first, last):
    """Reads copies of a file with a bit turned; in a process of its own, it is hard on HDF5."""
    data, copy = Path(path).read_bytes(), Path(f"{path}.copy")
    for seed in range(int(first), int(last)):
        rng, damaged = random.Random(seed), bytearray(data)
        damaged[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        copy.write_bytes(damaged)
        print(seed, flush=True)
        with suppress(RunError):
            read_everything(copy)


@pytest.mark.parametrize("flips", [100, pytest.param(2000, marks=pytest.mark.check)])
def test_a_damaged_file_is_refused_or_read(ricochet, tmp_path, flips):
    write_input(tmp_path, TINY)
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    command = [sys.executable, "-c", READER, tmp_path / "gas.h5", "0", str(flips)]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout.splitlines()[-1] + run.stderr


#: Simulations, and the scripts that draw them, with their options.
OUTPUT = "&stop time = 1e6 / &output frames_every_time = 0.2 observables_every_time = 0.2 /\n"
PAIR = "&species name = 'one' count = 1 radius = 0.1 position = 0.3, 0.3 velocity = 1, 0.3 /\n"
FALLING = """&box upper = 4, 4 gravity = 0, -9.81 /
&species name = 'A' count = 8 mass = 1 radius = 0.05 velocities = 'uniform' speed = 3 /
&species name = 'B' count = 8 mass = 2 radius = 0.05 velocities = 'uniform' speed = 3 /
"""
BULK = """&box boundary = 'periodic', 'periodic' /
&species name = 'gas' count = 64 packing_fraction = 0.3 temperature = 1 /
"""
CRATER = """&species name = 'bed' count = 40 radius = 0.04 region = 0, 1, 0, 0.5 /
&species name = 'projectile' mass = 25 radius = 0.1 position = 0.5, 0.75 velocity = 0, -5 /
"""
GENERIC = ("speeds", "snapshot", "animate", "energy", "trajectory", "export", "player", "cooling")
SOON = ("--skip", "1", "--apart", "1")
ROUGH = "&contact restitution = 0.9 tangential_restitution = 0.5 /\n"
RUNNING = {
    "mixture": (
        [MIXTURE.split("&contact")[0] + OUTPUT],
        {**dict.fromkeys(GENERIC, ()), "mixture": SOON},
    ),
    "falling": (
        [FALLING + OUTPUT],
        {
            **{"gravity": ("--skip", "1"), "equipartition": ()},
            **{"fields": (), "driven": ("--show", "height")},
        },
    ),
    "crater": ([CRATER + OUTPUT], {"crater": (), "crater_scan": ()}),
    "scattering": (
        [PAIR + "&species name = 'other' radius = 0.05 position = 0.8, 0.5 /\n" + OUTPUT],
        {"scattering": ()},
    ),
    "bulk": (
        [BULK + OUTPUT],
        dict.fromkeys(("correlations", "equation_of_state", "rates", "melting"), ()),
    ),
    "rough": ([BULK + ROUGH + OUTPUT], {"rough": ()}),
    "transport": (
        [BULK + OUTPUT.replace("&output", "&output event_log = .true. virial_tensor = .true.")],
        {"transport": ()},
    ),
    "cooling": ([BULK + "&contact restitution = 0.9 /\n" + OUTPUT], {"haff": ()}),
    "neighbours": (
        [PAIR + OUTPUT, PAIR.replace("0.3, 0.3", "0.3, 0.300001") + OUTPUT],
        {"lyapunov": ("--largest", "0.1")},
    ),
    "steps": (
        [FALLING + OUTPUT, FALLING + "&run dynamics = 'steps' dt = 4e-3 /\n" + OUTPUT],
        {"missed": ("--skip", "1")},
    ),
}
ENDINGS = {"animate": "gif", "export": "xyz", "player": "html"}


@pytest.mark.parametrize("system", RUNNING)
def test_running_simulations_are_drawn(started, tmp_path, system, capsys):
    """The simulation is held up while the scripts look at its file, and has not finished."""
    texts, scripts = RUNNING[system]
    parts = []
    for k, text in enumerate(texts):
        process = started(write_input(tmp_path, text, f"{k}.nml"), "-o", f"{k}.h5")
        parts.append(tmp_path / f"{k}.h5.part")
        wait_for(lambda: frames_in(parts[-1], "observables") > 100)
        process.send_signal(signal.SIGSTOP)
    for script, options in scripts.items():
        figure = tmp_path / f"{script}.{ENDINGS.get(script, 'png')}"
        few = ("--count", "3") if script == "animate" else ()
        code = run_script(script, *parts, "-o", figure, *options, *few)
        said = capsys.readouterr().err
        assert code == 0, said
        for part in parts:
            assert f"warning: {part.name} is unfinished" in said
        assert figure.stat().st_size > 0


@pytest.mark.parametrize(
    ("name", "note", "said"),
    [
        ("a.h5", "", ""),
        ("a.h5", "cooled to nothing", "a.h5 ended early: cooled to nothing"),
        ("a.h5.part", "", "a.h5.part is unfinished: going on, stopped, or broken off"),
        ("a.h5.part", "an inelastic\x1b[2J\ncollapse", "broke off: an inelastic[2Jcollapse; last"),
    ],
)
def test_a_run_that_met_no_stop_rule_says_so(tmp_path, monkeypatch, capsys, name, note, said):
    """In print, and in red on the figure."""
    x, known = np.zeros((4, 3, 2)), {"git_commit": "abc", "note": note}
    run, texts = write_run(tmp_path / name, x, x + 1, provenance=known), []
    monkeypatch.setattr(
        "ricochet.script.save",
        lambda figure, *_: texts.append(figure.get_supxlabel().replace("\n", " ")),
    )
    assert run_script("snapshot", run) == 0
    warned = capsys.readouterr().err
    assert said in warned and said in texts[0] and bool(said) == bool(warned) == bool(texts[0])


def test_a_crater_that_broke_off_says_so(ricochet, tmp_path, capsys):
    collapse = "&contact restitution = 0.05 wall_rule = 'normal' /\n"
    fall = "&box gravity = 0, -1 / &stop energy_fraction = 1e-12 /\n"
    bed = CRATER.replace("region", "velocity = 0, -1 region")
    write_input(tmp_path, fall + collapse + bed)
    assert ricochet("gas.nml", "-o", "run.h5").returncode == BROKEN
    assert run_script("crater", tmp_path / "run.h5.part", "-o", tmp_path / "a.png") == 0
    said = capsys.readouterr().err
    assert "warning: run.h5.part broke off: inelastic collapse" in said
    assert "% of the energy is left, not the 1e-10 % of stop.energy_fraction" in said


def test_every_script_draws_a_running_simulation():
    """All but `cost` and `scaling`, which want times of whole runs, and `coverage`: ten runs."""
    drawn = {script for _, scripts in RUNNING.values() for script in scripts}
    assert drawn == {*SCRIPTS} - {"cost", "coverage", "scaling"}


@pytest.mark.parametrize("ending", ["png", "csv", "xyz", "html", "gif"])
def test_a_full_disk_is_one_line(unfinished, small_disk, capsys, ending):
    folder = small_disk(4)
    script = {"png": "snapshot", "csv": "export"} | {end: name for name, end in ENDINGS.items()}
    few = ("--count", "1") if ending == "gif" else ()
    assert run_script(script[ending], unfinished, "-o", folder / f"a.{ending}", *few) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert said == f"{script[ending]}.py: cannot write the output: No space left on device"
