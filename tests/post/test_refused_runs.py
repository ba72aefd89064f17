"""Runs to which the law of a script does not apply, and the messages that refuse them."""

import numpy as np
import pytest

from gas_inputs import UNLIKE
from synthetic_run import refusal, run_script, write_run

HAFF = "smooth disks that only cool"


@pytest.mark.parametrize(
    ("script", "unlike", "words"),
    [
        ("haff", {"contact": {"restitution": 0.9, "tangential_restitution": 0.0}}, HAFF),
        ("haff", {"box": {"shear_rate": 1.0}}, HAFF),
        ("haff", {"drive": {"kind": "noise", "strength": 1.0}}, HAFF),
        ("haff", {"side/top": {"temperature": 1.0}}, HAFF),
        ("haff", {"contact": {"restitution": 1.0}}, "does not cool"),
        ("haff", {"walled": True}, "has walls"),
        ("haff", {"speed": 0.0}, "at rest"),
        ("rough", {}, "has smooth disks"),
        ("cooling", {"side/top": {"temperature": 1.0}}, "is not a freely cooling"),
        ("cooling", {"speed": 0.0}, "at rest"),
        ("crater", {"box": {"gravity": [0.0, -1.0]}}, "that is at rest"),
    ],
)
def test_runs_that_a_law_is_not_for_are_refused(tmp_path, capsys, script, unlike, words):
    """The runs differ in one trait from a gas that cools in a periodic box."""
    speed, walled = unlike.pop("speed", 1.0), unlike.pop("walled", False)
    groups = {"contact": {"restitution": 0.9}, **unlike}
    v, time = speed * np.ones((2, 4, 2)), np.array([0.0, 1.0])
    energy = {f"{name}/kinetic_energy": speed**2 * np.array([1.0, 0.9]) for name in ("all", "disk")}
    more = {"observables": {"collisions": [0, 4], **energy}, "periodic": (not walled, True)}
    path = write_run(tmp_path / "a.h5", 0 * v, v, time=time, parameters=groups, **more)
    assert run_script(script, path, "-o", tmp_path / "a.png") == 1
    said = capsys.readouterr().err
    assert words in said and said.startswith(f"{script}.py: {path}: ") and said.count("\n") == 1


LOSSY = {"restitution": 0.9}
SOFT = {"restitution": "0.9 restitution_law = 'power' reference_speed = 9"}
WALLS = {"sides": "'wall', 'periodic'"}
FALLING = {"sides": "'periodic', 'wall' gravity = 0, -1", "helfand": ".false."}
MIXED = {"packing": UNLIKE.format(1, 9)}
ROUND = {"sides": "'wall', 'wall' / &obstacle centre = 0.5, 0.5 radius = 0.5 side = 'inside'"}
APART = {"sides": "'wall', 'wall' / &wall from = 0.5, 0 to = 0.5, 1"}
APART |= {
    "packing": MIXED["packing"].replace("/", "region = 0, 0.5, 0, 1 /") + " region = 0.5, 1, 0, 1"
}
UNEVEN = {
    "sides": "'wall', 'periodic' / &side name = 'left' temperature = 1 / "
    "&side name = 'right' temperature = 2"
}
SETTLED = ("equation_of_state", "melting", "coverage", "transport", "gravity", "equipartition")


@pytest.mark.parametrize(
    ("unusual", "refused"),
    [
        (WALLS, {"transport": "driven.py --show viscosity", "melting": "has walls"}),
        ({"helfand": ".false."}, {"transport": "output.helfand"}),
        ({"length": 12}, {"transport": "eight collisions"}),
        (
            {"cadence": "frames_every_collisions = 500 observables_every_time = 0.02"},
            {"transport": "frames_every_time"},
        ),
        (
            {"cadence": "frames_every_time = 0.05 observables_every_collisions = 64"},
            {"transport": "observables_every_time"},
        ),
        (LOSSY, dict.fromkeys(SETTLED, "not elastic") | {"rough": "equal rough disks"}),
        (LOSSY | {"log": ".false."}, {"rates": "not elastic", "correlations": "draw them"}),
        (LOSSY | MIXED, {"mixture": "not elastic"}),
        (SOFT, {"rough": "velocity-dependent", "melting": "not elastic"}),
        (SOFT | MIXED, {"haff": "is a mixture of soft disks"}),
        (
            {"seed": 2, "cadence": "frames_every_collisions = 64"},
            {"correlations": "set output.frames_every_time"},
        ),
        ({"count": 32}, {"correlations": "analyse them separately"}),
        (ROUND | MIXED, {"mixture": "conserves angular momentum"}),
        (APART, {"mixture": "have not collided"}),
        (MIXED | {"count": 1, "packing": MIXED["packing"].replace("9", "1")}, {"mixture": "three"}),
        (UNEVEN, dict.fromkeys(SETTLED, "at different temperatures")),
        (FALLING, dict.fromkeys(("correlations", "rates", *SETTLED[:4]), "falls")),
        (MIXED, {"correlations": "not equal disks", "equation_of_state": "not equal or"}),
        (MIXED, {"melting": "disks of different mass or radius"}),
        ({}, {"equipartition": "needs ", "mixture": "needs "}),
    ],
)
def test_runs_that_a_script_is_not_for_are_refused(gas, tmp_path, capsys, unusual, refused):
    """The message is one line; scripts that compare runs also receive a suitable one."""
    path = gas(**{"length": 20} | unusual).path
    for script, said in refused.items():
        compared = script == "correlations" or unusual is MIXED
        usual = [gas("usual", length=20).path] if compared else []
        assert run_script(script, *usual, path, "-o", tmp_path / "no.png") in (1, 2)
        words = capsys.readouterr().err
        assert words.startswith(f"{script}.py: ") and words.count("\n") == 1
        assert said in words and str(path) in words


EVERY = " &output frames_every_time = 0.5 observables_every_time = 0.1 /"
NEEDY = (
    "correlations crater crater_scan equipartition gravity haff melting mixture rough scattering"
)


@pytest.mark.parametrize("script", [*NEEDY.split(), "speeds", "transport"])
def test_a_run_for_which_the_law_does_not_hold_is_refused_with_exit_1(simulated, capsys, script):
    """The runs have two equal disks between walls; errors of files and options exit with 2."""
    run = simulated("&species count = 2 radius = .05 speed = 1 / &stop time = 20 /" + EVERY)
    assert str(run.path) in refusal(capsys, script, run.path, code=1)
