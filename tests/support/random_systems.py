"""Random systems over every group of the input, to look for what nobody has named.

Each draws its scale, shape, boundaries, disks, obstacles, law, cadence and end on its own, with a
liking for what breaks programs: restitution of exactly 0, aligned velocities and lattices,
clusters, strips, great ratios of size and mass. A system is a text and the file that it names.
"""

import math
import random
from typing import NamedTuple

import numpy as np

MOST_EVENTS = 40_000


class System(NamedTuple):
    """An input file, the text of its starting file (empty: none), and what it says of itself."""

    text: str
    start: str
    disks: int
    events: int


def numbers(*values: float) -> str:
    """Values as a namelist has them, with all digits."""
    return ", ".join(repr(float(value)) for value in values)


def chance(rng: random.Random, share: float) -> bool:
    return rng.random() < share


class Draw:
    """One system in the making: what earlier choices mean for later ones."""

    def __init__(self, rng: random.Random):
        """The scales."""
        self.rng = rng
        self.disks = rng.choice([rng.randint(1, 12), rng.randint(20, 400), rng.randint(2600, 9000)])
        self.length = 10.0 ** rng.choice([0, 0, 0, rng.randint(-6, 6)])
        self.speed = 10.0 ** rng.choice([0, 0, 0, rng.randint(-6, 6)])
        aspect = rng.choice([1, 1, 2, 10, 100, 1000]) ** rng.choice([-0.5, 0.5])
        self.edges = [self.length * aspect, self.length / aspect]
        self.lower = [0.0, 0.0]
        if chance(rng, 0.3):
            self.lower = [rng.uniform(-1, 1) * edge for edge in self.edges]
        self.periodic = [chance(rng, 0.4), chance(rng, 0.4)]
        self.steps = chance(rng, 0.1)
        self.packing = rng.choice([0.01, 0.1, 0.2, 0.3, 0.4, 0.5])
        self.start: list[str] = []
        self.turns = chance(rng, 0.3)

    def place(self, x: float, y: float) -> list[float]:
        """A point of the box by its fractions of the edges."""
        return [
            low + part * edge
            for low, part, edge in zip(self.lower, (x, y), self.edges, strict=True)
        ]

    def region(self) -> tuple[float, float]:
        """Widths of a part of the box, and its line in `self.where`."""
        self.where = ""
        if chance(self.rng, 0.7):
            return tuple(self.edges)
        parts = [self.rng.choice([1, 0.5, 0.2]) for _ in "xy"]
        begin = [self.rng.uniform(0, 1 - part) for part in parts]
        low = self.place(*begin)
        high = self.place(*(b + p for b, p in zip(begin, parts, strict=True)))
        high = [min(h, lo + e) for h, lo, e in zip(high, self.lower, self.edges, strict=True)]
        self.where = f"region = {numbers(low[0], high[0], low[1], high[1])} "
        return high[0] - low[0], high[1] - low[1]

    def run(self) -> str:
        rng = self.rng
        words = f"&run seed = {rng.randint(0, 10**6)}"
        if self.steps:
            width = math.sqrt(math.prod(self.edges) * self.packing / self.disks)
            words += f" dynamics = 'steps' dt = {0.1 * width / self.speed!r}"
        return words + " /"

    def box(self) -> str:
        words = f"&box lower = {numbers(*self.lower)} "
        words += "upper = " + numbers(*(a + b for a, b in zip(self.lower, self.edges, strict=True)))
        sides = ["'periodic'" if yes else "'wall'" for yes in self.periodic]
        words += f" boundary = {', '.join(sides)}"
        self.falls = chance(self.rng, 0.3)
        if self.falls:
            unit = self.speed**2 / max(self.edges)
            pull = self.rng.choice([(0, -1), (0, -10), (1, 0), (0.3, -0.7)])
            words += " gravity = " + numbers(
                *(0 if ends else unit * g for g, ends in zip(pull, self.periodic, strict=True))
            )
        self.sheared = all(self.periodic) and not self.steps and chance(self.rng, 0.5)
        if self.sheared:
            rate = self.rng.choice([-1, 1]) * 10.0 ** self.rng.uniform(-2, 1)
            words += f" shear_rate = {rate * self.speed / self.edges[1]!r}"
        return words + " /"

    def motion(self) -> str:
        """How the disks of a species start."""
        v = self.speed
        turning = ""
        if self.turns and chance(self.rng, 0.4):
            rate = v / min(self.edges) * 10.0 ** self.rng.uniform(-1, 2)
            turning = f" angular_velocity = {rate!r}"
            if chance(self.rng, 0.5):
                turning = f" rotational_temperature = {v * v!r}"
        return turning + " " + self.rng.choice(
            [
                f"temperature = {v * v!r}",
                f"velocities = 'uniform' speed = {v!r}",
                f"speed = {v!r}",
                f"velocity = {numbers(v, 0)}",
                f"velocity = {numbers(0, -v)}",
                f"velocity = {numbers(v, v)}",
                "velocities = 'rest'",
            ]
        )

    def species(self) -> list[str]:
        self.kinds = 1
        if chance(self.rng, 0.15):
            return [self.from_file()]
        rng, groups, left = self.rng, [], self.disks
        for k in range(rng.choice([1, 1, 1, 2, 3])):
            count = left if k == 0 else rng.randint(1, max(left // 3, 1))
            wide, high = self.region()
            share = self.packing / (1 if k == 0 else 6)
            radius = math.sqrt(share * wide * high / (count * math.pi))
            radius = min(radius, 0.24 * wide, 0.24 * high) * rng.choice(
                [1, 1, rng.uniform(0.05, 1)]
            )
            few = ["lattice", "dense", "dense"] if self.disks <= 400 else ["lattice"]
            placement = rng.choice(["random", "random", *few]) if k == 0 else "random"
            motion = self.motion() if k == 0 else rng.choice([self.motion(), "velocities = 'rest'"])
            mass = 10.0 ** rng.choice([0, 0, 0, rng.randint(-4, 4)])
            size = f"radius = {radius!r} mass = {mass!r}"
            if k > 0 and chance(rng, 0.3):
                size = f"relative_to = 's0' radius = {rng.uniform(0.2, 2)!r} mass = {mass!r}"
            if "temperature" in motion and count > 1 and chance(rng, 0.3):
                motion += f" exact_temperature = {self.speed**2!r}"
            groups.append(
                f"&species name = 's{k}' count = {count} {size} "
                f"placement = '{placement}' {self.where}{motion} /"
            )
        self.kinds = len(groups)
        return groups

    def from_file(self) -> str:
        """A species in a file: a square lattice, each disk with its own size and velocity."""
        rng = self.rng
        aspect = self.edges[0] / self.edges[1]
        columns = max(round(math.sqrt(self.disks * aspect)), 1)
        rows = max(self.disks // columns, 1)
        self.disks = columns * rows
        cell = min(self.edges[0] / columns, self.edges[1] / rows)
        own = np.random.default_rng(rng.randint(0, 10**6))
        same = chance(rng, 0.3)
        self.start.append("x y vx vy radius mass" + (" omega angle" if self.turns else ""))
        for k in range(self.disks):
            x = self.lower[0] + (k % columns + 0.5) * self.edges[0] / columns
            y = self.lower[1] + (k // columns + 0.5) * self.edges[1] / rows
            if same:
                row = (x, y, rng.choice([-1, 0, 1]) * self.speed, 0, 0.2 * cell, 1)
            else:
                row = (x, y, *own.normal(0, self.speed, 2), own.uniform(0.05, 0.45) * cell)
                row += (own.uniform(0.5, 2),)
            if self.turns:
                row += (own.normal() * self.speed / cell, own.uniform(-9, 9))
            self.start.append(numbers(*row))
        return "&species name = 's0' file = 'start.txt' /"

    def obstacles(self) -> list[str]:
        rng, groups = self.rng, []
        if self.start or self.sheared:
            return groups  # they would stand on disks, or be refused
        small = min(self.edges)
        if chance(rng, 0.25):
            for _ in range(rng.choice([1, 3, 10])):
                centre = self.place(rng.random(), rng.random())
                radius = rng.uniform(0.01, 0.15) * small
                groups.append(
                    f"&obstacle centre = {numbers(*centre)} radius = {radius!r}{self.law()} /"
                )
        if chance(rng, 0.25):
            for _ in range(rng.choice([1, 3, 10])):
                one, two = (self.place(rng.random(), rng.random()) for _ in "12")
                if chance(rng, 0.5):
                    axis = rng.randint(0, 1)
                    two[axis] = one[axis]
                groups.append(f"&wall from = {numbers(*one)} to = {numbers(*two)}{self.law()} /")
        if chance(rng, 0.08) and not any(self.periodic):
            size = f"centre = {numbers(*self.place(0.5, 0.5))} radius = {0.5 * small!r}"
            groups.append(f"&obstacle name = 'bowl' side = 'inside' {size}{self.law()} /")
        return groups

    def law(self) -> str:
        """What one side, wall or obstacle has of its own: often nothing."""
        rng = self.rng
        if chance(rng, 0.6):
            return ""
        speed = rng.choice([-1, 1]) * self.speed * 10.0 ** rng.uniform(-1, 0.5)
        sliding = rng.choice(["", f" speed = {speed!r}"])
        if chance(rng, 0.4):
            return f" temperature = {self.speed**2 * 10.0 ** rng.uniform(-1, 1)!r}{sliding}"
        words = f" restitution = {rng.choice([0, 1, 0.9, rng.random()])}"
        if self.turns and chance(rng, 0.7):
            return f"{words} rule = 'normal'{self.grip()}{sliding}"
        return words + rng.choice(["", " rule = 'velocity'", " rule = 'normal'"])

    def grip(self, wall: str = "") -> str:
        """Tangential restitution and friction, of disks or of walls."""
        rng = self.rng
        beta = rng.choice([-1, 0, 1, rng.uniform(-1, 1)])
        words = f" {wall}tangential_restitution = {beta}"
        if beta > -1 and chance(rng, 0.5):
            words += f" {wall}friction = {rng.choice([0, 0.1, 0.5, 10])}"
        return words

    def sides(self) -> list[str]:
        """Laws and motions of the sides of the box."""
        rng, groups = self.rng, []
        for k, name in enumerate(("left", "right", "bottom", "top")):
            if self.periodic[k // 2] or chance(rng, 0.7):
                continue
            words = self.law()
            if "temperature" not in words and chance(rng, 0.5):
                period = min(self.edges) / self.speed * 10.0 ** rng.uniform(-2, 1)
                words += f" motion = '{rng.choice(['sine', 'parabolic'])}' period = {period!r}"
                words += f" amplitude = {min(self.edges) * 10.0 ** rng.uniform(-5, -1)!r}"
                words += f" phase = {rng.choice([0, 0.5, rng.random()])}"
            elif "temperature" not in words and chance(rng, 0.3):
                velocity = self.speed * 10.0 ** rng.uniform(-2, 0.5)
                words += f" motion = 'sawtooth' velocity = {velocity!r}"
            groups.append(f"&side name = '{name}'{words} /")
        self.worked = bool(groups)
        return groups

    def contact(self) -> str:
        rng = self.rng
        words = "&contact"
        restitution = rng.choice([0, 0, 1, 1, 0.5, 0.9, 0.99, rng.random()])
        words += f" restitution = {restitution}"
        if self.kinds > 1 and chance(rng, 0.4):
            table = [
                [rng.choice([0, 1, 0.9, rng.random()]) for _ in range(self.kinds)]
                for _ in range(self.kinds)
            ]
            pairs = [
                table[min(a, b)][max(a, b)] for a in range(self.kinds) for b in range(self.kinds)
            ]
            words += f" pair_restitution = {numbers(*pairs)}"
        if chance(rng, 0.5):
            words += f" wall_restitution = {rng.choice([0, 1, 0.9, rng.random()])}"
        if chance(rng, 0.5) or self.turns:
            words += " wall_rule = 'normal'"
        if self.turns:
            words += self.grip() + rng.choice(["", self.grip("wall_")])
            if chance(rng, 0.3):
                words += f" inertia = {rng.choice([1, 0.01, rng.uniform(0.1, 1)])}"
        if chance(rng, 0.6 if restitution < 1 else 0.1):
            size = math.sqrt(math.prod(self.edges) / self.disks)
            words += f" contact_time = {size / self.speed * 10.0 ** -rng.randint(1, 5)!r}"
        return words + " /"

    def drive(self) -> str:
        """Kicks, from many in a free flight to one in many."""
        rng = self.rng
        self.driven = chance(rng, 0.25)
        if not self.driven:
            return ""
        flight = math.sqrt(math.prod(self.edges) / self.disks) / self.speed
        interval = flight * 10.0 ** rng.uniform(-1, 2)
        energy = self.speed**2 * 10.0 ** rng.uniform(-2, 1)
        keep = rng.choice(["", " keep_momentum = .true."])
        words = rng.choice(
            [
                f"kind = 'noise' strength = {energy / flight!r}{keep}",
                f"kind = 'andersen' temperature = {energy!r}"
                f" fraction = {rng.choice([1, 0.1, 1e-3])}",
                f"kind = 'brownian' temperature = {energy!r}",
                f"kind = 'active' temperature = {energy!r} speed = {self.speed!r}"
                f" rotational_diffusion = {rng.choice([0, 0.1, 10]) / flight!r}",
            ]
        )
        if chance(rng, 0.3):
            words += " species = 's0'"
        return f"&drive interval = {interval!r} {words} /"

    def stop(self) -> str:
        rng = self.rng
        self.events = rng.randint(1, MOST_EVENTS)
        words = f"&stop events = {self.events}"
        if chance(rng, 0.3):
            words += f" collisions = {rng.randint(1, self.events)}"
        if chance(rng, 0.2):
            words += f" collisions_per_disk = {rng.uniform(0, 2) * self.events / self.disks!r}"
        if chance(rng, 0.2) and not (self.driven or self.sheared or self.worked):
            words += f" energy_fraction = {rng.uniform(0.05, 0.95)!r}"
        if chance(rng, 0.3) or self.steps or self.driven:
            words += f" time = {rng.uniform(0.01, 1) * min(self.edges) / self.speed!r}"
        return words + " /"

    def output(self) -> str:
        rng, words = self.rng, "&output"
        every = max(self.events // rng.randint(2, 40), 1)
        if self.disks > 1000:
            every = max(every, self.events // 5, 1)
        for track in "frames", "observables":
            kinds = ["time", "collisions", "events", "collisions_per_disk"]
            for kind in rng.sample(kinds, rng.choice([0, 1, 1, 1])):
                step = every
                if kind == "time":
                    step = rng.uniform(0.02, 0.3) * min(self.edges) / self.speed
                elif kind == "collisions_per_disk":
                    step = 2 * every / self.disks * rng.uniform(0.7, 1.4)
                words += f" {track}_every_{kind} = {step!r}"
        if chance(rng, 0.4):
            words += " event_log = .true."
        if chance(rng, 0.2):
            words += " precision = 'single'"
        if chance(rng, 0.3):
            words += " virial_tensor = .true."
        if chance(rng, 0.1):
            words += " checkpoint_every = 1e-3"
        return words + " /"


def random_system(rng: random.Random) -> System:
    """A system that may be refused, break off, or run."""
    draw = Draw(rng)
    box = draw.box()
    disks = draw.species()
    parts = [draw.run(), box, *draw.sides(), *draw.obstacles(), *disks]
    parts += [draw.contact(), draw.drive()]
    parts += [draw.stop(), draw.output()]
    return System("\n".join(parts) + "\n", "\n".join(draw.start), draw.disks, draw.events)
