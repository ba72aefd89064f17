"""Functions of the library as a caller in C uses them, and the header file."""

import ctypes
import random
import re
import textwrap
from pathlib import Path

import numpy as np
import pytest

from library_systems import GAS
from ricochet import Simulation
from ricochet.running.engine import library
from whole_runs import ran


def test_numbers_that_c_may_give_are_refused_or_count_as_none():
    """The header describes these numbers, which the Python package never passes."""
    engine, gas, room = library(), Simulation(GAS), 200
    message = ctypes.create_string_buffer(room)
    with gas._open() as handle:
        for bad in (np.nan, np.inf, -np.inf):
            velocity = gas.velocity.copy()
            velocity[7, 1] = bad
            code = engine.ricochet_set_velocities(handle, velocity.ctypes.data, message, room)
            assert code == 2 and b"velocity" in message.value
        assert engine.ricochet_advance(handle, np.nan, 9, 9, 1.0, message, room) == 2
        assert b"time" in message.value
        for room in (0, -5):
            message.raw = b"#" * 200
            assert engine.ricochet_advance(handle, np.nan, 9, 9, 1.0, message, room) == 2
            assert message.raw == b"#" * 200
        assert engine.ricochet_next_events(handle, -3, None) == 0
    engine.ricochet_close(None)
    assert gas.advance(events=9).events == 9 and np.isfinite(gas.velocity).all()


#: Arguments, valid or invalid, that a caller in C may pass.
NUMBERS = np.nan, np.inf, -np.inf, -1.0, 0.0, 0.1, 0.3, 1e-300, 1e100, 1e308
COUNTS = -(2**31), -5, -1, 0, 1, 5, 60, 500
SETTINGS = (
    *("", "=", "gravity", "box.gravity", "box.gravity=", "box.gravity=nan,1", "\n\n", "&box /"),
    *("box.gravity=0,-1", "contact.restitution=2", "contact.restitution=0.5", "x" * 300),
    *("species.a.count=3", "stop.time=1", "side.top.temperature=1", "drive.kind=noise"),
)
NAMES = "position", "image", "mass", "", "x", "input", "parameters", "changes", "note"


@pytest.mark.parametrize("seed", range(4))
def test_random_calls_in_c_have_an_answer(seed):
    """Whatever numbers and texts are passed, no call crashes, hangs or accepts invalid numbers."""
    engine, chance = library(), random.Random(seed)
    text, values = ctypes.create_string_buffer(20_000), np.empty((600, 6))
    message = ctypes.create_string_buffer(500)
    for _ in range(15):
        gas = Simulation(GAS, {"run.seed": chance.randrange(99)}, threads=chance.choice([1, 2]))
        for _ in range(10):
            say = message, min(chance.choice(COUNTS), 500)
            time, count = chance.choice(NUMBERS), chance.choice(COUNTS)
            if chance.random() < 0.5:
                velocity = gas.velocity.copy()
                velocity[chance.randrange(80), chance.randrange(2)] = chance.choice(NUMBERS)
            else:
                velocity = 2 * gas.velocity
            with gas._open() as handle:
                codes = [
                    engine.ricochet_advance(handle, time, count, count, 0.01, *say),
                    engine.ricochet_set_velocities(handle, velocity.ctypes.data, *say),
                    engine.ricochet_change(handle, chance.choice(SETTINGS).encode(), *say),
                ]
                assert set(codes) <= {0, 1, 2, 4}
                most = engine.ricochet_next_events(handle, count, values.ctypes.data)
                assert 0 <= most <= max(count, 0)
                name = chance.choice(NAMES).encode()
                assert 0 <= engine.ricochet_column(handle, name, values.ctypes.data) <= 2
                for ask, *rest in (
                    (engine.ricochet_text, name, text, count),
                    (engine.ricochet_observables, text, count, values.ctypes.data),
                ):
                    assert ask(handle, *rest) >= 0
            assert np.isfinite([gas.time, *gas.position.flat, *gas.velocity.flat]).all()


def test_the_library_needs_no_hdf5_and_shows_its_functions_only():
    """The library exports only the functions of the header."""
    path = library()._name
    assert "hdf5" not in ran("ldd", path, check=True).stdout
    listed = ran("nm", "-D", "--defined-only", path, check=True).stdout.split()[2::3]
    header = (Path(__file__).resolve().parents[2] / "src/ricochet.h").read_text().split("/* ---")[0]
    assert sorted(listed) == sorted({*re.findall(r"\b(ricochet_\w+)\(", header)})


def test_the_example_in_the_header_is_a_complete_program(tmp_path):
    """The example compiles without warnings, and stops at the requested number of collisions."""
    header = Path(__file__).resolve().parents[2] / "src/ricochet.h"
    folder = Path(library()._name).parent
    example = re.search(r"^ {7}#include .*?^ {7}\}$", header.read_text(), re.MULTILINE | re.DOTALL)
    source = tmp_path / "gas.c"
    source.write_text(textwrap.dedent(example[0]) + "\n")
    strict = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{header.parent}"]
    link = [f"-L{folder}", f"-Wl,-rpath,{folder}", "-lricochet", "-lm"]
    ran("cc", *strict, str(source), "-o", "gas", *link, cwd=tmp_path, check=True)
    shown = ran(tmp_path / "gas", check=True).stdout
    assert re.fullmatch(r"time [\d.]+, 500 collisions, first disk at -?[\d.]+, -?[\d.]+\n", shown)
