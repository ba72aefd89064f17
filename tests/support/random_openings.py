"""Open sides, sources, waiting disks and scheduled changes for random systems.

They use random numbers of their own, so that all other choices of a system are the same with and
without them.
"""

import math
import random
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from random_systems import Draw

SIDES = ("left", "right", "bottom", "top")
MOST_ACTIONS = 200  #: of a source
#: Species to which waiting disks can be added, because their number of disks is given.
COUNTED = re.compile(r"(?<= count = )\d+")


def numbers(*values: float) -> str:
    """Return numbers as text in namelist format with full precision."""
    return ", ".join(repr(float(value)) for value in values)


class Openings:
    """Changes in the groups of a random system that let disks leave and enter the box."""

    def __init__(self, draw: "Draw", parts: list[str]):
        """Store the groups of the system, which the methods modify."""
        self.draw, self.parts = draw, parts
        self.rng = random.Random(repr(draw.rng.getstate()[1][:9]))
        self.lids: list[str] = []
        self.sources: list[str] = []
        self.flight = math.sqrt(math.prod(draw.edges) / draw.disks) / draw.speed
        self.ties = [float(one) for one in re.findall(r"interval = (\S+)", " ".join(parts))]

    def chance(self, share: float) -> bool:
        return self.rng.random() < share

    def place_of(self, group: str) -> int:
        """Return the index of the first group with a given name."""
        return next(k for k, part in enumerate(self.parts) if part.startswith(f"&{group} "))

    def add(self, group: str, words: str) -> None:
        """Add variables to the first group with a given name."""
        k = self.place_of(group)
        self.parts[k] = f"{self.parts[k].removesuffix(' /')} {words} /"

    def all_parts(self) -> list[str]:
        """Return the groups of the system, open and with scheduled changes in some of the cases."""
        open_system = self.chance(0.25) and not self.draw.sheared
        changed = self.chance(0.5 if open_system else 0.1)
        self.end = self.flight
        if open_system or changed:
            self.limit_time()
        if open_system:
            self.close_options()
            self.open_sides()
            self.let_disks_wait()
            if not self.draw.recycles:
                self.add_sources()
        if changed:
            self.schedule()
        return self.parts

    def limit_time(self) -> None:
        """Add a time limit, because a source whose region is full never stops trying."""
        stop = self.parts[self.place_of("stop")]
        self.end = self.flight * 10.0 ** self.rng.uniform(-0.5, 1)
        if given := re.search(r" time = (\S+)", stop):
            self.end = float(given[1])
        else:
            self.add("stop", f"time = {self.end!r}")

    def close_options(self) -> None:
        """Remove settings that cannot be combined with an open system."""
        for group, word in (("stop", r" energy_fraction = \S+"), ("output", r" helfand = \S+")):
            k = self.place_of(group)
            self.parts[k] = re.sub(word, "", self.parts[k])

    def open_sides(self) -> None:
        """Open sides without a motion, or give them a lid that is initially closed."""
        for k, name in enumerate(SIDES):
            if self.draw.periodic[k // 2] or self.chance(0.5):
                continue
            group = f"side name = '{name}'"
            found = [part for part in self.parts if part.startswith(f"&{group}")]
            if found and re.search(" (motion|position) = ", found[0]):
                continue
            if not found:
                self.parts.insert(2, f"&{group} /")
            self.add(group, f"open = {self.rng.choice(['.true.', '.true.', '.false.'])}")
            self.lids.append(name)
        if self.lids and self.chance(0.4):
            disks = self.rng.choice([0, self.rng.randint(0, self.draw.disks)])
            self.add("stop", f"disks_inside = {disks}")

    def let_disks_wait(self) -> None:
        """Add waiting disks to species, or let all disks of a species wait."""
        for k, part in enumerate(self.parts):
            given = COUNTED.search(part)
            if not part.startswith("&species") or not given or self.chance(0.3):
                continue
            count = int(given[0])
            more = self.rng.choice([1, self.rng.randint(1, count), self.rng.randint(1, count)])
            needed = re.search(r" (grid|exact_temperature) = | velocity = [^,]*,[^,]*,", part)
            if self.chance(0.15) and not needed:
                count, more = 0, count
            words = COUNTED.sub(str(count + more), part).removesuffix(" /")
            self.parts[k] = f"{words} waiting = {more} /"

    def region(self) -> str:
        """Return a region in which disks enter: the whole box or a part of it."""
        if self.chance(0.3):
            return ""
        ends = []
        for axis in (0, 1):
            part = self.rng.choice([1, 0.5, 0.3])
            low = self.rng.uniform(0, 1 - part)
            start, edge = self.draw.lower[axis], self.draw.edges[axis]
            ends += [start + low * edge, min(start + (low + part) * edge, start + edge)]
        return f" region = {numbers(*ends)}"

    def add_sources(self) -> None:
        """Add up to three sources, whose times may coincide with each other and with kicks."""
        names = re.findall(r"&species name = '(\w+)'", "\n".join(self.parts))
        kt = self.draw.speed**2 * 10.0 ** self.rng.uniform(-1, 1)
        for k in range(self.rng.choice([1, 1, 2, 3])):
            interval = self.flight * 10.0 ** self.rng.uniform(-1, 1)
            if self.ties and self.chance(0.4):
                interval = self.rng.choice(self.ties)
            interval = max(interval, self.end / MOST_ACTIONS)
            self.ties.append(interval)
            velocity = numbers(*(self.draw.speed * self.rng.uniform(-1, 1) for _ in "xy"))
            words = self.rng.choice([f"temperature = {kt!r}", f"velocity = {velocity}"])
            if len(names) > 1 or self.chance(0.5):
                words += f" species = '{self.rng.choice(names)}'"
            if self.chance(0.6):
                words += f" count = {self.rng.choice([0, 2, 7, 1000])}"
            begin = self.rng.choice([self.rng.randint(0, 5) * interval, 0.4 * self.end])
            if self.chance(0.3):
                words += f" start_time = {begin!r}"
            if self.chance(0.3):
                last = begin + self.rng.choice([interval, self.rng.random() * self.end])
                words += f" end_time = {last!r}"
            name = f" name = 'in{k}'" if self.chance(0.7) else ""
            self.sources.append(f"in{k}" if name else f"source{k + 1}")
            self.parts.append(f"&source{name}{self.region()} interval = {interval!r} {words} /")

    def schedule(self) -> None:
        """Schedule changes, some of them at the time of an action of a source or of a kick."""
        for k in range(self.rng.choice([1, 1, 2, 4])):
            time = self.rng.uniform(0, 1.2) * self.end
            if self.ties and self.chance(0.4):
                time = self.rng.randint(1, 20) * self.rng.choice(self.ties)
            name = f" name = 'c{k}'" if self.chance(0.5) else ""
            time = max(time, 1e-3 * self.end)
            self.parts.append(f"&change{name} time = {time!r} set = '{self.setting()}' /")

    def setting(self) -> str:
        """Return a change that is valid at any time, except that a lid may be blocked."""
        draw, rng = self.draw, self.rng
        settings = [f"contact.restitution={max(draw.least, rng.choice([0.1, 0.5, 0.9, 0.999]))}"]
        if draw.falls:
            unit = rng.choice([1, 10]) * draw.speed**2 / max(draw.edges)
            pull = [0 if ends else unit * rng.uniform(-1, 1) for ends in draw.periodic]
            settings.append(f"box.gravity={numbers(*pull)}")
        for name in self.lids:
            settings += [f"side.{name}.open={rng.choice(['.true.', '.true.', '.false.'])}"] * 2
        for name in self.sources:
            interval = rng.choice([2, 0.7]) * rng.choice(self.ties)
            settings.append(f"source.{name}.count={rng.choice([0, 1, 50])}")
            settings.append(f"source.{name}.interval={max(interval, self.end / MOST_ACTIONS)!r}")
        return rng.choice(settings)
