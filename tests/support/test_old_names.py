"""Test that former public names occur only in the table of former names."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TABLES = {
    "CHANGELOG.md",
    "src/variables/old_names.f90",
    "tests/runs/refused.txt",
    "tests/support/compare_bits.py",
    "tests/support/test_old_names.py",
    "post/ricochet/reading/reader.py",
}
OLD = [
    *("radius_spread", r"mass_by(?!_area)", "restitution_speed", "wall_collisions", "wall_impulse"),
    *("stress_tensor", "hits_per_disk", r"frames_from\s*=", r"output\.frames_from"),
    *(r"drive\.speed", r"(?:side|wall|obstacle)\.(?:\w+\.)?speed"),
    r"side\.(?:\w+\.)?(?:begin|end)",
    *(r"motion = '(?:steady|free)'", r'"motion": "(?:steady|free)"', r"distribution = 'normal'"),
    *(
        "observables/pressure",
        r"observable\(\"pressure\"",
        r"disks/collisions",
        "observables/walls",
    ),
    *(r"sides/[\w{}<>]+/(?:place|energy)", r"walls/[\w{}<>]+/(?:energy|impulse|collisions)"),
    r"piston\.nml",
]


def test_no_old_name_is_left():
    """Former names are searched as whole words in all text files of the project."""
    files = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.split("\0")
    old, found = re.compile(rf"(?<![\w-])(?:{'|'.join(OLD)})(?!\w)"), []
    for name in sorted(set(filter(None, files)) - TABLES):
        path = ROOT / name
        if path.is_file() and b"\0" not in (data := path.read_bytes()):
            found += [f"{name}: {m[0]}" for m in old.finditer(data.decode(errors="replace"))]
    assert not found
