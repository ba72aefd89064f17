"""Runs at their limits: of memory, of the stack, and of anything happening any more."""

import resource
import subprocess

import h5py
import numpy as np
import pytest

USAGE, FILES = 2, 3
GAS = """&species name = 'gas' count = {count} packing_fraction = 0.3 temperature = 1 /
&stop collisions = {collisions} /
"""
# In a small process of its own: a program inherits the largest size that its parent ever had.
MEASURE = """import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"""


@pytest.fixture
def limited(program, tmp_path):
    """`limited(count, *options, address_space=, ...)` runs a gas under limits of the shell."""

    def run(count, *options, collisions=1000, address_space=None, data=None, stack=None):
        (tmp_path / "gas.nml").write_text(GAS.format(count=count, collisions=collisions))
        limits = {resource.RLIMIT_AS: address_space, resource.RLIMIT_DATA: data}
        limits[resource.RLIMIT_STACK] = stack

        anew = [] if "--resume" in options else ["--force"]

        def set_limits():
            for kind, limit in limits.items():
                if limit:
                    resource.setrlimit(kind, (limit, limit))

        return subprocess.run(
            [program, "gas.nml", "-o", "gas.h5", "--quiet", *anew, *options],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
            preexec_fn=set_limits,
        )

    return run


def sweep(limited, count, megabytes, *words):
    """A run under each of these limits: a right result or one line; both must occur."""
    options = [part for word in words for part in ("--set", word)]
    codes = set()
    for size in megabytes:
        for kind in ("data", "address_space"):
            run = limited(count, *options, **{kind: size * 1_000_000})
            if run.returncode == 127 and kind == "address_space":
                continue  # not even the libraries fit
            assert run.returncode in (0, USAGE, FILES), run
            lines = run.stderr.splitlines()
            assert len(lines) == (run.returncode > 0) and "runtime" not in run.stderr, run
            assert (run.returncode == 0) == ("collisions = " in run.stdout), run
            codes.add(run.returncode > 0)
    assert codes == {True, False}


def test_whatever_the_limit_of_memory_the_result_is_right_or_one_line(limited):
    sweep(limited, 1000, (10, 14, 20, 30, 60))
    steps = ("run.dynamics=steps", "run.dt=1e-5", "stop.collisions=", "stop.events=1000")
    sweep(limited, 50_000, (12, 20, 45, 60, 90), *steps)


@pytest.mark.check
@pytest.mark.parametrize(
    "words",
    [
        "",
        "box.boundary=periodic,periodic output.event_log=T output.frames_every_collisions=500",
        "run.queue=heap output.precision=single",
        "run.dynamics=steps run.dt=1e-5 stop.collisions= stop.events=1000",
        "species.gas.placement=dense species.gas.packing_fraction=0.42",
        "run.search=pairs stop.collisions=100",
    ],
)
@pytest.mark.parametrize("count", [1000, 10_000, 100_000, 1_000_000])
def test_every_kind_of_run_under_every_limit_is_right_or_one_line(limited, words, count):
    if (count > 10_000 and "pairs" in words) or (count > 100_000 and "dense" in words):
        pytest.skip("takes long")
    sweep(limited, count, [*range(10, 100, 6), *range(100, 501, 40)], *words.split())


@pytest.mark.parametrize("count", [10**8, 10**9, 10**12])
def test_a_file_that_declares_absurdly_many_disks_is_refused_at_once(ricochet, tmp_path, count):
    """Its datasets take no room on the disk."""
    with h5py.File(tmp_path / "many.h5", "w") as file:
        species = {"shape": (count,), "dtype": "i4", "chunks": (2**20,)}
        file.create_dataset("particles/disks/species", **species)
        file["parameters/species/names"] = [b"gas"]
    text = GAS.format(count=1000, collisions=1).replace("temperature = 1", "file = 'many.h5'")
    (tmp_path / "gas.nml").write_text(text)
    small = {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_AS, (2**28, 2**28))}
    run = ricochet("gas.nml", "--check", seconds=2, **small)
    assert run.returncode == FILES and len(run.stderr.splitlines()) == 1
    reason = "out of memory: there is no room for" if count == 10**8 else "its size is not that"
    assert reason in run.stderr


def test_the_memory_of_a_run_does_not_grow(program, tmp_path):
    """Arrays that come and go at every sample, sorting and checkpoint leave no gaps behind."""
    text = GAS.format(count=1000, collisions=10**9).replace("0.3", "1e-4")
    (tmp_path / "gas.nml").write_text(f"&box upper = 1000, 0.001 / {text}")
    words = ("output.checkpoint_every=1e-9", "output.observables_every_events=1")
    options = [part for word in words for part in ("--set", word)]
    used = []
    for events in (10, 210):  # a checkpoint at each, or more often if the machine is slow
        command = [program, "gas.nml", "-o", "gas.h5", "--force", "--quiet", *options]
        command = ["python3", "-c", MEASURE, *command, "--set", f"stop.events={events}"]
        used.append(int(subprocess.check_output(command, cwd=tmp_path, text=True)))
    assert used[1] < used[0] + 1000  # kB


def test_the_size_of_the_output_is_told_before_it_is_written(ricochet, tmp_path):
    """Two frames of 40 bytes per disk, and 24 bytes and two checkpoints of 72."""
    (tmp_path / "gas.nml").write_text(GAS.format(count=1_000_000, collisions=1))
    grid = ["--set", "species.gas.count=", "--set", "species.gas.grid=1000,1000"]
    run = ricochet("gas.nml", "--check", *grid)
    assert run.stdout == "gas.nml: valid; 1000000 disks; the output needs at least 248 MB\n"
    assert run.stderr == ""
    many = ["--set", "output.frames_every_collisions=50000", "--set", "stop.collisions=500000"]
    run = ricochet("gas.nml", *grid, *many, "--set", "stop.wall_clock=1e-9")
    assert run.stderr.splitlines()[0] == "note: the output needs at least 608 MB"
    assert abs((tmp_path / "runs/gas.h5.part").stat().st_size / 608e6 - 1) < 1e-3


@pytest.mark.parametrize(
    ("placement", "count"),
    [("random", 100_000), pytest.param("dense", 50_000, marks=pytest.mark.check)],
)
def test_a_run_uses_no_more_memory_than_is_foretold(program, placement, count, tmp_path):
    """410 bytes per disk, and 25 MB: see `start/memory`."""
    text = GAS.format(count=count, collisions=1000)
    (tmp_path / "gas.nml").write_text(text)
    words = [f"species.gas.placement={placement}", "output.frames_every_collisions=500"]
    words += ["species.gas.packing_fraction=0.42"] if placement == "dense" else []
    options = [part for word in words for part in ("--set", word)]
    command = [program, "gas.nml", "-o", "gas.h5", "--quiet", *options]
    used = subprocess.check_output(["python3", "-c", MEASURE, *command], cwd=tmp_path, text=True)
    foretold = 410 * count + 25e6
    assert 0.4 * foretold < int(used) * 1024 < foretold


@pytest.mark.check
@pytest.mark.parametrize("threads", [1, 2])
def test_domains_use_at_most_275_bytes_per_disk(program, tmp_path, threads):
    """And 25 MB, samples apart; to the end, where one core goes on alone."""
    count = 500_000
    (tmp_path / "gas.nml").write_text(GAS.format(count=count, collisions=5 * count))
    command = [program, "gas.nml", "-o", "many.h5", "--quiet"]
    command += ["--set", f"run.threads={threads}"]
    used = subprocess.check_output(["python3", "-c", MEASURE, *command], cwd=tmp_path, text=True)
    assert int(used) * 1024 < 275 * count + 25e6


@pytest.mark.check
def test_domains_copy_no_masses_of_their_own(program, tmp_path):
    """Eight domains take eight bytes more for each disk, not for each disk in each of them."""
    side = 700
    place = (np.indices((side, side)).reshape(2, -1).T + 0.5) / side
    mass = np.linspace(1, 2, len(place))
    np.savetxt(tmp_path / "own.txt", np.column_stack([place, mass]), header="x y mass", comments="")
    (tmp_path / "own.nml").write_text(
        f"""&species file = 'own.txt' radius = {0.3 / side} temperature = 1 /
        &stop collisions = {3 * side**2} /"""
    )
    used = []
    np.savetxt(tmp_path / "x.txt", place, header="x y", comments="")
    for words in ([], ["--set", "species.mass=1", "--set", "species.file=x.txt"]):
        command = [program, "own.nml", "-o", "many.h5", "--force", "--quiet", *words]
        command = ["python3", "-c", MEASURE, *command, "--set", "run.threads=8"]
        used.append(1024 * int(subprocess.check_output(command, cwd=tmp_path, text=True)))
    assert used[0] < used[1] + 20 * len(place)


@pytest.mark.check
@pytest.mark.parametrize(
    "words",
    [
        "box.boundary=periodic,periodic output.frames_every_collisions=50000",
        "species.gas.placement=dense species.gas.packing_fraction=0.42",
        "run.dynamics=steps run.dt=1e-6 stop.collisions=100",
        "output.precision=single output.event_log=T run.queue=heap",
    ],
)
def test_a_million_disks_need_no_stack(limited, words):
    options = [part for word in words.split() for part in ("--set", word)]
    small = {"collisions": 100_000, "stack": 256 * 1024}
    run = limited(1_000_000, *options, **small)
    assert run.returncode == 0, run.stderr
    stopped = limited(1_000_000, *options, "--set", "stop.wall_clock=1e-3", **small)
    assert stopped.returncode == 75, stopped.stderr
    resumed = limited(1_000_000, *options, "--resume", **small)
    assert resumed.returncode == 0, resumed.stderr


def test_a_long_input_needs_no_stack(limited, monkeypatch):
    """Three megabytes, of comments and of walls."""
    walls = "".join(f"&wall from = 0.1, {k}e-4 to = 0.9, {k}e-4 /\n" for k in range(1, 5000))
    text = GAS.replace("count = {count}", "count = {count} region = 0, 1, 0.6, 1")
    monkeypatch.setitem(globals(), "GAS", text + walls + "! and so on\n" * 230_000)
    run = limited(10, stack=256 * 1024, collisions=5)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize(("search", "queue"), [("cells", "calendar"), ("pairs", "heap")])
@pytest.mark.parametrize("rule", ["collisions=10", "time=50"])
def test_a_run_in_which_nothing_moves_any_more_ends(ricochet, tmp_path, rule, search, queue):
    (tmp_path / "pair.nml").write_text(
        f"""&run search = '{search}' queue = '{queue}' /
        &species radius = 0.125 position = 0.25, 0.5, 0.75, 0.5 velocity = 1, 0, -1, 0 /
        &contact restitution = 0 /
        &stop {rule} /"""
    )
    run = ricochet("pair.nml", "-o", "pair.h5")
    assert run.returncode == 0, run.stderr
    assert ("note = no further events are possible" in run.stdout) == (rule != "time=50")
    with h5py.File(tmp_path / "pair.h5") as file:
        disks = file["particles/disks"]
        assert disks["position/time"][-1] == (50 if rule == "time=50" else 0.125)
        assert disks["position/value"][-1].tolist() == [[0.375, 0.5], [0.625, 0.5]]
        assert not disks["velocity/value"][-1].any()
