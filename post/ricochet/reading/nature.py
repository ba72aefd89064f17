"""Traits of a run: the physical properties that determine which theories apply to it.

    run.nature                      # Nature({'inelastic', 'walls', ...}), the differences from
                                    # equal smooth elastic disks in an empty periodic box
    run.nature.closed               # whether only collisions change the energy
    allow(run, "Haff's law", "inelastic", "mixture")   # an error for any other trait

`nature_of` determines the traits from the input variables and the energy balance, both for output
files and for simulations in memory.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from .files import RunError

ROUNDING = 1e-6  # relative energy loss up to which it may be a rounding error
#: All traits, with their descriptions in error messages.
TRAITS = {
    "changed": "was changed during the run (--times takes the time between two changes)",
    "collapsed": "passed an inelastic collapse, after which rounding errors determine its state",
    "time_stepped": "is time-stepped",
    "sheared": "is sheared (box.shear_rate)",
    "noise_driven": "is heated by noise (&drive)",
    "random_walk": "has a centre of mass that noise moves (drive.keep_momentum)",
    "active": "has active disks (&drive)",
    "recycled": "recycles disks (drive.kind = 'recycle'), which jump",
    "open": "is an open system, which disks leave or enter (side.open, &source, species.waiting)",
    "moving_sides": "has moving sides",
    "piston": "has a piston",
    "sliding_surfaces": "has sliding surfaces",
    "unequal_temperatures": "is heated and cooled at different temperatures",
    "thermostatted": "is coupled to a heat bath (&drive)",
    "thermal_walls": "has thermal walls (temperature)",
    "gravity": "falls (box.gravity)",
    "inelastic": "is not elastic: it loses energy in collisions",
    "soft_contacts": "has a velocity-dependent restitution (contact.restitution_law)",
    "rough": "has rough disks, which rotate after collisions",
    "rotating": "has rotating disks",
    "round_container": "conserves angular momentum in a round container",
    "obstacles": "has obstacles or walls in the box",
    "pair_restitution": "has a restitution for each pair of species",
    "walls": "has walls",
    "mixture": "has disks of different mass or radius",
}
#: Traits of runs whose energy also changes by processes other than dissipation in collisions.
SOURCES = {
    "changed",
    "sheared",
    "noise_driven",
    "active",
    "recycled",
    "open",
    "moving_sides",
    "piston",
    "sliding_surfaces",
}
SOURCES |= {"thermostatted", "thermal_walls"}
THERMOSTATS = ("andersen", "brownian")  # kinds of driving that act as a heat bath
#: Traits of runs in which velocities also change between collisions.
KICKED = {"noise_driven", "active", "recycled", "thermostatted"}
#: Traits of runs whose velocities do not relax to the Maxwell distribution.
UNSETTLED = {*SOURCES, "unequal_temperatures", "inelastic", "soft_contacts", "round_container"} - {
    "thermostatted",
    "thermal_walls",
    "piston",
}
#: Traits with which velocities may relax to the Maxwell distribution.
SETTLED = TRAITS.keys() - UNSETTLED


class Refused(RunError):
    """Error for a run to which a theory does not apply, with the reason in its message."""


class Nature(frozenset[str]):
    """Set of all traits of a run; `TRAITS` lists the possible ones."""

    @property
    def closed(self) -> bool:
        """True if the energy of the disks changes only by dissipation in collisions."""
        return not self & SOURCES

    @property
    def driven(self) -> bool:
        """True if processes other than dissipation in collisions also change the energy."""
        return not self.closed

    @property
    def cooling(self) -> bool:
        """True for a freely cooling gas, which reaches no steady state."""
        return self.closed and "inelastic" in self

    @property
    def keeps_energy(self) -> bool:
        """True if the total energy of the disks is conserved."""
        return self.closed and "inelastic" not in self

    @property
    def keeps_kinetic_energy(self) -> bool:
        """True if the translational kinetic energy, and thus kT, is conserved on average."""
        return self.keeps_energy and not self & {"gravity", "rough", "rotating"}

    @property
    def in_equilibrium(self) -> bool:
        """True if velocities relax to the Maxwell distribution of a uniform temperature."""
        return not self & UNSETTLED


def nature_of(
    parameters: Mapping[str, Any],
    mass: np.ndarray,
    radius: np.ndarray,
    lost: float,
    turning: bool,
    collapsed: bool,
) -> Nature:
    """Return the traits of a run, given its input variables and its energy balance.

    `lost` is the dissipated energy relative to the largest kinetic energy, `turning` is True if the
    disks can rotate, and `collapsed` if an inelastic collapse occurred.
    """
    contact, drive = parameters.get("contact", {}), parameters.get("drive", {})
    box, kind = parameters.get("box", {}), drive.get("kind", "none")
    surfaces = surfaces_of(parameters)
    motions = {one.get("motion", "still") for one in surfaces}
    beta = float(contact.get("tangential_restitution", -1.0))
    pairs = np.unique(contact.get("pair_restitution", contact.get("restitution", 1.0)))
    # If disk-disk collisions dissipate energy, a run is "inelastic" from the start. If only
    # collisions with walls dissipate energy, it is "inelastic" after the first loss of energy.
    slips = beta > -1 and (beta < 1 or contact.get("friction") is not None)
    inelastic = len(mass) > 1 and (pairs.min() < 1 or slips)
    found = {
        "changed": bool(parameters.get("changes")),
        "collapsed": collapsed,
        "time_stepped": parameters.get("run", {}).get("dynamics") == "steps",
        "sheared": box.get("shear_rate", 0.0) != 0,
        "noise_driven": kind == "noise",
        "random_walk": kind == "noise"
        and not drive.get("keep_momentum", False)
        and drifts(parameters),
        "active": kind == "active",
        "recycled": kind == "recycle",
        "open": opens(parameters),
        "moving_sides": bool(motions - {"still", "piston"}),
        "piston": "piston" in motions,
        "sliding_surfaces": any(one.get("surface_velocity", 0.0) != 0 for one in surfaces),
        "unequal_temperatures": len(set(bath_temperatures(parameters))) > 1,
        "thermostatted": kind in THERMOSTATS,
        "thermal_walls": any(known(one.get("temperature")) for one in surfaces),
        "gravity": bool(np.any(box.get("gravity", 0.0))),
        "inelastic": inelastic or lost > ROUNDING,
        "soft_contacts": contact.get("restitution_law", "constant") != "constant"
        and (inelastic or lost > ROUNDING),
        "rough": beta > -1,
        "rotating": turning,
        "obstacles": "obstacle" in parameters or "wall" in parameters,
        "pair_restitution": len(pairs) > 1,
        "walls": any(kind == "wall" for kind in box.get("boundary", ())),
        "mixture": bool(np.ptp(mass) > 0 or np.ptp(radius) > 0),
    }
    torques = (
        "thermal_walls",
        "gravity",
        "noise_driven",
        "active",
        "recycled",
        "thermostatted",
        "inelastic",
        "rough",
    )
    found["round_container"] = held_round(parameters) and not any(found[name] for name in torques)
    return Nature(name for name, there in found.items() if there)


def opens(parameters: Mapping[str, Any]) -> bool:
    """Return whether disks can leave or enter the box, now or before a change during the run."""
    species = parameters.get("species", {})
    waiting = any(one.get("waiting", 0) for one in species.values() if isinstance(one, Mapping))
    open_sides = any(one.get("open") for one in parameters.get("side", {}).values())
    return bool(
        "source" in parameters or waiting or open_sides or ".open=" in changes_in(parameters)
    )


def changes_in(parameters: Mapping[str, Any]) -> str:
    """Return the text that lists the changes during a run."""
    return str(parameters.get("changes", "")).replace(" ", "")


def surfaces_of(parameters: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the input variables of each side, obstacle and wall."""
    return [
        *parameters.get("side", {}).values(),
        *rows_of(parameters.get("obstacle", {})),
        *rows_of(parameters.get("wall", {})),
    ]


def bath_temperatures(parameters: Mapping[str, Any]) -> list[float]:
    """Return kT of each heat bath (thermal boundary or thermostat)."""
    drive, surfaces = parameters.get("drive", {}), surfaces_of(parameters)
    baths = [float(drive["temperature"])] if drive.get("kind") in THERMOSTATS else []
    return baths + [float(one["temperature"]) for one in surfaces if known(one.get("temperature"))]


def drifts(parameters: Mapping[str, Any]) -> bool:
    """Return whether no external force acts on the centre of mass along at least one axis."""
    if "obstacle" in parameters or "wall" in parameters:
        return False
    box = parameters.get("box", {})
    periodic = np.array(box.get("boundary", ("wall", "wall"))) == "periodic"
    return bool(np.any(periodic & (np.array(box.get("gravity", (0.0, 0.0))) == 0)))


def held_round(parameters: Mapping[str, Any]) -> bool:
    """Return whether all disks are enclosed by a round container inside the sides of the box."""
    box, rows = parameters.get("box", {}), rows_of(parameters.get("obstacle", {}))
    if len(rows) != 1 or not rows[0].get("inside") or "wall" in parameters:
        return False
    centre = np.asarray(rows[0]["centre"])
    gap = np.minimum(centre - box.get("lower", 0.0), box.get("upper", 1.0) - centre)
    return bool(gap.min() >= rows[0]["radius"] * (1 - ROUNDING))


def rows_of(group: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Convert a dictionary of columns, such as a group of obstacles, to a list of rows."""
    columns = {name: column for name, column in group.items() if np.ndim(column) > 0}
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def known(value: Any) -> bool:
    """Return whether `value` is given; a value that is not given is None, NaN or 0."""
    return value is not None and bool(np.isfinite(value)) and float(value) > 0


def stays_in_box(run: Any) -> None:
    """Raise Refused if disks leave or enter the box during the run."""
    allow(run, "the script needs disks that stay in the box", *TRAITS.keys() - {"open"})


def allow(run: Any, law: str, *traits: str) -> None:
    """Raise Refused for any trait not in `traits`; the error message ends with `law`."""
    for trait, reason in TRAITS.items():
        if trait in run.nature and trait not in traits:
            raise Refused(f"{getattr(run, 'path', 'the simulation')}: {reason}; {law}")
