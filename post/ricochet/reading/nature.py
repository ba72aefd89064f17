"""The physical properties of a run, called traits, and the theories that apply to a run.

    run.nature                      # Nature({'inelastic', 'walls', ...}), the differences from
                                    # equal smooth elastic disks in an empty periodic box
    run.nature.closed               # whether only collisions change the energy
    allow(run, "Haff's law", "inelastic", "mixture")   # an error for any other trait

A pure function determines the traits from the parameters and the energy balance of a run.  The same
function is used for finished and unfinished output files and for simulations in memory.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from .files import RunError

ROUNDING = 1e-6  # fraction of the energy below which losses are rounding errors
#: The traits of a run, and for each trait the words of a message.
TRAITS = {
    "changed": "was changed during the run",
    "collapsed": "passed an inelastic collapse, after which rounding errors determine its state",
    "time_stepped": "is time-stepped",
    "sheared": "is sheared (box.shear_rate)",
    "noise_driven": "is heated by noise (&drive)",
    "random_walk": "has a centre of mass that noise moves (drive.keep_momentum)",
    "active": "has active disks (&drive)",
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
#: Traits of runs whose energy changes by processes other than dissipation in collisions.
SOURCES = {
    "changed",
    "sheared",
    "noise_driven",
    "active",
    "moving_sides",
    "piston",
    "sliding_surfaces",
}
SOURCES |= {"thermostatted", "thermal_walls"}
#: Traits with velocity changes between collisions.
KICKED = {"noise_driven", "active", "thermostatted"}
#: Traits of runs whose velocities do not relax to Maxwell's distribution.
UNSETTLED = {*SOURCES, "unequal_temperatures", "inelastic", "soft_contacts", "round_container"} - {
    "thermostatted",
    "thermal_walls",
    "piston",
}
#: Traits of runs whose velocities relax to Maxwell's distribution.
SETTLED = TRAITS.keys() - UNSETTLED


class Refused(RunError):
    """Error for a run to which a theory does not apply; the message contains the reason."""


class Nature(frozenset[str]):
    """The traits of a run: a set of keys of `TRAITS`."""

    @property
    def closed(self) -> bool:
        """Whether the energy changes by dissipation in collisions only."""
        return not self & SOURCES

    @property
    def driven(self) -> bool:
        """Whether something other than collisions changes the energy of the disks."""
        return not self.closed

    @property
    def cooling(self) -> bool:
        """Whether the disks only lose energy, so that there is no steady state."""
        return self.closed and "inelastic" in self

    @property
    def keeps_energy(self) -> bool:
        """Whether the total energy is conserved."""
        return self.closed and "inelastic" not in self

    @property
    def keeps_kinetic_energy(self) -> bool:
        """Whether the translational kinetic energy, and so kT, is conserved on average."""
        return self.keeps_energy and not self & {"gravity", "rough", "rotating"}

    @property
    def in_equilibrium(self) -> bool:
        """Whether velocities relax to Maxwell's distribution of a uniform temperature."""
        return not self & UNSETTLED


def nature_of(
    parameters: Mapping[str, Any],
    mass: np.ndarray,
    radius: np.ndarray,
    lost: float,
    turning: bool,
    collapsed: bool,
) -> Nature:
    """Return the nature of a run from its parameters and from the balance of its energy.

    `lost` is the dissipated energy over the largest kinetic energy so far.  `rotating` means that
    disks rotate, `collapsed` that an inelastic collapse occurred.
    """
    contact, drive = parameters.get("contact", {}), parameters.get("drive", {})
    box, kind = parameters.get("box", {}), drive.get("kind", "none")
    surfaces = [
        *parameters.get("side", {}).values(),
        *rows_of(parameters.get("obstacle", {})),
        *rows_of(parameters.get("wall", {})),
    ]
    motions = {one.get("motion", "still") for one in surfaces}
    baths = {float(one["temperature"]) for one in surfaces if known(one.get("temperature"))}
    thermal = bool(baths)
    if kind in ("andersen", "brownian"):
        baths.add(float(drive["temperature"]))
    beta = float(contact.get("tangential_restitution", -1.0))
    pairs = np.unique(contact.get("pair_restitution", contact.get("restitution", 1.0)))
    # A dissipative collision rule of disks is a trait from the start, that of a wall only after a
    # loss.
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
        "moving_sides": bool(motions - {"still", "piston"}),
        "piston": "piston" in motions,
        "sliding_surfaces": any(one.get("surface_velocity", 0.0) != 0 for one in surfaces),
        "unequal_temperatures": len(baths) > 1,
        "thermostatted": kind in ("andersen", "brownian"),
        "thermal_walls": thermal,
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
        "thermostatted",
        "inelastic",
        "rough",
    )
    found["round_container"] = held_round(parameters) and not any(found[name] for name in torques)
    return Nature(name for name, there in found.items() if there)


def drifts(parameters: Mapping[str, Any]) -> bool:
    """Return whether no force acts on the centre of mass along at least one axis."""
    if "obstacle" in parameters or "wall" in parameters:
        return False
    box = parameters.get("box", {})
    periodic = np.array(box.get("boundary", ("wall", "wall"))) == "periodic"
    return bool(np.any(periodic & (np.array(box.get("gravity", (0.0, 0.0))) == 0)))


def held_round(parameters: Mapping[str, Any]) -> bool:
    """Return whether a round container that does not touch the sides encloses all disks."""
    box, rows = parameters.get("box", {}), rows_of(parameters.get("obstacle", {}))
    if len(rows) != 1 or not rows[0].get("inside") or "wall" in parameters:
        return False
    centre = np.asarray(rows[0]["centre"])
    gap = np.minimum(centre - box.get("lower", 0.0), box.get("upper", 1.0) - centre)
    return bool(gap.min() >= rows[0]["radius"] * (1 - ROUNDING))


def rows_of(group: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return a dictionary for each obstacle or wall from the columns of variables in the file."""
    columns = {name: column for name, column in group.items() if np.ndim(column) > 0}
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def known(value: Any) -> bool:
    """Return whether a variable of an obstacle or wall was given; if not, the file has NaN or 0."""
    return value is not None and bool(np.isfinite(value)) and float(value) > 0


def allow(run: Any, law: str, *traits: str) -> None:
    """Raise an error for a run with any trait except these; `law` is a part of the message."""
    for trait, reason in TRAITS.items():
        if trait in run.nature and trait not in traits:
            raise Refused(f"{getattr(run, 'path', 'the simulation')}: {reason}; {law}")
