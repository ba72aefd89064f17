"""Distributions of squared speed and of height under gravity, compared with exponential laws."""

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import scipy

from ...analysis import equilibrium, statistics, thermodynamics
from ...analysis.estimates import Estimate, binned, estimate, jackknife, rounded_to_error
from ...analysis.statistics import SeriesMean, correlated_mean
from ...figures.drawing import bars, caption, colours, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...reading.nature import Refused, allow
from ...reading.reader import Run, RunError, Species
from ..groups import Group
from ..options import shared
from ..registry import Analysis
from ..result import Result
from ..tables import measured

SPEED_RANGE = (0.0, 5.0)  # range of m v^2 / 2 kT
HEIGHT_RANGE = (1.0, 5.0)  # range of m g h / kT
BLOCKS = 10  # blocks of time from which errors are estimated
FEWEST_VALUES = 20  # fewest values from which a slope is determined
STEEPEST = 500.0  # largest decay constant times the range of a fit
# largest excluded fraction of the area at the floor for which the first order is used
CROWDED = 0.5


class Samples(NamedTuple):
    """Samples (F, n) of v^2, v_x^2 and height for n disks of a species in F frames."""

    mass: float
    radius: float
    square: np.ndarray
    square_x: np.ndarray
    height: np.ndarray


def samples(run: Run, kind: Species, frames: list[int]) -> Samples:
    """Return the squared speeds and heights of all disks of a species in the given frames."""
    squares = run.velocity[frames][:, kind.disks] ** 2
    height = run.position[frames][:, kind.disks, 1] - (run.lower[1] + kind.radius)
    return Samples(kind.mass, kind.radius, squares.sum(axis=2), squares[..., 0], height)


def log_slope(values: np.ndarray, limits: tuple[float, float]) -> float:
    """Return the decay constant of exponentially distributed values between two limits.

    With this constant, the maximum-likelihood estimate, the mean of the truncated distribution
    equals the mean of the values. The slope of a line fitted to a histogram would scatter by a
    third more, because of nearly empty bins.
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
    """Return the limits of a fit, which ends at the largest value possible for a disk."""
    return reach[0] / law, min(reach[1] / law, largest)


def slope_of(
    values: np.ndarray, reach: tuple[float, float], laws: np.ndarray, largest: float = np.inf
) -> Estimate:
    """Return the decay constant of values (F, n), divided by the predicted one, with its error.

    `reach` is the range of the fit in kT, and `largest` the largest value possible for a disk.
    `laws` (BLOCKS + 1,) are the slopes for the mean kT of all frames, and for the mean kT without
    each block of frames (jackknife).
    """

    def over(law: float, own: np.ndarray) -> float:
        return log_slope(own, fit_limits(reach, law, largest)) / law

    whole = over(laws[0], values)
    if len(values) < BLOCKS:
        return Estimate(whole, np.nan)
    rests = (np.delete(values, own, axis=0) for own in blocks_of(len(values)))
    slopes = np.array([over(*one) for one in zip(laws[1:], rests, strict=True)])
    return Estimate(whole, jackknife(whole, slopes).error)


def blocks_of(frames: int) -> list[np.ndarray]:
    """Return the frames of each block of time."""
    return np.array_split(np.arange(frames), BLOCKS)


def warmth(species: list[Samples]) -> np.ndarray:
    """Return mean kinetic energies (BLOCKS + 1,), relative to the mean over all frames.

    The first one is the mean over all frames and equals 1. Each of the others leaves out one block
    of time.
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
    """Return the statistical weight of the energy of one disk at fixed total energy."""
    if np.isinf(count):
        return np.exp(-energy / temperature)
    return np.maximum(1 - energy / (2 * count * temperature), 0) ** (2 * count - 2)


def crowded_heights(
    height: np.ndarray, species: list[Samples], pull: float, kt: float, width: float, share: float
) -> list[np.ndarray]:
    """Return the densities at heights (H,), corrected to first order for the excluded area.

    The area that disk centres can reach is `width` wide; a disk does not exclude itself. `share` is
    the number of disks that share a fixed total energy; it is infinite if there is a heat bath.
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
    """Normalise the integral of a density to 1."""
    return weight / np.trapezoid(weight, x)


def law_slope(x: np.ndarray, density: np.ndarray, limits: tuple[float, float], count: int) -> float:
    """Return the slope that `log_slope` would find for `count` samples of a known density."""
    integral = scipy.integrate.cumulative_trapezoid(density, x, initial=0)
    ranks = (np.arange(count) + 0.5) / count
    return log_slope(np.interp(ranks, integral / integral[-1], x), limits)


def crowding(run: Run, species: list[Samples], kt: float) -> float:
    """Return the largest fraction of the area near the floor that is excluded for a species."""
    radius, pull = np.array([(s.radius, s.height.shape[1] * s.mass) for s in species]).T
    taken = np.pi * np.add.outer(radius, radius) ** 2 @ pull * abs(run.gravity[1]) / kt
    return float(taken.max() / (run.edges[0] - 2 * radius[0]))


def heights(run: Run, species: list[Samples], kt: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return heights that centres can reach, and their densities (NaN if too much is excluded)."""
    free = run.edges - 2 * species[0].radius
    grid = np.linspace(0, free[1], 4001)
    if crowding(run, species, kt) > CROWDED:
        return grid, [np.full_like(grid, np.nan)] * len(species)
    return grid, crowded_heights(grid, species, abs(run.gravity[1]), kt, free[0], sharers(run))


def table(run: Run, species: list[Samples], kt: Estimate | SeriesMean) -> list[dict[str, Any]]:
    """Return the fitted slopes, divided by the slopes of the solid and of the dashed lines."""
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


class Laws(NamedTuple):
    """Values of a species, and two laws for their distribution."""

    x: np.ndarray  # (P,) squared speeds or heights
    values: np.ndarray  # (F, n)
    ideal: np.ndarray  # (P,) exponential law
    finite: np.ndarray  # (P,) law for disks of finite number and size


def speed_laws(run: Run, species: list[Samples], kt: float) -> list[Laws]:
    """Return the squared speeds of each species, with laws of their distribution."""
    squares = np.linspace(0, 18 * kt / min(s.mass for s in species), 1000)
    count, found = sharers(run), []
    for s in species:
        law = s.mass / (2 * kt)
        finite = sharing(0.5 * s.mass * squares, kt, count) * law * (1 - 0.5 / count)
        found.append(Laws(squares, s.square, law * np.exp(-law * squares), finite))
    return found


def height_laws(run: Run, species: list[Samples], kt: float) -> list[Laws]:
    """Return the heights of each species, with laws of their distribution."""
    grid, crowded = heights(run, species, kt)
    found = []
    for s, finite in zip(species, crowded, strict=True):
        ideal = normalised(grid, np.exp(-s.mass * abs(run.gravity[1]) / kt * grid))
        known = 1 + 0 * finite  # both laws of the heights apply under the same condition
        found.append(Laws(grid, s.height, known * ideal, finite))
    return found


def draw_histogram(axes: plt.Axes, values: np.ndarray, top: float, colour: str, label: str) -> None:
    """Plot a normalised histogram with error bars."""
    bins = np.linspace(0, top, 51)
    blocks = np.array_split(values, min(BLOCKS, len(values)))
    parts = [binned(part.ravel(), bins).mean for part in blocks]
    height = Estimate(binned(values.ravel(), bins).mean, estimate(parts).error)
    bars(axes, height, bins, color=colour, fill=True, alpha=0.3, label=label)


def draw_laws(axes: plt.Axes, result: Result, kind: str, logarithmic: bool) -> None:
    """Plot the histograms of squared speeds ('speed') or heights ('height') with both laws."""
    run, species = result.runs[0], result.values
    laws_of, quantity = (
        (speed_laws, "squared speed") if kind == "speed" else (height_laws, "length")
    )
    laws = laws_of(run, species, result.table[0]["kT"])
    for own, name, row, colour in zip(
        laws, run.by_species, result.table, colours(len(laws)), strict=True
    ):
        fitted = " ± ".join(rounded_to_error(row[f"{kind}_slope"], row[f"{kind}_slope_error"]))
        label = f"{name.label}: {fitted}"
        known = row[f"{kind}_{'shared' if kind == 'speed' else 'crowded'}"]
        label += f" (dashed: {known:.3f})" if np.isfinite(known) else ""
        draw_histogram(axes, own.values, own.x[-1], colour, "" if logarithmic else label)
        axes.plot(own.x, own.ideal, color=colour, lw=1.4)
        axes.plot(own.x, own.finite, color="black", lw=1.0, ls="--")
    names = {"speed": "v²", "height": "height h of the centre"}
    axes.set_xlabel(run.units.label(names[kind], quantity))
    axes.set_ylabel(run.units.label("probability density", f"1/{quantity}"))
    axes.set_xlim(0, None)
    top = axes.get_ylim()[1]
    if logarithmic:
        axes.set(yscale="log", ylim=(1e-4 * top, 1.5 * top))
    else:
        axes.set_ylim(0, top)
    if logarithmic and np.isfinite(laws[0].ideal[0]):
        axes.plot([], [], color="0.4", lw=1.4, label="exponential law (in colour)")
        axes.plot([], [], color="black", lw=1, ls="--", label="finite number and size")
    legend_above(axes, **({} if logarithmic else {"title": "fitted slope / theory"}))


def draw(result: Result) -> Sheet:
    """Plot squared speeds (top) and heights (bottom) on linear and on logarithmic axes."""
    run, row, rows = result.runs[0], result.table[0], []
    for kind, name in (("speed", "speeds"), ("height", "heights")):
        linear = Panel(name, draw_laws, (result, kind, False), aspect=0.75)
        more = {"aspect": 0.75, "share_x": name}
        rows.append([linear, Panel(f"{name}_log", draw_laws, (result, kind, True), **more)])
    kt = " ± ".join(rounded_to_error(row["kT"], row["kT_error"]))
    began = result.further[0][0]["equilibrium_from"]
    when = f"t = {began:.4g} to {run.time[-1]:g} {run.units.time}".rstrip()
    return Sheet(rows, f"{caption([run])},  {when},  kT = {kt} {run.units.energy}".rstrip())


def check(run: Run) -> None:
    """Raise Refused unless the exponential laws apply to a run."""
    known = "walls", "gravity", "mixture", "thermal_walls", "thermostatted", "time_stepped"
    allow(run, "the exponential laws do not apply to it", *known)


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Compare the slopes of the distributions with exponential laws."""
    (run,) = groups[0].runs
    start, reason = equilibrium.relaxed_start(run, options.equilibration)
    frames = thermodynamics.frames_from(run, start)
    if not run.gravity[1]:
        raise Refused(f"{run.path}: has no gravity along y; the laws of heights do not apply")
    if not frames:
        raise RunError(f"{run.path}: needs frames in equilibrium")
    species = [samples(run, kind, frames) for kind in thermodynamics.kinds_of_disks(run)]
    kt = thermodynamics.temperature_after(run, start)
    if not np.isfinite(kt.mean):
        raise RunError(f"{run.path}: needs two samples of the observables in equilibrium")
    rows = table(run, species, kt)
    warnings: list[str] = []
    for kind, s, row in zip(run.by_species, species, rows, strict=True):
        mean = correlated_mean(s.height.mean(axis=1))
        warnings += statistics.diagnostics(f"height of {kind.label}", [mean])
        if (end := row["height_fit_to"]) < HEIGHT_RANGE[1]:
            high = f"height of {kind.label}: the lid is at mgh = {end:.3g} kT"
            fitted = end > HEIGHT_RANGE[0]
            last = f"{high}, where the fit ends" if fitted else f"{high}: no fit is possible"
            warnings.append(last)
    if (share := crowding(run, species, rows[0]["kT"])) > CROWDED:
        taken = f"points would take {share:.2g} of the area at the floor"
        warnings.append(f"{taken}: no law of heights")
    began = float(run.time[frames[0]])
    told = [{"equilibrium_from": began, "frames": len(frames), "left_out_before": reason}]
    notes = [
        f"Frames from t = {began:.4g} {run.units.time}".rstrip() + f" on; before: {reason}.",
        "Fits: kinetic energies {:g} to {:g} kT; mgh = {:g} to {:g} kT or the lid. ".format(
            *SPEED_RANGE, *HEIGHT_RANGE
        )
        + "Bars: standard errors, from ten blocks of time. h is measured from the lowest position.",
    ]
    return Result(rows, notes=notes, warnings=warnings, further=[told], values=species)


ANALYSIS = Analysis(
    compute,
    draw,
    options=(shared("equilibration", "15, or until no drift"),),
    accepts=check,
    single=True,
)
