"""What the fuzzers share: runs with a limit, many cases judged side by side, their command line."""

import argparse
import os
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests"))
from whole_runs import PATIENCE, within  # noqa: E402


def limited(command: list, seconds: int, **options) -> subprocess.CompletedProcess | None:
    """A run; None if so much processor time was not enough."""
    options |= {"capture_output": True, "timeout": PATIENCE}
    run = subprocess.run([*within(seconds), *command], check=False, **options)
    return None if run.returncode == -signal.SIGKILL else run


def tally(judge: Callable, cases: Iterable, harmless: set[str]) -> Counter:
    """Verdicts by kind; `judge` gives one and its details, shown on stderr if there is harm."""
    verdicts: Counter = Counter()
    cases = list(cases)
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        for case, (verdict, details) in zip(cases, pool.map(judge, cases), strict=True):
            verdicts[verdict] += 1
            if verdict not in harmless:
                print(f"--- {verdict}: {details}\n{case!r}", file=sys.stderr)
    return verdicts


def run(description: str, fuzz: Callable, harmless: set[str], count: int) -> int:
    """The command line of a fuzzer `fuzz(program, count, seed)`; the exit status."""
    parser = argparse.ArgumentParser(description=description.split("\n")[0])
    parser.add_argument("--count", type=int, default=count, help="number of cases (%(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the cases (%(default)s)")
    parser.add_argument(
        "--program",
        default=os.environ.get("RICOCHET", str(ROOT / "build" / "ricochet")),
        help="the program (%(default)s)",
    )
    options = parser.parse_args()
    verdicts = fuzz(str(Path(options.program).resolve()), options.count, options.seed)
    found = ", ".join(f"{number} {verdict}" for verdict, number in sorted(verdicts.items()))
    print(f"{Path(sys.argv[0]).name} --count {options.count} --seed {options.seed}: {found}")
    return 0 if set(verdicts) <= harmless else 1
