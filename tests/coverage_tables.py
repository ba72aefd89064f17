"""Tables of the validation page: coverage of error bars, and uniformity of p-values.

    python tests/coverage_tables.py            writes docs/coverage.json and docs/validation.md
    python tests/coverage_tables.py --seeds 40 --print     a quick look

The systems and the quantities were listed before any of them was run.  An error bar is half of the
interval that should hold the true value in 68 of 100 runs that differ by their seed alone: 61 to 75
are allowed.  The true value is exact, or the mean over all runs.  p-values of valid runs are
uniform: the p-value of their Kolmogorov-Smirnov test should not be below 0.001.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "post"), str(ROOT / "tests")]

import driven  # noqa: E402
import gravity  # noqa: E402
import mixture  # noqa: E402
import numpy as np  # noqa: E402
import scipy  # noqa: E402
from ricochet import (  # noqa: E402
    Run,
    correlations,
    fields,
    read_run,
    speed_laws,
    speeds,
    statistics,
    structure,
    thermodynamics as td,
    transport,
)
from validation import report  # noqa: E402

SEEDS, P_SEEDS = 400, 200
Found = dict[str, tuple[float, float]]  # mean and error by quantity
PERIODIC = "boundary = 'periodic', 'periodic'"
SIDES = ("left", "right", "bottom", "top")
THERMAL = " ".join(f"&side name = '{side}' temperature = 1 /" for side in SIDES)


def gas(count: int, eta: float = 0.1, mass: float = 1, name: str = "a") -> str:
    """Return the group of a species that starts with equal speeds, so that all seeds share a kT."""
    head = f"&species name = '{name}' count = {count} packing_fraction = {eta} mass = {mass}"
    return f"{head} speed = {np.sqrt(2 / mass)} /"


def text(
    box: str, groups: str, length: float, frames: float, unit: str = "time", more: str = ""
) -> str:
    """Return an input; `frames` is the time or the number of collisions per disk between frames."""
    stop, each = ("time", "time") if unit == "time" else (unit, unit)
    samples = f"&output frames_every_{each} = {frames} observables_every_{each} = {frames}"
    samples += f" {more} /"
    return f"&box {box} / {groups} &stop {stop} = {length} / {samples}"


by_collisions = partial(text, unit="collisions_per_disk")

# --- error bars ---


def of_rates(run: Run) -> Found:
    """rates.py and equation_of_state.py."""
    found = {name: one[:2] for name, one in td.rates(run).items()}
    return found | {f"Z by {way}": one[:2] for way, one in td.z_ways(run).items()}


def of_fields(run: Run) -> Found:
    """fields.py, in the cell in the middle."""
    found = fields.fields([run], None, (3, 3)).found
    return {name: (one.mean[4], one.error[4]) for name, one in found.items()}


def of_speeds(run: Run) -> Found:
    """speeds.py."""
    frames = td.frames_from(run, td.start_of_steady_state(run), 5)
    u, test = speeds.reduced_speeds(run, frames), speed_laws.speed_test([run], [frames], "a")
    found = {
        "mean_u": speeds.moment(u, 1, test.independent),
        "kurtosis": speeds.moment(u, 4, test.independent),
    }
    for k, axis in enumerate("xy"):
        found[f"kT_{axis}"] = statistics.correlated_mean(speeds.kt_of_frames(run, frames, None, k))[
            :2
        ]
    return found


def of_mixture(run: Run) -> Found:
    """mixture.py."""
    frames = td.frames_from(run, td.start_of_equilibrium(run), 5)
    rows = mixture.table([run], [frames])
    names = ("v", "K", "kT_x", "kT_y")
    return {f"{r['species']}: {n}": (r[n], r[f"{n}_error"]) for r in rows for n in names}


def of_driven(show: str, run: Run) -> Found:
    """driven.py, in the second half of the time."""
    _, curves, _, compared = driven.QUANTITIES[show]
    found = {}
    for name, (time, value) in curves(run).items():
        half = compared(value[time >= (time[0] + time[-1]) / 2])
        found[f"{show} {name}"] = statistics.correlated_mean(half)[:2]
        if show == "width":
            square = statistics.correlated_mean((half - half.mean()) ** 2)
            found["deviation"] = square.mean**0.5, square.error / 2 / square.mean**0.5
    return found


def of_gravity(run: Run) -> Found:
    """gravity.py."""
    frames = td.frames_from(run, td.start_of_equilibrium(run))
    species = [gravity.samples(run, kind, frames) for kind in run.by_species]
    (row,) = gravity.table(run, species, td.temperature(run))
    return {n: (row[n], row[f"{n}_error"]) for n in ("kT", "K_x", "speed_slope", "height_slope")}


def of_correlations(run: Run) -> Found:
    """correlations.py and structure, at one lag and in one bin each."""
    found = correlations.measured([run], waves=[2 * np.pi / (2 * run.radius[0])])["all"]
    frames = structure.evenly(run, most=50)
    for name, of, edges in (
        ("g", structure.pair_correlation, np.array([1.0, 1.2, 1.5, 2.0])),
        ("S", structure.structure_factor, np.array([2.0, 4.0, 6.0, 8.0])),
    ):
        found[name] = structure.averaged(of, [run], [frames], edges)
    return {
        name: (curve.y[k], curve.error[k])
        for name, curve in found.items()
        for k in [min(8, len(curve.x) - 2) if len(curve.x) > 5 else 0]
    }


def of_transport(run: Run) -> Found:
    """transport.py."""
    found = transport.coefficients([run])
    return {name: one.members[0][:2] for name, one in found.items()}


#: For each system: the input, and a function that returns the quantities of a script.
BARS: dict[str, tuple[str, Callable[[Run], Found]]] = {
    "40 disks between sides": (by_collisions("", gas(40), 150, 1), of_rates),
    "40 disks between thermal sides": (by_collisions("", gas(40) + THERMAL, 200, 1), of_rates),
    "fields of the same": (by_collisions("", gas(40) + THERMAL, 250, 0.5), of_fields),
    "speeds of 60 disks in a periodic box": (by_collisions(PERIODIC, gas(60), 200, 5), of_speeds),
    "a mixture 1:4 between sides": (
        by_collisions("", gas(30) + gas(30, 0.1, 4, "b"), 300, 5),
        of_mixture,
    ),
    "50 disks heated by noise": (
        text(PERIODIC, gas(50) + "&contact restitution = 0.8 / &drive kind = 'noise' "
             "interval = 0.01 strength = 1 /", 60, 0.1),
        partial(of_driven, "temperature"),
    ),
    "60 disks and a piston": (
        text("upper = 2, 1", gas(60) + "&side name = 'right' motion = 'piston' mass = 10 "
             "force = 40 /", 400, 0.1),
        partial(of_driven, "width"),
    ),
    "40 disks under shear": (
        text(f"{PERIODIC} shear_rate = 1", gas(40) + "&contact restitution = 0.8 /", 200, 0.2),
        partial(of_driven, "viscosity"),
    ),
    "40 disks under gravity": (
        text("gravity = 0, -2", "&species name = 'a' grid = 8, 5 radius = 0.005 speed = 1.4 /",
             300, 0.5),
        of_gravity,
    ),
    "48 disks of a fluid": (text(PERIODIC, gas(48, 0.35), 6, 0.015), of_correlations),
    "36 disks with Helfand moments": (
        text(PERIODIC, gas(36, 0.2), 20, 0.01, more="helfand = .true."), of_transport
    ),
}  # fmt: skip
EXACT = {("40 disks between thermal sides", "kT"): 1.0, ("fields of the same", "temperature"): 1.0}

# --- p-values ---

PISTON = "&side name = 'right' motion = 'piston' mass = 10 force = 40 /"
#: For each system: the input, and the collisions per disk between frames.
P_VALUES: dict[str, tuple[str, float]] = {
    "5 disks between sides": (by_collisions("", gas(5), 120, 5), 5),
    "200 disks between sides, a frame each collision per disk": (
        by_collisions("", gas(200), 60, 1),
        1,
    ),
    "12 disks in a periodic box": (by_collisions(PERIODIC, gas(12), 120, 5), 5),
    "1000 disks in a periodic box": (by_collisions(PERIODIC, gas(1000), 40, 5), 5),
    "a mixture 1:20 between sides": (
        by_collisions("", gas(30) + gas(30, 0.1, 20, "b"), 120, 5),
        5,
    ),
    "a mixture 1:5 in a periodic box": (
        by_collisions(PERIODIC, gas(15) + gas(15, 0.1, 5, "b"), 120, 5),
        5,
    ),
    "40 disks between thermal sides": (by_collisions("", gas(40) + THERMAL, 100, 5), 5),
    "60 disks and a piston": (by_collisions("upper = 2, 1", gas(60) + PISTON, 100, 5), 5),
}


def p_values(apart: float, run: Run) -> Found:
    """Return KS and chi-square p-values of each species instead of mean and error."""
    frames = td.frames_from(run, td.start_of_steady_state(run), apart)
    tests = {name: speed_laws.speed_test([run], [frames], name) for name in run.names}
    return {name: (test.ks_p, test.chi2_p) for name, test in tests.items()}


# --- the tables ---


def measured(program: str, folder: str, job: tuple) -> Found:
    """Run one seed of a system, and return the measured quantities."""
    kind, name, seed = job
    system, of = BARS[name] if kind == "bars" else P_VALUES[name]
    stem = Path(folder) / f"{kind}_{[*BARS, *P_VALUES].index(name)}_{seed}"
    stem.with_suffix(".nml").write_text(system)
    command = [program, stem.with_suffix(".nml"), "-o", stem.with_suffix(".h5"), "--quiet"]
    subprocess.run([*command, "--set", f"run.seed={seed}"], check=True, capture_output=True)
    try:
        run = read_run(stem.with_suffix(".h5"))
        found = of(run) if callable(of) else p_values(of, run)
        return {name: (float(a), float(b)) for name, (a, b) in found.items()}
    finally:
        for path in Path(folder).glob(f"{stem.name}.*"):
            path.unlink()


def coverage(name: str, results: list[Found]) -> list[dict]:
    """Return a row for each quantity of a system."""
    rows = []
    for quantity in results[0]:
        mean, error = np.array([one.get(quantity, (np.nan, np.nan)) for one in results]).T
        some = np.isfinite(error)
        mean, error = mean[some], error[some]
        if len(mean) < 10 or not error.any():  # exact values, such as kT of a fixed energy
            continue
        truth = EXACT.get((name, quantity), float(mean.mean()))
        three = mean[: len(mean) // 3 * 3].reshape(-1, 3)
        few = statistics.estimate(three, axis=1)
        row = {"system": name, "quantity": quantity.strip(), "runs": len(mean)}
        row |= {"held_%": float(100 * np.mean(np.abs(mean - truth) < error))}
        row |= {"error_over_scatter": float(error.mean() / mean.std())}
        row |= {"three_%": float(100 * np.mean(np.abs(few.mean - truth) < few.error))}
        rows.append(row)
    return rows


def uniformity(name: str, results: list[Found]) -> list[dict]:
    """Return a row for each species of a system."""
    rows = []
    for species in results[0]:
        both = np.array([one[species] for one in results]).T
        row = {"system": name, "species": species if len(results[0]) > 1 else ""}
        for test, p in zip(("ks", "chi2"), both, strict=True):
            row |= {f"{test}_below_5_%": float(100 * np.mean(p < 0.05))}
            row |= {f"{test}_below_32_%": float(100 * np.mean(p < 0.32))}
            row |= {f"{test}_uniform": float(scipy.stats.kstest(p, "uniform").pvalue)}
        rows.append(row | {"runs": len(results)})
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, help=f"[{SEEDS}, and {P_SEEDS} for p-values]")
    parser.add_argument("--print", action="store_true", help="print the tables and write nothing")
    parser.add_argument("--only", default="", help="systems whose name contains this")
    parser.add_argument("-j", "--jobs", type=int, default=os.cpu_count(), help="runs at a time")
    args = parser.parse_args()
    program = os.environ.get("RICOCHET", str(ROOT / "build" / "ricochet"))
    tables: dict[str, list[dict]] = {"bars": [], "p_values": []}
    with (
        tempfile.TemporaryDirectory(prefix="coverage") as folder,
        ProcessPoolExecutor(args.jobs) as pool,
    ):
        for kind, systems, seeds in (("p_values", P_VALUES, P_SEEDS), ("bars", BARS, SEEDS)):
            for name in (one for one in systems if args.only in one):
                jobs = [(kind, name, seed + 1) for seed in range(args.seeds or seeds)]
                results = list(pool.map(partial(measured, program, folder), jobs, chunksize=4))
                rows = (coverage if kind == "bars" else uniformity)(name, results)
                tables[kind] += rows
                for row in rows:
                    print(
                        *(f"{v:.3g}" if isinstance(v, float) else v for v in row.values()),
                        sep=" | ",
                        flush=True,
                    )
    if not args.print:
        base = ROOT / "docs"
        (base / "coverage.json").write_text(json.dumps(tables, indent=1, ensure_ascii=False) + "\n")
        report.rewrite(base / "validation")
    held = all(61 <= row["held_%"] <= 75 for row in tables["bars"])
    even = all(min(row["ks_uniform"], row["chi2_uniform"]) > 1e-3 for row in tables["p_values"])
    return 0 if held and even else 1


if __name__ == "__main__":
    sys.exit(main())
