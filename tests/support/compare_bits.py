"""Run two builds of the program with every input file, and compare the results bit for bit.

    python tests/support/compare_bits.py OLD NEW [MORE.nml...]

OLD and NEW are builds of the program, for example of two commits. Results are compared for all
input files and for random systems, except the group `provenance` of the output files. One line is
printed for each run; it ends in "unknown to OLD" if OLD refuses the input because of an unknown
variable. The exit status is 1 if any runs differ.

--except      paths of datasets whose layout was changed on purpose
--sums 1e-13  sums over collisions may differ by this fraction of their largest value or of the
energy
--old-names   OLD has the former public names (tables OLD_WORDS and OLD_PATHS), with which its input
files are written and which are converted in its output
"""

import argparse
import random
import re
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from random_systems import random_system, starting_file  # noqa: E402
from whole_runs import contents, ran, unlike, write_input  # noqa: E402

SYSTEMS = 60

# Former names in input files: for each group, patterns of present names, and the former names.
OLD_WORDS = {
    "side": {
        r"\bstart_time(?= *=)": "begin",
        r"\bend_time(?= *=)": "end",
        "'constant_velocity'": "'steady'",
        "'piston'": "'free'",
        r"\bsurface_velocity(?= *=)": "speed",
    },
    "obstacle": {r"\bsurface_velocity(?= *=)": "speed"},
    "wall": {r"\bsurface_velocity(?= *=)": "speed"},
    "drive": {r"\bself_propulsion_speed(?= *=)": "speed"},
    "species": {
        r"\bpolydispersity(?= *=)": "radius_spread",
        "'gaussian'": "'normal'",
        r"\bmass_scaling(?= *=)": "mass_by",
        "'equal'": "'number'",
    },
    "contact": {r"\breference_speed(?= *=)": "restitution_speed"},
    "output": {r"\bdecades_from(?= *=)": "frames_from", "'event_count'": "'collisions'"},
}
# Former names of datasets: patterns of former names, and the present names.
OLD_PATHS = {
    r"(/parameters/(?:side/\w+@|obstacle/|wall/))speed$": r"\1surface_velocity",
    r"(/parameters/drive@)speed$": r"\1self_propulsion_speed",
    r"(/parameters/species/[^@]+@)radius_spread$": r"\1polydispersity",
    r"(/parameters/species/[^@]+@)mass_by$": r"\1mass_scaling",
    r"(/parameters/contact@)restitution_speed$": r"\1reference_speed",
    r"(/parameters/output@)frames_from$": r"\1decades_from",
    r"(/observables/)wall_(collisions|impulse)(?=[/@]|$)": r"\1side_\2",
    r"(/observables/)pressure(?=[/@]|$)": r"\1virial_pressure",
    r"(/observables/)stress_tensor(?=[/@]|$)": r"\1kinetic_tensor",
    r"(/particles/disks/)collisions(?=[/@]|$)": r"\1event_count",
    r"(/observables/(?:sides|walls)/[^/]+)/energy(?=[/@]|$)": r"\1/energy_to_disks",
    r"(/observables/)walls(?=[/@]|$)": r"\1obstacles",
    r"(/observables/sides/\w+)/place(?=[/@]|$)": r"\1/position",
    r"(/parameters/side/\w+@)begin$": r"\1start_time",
    r"(/parameters/side/\w+@)end$": r"\1end_time",
}
OLD_VALUES = {
    r"/parameters/side/\w+@motion": {b"steady": b"constant_velocity", b"free": b"piston"},
    r"/parameters/species/[^@]+@radius_distribution": {b"normal": b"gaussian"},
    r"/parameters/species/[^@]+@mass_by": {b"number": b"equal"},
}


def for_old(text: str) -> str:
    """Return an input text with the former names of variables."""

    def group(match: re.Match) -> str:
        text = match[0]
        for pattern, word in OLD_WORDS.get(match[1], {}).items():
            text = re.sub(pattern, word, text)
        return text

    return re.sub(r"^[ \t]*&(\w+)(?:'[^']*'|![^\n]*|[^'/!])*/", group, text, flags=re.M)


def of_old(found: dict) -> dict:
    """Return the datasets of an earlier program under their present names."""
    renamed = dict(found)
    for pattern, words in OLD_VALUES.items():
        for path in filter(re.compile(pattern).fullmatch, found):
            renamed[path] = words.get(bytes(found[path]), found[path])
    for pattern, now in OLD_PATHS.items():
        renamed = {re.sub(pattern, now, path): value for path, value in renamed.items()}
    return renamed


def random_inputs(folder: Path) -> list[Path]:
    """Write random inputs and their initial-configuration files, each into a folder of its own."""
    inputs = []
    for k in range(SYSTEMS):
        system, place = random_system(random.Random(k)), folder / f"random_{k}"
        place.mkdir()
        (place / "start.txt").write_text(starting_file(system.columns, system.table))
        inputs.append(write_input(place, system.text, f"{place.name}.nml"))
    return inputs


#: Sums over collisions, whose rounding errors depend on the order of summation and on their units.
SUMS = re.compile(
    "/observables/(virial(_tensor|_pressure)?|side_impulse|dissipated_energy|heat|work|drive_energy"
    r"|heat_virial|helfand_\w+|(sides|obstacles)/\w+/\w+)/value"
)


def is_near(name: str, old: dict, new: dict, share: float) -> bool:
    """Return whether two sums agree within a fraction of their largest value or of the energy."""
    if not (SUMS.fullmatch(name) and name in old and name in new):
        return False
    a, b = old[name], new[name]
    scale = max(np.abs(found).max() for found in (a, old["/observables/total_energy/value"]))
    return a.shape == b.shape and np.abs(a - b).max() <= share * scale


def compare(
    programs: tuple[str, str], path: Path, work: Path, share: float, old_names: bool
) -> list[str] | None:
    """Return the differences between the results of two programs: exit codes, or dataset names.

    The result is None if the input contains a variable that is unknown to the old program.
    """
    ends, files, text = [], [], path.read_text()
    text_of_old = for_old(text) if old_names else text
    for name, program in zip(("old", "new"), programs, strict=True):
        output, source = work / name / path.with_suffix(".h5").name, path.resolve()
        if name == "old" and text_of_old != text:
            source = work / f"old_{path.name}"
            source.write_text(text_of_old)
        command = [Path(program).resolve(), source, "-o", output, "--quiet"]
        run = ran(*command, cwd=path.parent)
        ends.append((run.returncode, run.stderr.replace(str(output), output.name)))
        part = output.with_name(f"{output.name}.part")
        files += [file for file in (output, part) if file.exists()]
    if ends[0][0] == 2 and "unknown" in ends[0][1]:
        return None
    if ends[0] != ends[1] or not files:
        return [f"{ends}"] * (ends[0] != ends[1])
    old, new = map(contents, files)
    if text_of_old != text:
        old["/parameters/input"] = new["/parameters/input"]
    if old_names:
        old = of_old(old)
    return [name for name in unlike(old, new) if not is_near(name, old, new, share)]


def main() -> int:
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("old")
    parser.add_argument("new")
    parser.add_argument("more", nargs="*", type=Path, metavar="MORE.nml")
    parser.add_argument("--except", nargs="*", default=[], dest="changed", metavar="PATH")
    parser.add_argument("--sums", type=float, default=0, metavar="SHARE")
    parser.add_argument("--old-names", action="store_true")
    args = parser.parse_args()
    programs = args.old, args.new
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor() as pool:
        inputs = [*sorted((ROOT / "input").glob("*.nml")), *args.more, *random_inputs(Path(name))]
        found = pool.map(
            lambda path: compare(programs, path, Path(name), args.sums, args.old_names), inputs
        )
        bad = unknown = 0
        for path, told in zip(inputs, found, strict=True):
            if told is None:
                unknown += 1
                print("unknown to OLD", path.stem)
                continue
            names = [x for x in told if not x.startswith(tuple(args.changed))]
            bad += bool(names)
            print("DIFFERS" if names else "same", path.stem, *names[:5])
    same, tried = len(inputs) - bad - unknown, len(inputs) - unknown
    print(f"{same} of {tried} runs are the same, bit for bit; {unknown} are unknown to OLD")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
