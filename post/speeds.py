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
from ricochet.script import command_line, grouped, late_frames, launch, report
from ricochet.speeds import exact_law, independent_frames, reduced_speeds, relaxation
from ricochet.statistics import Estimate, binned, estimate, hold_against
from ricochet.theory import RELAXATION, maxwell_cdf, maxwell_pdf
from ricochet.thermodynamics import after_start, all_settle, equal_disks, start_of_equilibrium

import numpy as np

BINS = np.linspace(0, 3, 51)  # u = 1 lies inside a bin


class Pool(NamedTuple):
    """The late frames of the runs with the same number of disks."""

    density: Estimate  # (B,) of reduced speeds
    row: dict  # the tests


def pooled(runs: list[Run], args: Namespace, cool: bool) -> Pool:
    """The late frames of all runs; of those that cool, each at its own temperature."""
    begin = after_start if cool else start_of_equilibrium
    picked = [(run, late_frames(run, args, begin)) for run in runs]
    kts = [[run.kinetic_energy(f[k]).mean() for run, f in picked] for k in (0, -1)]
    u = np.concatenate([reduced_speeds(*one, each=cool) for one in picked])
    n = runs[0].count * sum(independent_frames(*one) for one in picked)
    maxwell, law = hold_against(u, maxwell_cdf, independent=n), exact_law(runs[0])
    exact = hold_against(u, law, independent=n) if law else None
    row = {
        "N": runs[0].count,
        "runs": len(runs),
        "speeds": len(u),
        "independent": n,
        "kT_first": float(np.mean(kts[0])),
        "kT_last": float(np.mean(kts[1])),
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
    return Pool(binned(u, BINS, n), row)


def draw_histogram(axes: plt.Axes, heights: list[Estimate], labels: list[str]) -> None:
    """Step histograms over the Maxwell curve."""
    style = {"fill": True, "alpha": 0.45} if len(heights) == 1 else {"fill": False}
    for height, label, colour in zip(heights, labels, colours(len(labels)), strict=True):
        bars(axes, height, BINS, color=colour, label=label, lw=1.6, **style)
    fine = np.linspace(0, 3, 301)
    axes.plot(fine, maxwell_pdf(fine), color="black", lw=1.2, label="Maxwell, $P(u)=2u\\,e^{-u^2}$")
    axes.set(xlabel="speed $u = v\\,/\\,\\sqrt{2kT/m}$", xlim=(0, 3))
    axes.set_ylabel("probability density $P(u)$")
    axes.legend()


def draw_relaxation(axes: plt.Axes, groups: list, cool: bool) -> None:
    """a2 against collisions per disk, mean and standard error over the runs."""
    equal = not cool
    for (count, runs), colour in zip(groups, colours(len(groups)), strict=True):
        tracks = [relaxation(run) for run in runs]
        common = min(len(tau) for tau, _ in tracks)
        tau = np.mean([track[:common] for track, _ in tracks], axis=0)
        a2 = estimate([track[:common] for _, track in tracks])
        error = a2.error if len(runs) > 1 else None
        axes.errorbar(tau, a2.mean, error, color=colour, marker=".", lw=1, label=f"N = {count}")
        noise_band(axes, count * len(runs), colour)
        equal = equal and all(map(equal_disks, runs)) and max(a[0] for _, a in tracks) < -0.4
    if equal:
        dilute_limit(axes, RELAXATION)
    axes.axhline(0, color="0.6", lw=0.8, zorder=0)
    axes.set(xlabel="collisions per disk", ylabel="$a_2$ (0: Maxwell)")
    axes.legend()


def cooling(row: dict) -> str:
    """How far a gas has cooled; one that falls may become hotter."""
    goes = "falls" if row["kT_last"] < row["kT_first"] else "goes"
    return f"kT {goes} from {row['kT_first']:.4g} to {row['kT_last']:.4g}"


def label_of(row: dict, cool: bool) -> str:
    """The tests in words."""
    size, free, exact = row["speeds"], row["independent"], row["KS_p_exact"]
    words = f"N = {row['N']}: {size} speeds" + (f", {free} independent" if free < size else "")
    words += f"\n{cooling(row)}" if cool else ""
    words += f"\nKS D = {row['KS_D']:.4f}, p-value {row['KS_p']:.2g}"
    return words + ("" if exact is None else f",\nof the law at fixed energy {exact:.2g}")


def draw(runs: list[Run], groups: list, pools: list[Pool], cool: bool) -> plt.Figure:
    """Four panels: start, last frame, equilibrium, relaxation."""
    figure, ((first, last), (late, way)) = plt.subplots(2, 2, figsize=(10, 7))
    largest = groups[-1][1][0]
    for axes, frame, when in ((first, 0, "first frame"), (last, -1, f"t = {largest.time[-1]:.4g}")):
        height = binned(reduced_speeds(largest, [frame]), BINS)
        draw_histogram(axes, [height], [f"{when}, N = {largest.count}"])
    draw_histogram(late, [pool.density for pool in pools], [label_of(p.row, cool) for p in pools])
    late.set_ylim(0, 1.1 + (0.6 if cool else 0.4) * len(groups))
    draw_relaxation(way, groups, cool)
    first.set_title("Start")
    last.set_title("One frame at the end")
    equilibrium = "No equilibrium: each frame at its own kT" if cool else "Equilibrium, many frames"
    late.set_title(equilibrium)
    way.set_title("The way there" if cool else "The way to equilibrium")
    figure.suptitle(caption(runs))
    return figure


def main() -> None:
    args = command_line(__doc__, "speeds.png", frames=None, skip=None, apart=5.0).parse_args()
    cool, groups = not all_settle(args.runs), grouped(args.runs, lambda run: run.count)
    pools = [pooled(members, args, cool) for _, members in groups]
    data, notes = {"u_low": BINS[:-1], "u_high": BINS[1:]}, []
    for (count, _), pool in zip(groups, pools, strict=True):
        data[f"density_N{count}"], data[f"density_error_N{count}"] = pool.density
        if cool:
            notes.append(f"N = {count}: loses energy, no equilibrium; {cooling(pool.row)}")
    data["maxwell"] = np.diff(maxwell_cdf(BINS)) / np.diff(BINS)
    figure = draw(args.runs, groups, pools, cool)
    report(args, figure, [pool.row for pool in pools], data=data, notes=notes)


if __name__ == "__main__":
    launch(main)
