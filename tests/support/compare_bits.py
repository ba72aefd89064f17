"""Runs two builds of the program on every input and compares all that they write, bit for bit.

    python tests/support/compare_bits.py OLD NEW [MORE.nml...]

OLD and NEW are programs, say of two commits. Provenance is left out; the paths of a layout that
changed on purpose are named with --except. One line for each run; exit status 1 if any differ.
"""

import argparse
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from whole_runs import differences  # noqa: E402

LOG = "--set=output.event_log=true"
PERIODIC = "--set=box.boundary=periodic,periodic"
STEPS = ["--set=run.dynamics=steps", "--set=run.dt=1e-3"]
HOLES = """&box boundary = 'periodic', 'wall' /
&obstacle centre = 0.05, 0.5 radius = 0.1 / &obstacle centre = 0.7, 0.3 radius = 0.15 /
&species name = 'small' count = 300 radius = 0.01 velocities = 'uniform' /
&species name = 'big' count = 3 radius = 0.06 mass = 9 temperature = 2 /
&contact restitution = 0.95 contact_time = 1e-4 wall_rule = 'normal' /
&stop collisions = 20000 / &output frames_every_collisions = 500 event_log = .true. /
"""
DENSE = """&box boundary = 'periodic', 'periodic' /
&species name = 'a' count = 200 packing_fraction = 0.5 placement = 'dense' temperature = 1 /
&species name = 'b' count = 20 packing_fraction = 0.25 placement = 'dense' temperature = 1 /
&stop collisions_per_disk = 30 / &output observables_every_collisions = 100 /
"""
BOWL = """&box upper = 2, 2 gravity = 0, -1 /
&obstacle name = 'bowl' centre = 1, 1 radius = 1 side = 'inside' /
&obstacle centre = 1, 0.6 radius = 0.2 /
&species count = 200 radius = 0.02 speed = 1 region = 0.5, 1.5, 0.9, 1.5 /
&contact restitution = 0.9 contact_time = 1e-3 /
&stop time = 5 / &output frames_every_time = 0.5 event_log = .true. /
"""
LATTICE = """&species count = 1000 packing_fraction = 0.75 placement = 'lattice' temperature = 1 /
&stop collisions = 50000 / &output observables_every_events = 700 precision = 'single' /
"""


def systems(folder: Path, more: list[str]) -> list[tuple[Path, list[str]]]:
    """Inputs with the overrides that they run with."""
    texts = {"holes": HOLES, "dense": DENSE, "bowl": BOWL, "lattice": LATTICE}
    runs = [(path, []) for path in [*sorted((ROOT / "input").glob("*.nml")), *map(Path, more)]]
    for name, text in texts.items():
        (folder / f"{name}.nml").write_text(text)
        runs.append((folder / f"{name}.nml", []))
        runs.append((folder / f"{name}.nml", ["--set=run.queue=heap", "--set=run.seed=2"]))
    crater, gas, mixture = (ROOT / "input" / f"{name}.nml" for name in ("crater", "gas", "mixture"))
    runs += [(crater, ["--set=box.gravity=0,-3", LOG]), (crater, [PERIODIC, LOG])]
    runs += [(gas, ["--set=run.search=pairs", "--set=stop.collisions=3000"])]
    runs += [(gas, ["--set=run.search=rescan", "--set=stop.collisions=100"])]
    runs += [(gas, [LOG, *STEPS]), (mixture, [PERIODIC])]
    runs += [(folder / f"{name}.nml", [*STEPS, "--set=stop.time=2"]) for name in ("holes", "bowl")]
    return runs


def compare(programs: tuple[str, str], path: Path, overrides: list[str], work: Path) -> list[str]:
    """Names of what differs between the two programs' files."""
    files = []
    for place, program in zip(("old", "new"), programs, strict=True):
        (work / place).mkdir(parents=True)
        command = [Path(program).resolve(), path.resolve(), "-o", "run.h5", "--quiet", *overrides]
        folder = work / place
        run = subprocess.run(command, check=False, cwd=folder, capture_output=True, text=True)
        if place == "old" and run.returncode == 2 and "unknown" in run.stderr:
            return []  # an input with a variable that the old program does not have yet
        if run.returncode != 0:
            return [f"{place}: exit {run.returncode}: {run.stderr.strip()}"]
        files.append(work / place / "run.h5")
    return differences(*files)


def main() -> int:
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("old")
    parser.add_argument("new")
    parser.add_argument("more", nargs="*", metavar="MORE.nml")
    parser.add_argument("--except", nargs="*", default=[], dest="changed", metavar="PATH")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor() as pool:
        folder = Path(name)
        runs = systems(folder, args.more)
        jobs = [
            pool.submit(compare, (args.old, args.new), path, overrides, folder / str(k))
            for k, (path, overrides) in enumerate(runs)
        ]
        bad = 0
        for (path, overrides), job in zip(runs, jobs, strict=True):
            found = [x for x in job.result() if not x.startswith(tuple(args.changed))]
            bad += bool(found)
            print("DIFFERS" if found else "same", path.stem, *overrides, *found[:5])
    print(f"{len(runs) - bad} of {len(runs)} runs are the same, bit for bit")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
