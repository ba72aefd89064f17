"""Speed distribution: first frame, last frame, equilibrium, and the way there.

    python post/speeds.py runs/gas/*.h5 -o speeds.png --csv speeds.csv

Speeds are given in u = v / sqrt(2 kT / m), kT = mean kinetic energy of the species, so that
equilibrium is P(u) = 2 u exp(-u^2) for any mass; with m = 1 and all speeds 1 at the start
u is v itself.  Runs of the same N are combined.  Equilibrium is found, or begins after --skip; it
takes the frames of --frames that are at least --apart collisions per disk from each other.
A gas that loses energy in collisions has no equilibrium: its histogram is of the frames after
--skip, or else 15 collisions per disk, with the kT of each frame for itself; `kT_first` and
`kT_last` say how far it has cooled meanwhile.
Tests: Kolmogorov-Smirnov (KS) and chi-square against the Maxwell law, KS against the exact law of N
disks that share a fixed kinetic energy, which matters if they are few; none where that law is not
known: with gravity, losses, one periodic axis of two, or two and unequal masses.  A disk forgets
its speed within 5 collisions: frames that are closer count for the tests as one frame every 5
collisions per disk.
a2 = <v^4> / (2 <v^2>^2) - 1.
"""

from argparse import Namespace
from typing import NamedTuple

from ricochet import Run
from ricochet.drawing import bars, caption, colours, dilute_limit, noise_band, plt
from ricochet.script import command_line, grouped, late_frames, launch, read_all, report
from ricochet.statistics import Estimate, Law, binned, estimate, excess_kurtosis, hold_against
from ricochet.theory import RELAXATION, finite_n_cdf, maxwell_cdf, maxwell_pdf
from ricochet.thermodynamics import (
    after_start,
    all_cool,
    conserved,
    equal_disks,
    loses_energy,
    start_of_equilibrium,
)

import numpy as np

BINS = np.linspace(0, 3, 51)  # u = 1 lies inside a bin
MEMORY = 5.0  # collisions per disk after which a speed is independent


class Pool(NamedTuple):
    """The histogram of the runs with the same number of disks."""

    speeds: np.ndarray  # (S,) reduced
    independent: int  # so many of them count
    kts: tuple[float, float]  # in the first and the last frame


def reduced_speeds(run: Run, frames: list[int], each: bool = False) -> np.ndarray:
    """(F * N,) speeds of these frames, each species by its own thermal speed.

    That is the one of all these frames, or of `each` for itself.
    """
    energy = np.array([run.kinetic_energy(k) for k in frames])
    for kind in run.by_species:
        own = energy[:, kind.disks]
        kt = np.mean(own, axis=1 if each else None, keepdims=True)
        energy[:, kind.disks] /= np.where(kt > 0, kt, 1)
    return np.sqrt(energy).ravel()


def independent_frames(run: Run, frames: list[int]) -> int:
    """How many independent frames these count as."""
    tau = run.collisions_per_disk_at(run.time)[frames]
    return min(len(frames), 1 + int((tau[-1] - tau[0]) / MEMORY * (1 + 1e-9)))


def relaxation(run: Run, until: float = 16) -> tuple[np.ndarray, np.ndarray]:
    """Collisions per disk and a2 of each frame up to `until` collisions per disk."""
    tau = run.collisions_per_disk_at(run.time)
    tau = tau[tau <= until]
    return tau, np.array([excess_kurtosis(reduced_speeds(run, [k])) for k in range(len(tau))])


def pooled(runs: list[Run], args: Namespace, cool: bool) -> Pool:
    """The late frames of all runs; of those that cool, each at its own temperature."""
    begin = after_start if cool else start_of_equilibrium
    picked = [(run, late_frames(run, args, begin)) for run in runs]
    kts = [[run.kinetic_energy(f[k]).mean() for run, f in picked] for k in (0, -1)]
    return Pool(
        np.concatenate([reduced_speeds(*one, each=cool) for one in picked]),
        runs[0].count * sum(independent_frames(*one) for one in picked),
        tuple(float(np.mean(kt)) for kt in kts),
    )


def exact_law(run: Run) -> Law | None:
    """The law of N disks that share a fixed kinetic energy, for runs that have one."""
    axes = conserved(run).sum()
    if loses_energy(run) or run.gravity.any() or axes == 1 or (axes == 2 and np.ptp(run.mass) > 0):
        return None
    return finite_n_cdf(run.count, bool(axes == 2))


def table(groups: list, pools: list[Pool]) -> list[dict]:
    """The tests of each group."""
    rows = []
    for (count, runs), (u, n, kts) in zip(groups, pools, strict=True):
        maxwell = hold_against(u, maxwell_cdf, independent=n)
        law = exact_law(runs[0])
        exact = hold_against(u, law, independent=n) if law else None
        rows.append(
            {
                "N": count,
                "runs": len(runs),
                "speeds": len(u),
                "independent": n,
                "kT_first": kts[0],
                "kT_last": kts[1],
                "mean_u": float(np.mean(u)),
                "kurtosis": float(np.mean(u**4)),
                "KS_D": maxwell.ks,
                "KS_limit_1%": 1.63 / n**0.5,
                "KS_p": maxwell.ks_p,
                "chi2/dof": maxwell.chi2,
                "chi2_p": maxwell.chi2_p,
                "KS_D_exact": exact and exact.ks,
                "KS_p_exact": exact and exact.ks_p,
            }
        )
    return rows


def draw_histogram(axes: plt.Axes, heights: list[Estimate], labels: list[str]) -> None:
    """Step histograms over the Maxwell curve."""
    for height, label, colour in zip(heights, labels, colours(len(labels)), strict=True):
        bars(
            axes,
            height,
            BINS,
            color=colour,
            label=label,
            fill=len(heights) == 1,
            alpha=0.45 if len(heights) == 1 else 1,
            lw=1.6,
        )
    fine = np.linspace(0, 3, 301)
    axes.plot(fine, maxwell_pdf(fine), color="black", lw=1.2, label="Maxwell, $P(u)=2u\\,e^{-u^2}$")
    axes.set(
        xlabel="speed $u = v\\,/\\,\\sqrt{2kT/m}$", ylabel="probability density $P(u)$", xlim=(0, 3)
    )
    axes.legend()


def draw_relaxation(axes: plt.Axes, groups: list, cool: bool) -> None:
    """a2 against collisions per disk, mean and standard error over the runs."""
    for (count, runs), colour in zip(groups, colours(len(groups)), strict=True):
        tracks = [relaxation(run) for run in runs]
        common = min(len(tau) for tau, _ in tracks)
        tau = np.mean([track[:common] for track, _ in tracks], axis=0)
        a2 = estimate([track[:common] for _, track in tracks])
        error = a2.error if len(runs) > 1 else None
        axes.errorbar(tau, a2.mean, error, color=colour, marker=".", lw=1, label=f"N = {count}")
        noise_band(axes, count * len(runs), colour)
    everyone = [run for _, runs in groups for run in runs]
    equal = all(equal_disks(run) and relaxation(run, 0)[1][0] < -0.4 for run in everyone)
    if equal and not cool:
        dilute_limit(axes, RELAXATION)
    axes.axhline(0, color="0.6", lw=0.8, zorder=0)
    axes.set(xlabel="collisions per disk", ylabel="$a_2$ (0: Maxwell)")
    axes.legend()


def cooling(row: dict) -> str:
    """How far a gas has cooled; one that falls may become hotter."""
    goes = "falls" if row["kT_last"] < row["kT_first"] else "goes"
    return f"kT {goes} from {row['kT_first']:.4g} to {row['kT_last']:.4g}"


def draw(groups: list, pools: list[Pool], tests: list[dict], cool: bool) -> plt.Figure:
    """Four panels: start, last frame, equilibrium, relaxation."""
    everyone = [run for _, runs in groups for run in runs]
    figure, ((first, last), (late, way)) = plt.subplots(2, 2, figsize=(10, 7))
    largest = groups[-1][1][0]
    label = f"first frame, N = {largest.count}"
    draw_histogram(first, [binned(reduced_speeds(largest, [0]), BINS)], [label])
    first.set_title("Start")
    time = largest.time[-1]
    label = f"one frame, t = {time:.4g}, N = {largest.count}"
    draw_histogram(last, [binned(reduced_speeds(largest, [-1]), BINS)], [label])
    last.set_title("One frame at the end")
    labels = []
    for row in tests:
        size, free, exact = row["speeds"], row["independent"], row["KS_p_exact"]
        labels.append(
            f"N = {row['N']}: {size} speeds" + (f", {free} independent" if free < size else "")
            + (f"\n{cooling(row)}" if cool else "")
            + f"\nKS D = {row['KS_D']:.4f}, p-value {row['KS_p']:.2g}"
            + ("" if exact is None else f",\nof the law at fixed energy {exact:.2g}")
        )  # fmt: skip
    draw_histogram(late, [late_density(pool) for pool in pools], labels)
    late.set_title(
        "No equilibrium: each frame at its own kT" if cool else "Equilibrium, many frames"
    )
    late.set_ylim(0, 1.1 + (0.6 if cool else 0.4) * len(groups))
    draw_relaxation(way, groups, cool)
    way.set_title("The way there" if cool else "The way to equilibrium")
    figure.suptitle(caption(everyone), fontsize=10)
    return figure


def late_density(pool: Pool) -> Estimate:
    """The histogram of the late frames."""
    return binned(pool.speeds, BINS, pool.independent)


def histograms(groups: list, pools: list[Pool]) -> dict[str, np.ndarray]:
    """Densities of the late frames, with the mean of the Maxwell density over each bin."""
    columns = {"u_low": BINS[:-1], "u_high": BINS[1:]}
    for (count, _), pool in zip(groups, pools, strict=True):
        columns[f"density_N{count}"], columns[f"density_error_N{count}"] = late_density(pool)
    return {**columns, "maxwell": np.diff(maxwell_cdf(BINS)) / np.diff(BINS)}


def main() -> None:
    args = command_line(__doc__, "speeds.png", frames=None, skip=None, apart=5.0).parse_args()
    runs = read_all(args.runs)
    cool, groups = all_cool(runs), grouped(runs, lambda run: run.count)
    pools = [pooled(members, args, cool) for _, members in groups]
    tests = table(groups, pools)
    figure = draw(groups, pools, tests, cool)
    title = "Speed distribution of hard disks"
    data = histograms(groups, pools)
    notes = [f"N = {row['N']}: loses energy, no equilibrium; {cooling(row)}" for row in tests]
    report(args, runs, title, figure, tests, data=data, notes=notes if cool else ())


if __name__ == "__main__":
    launch(main)
