"""Numbers that the laboratory shows: the state of a simulation, means with errors, theory."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy

from ..analysis.equilibrium import conserved_momentum
from ..analysis.statistics import SeriesMean, correlated_mean, equilibration
from ..predictions.walls import virial_pressure
from ..reading.nature import Nature, bath_temperatures
from ..reading.reader import Run, Series, obstacles_of, walls_of
from ..reading.records import Change
from ..running.simulation import Simulation

FEW_DISKS = 20  # largest number of disks whose next events are sent
PISTON_MARGIN = 0.2  # region beyond a piston that is shown [largest edge of the box]
FEWEST = 40  # smallest number of samples of a mean with an error
TURNS = "angular_velocity"
KEPT = 4  # quantities at the start of a sample from which pressures follow


@dataclass(frozen=True)
class SnapshotRun(Run):
    """Present state of a simulation, in the form of a run with one frame and its observables."""

    simulation: Simulation

    def observable(self, name: str) -> Series:
        value = np.asarray(self.simulation.observable(name))
        return Series(np.array([self.simulation.time]), value[None])

    @property
    def changes(self) -> list[Change]:
        """No changes, because the parameters describe the present state."""
        return []

    piston_positions = property(Run.piston_positions.func)  # not cached, because pistons move

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners of the box, with an additional margin at each side that is a piston."""
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
    """Return the time and the present observables; vectors are represented by one component."""
    seen = simulation._observed().items()
    return {name: part[0].item() for name, part in seen} | {"time": simulation.time}


def sampled(count: int, value: dict) -> tuple[float, ...]:
    """Return the quantities from which means are computed: time, energy, virial, area.

    The energy is that of all `count` disks or, in an open system, of the disks inside.
    """
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
    """Return a sample: the quantities of `sampled`, the temperature, and the mean speeds."""
    speeds = [value[f"{name}/mean_speed"] for name in run.names]
    return (*sampled(run.n_disks, value), value["all/temperature"], *speeds)


def means(run: Run, samples: Sequence[tuple[float, ...]], energy: float) -> list[dict]:
    """Return mean, error and theory of the temperature, the mean speeds and the pressure.

    The means over samples in equilibrium have errors with autocorrelation. They are omitted if the
    run does not relax, or has too few samples so far, as theories are where none is known. `energy`
    is the present energy of all disks.
    """
    titles = ["temperature"]
    titles += [f"mean speed of {name}" for name in run.names] if run.names[1:] else ["mean speed"]
    found: list[SeriesMean | None] = [None] * (len(titles) + 1)
    columns = np.array(samples).T
    if run.nature.in_equilibrium and len(samples) >= FEWEST:
        first = max(map(equilibration, columns[KEPT:]))
        if len(samples) - first > FEWEST // 2:
            late = columns[:, first:]
            found = [*map(correlated_mean, late[KEPT:]), pressure_between(late)]
    expected = theory(run, energy, found[0].mean if found[0] else None)
    return [
        {
            "name": title,
            "value": mean.mean if mean else None,
            "error": mean.error if mean else None,
            "theory": law,
        }
        for title, mean, law in zip(
            [*titles, "pressure", "pressure of an ideal gas"],
            [*found, None],
            expected,
            strict=True,
        )
    ]


def theory(run: Run, energy: float, measured: float | None) -> list[float | None]:
    """Return theoretical values of the quantities of `means` and of the pressure of an ideal gas.

    The observable `temperature` of n disks is kT (1 - 1/n), because it excludes the mean motion. If
    no theory predicts kT, the other values follow from the measured temperature.
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
    for k, kind in enumerate(run.by_species):
        if kind.alike:
            law[1 + k] = mean_speed(kt / kind.mass, 2 * drift / np.sum(run.mass))
    if not all(alike) or count <= FEW_DISKS:
        return law
    if run.nature & {"obstacles", "time_stepped", "gravity", "piston"}:
        return law
    sizes = [(kind.disks.sum(), kind.radii.mean()) for kind in run.by_species]
    area = float(np.prod(run.edges))
    rest = (drift - axes / 2 * kt) / area  # the observable contains the kinetic energy, not n kT
    pressure = kt * virial_pressure(*zip(*sizes, strict=True), run.edges, ~run.periodic)
    return [*law[:-2], pressure + rest, count * kt / area + rest]


def equilibrium_temperature(run: Run, energy: float) -> float | None:
    """Return kT of a run in equilibrium from its heat bath or from its conserved energy."""
    nature = run.nature
    if baths := bath_temperatures(run.parameters):
        return baths[0]
    if not nature.keeps_energy or "gravity" in nature:
        return None
    drift, axes = conserved_drift(run)
    freedoms = 2 * run.n_disks - axes + ("rough" in nature) * run.n_disks
    return 2 * (energy - drift) / freedoms


def conserved_drift(run: Run) -> tuple[float, int]:
    """Return the energy of the centre of mass along axes of conserved momentum; count the axes."""
    free = conserved_momentum(run)
    momentum = np.sum(run.mass[:, None] * run.velocity[0], axis=0)
    return float(np.sum(momentum[free] ** 2) / 2 / np.sum(run.mass)), int(np.sum(free))


def mean_speed(thermal: float, drift: float) -> float:
    """Return the mean speed of disks with kT/m = `thermal` and squared drift velocity `drift`."""
    x = drift / 4 / thermal
    bessel = (1 + 2 * x) * scipy.special.ive(0, x) + 2 * x * scipy.special.ive(1, x)
    return float(np.sqrt(np.pi * thermal / 2) * bessel)
