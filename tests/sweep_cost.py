"""Measure the cost of a sweep of many small member runs, apart from the runs themselves.

    python tests/sweep_cost.py [N]          N member runs, up to 100 000 [10 000]

A table of wall times and processor times is printed. The file of each member run is a link to one
of ten files of a real small run. Slurm is replaced by a substitute that runs nothing. The commands
are those of runs/ensemble.sh and post/gather.py.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SCRIPT = ROOT / "runs/ensemble.sh"
SMALL = """&species count = 100 packing_fraction = 0.1 speed = 1 /
&stop collisions_per_disk = 10 /
&output frames_every_collisions = 500 observables_every_collisions = 50 /
"""
ORIGINALS = 10
SBATCH = "#!/bin/sh\ncat >/dev/null\necho 7\n"


def measured(name: str, command: list[object], codes: set[int], env: Mapping[str, str]) -> None:
    """Run a command and print a row of the table."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    pipes = {"env": env, "capture_output": True, "text": True}
    done = subprocess.run(list(map(str, command)), check=False, **pipes)
    wall, after = time.monotonic() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in codes:
        sys.exit(f"{name}: exit {done.returncode}: {done.stderr}")
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(f"| {name} | {wall:.1f} s | {used:.1f} s |", flush=True)


def link_members(folder: Path, program: str, n: int, env: Mapping[str, str]) -> None:
    """Make the files of all member runs: links to a few files, written after the input."""
    names = [folder / f"original_{k}" for k in range(ORIGINALS)]
    for name in names:
        command = [program, folder / "input.nml", "-o", f"{name}.h5", "--quiet"]
        subprocess.run(command, env=env, check=True, stdout=subprocess.DEVNULL)
    for k in range(n):
        os.link(f"{names[k % ORIGINALS]}.h5", folder / f"seed_{k + 1}.h5")
    for name in names:
        Path(f"{name}.h5").unlink()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("n", nargs="?", type=int, default=10_000, help="number of members [10000]")
    n = parser.parse_args().n
    program = os.environ.get("RICOCHET", str(ROOT / "build/ricochet"))
    with tempfile.TemporaryDirectory() as name:
        home, folder = Path(name), Path(name) / "sweep"
        (home / "bin").mkdir()
        (home / "bin/sbatch").write_text(SBATCH)
        (home / "bin/sbatch").chmod(0o755)
        (home / "small.nml").write_text(SMALL)
        path = f"{home}/bin:{os.environ['PATH']}"
        env = {**os.environ, "RICOCHET": program, "PATH": path}
        command = [SCRIPT, home / "small.nml", "-d", folder, "--seeds", f"1-{n}"]
        one_share = [SCRIPT, folder / "input.nml", "-d", folder, "--manifest", folder / "left.txt"]
        print("| step | wall clock | processor |\n|---|---|---|")
        measured("plan: `--dry-run`", [*command, "--dry-run"], {0}, env)
        measured("submit: `--engine slurm`", [*command, "--engine", "slurm"], {75}, env)
        share = [*one_share, "-j", 1, "--share", f"7/{n}"]
        measured("share: one task, with its one member", share, {0}, env)
        (folder / "seed_7.h5").unlink()
        link_members(folder, program, n, env)
        measured("report: the same command, all members finished", command, {0}, env)
        gather = [sys.executable, ROOT / "post/gather.py", folder, "--csv", home / "a.csv"]
        measured("collect: `post/gather.py`", gather, {0}, env)


if __name__ == "__main__":
    main()
