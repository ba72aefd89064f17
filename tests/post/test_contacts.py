"""Contact networks satisfy the momentum balance of each disk; chains satisfy their definition."""

import csv

import numpy as np
import pytest

from ricochet import RunError, contacts, read_run
from synthetic_run import ROOT, run_script

BED = """&box gravity = 0, -1 boundary = 'periodic', 'wall' /
&obstacle centre = 0.5, 0.3 radius = 0.1 /
&species name = 'light' count = 40 radius = 0.03 region = 0, 1, 0.45, 1 speed = 0.3 /
&species name = 'heavy' count = 8 radius = 0.06 mass = 4 region = 0, 1, 0.45, 1 speed = 0.3 /
&contact restitution = 0.8 contact_time = 1e-3 /
&stop time = 2 /
&output frames_every_time = 0.5 event_log = .true. /"""


@pytest.fixture
def bed(simulated):
    return simulated(BED)


@pytest.mark.parametrize(("first", "last"), [(0, -1), (1, 2), (3, 4)])
def test_contacts_carry_the_momentum_of_each_disk(bed, first, last):
    """The momentum of a disk changes by the sum over its contacts and by its weight."""
    start, end = bed.time[first], bed.time[last]
    found = contacts.network(bed, start, end)
    gained, pairs = np.zeros((bed.n_disks, 2)), found.pairs
    np.add.at(gained, found.i - 1, found.momentum)
    np.subtract.at(gained, found.j[pairs] - 1, found.momentum[pairs])
    gained += bed.mass[:, None] * bed.gravity * (end - start)
    change = bed.mass[:, None] * (bed.velocity[last] - bed.velocity[first])
    assert np.abs(change).max() > 0.1
    np.testing.assert_allclose(gained, change, atol=1e-10)


def test_each_collision_belongs_to_one_contact(bed):
    log = bed.event_log()
    found, window = contacts.network(bed), contacts.network(bed, 0.5, 1.25)
    assert found.contacts.sum() == len(log.time) and np.all(
        found.i[found.pairs] < found.j[found.pairs]
    )
    assert found.impulse.sum() == pytest.approx(log.impulse.sum(), rel=1e-12)
    assert len({*zip(found.i.tolist(), found.j.tolist(), strict=True)}) == len(found.i)
    assert {-2, -4} <= {*found.j.tolist()}  # the bottom and the obstacle
    seen = (log.time > 0.5) & (log.time <= 1.25)
    assert window.contacts.sum() == seen.sum() > 100
    np.testing.assert_allclose(window.force * 0.75, window.impulse)
    assert np.all(np.hypot(*window.momentum.T) <= window.impulse * (1 + 1e-12))


def test_matrices_and_tables_contain_all_contacts(bed):
    found = contacts.network(bed, 1, 2)
    for name in ("contacts", "impulse", "force"):
        matrix = found.matrix(bed.n_disks, name)
        assert matrix.shape == (48, 48) and abs(matrix - matrix.T).max() == 0
        assert matrix.sum() == pytest.approx(2 * getattr(found, name)[found.pairs].sum())
    pytest.importorskip("pandas")
    table = found.to_dataframe()
    assert list(table.columns[:5]) == ["i", "j", "contacts", "impulse", "force"]
    assert table.momentum_y.sum() == pytest.approx(found.momentum[:, 1].sum())


def test_chains_are_connected_by_strong_contacts():
    i, j = np.array([[1, 2, 3, 4, 6, 7, 8, 9], [2, 3, 4, 5, 7, 8, 0, 10]])
    impulse = np.array([5, 5, 0.1, 5, 4, 4, 100, 0.2])  # the boundary does not count
    found = contacts.ContactNetwork(i, j, i, impulse, np.zeros((8, 2)), 0.0, 2.0)
    assert contacts.strong_contacts(found).tolist() == [
        True,
        True,
        False,
        True,
        True,
        True,
        False,
        False,
    ]
    assert sorted(chain.tolist() for chain in contacts.chains(found)) == [[1, 2, 3], [6, 7, 8]]
    assert [chain.tolist() for chain in contacts.chains(found, 1.3)] == [[1, 2, 3]]
    first, second, last = contacts.chains(found, at_least=2)
    assert last.tolist() == [4, 5] and len(first) == len(second) == 3
    assert contacts.chains(found, 0.0)[0].tolist() == [1, 2, 3, 4, 5]
    nothing = contacts.ContactNetwork(*(a[:0] for a in found[:5]), 0.0, 1.0)
    assert contacts.chains(nothing) == []


def test_the_script_draws_the_network_and_writes_its_contacts(bed, tmp_path, capsys):
    path = tmp_path / "contacts.csv"
    figure = tmp_path / "contacts.png"
    words = ("--from", "1", "--until", "2", "-o", figure, "--contacts", path)
    assert run_script("contacts", bed.path, *words) == 0 and figure.stat().st_size > 10000
    found = contacts.network(bed, 1, 2)
    with path.open(newline="") as file:
        rows = [*csv.DictReader(file)]
    assert [int(row["contacts"]) for row in rows] == found.contacts.tolist()
    assert [float(row["impulse"]) for row in rows] == found.impulse.tolist()
    assert str(int(found.pairs.sum())) in capsys.readouterr().out


def test_a_run_without_log_and_a_window_outside_are_answered_in_one_line(bed, simulated, capsys):
    for words in (("--from", "3"), ("--from", "1", "--until", "9"), ("--from", "-1")):
        assert run_script("contacts", bed.path, *words) == 2
        said = capsys.readouterr().err
        assert "has no window from" in said and "it ends at 2" in said and said.count("\n") == 1
    other = simulated(BED.replace(" event_log = .true.", ""), name="other")
    with pytest.raises(RunError, match=r"has no event log, set output.event_log = .true."):
        contacts.network(read_run(other.path))
    assert run_script("contacts", ROOT / "input" / "gas.nml") == 2
