"""Speeds and energies of each species of a mixture, at the start and in equilibrium.

    python post/mixture.py runs/mixture/*.h5 -o mixture.png --csv mixture.csv

Equilibrium begins after the first X collisions per disk, where X is the value of --equilibration,
or by default when no observable drifts any longer.  Frames selected by --frames are used only if
they are at least Y collisions per disk apart, where Y is the value of --min-separation.  Errors
include the autocorrelation over the frames of each run.  If the scatter of the runs is larger than
expected from the autocorrelation, the errors are determined from the scatter.  The theoretical
values for each species are <K> = kT and <v> = sqrt(pi kT / 2 m).  In a periodic box <K> is smaller
than kT by the fraction m / M, where M is the total mass of all disks.  If the kinetic energy is
conserved, kT is known exactly.  With thermal walls, driving or rotation, kT is the measured mean
over all disks in equilibrium, and has an error.
"""

from ricochet import Run
from ricochet.analysis.speed_laws import speed_test
from ricochet.analysis.speeds import kt_of_frames, means
from ricochet.analysis.statistics import (
    binned,
    combine_runs,
    correlated_mean,
    rounded_to_error,
)
from ricochet.analysis.thermodynamics import kinds_of_disks, mean_energy
from ricochet.figures.drawing import COLOURS, bars, caption, plt
from ricochet.predictions.theory import maxwell_pdf
from ricochet.reading.nature import SETTLED, Refused, allow
from ricochet.script import command_line, late_frames, launch, measured, report

import numpy as np

BINS = 60  # bins of a histogram


def pooled(runs: list[Run], frames: list[list[int]], name: str) -> np.ndarray:
    """Return the speeds of all disks of a species in the given frames of all runs."""
    each = zip(runs, frames, strict=True)
    return np.concatenate([run.speed(k)[run.of_species(name)] for run, own in each for k in own])


def table(runs: list[Run], frames: list[list[int]], skip: float | None = None) -> list[dict]:
    """Return mean speed and energy of each species, at the start and in equilibrium."""
    rows = []
    for kind in kinds_of_disks(runs[0]):
        name, mass = kind.name, kind.mass
        start = np.mean([np.ravel(means([run], [[0]], name)) for run in runs], axis=0)
        speed, energy = means(runs, frames, name)
        theory = combine_runs([mean_energy(run, mass, skip) for run in runs])
        expected = theory.mean
        test = speed_test(runs, frames, name)
        row = {"species": name, "mass": mass, "v_start": float(start[0])}
        row |= {"K_start": float(start[2]), **measured("v", speed)}
        row |= {"v_theory": float(np.sqrt(np.pi * expected / (2 * mass))), **measured("K", energy)}
        row |= measured("K_theory", theory)
        for k, axis in enumerate("xy"):
            both = zip(runs, frames, strict=True)
            tracks = [correlated_mean(kt_of_frames(run, own, name, k)) for run, own in both]
            row |= measured(f"kT_{axis}", combine_runs(tracks))
        row |= {
            "speeds": round(test.independent),
            "law": test.law,
            "KS_D": test.ks,
            "KS_p": test.ks_p,
        }
        rows.append(row)
    return rows


def speed_bins(start: np.ndarray, top: float) -> np.ndarray:
    """Return about 60 bins of speed up to `top`.

    If all initial speeds are equal, their common value is the centre of a bin.
    """
    speed, width = float(np.mean(start)), top / BINS
    if 0 < speed < top and np.ptp(start) < 1e-9 * speed:
        width = speed / max(1, round(speed / width))
    return np.maximum(0, (np.arange(int(top / width) + 3) - 0.5) * width)


def draw(runs: list[Run], frames: list[list[int]], result: list[dict]) -> plt.Figure:
    """Draw two panels for each species: the speeds at the start and in equilibrium."""
    names = runs[0].names
    figure, panels = plt.subplots(
        len(names), 2, sharex=True, squeeze=False, figsize=(10, 3.2 * len(names))
    )
    top = max(np.quantile(pooled(runs, frames, name), 0.9995) for name in names)
    v = np.linspace(0, top, 301)
    for k, (kind, found, row) in enumerate(zip(runs[0].by_species, result, panels, strict=True)):
        colour, sides = COLOURS[k % len(COLOURS)], ([[0]] * len(runs), frames)
        bins = speed_bins(pooled(runs, sides[0], kind.name), top)
        thermal = np.sqrt(2 * found["K_theory"] / kind.mass)
        label = f"Maxwell: KS D = {found['KS_D']:.4f}, p = {found['KS_p']:.2g}"
        law = maxwell_pdf(v / thermal) / thermal
        row[1].plot(v, law, color="black", lw=1.2, label=label, zorder=3)
        moments = (
            "⟨v⟩ = {v_start:.4g},  ⟨K⟩ = {K_start:.4g}".format(**found),
            "\n".join(
                f"⟨{x}⟩ = {' ± '.join(rounded_to_error(found[x], found[x + '_error']))} "
                f"(theory {found[x + '_theory']:.4g})"
                for x in ("v", "K")
            ),
        )
        for axes, chosen, words in zip(row, sides, moments, strict=True):
            speeds = pooled(runs, chosen, kind.name)
            style = {"color": colour, "label": f"{kind.label}: {len(speeds)} speeds"}
            bars(axes, binned(speeds, bins), bins, fill=True, alpha=0.45, **style)
            axes.plot([], [], ls="", label=words)
            density = runs[0].units.label("probability density $P(v)$", "1/speed")
            axes.set(ylabel=density, ylim=(0, 1.4 * axes.get_ylim()[1]))
            axes.legend(loc="upper right")
    panels[0, 0].set_title("Start")
    panels[0, 1].set_title("Equilibrium")
    for axes in panels[-1]:
        axes.set(xlabel=runs[0].units.label("speed v", "speed"), xlim=(0, top))
    figure.suptitle(caption(runs))
    return figure


def main() -> None:
    args = command_line(
        __doc__, "mixture.png", frames=None, equilibration=None, min_separation=5.0
    ).parse_args()
    runs = args.runs
    for run in runs:
        if run.names != runs[0].names or len(run.names) < 2 or run.n_disks < 3:
            what = "needs a mixture of at least three disks, the same in all runs; see speeds.py"
            raise Refused(f"{run.path}: {what}")
        allow(run, "its species do not reach a common temperature", *SETTLED)
        tracks = [run.observable(f"{name}/kinetic_energy").value for name in run.names]
        if not any(np.ptp(track) > 1e-9 * np.max(track) for track in tracks):
            raise Refused(
                f"{run.path}: its species have not collided with each other: each still "
                "has its initial energy"
            )
    frames = [late_frames(run, args) for run in runs]
    result = table(runs, frames, args.equilibration)
    report(args, draw(runs, frames, result), result)


if __name__ == "__main__":
    launch(main)
