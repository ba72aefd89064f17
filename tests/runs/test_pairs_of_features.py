"""Two features at a time: together they run and keep the balance of energy, or a line names both.

Each feature is a variable of walls, rough disks, kicks or shear with what it needs, or something
that it may meet: periodic sides, gravity, time steps, stop rules.  Alone each of them is accepted,
so what is refused of a pair is the two together.  All pairs are checked, some of them run; random
systems (test_random_systems.py) run many features at a time.
"""

import random
import re

import pytest

from run_laws import imbalance
from whole_runs import FINISHED, USAGE, contents, write_input

Settings = dict[str, dict[str, str]]  # by group, or group and name of the repeated ones

BASE: Settings = {
    "species gas": {"count": "40", "radius": "0.02", "temperature": "1"},
    "contact": {"restitution": "0.95"},
    "stop": {"time": "0.5", "events": "600"},
    "output": {"observables_every_events": "100"},
}
PLACES = {
    "obstacle post": {"centre": "0.7, 0.7", "radius": "0.1"},
    "wall ramp": {"from": "0.2, 0.1", "to": "0.5, 0.3"},
}
PERIODIC = "'periodic', 'periodic'"
NORMAL, ROUGH = {"rule": "'normal'"}, {"rule": "'normal'", "tangential_restitution": "0.3"}
LAWS = {
    "restitution": {"restitution": "0.7"},
    "rule": NORMAL,
    "tangential_restitution": ROUGH,
    "friction": {**ROUGH, "friction": "0.2"},
    "temperature": {"temperature": "2"},
    "speed": {**ROUGH, "speed": "0.5"},
    "speed, thermal": {"temperature": "2", "speed": "-0.5"},
}
SINE = {"motion": "'sine'", "amplitude": "0.03", "period": "0.4"}
MOTIONS = {
    "motion": {**SINE, "motion": "'parabolic'"},
    "amplitude": SINE,
    "period": SINE,
    "phase": {**SINE, "phase": "0.3"},
    "velocity": {"motion": "'sawtooth'", "velocity": "0.5"},
}
GRIP = {"tangential_restitution": "0.4"}
KICKS = {"interval": "0.02", "temperature": "2"}
NOISE = {"kind": "'noise'", "interval": "0.02", "strength": "3"}
ACTIVE = {**KICKS, "kind": "'active'", "speed": "1"}
CONTACT = {
    "tangential_restitution": GRIP,
    "friction": {**GRIP, "friction": "0.3"},
    "inertia": {**GRIP, "inertia": "0.3"},
    "wall_tangential_restitution": {
        "wall_rule": "'normal'", "wall_tangential_restitution": "0.2"
    },
    "wall_friction": {**GRIP, "wall_rule": "'normal'", "wall_friction": "0.2"},
    "wall_restitution": {"wall_restitution": "0.8"},
    "wall_rule": {"wall_rule": "'normal'"},
    "contact_time": {"contact_time": "1e-4"},
    "pair_restitution": {"pair_restitution": "0.9"},
}  # fmt: skip
DRIVE = {
    "kind": {**KICKS, "kind": "'brownian'"},
    "fraction": {**KICKS, "kind": "'andersen'", "fraction": "0.3"},
    "strength": NOISE,
    "keep_momentum": {**NOISE, "keep_momentum": ".true."},
    "species": {**NOISE, "species": "'gas'"},
    "speed": ACTIVE,
    "rotational_diffusion": {**ACTIVE, "rotational_diffusion": "0.7"},
}
OTHERS = {
    "box.shear_rate": {"box": {"shear_rate": "0.8", "boundary": PERIODIC}},
    "box.boundary": {"box": {"boundary": PERIODIC}},
    "box.boundary, one": {"box": {"boundary": "'wall', 'periodic'"}},
    "box.gravity": {"box": {"gravity": "0, -1"}},
    "run.dynamics": {"run": {"dynamics": "'steps'", "dt": "1e-3"}},
    "run.search": {"run": {"search": "'rescan'"}},
    "species.angular_velocity": {"species gas": {"angular_velocity": "3"}},
    "species.rotational_temperature": {"species gas": {"rotational_temperature": "2"}},
    "species.placement": {"species gas": {"placement": "'dense'"}},
    "species.exact_temperature": {"species gas": {"exact_temperature": "1"}},
    "stop.energy_fraction": {"stop": {"energy_fraction": "0.3"}},
    "output.virial_tensor": {"output": {"virial_tensor": ".true."}},
    "output.event_log": {"output": {"event_log": ".true."}},
}
SIDES = ("left", "right", "bottom", "top")
PART = 0.2  #: of the pairs that run
FEATURES = [
    *(f"{kind}.{name}" for kind in ("side", "obstacle", "wall") for name in LAWS),
    *(f"side.{name}" for name in MOTIONS),
    *(f"contact.{name}" for name in CONTACT),
    *(f"drive.{name}" for name in DRIVE),
    *OTHERS,
]


def settings_of(feature: str, rng: random.Random) -> Settings:
    """What a feature sets; a side is any of the four."""
    if feature in OTHERS:
        return OTHERS[feature]
    group, _, name = feature.partition(".")
    if group in ("contact", "drive"):
        return {group: (CONTACT if group == "contact" else DRIVE)[name]}
    if group == "side":
        return {f"side {rng.choice(SIDES)}": LAWS.get(name) or MOTIONS[name]}
    key = {"obstacle": "obstacle post", "wall": "wall ramp"}[group]
    return {key: PLACES[key] | LAWS[name]}


def merged(*parts: Settings) -> Settings | None:
    """All settings together; None if two of them give a variable two values."""
    found: Settings = {}
    for part in parts:
        for group, values in part.items():
            own = found.setdefault(group, {})
            if any(own.get(name, value) != value for name, value in values.items()):
                return None
            own.update(values)
    return found


def text_of(settings: Settings) -> str:
    """As an input file."""
    lines = []
    for key, values in settings.items():
        group, _, name = key.partition(" ")
        words = [f"name = '{name}'"] if name else []
        words += [f"{variable} = {value}" for variable, value in values.items()]
        lines.append(f"&{group} {' '.join(words)} /")
    return "\n".join(lines) + "\n"


def is_named(settings: Settings, line: str) -> bool:
    """Whether a message names a variable of these settings, or their group as such."""
    words = [rf"\b{name}\b" for values in settings.values() for name in values]
    words += [rf"(&{key.split()[0]}|{key.split()[0]}\.name)\b" for key in settings if " " in key]
    return any(re.search(word, line) for word in words)


def fault(ricochet, folder, settings: Settings, *features: Settings, runs: bool) -> str:
    """What is wrong with how the program takes the features; empty if nothing is."""
    write_input(folder, text_of(settings))
    done = ricochet("gas.nml", "--check")
    if done.returncode == USAGE:
        lines = done.stderr.splitlines()
        told = all(is_named(feature, line) for line in lines for feature in features)
        return "" if lines and told and len(features) > 1 else done.stderr
    if runs and done.returncode == FINISHED:
        done = ricochet("gas.nml", "-o", "gas.h5", "--force", "--quiet")
    notes = [line for line in done.stderr.splitlines() if not line.startswith("warning:")]
    if done.returncode != FINISHED or notes:
        return f"ends with {done.returncode}: {done.stderr}"
    part = imbalance(contents(folder / "gas.h5")) if runs else 0
    return "" if part < 1e-12 else f"is out of balance by {part:g}"


@pytest.mark.parametrize("feature", FEATURES)
def test_a_feature_goes_with_every_other_or_is_refused_by_the_names_of_both(
    ricochet, tmp_path, feature
):
    own = settings_of(feature, random.Random(feature))
    faults = {"nothing": fault(ricochet, tmp_path, merged(BASE, own), own, runs=True)}
    for other in FEATURES[FEATURES.index(feature) + 1 :]:
        rng = random.Random(f"{feature} {other}")
        pair = [settings_of(name, rng) for name in (feature, other)]
        seed = {"run": {"seed": str(rng.randint(1, 10**6))}}
        if (settings := merged(BASE, seed, *pair)) is not None:
            runs = rng.random() < PART
            faults[other] = fault(ricochet, tmp_path, settings, *pair, runs=runs)
    bad = {name: text for name, text in faults.items() if text}
    assert not bad, "\n".join(f"{feature} and {name}: {text}" for name, text in bad.items())


def test_every_variable_of_walls_contacts_and_kicks_is_a_feature(ricochet):
    """Apart from those that say which wall it is, and where."""
    text = ricochet("--print-defaults").stdout
    names = {feature.partition(",")[0] for feature in FEATURES}
    names |= {f"{group}.name" for group in ("side", "obstacle", "wall")}
    names |= {"obstacle.centre", "obstacle.radius", "obstacle.side", "wall.from", "wall.to"}
    names |= {"contact.restitution", "drive.interval", "drive.temperature"}
    for group in ("side", "obstacle", "wall", "contact", "drive"):
        body = re.search(rf"&{group}\n(.*?)\n(?:! )?/", text, re.DOTALL)[1]
        variables = re.findall(r"^[! ]*?(\w+) = ", body, re.MULTILINE)
        assert len(variables) > 5
        assert not {f"{group}.{name}" for name in variables} - names
