"""Recycled disks in Python, in figures and in the player; the rate of a hopper and its law."""

import numpy as np
import pytest

import player
import ricochet
import trajectory
from ricochet import ProgramError, RunError, Simulation, read_run, statistics
from ricochet.analysis.correlations import Correlator
from ricochet.reading.nature import Refused
from ricochet.reports.grains import discharge
from synthetic_run import run_script, write_run

HOPPER = """&box upper = 1, 2 gravity = 0, -1 boundary = '{}', 'wall' /
&wall name = 'left' from = 0, 0.6 to = 0.3, 0.4 / &wall from = 1, 0.6 to = 0.7, 0.4 /
&species name = 'grain' count = 40 radius = 0.02 region = 0, 1, 0.7, 2 /
&drive kind = 'recycle' interval = 0.05 from_region = 0, 1, 0, 0.3 to_region = 0, 1, 1.5, 2
velocity = 0.3, -0.5 / &contact restitution = 0.8 contact_time = 1e-4 /
&stop time = 5 / &output frames_every_time = 0.2 observables_every_time = 0.2 /
"""


@pytest.fixture(params=["wall", "periodic"])
def run(simulated, request):
    return simulated(HOPPER.format(request.param))


def test_displacements_are_refused_and_other_quantities_are_not(run):
    assert run.recycled[-1].sum() == run.observable("recycled").value[-1] > 20
    assert {"recycled", "gravity"} <= run.nature and run.nature.driven
    for use in (
        lambda: run.unwrapped(0),
        lambda: run.displacement(-1),
        lambda: Correlator(run, run.time),
    ):
        with pytest.raises(Refused, match="recycles disks"):
            use()
    assert run.speed(-1).max() > 0


def test_paths_are_interrupted_where_a_disk_is_recycled(run):
    frames = list(range(run.n_frames))
    paths = trajectory.paths_of(run, list(range(run.n_disks)), frames)
    jumps = 0
    for disk, path in enumerate(paths):
        steps = np.diff(path[:, 1])
        jumps += np.isnan(path[1:-1, 0]).sum()
        assert np.nanmax(steps) < 0.8, f"disk {disk + 1}: no line upwards into the upper region"
    assert jumps >= (np.diff(run.recycled[:], axis=0) > 0).sum() > 20


FLIGHTS = """return Array.from({ length: disks }, (_, i) => flights(i, first(), last())).flat()
  .map(({ from, to }) => to[1] - from[1])"""


def test_the_player_draws_no_line_where_a_disk_is_recycled(playing, run):
    facts, blocks = player.film(run, [0, 5, run.n_frames - 1], "speed", [])
    assert "displacement" not in facts["scales"] and facts["recycling"]
    counts = np.frombuffer(blocks["recycled"], "u1").reshape(3, -1)
    assert (counts == run.recycled[[0, 5, run.n_frames - 1]] % 256).all()
    upwards = playing(run.path).run(FLIGHTS)
    assert len(upwards) > run.n_disks and max(upwards) < 0.8


def test_the_engine_counts_recycled_disks_and_checks_changes(program, monkeypatch):
    monkeypatch.setenv("RICOCHET", str(program))
    with Simulation(HOPPER.format("wall")) as box:
        box.advance(time=2)
        assert box.recycled.sum() == box.observable("recycled") > 0
        for change in (
            {"drive.to_region": (0, 1, 0.4, 1)},  # across the walls
            {"drive.kind": "none"},
            {"drive.from_region": (0, 1, 0, 1.8)},
        ):
            with pytest.raises(ProgramError):
                box.change(change)
        before = box.recycled.sum()
        box.change({"drive.from_region": (0, 1, 0, 0.01)})  # where no disk can be
        assert box.advance(time=3).recycled.sum() == before
        box.change({"drive.from_region": (0, 1, 0, 0.3), "drive.velocity": (0, 0)})
        assert box.advance(time=3.2).recycled.sum() > before
    gas = "&species count = 2 radius = 0.1 speed = 1 / &stop time = 1 /"
    with Simulation(gas) as box, pytest.raises(AttributeError):
        assert box.recycled


def mouths(folder, widths, k, c, count=200, **grain):
    """Write runs with the rate C sqrt(g / d) (D / d - k)^(3/2), where d = 0.02 and g = 4."""
    folder.mkdir(exist_ok=True)
    paths = []
    for width in widths:
        rate = c * np.sqrt(4 / 0.02) * (width / 0.02 - k) ** 1.5
        time = np.linspace(0, 20, count)
        parameters = {"drive": {"kind": "recycle"}, "box": {"gravity": [0.0, -4.0]}}
        parameters |= {"species/disk": grain} if grain else {}
        walls = [((0, 1), (0.5 - width / 2, 0.5)), ((1, 1), (0.5 + width / 2, 0.5))]
        paths.append(
            write_run(
                folder / f"{width}.h5", np.full((1, 5, 2), width), np.zeros((1, 5, 2)), radius=0.01,
                walls=walls, observables={"recycled": rate * time}, observable_time=time,
                parameters=parameters,
            )
        )  # fmt: skip
    return paths


def test_the_rate_of_a_hopper_follows_the_law_that_it_has(tmp_path, capsys):
    """The fits return the parameters with which the rates were generated."""
    paths = mouths(tmp_path, (0.1, 0.15, 0.2, 0.3), k=1.4, c=0.7)
    rows = discharge.measured_rates([read_run(path) for path in paths], 4).rows
    assert [row["D_over_d"] for row in rows] == [5, 7.5, 10, 15]
    x, y = (np.array([row[name] for row in rows]) for name in ("D_over_d", "W_reduced"))
    per_time = np.array([row["W"] for row in rows])
    assert per_time == pytest.approx(0.7 * (x - 1.4) ** 1.5 * np.sqrt(4 / 0.02), rel=1e-6)
    assert y == pytest.approx(0.7 * (x - 1.4) ** 1.5, rel=1e-6)
    found = discharge.fitted(x, y)
    assert [one[0] for one in found.values()] == pytest.approx([0.7, 1.4, 1.5], rel=1e-5)
    (fit,) = ricochet.analyse("discharge", paths).further[0]
    assert fit["k"] == pytest.approx(1.4, rel=1e-5)
    for some, lines in ((paths, True), (paths[:2], False)):
        notes = ricochet.analyse("discharge", some).notes
        assert any("Lines: fits" in note for note in notes) == lines
    assert run_script("discharge", *paths, "-o", tmp_path / "rate.png") == 0
    assert " 1.4 " in capsys.readouterr().out.splitlines()[-2]


@pytest.mark.parametrize("widths", [3, 4])
@pytest.mark.parametrize("runs", [1, 3])
def test_68_of_100_fits_hold_the_law_however_few_the_widths(rng, widths, runs):
    """The errors of the rates are estimated from the scatter of points or of three runs."""
    held = []
    for _ in range(200):
        c, k = rng.uniform(0.5, 2), 1.4
        x = np.sort(rng.uniform(4, 7) * np.geomspace(1, rng.uniform(2, 4), widths))
        y = c * (x - k) ** 1.5 * (1 + rng.uniform(0.005, 0.03) * rng.normal(size=(runs, widths)))
        own = statistics.estimate(y) if runs > 1 else y
        fit = discharge.fitted(x, *own, *[runs] * (runs > 1))
        truth = zip(fit.values(), (c, k, 1.5), strict=True)
        held.append([abs(one.mean - true) < one.error for one, true in truth])
    assert np.mean(held, axis=0) == pytest.approx(0.6827, abs=4 * 0.033)
    assert np.mean(held) == pytest.approx(0.6827, abs=0.09)


def test_a_rate_of_drawn_radii_has_the_error_of_their_scatter(tmp_path):
    """Each seed has its own sample of radii; one run says nothing about the others."""
    drawn = {"polydispersity": 0.1}
    paths = [mouths(tmp_path / f"{c}", (0.2,), k=1.4, c=c, **drawn)[0] for c in (0.9, 1.0, 1.1)]
    runs = [read_run(path) for path in paths]
    found = discharge.measured_rates(runs, 4)
    (row,) = found.rows
    assert row["W_error"] / row["W"] == pytest.approx(0.1 * statistics.student(3) / 3**0.5)
    assert found.complete and found.independent == [3]
    single = discharge.measured_rates(runs[:1], 4)
    assert not single.complete and "samples of radii" in single.warnings[0]
    alike = [read_run(mouths(tmp_path / "alike", (0.2,), k=1.4, c=1.0)[0])]
    assert discharge.measured_rates(alike, 4).complete


def test_the_rate_of_one_mouth_is_drawn_against_time(tmp_path):
    """The lines of the rate and of the number of disks meet the measured curves at the end."""
    runs = [read_run(path) for path in mouths(tmp_path, (0.2,), k=1.4, c=0.7)]
    result = ricochet.analyse("discharge", runs)
    left, right = result.figure().axes
    measured, line, *_ = left.lines
    assert line.get_ydata()[-1] == pytest.approx(measured.get_ydata()[-1])
    assert right.lines[1].get_ydata() == pytest.approx(2 * [result.table[0]["W"]])


def test_what_is_no_refilled_hopper_is_refused(run, tmp_path):
    with pytest.raises(RunError, match="samples after"):
        discharge.rate(run, 100)
    still = write_run(tmp_path / "still.h5", np.zeros((1, 5, 2)), np.zeros((1, 5, 2)))
    with pytest.raises(Refused, match="recycles no disks"):
        discharge.rate(read_run(still), 0)
    with pytest.raises(Refused, match="no mouth"):
        discharge.mouth(read_run(still))
