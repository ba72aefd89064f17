"""Table of the settings, states and results of all member runs of a sweep.

    python post/gather.py runs/scan --csv scan.csv

table (a row for each member run)
  member, overrides, seed    name of the run, and the variables that the sweep changes
  state, reason              finished, unfinished or failed, and the reason for a failure
  wall_time                  [s]
  observables                final values of all scalar observables
  flow_share                 for cooling gases: share of flows in the kinetic energy of the last
                             frame; 0 on average in a homogeneous gas, otherwise with a warning

see also
  docs/guides/ensembles.md
"""

import argparse
import csv
import sys
from collections import Counter
from pathlib import Path

from ricochet.analysis.cooling import FlowShare, flow_share
from ricochet.reading.files import counted, destination
from ricochet.reading.reader import read_run
from ricochet.running.ensembles import gathered
from ricochet.script import launch


def with_flows(folder: Path, rows: list[dict]) -> list[FlowShare]:
    """Add `flow_share` to the rows of finished cooling gases, and return all these shares."""
    found = []
    for row in rows:
        if row["state"] == "finished" and row.get("dissipated_energy", 0) > 0:
            run = read_run(folder / f"{row['member']}.h5")
            if run.nature.cooling:
                found.append(flow_share([run]))
                row["flow_share"] = found[-1].share
    return found


def main() -> None:
    summary, _, text = __doc__.partition("\n")
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=summary, epilog=text, formatter_class=raw)
    parser.add_argument("folder", type=Path, help="folder of runs/ensemble.sh or ricochet.sweep")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="file for the table [printed]")
    args = parser.parse_args()
    rows = gathered(args.folder)
    shares = with_flows(args.folder, rows)
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
    print(f"{args.folder}: {counted(len(rows), 'member')}: {told}", file=sys.stderr)
    if flowing := sum(not one.homogeneous for one in shares):
        print(
            f"warning: {flowing} of {len(shares)} cooling gases are not homogeneous at the end "
            "(flow_share); their temperatures are not those of the homogeneous state",
            file=sys.stderr,
        )


if __name__ == "__main__":
    launch(main)
