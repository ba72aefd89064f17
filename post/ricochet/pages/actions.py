"""Actions of the user on a simulation, in words and as a script that repeats them."""

import numpy as np

from ..running.simulation import Simulation

#: Actions of the user on a disk, in words.
DONE_TO_DISK = {"position": "is moved", "velocity": "gets energy", "aim": "gets a new velocity"}


def words(what: str, value: object) -> str:
    """Describe an action of the user other than setting an input variable."""
    if what == "heat":
        return f"all speeds times {value:g}"
    if what == "hold":
        return f"the {next(iter(value)).split('.')[1]} side is dragged"
    if what == "open_side":
        ((name, opens),) = value.items()
        return f"the {name.split('.')[1]} side is {'opened' if opens == '.true.' else 'closed'}"
    if what == "insert":
        return f"up to {next(iter(value[0].values()))} disks are let in"
    return f"disk {value[0] + 1} {DONE_TO_DISK[what]}"


def typical_speed(simulation: Simulation) -> float:
    """Return the rms speed of the disks in the box, or 1 if none of them moves."""
    squares = np.sum(simulation.velocity**2, axis=1)
    squares = squares[np.isfinite(squares)]
    return float(np.sqrt(np.sum(squares) / max(len(squares), 1))) or 1.0


def set_row(simulation: Simulation, name: str, disk: int, value: list[float]) -> None:
    """Set the position or the velocity of one disk of a simulation."""
    values = np.array(getattr(simulation, name))
    values[disk] = value
    setattr(simulation, name, values)


def scale_velocities(simulation: Simulation, factor: float) -> None:
    """Multiply the velocities of all disks of a simulation by a factor."""
    simulation.velocity = factor * simulation.velocity


def let_in(simulation: Simulation, burst: dict, then: float, usual: dict) -> None:
    """Let disks enter until the time `then`, and then restore the usual values of the source."""
    simulation.change(burst).advance(time=then).change(usual)


def script(name: str, text: str, actions: list[tuple], end: float) -> str:
    """Return a Python script that repeats the run, with all its changes, up to the time `end`."""
    lines = [f'"""The run of {name} in the laboratory with all its changes, bit for bit."""', ""]
    quoted = repr(text) if "\\" in text or '"""' in text else f'"""{text}"""'
    lines += ["from ricochet import Simulation", "", f"INPUT = {quoted}", ""]
    lines += ["with Simulation(INPUT) as simulation:"]
    for when, what, _, value in actions:
        lines.append(f"    simulation.advance(time={when!r})")
        if what == "heat":
            lines.append(f"    simulation.velocity = {value!r} * simulation.velocity")
        elif what in DONE_TO_DISK:
            name = "position" if what == "position" else "velocity"
            lines.append(f"    values = simulation.{name}.copy()")
            lines.append(f"    values[{value[0]}] = {value[1]!r}")
            lines.append(f"    simulation.{name} = values")
        elif what == "insert":
            burst, then, usual = value
            call = f".change({burst!r}).advance(time={then!r}).change({usual!r})"
            lines.append(f"    simulation{call}")
        else:
            lines.append(f"    simulation.change({value!r})")
    lines.append(f"    simulation.advance(time={end!r})")
    lines.append("    print(simulation.time, simulation.position, sep=chr(10))")
    return "\n".join(lines) + "\n"


__all__ = [
    "DONE_TO_DISK",
    "let_in",
    "scale_velocities",
    "script",
    "set_row",
    "typical_speed",
    "words",
]
