"""Tests of runs/ensemble.sh: starting, skipping, resuming and reporting member runs.

In most tests a script replaces the simulation program. Tests with the real program check that
neither interruptions nor the order of member runs affect the results.
"""

import contextlib
import os
import random
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

from slurm_substitute import slurm_surroundings
from whole_runs import MIXTURE, PATIENCE, differences, environment, executable, is_asleep, occupy
from whole_runs import ran, wait_for, within, write_input

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "runs" / "ensemble.sh"
# The time of `read -t` can be over at the moment when the whole line has been read.
LATE = '() { builtin read "$@" || return; [[ $* != *-t* ]] || return $((RANDOM % 2 * 142)); }'

# This script replaces the simulation program. It records each start in OUT.starts, and waits as
# long as the file HOLD exists. On TERM it writes a checkpoint. With `outcome.exit=N` it fails with
# the exit status N: 2 also makes --check fail, 9 means that it is killed, and after 4 the run
# cannot be resumed. A member run cannot be continued with other settings.
PROGRAM = """while (($#)); do
  case $1 in
  -o) out=${2%.h5} && shift ;;
  --set) sets+="$2|" && [[ $2 != outcome.exit=* ]] || outcome=${2#*=} && shift ;;
  --resume) resumed=resumed ;;
  --check) check=check ;;
  esac
  shift
done
[[ -z ${check:-} || -z ${resumed:-} ]] || exit 2
[[ -z ${check:-} || ${outcome:-} == 2 ]] || exit 0
out=${out:-$1.check}
trap 'echo TERM >>"$out.signals"; touch "$out.h5.part"; exit 75' TERM INT
echo "${resumed:-anew} $sets" >>"$out.starts"
[[ -z ${resumed:-} || ! -e $out.broken ]] ||
  { echo "$out.h5.part: its run broke off and cannot be continued" >&2; exit 3; }
[[ ${outcome:-} != 4 ]] || touch "$out.h5.part" "$out.broken"
[[ ${outcome:-} != 9 ]] || { touch "$out.h5.part"; kill -9 $$; }
[[ -z ${outcome:-} ]] || { echo "reason of the failure" >&2; exit "$outcome"; }
while [[ -e ${HOLD:-} ]]; do sleep 0.05; done
rm -f -- "$out.h5.part"
[[ ! -e $out.h5 ]] || exit 3
echo data >"$out.h5"
"""


@pytest.fixture
def lab(tmp_path):
    """Return a folder with the replacement script, and an input file with a blank in its name."""
    folder = tmp_path / "a lab"
    folder.mkdir()
    executable(folder / "program", PROGRAM, "bash")
    (folder / "gas.nml").write_text("&run\n/\n")
    return folder


def command(lab, *options):
    return [str(SCRIPT), str(lab / "gas.nml"), "-d", str(lab / "out"), *options]


def surroundings(lab, **more):
    return environment(RICOCHET=lab / "program", HOLD=lab / "hold", **more)


def ensemble(lab, *options, seconds=None, **more):
    return ran(*within(seconds), *command(lab, *options), env=surroundings(lab, **more), cwd=lab)


@pytest.mark.parametrize(
    ("tool", "engine", "said"),
    [
        ("flock", "pool", "ensemble.sh: the program flock is missing (package util-linux)\n"),
        ("sbatch", "slurm", "--engine slurm needs"),
        ("parallel", "parallel", "--engine parallel needs"),
    ],
)
def test_a_tool_that_is_missing_is_told(lab, tool, engine, said):
    (lab / "tools").mkdir()
    for path in {*Path("/bin").iterdir(), *Path("/usr/bin").iterdir()}:
        link = lab / "tools" / path.name
        if path.name != tool and not link.is_symlink():
            link.symlink_to(path)
    few = surroundings(lab, PATH=lab / "tools")
    done = ran("bash", *command(lab, "--seeds", "1", "--engine", engine), env=few)
    assert done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1


def test_a_script_without_the_file_of_its_functions_says_so(lab):
    done = ran(shutil.copy(SCRIPT, lab), "gas.nml", "-d", "out", "--seeds", "1", cwd=lab)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert f"cannot read {lab}/ensemble_folder.sh" in done.stderr


def started(lab, *options, members):
    """Start a sweep whose members wait until the file `hold` is removed."""
    before = len(starts(lab))
    (lab / "hold").touch()
    process = subprocess.Popen(
        command(lab, *options),
        env=surroundings(lab),
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
    )
    wait_for(lambda: len(starts(lab)) == before + members and waits(process))
    return process


def workers_of(launcher) -> list[int]:
    """Return the process ids of the workers."""
    pid = launcher.pid
    return list(map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split()))


def waits(launcher) -> bool:
    """Return whether the launcher and all its workers are waiting."""
    return all(map(is_asleep, [launcher.pid, *workers_of(launcher)]))


def starts(lab):
    """Return for each member run a line per start: 'anew' or 'resumed', and the overrides."""
    return {
        path.stem: path.read_text().splitlines() for path in sorted((lab / "out").glob("*.starts"))
    }


@pytest.mark.parametrize("more", [{}, {"BASH_FUNC_read%%": LATE}])
def test_members_are_seeds_times_values(lab, more):
    """There is a member run for each seed and value; semicolons separate vector values."""
    scan = ["--scan", "species.ball.velocity=0,-1;0,-2", "--set", "contact.restitution=0.5"]
    result = ensemble(lab, "--seeds", "1-2,5", *scan, **more)
    assert result.returncode == 0
    assert starts(lab) == {
        f"ball.velocity_0_{v}_seed_{seed}": [
            f"anew contact.restitution=0.5|species.ball.velocity=0,{v}|run.seed={seed}|"
        ]
        for v in (-1, -2)
        for seed in (1, 2, 5)
    }
    assert "6 of 6 members finished, 0 failed" in result.stderr


def test_members_take_a_core_each_whatever_the_cluster_says(lab, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    with (lab / "program").open("a") as program:
        program.write('echo "$OMP_NUM_THREADS" >"$out.threads"\n')
    assert ensemble(lab, "--seeds", "1").returncode == 0
    assert (lab / "out" / "seed_1.threads").read_text() == "1\n"


def test_names_and_values_may_be_anything(lab):
    """This holds even if a list of member runs is used as a manifest."""
    names = ["*", "@", "$HOME", "a;b", "[x]", "'", '"', "!", "~", "a&b"]
    names += ["%s", "\\n", "ü", "one two"]
    rest = "--set run.title=a b --set species.ball.velocity=0,-1"
    manifest = lab / "members.txt"
    manifest.write_text("# many\n\nbare\n" + "".join(f"{name}\t{rest}\n" for name in names))
    everything = {name: ["anew run.title=a b|species.ball.velocity=0,-1|"] for name in names}
    for _ in range(2):
        assert ensemble(lab, "--manifest", str(manifest)).returncode == 0
        assert starts(lab) == everything | {"bare": ["anew "]}
        shutil.move(lab / "out" / "manifest.txt", manifest)
        shutil.rmtree(lab / "out")


def test_finished_members_are_skipped_and_checkpoints_resumed(lab):
    (lab / "out").mkdir()
    (lab / "out" / "seed_1.h5").write_text("done before")
    (lab / "out" / "seed_2.h5.part").touch()
    result = ensemble(lab, "--seeds", "1-3")
    assert result.returncode == 0
    assert starts(lab) == {"seed_2": ["resumed run.seed=2|"], "seed_3": ["anew run.seed=3|"]}
    assert (lab / "out" / "seed_1.h5").read_text() == "done before"
    assert "1 of them before" in result.stderr


@pytest.mark.parametrize("jobs", ["1", "3"])
def test_one_failure_does_not_stop_the_others(lab, jobs):
    """A failed member run is attempted once; a stopped one does not count as failed."""
    manifest = lab / "members.txt"
    manifest.write_text("a\nb\t--set outcome.exit=4\nc\nd\t--set outcome.exit=75\n")
    result = ensemble(lab, "--manifest", str(manifest), "-j", jobs)
    assert result.returncode == 1
    assert "2 of 4 members finished, 1 failed" in result.stderr
    assert "failed: b (exit 4): reason of the failure" in result.stderr
    assert [len(starts(lab)[name]) for name in "abcd"] == [1, 1, 1, 1]
    other = "-other"  # a folder may have any name
    assert ensemble(lab, "-d", other, "--scan", "outcome.exit=75").returncode == 75
    assert (lab / other / "exit_75.starts").exists()


def test_a_member_that_broke_off_starts_over(lab):
    for _ in range(2):
        assert ensemble(lab, "--scan", "outcome.exit=4").returncode == 1
    words = [line.split()[0] for line in starts(lab)["exit_4"]]
    assert words == ["anew", "resumed", "anew"]


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_reaches_each_member_once_and_the_command_goes_on(lab, how):
    with started(lab, "--seeds", "1-6", "-j", "2", members=2) as process:
        os.killpg(process.pid, how)  # as a terminal does
        said = process.communicate(timeout=PATIENCE)[1]
    assert process.returncode == 75 and not processes_of(lab)
    assert "0 of 6 members finished" in said and "stopped: the same command continues" in said
    assert len(list((lab / "out").glob("*.h5.part"))) == 2
    assert [p.read_text() for p in (lab / "out").glob("*.signals")] == ["TERM\n"] * 2
    (lab / "hold").unlink()
    assert ensemble(lab, "--seeds", "1-6").returncode == 0
    assert (
        sorted(lines[-1].split()[0] for lines in starts(lab).values())
        == ["anew"] * 4 + ["resumed"] * 2
    )


@pytest.fixture
def slurm(lab):
    """Return a function that runs a sweep on the simulated cluster and returns the messages."""
    cluster = slurm_surroundings(lab)

    def run(*options):
        return ensemble(lab, "--engine", "slurm", *options, **cluster)

    return run


def lines_of(path) -> list[str]:
    return path.read_text().splitlines() if path.exists() else []


def test_slurm_gives_up_what_failed_and_says_who_when_and_where(lab, slurm):
    """A killed member run continues; a failed one is repeated with --retry or a corrected input."""
    manifest = lab / "members.txt"
    manifest.write_text("a\nb\t--set outcome.exit=4\nc\t--set outcome.exit=9\n")
    members = ("--manifest", str(manifest))
    assert slurm(*members).returncode == 75 and lines_of(lab / "codes") == ["1", "1"]
    again = slurm(*members)
    assert again.returncode == 75 and "1 of them before, 2 failed" in again.stderr
    assert "failed: b: reason of the failure" in again.stderr
    assert "failed: c: killed by signal 9 (out of memory?), " in again.stderr
    assert [len(starts(lab)[name]) for name in "abc"] == [1, 1, 2]
    assert slurm(*members).returncode == 75 and slurm(*members).returncode == 1
    assert len(starts(lab)["c"]) == 3, "a third kill is not the machine's"
    manifest.write_text("a\nb\t--set outcome.exit=4\n")
    for options, code, times in (((), 1, 1), (("--retry",), 75, 3), ((), 1, 3)):
        assert slurm(*members, *options).returncode == code
        assert len(starts(lab)["b"]) == times
    assert len(lines_of(lab / "jobs")) == 4
    host = os.uname().nodename
    line = re.compile(rf"\d{{4}}-\d\d-\d\dT[\d:]{{8}}[+-]\d{{4}} 7_[12] {host} [abc]: \S.*")
    said = lines_of(lab / "out" / "slurm.log")
    assert said and all(map(line.fullmatch, said)), said
    manifest.write_text("b\t--set run.seed=1\n")
    assert slurm(*members).returncode == 75 and slurm(*members).returncode == 0


def test_every_task_of_an_array_is_requeued_when_its_time_is_over(lab, slurm):
    """Each under its own number, except tasks whose members have finished."""
    manifest = lab / "members.txt"
    manifest.write_text("a\t--set outcome.exit=75\nb\t--set outcome.exit=75\n")
    assert slurm("--manifest", str(manifest)).returncode == 75
    assert lines_of(lab / "requeued") == ["7_1", "7_2"]
    (lab / "requeued").unlink()
    manifest.write_text("c\nd\n")
    assert slurm("--manifest", str(manifest)).returncode == 75
    assert lines_of(lab / "requeued") == []


def test_nothing_is_submitted_with_a_member_whose_input_is_bad(lab, slurm):
    told = slurm("--scan", "outcome.exit=75,2", "--seeds", "1-3")
    assert told.returncode == 1 and "nothing is submitted" in told.stderr
    assert "failed: exit_2_seed_1 (exit 2): reason of the failure" in told.stderr
    assert "1 failed" in told.stderr and not lines_of(lab / "jobs")
    corrected = slurm("--scan", "outcome.exit=75,0", "--seeds", "1-3")
    assert corrected.returncode == 75 and len(lines_of(lab / "jobs")) == 1


@pytest.mark.parametrize(("options", "tasks"), [((), 2), (("--tasks", "1"), 1)])
def test_members_share_tasks_and_the_site_has_numbers_for_them(lab, slurm, options, tasks):
    assert slurm("--seeds", "1-5", *options).returncode == 75
    assert lines_of(lab / "array") == [str(tasks)]
    assert slurm("--seeds", "1-5").returncode == 0 and len(starts(lab)) == 5


# Each bash reads this script when it starts. The script sends TERM just before the command MOMENT,
# or before command number MOMENT of the shell. If a worker receives the signal, so does the
# launcher.
AT_A_COMMAND = """if [[ $0 == */ensemble.sh ]]; then
set -T
trap 'if [[ $BASH_COMMAND == "$MOMENT" || $((++commands_so_far)) == "$MOMENT" ]] &&
  mkdir "$LAB/sent" 2>/dev/null; then
  kill -TERM "$BASHPID"
  [[ $BASHPID == $$ ]] || kill -TERM $$
fi' DEBUG
fi
"""
#: Commands started with `&`, and a command just before one of them.
NARROW_MOMENTS = ["child=$!", "workers+=($!)", 'arguments+=(--set "$pair")']
RANDOM_MOMENTS = [str(random.Random(1).randrange(10, 500)) for _ in range(200)]


@pytest.mark.parametrize(
    "moment",
    [
        *NARROW_MOMENTS,
        *RANDOM_MOMENTS[:10],
        *(pytest.param(moment, marks=pytest.mark.check) for moment in RANDOM_MOMENTS[10:]),
    ],
)
def test_a_signal_at_any_command_leaves_nothing_behind(lab, moment):
    """After TERM at any command of the launcher or of a worker, no process remains."""
    assert moment.isdigit() or moment in SCRIPT.read_text()
    (lab / "hold").touch()
    (lab / "at_a_command").write_text(AT_A_COMMAND)
    variables = {"BASH_ENV": lab / "at_a_command", "MOMENT": moment, "LAB": lab}
    run = ensemble(lab, "--seeds", "1-3", "-j", "2", **variables)
    assert (lab / "sent").exists() and run.returncode == 75, run.stderr
    assert not processes_of(lab)
    (lab / "hold").unlink()
    assert ensemble(lab, "--seeds", "1-3").returncode == 0


def processes_of(folder) -> dict[int, list[str]]:
    """Return the commands of processes that contain the name of a folder."""
    found = {}
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):  # gone
            words = path.read_bytes().decode(errors="replace").split("\0")
            if any(str(folder) in word for word in words):
                found[int(path.parent.name)] = words
    return found


@pytest.mark.parametrize("shares", [1, 2, 3, 9])
def test_each_member_of_a_manifest_is_in_one_share(lab, shares):
    """This holds even if there are more shares than member runs."""
    manifest = lab / "members.txt"
    manifest.write_text("# members\na\nb\t--set run.seed=2\n\nc\nd\ne")
    for k in range(1, shares + 1):
        done = ensemble(lab, "--manifest", str(manifest), "--share", f"{k}/{shares}")
        assert done.returncode == 0, done.stderr
    assert {name: len(lines) for name, lines in starts(lab).items()} == dict.fromkeys("abcde", 1)


def test_two_copies_share_the_members(lab):
    copies = [started(lab, "--seeds", "1-12", "-j", "4", members=4) for _ in range(2)]
    (lab / "hold").unlink()
    codes = [finish(copy) for copy in copies]
    assert set(codes) <= {0, 75} and 0 in codes
    assert len(starts(lab)) == 12
    assert all(len(lines) == 1 for lines in starts(lab).values()), "no member ran twice"
    assert ensemble(lab, "--seeds", "1-12").returncode == 0


def test_results_of_other_settings_are_not_mixed(lab):
    assert ensemble(lab, "--seeds", "1").returncode == 0
    result = ensemble(lab, "--seeds", "1", "--set", "contact.restitution=0.9")
    assert result.returncode == 2 and "other settings" in result.stderr
    (lab / "gas.nml").write_text("&run\n  title = 'new'\n/\n")
    result = ensemble(lab, "--seeds", "1")
    assert result.returncode == 2 and "another input" in result.stderr


def test_settings_of_a_failed_member_may_be_mended(lab):
    manifest = lab / "members.txt"
    manifest.write_text("a\t--set outcome.exit=3 \n")
    assert ensemble(lab, "--manifest", str(manifest)).returncode == 1
    (lab / "gas.nml").write_text("&run\n  title = 'mended'\n/\n")
    manifest.write_text("a\t--set run.seed=1 \n")
    assert ensemble(lab, "--manifest", str(manifest)).returncode == 0
    assert starts(lab)["a"] == ["anew outcome.exit=3|", "anew run.seed=1|"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "no members"),
        (["--seeds", "1-"], "neither a number nor a range"),
        (["--seeds", "4-1"], "--seeds 4-1: in '4-1' the first seed exceeds the last"),
        (["--seeds", "1-2,3-x"], "'3-x' is neither a number nor a range"),
        (["--scan", "mass"], "write GROUP.VARIABLE=VALUE"),
        (["--seeds", "1-2", "--scan", "run.seed=1,2"], "run.seed: is given twice"),
        (["--seeds", "1", "-j", "0"], "-j 0"),
        (["--sedes", "1"], "unknown option --sedes; did you mean --seeds?"),
        (["--seeds"], "needs a value"),
        (["--seeds", "1", "--manifest", "x"], "--manifest cannot be combined"),
        (["--manifest", "/nowhere"], "cannot read"),
        (["--seeds", "1,1"], "two members have the name"),
        (["--seeds", "1-1000000000"], "more than 100000 members"),
        (["--seeds", "1-99999999999999999999"], "neither a number nor a range"),
        (["--seeds", "1-1000", "--scan", "a.b=" + "1," * 200], "more than 100000 members"),
        (["--seeds", "[0-9]*"], "'[0-9]*' is neither a number nor a range"),
        (["--seeds", "08-10"], "'08-10' is neither a number nor a range"),
        (["--seeds", "1,"], "'' is neither a number nor a range"),
        (["--seeds", "1\n2"], "'1?2' contains control characters"),
        (["--set", "run.title=a\tb", "--seeds", "1"], "control characters"),
        (["--manifest", "."], "cannot read"),
        (["--manifest", "/dev/zero"], "cannot read"),
        (["--manifest", "fifo"], "cannot read"),
        (["--seeds", "1", "--engine", "parallel", "--sshloginfile", "fifo"], "cannot read"),
        (["--seeds", "1", "--engine", "cloud"], "--engine cloud: unknown engine"),
        (["--seeds", "1", "--sshloginfile", "hosts"], "needs --engine parallel"),
        (["--seeds", "1", "--share", "0/3"], "--share 0/3: write K/M"),
        (["--seeds", "1", "--retry"], "need --engine slurm"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_2(lab, options, message):
    os.mkfifo(lab / "fifo")
    for k in range(10):
        (lab / str(k)).touch()
    result = ensemble(lab, *options, seconds=10)
    assert result.returncode == 2
    assert message in result.stderr and result.stderr.count("\n") == 1


@pytest.mark.parametrize("name", ["", "  ", "-x", ".x", "a/b", "a\x01b", "x ", "slurm", "n" * 201])
def test_what_cannot_name_a_member_is_one_line(lab, name):
    (lab / "members.txt").write_text(f"{name}\t--set run.seed=1\n")
    result = ensemble(lab, "--manifest", str(lab / "members.txt"))
    assert result.returncode == 2 and result.stderr.count("\n") == 1
    assert "cannot name a member" in result.stderr
    assert not (lab / "out").exists()


@pytest.mark.parametrize("how", ["link", "link to nothing", "hard link", "pipe", "folder", "file"])
@pytest.mark.parametrize("name", ["seed_2.log", "input.nml", "manifest.txt"])
def test_only_files_of_its_own_are_written(lab, name, how):
    """If names used by the script belong to foreign files, it reports them at the start."""
    (lab / "out").mkdir()
    precious = lab / "precious"
    precious.write_text("precious")
    occupy(lab / "out" / name, how, precious)
    result = ensemble(lab, "--seeds", "1-3")
    if (name, how) in [("manifest.txt", "hard link"), ("manifest.txt", "file")]:
        assert result.returncode == 0, "a list of members is replaced, not written to"
    else:
        assert result.returncode == 3 and result.stderr.count("\n") == 1
        assert f"out/{name} is not" in result.stderr and starts(lab) == {}
    assert precious.read_text() == "precious" and not (lab / "new").exists()


@pytest.mark.parametrize("how", ["link", "link to nothing", "hard link", "pipe", "folder"])
def test_a_log_that_is_planted_while_the_ensemble_runs_is_not_written(lab, how):
    precious = lab / "precious"
    precious.write_text("precious")
    with started(lab, "--seeds", "1-2", "-j", "1", members=1) as process:
        occupy(lab / "out" / "seed_2.log", how, precious)
        (lab / "hold").unlink()
        said = process.communicate()[1]
    assert process.returncode == 1
    assert f"failed: seed_2: cannot write {lab}/out/seed_2.log" in said
    assert precious.read_text() == "precious" and not (lab / "new").exists()
    assert list(starts(lab)) == ["seed_1"]


def test_a_folder_that_cannot_be_written_is_one_line(lab, small_disk):
    full = small_disk(4)
    (full / "filler").write_bytes(bytes(4096))

    def start(*seeds):
        return ensemble(lab, "-d", full / "out", "--seeds", *seeds)

    result = start("1-3")
    assert result.returncode == 3 and result.stderr.count("\n") == 1
    assert "No space left on device" in result.stderr
    assert list((full / "out").iterdir()) == []
    small_disk(400)
    assert start("1-3").returncode == 0
    small_disk(400, "ro")
    assert start("1-3").returncode == 0, "nothing is left to write"
    result = start("1-4")
    assert result.returncode == 3 and result.stderr.count("\n") == 1
    assert "Read-only file system" in result.stderr


def test_two_commands_at_once_remember_the_members_of_both(lab):
    lists = ["1-3", "4-6", "7-9"]
    copies = [
        subprocess.Popen(command(lab, "--seeds", seeds), env=surroundings(lab)) for seeds in lists
    ]
    assert [copy.wait() for copy in copies] == [0, 0, 0]
    lines = (lab / "out" / "manifest.txt").read_text().splitlines()
    assert lines == [f"seed_{k}\t--set run.seed={k}" for k in range(1, 10)]
    assert ensemble(lab, "--seeds", "1-9").returncode == 0


def test_dry_run_starts_nothing(lab):
    result = ensemble(lab, "--seeds", "1-2", "--dry-run")
    assert result.stdout == "seed_1\t--set run.seed=1\nseed_2\t--set run.seed=2\n"
    assert not (lab / "out").exists()


def test_dry_run_checks_the_first_member(program, tmp_path):
    """An invalid input is refused before any run starts; elements of vectors can be scanned."""
    input_file = write_input(tmp_path, MIXTURE)

    def dry(scan):
        command = [SCRIPT, input_file, "-d", tmp_path / "out", "--scan", scan, "--dry-run"]
        return ran(*command, env=environment(RICOCHET=program))

    sound = dry("box.upper(2)=1,2")
    assert (sound.returncode, sound.stderr) == (0, "")
    assert sound.stdout.splitlines()[1] == "upper_2_2\t--set box.upper(2)=2"
    wrong = dry("box.upper(3)=1,2")
    assert wrong.returncode == 2 and "member upper_3_1 cannot run" in wrong.stderr
    assert "box.upper: has 2 values" in wrong.stderr
    assert not (tmp_path / "out").exists()


@pytest.fixture
def real(program, tmp_path):
    """Return a function that starts a sweep of the real program, by default with six members."""
    text = MIXTURE.replace("event_log", "checkpoint_every = 0.05 event_log")
    input_file = write_input(tmp_path, text.replace("time = 4", "time = 20"))

    def start(folder, *options, members=("--seeds", "1-6")):
        return subprocess.Popen(
            [SCRIPT, input_file, "-d", tmp_path / folder, *members, *options],
            env=environment(RICOCHET=program),
            stderr=subprocess.PIPE,
            start_new_session=True,
            text=True,
        )

    return start


def finish(process) -> int:
    """Wait for the end of a sweep and return its exit code."""
    process.communicate(timeout=PATIENCE)
    return process.returncode


def members_in(folder) -> list[int]:
    """Return the process ids of the programs that write to a folder."""
    return [pid for pid, words in processes_of(f"{folder}/").items() if "-o" in words]


def disturb(process, folder, rng):
    """Send TERM or KILL to the launcher or to a member."""
    how = rng.choice([signal.SIGTERM, signal.SIGKILL])
    members = members_in(folder)
    victim = rng.choice(members) if members and rng.random() < 0.5 else process.pid
    try:
        os.kill(victim, how)
    except ProcessLookupError:
        return  # it has just ended


def differences_of(one, other) -> list[str]:
    """Return the differences between the six members of two sweeps."""
    names = [f"seed_{k}.h5" for k in range(1, 7)]
    return [f"{name}: {what}" for name in names for what in differences(one / name, other / name)]


@pytest.mark.parametrize("times", [5, pytest.param(20, marks=pytest.mark.check)])
def test_a_disturbed_ensemble_equals_an_undisturbed_one(real, tmp_path, times):
    """A sweep interrupted by TERM and KILL at random times has the same results."""
    begin = time.monotonic()
    assert finish(real("calm", "-j", "2")) == 0
    duration = time.monotonic() - begin
    rng, disturbed = random.Random(times), 0
    while disturbed < times:
        process = real("rough", "-j", "2")
        time.sleep(rng.uniform(0, duration / 2))
        disturb(process, tmp_path / "rough", rng)
        code = finish(process)
        assert code in (0, 1, 75, -signal.SIGTERM, -signal.SIGKILL)
        disturbed += 1
        if code == 0:
            assert differences_of(tmp_path / "calm", tmp_path / "rough") == []
            shutil.rmtree(tmp_path / "rough")
    wait_for(lambda: members_in(tmp_path / "rough") == [])
    assert finish(real("rough", "-j", "2")) == 0
    assert differences_of(tmp_path / "calm", tmp_path / "rough") == []


def test_members_depend_neither_on_order_nor_on_jobs_nor_on_company(real, ricochet, tmp_path):
    assert finish(real("one", "-j", "1")) == 0
    lines = (tmp_path / "one" / "manifest.txt").read_text().splitlines(keepends=True)
    (tmp_path / "backwards.txt").write_text("".join(reversed(lines)))
    assert finish(real("two", "-j", "3", members=("--manifest", tmp_path / "backwards.txt"))) == 0
    assert differences_of(tmp_path / "one", tmp_path / "two") == []
    run = ricochet("gas.nml", "-o", "alone.h5", "--set", "run.seed=4")
    assert run.returncode == 0
    assert differences(tmp_path / "alone.h5", tmp_path / "one" / "seed_4.h5") == []
    assert "/parameters/seed" in differences(tmp_path / "alone.h5", tmp_path / "one" / "seed_5.h5")
