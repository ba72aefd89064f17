"""Laws that hold for every run and input, tested with the contents of the output file.

`found` is the result of `whole_runs.contents`. Each law yields a deviation, in units of the allowed
rounding error; it holds if the deviation is below 1.
"""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

BALANCE = 1e-12  #: relative to the energy, the losses and the energy supplied
MOMENTUM = 1e-12  #: relative to the sum of m |v| over all disks
GAP = 1e-9  #: relative to the contact distance
PLACE = 1e-12  #: rounding error of positions, relative to the largest coordinate
SIDES = ("left", "right", "bottom", "top")

Found = dict[str, np.ndarray]


def laws_broken(found: Found) -> Iterator[str]:
    """Yield each violated law with the size of the violation."""
    laws = {
        "energy": imbalance(found) / BALANCE,
        "momentum": momentum_drift(found) / MOMENTUM,
        "disks and walls apart": depth(found),
        "log": log_error(found),
        "observables": observable_error(found),
    }
    for law, part in laws.items():
        if not part < 1:
            yield f"{law}: {part:g} times what is allowed"


def series(found: Found, name: str) -> np.ndarray:
    """Return all samples of an observable, none if it is not in the file."""
    return found.get(f"/observables/{name}/value", np.empty(0))


def of_box(found: Found) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return lower corner, edge lengths, and whether the axes are periodic."""
    box = "/particles/disks/box"
    return found[f"{box}/lower"], found[f"{box}/edges"], found[f"{box}@boundary"] == b"periodic"


def is_open(found: Found) -> bool:
    """Return whether disks can leave or enter the box."""
    return "/observables/inside/value" in found


def imbalance(found: Found) -> float:
    """Return the error of the energy balance, relative to its largest term.

    Terms that cancel count in full: kinetic and potential energy, noise kicks whose momentum is
    removed again, and the kT that a thermal wall transfers in one collision and may take back in
    the next.
    """
    signs = {"total_energy": 1, "dissipated_energy": 1, "heat": -1, "work": -1, "drive_energy": -1}
    signs |= {"outflow_energy": 1, "inflow_energy": -1}
    terms = {name: series(found, name) for name in signs if f"/observables/{name}/value" in found}
    balance = sum(signs[name] * values for name, values in terms.items())
    mass = found["/particles/disks/mass"]
    kick = [found.get(f"/parameters/drive@{name}", 0) for name in ("strength", "interval")]
    bath = ("@temperature", "parameters/wall/temperature", "parameters/obstacle/temperature")
    inside = series(found, "inside") if is_open(found) else len(mass)
    kinetic = np.nan_to_num(inside * series(found, "all/kinetic_energy"))  # a mean in the file
    parts = [kinetic, terms["total_energy"] - kinetic, *terms.values()]
    parts += [mass.max() * np.prod(kick), *(x for name, x in found.items() if name.endswith(bath))]
    most = max(np.nanmax(np.abs(part), initial=0) for part in parts)
    return np.ptp(balance) / most if most else 0.0


def momentum_drift(found: Found) -> float:
    """Return the largest change of a conserved momentum, relative to the sum of m |v|."""
    drive = found["/parameters/drive@kind"] != b"none"
    kept = of_box(found)[2].all() and not found.get("/parameters/box@shear_rate")
    kept = kept and not is_open(found)
    if not kept or "/parameters/wall/name" in found or "/parameters/obstacle/name" in found:
        return 0.0
    if drive and not found.get("/parameters/drive@keep_momentum"):
        return 0.0
    mass, speed = found["/particles/disks/mass"], series(found, "all/mean_speed")
    scale = mass.max() * len(mass) * speed.max()
    return np.ptp(series(found, "momentum"), axis=0).max() / scale if scale else 0.0


# --- places ---


def depth(found: Found) -> float:
    """Return the largest overlap of disks and walls, or 0 if time steps allow overlaps."""
    if found["/parameters/run@dynamics"] == b"steps":
        return 0.0
    places = found["/particles/disks/position/value"]
    lower, edges, _ = of_box(found)
    # A piston can push disks out of the box.
    farthest = max(np.max(np.abs([lower, lower + edges])), np.max(np.abs(places), initial=0))
    known = (PLACE if places.dtype == np.float64 else 1e-6) * farthest
    deepest = 0.0
    for time, place in zip(found["/particles/disks/position/time"], places, strict=True):
        for gap, width in (*pair_gaps(found, time, place), *wall_gaps(found, time, place)):
            deepest = max(deepest, np.max(-gap / (GAP * width + known), initial=0))
    return deepest


def of_present(found: Found, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return radii and positions of the disks in the box."""
    inside = np.isfinite(place[:, 0])
    return found["/particles/disks/radius"][inside], place[inside]


def has_lid(found: Found, side: str) -> bool:
    """Return whether a side is open, or may be opened by a change."""
    is_open = found.get(f"/parameters/side/{side}@open", 0)
    return bool(is_open) or f"{side}.open=".encode() in bytes(found.get("/parameters/changes", b""))


def pair_gaps(found: Found, time: float, place: np.ndarray) -> Iterator[tuple]:
    """Yield gaps and contact distances of close pairs, each found from its larger disk."""
    lower, edges, periodic = of_box(found)
    radius, place = of_present(found, place)
    if not len(place):
        return
    rows = [(0.0, 0.0)]
    if periodic[1]:
        slide = found.get("/parameters/box@shear_rate", 0) * edges[1] * time
        rows = [(k * slide, k * edges[1]) for k in (-1, 0, 1)]
    images = np.concatenate([place - lower + row for row in rows])
    whose = np.tile(np.arange(len(place)), len(rows))
    if periodic[0]:
        images[:, 0] %= edges[0]
        images[images[:, 0] >= edges[0], 0] = 0
    tree = cKDTree(images, boxsize=[edges[0] if periodic[0] else 0, 0])
    near = tree.query_ball_point(place - lower, 2 * radius * (1 + GAP))
    one = np.repeat(np.arange(len(place)), [len(found) for found in near])
    other = np.concatenate(near).astype(int)
    pairs = one != whose[other]
    one, other = one[pairs], other[pairs]
    apart = images[other] - (place - lower)[one]
    if periodic[0]:
        apart[:, 0] -= edges[0] * np.round(apart[:, 0] / edges[0])
    contact = radius[one] + radius[whose[other]]
    yield np.hypot(*apart.T) - contact, contact


def wall_gaps(found: Found, time: float, place: np.ndarray) -> Iterator[tuple]:
    """Yield the gaps of all disks to each wall, and their radii."""
    lower, edges, periodic = of_box(found)
    radius, place = of_present(found, place)
    for k, name in enumerate(SIDES):
        if has_lid(found, name):  # centres reach its line while it is open
            inwards = (place[:, k // 2] - lower[k // 2]) * (-1) ** k + (k % 2) * edges[k // 2]
            yield inwards, radius
        elif not periodic[k // 2]:
            inwards = place[:, k // 2] - lower[k // 2]
            if k % 2:
                inwards = edges[k // 2] - inwards
            yield inwards - shift_of(found, name, time) - radius, radius
    images = [np.array([x, y]) * edges for x in (-1, 0, 1) for y in (-1, 0, 1)]
    images = [image for image in images if not image[~periodic].any()]
    circles, circle_groups = rows_of(found, "obstacle", "centre", "radius")
    walls, _ = rows_of(found, "wall", "from", "to")
    insides = np.array(found.get("/parameters/obstacle/inside", ()))[circle_groups]
    angles = angles_of(found)[circle_groups]
    for image in images:
        for centre, size, inside, (first, last) in zip(*circles, insides, angles, strict=True):
            if np.isfinite(first):
                yield from_arc(place - centre - image, size, first, last) - radius, radius
                continue
            away = np.linalg.norm(place - centre - image, axis=1) - size
            yield (-away if inside else away) - radius, radius
        for begin, end in zip(*walls, strict=True):
            along, start = end - begin, place - begin - image
            part = np.clip(start @ along / (along @ along), 0, 1)
            yield np.linalg.norm(start - part[:, None] * along, axis=1) - radius, radius


def angles_of(found: Found) -> np.ndarray:
    """Return the angles (groups, 2) of the arc in each group of obstacles; NaN for circles."""
    none = np.full(len(found.get("/parameters/obstacle/inside", ())), np.nan)
    names = ("from_angle", "to_angle")
    return np.stack([found.get(f"/parameters/obstacle/{name}", none) for name in names], axis=1)


def from_arc(away: np.ndarray, size: float, first: float, last: float) -> np.ndarray:
    """Return the distances of points from an arc around the origin with the given angles."""
    angle = np.degrees(np.arctan2(away[:, 1], away[:, 0]))
    ends = [size * np.array([np.cos(a), np.sin(a)]) for a in np.radians([first, last])]
    to_ends = np.min([np.linalg.norm(away - end, axis=1) for end in ends], axis=0)
    faces = (angle - first) % 360 <= last - first
    return np.where(faces, np.abs(np.linalg.norm(away, axis=1) - size), to_ends)


def rows_of(found: Found, kind: str, *names: str) -> tuple[list, np.ndarray]:
    """Return values of all circles or straight walls, and the index of the group of each.

    If a group has several of them, the values are in a separate table.
    """
    table = f"/parameters/{kind}_rows"
    if f"{table}/group" in found:
        return [found[f"{table}/{name}"] for name in names], found[f"{table}/group"] - 1
    values = [found.get(f"/parameters/{kind}/{name}", ()) for name in names]
    return values, np.arange(len(values[0]))


def shift_of(found: Found, side: str, time: float) -> float:
    """Return the inward displacement of a side from its mean position."""
    kind, amplitude, period, phase = (
        found.get(f"/parameters/side/{side}@{name}", 0)
        for name in ("motion", "amplitude", "period", "phase")
    )
    k, (lower, edges, _) = SIDES.index(side), of_box(found)
    end = (lower, lower + edges)[k % 2][k // 2]
    offset = (found.get(f"/parameters/side/{side}@position", end) - end) * (-1) ** k
    if kind == b"piston":
        path, ends = f"/observables/sides/{side}/position", (lower, lower + edges)
        at = [place - ends[k % 2][k // 2] for place in found[f"{path}/value"]]
        known = found[f"{path}/time"] == time
        return float(np.ravel(at)[known][-1] * (-1) ** k) if np.any(known) else -np.inf
    if kind == b"constant_velocity":
        speed, begin, end = (
            found[f"/parameters/side/{side}@{name}"]
            for name in ("velocity", "start_time", "end_time")
        )
        return offset + speed * (min(max(time, begin), end) - begin)
    if kind == b"sine":
        return amplitude * np.sin(2 * np.pi * (time / period + phase))
    if kind == b"parabolic":
        s = (time / period + phase) % 1
        return amplitude * (16 * s * (0.5 - s) if s < 0.5 else 16 * (s - 0.5) * (s - 1))
    return offset


# --- what is written twice ---


def log_error(found: Found) -> float:
    """Return the deviation of the log from counts and sums for each disk and each wall."""
    if "/events/j" not in found:
        return 0.0
    i, j = found["/events/i"], found["/events/j"]
    codes = {f"sides/{name}": [-k] for k, name in enumerate(SIDES)}
    code = -len(SIDES)
    for kind, place in (("obstacle", "centre"), ("wall", "from")):
        names = found.get(f"/parameters/{kind}/name", ())
        # several rows have one boundary id each, and a common sum
        for group in rows_of(found, kind, place)[1]:
            codes.setdefault(f"obstacles/{names[group].decode()}", []).append(code)
            code -= 1
    change = found["/events/momentum_change"]
    wrong = [np.sum(np.diff(found["/events/time"]) < 0)]
    wrong.append(np.sum(j > 0) - series(found, "collisions")[-1])
    if "/particles/disks/event_count/value" in found:
        of_disks = found["/particles/disks/event_count/value"][-1]
        mine = np.bincount(np.concatenate([i, j[j > 0]]), minlength=len(of_disks) + 1)
        wrong += list(mine[1:] - of_disks)
    for name, rows in codes.items():
        count, last = series(found, f"{name}/collisions"), series(found, f"{name}/impulse")
        if len(count):
            struck = np.isin(j, rows)
            left = series(found, f"{name}/left")  # departures are events, but not collisions
            wrong.append(np.sum(struck) - count[-1] - (left[-1] if len(left) else 0))
            mine = change[struck]
            scale = 1e-12 * np.abs(mine).sum() + 1e-300
            wrong += list((mine.sum(axis=0) + last[-1]) / scale)
    return max(np.abs(wrong))


def observable_error(found: Found) -> float:
    """Return the deviation of the final observables from values computed with the last frame."""
    v, mass = found["/particles/disks/velocity/value"][-1], found["/particles/disks/mass"]
    inside = np.isfinite(v[:, 0])
    if v.dtype != np.float64 or not inside.any():
        return 0.0
    v, mass = v[inside], mass[inside]
    speed = np.hypot(*v.T)
    pairs = [
        (series(found, "all/kinetic_energy")[-1], mass * speed**2 / 2 / len(mass)),
        (series(found, "all/mean_speed")[-1], speed / len(mass)),
        *zip(series(found, "momentum")[-1], (mass[:, None] * v).T, strict=True),
    ]
    if "/particles/disks/angular_velocity/value" in found:
        spin = found["/particles/disks/angular_velocity/value"][-1][inside]
        square = mass * found["/particles/disks/radius"][inside] ** 2 * spin**2
        energy = found["/parameters/contact@inertia"] * square / 2 / len(mass)
        pairs.append((series(found, "all/rotational_energy")[-1], energy))
    return max(abs(told - one.sum()) / (1e-12 * np.abs(one).sum() + 1e-300) for told, one in pairs)
