"""Holds the project to its weight: lines of each folder of code, words of all pages.

    python tests/support/weigh.py             what has grown since weights.txt; exit status 1 if any
    python tests/support/weigh.py --record    writes weights.txt anew

So a change that makes the project heavier shows that in weights.txt, where a reader sees it.
"""

import subprocess
import sys
from collections import Counter
from pathlib import Path

RECORD = "tests/support/weights.txt"
CODE, PAGES = {"src", "tests", "post", "runs"}, "words of pages"


def weights_of(root: Path) -> Counter:
    """Lines by folder, words of pages, of all files that are or could be committed."""
    found: Counter = Counter()
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    for name in sorted(set(subprocess.check_output(command, cwd=root, text=True).splitlines())):
        path, place = root / name, Path(name).parts
        if not path.is_file() or name in (RECORD, "CHANGELOG.md"):
            continue
        if path.suffix == ".md":
            found[PAGES] += len(path.read_text().split())
        elif place[0] in CODE and path.suffix != ".png":
            found["/".join(place[:-1][:2])] += path.read_text().count("\n")
    for name, lines in list(found.items()):
        if name != PAGES:
            found[f"{name.split('/')[0]}, all"] += lines
    return found


def main(root: Path, record: bool) -> int:
    """Compares, or records; the exit status."""
    weights = weights_of(root)
    if record:
        lines = [f"{name}: {weight}\n" for name, weight in sorted(weights.items())]
        (root / RECORD).write_text("".join(lines))
        return 0
    known = dict(line.rsplit(": ", 1) for line in (root / RECORD).read_text().splitlines())
    grown = {name: n for name, n in weights.items() if n > int(known.get(name, 0))}
    for name, weight in sorted(grown.items()):
        print(f"{RECORD}: {name}: {weight}, not {known.get(name, 0)}: make lighter, or --record")
    return 1 if grown else 0


if __name__ == "__main__":
    sys.exit(main(Path.cwd(), "--record" in sys.argv))
