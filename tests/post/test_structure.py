"""Structure and time correlations of synthetic runs, compared with exact results."""

import pickle
from itertools import pairwise

import numpy as np
import pytest
import scipy

import ricochet
from ricochet.reports.equilibrium import correlations
import snapshot
from ricochet import (
    RunError,
    Simulation,
    correlations as pairs,
    estimates,
    hard_disks as hd,
    statistics,
    structure,
    transport,
)
from ricochet.analysis.structure import largest_cluster
from ricochet.figures.drawing import values_of
from ricochet.reading.nature import Refused
from ricochet.reading.reader import read_run
from sampling import STATISTICS, held_as_often_as_stated, samples
from synthetic_gases import gas
from synthetic_run import run_script, written

PERIODIC = (True, True)


# --- structure ---


@pytest.mark.parametrize("periodic", [PERIODIC, (False, False), (True, False)])
def test_points_at_random_are_not_correlated(tmp_path, rng, periodic):
    x = rng.uniform(size=(60, 1000, 2))
    run = written(tmp_path / "run.h5", x, x, periodic=periodic)
    g = structure.pair_correlation(run, list(range(60)), np.linspace(1, 6, 6))
    np.testing.assert_allclose(g, 1, atol=0.05)
    if not all(periodic):
        with pytest.raises(Refused, match="has walls"):
            structure.structure_factor(run, [0], np.array([0.1, 1.0]))


def test_pairs_are_counted_in_the_box_of_the_moment(tmp_path, rng):
    """A side compresses the disks; frames without disks far from walls yield no result."""
    time, stroke = (
        np.arange(60.0),
        {"motion": "constant_velocity", "velocity": 0.01, "start_time": 0.0, "end_time": 50.0},
    )
    x = rng.uniform(size=(60, 1000, 2))
    x[..., 0] *= 1 - 0.01 * np.minimum(time, 50)[:, None]
    x[-1] = 0.01
    run = written(tmp_path / "run.h5", x, x, time=time, parameters={"side/right": stroke})
    edges, frames = np.linspace(1, 6, 6), list(range(60))
    g = structure.pair_correlation(run, frames, edges)
    np.testing.assert_allclose(g, 1, atol=0.05)
    assert np.isnan(structure.pair_correlation(run, [59], edges)).all()
    np.testing.assert_allclose(
        structure.averaged(structure.pair_correlation, [run], [frames], edges).y, g, atol=0.02
    )


def test_the_structure_factor_of_points_at_random_is_1_of_a_lattice_n(tmp_path, rng, monkeypatch):
    x = rng.uniform(size=(60, 500, 2))
    gas = written(tmp_path / "gas.h5", x, x, periodic=PERIODIC)
    edges = np.array([0, 0.12, 0.3, 0.6, 1.0])  # 2 pi / L = 0.126 in diameters
    for terms in (structure.MOST_TERMS, 1e4):
        monkeypatch.setattr(structure, "MOST_TERMS", terms)
        found = structure.structure_factor(gas, list(range(60)), edges)
        assert np.isnan(found[0]), "no wave is longer than the box"
        np.testing.assert_allclose(found[2:], 1, atol=0.15)
    x, sides = triangular(12, 14)
    lattice = written(tmp_path / "c.h5", [x], [x], edges=sides, periodic=PERIODIC, radius=0.5)
    monkeypatch.undo()
    first = 4 * np.pi / np.sqrt(3)  # Bragg peak, six wave vectors
    edges = first + np.array([-0.3, -0.01, 0.01])
    between, peak = structure.structure_factor(lattice, [0], edges)
    assert between == pytest.approx(0, abs=1e-9) and peak == pytest.approx(len(x))


@pytest.mark.parametrize("sides", [(1.0, 1.0), (1.5, 0.7)])
def test_a_structure_factor_is_the_mean_over_all_wave_vectors(tmp_path, rng, sides):
    """Each wave vector of the plane is used once, so that x and y are equivalent."""
    x = rng.uniform(size=(2, 40, 2)) * sides
    run = written(tmp_path / "run.h5", x, x, edges=sides, periodic=PERIODIC, radius=0.5)
    edges = np.array([3.0, 6.5, 9.5, 20.0])
    n = np.stack(np.meshgrid(*[np.arange(-9, 10)] * 2), axis=-1).reshape(-1, 2)
    k = 2 * np.pi * n / sides
    waves = np.abs(np.exp(1j * np.einsum("fna,ka->fnk", x, k)).sum(axis=1)) ** 2
    value, length = waves.mean(axis=0) / 40, np.linalg.norm(k, axis=1)
    known = [(length >= low) & (length < high) for low, high in pairwise(edges)]
    expected = [value[some].mean() for some in known]
    np.testing.assert_allclose(structure.structure_factor(run, [0, 1], edges), expected)


def test_partial_structures_are_those_of_each_pair_of_species_and_add_up(tmp_path, rng):
    x = rng.uniform(size=(60, 500, 2))
    mixed = {"species": np.arange(500) % 3 // 2 + 1, "names": ("a", "b"), "periodic": PERIODIC}
    run, frames = written(tmp_path / "run.h5", x, x, **mixed), list(range(60))
    share = np.array([run.of_species(name).mean() for name in run.names])
    couples = [(one, other) for one in run.names for other in run.names]
    for of, edges in (
        (structure.pair_correlation, np.array([1.0, 3.0, 6.0])),
        (structure.structure_factor, np.array([0.5, 1])),
    ):
        part = np.array([of(run, frames, edges, pair) for pair in couples]).reshape(2, 2, -1)
        ideal = 1.0 if of is structure.pair_correlation else np.eye(2)[..., None]
        np.testing.assert_allclose(part - ideal, 0, atol=0.1)
        weight = np.sqrt(np.outer(share, share))[..., None]
        if of is structure.pair_correlation:  # N N' - N pairs, of which N (N' - 1) were counted
            counts = 500 * share
            weight = np.outer(counts, counts) - np.diag(counts)
            weight = weight[..., None] / (500 * 499)
        np.testing.assert_allclose(np.sum(weight * part, axis=(0, 1)), of(run, frames, edges))


def test_the_structure_of_one_run_knows_that_its_frames_remember(tmp_path, rng):
    """Two configurations, each lasting half of the time, count as two independent frames."""
    places = rng.uniform(size=(2, 200, 2))
    run = written(tmp_path / "run.h5", *[np.repeat(places, 16, axis=0)] * 2, periodic=PERIODIC)
    parts = [slice(0, 16), slice(16, 32), slice(0, 32)]
    one, other, both = (correlations.structure([run], [part])[1] for part in parts)
    for name in ("g", "S"):
        apart = np.abs(one[name].y - other[name].y)
        assert np.all(both[name].error >= 0.35 * apart), name


def triangular(columns, rows):
    """Write a perfect triangular crystal in a periodic box."""
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    x = np.stack([i + 0.5 * (j % 2), j * np.sqrt(0.75)], axis=-1).reshape(-1, 2) + 0.2
    return x, (columns, rows * np.sqrt(0.75))


def test_a_crystal_is_in_order_and_points_at_random_are_not(tmp_path, rng):
    x, edges = triangular(12, 14)
    # Positions are perturbed, because the triangulation of a perfect crystal is not unique.
    x = x + rng.normal(0, 1e-6, x.shape)
    frames = np.stack([x, x])
    crystal = written(tmp_path / "c.h5", frames, frames, edges=edges, periodic=PERIODIC)
    np.testing.assert_allclose(structure.bond_order(crystal, 0), 1, atol=1e-4)
    np.testing.assert_allclose(values_of(crystal, 0, "psi6"), 0, atol=0.01)
    psi = [structure.bond_order(crystal, k) for k in (0, 1)]
    g6 = structure.bond_correlation(crystal, [0, 1], psi, np.array([40, 80, 120, 300]))
    np.testing.assert_allclose(g6, 1, atol=1e-4)
    assert run_script("snapshot", crystal.path, "--colour", "psi6", "-o", tmp_path / "a.png") == 0
    for colour, ends in {"psi6": (-180, 180), "speed": (0, 14)}.items():
        shown = snapshot.scale(np.full(9, 7.0), False, colour)
        assert (shown.vmin, shown.vmax) == ends
    assert run_script("player", crystal.path, "--colour", "psi6", "-o", tmp_path / "a.html") == 2
    turned = {"edges": edges[::-1], "periodic": PERIODIC}
    turned = written(tmp_path / "t.h5", frames[..., ::-1], frames, **turned)
    np.testing.assert_allclose(structure.bond_order(turned, 0), -1, atol=1e-4)
    x = rng.uniform(size=(2, 2000, 2))
    gas = written(tmp_path / "g.h5", x, x, periodic=PERIODIC)
    psi = structure.bond_order(gas, 0)
    assert 0.3 < np.mean(np.abs(psi)) < 0.45 and abs(psi.mean()) < 0.1
    (far,) = structure.bond_correlation(gas, [0], [psi], np.array([5, 25]))
    assert abs(far) < 0.01


def test_a_cluster_hangs_together_across_a_periodic_side_and_not_across_a_wall(tmp_path):
    """Three disks in a row across the side; small disks at the rim of a large one belong to it."""
    x = [(0.05, 0.5), (0.98, 0.5), (0.91, 0.5), (0.5, 0.5), (0.5, 0.77), (0.23, 0.5), (0.2, 0.1)]
    radius = np.array([0.035] * 3 + [0.2] + [0.06] * 2 + [0.035])
    for periodic, expected in ((True, 3), (False, 2)):
        sides = {"radius": radius, "periodic": (periodic, False)}
        run = written(tmp_path / "run.h5", [x], [x], **sides)
        assert largest_cluster(run, 0, 0.005) == expected
        assert largest_cluster(run, 0, 0.012) == 3


# --- motion ---


def flights(rng, count, time):
    """Return positions and velocities (T, count, 2) of points with velocity changes at rate 1.

    Each component is Gaussian with variance 1, so that <v(0) v(t)> / 2 = D'(t) = exp(-t).
    """
    x, v = np.empty((2, len(time), count, 2))
    for k in range(count):
        turns = np.cumsum(rng.exponential(size=int(time[-1] + 10 * np.sqrt(time[-1]) + 30)))
        turns = np.append(0, turns)
        speed = rng.normal(size=(len(turns), 2))
        place = np.cumsum(np.diff(turns, prepend=0)[:, None] * np.roll(speed, 1, axis=0), axis=0)
        last = np.searchsorted(turns, time, side="right") - 1
        v[:, k] = speed[last]
        x[:, k] = place[last] + (time - turns[last])[:, None] * speed[last]
    return x, v


@pytest.mark.parametrize(("step", "lag"), [(0.4, 8), (1.0, 4), (2.0, 2), (5.0, 2)])
def test_memory_and_diffusion_are_right_however_far_apart_frames_are(tmp_path, rng, step, lag):
    """The unit is the mean free time; displacements and slopes of each flight are exact.

    The disks of the second species are twice as fast.
    """
    count, time = 1000, step * np.arange(1200)
    species = np.arange(count) % 2 + 1
    x, v = (species[:, None] * of for of in flights(rng, count, time))
    image = np.floor(x).astype(int)
    sides = {"image": image, "time": time, "periodic": PERIODIC, "species": species}
    sides["names"] = "slow", "fast"
    run = written(tmp_path / "run.h5", x - image, v, **sides)
    early, late = np.exp(-step * np.array([lag // 2, lag]))
    expected = 1 - (early - late) / (step * (lag - lag // 2))
    found = transport.diffusion(run, slice(None), lag, *run.names)
    for square, both in zip((2.5, 1, 4), found, strict=True):
        for one in both:
            assert one.mean == pytest.approx(square * expected * (1 - 1 / count), abs=4 * one.error)
            assert one.error < 0.008 * square
    at = step * np.array([0, 1, 2, 4])
    found = pairs.curves([pairs.Correlator(run, run.time, lags=at).follow(run)])[run.names[0]]
    np.testing.assert_allclose(found["diffusion"].y, 1 - np.exp(-at), atol=0.015)
    np.testing.assert_allclose(found["vacf"].y / found["vacf"].y[0], np.exp(-at), atol=0.015)
    far = 4 * (at - 1 + np.exp(-at))
    np.testing.assert_allclose(found["msd"].y, far, rtol=0.015)


DECADES = np.append(0, np.geomspace(1e-3, 1e3, 61))
TIMES = {
    "equal steps": 0.1 * np.arange(400),
    "decades": DECADES,
    "both": np.unique(np.append(DECADES[:30], np.arange(1, 200.0))),
    "bursts": pairs.bursts(0.01, 100, 30, 400),
}


@pytest.mark.parametrize("times", TIMES.values(), ids=TIMES)
def test_each_lag_is_exact_whenever_frames_are(tmp_path, rng, times):
    """Disks of two species move freely across the sides."""
    species, reach, wave = np.arange(300) % 2 + 1, 0.7, 3.0
    v = rng.normal(size=(300, 2)) * np.sqrt(species)[:, None]
    v -= v.mean(axis=0)
    x = 0.3 + times[:, None, None] * v + 0.4 * times[:, None, None]  # the drift does not contribute
    image, still = np.floor(x).astype(int), np.zeros_like(x) + v
    parts = {"image": image, "time": times, "periodic": PERIODIC}
    run = written(tmp_path / "a.h5", x - image, still, species=species, names=("a", "b"), **parts)
    known = pairs.Correlator(run, times, [wave], reach).follow(run)
    lags, speed = known.lags, np.linalg.norm(v, axis=1)
    assert np.all(known.pairs.sum(axis=1) > 0) and lags[-1] > times[-1] / 2
    assert np.max(np.diff(np.log10(lags[2:]))) < 0.5
    assert len(known.held) == 0 and known.lags[0] == 0
    for name, curves in pairs.curves([known]).items():
        own = speed[species == "ab".index(name) + 1] if name != "all" else speed
        square = np.mean(own**2)
        way = np.outer(lags, own)
        law = {
            "msd": square * lags**2,
            "vacf": np.full(len(lags), square),
            "diffusion": square * lags / 2,
            "alpha2": np.full(len(lags) - 1, np.mean(own**4) / (2 * square**2) - 1),
            "overlap": np.mean(way < reach, axis=1),
            "F_s(3)": np.mean(scipy.special.j0(wave * way), axis=1),
        }
        for what, expected in law.items():
            found = curves[what].y[-len(expected) :]
            np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8, err_msg=what)


def test_a_correlator_keeps_few_samples_and_looks_at_many_lags(tmp_path, rng, monkeypatch):
    """It finds all lags of very many times by testing some of the pairs."""
    monkeypatch.setattr(pairs, "MOST_DISKS", 0)  # as for runs with very many pairs
    x = rng.uniform(size=(4000, 3, 2))
    run = written(tmp_path / "run.h5", x, x, time=np.arange(4000.0))
    known, most = pairs.Correlator(run, run.time), 0
    for place, velocity in zip(x, x, strict=True):
        known.add(place, velocity)
        most = max(most, len(known.held))
    assert most < 400 and known.lags[-1] > 3000
    np.testing.assert_array_equal(known.pairs.sum(axis=1)[:4], 4000 - known.lags[:4])
    lags = pairs.lags_of(0.5 * np.arange(10.0**5))
    assert lags[1] == 0.5 and np.allclose(2 * lags % 1, 0) and len(lags) > 40


def test_lags_with_few_pairs_beside_lags_with_many_are_left_out():
    """Frames at powers of ten have one pair at each lag, equally spaced frames have many."""
    decades = np.append(0, np.geomspace(0.001, 100, 51))
    lags = pairs.lags_of(np.unique(np.round(np.append(decades, np.arange(1, 101.0)), 9)))
    assert sum(lags < 1) > 25 and np.all(lags[lags > 1] % 1 == 0)
    assert lags[-1] > 90 and sum(lags > 1) > 15


def test_what_makes_no_lags_is_refused(tmp_path, rng):
    for times in ([], [1.0], [0.0, 1.0, 1.0], [2.0, 1.0]):
        with pytest.raises(ValueError, match="at least two times"):
            pairs.lags_of(np.array(times))
    for wrong in ((1, 0.1, 1, 4), (0, 1, 1, 4), (0.1, 1, 0, 4), (0.1, 1, 1, 0.5)):
        with pytest.raises(ValueError, match="bursts require"):
            pairs.bursts(*wrong)
    x = rng.uniform(size=(9, 4, 2))
    equal, mixed = (
        written(
            tmp_path / f"{names}.h5",
            x,
            x,
            species=1 + np.arange(4) // 3 % names,
            names="ab"[:names],
        )
        for names in (1, 2)
    )
    with pytest.raises(RunError, match="its disks are not those of"):
        pairs.measured([equal, mixed], skip=0)


MIXED = """&run seed = {seed} / &box boundary = 'periodic', 'periodic' /
&species name = 'a' count = 150 packing_fraction = {packing} temperature = 2 mass = 3 /
&species name = 'b' count = 150 packing_fraction = {packing} temperature = 2 /
&stop time = {until} / &output frames_every_time = 0.02 decades_from = 0.001 frames_per_decade = 5 /
"""


def test_the_table_contains_the_diffusion_of_each_species(simulated, monkeypatch):
    """The coefficient of all disks is the mean over the species."""
    text = MIXED.format(seed=1, packing=0.2, until=0.8).replace("count = 150", "count = 50", 1)
    run = simulated(text.replace("decades_from = 0.001 frames_per_decade = 5", ""))
    orders = {name: [statistics.correlated_mean(np.ones(9))] for name in correlations.ORDERS}
    monkeypatch.setattr(correlations, "structure", lambda *_: (orders, {}))
    (row,) = ricochet.analyse("correlations", run, equilibration=0.0).table
    for way in correlations.DIFFUSION:
        parts = [row[f"{way}_a"] / 4, 3 / 4 * row[f"{way}_b"]]
        assert row[way] == pytest.approx(sum(parts)) and row[f"{way}_b_error"] > 0
        assert row[f"{way}_a"] != row[f"{way}_b"]
    assert row["D_enskog"] is None and row["D_enskog_b"] > row["D_enskog_a"] > 0


@pytest.mark.parametrize("side", ["periodic", "wall"])
def test_what_is_found_on_the_fly_and_in_parts_is_that_of_the_file(simulated, tmp_path, side):
    """Results are bit-identical in one pass, for a growing file, and after stop and resume."""
    texts = [MIXED.format(seed=1, packing=0.2, until=until) for until in (0.5, 1.01)]
    texts = [text.replace("periodic", side) for text in texts]
    short, run = (simulated(text, name=f"{k}") for k, text in enumerate(texts))
    times = run.time[:-1]
    whole = pairs.Correlator(run, times, [30.0]).follow(run)
    grown = pairs.Correlator(short, times, [30.0]).follow(short)
    assert 20 < grown.done < len(times)
    with Simulation(texts[1]) as gas:
        flown = pairs.Correlator(gas, times, [30.0])
        for time in times[:20]:
            flown.add(*next(pairs.samples(gas, [time])))
        state, kept = gas.save(tmp_path / "gas.h5"), pickle.dumps(flown)
    with Simulation.load(state) as gas:
        resumed = pickle.loads(kept).follow(gas)
    for other in (grown.follow(run), resumed):
        assert other.done == len(times)
        np.testing.assert_array_equal(other.sums, whole.sums)
        np.testing.assert_array_equal(other.pairs, whole.pairs)


def test_the_figure_of_a_mixture_names_all_curves_and_marks_those_without_error(simulated):
    """A single run has no error at long lags; its curves of species differ in colour.

    The structure is calculated for all pairs of species.
    """
    run = simulated(MIXED.format(seed=1, packing=0.2, until=0.6))
    result = ricochet.analyse("correlations", run, equilibration=0.0, wavenumber=6.28)
    found, figure = result.groups[0].values, result.figure()
    panels = {axes.get_ylabel(): axes for axes in figure.axes}
    for label, pieces in (("F_s", ["all", "a", "b"]), ("S(k)", ["all", "a, a", "a, b", "b, b"])):
        (axes,) = (own for text, own in panels.items() if label in text)
        handles, names = axes.get_legend_handles_labels()
        assert names == pieces
        assert len({handle.get_color() for handle in handles}) == len(pieces)
    (axes,) = (own for text, own in panels.items() if "F_s" in text)
    pale, known = axes.lines[:2]
    assert pale.get_alpha() < 1 and np.all(np.isfinite(pale.get_ydata()))
    error = found.curves["F_s"].error
    assert np.array_equal(np.isnan(known.get_ydata()), np.isnan(error)) and np.isnan(error[-1])
    edges = correlations.bins(run)["g"]
    assert np.all(np.diff(edges) > 0) and edges[1] - edges[0] < 0.011


@STATISTICS
def test_disks_that_differ_by_their_mass_alone_have_the_structure_of_equal_ones(simulated):
    """The pressure determines g at contact, the compressibility 1 / (eta Z)' S at small k."""
    run = simulated(MIXED.format(seed=1, packing=0.1, until=10))
    eta, near, far = 0.2, np.array([1, 1.02]), np.array([0.01, 0.5])
    frames = [structure.evenly(run, most=200)]
    chi = hd.contact_value(hd.simulated(eta), eta)
    total = 2e-3 / np.diff([x * hd.simulated(x) for x in (eta - 1e-3, eta + 1e-3)])[0]
    for pair in (None, ("a", "a"), ("a", "b"), ("b", "b")):
        g, s = (
            structure.averaged(of, [run], frames, edges, pair)
            for of, edges in ((structure.pair_correlation, near), (structure.structure_factor, far))
        )
        assert g.y[0] == pytest.approx(chi, abs=4 * g.error[0]) and g.error[0] < 0.12 * chi
        own = 0.0 if pair == ("a", "b") else 1.0
        law = total if pair is None else own + (total - 1) / 2
        assert s.y[0] == pytest.approx(law, abs=4 * s.error[0]) and s.error[0] < 0.1


def test_a_dilute_mixture_flies_as_maxwells_law_has_it(simulated):
    """F_s = exp(-k^2 kT t^2 / 2 m) and <r^2> = 2 kT t^2 / m, within four errors of eight seeds."""
    runs = [
        simulated(MIXED.format(seed=seed, packing=1e-5, until=0.1), name=f"{seed}")
        for seed in range(8)
    ]
    found = pairs.measured(runs, waves=[20.0], skip=0)
    for name, mass in (("a", 3.0), ("b", 1.0)):
        lag, *f_s = (part[1:] for part in found[name]["F_s(20)"])
        msd, laws = found[name]["msd"], (np.exp(-400 * lag**2 / mass), 4 * lag**2 / mass)
        for (mean, error), law in ((f_s, laws[0]), ((msd.y[1:], msd.error[1:]), laws[1])):
            assert np.all(np.abs(mean - law) < 4 * error)
            assert np.all(error < 0.03 * np.maximum(law, law.max()))


@samples(8, 50)
def test_errors_of_one_run_hold_the_truth_as_often_as_they_say(tmp_path, rng, samples):
    """This applies to lags below an eighth of the run; longer lags have no errors."""
    time, held, lag = 0.5 * np.arange(400), [], np.array([0.5, 4.0, 20.0, 50.0])
    for k in range(samples):
        x, v = flights(rng, 8, time)
        run = written(tmp_path / f"{k}.h5", x, v, time=time)
        msd = pairs.curves([pairs.Correlator(run, time, lags=lag).follow(run)])["all"]["msd"]
        truth = 4 * (lag - 1 + np.exp(-lag))
        assert np.isnan(msd.error[-1])
        held.append(np.abs(msd.y - truth)[:-1] < msd.error[:-1])
    if samples < 50:
        assert held_as_often_as_stated(held)
    else:
        share = np.mean(held, axis=0)
        np.testing.assert_allclose(share, 2 * estimates.ONE_SIGMA - 1, atol=0.2)


@pytest.mark.parametrize(
    ("unusual", "said"),
    [
        ("&contact restitution = 0.9 /", "is not elastic"),
        ("&box boundary = 'periodic', 'periodic' shear_rate = 1 /", "is sheared"),
        (
            "&box boundary = 'periodic', 'wall' / "
            "&side name = 'top' temperature = 1 surface_velocity = 1 /",
            "sliding",
        ),
    ],
)
def test_what_has_no_steady_state_or_flows_has_no_memory(unusual, said):
    species = "&species count = 9 radius = 0.01 temperature = 1 / "
    with Simulation(species + unusual) as gas, pytest.raises(Refused, match=said):
        pairs.Correlator(gas, [0, 1])


# --- formulas ---


def test_enskog_is_boltzmann_in_a_dilute_gas():
    assert hd.speed_of_sound(1e-6) == pytest.approx(np.sqrt(2), rel=1e-4)
    eta = 1e-4
    viscosity = hd.enskog(1 + 2 * eta, eta, 0.01, kt=2.0, mass=3.0)["viscosity"]
    assert viscosity == pytest.approx(1.022 / 0.02 * np.sqrt(6 / np.pi), rel=1e-3)
    assert hd.long_time_tail(2.0, 5.0, 0.7, 0.3) == pytest.approx(1 / (80 * np.pi))


@pytest.mark.parametrize(
    ("parameters", "periodic", "said"),
    [
        ({}, True, None),
        ({}, False, "no D_displacement, D_velocities (calculated only in a periodic box)."),
        (
            {"contact": {"restitution": 0.8}, "drive": {"kind": "noise", "keep_momentum": True}},
            True,
            "no D_displacement, D_velocities (calculated only in equilibrium), "
            "no D_enskog (known only for undriven smooth elastic disks).",
        ),
    ],
)
def test_missing_diffusion_coefficients_have_a_reason(tmp_path, rng, parameters, periodic, said):
    path = gas(tmp_path / "a.h5", rng, parameters=parameters, periodic=(periodic, periodic))
    result = ricochet.analyse("correlations", [read_run(path)], equilibration=1)
    found = [note for note in result.notes if ": no D" in note]
    assert [note.partition(": ")[2] for note in found] == ([said] if said else [])
    row = result.table[0] if isinstance(result.table, list) else result.table.iloc[0]
    assert (row["D_displacement"] is None) == (said is not None)
