"""Profiles and maps of fields, and the temperatures of rough disks."""

import csv
import sys
import warnings

import numpy as np
import pytest

import fields
import rough
from ricochet import hard_disks, read_run, theory
from ricochet.drawing import plt
from synthetic_run import ROOT, run_script, write_run
from whole_runs import FINISHED, write_input

WALLS = """&box upper = 20, 10 boundary = 'wall', 'periodic' /
&side name = 'left' temperature = 2 / &side name = 'right' temperature = 2 speed = {speed} /
&species count = 40 radius = 0.5 temperature = 2 /
&stop time = 100 / &output frames_every_time = 1 observables_every_time = 1 /
"""


def columns(path):
    with path.open() as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def test_fields_are_those_of_the_disks_in_each_cell(tmp_path):
    """Two disks in the left half that move together, two in the right half that part."""
    position = np.array([[[0.1, 0.2], [0.2, 0.8], [0.7, 0.2], [0.8, 0.8]]] * 4)
    velocity = np.array([[[1.0, 2.0], [1.0, 2.0], [3.0, 0.0], [-1.0, 0.0]]] * 4)
    run = read_run(write_run(tmp_path / "a.h5", position, velocity))
    found = fields.fields(run, [0, 1, 2, 3], (2, 1))
    assert found["density"] == pytest.approx(4)
    assert found["flow_x"] == pytest.approx(1) and found["flow_y"] == pytest.approx([2, 0])
    assert found["temperature"] == pytest.approx([0, 2 * run.mass[0]])
    assert found["stress_xx"] == pytest.approx([0, 16 * run.mass[0]])
    assert found["stress_yy"] == pytest.approx(0) and found["heat_x"] == pytest.approx(0)


def test_without_fluxes_the_law_is_a_gas_at_rest_of_that_pressure(ricochet, tmp_path):
    write_input(tmp_path, WALLS.format(speed=0))
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    run = read_run(tmp_path / "gas.h5")
    eta = 0.3
    pressure = 4 * eta / np.pi * 2 * hard_disks.henderson(eta)
    flux = fields.Fluxes(pressure, 0.0, 0.0)
    law = fields.expected(run, 0, np.linspace(1, 19, 7), flux, (0.5, 2.0))
    assert law == pytest.approx(np.tile([0.5, 2, 4 * eta / np.pi], (7, 1)))


def test_the_law_carries_the_fluxes(ricochet, tmp_path):
    """Its gradients times viscosity and conductivity are what passes from wall to wall."""
    write_input(tmp_path, WALLS.format(speed=0))
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    run = read_run(tmp_path / "gas.h5")
    flux, x = fields.Fluxes(1.2, -0.05, 0.1), np.linspace(1, 19, 181)
    u, kt, density = fields.expected(run, 0, x, flux, (0.0, 2.0)).T
    eta = np.pi * density / 4
    z = hard_disks.henderson(eta)
    assert density * kt * z == pytest.approx(1.2)
    shear = -density * hard_disks.enskog_viscosity(z, eta, 1.0, kt) * np.gradient(u, x)
    heat = -hard_disks.enskog_conductivity(z, eta, 1.0, kt) * np.gradient(kt, x)
    assert shear[1:-1] == pytest.approx(-0.05, rel=1e-3)
    assert (heat + shear * u)[1:-1] == pytest.approx(0.1, rel=2e-3)


def test_a_profile_and_a_map_are_drawn_with_their_numbers(ricochet, tmp_path, capsys):
    write_input(tmp_path, WALLS.format(speed=3))
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    path, table = tmp_path / "gas.h5", tmp_path / "a.csv"
    assert run_script("fields", path, "--cells", "5", "-o", tmp_path / "a.png", "--csv", table) == 0
    found = columns(table)
    assert found["x"] == pytest.approx([2, 6, 10, 14, 18])
    assert np.mean(found["density"]) == pytest.approx(0.2)
    assert (found["density_error"] > 0).all() and found["flow_y"][-1] > found["flow_y"][0]
    assert np.isfinite(found["flow_expected"]).all()
    grid = ("--grid", "4,2", "-o", tmp_path / "b.png", "--csv", table)
    assert run_script("fields", path, *grid) == 0
    assert len(columns(table)["x"]) == 8
    assert run_script("fields", path, "--cells", "1", "-o", tmp_path / "c.png") == 2
    assert "--cells" in capsys.readouterr().err


def test_rough_temperatures_follow_their_equations():
    xi, beta, q = 0.9, 0.3, 0.5
    tau = np.linspace(0, 5, 5001)
    t, r = theory.rough_temperatures(tau, (1.0, 0.2), xi, beta, q)
    a, b, c = theory.rough_rates(xi, beta, q)
    assert np.gradient(t, tau)[1:-1] == pytest.approx((-2 * (a * t - b * r))[1:-1], abs=1e-6)
    assert np.gradient(r, tau)[1:-1] == pytest.approx((4 * (b * t - c * r))[1:-1], abs=1e-6)
    late = theory.rough_temperatures(np.array([200.0]), (1.0, 0.0), xi, beta, q)
    assert late[1] / late[0] == pytest.approx(theory.rough_ratio(xi, beta, q))
    assert theory.rough_ratio(0.9, 0.0, 0.5) == pytest.approx(0.4695, abs=5e-5)
    assert theory.rough_ratio(0.9, 0.8, 0.5) == pytest.approx(1.0093, abs=5e-5)
    elastic = theory.rough_temperatures(tau, (1.0, 0.0), 1.0, 1.0, q)
    assert elastic[0] + elastic[1] / 2 == pytest.approx(1)  # nothing is lost


def test_the_steady_ratio_has_forgotten_its_start(monkeypatch):
    """Of runs that follow the law, whether they start without a spin or with too much of it."""
    law, tau = (0.9, 0.0, 0.5), np.linspace(0, 25, 251)
    runs = [(tau, *theory.rough_temperatures(tau, (1.0, start), *law)) for start in (0.0, 2.0)]
    monkeypatch.setattr(rough, "temperatures", lambda run: run)
    for run in runs:
        found = rough.steady_ratio([run], law).mean
        assert found == pytest.approx(theory.rough_ratio(*law), rel=rough.SETTLED)
    short = tuple(part[:51] for part in runs[0])
    assert rough.steady_ratio([short], law).mean == pytest.approx(
        np.mean(short[2][25:] / short[1][25:])
    )


def test_rough_gases_are_drawn_and_others_refused(ricochet, tmp_path, capsys):
    text = """&box upper = 60, 60 boundary = 'periodic', 'periodic' /
    &species count = 100 radius = 0.5 temperature = 1 / &contact restitution = 0.9 {} /
    &stop collisions_per_disk = 3 / &output observables_every_collisions = 20 /"""
    for name, law in {"a": "tangential_restitution = 0", "b": ""}.items():
        write_input(tmp_path, text.format(law))
        assert ricochet("gas.nml", "-o", f"{name}.h5").returncode == FINISHED
    assert run_script("rough", tmp_path / "a.h5", "-o", tmp_path / "a.png") == 0
    assert run_script("rough", tmp_path / "b.h5", "-o", tmp_path / "b.png") == 2
    assert "equal rough disks" in capsys.readouterr().err


def test_empty_cells_are_gaps_without_a_warning(ricochet, tmp_path, capsys, monkeypatch):
    """Disks at rest on the left; one passes above them, into the third of four cells."""
    write_input(
        tmp_path,
        """&box upper = 20, 10 / &stop time = 100 /
        &species count = 20 radius = 0.5 region = 0, 5, 0, 8 velocities = 'rest' /
        &species count = 1 radius = 0.5 position = 2, 9.4 velocity = 0.1, 0 /
        &output frames_every_time = 1 observables_every_time = 1 /""",
    )
    assert ricochet("gas.nml", "-o", "gas.h5").returncode == FINISHED
    plt.close("all")  # those of other tests: many open ones are a warning
    table = tmp_path / "a.csv"
    for cells in ("--cells", "4"), ("--grid", "4,1"):
        out = ("-o", tmp_path / "a.png", "--csv", table)
        words = map(str, ("fields.py", tmp_path / "gas.h5", *cells, *out))
        monkeypatch.setattr(sys, "argv", list(words))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            fields.main()
        assert capsys.readouterr().err == ""
        found = columns(table)
        assert found["flow_x"] == pytest.approx([0, 0.1, 0.1, np.nan], nan_ok=True)
        assert found["density"] == pytest.approx([0.4, 0.012, 0.008, 0], rel=0.1)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--cells", "1000000000"], "a profile has 2 to 100000 cells"),
        (["--cells", "1"], "a profile has 2 to 100000 cells"),
        (["--grid", "2000000,2000000"], "of 100000 cells at most"),
        (["--cells", "4", "--grid", "3,3"], "not allowed with"),
        (["--skip", "nan"], "is not a number from 0 on"),
        (["--skip", "-1"], "is not a number from 0 on"),
    ],
)
def test_options_without_a_meaning_are_refused(words, reason, capsys):
    assert run_script("fields", "a.h5", *words) == 2
    assert reason in capsys.readouterr().err


def test_a_profile_is_drawn_where_no_theory_fits_its_fluxes(ricochet, tmp_path, capsys):
    """Long before the steady state, the fluxes are those of nothing."""
    input_file = ROOT / "input/fourier.nml"
    run = ricochet(input_file, "-o", "a.h5", "--set", "stop.time=20")
    assert run.returncode == 0, run.stderr
    assert run_script("fields", tmp_path / "a.h5", "-o", tmp_path / "a.png") == 0
    said = capsys.readouterr()
    assert "warning: no gas has these fluxes" in said.err and "flow_expected" not in said.out
    assert (tmp_path / "a.png").exists()
