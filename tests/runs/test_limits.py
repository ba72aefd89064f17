"""Runs at their limits: of memory, of the stack, and of anything happening any more."""

import re
import resource
import subprocess

import h5py
import pytest

USAGE = 2
GAS = """&species name = 'gas' count = {count} packing_fraction = 0.3 temperature = 1 /
&stop collisions = {collisions} /
"""
# In a small process of its own: a program inherits the largest size that its parent ever had.
MEASURE = """import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"""


@pytest.fixture
def limited(program, tmp_path):
    """`limited(count, *options, address_space=, stack=)` runs a gas under limits of the shell."""

    def run(count, *options, collisions=1000, address_space=None, stack=None):
        (tmp_path / "gas.nml").write_text(GAS.format(count=count, collisions=collisions))
        limits = {resource.RLIMIT_AS: address_space, resource.RLIMIT_STACK: stack}

        def set_limits():
            for kind, limit in limits.items():
                if limit:
                    resource.setrlimit(kind, (limit, limit))

        return subprocess.run(
            [program, "gas.nml", "-o", "gas.h5", "--force", "--quiet", *options],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
            preexec_fn=set_limits,
        )

    return run


def needed_megabytes(run) -> int:
    """What a run that was refused in one line says it needs."""
    assert run.returncode == USAGE
    found = re.fullmatch(
        r"species\.count: (\d+) disks need about (\d+) MB of memory; "
        r"(?:ulimit -v|the machine|the control group) leaves \d+ MB; use fewer disks\n",
        run.stderr,
    )
    assert found, run.stderr
    return int(found[2])


def test_more_disks_than_memory_are_refused_in_one_line(limited):
    run = limited(100_000_000, "--check", address_space=2**30)
    assert needed_megabytes(run) > 10_000
    assert limited(1000, address_space=2**30).returncode == 0


@pytest.mark.parametrize(
    ("placement", "count"),
    [("random", 100_000), pytest.param("dense", 50_000, marks=pytest.mark.check)],
)
def test_the_memory_foretold_is_the_memory_used(limited, program, placement, count, tmp_path):
    options = ["--set", f"species.gas.placement={placement}"]
    if placement == "dense":
        options += ["--set", "species.gas.packing_fraction=0.42"]
    # The smallest room in which the program with its libraries can start at all.
    rooms = range(30_000_000, 300_000_000, 10_000_000)
    tries = (limited(count, *options, address_space=room) for room in rooms)
    foretold = needed_megabytes(next(run for run in tries if run.returncode != 127))
    options += ["--set", "output.frames_every_collisions=500"]
    command = [program, "gas.nml", "-o", "gas.h5", "--quiet", *options]
    used = subprocess.check_output(["python3", "-c", MEASURE, *command], cwd=tmp_path, text=True)
    assert 0.4 * foretold < int(used) * 1024 / 1e6 < foretold


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


@pytest.mark.parametrize(("search", "queue"), [("cells", "calendar"), ("pairs", "heap")])
@pytest.mark.parametrize("rule", ["collisions=10", "time=50"])
def test_a_run_in_which_nothing_moves_any_more_ends(ricochet, tmp_path, rule, search, queue):
    (tmp_path / "pair.nml").write_text(
        f"""&run search = '{search}' queue = '{queue}' /
        &species radius = 0.125 position = 0.25, 0.5, 0.75, 0.5 velocity = 1, 0, -1, 0 /
        &contact restitution = 0 /
        &stop {rule} /"""
    )
    run = ricochet("pair.nml", "-o", "pair.h5", timeout=30)
    assert run.returncode == 0, run.stderr
    assert ("note = no further events are possible" in run.stdout) == (rule != "time=50")
    with h5py.File(tmp_path / "pair.h5") as file:
        disks = file["particles/disks"]
        assert disks["position/time"][-1] == (50 if rule == "time=50" else 0.125)
        assert disks["position/value"][-1].tolist() == [[0.375, 0.5], [0.625, 0.5]]
        assert not disks["velocity/value"][-1].any()
