"""Inelastic collapse: the report of the program, compared with a calculation with 600 digits.

The random systems are rows of two to eight disks (free, at a wall, or nearly straight in the plane)
with equal or unequal masses and a common velocity, and nearly straight rows of rough disks.
"""

import os
import re
from decimal import Decimal, localcontext
from math import pi, tan

import numpy as np
import pytest
from ricochet import Simulation, read_run

from whole_runs import FINISHED, STOPPED, differences, write_input

RADIUS = 0.0625
KINDS = ("row", "wall", "plane", "masses")
#: Stability limit of the collapse of three disks in the plane (Zhou and Kadanoff 1996).
PLANE_LIMIT = 0.0557
NEVER = Decimal("Infinity")
COMMAND = ["gas.nml", "-o", "gas.h5", "--quiet", "--force"]


def limit(disks: int, walls: int) -> float:
    """Return the limit of collapse of a row of equal disks (Bernu and Mazighi 1990)."""
    return tan(pi / 4 * (1 - (2 - walls) / disks)) ** 2


class System:
    """Random row of disks approaching each other."""

    tangential, friction, precision, height = -1.0, None, 600, 1.0

    def __init__(self, seed: int):
        """Draw the system with a given seed."""
        self.rng = rng = np.random.default_rng(seed)
        self.kind = KINDS[seed % len(KINDS)]
        self.disks = 3 if self.kind == "plane" else int(rng.integers(2 + (self.kind != "wall"), 9))
        below = rng.random() < 0.5
        self.factor = rng.uniform(0.3, 0.97) if below else rng.uniform(1, 1.5)
        critical = PLANE_LIMIT
        if self.kind != "plane":
            critical = limit(self.disks, self.kind == "wall")
        elif not below:
            self.factor = max(self.factor, 1.03)
        self.restitution = min(self.factor * critical, 0.95)
        self.wall = float(rng.choice([1, self.restitution, rng.random()]))
        self.x = np.zeros((self.disks, 2))
        gaps = rng.uniform(0.05, 1, self.disks) * rng.choice([0.1, 1])
        self.x[:, 0] = np.cumsum(2 * RADIUS + gaps)
        self.v = np.zeros((self.disks, 2))
        self.v[:, 0] = -np.sort(rng.uniform(-1, 1, self.disks))
        self.time, self.common = 20.0, float(rng.choice([0, 2.5, 40, 300]))
        if self.kind == "wall":
            self.v[:, 0] = np.sort(rng.uniform(-1.2, -0.8, self.disks))[::-1]
            speed = float(rng.choice([1, 40, 300]))
            self.v *= speed
            self.time, self.common = 12 / speed, 0
        if self.kind == "plane":
            self.x[:, 1] = rng.uniform(-1, 1, 3) * 10 ** rng.uniform(-7, -2)
        self.mass = np.ones(self.disks)
        if self.kind == "masses":
            self.mass = 10 ** rng.uniform(-1, 1, self.disks)

    def text(self, order=None, length=1.0, time=1.0) -> str:
        """Return the input, for an order of the disks and for other units of length and time."""
        order = np.arange(self.disks) if order is None else order
        x, v = self.x * length, (self.v + np.array([self.common, 0])) * (length / time)
        end = (70 + self.time * self.common) * length
        start = 0.0 if self.kind == "wall" else -70 * length
        y = self.height * length
        text = f"&box upper = {end!r}, {y!r} lower = {start!r}, {-y!r} /"
        text += f" &contact restitution = {self.restitution!r} wall_restitution = {self.wall!r}"
        if self.tangential > -1:
            text += f" tangential_restitution = {self.tangential!r} friction = {self.friction!r}"
        text += f" wall_rule = 'normal' / &stop time = {self.time * time!r} /\n"
        for k in order:
            place, speed = (", ".join(repr(float(a)) for a in b[k]) for b in (x, v))
            text += f"&species name = 's{k}' radius = {RADIUS * length!r} position = {place}"
            text += f" velocity = {speed} mass = {float(self.mass[k])!r} /\n"
        return text

    def collapses(self, factor: float = 1) -> bool:
        """Return whether the collisions never end, according to hundreds of digits.

        All coefficients of restitution are multiplied by `factor`, up to 1. A collapse is assumed
        once the relative velocities have fallen by 100 powers of ten, or after 2500 collisions.
        Gaps decrease faster than relative velocities: with 200 digits, rounding errors determine
        the last gaps.
        """
        with localcontext() as context:
            context.prec = self.precision
            return self._goes_on(Decimal(factor))

    def is_near_a_limit(self) -> bool:
        """Return whether changing all coefficients of restitution by 3 % changes the verdict."""
        return len({self.collapses(factor) for factor in (0.97, 1, 1.03)}) > 1

    def _goes_on(self, factor: Decimal) -> bool:
        axes = range(2 if self.kind in ("plane", "rough") else 1)
        x, v = ([[Decimal(float(p[k])) for k in axes] for p in a] for a in (self.x, self.v))
        inverse_mass = [1 / Decimal(float(m)) for m in self.mass]
        sigma, left = 2 * Decimal(RADIUS), Decimal(self.time)
        if self.kind == "wall":  # a disk of infinite mass
            x.insert(0, [-sigma / 2])
            v.insert(0, [Decimal(0)])
            inverse_mass.insert(0, Decimal(0))
        pairs = [(i, j) for j in range(len(x)) for i in range(j) if j == i + 1 or len(axes) > 1]
        xi = [self.wall if self.kind == "wall" and i == 0 else self.restitution for i, _ in pairs]
        xi = [min(factor * Decimal(a), Decimal(1)) for a in xi]
        rims = [Decimal(0)] * len(x)  # radius times angular velocity
        due = [contact_time(x[i], x[j], v[i], v[j], sigma) for i, j in pairs]
        for _ in range(2500):
            s = min(due)
            if s > left:
                return False
            left -= s
            due = [t - s for t in due]
            x = [[a + b * s for a, b in zip(p, u, strict=True)] for p, u in zip(x, v, strict=True)]
            pair = due.index(0)
            i, j = pairs[pair]
            dx = [b - a for a, b in zip(x[i], x[j], strict=True)]
            distance = abs(dx[0]) if len(axes) == 1 else (dx[0] ** 2 + dx[1] ** 2).sqrt()
            n = [a / distance for a in dx]
            g = sum((b - a) * c for a, b, c in zip(v[i], v[j], n, strict=True))
            if abs(g) < Decimal("1e-100"):
                return True
            impulse = (1 + xi[pair]) * g / (inverse_mass[i] + inverse_mass[j])
            if self.tangential > -1:
                self._apply_friction(i, j, n, abs(impulse), v, rims, inverse_mass)
            for k in axes:
                v[i][k] += impulse * n[k] * inverse_mass[i]
                v[j][k] -= impulse * n[k] * inverse_mass[j]
            for k, (a, b) in enumerate(pairs):
                if {a, b} & {i, j}:
                    due[k] = contact_time(x[a], x[b], v[a], v[b], sigma)
            due[pair] = NEVER
        return True

    def _apply_friction(self, i, j, n, normal_impulse, v, rims, inverse_mass) -> None:
        """Change the velocities of two disks by the tangential impulse of their collision."""
        along = (n[1], -n[0])
        slip = sum((v[i][k] - v[j][k]) * along[k] for k in (0, 1)) - rims[i] - rims[j]
        impulse = (1 + Decimal(self.tangential)) * slip / (inverse_mass[i] + inverse_mass[j]) / 3
        largest = Decimal(self.friction) * normal_impulse
        impulse = max(-largest, min(impulse, largest))
        for k, sign in ((i, -1), (j, 1)):
            v[k] = [v[k][c] + sign * impulse * along[c] * inverse_mass[k] for c in (0, 1)]
            rims[k] += 2 * impulse * inverse_mass[k]


class RoughSystem(System):
    """Random, nearly straight row of three to five rough disks."""

    precision, height = 250, 9.0

    def __init__(self, seed: int):
        """Draw the system with a given seed."""
        self.rng = rng = np.random.default_rng(seed)
        self.kind = "rough"
        self.disks = n = int(rng.choice([3, 3, 4, 5]))
        self.wall, self.time, self.common = 1.0, 20.0, float(rng.choice([0, 2.5, 40]))
        self.restitution = min(rng.uniform(0.1, 1.3) * limit(n, 0), 0.95)
        self.tangential = rng.uniform(-1, 1)
        self.friction = float(rng.choice([rng.uniform(0, 1), 1e9]))
        self.x, self.v = np.zeros((n, 2)), np.zeros((n, 2))
        self.x[:, 0] = np.cumsum(2 * RADIUS + rng.uniform(0.05, 1, n) * rng.choice([0.1, 1]))
        self.x[:, 1] = rng.uniform(-1, 1, n) * 10 ** rng.uniform(-9, -2)
        self.v[:, 0] = -np.sort(rng.uniform(-1, 1, n))
        if rng.random() < 0.3:
            self.v[:, 1] = rng.uniform(-1, 1, n) * 10 ** rng.uniform(-6, -1)
        self.mass = np.ones(n) if rng.random() < 0.5 else 10 ** rng.uniform(-0.7, 0.7, n)


def contact_time(x, y, v, w, sigma):
    """Return the time until two disks touch, or NEVER."""
    dx, dv = ([b - a for a, b in zip(p, q, strict=True)] for p, q in ((x, y), (v, w)))
    if len(dx) == 1:
        return max(dx[0] - sigma, Decimal(0)) / -dv[0] if dv[0] < 0 else NEVER
    b, a = dx[0] * dv[0] + dx[1] * dv[1], dv[0] ** 2 + dv[1] ** 2
    c = max(dx[0] ** 2 + dx[1] ** 2 - sigma**2, Decimal(0))
    if b >= 0 or b * b <= a * c:
        return NEVER
    return c / ((b * b - a * c).sqrt() - b)


def reported(ricochet, folder, text) -> str:
    """Return the report of a collapse, or ''."""
    write_input(folder, text)
    run = ricochet(*COMMAND)
    said = re.search(r".*collapse.*", run.stdout + run.stderr)
    return said[0] if said else ""


@pytest.mark.parametrize("seed", range(60))
def test_a_run_reports_exactly_the_collapses(ricochet, tmp_path, seed):
    system = System(seed)
    assert bool(reported(ricochet, tmp_path, system.text())) == system.collapses()


@pytest.mark.parametrize("seed", range(12))
def test_a_run_of_rough_disks_reports_exactly_the_collapses(ricochet, tmp_path, seed):
    """Tangential impulses decide whether nearly aligned rough disks collapse."""
    system = RoughSystem(seed)
    assert bool(reported(ricochet, tmp_path, system.text())) == system.collapses()


@pytest.mark.check
def test_many_runs_report_exactly_the_collapses(ricochet, tmp_path):
    """720 systems are tested, with other seeds if the variable SEED is set, as in `make check`.

    Systems near a limit of collapse are excluded if the verdicts differ, because rounding errors
    can stop the time of a finite series there. A few rough systems are excluded elsewhere, but a
    run that continues never reports a collapse that is none.
    """
    first = 1000 * (1 + int(os.environ.get("SEED", "0")) % 10**6)
    excluded = 0
    for seed in range(first, first + 720):
        system = System(seed) if seed < first + 540 else RoughSystem(seed)
        said = reported(ricochet, tmp_path, system.text())
        if bool(said) != system.collapses():
            is_rough = isinstance(system, RoughSystem)
            allowed = is_rough and (not said or "time no longer advances" in said)
            assert allowed or system.is_near_a_limit(), seed
            excluded += 1
    assert excluded <= 50


@pytest.mark.parametrize("seed", range(100, 112))
def test_the_report_depends_on_no_order_threads_fall_or_binary_units(ricochet, tmp_path, seed):
    """The verdict is the same; binary units multiply the time of the collapse."""
    system = System(seed)
    said = reported(ricochet, tmp_path, system.text())
    order = system.rng.permutation(system.disks)
    assert bool(reported(ricochet, tmp_path, system.text(order))) == bool(said)
    assert reported(ricochet, tmp_path, system.text() + "&run threads = 2 /") == said
    falling = system.text().replace("&box ", "&box gravity = 0, -0.004 ")
    assert bool(reported(ricochet, tmp_path, falling)) == bool(said)
    length, time = (2.0 ** int(power) for power in system.rng.integers(-60, 60, 2))
    again = reported(ricochet, tmp_path, system.text(length=length, time=time))
    assert bool(again) == bool(said)
    if "occurred" in said:
        ends = [float(re.search(r"at time ([^;]+)", text)[1]) for text in (said, again)]
        assert ends[1] == pytest.approx(ends[0] * time, rel=1e-5)


#: Three disks with a collapse, 9 % below the limit: 18 of 41 collisions take no time.
THREE = """&box lower = -50, -1 upper = 50, 1 / &contact restitution = 0.065 /
&species radius = 0.1 position = -1, 0, 0, 0, 1.3, 0 velocity = 1, 0, 0, 0, -1.1, 0 /
&stop time = 10 /
"""


def test_a_run_in_parts_reports_the_same_collapse(ricochet, tmp_path):
    """The report is the same for a run in parts, for time slices and for a copy in memory."""
    write_input(tmp_path, THREE)
    run = ricochet("gas.nml", "-o", "gas.h5")
    note = re.search(r"\nnote = (.*)", run.stdout)[1]
    assert run.returncode == FINISHED and run.stderr.endswith(f"note: {note}\n")
    assert "collapsed" in read_run(tmp_path / "gas.h5").nature
    assert "18 collisions took no time" in note
    command = ["gas.nml", "-o", "parts.h5", "--quiet", "--set=stop.wall_clock=1e-9"]
    run = ricochet(*command)
    while run.returncode == STOPPED:
        run = ricochet(*command, "--resume")
    assert run.returncode == FINISHED and f"\nnote = {note}\n" in run.stdout
    disks, whole = (Simulation(tmp_path / "gas.nml") for _ in range(2))
    said = []
    for events in range(1, 42):
        disks = disks.advance(events=events).copy()
        said.append("collapsed" in disks.nature)
        assert said[-1] == ("collapsed" in whole.advance(events=events).nature)
    assert said == sorted(said) and not said[17] and said[-1]


def test_the_series_in_a_checkpoint_do_not_depend_on_the_order_in_the_queue(ricochet, tmp_path):
    write_input(
        tmp_path,
        """&run seed = 372281 /
        &box lower = 0.007441736661315069, -0.9738892615369732
          upper = 0.10744173666131507, 9.026110738463027 /
        &species count = 9 packing_fraction = 0.0037479192872135617 placement = 'dense' speed = 1 /
        &contact restitution = 0 wall_restitution = 0.4234442109596833 wall_rule = 'normal'
          tangential_restitution = 1 friction = 10
          wall_tangential_restitution = -0.24815727909603935 /
        &stop events = 10716 at_rest = .true. time = 10 /""",
    )
    for queue in "calendar", "heap":
        run = ricochet("gas.nml", "-o", f"{queue}.h5", "--quiet", f"--set=run.queue={queue}")
        assert run.returncode == FINISHED
    found = differences(tmp_path / "calendar.h5", tmp_path / "heap.h5")
    assert [name for name in found if "parameters" not in name] == []


def test_a_collapse_that_a_kick_or_a_change_prevents_is_not_reported(ricochet, tmp_path):
    """Changing the velocities after the first collisions of a collapse ends it."""
    write_input(tmp_path, THREE)
    disks = Simulation(tmp_path / "gas.nml")
    disks.advance(events=18)
    disks.velocity = disks.velocity + np.array([[-1, 0], [0, 0], [1, 0]])
    disks.advance(time=10)
    assert "collapsed" not in disks.nature


@pytest.mark.parametrize("restitution", [0.3, 0.8])
def test_a_long_series_is_stated_in_the_summary(ricochet, tmp_path, restitution):
    """The summary counts the endless collisions of two disks between a disk and a wall."""
    write_input(
        tmp_path,
        f"""&box upper = 2, 1 / &contact restitution = {restitution} wall_rule = 'normal' /
        &species radius = 0.0625 position = 0.5, 0.5, 1.5625, 0.5, 1.6875, 0.5, 1.8125, 0.5,
        1.9375, 0.5 velocity = 1, 0, 0, 0, 0, 0, 0, 0, 0, 0 / &stop time = 1.5 /""",
    )
    run = ricochet(*COMMAND)
    said = re.search(r"\nlongest_series = (\d+) collisions of (\d+) disks\n", run.stdout)
    assert bool(said) == (restitution < limit(5, 1)) == ("\nsimultaneous_collisions" in run.stdout)
    if said:
        assert int(said[1]) > 10 * int(said[2]) ** 2
