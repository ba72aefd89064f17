"""Write small HDF5 files in the layout of a Ricochet run, for tests of the post-processing."""

import csv
import importlib
import os
import re
import sys
import warnings
from pathlib import Path
from unittest import mock

import h5py
import matplotlib
import numpy as np

from ricochet import read_run
from ricochet import script
from ricochet.figures.drawing import plt, save
from ricochet.script import launch

ROOT = Path(__file__).resolve().parents[1]
#: Scripts that read runs (the laboratory makes runs instead).
SCRIPTS = sorted(
    path.stem
    for path in (ROOT / "post").glob("*.py")
    if re.search(r"(command_line|run_analysis)\(", path.read_text())
)


def text(value: str) -> np.bytes_:
    """Return a fixed-length string in the format of the program."""
    return np.bytes_(value.encode())


def write_run(
    path,
    position,
    velocity,
    *,
    time=None,
    mass=1.0,
    radius=0.01,
    species=None,
    names=("disk",),
    lower=(0.0, 0.0),
    edges=(1.0, 1.0),
    periodic=(False, False),
    image=None,
    collisions=None,
    observables=None,
    observable_time=None,
    parameters=None,
    obstacles=(),
    walls=(),
    provenance=None,
    committed=None,
):
    """Write a run with `position` and `velocity` (T, N, 2), and `observables` by name (T', ...)."""
    position, velocity = np.asarray(position, float), np.asarray(velocity, float)
    frames, count = position.shape[:2]
    time = np.arange(frames, dtype=float) if time is None else np.asarray(time, float)
    with h5py.File(path, "w") as file:
        file.create_group("h5md").attrs["version"] = np.array([1, 1], dtype=np.int32)
        creator = file.create_group("h5md/creator")
        creator.attrs["name"] = text("ricochet")
        disks = file.create_group("particles/disks")
        box = disks.create_group("box")
        box.attrs["dimension"] = 2
        box.attrs["boundary"] = [text("periodic" if p else "none") for p in periodic]
        box["edges"], box["lower"] = np.asarray(edges, float), np.asarray(lower, float)
        add_element(disks, "position", time, position)
        shared = disks["position"]
        if image is None and any(periodic):
            image = np.zeros(position.shape, np.int32)
        for name, values in (("velocity", velocity), ("image", image), ("event_count", collisions)):
            if values is not None:
                group = disks.create_group(name)
                group["step"], group["time"] = shared["step"], shared["time"]
                group["value"] = np.asarray(values)
        disks["mass"] = np.broadcast_to(np.asarray(mass, float), count)
        disks["radius"] = np.broadcast_to(np.asarray(radius, float), count)
        species = np.ones(count, np.int32) if species is None else np.asarray(species, np.int32)
        disks["species"], disks["id"] = species, np.arange(1, count + 1)
        disks["committed"] = np.int64(frames if committed is None else committed)
        clock = time if observable_time is None else observable_time
        energy = np.interp(clock, time, (mass * (velocity**2).sum(axis=2) / 2).mean(axis=1))
        write_observables(file, clock, {"all/kinetic_energy": energy, **(observables or {})})
        write_parameters(file, parameters, names, species, obstacles, walls)
        sides = [text("periodic" if p else "wall") for p in periodic]
        file.require_group("parameters/box").attrs["boundary"] = sides
        file.create_group("provenance").attrs.update(provenance or {"git_commit": text("abc1234")})
    return Path(path)


def written(path, position, velocity, **options):
    """Write a run and read it."""
    return read_run(write_run(path, position, velocity, **options))


def add_element(group, name, time, value):
    """Add an H5MD element with step, time and value."""
    element = group.create_group(name)
    element["step"], element["time"] = np.arange(len(time)), np.asarray(time, float)
    element["value"] = value


def write_observables(file, time, observables):
    """Write observables that share their sampling times."""
    group = file.create_group("observables")
    for name, value in {"dissipated_energy": np.zeros(len(time)), **observables}.items():
        add_element(group, name, time, np.asarray(value))
    group["committed"] = np.int64(len(time))


def write_parameters(file, parameters, names, species, obstacles, walls):
    """Write `parameters`, by group and variable; each species is a group species/NAME."""
    root = file.create_group("parameters")
    root["input"] = text("&run\n/\n")
    for group, variables in (parameters or {}).items():
        for name, value in variables.items():
            root.require_group(group).attrs[name] = text(value) if isinstance(value, str) else value
    root.require_group("species")["names"] = [text(name) for name in names]
    root["species"]["counts"] = [int(np.sum(species == k + 1)) for k in range(len(names))]
    if obstacles:
        centre, radius, inside = zip(*obstacles, strict=True)
        where = root.create_group("obstacle")
        where["name"] = [text(f"obstacle {k + 1}") for k in range(len(obstacles))]
        where["centre"], where["radius"] = np.array(centre), np.array(radius)
        where["inside"] = np.array(inside, dtype=np.int32)
    if walls:
        where = root.create_group("wall")
        where["name"] = [text(f"wall {k + 1}") for k in range(len(walls))]
        where["from"], where["to"] = np.moveaxis(np.array(walls, float), 1, 0)


def maxwell_velocities(rng, frames, count, temperature=1.0, mass=1.0):
    """Return velocities (frames, count, 2) of an ideal gas."""
    return rng.normal(0.0, np.sqrt(temperature / np.mean(mass)), (frames, count, 2))


def save_at_once(figure, *more):
    """Save a figure without a layout, which takes a quarter of the time of a script.

    With THOROUGH, and in tests that draw figures themselves, figures have their layout.
    """
    if not os.environ.get("THOROUGH"):
        figure.set_layout_engine("none")
    save(figure, *more)


def run_script(name, *arguments):
    """Run post/NAME.py in this process, as from the command line; return the exit code.

    Warnings are errors.
    """
    module, words = importlib.import_module(name), [f"{name}.py", *map(str, arguments)]
    saving = save_at_once if script.save is save else script.save  # a test may collect figures
    quick = mock.patch.object(script, "save", saving)
    with quick, mock.patch.object(sys, "argv", words), warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            launch(module.main)
        except SystemExit as end:
            return end.code or 0
    return 0


def run_code(code):
    """Execute the Python code of a page in this process; warnings for users are errors."""
    matplotlib.use("Agg")
    with warnings.catch_warnings(), plt.style.context("default"):
        warnings.simplefilter("error", UserWarning)
        exec(code, {"__name__": "__main__"})
    plt.close("all")


def refusal(capsys, script, *arguments, code=2):
    """Return the message of a script that refuses its arguments (exit code 1 if a law fails)."""
    assert run_script(script, *arguments) == code
    said = capsys.readouterr().err
    assert said.startswith(f"{script}.py: ") and said.count("\n") == 1
    return said


def drawn(folder, script, *arguments):
    """Run a script that draws a figure and writes its table; return the rows of the table."""
    figure, table = folder / f"{script}.png", folder / f"{script}.csv"
    assert run_script(script, *arguments, "-o", figure, "--csv", table) == 0
    assert figure.stat().st_size > 10000
    with table.open() as file:
        return list(csv.DictReader(file))


def still_run(path, position, **more):
    """Write a run with disks at rest at the given positions in each frame."""
    observables = {"collisions": np.zeros(len(position))}
    return write_run(path, position, np.zeros_like(position), observables=observables, **more)
