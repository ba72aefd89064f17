"""Hostile files: one line and exit 2, soon and in little memory, and nothing outside is touched."""

import importlib
import json
import os
import resource
import signal
import subprocess
import sys
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest

from ricochet import RunError, read_run
from synthetic_run import ROOT, SCRIPTS, run_script, write_run

SECONDS, MEGABYTES = 0.5, 200  # of processor time, to which the start of Python adds its own
MANY = 10**9
DISKS = "particles/disks"


def ordinary(path: Path) -> Path:
    """A file without a fault."""
    rng = np.random.default_rng(5)
    frames, count = 6, 8
    samples = np.arange(frames)
    energies = {f"{name}/kinetic_energy": 1.0 + samples for name in ("all", "light", "heavy")}
    return write_run(
        path,
        rng.uniform(0.1, 0.9, (frames, count, 2)),
        rng.normal(size=(frames, count, 2)),
        mass=np.repeat([1.0, 4.0], count // 2),
        species=np.repeat([1, 2], count // 2),
        names=("light", "heavy"),
        observables={"collisions": 9 * samples, "total_energy": 1.0 + 0 * samples, **energies},
        parameters={"run": {"title": "a title", "seed": 3}},
    )


def put(file, path, value=None, **more):
    """Replace what is at a path."""
    if path in file:
        del file[path]
    file.create_dataset(path, data=value, **more)


def link(file, path, target):
    if path in file:
        del file[path]
    file[path] = target


def change(file, path, place, value):
    data = file[path][()]
    data[place] = value
    put(file, path, data)


def deep(group, levels, names=("a",)):
    """A group in a group in a group, each under all of these names."""
    for _ in range(levels):
        inner = group.create_group(names[0])
        for name in names[1:]:
            group[name] = inner
        group = inner


def declared(*shape):
    """A dataset of this shape without any data."""
    return {"shape": shape, "dtype": "f8", "chunks": tuple(min(n, 1000) for n in shape)}


def packed_zeros(count):
    """A multiple of 1e6 numbers as zlib packs them, by repeating what it makes of so many."""
    million = bytes(8 * 10**6)
    zip_it, end = zlib.compressobj(), zlib.compressobj(wbits=-zlib.MAX_WBITS).flush()
    first, next_one = (
        zip_it.compress(million) + zip_it.flush(zlib.Z_FULL_FLUSH) for _ in range(2)
    )
    checksum = (8 * count % 65521 << 16) + 1  # Adler-32
    return first + next_one * (count // 10**6 - 1) + end + checksum.to_bytes(4, "big")


def bomb(file, path, shape, chunk):
    """Zeros that take a thousandth of their size."""
    del file[path]
    more = {"chunks": chunk, "maxshape": (None, *shape[1:]), "compression": "gzip"}
    data = file.create_dataset(path, shape, "f8", **more)
    packed = packed_zeros(int(np.prod(chunk)))
    for k in range(-(-shape[0] // chunk[0])):
        data.id.write_direct_chunk((k * chunk[0], *[0] * (len(shape) - 1)), packed)


def elsewhere(file, path, outside):
    """The numbers are in another file."""
    size = file[path].size
    put(file, path, shape=(size,), dtype="f8", external=[(str(outside), 0, 8 * size)])


def virtual(file, path, outside):
    layout = h5py.VirtualLayout(file[path].shape, "f8")
    layout[...] = h5py.VirtualSource(str(outside), "x", file[path].shape)
    del file[path]
    file.create_virtual_dataset(path, layout)


#: What is done to a file, and a word of the answer.  `out` is the name of a FIFO.
FAULTS = {
    "external link": (lambda f, out: link(f, DISKS, h5py.ExternalLink(out, "/x")), "a link"),
    "soft cycle": (
        lambda f, out: link(f, f"{DISKS}/mass", h5py.SoftLink(f"/{DISKS}/mass")),
        "a link",
    ),
    "soft link among parameters": (
        lambda f, out: link(f, "parameters/x", h5py.SoftLink("/")),
        "a link",
    ),
    "external link among parameters": (
        lambda f, out: link(f, "provenance/x", h5py.ExternalLink(out, "/x")),
        "a link",
    ),
    "hard cycle": (lambda f, out: link(f, "parameters/x", f["parameters"]), "another name"),
    "doubled links": (lambda f, out: deep(f["parameters"], 40, ("a", "b")), "parameters/a"),
    "thousands of levels": (lambda f, out: deep(f["provenance"], 1000), "too many"),
    "external storage": (lambda f, out: elsewhere(f, f"{DISKS}/mass", out), "another file"),
    "virtual": (lambda f, out: virtual(f, f"{DISKS}/velocity/value", out), "another file"),
    "many disks": (lambda f, out: put(f, f"{DISKS}/mass", **declared(MANY)), "does not hold"),
    "many disks in all": (
        lambda f, out: [
            put(f, f"{DISKS}/{name}", **declared(*shape))
            for name, shape in {
                "mass": (MANY,),
                "radius": (MANY,),
                "position/value": (6, MANY, 2),
                "velocity/value": (6, MANY, 2),
            }.items()
        ],
        "does not hold",
    ),
    "many frames": (
        lambda f, out: [
            put(f, f"{DISKS}/{name}", **declared(MANY, *shape))
            for name, shape in {
                "position/time": (),
                "position/value": (8, 2),
                "velocity/value": (8, 2),
            }.items()
        ],
        "does not hold",
    ),
    "a long text": (
        lambda f, out: put(f, "parameters/input", shape=(), dtype=f"S{MANY}"),
        "does not hold",
    ),
    "many names": (
        lambda f, out: put(f, "parameters/species/names", **declared(MANY)),
        "does not hold",
    ),
    "a long edge": (lambda f, out: put(f, f"{DISKS}/box/edges", **declared(MANY)), "edges"),
    "many committed": (
        lambda f, out: put(f, f"{DISKS}/committed", **declared(MANY)),
        "does not hold",
    ),
    "packed": (
        lambda f, out: [
            bomb(f, f"{DISKS}/mass", (2 * 10**7,), (10**6,)),
            bomb(f, f"{DISKS}/position/value", (6, 2 * 10**7, 2), (1, 10**6, 2)),
            bomb(f, f"{DISKS}/velocity/value", (6, 2 * 10**7, 2), (1, 10**6, 2)),
        ],
        "does not hold",
    ),
    "a large chunk": (
        lambda f, out: bomb(f, f"{DISKS}/mass", (8,), (10**8,)),
        "does not hold",
    ),
    "NaN in the last frame": (
        lambda f, out: change(f, f"{DISKS}/velocity/value", (-1, 0, 0), np.nan),
        "velocity: not all numbers in frame 5 are finite",
    ),
    "infinite at the start": (
        lambda f, out: change(f, f"{DISKS}/position/value", (0, 3, 1), np.inf),
        "position: not all numbers in frame 0 are finite",
    ),
    "NaN in time": (lambda f, out: change(f, f"{DISKS}/position/time", 2, np.nan), "finite"),
    "infinite radius": (lambda f, out: change(f, f"{DISKS}/radius", 2, np.inf), "finite"),
    "negative mass": (lambda f, out: change(f, f"{DISKS}/mass", 2, -1), "above 0"),
    "no room": (lambda f, out: put(f, f"{DISKS}/box/edges", [1.0, 0.0]), "above 0"),
    "species 0": (lambda f, out: change(f, f"{DISKS}/species", 1, 0), "species from 0"),
    "species 3": (lambda f, out: change(f, f"{DISKS}/species", 1, 3), "names"),
    "species 2^31": (lambda f, out: change(f, f"{DISKS}/species", 1, 2**31 - 1), "species from 1"),
    "species 2^31 without names": (
        lambda f, out: [
            change(f, f"{DISKS}/species", 1, 2**31 - 1),
            link(f, "parameters/species/names", f.create_group("other")),
        ],
        "species",
    ),
    "a species of fractions": (lambda f, out: put(f, f"{DISKS}/species", np.ones(8)), "type"),
    "mass in words": (lambda f, out: put(f, f"{DISKS}/mass", [b"heavy"] * 8), "type"),
    "mass of free length": (
        lambda f, out: put(f, f"{DISKS}/mass", ["heavy"] * 8, dtype=h5py.string_dtype()),
        "type",
    ),
    "complex time": (lambda f, out: put(f, f"{DISKS}/position/time", np.ones(6, "c16")), "type"),
    "compound": (
        lambda f, out: put(f, f"{DISKS}/velocity/value", np.zeros((6, 8, 2), [("x", "f8")])),
        "type",
    ),
    "a type for a dataset": (lambda f, out: link(f, f"{DISKS}/mass", np.dtype("f8")), "damaged"),
    "names of free length": (
        lambda f, out: put(f, "parameters/species/names", ["a", "b"], dtype=h5py.string_dtype()),
        "type",
    ),
    "no velocity": (lambda f, out: f.__delitem__(f"{DISKS}/velocity"), "velocity/value is missing"),
    "no box": (lambda f, out: f.__delitem__(f"{DISKS}/box"), "damaged"),
    "no edges": (lambda f, out: f.__delitem__(f"{DISKS}/box/edges"), "edges"),
    "no boundary": (lambda f, out: f[f"{DISKS}/box"].attrs.pop("boundary"), "boundary"),
    "no disks": (lambda f, out: put(f, f"{DISKS}/mass", np.zeros(0)), "mass has a wrong shape"),
    "no frames": (lambda f, out: put(f, f"{DISKS}/position/time", np.zeros(0)), "no frame"),
    "nothing": (lambda f, out: put(f, f"{DISKS}/mass", h5py.Empty("f8")), "damaged"),
    "no version": (
        lambda f, out: f["h5md"].attrs.create("version", np.zeros(0, int)),
        "damaged",
    ),
    "no names": (lambda f, out: put(f, "parameters/species/names", np.zeros(0, "S5")), "species"),
    "a name of two lines": (
        lambda f, out: put(f, "parameters/species/names", [b"a\nb", b"c"]),
        "name",
    ),
    "a long name": (
        lambda f, out: put(f, "parameters/species/names", [b"a" * 50000, b"c"]),
        "name",
    ),
}

#: What a file may have, however odd.
ODDITIES = {
    "a title in Latin-1": lambda f: f["parameters/run"].attrs.create(
        "title", np.bytes_(b"d\xfcnn")
    ),
    "a broken title": lambda f: f["parameters/run"].attrs.create(
        "title", b"\xff\x80", dtype=h5py.string_dtype()
    ),
    "a title of formulas": lambda f: f["parameters/run"].attrs.create(
        "title", np.bytes_(rb"5$ \frac{ $")
    ),
    "a note": lambda f: f["provenance"].attrs.create("note", "of a user"),
    "a link of a user": lambda f: link(f, "mine", h5py.SoftLink("/observables")),
}


def run_scripts(folder: str, stride: str) -> None:
    """Fork for each file and script from a process that has imported all of them."""
    for name in SCRIPTS:
        importlib.import_module(name)
    os.chdir(folder)
    chosen = [
        (script, fault)
        for k, fault in enumerate(FAULTS)
        for script in SCRIPTS[k % int(stride) :: int(stride)]
    ]
    json.dump([end_of(*one) for one in chosen], sys.stdout)


def end_of(script: str, fault: str) -> dict:
    """Exit code, words, seconds of processor time and megabytes of a script."""
    words = Path("words")
    child = os.fork()
    if child == 0:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(os.open(words, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
        resource.setrlimit(resource.RLIMIT_AS, (4 * 2**30,) * 2)  # lest the machine suffers
        signal.alarm(60)
        os._exit(run_script(script, *[f"{fault}.h5"] * (2 if script == "lyapunov" else 1)))
    _, status, use = os.wait4(child, 0)
    return {
        "script": script,
        "fault": fault,
        "code": os.waitstatus_to_exitcode(status),
        "words": words.read_text(errors="replace"),
        "seconds": use.ru_utime + use.ru_stime,
        "megabytes": use.ru_maxrss / 1024,
    }


@pytest.mark.parametrize("stride", [7, pytest.param(1, marks=pytest.mark.check)])
def test_scripts_answer_hostile_files_at_once(tmp_path, stride):
    """Three scripts a file, in turn, or all."""
    outside = tmp_path / "fifo"  # whoever opens it waits for ever
    os.mkfifo(outside)
    for name, (damage, _) in FAULTS.items():
        with h5py.File(ordinary(tmp_path / f"{name}.h5"), "r+") as file:
            damage(file, str(outside))
    assert all(path.stat().st_size < 2e6 for path in tmp_path.glob("*.h5"))
    places = [str(ROOT / name) for name in ("post", "tests", "tests/post")]
    code = f"import sys; sys.path[:0] = {places}; from test_post_hostile import run_scripts"
    command = [sys.executable, "-c", f"{code}; run_scripts(*sys.argv[1:])", tmp_path, str(stride)]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    ends = json.loads(run.stdout)
    assert len(ends) == sum(len(SCRIPTS[k % stride :: stride]) for k in range(len(FAULTS)))
    assert [end for end in ends if not answered_well(**end)] == []


def answered_well(script, fault, code, words, seconds, megabytes) -> bool:
    one = words.startswith(f"{script}.py: {fault}.h5: ") and words.count("\n") == 1
    soon = seconds < SECONDS and megabytes < MEGABYTES
    return code == 2 and one and FAULTS[fault][1] in words and soon


@pytest.mark.parametrize("oddity", ODDITIES)
def test_what_is_odd_but_sound_is_drawn(tmp_path, oddity, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with h5py.File(ordinary(tmp_path / "odd.h5"), "r+") as file:
        ODDITIES[oddity](file)
    for script in ("trajectory", "player"):
        assert run_script(script, "odd.h5") == 0, capsys.readouterr().err


@pytest.mark.parametrize(
    ("path", "place", "value"),
    [
        ("observables/total_energy/value", 3, np.nan),
        ("observables/collisions/time", 3, np.inf),
        ("particles/disks/velocity/value", (3, 0, 0), np.nan),
        ("events/i", 2, 9),
        ("events/i", 2, 0),
        ("events/j", 2, 2**31 - 1),
        ("events/impulse", 0, np.nan),
    ],
)
def test_what_only_some_scripts_read_is_looked_at_when_it_is_read(tmp_path, path, place, value):
    with h5py.File(ordinary(tmp_path / "a.h5"), "r+") as file:
        for name in ("time", "impulse"):
            file[f"events/{name}"] = np.arange(1.0, 6.0)
        for name in ("i", "j"):
            file[f"events/{name}"] = np.arange(1, 6)
    run = read_run(tmp_path / "a.h5")
    asked = {
        "observables": lambda run: [run.observable(n) for n in ("total_energy", "collisions")],
        "particles": lambda run: run.velocity[:],
        "events": lambda run: run.events,
    }[path.split("/")[0]]
    asked(run)
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        change(file, path, place, value)
    with pytest.raises(RunError, match=r"finite|there are not"):
        asked(read_run(tmp_path / "a.h5"))


@pytest.mark.parametrize("what", ["fifo", "device"])
def test_a_run_is_a_regular_file(tmp_path, capsys, what):
    path = tmp_path / "fifo"
    os.mkfifo(path)
    path = path if what == "fifo" else Path("/dev/zero")
    assert run_script("energy", path) == 2
    assert capsys.readouterr().err == f"energy.py: {path}: is a device, not a run\n"


#: Scripts that write a result each in their own way, and the ending of its name.
WRITERS = {
    "snapshot": "png",
    "energy": "csv",
    "export": "xyz",
    "player": "html",
    "animate": "gif",
}


@pytest.mark.parametrize("script", WRITERS)
def test_results_are_written_into_files_of_ones_own(tmp_path, monkeypatch, capsys, script):
    """Not through links, not into a FIFO or a run; a file with two names keeps the other."""
    monkeypatch.chdir(tmp_path)
    run, result = ordinary(Path("run.h5")), Path(f"result.{WRITERS[script]}")
    precious = Path("precious")
    before = run.read_bytes()

    def write() -> int:
        option = "--csv" if result.suffix == ".csv" else "-o"
        few = ["--count", "1"] if script == "animate" else []
        return run_script(script, run, option, result, *few)

    def refused(words: str) -> bool:
        code, said = write(), capsys.readouterr().err.splitlines()[-1]
        result.unlink()
        return code == 2 and said.startswith(f"{script}.py: {result}: ") and words in said

    precious.write_text("precious")
    result.symlink_to(precious)
    assert refused("not an ordinary file")
    result.symlink_to("dangling")
    assert refused("not an ordinary file")
    os.mkfifo(result)
    assert refused("not an ordinary file")
    result.hardlink_to(run)
    assert refused("HDF5")
    result.hardlink_to(precious)
    assert write() == 0 and result.stat().st_size > 50
    assert write() == 0, "an ordinary file is replaced"
    assert precious.read_text() == "precious" and run.read_bytes() == before
    assert not Path("dangling").exists()
