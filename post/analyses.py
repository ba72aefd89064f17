"""List all analyses, each with a one-line description.

    python post/analyses.py

An analysis is also a script, post/NAME.py, and a function: ricochet.analyse("NAME", runs).
"""

import argparse

from ricochet import analyses
from ricochet.script import launch


def main() -> None:
    raw = argparse.RawDescriptionHelpFormatter
    argparse.ArgumentParser(description=__doc__, formatter_class=raw).parse_args()
    print(analyses)


if __name__ == "__main__":
    launch(main)
