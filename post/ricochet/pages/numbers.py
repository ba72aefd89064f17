"""Numbers shown in the laboratory: the state of a simulation, means with errors, theory."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy

from ..analysis.equilibrium import SPEEDS_FORGET, conserved_momentum
from ..analysis.statistics import SeriesMean, correlated_mean, equilibration
from ..predictions.walls import virial_pressure
from ..reading.nature import Nature, bath_temperatures
from ..reading.box import obstacles_of, walls_of
from ..reading.frames import Series
from ..reading.reader import Run
from ..reading.records import Change
from ..running.simulation import Simulation

FEW_DISKS = 20  # largest number of disks whose next events are sent
PISTON_MARGIN = 0.2  # width of the region shown beyond a piston [longest edge of the box]
FEWEST = 40  # fewest samples of a mean with an error
TURNS = "angular_velocity"
KEPT = 5  # leading quantities of a sample, which are not averaged
FEWEST_FREEDOM = 4  # fewest degrees of freedom of an error
DECAYS = 5  # shortest duration of a mean, in decay times of slow fluctuations
POINTS = 200  # largest number of samples used to determine a decay time


@dataclass(frozen=True)
class SnapshotRun(Run):
    """Present state of a simulation in the form of a run with one frame and its observables."""

    simulation: Simulation

    def observable(self, name: str) -> Series:
        value = np.asarray(self.simulation.observable(name))
        return Series(np.array([self.simulation.time]), value[None])

    @property
    def changes(self) -> list[Change]:
        """Empty, because the parameters already describe the present state."""
        return []

    piston_positions = property(Run.piston_positions.func)  # not cached, because pistons move

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners of the box, with an additional margin beyond each piston."""
        way = np.zeros(4)
        way[[*self.piston_positions]] = PISTON_MARGIN * self.edges.max()
        lower, upper = Run.bounds.func(self)
        return lower - way[::2], upper + way[1::2]

    @cached_property
    def nature(self) -> Nature:
        return self.simulation.nature


def snapshot_run(simulation: Simulation) -> SnapshotRun:
    """Return the present state of a simulation in the form of a run with one frame."""
    parameters = simulation.parameters
    box, kinds = parameters["box"], parameters["species"]
    lower, upper = (np.asarray(box[name], dtype=float) for name in ("lower", "upper"))
    elements = {}
    if "all/rotational_energy" in simulation.observables:
        elements[TURNS] = simulation.angular_velocity[None]
    if "inside" in simulation.observables:
        elements["present"] = simulation.present[None]
    return SnapshotRun(
        simulation=simulation,
        path=Path(parameters.get("run", {}).get("title") or "simulation"),
        time=np.array([simulation.time]),
        position=simulation.position[None],
        velocity=simulation.velocity[None],
        image=None,
        event_count=None,
        recycled=None,
        disk_data=elements,
        mass=simulation.mass,
        radius=simulation.radius,
        species=simulation.species,
        names=tuple(kinds),
        lower=lower,
        edges=upper - lower,
        periodic=np.array([kind == "periodic" for kind in box["boundary"]]),
        obstacles=obstacles_of(parameters),
        walls=walls_of(parameters),
        parameters=parameters,
        provenance={},
    )


def observed(simulation: Simulation) -> dict[str, float]:
    """Return the time and the present observables, with only one component of each vector."""
    seen = simulation._observed().items()
    return {name: part[0].item() for name, part in seen} | {"time": simulation.time}


def energies(run: Run, value: dict) -> dict[str, list[float] | None]:
    """Return the mean energies of each species by kind; None for kinds that the run lacks."""
    found = {
        kind: [value.get(f"{name}/{kind}_energy", 0.0) for name in run.names]
        for kind in ("kinetic", "potential", "rotational")
    }
    lacking = {"potential": not run.gravity.any(), "rotational": TURNS not in run.disk_data}
    return found | {kind: None for kind, is_lacking in lacking.items() if is_lacking}


def sampled(count: int, value: dict) -> tuple[float, ...]:
    """Return time, energy (of the disks in the box), virial and area at each sample."""
    time, mean, virial = (value[name] for name in ("time", "all/kinetic_energy", "virial"))
    kinetic = mean * inside if (inside := value.get("inside", count)) else 0.0
    whole = kinetic + (virial / (2 * time) if time else 0.0)
    return time, kinetic, virial, whole / (value["virial_pressure"] or 1.0)


def pressure_between(samples: np.ndarray) -> SeriesMean:
    """Return the mean pressure between the first and the last sample; the sides may move."""
    (kinetic, virial, area), apart = samples[1:4], np.diff(samples[0])
    gain = kinetic[1:] * apart + np.diff(virial) / 2
    return correlated_mean(gain / area[1:], apart)


def sample_of(run: Run, value: dict) -> tuple[float, ...]:
    """Return the quantities of `sampled`, collisions per disk, temperature and mean speeds."""
    speeds = [value[f"{name}/mean_speed"] for name in run.names]
    tau = 2 * value["collisions"] / run.n_disks
    return (*sampled(run.n_disks, value), tau, value["all/temperature"], *speeds)


def means(run: Run, samples: Sequence[tuple[float, ...]], energy: float) -> list[dict]:
    """Return mean, error and theory of the temperature, the mean speeds and the pressure.

    The means over samples in equilibrium have errors that include the autocorrelation. They are
    omitted if the run does not relax, and a theory is omitted if none is known. While the run is
    too short for a reliable error, `short` is True. `energy` is the present energy of all disks.
    """
    titles = ["temperature"]
    titles += [f"mean speed of {name}" for name in run.names] if run.names[1:] else ["mean speed"]
    found: list[SeriesMean | None] = [None] * (len(titles) + 1)
    settles = run.nature.in_equilibrium
    if settles and len(samples) >= FEWEST:
        found = relaxed_means(run, np.array(samples).T, equilibrium_temperature(run, energy))
    expected = theory(run, energy, found[0].mean if found[0] else None)
    rows = zip([*titles, "pressure"], found, expected, strict=False)
    table = [
        {
            "name": title,
            "value": mean.mean if mean else None,
            "error": mean.error if mean and mean.error >= 0 else None,
            "short": settles and not (mean and mean.error >= 0),
            "theory": law,
        }
        for title, mean, law in rows
    ]
    ideal = {"name": "pressure of an ideal gas", "value": None, "error": None, "short": False}
    return [*table, ideal | {"theory": expected[-1]}]


def relaxed_means(run: Run, columns: np.ndarray, kt: float | None) -> list[SeriesMean | None]:
    """Return the means of temperature, mean speeds and pressure after the relaxation.

    They are returned after twice `SPEEDS_FORGET` collisions per disk. An error is NaN with too
    few degrees of freedom, or if the run is not several times longer than the decay time of slow
    fluctuations: of the total momentum or, with a heat bath, of the total energy. In a shorter run,
    samples look independent, although all deviate from the mean in the same direction.
    """
    tau = columns[KEPT - 1]
    first = max(map(equilibration, columns[KEPT:]))
    first = max(first, int(np.searchsorted(tau, tau[0] + SPEEDS_FORGET)))
    late = columns[:, first:]
    if late.shape[1] < FEWEST // 2 or tau[-1] - tau[first] < SPEEDS_FORGET:
        return [None] * (len(columns) - KEPT + 1)
    found = [*map(correlated_mean, late[KEPT:]), pressure_between(late)]
    count, energy, temperature = run.n_disks, late[1], late[KEPT]
    kt = kt or found[0].mean
    drift, axes = conserved_drift(run)
    share = 1 - axes / 2  # energy of the momentum that is not conserved, in units of kT
    fixed = not bath_temperatures(run.parameters)
    fixed = fixed or decays(energy, drift + (count - axes / 2) * kt, count * kt**2)
    calm = [decays(energy - count * temperature, drift + share * kt, share * kt**2)]
    calm += [True] * (len(found) - 1)
    return [
        one if one.error == 0 or (fixed and own and one.freedom >= FEWEST_FREEDOM) else short(one)
        for one, own in zip(found, calm, strict=True)
    ]


def short(mean: SeriesMean) -> SeriesMean:
    """Return a mean without its error."""
    return mean._replace(error=np.nan)


def decays(series: np.ndarray, mean: float, variance: float) -> bool:
    """Return whether fluctuations decay at least `DECAYS` times during a series (T,).

    The decay time is the lag at which the autocorrelation, averaged over all shorter lags, is 1/3.
    This average also decreases slowly for oscillations whose amplitude decays slowly. `mean` and
    `variance` are the values for a very long series.
    """
    rest = series[:: max(1, len(series) // POINTS)] - mean
    scale, total = max(variance, float(np.mean(rest**2))), 1.0
    if scale <= (1e-9 * mean) ** 2:
        return True  # constant up to rounding
    for lag in range(1, len(rest) // DECAYS + 1):
        total += 1 - float(np.mean((rest[lag:] - rest[:-lag]) ** 2)) / (2 * scale)
        if total <= (lag + 1) / 3:
            return True
    return False


def theory(run: Run, energy: float, measured: float | None) -> list[float | None]:
    """Return theoretical values of the quantities of `means`, and the pressure of an ideal gas.

    The observable `temperature` of n disks is kT (1 - 1/n), because it excludes the mean motion. If
    no theory predicts kT, the other values are based on the measured temperature.
    """
    count, alike = run.n_disks, [kind.alike for kind in run.by_species]
    law: list[float | None] = [None] * (len(alike) + 3)
    if not run.nature.in_equilibrium or count < 2:
        return law
    expected = equilibrium_temperature(run, energy)
    if expected:
        law[0] = expected * (1 - 1 / count)
    elif measured is None:
        return law
    kt = expected or measured / (1 - 1 / count)
    drift, axes = conserved_drift(run)
    mass, has_bath = float(np.sum(run.mass)), bool(bath_temperatures(run.parameters))
    fixed = fixed_energy_factor(freedoms(run)) ** 2 if expected and not has_bath else 1.0
    for k, kind in enumerate(run.by_species):
        if kind.alike:
            still = 1 - axes / 2 * kind.mass / mass  # the total momentum is no thermal motion
            law[1 + k] = mean_speed(still * fixed * kt / kind.mass, 2 * drift / mass)
    if not all(alike) or count <= FEW_DISKS:
        return law
    if run.nature & {"obstacles", "time_stepped", "gravity", "piston"}:
        return law
    sizes = [(kind.disks.sum(), kind.radii.mean()) for kind in run.by_species]
    area = float(np.prod(run.edges))
    # the kinetic part of the observable is the kinetic energy, which differs from n kT
    rest = (drift - axes / 2 * kt) / area
    pressure = kt * virial_pressure(*zip(*sizes, strict=True), run.edges, ~run.periodic)
    return [*law[:-2], pressure + rest, count * kt / area + rest]


def equilibrium_temperature(run: Run, energy: float) -> float | None:
    """Return kT in equilibrium, given by the heat bath or by the conserved energy."""
    nature = run.nature
    if baths := bath_temperatures(run.parameters):
        return baths[0]
    if not nature.keeps_energy or "gravity" in nature:
        return None
    return 2 * (energy - conserved_drift(run)[0]) / freedoms(run)


def freedoms(run: Run) -> int:
    """Return the number of degrees of freedom of the thermal motion of all disks."""
    return (3 if "rough" in run.nature else 2) * run.n_disks - conserved_drift(run)[1]


def fixed_energy_factor(count: int) -> float:
    """Return the mean speed at fixed energy, divided by the mean speed at fixed temperature.

    The velocities are distributed uniformly on a sphere in `count` dimensions.
    """
    half = count / 2
    return float(
        np.sqrt(half) * np.exp(scipy.special.gammaln(half) - scipy.special.gammaln(half + 0.5))
    )


def conserved_drift(run: Run) -> tuple[float, int]:
    """Return centre-of-mass energy along axes of conserved momentum, and how many these are."""
    free = conserved_momentum(run)
    momentum = np.sum(run.mass[:, None] * run.velocity[0], axis=0)
    return float(np.sum(momentum[free] ** 2) / 2 / np.sum(run.mass)), int(np.sum(free))


def mean_speed(thermal: float, drift: float) -> float:
    """Return the mean speed of disks with kT/m = `thermal` and squared drift velocity `drift`."""
    x = drift / 4 / thermal
    bessel = (1 + 2 * x) * scipy.special.ive(0, x) + 2 * x * scipy.special.ive(1, x)
    return float(np.sqrt(np.pi * thermal / 2) * bessel)
