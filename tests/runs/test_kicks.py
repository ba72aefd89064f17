"""Kicks: their laws, and that they leave no trace of how a run was done."""

import h5py
import numpy as np
import pytest

from whole_runs import FINISHED, STOPPED, USAGE, contents, differences, one_line, write_input

#: One of each kind, in systems that have something of everything.
KINDS = {
    "noise": "kind = 'noise' strength = 30 keep_momentum = .true.",
    "andersen": "kind = 'andersen' fraction = 0.2 temperature = 2 species = 'b'",
    "brownian": "kind = 'brownian' temperature = 0.5",
    "active": "kind = 'active' temperature = 0.5 speed = 3 rotational_diffusion = 20 species = 'a'",
}
#: The run ends with a kick, and samples are due at the moments of others.
SYSTEM = """&run threads = 1 /
&box boundary = {} /
&species name = 'a' count = 3000 packing_fraction = 0.2 temperature = 1 /
&species name = 'b' count = 2000 packing_fraction = 0.2 temperature = 1 mass = 2 /
&contact restitution = 0.9 wall_rule = 'normal' {} /
&drive interval = 0.0009765625 {} /
&stop time = 0.009765625 /
&output observables_every_time = 0.001953125 event_log = .true. /
"""
ROUGH = "tangential_restitution = 0.3 friction = 0.5 contact_time = 1e-5"
SYSTEMS = {
    "noise": SYSTEM.format("'periodic', 'periodic'", "", KINDS["noise"]),
    "andersen": SYSTEM.format("'wall', 'wall' gravity = 0, -9", ROUGH, KINDS["andersen"]),
    "brownian": SYSTEM.format("'periodic', 'wall'", ROUGH, KINDS["brownian"]),
    "active": SYSTEM.format("'periodic', 'periodic'", ROUGH, KINDS["active"]),
}
ONE = """&box boundary = 'periodic', 'periodic' /
&species count = 1 radius = 0.1 mass = 2 temperature = 0.6 /
&output frames_every_time = 0.01 /
"""
INTERVAL, KT, MASS = 0.01, 0.6, 2.0


@pytest.fixture(params=SYSTEMS)
def whole(request, ricochet, tmp_path):
    """The text of a system, run in one piece on one core as `whole.h5`."""
    write_input(tmp_path, SYSTEMS[request.param])
    assert ricochet("gas.nml", "-o", "whole.h5").returncode == FINISHED
    return tmp_path / "whole.h5"


def unlike(one, other) -> list[str]:
    return [name for name in differences(one, other) if not name.startswith("/parameters")]


def last(path) -> dict[str, bytes]:
    """All that the last samples say, but not how many came before."""
    return {
        name: value[-1].tobytes()
        for name, value in contents(path).items()
        if name.startswith(("/particles/disks", "/observables")) and name.endswith("/value")
    }


@pytest.mark.parametrize("option", ["run.queue=heap", "run.threads=2"])
def test_kicks_leave_no_trace_of_the_method(whole, ricochet, option):
    assert ricochet("gas.nml", "-o", "other.h5", "--set", option).returncode == FINISHED
    assert unlike(whole, whole.with_name("other.h5")) == []


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("search", ["pairs", "rescan"])
def test_kicks_leave_no_trace_of_the_search(ricochet, tmp_path, kind, search):
    write_input(tmp_path, SYSTEMS[kind].replace("000 ", "0 "))
    assert ricochet("gas.nml", "-o", "one.h5").returncode == FINISHED
    option = f"--set=run.search={search}"
    assert ricochet("gas.nml", "-o", "two.h5", option).returncode == FINISHED
    assert unlike(tmp_path / "one.h5", tmp_path / "two.h5") == []


def test_kicks_leave_no_trace_of_samples(whole, ricochet):
    """Not even where a sample is due at the moment of a kick: it comes after it."""
    often = ["output.observables_every_time=", "output.observables_every_events=301"]
    often += ["output.frames_every_time=0.0009765625"]
    options = [word for option in often for word in ("--set", option)]
    assert ricochet("gas.nml", "-o", "other.h5", *options).returncode == FINISHED
    assert last(whole) == last(whole.with_name("other.h5"))


@pytest.mark.parametrize("steps", [[], ["--set", "run.dynamics=steps", "--set", "run.dt=3e-4"]])
def test_a_driven_run_goes_on_where_it_was_stopped(whole, ricochet, steps):
    """At the very time of a kick, between two, and by its wall clock after a single step."""
    assert ricochet("gas.nml", "-o", "one.h5", *steps).returncode == FINISHED
    resume = []
    for time in (2**-10, 2.7e-3, 2**-8, 4.7e-3):
        stop = ["--set", f"stop.time={time}"]
        assert ricochet("gas.nml", "-o", "parts.h5", *steps, *stop, *resume).returncode == FINISHED
        resume = ["--resume"]
        stop = ["--set", "stop.wall_clock=1e-9"]
        assert ricochet("gas.nml", "-o", "parts.h5", *steps, *stop, *resume).returncode == STOPPED
    assert ricochet("gas.nml", "-o", "parts.h5", *steps, *resume).returncode == FINISHED
    assert unlike(whole.with_name("one.h5"), whole.with_name("parts.h5")) == []


def test_energy_balances_with_what_kicks_give(whole):
    found = contents(whole)
    total, lost, given = (
        found[f"/observables/{name}/value"]
        for name in ("total_energy", "dissipated_energy", "drive_energy")
    )
    assert abs(given[-1]) > 0 and lost[-1] > 0
    largest = max(abs(total).max(), abs(lost).max(), abs(given).max())
    assert abs(total + lost - given - total[0]).max() <= 1e-12 * largest


def test_energy_balances_where_kinetic_and_potential_energy_cancel(ricochet, tmp_path):
    """The sum over many disks is far smaller than its terms, and as exact as if it were not."""
    write_input(
        tmp_path,
        """&box lower = -0.5, 9.5 upper = 0.5, 10.5 gravity = 0, 0.1 /
        &species count = 5000 packing_fraction = 0.1 temperature = 1 /
        &drive kind = 'andersen' interval = 1e-5 fraction = 0.01 temperature = 1 /
        &stop time = 1e-4 / &output observables_every_time = 1e-5 /""",
    )
    assert ricochet("gas.nml", "-o", "a.h5").returncode == FINISHED
    found = contents(tmp_path / "a.h5")
    names = ("total_energy", "drive_energy", "dissipated_energy")
    total, given, lost = (found[f"/observables/{name}/value"] for name in names)
    assert abs(total).max() < 500 and abs(given).max() > 1
    assert np.ptp(total + lost - given) <= 1e-16 * 10_000  # of both


def test_energy_balances_from_rest_in_time_steps(ricochet, tmp_path):
    text = SYSTEM.format("'wall', 'wall'", ROUGH, KINDS["brownian"])
    write_input(tmp_path, text.replace("temperature = 1", "velocities = 'rest'"))
    steps = ["--set", "run.dynamics=steps", "--set", "run.dt=3e-4"]
    assert ricochet("gas.nml", "-o", "steps.h5", *steps).returncode == FINISHED
    test_energy_balances_with_what_kicks_give(tmp_path / "steps.h5")


def test_kicks_are_at_multiples_of_the_interval_and_no_events(ricochet, tmp_path):
    """One disk that meets nothing: its velocity changes at each kick, and only there."""
    drive = "&drive kind = 'brownian' interval = 0.1 temperature = 1 / &stop time = 1 /"
    write_input(tmp_path, ONE.replace("0.01", "0.05") + drive)
    assert ricochet("gas.nml", "-o", "run.h5", "--set", "box.upper=50,50").returncode == FINISHED
    found = contents(tmp_path / "run.h5")
    velocity = found["/particles/disks/velocity/value"][:, 0]
    changed = (velocity[1:] != velocity[:-1]).any(axis=1)
    assert changed.tolist() == [False, True] * 10
    assert found["/observables/collisions/value"][-1] == 0


def test_in_time_steps_kicks_wait_for_the_end_of_the_step(ricochet, tmp_path):
    drive = "&drive kind = 'brownian' interval = 0.25 temperature = 1 / &stop time = 1.1 /"
    write_input(tmp_path, ONE.replace("0.01", "0.1") + drive + "&run dynamics = 'steps' dt = 0.1 /")
    assert ricochet("gas.nml", "-o", "run.h5", "--set", "box.upper=50,50").returncode == FINISHED
    velocity = contents(tmp_path / "run.h5")["/particles/disks/velocity/value"][:, 0]
    changed = np.flatnonzero((velocity[1:] != velocity[:-1]).any(axis=1)) + 1
    assert changed.tolist() == [3, 5, 8, 10]


def frames(path) -> tuple[np.ndarray, np.ndarray]:
    """Unwrapped positions and velocities, (T,N,2)."""
    with h5py.File(path) as file:
        disks = file["particles/disks"]
        return disks["position/value"] + disks["image/value"][:], disks["velocity/value"][:]


def squares_of_blocks(position: np.ndarray, block: int) -> np.ndarray:
    """Squared displacements of one disk along both axes in blocks of frames."""
    return np.diff(position[::block, 0], axis=0).ravel() ** 2


def test_a_brownian_disk_diffuses(ricochet, tmp_path):
    """<dx**2> = 2 D t with D = (kT/m) interval/2, exactly."""
    drive = f"&drive kind = 'brownian' interval = {INTERVAL} temperature = {KT} /"
    write_input(tmp_path, ONE + drive + "&stop time = 200 /")
    assert ricochet("gas.nml", "-o", "run.h5").returncode == FINISHED
    position, velocity = frames(tmp_path / "run.h5")
    for block in (1, 7):
        squares = squares_of_blocks(position, block)
        expected = KT / MASS * INTERVAL * block * INTERVAL
        error = expected * np.sqrt(2 / len(squares))
        assert squares.mean() == pytest.approx(expected, abs=4 * error)
    speeds = velocity[:, 0] ** 2
    assert speeds.mean() == pytest.approx(KT / MASS, abs=4 * KT / MASS * np.sqrt(2 / speeds.size))


def test_an_active_disk_swims(ricochet, tmp_path):
    """<dr**2> = 4Dt + (2v**2/Dr**2) (Dr t - 1 + exp(-Dr t)).

    With a sum in place of an integral, as the orientation changes at kicks only.
    """
    v, rotation = 2.0, 0.7
    drive = f"&drive kind = 'active' interval = {INTERVAL} temperature = {KT} speed = {v}"
    drive += f" rotational_diffusion = {rotation} /"
    write_input(tmp_path, ONE.replace("count = 1", "count = 300").replace("0.1", "1e-6") + drive)
    stop = ["--set", "stop.time=4.01", "--set", "output.frames_every_time=4"]
    assert ricochet("gas.nml", "-o", "run.h5", *stop).returncode == FINISHED
    position, _ = frames(tmp_path / "run.h5")
    squares = ((position[1] - position[0]) ** 2).sum(axis=1)
    n, decay = 399, np.exp(-rotation * INTERVAL)  # the first interval is still that of the start
    lag = np.arange(1, n)
    persistent = n + 2 * ((n - lag) * decay**lag).sum()
    expected = 4 * (KT / MASS) * INTERVAL / 2 * 4 + (v * INTERVAL) ** 2 * persistent
    t = rotation * 4
    assert expected == pytest.approx(
        2 * KT / MASS * INTERVAL * 4 + 2 * v**2 / rotation**2 * (t - 1 + np.exp(-t)), rel=0.01
    )
    assert squares.mean() == pytest.approx(expected, abs=4 * squares.std() / np.sqrt(300))


def test_orientations_start_uniform_and_diffuse(ricochet, tmp_path):
    text = SYSTEM.format("'periodic', 'periodic'", "", KINDS["active"])
    write_input(tmp_path, text)
    assert ricochet("gas.nml", "-o", "run.h5").returncode == FINISHED
    angle = contents(tmp_path / "run.h5")["/particles/disks/orientation/value"]
    active, passive = angle[:, :3000], angle[:, 3000:]
    assert (passive == 0).all()
    assert abs(np.exp(1j * active[0]).mean()) < 4 / np.sqrt(3000)
    variance = 2 * 20 * 10 * 2**-10
    turned = (active[-1] - active[0]) ** 2
    assert turned.mean() == pytest.approx(variance, abs=4 * variance * np.sqrt(2 / 3000))


def gas(count, drive, restitution, seconds, boundary="'periodic', 'periodic'"):
    return f"""&box boundary = {boundary} /
&species count = {count} packing_fraction = 0.1 mass = 2 speed = 3 /
&contact restitution = {restitution} /
&drive {drive} / &stop time = {seconds} / &output observables_every_time = {seconds / 40} /
"""


def test_a_heat_bath_brings_maxwells_law(ricochet, tmp_path):
    """Also where collisions cost energy, if each kick reaches all disks; here right after one."""
    drive = "kind = 'andersen' interval = 0.01 fraction = 0.3 temperature = 0.7"
    write_input(tmp_path, gas(4000, drive, 1, 0.4, "'periodic', 'wall'"))
    assert ricochet("gas.nml", "-o", "run.h5").returncode == FINISHED
    velocity = contents(tmp_path / "run.h5")["/particles/disks/velocity/value"][-1]
    energy = np.sort((velocity**2).sum(axis=1))
    law = 1 - np.exp(-energy / 0.7)  # m v**2/2 over kT, m = 2
    rank = np.arange(1, 4001) / 4000
    assert abs(law - rank).max() < 1.63 / np.sqrt(4000)  # Kolmogorov and Smirnov, 1 %


def test_noise_holds_a_granular_gas_at_its_temperature(ricochet, tmp_path):
    """T/m = [strength/(sqrt(pi) (1 - xi**2) chi n sigma)]**(2/3): van Noije and Ernst, 1998."""
    count, packing, xi, strength = 500, 0.05, 0.9, 1.0
    drive = f"kind = 'noise' interval = 0.002 strength = {strength} keep_momentum = .true."
    text = gas(count, drive, xi, 8)
    write_input(tmp_path, text.replace("fraction = 0.1", f"fraction = {packing}"))
    assert ricochet("gas.nml", "-o", "run.h5").returncode == FINISHED
    found = contents(tmp_path / "run.h5")
    temperature = found["/observables/all/temperature/value"]
    diameter = 2 * np.sqrt(packing / (count * np.pi))
    chi = (1 - 7 * packing / 16) / (1 - packing) ** 2
    expected = 2 * (strength / (np.sqrt(np.pi) * (1 - xi**2) * chi * count * diameter)) ** (2 / 3)
    assert temperature[20:].mean() == pytest.approx(expected, rel=0.04)
    momentum = found["/observables/momentum/value"]
    assert abs(momentum - momentum[0]).max() < 1e-11 * count * np.sqrt(2 * expected)


@pytest.mark.parametrize("species", ["", "species = 'b'"])
def test_noise_without_keep_momentum_moves_the_whole(ricochet, tmp_path, species):
    """By as much as independent kicks do; with it by rounding alone, also for one species."""
    for keep in (".true.", ".false."):
        kind = f"kind = 'noise' strength = 30 keep_momentum = {keep} {species}"
        write_input(tmp_path, SYSTEM.format("'periodic', 'periodic'", "", kind))
        assert ricochet("gas.nml", "-o", "run.h5", "--force").returncode == FINISHED
        momentum = contents(tmp_path / "run.h5")["/observables/momentum/value"]
        mass2 = 2000 * 4 + (0 if species else 3000)
        moved, free = abs(momentum[-1] - momentum[0]), np.sqrt(mass2 * 30 * 10 * 2**-10)
        assert (moved < 1e-9).all() if keep == ".true." else (moved < 5 * free).all()
        assert keep == ".true." or moved.max() > 0.05 * free


def test_what_was_met_last_is_met_again_after_a_kick(ricochet, tmp_path):
    """Two disks side by side are kicked together again and again: no hit is taken for the last."""
    write_input(
        tmp_path,
        "&species count = 2 radius = 0.1 position = 0.1, 0.5, 0.3, 0.5 /"
        "&box upper = 0.400001, 1 / &contact restitution = 0.99 contact_time = 1e-12 /"
        "&drive kind = 'brownian' interval = 1e-3 temperature = 1 / &stop time = 3 /"
        "&output frames_every_time = 1e-3 observables_every_time = 1e-3 /",
    )
    run = ricochet("gas.nml", "-o", "run.h5")
    assert run.returncode == FINISHED, run.stderr
    place = contents(tmp_path / "run.h5")["/particles/disks/position/value"]
    assert np.linalg.norm(place[:, 1] - place[:, 0], axis=1).min() > 0.2 * (1 - 1e-12)
    assert place[..., 0].min() > 0.1 - 1e-12 and place[..., 0].max() < 0.300001 + 1e-12
    test_energy_balances_with_what_kicks_give(tmp_path / "run.h5")


def test_the_kicks_of_a_disk_are_its_own(ricochet, tmp_path):
    """They do not depend on who else there is, nor on where a disk is in memory."""
    drive = "&drive kind = 'brownian' interval = 0.1 temperature = 1e-4 / &stop time = 1 /"
    disk = "&species count = 1 radius = 0.01 position = 0.9, 0.9 /"
    write_input(tmp_path, disk + drive, "one.nml")
    others = "&species grid = 20, 20 radius = 0.01 region = 0, 0.8, 0, 0.8 /"
    write_input(tmp_path, disk + others + drive, "many.nml")
    found = []
    for name in ("one", "many"):
        assert ricochet(f"{name}.nml", "-o", f"{name}.h5").returncode == FINISHED
        found.append(contents(tmp_path / f"{name}.h5")["/particles/disks/velocity/value"][-1, 0])
    assert found[0].tolist() == found[1].tolist()


def test_a_gas_at_rest_waits_for_its_kick(ricochet, tmp_path):
    """Nothing can happen before it, and no rule names a time."""
    drive = "&drive kind = 'noise' interval = 7 strength = 1 / &stop collisions = 1000 /"
    write_input(tmp_path, "&species count = 100 radius = 0.01 velocities = 'rest' /" + drive)
    run = ricochet("gas.nml", "-o", "run.h5")
    assert run.returncode == FINISHED and "note" not in run.stdout
    assert "kicks = 1\n" in run.stdout and "collisions = 1000\n" in run.stdout


def test_a_driven_gas_does_not_end_for_being_cold(ricochet, tmp_path):
    """Its temperature falls below 1e-25 of the first between two kicks."""
    write_input(
        tmp_path,
        "&box boundary = 'periodic', 'periodic' /"
        "&species count = 50 packing_fraction = 0.4 temperature = 1 /"
        "&contact restitution = 0.7 contact_time = 1e-9 / &stop time = 2e16 /"
        "&drive kind = 'noise' interval = 1e16 strength = 1e-60 /",
    )
    run = ricochet("gas.nml", "-o", "run.h5")
    assert run.returncode == FINISHED and "note" not in run.stdout
    assert "time = 2e16" in run.stdout


ACTIVE = "kind = 'active' interval = 0.1 temperature = 1 speed = 1 "
BASE = "&species name = 'a' count = 9 radius = 0.01 speed = 1 / &stop time = 1 /"


@pytest.mark.parametrize(
    ("drive", "names"),
    [
        ("kind = 'noise' strength = 1", ["drive.kind", "drive.interval"]),
        ("kind = 'noise' interval = 0 strength = 1", ["drive.interval"]),
        ("kind = 'noise' interval = 0.1", ["drive.kind", "drive.strength"]),
        ("kind = 'noise' interval = 1e-20 strength = 1", ["drive.interval", "stop.time"]),
        ("kind = 'brownian' interval = 0.1", ["drive.kind", "drive.temperature"]),
        ("kind = 'brownian' interval = 0.1 temperature = 0", ["drive.temperature"]),
        ("kind = 'andersen' interval = 0.1 temperature = 1 fraction = 0", ["drive.fraction"]),
        ("kind = 'andersen' interval = 0.1 temperature = 1 fraction = 1.1", ["drive.fraction"]),
        ("kind = 'active' interval = 0.1 temperature = 1", ["drive.kind", "drive.speed"]),
        ("kind = 'brownian' interval = 0.1 temperature = 1 speed = 1", ["drive.speed", "kind"]),
        (ACTIVE + "strength = 1", ["drive.strength", "kind"]),
        (ACTIVE + "keep_momentum = .true.", ["keep_momentum", "kind"]),
        ("kind = 'noise' interval = 0.1 strength = 1 species = 'b'", ["drive.species", "known: a"]),
        ("strength = 1", ["drive.strength", "kind = 'none'"]),
        (ACTIVE + "/ &stop energy_fraction = 0.5", ["stop.energy_fraction", "drive.kind"]),
    ],
)
def test_what_does_not_go_together_is_refused(ricochet, tmp_path, drive, names):
    base = BASE.replace("&stop time = 1 /", "") if "&stop" in drive else BASE
    write_input(tmp_path, f"{base}&drive {drive} /")
    run = ricochet("gas.nml", "--check")
    assert run.returncode == USAGE
    line = one_line(run)
    assert all(name in line for name in names), line


def test_a_disk_that_can_meet_nothing_is_refused_an_end_by_events(ricochet, tmp_path):
    """Kicks go on for ever; with walls, or until a time, the same is sound."""
    drive = "&drive kind = 'brownian' interval = 1 temperature = 1 / &stop events = 9 /"
    write_input(tmp_path, ONE + drive)
    run = ricochet("gas.nml", "--check")
    assert run.returncode == USAGE and "drive.kind" in one_line(run)
    for option in ("box.boundary='wall','periodic'", "stop.time=1"):
        assert ricochet("gas.nml", "--check", "--set", option).returncode == FINISHED
