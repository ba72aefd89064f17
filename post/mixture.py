"""A mixture before and in equilibrium: speeds per species, mean speed and mean energy.

    python post/mixture.py runs/mixture/*.h5 -o mixture.png --csv mixture.csv

Equilibrium is found, or begins after --skip; it takes the frames of --frames that are at least
--apart collisions per disk from each other.  Errors are standard errors over the runs (of a single
run: from the autocorrelation over its frames).
Theory: each species has <K> = kT and <v> = sqrt(pi kT / 2 m); in a periodic box <K> is smaller by
the share of the disk in the mass of all.
"""

from ricochet import Run, RunError
from ricochet.drawing import COLOURS, bars, caption, plt
from ricochet.script import command_line, late_frames, launch, measured, read_all, report
from ricochet.statistics import Estimate, binned, estimate, hold_against, series_mean
from ricochet.theory import maxwell_cdf, maxwell_pdf
from ricochet.thermodynamics import kinds_of_disks, mean_energy

import numpy as np


def means(run: Run, frames: list[int], name: str) -> np.ndarray:
    """(F, 2) mean speed and mean kinetic energy of a species in each frame."""
    mask = run.of_species(name)
    return np.array(
        [(run.speed(k)[mask].mean(), run.kinetic_energy(k)[mask].mean()) for k in frames]
    )


def over_members(members: list[np.ndarray]) -> Estimate:
    """Mean and error over runs; over the frames of the only run, which remember each other."""
    if len(members) > 1:
        return estimate([m.mean(axis=0) for m in members])
    means = [series_mean(column) for column in members[0].T]
    return Estimate(*np.array([(one.mean, one.error) for one in means]).T)


def table(runs: list[Run], frames: list[list[int]]) -> list[dict]:
    """Per species: mean speed and energy at the start and in equilibrium, and the theory."""
    rows = []
    for kind in kinds_of_disks(runs[0]):
        name, mass = kind.name, kind.mass
        start = np.mean([means(run, [0], name)[0] for run in runs], axis=0)
        late = over_members([means(r, f, name) for r, f in zip(runs, frames, strict=True)])
        energy = float(np.mean([mean_energy(run, mass) for run in runs]))
        u = pooled_speeds(runs, frames, name) * np.sqrt(mass / (2 * energy))
        test = hold_against(u, maxwell_cdf)
        rows.append(
            {
                "species": name,
                "mass": mass,
                "v_start": float(start[0]),
                "K_start": float(start[1]),
                **measured("v", Estimate(late.mean[0], late.error[0])),
                "v_theory": float(np.sqrt(np.pi * energy / (2 * mass))),
                **measured("K", Estimate(late.mean[1], late.error[1])),
                "K_theory": energy,
                "speeds": test.n,
                "KS_D": test.ks,
                "KS_p": test.ks_p,
            }
        )
    return rows


def pooled_speeds(runs: list[Run], frames: list[list[int]], name: str) -> np.ndarray:
    """All speeds of a species in these frames."""
    return np.concatenate(
        [
            run.speed(k)[run.of_species(name)]
            for run, chosen in zip(runs, frames, strict=True)
            for k in chosen
        ]
    )


def draw(runs: list[Run], frames: list[list[int]], result: list[dict]) -> plt.Figure:
    """One row per species: start and equilibrium."""
    names = runs[0].names
    figure, panels = plt.subplots(
        len(names), 2, sharex=True, squeeze=False, figsize=(10, 3.2 * len(names))
    )
    start = [[0]] * len(runs)
    top = max(np.quantile(pooled_speeds(runs, frames, name), 0.9995) for name in names)
    bins = (np.arange(61) - 0.5) * top / 60
    for k, (kind, found, row) in enumerate(zip(runs[0].by_species, result, panels, strict=True)):
        colour = COLOURS[k % len(COLOURS)]
        for axes, chosen in zip(row, (start, frames), strict=True):
            v = pooled_speeds(runs, chosen, kind.name)
            bars(
                axes,
                binned(v, bins),
                bins,
                fill=True,
                alpha=0.45,
                color=colour,
                label=f"{kind.label}: {len(v)} speeds",
            )
            axes.set_ylabel("probability density $P(v)$")
        thermal = np.sqrt(2 * found["K_theory"] / kind.mass)
        v = np.linspace(0, top, 301)
        row[1].plot(
            v,
            maxwell_pdf(v / thermal) / thermal,
            color="black",
            lw=1.2,
            label=f"Maxwell: KS D = {found['KS_D']:.4f}, p = {found['KS_p']:.2g}",
        )
        for when, axes in zip(("_start", ""), row, strict=True):
            axes.plot([], [], ls="", label=moments(found, when))
            axes.set_ylim(0, 1.4 * axes.get_ylim()[1])
            axes.legend(loc="upper right")
    panels[0, 0].set_title("Start")
    panels[0, 1].set_title("Equilibrium")
    for axes in panels[-1]:
        axes.set(xlabel="speed v (reduced units)", xlim=(0, top))
    figure.suptitle(caption(runs), fontsize=10)
    return figure


def moments(row: dict, when: str) -> str:
    """Mean speed and energy for the legend."""
    v, energy = row[f"v{when}"], row[f"K{when}"]
    if when:
        return f"⟨v⟩ = {v:.4g},  ⟨K⟩ = {energy:.4g}"
    return (
        f"⟨v⟩ = {v:.4f} ± {row['v_error']:.4f} (theory {row['v_theory']:.4f})\n"
        f"⟨K⟩ = {energy:.4f} ± {row['K_error']:.4f} (theory {row['K_theory']:.4f})"
    )


def main() -> None:
    args = command_line(__doc__, "mixture.png", frames=None, skip=None, apart=5.0).parse_args()
    runs = read_all(args.runs)
    for run in runs:
        if run.names != runs[0].names or len(run.names) < 2:
            raise RunError(f"{run.path}: needs a mixture, the same in all runs; see speeds.py")
        if run.gravity.any():
            raise RunError(f"{run.path}: falls; see equipartition.py and gravity.py")
    frames = [late_frames(run, args) for run in runs]
    result = table(runs, frames)
    report(args, runs, "Speeds of a mixture", draw(runs, frames, result), result)


if __name__ == "__main__":
    launch(main)
