"""Inputs of the systems in the coverage tables."""

from functools import partial

import numpy as np

PERIODIC = "boundary = 'periodic', 'periodic'"
SIDES = ("left", "right", "bottom", "top")
THERMAL = " ".join(f"&side name = '{side}' temperature = 1 /" for side in SIDES)
INELASTIC = "&contact restitution = 0.9 /"
FALLING = " ".join(
    f"&species name = '{name}' count = 150 mass = {mass} radius = 0.005 region = 0, 1, 0, 1 "
    "velocities = 'uniform' speed = 1 /" for name, mass in (("a", 1), ("b", 4))
)  # fmt: skip
STEPPED = "&species name = 'a' count = 40 radius = 0.01 speed = 1.4 / &stop time = 60 / "
STEPPED += "&output observables_every_time = 0.5 /"
MOUTHS = (0.25, 0.3, 0.36, 0.42)
DRUM = """&box lower = -1.05, -1.05 upper = 1.05, 1.05 /
&obstacle centre = 0, 0 radius = 1 side = 'inside' temperature = 1 surface_velocity = 1.5 /
&species name = 'a' count = 40 radius = 0.05 temperature = 1 /
&stop time = 150 / &output frames_every_time = 0.25 observables_every_time = 0.25 /"""


def gas(count: int, eta: float = 0.1, mass: float = 1, name: str = "a") -> str:
    """Return a species with equal initial speeds, so that kT is the same for all seeds."""
    head = f"&species name = '{name}' count = {count} packing_fraction = {eta} mass = {mass}"
    return f"{head} speed = {np.sqrt(2 / mass)} /"


def text(
    box: str, groups: str, length: float, frames: float, unit: str = "time", more: str = ""
) -> str:
    """Return an input, where `frames` is the time or the collisions per disk between frames."""
    stop, each = ("time", "time") if unit == "time" else (unit, unit)
    samples = f"&output frames_every_{each} = {frames} observables_every_{each} = {frames}"
    samples += f" {more} /"
    return f"&box {box} / {groups} &stop {stop} = {length} / {samples}"


by_collisions = partial(text, unit="collisions_per_disk")


def billiard(shift: float, seed: int) -> str:
    """Return the input of a Sinai billiard, with a disk at a random initial position."""
    x, y, angle = np.random.default_rng(seed).uniform((0.02, 0.02, 0), (0.22, 0.98, 2 * np.pi))
    place, v = f"{x + shift:.17g}, {y:.17g}", f"{np.cos(angle):.17g}, {np.sin(angle):.17g}"
    disk = f"&species name = 'a' radius = 0.01 position = {place} velocity = {v} /"
    groups = f"&obstacle centre = 0.5, 0.5 radius = 0.25 / {disk}"
    return text("", groups, 100, 0.1).replace("&stop", "&stop events = 1000000")


def crater(mass: float) -> str:
    """Return the input of a projectile of given mass that hits a bed of 500 disks."""
    bed = "&species name = 'bed' count = 500 packing_fraction = 0.5 region = 0, 1, 0, 0.5 /"
    hit = f"name = 'projectile' relative_to = 'bed' mass = {mass} radius = 2 position = 0.5, 0.75"
    contact = "&contact restitution = 0.5 contact_time = 1e-5 / &stop energy_fraction = 0.1 /"
    samples = "&output observables_every_time = 0.01 /"
    return f"{bed} &species {hit} velocity = 0, -5 / {contact} {samples}"


def hopper(width: float, grains: str) -> str:
    """Return the input of a refilled hopper of 120 grains with a mouth of given width."""
    half, box = width / 2, "&box upper = 1, 2 gravity = 0, -1 /"
    walls = "".join(
        f"&wall name = '{name}' from = {end}, 0.6 to = {0.5 + sign * half}, {0.1 + half} /"
        for name, end, sign in (("left", 0, -1), ("right", 1, 1))
    )
    drive = "&drive kind = 'recycle' interval = 0.02 from_region = 0, 1, 0, "
    drive += f"{0.05 + half} to_region = 0, 1, 1.6, 2 velocity = 0, -0.5 /"
    contact = "&contact restitution = 0.7 tangential_restitution = 1 wall_rule = 'normal' "
    contact += "contact_time = 1e-3 / &stop time = 12 / &output observables_every_time = 0.1 /"
    return f"{box} {walls} {grains} {drive} {contact}"


def grains(count: int, radius: float, name: str = "a", spread: float = 0.0) -> str:
    """Return a species of grains above the mouth of a hopper."""
    head = f"&species name = '{name}' count = {count} radius = {radius} region = 0, 1, 0.6, 2"
    return f"{head} polydispersity = {spread} /" if spread else f"{head} /"
