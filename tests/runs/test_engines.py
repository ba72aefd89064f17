"""Tests of sweeps with real Slurm and GNU parallel over ssh on this computer.

The daemons listen only on the loopback interface. The tests start them, and end them by their
process ids.
"""

import contextlib
import getpass
import os
import shutil
import socket
import subprocess
from pathlib import Path

import numpy as np
import pytest

from ricochet import read_run
from synthetic_run import ROOT
from whole_runs import PATIENCE, differences, environment, frames_in, ran, wait_for

# Only run by `.ci/run` and `make check`, because the tests need daemons and take a minute.
pytestmark = pytest.mark.check

SCRIPT = ROOT / "runs" / "ensemble.sh"
INPUT = ROOT / "input" / "gas.nml"
SMALL = ("--set", "species.gas.count=50", "--set", "stop.collisions_per_disk=2")
LONG = ("--set", "stop.collisions_per_disk=6000", "--set", "output.frames_every_collisions=100000")


def need(*programs: str) -> None:
    """Skip the test if programs are missing, naming these programs."""
    places = f"{os.environ['PATH']}:/usr/sbin:/sbin"
    missing = [name for name in programs if not shutil.which(name, path=places)]
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextlib.contextmanager
def daemon(folder: Path, *command, ready):
    """Start a process, wait until `ready()` is true, and end it after the block."""
    name = Path(command[0]).name
    command = [shutil.which(command[0], path=f"{os.environ['PATH']}:/usr/sbin"), *command[1:]]
    log = (folder / f"{name}.out").open("w")
    process = subprocess.Popen(list(map(str, command)), stdout=log, stderr=log)
    try:
        wait_for(lambda: ready() or process.poll() is not None)
        yield process
    finally:
        process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(10)
        process.kill()
        process.wait()
        log.close()


def answers(port: int) -> bool:
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1):
        return True
    return False


@pytest.fixture
def ensemble(program, tmp_path):
    """Return a function that runs ensemble.sh in a separate folder.

    With start=True it does not wait for the end of the script.
    """

    def run(*arguments, start=False):
        command = ["bash", SCRIPT, INPUT, "-d", "members", *map(str, arguments)]
        options = {"cwd": tmp_path, "env": environment(RICOCHET=program)}
        if start:
            return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, **options)
        return ran(*command, **options)

    return run


# --- shares of member runs ---


def test_shares_are_the_whole_without_overlap(ensemble):
    every = ensemble("--seeds", "1-7", "--dry-run").stdout.splitlines()
    parts = [
        ensemble("--seeds", "1-7", "--dry-run", "--share", f"{k}/3").stdout.splitlines()
        for k in (1, 2, 3)
    ]
    assert sorted(line for part in parts for line in part) == sorted(every) and len(every) == 7
    assert [len(part) for part in parts] == [3, 2, 2]


# --- GNU parallel ---


@pytest.fixture
def hosts(tmp_path):
    """Write a file with two hosts for GNU parallel, which are two names of one ssh server."""
    need("parallel", "sshd", "ssh", "ssh-keygen")
    folder, port = tmp_path / "ssh", free_port()
    folder.mkdir(mode=0o700)
    for key in ("host", "user"):
        ran("ssh-keygen", "-qt", "ed25519", "-N", "", "-f", folder / key, check=True)
    (folder / "authorized").write_text((folder / "user.pub").read_text())
    (folder / "sshd.conf").write_text(
        f"ListenAddress 127.0.0.1:{port}\nHostKey {folder}/host\nPidFile {folder}/pid\n"
        f"AuthorizedKeysFile {folder}/authorized\nStrictModes no\nUsePAM no\n"
        "PasswordAuthentication no\nPermitRootLogin prohibit-password\nMaxStartups 50\n"
    )
    (folder / "ssh.conf").write_text(
        f"Host nodea nodeb\n HostName 127.0.0.1\n Port {port}\n User {getpass.getuser()}\n"
        f" IdentityFile {folder}/user\n IdentitiesOnly yes\n StrictHostKeyChecking no\n"
        f" UserKnownHostsFile {folder}/known\n LogLevel ERROR\n"
    )
    if os.getuid() == 0:
        Path("/run/sshd").mkdir(exist_ok=True)
    file = folder / "hosts"
    file.write_text("".join(f"ssh -F {folder}/ssh.conf node{k}\n" for k in "ab"))
    with daemon(
        folder, "sshd", "-D", "-e", "-f", folder / "sshd.conf", ready=lambda: answers(port)
    ):
        yield file


def test_parallel_runs_all_members_on_this_machine(ensemble, tmp_path):
    need("parallel")
    folder = ("-d", "my members")  # a blank must not matter
    arguments = (*folder, "--engine", "parallel", "-j", 2, "--seeds", "1-4", *SMALL)
    result = ensemble(*arguments)
    assert result.returncode == 0, result.stderr
    assert "4 of 4 members finished" in result.stderr
    again = ensemble(*arguments)
    assert again.returncode == 0 and "4 of them before" in again.stderr
    plain = ensemble("-d", "plain", "--seeds", "1-4", *SMALL)
    assert plain.returncode == 0
    for k in range(1, 5):
        pair = [tmp_path / folder / f"seed_{k}.h5" for folder in ("my members", "plain")]
        assert differences(*pair) == []


def test_parallel_runs_members_on_two_hosts(ensemble, hosts, tmp_path):
    arguments = ("--engine", "parallel", "--sshloginfile", hosts, "-j", 1, "--seeds", "1-6", *SMALL)
    result = ensemble(*arguments)
    log = (tmp_path / "ssh" / "sshd.out").read_text()
    assert result.returncode == 0, result.stderr + (tmp_path / "members/parallel.log").read_text()
    assert len(list((tmp_path / "members").glob("seed_*.h5"))) == 6
    assert log.count("Accepted publickey") >= 6


def test_parallel_reports_a_member_that_fails(ensemble):
    """With inelastic walls the disks undergo an inelastic collapse under gravity."""
    need("parallel")
    gas = ("species.gas.count=50", "box.gravity=0,-100", "stop.collisions_per_disk=100")
    settings = [word for value in gas for word in ("--set", value)]
    scan = ("--scan", "contact.wall_restitution=1,0.5")
    result = ensemble("--engine", "parallel", "-j", 2, *settings, *scan)
    assert result.returncode == 1
    assert "1 of 2 members finished, 1 failed" in result.stderr
    assert "failed: wall_restitution_0.5" in result.stderr


def test_term_reaches_members_on_other_hosts(ensemble, hosts, tmp_path):
    """TERM stops the member runs on other hosts, and the same command completes them."""
    arguments = ("--engine", "parallel", "--sshloginfile", hosts, "-j", 1, "--seeds", "1-2", *LONG)
    running, folder = ensemble(*arguments, start=True), tmp_path / "members"
    wait_for(lambda: sum(frames_in(path) > 0 for path in folder.glob("*.part")) == 2)
    running.terminate()
    _, errors = running.communicate(timeout=PATIENCE)
    assert running.returncode == 75, errors
    assert len(list(folder.glob("*.h5.part"))) == 2
    assert not list(folder.glob("seed_?.h5"))
    again = ensemble(*arguments)
    assert again.returncode == 0, again.stderr
    assert len(list(folder.glob("seed_?.h5"))) == 2


# --- Slurm ---


@pytest.fixture
def cluster(tmp_path, monkeypatch):
    """Start a Slurm cluster that consists of this computer, and set its environment variables."""
    need("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scontrol")
    if os.getuid() != 0:
        pytest.skip("Slurm's daemons need root")
    folder = tmp_path / "slurm"
    for name in ("", "state", "spool"):
        (folder / name).mkdir(mode=0o755)
    (folder / "key").write_bytes(os.urandom(128))
    (folder / "key").chmod(0o400)
    host, munge = socket.gethostname().split(".")[0], folder / "m"
    ports = free_port(), free_port()
    (folder / "slurm.conf").write_text(
        f"""ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket={munge},cred_expire=5
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
KillWait=30
SchedulerParameters=batch_sched_delay=0,sched_interval=1
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""
    )
    monkeypatch.setenv("SLURM_CONF", str(folder / "slurm.conf"))
    files = {name: f"{folder}/munged.{name}" for name in ("log", "pid", "seed")}

    def slurm(*command) -> str:
        return ran(*command).stdout

    with contextlib.ExitStack() as stack:
        munged = ["munged", "-F", "-f", f"--key-file={folder}/key", f"--socket={munge}"]
        munged += [f"--{name}-file={path}" for name, path in files.items()]
        for command, ready in (
            (munged, munge.exists),
            (["slurmctld", "-D"], lambda: answers(ports[0])),
            (["slurmd", "-D"], lambda: "idle" in slurm("sinfo", "--noheader")),
        ):
            stack.enter_context(daemon(folder, *command, ready=ready))
        yield slurm
        slurm("scancel", "--quiet", "--user", getpass.getuser())
        wait_for(lambda: not slurm("squeue", "--noheader").strip())


def test_slurm_runs_all_members(ensemble, cluster, tmp_path):
    arguments = ("--engine", "slurm", "-j", 2, "--seeds", "1-4", *SMALL)
    first = ensemble(*arguments)
    assert first.returncode == 75 and "submitted" in first.stderr, first.stderr
    folder = tmp_path / "members"
    wait_for(lambda: len(list(folder.glob("seed_*.h5"))) == 4)
    wait_for(lambda: not cluster("squeue", "--noheader").strip())
    last = ensemble(*arguments)
    assert last.returncode == 0 and "4 of 4 members finished" in last.stderr


def test_slurm_extends_finished_members_with_the_same_bits(ensemble, cluster, tmp_path):
    """A sweep with a later end submits its finished members again, and each of them continues."""
    later = ("--set", "stop.collisions_per_disk=4")
    arguments = ("--engine", "slurm", "-j", 2, "--seeds", "1-2", *SMALL)
    ensemble(*arguments)
    folder = tmp_path / "members"
    wait_for(lambda: len(list(folder.glob("seed_?.h5"))) == 2)
    wait_for(lambda: not cluster("squeue", "--noheader").strip())
    told = ensemble(*arguments, *later)
    assert told.returncode == 75 and "submitted" in told.stderr, told.stderr
    wait_for(lambda: not cluster("squeue", "--noheader").strip())
    told = ensemble(*arguments, *later)
    assert told.returncode == 0 and "2 of 2 members finished" in told.stderr, told.stderr
    assert ensemble("-d", "whole", "--seeds", "1-2", *SMALL, *later).returncode == 0
    for name in ("seed_1", "seed_2"):
        runs = [read_run(tmp_path / place / f"{name}.h5") for place in ("whole", "members")]
        assert np.array_equal(*(one.position[-1] for one in runs))
        assert np.array_equal(*(one.velocity[-1] for one in runs))


def test_slurm_is_not_given_the_same_work_twice_and_keeps_the_limit(ensemble, cluster, tmp_path):
    arguments = ("--engine", "slurm", "-j", 1, "--seeds", "1-2", *LONG)
    ensemble(*arguments)
    folder = tmp_path / "members"
    wait_for(lambda: list(folder.glob("*.part")))
    again = ensemble(*arguments)
    assert again.returncode == 75 and "is not finished: 0 of 2 members finished" in again.stderr
    assert len(list(folder.glob("*.part"))) == 1  # %1, although there are two processors
    assert len(cluster("squeue", "--noheader", "--array").splitlines()) == 2


@pytest.mark.parametrize(
    "how",
    [
        ("scontrol", "requeue"),  # Slurm starts it again after `cred_expire` seconds
        ("scancel", "--batch", "--signal=TERM"),  # as --signal=B:TERM@60 does at the time limit
    ],
)
def test_a_member_that_is_put_back_goes_on(ensemble, cluster, tmp_path, how):
    arguments = ("--engine", "slurm", "-j", 1, "--seeds", "1-1", *LONG)
    ensemble(*arguments)
    folder = tmp_path / "members"
    wait_for(lambda: list(folder.glob("*.part")))
    job = (folder / "slurm.job").read_text().strip()
    cluster(*how, f"{job}_1")
    wait_for(lambda: "stopped" in (folder / "seed_1.log").read_text())
    assert not list(folder.glob("seed_?.h5"))
    wait_for(lambda: list(folder.glob("seed_1.h5")))


def test_a_time_limit_puts_every_task_back(ensemble, cluster, tmp_path, monkeypatch):
    """This includes the last task of the array: two tasks of one member each stay in the queue."""
    monkeypatch.setenv("SBATCH_TIMELIMIT", "00:02:00")
    endless = (*LONG, "--set", "stop.collisions_per_disk=", "--set", "stop.time=1e9")
    ensemble("--engine", "slurm", "-j", 2, "--seeds", "1-2", *endless)
    logs = [tmp_path / f"members/seed_{k}.log" for k in (1, 2)]
    wait_for(lambda: all(log.exists() and "stopped" in log.read_text() for log in logs))
    waiting = "squeue", "--noheader", "--array", "--format=%K %r"
    wait_for(lambda: len(cluster(*waiting).splitlines()) == 2)
    job = (tmp_path / "members/slurm.job").read_text().strip()

    def shown(k):
        return cluster("scontrol", "show", "job", f"{job}_{k}")

    wait_for(lambda: "Restarts=1" in shown(1) and "Restarts=1" in shown(2))
