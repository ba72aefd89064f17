"""Random systems that use all groups of the input, to find failures in cases without a test.

Scale, shape, boundaries, disks, obstacles, contact laws, sampling and stop conditions are drawn
independently. Difficult cases are preferred: a restitution of exactly 0, parallel velocities,
lattices, clusters, narrow boxes, and large ratios of size and mass. A system consists of an input
text and an initial-configuration file.
"""

import math
import random
import re
from typing import NamedTuple

import numpy as np

from random_openings import Openings

MOST_EVENTS, MOST_OF_FEW = 40_000, 12_000  #: one or two epochs for many disks
SIDES = ("left", "right", "bottom", "top")
CADENCES = ("time", "collisions", "events", "collisions_per_disk")
#: Input variables whose value is a keyword; each keyword counts as a feature of the system.
KINDS = r"(dynamics|motion|rule|law|placement|velocities|kind|side|precision) = '(\w+)'"


class System(NamedTuple):
    """Random system: input text, text of its initial-configuration file, and a description."""

    text: str
    columns: list[str]
    table: np.ndarray
    disks: int
    events: int
    draw: "Draw"  #: draws changes that are valid for the system

    def features(self) -> set[str]:
        """Return the features of the system: variables, keywords, and boundary conditions."""
        found = {"many disks"} if self.disks > 2500 else set()
        for group, words in re.findall(r"^&(\w+)(.*)/$", self.text, re.MULTILINE):
            found |= {f"{group}.{name}" for name in re.findall(r"(\w+) =", words)}
            found |= {f"{group}.{name} = {kind}" for name, kind in re.findall(KINDS, words)}
            if group == "box":
                kinds = re.search(r"boundary = '(\w+)', '(\w+)'", words)
                found |= {f"{kind} {axis}" for kind, axis in zip(kinds.groups(), "xy", strict=True)}
        return found


def starting_file(columns: list[str], table: np.ndarray) -> str:
    """Return a table of disks as the text of an initial-configuration file."""
    return "\n".join([" ".join(columns), *(numbers(*row) for row in table.tolist())]) + "\n"


def numbers(*values: float) -> str:
    """Return numbers as text in namelist format with full precision."""
    return ", ".join(repr(float(value)) for value in values)


class Draw:
    """Random choice of one system, in which earlier choices restrict later ones."""

    def __init__(self, rng: random.Random, most: int):
        """Draw the scales of length, time and mass, on which other quantities depend."""
        self.rng = rng
        self.disks = rng.choice([rng.randint(1, 12), rng.randint(20, 400), rng.randint(2600, 6000)])
        self.disks = 1 + (self.disks - 1) % most
        self.length = 10.0 ** rng.choice([0, 0, 0, rng.randint(-6, 6)])
        self.speed = 10.0 ** rng.choice([0, 0, 0, rng.randint(-6, 6)])
        aspect = rng.choice([1, 1, 2, 10, 100, 1000]) ** rng.choice([-0.5, 0.5])
        self.edges = [self.length * aspect, self.length / aspect]
        self.lower = [0.0, 0.0]
        if self.chance(0.3):
            self.lower = [rng.uniform(-1, 1) * edge for edge in self.edges]
        self.periodic = [self.chance(0.4), self.chance(0.4)]
        self.steps = self.chance(0.1)
        self.packing = rng.choice([0.01, 0.1, 0.2, 0.3, 0.4, 0.5])
        # smallest restitution, for the viscoelastic law
        self.least = 0.6 if self.chance(0.2) else 0
        self.turns = self.chance(0.3)
        self.rotates = False
        self.recycles = False
        self.bowl = False  # all disks are in a round container
        self.driven = self.chance(0.3)
        self.falls = self.chance(0.3) and not all(self.periodic)
        self.sheared = all(self.periodic) and not self.steps and self.chance(0.5)
        self.loses = False  # each collision dissipates energy
        self.bouncing = False  # the contact time may make the run endless
        self.worked = False  # walls change the energy, so that no stop condition may depend on it
        self.drifts = all(self.periodic)  # without randomness, the centre of mass moves for ever
        self.columns: list[str] = []
        self.table = np.empty((0, 8))
        self.kinds = 1
        self.displaced = False  # a side moves, or does not start at the edge of the box
        if self.disks < 3 and (self.driven or all(self.periodic)):
            self.disks = 3  # fewer disks might never collide

    def chance(self, share: float) -> bool:
        return self.rng.random() < share

    def maybe(self, share: float, words: str) -> str:
        return f" {words}" if self.chance(share) else ""

    def place(self, x: float, y: float) -> list[float]:
        """Return the point of the box at the given fractions of its edge lengths."""
        return [
            low + part * edge
            for low, part, edge in zip(self.lower, (x, y), self.edges, strict=True)
        ]

    def run(self) -> str:
        words = f"&run seed = {self.rng.randint(0, 10**6)}"
        if self.steps:
            width = math.sqrt(math.prod(self.edges) * self.packing / self.disks)
            self.step = 0.1 * width / self.speed
            words += f" dynamics = 'steps' dt = {self.step!r}"
        return words + " /"

    def box(self) -> str:
        words = f"&box lower = {numbers(*self.lower)} "
        words += "upper = " + numbers(*(a + b for a, b in zip(self.lower, self.edges, strict=True)))
        sides = ["'periodic'" if yes else "'wall'" for yes in self.periodic]
        words += f" boundary = {', '.join(sides)}"
        if self.falls:
            unit = self.speed**2 / max(self.edges)
            pull = self.rng.choice([(0, -1), (0, -10), (1, 0), (0.3, -0.7)])
            pull = [0 if ends else g for g, ends in zip(pull, self.periodic, strict=True)]
            words += " gravity = " + numbers(*(unit * g for g in pull))
        if self.sheared:
            rate = self.rng.choice([-1, 1]) * 10.0 ** self.rng.uniform(-2, 2)
            words += f" shear_rate = {rate * self.speed / self.edges[1]!r}"
        return words + " /"

    # --- collision rules and motions of boundaries ---

    def law(self) -> str:
        """Draw the collision rule of one boundary, often the default."""
        rng = self.rng
        if self.chance(0.5):
            return ""
        sliding = rng.choice([-1, 1]) * self.speed * 10.0 ** rng.uniform(-1, 0.5)
        sliding = self.maybe(0.5, f"surface_velocity = {sliding!r}")
        if self.chance(0.4):
            self.worked = True
            return f" temperature = {self.speed**2 * 10.0 ** rng.uniform(-1, 1)!r}{sliding}"
        words = f" restitution = {max(self.least, rng.choice([0, 1, 0.9, rng.random()]))}"
        if self.chance(0.5):
            return words + rng.choice(["", " rule = 'velocity'", " rule = 'normal'"])
        self.worked = self.worked or bool(sliding)
        return f"{words} rule = 'normal'{self.grip(least=-0.9)}{sliding}"

    def grip(self, wall: str = "", least: float = -1) -> str:
        """Draw tangential restitution and friction of disks or walls."""
        beta = self.rng.choice([least, 0, 1, self.rng.uniform(least, 1)])
        words = f" {wall}tangential_restitution = {beta}"
        if beta > -1:
            words += self.maybe(0.5, f"{wall}friction = {self.rng.choice([0, 0.1, 0.5, 10])}")
        return words

    def sides(self) -> list[str]:
        """Draw the collision rules and motions of the sides of the box."""
        groups = []
        for k, name in enumerate(SIDES):
            if self.periodic[k // 2] or self.chance(0.65):
                continue
            words = self.law()
            if not {"temperature", "surface_velocity"} & set(words.split()) and self.chance(0.6):
                words += self.side_motion()
            if not re.search("'(sine|parabolic|sawtooth)'", words) and self.chance(0.25):
                edge, way = self.edges[k // 2], self.rng.choice([1e-6, 0.1, 0.7])
                way *= self.rng.random()
                end = self.lower[k // 2] + (k % 2) * edge
                words += f" position = {end + (2 * (k % 2) - 1) * way * edge!r}"
            self.displaced |= bool(re.search("'(sine|parabolic|constant_velocity|piston)'", words))
            self.displaced |= " position = " in words
            groups.append(f"&side name = '{name}'{words} /")
        return groups

    def side_motion(self) -> str:
        """Draw the motion of one side."""
        rng = self.rng
        self.worked = True
        kinds = ["constant_velocity", "parabolic", "sawtooth", "sine"]
        kind = rng.choice(kinds if self.steps else [*kinds, "piston"])
        words = f" motion = '{kind}'"
        if kind == "sawtooth":
            return words + f" velocity = {self.speed * 10.0 ** rng.uniform(-2, 0.5)!r}"
        if kind == "constant_velocity":
            speed = rng.choice([-1, 1]) * self.speed * 10.0 ** rng.uniform(-2, 0.5)
            begin = rng.choice([0, rng.random()]) * min(self.edges) / self.speed
            end = begin + rng.uniform(0, 0.1) * min(self.edges) / abs(speed)
            return words + f" velocity = {speed!r} start_time = {begin!r} end_time = {end!r}"
        if kind == "piston":
            mass = 10.0 ** rng.uniform(-1, 3)
            force = mass * self.speed**2 / min(self.edges)
            force *= rng.choice([0, 1, 1, 1]) * 10.0 ** rng.uniform(-2, 1)
            return words + f" mass = {mass!r} force = {force!r}"
        period = min(self.edges) / self.speed * 10.0 ** rng.uniform(-2, 1)
        words += f" amplitude = {min(self.edges) * 10.0 ** rng.uniform(-5, -1)!r}"
        words += f" period = {period!r}"
        return words + self.maybe(0.7, f"phase = {rng.choice([0, 0.5, rng.random()])}")

    def obstacles(self) -> list[str]:
        """Draw circles, arcs and walls, with space between them for randomly placed disks."""
        rng, groups, small = self.rng, [], min(self.edges)
        if self.sheared:
            return groups
        if self.chance(0.2):
            for _ in range(rng.choice([1, 1, 3, 10])):
                where = f"centre = {numbers(*self.place(rng.random(), rng.random()))}"
                radius = rng.uniform(0.01, 0.15) * small
                groups.append(f"&obstacle {where} radius = {radius!r}{self.law()} /")
        if self.chance(0.2):
            for k in range(rng.choice([1, 1, 3, 10])):
                one, two = (self.place(rng.random(), rng.random()) for _ in "12")
                if self.chance(0.5):
                    axis = rng.randint(0, 1)
                    two[axis] = one[axis]
                name = self.maybe(0.3, f"name = 'w{k}'")
                ends = f" from = {numbers(*one)} to = {numbers(*two)}"
                if self.chance(0.3):  # a triangle, or an open polyline
                    last = rng.choice([one, self.place(rng.random(), rng.random())])
                    middle = self.place(rng.random(), rng.random())
                    ends = f" points = {numbers(*one, *two, *middle, *last)}"
                groups.append(f"&wall{name}{ends}{self.law()} /")
        if self.chance(0.15) and not any(self.periodic):
            size = f"centre = {numbers(*self.place(0.5, 0.5))} radius = {0.5 * small!r}"
            groups.append(f"&obstacle name = 'bowl' side = 'inside' {size}{self.law()} /")
            self.packing *= small / max(self.edges)
            self.bowl = True
        if self.chance(0.2):
            groups += [self.arc(small) for _ in range(rng.choice([1, 2, 5]))]
        if groups:
            self.packing = min(self.packing, 0.2)
        return groups

    def arc(self, small: float) -> str:
        """Draw an arc inside a box whose shorter edge has the given length."""
        rng = self.rng
        where = f"centre = {numbers(*self.place(rng.uniform(0.3, 0.7), rng.uniform(0.3, 0.7)))}"
        radius = rng.uniform(0.01, 0.3) * small
        first = rng.choice([90 * rng.randint(-4, 4), rng.uniform(-360, 360)])
        last = first + rng.choice([90, 180, 270, 360, rng.uniform(1, 360)])
        angles = f"from_angle = {first!r} to_angle = {last!r}"
        return f"&obstacle {where} radius = {radius!r} {angles}{self.law()} /"

    # --- species and initial states of the disks ---

    def region(self) -> tuple[float, float]:
        """Draw a region of the box, store it in `self.where`, and return its edge lengths."""
        self.where = ""
        if self.chance(0.9 if self.blocked else 0.7):
            return tuple(self.edges)
        parts = [self.rng.choice([1, 0.5, 0.2]) for _ in "xy"]
        begin = [self.rng.uniform(0, 1 - part) for part in parts]
        low = self.place(*begin)
        high = self.place(*(b + p for b, p in zip(begin, parts, strict=True)))
        high = [min(h, lo + e) for h, lo, e in zip(high, self.lower, self.edges, strict=True)]
        self.where = f" region = {numbers(low[0], high[0], low[1], high[1])}"
        return high[0] - low[0], high[1] - low[1]

    def motion(self, count: int) -> str:
        """Draw the initial velocities of a species."""
        v, rng = self.speed, self.rng
        words = rng.choice(
            [
                f" temperature = {v * v!r}",
                f" velocities = 'uniform' speed = {v!r}",
                f" speed = {v!r}",
                f" velocity = {numbers(v, 0)}",
                f" velocity = {numbers(v, v)}",
                f" velocity = {numbers(*(v * rng.uniform(-1, 1) for _ in range(2 * count)))}"
                if count < 50
                else f" velocity = {numbers(0, -v)}",
                " velocities = 'rest'",
            ]
        )
        if words.split()[0] in ("temperature", "velocities", "speed") and "rest" not in words:
            self.drifts = False
            words += self.maybe(0.2 if count > 2 else 0, f"exact_temperature = {v**2!r}")
        if self.turns and self.chance(0.4):
            rate = v / min(self.edges) * 10.0 ** rng.uniform(-1, 2)
            spins = [f" angular_velocity = {rate!r}", f" rotational_temperature = {v * v!r}"]
            words += rng.choice(spins)
        return words

    def species(self, blocked: bool) -> list[str]:
        """Draw up to three randomly placed species, or one species read from a file."""
        rng, groups, self.blocked = self.rng, [], blocked
        if not blocked and self.chance(0.2):
            return [rng.choice([self.from_file, self.from_file, self.by_position])()]
        if self.chance(0.15):
            return self.of_many_sizes()
        if not (blocked or self.falls or self.displaced) and self.disks <= 400 and self.chance(0.2):
            return self.relaxed()
        for k in range(rng.choice([1, 1, 1, 2, 3])):
            count = self.disks if k == 0 else rng.randint(1, max(self.disks // 3, 1))
            wide, high = self.region()
            share = self.packing / (1 if k == 0 else 6)
            radius = math.sqrt(share * wide * high / (count * math.pi))
            radius = min(radius, 0.24 * min(wide, high)) * rng.choice([1, 1, rng.uniform(0.05, 1)])
            mass = 10.0 ** rng.choice([0, 0, 0, rng.randint(-4, 4)])
            placement = f" placement = '{self.placement(k)}'"
            if "'grid'" in placement:
                columns = max(round(math.sqrt(count * wide / high)), 1)
                rows, radius = max(count // columns, 1), radius / 2
                count, placement = columns * rows, f" grid = {columns}, {rows}"
                radius = min(radius, 0.4 * min(wide / columns, high / rows))
            spread = ""
            if self.chance(0.25):
                law, most = rng.choice([("uniform", 0.47), ("gaussian", 0.27), ("lognormal", 0.39)])
                spread = f" polydispersity = {most * rng.random()!r} radius_distribution = '{law}'"
                spread += self.maybe(0.5, "mass_scaling = 'area'")
                radius /= 2  # the largest radius may be three times as large
            size = f"radius = {radius!r} mass = {mass!r}"
            if k == 0 and "grid" not in placement and self.chance(0.2):
                share = count * math.pi * radius**2 / (wide * high)
                size = f"packing_fraction = {share!r} mass = {mass!r}"
            elif k > 0 and self.chance(0.3):
                size = f"relative_to = 's0' radius = {rng.uniform(0.1, 1)!r} mass = {mass!r}"
            groups.append(
                f"&species name = 's{k}' count = {count} {size}{spread}"
                f"{placement}{self.where}{self.motion(count)} /"
            )
        self.kinds = len(groups)
        return groups

    def of_many_sizes(self) -> list[str]:
        """Draw species of about equal total area, in decreasing order of radius."""
        kinds, ratio = self.rng.randint(3, 6), 10.0 ** self.rng.uniform(0.3, 2)
        wide, high = self.region()
        radii = [ratio ** (-k / (kinds - 1)) for k in range(kinds)]
        share = self.disks / sum(r**-2 for r in radii)
        counts = [max(round(share * r**-2), 1) for r in radii]
        unit = math.sqrt(self.packing * wide * high / math.pi)
        unit /= math.sqrt(sum(n * r**2 for n, r in zip(counts, radii, strict=True)))
        unit = min(unit, 0.24 * min(wide, high))
        self.kinds = kinds
        return [
            f"&species name = 's{k}' count = {n} radius = {unit * r!r} mass = {r * r!r}"
            f" placement = 'random'{self.where}{self.motion(n)} /"
            for k, (n, r) in enumerate(zip(counts, radii, strict=True))
        ]

    def relaxed(self) -> list[str]:
        """Draw up to three species that fill the box and are equilibrated by event chains."""
        rng, self.where = self.rng, ""
        self.kinds = rng.choice([1, 1, 2, 3])
        sweeps = rng.choice([0, 1, 5])
        groups = []
        for k in range(self.kinds):
            count = self.disks if k == 0 else rng.randint(1, max(self.disks // 3, 1))
            share = max(self.packing, 0.1) / (1 if k == 0 else 6)
            radius = math.sqrt(share * math.prod(self.edges) / (count * math.pi))
            radius = min(radius, 0.24 * min(self.edges))
            size = f"count = {count} radius = {radius!r} mass = {10.0 ** rng.randint(-2, 2)!r}"
            if self.chance(0.25):
                size += f" polydispersity = {0.2 * rng.random()!r} radius_distribution = 'uniform'"
                size = size.replace(f"radius = {radius!r}", f"radius = {radius / 2!r}")
                size += self.maybe(0.5, "mass_scaling = 'area'")
            given = self.maybe(1 if k == 0 else 0.3, f"relaxation_sweeps = {sweeps}")
            groups.append(
                f"&species name = 's{k}' {size} placement = 'relaxed'{given}{self.motion(count)} /"
            )
        return groups

    def placement(self, k: int) -> str:
        if self.blocked or k > 0:
            return "random"
        few = ["dense", "dense"] if self.disks <= 400 else []
        return self.rng.choice(["random", "random", "lattice", "grid", *few])

    def by_position(self) -> str:
        """Draw a few disks in a row, some of them almost in contact."""
        self.disks = count = self.rng.randint(3, 8)
        x = [self.place((k + 0.5) / count, self.rng.choice([0.5, 0.52])) for k in range(count)]
        radius = 0.5 * min(self.edges[0] / count, 0.9 * self.edges[1])
        radius *= self.rng.choice([0.99, 0.5, 0.1])
        words = f"radius = {radius!r} mass = {10.0 ** self.rng.randint(-4, 4)!r}"
        words += f" position = {numbers(*np.ravel(x))}{self.motion(count)}"
        return f"&species name = 's0' {words} /"

    def from_file(self) -> str:
        """Draw a file with a square lattice of disks of different sizes and velocities."""
        rng = self.rng
        columns = max(round(math.sqrt(self.disks * self.edges[0] / self.edges[1])), 1)
        rows = max(self.disks // columns, 1)
        self.disks = columns * rows
        cell = min(self.edges[0] / columns, self.edges[1] / rows)
        own = np.random.default_rng(rng.randint(0, 10**6))
        k = np.arange(self.disks)
        self.table = table = np.empty((self.disks, 8))
        table[:, 0] = self.lower[0] + (k % columns + 0.5) * self.edges[0] / columns
        table[:, 1] = self.lower[1] + (k // columns + 0.5) * self.edges[1] / rows
        if self.chance(0.3):
            table[:, 2:6] = [0, 0, 0.2 * cell, 1]
            table[:, 2] = own.choice([-1, 0, 1], self.disks) * self.speed
        else:
            table[:, 2:4] = own.normal(0, self.speed, (self.disks, 2))
            table[:, 4] = own.uniform(0.05, 0.45, self.disks) * cell
            table[:, 5] = own.uniform(0.5, 2, self.disks)
        table[:, 6] = own.normal(0, self.speed / cell, self.disks)
        table[:, 7] = own.uniform(-9, 9, self.disks)
        self.columns = ["x", "y", "vx", "vy", "radius", "mass"]
        self.columns += ["omega", "angle"] if self.turns else []
        return "&species name = 's0' file = 'start.txt' /"

    # --- dynamics, stop conditions and output ---

    def contact(self) -> str:
        rng = self.rng
        restitution = max(self.least, rng.choice([0, 0, 1, 1, 0.5, 0.9, 0.99, rng.random()]))
        self.loses = restitution < 1
        words = f"&contact restitution = {restitution}"
        if self.kinds > 1 and self.chance(0.4):
            table = [[rng.choice([0, 1, 0.9, rng.random()]) for _ in range(6)] for _ in range(6)]
            kinds = range(self.kinds)
            pairs = [max(self.least, table[min(a, b)][max(a, b)]) for a in kinds for b in kinds]
            words += f" pair_restitution = {numbers(*pairs)}"
        on_walls = max(self.least, rng.choice([0, 1, 0.9, rng.random()]))
        words += self.maybe(0.5, f"wall_restitution = {on_walls}")
        if min(restitution, on_walls) < 1 and (any(self.periodic) or on_walls == 0):
            self.drifts = True  # otherwise all disks come to rest
        if self.least or self.chance(0.2):
            self.drifts = True  # events become rare, and the last one may take a long time
            law = "viscoelastic" if self.least else rng.choice(["power", "elastic_below"])
            words += f" restitution_law = '{law}'"
            words += f" reference_speed = {self.speed * 10.0 ** rng.uniform(-2, 1)!r}"
        if self.turns or self.chance(0.5):
            words += " wall_rule = 'normal'"
        if self.turns:
            grip = self.grip()
            self.rotates = " = -1" not in grip
            words += grip + rng.choice(["", self.grip("wall_")])
            words += self.maybe(0.4, f"inertia = {rng.choice([1, 0.01, rng.uniform(0.1, 1)])}")
        if self.chance(0.6 if restitution < 1 else 0.1):
            size = math.sqrt(math.prod(self.edges) / self.disks)
            self.bouncing = True
            words += f" contact_time = {size / self.speed * 10.0 ** -rng.randint(1, 5)!r}"
        return words + " /"

    def drive(self) -> str:
        """Draw the driving, whose interval may be much shorter or longer than a free flight."""
        if not self.driven:
            return ""
        rng = self.rng
        flight = math.sqrt(math.prod(self.edges) / self.disks) / self.speed
        interval = flight * 10.0 ** rng.uniform(-1, 2)
        if self.steps and self.chance(0.5):
            interval = self.step * rng.randint(1, 5)  # events occur at the ends of steps
        energy = self.speed**2 * 10.0 ** rng.uniform(-2, 1)
        turn = self.maybe(0.7, f"rotational_diffusion = {rng.choice([0.1, 10]) / flight!r}")
        turn += f" turning_rate = {-1 / flight!r}" if turn else ""
        words = rng.choice(
            [
                f"kind = 'noise' strength = {energy / flight!r}"
                f" keep_momentum = {'.true.' if self.chance(0.7) else '.false.'}",
                f"kind = 'andersen' temperature = {energy!r}"
                f" fraction = {rng.choice([1, 0.1, 1e-3])}",
                f"kind = 'brownian' temperature = {energy!r}",
                f"kind = 'active' temperature = {energy!r}"
                f" self_propulsion_speed = {self.speed!r}{turn}",
            ]
        )
        if not self.sheared and self.chance(0.3):
            self.recycles, words = True, self.recycling(energy)
        words += self.maybe(0.3, "species = 's0'")
        return f"&drive interval = {interval!r} {words} /"

    def recycling(self, energy: float) -> str:
        """Draw the regions between which disks are recycled, and their new velocities."""
        rng = self.rng
        axis, first, second = rng.choice([0, 1]), rng.uniform(0.05, 0.5), rng.uniform(0.5, 0.9)
        regions = [[0.0, 1.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]]
        regions[0][2 * axis + 1], regions[1][2 * axis] = first, second
        rng.shuffle(regions)
        if self.chance(0.6):  # a small region may be between obstacles
            for first in (0, 2):
                low, high = regions[1][first : first + 2]
                width = rng.uniform(0.1, 0.6) * (high - low)
                regions[1][first] = low + rng.random() * (high - low - width)
                regions[1][first + 1] = regions[1][first] + width
        if self.bowl:
            across, up = (rng.uniform(0.05, 0.2) * min(self.edges) / edge for edge in self.edges)
            regions = [[0.0, 1.0, 0.0, 0.49 - up], [0.5 - across, 0.5 + across, 0.5 - up, 0.5 + up]]
        words = "kind = 'recycle'"
        for name, (x1, x2, y1, y2) in zip(("from", "to"), regions, strict=True):
            (left, low), (right, high) = self.place(x1, y1), self.place(x2, y2)
            words += f" {name}_region = {numbers(left, right, low, high)}"
        velocity = numbers(*(self.speed * rng.uniform(-1, 1) for _ in "xy"))
        return words + rng.choice([f" temperature = {energy!r}", f" velocity = {velocity}"])

    def stop(self) -> str:
        rng = self.rng
        self.events = rng.randint(1, MOST_EVENTS if self.disks > 2500 else MOST_OF_FEW)
        words = f"&stop events = {self.events}"
        words += self.maybe(0.3, f"collisions = {rng.randint(1, self.events)}")
        rate = rng.uniform(0, 2) * self.events / self.disks
        words += self.maybe(0.2, f"collisions_per_disk = {rate!r}")
        if not (self.driven or self.sheared or self.worked):
            words += self.maybe(0.3, f"energy_fraction = {rng.uniform(0.05, 0.95)!r}")
            if self.loses and not (self.bouncing or self.steps):
                words += self.maybe(0.9, " at_rest = .true.")
        if self.chance(0.3) or self.steps or self.driven or self.drifts or self.disks < 4:
            words += f" time = {rng.uniform(0.01, 1) * min(self.edges) / self.speed!r}"
        else:  # if events become rare, samples up to the last event would fill the disk
            far = 100 if max(self.edges) > 30 * min(self.edges) else 1000
            words += f" time = {far * min(self.edges) / self.speed!r}"
        return words + " /"

    def output(self) -> str:
        rng = self.rng
        words = "&output" + self.maybe(0.4, "event_log = .true.")
        words += self.maybe(0.2, "precision = 'single'") + self.maybe(0.3, "virial_tensor = .true.")
        words += (
            ""
            if self.falls or self.sheared or self.recycles
            else self.maybe(0.3, "helfand = .true.")
        )
        words += self.maybe(0.1, "checkpoint_every = 1e-3")
        for track in "frames", "observables":
            for kind in rng.sample(CADENCES, rng.choice([0, 1, 1, 1])):
                words += f" {track}_every_{kind} = {self.cadence(kind)!r}"
            if self.chance(0.3):
                times = sorted(self.cadence("time") for _ in range(rng.randint(1, 9)))
                words += f" {track}_at = {numbers(*times)}"
            words += self.maybe(0.3, f"{track}_per_decade = {rng.randint(1, 9)}")
        if "per_decade" in words:
            words += f" decades_from = {self.cadence('time') / 100!r}"
        words += self.maybe(0.2, "frame_columns = 'velocity'" + self.own_columns())
        return words + " /"

    def own_columns(self) -> str:
        """Return those columns of frames that only systems such as this one have."""
        image = ", 'image'" if any(self.periodic) else ""
        recycled = ", 'recycled'" if self.recycles else ""
        return image + (", 'orientation'" if self.rotates else "") + recycled

    def cadence(self, kind: str) -> float:
        """Draw the sampling interval of frames or observables."""
        every = max(self.events // self.rng.randint(2, 5 if self.disks > 1000 else 40), 1)
        if kind == "time":
            return self.rng.uniform(0.02, 0.3) * min(self.edges) / self.speed
        if kind == "collisions_per_disk":
            return 2 * every / self.disks * self.rng.uniform(0.7, 1.4)
        return every


def random_system(rng: random.Random, most: int = 10**6, openings: bool = True) -> System:
    """Return a random system of at most about `most` disks, which the program may refuse.

    Without `openings` the system has no open sides, sources, waiting disks or scheduled changes.
    """
    draw = Draw(rng, most)
    walls = draw.sides()
    obstacles = draw.obstacles()
    disks = draw.species(bool(obstacles))
    parts = [draw.run(), draw.box(), *walls, *obstacles, *disks, draw.contact(), draw.drive()]
    alone = draw.disks == 1 or ("species = 's0'" in parts[-1] and " count = 1 " in disks[0])
    if alone:  # the momentum of a single driven disk is its velocity, so only a free one is driven
        parts[-1] = parts[-1].replace("keep_momentum = .true.", "keep_momentum = .false.")
    parts += [draw.stop(), draw.output()]
    draw.openings = Openings(draw, [part for part in parts if part])
    if openings:
        parts = draw.openings.all_parts()
    table = draw.table[:, : len(draw.columns)]
    text = "\n".join(parts) + "\n"
    return System(text, draw.columns, table, draw.disks, draw.events, draw)
