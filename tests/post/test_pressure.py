"""Pressure between two times, and the accessible area."""

import numpy as np
import pytest
from synthetic_run import written

from ricochet.reports.equilibrium import equation_of_state
from ricochet.reports.groups import Group
from ricochet.reports.result import Result
import ricochet
from ricochet import RunError, hard_disks

GAS = "&species name = 'a' radius = 0.02 count = 40 temperature = 1 /\n&stop time = 2 /\n"
OFTEN = "&output observables_every_time = 0.125 virial_tensor = .true. /\n"
SIDES = "&side name = 'right' {} /\n"
INPUTS = {
    "walls": "",
    "periodic": "&box boundary = 'periodic', 'periodic' /\n",
    "obstacle": "&obstacle centre = 0.5, 0.5 radius = 0.2 /\n",
    "container": "&obstacle centre = 0.5, 0.5 radius = 0.45 side = 'inside' /\n",
    "heated": SIDES.format("temperature = 2"),
    "oscillating": SIDES.format("motion = 'sine' amplitude = 0.05 period = 0.7"),
    "compressed": SIDES.format(
        "motion = 'constant_velocity' velocity = 0.1 start_time = 0.2 end_time = 1.5"
    ),
    "piston": SIDES.format("motion = 'piston' mass = 10 force = 50"),
    "sheared": "&box boundary = 'periodic', 'periodic' shear_rate = 1 /\n",
}


@pytest.fixture
def simulated(program, tmp_path, monkeypatch):
    """Run a gas with additional input."""
    monkeypatch.setenv("RICOCHET", str(program))
    path = tmp_path / "gas.h5"
    return lambda more, often=OFTEN: ricochet.run(GAS + often + more, output=path)


@pytest.mark.parametrize("kind", INPUTS)
def test_the_area_is_that_of_the_pressure_in_the_file(simulated, kind):
    """The program divides K + W / 2t by this area at each sample."""
    run = simulated(INPUTS[kind])
    time, pressure = run.observable("virial_pressure")
    virial = run.observable("virial").value
    kinetic = run.n_disks * run.observable("all/kinetic_energy").value
    if run.shear_rate:  # K is relative to the flow
        kinetic = run.observable("kinetic_tensor").value[:, [0, 3]].sum(axis=1) / 2
    late = time > 0
    own = (kinetic + virial / (2 * np.where(late, time, 1)))[late] / pressure[late]
    assert run.accessible_area(time)[late] == pytest.approx(own, rel=1e-12)


def test_the_pressure_of_a_whole_run_is_the_last_one_in_the_file(simulated):
    """They are equal if the kinetic energy is constant."""
    run = simulated(INPUTS["obstacle"])
    assert run.pressure(0, 2) == pytest.approx(
        run.observable("virial_pressure").value[-1], rel=1e-12
    )


def moment(run, frame) -> float:
    """Return the sum of m v (x - centre of the box) over all disks, whose mean rate is zero."""
    return float(np.sum(run.mass[:, None] * run.velocity[frame] * (run.position[frame] - (1, 0.5))))


def test_the_pressure_is_less_than_the_force_per_length_of_a_wall(simulated):
    """It is smaller by the factor 1 - 2 r / L (docs/explanation/laws.md)."""
    run = simulated("&box upper = 2, 1 /\n")
    (time,), (impulse,) = run.time[[-1]], run.observable("side_impulse").value[[-1]]
    (width, height), r = run.edges, run.radius[0]
    p_x, p_y = np.reshape(impulse, (2, 2)).mean(axis=1) / time / (height, width)
    force = (p_x * (1 - 2 * r / width) + p_y * (1 - 2 * r / height)) / 2
    force += (moment(run, -1) - moment(run, 0)) / (2 * width * height * time)
    assert run.observable("virial_pressure").value[-1] == pytest.approx(force, rel=1e-12)


@pytest.mark.parametrize("container", [False, True])
def test_each_disk_of_a_mixture_presses_at_its_own_distance(simulated, container):
    """A wall acts on the centre of a disk one radius away, in a box and in a container."""
    mixture = "&species name = 'b' radius = 0.05 count = 10 mass = 3 temperature = 1 /\n"
    mixture += "&box upper = 2, 1 /\n&output event_log = .true. /\n"
    if container:
        mixture += "&obstacle centre = 1, 0.5 radius = 0.48 side = 'inside' /\n"
    run = simulated(mixture, often="")
    log = run.event_log()
    hits = log.j <= 0
    half = np.full(hits.sum(), 0.48) if container else run.edges[-log.j[hits] // 2] / 2
    reach = half - run.radius[log.i[hits] - 1]
    force = log.impulse[hits] @ reach + moment(run, -1) - moment(run, 0)
    force /= 2 * run.accessible_area(run.time[-1]) * run.time[-1]
    assert run.observable("virial_pressure").value[-1] == pytest.approx(force, rel=1e-11)


@pytest.mark.parametrize("kind", ["walls", "heated", "sheared", "container"])
def test_the_trace_of_the_tensor_is_twice_the_pressure(simulated, kind):
    """This applies to any part of a run; parts of equal length average to the whole."""
    run = simulated(INPUTS[kind])
    for start, end in ((0, 2), (0.5, 1.25), (0.51, 1.2)):
        tensor = run.pressure_tensor(start, end)
        assert tensor.shape == (2, 2)
        assert np.trace(tensor) == pytest.approx(2 * run.pressure(start, end), rel=1e-12)
        assert tensor[0, 1] == pytest.approx(tensor[1, 0], rel=1e-9, abs=1e-9)
    halves = (run.pressure(0, 1) + run.pressure(1, 2)) / 2
    assert halves == pytest.approx(run.pressure(0, 2), rel=1e-12)
    assert run.pressure(0.51, 1.2) == run.pressure(0.5, 1.25)


def test_the_means_are_over_time(tmp_path):
    """The trapezoidal rule is applied to unequally spaced samples in a shrinking box."""
    still = np.zeros((3, 4, 2))
    steady = {"motion": "constant_velocity", "velocity": 0.25, "start_time": 0.0, "end_time": 2.0}
    run = written(
        tmp_path / "a.h5",
        still,
        still,
        time=[0.0, 0.5, 2.0],
        parameters={"side/right": steady},
        observables={"all/kinetic_energy": [1.0, 2.0, 4.0], "virial": [0.0, 1.0, 6.0]},
    )
    assert run.accessible_area(run.time) == pytest.approx([1, 0.875, 0.5])
    kinetic, area = (0.5 * 1.5 + 1.5 * 3) / 2, 0.75
    assert run.pressure(0, 2) == pytest.approx((4 * kinetic + 6 / (2 * 2)) / area)
    assert run.pressure(0.5, 2) == pytest.approx((4 * 3 + 5 / (2 * 1.5)) / 0.6875)
    with pytest.raises(RunError, match="no two samples"):
        run.pressure(0, 0.1)
    for times in ((2, 0), (1, 1), (0, np.nan)):
        with pytest.raises(RunError, match="must be below the second"):
            run.pressure(*times)
    for times in ((0, 1e9), (-1, 2), (0, 2.001), (5, 6)):
        with pytest.raises(RunError, match="extends from t = 0 to 2, not from"):
            run.pressure(*times)


def test_the_curve_of_a_mixture_ends_before_equal_disks_freeze(tmp_path):
    """Above, Henderson's equation continues, and the figure names the points without reference."""
    x, radius = np.random.default_rng(1).uniform(size=(1, 4, 2)), np.array([1, 1, 1.4, 1.4])
    run = written(tmp_path / "a.h5", x, x, radius=0.01 * radius)
    ways = {f"Z_{name}{end}": 20.0 for name in equation_of_state.WAYS for end in ("", "_error")}
    rows = [{"packing": 0.78, "Z_reference": None, **ways}]
    above, below = equation_of_state.draw(Result(rows, [Group(0.78, [run])])).figure().axes
    henderson, published = (line.get_xydata() for line in above.lines[:2])
    assert henderson[-1, 0] == pytest.approx(0.78)
    known = published[np.isfinite(published[:, 1]), 0]
    assert 0.63 < known.max() <= hard_disks.FLUID[-1, 0]
    assert "no reference for η = 0.78" in [text.get_text() for text in below.texts]
