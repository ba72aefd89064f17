#!/usr/bin/env python3
"""The commands ricochet-player, ricochet-lab, ..., one for each script of post/.

`make install` installs this file under the names of the commands; pip generates commands that call
`main`.  A script uses the simulation program in the folder of the command, if that folder contains
one and RICOCHET names no other program.
"""

import os
import runpy
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
#: pip installs the scripts inside the package; in a source tree they are in the folder above.
SCRIPTS = HERE / "post" if (HERE / "post").is_dir() else HERE.parent
#: Commands that are no scripts of `post/`, with their paths in a clone (after `pip install -e .`).
IN_CLONE = {"ricochet": "build/ricochet", "ricochet-ensemble": "runs/ensemble.sh"}


def main() -> None:
    """Run the script that has the name of the command."""
    command = Path(sys.argv[0]).absolute()
    if command.stem in IN_CLONE:
        path = HERE / "bin" / command.stem
        if not path.parent.is_dir():
            path = HERE.parents[1] / IN_CLONE[command.stem]
        if not path.exists():
            sys.exit(f"{command.stem}: there is no {path}: run make")
        os.execv(path, [sys.argv[0], *sys.argv[1:]])
    program = command.with_name("ricochet")
    if program.is_file() and not (HERE / "bin").is_dir():
        os.environ.setdefault("RICOCHET", str(program))
    name = command.name.removeprefix("ricochet-").replace("-", "_")
    sys.path[0] = str(SCRIPTS)  # as for python post/NAME.py
    runpy.run_path(str(SCRIPTS / f"{name}.py"), run_name="__main__")


if __name__ == "__main__":
    main()
