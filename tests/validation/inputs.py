"""Input files as text."""

from collections.abc import Iterable

from ricochet import program

from .case import Member

EVERY_EVENT = {"frames_every_events": 1, "observables_every_events": 1, "event_log": True}
PERIODIC = {"boundary": ("periodic", "periodic")}
ROOT_2 = 1.4142135623730951  #: speed at which K = m, so that kT = 1 for m = 1


def namelist(**groups: dict | list[dict]) -> str:
    """Return groups of variables as text; a list of dictionaries stands for a repeated group."""
    return program.namelist(groups)


def ensemble(seeds: int | Iterable[int], *, run: dict = {}, **groups) -> tuple[Member, ...]:  # noqa: B006
    """Return runs of one input with the given seeds, where n stands for 1 to n."""
    seeds = range(1, seeds + 1) if isinstance(seeds, int) else seeds
    return tuple(Member(namelist(run={"seed": seed} | run, **groups)) for seed in seeds)


def gases(seeds: int | Iterable[int], count: int, *, periodic=False, **more) -> tuple[Member, ...]:
    """Return runs of `count` equal disks with speeds sqrt 2, so that kT = 1 between walls.

    An argument in `more` that names a group, such as stop or contact, defines this group; all other
    arguments are variables of the species.
    """
    groups = {"box": PERIODIC if periodic else {}}
    groups |= {key: value for key, value in more.items() if isinstance(value, dict)}
    own = {key: value for key, value in more.items() if key not in groups}
    speed = {} if "temperature" in own else {"speed": ROOT_2}
    species = {"name": "gas", "count": count} | speed | own
    return ensemble(seeds, species=species, **groups)


def light_and_heavy(seeds: int | Iterable[int], radius: float, **groups) -> tuple[Member, ...]:
    """Return gases of equal sizes and speeds; half of the disks have four times the mass."""
    disks = {"count": 500, "radius": radius, "speed": 1.0}
    species = [{"name": "light", **disks}, {"name": "heavy", "mass": 4.0, **disks}]
    return ensemble(seeds, species=species, **groups)


def disk(position: tuple, velocity: tuple, radius: float, mass: float = 1.0) -> dict:
    """Return a species of one disk, or of several disks with successive coordinates."""
    return {"position": position, "velocity": velocity, "radius": radius, "mass": mass}
