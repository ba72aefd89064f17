"""A gas under gravity in equilibrium: squared speeds and heights against exponential laws.

    python post/gravity.py runs/gravity/long.h5 -o gravity.png --after 20 --csv gravity.csv

kT is the mean kinetic energy per disk after the time --after.  Laws:
P(v^2) = m / (2 kT) exp(-m v^2 / 2 kT) and P(h) ~ exp(-m g h / kT) for the height h of the
centre above its lowest place.  Slopes are fitted to the logarithm of the histograms; their
errors come from ten blocks of time.
"""

from typing import NamedTuple

import numpy as np

from drawing import (
    COLOURS,
    caption,
    command_line,
    launch,
    plt,
    print_table,
    save,
    species_label,
    write_csv,
)
from read_run import Run, RunError, read_run
from theory import Estimate, estimate


class Samples(NamedTuple):
    """Of one species after the start: (F, n) squared speeds and heights."""

    mass: float
    square: np.ndarray
    height: np.ndarray


def samples(run: Run, name: str, after: float) -> Samples:
    """Squared speeds and heights above the lowest place."""
    mask = run.of_species(name)
    late = slice(int(np.searchsorted(run.time, after)), None)
    square = np.sum(run.velocity[late][:, mask] ** 2, axis=2)
    height = run.position[late][:, mask, 1] - (run.lower[1] + run.radius[mask])
    return Samples(float(run.mass[mask][0]), square, height)


def log_slope(values: np.ndarray, top: float, bins: int = 30) -> float:
    """Decay constant of a histogram over 0..top, by a weighted line through its logarithm."""
    counts, edges = np.histogram(values, bins, (0, top))
    good = counts >= 5
    if good.sum() < 3:
        return float("nan")
    middle = (edges[1:] + edges[:-1]) / 2
    return -float(np.polyfit(middle[good], np.log(counts[good]), 1, w=np.sqrt(counts[good]))[0])


def slope_estimate(values: np.ndarray, top: float, blocks: int = 10) -> Estimate:
    """Slope of all values with an error from blocks of time."""
    parts = [log_slope(part, top) for part in np.array_split(values, blocks)]
    return Estimate(log_slope(values, top), estimate(parts).error)


def table(run: Run, species: list[Samples], temperature: float) -> dict[str, list]:
    """Fitted slopes over those of the laws."""
    g = float(np.abs(run.gravity[1]))
    rows = []
    for name, s in zip(run.names, species, strict=True):
        speed = slope_estimate(s.square, 10 * temperature / s.mass)
        height = slope_estimate(s.height, 4 * temperature / (s.mass * g))
        rows.append(
            {
                "species": name,
                "mass": s.mass,
                "K": float(0.5 * s.mass * s.square.mean()),
                "kT": temperature,
                "speed_slope": speed.mean,
                "speed_slope_error": float(speed.error),
                "speed_slope_law": s.mass / (2 * temperature),
                "height_slope": height.mean,
                "height_slope_error": float(height.error),
                "height_slope_law": s.mass * g / temperature,
            }
        )
    return {key: [row[key] for row in rows] for key in rows[0]}


def draw_law(
    axes: plt.Axes, values: np.ndarray, slope: float, top: float, colour: str, label: str, law: str
) -> None:
    """Histogram and law with logarithmic ordinate."""
    bins = np.linspace(0, top, 51)
    density = np.histogram(values, bins)[0] / (values.size * np.diff(bins))
    axes.stairs(density, bins, color=colour, fill=True, alpha=0.45, label=label)
    x = np.linspace(0, top, 200)
    axes.semilogy(x, slope * np.exp(-slope * x), color="black", lw=1.2, label=law)
    axes.set_ylim(0.3 * slope * np.exp(-slope * top), 4 * slope)
    axes.legend(loc="upper right")


def draw(run: Run, species: list[Samples], result: dict[str, list], after: float) -> plt.Figure:
    """A row per species: squared speed and height."""
    figure, panels = plt.subplots(
        len(species), 2, squeeze=False, figsize=(10, 3.3 * len(species) + 0.4)
    )
    for k, (s, row) in enumerate(zip(species, panels, strict=True)):
        colour, label = COLOURS[k], species_label(run, run.names[k])
        v_law, h_law = result["speed_slope_law"][k], result["height_slope_law"][k]
        speed = result["speed_slope"][k] / v_law, result["speed_slope_error"][k] / v_law
        height = result["height_slope"][k] / h_law, result["height_slope_error"][k] / h_law
        draw_law(
            row[0],
            s.square.ravel(),
            v_law,
            9 / v_law,
            colour,
            label,
            f"$\\frac{{m}}{{2kT}}e^{{-mv^2/2kT}}$, slope fit/law {speed[0]:.3f} ± {speed[1]:.3f}",
        )
        draw_law(
            row[1],
            s.height.ravel(),
            h_law,
            min(9 / h_law, run.edges[1]),
            colour,
            label,
            f"$\\frac{{mg}}{{kT}}e^{{-mgh/kT}}$, slope fit/law {height[0]:.3f} ± {height[1]:.3f}",
        )
        row[0].set(xlabel="$v^2$ (reduced units)", ylabel="probability density")
        row[1].set(xlabel="height of the centre above its lowest place (reduced units)")
    figure.suptitle(
        f"{caption([run])},  t = {after:g} to {run.time[-1]:g},  kT = ⟨K⟩ = {result['kT'][0]:.4f}",
        fontsize=10,
    )
    return figure


def main() -> None:
    parser = command_line(__doc__, "gravity.png", one=True, table=True)
    parser.add_argument("--after", type=float, default=20, help="time of equilibrium [20]")
    args = parser.parse_args()
    run = read_run(args.run)
    if not run.gravity[1] or run.time[-1] <= args.after:
        raise RunError(f"{run.path}: needs gravity along y and frames after t = {args.after:g}")
    species = [samples(run, name, args.after) for name in run.names]
    energy = [0.5 * s.mass * s.square for s in species]
    temperature = float(np.sum([e.sum() for e in energy]) / np.sum([e.size for e in energy]))
    result = table(run, species, temperature)
    print_table(result)
    save(draw(run, species, result, args.after), args.output, [run], "Gas under gravity")
    if args.csv:
        write_csv(args.csv, result)


if __name__ == "__main__":
    launch(main)
