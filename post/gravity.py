"""Distributions of squared speeds and heights of a gas under gravity, with exponential laws.

    python post/gravity.py runs/gravity/long.h5 -o gravity.png --csv gravity.csv

The temperature kT is the mean kinetic energy of a disk in equilibrium.  Equilibrium begins after
the first X collisions per disk, where X is the value of --equilibration and by default 15.  If an
observable drifts significantly after 15 collisions per disk, equilibrium begins later, when no
observable drifts any longer.  The figure and the second table state which frames are left out, and
why.  The solid lines show P(v^2) = m / (2 kT) exp(-m v^2 / 2 kT) and P(h) ~ exp(-m g h / kT).  The
height h is the height of the centre of a disk above its lowest possible position.  The laws that
the solid lines show are exact for a large number of point particles.  The dashed lines include two
corrections.  The first correction is for a fixed total energy of N disks: it replaces the factor
exp(-e / kT) for the energy e of a disk by (1 - e / (2 N kT))^(2 N - 2).  The second correction
accounts for the area that disks exclude for the centres of other disks.  The centres of disks of
species i cannot be in the area pi s_ij^2 around each disk of species j, where s_ij is the sum of
the two radii.  To first order, the excluded area multiplies the density of species i by exp(-sum_j
pi s_ij^2 n_j(h)).  The correction for the excluded area is a few per cent near the floor.  If sum_j
pi s_ij^2 n_j(h), calculated for point particles, exceeds 0.5 at the floor, no dashed line is drawn
for the heights.

The slopes are maximum-likelihood estimates of the decay constants of exponential distributions.
The fits use kinetic energies between 0 and 5 kT, and values of m g h between 1 and 5 kT.  If the
lid of the box is lower than 5 kT / m g, the fit of the heights ends at the lid.  Heights with m g h
below 1 kT are left out, because the finite size of the disks flattens the distribution near the
floor.  The errors of the slopes follow from the jackknife over ten blocks of time.
"""

from typing import NamedTuple

from ricochet import Run, RunError, equilibrium, statistics, thermodynamics
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
FEWEST_VALUES = 20  # smallest number of values from which a slope is determined
STEEPEST = 500.0  # largest decay constant times the range of a fit
CROWDED = 0.5  # excluded fraction of the area at the floor up to which the first order is used


class Samples(NamedTuple):
    """Samples (F, n) of n disks of a species in F frames: v^2, v_x^2 and height."""

    mass: float
    radius: float
    square: np.ndarray
    square_x: np.ndarray
    height: np.ndarray


def samples(run: Run, kind: Species, frames: list[int]) -> Samples:
    """Return the squared speeds and the heights of all disks of a species in the given frames."""
    squares = run.velocity[frames][:, kind.disks] ** 2
    height = run.position[frames][:, kind.disks, 1] - (run.lower[1] + kind.radius)
    return Samples(kind.mass, kind.radius, squares.sum(axis=2), squares[..., 0], height)


def log_slope(values: np.ndarray, limits: tuple[float, float]) -> float:
    """Return the decay constant of values with an exponential distribution between two limits.

    The result is the maximum-likelihood estimate of the decay constant, with which the truncated
    exponential distribution has the same mean as the values between the limits.  A straight line
    fitted to the logarithm of a histogram would be less accurate, because nearly empty bins would
    make the scatter of the slope larger by a third.
    """
    inside = values[(values >= limits[0]) & (values <= limits[1])]
    reach = limits[1] - limits[0]
    if len(inside) < FEWEST_VALUES or reach <= 0:
        return float("nan")

    def excess(decay: float) -> float:
        mean = 0.5 - decay / 12 if abs(decay) < 1e-4 else 1 / decay - 1 / np.expm1(decay)
        return mean - (np.mean(inside) - limits[0]) / reach

    return float(scipy.optimize.brentq(excess, -STEEPEST, STEEPEST) / reach)


def fit_limits(
    reach: tuple[float, float], law: float, largest: float = np.inf
) -> tuple[float, float]:
    """Return the limits of a fit, which ends at the largest value that a disk can have."""
    return reach[0] / law, min(reach[1] / law, largest)


def slope_of(
    values: np.ndarray, reach: tuple[float, float], laws: np.ndarray, largest: float = np.inf
) -> Estimate:
    """Return the decay constant of values (F, n), divided by that of the law, with its error.

    The argument `reach` is the range of the fit in units of kT, and `largest` is the largest value
    that a disk can have.  The error is determined by the jackknife method.  The first element of
    `laws` (BLOCKS + 1,) is the slope of the law for the mean kT of all frames; each other element
    is the slope for the mean kT without the frames of one block.
    """

    def over(law: float, own: np.ndarray) -> float:
        return log_slope(own, fit_limits(reach, law, largest)) / law

    whole = over(laws[0], values)
    if len(values) < BLOCKS:
        return Estimate(whole, np.nan)
    rests = (np.delete(values, own, axis=0) for own in blocks_of(len(values)))
    slopes = np.array([over(*one) for one in zip(laws[1:], rests, strict=True)])
    return Estimate(whole, estimate(BLOCKS * whole - (BLOCKS - 1) * slopes).error)


def blocks_of(frames: int) -> list[np.ndarray]:
    """Return the frames that belong to each block of time."""
    return np.array_split(np.arange(frames), BLOCKS)


def warmth(species: list[Samples]) -> np.ndarray:
    """Return ratios (BLOCKS + 1,) of kinetic energies to the mean kinetic energy of all frames.

    The first ratio, for all frames, is 1; each other ratio is for the frames outside one block of
    time.
    """
    energy = np.sum([0.5 * s.mass * s.square.sum(axis=1) for s in species], axis=0)
    rests = [np.delete(energy, own) for own in blocks_of(len(energy))]
    return np.array([1.0, *(np.mean(rest if len(rest) else energy) for rest in rests)]) / np.append(
        1.0, np.full(BLOCKS, energy.mean())
    )


def sharers(run: Run) -> float:
    """Return the number of disks that share a fixed total energy, or infinity with a heat bath."""
    return run.n_disks if run.nature.keeps_energy else np.inf


def sharing(energy: np.ndarray, temperature: float, count: float) -> np.ndarray:
    """Return the statistical weight of an energy of one disk, if the total energy is fixed."""
    if np.isinf(count):
        return np.exp(-energy / temperature)
    return np.maximum(1 - energy / (2 * count * temperature), 0) ** (2 * count - 2)


def crowded_heights(
    height: np.ndarray, species: list[Samples], pull: float, kt: float, width: float, share: float
) -> list[np.ndarray]:
    """Return the densities at the heights (H,), corrected to first order for the excluded area.

    The argument `width` is the width of the area that the centres of disks can reach.  The argument
    `share` is the number of disks among which a fixed total energy is distributed, or infinity with
    a heat bath.  The area that a disk excludes does not affect the disk itself.
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
    """Return the values of a density after normalising its integral to 1."""
    return weight / np.trapezoid(weight, x)


def law_slope(x: np.ndarray, density: np.ndarray, limits: tuple[float, float], count: int) -> float:
    """Return the slope that `log_slope` would determine from `count` samples of a known density."""
    integral = scipy.integrate.cumulative_trapezoid(density, x, initial=0)
    ranks = (np.arange(count) + 0.5) / count
    return log_slope(np.interp(ranks, integral / integral[-1], x), limits)


def crowding(run: Run, species: list[Samples], kt: float) -> float:
    """Return the largest fraction of the area near the floor that is excluded for a species."""
    radius, pull = np.array([(s.radius, s.height.shape[1] * s.mass) for s in species]).T
    taken = np.pi * np.add.outer(radius, radius) ** 2 @ pull * abs(run.gravity[1]) / kt
    return float(taken.max() / (run.edges[0] - 2 * radius[0]))


def heights(run: Run, species: list[Samples], kt: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the heights that centres can reach, and densities (NaN at large excluded area)."""
    free = run.edges - 2 * species[0].radius
    grid = np.linspace(0, free[1], 4001)
    if crowding(run, species, kt) > CROWDED:
        return grid, [np.full_like(grid, np.nan)] * len(species)
    return grid, crowded_heights(grid, species, abs(run.gravity[1]), kt, free[0], sharers(run))


def table(run: Run, species: list[Samples], kt: Estimate | SeriesMean) -> list[dict]:
    """Return the ratios of the fitted slopes to the slopes of the solid and of the dashed lines."""
    temperature = kt[0]
    grid, crowded = heights(run, species, temperature)
    rows, warm = [], warmth(species)
    for name, s, density in zip(run.names, species, crowded, strict=True):
        v_law, h_law = s.mass / (2 * temperature), s.mass * np.abs(run.gravity[1]) / temperature
        squares = np.linspace(0, 20 / v_law, 4001)
        shared = sharing(0.5 * s.mass * squares, temperature, sharers(run))
        row = {"species": name, "mass": s.mass, "kT": temperature, "kT_error": kt[1]}
        for part, energies in (("K", s.square), ("K_x", s.square_x)):
            row |= measured(part, correlated_mean(0.5 * s.mass * energies.mean(axis=1)))
        lid = float(run.edges[1] - 2 * s.radius)
        for kind, other, law, values, reach, x, weight, largest in (
            ("speed", "shared", v_law, s.square, SPEED_RANGE, squares, shared, np.inf),
            ("height", "crowded", h_law, s.height, HEIGHT_RANGE, grid, density, lid),
        ):
            limits = fit_limits(reach, law, largest)
            row |= measured(f"{kind}_slope", slope_of(values, reach, law / warm, largest))
            row[f"{kind}_{other}"] = law_slope(x, weight, limits, values.size) / law
        row["height_fit_to"] = float(min(HEIGHT_RANGE[1], h_law * lid))
        rows.append(row)
    return rows


def draw_histogram(panels, values: np.ndarray, top: float, colour: str, label: str) -> None:
    """Draw a normalised histogram with error bars in a linear and in a logarithmic panel."""
    bins = np.linspace(0, top, 51)
    blocks = np.array_split(values, min(BLOCKS, len(values)))
    parts = [binned(part.ravel(), bins).mean for part in blocks]
    height = Estimate(binned(values.ravel(), bins).mean, estimate(parts).error)
    for axes in panels:
        bars(axes, height, bins, color=colour, fill=True, alpha=0.3, label=label)


def draw(run: Run, species: list[Samples], result: list[dict], began: tuple) -> plt.Figure:
    """Draw the histograms of squared speeds (top row) and heights (bottom row).

    The left panels have linear axes, and the right panels have logarithmic axes.

    The argument `began` contains the time of the first frame used, and the reason why earlier
    frames are not used.
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
        "slope fitted for $mgh$ = {:g} to {:g} kT or the lid, over $mg/kT$".format(*HEIGHT_RANGE),
    )
    names = (
        run.units.label("$v^2$", "squared speed"),
        run.units.label("height h of the centre above its lowest position", "length"),
    )
    densities = (
        run.units.label("probability density", f"1/{quantity}")
        for quantity in ("squared speed", "length")
    )
    each = zip(panels, titles, names, densities, (1, lawful[0]), strict=True)
    for row, title, name, density, known in each:
        top = row[0].get_ylim()[1]
        row[0].set(ylabel=density, xlim=(0, None), ylim=(0, top))
        row[0].legend(loc="upper right", title=title)
        row[1].set(yscale="log", ylim=(1e-4 * top, 1.5 * top))
        for axes in row:
            axes.set_xlabel(name)
        if np.isfinite(known):
            row[1].plot([], [], color="0.4", lw=1.4, label="exponential law (in colour)")
            row[1].plot(
                [], [], color="black", lw=1, ls="--", label="finite number and size of disks"
            )
            row[1].legend(*(part[-2:] for part in row[1].get_legend_handles_labels()))
    second, found = f" {run.units.time}".rstrip(), (kt, result[0]["kT_error"])
    when = f"t = {began[0]:.4g} to {run.time[-1]:g}{second}"
    figure.suptitle(
        f"{caption([run])},  {when},  kT = {' ± '.join(rounded_to_error(*found))}\n"
        f"left out before t = {began[0]:.4g}{second}: {began[1]}"
    )
    return figure


def main() -> None:
    starts = {"equilibration": "15, or until no drift"}
    args = command_line(__doc__, "gravity.png", one=True, **starts).parse_args()
    (run,) = args.runs
    known = "walls", "gravity", "mixture", "thermal_walls", "thermostatted", "time_stepped"
    allow(run, "the exponential laws do not apply to it", *known)
    start, reason = equilibrium.relaxed_start(run, args.equilibration)
    frames = thermodynamics.frames_from(run, start)
    if not run.gravity[1]:
        raise Refused(f"{run.path}: has no gravity along y; the laws of heights do not apply")
    if not frames:
        raise RunError(f"{run.path}: needs frames in equilibrium")
    species = [samples(run, kind, frames) for kind in thermodynamics.kinds_of_disks(run)]
    result, notes = table(run, species, thermodynamics.temperature_after(run, start)), []
    for kind, s, row in zip(run.by_species, species, result, strict=True):
        mean = correlated_mean(s.height.mean(axis=1))
        notes += statistics.diagnostics(f"height of {kind.label}", [mean])
        if (end := row["height_fit_to"]) < HEIGHT_RANGE[1]:
            high = f"height of {kind.label}: the lid is at mgh = {end:.3g} kT"
            fitted = end > HEIGHT_RANGE[0]
            notes.append(f"{high}, where the fit ends" if fitted else f"{high}: no fit is possible")
    if (share := crowding(run, species, result[0]["kT"])) > CROWDED:
        notes.append(f"points would take {share:.2g} of the area at the floor: no law of heights")
    began = float(run.time[frames[0]]), reason
    told = [{"equilibrium_from": began[0], "frames": len(frames), "left_out_before": reason}]
    report(args, draw(run, species, result, began), result, told, notes=notes)


if __name__ == "__main__":
    launch(main)
