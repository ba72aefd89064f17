"""Table of the settings, states and results of all runs of a sweep (its member runs).

    python post/gather.py runs/scan --csv scan.csv

The table contains a row for each member run.  The first columns are the name of the run, the values
of all variables that the sweep changes, and the seed.  The next columns contain the state of the
run (finished, unfinished or failed), the reason of a failure, and the wall time in seconds.  The
last columns of the table are the final values of all scalar observables.
"""

import argparse
import csv
import sys
from collections import Counter
from pathlib import Path

from ricochet.reading.files import destination
from ricochet.running.ensembles import gathered
from ricochet.script import launch


def main() -> None:
    summary, _, text = __doc__.partition("\n")
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=summary, epilog=text, formatter_class=raw)
    parser.add_argument("folder", type=Path, help="folder of runs/ensemble.sh or ricochet.sweep")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="file for the table [printed]")
    args = parser.parse_args()
    rows = gathered(args.folder)
    columns = list(dict.fromkeys(name for row in rows for name in row))
    last = ["state", "reason"]  # the longest texts are in the last columns
    if args.csv:
        with destination(args.csv).open("w", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, columns, restval="")
            table.writeheader()
            table.writerows(rows)
    else:
        shown = [name for name in columns if "/" not in name and name not in last] + last
        table = csv.DictWriter(sys.stdout, shown, restval="", extrasaction="ignore", delimiter="\t")
        table.writeheader()
        table.writerows(rows)
    states = Counter(row["state"] for row in rows)
    told = ", ".join(f"{number} {state}" for state, number in sorted(states.items()))
    print(f"{args.folder}: {len(rows)} members: {told}", file=sys.stderr)


if __name__ == "__main__":
    launch(main)
