"""Units do not matter: in other ones a run gives the same bits, scaled, or is refused."""

import os
import random

import h5py
import numpy as np
import pytest

from whole_runs import one_line, write_input

X = (0.2, 0.3, 0.7, 0.4, 0.5, 0.8, 0.3, 0.7, 0.85, 0.9)
V = (1.0, 0.5, -1.0, 0.25, 0.5, -1.0, 0.0, 0.75, -0.5, -0.5)


def system(length: float, speed: float, mass: float, kind: str) -> str:
    """Five disks in units of length, speed and mass."""

    def numbers(values, unit):
        return ", ".join(repr(value * unit) for value in values)

    periodic = "periodic" in kind
    gravity = 0.0 if "gravity" not in kind else -speed * (speed / length)
    return f"""&box upper = {numbers((1, 1), length)} gravity = 0, {gravity!r}
    boundary = {"'periodic', 'periodic'" if periodic else "'wall', 'wall'"} /
    &contact restitution = {0.75 if "lossy" in kind else 1} /
    &obstacle centre = {numbers((0.5, 0.5), length)} radius = {length / 16!r} /
    &species count = 5 radius = {length / 16!r} mass = {mass!r}
    position = {numbers(X, length)} velocity = {numbers(V, speed)} /
    &stop events = 60 / &output frames_every_events = 10 /
    """


def frames(path):
    with h5py.File(path) as file:
        disks, seen = file["particles/disks"], file["observables"]
        return (
            disks["position/value"][:],
            disks["velocity/value"][:],
            seen["dissipated_energy/value"][:],
            seen["collisions/value"][:],
        )


@pytest.mark.parametrize("kind", ["walls", "periodic lossy", "gravity", "gravity lossy"])
def test_units_do_not_matter_or_are_refused(ricochet, tmp_path, kind):
    """Powers of two change no digit. Sizes of all that is possible are drawn, and some beyond."""
    draw, refused, same = random.Random(os.urandom(8)), 0, 0
    powers = [(-320, 320, 320), (320, -320, -320), (0, 0, 1)]
    for _ in range(25):
        scale = draw.choice((40, 150, 320))
        powers.append(tuple(draw.randint(-scale, scale) for _ in range(3)))
    write_input(tmp_path, system(1.0, 1.0, 1.0, kind))
    assert ricochet("gas.nml", "-o", "one.h5").returncode == 0
    x, v, lost, collisions = frames(tmp_path / "one.h5")
    for power in powers:
        length, speed, mass = (2.0**k for k in power)
        write_input(tmp_path, system(length, speed, mass, kind))
        run = ricochet("gas.nml", "-o", "other.h5", "--force")
        if run.returncode:
            assert run.returncode == 2, (power, run.stderr)
            assert "out of range" in one_line(run) or "1e-100 to 1e100" in one_line(run), power
            refused += 1
            continue
        other = frames(tmp_path / "other.h5")
        assert np.array_equal(other[0], x * length), power
        assert np.array_equal(other[1], v * speed), power
        assert np.array_equal(other[2], lost * (mass * speed**2)), power
        assert np.array_equal(other[3], collisions), power
        same += 1
    assert same > 0 and refused > 1
