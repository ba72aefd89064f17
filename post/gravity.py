"""Distributions of squared speeds and heights of a gas under gravity, against exponential laws.

    python post/gravity.py runs/gravity/long.h5 -o gravity.png --csv gravity.csv

kT is the mean of the kinetic energy in equilibrium.  Equilibrium begins after --equilibration or,
without that option, when no observable drifts any longer; the figure and the second table state why
earlier frames are left out. The solid lines are P(v^2) = m / (2 kT) exp(-m v^2 / 2 kT) and P(h) ~
exp(-m g h / kT) for the height h of the centre above its lowest position.  These laws apply to a
large number of point particles.  The dashed lines include two corrections.  If N disks share a
fixed energy, (1 - e / (2 N kT))^(2 N - 2) replaces exp(-e / kT) for the energy e of a disk.  The
centres of disks of species i are excluded from the area pi s_ij^2 around each disk of species j.
To first order this multiplies the density of species i by exp(-sum_j pi s_ij^2 n_j(h)), a
correction of a few per cent near the floor.  No line is drawn for the heights if this sum, computed
for point particles, exceeds 0.5.

Slopes are those of weighted lines fitted to the logarithm of the histograms, from 0 to 5 kT in the
kinetic energy and from 1 to 5 kT in m g h.  The heights below 1 kT are left out, because the finite
size of the disks flattens the distribution there.  The errors of the slopes follow from ten blocks
of time.
"""

from typing import NamedTuple

from ricochet import Run, RunError, statistics, thermodynamics
from ricochet.analysis.statistics import (
    Estimate,
    SeriesMean,
    binned,
    estimate,
    correlated_mean,
    rounded_to_error,
)
from ricochet.figures.drawing import bars, caption, colours, plt
from ricochet.reading.nature import Refused, allow
from ricochet.reading.reader import Species
from ricochet.script import command_line, launch, measured, report

import numpy as np
import scipy

SPEED_RANGE = (0.0, 5.0)  # range of m v^2 / 2 kT
HEIGHT_RANGE = (1.0, 5.0)  # range of m g h / kT
BLOCKS = 10  # blocks of time, for errors
CROWDED = 0.5  # excluded fraction of the area at the floor up to which the first order is used


class Samples(NamedTuple):
    """Samples of one species in F frames, (F, n): squared speeds, their x parts, and heights."""

    mass: float
    radius: float
    square: np.ndarray
    square_x: np.ndarray
    height: np.ndarray


def samples(run: Run, kind: Species, frames: list[int]) -> Samples:
    """Return squared speeds of a species and its heights above the lowest position of a centre."""
    squares = run.velocity[frames][:, kind.disks] ** 2
    height = run.position[frames][:, kind.disks, 1] - (run.lower[1] + kind.radius)
    return Samples(kind.mass, kind.radius, squares.sum(axis=2), squares[..., 0], height)


def log_slope(values: np.ndarray, limits: tuple[float, float], bins: int = 30) -> float:
    """Return the decay constant of a histogram from a weighted line fitted to its logarithm."""
    counts, edges = np.histogram(values, bins, limits)
    good = counts >= 5
    if good.sum() < 3:
        return float("nan")
    middle = (edges[1:] + edges[:-1]) / 2
    return -float(np.polyfit(middle[good], np.log(counts[good]), 1, w=np.sqrt(counts[good]))[0])


def sharers(run: Run) -> float:
    """Return the number of disks that share a fixed total energy; infinity with a heat bath."""
    return run.n_disks if run.nature.keeps_energy else np.inf


def sharing(energy: np.ndarray, temperature: float, count: float) -> np.ndarray:
    """Return the probability weight of an energy of one of `count` disks of fixed total energy."""
    if np.isinf(count):
        return np.exp(-energy / temperature)
    return np.maximum(1 - energy / (2 * count * temperature), 0) ** (2 * count - 2)


def crowded_heights(
    height: np.ndarray, species: list[Samples], pull: float, kt: float, width: float, share: float
) -> list[np.ndarray]:
    """Return the densities at the heights (H,) with the excluded area to first order.

    `width` is the width of the box that is accessible to centres, and `share` is the result of
    `sharers`.  A disk excludes no area for its own centre.
    """
    numbers = [s.height.shape[1] for s in species]
    ideal = [sharing(s.mass * pull * height, kt, share) for s in species]
    density = [normalised(height, weight) for weight in ideal]
    for _ in range(50):
        taken = [  # area per height that the other disks exclude for one disk of each species
            sum(
                np.pi * (one.radius + s.radius) ** 2 * (numbers[j] - (i == j)) * density[j]
                for j, s in enumerate(species)
            )
            for i, one in enumerate(species)
        ]
        pairs = zip(ideal, taken, strict=True)
        density = [normalised(height, own * np.exp(-area / width)) for own, area in pairs]
    return density


def normalised(x: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return a density that is normalised to the integral 1."""
    return weight / np.trapezoid(weight, x)


def law_slope(x: np.ndarray, density: np.ndarray, limits: tuple[float, float], count: int) -> float:
    """Return the slope that `log_slope` finds for `count` values of an exact density."""
    integral = scipy.integrate.cumulative_trapezoid(density, x, initial=0)
    ranks = (np.arange(count) + 0.5) / count
    return log_slope(np.interp(ranks, integral / integral[-1], x), limits)


def crowding(run: Run, species: list[Samples], kt: float) -> float:
    """Return the largest fraction of the area at the floor that is excluded for a species."""
    radius, pull = np.array([(s.radius, s.height.shape[1] * s.mass) for s in species]).T
    taken = np.pi * np.add.outer(radius, radius) ** 2 @ pull * abs(run.gravity[1]) / kt
    return float(taken.max() / (run.edges[0] - 2 * radius[0]))


def heights(run: Run, species: list[Samples], kt: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the accessible heights, and `crowded_heights` (NaN if too much is excluded)."""
    free = run.edges - 2 * species[0].radius
    grid = np.linspace(0, free[1], 4001)
    if crowding(run, species, kt) > CROWDED:
        return grid, [np.full_like(grid, np.nan)] * len(species)
    return grid, crowded_heights(grid, species, abs(run.gravity[1]), kt, free[0], sharers(run))


def table(run: Run, species: list[Samples], kt: Estimate | SeriesMean) -> list[dict]:
    """Return the fitted slopes divided by the slopes of the solid and of the dashed lines."""
    temperature = kt[0]
    grid, crowded = heights(run, species, temperature)
    rows = []
    for name, s, density in zip(run.names, species, crowded, strict=True):
        v_law, h_law = s.mass / (2 * temperature), s.mass * np.abs(run.gravity[1]) / temperature
        squares = np.linspace(0, 20 / v_law, 4001)
        shared = sharing(0.5 * s.mass * squares, temperature, sharers(run))
        row = {"species": name, "mass": s.mass, "kT": temperature, "kT_error": kt[1]}
        for part, energies in (("K", s.square), ("K_x", s.square_x)):
            row |= measured(part, correlated_mean(0.5 * s.mass * energies.mean(axis=1)))
        for kind, other, law, values, reach, x, weight in (
            ("speed", "shared", v_law, s.square, SPEED_RANGE, squares, shared),
            ("height", "crowded", h_law, s.height, HEIGHT_RANGE, grid, density),
        ):
            limits = tuple(np.array(reach) / law)
            error = estimate([log_slope(part, limits) for part in np.array_split(values, BLOCKS)])
            slope = Estimate(log_slope(values, limits) / law, error.error / law)
            row |= measured(f"{kind}_slope", slope)
            row[f"{kind}_{other}"] = law_slope(x, weight, limits, values.size) / law
        rows.append(row)
    return rows


def draw_histogram(panels, values: np.ndarray, top: float, colour: str, label: str) -> None:
    """Draw a normalised histogram in a linear and a logarithmic panel, with errors from blocks."""
    bins = np.linspace(0, top, 51)
    blocks = np.array_split(values, min(BLOCKS, len(values)))
    parts = [binned(part.ravel(), bins).mean for part in blocks]
    height = Estimate(binned(values.ravel(), bins).mean, estimate(parts).error)
    for axes in panels:
        bars(axes, height, bins, color=colour, fill=True, alpha=0.3, label=label)


def draw(run: Run, species: list[Samples], result: list[dict], began: tuple) -> plt.Figure:
    """Draw squared speeds above and heights below, linear on the left and logarithmic on the right.

    `began` is the time of the first frame and the reason why earlier frames are left out.
    """
    figure, panels = plt.subplots(2, 2, figsize=(11, 8), sharex="row")
    kt, g = result[0]["kT"], float(np.abs(run.gravity[1]))
    squares = np.linspace(0, 18 * kt / min(s.mass for s in species), 1000)
    (grid, crowded), count = heights(run, species, kt), sharers(run)
    lawful = 1 + 0 * crowded[0]  # both laws of the heights apply under the same condition
    for k, (s, row, colour) in enumerate(zip(species, result, colours(len(species)), strict=True)):
        v_law, h_law = s.mass / (2 * kt), s.mass * g / kt
        shared = sharing(0.5 * s.mass * squares, kt, count) * v_law * (1 - 0.5 / count)
        laws = (
            v_law * np.exp(-v_law * squares),
            lawful[k] * normalised(grid, np.exp(-h_law * grid)),
        )
        for axes, x, values, law, dashed, kind, other in zip(
            panels,
            (squares, grid),
            (s.square, s.height),
            laws,
            (shared, crowded[k]),
            ("speed", "height"),
            ("shared", "crowded"),
            strict=True,
        ):
            fitted = " ± ".join(rounded_to_error(row[f"{kind}_slope"], row[f"{kind}_slope_error"]))
            label = f"{run.by_species[k].label}: {fitted}"
            if np.isfinite(own := row[f"{kind}_{other}"]):
                label += f" (dashed: {own:.3f})"
            draw_histogram(axes, values, x[-1], colour, label)
            for one in axes:
                one.plot(x, law, color=colour, lw=1.4)
                one.plot(x, dashed, color="black", lw=1.0, ls="--")
    titles = (
        "slope fitted for $mv^2/2$ = {:g} to {:g} kT, over $m/2kT$".format(*SPEED_RANGE),
        "slope fitted for $mgh$ = {:g} to {:g} kT, over $mg/kT$".format(*HEIGHT_RANGE),
    )
    names = (
        run.units.label("$v^2$", "squared speed"),
        run.units.label("height h of the centre above its lowest position", "length"),
    )
    for row, title, name, known in zip(panels, titles, names, (1, lawful[0]), strict=True):
        row[0].set(ylabel="probability density", xlim=(0, None))
        row[0].legend(loc="upper right", title=title)
        top = row[0].get_ylim()[1]
        row[1].set(yscale="log", ylim=(1e-4 * top, 1.5 * top))
        for axes in row:
            axes.set_xlabel(name)
        if np.isfinite(known):
            row[1].plot([], [], color="0.4", lw=1.4, label="exponential law (in colour)")
            row[1].plot(
                [], [], color="black", lw=1, ls="--", label="finite number and size of disks"
            )
            row[1].legend(*(part[-2:] for part in row[1].get_legend_handles_labels()))
    when, found = f"t = {began[0]:.4g} to {run.time[-1]:g}", (kt, result[0]["kT_error"])
    figure.suptitle(
        f"{caption([run])},  {when},  kT = {' ± '.join(rounded_to_error(*found))}\n"
        f"left out before: {began[1]}"
    )
    return figure


def main() -> None:
    args = command_line(__doc__, "gravity.png", one=True, equilibration=None).parse_args()
    (run,) = args.runs
    known = "walls", "gravity", "mixture", "thermal_walls", "thermostatted", "time_stepped"
    allow(run, "the exponential laws do not apply to it", *known)
    start, reason = thermodynamics.explained_start(run, args.equilibration)
    frames = thermodynamics.frames_from(run, start)
    if not run.gravity[1]:
        raise Refused(f"{run.path}: has no gravity along y; the laws of heights do not apply")
    if not frames:
        raise RunError(f"{run.path}: needs frames in equilibrium")
    species = [samples(run, kind, frames) for kind in thermodynamics.kinds_of_disks(run)]
    result, notes = table(run, species, thermodynamics.temperature(run, args.equilibration)), []
    for kind, s in zip(run.by_species, species, strict=True):
        mean = correlated_mean(s.height.mean(axis=1))
        notes += statistics.diagnostics(f"height of {kind.label}", [mean])
    if (share := crowding(run, species, result[0]["kT"])) > CROWDED:
        notes.append(f"points would take {share:.2g} of the area at the floor: no law of heights")
    began = float(run.time[frames[0]]), reason
    told = [{"equilibrium_from": began[0], "frames": len(frames), "left_out_before": reason}]
    report(args, draw(run, species, result, began), result, told, notes=notes)


if __name__ == "__main__":
    launch(main)
