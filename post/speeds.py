"""Speed distribution: first frame, last frame, equilibrium, and the way there.

    python post/speeds.py runs/gas/*.h5 -o speeds.png --csv speeds.csv

Speeds are given in u = v / sqrt(2 kT / m), kT = mean kinetic energy of the species, so that
equilibrium is P(u) = 2 u exp(-u^2) for any mass; with m = 1 and all speeds 1 at the start
u is v itself.  Runs of the same N are put together.  Equilibrium takes the frames after --skip
collisions per disk that are at least --apart collisions per disk from each other.  Tests:
Kolmogorov-Smirnov (KS) and chi-square against the Maxwell law, KS against the exact law of N disks
that share a fixed energy, which matters if they are few.  A disk has forgotten its speed after 5
collisions: frames that are closer count for the tests as one frame every 5 collisions per disk.
a2 = <v^4> / (2 <v^2>^2) - 1.
"""

import numpy as np

from drawing import (
    COLOURS,
    caption,
    command_line,
    dilute_limit,
    grouped,
    launch,
    plt,
    print_table,
    read_all,
    save,
    write_csv,
)
from read_run import Run
from theory import estimate, excess_kurtosis, finite_n_cdf, hold_against, maxwell_cdf, maxwell_pdf

# Dilute gas from equal speeds, by Monte Carlo solution of the Boltzmann equation (10^6 disks).
RELAXATION = np.array(
    [
        (0, -0.5),
        (1, -0.370),
        (2, -0.264),
        (3, -0.184),
        (4, -0.125),
        (5, -0.0855),
        (6, -0.0565),
        (8, -0.025),
    ]
)
BINS = np.linspace(0, 3, 51)  # u = 1 lies inside a bin
MEMORY = 5.0  # collisions per disk after which a speed is independent


def reduced_speeds(run: Run, frames: list[int]) -> np.ndarray:
    """(F * N,) speeds of these frames, each species by its own thermal speed."""
    energy = np.array([run.kinetic_energy(k) for k in frames])
    for s in np.unique(run.species):
        energy[:, run.species == s] /= np.mean(energy[:, run.species == s]) or 1.0
    return np.sqrt(energy).ravel()


def equilibrium_frames(run: Run, skip: float, apart: float, first: int = 0) -> list[int]:
    """Frames after `skip` collisions per disk, each `apart` from the one before."""
    chosen, last = [], -np.inf
    for frame, tau in enumerate(run.collisions_per_disk_at(run.time)):
        if frame >= first and tau >= skip and tau >= last + apart * (1 - 1e-9):
            chosen.append(frame)
            last = tau
    return chosen


def independent_frames(run: Run, frames: list[int]) -> int:
    """As how many independent ones these frames count."""
    tau = run.collisions_per_disk_at(run.time)[frames]
    return min(len(frames), 1 + int((tau[-1] - tau[0]) / MEMORY * (1 + 1e-9)))


def relaxation(run: Run, until: float = 16) -> tuple[np.ndarray, np.ndarray]:
    """Collisions per disk and a2 of each frame up to `until` collisions per disk."""
    tau = run.collisions_per_disk_at(run.time)
    tau = tau[tau <= until]
    return tau, np.array([excess_kurtosis(reduced_speeds(run, [k])) for k in range(len(tau))])


def table(groups: list, samples: list[np.ndarray], independent: list[int]) -> dict[str, list]:
    """The tests of each group, as columns."""
    rows = []
    for (count, runs), u, n in zip(groups, samples, independent, strict=True):
        maxwell = hold_against(u, maxwell_cdf, independent=n)
        law = finite_n_cdf(count, bool(runs[0].periodic.all()))
        exact = hold_against(u, law, independent=n)
        rows.append(
            {
                "N": count,
                "runs": len(runs),
                "speeds": len(u),
                "independent": n,
                "mean_u": float(np.mean(u)),
                "kurtosis": float(np.mean(u**4)),
                "KS_D": maxwell.ks,
                "KS_limit_1%": 1.63 / n**0.5,
                "KS_p": maxwell.ks_p,
                "chi2/dof": maxwell.chi2,
                "chi2_p": maxwell.chi2_p,
                "KS_D_exact": exact.ks,
                "KS_p_exact": exact.ks_p,
            }
        )
    return {key: [row[key] for row in rows] for key in rows[0]}


def draw_histogram(axes: plt.Axes, samples: list[np.ndarray], labels: list[str]) -> None:
    """Step histograms over the Maxwell curve."""
    for u, label, colour in zip(samples, labels, COLOURS, strict=False):
        density, _ = np.histogram(u, BINS)
        axes.stairs(
            density / (len(u) * np.diff(BINS)),
            BINS,
            color=colour,
            label=label,
            fill=len(samples) == 1,
            alpha=0.45 if len(samples) == 1 else 1,
            lw=1.6,
        )
    fine = np.linspace(0, 3, 301)
    axes.plot(fine, maxwell_pdf(fine), color="black", lw=1.2, label="Maxwell, $P(u)=2u\\,e^{-u^2}$")
    axes.set(
        xlabel="speed $u = v\\,/\\,\\sqrt{2kT/m}$", ylabel="probability density $P(u)$", xlim=(0, 3)
    )
    axes.legend()


def draw_relaxation(axes: plt.Axes, groups: list) -> None:
    """a2 against collisions per disk, mean and standard error over the runs."""
    for (count, runs), colour in zip(groups, COLOURS, strict=False):
        tracks = [relaxation(run) for run in runs]
        common = min(len(tau) for tau, _ in tracks)
        tau = np.mean([track[:common] for track, _ in tracks], axis=0)
        a2 = estimate([track[:common] for _, track in tracks])
        error = a2.error if len(runs) > 1 else None
        axes.errorbar(tau, a2.mean, error, color=colour, marker=".", lw=1, label=f"N = {count}")
    dilute_limit(axes, RELAXATION)
    axes.axhline(0, color="0.6", lw=0.8, zorder=0)
    axes.set(xlabel="collisions per disk", ylabel="$a_2$ (0: Maxwell)")
    axes.legend()


def draw(groups: list, samples: list[np.ndarray], tests: dict) -> plt.Figure:
    """Four panels: start, last frame, equilibrium, relaxation."""
    everyone = [run for _, runs in groups for run in runs]
    figure, ((first, last), (pooled, way)) = plt.subplots(2, 2, figsize=(10, 7))
    largest = groups[-1][1][0]
    draw_histogram(first, [reduced_speeds(largest, [0])], [f"first frame, N = {largest.count}"])
    first.set_title("Start")
    time = largest.time[-1]
    draw_histogram(
        last, [reduced_speeds(largest, [-1])], [f"one frame, t = {time:.4g}, N = {largest.count}"]
    )
    last.set_title("One frame at the end")
    columns = ("N", "speeds", "independent", "KS_D", "KS_p", "KS_p_exact")
    labels = [
        f"N = {n}: {size} speeds" + (f", {free} independent" if free < size else "")
        + f"\nKS D = {d:.4f}, p = {p:.2g} (at fixed energy {q:.2g})"
        for n, size, free, d, p, q in zip(*(tests[key] for key in columns), strict=True)
    ]  # fmt: skip
    draw_histogram(pooled, samples, labels)
    pooled.set(title="Equilibrium, many frames", ylim=(0, 1.1 + 0.25 * len(groups)))
    draw_relaxation(way, groups)
    way.set_title("The way to equilibrium")
    figure.suptitle(caption(everyone), fontsize=10)
    return figure


def main() -> None:
    parser = command_line(__doc__, "speeds.png", table=True)
    parser.add_argument("--skip", type=float, default=15, help="collisions per disk [15]")
    parser.add_argument("--apart", type=float, default=5, help="collisions per disk [5]")
    parser.add_argument("--first", type=int, default=0, help="no frame before this number [0]")
    args = parser.parse_args()
    runs = read_all(args.runs)
    groups = grouped(runs, lambda run: run.count)
    samples, independent = [], []
    for count, members in groups:
        picked = [
            (r, equilibrium_frames(r, args.skip, args.apart, args.first) or [r.frames - 1])
            for r in members
        ]
        samples.append(np.concatenate([reduced_speeds(r, frames) for r, frames in picked]))
        independent.append(int(count) * sum(independent_frames(*pick) for pick in picked))
    tests = table(groups, samples, independent)
    print_table(tests)
    save(draw(groups, samples, tests), args.output, runs, "Speed distribution of hard disks")
    if args.csv:
        columns = {"u_low": BINS[:-1], "u_high": BINS[1:]}
        for (count, _), u in zip(groups, samples, strict=True):
            columns[f"density_N{count}"] = np.histogram(u, BINS)[0] / (len(u) * np.diff(BINS))
        write_csv(args.csv, {**columns, "maxwell": maxwell_density()})


def maxwell_density() -> np.ndarray:
    """Mean of the Maxwell density over each bin."""
    return np.diff(maxwell_cdf(BINS)) / np.diff(BINS)


if __name__ == "__main__":
    launch(main)
