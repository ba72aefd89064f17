"""Input files as text."""

from collections.abc import Iterable

EVERY_EVENT = {"frames_every_events": 1, "observables_every_events": 1, "event_log": True}
PERIODIC = {"boundary": ("periodic", "periodic")}
ROOT_2 = 1.4142135623730951  #: speed at which K = m, so kT = 1


def namelist(**groups: dict | list[dict]) -> str:
    """Groups of variables; a list of dictionaries is a group that is repeated."""
    lines = []
    for name, contents in groups.items():
        for content in contents if isinstance(contents, list) else [contents]:
            assignments = [f"  {key} = {written(value)}" for key, value in content.items()]
            lines += [f"&{name}", *assignments, "/"]
    return "\n".join(lines) + "\n"


def written(value: object) -> str:
    """A value as a namelist wants it, with all its digits."""
    if isinstance(value, str):
        return f"'{value}'"
    if isinstance(value, bool):
        return ".true." if value else ".false."
    if isinstance(value, Iterable):
        return ", ".join(map(written, value))
    return repr(int(value)) if isinstance(value, int) else repr(float(value))


def gas(count: int, *, seed: int = 1, stop: dict, output: dict | None = None, **more) -> str:
    """`count` equal disks, speeds sqrt 2, so kT = 1 between walls.

    `more` goes to the group of that name, such as box or contact, or else to the species.
    """
    species = {"name": "gas", "count": count, "speed": ROOT_2}
    groups = {"run": {"seed": seed}, "box": {}, "species": species, "contact": {}}
    if more.pop("periodic", False):
        groups["box"].update(PERIODIC)
    for key, value in more.items():
        if isinstance(value, dict):
            groups.setdefault(key, {}).update(value)
        else:
            species[key] = value
    if "temperature" in species:
        del species["speed"]
    return namelist(**groups, stop=stop, output=output or {})


def disk(position: tuple, velocity: tuple, radius: float, mass: float = 1.0) -> dict:
    """A species of one disk, or of several: coordinates one after the other."""
    return {"position": position, "velocity": velocity, "radius": radius, "mass": mass}
