"""Write the results of the textbook exercises into the pages of docs/tutorials.

    make figures                     or runs/mixture.sh, cooling.sh, crater.sh, gravity.sh alone
    python docs/tasks_page.py        reads runs/figures into docs/tasks.json, and writes the pages

docs/tasks.json contains each measured number on the pages with its error. On a page, each text that
the script replaces is enclosed in two HTML comments, the first of which is its name.
"""

import csv
import json
import re
import sys
import textwrap
from pathlib import Path

from ricochet.analysis.statistics import rounded_to_error

DOCS = Path(__file__).resolve().parent
TABLES = DOCS.parent / "runs" / "figures"
BLANK = re.compile(r"{(\S+?)}")  # placeholder of a number in a text
Numbers = dict[str, tuple[float, float | None]]  # value and error (None if there is none)

PAGES = ("exam", "gravity")
TEXTS = {
    "mixture": """\
The following values are means over eight seeds. The light disks end with ⟨K⟩ = {K_light} and the
heavy disks with {K_heavy}. The theoretical value is 1.25. The mean speed of the light disks is
{v_light} (theory {v_light_theory}), and that of the heavy disks is {v_heavy} (theory
{v_heavy_theory}).
""",
    "cooling": """\
After 20 collisions per disk the temperature of the heavy disks, divided by that of the light disks,
is {ratio_1} for ξ = 1, {ratio_0.9} for ξ = 0.9 and {ratio_0.8} for ξ = 0.8. These are means over
eight seeds. For ξ < 1 the heavy disks are hotter than the light disks, so the gas violates
equipartition.
""",
    "walls": """\
For ξ = 0.8 and eight seeds, the ratio K/K₀ after 20 collisions per disk is {left_velocity} with the
walls of the exam. With smooth walls it is {left_normal}.
""",
    "crater": """\
- *Size.* Of the 2000 grains in the bed, {hit} are hit, and {displaced} move by more than their
  radius. The displaced grains come from a region {width} wide and {depth} deep. These numbers are
  means over eight beds.
- *Mass.* The number of grains hit grows as the mass of the projectile to the power {hit_mass}.
- *Speed.* The crater does not depend on the speed: the fitted exponent of the number of grains hit
  is {hit_speed}.
- *Radius.* In a large bed the crater shrinks slowly with the radius of the projectile. In a small
  bed it grows with the radius, because a small projectile reaches the floor and loses its energy
  there. All beds in the figure have 2000 grains. Open points are small projectiles that reach the
  floor of such a bed.
- *Restitution.* As ξ approaches 1, the crater grows until it includes the whole bed.

| grains in the bed | hit with radius 2 | radius 5 | radius 10 |
|---|---|---|---|
| 5000 | 1043 | 951 | 905 |
| 1000 | 537 | 610 | 663 |

How large must the bed be? A bed needs about 7.5 M (1/f - 1)/(1 - ξ²) grains. Here M is the mass
ratio, and f is the fraction of the energy that is left at the end. The formula holds for
projectiles with 5 to 10 times the radius of a grain. With a ratio of 2 or 3 the projectile
penetrates deeper, and the bed needs 1.5 times this number. This exercise would need 2250 grains.
The slightly smaller bed of 2000 grains is acceptable, because fewer than 20 collisions with walls
occur. If more wall collisions occur, the scripts exclude the crater from the fit and draw it as an
open symbol.
""",
    "energy": """\
With every method the total energy is constant to a relative error of {energy_change}. The table
compares the measured fraction of missed collisions with the calculated fraction. The measurement
used 32 pairs of runs of 520 s.

| dt | missed (%) | formula (%) |
|---|---|---|
| 0.001 | {missed_0.001} | {expected_0.001} |
| 0.002 | {missed_0.002} | {expected_0.002} |
| 0.004 | {missed_0.004} | {expected_0.004} |
""",
    "equipartition": """\
The mean energies of the two species agree within 10 % after the time T_therm. It hardly depends on
v₀: among the four values of v₀, the shortest time is ({T_first}) s, and the longest ({T_last}) s.
""",
    "laws": """\
The table lists the slopes measured with seed 1, divided by the slopes of the exponential laws. The
dashed lines in the figure show the laws for 60 disks of finite size with a fixed energy. The
slopes of these laws differ slightly from 1 (last column).

| histogram | measured | law for 60 disks |
|---|---|---|
| v², species A | {speed_A} | {speed_law} |
| v², species B | {speed_B} | {speed_law} |
| height, species A | {height_A} | {height_law_A} |
| height, species B | {height_B} | {height_law_B} |
""",
}


def table(name: str) -> list[dict[str, str]]:
    """Return the rows of a table with measured results."""
    path = TABLES / f"{name}.csv"
    if not path.exists():
        sys.exit(f"tasks_page.py: there is no {path}; make it with runs/{name.split('_')[0]}.sh")
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def value(row: dict[str, str], name: str, error: str = "") -> tuple[float, float | None]:
    """Return a number from a table row, with its error if the table contains one."""
    error = error or f"{name}_error"
    return float(row[name]), float(row[error]) if error in row else None


def mixture() -> Numbers:
    """Return energies and speeds of both species of the mixture in equilibrium."""
    return {
        f"{name}_{row['species']}{end}": value(row, name + end)
        for row in table("mixture")
        for name in ("K", "v")
        for end in ("", "_theory")
    }


def cooling() -> Numbers:
    """Return the temperature ratios of the two species, and the energy left, after cooling."""
    end = {rule: table(f"cooling_{rule}")[-1] for rule in ("velocity", "normal")}
    found = {
        f"ratio_{xi}": value(end["velocity"], f"ratio_xi{xi}", f"ratio_error_xi{xi}")
        for xi in ("1", "0.9", "0.8")
    }
    left = {
        f"left_{rule}": value(row, "K_all_xi0.8", "K_all_error_xi0.8") for rule, row in end.items()
    }
    return found | left


def crater() -> Numbers:
    """Return the size of the crater, and the exponents of its dependence on mass and speed."""
    rows = [row for row in table("crater_scan") if row["in_fit"] == "1"]
    (base,) = (row for row in rows if row["scan"] == "mass" and float(row["mass"]) == 25)
    found = {name: value(base, name) for name in ("hit", "displaced", "width", "depth")}
    for axis in ("mass", "speed"):
        row = next(row for row in rows if row["scan"] == axis)
        found[f"hit_{axis}"] = value(row, "hit_exponent")
    return found


def gravity() -> Numbers:
    """Return the results of the exercises on a gas under gravity."""
    changes = [float(row["largest_change"]) for row in table("gravity_energy")]
    times = [value(row, "T_therm") for row in table("gravity_equipartition")]
    found = {"energy_change": (max(changes), None), "T_first": min(times), "T_last": max(times)}
    for row in table("gravity_missed")[1:]:
        found[f"missed_{row['dt']}"] = value(row, "missed_percent")
        found[f"expected_{row['dt']}"] = value(row, "expected_percent")
    for row in table("gravity_laws"):
        for kind in ("speed", "height"):
            found[f"{kind}_{row['species']}"] = value(row, f"{kind}_slope")
        found["speed_law"] = value(row, "speed_shared")
        found[f"height_law_{row['species']}"] = value(row, "height_crowded")
    return found


def words(number: tuple[float, float | None]) -> str:
    """Return a number and its error as text, rounded as on the pages."""
    mean, error = number
    if error is None:
        return f"{mean:.1g}" if mean < 1e-6 else f"{mean:.4g}"
    return " ± ".join(rounded_to_error(mean, error))


def wrapped(paragraph: str) -> str:
    """Return a paragraph, a list or a table of a page, with lines of the width of the pages."""
    if paragraph.startswith("|"):
        return paragraph.strip() + "\n"
    items = [" ".join(item.split()) for item in re.split(r"\n(?=- )", paragraph)]
    lines = [
        textwrap.fill(
            item,
            120,
            subsequent_indent=2 * " " * (item[0] == "-"),
            break_long_words=False,
            break_on_hyphens=False,
        )
        for item in items
    ]
    return "\n".join(lines) + "\n"


def filled(page: str, numbers: Numbers) -> str:
    """Return a page with all texts that contain results replaced."""
    for name, template in TEXTS.items():
        start, end = f"<!-- {name} -->\n", "<!-- end -->"
        if start not in page:
            continue
        text = BLANK.sub(lambda blank: words(numbers[blank[1]]), template)
        before, _, rest = page.partition(start)
        parts = "\n".join(map(wrapped, text.split("\n\n")))
        page = before + start + parts + end + rest.partition(end)[2]
    return page


def main() -> None:
    found = mixture() | cooling() | crater() | gravity()
    numbers = {name: found[name] for name in BLANK.findall("".join(TEXTS.values()))}
    (DOCS / "tasks.json").write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")
    for name in PAGES:
        page = DOCS / "tutorials" / f"{name}.md"
        page.write_text(filled(page.read_text(encoding="utf-8"), numbers), encoding="utf-8")


if __name__ == "__main__":
    main()
