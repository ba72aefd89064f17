"""Fields of density, flow, temperature and stress, and the script fields."""

import re

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from scipy.stats import binom

from gas_inputs import PERIODIC
import ricochet
from ricochet import RunError, estimates, fields, hard_disks as hd, statistics, thermodynamics as td
from synthetic_run import ROOT, drawn, run_script, written

SHEARED = """&box upper = 20, 10 boundary = 'wall', 'periodic' /
&side name = 'left' temperature = 2 /
&side name = 'right' temperature = 2 surface_velocity = {speed} /
&species count = 40 radius = 0.5 temperature = 2 /
&stop time = 1600 / &output frames_every_time = 4 observables_every_time = 4 /
"""


def test_fields_are_those_of_the_disks_in_each_cell(tmp_path):
    """Two disks in the left half have equal velocities; two in the right half separate."""
    position = np.array([[[0.1, 0.2], [0.2, 0.8], [0.7, 0.2], [0.8, 0.8]]] * 8)
    velocity = np.array([[[1.0, 2.0], [1.0, 2.0], [3.0, 2.0], [-1.0, 2.0]]] * 8)
    run = written(tmp_path / "a.h5", position, velocity, periodic=PERIODIC, radius=0.1)
    found = {name: one.mean for name, one in fields.fields([run], None, (2, 1)).found.items()}
    assert found["density"] == pytest.approx(4)
    assert found["flow_x"] == pytest.approx(1) and found["flow_y"] == pytest.approx(2)
    assert 3 / 4 * found["temperature"] == pytest.approx([0, 2]) == found["stress_xx"] / 8
    assert found["stress_yy"] == pytest.approx(0) and found["heat_x"] == pytest.approx(0)
    leaves = {"side/top": {"motion": "piston"}}
    gone = written(tmp_path / "b.h5", position, velocity, parameters=leaves)
    with pytest.raises(RunError, match="moves away"):
        fields.fields([gone], None, (2, 1))


@pytest.mark.parametrize(
    ("cells", "shear"), [((16, 12), 0.0), ((16, 12), 0.5), ((4, 1), 0.0), ((1, 4), 0.5)]
)
def test_fields_of_few_values_have_no_bias_and_their_errors_hold(tmp_path, rng, cells, shear):
    """Random velocities and positions between walls, with kT = 2 and uniform accessible density.

    The mean flow does not contribute to the temperature, even in cells with few disks.
    """
    place = rng.uniform(0.1, [3.9, 2.9], (300, 60, 2))
    v = rng.normal(size=place.shape) + shear * np.stack([place[..., 1], 0 * place[..., 1]], axis=-1)
    v *= np.sqrt(2)
    run = written(tmp_path / "a.h5", place, v, radius=0.1, edges=(4, 3))
    own = fields.fields([run], None, cells)
    even = {"density": 60 / (3.8 * 2.8), "temperature": 2, "flow_y": 0}
    held = []
    for name, truth in even.items():
        mean, error = own.found[name]
        held.append(np.abs(mean - truth) < error)
        off = (np.average(mean, weights=own.disks) - truth) * np.sqrt(own.disks.sum())
        assert abs(off) < 4 * max(2, truth / 2) or name == "density"
    assert np.mean(held) == pytest.approx(0.68, abs=5 * 0.47 / np.sqrt(np.size(held)))


@pytest.mark.statistics
def test_errors_of_a_flow_of_bounded_displacements_are_its_scatter(tmp_path, rng):
    """A part of each velocity is the change of a bounded displacement between two frames."""
    place = np.broadcast_to(rng.uniform(0.1, 0.9, (40, 2)), (160, 40, 2))
    found = []
    for k in range(60):
        v = 0.4 * np.diff(rng.normal(size=(161, 40, 2)), axis=0)
        v += 0.3 * rng.normal(size=place.shape)
        run = written(tmp_path / f"{k}.h5", place, v, radius=0.1)
        own = fields.fields([run], None, (2, 2)).found
        found.append([own["flow_x"], own["flow_y"]])
    mean, error = np.moveaxis(found, 2, 0)
    assert np.mean(error) < 1.15 * np.sqrt(np.mean(mean**2))
    assert np.mean(np.abs(mean) < error) == pytest.approx(0.6827, abs=0.06)


def test_cells_in_which_few_disks_were_have_no_error_of_nothing(tmp_path, rng):
    """One disk in each of two blocks determines only the flow; an empty cell has no error of 0."""
    place = np.full((32, 4, 2), 0.1)
    place[[18, 30], 3, 0] = 0.5
    run = written(tmp_path / "a.h5", place, rng.normal(size=place.shape), periodic=PERIODIC)
    own = fields.fields([run], None, (3, 1))
    assert own.disks.tolist() == [62, 2, 0] and len(own.blocks) > 3
    assert own.found["density"].mean == pytest.approx(np.array([62, 2, 0]) * 3 / 16)
    assert own.found["density"].error[2] == pytest.approx(3 / 16)
    for name in ("temperature", "stress_xx", "heat_x"):
        assert np.isfinite(own.found[name]).tolist() == [[True, False, False]] * 2


def test_a_map_of_a_round_container_is_drawn_in_it(tmp_path, rng):
    place = rng.uniform(0.3, 0.7, (16, 9, 2))
    v, held = rng.normal(size=place.shape), [((0.5, 0.5), 0.5, 1)]
    run = written(tmp_path / "a.h5", place, v, obstacles=held)
    axes = ricochet.analyse("fields", run, grid=(2, 2)).figure().axes[0]
    (shown,) = (one for one in axes.collections if isinstance(one, QuadMesh))
    assert shown.get_clip_path() and axes.patches[-1].zorder < shown.zorder


def test_the_area_that_centres_can_reach(tmp_path):
    """Strips one radius wide along walls, and around circles and straight walls, are excluded."""
    one = np.full((2, 1, 2), 0.5)
    parts = {"radius": 0.1, "edges": (4, 2), "obstacles": [((1.0, 1.0), 0.4, 0)]}
    parts |= {"walls": [((3.0, 1.0), (3.4, 1.0))], "periodic": (True, False)}
    run = written(tmp_path / "a.h5", one, 0 * one, **parts)
    area = fields.accessible(run, (2, 1), 0.1)
    stadium = 0.4 * 0.2 + np.pi * 0.1**2
    assert area == pytest.approx([3.6 - np.pi * 0.5**2, 3.6 - stadium], rel=2e-3)


GASES = {  # input, cells and the known kT
    "still": ("""&box upper = 40, 20 / &stop time = 200 /
        &species count = 400 radius = 0.5 temperature = 1 /""", (8, 12),
        lambda run: td.temperature(run).mean),
    "falling": ("""&box upper = 20, 60 gravity = 0, -0.1 boundary = 'periodic', 'wall' /
        &side name = 'bottom' temperature = 2 / &stop time = 800 /
        &species count = 200 radius = 0.5 temperature = 2 /""", (1, 20), lambda run: 2.0),
    "sheared": ("""&box upper = 80, 40 shear_rate = 0.1 boundary = 'periodic', 'periodic' /
        &contact restitution = 0.8 / &stop time = 400 /
        &species count = 200 radius = 0.5 temperature = 1 /""", (5, 3),
        lambda run: np.mean(run.observable("all/temperature").value[-51:])),
    "couette": ("couette.nml", (1, 20), None),
}  # fmt: skip


@pytest.mark.parametrize(
    ("gas", "seeds"),
    [*((name, 4) for name in ("still", "falling", "sheared"))]
    + [pytest.param(name, 30, marks=pytest.mark.check) for name in GASES],
)
def test_fields_of_gases_have_the_temperature_that_is_known(simulated, gas, seeds):
    """The error bars of a run contain the mean of many seeds with the stated probability."""
    text, cells, truth = GASES[gas]
    output = "&output frames_every_time = 4 observables_every_time = 4 /"
    system = ROOT / "input" / text if text.endswith("nml") else f"{text}\n{output}\n"
    runs = [simulated(system, f"run.seed={k + 1}", name=f"{gas}{k}") for k in range(seeds)]
    own = [fields.fields([run], None, cells) for run in runs]
    if truth is not None:
        pairs = [(one.found["temperature"].mean, one.disks) for one in own]
        known = [np.isfinite(kt) for kt, _ in pairs]
        kt = [np.average(k[ok], weights=n[ok]) for (k, n), ok in zip(pairs, known, strict=True)]
        off = statistics.estimate(np.array(kt) / [truth(run) for run in runs])
        assert off.mean == pytest.approx(1, abs=4 * off.error)
    low, high = binom.interval(0.999, seeds, 2 * estimates.ONE_SIGMA - 1)
    for name in own[0].found if seeds > 4 else ():
        mean, error = np.moveaxis([one.found[name] for one in own], 1, 0)
        held = np.where(np.isfinite(error), np.abs(mean - np.nanmean(mean, 0)) < error, np.nan)
        assert low / seeds <= np.nanmean(held) <= high / seeds, name


def test_the_law_carries_the_fluxes_and_is_a_gas_at_rest_without(simulated):
    """Gradients times viscosity and conductivity equal the fluxes at the walls."""
    run, eta = simulated(SHEARED.format(speed=0)), 0.3
    flux = fields.Fluxes(4 * eta / np.pi * 2 * hd.henderson(eta), 0.0, 0.0)
    law = fields.expected(run, 0, np.linspace(1, 19, 7), flux, (0.5, 2.0))
    assert law == pytest.approx(np.tile([0.5, 2, 4 * eta / np.pi], (7, 1)))
    flux, x = fields.Fluxes(1.2, -0.05, 0.1), np.linspace(1, 19, 181)
    u, kt, density = fields.expected(run, 0, x, flux, (0.0, 2.0)).T
    eta = np.pi * density / 4
    z = hd.henderson(eta)
    assert density * kt * z == pytest.approx(1.2)
    gas = hd.enskog(z, eta, 1.0, kt)
    shear, heat = -gas["viscosity"] * np.gradient(u, x), -gas["conductivity"] * np.gradient(kt, x)
    assert shear[1:-1] == pytest.approx(-0.05, rel=1e-3)
    assert (heat + shear * u)[1:-1] == pytest.approx(0.1, rel=2e-3)


def test_a_profile_and_a_map_are_drawn_with_their_numbers(simulated, tmp_path, capsys):
    path = simulated(SHEARED.format(speed=3)).path
    rows = drawn(tmp_path, "fields", path, "--cells", "5")
    found = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    assert found["x"] == pytest.approx([2.25, 6, 10, 14, 17.75]), "middles of where centres are"
    assert np.average(found["density"], weights=[3.5, 4, 4, 4, 3.5]) == pytest.approx(40 / 190)
    assert (found["density_error"] > 0).all() and found["flow_y"][-1] > found["flow_y"][0]
    assert np.isfinite(found["flow_expected"]).all()
    assert len(drawn(tmp_path, "fields", path, "--grid", "4,2")) == 8
    soon = ("stop.time=20", "output.frames_every_time=2", "output.observables_every_time=2")
    early = simulated(ROOT / "input/fourier.nml", *soon, name="early").path
    assert "flow_expected" not in drawn(tmp_path, "fields", early)[0]
    assert "warning: no profile agrees with these fluxes" in capsys.readouterr().err


def test_the_oscillation_of_a_bed_is_told_apart_from_heat(tmp_path, rng, capsys):
    """The mean velocity along y oscillates with an amplitude of 2, and kT is 1."""
    place = rng.uniform(0.1, 0.9, (300, 60, 2))
    v = rng.normal(size=place.shape)
    calm = written(tmp_path / "calm.h5", place, v, radius=0.01).path
    v[..., 1] += 2 * np.sin(0.7 * np.arange(300))[:, None]
    kinds = {"species": np.repeat([1, 2], 30), "names": ("grain", "other")}
    bed = written(tmp_path / "bed.h5", place, v, radius=0.01, **kinds).path
    given = ((calm, {}), (bed, {"species": "grain"}))
    shown = [ricochet.analyse("fields", path, across="y", **more).figure() for path, more in given]
    labels = [figure.axes[2].get_legend_handles_labels()[1] for figure in shown]
    assert labels == [["measured"], ["kT", "kT, x", "kT, y"]]
    assert "fields of the species 'grain' (30 disks)" in shown[1].get_suptitle()
    drawn(tmp_path, "fields", calm)
    assert capsys.readouterr().err == ""
    drawn(tmp_path, "fields", bed, "--species", "grain")
    share = "centre of mass is 6[5-9] % of kT_y"  # 2 of 3
    assert re.search(share, capsys.readouterr().err)


def test_the_help_states_which_frames_are_used(capsys):
    assert run_script("fields", "--help") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "equilibration (collisions per disk) [first half]" in said and "no drift" not in said


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ((), ""),
        (("contact.restitution=0.9",), "is not elastic"),
        (("box.boundary='wall','wall'",), "also has walls across y"),
    ],
)
def test_missing_predictions_have_a_reason(simulated, settings, reason):
    more = ("stop.time=40", *settings)
    run = simulated(SHEARED.format(speed=0), *more)
    notes = [note for note in ricochet.analyse("fields", [run], cells=5).notes if "No pred" in note]
    assert len(notes) == bool(reason) and all(reason in note for note in notes)
