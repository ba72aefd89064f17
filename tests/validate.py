"""Validate the physics: run the program on every case, and compare with the references.

    python tests/validate.py                    all cases
    python tests/validate.py P4 P7-01           cases whose names begin with P4 or P7-01
    python tests/validate.py --seed-shift 100   the same with other random numbers

The program is build/ricochet, or the one that the variable RICOCHET names. Exit codes: 0 all cases
pass, 1 some fail, 2 wrong usage.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "post"))

from validation import CASES, report
from validation.running import validate

ROOT = Path(__file__).resolve().parents[1]


def command_line() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cases", nargs="*", metavar="CASE", help="beginnings of names [all]")
    parser.add_argument("-j", "--jobs", type=int, default=os.cpu_count(), help="runs at a time")
    parser.add_argument("--report", type=Path, metavar="BASE", help="write BASE.md and BASE.json")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep the runs")
    parser.add_argument("--seed-shift", type=int, default=0, help="added to all seeds [0]")
    parser.add_argument("--list", action="store_true", help="print the cases and stop")
    return parser


def main() -> int:
    parser = command_line()
    args = parser.parse_args()
    wanted = tuple(args.cases) or ("",)
    cases = [case for case in CASES if case.id.startswith(wanted)]
    if unknown := [w for w in wanted if not any(case.id.startswith(w) for case in CASES)]:
        parser.error(f"no case begins with {', '.join(unknown)}; --list shows all")
    if args.list:
        print(*(f"{case.id:10} {case.what}" for case in cases), sep="\n")
        return 0
    program = Path(os.environ.get("RICOCHET", ROOT / "build" / "ricochet")).resolve()
    if not os.access(program, os.X_OK):
        parser.error(f"no program at {program}: run make first, or set RICOCHET")
    version = subprocess.run([program, "--version"], capture_output=True, text=True, check=True)
    begin = time.monotonic()
    verdicts = []
    with tempfile.TemporaryDirectory(prefix="validation") as folder:
        for verdict in validate(
            cases, program, args.keep or Path(folder), args.jobs, args.seed_shift
        ):
            verdicts.append(verdict)
            print(line(verdict), flush=True)
    seconds = time.monotonic() - begin
    print(report.outcome([report.as_data(verdict) for verdict in verdicts], seconds))
    if args.report:
        report.write(args.report, verdicts, version.stdout.split("\n")[0], seconds)
    return 0 if all(verdict.passed for verdict in verdicts) else 1


def line(verdict) -> str:
    """Return a verdict as a line for the terminal."""
    mark = "pass" if verdict.passed else "FAIL"
    measured = report.measured(verdict.measured, verdict.error)
    values = f"{report.number(verdict.reference, 8):>14} {measured:>22}"
    tail = verdict.problem or verdict.case.what
    return f"{mark} {verdict.case.id:10} {values} {verdict.used:6.2f}  {tail}"


if __name__ == "__main__":
    sys.exit(main())
