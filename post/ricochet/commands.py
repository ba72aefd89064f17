#!/usr/bin/env python3
"""Commands such as ricochet-player and ricochet-lab, one for each script in post/.

`make install` copies this file once under the name of each command; commands installed by pip call
`main`. Scripts use the program in the folder of the command, or the one that RICOCHET names.
"""

import os
import runpy
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
#: Folder of the scripts: inside the package if pip installed it, otherwise its parent.
SCRIPTS = HERE / "post" if (HERE / "post").is_dir() else HERE.parent
#: Commands that are not Python scripts, with their paths in a source tree.
IN_CLONE = {"ricochet": "build/ricochet", "ricochet-ensemble": "runs/ensemble.sh"}


def main() -> None:
    """Run the script or program with the name of the command."""
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
    sys.path[0] = str(SCRIPTS)  # as if started by python post/NAME.py
    runpy.run_path(str(SCRIPTS / f"{name}.py"), run_name="__main__")


if __name__ == "__main__":
    main()
