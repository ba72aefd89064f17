"""A mixture before and in equilibrium: speeds per species, mean speed and mean energy.

    python post/mixture.py runs/mixture/*.h5 -o mixture.png --csv mixture.csv

Equilibrium takes the frames after --skip collisions per disk, --apart collisions per disk from
each other.  Errors are standard errors over the runs (over the frames if there is one run).
Theory: each species has <K> = kT = E / N and <v> = sqrt(pi kT / 2 m).
"""

import numpy as np

from drawing import (
    COLOURS,
    caption,
    command_line,
    launch,
    plt,
    print_table,
    read_all,
    save,
    species_label,
    write_csv,
)
from read_run import Run
from speeds import equilibrium_frames
from theory import Estimate, estimate, hold_against, maxwell_cdf, maxwell_pdf


def means(run: Run, frames: list[int], name: str) -> np.ndarray:
    """(F, 2) mean speed and mean kinetic energy of a species in each frame."""
    mask = run.of_species(name)
    return np.array(
        [(run.speed(k)[mask].mean(), run.kinetic_energy(k)[mask].mean()) for k in frames]
    )


def over_members(members: list[np.ndarray]) -> Estimate:
    """Mean and error over runs; over the frames of the only run."""
    return estimate(members[0]) if len(members) == 1 else estimate([m.mean(0) for m in members])


def table(runs: list[Run], frames: list[list[int]]) -> dict[str, list]:
    """Per species: mean speed and energy at the start and in equilibrium, and the theory."""
    temperature = float(np.mean([run.kinetic_energy(0).mean() for run in runs]))
    rows = []
    for name in runs[0].names:
        mass = float(runs[0].mass[runs[0].of_species(name)][0])
        start = np.mean([means(run, [0], name)[0] for run in runs], axis=0)
        late = over_members([means(r, f, name) for r, f in zip(runs, frames, strict=True)])
        u = pooled_speeds(runs, frames, name) * np.sqrt(mass / (2 * temperature))
        test = hold_against(u, maxwell_cdf)
        rows.append(
            {
                "species": name,
                "mass": mass,
                "v_start": float(start[0]),
                "K_start": float(start[1]),
                "v": float(late.mean[0]),
                "v_error": float(late.error[0]),
                "v_theory": float(np.sqrt(np.pi * temperature / (2 * mass))),
                "K": float(late.mean[1]),
                "K_error": float(late.error[1]),
                "K_theory": temperature,
                "speeds": test.n,
                "KS_D": test.ks,
                "KS_p": test.ks_p,
            }
        )
    return {key: [row[key] for row in rows] for key in rows[0]}


def pooled_speeds(runs: list[Run], frames: list[list[int]], name: str) -> np.ndarray:
    """All speeds of a species in these frames."""
    return np.concatenate(
        [
            run.speed(k)[run.of_species(name)]
            for run, chosen in zip(runs, frames, strict=True)
            for k in chosen
        ]
    )


def draw(runs: list[Run], frames: list[list[int]], result: dict[str, list]) -> plt.Figure:
    """One row per species: start and equilibrium."""
    names = runs[0].names
    figure, panels = plt.subplots(
        len(names), 2, sharex=True, squeeze=False, figsize=(10, 3.2 * len(names))
    )
    start = [[0]] * len(runs)
    top = max(np.quantile(pooled_speeds(runs, frames, name), 0.9995) for name in names)
    bins = (np.arange(61) - 0.5) * top / 60
    for k, (name, row) in enumerate(zip(names, panels, strict=True)):
        colour, label = COLOURS[k % len(COLOURS)], species_label(runs[0], name)
        for axes, chosen in zip(row, (start, frames), strict=True):
            v = pooled_speeds(runs, chosen, name)
            density = np.histogram(v, bins)[0] / (len(v) * np.diff(bins))
            axes.stairs(
                density,
                bins,
                fill=True,
                alpha=0.45,
                color=colour,
                label=f"{label}: {len(v)} speeds",
            )
            axes.set_ylabel("probability density $P(v)$")
        thermal = np.sqrt(2 * result["K_theory"][k] / result["mass"][k])
        v = np.linspace(0, top, 301)
        row[1].plot(
            v,
            maxwell_pdf(v / thermal) / thermal,
            color="black",
            lw=1.2,
            label=f"Maxwell at $kT = E/N$: KS D = {result['KS_D'][k]:.4f}, "
            f"p = {result['KS_p'][k]:.2g}",
        )
        for when, axes in zip(("_start", ""), row, strict=True):
            axes.plot([], [], ls="", label=moments(result, k, when))
            axes.set_ylim(0, 1.4 * axes.get_ylim()[1])
            axes.legend(loc="upper right")
    panels[0, 0].set_title("Start")
    panels[0, 1].set_title("Equilibrium")
    for axes in panels[-1]:
        axes.set(xlabel="speed v (reduced units)", xlim=(0, top))
    figure.suptitle(caption(runs), fontsize=10)
    return figure


def moments(result: dict[str, list], k: int, when: str) -> str:
    """Mean speed and energy for the legend."""
    v, energy = result[f"v{when}"][k], result[f"K{when}"][k]
    if when:
        return f"⟨v⟩ = {v:.4g},  ⟨K⟩ = {energy:.4g}"
    return (
        f"⟨v⟩ = {v:.4f} ± {result['v_error'][k]:.4f} (theory {result['v_theory'][k]:.4f})\n"
        f"⟨K⟩ = {energy:.4f} ± {result['K_error'][k]:.4f} (theory {result['K_theory'][k]:.4f})"
    )


def main() -> None:
    parser = command_line(__doc__, "mixture.png", table=True)
    parser.add_argument("--skip", type=float, default=15, help="collisions per disk [15]")
    parser.add_argument("--apart", type=float, default=5, help="collisions per disk [5]")
    args = parser.parse_args()
    runs = read_all(args.runs)
    frames = [equilibrium_frames(r, args.skip, args.apart) or [r.frames - 1] for r in runs]
    result = table(runs, frames)
    print_table(result)
    save(draw(runs, frames, result), args.output, runs, "Speeds of a mixture")
    if args.csv:
        write_csv(args.csv, result)


if __name__ == "__main__":
    launch(main)
