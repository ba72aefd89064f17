"""Disks that meet an obstacle where the direction of its surface is undetermined."""

import math
import random

import numpy as np
import pytest

from ricochet import Simulation

CONTAINERS = ["side='inside'", "from_angle=0 to_angle=360", "from_angle=-100 to_angle=250"]
LAWS = [
    "",
    "&contact wall_rule='normal' wall_tangential_restitution=0.5 tangential_restitution=0.5 /",
    "&box gravity=0,-1 /",
    "&contact wall_restitution=0.5 wall_rule='normal' contact_time=1e-30 /",
    "&contact wall_restitution=0 wall_rule='normal' contact_time=1e-9 /",
]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kind", CONTAINERS)
def test_a_container_may_be_hardly_larger_than_its_disk(kind, law):
    """At the centre of such a container the disk touches it in all directions.

    A disk that rests on it is separated from it, but not by a velocity that it cannot keep.
    """
    rng = random.Random(kind + law)
    for _ in range(8):
        size = rng.uniform(0.05, 0.45)
        radius = size
        for _ in range(rng.randrange(1, 5)):
            radius = math.nextafter(radius, 0)
        x, y = rng.choice([(0.5, 0.5), (rng.uniform(0.45, 0.55), rng.uniform(0.45, 0.55))])
        u, v = rng.uniform(-1, 1), rng.uniform(-1, 1)
        text = f"&obstacle centre={x!r},{y!r} radius={size!r} {kind} /\n{law}\n&species name='a' "
        text += f"radius={radius!r} position={x!r},{y!r} velocity={u!r},{v!r} /\n"
        with Simulation(text) as box:
            energy = box.observable("total_energy")
            box.advance(events=100)
            left, lost = map(box.observable, ("total_energy", "dissipated_energy"))
            assert left <= 2 * energy and left + lost == pytest.approx(energy, rel=1e-9), text
            speed = np.linalg.norm(box.velocity)
            assert np.all(np.isfinite(box.position)) and math.isfinite(speed), text
            assert np.all(np.abs(box.position - (x, y)) < 1e-12) or "to_angle=250" in kind
            if law == "":
                assert speed == pytest.approx(math.hypot(u, v), rel=1e-12), text


@pytest.mark.parametrize(
    ("obstacle", "reflected"),
    [
        ("&obstacle centre=0.5,0.5 radius=0.125", True),
        ("&obstacle centre=0.5,0.25 radius=0.25 from_angle=45 to_angle=90", True),
        ("&wall from=0.5,0.5 to=0.5,0.75", True),
        ("&wall from=0.5,0.25 to=0.5,0.75", True),
        ("&obstacle centre=0.5,0.75 radius=0.25 from_angle=-135 to_angle=-45", False),
        ("&wall from=0.5,0.5 to=0.75,0.5", False),
    ],
)
@pytest.mark.parametrize("law", ["wall_rule='velocity'", "wall_tangential_restitution=0"])
def test_a_step_may_end_exactly_on_an_obstacle(obstacle, reflected, law):
    """The disk is reflected at a centre or an end, and continues along an outline."""
    rough = "wall_rule='normal' tangential_restitution=0 " if "tangential" in law else ""
    sliding = "surface_velocity=1" if rough else ""
    text = f"{obstacle} {sliding} /\n&contact {rough}{law} /\n"
    text += "&species name='a' radius=0.0625 position=0.25,0.5 velocity=4,0 /\n"
    text += "&run dynamics='steps' dt=0.0625 /\n"
    with Simulation(text) as box:
        box.advance(time=0.0625)
        assert box.position.tolist() == [[0.5, 0.5]]
        if not rough:
            assert box.velocity.tolist() == [[-4 if reflected else 4, 0]]
        box.advance(time=3)
        assert np.all(np.isfinite([*box.position, *box.velocity]))
