"""The traits of a run, and which theories apply to it.

    run.nature                      # Nature({'inelastic', 'walls', ...}), the differences from
                                    # equal smooth elastic disks in an empty periodic box
    run.nature.closed               # whether only collisions change the energy
    allow(run, "Haff's law", "inelastic", "mixture")   # refuses a run with any other trait

The traits follow from the parameters of a run and from its balance of energy, by a pure function:
a file, a file that is still being written and a simulation in memory are treated alike.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from .files import RunError

ROUNDING = 1e-6  # share of the energy: smaller losses are rounding
#: Traits of a run, and the words in which each is given as a reason.
TRAITS = {
    "changed": "was changed while it ran",
    "collapsed": "passed a collapse, and is decided by rounding from then on",
    "time_stepped": "is made by time steps",
    "sheared": "is sheared (box.shear_rate)",
    "noise_driven": "is heated by noise (&drive)",
    "random_walk": "has a centre of mass that noise moves (drive.keep_momentum)",
    "active": "has disks that drive themselves (&drive)",
    "moving_sides": "has sides that move",
    "piston": "has sides that disks push",
    "sliding_surfaces": "has surfaces that slide",
    "unequal_temperatures": "is heated and cooled at different temperatures",
    "thermostatted": "is kicked by a heat bath (&drive)",
    "thermal_walls": "has walls that heat and cool (temperature)",
    "gravity": "falls (box.gravity)",
    "inelastic": "is not elastic: it loses energy in collisions",
    "soft_contacts": "has a restitution that depends on the speed (contact.restitution_law)",
    "rough": "has rough disks, whose collisions turn them",
    "rotating": "has disks that turn",
    "round_container": "keeps its angular momentum in a round container",
    "obstacles": "has obstacles or walls in the box",
    "pair_restitution": "has a restitution for each pair of species",
    "walls": "has walls",
    "mixture": "has disks of different mass or radius",
}
#: Traits that change the energy in other ways than by dissipation in collisions.
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
#: Traits of runs whose velocities do relax to it.
SETTLED = TRAITS.keys() - UNSETTLED


class Refused(RunError):
    """Error for a run to which a theory does not apply; the message names the reason."""


class Nature(frozenset[str]):
    """The traits of a run: a set of the words in `TRAITS`."""

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
    # A dissipative law of disks is a trait from the start; one of walls only after it has acted.
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
    """Whether along some axis nothing in the box acts on the centre of mass."""
    if "obstacle" in parameters or "wall" in parameters:
        return False
    box = parameters.get("box", {})
    periodic = np.array(box.get("boundary", ("wall", "wall"))) == "periodic"
    return bool(np.any(periodic & (np.array(box.get("gravity", (0.0, 0.0))) == 0)))


def held_round(parameters: Mapping[str, Any]) -> bool:
    """Whether a single round container, which does not reach the sides, encloses the disks."""
    box, rows = parameters.get("box", {}), rows_of(parameters.get("obstacle", {}))
    if len(rows) != 1 or not rows[0].get("inside") or "wall" in parameters:
        return False
    centre = np.asarray(rows[0]["centre"])
    gap = np.minimum(centre - box.get("lower", 0.0), box.get("upper", 1.0) - centre)
    return bool(gap.min() >= rows[0]["radius"] * (1 - ROUNDING))


def rows_of(group: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return one dictionary for each obstacle or wall; the file has a column for each variable."""
    columns = {name: column for name, column in group.items() if np.ndim(column) > 0}
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def known(value: Any) -> bool:
    """Whether a variable of an obstacle or wall was given; otherwise it is NaN or 0 in the file."""
    return value is not None and bool(np.isfinite(value)) and float(value) > 0


def allow(run: Any, law: str, *traits: str) -> None:
    """Refuse a run that has any trait but these; `law` completes the message."""
    for trait, reason in TRAITS.items():
        if trait in run.nature and trait not in traits:
            raise Refused(f"{getattr(run, 'path', 'the simulation')}: {reason}; {law}")
