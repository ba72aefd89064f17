"""Report missing packages; all scripts import `ricochet` before any other package."""

import sys
from importlib.util import find_spec
from pathlib import Path

needed = ("numpy", "h5py", "matplotlib", "scipy", "tqdm", "aiohttp")
missing = [name for name in needed if not find_spec(name)]
if missing:
    script, root = Path(sys.argv[0]).resolve(), Path(__file__).resolve().parents[2]
    if (root / "Makefile").exists():
        way = f"`make demo` in {root} installs them for {root / '.venv/bin/python'}"
    else:
        way = f"`{sys.executable} -m pip install {' '.join(missing)}` does, best in a venv"
    reason = f"{sys.executable} has no {', '.join(missing)}; {way}"
    if script.parent != root / "post":
        raise ImportError(reason)
    print(f"{script.name}: {reason}", file=sys.stderr)
    sys.exit(2)
