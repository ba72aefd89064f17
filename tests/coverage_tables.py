"""Tables of the validation page: coverage of error bars, and uniformity of p-values.

    python tests/coverage_tables.py            writes coverage.json and validation.md
                                               in docs/explanation
    python tests/coverage_tables.py --only gravity         repeats the rows of some systems
    python tests/coverage_tables.py --seeds 40 --print     prints less accurate tables

Systems and quantities were chosen before any system was simulated. For each quantity, 100 runs that
differ only in their seed yield 100 confidence intervals, 68 of which should contain the true value
(61 to 75 are allowed). The true value is known exactly, or is the mean over all runs. The p-values
of valid runs should be distributed uniformly: the p-value of a Kolmogorov-Smirnov test of their
uniformity must be at least 0.001. The exit status is 0 if all systems have published rows within
these limits.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "post"), str(ROOT / "tests")]

from ricochet.reports.grains import crater_scan, discharge  # noqa: E402
from ricochet.reports.equilibrium import driven, equipartition  # noqa: E402
from ricochet.reports.equilibrium import gravity  # noqa: E402
from ricochet.reports.trajectories import lyapunov  # noqa: E402
from ricochet.reports.equilibrium import missed  # noqa: E402
from ricochet.reports.equilibrium import mixture  # noqa: E402
import numpy as np  # noqa: E402
import scipy  # noqa: E402
from ricochet import (  # noqa: E402
    Run,
    cooling,
    correlations,
    equilibrium,
    fields,
    read_run,
    speed_laws,
    speeds,
    statistics,
    streams,
    structure,
    thermodynamics as td,
    transport,
)
from coverage_inputs import (  # noqa: E402
    DRUM,
    FALLING,
    INELASTIC,
    MOUTHS,
    PERIODIC,
    STEPPED,
    THERMAL,
    billiard,
    by_collisions,
    crater,
    gas,
    grains,
    hopper,
    text,
)
from validation import report  # noqa: E402

SEEDS, P_SEEDS = 400, 200
FIRST_SEED = 1001  # of the published tables
Found = dict[str, tuple[float, float]]  # mean and error, by quantity
# text of an input file, or a function that returns it for a seed
Input = str | Callable[[int], str]


# --- error bars ---


def of_rates(run: Run) -> Found:
    """rates.py and equation_of_state.py."""
    found = {name: one[:2] for name, one in td.rates(run).items()}
    return found | {f"Z by {way}": one[:2] for way, one in td.z_ways(run).items()}


def of_fields(run: Run) -> Found:
    """fields.py, in the central cell."""
    found = fields.fields([run], None, (3, 3)).found
    return {name: (one.mean[4], one.error[4]) for name, one in found.items()}


def of_stream(run: Run) -> Found:
    """fields.py --grid: flux between the centre of a drum and its wall."""
    psi = streams.stream_function([run], None, (3, 3)).middles
    return {"stream function": (psi.mean[4], psi.error[4])}


def of_discharge(*runs: Run) -> Found:
    """discharge.py: rate for one mouth, or constants of Beverloo's law for several mouths."""
    found = discharge.measured_rates(list(runs), 4)
    if fit := discharge.fit_of(found):
        return {name: tuple(map(float, one)) for name, one in fit.items()}
    return {"W": (found.rows[0]["W"], found.rows[0]["W_error"])}


def of_speeds(run: Run) -> Found:
    """speeds.py."""
    frames = td.frames_from(run, td.start_of_steady_state(run), 5)
    u = speeds.reduced_speeds(run, frames).reshape(len(frames), -1)
    free = speed_laws.speed_test([run], [frames], "a").independent
    found = {
        "mean_u": speeds.moment([u], 1, free),
        "kurtosis": speeds.moment([u], 4, free),
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
    """driven.py, in the second half of the run."""
    quantity, found = driven.QUANTITIES[show], {}
    for name, curve in quantity.curves(run).items():
        half = driven.late(curve, quantity.compared)
        found[f"{show} {name}"] = statistics.correlated_mean(half)[:2]
        if show == "width":
            square = statistics.correlated_mean((half - half.mean()) ** 2)
            found["deviation"] = square.mean**0.5, square.error / 2 / square.mean**0.5
    return found


def of_gravity(run: Run) -> Found:
    """gravity.py."""
    start = equilibrium.relaxed_start(run)[0]
    frames = td.frames_from(run, start)
    species = [gravity.samples(run, kind, frames) for kind in run.by_species]
    (row,) = gravity.table(run, species, td.temperature_after(run, start))
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


# --- error bars of several runs ---


def at(x: np.ndarray, curve: statistics.Estimate, place: float) -> tuple[float, float]:
    """Return a point of a curve with its error, at the same abscissa for all groups of runs."""
    mean, error = (float(np.interp(place, x, part)) for part in curve)
    return mean, error


def of_cooling(*runs: Run) -> Found:
    """cooling.py, at three quarters of the collisions, and at t = 0.45."""
    found = cooling.energies(list(runs), points=41)
    axes = {"energy": ("time", 0.45), "K": ("collisions_per_disk", 6.0)}
    axes["ratio"] = axes["K"]
    points = {}
    for name, curve in found.items():
        if isinstance(curve, statistics.Estimate):
            axis, place = axes[name.partition("_")[0]]
            points[name] = at(found[axis], curve, place)
    return points


def of_haff(*runs: Run) -> Found:
    """haff.py, after 10 collisions per disk, and at the time 8 / w0."""
    tracks = [cooling.energy_left(run) for run in runs]
    curves, rate, _, _ = cooling.haff(tracks, runs[0].restitution)
    points = {"K by collisions": at(curves["collisions_per_disk"], curves["K"], 10)}
    return points | {"K by time": at(curves["w0_t"], curves["K_by_time"], 8), "rate": rate[:2]}


def of_equipartition(*runs: Run) -> Found:
    """equipartition.py."""
    found = {"T_therm": equipartition.approach(list(runs), 0.5, 0.1).thermalisation}
    names = {"energy": "total_energy", "K_light": "a/kinetic_energy", "K_heavy": "b/kinetic_energy"}
    return found | {key: equipartition.late(list(runs), name, None) for key, name in names.items()}


def of_pairs(*runs: Run) -> Found:
    """lyapunov.py, where successive runs form pairs."""
    apart = np.array([lyapunov.distance(*pair) for pair in batched(runs, 2)])
    return {"exponent": lyapunov.divergence(runs[0].time, apart, 0.01, 0.2).exponent}


def of_missed(*runs: Run) -> Found:
    """missed.py; the error of a single pair of runs is due to the fluctuations in time."""
    found = {}
    for name, some in (("pairs", runs), ("a pair", runs[:2])):
        row = missed.compare(list(some), None)[1]
        found[f"missed, {name}"] = row["missed_percent"], row["missed_percent_error"]
    return found


def of_craters(*runs: Run) -> Found:
    """crater_scan.py: sizes for the smallest mass, and exponents of the mass."""
    points = [crater_scan.point(*one) for one in crater_scan.grouped(runs, crater_scan.key_of)]
    (curve,) = crater_scan.scanned(points)["mass"]
    found: Found = dict(curve[0].sizes)
    for size in crater_scan.SIZES:
        if fit := crater_scan.fit_of("mass", curve, size):
            found[f"exponent of {size}"] = fit.exponent, fit.exponent_error
    return found


def batched(runs: tuple[Run, ...], size: int) -> list[tuple[Run, ...]]:
    """Divide the runs into groups of the given size."""
    return [runs[k : k + size] for k in range(0, len(runs), size)]


class Group(NamedTuple):
    """Runs from which a script calculates the measured quantities."""

    inputs: tuple[Input, ...]  # inputs of the runs with one seed
    of: Callable[..., Found]
    seeds: int  # number of seeds in a group


#: For each system: the runs of a group, and a function that returns the quantities of a script.
GROUPS: dict[str, Group] = {
    "4 runs of a cooling mixture 1:4": Group(
        (by_collisions(PERIODIC, gas(30) + gas(30, 0.1, 4, "b") + INELASTIC, 8, 0.5),),
        of_cooling,
        4,
    ),
    "4 runs of 100 cooling disks": Group(
        (by_collisions(PERIODIC, gas(100) + INELASTIC, 12, 0.25),), of_haff, 4
    ),
    "4 runs of a mixture under gravity": Group(
        (text("gravity = 0, -1", FALLING, 8, 0.1),), of_equipartition, 4
    ),
    "4 pairs of Sinai billiards": Group(
        (partial(billiard, 0.0), partial(billiard, 1e-9)), of_pairs, 4
    ),
    "3 pairs with and without time steps": Group(
        (STEPPED, f"{STEPPED} &run dynamics = 'steps' dt = 0.003 /"), of_missed, 3
    ),
    "4 runs of a hopper with drawn radii": Group(
        (hopper(0.3, grains(120, 0.03, spread=0.1)),), of_discharge, 4
    ),
    "hoppers of 4 widths": Group(
        tuple(hopper(w, grains(60, 0.027) + grains(60, 0.033, "b")) for w in MOUTHS),
        of_discharge,
        1,
    ),
    "craters of 3 masses, 4 runs each": Group(tuple(map(crater, (1, 2, 4))), of_craters, 4),
}

#: For each system: the input, and a function that returns the quantities of a script.
BARS: dict[str, tuple[str, Callable[[Run], Found]]] = {
    "40 disks between sides": (by_collisions("", gas(40), 150, 1), of_rates),
    "40 disks between thermal sides": (by_collisions("", gas(40) + THERMAL, 200, 1), of_rates),
    "fields of the same": (by_collisions("", gas(40) + THERMAL, 250, 0.5), of_fields),
    "40 disks in a rotating drum": (DRUM, of_stream),
    "a hopper with two sizes of grains": (
        hopper(0.3, grains(60, 0.027) + grains(60, 0.033, "b")), of_discharge
    ),
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


class Pool(NamedTuple):
    """Runs of one input, from which groups are drawn with replacement.

    The runs of a group are independent members of the pool, and the true value is that of all runs.
    """

    input: str
    runs: int
    size: int  # number of runs in a group


FALL = (ROOT / "input" / "gravity.nml").read_text().replace("time = 100", "time = 12")
FALL = FALL.replace("frames_every_time = 0.04", "frames_every_time = 12")
POOLS = {f"{size} runs of 60 disks that fall": Pool(FALL, 3000, size) for size in (25, 100)}
EXACT = {
    ("40 disks between thermal sides", "kT"): 1.0,
    ("fields of the same", "temperature"): 1.0,
    # Rigid rotation: the wall sets the velocity of centres at the distance 0.95 from the axis.
    ("40 disks in a rotating drum", "stream function"): 40 * 1.5 / 0.95 / (2 * np.pi),
    ("4 pairs of Sinai billiards", "exponent"): 1.836,  # growth of a narrow beam, 10^7 collisions
}

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
    """Return the KS and chi-square p-values of each species in place of mean and error."""
    frames = td.frames_from(run, td.start_of_steady_state(run), apart)
    tests = {name: speed_laws.speed_test([run], [frames], name) for name in run.names}
    return {name: (test.ks_p, test.chi2_p) for name, test in tests.items()}


# --- groups of a pool of runs ---


def energies(program: str, folder: str, given: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the energies (2, W) of two species in W time windows, and the times of the windows."""
    stem = Path(folder) / f"pool_{seed}"
    try:
        run = performed(program, stem, given, seed)
        light, heavy = td.lightest_and_heaviest(run)
        names = (f"{run.names[kind]}/kinetic_energy" for kind in (light, heavy))
        both = [statistics.windows(*run.observable(name), 0.5) for name in names]
        return np.array([values for _, values in both]), both[0][0]
    finally:
        for path in Path(folder).glob(f"{stem.name}.*"):
            path.unlink()


def drawn(found: np.ndarray, time: np.ndarray, size: int, groups: int) -> tuple[list[Found], float]:
    """Return T_therm of groups of runs, by the method of equipartition.py, and of all runs."""

    def time_of(both: np.ndarray) -> float:
        return equipartition.entry(time, np.abs(both[1] / both[0] - 1))

    rng = np.random.default_rng(FIRST_SEED)
    own = [found[rng.integers(0, len(found), size)] for _ in range(groups)]
    times = [equipartition.over_runs(time_of, [*np.moveaxis(one, 1, 0)]) for one in own]
    results = [{"T_therm": (float(one.mean), float(one.error))} for one in times]
    return results, time_of(found.mean(axis=0))


@cache
def pool_of(
    program: str, folder: str, workers: ProcessPoolExecutor, given: str, runs: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the energies (R, 2, W) of the runs of a pool, and the times (W,) of the windows."""
    seeds = range(FIRST_SEED, FIRST_SEED + runs)
    each = partial(energies, program, folder, given)
    found, times = zip(*workers.map(each, seeds, chunksize=16), strict=True)
    return np.array(found), times[0]


# --- the tables ---


def performed(program: str, stem: Path, given: Input, seed: int) -> Run:
    """Run the program with an input and a seed, and read the result."""
    stem.with_suffix(".nml").write_text(given if isinstance(given, str) else given(seed))
    command = [program, stem.with_suffix(".nml"), "-o", stem.with_suffix(".h5"), "--quiet"]
    subprocess.run([*command, "--set", f"run.seed={seed}"], check=True, capture_output=True)
    return read_run(stem.with_suffix(".h5"))


def measured(program: str, folder: str, job: tuple) -> Found:
    """Run one seed of a system, or the seeds of a group, and return the measured quantities."""
    kind, name, seed = job
    group = GROUPS.get(name) if kind == "bars" else None
    if kind == "bars":
        inputs, of, seeds = group or Group((BARS[name][0],), BARS[name][1], 1)
    else:
        inputs, of, seeds = Group((P_VALUES[name][0],), partial(p_values, P_VALUES[name][1]), 1)
    number = [*BARS, *GROUPS, *P_VALUES].index(name)
    stem, runs = f"{kind}_{number}_{seed}", []
    try:
        for k in range(seeds * len(inputs)):
            own, given = seed * seeds + k // len(inputs), inputs[k % len(inputs)]
            runs.append(performed(program, Path(folder) / f"{stem}_{k}", given, own))
        found = of(*runs)
        return {name: (float(one[0]), float(one[1])) for name, one in found.items()}
    finally:
        for path in Path(folder).glob(f"{stem}_*"):
            path.unlink()


def coverage(name: str, results: list[Found], exact: float | None = None) -> list[dict]:
    """Return a row for each quantity of a system; `exact` is the true value, if known."""
    rows = []
    for quantity in results[0]:
        mean, error = np.array([one.get(quantity, (np.nan, np.nan)) for one in results]).T
        some = np.isfinite(error)
        mean, error = mean[some], error[some]
        if len(mean) < 10 or not error.any():  # exact values, such as kT at fixed energy
            continue
        truth = EXACT.get((name, quantity), float(mean.mean()) if exact is None else exact)
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


def merged(tables: dict[str, list[dict]], path: Path) -> dict[str, list[dict]]:
    """Return the tables, in the order of the lists, with old rows for systems not repeated.

    Published rows of systems no longer in the lists are left out.
    """
    known = json.loads(path.read_text()) if path.exists() else {}
    for kind, systems in (("bars", BARS | GROUPS | POOLS), ("p_values", P_VALUES)):
        repeated = {row["system"] for row in tables[kind]}
        rows = tables[kind] + [r for r in known.get(kind, []) if r["system"] not in repeated]
        order = {name: k for k, name in enumerate(systems)}
        rows = [row for row in rows if row["system"] in order]
        tables[kind] = sorted(rows, key=lambda row, order=order: order[row["system"]])
    return tables


def unmeasured(tables: dict[str, list[dict]]) -> list[str]:
    """Return the systems that have no row in their table."""
    known = {kind: {row["system"] for row in rows} for kind, rows in tables.items()}
    return [
        f"{name}{end}"
        for kind, systems, end in (
            ("bars", BARS | GROUPS | POOLS, ""),
            ("p_values", P_VALUES, ", p-values"),
        )
        for name in systems
        if name not in known[kind]
    ]


def misses(tables: dict[str, list[dict]]) -> list[str]:
    """Return the quantities and species whose rows are outside the limits."""
    bars = [row for row in tables["bars"] if not 61 <= row["held_%"] <= 75]
    uneven = [r for r in tables["p_values"] if min(r["ks_uniform"], r["chi2_uniform"]) <= 1e-3]
    named = [f"{row['system']}: {row['quantity']}" for row in bars]
    return named + [f"{row['system']}: p-values {row['species']}" for row in uneven]


def main() -> int:
    """Measure the tables; return 0 if all rows are within the limits."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, help=f"[{SEEDS}, and {P_SEEDS} for p-values]")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help=f"[{FIRST_SEED}]")
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
        for kind, systems, seeds in (
            ("p_values", P_VALUES, P_SEEDS),
            ("bars", BARS | GROUPS | POOLS, SEEDS),
        ):
            for name in (one for one in systems if args.only in one):
                if name in POOLS:
                    given, runs, size = POOLS[name]
                    runs_of_pool = pool_of(program, folder, pool, given, runs)
                    results, truth = drawn(*runs_of_pool, size, args.seeds or SEEDS)
                    rows = coverage(name, results, truth)
                else:
                    seed = range(args.first_seed, args.first_seed + (args.seeds or seeds))
                    jobs = [(kind, name, k) for k in seed]
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
        base = ROOT / "docs" / "explanation"
        tables = merged(tables, base / "coverage.json")
        missing = unmeasured(tables)
        data = json.dumps(tables | {"missing": missing}, indent=1, ensure_ascii=False)
        (base / "coverage.json").write_text(data + "\n")
        report.rewrite(base / "validation")
        print(*(f"not measured: {name}" for name in missing), sep="\n", file=sys.stderr)
    outside = misses(tables)
    print(*(f"outside of the limits: {name}" for name in outside), sep="\n", file=sys.stderr)
    return 1 if outside or (not args.print and missing) else 0


if __name__ == "__main__":
    sys.exit(main())
