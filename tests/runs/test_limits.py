"""Runs at the limits of memory and stack, and runs without further events."""

import resource

import h5py
import pytest

from whole_runs import FILES, USAGE, ran

GAS = """&species name = 'gas' count = {count} packing_fraction = 0.3 temperature = 1 /
&stop collisions = {collisions} /
"""
MEASURE = """import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"""


def options(words) -> list[str]:
    return [part for word in words for part in ("--set", word)]


@pytest.fixture
def memory_of(program, tmp_path):
    """Return a function that measures the memory of a run of an input [bytes].

    A small process starts the program, because a program inherits the maximum memory size of its
    parent.
    """

    def run(text, *words) -> int:
        (tmp_path / "gas.nml").write_text(text)
        command = [program, "gas.nml", "-o", "gas.h5", "--force", "--quiet", *options(words)]
        return 1024 * int(ran("python3", "-c", MEASURE, *command, cwd=tmp_path, check=True).stdout)

    return run


@pytest.fixture
def limited(program, tmp_path):
    """Return a function that runs a gas under resource limits of the shell."""

    def run(count, *options, collisions=1000, address_space=None, data=None, stack=None):
        (tmp_path / "gas.nml").write_text(GAS.format(count=count, collisions=collisions))
        limits = {resource.RLIMIT_AS: address_space, resource.RLIMIT_DATA: data}
        limits[resource.RLIMIT_STACK] = stack
        anew = [] if "--resume" in options else ["--force"]

        def set_limits():
            for kind, limit in limits.items():
                if limit:
                    resource.setrlimit(kind, (limit, limit))

        command = [program, "gas.nml", "-o", "gas.h5", "--quiet", *anew, *options]
        return ran(*command, cwd=tmp_path, preexec_fn=set_limits)

    return run


SIZES = [*range(10, 100, 6), *range(100, 501, 40)]
STEPS = "run.dynamics=steps run.dt=1e-5 stop.collisions= stop.events=1000"
KINDS = [
    "",
    "box.boundary=periodic,periodic output.event_log=T output.frames_every_collisions=500",
    "run.queue=heap output.precision=single",
    STEPS,
    "species.gas.placement=dense species.gas.packing_fraction=0.42",
]


@pytest.mark.parametrize(
    ("count", "words", "megabytes"),
    [
        (1000, "", (*range(1, 10), 10, 20, 60)),
        (50_000, STEPS, (2, 12, 20, 60, 90)),
        *(
            pytest.param(count, words, SIZES, marks=pytest.mark.check)
            for count in (100_000, 1_000_000)
            for words in KINDS
            if count == 100_000 or "dense" not in words
        ),
    ],
)
def test_whatever_the_limit_of_memory_the_result_is_right_or_one_line(
    limited, count, words, megabytes
):
    codes = set()
    for size in megabytes:
        for kind in ("data", "address_space")[: 1 if size < 10 else 2]:  # the program starts
            run = limited(count, *options(words.split()), **{kind: size * 1_000_000})
            if run.returncode == 127:
                continue  # not even the libraries fit
            assert run.returncode in (0, USAGE, FILES), run
            lines = run.stderr.splitlines()
            assert len(lines) == (run.returncode > 0) and "runtime" not in run.stderr, run
            assert (run.returncode == 0) == ("collisions = " in run.stdout), run
            codes.add(run.returncode > 0)
    assert codes == {True, False}


@pytest.mark.parametrize("count", [10**8, 10**9, 10**12])
def test_a_file_that_declares_absurdly_many_disks_is_refused_at_once(ricochet, tmp_path, count):
    """The datasets of the file are empty."""
    with h5py.File(tmp_path / "many.h5", "w") as file:
        species = {"shape": (count,), "dtype": "i4", "chunks": (2**20,)}
        file.create_dataset("particles/disks/species", **species)
        file["parameters/species/names"] = [b"gas"]
    text = GAS.format(count=1000, collisions=1).replace("temperature = 1", "file = 'many.h5'")
    (tmp_path / "gas.nml").write_text(text)
    small = {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_AS, (2**28, 2**28))}
    run = ricochet("gas.nml", "--check", seconds=2, **small)
    assert run.returncode == FILES and len(run.stderr.splitlines()) == 1
    reason = (
        "or a smaller initial-configuration file"
        if count == 10**8
        else "its number of disks is not valid"
    )
    assert reason in run.stderr


def test_the_memory_of_a_run_does_not_grow(memory_of):
    """This holds although samples, sorting and checkpoints allocate arrays."""
    text = "&box upper = 1000, 0.001 / " + GAS.format(count=1000, collisions=10**9)
    words = ("species.gas.packing_fraction=1e-4", "output.checkpoint_every=1e-9")
    words += ("output.observables_every_events=1",)  # at least one checkpoint per sample
    few, many = (memory_of(text, *words, f"stop.events={events}") for events in (10, 210))
    assert many < few + 1e6


def assumed_memory(ricochet, *words) -> float:
    """Return the memory of a run of gas.nml as estimated by --check [bytes]."""
    said = ricochet("gas.nml", "--check", *options(words)).stdout
    return 1e6 * float(said.split("needs about ")[1].split(" MB of memory")[0])


LATTICE = """&species name = 'gas' count = {count} packing_fraction = 0.5
placement = 'lattice' velocities = 'maxwell' /
&stop collisions_per_disk = {length} /
"""


@pytest.mark.parametrize(
    ("count", "length", "words"),
    [
        (490_000, 2, ()),
        (490_000, 2, ("box.boundary=periodic,periodic", "output.frames_every_collisions=490000")),
        # shorter runs do not use domains
        pytest.param(1_000_000, 6, (), marks=pytest.mark.statistics),
        pytest.param(10_000_000, 6, (), marks=pytest.mark.check),
    ],
)
def test_a_run_takes_the_memory_that_is_assumed(memory_of, ricochet, count, length, words):
    """The memory of the disks agrees with the estimate, with and without domains.

    The memory of a run of 100 disks is subtracted from both, because the libraries of one system
    need twice as much memory as those of another. The run of 10^6 disks, the smallest with domains,
    takes 6 s.
    """
    measured, assumed = [], []
    for disks in (count, 100):
        measured.append(memory_of(LATTICE.format(count=disks, length=length), *words))
        assumed.append(assumed_memory(ricochet, *words))
    assert measured[0] - measured[1] == pytest.approx(assumed[0] - assumed[1], rel=0.05)


def test_the_size_of_the_output_is_told_before_it_is_written(ricochet, tmp_path):
    """Per disk, the output has two frames of 36 bytes, 24 bytes and two checkpoints of 72 bytes."""
    (tmp_path / "gas.nml").write_text(GAS.format(count=1_000_000, collisions=1))
    grid = ["--set", "species.gas.count=", "--set", "species.gas.grid=1000,1000"]
    run = ricochet("gas.nml", "--check", *grid)
    assert run.stdout == (
        "gas.nml: valid; 1000000 disks; the run needs about 318 MB of memory, "
        "the output at least 240 MB\n"
    )
    assert run.stderr == ""
    many = ["--set", "output.frames_every_collisions=50000", "--set", "stop.collisions=500000"]
    run = ricochet("gas.nml", *grid, *many, "--set", "stop.wall_clock=1e-9")
    assert run.stderr.splitlines()[0] == "note: the output needs at least 564 MB"
    assert abs((tmp_path / "runs/gas.h5.part").stat().st_size / 564e6 - 1) < 1e-3


@pytest.mark.parametrize(
    ("words", "count"),
    [
        ("", 100_000),
        pytest.param(
            "species.gas.placement=dense species.gas.packing_fraction=0.42",
            50_000,
            marks=pytest.mark.check,
        ),
    ],
)
def test_a_run_uses_no_more_memory_than_is_foretold(memory_of, words, count):
    """The limit is 410 bytes per disk and 25 MB, the estimate of `start/memory`."""
    text = GAS.format(count=count, collisions=1000)
    used = memory_of(text, "output.frames_every_collisions=500", *words.split())
    assert 0.4 < used / (410 * count + 25e6) < 1


@pytest.mark.check
@pytest.mark.parametrize("threads", [1, 2])
def test_domains_use_at_most_275_bytes_per_disk(memory_of, threads):
    """In addition to these and the samples, the program may use 25 MB."""
    text = GAS.format(count=500_000, collisions=2_500_000)
    assert memory_of(text, f"run.threads={threads}") < 275 * 500_000 + 25e6


@pytest.mark.check
@pytest.mark.parametrize("words", [*KINDS[1:3], STEPS, KINDS[4]])
def test_a_million_disks_need_no_stack(limited, words):
    if words == STEPS:
        words = words.replace("1e-5", "1e-6").replace("1000", "100")
    words = words.replace("collisions=500", "collisions=50000")  # a frame has 57 MB
    for more, code in ([], 0), (["--set", "stop.wall_clock=1e-3"], 75), (["--resume"], 0):
        small = {"collisions": 100_000, "stack": 256 * 1024}
        run = limited(1_000_000, *options(words.split()), *more, **small)
        assert run.returncode == code, run.stderr


def test_a_long_input_needs_no_stack(limited, monkeypatch):
    """The input consists of three megabytes of comments and walls."""
    walls = "".join(f"&wall from = 0.1, {k}e-4 to = 0.9, {k}e-4 /\n" for k in range(1, 2000))
    text = GAS.replace("count = {count}", "count = {count} region = 0, 1, 0.6, 1")
    monkeypatch.setitem(globals(), "GAS", text + walls + "! and so on\n" * 230_000)
    run = limited(10, stack=256 * 1024, collisions=5)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("rule", ["collisions=10", "time=50"])
def test_a_run_in_which_nothing_moves_any_more_ends(ricochet, tmp_path, rule):
    (tmp_path / "pair.nml").write_text(
        f"""&species radius = 0.125 position = 0.25, 0.5, 0.75, 0.5 velocity = 1, 0, -1, 0 /
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
