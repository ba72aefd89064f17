#!/usr/bin/env python3
"""The commands ricochet-player, ricochet-lab, ...: one for each script of post/.

`make install` gives this file their names, pip makes them of `main`.  A script runs the program
beside its command, if there is one and RICOCHET names no other.
"""

import os
import runpy
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
#: pip puts the scripts into the package; elsewhere it is beside them.
SCRIPTS = HERE / "post" if (HERE / "post").is_dir() else HERE.parent


def main() -> None:
    """Run the script that the command is called after."""
    command = Path(sys.argv[0]).absolute()
    if command.stem == "ricochet":  # of pip
        os.execv(HERE / "bin/ricochet", [sys.argv[0], *sys.argv[1:]])
    program = command.with_name("ricochet")
    if program.is_file() and not (HERE / "bin").is_dir():
        os.environ.setdefault("RICOCHET", str(program))
    name = command.name.removeprefix("ricochet-").replace("-", "_")
    sys.path[0] = str(SCRIPTS)  # as python post/NAME.py has it
    runpy.run_path(str(SCRIPTS / f"{name}.py"), run_name="__main__")


if __name__ == "__main__":
    main()
